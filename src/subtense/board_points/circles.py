"""Asymmetric grids of circles: dark discs on a light ground, every second row half a step to the right.

A disc's centre is the centroid of its darkness in linear light, over a ground that is a plane. The centroid of a disc seen
obliquely is not where its centre is seen: perspective shifts it by up to several pixels. The shift is taken out with the
board's own fit, through which each disc is projected as a polygon; the discs' radius is measured in the picture.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from ..arrays import Array, Pixels
from ..board import Board
from ..subpixel import CURVE
from .gray import TWO_STEPS, Reduced, reduced, steps
from .lattice import Lattice, fit
from .seen import Missing, Seen, fitted, grid_of

REACH = 0.68
"""How far around a centre the picture is looked at, in steps; the next disc's centre is 1.41 away."""
BEYOND, BLUR_PX = 1.3, 3.0
"""Reach once the radius is known: so many radii and pixels; there may be print beside the outer discs."""
SMALLEST, LARGEST = 0.08, 0.62
"""Radii in steps that can be measured."""
SHARES = (1.0, 1.3, 2.0)
"""How many spots are looked through, over the discs of the board."""
SHIFT_DOUBT = 0.05
"""Relative doubt of the perspective's shift: the radius, and the lens within a disc."""
LEAST_SHARE = 0.7
"""Share of the discs that must be seen."""
WORST_FIT = 0.15
"""Rms residual over a step beyond which it is no board."""
_ANGLES = np.linspace(0, 2 * np.pi, 72, endpoint=False)


def circles(gray: Pixels, board: Board) -> Seen | Missing:
    """The discs' centres, as the perspective shows them."""
    found = 0
    for small in steps(gray, TWO_STEPS):
        for centres in _detected(small, board):
            seen = _located(gray, board, small.full(centres))
            if seen is not None:
                return seen
            found = max(found, len(centres))
    return _instead(gray, board, found)


def _instead(gray: Pixels, board: Board, found: int) -> Missing:
    """Whether columns and rows are exchanged."""
    turned = replace(board, columns=board.rows, rows=board.columns)
    small = reduced(gray)
    for centres in _detected(small, turned):
        if _located(gray, turned, small.full(centres)) is not None:
            return Missing(found, f"columns and rows are exchanged; give --squares {turned.columns}x{turned.rows}")
    return Missing(found)


def _detected(small: Reduced, board: Board) -> Iterator[Array]:
    """Grids among the dark spots that stand out most: a search through all spots of a lively background takes minutes."""
    import cv2

    size = (board.columns, board.rows)
    spots = _spots(small.pixels)
    for share in SHARES:
        most = round(share * board.columns * board.rows)
        picture = _drawn(spots[:most], small.pixels.shape)
        for flags in (cv2.CALIB_CB_ASYMMETRIC_GRID, cv2.CALIB_CB_ASYMMETRIC_GRID | cv2.CALIB_CB_CLUSTERING):
            found, centres = cv2.findCirclesGrid(picture, size, flags=flags, blobDetector=_blobs(picture, 0.6))
            if found:
                yield np.reshape(centres, (-1, 2)).astype(float)
        if most >= len(spots):
            break


def _spots(gray: Pixels) -> Array:
    """(n, 3) x, y, radius of dark spots, the one that stands out most from what is around it first."""
    found = [(*point.pt, point.size / 2) for point in _blobs(gray, 0.9).detect(gray)]
    spots = np.array(found, float).reshape(-1, 3)
    around = spots[:, None, :2] + 1.5 * spots[:, None, 2:] * np.column_stack([np.cos(_ANGLES), np.sin(_ANGLES)])
    around = np.clip(np.rint(around), 0, np.array(gray.shape[::-1]) - 1).astype(int)
    at = np.clip(np.rint(spots[:, :2]), 0, np.array(gray.shape[::-1]) - 1).astype(int)
    ring = np.percentile(gray[around[..., 1], around[..., 0]], 30, axis=1) if len(spots) else np.zeros(0)
    return spots[np.argsort(gray[at[:, 1], at[:, 0]] - ring)]


def _drawn(spots: Array, shape: tuple[int, ...]) -> Pixels:
    """A clean picture of spots, to look for the grid in."""
    import cv2

    picture = np.full(shape, 255, np.uint8)
    for x, y, radius in spots:
        centre = (round(x * 256), round(y * 256))
        cv2.circle(picture, centre, round(max(0.6 * radius, 2.5) * 256), 0, -1, cv2.LINE_AA, 8)
    return picture


def _blobs(gray: Pixels, convexity: float) -> Any:
    """A detector of dark spots from 5 px across to a tenth of the picture."""
    import cv2

    parameters = cv2.SimpleBlobDetector.Params()
    parameters.minArea, parameters.maxArea = 16.0, max(gray.size / 100, 32.0)
    parameters.minThreshold, parameters.maxThreshold = 20.0, 240.0
    parameters.minDistBetweenBlobs = 5.0
    parameters.minInertiaRatio = 0.05  # a disc seen at 70 degrees is three times as long as wide
    parameters.minConvexity = convexity
    return cv2.SimpleBlobDetector.create(parameters)


def _located(gray: Pixels, board: Board, centres: Array) -> Seen | None:
    height, width = gray.shape
    grid = grid_of(board)
    ordered = _ordered(board, centres, (width, height))
    if ordered is None:
        return None
    lattice, points = ordered
    shift, measured, reach = np.zeros_like(grid), points, REACH
    for _ in range(3):  # where the discs are tells their shift, and the shift where they are
        measured, radii = _centroids(gray, lattice, grid, reach)
        there = np.isfinite(measured).all(axis=1)
        radius = float(np.median(radii[there])) if there.any() else 0.0
        if not SMALLEST < radius < LARGEST or there.sum() < LEAST_SHARE * len(grid):
            return None
        step_px = float(np.sqrt(abs(np.linalg.det(lattice.jacobian(grid.mean(axis=0)[None], 1.0)[0]))))
        reach = min(REACH, BEYOND * radius + BLUR_PX / step_px)
        shift = _shifts(lattice, grid, radius)
        again = fit(grid[there], (measured - shift)[there], width, height)
        if again is None:
            return None
        lattice = again
    found = fitted(board, np.arange(len(grid)), measured - shift, (width, height), "circles")
    if found is None or len(found[1].ids) < LEAST_SHARE * len(grid):
        return None
    seen = found[1]
    doubt = SHIFT_DOUBT * np.hypot(*shift[seen.ids].T)
    return Seen(seen.ids, seen.points_px, np.hypot(seen.sigma_px, doubt), seen.source)


def _ordered(board: Board, centres: Array, size_px: tuple[int, int]) -> tuple[Lattice, Array] | None:
    """The centres in the board's order, not mirrored; an even number of rows leaves a half turn, which the picture settles."""
    grid = grid_of(board)
    rows = centres.reshape(board.rows, board.columns, 2)
    best: tuple[float, Lattice, Array] | None = None
    for turned in (rows, rows[::-1, ::-1], rows[::-1], rows[:, ::-1]):
        points = turned.reshape(-1, 2)
        lattice = fit(grid, points, *size_px)
        if lattice is None:
            continue
        jac = lattice.jacobian(grid.mean(axis=0)[None], 1.0)[0]
        side_px = np.sqrt(abs(np.linalg.det(jac)))
        if np.linalg.det(jac) <= 0 or lattice.rms_px > WORST_FIT * side_px:
            continue
        upright = float(jac[0, 0] + jac[1, 1])
        if best is None or upright > best[0]:
            best = upright, lattice, points
    return None if best is None else best[1:]


def _centroids(gray: Pixels, lattice: Lattice, grid: Array, reach: float) -> tuple[Array, Array]:
    """(N, 2) centroids of darkness near each board point, NaN where there is no disc, and (N,) radii in steps."""
    centres, jacobians = lattice.project(grid), lattice.jacobian(grid, reach)
    found = [_centroid(gray, c, j, reach) for c, j in zip(centres, jacobians, strict=True)]
    return np.array([f[:2] for f in found]), np.array([f[2] for f in found])


def _centroid(gray: Pixels, centre: Array, jac: Array, reach: float) -> tuple[float, float, float]:
    nothing = (np.nan, np.nan, np.nan)
    reach_px = reach * np.hypot(jac[:, 0], jac[:, 1])
    low, high = np.floor(centre - reach_px).astype(int), np.ceil(centre + reach_px).astype(int) + 1
    if np.any(low < 0) or np.any(high > gray.shape[::-1]) or np.linalg.det(jac) == 0:
        return nothing
    y, x = np.mgrid[low[1] : high[1], low[0] : high[0]]
    away = np.stack([x - centre[0], y - centre[1]], axis=-1)
    distance = np.hypot(*np.moveaxis(away @ np.linalg.inv(jac).T, -1, 0))
    light = (gray[low[1] : high[1], low[0] : high[0]] / 255.0) ** CURVE
    rim, core = (distance > 0.88 * reach) & (distance < reach), distance < 0.1
    if rim.sum() < 12 or not core.any():
        return nothing
    plane = np.linalg.lstsq(np.column_stack([away[rim], np.ones(rim.sum())]), light[rim], rcond=None)[0]
    ground = away @ plane[:2] + plane[2]
    depth = float(np.mean((ground - light)[core]))
    if not depth > 0.02:
        return nothing
    dark = np.where(distance < reach, (ground - light) / depth, 0.0)
    area = float(dark.sum())
    if area <= 0:
        return nothing
    dx, dy = (float((dark * away[..., i]).sum() / area) for i in (0, 1))
    return float(centre[0]) + dx, float(centre[1]) + dy, float(np.sqrt(area / np.pi / abs(np.linalg.det(jac))))


def _shifts(lattice: Lattice, grid: Array, radius: float) -> Array:
    """(N, 2) centroid of each disc's picture less the picture of its centre."""
    around = radius * np.column_stack([np.cos(_ANGLES), np.sin(_ANGLES)])
    centres = lattice.project(grid)
    p = lattice.project(grid[:, None] + around) - centres[:, None]
    q = np.roll(p, -1, axis=1)
    cross = p[..., 0] * q[..., 1] - p[..., 1] * q[..., 0]
    return np.asarray(((p + q) * cross[..., None]).sum(axis=1) / 3 / cross.sum(axis=1)[:, None])
