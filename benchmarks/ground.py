"""How far off distances on the ground are, and how often their interval holds the truth: simulated scenes and real pictures.

`rows()` is for docs/accuracy.md. The real pictures lie outside the repository (../shared/data); without them their rows are left out.

    python benchmarks/ground.py [SCENES]        5,000 scenes a geometry take about two hours on one core, 1,000 half an hour
"""

from __future__ import annotations

import math
import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT / "tests" / "synthetic"))
sys.path.insert(0, str(ROOT / "tests"))

import test_ground_coverage as coverage  # noqa: E402
import test_ground_real as real  # noqa: E402

DATA = ROOT.parent / "shared" / "data"
SCENES = 5000
SURVEYED = 1000
"""Of scenes with surveyed points, each of which is adjusted on its own."""
BOUNDS = {5000: ((0.9396, 0.9598), (0.018, 0.033)), 1000: ((0.926, 0.971), (0.0, 0.046))}
"""Shares of intervals that hold the truth, and of misses on one side, by the number of scenes."""
Row = tuple[str, ...]


def percent(x: float, digits: int = 1) -> str:
    """A share as a percentage."""
    return f"{100 * x:.{digits}f} %"


def simulated(scenes: int = SCENES) -> list[Row]:
    """Coverage of the headline, misses on each side, and its u, for every geometry."""
    rows = [("method and geometry", "scenes", "intervals that hold the truth", "truth below / above", "typical u")]
    for name in coverage.MADE:
        count = min(scenes, SURVEYED) if name.startswith("surveyed") else scenes
        hit, below, width = coverage.score(name, count)
        share, low = float(hit[:, 0].mean()), float(below[:, 0].mean())
        high = 1 - share - low
        fine = ""
        if count in BOUNDS:
            (least, most), (few, many) = BOUNDS[count]
            fine = "" if least <= share <= most and few <= low <= many and few <= high <= many else " (outside)"
        u = percent(float(np.median(width[:, 0])) / 3.92)
        rows.append((name, str(count), percent(share, 2) + fine, f"{percent(low)} / {percent(high)}", u))
        print(*rows[-1], sep=" | ", flush=True)
    return rows


def pictures() -> list[Row]:
    """Real pictures: how many points, median error, intervals that hold the truth."""
    rows = [("picture", "points", "median error", "intervals that hold the truth")]
    if not DATA.is_dir():
        return rows
    for known in (True, False):
        value, _, low, high, true = np.concatenate([real.juncal(DATA, half, known) for half in (0, 1)]).T
        text = "heights surveyed" if known else f"heights known to {real.JUNCAL_U_M} m"
        rows.append(_row(f"River Juncal, {true.min():.0f} to {true.max():.0f} m, {text}", value, low, high, true))
    value, low, high, true = real.kitti(DATA).T
    rows.append(
        _row(f"KITTI, lidar on the road, {true.min():.0f} to {true.max():.0f} m, pitch to 0.5°", value, low, high, true)
    )
    m = real.drone(DATA).measurements[0]
    held = "1 of 1" if abs(m.value - real.GPS_M) < 1.96 * math.hypot(m.u, 1.0, 0.5) else "0 of 1"
    rows.append(("drone straight down, way between two pictures by GPS", "1", percent(m.value / real.GPS_M - 1), held))
    return rows


def _row(name: str, value: np.ndarray, low: np.ndarray, high: np.ndarray, true: np.ndarray) -> Row:
    held = int(np.sum((low <= true) & (true <= high)))
    return name, str(len(true)), percent(float(np.median(abs(value / true - 1)))), f"{held} of {len(true)}"


def rows(scenes: int = SCENES) -> tuple[list[Row], list[Row]]:
    """Simulated and real, each with its head."""
    return simulated(scenes), pictures()


if __name__ == "__main__":
    for row in pictures():
        print(*row, sep=" | ")
    simulated(int(sys.argv[1]) if len(sys.argv) > 1 else SCENES)
