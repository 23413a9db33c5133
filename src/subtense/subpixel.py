"""Sub-pixel edges in linear light: the four sides of a dark square on a light ground, and its corners with covariance.

Each side is fitted as a blurred step over the pixels of a strip along it:
I = low + (high - low) Phi((n - a - b t - c t^2) / s), with low and high linear in t. Fitting pixels, not interpolated
profiles, leaves their noise independent, so the covariance is that of the residuals.

Source: the blurred-edge model of W. Förstner and B. Wrobel, Photogrammetric Computer Vision, 15.3; traps of encoded values:
an edge blurred in linear light and located in encoded values moves by up to 0.8 blur radii into the dark side.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from .distribution import Array

CURVE_SHIFT = 0.15
"""u of an edge's place, in blur radii, because a camera's transfer curve is not exactly that of sRGB."""
MODEL_SIGMA_PX = 0.02
"""What the edge model leaves out: uneven sampling, printing."""
CURVED_FROM_PX = 80.0
"""Sides longer than this may be bent by the lens, and get a quadratic term."""
WIDEST_STRIP_PX = 6.0
_SAMPLES = 1500


def linear_light(pixels: npt.NDArray[np.uint8]) -> Array:
    """(H, W, 3) sRGB to (H, W) linear luminance, 0 to 1 (IEC 61966-2-1)."""
    v = np.arange(256) / 255.0
    table = np.where(v <= 0.04045, v / 12.92, ((v + 0.055) / 1.055) ** 2.4)
    return np.asarray(table[pixels] @ np.array([0.2126, 0.7152, 0.0722]))


@dataclass(frozen=True)
class Side:
    """One fitted side: point(t) = start + t along + (a + b t + c t^2) across, t from 0 to length.

    Attributes:
        start: (2,) px.
        along: (2,) unit vector.
        across: (2,) unit vector, to the outside.
        bend: (3,) a, b, c.
        cov: (3, 3) of them.
        blur_px: radius of the blur.
        contrast: high less low.
        misfit: rms residual over contrast.
    """

    start: Array
    along: Array
    across: Array
    bend: Array
    cov: Array
    blur_px: float
    contrast: float
    misfit: float


@dataclass(frozen=True)
class Quad:
    """Four corners of a dark quadrilateral and their (8, 8) covariance; `misfit` is that of its worst side."""

    corners_px: Array
    cov: Array
    misfit: float
    contrast: float


def refine_quad(light: Array, corners_px: Array, module_px: float) -> Quad | None:
    """Refine the corners of a dark square on a light ground.

    Args:
        light: (H, W) linear luminance.
        corners_px: (4, 2) rough corners, in order around.
        module_px: width of what is surely plain on either side of the edges (a marker's module).

    Returns:
        The refined quad, or None where a side can't be seen.
    """
    corners = np.asarray(corners_px, float)
    half = float(np.clip(0.75 * module_px, 1.6, WIDEST_STRIP_PX))
    for _ in range(2):  # the second pass has its strips where the sides are
        sides = [fit_side(light, corners[i], corners[(i + 1) % 4], corners.mean(axis=0), half) for i in range(4)]
        if any(side is None for side in sides):
            return None
        good = [side for side in sides if side is not None]
        corners = _corners(good, np.stack([side.bend for side in good]))
    contrast = min(side.contrast for side in good)
    return Quad(corners, _corner_cov(good, corners), max(side.misfit for side in good), contrast)


def fit_side(light: Array, start: Array, end: Array, inside: Array, half: float) -> Side | None:
    """Fit one side in a strip of +-half px, from a light outside to a dark inside."""
    from scipy.optimize import least_squares

    length = float(np.hypot(*(end - start)))
    if length < 6:
        return None
    along = (end - start) / length
    across = np.array([along[1], -along[0]])
    if across @ (inside - start) > 0:
        across = -across
    t, n, value = _strip(light, start, along, across, length, half)
    if len(value) < 24:
        return None
    low, high = np.median(value[n < -half / 3]), np.median(value[n > half / 3])
    if not high - low > 0.02:
        return None
    u = 2 * t / length - 1  # -1 to 1 along the side, for a well-conditioned fit
    curved = length > CURVED_FROM_PX
    x0 = np.array([0.0, 0.0, 0.7, low, high, 0.0, 0.0] + [0.0] * curved)

    scale = high - low
    fit = least_squares(lambda x: (_edge(x, u, n) - value) / scale, x0, jac=lambda x: _edge_jacobian(x, u, n) / scale,
                        method="trf", x_scale=np.array([1, 1, 0.5, scale, scale, scale, scale] + [1.0] * curved),
                        max_nfev=40)  # fmt: skip
    x = fit.x
    if not fit.success or abs(x[0]) > half or abs(x[2]) > 2.5 * half or not x[4] - x[3] > 0.02:
        return None
    return _side(fit, start, along, across, length, curved, len(value))


def _side(fit: Any, start: Array, along: Array, across: Array, length: float, curved: bool, count: int) -> Side:
    x = fit.x
    dof = max(count - len(x), 1)
    variance = 2 * fit.cost / dof
    try:
        full = np.linalg.inv(fit.jac.T @ fit.jac) * variance
    except np.linalg.LinAlgError:
        full = np.eye(len(x))
    keep = [0, 1, 7] if curved else [0, 1]
    own = np.zeros((3, 3))
    own[: len(keep), : len(keep)] = full[np.ix_(keep, keep)]
    p = np.array([x[0], x[1], x[7] if curved else 0.0])
    # from u in -1..1 to t in 0..length: u = 2 t / length - 1
    k = 2 / length
    change = np.array([[1, -1, 1], [0, k, -2 * k], [0, 0, k * k]])
    contrast = float(x[4] - x[3])
    return Side(start, along, across, change @ p, change @ own @ change.T, abs(float(x[2])), contrast, float(np.sqrt(variance)))


def _strip(light: Array, start: Array, along: Array, across: Array, length: float, half: float) -> tuple[Array, Array, Array]:
    """Pixels of a strip along a side but for its ends: place along, place across, luminance."""
    margin = min(max(1.5 * half, 0.08 * length), 0.3 * length)
    ends = np.array([start + margin * along, start + (length - margin) * along])
    box = np.concatenate([ends - half * abs(across), ends + half * abs(across)])
    x0, y0 = np.maximum(np.floor(box.min(axis=0)).astype(int), 0)
    x1, y1 = np.minimum(np.ceil(box.max(axis=0)).astype(int) + 1, light.shape[::-1])
    if x1 <= x0 or y1 <= y0:
        return np.zeros(0), np.zeros(0), np.zeros(0)
    yy, xx = np.mgrid[y0:y1, x0:x1]
    dx, dy = xx - start[0], yy - start[1]
    t, n = dx * along[0] + dy * along[1], dx * across[0] + dy * across[1]
    inside = (t >= margin) & (t <= length - margin) & (abs(n) <= half)
    picked = np.flatnonzero(inside)
    picked = picked[:: max(1, len(picked) // _SAMPLES)]
    return t.ravel()[picked], n.ravel()[picked], light[y0:y1, x0:x1].ravel()[picked]


def _parts(x: Array, u: Array, n: Array) -> tuple[Array, Array, Array, Array, float]:
    blur = np.hypot(x[2], 0.28)  # a pixel's own width blurs by 0.29 px
    place = x[0] + x[1] * u + (x[7] * u * u if len(x) > 7 else 0.0)
    z = (n - place) / blur
    return z, x[3] + x[5] * u, x[4] + x[6] * u, np.exp(-z * z / 2) / np.sqrt(2 * np.pi), float(blur)


def _edge(x: Array, u: Array, n: Array) -> Array:
    from scipy.special import ndtr

    z, low, high, _, _ = _parts(x, u, n)
    return np.asarray(low + (high - low) * ndtr(z))


def _edge_jacobian(x: Array, u: Array, n: Array) -> Array:
    from scipy.special import ndtr

    z, low, high, density, blur = _parts(x, u, n)
    step = ndtr(z)
    slope = -(high - low) * density / blur
    columns = [slope, slope * u, slope * z * x[2] / blur, 1 - step, step, (1 - step) * u, step * u]
    if len(x) > 7:
        columns.append(slope * u * u)
    return np.stack(columns, -1)


def _corners(sides: list[Side], bends: Array) -> Array:
    """(4, 2) where side i - 1 meets side i, for bends (4, 3)."""
    out = np.empty((4, 2))
    for i in range(4):
        p, q, pb, qb = sides[i - 1], sides[i], bends[i - 1], bends[i]
        tp, tq = float((q.start - p.start) @ p.along), 0.0
        for _ in range(3):  # Newton on the two places along the sides
            gap = _point(q, qb, tq) - _point(p, pb, tp)
            jac = np.stack([_tangent(p, pb, tp), -_tangent(q, qb, tq)], -1)
            step = np.linalg.solve(jac, gap)
            tp, tq = tp + step[0], tq + step[1]
        out[i] = _point(q, qb, tq)
    return out


def _point(side: Side, bend: Array, t: float) -> Array:
    return np.asarray(side.start + t * side.along + (bend[0] + bend[1] * t + bend[2] * t * t) * side.across)


def _tangent(side: Side, bend: Array, t: float) -> Array:
    return np.asarray(side.along + (bend[1] + 2 * bend[2] * t) * side.across)


def _corner_cov(sides: list[Side], corners: Array) -> Array:
    """(8, 8) from the sides' covariances, the transfer curve (all sides out or in together) and the model's own sigma."""
    bends = np.stack([side.bend for side in sides])
    cov = np.eye(8) * MODEL_SIGMA_PX**2
    for i, side in enumerate(sides):
        sd = np.sqrt(np.diag(side.cov))
        jac = np.zeros((8, 3))
        for j in np.flatnonzero(sd > 0):
            moved = bends.copy()
            moved[i, j] += sd[j]
            jac[:, j] = (_corners(sides, moved) - corners).ravel() / sd[j]
        cov += jac @ side.cov @ jac.T
    shifted = bends.copy()
    shifted[:, 0] += [CURVE_SHIFT * side.blur_px for side in sides]
    outward = (_corners(sides, shifted) - corners).ravel()
    return np.asarray(cov + np.outer(outward, outward))
