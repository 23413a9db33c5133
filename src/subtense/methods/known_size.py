"""Distance of an object of known size from its two ends in the picture.

A segment of length L seen between two directions with slopes m1, m2 (x/z, y/z) and facing the camera stands at depth
Z = L / |m2 - m1|, which for a pinhole is the classical  distance = size * f_px / pixels.  A tilt t of the segment
to the image plane gives the quadratic |Z a + L sin(t) b| = L cos(t), a = m2 - m1, b = (m1 + m2) / 2. A focal length
that holds for focus at infinity makes the depth too short by about f (thin lens), which `focus` says how much of to add.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from ..arrays import Array, Codes
from ..assumptions import UNKNOWN_TILT, frontal, unknown_tilt
from ..camera import Camera
from ..focus import NO_EXTENSION, close_focus, thin_lens
from ..geometry import segment_depth
from ..lenses import LENSES
from ..method import Method, Output, Reason, reasons
from ..observation import Observation
from ..quantity import Note, Quantity


@dataclass(frozen=True)
class Inputs:
    """A camera, the two ends of the object in the picture, and its real size.

    Attributes:
        camera: of the upright picture the ends were seen in.
        ends: two points.
        size: distance between the ends on the object, m.
        tilt: angle of the object to the image plane, rad; positive where the second end is farther.
        focus: share of the thin-lens extension that is added where the focal length is nominal; 1.
    """

    camera: Camera
    ends: Observation = field(metadata={"points": 2})
    size: Quantity = field(metadata={"unit": "m", "assume": "size"})
    tilt: Quantity = field(
        default_factory=frontal, metadata={"unit": "rad", "assume": "angle", "in_photo": unknown_tilt}
    )
    focus: Quantity = field(default_factory=thin_lens, metadata={"unit": "1"})


@dataclass(frozen=True)
class Result:
    """Arrays (...): range from the entrance pupil and depth along the axis of the object's middle."""

    range_m: Array
    depth_m: Array
    reason: Codes


def known_size(inputs: Inputs) -> Result:
    """Range and depth of the object's middle, m.

    Source: similar triangles; see the module.
    """
    size, (ax, ay), (bx, by), depth, depth_m = _middle(inputs)
    range_m = depth_m * np.sqrt(1 + bx * bx + by * by)
    if LENSES[inputs.camera.lens].perspective and depth_m.min(initial=np.inf) > 0 and range_m.max(initial=0.0) < np.inf:
        return Result(range_m, depth_m, np.zeros(range_m.shape, np.int8))  # nothing went wrong: the usual case
    perspective = np.asarray(not LENSES[inputs.camera.lens].perspective)
    code = reasons(
        range_m.shape, (perspective, Reason.NOT_PINHOLE), (~np.isfinite(ax + ay), Reason.NOT_INVERTIBLE),
        (ax * ax + ay * ay == 0, Reason.ZERO_EXTENT), (~(size > 0), Reason.OUT_OF_RANGE),
        (~np.isfinite(depth), Reason.TOO_OBLIQUE), (~(depth_m > 0), Reason.BEHIND_CAMERA),
    )  # fmt: skip
    return Result(range_m, depth_m, code)


def _middle(inputs: Inputs) -> tuple[Array, tuple[Array, Array], tuple[Array, Array], Array, Array]:
    """The size, the slopes between the ends and of the object's middle, its depth at infinite focus, and as focused."""
    x, y = inputs.camera.slopes(inputs.ends.points_px)
    ax, ay = x[..., 1] - x[..., 0], y[..., 1] - y[..., 0]
    bx, by = (x[..., 0] + x[..., 1]) * 0.5, (y[..., 0] + y[..., 1]) * 0.5
    size, nominal_m = np.asarray(inputs.size.value), inputs.camera.nominal_focal_m
    depth, half_step = segment_depth(ax, ay, bx, by, size, np.asarray(inputs.tilt.value))
    depth_m = depth + np.asarray(inputs.focus.value) * nominal_m if nominal_m else depth
    if np.any(half_step):  # the middle of the 3-D segment: Z b + (half step) a / 2, at depth Z
        shift = half_step / (2 * depth)
        bx, by = bx + shift * ax, by + shift * ay
    return size, (ax, ay), (bx, by), depth, depth_m


def place(inputs: Inputs) -> Array:
    """(..., 3) the object's middle in the camera's frame, m."""
    _, _, (bx, by), _, depth_m = _middle(inputs)
    return np.stack(np.broadcast_arrays(bx * depth_m, by * depth_m, depth_m), -1)


def derivative(inputs: Inputs, result: Result) -> dict[str, dict[tuple[str, str], tuple[Array, ...]]] | None:
    """Partial derivatives for a pinhole and an object that faces it; None otherwise.

    With the pixel difference (dx, dy), e = hypot(dx, dy / aspect) and the middle's slopes b:
    depth = L f / e + focus, range = depth * sqrt(1 + b^2).
    """
    camera = inputs.camera
    if camera.lens != "pinhole" or np.any(inputs.tilt.value) or np.any(inputs.tilt.u):
        return None
    per_f, per_aspect = 1 / np.asarray(camera.f_px), 1 / np.asarray(camera.aspect)
    nominal_m, zero = camera.nominal_focal_m or 0.0, np.zeros(())
    x, y = inputs.ends.points_px[..., 0], inputs.ends.points_px[..., 1]
    dx, dy = x[..., 1] - x[..., 0], (y[..., 1] - y[..., 0]) * per_aspect
    bx = (x[..., 0] + x[..., 1] - 2 * camera.cx_px) * (0.5 * per_f)
    by = (y[..., 0] + y[..., 1] - 2 * camera.cy_px) * (0.5 * per_f * per_aspect)
    slant = np.sqrt(1 + bx * bx + by * by)
    depth = np.where(result.reason == 0, result.depth_m, np.nan) if result.reason.any() else result.depth_m
    classical = depth - np.asarray(inputs.focus.value) * nominal_m if nominal_m else depth
    with np.errstate(divide="ignore", invalid="ignore"):
        per_length2 = classical / (dx * dx + dy * dy)
    gx, gy, over = per_length2 * dx, per_length2 * dy * per_aspect, depth / slant
    tx, ty = over * bx * (0.5 * per_f), over * by * (0.5 * per_f * per_aspect)
    by_f, by_size, by_aspect = (
        classical * per_f,
        classical / np.asarray(inputs.size.value),
        per_length2 * dy * dy * per_aspect,
    )
    gx_slant, gy_slant = gx * slant, gy * slant
    return {
        "depth_m": {
            ("camera", "0"): (by_f,), ("camera", "1"): (by_aspect,), ("camera", "2,3"): (zero, zero),
            ("ends", "points"): (gx, gy, -gx, -gy), ("size", "value"): (by_size,), ("focus", "value"): (zero + nominal_m,),
        },
        "range_m": {
            ("camera", "0"): (by_f * slant - over * (bx * bx + by * by) * per_f,),
            ("camera", "1"): (by_aspect * slant - over * by * by * per_aspect,), ("camera", "2,3"): (-2 * tx, -2 * ty),
            ("ends", "points"): (gx_slant + tx, gy_slant + ty, tx - gx_slant, ty - gy_slant),
            ("size", "value"): (by_size * slant,), ("focus", "value"): (slant * nominal_m,),
        },
    }  # fmt: skip


def prepare(inputs: Inputs) -> Inputs:
    """A calibrated focal length holds its focus extension already: nothing is doubtful about it."""
    return inputs if inputs.camera.nominal_focal_m else replace(inputs, focus=NO_EXTENSION)


def notes(inputs: Inputs, result: Result) -> tuple[Note, ...]:
    """`frontal_assumption`, `unknown_tilt` and `close_focus`."""
    found = []
    tilt, u_tilt = float(inputs.tilt.value), float(inputs.tilt.u)
    if tilt == 0 and u_tilt == 0:
        found.append(Note("frontal_assumption", "the object is taken to face the camera; turned by 10° it reads 1.5 % "
                          "too far, by 20° 6 %", 'state its tilt, as in --tilt "0 ± 20 deg (limits)"'))  # fmt: skip
    elif inputs.tilt.source.startswith(UNKNOWN_TILT):
        limit = math.degrees(u_tilt * math.sqrt(3))
        found.append(Note("unknown_tilt", f"the object's tilt is unknown; up to {limit:.0f}° is in the interval, which "
                          "reaches to the near side; turned further, the distance is only an upper bound",
                          'state it, as in --tilt "0 ± 3 deg", or use a marker'))  # fmt: skip
    note = close_focus(inputs.camera.nominal_focal_m, float(result.depth_m), inputs.focus)
    return (*found, note) if note else tuple(found)


def example() -> Inputs:
    """A package of 200 mm seen 150 px long by a 35 mm lens on a 14.1 mm sensor of 4096 px."""
    f = 35 / 14.1 * 4096
    camera = Camera(4096, 3000, f, 2047.5, 1499.5, cov=np.diag([(0.015 * f) ** 2, 0, 20.0**2, 20.0**2]))
    ends = Observation(np.array([[1972.5, 1499.5], [2122.5, 1499.5]]))
    return Inputs(camera, ends, Quantity.interval(0.2, 0.002, "m"))


METHOD = Method(
    name="known_size",
    title="an object of known size, two ends",
    inputs=Inputs,
    outputs=(Output("range_m", "range", "m", "range (from the entrance pupil)"),
             Output("depth_m", "depth", "m", "depth (along the axis)")),
    function=known_size,
    assumes=("the two points are the ends of the stated size", "the object is straight, and tilted as stated",
             "the picture is not cropped or edited after the camera's numbers were taken"),
    source="similar triangles; thin lens: E. Hecht, Optics, 5.2",
    typical="1 to 3 % with a nominal focal length, 0.2 to 1 % calibrated",
    example=example,
    button="Known size",
    derivative=derivative,
    prepare=prepare,
    place=place,
    notes=notes,
)  # fmt: skip
