"""Several ways for one thing: which can answer, which is best, and whether they agree."""

import json

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image

from subtense import Camera, InputError
from subtense.cli import main
from subtense.workflow.applicable import applicable
from subtense.workflow.tables import METHODS

pytestmark = pytest.mark.opencv
CAMERA = Camera(1600, 1200, 1500.0, 799.5, 599.5)
STANDS = ("--height", "1.6 ± 0.02 m", "--pitch", "0 ± 0.2 deg", "--roll", "0 ± 0.2 deg", "--slope", "0 ± 0.1 deg")


def run(*words):
    return CliRunner().invoke(main, [str(word) for word in words], catch_exceptions=False)


@pytest.fixture
def photo(tmp_path):
    path = tmp_path / "plain.png"
    Image.fromarray(np.full((1200, 1600, 3), 90, np.uint8)).save(path)
    return path


def person(distance, height=1.75, x=0.0):
    """Head and foot of someone upright on the ground 1.6 m below a level camera, as a line."""
    (u, head), (v, foot) = CAMERA.project(np.array([[x, 1.6 - height, distance], [x, 1.6, distance]]))
    return f"{u:.2f},{head:.2f},{v:.2f},{foot:.2f} ± 1px"


def measured(photo, *words):
    told = run("measure", photo, "--camera", "f=1500 ± 5px", "--tilt", "0 ± 2 deg", "--format", "json", *words)
    assert told.exit_code == 0, told.output
    return json.loads(told.output)["measurements"]


def codes(m):
    return {note["code"] for note in m["notes"]}


def test_the_narrower_answer_comes_first_and_the_other_checks_it(photo):
    near = measured(photo, "--line", person(5), "--size", "1.75 ± 0.15 m", *STANDS)
    assert near[0]["method"] == "ground_plane" and "cross_check" in codes(near[0])
    assert [m["method"] for m in near if m["what"] == "range"] == ["ground_plane", "known_size"]
    far = measured(photo, "--line", person(40), "--size", "1.75 ± 0.02 m", *STANDS)
    assert far[0]["method"] == "known_size" and "cross_check" in codes(far[0])
    for found, true in ((near, 5.0), (far, 40.0)):
        depths = [m for m in found if m["what"] == "depth"]
        assert len(depths) == 2
        assert all(m["low"] < true < m["high"] for m in depths)


def test_a_child_taken_for_an_adult_is_found_out(photo):
    found = measured(photo, "--line", person(5, height=1.2), "--size", "1.75 ± 0.05 m", *STANDS)
    assert "methods_disagree" in codes(found[0])


def test_chance_alone_hardly_ever_disagrees(photo):
    """Where all is as stated, a contradiction is told in about one of a hundred."""
    rng = np.random.default_rng(3)
    told = 0
    for _ in range(15):
        ends = np.array([float(x) for x in person(8).split(" ")[0].split(",")]) + rng.normal(0, 0.5, 4)
        text = ",".join(f"{x:.3f}" for x in ends) + " ± 1px"
        told += "methods_disagree" in codes(measured(photo, "--line", text, "--size", "1.75 ± 0.05 m", *STANDS)[0])
    assert told <= 1


def test_a_line_without_a_size_is_ranged_by_where_it_stands(photo):
    found = measured(photo, "--line", person(8), *STANDS)
    assert found[0]["method"] == "ground_plane" and "stands_on_ground" in codes(found[0])
    assert found[0]["low"] < 8 < found[0]["high"]


def test_what_lies_across_needs_a_size(photo):
    told = run("measure", photo, "--camera", "f=1500px", "--line", "100,900,700,905", *STANDS)
    assert told.exit_code != 0 and "lies across" in told.output


def test_distances_between_lines(photo):
    words = ("--line", person(8, x=-1), "--line", person(11, x=2), "--size", "1.75 ± 0.01 m")
    found = measured(photo, *words, "--between", "1,2")
    length = next(m for m in found if m["method"] == "between" and m["what"] == "length")
    assert length["label"] == "line 1 to line 2"
    assert length["low"] < np.sqrt(18) < length["high"]
    assert any(m["method"] == "between" for m in measured(photo, *words, "--between", "line 1; line 2"))
    assert any(m["method"] == "between" for m in measured(photo, *words, "--between", "all"))


def test_what_checks_another_has_no_number(photo):
    words = ("--line", person(8, x=-1), "--line", person(11, x=2), "--size", "1.75 ± 0.01 m", *STANDS)
    found = measured(photo, *words, "--between", "1,2")
    assert next(m["label"] for m in found if m["method"] == "between") == "line 1 to line 2"
    other = next(m["label"] for m in found if ", by " in m["label"])
    both = measured(photo, *words, "--same", f"line 1; {other}")
    fused = next(m for m in both if m["method"] == "fuse")
    assert fused["u"] < min(m["u"] for m in both if m["what"] == "range" and m["label"] in ("line 1", other))


def test_one_size_for_all_lines_is_one_doubt(photo):
    """A size that is wrong by 1 % moves both by 1 %: it counts once in the distance between them."""
    words = ("--line", person(10), "--line", person(20), "--between", "1,2")
    one = measured(photo, *words, "--size", "1.75 ± 0.1 m")
    two = measured(photo, *words, "--size", "1.75 ± 0.1 m", "--size", "1.75 ± 0.1 m")
    u = [next(m["u"] for m in found if m["method"] == "between" and m["what"] == "length") for found in (one, two)]
    assert u[0] < 0.6 * u[1]


def test_the_same_thing_twice(photo):
    found = measured(
        photo,
        "--line",
        person(8),
        "--line",
        person(8),
        "--size",
        "1.75 ± 0.05 m",
        "--size",
        "1.75 ± 0.05 m",
        "--same",
        "1,2",
    )
    fused = next(m for m in found if m["method"] == "fuse")
    assert fused["u"] < found[0]["u"]


@pytest.mark.parametrize("words", [("--between", "1,7"), ("--between", "1"), ("--same", "1,1"), ("--between", "nobody;line 1"),
                                   ("--between", "1,2,3"), ("--same", ""), ("--height", "-2 m"), ("--pitch", "95 deg")])  # fmt: skip
def test_nonsense_is_told_in_a_line(photo, words):
    told = run(
        "measure", photo, "--camera", "f=1500px", "--line", person(8), "--line", person(9), "--size", "1.75 m", *words
    )
    assert told.exit_code != 0
    assert told.output.startswith("subtense: ") and len(told.output.strip().splitlines()) == 1


def test_which_methods_can_answer():
    found = applicable(["camera", "ends", "size"])
    assert found[0].method.name == "known_size" and found[0].answers
    by_name = {one.method.name: one for one in found}
    assert by_name["same_plane"].missing == ("reference", "length")
    assert by_name["ground_plane"].missing == ("foot", "pitch or horizon or parallels", "height or reference")
    lengths = applicable([], "length")
    assert {"same_plane", "plane", "ground_length"} <= {one.method.name for one in lengths}
    assert len(applicable([])) == len(METHODS)
    with pytest.raises(InputError, match="known are"):
        applicable(["weather"])
    with pytest.raises(InputError, match="known are"):
        applicable([], "colour")


def test_methods_on_the_command_line():
    told = run("methods", "camera", "foot", "height", "pitch")
    assert told.output.splitlines()[1].startswith("ground_plane") and "nothing" in told.output.splitlines()[1]


def test_any_method_in_a_photo(photo):
    told = run("method", "ground_plane", "--photo", photo, "--camera", "f=1500 ± 5px", "--foot", "800,900", "--height", "1.6 ± 0.02 m",
               "--pitch", "-90 ± 1 deg", "--format", "json")  # fmt: skip
    assert told.exit_code == 0, told.output
    found = json.loads(told.output)
    assert found["photo"]["name"] == "plain.png" and found["measurements"][0]["what"] == "ground_distance"
    told = run(
        "method",
        "known_size",
        "--photo",
        photo,
        "--camera",
        "f=1500 ± 5px",
        "--ends",
        "100,100;9000,100",
        "--size",
        "1 m",
    )
    assert told.exit_code != 0 and "must lie in it" in told.output


def test_the_ground_on_the_command_line(photo, tmp_path):
    told = run("ground", photo, "--camera", "f=1500 ± 5px", "--point", "799.5,899.5", *STANDS, "--overlay", tmp_path / "o.png",
               "--length", "700,900;900,900", "--move", "700,900;900,900", "--time", "0.5 ± 0.01 s", "--format", "json")  # fmt: skip
    assert told.exit_code == 0, told.output
    found = json.loads(told.output)["measurements"]
    assert found[0]["value"] == pytest.approx(8.0, rel=0.001)
    speed = next(m for m in found if m["what"] == "speed")
    length = next(m for m in found if m["what"] == "length")
    assert speed["value"] == pytest.approx(length["value"] / 0.5, rel=0.01)
    assert (tmp_path / "o.png").stat().st_size > 1000
    told = run("ground", photo, "--camera", "f=1500px")
    assert told.exit_code != 0 and "--point" in told.output
    told = run("ground", photo, "--camera", "f=1500px", "--point", "800,900", "--terrain", "hill.tif", *STANDS)
    assert told.exit_code != 0 and "--position" in told.output


def test_bare_numbers_of_a_method_in_a_photo_are_refused(photo):
    """There is no field that shows a unit beside it."""
    for words in (("--distance", "8.09 ± 0.02", "--tilt", "0 deg"), ("--distance", "8 m", "--tilt", "0.7854 exact")):
        told = run(
            "method",
            "known_distance",
            "--photo",
            photo,
            "--camera",
            "f=1500 ± 5px",
            "--ends",
            "100,100;100,600",
            *words,
        )
        assert told.exit_code != 0 and "give a" in told.output


def test_width_and_height_of_a_sheet_that_was_found(examples):
    told = [run("measure", examples / "desk.jpg", "--only", "sheets", "--size", text, "--format", "json")
            for text in ("297 x 210 mm", "210 ± 1 mm x 297 ± 1 mm")]  # fmt: skip
    ranges = [next(m["value"] for m in json.loads(t.output)["measurements"] if m["label"] == "sheet") for t in told]
    assert ranges == pytest.approx([0.652, 0.652], rel=0.01)
    one = json.loads(
        run("measure", examples / "desk.jpg", "--only", "sheets", "--size", "297 mm", "--format", "json").output
    )
    assert "sheet" not in {m["label"] for m in one["measurements"]}
    assert any(note["code"] == "size_unknown" and "width and height" in note["cure"] for note in one["notes"])


def test_marked_lines_are_measured_where_nothing_is_found(photo):
    told = run("measure", photo, "--camera", "f=1500px", "--line", "100,100,100,600", "--size", "1.75 m", "--marker-size", "50 mm",
               "--format", "json")  # fmt: skip
    found = json.loads(told.output)
    assert found["measurements"][0]["what"] == "range"
    assert "nothing_found" in {note["code"] for note in found["notes"]}


def test_wrong_options_are_told_in_a_line(photo):
    for words in (
        ["plan", "--accuracy", "1 cm"],
        ["measure"],
        ["ground", photo, "--pont", "1,2"],
        ["measure", photo, "--seed", "abc"],
    ):
        told = run(*words)
        assert told.exit_code == 2 and told.output.startswith("subtense: ") and len(told.output.splitlines()) == 1
        assert "--help" in told.output


def test_nothing_but_refusals_is_an_error(photo):
    told = run(
        "ground", photo, "--camera", "f=1500 ± 5px", *STANDS, "--point", "800,300", "--length", "700,200;800,300"
    )
    assert told.exit_code == 3 and len(told.output.splitlines()) == 1 and "horizon" in told.output


def test_the_longest_extent_of_a_box_goes_from_corner_to_corner(examples):
    """The package of 200 x 150 mm: its diagonal is taken for the size given, which is told."""
    words = (
        "measure",
        examples / "belt.jpg",
        "--outline",
        "450,330,1050,800",
        "--size",
        "200 mm",
        "--camera",
        "f=2685.3 ± 3 px",
        "--format",
        "json",
    )
    found = json.loads(run(*words).output)["measurements"]
    assert "across_corners" in codes(found[0])
    side = json.loads(run(*words, "--extent", "width").output)["measurements"]
    assert "across_corners" not in codes(side[0])


def test_a_point_that_snaps_far_is_doubted(examples):
    """The foot goes to the edge of a shadow, 3.5 px off and five times as far as a mark is off by chance."""
    words = ("measure", examples / "street.jpg", "--camera", "f=1829 ± 3px", "--line", "672.3,897.2,668.4,499.2",
             "--size", "1.75 ± 0.001 m", "--tilt", "0 ± 1 deg", "--snap", "--format", "json")  # fmt: skip
    m = json.loads(run(*words).output)["measurements"][1]
    assert "snapped_far" in codes(json.loads(run(*words).output)["measurements"][0])
    assert abs(m["value"] - 8.05) < 3 * m["u"]


def test_a_part_of_the_same_proportions_is_told_as_possible(examples, tmp_path):
    with Image.open(examples / "street.jpg") as whole:
        whole.crop((300, 200, 1500, 1000)).save(tmp_path / "cut.jpg", exif=whole.getexif())
    told = run(
        "measure", tmp_path / "cut.jpg", "--line", "372,697,368,299", "--size", "1.75 ± 0.02 m", "--format", "json"
    )
    note = next(note for note in json.loads(told.output)["notes"] if note["code"] == "resized")
    assert "cut out instead, all distances are 1.5 times" in note["text"]
