"""Lengths, areas and angles in a plane of which no places are known, but right angles, parallels, equal lengths, and a length.

A window of which one side is known, tiles, the edges of a road: what holds in the plane tells how its picture is to be undone. All but the
scale is told by four conditions without a camera (two directions of parallels, and two right angles, equal or known lengths of
different directions), and by two with one (two directions of parallels, which give the plane's horizon, or one and a right angle). A known
length gives the scale; an angle needs none. More conditions check each other.

Source: R. Hartley, A. Zisserman, Multiple View Geometry, 2.7, 8.6.3; D. Liebowitz, A. Zisserman, Metric rectification for perspective
images of planes, CVPR 1998.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from ..arrays import Array, Codes
from ..camera import Camera
from ..conditions import KNOWN, WORDS, Condition, Conditions, read_conditions
from ..errors import InputError
from ..flat_path import Angle, Area, Length, angle_between, crosses, enclosed_area, path_length
from ..flat_view import ASSUMED, MOST_POINTS, Disc, straight_view, unknown_distortion
from ..lenses import LENSES
from ..method import Method, Output, Reason, reasons
from ..observation import Observation
from ..quantity import Note, Quantity
from ..rectify import Plane, Scene, moved_plane, nominal_plane


@dataclass(frozen=True)
class Inputs:
    """Points of a plane, what holds among them, a length, and which of them are the path that is wanted.

    Attributes:
        points: of the plane; conditions and path count them from 1.
        conditions: as 'rectangle 1 2 3 4; length 1 2'; also square 1 2 3 4, parallel 1 2 4 3, right 1 2 3, equal 1 2 3 4, second 2 3.
        path: numbers of two or more of the points, as '5 6'.
        length: of the side that `length` names, m.
        second: of the side that `second` names, m.
        third: of the side that `third` names, m.
        camera: of the upright picture; with it two conditions and a length are enough, else four and a length.
        distortion: radial distortion in the corner, as share of the distance from the middle, where there is no camera.
        frame: two opposite corners of the whole picture, where there is no camera.
    """

    points: Observation
    conditions: str
    path: str
    length: Quantity | None = field(default=None, metadata={"unit": "m", "assume": "size"})
    second: Quantity | None = field(default=None, metadata={"unit": "m", "assume": "size"})
    third: Quantity | None = field(default=None, metadata={"unit": "m", "assume": "size"})
    camera: Camera | None = None
    distortion: Quantity = field(default_factory=unknown_distortion, metadata={"unit": "1"})
    frame: Observation | None = field(default=None, metadata={"of_photo": True})

    def __post_init__(self) -> None:
        count = self.points.points_px.shape[-2]
        if count > MOST_POINTS:
            raise InputError("points", f"{count} of them", f"give {MOST_POINTS} at most; more tell nothing more")
        _check_path(self.path, len(self.wanted), *self._corners)
        kinds = {one.kind for one in self.read.each}
        for kind in KNOWN:
            if (kind in kinds) != (getattr(self, kind) is not None):
                raise InputError(kind, None if kind in kinds else "of no side",
                                 f"give {kind} together with a condition that says which side it is of, as '{kind} 1 2'")  # fmt: skip
        if self._scaled and not self.read.scaled:
            raise InputError(
                "length", None, "give one length, and say which side it is of, as 'length 1 2' in conditions"
            )
        _check_enough(self.read, camera=self.camera is not None)

    @property
    def read(self) -> Conditions:
        """The conditions."""
        return read_conditions(self.conditions, self.points.points_px.shape[-2])

    @property
    def wanted(self) -> tuple[int, ...]:
        """Indices of the path's points, from 0."""
        return _path(self.path, self.points.points_px.shape[-2])

    @property
    def _corners(self) -> tuple[int, float]:
        return 2, math.inf

    @property
    def _scaled(self) -> bool:
        return True


@dataclass(frozen=True)
class Outline(Inputs):
    """Points of a plane, what holds among them, a length, and which of them are the corners of the area that is wanted.

    Attributes:
        points: of the plane; conditions and path count them from 1.
        conditions: as 'rectangle 1 2 3 4; length 1 2'; also square 1 2 3 4, parallel 1 2 4 3, right 1 2 3, equal 1 2 3 4, second 2 3.
        path: numbers of three or more of the points, in order around the area, as '1 2 3 5'.
        length: of the side that `length` names, m.
        second: of the side that `second` names, m.
        third: of the side that `third` names, m.
        camera: of the upright picture; with it two conditions and a length are enough, else four and a length.
        distortion: radial distortion in the corner, as share of the distance from the middle, where there is no camera.
        frame: two opposite corners of the whole picture, where there is no camera.
    """

    @property
    def _corners(self) -> tuple[int, float]:
        return 3, math.inf


@dataclass(frozen=True)
class Corner(Inputs):
    """Points of a plane, what holds among them, and which three of them are the angle that is wanted.

    Attributes:
        points: of the plane; conditions and path count them from 1.
        conditions: as 'square 1 2 3 4'; also rectangle 1 2 3 4, parallel 1 2 4 3, right 1 2 3, equal 1 2 3 4, length 1 2.
        path: numbers of three of the points, the corner in the middle, as '1 2 5'.
        length: of the side that `length` names, m; needed only where another is known too.
        second: of the side that `second` names, m.
        third: of the side that `third` names, m.
        camera: of the upright picture; with it two conditions are enough, else four.
        distortion: radial distortion in the corner, as share of the distance from the middle, where there is no camera.
        frame: two opposite corners of the whole picture, where there is no camera.
    """

    @property
    def _corners(self) -> tuple[int, float]:
        return 3, 3

    @property
    def _scaled(self) -> bool:
        return False


@lru_cache(maxsize=64)
def _path(text: str, count: int) -> tuple[int, ...]:
    words = text.replace(",", " ").split()
    numbers = tuple(int(word[:6]) - 1 if word.isascii() and word.isdecimal() else -1 for word in words)
    if not all(0 <= one < count for one in numbers):
        raise InputError("path", text, f"name points by their numbers from 1 to {count}, as '1 2'")
    return numbers


def _check_path(text: str, count: int, least: int, most: float) -> None:
    if not least <= count <= most:
        raise InputError(
            "path", text, "name three points, the corner in the middle" if most == 3 else f"name {least} points or more"
        )
    if count > MOST_POINTS:
        raise InputError("path", f"{count} points", f"name {MOST_POINTS} at most")


def _check_enough(read: Conditions, *, camera: bool) -> None:
    needed = read.needed(camera=camera)
    if len(read.each) >= needed:
        return
    fewer = "" if camera else f", or the camera too, with which {read.needed(camera=True)} are enough"
    raise InputError("conditions", f"{len(read.each)} of them",
                     f"give {needed} or more{fewer} (a rectangle counts as three, a square as four, each length as one)")  # fmt: skip


def _scene(inputs: Inputs, disc: Disc) -> Scene:
    flat = straight_view(inputs.camera, inputs.points.points_px, inputs.distortion, disc)
    stated = (getattr(inputs, kind) for kind in KNOWN)
    return Scene(flat, tuple(np.asarray(1.0 if one is None else one.value, float) for one in stated))


@lru_cache(maxsize=8)
def start(inputs: Inputs) -> Plane:
    """Find the nominal plane, and whether there is another."""
    disc = Disc.around(inputs.frame, inputs.points)

    def scene(points: Observation, camera: Camera | None, bend: Quantity, *known: Quantity | None) -> Scene:
        flat = straight_view(camera, points.points_px, bend, disc)
        return Scene(flat, tuple(np.asarray(1.0 if one is None else one.value, float) for one in known))

    nouns = (inputs.points, inputs.camera, inputs.distortion, inputs.length, inputs.second, inputs.third)
    return nominal_plane(inputs.read, nouns, scene, disc, camera=inputs.camera is not None, wanted=inputs.wanted)


def _on_plane(inputs: Inputs, begin: Plane) -> tuple[Array, Codes]:
    """(..., M, 2 or 3) places of the path, m where a length is known; and the reasons why there are none."""
    seen = _scene(inputs, begin.disc)
    lead = np.broadcast_shapes(seen.flat.shape[:-2], *(one.shape for one in seen.known))
    numbers, lost = moved_plane(begin, seen, lead)
    path = seen.flat[..., list(inputs.wanted), :]
    _, before = begin.rectified.places(numbers, seen.flat[..., inputs.read.told, :])
    places, reached = begin.rectified.places(numbers, path)
    panorama = np.asarray(inputs.camera is not None and not LENSES[inputs.camera.lens].perspective)
    missing = np.asarray(~np.isfinite(seen.flat).all(axis=(-1, -2)))
    stated = np.asarray(np.all(np.broadcast_arrays(*(one > 0 for one in seen.known)), axis=0))
    why = begin.reason if begin.reason is not Reason.OK else Reason.NOT_CONVERGED
    code = reasons(
        lead, (panorama, Reason.NOT_PINHOLE), (missing, Reason.NOT_INVERTIBLE), (~stated, Reason.OUT_OF_RANGE), (lost, why),
        (~before, Reason.FOLDED), (~reached, Reason.BEYOND_HORIZON),
    )  # fmt: skip
    return np.broadcast_to(places, (*lead, *places.shape[-2:])), code


def _with_extent(code: Codes, numbers: Array) -> Codes:
    """The reasons, with what has no extent among them."""
    return np.where((code == 0) & ~(numbers > 0), np.int8(Reason.ZERO_EXTENT), code)


def plane_conditions(inputs: Inputs, begin: Plane) -> Length:
    """Length along the path, m.

    Source: the plane in which the conditions hold; see the module.
    """
    places, code = _on_plane(inputs, begin)
    length = path_length(places)
    return Length(length, _with_extent(code, length))


def plane_conditions_area(inputs: Outline, begin: Plane) -> Area:
    """Area inside the outline, m², and the outline's length, m.

    Source: the plane in which the conditions hold, see the module; the shoelace formula.
    """
    places, code = _on_plane(inputs, begin)
    outline = path_length(places, closed=True)
    return Area(enclosed_area(places), outline, _with_extent(code, outline))


def plane_conditions_angle(inputs: Corner, begin: Plane) -> Angle:
    """Angle at the corner, rad.

    Source: the plane in which the conditions hold; see the module.
    """
    places, code = _on_plane(inputs, begin)
    one, other = (places[..., i, :] - places[..., 1, :] for i in (0, 2))
    shorter = np.minimum(np.sum(one**2, -1), np.sum(other**2, -1))
    return Angle(angle_between(one, other), _with_extent(code, shorter))


def notes(inputs: Inputs, result: Length | Area | Angle) -> tuple[Note, ...]:
    """`conditions_misfit`, `conditions_unchecked`, `outline_crosses` and `distortion_unknown`."""
    begin, found = start(inputs), []
    if begin.freedom <= 0:
        text = (
            "the conditions are just enough, so some plane meets them whatever the clicks: a wrong one can't be noticed"
        )
        found.append(
            Note("conditions_unchecked", text, "give one more: a parallel, a right angle, equal or known lengths")
        )
    elif begin.misfit:
        found.append(_misfit(inputs, begin))
    if isinstance(result, Area) and crosses(inputs.points.points_px[list(inputs.wanted)]):
        found.append(Note("outline_crosses", "the outline of the area crosses itself, and parts of it are subtracted from others",
                          "name its corners in order around it"))  # fmt: skip
    if inputs.camera is None and inputs.distortion.source.startswith(ASSUMED):
        found.append(Note("distortion_unknown", "nothing is known of the lens's distortion: "
                          f"{100 * float(inputs.distortion.u):.2g} % (1s) in the corners of the picture is in u",
                          "give a calibrated camera, or measure near the middle of the picture"))  # fmt: skip
    return tuple(found)


def _misfit(inputs: Inputs, begin: Plane) -> Note:
    """The conditions contradict each other, and which does so most."""
    assert begin.lone is not None
    worst = int(np.argmax(begin.lone))
    said = _said(inputs, inputs.read.each[worst])
    if begin.freedom == 1:  # one contradiction is all, and is no single condition's
        text = f"the conditions contradict each other by {begin.lone[worst]:.2g} times what is stated of points and lengths"
        cure = "check that all of them hold in this plane, and the clicks; one more condition would tell which is wrong"
    else:
        text = (f"the conditions contradict each other: the {said} is off what the others say by {begin.lone[worst]:.2g} times "
                "what is stated of points and lengths")  # fmt: skip
        cure = f"check whether the {said} holds in this plane, and its clicks"
    return Note("conditions_misfit", f"{text}, and the interval is too narrow", cure)


def _said(inputs: Inputs, one: Condition) -> str:
    """A condition in words, by its pixels."""
    ends = [";".join(f"{x:.0f},{y:.0f}" for x, y in inputs.points.points_px[list(one.points[i : i + 2])])
            for i in range(0, len(one.points), 2)]  # fmt: skip
    return f"{WORDS[one.kind]} {' | '.join(ends)}"


def _example(kind: type[Inputs], conditions: str, path: str, length: Quantity | None) -> Inputs:
    """A window of which the width is known, and three points beside it, by a camera."""
    camera = Camera(1600, 1200, 1300.0, 799.5, 599.5, cov=np.diag([13.0**2, 0, 8.0**2, 8.0**2]))
    c, s = math.cos(math.radians(35)), math.sin(math.radians(35))
    flat = np.array([(-1, -0.7), (0.8, -0.7), (0.8, 0.6), (-1, 0.6), (1.0, -0.5), (1.0, 0.5), (1.4, 0.5)])
    seen = camera.project(np.column_stack([c * flat[:, 0], flat[:, 1], 4 - s * flat[:, 0]]))
    return kind(Observation(seen, 0.7), conditions, path, length, camera=camera)


def example() -> Inputs:
    """A length beside a window of which only the width is known."""
    return _example(Inputs, "rectangle 1 2 3 4; length 1 2", "5 6", Quantity.normal(1.8, 0.005, "m"))


def example_area() -> Inputs:
    """A triangle beside a window of which only the width is known."""
    return _example(Outline, "rectangle 1 2 3 4; length 1 2", "5 6 7", Quantity.normal(1.8, 0.005, "m"))


def example_angle() -> Inputs:
    """An angle beside a window of unknown size."""
    return _example(Corner, "rectangle 1 2 3 4", "5 6 7", None)


_ASSUMES = ("the conditions hold: right angles are right, parallels parallel", "all points lie in one plane",
            "the lens draws as the camera says, or, without one, with the distortion that is in the interval")  # fmt: skip
_SOURCE = "R. Hartley, A. Zisserman, Multiple View Geometry, 2.7; D. Liebowitz, A. Zisserman, CVPR 1998"

METHOD = Method(
    name="plane_conditions", title="a length or a path in a plane known by right angles, parallels and a length", inputs=Inputs,
    outputs=(Output("length_m", "length", "m", "length"),), function=plane_conditions, assumes=_ASSUMES, source=_SOURCE,
    typical="0.5 to 3 %", example=example, start=start, notes=notes, most_draws=100_000,
)  # fmt: skip

AREA = Method(
    name="plane_conditions_area", title="an area in a plane known by right angles, parallels and a length", inputs=Outline,
    outputs=(Output("area_m2", "area", "m²", "area"), Output("outline_m", "length", "m", "length of the outline")),
    function=plane_conditions_area, assumes=_ASSUMES, source=_SOURCE, typical="1 to 6 %", example=example_area, start=start,
    notes=notes, most_draws=100_000,
)  # fmt: skip

ANGLE = Method(
    name="plane_conditions_angle", title="an angle in a plane known by right angles and parallels", inputs=Corner,
    outputs=(Output("angle_rad", "corner", "rad", "angle in the plane"),), function=plane_conditions_angle, assumes=_ASSUMES,
    source=_SOURCE, typical="0.3 to 2 degrees", example=example_angle, start=start, notes=notes, most_draws=100_000,
)  # fmt: skip
