"""Lengths, paths, areas and angles in a plane, from four or more points of it whose places are known.

The reference points give the homography between plane and picture, by least squares with the covariance of all that is doubtful of
them. No focal length is needed. With a camera the points are undistorted first; without one the distortion that a lens may have
is in the interval. What stands off the plane by a height h towards the camera is seen on it 1 / (1 - h / H) times as large, H
being the camera's height over the plane: known with a camera, or to be stated.

Source: A. Criminisi, I. Reid, A. Zisserman, A plane measuring device, Image and Vision Computing 17, 1999.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from ..arrays import Array, Bools, Codes
from ..camera import Camera
from ..errors import InputError
from ..flat_path import Angle, Area, Length, angle_between, crosses, enclosed_area, path_length
from ..flat_view import (
    ASSUMED,
    MOST_POINTS,
    Disc,
    FlatView,
    check_reference,
    flat_view,
    reference_notes,
    straight_view,
    unknown_distortion,
)
from ..homography import refined, refined_pose, transfer
from ..lenses import LENSES
from ..method import Method, Output, Reason, reasons
from ..observation import Observation
from ..quantity import Note, Quantity
from ..target import Target

MOST_DRAWS = 100_000
"""Each solves the plane anew."""


def in_plane() -> Quantity:
    """What is measured lies in the plane."""
    return Quantity.exact(0.0, "m", "what is measured lies in the plane")


@dataclass(frozen=True)
class Inputs:
    """Four or more reference points of a plane, their places in it, and the points of what is wanted.

    Attributes:
        points: point i is point i of the target.
        target: places of the reference points, at least four, no three on one line.
        path: two or more points: a length or a path; the outline of an area; three for an angle, its corner in the middle.
        camera: of the upright picture; left out, lengths in the plane need none.
        off_plane: how far what is measured stands off the plane, towards the camera, m; needs a camera or `camera_height`.
        camera_height: of the camera over the plane, m; left out, it is had from the camera and the reference points.
        distortion: radial distortion in the corner, as share of the distance from the middle, where there is no camera.
        frame: two opposite corners of the whole picture, where there is no camera.
    """

    points: Observation = field(metadata={"points": 4, "more": True, "closed": True})
    target: Target
    path: Observation = field(metadata={"points": 2, "more": True})
    camera: Camera | None = None
    off_plane: Quantity = field(default_factory=in_plane, metadata={"unit": "m"})
    camera_height: Quantity | None = field(default=None, metadata={"unit": "m", "assume": "size"})
    distortion: Quantity = field(default_factory=unknown_distortion, metadata={"unit": "1"})
    frame: Observation | None = field(default=None, metadata={"of_photo": True})

    def __post_init__(self) -> None:
        check_reference(self.points, self.target)
        count = self.path.points_px.shape[-2]
        if not 2 <= count <= MOST_POINTS:
            raise InputError("path", f"{count} points", f"give two or more, {MOST_POINTS} at most")
        if self.raised and self.camera is None and self.camera_height is None:
            raise InputError("off_plane", str(np.asarray(self.off_plane.value).tolist()),
                             "give the camera too, or its height over the plane with camera_height")  # fmt: skip

    @property
    def raised(self) -> bool:
        """Whether what is measured may stand off the plane."""
        return bool(np.any(self.off_plane.value) or np.any(self.off_plane.u))


@dataclass(frozen=True)
class Outline(Inputs):
    """Four or more reference points of a plane, their places in it, and the corners of an area.

    Attributes:
        points: point i is point i of the target.
        target: places of the reference points, at least four, no three on one line.
        path: three or more corners of the area, in order around it.
        camera: of the upright picture; left out, areas in the plane need none.
        off_plane: how far what is measured stands off the plane, towards the camera, m; needs a camera or `camera_height`.
        camera_height: of the camera over the plane, m; left out, it is had from the camera and the reference points.
        distortion: radial distortion in the corner, as share of the distance from the middle, where there is no camera.
        frame: two opposite corners of the whole picture, where there is no camera.
    """

    path: Observation = field(metadata={"points": 3, "more": True, "closed": True})

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.path.points_px.shape[-2] < 3:
            raise InputError("path", f"{self.path.points_px.shape[-2]} points", "give three corners or more")


@dataclass(frozen=True)
class Corner(Inputs):
    """Four or more reference points of a plane, their places in it, and three points of an angle.

    Attributes:
        points: point i is point i of the target.
        target: places of the reference points, at least four, no three on one line.
        path: three points: on one side of the angle, its corner, and on the other side.
        camera: of the upright picture; left out, angles in the plane need none.
        off_plane: how far what is measured stands off the plane; it does not change an angle.
        camera_height: of the camera over the plane, m.
        distortion: radial distortion in the corner, as share of the distance from the middle, where there is no camera.
        frame: two opposite corners of the whole picture, where there is no camera.
    """

    path: Observation = field(metadata={"points": 3})

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.path.points_px.shape[-2] != 3:
            raise InputError("path", f"{self.path.points_px.shape[-2]} points", "give three, the corner in the middle")


@lru_cache(maxsize=8)
def start(inputs: Inputs) -> FlatView:
    """Fit the nominal scene."""
    disc = Disc.around(inputs.frame, inputs.points, inputs.path)
    wanted = inputs.raised and inputs.camera_height is None
    return flat_view(inputs.camera, inputs.points, inputs.target, inputs.distortion, disc, place=wanted)


def _on_plane(inputs: Inputs, begin: FlatView) -> tuple[Array, Codes]:
    """(..., M, 2) places of the path, m, but for a shift that all share; and the reasons why there are none."""
    known, fit = inputs.target.points_m, begin.fit
    seen = straight_view(inputs.camera, inputs.points.points_px, inputs.distortion, begin.disc)
    path = straight_view(inputs.camera, inputs.path.points_px, inputs.distortion, begin.disc)
    lead = np.broadcast_shapes(known.shape[:-2], seen.shape[:-2], path.shape[:-2])
    plane = fit.plane.enter(known[..., :2])
    h = refined(fit.h, plane, fit.seen.enter(seen), fit.gain) if np.all(np.isfinite(fit.h)) else fit.h
    depths = transfer(h, plane)[1]
    places, third = transfer(_inverse(h), fit.seen.enter(path))
    places = places * fit.plane.scale
    factor, lost = _off_plane_factor(inputs, begin, seen, lead)
    perspective = np.asarray(inputs.camera is not None and not LENSES[inputs.camera.lens].perspective)
    lead = np.broadcast_shapes(lead, factor.shape)
    missing = np.asarray(~(np.isfinite(seen).all(axis=(-1, -2)) & np.isfinite(path).all(axis=(-1, -2))))
    undetermined = np.asarray(~np.isfinite(h).all(axis=(-1, -2)))
    code = reasons(
        lead, (perspective, Reason.NOT_PINHOLE), (missing, Reason.NOT_INVERTIBLE),
        (undetermined, Reason.COLLINEAR), (~np.all(depths > 0, axis=-1), Reason.FOLDED),
        (~np.all(third > 0, axis=-1), Reason.BEYOND_HORIZON), (lost, Reason.NOT_CONVERGED), (~(factor > 0), Reason.OUT_OF_RANGE),
    )  # fmt: skip
    return places * factor[..., None, None], code


def _inverse(h: Array) -> Array:
    """(..., 3, 3) adjugate over the determinant; NaN where there is none."""
    a, b, c = h[..., 0, :], h[..., 1, :], h[..., 2, :]
    rows = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], -1)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(rows / np.sum(a * np.cross(b, c), -1)[..., None, None])


def _off_plane_factor(inputs: Inputs, begin: FlatView, seen: Array, lead: tuple[int, ...]) -> tuple[Array, Bools]:
    """(...) what lengths on the plane are multiplied by for their height over it, and whether the plane's place is not known."""
    lost = np.zeros((), bool)
    if not (inputs.raised or np.any(np.asarray(inputs.off_plane.value))):
        return np.ones(lead), lost
    if inputs.camera_height is not None:
        over = np.asarray(inputs.camera_height.value, float)
    elif not begin.poses or begin.whiten is None:
        return np.ones(lead), ~lost
    else:
        pose = refined_pose(begin.poses[0], inputs.target.points_m, seen, begin.whiten, 3)
        over = abs(np.sum(pose.rotation[..., :, 2] * pose.translation_m, -1))
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.broadcast_to(
            1 - np.asarray(inputs.off_plane.value) / over, np.broadcast_shapes(lead, over.shape)
        ), lost


def _with_extent(code: Codes, numbers: Array) -> Codes:
    """The reasons, with what has no extent among them."""
    empty = (code == 0) & ~(numbers > 0)
    return np.where(empty, np.int8(Reason.ZERO_EXTENT), code)


def plane(inputs: Inputs, begin: FlatView) -> Length:
    """Length along the path, m.

    Source: the homography of the reference points; see the module.
    """
    places, code = _on_plane(inputs, begin)
    length = path_length(places)
    return Length(length, _with_extent(code, length))


def plane_area(inputs: Outline, begin: FlatView) -> Area:
    """Area inside the outline, m², and the outline's length, m.

    Source: the homography of the reference points, see the module; the shoelace formula.
    """
    places, code = _on_plane(inputs, begin)
    outline = path_length(places, closed=True)
    return Area(enclosed_area(places), outline, _with_extent(code, outline))


def plane_angle(inputs: Corner, begin: FlatView) -> Angle:
    """Angle at the corner, rad.

    Source: the homography of the reference points; see the module.
    """
    places, code = _on_plane(inputs, begin)
    one, other = (places[..., i, :] - places[..., 1, :] for i in (0, 2))
    shorter = np.minimum(np.sum(one**2, -1), np.sum(other**2, -1))
    return Angle(angle_between(one, other), _with_extent(code, shorter))


def notes(inputs: Inputs, result: Length | Area | Angle) -> tuple[Note, ...]:
    """`points_misfit`, `points_unchecked`, `distortion_unknown`, `outline_crosses` and `off_plane`."""
    found = reference_notes(start(inputs), inputs.points.points_px.shape[-2])
    if inputs.camera is None and inputs.distortion.source.startswith(ASSUMED):
        found.append(Note("distortion_unknown", "nothing is known of the lens's distortion: "
                          f"{100 * float(inputs.distortion.u):.2g} % (1s) in the corners of the picture is in u",
                          "give a calibrated camera, or measure near the reference points and the middle of the picture"))  # fmt: skip
    if isinstance(result, Area) and crosses(inputs.path.points_px):
        found.append(Note("outline_crosses", "the outline of the area crosses itself, and parts of it are subtracted from others",
                          "mark its corners in order around it"))  # fmt: skip
    if inputs.raised and not isinstance(result, Angle):
        factor, _ = _off_plane_factor(inputs, start(inputs), straight_view(
            inputs.camera, inputs.points.points_px, inputs.distortion, start(inputs).disc), ())  # fmt: skip
        text = (f"what is measured stands {1000 * float(inputs.off_plane.value):.3g} mm off the plane: lengths on the plane are taken "
                f"{100 * (float(factor) - 1):+.2g} %")  # fmt: skip
        found.append(Note("off_plane", text, "lay the reference at the height of what is measured"))
    return tuple(found)


def _example(kind: type[Inputs], path: list[tuple[float, float]]) -> Inputs:
    """A sheet of A4 seen from the side, with the middles of its long sides; all points to 0.3 px."""
    w, h = 0.1485, 0.105
    places = np.array([[-w, -h, 0], [w, -h, 0], [w, h, 0], [-w, h, 0], [0, -h, 0], [0, h, 0.0]])
    whole = np.array([[2400.0, 500.0, 1600.0], [-150.0, 1900.0, 1200.0], [0.5, 0.9, 1.0]])
    seen = transfer(whole, places[:, :2])[0]
    reference = Target("sheet of A4", places, 0.002, source="stated")
    return kind(Observation(seen, 0.3, label="reference"), reference,
                Observation(transfer(whole, np.array(path))[0], 0.3, label="what is wanted"),
                frame=Observation(np.array([[-0.5, -0.5], [3199.5, 2399.5]]), 0.0, label="picture"))  # fmt: skip


def example() -> Inputs:
    """A length of 0.3 m beside a sheet of A4."""
    return _example(Inputs, [(0.2, -0.1), (0.2, 0.2)])


def example_area() -> Inputs:
    """A triangle beside a sheet of A4."""
    return _example(Outline, [(0.2, -0.1), (0.4, 0.1), (0.2, 0.2)])


def example_angle() -> Inputs:
    """A right angle beside a sheet of A4."""
    return _example(Corner, [(0.2, -0.1), (0.3, 0.0), (0.2, 0.1)])


_ASSUMES = ("the reference points have the places that are stated, and lie in one plane",
            "what is measured lies in that plane, or off it as stated",
            "the lens draws as the camera says, or, without one, with the distortion that is in the interval")  # fmt: skip
_SOURCE = "A. Criminisi, I. Reid, A. Zisserman, Image and Vision Computing 17, 1999; R. Hartley, A. Zisserman, 4.1"

METHOD = Method(
    name="plane", title="a length or a path in a plane with four known points", inputs=Inputs,
    outputs=(Output("length_m", "length", "m", "length"),), function=plane, assumes=_ASSUMES, source=_SOURCE,
    typical="0.2 to 1 % near the reference, more away from it", example=example, button="Plane length", start=start, notes=notes,
    most_draws=MOST_DRAWS,
)  # fmt: skip

AREA = Method(
    name="plane_area", title="an area in a plane with four known points", inputs=Outline,
    outputs=(Output("area_m2", "area", "m²", "area"), Output("outline_m", "length", "m", "length of the outline")),
    function=plane_area, assumes=_ASSUMES, source=_SOURCE, typical="0.5 to 2 % near the reference, more away from it",
    example=example_area, button="Plane area", start=start, notes=notes,
    most_draws=MOST_DRAWS,
)  # fmt: skip

ANGLE = Method(
    name="plane_angle", title="an angle in a plane with four known points", inputs=Corner,
    outputs=(Output("angle_rad", "corner", "rad", "angle in the plane"),), function=plane_angle, assumes=_ASSUMES, source=_SOURCE,
    typical="0.2 to 1 degree", example=example_angle, button="Plane angle", start=start, notes=notes,
    most_draws=MOST_DRAWS,
)  # fmt: skip
