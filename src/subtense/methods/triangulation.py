"""Triangulation: a point seen from two or more known places, and lengths between such points.

Each picture gives a line of sight; the point is where they meet best, in whitened pixels. It is sought as a direction from the first
picture and an inverse range along it, in which the residuals are nearly straight however small the parallax:

    X_i = R_i (R_1^T (d + a e1 + b e2) + w (C_1 - C_i)),   minimise  sum |whitened (X_i / z_i - seen direction i)|^2  over a, b, w

with the residual taken in the plane across the seen direction, so that any lens will do. Points of one scene share the errors of its
cameras and their places, which therefore largely cancel in the length between them. A known motion of the camera (a slider, a flight)
is the distance between the first two places, `baseline`.

Source: R. Hartley, A. Zisserman, Multiple View Geometry, 12.2 and 12.6; inverse depth: J. Civera, A. Davison, J. Montiel, IEEE
Transactions on Robotics 24, 2008.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np

from ..arrays import Array, Codes
from ..camera import Camera
from ..errors import InputError
from ..geometry import rotation_from_vector
from ..method import Method, Output, Reason, reasons
from ..quantity import Note, Quantity
from ..views import Track, Views

STEPS = 3
"""Gauss-Newton steps of a moved scene from the nominal point."""
MOST_STEPS = 30
SMALL_PARALLAX_DEG = 2.0
"""Lines of sight that meet at less are noted."""
CHANCE_Z = 3.72
"""Normal quantile (1 in 10,000) beyond which residuals are no chance."""
BEHIND_SIGMAS = 4.0
"""How far beyond infinity, in its own deviation, an inverse range lies behind the cameras rather than at infinity."""
LEAST_SIGMA_PX = 1e-3


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
        first: where one end lies.
        second: where the other end lies, in the same pictures or others.
        baseline: distance between the places of the first two of `views`, m; left out, the places are in metres as stated.
    """

    views: Views
    first: Track
    second: Track
    baseline: Quantity | None = field(default=None, metadata={"unit": "m", "assume": "size"})

    def __post_init__(self) -> None:
        _check(self.views, (self.first, self.second), self.baseline)


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


def _check(views: Views, tracks: Sequence[Track], baseline: Quantity | None) -> None:
    for track in tracks:
        if len(track.names) < 2:
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


@dataclass(frozen=True, eq=False)
class Start:
    """The nominal point, from which moved scenes take a few steps.

    Attributes:
        direction: (3,) seen in the first picture, in its camera's frame.
        tangents: (N, 2, 3) two axes across each seen direction, in the frame of its camera.
        whiten: (2N, 2N), by which residuals across the seen directions get unit variance.
        solution: (3,) the nominal a, b, and w in 1 / (distance between the first two pictures of the point).
        behind: whether the lines of sight meet behind the cameras, beyond doubt.
    """

    direction: Array
    tangents: Array
    whiten: Array
    solution: Array
    behind: bool


def start(inputs: Inputs) -> Start:
    """The nominal point."""
    return _start(inputs.views, inputs.point)


def start_length(inputs: LengthInputs) -> tuple[Start, Start]:
    """The nominal ends."""
    return _start(inputs.views, inputs.first), _start(inputs.views, inputs.second)


@lru_cache(maxsize=32)
def _start(views: Views, track: Track) -> Start:
    rays, pixel_steps = _nominal_rays(views, track)
    tangents = np.stack([_across(ray) for ray in rays])
    whiten = _whitening(track, tangents, pixel_steps)
    begin = Start(rays[0], tangents, whiten, np.zeros(3), False)
    if not (np.all(np.isfinite(rays)) and np.all(np.isfinite(whiten))):
        return begin
    turns, shifts = _relative(views, track)
    a = np.cross(rays[1:], (turns[1:] @ rays[0]))
    b = np.cross(rays[1:], shifts[1:])
    squared = float(np.sum(b * b))
    w = -float(np.sum(a * b)) / squared if squared > 0 else 0.0
    begin = Start(rays[0], tangents, whiten, np.array([0.0, 0.0, w]), False)
    solution, normal = _settled(begin, rays, turns, shifts, MOST_STEPS)
    with np.errstate(all="ignore"):
        spread = math.sqrt(max(float(np.linalg.pinv(normal)[2, 2]), 0.0))
    return Start(rays[0], tangents, whiten, solution, bool(solution[2] < -BEHIND_SIGMAS * spread))


def _nominal_rays(views: Views, track: Track) -> tuple[Array, Array]:
    """(N, 3) seen directions, and (N, 3, 2) how they move by a pixel."""
    rays, steps = [], []
    offset = np.array([[0.0, 0], [0.5, 0], [-0.5, 0], [0, 0.5], [0, -0.5]])
    for name, place in zip(track.names, track.seen.points_px.reshape(-1, len(track.names), 2)[0], strict=True):
        around = views.camera(views.index(name)).rays(place + offset)
        around = around.reshape(-1, 5, 3)[0]
        rays.append(around[0])
        steps.append(np.stack([around[1] - around[2], around[3] - around[4]], -1))
    return np.stack(rays), np.stack(steps)


def _across(ray: Array) -> Array:
    """(2, 3) unit axes across a direction."""
    first = np.cross(ray, np.eye(3)[np.argmin(abs(np.nan_to_num(ray)))])
    first = first / np.linalg.norm(first)
    return np.stack([first, np.cross(ray, first)])


def _whitening(track: Track, tangents: Array, pixel_steps: Array) -> Array:
    n = len(tangents)
    per_pixel = tangents @ pixel_steps
    to_directions = np.zeros((2 * n, 2 * n))
    for i in range(n):
        to_directions[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = per_pixel[i]
    seen = track.seen
    floored = np.maximum(seen.standard_deviations.reshape(2 * n, -1)[:, 0], LEAST_SIGMA_PX) ** 2
    cov = np.diag(floored) if seen.cov is None else np.asarray(seen.cov) + LEAST_SIGMA_PX**2 * np.eye(2 * n)
    spread = to_directions @ cov @ to_directions.T
    if not np.all(np.isfinite(spread)):
        return np.full((2 * n, 2 * n), np.nan)
    return np.asarray(np.linalg.inv(np.linalg.cholesky(spread)))


def _relative(views: Views, track: Track) -> tuple[Array, Array]:
    """Of each picture from the first: (..., N, 3, 3) rotations, and (..., N, 3) shifts in units of the first two's distance."""
    rows = [views.index(name) for name in track.names]
    rotation, centre = views.rotation[..., rows, :, :], views.centre_m[..., rows, :]
    turns = rotation @ np.swapaxes(rotation[..., :1, :, :], -1, -2)
    apart = centre[..., :1, :] - centre
    with np.errstate(divide="ignore", invalid="ignore"):
        unit = apart / np.linalg.norm(apart[..., 1, :], axis=-1)[..., None, None]
    return turns, (rotation @ np.nan_to_num(unit)[..., None])[..., 0]


def _settled(begin: Start, rays: Array, turns: Array, shifts: Array, steps: int) -> tuple[Array, Array]:
    """(..., 3) the solution and (..., 3, 3) its normal matrix, by Gauss-Newton steps; broadcasts over leading axes."""
    axes = np.stack([begin.tangents[0, 0], begin.tangents[0, 1]], -1)  # e1, e2 of the first picture
    lead = np.broadcast_shapes(rays.shape[:-2], turns.shape[:-3], shifts.shape[:-2])
    found = np.broadcast_to(begin.solution, (*lead, 3))
    by = np.concatenate([np.broadcast_to(turns @ axes, (*lead, *turns.shape[-3:-1], 2)),
                         np.broadcast_to(shifts, (*lead, *shifts.shape[-2:]))[..., None]], -1)  # fmt: skip
    base = turns @ begin.direction
    normal = np.zeros((*lead, 3, 3))
    for _ in range(steps):
        place = base + (by @ found[..., None, :, None])[..., 0]
        residual, slope = _residual(begin, rays, place)
        jac = begin.whiten @ (slope @ by).reshape(*lead, -1, 3)
        normal = np.swapaxes(jac, -1, -2) @ jac
        gradient = np.swapaxes(jac, -1, -2) @ (begin.whiten @ residual.reshape(*lead, -1, 1))
        damp = 1e-12 * np.trace(normal, axis1=-2, axis2=-1)[..., None, None] * np.eye(3) + 1e-300 * np.eye(3)
        bad = ~np.all(np.isfinite(normal), axis=(-1, -2), keepdims=True)
        step = np.linalg.solve(np.where(bad, np.eye(3), normal + damp), np.where(bad, np.nan, gradient))[..., 0]
        found = found - step
        if np.all(abs(step) < 1e-13 * (1 + abs(found))):
            break
    return found, normal


def _residual(begin: Start, rays: Array, place: Array) -> tuple[Array, Array]:
    """(..., N, 2) residuals across the seen directions, and (..., N, 2, 3) their slopes by the place."""
    inner = np.sum(begin.tangents * rays[..., None, :], -1)[..., None]
    tangents = begin.tangents - inner * rays[..., None, :]  # across the moved directions
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        along = 1 / np.sum(rays * place, -1)[..., None]
        residual = (tangents @ place[..., None])[..., 0] * along
        slope = (tangents - residual[..., None] * rays[..., None, :]) * along[..., None]
    return residual, slope


def _located(views: Views, track: Track, baseline: Quantity | None, begin: Start) -> tuple[Array, Array, Codes]:
    """(..., 3) the point in the frame of the first picture of the track and in that of the world, m, and the reason."""
    rays = _rays(views, track)
    turns, shifts = _relative(views, track)
    found, _ = _settled(begin, rays, turns, shifts, STEPS)
    axes = np.stack([begin.tangents[0, 0], begin.tangents[0, 1]], -1)
    direction = begin.direction + found[..., :2] @ axes.T
    seen_at = turns @ direction[..., None, :, None]
    ahead = np.sum(rays * (seen_at[..., 0] + found[..., None, 2:] * shifts), -1)
    rows = [views.index(name) for name in track.names]
    places = views.places_m * _by_baseline(views, baseline)[..., None, None]
    unit = np.linalg.norm(places[..., rows[0], :] - places[..., rows[1], :], axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        own = direction * (unit / found[..., 2])[..., None]
    turn = np.swapaxes(views.rotation[..., rows[0], :, :], -1, -2)
    world = (turn @ own[..., None])[..., 0] + places[..., rows[0], :]
    code = _reason(rays, found, unit, ahead, begin, np.asarray(1.0 if baseline is None else baseline.value))
    return own, world, code


def _reason(rays: Array, found: Array, unit: Array, ahead: Array, begin: Start, baseline: Array) -> Codes:
    lead = np.broadcast_shapes(found.shape[:-1], unit.shape, ahead.shape[:-1], rays.shape[:-2], baseline.shape)
    meets = found[..., 2] > 0
    behind = ~np.all(ahead > 0, axis=-1) & (meets | begin.behind)
    return reasons(
        lead, (~np.all(np.isfinite(rays), axis=(-1, -2)), Reason.NOT_INVERTIBLE), (~(baseline > 0), Reason.OUT_OF_RANGE),
        (~(unit > 0), Reason.NO_BASELINE), (np.asarray(begin.behind) | behind, Reason.BEHIND_CAMERA),
        (~np.asarray(meets), Reason.PARALLEL_RAYS),
    )  # fmt: skip


def _rays(views: Views, track: Track) -> Array:
    """(..., N, 3) seen directions, each in the frame of its camera."""
    points = track.seen.points_px
    found = [views.camera(views.index(name)).rays(points[..., i : i + 1, :]) for i, name in enumerate(track.names)]
    return np.concatenate(np.broadcast_arrays(*found), axis=-2) if found else np.zeros((0, 3))


def _by_baseline(views: Views, baseline: Quantity | None) -> Array:
    """(...) what the places are multiplied by so that the first two are `baseline` apart."""
    if baseline is None:
        return np.ones(())
    apart = views.places_m[..., 1, :] - views.places_m[..., 0, :]
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.asarray(baseline.value) / np.linalg.norm(apart, axis=-1))


def triangulation(inputs: Inputs, begin: Start) -> Result:
    """Range and depth from the first picture of the point, and its place in the frame of the places, m.

    Source: reprojection least squares in direction and inverse range; see the module.
    """
    own, world, code = _located(inputs.views, inputs.point, inputs.baseline, begin)
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
        _located(inputs.views, track, inputs.baseline, one)
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
        rays = _rays(inputs["views"], inputs["track"])
        turns, shifts = _relative(inputs["views"], inputs["track"])
        found, _ = _settled(begin, rays, turns, shifts, STEPS)
        axes = np.stack([begin.tangents[0, 0], begin.tangents[0, 1]], -1)
        place = (turns @ (begin.direction + found[..., :2] @ axes.T)[..., None, :, None])[..., 0] + found[
            ..., None, 2:
        ] * shifts
        left = _residual(begin, rays, place)[0]
        values = (begin.whiten @ left.reshape(*left.shape[:-2], -1, 1))[..., 0]
        return _Residuals(values, np.zeros(values.shape[:-1], np.int8))

    begin = _start(views, track)
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
        [views.rotation[views.index(name)].T @ ray for name, ray in zip(track.names, _rays(views, track), strict=True)]
    )
    across = [np.linalg.norm(np.cross(a, b)) for i, a in enumerate(rays) for b in rays[:i]]
    return math.asin(min(max(map(float, across)), 1.0))


def _doubts(views: Views, tracks: Sequence[Track]) -> tuple[Note, ...]:
    found = []
    for track in tracks:
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
