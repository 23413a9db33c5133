"""What a finder hands back: a board's points, or why there are none."""

from __future__ import annotations

from dataclasses import dataclass

from ..arrays import Array, Indices


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
