"""OpenCV's calibrations: FileStorage YAML, XML and JSON, and the same keys as other programs spell them.

The camera matrix and the coefficients are OpenCV's, so they go in as they are; pixel (0, 0) is a centre there too. Keys
are compared without case, _ and -. A tag before or behind names one of several cameras: M1 and D1, cameraMatrix2 and
distCoeffs2, K_left and D_left. With OpenCV's standard deviations (`..._std_dev` of its interactive calibration) the
covariance is theirs, without correlations, which no file tells.
"""

from __future__ import annotations

import json
import re
from typing import Any

import numpy as np

from ..arrays import Array
from ..quantity import Note
from .exact import focal_px
from .reading import Found, Reading

_TAG = r"(left|right|l|r|\d{1,2})"
_MATRIX = re.compile(
    rf"{_TAG}?(?:cameramatrix|cameraintrinsics|intrinsicmatrix|intrinsics?|cammat|matrix|mtx|k|m){_TAG}?"
)
_DISTORTION = re.compile(
    rf"{_TAG}?(?:distortioncoefficients?|distortioncoeffs?|distcoeffs?|distortion|distcoefs?|dist|d){_TAG}?"
)
_WIDTHS, _HEIGHTS = ("imagewidth", "width"), ("imageheight", "height")
_SIZES = ("cameraresolution", "imagesize", "imgsize", "resolution", "size")
_FISHEYE_WORDS = ("fisheye", "equidistant", "kannalabrandt", "kb4")
_MODEL_KEYS = ("fisheyemodel", "fisheye", "distortionmodel", "cameramodel", "model", "lensmodel")
_SPREADS = ("stddeviationsintrinsics", "stddeviationsint", "stddevsintrinsics")


def _plain(key: str) -> str:
    return key.lower().replace("_", "").replace("-", "").replace(" ", "")


def _by_tag(tree: dict[str, Any], pattern: re.Pattern[str]) -> dict[str, str]:
    """Which key has which tag; "left" and "l" are one."""
    found = {}
    for key, value in tree.items():
        if (match := pattern.fullmatch(_plain(key))) and value is not None:
            tag = match[1] or match[2] or ""
            found[tag if tag.isdigit() else tag[:1]] = key
    return found


def tells(tree: Any) -> bool:
    """Whether this is one: a matrix of 9 numbers under one of the names."""
    return isinstance(tree, dict) and any(_of_nine(tree[key]) for key in _by_tag(tree, _MATRIX).values())


def _of_nine(value: Any) -> bool:
    data = value.get("data") if isinstance(value, dict) else value
    if not isinstance(data, list):
        return False
    return len(data) == 9 or (len(data) == 3 and all(isinstance(row, list) and len(row) == 3 for row in data))


def read(reading: Reading) -> Found:
    """The camera."""
    tree = reading.mapping(reading.content, "the file")
    tagged = {tag: key for tag, key in _by_tag(tree, _MATRIX).items() if _of_nine(tree[key])}
    if not tagged:
        raise reading.refused("has no camera_matrix of 3 x 3 numbers; give the file that the calibration wrote")
    matrix_key, tag = reading.one({key: tag for tag, key in tagged.items()})
    fx, fy, cx, cy = reading.focal_and_centre(reading.numbers(tree[matrix_key], matrix_key, (9,)), matrix_key)
    fisheye = reading.pick.fisheye or _says_fisheye(reading, tree)
    k_key = _by_tag(tree, _DISTORTION).get(tag)
    counts = (4,) if fisheye else (0, 4, 5, 8, 12, 14)
    k = reading.numbers(tree[k_key], k_key, counts) if k_key else [0.0] * (4 if fisheye else 0)
    size = _size(reading, tree, (cx, cy))
    spread = _spread(reading, tree, matrix_key, k_key, len(k))
    cov = None if spread is None else _cov(reading, spread, fx, fy, fisheye=fisheye)
    camera = reading.camera(size, (fx, fy), (cx, cy), "fisheye" if fisheye else "brown_conrady", k, cov)
    return Found(camera, () if cov is None else (_UNCORRELATED,))


_UNCORRELATED = Note(
    "calibration_without_correlations",
    "the calibration tells standard deviations but not how its numbers vary together; they are taken as independent",
    "calibrate with a tool that tells the covariance",
)


def _says_fisheye(reading: Reading, tree: dict[str, Any]) -> bool:
    for key, value in tree.items():
        if _plain(key) not in _MODEL_KEYS:
            continue
        if isinstance(value, str):
            if _plain(value) in _FISHEYE_WORDS:
                return True
        elif _plain(key) in ("fisheyemodel", "fisheye") and value is not None:
            return bool(value) if isinstance(value, bool) else reading.number(value, key) != 0
    return False


def _size(reading: Reading, tree: dict[str, Any], centre: tuple[float, float]) -> tuple[int, int]:
    plain = {_plain(key): value for key, value in tree.items()}
    width, height = (next((plain[k] for k in keys if plain.get(k) is not None), None) for keys in (_WIDTHS, _HEIGHTS))
    pair = next((plain[key] for key in _SIZES if isinstance(plain.get(key), (dict, list))), None)
    if width is None and isinstance(pair, dict):
        width, height = pair.get("width"), pair.get("height")
    elif width is None and isinstance(pair, list) and len(pair) == 2:
        width, height = pair
        size = reading.size(width, height)
        if (centre[0] > size[0] or centre[1] > size[1]) and centre[0] < size[1] and centre[1] < size[0]:
            raise reading.refused(f"its picture size {size[0]}, {size[1]} seems to be height and width; exchange them")
    return reading.size(width, height)


# -- uncertainty ---------------------------------------------------------------------------------------


def _spread(reading: Reading, tree: dict[str, Any], matrix: str, k: str | None, count: int) -> list[float] | None:
    """Standard deviations of fx, fy, cx, cy and the coefficients, where the file tells them."""
    plain = {_plain(key): value for key, value in tree.items()}
    whole = next((plain[key] for key in _SPREADS if plain.get(key) is not None), None)
    if whole is not None:
        found = reading.numbers(whole, "the standard deviations")[: 4 + count]
    elif (mine := plain.get(_plain(matrix) + "stddev")) is not None:
        found = reading.numbers(mine, f"{matrix}_std_dev", (4,))
        lens = plain.get(_plain(k) + "stddev") if k else None
        found += reading.numbers(lens, f"{k}_std_dev")[:count] if lens is not None else []
    else:
        return None
    if len(found) < 4 or any(u < 0 for u in found):
        raise reading.refused("its standard deviations must be 4 or more numbers of 0 or above")
    return found + [0.0] * (4 + count - len(found))


def _cov(reading: Reading, u: list[float], fx: float, fy: float, *, fisheye: bool) -> Array | None:
    """The covariance of (f, aspect, cx, cy, coefficients).

    With a fixed aspect ratio OpenCV writes 0 for fx and all of the doubt for fy: there the aspect is exact. Elsewhere fx and
    fy are taken as independent, and aspect = fy / fx follows.
    """
    if not any(u) or not (fx > 0 and fy > 0):
        return None
    count = 4 if fisheye else next(n for n in (5, 8, 12, 14) if n >= len(u) - 4)
    with np.errstate(over="ignore", invalid="ignore"):
        cov = np.diag(np.square([*u, *[0.0] * (4 + count - len(u))]))
        if u[0] == 0 or u[1] == 0:
            cov[0, 0], cov[1, 1] = max(u[0], u[1] * fx / fy) ** 2, 0.0
        else:
            by_fx, by_fy = np.float64(-fy) / fx / fx, 1 / np.float64(fx)
            cov[1, 1] = (by_fx * u[0]) ** 2 + (by_fy * u[1]) ** 2
            cov[0, 1] = cov[1, 0] = by_fx * u[0] ** 2
    if not np.all(np.isfinite(cov)):
        raise reading.refused("its standard deviations are too large")
    return cov


# -- writing -------------------------------------------------------------------------------------------


def _keys(found: Found) -> dict[str, Any] | None:
    """What a file holds, under the names that OpenCV's calibration sample gives; matrices as NumPy arrays."""
    camera = found.camera
    if camera.lens == "equirectangular":
        return None
    fx, fy = focal_px(camera)
    matrix = np.array([[fx, 0, camera.cx_px], [0, fy, camera.cy_px], [0, 0, 1.0]])
    k = np.zeros(5) if camera.lens == "pinhole" else camera.coefficients
    return {
        "image_width": camera.width_px, "image_height": camera.height_px, "fisheye_model": int(camera.lens == "fisheye"),
        "camera_matrix": matrix, "distortion_coefficients": k.reshape(1, -1),
    }  # fmt: skip


def _numbers(matrix: Array) -> list[str]:
    return [repr(float(v)) for v in matrix.ravel()]


def write_yaml(found: Found) -> str | None:
    """FileStorage YAML."""
    if (keys := _keys(found)) is None:
        return None
    lines = ["%YAML:1.0", "---"]
    for key, value in keys.items():
        if isinstance(value, int):
            lines.append(f"{key}: {value}")
            continue
        rows, cols = value.shape
        data = f"   data: [ {', '.join(_numbers(value))} ]"
        lines += [f"{key}: !!opencv-matrix", f"   rows: {rows}", f"   cols: {cols}", "   dt: d", data]
    return "\n".join(lines) + "\n"


def write_xml(found: Found) -> str | None:
    """FileStorage XML."""
    if (keys := _keys(found)) is None:
        return None
    lines = ['<?xml version="1.0"?>', "<opencv_storage>"]
    for key, value in keys.items():
        if isinstance(value, int):
            lines.append(f"<{key}>{value}</{key}>")
            continue
        rows, cols = value.shape
        inner = f"  <rows>{rows}</rows>", f"  <cols>{cols}</cols>", "  <dt>d</dt>"
        data = f"  <data>{' '.join(_numbers(value))}</data></{key}>"
        lines += [f'<{key} type_id="opencv-matrix">', *inner, data]
    return "\n".join([*lines, "</opencv_storage>"]) + "\n"


def write_json(found: Found) -> str | None:
    """FileStorage JSON."""
    if (keys := _keys(found)) is None:
        return None
    tree = {
        key: value if isinstance(value, int) else {"type_id": "opencv-matrix", "rows": value.shape[0], "cols": value.shape[1],
                                                   "dt": "d", "data": value.ravel().tolist()}
        for key, value in keys.items()
    }  # fmt: skip
    return json.dumps(tree, indent=1) + "\n"
