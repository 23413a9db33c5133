"""Bias and normalised errors of outlines on drawn things: python benchmarks/outline.py [seeds]."""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent))

from tests.test_outline import around, length, scene

from subtense.detectors.outline import outline
from subtense.errors import SubtenseError
from subtense.outline import EXTENTS

KINDS = ("ellipse", "box", "blob")
PICTURES = {
    "plain": {}, "grainy": {"amplitude": 0.3}, "very grainy": {"amplitude": 0.45}, "blurred 3 px": {"blur": 3.0},
    "noise 12": {"noise": 12.0},
}  # fmt: skip


def row(kind: str, how: dict[str, float], seeds: int, by: str) -> str:
    """One line of the table: errors in pixels and in u over all extents and seeds."""
    errors, z, missed, noted, start = [], [], 0, 0, time.perf_counter()
    for seed in range(seeds):
        photo, middle, truth, rim = scene(kind, seed, **how)
        try:
            found = outline(photo, middle if by == "point" else around(rim))
        except SubtenseError:
            missed += 1
            continue
        noted += bool(found.notes)
        for name in EXTENTS:
            size, u = length(found.extents[name])
            errors.append(size - truth[name])
            z.append(errors[-1] / u)
    if not z:
        return f"none of {seeds} found"
    took = (time.perf_counter() - start) / seeds
    return (f"bias {np.mean(errors):+6.2f} px  rms {np.sqrt(np.mean(np.square(errors))):5.2f} px  "
            f"rms error/u {np.sqrt(np.mean(np.square(z))):4.2f}  beyond 3u {np.mean(np.abs(z) > 3):5.1%}  "
            f"missed {missed}  noted {noted}  {took:.2f} s")  # fmt: skip


def main() -> None:
    """All kinds of things and pictures, by a point and by a box."""
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 10
    for name, how in PICTURES.items():
        for kind in KINDS:
            for by in ("point", "box"):
                print(f"{name:13} {kind:8} {by:6} {row(kind, how, seeds, by)}")


if __name__ == "__main__":
    main()
