"""Photo: the one loader of pictures. Pixels upright and in RGB, what the file says of its camera, and limits.

Positions and serial numbers in a file are never read.
"""

from __future__ import annotations

import hashlib
import io
import math
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from .arrays import Pixels
from .errors import FileFormatError
from .quantity import Note

MOST_PIXELS = 250_000_000
MOST_BYTES = 512 * 2**20
MOST_EXIF_BYTES = 2**20
FORMATS = ("JPEG", "PNG", "TIFF", "WEBP", "BMP")
TURNS = {1: 0, 3: 2, 6: 1, 8: 3}
"""EXIF orientation: clockwise quarter turns that make the stored picture upright (2, 4, 5, 7 are also mirrored)."""


@dataclass(frozen=True)
class Metadata:
    """What a file says of its camera; None where it says nothing usable. Lengths in mm as in the tags.

    Attributes:
        make: camera maker.
        model: camera model.
        lens: lens model.
        focal_mm: focal length.
        f35_mm: focal length in 35 mm equivalents.
        focal_plane_x_per_mm: pixels per mm on the sensor along the stored width.
        focal_plane_y_per_mm: the same along the stored height.
        tagged_width_px: stored width by the EXIF tags.
        tagged_height_px: stored height by the EXIF tags.
        digital_zoom: ratio; 1 for none.
        orientation: 1 to 8.
    """

    make: str | None = None
    model: str | None = None
    lens: str | None = None
    focal_mm: float | None = None
    f35_mm: float | None = None
    focal_plane_x_per_mm: float | None = None
    focal_plane_y_per_mm: float | None = None
    tagged_width_px: int | None = None
    tagged_height_px: int | None = None
    digital_zoom: float | None = None
    orientation: int = 1


@dataclass(frozen=True, eq=False)
class Photo:
    """A picture as it is looked at.

    Attributes:
        pixels: (height, width, 3) uint8 RGB, upright: the EXIF orientation is applied, once.
        metadata: what the file says.
        path: the file.
        digest: SHA-256 of the file.
        notes: doubts about the file.
    """

    pixels: Pixels
    metadata: Metadata
    path: Path
    digest: str
    notes: tuple[Note, ...] = ()

    @property
    def width_px(self) -> int:
        """Width of the upright picture."""
        return int(self.pixels.shape[1])

    @property
    def height_px(self) -> int:
        """Height of the upright picture."""
        return int(self.pixels.shape[0])

    @property
    def stored_size_px(self) -> tuple[int, int]:
        """Width and height as stored, before the orientation was applied."""
        size = (self.width_px, self.height_px)
        return size[::-1] if self.metadata.orientation >= 5 else size

    def to_json(self) -> dict[str, Any]:
        """Name, size and digest: no path, no position, no serial number."""
        return {"name": self.path.name, "width_px": self.width_px, "height_px": self.height_px, "sha256": self.digest}

    @classmethod
    def load(cls, path: str | Path) -> Photo:
        """Read a picture.

        Raises:
            FileFormatError: no such file, a folder, no picture, a cut picture, or one over the limits.
        """
        path = Path(path)
        data = _bytes(path)
        with _pillow_without_its_own_limit() as Image:
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    picture = Image.open(io.BytesIO(data), formats=FORMATS)
            except Exception:
                raise FileFormatError(path, _what_it_is(data)) from None
            width, height = picture.size
            if width * height > MOST_PIXELS:
                raise FileFormatError(path, f"{width} x {height} px are {width * height / 1e6:.0f} million; the limit is "
                                      f"{MOST_PIXELS // 10**6} million, so resize it")  # fmt: skip
            metadata, notes = _metadata(picture)
            pixels = _upright(_decoded(picture, path), metadata.orientation)
        return cls(np.ascontiguousarray(pixels), metadata, path, hashlib.sha256(data).hexdigest(), notes)


def _bytes(path: Path) -> bytes:
    if not path.exists():
        raise FileFormatError(path, "no such file")
    if path.is_dir():
        raise FileFormatError(path, "is a folder; name a picture in it")
    if not path.is_file():
        raise FileFormatError(path, "is not a file")
    if path.stat().st_size > MOST_BYTES:
        raise FileFormatError(path, f"is larger than {MOST_BYTES // 2**20} MiB")
    try:
        data = path.read_bytes()
    except OSError as error:
        raise FileFormatError(path, f"can't be read ({error.strerror})") from None
    if not data:
        raise FileFormatError(path, "is empty")
    return data


_SIGNATURES = (
    (b"%PDF", "is a PDF; export the page as PNG or JPEG"), (b"GIF8", "is a GIF; save it as PNG"),
    (b"PK\x03\x04", "is an archive; unpack it"), (b"RIFF", "is a damaged or unknown RIFF file"),
    (b"\xff\xd8", "is a damaged JPEG"), (b"\x89PNG", "is a damaged PNG"), (b"<svg", "is an SVG; export it as PNG"),
)  # fmt: skip


def _what_it_is(data: bytes) -> str:
    for signature, text in _SIGNATURES:
        if data.startswith(signature):
            return text
    if data[4:12] in (b"ftypheic", b"ftypheix", b"ftypmif1", b"ftypavif"):
        return "is a HEIC or AVIF picture; save it as JPEG"
    return f"is not a picture that can be read; give one of {', '.join(FORMATS)}"


_PILLOW = threading.Lock()


@contextmanager
def _pillow_without_its_own_limit() -> Iterator[Any]:
    """Pillow with our limit on pixels in place of its own; its limit is a global, so it is put back."""
    from PIL import Image

    with _PILLOW:
        own, Image.MAX_IMAGE_PIXELS = Image.MAX_IMAGE_PIXELS, None
        try:
            yield Image
        finally:
            Image.MAX_IMAGE_PIXELS = own


def _decoded(picture: Any, path: Path) -> Pixels:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            picture.load()
            if picture.mode.startswith("I"):  # 16 bits a sample
                wide = np.asarray(picture, np.int64)
                return np.repeat((wide >> 8).clip(0, 255).astype(np.uint8)[..., None], 3, axis=2)
            if picture.mode in ("RGBA", "LA", "PA") or "transparency" in picture.info:
                from PIL import Image

                picture = picture.convert("RGBA")
                picture = Image.alpha_composite(Image.new("RGBA", picture.size, "white"), picture)
            return np.asarray(picture.convert("RGB"))
    except Exception as error:  # a decoder raises what it likes on a stranger's file
        reason = " ".join(str(error).split())[:80]
        raise FileFormatError(path, f"is cut or damaged ({reason}); copy it again from the camera") from None


def _upright(pixels: Pixels, orientation: int) -> Pixels:
    """EXIF orientation: 2 mirrored, 3 half turn, 4 mirrored top to bottom, 5 to 8 with a quarter turn."""
    if orientation in (2, 5, 7, 4):
        mirrored = pixels[:, ::-1]
        return {2: mirrored, 4: np.rot90(mirrored, 2), 5: np.rot90(mirrored, 1), 7: np.rot90(mirrored, -1)}[orientation]
    return np.rot90(pixels, -TURNS[orientation])


# -- metadata --------------------------------------------------------------------------------------------


def _metadata(picture: Any) -> tuple[Metadata, tuple[Note, ...]]:
    """The tags, each on its own: one damaged value does not hide the others."""
    damaged = Note("metadata_damaged", "the file's metadata can't be read", "give the camera with --camera")
    if len(picture.info.get("exif", b"")) > MOST_EXIF_BYTES:
        return Metadata(), (damaged,)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            exif = picture.getexif()
            tags = {**exif, **exif.get_ifd(0x8769)}
    except Exception:  # metadata readers raise undocumented exceptions
        return Metadata(), (damaged,)
    orientation = tags.get(0x0112, 1)
    notes: tuple[Note, ...] = ()
    if orientation not in range(1, 9):
        notes = (Note("orientation_invalid", f"the orientation tag is {str(orientation)[:20]!r}, not 1 to 8; the picture is "
                      "taken as it is stored", "check that it is upright"),)  # fmt: skip
        orientation = 1
    per_mm = {2: 1 / 25.4, 3: 0.1, 4: 1.0, 5: 1000.0}.get(tags.get(0xA210, 2))
    return Metadata(
        make=_text(tags.get(0x010F)), model=_text(tags.get(0x0110)), lens=_text(tags.get(0xA434)),
        focal_mm=_positive(tags.get(0x920A)), f35_mm=_positive(tags.get(0xA405)),
        focal_plane_x_per_mm=_scaled(tags.get(0xA20E), per_mm), focal_plane_y_per_mm=_scaled(tags.get(0xA20F), per_mm),
        tagged_width_px=_whole(tags.get(0xA002)), tagged_height_px=_whole(tags.get(0xA003)),
        digital_zoom=_positive(tags.get(0xA404)), orientation=int(orientation),
    ), notes  # fmt: skip


def _text(value: Any) -> str | None:
    """A tag's text, printable and short."""
    if not isinstance(value, str):
        return None
    shown = " ".join("".join(c if c.isprintable() else " " for c in value[:4096]).split())[:100]
    return shown or None


def _positive(value: Any) -> float | None:
    try:
        number = float(value)
    except (TypeError, ValueError, ZeroDivisionError, OverflowError):
        return None
    return number if math.isfinite(number) and number > 0 else None


def _whole(value: Any) -> int | None:
    number = _positive(value)
    return int(number) if number else None


def _scaled(value: Any, factor: float | None) -> float | None:
    number = _positive(value)
    return number * factor if number and factor else None
