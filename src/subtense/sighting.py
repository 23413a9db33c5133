"""Sighting: where the lines of sight of one point from several pictures meet.

Each picture gives a line of sight; the point is where they meet best, in whitened pixels. It is sought as a direction from the first
picture and an inverse range along it, in which the residuals are nearly straight however small the parallax:

    X_i = R_i (R_1^T (d + a e1 + b e2) + w (C_1 - C_i)),   minimise  sum |whitened (X_i / z_i - seen direction i)|^2  over a, b, w

with the residual taken in the plane across the seen direction, so that any lens will do.

Source: R. Hartley, A. Zisserman, Multiple View Geometry, 12.2; inverse depth: J. Civera, A. Davison, J. Montiel, IEEE Transactions on
Robotics 24, 2008.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from .arrays import Array, Codes
from .method import Reason, reasons
from .quantity import Quantity
from .views import Track, Views

STEPS = 3
"""Gauss-Newton steps of a moved scene from the nominal point."""
MOST_STEPS = 30
BEHIND_SIGMAS = 4.0
"""How far beyond infinity, in its own deviation, an inverse range lies behind the cameras rather than at infinity."""
LEAST_SIGMA_PX = 1e-3


@dataclass(frozen=True, eq=False)
class Start:
    """The nominal point, from which moved scenes take a few steps.

    Attributes:
        direction: (3,) seen in the first picture, in its camera's frame.
        tangents: (N, 2, 3) two axes across each seen direction, in the frame of its camera.
        whiten: (2N, 2N), by which residuals across the seen directions get unit variance.
        solution: (3,) the nominal a, b, and w in 1 / (distance between the first two pictures of the point).
        behind: whether the lines of sight meet behind the cameras, beyond doubt.
    """

    direction: Array
    tangents: Array
    whiten: Array
    solution: Array
    behind: bool


@lru_cache(maxsize=32)
def start_of(views: Views, track: Track) -> Start:
    """The nominal point."""
    if track.is_place:
        return Start(np.zeros(3), np.zeros((0, 2, 3)), np.zeros((0, 0)), np.zeros(3), False)
    rays, pixel_steps = _nominal_rays(views, track)
    tangents = np.stack([_across(ray) for ray in rays])
    whiten = _whitening(track, tangents, pixel_steps)
    begin = Start(rays[0], tangents, whiten, np.zeros(3), False)
    if not (np.all(np.isfinite(rays)) and np.all(np.isfinite(whiten))):
        return begin
    turns, shifts = relative(views, track)
    a = np.cross(rays[1:], (turns[1:] @ rays[0]))
    b = np.cross(rays[1:], shifts[1:])
    squared = float(np.sum(b * b))
    w = -float(np.sum(a * b)) / squared if squared > 0 else 0.0
    begin = Start(rays[0], tangents, whiten, np.array([0.0, 0.0, w]), False)
    solution, normal = settled(begin, rays, turns, shifts, MOST_STEPS)
    with np.errstate(all="ignore"):
        spread = math.sqrt(max(float(np.linalg.pinv(normal)[2, 2]), 0.0))
    return Start(rays[0], tangents, whiten, solution, bool(solution[2] < -BEHIND_SIGMAS * spread))


def _nominal_rays(views: Views, track: Track) -> tuple[Array, Array]:
    """(N, 3) seen directions, and (N, 3, 2) how they move by a pixel."""
    rays, steps = [], []
    offset = np.array([[0.0, 0], [0.5, 0], [-0.5, 0], [0, 0.5], [0, -0.5]])
    for name, place in zip(track.names, track.seen.points_px.reshape(-1, len(track.names), 2)[0], strict=True):
        around = views.camera(views.index(name)).rays(place + offset)
        around = around.reshape(-1, 5, 3)[0]
        rays.append(around[0])
        steps.append(np.stack([around[1] - around[2], around[3] - around[4]], -1))
    return np.stack(rays), np.stack(steps)


def _across(ray: Array) -> Array:
    """(2, 3) unit axes across a direction."""
    first = np.cross(ray, np.eye(3)[np.argmin(abs(np.nan_to_num(ray)))])
    first = first / np.linalg.norm(first)
    return np.stack([first, np.cross(ray, first)])


def _whitening(track: Track, tangents: Array, pixel_steps: Array) -> Array:
    n = len(tangents)
    per_pixel = tangents @ pixel_steps
    to_directions = np.zeros((2 * n, 2 * n))
    for i in range(n):
        to_directions[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = per_pixel[i]
    seen = track.seen
    floored = np.maximum(seen.standard_deviations.reshape(2 * n, -1)[:, 0], LEAST_SIGMA_PX) ** 2
    cov = np.diag(floored) if seen.cov is None else np.asarray(seen.cov) + LEAST_SIGMA_PX**2 * np.eye(2 * n)
    spread = to_directions @ cov @ to_directions.T
    if not np.all(np.isfinite(spread)):
        return np.full((2 * n, 2 * n), np.nan)
    return np.asarray(np.linalg.inv(np.linalg.cholesky(spread)))


def relative(views: Views, track: Track) -> tuple[Array, Array]:
    """Of each picture from the first: (..., N, 3, 3) rotations, and (..., N, 3) shifts in units of the first two's distance."""
    rows = [views.index(name) for name in track.names]
    rotation, centre = views.rotation[..., rows, :, :], views.centre_m[..., rows, :]
    turns = rotation @ np.swapaxes(rotation[..., :1, :, :], -1, -2)
    apart = centre[..., :1, :] - centre
    with np.errstate(divide="ignore", invalid="ignore"):
        unit = apart / np.linalg.norm(apart[..., 1, :], axis=-1)[..., None, None]
    return turns, (rotation @ np.nan_to_num(unit)[..., None])[..., 0]


def settled(begin: Start, rays: Array, turns: Array, shifts: Array, steps: int) -> tuple[Array, Array]:
    """(..., 3) the solution and (..., 3, 3) its normal matrix, by Gauss-Newton steps; broadcasts over leading axes."""
    axes = np.stack([begin.tangents[0, 0], begin.tangents[0, 1]], -1)  # e1, e2 of the first picture
    lead = np.broadcast_shapes(rays.shape[:-2], turns.shape[:-3], shifts.shape[:-2])
    found = np.broadcast_to(begin.solution, (*lead, 3))
    by = np.concatenate([np.broadcast_to(turns @ axes, (*lead, *turns.shape[-3:-1], 2)),
                         np.broadcast_to(shifts, (*lead, *shifts.shape[-2:]))[..., None]], -1)  # fmt: skip
    base = turns @ begin.direction
    normal = np.zeros((*lead, 3, 3))
    for _ in range(steps):
        place = base + (by @ found[..., None, :, None])[..., 0]
        left, slope = residual(begin, rays, place)
        jac = begin.whiten @ (slope @ by).reshape(*lead, -1, 3)
        normal = np.swapaxes(jac, -1, -2) @ jac
        gradient = np.swapaxes(jac, -1, -2) @ (begin.whiten @ left.reshape(*lead, -1, 1))
        damp = 1e-12 * np.trace(normal, axis1=-2, axis2=-1)[..., None, None] * np.eye(3) + 1e-300 * np.eye(3)
        bad = ~np.all(np.isfinite(normal), axis=(-1, -2), keepdims=True)
        step = np.linalg.solve(np.where(bad, np.eye(3), normal + damp), np.where(bad, np.nan, gradient))[..., 0]
        found = found - step
        if np.all(abs(step) < 1e-13 * (1 + abs(found))):
            break
    return found, normal


def residual(begin: Start, rays: Array, place: Array) -> tuple[Array, Array]:
    """(..., N, 2) residuals across the seen directions, and (..., N, 2, 3) their slopes by the place."""
    inner = np.sum(begin.tangents * rays[..., None, :], -1)[..., None]
    tangents = begin.tangents - inner * rays[..., None, :]  # across the moved directions
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        along = 1 / np.sum(rays * place, -1)[..., None]
        left = (tangents @ place[..., None])[..., 0] * along
        slope = (tangents - left[..., None] * rays[..., None, :]) * along[..., None]
    return left, slope


def located(views: Views, track: Track, baseline: Quantity | None, begin: Start) -> tuple[Array, Array, Codes]:
    """(..., 3) the point in the frame of the first picture of the track and in that of the world, m, and the reason."""
    places = views.places_m * by_baseline(views, baseline)[..., None, None]
    if track.is_place:
        own = places[..., views.index(track.names[0]), :]
        return np.zeros_like(own), own, np.zeros(own.shape[:-1], np.int8)
    rays = rays_of(views, track)
    turns, shifts = relative(views, track)
    found, _ = settled(begin, rays, turns, shifts, STEPS)
    axes = np.stack([begin.tangents[0, 0], begin.tangents[0, 1]], -1)
    direction = begin.direction + found[..., :2] @ axes.T
    seen_at = turns @ direction[..., None, :, None]
    ahead = np.sum(rays * (seen_at[..., 0] + found[..., None, 2:] * shifts), -1)
    rows = [views.index(name) for name in track.names]
    unit = np.linalg.norm(places[..., rows[0], :] - places[..., rows[1], :], axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        own = direction * (unit / found[..., 2])[..., None]
    turn = np.swapaxes(views.rotation[..., rows[0], :, :], -1, -2)
    world = (turn @ own[..., None])[..., 0] + places[..., rows[0], :]
    code = _reason(rays, found, unit, ahead, begin, np.asarray(1.0 if baseline is None else baseline.value))
    return own, world, code


def _reason(rays: Array, found: Array, unit: Array, ahead: Array, begin: Start, baseline: Array) -> Codes:
    lead = np.broadcast_shapes(found.shape[:-1], unit.shape, ahead.shape[:-1], rays.shape[:-2], baseline.shape)
    meets = found[..., 2] > 0
    behind = ~np.all(ahead > 0, axis=-1) & (meets | begin.behind)
    return reasons(
        lead, (~np.all(np.isfinite(rays), axis=(-1, -2)), Reason.NOT_INVERTIBLE), (~(baseline > 0), Reason.OUT_OF_RANGE),
        (~(unit > 0), Reason.NO_BASELINE), (np.asarray(begin.behind) | behind, Reason.BEHIND_CAMERA),
        (~np.asarray(meets), Reason.PARALLEL_RAYS),
    )  # fmt: skip


def rays_of(views: Views, track: Track) -> Array:
    """(..., N, 3) seen directions, each in the frame of its camera."""
    points = track.seen.points_px
    found = [views.camera(views.index(name)).rays(points[..., i : i + 1, :]) for i, name in enumerate(track.names)]
    return np.concatenate(np.broadcast_arrays(*found), axis=-2) if found else np.zeros((0, 3))


def by_baseline(views: Views, baseline: Quantity | None) -> Array:
    """(...) what the places are multiplied by so that the first two are `baseline` apart."""
    if baseline is None:
        return np.ones(())
    apart = views.places_m[..., 1, :] - views.places_m[..., 0, :]
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.asarray(baseline.value) / np.linalg.norm(apart, axis=-1))
