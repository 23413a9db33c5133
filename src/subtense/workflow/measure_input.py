"""From what a person typed about a photo to a Document, with the defaults of `assumptions`."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Mapping, Sequence
from typing import Any

from .. import assumptions
from ..detection import parse_curve, unknown_curve
from ..document import Document
from ..errors import InputError, NothingFoundError
from ..observation import Observation
from ..photo import Photo
from ..quantity import Note, Quantity
from ..target import Target
from .found import Asked, Progress, measured
from .ground import GROUND, START, GroundTexts, standing
from .measure import Standing, joined, measure_lines
from .resolve_camera import Resolved
from .snap import snapped_lines, with_line_notes
from .together import with_distances, with_fused


def measure_document(
    photo: Photo, *, lines: Sequence[str] = (), sizes: Sequence[str] = (), tilt: str | None = None,
    marker_size: str | None = None, asked: Asked | None = None, camera: str | None = None, level: float = 0.95,
    seed: int = 0, snap: bool = False, progress: Progress | None = None, ground: GroundTexts | None = None,
    between: Sequence[str] = (), same: Sequence[str] = (),
) -> Document:  # fmt: skip
    """Lines of known size, or what is found by itself, or both, as one document.

    Args:
        photo: the picture.
        lines: two ends each; without any, everything that can be found is looked for.
        sizes: of the lines, one for all or one each; without lines one, of things whose size nothing else tells.
        tilt: of the lines.
        marker_size: side of markers; with it alone, only markers are looked for.
        asked: what to look for, and the picture's transfer curve.
        camera: what the user said of it; None to go by the photo.
        level: coverage of the intervals.
        seed: of the draws.
        snap: move the ends of lines to the edges and corners near them.
        progress: is told what is looked for, and the share of all work done.
        ground: how the camera stands above the ground, by which what stands on it is ranged too.
        between: pairs of things, by number or name, whose distance from each other is wanted: "1,2", or "all".
        same: things that are one and the same, by number or name: "1,2".

    Raises:
        NothingFoundError: nothing found, or nothing to snap to.
        InputError: a text that can't be read.
    """
    told = asked or Asked()
    asked = what_to_look_for(told, marker_size, lines)
    standing = None if ground is None or ground == GroundTexts() else standing_of(ground)
    if lines and not sizes and standing is None:
        raise InputError("--size", None, "give the real size of what the line spans, as --size '210 mm'")
    if len(sizes) > 1 and not lines:
        raise InputError("--line", None, "give the two ends of each thing that has a size, as --line 120,80,640,80")
    found = []
    if lines:
        ends = [Observation.parse(text, name="--line", count=2) for text in lines]
        lengths = [read_length(text, "--size") for text in sizes]
        angle = (
            None if tilt is None else Quantity.parse(tilt, "rad", bare="deg", name="--tilt", assume=assumptions.angle)
        )
        notes: list[tuple[Note, ...]] = []
        if snap:
            curve = unknown_curve() if told.curve is None else parse_curve(told.curve)
            ends, notes = snapped_lines(photo, ends, curve)
        document = measure_lines(photo, ends, lengths, camera=camera, tilt=angle, standing=standing, level=level,
                                 seed=seed)  # fmt: skip
        found.append(with_line_notes(document, notes))
    if asked is not None:
        side = None if marker_size is None else read_length(marker_size, "--marker-size")
        size = read_size(sizes[0], "--size") if sizes and not lines else None
        try:
            found.append(measured(photo, asked, size=size, marker_size=side, camera=camera, standing=standing, level=level, seed=seed,
                                  progress=progress))  # fmt: skip
        except NothingFoundError as error:
            if not lines:
                raise
            found[0] = dataclasses.replace(found[0], notes=(*found[0].notes, Note("nothing_found", str(error))))
    document = joined(found)
    for text in same:
        document = with_fused(document, text, level=level, seed=seed)
    for text in between:
        document = with_distances(document, text, level=level, seed=seed)
    return document


def standing_of(ground: GroundTexts) -> Standing:
    """How a camera stands, by what was typed and what its photo tells."""

    def told(camera: Resolved) -> Mapping[str, Any]:
        datum, fields, _ = standing(ground, camera.pose)
        if datum not in (GROUND, START):
            raise InputError(
                "--height", ground.height, "give it above the ground; a terrain model serves `subtense ground` only"
            )
        return fields

    return told


def what_to_look_for(asked: Asked, marker_size: str | None, lines: Sequence[str]) -> Asked | None:
    """What is left to find by itself: nothing beside lines alone, markers where only their size was given, else everything."""
    if asked.only or (asked.targets and marker_size is None):
        return asked
    if marker_size is not None:
        return dataclasses.replace(asked, only=("markers",))
    return None if lines else asked


def read_length(text: str, name: str) -> Quantity:
    """A real size above 0; mm if bare, 0.5 % where nothing was said."""
    length = Quantity.parse(text, "m", bare="mm", name=name, assume=assumptions.size)
    if not float(length.value) > 0:
        raise InputError(name, text, "give a length above 0")
    return length


def read_size(text: str, name: str) -> Quantity | Target:
    """A length as `read_length`, or width x height."""
    if re.search(r"\d\D*\sx\s", text):
        width, _, height = re.sub(r"\sx\s", " x ", text).partition(" x ")
        unit = re.search(r"[a-zµ]+\s*(\(.*\))?\s*$", height)
        if unit and not re.search(r"[a-zµ]", width):  # 210 x 297 mm
            width += " " + unit[0].split("(")[0].strip()
        return Target.rectangle(read_length(width, name), read_length(height, name), "rectangle")
    return read_length(text, name)


def gray_will_do(asked: Asked, marker_size: str | None, lines: Sequence[str]) -> bool:
    """Whether only markers are looked for, which have no colour."""
    left = what_to_look_for(asked, marker_size, lines)
    return not lines and left is not None and left.only == ("markers",)
