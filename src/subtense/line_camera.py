"""Focal length, pitch and roll from lines along two or three directions at right angles, as buildings have them.

Unknown are the focal length, the rotation, and, within what is assumed of them, principal point and radial distortion. Each line ought
to run to the vanishing point of its direction; how far its ends lie off is minimised by Gauss-Newton. Where the lines scatter more
than is stated of them, their doubt is widened by as much. The covariance is that at the solution, with what was assumed as prior.

Source: B. Caprile, V. Torre, Using vanishing points for camera calibration, IJCV 4, 1990; R. Hartley, A. Zisserman, 8.8.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .arrays import Array
from .assumptions import UNKNOWN_CENTRE, UNKNOWN_K1
from .camera import Camera
from .geometry import rotation_from_vector
from .horizon import level_from_up
from .hypothesis import ASSUMED_DISTORTION, unknown_lens
from .observation import Observation
from .vanishing import misses, vanishing_point, weights_of

WORST_U = 0.15
"""Relative u of the focal length beyond which lines are said not to tell it."""
SHORTEST, LONGEST = 0.25, 12.0
"""Focal lengths that are tried, in longer sides of the picture."""
TRIED = 32
UNSET = 7
"""log f, rotation, principal point, k1."""


@dataclass(frozen=True, eq=False)
class LineCamera:
    """What lines tell of a camera.

    Attributes:
        camera: with the covariance of focal length, principal point and k1 together.
        rotation: (3, 3) camera from the lines' own frame; columns: first level direction, second one, upright (either way each).
        pitch_rad: of the optical axis above the horizon.
        roll_rad: right side down.
        level_cov: (2, 2) covariance of pitch and roll, rad^2.
        scatter: root mean square of the lines' misses in what is stated of them; 0 where no line is spare.
        misses_px: of the lines, in the order given.
    """

    camera: Camera
    rotation: Array
    pitch_rad: float
    roll_rad: float
    level_cov: Array
    scatter: float
    misses_px: Array


@dataclass(frozen=True, eq=False)
class _Scene:
    """Lines by axis, and what is assumed."""

    width_px: int
    height_px: int
    points_px: Array
    sigma_px: Array
    axes: Array
    k1_u: float

    def camera(self, theta: Array) -> Camera:
        """Of numbers (..., UNSET)."""
        longer = max(self.width_px, self.height_px)
        k = np.zeros((*theta.shape[:-1], 5))
        k[..., 0] = theta[..., 6]
        f, cx, cy = np.exp(theta[..., 0]), theta[..., 4] * longer, theta[..., 5] * longer
        base = Camera(self.width_px, self.height_px, 1.0, 0.0, 0.0, lens="brown_conrady")
        middle = (self.width_px - 1) / 2, (self.height_px - 1) / 2
        if not np.any(theta[..., 6]):  # many times as fast
            base = Camera(self.width_px, self.height_px, 1.0, 0.0, 0.0)
            return base._with(f_px=f, cx_px=middle[0] + cx, cy_px=middle[1] + cy)
        return base._with(f_px=f, cx_px=middle[0] + cx, cy_px=middle[1] + cy, distortion=k)

    def off_px(self, theta: Array, rotation: Array) -> Array:
        """(..., K) misses of the lines, for numbers (..., UNSET) whose rotation vector turns `rotation` on the left."""
        seen = np.stack(
            self.camera(theta).slopes(np.broadcast_to(self.points_px, (*theta.shape[:-1], *self.points_px.shape))), -1
        )
        turned = rotation_from_vector(theta[..., 1:4]) @ rotation
        found = np.empty((*theta.shape[:-1], len(self.axes)))
        for axis in range(3):
            own = np.flatnonzero(self.axes == axis)
            ends = np.stack([2 * own, 2 * own + 1], -1).reshape(-1)
            found[..., own] = misses(seen[..., ends, :], turned[..., :, axis])
        return found * np.exp(theta[..., :1])

    def residual(self, theta: Array, rotation: Array, scatter: float) -> Array:
        """(..., K + 3) in standard deviations: lines, principal point, k1."""
        lines = self.off_px(theta, rotation) / (self.sigma_px * scatter)
        prior = theta[..., 4:] / np.array([UNKNOWN_CENTRE, UNKNOWN_CENTRE, self.k1_u])
        return np.concatenate([lines, prior], -1)


def camera_from_lines(
    width_px: int, height_px: int, verticals: Observation | None, parallels: Observation | None, others: Observation | None, *,
    k1_u: float = UNKNOWN_K1, source: str = "vanishing points of lines",
) -> LineCamera | str:  # fmt: skip
    """The camera of a picture by lines that were marked in it.

    Args:
        width_px: of the picture.
        height_px: of it.
        verticals: two points of each upright line; None where none were marked.
        parallels: the same of level lines of one direction.
        others: the same of level lines at right angles to it.
        k1_u: u of the radial distortion, as the lens's class has it.
        source: what to call it.

    Returns:
        The camera, or why the lines do not tell it.
    """
    sets = [(axis, lines) for axis, lines in enumerate((parallels, others, verticals)) if lines is not None]
    if len(sets) < 2:
        return "lines of one direction only; two at right angles are needed"
    scene = _scene(width_px, height_px, sets, k1_u)
    found = [one for one in (_solved(scene, *begin, 1.0) for begin in _starts(scene)) if one is not None]
    if not found:
        return "no focal length fits lines at right angles"
    theta, rotation, cost = min(found, key=lambda one: one[2])
    spare = len(scene.axes) - 4
    scatter = math.sqrt(cost / spare) if spare > 0 else 0.0
    again = _solved(scene, theta, rotation, max(scatter, 1.0))
    if again is None:
        return "no focal length fits lines at right angles"
    return _camera(scene, again[0], again[1], scatter, source)


def _scene(width_px: int, height_px: int, sets: Sequence[tuple[int, Observation]], k1_u: float) -> _Scene:
    points = np.concatenate([lines.points_px for _, lines in sets])
    sigma = np.concatenate([lines.standard_deviations.reshape(-1, 2) for _, lines in sets])
    each = np.sqrt(np.mean(sigma**2, axis=1))
    # two ends that miss the line from their middle one to either side
    of_line = np.maximum(np.hypot(each[0::2], each[1::2]) / 2, 1e-3)
    axes = np.concatenate([np.full(lines.points_px.shape[-2] // 2, axis) for axis, lines in sets])
    return _Scene(width_px, height_px, points, of_line, axes, k1_u)


def _starts(scene: _Scene) -> list[tuple[Array, Array]]:
    """Focal lengths that fit better than their neighbours, with the rotation nearest to the vanishing points."""
    longer = max(scene.width_px, scene.height_px)
    tried = []
    for f in longer * np.geomspace(SHORTEST, LONGEST, TRIED):
        theta = np.zeros(UNSET)
        theta[0] = math.log(f)
        rotation = _rotation(scene, theta)
        if rotation is not None:
            tried.append((float(np.sum(scene.residual(theta, rotation, 1.0) ** 2)), theta, rotation))
    best = [one for i, one in enumerate(tried)
            if all(one[0] <= tried[j][0] for j in (i - 1, i + 1) if 0 <= j < len(tried))]  # fmt: skip
    return [(theta, rotation) for _, theta, rotation in sorted(best, key=lambda one: one[0])[:2]]


def _rotation(scene: _Scene, theta: Array) -> Array | None:
    """(3, 3) nearest to the directions that the lines of each axis tell alone."""
    camera = scene.camera(theta)
    columns = np.zeros((3, 3))
    known = sorted(set(scene.axes.tolist()))
    for axis in known:
        own = np.flatnonzero(scene.axes == axis)
        ends = np.stack([2 * own, 2 * own + 1], -1).reshape(-1)
        seen = camera.normalised(scene.points_px[ends])
        v, lost = vanishing_point(seen, weights_of(seen, np.repeat(scene.sigma_px[own], 2)))
        if np.any(lost):
            return None
        columns[:, axis] = v
    if len(known) == 2:
        missing = 3 - sum(known)
        columns[:, missing] = np.cross(columns[:, (missing + 1) % 3], columns[:, (missing + 2) % 3])
    elif np.linalg.det(columns) < 0:
        columns[:, 2] *= -1
    u, _, v = np.linalg.svd(columns)
    return np.asarray(u @ np.diag([1.0, 1.0, np.linalg.det(u @ v)]) @ v)


def _solved(scene: _Scene, theta: Array, rotation: Array, scatter: float) -> tuple[Array, Array, float] | None:
    """Numbers, rotation, and the lines' chi^2, by damped Gauss-Newton."""
    theta, damp = theta.copy(), 1e-3
    residual = scene.residual(theta, rotation, scatter)
    cost = float(residual @ residual)
    for _ in range(60):
        jacobian = _jacobian(scene, theta, rotation, scatter)
        if not np.all(np.isfinite(jacobian)):
            return None
        normal = jacobian.T @ jacobian
        step = np.linalg.lstsq(normal + damp * np.diag(np.diag(normal) + 1e-12), -jacobian.T @ residual, rcond=None)[0]
        new, turned = theta + step, rotation_from_vector(np.asarray(step[1:4], float)) @ rotation
        new[1:4] = 0.0
        trial = scene.residual(new, turned, scatter)
        if np.all(np.isfinite(trial)) and trial @ trial < cost:
            theta, rotation, residual, damp = new, turned, trial, max(damp / 10, 1e-12)
            fell, cost = cost - float(trial @ trial), float(trial @ trial)
            if fell < 1e-10 * cost + 1e-14:
                break
        else:
            damp *= 10
            if damp > 1e8:
                break
    longer = max(scene.width_px, scene.height_px)
    if not math.log(SHORTEST * longer) < theta[0] < math.log(LONGEST * longer):
        return None
    lines = residual[:-3]
    return theta, rotation, float(lines @ lines)


def _jacobian(scene: _Scene, theta: Array, rotation: Array, scatter: float) -> Array:
    """(K + 3, UNSET) by central differences."""
    step = 1e-6 * np.eye(UNSET)
    both = scene.residual(np.concatenate([theta + step, theta - step]), rotation, scatter)
    return np.asarray((both[:UNSET] - both[UNSET:]).T / 2e-6)


def _camera(scene: _Scene, theta: Array, rotation: Array, scatter: float, source: str) -> LineCamera | str:
    jacobian = _jacobian(scene, theta, rotation, max(scatter, 1.0))
    normal = jacobian.T @ jacobian
    size = np.sqrt(np.diag(normal))
    if not np.all(size > 0) or not np.all(np.isfinite(size)):
        return "the lines do not tell the focal length"
    cov = np.linalg.pinv(normal / np.outer(size, size), rcond=1e-13, hermitian=True) / np.outer(size, size)
    u = math.sqrt(cov[0, 0])
    if not u <= WORST_U:
        return (f"the lines tell the focal length to {100 * u:.0f} % (1s) only; mark longer ones that run together in the picture, in two "
                "directions")  # fmt: skip
    f, longer = math.exp(theta[0]), max(scene.width_px, scene.height_px)
    scale = np.array([f, longer, longer, 1.0])
    picked = np.ix_([0, 4, 5, 6], [0, 4, 5, 6])
    made = unknown_lens(scene.width_px, scene.height_px, f, u * f, source, k1_u=scene.k1_u)
    whole = np.zeros((9, 9))
    whole[np.ix_([0, 2, 3, 4], [0, 2, 3, 4])] = cov[picked] * np.outer(scale, scale)
    camera = Camera(
        scene.width_px, scene.height_px, f, float(made.cx_px) + theta[4] * longer, float(made.cy_px) + theta[5] * longer,
        lens="brown_conrady", distortion=np.array([theta[6], 0, 0, 0, 0]), cov=whole, source=source,
        part_sources={"lens distortion": f"{ASSUMED_DISTORTION}, k1 to {scene.k1_u:.2g} before the lines"},
    )  # fmt: skip
    pitch, roll = _angles(rotation)
    step = 1e-6 * np.eye(3)
    ends = [[np.array(_angles(rotation_from_vector(sign * row) @ rotation)) for row in step] for sign in (1, -1)]
    slope = np.array([(a - b) / 2e-6 for a, b in zip(*ends, strict=True)]).T
    return LineCamera(
        camera, rotation, pitch, roll, slope @ cov[1:4, 1:4] @ slope.T, scatter, scene.off_px(theta, rotation)
    )


def _angles(rotation: Array) -> tuple[float, float]:
    level = level_from_up(rotation[:, 2])
    return float(level.pitch_rad), float(level.roll_rad)
