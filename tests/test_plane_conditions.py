"""A plane by what holds in it: right angles, parallels, equal and known lengths."""

import json

import numpy as np
import pytest
from click.testing import CliRunner
from test_plane_pictures import ACROSS, ALONG, LOCKERS, VERTICALS

from subtense import Photo, propagate
from subtense.camera import Camera
from subtense.cli import main
from subtense.errors import GeometryError, InputError
from subtense.geometry import Pose, rotation_from_vector
from subtense.line_camera import camera_from_lines
from subtense.methods import plane_conditions as way
from subtense.observation import Observation
from subtense.quantity import Quantity
from subtense.workflow.plane_conditions import PlaneTexts, plane_document

pytestmark = pytest.mark.opencv
CAMERA = Camera(1600, 1200, 1500.0, 799.5, 599.5, cov=np.diag([100.0, 1e-6, 9, 9]))
EXACT = Quantity.exact(0.0, "1")
# a rectangle, a square that is turned by 30 degrees, two more ends, and what is wanted
WINDOW = np.array([[-0.5, -0.3], [0.4, -0.3], [0.4, 0.3], [-0.5, 0.3]])
TURN = np.array([[np.cos(0.5), np.sin(0.5)], [-np.sin(0.5), np.cos(0.5)]])
TILE = np.array([[-0.2, -0.2], [0.2, -0.2], [0.2, 0.2], [-0.2, 0.2]]) @ TURN
PATH = np.array([[-0.4, 0.5], [0.5, 0.4], [0.6, -0.4]])
POINTS = np.concatenate([WINDOW, TILE, PATH])
LENGTH = np.hypot(0.9, 0.1) + np.hypot(0.1, 0.8)
WIDE, HIGH = Quantity.normal(0.9, 0.001, "m"), Quantity.normal(0.6, 0.001, "m")
LEVEL = Pose(np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]), np.array([0, 1.5, 4.0]))
"""A floor under a level camera: the principal ray never meets it."""


def seen(points=POINTS, lean=(0.6, 0.4, 0.3), place=(0.05, 0.0, 3.0), pose=None, camera=CAMERA):
    pose = pose or Pose(rotation_from_vector(np.array(lean)), np.array(place))
    return camera.project(pose.apply(np.column_stack([points, np.zeros(len(points))])))


def inputs(conditions, camera=CAMERA, path="9 10 11", method=way.METHOD, points=None, sigma=0.5, **known):
    more = {"camera": camera} if camera else {"distortion": EXACT}
    return method.inputs(Observation(seen() if points is None else points, sigma), conditions, path, **more, **known)


def value(method, one):
    return propagate.measure(method, one, draws=2_000)[0].value


def codes(one, method=way.METHOD):
    return {n.code for n in propagate.measure(method, one, draws=2_000)[0].notes}


def refusal(one, method=way.METHOD):
    with pytest.raises(GeometryError) as caught:
        propagate.measure(method, one, draws=2_000)
    return caught.value.code


# -- right answers -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("conditions", "camera", "known"),
    [
        ("rectangle 1 2 3 4; length 1 2", CAMERA, {"length": WIDE}),
        ("parallel 1 2 4 3; parallel 2 3 1 4; length 1 2", CAMERA, {"length": WIDE}),
        ("right 1 2 3; right 5 6 7; parallel 1 2 4 3; length 2 3", CAMERA, {"length": HIGH}),
        ("rectangle 1 2 3 4; length 1 2; second 2 3", None, {"length": WIDE, "second": HIGH}),
        ("rectangle 1 2 3 4; square 5 6 7 8; length 1 2", None, {"length": WIDE}),
        ("square 5 6 7 8; length 1 2", None, {"length": WIDE}),
        ("rectangle 1 2 3 4; right 5 6 7; length 1 2", None, {"length": WIDE}),
        ("parallel 1 2 4 3; parallel 2 3 1 4; length 1 2; second 2 3; third 1 3", None,
         {"length": WIDE, "second": HIGH, "third": Quantity.normal(np.hypot(0.9, 0.6), 0.001, "m")}),
    ],
)  # fmt: skip
def test_length_area_and_angle_of_a_drawing(conditions, camera, known):
    assert value(way.METHOD, inputs(conditions, camera, **known)) == pytest.approx(LENGTH, rel=1e-6)
    area = abs(0.9 * -0.9 - -0.1 * 1.0) / 2
    assert value(way.AREA, inputs(conditions, camera, method=way.AREA, **known)) == pytest.approx(area, rel=1e-6)
    a, b = PATH[0] - PATH[1], PATH[2] - PATH[1]
    angle = np.arccos(a @ b / np.linalg.norm(a) / np.linalg.norm(b))
    assert value(way.ANGLE, inputs(conditions, camera, method=way.ANGLE, **known)) == pytest.approx(angle, rel=1e-6)


@pytest.mark.parametrize(("conditions", "camera"), [("rectangle 1 2 3 4", CAMERA), ("square 5 6 7 8", None)])
def test_an_angle_needs_no_length(conditions, camera):
    a, b = PATH[0] - PATH[1], PATH[2] - PATH[1]
    angle = np.arccos(a @ b / np.linalg.norm(a) / np.linalg.norm(b))
    found = propagate.measure(way.ANGLE, inputs(conditions, camera, method=way.ANGLE))[0]
    assert found.value == pytest.approx(angle, rel=1e-6) and found.u < 0.05


def test_a_floor_under_a_level_camera():
    points = seen(pose=LEVEL)
    one = inputs("rectangle 1 2 3 4; length 1 2", points=points, length=WIDE)
    assert value(way.METHOD, one) == pytest.approx(LENGTH, rel=1e-6)


def test_the_known_side_itself_is_as_certain_as_stated():
    """Its ends are the same clicks, so they do not count twice."""
    m = propagate.measure(way.METHOD, inputs("rectangle 1 2 3 4; length 1 2", path="1 2", length=WIDE))[0]
    assert m.value == pytest.approx(0.9) and m.u == pytest.approx(0.001, rel=0.3)


def test_more_conditions_make_it_more_certain():
    few = inputs("square 5 6 7 8; length 1 2", None, length=WIDE)
    many = inputs("square 5 6 7 8; rectangle 1 2 3 4; length 1 2", None, length=WIDE)
    assert propagate.measure(way.METHOD, many)[0].u < propagate.measure(way.METHOD, few)[0].u


def test_the_lens_that_nobody_knows_is_in_u_and_noted():
    one = way.Inputs(Observation(seen(), 0.5), "square 5 6 7 8; length 1 2", "9 10", WIDE)
    assert "distortion_unknown" in codes(one)
    assert "distortion" in [c.name for c in propagate.measure(way.METHOD, one)[0].budget]


# -- doubts ------------------------------------------------------------------------------------------------------------


def test_just_enough_conditions_can_not_be_checked():
    assert codes(inputs("parallel 1 2 4 3; parallel 2 3 1 4; length 1 2", length=WIDE)) == {"conditions_unchecked"}
    assert codes(inputs("rectangle 1 2 3 4; length 1 2", length=WIDE)) == set()


def test_the_condition_that_is_off_is_named():
    """Only the tile's sides are not equal: one is told 10 % too long."""
    text = "rectangle 1 2 3 4; rectangle 5 6 7 8; equal 5 6 6 7; equal 1 2 3 4; length 1 2; second 2 3; third 5 7"
    long = Quantity.normal(1.1 * 0.4 * 2**0.5, 0.001, "m")
    [note] = propagate.measure(way.METHOD, inputs(text, length=WIDE, second=HIGH, third=long))[0].notes
    assert note.code == "conditions_misfit" and "third known length" in note.text


def test_a_single_spare_condition_tells_that_one_is_wrong_but_not_which():
    stretched = POINTS.copy()
    stretched[:4, 0] += 0.3 * stretched[:4, 1]  # the window is a rhomboid
    one = inputs("rectangle 1 2 3 4; length 1 2", points=seen(stretched), length=WIDE)
    [note] = propagate.measure(way.METHOD, one)[0].notes
    assert note.code == "conditions_misfit" and "tell which" in note.cure


def test_an_outline_that_crosses_itself_is_noted():
    one = inputs("rectangle 1 2 3 4; length 1 2", path="9 10 1 11", method=way.AREA, length=WIDE)
    assert "outline_crosses" in codes(one, way.AREA)


# -- refusals ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("conditions", "camera"),
    [
        # parallels alone leave the shape open without a camera
        ("parallel 1 2 4 3; parallel 2 3 1 4; parallel 5 6 8 7; parallel 6 7 5 8; length 1 2", None),
        # one direction of parallels, more than once
        ("parallel 1 2 4 3; parallel 4 3 9 12; length 1 2", CAMERA),
        ("parallel 1 2 4 3; parallel 4 3 9 12; right 1 2 3; right 2 3 4; length 1 2", None),
        # right angles of one direction
        ("rectangle 1 2 3 4; right 2 3 4; right 3 4 1; length 1 2", None),
    ],
)
@pytest.mark.parametrize("seed", range(4))
def test_what_does_not_fix_the_plane_is_refused_with_noise_too(conditions, camera, seed):
    points = np.concatenate([POINTS, [PATH[0] + [0.7, 0.0]]])
    noisy = seen(points) + np.random.default_rng(seed).normal(0, 0.5, (len(points), 2))
    assert refusal(inputs(conditions, camera, points=noisy, length=WIDE)) == "undetermined"


def test_one_right_angle_and_parallels_far_away_have_two_planes():
    """From far away a right angle is seen alike on two planes."""
    far = seen(place=(0.05, 0.0, 60.0)) + np.random.default_rng(3).normal(0, 0.3, (11, 2))
    one = inputs("right 1 2 3; right 5 6 7; length 1 2", points=far, path="9 10", length=WIDE)
    assert refusal(one) == "undetermined"


def test_corners_in_the_wrong_order_and_points_on_one_click():
    assert refusal(inputs("rectangle 1 3 2 4; length 1 2", length=WIDE)) == "folded"
    points = seen()
    points[1] = points[0]
    assert refusal(inputs("rectangle 1 2 3 4; length 1 2", points=points, length=WIDE)) in ("collinear", "folded")


def test_beyond_the_horizon():
    points = seen(pose=LEVEL)
    points[9] = [800.0, 300.0]
    assert refusal(inputs("rectangle 1 2 3 4; length 1 2", points=points, length=WIDE)) == "beyond_horizon"


@pytest.mark.parametrize(
    ("conditions", "known", "words"),
    [
        ("rectangle 1 2 3 4; length 1 2", {}, "length is missing"),
        ("rectangle 1 2 3 4", {}, "length is missing"),
        ("rectangle 1 2 3 4", {"length": WIDE}, "side it is of"),
        ("rectangle 1 2 3 99; length 1 2", {"length": WIDE}, "from 1 to 11"),
        ("rectangle 1 2 3; length 1 2", {"length": WIDE}, "rectangle 1 2 3 4"),
        ("circle 1 2 3; length 1 2", {"length": WIDE}, "write them as"),
        ("parallel 1 1 2 3; length 1 2", {"length": WIDE}, "two different points"),
        ("length 1 2", {"length": WIDE}, "give 3 or more"),
        ("length 1 x", {"length": WIDE}, "write them as"),
        ("", {"length": WIDE}, "write them as"),
        ("length 1 2; " * 50, {"length": WIDE}, "at most"),
    ],
)
def test_conditions_that_can_not_be_read(conditions, known, words):
    with pytest.raises(InputError, match=words):
        inputs(conditions, **known)


def test_paths_that_can_not_be_read():
    for path in ("9", "9 99", "9 x", ""):
        with pytest.raises(InputError, match="path"):
            inputs("rectangle 1 2 3 4; length 1 2", path=path, length=WIDE)
    with pytest.raises(InputError, match="three"):
        inputs("rectangle 1 2 3 4", path="9 10", method=way.ANGLE)
    with pytest.raises(InputError, match="100"):
        way.Inputs(Observation(np.zeros((10_000, 2))), "rectangle 1 2 3 4; length 1 2", "1 2", WIDE)


# -- a photo -----------------------------------------------------------------------------------------------------------


def drawn(tmp_path):
    from PIL import Image

    file = tmp_path / "wall.png"
    Image.new("RGB", (1600, 1200), "white").save(file)
    return file


def text(*indices, points=None):
    return ";".join(f"{x:.3f},{y:.3f}" for x, y in (seen() if points is None else points)[list(indices)])


def run(*words):
    return CliRunner().invoke(main, ["plane", *map(str, words)], catch_exceptions=False)


def test_on_the_command_line(tmp_path):
    file, picture = drawn(tmp_path), tmp_path / "out.png"
    said = ["--square", text(4, 5, 6, 7), "--parallel", f"{text(0, 1)} | {text(3, 2)}", "--right-angle", text(0, 1, 2),
            "--equal-length", f"{text(0, 1)} | {text(3, 2)} ± 0.5px", "--length", f"{text(0, 1)} = 900 ± 2 mm"]  # fmt: skip
    result = run(file, *said, "--path", text(8, 9, 10), "--area", text(8, 9, 10), "--angle", text(8, 9, 10), "--camera", "none",
                 "--overlay", picture, "--format", "json")  # fmt: skip
    assert result.exit_code == 0, result.output
    found = json.loads(result.output)["measurements"]
    assert [m["what"] for m in found] == ["length", "area", "length", "corner"] and picture.exists()
    for m, true in zip(found[:2], (LENGTH, abs(0.9 * -0.9 + 0.1) / 2), strict=True):
        assert m["low"] <= true <= m["high"]
    with_camera = run(file, "--rectangle", text(0, 1, 2, 3), "--length", f"{text(0, 1)} = 90 cm", "--path", text(8, 9), "--camera",
                      "f=1500 ± 10 px", "--format", "json")  # fmt: skip
    [m] = json.loads(with_camera.output)["measurements"]
    assert m["low"] <= np.hypot(0.9, 0.1) <= m["high"]


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ([], "--rectangle is missing"),
        (["--square", "0,0;9,0;9,9;0,9"], "--path is missing"),
        (["--path", "1,1;2,2"], "--rectangle is missing"),
        (["--path", "1,1", "--square", "0,0;9,0;9,9;0,9"], "two points|2 points"),
        (["--path", "1,1;2,2", "--square", "0,0;9,0;9,9"], "4 points"),
        (["--path", "1,1;2,2", "--parallel", "0,0;9,0"], "two lines"),
        (["--path", "1,1;2,2", "--length", "0,0;9,0"], "= 2.4 m"),
        (["--path", "1,1;2,2", "--length", "0,0;9,0 = -2 m"], "above 0"),
        (
            ["--path", "1,1;2,2", "--rectangle", "0,0;9,0;9,9;0,9", "--length", "0,0;9,0 = 2 m"],
            "5 or more, or the camera too",
        ),
        (["--path", "1,1;2000,2", "--square", "0,0;9,0;9,9;0,9", "--length", "0,0;9,0 = 2 m"], "must lie in it"),
        (["--path", "nan,1;2,2", "--square", "0,0;9,0;9,9;0,9"], "in pixels"),
    ],
)
def test_one_line_says_what_is_wrong(tmp_path, words, told):
    import re

    result = run(drawn(tmp_path), *words)
    assert result.exit_code == 2 and result.output.count("\n") == 1 and re.search(told, result.output), result.output


# -- real pictures -----------------------------------------------------------------------------------------------------


def chessboard(data):
    """The photo, and 5 x 7 corners of a board of 33 mm squares."""
    import cv2

    photo = Photo.load(data / "reference_object" / "mouse_on_chessboard" / "object.jpg")
    gray = cv2.cvtColor(photo.pixels, cv2.COLOR_RGB2GRAY)
    return photo, cv2.findChessboardCornersSB(gray, (7, 5))[1].reshape(5, 7, 2).astype(float)


SQUARE_M = 0.033
BOARD = {"camera": "f=693.6px ± 1%", "no camera": "none"}


def board_measured(data, camera):
    """(measured, truth) of lengths, an area and an angle of the board, from a square of it and its diagonal lines."""
    photo, corners = chessboard(data)

    def at(*places):
        return ";".join("{:.3f},{:.3f}".format(*corners[row, column]) for row, column in places) + " ± 0.6px"

    # a square of 3 x 3, parallels beyond it, and a right angle of its diagonals
    said = PlaneTexts(square=[at((0, 0), (0, 3), (3, 3), (3, 0))], parallel=[f"{at((0, 0), (0, 6))[:-8]} | {at((4, 0), (4, 6))}"],
                      right_angle=[at((0, 0), (3, 3), (0, 6))], length=[f"{at((0, 0), (0, 3))} = 99 ± 0.3 mm"])  # fmt: skip
    paths = {
        ((0, 0), (0, 6)): 6,
        ((0, 6), (4, 6)): 4,
        ((0, 0), (4, 6)): np.hypot(4, 6),
        ((1, 4), (4, 5)): np.hypot(3, 1),
    }
    areas = {((0, 0), (0, 6), (4, 6), (4, 0)): 24, ((1, 4), (3, 4), (3, 6)): 2}
    angles = {((0, 0), (0, 6), (4, 6)): np.pi / 2, ((0, 6), (2, 4), (2, 6)): np.pi / 4}
    document = plane_document(photo, said, paths=[at(*p) for p in paths], areas=[at(*p) for p in areas],
                              angles=[at(*p) for p in angles], camera=camera)  # fmt: skip
    truth = [SQUARE_M * n for n in paths.values()]
    truth += [
        one
        for n, outline in zip(areas.values(), (20, 4 + 8**0.5), strict=True)
        for one in (SQUARE_M**2 * n, SQUARE_M * outline)
    ]
    return list(zip(document.measurements, [*truth, *angles.values()], strict=True))


@pytest.mark.parametrize("camera", BOARD)
def test_a_chessboard(shared_data, camera):
    for m, truth in board_measured(shared_data, BOARD[camera]):
        assert m.low <= truth <= m.high, f"{m.label}: {m.low:.4f} to {m.high:.4f}, truth {truth:.4f}"
        assert "conditions_misfit" not in {n.code for n in m.notes}
        assert m.u < 0.03 * m.value


def test_a_chessboard_taken_for_oblong_is_told(shared_data):
    """Squares said to be half as wide again."""
    photo, corners = chessboard(shared_data)
    ends = [
        ";".join("{:.3f},{:.3f}".format(*corners[p]) for p in side) for side in (((0, 0), (0, 4)), ((0, 0), (4, 0)))
    ]
    said = PlaneTexts(rectangle=[";".join("{:.3f},{:.3f}".format(*corners[p]) for p in ((0, 0), (0, 4), (4, 4), (4, 0)))],
                      length=[f"{ends[0]} = 132 mm", f"{ends[1]} = 198 mm"])  # fmt: skip
    [m] = plane_document(photo, said, paths=[ends[0]], camera="f=693.6px ± 1%").measurements
    assert "conditions_misfit" in {n.code for n in m.notes}


def lockers_measured(data):
    """Heights of the second and third locker by that of the first, which all stand in one row, and the truth."""
    photo = Photo.load(data / "single_view_metrology" / "corridor" / "i_NTH.jpeg")
    told = camera_from_lines(photo.width_px, photo.height_px, VERTICALS, ALONG, ACROSS, k1_u=0.02)
    points = Observation(np.concatenate([one.points_px for one in LOCKERS]), 1.0)
    for path in ("3 4", "5 6"):
        one = way.Inputs(points, "parallel 1 2 3 4; parallel 1 2 5 6; parallel 1 5 2 6; right 2 1 5; length 1 2", path,
                         Quantity.normal(1.82, 0.005, "m"), camera=told.camera)  # fmt: skip
        yield propagate.measure(way.METHOD, one)[0], 1.82


def test_a_row_of_lockers(shared_data):
    for m, truth in lockers_measured(shared_data):
        assert m.low - 0.005 <= truth <= m.high + 0.005 and m.u < 0.03
