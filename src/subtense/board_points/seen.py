"""What a finder hands back: a board's points, or why there are none."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Array, Indices
from ..board import Board
from .lattice import FEWEST, Lattice, fit_without_strays, scatter_px

FLOOR_PX = 0.01
"""No point is better known: pixels sample, pictures are compressed."""
ASSUMED_PX = 0.1
"""Where there are too few points to tell."""


@dataclass(frozen=True, eq=False)
class Seen:
    """Points of a board in a picture.

    Attributes:
        ids: (n,) indices into `Board.points_m`.
        points_px: (n, 2).
        sigma_px: (n,) standard deviation of each coordinate.
        source: which detector.
    """

    ids: Indices
    points_px: Array
    sigma_px: Array
    source: str


@dataclass(frozen=True)
class Missing:
    """Why a board was not found.

    Attributes:
        found: how many points or markers there are.
        text: what is there instead, and the cure; empty if nothing is known.
    """

    found: int = 0
    text: str = ""


def grid_of(board: Board) -> Array:
    """(N, 2) the board's points in units of `square_m`."""
    return np.asarray(board.points_m[:, :2] / board.square_m)


def fitted(
    board: Board, ids: Indices, points_px: Array, size_px: tuple[int, int], source: str
) -> tuple[Lattice, Seen] | None:
    """Points that agree with each other on where the board is, by ids, with the sigma they tell; None if too few do.

    Args:
        board: the board.
        ids: (n,) which points.
        points_px: (n, 2), NaN where a point could not be located.
        size_px: width and height of the picture.
        source: the detector.
    """
    there = np.isfinite(points_px).all(axis=1)
    ids, points_px = ids[there], points_px[there]
    if len(ids) < FEWEST:
        return None
    lattice, keep = fit_without_strays(grid_of(board)[ids], points_px, *size_px)
    if lattice is None or keep.sum() < FEWEST:
        return None
    ids, points_px = ids[keep], points_px[keep]
    order = np.argsort(ids)
    ids, points_px = ids[order], points_px[order]
    sigma = max(scatter_px(lattice, ids, points_px, board.points_across, board.points_down), FLOOR_PX)
    if len(ids) < 2 * FEWEST:
        sigma = max(sigma, ASSUMED_PX) if np.isfinite(sigma) else ASSUMED_PX
    return lattice, Seen(ids, points_px, np.full(len(ids), sigma), source)
