"""Distance of a point from its disparity between the two pictures of a rig, and the length between two such points.

The point lies on the left camera's ray of its pixel, as far out as the right camera sees it in the column that the disparity
tells. For rectified pictures that is Z = f B / (d + doffs). The row in the right picture follows from the geometry and is not needed.

An error of the clicked pixel moves both pictures' points alike, so that it hardly enters the distance; what enters is the
disparity's own error, and the rig's.

Source: R. Hartley, A. Zisserman, Multiple View Geometry, 11.12 and 12.1; D. Scharstein et al., High-Resolution Stereo Datasets
with Subpixel-Accurate Ground Truth, GCPR 2014 (doffs).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from ..arrays import Array, Codes
from ..camera import Camera
from ..errors import GeometryError
from ..method import Method, Output, Reason, reasons
from ..observation import Observation
from ..quantity import Quantity
from ..rig import Rig
from ..space import Space

LEAST_U = 3.0
"""Disparities of fewer u tell no distance: the interval's far end would be open, or nearly so."""
STEPS = 5
"""Of the row in a right picture with lens distortion, each ten times closer or better."""


@dataclass(frozen=True, kw_only=True)
class Inputs:
    """A rig, a pixel of its left picture, and how far to the left the right picture shows the same point.

    Attributes:
        rig: two cameras fixed to each other, left and right.
        spot: a pixel of the left picture.
        disparity: column in the left picture less column in the right one, px of the pictures that `rig` is for.
    """

    rig: Rig
    spot: Observation = field(metadata={"points": 1})
    disparity: Quantity = field(metadata={"unit": "px", "signed": True})


@dataclass(frozen=True)
class Result:
    """Arrays (...): range from the left camera's entrance pupil, depth along its axis."""

    range_m: Array
    depth_m: Array
    reason: Codes


def stereo(inputs: Inputs) -> Result:
    """Range and depth of the point from the left camera, m.

    Source: R. Hartley, A. Zisserman, Multiple View Geometry, 12.1; rectified, Z = f B / (d + doffs).
    """
    place, code = _placed(inputs.rig, inputs.spot.points_px[..., 0, :], np.asarray(inputs.disparity.value, float))
    return Result(np.sqrt(np.sum(place * place, axis=-1)), place[..., 2], code)


def located(rig: Rig, spot_px: Array, disparity_px: Array) -> Array:
    """(..., 3) places in the left camera's frame, m; NaN where there is no answer.

    Args:
        rig: the two cameras.
        spot_px: (..., 2) pixels of the left picture.
        disparity_px: (...) column in the left picture less that in the right one.
    """
    return _placed(rig, spot_px, disparity_px)[0]


def _placed(rig: Rig, spot: Array, disparity: Array) -> tuple[Array, Codes]:
    slope = np.stack(np.broadcast_arrays(*rig.left.slopes(spot[..., None, :]), 1.0), -1)[..., 0, :]
    pose = rig.right_from_left
    turned = (pose.rotation @ slope[..., None])[..., 0]
    moved = np.asarray(pose.translation_m)
    column = spot[..., 0] - disparity
    depth, pinhole = np.full((), np.inf), rig.right.lens == "pinhole"
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        row = _row(rig.right, turned, moved, depth)
        for _ in range(1 if pinhole else STEPS):
            x = rig.right.slopes(np.stack(np.broadcast_arrays(column, row), -1)[..., None, :])[0][..., 0]
            parallax = turned[..., 0] - x * turned[..., 2]
            depth = (x * moved[..., 2] - moved[..., 0]) / parallax
            if not pinhole:
                row = _row(rig.right, turned, moved, np.where(depth > 0, depth, np.inf))
        place = slope * depth[..., None]
        ahead = (turned[..., 2] * depth + moved[..., 2]) > 0
    code = reasons(
        np.shape(depth), (np.asarray(~np.isfinite(slope).all(axis=-1) | ~np.isfinite(x)), Reason.NOT_INVERTIBLE),
        (np.asarray(~(depth > 0) | ~np.isfinite(depth)), Reason.NO_PARALLAX), (np.asarray(~ahead), Reason.BEHIND_CAMERA),
    )  # fmt: skip
    return np.where((code == 0)[..., None], place, np.nan), code


def _row(right: Camera, turned: Array, moved: Array, depth: Array) -> Array:
    """(...) the row in which the right camera sees what lies at this depth on the left one's ray."""
    inverse = 1 / depth
    point = turned + moved * np.asarray(inverse)[..., None]
    seen = right.project(point[..., None, :])[..., 0, 1]
    return np.where(np.isfinite(seen), seen, (right.height_px - 1) / 2)


# -- the length between two points -----------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class LengthInputs:
    """A rig, two pixels of its left picture, and the disparity of each.

    Attributes:
        rig: two cameras fixed to each other, left and right.
        ends: two pixels of the left picture.
        first: disparity of the first, px.
        second: disparity of the second, px.
    """

    rig: Rig
    ends: Observation = field(metadata={"points": 2})
    first: Quantity = field(metadata={"unit": "px", "signed": True})
    second: Quantity = field(metadata={"unit": "px", "signed": True})


@dataclass(frozen=True)
class LengthResult:
    """Arrays (...): straight line between the two points."""

    length_m: Array
    reason: Codes


def stereo_length(inputs: LengthInputs) -> LengthResult:
    """Length of the straight line between the two points, m.

    Source: the difference of two triangulated points; see the module.
    """
    ends = inputs.ends.points_px
    one, first = _placed(inputs.rig, ends[..., 0, :], np.asarray(inputs.first.value, float))
    two, second = _placed(inputs.rig, ends[..., 1, :], np.asarray(inputs.second.value, float))
    length = np.sqrt(np.sum((one - two) ** 2, axis=-1))
    code = np.where(first != 0, first, second).astype(np.int8)
    return LengthResult(length, np.broadcast_to(code, length.shape))


# -- whether a disparity tells a distance ----------------------------------------------------------------


def prepare(inputs: Inputs) -> Inputs:
    """The inputs themselves, where the disparity is resolved.

    Raises:
        GeometryError: `disparity_not_resolved`: the parallax is below 3 u, by the disparity and by the rig.
    """
    _check_resolved(inputs)
    return inputs


def prepare_length(inputs: LengthInputs) -> LengthInputs:
    """The same for both ends."""
    for index, disparity in enumerate((inputs.first, inputs.second)):
        spot = Observation(inputs.ends.points_px[..., index : index + 1, :], 0.0)
        _check_resolved(Inputs(rig=inputs.rig, spot=spot, disparity=disparity))
    return inputs


def _check_resolved(inputs: Inputs) -> None:
    """Inverse depth is nearly straight in all that enters, so its u is had at first order."""
    space = Space((inputs,))
    if space.leading:
        return
    nominal = _inverse_depth(inputs)
    if not math.isfinite(nominal):
        return
    variance = 0.0
    for line in space.lines:
        for j in range(line.count):
            moved: dict[object, dict[str, Array]] = {}
            line.put(line.value + line.shift(j), moved)
            (one,) = space.rebuilt(moved)
            variance += (_inverse_depth(one) - nominal) ** 2
    u = math.sqrt(variance) if math.isfinite(variance) else math.inf
    if nominal >= LEAST_U * u:
        return
    farthest = 1 / (nominal + 2 * u) if nominal + 2 * u > 0 else math.inf
    raise GeometryError(
        f"the disparity is only {max(nominal / u, 0):.1f} of its u beyond that of infinitely far points, and 3 are needed; the point is "
        f"farther than about {farthest:.3g} m: come nearer, or use a longer baseline",
        code="disparity_not_resolved",
    )


def _inverse_depth(inputs: Inputs) -> float:
    """1/m; continued through infinity, so that a point at infinity has 0."""
    rig, spot = inputs.rig, inputs.spot.points_px[..., 0, :]
    slope = np.array([*(float(s[..., 0]) for s in rig.left.slopes(spot[..., None, :])), 1.0])
    turned, moved = rig.right_from_left.rotation @ slope, np.asarray(rig.right_from_left.translation_m)
    with np.errstate(divide="ignore", invalid="ignore"):
        row = float(_row(rig.right, turned, moved, np.asarray(np.inf)))
        column = spot[..., 0] - np.asarray(inputs.disparity.value)
        x = float(rig.right.slopes(np.array([[float(column), row]]))[0][0])
    return float((turned[0] - x * turned[2]) / (x * moved[2] - moved[0]))


# -- examples --------------------------------------------------------------------------------------------


def _rig() -> Rig:
    """Two rectified cameras of 640 x 480 px, 120 mm apart."""
    camera = Camera(640, 480, 700.0, 319.5, 239.5, cov=np.diag([1.0, 0.0, 0.0, 0.0]), source="stated")
    return Rig.of_rectified(
        camera, Quantity.normal(0.12, 0.0001, "m", "stated"), Quantity.normal(0.0, 0.1, "px", "stated")
    )


def example() -> Inputs:
    """A point 3 m away, before two cameras 120 mm apart."""
    spot = Observation(np.array([[400.0, 210.0]]), 0.0, source="a pixel, as named")
    return Inputs(rig=_rig(), spot=spot, disparity=Quantity.normal(28.0, 0.2, "px", "matching"))


def example_length() -> LengthInputs:
    """Two points about 3 m away."""
    first, second = (Quantity.normal(d, 0.2, "px", "matching") for d in (28.0, 27.0))
    ends = Observation(np.array([[200.0, 240.0], [430.0, 250.0]]), 0.7)
    return LengthInputs(rig=_rig(), ends=ends, first=first, second=second)


_ASSUMES = (
    "the two pictures were taken at the same moment, or nothing moved between them",
    "the rig is as it was when it was calibrated",
    "the disparity is of one and the same point",
)

METHOD = Method(
    name="stereo",
    title="a point in both pictures of a rig",
    inputs=Inputs,
    outputs=(Output("range_m", "range", "m", "range (from the left entrance pupil)"),
             Output("depth_m", "depth", "m", "depth (along the left axis)")),
    function=stereo,
    assumes=_ASSUMES,
    source="R. Hartley, A. Zisserman, Multiple View Geometry, 12.1",
    typical="Z u(d) / (f B) of the depth, and 0.2 % for the rig",
    example=example,
    button="Stereo",
    prepare=prepare,
    most_draws=100_000,
)  # fmt: skip

LENGTH = Method(
    name="stereo_length",
    title="the length between two points in both pictures of a rig",
    inputs=LengthInputs,
    outputs=(Output("length_m", "length", "m", "length"),),
    function=stereo_length,
    assumes=_ASSUMES,
    source="R. Hartley, A. Zisserman, Multiple View Geometry, 12.1",
    typical="0.5 % of the distance along the line of sight, Z u / f across it",
    example=example_length,
    button="Stereo length",
    prepare=prepare_length,
    most_draws=100_000,
)  # fmt: skip
