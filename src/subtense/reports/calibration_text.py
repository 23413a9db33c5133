"""A calibration as text for a terminal: what it is good for, its numbers, what was checked, the next picture, the pictures."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from textwrap import wrap

from ..calibration import Calibration, Picture
from ..calibration_summary import (
    Number,
    bow_text,
    camera_numbers,
    camera_titles,
    fit_text,
    lengths,
    model_text,
    next_text,
    other_notes,
    percent,
    printable,
    reason,
    rig_numbers,
    size_text,
    verdict,
)
from .rounding import interval, number, rounded

WIDTH = 100
NAME_WIDTH = 36
_NO_BREAK = "\N{NO-BREAK SPACE}"


def text(calibration: Calibration) -> str:
    """The calibration as text of 100 columns, without a trailing newline."""
    blocks = (_head, _numbers, _basis, _checks, _pictures)
    return "\n\n".join("\n".join(block(calibration)) for block in blocks)


def _head(calibration: Calibration) -> Iterator[str]:
    found = verdict(calibration)
    yield f"{found.title}."
    for sentence in found.sentences:
        yield from _wrapped(f"  {sentence}", "    ")
    used, all_ = len(calibration.used), len(calibration.pictures)
    many = f"{used}" if used == all_ else f"{used} of {all_}"
    what = "two cameras" if calibration.rig else "one camera"
    yield from _wrapped(f"{what}, {size_text(calibration)}, from {many} pictures of a {calibration.board.text}")


# -- numbers -----------------------------------------------------------------------------------------


def _numbers(calibration: Calibration) -> Iterator[str]:
    if calibration.rig:
        yield "left to right"
        yield from _table(rig_numbers(calibration))
    for title, camera in zip(camera_titles(calibration), calibration.cameras, strict=True):
        if title:
            yield f"{title} camera"
        yield from _table(camera_numbers(camera))


def _table(numbers: Sequence[Number]) -> Iterator[str]:
    """The first one with its interval, the others with u alone."""
    width = max(len(n.name) for n in numbers)
    for i, n in enumerate(numbers):
        value, u = rounded(n.value, n.unit, n.u), ""
        if n.u:
            u = f"u {number(n.u, n.unit, n.u, reference=n.value)}"
            if not i:
                u = f"95 %: {interval(n.value, n.unit, n.u)}   ({u}, {percent(n.u / abs(n.value))})"
        yield f"  {n.name:<{width}}  {value:>14}   {u:<16} {n.remark}".rstrip()


# -- what it rests on --------------------------------------------------------------------------------


def _basis(calibration: Calibration) -> Iterator[str]:
    yield from _wrapped(f"points: {fit_text(calibration)}")
    yield from _wrapped(f"lens model: {model_text(calibration)}")
    if bow := bow_text(calibration):
        yield from _wrapped(f"board: it bulges by {bow}; that is taken into account")
    yield from _wrapped(lengths(calibration.board))
    yield from _wrapped(f"next picture: {next_text(calibration)}")


def _checks(calibration: Calibration) -> Iterator[str]:
    yield "checks"
    for check in sorted(calibration.checks, key=lambda c: c.passed):
        yield from _wrapped(f"  {'ok' if check.passed else 'NO'}  {check.name}: {check.found}", "      ")
        if not check.passed and check.cure:
            yield from _wrapped(f"      -> {check.cure}", "         ")
    for note in other_notes(calibration):
        cure = f"; {note.cure}" if note.cure else ""
        yield from _wrapped(f"  note {note.code}: {note.text}{cure}", "      ")


# -- pictures ----------------------------------------------------------------------------------------


def _pictures(calibration: Calibration) -> Iterator[str]:
    """Those left out first: they are what a person has to look at."""
    titles = camera_titles(calibration)
    out = [p for p in calibration.pictures if p.left_out]
    if out:
        yield f"left out ({len(out)})"
        for p in out:
            yield from _wrapped(f"  {_who(p, titles)}{printable(p.name)}: {reason(p)}", "      ")
    width = max(len(_name(p, titles)) for p in calibration.used)
    yield f"  {'picture':<{width}}  points        rms   tilt     range   detector"
    for p in calibration.used:
        assert p.rms_px is not None
        tilt = "" if p.tilt_rad is None else f"{math.degrees(p.tilt_rad):.0f}°"
        range_ = "" if p.range_m is None else f"{p.range_m:#.3g} m".replace(". m", " m")
        yield f"  {_name(p, titles):<{width}}  {p.points:>6}  {p.rms_px:>6.2f} px  {tilt:>5}  {range_:>8}   {p.detector}".rstrip()


def _who(picture: Picture, titles: Sequence[str]) -> str:
    return f"{titles[picture.camera]} " if titles[picture.camera] else ""


def _name(picture: Picture, titles: Sequence[str]) -> str:
    """Which camera and which file, the middle of a long name left out."""
    name = printable(picture.name)
    if len(name) > NAME_WIDTH:
        name = f"{name[: NAME_WIDTH // 2]}…{name[-NAME_WIDTH // 2 + 1 :]}"
    return _who(picture, titles) + name


def _wrapped(line: str, indent: str = "  ") -> list[str]:
    """Lines of WIDTH columns; a number and its percent sign stay together."""
    lines = wrap(line.replace(" %", f"{_NO_BREAK}%"), WIDTH, subsequent_indent=indent, break_on_hyphens=False)
    return [part.replace(_NO_BREAK, " ") for part in lines]
