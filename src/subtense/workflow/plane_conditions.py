"""A plane of a photo by what holds in it: from what a person typed of right angles, parallels and lengths to a Document."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import Array
from ..conditions import KNOWN
from ..document import Document, Shape
from ..errors import InputError, UnknownCameraError
from ..method import Method
from ..methods import plane_conditions
from ..observation import Observation
from ..photo import Photo
from ..quantity import Quantity
from .in_photo import Item, measure_item, measure_items
from .measure_input import read_length
from .resolve_camera import Resolved, resolve_camera

MOST_WANTED = 100
"""Paths, areas and angles of one call."""
NO_CAMERA = "none"
"""What is said of a camera that is to be left out."""
LINES = "as 'x1,y1;x2,y2 | x3,y3;x4,y4'"


@dataclass(frozen=True)
class PlaneTexts:
    """What a person typed of what holds in a plane; points in px, a click at the same place is the same point.

    Attributes:
        rectangle: four corners in order, "x1,y1;x2,y2;x3,y3;x4,y4"; each may end in " ± 0.5px".
        square: the same, with equal sides.
        parallel: two lines or more, "x1,y1;x2,y2 | x3,y3;x4,y4".
        right_angle: a corner in the middle of three points, "x1,y1;x2,y2;x3,y3", or two lines.
        equal_length: two lines or more.
        length: a line and how long it is, "x1,y1;x2,y2 = 2.4 m ± 5 mm"; up to three.
    """

    rectangle: Sequence[str] = ()
    square: Sequence[str] = ()
    parallel: Sequence[str] = ()
    right_angle: Sequence[str] = ()
    equal_length: Sequence[str] = ()
    length: Sequence[str] = ()


class _Clicks:
    """Points by number, each place once."""

    def __init__(
        self, points: Sequence[tuple[float, float]] = (), sigmas: Sequence[float] = (), source: str = ""
    ) -> None:
        self.points, self.sigmas, self.source = list(points), list(sigmas), source

    def numbered(self, seen: Observation) -> list[str]:
        """The numbers of points from 1, as conditions name them."""
        found = []
        self.source = self.source or seen.source
        for x, y in seen.points_px.tolist():
            if (x, y) not in self.points:
                self.points.append((x, y))
                self.sigmas.append(float(np.max(seen.sigma_px)))
            found.append(str(self.points.index((x, y)) + 1))
        return found

    def copy(self) -> _Clicks:
        """The same, to which points of one measurement are added."""
        return _Clicks(self.points, self.sigmas, self.source)

    @property
    def seen(self) -> Observation:
        """All of them."""
        sigma: float | Array = np.array(self.sigmas)
        if len(set(self.sigmas)) == 1:
            sigma = self.sigmas[0]
        return Observation(np.array(self.points), sigma, source=self.source)


def plane_document(
    photo: Photo, said: PlaneTexts, *, paths: Sequence[str] = (), areas: Sequence[str] = (), angles: Sequence[str] = (),
    camera: str | Resolved | None = None, level: float = 0.95, seed: int = 0,
) -> Document:  # fmt: skip
    """Lengths, areas and angles in a plane of a photo by what holds in it.

    Args:
        photo: the picture, upright.
        said: what holds.
        paths: two or more points each, "x1,y1;x2,y2".
        areas: three or more corners each.
        angles: three points each, the corner in the middle.
        camera: what the user said of it, "none" to do without; None to go by the photo, and without where that tells nothing.
        level: coverage of the intervals.
        seed: of the draws.

    Raises:
        InputError: nothing to measure, too few conditions, or a text that can't be read.
        GeometryError: no finite answer.
    """
    clicks = _Clicks()
    shapes: list[Shape] = []
    conditions, known = _conditions(said, clicks, shapes)
    wanted = [(plane_conditions.METHOD, "--path", "path", paths, 2), (plane_conditions.AREA, "--area", "area", areas, 3),
              (plane_conditions.ANGLE, "--angle", "angle", angles, 3)]  # fmt: skip
    items = []
    for method, option, word, texts, least in wanted:
        for number, text in enumerate(texts, 1):
            seen = _points(text, option, least)
            label = f"{word} {number}" if len(texts) > 1 else word
            items.append(_item(method, seen, clicks.copy(), conditions, known, label))
            shapes.append(_shape(seen.points_px, label, closed=word == "area"))
    if not items:
        raise InputError(
            "--path", None, "give what is to be measured in the plane, as --path 'x1,y1;x2,y2', --area or --angle"
        )
    if len(items) > MOST_WANTED:
        raise InputError("--path", f"{len(items)} things to measure", f"give {MOST_WANTED} or fewer at once")
    resolved = _camera(photo, camera)
    if len(items) == 1:
        found = measure_item(items[0], photo, resolved, level=level, seed=seed)
    else:
        found = measure_items(items, photo, resolved or UnknownCameraError("left out"), level=level, seed=seed)
    return dataclasses.replace(found, shapes=tuple(shapes))


def _camera(photo: Photo, camera: str | Resolved | None) -> Resolved | UnknownCameraError | None:
    if isinstance(camera, Resolved):
        return camera
    if camera is not None and camera.strip().lower() == NO_CAMERA:
        return None
    try:
        return resolve_camera(photo, camera)
    except UnknownCameraError as error:
        if camera is not None or error.code == "panorama":
            raise
        return error


def _item(
    method: Method, seen: Observation, clicks: _Clicks, conditions: str, known: dict[str, Quantity], label: str
) -> Item:
    path = " ".join(clicks.numbered(seen))
    inputs: dict[str, Any] = {"points": clicks.seen, "conditions": conditions, "path": path, **known}
    return Item(method, inputs, label)


def _conditions(said: PlaneTexts, clicks: _Clicks, shapes: list[Shape]) -> tuple[str, dict[str, Quantity]]:
    """The conditions by the numbers of points, and the known lengths."""
    found: list[str] = []
    for kind, texts in (("rectangle", said.rectangle), ("square", said.square)):
        for text in texts:
            seen = _points(text, f"--{kind}", 4, most=4)
            found.append(f"{kind} {' '.join(clicks.numbered(seen))}")
            shapes.append(_shape(seen.points_px, kind, closed=True))
    for text in said.right_angle:
        found.append(f"right {' '.join(_right(text, clicks, shapes))}")
    for kind, option, texts in (
        ("parallel", "--parallel", said.parallel),
        ("equal", "--equal-length", said.equal_length),
    ):
        for text in texts:
            first, *others = _lines(text, option, clicks, shapes, kind)
            found += [f"{kind} {' '.join(first + other)}" for other in others]
    if len(said.length) > len(KNOWN):
        raise InputError("--length", f"{len(said.length)} of them", f"give {len(KNOWN)} at most")
    known = {}
    for kind, text in zip(KNOWN, said.length, strict=False):
        line, word, size = text.partition("=")
        if not word:
            raise InputError("--length", text, "give two points and how long they are apart, as 'x1,y1;x2,y2 = 2.4 m'")
        seen = _points(line, "--length", 2, most=2)
        known[kind] = read_length(size.strip(), "--length")
        found.append(f"{kind} {' '.join(clicks.numbered(seen))}")
        shapes.append(_shape(seen.points_px, "length"))
    if not found:
        raise InputError("--rectangle", None, "say what holds in the plane: --rectangle, --square, --parallel, --right-angle, "
                         "--equal-length, and a --length")  # fmt: skip
    return "; ".join(found), known


def _right(text: str, clicks: _Clicks, shapes: list[Shape]) -> list[str]:
    if "|" not in text:
        seen = _points(text, "--right-angle", 3, most=3)
        shapes.append(_shape(seen.points_px, "right angle"))
        return clicks.numbered(seen)
    lines = _lines(text, "--right-angle", clicks, shapes, "right angle")
    if len(lines) != 2:
        raise InputError("--right-angle", text, f"give two lines, {LINES}")
    return lines[0] + lines[1]


def _lines(text: str, option: str, clicks: _Clicks, shapes: list[Shape], label: str) -> list[list[str]]:
    """The numbers of the two ends of each line."""
    head, sign, tail = re.sub(r"\+/-|\+-", "±", text).partition("±")
    parts = head.split("|")
    if len(parts) < 2:
        raise InputError(option, text, f"give two lines or more, {LINES}")
    found = []
    for part in parts:
        seen = _points(f"{part}{sign}{tail}", option, 2, most=2)
        found.append(clicks.numbered(seen))
        shapes.append(_shape(seen.points_px, label))
    return found


def _points(text: str, option: str, least: int, most: int | None = None) -> Observation:
    seen = Observation.parse(text, name=option, count=most)
    if len(seen.points_px) < least:
        raise InputError(option, text, f"give {least} points or more")
    return seen


def _shape(points: Array, label: str, *, closed: bool = False) -> Shape:
    return Shape(tuple((float(x), float(y)) for x, y in points), closed, label)
