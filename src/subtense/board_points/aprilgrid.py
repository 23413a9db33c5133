"""AprilGrids: rows of AprilTags that name themselves, with small black squares where the gaps cross.

As Kalibr has them: numbers go row by row from the bottom-left tag to the right and up, and a tag's black border is two
modules wide. Borders of one module are read too, and so are numbers from the top-left tag down; which one it is shows in the
picture, as read the wrong way the board would be mirrored. The squares make each tag's corner a saddle; where a board has
none, the tags' sides are fitted in linear light instead (`subpixel`).

Source: https://github.com/ethz-asl/kalibr/wiki/calibration-targets
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..arrays import Array, Indices, Pixels
from ..board import Board
from ..errors import InputError
from ..subpixel import refine_quad
from .dictionaries import dictionary, modules_of, size_of, smallest_perimeter
from .gray import Reduced, reduced, steps
from .lattice import Lattice, fit_without_strays
from .saddles import refined, windows_px
from .seen import Missing, Seen, fitted, grid_of

BORDER_MODULES = (2, 1)
"""Widths of the black border that are read; Kalibr's first."""
FEWEST_TAGS = 3
MOST_COLUMNS = 20
"""Columns up to which a wrong count is looked for."""
MANY = 0.75
"""Share of the tags in the reduced picture that makes a search of the full one needless."""
WORST_FIT = 0.12
"""Rms residual over a tag's side beyond which it is no board."""
WORST_MISFIT = 0.25
"""Rms residual of a tag's side over its contrast beyond which there is no edge."""


def aprilgrid(gray: Pixels, board: Board) -> Seen | Missing:
    """All corners of the tags that are seen.

    Raises:
        InputError: the dictionary has too few tags.
    """
    needed = board.columns * board.rows
    if size_of(board.dictionary) < needed:
        raise InputError("--dictionary", board.dictionary, f"it has {size_of(board.dictionary)} tags and the board needs "
                         f"{needed}; give a larger one")  # fmt: skip
    best: Seen | None = None
    most = 0
    for small in steps(gray):
        numbers, quads, border = _detected(small, board)
        most = max(most, len(numbers))
        seen = _located(gray, board, numbers, quads, border)
        if seen is not None and (best is None or len(seen.ids) > len(best.ids)):
            best = seen
        if best is not None and len(best.ids) >= MANY * len(board.points_m):
            break
    return best if best is not None else _instead(board, reduced(gray), most, gray.shape[::-1])


def _instead(board: Board, small: Reduced, most: int, size_px: tuple[int, int]) -> Missing:
    """On how many columns the tags lie as seen, if it is not as many as stated."""
    numbers, quads, _ = _detected(small, replace(board, columns=MOST_COLUMNS, rows=MOST_COLUMNS))
    if len(numbers) < FEWEST_TAGS:
        return Missing(most)
    best: tuple[float, str] | None = None
    for columns in range(2, MOST_COLUMNS + 1):
        rows = max(int(numbers.max()) // columns + 1, 2)
        placed = _placed(replace(board, columns=columns, rows=rows), numbers, quads, size_px)
        if placed is not None and (best is None or placed[0].rms_px < best[0]):
            best = placed[0].rms_px, f"{columns}x{rows}"
    if best is None:
        return Missing(
            most, f"{len(numbers)} tags of {board.dictionary} are there, but not as on such a board; check --squares"
        )
    return Missing(most, f"a board of {best[1]} tags is there; give --squares {best[1]}")


def _detected(small: Reduced, board: Board) -> tuple[Indices, Array, int]:
    """Numbers of the tags that are on the board, their corners in full pixels (n, 4, 2), and the border's modules."""
    import cv2

    best: tuple[Indices, Array, int] = np.zeros(0, int), np.zeros((0, 4, 2)), BORDER_MODULES[0]
    for border in BORDER_MODULES:
        parameters = cv2.aruco.DetectorParameters()
        parameters.markerBorderBits = border
        parameters.minMarkerPerimeterRate = smallest_perimeter(small.pixels)
        parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
        quads, numbers, _ = cv2.aruco.ArucoDetector(dictionary(board.dictionary), parameters).detectMarkers(
            small.pixels
        )
        if numbers is None:
            continue
        n = np.asarray(np.reshape(numbers, -1), int)
        q = small.full(np.reshape(quads, (-1, 2)).astype(float)).reshape(-1, 4, 2)
        alone = (n < board.columns * board.rows) & (np.bincount(n)[n] == 1)  # a number seen twice is on two boards
        if alone.sum() > len(best[0]):
            best = n[alone], q[alone], border
    return best


def _located(gray: Pixels, board: Board, numbers: Indices, quads: Array, border: int) -> Seen | None:
    height, width = gray.shape
    placed = _placed(board, numbers, quads, (width, height))
    if placed is None:
        return None
    lattice, ids, corners, source = placed
    grid = grid_of(board)
    if not _has_squares(gray, board, lattice):
        return _by_sides(gray, board, ids, corners, border, source)
    tag = board.marker_m / board.square_m
    free = min(border * tag / (modules_of(board.dictionary) + 2 * border), 1 - tag)
    flat, points = ids.ravel(), corners.reshape(-1, 2)
    found = fitted(board, flat, refined(gray, points, windows_px(lattice, grid[flat], free)), (width, height), source)
    return None if found is None else found[1]


def _ids(board: Board, column: int, row: int) -> Indices:
    """(4,) ids of a tag's corners as one looks at the board: top-left, top-right, bottom-right, bottom-left."""
    first = 2 * row * board.points_across + 2 * column
    return np.array([first, first + 1, first + board.points_across + 1, first + board.points_across])


def _placed(
    board: Board, numbers: Indices, quads: Array, size_px: tuple[int, int]
) -> tuple[Lattice, Indices, Array, str] | None:
    """Where the board is; ids and corners (n, 4, 2) of the tags that agree on it, and how they are numbered.

    Tags may be printed turned by quarters, and numbered from the bottom or from the top. Only the right reading puts all
    corners on one lattice.
    """
    if len(numbers) < FEWEST_TAGS:
        return None
    grid = grid_of(board)
    best: tuple[float, tuple[Lattice, Indices, Array, str]] | None = None
    for rows, source in ((board.rows - 1 - numbers // board.columns, "aprilgrid"),
                         (numbers // board.columns, "aprilgrid numbered from the top")):  # fmt: skip
        ids = np.stack([_ids(board, int(c), int(r)) for c, r in zip(numbers % board.columns, rows, strict=True)])
        for turn in range(4):
            corners = np.roll(quads, turn, axis=1)
            lattice, keep = fit_without_strays(grid[ids.ravel()], corners.reshape(-1, 2), *size_px)
            if lattice is None or np.linalg.det(lattice.jacobian(grid.mean(axis=0)[None], 1.0)[0]) <= 0:
                continue
            whole = keep.reshape(-1, 4).all(axis=1)
            if whole.sum() >= FEWEST_TAGS and (best is None or lattice.rms_px < best[0]):
                best = lattice.rms_px, (lattice, ids[whole], corners[whole], source)
    if best is None:
        return None
    side_px = float(np.median(np.hypot(*(quads[:, 1] - quads[:, 0]).T)))
    return best[1] if best[0] < WORST_FIT * side_px else None


def _has_squares(gray: Pixels, board: Board, lattice: Lattice) -> bool:
    """Whether the gaps' crossings are black where the gaps themselves are light."""
    tag = board.marker_m / board.square_m
    gap = 1 - tag
    x, y = np.meshgrid(np.arange(board.columns - 1), np.arange(board.rows - 1))
    crossing = np.column_stack([x.ravel(), y.ravel()]) + tag + gap / 2
    beside, border = np.array([0.5, 0.0]), gap / 2 + tag / 30
    crossings, gaps, tags = (
        _light(gray, lattice.project(crossing - back)) for back in (np.zeros(2), beside, np.full(2, border))
    )
    seen = np.isfinite(crossings) & np.isfinite(gaps) & np.isfinite(tags)
    return not seen.any() or bool(np.median((2 * crossings - gaps - tags)[seen]) < 0)


def _light(gray: Pixels, spots_px: Array) -> Array:
    height, width = gray.shape
    place = np.rint(spots_px).astype(int)
    inside = np.all((place >= 0) & (place < [width, height]), axis=1)
    out = np.full(len(place), np.nan)
    out[inside] = gray[place[inside, 1], place[inside, 0]]
    return out


def _by_sides(gray: Pixels, board: Board, ids: Indices, corners: Array, border: int, source: str) -> Seen | None:
    """Corners of tags without squares beside them, from their sides; a tag's own covariance is the sigma."""
    height, width = gray.shape
    light = gray / 255.0
    sigma = np.full(len(board.points_m), np.nan)
    points = np.full((*ids.shape, 2), np.nan)
    for i, quad in enumerate(corners):
        side = float(np.mean(np.hypot(*(np.roll(quad, -1, axis=0) - quad).T)))
        found = refine_quad(light, quad, side / (modules_of(board.dictionary) + 2 * border))
        if found is not None and found.misfit < WORST_MISFIT:
            points[i] = found.corners_px
            sigma[ids[i]] = np.sqrt(np.diag(found.cov).reshape(4, 2).mean(axis=1))
    seen = fitted(board, ids.ravel(), points.reshape(-1, 2), (width, height), f"{source}, by the tags' sides")
    if seen is None:
        return None
    s = seen[1]
    return Seen(s.ids, s.points_px, np.maximum(s.sigma_px, sigma[s.ids]), s.source)
