"""Decode: from the bytes of a picture to rows of RGB, with the decoder that its content asks for.

Pillow decodes JPEG, PNG, TIFF, WebP, BMP and AVIF; pillow-heif (the extra `heic`) HEIC; rawpy (the extra `raw`) the RAW files
of cameras. What a file is, is told by its content; its ending only hints that a TIFF of an unknown maker is a RAW, of which
Pillow would show the thumbnail.

Rows come in strips, so that no second copy of a whole picture is made on the way into the array it is kept in.
"""

from __future__ import annotations

import importlib
import io
import re
import threading
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np

from .arrays import Pixels
from .errors import FileFormatError, InputError, MissingExtraError
from .heif_boxes import camera_matrix
from .tiff_tags import camera_tags, is_raw_tiff, preview_size, raw_camera_tags, xmp_packet

MOST_EXIF_BYTES = 2**20
MOST_XMP_BYTES = 2**22
STRIP_PIXELS = 2**20
FORMATS = ("JPEG", "PNG", "TIFF", "WEBP", "BMP", "AVIF")
"""What Pillow decodes here."""
HEIC_BRANDS = (b"heic", b"heix", b"heim", b"heis", b"hevc", b"hevx", b"hevm", b"hevs")
AVIF_BRANDS = (b"avif", b"avis")
RAW_SIGNATURES = (b"FUJIFILMCCD-RAW", b"IIRO", b"IIRS", b"MMOR", b"IIU\0", b"\0MRM", b"FOVb", b"II\x1a\0\0\0HEAPCCDR")
RAW_ENDINGS = (
    ".3fr", ".arw", ".cr2", ".crw", ".dcr", ".dng", ".erf", ".fff", ".iiq", ".kdc", ".mef", ".mos", ".nef", ".nrw", ".orf",
    ".pef", ".rw2", ".rwl", ".sr2", ".srf", ".srw",
)  # fmt: skip
OLDEST_LIBHEIF = (1, 23, 2)
"""Older ones run code that a picture brings along."""
OLDEST_LIBRAW = (0, 22, 2)
"""Older ones write past their memory on crafted files."""
SRGB_GAMMA = (2.4, 12.92)
"""Power and slope of the transfer curve, the one that edges are fitted through."""
ORIENTATION_OF_FLIP = {0: 1, 1: 2, 2: 4, 3: 3, 4: 5, 5: 8, 6: 6, 7: 7}
"""LibRaw's flip (1 mirrored, 2 top to bottom, 4 transposed, added) as an EXIF orientation."""

Rows = Callable[[int, int], Pixels]
"""From a first row to the one after the last: (rows, width, 3) uint8 RGB, or (rows, width, 1) for gray."""
Buffer = Callable[[int, int], Pixels]
"""From height and width in px to a writable (height, width, 3) uint8 array."""


@dataclass(frozen=True)
class Decoded:
    """Pixels in the decoder's memory.

    Attributes:
        width_px: width of what the decoder gives.
        height_px: its height.
        orientation: the EXIF orientation that is still to be applied; 1 where the decoder has applied it.
        rows: the pixels.
        single: whether they are one channel, kept as one and seen three times.
    """

    width_px: int
    height_px: int
    orientation: int
    rows: Rows
    single: bool = False


@dataclass(frozen=True)
class Beside:
    """What a file tells of its camera beside the EXIF tags.

    Attributes:
        xmp: the packet.
        preview_px: width and height of the preview within.
        densities: pixels along a length in x and y, the unit of both the same.
        intrinsic_matrix: 3 x 3 row by row, px, from a HEIC.
        exif: bytes with a TIFF header, and where it begins, for who is asked for what is not kept.
    """

    xmp: bytes | None = None
    preview_px: tuple[int, int] | None = None
    densities: tuple[float, float] | None = None
    intrinsic_matrix: tuple[float, ...] | None = None
    exif: tuple[bytes, int] | None = None


@dataclass(frozen=True)
class Opened:
    """A picture whose head is read and whose pixels are not yet.

    Attributes:
        form: "HEIC", "RAW", or Pillow's name of the format.
        width_px: width by the head.
        height_px: height by the head.
        tags: reads the EXIF tags, by number; gives None where they are damaged. Some stand behind the pixels and decode them,
            so the size is looked at first.
        beside: reads what else is told.
        decode: decodes the pixels.
    """

    form: str
    width_px: int
    height_px: int
    tags: Callable[[], dict[int, Any] | None]
    beside: Callable[[], Beside]
    decode: Callable[[], Decoded]


def open_picture(data: bytes, label: object, ending: str = "", *, gray: bool = False) -> Opened:
    """Read a picture's head.

    Args:
        data: the file.
        label: what it is called in an error.
        ending: of its name, ".dng"; a hint.
        gray: whether the luma of a colour JPEG will do, which is quicker to decode.

    Raises:
        FileFormatError: no picture, a damaged one, or a decoder too old for a stranger's file.
        MissingExtraError: its decoder is not installed.
    """
    form = _form(data, ending.lower())
    if form == "":
        return _open_other(data, label, gray=gray)
    return {"HEIC": _open_heic, "RAW": _open_raw}[form](data, label)


def upright(decoded: Decoded, label: object, pixels: Buffer | None = None) -> Pixels:
    """The picture as it is looked at, (height, width, 3) uint8 RGB, in `pixels`' array where one is given.

    Raises:
        InputError: `pixels` gave an array of another kind.
    """
    size = (decoded.height_px, decoded.width_px)
    height, width = size[::-1] if decoded.orientation >= 5 else size
    single = decoded.single and pixels is None
    out = np.empty((height, width, 1), np.uint8) if single else _array(pixels, height, width, label)
    stored = as_stored(out, decoded.orientation)
    rows_at_once = max(1, STRIP_PIXELS // decoded.width_px)
    with _guarded(label):
        for top in range(0, decoded.height_px, rows_at_once):
            bottom = min(top + rows_at_once, decoded.height_px)
            stored[top:bottom] = decoded.rows(top, bottom)
    return np.broadcast_to(out, (height, width, 3)) if single else out


@contextmanager
def _guarded(
    label: object, what: str = "is cut or damaged", cure: str = "copy it again from the camera"
) -> Iterator[None]:
    """A decoder raises what it likes on a stranger's file; from here it leaves as one line."""
    try:
        yield
    except (FileFormatError, MissingExtraError):
        raise
    except MemoryError:
        raise FileFormatError(label, "takes more memory than there is, so resize it") from None
    except Exception as error:
        told = error.args[0] if error.args else ""
        reason = " ".join((told.decode("utf-8", "replace") if isinstance(told, bytes) else str(error)).split())[:80]
        raise FileFormatError(label, f"{what} ({reason}); {cure}", code="partial_file") from None


def _array(pixels: Buffer | None, height_px: int, width_px: int, label: object) -> Pixels:
    shape = (height_px, width_px, 3)
    if pixels is None:
        with _guarded(label):
            return np.empty(shape, np.uint8)
    out = pixels(height_px, width_px)
    if not (isinstance(out, np.ndarray) and out.dtype == np.uint8 and out.shape == shape and out.flags.writeable):
        given = f"{out.dtype} of shape {out.shape}" if isinstance(out, np.ndarray) else type(out).__name__
        raise InputError("pixels", given, f"give a writable uint8 array of shape {shape}")
    return out


def as_stored(out: Pixels, orientation: int) -> Pixels:
    """A view of the upright array in the frame of the file, so that writing into it turns.

    EXIF orientation: 2 mirrored, 3 half turn, 4 mirrored top to bottom, 5 to 8 with a quarter turn.
    """
    across = out.swapaxes(0, 1)
    return {
        2: out[:, ::-1], 3: out[::-1, ::-1], 4: out[::-1],
        5: across, 6: across[::-1], 7: across[::-1, ::-1], 8: across[:, ::-1],
    }.get(orientation, out)  # fmt: skip


# -- what a file is --------------------------------------------------------------------------------------


def _form(data: bytes, ending: str) -> str:
    brands = _brands(data)
    if brands:
        if brands[0] == b"crx ":
            return "RAW"
        # mif1 and msf1 say only that it is a container: what it holds stands among the brands after it
        told = next((b for b in brands if b in (*HEIC_BRANDS, *AVIF_BRANDS)), None)
        container = brands[0] in (b"mif1", b"msf1")
        return "HEIC" if told in HEIC_BRANDS or (container and told is None) else ""
    if data.startswith(RAW_SIGNATURES) or (data[8:10] == b"CR" and data[:2] in (b"II", b"MM")):
        return "RAW"
    tiff = data[:4] in (b"II*\0", b"MM\0*")
    return "RAW" if tiff and (ending in RAW_ENDINGS or is_raw_tiff(data)) else ""


def _brands(data: bytes) -> list[bytes]:
    """The brands of an ISO base media file, the major one first; empty where it is none."""
    if data[4:8] != b"ftyp":
        return []
    end = min(int.from_bytes(data[:4], "big"), 256, len(data))
    return [data[8:12], *(data[at : at + 4] for at in range(16, end - 3, 4))]


_SIGNATURES = (
    (b"%PDF", "is a PDF; export the page as PNG or JPEG"), (b"GIF8", "is a GIF; save it as PNG"),
    (b"PK\x03\x04", "is an archive; unpack it"), (b"RIFF", "is a damaged or unknown RIFF file"),
    (b"\xff\xd8", "is a damaged JPEG"), (b"\x89PNG", "is a damaged PNG"), (b"<svg", "is an SVG; export it as PNG"),
)  # fmt: skip


def _what_it_is(data: bytes) -> str:
    for signature, text in _SIGNATURES:
        if data.startswith(signature):
            return text
    brands = _brands(data)
    if any(brand in AVIF_BRANDS for brand in brands):
        return "is a damaged AVIF, or this Pillow is built without AVIF; save it as JPEG"
    if brands:
        return "is a film or of an unknown kind; save a picture of it as PNG or JPEG"
    return f"is not a picture that can be read; give one of {', '.join(FORMATS)}, HEIC, RAW"


def _size_px(picture: Any) -> tuple[int, int]:
    width, height = picture.size
    return int(width), int(height)


# -- Pillow ----------------------------------------------------------------------------------------------


_PILLOW = threading.Lock()
_IN_USE: list[int | None] = []
"""Pillow's own limit, once for each thread that works without it."""


@contextmanager
def _pillow_without_its_own_limit() -> Iterator[Any]:
    """Pillow with our limit on pixels in place of its own; that is a global, so the last one out puts it back."""
    from PIL import Image

    with _PILLOW:
        _IN_USE.append(_IN_USE[0] if _IN_USE else Image.MAX_IMAGE_PIXELS)
        Image.MAX_IMAGE_PIXELS = None
    try:
        yield Image
    finally:
        with _PILLOW:
            own = _IN_USE.pop()
            if not _IN_USE:
                Image.MAX_IMAGE_PIXELS = own


def _open_other(data: bytes, label: object, *, gray: bool = False) -> Opened:
    with _pillow_without_its_own_limit() as Image:
        try:
            picture = Image.open(io.BytesIO(data), formats=FORMATS)
        except Exception:
            reason = _what_it_is(data)
            raise FileFormatError(label, reason, code="partial_file" if "damaged" in reason else None) from None

    def decode() -> Decoded:
        if gray and picture.format == "JPEG":
            picture.draft("L", picture.size)  # the luma alone, as it is stored
        with _pillow_without_its_own_limit(), _guarded(label):
            picture.load()
        # Pillow turns a TIFF itself, and takes the tag away: what is left of it is still to be applied
        left = (_exif_tags(picture) or {}).get(0x0112, 1)
        orientation = left if left in range(1, 9) else 1
        single = gray and picture.mode == "L"
        return Decoded(*_size_px(picture), orientation, lambda top, bottom: _strip(picture, top, bottom), single)

    form = "JPEG" if picture.format == "MPO" else str(picture.format)  # an MPO is a JPEG with others behind it
    return Opened(form, *_size_px(picture), lambda: _exif_tags(picture), lambda: _beside(picture, data), decode)


def _exif_tags(picture: Any) -> dict[int, Any] | None:
    if len(picture.info.get("exif", b"")) > MOST_EXIF_BYTES:
        return None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            exif = picture.getexif()
            return {**exif, **exif.get_ifd(0x8769), 0x0112: exif.get(0x0112, 1)}
    except Exception:  # metadata readers raise undocumented exceptions
        return None


_EXTENDED_XMP = b"http://ns.adobe.com/xmp/extension/\0"


def _beside(picture: Any, data: bytes) -> Beside:
    info = picture.info
    packet = info.get("xmp")
    packet = packet.encode("utf-8", "replace") if isinstance(packet, str) else packet
    exif = data if picture.format == "TIFF" else info.get("exif") or b""
    block = (exif, 6 if exif.startswith(b"Exif\0\0") else 0) if isinstance(exif, bytes) and exif else None
    densities = info.get("jfif_density") or info.get("aspect") or info.get("dpi")
    return Beside(packet if isinstance(packet, bytes) else _extended_xmp(picture), preview_size(*block) if block else None,
                  tuple(densities) if densities and len(densities) == 2 else None, exif=block)  # fmt: skip


def _extended_xmp(picture: Any) -> bytes | None:
    """The part of a JPEG's XMP that did not fit into its first packet, joined; None where there is none.

    Source: XMP specification part 3, 1.1.3.1: after the signature a digest of 32 letters, the whole length, an offset.
    """
    pieces = [
        s[len(_EXTENDED_XMP) :]
        for app, s in getattr(picture, "applist", ())
        if app == "APP1" and s.startswith(_EXTENDED_XMP)
    ]
    joined = sorted((int.from_bytes(piece[36:40], "big"), piece[40:]) for piece in pieces)
    return b"".join(data for _, data in joined)[:MOST_XMP_BYTES] or None


def _strip(picture: Any, top: int, bottom: int) -> Pixels:
    """Rows of a loaded Pillow picture: transparent is white, and 16 bits a sample keep their upper 8."""
    with _pillow_without_its_own_limit():  # one row may be over it
        strip = picture.crop((0, top, picture.width, bottom))
    return _rgb(strip)


def _rgb(picture: Any) -> Pixels:
    """A Pillow picture of any mode as (height, width, 3) uint8, or (height, width, 1) for gray without transparency."""
    if picture.mode.startswith("I"):  # 16 bits a sample
        return (np.asarray(picture, np.int64) >> 8).clip(0, 255).astype(np.uint8)[..., None]
    if picture.mode == "L" and "transparency" not in picture.info:
        return np.asarray(picture)[..., None]
    if picture.mode in ("RGBA", "LA", "PA") or "transparency" in picture.info:
        from PIL import Image

        picture = picture.convert("RGBA")
        picture = Image.alpha_composite(Image.new("RGBA", picture.size, "white"), picture)
    return np.asarray(picture if picture.mode == "RGB" else picture.convert("RGB"))


# -- HEIC ------------------------------------------------------------------------------------------------


def _extra(module: str, label: object, form: str, extra: str) -> Any:
    try:
        return importlib.import_module(module)
    except ImportError:
        raise MissingExtraError(f"{label}: a {form} picture", extra) from None


def _open_heic(data: bytes, label: object) -> Opened:
    """The primary picture of the file.

    The container's own turn counts, and libheif applies it; the EXIF orientation beside it is information, and tells in which
    frame the other EXIF tags are. So nothing is left to apply, and the tag is kept.
    """
    pillow_heif = _extra("pillow_heif", label, "HEIC", "heic")
    version = pillow_heif.libheif_version()
    if tuple(int(part) for part in re.findall(r"\d+", version)[:3]) < OLDEST_LIBHEIF:
        raise FileFormatError(label, f"is a HEIC picture, and libheif {version} is not safe to read it; "
                              f"{_dotted(OLDEST_LIBHEIF)} is needed: pip install --upgrade pillow-heif")  # fmt: skip
    damaged = ("is a damaged HEIC picture", "copy it again from the camera, or save it as JPEG")
    with _guarded(label, *damaged):
        file = pillow_heif.open_heif(data)
        picture = file[file.primary_index]
    exif = picture.info.get("exif") or b""

    def tags() -> dict[int, Any] | None:
        if not exif:
            return {}
        return camera_tags(exif, 6 if exif.startswith(b"Exif\0\0") else 0) if len(exif) <= MOST_EXIF_BYTES else None

    def decode() -> Decoded:
        with _guarded(label, *damaged):
            array = np.asarray(picture)  # decodes; a view of the decoder's memory
        width, height = _size_px(picture)  # may differ from the head's
        array = array.reshape(*array.shape[:2], -1)[:height, :width]
        return Decoded(width, height, 1, lambda top, bottom: _heic_rows(array[top:bottom], picture.mode))

    def beside() -> Beside:
        found = picture.info.get("xmp")
        return Beside(
            found if isinstance(found, bytes) else None,
            intrinsic_matrix=camera_matrix(data),
            exif=(exif, 6 if exif.startswith(b"Exif\0\0") else 0) if exif else None,
        )

    return Opened("HEIC", *_size_px(picture), tags, beside, decode)


def _heic_rows(array: Pixels, mode: str) -> Pixels:
    if mode in ("RGB", "L"):
        return array
    from PIL import Image

    strip = Image.frombytes(mode, (array.shape[1], array.shape[0]), array.tobytes())
    return _rgb(strip.convert(mode.upper()))  # "RGBa" holds colours that are multiplied by their opacity already


# -- RAW -------------------------------------------------------------------------------------------------


def _open_raw(data: bytes, label: object) -> Opened:
    """Developed with the camera's white balance, as bright as it was taken, and with the transfer curve of sRGB.

    LibRaw turns the picture upright, by a flip that it has from the file. That is what the orientation says here.
    """
    rawpy = _extra("rawpy", label, "RAW", "raw")
    version = tuple(rawpy.libraw_version)
    if version < OLDEST_LIBRAW:
        raise FileFormatError(label, f"is a RAW picture, and LibRaw {_dotted(version)} is not safe to read it; "
                              f"{_dotted(OLDEST_LIBRAW)} is needed: pip install --upgrade rawpy")  # fmt: skip
    damaged = ("is a RAW picture that is cut, damaged or of an unknown camera", "copy it again, or save it as JPEG")
    with _guarded(label, *damaged), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        raw = rawpy.imread(io.BytesIO(data))
        sizes = raw.sizes

    def tags() -> dict[int, Any]:
        return {**raw_camera_tags(data), 0x0112: ORIENTATION_OF_FLIP.get(sizes.flip, 1)}

    def decode() -> Decoded:
        with _guarded(label, *damaged), raw:  # closed behind: LibRaw holds four values of 16 bits for each pixel
            array = raw.postprocess(use_camera_wb=True, no_auto_bright=True, output_bps=8, gamma=SRGB_GAMMA)
        array = array.reshape(*array.shape[:2], -1)
        return Decoded(array.shape[1], array.shape[0], 1, lambda top, bottom: array[top:bottom])

    # the limit on size is one on the whole sensor, which is what takes memory
    return Opened(
        "RAW", sizes.raw_width, sizes.raw_height, tags, lambda: Beside(xmp_packet(data), exif=(data, 0)), decode
    )


def _dotted(version: tuple[int, ...]) -> str:
    return ".".join(str(part) for part in version)
