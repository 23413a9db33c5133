"""The readable report: what was found, its interval, what it consists of, what is doubtful, what would improve it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from textwrap import wrap
from typing import Any

from ..document import Document
from ..quantity import Measurement, Note
from .rounding import digits_for, fitting_unit, grouped, number

WIDTH = 100
_BAR = 20

TITLES = {
    "range": "distance from the entrance pupil (range)",
    "depth": "distance along the axis (depth)",
    "length": "length",
    "ground_distance": "ground distance",
    "speed": "mean speed",
    "area": "area",
    "near_width": "along the lower edge",
    "far_width": "along the upper edge",
    "position_x": "place, x",
    "position_y": "place, y",
    "position_z": "place, z",
    "object_scale_along": "mm per pixel, along the columns",
    "size": "real size",
    "extent": "extent in the picture",
    "focal_length": "focal length",
    "sensor_width": "sensor width",
    "image_width": "picture width",
    "focal_length_px": "focal length in pixels",
    "sensor_scale": "pixels per mm on the sensor",
    "object_scale": "mm per pixel at the object",
    "field_of_view": "field of view across the width",
    "angle": "angle the object subtends",
    "tilt": "tilt to the line of sight",
    "corner": "angle in the plane",
    "height": "height",
    "camera_height": "camera above the plane",
    "width": "its level part",
    "rise": "its upright part",
    "depth_difference": "how much deeper the second is",
}


def report(document: Document) -> str:
    """The document as text, without a trailing newline."""
    lines: list[str] = []
    if document.photo:
        p = document.photo
        lines += [f"{p['name']}, {p['width_px']} x {p['height_px']} px"]
    if document.camera and "lens" in document.camera:  # a calculator's focal length stands among its results
        lines += _camera(document)
    lines += _notes(document.notes)
    for label in dict.fromkeys(m.label for m in document.measurements):
        group = [m for m in document.measurements if m.label == label]
        lines += ["" if lines else None, *_group(group)]  # type: ignore[list-item]
    return "\n".join(line for line in lines if line is not None)


def _camera(document: Document) -> Iterator[str]:
    camera = document.camera or {}
    yield f"camera: {_focal(camera['f_px'], camera.get('u_f_px'))}, {camera['source']}"
    if any(m.what == "focal_length_px" for m in document.measurements):  # the camera is what was asked for
        yield from _sources(camera)
    else:
        for other in camera.get("hypotheses", ()):
            if not other["chosen"] and other["f_px"]:
                yield f"  {other['source']} says {_focal(other['f_px'], other['u_f_px'])}, {other['text']}"
    if camera.get("pose"):
        yield from wrap(_pose(camera["pose"]), WIDTH, subsequent_indent="  ")


def _sources(camera: Mapping[str, Any]) -> Iterator[str]:
    """A table of what every source says, the chosen one marked, and where the rest of the camera comes from."""
    for name, source in camera.get("part_sources", {}).items():
        yield f"  {name}: {source}"
    told = camera.get("hypotheses", ())
    said = [
        _focal(h["f_px"], h["u_f_px"]).removeprefix("f = ").removesuffix(" (95 %)") if h["f_px"] else "-" for h in told
    ]
    widest = max((len(h["source"]) for h in told), default=0)
    broadest = max((len(text) for text in said), default=0)
    yield "what every source says (95 %)"
    for h, text in zip(told, said, strict=True):
        yield f"{'>' if h['chosen'] else ' '} {h['source']:<{widest}}  {text:<{broadest}}  {h['text']}"


def _pose(pose: Mapping[str, Any]) -> str:
    """One line: the angles of the upright picture, and the height where it is told."""
    pitch, roll, half = (math.degrees(pose[key]) for key in ("pitch_rad", "roll_rad", "u_rad"))
    height = pose["height_above_start_m"]
    above = f", {height:.1f} m ± {1.96 * pose['u_height_m']:.1f} m above the start" if height is not None else ""
    angles = (
        f"pitch {pitch:+.1f}° (0 the horizon, -90 straight down), roll {roll:+.1f}°, both ± {1.96 * half:.1f}° (95 %)"
    )
    return f"pose: {angles}{above}, {pose['source']}"


def _focal(f_px: float, u: float | None) -> str:
    return f"f = {number(f_px, 'px', u)}" + (f" ± {number(1.96 * u, 'px', u)} (95 %)" if u else "")


def _group(group: list[Measurement]) -> Iterator[str]:
    head, *others = group
    title = f"{head.label}: " if head.label else ""
    yield f"{title}{TITLES.get(head.what, head.what)}  {headline(head)}"
    how = "" if head.evaluation == "first order" else f"   ({head.evaluation})"
    if head.unit == "m":
        yield f"  nominal {_unrounded(head)}{how}"
    for other in others:
        yield f"  {TITLES.get(other.what, other.what):<42}{headline(other)}"
    if head.budget:
        yield "what it consists of"
        yield from _budget(head)
    if head.improve:
        yield from wrap(f"to improve it: {head.improve}", WIDTH, subsequent_indent="  ")
    yield from _notes(tuple(dict.fromkeys(note for m in group for note in m.notes)))


def headline(m: Measurement) -> str:
    """Value and interval in one unit, as "13.56 m   95 %: 13.06 to 14.07 m   (u 0.26 m)".

    Scales, angles and pixels keep their digits: people carry them on into other calculations.
    """
    value = number(m.value, m.unit, _doubt(m)) if m.unit in ("m", "m²") else _unrounded(m)
    if m.u == 0:
        return f"{value}   exact"
    level = f"{100 * m.level:.8g} %"
    if m.low is None and m.high is None:
        return f"{value}   {level}: open on both sides"
    name, factor = fitting_unit(m.value, m.unit)
    decimals = max(digits_for(_doubt(m) / factor), 0)
    space = "" if name == "°" else " "
    low, high = (None if x is None else grouped(x / factor, decimals) for x in (m.low, m.high))
    if high is None:
        return f"{value}   {level}: from {low}{space}{name}, far limit open"
    if low is None:
        return f"{value}   {level}: up to {high}{space}{name}, near limit open"
    u = "" if m.u is None else f"   (u {_short(m.u, m.unit, m.value)})"
    return f"{value}   {level}: {low} to {high}{space}{name}{u}"


def _doubt(m: Measurement) -> float:
    """u, or what stands for it in rounding where it has no meaning."""
    if m.u is not None:
        return m.u
    ends = [end for end in (m.low, m.high) if end is not None]
    return max((abs(m.value - end) for end in ends), default=abs(m.value)) / 2


def _short(u: float, unit: str, reference: float) -> str:
    name, factor = fitting_unit(reference, unit)
    return f"{grouped(u / factor, max(digits_for(u / factor), 0))}{'' if name == '°' else ' '}{name}"


def _unrounded(m: Measurement) -> str:
    if m.unit == "m":
        return f"{grouped(m.value * 1000, 2)} mm"
    name, factor = fitting_unit(m.value, m.unit)
    shown = grouped(m.value / factor, 4 if m.unit == "m/px" else 3)
    return f"{shown}{'' if name == '°' else ' '}{name}".strip()


def _budget(m: Measurement) -> Iterator[str]:
    widest = max(len(c.name) for c in m.budget)
    for c in m.budget:
        bar = "█" * max(round(_BAR * c.share), 0)
        share = f"{100 * c.share:.0f} %" if c.share >= 0.005 else "<1 %"
        yield f"  {c.name:<{widest}}  {bar:<{_BAR}} {share:>5}   {_short(abs(c.u), m.unit, m.value):>10}   {c.source}"


def _notes(notes: tuple[Note, ...]) -> Iterator[str]:
    for note in notes:
        cure = f"; {note.cure}" if note.cure else ""
        yield from wrap(f"note {note.code}: {note.text}{cure}", WIDTH, subsequent_indent="  ")
