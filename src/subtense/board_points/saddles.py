"""Saddles, where two black squares touch at a corner, to a fraction of a pixel.

At a saddle the light is the same on opposite sides. What blur, the pixels' extent and the transfer curve do to one side
they do to the other, so a saddle stays in place where an edge would move (`subpixel`): rendered in linear light, blurred by
0.5 to 2.5 px, and encoded, corners are off by less than 0.005 px on average. The corner is where the gradients all around
point past it; it is exact as far as the window holds nothing but the saddle, so the window is as large as the squares
leave room for and no larger.

Source: the gradient condition of W. Förstner and E. Gülch, A fast operator for detection and precise location of distinct
points (1987), as in OpenCV's cornerSubPix.
"""

from __future__ import annotations

import numpy as np

from ..arrays import Array, Indices, Pixels
from .lattice import Lattice

SMALLEST_PX, LARGEST_PX = 2, 25
"""Least and greatest half side of a window."""


def windows_px(lattice: Lattice, board: Array, free: float) -> Indices:
    """(N,) half sides of the windows around board points, whole pixels.

    Args:
        lattice: where the board is.
        board: (N, 2) points, in the lattice's unit.
        free: how far from a saddle, across either of its edges, nothing else is seen; same unit.
    """
    jac = lattice.jacobian(board, free)
    area = abs(np.linalg.det(jac))
    half = np.full(len(board), float(LARGEST_PX))
    for axis in (0, 1):  # the lines beside the saddle that run along x, then along y
        along = jac[:, :, axis]
        length = np.maximum(np.hypot(along[:, 0], along[:, 1]), 1e-9)
        apart = free * area / length
        reach = abs(along).sum(axis=1) / length  # of the window's corner towards that line, per half side
        half = np.minimum(half, (apart - 1.0) / reach)
    return np.asarray(np.clip(np.floor(half), SMALLEST_PX, LARGEST_PX), int)


def refined(gray: Pixels, points_px: Array, half_px: Indices) -> Array:
    """(N, 2) saddles near the given points, each in its own window; NaN where there is none in the window."""
    import cv2

    out = np.full((len(points_px), 2), np.nan)
    height, width = gray.shape
    border = np.minimum(points_px, np.array([width - 1, height - 1]) - points_px).min(axis=1)
    half_px = np.minimum(half_px, np.floor(border).astype(int) - 1)  # what is made up beyond the border pulls
    inside = half_px >= SMALLEST_PX
    ending = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 60, 1e-3)
    for half in np.unique(half_px[inside]):
        these = inside & (half_px == half)
        start = np.ascontiguousarray(points_px[these], np.float32).reshape(-1, 1, 2)
        side = int(half)
        out[these] = cv2.cornerSubPix(gray, start.copy(), (side, side), (-1, -1), ending).reshape(-1, 2)
    moved = np.abs(out - points_px).max(axis=1)
    out[~(moved < np.maximum(half_px, 1.5))] = np.nan
    return out
