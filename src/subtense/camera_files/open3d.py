"""Open3D's pinhole intrinsics: width, height and a camera matrix given column by column; pixel (0, 0) is a centre."""

from __future__ import annotations

import json
from typing import Any

from .exact import focal_px
from .reading import Found, Reading

_BY_COLUMN = (0, 3, 6, 1, 4, 7, 2, 5, 8)


def tells(tree: Any) -> bool:
    """Whether this is one: a flat matrix whose last number of the first row, by rows, would be 0."""
    matrix = tree.get("intrinsic_matrix") if isinstance(tree, dict) else None
    return (
        isinstance(matrix, list)
        and len(matrix) == 9
        and not any(isinstance(v, list) for v in matrix)
        and matrix[2] == 0
    )


def read(reading: Reading) -> Found:
    """The camera."""
    reading.none_to_choose()
    tree = reading.mapping(reading.content, "the file")
    m = reading.numbers(tree.get("intrinsic_matrix"), "intrinsic_matrix", (9,))
    fx, fy, cx, cy = reading.focal_and_centre([m[i] for i in _BY_COLUMN], "intrinsic_matrix")
    return Found(reading.camera(reading.size(tree.get("width"), tree.get("height")), (fx, fy), (cx, cy), "pinhole", ()))


def write(found: Found) -> str | None:
    """The same keys."""
    camera = found.camera
    if camera.lens != "pinhole":
        return None
    (fx, fy), cx, cy = focal_px(camera), float(camera.cx_px), float(camera.cy_px)
    matrix = [fx, 0, 0, 0, fy, 0, cx, cy, 1]
    return (
        json.dumps({"width": camera.width_px, "height": camera.height_px, "intrinsic_matrix": matrix}, indent=1) + "\n"
    )
