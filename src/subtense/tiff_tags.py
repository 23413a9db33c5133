"""TIFF tags: the few numbers and texts that a RAW or HEIC picture tells of its camera, and whether a TIFF is a RAW.

The blocks within are here too: an XMP packet, the preview's size, and the one number of Apple's maker note that is of use.

Pillow reads the tags of what it decodes. This reader is for the rest: RAW files are TIFF directories, or hold some, under
signatures that Pillow does not accept (ORF, RW2, CR3, RAF). It looks at wanted tags only, and each is at most
`MOST_VALUE_BYTES` long, so that a stranger's file can't make it large.

Source: TIFF 6.0; Exif 2.32 (CIPA DC-008); DNG 1.6 for DNGVersion and the photometric interpretations of a RAW.
"""

from __future__ import annotations

import struct
from collections.abc import Set
from typing import Any

MOST_ENTRIES = 1000
MOST_VALUE_BYTES = 4096
MOST_DIRECTORIES = 16
SEARCHED_BYTES = 2**20
"""The head of a file in which another format's directories are looked for."""

_ORDERS = {b"II": "<", b"MM": ">"}
_LETTERS = {1: "B", 3: "H", 4: "L", 6: "b", 8: "h", 9: "l", 11: "f", 12: "d", 13: "L"}
_RATIONALS = {5: "L", 10: "l"}
_XMP, _MAKER_NOTE, _PREVIEW, _PREVIEW_BYTES = 0x02BC, 0x927C, 0x0201, 0x0202
_PHOTOMETRIC, _SUB_DIRECTORIES, _EXIF_DIRECTORY, _DNG_VERSION, _CFA_PATTERN = 0x0106, 0x014A, 0x8769, 0xC612, 0x828E
_RAW_PHOTOMETRICS = (32803, 34892)
"""Colour filter array, and linear raw."""
_CAMERA = (
    0x010F, 0x0110, 0x0112, 0x011A, 0x011B, 0x0131, 0x829A, 0x829D, 0x9206, 0x920A, 0x927C, 0xA002, 0xA003, 0xA20E, 0xA20F, 0xA210, 0xA401,
    0xA404, 0xA405, 0xA432, 0xA433, 0xA434,
)  # fmt: skip
_WANTED = {*_CAMERA, _PHOTOMETRIC, _SUB_DIRECTORIES, _EXIF_DIRECTORY, _DNG_VERSION, _CFA_PATTERN}
_LONG = {_XMP: 2**22, _MAKER_NOTE: 2**16}
"""Most bytes of the values that are no numbers or texts."""


def camera_tags(data: bytes, start: int = 0) -> dict[int, Any] | None:
    """Tags of the first directory and of the Exif directory that it names; None where there is no TIFF header.

    Args:
        data: the file.
        start: where the TIFF header begins; offsets in it count from there.
    """
    order = _ORDERS.get(data[start : start + 2])
    if order is None or len(data) < start + 8:
        return None
    first = _directory(data, start, struct.unpack_from(order + "L", data, start + 4)[0], order)
    exif = first.get(_EXIF_DIRECTORY)
    tags = {**first, **(_directory(data, start, exif, order) if isinstance(exif, int) else {})}
    if 0x0112 in first:  # the picture's orientation stands in the first directory only
        tags[0x0112] = first[0x0112]
    return tags


def raw_camera_tags(data: bytes) -> dict[int, Any]:
    """The camera's tags of a RAW file, empty where it tells none that can be read."""
    if (
        data.startswith(b"FUJIFILMCCD-RAW") and len(data) > 88
    ):  # a whole JPEG lies inside, and its EXIF tells the camera
        jpeg = int.from_bytes(data[84:88], "big")
        at = data.find(b"Exif\0\0", jpeg, jpeg + 2**16)
        return (camera_tags(data, at + 6) if at >= 0 else None) or {}
    if data[4:8] == b"ftyp":  # CR3: a box for each directory
        tags: dict[int, Any] = {}
        for box in (b"CMT2", b"CMT1"):
            at = data.find(box, 0, SEARCHED_BYTES)
            tags |= (camera_tags(data, at + 4) if at >= 0 else None) or {}
        return tags
    return camera_tags(data) or {}


def xmp_packet(data: bytes) -> bytes | None:
    """The XMP packet of a TIFF or a RAW that is one; None where it has none."""
    order = _ORDERS.get(data[:2])
    if order is None or len(data) < 8:
        return None
    found = _directory(data, 0, struct.unpack_from(order + "L", data, 4)[0], order, {_XMP}).get(_XMP)
    return found if isinstance(found, bytes) else None


_GPS_DIRECTORY = 0x8825
_POSITION = set(range(1, 7))
_SERIALS = {0xA431, 0xA435, 0xC62F}


def private_tags(data: bytes, start: int = 0) -> dict[int, Any]:
    """Tags of the GPS directory, and serial numbers: what nobody reads who is not asked to.

    Args:
        data: the file or the block.
        start: where the TIFF header begins.
    """
    order = _ORDERS.get(data[start : start + 2])
    if order is None or len(data) < start + 8:
        return {}
    offset = struct.unpack_from(order + "L", data, start + 4)[0]
    first = _directory(data, start, offset, order, {_GPS_DIRECTORY, _EXIF_DIRECTORY, *_SERIALS})
    found = {tag: value for tag, value in first.items() if tag in _SERIALS}
    for pointer, wanted in ((_EXIF_DIRECTORY, _SERIALS), (_GPS_DIRECTORY, _POSITION)):
        if isinstance(first.get(pointer), int):
            found |= _directory(data, start, first[pointer], order, wanted)
    return found


def preview_size(exif: bytes, start: int = 0) -> tuple[int, int] | None:
    """Width and height of the preview that an EXIF block holds in its second directory; None where there is none."""
    order = _ORDERS.get(exif[start : start + 2])
    if order is None or len(exif) < start + 8:
        return None
    first = start + struct.unpack_from(order + "L", exif, start + 4)[0]
    if first + 2 > len(exif):
        return None
    after = first + 2 + 12 * struct.unpack_from(order + "H", exif, first)[0]
    if after + 4 > len(exif):
        return None
    second = _directory(exif, start, struct.unpack_from(order + "L", exif, after)[0], order, {_PREVIEW, _PREVIEW_BYTES})
    at, length = second.get(_PREVIEW), second.get(_PREVIEW_BYTES)
    return (
        _jpeg_size(exif[start + at : start + at + length]) if isinstance(at, int) and isinstance(length, int) else None
    )


def _jpeg_size(data: bytes) -> tuple[int, int] | None:
    """Width and height by the frame header of a JPEG."""
    at = 2
    while data[:2] == b"\xff\xd8" and at + 9 <= len(data) and data[at] == 0xFF:
        marker, length = data[at + 1], int.from_bytes(data[at + 2 : at + 4], "big")
        if 0xC0 <= marker <= 0xCF and marker not in (0xC4, 0xC8, 0xCC):
            height, width = struct.unpack_from(">HH", data, at + 5)
            return (width, height) if width and height else None
        at += 2 + max(length, 2)
    return None


def apple_acceleration(note: Any) -> tuple[float, float, float] | None:
    """The acceleration vector in units of g that Apple's maker note holds; None where there is none.

    Source: ExifTool's documentation of Apple's tags, AccelerationVector (0x0008).
    """
    if not isinstance(note, bytes) or not note.startswith(b"Apple iOS\0\0\x01MM"):
        return None
    vector = _directory(note, 0, 14, ">", {0x0008}).get(0x0008)
    if not isinstance(vector, tuple) or len(vector) != 3 or not 0.5 < sum(v * v for v in vector) < 2.0:
        return None
    return float(vector[0]), float(vector[1]), float(vector[2])


def is_raw_tiff(data: bytes) -> bool:
    """Whether a TIFF holds a sensor's own values: a DNG, or a directory with a colour filter array."""
    order = _ORDERS.get(data[:2])
    if order is None or len(data) < 8:
        return False
    first = _directory(data, 0, struct.unpack_from(order + "L", data, 4)[0], order)
    below = first.get(_SUB_DIRECTORIES, ())
    offsets = below if isinstance(below, tuple) else (below,)
    directories = [
        first,
        *(_directory(data, 0, at, order) for at in offsets[:MOST_DIRECTORIES] if isinstance(at, int)),
    ]
    return _DNG_VERSION in first or any(
        _CFA_PATTERN in one or one.get(_PHOTOMETRIC) in _RAW_PHOTOMETRICS for one in directories
    )


def _directory(
    data: bytes, start: int, offset: int, order: str, wanted: Set[int] = frozenset(_WANTED)
) -> dict[int, Any]:
    """The wanted tags of the directory at `offset` after `start`; a damaged one is left out."""
    found: dict[int, Any] = {}
    at = start + offset
    if not 0 <= at <= len(data) - 2:
        return found
    for i in range(min(struct.unpack_from(order + "H", data, at)[0], MOST_ENTRIES)):
        entry = at + 2 + 12 * i
        if entry + 12 > len(data):
            break
        tag, kind, count = struct.unpack_from(order + "HHL", data, entry)
        value = _value(data, start, entry, kind, count, order, tag) if tag in wanted else None
        if value is not None:
            found.setdefault(tag, value)
    return found


def _value(data: bytes, start: int, entry: int, kind: int, count: int, order: str, tag: int) -> Any:
    """A text, a number, a tuple of numbers, or bytes; None where the entry holds none, is too long, or points out of the file."""
    block = tag in _LONG and kind in (1, 2, 7)
    letter = "s" if kind == 2 or block else _RATIONALS.get(kind) or _LETTERS.get(kind)
    most = _LONG[tag] if block else MOST_VALUE_BYTES
    if letter is None or count > most:
        return None
    form = f"{order}{2 * count if kind in _RATIONALS else count}{letter}"
    size = struct.calcsize(form)
    at = entry + 8 if size <= 4 else start + struct.unpack_from(order + "L", data, entry + 8)[0]
    if not 0 < size <= most or at + size > len(data):
        return None
    values = struct.unpack_from(form, data, at)
    if block:
        return values[0]
    if kind == 2:
        return values[0].split(b"\0")[0].decode("utf-8", "replace")
    if kind in _RATIONALS:
        pairs = zip(values[::2], values[1::2], strict=True)
        values = tuple(above / below if below else float("nan") for above, below in pairs)
    return values[0] if count == 1 else values
