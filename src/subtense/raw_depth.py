"""RawDepth: a map of depths as a network or a file gives it, before it is anchored, and what is read from it at a place."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from .arrays import Array
from .depth_models import KINDS
from .errors import GeometryError, InputError
from .quantity import Note

EDGE = 0.15
"""Spread of the depths about a point, relative, from which it may belong to near or far."""
TOLD, TORN = 0.6, 0.5
"""Share of the variance that a plane tells, or of the range that is a gap, from which such a spread is no noise."""
LEAST_ANSWERED = 0.3
"""Share of the pixels about a place that must have a number."""


@dataclass(frozen=True, eq=False)
class RawDepth:
    """Numbers for the pixels of a picture.

    Attributes:
        values: (height, width) of the upright picture; NaN where there is none.
        kind: of KINDS: depth in metres, up to a factor, up to a factor and a shift, or its inverse up to both.
        source: what gave it.
        u_factor: relative standard deviation of a factor that all depths share, in the logarithm; unused where relative.
        u_local: relative standard deviation of single depths beside that.
        u_m: standard deviation of single depths beside that, m.
        doubt: where these come from.
        cell_px: pixels of the picture for one number.
        focal: whether the depths are proportional to the camera's focal length, by how they were made.
        published: whether its error is a published or assumed one, and was not stated by a person.
        notes: doubts about it.
    """

    values: Array
    kind: str
    source: str
    u_factor: float
    u_local: float
    u_m: float = 0.0
    doubt: str = ""
    cell_px: float = 1.0
    focal: bool = False
    published: bool = True
    notes: tuple[Note, ...] = ()

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise InputError("--gives", self.kind, f"known are {', '.join(KINDS)}")
        if self.values.ndim != 2:
            raise InputError("values", f"of shape {self.values.shape}", "give rows of numbers")

    @property
    def inverse(self) -> bool:
        """Whether the numbers are of 1/depth."""
        return self.kind == "disparity"

    @property
    def relative(self) -> bool:
        """Whether the numbers are no metres before they are anchored."""
        return self.kind != "metric"


@dataclass(frozen=True)
class Sample:
    """What a map says at a place.

    Attributes:
        value: its number there.
        spread: standard deviation of the numbers about it, as far as they may be meant.
        near: the fifth percentile of the numbers about it.
        far: the ninety-fifth.
        edge: whether the numbers about it are of near and far things.
    """

    value: float
    spread: float
    near: float
    far: float
    edge: bool = False


def at_point(raw: RawDepth, point_px: Array, sigma_px: float) -> Sample:
    """The map at a point, whose place is known to sigma_px.

    On a surface that slants the place's doubt is one of depth, by the slope of a plane through the numbers about it; their noise
    is the map's own error, and no part of that. All that lies within two sigma, and within one number of the map, may be meant:
    at the border of a thing maps run from near to far, so there the spread holds both.

    Raises:
        InputError: the point lies outside the picture.
        GeometryError: there is no number there.
    """
    height, width = raw.values.shape
    x, y = float(point_px[0]), float(point_px[1])
    if not (-0.5 <= x <= width - 0.5 and -0.5 <= y <= height - 0.5):
        raise InputError("--point", f"{x:g},{y:g}", f"the picture has {width} x {height} px; it must lie in it")
    meant = max(2 * sigma_px, raw.cell_px if raw.cell_px > 1 else 0.0)
    about, wider = _window(raw.values, x, y, meant), _window(raw.values, x, y, max(meant, 1.0))
    found = about[np.isfinite(about)]
    if found.size < max(LEAST_ANSWERED * about.size, 1):
        raise _nothing(f"{x:g},{y:g}")
    here = float(raw.values[min(max(round(y), 0), height - 1), min(max(round(x), 0), width - 1)])
    value = here if np.isfinite(here) else float(np.median(found))
    slope, told = _plane(wider)
    sample = _sample(found, value, sigma_px * slope)
    torn = np.max(np.diff(np.sort(found)), initial=0.0) > TORN * np.ptp(found)
    # noise scatters: it leaves no gap in the middle, and no plane tells much of it
    return _either(sample) if found.size > 1 and _wide(sample) and (told > TOLD or torn) else sample


def _window(values: Array, x: float, y: float, reach: float) -> Array:
    """The numbers up to reach pixels away to each side."""
    height, width = values.shape
    rows = slice(max(round(y - reach), 0), min(round(y + reach), height - 1) + 1)
    columns = slice(max(round(x - reach), 0), min(round(x + reach), width - 1) + 1)
    return np.asarray(values[rows, columns], float)


def _plane(about: Array) -> tuple[float, float]:
    """Steepest change from pixel to pixel of a plane through numbers, and the share of their variance that it tells; 0 where
    they are too few.
    """
    y, x = np.nonzero(np.isfinite(about))
    if len(x) < 6 or np.ptp(x) == 0 or np.ptp(y) == 0:
        return 0.0, 0.0
    numbers = about[y, x]
    rows = np.stack([x, y, np.ones_like(x)], -1).astype(float)
    plane, *_ = np.linalg.lstsq(rows, numbers, rcond=None)
    left, whole = float(np.var(numbers - rows @ plane)), float(np.var(numbers))
    return float(np.hypot(plane[0], plane[1])), 1 - left / whole if whole > 0 else 0.0


def in_box(raw: RawDepth, box_px: Sequence[float]) -> Sample:
    """The median of the map in the middle half of a box (left, top, right, bottom), whose corners often show the ground
    behind; the spread is that of the numbers there.

    Raises:
        InputError: the box is empty, or lies outside the picture.
        GeometryError: there are no numbers there.
    """
    height, width = raw.values.shape
    left, top, right, bottom = map(float, box_px)
    text = f"{left:g},{top:g},{right:g},{bottom:g}"
    if not (right > left and bottom > top):
        raise InputError("--box", text, "give left, top, right and bottom, px")
    if left < -0.5 or top < -0.5 or right > width - 0.5 or bottom > height - 0.5:
        raise InputError("--box", text, f"the picture has {width} x {height} px; it must lie in it")
    across, down = (right - left) / 4, (bottom - top) / 4
    rows = slice(round(top + down), max(round(bottom - down), round(top + down)) + 1)
    columns = slice(round(left + across), max(round(right - across), round(left + across)) + 1)
    about = np.asarray(raw.values[rows, columns], float).ravel()
    found = about[np.isfinite(about)]
    if found.size < max(LEAST_ANSWERED * about.size, 1):
        raise _nothing(text)
    low, high = np.quantile(found, [0.25, 0.75])
    sample = _sample(found, float(np.median(found)), float((high - low) / 1.349))
    return _either(sample) if _wide(sample) else sample


def _sample(found: Array, value: float, spread: float) -> Sample:
    near, far = np.quantile(found, [0.05, 0.95])
    return Sample(value, spread, float(near), float(far))


def _wide(sample: Sample) -> bool:
    return abs(sample.far - sample.near) > EDGE * abs(sample.value)


def _either(sample: Sample) -> Sample:
    """The sample where either of two depths may be meant: a uniform law from the one to the other, about its value."""
    limit = max(abs(sample.far - sample.value), abs(sample.value - sample.near))
    return replace(sample, spread=max(sample.spread, limit / math.sqrt(3)), edge=True)


def _nothing(where: str) -> GeometryError:
    return GeometryError(f"the depth map has no number at {where}; choose a place where it has one", code="no_depth")
