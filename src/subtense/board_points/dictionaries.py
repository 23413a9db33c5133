"""Markers' dictionaries by the names people give them."""

from __future__ import annotations

from typing import Any

from ..arrays import Pixels
from ..errors import InputError

SIZES = (50, 100, 250, 1000)
SMALLEST_PX, SMALLEST_SHARE = 36.0, 0.01
"""Perimeter of a marker that can still be read; that over the picture's longest side below which there would be too many."""
NAMES: dict[str, str] = {
    **{f"{bits}x{bits}_{size}": f"DICT_{bits}X{bits}_{size}" for bits in (4, 5, 6, 7) for size in SIZES},
    "aruco_original": "DICT_ARUCO_ORIGINAL", "aruco_mip_36h12": "DICT_ARUCO_MIP_36h12",
    "16h5": "DICT_APRILTAG_16h5", "25h9": "DICT_APRILTAG_25h9", "36h10": "DICT_APRILTAG_36h10",
    "36h11": "DICT_APRILTAG_36h11",
}  # fmt: skip
"""Name to OpenCV's name. The first 50 markers of 4x4_1000 are those of 4x4_50, so the larger reads the smaller."""


def dictionary_name(text: str) -> str:
    """The key of NAMES that is meant: `DICT_4X4_50`, `tag36h11`, `apriltag_36h11` are understood too.

    Raises:
        InputError: no such dictionary.
    """
    name = text.strip().lower().removeprefix("dict_")
    for start in ("apriltag_", "apriltag", "tag"):
        name = name.removeprefix(start)
    name = {"mip_36h12": "aruco_mip_36h12", "original": "aruco_original"}.get(name, name)
    if name not in NAMES:
        raise InputError("--dictionary", text, "give 4x4_50, 4x4_100, 4x4_250, 4x4_1000, the same of 5x5 to 7x7, "
                         "aruco_original, aruco_mip_36h12, 16h5, 25h9, 36h10 or 36h11")  # fmt: skip
    return name


def dictionary(text: str) -> Any:
    """OpenCV's dictionary."""
    import cv2

    return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, NAMES[dictionary_name(text)]))


def size_of(text: str) -> int:
    """How many markers a dictionary has."""
    return len(dictionary(text).bytesList)


def modules_of(text: str) -> int:
    """Modules across a marker without its black border."""
    return int(dictionary(text).markerSize)


def smallest_perimeter(gray: Pixels) -> float:
    """Perimeter of the smallest marker to look for, over the picture's longest side, as OpenCV wants it."""
    return max(SMALLEST_PX / float(max(gray.shape)), SMALLEST_SHARE)
