"""Kinds: what networks find, which row of data/targets.toml its size is taken from, and what a whole one looks like."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from ..targets import KnownTarget, find_target


@dataclass(frozen=True)
class Kind:
    """What is looked for.

    Attributes:
        name: what a detection is called.
        words: labels of networks for it, in small letters.
        target: row of data/targets.toml that its size is taken from; empty where only a person can tell.
        others: rows that fit as well.
        stated: further rows that a person may say it is.
        across: whether the width is measured in place of the height.
        least: score from which it is shown.
        deep: whether it reaches away from the camera, so that from above more than its height is seen.
        aspect: limits of width over height of a whole one.
    """

    name: str
    words: tuple[str, ...]
    target: str = ""
    others: tuple[str, ...] = ()
    stated: tuple[str, ...] = ()
    across: bool = False
    deep: bool = False
    least: float = 0.45
    aspect: tuple[float, float] = (0.0, math.inf)

    def taken_as(self, stated: Sequence[KnownTarget]) -> tuple[KnownTarget, ...]:
        """The row its size is taken from, then those that fit as well; empty where it isn't asked for, or has no size.

        Args:
            stated: what a person says is in the picture; empty where nothing was said.
        """
        if stated:
            return tuple(target for target in stated if target.name in (self.target, *self.stated))
        return tuple(find_target(name) for name in (self.target, *self.others)) if self.target else ()


PERSON = Kind(
    "person", ("person", "pedestrian"), "person", ("child",),
    ("man", "woman", "child", "child-3-5", "child-6-8", "child-9-11", "child-12-14",
     "man-height", "woman-height", "man-height-world", "woman-height-world"), least=0.3,
)  # fmt: skip
RIDDEN = ("bicycle", "motorcycle", "motorbike", "stationary bicycle")
"""Labels of what a person may sit on with straight legs."""
KINDS = (
    PERSON,
    Kind("car", ("car",), "car", ("van",), ("van",), deep=True, aspect=(1.0, 3.6)),
    Kind("bus", ("bus",), "bus", deep=True),
    Kind("lorry", ("truck",), "truck", ("van",), ("van",), deep=True),
    Kind("van", ("van",), "van", deep=True),
    Kind("vehicle", ("vehicle",), stated=("van", "truck", "bus", "motorcycle"), deep=True),
    Kind("motorcycle", ("motorcycle", "motorbike"), "motorcycle"),
    Kind("bicycle", ("bicycle",), "bicycle", ("bicycle-child",), ("bicycle-child",), aspect=(0.3, 2.2)),
    Kind("bottle", ("bottle",), "bottle", aspect=(0.15, 0.75)),
    Kind("cup", ("mug", "coffee cup", "cup"), "cup", aspect=(0.5, 2.2)),
    Kind("chair", ("chair",), "chair", deep=True, aspect=(0.4, 1.6)),
    Kind("laptop", ("laptop",), "laptop", across=True, aspect=(0.9, 2.5)),
)
"""What is measured of people comes from their joints; of the others, from their boxes."""


def kind_of(label: str) -> Kind | None:
    """The kind that a network's label means."""
    word = label.strip().lower()
    return next((kind for kind in KINDS if word in kind.words), None)
