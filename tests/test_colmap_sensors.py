"""Cameras from COLMAP's table: a last resort that must agree with the equivalent."""

import math
import sys

import pytest
from written_photos import write

from subtense.camera_sources import colmap_sensors
from subtense.photo import Photo
from subtense.workflow.resolve_camera import resolve_camera

pytest.importorskip("pycolmap")
NIKON = {"make": "NIKON CORPORATION", "model": "NIKON D850", "focal": 50.0, "f_number": 8.0, "exposure": 0.01}


@pytest.fixture
def photo(tmp_path):
    def make(size=(600, 400), **tags):
        return Photo.load(write(tmp_path / "a.jpg", size, **tags))

    return make


def test_a_width_of_the_table():
    assert colmap_sensors.sensor_width_mm("NIKON CORPORATION", "NIKON D850") == pytest.approx(36.0, abs=0.11)
    assert colmap_sensors.sensor_width_mm("Apple", "iPhone 13 Pro") == pytest.approx(7.66, abs=1e-4)


@pytest.mark.parametrize(
    ("make", "model"),
    [
        ("Apple", "iPhone 99"),
        ("", ""),
        ("x\n\x00ü", "y"),
        ("A" * 5000, "B" * 5000),
        ("%s%n", "../../etc"),
        ("\x00", "\x00"),
    ],
)
def test_what_is_not_in_it_is_none(make, model):
    assert colmap_sensors.sensor_width_mm(make, model) is None


def test_a_camera(photo, capfd):
    found = colmap_sensors.camera(photo(**NIKON))
    assert found.camera.f_px == pytest.approx(50 / 36 * 600, rel=0.004)
    assert found.relative_u == pytest.approx(math.hypot(0.015, 0.03), rel=0.01)
    assert capfd.readouterr() == ("", "")


def test_the_equivalent_must_agree(photo):
    assert colmap_sensors.camera(photo(f35=50, **NIKON)).camera is not None
    cropped = colmap_sensors.camera(photo(f35=75, **NIKON))
    assert cropped.camera is None and "contradicts by 50 %" in cropped.reason


def test_a_phone_or_a_drone_needs_an_equivalent(photo):
    phone = {"make": "Apple", "model": "iPhone 13 Pro", "focal": 5.7}
    assert "may have several cameras" in colmap_sensors.camera(photo((400, 300), **phone)).reason
    assert colmap_sensors.camera(photo((400, 300), f35=26, **phone)).camera is not None
    assert "may have several cameras" in colmap_sensors.camera(photo(make="DJI", model="ZH20T", focal=4.5)).reason


def test_a_picture_cut_to_other_proportions_is_in_doubt(photo):
    assert colmap_sensors.camera(photo((640, 360), **NIKON)).relative_u > 0.08


def test_it_is_asked_only_where_nothing_else_answers(photo, monkeypatch):
    """0.2 s of import for a width that others know better."""
    asked = []
    monkeypatch.setattr(colmap_sensors, "sensor_width_mm", lambda make, model: asked.append(model))
    said = {h.source: h.reason for h in resolve_camera(photo(f35=50, **NIKON)).hypotheses}
    assert not asked and "not asked" in said["colmap_sensors"]
    said = {h.source: h.reason for h in resolve_camera(photo(f35=50, **NIKON), ask_all=True).hypotheses}
    assert asked == ["NIKON D850"] and "COLMAP's table has no" in said["colmap_sensors"]


def test_without_the_package_its_reason_says_what_to_install(photo, monkeypatch):
    monkeypatch.setattr(colmap_sensors, "find_spec", lambda _: None)
    assert "pip install 'subtense[sfm]'" in colmap_sensors.camera(photo(**NIKON)).reason
    assert colmap_sensors.camera(photo(make="NIKON", focal=5.0)).reason == "the metadata does not name the camera"


def test_it_is_not_loaded_before_it_is_asked():
    import subprocess

    code = "import sys, subtense; sys.exit('pycolmap' in sys.modules or 'lensfunpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
