"""Ground sampling distance: how much ground one pixel shows, at a point of the picture.

The ground is met by the lines of sight half a pixel to each side of the point. Looking straight down on level ground that is
height / focal length in pixels; from the side, the pixel below shows more of the ground than the one beside.

Source: similar triangles on bent, sloping ground; P. Wolf, B. Dewitt, Elements of Photogrammetry, 6.3 (scale of an air photo).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from ..arrays import Array, Codes
from ..camera import Camera
from ..ground import Standing, ground_notes, meet, stand, with_standing
from ..method import Method, Output
from ..observation import Observation
from ..quantity import Note, Quantity

_CROSS = np.array([[-0.5, 0.0], [0.5, 0.0], [0.0, -0.5], [0.0, 0.5]])


@with_standing
@dataclass(frozen=True, kw_only=True)
class Inputs(Standing):
    """A camera of known height above the ground, how it stands, and a point of its picture.

    Attributes:
        place: the point, on the ground.
    """

    place: Observation = field(metadata={"points": 1})


@dataclass(frozen=True)
class Result:
    """Arrays (...): ground per pixel along the picture's rows and along its columns, and the range."""

    across_m_px: Array
    along_m_px: Array
    range_m: Array
    reason: Codes


def ground_sampling(inputs: Inputs) -> Result:
    """Ground per pixel, m, and range, m.

    Source: similar triangles on bent, sloping ground; see the module.
    """
    place = stand(inputs)
    points = inputs.place.points_px
    middle = meet(inputs, place, inputs.camera.rays(points), np.zeros(()))
    met = meet(inputs, place, inputs.camera.rays(points + _CROSS), np.zeros(()))
    worst = np.maximum(met.worst, middle.worst)
    return Result(met.apart_m(0, 1), met.apart_m(2, 3), middle.range_m[..., 0], worst)


def notes(inputs: Inputs, _: Result) -> tuple[Note, ...]:
    """Those of the ground."""
    return ground_notes(inputs, inputs.place, np.zeros(()))


def example() -> Inputs:
    """The middle of a picture from a drone 40 m above the ground that looks straight down."""
    camera = Camera(4000, 2250, 2300.0, 1999.5, 1124.5, cov=np.diag([30.0**2, 0, 20.0**2, 20.0**2]))
    return Inputs(
        camera=camera, height=Quantity.normal(40.0, 1.0, "m"), pitch=Quantity.normal(-math.radians(90), math.radians(0.5), "rad"),
        roll=Quantity.normal(0.0, math.radians(0.5), "rad"), place=Observation(np.array([[1999.5, 1124.5]]), 0.0),
    )  # fmt: skip


METHOD = Method(
    name="ground_sampling",
    title="ground sampling distance of an air photo",
    inputs=Inputs,
    outputs=(Output("across_m_px", "object_scale", "m/px", "ground per pixel, across"),
             Output("along_m_px", "object_scale_along", "m/px", "ground per pixel, up and down the picture"),
             Output("range_m", "range", "m", "range (from the entrance pupil)")),
    function=ground_sampling,
    assumes=("the point is on the ground", "the ground is a plane of the stated slope, bent with the earth",
             "the height is that of the entrance pupil, above the ground at the camera's foot"),
    source="P. Wolf, B. Dewitt, Elements of Photogrammetry, 6.3",
    typical="2 to 5 % by a drone's own height",
    example=example,
    most_draws=200_000,
    button="Ground sampling",
    notes=notes,
)  # fmt: skip
