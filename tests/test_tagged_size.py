"""Pictures that were cut, turned, zoomed, filmed or straightened: what the camera becomes, and what is noted."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from written_photos import packet, write

from subtense import Observation, Quantity, measure_lines
from subtense.errors import UnknownCameraError
from subtense.photo import Photo
from subtense.workflow.resolve_camera import resolve_camera

DIAGONAL_MM = math.hypot(36, 24)
PHONE = {"make": "Apple", "model": "iPhone of no table", "f35": 26, "focal": 4.25, "f_number": 1.8, "exposure": 0.01}


@pytest.fixture
def take(tmp_path):
    def make(size=(400, 300), **more):
        return resolve_camera(Photo.load(write(tmp_path / "a.jpg", size, **more)))

    return make


def codes(found):
    return [note.code for note in found.notes]


def relative(found):
    return found.camera.u_f_px / found.camera.f_px


def crop(left, top, right, bottom, angle=0, applied="True"):
    return packet(crs_HasCrop="True", crs_AlreadyApplied=applied, crs_CropLeft=left, crs_CropTop=top, crs_CropRight=right,
                  crs_CropBottom=bottom, crs_CropAngle=angle)  # fmt: skip


@pytest.mark.parametrize("factor", [1, 0.5])
def test_a_crop_whose_rectangle_is_told_is_corrected_exactly(take, factor):
    """Of 4000 x 3000 px the part from (400, 600) to (2400, 2100); also where it was resized after."""
    whole = take((4000, 3000), **PHONE).camera
    size = (round(2000 * factor), round(1500 * factor))
    found = take(size, xmp=crop(0.1, 0.2, 0.6, 0.7), **PHONE)
    expected = whole.cropped(400, 600, 2000, 1500).resized(*size)
    assert codes(found) == ["cropped"]
    assert found.camera.f_px == pytest.approx(expected.f_px)
    assert (found.camera.cx_px, found.camera.cy_px) == pytest.approx((expected.cx_px, expected.cy_px))
    assert relative(found) == pytest.approx(whole.u_f_px / whole.f_px)


def test_a_crop_of_a_picture_that_was_turned_after_has_its_middle_on_either_side(take):
    """A raw picture 4000 x 3000, cut to 3000 x 3000 at its left, and written upright after."""
    found = take((1500, 2000), xmp=crop(0.0, 0.0, 0.5, 0.5), **PHONE)
    assert found.camera.f_px == pytest.approx(26 * 5000 / DIAGONAL_MM)
    turned = take(
        (1800, 2000), xmp=crop(0.0, 0.1, 0.5, 0.7), **PHONE
    )  # 2000 x 1800 of 4000 x 3000, turned by a quarter
    assert turned.camera.f_px == pytest.approx(26 * 5000 / DIAGONAL_MM)
    off = 0.25 * 4000  # the middle lies that far off, up or down
    assert abs(turned.camera.cy_px - 999.5) < 1
    assert math.sqrt(turned.camera.cov[3, 3]) > 0.5 * off


def test_a_crop_that_is_not_in_the_pixels_is_none(take):
    found = take(xmp=crop(0.1, 0.2, 0.6, 0.7, applied="False"), **PHONE)
    assert codes(found) == []
    assert found.camera.cx_px == 199.5


def test_a_turned_crop_is_wider(take):
    straight, turned = (take(xmp=crop(0.1, 0.1, 0.9, 0.9, angle), **PHONE) for angle in (0, 5))
    assert relative(turned) > math.sin(math.radians(5)) > relative(straight)


@pytest.mark.parametrize(
    ("size", "more"),
    [
        ((400, 220), {}),  # no camera's proportions
        ((400, 300), {"xmp": packet(crs_HasCrop="True")}),
        ((400, 300), {"xmp": packet(crs_HasCrop="True", crs_AlreadyApplied="True")}),
        ((300, 300), {"width": 400, "height": 300}),
    ],
)
def test_signs_of_an_unknown_crop_widen_focal_length_and_centre(take, size, more):
    found = take(size, **more, **PHONE)
    assert "cropped" in codes(found)
    assert relative(found) > 0.15
    assert math.sqrt(found.camera.cov[2, 2]) >= 0.1 * size[0]


def test_a_crop_beside_its_tagged_size_holds_the_truth(take):
    """Cut to 2400 x 2400 of 4032 x 3024, as it is and resized to half: f = 26 mm by the whole diagonal."""
    for size, truth in (((2400, 2400), 26 * 5040 / DIAGONAL_MM), ((1200, 1200), 26 * 2520 / DIAGONAL_MM)):
        found = take(size, width=4032, height=3024, **PHONE)
        assert abs(found.camera.f_px - truth) < 1.96 * found.camera.u_f_px


@pytest.mark.parametrize("size", [(4032, 2268), (3024, 3024)])
def test_both_readings_of_a_picture_of_other_proportions_are_held(take, size):
    found = take(size, **PHONE)
    assert "aspect_mismatch" in codes(found)
    for diagonal in (math.hypot(*size), 5040):
        assert abs(found.camera.f_px - 26 * diagonal / DIAGONAL_MM) < 1.5 * found.camera.u_f_px


def test_another_source_settles_which_reading_holds(take):
    """16:9 of a 4:3 sensor 6.16 mm wide: the equivalent holds for the whole sensor."""
    per_mm = 4000 / 6.16
    found = take((4000, 2250), f35=20, focal=3.61, fp_x=per_mm, fp_y=per_mm, fp_unit=4, f_number=2.8)
    said = next(h for h in found.hypotheses if h.source == "exif_35mm")
    assert said.camera.f_px == pytest.approx(20 * 5000 / DIAGONAL_MM)
    assert "fits the other sources" in said.reason
    assert "camera_sources_disagree" not in codes(found)


def test_a_digital_zoom_is_in_the_equivalent_or_not(take):
    found = take(f35=26, focal=4.25, zoom=2.0)
    assert "digital_zoom" in codes(found)
    for truth in (26, 52):
        assert abs(found.camera.f_px - truth * 500 / DIAGONAL_MM) < 1.5 * found.camera.u_f_px


@pytest.mark.parametrize(
    "more",
    [
        {"f35": 26, "focal": 4.25},  # nothing of a still
        {"f35": 26, "focal": 4.25, "f_number": 1.8, "software": "Lavf59.27.100"},
        {"f35": 26, "focal": 4.25, "f_number": 1.8, "xmp": packet(xmpDM_videoFrameRate="29.97")},
    ],
)
def test_a_films_frame_is_1_to_1_5_times_narrower(take, more):
    found = take((1920, 1080), **more)
    assert "video_crop" in codes(found)
    plain = 26 * math.hypot(1920, 1440) / DIAGONAL_MM
    assert abs(found.camera.f_px - 1.28 * plain) < 1.96 * found.camera.u_f_px
    assert abs(found.camera.f_px - plain) < 1.96 * found.camera.u_f_px


def test_a_still_of_a_films_size_is_a_still(take):
    assert "video_crop" not in codes(take((1920, 1080), **PHONE))


@pytest.mark.parametrize(
    ("more", "aspect"),
    [
        ({"fp_x": 100.0, "fp_y": 50.0, "fp_unit": 4}, 0.5),
        ({"fp_x": 100.0, "fp_y": 100.0, "fp_unit": 4, "x_res": 72.0, "y_res": 96.0}, 4 / 3),
    ],
)
@pytest.mark.parametrize("turn", [1, 6])
def test_pixels_that_are_not_square_make_fx_and_fy_differ(take, more, aspect, turn):
    found = take(focal=35.0, turn=turn, **more)
    assert "nonsquare_pixels" in codes(found)
    expected = aspect if turn == 1 else 1 / aspect
    assert found.camera.aspect == pytest.approx(expected)
    assert found.camera.f_px == pytest.approx(3500 if turn == 1 else 3500 * aspect)
    assert found.camera.cov[1, 1] > 0


def test_a_hundredth_of_difference_in_the_focal_plane_is_rounding(take):
    found = take(focal=35.0, fp_x=100.0, fp_y=100.3, fp_unit=4)
    assert found.camera.aspect == 1.0
    assert "nonsquare_pixels" not in codes(found)


def test_by_the_diagonal_with_pixels_that_are_not_square(take):
    """PAL: 720 x 576 pixels of 16:15 are 768 x 576 square ones."""
    found = take((720, 576), f35=35, focal=5.0, f_number=2.0, x_res=150.0, y_res=160.0)
    fy = 35 * math.hypot(768, 576) / DIAGONAL_MM
    assert found.camera.f_px * found.camera.aspect == pytest.approx(fy, rel=1e-4)


@pytest.mark.parametrize("turn", range(1, 9))
def test_every_orientation_gives_the_same_camera_of_the_upright_picture(tmp_path, turn):
    """A cut picture whose axis is off its middle, stored in eight ways; the axis is marked in the pixels."""
    from test_photo import stored_as

    pixels = np.zeros((300, 400, 3), np.uint8)
    pixels[110:131, 250:271] = 255  # its middle is the axis: (260, 120)
    stored = stored_as(pixels, turn)
    y, x = np.argwhere(stored[..., 0] > 0).mean(axis=0)
    h, w = stored.shape[:2]
    # the rectangle of a whole picture, twice as large, whose middle is (x, y)
    left, top = 0.5 - (x + 0.5) / w / 2, 0.5 - (y + 0.5) / h / 2
    path = write(tmp_path / "a.png", pixels=stored, xmp=crop(left, top, left + 0.5, top + 0.5), turn=turn, **PHONE)
    found = resolve_camera(Photo.load(path)).camera
    assert (found.width_px, found.height_px) == (400, 300)
    assert found.f_px == pytest.approx(26 * 1000 / DIAGONAL_MM)
    assert (found.cx_px, found.cy_px) == pytest.approx((260, 120))


def test_tags_of_two_lenses_of_a_phone_are_told(take):
    found = take(
        make="Apple", model="iPhone 13 Pro", lens="iPhone 13 Pro back triple camera 9mm f/2.8", focal=5.7, f35=26
    )
    assert "lens_ambiguous" in codes(found)
    assert relative(found) > 0.3
    same = take(
        make="Apple", model="iPhone 13 Pro", lens="iPhone 13 Pro back triple camera 5.7mm f/1.5", focal=5.7, f35=26
    )
    assert codes(same) == []


@pytest.mark.parametrize(
    ("more", "code"),
    [
        ({"xmp": packet(crs_PerspectiveVertical="-20", crs_AlreadyApplied="True")}, "perspective_edited"),
        ({"xmp": packet(crs_PerspectiveUpright="2")}, "perspective_edited"),
        ({"xmp": packet(crs_PerspectiveScale="110", crs_AlreadyApplied="True")}, "perspective_edited"),
        ({"software": "CamScanner 6"}, "perspective_edited"),
        ({"xmp": packet(GPano_ProjectionType="cylindrical")}, "panorama"),
        ({"rendered": 6}, "panorama"),
    ],
)
@pytest.mark.parametrize("given", [None, "f=400px"])
def test_no_pinhole_for_a_panorama_or_an_edited_perspective(tmp_path, more, code, given):
    photo = Photo.load(write(tmp_path / "a.jpg", **more, **PHONE))
    with pytest.raises(UnknownCameraError) as caught:
        resolve_camera(photo, given)
    assert caught.value.code == code
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "xmp",
    [
        packet(crs_PerspectiveVertical="-20", crs_AlreadyApplied="False"),
        packet(crs_PerspectiveVertical="0", crs_PerspectiveScale="100", crs_AlreadyApplied="True"),
        packet(crs_PerspectiveUpright="0"),
    ],
)
def test_edits_that_are_none_refuse_nothing(take, xmp):
    assert codes(take(xmp=xmp, **PHONE)) == []


@pytest.mark.parametrize(
    ("more", "least", "most"),
    [
        (PHONE, 0.02, 0.021),
        ({"f35": 26, "make": "GoPro", "model": "HERO9 Black"}, 0.25, 0.251),
        ({"f35": 27, "focal": 18.0, "make": "Canon", "lens": "EF-S18-55mm"}, 0.05, 0.051),
        ({"f35": 24, "make": "DJI", "model": "FC6310"}, 0.05, 0.051),
        ({"f35": 26, "make": "Basler"}, 0.1, 0.101),
        ({"f35": 300, "make": "Canon"}, 1.5, 2.5),  # 1 % in the corner of a long lens
        ({"f35": 45, "focal": 30.0, "make": "samsung", "model": "NX300"}, 0.05, 0.051),
    ],
)
def test_the_class_of_the_lens_decides_what_distortion_may_be(take, more, least, most):
    found = take(**more).camera
    assert least <= math.sqrt(found.cov[4, 4]) <= most
    assert found.coefficients[0] == 0


def test_a_preview_of_other_proportions_tells_of_a_crop(tmp_path):
    photo = Photo.load(write(tmp_path / "a.jpg", (400, 300), **PHONE))

    def noted(size):
        return codes(resolve_camera(replace(photo, metadata=replace(photo.metadata, thumbnail_size_px=size))))

    assert noted((160, 107)) == ["cropped"]
    assert noted((160, 120)) == noted(None) == []


@pytest.mark.parametrize("k1", [-0.05, 0.05])
def test_the_distortion_of_a_kit_lens_is_within_u_far_from_the_middle(tmp_path, k1):
    """A frontal rod of 100 mm at 2 m near the corner, drawn by a lens with this k1, measured without knowing it."""
    photo = Photo.load(write(tmp_path / "a.jpg", (3000, 2000), f35=28, focal=18.0, make="Canon"))
    plain = resolve_camera(photo).camera
    true = replace(plain, distortion=np.array([k1, 0, 0, 0, 0]))
    for x in (0.05, 1.0):
        ends = true.project(np.array([[x, x / 2, 2.0], [x + 0.1, x / 2, 2.0]]))
        document = measure_lines(
            photo, [Observation(ends, 0.2)], [Quantity.normal(0.1, 0.0001, "m")], tilt=Quantity.exact(0.0, "rad")
        )
        depth = next(m for m in document.measurements if m.what == "depth")
        assert abs(depth.value - 2.0) < 2 * depth.u
        far = [note for note in document.measurements[0].notes if note.code == "distortion_unknown"]
        assert len(far) == (x > 0.5)
        share = {c.name: c.share for c in depth.budget}.get("lens distortion", 0.0)
        assert (share > 0.3) if far else (share < 0.02)


def test_a_calibrated_lens_gets_no_such_note(tmp_path):
    photo = Photo.load(write(tmp_path / "a.jpg", (3000, 2000), f35=28))
    path = tmp_path / "camera.json"
    path.write_text(json.dumps({"width_px": 3000, "height_px": 2000, "f_px": 2000, "cx_px": 1499.5, "cy_px": 999.5}))
    line = [Observation(np.array([[10.0, 10.0], [200.0, 10.0]]), 0.5)]
    document = measure_lines(photo, line, [Quantity.normal(0.1, 0.001, "m")], camera=str(path))
    assert "distortion_unknown" not in [note.code for note in document.measurements[0].notes]
