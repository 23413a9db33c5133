import io
import struct

import heic_boxes
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image
from PIL.TiffImagePlugin import IFDRational

from subtense.heif_boxes import camera_matrix
from subtense.tiff_tags import (
    apple_acceleration,
    camera_tags,
    is_raw_tiff,
    preview_size,
    private_tags,
    raw_camera_tags,
    xmp_packet,
)


def exif():
    """EXIF as Pillow writes it: the other software that the reader is held against."""
    tags = Image.Exif()
    tags[0x010F], tags[0x0110], tags[0x0112] = "Maker", "Model", 6
    ifd = tags.get_ifd(0x8769)
    ifd[0x920A], ifd[0xA405], ifd[0xA002], ifd[0xA434] = IFDRational(35, 10), 26, 4000, "Lens"
    return tags.tobytes()[6:]


WANTED = {0x010F: "Maker", 0x0110: "Model", 0x0112: 6, 0x920A: 3.5, 0xA405: 26, 0xA002: 4000, 0xA434: "Lens"}


def without_pointer(tags):
    return {tag: value for tag, value in tags.items() if tag != 0x8769}


def test_the_tags_of_both_directories_are_read():
    assert without_pointer(camera_tags(exif())) == WANTED
    assert without_pointer(camera_tags(b"before" + exif(), 6)) == WANTED


def test_no_header_is_none():
    assert camera_tags(b"") is None
    assert camera_tags(b"XX*\0aaaaaaaa") is None


def test_signatures_that_pillow_refuses_are_read():
    """Olympus and Panasonic write a TIFF under numbers of their own."""
    whole = exif()
    for signature in (b"MMOR", b"MM\0U"):
        assert without_pointer(raw_camera_tags(signature + whole[4:])) == WANTED


def test_a_raf_tells_by_the_jpeg_within():
    jpeg = io.BytesIO()
    Image.new("RGB", (8, 8)).save(jpeg, "JPEG", exif=b"Exif\0\0" + exif())
    head = b"FUJIFILMCCD-RAW ".ljust(84, b"\0") + struct.pack(">LL", 160, len(jpeg.getvalue()))
    assert without_pointer(raw_camera_tags(head.ljust(160, b"\0") + jpeg.getvalue())) == WANTED
    assert raw_camera_tags(head) == {}


def test_a_cr3_tells_by_its_boxes():
    one = exif()
    two = struct.pack("<2sHLHHHLLLLL", b"II", 42, 8, 1, 0x920A, 5, 1, 26, 0, 50, 1)  # the Exif directory alone
    data = (
        b"\0\0\0\x18ftypcrx "
        + b"\0" * 12
        + b"".join(struct.pack(">L", len(box) + 8) + name + box for name, box in ((b"CMT1", one), (b"CMT2", two)))
    )
    assert without_pointer(raw_camera_tags(data)) == WANTED
    assert raw_camera_tags(data.replace(b"CMT1", b"free")) == {0x920A: 50.0}


def tiff(entries, more=b""):
    directory = struct.pack("<H", len(entries)) + b"".join(struct.pack("<HHLL", *entry) for entry in entries)
    return b"II*\0" + struct.pack("<L", 8) + directory + b"\0\0\0\0" + more


CFA = struct.pack("<HHHLL", 1, 0x0106, 3, 1, 32803) + b"\0\0\0\0"


@pytest.mark.parametrize(
    ("data", "raw"),
    [
        (tiff([(0x0106, 3, 1, 2)]), False),
        (tiff([(0x0106, 3, 1, 32803)]), True),
        (tiff([(0x0106, 3, 1, 34892)]), True),
        (tiff([(0xC612, 1, 4, 0x0401)]), True),
        (tiff([(0x0106, 3, 1, 2), (0x014A, 4, 1, 38)], CFA), True),  # a NEF: a thumbnail, and the sensor below
        (tiff([(0x0106, 3, 1, 2), (0x014A, 4, 1, 39)], CFA), False),
        (tiff([(0x0106, 3, 1, 2), (0x014A, 2, 4, 0x61616161)]), False),
        (tiff([(0x0106, 3, 1, 2), (0x014A, 9, 1, 0xFFFFFFFF)]), False),
        (b"\xff\xd8", False),
    ],
)
def test_a_raw_is_told_from_a_tiff_by_its_tags(data, raw):
    assert is_raw_tiff(data) is raw


def test_a_long_value_and_one_outside_are_left_out():
    assert camera_tags(tiff([(0x010F, 2, 2**31, 8), (0x0110, 2, 100, 2**31), (0x0112, 3, 1, 6)])) == {0x0112: 6}
    assert camera_tags(tiff([(0x010F, 2, 5000, 8)], b"a" * 9000)) == {}
    assert camera_tags(tiff([(0x010F, 2, 9, 26)], b"a" * 9000)) == {0x010F: "a" * 9}


@given(st.data())
def test_damaged_bytes_never_raise(data):
    whole = bytearray(exif() + tiff([(0x014A, 4, 2, 8), (0x8769, 4, 1, 8)]))
    for _ in range(data.draw(st.integers(1, 12))):
        whole[data.draw(st.integers(2, len(whole) - 1))] = data.draw(st.integers(0, 255))
    cut = bytes(whole[: data.draw(st.integers(0, len(whole)))])
    camera_tags(cut)
    is_raw_tiff(cut)
    raw_camera_tags(b"FUJIFILMCCD-RAW" + cut)
    raw_camera_tags(b"\0\0\0\x18ftypcrx CMT1" + cut)
    for read in (preview_size, private_tags, xmp_packet):
        read(cut)
    apple_acceleration(b"Apple iOS\0\0\x01MM" + cut)


@given(st.data())
def test_damaged_boxes_of_a_heic_never_raise(data):
    whole = bytearray(heic_boxes.heic(properties=[heic_boxes.cmin(1.2, 0.5, 0.5), heic_boxes.clap(300, 200, 1, 2)]))
    meta = whole.find(b"meta")
    for _ in range(data.draw(st.integers(1, 12))):
        whole[data.draw(st.integers(meta, meta + 420))] = data.draw(st.integers(0, 255))
    camera_matrix(bytes(whole[: data.draw(st.integers(0, len(whole)))]))


def test_the_xmp_packet_of_a_raw_is_found():
    """A DNG: XMP stands in a tag of bytes, longer than other values may be."""
    packet = b"<x>" + b" " * 50_000 + b"</x>"
    assert xmp_packet(tiff([(0xC612, 1, 4, 0x0401), (0x02BC, 1, len(packet), 38)], packet)) == packet
    assert xmp_packet(tiff([(0x02BC, 7, 4, 0x3E613C20)])) == b" <a>"
    assert xmp_packet(tiff([(0xC612, 1, 4, 0x0401)])) is None
    assert xmp_packet(b"\xff\xd8") is None
