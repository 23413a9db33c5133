"""Board: a flat pattern of many known points to calibrate a camera with, and what a picture shows of it."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from .arrays import Array, Indices
from .errors import InputError

KINDS = ("chessboard", "charuco", "circles", "aprilgrid")
LEAST, MOST = 2, 100
"""Fewest and most columns or rows of a board."""


@dataclass(frozen=True)
class Board:
    """A calibration board, flat, x right and y down as one looks at it, z into the board.

    Attributes:
        kind: one of KINDS.
        columns: squares (chessboard, ChArUco), circles of a row (circles) or tags (AprilGrid) across.
        rows: the same down.
        square_m: side of a square; for circles the distance from a row to the next, half of that within a row; for an
            AprilGrid from a tag's left side to the next tag's.
        marker_m: side of the black square of a marker (ChArUco, AprilGrid); 0 for none.
        dictionary: of the markers, as "4x4_50", "36h11".
        legacy: ChArUco pattern of OpenCV before 4.6: a board of an even number of rows begins with a white square.
        relative_u: of all lengths on the board together: how well the print's scale is known.
        source: where the size comes from.
    """

    kind: str
    columns: int
    rows: int
    square_m: float
    marker_m: float = 0.0
    dictionary: str = ""
    legacy: bool = False
    relative_u: float = 0.0
    source: str = "stated"

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise InputError("--board", self.kind, f"known are {', '.join(KINDS)}")
        for name in ("columns", "rows"):
            if not LEAST <= getattr(self, name) <= MOST:
                raise InputError("--squares", f"{self.columns}x{self.rows}", f"give {LEAST} to {MOST} each way")
        if not 0 < self.square_m < np.inf:
            raise InputError("--square", self.square_m, "give a length above 0")
        if self.kind in ("charuco", "aprilgrid"):
            if not 0 < self.marker_m < self.square_m:
                raise InputError(
                    "--marker", self.marker_m, f"give a length between 0 and --square, {self.square_m:g} m"
                )
            if not self.dictionary:
                raise InputError("--dictionary", None, "name the markers' dictionary, as 4x4_50 or 36h11")

    @property
    def points_across(self) -> int:
        """Points of one row: inner corners, circles, or tag corners."""
        return {"circles": self.columns, "aprilgrid": 2 * self.columns}.get(self.kind, self.columns - 1)

    @property
    def points_down(self) -> int:
        """Rows of points."""
        return {"circles": self.rows, "aprilgrid": 2 * self.rows}.get(self.kind, self.rows - 1)

    @cached_property
    def points_m(self) -> Array:
        """(N, 3) points in metres, row by row.

        Chessboard and ChArUco: inner corners from the first one, at (0, 0). Asymmetric circles: centres, every second row
        half a step to the right, as OpenCV has them. AprilGrid: all corners of all tags by rows of corners, from the top-left
        corner of the top-left tag.
        """
        across, down = np.meshgrid(np.arange(self.points_across), np.arange(self.points_down))
        x, y = across.ravel().astype(float), down.ravel().astype(float)
        if self.kind == "circles":
            x = 2 * x + y % 2
        if self.kind == "aprilgrid":
            x, y = (i // 2 + (i % 2) * self.marker_m / self.square_m for i in (x, y))
        points = np.column_stack([x, y, np.zeros_like(x)]) * self.square_m
        points.flags.writeable = False  # kept, and shared by all who ask
        return points

    @property
    def width_m(self) -> float:
        """Between the outer edges of the whole pattern, across: what `--printed` measures on the print.

        Squares: of all columns. Circles: from the first column's centres to the last one's. AprilGrid: from the first tag's left
        side to the last one's right side.
        """
        if self.kind == "circles":
            return float(np.ptp(self.points_m[:, 0]))
        return (
            (self.columns - 1) * self.square_m + self.marker_m
            if self.kind == "aprilgrid"
            else self.columns * self.square_m
        )

    @property
    def text(self) -> str:
        """As people say it: "chessboard of 10 x 7 squares of 25 mm"."""
        what, many = {
            "charuco": ("ChArUco board", "squares"), "circles": ("grid", "circles"), "aprilgrid": ("AprilGrid", "tags"),
        }.get(self.kind, (self.kind, "squares"))  # fmt: skip
        return f"{what} of {self.columns} x {self.rows} {many}, {self.square_m * 1000:.6g} mm"

    def to_json(self) -> dict[str, Any]:
        """All fields."""
        return {name: getattr(self, name) for name in type(self).__dataclass_fields__}

    @staticmethod
    def parse_count(text: str) -> tuple[int, int]:
        """Read `10x7`: across, then down."""
        found = re.fullmatch(r"\s*(\d{1,4})\s*[x×X*]\s*(\d{1,4})\s*", text)
        if not found:
            raise InputError("--squares", text, "write across x down, as 10x7")
        return int(found[1]), int(found[2])


@dataclass(frozen=True, eq=False)
class BoardView:
    """What one picture shows of a board.

    Attributes:
        name: of the picture.
        width_px: its width.
        height_px: its height.
        ids: (n,) indices into `Board.points_m` of the points seen.
        points_px: (n, 2) where they are seen; (0, 0) is the centre of the top-left pixel.
        sigma_px: (n,) standard deviation of each coordinate by the detector, in so far as it can tell.
        source: the detector ("charuco", "chessboard, classical", "chessboard, sectors").
    """

    name: str
    width_px: int
    height_px: int
    ids: Indices
    points_px: Array
    sigma_px: Array
    source: str = "stated"

    def __post_init__(self) -> None:
        ids, points = np.asarray(self.ids, int), np.asarray(self.points_px, float)
        if points.shape != (ids.size, 2) or not np.all(np.isfinite(points)):
            raise InputError("points_px", f"of shape {points.shape}", f"give {ids.size} x 2 finite pixel coordinates")
        sigma = np.broadcast_to(np.asarray(self.sigma_px, float), ids.shape)
        if not np.all(sigma > 0) or not np.all(np.isfinite(sigma)):
            raise InputError("sigma_px", self.sigma_px, "give a standard deviation in pixels above 0")
        for name, value in (("ids", ids), ("points_px", points), ("sigma_px", sigma)):
            object.__setattr__(self, name, value)
