"""Range and depth of a point from the number that a depth map has there.

A map is a product, made by a network, a sensor or a program, and no number that a method could move. What is doubtful about it is offered
as scale, shift and a factor: with v the map's number and x = shift + scale (v - pivot), the depth along the axis is x, or 1/x where the
map is of disparity, times exp(log_factor); where the map was made for a focal length, times f / focal. The range is the depth over
the cosine of the line of sight to the axis.

Source: alignment of scale and shift, in disparity where the map is of it: R. Ranftl et al., PAMI 2022; the canonical camera: W. Yin et al.,
Metric3D, ICCV 2023.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..arrays import Array, Codes
from ..camera import Camera
from ..errors import InputError
from ..method import Method, Output, Reason, reasons
from ..observation import Observation
from ..quantity import Quantity

SPACES = ("depth", "disparity")


def one() -> Quantity:
    """The map's numbers are depths in metres."""
    return Quantity.exact(1.0, "1", "the map's own scale")


def nothing() -> Quantity:
    """No shift."""
    return Quantity.exact(0.0, "1", "no shift")


@dataclass(frozen=True)
class Inputs:
    """A camera, a point, and the map's number at it.

    Attributes:
        camera: of the upright picture.
        point: one point.
        map_value: the map's number there; depth in metres, or whatever scale and shift make metres, or 1/m, of.
        map_scale: depth (or 1/depth) per number; 1.
        map_shift: depth (or 1/depth) where the map's number is the pivot; 0.
        map_pivot: a number of the map; 0.
        log_factor: natural logarithm of a factor that all depths share; 0.
        focal: focal length for which the depths hold, px; where given, they grow with the camera's.
        space: "depth", or "disparity" where the map is of 1/depth.
    """

    camera: Camera
    point: Observation = field(metadata={"points": 1})
    map_value: Quantity = field(metadata={"unit": "1"})
    map_scale: Quantity = field(default_factory=one, metadata={"unit": "1"})
    map_shift: Quantity = field(default_factory=nothing, metadata={"unit": "1"})
    map_pivot: Quantity = field(default_factory=nothing, metadata={"unit": "1"})
    log_factor: Quantity = field(default_factory=nothing, metadata={"unit": "1"})
    focal: Quantity | None = field(default=None, metadata={"unit": "px"})
    space: str = "depth"

    def __post_init__(self) -> None:
        if self.space not in SPACES:
            raise InputError("space", self.space, "give depth or disparity")
        if self.focal is not None and not np.all(np.asarray(self.focal.value) > 0):
            raise InputError("focal", self.focal.value, "give a focal length above 0")


@dataclass(frozen=True)
class Result:
    """Arrays (...): range from the entrance pupil, and depth along the axis."""

    range_m: Array
    depth_m: Array
    reason: Codes


def _depth(inputs: Inputs) -> Array:
    """(...) m; infinite or negative where the map's number has no depth."""
    moved = np.asarray(inputs.map_value.value) - np.asarray(inputs.map_pivot.value)
    x = np.asarray(inputs.map_shift.value) + np.asarray(inputs.map_scale.value) * moved
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        depth = (1 / x if inputs.space == "disparity" else x) * np.exp(np.asarray(inputs.log_factor.value))
        if inputs.focal is not None:
            depth = depth * np.asarray(inputs.camera.f_px) / np.asarray(inputs.focal.value)
    return np.asarray(depth)


def place(inputs: Inputs) -> Array:
    """(..., 3) the point in the camera's frame, m; NaN without an answer."""
    ray = inputs.camera.rays(inputs.point.points_px)[..., 0, :]
    result = depth_map(inputs)
    return np.asarray(ray * result.range_m[..., None])


def depth_map(inputs: Inputs) -> Result:
    """Range and depth of the point, m.

    Source: see the module.
    """
    ray = inputs.camera.rays(inputs.point.points_px)[..., 0, :]
    depth = _depth(inputs)
    forward = ray[..., 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        range_m = depth / forward
    range_m, depth = np.broadcast_arrays(range_m, depth)
    wrong = ~(np.isfinite(depth) & (depth > 0))
    beyond = wrong if inputs.space == "disparity" else np.zeros_like(wrong)
    code = reasons(
        range_m.shape, (np.asarray(~np.isfinite(forward)), Reason.NOT_INVERTIBLE),
        (np.asarray(forward <= 0), Reason.BEHIND_CAMERA), (beyond, Reason.OUT_OF_RANGE), (wrong, Reason.BEHIND_CAMERA),
    )  # fmt: skip
    nowhere = code != 0
    return Result(np.where(nowhere, np.nan, range_m), np.where(nowhere, np.nan, depth), code)


def example() -> Inputs:
    """A wall in a map that was anchored by one tape measure, 4 m away and right of the middle."""
    camera = Camera(1600, 1200, 1300.0, 799.5, 599.5, cov=np.diag([10.0**2, 0, 4.0**2, 4.0**2]))
    return Inputs(
        camera, Observation(np.array([[1100.0, 500.0]]), 0.7), Quantity.normal(3.2, 0.1, "1", "stated"),
        map_scale=Quantity.normal(1.25, 0.02, "1", "one anchor"),
    )  # fmt: skip


METHOD = Method(
    name="depth_map",
    title="a depth map's number at a point",
    inputs=Inputs,
    outputs=(Output("range_m", "range", "m", "range (from the entrance pupil)"), Output("depth_m", "depth", "m", "depth (along the axis)")),
    function=depth_map,
    assumes=("the map is of this picture, and its numbers are depths along the axis (or their inverse) up to scale and shift",
             "the error of a single number is as stated; that of neighbouring numbers is taken as independent"),
    source="R. Ranftl et al., PAMI 2022; W. Yin et al., Metric3D, ICCV 2023",
    typical="1 to 3 % of a depth sensor, 5 to 15 % of a network with anchors, 15 to 60 % without",
    example=example,
    place=place,
    most_draws=100_000,
)  # fmt: skip
