"""ArUco and AprilTag markers: found in every family, corners located in linear light with their covariance.

OpenCV finds the quadrilaterals, on a coarse level of the picture first; which marker one is, is read here in all families at
once; and its corners are those of its whole pattern, fitted at full resolution (see `pattern`): OpenCV's own make a marker too
small by 0.2 to 2.7 %. The size of a marker is that of its black square, without the white border; of families with data outside
the border (`apriltag_library`) that of the border.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from .. import apriltag_library
from ..arrays import Array, Pixels
from ..dark_quads import dark_quads
from ..detection import Detection, Search
from ..marker_codes import FAMILIES, WEAK, Reader, Reading, cells_of, rimmed
from ..observation import Observation
from ..pattern import FLOOR_PX, LOSSY_PX, Fitted, fit_pattern
from ..photo import Photo
from ..quantity import Quantity
from ..subpixel import refine_quad

ALL_FAMILIES = (*FAMILIES, *apriltag_library.FAMILIES)
"""Those that are tried unasked, and those of the library, which must be asked for."""

WORST_MISFIT = 0.25
"""Rms residual over contrast beyond which there is no marker."""
WORST_PATTERN = 0.12
"""The same of a whole pattern, beyond which only its sides are believed."""
WORST_WEAK = 0.07
"""The same where few bits tell."""
LEAST_WEAK_PX = 10.0
MOST_READ = 600
MOST_FINE = 100
"""Quadrilaterals of a level that are read, and that are read through the blur: those of most contrast."""
LOSSY = ("JPEG", "WEBP", "HEIC", "AVIF")
COARSE_PX = 1100
"""Longer side of the level that is searched first."""
SMALLEST_QUAD_PX = 8.0
SEEN_FROM_PX = 15.0
"""Side of a sharp marker from which on it is usually found, in px of the level."""
MOST_ENLARGED = 2_000_000
"""Pixels of a picture that is searched twice as large as well, where nothing was found."""


def markers(photo: Photo, search: Search | None = None) -> tuple[Detection, ...]:
    """Markers in a photo, left to right.

    A coarse level is searched first, the full picture where nothing was found there or `search.thorough` says so.

    Args:
        photo: the picture.
        search: `family`, `curve`, `thorough` and `progress` of it are heeded.

    Returns:
        Squares: corners top-left, top-right, bottom-right, bottom-left of the marker as printed.
    """
    search = search or Search()
    gray = _gray(photo.pixels)
    floor_px = LOSSY_PX if photo.metadata.form in LOSSY else FLOOR_PX
    if search.family in apriltag_library.FAMILIES:
        return _by_library(gray, search.family, search.curve, floor_px)
    found: list[Observation] = []
    levels = _levels(gray.shape[1], gray.shape[0], thorough=search.thorough)
    for done, scale in enumerate(levels):
        search.progress(done / len(levels))
        if scale <= 1 or not found:
            found += [one for one in _on_level(gray, scale, search, floor_px) if not _seen(one, found)]
        if found and not search.thorough:
            break
    search.progress(1.0)
    return tuple(Detection(one, "square") for one in sorted(found, key=lambda o: float(o.points_px[:, 0].mean())))


def _by_library(gray: Pixels, family: str, curve: Quantity, floor_px: float) -> tuple[Detection, ...]:
    """Tags of a family that only the library knows, left to right."""
    found = []
    for tag in apriltag_library.find(gray, family):
        patch, offset = _patch(gray, tag.corners_px)
        near = replace(tag, corners_px=tag.corners_px - offset)
        fitted = apriltag_library.located(patch, near, family, curve, floor_px)
        if fitted is not None and fitted[2] < WORST_PATTERN:
            corners, cov, _ = fitted
            label = f"{family} id {tag.number}"
            found.append(Observation(corners + offset, cov=cov, label=label, source="pattern of the marker"))
    return tuple(Detection(one, "square") for one in sorted(found, key=lambda o: float(o.points_px[:, 0].mean())))


def reach_px(photo: Photo, search: Search, found: bool) -> float:
    """Side of the smallest marker that the search came down to, px; sharp ones are seen from there on."""
    levels = _levels(photo.width_px, photo.height_px, thorough=search.thorough)
    last = levels[0] if found and not search.thorough else levels[-1]
    return SEEN_FROM_PX / last


def _gray(pixels: Pixels) -> Pixels:
    """(H, W) encoded luma."""
    import cv2

    if pixels.strides[2] == 0:  # one channel, seen three times
        return pixels[..., 0]
    return np.asarray(cv2.cvtColor(pixels, cv2.COLOR_RGB2GRAY))


def _levels(width_px: int, height_px: int, *, thorough: bool) -> list[float]:
    """Scales that are searched, in order."""
    coarse = 1 / max(math.ceil(max(width_px, height_px) / COARSE_PX), 1)
    scales = [coarse] if coarse == 1 else [coarse, 1.0]
    return [*scales, 2.0] if thorough or width_px * height_px <= MOST_ENLARGED else scales


def _on_level(gray: Pixels, scale: float, search: Search, floor_px: float) -> list[Observation]:
    """Markers among the quadrilaterals of one level, located in the full picture."""
    import cv2

    if scale == 1:
        level = gray
    else:
        how = cv2.INTER_AREA if scale < 1 else cv2.INTER_CUBIC
        level = cv2.resize(gray, None, fx=scale, fy=scale, interpolation=how)
    readers = [(quad, Reader(level, quad)) for quad in rimmed(level, dark_quads(level, SMALLEST_QUAD_PX))[:MOST_READ]]
    for correct, fine, families in _passes([search.family] if search.family else list(FAMILIES)):
        found: list[Observation] = []
        for quad, reader in readers[:MOST_FINE] if fine else readers:
            read = next((r for r in (reader.read(name, correct, fine=fine) for name in families) if r), None)
            one = read and _located(gray, _turned(_full(quad, scale), read), read, search.curve, floor_px)
            if one and not _seen(one, found):
                found.append(one)
        if found:
            return found
    return []


def _passes(families: list[str]) -> Iterator[tuple[float, bool, list[str]]]:
    """(share of bits corrected, whether narrow cells are read through the blur, families).

    The next only where the one before found nothing: exact readings first, and the families of 16 bits last.
    """
    strong = [name for name in families if name not in WEAK]
    for names in (strong, families):
        yield from ((correct, fine, names) for correct, fine in ((0.0, False), (0.0, True), (0.5, True)))


def _full(quad: Array, scale: float) -> Array:
    """Places on a level as places in the full picture."""
    return (quad + 0.5) / scale - 0.5


def _turned(quad: Array, read: Reading) -> Array:
    """Corners in the marker's own order."""
    return np.roll(quad, read.turns, axis=0)


def _located(gray: Pixels, corners: Array, read: Reading, curve: Quantity, floor_px: float) -> Observation | None:
    """A marker with its corners from its pattern, or from its sides where something lies over it; None without any."""
    patch, offset = _patch(gray, corners)
    label, rough = f"{read.family} id {read.number}", corners - offset
    cells = cells_of(read.family, read.number)
    pattern = fit_pattern(patch, rough, cells, curve, floor_px)
    if pattern is not None and _believed(pattern, read, len(cells), curve):
        return Observation(pattern.corners_px + offset, cov=pattern.cov, label=label, source="pattern of the marker")
    if read.family in WEAK or read.wrong:
        return None
    quad = refine_quad(patch, rough, float(np.sqrt(_area(rough))) / len(cells), curve)
    if quad is None or quad.misfit >= WORST_MISFIT:
        return None
    return Observation(quad.corners_px + offset, cov=quad.cov, label=label, source="edges of the marker")


def _believed(pattern: Fitted, read: Reading, cells: int, curve: Quantity) -> bool:
    """Whether it looks like this marker: of weak families, which much else reads as, more is asked."""
    if pattern.misfit >= WORST_PATTERN:
        return False
    if read.family not in WEAK:
        return True
    sides = np.hypot(*(np.roll(pattern.corners_px, -1, axis=0) - pattern.corners_px).T)
    usual = abs(pattern.curve - float(curve.value)) <= max(2.5 * float(curve.u), 1e-6)
    sharp = pattern.blur_px < float(sides.mean()) / cells
    return usual and sharp and pattern.misfit < WORST_WEAK and bool(sides.min() > max(0.2 * sides.max(), LEAST_WEAK_PX))


def _patch(gray: Pixels, corners: Array) -> tuple[Array, Array]:
    """The part of the picture around a marker, 0 to 1, and where its first pixel lies."""
    margin = 0.8 * np.ptp(corners, axis=0).max() + 4
    low = np.maximum(np.floor(corners.min(axis=0) - margin).astype(int), 0)
    high = np.ceil(corners.max(axis=0) + margin).astype(int) + 1
    return gray[low[1] : high[1], low[0] : high[0]] / 255.0, low.astype(float)


def _area(corners: Array) -> float:
    x, y = corners[:, 0], corners[:, 1]
    return float(abs(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))) / 2)


def _seen(one: Observation, others: list[Observation]) -> bool:
    return any(_same_place(one.points_px, other.points_px) for other in others)


def _same_place(a: Array, b: Array) -> bool:
    return bool(np.hypot(*(a.mean(axis=0) - b.mean(axis=0))) < np.sqrt(_area(a)) / 2)
