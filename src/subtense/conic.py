"""Ellipses and cones of sight: what a disc or a ball looks like, fitted to directions.

The directions in which the rim of a disc or of a ball is seen lie on an elliptic cone. In the plane at distance 1 across the
cone's own axis it is an ellipse about the axis, whose half axes p <= q are the tangents of the cone's half angles. It is kept as
s = log(p q) / 2 and d = log(q / p) / 2 in the direction of twice the long axis' angle, whose noise is independent of that of s
where the whole rim is seen. No lens and no place in the picture enters: the plane turns with the axis.

For a disc of radius r (with l = (1/p^2, 1/q^2, -1) the cone's eigenvalues):
  range of the centre   r sqrt(1 + (1 - p^2) / q^2)
  cos(tilt)             p / (q sqrt(1 + q^2 - p^2)), between the disc's normal and the line of sight to its centre
  centre off the axis   r p sqrt((1 - p^2 / q^2) / (1 + p^2)), along the short axis, to either side
Both discs that a cone can be of have the same range and the same tilt. For a ball p = q, and range = r sqrt(1 + 1 / q^2).

Source: Q. Chen, H. Wu, T. Wada, Camera calibration with two arbitrary coplanar circles, ECCV 2004, section 2 (the two discs of a
cone), from which the forms in p and q follow; P. Sampson, Fitting conic sections to very scattered data, 1982 (the residual).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from .arrays import Array, Bools
from .camera import Camera
from .geometry import cross_matrix, rotation_from_vector
from .observation import Observation

SETTLED = 1e-10
"""A step below which a fit has converged; all its parameters are relative to the cone's size."""
FINE = 1e-4
"""A last step above which there is no cone."""
REFITS = 2
"""Steps of a moved rim from the nominal cone."""
LEAST_SIZE = 1e-9
"""Points nearer together are one."""
STEPS, ROUNDS = 40, 2
"""Steps of the nominal fit at most, and how often it is weighted."""
SMALL_SHARE = 1e-2
"""Least eigenvalue of the residuals' covariance over its mean one: points that stand for a fitted conic have rank 5 only."""


@dataclass(frozen=True, eq=False)
class Cone:
    """An elliptic cone with its apex at the camera.

    Attributes:
        frame: (..., 3, 3) rows are two directions across the axis, and the axis; rotation of camera directions into it.
        log_size: (...) s, of the tangents of the half angles.
        flat: (..., 2) d, as a vector at twice the angle of the long axis in the frame.
    """

    frame: Array
    log_size: Array
    flat: Array

    @property
    def axis(self) -> Array:
        """(..., 3) unit direction."""
        return self.frame[..., 2, :]

    @property
    def short(self) -> Array:
        """(..., 3) unit direction of the ellipse's short axis, across the cone's axis, to its lower end in the picture."""
        half = np.arctan2(self.flat[..., 1], self.flat[..., 0])[..., None] / 2
        short = np.cos(half) * self.frame[..., 1, :] - np.sin(half) * self.frame[..., 0, :]
        return np.asarray(short * np.where(short[..., 1:2] < 0, -1.0, 1.0))


@dataclass(frozen=True, eq=False)
class ConeFit:
    """A nominal fit, and what refits moved points.

    Attributes:
        cone: the fit.
        middle: (..., 3) mean of the directions, in the cone's frame.
        size: (...) mean tangent of the half angles where the fit began: the unit of its residuals and turns.
        gain: (..., k, N) from residuals to parameters; k = 5, or 3 for a round cone.
        cov: (..., k, k) of the parameters (two turns of the axis over the size, s, d), by the points' covariance.
        chi2: (...) weighted sum of squared residuals.
        fits: (...) whether there is a cone at all.
    """

    cone: Cone
    middle: Array
    size: Array
    gain: Array
    cov: Array
    chi2: Array
    fits: Bools


def residuals(seen: Array, log_size: Array, flat: Array) -> Array:
    """(..., N) distances of (..., N, 2) points of the plane from the ellipse about 0, to first order."""
    x, y = seen[..., 0], seen[..., 1]
    d1, d2 = flat[..., :1], flat[..., 1:]
    length = np.sqrt(d1 * d1 + d2 * d2).clip(1e-6, 50.0)  # the functions of it below are even, and flat at 0
    grow, share = np.cosh(2 * length), np.sinh(2 * length) / length
    gx, gy = (grow - share * d1) * x - share * d2 * y, (grow + share * d1) * y - share * d2 * x
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray((x * gx + y * gy - np.exp(2 * log_size)[..., None]) / (2 * np.sqrt(gx * gx + gy * gy)))


def _placed(local: Array, turn: Array) -> Array:
    """(..., N, 2) places in the plane across the axis, of directions in a frame that is turned by (..., 3, 3)."""
    moved = local @ np.swapaxes(turn, -1, -2)
    with np.errstate(divide="ignore", invalid="ignore"):
        z = np.where(moved[..., 2:] > 0, moved[..., 2:], np.nan)
        return np.asarray(moved[..., :2] / z)


def _turned(turn: Array, step: Array, size: Array) -> Array:
    """The rotation after a step of the axis, (..., 2) over its size."""
    vector = np.concatenate([step * size[..., None], np.zeros_like(step[..., :1])], -1)
    return np.asarray(rotation_from_vector(vector) @ turn)


class _State(NamedTuple):
    """Turn of the frame, s, d."""

    turn: Array
    log_size: Array
    flat: Array


def _moved(state: _State, step: Array, size: Array) -> _State:
    """The state after (..., k) steps: two turns of the axis over the size, s, d."""
    flat = state.flat + step[..., 3:] if step.shape[-1] == 5 else state.flat
    return _State(_turned(state.turn, step[..., :2], size), state.log_size + step[..., 2], flat)


def _off(state: _State, local: Array, size: Array) -> Array:
    """(..., N) residuals over the size."""
    return residuals(_placed(local, state.turn), state.log_size, state.flat) / size[..., None]


def _jacobian(state: _State, local: Array, size: Array, count: int) -> Array:
    """(..., N, count) derivatives of the residuals over the size, by differences."""
    seen, h = _placed(local, state.turn), 1e-5
    x, y = seen[..., 0], seen[..., 1]
    turns = size[..., None, None] * np.stack([np.stack([-x * y, -1 - y * y], -1), np.stack([1 + x * x, x * y], -1)])
    columns = [
        residuals(seen + h * turn, state.log_size, state.flat) - residuals(seen - h * turn, state.log_size, state.flat)
        for turn in turns
    ]
    for move in h * np.eye(3)[: count - 2]:
        sides = [residuals(seen, state.log_size + s * move[0], state.flat + s * move[1:]) for s in (1, -1)]
        columns.append(sides[0] - sides[1])
    return np.nan_to_num(np.stack(columns, -1) / (2 * h * size[..., None, None]))


def rim_cone(camera: Camera, rim: Observation, *, round_one: bool = False) -> ConeFit:
    """The cone on which the points of a rim lie, through any lens.

    Args:
        camera: of the picture.
        rim: five or more points, three or more of a ball's.
        round_one: whether it is a ball's.
    """
    points, step = rim.points_px, 1e-3
    dx, dy = np.array([step, 0.0]), np.array([0.0, step])
    by_px = np.stack([camera.rays(points + move) - camera.rays(points - move) for move in (dx, dy)], -1) / (2 * step)
    cov = rim.cov
    if cov is None:
        variance = np.maximum(rim.standard_deviations, 1e-6) ** 2
        cov = variance[..., None] * np.eye(variance.shape[-1])
    return fit_cone(np.nan_to_num(camera.rays(points)), np.nan_to_num(by_px), cov, round_one=round_one)


MISFIT_Z = 4.75
"""Normal quantile (1 in 1e6) beyond which residuals are no chance."""


def misfit(chi2: float, freedom: int) -> float:
    """How many times what is stated the residuals are, where that is beyond chance; 0 else."""
    if freedom < 1:
        return 0.0
    spread = 2 / (9 * freedom)
    most = freedom * (1 - spread + MISFIT_Z * spread**0.5) ** 3  # Wilson and Hilferty's quantile of chi^2
    return float((chi2 / freedom) ** 0.5) if chi2 > most else 0.0


def fit_cone(rays: Array, rays_by_px: Array, cov_px: Array, *, round_one: bool = False) -> ConeFit:
    """Fit a cone to directions, weighted by what is known of their points.

    Args:
        rays: (..., N, 3) unit directions in the camera frame.
        rays_by_px: (..., N, 3, 2) their derivatives by the points.
        cov_px: (..., 2N, 2N) covariance of the points.
        round_one: whether it is a ball's.
    """
    frame, log_size, flat = _begin(rays, round_one)
    size, count = np.asarray(np.exp(log_size), float), 3 if round_one else 5
    for _ in range(ROUNDS):  # the weights are those where the fit is
        local = rays @ np.swapaxes(frame, -1, -2)
        spread = _residual_cov(local, frame, rays_by_px, cov_px, log_size, flat, size)
        weight = np.asarray(np.linalg.inv(_floored(spread)), float)
        state, last = _least_squares(
            _State(np.broadcast_to(np.eye(3), frame.shape), log_size, flat), local, size, weight, count
        )
        frame, log_size, flat = state.turn @ frame, state.log_size, state.flat
    local = rays @ np.swapaxes(frame, -1, -2)
    state = _State(np.broadcast_to(np.eye(3), frame.shape), log_size, flat)
    gain, now = _solved(_jacobian(state, local, size, count), weight), _off(state, local, size)
    chi2 = np.einsum("...i,...ij,...j->...", now, weight, now)
    fits = np.asarray((last < FINE) & np.isfinite(chi2) & (log_size > -20))
    return ConeFit(
        Cone(frame, log_size, flat),
        local.mean(axis=-2),
        size,
        gain,
        gain @ spread @ np.swapaxes(gain, -1, -2),
        chi2,
        fits,
    )


def _solved(jac: Array, weight: Array, damping: Array | float = 0.0) -> Array:
    """(..., count, N) what takes residuals to the step of least squares, damped after Marquardt."""
    weighted = np.swapaxes(jac, -1, -2) @ weight
    normal = weighted @ jac
    eye = np.eye(jac.shape[-1])
    scale = np.trace(normal, axis1=-2, axis2=-1)[..., None, None] + 1e-300
    return np.linalg.solve(normal + (1e-13 * scale + np.asarray(damping)[..., None, None] * normal) * eye, weighted)


def _least_squares(state: _State, local: Array, size: Array, weight: Array, count: int) -> tuple[_State, Array]:
    """Levenberg and Marquardt's steps, each row with a damping of its own; and how long the last one was."""
    damping, last = np.full(state.log_size.shape, 1e-3), np.full(state.log_size.shape, np.inf)
    off = _off(state, local, size)
    cost = np.nan_to_num(np.einsum("...i,...ij,...j->...", off, weight, off), nan=np.inf)
    for _ in range(STEPS):
        step = -(_solved(_jacobian(state, local, size, count), weight, damping) @ np.nan_to_num(off)[..., None])[
            ..., 0
        ].clip(-1.0, 1.0)
        tried = _moved(state, step, size)
        then = _off(tried, local, size)
        worth = np.nan_to_num(np.einsum("...i,...ij,...j->...", then, weight, then), nan=np.inf)
        last = abs(step).max(axis=-1)
        better = np.asarray((worth <= cost * (1 + 1e-12)) | (last < SETTLED))
        state = _State(*(np.where(better[(..., *(None,) * (new.ndim - better.ndim))], new, old)
                         for new, old in zip(tried, state, strict=True)))  # fmt: skip
        off, cost = np.where(better[..., None], then, off), np.where(better, worth, cost)
        damping = np.where(better, damping * 0.1, np.minimum(damping * 10, 1e6))
        if np.max(last, initial=0.0) < SETTLED:
            break
    return state, last


def _residual_cov(
    local: Array, frame: Array, rays_by_px: Array, cov_px: Array, log_size: Array, flat: Array, size: Array
) -> Array:
    """(..., N, N) covariance of the residuals over the size, from that of the points."""
    by_px = frame[..., None, :, :] @ rays_by_px
    small = (1e-3 * size)[..., None] / _length(by_px)  # a move of a thousandth of the size, in px
    slopes = []
    for axis in (0, 1):
        move = small[..., None] * by_px[..., axis]
        sides = [residuals(_placed(local + sign * move, np.eye(3)), log_size, flat) for sign in (1.0, -1.0)]
        slopes.append((sides[0] - sides[1]) / (2 * small * size[..., None]))
    slope = np.nan_to_num(np.stack(slopes, -1))  # (..., N, 2)
    n = slope.shape[-2]
    blocks = cov_px.reshape(*cov_px.shape[:-2], n, 2, n, 2)
    return np.asarray(np.einsum("...ia,...iajb,...jb->...ij", slope, blocks, slope))


def _length(by_px: Array) -> Array:
    """(..., N) how far a direction moves with a pixel, at most."""
    return np.asarray(np.sqrt(np.sum(by_px**2, axis=(-1, -2))) + 1e-300)


def _floored(cov: Array) -> Array:
    n = cov.shape[-1]
    mean = np.trace(cov, axis1=-2, axis2=-1)[..., None, None] / n
    return np.asarray(cov + (SMALL_SHARE * np.where(mean > 0, mean, 1.0)) * np.eye(n))


def _begin(rays: Array, round_one: bool) -> tuple[Array, Array, Array]:
    """Frame, s and d of a cone near the directions: that of the conic of least algebraic distance, else a round one."""
    frame = frame_of(np.nan_to_num(rays.mean(axis=-2), nan=1.0))
    seen = np.nan_to_num(_placed(rays @ np.swapaxes(frame, -1, -2), np.eye(3)))
    middle = seen.mean(axis=-2, keepdims=True)
    scale = np.sqrt(np.mean((seen - middle) ** 2, axis=(-1, -2))) + LEAST_SIZE
    x, y = np.moveaxis((seen - middle) / scale[..., None, None], -1, 0)
    conic = _circle_by(x, y)
    if not round_one:
        general = _conic_by(x, y)
        conic = np.where(_is_ellipse(general)[..., None, None], general, conic)
    move = np.zeros((*scale.shape, 3, 3))  # to centred and scaled places
    move[..., 0, 0] = move[..., 1, 1] = 1 / scale
    move[..., :2, 2] = -middle[..., 0, :] / scale[..., None]
    move[..., 2, 2] = 1
    return _principal(np.swapaxes(move, -1, -2) @ conic @ move, frame, round_one)


def _circle_by(x: Array, y: Array) -> Array:
    """(..., 3, 3) the circle of least algebraic distance (Kasa) as a conic."""
    found = np.linalg.pinv(np.stack([x, y, np.ones_like(x)], -1)) @ (x * x + y * y)[..., None]
    cx, cy, c = found[..., 0, 0] / 2, found[..., 1, 0] / 2, found[..., 2, 0]
    zero = np.zeros_like(cx)
    rows = ([zero + 1, zero, -cx], [zero, zero + 1, -cy], [-cx, -cy, -c])
    return np.stack([np.stack(row, -1) for row in rows], -2)


def _conic_by(x: Array, y: Array) -> Array:
    """(..., 3, 3) the conic of least algebraic distance."""
    design = np.stack([x * x, 2 * x * y, y * y, 2 * x, 2 * y, np.ones_like(x)], -1)
    a, b, c, d, e, f = np.moveaxis(np.linalg.svd(design, full_matrices=True)[2][..., -1, :], -1, 0)
    return np.stack([np.stack(row, -1) for row in ([a, b, d], [b, c, e], [d, e, f])], -2)


def _is_ellipse(conic: Array) -> Bools:
    """Whether it is a real ellipse, not too slim to be one with noise."""
    a, b, c = conic[..., 0, 0], conic[..., 0, 1], conic[..., 1, 1]
    real = np.linalg.det(conic) * (a + c) < 0
    return np.asarray((a * c - b * b > 1e-3 * (a + c) ** 2) & real)


def _principal(conic: Array, frame: Array, round_one: bool) -> tuple[Array, Array, Array]:
    """The axis frame, s and d of the cone v^T conic v = 0, told in `frame`."""
    values, vectors = np.linalg.eigh(conic * np.sign(np.trace(conic[..., :2, :2], axis1=-2, axis2=-1))[..., None, None])
    values = np.stack([np.minimum(values[..., 0], -1e-30), *np.moveaxis(np.maximum(values[..., 1:], 1e-30), -1, 0)], -1)
    axis = vectors[..., 0] * np.where(vectors[..., 2, :1] < 0, -1.0, 1.0)
    across = vectors[..., 1]  # of the smaller positive eigenvalue: the long axis
    rows = np.stack([across, np.cross(axis, across), axis], -2) @ frame
    q2, p2 = -values[..., 0] / values[..., 1], -values[..., 0] / values[..., 2]
    s, d = np.log(p2 * q2) / 4, np.log(q2 / p2) / 4
    if round_one:
        d = np.zeros_like(d)
    return rows, s, np.stack([d, np.zeros_like(d)], -1)


def frame_of(axis: Array) -> Array:
    """(..., 3, 3) a rotation whose third row is along (..., 3)."""
    axis = axis / np.sqrt(np.sum(axis * axis, -1, keepdims=True))
    helper = np.where(abs(axis[..., :1]) < 0.9, np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]))
    first = helper - np.sum(helper * axis, -1, keepdims=True) * axis
    first = first / np.sqrt(np.sum(first * first, -1, keepdims=True))
    return np.stack([first, np.cross(axis, first), axis], -2)


def refit(fit: ConeFit, rays: Array) -> tuple[Cone, Bools]:
    """The cone of moved directions: steps of the nominal gain from the nominal fit; and where that has an answer.

    First the nominal cone is turned to where the rim is now: a principal point moves it by more than its size. Size and
    flattening are logarithms, in which the response to the rest is nearly straight.
    """
    local = rays @ np.swapaxes(fit.cone.frame, -1, -2)
    lead = np.broadcast_shapes(local.shape[:-2], fit.size.shape)
    size = np.broadcast_to(fit.size, lead)
    state = _State(_onto(local.mean(axis=-2), fit.middle), np.broadcast_to(fit.cone.log_size, lead),
                   np.broadcast_to(fit.cone.flat, (*lead, 2)))  # fmt: skip
    step = np.zeros((*lead, 1))
    for _ in range(REFITS):
        step = -(fit.gain @ _off(state, local, size)[..., None])[..., 0]
        state = _moved(state, np.nan_to_num(step).clip(-1.0, 1.0), size)
    return Cone(state.turn @ fit.cone.frame, state.log_size, state.flat), np.asarray(
        np.isfinite(step).all(axis=-1) & fit.fits
    )


def _onto(one: Array, other: Array) -> Array:
    """(..., 3, 3) the least rotation that takes one direction to another, not opposite, one."""
    a, b = (v / np.sqrt(np.sum(v * v, -1, keepdims=True)) for v in (one, other))
    axis, cosine = np.cross(a, b), np.sum(a * b, -1)[..., None, None]
    cross = cross_matrix(axis)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.nan_to_num(np.eye(3) + cross + cross @ cross / (1 + cosine)))
