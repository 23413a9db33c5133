"""What a reader of calibration files gets and gives, and the checks that all of them share."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from ..arrays import Array
from ..camera import Camera
from ..errors import FileFormatError, InputError
from ..quantity import Note
from .selector import NOTHING, Pick

MOST_BYTES = 2**20
MOST_DEPTH = 32
MOST_NUMBERS = 1000
"""In one matrix; the longest that is read, a covariance of 18 numbers, has 324."""
MOST_SIDE_PX = 1_000_000
_MOST_NAMES = 12

One = TypeVar("One")


@dataclass(frozen=True)
class Found:
    """What a calibration file says.

    Attributes:
        camera: with `cov` None where the file tells no uncertainty.
        notes: doubts that the file carries or that reading it raises.
        frame: "stored" where the calibration is of pictures before their EXIF orientation, "upright" where of those
            after it; empty where the file does not say.
    """

    camera: Camera
    notes: tuple[Note, ...] = ()
    frame: str = ""


@dataclass(frozen=True)
class Reading:
    """One file on its way in.

    Attributes:
        path: for messages.
        content: the content as its syntax gives it: a tree of dicts, lists, numbers and texts, or text, or bytes.
        pick: what was said beside the file.
    """

    path: Any
    content: Any
    pick: Pick = NOTHING

    def refused(self, reason: str) -> FileFormatError:
        """The error of this file."""
        return FileFormatError(self.path, reason)

    # -- numbers -----------------------------------------------------------------------------------

    def number(self, value: Any, name: str) -> float:
        """A finite number."""
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise self.refused(f"{name} is {_shown(value)}; a number is needed")
        try:
            found = float(value)
        except OverflowError:
            found = math.inf
        if not math.isfinite(found):
            raise self.refused(f"{name} is {_shown(value)}; a finite number is needed")
        return found

    def numbers(self, value: Any, name: str, counts: Sequence[int] = ()) -> list[float]:
        """The numbers of a list, of a list of lists, or of a matrix with rows, cols and data.

        Args:
            value: of the tree.
            name: for messages.
            counts: how many there may be; empty for any.
        """
        flat: list[Any] = []
        for row in _rows(self, value, name):
            flat += row if isinstance(row, list) else [row]
            if len(flat) > MOST_NUMBERS:
                raise self.refused(f"{name} has more than {MOST_NUMBERS} numbers")
        found = [self.number(item, f"{name}[{i}]") for i, item in enumerate(flat)]
        if counts and len(found) not in counts:
            wanted = " or ".join(map(str, counts))
            raise self.refused(f"{name} has {len(found)} numbers; {wanted} are needed")
        return found

    def size(self, width: Any, height: Any) -> tuple[int, int]:
        """The picture's size, from the file or from what was said beside it; both must agree."""
        said = self.pick.size_px
        if width is None or height is None:
            if said is None:
                raise self.refused(
                    f"does not tell the picture's size; write it behind the name, as {self.path}#640x480"
                )
            width, height = said
        size = self._side(width, "width"), self._side(height, "height")
        if said is not None and said != size:
            raise self.refused(f"is for {size[0]} x {size[1]} px; leave out #{said[0]}x{said[1]}")
        return size

    def _side(self, value: Any, name: str) -> int:
        side = self.number(value, f"the picture's {name}")
        if not 1 <= side <= MOST_SIDE_PX or side != int(side):
            raise self.refused(f"the picture's {name} is {side:g}; a whole number of 1 to {MOST_SIDE_PX} is needed")
        return int(side)

    def text(self, value: Any, name: str) -> str:
        """A text."""
        if not isinstance(value, str):
            raise self.refused(f"{name} is {_shown(value)}; a text is needed")
        return value

    def mapping(self, value: Any, name: str) -> dict[str, Any]:
        """A part of the tree that has keys."""
        if not isinstance(value, dict):
            raise self.refused(f"{name} is {_shown(value)}; keys and values are needed")
        return value

    def one(self, several: Mapping[str, One]) -> tuple[str, One]:
        """The camera that was asked for, or the only one."""
        names = ", ".join(list(several)[:_MOST_NAMES]) + (", ..." if len(several) > _MOST_NAMES else "")
        wanted = self.pick.name
        if wanted is None and len(several) > 1:
            raise self.refused(
                f"has {len(several)} cameras ({names}); choose one, as {self.path}#{next(iter(several))}"
            )
        if not several:
            raise self.refused("holds no camera")
        if wanted is not None and wanted not in several:
            raise self.refused(f"has no camera {wanted!r}; it has {names}")
        name = next(iter(several)) if wanted is None else wanted
        return name, several[name]

    def none_to_choose(self) -> None:
        """That no camera was asked for by name, where the format holds one without a name."""
        if self.pick.name is not None:
            raise self.refused(f"has one camera without a name; leave out #{self.pick.name}")

    # -- a camera ----------------------------------------------------------------------------------

    def focal_and_centre(self, matrix: list[float], name: str) -> tuple[float, float, float, float]:
        """fx, fy, cx, cy of a 3 x 3 camera matrix given row by row."""
        if any(matrix[i] != wanted for i, wanted in ((3, 0.0), (6, 0.0), (7, 0.0), (8, 1.0))):
            raise self.refused(
                f"{name} is no camera matrix: the numbers below its diagonal must be 0 and the last one 1"
            )
        self.no_skew(matrix[1])
        return matrix[0], matrix[4], matrix[2], matrix[5]

    def no_skew(self, skew: float) -> None:
        """Skew is no part of a Camera, and to leave it out would be wrong."""
        if skew != 0:
            raise self.refused(f"has a skew of {skew:g}; calibrate without skew (pixels of today's sensors have none)")

    def camera(self, size_px: tuple[int, int], focal: Sequence[float], centre: Sequence[float], lens: str,
               k: Sequence[float], cov: Array | None = None) -> Camera:  # fmt: skip
        """A Camera of these numbers; a lens whose coefficients are all exactly 0 has no distortion: a pinhole."""
        fx, fy = focal
        for value, name in ((fx, "fx"), (fy, "fy")):
            if not value > 0:
                raise self.refused(f"{name} is {value:g}; a focal length above 0 is needed")
        if lens == "brown_conrady" and cov is None and not any(k):
            lens, k = "pinhole", ()
        name = getattr(self.path, "name", self.path)
        try:
            return Camera(*size_px, fx, centre[0], centre[1], fy / fx, lens, _padded(lens, k), cov,
                          source=f"calibration file {name}")  # fmt: skip
        except InputError as error:
            raise self.refused(str(error)) from None


def _padded(lens: str, k: Sequence[float]) -> Array:
    """Coefficients with zeros to the next number of them that the lens model has; too many stay, and are refused."""
    if lens == "brown_conrady":
        count = next((n for n in (5, 8, 12, 14) if n >= len(k)), len(k))
        return np.array([*k, *[0.0] * (count - len(k))])
    return np.array(k, float)


def _rows(reading: Reading, value: Any, name: str) -> list[Any]:
    """The rows of nested lists, or the data of a matrix with rows and cols."""
    if isinstance(value, dict):
        data = value.get("data")
        if not isinstance(data, list):
            data = [] if data is None else [data]
        rows, cols = (value.get(key, value.get(other)) for key, other in (("rows", "Rows"), ("cols", "Cols")))
        if rows is not None and cols is not None:
            count = reading.number(rows, f"rows of {name}") * reading.number(cols, f"cols of {name}")
            if count != len(data):
                raise reading.refused(f"{name} has {len(data)} numbers, and its rows and cols say {count:g}")
        return data
    if value is None:
        raise reading.refused(f"{name} is missing")
    return value if isinstance(value, list) else [value]


def _shown(value: Any) -> str:
    if value is None:
        return "missing"
    if isinstance(value, (dict, list)):
        return "a list" if isinstance(value, list) else "keys and values"
    if isinstance(value, int) and abs(value) > 10**20:  # to print thousands of digits may itself be refused
        return "a huge number"
    text = repr(value) if isinstance(value, str) else str(value)
    return text if len(text) <= 40 else text[:37] + "..."
