"""Width and height on an upright plane (a wall, a front), from a reference of known height on the ground before it.

With a camera the vanishing point of upright lines is their direction n. A reference of known height gives the height h of the camera
over the ground, so a point of the ground in the direction r is at r h / (-n . r). The wall stands on two of them; a point of it is
where its direction meets the upright plane through both.

Source: A. Criminisi, I. Reid, A. Zisserman, Single view metrology, IJCV 40, 2000; R. Hartley, A. Zisserman, 8.6.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from ..arrays import Array, Codes
from ..camera import Camera
from ..errors import InputError
from ..flat_view import Disc, unknown_distortion
from ..lenses import LENSES
from ..method import Method, Output, Reason, reasons
from ..observation import Observation
from ..quantity import Note, Quantity
from ..upright import Lines, check_lines, leaning, line_notes, line_weights
from ..vanishing import camera_share, homogeneous, upright_share, vanishing_point


@dataclass(frozen=True)
class Inputs:
    """A camera, upright lines, a reference of known height, the foot of a wall, and two points on the wall.

    Attributes:
        camera: of the upright picture.
        verticals: two points of each upright line; two lines or more, far apart and long.
        reference: base and top of the reference, which stands on the ground.
        height: real height of the reference, m.
        foot: two points of the line where the wall meets the ground.
        ends: two points on the wall.
    """

    camera: Camera
    verticals: Observation = field(metadata={"points": 4, "more": True})
    reference: Observation = field(metadata={"points": 2})
    height: Quantity = field(metadata={"unit": "m", "assume": "size"})
    foot: Observation = field(metadata={"points": 2})
    ends: Observation = field(metadata={"points": 2})

    def __post_init__(self) -> None:
        check_lines("verticals", self.verticals)
        for name in ("reference", "foot", "ends"):
            count = getattr(self, name).points_px.shape[-2]
            if count != 2:
                raise InputError(name, f"{count} points", "give two")


@dataclass(frozen=True)
class Result:
    """Arrays (...): distance of the two points, and its level and upright parts."""

    length_m: Array
    width_m: Array
    rise_m: Array
    reason: Codes


@lru_cache(maxsize=8)
def start(inputs: Inputs) -> Lines:
    """Weight the nominal lines."""
    disc = Disc.around(None, inputs.verticals)
    weights = line_weights(inputs.camera, inputs.verticals, unknown_distortion(), disc)
    assert weights is not None
    return Lines(disc, weights)


def wall(inputs: Inputs, begin: Lines) -> Result:
    """Distance of the two points on the wall, its level and its upright part, m.

    Source: A. Criminisi, I. Reid, A. Zisserman, IJCV 40, 2000; see the module.
    """
    seen = {
        n: inputs.camera.normalised(getattr(inputs, n).points_px) for n in ("verticals", "reference", "foot", "ends")
    }
    up, lost = vanishing_point(seen["verticals"], begin.verticals)
    b, t = seen["reference"][..., 0, :], seen["reference"][..., 1, :]
    with np.errstate(divide="ignore", invalid="ignore"):
        over = np.asarray(inputs.height.value) * camera_share(up, up) / upright_share(b, t, up, up)
        foot_rays, rays = homogeneous(seen["foot"]), homogeneous(seen["ends"])
        # n . r = -1 at the ground under a camera at height 1, whichever way n points
        sign = -np.sign(np.sum(up * homogeneous(b[..., None, :])[..., 0, :], -1))
        normal = up * sign[..., None]
        down = -np.sum(foot_rays * normal[..., None, :], -1)
        foot = foot_rays * (over[..., None] / down)[..., None]
        along = foot[..., 1, :] - foot[..., 0, :]
        facing = np.cross(normal, along)
        distance = np.sum(facing * foot[..., 0, :], -1)[..., None] / np.sum(rays * facing[..., None, :], -1)
        points = rays * distance[..., None]
        step = points[..., 1, :] - points[..., 0, :]
        rise = abs(np.sum(step * normal, -1))
        width = abs(np.sum(step * along, -1)) / np.sqrt(np.sum(along**2, -1))
        length = np.sqrt(np.sum(step**2, -1))
    length, width, rise, over = np.broadcast_arrays(length, width, rise, over)
    perspective = np.asarray(not LENSES[inputs.camera.lens].perspective)
    missing = np.asarray(
        ~np.all(
            [np.isfinite(one).all(axis=(-1, -2)) for one in np.broadcast_arrays(seen["foot"], seen["ends"])], axis=0
        )
    )
    code = reasons(
        length.shape, (perspective, Reason.NOT_PINHOLE), (missing, Reason.NOT_INVERTIBLE), (lost, Reason.NO_VANISHING_POINT),
        (np.asarray(~(np.asarray(inputs.height.value) > 0)), Reason.OUT_OF_RANGE), (np.asarray(~np.isfinite(over)), Reason.NO_HEIGHT),
        (np.asarray(~(over > 0)), Reason.UPSIDE_DOWN), (np.asarray(~np.all(down > 0, axis=-1)), Reason.BEYOND_HORIZON),
        (np.asarray(~(np.sum(along**2, -1) > 0)), Reason.ZERO_EXTENT),
        (np.asarray(~np.all(distance > 0, axis=-1)), Reason.BEHIND_CAMERA), (np.asarray(~(length > 0)), Reason.ZERO_EXTENT),
    )  # fmt: skip
    return Result(length, width, rise, code)


def notes(inputs: Inputs, _: Result) -> tuple[Note, ...]:
    """`lines_misfit` and `not_upright`."""
    begin, none = start(inputs), unknown_distortion()
    found = line_notes("vertical lines", inputs.camera, inputs.verticals, none, begin.verticals, begin.disc)
    return (
        *found,
        *leaning("reference", inputs.camera, inputs.reference, inputs.verticals, none, begin.verticals, begin.disc),
    )


def example() -> Inputs:
    """A window of 1.2 m by 0.9 m in a wall that is seen from the side, and a pole of 2 m before it."""
    c, s = np.cos(np.radians(8)), np.sin(np.radians(8))
    turn = np.array([[1.0, 0, 0], [0, -s, -c], [0, c, -s]])
    camera = Camera(1600, 1200, 1300.0, 799.5, 599.5, cov=np.diag([13.0**2, 0, 8.0**2, 8.0**2]))

    def seen(*points: tuple[float, float, float], label: str = "") -> Observation:
        return Observation(camera.project((np.array(points) - [0, 0, 1.6]) @ turn.T), 0.7, label=label)

    return Inputs(
        camera,
        seen((-1.5, 5, 0.2), (-1.5, 5, 2.2), (1.5, 6.5, 0.2), (1.5, 6.5, 2.6), (0.2, 6, 0.3), (0.2, 6, 2.3), label="vertical lines"),
        seen((-1, 4.5, 0), (-1, 4.5, 2.0), label="reference"), Quantity.normal(2.0, 0.005, "m"),
        seen((-1.5, 5, 0), (1.5, 6.5, 0), label="foot"), seen((-0.5, 5.5, 1.0), (0.5733, 6.03665, 1.9), label="what is wanted"),
    )  # fmt: skip


METHOD = Method(
    name="wall", title="width and height on a wall, by one height that is known", inputs=Inputs,
    outputs=(Output("length_m", "length", "m", "length"), Output("width_m", "width", "m", "its level part"),
             Output("rise_m", "rise", "m", "its upright part")),
    function=wall,
    assumes=("the wall is upright and stands on the level ground of the reference", "the vertical lines are upright",
             "the picture is not cropped or edited after the camera's numbers were taken"),
    source="A. Criminisi, I. Reid, A. Zisserman, Single view metrology, IJCV 40, 2000", typical="1 to 4 %", example=example,
    button="Wall", start=start, notes=notes,
)  # fmt: skip
