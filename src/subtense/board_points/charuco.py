"""ChArUco boards: inner corners named by the markers around them, so a part of the board will do.

OpenCV reads the markers and places the corners; the corners are then located as saddles in windows that keep clear of the
markers. OpenCV before 4.6 began boards of an even number of rows with a white square; such a board is only found as the one
or the other.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..arrays import Array, Indices, Pixels
from ..board import Board
from ..errors import InputError
from .dictionaries import NAMES, SIZES, dictionary, dictionary_name, size_of, smallest_perimeter
from .gray import Reduced, reduced, steps
from .lattice import fit
from .saddles import refined, windows_px
from .seen import Missing, Seen, fitted, grid_of

MANY = 0.75
"""Share of the corners in the reduced picture that makes a search of the full one needless."""
FEWEST_MARKERS = 4
"""Markers from which it is worth asking what is wrong with them."""
MOST_COLUMNS = 41
"""Columns up to which a wrong count is looked for."""
WORST_FIT = 0.1
"""Rms residual of the markers over their side beyond which they lie otherwise."""
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
    parameters.minMarkerPerimeterRate = smallest_perimeter(gray)
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
    """Likely mistakes, looked for in the reduced picture."""
    small = reduced(gray)
    if markers < FEWEST_MARKERS:
        return _other_dictionary(small, board, markers)
    laid = _laid(small, board)
    if laid is None:
        return Missing(
            markers, f"{markers} markers of {board.dictionary} are there, but not as on such a board; check --squares"
        )
    columns, rows, white_first = laid
    size, stated = f"{columns}x{rows}", f"{board.columns}x{board.rows}"
    if size != stated:
        inner = (columns - 1, rows - 1) == (board.columns, board.rows)
        why = f" ({stated} are its inner corners)" if inner else ""
        return Missing(markers, f"a board of {size} squares is there{why}; give --squares {size}")
    if white_first != (board.legacy and rows % 2 == 0):
        text = "the older pattern; give --legacy" if white_first else "the newer pattern; leave out --legacy"
        return Missing(markers, f"the board is of {text}")
    return Missing(markers)


def _laid(small: Reduced, board: Board) -> tuple[int, int, bool] | None:
    """Columns and rows of squares on which the markers lie as seen, and whether the first square is white.

    The numbers go row by row, so they tell the columns by where each row begins; the rows are those up to the last marker.
    """
    numbers, quads = _markers(small, board.dictionary)
    height, width = small.pixels.shape
    inset = (1 - board.marker_m / board.square_m) / 2
    corner = np.array([[inset, inset], [1 - inset, inset], [1 - inset, 1 - inset], [inset, 1 - inset]])
    side_px = float(np.median(np.hypot(*(quads[:, 1] - quads[:, 0]).T))) if len(quads) else 1.0
    best: tuple[float, tuple[int, int, bool]] | None = None
    for columns in range(3, MOST_COLUMNS):
        for white_first in (False, True):
            place = _places(columns, white_first, int(numbers.max(initial=0)) + 1)[numbers]
            corners = (place[:, None] + corner).reshape(-1, 2)  # not their middles: those fit many a wrong count
            lattice = fit(corners, quads.reshape(-1, 2), width, height)
            if lattice is None:
                continue
            jac = np.linalg.det(lattice.jacobian(corners.mean(axis=0)[None], 1.0)[0])
            misfit = lattice.rms_px / side_px
            if jac > 0 and misfit < WORST_FIT and (best is None or misfit < best[0]):
                best = misfit, (columns, int(place[:, 1].max()) + 1, white_first)
    return None if best is None else best[1]


def _places(columns: int, white_first: bool, count: int) -> Array:
    """(count, 2) column and row of the white squares, row by row."""
    rows = 2 * count // columns + 2
    row, column = np.divmod(np.arange(rows * columns), columns)
    white = (row + column) % 2 == (0 if white_first else 1)
    return np.column_stack([column[white], row[white]])[:count].astype(float)


def _markers(small: Reduced, name: str) -> tuple[Indices, Array]:
    """Numbers (n,) and corners (n, 4, 2) of the markers of a dictionary, each number once."""
    import cv2

    parameters = cv2.aruco.DetectorParameters()
    parameters.minMarkerPerimeterRate = smallest_perimeter(small.pixels)
    quads, numbers, _ = cv2.aruco.ArucoDetector(dictionary(name), parameters).detectMarkers(small.pixels)
    if numbers is None:
        return np.zeros(0, int), np.zeros((0, 4, 2))
    once, at = np.unique(np.reshape(numbers, -1), return_index=True)
    return np.asarray(once, int), np.reshape(quads, (-1, 4, 2)).astype(float)[at]


def _other_dictionary(small: Reduced, board: Board, markers: int) -> Missing:
    """Markers of another dictionary."""
    mine = dictionary_name(board.dictionary)
    for name in BIGGEST:
        if _kind(name) == _kind(mine):
            continue
        numbers, _ = _markers(small, name)
        if len(numbers) >= FEWEST_MARKERS:
            fitting = _smallest(name, int(numbers.max()))
            return Missing(markers, f"{len(numbers)} markers of {fitting} are there; give --dictionary {fitting}")
    return Missing(markers)


def _kind(name: str) -> str:
    """4x4_50 and 4x4_1000 are of one kind: the smaller is the beginning of the larger."""
    return name.partition("_")[0] if name[0].isdigit() and "x" in name else name


def _smallest(name: str, number: int) -> str:
    """The smallest dictionary of a kind that has this marker."""
    sizes = [f"{_kind(name)}_{size}" for size in SIZES if number < size]
    return sizes[0] if sizes and sizes[0] in NAMES else name
