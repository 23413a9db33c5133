"""Range and depth of a point in a plane, from four or more points of the plane whose places are known, and the camera.

The plane's place is that of its reference points (a pose by reprojection least squares, as in `pose`); the point is where its
viewing direction r meets the plane: range = (n . t) / (n . r). Where the pixels can't tell two poses of the reference apart, the
second enters with its weight exp(-chi^2 / 2) as a line of the budget.

Source: R. Hartley, A. Zisserman, Multiple View Geometry, 8.1.1, 7.1.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np

from ..arrays import Array, Codes
from ..camera import Camera
from ..distribution import Distribution
from ..flat_view import Disc, FlatView, check_reference, flat_view, reference_notes, unknown_distortion
from ..focus import close_focus, thin_lens
from ..geometry import Pose, rotation_from_vector
from ..homography import chi2_limit, refined_pose
from ..lenses import LENSES
from ..method import Method, Output, Reason, reasons
from ..observation import Observation
from ..quantity import Note, Quantity
from ..target import Target

LEAST_WEIGHT = 0.01
"""A second pose of less weight is left out."""


def unambiguous() -> Quantity:
    """Only the better pose of the reference."""
    return Quantity.exact(0.0, "1", "the better of two poses")


@dataclass(frozen=True)
class Inputs:
    """A camera, four or more reference points of a plane with their places in it, and a point of the plane.

    Attributes:
        camera: of the upright picture.
        points: point i is point i of the target.
        target: places of the reference points, at least four, no three on one line.
        spot: the point of the plane whose distance is wanted.
        focus: share of the thin-lens extension that is added where the focal length is nominal; 1.
        ambiguity: share of the second pose: 0, or either 0 or 1 by its weight (found by itself).
    """

    camera: Camera
    points: Observation = field(metadata={"points": 4, "more": True, "closed": True})
    target: Target
    spot: Observation = field(metadata={"points": 1})
    focus: Quantity = field(default_factory=thin_lens, metadata={"unit": "1"})
    ambiguity: Quantity = field(default_factory=unambiguous, metadata={"unit": "1"})

    def __post_init__(self) -> None:
        check_reference(self.points, self.target)


@dataclass(frozen=True)
class Result:
    """Arrays (...): range from the entrance pupil and depth of the point, and height of the camera over the plane."""

    range_m: Array
    depth_m: Array
    camera_height_m: Array
    reason: Codes


@lru_cache(maxsize=8)
def start(inputs: Inputs) -> FlatView:
    """Fit the nominal scene."""
    none = unknown_distortion()
    return flat_view(inputs.camera, inputs.points, inputs.target, none, Disc.around(None, inputs.points), place=True)


def plane_distance(inputs: Inputs, begin: FlatView) -> Result:
    """Range, depth and the camera's height over the plane, m.

    Source: ray and plane; see the module.
    """
    lead = np.broadcast_shapes(*(one.leading for one in (inputs.points, inputs.spot, inputs.camera, inputs.target)),
                               np.shape(inputs.focus.value), np.shape(inputs.ambiguity.value))  # fmt: skip
    nothing = np.full(lead, np.nan)
    if not begin.poses:
        why = Reason.NOT_CONVERGED if np.all(np.isfinite(begin.fit.h)) else Reason.COLLINEAR
        return Result(nothing, nothing, nothing, np.full(lead, why, np.int8))
    numbers = list(_numbers(begin.poses[0], inputs, begin))
    share = np.asarray(inputs.ambiguity.value)
    if len(begin.poses) > 1 and (np.any(share) or np.any(inputs.ambiguity.u)):
        other = _numbers(begin.poses[1], inputs, begin)
        numbers = [(1 - share) * a + share * b for a, b in zip(numbers, other, strict=True)]
    range_m, depth_m, height_m = (np.broadcast_to(n, lead) for n in numbers)
    perspective = np.asarray(not LENSES[inputs.camera.lens].perspective)
    missing = np.asarray(~np.isfinite(inputs.camera.slopes(inputs.points.points_px)[0]).all(axis=-1)
                         | ~np.isfinite(inputs.camera.slopes(inputs.spot.points_px)[0]).all(axis=-1))  # fmt: skip
    code = reasons(lead, (perspective, Reason.NOT_PINHOLE), (missing, Reason.NOT_INVERTIBLE),
                   (~np.isfinite(height_m), Reason.NOT_CONVERGED), (~(depth_m > 0), Reason.BEYOND_HORIZON))  # fmt: skip
    return Result(range_m, depth_m, height_m, code)


def _numbers(begin: Pose, inputs: Inputs, view: FlatView) -> tuple[Array, Array, Array]:
    """Range, depth and the camera's height from one pose."""
    seen = inputs.camera.normalised(inputs.points.points_px)
    assert view.whiten is not None
    pose = refined_pose(begin, inputs.target.points_m, seen, view.whiten, 3)
    x, y = (slope[..., 0] for slope in inputs.camera.slopes(inputs.spot.points_px))
    normal = pose.rotation[..., :, 2]
    over = np.sum(normal * pose.translation_m, -1)
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = over / (normal[..., 0] * x + normal[..., 1] * y + normal[..., 2])
        extension = np.asarray(inputs.focus.value) * (inputs.camera.nominal_focal_m or 0.0)
        depth = depth + extension
        return depth * np.sqrt(1 + x * x + y * y), depth, abs(over)


def place(inputs: Inputs, begin: FlatView) -> Array:
    """(..., 3) the point in the camera's frame, m."""
    return np.asarray(
        inputs.camera.rays(inputs.spot.points_px)[..., 0, :] * plane_distance(inputs, begin).range_m[..., None]
    )


def prepare(inputs: Inputs) -> Inputs:
    """Inputs whose `ambiguity` holds the second pose's weight, where it has any."""
    weight = _weight(start(inputs))
    if weight < LEAST_WEIGHT or np.any(inputs.ambiguity.u):
        return inputs
    either = Quantity(
        0.0, math.sqrt(weight), "1", Distribution("either", weight), source="two poses fit the reference points"
    )
    return replace(inputs, ambiguity=either)


def _weight(view: FlatView) -> float:
    """Probability of the second pose, were both equally likely before."""
    if len(view.chi2) < 2:
        return 0.0
    return 1 / (1 + math.exp(min((view.chi2[1] - view.chi2[0]) / 2, 700.0)))


def notes(inputs: Inputs, result: Result) -> tuple[Note, ...]:
    """`points_misfit`, `points_unchecked`, `pose_ambiguous` and `close_focus`."""
    view = start(inputs)
    found = [note for note in reference_notes(view, inputs.points.points_px.shape[-2]) if note.code == "points_misfit"]
    # four points of a known camera leave two spare observations: the pose has six numbers
    if not found and view.chi2 and view.chi2[0] > chi2_limit(inputs.points.points_px.size - 6):
        off = math.sqrt(view.chi2[0] / (inputs.points.points_px.size - 6))
        found.append(Note("points_misfit", "the reference points do not fit this camera: they are off by "
                          f"{off:.2g} times what is stated of them, and the interval is too narrow",
                          "check the points, their order and places, and the camera"))  # fmt: skip
    weight = _weight(view)
    if weight >= LEAST_WEIGHT:
        one, other = (float(_numbers(pose, inputs, view)[0]) for pose in view.poses[:2])
        text = ("a second pose of the reference fits nearly as well "
                f"(probability {100 * weight:.0f} %): {other:.3g} m instead of {one:.3g} m")  # fmt: skip
        found.append(Note("pose_ambiguous", text, "take reference points farther apart, or nearer to the camera"))
    note = close_focus(inputs.camera.nominal_focal_m, float(result.depth_m), inputs.focus)
    return (*found, note) if note else tuple(found)


def example() -> Inputs:
    """A floor with four marks 2 m by 3 m apart, seen from 1.6 m above it, and a point 8 m away."""
    camera = Camera(1600, 1200, 1300.0, 799.5, 599.5, cov=np.diag([10.0**2, 0, 4.0**2, 4.0**2]))
    places = np.array([[-1.0, 0, 0], [1.0, 0, 0], [1.0, 3.0, 0], [-1.0, 3.0, 0]])
    # x right, y ahead, z up; the camera looks 20 degrees down
    level = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    turn = rotation_from_vector(np.array([math.radians(20), 0, 0])) @ level
    pose = Pose(turn, -turn @ np.array([0.0, -3.0, 1.6]))
    seen, spot = camera.project(pose.apply(places)), camera.project(pose.apply(np.array([[0.5, 4.8, 0.0]])))
    return Inputs(camera, Observation(seen, 0.7, label="reference"), Target("marks", places, 0.002, source="stated"),
                  Observation(spot, 0.7, label="what is wanted"))  # fmt: skip


METHOD = Method(
    name="plane_distance", title="distance to a point in a plane with four known points", inputs=Inputs,
    outputs=(Output("range_m", "range", "m", "range (from the entrance pupil)"), Output("depth_m", "depth", "m", "depth (along the axis)"),
             Output("camera_height_m", "camera_height", "m", "camera above the plane")),
    function=plane_distance,
    assumes=("the reference points have the places that are stated, and lie in one plane", "the point lies in that plane",
             "the picture is not cropped or edited after the camera's numbers were taken"),
    source="R. Hartley, A. Zisserman, Multiple View Geometry, 8.1.1", typical="0.3 to 2 %", example=example,
    button="Plane distance", prepare=prepare, start=start, place=place, notes=notes,
    most_draws=100_000,
)  # fmt: skip
