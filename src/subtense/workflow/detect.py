"""Finding things in a photo by themselves, and what to measure of each: detections to items of a method."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import Array
from ..detection import Detection, Search
from ..document import Document, Shape
from ..errors import InputError, MissingExtraError, UnknownCameraError
from ..observation import Observation
from ..photo import Photo
from ..quantity import Note, Quantity
from ..target import Target
from ..targets import KnownTarget
from .grade import graded
from .in_photo import Item
from .resolve_camera import resolve_camera
from .tables import DETECTORS, METHODS, Detector


@dataclass(frozen=True)
class Way:
    """How a shape is measured.

    Attributes:
        method: of METHODS.
        points: its field that takes the observation.
        size: its field that takes the real size.
        prefix: stands before the size where a person types it.
    """

    method: str
    points: str
    size: str
    prefix: str = ""


WAYS: dict[str, Way] = {
    "square": Way("pose", "points", "target", "square "),
    "rectangle": Way("pose", "points", "target", "rectangle "),
    "length": Way("known_size", "ends", "size"),
    "circle": Way("circle", "rim", "diameter"),
    "sphere": Way("sphere", "rim", "diameter"),
}
"""By the shape of a detection."""


SQUARE = "square"
"""Name of the target where a person told the side of what was found."""
SEARCHED_FINE_PX = 25.0
"""Size that a search should reach down to, or it is noted."""


@dataclass(frozen=True)
class Found:
    """What a search of a photo gave.

    Attributes:
        detections: of all detectors that were asked, in the order of the table.
        notes: detectors that could not be asked, and why.
        detectors: who found each detection, by name.
    """

    detections: tuple[Detection, ...]
    notes: tuple[Note, ...] = ()
    detectors: tuple[str, ...] = ()


def detectors_for(only: Sequence[str], targets: Sequence[KnownTarget]) -> list[Detector]:
    """The rows to ask: those named and those that find the targets; with neither, all that look unasked.

    Raises:
        InputError: no such detector, or a target that none of them finds.
    """
    for name in only:
        if name not in DETECTORS:
            raise InputError("--only", name, f"known are {', '.join(DETECTORS)}")
    asked = list(DETECTORS.values()) if targets else [DETECTORS[name] for name in only] or list(DETECTORS.values())
    if not targets:
        return asked if only else [row for row in asked if row.automatic]
    for target in targets:
        if not any(target.group in row.groups for row in asked):
            raise InputError(
                "--target", target.name, "nothing finds it by itself; give its ends with --line and --size"
            )
    return [row for row in asked if row.name in only or any(target.group in row.groups for target in targets)]


def detect(
    photo: Photo, only: Sequence[str] = (), search: Search | None = None,
    progress: Callable[[str, float], None] = lambda title, share: None,
) -> Found:  # fmt: skip
    """Everything that the asked detectors see.

    Args:
        photo: the picture.
        only: names of DETECTORS; empty for those that find `search.targets`, or all that look unasked.
        search: what is known beside the photo.
        progress: is told what is looked for, and the share of all work done.

    Raises:
        InputError: no such detector, or nothing finds one of the targets.
        MissingExtraError: a detector that was named needs an extra.
    """
    search = _with_camera(photo, search or Search())
    rows = detectors_for(only, search.targets)
    found: list[Detection] = []
    by: list[str] = []
    notes: list[Note] = []
    for number, row in enumerate(rows):
        told = dataclasses.replace(search, progress=_part(progress, row.title, number, len(rows)))
        told.progress(0.0)
        try:
            seen = row.function(photo, told)
        except MissingExtraError as error:
            if only or search.targets:
                raise
            notes.append(Note("not_searched", f"{row.title} were not looked for: {error}"))
            continue
        found += [graded(photo, one) for one in seen]
        by += [row.name] * len(seen)
        reach = row.reach(photo, told, bool(seen)) if row.reach else 0.0
        if reach > SEARCHED_FINE_PX and seen:
            text = f"{row.title}: looked for down to about {reach:.0f} px, as larger ones are there"
            notes.append(Note("searched_coarse", text, "for smaller ones too: --thorough"))
    return Found(tuple(_told_apart(found)), tuple(notes), tuple(by))


def _with_camera(photo: Photo, search: Search) -> Search:
    """The search with the photo's own camera where none was told; a photo that tells none is searched without."""
    if search.camera is not None:
        return search
    try:
        return dataclasses.replace(search, camera=resolve_camera(photo).camera)
    except UnknownCameraError:
        return search


def _part(progress: Callable[[str, float], None], title: str, number: int, of: int) -> Callable[[float], None]:
    return lambda share: progress(title, (number + share) / of)


def _told_apart(found: Sequence[Detection]) -> list[Detection]:
    """Detections with labels of their own: a second one of the same label gets "(2)"."""
    counts: dict[str, int] = {}
    out = []
    for one in found:
        count = counts[one.label] = counts.get(one.label, 0) + 1
        seen = dataclasses.replace(one.seen, label=f"{one.label} ({count})") if count > 1 else one.seen
        out.append(dataclasses.replace(one, seen=seen))
    return out


def size_text(detection: Detection) -> str | None:
    """What a person would type of its size; None where it must be told."""
    if detection.target is None:
        return None
    return WAYS[detection.shape].prefix + detection.target.text


def item_of(detection: Detection, size: Target | Quantity | str | None = None) -> Item | None:
    """What to measure: by the size given, or by that of its target; None where neither is there.

    Args:
        detection: what was found.
        size: side of a square, or the length or diameter; text as a person types it.
    """
    way = WAYS[detection.shape]
    told = way.prefix + size if isinstance(size, str) else size
    if told is None:
        told = size_of(detection)
    if told is None:
        return None
    if isinstance(told, Target) and detection.shape not in ("square", "rectangle"):
        return None  # width and height are told of a sheet
    if isinstance(told, Quantity) and detection.shape == "rectangle":
        return None  # one length is no width and height
    if isinstance(told, Target) and detection.shape == "rectangle":
        told = _turned_as_seen(told, detection.seen)
    if isinstance(told, Quantity) and way.size == "target":
        told = Target.square(told, SQUARE)  # of one name, so that what is told of all squares is one doubt
    inputs: dict[str, Any] = {way.points: detection.seen, way.size: told}
    if detection.tilt is not None and detection.shape == "length":
        inputs["tilt"] = detection.tilt
    return Item(METHODS[way.method], inputs, detection.label)


def _turned_as_seen(told: Target, seen: Observation) -> Target:
    """Width and height that a person told, exchanged where the seen corners go round the other way about."""

    def first_over_second(corners: Array) -> float:
        sides = np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=-1)
        return float((sides[0] + sides[2]) / (sides[1] + sides[3]))

    if (first_over_second(told.points_m) > 1) == (first_over_second(seen.points_px) > 1):
        return told
    points = told.points_m[:, [1, 0, 2]][[0, 3, 2, 1]]  # mirrored, and gone round from the same corner
    return dataclasses.replace(told, points_m=points, id=None)


def size_of(detection: Detection) -> Target | Quantity | None:
    """The size of what it is taken to be, with where that comes from; of each thing its own, as those of a kind differ."""
    known = detection.target
    if known is None:
        return None
    if known.width is not None and known.height is not None:
        return dataclasses.replace(
            Target.rectangle(known.width, known.height, known.title), id=f"size of {detection.label}"
        )
    assert known.size is not None
    if detection.shape == "square":
        return dataclasses.replace(Target.square(known.size, known.title), id=f"size of {detection.label}")
    return dataclasses.replace(known.size)


def detection_json(detection: Detection) -> dict[str, Any]:
    """The detection with how it is measured: the method, its fields of points and of size, and the size as text and whole."""
    way, size = WAYS[detection.shape], size_of(detection)
    return {
        **detection.to_json(), "method": way.method, "points_field": way.points, "size_field": way.size,
        "size_prefix": way.prefix, "size_text": size_text(detection), "size": None if size is None else size.to_json(),
    }  # fmt: skip


def shapes_of(found: Found, photo: Photo) -> Document:
    """A document without measurements, whose shapes are what was found: for drawing."""
    shapes = tuple(
        Shape(tuple((float(x), float(y)) for x, y in one.seen.points_px), one.shape != "length", one.label)
        for one in found.detections
    )
    return Document((), None, photo.to_json(), (*photo.notes, *found.notes), shapes)
