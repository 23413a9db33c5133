"""ArUco and AprilTag markers: found in every family, corners located in linear light with their covariance.

OpenCV finds and reads the markers; its own corners make a marker too small by 0.2 to 2.7 %, so the black square's four
sides are fitted again (see `subpixel`). The size of a marker is that of its black square, without the white border.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..arrays import Array, Pixels
from ..detection import Detection, Search
from ..observation import Observation
from ..photo import Photo
from ..subpixel import encoded_gray, refine_quad

FAMILIES: dict[str, tuple[str, int]] = {
    "36h11": ("DICT_APRILTAG_36h11", 8), "25h9": ("DICT_APRILTAG_25h9", 7), "36h10": ("DICT_APRILTAG_36h10", 8),
    "16h5": ("DICT_APRILTAG_16h5", 6), "aruco_mip_36h12": ("DICT_ARUCO_MIP_36h12", 8),
    "aruco_original": ("DICT_ARUCO_ORIGINAL", 7), "7x7": ("DICT_7X7_1000", 9), "6x6": ("DICT_6X6_1000", 8),
    "5x5": ("DICT_5X5_1000", 7), "4x4": ("DICT_4X4_1000", 6),
}  # fmt: skip
"""Family: OpenCV's name, and modules across its black square. Earlier families win where a marker reads in two."""

WEAK = ("16h5", "4x4")
"""Families of 16 bits."""
WORST_MISFIT = 0.25
"""Rms residual of a side over its contrast beyond which there is no edge."""


def markers(photo: Photo, search: Search | None = None) -> tuple[Detection, ...]:
    """Markers in a photo, left to right.

    Args:
        photo: the picture.
        search: `family`, `curve` and `progress` of it are heeded.

    Returns:
        Squares: corners top-left, top-right, bottom-right, bottom-left of the marker as printed.
    """
    import cv2

    search = search or Search()

    gray = cv2.cvtColor(photo.pixels, cv2.COLOR_RGB2GRAY)
    encoded = encoded_gray(photo.pixels)
    found: list[Observation] = []
    passes = _passes([search.family] if search.family else list(FAMILIES))
    done, most = 0, sum(len(names) for _, names in passes)
    for correction, names in passes:
        for name in names:
            for number, corners in _detected(cv2, gray, name, correction):
                if any(_same_place(corners, other.points_px) for other in found):
                    continue
                seen = _located(encoded, name, number, corners)
                found += [seen] if seen else []
            done += 1
            search.progress(done / most)
        if found:
            break
    return tuple(Detection(one, "square") for one in sorted(found, key=lambda o: float(o.points_px[:, 0].mean())))


def _passes(families: list[str]) -> tuple[tuple[float, list[str]], ...]:
    """(share of bits corrected, families): exact readings first; the next only where the one before found nothing.

    Every 16th dark square reads as some marker of 16 bits, so such families are believed only in want of a stronger one.
    """
    strong = [name for name in families if name not in WEAK]
    return (0.0, strong), (0.0, families), (0.5, strong), (0.5, families)


def _located(encoded: Array, name: str, number: int, corners: Array) -> Observation | None:
    """A marker with its corners from its edges; None where it has none to see."""
    module = float(np.sqrt(_area(corners))) / FAMILIES[name][1]
    quad = refine_quad(encoded, corners, module)
    if quad is None or quad.misfit >= WORST_MISFIT:
        return None
    return Observation(quad.corners_px, cov=quad.cov, label=f"{name} id {number}", source="edges of the marker")


def _detected(cv2: Any, gray: Pixels, name: str, correction: float) -> list[tuple[int, Array]]:
    parameters = cv2.aruco.DetectorParameters()
    parameters.errorCorrectionRate = correction
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    parameters.minMarkerPerimeterRate = 0.01
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, FAMILIES[name][0]))
    quads, numbers, _ = cv2.aruco.ArucoDetector(dictionary, parameters).detectMarkers(gray)
    if numbers is None:
        return []
    return [(int(n), np.reshape(q, (4, 2)).astype(float)) for n, q in zip(np.reshape(numbers, -1), quads, strict=True)]


def _area(corners: Array) -> float:
    x, y = corners[:, 0], corners[:, 1]
    return float(abs(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))) / 2)


def _same_place(a: Array, b: Array) -> bool:
    return bool(np.hypot(*(a.mean(axis=0) - b.mean(axis=0))) < np.sqrt(_area(a)) / 2)
