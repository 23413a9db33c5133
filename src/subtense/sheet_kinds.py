"""Which known rectangle a quadrilateral can be: its aspect and its right angles, as the camera sees them.

With the homography [h1 h2 h3] from the unit square to the corners in normalised coordinates, a rectangle has the aspect
|h1| / |h2| (width over height) and h1 . h2 = 0. Both are weighed with the covariance of corners and camera. Where the
camera is unknown, focal lengths of usual lenses are tried, with the picture's middle as principal point: for a sheet that faces
the camera the aspect hardly depends on them.

Source: Z. Zhang, L.-W. He, Whiteboard scanning and image enhancement, Digital Signal Processing, 2007.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .arrays import Array
from .camera import Camera
from .targets import KnownTarget

GATE = 13.8
"""Chi^2 of two numbers that one in a thousand exceeds."""
AS_WELL = 0.05
"""Of the best kind's likelihood: kinds with more fit as well."""
FLOOR = 0.004
"""Of aspect and right angle: sheets that are not quite flat, cards that are not quite cut square."""
USUAL_F = 0.75
"""Focal length over the picture's diagonal: of lenses between wide angle and short tele."""
USUAL_F_SPREAD = 0.45
"""Standard deviation of its logarithm."""
_TRIED = np.linspace(-2.0, 2.0, 9)


@dataclass(frozen=True)
class KindFit:
    """How well one kind explains a quadrilateral.

    Attributes:
        target: the kind.
        chi2: of aspect and right angle, 2 degrees of freedom; the least over what the camera may be.
        likelihood: density of what was seen, for ranking kinds.
        u_aspect: relative standard deviation of the aspect as seen.
        first: which corner is the target's top-left, 0 or 1; its width then runs to the next corner.
    """

    target: KnownTarget
    chi2: float
    likelihood: float
    u_aspect: float
    first: int


def shape_numbers(x: Array, y: Array) -> Array:
    """(..., 2) logarithm of the aspect, and cosine of the angle at the corners, of (..., 4) normalised corners in order."""
    dx1, dx2, sx = x[..., 1] - x[..., 2], x[..., 3] - x[..., 2], x[..., 0] - x[..., 1] + x[..., 2] - x[..., 3]
    dy1, dy2, sy = y[..., 1] - y[..., 2], y[..., 3] - y[..., 2], y[..., 0] - y[..., 1] + y[..., 2] - y[..., 3]
    with np.errstate(divide="ignore", invalid="ignore"):
        den = dx1 * dy2 - dy1 * dx2
        g, h = (sx * dy2 - sy * dx2) / den, (dx1 * sy - dy1 * sx) / den
        one = np.stack([x[..., 1] - x[..., 0] + g * x[..., 1], y[..., 1] - y[..., 0] + g * y[..., 1], g], -1)
        two = np.stack([x[..., 3] - x[..., 0] + h * x[..., 3], y[..., 3] - y[..., 0] + h * y[..., 3], h], -1)
        a, b = np.sqrt(np.sum(one**2, -1)), np.sqrt(np.sum(two**2, -1))
        return np.stack([np.log(a / b), np.sum(one * two, -1) / (a * b)], -1)


def usual_cameras(width_px: int, height_px: int) -> list[tuple[Camera, float]]:
    """(camera, weight) of the lenses that an unknown camera may have; the weights sum to 1."""
    diagonal, step = math.hypot(width_px, height_px), USUAL_F_SPREAD * float(_TRIED[1] - _TRIED[0])
    weights = np.exp(-(_TRIED**2) / 2)
    out = []
    for z, weight in zip(_TRIED, weights / weights.sum(), strict=True):
        f = USUAL_F * math.exp(USUAL_F_SPREAD * float(z)) * diagonal
        u_middle = 0.01 * diagonal
        cov = np.diag([(step / math.sqrt(12) * f) ** 2, 0.0, u_middle**2, u_middle**2])
        middle = ((width_px - 1) / 2, (height_px - 1) / 2)
        out.append((Camera(width_px, height_px, f, *middle, cov=cov), float(weight)))
    return out


def kind_fits(
    corners_px: Array, cov: Array, cameras: Sequence[tuple[Camera, float]], kinds: Sequence[KnownTarget]
) -> list[KindFit]:
    """How well each kind of rectangle fits, best first; those beyond GATE are left out.

    Args:
        corners_px: (4, 2) in order around.
        cov: (8, 8) of them.
        cameras: what the camera may be, with weights that sum to 1.
        kinds: with the shape "rectangle".
    """
    told = [(_numbers(camera, corners_px, cov), weight) for camera, weight in cameras]
    u_aspect = _spread_of_aspect(told)
    found = []
    for kind in kinds:
        assert kind.width is not None and kind.height is not None
        w, h = (float(side.value) for side in (kind.width, kind.height))
        own = math.hypot(float(kind.width.u) / w, float(kind.height.u) / h)
        fits = [_weighed(told, sign * math.log(w / h), own) for sign in (1.0, -1.0)]
        first = int(np.argmax([likelihood for _, likelihood in fits]))
        chi2, likelihood = fits[first]
        if chi2 < GATE and likelihood > 0:
            found.append(KindFit(kind, chi2, likelihood, u_aspect, first))
    return sorted(found, key=lambda fit: -fit.likelihood)


def _weighed(told: Sequence[tuple[tuple[Array, Array], float]], log_aspect: float, own: float) -> tuple[float, float]:
    """(least chi^2, likelihood) over cameras."""
    least, total = math.inf, 0.0
    for (value, spread), weight in told:
        whole = spread + np.diag([own**2, 0.0])
        off = value - [log_aspect, 0.0]
        determinant = float(np.linalg.det(whole)) if np.all(np.isfinite(whole)) else 0.0
        if not determinant > 0 or not np.all(np.isfinite(off)):
            continue
        chi2 = float(off @ np.linalg.solve(whole, off))
        least = min(least, chi2)
        total += weight * math.exp(-min(chi2, 1400.0) / 2) / math.sqrt(determinant)
    return least, total


def _spread_of_aspect(told: Sequence[tuple[tuple[Array, Array], float]]) -> float:
    """Standard deviation of the logarithm of the aspect, over the cameras that leave the corners right angles."""
    values, weights = [], []
    for (value, spread), weight in told:
        if np.all(np.isfinite(value)) and np.all(np.isfinite(spread)):
            right = math.exp(-min(value[1] ** 2 / spread[1, 1], 1400.0) / 2) + 1e-12
            # known right angles tell the aspect better where the two vary together
            values.append((value[0], spread[0, 0] - spread[0, 1] ** 2 / spread[1, 1]))
            weights.append(weight * right)
    if not values:
        return math.inf
    mean, variance = np.array(values).T
    middle = np.average(mean, weights=weights)
    return math.sqrt(float(np.average(np.maximum(variance, 0.0) + (mean - middle) ** 2, weights=weights)))


def _numbers(camera: Camera, corners: Array, cov: Array) -> tuple[Array, Array]:
    """(2,) shape numbers and their (2, 2) covariance from corners and camera."""
    step = 0.01
    moved = corners.ravel() + np.concatenate([np.zeros((1, 8)), step * np.eye(8), -step * np.eye(8)])
    numbers = shape_numbers(*camera.slopes(moved.reshape(-1, 4, 2)))
    jac = (numbers[1:9] - numbers[9:]).T / (2 * step)
    spread = jac @ cov @ jac.T + FLOOR**2 * np.eye(2)
    for part in camera.parts():
        values = np.asarray(part.value, float)
        own = part.cov if part.cov is not None else np.diag(np.asarray(part.u, float) ** 2)
        own_jac = np.zeros((2, len(values)))
        for i in np.flatnonzero(np.diag(own) > 0):
            near = values.copy()
            sd = math.sqrt(own[i, i])
            near[i] += 0.1 * sd
            other = shape_numbers(*camera.moved({part.key: near}).slopes(corners[None]))[0]
            own_jac[:, i] = (other - numbers[0]) / (0.1 * sd)
        spread = spread + own_jac @ own @ own_jac.T
    return numbers[0], np.asarray(spread)
