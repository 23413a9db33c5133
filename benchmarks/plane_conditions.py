"""Planes by conditions against truth: drawn scenes, gross clicks, and real pictures.

`rows()` is for docs/accuracy.md. The real pictures lie outside the repository (../shared/data); without them their rows are left out.

    python benchmarks/plane_conditions.py [SCENES [GEOMETRY ...]]
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT / "tests" / "synthetic"))
sys.path.insert(0, str(ROOT / "tests"))

import test_plane_conditions as real  # noqa: E402
import test_plane_conditions_coverage as drawn  # noqa: E402

DATA = ROOT.parent / "shared" / "data"
SCENES, MANY = 1000, 5000
Row = tuple[str, ...]


def percent(x: float, digits: int = 1) -> str:
    """A share as a percentage."""
    return f"{100 * x:.{digits}f} %"


def simulated(scenes: int = SCENES, kinds: Sequence[str] = tuple(drawn.PLANES)) -> list[Row]:
    """Coverage, share of truths below and above the interval, typical u, and how many scenes were refused."""
    head = (
        "what holds",
        "geometry",
        "scenes",
        "intervals that hold the truth",
        "truth below / above",
        "typical u",
        "refused",
    )
    rows: list[Row] = [head]
    print(*head, sep=" | ", flush=True)
    for name in drawn.SETS:
        for kind in kinds:
            hit, below, _, u, _, refused = drawn.score(name, kind, scenes)
            held, under = float(hit.mean()), float(below.mean())
            share = len(refused) / (len(hit) + len(refused))
            rows.append((name, kind, f"{len(hit)}", percent(held), f"{percent(under)} / {percent(1 - held - under)}",
                         percent(float(np.median(u))), percent(share)))  # fmt: skip
            print(*rows[-1], sep=" | ", flush=True)
    return rows


def pictures() -> list[Row]:
    """Real pictures: a chessboard by a square of it, and a row of lockers by the first one's height."""
    rows: list[Row] = [("picture", "what", "measured, 95 %", "truth", "inside")]
    if not DATA.is_dir():
        return rows
    found = [
        (f"chessboard, {name}", *one)
        for name, camera in real.BOARD.items()
        for one in real.board_measured(DATA, camera)
    ]
    found += [("lockers", *one) for one in real.lockers_measured(DATA)]
    for name, m, truth in found:
        inside = "yes" if m.low <= truth <= m.high else "no"
        rows.append(
            (
                name,
                m.label or m.what,
                f"{m.value:.4g} {m.unit}, {m.low:.4g} to {m.high:.4g}",
                f"{truth:.4g} {m.unit}",
                inside,
            )
        )
    return rows


if __name__ == "__main__":
    for row in pictures():
        print(*row, sep=" | ")
    simulated(int(sys.argv[1]) if len(sys.argv) > 1 else SCENES, sys.argv[2:] or tuple(drawn.PLANES))
