"""Snapping and callipers on edges with exact truth."""

import contextlib
import dataclasses
import json
import sys
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

sys.path.insert(0, str(Path(__file__).parent / "synthetic"))
import sheet_scenes as scenes

from subtense import InputError, NothingFoundError, Photo, Quantity
from subtense.cli import main
from subtense.corners import corners_near
from subtense.detection import unknown_curve
from subtense.edges import edges_across, snap, width_along
from subtense.observation import Observation
from subtense.workflow.snap import snapped

pytestmark = pytest.mark.opencv
SRGB = Quantity.exact(2.2, "1")
MIDDLE = np.array([60.3, 59.6])


def normal(angle):
    return np.array([np.cos(angle), np.sin(angle)])


def measured(photo, width, angle, rng, curve):
    """Error of the width across the bar, and its u: the line is clicked a few px and degrees off."""
    n, d = normal(angle), normal(angle + rng.uniform(-0.1, 0.1))
    ends = MIDDLE + np.outer([-0.5, 0.5], d) * width / (d @ n) + rng.normal(0, 1.5, (2, 2))
    seen = width_along(photo, Observation(ends), curve=curve)
    jac = np.concatenate([-n, n]) * np.sign((seen.points_px[1] - seen.points_px[0]) @ n)
    return abs((seen.points_px[1] - seen.points_px[0]) @ n) - width, float(np.sqrt(jac @ seen.cov @ jac))


@pytest.mark.parametrize("inverted", [False, True], ids=["bright", "dark"])
@pytest.mark.parametrize(("blur", "noise", "dark", "light"), [
    (0.5, 2, 20, 220), (1.0, 8, 40, 200), (2.0, 2, 20, 220), (2.0, 8, 60, 200), (1.0, 2, 100, 130), (0.5, 8, 100, 130),
])  # fmt: skip
def test_widths_are_unbiased_where_the_curve_is_told(blur, noise, dark, light, inverted):
    """Located in encoded values, the bar of blur 2 px would be 2.5 px too wide or too narrow."""
    errors, u = [], []
    for seed in range(5):
        rng = np.random.default_rng(seed)
        width, angle = rng.uniform(30, 45), rng.uniform(0, 2 * np.pi)
        photo = scenes.bar(width, angle, blur=blur, noise=noise, dark=dark, light=light, seed=seed, inverted=inverted)
        error, own = measured(photo, width, angle, rng, SRGB)
        errors.append(error)
        u.append(own)
    assert np.max(np.abs(errors) / u) < 3
    assert abs(np.mean(errors)) < 0.05 + 0.9 * np.mean(u) / 5**0.5


@pytest.mark.parametrize(("blur", "noise", "dark", "light"), [(1.2, 6, 60, 190), (0.6, 3, 100, 130)])
def test_the_noise_of_an_edge_is_as_stated(blur, noise, dark, light):
    """At 40 places of one edge, the noise's own part of u, without what is added for real pictures."""
    n, middle = normal(0.1), np.array([30.0, 240.0])
    photo = scenes.bar(40.0, 0.1, blur=blur, noise=noise, dark=dark, light=light, size=480, middle=middle)
    off = []
    for k in range(-20, 21):
        place = middle + 20 * n + 10.0 * k * np.array([-n[1], n[0]])
        found = edges_across(photo, place + 0.7 * n, n, radius_px=6, curve=SRGB)
        off += [(found[0].point_px - place) @ n / found[0].noise_px] if found else []
    assert len(off) >= 39
    assert np.std(off) == pytest.approx(1.0, abs=0.25)  # of 40, known to 0.11
    assert abs(np.mean(off)) < 0.6


@pytest.mark.parametrize("inverted", [False, True], ids=["bright", "dark"])
def test_an_unknown_curve_is_in_the_joint_covariance(inverted):
    """Both edges move out or in together; over curves drawn as stated, normalised errors are about 1."""
    z = []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        exponent = float(np.clip(rng.normal(2.2, 0.5), 1.0, 3.5))
        width, angle = rng.uniform(30, 45), rng.uniform(0, 2 * np.pi)
        photo = scenes.bar(width, angle, blur=1.5, exponent=exponent, seed=seed, inverted=inverted)
        error, own = measured(photo, width, angle, rng, None)
        z.append(error / own)
    assert np.max(np.abs(z)) < 2.5
    assert 0.4 < np.std(z) < 1.3


def test_covariance_of_a_width_is_joint():
    photo = scenes.bar(40.0, 0.0, blur=1.5)
    seen = width_along(photo, Observation(np.array([[40.0, 60.0], [80.0, 60.0]])))
    assert seen.cov.shape == (4, 4) and np.linalg.eigvalsh(seen.cov).min() > 0
    assert seen.cov[0, 2] < -0.05  # one end to the left, the other to the right
    told = width_along(photo, Observation(np.array([[40.0, 60.0], [80.0, 60.0]])), curve=SRGB)
    assert abs(told.cov[0, 2]) < 1e-6


def test_an_end_on_a_slanted_edge_is_as_doubtful_as_the_line_s_place():
    photo = scenes.bar(40.0, 0.5)
    d = np.array([1.0, 0.0])
    ends = MIDDLE + np.outer([-20 / np.cos(0.5), 20 / np.cos(0.5)], d)
    seen = width_along(photo, Observation(ends, 2.0), curve=SRGB)
    assert np.sqrt(seen.cov[0, 0]) == pytest.approx(2.0 * np.tan(0.5), rel=0.05)


@pytest.mark.parametrize(("blur", "noise", "dark", "light"), [(0.5, 2, 20, 220), (1.0, 8, 60, 180), (2.0, 2, 60, 140)])
@pytest.mark.parametrize("inverted", [False, True], ids=["bright", "dark"])
def test_corners_are_where_their_edges_meet(blur, noise, dark, light, inverted):
    chi2, noise_chi2 = [], []
    for seed in range(6):
        rng = np.random.default_rng(seed)
        photo = scenes.wedge(rng.uniform(0, 6.28), np.radians(rng.uniform(50, 130)), blur=blur, noise=noise, dark=dark,
                             light=light, seed=seed, inverted=inverted)  # fmt: skip
        truth = np.array([55.3, 54.6])
        corner = corners_near(photo, truth + rng.normal(0, 2, 2), radius_px=10, curve=SRGB)[0]
        off = corner.point_px - truth
        chi2.append(off @ np.linalg.solve(corner.whole_cov, off) / 2)
        rendered = 0.015**2 * np.eye(2)  # to which pixels that are boxes follow the model of a round blur
        noise_chi2.append(off @ np.linalg.solve(corner.noise_cov + rendered, off) / 2)
    assert np.max(chi2) < 5
    assert np.mean(noise_chi2) < 2.6  # of 12 numbers: 1 ± 0.4


def test_a_corner_and_an_edge_are_snapped_to():
    photo = scenes.wedge(0.2, 1.4)
    corner = snap(photo, (57.0, 52.0), curve=SRGB)
    assert corner.points_px[0] == pytest.approx([55.3, 54.6], abs=0.15) and corner.cov.shape == (2, 2)
    on_edge = np.array([55.3, 54.6]) + 25 * normal(0.2)
    edge = snap(photo, np.add(on_edge, (1.0, 4.0)), direction=(0, 1), curve=SRGB)
    across = np.array([-np.sin(0.2), np.cos(0.2)])
    assert (edge.points_px[0] - [55.3, 54.6]) @ across == pytest.approx(0, abs=0.15)
    assert edge.points_px[0, 0] == pytest.approx(on_edge[0] + 1.0)


@pytest.mark.parametrize("noise", [0, 3, 12])
def test_nothing_is_found_in_nothing(noise):
    blank = scenes.photo_of(np.full((120, 160), 0.5), 1, noise)
    for direction in (None, (1.0, 0.0)):
        with pytest.raises(NothingFoundError, match=r"drawn.png at 50.0,60.0: no (corner|edge)"):
            snap(blank, (50.0, 60.0), direction)
    with pytest.raises(NothingFoundError, match="no edge within"):
        width_along(blank, Observation(np.array([[30.0, 30.0], [90.0, 80.0]])))


@given(st.integers(1, 20), st.integers(1, 20), st.floats(0, 1), st.floats(0, 1), st.integers(0, 3))
def test_no_picture_and_no_place_breaks_it(width, height, x, y, seed):
    pixels = np.random.default_rng(seed).random((height, width))
    photo = scenes.photo_of(pixels, seed, 0)
    point = (x * (width - 1), y * (height - 1))
    for direction in (None, (0.3, 1.0)):
        with contextlib.suppress(NothingFoundError):
            assert np.all(np.isfinite(snap(photo, point, direction).points_px))


@pytest.mark.parametrize(
    ("point", "direction", "radius"),
    [((500, 5), None, None), ((5, float("nan")), None, None), ((5, 5), (0, 0), None), ((5, 5), None, 1e9)],
)
def test_what_can_not_be_used_is_said_in_a_line(point, direction, radius):
    photo = scenes.photo_of(np.full((120, 160), 0.5), 1, 2)
    with pytest.raises(InputError) as error:
        snap(photo, point, direction, radius_px=radius)
    assert "\n" not in str(error.value)


# -- lines that a person marked ------------------------------------------------------------------------


def test_a_line_along_a_side_ends_in_the_corners():
    photo, corners, _, _ = scenes.sheet(tilt=0, turn=5, distance_m=0.9)
    seen, notes = snapped(photo, Observation(np.add(corners[:2], ((2.0, 1.5), (-2.0, -1.0)))), SRGB)
    assert seen.points_px == pytest.approx(corners[:2], abs=0.2)
    assert [note.code for note in notes] == ["snapped"]


def test_a_line_across_a_thing_ends_on_its_edges_and_a_rival_is_noted():
    photo = scenes.bar(20.0, 0.0, middle=(60.0, 59.6))
    seen, notes = snapped(photo, Observation(np.array([[52.0, 60.0], [68.5, 60.0]])), SRGB)
    assert seen.points_px[:, 0] == pytest.approx([50.0, 70.0], abs=0.1) and [n.code for n in notes] == ["snapped"]
    beside = scenes.bar(4.0, 0.0, middle=(76.0, 59.6))
    two = dataclasses.replace(photo, pixels=np.maximum(photo.pixels, beside.pixels))
    seen, notes = snapped(two, Observation(np.array([[51.0, 60.0], [71.0, 60.0]])), SRGB)
    assert seen.points_px[1, 0] == pytest.approx(70.0, abs=0.2)
    assert [n.code for n in notes] == ["snapped", "snap_ambiguous"]


def test_four_marked_points_are_snapped_to_corners():
    photo, corners, _, _ = scenes.sheet(tilt=20, turn=5, distance_m=0.9)
    seen, _ = snapped(photo, Observation(np.add(corners, ((1.5, 1.0), (-2, 1), (-1, -2), (1, 0)))), unknown_curve())
    assert seen.points_px == pytest.approx(corners, abs=0.3) and seen.cov.shape == (8, 8)
    assert np.linalg.eigvalsh(seen.cov).min() > 0


def test_the_command_line_snaps(examples):
    words = [
        "measure",
        str(examples / "belt.jpg"),
        "--line",
        "486,569,1014,571",
        "--size",
        "200 mm",
        "--format",
        "json",
    ]
    found = [json.loads(CliRunner().invoke(main, words + more, catch_exceptions=False).output)["measurements"][0]
             for more in ([], ["--snap"])]  # fmt: skip
    assert found[1]["given"]["ends"]["points_px"][0][0] == pytest.approx(483.65, abs=0.2)
    assert found[1]["given"]["ends"]["points_px"][1][0] == pytest.approx(1016.87, abs=0.2)
    assert "snapped" in [note["code"] for note in found[1]["notes"]]
    assert found[1]["u"] < found[0]["u"] * 1.01


def test_snapping_on_the_command_line_knows_the_curve(examples):
    """An unknown curve moves both ends out or in together; a linear picture's edges lie elsewhere, and are known better."""
    words = ["measure", str(examples / "belt.jpg"), "--line", "486,569,1014,571", "--size", "200 mm", "--snap"]

    def ends(*more: str):
        output = CliRunner().invoke(main, [*words, "--format", "json", *more], catch_exceptions=False).output
        return json.loads(output)["measurements"][0]["given"]["ends"]

    unknown, srgb, linear = ends(), ends("--curve", "srgb"), ends("--curve", "linear")
    assert unknown["cov"][0][2] < -0.005 and srgb["cov"][0][2] == 0 and srgb["cov"][0][0] < unknown["cov"][0][0]
    assert abs(linear["points_px"][0][0] - srgb["points_px"][0][0]) > 0.1
    bad = CliRunner().invoke(main, [*words, "--curve", "x"])
    assert bad.exit_code == 2 and "--curve" in bad.output


def test_the_command_line_says_that_there_is_no_edge(tmp_path):
    path = tmp_path / "gray.png"
    Image.new("RGB", (300, 200), "gray").save(path)
    words = ["measure", path, "--line", "50,50,150,50", "--size", "1 m", "--camera", "f=300px", "--snap"]
    result = CliRunner().invoke(main, [str(w) for w in words])
    assert result.exit_code == 3 and result.output.count("\n") == 1 and "no edge within" in result.output


def test_real_edges_of_a_step_are_found(shared_data):
    """The front edge of a stone step: by callipers a few px off, both ways along it, on one line."""
    photo = Photo.load(shared_data / "reference_object" / "step_card" / "stepA_1.jpg")
    places = [
        snap(photo, (x, 176 - 0.035 * x + dy), direction=(0, 1)).points_px[0] for x in (100, 300, 600) for dy in (-2, 2)
    ]
    x, y = np.array(places).T
    assert np.std(y - np.polyval(np.polyfit(x, y, 1), x)) < 1.5
