"""What is black on a board: areas and discs, in metres from the pattern's top-left corner, x right and y down."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from .arrays import Array, Bools
from .board import Board
from .board_points.dictionaries import dictionary, modules_of, size_of
from .errors import InputError

RADIUS = 0.35
"""Radius of a disc in steps from row to row: discs as large as their distance allows are located best."""
BORDER_MODULES = {"charuco": 1, "aprilgrid": 2}
"""Width of a marker's black border; Kalibr draws two."""
KALIBR_TURN = 2
"""Quarter turns by which Kalibr draws a tag against OpenCV."""

Loop = Array
"""(n, 2) corners of a closed outline, m."""


@dataclass(frozen=True, eq=False)
class Pattern:
    """The black parts of a board.

    Attributes:
        width_m: of everything black.
        height_m: of everything black.
        areas: each is outlines that are filled by the even-odd rule.
        discs: (n, 3) x, y and radius, m.
        across_m: x of the two ends that `Board.width_m` lies between.
        down_m: y of the same, down.
    """

    width_m: float
    height_m: float
    areas: tuple[tuple[Loop, ...], ...]
    discs: Array
    across_m: tuple[float, float]
    down_m: tuple[float, float]


def pattern(board: Board) -> Pattern:
    """The pattern of a board.

    Raises:
        InputError: the dictionary has too few markers, or is not known.
    """
    made = {"chessboard": _squares, "charuco": _charuco, "circles": _circles, "aprilgrid": _aprilgrid}[board.kind]
    if board.kind in BORDER_MODULES:
        many = board.columns * board.rows // (2 if board.kind == "charuco" else 1)
        if size_of(board.dictionary) < many:
            raise InputError("--dictionary", board.dictionary, f"it has {size_of(board.dictionary)} markers and the board needs "
                             f"{many}; give a larger one")  # fmt: skip
    return made(board)


def _squares(board: Board) -> Pattern:
    return _of_squares(board, tuple(_black(board)), ())


def _charuco(board: Board) -> Pattern:
    """Markers in the white squares, numbered row by row."""
    black = tuple(_black(board))
    white = [(c, r) for r in range(board.rows) for c in range(board.columns) if (c, r) not in set(black)]
    inset = (board.square_m - board.marker_m) / 2
    markers = [
        _marker(board, number, c * board.square_m + inset, r * board.square_m + inset)
        for number, (c, r) in enumerate(white)
    ]
    return _of_squares(board, black, tuple(markers))


def _black(board: Board) -> Iterator[tuple[int, int]]:
    """(column, row) of the black squares; the first is black but on ChArUco boards of an even number of rows before 4.6."""
    first = 1 if board.kind == "charuco" and board.legacy and board.rows % 2 == 0 else 0
    return ((c, r) for r in range(board.rows) for c in range(board.columns) if (c + r + first) % 2 == 0)


def _of_squares(board: Board, black: tuple[tuple[int, int], ...], more: tuple[tuple[Loop, ...], ...]) -> Pattern:
    width, height = board.columns * board.square_m, board.rows * board.square_m
    squares = tuple((_square(c * board.square_m, r * board.square_m, board.square_m),) for c, r in black)
    return Pattern(width, height, squares + more, np.zeros((0, 3)), (0.0, width), (0.0, height))


def _circles(board: Board) -> Pattern:
    radius = RADIUS * board.square_m
    centres = board.points_m[:, :2] + radius
    width, height = centres.max(axis=0)
    discs = np.column_stack([centres, np.full(len(centres), radius)])
    return Pattern(width + radius, height + radius, (), discs, (radius, float(width)), (radius, float(height)))


def _aprilgrid(board: Board) -> Pattern:
    """Tags numbered row by row from the bottom-left, and squares where the gaps cross, also around the outside."""
    gap = board.square_m - board.marker_m
    width, height = (n * board.square_m + gap for n in (board.columns, board.rows))
    tags = [
        _marker(board, (board.rows - 1 - r) * board.columns + c, gap + c * board.square_m, gap + r * board.square_m)
        for r in range(board.rows)
        for c in range(board.columns)
    ]
    crossings = [
        (_square(c * board.square_m, r * board.square_m, gap),)
        for r in range(board.rows + 1)
        for c in range(board.columns + 1)
    ]
    return Pattern(width, height, (*tags, *crossings), np.zeros((0, 3)), (gap, width - gap), (gap, height - gap))


def _square(x: float, y: float, side: float) -> Loop:
    return np.array([[x, y], [x + side, y], [x + side, y + side], [x, y + side]])


def _marker(board: Board, number: int, x: float, y: float) -> tuple[Loop, ...]:
    """A marker's black, its corner at (x, y), as outlines: modules drawn one by one would show seams."""
    import cv2

    border = BORDER_MODULES[board.kind]
    modules = modules_of(board.dictionary) + 2 * border
    picture = cv2.aruco.generateImageMarker(dictionary(board.dictionary), number, modules, None, border)
    black = np.asarray(picture) < 128
    if board.kind == "aprilgrid":
        black = np.rot90(black, KALIBR_TURN)
    module = board.marker_m / modules
    return tuple(np.array([x, y]) + module * loop for loop in outlines(black))


def outlines(black: Bools) -> Iterator[Array]:
    """Closed outlines of the black cells of a grid, (n, 2) in cells; by the even-odd rule they enclose what is black."""
    padded = np.pad(black, 1)
    ends: dict[tuple[int, int], list[tuple[int, int]]] = {}
    for y, x in np.argwhere(padded[1:, :] != padded[:-1, :]):  # lines along x
        _join(ends, (int(x) - 1, int(y)), (int(x), int(y)))
    for y, x in np.argwhere(padded[:, 1:] != padded[:, :-1]):  # lines along y
        _join(ends, (int(x), int(y) - 1), (int(x), int(y)))
    while ends:
        start = place = next(iter(ends))
        loop = [start]
        while True:
            then = ends[place].pop()
            ends[then].remove(place)
            for at in (place, then):
                if at in ends and not ends[at]:
                    del ends[at]
            if then == start:
                break
            loop.append(then)
            place = then
        yield _without_straight(np.array(loop, float))


def _join(ends: dict[tuple[int, int], list[tuple[int, int]]], a: tuple[int, int], b: tuple[int, int]) -> None:
    ends.setdefault(a, []).append(b)
    ends.setdefault(b, []).append(a)


def _without_straight(loop: Array) -> Array:
    """Without the points that a line goes straight through."""
    before, behind = loop - np.roll(loop, 1, axis=0), np.roll(loop, -1, axis=0) - loop
    turns = before[:, 0] * behind[:, 1] - before[:, 1] * behind[:, 0] != 0
    return np.asarray(loop[turns])
