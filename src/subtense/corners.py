"""Corners of a picture near a rough place: where two straight edges meet.

Lines are found by the gradient's directions (a Hough transform in which a pixel votes for the one line it lies on), in a
window around the place. Two that meet there at an angle, and that have their edges on at least one side of the meeting
point each, are a corner. Each edge is then located in linear light (`edges.piece`), away from the meeting point, so that a
rounded corner is where its sides would meet.

Source: the Hough transform with gradients of D. Ballard, 1981; see `edges`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .arrays import Array
from .detection import unknown_curve
from .edges import LEAST_STEP, WORST_MISFIT, Patch, piece, side_tangent
from .quantity import Quantity
from .subpixel import CORNER_SIGMA_PX, SIDE_SIGMA_PX, WIDEST_STRIP_PX, Side

if TYPE_CHECKING:
    from .photo import Photo

ARM_PX = 26.0
"""How far from the corner its edges are looked at."""
SHORTEST_ARM_PX = 14.0
LEAST_ANGLE = math.radians(25.0)
"""Between the two edges."""
WORST_SIGMA_PX = 1.0
"""A corner that is known less well is none."""
_MOST_LINES = 8
_HALF_STRIP_PX = 4.0


@dataclass(frozen=True, eq=False)
class Corner:
    """Where two edges meet.

    Attributes:
        point_px: (2,) px of the picture.
        cov: (2, 2) of it, without that of the transfer curve.
        by_curve_px: (2,) shift by one standard deviation of the curve's exponent.
        alongs: (2, 2) unit vectors away from the corner along its edges.
        contrast: of the weaker edge, 0 to 1.
        away_px: from where it was looked for.
        noise_cov: (2, 2) the part that the picture's noise makes.
    """

    point_px: Array
    cov: Array
    by_curve_px: Array
    alongs: Array
    contrast: float
    away_px: float
    noise_cov: Array

    @property
    def whole_cov(self) -> Array:
        """(2, 2) covariance with that of the transfer curve."""
        return np.asarray(self.cov + np.outer(self.by_curve_px, self.by_curve_px))


@dataclass(frozen=True, eq=False)
class _Line:
    """A line x . normal = distance about the window's middle, from dark to light along the normal."""

    normal: Array
    distance: float
    votes: float

    @property
    def along(self) -> Array:
        return np.array([-self.normal[1], self.normal[0]])


def corners_near(
    photo: Photo, point_px: Array, *, radius_px: float, curve: Quantity | None = None
) -> tuple[Corner, ...]:
    """Corners within a radius, likeliest first: by the contrast and length of their edges, and nearness.

    Args:
        photo: the picture.
        point_px: (2,) rough place, px.
        radius_px: how far from it.
        curve: exponent of the transfer curve; None where it is unknown.
    """
    point = np.asarray(point_px, float)
    reach = radius_px + ARM_PX + 2 * WIDEST_STRIP_PX
    patch = Patch.of(photo.pixels, point - reach, point + reach, curve or unknown_curve())
    if min(patch.gray.shape) < 12:
        return ()
    lines = _lines(patch, point, radius_px)
    scored = []
    for i, one in enumerate(lines):
        for other in lines[i + 1 :]:
            found = _meeting(patch, point, one, other, radius_px)
            if found is not None:
                scored.append(found)
    corners: list[Corner] = []
    for _, where, arms in sorted(scored, key=lambda s: -s[0])[:4]:
        corner = _located(patch, point, where, arms)
        if corner is not None and corner.away_px <= radius_px + 1 and not any(
            np.hypot(*(corner.point_px - other.point_px)) < 2 for other in corners
        ):  # fmt: skip
            corners.append(corner)
    return tuple(corners)


def _lines(patch: Patch, point: Array, radius: float) -> list[_Line]:
    """Lines that pass within the radius of the point, strongest first."""
    import cv2

    smooth = cv2.GaussianBlur(patch.gray, (0, 0), 1.0)
    gx, gy = (cv2.Sobel(smooth, cv2.CV_64F, *order, ksize=3) / 8 for order in ((1, 0), (0, 1)))
    size = np.hypot(gx, gy)
    yy, xx = np.mgrid[0 : size.shape[0], 0 : size.shape[1]]
    x, y = xx + patch.origin_px[0] - point[0], yy + patch.origin_px[1] - point[1]
    near = (np.hypot(x, y) < radius + ARM_PX) & (size > max(LEAST_STEP / 6, 0.12 * float(size.max())))
    near[0], near[-1], near[:, 0], near[:, -1] = False, False, False, False
    x, y, gx, gy, size = (v[near] for v in (x, y, gx, gy, size))
    if len(x) < 20:
        return []
    angle, rho = np.arctan2(gy, gx), (x * gx + y * gy) / size
    kept = abs(rho) <= radius + 2
    angle, rho, size = angle[kept], rho[kept], size[kept]
    return _hough(angle, rho, np.sqrt(size), radius)


def _hough(angle: Array, rho: Array, weight: Array, radius: float) -> list[_Line]:
    bins, step = 72, 2 * math.pi / 72
    width = int(2 * (radius + 3)) + 1
    votes = np.zeros((bins, width))
    column = np.clip(np.round(rho + width / 2).astype(int), 0, width - 1)
    np.add.at(votes, (np.floor((angle + math.pi) / step).astype(int) % bins, column), weight)
    padded = np.pad(np.concatenate([votes[-1:], votes, votes[:1]]), ((0, 0), (1, 1)))
    shifts = [(i, j) for i in range(3) for j in range(3)]
    summed = np.sum([padded[i : i + bins, j : j + width] for i, j in shifts], axis=0)
    lines: list[_Line] = []
    score = np.array(summed, float)
    for _ in range(_MOST_LINES):
        i, j = np.unravel_index(int(np.argmax(score)), score.shape)
        if score[i, j] <= 0.15 * summed.max():
            break
        near = (abs(np.angle(np.exp(1j * (angle + math.pi - (i + 0.5) * step)))) < 1.6 * step) & (
            abs(rho - (j - width / 2)) < 2
        )
        if near.sum() >= 8:
            theta = float(np.angle(np.sum(weight[near] * np.exp(1j * angle[near]))))
            normal = np.array([math.cos(theta), math.sin(theta)])
            lines.append(_Line(normal, float(np.average(rho[near], weights=weight[near])), float(score[i, j])))
        for k in range(-2, 3):
            score[(i + k) % bins, max(0, j - 3) : j + 4] = 0
    return lines


def _meeting(
    patch: Patch, point: Array, one: _Line, other: _Line, radius: float
) -> tuple[float, Array, list[tuple[Array, Array]]] | None:
    """(score, place, [(arm away from it, normal to the light side)]) where two lines make a corner."""
    normals = np.array([one.normal, other.normal])
    if abs(np.linalg.det(normals)) < math.sin(LEAST_ANGLE):
        return None
    away = np.linalg.solve(normals, np.array([one.distance, other.distance]))
    if np.hypot(*away) > radius + 1:
        return None
    place, arms, strength = point + away, [], 1.0
    for line in (one, other):
        best = max(((_support(patch, place, s * line.along, line.normal), s) for s in (1.0, -1.0)), key=lambda b: b[0])
        if best[0] <= LEAST_STEP:
            return None
        arms.append((best[1] * line.along, line.normal))
        strength *= best[0]
    closeness = math.exp(-((float(np.hypot(*away)) / radius) ** 2))
    return math.sqrt(strength) * closeness, place, arms


def _support(patch: Patch, place: Array, along: Array, normal: Array) -> float:
    """The step across an arm: a low quantile over places along it, so that it is there everywhere."""
    t = np.arange(4.0, SHORTEST_ARM_PX + 0.5)
    middle = place + t[:, None] * along
    steps = np.mean([patch.values(middle + n * normal) - patch.values(middle - n * normal) for n in (1.5, 2.5, 3.5)], 0)
    steps = steps[np.isfinite(steps)]
    return float(np.quantile(steps, 0.2)) if len(steps) >= 8 else 0.0


def _located(patch: Patch, point: Array, place: Array, arms: list[tuple[Array, Array]]) -> Corner | None:
    sides: list[Side] = []
    for _ in range(2):
        sides = []
        for along, normal in arms:
            side = _arm(patch, place, along, normal)
            if side is None:
                return None
            sides.append(side)
        arms = [(math.copysign(1.0, side_tangent(s) @ a) * side_tangent(s), n)
                for s, (a, n) in zip(sides, arms, strict=True)]  # fmt: skip
        place = meeting(sides[0], sides[1]) + patch.origin_px
    jac = np.stack([_jacobian(sides, i) for i in (0, 1)])
    noise = sum((jac[i] @ sides[i].cov @ jac[i].T for i in (0, 1)), np.zeros((2, 2)))
    floor = np.diag([SIDE_SIGMA_PX**2, 0.0, 0.0])
    cov = noise + sum((jac[i] @ floor @ jac[i].T for i in (0, 1)), CORNER_SIGMA_PX**2 * np.eye(2))
    shift = sum((jac[i] @ sides[i].by_curve for i in (0, 1)), np.zeros(2)) * patch.u_exponent
    if not np.all(np.isfinite(cov)) or np.sqrt(np.trace(cov)) > WORST_SIGMA_PX:
        return None
    return Corner(place, cov, shift, np.array([a for a, _ in arms]),
                  min(s.contrast for s in sides), float(np.hypot(*(place - point))), noise)  # fmt: skip


def _arm(patch: Patch, place: Array, along: Array, normal: Array) -> Side | None:
    """An edge from 5 px beyond the corner on, as far as it can be fitted."""
    for far in (ARM_PX + 8, ARM_PX - 4, SHORTEST_ARM_PX + 2):
        length = far - 5.0
        side = piece(patch, place + (5.0 + length / 2) * along, along, length, _HALF_STRIP_PX, normal)
        if side is not None and side.misfit < WORST_MISFIT:
            return side
    return None


def meeting(one: Side, other: Side) -> Array:
    """(2,) where two fitted sides meet, px of their patch."""
    tp, tq = float((other.start - one.start) @ one.along), 0.0
    for _ in range(4):  # Newton on the two places along the sides
        gap = _point(other, tq) - _point(one, tp)
        jac = np.stack([_slope(one, tp), -_slope(other, tq)], -1)
        step = np.linalg.solve(jac, gap)
        tp, tq = tp + step[0], tq + step[1]
    return _point(other, tq)


def _point(side: Side, t: float) -> Array:
    return np.asarray(side.start + t * side.along + (side.bend @ [1.0, t, t * t]) * side.across)


def _slope(side: Side, t: float) -> Array:
    return np.asarray(side.along + (side.bend[1] + 2 * side.bend[2] * t) * side.across)


def _jacobian(sides: list[Side], i: int) -> Array:
    """(2, 3) of the meeting point by a, b, c of one side."""
    from dataclasses import replace

    there = meeting(sides[0], sides[1])
    out = np.zeros((2, 3))
    for j, size in enumerate((1e-3, 1e-5, 1e-7)):
        bend = sides[i].bend.copy()
        bend[j] += size
        moved = [replace(s, bend=bend) if k == i else s for k, s in enumerate(sides)]
        out[:, j] = (meeting(moved[0], moved[1]) - there) / size
    return out
