import json
import math

import numpy as np
import pytest
from PIL import Image
from PIL.TiffImagePlugin import IFDRational

from subtense.camera import Camera
from subtense.errors import FileFormatError, InputError, UnknownCameraError
from subtense.photo import Photo
from subtense.workflow.resolve_camera import CAMERA_SOURCES, resolve_camera

FOCAL, F35, FP_X, FP_UNIT, WIDTH, HEIGHT, ZOOM, TURN = 0x920A, 0xA405, 0xA20E, 0xA210, 0xA002, 0xA003, 0xA404, 0x0112


@pytest.fixture
def take(tmp_path):
    """A photo with these tags."""

    def make(size=(400, 300), name="a.jpg", **tags):
        exif = Image.Exif()
        ifd = exif.get_ifd(0x8769)
        for key, value in tags.items():
            code = globals()[key]
            (exif if code == TURN else ifd)[code] = (
                IFDRational(round(value * 10**4), 10**4) if isinstance(value, float) else value
            )
        Image.new("RGB", size).save(tmp_path / name, exif=exif)
        return Photo.load(tmp_path / name)

    return make


def codes(found):
    return [note.code for note in found.notes]


def test_35_mm_equivalent_goes_by_the_diagonal(take):
    found = resolve_camera(take(F35=26, FOCAL=5.65))
    assert found.camera.f_px == pytest.approx(26 * 500 / math.hypot(36, 24))
    assert found.camera.nominal_focal_m == pytest.approx(0.00565)
    # rounding 0.5 / 26 as limits, 2 % of the maker's rule, 1.5 % nominal
    assert found.camera.u_f_px / found.camera.f_px == pytest.approx(math.hypot(0.5 / 26 / math.sqrt(3), 0.02, 0.015))


def test_focal_plane_resolution(take):
    found = resolve_camera(take(FOCAL=35.0, FP_X=100.0, FP_UNIT=4, WIDTH=400, HEIGHT=300))
    assert found.camera.f_px == pytest.approx(3500)
    assert found.chosen.source == "exif_focal_plane"


@pytest.mark.parametrize(("unit", "per_mm"), [(2, 1 / 25.4), (3, 0.1), (4, 1.0)])
def test_focal_plane_units(take, unit, per_mm):
    found = resolve_camera(take(FOCAL=35.0, FP_X=100.0 / per_mm, FP_UNIT=unit))
    assert found.camera.f_px == pytest.approx(3500, rel=1e-5)


def test_turned_pictures_agree(take):
    upright = resolve_camera(take(F35=26, FOCAL=5.65, WIDTH=400, HEIGHT=300)).camera
    turned = resolve_camera(take(F35=26, FOCAL=5.65, WIDTH=400, HEIGHT=300, TURN=6)).camera
    assert turned.f_px == pytest.approx(upright.f_px)
    assert (turned.width_px, turned.height_px) == (300, 400)
    assert turned.cx_px == pytest.approx(149.5)


def test_a_resized_picture_is_scaled_and_told(take):
    found = resolve_camera(take(FOCAL=35.0, FP_X=200.0, FP_UNIT=4, WIDTH=800, HEIGHT=600))
    assert found.camera.f_px == pytest.approx(3500)
    assert codes(found) == ["resized"]


def test_a_cropped_picture_is_told_and_widened(take):
    whole, cut = resolve_camera(take(F35=26)), resolve_camera(take(F35=26, WIDTH=400, HEIGHT=400))
    assert "cropped" in codes(cut)
    assert cut.camera.u_f_px > 4 * whole.camera.u_f_px


def test_tags_of_another_size_are_not_believed(take):
    with pytest.raises(UnknownCameraError, match=r"0\.57 mm wide"):
        resolve_camera(take(size=(100, 68), FOCAL=135.0, FP_X=4438.356, FP_UNIT=2, WIDTH=100, HEIGHT=68))


def test_an_absurd_equivalent_is_left_out(take):
    with pytest.raises(UnknownCameraError, match="48388"):
        resolve_camera(take(F35=48388, FOCAL=7.0))
    found = resolve_camera(take(F35=48388, FOCAL=35.0, FP_X=100.0, FP_UNIT=4))
    assert "f35_invalid" in codes(found)


def test_digital_zoom_is_told(take):
    found = resolve_camera(take(FOCAL=35.0, FP_X=100.0, FP_UNIT=4, ZOOM=2.0))
    assert found.camera.f_px == pytest.approx(7000)
    assert "digital_zoom" in codes(found)


def test_sources_that_contradict_each_other_are_told_and_both_held(take):
    found = resolve_camera(take(FOCAL=35.0, FP_X=100.0, FP_UNIT=4, F35=200))
    other = 200 * 500 / math.hypot(36, 24)
    assert "camera_sources_disagree" in codes(found)
    assert abs(found.camera.f_px - other) < 2 * found.camera.u_f_px


def test_a_wide_picture_from_another_sensor_is_widened(take):
    found = resolve_camera(take(size=(1600, 900), F35=20, FOCAL=3.61))
    assert "aspect_mismatch" in codes(found)
    assert found.camera.u_f_px / found.camera.f_px > 0.045


def test_nothing_known_is_an_error_that_says_what_to_give(take):
    with pytest.raises(UnknownCameraError, match=r"--camera: a calibration file, f=1500px") as caught:
        resolve_camera(take())
    assert {source for source, _ in caught.value.tried} == set(CAMERA_SOURCES)
    assert caught.value.code == "no_focal_length"


@pytest.mark.parametrize(
    ("text", "f_px", "relative_u"),
    [
        ("f=1500px", 1500, 0.005),
        ("f=1500 ± 10 px", 1500, 10 / 1.959964 / 1500),
        ("f=35mm,sensor=14.1mm", 35 / 14.1 * 400, None),
        ("fov=70deg", 200 / math.tan(math.radians(35)), None),
        ("fov=70 ± 1 deg", 200 / math.tan(math.radians(35)), None),
        ("smartphone", 5 / 6 * 400, None),
    ],
)
def test_what_a_person_types(take, text, f_px, relative_u):
    camera = resolve_camera(take(), text).camera
    assert camera.f_px == pytest.approx(f_px)
    assert camera.u_f_px > 0
    if relative_u:
        assert camera.u_f_px / camera.f_px == pytest.approx(relative_u, rel=1e-4)


def test_a_sensor_preset_takes_the_focal_length_from_the_photo(take):
    assert resolve_camera(take(FOCAL=5.0), "1/2.3").camera.f_px == pytest.approx(5 / 6.17 * 400)
    with pytest.raises(InputError, match="no focal length"):
        resolve_camera(take(), "1/2.3")


@pytest.mark.parametrize(
    "text", ["f=0px", "f=-3 px", "fov=0deg", "fov=190deg", "g=3", "f=35mm", "nonsense", "", "f=1,f=2", "f=3 kg"]
)
def test_what_cant_be_read_is_refused(take, text):
    with pytest.raises(InputError):
        resolve_camera(take(), text)


def test_calibration_file_of_this_size_and_resized(take, tmp_path):
    path = tmp_path / "c.json"
    path.write_text(json.dumps(Camera(400, 300, 500.0, 201.0, 148.0, cov=np.diag([1.0, 0, 1, 1])).to_json()))
    assert resolve_camera(take(), str(path)).camera.f_px == 500
    half = resolve_camera(take(size=(200, 150)), str(path))
    assert half.camera.f_px == pytest.approx(250)
    assert half.camera.cx_px == pytest.approx((201.5) / 2 - 0.5)
    assert "calibration_size_mismatch" in codes(half)
    with pytest.raises(FileFormatError, match="turned by a quarter"):
        resolve_camera(take(size=(300, 400)), str(path))


@pytest.mark.parametrize(
    "content",
    ["", "{", "[]", "3", '{"width_px": 4}', '{"width_px": "a", "height_px": 3, "f_px": 1, "cx_px": 0, "cy_px": 0}', "[" * 100_000,
     '{"width_px": 400, "height_px": 300, "f_px": -1, "cx_px": 0, "cy_px": 0}',
     '{"width_px": 400, "height_px": 300, "f_px": 1, "cx_px": 0, "cy_px": 0, "distortion": "x"}'],
)  # fmt: skip
def test_broken_calibration_files_are_named(take, tmp_path, content):
    path = tmp_path / "c.json"
    path.write_text(content)
    with pytest.raises(FileFormatError, match=r"c\.json"):
        resolve_camera(take(), str(path))


def test_a_missing_calibration_file_is_named(take):
    with pytest.raises(FileFormatError, match="no such file"):
        resolve_camera(take(), "nowhere.json")


def test_what_the_json_of_a_camera_says_is_a_calibration_file(take, tmp_path):
    first = resolve_camera(take(F35=26))
    path = tmp_path / "camera.json"
    path.write_text(json.dumps({"camera": first.to_json()}))
    assert resolve_camera(take(), str(path)).camera.f_px == first.camera.f_px
