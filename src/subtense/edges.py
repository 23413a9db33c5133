"""Edges and corners of a picture near a rough place: snapping, callipers, and long straight sides.

An edge is first looked for in a strip across it, averaged along the edge at several angles; then it is located on the
pixels by `subpixel.fit_side`, as a step blurred in linear light. A corner is where two edges meet. A long side is many short
pieces, each located for itself, with a line through those that agree: what hides a part of it, and a ground that changes along
it, do no harm. The exponent of the transfer curve moves all edges of one thing out or in together; that is a line of its
own, `by_curve_px`, and makes the covariance of the ends of a width joint.

Source: the calliper of machine vision (E. R. Davies, Computer Vision, 5); RANSAC of M. Fischler, R. Bolles, 1981; the
blurred step of W. Förstner, B. Wrobel, Photogrammetric Computer Vision, 15.3.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .arrays import Array, Pixels
from .assumptions import CLICK_SIGMA_PX
from .detection import unknown_curve
from .errors import InputError, NothingFoundError
from .observation import Observation
from .quantity import Quantity
from .subpixel import CORNER_SIGMA_PX, SIDE_SIGMA_PX, WIDEST_STRIP_PX, Side, encoded_gray, fit_side

if TYPE_CHECKING:
    from .photo import Photo

LEAST_RADIUS_PX = 8.0
RADIUS_SHARE = 0.004
"""Of the picture's longer side: how far from a click an edge is looked for, at least LEAST_RADIUS_PX."""
STRIP_PX = 9.0
"""Width of the strip that a calliper averages, along the edge."""
LONGER = 3.0
"""A strip in which noise hides all edges is tried again with this many times its width."""
ONE_STEP_PX = 4.0
"""Two peaks of one sign that are nearer are of one blurred step."""
TELLING_SHARE = 0.35
"""Of a step: a neighbour of less is noise, and leaves it its room."""
LEAST_STEP = 0.04
"""Encoded contrast (0 to 1) of the weakest edge."""
RIVAL_SHARE = 0.4
"""Of the chosen edge's contrast: another edge within the radius with more makes the choice doubtful."""
WORST_MISFIT = 0.4
"""Rms residual over contrast beyond which there is no edge."""
WORST_NOISE_PX = 0.6
"""An edge that noise leaves more doubtful is none."""
STEEPEST = math.radians(40.0)
"""How far the edge may stand from square to the search."""
_ANGLES = np.radians(np.arange(-40.0, 41.0, 8.0))
_STEP_PX = 0.5


def default_radius(photo: Photo) -> float:
    """How far from a click an edge is looked for, px."""
    return max(LEAST_RADIUS_PX, RADIUS_SHARE * max(photo.width_px, photo.height_px))


@dataclass(frozen=True, eq=False)
class Patch:
    """A cut-out of a picture as encoded luminance.

    Attributes:
        gray: (h, w), 0 to 1.
        origin_px: (2,) x and y of its first pixel in the picture.
        exponent: of the picture's transfer curve.
        u_exponent: its standard deviation.
    """

    gray: Array
    origin_px: Array
    exponent: float
    u_exponent: float

    @classmethod
    def of(cls, pixels: Pixels, low_px: Array, high_px: Array, curve: Quantity) -> Patch:
        """The pixels between two corners (x, y), cut at the picture's border."""
        height, width = pixels.shape[:2]
        x0, y0 = np.clip(np.floor(low_px).astype(int), 0, [width - 1, height - 1])
        x1, y1 = np.clip(np.ceil(high_px).astype(int) + 1, [x0 + 1, y0 + 1], [width, height])
        gray = encoded_gray(pixels[y0:y1, x0:x1])
        return cls(gray, np.array([x0, y0], float), float(curve.value), float(curve.u))

    def values(self, points_px: Array) -> Array:
        """(...) bilinear values at (..., 2) px of the picture; NaN outside."""
        x, y = np.moveaxis(points_px - self.origin_px, -1, 0)
        height, width = self.gray.shape
        outside = (x < 0) | (y < 0) | (x > width - 1) | (y > height - 1)
        x0, y0 = (np.clip(np.floor(v).astype(int), 0, n - 2) for v, n in ((x, max(width, 2)), (y, max(height, 2))))
        x1, y1 = np.minimum(x0 + 1, width - 1), np.minimum(y0 + 1, height - 1)
        fx, fy, g = x - x0, y - y0, self.gray
        value = (g[y0, x0] * (1 - fx) + g[y0, x1] * fx) * (1 - fy) + (g[y1, x0] * (1 - fx) + g[y1, x1] * fx) * fy
        return np.asarray(np.where(outside, np.nan, value))


@dataclass(frozen=True, eq=False)
class Edge:
    """A straight edge at one place.

    Attributes:
        point_px: (2,) where the search crossed it, px of the picture.
        across: (2,) unit vector from dark to light.
        u_px: standard deviation of its place across, without that of the transfer curve.
        noise_px: the part of `u_px` that the picture's noise makes.
        by_curve_px: shift along `across` by one standard deviation of the exponent.
        contrast: encoded light less dark, 0 to 1.
        misfit: rms residual over contrast.
        away_px: how far from where it was looked for.
    """

    point_px: Array
    across: Array
    u_px: float
    noise_px: float
    by_curve_px: float
    contrast: float
    misfit: float
    away_px: float

    @property
    def along(self) -> Array:
        """(2,) unit vector along the edge."""
        return np.array([-self.across[1], self.across[0]])


# -- an edge across a direction -----------------------------------------------------------------------


def edges_across(
    photo: Photo, point_px: Array, direction: Array, *, radius_px: float, curve: Quantity | None = None,
    strip_px: float = STRIP_PX,
) -> tuple[Edge, ...]:  # fmt: skip
    """Edges that a line through a point crosses, likeliest first: by contrast, and nearness to the point.

    Args:
        photo: the picture.
        point_px: (2,) rough place.
        direction: (2,) of the line, any length above 0.
        radius_px: how far either way.
        curve: exponent of the transfer curve.
        strip_px: width of the strip along the edge that is averaged; three times that where noise hides all edges.
    """
    point, d = np.asarray(point_px, float), _unit(direction)
    reach = radius_px + 2 * WIDEST_STRIP_PX + LONGER * strip_px
    patch = Patch.of(photo.pixels, point - reach, point + reach, curve or unknown_curve())
    return edges_in(patch, point, d, radius_px, strip_px) or edges_in(patch, point, d, radius_px, LONGER * strip_px)


def edges_in(patch: Patch, point: Array, d: Array, radius_px: float, strip_px: float = STRIP_PX) -> tuple[Edge, ...]:
    """As `edges_across`, in a patch that reaches far enough."""
    peaks = _peaks(patch, point, d, radius_px, strip_px)
    found: list[Edge] = []
    unclear = 0.0
    for n, angle, step in peaks[:6]:
        gaps = [abs(n - other) for other, _, size in peaks if other != n and abs(size) > TELLING_SHARE * abs(step)]
        half = float(np.clip(0.6 * min(gaps, default=99.0), 1.6, WIDEST_STRIP_PX))
        edge = _located(patch, point, d, (n, angle, step), half, strip_px)
        if edge is None and half > 3.0:  # a rim, a line beside it: nearer to the edge it is a step
            edge = _located(patch, point, d, (n, angle, step), half / 2, strip_px)
        if edge is None:
            unclear = max(unclear, abs(step) * math.exp(-((n / radius_px) ** 2)))
            continue
        if edge.away_px > radius_px + 0.5 or abs(step) * math.exp(-((n / radius_px) ** 2)) < RIVAL_SHARE * unclear:
            continue  # beyond, or it stands behind a stronger step that is no clear edge and may be what is meant
        if not any(abs((edge.point_px - other.point_px) @ d) < 1.0 for other in found):
            found.append(edge)
    return tuple(sorted(found, key=lambda e: -e.contrast * math.exp(-((e.away_px / radius_px) ** 2))))


Peak = tuple[float, float, float]
"""Place along the direction, angle, and signed step of the averaged strip."""


def _peaks(patch: Patch, point: Array, d: Array, radius: float, strip: float) -> list[Peak]:
    """The averaged strip's steps, strongest and nearest first."""
    e = np.array([-d[1], d[0]])
    n = np.arange(-radius - 4.0, radius + 4.0 + _STEP_PX / 2, _STEP_PX)
    t = np.arange(-strip / 2 + 0.5, strip / 2)
    tilt = np.tan(_ANGLES)
    place = n[None, :, None] + t[None, None, :] * tilt[:, None, None]
    points = point + place[..., None] * d + (t[None, None, :, None] + 0 * place[..., None]) * e
    values = patch.values(points)
    seen = np.isfinite(values).mean(axis=-1) > 0.7
    with np.errstate(invalid="ignore"):
        profile = np.where(seen, np.nansum(values, -1) / np.maximum(np.isfinite(values).sum(-1), 1), np.nan)
    kernel = np.array([1.0, 1, 1, 0, -1, -1, -1]) / 3  # the step between the means of 1.5 px on either side
    steps = np.array([np.convolve(row, kernel, "same") for row in profile])
    steps[:, :3] = steps[:, -3:] = 0
    steps = np.nan_to_num(steps) * np.cos(_ANGLES)[:, None] ** 0.5  # of equal steps, the square one
    best = np.argmax(abs(steps), axis=0)
    along = steps[best, np.arange(len(n))]
    size = abs(along)
    top = [i for i in range(1, len(n) - 1)
           if size[i] >= LEAST_STEP / 2 and size[i] >= size[max(i - 3, 0) : i + 4].max()
           and abs(n[i]) <= radius + 1]  # fmt: skip
    found = [(float(n[i]), float(_ANGLES[best[i]]), float(along[i])) for i in top]
    found = [peak for peak in found if not any(_of_one_step(peak, other, found) for other in found)]
    return sorted(found, key=lambda peak: -abs(peak[2]) * math.exp(-((peak[0] / radius) ** 2)))


def _of_one_step(peak: Peak, other: Peak, every: list[Peak]) -> bool:
    """Whether noise on a blurred step made the peak beside a larger one: same sign, near, and nothing opposite between."""
    if abs(other[2]) <= abs(peak[2]) or other[2] * peak[2] < 0 or abs(other[0] - peak[0]) > ONE_STEP_PX:
        return False
    low, high = sorted((other[0], peak[0]))
    return not any(low < n < high and step * peak[2] < 0 for n, _, step in every)


def _located(patch: Patch, point: Array, d: Array, peak: Peak, half: float, strip: float) -> Edge | None:
    n, angle, step = peak
    e = np.array([-d[1], d[0]])
    middle, along = point + n * d, _unit(e + math.tan(angle) * d)
    side = None
    for _ in range(2):  # the second pass has its strip where the edge is
        side = piece(patch, middle, along, strip, half, math.copysign(1.0, step) * d)
        if side is None:
            return None
        middle, along = _crossing(side, point - patch.origin_px, d) + patch.origin_px, side_tangent(side)
    assert side is not None
    if side.misfit > WORST_MISFIT or abs(along @ d) > math.sin(STEEPEST):
        return None
    edge = _edge_of(patch, side, middle, abs(float((middle - point) @ d)))
    return edge if edge.noise_px < WORST_NOISE_PX else None


def piece(patch: Patch, middle: Array, along: Array, length: float, half: float, to_light: Array) -> Side | None:
    """A fit of the short stretch of an edge around a place; its coordinates are those of the patch.

    Args:
        patch: the cut-out.
        middle: (2,) px of the picture.
        along: (2,) unit vector.
        length: of the stretch, px.
        half: half width of the strip, px.
        to_light: (2,) any vector to the light side.
    """
    reach = (length / 2 + 1.5 * half) * along  # `fit_side` leaves out 1.5 half at either end
    place = middle - patch.origin_px
    dark = place - 50.0 * math.copysign(1.0, float(to_light @ _normal(along))) * _normal(along)
    return fit_side(patch.gray, place - reach, place + reach, dark, half, patch.exponent)


def _edge_of(patch: Patch, side: Side, place: Array, away: float) -> Edge:
    t = float((place - patch.origin_px - side.start) @ side.along)
    row = np.array([1.0, t, t * t])
    noise = math.sqrt(max(float(row @ side.cov @ row), 0.0))
    shift = float(row @ side.by_curve) * patch.u_exponent
    across = _normal(side_tangent(side, t))
    across = across if across @ side.across > 0 else -across
    return Edge(place, across, math.hypot(noise, SIDE_SIGMA_PX), noise, shift, side.contrast, side.misfit, away)


def side_tangent(side: Side, t: float | None = None) -> Array:
    """(2,) unit vector along a fitted side at t, by default its middle."""
    if t is None:
        return _unit(side.along + side.bend[1] * side.across)
    return _unit(side.along + (side.bend[1] + 2 * side.bend[2] * t) * side.across)


def _crossing(side: Side, point: Array, d: Array) -> Array:
    """(2,) where the line through a point meets a fitted side, patch px."""
    a, b, c = side.bend
    s = 0.0
    for _ in range(4):
        there = point + s * d - side.start
        t, off = float(there @ side.along), float(there @ side.across)
        slope = float(d @ side.across) - (b + 2 * c * t) * float(d @ side.along)
        s -= (off - a - b * t - c * t * t) / (slope if abs(slope) > 1e-6 else 1e-6)
    return np.asarray(point + s * d)


def _normal(along: Array) -> Array:
    return np.array([along[1], -along[0]])


def _unit(vector: Array) -> Array:
    found = np.asarray(vector, float)
    return found / max(float(np.hypot(*found)), 1e-12)


# -- what a person calls for --------------------------------------------------------------------------


def end_covariance(edge: Edge, d: Array, u_along_px: float) -> tuple[Array, Array]:
    """(2, 2) covariance of where a line in direction d meets an edge, and (2,) its shift by u of the transfer curve.

    Args:
        edge: what the line meets.
        d: (2,) unit vector of the line.
        u_along_px: how well it is known where the line stands, beside its direction.
    """
    meets = float(d @ edge.across)
    towards = d / meets
    e = np.array([-d[1], d[0]])
    slid = edge.along / float(edge.along @ e)  # the edge's point where the line stands 1 px beside
    cov = edge.u_px**2 * np.outer(towards, towards) + u_along_px**2 * np.outer(slid, slid)
    return cov + CORNER_SIGMA_PX**2 * np.eye(2), edge.by_curve_px * towards


def snap(
    photo: Photo, point_px: Array, direction: Array | None = None, *, radius_px: float | None = None,
    curve: Quantity | None = None,
) -> Observation:  # fmt: skip
    """The corner nearest to a rough place, or the edge that a line through it crosses.

    Args:
        photo: the picture.
        point_px: (2,) where about it is, px.
        direction: (2,) along which an edge is looked for; None for a corner.
        radius_px: how far from the place; None for 0.4 % of the picture's longer side, at least 8 px.
        curve: exponent of the transfer curve; None where it is unknown.

    Returns:
        One point with its (2, 2) covariance. On an edge it is known across; along, as well as a click is.

    Raises:
        InputError: a place outside the picture, or no direction.
        NothingFoundError: no corner or edge there.
    """
    point, radius = checked(photo, point_px, radius_px)
    if direction is None:
        from .corners import corners_near

        corners = corners_near(photo, point, radius_px=radius, curve=curve)
        if not corners:
            raise NothingFoundError(f"{_at(photo, point)}: no corner of two edges within {radius:.3g} px; mark it closer, "
                                    "or without snapping")  # fmt: skip
        return Observation(corners[0].point_px[None], cov=corners[0].whole_cov, source="corner of two edges")
    if np.shape(direction) != (2,) or not np.any(direction) or not np.all(np.isfinite(direction)):
        raise InputError("direction", str(direction), "give a vector across the edge, as (1, 0)")
    found = edges_across(photo, point, direction, radius_px=radius, curve=curve)
    if not found:
        raise no_edge(photo, point, radius)
    cov, shift = end_covariance(found[0], _unit(direction), CLICK_SIGMA_PX)
    return Observation(found[0].point_px[None], cov=cov + np.outer(shift, shift), source="edge across the direction")


def width_along(
    photo: Photo, line: Observation, *, radius_px: float | None = None, curve: Quantity | None = None,
    strip_px: float = STRIP_PX,
) -> Observation:  # fmt: skip
    """The two edges at the ends of a line, located along it: a calliper.

    Args:
        photo: the picture.
        line: two points, about where the edges are; its sigma says how well the line's place is known.
        radius_px: how far from each end along the line; None for 0.4 % of the picture's longer side, at least 8 px,
            and at most 0.45 of the line.
        curve: exponent of the transfer curve; None where it is unknown.
        strip_px: how wide a strip is averaged.

    Returns:
        Two points with their (4, 4) covariance; an unknown curve moves both out or in together.

    Raises:
        InputError: not two points in the picture.
        NothingFoundError: no edge at an end.
    """
    ends, d, reach = line_of(photo, line, radius_px)
    found = []
    for end in ends:
        edges = edges_across(photo, end, d, radius_px=reach, curve=curve, strip_px=strip_px)
        if not edges:
            raise no_edge(photo, end, reach)
        found.append(edges[0])
    return observed(found, d, line)


def line_of(photo: Photo, line: Observation, radius_px: float | None) -> tuple[Array, Array, float]:
    """(2, 2) ends, (2,) direction and radius of a calliper's line.

    Raises:
        InputError: not two points in the picture, or on one spot.
    """
    ends = np.asarray(line.points_px, float)
    if ends.shape != (2, 2):
        raise InputError("line", f"{ends.shape[-2]} points", "give its two ends")
    _, reach = checked(photo, ends[0], radius_px)
    checked(photo, ends[1], radius_px)
    length = float(np.hypot(*(ends[1] - ends[0])))
    if length < 3.0:
        raise InputError("line", f"of {length:.2g} px", "give one of 3 px or more")
    return ends, (ends[1] - ends[0]) / length, min(reach, 0.45 * length)


def observed(found: list[Edge], d: Array, line: Observation) -> Observation:
    """Edges on a line as one Observation with joint covariance."""
    beside = np.array([-d[1], d[0]])
    spread = line.standard_deviations.reshape(-1, 2)
    cov, shift = np.zeros((2 * len(found), 2 * len(found))), np.zeros(2 * len(found))
    for i, edge in enumerate(found):
        own = slice(2 * i, 2 * i + 2)
        cov[own, own], shift[own] = end_covariance(edge, d, float(np.hypot(*(spread[i] * beside))))
    points = np.array([edge.point_px for edge in found])
    return Observation(points, cov=cov + np.outer(shift, shift), label=line.label, source="edges across the line")


def checked(photo: Photo, point_px: Array, radius_px: float | None) -> tuple[Array, float]:
    """A place and a radius that can be used.

    Raises:
        InputError: a place outside the picture, a radius that is none.
    """
    point = np.asarray(point_px, float)
    size = np.array([photo.width_px, photo.height_px])
    if point.shape != (2,) or not np.all(np.isfinite(point)) or np.any(point < -0.5) or np.any(point > size - 0.5):
        raise InputError("point_px", str(point_px), f"give x and y within {size[0]} x {size[1]} px")
    radius = default_radius(photo) if radius_px is None else float(radius_px)
    if not 1.0 <= radius <= 200.0:
        raise InputError("radius_px", radius, "give 1 to 200 px")
    return point, radius


def no_edge(photo: Photo, point: Array, radius: float) -> NothingFoundError:
    """What is raised where a calliper finds nothing."""
    return NothingFoundError(
        f"{_at(photo, point)}: no edge within {radius:.3g} px along the line, of {100 * LEAST_STEP:.0f} % contrast or more; "
        "mark it closer, or without snapping"
    )


def _at(photo: Photo, point: Array) -> str:
    return f"{photo.name} at {point[0]:.1f},{point[1]:.1f}"
