"""Anchors of a depth map from what a person typed and from what is found in the picture, with their covariance."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .. import assumptions, propagate
from ..anchoring import Anchor
from ..arrays import Array
from ..detection import Detection, Search
from ..errors import GeometryError, InputError, NothingFoundError
from ..method import Method
from ..methods import ground_plane, known_size
from ..observation import Observation
from ..photo import Photo
from ..quantity import Note, Quantity
from ..raw_depth import RawDepth, at_point
from ..targets import find_target
from .detect import detect, item_of
from .found import Progress
from .ground import GroundTexts, standing
from .in_photo import Item, item_inputs
from .measure import assumed
from .measure_input import read_length
from .resolve_camera import Resolved
from .tables import DETECTORS

DRAWS = 4000
"""For the covariance of anchors that were measured with one camera."""
THICK = 0.05
"""Of the length of a thing that is no sheet: how doubtful it is how far its surface stands before its middle (1s)."""
SIZED = "square, rectangle, length, circle"


@dataclass(frozen=True)
class Anchors:
    """What fixes a map.

    Attributes:
        anchors: places with their depths.
        cov_m2: (n, n) covariance of the depths.
        notes: doubts about them, and things that could not serve.
    """

    anchors: tuple[Anchor, ...] = ()
    cov_m2: Array | None = None
    notes: tuple[Note, ...] = ()


@dataclass(frozen=True)
class _Measured:
    """A thing whose place a method tells.

    Attributes:
        method: that places it.
        inputs: of it.
        label: what it is.
        nearer_m: by how much its surface is nearer than the place.
        u_m: how doubtful that is.
    """

    method: Method
    inputs: Any
    label: str
    nearer_m: float = 0.0
    u_m: float = 0.0


@dataclass(frozen=True)
class _Typed:
    """A point whose depth was said."""

    point: Observation
    depth_m: float
    u_m: float
    label: str


def anchors_of(
    photo: Photo, raw: RawDepth, resolved: Resolved, typed: Sequence[str], things: Sequence[str], ground: GroundTexts,
    progress: Progress | None = None,
) -> Anchors:  # fmt: skip
    """All anchors that were given or found.

    Args:
        photo: the picture.
        raw: its map.
        resolved: its camera.
        typed: "x,y = 3.2 ± 0.1 m" (range), "x,y = depth 3.2 m", "x1,y1;x2,y2 = 1.75 m" (size), "x,y = ground".
        things: what to look for: a detector or a thing of known size, with "= size" where nothing tells it.
        ground: how the camera stands above the ground.
        progress: is told what is looked for.

    Raises:
        InputError: a text that can't be read, or a point outside the picture.
        NothingFoundError: a thing to anchor by is not there.
    """
    said: list[_Typed] = []
    measured: list[_Measured] = []
    notes: list[Note] = []
    for text in typed:
        one, doubts = _read(text, photo, resolved, ground)
        (said if isinstance(one, _Typed) else measured).append(one)  # type: ignore[arg-type]
        notes += doubts
    for text in things:
        found, told = _found(text, photo, resolved, progress)
        measured += found
        notes += told
    return _joined(raw, resolved, said, measured, notes)


# -- what was typed ----------------------------------------------------------------------------------------


def _read(
    text: str, photo: Photo, resolved: Resolved, ground: GroundTexts
) -> tuple[_Typed | _Measured, tuple[Note, ...]]:
    where, equals, what = text.partition("=")
    points = _points(text, where) if equals and what.strip() else None
    if points is None:
        raise InputError(
            "--anchor",
            text,
            "write where and how far, as '320,240 = 3.2 ± 0.1 m', or 'x1,y1;x2,y2 = 1.75 m' for a size",
        )
    if what.strip().lower() == "ground":
        return _on_ground(text, points, photo, resolved, ground)
    if len(points.points_px) == 2:
        size = read_length(what, "--anchor")
        item = Item(known_size.METHOD, {"ends": points, "size": size})
        return _Measured(known_size.METHOD, item_inputs(item, photo, resolved), f"size {what.strip()}"), ()
    along = what.strip().lower().startswith("depth")
    length = Quantity.parse(
        re.sub(r"^\s*(depth|range)\b", "", what, flags=re.IGNORECASE),
        "m",
        bare="no unit",
        name="--anchor",
        assume=assumptions.size,
    )
    if not float(length.value) > 0:
        raise InputError("--anchor", text, "give a distance above 0")
    forward = float(resolved.camera.rays(points.points_px)[0, 2])
    if not forward > 0:
        raise InputError("--anchor", text, "the camera does not look there")
    factor = 1.0 if along else forward
    return _Typed(points, float(length.value) * factor, float(length.u) * factor, what.strip()), ()


def _points(text: str, where: str) -> Observation | None:
    seen = Observation.parse(where, name="--anchor")
    if len(seen.points_px) > 2:
        raise InputError("--anchor", text, "give one point, or the two ends of a thing")
    return seen


def _on_ground(
    text: str, points: Observation, photo: Photo, resolved: Resolved, ground: GroundTexts
) -> tuple[_Measured, tuple[Note, ...]]:
    if len(points.points_px) != 1:
        raise InputError("--anchor", text, "give one point on the ground")
    _datum, common, notes = standing(ground, resolved.pose)
    item = Item(ground_plane.METHOD, {"foot": points, **common})
    return _Measured(ground_plane.METHOD, item_inputs(item, photo, resolved), "ground"), notes


# -- what is found -----------------------------------------------------------------------------------------


def _found(
    text: str, photo: Photo, resolved: Resolved, progress: Progress | None
) -> tuple[list[_Measured], list[Note]]:
    name, _, size = (word.strip() for word in text.partition("="))
    by_detector = name in DETECTORS
    search = (
        Search(camera=resolved.camera)
        if by_detector
        else Search((find_target(name, "--anchor-by"),), camera=resolved.camera)
    )
    seen = detect(photo, [name] if by_detector else [], search, progress or (lambda _title, _share: None))
    length = read_length(size, "--anchor-by") if size else None
    measured, notes = [], list(seen.notes)
    for one in seen.detections:
        if not by_detector and one.target is None:
            continue
        item = item_of(one, length)
        if item is None:
            notes.append(
                Note(
                    "size_unknown",
                    f"{one.label}: found, and nothing tells its size",
                    f"give it, as --anchor-by '{name} = 50 mm'",
                )
            )
            continue
        notes += [
            replace(note, text=f"{one.label}: {note.text}") for note in (*assumed(one, search.targets), *one.notes)
        ]
        nearer, u = _surface(one, item)
        measured.append(_Measured(item.method, item_inputs(item, photo, resolved), one.label, nearer, u))
    if not measured:
        why = "".join(f"; {note.text}" for note in notes)
        raise NothingFoundError(
            f"{photo.name}: no {name} that could anchor the map was found{why}; give a distance with --anchor"
        )
    return measured, notes


def _surface(one: Detection, item: Item) -> tuple[float, float]:
    """By how much what the map sees is nearer than the place that the method gives, and how doubtful that is, m.

    Of a ball it is the radius; a sheet, a marker and a disc have no thickness; a body's middle lies within it.
    """
    size = next((value for value in item.inputs.values() if isinstance(value, Quantity) and value.unit == "m"), None)
    if size is None or one.shape not in ("sphere", "length"):
        return 0.0, 0.0
    return (float(size.value) / 2, float(size.u) / 2) if one.shape == "sphere" else (0.0, THICK * float(size.value))


# -- together ----------------------------------------------------------------------------------------------


def _joined(
    raw: RawDepth, resolved: Resolved, said: Sequence[_Typed], measured: Sequence[_Measured], notes: list[Note]
) -> Anchors:
    """Anchors with their covariance; what was measured with one camera is drawn together."""
    anchors = [
        _anchor(
            raw, one.point.points_px[0], float(np.max(one.point.standard_deviations)), one.depth_m, one.u_m, one.label
        )
        for one in said
    ]
    cov = np.diag([one.u_m**2 for one in said]) if said else np.zeros((0, 0))
    if measured:
        depths, between = _depths(measured)
        places = [_pixel(resolved, one) for one in measured]
        for one, depth, place, u in zip(measured, depths, places, np.sqrt(np.diag(between)), strict=True):
            try:
                anchors.append(_anchor(raw, place, 1.0, float(depth), float(u), one.label))
            except (InputError, GeometryError) as error:
                raise InputError("--anchor", one.label, f"it can't anchor the map: {error}") from None
        whole = np.zeros((len(anchors), len(anchors)))
        whole[: len(said), : len(said)], whole[len(said) :, len(said) :] = cov, between
        cov = whole
    return Anchors(tuple(anchors), cov if anchors else None, tuple(dict.fromkeys(notes)))


def _anchor(raw: RawDepth, point: Array, sigma_px: float, depth: float, u: float, label: str) -> Anchor:
    if not depth > 0:
        raise InputError("--anchor", label, "it lies behind the camera")
    sample = at_point(raw, point, sigma_px)
    named = f"{label} at {point[0]:.0f},{point[1]:.0f}"
    return Anchor(np.asarray(point), sample.value, sample.spread, depth, u, named)


def _depths(measured: Sequence[_Measured]) -> tuple[Array, Array]:
    """(n,) depths of the surfaces, means of the draws, and (n, n) covariance."""
    pairs = [(one.method, one.method.prepare(one.inputs)) for one in measured]
    _, drawn = propagate.joint(pairs, draws=DRAWS)
    rows, first = [], 0
    for method, _inputs in pairs:
        names = [output.name for output in method.outputs]
        rows.append(first + names.index("depth_m"))
        first += len(names)
    values = drawn.values[rows]
    values = values[:, np.isfinite(values).all(axis=0)]
    if values.shape[1] < 0.9 * DRAWS:
        raise GeometryError("the anchors have no finite depth in many of the draws", code="no_depth")
    nearer, u = np.array([one.nearer_m for one in measured]), np.array([one.u_m for one in measured])
    return values.mean(axis=1) - nearer, np.atleast_2d(np.cov(values)) + np.diag(u**2)


def _pixel(resolved: Resolved, one: _Measured) -> Array:
    """(2,) where the thing is seen."""
    ready = one.method.prepare(one.inputs)
    assert one.method.place is not None
    place = np.asarray(one.method.place(ready, *((one.method.start(ready),) if one.method.start else ())))
    seen = resolved.camera.project(place[None])[0]
    if not math.isfinite(float(seen.sum())):
        raise GeometryError(f"{one.label}: it would lie behind the camera", code="behind_camera")
    return np.asarray(seen)
