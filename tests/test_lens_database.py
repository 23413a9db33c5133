"""Cameras and lenses of Lensfun's database: whole names only, and its distortion against its own map of pixels."""

from dataclasses import replace

import numpy as np
import pytest
from written_photos import packet, write

from subtense.camera_sources import lens_database
from subtense.metadata import Metadata
from subtense.photo import Photo
from subtense.workflow.resolve_camera import resolve_camera

pytest.importorskip("lensfunpy")
CANON = {
    "make": "Canon",
    "model": "Canon EOS 600D",
    "lens": "EF-S18-55mm f/3.5-5.6 IS STM",
    "focal": 18.0,
    "f_number": 8.0,
    "exposure": 0.01,
}
SONY = {
    "make": "SONY",
    "model": "ILCE-7M3",
    "lens": "FE 24-105mm F4 G OSS",
    "focal": 24.0,
    "f_number": 8.0,
    "exposure": 0.01,
}
SIZE = (600, 400)


@pytest.fixture
def photo(tmp_path):
    def make(size=SIZE, form="JPEG", **tags):
        found = Photo.load(write(tmp_path / "a.jpg", size, **tags))
        return replace(found, metadata=replace(found.metadata, form=form))

    return make


def codes(found):
    return [note.code for note in found.notes]


# -- names -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("make", "model"),
    [("Apple", "iPhone 14 Pro"), ("Canon", "Canon EOS"), ("Canon", "EOS 60"), ("NIKON CORPORATION", "NIKON D85"), ("Nikon", "D8500"),
     ("SONY", "ILCE-7"[:5]), ("Pentax", "Canon EOS 600D"), (" ", " "), ("DJI", "FC300S")],
)  # fmt: skip
def test_a_part_of_a_name_is_no_camera(make, model):
    """The package's own search gives an iPhone XS for an iPhone 14 Pro."""
    assert lens_database._body(make, model) is None


@pytest.mark.parametrize(
    ("make", "model", "crop"),
    [
        ("NIKON CORPORATION", "NIKON D850", 1.0),
        ("Canon", "Canon EOS 600D", 1.613),
        ("SONY", "ILCE-7M3", 1.0),
        ("PENTAX", "PENTAX K-5", 1.526),
    ],
)
def test_whole_names_as_cameras_write_them(make, model, crop):
    assert lens_database._body(make, model).crop_factor == pytest.approx(crop, abs=2e-3)


@pytest.mark.parametrize(
    "lens", ["EF-S18-55mm f/3.5-5.6 IS", "EF-S18-55mm", "18-55mm", "EF-S18-55mm f/3.5-5.6 IS STM II", "", None]
)
def test_a_lens_of_nearly_the_name_is_another(lens):
    body = lens_database._body("Canon", "Canon EOS 600D")
    found = lens_database._lens(Metadata(make="Canon", lens=lens, focal_mm=18.0), body)
    assert found is None or found.model == "Canon EF-S 18-55mm f/3.5-5.6 IS"


def test_a_focal_length_beyond_the_lens_is_of_another():
    body = lens_database._body("Canon", "Canon EOS 600D")
    named = Metadata(make="Canon", lens=CANON["lens"], focal_mm=18.0)
    assert lens_database._lens(named, body) is not None
    assert lens_database._lens(replace(named, focal_mm=85.0), body) is None


# -- the camera --------------------------------------------------------------------------------------------


def test_the_focal_length_is_by_the_crop_factor(photo):
    found = lens_database.camera(photo(**CANON))
    assert found.camera.f_px == pytest.approx(18 * 1.613 * np.hypot(*SIZE) / np.hypot(36, 24), rel=1e-4)
    assert 0.02 < found.relative_u < 0.04


def test_an_equivalent_that_contradicts_it_withdraws_it(photo):
    assert lens_database.camera(photo(f35=29, **CANON)).camera is not None
    found = lens_database.camera(photo(f35=36, **CANON))
    assert found.camera is None and "and the metadata says 36 mm" in found.reason


def test_reasons_where_there_is_nothing(photo, monkeypatch):
    assert (
        "next to no phones" in lens_database.camera(photo(make="samsung", model="SM-G991B", focal=2.2, f35=13)).reason
    )
    assert "database has no Belt 12" in lens_database.camera(photo(make="Ours", model="Belt 12", focal=12.0)).reason
    monkeypatch.setattr(lens_database, "find_spec", lambda _: None)
    assert "pip install 'subtense[lenses]'" in lens_database.camera(photo(**CANON)).reason


# -- distortion --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "tags", [CANON, SONY, {**CANON, "focal": 35.0}, {"make": "SONY", "model": "DSC-RX100M3", "focal": 8.8}]
)
@pytest.mark.parametrize("size", [(5184, 3456), (4000, 2250)])
def test_pixels_go_where_the_database_says(tags, size):
    """Of every pixel of its picture without distortion: the camera's against the package's own map, 0.4 % of the half diagonal."""
    small = tuple(side // 8 for side in size)
    body = lens_database._body(tags["make"], tags["model"])
    lens = lens_database._lens(Metadata(make=tags["make"], lens=tags.get("lens"), focal_mm=tags["focal"]), body)
    f_px = tags["focal"] * body.crop_factor * np.hypot(*small) / np.hypot(36, 24)
    found = lens_database._distortion(lens, body.crop_factor, tags["focal"], small[0] / small[1], f_px / small[0])
    places = lens_database.distorted_places(lens, body.crop_factor, tags["focal"], small)
    middle = (np.array(small) - 1) / 2
    y, x = np.mgrid[: small[1], : small[0]]
    slopes = (np.stack([x, y], -1) - middle) / f_px * found.scale
    r2 = (slopes**2).sum(-1, keepdims=True)
    made = slopes * (1 + found.k[0] * r2 + found.k[1] * r2**2 + found.k[2] * r2**3) * f_px + middle
    worst = np.linalg.norm(made - places, axis=-1).max() / np.hypot(*middle)
    undone = np.linalg.norm(slopes * f_px + middle - places, axis=-1).max() / np.hypot(*middle)
    assert worst < 0.004 and worst < 0.15 * undone
    assert 0.6 * worst < found.miss + 4e-4 < 2 * worst + 8e-4


@pytest.mark.parametrize(
    ("tags", "form", "applied"),
    [(CANON, "JPEG", True), (CANON, "RAW", True), (CANON, "TIFF", False), (SONY, "JPEG", False), (SONY, "RAW", True)],
)
def test_it_is_applied_where_the_picture_still_has_it(photo, tags, form, applied):
    found = lens_database.camera(photo(form=form, **tags))
    assert ("distortion_corrected" in codes(found)) == applied
    assert bool(found.camera.coefficients.any()) == applied
    u = np.sqrt(found.camera.cov[4, 4])
    assert u > 0.2 * abs(found.camera.coefficients[0]) and u > 0.015


@pytest.mark.parametrize("more", [{"software": "Adobe Lightroom 6.0"}, {"xmp": packet(crs_LensProfileEnable=1)}])
def test_what_an_editor_wrote_may_be_corrected(photo, more):
    found = lens_database.camera(photo(**more, **CANON))
    assert "distortion_corrected" not in codes(found) and not found.camera.coefficients.any()


def test_a_reflex_camera_is_corrected_whoever_has_its_focal_length(photo):
    """The focal plane has the surer focal length, the database the lens: a point in the corner moves by what the lens does."""
    taken = photo(fp_x=600 / 22.3, fp_y=600 / 22.3, fp_unit=4, **CANON)
    resolved = resolve_camera(taken)
    assert "distortion_corrected" in codes(resolved)
    assert "Lensfun" in resolved.camera.part_sources["lens distortion"]
    alone = lens_database.camera(taken).camera
    assert resolved.camera.coefficients == pytest.approx(alone.coefficients)
    assert resolved.camera.u_f_px / resolved.camera.f_px >= alone.u_f_px / alone.f_px * 0.999
    ray = resolved.camera.rays(np.array([[0.0, 0.0]]))[0]
    straight = np.array([-299.5, -199.5]) / resolved.camera.f_px
    assert 0.02 < np.hypot(*(ray[:2] / ray[2])) / np.hypot(*straight) - 1 < 0.09  # barrel: the corner lies farther out
    assert np.allclose(resolved.camera.project(ray[None]), 0.0, atol=1e-6)


def test_what_a_person_gives_keeps_its_own_lens(photo):
    resolved = resolve_camera(photo(**CANON), "f=500px")
    assert not resolved.camera.coefficients.any() and "distortion_corrected" not in codes(resolved)


def test_a_turned_picture_has_the_same_lens(photo):
    upright, turned = (lens_database.camera(photo(turn=turn, **CANON)).camera for turn in (1, 6))
    assert turned.width_px == upright.height_px
    assert turned.coefficients == pytest.approx(upright.coefficients)
