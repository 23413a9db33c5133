"""Terrain: heights of the ground over a map, from a GeoTIFF, and where a line of sight meets them.

Coordinates are those of the file's projected coordinate system, in metres: x to the east, y to the north. Heights count from a named
vertical datum; heights of two datums differ by up to 100 m and are never mixed. Cells are points in their middle, with a plane
stretched between four of them (bilinear).

Source: OGC GeoTIFF 1.1 (cells, georeference, vertical systems).
"""

from __future__ import annotations

import math
import re
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from .arrays import Array
from .errors import FileFormatError, InputError, MissingExtraError
from .horizon import effective_radius_m

MOST_CELLS = 25_000_000
"""Of the part that is read."""
WITHIN_M = 5000.0
"""How far around the camera the model is read."""
MOST_STEPS = 40_000
"""Of a line of sight, half a cell each or more."""


@dataclass(frozen=True, eq=False)
class Terrain:
    """Heights over a map.

    Attributes:
        heights_m: (rows, columns), from north to south; NaN where there are none.
        to_map: a, b, c, d, e, f: x = a column + b row + c and y = d column + e row + f, of a cell's middle.
        sigma_m: standard deviation of a height.
        datum: what the heights count from.
        source: the file's name.
    """

    heights_m: Array
    to_map: tuple[float, float, float, float, float, float]
    sigma_m: float
    datum: str
    source: str

    @property
    def cell_m(self) -> float:
        """The side of a cell."""
        a, b, _, d, e, _ = self.to_map
        return math.sqrt(abs(a * e - b * d))

    def height_m(self, x_m: Array, y_m: Array) -> Array:
        """(...) heights at places of the map; NaN outside, and where a neighbour has none."""
        a, b, c, d, e, f = self.to_map
        det = a * e - b * d
        dx, dy = np.asarray(x_m, float) - c, np.asarray(y_m, float) - f
        column, row = (e * dx - b * dy) / det, (a * dy - d * dx) / det
        rows, columns = self.heights_m.shape
        inside = (column >= 0) & (row >= 0) & (column <= columns - 1) & (row <= rows - 1)
        i = np.clip(np.floor(np.nan_to_num(row)).astype(int), 0, max(rows - 2, 0))
        j = np.clip(np.floor(np.nan_to_num(column)).astype(int), 0, max(columns - 2, 0))
        u, v = column - j, row - i
        h = self.heights_m
        low, high = min(1, rows - 1), min(1, columns - 1)
        value = (1 - v) * ((1 - u) * h[i, j] + u * h[i, j + high]) + v * (
            (1 - u) * h[i + low, j] + u * h[i + low, j + high]
        )
        return np.asarray(np.where(inside, value, np.nan))

    def plane(self, x_m: float, y_m: float, radius_m: float) -> tuple[float, float, float, float]:
        """Height, slope to the east and to the north, and the rms distance of the terrain from that plane, around a place."""
        radius = max(radius_m, 1.5 * self.cell_m)
        steps = np.linspace(-1.0, 1.0, 9)
        east, north = (grid.ravel() * radius for grid in np.meshgrid(steps, steps))
        keep = np.hypot(east, north) <= radius * 1.001
        east, north = east[keep], north[keep]
        heights = self.height_m(x_m + east, y_m + north)
        fine = np.isfinite(heights)
        if fine.sum() < 6:
            return math.nan, math.nan, math.nan, math.nan
        design = np.stack([np.ones(fine.sum()), east[fine], north[fine]], -1)
        (height, slope_x, slope_y), *_ = np.linalg.lstsq(design, heights[fine], rcond=None)
        rest = heights[fine] - design @ np.array([height, slope_x, slope_y])
        return float(height), float(slope_x), float(slope_y), float(np.sqrt(np.mean(rest**2)))

    def meet(self, place_m: Array, way: Array, refraction: float) -> float:
        """How far along a unit direction from a place (east, north, up) the terrain is met first; NaN where it is not.

        The earth's curvature lowers the terrain below the level through the place.
        """
        level = max(float(np.hypot(way[0], way[1])), 1e-9)
        rows, columns = self.heights_m.shape
        reach = math.hypot(rows, columns) * self.cell_m / level
        below = float(place_m[2]) - float(np.nanmin(self.heights_m))
        if way[2] < 0:
            reach = min(reach, (below + self.cell_m) / -way[2] * 1.01)
        count = int(min(max(reach * level / (self.cell_m / 2), 200), MOST_STEPS))
        t = np.linspace(0.0, reach, count + 1)
        gap = self._gap(place_m, way, t, refraction)
        under = np.flatnonzero(gap <= 0)
        if not len(under) or under[0] == 0 or not np.isfinite(gap[: under[0]]).all():
            return math.nan
        near, far = t[under[0] - 1], t[under[0]]
        for _ in range(40):
            middle = (near + far) / 2
            near, far = (
                (near, middle) if self._gap(place_m, way, np.array([middle]), refraction)[0] <= 0 else (middle, far)
            )
        return float((near + far) / 2)

    def _gap(self, place_m: Array, way: Array, t: Array, refraction: float) -> Array:
        """Height of a line of sight above the terrain."""
        drop = (t * np.hypot(way[0], way[1])) ** 2 / (2 * effective_radius_m(np.asarray(refraction)))
        ground = self.height_m(place_m[0] + t * way[0], place_m[1] + t * way[1]) - drop
        return np.asarray(place_m[2] + t * way[2] - ground)


def load_terrain(path: Path, around_m: tuple[float, float], sigma_m: float, datum: str | None = None) -> Terrain:
    """The part of a GeoTIFF around a place.

    Args:
        path: the file.
        around_m: x and y of the place.
        sigma_m: standard deviation of its heights.
        datum: what they count from, where the file does not say.

    Raises:
        FileFormatError: no GeoTIFF, no georeference, degrees, feet, or nothing around the place.
        InputError: no vertical datum, or another than the file's.
        MissingExtraError: rasterio is not installed.
    """
    path = Path(path)
    if not path.is_file():
        raise FileFormatError(path, "no such file")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of a file without georeference, and of what rasterio itself imports
        try:
            import rasterio
            from rasterio.errors import RasterioError
        except ImportError:
            raise MissingExtraError("a terrain model", "terrain") from None
        try:
            with rasterio.open(path, driver="GTiff") as opened:
                return _read(opened, path, around_m, sigma_m, datum)
        except (FileFormatError, InputError):
            raise
        except (RasterioError, OSError, ValueError, MemoryError):
            raise FileFormatError(path, "is no GeoTIFF that can be read") from None


def _read(opened: Any, path: Path, around_m: tuple[float, float], sigma_m: float, datum: str | None) -> Terrain:
    """The window around the place, checked."""
    shift = opened.transform
    if opened.crs is None or shift.is_identity:
        raise FileFormatError(
            path, "has no georeference: neither coordinate system nor place; give a GeoTIFF that has both"
        )
    if not opened.crs.is_projected or abs(opened.crs.linear_units_factor[1] - 1) > 1e-9:
        raise FileFormatError(path, f"has coordinates in {opened.crs.linear_units if opened.crs.is_projected else 'degrees'}; "
                              "reproject it to a system in metres (UTM, say) with gdalwarp -t_srs")  # fmt: skip
    named = _datum(opened.crs.to_wkt(), datum)
    column, row = _cell(shift, *around_m)
    half = WITHIN_M / math.sqrt(abs(shift.a * shift.e - shift.b * shift.d))
    left, right = (int(np.clip(column + sign * half, 0, opened.width)) for sign in (-1, 1))
    top, bottom = (int(np.clip(row + sign * half, 0, opened.height)) for sign in (-1, 1))
    if right - left < 2 or bottom - top < 2:
        raise FileFormatError(
            path, f"has no terrain around {around_m[0]:.0f}, {around_m[1]:.0f}; is the position in its coordinates?"
        )
    if (right - left) * (bottom - top) > MOST_CELLS:
        raise FileFormatError(
            path, f"has more than {MOST_CELLS // 10**6} million cells around the camera; resample it to larger ones"
        )
    from rasterio.windows import Window

    band = opened.read(1, window=Window(left, top, right - left, bottom - top), masked=True)
    heights = np.asarray(band.astype(float).filled(np.nan), float)
    heights[(abs(heights) > 12_000) | ~np.isfinite(heights)] = np.nan  # no height on earth
    x, y = (p * (left + 0.5) + q * (top + 0.5) + r for p, q, r in (shift[:3], shift[3:6]))
    return Terrain(heights, (shift.a, shift.b, x, shift.d, shift.e, y), sigma_m, named, path.name)


def _cell(shift: Any, x_m: float, y_m: float) -> tuple[float, float]:
    """Column and row of a place, by the file's affine transform of cell corners."""
    a, b, c, d, e, f = shift[:6]
    det = a * e - b * d
    return (e * (x_m - c) - b * (y_m - f)) / det, (a * (y_m - f) - d * (x_m - c)) / det


def _datum(wkt: str, stated: str | None) -> str:
    """The vertical datum: the file's, else the stated one."""
    found = re.search(r'VERT_CS\["([^"]+)"|VERTCRS\["([^"]+)"', wkt)
    named = next((part for part in found.groups() if part), None) if found else None
    if named is None and not stated:
        raise InputError(
            "--terrain-datum",
            None,
            "the terrain file names no vertical datum; say what its heights count from, as EGM2008",
        )
    if named and stated and not same_datum(named, stated):
        raise InputError("--terrain-datum", stated, f"the file says {named}")
    return named or str(stated)


def same_datum(one: str, other: str) -> bool:
    """Whether two names are of one vertical datum: their words without "height", and whatever is in brackets."""
    short = [_plain(name) for name in (one, other)]
    return bool(short[0]) and short[0] == short[1]


def _plain(name: str) -> str:
    words = re.sub(r"\([^)]*\)|\bheights?\b|\bdepth\b", " ", name.lower())
    return re.sub(r"[^a-z0-9]", "", words)
