"""Ground: a camera above ground that is level or of known slope, and where a line of sight meets it.

The ground is a plane with a slope through the camera's foot, bent with the earth: at a place x to the right and y ahead of the foot it
lies at  z = x tan(cross slope) + y tan(slope) - (x^2 + y^2) / (2 R'),  with R' = R / (1 - k) the radius of an earth on which rays bent
by refraction are straight. A point at t along the unit direction d, from a camera at height h, is at z = h + t d_z, so

    t^2 (d_x^2 + d_y^2) / (2 R')  -  t g  +  (h - rise - point height) = 0,   g = d_x tan(cross slope) + d_y tan(slope) - d_z

with g the rate at which the line of sight falls to the ground. Where there is no root the line of sight passes above the horizon.

Source: similar triangles; curvature and refraction: W. Torge, Geodesy, 5.1.2 (k = 0.13). The parabola stands for the sphere to 1e-4
of a height up to 100 km away.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import ClassVar, TypeVar

import numpy as np

from .arrays import Array, Bools, Codes
from .camera import Camera
from .errors import InputError
from .horizon import Level, dip_rad, effective_radius_m, level_from_angles, level_from_horizon, level_from_parallels
from .method import Reason, reasons
from .observation import Observation
from .quantity import Note, Quantity

LEVEL_GROUND_RAD = 0.01
"""u of the slope, each way, of ground of which nothing was said: 1 %, as of paved places; open country has more."""
REFRACTION, U_REFRACTION = 0.13, 0.13
"""Coefficient of refraction; by day, metres above the ground. Close to hot ground it may be far from it, even negative."""
CURVED_BEYOND_M = 500.0
"""Distance beyond which the note `earth_curvature` tells what the earth's curvature does."""
LEANING_RAD = math.radians(8.0)
"""Roll of a marked horizon, or of level lines, beyond which they are doubted: pictures are held straighter."""
NEAR_HORIZON = 3.0
"""Of u of the angle below the horizon: a point nearer to the horizon is noted."""
SETTLED_PASSES = 3
"""Passes that find the height from a reference on bent ground, or from a horizon whose dip depends on it."""


def level_ground() -> Quantity:
    """The slope of ground of which nothing was said."""
    return Quantity.normal(0.0, LEVEL_GROUND_RAD, "rad", "assumed: level ground, to 1 % (1s)")


def refraction() -> Quantity:
    """The coefficient of refraction of light near the ground."""
    return Quantity.normal(REFRACTION, U_REFRACTION, "1", "assumed: refraction 0.13, and as much for its u")


def nothing() -> Quantity:
    """A height of 0: on the ground."""
    return Quantity.exact(0.0, "m", "on the ground")


def level_roll() -> Quantity:
    """The roll of a camera of which nothing was said: held level by eye."""
    return Quantity.normal(0.0, math.radians(1.5), "rad", "assumed: held level to 1.5° (1s)")


def either_horizon() -> Quantity:
    """What was marked as the horizon: a vanishing line, or the visible edge of the earth, which lies lower."""
    return Quantity.uniform(0.0, 1.0, "1", "assumed: between a vanishing line and the visible horizon")


STANDING = """
        camera: of the upright picture.
        height: of the camera's entrance pupil above the ground at its foot, m; or a reference with its length.
        pitch: of the optical axis above the horizon, rad; -90° looks straight down. Or horizon, or parallels.
        roll: right side down, rad; with horizon and parallels only where these leave it open.
        horizon: two or more points of the horizon, or one with a known roll.
        parallels: two points of a level line and two of one parallel to it; best the same of a second pair in another direction.
        reference: two points on the ground, a known length apart, which give the height.
        reference_length: how far apart these are, m.
        dip: 0 where `horizon` is a vanishing line, 1 where it is the visible edge of a sea or plain.
        slope: of the ground, rising ahead, rad.
        cross_slope: of the ground, rising to the right, rad.
        rise: of the ground there above the ground that `height` counts from, m.
        refraction: coefficient of the refraction of light, k.
"""


One = TypeVar("One")


def with_standing(cls: type[One]) -> type[One]:
    """The class, its docstring with the attributes of `Standing` before its own."""
    cls.__doc__ = (cls.__doc__ or "").replace("Attributes:\n", f"Attributes:{STANDING}", 1)
    return cls


@with_standing
@dataclass(frozen=True, kw_only=True)
class Standing:
    """A camera above the ground, and how it stands: the fields that all methods on the ground share.

    Attributes:
    """

    camera: Camera
    height: Quantity | None = field(default=None, metadata={"unit": "m"})
    pitch: Quantity | None = field(default=None, metadata={"unit": "rad", "signed": True})
    roll: Quantity = field(default_factory=level_roll, metadata={"unit": "rad", "signed": True})
    horizon: Observation | None = None
    parallels: Observation | None = None
    reference: Observation | None = None
    reference_length: Quantity | None = field(default=None, metadata={"unit": "m"})
    dip: Quantity = field(default_factory=either_horizon, metadata={"unit": "1"})
    slope: Quantity = field(default_factory=level_ground, metadata={"unit": "rad", "signed": True})
    cross_slope: Quantity = field(default_factory=level_ground, metadata={"unit": "rad", "signed": True})
    rise: Quantity = field(default_factory=nothing, metadata={"unit": "m", "signed": True})
    refraction: Quantity = field(default_factory=refraction, metadata={"unit": "1"})

    one_of: ClassVar[tuple[tuple[str, ...], ...]] = (("pitch", "horizon", "parallels"), ("height", "reference"))
    """Of each group one is needed."""

    def __post_init__(self) -> None:
        said = [name for name in ("pitch", "horizon", "parallels") if getattr(self, name) is not None]
        if len(said) != 1:
            raise InputError(
                "pitch", " and ".join(said) or None, "give one of: the pitch with its ±, horizon, parallels"
            )
        if (self.height is None) == (self.reference is None):
            raise InputError("height", None if self.height is None else "there beside a reference",
                             "give either the camera's height above the ground, or a reference with its length")  # fmt: skip
        if (self.reference is None) != (self.reference_length is None):
            raise InputError("reference", "alone", "give its two points and their distance, reference_length")
        _check_points("horizon", self.horizon, range(1, 10_001), "one point with a known roll, or two or more")
        _check_points("parallels", self.parallels, (4, 8), "4 points of two parallel lines, or 8 of two pairs")
        _check_points("reference", self.reference, (2,), "2 points on the ground")
        for name in ("horizon", "reference"):
            seen = getattr(self, name)
            if seen is not None and seen.points_px.shape[-2] > 1 and not np.any(np.ptp(seen.points_px, axis=-2)):
                raise InputError(name, "one point several times", "give points that lie apart")
        for name in ("height", "reference_length"):
            length = getattr(self, name)
            if length is not None and np.ndim(length.value) == 0 and not float(length.value) > 0:
                raise InputError(name, f"{float(length.value):g} m", "give a length above 0")


def _check_points(name: str, seen: Observation | None, counts: range | tuple[int, ...], allowed: str) -> None:
    if seen is not None and seen.points_px.shape[-2] not in counts:
        raise InputError(name, f"{seen.points_px.shape[-2]} points", f"give {allowed}")


@dataclass(frozen=True, eq=False)
class Met:
    """Where lines of sight meet the ground; arrays (..., N).

    Attributes:
        range_m: along the line of sight, from the entrance pupil.
        x_m: level, to the right.
        y_m: level, ahead.
        z_m: above the camera; below it, negative.
        depth_m: along the optical axis.
        reason: codes of Reason.
    """

    range_m: Array
    x_m: Array
    y_m: Array
    z_m: Array
    depth_m: Array
    reason: Codes

    @property
    def ground_distance_m(self) -> Array:
        """(..., N) level distance from the camera's foot."""
        return np.asarray(np.hypot(self.x_m, self.y_m))

    def apart_m(self, one: int = 0, other: int = 1) -> Array:
        """(...) straight distance between two of the points."""
        steps = [a[..., other] - a[..., one] for a in (self.x_m, self.y_m, self.z_m)]
        return np.asarray(np.sqrt(sum(step * step for step in steps)))

    @property
    def worst(self) -> Codes:
        """(...) the first reason of any point that has no answer."""
        return np.asarray(np.max(self.reason, axis=-1), np.int8)


@dataclass(frozen=True, eq=False)
class Stand:
    """A camera above the ground, settled: its level frame and its height (...), m."""

    level: Level
    height_m: Array


def stand(inputs: Standing) -> Stand:
    """How the camera stands: up from its angles, its horizon or its parallels; its height as told, or from the reference."""
    if inputs.height is not None:
        told = np.asarray(inputs.height.value, float)
        return Stand(_level(inputs, told), told)
    assert inputs.reference is not None and inputs.reference_length is not None
    length = np.asarray(inputs.reference_length.value)
    rays = inputs.camera.rays(inputs.reference.points_px)
    height: Array = np.ones(())
    for _ in range(SETTLED_PASSES):
        found = Stand(_level(inputs, height), height)
        with np.errstate(divide="ignore", invalid="ignore"):
            height = height * length / meet(inputs, found, rays, np.zeros(())).apart_m()
    return Stand(_level(inputs, height), height)


def _level(inputs: Standing, height_m: Array) -> Level:
    roll = np.asarray(inputs.roll.value)
    if inputs.horizon is not None:
        dip = np.asarray(inputs.dip.value) * dip_rad(height_m, np.asarray(inputs.refraction.value))
        return level_from_horizon(inputs.camera.rays(inputs.horizon.points_px), dip, roll)
    if inputs.parallels is not None:
        return level_from_parallels(inputs.camera.rays(inputs.parallels.points_px), roll)
    assert inputs.pitch is not None
    return level_from_angles(np.asarray(inputs.pitch.value), roll)


def meet(inputs: Standing, place: Stand, rays: Array, above_m: Array) -> Met:
    """Where lines of sight meet the ground, or a height above it.

    Args:
        inputs: slopes, rise and refraction.
        place: of the camera.
        rays: (..., N, 3) unit vectors in the camera's frame.
        above_m: (..., N) or (...) height of the points above the ground.
    """
    level = place.level
    x, y, z = (np.sum(rays * axis[..., None, :], -1) for axis in (level.right, level.ahead, level.up))
    ahead, across = (np.tan(np.asarray(s.value))[..., None] for s in (inputs.slope, inputs.cross_slope))
    falls = across * x + ahead * y - z
    rise = np.asarray(inputs.rise.value)[..., None]
    height = place.height_m[..., None] - rise - above_m
    bend = (x * x + y * y) / (2 * effective_radius_m(np.asarray(inputs.refraction.value)))[..., None]
    with np.errstate(invalid="ignore", divide="ignore"):
        inner = falls * falls - 4 * bend * height
        root = np.where(falls < 0, -1.0, 1.0) * np.sqrt(inner)
        t = 2 * height / (falls + root)
    code = _reasons(rays, falls, height, inner, t)
    t = np.where(code == 0, t, np.nan)
    return Met(t, t * x, t * y, t * z, t * rays[..., 2], code)


def _reasons(rays: Array, falls: Array, height: Array, inner: Array, t: Array) -> Codes:
    """Above the camera's height a point is seen above the horizon, and below it below."""
    level = (height > 0) & ~((falls > 0) & (inner >= 0))
    lower = (height < 0) & ~(falls < 0)
    crossed: Bools = np.asarray((falls > 0) & (height < 0))
    return reasons(
        t.shape, (np.asarray(~np.isfinite(rays).all(axis=-1)), Reason.NOT_INVERTIBLE), (crossed, Reason.BEHIND_CAMERA),
        (level | lower | (height == 0), Reason.AT_OR_ABOVE_HORIZON), (~np.isfinite(t), Reason.OUT_OF_RANGE),
    )  # fmt: skip


def ground_notes(inputs: Standing, seen: Observation, above_m: Array) -> tuple[Note, ...]:
    """Doubts of what was assumed, of a horizon that leans or is near, and `earth_curvature`, for points (N) of a nominal scene."""
    place = stand(inputs)
    met = meet(inputs, place, inputs.camera.rays(seen.points_px), above_m)
    found = []
    if inputs.slope.source.startswith("assumed") or inputs.cross_slope.source.startswith("assumed"):
        found.append(Note("slope_assumed", "the ground is taken as level to 1 % (1s) each way; how it slopes is unknown",
                          "state it with its ±, as slope 0 ± 0.2 deg on a floor"))  # fmt: skip
    if inputs.roll.source.startswith("assumed") and inputs.pitch is not None:
        found.append(
            Note(
                "roll_assumed", "the camera is taken as held level to 1.5° (1s)", "state its roll, or mark the horizon"
            )
        )
    if inputs.horizon is not None and inputs.dip.source.startswith("assumed"):
        dip = float(dip_rad(place.height_m, np.asarray(inputs.refraction.value)))
        text = ("the line marked is taken for the horizon of level ground, and hills are higher; whether it is a vanishing line or the "
                f"visible horizon, {math.degrees(dip):.2g}° lower, is in u")  # fmt: skip
        found.append(Note("horizon_assumed", text, "state dip: 0 for a vanishing line, 1 for the visible horizon"))
    lean = abs(float(place.level.roll_rad))
    if inputs.pitch is None and lean > LEANING_RAD:
        text = f"by the points marked the camera leans by {math.degrees(lean):.0f}° to a side; few pictures do"
        found.append(Note("horizon_leans", text, "check the points, and which lines are parallel and level"))
    return (*found, *_near_horizon(inputs, met), *_curvature(inputs, met))


def _near_horizon(inputs: Standing, met: Met) -> tuple[Note, ...]:
    below = float(np.min(np.arctan2(-met.z_m, met.ground_distance_m)))
    tilt = 0.0 if inputs.pitch is None else float(inputs.pitch.u)
    u = math.hypot(tilt, float(inputs.slope.u))
    if not 0 <= below < NEAR_HORIZON * u:
        return ()
    text = f"only {math.degrees(below):.2g}° below the horizon, which is known to {math.degrees(u):.2g}° (1s): the distance is hardly known"
    return (Note("near_horizon", text, "mark the horizon, raise the camera, or state pitch and slope more closely"),)


def _curvature(inputs: Standing, met: Met) -> tuple[Note, ...]:
    far = float(np.max(met.ground_distance_m))
    if not far > CURVED_BEYOND_M:
        return ()
    drop = far**2 / (2 * float(effective_radius_m(np.asarray(inputs.refraction.value))))
    text = f"at {far:.0f} m the earth's curvature, less refraction, lowers the ground by {drop:.2g} m; this is taken into account"
    return (Note("earth_curvature", text, "give the refraction coefficient if it is known"),)
