"""From what a person typed about a photo to a Document, with the defaults of `assumptions`."""

from __future__ import annotations

from collections.abc import Sequence

from .. import assumptions
from ..document import Document
from ..errors import InputError
from ..observation import Observation
from ..photo import Photo
from ..quantity import Quantity
from .measure import joined, measure_lines, measure_markers


def measure_document(
    photo: Photo, *, lines: Sequence[str] = (), sizes: Sequence[str] = (), tilt: str | None = None,
    marker_size: str | None = None, marker_family: str | None = None, camera: str | None = None, level: float = 0.95,
    seed: int = 0,
) -> Document:  # fmt: skip
    """Lines of known size, or markers, or both, as one document.

    Raises:
        InputError: nothing to measure, or a text that can't be read.
    """
    if not lines and marker_size is None:
        raise InputError("--line or --marker-size", None, "give --line X1,Y1,X2,Y2 with --size, or --marker-size")
    if lines and not sizes:
        raise InputError("--size", None, "give the real size of what the line spans, as --size '210 mm'")
    if sizes and not lines:
        raise InputError("--line", None, "give the two ends of what has this size, as --line 120,80,640,80")
    found = []
    if lines:
        ends = [Observation.parse(text, name="--line", count=2) for text in lines]
        lengths = [read_length(text, "--size") for text in sizes]
        angle = (
            None if tilt is None else Quantity.parse(tilt, "rad", bare="deg", name="--tilt", assume=assumptions.angle)
        )
        found.append(measure_lines(photo, ends, lengths, camera=camera, tilt=angle, level=level, seed=seed))
    if marker_size is not None:
        side = read_length(marker_size, "--marker-size")
        found.append(measure_markers(photo, side, family=marker_family, camera=camera, level=level, seed=seed))
    return joined(found)


def read_length(text: str, name: str) -> Quantity:
    """A real size above 0; mm if bare, 0.5 % where nothing was said."""
    length = Quantity.parse(text, "m", bare="mm", name=name, assume=assumptions.size)
    if not float(length.value) > 0:
        raise InputError(name, text, "give a length above 0")
    return length
