"""A marker's distance from file to number, beside cv2.imread alone and with cv2.aruco, on one JPEG of 12 megapixels.

The picture is examples/desk.jpg enlarged, with the noise of a camera; its marker is 230 px wide. In process, imports done.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import cv2
import numpy as np
from comparison import Comparison, compare, table

from subtense import Photo, Quantity, measure_markers

PHOTO = Path(__file__).parent.parent / "examples" / "desk.jpg"
SIZE = (4032, 3024)
NOISE = 2.0


def picture(folder: Path) -> Path:
    """The JPEG of 12 megapixels."""
    large = cv2.resize(cv2.imread(str(PHOTO)), SIZE, interpolation=cv2.INTER_CUBIC).astype(np.float32)
    noisy = large + np.random.default_rng(0).normal(0, NOISE, large.shape)
    path = folder / "desk12.jpg"
    cv2.imwrite(str(path), np.clip(noisy, 0, 255).astype(np.uint8), [cv2.IMWRITE_JPEG_QUALITY, 92])
    return path


def comparisons(turns: int = 9) -> list[Comparison]:
    """Ours against both peers."""
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    detector = cv2.aruco.ArucoDetector(dictionary)
    side = Quantity.interval(0.05, 0.0002, "m")
    with tempfile.TemporaryDirectory() as folder:
        path = picture(Path(folder))

        def ours() -> None:
            found = measure_markers(Photo.load(path, gray=True), side, camera="f=3028px")
            assert len(found.measurements) == 3

        what = f"marker's distance from a JPEG of 12 MP ({path.stat().st_size / 1e6:.1f} MB)"
        return [
            compare(what, ours, "cv2.imread", lambda: cv2.imread(str(path)), turns=turns, target=1.0),
            compare(what, ours, "cv2.imread and cv2.aruco", lambda: detector.detectMarkers(cv2.imread(str(path))),
                    turns=turns),
        ]  # fmt: skip


if __name__ == "__main__":
    print(table(comparisons()))
