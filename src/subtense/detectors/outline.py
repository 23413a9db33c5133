"""The outline of a thing by one click or one box: GrabCut at a working resolution, or a network; then edges at the full one.

GrabCut models the colours of thing and ground and cuts between them where neighbours differ. Where its answer hangs on how
it is begun (margins, rounds), runs that begin otherwise tell by how much, and that is in sigma.

Source: C. Rother, V. Kolmogorov, A. Blake, GrabCut: interactive foreground extraction using iterated graph cuts, 2004.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import Array, Bools, Pixels
from ..detection import Search
from ..errors import FileFormatError, InputError, NothingFoundError
from ..outline import MOST_POINTS, Contour, Outline, area_of, extents_of, located, normals_of, overlap, width_at
from ..photo import Photo
from ..quantity import Note

WORKING_PX = 360
"""Longer side of what GrabCut works on."""
SMALLEST_PX = 8
"""Shorter side of a box that can be cut."""
AMBIGUOUS = 0.03
"""Of the thing's size: extents that differ by more from run to run (1s) are noted."""
MIXED_FROM = 0.001
MIXED_PER_ROOT = 0.35
"""Where a share s of the pixels beside the outline has the colours of its other side, each side is off by up to this times
sqrt(s) of the thing's size (1s): by 2 px of 100 for 0.3 %, by 10 for 8 %, as in drawn pictures of grainy things and grounds."""
LEAST_LOCATED = 0.6
"""Share of the contour that must lie on edges; less is noted."""
RUNS = ((0.35, 3, 0.0, False), (0.25, 3, 1.5, False), (0.5, 3, 0.0, True), (0.35, 4, 2.5, True))
"""Ground taken in around the box in box sizes, rounds, blur in working pixels, and whether colours are told by lightness and
hue: what grain and shade decide in one run, they do not in another. The middle one is the answer, all tell its doubt."""
NETWORK_SIDE_PX = 320


@dataclass(frozen=True)
class _Window:
    """A part of the picture, made smaller: its origin in px and how many of its px are one."""

    x0: int
    y0: int
    x1: int
    y1: int
    scale: float

    def to_full(self, points: Array) -> Array:
        return np.asarray((points + 0.5) / self.scale - 0.5 + np.array([self.x0, self.y0]))

    def to_work(self, points: Array) -> Array:
        return np.asarray((points - np.array([self.x0, self.y0]) + 0.5) * self.scale - 0.5)


def outline(photo: Photo, where: Array, search: Search | None = None) -> Outline:
    """The outline of what lies under a point or in a box.

    Args:
        photo: the picture.
        where: (2,) x and y of a point on the thing, or (4,) x1, y1, x2, y2 of a box around it, px.
        search: `model` and `progress` of it are heeded: an ONNX or TFLite network from a picture to a mask of 1 or 2 channels.

    Raises:
        InputError: outside the picture, or too small a box.
        NothingFoundError: nothing there stands out from its ground.
        FileFormatError: a model that can't be run, or gives no mask.
    """
    search = search or Search()
    place = _checked(photo, np.asarray(where, float))
    box = place if place.shape == (4,) else None
    if box is None and search.model is None:
        box = _box_around(photo, place)
        search.progress(0.3)
    masks = _by_network(photo, place, search) if search.model is not None else _by_grabcut(photo, box, place)
    contours = []
    for number, (mask, window) in enumerate(masks):
        rough = _contour(mask, window)
        if rough is not None:
            contours.append(located(photo.pixels, rough, max(0.8 / window.scale, 0.8)))
        search.progress(0.4 + 0.6 * (number + 1) / len(masks))
    if not contours or len(contours) < (len(masks) + 1) // 2:
        raise _nothing(photo, place)
    # of several runs the one whose extents are nearest to those of all
    spans = np.array([[width_at(one, angle) for angle in np.linspace(0, np.pi, 8, endpoint=False)] for one in contours])
    middle = int(np.argmin(np.abs(spans - np.median(spans, axis=0)).sum(axis=1)))
    return _outline(photo, contours[middle], [one for i, one in enumerate(contours) if i != middle])


def _outline(photo: Photo, contour: Contour, others: list[Contour]) -> Outline:
    import cv2

    area, u_area = area_of(contour, others)
    mask = np.zeros(photo.pixels.shape[:2], np.uint8)
    inner = contour.points_px - 0.5 * normals_of(contour.points_px)  # the filling takes in the pixels on its line
    cv2.fillPoly(mask, [np.round(inner * 16).astype(np.int32)], 1, shift=4)
    mixed = overlap(photo.pixels, contour)
    mixed_px = MIXED_PER_ROOT * (mixed * area) ** 0.5 if mixed > MIXED_FROM else 0.0
    extents = extents_of(contour, others, mixed_px)
    u_area = float(np.hypot(u_area, 2 * mixed_px * area**0.5))
    return Outline(mask > 0, contour, extents, area, u_area, _notes(photo, contour, others, mixed))


def _notes(photo: Photo, contour: Contour, others: list[Contour], mixed: float) -> tuple[Note, ...]:
    notes = []
    spans = [np.ptp(one.points_px, axis=0) for one in (contour, *others)]
    spread = float(np.max(np.std(spans, axis=0) / np.maximum(spans[0], 1e-9)))
    if spread > AMBIGUOUS:
        notes.append(Note("outline_ambiguous", f"where the thing ends hangs on how the search began: by {100 * spread:.0f} % of its "
                          "size, which is in u", "give a box around it, or mark its ends"))  # fmt: skip
    elif mixed > MIXED_FROM:
        notes.append(Note("outline_ambiguous", f"{100 * mixed:.1f} % of the pixels beside its outline have the colours of its other "
                          "side, so that parts of it may be off; this is in u", "another ground, or mark its ends"))  # fmt: skip
    share = float(contour.located.mean())
    if share < LEAST_LOCATED:
        notes.append(Note("outline_unsharp", f"only {100 * share:.0f} % of its outline lie on edges; the rest is known to a "
                          "pixel or two", "another ground, or mark its ends"))  # fmt: skip
    low, high = contour.points_px.min(axis=0), contour.points_px.max(axis=0)
    if np.any(low < 1.5) or np.any(high > np.array([photo.width_px, photo.height_px]) - 2.5):
        notes.append(Note("cut_by_border", "its outline reaches the picture's border: it is not whole in the picture, and its "
                          "extents are too small", "take it whole into the picture"))  # fmt: skip
    return tuple(notes)


def _checked(photo: Photo, place: Array) -> Array:
    size = np.array([photo.width_px, photo.height_px])
    if place.shape not in ((2,), (4,)) or not np.all(np.isfinite(place)):
        raise InputError(
            "outline", str(place.tolist()), "give X,Y of a point on the thing, or X1,Y1,X2,Y2 of a box around it"
        )
    corners = place.reshape(-1, 2)
    shown = ",".join(f"{v:g}" for v in place)
    if np.any(corners < -0.5) or np.any(corners > size - 0.5):
        raise InputError("outline", shown, f"the picture has {size[0]} x {size[1]} px; it must lie in it")
    if len(corners) == 1:
        return place
    low, high = corners.min(axis=0), corners.max(axis=0)
    if np.any(high - low < SMALLEST_PX):
        raise InputError("outline", shown, f"a box needs {SMALLEST_PX} px or more each way")
    return np.concatenate([low, high])


def _nothing(photo: Photo, place: Array) -> NothingFoundError:
    shown = ",".join(f"{v:g}" for v in place)
    return NothingFoundError(f"{photo.name}: nothing at {shown} stands out from its ground; give a box around the thing, or mark "
                             "its ends with --line")  # fmt: skip


# -- GrabCut ------------------------------------------------------------------------------------------


def _window(photo: Photo, box: Array, margin: float) -> tuple[Pixels, _Window]:
    """The box with ground around it, made smaller to the working resolution."""
    import cv2

    width, height = box[2] - box[0], box[3] - box[1]
    around = np.maximum(margin * np.array([width, height]), 6.0)
    x0, y0 = (max(int(v), 0) for v in box[:2] - around)
    x1, y1 = min(int(box[2] + around[0]) + 2, photo.width_px), min(int(box[3] + around[1]) + 2, photo.height_px)
    cut = photo.pixels[y0:y1, x0:x1]
    scale = min(1.0, WORKING_PX / max(cut.shape[:2]))
    size = (max(round(cut.shape[1] * scale), 2), max(round(cut.shape[0] * scale), 2))
    small = cv2.resize(cut, size, interpolation=cv2.INTER_AREA) if scale < 1 else np.ascontiguousarray(cut)
    return small, _Window(x0, y0, x1, y1, scale)


def _by_grabcut(photo: Photo, box: Array | None, place: Array) -> list[tuple[Bools, _Window]]:
    import cv2

    if box is None:
        return []
    seed = place if place.shape == (2,) else (box[:2] + box[2:]) / 2
    found = []
    for margin, rounds, blur, by_hue in RUNS:
        small, window = _window(photo, box, margin)
        if by_hue:
            small = cv2.cvtColor(small, cv2.COLOR_RGB2LAB)
        if blur:
            small = cv2.GaussianBlur(small, (0, 0), blur)
        mask = _cut(small, window.to_work(box.reshape(2, 2)).ravel(), rounds)
        part = _part_at(mask, window.to_work(seed[None])[0], must=place.shape == (2,))
        if part is not None:
            found.append((part, window))
    return found


def _cut(small: Pixels, box: Array, rounds: int) -> Bools:
    """GrabCut in a box of a small picture."""
    import cv2

    height, width = small.shape[:2]
    mask = np.full((height, width), cv2.GC_BGD, np.uint8)
    x0, y0 = (max(int(np.floor(v)), 0) for v in box[:2])
    x1, y1 = int(np.ceil(box[2])) + 1, int(np.ceil(box[3])) + 1
    mask[y0:y1, x0:x1] = cv2.GC_PR_FGD
    if not np.any(mask == cv2.GC_BGD) or np.ptp(small) < 8:
        return np.zeros((height, width), bool)
    return _run(small, mask, rounds)


def _run(small: Pixels, mask: Any, rounds: int) -> Bools:
    import cv2

    cv2.setRNGSeed(1)  # its colour models begin at random
    models = np.zeros((1, 65)), np.zeros((1, 65))
    try:
        cv2.grabCut(small, mask, None, *models, rounds, cv2.GC_INIT_WITH_MASK)
    except cv2.error:  # all of one colour
        return np.zeros(mask.shape, bool)
    return np.asarray((mask == cv2.GC_FGD) | (mask == cv2.GC_PR_FGD))


def _part_at(mask: Bools, seed: Array, *, must: bool) -> Bools | None:
    """The part under a place, holes filled; where the place is free, the largest."""
    import cv2

    count, labels, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=4)
    if count < 2:
        return None
    x, y = (int(np.clip(round(float(v)), 0, n - 1)) for v, n in zip(seed, mask.shape[::-1], strict=True))
    label = int(labels[y, x])
    if label == 0 and must:
        return None
    if label == 0 or not must:
        label = 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA]))
    if stats[label, cv2.CC_STAT_AREA] < 30:
        return None
    part = (labels == label).astype(np.uint8)
    part = cv2.morphologyEx(part, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
    outer, _ = cv2.findContours(part, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    if not outer:
        return None
    filled = np.zeros_like(part)
    cv2.drawContours(filled, [max(outer, key=cv2.contourArea)], -1, 1, cv2.FILLED)
    return np.asarray(filled > 0)


def _box_around(photo: Photo, point: Array) -> Array:
    """A box around what a point lies on: what is like it and joined to it, then a cut with the picture's border as ground."""
    import cv2

    whole = np.array([0, 0, photo.width_px - 1, photo.height_px - 1], float)
    small, window = _window(photo, whole, 0.0)
    height, width = small.shape[:2]
    at = window.to_work(point[None])[0]
    x, y = (int(np.clip(round(float(v)), 0, n - 1)) for v, n in zip(at, (width, height), strict=True))
    smooth = cv2.bilateralFilter(small, 5, 25, 5)
    like = _like(smooth, x, y)
    mask = np.full((height, width), cv2.GC_PR_BGD, np.uint8)
    mask[like] = cv2.GC_PR_FGD
    rim = max(2, min(height, width) // 50)
    mask[:rim], mask[-rim:], mask[:, :rim], mask[:, -rim:] = (cv2.GC_BGD,) * 4
    cv2.circle(mask, (x, y), max(2, min(height, width) // 100), int(cv2.GC_FGD), -1)
    part = _part_at(_run(smooth, mask, 4), np.array([x, y], float), must=True) if np.ptp(small) >= 8 else None
    if part is None or part.mean() > 0.8:
        raise _nothing(photo, point)
    rows, columns = np.flatnonzero(part.any(axis=1)), np.flatnonzero(part.any(axis=0))
    low = window.to_full(np.array([[columns[0], rows[0]]], float))[0]
    high = window.to_full(np.array([[columns[-1], rows[-1]]], float))[0]
    grown = 0.04 * (high - low) + 2 / window.scale
    found = np.concatenate([low - grown, high + grown])
    return np.asarray(np.clip(found, 0.0, np.array([photo.width_px - 1, photo.height_px - 1] * 2, float)))


def _like(smooth: Pixels, x: int, y: int) -> Bools:
    """What is joined to a place by colours like its own: the largest such part that is not most of the picture."""
    import cv2

    lab = cv2.cvtColor(smooth, cv2.COLOR_RGB2LAB)
    best = np.zeros(lab.shape[:2], bool)
    for tolerance in (4, 7, 11, 16, 23):
        filled = np.zeros((lab.shape[0] + 2, lab.shape[1] + 2), np.uint8)
        flags = 4 | cv2.FLOODFILL_FIXED_RANGE | cv2.FLOODFILL_MASK_ONLY | (1 << 8)
        cv2.floodFill(lab.copy(), filled, (x, y), 0, (tolerance,) * 3, (tolerance,) * 3, flags)
        part = filled[1:-1, 1:-1] > 0
        if part.mean() > 0.35 or _touches(part) > 0.25:
            break
        best = part
    return best


def _touches(part: Bools) -> float:
    """Share of the picture's border that a part covers."""
    border = np.concatenate([part[0], part[-1], part[:, 0], part[:, -1]])
    return float(border.mean())


def _contour(mask: Bools, window: _Window) -> Array | None:
    """(N, 2) closed contour of a part in px of the whole picture, between its pixels and those outside."""
    import cv2

    # a border of ground, and twice as large, so that the contour runs along pixels' borders
    padded = np.pad(mask.astype(np.uint8), 1)
    large = cv2.resize(padded, None, fx=2, fy=2, interpolation=cv2.INTER_NEAREST)
    found, _ = cv2.findContours(large, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    if not found:
        return None
    points = max(found, key=cv2.contourArea).reshape(-1, 2).astype(float)
    if len(points) < 24:
        return None
    points = (points + 0.5) / 2 - 0.5 - 1.0
    middle = points.mean(axis=0)
    out = points - middle
    points = points + 0.25 * out / np.maximum(np.hypot(*out.T), 1e-9)[:, None]
    return window.to_full(points[:: max(1, len(points) // (4 * MOST_POINTS))])


# -- networks -----------------------------------------------------------------------------------------


def _by_network(photo: Photo, place: Array, search: Search) -> list[tuple[Bools, _Window]]:
    """Masks of a network: of the whole picture, or of the box with more and less around it."""
    from ..networks import Network

    assert search.model is not None
    network = Network(search.model)
    whole = np.array([0, 0, photo.width_px - 1, photo.height_px - 1], float)
    box = place if place.shape == (4,) else whole
    seed = place if place.shape == (2,) else (box[:2] + box[2:]) / 2
    found = []
    for margin in (0.15, 0.05, 0.3) if place.shape == (4,) else (0.0,):
        _, window = _window(photo, box, margin)
        mask, scaled = _masked(network, photo.pixels[window.y0 : window.y1, window.x0 : window.x1], window)
        part = _part_at(mask, scaled.to_work(seed[None])[0], must=place.shape == (2,))
        if part is not None:
            found.append((part, scaled))
    return found


def _masked(network: Any, cut: Pixels, window: _Window) -> tuple[Bools, _Window]:
    """What a network takes for the thing in a part of the picture, at the working resolution."""
    import cv2

    shape = network.inputs[0].shape
    if len(network.inputs) != 1 or len(shape) != 4 or 3 not in (shape[1], shape[3]):
        raise FileFormatError(network.path, "takes no picture of 3 channels; give a network from a picture to a mask")
    last = shape[3] == 3
    high, wide = (shape[1], shape[2]) if last else (shape[2], shape[3])
    size = (wide or NETWORK_SIDE_PX, high or NETWORK_SIDE_PX)
    small = cv2.resize(cut, size, interpolation=cv2.INTER_AREA).astype(np.float32) / 255.0
    out = np.squeeze(np.asarray(network.run((small if last else small.transpose(2, 0, 1))[None])[0], float))
    share = _share(out)
    if share is None:
        raise FileFormatError(
            network.path, f"gives an array of {' x '.join(map(str, out.shape))}, and no mask of 1 or 2 channels"
        )
    width, height = (max(round(n * window.scale), 2) for n in (cut.shape[1], cut.shape[0]))
    mask = cv2.resize(share.astype(np.float32), (width, height), interpolation=cv2.INTER_LINEAR) > 0.5
    return np.asarray(mask), window


def _share(out: Array) -> Array | None:
    """(h, w) share of the thing, 0 to 1, from 1 or 2 channels, as probabilities or as their logarithms' odds."""
    if out.ndim == 3 and out.shape[0] == 2:
        out = np.moveaxis(out, 0, -1)
    if out.ndim == 3 and out.shape[-1] == 2:
        odds = out[..., 1] - out[..., 0]
        bounded = out.min() >= 0 and out.max() <= 1
        return np.asarray(out[..., 1] if bounded else 1 / (1 + np.exp(-np.clip(odds, -50, 50))))
    if out.ndim != 2:
        return None
    return np.asarray(out if out.min() >= -1e-3 and out.max() <= 1 + 1e-3 else 1 / (1 + np.exp(-np.clip(out, -50, 50))))
