"""Triangulation from what a person typed: photos or views, tracks, and how the camera moved, to a Document."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from .. import propagate
from ..arrays import Array
from ..document import Document
from ..errors import InputError
from ..method import Method
from ..methods import triangulation
from ..photo import Photo
from ..quantity import Measurement, Note, Quantity
from ..views import Track, Views
from .given import given, read_json
from .improve import improved
from .resolve_camera import resolve_camera

SLIDER_TURN_RAD = math.radians(0.1)
"""Standard deviation of the camera's rotation from one place of a slider to the next, about each axis, where nothing was said."""
TURN_ASSUMED = "assumed: a camera that is moved along a slider keeps its direction to 0.1° (1s)"


def triangulate(
    views: Views, points: Sequence[str], *, baseline: str | None = None, level: float = 0.95, seed: int = 0,
    notes: tuple[Note, ...] = (),
) -> Document:  # fmt: skip
    """Range, depth and place of each point, and the lengths from each point to the next, with the cameras' errors in common.

    Args:
        views: the pictures with their places.
        points: `a.jpg:x,y; b.jpg:x,y` each.
        baseline: distance between the first two places; None where the places are in metres.
        level: coverage of the intervals.
        seed: of the draws.
        notes: doubts about the views.

    Raises:
        InputError: a text that can't be read, or a point outside its picture.
        GeometryError: lines of sight that do not meet in front of the cameras.
    """
    if not points:
        raise InputError(
            "--point", None, "write a point in two pictures or more, as --point 'a.jpg:120,80; b.jpg:95,82'"
        )
    apart = None if baseline is None else Quantity.parse(baseline, "m", bare="no unit", name="--baseline")
    tracks = [track_of(text, views, f"point {i}") for i, text in enumerate(points, 1)]
    found: list[Measurement] = []
    for track in tracks:
        found += measured(
            triangulation.METHOD, triangulation.Inputs(views, track, apart), track.seen.label, level, seed
        )
    for one, other in pairwise(tracks):
        label = f"{one.seen.label} to {other.seen.label}"
        found += measured(
            triangulation.LENGTH, triangulation.LengthInputs(views, one, other, apart), label, level, seed
        )
    return Document(improved(_told_once(found)), None, None, notes)


def _told_once(found: Sequence[Measurement]) -> tuple[Measurement, ...]:
    """Without notes that an earlier measurement has already: a length's ends were measured by themselves."""
    told: set[Note] = set()
    kept = []
    for one in found:
        kept.append(dataclasses.replace(one, notes=tuple(note for note in one.notes if note not in told)))
        told.update(one.notes)
    return tuple(kept)


def measured(method: Method, inputs: object, label: str, level: float, seed: int) -> tuple[Measurement, ...]:
    """The outputs of a method on nouns."""
    return propagate.measure(method, inputs, level=level, seed=seed, label=label, given=given(inputs))


def track_of(text: str, views: Views, label: str, option: str = "--point") -> Track:
    """A track whose points lie in their pictures."""
    track = Track.parse(text, name=option)
    for name, (x, y) in zip(track.names, track.seen.points_px, strict=True):
        camera = views.camera(views.index(name))
        if not (-0.5 <= x <= camera.width_px - 0.5 and -0.5 <= y <= camera.height_px - 0.5):
            raise InputError(
                option, f"{name}:{x:g},{y:g}", f"that picture has {camera.width_px} x {camera.height_px} px"
            )
    return dataclasses.replace(track, seen=dataclasses.replace(track.seen, label=label, id=None), id=None)


def views_of(source: str) -> Views:
    """Views from a JSON file (@file.json or its name), or from text as `Views.parse` reads it."""
    path = Path(source.removeprefix("@"))
    if source.startswith("@") or path.suffix.lower() == ".json":
        data = read_json(path)
        try:
            return Views.from_json(data.get("views", data))
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise InputError("--views", str(path), f"it holds no views ({type(error).__name__}: {error})") from None
    return Views.parse(source, name="--views")


def moved_camera(
    photos: Sequence[Path], *, slide: str = "1,0,0", turn: str | None = None, camera: str | None = None
) -> tuple[Views, tuple[Note, ...]]:
    """Views of one camera that was moved in equal steps and kept its direction; one step is the unit of length.

    Args:
        photos: in the order they were taken.
        slide: direction of a step in the camera's frame: x right, y down, z forward.
        turn: how well the camera kept its direction, about each axis, as "0 ± 0.2 deg".
        camera: what is known of it; None to go by the first photo.
    """
    if len(photos) < 2:
        raise InputError("PHOTOS", f"{len(photos)}", "give two pictures or more, taken from different places")
    pictures = [Photo.load(path) for path in photos]
    sizes = {(p.width_px, p.height_px) for p in pictures}
    if len(sizes) > 1:
        raise InputError("PHOTOS", f"of {len(sizes)} sizes", "give pictures of one camera and one size")
    resolved = resolve_camera(pictures[0], camera)
    if resolved.camera.nominal_focal_m:
        resolved = dataclasses.replace(
            resolved, camera=dataclasses.replace(resolved.camera, nominal_focal_m=None, id=None)
        )
    names = unique_names(photos)
    turned = SLIDER_TURN_RAD if turn is None else float(Quantity.parse(turn, "rad", bare="deg", name="--turn").u)
    u_turn = np.full((len(names), 3), turned)
    u_turn[0] = 0.0  # the first picture's frame is the world's
    places = np.arange(len(names))[:, None] * _direction(slide)
    views = Views.independent(names, (resolved.camera,), np.broadcast_to(np.eye(3), (len(names), 3, 3)), places, u_rotation_rad=u_turn,
                              source=TURN_ASSUMED if turn is None else "the camera's direction, as stated")  # fmt: skip
    notes = resolved.notes
    if turn is None:
        notes = (
            *notes,
            Note("turn_assumed", TURN_ASSUMED, "say how well it did: --turn '0 ± 0.2 deg', or reconstruct the scene"),
        )
    return views, notes


def _direction(text: str) -> Array:
    try:
        found = np.array([float(x) for x in text.split(",")])
    except ValueError:
        found = np.zeros(0)
    if found.shape != (3,) or not np.all(np.isfinite(found)) or not np.any(found):
        raise InputError(
            "--slide", text, "write the direction of a step as x,y,z: 1,0,0 is to the right, 0,0,1 forward"
        )
    return np.asarray(found / np.linalg.norm(found))


def unique_names(photos: Sequence[Path]) -> tuple[str, ...]:
    """File names, with their folders where two are alike."""
    names = [path.name for path in photos]
    return tuple(names) if len(set(names)) == len(names) else tuple(str(path) for path in photos)
