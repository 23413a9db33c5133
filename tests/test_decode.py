"""Decoders beside Pillow's, strips, and buffers. The DNG is made here; LibRaw is what reads it."""

import io
import struct
import sys

import numpy as np
import pytest
from PIL import Image
from PIL.TiffImagePlugin import IFDRational

from subtense import decode
from subtense.errors import FileFormatError, InputError, MissingExtraError
from subtense.photo import Photo


def needs(module, extra):
    return pytest.importorskip(module, reason=f'{module} is not installed; pip install "subtense[{extra}]"')


def quarters(height=64, width=96):
    """Red, green, blue, and white, wider than high."""
    pixels = np.full((height, width, 3), 250, np.uint8)
    top, left = height // 2, width // 2
    pixels[:top, :left], pixels[:top, left:], pixels[top:, :left] = [250, 0, 0], [0, 250, 0], [0, 0, 250]
    return pixels


def corners(pixels):
    """The letter of the brightest channel near each corner, clockwise from the upper left; w for white."""
    height, width = pixels.shape[:2]
    seen = [pixels[y, x] for y, x in ((8, 8), (8, width - 9), (height - 9, width - 9), (height - 9, 8))]
    return "".join("w" if p.min() > 150 else "rgb"[int(p.argmax())] for p in seen)


def camera_exif(orientation):
    exif = Image.Exif()
    exif[0x010F], exif[0x0112] = "Maker", orientation
    ifd = exif.get_ifd(0x8769)
    ifd[0x920A], ifd[0xA002], ifd[0xA003] = IFDRational(35, 10), 96, 64
    return exif.tobytes()


# corners of the four quarters, clockwise from the upper left, after the turn that each orientation asks for
TURNED = {1: "rgwb", 3: "wbrg", 6: "brgw", 8: "gwbr"}


# -- strips ----------------------------------------------------------------------------------------------


def at_once(picture):
    """The whole picture in one go: what strips must equal."""
    picture.load()
    if picture.mode.startswith("I"):
        wide = np.asarray(picture, np.int64)
        return np.repeat((wide >> 8).clip(0, 255).astype(np.uint8)[..., None], 3, axis=2)
    if picture.mode in ("RGBA", "LA", "PA") or "transparency" in picture.info:
        picture = picture.convert("RGBA")
        picture = Image.alpha_composite(Image.new("RGBA", picture.size, "white"), picture)
    return np.asarray(picture.convert("RGB"))


def noise(mode):
    rng = np.random.default_rng(5)
    if mode.startswith("I;16"):
        return Image.fromarray(rng.integers(0, 2**16, (50, 70), np.uint16).astype(">u2" if mode == "I;16B" else "<u2"))
    if mode in ("RGBA", "LA"):
        return Image.fromarray(rng.integers(0, 256, (50, 70, 4), np.uint8)).convert(mode)
    return Image.fromarray(rng.integers(0, 256, (50, 70, 3), np.uint8)).convert(mode)


STORED = [
    ("RGB", "PNG", {}), ("RGB", "JPEG", {}), ("RGB", "PNG", {"transparency": (3, 4, 5)}), ("L", "PNG", {}),
    ("L", "PNG", {"transparency": 7}), ("P", "PNG", {}), ("P", "PNG", {"transparency": 3}),
    ("P", "PNG", {"transparency": bytes(range(256))}), ("RGBA", "PNG", {}), ("RGBA", "WEBP", {"lossless": True}),
    ("LA", "PNG", {}), ("CMYK", "TIFF", {}), ("CMYK", "JPEG", {}), ("I;16", "PNG", {}), ("I;16B", "TIFF", {}), ("1", "PNG", {}),
    ("RGB", "AVIF", {}), ("RGBA", "AVIF", {}), ("F", "TIFF", {}), ("YCbCr", "TIFF", {}),
]  # fmt: skip


@pytest.mark.parametrize(("mode", "form", "options"), STORED)
@pytest.mark.parametrize("strip_px", [1, 1000, 2**20])
def test_strips_give_the_pixels_of_the_whole(tmp_path, monkeypatch, mode, form, options, strip_px):
    monkeypatch.setattr(decode, "STRIP_PIXELS", strip_px)
    path = tmp_path / "a.picture"
    noise(mode).save(path, form, **options)
    photo = Photo.load(path)
    assert (photo.pixels == at_once(Image.open(path))).all()
    assert photo.pixels.flags.c_contiguous


@pytest.mark.parametrize("orientation", range(1, 9))
def test_a_given_buffer_is_filled_upright(tmp_path, monkeypatch, orientation):
    monkeypatch.setattr(decode, "STRIP_PIXELS", 500)
    path = tmp_path / "a.png"
    noise("RGB").save(path, exif=camera_exif(orientation))
    asked = []

    def pixels(height_px, width_px):
        asked.append((height_px, width_px))
        return np.memmap(tmp_path / "out", np.uint8, "w+", shape=(height_px, width_px, 3))

    photo = Photo.load(path, pixels=pixels)
    assert asked == [(70, 50) if orientation >= 5 else (50, 70)]
    assert isinstance(photo.pixels, np.memmap)
    photo.pixels.flush()
    written = np.fromfile(tmp_path / "out", np.uint8).reshape(*asked[0], 3)
    assert (written == Photo.load(path).pixels).all()


@pytest.mark.parametrize(
    "wrong",
    [
        lambda h, w: np.empty((w, h, 3), np.uint8),
        lambda h, w: np.empty((h, w, 3), np.int8),
        lambda h, w: np.broadcast_to(np.uint8(0), (h, w, 3)),
        lambda h, w: bytearray(h * w * 3),
    ],
)
def test_a_buffer_of_another_kind_is_refused(tmp_path, wrong):
    noise("RGB").save(tmp_path / "a.png")
    with pytest.raises(InputError, match=r"writable uint8 array of shape \(50, 70, 3\)"):
        Photo.load(tmp_path / "a.png", pixels=wrong)


def test_a_row_over_pillows_own_limit_is_read(tmp_path, monkeypatch):
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 20)
    monkeypatch.setattr(decode, "STRIP_PIXELS", 1)
    Image.new("RGB", (70, 2), (9, 8, 7)).save(tmp_path / "a.png")
    assert (Photo.load(tmp_path / "a.png").pixels == [9, 8, 7]).all()
    assert Image.MAX_IMAGE_PIXELS == 20


def test_too_little_memory_is_told(tmp_path, monkeypatch):
    noise("RGB").save(tmp_path / "a.png")

    def full(*_):
        raise MemoryError

    monkeypatch.setattr(decode, "_rgb", full)
    with pytest.raises(FileFormatError, match="more memory"):
        Photo.load(tmp_path / "a.png")


# -- AVIF ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("orientation", [1, 3, 6, 8])
def test_an_avif_is_turned_once(tmp_path, orientation):
    Image.fromarray(quarters()).save(tmp_path / "a.avif", exif=camera_exif(orientation))
    photo = Photo.load(tmp_path / "a.avif")
    assert corners(photo.pixels) == TURNED[orientation]
    assert photo.stored_size_px == (96, 64)
    assert (photo.metadata.make, photo.metadata.focal_mm) == ("Maker", 3.5)


# -- HEIC ------------------------------------------------------------------------------------------------


def heic(picture, **options):
    pillow_heif = needs("pillow_heif", "heic")
    file = io.BytesIO()
    pillow_heif.from_pillow(picture).save(file, quality=90, **options)
    return file.getvalue()


@pytest.mark.parametrize("orientation", [1, 3, 6, 8])
@pytest.mark.parametrize("name", ["a.heic", "a.jpg"])
def test_a_heic_is_turned_once(tmp_path, orientation, name):
    (tmp_path / name).write_bytes(heic(Image.fromarray(quarters()), exif=camera_exif(orientation)))
    photo = Photo.load(tmp_path / name)
    assert corners(photo.pixels) == TURNED[orientation]
    assert photo.stored_size_px == (96, 64)
    tags = photo.metadata
    assert (tags.make, tags.focal_mm, tags.tagged_width_px, tags.orientation) == ("Maker", 3.5, 96, orientation)
    assert photo.notes == ()


@pytest.mark.parametrize(("mode", "expected"), [("L", (204,) * 3), ("RGBA", (204,) * 3), ("LA", (204,) * 3)])
def test_a_heic_without_colour_or_with_opacity(tmp_path, mode, expected):
    (tmp_path / "a.heic").write_bytes(heic(Image.new("RGB", (64, 48), (204, 204, 204)).convert(mode)))
    photo = Photo.load(tmp_path / "a.heic")
    assert photo.pixels.shape == (48, 64, 3)
    assert np.abs(photo.pixels.astype(int) - expected).max() <= 2
    assert photo.metadata.focal_mm is None and photo.notes == ()


def test_a_transparent_heic_is_white(tmp_path):
    (tmp_path / "a.heic").write_bytes(heic(Image.new("RGBA", (64, 48), (0, 0, 0, 0))))
    assert Photo.load(tmp_path / "a.heic").pixels.min() >= 253


def test_a_heic_fills_a_given_buffer(tmp_path):
    (tmp_path / "a.heic").write_bytes(heic(Image.fromarray(quarters()), exif=camera_exif(6)))
    out = np.zeros((96, 64, 3), np.uint8)
    assert Photo.load(tmp_path / "a.heic", pixels=lambda h, w: out).pixels is out
    assert corners(out) == TURNED[6]


@pytest.mark.parametrize("kept", [0.01, 0.1, 0.5, 0.99])
def test_a_cut_heic_is_told(tmp_path, kept):
    data = heic(noise("RGB"))
    (tmp_path / "a.heic").write_bytes(data[: int(len(data) * kept)])
    one_line(FileFormatError, tmp_path / "a.heic", "damaged HEIC")


def test_a_huge_heic_is_refused_before_decoding(tmp_path):
    data = heic(Image.fromarray(quarters()))
    at = data.index(b"ispe") + 8
    (tmp_path / "a.heic").write_bytes(data[:at] + struct.pack(">LL", 30_000, 30_000) + data[at + 8 :])
    one_line(FileFormatError, tmp_path / "a.heic", "900 million|damaged HEIC")


def test_an_old_libheif_is_refused(tmp_path, monkeypatch):
    (tmp_path / "a.heic").write_bytes(heic(Image.fromarray(quarters())))
    monkeypatch.setattr(sys.modules["pillow_heif"], "libheif_version", lambda: "1.23.1")
    one_line(FileFormatError, tmp_path / "a.heic", r"1\.23\.1 .* 1\.23\.2 is needed")


@pytest.mark.parametrize(
    ("brands", "form"),
    [
        (b"heic\0\0\0\0mif1", "HEIC"), (b"mif1\0\0\0\0mif1heic", "HEIC"), (b"mif1\0\0\0\0mif1avif", ""), (b"mif1\0\0\0\0mif1", "HEIC"),
        (b"msf1\0\0\0\0hevc", "HEIC"), (b"avif\0\0\0\0mif1", ""), (b"crx \0\0\0\1crx isom", "RAW"), (b"isom\0\0\0\0mp42", ""),
    ],
)  # fmt: skip
def test_a_container_is_told_by_its_brands(brands, form):
    assert decode._form(struct.pack(">L", 8 + len(brands)) + b"ftyp" + brands + b"heic" * 9, "") == form


# -- RAW -------------------------------------------------------------------------------------------------


def dng(orientation=1, order="<", size=(64, 96)):
    """A DNG of the four quarters: 16 bits, RGGB, the colours of sRGB, with its Exif directory. Layout by TIFF 6.0 and DNG 1.4."""

    def numbers(letter, *values):
        return struct.pack(f"{order}{len(values)}{letter}", *values)

    height, width = size
    scene = np.where(quarters(height, width) > 0, 40_000, 3_000)
    mosaic = scene[..., 1].copy()
    mosaic[::2, ::2], mosaic[1::2, 1::2] = scene[::2, ::2, 0], scene[1::2, 1::2, 2]
    xyz = [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
    matrix = [x for value in np.linalg.inv(xyz).ravel() for x in (round(value * 10_000), 10_000)]
    exif = [(0x920A, 5, 1, numbers("L", 50, 1)), (0xA405, 3, 1, numbers("H", 75))]
    exif += [(0xA002, 4, 1, numbers("L", width - 1)), (0xA003, 4, 1, numbers("L", height - 1))]

    def first(exif_at, pixels_at):
        return [
            (254, 4, 1, numbers("L", 0)), (256, 4, 1, numbers("L", width)), (257, 4, 1, numbers("L", height)),
            (258, 3, 1, numbers("H", 16)), (259, 3, 1, numbers("H", 1)), (262, 3, 1, numbers("H", 32803)), (271, 2, 6, b"Maker\0"),
            (272, 2, 6, b"Model\0"), (273, 4, 1, numbers("L", pixels_at)), (274, 3, 1, numbers("H", orientation)),
            (277, 3, 1, numbers("H", 1)), (278, 4, 1, numbers("L", height)), (279, 4, 1, numbers("L", 2 * mosaic.size)),
            (33421, 3, 2, numbers("H", 2, 2)), (33422, 1, 4, bytes([0, 1, 1, 2])), (34665, 4, 1, numbers("L", exif_at)),
            (50706, 1, 4, bytes([1, 4, 0, 0])), (50708, 2, 6, b"Model\0"), (50717, 4, 1, numbers("L", 65_535)),
            (50721, 10, 9, numbers("l", *matrix)), (50728, 5, 3, numbers("L", *[1] * 6)), (50778, 3, 1, numbers("H", 21)),
        ]  # fmt: skip

    def directory(entries, at):
        head, values = numbers("H", len(entries)), b""
        behind = at + 2 + 12 * len(entries) + 4
        for tag, kind, count, value in entries:
            head += numbers("H", tag, kind) + numbers("L", count)
            head += value.ljust(4, b"\0") if len(value) <= 4 else numbers("L", behind + len(values))
            values += value if len(value) > 4 else b""
        return head + numbers("L", 0) + values

    exif_at = 8 + len(directory(first(0, 0), 8))
    pixels_at = exif_at + len(directory(exif, exif_at))
    head = (b"II*\0" if order == "<" else b"MM\0*") + numbers("L", 8)
    body = directory(first(exif_at, pixels_at), 8) + directory(exif, exif_at)
    return head + body + mosaic.astype(f"{order}u2").tobytes()


@pytest.mark.parametrize("orientation", [1, 3, 6, 8])
@pytest.mark.parametrize("order", ["<", ">"])
def test_a_dng_is_developed_and_turned_once(tmp_path, orientation, order):
    needs("rawpy", "raw")
    (tmp_path / "a.tif").write_bytes(dng(orientation, order))
    photo = Photo.load(tmp_path / "a.tif")
    assert (photo.width_px, photo.height_px) == ((64, 96) if orientation >= 5 else (96, 64))
    assert corners(photo.pixels) == TURNED[orientation]
    # 40 000 of 65 535 through the sRGB curve (IEC 61966-2-1) is 0.805
    assert photo.pixels.max(axis=2)[10, 10] == pytest.approx(205, abs=2)
    assert photo.pixels.flags.c_contiguous
    tags = photo.metadata
    assert (tags.make, tags.model, tags.focal_mm, tags.f35_mm, tags.orientation) == (
        "Maker",
        "Model",
        50.0,
        75.0,
        orientation,
    )
    assert photo.stored_size_px == (96, 64)
    assert tags.tagged_width_px is tags.tagged_height_px is None  # the sensor's margins are no crop


def test_a_dng_fills_a_given_buffer(tmp_path):
    needs("rawpy", "raw")
    (tmp_path / "a.dng").write_bytes(dng(6))
    out = np.zeros((96, 64, 3), np.uint8)
    assert Photo.load(tmp_path / "a.dng", pixels=lambda h, w: out).pixels is out
    assert corners(out) == TURNED[6]


@pytest.mark.parametrize("kept", [0.02, 0.2, 0.5, 0.95])
def test_a_cut_raw_is_told(tmp_path, kept, capfd):
    needs("rawpy", "raw")
    data = dng()
    (tmp_path / "a.dng").write_bytes(data[: int(len(data) * kept)])
    one_line(FileFormatError, tmp_path / "a.dng", "RAW picture that is cut, damaged")


def test_the_ending_of_an_unknown_tiff_hints_at_a_raw(tmp_path):
    """A RAW of an unknown maker would else be shown as the thumbnail that it holds."""
    needs("rawpy", "raw")
    Image.fromarray(quarters()).save(tmp_path / "0.bin", "TIFF")
    assert corners(Photo.load(tmp_path / "0.bin").pixels) == "rgwb"
    with pytest.raises(FileFormatError, match="RAW picture"):
        Photo.load(tmp_path / "0.bin", name="DSC1.ARW")


def test_a_huge_sensor_is_refused_before_decoding(tmp_path):
    needs("rawpy", "raw")
    data = dng()
    for tag, before, after in ((256, 96, 20_000), (257, 64, 20_000)):
        data = data.replace(struct.pack("<HHLL", tag, 4, 1, before), struct.pack("<HHLL", tag, 4, 1, after))
    (tmp_path / "a.dng").write_bytes(data)
    one_line(FileFormatError, tmp_path / "a.dng", "400 million")


def test_an_old_libraw_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(needs("rawpy", "raw"), "libraw_version", (0, 21, 4))
    (tmp_path / "a.dng").write_bytes(dng())
    one_line(FileFormatError, tmp_path / "a.dng", r"0\.21\.4 .* 0\.22\.2 is needed")


# -- without the extras ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("module", "extra", "data"),
    [
        ("pillow_heif", "heic", b"\0\0\0\x18ftypheic\0\0\0\0mif1heic"),
        ("rawpy", "raw", dng()),
        ("rawpy", "raw", b"\0\0\0\x18ftypcrx \0\0\0\1crx isom"),
        ("rawpy", "raw", b"FUJIFILMCCD-RAW 0201"),
        ("rawpy", "raw", b"II*\0\x10\0\0\0CR\2\0" + b"\0" * 20),
    ],
)
def test_a_missing_extra_is_named(tmp_path, monkeypatch, module, extra, data):
    monkeypatch.setitem(sys.modules, module, None)
    (tmp_path / "a.picture").write_bytes(data)
    told = one_line(MissingExtraError, tmp_path / "a.picture", rf"subtense\[{extra}\]")
    assert told.extra == extra


def one_line(kind, path, says):
    with pytest.raises(kind, match=says) as caught:
        Photo.load(path)
    assert path.name in str(caught.value)
    assert "\n" not in str(caught.value)
    return caught.value
