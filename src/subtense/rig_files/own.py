"""Our own JSON, as `subtense calibrate --stereo` writes it: "rig" with left, right, right_from_left and the covariance of all."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from ..errors import InputError
from ..geometry import Pose
from ..quantity import Note
from ..rig import Rig
from .reading import RigFound, RigReading


def _inner(tree: Any) -> Any:
    return tree.get("rig", tree) if isinstance(tree, dict) else None


def tells(trees: tuple[Any, ...]) -> bool:
    """Whether this is one."""
    inner = _inner(trees[0]) if len(trees) == 1 else None
    return isinstance(inner, dict) and "right_from_left" in inner


def read(reading: RigReading) -> RigFound:
    """The rig with its covariance, and the doubts that it was written with."""
    tree = reading.trees[0]
    try:
        rig = Rig.from_json(_inner(tree))
    except InputError as error:
        raise reading.refused(str(error)) from None
    except (KeyError, TypeError, ValueError, AttributeError, IndexError, OverflowError) as error:
        raise reading.refused(f"holds no rig that can be read ({type(error).__name__})") from None
    if not (np.isfinite(rig.right_from_left.rotation).all() and rig.leading == ()):
        raise reading.refused("holds no rig that can be read (numbers that are not finite, or many rigs in one)")
    if reading.baseline is not None:
        rig = _with_baseline(rig, reading)
    notes = tree.get("notes", ()) if isinstance(tree, dict) else ()
    return RigFound(rig, tuple(_notes(notes)))


def _with_baseline(rig: Rig, reading: RigReading) -> Rig:
    """The rig with a typed baseline in place of its own; what ties the old one to other numbers falls away."""
    assert reading.baseline is not None
    pose, typed = rig.right_from_left, reading.baseline
    if not float(typed.value) > 0:
        raise InputError("--baseline", f"{float(typed.value):g} m", "give a length above 0")
    along = pose.translation_m / rig.baseline_m
    across = np.eye(3) - np.outer(along, along)
    by = np.eye(len(rig.cov))
    by[-3:, -3:] = across * float(typed.value) / rig.baseline_m
    cov = by @ rig.cov @ by.T
    cov[-3:, -3:] += np.outer(along, along) * float(typed.u) ** 2
    moved = Pose(pose.rotation, along * float(typed.value), cov[-6:, -6:])
    return dataclasses.replace(
        rig, right_from_left=moved, cov=cov, part_sources={**rig.part_sources, "baseline": typed.source}, id=None
    )


def _notes(data: Any) -> list[Note]:
    """The notes on a calibration; none that can't be read is one."""
    found = []
    for item in data[:50] if isinstance(data, list) else ():
        if not isinstance(item, dict):
            continue
        said = [item.get("code"), item.get("text", item.get("message")), item.get("cure", "")]
        if all(isinstance(word, str) for word in said) and said[0]:
            code, text, cure = (" ".join(word.split())[:500] for word in said)
            found.append(Note(code, text, cure))
    return found
