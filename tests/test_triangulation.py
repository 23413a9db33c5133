"""Points and lengths from pictures whose places are known: exact scenes, truth by simulation, doubts and refusals."""

import json

import cv2
import numpy as np
import pytest
from click.testing import CliRunner

from subtense import propagate
from subtense.camera import Camera
from subtense.cli import main
from subtense.errors import GeometryError, InputError
from subtense.geometry import rotation_from_vector
from subtense.methods import triangulation
from subtense.methods.triangulation import CAMERAS, LENGTH, METHOD, CamerasInputs, Inputs, LengthInputs, seen_by
from subtense.observation import Observation
from subtense.quantity import Quantity
from subtense.views import Track, Views

pytestmark = pytest.mark.opencv

LENS = {"lens": "brown_conrady", "distortion": np.array([-0.1, 0.02, 1e-3, -5e-4, 0])}
CAMERA = Camera(1600, 1200, 1500.0, 805.0, 590.0, 1.01, cov=np.diag([36.0, 1e-8, 9, 9, 1e-5, 0, 0, 0, 0]), **LENS)
TURNS = rotation_from_vector(np.array([[0.02, 0.01, -0.03], [0.0, 0.1, 0.0], [-0.1, 0.05, 0.2]]))
PLACES = np.array([[0.1, 0.0, 0.2], [0.6, 0.05, 0.1], [0.4, -0.4, 0.0]])
POINT, OTHER = np.array([0.4, -0.3, 4.2]), np.array([-0.5, 0.2, 4.8])


def views(camera=CAMERA, u_turn=3e-4, u_place=1e-3, **more):
    return Views.independent(
        ("a", "b", "c"), (camera,), TURNS, PLACES, u_rotation_rad=u_turn, u_centre_m=u_place, **more
    )


def measured(inputs, method=METHOD):
    return {m.what: m for m in propagate.measure(method, inputs)}


@pytest.mark.parametrize("names", [("a", "b"), ("b", "c"), ("c", "a", "b")])
def test_an_exact_scene(names):
    found = measured(Inputs(views(), seen_by(views(), POINT, 0.3, names)))
    first = views().index(names[0])
    own = TURNS[first] @ (POINT - PLACES[first])
    assert found["range"].value == pytest.approx(np.linalg.norm(own), rel=1e-9)
    assert found["depth"].value == pytest.approx(own[2], rel=1e-9)
    assert [found[f"position_{k}"].value for k in "xyz"] == pytest.approx(POINT, abs=1e-8)
    assert found["range"].notes == ()


def test_agrees_with_opencv_on_noisy_pixels():
    pinhole = Camera(1600, 1200, 1500.0, 799.5, 599.5)
    known = views(pinhole, 0, 0)
    track = seen_by(known, POINT, 0.5, ("a", "b"))
    noisy = Track(track.names, Observation(track.seen.points_px + np.array([[0.0, 0.3], [0.0, -0.3]]), 0.5))
    found = triangulation.triangulation(Inputs(known, noisy), triangulation.start(Inputs(known, noisy)))
    p = [pinhole.matrix @ np.column_stack([TURNS[i], -TURNS[i] @ PLACES[i]]) for i in (0, 1)]
    x = cv2.triangulatePoints(p[0], p[1], *(noisy.seen.points_px[i][:, None] for i in (0, 1)))
    assert [found.x_m, found.y_m, found.z_m] == pytest.approx((x[:3] / x[3])[:, 0], abs=2e-3)


def test_any_lens_will_do():
    sphere = Camera(2000, 1000, 2000 / (2 * np.pi), 999.5, 499.5, lens="equirectangular")
    behind = np.array([0.5, 0.3, -3.0])
    known = views(sphere, 0, 0)
    found = measured(Inputs(known, seen_by(known, behind, 0.3)))
    assert [found[f"position_{k}"].value for k in "xyz"] == pytest.approx(behind, abs=1e-6)


def test_a_baseline_is_the_distance_of_the_first_two_pictures():
    known = views(u_turn=0, u_place=0)
    apart = np.linalg.norm(PLACES[1] - PLACES[0])
    inputs = Inputs(known, seen_by(known, POINT, 0.1), Quantity.normal(2 * apart, 0.02 * apart, "m"))
    found = measured(inputs)
    assert found["range"].value == pytest.approx(2 * np.linalg.norm(POINT - PLACES[0]))
    line = next(c for c in found["range"].budget if c.name == "baseline")
    assert line.u == pytest.approx(0.01 * found["range"].value, rel=1e-3)


def test_a_common_scale_is_a_line_of_its_own():
    found = measured(LengthInputs(views(u_scale=0.02, u_turn=0, u_place=0), *ends()), LENGTH)["length"]
    line = next(c for c in found.budget if c.name == "scale")
    assert line.u == pytest.approx(0.02 * found.value, rel=1e-6)


def ends(sigma=0.3):
    return seen_by(views(), POINT, sigma, label="one"), seen_by(views(), OTHER, sigma, label="other")


def test_the_cameras_errors_are_common_to_both_ends():
    length = measured(LengthInputs(views(), *ends(0.01)), LENGTH)["length"]
    assert length.value == pytest.approx(np.linalg.norm(POINT - OTHER))
    apart = [measured(Inputs(views(), end))["position_z"].u for end in ends(0.01)]
    assert length.u < 0.5 * np.hypot(*apart)


def test_distance_of_cameras():
    found = measured(CamerasInputs(views(u_place=1e-3)), CAMERAS)["length"]
    assert found.value == pytest.approx(np.linalg.norm(PLACES[1] - PLACES[0]))
    assert found.u == pytest.approx(1e-3 * 2**0.5, rel=1e-3)


def simulated(rng, count):
    """Ranges and lengths of scenes with all errors as stated: normalised errors, and how often the interval holds the truth."""
    z, held = [], []
    for _ in range(count):
        true = views()
        track = [seen_by(true, p, 0.5) for p in (POINT, OTHER)]
        moved = [Track(t.names, Observation(t.seen.points_px + rng.normal(0, 0.5, (3, 2)), 0.5)) for t in track]
        told = Views.independent(("a", "b", "c"), (Camera(1600, 1200, 1500 + 6 * rng.standard_normal(), 805 + 3 * rng.standard_normal(),
                                 590 + 3 * rng.standard_normal(), 1.01, cov=CAMERA.cov, lens="brown_conrady",
                                 distortion=LENS["distortion"] + [10**-2.5 * rng.standard_normal(), 0, 0, 0, 0]),),
                                 rotation_from_vector(3e-4 * rng.standard_normal((3, 3))) @ TURNS,
                                 PLACES + 1e-3 * rng.standard_normal((3, 3)), u_rotation_rad=3e-4, u_centre_m=1e-3)  # fmt: skip
        one = measured(Inputs(told, moved[0]))["range"]
        length = measured(LengthInputs(told, *moved), LENGTH)["length"]
        for found, truth in ((one, np.linalg.norm(POINT - PLACES[0])), (length, np.linalg.norm(POINT - OTHER))):
            z.append((found.value - truth) / found.u)
            held.append(found.low <= truth <= found.high)
    return np.reshape(z, (count, 2)), np.reshape(held, (count, 2))


def test_truth_by_simulation():
    z, held = simulated(np.random.default_rng(3), 80)
    assert np.all(abs(z.mean(0)) < 3 / 80**0.5)
    assert np.all(abs(z.std(0) - 1) < 3 / 160**0.5)
    assert np.all(abs(held.mean(0) - 0.95) < 3 * (0.95 * 0.05 / 80) ** 0.5)


def far(distance, sigma=0.5):
    pinhole = Camera(1600, 1200, 1500.0, 799.5, 599.5)
    known = Views.independent(("a", "b"), (pinhole,), np.stack([np.eye(3)] * 2), np.array([[0.0, 0, 0], [0.5, 0, 0]]))
    return known, seen_by(known, np.array([0.3, 0.2, distance]), sigma)


def test_small_parallax_is_noted_and_its_interval_open():
    near, distant = measured(Inputs(*far(60.0)))["range"], measured(Inputs(*far(1000.0)))["range"]
    assert [n.code for n in near.notes] == ["small_parallax"]
    assert near.high - near.value > near.value - near.low
    assert distant.high is None and {n.code for n in distant.notes} >= {"small_parallax", "open_interval"}


def test_lines_of_sight_that_part_are_refused():
    known, track = far(60.0)
    parted = Track(track.names, Observation(track.seen.points_px + np.array([[0.0, 0], [14, 0]]), 5.0))
    with pytest.raises(GeometryError) as error:
        measured(Inputs(known, parted))
    assert error.value.code == "parallel_rays"
    wrong = Track(track.names, Observation(track.seen.points_px + np.array([[0.0, 0], [400, 0]]), 0.5))
    with pytest.raises(GeometryError) as error:
        measured(Inputs(known, wrong))
    assert error.value.code == "behind_camera"


def test_one_place_tells_no_distance():
    pinhole = Camera(1600, 1200, 1500.0, 799.5, 599.5)
    known = Views.independent(("a", "b"), (pinhole,), TURNS[:2], np.zeros((2, 3)))
    with pytest.raises(GeometryError) as error:
        measured(Inputs(known, seen_by(known, POINT, 0.5)))
    assert error.value.code == "no_baseline"


def test_another_point_is_noted():
    known, track = views(), seen_by(views(), POINT, 0.3)
    wrong = track.seen.points_px + np.array([[0.0, 0], [0, 0], [0, 12]])
    codes = {n.code for n in measured(Inputs(known, Track(track.names, Observation(wrong, 0.3))))["range"].notes}
    assert "rays_disagree" in codes
    # what the places' doubt allows is no disagreement
    loose = views(u_turn=0.01)
    assert measured(Inputs(loose, Track(track.names, Observation(wrong, 0.3))))["range"].notes == ()


def test_false_alarms_are_rare():
    rng, alarms = np.random.default_rng(5), 0
    for _ in range(200):
        track = seen_by(views(), POINT, 0.5)
        noisy = Track(track.names, Observation(track.seen.points_px + rng.normal(0, 0.5, (3, 2)), 0.5))
        inputs = Inputs(views(u_turn=0, u_place=0), noisy)
        alarms += bool(triangulation.notes(inputs, None))
    assert alarms <= 1


def test_texts_and_json():
    known = Views.parse("1600x1200, f=1500 ± 10 px | a.jpg 0,0,0 | b.jpg 0.5,0,0 ± 1mm")
    assert known.names == ("a.jpg", "b.jpg") and known.covariance[9, 9] == pytest.approx((1e-3 / 1.96) ** 2, rel=1e-3)
    again = Views.from_json(json.loads(json.dumps(known.to_json())))
    assert again.digest == known.digest and np.array_equal(again.covariance, known.covariance)
    track = Track.parse("C:a.jpg:120,80; b.jpg:95,82 ± 0.5px")
    assert track.names == ("C:a.jpg", "b.jpg") and Track.from_json(track.to_json()).digest == track.digest
    for text in ("", "a.jpg", "a.jpg:1", "a.jpg:1,2; a.jpg:3,4", "a:nan,2;b:1,2"):
        with pytest.raises(InputError):
            Track.parse(text)
    for text in (
        "",
        "1600x1200, f=1500 ± 10 px | a 0,0,0",
        "1600x1200, f=1500 ± 10 px | a 0,0,0 | a 1,0,0",
        "x | a 0,0,0 | b 1,0",
    ):
        with pytest.raises(InputError):
            Views.parse(text)


def test_a_subset_keeps_the_joint_covariance():
    rng = np.random.default_rng(1)
    root = rng.normal(0, 1e-4, (27, 40))
    known = Views(("a", "b", "c"), (CAMERA,), TURNS, PLACES, cov=root @ root.T)
    track = seen_by(known, POINT, 0.3, ("c", "a"))
    whole, part = (measured(Inputs(v, track))["range"] for v in (known, known.subset(("c", "a"))))
    assert part.u == pytest.approx(whole.u, rel=1e-3) and part.value == pytest.approx(whole.value)


def run(*words):
    return CliRunner().invoke(main, ["triangulate", *map(str, words)], catch_exceptions=False)


def test_a_rendered_pair_by_its_slider(examples, truth):
    seen = truth["stereo_left.jpg"]["objects"][0]["points"][:2]
    words = [w for p in seen for w in ("--point", "stereo_left.jpg:{},{};stereo_right.jpg:{},{} ± 0.3px".format(
        *p["pixel_px"], *p["pixel_right_px"]))]  # fmt: skip
    pair = [examples / "stereo_left.jpg", examples / "stereo_right.jpg"]
    result = run(
        *pair,
        "--baseline",
        "120 ± 0.1 mm",
        "--turn",
        "0 ± 0.3 deg",
        "--camera",
        "f=1790 ± 6 px",
        *words,
        "--format",
        "json",
    )
    found = json.loads(result.output)["measurements"]
    length = next(m for m in found if m["what"] == "length")
    true = np.linalg.norm(np.subtract(seen[0]["world_m"], seen[1]["world_m"]))
    assert length["low"] < true < length["high"]
    for point, name in zip(seen, ("point 1", "point 2"), strict=True):
        one = next(m for m in found if m["label"] == name and m["what"] == "range")
        assert one["low"] < point["range_m"] < one["high"]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ((), "--views"),
        (("--views", "1600x1200, f=1500 ± 10 px | a 0,0,0 | b 0.5,0,0"), "--point"),
        (("--views", "1600x1200, f=1500 ± 10 px | a 0,0,0 | b 0.5,0,0", "--point", "a:1,2;c:3,4"), "known are a, b"),
        (("--views", "1600x1200, f=1500 ± 10 px | a 0,0,0 | b 0.5,0,0", "--point", "a:1,2;b:9999,4"), "1600 x 1200"),
        (("--views", "1600x1200, f=1500 ± 10 px | a 0,0,0 | b 0.5,0,0", "--point", "a:1,2"), "two pictures"),
        (("--views", "@nowhere.json", "--point", "a:1,2;b:3,4"), "no such file"),
        (("{examples}/belt.jpg",), "--baseline"),
        (("{examples}/belt.jpg", "--baseline", "1 m ± 1mm"), "two pictures"),
        (("{examples}/belt.jpg", "{examples}/facade.jpg", "--baseline", "1 m ± 1mm"), "one size"),
        (("{examples}/stereo_left.jpg", "{examples}/stereo_right.jpg", "--baseline", "1", "--point", "x:1,2;y:3,4"), "--baseline"),
        (("{examples}/stereo_left.jpg", "{examples}/stereo_right.jpg", "--baseline", "1 m ± 1mm", "--slide", "0,0,0"), "--slide"),
    ],
)  # fmt: skip
def test_one_line_says_what_is_wrong(examples, words, said):
    result = run(*(word.replace("{examples}", str(examples)) for word in words))
    assert result.exit_code in (2, 3) and said in result.stderr and len(result.stderr.splitlines()) == 1
