"""ChArUco boards: inner corners named by the markers around them, so a part of the board will do.

OpenCV reads the markers and places the corners; the corners are then located as saddles in windows that keep clear of the
markers. OpenCV before 4.6 began boards of an even number of rows with a white square; such a board is only found as the one
or the other.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ..arrays import Array, Indices, Pixels
from ..board import Board
from ..errors import InputError
from .dictionaries import NAMES, dictionary, dictionary_name, size_of
from .gray import Reduced, reduced, steps
from .lattice import FEWEST, fit
from .saddles import refined, windows_px
from .seen import Missing, Seen, fitted, grid_of

MANY = 0.75
"""Share of the corners in the reduced picture that makes a search of the full one needless."""
FEWEST_MARKERS = 4
"""Markers from which it is worth asking what is wrong with them."""
LEAST_FREE = 0.1
"""Reach of a window in squares where the markers leave less."""
BIGGEST = (
    "4x4_1000",
    "5x5_1000",
    "6x6_1000",
    "7x7_1000",
    "36h11",
    "aruco_original",
    "aruco_mip_36h12",
    "25h9",
    "36h10",
    "16h5",
)


def charuco(gray: Pixels, board: Board) -> Seen | Missing:
    """The inner corners of a ChArUco board that are seen.

    Raises:
        InputError: the dictionary has too few markers.
    """
    needed = board.columns * board.rows // 2
    if size_of(board.dictionary) < needed:
        raise InputError("--dictionary", board.dictionary, f"it has {size_of(board.dictionary)} markers and the board "
                         f"needs {needed}; give a larger one")  # fmt: skip
    best: Seen | None = None
    most_markers = 0
    for small in steps(gray):
        corners, ids, markers = _detected(small.pixels, board)
        most_markers = max(most_markers, len(markers))
        seen = _fitted(gray, board, small.full(corners), ids)
        if seen is not None and (best is None or len(seen.ids) > len(best.ids)):
            best = seen
        if best is not None and len(best.ids) >= MANY * len(board.points_m):
            break
    return best if best is not None else _instead(gray, board, most_markers)


def opencv_board(board: Board) -> Any:
    """OpenCV's board, in squares."""
    import cv2

    made = cv2.aruco.CharucoBoard(
        (board.columns, board.rows), 1.0, board.marker_m / board.square_m, dictionary(board.dictionary)
    )
    made.setLegacyPattern(board.legacy)
    return made


def _detected(gray: Pixels, board: Board) -> tuple[Array, Indices, Indices]:
    """Corners (n, 2), their ids, and the markers' numbers."""
    import cv2

    detector = cv2.aruco.CharucoDetector(opencv_board(board))
    parameters = detector.getDetectorParameters()
    parameters.minMarkerPerimeterRate = 0.01  # of the longest side: small boards in large pictures
    detector.setDetectorParameters(parameters)
    corners, ids, _, markers = detector.detectBoard(gray)
    numbers = np.zeros(0, int) if markers is None else np.asarray(np.reshape(markers, -1), int)
    if ids is None:
        return np.zeros((0, 2)), np.zeros(0, int), numbers
    return np.reshape(corners, (-1, 2)).astype(float), np.reshape(ids, -1).astype(int), numbers


def _fitted(gray: Pixels, board: Board, corners: Array, ids: Indices) -> Seen | None:
    """The corners refined, without strays; None where they are too few to be believed."""
    height, width = gray.shape
    rough = fitted(board, ids, corners, (width, height), "charuco")
    if rough is None:
        return None
    lattice, seen = rough
    free = max((1 - board.marker_m / board.square_m) / 2, LEAST_FREE)
    exact = refined(gray, seen.points_px, windows_px(lattice, grid_of(board)[seen.ids], free))
    again = fitted(board, seen.ids, exact, (width, height), "charuco")
    return None if again is None else again[1]


# -- what is there instead -------------------------------------------------------------------------------


def _instead(gray: Pixels, board: Board, markers: int) -> Missing:
    """Likely mistakes, each tried once on the reduced picture."""
    small = reduced(gray)
    if markers < FEWEST_MARKERS:
        return _other_dictionary(small, board, markers)
    other = replace(board, legacy=not board.legacy)
    turned = replace(board, columns=board.rows, rows=board.columns)
    larger = replace(board, columns=board.columns + 1, rows=board.rows + 1)
    size = "{0.columns}x{0.rows}".format
    tried = [(other, f"the board is of the {'older' if other.legacy else 'newer'} pattern; "
              f"{'give' if other.legacy else 'leave out'} --legacy"),
             (turned, f"columns and rows are exchanged; give --squares {size(turned)}"),
             (larger, f"a board of {size(larger)} squares is there ({size(board)} are its inner corners); "
              f"give --squares {size(larger)}")]  # fmt: skip
    for guess, text in tried:
        if size_of(guess.dictionary) < guess.columns * guess.rows // 2:
            continue
        corners, ids, _ = _detected(small.pixels, guess)
        if _is_board(small, guess, corners, ids):
            return Missing(markers, text)
    return Missing(
        markers, f"{markers} markers of {board.dictionary} are there, but not as on this board; check --squares"
    )


def _is_board(small: Reduced, board: Board, corners: Array, ids: Indices) -> bool:
    height, width = small.pixels.shape
    lattice = fit(grid_of(board)[ids], corners, width, height) if len(ids) >= 2 * FEWEST else None
    return lattice is not None and lattice.rms_px < 1.0


def _other_dictionary(small: Reduced, board: Board, markers: int) -> Missing:
    """Markers of another dictionary."""
    import cv2

    mine = NAMES[dictionary_name(board.dictionary)]
    for name in BIGGEST:
        if NAMES[name].split("_")[1] == mine.split("_")[1] and name[0].isdigit() and "h" not in name:
            continue
        _, ids, _ = cv2.aruco.ArucoDetector(dictionary(name)).detectMarkers(small.pixels)
        count = 0 if ids is None else len(np.unique(ids))
        if count >= FEWEST_MARKERS:
            fitting = _smallest(name, int(np.max(ids)))
            return Missing(markers, f"{count} markers of {fitting} are there; give --dictionary {fitting}")
    return Missing(markers)


def _smallest(name: str, number: int) -> str:
    """The smallest dictionary of a kind that has this marker."""
    family, _, size = name.rpartition("_")
    if not size.isdigit() or not family:
        return name
    return next(f"{family}_{n}" for n in (50, 100, 250, 1000) if number < n)
