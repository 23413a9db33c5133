"""Corners of rendered markers against the truth, beside cv2.aruco, pupil-apriltags and pyapriltags on the same pictures.

Tags 36h11 are drawn with exact corners by 6-fold sampling, blurred in linear light (or in encoded values), encoded by sRGB,
and given noise. Run it for the tables; `rows()` gives what docs/accuracy.md prints.
"""

from __future__ import annotations

import itertools
import sys
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from subtense.detection import Search, parse_curve
from subtense.detectors.markers import markers
from subtense.marker_codes import cells_of
from subtense.pattern import FLOOR_PX, floor_cov
from subtense.photo import Metadata, Photo

SIDES_PX = (12, 16, 20, 30, 60, 120, 200)
BLURS_PX = (0.5, 1.0, 2.0)
NOISES = (2, 5, 8)
TILTS_DEG = (0, 45, 70)
DARK, BRIGHT = 0.03, 0.8
FOCAL_PX = 800.0
SAMPLES = 6
FOUND_PX = 3.0
"""Mean distance of four corners from the truth within which a marker counts as found."""

Corners = Callable[[np.ndarray, int], np.ndarray | None]


class Case(NamedTuple):
    """How a marker is seen; sides by the frontal one."""

    side_px: float
    blur_px: float
    noise: float
    tilt_deg: float


def encoded(light: np.ndarray) -> np.ndarray:
    """sRGB."""
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * np.maximum(light, 1e-9) ** (1 / 2.4) - 0.055)


def seen_corners(case: Case, rng: np.random.Generator, size: int) -> np.ndarray:
    """(4, 2) corners of a marker in the middle of a picture of size x size px, tilted about a random axis."""
    tilt, axis, roll = np.radians(case.tilt_deg), rng.uniform(0, 2 * np.pi), rng.uniform(0, 2 * np.pi)
    turn = cv2.Rodrigues(np.array([np.cos(axis), np.sin(axis), 0]) * tilt)[0] @ cv2.Rodrigues(np.array([0, 0, roll]))[0]
    square = np.array([[-0.5, -0.5, 0], [0.5, -0.5, 0], [0.5, 0.5, 0], [-0.5, 0.5, 0]])
    points = square @ turn.T + [0, 0, FOCAL_PX / case.side_px]
    return points[:, :2] / points[:, 2:] * FOCAL_PX + (size - 1) / 2 + rng.uniform(-0.5, 0.5, 2)


def drawn(
    case: Case, number: int, rng: np.random.Generator, blurred_in: str = "light"
) -> tuple[np.ndarray, np.ndarray]:
    """A picture (uint8) of one marker and its true corners."""
    size = int(case.side_px * 2.2) + 40
    corners = seen_corners(case, rng, size)
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
    inverse = np.linalg.inv(cv2.getPerspectiveTransform(square, corners.astype(np.float32)).astype(float))
    cells = cells_of("36h11", number)
    y, x = (np.mgrid[0 : size * SAMPLES, 0 : size * SAMPLES] + 0.5) / SAMPLES - 0.5
    a, b, d = (inverse[i, 0] * x + inverse[i, 1] * y + inverse[i, 2] for i in range(3))
    a, b, n = a / d, b / d, len(cells)
    inside = (a >= 0) & (a < 1) & (b >= 0) & (b < 1)
    light = np.full(x.shape, BRIGHT, np.float32)
    light[inside] = DARK + (BRIGHT - DARK) * cells[(b[inside] * n).astype(int), (a[inside] * n).astype(int)]
    before = light if blurred_in == "light" else encoded(light).astype(np.float32)
    soft = cv2.GaussianBlur(before, (0, 0), case.blur_px * SAMPLES)
    soft = soft.reshape(size, SAMPLES, size, SAMPLES).mean(axis=(1, 3))
    value = 255 * (encoded(soft) if blurred_in == "light" else soft) + rng.normal(0, case.noise, soft.shape)
    return np.clip(np.round(value), 0, 255).astype(np.uint8), corners


def photo_of(gray: np.ndarray) -> Photo:
    """The picture as a photo without metadata."""
    return Photo(np.repeat(gray[..., None], 3, axis=2), Metadata(), Path("drawn.png"), "0")


def peers() -> dict[str, Corners]:
    """Other detectors: corners of the marker of a number in a picture, in any order; None where it is not found."""
    import pupil_apriltags
    import pyapriltags

    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    parameters.minMarkerPerimeterRate = 0.01
    opencv = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11), parameters)
    pupil = pupil_apriltags.Detector(families="tag36h11", quad_decimate=1.0)
    april = pyapriltags.Detector(families="tag36h11", quad_decimate=1.0)

    def by_opencv(gray: np.ndarray, number: int) -> np.ndarray | None:
        quads, numbers, _ = opencv.detectMarkers(gray)
        return next((np.reshape(q, (4, 2)) for q, n in zip(quads, np.reshape(numbers, -1) if numbers is not None else [],
                                                           strict=False) if n == number), None)  # fmt: skip

    def by_library(detector: object) -> Corners:
        def find(gray: np.ndarray, number: int) -> np.ndarray | None:
            found = [one for one in detector.detect(gray) if one.tag_id == number]  # type: ignore[attr-defined]
            return found[0].corners - 0.5 if found else None  # its pixels begin at their edge

        return find

    return {"cv2.aruco": by_opencv, "pupil-apriltags": by_library(pupil), "pyapriltags": by_library(april)}


def misplaced(found: np.ndarray | None, true: np.ndarray) -> np.ndarray | None:
    """Errors (4, 2) of corners in whichever order they go round; None where that is no marker here."""
    if found is None:
        return None
    orders = [np.roll(q, k, axis=0) for q in (found, found[::-1]) for k in range(4)]
    best = min((q - true for q in orders), key=lambda e: float(np.hypot(*e.T).mean()))
    return best if np.hypot(*best.T).mean() < FOUND_PX else None


def perimeter(corners: np.ndarray) -> float:
    """Of a polygon, px."""
    return float(np.hypot(*(np.roll(corners, -1, axis=0) - corners).T).sum())


class Tally:
    """What one detector made of the pictures of a case."""

    def __init__(self) -> None:
        self.errors: list[float] = []
        self.sides: list[float] = []
        self.normalised: list[float] = []
        self.shown = 0

    def add(self, error: np.ndarray | None, true: np.ndarray, cov: np.ndarray | None = None) -> None:
        """One picture more."""
        self.shown += 1
        if error is None:
            return
        self.errors.append(float(np.hypot(*error.T).mean()))
        self.sides.append(perimeter(true + error) / perimeter(true) - 1)
        if cov is not None:
            self.normalised.append(float(error.ravel() @ np.linalg.solve(cov, error.ravel())) / 8)

    @property
    def rate(self) -> float:
        """Share of markers found."""
        return len(self.errors) / self.shown


def compared(cases: list[Case], repeats: int, blurred_in: str = "light", curve: str | None = None) -> dict[str, Tally]:
    """Tallies of ours and of the peers over the pictures of some cases."""
    others = peers()
    tallies = {name: Tally() for name in ("subtense", *others)}
    search = Search() if curve is None else Search(curve=parse_curve(curve))
    for case, k in itertools.product(cases, range(repeats)):
        rng = np.random.default_rng([int(10 * v) for v in case] + [k])
        gray, true = drawn(case, number := int(rng.integers(587)), rng, blurred_in)
        ours = next((d.seen for d in markers(photo_of(gray), search) if d.label == f"36h11 id {number}"), None)
        error = misplaced(None if ours is None else ours.points_px, true)
        tallies["subtense"].add(error, true, None if ours is None else ours.cov)
        for name, find in others.items():
            tallies[name].add(misplaced(find(gray, number), true), true)
    return tallies


def grid(side_px: float) -> list[Case]:
    """All blurs, noises and tilts of one size."""
    return [Case(side_px, *rest) for rest in itertools.product(BLURS_PX, NOISES, TILTS_DEG)]


def rows(repeats: int = 4) -> list[tuple[str, ...]]:
    """By size of the marker: share found, median error of a corner, and how our errors compare with their covariance."""
    names = ("subtense", "cv2.aruco", "pupil-apriltags", "pyapriltags")
    table: list[tuple[str, ...]] = [
        ("side", *(f"{name}: found, error" for name in names), "ours: squared error over its due")
    ]
    for side in SIDES_PX:
        found = compared(grid(side), repeats, curve="srgb")
        ours = np.array(found["subtense"].normalised or [np.nan])
        table.append((f"{side} px", *(_cell(found[name]) for name in names), f"{np.mean(ours):.2f}"))
    return table


def covariance_rows(repeats: int = 6) -> list[tuple[str, ...]]:
    """Mean squared error over what the covariance says it should be: of the fit alone, and with the floor for real pictures."""
    table: list[tuple[str, ...]] = [("side", "corners", "by the fit alone", "as stated, with the floor")]
    search = Search(curve=parse_curve("srgb"))
    for side in SIDES_PX:
        alone, stated = [], []
        for case, k in itertools.product(grid(side), range(repeats)):
            rng = np.random.default_rng([int(10 * v) for v in case] + [k])
            gray, true = drawn(case, number := int(rng.integers(587)), rng, "light")
            ours = next((d.seen for d in markers(photo_of(gray), search) if d.label == f"36h11 id {number}"), None)
            error = misplaced(None if ours is None else ours.points_px, true)
            if ours is None or error is None:
                continue
            floor = floor_cov(ours.points_px / (perimeter(ours.points_px) / 8), FLOOR_PX)
            for kept, cov in ((alone, ours.cov - floor), (stated, ours.cov)):
                kept.append(float(error.ravel() @ np.linalg.solve(cov, error.ravel())) / 8)
        table.append((f"{side} px", f"{4 * len(alone)}", f"{np.mean(alone):.2f}", f"{np.mean(stated):.2f}"))
        print(*table[-1], sep=" | ", flush=True)
    return table


def _cell(tally: Tally) -> str:
    return f"{100 * tally.rate:.0f} %, {np.median(tally.errors):.3f} px" if tally.errors else "0 %"


def bias_rows(repeats: int = 40) -> list[tuple[str, ...]]:
    """Mean error of the side's length at blur 0.7 px, noise 3, to 45 degrees, by where the blur was made."""
    names = ("subtense", "cv2.aruco", "pupil-apriltags", "pyapriltags")
    table: list[tuple[str, ...]] = [("blur in", "curve told", "side", *names)]
    for blurred_in, curve in (("light", "srgb"), ("light", None), ("encoded", "linear"), ("encoded", None)):
        for side in (20, 30, 60, 150):
            found = compared([Case(side, 0.7, 3, tilt) for tilt in (0, 15, 30, 45)], repeats // 4, blurred_in, curve)
            means = [f"{100 * np.mean(found[n].sides):+.2f} %" if found[n].sides else "-" for n in names]
            table.append(("light" if blurred_in == "light" else "encoded values", curve or "no", f"{side} px", *means))
    return table


if __name__ == "__main__":
    repeats = int(sys.argv[1]) if len(sys.argv) > 1 else 4
    for line in (*bias_rows(10 * repeats), *rows(repeats)):
        print(" | ".join(line), flush=True)
