"""The quality of the picture where something was seen in it: doubts become notes, and what its source can't know widens sigma."""

from __future__ import annotations

import dataclasses

from ..arrays import Array
from ..detection import Detection
from ..observation import Observation
from ..photo import Photo
from ..quality import quality, widened
from ..quantity import Note

OPEN = ("length",)
"""Shapes whose points do not go round them."""


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


def _new(old: tuple[Note, ...], new: tuple[Note, ...]) -> tuple[Note, ...]:
    return tuple(note for note in new if note.code not in {one.code for one in old})


def graded_contour(photo: Photo, ends: Observation, contour_px: Array) -> tuple[Observation, tuple[Note, ...]]:
    """The ends of an outline's extent, judged by the picture's quality along its (N, 2) contour."""
    found = quality(photo, Observation(contour_px, 0.5), closed=True)
    return widened(ends, found), found.notes
