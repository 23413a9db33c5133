"""Length between two points on the ground, from the camera's height and how it stands.

Both lines of sight meet the ground as in `ground`; what they have in common (height, pitch, slope, camera) moves both. Points that
are nearer to each other than three of their u are not resolved: that they are apart at all is not shown.

Source: similar triangles on bent, sloping ground.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from ..arrays import Array, Codes
from ..camera import Camera
from ..ground import Standing, ground_notes, meet, nothing, stand, with_standing
from ..method import Method, Output
from ..observation import Observation
from ..quantity import Note, Quantity


@with_standing
@dataclass(frozen=True, kw_only=True)
class Inputs(Standing):
    """A camera of known height above the ground, how it stands, and two points on the ground in its picture.

    Attributes:
        ends: the two points.
        first_height: of the first above the ground, m; 0.
        second_height: of the second, m; 0.
    """

    ends: Observation = field(metadata={"points": 2})
    first_height: Quantity = field(default_factory=nothing, metadata={"unit": "m", "signed": True})
    second_height: Quantity = field(default_factory=nothing, metadata={"unit": "m", "signed": True})


@dataclass(frozen=True)
class Result:
    """Arrays (...): straight length between the points."""

    length_m: Array
    reason: Codes


def _heights(inputs: Inputs) -> Array:
    """(..., 2) of the two points above the ground."""
    both = (np.asarray(inputs.first_height.value, float), np.asarray(inputs.second_height.value, float))
    return np.stack(np.broadcast_arrays(*both), -1)


def ground_length(inputs: Inputs) -> Result:
    """Straight length between two points on the ground, m.

    Source: similar triangles on bent, sloping ground; see `ground`.
    """
    met = meet(inputs, stand(inputs), inputs.camera.rays(inputs.ends.points_px), _heights(inputs))
    return Result(met.apart_m(), met.worst)


def notes(inputs: Inputs, _: Result) -> tuple[Note, ...]:
    """Those of the ground."""
    return ground_notes(inputs, inputs.ends, _heights(inputs))


def example() -> Inputs:
    """Two points 8 m apart on the ground, from a drone 40 m above it that looks straight down."""
    camera = Camera(4000, 2250, 2300.0, 1999.5, 1124.5, cov=np.diag([30.0**2, 0, 20.0**2, 20.0**2]))
    return Inputs(
        camera=camera, height=Quantity.normal(40.0, 1.0, "m"), pitch=Quantity.normal(-math.radians(90), math.radians(0.5), "rad"),
        roll=Quantity.normal(0.0, math.radians(0.5), "rad"), ends=Observation(np.array([[1500.0, 900.0], [1930.0, 1080.0]])),
    )  # fmt: skip


METHOD = Method(
    name="ground_length",
    title="between two points on the ground",
    inputs=Inputs,
    outputs=(Output("length_m", "length", "m", "length between the points"),),
    function=ground_length,
    assumes=("both points are on the ground, or as high above it as stated", "the ground is a plane of the stated slope, bent with the "
             "earth", "the height is that of the entrance pupil, above the ground at the camera's foot",
             "the picture is not cropped or edited after the camera's numbers were taken"),
    source="similar triangles; A. Criminisi, I. Reid, A. Zisserman, IJCV 2000",
    typical="1 to 5 % from above, as ground_plane from the side",
    example=example,
    most_draws=200_000,
    button="Ground length",
    notes=notes,
)  # fmt: skip
