"""Pictures of a chessboard by a camera whose numbers are exactly known: rays through the lens, light averaged over pixels."""

from __future__ import annotations

from functools import cache

import numpy as np
from PIL import Image

from subtense.board import Board
from subtense.camera import Camera
from subtense.geometry import Pose, rotation_from_vector

BOARD = Board("chessboard", 10, 7, 0.025)
CAMERA = Camera(640, 480, 620.0, 324.1, 236.2, 1.0, "brown_conrady", np.array([-0.12, 0.03, 0.0, 0.0, 0.0]))
POSES = tuple(
    (np.radians([about_x, about_y, roll]), (x, y), depth)
    for about_x, about_y, roll, x, y, depth in (
        (0, 35, 3, -0.03, 0.0, 0.42), (0, -35, -4, 0.03, 0.01, 0.42), (35, 0, 2, 0.0, -0.03, 0.45), (-35, 0, -2, 0.01, 0.03, 0.40),
        (25, 25, 8, -0.06, -0.04, 0.52), (-25, 25, -8, 0.06, -0.03, 0.50), (25, -25, 5, -0.05, 0.04, 0.48),
        (-20, -25, -6, 0.07, 0.05, 0.60), (10, 5, 0, 0.0, 0.0, 0.36), (-5, 10, 90, 0.02, 0.0, 0.66),
    )
)  # fmt: skip
"""Turns of the board, where its middle stands (m), and its depth (m)."""


def camera_from_board(turn_rad, middle_m, depth_m, board=BOARD):
    """The board's pose, its middle at a place."""
    rotation = rotation_from_vector(np.asarray(turn_rad, float))
    return Pose(rotation, np.array([*middle_m, depth_m]) - rotation @ board.points_m.mean(0))


@cache
def directions(camera, samples):
    """(N, 3) of all samples of the picture."""
    rows, columns = np.indices((camera.height_px * samples, camera.width_px * samples))
    return camera.rays((np.stack([columns, rows], -1).reshape(-1, 2) + 0.5) / samples - 0.5)


def draw(camera, pose, board=BOARD, samples=2):
    """(height, width, 3) uint8: the board on a light wall, sRGB."""
    rays = directions(camera, samples)
    normal = pose.rotation[:, 2]
    along = (pose.translation_m @ normal) / (rays @ normal)
    place = (rays * along[:, None] - pose.translation_m) @ pose.rotation[:, :2] / board.square_m + 1
    square = np.floor(place).astype(int)
    inside = (place > 0).all(1) & (place < [board.columns, board.rows]).all(1)
    light = np.where(inside & (square.sum(1) % 2 == 0), 0.03, 0.8)
    light = light.reshape(camera.height_px, samples, camera.width_px, samples).mean((1, 3))
    encoded = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    return np.repeat(np.round(255 * encoded).astype(np.uint8)[..., None], 3, axis=2)


def write(folder, camera=CAMERA, move=None):
    """Pictures shot00.png, shot01.png, ... in a folder; `move` is camera_from_first of a second camera."""
    paths = []
    for i, pose in enumerate(POSES):
        first = camera_from_board(*pose)
        if move is not None:
            first = Pose(move.rotation @ first.rotation, move.rotation @ first.translation_m + move.translation_m)
        paths.append(folder / f"shot{i:02d}.png")
        Image.fromarray(draw(camera, first)).save(paths[-1])
    return paths
