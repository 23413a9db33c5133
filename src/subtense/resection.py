"""Resection: where a camera stood, how it looked, and its own numbers as far as they were open, from surveyed points in its picture.

What is known of the camera before is an observation like the pixels: its covariance says how much the points may change it. So a
camera of which next to nothing is known is calibrated by its one picture, and a calibrated one stays as it is.

    minimise  sum |project(camera, pose, point) - pixel|^2 / sigma^2  +  (camera - known)^T cov^-1 (camera - known)

with sigma^2 of the pixel and of the survey, the latter at its range. Numbers that are moved from there take three steps with the
nominal Jacobian, so a hundred thousand draws cost as many projections.

Source: P. Wolf, B. Dewitt, Elements of Photogrammetry, 11.6 (space resection); bundle adjustment with observed camera numbers:
B. Triggs et al., Bundle adjustment, a modern synthesis, 2000.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .arrays import Array
from .camera import Camera
from .geometry import Pose, rotation_from_vector
from .observation import Observation

STEPS = 3
"""Steps of moved numbers from the nominal solution."""
MOST_STEPS = 100
FIRST_STEPS = 6
SETTLED = 1e-9
"""Relative fall of the squared sum below which the nominal solution has converged."""
STARTS = (1.0, 0.7, 1.4, 0.5, 2.0)
"""Focal lengths to start from, in the known one, where that is open."""
OPEN_FOCAL = 0.03
"""Relative u of the focal length from which other starts are tried."""
LEAST_SIGMA_PX = 1e-3


@dataclass(frozen=True, eq=False)
class Resection:
    """A nominal solution, and how moved observations move it.

    Attributes:
        camera: with the numbers that fit.
        pose: camera_from_survey, with the survey's origin moved to `origin_m`.
        origin_m: (3,) middle of the surveyed points.
        gain: (6 + free, residuals) step of (rotation vector, translation, free camera numbers) by whitened residuals.
        whiten: (2N, 2N).
        free: indices of the camera's numbers that are open.
        prior: (free, free) whitening of the known camera numbers.
        chi2: squared sum of the whitened residuals of the pixels.
        freedom: its expectation, were all sigmas right: the pixels less what they determine.
    """

    camera: Camera
    pose: Pose
    origin_m: Array
    gain: Array
    whiten: Array
    free: tuple[int, ...]
    prior: Array
    chi2: float
    freedom: float


def resect(camera: Camera, seen: Observation, points_m: Array, sigma_m: float = 0.0) -> Resection | None:
    """The nominal solution; None where no place of the camera fits.

    Args:
        camera: what is known of it, with its covariance.
        seen: N points of the picture.
        points_m: (N, 3) of the survey.
        sigma_m: standard deviation of each coordinate.
    """
    origin = points_m.mean(axis=0)
    free = () if camera.cov is None else tuple(int(i) for i in np.flatnonzero(np.diag(camera.cov) > 0))
    known = np.zeros((0, 0)) if camera.cov is None or not free else camera.cov[np.ix_(free, free)]
    prior = np.asarray(np.linalg.inv(_root(known)), float) if free else known
    problem = _Problem(camera, seen, points_m - origin, free, prior)
    best = _best_start(problem, camera, sigma_m)
    if best is None:
        return None
    for _ in range(2):  # the survey's own sigma counts by the range, which is known after the first round
        whiten = _whitening(camera, seen, best.pose, problem.points_m, sigma_m)
        best = problem.settled(best, whiten, MOST_STEPS)
    if not (math.isfinite(best.chi2) and np.all(best.pose.apply(problem.points_m)[:, 2] > 0)):
        return None
    residual, jacobian = problem.linear(best, whiten)
    gain = np.asarray(np.linalg.pinv(jacobian), float)
    pixels = 2 * len(points_m)
    freedom = pixels - float(np.einsum("ij,ji->", jacobian[:pixels], gain[:, :pixels]))
    chi2 = float(residual[:pixels] @ residual[:pixels])
    return Resection(problem.camera_at(best.vector), best.pose, origin, gain, whiten, free, prior, chi2, freedom)


def _best_start(problem: _Problem, camera: Camera, sigma_m: float) -> _State | None:
    """After a few steps from each closed form, for several focal lengths where that is open."""
    best: _State | None = None
    for factor in STARTS if camera.u_f_px > OPEN_FOCAL * float(camera.f_px) else STARTS[:1]:
        for pose in _closed_form(camera, problem.seen, problem.points_m, factor):
            whiten = _whitening(camera, problem.seen, pose, problem.points_m, sigma_m)
            state = problem.settled(_State(problem.vector(factor), pose), whiten, FIRST_STEPS)
            if math.isfinite(state.chi2) and (best is None or state.chi2 < best.chi2):
                best = state
    return best


def moved(begin: Resection, camera: Camera, points_px: Array, points_m: Array) -> tuple[Camera, Pose]:
    """Camera and pose of moved observations, by a few steps from the nominal solution.

    Args:
        begin: the nominal solution.
        camera: what is known, moved; numbers (...).
        points_px: (..., N, 2).
        points_m: (..., N, 3) of the survey, in its own frame.
    """
    known = _vector(camera)[list(begin.free)]
    points = points_m - begin.origin_m
    lead = np.broadcast_shapes(known.shape[1:], points_px.shape[:-2], points.shape[:-2])
    rotation = np.broadcast_to(begin.pose.rotation, (*lead, 3, 3))
    shift = np.broadcast_to(begin.pose.translation_m, (*lead, 3))
    start = _vector(begin.camera)[list(begin.free)]
    vector = np.broadcast_to(start.reshape(-1, *(1,) * len(lead)), (len(start), *lead))
    for _ in range(STEPS):
        now = _with_numbers(camera, begin.free, vector)
        pixels = (now.project(Pose(rotation, shift).apply(points)) - points_px).reshape(*lead, -1)
        whitened = (begin.whiten @ pixels[..., None])[..., 0]
        apart = (begin.prior @ np.moveaxis(vector - known, 0, -1)[..., None])[..., 0]
        step = -(begin.gain @ np.concatenate([whitened, apart], -1)[..., None])[..., 0]
        rotation = rotation_from_vector(step[..., :3]) @ rotation
        shift = shift + step[..., 3:6]
        vector = vector + np.moveaxis(step[..., 6:], -1, 0)
    return _with_numbers(camera, begin.free, vector), Pose(rotation, shift)


def _vector(camera: Camera) -> Array:
    """(4 + k, ...) the camera's numbers, in the order of its covariance."""
    k = np.moveaxis(camera.coefficients, -1, 0)
    own = (camera.f_px, camera.aspect, camera.cx_px, camera.cy_px)
    return np.stack(np.broadcast_arrays(*(np.asarray(number, float) for number in own), *k))


def _with_numbers(camera: Camera, free: tuple[int, ...], vector: Array) -> Camera:
    return camera.moved({",".join(map(str, free)): vector}) if free else camera


def _root(cov: Array) -> Array:
    """Lower root of a covariance; numbers that are tied to each other wholly are loosened by a millionth."""
    scale = np.sqrt(np.diag(cov))
    unit = cov / np.outer(scale, scale)
    return np.asarray(scale[:, None] * np.linalg.cholesky(unit + 1e-6 * np.eye(len(cov))))


def _whitening(camera: Camera, seen: Observation, pose: Pose, points_m: Array, sigma_m: float) -> Array:
    """(2N, 2N) inverse root of the covariance of pixels and survey, the latter at its range."""
    floor = LEAST_SIGMA_PX**2
    cov = np.array(seen.cov) if seen.cov is not None else np.diag(seen.standard_deviations**2)
    far = np.linalg.norm(pose.apply(points_m), axis=-1)
    survey = np.repeat((float(camera.f_px) * sigma_m / np.maximum(far, 1e-9)) ** 2, 2)
    return np.asarray(np.linalg.inv(np.linalg.cholesky(cov + np.diag(survey + floor))))


def _closed_form(camera: Camera, seen: Observation, points_m: Array, factor: float) -> list[Pose]:
    import cv2

    slopes = camera.normalised(seen.points_px) / factor
    if not np.all(np.isfinite(slopes)):
        return []
    poses = []
    for flags in (cv2.SOLVEPNP_SQPNP, cv2.SOLVEPNP_EPNP):
        try:
            _, vectors, shifts, _ = cv2.solvePnPGeneric(points_m, slopes, np.eye(3), None, flags=flags)
        except cv2.error:
            continue
        for turn, shift in zip(vectors, shifts, strict=True):
            pose = Pose(rotation_from_vector(np.reshape(turn, 3)), np.reshape(shift, 3))
            if np.all(np.isfinite(pose.rotation)) and np.all(np.isfinite(pose.translation_m)):
                poses.append(pose)
        if poses:
            break
    return poses


@dataclass(frozen=True, eq=False)
class _State:
    """Free camera numbers, the pose, and the squared sum there."""

    vector: Array
    pose: Pose
    chi2: float = math.inf


@dataclass(frozen=True, eq=False)
class _Problem:
    """What is seen and known, and the residuals of a state."""

    known: Camera
    seen: Observation
    points_m: Array
    free: tuple[int, ...]
    prior: Array

    def vector(self, factor: float) -> Array:
        """The free numbers to start from; the focal length times a factor, if it is one of them."""
        start = np.array(_vector(self.known)[list(self.free)])
        if self.free and self.free[0] == 0:
            start[0] *= factor
        return start

    def camera_at(self, vector: Array) -> Camera:
        return _with_numbers(self.known, self.free, vector)

    def residual(self, state: _State, whiten: Array) -> Array:
        seen = self.camera_at(state.vector).project(state.pose.apply(self.points_m))
        pixels = whiten @ (seen - self.seen.points_px).reshape(-1)
        known = _vector(self.known)[list(self.free)]
        return np.concatenate([pixels, self.prior @ (state.vector - known)])

    def stepped(self, state: _State, step: Array) -> _State:
        rotation = rotation_from_vector(step[:3]) @ state.pose.rotation
        return _State(state.vector + step[6:], Pose(rotation, state.pose.translation_m + step[3:6]))

    def linear(self, state: _State, whiten: Array) -> tuple[Array, Array]:
        """Residual and its Jacobian by central differences, all of them projected at once."""
        scale = np.concatenate([np.full(3, 1e-6), np.full(3, 1e-5), 1e-4 / np.maximum(np.diag(self.prior), 1e-12)])
        steps = np.concatenate([np.diag(scale), -np.diag(scale), np.zeros((1, len(scale)))])
        pose = Pose(rotation_from_vector(steps[:, :3]) @ state.pose.rotation, state.pose.translation_m + steps[:, 3:6])
        vectors = state.vector[:, None] + steps[:, 6:].T
        pixels = (self.camera_at(vectors).project(pose.apply(self.points_m)) - self.seen.points_px).reshape(
            len(steps), -1
        )
        known = _vector(self.known)[list(self.free)]
        whole = np.concatenate([pixels @ whiten.T, (vectors - known[:, None]).T @ self.prior.T], -1)
        count = len(scale)
        return whole[-1], np.asarray(((whole[:count] - whole[count:-1]) / (2 * scale[:, None])).T)

    def settled(self, state: _State, whiten: Array, most: int) -> _State:
        """Levenberg and Marquardt's steps to the least squares."""
        damp = 1e-3
        residual = self.residual(state, whiten)
        state = _State(state.vector, state.pose, float(residual @ residual))
        for _ in range(most):
            residual, jacobian = self.linear(state, whiten)
            if not (math.isfinite(state.chi2) and np.all(np.isfinite(jacobian))):
                return state
            normal, gradient = jacobian.T @ jacobian, jacobian.T @ residual
            better, damp = self._descended(state, whiten, normal, gradient, damp)
            if better is None:
                return state
            gained = state.chi2 - better.chi2
            state = better
            if gained <= SETTLED * (state.chi2 + 1e-12):
                return state
        return state

    def _descended(
        self, state: _State, whiten: Array, normal: Array, gradient: Array, damp: float
    ) -> tuple[_State | None, float]:
        """A state of a smaller sum, and the damping to go on with; None where no step helps."""
        for _ in range(20):
            try:
                step = np.asarray(-np.linalg.solve(normal + damp * np.diag(np.diag(normal) + 1e-12), gradient), float)
            except np.linalg.LinAlgError:
                damp *= 10
                continue
            tried = self.stepped(state, step)
            with np.errstate(all="ignore"):
                residual = self.residual(tried, whiten)
            chi2 = float(residual @ residual)
            if chi2 <= state.chi2:
                return _State(tried.vector, tried.pose, chi2), max(damp / 10, 1e-12)
            damp *= 10
        return None, damp
