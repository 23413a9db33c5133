"""What several measurements of a document say together: distances between things, and one number from several."""

from __future__ import annotations

import dataclasses
import itertools
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..document import Document, Shape
from ..errors import FileFormatError, InputError
from ..method import Method
from ..quantity import Measurement
from .between import between
from .fuse import Fused, fuse, with_common_causes
from .given import inputs_from_json, read_json
from .improve import improved
from .tables import METHODS

MOST_PAIRS = 45
"""Distances of `all`: those of ten things."""


@dataclasses.dataclass(frozen=True)
class Thing:
    """One measured thing of a document, with what its method needs to measure it again."""

    label: str
    method: Method
    inputs: Any

    @property
    def check(self) -> bool:
        """Whether it is a thing measured before, by another way."""
        return self.label.endswith(f", by {self.method.name}")

    @property
    def pair(self) -> tuple[Method, Any]:
        """For `between` and `fuse`."""
        return self.method, self.inputs


def things_of(document: Document) -> list[Thing]:
    """The headline of each label, measured by a method of the table."""
    heads: dict[str, Measurement] = {}
    for m in document.measurements:
        if m.method in METHODS:
            heads.setdefault(m.label, m)
    return [Thing(label, METHODS[m.method], inputs_from_json(METHODS[m.method], m.given)) for label, m in heads.items()]


def chosen(things: Sequence[Thing], text: str, option: str) -> list[Thing]:
    """The things that a text names: numbers in the order of the report, or labels, with commas or semicolons between.

    Raises:
        InputError: fewer than two, or one that there is not.
    """
    words = [word.strip() for word in re.split(";" if ";" in text else ",", text) if word.strip()]
    counted = [thing for thing in things if not thing.check]  # what checks another has no number of its own
    known = "; ".join(f"{number}: {thing.label or 'the line'}" for number, thing in enumerate(counted, 1))
    found = []
    for word in words:
        by_label = [thing for thing in things if thing.label == word]
        number = int(word) if word.isdecimal() and len(word) < 6 else 0
        if by_label:
            found.append(by_label[0])
        elif 1 <= number <= len(counted):
            found.append(counted[number - 1])
        else:
            raise InputError(option, word, f"give numbers or names of what was measured ({known})")
    if len({thing.label for thing in found}) < 2 or len(found) != len({thing.label for thing in found}):
        raise InputError(option, text, f"give two different things ({known})")
    return found


def with_distances(
    document: Document,
    text: str,
    *,
    option: str = "--between",
    level: float = 0.95,
    seed: int = 0,
    draws: int | None = None,
) -> Document:
    """The document with the distances between things.

    Args:
        document: of one picture.
        text: two things, as "1,2" or "marker 1; cup", or "all".
        option: what an error calls the text.
        level: coverage of the intervals.
        seed: of the draws.
        draws: how many, where they are needed; None for as many as two digits of u need.

    Raises:
        InputError: a thing that there is not, or that has no place in the camera's frame.
    """
    things = things_of(document)
    if text.strip().lower() == "all":
        placed = [thing for thing in things if thing.method.place is not None and not thing.check]
        pairs = list(itertools.combinations(placed, 2))
        if not 1 <= len(pairs) <= MOST_PAIRS:
            raise InputError(option, f"all, with {len(placed)} things", "name two things that have a range, as 1,2")
    else:
        two = chosen(things, text, option)
        if len(two) != 2:
            raise InputError(option, text, "give two things; repeat it for more")
        pairs = [(two[0], two[1])]
    found: list[Measurement] = []
    shapes: list[Shape] = []
    for one, other in pairs:
        label = f"{one.label or 'line'} to {other.label or 'line'}"
        found += between(one.pair, other.pair, level=level, seed=seed, draws=draws, label=label)
        shapes.append(Shape((_middle(document, one.label), _middle(document, other.label)), False, label))
    return dataclasses.replace(document, measurements=(*document.measurements, *improved(tuple(found))),
                               shapes=(*document.shapes, *shapes))  # fmt: skip


def _middle(document: Document, label: str) -> tuple[float, float]:
    """Of what is drawn of a thing."""
    points = next((shape.points_px for shape in document.shapes if shape.label == label), ((0.0, 0.0),))
    x, y = np.mean(np.asarray(points, float), axis=0)
    return float(x), float(y)


def with_fused(
    document: Document,
    text: str,
    *,
    option: str = "--same",
    level: float = 0.95,
    seed: int = 0,
    draws: int | None = None,
) -> Document:
    """The document with one number from several things that are one and the same, as "1,2"; else as `with_distances`."""
    named = chosen(things_of(document), text, option)
    label = " and ".join(thing.label or "line" for thing in named)
    pairs, labels = [thing.pair for thing in named], [thing.label for thing in named]
    one = fuse(pairs, level=level, seed=seed, draws=draws, label=label, labels=labels).one
    return dataclasses.replace(document, measurements=(*document.measurements, *improved((one,))))


def fuse_files(
    sources: Sequence[str], what: str | None = None, *, level: float = 0.95, seed: int = 0
) -> tuple[Document, Fused]:
    """One number from measurements in several JSON files of ours, of several pictures or ways.

    Args:
        sources: files, each with `#label` behind its name where it has several things.
        what: range, depth, length, ...; the first that all of them have where it is None.
        level: coverage of the interval.
        seed: of the draws.

    Raises:
        FileFormatError: a file that is no document of ours.
        InputError: a thing that there is not, or nothing in common.
    """
    things = [_thing_in(source) for source in sources]
    inputs = with_common_causes([thing.inputs for thing in things])
    labels = [thing.label or Path(source.partition("#")[0]).stem for thing, source in zip(things, sources, strict=True)]
    pairs = [(thing.method, one) for thing, one in zip(things, inputs, strict=True)]
    found = fuse(pairs, what, level=level, seed=seed, labels=labels)
    return Document(improved((found.one, *found.each))), found


def _thing_in(source: str) -> Thing:
    name, _, label = source.partition("#")
    data = read_json(Path(name))
    if not isinstance(data, dict) or not isinstance(data.get("measurements"), list):
        raise FileFormatError(Path(name), "is no document of subtense; write one with --format json or --report x.json")
    heads: dict[str, Any] = {}
    for m in data["measurements"]:
        if isinstance(m, dict) and m.get("method") in METHODS and isinstance(m.get("given"), dict):
            heads.setdefault(str(m.get("label", "")), m)
    if not label and len(heads) == 1:
        label = next(iter(heads))
    if label not in heads:
        names = ", ".join(repr(head) for head in heads)
        raise InputError("file", source, f"write one of its things behind #; it has {names}"
                         if heads else "it holds no measurement that can be combined")  # fmt: skip
    m = heads[label]
    method = METHODS[m["method"]]
    return Thing(label, method, inputs_from_json(method, m["given"]))
