"""Sheets, cards and plates found by themselves: rendered with exact truth, and real ones."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent / "synthetic"))
import sheet_scenes as scenes

from subtense import Photo, Quantity, propagate, resolve_camera
from subtense.detection import Search
from subtense.detectors.sheets import sheets
from subtense.methods import pose
from subtense.sheet_kinds import kind_fits, shape_numbers, usual_cameras
from subtense.target import Target
from subtense.targets import find_target, targets
from subtense.workflow.detect import detect, item_of
from subtense.workflow.in_photo import measure_item

pytestmark = pytest.mark.opencv
SRGB = Quantity.exact(2.2, "1")
A4, CARD = find_target("a4"), find_target("id-1")


def found(photo, *told, camera=None, curve=SRGB):
    return sheets(photo, Search(targets=told, camera=camera, curve=curve))


def chi2(one, corners):
    off = (one.seen.points_px - scenes.in_order(one.seen.points_px, corners)).ravel()
    return float(off @ np.linalg.solve(one.seen.cov, off)) / 8, float(abs(off).max())


@pytest.mark.parametrize(("tilt", "seed"), [(0, 1), (25, 2), (45, 3), (60, 4)])
@pytest.mark.parametrize("dark", [70, 245], ids=["light", "dark"])
def test_a_sheet_is_found_at_any_tilt_with_its_corners_and_its_range(tilt, seed, dark):
    rng = np.random.default_rng(seed)
    light = 225 if dark == 70 else 90
    photo, corners, camera, true = scenes.sheet(
        tilt=tilt, axis=rng.uniform(0, 360), turn=rng.uniform(0, 360), seed=seed, dark=dark, light=light
    )
    (one,) = found(photo, A4, camera=camera)
    assert one.target is A4 and one.shape == "rectangle" and one.notes == ()
    assert chi2(one, corners)[0] < 2.5 and chi2(one, corners)[1] < 0.3
    assert np.linalg.eigvalsh(one.seen.cov).min() > 0
    known = Target.rectangle(Quantity.exact(0.297, "m"), Quantity.exact(0.210, "m"), "a4")
    m = propagate.measure(pose.METHOD, pose.Inputs(camera, one.seen, known))[0]
    assert m.low < true < m.high and m.u / m.value < 0.01


def test_the_first_side_is_the_target_s_width():
    for turn in (0, 90):
        photo, _, camera, _ = scenes.sheet(tilt=10, turn=turn)
        (one,) = found(photo, A4, camera=camera)
        p = one.seen.points_px
        assert np.hypot(*(p[1] - p[0])) > 1.3 * np.hypot(*(p[2] - p[1]))
        edge = np.roll(p, -1, axis=0) - p
        assert np.all(edge[:, 0] * np.roll(edge[:, 1], -1) > edge[:, 1] * np.roll(edge[:, 0], -1))  # clockwise as seen


def test_the_corner_of_a_rounded_card_is_where_its_sides_meet():
    """The picture's own corners are rounded by 12 px; a card is a card by that, without being told."""
    photo, corners, camera, _ = scenes.sheet(0.0856, 0.05398, distance_m=0.2, rounded_m=0.00318, tilt=20)
    for told in ((CARD,), ()):
        (one,) = found(photo, *told, camera=camera)
        assert one.target.name == "id-1" and chi2(one, corners)[1] < 0.3


def test_a_sharp_rectangle_of_a_card_s_proportions_is_no_card():
    photo, _, camera, _ = scenes.sheet(0.0856, 0.05398, distance_m=0.2, tilt=20)
    assert found(photo, CARD, camera=camera) == ()
    assert all(one.target is None for one in found(photo, camera=camera))


@pytest.mark.parametrize("hidden", [((0.0, 0.0, 40.0),), ((0.5, 0.0, 60.0),), ((0.0, 0.0, 30.0), (1.0, 0.5, 45.0))])
def test_hidden_corners_are_where_sides_meet(hidden):
    """A hand over a corner or over part of a side; u grows, and the corners stay right."""
    plain, corners, camera, _ = scenes.sheet(tilt=25, distance_m=0.7)
    a, b, _, d = corners
    discs = [(*(a + x * (b - a) + y * (d - a)), radius) for x, y, radius in hidden]
    photo, _, _, _ = scenes.sheet(tilt=25, distance_m=0.7, hidden=discs)
    (one,) = found(photo, A4, camera=camera)
    assert chi2(one, corners)[0] < 2.5
    (whole,) = found(plain, A4, camera=camera)
    assert np.trace(one.seen.cov) > np.trace(whole.seen.cov)
    assert one.seen.score < whole.seen.score


def test_sides_that_are_mostly_hidden_are_noted():
    _, corners, camera, _ = scenes.sheet(tilt=5, distance_m=0.7)
    middle = (corners[0] + corners[1]) / 2
    photo, _, _, _ = scenes.sheet(tilt=5, distance_m=0.7, hidden=[(*middle, 60.0)])
    (one,) = found(photo, A4, camera=camera)
    assert "partly_hidden" in [note.code for note in one.notes]


# -- what it is ------------------------------------------------------------------------------------------


def test_a_plain_sheet_has_no_size_unless_told():
    """All A sizes are alike; and so the interval can't be small."""
    photo, _, camera, _ = scenes.sheet(tilt=25)
    (one,) = found(photo, camera=camera)
    assert one.target is None and item_of(one) is None
    assert {"a3", "a4", "a5"} <= {other.name for other in one.others}
    assert "letter" not in {other.name for other in one.others}
    assert item_of(one, A4.text) is not None


def test_kinds_told_are_told_apart_by_their_proportions():
    letter = find_target("letter")
    photo, _, camera, _ = scenes.sheet(0.2794, 0.2159, tilt=35)
    (one,) = found(photo, A4, letter, camera=camera)
    assert one.target is letter and one.others == ()
    assert found(photo, A4, camera=camera) == ()


def test_two_told_kinds_of_one_shape_are_not_guessed_between():
    photo, _, camera, _ = scenes.sheet(tilt=25)
    (one,) = found(photo, A4, find_target("a5"), camera=camera)
    assert one.target is None and {other.name for other in one.others} == {"a4", "a5"} and item_of(one) is None


def test_without_a_camera_the_proportions_are_known_less():
    photo, corners, camera, _ = scenes.sheet(tilt=40, axis=0, turn=0)
    kinds = [row for row in targets().values() if row.shape == "rectangle"]
    cov = 0.1**2 * np.eye(8)
    with_camera = {fit.target.name for fit in kind_fits(corners, cov, [(camera, 1.0)], kinds)}
    without = {fit.target.name for fit in kind_fits(corners, cov, usual_cameras(640, 480), kinds)}
    assert "a4" in with_camera and with_camera < without
    (one,) = found(photo, A4)
    assert one.target is A4


def test_the_shape_numbers_are_those_of_the_rectangle():
    for tilt in (0, 30, 70):
        _, corners, camera, _ = scenes.sheet(0.5, 0.2, tilt=tilt, distance_m=3.0)
        aspect, right = shape_numbers(*camera.slopes(corners))
        assert aspect == pytest.approx(np.log(2.5), abs=1e-9) and right == pytest.approx(0, abs=1e-9)


def test_two_that_fit_are_noted_on_each():
    one, _, camera, _ = scenes.sheet(distance_m=1.6, offset=(-0.25, 0.0), tilt=10)
    other, _, _, _ = scenes.sheet(distance_m=1.6, offset=(0.25, 0.0), tilt=10)
    import dataclasses

    both = dataclasses.replace(one, pixels=np.maximum(one.pixels, other.pixels))
    pair = found(both, A4, camera=camera)
    assert [[note.code for note in one.notes] for one in pair] == [["several_fit"], ["several_fit"]]


# -- what is no sheet ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("told", [(), (A4,), (CARD, A4)])
def test_nothing_is_found_in_blank_black_and_noisy_pictures(told):
    rng = np.random.default_rng(3)
    for value in (
        np.full((120, 160), 0.5),
        np.zeros((90, 120)),
        rng.random((150, 200)),
        np.zeros((1, 1)),
        np.ones((3, 200)),
    ):
        photo = scenes.photo_of(value, 1, 2)
        assert found(photo, *told) == ()


def test_other_targets_are_left_to_others():
    photo, _, camera, _ = scenes.sheet()
    assert found(photo, find_target("euro-1"), camera=camera) == ()


@pytest.mark.parametrize("name", ["facade.jpg", "street.jpg", "belt.jpg"])
def test_windows_boxes_and_cars_have_no_confident_distance(examples, name):
    photo = Photo.load(examples / name)
    assert all(one.target is None for one in sheets(photo, Search(camera=resolve_camera(photo).camera)))


# -- whole pictures ------------------------------------------------------------------------------------------


def test_the_sheet_and_the_card_on_the_desk(examples, truth):
    """By the photo's metadata alone; the card without being told."""
    photo = Photo.load(examples / "desk.jpg")
    resolved = resolve_camera(photo)
    things = {o["name"]: o["points"] for o in truth["desk.jpg"]["objects"]}
    (card,) = [one for one in detect(photo, ["sheets"]).detections if one.target]
    (sheet,) = detect(photo, ["sheets"], Search(targets=(A4,))).detections
    for one, name in ((sheet, "a4"), (card, "card")):
        corners = np.array([p["pixel_px"] for p in things[name]])
        assert chi2(one, corners)[0] < 3
        true = float(np.linalg.norm(np.mean([p["camera_m"] for p in things[name]], axis=0)))
        m = measure_item(item_of(one), photo, resolved).measurements[0]
        assert m.low < true < m.high and m.value == pytest.approx(true, rel=0.01)


@pytest.mark.parametrize("name", ["stepA_1.jpg", "stepA_2.jpg"])
def test_a_real_card_on_a_step_is_found(shared_data, name):
    """White on dark, on metal and on light stone, with a black stripe through; corners by eye to 2 px."""
    photo = Photo.load(shared_data / "reference_object" / "step_card" / name)
    by_eye = {"stepA_1.jpg": [[361, 357], [508, 349], [502, 425], [363, 434]],
              "stepA_2.jpg": [[385, 339], [511, 311], [499, 386], [379, 420]]}[name]  # fmt: skip
    (one,) = sheets(photo, Search(targets=(CARD,), camera=resolve_camera(photo).camera))
    assert abs(one.seen.points_px - scenes.in_order(one.seen.points_px, np.array(by_eye, float))).max() < 2.5
    assert one.target is CARD


def test_a_real_business_card_is_found(shared_data):
    photo = Photo.load(shared_data / "reference_object" / "coins_card" / "example_01.png")
    (one,) = sheets(photo, Search(targets=(find_target("business-card-us"),)))
    p = one.seen.points_px
    assert np.hypot(*(p[1] - p[0])) / np.hypot(*(p[2] - p[1])) == pytest.approx(88.9 / 50.8, rel=0.01)


def test_real_exit_signs_have_the_proportions_of_their_kind(shared_data, tmp_path):
    """Corners as labelled, known to about 2 px; the sign of 335 x 195 mm, its range within 3 u."""
    import json

    said = json.loads((shared_data / "known_size" / "exit_sign_labels" / "truth.json").read_text())
    own = tmp_path / "own.toml"
    own.write_text(
        '[exit-sign]\ntitle = "exit sign"\nwidth_mm = 335\nheight_mm = 195\nspread_mm = 3\nsource = "measured"\n'
    )
    sign, letter = targets(own)["exit-sign"], find_target("a4")
    camera = usual_cameras(*said["image_size"])[0][0]
    camera = camera._with(f_px=float(said["f_px"]), cov=np.diag([16.0**2, 0, 15.0**2, 15.0**2]))
    best = []
    for sample in said["samples"][:120:4]:
        p = np.array(sample["quad_px"], float)
        around = np.argsort(np.arctan2(*(p - p.mean(axis=0)).T[::-1]))
        fits = kind_fits(p[around], 2.0**2 * np.eye(8), [(camera, 1.0)], [sign, letter])
        best.append(bool(fits) and fits[0].target is sign)
    assert np.mean(best) > 0.8
