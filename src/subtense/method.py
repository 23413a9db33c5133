"""Method: one row of the METHODS table, and the reasons why a row may have no answer."""

from __future__ import annotations

import enum
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .arrays import Array, Bools, Codes
from .quantity import Note


@enum.unique
class Reason(enum.IntEnum):
    """Why a row has no answer; 0 where it has one. `FAR` reasons are approached by ever larger distances."""

    OK = 0
    ZERO_EXTENT = 1
    BEHIND_CAMERA = 2
    NOT_INVERTIBLE = 3
    TOO_OBLIQUE = 4
    NOT_CONVERGED = 5
    NOT_PINHOLE = 6
    OUT_OF_RANGE = 7
    FOLDED = 8
    COLLINEAR = 9
    BEYOND_HORIZON = 10
    NO_VANISHING_POINT = 11
    NO_HEIGHT = 12
    AT_OR_ABOVE_HORIZON = 13
    UPSIDE_DOWN = 14
    NO_PARALLAX = 15
    NO_BASELINE = 16
    PARALLEL_RAYS = 17
    UNDETERMINED = 18

    @property
    def text(self) -> str:
        """The sentence a person reads."""
        return _REASONS[self][0]

    @property
    def far(self) -> bool:
        """Whether the answer grows without limit on the way there, so that it counts as infinite in an interval."""
        return _REASONS[self][1]


_REASONS: dict[Reason, tuple[str, bool]] = {
    Reason.OK: ("", False),
    Reason.ZERO_EXTENT: ("the object has no extent in the picture: its two ends fall on one point", True),
    Reason.BEHIND_CAMERA: ("the object would lie behind the camera", False),
    Reason.NOT_INVERTIBLE: ("a point lies where the lens model gives no direction (its distortion folds back)", False),
    Reason.TOO_OBLIQUE: ("no place of the object fits: it can't be tilted that much and look that long", False),
    Reason.NOT_CONVERGED: ("no pose of the target fits the points", False),
    Reason.NOT_PINHOLE: ("this method needs a perspective picture, and the camera's is a panorama", False),
    Reason.OUT_OF_RANGE: ("an input left the range it has a meaning in (a length, a focal length of 0 or below)", True),
    Reason.FOLDED: (
        "no plane looks like this: a part of it would lie behind the camera; are the points in their right order?",
        False,
    ),
    Reason.COLLINEAR: (
        "the reference points do not determine the plane: three of four lie on one line, or two on one point",
        False,
    ),
    Reason.BEYOND_HORIZON: ("a point lies on or beyond the horizon of the plane", True),
    Reason.NO_VANISHING_POINT: (
        "the lines do not determine a vanishing point or the horizon: they coincide, or are too short",
        False,
    ),
    Reason.NO_HEIGHT: (
        "the reference has no height in this view: its two ends fall on one point, or the view is straight down",
        True,
    ),
    Reason.AT_OR_ABOVE_HORIZON: (
        "a point lies at or above the horizon of the ground: its pitch, its slope or the point is wrong, or it is no ground",
        True,
    ),
    Reason.NO_PARALLAX: (
        "the two pictures show the point where they would show it infinitely far away, or beyond that: its disparity is too small",
        True,
    ),
    Reason.UPSIDE_DOWN: (
        "base and top are exchanged: the first point is the base on the plane, the second the top",
        False,
    ),
    Reason.UNDETERMINED: (
        "the conditions do not fix the plane: more than one meets them; give one more, of another kind or direction",
        False,
    ),
    Reason.PARALLEL_RAYS: ("the lines of sight do not meet in front of the cameras: they are parallel, or part", True),
    Reason.NO_BASELINE: (
        "the first two pictures of the point were taken from one place, which tells no distance",
        False,
    ),
}

Partials = tuple[Array, ...]


@dataclass(frozen=True)
class Output:
    """One number a method gives.

    Attributes:
        name: the field of the method's result.
        what: range, depth, length, ...
        unit: m, px, rad, ...
        title: the name people read.
        nonnegative: an interval's lower end is cut at 0.
        digits: significant digits of u that the ends of its interval must keep (JCGM 101, 7.9.2).
    """

    name: str
    what: str
    unit: str
    title: str
    nonnegative: bool = True
    digits: int = 2


@dataclass(frozen=True)
class Method:
    """One way to measure.

    Attributes:
        name: the key in METHODS, as on the command line.
        title: a few words.
        button: one or two words, for a tool that measures in a picture.
        inputs: the frozen dataclass whose fields are nouns.
        outputs: the numbers it gives, headline first.
        function: Inputs to a frozen result with an array per output and `reason`; pure, broadcasting, without sigma.
        assumes: what must hold for the interval to hold, one sentence each.
        source: where the relation is published.
        typical: its usual relative error, in words.
        example: makes Inputs for documentation and contract tests.
        prepare: settles what the inputs leave open (the weight of a second solution) before anything is moved.
        start: for estimators, the nominal solution that `function` refines (its second argument).
        derivative: partial derivatives by (field, part key): {output: {(field, key): one array a
            component}}; None where it has none.
        place: the arguments of `function` to where in the camera's frame that is whose range is given, (..., 3) m, NaN
            without an answer; None for methods that place nothing.
        notes: doubts that follow from the inputs and the nominal result.
        most_draws: where the adaptive procedure stops at the latest.
        vectorised: False for engines that take one scene at a time.
    """

    name: str
    title: str
    inputs: type
    outputs: tuple[Output, ...]
    function: Callable[..., Any]
    assumes: tuple[str, ...]
    source: str
    typical: str
    example: Callable[[], Any]
    button: str = ""
    prepare: Callable[[Any], Any] = field(default=lambda inputs: inputs)
    start: Callable[[Any], Any] | None = None
    derivative: Callable[[Any, Any], Mapping[str, Mapping[tuple[str, str], Partials]] | None] | None = None
    place: Callable[..., Array] | None = None
    notes: Callable[[Any, Any], tuple[Note, ...]] = field(default=lambda inputs, result: ())
    vectorised: bool = True
    most_draws: int = 1_000_000

    @property
    def needs(self) -> str:
        """The first paragraph of the inputs' documentation."""
        return (self.inputs.__doc__ or "").strip().split("\n\n")[0]


def reasons(shape: tuple[int, ...], *conditions: tuple[Bools, Reason]) -> Codes:
    """(shape) the first reason whose condition holds, OK elsewhere."""
    code = np.zeros(shape, np.int8)
    for where, reason in reversed(conditions):
        np.copyto(code, _NUMBERS[reason], where=where)
    return code


_NUMBERS = {reason: np.int8(reason) for reason in Reason}
