"""Sub-pixel edges in linear light: the four sides of a dark square on a light ground, and its corners with covariance.

Each side is fitted as a step that was blurred in linear light and then encoded, over the pixels of a strip along it:
v = e(l + (h - l) Phi((n - a - b t - c t^2) / s)), with the encoded plateaus e(l) and e(h) linear in t and e the transfer curve.
An edge located in encoded values would move by up to 0.8 blur radii into the dark side. The curve is that of sRGB; a
camera's own is another, so its exponent carries u, which moves all sides out or in together. (The asymmetry of the edges would
tell g, but only through the tails of the blur, which sharpening and demosaicing change; it misled more than it told.)
Fitting pixels, not interpolated profiles, leaves their noise independent.

Source: the blurred-edge model of W. Förstner and B. Wrobel, Photogrammetric Computer Vision, 15.3; IEC 61966-2-1 (sRGB).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .arrays import Array, Pixels
from .quantity import Quantity
from .transfer import encoded_of, light_of, slope_of

CURVE = 2.2
"""Exponent of the transfer curve: that of sRGB over most of its range."""
CURVE_U = 0.5
"""Its u: cameras draw their own contrast curves; it moves an edge by 0.3 blur radii (half a radius, as limits)."""
PIXEL_BLUR = 0.28
"""A pixel's own width as a blur radius."""
SIDE_SIGMA_PX = 0.1
"""How far a whole side may lie off, whatever the residuals say: uneven prints, resampled pictures, unlike blur."""
CORNER_SIGMA_PX = 0.02
"""The same for a single corner."""
CURVED_FROM_PX = 80.0
"""Sides longer than this may be bent by the lens, and get a quadratic term."""
WIDEST_STRIP_PX = 6.0
_SAMPLES = 1500


def encoded_gray(pixels: Pixels) -> Array:
    """(H, W, 3) RGB to (H, W) encoded luminance, 0 to 1."""
    return np.asarray(pixels @ np.array([0.2126, 0.7152, 0.0722]) / 255.0)


@dataclass(frozen=True)
class Side:
    """One fitted side: point(t) = start + t along + (a + b t + c t^2) across, t from 0 to length.

    Attributes:
        start: (2,) px.
        along: (2,) unit vector.
        across: (2,) unit vector, to the outside.
        bend: (3,) a, b, c.
        cov: (3, 3) of them.
        contrast: encoded high less low.
        misfit: rms residual over contrast.
        by_curve: (3,) change of a, b, c with the exponent of the transfer curve.
    """

    start: Array
    along: Array
    across: Array
    bend: Array
    cov: Array
    contrast: float
    misfit: float
    by_curve: Array


@dataclass(frozen=True)
class Quad:
    """Four corners of a dark quadrilateral and their (8, 8) covariance; `misfit` is that of its worst side."""

    corners_px: Array
    cov: Array
    misfit: float
    contrast: float


def refine_quad(gray: Array, corners_px: Array, module_px: float, curve: Quantity | None = None) -> Quad | None:
    """Refine the corners of a dark square on a light ground.

    Args:
        gray: (H, W) encoded luminance, 0 to 1.
        corners_px: (4, 2) rough corners, in order around.
        module_px: width of what is surely plain on either side of the edges (a marker's module).
        curve: exponent of the transfer curve; None for sRGB with what cameras may differ from it.

    Returns:
        The refined quad, or None where a side can't be seen.
    """
    corners = np.asarray(corners_px, float)
    half = float(np.clip(0.5 * module_px, 1.6, WIDEST_STRIP_PX))
    exponent = CURVE if curve is None else float(curve.value)
    sides: list[Side] = []
    for _ in range(2):  # the second pass has its strips where the sides are
        sides = _sides(gray, corners, half, exponent)
        if len(sides) < 4:
            return None
        corners = _corners(sides, np.stack([side.bend for side in sides]))
    cov = _corner_cov(sides, corners, CURVE_U if curve is None else float(curve.u))
    return Quad(corners, cov, max(side.misfit for side in sides), min(side.contrast for side in sides))


def _sides(gray: Array, corners: Array, half: float, exponent: float) -> list[Side]:
    middle = corners.mean(axis=0)
    sides = [fit_side(gray, corners[i], corners[(i + 1) % 4], middle, half, exponent) for i in range(4)]
    return [side for side in sides if side is not None]


def fit_side(gray: Array, start: Array, end: Array, inside: Array, half: float, exponent: float = CURVE) -> Side | None:
    """Fit one side in a strip of +-half px, from a light outside to a dark inside.

    Args:
        gray: (H, W) encoded luminance.
        start: (2,) one end, px.
        end: (2,) the other.
        inside: (2,) a point on the dark side.
        half: half width of the strip, px.
        exponent: of the transfer curve.
    """
    length = float(np.hypot(*(end - start)))
    if length < 6:
        return None
    along = (end - start) / length
    across = np.array([along[1], -along[0]])
    if across @ (inside - start) > 0:
        across = -across
    t, n, value = _strip(gray, start, along, across, length, half)
    if len(value) < 24 or not np.any(n < -half / 3) or not np.any(n > half / 3):
        return None
    low, high = (float(np.median(value[where])) for where in (n < -half / 3, n > half / 3))
    scatter = max(
        float(np.median(abs(value[where] - level))) for where, level in ((n < -half / 3, low), (n > half / 3, high))
    )
    if not high - low > max(0.05, 2 * scatter):  # no step, or a picture of noise: not worth a fit
        return None
    u = 2 * t / length - 1  # -1 to 1 along the side, for a well-conditioned fit
    begin = np.array([0.0, 0.0, 0.6, low, high, 0.0, 0.0, exponent, 0.0])
    free = [0, 1, 2, 3, 4, 5, 6] + ([8] if length > CURVED_FROM_PX else [])
    x, cov, sigma = _fit(begin, free, u, n, value)
    if not np.all(np.isfinite(x)) or abs(x[0]) > half or abs(x[2]) > 2.5 * half or not x[4] - x[3] > 0.05:
        return None
    return _side(x, cov, sigma, u, n, free, start, along, across, length)


def _fit(x: Array, free: list[int], u: Array, n: Array, value: Array) -> tuple[Array, Array, float]:
    """Least squares over the free parameters: all of them, their covariance, and the residuals' standard deviation."""
    from scipy.optimize import least_squares

    def whole(p: Array) -> Array:
        full = x.copy()
        full[free] = p
        return full

    fit = least_squares(
        lambda p: _edge(whole(p), u, n) - value,
        x[free],
        lambda p: _edge_jacobian(whole(p), u, n)[:, free],
        method="lm",
        max_nfev=60,
    )
    sigma = max(float(np.sqrt(2 * fit.cost / max(len(value) - len(free), 1))), 1e-4)
    cov = np.zeros((9, 9))
    cov[np.ix_(free, free)] = np.linalg.pinv(fit.jac.T @ fit.jac) * sigma**2
    return whole(fit.x), cov, sigma


def _side(
    x: Array, cov: Array, sigma: float, u: Array, n: Array, free: list[int], start: Array, along: Array,
    across: Array, length: float,
) -> Side:  # fmt: skip
    keep = [0, 1, 8]
    jac = _edge_jacobian(x, u, n)
    by_curve = np.zeros(9)
    by_curve[free] = -np.linalg.lstsq(jac[:, free], jac[:, 7], rcond=None)[0]
    k = 2 / length  # from u in -1..1 to t in 0..length: u = k t - 1
    change = np.array([[1, -1, 1], [0, k, -2 * k], [0, 0, k * k]])
    contrast = float(x[4] - x[3])
    return Side(start, along, across, change @ x[keep], change @ cov[np.ix_(keep, keep)] @ change.T, contrast,
                sigma / contrast, change @ by_curve[keep])  # fmt: skip


def _strip(
    light: Array, start: Array, along: Array, across: Array, length: float, half: float
) -> tuple[Array, Array, Array]:
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


_DARKEST = 1e-3
_CURVE_STEP = 1e-4


def _edge(x: Array, u: Array, n: Array) -> Array:
    """Encoded values of the model; x = a, b, blur, low, high, slopes of low and high, exponent, c."""
    return _edge_parts(x, u, n)[0]


def _edge_parts(x: Array, u: Array, n: Array) -> tuple[Array, ...]:
    from scipy.special import ndtr

    blur = np.hypot(x[2], PIXEL_BLUR)
    z = (n - x[0] - x[1] * u - x[8] * u * u) / blur
    low, high = np.maximum(x[3] + x[5] * u, _DARKEST), np.maximum(x[4] + x[6] * u, _DARKEST)
    step, g = ndtr(z), float(np.clip(x[7], 0.5, 4.0))
    low_light, high_light = light_of(low, g), light_of(high, g)
    light = low_light + (high_light - low_light) * step
    return encoded_of(light, g), z, step, low, high, low_light, high_light


def _edge_jacobian(x: Array, u: Array, n: Array) -> Array:
    """(samples, 9) derivatives of `_edge`."""
    value, z, step, low, high, low_light, high_light = _edge_parts(x, u, n)
    blur, g = np.hypot(x[2], PIXEL_BLUR), float(np.clip(x[7], 0.5, 4.0))
    encode = 1 / slope_of(np.maximum(value, _DARKEST), g)
    by_place = -encode * (high_light - low_light) * np.exp(-z * z / 2) / np.sqrt(2 * np.pi) / blur
    by_low, by_high = encode * slope_of(low, g) * (1 - step), encode * slope_of(high, g) * step
    other = g + _CURVE_STEP
    dark, bright = light_of(low, other), light_of(high, other)
    by_g = (encoded_of(dark + (bright - dark) * step, other) - value) / _CURVE_STEP
    return np.stack([by_place, by_place * u, by_place * z * x[2] / blur, by_low, by_high, by_low * u, by_high * u, by_g,
                     by_place * u * u], -1)  # fmt: skip


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


def _corner_cov(sides: list[Side], corners: Array, curve_u: float) -> Array:
    """(8, 8) from the sides' covariances, the transfer curve (all sides together) and what the model leaves out."""
    bends = np.stack([side.bend for side in sides])
    cov = np.eye(8) * CORNER_SIGMA_PX**2
    for i, side in enumerate(sides):
        own = side.cov + np.diag([SIDE_SIGMA_PX**2, 0.0, 0.0])
        sd = np.sqrt(np.diag(own))
        jac = np.zeros((8, 3))
        for j in np.flatnonzero(sd > 0):
            moved = bends.copy()
            moved[i, j] += sd[j]
            jac[:, j] = (_corners(sides, moved) - corners).ravel() / sd[j]
        cov += jac @ own @ jac.T
    shifted = bends + curve_u * np.stack([side.by_curve for side in sides])
    outward = (_corners(sides, shifted) - corners).ravel()
    return np.asarray(cov + np.outer(outward, outward))
