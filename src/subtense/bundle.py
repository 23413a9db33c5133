"""Bundle adjustment of a scene: camera numbers, places and points that explain what the pictures show, with their joint covariance.

Minimises  sum rho(|project(camera, R (X - C)) - seen|^2 / sigma^2)  +  (camera - known)^T cov^-1 (camera - known):  what was known of a
camera before is an observation like the pixels. The points are eliminated block by block (Schur complement), so that what is solved
for grows with the pictures only. rho is Cauchy's, so that what COLMAP let pass as a match counts little. Where the world lies, how it
is turned, and its scale, pictures do not tell: the covariance is that of the free network, which is right for everything that does
not depend on them, and for nothing else until a scale is given.

Sigma is what the residuals show; they are judged in patches of the pictures too, because a lens that is not quite its model, or a
detector that errs alike on like things, moves neighbours together.

Source: B. Triggs et al., Bundle adjustment, a modern synthesis, 2000, sections 6 and 9; patches: cluster-robust covariance, A. Cameron,
D. Miller, Journal of Human Resources 50, 2015.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from .arrays import Array, Bools, Indices
from .camera import Camera
from .geometry import cross_matrix, rotation_from_vector

MOST_STEPS = 25
SETTLED = 0.1
"""Fall of the sum of squares below which the solution stands: what a tenth of one unknown's variance is worth."""
CHUNK = 40_000
"""Points eliminated at once."""
CAUCHY = 2.0
"""Residuals, in sigma, from which they count less and less."""
LEAST_SIGMA_PX = 0.05
PATCHES = 4
"""Patches across and down a picture, by which residuals are judged together."""
UNTOLD_INFLATION = 2.0
"""Where there are too few points to tell."""


@dataclass(frozen=True, eq=False)
class Network:
    """Cameras, places, points, and where each point was seen.

    Attributes:
        cameras: with what is known of them before, as their covariance.
        camera_of: (V,) which took each picture.
        rotation: (V, 3, 3) camera_from_world.
        centre: (V, 3) of the entrance pupils, in the world's unit.
        points: (P, 3).
        view: (M,) the picture of each observation.
        point: (M,) its point.
        seen_px: (M, 2).
    """

    cameras: tuple[Camera, ...]
    camera_of: Indices
    rotation: Array
    centre: Array
    points: Array
    view: Indices
    point: Indices
    seen_px: Array

    @cached_property
    def free(self) -> tuple[Indices, ...]:
        """Of each camera, which of its numbers are open."""
        return tuple(
            np.zeros(0, np.intp) if camera.cov is None else np.flatnonzero(np.diag(camera.cov) > 0)
            for camera in self.cameras
        )

    @cached_property
    def starts(self) -> Indices:
        """Where each camera's open numbers begin among the unknowns, and how many unknowns there are."""
        return np.cumsum([6 * len(self.rotation), *(len(free) for free in self.free)])

    def placed(self) -> Array:
        """(M, 3) what was seen, in the frame of the picture it was seen in."""
        apart = self.points[self.point] - self.centre[self.view]
        return np.asarray(np.einsum("mij,mj->mi", self.rotation[self.view], apart))

    def residual_px(self, placed: Array | None = None) -> Array:
        """(M, 2) projected less seen; NaN behind a camera."""
        own = self.placed() if placed is None else placed
        found = np.full((len(own), 2), np.nan)
        for c, camera in enumerate(self.cameras):
            mine = self.camera_of[self.view] == c
            found[mine] = camera.project(own[mine])
        return np.asarray(found - self.seen_px)

    def kept(self, mask: Bools) -> Network:
        """Those observations only, of points that are still seen twice; points that are not stay where they are."""
        often = np.bincount(self.point[mask], minlength=len(self.points)) >= 2
        mask = mask & often[self.point]
        return replace(self, view=self.view[mask], point=self.point[mask], seen_px=self.seen_px[mask])


@dataclass(frozen=True, eq=False)
class Bundle:
    """A network that fits, and how well it is known.

    Attributes:
        network: adjusted.
        cov: of the places (rotation vector rad, centre) of all pictures and then all numbers of all cameras, in the free network.
        sigma_px: of an observation's coordinate, as the residuals show.
        inflation: how many times wider `cov` is, in deviations, than independent residuals would make it.
        used: (M,) how much each observation counted, 0 to 1.
        rms_px: per coordinate, of all observations.
        freedom: coordinates less unknowns.
        prior_shift: for each camera how far its open numbers moved, in what was known of them.
    """

    network: Network
    cov: Array
    sigma_px: float
    inflation: float
    used: Array
    rms_px: float
    freedom: float
    prior_shift: tuple[Array, ...]


@dataclass(frozen=True, eq=False)
class _Linear:
    """The reduced system at a state."""

    schur: Array
    right: Array
    back: Callable[[Array], Array]


def adjust(network: Network, known: Sequence[Camera] | None = None) -> Bundle:
    """The network that fits best, by Levenberg-Marquardt steps.

    Args:
        network: a start, as of structure from motion.
        known: what was known of the cameras before, with its covariance; None for the cameras of the start.
    """
    before = network.cameras if known is None else tuple(known)
    residual = network.residual_px()
    network = network.kept(np.asarray(np.isfinite(residual).all(axis=1)))
    sigma = _sigma(network.residual_px())
    damp, cost = 1e-4, _cost(network, before, sigma)
    for step in range(MOST_STEPS):
        weight = _weights(network.residual_px(), sigma)
        system = _system(network, before, weight / sigma**2)
        better, damp, gained = _descended(network, before, system, sigma, cost, damp)
        if better is None:
            break
        network, cost = better, cost - gained
        if gained <= SETTLED:
            break
        if step < 3:  # the residuals of a start say little
            sigma = _sigma(network.residual_px())
            cost = _cost(network, before, sigma)
    return _result(network, before)


def _sigma(residual: Array) -> float:
    """Robust standard deviation of a coordinate."""
    return max(1.4826 * float(np.nanmedian(abs(residual))), LEAST_SIGMA_PX)


def _weights(residual: Array, sigma: float) -> Array:
    """(M,) of Cauchy's law; 0 behind a camera."""
    square = np.sum(residual**2, axis=1) / (CAUCHY * sigma) ** 2
    return np.where(np.isfinite(square), 1 / (1 + np.nan_to_num(square)), 0.0)


def _cost(network: Network, known: tuple[Camera, ...], sigma: float) -> float:
    square = np.sum(network.residual_px() ** 2, axis=1) / sigma**2
    square = np.where(np.isfinite(square), square, 1e6)
    apart = [
        _prior(camera, before, free) for camera, before, free in zip(network.cameras, known, network.free, strict=True)
    ]
    return float(np.sum(CAUCHY**2 * np.log1p(square / CAUCHY**2))) + sum(float(d @ w @ d) for d, w in apart)


def _prior(camera: Camera, before: Camera, free: Indices) -> tuple[Array, Array]:
    """How far the open numbers are from what was known, and the weight of that."""
    if not len(free) or before.cov is None:
        return np.zeros(0), np.zeros((0, 0))
    cov = before.cov[np.ix_(free, free)]
    scale = np.sqrt(np.diag(cov))
    unit = cov / np.outer(scale, scale) + 1e-9 * np.eye(len(free))
    return (numbers(camera) - numbers(before))[free], np.asarray(np.linalg.inv(unit) / np.outer(scale, scale))


def numbers(camera: Camera) -> Array:
    """(4 + k,) in the order of `Camera.cov`."""
    return np.concatenate([[camera.f_px, camera.aspect, camera.cx_px, camera.cy_px], camera.coefficients])


def with_numbers(camera: Camera, values: Array, **changes: Any) -> Camera:
    """The camera with other numbers."""
    k = values[4:] if len(values) > 4 else None
    return replace(camera, f_px=float(values[0]), aspect=float(values[1]), cx_px=float(values[2]), cy_px=float(values[3]),
                   distortion=k, id=None, **changes)  # fmt: skip


def _slopes(network: Network) -> tuple[Array, list[Array], Array]:
    """(M, 2, 6) residuals' slopes by place, for each camera (its M, 2, K) those by its numbers, and (M, 2, 3) those by point."""
    placed = network.placed()
    by_placed = np.empty((len(placed), 2, 3))
    by_camera = []
    for c, camera in enumerate(network.cameras):
        mine = network.camera_of[network.view] == c
        own = placed[mine]
        step = 1e-6 * np.linalg.norm(own, axis=1)
        for axis in range(3):
            shift = np.zeros_like(own)
            shift[:, axis] = step
            ahead, behind = camera.project(own + shift), camera.project(own - shift)
            by_placed[mine, :, axis] = (ahead - behind) / (2 * step[:, None])
        by_camera.append(_by_numbers(camera, own, network.free[c]))
    turns = network.rotation[network.view]
    by_point = by_placed @ turns
    by_place = np.concatenate([by_placed @ -cross_matrix(placed), -by_point], axis=2)
    return by_place, by_camera, by_point


def _by_numbers(camera: Camera, own: Array, free: Indices) -> Array:
    found = np.empty((len(own), 2, len(free)))
    values = numbers(camera)
    assert camera.cov is not None or not len(free)
    for column, index in enumerate(free):
        step = np.zeros_like(values)
        step[index] = 1e-4 * math.sqrt(camera.cov[index, index])  # type: ignore[index]
        ahead, behind = (with_numbers(camera, values + sign * step).project(own) for sign in (1, -1))
        found[:, :, column] = (ahead - behind) / (2 * step[index])
    return found


def _blocks(network: Network) -> tuple[Array, Array, Indices]:
    """(M, 2, 6 + most) slopes by place and camera, (M, 2, 3) by point, and (M, 6 + most) the unknowns of the first; -1 for none."""
    by_place, by_camera, by_point = _slopes(network)
    most = max((len(free) for free in network.free), default=0)
    slopes = np.zeros((len(by_place), 2, 6 + most))
    slopes[:, :, :6] = by_place
    columns = np.full((len(by_place), 6 + most), -1)
    columns[:, :6] = 6 * network.view[:, None] + np.arange(6)
    for c, free in enumerate(network.free):
        mine = network.camera_of[network.view] == c
        slopes[mine, :, 6 : 6 + len(free)] = by_camera[c]
        columns[mine, 6 : 6 + len(free)] = network.starts[c] + np.arange(len(free))
    return slopes, by_point, columns


def _system(network: Network, known: tuple[Camera, ...], weight: Array) -> _Linear:
    """The normal equations with the points eliminated."""
    from scipy import sparse

    size, points = int(network.starts[-1]), len(network.points)
    slopes, by_point, columns = _blocks(network)
    residual = network.residual_px()
    fine = np.isfinite(slopes).all(axis=(1, 2)) & np.isfinite(residual).all(axis=1)
    weight = np.where(fine, weight, 0.0)
    slopes, by_point, residual = (np.nan_to_num(x) for x in (slopes, by_point, residual))
    weighted = slopes * weight[:, None, None]
    right = _gathered(-np.einsum("mij,mi->mj", weighted, residual), columns, size)
    inner = np.zeros((points, 3, 3))
    np.add.at(inner, network.point, np.einsum("mij,mik->mjk", by_point * weight[:, None, None], by_point))
    pull = np.zeros((points, 3))
    np.add.at(pull, network.point, -np.einsum("mij,mi->mj", by_point * weight[:, None, None], residual))
    trace = np.trace(inner, axis1=1, axis2=2)
    inverse = np.linalg.inv(inner + (1e-9 * trace + (trace == 0))[:, None, None] * np.eye(3))
    own = np.einsum("mij,mik->mjk", weighted, slopes)
    rows, cols = (np.broadcast_to(x, own.shape) for x in (columns[:, :, None], columns[:, None, :]))
    kept = (rows >= 0) & (cols >= 0)
    schur = np.asarray(sparse.coo_matrix((own[kept], (rows[kept], cols[kept])), shape=(size, size)).toarray())
    cross = np.einsum("mij,mik->mjk", weighted, by_point)  # (M, 6 + most, 3)
    row = np.broadcast_to(columns[:, :, None], cross.shape)
    column = np.broadcast_to((3 * network.point)[:, None, None] + np.arange(3), cross.shape)
    kept = row >= 0
    e = sparse.csr_matrix((cross[kept], (row[kept], column[kept])), shape=(size, 3 * points))
    root = np.linalg.cholesky(inverse)
    for first in range(0, points, CHUNK):
        part = slice(first, min(first + CHUNK, points))
        half = _times(e[:, 3 * part.start : 3 * part.stop], root[part])
        schur -= (half @ half.T).toarray()
    right -= e @ np.einsum("pij,pj->pi", inverse, pull).reshape(-1)
    _add_priors(network, known, schur, right)

    def back(step: Array) -> Array:
        return np.asarray(np.einsum("pij,pj->pi", inverse, pull - (e.T @ step).reshape(-1, 3)))

    return _Linear((schur + schur.T) / 2, right, back)


def _times(e: Any, root: Array) -> Any:
    """Sparse (n, 3 P) times the block-diagonal of (P, 3, 3)."""
    from scipy import sparse

    count = len(root)
    blocks = sparse.bsr_matrix((root, np.arange(count), np.arange(count + 1)), shape=(3 * count, 3 * count))
    return (e @ blocks.tocsr()).tocsr()


def _gathered(values: Array, columns: Indices, size: int) -> Array:
    kept = columns >= 0
    return np.asarray(np.bincount(columns[kept], values[kept], minlength=size), float)


def _add_priors(network: Network, known: tuple[Camera, ...], schur: Array, right: Array) -> None:
    for c, (camera, before, free) in enumerate(zip(network.cameras, known, network.free, strict=True)):
        apart, weight = _prior(camera, before, free)
        rows = slice(int(network.starts[c]), int(network.starts[c]) + len(free))
        schur[rows, rows] += weight
        right[rows] -= weight @ apart


def _descended(
    network: Network, known: tuple[Camera, ...], system: _Linear, sigma: float, cost: float, damp: float
) -> tuple[Network | None, float, float]:
    """A network of a smaller sum, the damping to go on with, and what was gained; None where no step helps."""
    diagonal = np.diag(system.schur)
    for _ in range(12):
        try:
            step = np.asarray(
                np.linalg.solve(system.schur + damp * np.diag(diagonal + 1e-9 * diagonal.mean()), system.right), float
            )
        except np.linalg.LinAlgError:
            damp *= 10
            continue
        moved = _stepped(network, step, system.back(step))
        new = _cost(moved, known, sigma) if moved is not None else math.inf
        if moved is not None and new <= cost:
            return moved, max(damp / 10, 1e-10), cost - new
        damp *= 10
    return None, damp, 0.0


def _stepped(network: Network, step: Array, points: Array) -> Network | None:
    views = len(network.rotation)
    places = step[: 6 * views].reshape(views, 6)
    cameras = []
    for c, (camera, free) in enumerate(zip(network.cameras, network.free, strict=True)):
        values = numbers(camera)
        values[free] += step[network.starts[c] : network.starts[c] + len(free)]
        if not (values[0] > 0 and values[1] > 0 and np.all(np.isfinite(values))):
            return None
        cameras.append(with_numbers(camera, values))
    return replace(network, cameras=tuple(cameras), rotation=rotation_from_vector(places[:, :3]) @ network.rotation,
                   centre=network.centre + places[:, 3:], points=network.points + points)  # fmt: skip


def thinned(network: Network, cells: int) -> Network:
    """Points spread over all pictures, the longest tracks first: one for each cell of `cells` by `cells` in each picture.

    Neighbours are found by the same detector in the same texture and err alike, so the many more that there are add certainty only in
    the formula.
    """
    length = np.bincount(network.point, minlength=len(network.points))
    sizes = np.array([[network.cameras[c].width_px, network.cameras[c].height_px] for c in network.camera_of])
    cell = np.clip((network.seen_px / sizes[network.view] * cells).astype(int), 0, cells - 1)
    key = (network.view * cells + cell[:, 0]) * cells + cell[:, 1]
    order = np.lexsort((network.point, -length[network.point], key))
    first = np.r_[True, np.diff(key[order]) != 0]
    kept = np.zeros(len(network.points), bool)
    kept[network.point[order[first]]] = True
    mine = kept[network.point]
    renumbered = np.cumsum(kept) - 1
    return replace(network, points=network.points[kept], view=network.view[mine], point=renumbered[network.point[mine]],
                   seen_px=network.seen_px[mine])  # fmt: skip


# -- how well it is known --------------------------------------------------------------------------------


def _result(network: Network, known: tuple[Camera, ...]) -> Bundle:
    residual = network.residual_px()
    sigma = _sigma(residual)
    weight = _weights(residual, sigma)
    seen = np.bincount(network.point, weight > 0.1, minlength=len(network.points)) >= 2
    unknowns = network.starts[-1] - 7 + 3 * int(seen.sum())
    effective = float(np.sum(weight))
    freedom = max(2 * effective - unknowns, 1.0)
    sigma = math.sqrt(float(np.nansum(weight[:, None] * residual**2)) / freedom)
    system = _system(network, known, weight / sigma**2)
    free_cov = free_network(network, system.schur)
    inflation = _inflation(network, known, weight / sigma**2)
    cov = _whole(network, free_cov, inflation)
    cameras = tuple(_informed(camera, cov, _offset(network, c)) for c, camera in enumerate(network.cameras))
    shifts = tuple(
        (numbers(camera) - numbers(before))[free] / np.sqrt(np.diag(before.cov)[free])
        if before.cov is not None
        else np.zeros(0)
        for camera, before, free in zip(network.cameras, known, network.free, strict=True)
    )
    return Bundle(
        replace(network, cameras=cameras),
        cov,
        sigma,
        inflation,
        weight,
        float(np.sqrt(np.nanmean(residual**2))),
        freedom,
        shifts,
    )


def _offset(network: Network, c: int) -> int:
    return 6 * len(network.rotation) + sum(4 + camera.coefficients.size for camera in network.cameras[:c])


def _informed(camera: Camera, cov: Array, start: int) -> Camera:
    own = slice(start, start + 4 + camera.coefficients.size)
    return replace(camera, cov=cov[own, own], id=None)


def gauge(network: Network) -> Array:
    """(unknowns, 7) how places move when the world is shifted, turned and scaled about its middle; nothing seen changes."""
    views, size = len(network.rotation), int(network.starts[-1])
    middle = network.centre.mean(axis=0)
    found = np.zeros((size, 7))
    for axis in range(3):
        turn = np.zeros(3)
        turn[axis] = 1.0
        found[3 : 6 * views : 6, axis] = 0
        for i in range(views):
            found[6 * i + 3 + axis, axis] = 1.0
            found[6 * i : 6 * i + 3, 3 + axis] = -network.rotation[i] @ turn
            found[6 * i + 3 : 6 * i + 6, 3 + axis] = np.cross(turn, network.centre[i] - middle)
    found[: 6 * views, 6].reshape(views, 6)[:, 3:] = network.centre - middle
    return found


def free_network(network: Network, schur: Array) -> Array:
    """The covariance of the unknowns, of least trace (in scaled numbers) among all that fit the same pictures."""
    scale = 1 / np.sqrt(np.maximum(np.diag(schur), 1e-300))
    unit = schur * np.outer(scale, scale)
    basis, _ = np.linalg.qr(gauge(network) / scale[:, None])
    weight = float(np.median(np.diag(unit)))
    inverse = np.linalg.inv(unit + weight * basis @ basis.T)
    project = np.eye(len(unit)) - basis @ basis.T
    found = project @ inverse @ project
    return np.asarray((found + found.T) / 2 * np.outer(scale, scale))


def _whole(network: Network, cov: Array, inflation: float) -> Array:
    """That of the open unknowns put into that of all numbers, widened."""
    views = 6 * len(network.rotation)
    rows = list(range(views))
    for c, free in enumerate(network.free):
        rows += [_offset(network, c) + int(index) for index in free]
    size = _offset(network, len(network.cameras))
    whole = np.zeros((size, size))
    whole[np.ix_(rows, rows)] = cov * inflation**2
    return whole


def _inflation(network: Network, known: tuple[Camera, ...], weight: Array) -> float:
    """How much farther halves of the points differ in what they say than independent residuals would make them; at least 1.

    The halves are fields of a pattern of patches, so that neighbours, which err alike, stay together.
    """
    sizes = np.array([[network.cameras[c].width_px, network.cameras[c].height_px] for c in network.camera_of])
    patch = np.clip((network.seen_px / sizes[network.view] * PATCHES).astype(int), 0, PATCHES - 1)
    first = np.zeros(len(network.points), np.intp)
    first[network.point[::-1]] = np.arange(len(network.point))[::-1]
    across, down = patch[first].T
    basis = None
    found = []
    for half in ((across + down) % 2 == 0, across % 2 == 0, down % 2 == 0):
        mine = half[network.point]
        if min(np.sum(weight[mine] > 0), np.sum(weight[~mine] > 0)) < 2 * int(network.starts[-1]):
            continue
        parts = [_system(network, known, np.where(side, weight, 0.0)) for side in (mine, ~mine)]
        if basis is None:
            scale = 1 / np.sqrt(np.maximum(np.diag(parts[0].schur + parts[1].schur), 1e-300))
            basis, _ = np.linalg.qr(gauge(network) / scale[:, None])
            space = np.linalg.svd(basis)[0][:, basis.shape[1] :]  # of what pictures can tell
        inner = [space.T @ (part.schur * np.outer(scale, scale)) @ space for part in parts]
        try:
            inverse = [np.linalg.inv(one) for one in inner]
            apart = inverse[0] @ (space.T @ (scale * parts[0].right)) - inverse[1] @ (
                space.T @ (scale * parts[1].right)
            )
            found.append(float(apart @ np.linalg.solve(inverse[0] + inverse[1], apart)) / len(apart))
        except np.linalg.LinAlgError:
            continue
    return max(1.0, math.sqrt(float(np.mean(found)))) if found else UNTOLD_INFLATION
