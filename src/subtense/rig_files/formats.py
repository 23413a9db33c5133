"""The table of rig file formats; files are told by what they say."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..camera_files import json_text, xml_text, yaml_text
from ..camera_files.reading import MOST_BYTES
from ..camera_files.selector import split
from ..errors import FileFormatError, InputError
from ..quantity import Quantity
from . import kalibr, kitti, middlebury, opencv, own, ros
from .reading import RigFound, RigReading


@dataclass(frozen=True)
class RigFormat:
    """One row of RIG_FORMATS.

    Attributes:
        name: a word.
        title: as people call it.
        tells: whether the contents are of this format.
        read: the reader.
    """

    name: str
    title: str
    tells: Callable[[tuple[Any, ...]], bool]
    read: Callable[[RigReading], RigFound]


RIG_FORMATS: dict[str, RigFormat] = {
    row.name: row
    for row in (
        RigFormat("subtense", "subtense JSON", own.tells, own.read),
        RigFormat("middlebury", "Middlebury calib.txt", middlebury.tells, middlebury.read),
        RigFormat("kitti", "KITTI calib.txt", kitti.tells, kitti.read),
        RigFormat("ros", "two ROS camera_info", ros.tells, ros.read),
        RigFormat("kalibr", "Kalibr camchain", kalibr.tells, kalibr.read),
        RigFormat("opencv", "OpenCV stereo YAML, XML or JSON", opencv.tells, opencv.read),
    )
}
"""Every format; the more telling ones come first."""


def read(names: Sequence[str], *, size_px: tuple[int, int] | None = None, unit: str = "", baseline: Quantity | None = None,
         rectified: bool = False) -> RigFound:  # fmt: skip
    """The rig in one file, or in two.

    Args:
        names: as typed, with what stands behind a #.
        size_px: of the pictures that it is wanted for, where the file does not tell it.
        unit: of lengths, where the file does not tell it.
        baseline: as typed, in place of the file's.
        rectified: that the pictures are rectified.

    Raises:
        FileFormatError: no rig that can be used; where, and what would help.
    """
    if not 1 <= len(names) <= 2:
        raise InputError("--rig", f"{len(names)} files", "give one file of two cameras, or one of each")
    split_names = [split(name) for name in names]
    paths = tuple(path for path, _ in split_names)
    trees = tuple(_tree(path) for path in paths)
    reading = RigReading(paths, trees, size_px, split_names[0][1], unit, baseline, rectified)
    with np.errstate(all="ignore"):  # absurd numbers are refused by what comes of them
        for row in RIG_FORMATS.values():
            if row.tells(trees):
                return _plausible(paths, row.read(reading))
    known = ", ".join(row.title for row in RIG_FORMATS.values())
    raise FileFormatError(paths[0], f"holds no two cameras that are known here; known are {known}")


def _plausible(paths: tuple[Path, ...], found: RigFound) -> RigFound:
    rig = found.rig
    if not 1e-4 < rig.baseline_m < 1000:
        raise FileFormatError(
            paths[0], f"has a baseline of {rig.baseline_m:g} m, which no rig has; is its unit another one?"
        )
    return found


def _tree(path: Path) -> Any:
    """The content: a tree of JSON, XML or YAML, or the text."""
    if not path.is_file():
        raise FileFormatError(path, "no such file")
    with path.open("rb") as file:
        content = file.read(MOST_BYTES + 1)
    if len(content) > MOST_BYTES:
        raise FileFormatError(path, f"is larger than {MOST_BYTES // 2**20} MiB, no calibration is")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise FileFormatError(path, "is not a text in UTF-8; give the file that the calibration wrote") from None
    bare = text.lstrip()
    if bare.startswith("<"):
        return xml_text.tree(path, content)
    if bare[:1] in "{[" and bare:
        return json_text.tree(path, text)
    return text if middlebury.tells((text,)) or kitti.tells((text,)) else yaml_text.tree(path, text)
