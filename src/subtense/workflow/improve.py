"""What would improve a measurement most, from the largest line of its budget."""

from __future__ import annotations

import math

from ..noun import unchecked
from ..quantity import Measurement
from ..reports.rounding import digits_for, fitting_unit, grouped

CURES = (
    ("map value", "anchor the map near the place, choose a place within the thing, or use a better map"),
    ("map scale", "give more anchors, or better known ones"),
    ("map shift", "give anchors nearer and farther away"),
    ("log factor", "give one known distance in the picture, with --anchor"),
    ("pitch", "mark the horizon, or measure the pitch with a spirit level at the camera"),
    ("roll", "mark the horizon, or level the camera"),
    ("slope", "measure the slope of the ground and state its ±"),
    ("rise", "give how much higher the ground there lies, or the height above it"),
    ("elevation", "survey the height of the point"),
    ("shape of the survey", "survey the points more closely"),
    ("focal length", "calibrate the camera at this focus (20 pictures of a board), or measure one known distance"),
    ("pixel aspect", "calibrate the camera"),
    ("rotation between the cameras", "calibrate the pair, and keep it rigid"),
    ("baseline", "calibrate the pair at this focus, and keep it rigid"),
    ("principal points", "calibrate the pair at this focus"),
    (
        "disparity",
        "set the cameras farther apart, use a longer lens or more pixels, or match to a smaller part of a pixel",
    ),
    ("principal point", "calibrate the camera, or keep the object near the middle of the picture"),
    ("lens distortion", "calibrate the camera, or keep the object near the middle of the picture"),
    ("sensor width", "look up the sensor's width to two decimals, or calibrate the camera"),
    ("image width", "state the picture's own width in pixels"),
    ("pixel", "come closer or use a longer lens, so that the object is larger in the picture"),
    ("extent", "come closer or use a longer lens, or measure its ends to a tenth of a pixel"),
    ("size", "measure the object itself with a calliper or a tape and state its ±"),
    ("distance", "measure the distance with a tape or a laser and state its ±"),
    ("tilt", "turn the object to face the camera and state its tilt, or use a target with four known points"),
    ("focus", "calibrate the camera at this focus"),
    ("height", "measure the height with a tape or a laser and state its ±"),
    ("interaction", "lessen the largest of the other lines: the response bends"),
)
"""A word of a budget line's name, and what lessens that line; the first that fits is taken."""


def cure_of(name: str) -> str:
    """What lessens a line of a budget, by its name."""
    return next((cure for word, cure in CURES if word in name), "state it more closely")


def improve(m: Measurement) -> str:
    """One sentence: the largest line, what u would be without it, and what lessens it; empty where there is no budget."""
    if not m.budget or m.u is None:
        return ""
    if m.method == "fuse" and any(note.code == "methods_disagree" for note in m.notes):
        return "find out which of the measurements is wrong; what they consist of says less than that they contradict each other."
    top = m.budget[0]
    name, factor = fitting_unit(m.value, m.unit)
    rest = m.u * math.sqrt(max(1 - top.share, 0.0)) / factor
    now = m.u / factor
    less = f"{grouped(rest, max(digits_for(rest), 0))}" if rest > 1e-4 * now else "next to 0"
    saving = f"without it u would be {less} instead of {grouped(now, max(digits_for(now), 0))} {name}"
    return f"{top.name} makes {100 * top.share:.0f} % of the variance ({saving}): {cure_of(top.name)}."


def improved(measurements: tuple[Measurement, ...]) -> tuple[Measurement, ...]:
    """The measurements with `improve` filled in."""
    return tuple(unchecked(m, improve=improve(m)) for m in measurements)
