"""ROS camera_info, as camera_calibration_parsers writes it and as `rostopic echo` prints it.

K and D are OpenCV's, and hold for the raw picture of the full sensor: a region of interest is cut out and binning applied
here, half a pixel included, so that the camera is that of the pictures. Rectification and P are left out.
"""

from __future__ import annotations

from typing import Any

from ..camera import Camera
from ..errors import InputError
from .exact import focal_px, shortened
from .reading import Found, Reading

_COUNTS = {"plumb_bob": (4, 5), "rational_polynomial": (8, 12, 14), "equidistant": (4,)}
_MARKS = ("rectification_matrix", "projection_matrix", "distortion_model")


def tells(tree: Any) -> bool:
    """Whether this is one."""
    if not isinstance(tree, dict):
        return False
    parsed = "camera_matrix" in tree and any(key in tree for key in _MARKS)
    printed = any(key in tree for key in "Kk") and any(key in tree for key in "Dd") and "distortion_model" in tree
    return parsed or printed


def read(reading: Reading) -> Found:
    """The camera of the pictures."""
    reading.none_to_choose()
    tree = reading.mapping(reading.content, "the file")
    matrix_key, k_key = (
        next((key for key in keys if tree.get(key) is not None), keys[0])
        for keys in (("camera_matrix", "K", "k"), ("distortion_coefficients", "D", "d"))
    )
    fx, fy, cx, cy = reading.focal_and_centre(reading.numbers(tree.get(matrix_key), matrix_key, (9,)), matrix_key)
    k = reading.numbers(tree.get(k_key), k_key) if tree.get(k_key) is not None else []
    model = tree.get("distortion_model") or ("plumb_bob" if len(k) <= 5 else "rational_polynomial")
    if model == "fisheye":  # as some drivers call it
        model = "equidistant"
    if not isinstance(model, str) or model not in _COUNTS:
        raise reading.refused(f"distortion_model {str(model)[:40]!r} is not read; {', '.join(_COUNTS)} are")
    if k or model == "equidistant":
        k = reading.numbers(tree.get(k_key), k_key, _COUNTS[model])
    width, height = (tree.get(f"image_{side}", tree.get(side)) for side in ("width", "height"))
    lens = "fisheye" if model == "equidistant" else "brown_conrady"
    sensor = reading.camera(_sensor(reading, tree, width, height), (fx, fy), (cx, cy), lens, k)
    return Found(_seen(reading, tree, sensor))


def _sensor(reading: Reading, tree: dict[str, Any], width: Any, height: Any) -> tuple[int, int]:
    """The full sensor's size; what was said beside the file is that of the pictures, so it counts only without these."""
    whole = not (tree.get("binning_x") or tree.get("binning_y") or tree.get("roi"))
    return reading.size(width, height) if whole else Reading(reading.path, None).size(width, height)


def _seen(reading: Reading, tree: dict[str, Any], sensor: Camera) -> Camera:
    """The region of interest, then binning; 0 stands for none of it."""
    roi = reading.mapping(tree.get("roi") or {}, "roi")
    cut = {key: reading.number(roi.get(key) or 0, f"roi.{key}") for key in ("x_offset", "y_offset", "width", "height")}
    if any(value < 0 or value != int(value) for value in cut.values()):
        raise reading.refused("roi must be whole numbers of 0 or above")
    camera = sensor
    left, top = int(cut["x_offset"]), int(cut["y_offset"])
    width, height = int(cut["width"]) or sensor.width_px - left, int(cut["height"]) or sensor.height_px - top
    if not (0 < width <= sensor.width_px - left and 0 < height <= sensor.height_px - top):
        raise reading.refused("roi lies outside of the picture")
    if (left, top, width, height) != (0, 0, sensor.width_px, sensor.height_px):
        camera = sensor.cropped(left, top, width, height)
    bins = [reading.number(tree.get(key) or 1, key) for key in ("binning_x", "binning_y")]
    if any(n < 1 or n != int(n) or side % n for n, side in zip(bins, (width, height), strict=True)):
        raise reading.refused("binning must be whole numbers that divide the picture's width and height")
    try:
        return camera if bins == [1, 1] else camera.resized(int(width / bins[0]), int(height / bins[1]))
    except InputError as error:
        raise reading.refused(str(error)) from None


def write(found: Found) -> str | None:
    """As camera_calibration_parsers; P is K, as for one camera that is not rectified."""
    camera = found.camera
    models = {"pinhole": ("plumb_bob", (5,)), "brown_conrady": ("plumb_bob", (5,)), "fisheye": ("equidistant", (4,))}
    if camera.lens not in models:
        return None
    model, counts = models[camera.lens]
    k = shortened(camera.coefficients, counts)
    if k is None or camera.coefficients.size > 5:  # as many as there were, so that reading gives back the same
        model, k = "rational_polynomial", shortened(camera.coefficients, (8,))
    if k is None:
        return None
    (fx, fy), cx, cy = focal_px(camera), float(camera.cx_px), float(camera.cy_px)
    matrices = {
        "camera_matrix": (3, [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]), "distortion_coefficients": (1, k),
        "rectification_matrix": (3, [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]),
        "projection_matrix": (3, [fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0]),
    }  # fmt: skip
    lines = [f"image_width: {camera.width_px}", f"image_height: {camera.height_px}", "camera_name: camera"]
    for name, (rows, data) in matrices.items():
        if name == "distortion_coefficients":
            lines.append(f"distortion_model: {model}")
        numbers = ", ".join(map(repr, data))
        lines += [f"{name}:", f"  rows: {rows}", f"  cols: {len(data) // rows}", f"  data: [{numbers}]"]
    return "\n".join(lines) + "\n"
