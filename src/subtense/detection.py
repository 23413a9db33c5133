"""Detection: something that was found in a photo, which way it can be measured, and what its size is taken to be.

A detector is a function from a Photo and a Search to Detections; it never measures. What shape a thing has says which method
can (see `workflow.detect`): of a square or rectangle the corners were seen, of a length its two ends, of a circle or a sphere
points of its rim.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from .camera import Camera
from .errors import InputError
from .observation import Observation
from .quantity import Note, Quantity
from .targets import KnownTarget

SHAPES = ("square", "rectangle", "length", "circle", "sphere")
"""What can be found. Squares and rectangles: top-left, top-right, bottom-right, bottom-left as they stand or read."""


def unknown_curve() -> Quantity:
    """Exponent of the transfer curve where nothing was said: that of sRGB, from which cameras' own curves differ."""
    return Quantity.normal(2.2, 0.5, "1", "assumed: near the sRGB curve; cameras draw their own contrast")


def parse_curve(text: str) -> Quantity:
    """`linear`, `srgb`, or an exponent: from light to encoded value, value = light^(1/exponent)."""
    known = {"linear": 1.0, "srgb": 2.2}
    word = text.strip().lower()
    try:
        exponent = known[word] if word in known else float(word.removeprefix("gamma"))
    except ValueError:
        exponent = 0.0
    if not 0.4 <= exponent <= 4.0:
        raise InputError("--curve", text, "write srgb, linear, or an exponent between 0.4 and 4, as 2.2")
    return Quantity.exact(exponent, "1", "stated")


@dataclass(frozen=True)
class Search:
    """What a detector is told beside the photo.

    Attributes:
        targets: kinds that a person says are in the picture; empty where nothing was said.
        family: of markers; None for all.
        curve: exponent of the transfer curve, from light to encoded values.
        thorough: whether the full resolution is searched even where a coarse one would do.
        model: a network of one's own, for detectors that take one.
        camera: of the picture, where it is known: it tells shapes apart that perspective makes alike.
        progress: is told the share done, 0 to 1.
    """

    targets: tuple[KnownTarget, ...] = ()
    family: str | None = None
    curve: Quantity = field(default_factory=unknown_curve)
    thorough: bool = False
    model: Path | None = None
    camera: Camera | None = None
    progress: Callable[[float], None] = lambda share: None


@dataclass(frozen=True)
class Detection:
    """One thing found.

    Attributes:
        seen: the points, with sigma or covariance, label and score.
        shape: of SHAPES.
        target: what its size is taken to be; None where that must be told (a marker's side, a coin's kind).
        others: further kinds that fit as well.
        tilt: of a length, its angle to the image plane where that is known better than not at all, rad.
        notes: doubts about what was seen.
    """

    seen: Observation
    shape: str
    target: KnownTarget | None = None
    others: tuple[KnownTarget, ...] = ()
    tilt: Quantity | None = None
    notes: tuple[Note, ...] = ()

    def __post_init__(self) -> None:
        if self.shape not in SHAPES:
            raise InputError("shape", self.shape, f"known are {', '.join(SHAPES)}")

    @property
    def label(self) -> str:
        """What it is called."""
        return self.seen.label

    def to_json(self) -> dict[str, Any]:
        """The observation with what it is of."""
        return {
            **self.seen.to_json(), "shape": self.shape, "target": self.target.name if self.target else None,
            "others": [one.name for one in self.others], "tilt": self.tilt.to_json() if self.tilt else None,
            "notes": [note.to_json() for note in self.notes],
        }  # fmt: skip
