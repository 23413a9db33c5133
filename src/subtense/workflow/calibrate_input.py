"""What `subtense calibrate` is told, as nouns: the board, the pictures, where to write."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from .. import assumptions
from ..board import Board
from ..errors import InputError
from ..quantity import Quantity

PICTURES = frozenset((".jpg", ".jpeg", ".png", ".tif", ".tiff", ".webp", ".bmp", ".heic", ".heif", ".avif", ".dng"))
"""Endings that count as pictures in a folder."""


def board_of(kind: str, squares: str | None, square: str | None, marker: str | None = None, dictionary: str | None = None,
             *, legacy: bool = False) -> Board:  # fmt: skip
    """The board as it is described in words.

    Args:
        kind: of board.KINDS.
        squares: "10x7", across and down.
        square: length of a side, mm if bare; without ± it is taken to 0.5 %.
        marker: side of a marker's black square.
        dictionary: of the markers.
        legacy: a ChArUco pattern of OpenCV before 4.6.

    Raises:
        InputError: something missing or impossible.
    """
    if squares is None:
        raise InputError("--squares", None, "give how many across and down, as 10x7")
    if square is None:
        raise InputError("--square", None, "give the side of a square, as '25 mm'")
    columns, rows = Board.parse_count(squares)
    side = Quantity.parse(square, "m", bare="mm", name="--square", assume=assumptions.size)
    if marker is None:
        black = 0.0
        if kind in ("charuco", "aprilgrid"):
            raise InputError(
                "--marker", None, f"a {kind} board needs the side of its markers' black squares, as '18 mm'"
            )
    else:
        black = float(Quantity.parse(marker, "m", bare="mm", name="--marker", assume=assumptions.size).value)
    if not float(side.value) > 0:
        raise InputError("--square", square, "give a length above 0")
    return Board(kind, columns, rows, float(side.value), black, (dictionary or "").lower(), legacy,
                 float(side.u) / float(side.value), side.source)  # fmt: skip


def printed_width(text: str | None) -> Quantity | None:
    """The measured width of the whole pattern; without ± it is taken to half its last digit."""
    if text is None:
        return None

    def ruled(value: float, half_digit: float) -> Quantity:
        return Quantity.uniform(value - half_digit, value + half_digit, "m", "assumed: half its last digit")

    return Quantity.parse(text, "m", bare="mm", name="--printed", assume=ruled)


def pictures_of(paths: Sequence[Path]) -> list[Path]:
    """The pictures: files as named, folders as all the pictures in them, by name.

    Raises:
        InputError: none, or one twice.
    """
    found: list[Path] = []
    for path in paths:
        found += _in_folder(path) if path.is_dir() else [path]
    if not found:
        raise InputError("IMAGES", None, "name pictures of the board, or a folder of them")
    twice = next((p for p in found if found.count(p) > 1), None)
    if twice is not None:
        raise InputError("IMAGES", str(twice), "it is named twice; name each picture once")
    return found


def _in_folder(folder: Path) -> list[Path]:
    inside = sorted(p for p in folder.iterdir() if p.suffix.lower() in PICTURES and not p.name.startswith("."))
    if not inside:
        raise InputError("IMAGES", str(folder), "the folder holds no pictures")
    return inside


def pairs_of(paths: Sequence[Path]) -> tuple[list[Path], list[Path]]:
    """Left and right pictures: two folders, or the first and the second half of the files.

    Raises:
        InputError: not as many of each, or numbers in the names that differ.
    """
    if len(paths) == 2 and all(p.is_dir() for p in paths):
        left, right = (pictures_of([p]) for p in paths)
    else:
        every = pictures_of(paths)
        left, right = every[: len(every) // 2], every[len(every) // 2 :]
    if len(left) != len(right):
        raise InputError(
            "--stereo", f"{len(left)} left and {len(right)} right pictures", "give as many of each, in the same order"
        )
    for a, b in zip(left, right, strict=True):
        numbers = [re.findall(r"\d+", p.stem)[-1:] for p in (a, b)]
        if numbers[0] and numbers[1] and int(numbers[0][0]) != int(numbers[1][0]):
            raise InputError(
                "--stereo", f"{a.name} with {b.name}", "their numbers differ; give pairs that were taken at once"
            )
    return left, right
