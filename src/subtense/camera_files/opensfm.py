"""OpenSfM's camera_models.json (and OpenDroneMap's cameras.json).

Its coordinates begin in the middle of the picture and are in units of the longer side: x_px = x · max(w, h) + (w - 1) / 2, so
its pixels are centred as ours. Cameras go by their names.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from typing import Any

from .exact import focal_px, shortened, undone
from .reading import Found, Reading

_K: dict[str, tuple[str, tuple[str, ...], bool]] = {
    "perspective": ("brown_conrady", ("k1", "k2"), False),
    "simple_radial": ("brown_conrady", ("k1",), True),
    "radial": ("brown_conrady", ("k1", "k2"), True),
    "brown": ("brown_conrady", ("k1", "k2", "p1", "p2", "k3"), True),
    "fisheye": ("fisheye", ("k1", "k2"), False),
    "fisheye_opencv": ("fisheye", ("k1", "k2", "k3", "k4"), True),
}
"""Lens, coefficients in our order, and whether both focal lengths and the principal point stand there."""
_PANORAMAS = ("spherical", "equirectangular")


def tells(tree: Any) -> bool:
    """Whether this is one."""
    return isinstance(tree, dict) and any(isinstance(v, dict) and "projection_type" in v for v in tree.values())


def read(reading: Reading) -> Found:
    """The camera."""
    tree = reading.mapping(reading.content, "the file")
    _, said = reading.one({n: v for n, v in tree.items() if isinstance(v, dict) and "projection_type" in v})
    width, height = reading.size(said.get("width") or None, said.get("height") or None)
    kind, longer = said["projection_type"], max(width, height)
    if kind in _PANORAMAS:
        f = longer / (2 * math.pi)
        return Found(
            reading.camera((width, height), (f, f), ((width - 1) / 2, (height - 1) / 2), "equirectangular", ())
        )
    if not isinstance(kind, str) or kind not in _K:
        raise reading.refused(f"projection_type {str(kind)[:40]} is not read; {', '.join((*_K, *_PANORAMAS))} are")
    lens, names, both = _K[kind]

    def number(name: str) -> float:
        return reading.number(said.get(name, 0.0), name)

    fx, fy = (reading.number(said.get(name), name) for name in (("focal_x", "focal_y") if both else ("focal", "focal")))
    k = [number(name) for name in names]
    k += [0.0] * (4 - len(k)) if lens == "fisheye" else []
    x, y = (number("c_x"), number("c_y")) if both else (0.0, 0.0)
    centre = _to_px(x, longer, width), _to_px(y, longer, height)
    return Found(reading.camera((width, height), (fx * longer, fy * longer), centre, lens, k))


def _to_px(value: float, longer: int, side: int) -> float:
    return value * longer + (side - 1) / 2


def write(found: Found) -> str | None:
    """One camera, named camera; its numbers are those that read as ours, to the last digit or nearly."""
    camera, longer = found.camera, max(found.camera.width_px, found.camera.height_px)
    size: dict[str, Any] = {"width": camera.width_px, "height": camera.height_px}
    if camera.lens == "equirectangular":
        whole = Found(read(Reading("", {"camera": {"projection_type": "spherical", **size}})).camera)
        same = all(getattr(whole.camera, n) == getattr(camera, n) for n in ("f_px", "aspect", "cx_px", "cy_px"))
        return _text({"projection_type": "spherical", **size}) if same else None
    kind = "fisheye_opencv" if camera.lens == "fisheye" else "brown"
    names = _K[kind][1]
    k = shortened(camera.coefficients, (len(names),))
    if k is None:
        return None
    fx, fy = (undone(f, f / longer, lambda v: v * longer) for f in focal_px(camera))
    x, y = (
        undone(float(c), (float(c) - (side - 1) / 2) / longer, _reader(longer, side))
        for c, side in ((camera.cx_px, camera.width_px), (camera.cy_px, camera.height_px))
    )
    numbers = {"focal_x": fx, "focal_y": fy, "c_x": x, "c_y": y, **dict(zip(names, k, strict=True))}
    return _text({"projection_type": kind, **size, **numbers})


def _reader(longer: int, side: int) -> Callable[[float], float]:
    return lambda value: _to_px(value, longer, side)


def _text(camera: dict[str, Any]) -> str:
    return json.dumps({"camera": camera}, indent=1) + "\n"
