"""Middlebury's calib.txt: cam0, cam1, doffs, baseline in mm, width and height, of a rectified pair.

Pixel (0, 0) is a centre there. Z = f B / (d + doffs), where doffs is cam1's principal point less cam0's, along x.
"""

from __future__ import annotations

import re
from typing import Any

from ..camera_files import scalars
from .reading import RigFound, RigReading, rectified_rig

_LINE = re.compile(r"\s*([A-Za-z]\w{0,30})\s*=\s*(.{0,400}?)\s*", re.ASCII)


def tells(trees: tuple[Any, ...]) -> bool:
    """Whether this is one."""
    return len(trees) == 1 and isinstance(trees[0], str) and bool(re.search(r"(?m)^\s*cam0\s*=\s*\[", trees[0]))


def read(reading: RigReading) -> RigFound:
    """The rig."""
    said = {m[1]: m[2] for line in reading.trees[0].splitlines()[:200] if (m := _LINE.fullmatch(line))}
    one = reading.of()
    first = one.focal_and_centre(_matrix(reading, said, "cam0"), "cam0")
    second = one.focal_and_centre(_matrix(reading, said, "cam1"), "cam1")
    if abs(first[0] - second[0]) > 1e-3 * first[0]:
        raise reading.refused("cam0 and cam1 have other focal lengths, so that this is no rectified pair")
    baseline = one.number(scalars.value(said.get("baseline", "")), "baseline")
    doffs = one.number(scalars.value(said["doffs"]), "doffs") if "doffs" in said else second[2] - first[2]
    if abs(doffs - (second[2] - first[2])) > 0.5:
        raise reading.refused(
            f"doffs is {doffs:g}, and the principal points differ by {second[2] - first[2]:g} px; one of them is wrong"
        )
    size = one.size(scalars.value(said.get("width", "")), scalars.value(said.get("height", "")))
    return rectified_rig(reading, size, first[0], (first[2], first[3]), doffs, baseline / 1000)


def _matrix(reading: RigReading, said: dict[str, str], name: str) -> list[float]:
    words = re.split(r"[\s,;]+", said.get(name, "").strip("[] "))
    return reading.of().numbers([scalars.value(word) for word in words], name, (9,))
