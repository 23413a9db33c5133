"""Photo: the one loader of pictures. Pixels upright and in RGB, what the file says of its camera, and limits.

Positions and serial numbers in a file are never read.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from .arrays import Pixels
from .decode import Beside, Buffer, as_stored, open_picture, upright
from .errors import FileFormatError
from .metadata import Metadata, metadata_of, text_of
from .quantity import Note

__all__ = ["MOST_PIXELS", "Metadata", "Photo"]

MOST_PIXELS = 250_000_000
MOST_BYTES = 512 * 2**20
MARGINS = 0.02
"""A RAW is developed with the sensor's margins, so it is by up to that larger than the size in its tags."""


@dataclass(frozen=True, eq=False)
class Photo:
    """A picture as it is looked at.

    Attributes:
        pixels: (height, width, 3) uint8 RGB, upright: the EXIF orientation is applied, once.
        metadata: what the file says.
        path: the file.
        digest: SHA-256 of the file.
        notes: doubts about the file.
        name: what the picture is called where people see it; the file's name unless another is given.
    """

    pixels: Pixels
    metadata: Metadata
    path: Path
    digest: str
    notes: tuple[Note, ...] = ()
    name: str = ""

    def __post_init__(self) -> None:
        if not self.name:
            object.__setattr__(self, "name", self.path.name)

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

    def as_stored(self) -> Photo:
        """The same with pixels in the frame of the file, as the camera's sensor has them: what a calibration is of."""
        if self.metadata.orientation == 1:
            return self
        turned = np.ascontiguousarray(as_stored(self.pixels, self.metadata.orientation))
        return replace(self, pixels=turned, metadata=replace(self.metadata, orientation=1))

    def to_json(self) -> dict[str, Any]:
        """Name, size and digest: no path, no position, no serial number."""
        return {"name": self.name, "width_px": self.width_px, "height_px": self.height_px, "sha256": self.digest}

    @classmethod
    def load(cls, path: str | Path, *, name: str | None = None, pixels: Buffer | None = None,
             most_pixels: int = MOST_PIXELS, gray: bool = False) -> Photo:  # fmt: skip
        """Read a picture: JPEG, PNG, TIFF, WebP, BMP, AVIF; HEIC with the extra `heic`, a camera's RAW with the extra `raw`.

        Args:
            path: the file.
            name: what it is called in results and errors, where the file is kept under another name.
            pixels: gives the array to decode into, from height and width in px of the upright picture: writable, uint8,
                (height, width, 3). A `numpy.memmap`, say, so that another process has the pixels.
            most_pixels: more are refused.
            gray: whether gray will do: of a JPEG the luma alone is decoded, and `pixels` is one channel seen three times.

        Raises:
            FileFormatError: no such file, a folder, no picture, a cut picture, or one over the limits.
            MissingExtraError: a HEIC or RAW picture, and its decoder is not installed.
            InputError: `pixels` gave another kind of array.
        """
        path = Path(path)
        shown = _shown(name) or path.name
        label: object = path if name is None else shown
        data = file_bytes(path, label)
        opened = open_picture(data, label, Path(name or path).suffix, gray=gray)
        check_size(label, opened.width_px, opened.height_px, most_pixels)
        tags = opened.tags()  # before the pixels are decoded: turning them takes the orientation away
        decoded = opened.decode()
        check_size(
            label, decoded.width_px, decoded.height_px, most_pixels
        )  # a container may hold another size than it tells
        metadata, notes = _metadata(opened.form, tags, opened.beside())  # of a PNG some of it stands behind the pixels
        array = upright(decoded, label, pixels)
        photo = cls(array, metadata, path, hashlib.sha256(data).hexdigest(), notes, shown)
        return replace(photo, metadata=_without_margins(photo)) if opened.form == "RAW" else photo


def _shown(name: str | None) -> str:
    """The last part of a name, on one line: it may be a stranger's."""
    return text_of((name or "").replace("\\", "/").rsplit("/", 1)[-1]) or ""


def check_size(label: object, width_px: int, height_px: int, most_pixels: int = MOST_PIXELS) -> None:
    """Refuse a picture of more pixels; `label` is what it is called in the error."""
    if width_px * height_px > most_pixels:
        raise FileFormatError(label, f"{width_px} x {height_px} px are {width_px * height_px / 1e6:.0f} million; the limit is "
                              f"{most_pixels // 10**6} million, so resize it")  # fmt: skip


def file_bytes(path: Path, label: object) -> bytes:
    """The content of a picture's file, within the limit; `label` is what it is called in errors."""
    if not path.exists():
        raise FileFormatError(label, "no such file")
    if path.is_dir():
        raise FileFormatError(label, "is a folder; name a picture in it")
    if not path.is_file():
        raise FileFormatError(label, "is not a file")
    if path.stat().st_size > MOST_BYTES:
        raise FileFormatError(label, f"is larger than {MOST_BYTES // 2**20} MiB")
    try:
        data = path.read_bytes()
    except OSError as error:
        raise FileFormatError(label, f"can't be read ({error.strerror})") from None
    if not data:
        raise FileFormatError(label, "is empty")
    return data


# -- metadata --------------------------------------------------------------------------------------------


def _metadata(form: str, tags: dict[int, Any] | None, beside: Beside) -> tuple[Metadata, tuple[Note, ...]]:
    """What the file tells; a damaged part of it is noted and does not hide the others."""
    properties = _properties(beside.xmp)
    told = metadata_of(tags or {}, beside, properties or {}, form=form)
    if tags is not None and properties is not None:
        return told
    what = "metadata" if tags is None else "XMP metadata"
    note = Note("metadata_damaged", f"the file's {what} can't be read", "give the camera with --camera")
    return told[0], (*told[1], note)


def _properties(packet: bytes | None) -> dict[str, str] | None:
    """The XMP properties; the reader is imported only where there is a packet."""
    if not packet:
        return {}
    from .xmp import camera_properties

    return camera_properties(packet)


def _without_margins(photo: Photo) -> Metadata:
    """The metadata of a RAW without a tagged size that differs by margins only: the picture is neither resized nor cropped."""
    tags = photo.metadata
    if not tags.tagged_width_px or not tags.tagged_height_px:
        return tags
    then, now = sorted((tags.tagged_width_px, tags.tagged_height_px)), sorted(photo.stored_size_px)
    near = all(abs(now[i] / then[i] - 1) < MARGINS for i in range(2))
    return replace(tags, tagged_width_px=None, tagged_height_px=None) if near else tags
