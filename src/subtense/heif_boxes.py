"""HEIF boxes: the camera matrix of the primary picture of a HEIC, taken through the container's crop, turn and mirror.

libheif gives the matrix of the coded picture and decodes the turned one; so the boxes are read here, in the order they apply.

Source: ISO/IEC 23008-12, 6.5 (pitm, ipco, ipma, ispe, clap, irot, imir, cmin); ISO/IEC 14496-12 (boxes).
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass, replace

MOST_BOXES = 4096


@dataclass(frozen=True)
class Matrix:
    """fx, fy, cx, cy in px, the origin the outer corner of the top-left pixel, of a picture of this size."""

    fx: float
    fy: float
    cx: float
    cy: float
    width: float
    height: float

    def turned(self) -> Matrix:
        """Of the picture turned counter-clockwise by a quarter."""
        return Matrix(self.fy, self.fx, self.cy, self.width - self.cx, self.height, self.width)


def camera_matrix(data: bytes) -> tuple[float, ...] | None:
    """3 x 3 row by row, of the picture as it is looked at; None where the file has none, or is not one that can be read."""
    try:
        found = _matrix(list(_primary_properties(data)))
    except (struct.error, IndexError, ZeroDivisionError, OverflowError):
        return None
    return None if found is None else (found.fx, 0.0, found.cx, 0.0, found.fy, found.cy, 0.0, 0.0, 1.0)


def _matrix(told: list[tuple[bytes, bytes]]) -> Matrix | None:
    size = next((struct.unpack_from(">LL", body, 4) for kind, body in told if kind == b"ispe"), None)
    body = next((body for kind, body in told if kind == b"cmin"), None)
    if size is None or body is None:
        return None
    found = _told(body, *size)
    for kind, content in told:
        if kind == b"clap":
            found = _cut(found, content)
        elif kind == b"irot":
            for _ in range(content[0] & 3):
                found = found.turned()
        elif kind == b"imir":
            found = (
                replace(found, cx=found.width - found.cx)
                if content[0] & 1
                else replace(found, cy=found.height - found.cy)
            )
    return found


def _told(body: bytes, width: int, height: int) -> Matrix:
    """Focal length in widths, the point in widths and heights, as whole numbers over a power of two."""
    flags = int.from_bytes(body[1:4], "big")
    unit = float(1 << (flags >> 8 & 31))
    focal, x, y = struct.unpack_from(">lll", body, 4)
    fy = struct.unpack_from(">l", body, 16)[0] / unit * height if flags & 1 else focal / unit * width
    return Matrix(focal / unit * width, fy, x / unit * width, y / unit * height, width, height)


def _cut(found: Matrix, body: bytes) -> Matrix:
    """The clean aperture: its size, and how far its middle lies from the picture's, as fractions."""
    n = struct.unpack_from(">LLLLlLlL", body)
    width, height, right, down = (n[i] / n[i + 1] for i in (0, 2, 4, 6))
    left, top = (found.width - width) / 2 + right, (found.height - height) / 2 + down
    return replace(found, cx=found.cx - left, cy=found.cy - top, width=width, height=height)


# -- boxes -------------------------------------------------------------------------------------------------


def _boxes(data: bytes, start: int, end: int) -> Iterator[tuple[bytes, int, int]]:
    """Kind, start and end of the content of each box within."""
    for _ in range(MOST_BOXES):
        if start + 8 > end:
            return
        size, kind = struct.unpack_from(">L4s", data, start)
        head = 16 if size == 1 else 8
        size = struct.unpack_from(">Q", data, start + 8)[0] if size == 1 else size or end - start
        if size < head or start + size > end:
            return
        yield kind, start + head, start + size
        start += size


def _inside(data: bytes, start: int, end: int, kind: bytes) -> tuple[int, int]:
    return next(((a, b) for name, a, b in _boxes(data, start, end) if name == kind), (0, 0))


def _primary_properties(data: bytes) -> Iterator[tuple[bytes, bytes]]:
    """Kind and content of the primary picture's properties, in the order they are listed."""
    meta = _inside(data, 0, len(data), b"meta")
    meta = (meta[0] + 4, meta[1])
    pitm, _ = _inside(data, *meta, b"pitm")
    primary = struct.unpack_from(">L" if data[pitm] else ">H", data, pitm + 4)[0]
    iprp = _inside(data, *meta, b"iprp")
    boxes = list(_boxes(data, *_inside(data, *iprp, b"ipco")))
    for index in _listed(data, *_inside(data, *iprp, b"ipma"), primary):
        if 1 <= index <= len(boxes):
            kind, start, end = boxes[index - 1]
            yield kind, data[start : min(end, start + 64)]


def _listed(data: bytes, start: int, end: int, item: int) -> Iterator[int]:
    """The numbers of the item's properties."""
    version, wide = data[start], data[start + 3] & 1
    at = start + 8
    for _ in range(min(struct.unpack_from(">L", data, start + 4)[0], MOST_BOXES)):
        number = struct.unpack_from(">H" if version == 0 else ">L", data, at)[0]
        at += 2 if version == 0 else 4
        count, at = data[at], at + 1
        for i in range(count):
            if number == item and at + (2 if wide else 1) * (i + 1) <= end:
                yield struct.unpack_from(">H", data, at + 2 * i)[0] & 0x7FFF if wide else data[at + i] & 0x7F
        at += count * (2 if wide else 1)
