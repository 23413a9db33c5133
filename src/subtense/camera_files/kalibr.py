"""Kalibr's camchain, and the sensor.yaml of data sets made like it: pinhole with radtan, equidistant or none.

Coordinates are OpenCV's. The cameras of a chain go by their names, cam0, cam1, ...
"""

from __future__ import annotations

from typing import Any

from .exact import focal_px, shortened
from .reading import Found, Reading

_LENSES = {"radtan": ("brown_conrady", 4), "radial-tangential": ("brown_conrady", 4), "plumb_bob": ("brown_conrady", 4),
           "equidistant": ("fisheye", 4), "none": ("pinhole", 0)}  # fmt: skip


def _is_camera(tree: Any) -> bool:
    return isinstance(tree, dict) and "camera_model" in tree and "intrinsics" in tree


def tells(tree: Any) -> bool:
    """Whether this is one."""
    return _is_camera(tree) or (isinstance(tree, dict) and any(_is_camera(value) for value in tree.values()))


def read(reading: Reading) -> Found:
    """The camera."""
    tree = reading.mapping(reading.content, "the file")
    if _is_camera(tree):
        reading.none_to_choose()
    else:
        _, tree = reading.one({name: value for name, value in tree.items() if _is_camera(value)})
    if tree["camera_model"] != "pinhole":
        raise reading.refused(f"camera_model {str(tree['camera_model'])[:40]} is not read; pinhole is")
    model = tree.get("distortion_model") or "none"
    if not isinstance(model, str) or model not in _LENSES:
        raise reading.refused(f"distortion_model {str(model)[:40]} is not read; radtan, equidistant and none are")
    lens, count = _LENSES[model]
    fx, fy, cx, cy = reading.numbers(tree["intrinsics"], "intrinsics", (4,))
    key = "distortion_coefficients" if "distortion_coefficients" in tree else "distortion_coeffs"
    k = reading.numbers(tree.get(key), key, (count,)) if count else []
    size = tree.get("resolution")
    width, height = reading.numbers(size, "resolution", (2,)) if size is not None else (None, None)
    return Found(reading.camera(reading.size(width, height), (fx, fy), (cx, cy), lens, k))


def write(found: Found) -> str | None:
    """A camchain of one camera, cam0."""
    camera = found.camera
    models = {"pinhole": ("none", 0), "brown_conrady": ("radtan", 4), "fisheye": ("equidistant", 4)}
    if camera.lens not in models:
        return None
    model, count = models[camera.lens]
    if (k := shortened(camera.coefficients, (count,))) is None:
        return None
    intrinsics = [*focal_px(camera), float(camera.cx_px), float(camera.cy_px)]
    return "\n".join([
        "cam0:", "  camera_model: pinhole", f"  distortion_coeffs: {k!r}", f"  distortion_model: {model}",
        f"  intrinsics: {intrinsics!r}", f"  resolution: [{camera.width_px}, {camera.height_px}]", "  rostopic: /cam0/image_raw",
    ]) + "\n"  # fmt: skip
