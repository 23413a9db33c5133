"""Calibrating from pictures: what comes out, what is refused, what is left out."""

import json
import re
import sys
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image

sys.path.insert(0, str(Path(__file__).parent / "synthetic"))

from board_pictures import BOARD, CAMERA, write
from boards import CHESSBOARD, NOISE_PX, scene, true_intrinsics

from subtense.adjustment import LENS_MODELS, Problem, Sight, adjust
from subtense.adjustment_start import start_state
from subtense.board import Board, BoardView
from subtense.camera import Camera
from subtense.camera_sources import calibration_file
from subtense.cli import main
from subtense.errors import GeometryError, InputError, NothingFoundError
from subtense.geometry import Pose, rotation_from_vector
from subtense.quantity import Quantity
from subtense.rig import Rig
from subtense.workflow.audit import audit_views
from subtense.workflow.calibrate import Seen, calibrate, calibrate_rig, calibrate_rig_views, calibrate_views

DATA = Path(__file__).parent.parent.parent / "shared" / "data" / "calibration"
SQUARES = ("--board", "chessboard", "--squares", "10x7", "--square", "25 mm")


@pytest.fixture(scope="session")
def pictures(tmp_path_factory):
    """Ten pictures of a board by a known camera."""
    return write(tmp_path_factory.mktemp("board"))


@pytest.fixture(scope="session")
def views():
    """Twenty views as points, without pixels."""
    return scene(np.random.default_rng(11))


def run(*args):
    return CliRunner().invoke(main, ["calibrate", *map(str, args)])


# -- what comes out -----------------------------------------------------------------------------------------------------


@pytest.mark.opencv
def test_pictures_give_the_camera_that_took_them(pictures):
    done = []
    found = calibrate(pictures, BOARD, progress=lambda n, of: done.append((n, of)))
    assert done == [(i, 10) for i in range(1, 11)]
    off = np.array([found.camera.f_px, found.camera.cx_px, found.camera.cy_px]) - [
        CAMERA.f_px,
        CAMERA.cx_px,
        CAMERA.cy_px,
    ]
    u = np.sqrt(np.diag(found.camera.cov))[[0, 2, 3]]
    assert np.all(abs(off) < 3 * u)
    assert found.camera.u_f_px < 0.003 * CAMERA.f_px
    assert len(found.used) == 10
    assert found.trusted
    assert [n.code for n in found.notes] == ["print_scale_assumed"]


@pytest.mark.opencv
def test_two_cameras_give_the_baseline(pictures, tmp_path):
    move = Pose(rotation_from_vector(np.array([0, 0.1, 0])), np.array([-0.06, 0.001, 0.003]))
    right = Camera(640, 480, 640.0, 318.0, 241.0, 1.0, "brown_conrady", np.array([-0.1, 0.02, 0, 0, 0]))
    found = calibrate_rig(pictures, write(tmp_path, right, move=move), BOARD, printed=Quantity.exact(0.25, "m"))
    rig = found.rig
    assert abs(rig.baseline_m - np.linalg.norm(move.translation_m)) < 3 * rig.u_baseline_m
    assert rig.u_baseline_m < 0.0002
    assert abs(rig.right.f_px - 640) < 3 * rig.right.u_f_px
    again = Rig.from_json(json.loads(json.dumps(found.to_json()))["rig"])
    assert again.baseline_m == rig.baseline_m
    assert np.array_equal(again.cov, rig.cov)


def test_same_points_give_the_solution_of_opencv(views):
    cv2 = pytest.importorskip("cv2")
    board = CHESSBOARD.points_m.astype(np.float32)
    seen = [v.points_px.astype(np.float32) for v in views]
    rms, matrix, *_ = cv2.calibrateCamera([board] * len(views), seen, (1600, 1200), None, None)
    own = adjusted(views, "opencv5")
    assert own.rms_px == pytest.approx(rms, rel=0.01)
    assert own.state.intrinsics[0][0] == pytest.approx(matrix[0, 0], abs=0.3)
    assert own.state.intrinsics[0][0] * own.state.intrinsics[0][1] == pytest.approx(matrix[1, 1], abs=0.3)


def adjusted(views, model):
    sights = tuple(Sight(0, i, v) for i, v in enumerate(views))
    problem = Problem(CHESSBOARD, sights, (LENS_MODELS[model],), ((1600, 1200),))
    return adjust(problem, start_state(problem))


def test_covariance_is_full_and_scaled_by_the_noise_seen(views):
    once = adjusted(views, "opencv5")
    told_half = [BoardView(v.name, 1600, 1200, v.ids, v.points_px, NOISE_PX / 2) for v in views]
    half = adjusted(told_half, "opencv5")
    assert np.allclose(half.cov[:9, :9], once.cov[:9, :9], rtol=1e-3)
    assert half.factor == pytest.approx(2 * once.factor, rel=1e-6)
    u = np.sqrt(np.diag(once.cov)[:9])
    assert abs(once.cov[4, 5] / u[4] / u[5]) > 0.8  # k1 and k2 are told apart badly: single deviations would hide it


def test_board_points_seen_in_part_are_enough(views):
    rng = np.random.default_rng(0)
    parts = []
    for v in views:
        kept = np.sort(rng.permutation(54)[:20])
        parts.append(BoardView(v.name, 1600, 1200, v.ids[kept], v.points_px[kept], NOISE_PX))
    found = calibrate_views(parts, CHESSBOARD, model="opencv4")
    assert abs(found.camera.f_px - true_intrinsics()[0]) < 3 * found.camera.u_f_px


def test_print_scale_moves_lengths_and_no_focal_length(pictures):
    plain, printed = (
        calibrate(pictures, BOARD, model="opencv4", printed=p) for p in (None, Quantity.normal(0.2425, 0.0001, "m"))
    )
    assert printed.camera.f_px == pytest.approx(plain.camera.f_px, rel=1e-6)
    assert printed.used[0].range_m == pytest.approx(0.97 * plain.used[0].range_m, rel=1e-6)
    assert "print_scale_assumed" not in [n.code for n in printed.notes]
    assert printed.board.relative_u == pytest.approx(0.0001 / 0.2425)
    with pytest.raises(
        InputError, match=r"--printed is '24 mm'; give the measured width of the whole pattern, nominally 250 mm"
    ):
        calibrate(pictures, BOARD, printed=Quantity.exact(0.024, "m"))


def test_square_pixels_may_be_held(views):
    found = calibrate_views(views, CHESSBOARD, model="opencv5", square_pixels=True)
    assert found.camera.aspect == 1
    assert found.camera.cov[1, 1] == 0


def test_next_picture_fills_what_is_missing(views):
    corner = scene(np.random.default_rng(2), spread=(0.25, 0.45), depth_m=(0.5, 0.8))
    found = calibrate_views(corner, CHESSBOARD, model="opencv4")
    assert "right" in found.next_picture or "bottom" in found.next_picture
    assert "low_coverage" in [n.code for n in found.notes]


def test_one_depth_is_noted():
    found = calibrate_views(
        scene(np.random.default_rng(2), depth_m=(0.55, 0.57), spread=(0.4, 0.6)), CHESSBOARD, model="opencv4"
    )
    assert "single_range" in [n.code for n in found.notes]


# -- what is left out -----------------------------------------------------------------------------------------------------


def test_a_picture_that_nothing_explains_is_named_and_left_out(views):
    rng = np.random.default_rng(4)
    bad = BoardView("moved.jpg", 1600, 1200, views[3].ids, views[3].points_px + rng.normal(0, 3, (54, 2)), NOISE_PX)
    found = calibrate_views([*views[:3], bad, *views[4:]], CHESSBOARD, model="opencv5")
    out = [p for p in found.pictures if p.left_out]
    assert [p.name for p in out] == ["moved.jpg"]
    assert "off by" in out[0].left_out and "those of the other pictures" in out[0].left_out
    assert "views_left_out" in [n.code for n in found.notes]
    assert abs(found.camera.f_px - 1200) < 3 * found.camera.u_f_px


def test_single_points_that_are_far_off_are_left_out(views):
    points = views[0].points_px.copy()
    points[17] += (9, -7)
    found = calibrate_views(
        [BoardView("a", 1600, 1200, views[0].ids, points, NOISE_PX), *views[1:]], CHESSBOARD, model="opencv5"
    )
    assert found.pictures[0].points == 53
    assert found.trusted


@pytest.mark.opencv
def test_a_file_that_is_no_picture_is_named_and_the_rest_goes_on(pictures, tmp_path):
    (tmp_path / "notes.png").write_text("no picture")
    Image.new("RGB", (640, 480)).save(tmp_path / "black.png")
    result = run(*pictures, tmp_path / "notes.png", tmp_path / "black.png", *SQUARES, "--format", "json")
    assert result.exit_code == 0
    out = {p["name"]: p["left_out"] for p in json.loads(result.output)["calibration"]["pictures"] if p["left_out"]}
    assert "is not a picture" in out["notes.png"]
    assert "no chessboard" in out["black.png"]


# -- what is refused --------------------------------------------------------------------------------------------------------


@pytest.mark.opencv
def test_a_board_that_is_in_no_picture(tmp_path):
    for i in range(4):
        Image.new("RGB", (320, 240), "gray").save(tmp_path / f"{i}.png")
    result = run(tmp_path, *SQUARES)
    assert result.exit_code == 3
    assert result.output.count("\n") == 1
    assert "is in none of 4 pictures" in result.output


@pytest.mark.opencv
def test_wrong_square_counts_are_told(pictures):
    result = run(*pictures[:3], "--board", "chessboard", "--squares", "9x6", "--square", "25 mm")
    assert result.exit_code == 3
    assert "10x7" in result.output and result.output.count("\n") == 1


@pytest.mark.opencv
def test_one_picture_is_not_enough(pictures):
    result = run(pictures[0], *SQUARES)
    assert result.exit_code == 3
    assert "the board is in 1 of 1 pictures, 3 are needed and 20 are good" in result.output


@pytest.mark.opencv
def test_pictures_of_different_sizes(pictures, tmp_path):
    with Image.open(pictures[0]) as picture:
        picture.resize((960, 720)).save(tmp_path / "large.png")
    with pytest.raises(
        InputError, match=r"of different sizes: 640 x 480 px \(shot01.png\), 960 x 720 px \(large.png\)"
    ):
        calibrate([*pictures[1:], tmp_path / "large.png"], BOARD)


@pytest.mark.parametrize(
    ("args", "message"),
    [
        ((), "IMAGES is missing; name pictures of the board, or a folder of them"),
        (("x.png", "--board", "dots"), "--board is 'dots'; known are chessboard, charuco, circles, aprilgrid"),
        (("x.png", "--squares", "ten"), "--squares is 'ten'; write across x down, as 10x7"),
        (("x.png", "--square", "-25 mm"), "--square is '-25 mm'; give a length above 0"),
        (("x.png", "--model", "opencv9"), "--model is 'opencv9'; known are pinhole, k1, k1k2"),
        (("x.png", "--report", "x.docx"), "--report is 'x.docx'; give a name that ends in .html, .txt or .json"),
        (("x.png", "x.png"), "IMAGES is 'x.png'; it is named twice"),
        (("x.png", "y.png", "z.png", "--stereo"), "--stereo is '1 left and 2 right pictures'; give as many of each"),
        (("l1.png", "l2.png", "r1.png", "r3.png", "--stereo"), "--stereo is 'l2.png with r3.png'; their numbers differ"),
        (("x.png", "--board", "charuco"), "--marker is missing; a charuco board needs the side of its markers"),
    ],
)  # fmt: skip
def test_bad_options_are_one_line(args, message):
    given = ["--board", "chessboard", "--squares", "10x7", "--square", "25 mm"]
    result = run(*given, *args)
    assert result.exit_code == 2
    assert message in result.output
    assert result.output.count("\n") == 1


def test_views_that_leave_the_camera_open_are_refused(views):
    same = [BoardView(f"{i}", 1600, 1200, views[0].ids, views[0].points_px, NOISE_PX) for i in range(4)]
    with pytest.raises(GeometryError):
        calibrate_views(same, CHESSBOARD, model="opencv5")


def test_pairs_that_never_show_the_board_to_both(views):
    left = Seen((*views[:5], *[None] * 5), ("",) * 10, tuple("abcdefghij"))
    right = Seen((*[None] * 5, *views[5:10]), ("",) * 10, tuple("abcdefghij"))
    with pytest.raises(NothingFoundError, match="in both pictures of 0 pairs, 3 are needed"):
        calibrate_rig_views(left, right, CHESSBOARD)


# -- files ------------------------------------------------------------------------------------------------------------------


@pytest.mark.opencv
def test_the_camera_is_written_and_measures_with_what_is_known_of_it(pictures, tmp_path):
    result = run(
        *pictures,
        *SQUARES,
        "-o",
        tmp_path / "camera.json",
        "--report",
        tmp_path / "report.html",
        "--plots",
        tmp_path / "plots",
    )
    assert result.exit_code == 0, result.output
    found = calibration_file.read(tmp_path / "camera.json")
    assert found.frame == "stored"
    assert [n.code for n in found.notes] == ["print_scale_assumed"]
    assert found.camera.cov is not None
    assert (tmp_path / "report.html").stat().st_size > 10_000
    assert list((tmp_path / "plots").glob("*.png"))
    shown = CliRunner().invoke(
        main, ["camera", str(pictures[0]), "--camera", str(tmp_path / "camera.json"), "--format", "json"]
    )
    assert json.loads(shown.output)["camera"]["f_px"] == found.camera.f_px
    result = run(*pictures, *SQUARES, "-o", tmp_path / "camera.yaml")
    assert result.exit_code == 0
    assert "does not keep the uncertainty" in result.output
    assert not list(tmp_path.glob(".*"))


@pytest.mark.opencv
def test_an_output_that_cant_be_written_leaves_nothing(pictures, tmp_path):
    result = run(*pictures, *SQUARES, "-o", tmp_path / "none" / "camera.json")
    assert result.exit_code == 2
    assert "its folder does not exist" in result.output
    assert not list(tmp_path.iterdir())


@pytest.mark.opencv
def test_photos_held_either_way_are_of_one_camera(pictures, tmp_path):
    for i, path in enumerate(pictures):
        with Image.open(path) as picture:
            exif = Image.Exif()
            if i % 2:  # stored as the sensor has it, and marked to be turned
                exif[0x0112] = 6
            picture.save(tmp_path / f"{i}.jpg", quality=97, exif=exif)
    found = calibrate([tmp_path / f"{i}.jpg" for i in range(10)], BOARD)
    assert (found.camera.width_px, found.camera.height_px) == (640, 480)
    assert abs(found.camera.f_px - CAMERA.f_px) < 3 * found.camera.u_f_px


# -- auditing ---------------------------------------------------------------------------------------------------------------


@pytest.mark.opencv
def test_audit_from_the_command_line(pictures, tmp_path):
    assert run(*pictures[:5], *SQUARES, "-o", tmp_path / "good.json").exit_code == 0
    good = run(*pictures[5:], *SQUARES, "--check", tmp_path / "good.json")
    assert good.exit_code == 0
    assert good.output.startswith("These pictures bear the camera out.")
    told = json.loads((tmp_path / "good.json").read_text())
    told["camera"]["f_px"] *= 1.02
    (tmp_path / "bad.json").write_text(json.dumps(told))
    bad = run(*pictures, *SQUARES, "--check", tmp_path / "bad.json")
    assert bad.exit_code == 3
    assert re.search(
        r"NO range: ranges by the stated camera come out [12]\.\d+ % too long", " ".join(bad.output.split())
    )


def test_audit_knows_another_zoom_and_another_size(views):
    own = calibrate_views(views, CHESSBOARD, model="opencv5").camera
    seen = Seen(tuple(scene(np.random.default_rng(5))), ("",) * 20, tuple(map(str, range(20))))
    assert audit_views(own, seen, CHESSBOARD).trusted
    found = audit_views(own.resized(800, 600), seen, CHESSBOARD)
    assert found.trusted and [n.code for n in found.notes] == ["calibration_size_mismatch"]
    shifted = Camera(1600, 1200, own.f_px, own.cx_px + 40, own.cy_px, own.aspect, own.lens, own.coefficients, own.cov)
    assert not audit_views(shifted, seen, CHESSBOARD).trusted
    with pytest.raises(InputError, match="--check is 'for 1600 x 1000 px'; the pictures have 1600 x 1200 px"):
        audit_views(own.cropped(0, 0, 1600, 1000), seen, CHESSBOARD)


# -- real pictures ----------------------------------------------------------------------------------------------------------

real = pytest.mark.skipif(
    not DATA.is_dir(), reason="the real calibration pictures (../shared/data/calibration) are not here"
)


def pictures_in(folder, pattern):
    return sorted((DATA / folder).glob(pattern))


@real
@pytest.mark.opencv
def test_opencv_left_set():
    found = calibrate(pictures_in("opencv_stereo_chess", "left*.jpg"), Board("chessboard", 10, 7, 0.025))
    assert len(found.used) == 13
    assert found.solution.rms_px <= 0.20
    assert found.camera.f_px == pytest.approx(532.8, abs=1)


@real
@pytest.mark.opencv
def test_charuco_set():
    found = calibrate(pictures_in("charuco_1280", "*.jpg"), Board("charuco", 8, 8, 0.0254, 0.01905, "4x4_1000"))
    assert found.solution.rms_px <= 0.26
    assert found.camera.f_px == pytest.approx(1127.5, abs=2)


@real
@pytest.mark.opencv
def test_stereo_baseline():
    sets = [pictures_in("opencv_stereo_chess", f"{side}*.jpg") for side in ("left", "right")]
    found = calibrate_rig(*sets, Board("chessboard", 10, 7, 0.025))
    assert found.rig.baseline_m == pytest.approx(0.0834, abs=0.0004)


@real
@pytest.mark.opencv
def test_same_corners_as_opencv_on_real_pictures():
    import cv2

    board = Board("chessboard", 10, 7, 0.025)
    found = calibrate(pictures_in("opencv_stereo_chess", "left*.jpg"), board, model="opencv5")
    seen = [BoardView(s.view.name, 640, 480, s.view.ids, s.view.points_px, 0.1) for s in found.solution.problem.sights]
    rms, matrix, *_ = cv2.calibrateCamera([board.points_m[v.ids].astype(np.float32) for v in seen],
                                          [v.points_px.astype(np.float32) for v in seen], (640, 480), None, None)  # fmt: skip
    problem = Problem(
        board, tuple(Sight(0, i, v) for i, v in enumerate(seen)), (LENS_MODELS["opencv5"],), ((640, 480),)
    )
    own = adjust(problem, start_state(problem))
    assert own.rms_px == pytest.approx(rms, rel=0.01)
    assert own.state.intrinsics[0][0] == pytest.approx(matrix[0, 0], abs=0.3)


@real
@pytest.mark.opencv
def test_audit_of_what_opencv_ships():
    left = pictures_in("opencv_stereo_chess", "left*.jpg")
    result = run(*left, *SQUARES, "--check", DATA / "opencv_stereo_chess" / "left_intrinsics.yml")
    assert "calibration_without_uncertainty" in result.output
    assert result.exit_code in (0, 3)
