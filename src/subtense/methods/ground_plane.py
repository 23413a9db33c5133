"""Distance to a point on the ground, from the camera's height and how it stands.

From a height h a line of sight that falls by an angle a below the horizon meets level ground at h / tan(a). The angle is had from
pitch and roll, from the horizon in the picture, or from level lines that run side by side in it; slope, curvature of the earth and
refraction are in `ground`. Far away everything rests on the angle: at 20 m from a height of 1.6 m, 1° of pitch is 28 %.

Source: similar triangles; A. Criminisi, I. Reid, A. Zisserman, Single View Metrology, IJCV 2000, for height and horizon.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from ..arrays import Array, Codes
from ..camera import Camera
from ..ground import Met, Standing, ground_notes, meet, nothing, stand, with_standing
from ..method import Method, Output
from ..observation import Observation
from ..quantity import Note, Quantity


@with_standing
@dataclass(frozen=True, kw_only=True)
class Inputs(Standing):
    """A camera of known height above the ground, how it stands, and a point on the ground in its picture.

    Attributes:
        foot: the point.
        point_height: of the point above the ground, m; 0.
        above: how far straight above that point what is wanted is, m; 0.
    """

    foot: Observation = field(metadata={"points": 1})
    point_height: Quantity = field(default_factory=nothing, metadata={"unit": "m", "signed": True})
    above: Quantity = field(default_factory=nothing, metadata={"unit": "m", "signed": True})


@dataclass(frozen=True)
class Result:
    """Arrays (...): level distance from the camera's foot, range from the entrance pupil, depth along the axis."""

    ground_distance_m: Array
    range_m: Array
    depth_m: Array
    reason: Codes


def ground_plane(inputs: Inputs) -> Result:
    """Where the line of sight meets the ground, m.

    Source: similar triangles on bent, sloping ground; see `ground`.
    """
    met, up = _met(inputs)
    if not np.any(inputs.above.value):
        return Result(met.ground_distance_m[..., 0], met.range_m[..., 0], met.depth_m[..., 0], met.worst)
    above = np.asarray(inputs.above.value)
    level, depth = met.ground_distance_m[..., 0], met.depth_m[..., 0] + above * up[..., 2]
    return Result(level, np.hypot(level, met.z_m[..., 0] + above), depth, met.worst)


def place(inputs: Inputs) -> Array:
    """(..., 3) what is wanted, in the camera's frame, m."""
    met, up = _met(inputs)
    there = inputs.camera.rays(inputs.foot.points_px)[..., 0, :] * met.range_m
    return np.asarray(there + np.asarray(inputs.above.value)[..., None] * up)


def _met(inputs: Inputs) -> tuple[Met, Array]:
    """Where the line of sight meets the ground, and which way is up."""
    found = stand(inputs)
    rays = inputs.camera.rays(inputs.foot.points_px)
    return meet(inputs, found, rays, np.asarray(inputs.point_height.value)[..., None]), found.level.up


def notes(inputs: Inputs, _: Result) -> tuple[Note, ...]:
    """Those of the ground."""
    return ground_notes(inputs, inputs.foot, np.asarray(inputs.point_height.value)[..., None])


def example() -> Inputs:
    """A foot point some 12 m away, from a camera 1.6 m above the ground that looks down by 5 degrees."""
    camera = Camera(1600, 1200, 1500.0, 799.5, 599.5, cov=np.diag([15.0**2, 0, 6.0**2, 6.0**2]))
    return Inputs(
        camera=camera, height=Quantity.interval(1.6, 0.02, "m"), pitch=Quantity.normal(-math.radians(5), math.radians(0.2), "rad"),
        roll=Quantity.normal(0.0, math.radians(0.2), "rad"), slope=Quantity.normal(0.0, 0.002, "rad"),
        cross_slope=Quantity.normal(0.0, 0.002, "rad"), foot=Observation(np.array([[900.0, 670.0]])),
    )  # fmt: skip


METHOD = Method(
    name="ground_plane",
    title="a point on the ground, from the camera's height and pitch",
    inputs=Inputs,
    outputs=(Output("ground_distance_m", "ground_distance", "m", "ground distance (level, from the camera's foot)"),
             Output("range_m", "range", "m", "range (from the entrance pupil)"),
             Output("depth_m", "depth", "m", "depth (along the axis)", nonnegative=False)),
    function=ground_plane,
    assumes=("the point is on the ground, or as high above it as stated", "the ground is a plane of the stated slope, bent with the earth",
             "the height is that of the entrance pupil, above the ground at the camera's foot",
             "the picture is not cropped or edited after the camera's numbers were taken"),
    source="similar triangles; A. Criminisi, I. Reid, A. Zisserman, IJCV 2000",
    typical="1 to 5 % up to 10 heights away, 28 % for 1° of pitch at 12 heights",
    example=example,
    most_draws=200_000,
    button="Ground point",
    place=place, notes=notes,
)  # fmt: skip
