"""Range and depth of a ball of known diameter, from its outline.

The lines of sight that touch a ball of radius R make a round cone of half angle a about the direction of its centre, and
range = R / sin(a). Its outline is nearer than its centre, so a disc of the same size would read sqrt(1 - (R / range)^2) of the
range; off the middle of the picture the outline is an ellipse, up to 1 / cos wider than high, and its centre is not that of
the ball. The cone is fitted to directions, so neither matters, nor the lens.

Source: the tangent cone of a sphere, any text of solid geometry; its outline: M. Agrawal, L. Davis, Camera calibration using
spheres, ICCV 2003.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np

from ..arrays import Array, Codes
from ..camera import Camera
from ..conic import ConeFit, misfit, refit, rim_cone
from ..errors import InputError
from ..focus import NO_EXTENSION, close_focus, thin_lens
from ..lenses import LENSES
from ..method import Method, Output, Reason, reasons
from ..observation import Observation
from ..quantity import Note, Quantity

LEAST_POINTS = 3


@dataclass(frozen=True)
class Inputs:
    """A camera, three or more points of a ball's outline, and its diameter.

    Attributes:
        camera: of the upright picture.
        rim: points of the outline, in order around it; more, and all around, are better.
        diameter: of the ball, m.
        focus: share of the thin-lens extension that is added where the focal length is nominal; 1.
    """

    camera: Camera
    rim: Observation = field(metadata={"closed": True, "least": LEAST_POINTS})
    diameter: Quantity = field(metadata={"unit": "m", "assume": "size"})
    focus: Quantity = field(default_factory=thin_lens, metadata={"unit": "1"})

    def __post_init__(self) -> None:
        seen = self.rim.points_px.shape[-2]
        if seen < LEAST_POINTS:
            raise InputError("rim", f"{seen} points", f"give {LEAST_POINTS} or more, all around the outline")


@dataclass(frozen=True)
class Result:
    """Arrays (...): range from the entrance pupil and depth along the axis of the ball's centre."""

    range_m: Array
    depth_m: Array
    reason: Codes


@lru_cache(maxsize=8)
def start(inputs: Inputs) -> ConeFit:
    """Fit the nominal outline."""
    return rim_cone(inputs.camera, inputs.rim, round_one=True)


def place(inputs: Inputs, begin: ConeFit) -> Array:
    """(..., 3) the ball's centre in the camera's frame, m."""
    cone, _ = refit(begin, inputs.camera.rays(inputs.rim.points_px))
    return np.asarray(cone.axis * sphere(inputs, begin).range_m[..., None])


def sphere(inputs: Inputs, begin: ConeFit) -> Result:
    """Range and depth of the ball's centre, m.

    Source: the tangent cone; see the module.
    """
    rays = inputs.camera.rays(inputs.rim.points_px)
    cone, converged = refit(begin, rays)
    diameter = np.asarray(inputs.diameter.value)
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        range_m = diameter / 2 * np.sqrt(1 + np.exp(-2 * cone.log_size))
        depth = range_m * cone.axis[..., 2]
        extension = 1 + np.asarray(inputs.focus.value) * (inputs.camera.nominal_focal_m or 0.0) / depth
    range_m, depth_m = range_m * extension, depth * extension
    perspective = np.asarray(not LENSES[inputs.camera.lens].perspective)
    code = reasons(
        range_m.shape, (perspective, Reason.NOT_PINHOLE), (np.asarray(~np.isfinite(rays).all(axis=(-1, -2))), Reason.NOT_INVERTIBLE),
        (~(diameter > 0), Reason.OUT_OF_RANGE), (~converged | ~np.isfinite(range_m), Reason.NOT_CONVERGED),
        (~(depth_m > 0), Reason.BEHIND_CAMERA),
    )  # fmt: skip
    return Result(range_m, depth_m, code)


def prepare(inputs: Inputs) -> Inputs:
    """A calibrated focal length holds its focus extension already: nothing is doubtful about it."""
    return inputs if inputs.camera.nominal_focal_m else replace(inputs, focus=NO_EXTENSION)


def notes(inputs: Inputs, result: Result) -> tuple[Note, ...]:
    """`points_misfit` and `close_focus`."""
    found = []
    off = misfit(float(start(inputs).chi2), inputs.rim.points_px.shape[-2] - LEAST_POINTS)
    if off:
        found.append(Note("points_misfit", "the points do not lie on the outline of one ball: they are off by "
                          f"{off:.2g} times what is stated of them, and the interval is too narrow",
                          "check that all are on one outline, and the camera"))  # fmt: skip
    note = close_focus(inputs.camera.nominal_focal_m, float(result.depth_m), inputs.focus)
    return (*found, note) if note else tuple(found)


def outline(centre_m: Array, radius_m: float, count: int = 8) -> Array:
    """(count, 3) points where lines of sight touch a ball, camera frame."""
    centre = np.asarray(centre_m, float)
    far = float(np.linalg.norm(centre))
    axis = centre / far
    first = np.cross(axis, [0.0, 1.0, 0.0] if abs(axis[1]) < 0.9 else [1.0, 0.0, 0.0])
    first /= np.linalg.norm(first)
    around = np.linspace(0, 2 * np.pi, count, endpoint=False)[:, None]
    sine = radius_m / far
    across = np.cos(around) * first + np.sin(around) * np.cross(axis, first)
    return np.asarray(far * (1 - sine**2) * axis + radius_m * np.sqrt(1 - sine**2) * across)


def example() -> Inputs:
    """A football of 220 mm, 3 m away; eight points of its outline."""
    camera = Camera(1600, 1200, 1300.0, 799.5, 599.5, cov=np.diag([10.0**2, 0, 4.0**2, 4.0**2]))
    seen = camera.project(outline(np.array([0.8, -0.3, 3.0]), 0.11))
    return Inputs(camera, Observation(seen, 0.3), Quantity.interval(0.22, 0.003, "m"))


METHOD = Method(
    name="sphere",
    title="a ball of known diameter",
    inputs=Inputs,
    outputs=(Output("range_m", "range", "m", "range (from the entrance pupil)"),
             Output("depth_m", "depth", "m", "depth (along the axis)")),
    function=sphere,
    assumes=("the points lie on the outline of one ball of the stated diameter",
             "the picture is not cropped or edited after the camera's numbers were taken"),
    source="the tangent cone of a sphere; M. Agrawal, L. Davis, ICCV 2003",
    typical="0.2 to 0.5 % calibrated, 1 to 3 % with a nominal focal length",
    example=example,
    button="Ball",
    start=start,
    place=place,
    prepare=prepare,
    most_draws=100_000,
    notes=notes,
)  # fmt: skip
