import json
import math
import struct

import heic_boxes
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image
from written_photos import exif, packet, write

from subtense.errors import FileFormatError
from subtense.metadata import Metadata
from subtense.photo import Photo
from subtense.workflow.resolve_camera import CAMERA_SOURCES

ALL = {
    "make": "Maker", "model": "Model", "software": "Firmware 3", "lens": "Lens 4 mm", "focal": 4.25, "f35": 26, "f_number": 1.8,
    "exposure": 0.01, "distance": 1.5, "lens_spec": (1.5, 9.0, 1.8, 2.8), "fp_x": 2500.0, "fp_y": 2500.0, "fp_unit": 3,
    "width": 400, "height": 300, "zoom": 1.0,
}  # fmt: skip


def told(path):
    return Photo.load(path).metadata


@pytest.mark.parametrize("ending", ["jpg", "png", "tif", "webp"])
def test_exif_and_xmp_are_read_from_every_format(tmp_path, ending):
    path = write(tmp_path / f"a.{ending}", xmp=packet(drone_dji_GimbalPitchDegree="-30.0"), **ALL)
    found = told(path)
    assert (found.make, found.model, found.software, found.lens) == ("Maker", "Model", "Firmware 3", "Lens 4 mm")
    assert (found.focal_mm, found.f35_mm, found.f_number, found.exposure_s) == (4.25, 26, 1.8, 0.01)
    assert (found.subject_distance_m, found.digital_zoom) == (1.5, 1.0)
    assert found.lens_focal_mm == pytest.approx((1.5, 9.0)) and found.lens_f_number == pytest.approx((1.8, 2.8))
    assert found.focal_plane_x_per_mm == pytest.approx(250)
    assert (found.tagged_width_px, found.tagged_height_px) == (400, 300)
    assert found.xmp == {"drone-dji:GimbalPitchDegree": "-30.0"}


def test_exif_and_xmp_are_read_from_a_heic(tmp_path):
    path = tmp_path / "a.heic"
    path.write_bytes(heic_boxes.heic(exif=exif(**ALL), xmp=packet(tiff_Model="X", drone_dji_GimbalPitchDegree="-30")))
    found = told(path)
    assert (found.model, found.focal_mm, found.f35_mm, found.lens_focal_mm) == ("Model", 4.25, 26, (1.5, 9.0))
    assert found.xmp["drone-dji:GimbalPitchDegree"] == "-30"
    assert found.form == "HEIC"


def test_what_exif_leaves_out_xmp_tells(tmp_path):
    xmp = packet(
        exif_FocalLength="350/10",
        exif_FocalLengthIn35mmFilm="52",
        exifEX_LensModel="Long",
        tiff_Make="M",
        exif_FNumber="28/10",
    )
    found = told(write(tmp_path / "a.png", xmp=xmp, make="Own"))
    assert (found.focal_mm, found.f35_mm, found.lens, found.make, found.f_number) == (35.0, 52.0, "Long", "Own", 2.8)


def test_metadata_survive_json(tmp_path):
    found = told(write(tmp_path / "a.jpg", xmp=packet(GPano_ProjectionType="equirectangular"), **ALL))
    assert Metadata.from_json(json.loads(json.dumps(found.to_json()))) == found


@pytest.mark.parametrize(
    ("tags", "save", "aspect"),
    [
        ({"x_res": 300.0, "y_res": 150.0}, {}, 0.5),
        ({}, {"dpi": (300, 300)}, 1.0),
        ({}, {}, None),
    ],
)
def test_pixel_aspect_of_a_jpeg(tmp_path, tags, save, aspect):
    Image.new("RGB", (40, 30)).save(tmp_path / "a.jpg", exif=exif(**tags), **save)
    assert told(tmp_path / "a.jpg").pixel_aspect == (pytest.approx(aspect) if aspect else pytest.approx(1.0))


def test_pixel_aspect_of_a_png(tmp_path):
    Image.new("RGB", (40, 30)).save(tmp_path / "a.png", dpi=(100, 91))
    assert told(tmp_path / "a.png").pixel_aspect == pytest.approx(0.91, abs=0.001)


def test_the_previews_size_is_read(tmp_path):
    thumbnail = tmp_path / "t.jpg"
    Image.new("RGB", (160, 120)).save(thumbnail)
    block = exif(**ALL).tobytes()
    # a second directory behind the first: offset and length of a JPEG
    head = bytearray(block[6:])
    order = "<" if head[:2] == b"II" else ">"
    first = struct.unpack_from(order + "L", head, 4)[0]
    link = first + 2 + 12 * struct.unpack_from(order + "H", head, first)[0]
    at = len(head)
    struct.pack_into(order + "L", head, link, at)
    data = thumbnail.read_bytes()
    head += struct.pack(order + "HHHLLHHLLL", 2, 0x0201, 4, 1, at + 30, 0x0202, 4, 1, len(data), 0) + data
    Image.new("RGB", (400, 300)).save(tmp_path / "a.jpg", exif=b"Exif\0\0" + bytes(head))
    assert told(tmp_path / "a.jpg").thumbnail_size_px == (160, 120)


def test_an_xmp_packet_of_a_jpeg_that_is_split_is_joined(tmp_path):
    xmp = packet(elements="<GPano:ProjectionType>equirectangular</GPano:ProjectionType>" + "<!-- -->" * 9000)
    pieces = [xmp[i : i + 60_000] for i in range(0, len(xmp), 60_000)]
    Image.new("RGB", (8, 8)).save(tmp_path / "a.jpg")
    data = (tmp_path / "a.jpg").read_bytes()
    more = b""
    for number, piece in enumerate(pieces):
        body = (
            b"http://ns.adobe.com/xmp/extension/\0" + b"0" * 32 + struct.pack(">LL", len(xmp), number * 60_000) + piece
        )
        more += b"\xff\xe1" + struct.pack(">H", len(body) + 2) + body
    (tmp_path / "a.jpg").write_bytes(data[:2] + more + data[2:])
    assert len(pieces) == 2
    assert told(tmp_path / "a.jpg").xmp == {"GPano:ProjectionType": "equirectangular"}


@pytest.mark.parametrize(
    "xmp",
    [
        b'<!DOCTYPE x [<!ENTITY a "aaaa">]><x>&a;</x>', b"<a>" * 5000, b"not xml", b"<a><b></a>", b"\xff\xfe\0<",
        b'<?xml version="1.0" encoding="nonsense"?><a/>', packet(crs_HasCrop="True") + b"<b/>",
    ],
)  # fmt: skip
def test_a_damaged_packet_is_noted_and_the_exif_kept(tmp_path, xmp):
    photo = Photo.load(write(tmp_path / "a.webp", xmp=xmp, f35=26))
    assert [note.code for note in photo.notes] == ["metadata_damaged"]
    assert photo.metadata.f35_mm == 26


def test_a_packet_over_the_limit_is_left_out(tmp_path):
    photo = Photo.load(write(tmp_path / "a.webp", xmp=packet(crs_HasCrop="True") + b" " * 2**22, f35=26))
    assert photo.metadata.xmp == {}


def test_positions_and_serial_numbers_are_not_read(tmp_path):
    secret = "SECRET123"
    xmp = packet(
        drone_dji_GpsLatitude="47.123456",
        drone_dji_CameraSerialNumber=secret,
        aux_SerialNumber=secret,
        drone_dji_AbsoluteAltitude="+501.5",
    )
    photo = Photo.load(write(tmp_path / "a.jpg", xmp=xmp, body_serial=secret, lens_serial=secret, f35=26))
    shown = json.dumps(photo.metadata.to_json()) + json.dumps(photo.to_json())
    for word in (secret, "47.123", "501.5"):
        assert word not in shown


@pytest.mark.parametrize("form", ["JPEG", "PNG", "WEBP", "TIFF", "progressive"])
def test_a_cut_file_is_refused_with_its_code(tmp_path, form):
    rng = np.random.default_rng(1)
    whole = tmp_path / "a.jpg"
    picture = Image.fromarray(rng.integers(0, 255, (300, 400, 3), np.uint8))
    picture.save(whole, "JPEG", progressive=True) if form == "progressive" else picture.save(whole, form)
    data = whole.read_bytes()
    for part in (0.02, 0.5, 0.97):
        whole.write_bytes(data[: int(part * len(data))])
        with pytest.raises(FileFormatError) as caught:
            Photo.load(whole)
        assert caught.value.code == "partial_file", part


def test_a_cut_heic_is_refused_with_its_code(tmp_path):
    data = heic_boxes.heic()
    (tmp_path / "a.heic").write_bytes(data[: len(data) - 60])
    with pytest.raises(FileFormatError) as caught:
        Photo.load(tmp_path / "a.heic")
    assert caught.value.code == "partial_file"


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_mutated_metadata_never_raise(tmp_path, data):
    """Bytes of EXIF and XMP changed at random: the picture still loads, and every source says something or nothing."""
    block = bytearray(exif(**ALL).tobytes())
    xmp = bytearray(packet(crs_HasCrop="True", crs_CropTop="0.1", crs_AlreadyApplied="True", GPano_FullPanoWidthPixels="800",
                           drone_dji_DewarpData="d;3600,3600,1,2,-0.2,0.1,0,0,0", Camera_PrincipalPoint="2.4,1.8",
                           ImagingModel_FocalLengthX="0.8", drone_dji_GimbalPitchDegree="-90"))  # fmt: skip
    for target in (block, xmp):
        for _ in range(data.draw(st.integers(1, 8))):
            target[data.draw(st.integers(6, len(target) - 1))] = data.draw(st.integers(0, 255))
    path = tmp_path / "a.webp"
    Image.new("RGB", (40, 30)).save(path, exif=bytes(block), xmp=bytes(xmp))
    photo = Photo.load(path)
    for source in CAMERA_SOURCES.values():
        found = source(photo)
        assert found.camera is None or math.isfinite(found.camera.u_f_px)
    Metadata.from_json(json.loads(json.dumps(photo.metadata.to_json())))
