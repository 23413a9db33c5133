"""Whether the stated side of markers is that of the black square, told by another thing of known size in the same plane.

People measure a marker with its white border, and families with data outside the border are measured across the whole pattern: the
size is then off by (n + 2) / n, or 9 / 5. Where a second thing of known size lies in the marker's plane, the two say how far off
the plane is; a ratio of just such a value tells the mistake.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Array
from ..detection import Detection
from ..methods import pose
from ..quantity import Note

PARALLEL_RAD = math.radians(6.0)
"""Planes whose normals differ by less may be one."""
NEAR = 0.03
"""Logarithm of the ratio over that of a mistake, within which it is told."""
MISTAKES = {
    "with the white border": (10 / 8, 9 / 7, 8 / 6, 11 / 9),
    "across the whole pattern, not its border": (9 / 5, 10 / 6, 11 / 5),
}
"""How many times too large the stated side is."""


@dataclass(frozen=True)
class Plane:
    """Where a flat thing lies by its own size: the unit normal towards the camera, and the plane's distance from it, m."""

    normal: Array
    distance_m: float

    @classmethod
    def of(cls, inputs: pose.Inputs) -> Plane | None:
        """By the better of its poses."""
        begin = pose.start(inputs)
        if not begin.poses:
            return None
        normal = begin.poses[0].rotation[:, 2]
        distance = float(normal @ begin.poses[0].translation_m)
        return cls(-normal * np.sign(distance), abs(distance))


def size_convention(planes: Mapping[str, tuple[Detection, Plane]]) -> tuple[Note, ...]:
    """The note `size_convention` for markers whose stated size another thing in their plane contradicts by a usual mistake.

    Args:
        planes: by label; markers are squares without a target of their own, the others have one.
    """
    markers = [(one, plane) for one, plane in planes.values() if one.shape == "square" and one.target is None]
    others = [(one, plane) for one, plane in planes.values() if one.target is not None]
    notes = []
    for marker, plane in markers:
        for other, beside in others:
            mistake = _mistake(plane, beside)
            if mistake:
                what, ratio = mistake
                title = other.target.title if other.target else other.label
                text = f"{marker.label}: beside the {title} its stated side is {ratio:.2f} times too large, as if measured {what}"
                cure = "give the side of the black square, or of the border of a tag with data outside it"
                notes.append(Note("size_convention", text, cure))
                break
    return tuple(notes)


def _mistake(plane: Plane, beside: Plane) -> tuple[str, float] | None:
    """Which mistake the ratio of the planes' distances tells."""
    if float(plane.normal @ beside.normal) < math.cos(PARALLEL_RAD):
        return None
    ratio = plane.distance_m / beside.distance_m
    found = [(abs(math.log(ratio / usual)), what) for what, all_of in MISTAKES.items() for usual in all_of]
    gap, what = min(found)
    return (what, ratio) if gap < NEAR else None


def planes_of(measured: Sequence[tuple[Detection, object]]) -> dict[str, tuple[Detection, Plane]]:
    """The planes of what was measured by its pose."""
    if len({one.target is None for one, _ in measured}) < 2:  # no marker, or nothing to compare it with
        return {}
    found = {}
    for one, inputs in measured:
        if isinstance(inputs, pose.Inputs) and (plane := Plane.of(inputs)) is not None:
            found[one.label] = (one, plane)
    return found
