"""Reading detections out of a network's numbers: anchors, boxes from them, and one box of the many around a thing.

Source: W. Liu et al., SSD: Single Shot MultiBox Detector, ECCV 2016, 2.2 (anchors, codes of boxes); V. Bazarevsky et al.,
BlazeFace, 2019, 3 and 5 (a grid of anchors of one size; blending of boxes instead of suppression).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..arrays import Array, Indices


def grid_anchors(size_px: int, layers: Sequence[tuple[int, int]]) -> Array:
    """Centres of anchors that all have the size of the whole input.

    Args:
        size_px: width and height of the input.
        layers: (stride in px, anchors in each cell), in the order of the network.

    Returns:
        (N, 2) centres as shares of the input, row by row.
    """
    found = []
    for stride, each in layers:
        cells = -(-size_px // stride)
        middle = (np.arange(cells) + 0.5) / cells
        y, x = np.meshgrid(middle, middle, indexing="ij")
        found.append(np.repeat(np.stack([x.ravel(), y.ravel()], -1), each, axis=0))
    return np.concatenate(found)


def ssd_anchors(
    size_px: int, strides: Sequence[int], *, smallest: float, largest: float, ratios: Sequence[float]
) -> Array:
    """Anchors of a classical SSD: scales spaced evenly over the layers, ratios at each, one scale between neighbours.

    The lowest layer has three only: half its scale, and the second and third ratio.

    Args:
        size_px: width and height of the input.
        strides: of the layers, px.
        smallest: scale of the first layer, share of the input.
        largest: of the last.
        ratios: width over height; the first is 1.

    Returns:
        (N, 4) centre x, centre y, width, height as shares of the input.
    """
    scales = [*np.linspace(smallest, largest, len(strides)), 1.0]
    found = []
    for level, stride in enumerate(strides):
        if level == 0:
            shapes = [(smallest / 2, 1.0), *((scales[0], ratio) for ratio in ratios[1:3])]
        else:
            shapes = [(scales[level], ratio) for ratio in ratios]
            shapes.append((float(np.sqrt(scales[level] * scales[level + 1])), 1.0))
        sides = np.array([(scale * ratio**0.5, scale / ratio**0.5) for scale, ratio in shapes])
        centres = grid_anchors(size_px, [(stride, len(shapes))])
        found.append(np.concatenate([centres, np.tile(sides, (len(centres) // len(shapes), 1))], -1))
    return np.concatenate(found)


def sigmoid(values: Array) -> Array:
    """1 / (1 + exp(-values)), without overflow."""
    return np.asarray(0.5 * (1 + np.tanh(0.5 * np.asarray(values, float))))


def overlaps(box: Array, boxes: Array) -> Array:
    """Intersection over union of a box (4,) with boxes (N, 4); left, top, right, bottom."""
    low, high = np.maximum(box[:2], boxes[:, :2]), np.minimum(box[2:], boxes[:, 2:])
    both = np.prod(np.clip(high - low, 0, None), axis=-1)
    areas = np.prod(np.clip(boxes[:, 2:] - boxes[:, :2], 0, None), axis=-1)
    own = float(np.prod(np.clip(box[2:] - box[:2], 0, None)))
    return np.asarray(both / np.maximum(own + areas - both, 1e-12))


def groups(boxes: Array, scores: Array, overlap: float) -> list[Indices]:
    """Which boxes are of one thing: the best, and all that overlap it; then the best of the rest, and so on.

    Args:
        boxes: (N, 4) left, top, right, bottom.
        scores: (N,).
        overlap: intersection over union from which two are of one thing.

    Returns:
        Indices of each thing, its best box first; the things by score.
    """
    left = np.argsort(-scores, kind="stable")
    found = []
    while len(left):
        same = overlaps(boxes[left[0]], boxes[left]) >= overlap
        same[0] = True
        found.append(left[same])
        left = left[~same]
    return found


def suppressed(boxes: Array, scores: Array, overlap: float) -> Indices:
    """Indices of the best box of each thing (non-maximum suppression), by score."""
    return np.array([group[0] for group in groups(boxes, scores, overlap)], int)


def blended(boxes: Array, scores: Array, overlap: float, values: Array | None = None) -> tuple[Array, Array]:
    """The mean by score of the boxes of each thing, which jumps less from picture to picture than the best one.

    Args:
        boxes: (N, 4).
        scores: (N,).
        overlap: as in `groups`.
        values: (N, K) to blend; the boxes where None.

    Returns:
        (things, K) values and (things,) scores of the best.
    """
    values = boxes if values is None else values
    found = groups(boxes, scores, overlap)
    mixed = [scores[group] @ values[group] / scores[group].sum() for group in found]
    return np.reshape(mixed, (len(found), values.shape[-1])), np.array([scores[group[0]] for group in found])
