"""Things: boxes of people, vehicles and household things in a picture, by the packaged network.

The network looks at the whole picture and at overlapping tiles of a half and a quarter of its width, each letterboxed, so that a
person of 80 px in 12 million pixels is seen; what is cut by the inner border of a tile is left to the next larger one. A box
found so is rough by a few hundredths of its height. `refined` looks again at closer views centred on it and takes the mean.

Source: W. Liu et al., SSD: Single Shot MultiBox Detector, ECCV 2016; M. Sandler et al., MobileNetV2, CVPR 2018; labels of
Open Images V4.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from ..arrays import Array, Pixels
from .boxes import overlaps, sigmoid, ssd_anchors
from .files import model_file, packaged
from .view import View, cut

FILE = "object_detection_ssd_mobilenetv2_oidv4_fp16.tflite"
LABELS = "object_detection_oidv4_labelmap.txt"
SIZE_PX = 300
STRIDES = (16, 32, 64, 100, 150, 300)
"""Grids of 19, 10, 5, 3, 2 and 1 cells."""
GRAY = 127.5
LEAST_SCORE = 0.3
OVERLAP = 0.25
"""Of neighbouring tiles: what is smaller than this share of a tile lies whole in one of them."""
NEAR_BORDER = 0.03
"""Of a tile: a box that ends nearer to an inner border is likely cut by it."""
SAME = 0.45
"""Intersection over union from which two boxes are of one thing."""
AGREE = 0.6
"""Intersection over union from which boxes of two labels are of one thing."""
INSIDE = 0.8
"""Share of a box inside a better one of its label, from which it is a part of that thing."""
CLOSER = (1.4, 1.8, 2.4)
"""Sizes of the closer views, in longer sides of the box."""
FARTHEST_MOVE = 0.35
"""Of the longer side, by which a box may move when it is looked at again."""


@dataclass(frozen=True)
class Thing:
    """A box in a picture.

    Attributes:
        label: in the words of the network.
        score: 0 to 1.
        box_px: (4,) left, top, right, bottom edges, px of the picture.
    """

    label: str
    score: float
    box_px: Array

    @property
    def width_px(self) -> float:
        """Of the box."""
        return float(self.box_px[2] - self.box_px[0])

    @property
    def height_px(self) -> float:
        """Of the box."""
        return float(self.box_px[3] - self.box_px[1])

    def covered_by(self, other: Thing) -> float:
        """Which share of the box the other one covers."""
        low, high = np.maximum(self.box_px[:2], other.box_px[:2]), np.minimum(self.box_px[2:], other.box_px[2:])
        return float(np.prod(np.clip(high - low, 0, None)) / max(self.width_px * self.height_px, 1e-9))


@dataclass(frozen=True)
class Eye:
    """A network at work.

    Attributes:
        look: the things in a view of size_px x size_px, boxes in px of the view.
        size_px: width and height of its views.
        beyond: value of a view where there is no picture.
    """

    look: Callable[[View], list[Thing]]
    size_px: int
    beyond: float


def look(view: View) -> list[Thing]:
    """The things that the packaged network sees in a view of SIZE_PX x SIZE_PX, boxes in px of the view.

    Raises:
        MissingExtraError: the installation was made without networks, or without what runs them.
    """
    codes, logits = packaged(FILE).run(view.input(-1.0, 1.0))
    scores, centres = sigmoid(logits[0, :, 1:]), _anchors()
    rows, columns = np.nonzero(scores >= LEAST_SCORE)
    code, anchor = codes[0][rows], centres[rows]
    middle = code[:, 1::-1] / 10 * anchor[:, 2:] + anchor[:, :2]
    half = np.exp(np.minimum(code[:, 3:1:-1] / 5, 5.0)) * anchor[:, 2:] / 2
    boxes = np.concatenate([middle - half, middle + half], -1) * SIZE_PX - 0.5
    labels = _labels()
    return [Thing(labels[k], float(scores[i, k]), box) for i, k, box in zip(rows, columns, boxes, strict=True)]


PACKAGED = Eye(look, SIZE_PX, GRAY)
"""The network that comes with the installation."""


@cache
def _anchors() -> Array:
    return ssd_anchors(SIZE_PX, STRIDES, smallest=0.2, largest=0.95, ratios=(1.0, 2.0, 0.5, 3.0, 1 / 3))


@cache
def _labels() -> tuple[str, ...]:
    return tuple(model_file(LABELS).read_text("utf-8").split("\n")[1:24])


def things(
    pixels: Pixels, eye: Eye = PACKAGED, *, thorough: bool = False, progress: Callable[[float], None] = lambda _: None
) -> list[Thing]:
    """What a network sees in a picture, at several scales, one box for each thing of a label; best first.

    Args:
        pixels: (H, W, 3) of the picture.
        eye: the network.
        thorough: whether to look at still smaller tiles.
        progress: is told the share done.
    """
    tiles = list(_tiles(pixels.shape[1], pixels.shape[0], eye.size_px, 4 if thorough else 3))
    found: list[Thing] = []
    for number, (left, top, side) in enumerate(tiles):
        progress(number / len(tiles))
        centre = np.array([left + (side - 1) / 2, top + (side - 1) / 2])
        view = cut(pixels, centre, side / eye.size_px, eye.size_px, eye.size_px, beyond=eye.beyond)
        placed = [replace(one, box_px=_placed(view, one.box_px)) for one in eye.look(view)]
        found += [one for one in placed if _whole_in(one.box_px, left, top, side, pixels)]
    return distinct(found)


def _placed(view: View, box: Array) -> Array:
    """A box in px of a view, in px of the picture."""
    return view.in_picture(box.reshape(2, 2)).ravel()


def _tiles(width: int, height: int, size_px: int, levels: int) -> Iterator[tuple[float, float, float]]:
    """Squares (left, top, side): the whole picture, then overlapping ones of a half, a quarter ... of its longer side."""
    longer = max(width, height)
    yield (width - longer) / 2, (height - longer) / 2, float(longer)
    for level in range(1, levels):
        side = longer / 2**level
        if side < size_px:
            return
        for top in _starts(height, side):
            for left in _starts(width, side):
                yield left, top, side


def _starts(length: int, side: float) -> Sequence[float]:
    """Beginnings of overlapping pieces of a length; one in the middle where it is shorter than a piece."""
    if length <= side:
        return [(length - side) / 2]
    count = int(np.ceil((length - side) / (side * (1 - OVERLAP)))) + 1
    return [float(start) for start in np.linspace(0, length - side, count)]


def _whole_in(box: Array, left: float, top: float, side: float, pixels: Pixels) -> bool:
    """Whether a box is not cut by a border of the tile that is none of the picture."""
    height, width = pixels.shape[:2]
    near = NEAR_BORDER * side
    return not (
        (left > 0 and box[0] < left + near) or (top > 0 and box[1] < top + near)
        or (left + side < width and box[2] > left + side - near) or (top + side < height and box[3] > top + side - near)
    )  # fmt: skip


def distinct(found: Sequence[Thing]) -> list[Thing]:
    """One box for each thing of a label, best first: of those that overlap, or lie inside a better one, the best."""
    kept: list[Thing] = []
    for label in sorted({one.label for one in found}):
        left = sorted((one for one in found if one.label == label), key=lambda thing: -thing.score)
        boxes = np.stack([one.box_px for one in left])
        areas = np.maximum(np.prod(np.clip(boxes[:, 2:] - boxes[:, :2], 0, None), axis=-1), 1e-9)
        free = np.ones(len(left), bool)
        for i in range(len(left)):
            if not free[i]:
                continue
            kept.append(left[i])
            low, high = np.maximum(boxes[i, :2], boxes[:, :2]), np.minimum(boxes[i, 2:], boxes[:, 2:])
            inside = np.prod(np.clip(high - low, 0, None), axis=-1) / areas
            free &= (overlaps(boxes[i], boxes) < SAME) & (inside < INSIDE)
    return sorted(kept, key=lambda thing: -thing.score)


def one_label(found: Sequence[Thing], general: str = "Vehicle") -> list[Thing]:
    """One label for each box, best first: of boxes that nearly agree, the best, and a general word only if it is alone."""
    kept: list[Thing] = []
    for one in sorted(found, key=lambda thing: (thing.label == general, -thing.score)):
        if not kept or overlaps(one.box_px, np.stack([other.box_px for other in kept])).max() < AGREE:
            kept.append(one)
    return sorted(kept, key=lambda thing: -thing.score)


def refined(pixels: Pixels, thing: Thing, eye: Eye = PACKAGED) -> Thing:
    """The thing with the mean of its boxes in closer views; as it was where none of them sees it.

    Args:
        pixels: (H, W, 3) of the picture.
        thing: what was found.
        eye: the network that found it.
    """
    box, longer = thing.box_px, max(thing.width_px, thing.height_px)
    boxes, scores = [], [thing.score]
    for size in CLOSER:
        view = cut(pixels, (box[:2] + box[2:]) / 2, size * longer / eye.size_px, eye.size_px, eye.size_px,
                   beyond=eye.beyond)  # fmt: skip
        seen = [one for one in eye.look(view) if one.label == thing.label]
        moved = np.reshape([_placed(view, one.box_px) for one in seen], (-1, 4))
        score = np.array([one.score for one in seen])
        near = np.abs(moved - box).max(axis=-1, initial=0.0) < FARTHEST_MOVE * longer
        if not near.any():
            continue
        best = np.flatnonzero(near)[np.argmax(score[near])]
        alike = near & (score > 0.6 * score[best]) & (np.abs(moved - moved[best]).max(axis=-1) < 0.2 * longer)
        boxes.append(score[alike] @ moved[alike] / score[alike].sum())
        scores.append(float(score[best]))
    return replace(thing, box_px=np.mean(boxes, axis=0), score=max(scores)) if boxes else thing
