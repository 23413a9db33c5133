"""Planes, heights and cameras from lines against truth: drawn scenes, gross clicks, and real pictures.

`rows()` is for docs/accuracy.md. The real pictures lie outside the repository (../shared/data); without them their rows are left out.

    python benchmarks/planes.py [SCENES]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT / "tests" / "synthetic"))
sys.path.insert(0, str(ROOT / "tests"))

import test_height_coverage as heights  # noqa: E402
import test_plane_coverage as planes  # noqa: E402
import test_plane_pictures as real  # noqa: E402

from subtense import propagate  # noqa: E402
from subtense.methods import plane  # noqa: E402

DATA = ROOT.parent / "shared" / "data"
SCENES = 5000
DRAWS = 6_000
"""Of a scene where the response bends: an interval end is known to a thirtieth of u."""
Row = tuple[str, ...]


def percent(x: float, digits: int = 1) -> str:
    """A share as a percentage."""
    return f"{100 * x:.{digits}f} %"


def simulated(scenes: int = SCENES) -> list[Row]:
    """Coverage of the headline and share of truths below and above the interval, for good, typical and bad geometry."""
    rows: list[Row] = [("what", "geometry", "scenes", "intervals that hold the truth", "truth below / above")]
    for module in (planes, heights):
        for name in module.SCENARIOS:
            for kind in module.PLANES:
                hit, below, _ = module.score(name, kind, scenes, draws=DRAWS)
                held, under = float(hit[:, 0].mean()), float(below[:, 0].mean())
                rows.append((name, kind, str(scenes), percent(held), f"{percent(under)} / {percent(1 - held - under)}"))
                print(*rows[-1], sep=" | ", flush=True)
    return rows


def cameras(scenes: int = 500) -> list[Row]:
    """Cameras from lines: focal length, pitch and roll."""
    rows: list[Row] = [("lines at right angles", "refused", "focal length", "pitch", "roll")]
    for name, sets in (("three directions", (0, 1, 2)), ("two level ones", (0, 1)), ("upright and one level", (0, 2))):
        z, refused = heights.line_cameras(scenes, sets)
        rows.append((name, percent(refused / scenes), *(percent(float(one)) for one in np.mean(abs(z) < 1.96, axis=0))))
        print(*rows[-1], sep=" | ", flush=True)
    return rows


def gross_clicks(scenes: int = 500) -> list[Row]:
    """One gross click among nine reference points: how often it is flagged, and how often it is flagged or does no harm."""
    rows: list[Row] = [("off by", "flagged", "flagged, or the interval holds the truth")]
    for gross_px in (3, 5, 10, 30, 100):
        rng, flagged, fine = np.random.default_rng(gross_px), 0, 0
        for i in range(scenes):
            inputs, p = planes.in_plane("good", rng, plane.METHOD, 2, gross_px=gross_px)
            [m] = propagate.measure(plane.METHOD, inputs, draws=20_000, seed=i)
            noted = "points_misfit" in {n.code for n in m.notes}
            flagged += noted
            fine += noted or m.low <= np.linalg.norm(p[1] - p[0]) <= m.high
        rows.append((f"{gross_px} px", percent(flagged / scenes), percent(fine / scenes)))
        print(*rows[-1], sep=" | ", flush=True)
    return rows


def pictures() -> list[Row]:
    """Real pictures, clicked once."""
    rows: list[Row] = [("picture", "what", "measured, 95 %", "truth", "inside")]
    for picture in real.PICTURES if DATA.is_dir() else ():
        for case in picture(DATA):
            m = case.measured
            known = f" ± {1000 * case.known_to:.3g}" if case.known_to else ""
            rows.append((case.name, case.what, f"{1000 * m.value:.1f} mm, {1000 * m.low:.1f} to {1000 * m.high:.1f}",
                         f"{1000 * case.truth:.4g}{known} mm", "yes" if case.inside else "no"))  # fmt: skip
    return rows


def rows(scenes: int = SCENES) -> tuple[list[Row], list[Row], list[Row], list[Row]]:
    """Simulated, cameras from lines, gross clicks and real pictures, each with its head."""
    return simulated(scenes), cameras(), gross_clicks(), pictures()


if __name__ == "__main__":
    for row in pictures():
        print(*row, sep=" | ")
    gross_clicks()
    cameras()
    simulated(int(sys.argv[1]) if len(sys.argv) > 1 else SCENES)
