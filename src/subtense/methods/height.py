"""Height over a plane, from a reference of known height that stands on the same plane.

What stands upright at b and ends at t is seen as t ~ b + mu v, with the vanishing point v of upright lines and b scaled by the plane's
horizon; mu is proportional to the height, so height = reference * mu / reference mu, and no focal length is needed. The horizon is
marked, or follows from level lines in two directions, or, with a camera, from the upright direction alone.

Source: A. Criminisi, I. Reid, A. Zisserman, Single view metrology, IJCV 40, 2000.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from ..arrays import Array, Codes
from ..camera import Camera
from ..errors import InputError
from ..flat_view import ASSUMED, Disc, unknown_distortion
from ..lenses import LENSES
from ..method import Method, Output, Reason, reasons
from ..observation import Observation
from ..quantity import Note, Quantity
from ..upright import Lines, check_lines, horizon_of, leaning, line_notes, line_weights, view
from ..vanishing import below_horizon, camera_share, upright_share, vanishing_point


@dataclass(frozen=True)
class Inputs:
    """Upright lines, a reference of known height, and what is wanted, each by its base on the plane and its top.

    Attributes:
        verticals: two points of each upright line; two lines or more, far apart and long.
        reference: base and top of the reference.
        ends: base and top of what is wanted.
        height: real height of the reference, m.
        horizon: two points of the plane's horizon, if it is seen.
        parallels: two points of each of two or more level lines that are parallel, for the horizon.
        others: the same in another direction.
        camera: of the upright picture; without horizon and level lines it gives the horizon.
        distortion: radial distortion in the corner, as share of the distance from the middle, where there is no camera.
        frame: two opposite corners of the whole picture, where there is no camera.
    """

    verticals: Observation = field(metadata={"points": 4, "more": True})
    reference: Observation = field(metadata={"points": 2})
    ends: Observation = field(metadata={"points": 2})
    height: Quantity = field(metadata={"unit": "m", "assume": "size"})
    horizon: Observation | None = None
    parallels: Observation | None = None
    others: Observation | None = None
    camera: Camera | None = None
    distortion: Quantity = field(default_factory=unknown_distortion, metadata={"unit": "1"})
    frame: Observation | None = field(default=None, metadata={"of_photo": True})

    def __post_init__(self) -> None:
        for name in ("verticals", "parallels", "others"):
            check_lines(name, getattr(self, name))
        for name in ("reference", "ends", "horizon"):
            seen = getattr(self, name)
            if seen is not None and seen.points_px.shape[-2] != 2:
                raise InputError(name, f"{seen.points_px.shape[-2]} points", "give two")
        if (self.parallels is None) != (self.others is None):
            raise InputError(
                "parallels",
                "level lines of one direction only",
                "give others too, or the horizon, or a camera and neither",
            )
        if self.horizon is None and self.parallels is None and self.camera is None:
            raise InputError(
                "horizon",
                None,
                "give two points of it, or level lines in two directions (parallels, others), or a camera",
            )


@dataclass(frozen=True)
class Result:
    """Arrays (...): the wanted height, and that of the camera over the plane."""

    height_m: Array
    camera_height_m: Array
    reason: Codes


@lru_cache(maxsize=8)
def start(inputs: Inputs) -> Lines:
    """Weight the nominal lines."""
    camera, distortion = inputs.camera, inputs.distortion
    disc = Disc.around(inputs.frame, inputs.verticals, inputs.reference, inputs.ends)
    verticals, parallels, others = (
        line_weights(camera, lines, distortion, disc) for lines in (inputs.verticals, inputs.parallels, inputs.others)
    )
    assert verticals is not None
    return Lines(disc, verticals, parallels, others)


def height(inputs: Inputs, begin: Lines) -> Result:
    """Height of what is wanted and of the camera over the plane, m.

    Source: A. Criminisi, I. Reid, A. Zisserman, IJCV 40, 2000, equation 10; see the module.
    """
    camera, distortion, disc = inputs.camera, inputs.distortion, begin.disc
    up, lost = vanishing_point(view(camera, inputs.verticals, distortion, disc), begin.verticals)
    horizon, gone = horizon_of(camera, up, inputs.horizon, inputs.parallels, inputs.others, distortion, begin)
    reference, ends = (view(camera, one, distortion, disc) for one in (inputs.reference, inputs.ends))
    (b, t), (base, top) = ((one[..., 0, :], one[..., 1, :]) for one in (reference, ends))
    known, wanted = upright_share(b, t, up, horizon), upright_share(base, top, up, horizon)
    own = camera_share(up, horizon)
    stated = np.asarray(inputs.height.value)
    with np.errstate(divide="ignore", invalid="ignore"):
        height_m, camera_m = stated * wanted / known, stated * own / known
        across = below_horizon(b, horizon) / below_horizon(base, horizon)
    height_m, camera_m, across, stated = np.broadcast_arrays(height_m, camera_m, across, stated)
    perspective = np.asarray(camera is not None and not LENSES[camera.lens].perspective)
    missing = np.asarray(~(np.isfinite(reference).all(axis=(-1, -2)) & np.isfinite(ends).all(axis=(-1, -2))))
    code = reasons(
        height_m.shape, (perspective, Reason.NOT_PINHOLE), (missing, Reason.NOT_INVERTIBLE), (lost | gone, Reason.NO_VANISHING_POINT),
        (np.asarray(~(stated > 0)), Reason.OUT_OF_RANGE), (np.asarray(known == 0), Reason.NO_HEIGHT),
        (np.asarray(wanted == 0), Reason.ZERO_EXTENT), (np.asarray(~(across > 0)), Reason.BEYOND_HORIZON),
        (np.asarray(~np.isfinite(height_m * camera_m)), Reason.NO_HEIGHT),
        (np.asarray(~((height_m > 0) & (camera_m > 0))), Reason.UPSIDE_DOWN),
    )  # fmt: skip
    return Result(height_m, camera_m, code)


def notes(inputs: Inputs, _: Result) -> tuple[Note, ...]:
    """`lines_misfit`, `lines_unchecked`, `not_upright` and `distortion_unknown`."""
    begin = start(inputs)
    camera, distortion, disc = inputs.camera, inputs.distortion, begin.disc
    found: list[Note] = []
    for name, lines, weights in (("vertical lines", inputs.verticals, begin.verticals),
                                 ("first level lines", inputs.parallels, begin.parallels),
                                 ("second level lines", inputs.others, begin.others)):  # fmt: skip
        found += line_notes(name, camera, lines, distortion, weights, disc)
    for name, thing in (("reference", inputs.reference), ("thing that is wanted", inputs.ends)):
        found += leaning(name, camera, thing, inputs.verticals, distortion, begin.verticals, disc)
    if inputs.parallels is not None and inputs.others is not None:
        sets = (inputs.parallels, inputs.others)
        if inputs.horizon is None and any(lines.points_px.shape[-2] == 4 for lines in sets):
            found.append(Note("lines_unchecked", "two lines of a direction always meet: a wrong one among the level lines can't be noticed",
                              "give a third line of each direction"))  # fmt: skip
    if camera is None and distortion.source.startswith(ASSUMED):
        found.append(Note("distortion_unknown", "nothing is known of the lens's distortion: "
                          f"{100 * float(distortion.u):.2g} % (1s) in the corners is in u", "give a calibrated camera"))  # fmt: skip
    return tuple(found)


def example() -> Inputs:
    """A door of 2.02 m beside a person, from a camera 1.6 m above the floor that looks 12 degrees down."""
    c, s = np.cos(np.radians(12)), np.sin(np.radians(12))
    turn = np.array([[1.0, 0, 0], [0, -s, -c], [0, c, -s]])
    camera = Camera(1600, 1200, 1300.0, 799.5, 599.5, cov=np.diag([13.0**2, 0, 8.0**2, 8.0**2]))

    def seen(*points: tuple[float, float, float], label: str = "") -> Observation:
        pixels = camera.project((np.array(points) - [0, 0, 1.6]) @ turn.T)
        return Observation(pixels, 0.7, label=label)

    return Inputs(
        seen((-1.5, 5, 0.2), (-1.5, 5, 2.2), (1.5, 4, 0.2), (1.5, 4, 2.0), (0.2, 6, 0), (0.2, 6, 2.3), label="vertical lines"),
        seen((-1, 5, 0), (-1, 5, 2.02), label="reference"), seen((0.8, 4, 0), (0.8, 4, 1.75), label="what is wanted"),
        Quantity.normal(2.02, 0.005, "m"), camera=camera,
    )  # fmt: skip


METHOD = Method(
    name="height", title="a height over a plane, by one that is known", inputs=Inputs,
    outputs=(Output("height_m", "height", "m", "height"), Output("camera_height_m", "camera_height", "m", "camera above the plane")),
    function=height,
    assumes=("reference and what is wanted stand upright on one level plane", "the vertical lines are upright, the level lines level",
             "the lens draws as the camera says, or, without one, with the distortion that is in the interval"),
    source="A. Criminisi, I. Reid, A. Zisserman, Single view metrology, IJCV 40, 2000",
    typical="0.5 to 3 %", example=example, button="Height", start=start, notes=notes,
)  # fmt: skip
