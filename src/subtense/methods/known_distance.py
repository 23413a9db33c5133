"""Size of an object at a known distance, from its two ends in the picture.

The relation of `known_size` solved for the length: a segment of length L facing the camera stands at depth
Z = L / |m2 - m1| where m1, m2 are the slopes (x/z, y/z) of its ends, so  size = distance * pixels / f_px.  Depth and
range of the middle grow in proportion to L, so one unit of length, tilted as stated, tells both.
"""

from __future__ import annotations

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
    """A camera, the two ends of the object in the picture, and how far away its middle is.

    Attributes:
        camera: of the upright picture the ends were seen in.
        ends: two points.
        distance: range of the object's middle, a straight line from the entrance pupil, m.
        tilt: angle of the object to the image plane, rad; positive where the second end is farther.
        focus: share of the thin-lens extension that is taken off where the focal length is nominal; 1.
    """

    camera: Camera
    ends: Observation = field(metadata={"points": 2})
    distance: Quantity = field(metadata={"unit": "m", "assume": "size"})
    tilt: Quantity = field(
        default_factory=frontal, metadata={"unit": "rad", "assume": "angle", "in_photo": unknown_tilt}
    )
    focus: Quantity = field(default_factory=thin_lens, metadata={"unit": "1"})


@dataclass(frozen=True)
class Result:
    """Arrays (...): the object's length, and the depth of its middle along the axis."""

    size_m: Array
    depth_m: Array
    reason: Codes


def known_distance(inputs: Inputs) -> Result:
    """Length of the object, m, and depth of its middle, m.

    Source: similar triangles; see the module.
    """
    x, y = inputs.camera.slopes(inputs.ends.points_px)
    ax, ay = x[..., 1] - x[..., 0], y[..., 1] - y[..., 0]
    bx, by = (x[..., 0] + x[..., 1]) * 0.5, (y[..., 0] + y[..., 1]) * 0.5
    distance, tilt = np.asarray(inputs.distance.value), np.asarray(inputs.tilt.value)
    per_length, half_step = segment_depth(ax, ay, bx, by, np.ones(()), tilt)
    with np.errstate(divide="ignore", invalid="ignore"):
        shift = half_step / (2 * per_length)
        slant = np.sqrt(1 + (bx + shift * ax) ** 2 + (by + shift * ay) ** 2)
        depth_m = distance / slant
        size_m = (depth_m - np.asarray(inputs.focus.value) * (inputs.camera.nominal_focal_m or 0.0)) / per_length
    perspective = np.asarray(not LENSES[inputs.camera.lens].perspective)
    nowhere = np.asarray(~np.isfinite(x).all(axis=-1))
    size_m, depth_m = np.broadcast_arrays(size_m, depth_m)
    code = reasons(
        size_m.shape, (perspective, Reason.NOT_PINHOLE), (nowhere, Reason.NOT_INVERTIBLE),
        ((ax == 0) & (ay == 0), Reason.ZERO_EXTENT), (~(distance > 0), Reason.BEHIND_CAMERA),
        (~np.isfinite(size_m), Reason.TOO_OBLIQUE), (~(size_m > 0), Reason.BEHIND_CAMERA),
    )  # fmt: skip
    return Result(size_m, depth_m, code)


def prepare(inputs: Inputs) -> Inputs:
    """A calibrated focal length holds its focus extension already: nothing is doubtful about it."""
    return inputs if inputs.camera.nominal_focal_m else replace(inputs, focus=NO_EXTENSION)


def notes(inputs: Inputs, result: Result) -> tuple[Note, ...]:
    """`frontal_assumption`, `unknown_tilt` and `close_focus`."""
    found = []
    if float(inputs.tilt.value) == 0 and float(inputs.tilt.u) == 0:
        found.append(Note("frontal_assumption", "the object is taken to face the camera; turned by 10° it is 1.5 % longer than "
                          "that, by 20° 6 %", 'state its tilt, as in --tilt "0 ± 20 deg (limits)"'))  # fmt: skip
    elif inputs.tilt.source.startswith(UNKNOWN_TILT):
        found.append(Note("unknown_tilt", "the object's tilt is unknown; up to 20° is in the interval, which reaches to the long "
                          "side; turned further, it is longer than the interval says",
                          'state it, as in --tilt "0 ± 3 deg", or use a reference in its plane'))  # fmt: skip
    note = close_focus(inputs.camera.nominal_focal_m, float(result.depth_m), inputs.focus)
    return (*found, note) if note else tuple(found)


def example() -> Inputs:
    """A crack 120 px long in a wall 4 m away, seen by a 35 mm lens on a 36 mm sensor of 6000 px."""
    f = 35 / 36 * 6000
    camera = Camera(6000, 4000, f, 2999.5, 1999.5, cov=np.diag([(0.005 * f) ** 2, 0, 20.0**2, 20.0**2]))
    ends = Observation(np.array([[3100.0, 2100.0], [3172.0, 2196.0]]))
    return Inputs(camera, ends, Quantity.interval(4.0, 0.02, "m"))


METHOD = Method(
    name="known_distance",
    title="an object at a known distance, two ends",
    inputs=Inputs,
    outputs=(Output("size_m", "size", "m", "real size"), Output("depth_m", "depth", "m", "depth (along the axis)")),
    function=known_distance,
    assumes=("the stated distance is that of the object's middle, from the entrance pupil (a few cm behind the front lens)",
             "the object is straight, and tilted as stated",
             "the picture is not cropped or edited after the camera's numbers were taken"),
    source="similar triangles; thin lens: E. Hecht, Optics, 5.2",
    typical="1 to 3 % with a nominal focal length, 0.2 to 1 % calibrated",
    example=example,
    button="Known distance",
    prepare=prepare,
    notes=notes,
)  # fmt: skip
