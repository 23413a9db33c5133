"""MATLAB's cameraParameters or cameraIntrinsics as `jsonencode` writes them, or their `toStruct`.

MATLAB's pixels begin at 1, so 1 is taken off the principal point; IntrinsicMatrix is the transposed camera matrix, K is not;
ImageSize is rows, columns.
"""

from __future__ import annotations

import json
from typing import Any

from .exact import focal_px, moved_centre_px, shortened
from .reading import Found, Reading

FIRST = 1.0
_PAIR = ("CameraParameters1", "CameraParameters2")
_AGREE = 1e-9


def _is_camera(tree: Any) -> bool:
    return isinstance(tree, dict) and (
        "IntrinsicMatrix" in tree or ("FocalLength" in tree and "PrincipalPoint" in tree) or ("K" in tree and "RadialDistortion" in tree)
        or "MappingCoefficients" in tree or _is_camera(tree.get("Intrinsics"))
    )  # fmt: skip


def tells(tree: Any) -> bool:
    """Whether this is one."""
    return _is_camera(tree) or (isinstance(tree, dict) and any(_is_camera(tree.get(key)) for key in _PAIR))


def read(reading: Reading) -> Found:
    """The camera."""
    tree = reading.mapping(reading.content, "the file")
    if _is_camera(tree):
        reading.none_to_choose()
    else:
        _, tree = reading.one({key: tree[key] for key in _PAIR if _is_camera(tree.get(key))})
    while isinstance(tree.get("Intrinsics"), dict) and "FocalLength" not in tree:
        tree = tree["Intrinsics"]
    if "MappingCoefficients" in tree:
        raise reading.refused("MATLAB's fisheyeIntrinsics are not read; cameraIntrinsics are")
    fx, fy, cx, cy = _focal_and_centre(reading, tree)
    radial = _list(reading, tree, "RadialDistortion", (2, 3))
    p1, p2 = _list(reading, tree, "TangentialDistortion", (2,))
    k = [radial[0], radial[1], p1, p2, radial[2] if len(radial) > 2 else 0.0]
    size = tree.get("ImageSize") or None
    height, width = reading.numbers(size, "ImageSize", (2,)) if size is not None else (None, None)
    return Found(reading.camera(reading.size(width, height), (fx, fy), (cx - FIRST, cy - FIRST), "brown_conrady", k))


def _list(reading: Reading, tree: dict[str, Any], name: str, counts: tuple[int, ...]) -> list[float]:
    return reading.numbers(tree[name], name, counts) if tree.get(name) else [0.0] * counts[0]


def _focal_and_centre(reading: Reading, tree: dict[str, Any]) -> tuple[float, float, float, float]:
    """From the matrix, and from FocalLength and PrincipalPoint; where both stand there they must agree."""
    found: list[tuple[float, float, float, float]] = []
    if tree.get("Skew") is not None:
        reading.no_skew(reading.number(tree["Skew"], "Skew"))
    if "FocalLength" in tree and "PrincipalPoint" in tree:
        (fx, fy), (cx, cy) = (reading.numbers(tree[key], key, (2,)) for key in ("FocalLength", "PrincipalPoint"))
        found.append((fx, fy, cx, cy))
    for key in ("IntrinsicMatrix", "K"):
        if tree.get(key) is not None:
            m = reading.numbers(tree[key], key, (9,))
            m = [m[i] for i in (0, 3, 6, 1, 4, 7, 2, 5, 8)] if key == "IntrinsicMatrix" else m
            found.append(reading.focal_and_centre(m, key))
    if not found:
        raise reading.refused("has neither FocalLength and PrincipalPoint nor IntrinsicMatrix")
    if any(abs(a - b) > _AGREE * max(abs(a), 1.0) for other in found[1:] for a, b in zip(found[0], other, strict=True)):
        raise reading.refused("its FocalLength, PrincipalPoint and matrix contradict each other; keep one of them")
    return found[0]


def write(found: Found) -> str | None:
    """Fields as `toStruct` of a cameraIntrinsics gives them."""
    camera = found.camera
    if camera.lens not in ("pinhole", "brown_conrady") or (k := shortened(camera.coefficients, (5,))) is None:
        return None
    (fx, fy), (cx, cy) = focal_px(camera), moved_centre_px(camera, FIRST)
    tree = {
        "FocalLength": [fx, fy], "PrincipalPoint": [cx, cy], "ImageSize": [camera.height_px, camera.width_px],
        "RadialDistortion": [k[0], k[1], k[4]], "TangentialDistortion": k[2:4], "Skew": 0,
        "IntrinsicMatrix": [[fx, 0, 0], [0, fy, 0], [cx, cy, 1]],
    }  # fmt: skip
    return json.dumps(tree, indent=1) + "\n"
