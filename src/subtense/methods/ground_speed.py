"""Mean speed of something on the ground, from its foot points in two pictures of one standing camera and the time between them.

A rolling shutter reads a picture row by row: a thing that has moved to another row was seen so much earlier or later than the
pictures' times tell. Exposure time does not tell how long the reading takes; phones need 14 to 60 ms.

    speed = length / (time + readout (row 2 - row 1) / picture height)

Source: similar triangles on bent, sloping ground (`ground_length`); O. Ait-Aider et al., Simultaneous object pose and velocity
computation using a single view from a rolling shutter camera, ECCV 2006, for the row's time.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from ..arrays import Array, Codes
from ..camera import Camera
from ..errors import InputError
from ..ground import Standing, ground_notes, meet, stand, with_standing
from ..method import Method, Output, Reason, reasons
from ..observation import Observation
from ..quantity import Note, Quantity

LONGEST_READOUT_S = 0.06
"""From the first row of a picture to its last, as measured on phones."""
READOUT_TELLS = 0.002
"""Of the time between the pictures: u of a shutter's that is noted."""


def rolling() -> Quantity:
    """The readout of a camera of which nothing was said; a picture that was turned over was read from below."""
    return Quantity.uniform(
        -LONGEST_READOUT_S, LONGEST_READOUT_S, "s", "assumed: a rolling shutter of up to 60 ms either way"
    )


@with_standing
@dataclass(frozen=True, kw_only=True)
class Inputs(Standing):
    """A standing camera of known height, how it stands, a thing's foot point in two pictures, and the time between.

    Attributes:
        ends: the foot point in the first picture, and in the second.
        time: from the first picture to the second, s.
        readout: from a picture's first row to its last, s; 0 for a global shutter.
    """

    ends: Observation = field(metadata={"points": 2})
    time: Quantity = field(metadata={"unit": "s"})
    readout: Quantity = field(default_factory=rolling, metadata={"unit": "s"})

    def __post_init__(self) -> None:
        super().__post_init__()
        if np.ndim(self.time.value) == 0 and not float(self.time.value) > 0:
            raise InputError(
                "time", f"{float(self.time.value):g} s", "give the time from the first picture to the second, above 0"
            )


@dataclass(frozen=True)
class Result:
    """Arrays (...): mean speed, and the length of the way."""

    speed_m_s: Array
    length_m: Array
    reason: Codes


def ground_speed(inputs: Inputs) -> Result:
    """Mean speed, m/s, and the way, m.

    Source: the length between two points on the ground over the time between their rows; see the module.
    """
    rows = inputs.ends.points_px[..., 1]
    met = meet(inputs, stand(inputs), inputs.camera.rays(inputs.ends.points_px), np.zeros(()))
    share = (rows[..., 1] - rows[..., 0]) / inputs.camera.height_px
    time_s = np.asarray(inputs.time.value) + np.asarray(inputs.readout.value) * share
    length_m = met.apart_m()
    with np.errstate(invalid="ignore", divide="ignore"):
        speed = length_m / time_s
    worst = met.worst
    code = reasons(np.broadcast_shapes(speed.shape, worst.shape), (~(time_s > 0), Reason.OUT_OF_RANGE))
    return Result(speed, length_m, np.asarray(np.where(worst > 0, worst, code), np.int8))


def notes(inputs: Inputs, _: Result) -> tuple[Note, ...]:
    """Those of the ground, and `rolling_shutter`."""
    found = ground_notes(inputs, inputs.ends, np.zeros(()))
    rows = inputs.ends.points_px[..., 1]
    doubt = (
        float(inputs.readout.u)
        * abs(float(rows[..., 1] - rows[..., 0]))
        / inputs.camera.height_px
        / float(inputs.time.value)
    )
    if doubt < READOUT_TELLS or not inputs.readout.source.startswith("assumed"):
        return found
    text = f"a rolling shutter sees the two rows at other times than the pictures'; up to {100 * doubt:.2g} % (1s) of the speed is in u"
    return (*found, Note("rolling_shutter", text, "state the readout time, as 20 ± 2 ms, or 0 for a global shutter"))


def example() -> Inputs:
    """A walker 10 m away, from a camera on a mast of 4 m, in two pictures 2 s apart."""
    camera = Camera(1920, 1080, 1400.0, 959.5, 539.5, cov=np.diag([14.0**2, 0, 6.0**2, 6.0**2]))
    return Inputs(
        camera=camera, height=Quantity.interval(4.0, 0.05, "m"), pitch=Quantity.normal(-math.radians(20), math.radians(0.3), "rad"),
        roll=Quantity.normal(0.0, math.radians(0.3), "rad"), ends=Observation(np.array([[700.0, 620.0], [1100.0, 560.0]])),
        time=Quantity.normal(2.0, 0.01, "s"),
    )  # fmt: skip


METHOD = Method(
    name="ground_speed",
    title="speed on the ground, from two pictures",
    inputs=Inputs,
    outputs=(Output("speed_m_s", "speed", "m/s", "mean speed"), Output("length_m", "length", "m", "length of the way")),
    function=ground_speed,
    assumes=("the camera stood still between the pictures", "the same point of the thing touches the ground in both",
             "the ground is a plane of the stated slope, bent with the earth",
             "the height is that of the entrance pupil, above the ground at the camera's foot"),
    source="similar triangles; O. Ait-Aider et al., ECCV 2006, for rolling shutters",
    typical="2 to 5 %",
    example=example,
    most_draws=200_000,
    button="Speed",
    notes=notes,
)  # fmt: skip
