"""Long straight sides of things: many short pieces of an edge, and a line through those that agree.

A piece is located for itself (`edges.piece`), so that a ground that changes along a side, print on the thing, and what hides
a part of it cost only the pieces they touch. A line is proposed by pairs of pieces (RANSAC, but of all pairs), then fitted
to those that lie on it, with a bend where the lens may make one. Corners are where neighbouring sides meet.

Source: M. Fischler, R. Bolles, Random sample consensus, 1981; see `edges`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from .arrays import Array, Bools
from .corners import meeting
from .edges import LEAST_STEP, WORST_MISFIT, Patch, piece
from .subpixel import CORNER_SIGMA_PX, CURVED_FROM_PX, SIDE_SIGMA_PX, WIDEST_STRIP_PX, Side

MOST_PIECES = 16
LEAST_PIECES = 3
SHORTEST_PIECE_PX = 5.0
PIECE_SIGMA_PX = 0.05
"""How far a piece may lie off the side, whatever its residuals say."""
QUICK_SIGMA_PX = 0.5
"""Of a piece that is not located in linear light."""
ON_LINE_PX = 1.0


@dataclass(frozen=True, eq=False)
class Straight:
    """A side through pieces.

    Attributes:
        side: its line; coordinates of the patch.
        support: share of its pieces that were found on the line.
        outward: mean over the pieces of +1 where the light is on the side of `side.across`, -1 where the dark is.
        stretch: (2,) from where to where along it pieces were found, share of its length.
    """

    side: Side
    support: float
    outward: float
    stretch: tuple[float, float]


def straight(
    patch: Patch, start_px: Array, end_px: Array, *, reach_px: float, margin: float = 0.08, fine: bool = True
) -> Straight | None:
    """The straight edge between two rough ends.

    Args:
        patch: the cut-out.
        start_px: (2,) px of the picture.
        end_px: (2,).
        reach_px: how far from the rough line.
        margin: share of the length at either end that is left out, for rounded corners.
        fine: whether the pieces are located in linear light; else to about half a pixel, a hundred times as fast.

    Returns:
        None where fewer than three pieces lie on a line.
    """
    start, end = np.asarray(start_px, float), np.asarray(end_px, float)
    length = float(np.hypot(*(end - start)))
    if length < 4 * SHORTEST_PIECE_PX * 0.5:
        return None
    along = (end - start) / length
    across = np.array([along[1], -along[0]])
    edge = max(margin * length, 2.0)
    count = int(np.clip((length - 2 * edge) / SHORTEST_PIECE_PX, LEAST_PIECES, MOST_PIECES))
    size = (length - 2 * edge) / count
    stations = np.asarray(edge + (np.arange(count) + 0.5) * size)
    found = _proposals(patch, start, along, across, stations, size, reach_px)
    on_line = _agreeing(found, length)
    if on_line is None or len({k for k, _, _, _ in on_line}) < max(LEAST_PIECES, 0.2 * count):
        return None
    half = float(np.clip(length / 12, 2.0, WIDEST_STRIP_PX))
    if not fine:
        return _quick(patch, start, along, across, on_line, (length, size, count))
    return _fitted(patch, start, along, across, on_line, (length, size, half, count))


Proposal = tuple[int, float, float, float]
"""Which piece, its place along, across, and the signed step."""


def _proposals(
    patch: Patch, start: Array, along: Array, across: Array, stations: Array, size: float, reach: float
) -> list[Proposal]:
    """Steps across each station, all at once; at most four a station."""
    n = np.arange(-reach - 2.5, reach + 2.6, 0.5)
    t = np.linspace(-size / 2, size / 2, max(3, min(int(size), 12)))
    points = start + (stations[:, None, None, None] + t[None, None, :, None]) * along + n[None, :, None, None] * across
    profile = patch.values(points).mean(axis=-1)
    kernel = np.array([1.0, 1, 1, 0, -1, -1, -1]) / 3
    steps = np.nan_to_num(np.array([np.convolve(row, kernel, "same") for row in profile]))
    steps[:, :3] = steps[:, -3:] = 0
    magnitude = abs(steps)
    top = magnitude >= LEAST_STEP / 2
    for shift in (-3, -2, -1, 1, 2, 3):
        top &= magnitude >= np.roll(magnitude, shift, axis=1)
    found: list[Proposal] = []
    for k in range(len(stations)):
        where = np.flatnonzero(top[k])
        for i in sorted(where, key=lambda i: -magnitude[k, i])[:4]:
            found.append((k, float(stations[k]), float(n[i]), float(steps[k, i])))
    return found


def _agreeing(found: list[Proposal], length: float) -> list[Proposal] | None:
    """Proposals on the line that most stations support, the stronger steps and the smaller turn preferred."""
    if len(found) < LEAST_PIECES:
        return None
    k = np.array([f[0] for f in found])
    t, n, step = (np.array([f[i] for f in found]) for i in (1, 2, 3))
    first, second = np.nonzero((k[:, None] < k[None, :]) & (abs(t[:, None] - t[None, :]) > 0.25 * length))
    if len(first) == 0:
        return None
    slope = (n[second] - n[first]) / (t[second] - t[first])
    flat = abs(slope) < 0.2
    first, slope = first[flat], slope[flat]
    offset = n[first] - slope * t[first]
    tolerance = ON_LINE_PX + 0.001 * length
    best, score = None, 0.0
    strength = np.minimum(abs(step), 4 * LEAST_STEP) / (4 * LEAST_STEP)
    for a, b in zip(offset, slope, strict=True):
        on = abs(n - a - b * t) < tolerance
        per_station = np.zeros(k.max() + 1)
        np.maximum.at(per_station, k[on], 0.5 + 0.5 * strength[on])
        total = float(per_station.sum()) - 0.02 * abs(a + b * length / 2)
        if total > score:
            best, score = (a, b), total
    if best is None:
        return None
    away = abs(n - best[0] - best[1] * t)
    on_line = [min((away[i], i) for i in np.flatnonzero(k == one))[1] for one in set(k.tolist())]
    return [found[i] for i in on_line if away[i] < tolerance]


def _fitted(
    patch: Patch, start: Array, along: Array, across: Array, on_line: list[Proposal],
    sizes: tuple[float, float, float, int],
) -> Straight | None:  # fmt: skip
    length, size, half, count = sizes
    t0, n0 = np.array([p[1] for p in on_line]), np.array([p[2] for p in on_line])
    slope, offset = np.polyfit(t0, n0, 1) if len(t0) > 1 else (0.0, n0[0])
    direction = (along + slope * across) / math.hypot(1.0, slope)
    rows = []
    for _, t, _, step in on_line:
        middle = start + t * along + (offset + slope * t) * across
        found = piece(patch, middle, direction, size, half, math.copysign(1.0, step) * across)
        if found is None or found.misfit > WORST_MISFIT:
            continue
        rows.append(_row(patch, found, start, along, across, middle))
    if len(rows) < max(LEAST_PIECES, 0.2 * count):
        return None
    data = np.array(rows)
    fit = _line(data, length)
    if fit is None:
        return None
    bend, cov, by_curve, kept = fit
    contrast, misfit = float(np.median(data[kept, 4])), float(np.median(data[kept, 5]))
    side = Side(start - patch.origin_px, along, across, bend, cov, contrast, misfit, by_curve)
    reach = (float(data[kept, 0].min() - size / 2) / length, float(data[kept, 0].max() + size / 2) / length)
    return Straight(side, float(kept.sum()) / count, float(np.sign(data[kept, 6]).mean()), reach)


def _quick(
    patch: Patch, start: Array, along: Array, across: Array, on_line: list[Proposal], sizes: tuple[float, float, int]
) -> Straight | None:  # fmt: skip
    length, size, count = sizes
    t, n, step = (np.array([p[i] for p in on_line]) for i in (1, 2, 3))
    ones = np.ones_like(t)
    found = _line(np.stack([t, n, QUICK_SIGMA_PX**2 * ones, 0 * ones, abs(step), 0 * ones, np.sign(step)], -1), length)
    if found is None:
        return None
    bend, cov, by_curve, kept = found
    side = Side(start - patch.origin_px, along, across, bend, cov, float(np.median(abs(step))), 0.0, by_curve)
    reach = (float(t[kept].min() - size / 2) / length, float(t[kept].max() + size / 2) / length)
    return Straight(side, float(kept.sum()) / count, float(np.sign(step[kept]).mean()), reach)


def _row(patch: Patch, found: Side, start: Array, along: Array, across: Array, middle: Array) -> list[float]:
    """Place along and across, variance, change with the curve, contrast, misfit, and the sign of the light side."""
    t = float((middle - patch.origin_px - found.start) @ found.along)
    powers = np.array([1.0, t, t * t])
    place = found.start + t * found.along + float(found.bend @ powers) * found.across + patch.origin_px - start
    sign = math.copysign(1.0, float(found.across @ across))
    variance = float(powers @ found.cov @ powers) + PIECE_SIGMA_PX**2
    return [float(place @ along), float(place @ across), variance, sign * float(found.by_curve @ powers),
            found.contrast, found.misfit, sign]  # fmt: skip


def _line(data: Array, length: float) -> tuple[Array, Array, Array, Bools] | None:
    """(3,) bend, its covariance, its change with the curve, and which pieces are on it."""
    t, n, variance, by_curve = data[:, 0], data[:, 1], data[:, 2], data[:, 3]
    u = 2 * t / length - 1
    kept = np.ones(len(t), bool)
    for _ in range(6):
        design = np.stack([np.ones_like(u), u, u * u], -1)
        design = design[:, : 3 if length > CURVED_FROM_PX and kept.sum() >= 8 else 2]
        solver = _solver(design, variance, kept)
        if solver is None:
            return None
        found = solver @ n[kept]
        residual = (n - design @ found) / np.sqrt(variance)
        scale = max(1.0, 1.4826 * float(np.median(abs(residual[kept]))))
        now = abs(residual) < 3.5 * scale
        if now.sum() < LEAST_PIECES or np.array_equal(now, kept):
            break
        kept = now
    solver = _solver(design, variance, kept)
    if solver is None:
        return None
    found, shift = solver @ n[kept], solver @ by_curve[kept]
    freedom = max(int(kept.sum()) - design.shape[1], 1)
    excess = max(1.0, float(residual[kept] @ residual[kept]) / freedom)
    k = 2 / length  # from u in -1..1 to t in 0..length: u = k t - 1
    change = np.array([[1, -1, 1], [0, k, -2 * k], [0, 0, k * k]])[:, : design.shape[1]]
    cov = (solver * (excess * variance[kept])) @ solver.T
    return change @ found, change @ cov @ change.T, change @ shift, kept


def _solver(design: Array, variance: Array, kept: Bools) -> Array | None:
    """(parameters, kept) weighted least squares as a matrix; None where the pieces don't tell."""
    weighted = design[kept].T / variance[kept]
    normal = weighted @ design[kept]
    if np.linalg.cond(normal) > 1e10:
        return None
    return np.asarray(np.linalg.solve(normal, weighted))


@dataclass(frozen=True, eq=False)
class Outline:
    """Four sides and where they meet.

    Attributes:
        corners_px: (4, 2) px of the picture; corner i is where sides i - 1 and i meet.
        cov: (8, 8) with that of the transfer curve.
        sides: four.
    """

    corners_px: Array
    cov: Array
    sides: tuple[Straight, ...]


def outline(patch: Patch, corners_px: Array, *, reach_px: float, fine: bool = True) -> Outline | None:
    """The four straight sides near a rough quadrilateral, and their corners with covariance.

    Args:
        patch: the cut-out, with some px around the quadrilateral.
        corners_px: (4, 2) in order around, px of the picture.
        reach_px: how far the sides may lie from the rough ones.
        fine: whether in linear light; else to about half a pixel, for a first look.
    """
    quick = _placed(patch, np.asarray(corners_px, float), reach_px, fine=False)
    if quick is None or not fine:
        return quick
    return _placed(patch, quick.corners_px, 3.0, fine=True)


def _placed(patch: Patch, corners: Array, reach: float, *, fine: bool) -> Outline | None:
    found = [straight(patch, corners[i], corners[(i + 1) % 4], reach_px=reach, fine=fine) for i in range(4)]
    sides = [one for one in found if one is not None]
    if len(sides) < 4:
        return None
    try:
        moved = np.array([meeting(sides[i - 1].side, sides[i].side) for i in range(4)]) + patch.origin_px
    except np.linalg.LinAlgError:
        return None
    if not np.all(np.isfinite(moved)) or np.max(np.hypot(*(moved - corners).T)) > 3 * reach + 10:
        return None
    cov = _covariance(patch, sides)
    return Outline(moved, cov, tuple(sides)) if np.all(np.isfinite(cov)) else None


def _covariance(patch: Patch, sides: list[Straight]) -> Array:
    bends = np.stack([one.side.bend for one in sides])

    def corners(moved: Array) -> Array:
        now = [replace(one.side, bend=bend) for one, bend in zip(sides, moved, strict=True)]
        return np.array([meeting(now[i - 1], now[i]) for i in range(4)]).ravel()

    there, cov = corners(bends), np.eye(8) * CORNER_SIGMA_PX**2
    for i, one in enumerate(sides):
        own = one.side.cov + np.diag([SIDE_SIGMA_PX**2, 0.0, 0.0])
        sd = np.sqrt(np.diag(own).clip(0.0))
        jac = np.zeros((8, 3))
        for j in np.flatnonzero(sd > 0):
            moved = bends.copy()
            moved[i, j] += 0.1 * sd[j]
            jac[:, j] = (corners(moved) - there) / (0.1 * sd[j])
        cov += jac @ own @ jac.T
    size = patch.u_exponent
    shift = (corners(bends + 0.1 * np.stack([one.side.by_curve for one in sides])) - there) * 10 * size
    return np.asarray(cov + np.outer(shift, shift))
