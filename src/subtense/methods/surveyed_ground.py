"""Place and distance of a point of known height, in a picture in which surveyed points are seen.

Four or more surveyed points tell where the camera stood and how it looked, and more of them its focal length and distortion too, as far
as what is known of it leaves them open (`resection`). The line of sight of another point meets its height in the survey's frame.
Where the surveyed points fit worse than is stated of them, their sigma is widened to what their residuals show.

Source: space resection, P. Wolf, B. Dewitt, Elements of Photogrammetry, 11.6; variance factor: GUM, and any text of adjustment.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np

from ..arrays import Array, Codes
from ..camera import Camera
from ..errors import InputError
from ..method import Method, Output, Reason, reasons
from ..observation import Observation
from ..quantity import Note, Quantity
from ..resection import Resection, moved, resect
from ..target import Target

CHANCE_Z = 2.326
"""Normal quantile (1 in 100) beyond which residuals are no chance."""
LEAST_FREEDOM = 3.0
"""Degrees of freedom from which residuals tell a sigma."""
WIDENED = "widened"


@dataclass(frozen=True, kw_only=True)
class Inputs:
    """A camera, four or more surveyed points and where they are in the picture, and a point whose height is known.

    Attributes:
        camera: what is known of it; numbers with a wide u are found from the points.
        control: point i is point i of the survey.
        survey: at least four points, not on one line; z up.
        foot: the point that is wanted.
        elevation: of that point, z in the frame of the survey, m.
    """

    camera: Camera
    control: Observation
    survey: Target
    foot: Observation = field(metadata={"points": 1})
    elevation: Quantity = field(metadata={"unit": "m", "signed": True})

    def __post_init__(self) -> None:
        seen, known = self.control.points_px.shape[-2], self.survey.points_m.shape[-2]
        if seen != known or seen < 4:
            raise InputError("control", f"{seen} for a survey of {known}", "give the same number, four or more")
        if self.survey.points_m.ndim == 2:
            spread = np.linalg.svd(self.survey.points_m - self.survey.points_m.mean(axis=0), compute_uv=False)
            if spread[1] < 1e-6 * max(spread[0], 1e-12):
                raise InputError("survey", "points on one line", "give at least four points that span a plane")


@dataclass(frozen=True)
class Result:
    """Arrays (...): level distance, range from the entrance pupil, depth along the axis, and the place in the survey's frame."""

    ground_distance_m: Array
    range_m: Array
    depth_m: Array
    x_m: Array
    y_m: Array
    reason: Codes


def start(inputs: Inputs) -> Resection | None:
    """Resect the nominal scene; once for all points that are measured beside the same survey."""
    return _resected(inputs.camera, inputs.control, inputs.survey)


@lru_cache(maxsize=8)
def _resected(camera: Camera, control: Observation, survey: Target) -> Resection | None:
    return resect(camera, control, survey.points_m, survey.sigma_m)


def surveyed_ground(inputs: Inputs, begin: Resection | None) -> Result:
    """Where the line of sight meets the stated height, m.

    Source: space resection by least squares; see the module.
    """
    elevation = np.asarray(inputs.elevation.value, float)
    if begin is None:
        nothing = np.full(np.broadcast_shapes(elevation.shape, inputs.foot.leading, inputs.camera.leading), np.nan)
        return Result(
            nothing, nothing, nothing, nothing, nothing, np.full(nothing.shape, Reason.NOT_CONVERGED, np.int8)
        )
    camera, pose = moved(begin, inputs.camera, inputs.control.points_px, inputs.survey.points_m)
    ray = camera.rays(inputs.foot.points_px)[..., 0, :]
    back = pose.inverse()
    ways = (back.rotation @ ray[..., None])[..., 0]
    height = elevation - begin.origin_m[2] - back.translation_m[..., 2]
    with np.errstate(invalid="ignore", divide="ignore"):
        t = height / ways[..., 2]
    code = reasons(t.shape, (np.asarray(~np.isfinite(pose.translation_m).all(axis=-1)), Reason.NOT_CONVERGED),
                   (np.asarray(~np.isfinite(ways).all(axis=-1)), Reason.NOT_INVERTIBLE), (~(t > 0), Reason.AT_OR_ABOVE_HORIZON),
                   (~np.isfinite(t), Reason.AT_OR_ABOVE_HORIZON))  # fmt: skip
    x, y = (back.translation_m[..., i] + t * ways[..., i] + begin.origin_m[i] for i in (0, 1))
    return Result(np.asarray(t * np.hypot(ways[..., 0], ways[..., 1])), t, t * ray[..., 2], x, y, code)


def place(inputs: Inputs, begin: Resection | None) -> Array:
    """(..., 3) the point in the camera's frame, m."""
    range_m = surveyed_ground(inputs, begin).range_m[..., None]
    if begin is None:
        return range_m + np.zeros(3)
    camera, _ = moved(begin, inputs.camera, inputs.control.points_px, inputs.survey.points_m)
    return np.asarray(camera.rays(inputs.foot.points_px)[..., 0, :] * range_m)


def prepare(inputs: Inputs) -> Inputs:
    """Inputs whose surveyed points are as doubtful as their residuals show, where these are beyond chance."""
    if WIDENED in inputs.control.source:
        return inputs
    control, survey = _widened(inputs.camera, inputs.control, inputs.survey)
    return inputs if control is inputs.control else replace(inputs, control=control, survey=survey)


@lru_cache(maxsize=8)
def _widened(camera: Camera, control: Observation, survey: Target) -> tuple[Observation, Target]:
    begin = _resected(camera, control, survey)
    if begin is None or begin.freedom < LEAST_FREEDOM:
        return control, survey
    spread = 2 / (9 * begin.freedom)
    if begin.chi2 <= begin.freedom * (1 - spread + CHANCE_Z * math.sqrt(spread)) ** 3:  # Wilson and Hilferty's quantile
        return control, survey
    # the factor is itself known from few residuals: the variance of a t law of as many degrees of freedom
    factor = math.sqrt(begin.chi2 / (begin.freedom - 2))
    source = f"{control.source}, {WIDENED} {factor:.2g} times by the residuals"
    cov = None if control.cov is None else control.cov * factor**2
    wider = replace(control, sigma_px=np.asarray(control.sigma_px) * factor, cov=cov, source=source, id=None)
    return wider, replace(survey, sigma_m=survey.sigma_m * factor, id=None)


def notes(inputs: Inputs, _: Result) -> tuple[Note, ...]:
    """`points_misfit`."""
    _before, widened, factor = inputs.control.source.partition(f"{WIDENED} ")
    if not widened:
        return ()
    text = f"the surveyed points fit worse than is stated of them; their sigma was widened {factor.split()[0]} times, to what they show"
    return (Note("points_misfit", text, "check each point, and state sigmas that hold for clicks and survey"),)


def example() -> Inputs:
    """Eight points surveyed to 1 cm, 15 to 40 m from a camera on a mast of 8 m, and a point among them."""
    camera = Camera(1920, 1080, 1450.0, 959.5, 539.5, cov=np.diag([15.0**2, 0, 8.0**2, 8.0**2]))
    survey = np.array(
        [[-6, 16, 0.2], [5, 15, 0], [-9, 24, 0.1], [8, 26, 0.6], [0, 20, 0], [-8, 38, 0.9], [10, 40, 0.3], [1, 32, 0.0]]
    )
    tilt = math.radians(18)
    rotation = np.array([[1, 0, 0], [0, -math.sin(tilt), -math.cos(tilt)], [0, math.cos(tilt), -math.sin(tilt)]])
    place = np.array([0.0, 0.0, 8.0])
    seen = camera.project((survey - place) @ rotation.T)
    foot = camera.project((np.array([[2.0, 28.0, 0.4]]) - place) @ rotation.T)
    return Inputs(camera=camera, control=Observation(seen, 0.7), survey=Target("survey", survey, sigma_m=0.01),
                  foot=Observation(foot, 0.7), elevation=Quantity.normal(0.4, 0.02, "m"))  # fmt: skip


METHOD = Method(
    name="surveyed_ground",
    title="a point of known height, beside surveyed points",
    inputs=Inputs,
    outputs=(Output("ground_distance_m", "ground_distance", "m", "ground distance (level, from below the camera)"),
             Output("range_m", "range", "m", "range (from the entrance pupil)"),
             Output("depth_m", "depth", "m", "depth (along the axis)"),
             Output("x_m", "position_x", "m", "place, x of the survey", nonnegative=False),
             Output("y_m", "position_y", "m", "place, y of the survey", nonnegative=False)),
    function=surveyed_ground,
    assumes=("the surveyed points are those in the picture, in the same order", "the survey's frame is level, with z up",
             "the wanted point has the stated height in that frame", "the camera's lens model fits its lens"),
    source="P. Wolf, B. Dewitt, Elements of Photogrammetry, 11.6",
    typical="0.3 to 1 % of the range",
    example=example,
    button="Surveyed points",
    start=start,
    place=place,
    prepare=prepare,
    most_draws=100_000,
    notes=notes,
)  # fmt: skip
