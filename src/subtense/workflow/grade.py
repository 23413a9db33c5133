"""The quality of the picture where something was seen in it: doubts become notes, and what its source can't know widens sigma."""

from __future__ import annotations

import dataclasses
from typing import Any

from ..arrays import Array
from ..detection import Detection
from ..observation import Observation
from ..photo import Photo
from ..quality import quality, widened
from ..quantity import Note

OPEN = ("length",)
"""Shapes whose points do not go round them."""
CLICKED = ("assumed: a clicked", "clicked", "clicks", "stated")
"""How the source of points that a person set begins."""


def graded(photo: Photo, detection: Detection) -> Detection:
    """A detection with notes on the picture's quality at it, and with sigma widened where that calls for it."""
    closed = detection.shape not in OPEN
    found = quality(photo, detection.seen, closed=closed)
    seen = widened(detection.seen, found, closed=closed)
    return dataclasses.replace(detection, seen=seen, notes=(*detection.notes, *_new(detection.notes, found.notes)))


def graded_line(photo: Photo, line: Observation) -> tuple[Observation, tuple[Note, ...]]:
    """The two ends of a line as a person set them: widened where their edges are more blurred than a click's sigma holds."""
    found = quality(photo, line)
    return widened(line, found, clicked=line.cov is None), found.notes


def graded_clicks(photo: Photo, inputs: Any) -> tuple[Any, tuple[Note, ...]]:
    """A method's Inputs with each line and figure that a person set judged as `graded_line` judges a line."""
    changes: dict[str, Observation] = {}
    notes: tuple[Note, ...] = ()
    for field in dataclasses.fields(inputs):
        seen = getattr(inputs, field.name)
        if not isinstance(seen, Observation) or seen.cov is not None or not seen.source.startswith(CLICKED):
            continue
        if seen.points_px.ndim != 2 or len(seen.points_px) < 2:
            continue
        closed = bool(field.metadata.get("closed"))
        found = quality(photo, seen, closed=closed)
        changes[field.name] = widened(seen, found, closed=closed, clicked=True)
        notes = (*notes, *_new(notes, found.notes))
    return dataclasses.replace(inputs, **changes) if changes else inputs, notes


def _new(old: tuple[Note, ...], new: tuple[Note, ...]) -> tuple[Note, ...]:
    return tuple(note for note in new if note.code not in {one.code for one in old})


def graded_contour(photo: Photo, ends: Observation, contour_px: Array) -> tuple[Observation, tuple[Note, ...]]:
    """The ends of an outline's extent, judged by the picture's quality along its (N, 2) contour."""
    found = quality(photo, Observation(contour_px, 0.5), closed=True)
    return widened(ends, found), found.notes
