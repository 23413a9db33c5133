"""Homography: how a plane is seen, fitted to points of the plane with the covariance of all of them.

A picture point is (h1 . X, h2 . X) / (h3 . X) of the plane point X = (x, y, 1). Plane and picture coordinates are centred and
scaled first, so h3 = (., ., 1): the middle of the points is never on the horizon. The least squares solution is refined by
Gauss-Newton on the picture coordinates, which are slopes of viewing directions where a camera is known, and pixels else.

Source: R. Hartley, A. Zisserman, Multiple View Geometry, 4.1, 4.2, 5.2; W. Baarda, A testing procedure for use in
geodetic networks, 1968 (what each point says against the others).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from .arrays import Array, Bools
from .geometry import Pose, cross_matrix, rotation_from_vector
from .noun import Noun, Part

STEPS = 8
"""Most steps of a moved scene from the nominal solution."""
SETTLED = 1e-9
MISFIT_Z = 3.72
"""Normal quantile (1 in 1e4) beyond which residuals are no chance."""
ONE_OFF = 3e-3
"""Probability that any point of a right set is called off: a single wrong click shows by itself sooner than in the sum."""
DEGENERATE = 1e-9
"""Singular value, in units of the largest, below which the points do not determine a plane's picture."""
FLOOR_PX = 1e-3
"""Standard deviation below which a point's place is taken as that, so that exact points can be weighted."""


@dataclass(frozen=True, eq=False)
class Frame:
    """Centring and scaling of coordinates: (p - middle) / scale.

    Attributes:
        middle: (2,).
        scale: above 0.
    """

    middle: Array
    scale: float

    @classmethod
    def of(cls, points: Array) -> Frame:
        """With the middle of points (N, 2) at 0, and 1 their rms distance from it."""
        middle = points.mean(axis=0)
        scale = float(np.sqrt(np.mean(np.sum((points - middle) ** 2, axis=-1))))
        return cls(middle, scale if scale > 0 else 1.0)

    def enter(self, points: Array) -> Array:
        """(..., N, 2) points in this frame."""
        return np.asarray((points - self.middle) / self.scale)

    @property
    def matrix(self) -> Array:
        """(3, 3) into this frame, homogeneous."""
        s = 1 / self.scale
        return np.array([[s, 0, -s * self.middle[0]], [0, s, -s * self.middle[1]], [0, 0, 1.0]])


@dataclass(frozen=True, eq=False)
class Fit:
    """The nominal fit, from which moved scenes are refined.

    Attributes:
        plane: frame of plane coordinates.
        seen: frame of picture coordinates.
        h: (3, 3) picture from plane, in these frames, h[2, 2] = 1; NaN where the points determine none.
        gain: (8, 2N) change of h by the picture coordinates, see `gain_of`.
        chi2: sum of their squares.
        freedom: spare observations, 2N - 8.
        snooped: (N,) by how many standard deviations each point lies off what the others say (0 without spare ones).
    """

    plane: Frame
    seen: Frame
    h: Array
    gain: Array
    chi2: float
    freedom: int
    snooped: Array

    @property
    def misfit(self) -> bool:
        """Whether the residuals are beyond chance, all together or those of one point alone."""
        if self.freedom <= 0:
            return False
        alone = math.sqrt(-2 * math.log(ONE_OFF / len(self.snooped)))
        return self.chi2 > chi2_limit(self.freedom) or float(self.snooped.max()) > alone


def chi2_limit(freedom: int) -> float:
    """What chi^2 exceeds once in ten thousand times (Wilson and Hilferty's quantile)."""
    spread = 2 / (9 * freedom)
    return freedom * (1 - spread + MISFIT_Z * math.sqrt(spread)) ** 3


def transfer(h: Array, points: Array) -> tuple[Array, Array]:
    """(..., N, 2) points through a homography (..., 3, 3), and (..., N) the third homogeneous coordinate."""
    turned = points @ np.swapaxes(h[..., :2], -1, -2) + h[..., None, :, 2]
    third = turned[..., 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        return turned[..., :2] / third[..., None], third


def closed_form(plane: Array, seen: Array) -> Array | None:
    """(3, 3) by the direct linear transform of points (N, 2) in their frames; None where they determine none."""
    one, zero = np.ones(len(plane)), np.zeros((len(plane), 3))
    x = np.column_stack([plane, one])
    rows = np.concatenate([np.hstack([x, zero, -seen[:, :1] * x]), np.hstack([zero, x, -seen[:, 1:] * x])])
    _, values, vectors = np.linalg.svd(rows)
    h = vectors[-1].reshape(3, 3)
    if values[7] < DEGENERATE * values[0] or abs(h[2, 2]) < DEGENERATE * np.abs(h).max():
        return None
    h = np.asarray(h / h[2, 2])
    return h if abs(np.linalg.det(h)) > DEGENERATE else None


def refined(h: Array, plane: Array, seen: Array, gain: Array, steps: int = STEPS) -> Array:
    """(..., 3, 3) of moved scenes, from the nominal h (3, 3), by the slopes at the nominal solution.

    Args:
        h: nominal solution.
        plane: (..., N, 2).
        seen: (..., N, 2).
        gain: (8, 2N) of the nominal solution, see `gain_of`.
        steps: at most.
    """
    lead = np.broadcast_shapes(plane.shape[:-2], seen.shape[:-2])
    found = np.broadcast_to(h, (*lead, 3, 3))
    for _ in range(steps):
        residual = np.nan_to_num((transfer(found, plane)[0] - seen).reshape(*lead, -1), posinf=0.0, neginf=0.0)
        step = residual @ gain.T
        found = found - np.concatenate([step, np.zeros((*lead, 1))], -1).reshape(*lead, 3, 3)
        if np.max(abs(step), initial=0.0) < SETTLED:
            break
    return np.asarray(found)


def gain_of(h: Array, plane: Array, whiten: Array) -> Array:
    """(8, 2N) change of h11, h12, ..., h32 by the picture coordinates, weighted."""
    where, w = transfer(h, plane)
    jacobian = _slopes(plane, where, w)
    return np.asarray(np.linalg.pinv(whiten @ jacobian) @ whiten)


def _solution(h: Array, plane: Array, seen: Array, whiten: Array) -> Array:
    """(3, 3) Gauss-Newton of the nominal scene."""
    for _ in range(30):
        gain = gain_of(h, plane, whiten) if np.all(np.isfinite(h)) else np.zeros((8, seen.size))
        step = gain @ (transfer(h, plane)[0] - seen).reshape(-1)
        h = h - np.append(step, 0.0).reshape(3, 3)
        if np.max(abs(step)) < 1e-14:
            break
    return h


def _solved(jacobian: Array, residual: Array) -> Array:
    """(..., p) least squares solutions; square systems are solved as they are, which keeps their condition."""
    jacobian, residual = (
        np.nan_to_num(jacobian, posinf=0.0, neginf=0.0),
        np.nan_to_num(residual, posinf=0.0, neginf=0.0),
    )
    if jacobian.shape[-1] != jacobian.shape[-2]:
        turned = np.swapaxes(jacobian, -1, -2)
        jacobian, residual = turned @ jacobian, turned @ residual
    damp = 1e-15 * np.sqrt(np.sum(jacobian**2, axis=(-1, -2)))[..., None, None] + 1e-300
    return np.asarray(np.linalg.solve(jacobian + damp * np.eye(jacobian.shape[-1]), residual)[..., 0])


def _slopes(plane: Array, where: Array, w: Array) -> Array:
    """(..., 2N, 8) of the picture coordinates by h11, h12, ..., h32."""
    with np.errstate(divide="ignore", invalid="ignore"):
        x = np.concatenate([plane, np.ones((*plane.shape[:-1], 1))], -1) / w[..., None]
    zero = np.zeros_like(x)
    first = np.concatenate([x, zero, -where[..., :1] * x[..., :2]], -1)
    second = np.concatenate([zero, x, -where[..., 1:] * x[..., :2]], -1)
    both = np.stack([first, second], -2)
    return np.asarray(both.reshape(*both.shape[:-3], -1, 8))


def fit(plane_m: Array, seen: Array, cov: Array) -> Fit:
    """Fit the nominal scene.

    Args:
        plane_m: (N, 2) points of the plane.
        seen: (N, 2) where they are in the picture.
        cov: (2N, 2N) covariance of `seen`, in its unit squared.
    """
    plane, picture = Frame.of(plane_m), Frame.of(seen)
    x, y = plane.enter(plane_m), picture.enter(seen)
    n = seen.size
    nothing = Fit(plane, picture, np.full((3, 3), np.nan), np.zeros((8, n)), 0.0, 0, np.zeros(n // 2))
    if not (np.all(np.isfinite(y)) and np.all(np.isfinite(cov))):
        return nothing
    h = closed_form(x, y)
    if h is None:
        return nothing
    scaled = cov / picture.scale**2
    whiten = np.linalg.inv(np.linalg.cholesky(scaled + 1e-14 * np.trace(scaled) / n * np.eye(n)))
    h = _solution(h, x, y, whiten)
    where, w = transfer(h, x)
    if not np.all(np.isfinite(where)):
        return nothing
    residual = (where - y).reshape(-1)
    white = whiten @ residual
    snooped = _snooped(whiten, _slopes(x, where, w), residual)
    return Fit(plane, picture, h, gain_of(h, x, whiten), float(white @ white), n - 8, snooped)


def _snooped(whiten: Array, jacobian: Array, residual: Array) -> Array:
    """(N,) root of each point's own chi^2 (2 degrees of freedom) against what the others say."""
    n = len(residual)
    if n <= 8:
        return np.zeros(n // 2)
    weight = whiten.T @ whiten
    weighted = weight @ jacobian
    inner = weight - weighted @ np.linalg.pinv(jacobian.T @ weighted) @ weighted.T
    pulled = weight @ residual
    found = []
    for i in range(0, n, 2):
        block = inner[i : i + 2, i : i + 2]
        own = pulled[i : i + 2]
        found.append(math.sqrt(max(float(own @ np.linalg.pinv(block, rcond=1e-9) @ own), 0.0)))
    return np.array(found)


def covariance_by(nouns: Iterable[Noun | None], seen: Callable[..., Array], size: int) -> Array:
    """(size, size) covariance that the uncertain parts of nouns give to a function of them, to first order.

    Args:
        nouns: what may move; None and exact ones are left out.
        seen: takes all nouns in order, one of them with a leading axis, and gives `size` numbers for each row of it.
        size: how many.
    """
    those = list(nouns)
    cov = np.zeros((size, size))
    for place, noun in enumerate(those):
        for part in noun.parts() if noun is not None else ():
            assert noun is not None
            value, columns = np.asarray(part.value, float).reshape(-1, 1), _factor(part)
            up, down = (
                seen(*those[:place], noun.moved({part.key: value + sign * columns}), *those[place + 1 :])
                for sign in (1.0, -1.0)
            )
            half = np.broadcast_to((up - down).reshape(-1, size) / 2, (columns.shape[1], size))
            cov += half.T @ half
    return cov


def _factor(part: Part) -> Array:
    """(k, m) matrix whose columns move the numbers of a part by one standard deviation each."""
    if part.cov is None:
        return np.diag(np.asarray(part.u, float).reshape(-1))
    values, vectors = np.linalg.eigh(part.cov)
    return np.asarray(vectors * np.sqrt(values.clip(0.0)))


def front(h: Array, plane: Array) -> Bools:
    """(...) whether all points (..., N, 2) of the plane lie on the side of its horizon that is seen."""
    return np.asarray(np.all(transfer(h, plane)[1] > 0, axis=-1))


# -- the plane's place, where the picture coordinates are slopes -------------------------------------------------------


def pose_of(h: Array, one: Fit) -> Pose:
    """camera_from_plane of a homography (3, 3) onto slopes, in the frames of a fit: the nearest rotation."""
    whole = np.linalg.inv(one.seen.matrix) @ h @ one.plane.matrix
    middle = np.append(one.plane.middle, 1.0)
    whole = whole * np.sign(whole[2] @ middle)
    first, second, _ = whole.T
    scale = math.sqrt(np.linalg.norm(first) * np.linalg.norm(second))
    u, _, v = np.linalg.svd(np.stack([first, second, np.cross(first, second) / scale], -1) / scale)
    rotation = u @ np.diag([1, 1, np.linalg.det(u @ v)]) @ v
    # the middle of the points stays where it is seen
    return Pose(rotation, whole @ middle / scale - rotation @ np.append(one.plane.middle, 0.0))


def mirrored(pose: Pose, middle_m: Array) -> Pose:
    """The pose with the plane mirrored about the line of sight to a point of it (3,): near a second solution."""
    place = pose.rotation @ middle_m + pose.translation_m
    sight, face = place / np.linalg.norm(place), pose.rotation[:, 2]
    face = face * np.sign(face @ sight or 1.0)
    across = np.cross(face, sight)
    size = float(np.linalg.norm(across))
    angle = 2 * math.atan2(size, float(face @ sight))
    rotation = rotation_from_vector(across / size * angle if size > 1e-12 else np.zeros(3)) @ pose.rotation
    return Pose(rotation, place - rotation @ middle_m)


def settled_pose(pose: Pose, points_m: Array, seen: Array, whiten: Array) -> Pose:
    """The pose of the nominal scene by damped Gauss-Newton, which does not step behind the camera; see `refined_pose`."""
    damp = 1e-6
    jacobian, residual = _linearised(pose, points_m, seen)
    best = float(np.sum((whiten @ residual) ** 2))
    for _ in range(60):
        weighted = whiten @ jacobian
        normal = weighted.T @ weighted
        step = -_solved(normal + damp * np.diag(np.diag(normal)), weighted.T @ (whiten @ residual))
        trial = Pose(rotation_from_vector(step[:3]) @ pose.rotation, pose.translation_m + step[3:])
        slopes, off = _linearised(trial, points_m, seen)
        cost = float(np.sum((whiten @ off) ** 2))
        if np.all(trial.apply(points_m)[..., 2] > 0) and cost <= best:
            pose, jacobian, residual, damp, best = trial, slopes, off, max(damp / 10, 1e-12), cost
            if np.max(abs(step)) < SETTLED * 1e-3:
                break
        else:
            damp *= 10
            if damp > 1e8:
                break
    return pose


def _linearised(pose: Pose, points_m: Array, seen: Array) -> tuple[Array, Array]:
    """(..., 2N, 6) slopes by rotation vector and translation, and (..., 2N, 1) residuals."""
    turned = points_m @ np.swapaxes(pose.rotation, -1, -2)
    placed = turned + pose.translation_m[..., None, :]
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        inverse = 1 / placed[..., 2]
        where = placed[..., :2] * inverse[..., None]
    zero = np.zeros_like(inverse)
    by_point = np.stack([np.stack([inverse, zero, -where[..., 0] * inverse], -1),
                         np.stack([zero, inverse, -where[..., 1] * inverse], -1)], -2)  # fmt: skip
    jacobian = np.concatenate([by_point @ -cross_matrix(turned), by_point], -1)
    residual = (where - seen).reshape(*where.shape[:-2], -1, 1)
    return np.asarray(jacobian.reshape(*jacobian.shape[:-3], -1, 6)), residual


def refined_pose(pose: Pose, points_m: Array, seen: Array, whiten: Array, steps: int) -> Pose:
    """Gauss-Newton of a pose, perturbed on the left, on slopes (..., N, 2) of points (..., N, 3).

    Args:
        pose: to start from; without leading axes.
        points_m: the points.
        seen: their slopes.
        whiten: (2N, 2N) for residuals of slopes.
        steps: how many.
    """
    lead = np.broadcast_shapes(points_m.shape[:-2], seen.shape[:-2])
    now = Pose(np.broadcast_to(pose.rotation, (*lead, 3, 3)), np.broadcast_to(pose.translation_m, (*lead, 3)))
    for _ in range(steps):
        jacobian, residual = _linearised(now, points_m, seen)
        step = -_solved(whiten @ jacobian, whiten @ residual)
        now = Pose(rotation_from_vector(step[..., :3]) @ now.rotation, now.translation_m + step[..., 3:])
        if np.max(abs(step), initial=0.0) < SETTLED:
            break
    return now
