"""A pair from rectified pictures to disparities with their deviations, beside OpenCV's semi-global matching and its WLS filter.

OpenCV's side is that of its own sample for filtering: StereoSGBM by three paths in both directions, then the filter. It is told the
range of disparities that ours finds by itself; a second row has it look for 160, the sample's default. In process, imports done.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

import cv2
import numpy as np
from comparison import Comparison, compare, table

from subtense import Photo
from subtense.disparity import dense
from subtense.pair_check import check_pair
from subtense.rectified_pair import rectified
from subtense.rig_files import formats

EXAMPLES = Path(__file__).parent.parent / "examples"
DEFAULT = 160
"""Of the sample."""
TARGET = 1.15


def comparisons(turns: int = 7) -> list[Comparison]:
    """Ours against both peers, at two sizes."""
    found = []
    for width in (800, 1600):
        left, right, doffs_px = pair(width)
        facts = check_pair(left, right, doffs_px)
        count = -(-(facts.high_px - facts.low_px + 1) // 16) * 16

        def ours(left=left, right=right, doffs_px=doffs_px) -> None:
            seen = check_pair(left, right, doffs_px)
            dense(left, right, seen.low_px, seen.high_px)

        what = f"stereo, {width} x {width * 3 // 4} px, range found by itself"
        for low, many, name in ((facts.low_px, count, "same range"), (0, DEFAULT * width // 800, "its sample's range")):
            peer = f"cv2 SGBM + WLS, {name} ({many})"
            found.append(
                compare(
                    what,
                    ours,
                    peer,
                    lambda a=left, b=right, n=low, m=many: opencv(a, b, n, m),
                    turns=turns,
                    target=TARGET,
                )
            )
    return found


def pair(width: int) -> tuple[np.ndarray, np.ndarray, float]:
    """The example pair, rectified, gray, at a width; and its disparity's offset."""
    rig = formats.read([str(EXAMPLES / "stereo_rig.json")]).rig
    photos = [Photo.load(EXAMPLES / f"stereo_{side}.jpg") for side in ("left", "right")]
    size = (width, width * 3 // 4)
    grays = [cv2.resize(cv2.cvtColor(p.pixels, cv2.COLOR_RGB2GRAY), size, interpolation=cv2.INTER_AREA) for p in photos]
    rows = rectified(dataclasses.replace(rig) if width == 1600 else rig.resized(*size))
    left, right = rows.pair(*grays)
    return left, right, rows.doffs_px


def opencv(left: np.ndarray, right: np.ndarray, low: int, count: int) -> np.ndarray:
    """OpenCV's sample for disparity filtering, with its parameters for three paths."""
    block = 3
    matcher = cv2.StereoSGBM_create(low, count, block, P1=24 * block**2, P2=96 * block**2, preFilterCap=63,
                                    mode=cv2.STEREO_SGBM_MODE_SGBM_3WAY)  # fmt: skip
    back = cv2.ximgproc.createRightMatcher(matcher)
    wls = cv2.ximgproc.createDisparityWLSFilter(matcher)
    wls.setLambda(8000)
    wls.setSigmaColor(1.5)
    there = matcher.compute(left, right)
    return wls.filter(there, left, disparity_map_right=back.compute(right, left))


if __name__ == "__main__":
    print(table(comparisons()))
