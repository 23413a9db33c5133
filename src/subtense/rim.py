"""Sub-pixel rims: an ellipse fitted to a closed edge in linear light, with its covariance.

The edge is located in sectors around the rim, each as a step that was blurred in linear light and then encoded, over the pixels
on either side of it. A blurred disc is a little smaller than the disc at half its light: the step lies s^2 / (2 R) inside a rim
of radius R blurred by s, which is taken off. Sectors that do not agree with the ellipse (what hides a part, a shadow, a shine)
lose their weight. The exponent of the transfer curve moves all sectors together, so it is one line of the covariance.

Source: the blurred-edge model of W. Förstner and B. Wrobel, Photogrammetric Computer Vision, 15.3, on a curved edge (second
order in s / R); robust weights after J. Tukey.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .arrays import Array, Bools
from .quantity import Quantity
from .transfer import encoded_of, light_of

WIDEST_STRIP_PX = 7.0
LEAST_CONTRAST = 0.04
"""Encoded contrast (0 to 1) of the weakest sector."""
SECTOR_PX = 5.0
FEWEST, MOST = 20, 96
COMMON_SIGMA_PX = 0.01
"""How far a whole rim may lie off, whatever the residuals say."""
LEAST_SEEN = 0.4
"""Share of the sectors that must show an edge."""
PASSES = 4
POOLED = 20
"""Pixels of its own that count as much as all other sectors in what is taken for a sector's noise."""
CURVE_STEP = 0.2
"""Of the exponent, for the change of the rim with it."""
MOST_PIXELS = 80
"""Of one sector."""


@dataclass(frozen=True, eq=False)
class Ellipse:
    """An ellipse in a picture: centre, half axes (px), and the angle of the first one (rad)."""

    x_px: float
    y_px: float
    a_px: float
    b_px: float
    angle_rad: float

    @property
    def vector(self) -> Array:
        """(5,) x, y, a, b, angle."""
        return np.array([self.x_px, self.y_px, self.a_px, self.b_px, self.angle_rad])

    def points(self, around: Array) -> Array:
        """(..., 2) points at parameters."""
        c, s = np.cos(self.angle_rad), np.sin(self.angle_rad)
        u, v = self.a_px * np.cos(around), self.b_px * np.sin(around)
        return np.stack([self.x_px + c * u - s * v, self.y_px + s * u + c * v], -1)

    def points_by_vector(self, around: Array) -> Array:
        """(..., 2, 5) derivatives of `points`."""
        c, s = np.cos(self.angle_rad), np.sin(self.angle_rad)
        ct, st, zero, one = np.cos(around), np.sin(around), np.zeros_like(around), np.ones_like(around)
        u, v = self.a_px * ct, self.b_px * st
        return np.stack([np.stack([one, zero, c * ct, -s * st, -s * u - c * v], -1),
                         np.stack([zero, one, s * ct, c * st, c * u - s * v], -1)], -2)  # fmt: skip

    def normals(self, around: Array) -> Array:
        """(..., 2) outward unit normals."""
        c, s = np.cos(self.angle_rad), np.sin(self.angle_rad)
        u, v = np.cos(around) / self.a_px, np.sin(around) / self.b_px
        length = np.hypot(u, v)
        return np.stack([(c * u - s * v) / length, (s * u + c * v) / length], -1)

    def curvature(self, around: Array) -> Array:
        """(...) 1 / px."""
        across = (self.a_px * np.sin(around)) ** 2 + (self.b_px * np.cos(around)) ** 2
        return np.asarray(self.a_px * self.b_px / across**1.5)

    def nearest(self, points_px: Array) -> tuple[Array, Array]:
        """(...) parameter of the nearest point of the ellipse to (..., 2), and the distance, positive outside."""
        c, s = np.cos(self.angle_rad), np.sin(self.angle_rad)
        dx, dy = points_px[..., 0] - self.x_px, points_px[..., 1] - self.y_px
        x, y = c * dx + s * dy, c * dy - s * dx
        a, b = self.a_px, self.b_px
        t = np.arctan2(y * a, x * b)
        for _ in range(5):
            ct, st = np.cos(t), np.sin(t)
            slope = (b * b - a * a) * ct * st + x * a * st - y * b * ct
            bend = (b * b - a * a) * (ct * ct - st * st) + x * a * ct + y * b * st
            t = t - np.where(bend > 0, slope / np.where(bend > 0, bend, 1.0), 0.0).clip(-0.5, 0.5)
        away = np.hypot(x - a * np.cos(t), y - b * np.sin(t))
        return t, np.where((x / a) ** 2 + (y / b) ** 2 >= 1, away, -away)


@dataclass(frozen=True, eq=False)
class Rim:
    """A fitted rim.

    Attributes:
        ellipse: with a >= b.
        cov: (5, 5) of its vector.
        share: of the rim that was seen and agrees.
        scatter_px: standard deviation of the sectors about the ellipse.
        contrast: median encoded contrast, positive where the outside is lighter.
        one_sign: share of the agreeing sectors whose contrast has the common sign.
        blur_px: of the edge.
        widest_gap_rad: largest part of the rim without an agreeing sector.
    """

    ellipse: Ellipse
    cov: Array
    share: float
    scatter_px: float
    contrast: float
    one_sign: float
    blur_px: float
    widest_gap_rad: float

    def observed(self, count: int) -> tuple[Array, Array]:
        """(count, 2) points evenly spaced on the ellipse, and their (2 count, 2 count) covariance of rank 5."""
        around = np.linspace(0, 2 * np.pi, count, endpoint=False)
        # across the rim only: a nearly round rim does not tell its angle, which would move points far along it
        outwards = (self.ellipse.normals(around)[..., None] * _design(self.ellipse, around)[:, None, :]).reshape(-1, 5)
        return self.ellipse.points(around), outwards @ self.cov @ outwards.T


def fit_rim(gray: Array, rough: Ellipse, curve: Quantity) -> Rim | None:
    """Fit an ellipse to the edge near a rough one.

    Args:
        gray: (H, W) encoded luminance, 0 to 1.
        rough: within a few px of the edge.
        curve: exponent of the transfer curve.

    Returns:
        The rim, or None where there is none.
    """
    ellipse, exponent = rough, float(curve.value)
    half, blur = _half_strip(rough), None
    for number in range(PASSES):
        sectors = _sectors(gray, ellipse, half)
        if sectors is None:
            return None
        found = _located(sectors, exponent, blur)
        if found.seen.mean() < LEAST_SEEN:
            return None
        fit = _adjusted(ellipse, sectors.around, found)
        if fit is None:
            return None
        ellipse = fit[0]
        if not (3 < ellipse.b_px <= ellipse.a_px < 4 * rough.a_px) or ellipse.a_px > 12 * ellipse.b_px:
            return None
        blur = float(np.clip(np.median(found.blur[fit[1] > 0]), 0.3, 0.6 * half)) if number >= 1 else None
        if blur is not None:
            half = min(_half_strip(ellipse), max(2.5, 3.2 * blur))
    return _judged(gray, ellipse, half, curve, blur)


def _half_strip(ellipse: Ellipse) -> float:
    return float(np.clip(0.45 * ellipse.b_px, 2.5, WIDEST_STRIP_PX))


@dataclass(frozen=True, eq=False)
class _Sectors:
    """Pixels of the strip around a rim by sector, padded: (K, P); `around` (K,) are the sectors' middles."""

    around: Array
    n: Array
    curvature: Array
    value: Array
    used: Bools


@dataclass(frozen=True, eq=False)
class _Located:
    """By sector: offset outwards from the ellipse and its u, px; contrast; blur, px; whether there is an edge."""

    offset: Array
    u: Array
    contrast: Array
    blur: Array
    seen: Bools


def _sectors(gray: Array, ellipse: Ellipse, half: float) -> _Sectors | None:
    """The pixels within `half` of the ellipse, by equal lengths of its rim."""
    box = ellipse.points(np.linspace(0, 2 * np.pi, 64))
    x0, y0 = np.maximum(np.floor(box.min(axis=0) - half).astype(int), 0)
    x1, y1 = np.minimum(np.ceil(box.max(axis=0) + half).astype(int) + 1, gray.shape[::-1])
    if x1 - x0 < 4 or y1 - y0 < 4:
        return None
    yy, xx = np.mgrid[y0:y1, x0:x1]
    c, s = np.cos(ellipse.angle_rad), np.sin(ellipse.angle_rad)
    u, v = c * (xx - ellipse.x_px) + s * (yy - ellipse.y_px), c * (yy - ellipse.y_px) - s * (xx - ellipse.x_px)
    level = np.hypot(u / ellipse.a_px, v / ellipse.b_px)
    near = abs(level - 1) < 1.5 * half / ellipse.b_px
    points = np.stack([xx[near], yy[near]], -1).astype(float)
    t, n = ellipse.nearest(points)
    inside = abs(n) <= half
    t, n, points = t[inside], n[inside], points[inside]
    value = gray[points[:, 1].astype(int), points[:, 0].astype(int)]
    fine = np.linspace(-np.pi, np.pi, 721)
    length = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(ellipse.points(fine), axis=0).T))])
    count = int(np.clip(length[-1] / SECTOR_PX, FEWEST, MOST))
    place = np.interp((t + np.pi) % (2 * np.pi) - np.pi, fine, length) / length[-1] * count
    sector = np.minimum(place.astype(int), count - 1)
    around = np.interp((np.arange(count) + 0.5) / count * length[-1], length, fine)
    return _padded(sector, count, around, n, ellipse.curvature(t), value)


def _padded(sector: Array, count: int, around: Array, n: Array, curvature: Array, value: Array) -> _Sectors:
    order = np.argsort(sector, kind="stable")
    have = np.bincount(sector, minlength=count)
    first = np.concatenate([[0], np.cumsum(have)[:-1]])
    width = int(min(have.max(initial=1), MOST_PIXELS))
    # of a sector with too many pixels, ones spread evenly over it
    pick = (np.arange(width)[None, :] * np.maximum(have / width, 1.0)[:, None]).astype(int)
    used = pick < have[:, None]
    index = order[np.where(used, first[:, None] + np.minimum(pick, np.maximum(have - 1, 0)[:, None]), 0)]
    return _Sectors(around, n[index], curvature[index], value[index], used)


def _model(x: Array, sectors: _Sectors, exponent: float) -> Array:
    """(K, P) encoded values; x (K, 4): offset, log blur, light inside, light outside."""
    from scipy.special import ndtr

    blur = np.exp(x[:, 1:2])
    z = (sectors.n - x[:, :1] + blur**2 * sectors.curvature / 2) / blur
    light = x[:, 2:3] + (x[:, 3:4] - x[:, 2:3]) * ndtr(z)
    return encoded_of(np.maximum(light, 1e-6), exponent)


def _located(sectors: _Sectors, exponent: float, blur: float | None) -> _Located:
    """Fit every sector's step; with a blur given, only its place and its two lights."""
    n, value, used = sectors.n, sectors.value, sectors.used
    half = float(abs(n).max(initial=1.0))

    def mean(where: Bools) -> Array:
        return np.asarray((value * where).sum(1) / np.maximum(where.sum(1), 1))

    inner, outer = mean(used & (n < -0.5 * half)), mean(used & (n > 0.5 * half))
    x = np.stack(
        [0 * inner, np.full_like(inner, np.log(blur or 1.0)), light_of(inner, exponent), light_of(outer, exponent)], -1
    )
    free = [0, 2, 3] if blur else [0, 1, 2, 3]
    for _ in range(8):
        base = _model(x, sectors, exponent)
        off = np.where(used, value - base, 0.0)
        jac = _derivatives(x, sectors, exponent, base, free)
        normal = np.swapaxes(jac, -1, -2) @ jac
        scale = np.trace(normal, axis1=-2, axis2=-1)[:, None, None] + 1e-12
        damped = normal + 1e-3 * normal * np.eye(len(free)) + 1e-9 * scale * np.eye(len(free))
        step = np.linalg.solve(damped, (np.swapaxes(jac, -1, -2) @ off[..., None]))[..., 0]
        x[:, free] += step.clip(-0.5, 0.5)
        x[:, 0], x[:, 1] = x[:, 0].clip(-half, half), x[:, 1].clip(np.log(0.25), np.log(half))
        x[:, 2:] = x[:, 2:].clip(0.0, 1.5)
    base = _model(x, sectors, exponent)
    off = np.where(used, value - base, 0.0)
    have = used.sum(1)
    spare = np.maximum(have - len(free), 1)
    alone = (off**2).sum(1) / spare
    # few pixels tell their noise badly, and weights by it would be worse than none: partly that of all sectors
    noise = np.sqrt((spare * alone + POOLED * np.median(alone)) / (spare + POOLED))
    inverse = np.linalg.pinv(normal + 1e-9 * scale * np.eye(len(free)))
    u = noise * np.sqrt(np.maximum(inverse[:, 0, 0], 0.0))
    contrast = encoded_of(x[:, 3], exponent) - encoded_of(x[:, 2], exponent)
    seen = (
        (have >= 10)
        & (abs(contrast) > LEAST_CONTRAST)
        & (abs(contrast) > 1.5 * noise)
        & (abs(x[:, 0]) < 0.8 * half)
        & (u < 0.7)
    )
    return _Located(x[:, 0], np.maximum(u, 1e-3), contrast, np.exp(x[:, 1]), np.asarray(seen))


def _derivatives(x: Array, sectors: _Sectors, exponent: float, base: Array, free: list[int]) -> Array:
    columns = []
    for j in free:
        moved = x.copy()
        moved[:, j] += 1e-4
        columns.append(np.where(sectors.used, (_model(moved, sectors, exponent) - base) / 1e-4, 0.0))
    return np.stack(columns, -1)


def _design(ellipse: Ellipse, around: Array) -> Array:
    """(K, 5) outward move of the rim by the ellipse's vector; the angle in px at the long end."""
    by_vector = ellipse.points_by_vector(around)
    design = np.einsum("...i,...ij->...j", ellipse.normals(around), by_vector)
    return np.asarray(design)


def _adjusted(ellipse: Ellipse, around: Array, found: _Located) -> tuple[Ellipse, Array] | None:
    """The ellipse through the sectors' edges, and the (K,) weights of the robust fit, 0 to 1."""
    if found.seen.sum() < 8:
        return None
    design = _design(ellipse, around)
    robust = found.seen.astype(float)
    step = np.zeros(5)
    for number in range(12):
        weight = robust / (found.u**2 + 0.02**2)
        normal = (design * weight[:, None]).T @ design
        # a circle does not tell its angle: such a direction stays where it is
        step = np.linalg.lstsq(
            normal + 1e-9 * np.trace(normal) * np.eye(5), design.T @ (weight * found.offset), rcond=None
        )[0]
        off = found.offset - design @ step
        scale = max(1.4826 * float(np.median(abs(off[found.seen]))), 0.03)
        ratio = off / ((6.0 if number < 3 else 4.0) * scale)
        robust = np.where(found.seen & (abs(ratio) < 1), (1 - ratio**2) ** 2, 0.0)
        if (robust > 0).sum() < 8:
            return None
    most = 0.5 * ellipse.b_px
    x, y, a, b, angle = ellipse.vector + step.clip([-most] * 4 + [-0.5], [most] * 4 + [0.5])
    if a < b:
        a, b, angle = b, a, angle + np.pi / 2
    return Ellipse(x, y, a, b, angle % np.pi), robust


def _judged(gray: Array, ellipse: Ellipse, half: float, curve: Quantity, blur: float | None) -> Rim | None:
    """The rim at its final place, with its covariance."""
    exponent = float(curve.value)
    sectors = _sectors(gray, ellipse, half)
    if sectors is None:
        return None
    found = _located(sectors, exponent, blur)
    fit = _adjusted(ellipse, sectors.around, found)
    if fit is None:
        return None
    final, robust = fit
    good, design = robust > 0.2, _design(ellipse, sectors.around)
    if good.sum() < 8:
        return None
    off, cov = _covariance(sectors, found, good, design, curve, blur)
    cov += COMMON_SIGMA_PX**2 * np.diag([1.0, 1, 1, 1, 1 / ellipse.a_px**2])
    signs = found.contrast[good]
    one_sign = float(max((signs > 0).mean(), (signs < 0).mean()))
    turned = np.sort(sectors.around[good])
    gap = float(np.max(np.diff(np.concatenate([turned, turned[:1] + 2 * np.pi]))))
    scatter = float(np.sqrt(np.mean(off[good] ** 2)))
    return Rim(final, _ordered(cov, ellipse, final), float(good.mean()), scatter, float(np.median(signs)), one_sign,
               float(blur or 1.0), gap)  # fmt: skip


def _covariance(
    sectors: _Sectors, found: _Located, good: Bools, design: Array, curve: Quantity, blur: float | None
) -> tuple[Array, Array]:
    """Residuals of the sectors, and the (5, 5) covariance: noise, the common blur, and the transfer curve."""
    weight = good / (found.u**2 + 0.01**2)
    normal = (design * weight[:, None]).T @ design
    normal += 1e-9 * np.trace(normal) * np.eye(5)
    gain = np.linalg.solve(normal, design.T * weight)
    off = np.asarray(found.offset - design @ (gain @ found.offset))
    chi2 = float(weight @ off**2) / max(int(good.sum()) - 5, 1)
    cov = np.asarray(np.linalg.inv(normal), float) * max(chi2, 1.0) * _together(off, good)
    exponent = float(curve.value)

    def by(step: float, exponent: float, blur: float | None) -> Array:
        other = _located(sectors, exponent, blur)
        return np.asarray(gain @ np.where(good & other.seen, (other.offset - found.offset) / step, 0.0))

    if blur is not None:  # it is the median of the sectors' own
        free = _located(sectors, exponent, None)
        u_blur = 1.25 * 1.4826 * float(np.median(abs(free.blur[good] - blur))) / float(good.sum()) ** 0.5
        moved = by(0.05 * blur, exponent, 1.05 * blur)
        cov += u_blur**2 * np.outer(moved, moved)
    if curve.u:
        moved = by(CURVE_STEP, exponent + CURVE_STEP, blur)
        cov += float(curve.u) ** 2 * np.outer(moved, moved)
    return off, cov


def _ordered(cov: Array, before: Ellipse, after: Ellipse) -> Array:
    """The covariance with the axes in the order of the ellipse after the last step."""
    if abs(after.a_px - before.a_px) <= abs(after.a_px - before.b_px):
        return cov
    order = [0, 1, 3, 2, 4]
    return cov[np.ix_(order, order)]


def _together(off: Array, good: Bools) -> float:
    """What neighbours that err alike add to a variance: (1 + r) / (1 - r) of their correlation r."""
    pair = good & np.roll(good, 1)
    if pair.sum() < 8:
        return 1.0
    r = float(
        np.sum(off[pair] * np.roll(off, 1)[pair]) / max(float(np.sum(off[good] ** 2)) * pair.sum() / good.sum(), 1e-12)
    )
    if r < 2 / float(pair.sum()) ** 0.5:  # no more than chance
        return 1.0
    r = min(r, 0.8)
    return (1 + r) / (1 - r)
