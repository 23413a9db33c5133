"""Chessboards: inner corners by two detectors, the better one chosen by how well its corners fit a board.

The first binarises and follows squares (`findChessboardCorners`), the second correlates sectors (`findChessboardCornersSB`).
The corners of either are located again as saddles; the second's own positions compete, as they stand a strong blur better.
Both detectors sometimes see a part of a larger board, or take the margin of a smaller one for squares, so what they find is
looked at again: the squares must alternate up to the stated count and end there.

Order: x right and y down on the board as one looks at it, never mirrored. The first corner is the one beside the black
outer square where colours can tell (an odd sum of columns and rows: always; a square board of even counts: up to a half
turn); among what is left, rows run as nearly left to right in the picture as can be. That is stable between two views unless
the board is turned by near a quarter turn in one of them.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..arrays import Array, Pixels
from ..board import Board
from .gray import Reduced, reduced, steps
from .lattice import Lattice, fit, fit_without_strays, scatter_px
from .saddles import ASSUMED_PX, FLOOR_PX, refined, windows_px
from .seen import Missing, Seen

CLASSICAL, SECTORS = "chessboard, classical", "chessboard, sectors"
ALTERNATES = 0.4
"""Contrast of a row's squares over that of the row before it, from which it belongs to the board."""
FREE = 0.4
"""How far from a corner the window reaches, in squares: the outer squares of many boards are cut to half."""
NEAR = 0.3
"""Where a row's squares are looked at, in squares from their side that is nearer to the middle."""
MOST_BEYOND = 3
"""Rows looked for beyond the corners found."""
FEWEST_SQUARES = 4
"""Fewest columns and rows that the detectors see."""
LEAST_SHARE = 0.7
"""Share of the corners that must be seen."""
GOOD_FIT_PX = 0.25
"""Rms residual of a view from which the second detector is tried too."""
WORST_FIT = 0.1
"""Rms residual over the squares' side beyond which it is no board."""


def chessboard(gray: Pixels, board: Board) -> Seen | Missing:
    """All inner corners of a chessboard, but for the few that are hidden."""
    found = 0
    for small in steps(gray):
        views: list[tuple[float, Seen]] = []
        for corners, source in _detected(small, board):
            exact = source != CLASSICAL and small.scale_x == 1
            judged = _judged(gray, board, small.full(corners), source, exact)
            if isinstance(judged, Missing):
                found = max(found, judged.found)
                continue
            views.append(judged)
            if judged[0] < GOOD_FIT_PX:
                break
        if views:
            return min(views, key=lambda view: view[0])[1]
    return _instead(gray, board, found)


def _detected(small: Reduced, board: Board) -> Iterator[tuple[Array, str]]:
    """Corners by each detector, the quickest first; taken only as far as they are asked for."""
    import cv2

    size = (board.points_across, board.points_down)
    classical = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE
    found, corners = cv2.findChessboardCorners(small.pixels, size, flags=classical)
    if found:
        yield np.reshape(corners, (-1, 2)).astype(float), CLASSICAL
    for flags in (0, cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_ACCURACY):
        found, corners = cv2.findChessboardCornersSB(small.pixels, size, flags=flags)
        if found:
            yield np.reshape(corners, (-1, 2)).astype(float), SECTORS
            return


def _judged(gray: Pixels, board: Board, corners: Array, source: str, exact: bool) -> tuple[float, Seen] | Missing:
    """The corners in order and refined, with their rms residual, if they are those of this board."""
    height, width = gray.shape
    grid = _grid(board.points_across, board.points_down)
    corners = _ordered(gray, corners.reshape(board.points_down, board.points_across, 2)).reshape(-1, 2)
    lattice = fit(grid, corners, width, height)
    if lattice is None or lattice.rms_px > WORST_FIT * _side_px(lattice, grid):
        return Missing()
    columns, rows = extent(gray, lattice, board.points_across, board.points_down)
    if (columns, rows) != (board.columns, board.rows):
        return Missing(len(corners))
    again = _fitted(board, refined(gray, corners, windows_px(lattice, grid, FREE)), source, width, height)
    own = _fitted(board, corners, f"{source}, its own corners", width, height) if exact else None
    found = [seen for seen in (again, own) if seen is not None]
    return min(found, key=lambda seen: seen[0]) if found else Missing(len(corners))


def _fitted(board: Board, corners: Array, source: str, width_px: int, height_px: int) -> tuple[float, Seen] | None:
    """Rms residual and what is seen, without strays; None where too much of the board is missing."""
    ids = np.flatnonzero(np.isfinite(corners).all(axis=1))
    grid = _grid(board.points_across, board.points_down)[ids]
    lattice, keep = fit_without_strays(grid, corners[ids], width_px, height_px)
    if lattice is None or keep.sum() < LEAST_SHARE * len(corners):
        return None
    ids = ids[keep]
    sigma = scatter_px(lattice, ids, corners[ids], board.points_across, board.points_down)
    sigma = max(sigma, FLOOR_PX) if np.isfinite(sigma) else ASSUMED_PX
    return lattice.rms_px, Seen(ids, corners[ids], np.full(len(ids), sigma), source)


# -- order and count -------------------------------------------------------------------------------------


def _grid(across: int, down: int) -> Array:
    """(N, 2) corners in squares, row by row."""
    x, y = np.meshgrid(np.arange(across, dtype=float), np.arange(down, dtype=float))
    return np.column_stack([x.ravel(), y.ravel()])


def _side_px(lattice: Lattice, grid: Array) -> float:
    """Side of a middling square."""
    return float(np.median(np.sqrt(abs(np.linalg.det(lattice.jacobian(grid, 1.0))))))


def _ordered(gray: Pixels, corners: Array) -> Array:
    """(down, across, 2) corners turned as the module says."""

    def way(grid: Array) -> tuple[Array, Array]:
        return grid[:, -1].mean(axis=0) - grid[:, 0].mean(axis=0), grid[-1].mean(axis=0) - grid[0].mean(axis=0)

    x, y = way(corners)
    if x[0] * y[1] - x[1] * y[0] < 0:
        corners = corners[::-1]
    turns = (0, 1, 2, 3) if corners.shape[0] == corners.shape[1] else (0, 2)
    turned = [np.rot90(corners, k) for k in turns]
    middles = (corners[1:, 1:] + corners[:-1, :-1] + corners[1:, :-1] + corners[:-1, 1:]) / 4
    light = _light(gray, middles[..., None, :])
    even = np.add.outer(np.arange(light.shape[0]), np.arange(light.shape[1])) % 2 == 0
    black_first = light[even].mean() < light[~even].mean()
    first = [_first_is_black(k, black_first, light.shape) for k in turns]
    among = [grid for grid, black in zip(turned, first, strict=True) if black] or turned

    def upright(grid: Array) -> float:
        x, y = way(grid)
        return float(x[0] / np.hypot(*x) + y[1] / np.hypot(*y))

    return np.asarray(max(among, key=upright))


def _first_is_black(quarter_turns: int, black_first: bool, squares: tuple[int, int]) -> bool:
    """Whether the first square is black after turning; squares of the same parity have the same colour."""
    down, across = squares
    row, column = ((0, 0), (0, across - 1), (down - 1, across - 1), (down - 1, 0))[quarter_turns]
    return bool(((row + column) % 2 == 0) == black_first)


def extent(gray: Pixels, lattice: Lattice, across: int, down: int) -> tuple[int, int]:
    """Columns and rows of squares that alternate, told from the picture, where corners (across x down) were found.

    A row outside the picture counts as far as the stated board reaches.
    """
    return _run(gray, lattice, across, down), _run(gray, lattice, down, across, upright=True)


def _run(gray: Pixels, lattice: Lattice, across: int, down: int, *, upright: bool = False) -> int:
    """Columns of alternating squares from the middle one to either side; rows if `upright`."""
    sign = np.where(np.arange(-1, down) % 2 == 0, 1.0, -1.0)

    def contrast(column: int) -> float:
        """Light of every second square less that of the others, NaN outside the picture."""
        x = column + 0.5 if 0 <= column < across - 1 else column + 1 - NEAR if column < 0 else column + NEAR
        y = np.clip(np.arange(-1, down) + 0.5, -NEAR, down - 1 + NEAR)
        spots = np.stack(np.broadcast_arrays(x, y), axis=-1)
        spots = spots[:, None] + _AROUND
        light = _light(gray, lattice.project(spots[..., ::-1] if upright else spots))
        seen, s = np.isfinite(light), sign * (1 if column % 2 == 0 else -1)
        if min((seen & (s > 0)).sum(), (seen & (s < 0)).sum()) < 1 or seen.sum() < 3:
            return np.nan
        return float(light[seen & (s > 0)].mean() - light[seen & (s < 0)].mean())

    middle = (across - 1) // 2
    found, start = 1, contrast(middle)
    for step in (-1, 1):
        column, last = middle + step, start
        while -MOST_BEYOND <= column < across + MOST_BEYOND:
            now = contrast(column)
            if np.isnan(now):
                now = last if -1 <= column < across else 0.0
            if not now / last > ALTERNATES:
                break
            found, column, last = found + 1, column + step, now
    return found


_AROUND = np.stack(np.meshgrid([-0.15, 0.0, 0.15], [-0.15, 0.0, 0.15]), axis=-1).reshape(-1, 2)


def _light(gray: Pixels, spots_px: Array) -> Array:
    """(..., n, 2) places to the (...) mean of their pixels; NaN where one lies outside."""
    height, width = gray.shape
    inside = np.all((spots_px > -0.5) & (spots_px < [width - 0.5, height - 0.5]), axis=-1)
    x, y = np.moveaxis(np.where(inside[..., None], spots_px, 0.0), -1, 0)
    value = gray[np.rint(y).astype(int), np.rint(x).astype(int)].astype(float)
    return np.asarray(np.where(inside.all(axis=-1), value.mean(axis=-1), np.nan))


def counted(gray: Pixels) -> tuple[int, int] | None:
    """Columns and rows of the chessboard in the picture, whatever it is; None where none is seen."""
    import cv2

    small = reduced(gray).pixels
    best: tuple[int, int] | None = None
    for flags in (cv2.CALIB_CB_LARGER, cv2.CALIB_CB_LARGER | cv2.CALIB_CB_EXHAUSTIVE):
        found, corners, meta = cv2.findChessboardCornersSBWithMeta(small, (3, 3), flags)
        if not found:
            continue
        down, across = meta.shape[:2]
        lattice = fit(_grid(across, down), np.reshape(corners, (-1, 2)), small.shape[1], small.shape[0])
        if lattice is None:
            continue
        size = extent(small, lattice, across, down)
        if min(size) >= FEWEST_SQUARES and (best is None or np.prod(size) > np.prod(best)):
            best = size
    return best


def _instead(gray: Pixels, board: Board, found: int) -> Missing:
    """What is there instead of the stated board, as a sentence with the cure."""
    size = counted(gray)
    if size is None or sorted(size) == sorted((board.columns, board.rows)):
        return Missing(found)
    columns, rows = size if (size[0] >= size[1]) == (board.columns >= board.rows) else size[::-1]
    inner = (columns - 1, rows - 1) == (board.columns, board.rows)
    why = f" ({board.columns}x{board.rows} are its inner corners)" if inner else ""
    return Missing(found, f"a board of {columns}x{rows} squares is there{why}; give --squares {columns}x{rows}")
