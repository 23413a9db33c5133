"""The classical relation between focal length, sensor, picture, size and distance, solved for any one of them.

With f_px = f * W_px / sensor width:  distance = size * f_px / extent.  The other values follow from the same relation.
A tilted object, and one off the axis, obey |Z a + L sin(t) b| = L cos(t), see `known_size`; without tilt that is the
relation above, whatever the place in the picture. The distance is the depth along the axis; the range is the straight
line from the entrance pupil. A thin lens focused on the object would put it one focal length farther: `focus` is the
share of that which is added (0, and up to 1 as a one-sided limit, where the classical value is the headline).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..arrays import Array, Codes
from ..assumptions import frontal
from ..errors import InputError
from ..focus import classical, close_focus
from ..geometry import segment_depth
from ..method import Method, Output, Reason, reasons
from ..quantity import Note, Quantity

UNKNOWNS = ("distance", "size", "extent", "focal_length", "sensor_width", "image_width")
"""What can be left out, and is then solved for."""


def centred() -> Quantity:
    """The middle of the picture."""
    return Quantity.exact(0.0, "px", "assumed: in the middle of the picture")


def square_pixels() -> Quantity:
    """Pixels as wide as high."""
    return Quantity.exact(1.0, "1", "square pixels")


@dataclass(frozen=True)
class Inputs:
    """All but one of focal length, sensor width, image width, size, extent and distance.

    Attributes:
        sensor_width: width of the sensor, m; leave it out to solve for it.
        image_width: picture width, px; or leave it out.
        focal_length: m; leave it out to solve for it.
        size: real size of the object, m; or leave it out.
        extent: its length in the picture, px; or leave it out.
        distance: depth along the axis, m; or leave it out.
        along: whether the extent was measured along the "width" or the "height" of the picture.
        aspect: pixel width over pixel height.
        tilt: of the object to the image plane, rad.
        offset_x: of the object's middle from the picture's, px.
        offset_y: the same downwards.
        focus: share of the thin-lens extension that is added.
    """

    sensor_width: Quantity | None = field(default=None, metadata={"unit": "m"})
    image_width: Quantity | None = field(default=None, metadata={"unit": "px"})
    focal_length: Quantity | None = field(default=None, metadata={"unit": "m"})
    size: Quantity | None = field(default=None, metadata={"unit": "m"})
    extent: Quantity | None = field(default=None, metadata={"unit": "px"})
    distance: Quantity | None = field(default=None, metadata={"unit": "m"})
    along: str = "width"
    aspect: Quantity = field(default_factory=square_pixels, metadata={"unit": "1"})
    tilt: Quantity = field(default_factory=frontal, metadata={"unit": "rad"})
    offset_x: Quantity = field(default_factory=centred, metadata={"unit": "px"})
    offset_y: Quantity = field(default_factory=centred, metadata={"unit": "px"})
    focus: Quantity = field(default_factory=classical, metadata={"unit": "1"})

    def __post_init__(self) -> None:
        if self.along not in ("width", "height"):
            raise InputError("along", self.along, "give width or height")
        missing = [name for name in UNKNOWNS if getattr(self, name) is None]
        if len(missing) != 1:
            raise InputError(
                "the unknown", ", ".join(missing) or "nothing", f"leave out exactly one of {', '.join(UNKNOWNS)}"
            )

    @property
    def unknown(self) -> str:
        """The one value that was left out."""
        return next(name for name in UNKNOWNS if getattr(self, name) is None)


@dataclass(frozen=True)
class Result:
    """Arrays (...): the six values of the relation, the solved one among them, and what lies between."""

    distance_m: Array
    range_m: Array
    size_m: Array
    extent_px: Array
    focal_length_m: Array
    sensor_width_m: Array
    image_width_px: Array
    focal_length_px: Array
    sensor_px_per_m: Array
    object_m_per_px: Array
    field_of_view_rad: Array
    angle_rad: Array
    reason: Codes


@dataclass
class _Scene:
    """The inputs as arrays; the unknown is None until it is solved. Lengths in m, pixels as pixels of the width's pitch."""

    focal: Array | None
    size: Array | None
    extent: Array | None
    distance: Array | None
    sensor: Array | None
    image: Array | None
    ex: float  # the extent's direction in the picture
    ey: Array
    ox: Array
    oy: Array
    sine: Array
    cosine: Array
    tilt: Array
    focus: Array

    @property
    def pitch(self) -> Array:
        """Width of a pixel on the sensor, m."""
        assert self.sensor is not None and self.image is not None
        return np.asarray(self.sensor / self.image)


def _value(quantity: Quantity | None) -> Array | None:
    return None if quantity is None else np.asarray(quantity.value, float)


def _scene(inputs: Inputs) -> _Scene:
    aspect, tilt = np.asarray(inputs.aspect.value, float), np.asarray(inputs.tilt.value, float)
    along_width = inputs.along == "width"
    return _Scene(
        _value(inputs.focal_length), _value(inputs.size), _value(inputs.extent), _value(inputs.distance),
        _value(inputs.sensor_width), _value(inputs.image_width),
        1.0 if along_width else 0.0, np.zeros_like(aspect) if along_width else 1 / aspect,
        np.asarray(inputs.offset_x.value), np.asarray(inputs.offset_y.value) / aspect, np.sin(tilt), np.cos(tilt), tilt,
        np.asarray(inputs.focus.value),
    )  # fmt: skip


def _distance(s: _Scene) -> Array:
    assert s.focal is not None and s.size is not None and s.extent is not None
    f = s.focal / s.pitch
    depth, _ = segment_depth(s.ex * s.extent / f, s.ey * s.extent / f, s.ox / f, s.oy / f, s.size, s.tilt)
    return np.asarray(depth + s.focus * s.focal)


def _size(s: _Scene) -> Array:
    """L^2 (cos^2 - sin^2 b^2) - 2 L Z sin ab - Z^2 a^2 = 0."""
    assert s.focal is not None and s.extent is not None and s.distance is not None
    f, z = s.focal / s.pitch, s.distance - s.focus * s.focal
    ax, ay, bx, by = s.ex * s.extent / f, s.ey * s.extent / f, s.ox / f, s.oy / f
    a2, b2, turn = ax * ax + ay * ay, bx * bx + by * by, s.sine * (ax * bx + ay * by)
    lead = s.cosine**2 - s.sine**2 * b2
    return np.asarray(z * (turn + np.sqrt(turn * turn + lead * a2)) / lead)


def _extent(s: _Scene) -> Array:
    """(p Z)^2 + 2 p Z L sin eb + L^2 (sin^2 b^2 - cos^2) = 0 for the slope p of the extent."""
    assert s.focal is not None and s.size is not None and s.distance is not None
    f, z = s.focal / s.pitch, s.distance - s.focus * s.focal
    bx, by, length = s.ox / f, s.oy / f, s.size
    unit = np.sqrt(s.ex**2 + s.ey**2)
    turn = length * s.sine * (s.ex * bx + s.ey * by) / unit
    inner = turn**2 - length**2 * (s.sine**2 * (bx * bx + by * by) - s.cosine**2)
    return np.asarray((np.sqrt(inner) - turn) / z * f / unit)


def _seen_focal(s: _Scene, z: Array) -> Array:
    """Focal length in pixels that draws the object as long as it is: f = |Z E + L sin O| / (L cos)."""
    assert s.size is not None and s.extent is not None
    x = z * s.ex * s.extent + s.size * s.sine * s.ox
    y = z * s.ey * s.extent + s.size * s.sine * s.oy
    return np.asarray(np.hypot(x, y) / (s.size * s.cosine))


def _focal(s: _Scene) -> Array:
    """Z = D - focus f holds the unknown itself: a fixed point, which gains a factor f / D each time."""
    assert s.distance is not None
    f, pitch = np.zeros(()), s.pitch
    for _ in range(12):
        f = _seen_focal(s, s.distance - s.focus * f) * pitch
    return np.asarray(f)


def _sensor_width(s: _Scene) -> Array:
    assert s.focal is not None and s.distance is not None and s.image is not None
    return np.asarray(s.focal * s.image / _seen_focal(s, s.distance - s.focus * s.focal))


def _image_width(s: _Scene) -> Array:
    assert s.focal is not None and s.distance is not None and s.sensor is not None
    return np.asarray(_seen_focal(s, s.distance - s.focus * s.focal) * s.sensor / s.focal)


_SOLVERS = {"distance": _distance, "size": _size, "extent": _extent, "focal_length": _focal,
            "sensor_width": _sensor_width, "image_width": _image_width}  # fmt: skip
_FIELDS = {"distance": "distance", "size": "size", "extent": "extent", "focal_length": "focal", "sensor_width": "sensor",
           "image_width": "image"}  # fmt: skip


def calculator(inputs: Inputs) -> Result:
    """All values of the relation, the unknown among them.

    Source: similar triangles; see the module.
    """
    s, unknown = _scene(inputs), inputs.unknown
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        solved = _SOLVERS[unknown](s)
        setattr(s, _FIELDS[unknown], solved)
        focal, size, extent, distance, sensor = s.focal, s.size, s.extent, s.distance, s.sensor
        assert focal is not None and size is not None and extent is not None and distance is not None
        assert sensor is not None and s.image is not None
        pitch = s.pitch
        f = focal / pitch
        bx, by, ax, ay = s.ox / f, s.oy / f, s.ex * extent / f, s.ey * extent / f
        step = size * s.sine / 4 / distance  # the middle of the 3-D segment: Z b + (half step) a / 2
        mx, my = bx + step * ax, by + step * ay
        range_m = distance * np.sqrt(1 + mx * mx + my * my)
        view = 2 * np.arctan2(sensor, 2 * focal)
        hx, hy = ax / 2, ay / 2
        angle = _angle(bx - hx, by - hy, bx + hx, by + hy)
        per_px = size / extent
    code = reasons(
        np.broadcast_shapes(range_m.shape, angle.shape), (~((focal > 0) & (size > 0) & (pitch > 0)), Reason.OUT_OF_RANGE),
        (extent == 0, Reason.ZERO_EXTENT), (~(extent > 0), Reason.OUT_OF_RANGE), (~np.isfinite(solved), Reason.TOO_OBLIQUE),
        (~(distance > 0), Reason.BEHIND_CAMERA),
    )  # fmt: skip
    return Result(distance, range_m, size, extent, focal, sensor, s.image, f, 1 / pitch, per_px, view, angle, code)


def _angle(x1: Array, y1: Array, x2: Array, y2: Array) -> Array:
    """The angle between two directions given by their slopes; exact for small angles too."""
    cross = np.sqrt((y1 - y2) ** 2 + (x2 - x1) ** 2 + (x1 * y2 - x2 * y1) ** 2)
    return np.asarray(np.arctan2(cross, x1 * x2 + y1 * y2 + 1))


_TURNED = {
    "distance": "its distance comes out too large",
    "size": "its size comes out too small",
    "extent": "it looks shorter than that",
    "focal_length": "the focal length comes out too small",
    "sensor_width": "the sensor comes out too wide",
    "image_width": "the picture comes out too narrow",
}


def notes(inputs: Inputs, result: Result) -> tuple[Note, ...]:
    """`frontal_assumption`, `close_focus`, `off_axis`."""
    found = []
    if float(inputs.tilt.value) == 0 and float(inputs.tilt.u) == 0:
        turned = _TURNED[inputs.unknown]
        text = f"the relation holds for an object that faces the camera; turned by 10°, {turned} by 1.5 %, by 20° 6 %"
        found.append(Note("frontal_assumption", text, 'state its tilt, as in --tilt "0 ± 20 deg (limits)"'))
    slant = float(result.range_m / result.distance_m)
    if slant > 1.001:
        found.append(Note("off_axis", f"off the axis the straight line to the object is {100 * (slant - 1):.1f} % longer than "
                          "its depth; both are given", "use the one you need"))  # fmt: skip
    note = close_focus(float(result.focal_length_m), float(result.distance_m), inputs.focus)
    return (*found, note) if note else tuple(found)


def example() -> Inputs:
    """A package on a conveyor belt."""
    return Inputs(
        Quantity.uniform(0.01405, 0.01415, "m"), Quantity.exact(4096, "px"), Quantity.normal(0.035, 0.0006, "m"),
        Quantity.interval(0.2, 0.002, "m"), Quantity.normal(150, 1, "px"),
    )  # fmt: skip


METHOD = Method(
    name="calculator",
    title="focal length, sensor, picture, size, extent: any one from the others",
    inputs=Inputs,
    outputs=(
        Output("distance_m", "depth", "m", "distance (depth along the axis)"),
        Output("range_m", "range", "m", "range (from the entrance pupil)"),
        Output("size_m", "size", "m", "real size"),
        Output("extent_px", "extent", "px", "extent in the picture"),
        Output("focal_length_m", "focal_length", "m", "focal length"),
        Output("sensor_width_m", "sensor_width", "m", "sensor width"),
        Output("image_width_px", "image_width", "px", "picture width"),
        Output("focal_length_px", "focal_length_px", "px", "focal length in pixels"),
        Output("sensor_px_per_m", "sensor_scale", "px/m", "pixels per mm on the sensor"),
        Output("object_m_per_px", "object_scale", "m/px", "mm per pixel at the object"),
        Output("field_of_view_rad", "field_of_view", "rad", "field of view across the width"),
        Output("angle_rad", "angle", "rad", "angle the object subtends"),
    ),
    function=calculator,
    assumes=("the object faces the camera or is tilted as stated", "the lens draws without distortion",
             "the picture is the whole sensor, neither cropped nor zoomed digitally"),
    source="similar triangles",
    typical="1 to 3 % with nominal values",
    example=example,
    notes=notes,
)  # fmt: skip
