"""Run all benchmarks: print the table, write results.json, and renew the table in docs/benchmarks.md."""

from __future__ import annotations

import argparse
import json
import os
import platform
import re
from importlib.metadata import version
from pathlib import Path

import calc
import calibration
import marker_speed
import monte_carlo
import pictures
import reconstruction
import rows
import startup
import stereo
from comparison import Comparison, table

HERE = Path(__file__).parent
PAGE = HERE.parent / "docs" / "benchmarks.md"
BEGIN, END = "<!-- benchmarks: begin -->", "<!-- benchmarks: end -->"
ALL = {
    "startup": startup,
    "calc": calc,
    "monte_carlo": monte_carlo,
    "rows": rows,
    "pictures": pictures,
    "calibration": calibration,
    "marker_speed": marker_speed,
    "reconstruction": reconstruction,
    "stereo": stereo,
}


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", help=f"some of {', '.join(ALL)}; written down only if all run")
    names = parser.parse_args().names or list(ALL)
    comparisons = [c for name in names for c in ALL[name].comparisons()]
    print(table(comparisons))
    if set(names) == set(ALL):
        write(comparisons)


def write(comparisons: list[Comparison]) -> None:
    """results.json and the page."""
    data = {"machine": machine(), "comparisons": [c.to_json() for c in comparisons]}
    (HERE / "results.json").write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")
    renewed = f"{BEGIN}\n{machine_line()}\n\n{table(comparisons)}\n{END}"
    page = PAGE.read_text(encoding="utf-8")
    PAGE.write_text(re.sub(f"{BEGIN}.*{END}", lambda _: renewed, page, flags=re.DOTALL), encoding="utf-8")


def machine() -> dict[str, str]:
    """What the figures depend on."""
    packages = ("subtense", "numpy", "click", "pillow", "opencv-contrib-python-headless", "uncertainties")
    found = {"cores": str(os.cpu_count()), "processor": platform.machine(), "python": platform.python_version()}
    return found | {name: version(name) for name in packages}


def machine_line() -> str:
    """The same in one sentence."""
    m = machine()
    return (f"{m['cores']} cores ({m['processor']}), Python {m['python']}, NumPy {m['numpy']}, "
            f"OpenCV {m['opencv-contrib-python-headless']}, Pillow {m['pillow']}.")  # fmt: skip


if __name__ == "__main__":
    main()
