"""Rig files of other tools, files of depths and points, a network in place of the matcher, and the command line."""

import json
import struct
from pathlib import Path

import cv2
import numpy as np
import pytest
from click.testing import CliRunner
from onnx_files import constants
from PIL import Image

from subtense import Photo
from subtense.camera import Camera
from subtense.cli import main
from subtense.depth_map import DepthMap
from subtense.errors import FileFormatError, InputError, SubtenseError
from subtense.quantity import Quantity
from subtense.reports import depth_files
from subtense.rig_files import formats
from subtense.workflow.stereo import Asked, match_pair

pytestmark = pytest.mark.opencv
EXAMPLES = Path(__file__).parent.parent / "examples"

MIDDLEBURY = """cam0=[994.978 0 311.193; 0 994.978 254.877; 0 0 1]
cam1=[994.978 0 342.279; 0 994.978 254.877; 0 0 1]
doffs=31.086
baseline=193.001
width=741
height=500
ndisp=70
"""
KITTI = "\n".join(f"P{i}: 707.0912 0 601.8873 {-379.8145 * i} 0 707.0912 183.1104 0 0 0 1 0" for i in range(4))
KALIBR = """cam0:
  camera_model: pinhole
  distortion_coeffs: [-0.28, 0.07, 0.0002, 1.7e-05]
  distortion_model: radtan
  intrinsics: [458.6, 457.3, 367.2, 248.4]
  resolution: [752, 480]
cam1:
  T_cn_cnm1:
  - [1.0, 0.0, 0.0, -0.11]
  - [0.0, 1.0, 0.0, 0.0004]
  - [0.0, 0.0, 1.0, -0.0008]
  - [0.0, 0.0, 0.0, 1.0]
  camera_model: pinhole
  distortion_coeffs: [-0.28, 0.07, -0.0001, -3.5e-05]
  distortion_model: radtan
  intrinsics: [457.6, 456.1, 379.99, 255.2]
  resolution: [752, 480]
"""


def matrix(name, rows, data):
    cols = len(data) // rows
    return f"{name}: !!opencv-matrix\n   rows: {rows}\n   cols: {cols}\n   dt: d\n   data: {data!r}\n"


INTRINSICS = "%YAML:1.0\n---\n" + "".join(
    matrix(f"M{i}", 3, [535.0 + i, 0.0, 340.0, 0.0, 535.0, 235.0, 0.0, 0.0, 1.0]) + matrix(f"D{i}", 1, [-0.28, 0.08, 0.0, 0.0, 0.0])
    for i in (1, 2)
)  # fmt: skip
EXTRINSICS = "%YAML:1.0\n---\n" + matrix("R", 3, np.eye(3).ravel().tolist()) + matrix("T", 3, [-83.4, 0.5, 0.2])


def camera_info(p3):
    lists = {
        "camera_matrix": (3, [500.0, 0.0, 320.0, 0.0, 500.0, 240.0, 0.0, 0.0, 1.0]),
        "distortion_coefficients": (1, [-0.1, 0.01, 0.0, 0.0, 0.0]),
        "rectification_matrix": (3, np.eye(3).ravel().tolist()),
        "projection_matrix": (3, [480.0, 0.0, 322.0, p3, 0.0, 480.0, 241.0, 0.0, 0.0, 0.0, 1.0, 0.0]),
    }
    body = "".join(f"{k}:\n  rows: {r}\n  cols: {len(v) // r}\n  data: {v!r}\n" for k, (r, v) in lists.items())
    return f"image_width: 640\nimage_height: 480\ncamera_name: c\ndistortion_model: plumb_bob\n{body}"


def written(tmp_path, **files):
    names = []
    for name, text in files.items():
        path = tmp_path / name.replace("_", ".")
        path.write_text(text)
        names.append(str(path))
    return names


@pytest.mark.parametrize(
    ("files", "said", "baseline", "f", "doffs"),
    [
        ({"calib_txt": MIDDLEBURY}, {}, 0.193001, 994.978, 31.086),
        ({"calib_txt": KITTI}, {"size_px": (1241, 376)}, 379.8145 / 707.0912, 707.0912, 0),
        ({"chain_yaml": KALIBR}, {}, 0.110004, 458.6, None),
        ({"in_yml": INTRINSICS, "ex_yml": EXTRINSICS}, {"size_px": (640, 480), "unit": "mm"}, 0.0834017, 536.0, None),
        ({"both_yml": INTRINSICS + EXTRINSICS[14:]}, {"size_px": (640, 480), "unit": "mm"}, 0.0834017, 536.0, None),
        ({"l_yaml": camera_info(0.0), "r_yaml": camera_info(-60.0)}, {}, 0.125, 500.0, None),
        ({"l_yaml": camera_info(0.0), "r_yaml": camera_info(-60.0)}, {"rectified": True}, 0.125, 480.0, 0),
    ],
)
def test_rigs_of_other_tools(files, said, baseline, f, doffs, tmp_path):
    found = formats.read(written(tmp_path, **files), **said)
    assert found.rig.baseline_m == pytest.approx(baseline, rel=1e-5)
    assert float(found.rig.left.f_px) == pytest.approx(f)
    assert "rig_without_uncertainty" in [note.code for note in found.notes]
    assert found.rig.u_baseline_m == pytest.approx(0.005 * baseline, rel=1e-3)
    if doffs is not None:
        assert float(found.rig.right.cx_px) - float(found.rig.left.cx_px) == pytest.approx(doffs, abs=1e-6)


def test_a_typed_baseline_takes_the_place_of_the_file_s(tmp_path):
    typed = Quantity.normal(0.2, 0.0004, "m", "stated")
    names = written(tmp_path, in_yml=INTRINSICS, ex_yml=EXTRINSICS)
    own = formats.read([str(EXAMPLES / "stereo_rig.json")], baseline=typed)
    for found in (formats.read(names, size_px=(640, 480), baseline=typed), own):
        assert found.rig.baseline_m == pytest.approx(0.2) and found.rig.u_baseline_m == pytest.approx(0.0004, rel=0.01)


@pytest.mark.parametrize(
    ("files", "said", "words"),
    [
        ({"in_yml": INTRINSICS}, {"size_px": (640, 480)}, "R and T|no two cameras"),
        ({"both_yml": INTRINSICS + EXTRINSICS[14:]}, {"size_px": (640, 480)}, "--unit"),
        ({"l_yaml": camera_info(0.0)}, {}, "second --rig"),
        ({"l_yaml": camera_info(0.0), "r_yaml": camera_info(0.0)}, {}, "P\\[3\\]"),
        ({"r_yaml": camera_info(-60.0), "l_yaml": camera_info(0.0)}, {"rectified": True}, "exchange"),
        ({"calib_txt": MIDDLEBURY.replace("31.086", "3")}, {}, "doffs"),
        ({"calib_txt": MIDDLEBURY.replace("193.001", "nan")}, {}, "number"),
        ({"calib_txt": KITTI.replace("707.0912", "-7")}, {"size_px": (9, 9)}, "focal"),
        ({"chain_yaml": KALIBR.replace("1.0, 0.0, 0.0, -0.11", "2.0, 0.0, 0.0, -0.11")}, {}, "rotation"),
        ({"a_json": '{"rig": {"right_from_left": {}, "cov": []}}'}, {}, "rig"),
        ({"a_json": "{}"}, {}, "no two cameras"),
    ],
)
def test_files_without_a_rig_say_what_is_missing(files, said, words, tmp_path):
    with pytest.raises((FileFormatError, InputError), match=words) as error:
        formats.read(written(tmp_path, **files), **said)
    assert "\n" not in str(error.value)


def test_damaged_files_are_refused_and_nothing_else(tmp_path):
    rng = np.random.default_rng(0)
    own = (EXAMPLES / "stereo_rig.json").read_text()
    for text in (
        MIDDLEBURY,
        KITTI,
        KALIBR,
        INTRINSICS + EXTRINSICS[14:],
        camera_info(-60.0),
        own[:4000] + own[-700:],
        own,
    ):
        for _ in range(40):
            data = bytearray(text.encode())
            for at in rng.integers(0, len(data), 6):
                data[at] = int(rng.integers(32, 127))
            cut = bytes(data[: int(rng.integers(1, len(data) + 1))])
            path = tmp_path / "damaged"
            path.write_bytes(cut)
            try:
                found = formats.read([str(path)], size_px=(640, 480), unit="mm")
                assert np.isfinite(found.rig.baseline_m)
            except SubtenseError:
                pass


# -- files of depths ---------------------------------------------------------------------------------------------------


@pytest.fixture
def small():
    depth = np.array([[1.0, 2.5, np.nan], [4.0, 70.0, 0.5]])
    filled = np.array([[False, True, False], [False, False, False]])
    return DepthMap(
        depth, np.where(np.isnan(depth), np.nan, 0.01 * depth), filled, Camera(3, 2, 10.0, 1.0, 0.5), "made up"
    )


def test_maps_are_read_back(small, tmp_path):
    for ending in ("png", "pfm", "npy"):
        depth_files.write_map(small.depth_m, tmp_path / f"d.{ending}", "--depth-map")
    whole = cv2.imread(str(tmp_path / "d.png"), cv2.IMREAD_UNCHANGED)
    assert whole.dtype == np.uint16 and whole.tolist() == [[1000, 2500, 0], [4000, 0, 500]]
    for found in (np.load(tmp_path / "d.npy"), cv2.imread(str(tmp_path / "d.pfm"), cv2.IMREAD_UNCHANGED)):
        assert np.array_equal(np.isnan(found), np.isnan(small.depth_m))
        assert np.nan_to_num(found) == pytest.approx(np.nan_to_num(small.depth_m))


def test_clouds_hold_what_was_seen_and_not_what_was_filled(small, tmp_path):
    pixels = np.arange(18, dtype=np.uint8).reshape(2, 3, 3)
    for ending in ("ply", "las"):
        depth_files.write_cloud(small, pixels, tmp_path / f"c.{ending}", "--cloud")
    head, _, body = (tmp_path / "c.ply").read_bytes().partition(b"end_header\n")
    assert b"element vertex 4" in head and len(body) == 4 * 19
    first = struct.unpack("<3f3Bf", body[:19])
    assert first == pytest.approx((-0.1, -0.05, 1.0, 0, 1, 2, 0.01))
    data = (tmp_path / "c.las").read_bytes()
    assert data[:4] == b"LASF" and struct.unpack("<HI", data[94:100]) == (227, 227)
    kind, length, count = struct.unpack("<BHI", data[104:111])
    assert (kind, length, count) == (2, 26, 4) and len(data) == 227 + 4 * 26
    scale = struct.unpack("<3d", data[131:155])
    place = np.array(struct.unpack("<3i", data[227:239])) * scale
    assert place == pytest.approx([-0.1, 1.0, 0.05], abs=1e-4)  # z up


def test_pictures_and_error_by_depth(small, tmp_path):
    depth_files.write_picture(small, tmp_path / "p.png", "--depth-picture")
    with Image.open(tmp_path / "p.png") as seen:
        assert seen.size[1] == 2
    depth_files.write_error(small, tmp_path / "e.csv", "--error-plot")
    rows = [line.split(",") for line in (tmp_path / "e.csv").read_text().splitlines()]
    assert rows[0][0] == "depth_m" and [float(r[0]) for r in rows[1:]] == [0.5, 1.0, 4.0, 70.0]
    with pytest.raises(InputError, match="ends in"):
        depth_files.write_map(small.depth_m, tmp_path / "d.gif", "--depth-map")
    with pytest.raises(InputError, match="folder"):
        depth_files.write_map(small.depth_m, tmp_path / "no" / "d.png", "--depth-map")


# -- a network ---------------------------------------------------------------------------------------------------------


def noise_pair(tmp_path):
    rng = np.random.default_rng(3)
    wide = cv2.GaussianBlur(rng.uniform(0, 255, (96, 200)).astype(np.float32), (0, 0), 1.2)
    wide = np.clip((wide - wide.mean()) * 4 + 128, 0, 255).astype(np.uint8)
    for name, first in (("l", 20), ("r", 28)):
        Image.fromarray(np.repeat(wide[:, first : first + 128, None], 3, 2)).save(tmp_path / f"{name}.png")
    return Photo.load(tmp_path / "l.png"), Photo.load(tmp_path / "r.png")


def test_a_network_s_disparity_is_judged_like_any_other(tmp_path):
    pytest.importorskip("onnxruntime")
    pair = noise_pair(tmp_path)
    takes = {"left": ("float32", (1, 3, 96, 128)), "right": ("float32", (1, 3, 96, 128))}
    path = constants(tmp_path / "n.onnx", {"disparity": np.full((1, 1, 96, 128), 8.0)}, inputs=takes)
    asked = {"camera": "f=300 ± 1 px", "baseline": "100 ± 0.2 mm"}
    found = match_pair(*pair, Asked(**asked, model=path)).found
    assert np.nanmedian(found.px) == pytest.approx(8.0) and np.nanmedian(found.sigma_px) < 0.6
    wrong = constants(tmp_path / "w.onnx", {"disparity": np.full((1, 5), 8.0)}, inputs=takes)
    with pytest.raises(FileFormatError, match="no disparity"):
        match_pair(*pair, Asked(**asked, model=wrong))
    one = constants(tmp_path / "o.onnx", {"disparity": np.full((1, 5), 8.0)})
    with pytest.raises(FileFormatError, match="two pictures"):
        match_pair(*pair, Asked(**asked, model=one))


# -- the command line --------------------------------------------------------------------------------------------------


def test_the_command_measures_and_writes_all_files(tmp_path):
    noise_pair(tmp_path)
    names = {"depth-map": "d.png", "sigma-map": "s.pfm", "depth-picture": "c.jpg", "cloud": "p.ply"}
    names |= {"error-plot": "e.csv", "overlay": "o.png"}
    wanted = [word for option, name in names.items() for word in (f"--{option}", str(tmp_path / name))]
    said = [
        "--camera",
        "f=300 ± 1 px",
        "--baseline",
        "100 ± 0.2 mm",
        "--at",
        "60,50",
        "--between",
        "50,40;80,60",
        "--format",
        "json",
    ]
    run = CliRunner().invoke(
        main, ["stereo", str(tmp_path / "l.png"), str(tmp_path / "r.png"), *said, *wanted], catch_exceptions=False
    )
    assert run.exit_code == 0, run.output
    document = json.loads(run.stdout)
    depth = next(m for m in document["measurements"] if m["what"] == "depth")
    assert depth["low"] <= 300 * 0.1 / 8 <= depth["high"]
    assert all((tmp_path / name).stat().st_size > 100 for name in names.values())
    assert {"depth_map", "rectified_assumed"} <= {note["code"] for note in document["notes"]}


@pytest.mark.parametrize(
    ("more", "word"),
    [
        ([], "--rig"),
        (["--baseline", "1 m"], "--camera"),
        (["--rig", "nothing.json"], "no such file"),
        (["--rig", "nothing.json", "--camera", "f=3px"], "--camera"),
        (["--baseline", "1 m", "--camera", "f=300px", "--depth-map", "x.gif"], "ends in"),
        (["--baseline", "1 m", "--camera", "f=300px", "--at", "500,1"], "128 x 96"),
    ],
)
def test_what_is_missing_is_one_line(more, word, tmp_path):
    noise_pair(tmp_path)
    run = CliRunner().invoke(
        main, ["stereo", str(tmp_path / "l.png"), str(tmp_path / "r.png"), *more], catch_exceptions=False
    )
    assert run.exit_code in (2, 3) and word in run.output and run.output.count("\n") == 1
