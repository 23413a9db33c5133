"""Planned set-ups: what is planned is what the methods then measure, at drawn scenes, at the thumb rules, and through the command."""

import dataclasses
import json
import math
import re

import numpy as np
import pytest
from click.testing import CliRunner
from jsonschema import Draft202012Validator

from subtense import Quantity, propagate
from subtense.cli import main
from subtense.distribution import HALF_WIDTH_95
from subtense.errors import GeometryError, InputError, MissingExtraError
from subtense.observation import Observation
from subtense.reports import plan_chart
from subtense.workflow.plan import plan
from subtense.workflow.plan_input import PlanTexts, setup_of, wanted_of, ways_of
from subtense.workflow.plan_ways import WAYS
from subtense.workflow.tables import METHODS

SCENES = 4000


def planned(solve=(), between=None, **said):
    """The plan of one way, by default without a table, which takes its time."""
    distance = said["distance"]
    number, unit = distance.split()
    [found] = plan(PlanTexts(**said), solve=solve, between=between or f"{distance} to {1.01 * float(number)} {unit}")
    return found


def run(*words):
    result = CliRunner().invoke(main, ["plan", *words])
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result


def solution(found, key):
    return next(one for one in found.solutions if one.key == key)


# -- what is planned is what is measured ------------------------------------------------------------------------------------


def close(values, truth, half_width):
    """The share of measurements that lie as near to the truth as was planned."""
    assert np.isfinite(values).mean() > 0.99
    return float(np.mean(np.abs(values - truth) <= half_width))


def drawn(rng, value, half_width):
    return value + half_width / HALF_WIDTH_95 * rng.standard_normal(SCENES)


def test_a_planned_size_is_measured_as_well_as_planned():
    said = {
        "distance": "12 m",
        "way": "known_size",
        "focal": "2900 ± 12 px",
        "tilt": "0 ± 4 deg",
        "pixel_error": "1 px",
    }
    size_m = solution(planned(accuracy="12 cm", solve=["size"], size="1 m ± 0.4 %", **said), "size").low
    half = planned(size=f"{size_m} m ± 0.4 %", **said).answer.half_width_m
    assert half == pytest.approx(0.12, rel=0.02)
    rng = np.random.default_rng(1)
    size, tilt = drawn(rng, size_m, 0.004 * size_m), drawn(rng, 0, math.radians(4))
    f, cx = drawn(rng, 2900, 12), 1999.5 + 4 * rng.standard_normal(SCENES)
    sides = np.array([-0.5, 0.5]) * size[:, None]
    x = cx[:, None] + f[:, None] * sides * np.cos(tilt)[:, None] / (12 + sides * np.sin(tilt)[:, None])
    points = np.stack([x, np.full_like(x, 1499.5)], -1) + 1 / HALF_WIDTH_95 * rng.standard_normal((SCENES, 2, 2))
    inputs = WAYS["known_size"].inputs(
        setup_of(WAYS["known_size"], PlanTexts(size=f"{size_m} m ± 0.4 %", **said), 12.0), 12.0
    )
    seen = dataclasses.replace(inputs, ends=Observation(points, inputs.ends.sigma_px))
    found = METHODS["known_size"].function(seen)
    assert 0.93 <= close(found.range_m, 12.0, half) <= 0.975


def test_a_planned_height_is_measured_as_well_as_planned():
    said = {
        "distance": "15 m", "way": "ground", "focal": "2000 ± 8 px", "pitch_error": "0.2 deg", "roll_error": "0.5 deg",
        "slope": "0 ± 0.1 deg", "pixel_error": "2 px",
    }  # fmt: skip
    height_m = solution(planned(accuracy="40 cm", solve=["height"], height="2 ± 0.01 m", **said), "height").low
    said["height"] = f"{height_m} ± 0.01 m"
    half = planned(**said).answer.half_width_m
    assert half == pytest.approx(0.4, rel=0.02)
    rng = np.random.default_rng(2)
    inputs = WAYS["ground"].inputs(setup_of(WAYS["ground"], PlanTexts(**said), 15.0), 15.0)
    assert float(METHODS["ground_plane"].function(inputs).ground_distance_m) == pytest.approx(15.0, abs=1e-6)
    # the true camera: an angle below the horizon that its pitch, the slope and its principal point and pixels are in
    pitch = drawn(rng, float(inputs.pitch.value), math.radians(0.2))
    height, f, slope = drawn(rng, height_m, 0.01), drawn(rng, 2000, 8), drawn(rng, 0, math.radians(0.1))
    cy = 1499.5 + 4 * rng.standard_normal(SCENES)
    below = np.arctan(height / 15 - np.tan(slope))
    y = cy + f * np.tan(below + pitch) + 2 / HALF_WIDTH_95 * rng.standard_normal(SCENES)
    points = np.stack([np.full(SCENES, 1999.5), y], -1)[:, None, :]
    seen = dataclasses.replace(inputs, foot=Observation(points, inputs.foot.sigma_px))
    found = METHODS["ground_plane"].function(seen)
    assert 0.93 <= close(found.ground_distance_m, 15.0, half) <= 0.97


def test_a_planned_baseline_is_measured_as_well_as_planned():
    said = {
        "distance": "20 m",
        "way": "stereo",
        "focal": "3000 px ± 0.1 %",
        "pixel_error": "0.3 px",
        "offset_error": "0.1 px",
    }
    baseline_m = solution(
        planned(accuracy="20 cm", solve=["baseline"], baseline="0.2 m ± 0.1 %", **said), "baseline"
    ).low
    said["baseline"] = f"{baseline_m} m ± 0.1 %"
    half = planned(**said).answer.half_width_m
    assert half == pytest.approx(0.2, rel=0.01)
    rng = np.random.default_rng(3)
    inputs = WAYS["stereo"].inputs(setup_of(WAYS["stereo"], PlanTexts(**said), 20.0), 20.0)
    f, baseline = drawn(rng, 3000, 3), drawn(rng, baseline_m, 0.001 * baseline_m)
    disparity = f * baseline / 20 + drawn(rng, 0, 0.1) + drawn(rng, 0, 0.3)
    found = WAYS["stereo"].method.function(
        dataclasses.replace(inputs, disparity=dataclasses.replace(inputs.disparity, value=disparity))
    )
    assert 0.935 <= close(found.depth_m, 20.0, half) <= 0.965


def test_a_planned_altitude_is_measured_as_well_as_planned():
    said = {
        "distance": "10 m", "way": "drone", "focal": "3000 ± 6 px", "pitch_error": "1 deg", "roll_error": "1 deg",
        "slope": "0 ± 0.2 deg", "pixel_error": "2 px",
    }  # fmt: skip
    found = solution(planned(accuracy="6 cm", solve=["height"], height="40 ± 0.1 m", **said), "height")
    assert found.low < 40 < found.high  # too low the height's ± counts for more, too high the pixel
    said["height"] = f"{found.high} ± 0.1 m"
    half = planned(**said).answer.half_width_m
    assert half == pytest.approx(0.06, rel=0.02)
    rng = np.random.default_rng(4)
    inputs = WAYS["drone"].inputs(setup_of(WAYS["drone"], PlanTexts(**said), 10.0), 10.0)
    pitch, roll = drawn(rng, 0, math.radians(1)), drawn(rng, 0, math.radians(1))
    height, f = drawn(rng, found.high, 0.1), drawn(rng, 3000, 6)
    slope, cross = drawn(rng, 0, math.radians(0.2)), drawn(rng, 0, math.radians(0.2))
    ends = np.array([-5.0, 5.0])
    x, y, z = (
        ends + 0 * cross[:, None],
        np.zeros((SCENES, 2)),
        height[:, None] - np.tan(cross)[:, None] * ends + 0 * slope[:, None],
    )
    x, z = np.cos(roll)[:, None] * x - np.sin(roll)[:, None] * z, np.sin(roll)[:, None] * x + np.cos(roll)[:, None] * z
    y, z = (
        np.cos(pitch)[:, None] * y - np.sin(pitch)[:, None] * z,
        np.sin(pitch)[:, None] * y + np.cos(pitch)[:, None] * z,
    )
    points = np.stack([1999.5 + f[:, None] * x / z, 1499.5 + f[:, None] * y / z], -1)
    points = points + 2 / HALF_WIDTH_95 * rng.standard_normal(points.shape)
    measured = METHODS["ground_length"].function(
        dataclasses.replace(inputs, ends=Observation(points, inputs.ends.sigma_px))
    )
    true_m = 10 / np.cos(cross)
    assert 0.93 <= close(measured.length_m - true_m, 0.0, half) <= 0.97


@pytest.mark.parametrize("way", WAYS)
def test_numbers_are_those_of_the_method(way):
    """The half-width planned is what `propagate.measure` says of the picture that the set-up gives."""
    said = PlanTexts(
        distance="8 m", way=way, focal="3000 ± 9 px", **({"height": "30 ± 0.2 m"} if way == "drone" else {})
    )
    [found] = plan(said)
    inputs = WAYS[way].inputs(setup_of(WAYS[way], said, 8.0), 8.0)
    measured = propagate.measure(WAYS[way].method, inputs)
    name = [o.name for o in WAYS[way].method.outputs].index(WAYS[way].output)
    m = measured[name]
    assert m.value == pytest.approx(8.0, abs=1e-6)
    assert found.answer.half_width_m == pytest.approx(max(m.value - m.low, m.high - m.value), rel=1e-9)
    assert found.method == WAYS[way].method.name


# -- thumb rules, to first order --------------------------------------------------------------------------------------------


def test_stereo_error_is_that_of_the_thumb_rule():
    found = planned(distance="5 m", way="stereo", focal="2000 px exact", baseline="1 m exact", pixel_error="0.1 px (1s)",
                    offset_error="0 px")  # fmt: skip
    assert found.answer.measured.u == pytest.approx(5**2 / (2000 * 1) * 0.1, rel=1e-3)


def test_known_size_error_is_that_of_the_thumb_rule():
    found = planned(
        distance="10 m",
        way="known_size",
        focal="2000 px exact",
        size="2 m exact",
        tilt="0 exact",
        pixel_error="0.5 px (1s)",
    )
    assert found.answer.measured.u == pytest.approx(10**2 / (2000 * 2) * 0.5 * math.sqrt(2), rel=1e-3)


def test_ground_error_is_that_of_the_thumb_rule():
    found = planned(distance="10 m", way="ground", focal="2000 px exact", height="2 m exact", pitch_error="0.01 deg (1s)",
                    roll_error="0 deg", slope="0 exact", pixel_error="0 px")  # fmt: skip
    pitch = next(line.u for line in found.answer.measured.budget if line.name == "pitch")
    assert abs(pitch) == pytest.approx((10**2 + 2**2) / 2 * math.radians(0.01), rel=1e-3)


def test_ground_sampling_is_height_over_focal_length():
    found = planned(distance="10 m", way="drone", focal="2000 px exact", height="50 ± 0.1 m")
    assert found.sampling.value == pytest.approx(50 / 2000, rel=1e-6)


# -- what is solved for -----------------------------------------------------------------------------------------------------


OPTION = {
    "focal": lambda x: {"focal": f"{x!r} px ± 0.2 %"}, "size": lambda x: {"size": f"{x!r} m ± 0.1 %"},
    "width-px": lambda x: {"width_px": f"{x:.0f}", "focal": f"{2900 * x / 4000!r} px ± 0.2 %"},
    "focal-error": lambda u: {"focal": f"2900 ± {u!r} px (1s)"}, "size-error": lambda u: {"size": f"1 m ± {u!r} m (1s)"},
    "tilt-error": lambda u: {"tilt": f"0 ± {math.degrees(u)!r} deg (1s)"}, "pixel-error": lambda u: {"pixel_error": f"{u!r} px (1s)"},
    "distance": lambda x: {"distance": f"{x!r} m"},
}  # fmt: skip


@pytest.mark.parametrize("key", OPTION)
def test_what_is_solved_for_reaches_it_and_a_little_less_does_not(key):
    said = {"distance": "10 m", "accuracy": "10 cm", "way": "known_size", "focal": "2900 px ± 0.2 %", "size": "1 m ± 0.1 %",
            "tilt": "0 ± 2 deg" if key == "tilt-error" else "0 exact", "pixel_error": "1 px"}  # fmt: skip
    one = solution(planned(solve=[key], **said), key)
    assert one.reached
    edge, beyond = (one.low, 0.97) if one.low is not None and key not in ("distance",) else (one.high, 1.03)
    assert planned(**{**said, **OPTION[key](edge)}).reached
    assert not planned(**{**said, **OPTION[key](beyond * edge)}).reached


def test_where_the_size_itself_is_the_limit_no_lens_helps():
    found = planned(
        distance="20 m", accuracy="5 cm", way="known_size", size="1.75 ± 0.03 m", tilt="0 exact", focal="3000 px exact"
    )
    one = solution(found, "focal")
    assert not one.reached
    assert one.limit == "size"
    assert one.limit_half_width_m == pytest.approx(0.03 / 1.75 * 20, rel=0.01)
    assert solution(found, "size").reached  # a larger thing known to the same 3 cm
    text = run("--distance", "20 m", "--accuracy", "5 cm", "--way", "known_size", "--size", "1.75 ± 0.03 m", "--tilt", "0 exact",
               "--focal", "3000 px exact").output  # fmt: skip
    assert re.search(r"focal length +none: at best ±0\.3\d m, near .*; ±0\.34 m by size alone", text)


def test_a_doubt_said_in_per_cent_goes_with_its_value_and_one_in_metres_stays():
    said = {
        "distance": "20 m",
        "accuracy": "20 cm",
        "way": "known_size",
        "tilt": "0 exact",
        "focal": "6000 px exact",
        "solve": ["size"],
    }
    assert solution(planned(size="1 m ± 2 cm", **said), "size").reached
    assert not solution(planned(size="1 m ± 2 %", **said), "size").reached


def test_shared_out_doubts_reach_it():
    said = {
        "distance": "20 m",
        "accuracy": "5 cm",
        "way": "known_size",
        "focal": "3000 ± 60 px",
        "size": "1 m ± 2 cm",
        "tilt": "0 ± 5 deg",
    }
    found = planned(**said)
    assert not found.reached
    u = {one.title: one.u for one in found.shares}
    better = planned(**{**said, "focal": f"3000 ± {u['focal length']} px (1s)", "size": f"1 m ± {u['size of the object']} m (1s)",
                        "tilt": f"0 ± {math.degrees(u['tilt of the object'])} deg (1s)",
                        "pixel_error": f"{u['pixel positions']} px (1s)"})  # fmt: skip
    assert better.reached
    assert better.answer.half_width_m > 0.03  # not better than it need be
    lines = [line.share for line in better.answer.measured.budget[:4]]
    assert max(lines) < 0.4


def test_a_longer_baseline_with_a_better_calibration_reaches_what_neither_does():
    said = {
        "distance": "20 m",
        "accuracy": "5 cm",
        "way": "stereo",
        "focal": "3000 px ± 0.4 %",
        "baseline": "12 cm ± 0.4 %",
    }
    found = planned(**said)
    assert not any(one.reached for one in found.solutions if one.key != "distance")
    together, u = found.combined.solution, {one.key: one.u / one.value for one in found.combined.shares}
    assert set(u) == {"focal", "baseline"}
    better = {
        "focal": f"3000 px ± {100 * HALF_WIDTH_95 * u['focal']} %",
        "baseline": f"{together.low} m ± {100 * HALF_WIDTH_95 * u['baseline']} %",
    }  # fmt: skip
    assert planned(**{**said, **better}).reached
    assert not planned(**{**said, **better, "baseline": f"{0.9 * together.low} m ± 0.1 %"}).reached


def test_where_one_change_is_enough_no_other_is_asked_for():
    found = planned(distance="20 m", accuracy="40 cm", way="stereo", baseline="20 cm ± 0.1 %")
    assert not found.reached
    assert solution(found, "baseline").reached
    assert found.combined is None


def test_a_disparity_that_is_not_resolved_is_told_with_what_resolves_it():
    said = {"distance": "2000 m", "accuracy": "100 m", "way": "stereo"}
    found = planned(baseline="20 cm ± 0.1 %", **said, solve=["baseline"])
    assert found.answer.measured is None
    assert "3 are needed" in found.answer.reason
    assert found.reached is False
    baseline_m = solution(found, "baseline").low
    assert planned(baseline=f"{baseline_m} m ± 0.1 %", **said, solve=["baseline"]).reached
    assert (
        "no answer"
        in run(*(f"--{key}={text}" for key, text in said.items()), "--baseline=20 cm ± 0.1 %").output.splitlines()[0]
    )


def test_accuracies_are_read_as_the_house_reads_a_doubt():
    assert wanted_of("5 cm", 20.0).half_width_m == pytest.approx(0.05)
    assert wanted_of("± 5 cm", 20.0).half_width_m == pytest.approx(0.05)
    assert wanted_of("5 cm (1s)", 20.0).half_width_m == pytest.approx(0.05 * HALF_WIDTH_95)
    assert wanted_of("1 %", 20.0).half_width_m == pytest.approx(0.2)
    assert wanted_of("1 %", 20.0).at(40.0) == pytest.approx(0.4)
    assert wanted_of("2 in", 20.0).half_width_m == pytest.approx(0.0508)


def test_without_a_way_all_that_fit_what_is_said_are_planned():
    assert [way.name for way in ways_of(PlanTexts("20 m"))] == list(WAYS)
    assert [way.name for way in ways_of(PlanTexts("20 m", height="2 ± 0.1 m"))] == ["ground", "drone"]
    found = plan(
        PlanTexts("20 cm"), between="10 cm to 1 m"
    )  # the ground at 20 cm lies below the picture's middle, and is seen
    assert {p.way for p in found} == set(WAYS)
    assert all(p.answer.measured is not None or p.notes[0].code == "refused" for p in found)


def test_what_is_assumed_is_said():
    found = planned(distance="20 m", way="stereo", baseline="30 ± 0.1 cm")
    assert {e.key for e in found.entries if e.assumed} == {"focal", "sensor", "width-px", "offset", "pixel"}
    assert "setup_assumed" in [note.code for note in found.notes]


def test_the_cure_is_that_of_reports():
    found = planned(distance="20 m", way="stereo")
    assert found.improve.startswith("disparity makes")
    assert "set the cameras farther apart" in found.improve


def test_rows_without_an_answer_have_a_reason():
    found = planned(distance="10 m", way="known_size", size="1 m ± 1 %", between="1 m to 100 m")
    small = [row for row in plan(PlanTexts("10 m", way="known_size"), between="10 cm to 1 m")[0].rows if row.reason]
    assert small
    assert all("does not fit" in row.reason and row.half_width_m is None for row in small)
    assert [row.distance_m for row in found.rows] == [1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0]


# -- the command ------------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def validator(request):
    schema = json.loads((request.config.rootpath / "docs" / "plan-schema.json").read_text())
    Draft202012Validator.check_schema(schema)
    return Draft202012Validator(schema)


@pytest.mark.parametrize("words", [
    ("--way", "known_size", "--tilt", "0 ± 2 deg", "--accuracy", "3 %"),
    ("--way", "ground", "--accuracy", "50 cm", "--height", "4 ± 0.02 m", "--solve", "height"),
    ("--way", "stereo", "--accuracy", "1 cm"),
    ("--way", "drone", "--height", "30 ± 0.3 m", "--accuracy", "5 cm (1s)", "--solve", "height", "--solve", "focal-error"),
    ("--way", "ground", "--height", "20 cm exact"),
])  # fmt: skip
def test_json_obeys_the_schema(validator, words):
    result = run("--distance", "8 m", *words, "--format", "json")
    assert result.exit_code == 0, result.output
    document = json.loads(result.output, parse_constant=lambda name: pytest.fail(f"{name} in the JSON"))
    validator.validate(document)
    assert not validator.is_valid({**document, "plans": [{**document["plans"][0], "extra": 1}]})
    if "--accuracy" in words:
        assert document["plans"][0]["solutions"]


@pytest.mark.parametrize(("words", "says"), [
    (("--distance", "20"), "--distance is '20'; give it with its unit"),
    (("--distance", "0 m"), "--distance is '0 m'"),
    (("--distance", "-3 m"), "--distance is '-3 m'"),
    (("--distance", "1e300 m"), "--distance is '1e300 m'"),
    (("--distance", "20 m", "--accuracy", "0 cm"), "--accuracy is '0 cm'; nothing is known exactly"),
    (("--distance", "20 m", "--accuracy", "5"), "--accuracy is '5'; give it with its unit"),
    (("--distance", "20 m", "--accuracy", "-5 cm"), "--accuracy is '-5 cm'"),
    (("--distance", "20 m", "--accuracy", "5 px"), "--accuracy is '5 px'"),
    (("--distance", "20 m", "--accuracy", "1e-300 m"), "--accuracy is '1e-300 m'"),
    (("--distance", "20 m", "--accuracy", "5 cm (limits)"), "give the half-width of a 95 % interval"),
    (("--distance", "20 m", "--way", "fly"), "--way is 'fly'; known are known_size"),
    (("--distance", "20 m", "--way", "stereo", "--accuracy", "5 cm", "--solve", "size"), "--solve is 'size'"),
    (("--distance", "20 m", "--solve", "focal"), "say what is to be reached"),
    (("--distance", "20 m", "--way", "stereo", "--size", "1 m"), "belongs to the way known_size"),
    (("--distance", "1 cm", "--way", "stereo"), "nothing is in both pictures; the nearest is"),
    (("--distance", "2 mm", "--way", "known_size"), "the nearest is beyond"),
    (("--distance", "20 cm", "--way", "known_size"), "does not fit into the picture"),
    (("--distance", "20 m", "--focal", "8 mm"), "--sensor is missing"),
    (("--distance", "20 m", "--focal", "-8 mm", "--sensor", "5 mm"), "--focal is '-8 mm'"),
    (("--distance", "20 m", "--pixel-error", "-1 px"), "--pixel-error is '-1 px'"),
    (("--distance", "20 m", "--pitch", "-5 ± 1 deg", "--pitch-error", "1 deg"), "--pitch has its ± already"),
    (("--distance", "20 m", "--way", "ground", "--pitch", "40 ± 1 deg"), "does not fit into the picture"),
    (("--distance", "20 m", "--width-px", "3.5"), "--width-px is '3.5'"),
    (("--distance", "20 m", "--between", "5 m to 1 m"), "--between is '5 m to 1 m'"),
    (("--distance", "20 m", "--chart", "plan.gif"), "--chart is 'plan.gif'; name a .png or .svg file"),
    (("--distance", "20 m", "--slope", "3 ± 1 deg"), "planning is for level ground"),
    (("--distance", "20 m", "--baseline", "12"), "--baseline is '12'; give it with its unit"),
])  # fmt: skip
def test_impossible_input_is_one_line(words, says):
    result = run(*words)
    assert result.exit_code in (2, 3)
    assert result.output.startswith("subtense: ")
    assert result.output.count("\n") == 1
    assert says in result.output


def test_the_text_says_it_all():
    text = run("--distance", "20 m", "--accuracy", "50 cm", "--way", "stereo", "--baseline", "20 cm ± 0.1 %").output
    assert text.startswith("two cameras side by side: depth 20 m   95 %: ±0.")
    assert "not reached" in text.splitlines()[0]
    assert re.search(r"\n  baseline +20\d mm \(29\.\d px in the picture\) to \d+\.\d m; at 20 m nothing", text)
    assert re.search(r"\n  20 m +\d\d(\.\d)? px +0\.\d\d m +±0\.\d\d m +\d\.\d % +disparity \d\d %\n", text)
    assert max(map(len, text.splitlines())) <= 130


def test_several_ways_are_compared_first():
    text = run("--distance", "20 m", "--height", "5 ± 0.05 m", "--solve", "height", "--accuracy", "1 m").output
    assert re.match(r"way +what it measures +± \(95 %\) +wanted\nground .*\ndrone ", text)


@pytest.mark.parametrize(("ending", "begins"), [("png", b"\x89PNG"), ("svg", b"<?xml")])
def test_charts_are_the_same_each_time(tmp_path, ending, begins):
    pytest.importorskip("matplotlib")
    files = [tmp_path / f"{n}.{ending}" for n in "ab"]
    for file in files:
        assert (
            run(
                "--distance",
                "20 m",
                "--way",
                "stereo",
                "--accuracy",
                "50 cm",
                "--solve",
                "distance",
                "--chart",
                str(file),
            ).exit_code
            == 0
        )
    first, second = (file.read_bytes() for file in files)
    assert first.startswith(begins)
    assert first == second


def test_a_chart_without_matplotlib_names_the_extra(monkeypatch, tmp_path):
    monkeypatch.setitem(__import__("sys").modules, "matplotlib", None)
    with pytest.raises(MissingExtraError, match=r"subtense\[plots\]"):
        plan_chart.write(plan(PlanTexts("20 m", way="stereo"), curve=True), tmp_path / "a.png")


def test_python_raises_what_the_command_prints():
    with pytest.raises(GeometryError):
        plan(PlanTexts("1 cm", way="stereo"))
    with pytest.raises(InputError):
        plan(PlanTexts("20 m", accuracy="0 m"))
    assert isinstance(setup_of(WAYS["stereo"], PlanTexts("20 m"), 20.0).entries["baseline"].quantity, Quantity)
