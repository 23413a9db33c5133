"""LAS 1.2: points with colours, for programs of surveyors.

Source: American Society for Photogrammetry and Remote Sensing, LAS specification 1.2, point record format 2. Coordinates are whole
multiples of 0.1 mm from the scene's origin.
"""

from __future__ import annotations

import struct

import numpy as np

from ..errors import InputError
from ..scene import Scene

STEP_M = 1e-4
_HEAD, _RECORD = 227, 26


def write(scene: Scene) -> bytes:
    """The points of a scene in metres.

    Raises:
        InputError: the scene has no scale, or is too large for the step.
    """
    if not scene.metric:
        raise InputError("LAS", "a scene without a scale", "give one: LAS holds metres")
    origin = np.zeros(3) if scene.origin_m is None else scene.origin_m
    fine = np.isfinite(scene.points).all(axis=1) & (abs(scene.points) < STEP_M * 2**31).all(axis=1)
    points, colour = scene.points[fine], scene.colour[fine]
    if not len(points):
        raise InputError("LAS", "a scene of no points", "reconstruct one with points")
    rows = np.zeros(len(points), dtype=[("xyz", "<i4", 3), ("intensity", "<u2"), ("flags", "u1"), ("class", "u1"), ("angle", "i1"),
                                        ("user", "u1"), ("source", "<u2"), ("colour", "<u2", 3)])  # fmt: skip
    rows["xyz"] = np.round(points / STEP_M)
    rows["flags"] = 0b001001  # the first of one return
    rows["colour"] = colour.astype(np.uint16) * 257
    low, high = rows["xyz"].min(0) * STEP_M + origin, rows["xyz"].max(0) * STEP_M + origin
    head = struct.pack("<4sHHIHH8sBB32s32sHHHIIBHI5I", b"LASF", 0, 0, 0, 0, 0, bytes(8), 1, 2, b"subtense", b"subtense", 0, 0, _HEAD, _HEAD,
                       0, 2, _RECORD, len(points), len(points), 0, 0, 0, 0)  # fmt: skip
    head += struct.pack("<6d", *(STEP_M,) * 3, *origin)
    head += struct.pack("<6d", high[0], low[0], high[1], low[1], high[2], low[2])
    assert len(head) == _HEAD and rows.itemsize == _RECORD
    return head + rows.tobytes()
