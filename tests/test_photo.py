import io

import numpy as np
import pytest
from PIL import Image
from PIL.TiffImagePlugin import IFDRational

from subtense.errors import FileFormatError
from subtense.photo import Photo


def arrow():
    """A picture whose four quarters differ, wider than high."""
    pixels = np.zeros((40, 60, 3), np.uint8)
    pixels[:20, :30], pixels[:20, 30:], pixels[20:, :30] = [250, 0, 0], [0, 250, 0], [0, 0, 250]
    return pixels


def stored_as(pixels, orientation):
    """What a camera stores so that `orientation` makes it upright: the inverse of the EXIF table."""
    inverse = {
        1: lambda p: p, 2: lambda p: p[:, ::-1], 3: lambda p: p[::-1, ::-1], 4: lambda p: p[::-1],
        5: lambda p: p.transpose(1, 0, 2), 6: lambda p: np.rot90(p, 1), 7: lambda p: np.rot90(p.transpose(1, 0, 2), 2),
        8: lambda p: np.rot90(p, -1),
    }  # fmt: skip
    return np.ascontiguousarray(inverse[orientation](pixels))


@pytest.mark.parametrize("orientation", range(1, 9))
def test_orientation_is_applied_once(tmp_path, orientation):
    exif = Image.Exif()
    exif[0x0112] = orientation
    path = tmp_path / "a.png"
    Image.fromarray(stored_as(arrow(), orientation)).save(path, exif=exif)
    photo = Photo.load(path)
    assert (photo.pixels == arrow()).all()
    assert (photo.width_px, photo.height_px) == (60, 40)
    assert photo.stored_size_px == ((40, 60) if orientation >= 5 else (60, 40))


@pytest.mark.parametrize("orientation", range(1, 9))
def test_a_tiff_that_pillow_turns_is_not_turned_again(tmp_path, orientation):
    path = tmp_path / "a.tif"
    Image.fromarray(stored_as(arrow(), orientation)).save(path, tiffinfo={0x0112: orientation})
    photo = Photo.load(path)
    assert (photo.pixels == arrow()).all()
    assert photo.metadata.orientation == orientation
    assert photo.stored_size_px == ((40, 60) if orientation >= 5 else (60, 40))


def test_an_invalid_orientation_is_told(tmp_path):
    exif = Image.Exif()
    exif[0x0112] = 9
    Image.fromarray(arrow()).save(tmp_path / "a.jpg", exif=exif)
    photo = Photo.load(tmp_path / "a.jpg")
    assert [n.code for n in photo.notes] == ["orientation_invalid"]


def in_mode(mode):
    if mode == "I;16":
        return Image.fromarray(np.full((20, 30), 40_000, np.uint16))
    return Image.new("RGB", (30, 20), (204, 204, 204)).convert(mode)


def writable():
    """The pairs of mode and format that Pillow writes."""
    for mode in ("RGB", "L", "P", "RGBA", "LA", "1", "CMYK", "I;16"):
        for form in ("PNG", "TIFF", "WEBP", "JPEG", "BMP"):
            try:
                in_mode(mode).save(io.BytesIO(), form)
            except (OSError, ValueError):
                continue
            if mode != "I;16" or form in ("PNG", "TIFF"):
                yield mode, form


@pytest.mark.parametrize(("mode", "form"), list(writable()))
def test_every_mode_becomes_upright_rgb(tmp_path, mode, form):
    path = tmp_path / "a.picture"
    in_mode(mode).save(path, form)
    photo = Photo.load(path)
    assert photo.pixels.shape == (20, 30, 3)
    assert photo.pixels.dtype == np.uint8
    # one bit a pixel is dithered: only its mean is that of the picture
    assert photo.pixels.mean() == pytest.approx(40_000 / 256 if mode == "I;16" else 204, abs=15 if mode == "1" else 2)


def test_transparent_is_white(tmp_path):
    Image.new("RGBA", (8, 8), (0, 0, 0, 0)).save(tmp_path / "a.png")
    assert (Photo.load(tmp_path / "a.png").pixels == 255).all()


@pytest.fixture
def broken(tmp_path):
    whole = tmp_path / "whole.jpg"
    Image.effect_noise((400, 300), 80).convert("RGB").save(whole)
    data = whole.read_bytes()
    files = {
        "empty.jpg": b"", "cut.jpg": data[: len(data) // 2], "head.jpg": data[:30], "page.pdf": b"%PDF-1.7\n...",
        "text.jpg": b"hello", "a.gif": b"GIF89a....",
        "a.mp4": b"\0\0\0\x18ftypisom" + b"\0" * 40, "a.avif": b"\0\0\0\x18ftypavif" + b"\0" * 40,
        "a.png": b"\x89PNG\r\n\x1a\n" + b"x" * 50,
    }  # fmt: skip
    for name, content in files.items():
        (tmp_path / name).write_bytes(content)
    (tmp_path / "folder").mkdir()
    return tmp_path


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("empty.jpg", "empty"), ("cut.jpg", "cut or damaged"), ("head.jpg", "damaged"), ("page.pdf", "PDF"), ("text.jpg", "not a picture"),
        ("a.gif", "GIF"), ("a.mp4", "film"), ("a.avif", "AVIF"), ("a.png", "damaged"),
        ("folder", "folder"), ("missing.jpg", "no such file"),
    ],
)  # fmt: skip
def test_broken_files_are_named_with_their_reason(broken, name, says):
    with pytest.raises(FileFormatError, match=says) as caught:
        Photo.load(broken / name)
    assert name in str(caught.value)
    assert "\n" not in str(caught.value)


def test_four_hundred_million_pixels_are_refused_before_decoding(tmp_path):
    path = tmp_path / "huge.png"
    Image.new("1", (20_000, 20_000)).save(path)
    with pytest.raises(FileFormatError, match="400 million"):
        Photo.load(path)
    assert Image.MAX_IMAGE_PIXELS is not None  # Pillow's own limit is back in place


def test_metadata_is_read_tag_by_tag(tmp_path):
    exif = Image.Exif()
    exif[0x010F], exif[0x0110] = "Maker\x07", "  Model \x00 X "
    ifd = exif.get_ifd(0x8769)
    ifd[0x920A], ifd[0xA405], ifd[0xA20E], ifd[0xA210] = IFDRational(35, 10), 26, IFDRational(1000, 1), 3
    ifd[0xA404] = IFDRational(0, 0)
    Image.fromarray(arrow()).save(tmp_path / "a.jpg", exif=exif)
    tags = Photo.load(tmp_path / "a.jpg").metadata
    assert (tags.make, tags.model, tags.focal_mm, tags.f35_mm) == ("Maker", "Model X", 3.5, 26.0)
    assert tags.focal_plane_x_per_mm == pytest.approx(100.0)
    assert tags.digital_zoom is None


@pytest.mark.parametrize(
    ("given", "shown"),
    [("desk.jpg", "desk.jpg"), ("C:\\x\\desk.jpg", "desk.jpg"), ("../de\nsk.jpg", "de sk.jpg"), ("/", "0.bin")],
)
def test_a_given_name_is_shown_in_results_and_errors(tmp_path, given, shown):
    path = tmp_path / "0.bin"
    Image.fromarray(arrow()).save(path, "PNG")
    photo = Photo.load(path, name=given)
    assert photo.name == photo.to_json()["name"] == shown
    assert photo.path == path
    path.write_bytes(b"hello")
    with pytest.raises(FileFormatError) as caught:
        Photo.load(path, name=given)
    assert str(caught.value).startswith(f"{shown}: is not a picture")


def test_output_has_no_path_and_no_position(tmp_path):
    Image.fromarray(arrow()).save(tmp_path / "a.jpg")
    data = Photo.load(tmp_path / "a.jpg").to_json()
    assert data["name"] == "a.jpg"
    assert str(tmp_path) not in str(data)
    assert set(data) == {"name", "width_px", "height_px", "sha256"}
