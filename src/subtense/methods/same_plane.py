"""A length from a reference length in the same plane, each by its two ends.

In a plane that faces the camera all lengths have one scale:  length = reference * pixels / reference pixels.  A plane with
normal n = (tan a, tan b, 1), turned by a about the picture's vertical and by b about its horizontal axis, is met by the
viewing direction r at r / (n . r) plane distances, which gives both lengths up to that distance, and their ratio without
it. Without a camera the rays are parallel: the foreshortening is the same, the change of scale across the plane is left out.
With a camera the reference also tells where the plane is, and so how far what is measured is away. What stands off the plane by h
towards a camera at the distance H from the plane looks 1 / (1 - h / H) times as long.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from ..arrays import Array, Bools, Codes
from ..assumptions import UNKNOWN_TILT, frontal, unknown_tilt
from ..camera import Camera
from ..errors import InputError
from ..focus import close_focus, thin_lens
from ..lenses import LENSES
from ..method import Method, Output, Reason, reasons
from ..observation import Observation
from ..quantity import Note, Quantity


def in_plane() -> Quantity:
    """What is wanted lies in the reference's plane."""
    return Quantity.exact(0.0, "m", "what is wanted lies in the plane of the reference")


@dataclass(frozen=True)
class Inputs:
    """The two ends of a reference of known length, and the two ends of what is wanted, in one plane.

    Attributes:
        reference: two points.
        ends: two points of what is wanted.
        length: real length of the reference, m.
        turn: of the plane about the picture's vertical axis, rad; positive where the right side is nearer.
        tip: of the plane about the picture's horizontal axis, rad; positive where the lower side is nearer.
        camera: of the upright picture; left out, the rays are taken as parallel.
        off_plane: how far what is wanted stands off the reference's plane, towards the camera, m; needs a camera or
            `camera_height`.
        camera_height: distance of the camera from the plane, m; left out, it is had from the camera and the reference.
    """

    reference: Observation = field(metadata={"points": 2})
    ends: Observation = field(metadata={"points": 2})
    length: Quantity = field(metadata={"unit": "m", "assume": "size"})
    turn: Quantity = field(
        default_factory=frontal, metadata={"unit": "rad", "assume": "angle", "in_photo": unknown_tilt}
    )
    tip: Quantity = field(
        default_factory=frontal, metadata={"unit": "rad", "assume": "angle", "in_photo": unknown_tilt}
    )
    camera: Camera | None = None
    off_plane: Quantity = field(default_factory=in_plane, metadata={"unit": "m"})
    camera_height: Quantity | None = field(default=None, metadata={"unit": "m", "assume": "size"})

    def __post_init__(self) -> None:
        if self.raised and self.camera is None and self.camera_height is None:
            raise InputError("off_plane", float(np.ravel(self.off_plane.value)[0]),
                             "give the camera too, or its distance from the plane with camera_height")  # fmt: skip

    @property
    def raised(self) -> bool:
        """Whether what is wanted may stand off the plane."""
        return bool(np.any(self.off_plane.value) or np.any(self.off_plane.u))


@dataclass(frozen=True)
class DistanceInputs:
    """A camera, the two ends of a reference of known length, and the two ends of something in its plane.

    Attributes:
        camera: of the upright picture.
        reference: two points.
        ends: two points; the distance is that of their middle.
        length: real length of the reference, m.
        turn: of the plane about the picture's vertical axis, rad; positive where the right side is nearer.
        tip: of the plane about the picture's horizontal axis, rad; positive where the lower side is nearer.
        focus: share of the thin-lens extension that is added where the focal length is nominal; 1.
    """

    camera: Camera
    reference: Observation = field(metadata={"points": 2})
    ends: Observation = field(metadata={"points": 2})
    length: Quantity = field(metadata={"unit": "m", "assume": "size"})
    turn: Quantity = field(
        default_factory=frontal, metadata={"unit": "rad", "assume": "angle", "in_photo": unknown_tilt}
    )
    tip: Quantity = field(
        default_factory=frontal, metadata={"unit": "rad", "assume": "angle", "in_photo": unknown_tilt}
    )
    focus: Quantity = field(default_factory=thin_lens, metadata={"unit": "1"})


@dataclass(frozen=True)
class Result:
    """Arrays (...): the wanted length."""

    length_m: Array
    reason: Codes


@dataclass(frozen=True)
class Distance:
    """Arrays (...): range from the entrance pupil and depth of the middle of both ends."""

    range_m: Array
    depth_m: Array
    reason: Codes


def same_plane(inputs: Inputs) -> Result:
    """The wanted length, m.

    Source: similar triangles in a plane; see the module.
    """
    p, q = np.tan(np.asarray(inputs.turn.value)), np.tan(np.asarray(inputs.tip.value))
    known, known_facing = _length(inputs.camera, inputs.reference.points_px, p, q)
    wanted, wanted_facing = _length(inputs.camera, inputs.ends.points_px, p, q)
    factor: Array = np.ones(())
    with np.errstate(divide="ignore", invalid="ignore"):
        length_m = np.asarray(inputs.length.value) * wanted / known
        if inputs.raised or np.any(np.asarray(inputs.off_plane.value)):
            over = _camera_height(inputs, known, p, q)
            factor = np.asarray(1 - np.asarray(inputs.off_plane.value) / over)
            length_m = length_m * factor
    perspective = np.asarray(inputs.camera is not None and not LENSES[inputs.camera.lens].perspective)
    code = reasons(
        length_m.shape, (perspective, Reason.NOT_PINHOLE), (~(known_facing & wanted_facing), Reason.TOO_OBLIQUE),
        (~(np.asarray(inputs.length.value) > 0), Reason.OUT_OF_RANGE), (known == 0, Reason.ZERO_EXTENT),
        (np.asarray(~(factor > 0)), Reason.OUT_OF_RANGE), (wanted == 0, Reason.ZERO_EXTENT),
        (~np.isfinite(length_m), Reason.NOT_INVERTIBLE),
    )  # fmt: skip
    return Result(length_m, code)


def _camera_height(inputs: Inputs, known: Array, p: Array, q: Array) -> Array:
    """(...) distance of the camera from the plane, m."""
    if inputs.camera_height is not None:
        return np.asarray(inputs.camera_height.value, float)
    return np.asarray(np.asarray(inputs.length.value) / known / np.sqrt(1 + p * p + q * q))


def same_plane_distance(inputs: DistanceInputs) -> Distance:
    """Range and depth of the middle of both ends, m.

    Source: the plane is where the reference has its length; see the module.
    """
    middle, known, facing = _middle(inputs)
    range_m, depth = np.sqrt(np.sum(middle * middle, -1)), middle[..., 2]
    perspective = np.asarray(not LENSES[inputs.camera.lens].perspective)
    code = reasons(
        depth.shape, (perspective, Reason.NOT_PINHOLE), (~facing, Reason.TOO_OBLIQUE),
        (~(np.asarray(inputs.length.value) > 0), Reason.OUT_OF_RANGE), (known == 0, Reason.ZERO_EXTENT),
        (~np.isfinite(depth), Reason.NOT_INVERTIBLE),
    )  # fmt: skip
    return Distance(range_m, depth, code)


def place(inputs: DistanceInputs) -> Array:
    """(..., 3) the middle of both ends in the camera's frame, m."""
    return _middle(inputs)[0]


def _middle(inputs: DistanceInputs) -> tuple[Array, Array, Bools]:
    """The middle of both ends (..., 3), the reference's length in plane distances, and whether the plane faces the camera."""
    p, q = np.tan(np.asarray(inputs.turn.value)), np.tan(np.asarray(inputs.tip.value))
    known, known_facing = _length(inputs.camera, inputs.reference.points_px, p, q)
    slope_x, slope_y = inputs.camera.slopes(inputs.ends.points_px)
    along = 1 + p[..., None] * slope_x + q[..., None] * slope_y
    with np.errstate(divide="ignore", invalid="ignore"):
        z = (np.asarray(inputs.length.value) / known)[..., None] / along
        middle = np.stack([np.mean(c, axis=-1) for c in np.broadcast_arrays(slope_x * z, slope_y * z, z)], -1)
        farther = 1 + np.asarray(inputs.focus.value) * (inputs.camera.nominal_focal_m or 0.0) / middle[..., 2]
        return middle * farther[..., None], known, known_facing & np.all(~(along <= 0), axis=-1)


def _length(camera: Camera | None, points_px: Array, p: Array, q: Array) -> tuple[Array, Bools]:
    """Distance of two points in the plane, in plane distances (in pixels without a camera), and whether they lie before it."""
    p, q = p[..., None], q[..., None]
    if camera is None:
        x, y = points_px[..., 0], points_px[..., 1]
        z = -(p * x + q * y)
        facing = np.ones(np.broadcast_shapes(x.shape, z.shape)[:-1], bool)
    else:
        slope_x, slope_y = camera.slopes(points_px)
        along = 1 + p * slope_x + q * slope_y
        with np.errstate(divide="ignore", invalid="ignore"):
            z = 1 / along
        x, y, facing = slope_x * z, slope_y * z, np.all(~(along <= 0), axis=-1)
    dx, dy, dz = (c[..., 1] - c[..., 0] for c in np.broadcast_arrays(x, y, z))
    return np.asarray(np.sqrt(dx * dx + dy * dy + dz * dz)), facing


def notes(inputs: Inputs, _: Result) -> tuple[Note, ...]:
    """`frontal_assumption`, `unknown_tilt`, `parallel_rays` and `off_plane`."""
    found = _tilt_notes(inputs)
    if inputs.camera is None:
        found.append(Note("parallel_rays", "without a camera the change of scale across a turned plane is not in the interval",
                          "give the camera, or lay the reference beside what is wanted"))  # fmt: skip
    if inputs.raised:
        found.append(Note("off_plane", f"what is measured stands {1000 * float(inputs.off_plane.value):.3g} mm off the plane of the "
                          "reference, and is corrected for that", "lay the reference at the height of what is measured"))  # fmt: skip
    return tuple(found)


def distance_notes(inputs: DistanceInputs, result: Distance) -> tuple[Note, ...]:
    """`frontal_assumption`, `unknown_tilt` and `close_focus`."""
    note = close_focus(inputs.camera.nominal_focal_m, float(result.depth_m), inputs.focus)
    return (*_tilt_notes(inputs), *((note,) if note else ()))


def _tilt_notes(inputs: Inputs | DistanceInputs) -> list[Note]:
    found: list[Note] = []
    angles = (inputs.turn, inputs.tip)
    exact = [not (float(angle.value) or float(angle.u)) for angle in angles]
    assumed = [angle.source.startswith("assumed") for angle in angles]
    if any(angle.source.startswith(UNKNOWN_TILT) for angle in angles):
        found.append(Note("unknown_tilt", "how the plane is turned is unknown; up to 20° each way is in the interval",
                          "hold the camera square to the plane and state it, as in 0 ± 3 deg, or lay the reference beside what "
                          "is wanted and in its direction"))  # fmt: skip
    elif all(exact) or any(a and e for a, e in zip(assumed, exact, strict=True)):
        cost = 100 * (1 / math.cos(math.radians(20)) - 1)
        but = "" if all(exact) else "but for what is stated, "
        found.append(Note("frontal_assumption", f"{but}the plane is taken to face the camera; turned by 20° a length across the turn "
                          f"is off by up to {cost:.0f} % against one along it", "state how far it may be turned"))  # fmt: skip
    return found


def example() -> Inputs:
    """A bank card of 85.6 mm, 800 px long, beside something 1200 px long, in a plane within 5 degrees of facing the camera."""
    camera = Camera(4000, 3000, 3000.0, 1999.5, 1499.5, cov=np.diag([30.0**2, 0, 20.0**2, 20.0**2]))
    within = Quantity.uniform(-math.radians(5), math.radians(5), "rad")
    return Inputs(
        Observation(np.array([[1000.0, 1500.0], [1800.0, 1500.0]]), label="reference"),
        Observation(np.array([[2000.0, 900.0], [2000.0, 2100.0]]), label="what is wanted"),
        Quantity.uniform(0.08547, 0.08572, "m"), within, within, camera,
    )  # fmt: skip


def example_distance() -> DistanceInputs:
    """The distance of something in the plane of a bank card."""
    one = example()
    assert one.camera is not None
    return DistanceInputs(one.camera, one.reference, one.ends, one.length, one.turn, one.tip)


METHOD = Method(
    name="same_plane",
    title="a length beside a reference in the same plane",
    inputs=Inputs,
    outputs=(Output("length_m", "length", "m", "length"),),
    function=same_plane,
    assumes=("both lie in one plane: a reference lying higher than what is measured makes it read too small",
             "the plane is turned as stated", "the lens draws without distortion where no camera is given"),
    source="similar triangles in a plane; R. Hartley, A. Zisserman, Multiple View Geometry, 8.1.1",
    typical="0.3 to 1 % square to the plane, 2 to 6 % by eye",
    example=example,
    button="Same plane",
    notes=notes,
)  # fmt: skip

DISTANCE = Method(
    name="same_plane_distance",
    title="distance of something beside a reference in the same plane",
    inputs=DistanceInputs,
    outputs=(Output("range_m", "range", "m", "range (from the entrance pupil)"), Output("depth_m", "depth", "m", "depth (along the axis)")),
    function=same_plane_distance,
    assumes=("both lie in one plane", "the plane is turned as stated",
             "the picture is not cropped or edited after the camera's numbers were taken"),
    source="similar triangles in a plane; R. Hartley, A. Zisserman, Multiple View Geometry, 8.1.1",
    typical="1 to 3 % square to the plane, 2 to 6 % by eye",
    example=example_distance,
    button="Beside a reference",
    place=place,
    notes=distance_notes,
)  # fmt: skip
