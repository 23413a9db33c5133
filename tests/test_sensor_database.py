"""Cameras from the table of sensors: phones, drones, boards with their modes; what contradicts them."""

import math

import pytest
from written_photos import write

from subtense.camera_sources import sensor_database
from subtense.photo import Photo
from subtense.workflow.resolve_camera import resolve_camera

WIDE = {"make": "Apple", "model": "iPhone 13 Pro", "f_number": 1.5, "exposure": 0.01, "focal": 5.7, "f35": 26}
"""7.66 mm and 4032 px: 3000 px."""
PI = {"make": "RaspberryPi", "model": "RP_ov5647", "focal": 3.5976, "exposure": 0.01, "f_number": 2.9}
DRONE = {"make": "DJI", "model": "M3T", "f_number": 2.8, "exposure": 0.01}


@pytest.fixture
def take(tmp_path):
    def make(size=(403, 302), **tags):
        return sensor_database.camera(Photo.load(write(tmp_path / "a.jpg", size, **tags)))

    return make


def codes(found):
    return [note.code for note in found.notes]


def f_px(found):
    assert found.camera is not None, found.reason
    return found.camera.f_px


def test_a_phone_by_its_pixels(take):
    found = take((4032, 3024), **WIDE)
    assert f_px(found) == pytest.approx(5.7 / 0.0019)
    assert found.relative_u == pytest.approx(math.hypot(0.015, 0.015, 0.05 / math.sqrt(3) / 5.7))
    assert codes(found) == [] and "iPhone 13 Pro" in found.reason


def test_a_resized_or_binned_picture_spans_the_same_sensor(take):
    assert f_px(take((2016, 1512), **WIDE)) == pytest.approx(1500)
    found = take((1008, 756), width=4032, height=3024, **WIDE)
    assert f_px(found) == pytest.approx(750)
    assert codes(found) == ["resized"]


@pytest.mark.parametrize(("size", "expected"), [((4032, 2268), 3000), ((3024, 3024), 3000)])
def test_a_cut_with_a_side_of_the_sensor_has_its_pixels(take, size, expected):
    """16:9 and 1:1 in the pixels of the sensor."""
    found = take(size, **WIDE)
    assert f_px(found) == pytest.approx(expected)
    assert codes(found) == []


def test_another_cut_may_be_of_a_part_of_the_sensor(take):
    found = take((1920, 1080), **WIDE)
    assert codes(found) == ["aspect_mismatch"]
    assert f_px(found) == pytest.approx(3000 * 1920 / 4032) and found.relative_u > 0.08


def test_the_ultra_wide_is_not_the_main_lens(take):
    """13 mm taken for 26 doubles every distance."""
    ultra = take((4032, 3024), **{**WIDE, "focal": 1.57, "f35": 13, "f_number": 1.8})
    assert f_px(ultra) == pytest.approx(1570)
    mixed = take((4032, 3024), **{**WIDE, "f35": 13})
    assert mixed.camera is None and "no lens of iPhone 13 Pro" in mixed.reason


def test_lenses_that_the_tags_do_not_tell_apart_are_ambiguous(take):
    found = take(make="Xiaomi", model="Mi 9T Pro", focal=4.77)
    assert found.camera is None and codes(found) == ["lens_ambiguous"]


def test_a_digital_zoom_without_its_tag_is_seen_and_corrected(take):
    found = take((4032, 3024), **{**WIDE, "f35": 52})
    assert codes(found) == ["digital_zoom"]
    assert f_px(found) == pytest.approx(52 / math.hypot(36, 24) * 5040, rel=1e-6)
    assert found.relative_u > 0.05


def test_a_digital_zoom_with_its_tag_is_corrected_once(take):
    found = take((4032, 3024), zoom=2.0, **{**WIDE, "f35": 52})
    assert codes(found) == ["digital_zoom"] and f_px(found) == pytest.approx(6000)


def test_an_equivalent_that_is_a_little_too_long_withdraws_the_row(take):
    """8 % more are no zoom that anybody sets, and too much for rounding."""
    found = take((4032, 3024), **{**WIDE, "f35": 28})
    assert found.camera is None and "makes the equivalent" in found.reason


def test_a_model_of_several_cameras_needs_an_equivalent(take):
    assert take((4000, 3000), focal=4.4, **DRONE).camera is None
    assert f_px(take((4000, 3000), focal=4.4, f35=24, **DRONE)) == pytest.approx(4.4 / 6.430908 * 4000)
    thermal = take((640, 512), focal=9.1, f35=40, **DRONE)
    assert thermal.camera is None and "makes the equivalent" in thermal.reason


def test_a_published_distortion_widens_the_doubt_only(take):
    found = take((5280, 3956), make="DJI", model="M3E", focal=12.29, f35=24, f_number=2.8)
    assert found.camera.coefficients.tolist() == [0] * 5
    assert math.sqrt(found.camera.cov[4, 4]) == pytest.approx(0.111398)


# -- sensor modes ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("model", "size", "focal", "native"),
    [
        ("RP_ov5647", (2592, 1944), 3.5976, [2592]),
        ("RP_ov5647", (1296, 972), 3.5976, [2592]),
        ("RP_ov5647", (1920, 1080), 3.5976, [1928, 2592]),
        ("RP_imx219", (3280, 2464), 3.04, [3280]),
        ("RP_imx219", (1640, 1232), 3.04, [3280]),
        ("RP_imx219", (1920, 1080), 3.04, [1920, 3280]),
        ("imx477", (2028, 1080), 6.0, [4056]),
        ("imx477", (1332, 990), 6.0, [2664, 4056]),
        ("imx708", (2304, 1296), 4.74, [4608]),
        ("imx708", (1536, 864), 4.74, [3072, 4608]),
    ],
)
def test_a_mode_spans_its_part_of_the_sensor_or_all_of_it(take, model, size, focal, native):
    found = take(size, make="RaspberryPi", model=model, focal=focal, exposure=0.01)
    pitch = {"ov5647": 1.4e-3, "imx219": 1.12e-3, "imx477": 1.55e-3, "imx708": 1.4e-3}[model.removeprefix("RP_")]
    expected = sorted((focal / pitch * size[0] / span for span in native), reverse=True)
    readings = [one.f_px for one in found.either] or [f_px(found)]
    assert readings == pytest.approx(expected)
    for one in expected:
        assert abs(f_px(found) - one) <= found.camera.u_f_px
    assert "lens_varies" in codes(found)


def test_a_picture_turned_by_a_quarter_has_the_same_mode(take):
    upright, turned = take((1920, 1080), **PI), take((1920, 1080), turn=6, **PI)
    assert f_px(turned) == pytest.approx(f_px(upright)) and turned.camera.width_px == 1080


@pytest.mark.parametrize("native", [2664, 4056])
def test_the_equivalent_settles_which_mode_it_was(take, native):
    expected = 6 / 1.55e-3 * 1332 / native
    f35 = round(expected * math.hypot(36, 24) / math.hypot(1332, 990))
    found = take((1332, 990), make="Raspberry Pi", model="imx477", focal=6.0, f35=f35, exposure=0.01)
    assert f_px(found) == pytest.approx(expected) and not found.either


def test_a_board_with_another_lens_is_held(take):
    """A real one: a tape and squares on a board say 1748 px where the maker's numbers say 1903 or 2559."""
    found = take((1920, 1080), **PI)
    assert abs(f_px(found) - 1748) < 1.96 * found.camera.u_f_px


# -- beside the others -------------------------------------------------------------------------------------


def test_reasons_where_there_is_nothing(take):
    assert take(model="iPhone 13 Pro", make="Apple", f35=26).reason == "the metadata has no focal length"
    assert "no iPhone of no table" in take(make="Apple", model="iPhone of no table", focal=4.0).reason
    assert "camera without a name" in take(focal=4.0).reason


def test_it_agrees_with_the_equivalent_and_is_taken_where_it_is_surer(tmp_path):
    resolved = resolve_camera(Photo.load(write(tmp_path / "a.jpg", (4032, 3024), **WIDE)))
    assert resolved.chosen.source == "sensor_database"
    assert "camera_sources_disagree" not in [note.code for note in resolved.notes]
