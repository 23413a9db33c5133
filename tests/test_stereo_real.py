"""Real pairs with truth: Middlebury's motorcycle, a chessboard seen by a calibrated rig, KITTI's street, and rooms of a depth camera."""

import json
import subprocess
import sys
import zipfile

import cv2
import numpy as np
import pytest

from subtense import Photo, propagate
from subtense.camera import Camera
from subtense.detection import Search
from subtense.errors import GeometryError
from subtense.methods import stereo
from subtense.observation import Observation
from subtense.quantity import Quantity
from subtense.rig import Rig
from subtense.workflow.calibrate import calibrate_rig
from subtense.workflow.calibrate_input import board_of
from subtense.workflow.detect import detect
from subtense.workflow.measure import measure_detections
from subtense.workflow.resolve_camera import resolve_camera
from subtense.workflow.stereo import Asked, depth_of, match_pair, stereo_document

pytestmark = pytest.mark.opencv


def motorcycle(folder, tmp_path):
    """The pair, its exact rig as a file, and the true disparity."""
    said = json.loads((folder / "truth.json").read_text())
    camera = Camera(741, 500, said["f_px"], said["cx"], said["cy"])
    rig = Rig.of_rectified(camera, Quantity.exact(said["baseline_m"], "m"), Quantity.exact(said["doffs"], "px"))
    (tmp_path / "rig.json").write_text(json.dumps({"rig": rig.to_json()}))
    with np.load(folder / "motorcycle_disp.npz") as file:
        truth = np.asarray(file[file.files[0]], float)
    pair = [Photo.load(folder / f"motorcycle_{side}.png") for side in ("left", "right")]
    return (
        pair,
        Asked(rig=(str(tmp_path / "rig.json"),)),
        np.where(np.isfinite(truth) & (truth > 0), truth, np.nan),
        said,
    )


def test_middlebury_depths_and_intervals(shared_data, tmp_path):
    pair, asked, disparity, said = motorcycle(shared_data / "stereo" / "middlebury_motorcycle", tmp_path)
    made = depth_of(match_pair(*pair, asked))
    truth = said["f_px"] * said["baseline_m"] / (disparity + said["doffs"])
    known = ~np.isnan(truth)
    kept = known & made.answered
    off = abs(made.depth_m / truth - 1)[kept]
    assert kept.sum() / known.sum() >= 0.80
    assert np.median(off) <= 0.003 and np.quantile(off, 0.9) <= 0.012
    inside = abs(made.depth_m - truth)[kept] <= 1.96 * made.sigma_m[kept]
    assert 0.93 <= inside.mean() <= 0.97


def test_middlebury_pixels(shared_data, tmp_path):
    pair, asked, disparity, said = motorcycle(shared_data / "stereo" / "middlebury_motorcycle", tmp_path)
    matched, rng, found = match_pair(*pair, asked), np.random.default_rng(0), []
    for x, y in zip(rng.integers(5, 736, 400).tolist(), rng.integers(5, 495, 400).tolist(), strict=True):
        if np.isnan(disparity[y, x]):
            continue
        try:
            range_m, depth = stereo_document(matched, Asked(at=(f"{x},{y}",))).measurements
        except GeometryError:
            continue
        truth = said["f_px"] * said["baseline_m"] / (disparity[y, x] + said["doffs"])
        found.append((depth.low <= truth <= depth.high, abs(depth.value - truth) > 3 * depth.u and not range_m.notes))
    inside, silent = np.mean(found, axis=0)
    assert len(found) > 250 and inside > 0.92 and silent < 0.02


def test_rows_of_a_chessboard_are_as_long_as_they_are(shared_data):
    folder = shared_data / "calibration" / "opencv_stereo_chess"
    numbers = [1, 2, 3, 4, 5, 6, 7, 8, 9, 11, 12, 13, 14]
    files = [[folder / f"{side}{n:02d}.jpg" for n in numbers] for side in ("left", "right")]
    rig = calibrate_rig(*files, board_of("chessboard", "10x7", "25 mm", None, None, legacy=False)).rig
    assert (
        np.sqrt(np.diag(rig.cov)[-6:-3]).max() < 0.005
    )  # the turn between the cameras, rad; not what a lens model's own axis turns by
    inside, off = [], []
    for pair in zip(*files, strict=True):
        left, right = (_corners(path) for path in pair)
        for row in (0, 2, 5):
            ends = Observation(left[row, [0, -1]], 0.1)
            apart = [Quantity.normal(float(left[row, i, 0] - right[row, i, 0]), 0.15, "px", "corners") for i in (0, -1)]
            given = stereo.LengthInputs(rig=rig, ends=ends, first=apart[0], second=apart[1])
            length = propagate.measure(stereo.LENGTH, given)[0]
            inside.append(length.low <= 0.2 <= length.high)
            off.append(abs(length.value - 0.2))
    assert np.mean(inside) >= 0.95
    assert np.quantile(off, 0.95) <= 0.001


def _corners(path):
    """(6, 9, 2) px."""
    gray = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    found, corners = cv2.findChessboardCorners(gray, (9, 6))
    assert found
    return cv2.cornerSubPix(gray, corners, (5, 5), (-1, -1), (3, 50, 1e-4)).reshape(6, 9, 2).astype(float)


def test_streets_of_kitti(shared_data):
    folder = shared_data / "stereo" / "kitti_vo_seq1"
    for number in (0, 3):
        pair = [Photo.load(folder / f"image_{side}" / f"{number:06d}.png") for side in "lr"]
        matched = match_pair(*pair, Asked(rig=(str(folder / "calib.txt"),)))
        made = depth_of(matched)
        assert made.answered.mean() > 0.5 and "rig_without_uncertainty" in [note.code for note in matched.notes]
        # the road before the car, seen from about 1.65 m above it: nearly the middle of the lowest rows
        points = made.points_m()[330:360, 560:680]
        assert np.nanmedian(points[..., 1]) == pytest.approx(1.65, abs=0.15)
        with pytest.raises(GeometryError):
            match_pair(*pair[::-1], Asked(rig=(str(folder / "calib.txt"),)))


@pytest.fixture(scope="module")
def rooms(pytestconfig):
    """Twelve pairs of a depth camera in the wheel `stereodemo`, which is fetched and never installed."""
    folder = pytestconfig.cache.mkdir("stereodemo")
    if not list(folder.glob("*.whl")):
        command = [sys.executable, "-m", "pip", "download", "-q", "--no-deps", "--disable-pip-version-check"]
        command += ["-d", str(folder), "stereodemo==0.7"]
        try:
            subprocess.run(command, check=True, capture_output=True, timeout=120)
        except (OSError, subprocess.SubprocessError):
            pytest.skip("the wheel with the pairs can't be fetched here")
    with zipfile.ZipFile(next(folder.glob("*.whl"))) as wheel:
        names = [n for n in wheel.namelist() if "/oak-d/" in n and n.endswith((".png", ".json"))]
        for name in names:
            (folder / name.rsplit("/", 1)[1]).write_bytes(wheel.read(name))
    return folder


def asked_of(folder):
    said = json.loads((folder / "stereodemo_calibration.json").read_text())
    f = said["fx"]
    return Asked(camera=f"f={f} ± {0.005 * f:.2f} px", baseline=f"{1000 * said['baseline_meters']} ± 0.4 mm"), f


def test_twelve_rooms_run(rooms):
    asked, _ = asked_of(rooms)
    lefts = sorted(rooms.glob("*_left.png"))
    assert len(lefts) == 12
    for left in lefts:
        made = depth_of(match_pair(Photo.load(left), Photo.load(str(left).replace("_left", "_right")), asked))
        assert made.answered.mean() > 0.15
        assert 0.3 < np.nanquantile(made.depth_m, 0.02) < np.nanquantile(made.depth_m, 0.98) < 15


def test_a_face_is_as_far_as_its_eyes_say(rooms):
    pytest.importorskip("ai_edge_litert")
    asked, f = asked_of(rooms)
    left = Photo.load(rooms / "selfie_left.png")
    resolved = resolve_camera(left, f"f={f} ± {0.005 * f:.2f} px")
    found = detect(left, ["faces"], Search(camera=resolved.camera))
    by_eyes = [m for m in measure_detections(found, left, resolved, sizes={}).measurements if m.what == "range"]
    assert len(by_eyes) == 2
    matched = match_pair(left, Photo.load(rooms / "selfie_right.png"), asked)
    x, y = found.detections[0].seen.points_px.mean(axis=0)
    box = f"{x - 25:.0f},{y - 10:.0f},{x + 25:.0f},{y + 45:.0f}"
    for said in (Asked(at=(f"{x:.1f},{y:.1f}",)), Asked(boxes=(box,))):
        range_m = stereo_document(matched, said).measurements[0]
        assert all(m.low <= range_m.value <= m.high for m in by_eyes)
        assert range_m.u < 0.02
