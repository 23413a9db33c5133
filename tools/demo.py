"""Measure the example photos by the command line, print what it says, and write the annotated pictures to demo-out/."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parent.parent
OUT = ROOT / "demo-out"
RUNS = (
    ("desk", ["--marker-size", "50 ± 0.2 mm"]),
    ("belt", ["--line", "484,568,1017,570", "--size", "200 ± 1 mm", "--tilt", "0 ± 1 deg (limits)"]),
    (
        "street",
        [
            "--line",
            "672,897,668,499",
            "--size",
            "1.75 ± 0.03 m",
            "--line",
            "941,704,1174,702",
            "--size",
            "1.80 ± 0.03 m",
        ],
    ),
    ("facade", ["--line", "554,1291,557,1036", "--size", "2.10 ± 0.01 m", "--tilt", "0 ± 3 deg (limits)"]),
)
"""Photo, and what a person would click and type."""


def main() -> int:
    """Run each example; stop at the first that fails."""
    OUT.mkdir(exist_ok=True)
    command = Path(sys.executable).with_name("subtense")
    for name, words in RUNS:
        arguments = ["measure", f"examples/{name}.jpg", *words, "--overlay", f"demo-out/{name}.png"]
        print("$ subtense " + " ".join(f'"{w}"' if " " in w else w for w in arguments), flush=True)
        done = subprocess.run([command, *arguments], cwd=ROOT, check=False)
        if done.returncode:
            return done.returncode
        print(flush=True)
    print("annotated pictures: " + ", ".join(f"demo-out/{name}.png" for name, _ in RUNS))
    return 0


if __name__ == "__main__":
    sys.exit(main())
