"""Triangulation: a point seen from two or more known places, and lengths between such points.

Where the lines of sight meet best is found by `sighting`. Points of one scene share the errors of its cameras and their places, which
therefore largely cancel in the length between them. A known motion of the camera (a slider, a flight) is the distance between the
first two places, `baseline`.

Source: R. Hartley, A. Zisserman, Multiple View Geometry, 12.2 and 12.6; inverse depth: J. Civera, A. Davison, J. Montiel, IEEE
Transactions on Robotics 24, 2008.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..arrays import Array, Codes
from ..camera import Camera
from ..errors import InputError
from ..geometry import rotation_from_vector
from ..method import Method, Output
from ..quantity import Note, Quantity
from ..sighting import STEPS, Start, located, rays_of, relative, residual, settled, start_of
from ..views import Track, Views

SMALL_PARALLAX_DEG = 2.0
"""Lines of sight that meet at less are noted."""
CHANCE_Z = 3.72
"""Normal quantile (1 in 10,000) beyond which residuals are no chance."""


@dataclass(frozen=True)
class Inputs:
    """Two or more pictures whose places are known, and one point in them.

    Attributes:
        views: the pictures with cameras and places.
        point: where it lies in two or more of them; range and depth are those from the first one named.
        baseline: distance between the places of the first two of `views`, m; left out, the places are in metres as stated.
    """

    views: Views
    point: Track
    baseline: Quantity | None = field(default=None, metadata={"unit": "m", "assume": "size"})

    def __post_init__(self) -> None:
        _check(self.views, (self.point,), self.baseline)


@dataclass(frozen=True)
class LengthInputs:
    """Two or more pictures whose places are known, and two points, each in two or more of them.

    Attributes:
        views: the pictures with cameras and places.
        first: where one end lies; or one picture without a point, for the place where that was taken.
        second: where the other end lies, in the same pictures or others.
        baseline: distance between the places of the first two of `views`, m; left out, the places are in metres as stated.
    """

    views: Views
    first: Track
    second: Track
    baseline: Quantity | None = field(default=None, metadata={"unit": "m", "assume": "size"})

    def __post_init__(self) -> None:
        _check(self.views, (self.first, self.second), self.baseline, places=True)


@dataclass(frozen=True)
class CamerasInputs:
    """Two or more pictures whose places are known.

    Attributes:
        views: the pictures with cameras and places; the distance is that between the first two.
    """

    views: Views

    def __post_init__(self) -> None:
        if len(self.views.names) < 2:
            raise InputError("views", f"{len(self.views.names)} picture", "give two or more")


def _check(views: Views, tracks: Sequence[Track], baseline: Quantity | None, *, places: bool = False) -> None:
    for track in tracks:
        if len(track.names) < 2 and not (places and track.is_place):
            raise InputError("point", "; ".join(track.names), "give it in two pictures or more")
        for name in track.names:
            views.index(name)
    if baseline is not None and len(views.names) < 2:
        raise InputError("baseline", "of one picture", "give two pictures or more")
    if baseline is not None and not np.all(np.asarray(baseline.value) > 0):
        raise InputError("baseline", float(np.min(baseline.value)), "give a length above 0")


@dataclass(frozen=True)
class Result:
    """Arrays (...): range from the entrance pupil and depth of the point, from the first picture, and its place."""

    range_m: Array
    depth_m: Array
    x_m: Array
    y_m: Array
    z_m: Array
    reason: Codes


@dataclass(frozen=True)
class LengthResult:
    """Arrays (...): the length between the two points."""

    length_m: Array
    reason: Codes


def start(inputs: Inputs) -> Start:
    """The nominal point."""
    return start_of(inputs.views, inputs.point)


def start_length(inputs: LengthInputs) -> tuple[Start, Start]:
    """The nominal ends."""
    return start_of(inputs.views, inputs.first), start_of(inputs.views, inputs.second)


def triangulation(inputs: Inputs, begin: Start) -> Result:
    """Range and depth from the first picture of the point, and its place in the frame of the places, m.

    Source: reprojection least squares in direction and inverse range; see the module.
    """
    own, world, code = located(inputs.views, inputs.point, inputs.baseline, begin)
    shape = code.shape
    x, y, z = (np.broadcast_to(world[..., i], shape) for i in range(3))
    return Result(
        np.broadcast_to(np.linalg.norm(own, axis=-1), shape), np.broadcast_to(own[..., 2], shape), x, y, z, code
    )


def triangulated_length(inputs: LengthInputs, begin: tuple[Start, Start]) -> LengthResult:
    """Length between the two points, m.

    Source: both by reprojection least squares, with the cameras' errors in common; see the module.
    """
    ends = [
        located(inputs.views, track, inputs.baseline, one)
        for track, one in zip((inputs.first, inputs.second), begin, strict=True)
    ]
    code = np.maximum(ends[0][2], ends[1][2])
    return LengthResult(np.broadcast_to(np.linalg.norm(ends[1][1] - ends[0][1], axis=-1), code.shape), code)


def cameras_apart(inputs: CamerasInputs) -> LengthResult:
    """Distance between the entrance pupils of the first two pictures, m.

    Source: their places; see the module.
    """
    places = inputs.views.places_m
    apart = np.linalg.norm(places[..., 1, :] - places[..., 0, :], axis=-1)
    return LengthResult(apart, np.zeros(np.shape(apart), np.int8))


# -- doubts --------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Residuals:
    """Whitened residuals as fields of a result, so that their covariance can be had like any other."""

    values: Array
    reason: Codes

    def __getattr__(self, name: str) -> Array:
        if name.startswith("r"):
            return np.asarray(self.values[..., int(name[1:])])
        raise AttributeError(name)


def _misfit(views: Views, track: Track) -> float:
    """How many deviations the lines of sight pass each other by, rms, where that is beyond chance; 0 else."""
    from .. import propagate  # the only place that calculates with sigma

    count = 2 * len(track.names)

    def residuals(inputs: dict[str, Any], begin: Start) -> _Residuals:
        rays = rays_of(inputs["views"], inputs["track"])
        turns, shifts = relative(inputs["views"], inputs["track"])
        found, _ = settled(begin, rays, turns, shifts, STEPS)
        axes = np.stack([begin.tangents[0, 0], begin.tangents[0, 1]], -1)
        place = (turns @ (begin.direction + found[..., :2] @ axes.T)[..., None, :, None])[..., 0] + found[
            ..., None, 2:
        ] * shifts
        left = residual(begin, rays, place)[0]
        values = (begin.whiten @ left.reshape(*left.shape[:-2], -1, 1))[..., 0]
        return _Residuals(values, np.zeros(values.shape[:-1], np.int8))

    begin = start_of(views, track)
    outputs = tuple(Output(f"r{i}", "residual", "1", "residual") for i in range(count))
    of = Method("residuals", "", dict, outputs, residuals, (), "", "", dict, start=lambda _: begin)
    found = propagate.first_order(of, {"views": views.subset(track.names), "track": track})
    assert found.cov is not None
    values, vectors = np.linalg.eigh(found.cov)
    free = values > 1e-9 * max(values[-1], 1e-300)
    along = (vectors[:, free].T @ found.value) / np.sqrt(values[free])
    chi2, freedom = float(along @ along), int(free.sum())
    if not freedom:
        return 0.0
    spread = 2 / (9 * freedom)
    most = freedom * (1 - spread + CHANCE_Z * math.sqrt(spread)) ** 3  # Wilson and Hilferty's quantile of chi^2
    return math.sqrt(chi2 / freedom) if chi2 > most else 0.0


def _parallax_rad(views: Views, track: Track) -> float:
    """The largest angle between two lines of sight of the point."""
    rays = np.stack(
        [
            views.rotation[views.index(name)].T @ ray
            for name, ray in zip(track.names, rays_of(views, track), strict=True)
        ]
    )
    across = [np.linalg.norm(np.cross(a, b)) for i, a in enumerate(rays) for b in rays[:i]]
    return math.asin(min(max(map(float, across)), 1.0))


def _doubts(views: Views, tracks: Sequence[Track]) -> tuple[Note, ...]:
    found = []
    for track in (one for one in tracks if not one.is_place):
        what = track.seen.label or "the point"
        misfit = _misfit(views, track)
        if misfit:
            text = (f"{what}: the lines of sight pass each other by {misfit:.2g} times what is stated of pictures and places, and the "
                    "interval is too narrow")  # fmt: skip
            found.append(
                Note(
                    "rays_disagree",
                    text,
                    "check that it is one point in all pictures, and how well the places are known",
                )
            )
        angle = math.degrees(_parallax_rad(views, track))
        if angle < SMALL_PARALLAX_DEG:
            text = (f"{what}: the lines of sight meet at only {angle:.2g}°, so small errors of a picture or its rotation are large ones "
                    "of the distance")  # fmt: skip
            found.append(Note("small_parallax", text, "take the pictures from places farther apart"))
    return tuple(found)


def notes(inputs: Inputs, _: Result) -> tuple[Note, ...]:
    """`rays_disagree` and `small_parallax`."""
    return _doubts(inputs.views, (inputs.point,))


def length_notes(inputs: LengthInputs, _: LengthResult) -> tuple[Note, ...]:
    """`rays_disagree` and `small_parallax`, for each end."""
    return _doubts(inputs.views, (inputs.first, inputs.second))


# -- examples ------------------------------------------------------------------------------------------


def _example_views() -> Views:
    """A camera on a slider, at 0 and 0.5 m, and a third place above the second."""
    camera = Camera(1600, 1200, 1500.0, 799.5, 599.5, cov=np.diag([6.0**2, 0, 4.0**2, 4.0**2]))
    turns = rotation_from_vector(np.array([[0.0, 0, 0], [0.0, 0.1, 0], [-0.1, 0.1, 0]]))
    places = np.array([[0.0, 0, 0], [0.5, 0, 0], [0.5, -0.4, 0.05]])
    return Views.independent(
        ("a.jpg", "b.jpg", "c.jpg"), (camera,), turns, places, u_rotation_rad=2e-4, u_centre_m=5e-4
    )


def seen_by(views: Views, point_m: Array, sigma_px: float, names: Sequence[str] = (), label: str = "") -> Track:
    """Where a point of the world lies in the named pictures, all of them if none is named."""
    from ..observation import Observation

    of = tuple(names) or views.names
    rows = [views.index(name) for name in of]
    pixels = [views.camera(i).project((views.rotation[i] @ (point_m - views.places_m[i]))[None])[0] for i in rows]
    return Track(of, Observation(np.array(pixels), sigma_px, label=label))


def example() -> Inputs:
    """A point about 4 m in front of a camera on a slider."""
    views = _example_views()
    return Inputs(views, seen_by(views, np.array([0.3, -0.2, 4.0]), 0.3))


def example_length() -> LengthInputs:
    """Two points 1.2 m apart, 4 m in front of a camera on a slider, whose travel is known to 0.2 mm."""
    views = _example_views()
    ends = [
        seen_by(views, np.array([x, -0.2, 4.0]), 0.3, label=name)
        for x, name in ((-0.5, "left end"), (0.7, "right end"))
    ]
    return LengthInputs(views, ends[0], ends[1], Quantity.normal(0.5, 0.0002, "m"))


def example_cameras() -> CamerasInputs:
    """The first two places of a slider."""
    return CamerasInputs(_example_views())


_TOLD = ("it is the same point in all pictures, and did not move", "the cameras stood where stated")

METHOD = Method(
    name="triangulation",
    title="a point seen from two or more known places",
    inputs=Inputs,
    outputs=(Output("range_m", "range", "m", "range (from the entrance pupil of the first picture)"),
             Output("depth_m", "depth", "m", "depth (along the axis of the first picture)"),
             Output("x_m", "position_x", "m", "place, x", nonnegative=False),
             Output("y_m", "position_y", "m", "place, y", nonnegative=False),
             Output("z_m", "position_z", "m", "place, z", nonnegative=False)),
    function=triangulation,
    assumes=_TOLD,
    source="R. Hartley, A. Zisserman, Multiple View Geometry, 12.2",
    typical="0.1 to 1 % at 10 baselines, 10 times that at 100",
    example=example,
    start=start,
    notes=notes,
    most_draws=100_000,
)  # fmt: skip

LENGTH = Method(
    name="triangulated_length",
    title="the length between two points seen from known places",
    inputs=LengthInputs,
    outputs=(Output("length_m", "length", "m", "length"),),
    function=triangulated_length,
    assumes=_TOLD,
    source="R. Hartley, A. Zisserman, Multiple View Geometry, 12.2",
    typical="0.1 to 1 %",
    example=example_length,
    start=start_length,
    notes=length_notes,
    most_draws=100_000,
)

CAMERAS = Method(
    name="cameras_apart",
    title="the distance between two known places of cameras",
    inputs=CamerasInputs,
    outputs=(Output("length_m", "length", "m", "distance between the cameras"),),
    function=cameras_apart,
    assumes=("the cameras stood where stated",),
    source="Euclid's distance",
    typical="as the places are known",
    example=example_cameras,
)
