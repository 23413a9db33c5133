"""Stereo against truth: the rendered example pair, Middlebury's motorcycle, rendered frames of a moving camera, and a chessboard's rows."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
from PIL import Image

from subtense import Photo, propagate
from subtense.camera import Camera
from subtense.disparity import filled
from subtense.errors import GeometryError
from subtense.geometry import Pose
from subtense.methods import stereo
from subtense.observation import Observation
from subtense.quantity import Quantity
from subtense.rig import Rig
from subtense.workflow.calibrate import calibrate_rig
from subtense.workflow.calibrate_input import board_of
from subtense.workflow.stereo import Asked, depth_of, match_pair, stereo_document

ROOT = Path(__file__).parent.parent
DATA = ROOT.parent / "shared" / "data"
PIXELS = 300
Row = tuple[str, ...]
Scene = tuple[str, list[np.ndarray], Rig, np.ndarray]


def percent(x: float, digits: int = 1) -> str:
    """A share as a percentage."""
    return f"{100 * x:.{digits}f} %"


def example() -> Iterator[Scene]:
    """The path-traced pair, lens distortion and all, with its rig exact."""
    said = json.loads((ROOT / "examples" / "stereo_rig.json").read_text())
    rig = Rig.from_json({**said["rig"], "cov": np.zeros((24, 24)).tolist()})
    pixels = [Photo.load(ROOT / "examples" / f"stereo_{side}.jpg").pixels for side in ("left", "right")]
    with Image.open(ROOT / "examples" / "stereo_depth.png") as file:
        yield "examples, path-traced room, 1600 x 1200", pixels, rig, np.asarray(file) * 1e-4


def middlebury() -> Iterator[Scene]:
    """The motorcycle of 2014 at a quarter of its size."""
    folder = DATA / "stereo" / "middlebury_motorcycle"
    said = json.loads((folder / "truth.json").read_text())
    with np.load(folder / "motorcycle_disp.npz") as file:
        disparity = np.asarray(file[file.files[0]], float)
    disparity[~np.isfinite(disparity) | (disparity <= 0)] = np.nan
    camera = Camera(741, 500, said["f_px"], said["cx"], said["cy"])
    rig = Rig.of_rectified(camera, Quantity.exact(said["baseline_m"], "m"), Quantity.exact(said["doffs"], "px"))
    pixels = [Photo.load(folder / f"motorcycle_{side}.png").pixels for side in ("left", "right")]
    yield (
        "Middlebury 2014, motorcycle, 741 x 500",
        pixels,
        rig,
        said["f_px"] * said["baseline_m"] / (disparity + said["doffs"]),
    )


def frames() -> Iterator[Scene]:
    """Frames of a camera that moves upwards, turned by a quarter so that they are left and right."""
    folder = DATA / "metric_depth" / "rgbd_sequence"
    lines = (folder / "trajectory.log").read_text().splitlines()
    poses = [np.array([[float(v) for v in line.split()] for line in lines[i + 1 : i + 5]]) for i in range(0, 25, 5)]
    quarter = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    camera = Camera(480, 640, 525.0, 239.5, 319.5)
    for second in (1, 2, 4):
        move = np.linalg.inv(poses[second]) @ poses[0]
        pose = Pose(quarter @ move[:3, :3] @ quarter.T, quarter @ move[:3, 3])
        pixels = [np.ascontiguousarray(np.rot90(Photo.load(folder / f"{n:05d}.jpg").pixels, -1)) for n in (0, second)]
        depth = np.rot90(cv2.imread(str(folder / "00000.png"), cv2.IMREAD_UNCHANGED), -1) / 1000.0
        rig = Rig(camera, camera, pose, np.zeros((14, 14)))
        yield (
            f"ICL-NUIM, frames 0 and {second}, {1000 * rig.baseline_m:.0f} mm apart",
            pixels,
            rig,
            np.where(depth > 0, depth, np.nan),
        )


def depths() -> list[Row]:
    """For each scene: what is answered, how well, and how often the 95 % interval holds the truth."""
    rows: list[Row] = [("pair", "answered", "error, median", "error, 9 of 10 below", "95 % intervals that hold the truth", "beyond 3 u",
                        "of filled pixels", "single pixels: hold", "beyond 3 u without a note")]  # fmt: skip
    for scenes in (example(), middlebury(), frames()):
        for name, pixels, rig, truth in scenes:
            rows.append((name, *_scene(pixels, rig, truth)))
            print(rows[-1], flush=True)
    return rows


def _scene(pixels: list[np.ndarray], rig: Rig, truth: np.ndarray) -> Row:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for side, one in zip(("l", "r"), pixels, strict=True):
            Image.fromarray(one).save(folder / f"{side}.png")
        (folder / "rig.json").write_text(json.dumps({"rig": rig.to_json()}))
        matched = match_pair(*(Photo.load(folder / f"{s}.png") for s in "lr"), Asked(rig=(str(folder / "rig.json"),)))
    made = depth_of(matched)
    known = ~np.isnan(truth)
    seen = known & made.answered
    z = abs(made.depth_m - truth) / made.sigma_m
    off = abs(made.depth_m / truth - 1)[seen]
    wide = depth_of(type(matched)(**{**vars(matched), "found": filled(matched.found)}))
    there = known & wide.filled
    z_filled = (abs(wide.depth_m - truth) / wide.sigma_m)[there]
    inside, silent = _pixels(matched, truth)
    hold, far_out = (z[seen] < 1.96).mean(), (z[seen] > 3).mean()
    shares = [percent(one) for one in (hold, far_out, (z_filled < 1.96).mean(), inside, silent)]
    return (percent(seen.sum() / known.sum()), percent(np.median(off), 2), percent(np.quantile(off, 0.9), 2), *shares)


def _pixels(matched: object, truth: np.ndarray) -> tuple[float, float]:
    rng, found = np.random.default_rng(1), []
    height, width = truth.shape
    while len(found) < PIXELS:
        x, y = int(rng.integers(5, width - 5)), int(rng.integers(5, height - 5))
        if np.isnan(truth[y, x]):
            continue
        try:
            range_m, depth = stereo_document(matched, Asked(at=(f"{x},{y}",))).measurements
        except GeometryError:
            continue
        inside = depth.low <= truth[y, x] <= (depth.high or np.inf)
        found.append((inside, abs(depth.value - truth[y, x]) > 3 * (depth.u or np.inf) and not range_m.notes))
    return tuple(np.mean(found, axis=0))


def chess() -> list[Row]:
    """The 200 mm rows of OpenCV's chessboard, by a rig calibrated here."""
    folder = DATA / "calibration" / "opencv_stereo_chess"
    files = [sorted(folder.glob(f"{side}??.jpg")) for side in ("left", "right")]
    rig = calibrate_rig(*files, board_of("chessboard", "10x7", "25 mm", None, None, legacy=False)).rig
    inside, off, widths = [], [], []
    for pair in zip(*files, strict=True):
        left, right = map(_corners, pair)
        for row in range(6):
            ends = Observation(left[row, [0, -1]], 0.1)
            apart = [Quantity.normal(float(left[row, i, 0] - right[row, i, 0]), 0.15, "px", "corners") for i in (0, -1)]
            length = propagate.measure(
                stereo.LENGTH, stereo.LengthInputs(rig=rig, ends=ends, first=apart[0], second=apart[1])
            )[0]
            inside.append(length.low <= 0.2 <= length.high)
            off.append(length.value - 0.2)
            widths.append(length.u)
    off_mm = 1000 * np.array(off)
    return [
        ("rows of 200 mm", "intervals that hold it", "mean error", "19 of 20 errors below", "greatest error", "typical u"),
        (f"{len(off)} rows in {len(files[0])} pairs", percent(float(np.mean(inside))), f"{off_mm.mean():+.2f} mm",
         f"{np.quantile(abs(off_mm), 0.95):.2f} mm", f"{abs(off_mm).max():.2f} mm", f"{1000 * np.median(widths):.2f} mm"),
    ]  # fmt: skip


def _corners(path: Path) -> np.ndarray:
    gray = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    _, corners = cv2.findChessboardCorners(gray, (9, 6))
    return cv2.cornerSubPix(gray, corners, (5, 5), (-1, -1), (3, 50, 1e-4)).reshape(6, 9, 2).astype(float)


if __name__ == "__main__":
    for table in (depths(), chess()):
        print(*table, sep="\n")
