"""Finding markers and loading photos, against one bare call of the libraries that do the work; for information."""

from __future__ import annotations

from pathlib import Path

import cv2
from comparison import Comparison, compare, table
from PIL import Image

from subtense import Photo
from subtense.detection import Search
from subtense.detectors.markers import markers

PHOTO = Path(__file__).parent.parent / "examples" / "desk.jpg"


def comparisons(turns: int = 9) -> list[Comparison]:
    """Markers of all families and of one, and the loader."""
    photo = Photo.load(PHOTO)
    gray = cv2.cvtColor(photo.pixels, cv2.COLOR_RGB2GRAY)
    family = found_family(photo)
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    detector = cv2.aruco.ArucoDetector(dictionary)
    peer = "cv2 detectMarkers, 1 dictionary"
    size = f"{photo.width_px} x {photo.height_px} px"
    return [
        compare(f"markers(), all families, {size}", lambda: markers(photo), peer,
                lambda: detector.detectMarkers(gray), turns=turns),
        compare(f"markers(), {family} only, {size}", lambda: markers(photo, Search(family=family)), peer,
                lambda: detector.detectMarkers(gray), turns=turns),
        compare(f"Photo.load, {size}", lambda: Photo.load(PHOTO), "Pillow, open and load",
                lambda: Image.open(PHOTO).load(), turns=turns),
    ]  # fmt: skip


def found_family(photo: Photo) -> str:
    """The family of the first marker in the photo."""
    return markers(photo)[0].label.partition(" ")[0]


if __name__ == "__main__":
    print(table(comparisons()))
