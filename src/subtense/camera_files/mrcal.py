"""mrcal's .cameramodel: a Python literal, here read without Python; the pinhole and OpenCV lens models.

Intrinsics are fx, fy, cx, cy and then OpenCV's coefficients; pixel (0, 0) is a centre. What the file holds of the
calibration's own inputs is left out.
"""

from __future__ import annotations

import re
from typing import Any

from .exact import focal_px, shortened
from .reading import Found, Reading

_COUNTS = {
    "LENSMODEL_PINHOLE": 0,
    "LENSMODEL_OPENCV4": 4,
    "LENSMODEL_OPENCV5": 5,
    "LENSMODEL_OPENCV8": 8,
    "LENSMODEL_OPENCV12": 12,
}
_KEYS = ("lensmodel", "lens_model", "distortion_model")
_MARK = re.compile(r"""['"](?:lensmodel|lens_model|distortion_model)['"]\s{0,9}:\s{0,9}['"](?:LENSMODEL|DISTORTION)_""")


def marked(text: str) -> bool:
    """Whether a text has a .cameramodel's first key."""
    return _MARK.search(text) is not None


def tells(tree: Any) -> bool:
    """Whether this is one."""
    return isinstance(tree, dict) and "intrinsics" in tree and any(key in tree for key in _KEYS)


def read(reading: Reading) -> Found:
    """The camera."""
    reading.none_to_choose()
    tree = reading.mapping(reading.content, "the file")
    key = next((key for key in _KEYS if key in tree), _KEYS[0])
    model = reading.text(tree.get(key), key).replace("DISTORTION_", "LENSMODEL_")
    model = {"LENSMODEL_NONE": "LENSMODEL_PINHOLE"}.get(model, model)
    if model not in _COUNTS:
        raise reading.refused(f"{key} {model[:60]} is not read; {', '.join(_COUNTS)} are (mrcal-convert-lensmodel)")
    fx, fy, cx, cy, *k = reading.numbers(tree.get("intrinsics"), "intrinsics", (4 + _COUNTS[model],))
    size = tree.get("imagersize")
    width, height = reading.numbers(size, "imagersize", (2,)) if size is not None else (None, None)
    return Found(reading.camera(reading.size(width, height), (fx, fy), (cx, cy), "brown_conrady", k))


def write(found: Found) -> str | None:
    """A .cameramodel at the origin, under the key names that every version of mrcal reads."""
    camera = found.camera
    if camera.lens not in ("pinhole", "brown_conrady"):
        return None
    counts = (0,) if camera.lens == "pinhole" else (4, 5, 8, 12)
    if (k := shortened(camera.coefficients, counts)) is None:
        return None
    model = next(name for name, count in _COUNTS.items() if count == len(k))
    intrinsics = [*focal_px(camera), float(camera.cx_px), float(camera.cy_px), *k]
    return "\n".join([
        "{", f"    'lens_model': '{model}',", "", "    # intrinsics are fx,fy,cx,cy,distortion0,distortion1,....",
        f"    'intrinsics': {intrinsics!r},", "", "    'extrinsics': [0, 0, 0, 0, 0, 0],", "",
        f"    'imagersize': [{camera.width_px}, {camera.height_px}],", "}",
    ]) + "\n"  # fmt: skip
