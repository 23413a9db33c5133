"""The pictures of a calibration for the documentation, from simulated views of a board: docs/pictures/calibration-*.png."""

import io
import sys
from pathlib import Path

import numpy as np
from PIL import Image

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT))

from tests.synthetic.boards import CHESSBOARD, scene  # noqa: E402

from subtense.reports.calibration_plots import plots  # noqa: E402
from subtense.workflow.calibrate import calibrate_views  # noqa: E402

WIDTH_PX, COLOURS = 800, 256


def small(png: bytes) -> Image.Image:
    """As wide as a page shows it, in a palette."""
    picture = Image.open(io.BytesIO(png)).convert("RGB")
    picture = picture.resize((WIDTH_PX, round(picture.height * WIDTH_PX / picture.width)), Image.Resampling.LANCZOS)
    return picture.quantize(COLOURS, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)


def main() -> None:
    """All pictures of a good calibration, and the board of a bowed one."""
    folder = ROOT / "docs" / "pictures"
    rng = np.random.default_rng(4)
    good = calibrate_views(scene(rng, views=24, spread=(0.1, 0.9), depth_m=(0.3, 0.9)), CHESSBOARD)
    bowed = calibrate_views(scene(rng, warp_m=(0.001, 0.0003)), CHESSBOARD)
    shown = [p for p in plots(good) if p.name != "board"] + [p for p in plots(bowed) if p.name == "board"]
    for plot in shown:
        path = folder / f"calibration-{plot.name}.png"
        small(plot.png).save(path, optimize=True)
        print(f"{path.relative_to(ROOT)}  {path.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
