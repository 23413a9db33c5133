"""Bad input for every method of a plane, through the command line: one line that says what is wrong, or a right answer, at once."""

import csv
import time
from itertools import chain

import pytest
from click.testing import CliRunner

from subtense.cli import main

pytestmark = pytest.mark.opencv
CAMERA = "1600x1200, f=1500 ± 10 px"
MANY = ";".join(f"{x % 100 * 10 + 100},{x // 100 * 8 + 100}" for x in range(10_000)) + " ± 0.7px"
CORNERS = "400,300;1200,340;1150,900;420,850"
MORE = ";500,1000;1100,1040 ± 0.7px"
FRAME = {"frame": "-0.5,-0.5;1599.5,1199.5"}
RECTANGLE = {"points": f"{CORNERS} ± 0.7px", "target": "rectangle 297 ± 1 mm x 210 ± 1 mm"}
UPRIGHT = {
    "verticals": "300,200;310,900;1200,150;1180,880 ± 0.7px",
    "reference": "600,800;605,400 ± 0.7px",
    "height": "2 ± 0.01 m",
}
GOOD = {
    "plane": {**RECTANGLE, **FRAME, "path": "500,400;900,420 ± 0.7px"},
    "plane_area": {**RECTANGLE, **FRAME, "path": "500,400;900,420;700,800 ± 0.7px"},
    "plane_angle": {**RECTANGLE, **FRAME, "path": "500,400;900,420;700,800 ± 0.7px"},
    "plane_distance": {**RECTANGLE, "camera": CAMERA, "spot": "500,400 ± 0.7px"},
    "plane_conditions": {**FRAME, "points": CORNERS + MORE, "conditions": "square 1 2 3 4; length 1 2", "length": "297 ± 1 mm",
                         "path": "5 6"},
    "height": {**UPRIGHT, "camera": CAMERA, "ends": "900,820;902,300 ± 0.7px"},
    "wall": {**UPRIGHT, "camera": CAMERA, "foot": "500,850;1100,900 ± 0.7px", "ends": "600,700;1000,500 ± 0.7px"},
    "same_plane": {"reference": "300,500;700,500 ± 0.5px", "ends": "300,700;500,700 ± 0.5px", "length": "2 ± 0.01 m"},
}  # fmt: skip
LONGEST_S = 60.0
"""Even on a machine that is busy with other things."""


def run(method, **changed):
    """Exit code, what is printed, and how long it took; None leaves an input out."""
    given = {name: text for name, text in {**GOOD[method], **changed}.items() if text is not None}
    words = chain.from_iterable((f"--{name.replace('_', '-')}", text) for name, text in given.items())
    start = time.perf_counter()
    result = CliRunner().invoke(main, ["method", method, *words, "--format", "csv"], catch_exceptions=False)
    assert time.perf_counter() - start < LONGEST_S
    return result.exit_code, result.output


def refused(method, words, **changed):
    code, printed = run(method, **changed)
    assert code in (2, 3) and printed.count("\n") == 1 and words in printed, printed


def answer(method, **changed):
    """The first row of what is measured."""
    code, printed = run(method, **changed)
    assert code == 0, printed
    return next(csv.DictReader(printed.splitlines()))


@pytest.mark.parametrize("method", GOOD)
def test_good_input_is_measured(method):
    assert float(answer(method)["value"]) > 0


OF_FOUR = ("plane", "plane_area", "plane_angle", "plane_distance")


@pytest.mark.parametrize("method", [*OF_FOUR, "plane_conditions"])
@pytest.mark.parametrize(
    ("points", "words"),
    [
        ("400,300;800,300;1200,300;420,850", "reference points do not determine|no plane looks"),  # three on one line
        ("400,300;1150,900;1200,340;420,850", "right order|no pose"),  # a rectangle that folds over
        ("400,300;1200,340;600,450;420,850", "right order|no pose|more than one"),  # a corner inside the others
        ("400,300;400,300;1150,900;420,850", "do not determine"),  # two on one click
        ("400,300;400,300;400,300;400,300", "do not determine"),
        ("400,300;1e9,340;1150,900;420,850", "do not determine|no plane looks"),
    ],
)
def test_points_that_show_no_plane(method, points, words):
    code, printed = run(method, points=points + (MORE if method == "plane_conditions" else " ± 0.7px"))
    assert code == 3 and printed.count("\n") == 1 and any(one in printed for one in words.split("|")), printed


def test_points_in_reverse_order_show_the_same_rectangle():
    back = answer("plane", points="420,850;1150,900;1200,340;400,300 ± 0.7px")
    assert float(back["value"]) == pytest.approx(float(answer("plane")["value"]))


def test_points_that_start_at_the_wrong_corner_are_told_where_they_can_be():
    """Four points fit any plane, which is noted; with a camera they do not fit the rectangle."""
    turned = "1200,340;1150,900;420,850;400,300 ± 0.7px"
    assert "points_unchecked" in answer("plane", points=turned)["notes"]
    assert "points_misfit" in answer("plane_distance", points=turned)["notes"]


def test_points_that_hardly_show_a_plane_have_an_open_interval():
    found = answer("plane", points="400,300;402,300;402,302;400,302 ± 0.7px")
    assert "open_interval" in found["notes"] and not found["high"]
    refused("plane_conditions", "do not fix", points="400,300;402,300;402,302;400,302" + MORE)


def test_exact_points_are_measured():
    for method in ("plane", "plane_conditions"):
        exact = answer(method, points=GOOD[method]["points"].replace("0.7px", "0px"))
        assert float(exact["value"]) == pytest.approx(float(answer(method)["value"]), rel=1e-3)


@pytest.mark.parametrize(
    ("method", "field", "words"),
    [
        *((method, "points", "same number") for method in OF_FOUR),
        ("plane_conditions", "points", "100 at most"),
        ("plane", "path", "100 at most"),
        ("plane_area", "path", "100 at most"),
        ("plane_angle", "path", "give 3"),
        ("plane_distance", "spot", "give 1"),
        ("height", "verticals", "50 lines at most"),
        ("height", "reference", "give 2"),
        ("wall", "verticals", "50 lines at most"),
        ("wall", "foot", "give 2"),
        ("same_plane", "ends", "give 2"),
    ],
)
def test_ten_thousand_points(method, field, words):
    refused(method, words, **{field: MANY})


@pytest.mark.parametrize(
    ("method", "changed", "words"),
    [
        ("plane", {"path": "500,400;500,400 ± 0.7px"}, "no extent"),
        ("plane_area", {"path": "500,400;500,400;500,400 ± 0.7px"}, "no extent"),
        ("plane_angle", {"path": "500,400;500,400;700,800 ± 0.7px"}, "no extent"),
        ("plane_conditions", {"path": "5 5"}, "no extent"),
        ("height", {"ends": "900,820;900,820 ± 0.7px"}, "no extent"),
        ("height", {"reference": "600,800;600,800 ± 0.7px"}, "no height"),
        ("height", {"verticals": "300,200;300,200;1200,150;1180,880 ± 0.7px"}, "vanishing point"),
        ("height", {"verticals": "300,200;310,900;300,200;310,900 ± 0.7px"}, "vanishing point"),
        ("wall", {"foot": "500,850;500,850 ± 0.7px"}, "no extent"),
        ("wall", {"ends": "900,820;900,820 ± 0px"}, "no extent"),
        ("same_plane", {"reference": "300,500;300,500 ± 0.5px"}, "no extent"),
    ],
)
def test_coincident_clicks(method, changed, words):
    refused(method, words, **changed)


@pytest.mark.parametrize(
    ("method", "changed"),
    [
        ("plane", {"path": "500,400;1e7,1e7 ± 0.7px"}),
        ("plane_distance", {"spot": "900,20000 ± 0.7px"}),
        ("plane_conditions", {"points": CORNERS + ";500,1000;1e6,1e6 ± 0.7px"}),
        ("height", {"ends": "900,100;902,20 ± 0.7px"}),
        ("height", {"camera": None, "horizon": "0,800;1600,800 ± 2px", **FRAME}),  # through the base
        ("height", {"camera": None, "horizon": "800,0;800,1200 ± 2px", **FRAME}),  # upright
        ("wall", {"foot": "500,100;1100,90 ± 0.7px"}),
    ],
)
def test_beyond_the_horizon(method, changed):
    refused(method, "horizon", **changed)


def test_a_horizon_through_the_object_is_right():
    """A thing taller than the camera stands through the horizon, which is no fault."""
    found = answer("height", camera=None, horizon="0,600;1600,600 ± 2px", **FRAME)
    assert float(found["low"]) < float(found["value"]) < float(found["high"])


@pytest.mark.parametrize("horizon", ["0,1000;1600,1000 ± 2px", "800,600;800,600 ± 2px"])
def test_a_horizon_that_can_not_be_is_refused(horizon):
    code, printed = run("height", camera=None, horizon=horizon, **FRAME)
    assert code == 3 and printed.count("\n") == 1


@pytest.mark.parametrize(
    ("method", "changed", "words"),
    [
        ("height", {"height": "0 ± 0.01 m"}, "length"),
        ("height", {"height": "-2 ± 0.01 m"}, "length"),
        ("wall", {"height": "0 ± 0.01 m"}, "length"),
        ("same_plane", {"length": "0 ± 0.01 m"}, "length"),
        ("plane_conditions", {"length": "0 ± 1 mm"}, "length"),
        ("plane", {"target": "rectangle 0 ± 1 mm x 210 ± 1 mm"}, "above 0"),
        ("plane", {"target": "rectangle -297 ± 1 mm x 210 ± 1 mm"}, "above 0"),
        ("plane", {"target": "plane 0,0;1,0;2,0;3,0 m ± 1 mm"}, "do not determine"),
        ("plane", {"target": "plane 0,0;0,0;2,1;0,1 m ± 1 mm"}, "do not determine"),
        ("plane", {"camera": CAMERA, "frame": None, "off_plane": "10 ± 0.1 m"}, "range"),
    ],
)
def test_no_size_and_no_height(method, changed, words):
    refused(method, words, **changed)
