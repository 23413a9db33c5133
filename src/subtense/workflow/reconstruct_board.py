"""A calibration board in the pictures of a scene, as a thing of known size."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from ..board import Board, BoardView
from ..detectors.boards import board_view
from ..errors import InputError, NothingFoundError
from ..observation import Observation
from ..photo import Photo
from ..quantity import Quantity
from ..scale import Known
from ..scene import Scene
from ..views import Track
from .calibrate_input import board_of

MOST_POINTS = 16
"""Of a board: the farthest apart tell the scale, and more of them cost time alone."""


def read_board(text: str) -> Board:
    """A board from `charuco, 8x6, 25 mm, 18 mm, 4x4_50` or `chessboard, 9x6, 25 ± 0.05 mm`.

    Raises:
        InputError: something missing or impossible.
    """
    words = [word.strip() for word in text.split(",")]
    if not 3 <= len(words) <= 5:
        raise InputError("--board", text, "give kind, squares, side and, of a board with markers, their side and dictionary, as "
                         "'charuco, 8x6, 25 mm, 18 mm, 4x4_50'")  # fmt: skip
    return board_of(*words)


def known_board(scene: Scene, photos: Mapping[str, Path], board: Board) -> Known:
    """The board as tracks of its points.

    Args:
        scene: whose pictures are searched.
        photos: the file of each picture.
        board: in two pictures or more.

    Raises:
        NothingFoundError: fewer than two pictures show three points of it in common.
    """
    views = {}
    for name in scene.names:
        try:
            views[name] = board_view(Photo.load(photos[name]), board)
        except NothingFoundError:
            continue
    shown = {name: {int(k): i for i, k in enumerate(view.ids)} for name, view in views.items()}
    often = [k for k in range(len(board.points_m)) if sum(k in ids for ids in shown.values()) >= 2]
    if len(often) < 3:
        raise NothingFoundError(f"no {board.text} was found in two pictures of the scene", found=len(views), needed=2)
    picked = _far_apart(board.points_m[often], often)
    tracks = tuple(_track(k, {name: ids[k] for name, ids in shown.items() if k in ids}, views) for k in picked)
    length = Quantity(1.0, board.relative_u, "1", source=board.source)
    return Known("shape", length, tracks, places_m=board.points_m[picked], label=board.text)


def _track(point: int, rows: Mapping[str, int], views: Mapping[str, BoardView]) -> Track:
    """One point of the board in the pictures that show it, by its row in each."""
    points = np.array([views[name].points_px[i] for name, i in rows.items()])
    sigma = np.array([float(views[name].sigma_px[i]) for name, i in rows.items()])
    seen = Observation(points, cov=np.diag(np.repeat(sigma, 2) ** 2), label=f"board, point {point}", source="board")
    return Track(tuple(rows), seen)


def _far_apart(places: np.ndarray, names: list[int]) -> list[int]:
    """Points that are far from each other, the outermost first."""
    picked = [int(np.argmax(np.linalg.norm(places - places.mean(axis=0), axis=1)))]
    while len(picked) < min(MOST_POINTS, len(names)):
        near = np.min(np.linalg.norm(places[:, None] - places[picked], axis=-1), axis=1)
        picked.append(int(np.argmax(near)))
    return [names[i] for i in picked]
