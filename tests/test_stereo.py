"""Stereo: methods against closed forms and simulated errors, pairs with exact truth, and pairs that are none."""

import contextlib
import dataclasses
import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from subtense import Photo, propagate
from subtense.camera import Camera
from subtense.errors import FileFormatError, GeometryError, InputError
from subtense.geometry import Pose, rotation_from_vector
from subtense.methods import stereo
from subtense.observation import Observation
from subtense.quantity import Quantity
from subtense.rig import Rig
from subtense.workflow.stereo import Asked, depth_of, match_pair, stereo_document

pytestmark = pytest.mark.opencv
EXAMPLES = Path(__file__).parent.parent / "examples"


def plain_rig(width=640, height=480, f=700.0, baseline=0.12, doffs=0.0, **u):
    cov = np.diag([u.get("u_f", 0.0) ** 2, 0, 0, 0])
    camera = Camera(width, height, f, (width - 1) / 2, (height - 1) / 2, cov=cov)
    return Rig.of_rectified(
        camera,
        Quantity.normal(baseline, u.get("u_baseline", 0.0), "m"),
        Quantity.normal(doffs, u.get("u_doffs", 0.0), "px"),
    )


def turned_rig():
    k = np.array([-0.25, 0.08, 0.001, -0.0006, 0.0])
    left, right = (Camera(640, 480, f, x, y, 1.002, "brown_conrady", k * s)
                   for f, x, y, s in ((530.0, 340.0, 235.0, 1.0), (540.0, 325.0, 248.0, 1.2)))  # fmt: skip
    turn = rotation_from_vector(np.array([0.02, -0.06, 0.03]))
    return Rig(left, right, Pose(turn, turn @ np.array([-0.11, 0.004, -0.007])), np.zeros((24, 24)))


def inputs(rig, disparity, u, spot=(400.0, 210.0)):
    return stereo.Inputs(
        rig=rig, spot=Observation(np.array([spot]), 0.0), disparity=Quantity.normal(disparity, u, "px", "stated")
    )


# -- the methods -------------------------------------------------------------------------------------------------------


def test_depth_of_a_rectified_pair_is_f_b_over_disparity_and_doffs():
    found = propagate.measure(stereo.METHOD, inputs(plain_rig(doffs=31.0), 20.0, 0.2))
    assert found[1].value == pytest.approx(700 * 0.12 / 51)
    ray = np.array([(400 - 319.5) / 700, (210 - 239.5) / 700, 1])
    assert found[0].value == pytest.approx(700 * 0.12 / 51 * np.linalg.norm(ray))


def test_any_rig_is_triangulated_exactly():
    rig, rng = turned_rig(), np.random.default_rng(1)
    points = np.column_stack([rng.uniform(-0.4, 0.4, 300), rng.uniform(-0.3, 0.3, 300), rng.uniform(0.8, 3.0, 300)])
    left, right = rig.left.project(points), rig.right.project(rig.right_from_left.apply(points))
    found = stereo.located(rig, left, left[:, 0] - right[:, 0])
    assert found == pytest.approx(points, abs=1e-7)


def test_the_interval_is_mapped_through_the_disparity():
    found = propagate.measure(stereo.METHOD, inputs(plain_rig(), 8.0, 0.8))[1]
    assert found.low == pytest.approx(84 / (8 + 1.96 * 0.8), rel=2e-3)
    assert found.high == pytest.approx(84 / (8 - 1.96 * 0.8), rel=2e-3)


def test_intervals_hold_the_truth_whatever_errs():
    u = {"f": 7.0, "baseline": 0.001, "doffs": 0.25}
    rng, hit, below = np.random.default_rng(2), 0, 0
    for _ in range(300):
        truth = rng.uniform(1.5, 9.0)
        f, base, doffs = (rng.normal(v, u[k]) for k, v in (("f", 700.0), ("baseline", 0.12), ("doffs", 0.0)))
        seen = f * base / truth - doffs + rng.normal(0, 0.3)
        rig = plain_rig(**{f"u_{name}": value for name, value in u.items()})
        depth = propagate.measure(stereo.METHOD, inputs(rig, seen, 0.3, (319.5, 239.5)), draws=4000)[1]
        low, high = depth.low, depth.high
        hit += low <= truth <= high
        below += truth < low
    assert 0.92 <= hit / 300 <= 0.98
    assert below <= 0.75 * (300 - hit) + 3


def test_a_disparity_below_three_u_is_refused_by_match_and_by_rig():
    with pytest.raises(GeometryError, match="farther than about") as error:
        propagate.measure(stereo.METHOD, inputs(plain_rig(), 2.0, 1.0))
    assert error.value.code == "disparity_not_resolved"
    with pytest.raises(GeometryError) as error:
        propagate.measure(stereo.METHOD, inputs(plain_rig(), -1.0, 0.1))
    assert error.value.code == "disparity_not_resolved"
    camera = Camera(640, 480, 700.0, 319.5, 239.5)
    doubtful = Rig.of_rectified(camera, Quantity.exact(0.12, "m"), Quantity.normal(0.0, 1.0, "px"))
    with pytest.raises(GeometryError):
        propagate.measure(stereo.METHOD, inputs(doubtful, 2.5, 0.1))


def test_a_length_shares_the_rig_s_error():
    camera = Camera(640, 480, 700.0, 319.5, 239.5)
    rig = Rig.of_rectified(camera, Quantity.normal(0.12, 0.0012, "m"), Quantity.exact(0.0, "px"))
    ends = Observation(np.array([[200.0, 240.0], [500.0, 240.0]]), 0.0)
    exact = Quantity.exact(28.0, "px")
    found = propagate.measure(
        stereo.LENGTH, stereo.LengthInputs(rig=rig, ends=ends, first=exact, second=Quantity.exact(28.0, "px"))
    )[0]
    assert found.value == pytest.approx(300 / 700 * 3.0)
    assert found.u / found.value == pytest.approx(0.01, rel=0.01)


def test_a_rig_survives_json_and_text():
    rig = turned_rig()
    again = Rig.from_json(json.loads(json.dumps({"rig": rig.to_json()})))
    assert again.digest == rig.digest
    typed = Rig.parse("640x480, f=700 ± 2 px, baseline=120 ± 0.5 mm, doffs=1 ± 0.2 px")
    assert typed.baseline_m == pytest.approx(0.12) and typed.u_baseline_m == pytest.approx(0.0005 / 1.96, rel=1e-3)
    assert float(typed.right.cx_px) - float(typed.left.cx_px) == pytest.approx(1)
    for wrong in ("640x480, f=700 ± 2 px", "640x480, f=700 ± 2 px, baseline=-1 ± 1 mm", "f=7, baseline=1", "x"):
        with pytest.raises(InputError):
            Rig.parse(wrong)


# -- a pair with exact truth -------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def half(tmp_path_factory):
    """The example pair at half size, its rig, and its depth."""
    folder = tmp_path_factory.mktemp("pair")
    for side in ("left", "right"):
        Image.open(EXAMPLES / f"stereo_{side}.jpg").reduce(2).save(folder / f"{side}.png")
    depth = np.asarray(Image.open(EXAMPLES / "stereo_depth.png"))[::2, ::2] * 1e-4
    rig = Rig.from_json(json.loads((EXAMPLES / "stereo_rig.json").read_text()))
    (folder / "rig.json").write_text(json.dumps({"rig": rig.resized(800, 600).to_json()}))
    pair = Photo.load(folder / "left.png"), Photo.load(folder / "right.png")
    return folder, pair, depth, match_pair(*pair, Asked(rig=(str(folder / "rig.json"),)))


def test_depths_and_their_deviations_are_true(half):
    _, _, truth, matched = half
    made = depth_of(matched)
    kept = made.answered
    off = abs(made.depth_m - truth)[kept]
    assert kept.mean() > 0.6 and not made.filled.any()
    assert np.median(off / truth[kept]) < 0.005
    z = off / made.sigma_m[kept]
    assert 0.93 < np.mean(z < 1.96) < 0.995
    assert np.mean(z > 3) < matched.found.unsure + 0.01 < 0.06


def test_filled_pixels_are_marked_and_say_how_doubtful_they_are(half):
    _, pair, truth, matched = half
    from subtense.disparity import filled, smoothed

    for found in (filled(matched.found), smoothed(matched.found, matched.left)):
        made = depth_of(dataclasses.replace(matched, found=found))
        assert made.filled.mean() > 0.05
        z = (abs(made.depth_m - truth) / made.sigma_m)[made.filled]
        assert np.mean(z < 1.96) > 0.93
        assert np.median(made.sigma_m[made.filled]) > 3 * np.median(made.sigma_m[made.answered & ~made.filled])
    del pair


def test_pixels_boxes_and_lengths_hold_the_truth_or_say_what_is_doubtful(half):
    _, _, truth, matched = half
    rng, found = np.random.default_rng(4), []
    for x, y in zip(rng.integers(20, 780, 30).tolist(), rng.integers(20, 580, 30).tolist(), strict=True):
        with contextlib.suppress(GeometryError):  # hidden pixels
            depth = stereo_document(matched, Asked(at=(f"{x},{y}",))).measurements
            inside = depth[1].low <= truth[y, x] <= (depth[1].high or np.inf)
            far_out = abs(depth[1].value - truth[y, x]) > 3 * (depth[1].u or np.inf)
            found.append((inside, far_out and not depth[0].notes))
    inside, silent = np.mean(found, axis=0)
    assert len(found) > 15 and inside > 0.9 and silent == 0
    box = stereo_document(matched, Asked(boxes=("130,40,220,120",))).measurements[1]
    assert box.low <= np.median(truth[40:121, 130:221]) <= box.high


def test_rectification_brings_pixels_back_to_where_they_were(half):
    pair = half[3].pair
    spots = np.random.default_rng(5).uniform([20, 20], [780, 580], (50, 2))
    assert pair.to_left(pair.from_left(spots)) == pytest.approx(spots, abs=1e-6)
    assert pair.to_right(pair.from_right(spots)) == pytest.approx(spots, abs=1e-6)


def test_a_rig_of_another_size_is_scaled_and_noted_or_refused(half):
    _, pair, _, matched = half
    note = match_pair(*pair, Asked(rig=(str(EXAMPLES / "stereo_rig.json"),))).notes[-1]
    assert note.code == "calibration_size_mismatch"
    cut = [dataclasses.replace(one, pixels=one.pixels[:, 100:]) for one in pair]
    with pytest.raises(FileFormatError) as error:
        match_pair(*cut, Asked(rig=(str(EXAMPLES / "stereo_rig.json"),)))
    assert error.value.code == "calibration_size_mismatch"
    del matched


# -- pairs that are none -----------------------------------------------------------------------------------------------


def textured(shift, rows=0.0, size=(200, 320), seed=0):
    """A plane of smooth noise, moved to the left by `shift` px and down by `rows`."""
    rng = np.random.default_rng(seed)
    wide = cv2.GaussianBlur(rng.uniform(0, 255, (size[0] + 40, size[1] + 200)).astype(np.float32), (0, 0), 1.5)
    wide = (wide - wide.mean()) * 4 + 128
    move = np.array([[1, 0, -100 - shift], [0, 1, -20 + rows]], np.float32)
    moved = cv2.warpAffine(wide, move, size[::-1], flags=cv2.INTER_CUBIC)
    return np.repeat(np.clip(moved + rng.normal(0, 1, size), 0, 255).astype(np.uint8)[..., None], 3, 2)


def photo(pixels, tmp_path, name):
    Image.fromarray(pixels).save(tmp_path / name)
    return Photo.load(tmp_path / name)


TYPED = Asked(camera="f=300 ± 1 px", baseline="100 ± 0.2 mm", doffs="0 ± 0.1 px")


def matched_pair(left, right, tmp_path, asked=TYPED):
    return match_pair(photo(left, tmp_path, "l.png"), photo(right, tmp_path, "r.png"), asked)


def test_a_plane_of_noise_is_where_it_is(tmp_path):
    matched = matched_pair(textured(0), textured(12.3), tmp_path)
    found = stereo_document(matched, Asked(at=("160,100",))).measurements[1]
    assert found.low <= 300 * 0.1 / 12.3 <= found.high
    assert found.u / found.value < 0.03
    assert matched.facts.low_px <= 10 and matched.facts.high_px >= 14


@pytest.mark.parametrize(
    ("left", "right", "code"),
    [
        (textured(0), textured(0), "identical_pictures"),
        (textured(12), textured(0), "left_right_swapped"),
        (textured(0), np.zeros_like(textured(0)), "no_texture"),
        (np.full_like(textured(0), 90), textured(0), "no_texture"),
        (textured(0), textured(8, rows=7), "not_rectified"),
        (textured(0), textured(0, seed=9), "no_overlap"),
    ],
)
def test_what_is_no_pair_is_an_error_with_a_name(left, right, code, tmp_path):
    with pytest.raises(GeometryError) as error:
        matched_pair(left, right, tmp_path)
    assert error.value.code == code and "\n" not in str(error.value)


def test_rows_a_little_off_and_a_rolling_shutter_are_noted(tmp_path):
    asked = dataclasses.replace(TYPED, shutter="rolling")
    codes = [note.code for note in matched_pair(textured(0), textured(8, rows=1.6), tmp_path, asked).notes]
    assert "not_rectified" in codes and "rolling_shutter" in codes


def test_sizes_orientations_and_places_that_do_not_fit_are_refused(tmp_path):
    with pytest.raises(InputError, match="RIGHT"):
        matched_pair(textured(0), textured(5)[:, :300], tmp_path)
    matched = matched_pair(textured(0), textured(9), tmp_path)
    for asked in (Asked(at=("400,20",)), Asked(at=("x",)), Asked(boxes=("1,1,2,2",)), Asked(between=("1,1",))):
        with pytest.raises(InputError):
            stereo_document(matched, asked)
    for wrong in (
        {"disparities": "a:b"},
        {"disparities": "9:1"},
        {"shutter": "slow"},
        {"baseline": "0 ± 1 mm"},
        {"baseline": None},
    ):
        with pytest.raises(InputError):
            matched_pair(textured(0), textured(9), tmp_path, dataclasses.replace(TYPED, **wrong))


def test_a_pattern_that_repeats_is_noted(tmp_path):
    x = np.arange(420)
    rng = np.random.default_rng(1)
    wide = np.tile(128 + 80 * np.sign(np.sin(2 * np.pi * x / 16)), (200, 1)) * np.ones((200, 1))
    wide = cv2.GaussianBlur((wide + 40 * np.sign(np.sin(np.arange(200) / 5))[:, None]).astype(np.float32), (0, 0), 1)
    left, right = (np.repeat(np.clip(wide[:, a : a + 320] + rng.normal(0, 1, (200, 320)), 0, 255).astype(np.uint8)[..., None], 3, 2)
                   for a in (40, 46))  # fmt: skip
    asked, codes = dataclasses.replace(TYPED, disparities="0:48"), set()
    try:
        matched = matched_pair(left, right, tmp_path, asked)
        codes = {note.code for note in stereo_document(matched, Asked(at=("160,100",))).measurements[0].notes}
    except GeometryError as error:
        codes = {error.code}  # a refusal is as honest
    assert codes & {"match_ambiguous", "no_match", "no_overlap"}
