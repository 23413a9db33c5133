"""Pose of a target with four or more known points, and so its range, depth and tilt.

A start is found by OpenCV (IPPE for flat targets, SQPNP else), and refined by Gauss-Newton on the normalised image plane
with the observation's covariance. A flat target has two solutions; where the pixels can't tell them apart, the second
enters with its weight exp(-chi^2 / 2) as a line of the budget. That chi^2, which also says whether the points fit the target
at all, weighs the residuals by all that is stated of points, camera and target, for a focal length that is a little wrong bends
them much more than accurate corners may err. A nominal focal length makes the target too near by about
f (thin lens), which `focus` says how much of to add.

Source: T. Collins, A. Bartoli, Infinitesimal plane-based pose estimation, IJCV 2014; G. Terzakis, M. Lourakis, SQPnP, 2020.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np

from ..arrays import Array, Codes
from ..camera import Camera
from ..distribution import Distribution
from ..errors import InputError
from ..focus import close_focus, thin_lens
from ..geometry import Pose, cross_matrix, rotation_from_vector
from ..lenses import LENSES
from ..method import Method, Output, Reason, reasons
from ..noun import Part
from ..observation import Observation
from ..quantity import Note, Quantity
from ..target import Target

STEPS = 2
"""Gauss-Newton steps of a moved scene from the nominal solution."""
SETTLED = 1e-13
"""A step of the nominal solution (rad, m) below which it has converged."""
TELLING_RAD = math.radians(3.0)
"""Two solutions whose faces differ by less are not called ambiguous."""
MISFIT_Z = 4.75
"""Normal quantile (1 in 1e6) beyond which residuals are no chance."""
STEP = 0.1
"""Of a standard deviation, by which stated numbers are moved to see how residuals follow."""
LEAST_WEIGHT = 0.01
"""A second solution of less weight is left out."""


def unambiguous() -> Quantity:
    """Only the better solution."""
    return Quantity.exact(0.0, "1", "the better of two solutions")


@dataclass(frozen=True)
class Inputs:
    """A camera, a target of four or more known points, and where they are in the picture.

    Attributes:
        camera: of the upright picture.
        points: point i is point i of the target.
        target: at least four points, not on one line.
        focus: share of the thin-lens extension that is added where the focal length is nominal; 1.
        ambiguity: share of the second solution: 0, or either 0 or 1 by its weight (found by itself).
    """

    camera: Camera
    points: Observation = field(metadata={"points": 4, "closed": True})
    target: Target
    focus: Quantity = field(default_factory=thin_lens, metadata={"unit": "1"})
    ambiguity: Quantity = field(default_factory=unambiguous, metadata={"unit": "1"})

    def __post_init__(self) -> None:
        seen, known = self.points.points_px.shape[-2], self.target.points_m.shape[-2]
        if seen != known or seen < 4:
            raise InputError("points", f"{seen} for a target of {known}", "give the same number, four or more")


@dataclass(frozen=True)
class Result:
    """Arrays (...): range from the entrance pupil and depth of the target's middle, and the angle between its face and
    the line of sight's normal (0 where it faces the camera)."""

    range_m: Array
    depth_m: Array
    tilt_rad: Array
    reason: Codes


@dataclass(frozen=True)
class Start:
    """Nominal solutions, better first, and the whitening of normalised coordinates.

    Attributes:
        poses: camera_from_target, one or two.
        whiten: (2N, 2N), so that residuals whitened have unit variance as far as the points err.
        chi2: of each solution, by all that is stated of points, camera and target; the camera and the pose are fitted to it.
    """

    poses: tuple[Pose, ...]
    whiten: Array
    chi2: tuple[float, ...]

    @property
    def weight(self) -> float:
        """Probability of the second solution, were both equally likely before."""
        if len(self.chi2) < 2:
            return 0.0
        return 1 / (1 + math.exp(min((self.chi2[1] - self.chi2[0]) / 2, 700.0)))

    @property
    def apart_rad(self) -> float:
        """Angle between the faces of the two solutions."""
        one, two = (pose.rotation[:, 2] for pose in self.poses[:2])
        return float(np.arctan2(np.linalg.norm(np.cross(one, two)), one @ two))


@lru_cache(maxsize=8)
def start(inputs: Inputs) -> Start:
    """Solve the nominal scene; no pose at all leaves `poses` empty."""
    points, seen = inputs.target.points_m, inputs.camera.normalised(inputs.points.points_px)
    if not np.all(np.isfinite(seen)):
        return Start((), np.eye(seen.size), ())
    cov = _points_cov(inputs)
    whiten, found = _whitening(cov), list[tuple[float, Pose]]()
    for pose in _closed_form(points, seen):
        for candidate in (pose, _mirrored(pose, points)):
            refined = _refined(candidate, points, seen, whiten, 20)
            chi2 = _chi2(refined, points, seen, whiten)
            fits = np.isfinite(chi2) and np.all(refined.apply(points)[..., 2] > 0)
            if fits and not any(_same(refined, other) for _, other in found):
                found.append((chi2, refined))
    if not found:
        return Start((), whiten, ())
    best = sorted(found, key=lambda pair: pair[0])[:2]
    whole = _whitening(cov + _moved_cov(inputs, best[0][1]))
    fitted = [(_chi2(_refined(pose, points, seen, whole, STEPS), points, seen, whole), pose) for _, pose in best]
    best = sorted(fitted, key=lambda pair: pair[0])
    return Start(tuple(p for _, p in best), whiten, tuple(c for c, _ in best))


def _chi2(pose: Pose, points_m: Array, seen: Array, whiten: Array) -> float:
    residual = whiten @ (_seen_at(pose, points_m) - seen).reshape(-1)
    return float(residual @ residual)


def _same(one: Pose, other: Pose) -> bool:
    return bool(np.allclose(one.rotation, other.rotation, atol=1e-6))


def _mirrored(pose: Pose, points_m: Array) -> Pose:
    """The pose with the target's face mirrored about the line of sight: near the second solution of a flat target."""
    middle = points_m.mean(axis=0)
    place = pose.rotation @ middle + pose.translation_m
    sight, face = place / np.linalg.norm(place), pose.rotation[:, 2]
    across = np.cross(face, sight)
    if face @ sight < 0:
        across = -across
    size = np.linalg.norm(across)
    angle = 2 * math.atan2(size, abs(face @ sight))
    rotation = rotation_from_vector(across / size * angle if size > 1e-12 else np.zeros(3)) @ pose.rotation
    return Pose(rotation, place - rotation @ middle)


def _points_cov(inputs: Inputs) -> Array:
    """(2N, 2N) covariance of the points, in normalised coordinates (pixels over f)."""
    f = float(np.mean(inputs.camera.f_px))
    points = inputs.points
    cov = points.cov if points.cov is not None else np.diag(np.maximum(points.standard_deviations, 1e-3) ** 2)
    return np.asarray((cov + 1e-6 * np.eye(len(cov))) / f**2)


def _whitening(cov: Array) -> Array:
    """Inverse Cholesky root."""
    return np.asarray(np.linalg.inv(np.linalg.cholesky(cov)))


def _moved_cov(inputs: Inputs, at: Pose) -> Array:
    """(2N, 2N) covariance of the normalised residuals by what is stated of the camera's numbers and the target's shape."""
    camera, target = inputs.camera, inputs.target
    cov = np.zeros((2 * inputs.points.points_px.shape[-2],) * 2)
    for part in camera.parts():
        cov += _by_part(part, lambda values: camera.moved(values).normalised(inputs.points.points_px))
    for part in target.parts():
        cov += _by_part(part, lambda values: _seen_at(at, target.moved(values).points_m))
    return cov


def _by_part(part: Part, residual: Callable[[dict[str, Array]], Array]) -> Array:
    """(2N, 2N) covariance that one block of numbers gives to residuals, by central differences."""
    u = np.sqrt(np.diag(part.cov)) if part.cov is not None else np.asarray(part.u, float).reshape(-1)
    steps = STEP * np.diag(u)
    up, down = (residual({part.key: part.value.reshape(-1, 1) + sign * steps}) for sign in (1, -1))
    # rows: change with one u of each number, where a lens that was moved still gives directions
    by_u = np.nan_to_num((up - down) / (2 * STEP), posinf=0.0, neginf=0.0).reshape(len(u), -1)
    if part.cov is None:
        return np.asarray(by_u.T @ by_u)
    scale = np.where(u > 0, u, 1.0)
    return np.asarray(by_u.T @ (part.cov / np.outer(scale, scale)) @ by_u)


def _closed_form(points_m: Array, seen: Array) -> list[Pose]:
    import cv2

    centred = points_m - points_m.mean(axis=0)
    spread = np.linalg.svd(centred, compute_uv=False)
    if spread[1] < 1e-9 * spread[0]:
        raise InputError("target", "points on one line", "give at least four points that span a plane")
    flat = spread[2] < 1e-9 * spread[0]
    turn = _to_plane(centred) if flat else np.eye(3)
    poses = []
    # IPPE fails where a flat target exactly faces the camera; the iterative solver starts from a homography
    for flags in (cv2.SOLVEPNP_IPPE, cv2.SOLVEPNP_ITERATIVE) if flat else (cv2.SOLVEPNP_SQPNP,):
        try:
            _, vectors, shifts, _ = cv2.solvePnPGeneric(centred @ turn.T, seen, np.eye(3), None, flags=flags)
        except cv2.error:
            continue
        for vector, shift in zip(vectors, shifts, strict=True):
            rotation = rotation_from_vector(np.reshape(vector, 3)) @ turn
            poses.append(Pose(rotation, np.reshape(shift, 3) - rotation @ points_m.mean(axis=0)))
    return [pose for pose in poses if np.all(np.isfinite(pose.rotation)) and np.all(np.isfinite(pose.translation_m))]


def _to_plane(centred: Array) -> Array:
    """Rotation that lays flat points into z = 0, as IPPE wants them."""
    turn = np.linalg.svd(centred)[2]
    return np.asarray(turn * np.array([[1.0], [1.0], [np.linalg.det(turn)]]))


def _seen_at(pose: Pose, points_m: Array) -> Array:
    placed = pose.apply(points_m)
    return np.asarray(placed[..., :2] / placed[..., 2:])


def _refined(pose: Pose, points_m: Array, seen: Array, whiten: Array, steps: int) -> Pose:
    """Gauss-Newton, perturbing the rotation on the left; broadcasts over leading axes of points and seen."""
    lead = np.broadcast_shapes(points_m.shape[:-2], seen.shape[:-2])
    rotation = np.broadcast_to(pose.rotation, (*lead, 3, 3))
    shift = np.broadcast_to(pose.translation_m, (*lead, 3))
    for _ in range(steps):
        turned = points_m @ np.swapaxes(rotation, -1, -2)
        placed = turned + shift[..., None, :]
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            inverse = 1 / placed[..., 2]
            slope = placed[..., :2] * inverse[..., None]
        jac = _jacobian(turned, slope, inverse)
        residual = (slope - seen).reshape(*slope.shape[:-2], -1)
        weighted = whiten @ jac
        normal = np.swapaxes(weighted, -1, -2) @ weighted
        gradient = np.swapaxes(weighted, -1, -2) @ (whiten @ residual[..., None])
        damp = 1e-12 * np.trace(normal, axis1=-2, axis2=-1)[..., None, None] * np.eye(6)
        step = -np.linalg.solve(np.nan_to_num(normal + damp, nan=1.0, posinf=1.0), np.nan_to_num(gradient))[..., 0]
        rotation = rotation_from_vector(step[..., :3]) @ rotation
        shift = shift + step[..., 3:]
        if np.max(abs(step)) < SETTLED:
            break
    return Pose(rotation, shift)


def _jacobian(turned: Array, slope: Array, inverse: Array) -> Array:
    """(..., 2N, 6) of the slopes by (rotation vector, translation)."""
    zero = np.zeros_like(inverse)
    by_point = np.stack([np.stack([inverse, zero, -slope[..., 0] * inverse], -1),
                         np.stack([zero, inverse, -slope[..., 1] * inverse], -1)], -2)  # fmt: skip
    whole = np.concatenate([by_point @ -cross_matrix(turned), by_point], -1)
    return np.asarray(whole.reshape(*whole.shape[:-3], -1, 6))


def pose(inputs: Inputs, begin: Start) -> Result:
    """Range, depth (m) and tilt (rad) of the target's middle.

    Source: reprojection least squares; see the module.
    """
    lead = _leading(inputs)
    if not begin.poses:
        nothing = np.full(lead, np.nan)
        return Result(nothing, nothing, nothing, np.full(lead, Reason.NOT_CONVERGED, np.int8))
    seen = inputs.camera.normalised(inputs.points.points_px)
    share = np.asarray(inputs.ambiguity.value)
    numbers = list(_numbers(begin.poses[0], inputs, seen, begin.whiten))
    if len(begin.poses) > 1 and (np.any(share) or np.any(inputs.ambiguity.u)):
        other = _numbers(begin.poses[1], inputs, seen, begin.whiten)
        numbers = [(1 - share) * a + share * b for a, b in zip(numbers, other, strict=True)]
    range_m, depth_m, tilt = (np.broadcast_to(n, lead) for n in numbers)
    perspective = np.asarray(not LENSES[inputs.camera.lens].perspective)
    code = reasons(lead, (perspective, Reason.NOT_PINHOLE), (np.asarray(~np.isfinite(seen).all(axis=(-1, -2))), Reason.NOT_INVERTIBLE),
                   (~np.isfinite(range_m), Reason.NOT_CONVERGED), (~(depth_m > 0), Reason.BEHIND_CAMERA))  # fmt: skip
    return Result(range_m, depth_m, tilt, code)


def _leading(inputs: Inputs) -> tuple[int, ...]:
    return np.broadcast_shapes(inputs.points.leading, inputs.camera.leading, inputs.target.leading,
                               np.shape(inputs.focus.value), np.shape(inputs.ambiguity.value))  # fmt: skip


def place(inputs: Inputs, begin: Start) -> Array:
    """(..., 3) the target's middle in the camera's frame, m."""
    lead = _leading(inputs)
    if not begin.poses:
        return np.full((*lead, 3), np.nan)
    seen = inputs.camera.normalised(inputs.points.points_px)
    share = np.asarray(inputs.ambiguity.value)[..., None]
    middle, _ = _middle(begin.poses[0], inputs, seen, begin.whiten)
    if len(begin.poses) > 1 and (np.any(share) or np.any(inputs.ambiguity.u)):
        middle = (1 - share) * middle + share * _middle(begin.poses[1], inputs, seen, begin.whiten)[0]
    return np.broadcast_to(middle, (*lead, 3))


def _middle(begin: Pose, inputs: Inputs, seen: Array, whiten: Array) -> tuple[Array, Array]:
    """The target's middle and the normal of its face, (..., 3) each, from one start."""
    points = inputs.target.points_m
    placed = _refined(begin, points, seen, whiten, STEPS)
    middle = placed.apply(points.mean(axis=-2, keepdims=True))[..., 0, :]
    extension = np.asarray(inputs.focus.value) * (inputs.camera.nominal_focal_m or 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        return middle * (1 + extension / middle[..., 2])[..., None], placed.rotation[..., :, 2]


def _numbers(begin: Pose, inputs: Inputs, seen: Array, whiten: Array) -> tuple[Array, Array, Array]:
    """Range, depth and tilt from one start."""
    middle, face = _middle(begin, inputs, seen, whiten)
    with np.errstate(divide="ignore", invalid="ignore"):
        range_m = np.sqrt(np.sum(middle**2, -1))
        along = abs(np.sum(face * middle, -1)) / range_m
        across = np.sqrt(np.sum(np.cross(face, middle) ** 2, -1)) / range_m
    return range_m, middle[..., 2], np.arctan2(across, along)


def prepare(inputs: Inputs) -> Inputs:
    """Inputs whose `ambiguity` holds the second solution's weight, where it has any."""
    weight = start(inputs).weight
    if weight < LEAST_WEIGHT or inputs.ambiguity.u:
        return inputs
    either = Quantity(0.0, math.sqrt(weight), "1", Distribution("either", weight), source="two poses fit the points")
    return replace(inputs, ambiguity=either)


def _misfit(inputs: Inputs, begin: Start) -> float:
    """Residual of the better solution in what is stated of points, camera and target, where it is beyond chance; 0 else."""
    freedom = 2 * inputs.points.points_px.shape[-2] - 6
    spread = 2 / (9 * freedom)
    most = freedom * (1 - spread + MISFIT_Z * math.sqrt(spread)) ** 3  # Wilson and Hilferty's quantile of chi^2
    chi2 = begin.chi2[0] if begin.chi2 else 0.0
    return math.sqrt(chi2 / freedom) if chi2 > most else 0.0


def notes(inputs: Inputs, result: Result) -> tuple[Note, ...]:
    """`points_misfit`, `pose_ambiguous` and `close_focus`."""
    begin = start(inputs)
    found = []
    misfit = _misfit(inputs, begin)
    if misfit:
        text = (f"the points do not fit the target: they are off by {misfit:.2g} times what is stated of them and of the camera, "
                "and the interval is too narrow")  # fmt: skip
        cure = "check that the points are those of the target in its order, which side is which, and the camera"
        found.append(Note("points_misfit", text, cure))
    if begin.weight >= LEAST_WEIGHT and begin.apart_rad > TELLING_RAD:
        other = _numbers(begin.poses[1], inputs, inputs.camera.normalised(inputs.points.points_px), begin.whiten)
        text = (f"a second pose fits nearly as well (probability {begin.weight:.0%}): tilt {math.degrees(float(other[2])):.0f}° "
                "the other way").replace("%)", " %)")  # fmt: skip
        found.append(Note("pose_ambiguous", text, "come closer, or look at the target from the side"))
    note = close_focus(inputs.camera.nominal_focal_m, float(result.depth_m), inputs.focus)
    return (*found, note) if note else tuple(found)


def example() -> Inputs:
    """A marker of 50 mm, tilted by 40 degrees, 0.6 m away."""
    camera = Camera(1600, 1200, 1300.0, 799.5, 599.5, cov=np.diag([10.0**2, 0, 4.0**2, 4.0**2]))
    target = Target.square(Quantity.interval(0.05, 0.0002, "m"), "marker")
    there = Pose(rotation_from_vector(np.array([0.0, math.radians(40), 0.0])), np.array([0.05, -0.03, 0.6]))
    return Inputs(camera, Observation(camera.project(there.apply(target.points_m)), 0.1), target)


def _outputs() -> tuple[Output, ...]:
    return (Output("range_m", "range", "m", "range (from the entrance pupil)"),
            Output("depth_m", "depth", "m", "depth (along the axis)"),
            Output("tilt_rad", "tilt", "rad", "tilt to the line of sight", digits=1))  # fmt: skip


METHOD = Method(
    name="pose",
    title="four or more known points: a marker, a card, a sheet",
    inputs=Inputs,
    outputs=_outputs(),
    function=pose,
    assumes=("the points are those of the target, in its order", "the target is rigid, and flat where its points are",
             "the picture is not cropped or edited after the camera's numbers were taken"),
    source="T. Collins, A. Bartoli, IJCV 2014",
    typical="0.1 to 0.5 % calibrated, 1 to 3 % with a nominal focal length",
    example=example,
    button="Rectangle",
    start=start,
    place=place,
    prepare=prepare,
    most_draws=100_000,
    notes=notes,
)  # fmt: skip


def solution(inputs: Inputs) -> Pose | None:
    """camera_from_target of the nominal scene with its (6, 6) covariance from the points, or None."""
    begin = start(inputs)
    if not begin.poses:
        return None
    best = begin.poses[0]
    turned = inputs.target.points_m @ best.rotation.T
    placed = turned + best.translation_m
    weighted = begin.whiten @ _jacobian(turned, placed[:, :2] / placed[:, 2:], 1 / placed[:, 2])
    return replace(best, cov=np.asarray(np.linalg.inv(weighted.T @ weighted), float))
