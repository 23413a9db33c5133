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

from ..arrays import Array, Bools, Pixels
from ..board import Board
from .gray import TWO_STEPS, Reduced, reduced, steps
from .lattice import Lattice, fit
from .saddles import refined, windows_px
from .seen import Missing, Seen, fitted

CLASSICAL, SECTORS = "chessboard, classical", "chessboard, sectors"
ALTERNATES = 0.4
"""Contrast of a row's squares over that of the row before it, from which it belongs to the board."""
FREE, FREE_AT_CUT = 0.7, 0.4
"""How far from a corner its window reaches, in squares; the second beside outer squares that are cut to half, as on many boards."""
CUT = 0.8
"""Where an outer square is looked at to see whether it is whole, in squares from its inner side."""
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
    for i, small in enumerate(steps(gray, TWO_STEPS)):
        views: list[tuple[float, Seen]] = []
        for corners, source in _detected(small, board, thorough=i == 0):
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


def _detected(small: Reduced, board: Board, *, thorough: bool) -> Iterator[tuple[Array, str]]:
    """Corners by each detector, the quickest first; taken only as far as they are asked for.

    Not thorough is the sectors' quick search alone: in a large picture without a board the others take many seconds.
    """
    import cv2

    size = (board.points_across, board.points_down)
    if thorough:
        flags = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE
        found, corners = cv2.findChessboardCorners(small.pixels, size, flags=flags)
        if found:
            yield np.reshape(corners, (-1, 2)).astype(float), CLASSICAL
    for flags in (0, cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_ACCURACY)[: 2 if thorough else 1]:
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
    windows = np.where(_beside_cut(gray, lattice, board), *(windows_px(lattice, grid, f) for f in (FREE_AT_CUT, FREE)))
    views = [_fitted(board, refined(gray, corners, windows), source, (width, height))]
    if exact:
        views.append(_fitted(board, corners, f"{source}, its own corners", (width, height)))
    found = [view for view in views if view is not None]
    return min(found, key=lambda view: view[0]) if found else Missing(len(corners))


def _fitted(board: Board, corners: Array, source: str, size_px: tuple[int, int]) -> tuple[float, Seen] | None:
    """Rms residual and what is seen; None where too much of the board is missing."""
    found = fitted(board, np.arange(len(corners)), corners, size_px, source)
    if found is None or len(found[1].ids) < LEAST_SHARE * len(corners):
        return None
    return found[0].rms_px, found[1]


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
    middle = (across - 1) // 2
    found, start = 1, _contrast(gray, lattice, across, down, middle, upright=upright)
    for step in (-1, 1):
        column, last = middle + step, start
        while -MOST_BEYOND <= column < across + MOST_BEYOND:
            now = _contrast(gray, lattice, across, down, column, upright=upright)
            if np.isnan(now):
                now = last if -1 <= column < across else 0.0
            if not now / last > ALTERNATES:
                break
            found, column, last = found + 1, column + step, now
    return found


def _contrast(
    gray: Pixels, lattice: Lattice, across: int, down: int, column: int, *, near: float = NEAR, upright: bool = False
) -> float:
    """Light of every second square of a column (a row if `upright`) less that of the others, NaN outside the picture."""
    x = column + 0.5 if 0 <= column < across - 1 else column + 1 - near if column < 0 else column + near
    y = np.clip(np.arange(-1, down) + 0.5, -NEAR, down - 1 + NEAR)
    spots = np.stack(np.broadcast_arrays(x, y), axis=-1)[:, None] + _AROUND
    light = _light(gray, lattice.project(spots[..., ::-1] if upright else spots))
    sign = np.where((np.arange(-1, down) + column) % 2 == 0, 1.0, -1.0)
    seen = np.isfinite(light)
    if min((seen & (sign > 0)).sum(), (seen & (sign < 0)).sum()) < 1 or seen.sum() < 3:
        return np.nan
    return float(light[seen & (sign > 0)].mean() - light[seen & (sign < 0)].mean())


def _beside_cut(gray: Pixels, lattice: Lattice, board: Board) -> Bools:
    """(N,) which corners lie beside outer squares that end early."""
    out = np.zeros((board.points_down, board.points_across), bool)
    for upright, across, down in ((False, *out.shape[::-1]), (True, *out.shape)):
        for column in (-1, across - 1):
            inner, outer = (
                _contrast(gray, lattice, across, down, column, near=n, upright=upright) for n in (NEAR, CUT)
            )
            edge = (out.T if upright else out)[:, 0 if column < 0 else -1]
            edge |= not outer / inner > ALTERNATES
    return out.ravel()


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
