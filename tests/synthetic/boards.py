"""Pictures of a board by a camera whose numbers are exactly known, as points with noise; no pixels are drawn."""

from __future__ import annotations

import numpy as np

from subtense.board import Board, BoardView
from subtense.camera import Camera
from subtense.geometry import rotation_from_vector

CHESSBOARD = Board("chessboard", 10, 7, 0.030, relative_u=0.001, source="measured on the print")
"""9 x 6 inner corners, 240 x 150 mm."""
SIZE_PX = (1600, 1200)
NOISE_PX = 0.3
USUAL = (-0.2, 0.08, 0.0008, -0.0005, -0.02)
"""Brown-Conrady coefficients of an ordinary lens."""


def true_intrinsics(distortion=USUAL, f_px=1200.0, size_px=SIZE_PX):
    """(f, aspect, cx, cy, distortion...), the middle a few pixels off the picture's."""
    return np.array([f_px, 1.0, size_px[0] / 2 + 5.3, size_px[1] / 2 - 7.1, *distortion])


def scene(rng, lens="brown_conrady", intrinsics=None, *, board=CHESSBOARD, size_px=SIZE_PX, views=20, noise_px=NOISE_PX,
          tilt_deg=(0, 45), depth_m=(0.35, 0.9), spread=(0.2, 0.8), warp_m=(0.0, 0.0), told=None):  # fmt: skip
    """Views of a board held at random within limits.

    Args:
        lens: key of LENSES.
        intrinsics: true ones; USUAL's camera if None.
        tilt_deg: limits of the tilt of the board, about an axis of any direction.
        depth_m: limits of its depth.
        spread: where its middle is seen, as shares of the picture.
        warp_m: how far its middle bulges, along its width and its height.
        told: the sigma the views carry; the noise itself if None.
    """
    theta = true_intrinsics() if intrinsics is None else np.asarray(intrinsics, float)
    points = board.points_m - board.points_m.mean(0)  # a copy
    half = np.ptp(points, axis=0)[:2] / 2
    points[:, 2] = (1 - (points[:, :2] / half) ** 2) @ np.asarray(warp_m)
    camera = Camera(*size_px, theta[0], theta[2], theta[3], theta[1], lens, theta[4:])
    found = []
    while len(found) < views:
        seen = camera.project(points @ _turned(rng, tilt_deg).T + _place(rng, theta, size_px, depth_m, spread))
        if np.isfinite(seen).all() and (seen > 0).all() and (seen < np.array(size_px) - 1).all():
            noisy = seen + rng.normal(0, noise_px, seen.shape)
            name = f"shot{len(found):02d}.jpg"
            found.append(BoardView(name, *size_px, np.arange(len(seen)), noisy, told or noise_px))
    return found


def _turned(rng, tilt_deg):
    about, tilt = rng.uniform(0, 2 * np.pi), np.radians(rng.uniform(*tilt_deg))
    roll = rotation_from_vector(np.array([0, 0, rng.uniform(-0.5, 0.5)]))
    return rotation_from_vector(np.array([np.cos(about), np.sin(about), 0]) * tilt) @ roll


def _place(rng, theta, size_px, depth_m, spread):
    depth = rng.uniform(*depth_m)
    seen = rng.uniform(spread[0], spread[1], 2) * size_px
    return np.array([*(seen - theta[2:4]) / theta[0] * depth, depth])
