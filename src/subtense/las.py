"""LAS 1.2: points with colours, for the programs of surveyors; LAZ, the same compressed, by the extra `laz`.

Source: American Society for Photogrammetry and Remote Sensing, LAS specification 1.2, point record format 2.
"""

from __future__ import annotations

import io
import struct

import numpy as np

from .arrays import Array, Pixels
from .errors import MissingExtraError

STEP_M = 1e-4
"""Coordinates are whole multiples of it."""
LARGEST = 2**31 - 10
_HEAD = 227


def las(points: Array, colours: Pixels, origin_m: Array | None = None) -> bytes:
    """Points as a LAS file.

    Args:
        points: (N, 3) from the origin, m, z up; farther out than 214 km they are kept to coarser steps.
        colours: (N, 3) uint8.
        origin_m: (3,) of the points in the file's frame.
    """
    origin = np.zeros(3) if origin_m is None else np.asarray(origin_m, float)
    step = max(STEP_M, float(np.abs(points).max(initial=0.0)) / LARGEST)
    rows = np.zeros(len(points), [("xyz", "<i4", 3), ("intensity", "<u2"), ("flags", "u1"), ("class", "u1"), ("angle", "i1"),
                                  ("user", "u1"), ("source", "<u2"), ("rgb", "<u2", 3)])  # fmt: skip
    rows["xyz"], rows["rgb"] = np.rint(points / step), colours.astype(np.uint16) * 257
    rows["flags"] = 0b001001  # the first of one return
    ends = [rows["xyz"].max(0) * step + origin, rows["xyz"].min(0) * step + origin] if len(points) else [origin, origin]
    count = len(points)
    head = struct.pack("<4sHHIHH8sBB32s32sHHHIIBHI5I", b"LASF", 0, 0, 0, 0, 0, b"", 1, 2, b"subtense", b"subtense", 1, 2000, _HEAD,
                       _HEAD, 0, 2, rows.dtype.itemsize, count, count, 0, 0, 0, 0)  # fmt: skip
    head += struct.pack("<12d", step, step, step, *origin, *(float(end[axis]) for axis in range(3) for end in ends))
    return head + rows.tobytes()


def laz(content: bytes) -> bytes:
    """A LAS file compressed as LAZ.

    Raises:
        MissingExtraError: laspy with its compressor is not installed.
    """
    try:
        import laspy
        import lazrs  # noqa: F401  # laspy finds it by itself, or fails late
    except ImportError:
        raise MissingExtraError("LAZ files are compressed by laspy", "laz") from None
    packed = io.BytesIO()
    laspy.read(io.BytesIO(content)).write(packed, do_compress=True)
    return packed.getvalue()
