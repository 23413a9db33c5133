"""How often intervals of distances between two things, and of numbers from several measurements, hold the truth.

`rows()` is for docs/accuracy.md.

    python benchmarks/together.py [SCENES]
"""

from __future__ import annotations

import sys
from pathlib import Path

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT / "tests" / "synthetic"))

import test_together_coverage as coverage  # noqa: E402

SCENES = 5000
DRAWS = 5_000
Row = tuple[str, ...]


def rows(scenes: int = SCENES) -> list[Row]:
    """What, geometry, share of intervals that hold the truth, and of truths below and above them."""
    found: list[Row] = [("what", "geometry", "intervals that hold the truth", "truth below / above")]
    jobs = [("between", kind) for kind in coverage.APART] + [("fuse", kind) for kind in ("good", "typical", "bad")]
    for what, kind in jobs:
        hit, below = coverage.score(kind, scenes, what, draws=DRAWS)
        held, low = 100 * float(hit.mean()), 100 * float(below.mean())
        found.append((what, kind, f"{held:.1f} %", f"{low:.1f} / {100 - held - low:.1f} %"))
        print(*found[-1], sep=" | ", flush=True)
    return found


if __name__ == "__main__":
    rows(int(sys.argv[1]) if len(sys.argv) > 1 else SCENES)
