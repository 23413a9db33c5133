"""One point of a rectified left picture found in the right one, to a fraction of a pixel, with its standard deviation.

A window around the point is moved along the row until it fits best, then fitted by least squares: place, slant of the surface (the
disparity's slopes), a part of a pixel between the rows, and brightness and contrast. The deviation is that of the fit.

Source: A. Gruen, Adaptive least squares correlation, South African Journal of Photogrammetry 14, 1985.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from .arrays import Array, Pixels

HALF_PX = 7
"""Half the window."""
WIDE_PX = 12
"""Half of one that is tried where the first has too little texture."""
LEAST_NOISE = 1.0
"""Of gray levels."""
TOGETHER = 2.0
"""By which variances are larger because residuals of neighbours go together."""
FLOOR_PX = 0.1
"""Least standard deviation: lens blur and interpolation differ between the two pictures."""
POOR = 0.6
"""Correlation below which nothing fits."""
RIVAL = 0.05
"""A second place that correlates as well up to this makes the match ambiguous."""
PRIORS = (np.inf, 0.3, 0.3, 0.5)
"""Standard deviations of what is fitted before anything is seen: disparity, its two slopes, and the rows' difference, px."""


@dataclass(frozen=True)
class PointMatch:
    """A point found.

    Attributes:
        disparity_px: column in the left picture less that in the right one.
        sigma_px: its standard deviation.
        rows_px: row in the right picture less that in the left one.
        correlation: of the two windows, -1 to 1.
        rival_px: another disparity that fits nearly as well; NaN for none.
    """

    disparity_px: float
    sigma_px: float
    rows_px: float
    correlation: float
    rival_px: float


def match_point(
    left: Pixels, right: Pixels, spot_px: Array, low: int, high: int, near_px: float = np.nan
) -> PointMatch | None:
    """Find the point of the left picture in the right one; None where nothing fits, or the way back leads elsewhere.

    Args:
        left: (height, width) uint8, rectified.
        right: likewise.
        spot_px: (2,) in the left picture.
        low: least disparity to look for.
        high: greatest.
        near_px: what is known of it from elsewhere; NaN for nothing.
    """
    first = _searched(left, right, spot_px, low, high)
    if first is None:
        return None
    guess, rival = first
    if np.isfinite(near_px):
        rival = guess if abs(guess - near_px) > 2 else rival
        guess = near_px
    best: PointMatch | None = None
    for half in (HALF_PX, WIDE_PX):
        fitted = _fitted(left, right, spot_px, guess, half)
        if fitted is not None and (best is None or fitted[1] < best.sigma_px):
            best = PointMatch(*fitted, rival)
        if best is not None and best.sigma_px < 2 * FLOOR_PX:
            break
    if best is None or best.correlation < POOR or abs(best.disparity_px - guess) > 2:
        return None
    there = np.array([spot_px[0] - best.disparity_px, spot_px[1] + best.rows_px])
    back = _fitted(right, left, there, -best.disparity_px, HALF_PX)
    if back is None or abs(back[0] + best.disparity_px) > max(1.0, 4 * best.sigma_px):
        return None
    return best


def _searched(left: Pixels, right: Pixels, spot: Array, low: int, high: int) -> tuple[float, float] | None:
    """The whole disparity that correlates best, and a rival that does so nearly as well."""
    import cv2

    x, y, half = round(float(spot[0])), round(float(spot[1])), HALF_PX
    window = _padded(left, x - half, y - half, 2 * half + 1)
    if window is None or float(np.std(window)) < 1e-6:
        return None
    strip = _strip(right, x - high - half, x - low + half, y - half, 2 * half + 1)
    if strip is None:
        return None
    score = np.nan_to_num(
        cv2.matchTemplate(strip, window, cv2.TM_CCOEFF_NORMED)[0].astype(float), nan=-1.0, posinf=-1.0, neginf=-1.0
    )
    best = int(np.argmax(score))
    others = np.array(score)
    others[max(best - 3, 0) : best + 4] = -1
    peaks = np.flatnonzero((others >= score[best] - RIVAL) & (others > POOR))
    disparity = float(high - best)
    return disparity, (float(high - peaks[np.argmax(others[peaks])]) if len(peaks) else np.nan)


def _padded(picture: Pixels, left: int, top: int, size: int) -> Pixels | None:
    height, width = picture.shape
    inside = left >= 0 and top >= 0 and left + size <= width and top + size <= height
    return picture[top : top + size, left : left + size] if inside else None


def _strip(picture: Pixels, first: int, last: int, top: int, size: int) -> Pixels | None:
    """Columns `first` to `last` of some rows; what lies beyond the picture repeats its edge."""
    if top < 0 or top + size > picture.shape[0]:
        return None
    columns = np.clip(np.arange(first, last + 1), 0, picture.shape[1] - 1)
    return np.ascontiguousarray(picture[top : top + size][:, columns])


def _fitted(
    left: Pixels, right: Pixels, spot: Array, guess: float, half: int
) -> tuple[float, float, float, float] | None:
    """Disparity, its standard deviation, the rows' difference and the correlation, by least squares from a guess.

    L(x, y) = g R(x - d - a (x - x0) - b (y - y0), y + v) + o, with weights that fall off from the middle.
    """
    step = np.arange(-half, half + 1, dtype=float)
    dx, dy = np.meshgrid(step, step)
    weight = np.exp(-(dx**2 + dy**2) / (2 * (half / 1.5) ** 2)).ravel()
    mine = _sampled(left, spot[0] + dx, spot[1] + dy)
    if mine is None:
        return None
    shape = np.array([guess, 0.0, 0.0, 0.0])
    prior = np.array([0.0 if np.isinf(s) else 1 / s**2 for s in PRIORS])
    for _ in range(12):
        moved = _moved(right, spot, dx, dy, shape)
        if moved is None:
            return None
        theirs, along, across = moved
        gain, offset = _brightness(mine, theirs, weight)
        jacobian = np.stack([-along, -along * dx.ravel(), -along * dy.ravel(), across], -1) * gain
        full = np.column_stack([jacobian, theirs, np.ones_like(theirs)])
        residual = mine - gain * theirs - offset
        noise = max(float(weight @ residual**2 / weight.sum()), LEAST_NOISE**2)
        normal = (full * weight[:, None]).T @ full / noise
        normal[range(4), range(4)] += prior
        normal[range(6), range(6)] += 1e-9 * np.maximum(np.diag(normal), 1e-9)
        pull = (full * weight[:, None]).T @ residual / noise
        pull[:4] -= prior * np.array([0.0, *shape[1:]])
        change = np.linalg.solve(normal, pull)[:4]
        shape = shape + np.clip(change, -1, 1)
        if abs(change[0]) < 1e-3:
            break
    else:
        return None
    together = weight.sum() / max(float((weight**2).sum()), 1e-9)  # weights count as less than whole observations
    sigma = float(np.sqrt(TOGETHER * np.linalg.inv(normal)[0, 0] * max(together / 2, 1.0) + FLOOR_PX**2))
    spread = np.sqrt(_variance(mine, weight) * _variance(theirs, weight))
    middle = [float(weight @ one / weight.sum()) for one in (mine, theirs)]
    correlation = float(weight @ ((mine - middle[0]) * (theirs - middle[1])) / weight.sum() / max(spread, 1e-9))
    return float(shape[0]), sigma, float(shape[3]), correlation


def _moved(right: Pixels, spot: Array, dx: Array, dy: Array, shape: Array) -> tuple[Array, Array, Array] | None:
    """The right picture where the left one's window goes, and its slopes along and across the row."""
    x = spot[0] + dx - shape[0] - shape[1] * dx - shape[2] * dy
    y = spot[1] + dy + shape[3]
    middle = _sampled(right, x, y)
    sides = [_sampled(right, x + a, y + b) for a, b in ((0.5, 0), (-0.5, 0), (0, 0.5), (0, -0.5))]
    if middle is None or any(side is None for side in sides):
        return None
    east, west, south, north = (np.asarray(side) for side in sides)
    return middle, east - west, south - north


def _sampled(picture: Pixels, x: Array, y: Array) -> Any:
    """(n,) gray levels between pixels; None where the window leaves the picture."""
    import cv2

    height, width = picture.shape
    if x.min() < 1 or y.min() < 1 or x.max() > width - 2 or y.max() > height - 2 or not np.isfinite(x).all():
        return None
    left, top = int(x.min()) - 3, int(y.min()) - 3
    left, top = max(left, 0), max(top, 0)
    part = picture[top : int(y.max()) + 5, left : int(x.max()) + 5].astype(np.float32)
    at = (x - left).astype(np.float32), (y - top).astype(np.float32)
    return cv2.remap(part, *at, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE).astype(float).ravel()


def _brightness(mine: Array, theirs: Array, weight: Array) -> tuple[float, float]:
    """Gain and offset that take their gray levels to mine."""
    total = weight.sum()
    a, b = float(weight @ mine / total), float(weight @ theirs / total)
    variance = _variance(theirs, weight)
    gain = float(weight @ ((mine - a) * (theirs - b)) / total / variance) if variance > 1e-6 else 1.0
    gain = min(max(gain, 0.3), 3.0)
    return gain, a - gain * b


def _variance(values: Array, weight: Array) -> float:
    total = weight.sum()
    middle = float(weight @ values / total)
    return float(weight @ (values - middle) ** 2 / total)
