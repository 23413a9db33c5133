import heic_boxes
import pytest
from click.testing import CliRunner
from PIL import Image
from written_photos import exif, packet, rational, write

from subtense.cli import main
from subtense.private_tags import private_tags


def with_position(**tags):
    found = exif(make="M", body_serial="B-12", lens_serial="L-9", f35=26, **tags)
    gps = found.get_ifd(0x8825)
    gps[1], gps[2], gps[3], gps[4] = (
        "S",
        tuple(map(rational, (12.0, 30.0, 36.0))),
        "E",
        tuple(map(rational, (8.0, 15.0, 0.0))),
    )
    gps[5], gps[6] = b"\1", rational(12.5)
    return found


EXPECTED = {
    "latitude": "-12.51000000", "longitude": "8.25000000", "altitude above the sea": "-12.500 m", "camera serial number": "B-12",
    "lens serial number": "L-9",
}  # fmt: skip


@pytest.mark.parametrize("ending", ["jpg", "png", "webp", "heic"])
def test_they_are_read_where_asked_for(tmp_path, ending):
    path = tmp_path / f"a.{ending}"
    if ending == "heic":
        path.write_bytes(heic_boxes.heic(exif=with_position()))
    else:
        Image.new("RGB", (40, 30)).save(path, exif=with_position())
    assert private_tags(path) == EXPECTED


def test_those_of_a_drone(tmp_path):
    xmp = packet(drone_dji_GpsLatitude="47.1", drone_dji_GpsLongtitude="8.5", drone_dji_AbsoluteAltitude="+501.5",
                 drone_dji_DroneSerialNumber="D1")  # fmt: skip
    found = private_tags(write(tmp_path / "a.jpg", xmp=xmp))
    assert found == {
        "latitude": "47.1",
        "longitude": "8.5",
        "altitude above the sea": "+501.5 m",
        "drone serial number": "D1",
    }


def test_no_other_output_has_them(tmp_path):
    path = tmp_path / "a.jpg"
    Image.new("RGB", (400, 300)).save(path, exif=with_position())
    for words in (
        ["camera"],
        ["camera", "--format", "json"],
        ["measure", "--line", "10,10,90,10", "--size", "1m", "--format", "json"],
    ):
        shown = CliRunner().invoke(main, [words[0], str(path), *words[1:]], catch_exceptions=False).output
        assert "f_px" in shown or "f = " in shown
        for secret in ("12.51", "8.25", "B-12", "L-9"):
            assert secret not in shown
    asked = CliRunner().invoke(main, ["camera", str(path), "--private"], catch_exceptions=False).output
    assert "latitude: -12.51000000" in asked and "B-12" in asked


def test_a_picture_without_any(tmp_path):
    path = write(tmp_path / "a.jpg")
    assert "no position" in CliRunner().invoke(main, ["camera", str(path), "--private"], catch_exceptions=False).output
