"""Footprint: the ground that a picture shows.

The lines of sight through the picture's four outer corners meet the ground; sides and area are those of the four-sided figure they
make, seen from above. The sides of a distorted picture are bent, which is left out.

Source: similar triangles on bent, sloping ground; the area by the shoelace rule.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..arrays import Array, Codes
from ..camera import Camera
from ..ground import Standing, ground_notes, meet, stand, with_standing
from ..method import Method, Output
from ..observation import Observation
from ..quantity import Note, Quantity


@with_standing
@dataclass(frozen=True, kw_only=True)
class Inputs(Standing):
    """A camera of known height above the ground, and how it stands.

    Attributes:
    """


@dataclass(frozen=True)
class Result:
    """Arrays (...): area, the ground along the lower and the upper edge of the picture, and between their middles."""

    area_m2: Array
    near_m: Array
    far_m: Array
    length_m: Array
    reason: Codes


def _corners(camera: Camera) -> Array:
    """(6, 2) outer corners from top-left around, then the middles of the upper and the lower edge."""
    right, bottom = camera.width_px - 0.5, camera.height_px - 0.5
    middle = (right - 0.5) / 2
    return np.array([[-0.5, -0.5], [right, -0.5], [right, bottom], [-0.5, bottom], [middle, -0.5], [middle, bottom]])


def ground_footprint(inputs: Inputs) -> Result:
    """Area, m^2, and sides, m, of the ground in the picture.

    Source: similar triangles on bent, sloping ground; see the module.
    """
    met = meet(inputs, stand(inputs), inputs.camera.rays(_corners(inputs.camera)), np.zeros(()))
    x, y = met.x_m[..., :4], met.y_m[..., :4]
    area = abs(np.sum(x * np.roll(y, -1, -1) - y * np.roll(x, -1, -1), -1)) / 2
    return Result(area, met.apart_m(3, 2), met.apart_m(0, 1), met.apart_m(4, 5), met.worst)


def notes(inputs: Inputs, _: Result) -> tuple[Note, ...]:
    """Those of the ground."""
    return ground_notes(inputs, Observation(_corners(inputs.camera), 0.0), np.zeros(()))


def example() -> Inputs:
    """From a drone 40 m above the ground that looks down by 60 degrees."""
    camera = Camera(4000, 2250, 2300.0, 1999.5, 1124.5, cov=np.diag([30.0**2, 0, 20.0**2, 20.0**2]))
    return Inputs(
        camera=camera, height=Quantity.normal(40.0, 1.0, "m"), pitch=Quantity.normal(-math.radians(60), math.radians(0.5), "rad"),
        roll=Quantity.normal(0.0, math.radians(0.5), "rad"),
    )  # fmt: skip


METHOD = Method(
    name="ground_footprint",
    title="the ground that an air photo shows",
    inputs=Inputs,
    outputs=(Output("area_m2", "area", "m2", "area of the footprint"), Output("near_m", "near_width", "m", "along the lower edge"),
             Output("far_m", "far_width", "m", "along the upper edge"),
             Output("length_m", "length", "m", "between the middles of these edges")),
    function=ground_footprint,
    assumes=("the ground is a plane of the stated slope, bent with the earth", "the lens draws the picture's edges straight",
             "the height is that of the entrance pupil, above the ground at the camera's foot"),
    source="similar triangles; the shoelace rule",
    typical="4 to 10 % of the area by a drone's own height",
    example=example,
    most_draws=200_000,
    button="Footprint",
    notes=notes,
)  # fmt: skip
