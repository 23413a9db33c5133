"""Depth maps as files: numbers (PNG of 16 bits, PFM, NPY), a picture in colour with a scale, point clouds (PLY, LAS), error by depth."""

from __future__ import annotations

import io
import math
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import Array, Pixels
from ..depth_map import DepthMap
from ..errors import InputError, MissingExtraError
from ..las import las, laz
from ..whole_file import write_whole

ENDINGS = {
    "--depth-map": (".png", ".pfm", ".npy"),
    "--sigma-map": (".png", ".pfm", ".npy"),
    "--depth-picture": (".png", ".jpg", ".jpeg"),
    "--cloud": (".ply", ".las", ".laz"),
    "--error-plot": (".csv", ".png"),
}
NOTHING_RGB, FILLED_WEIGHT = (38, 38, 42), 0.55
"""Pixels without a depth; filled ones are drawn paler, by this weight of their colour."""
SCALE_PX = 96
"""Width of the scale beside a picture of 1000 px."""
MOST_MM = 65535
BINS = 24
"""Of the error by depth, equally full."""


def check(path: Path, option: str) -> None:
    """Refuse a file's name that can't be written.

    Raises:
        InputError: another ending, or no such folder.
    """
    if path.suffix.lower() not in ENDINGS[option]:
        raise InputError(option, str(path), f"give a name that ends in {', '.join(ENDINGS[option])}")
    if not path.parent.is_dir():
        raise InputError(option, str(path), "its folder does not exist")


def write_map(values_m: Array, path: Path, option: str) -> None:
    """(height, width) metres: a PNG of 16 bits has whole millimetres and 0 for none, and none beyond 65.5 m; PFM and NPY have NaN."""
    check(path, option)
    ways = {".png": _png, ".pfm": _pfm, ".npy": _npy}
    write_whole(path, ways[path.suffix.lower()](np.asarray(values_m, np.float32)), option)


def _png(values: Any) -> bytes:
    from PIL import Image

    whole = np.rint(np.nan_to_num(values, nan=0.0) * 1000)
    whole = np.where(whole > MOST_MM, 0, np.where(values > 0, np.maximum(whole, 1), 0)).astype(np.uint16)
    file = io.BytesIO()
    Image.fromarray(whole).save(file, "PNG")
    return bytes(file.getvalue())


def _pfm(values: Any) -> bytes:
    """Rows from the bottom up, little-endian, as the format wants them."""
    height, width = values.shape
    return f"Pf\n{width} {height}\n-1.0\n".encode() + bytes(values[::-1].astype("<f4").tobytes())


def _npy(values: Any) -> bytes:
    file = io.BytesIO()
    np.save(file, values, allow_pickle=False)
    return bytes(file.getvalue())


# -- the picture -----------------------------------------------------------------------------------------


def write_picture(made: DepthMap, path: Path, option: str) -> None:
    """Near is red, far is blue, even in inverse depth, as the disparity is; beside it the scale in metres."""
    check(path, option)
    file = io.BytesIO()
    form = "PNG" if path.suffix.lower() == ".png" else "JPEG"
    picture(made).save(file, form, **({} if form == "PNG" else {"quality": 92}))
    write_whole(path, file.getvalue(), option)


def picture(made: DepthMap) -> Any:
    """As a Pillow image: the map, and at its right the scale."""
    from PIL import Image

    answered = made.answered
    height, width = answered.shape
    near, far = (0.5, 2.0)
    if answered.any():
        seen = answered & ~made.filled if np.any(answered & ~made.filled) else answered
        near, far = (float(q) for q in np.quantile(made.depth_m[seen], [0.005, 0.995]))
        far = max(far, near * 1.001)
    with np.errstate(invalid="ignore", divide="ignore"):
        share = (1 / made.depth_m - 1 / far) / (1 / near - 1 / far)
    shown = _coloured(np.nan_to_num(share).clip(0, 1))
    shown = np.where(made.filled[..., None], FILLED_WEIGHT * shown + (1 - FILLED_WEIGHT) * 90, shown)
    shown = np.where(answered[..., None], shown, NOTHING_RGB).astype(np.uint8)
    beside = max(72, round(SCALE_PX * max(height, width) / 1000))
    whole = Image.new("RGB", (width + beside, height), (255, 255, 255))
    whole.paste(Image.fromarray(shown), (0, 0))
    _scale(whole, width, beside, near, far)
    return whole


def _coloured(share: Any) -> Any:
    import cv2

    table: Any = cv2.applyColorMap(np.arange(256, dtype=np.uint8)[:, None], cv2.COLORMAP_TURBO)[:, 0, ::-1]
    return table[np.rint(20 + 220 * share).astype(np.uint8)].astype(float)


def _scale(whole: Any, left: int, beside: int, near: float, far: float) -> None:
    """A bar from far, at the top, to near, with depths at round numbers."""
    from PIL import Image, ImageDraw, ImageFont

    height, size = whole.height, max(11, beside // 6)
    font = ImageFont.load_default(size)
    top, bottom, bar = 2 * size, height - 2 * size, beside // 4
    if bottom - top < 20:
        return
    share = np.linspace(0, 1, bottom - top)
    strip = np.broadcast_to(_coloured(share)[:, None], (len(share), bar, 3)).astype(np.uint8)
    whole.paste(Image.fromarray(np.ascontiguousarray(strip)), (left + size // 2, top))
    pen = ImageDraw.Draw(whole)
    pen.text((left + size // 2, size // 4), "m", fill=(30, 30, 30), font=font)
    last = -math.inf
    for depth in _round_depths(near, far):
        y = top + (bottom - top) * (1 / depth - 1 / far) / (1 / near - 1 / far)
        if y - last < 1.4 * size:
            continue
        last = y
        x = left + size // 2 + bar
        pen.line([(x, y), (x + 4, y)], fill=(30, 30, 30))
        pen.text((x + 7, y - 0.6 * size), f"{depth:g}", fill=(30, 30, 30), font=font)


def _round_depths(near: float, far: float) -> list[float]:
    """From far to near, at one or two digits times powers of ten."""
    found = []
    for power in range(math.floor(math.log10(near)) - 1, math.ceil(math.log10(far)) + 1):
        found += [
            round(d * 10.0**power, 6)
            for d in (1, 1.1, 1.2, 1.3, 1.4, 1.5, 1.6, 1.8, 2, 2.2, 2.5, 3, 3.5, 4, 5, 6, 7, 8, 9)
        ]
    found = [d for d in found if near <= d <= far]
    return sorted(found, reverse=True) if len(found) > 1 else [far, near]


# -- points ----------------------------------------------------------------------------------------------


def write_cloud(made: DepthMap, pixels: Pixels, path: Path, option: str) -> None:
    """Points that were seen, not filled ones, with colour; in PLY also the standard deviation of each depth, m. Camera axes: x right,
    y down, z forward; LAS and LAZ, which geographers read, has z up: (x, z, -y)."""
    check(path, option)
    kept = made.answered & ~made.filled
    points, colours = made.points_m()[kept], pixels[kept]
    sigma = np.asarray(made.sigma_m[kept], "<f4")
    fine = np.isfinite(points).all(axis=-1)
    points, colours, sigma = points[fine], colours[fine], sigma[fine]
    write_whole(path, _points(points, colours, sigma, path.suffix.lower()), option)


def _points(points: Array, colours: Pixels, sigma: Any, ending: str) -> bytes:
    if ending == ".ply":
        return _ply(points, colours, sigma)
    content = las(np.stack([points[:, 0], points[:, 2], -points[:, 1]], -1), colours)
    return laz(content) if ending == ".laz" else content


def _ply(points: Array, colours: Pixels, sigma: Any) -> bytes:
    rows = np.zeros(len(points), [("xyz", "<f4", 3), ("rgb", "u1", 3), ("sigma", "<f4")])
    rows["xyz"], rows["rgb"], rows["sigma"] = points, colours, sigma
    head = [
        "ply", "format binary_little_endian 1.0", "comment metres, camera axes: x right, y down, z forward",
        "comment sigma: standard deviation of the depth z", f"element vertex {len(points)}",
        *(f"property float {name}" for name in "xyz"), *(f"property uchar {name}" for name in ("red", "green", "blue")),
        "property float sigma", "end_header", "",
    ]  # fmt: skip
    return "\n".join(head).encode() + rows.tobytes()


# -- error by depth --------------------------------------------------------------------------------------


def write_error(made: DepthMap, path: Path, option: str) -> None:
    """Median, and 90 of 100, of the standard deviation in steps of depth: a table, or a picture.

    Raises:
        MissingExtraError: a picture, and matplotlib is not installed.
    """
    check(path, option)
    rows = error_by_depth(made)
    if path.suffix.lower() == ".csv":
        lines = [
            "depth_m,sigma_median_m,sigma_90_m,pixels",
            *(f"{d:.6g},{m:.6g},{q:.6g},{int(n)}" for d, m, q, n in rows),
        ]
        write_whole(path, "\n".join(lines) + "\n", option)
        return
    write_whole(path, _error_png(rows), option)


def error_by_depth(made: DepthMap) -> Array:
    """(n, 4) median depth, median standard deviation, that of 90 of 100, and pixels, of equally full steps of depth."""
    kept = made.answered & ~made.filled
    depth, sigma = np.asarray(made.depth_m[kept], float), np.asarray(made.sigma_m[kept], float)
    if not len(depth):
        return np.zeros((0, 4))
    parts = np.array_split(np.argsort(depth), min(BINS, len(depth)))
    return np.array([[np.median(depth[p]), np.median(sigma[p]), np.quantile(sigma[p], 0.9), len(p)] for p in parts])


def _error_png(rows: Array) -> bytes:
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
        from matplotlib.ticker import FuncFormatter
    except ImportError:
        raise MissingExtraError("a picture of the error by depth", "plots") from None
    figure = Figure(figsize=(7, 4.2), dpi=120, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    axes.plot(rows[:, 0], 1000 * rows[:, 1], color="#1f5fa8", lw=2, label="half of the pixels are better")
    axes.plot(rows[:, 0], 1000 * rows[:, 2], color="#1f5fa8", lw=1, ls="--", label="nine of ten are better")
    axes.set(xlabel="depth, m", ylabel="standard deviation of the depth, mm", yscale="log")
    for axis in (axes.yaxis.set_major_formatter, axes.yaxis.set_minor_formatter):
        axis(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.grid(True, which="both", color="#dddddd", lw=0.5)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(frameon=False)
    file = io.BytesIO()
    figure.savefig(file, format="png", metadata={"Software": "subtense"})
    return file.getvalue()
