"""Calibrating from 30 pictures of 12 megapixels, against OpenCV's plain loop on the same pictures."""

from __future__ import annotations

import tempfile
from pathlib import Path

import cv2
import numpy as np
from comparison import Comparison, compare, table

from subtense.board import Board
from subtense.geometry import Pose, rotation_from_vector
from subtense.workflow.calibrate import calibrate

BOARD = Board("chessboard", 10, 7, 0.025)
SIZE_PX = (4032, 3024)
MATRIX = np.array([[3100.0, 0, 2015.5], [0, 3100.0, 1511.5], [0, 0, 1]])
PICTURES = 30
TARGET = 0.6
"""Aim on two cores."""


def comparisons(turns: int = 3) -> list[Comparison]:
    """Everything from the files to the camera; ours chooses the lens model, checks it, and gives the covariance besides."""
    with tempfile.TemporaryDirectory() as folder:
        paths = write_pictures(Path(folder))
        return [compare(f"calibrate(), {PICTURES} pictures of 12 MP", lambda: calibrate(paths, BOARD), "cv2, plain loop",
                        lambda: plain_loop(paths), turns=turns, target=TARGET)]  # fmt: skip


def plain_loop(paths: list[Path]) -> float:
    """As the tutorials have it: read, find, refine, calibrate."""
    board = BOARD.points_m.astype(np.float32)
    seen = []
    for path in paths:
        gray = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
        ok, corners = cv2.findChessboardCorners(gray, (9, 6))
        assert ok, path.name
        criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 30, 0.001)
        seen.append(cv2.cornerSubPix(gray, corners, (11, 11), (-1, -1), criteria))
    return float(cv2.calibrateCamera([board] * len(seen), seen, SIZE_PX, None, None)[0])


def write_pictures(folder: Path) -> list[Path]:
    """Boards held in 30 ways, with a little blur and noise, as JPEG."""
    rng = np.random.default_rng(0)
    pattern, scale = _pattern()
    paths = []
    for i in range(PICTURES):
        pose = _held(rng)
        to_picture = MATRIX @ np.column_stack([pose.rotation[:, :2], pose.translation_m]) @ scale
        picture = cv2.warpPerspective(pattern, to_picture, SIZE_PX, flags=cv2.INTER_AREA, borderValue=200)
        picture = cv2.GaussianBlur(picture, (0, 0), 1.2) + rng.normal(0, 2, picture.shape)
        paths.append(folder / f"shot{i:02d}.jpg")
        cv2.imwrite(str(paths[-1]), np.clip(picture, 0, 255).astype(np.uint8), [cv2.IMWRITE_JPEG_QUALITY, 92])
    return paths


def _pattern() -> tuple[np.ndarray, np.ndarray]:
    """The board at 8 px a millimetre with a margin of a square, and the board's metres from its pixels."""
    side = 200
    rows, columns = np.indices(((BOARD.rows + 2) * side, (BOARD.columns + 2) * side)) // side - 1
    inside = (rows >= 0) & (rows < BOARD.rows) & (columns >= 0) & (columns < BOARD.columns)
    pattern = np.where(inside & ((rows + columns) % 2 == 0), 25, 225).astype(np.uint8)
    metre = BOARD.square_m / side
    return pattern, np.array(
        [[metre, 0, -2 * BOARD.square_m + metre / 2], [0, metre, -2 * BOARD.square_m + metre / 2], [0, 0, 1]]
    )


def _held(rng: np.random.Generator) -> Pose:
    """The board wholly in the picture."""
    while True:
        turn = np.array([*rng.uniform(-0.6, 0.6, 2), rng.uniform(-0.3, 0.3)])
        rotation = rotation_from_vector(turn)
        depth = rng.uniform(0.3, 0.55)
        middle = np.array([*rng.uniform(-0.12, 0.12, 2), depth])
        pose = Pose(rotation, middle - rotation @ BOARD.points_m.mean(0))
        corners = pose.apply(np.array([[-0.05, -0.05, 0], [0.25, -0.05, 0], [-0.05, 0.175, 0], [0.25, 0.175, 0]]))
        pixels = corners @ MATRIX.T
        pixels = pixels[:, :2] / pixels[:, 2:]
        if (pixels > 0).all() and (pixels < SIZE_PX).all():
            return pose


if __name__ == "__main__":
    print(table(comparisons()))
