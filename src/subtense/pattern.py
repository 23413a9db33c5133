"""A printed pattern of dark and light cells, fitted as a whole: its corners with covariance.

The picture of a flat pattern is modelled as its cells under a homography, blurred in linear light, and encoded; what is
free are the homography, the blur, the two plateaus, a gradient of the illumination, and the exponent of the transfer curve
about what is known of it. An unknown curve (and ink that spreads) moves the outer sides of a marker in or out together
and can't be told from its size; but it moves the edges of the light cells within the other way, so that the pattern as a
whole tells both. Large patterns may be bent by the lens, and get a quadratic term.

A cell's edge along a is blurred by s |grad a| in units of a. Seen obliquely the two directions are correlated at the cells'
corners, rho = grad a . grad b / (|grad a| |grad b|), and the share of a cell is a bivariate normal probability: the tetrachoric
series, Phi(h) Phi(k) + sum rho^m / m! He_(m-1)(h) phi(h) He_(m-1)(k) phi(k), whose terms are sums over rows and columns like the first.

Source: M. G. Kendall, Proof of relations connected with the tetrachoric series, Biometrika 32 (1941).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .arrays import Array, Indices
from .quantity import Quantity
from .transfer import encoded_of, light_of, slope_of

PIXEL_BLUR = 0.28
"""A pixel's own width as a blur radius."""
BENT_FROM_PX = 60.0
"""Patterns with longer sides may be bent by the lens."""
MOST_PIXELS = 2000
MOST_STEPS = 25
SETTLED_PX = 3e-3
FEWER_PIXELS = 400
ROUGHLY_PX = 0.1
"""The first steps go with fewer pixels, until they are this short."""
FLOOR_PX = 0.01
"""Standard deviation that is in any case there, of each corner by itself and of all sides outward together: uneven prints,
resampled pictures, unlike blur."""
LOSSY_PX = 0.025
"""The same of a picture that was compressed with losses: what is lost is alike over a cell, and no noise."""
LEAST_NOISE = 1e-3
"""Standard deviation of encoded values that rounding alone makes."""
COST_NOISE = 0.01
"""The same as it usually is, which weighs the pixels against what is known of the curve while the fit goes on."""
OFF = 0.6
"""Of the contrast: residuals that count no more."""
LEAST_SEEN = 0.88
"""Share of a pattern that must be as it should."""
MOST_TERMS = 6
LEAST_TERM = 0.02
"""Terms of the series are left out from where their powers of the correlation are smaller."""
_DARKEST = 1e-3

# the parameters: 8 of the homography, bends, then these
_BLUR, _LOW, _HIGH, _GX, _GY, _POWER = range(6)
_OTHERS = 6


@dataclass(frozen=True)
class Fitted:
    """Corners of a pattern.

    Attributes:
        corners_px: (4, 2) where the pattern's top-left, top-right, bottom-right, bottom-left corners are seen.
        cov: (8, 8) of them, px^2.
        misfit: rms residual over contrast.
        contrast: encoded high less low.
        blur_px: radius of the blur.
        curve: exponent found.
    """

    corners_px: Array
    cov: Array
    misfit: float
    contrast: float
    blur_px: float
    curve: float


def fit_pattern(
    gray: Array, corners_px: Array, cells: Array, curve: Quantity, floor_px: float = FLOOR_PX
) -> Fitted | None:
    """Fit a pattern where it was roughly found.

    Args:
        gray: (H, W) encoded luminance, 0 to 1; its value at a pixel is that of the pixel's centre.
        corners_px: (4, 2) its rough corners, to a quarter of a cell.
        cells: (n, n) 1 light, 0 dark; beyond it is light.
        curve: exponent of the transfer curve.
        floor_px: what is added to the corners' covariance in any case; see FLOOR_PX.

    Returns:
        The corners, or None where no such pattern is to be seen.
    """
    patch = _Patch.of(gray, corners_px, cells)
    if patch is None:
        return None
    begin = _begin(patch, corners_px, curve)
    if begin is None:
        return None
    with np.errstate(all="ignore"):
        near = begin if len(patch.value) < 2 * FEWER_PIXELS else _solve(patch.fewer(), begin, curve, ROUGHLY_PX)
        solved = None if near is None else _solve(patch, near, curve, SETTLED_PX)
        found = None if solved is None else _settled(patch, solved, curve)
    return None if found is None or solved is None else _fitted(patch, solved, *found, floor_px)


@dataclass(frozen=True)
class _Patch:
    """The pixels of a pattern, about their middle and in units of its half width, so that all parameters are of like size.

    Attributes:
        xy: (k, 2) places.
        value: (k,) encoded luminance.
        dark: (n, n) 1 - cells, rows by b, columns by a.
        middle_px: of the pattern.
        unit_px: half its width.
        bends: whether a quadratic term is fitted.
    """

    xy: Array
    value: Array
    dark: Array
    middle_px: Array
    unit_px: float
    bends: bool

    @classmethod
    def of(cls, gray: Array, corners_px: Array, cells: Array) -> _Patch | None:
        corners = np.asarray(corners_px, float)
        n = len(cells)
        sides = np.hypot(*(np.roll(corners, -1, axis=0) - corners).T)
        middle, unit = corners.mean(axis=0), float(sides.mean()) / 2
        margin = 2 * unit / n
        low = np.maximum(np.floor(corners.min(axis=0) - margin).astype(int), 0)
        high = np.minimum(np.ceil(corners.max(axis=0) + margin).astype(int) + 1, gray.shape[::-1])
        if np.any(high - low < 4) or unit < 3:
            return None
        yy, xx = np.mgrid[low[1] : high[1], low[0] : high[0]]
        xy = (np.stack([xx.ravel(), yy.ravel()], -1) - middle) / unit
        h = _homography((corners - middle) / unit)
        if h is None:
            return None
        a, b = _cell_places(h, xy, bends=False)[:2]
        inside = (a > -1 / n) & (a < 1 + 1 / n) & (b > -1 / n) & (b < 1 + 1 / n)
        picked = np.flatnonzero(inside)
        if len(picked) < 40:
            return None
        picked = picked[_telling(a[picked], b[picked], n, unit)]
        value = np.asarray(gray[yy.ravel()[picked], xx.ravel()[picked]], float)
        return cls(xy[picked], value, 1.0 - np.asarray(cells, float), middle, unit, bool(sides.max() > BENT_FROM_PX))

    def fewer(self) -> _Patch:
        """A part of the pixels, for the first steps."""
        step = len(self.value) // FEWER_PIXELS
        return replace(self, xy=self.xy[::step], value=self.value[::step])


def _telling(a: Array, b: Array, n: int, unit: float) -> Indices:
    """Indices of at most MOST_PIXELS pixels: near the edges first, and some of the plateaus."""
    if len(a) <= MOST_PIXELS:
        return np.arange(len(a))
    cell_px = 2 * unit / n
    gap = np.minimum(abs(a * n - np.round(a * n)), abs(b * n - np.round(b * n))) * cell_px
    near = np.flatnonzero(gap < 3.0)
    far = np.flatnonzero(gap >= 3.0)
    few = far[:: max(1, len(far) // (MOST_PIXELS // 4))]
    return np.concatenate([near[:: max(1, -(-len(near) // MOST_PIXELS))], few])


def _homography(corners: Array) -> Array | None:
    """(8,) of the map from places to cells, a = (h0 x + h1 y + h2) / (h6 x + h7 y + 1), by four corners of the unit square."""
    rows, right = [], []
    for (x, y), (a, b) in zip(corners, ((0, 0), (1, 0), (1, 1), (0, 1)), strict=True):
        rows += [[x, y, 1, 0, 0, 0, -a * x, -a * y], [0, 0, 0, x, y, 1, -b * x, -b * y]]
        right += [a, b]
    try:
        return np.asarray(np.linalg.solve(np.array(rows), np.array(right, float)))
    except np.linalg.LinAlgError:
        return None


def _cell_places(h: Array, xy: Array, *, bends: bool) -> tuple[Array, ...]:
    """a, b of places, their gradients' lengths and correlation, and what derivatives are divided by."""
    x, y = xy[:, 0], xy[:, 1]
    d = h[6] * x + h[7] * y + 1
    a, b = (h[0] * x + h[1] * y + h[2]) / d, (h[3] * x + h[4] * y + h[5]) / d
    ax, ay, bx, by = h[0] - a * h[6], h[1] - a * h[7], h[3] - b * h[6], h[4] - b * h[7]
    long_a, long_b = np.hypot(ax, ay), np.hypot(bx, by)
    rho = (ax * bx + ay * by) / (long_a * long_b)
    if bends:  # terms that a homography doesn't have: a bent by b and b by a, and either by itself
        p, q = a - 0.5, b - 0.5
        a, b = a + h[8] * q * q + h[9] * p * p, b + h[10] * p * p + h[11] * q * q
    return a, b, long_a / abs(d), long_b / abs(d), rho, d


def _blurred(place: Array, sigma: Array, n: int) -> tuple[Array, Array, Array, Array, Array]:
    """(k, n) share of each cell at a place, its derivative by the place, and by the logarithm of sigma; (k, n + 1) z, phi."""
    from scipy.special import ndtr

    z = (place[:, None] - np.arange(n + 1) / n) / sigma[:, None]
    step = ndtr(z)
    density = np.exp(-0.5 * z * z) * (1 / np.sqrt(2 * np.pi))
    wider = density * z
    per = 1 / sigma[:, None]
    return _between(step), _between(density) * per, -_between(wider), z, density


def _between(at_edges: Array) -> Array:
    """(k, n) of cells, from (k, n + 1) of their edges."""
    return np.asarray(at_edges[:, :-1] - at_edges[:, 1:])


def _correlated(patch: _Patch, rho: Array, z_a: Array, phi_a: Array, z_b: Array, phi_b: Array) -> Array:
    """(k,) what the correlation of the two directions adds to the dark share: the series from its first power on."""
    most = float(np.max(abs(rho)))
    added, power = np.zeros(len(rho)), np.ones(len(rho))
    before_a, before_b = np.zeros_like(z_a), np.zeros_like(z_b)
    now_a, now_b = np.ones_like(z_a), np.ones_like(z_b)
    for m in range(1, MOST_TERMS + 1):
        if most**m < LEAST_TERM:
            break
        power = power * rho / m
        in_a, in_b = _between(now_a * phi_a), _between(now_b * phi_b)
        added += power * np.einsum("ki,ki->k", in_b @ patch.dark, in_a)
        now_a, before_a = z_a * now_a - (m - 1) * before_a, now_a
        now_b, before_b = z_b * now_b - (m - 1) * before_b, now_b
    return added


def _model(patch: _Patch, x: Array) -> tuple[Array, Array]:
    """Encoded values, and their derivatives (k, parameters)."""
    count = len(x) - _OTHERS
    rest = x[count:]
    place, (a, b, d) = _shares(patch, x)
    value, per_share, others = _encoded(patch, place.share, rest)
    jac = np.empty((len(value), len(x)))
    _by_map(jac, per_share * place.by_a, per_share * place.by_b, patch.xy, a, b, d, bends=patch.bends)
    blur2 = float(rest[_BLUR]) ** 2 + PIXEL_BLUR**2
    jac[:, count + _BLUR] = per_share * place.by_blur * rest[_BLUR] / blur2
    jac[:, count + _LOW :] = others
    return value, jac


@dataclass(frozen=True)
class _Shares:
    """(k,) share of light at each pixel, and its derivatives by a, b, and the logarithm of the blur."""

    share: Array
    by_a: Array
    by_b: Array
    by_blur: Array


def _shares(patch: _Patch, x: Array) -> tuple[_Shares, tuple[Array, Array, Array]]:
    """The pattern as light, and a, b and the homography's divisor."""
    count, n = len(x) - _OTHERS, len(patch.dark)
    a, b, size_a, size_b, rho, d = _cell_places(x[:count], patch.xy, bends=patch.bends)
    blur = float(np.hypot(x[count + _BLUR], PIXEL_BLUR)) / patch.unit_px
    in_a, by_a, wide_a, z_a, phi_a = _blurred(a, blur * size_a, n)
    in_b, by_b, wide_b, z_b, phi_b = _blurred(b, blur * size_b, n)
    along_a, along_b = in_b @ patch.dark, in_a @ patch.dark.T  # what remains to be summed over a, over b
    dark = np.einsum("ki,ki->k", along_a, in_a) + _correlated(patch, rho, z_a, phi_a, z_b, phi_b)
    wider = np.einsum("ki,ki->k", along_a, wide_a) + np.einsum("ki,ki->k", along_b, wide_b)
    shares = _Shares(np.clip(1 - dark, 0.0, 1.0), -np.einsum("ki,ki->k", along_a, by_a),
                     -np.einsum("ki,ki->k", along_b, by_b), -wider)  # fmt: skip
    return shares, (a, b, d)


def _along(patch: _Patch, x: Array) -> tuple[Array, Array, Array, Array]:
    """a and b of each pixel, and the derivatives of its encoded value by them."""
    place, (a, b, _) = _shares(patch, x)
    per_share = _encoded(patch, place.share, x[len(x) - _OTHERS :])[1]
    return a, b, per_share * place.by_a, per_share * place.by_b


def _encoded(patch: _Patch, share: Array, rest: Array) -> tuple[Array, Array, Array]:
    """Encoded values of a share of light, their derivative by it, and (k, 5) by plateaus, gradient and exponent."""
    power = float(np.clip(rest[_POWER], 0.5, 4.0))
    low, high = (max(float(v), _DARKEST) for v in (rest[_LOW], rest[_HIGH]))
    gain = 1 + patch.xy @ rest[[_GX, _GY]]

    def light(exponent: float) -> Array:
        dark, bright = light_of(np.array([low, high]), exponent)
        return np.asarray(dark + (bright - dark) * share)

    plain = light(power)
    value = encoded_of(plain * gain, power)
    per_light = 1 / slope_of(np.maximum(value, _DARKEST), power)
    dark, bright = light_of(np.array([low, high]), power)
    by_low, by_high = slope_of(np.array([low, high]), power)
    step = 1e-4
    by_power = (encoded_of(light(power + step) * gain, power + step) - value) / step
    lit = per_light * gain
    others = np.stack([lit * (1 - share) * by_low, lit * share * by_high, per_light * plain * patch.xy[:, 0],
                       per_light * plain * patch.xy[:, 1], by_power], -1)  # fmt: skip
    return value, lit * (bright - dark), others


def _by_map(jac: Array, by_a: Array, by_b: Array, xy: Array, a: Array, b: Array, d: Array, *, bends: bool) -> None:
    """Derivatives by the map, from those by a and b."""
    x, y = xy[:, 0], xy[:, 1]
    wa, wb = by_a / d, by_b / d
    both = -(wa * a + wb * b)
    for i, column in enumerate((wa * x, wa * y, wa, wb * x, wb * y, wb, both * x, both * y)):
        jac[:, i] = column
    if bends:
        p2, q2 = (a - 0.5) ** 2, (b - 0.5) ** 2
        for i, column in enumerate((by_a * q2, by_a * p2, by_b * p2, by_b * q2), 8):
            jac[:, i] = column


def _begin(patch: _Patch, corners_px: Array, curve: Quantity) -> Array | None:
    h = _homography((np.asarray(corners_px, float) - patch.middle_px) / patch.unit_px)
    if h is None:
        return None
    low, high = (float(v) for v in np.percentile(patch.value, (10, 90)))
    if not high - low > 0.05:
        return None
    bends = np.zeros(4 if patch.bends else 0)
    return np.concatenate([h, bends, [0.7, low, high, 0.0, 0.0, float(curve.value)]])


def _solve(patch: _Patch, x: Array, curve: Quantity, settled_px: float) -> Array | None:
    """Levenberg-Marquardt with the curve's prior, and weights against what hides the pattern: the parameters."""
    free = _free(x, curve)
    value, jac = _model(patch, x)
    residual, damping = patch.value - value, 1e-3
    for _ in range(MOST_STEPS):
        weight = _weight(residual, x)
        normal, right = _normal(jac, residual, weight, x, free, curve)
        step = np.zeros(len(x))
        try:
            step[free] = np.linalg.solve(normal + damping * np.diag(np.diag(normal)), right)
        except np.linalg.LinAlgError:
            return None
        new_value, new_jac = _model(patch, x + step)
        new = patch.value - new_value
        if not np.all(np.isfinite(new)):
            return None
        if _cost(new, weight, x + step, curve) < _cost(residual, weight, x, curve):
            x, residual, jac, damping = x + step, new, new_jac, damping / 8
            if np.max(abs(step[:8])) * patch.unit_px < settled_px:
                break
        else:
            damping *= 8
            if damping > 1e6:
                break
    return x


def _free(x: Array, curve: Quantity) -> Indices:
    """Which parameters are free: all, or all but a curve that was told."""
    return np.arange(len(x) - (1 if float(curve.u) < 1e-9 else 0))


def _settled(patch: _Patch, x: Array, curve: Quantity) -> tuple[Array, float] | None:
    """Covariance of the parameters and standard deviation of the residuals; None where most is not as the pattern."""
    free, (value, jac) = _free(x, curve), _model(patch, x)
    residual = patch.value - value
    weight = _weight(residual, x)
    if np.mean(weight > 0.5) < LEAST_SEEN:
        return None
    spare = max(float(weight.sum()) - len(free), 1.0)
    sigma = max(float(np.sqrt(residual**2 @ weight / spare)), LEAST_NOISE)
    stray = _stray(patch, x, residual * weight, sigma)
    normal, _ = _normal(jac, residual, weight, x, free, curve, sigma * np.sqrt(stray))
    cov = np.zeros((len(x), len(x)))
    try:
        cov[np.ix_(free, free)] = np.linalg.inv(normal)
    except np.linalg.LinAlgError:
        return None
    return cov, sigma


def _weight(residual: Array, x: Array) -> Array:
    """Tukey's weights for residuals of half the contrast or more: what lies over the pattern, and glare."""
    limit = OFF * max(float(x[-_OTHERS + _HIGH] - x[-_OTHERS + _LOW]), 0.05)
    return np.asarray(np.maximum(1 - (residual / limit) ** 2, 0.0) ** 2)


def _stray(patch: _Patch, x: Array, residual: Array, sigma: float) -> float:
    """How much farther the cells' edges lie off the pattern than the noise alone would put them, as a ratio of variances.

    Each cell edge between dark and light has a shift of its own, by least squares over its pixels. An uneven print,
    a blur of another form, sharpening and compression leave such shifts; the fit's covariance is to hold them.
    """
    n = len(patch.dark)
    a, b, by_a, by_b = _along(patch, x)
    ratios = []
    for along, across, slope in ((a, b, by_a), (b, a, by_b)):
        edge = np.clip(np.round(along * n), 0, n).astype(int) * (n + 2) + np.clip(
            np.floor(across * n) + 1, 0, n + 1
        ).astype(int)
        information = np.bincount(edge, slope**2, minlength=(n + 1) * (n + 2))
        pull = np.bincount(edge, slope * residual, minlength=(n + 1) * (n + 2))
        telling = information > 0.1 * information.max()
        ratios.append(pull[telling] ** 2 / (information[telling] * sigma**2))
    found = np.concatenate(ratios)
    chance = 1 + 2 * np.sqrt(2 / len(found))  # what the mean of so many may come to by noise alone
    return max(float(np.sum(found) / max(len(found) - 8, 1) / chance), 1.0)


def _normal(
    jac: Array, residual: Array, weight: Array, x: Array, free: Indices, curve: Quantity, sigma: float | None = None
) -> tuple[Array, Array]:  # fmt: skip
    """The normal equations; their noise is the residuals' where none is given."""
    variance = float(residual**2 @ weight / weight.sum()) if sigma is None else sigma**2
    variance = max(variance, LEAST_NOISE**2)
    part = jac[:, free]
    weighted = part * (weight / variance)[:, None]
    normal, right = weighted.T @ part, weighted.T @ residual
    if len(free) == len(x):
        prior = 1 / float(curve.u) ** 2
        normal[-1, -1] += prior
        right[-1] += prior * (float(curve.value) - x[-1])
    return normal, right


def _cost(residual: Array, weight: Array, x: Array, curve: Quantity) -> float:
    prior = 0.0 if float(curve.u) < 1e-9 else (x[-1] - float(curve.value)) / float(curve.u)
    return float(residual**2 @ weight) / COST_NOISE**2 + prior**2


def _fitted(patch: _Patch, x: Array, cov: Array, sigma: float, floor_px: float) -> Fitted | None:
    count = len(x) - _OTHERS
    corners = _corners(x[:count], patch.bends)
    contrast = float(x[count + _HIGH] - x[count + _LOW])
    if corners is None or not contrast > 0.05:
        return None
    jac = np.empty((8, count))
    for i in range(count):
        step = 1e-5
        moved = x[:count].copy()
        moved[i] += step
        other = _corners(moved, patch.bends)
        if other is None:
            return None
        jac[:, i] = (other - corners).ravel() / step
    own = jac @ cov[:count, :count] @ jac.T * patch.unit_px**2 + floor_cov(corners, floor_px)
    return Fitted(corners * patch.unit_px + patch.middle_px, own, sigma / contrast, contrast,
                  abs(float(x[count + _BLUR])), float(x[-1]))  # fmt: skip


def floor_cov(corners: Array, floor_px: float) -> Array:
    """(8, 8) px^2, what is added to a fit's covariance in any case: each corner by itself, and all sides outward together.

    Args:
        corners: (4, 2) in units of half a side.
        floor_px: see FLOOR_PX.
    """
    outward = (corners - corners.mean(axis=0)).ravel()
    return np.asarray((np.eye(8) + np.outer(outward, outward)) * floor_px**2)


def _corners(h: Array, bends: bool) -> Array | None:
    """(4, 2) places whose cells are the unit square's corners, by Newton's steps from the homography's."""
    matrix = np.array([[h[0], h[1], h[2]], [h[3], h[4], h[5]], [h[6], h[7], 1.0]])
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]])
    try:
        inverse = np.linalg.inv(matrix)
    except np.linalg.LinAlgError:
        return None
    wanted = square.copy()
    for _ in range(4 if bends else 1):
        seen = np.concatenate([wanted, np.ones((4, 1))], axis=1) @ inverse.T
        places = seen[:, :2] / seen[:, 2:]
        if bends:
            a, b = _cell_places(h, places, bends=True)[:2]
            wanted = wanted + square - np.stack([a, b], -1)
    return np.asarray(places)
