"""Calibration boards: which points of a board a picture shows, and where, each with its sigma.

The corners are saddles, which blur and the transfer curve leave in place (`board_points.saddles`). Their sigma is what the
points of the view tell against each other; the board's flatness and print are not in it.
"""

from __future__ import annotations

from ..board import Board, BoardView
from ..board_points import aprilgrid, charuco, chessboard, circles, gray
from ..board_points.seen import Missing, Seen
from ..errors import InputError, NothingFoundError
from ..photo import Photo

FEWEST_POINTS = 6
"""Points of a board whose parts have names that make a view."""

SMALLEST_PICTURE_PX = 32
"""Shorter side of a picture below which the detectors can't work."""


def board_view(photo: Photo, board: Board) -> BoardView:
    """The points of a board that a photo shows.

    Args:
        photo: the picture.
        board: the board in it.

    Returns:
        Points in pixels of the upright picture, (0, 0) the centre of its top-left pixel. Chessboards and circles are seen
        whole or not at all, but for a few hidden points; of ChArUco boards and AprilGrids a part will do.

    Raises:
        InputError: no such board can be found in any picture.
        NothingFoundError: too few points are seen; the message says what is there instead where that can be told.
    """
    seen = find_board(photo, board)
    if isinstance(seen, Missing):
        raise NothingFoundError(
            f"{photo.name}: no {board.text} is seen; {_why(seen, board)}", found=seen.found, needed=needed_points(board)
        )
    return BoardView(photo.name, photo.width_px, photo.height_px, seen.ids, seen.points_px, seen.sigma_px, seen.source)


def _why(missing: Missing, board: Board) -> str:
    """What is there instead, or how much was found, and what to do."""
    if missing.text:
        return missing.text
    needed, cure = needed_points(board), _CURES[board.kind]
    if board.kind in ("charuco", "aprilgrid"):
        return f"{missing.found} markers were found, and {needed} points are needed; {cure}"
    if missing.found >= needed:
        return f"what was found does not lie as on this board; {cure}"
    return f"{missing.found} points were found, and {needed} are needed; {cure}"


_CURES = {
    "chessboard": "show the whole board sharp and evenly lit, with a light margin around it",
    "charuco": "come closer or light it better; a part of the board will do",
    "circles": "show the whole board sharp and evenly lit, dark circles on a light ground",
    "aprilgrid": "come closer or light it better; a part of the board will do",
}


def needed_points(board: Board) -> int:
    """How many points make a view of this board."""
    return FEWEST_POINTS if board.kind in ("charuco", "aprilgrid") else len(board.points_m)


def find_board(photo: Photo, board: Board) -> Seen | Missing:
    """The board's points, or why they are not there: `Missing.text` names a wrong count, pattern or dictionary.

    Raises:
        InputError: no such board can be found in any picture.
    """
    picture = gray.gray_of(photo.pixels)
    if min(picture.shape) < SMALLEST_PICTURE_PX:
        return Missing(0, f"the picture has only {photo.width_px} x {photo.height_px} px; use a larger one")
    if board.kind == "chessboard":
        least = chessboard.FEWEST_SQUARES
        if min(board.columns, board.rows) < least:
            raise InputError(
                "--squares", f"{board.columns}x{board.rows}", f"a chessboard is found from {least}x{least} on"
            )
        return chessboard.chessboard(picture, board)
    if board.kind == "charuco":
        return charuco.charuco(picture, board)
    return (circles.circles if board.kind == "circles" else aprilgrid.aprilgrid)(picture, board)
