"""Boards rendered with exact truth: in linear light, blurred, encoded, with noise; and real pictures where they are at hand."""

from pathlib import Path

import numpy as np
import pytest

from subtense.board import Board
from subtense.detectors.boards import board_view
from subtense.errors import InputError, NothingFoundError
from subtense.photo import Metadata, Photo

pytestmark = pytest.mark.opencv

WIDTH, HEIGHT, SCALE = 400, 300, 5
DARK, BRIGHT = 0.03, 0.8
CALIBRATION = Path(__file__).parent.parent.parent / "shared" / "data" / "calibration"


# -- rendering -------------------------------------------------------------------------------------------


def looking(board_m, tilt=(0.3, 0.2), turn=0.1, fill=0.6, middle=(0.5, 0.5)):
    """(3, 3) homography from board metres to pixels: a board of `board_m` (width, height) from its outer top-left corner."""
    import cv2

    f = 1.2 * WIDTH
    rotation = cv2.Rodrigues(np.array([tilt[0], 0, 0.0]))[0] @ cv2.Rodrigues(np.array([0, tilt[1], 0.0]))[0]
    rotation = rotation @ cv2.Rodrigues(np.array([0.0, 0, turn]))[0]
    depth = max(board_m[0] * f / (fill * WIDTH), board_m[1] * f / (fill * HEIGHT))
    to_middle = np.array([[1, 0, -board_m[0] / 2], [0, 1, -board_m[1] / 2], [0, 0, 1]])
    camera = np.array([[f, 0, middle[0] * (WIDTH - 1)], [0, f, middle[1] * (HEIGHT - 1)], [0, 0, 1]])
    return camera @ np.column_stack([rotation[:, 0], rotation[:, 1], [0, 0, depth]]) @ to_middle


def seen_at(homography, points_m):
    q = np.column_stack([points_m, np.ones(len(points_m))]) @ homography.T
    return q[:, :2] / q[:, 2:]


def photo_of(light_of, homography, blur=0.8, noise=1.0, seed=0):
    """A photo of a pattern: `light_of(x_m, y_m)` is 0 for black and 1 for white."""
    import cv2

    random = np.random.default_rng(seed)
    tile = random.uniform(-0.5, 0.5, (2, 100, 100)).astype(np.float32)  # edges along the samples would be displaced
    dy, dx = np.tile(tile, (1, HEIGHT * SCALE // 100, WIDTH * SCALE // 100))
    y, x = (np.arange(n * SCALE, dtype=np.float32) for n in (HEIGHT, WIDTH))
    y, x = (dy + y[:, None] + 0.5) / SCALE - 0.5, (dx + x + 0.5) / SCALE - 0.5
    u, v, w = (r[0] * x + r[1] * y + r[2] for r in np.linalg.inv(homography).astype(np.float32))
    light = np.asarray(DARK + (BRIGHT - DARK) * light_of(u / w, v / w), np.float32)
    light = cv2.GaussianBlur(light, (0, 0), blur * SCALE)
    light = cv2.resize(light, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA)
    value = 255 * np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    value += random.normal(0, noise, value.shape)
    gray = np.clip(np.round(value), 0, 255).astype(np.uint8)
    return Photo(np.repeat(gray[..., None], 3, axis=2), Metadata(), Path("drawn.png"), "0")


def squares(board):
    """The light of a chessboard from its outer top-left corner, the first square black."""

    def light(x, y):
        column, row = np.floor(x / board.square_m), np.floor(y / board.square_m)
        inside = (column >= 0) & (column < board.columns) & (row >= 0) & (row < board.rows)
        return np.where(inside & ((column + row) % 2 == 0), 0.0, 1.0)

    return light


CHESS = Board("chessboard", 10, 7, 0.025)
CIRCLES = Board("circles", 4, 11, 0.02)
CHARUCO = Board("charuco", 9, 6, 0.025, 0.018, "4x4_50")
APRIL = Board("aprilgrid", 5, 4, 0.0286, 0.022, "36h11")


def chess_photo(board=CHESS, blur=0.8, noise=1.0, seed=0, **how):
    """A photo of a chessboard and where its corners are."""
    homography = looking((board.columns * board.square_m, board.rows * board.square_m), **how)
    truth = seen_at(homography, board.points_m[:, :2] + board.square_m)
    return photo_of(squares(board), homography, blur, noise, seed), truth


def discs(board, radius):
    """The light of an asymmetric grid of discs; the first centre at (1, 1) steps."""

    def light(x, y):
        u, v = x / board.square_m - 1, y / board.square_m - 1
        out = np.ones(x.shape)
        for row in (np.rint(v) + i for i in (-1, 0, 1)):
            row = np.clip(row, 0, board.rows - 1)
            column = np.clip(np.rint((u - row % 2) / 2), 0, board.columns - 1)
            out[np.hypot(u - 2 * column - row % 2, v - row) < radius] = 0.0
        return out

    return light


def circles_photo(radius=0.4, board=CIRCLES, blur=0.8, noise=1.0, seed=0, **how):
    homography = looking((10 * board.square_m, 12 * board.square_m), **{"fill": 0.9, **how})
    truth = seen_at(homography, board.points_m[:, :2] + board.square_m)
    return photo_of(discs(board, radius), homography, blur, noise, seed), truth


def cells(white, cell_m):
    """The light of a picture whose pixels are `cell_m` wide, white around."""

    def light(x, y):
        row, column = np.floor(y / cell_m).astype(int), np.floor(x / cell_m).astype(int)
        inside = (row >= 0) & (row < white.shape[0]) & (column >= 0) & (column < white.shape[1])
        return np.where(inside, white[np.where(inside, row, 0), np.where(inside, column, 0)], 1.0)

    return light


def charuco_photo(board=CHARUCO, blur=0.7, noise=1.0, seed=0, **how):
    """OpenCV's own drawing, half a millimetre to the pixel."""
    import cv2

    name = "DICT_" + board.dictionary.upper()
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name))
    drawn = cv2.aruco.CharucoBoard((board.columns, board.rows), board.square_m, board.marker_m, dictionary)
    drawn.setLegacyPattern(board.legacy)
    white = drawn.generateImage((50 * board.columns, 50 * board.rows), None, 0, 1) / 255.0
    homography = looking((board.columns * board.square_m, board.rows * board.square_m), **{"fill": 0.9, **how})
    truth = seen_at(homography, board.points_m[:, :2] + board.square_m)
    return photo_of(cells(white, 0.0005), homography, blur, noise, seed), truth


def april_photo(board=APRIL, border=2, crossings=True, from_top=False, blur=0.7, noise=1.0, seed=0, **how):
    """Tags of 10 modules (8 with a border of one), gaps of 3 tenths of a tag with black squares where they cross."""
    import cv2

    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    side, gap = 6 + 2 * border, round(0.3 * (6 + 2 * border) * 10) // 10
    step = side + gap
    white = np.ones((board.rows * step + gap, board.columns * step + gap))
    for row in range(board.rows):
        for column in range(board.columns):
            number = (row if from_top else board.rows - 1 - row) * board.columns + column
            tag = cv2.aruco.generateImageMarker(dictionary, number, side, None, border) / 255.0
            y, x = gap + row * step, gap + column * step
            white[y : y + side, x : x + side] = np.rot90(tag, 2)
    if crossings:
        for y in range(0, white.shape[0], step):
            for x in range(0, white.shape[1], step):
                white[y : y + gap, x : x + gap] = 0.0
    cell = board.marker_m / side
    homography = looking((white.shape[1] * cell, white.shape[0] * cell), **{"fill": 0.9, **how})
    truth = seen_at(homography, board.points_m[:, :2] + gap * cell)
    return photo_of(cells(white, cell), homography, blur, noise, seed), truth


def compared(views):
    """Rms error of a coordinate, the mean error's length, and the rms sigma, of (view, truth)."""
    errors = np.concatenate([view.points_px - truth[view.ids] for view, truth in views])
    sigma = np.concatenate([view.sigma_px for view, _ in views])
    return float(np.sqrt(np.mean(errors**2))), float(np.hypot(*errors.mean(axis=0))), float(np.sqrt(np.mean(sigma**2)))


def said(photo, board):
    """What is said where the board is not found."""
    with pytest.raises(NothingFoundError) as caught:
        board_view(photo, board)
    return str(caught.value)


# -- chessboards -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("blur", "noise", "fill"), [(0.6, 1.0, 0.9), (0.9, 3.0, 0.9), (1.5, 1.0, 0.6), (2.5, 2.0, 0.9)]
)
def test_corners_of_a_chessboard_are_as_good_as_their_sigma(blur, noise, fill):
    """Blurred in linear light and then encoded; the corners stay where they are."""
    views = []
    for seed in range(2):
        photo, truth = chess_photo(
            blur=blur, noise=noise, seed=seed, tilt=(0.5 - 0.4 * seed, 0.3), turn=0.1 * seed, fill=fill
        )
        views.append((board_view(photo, CHESS), truth))
        assert len(views[-1][0].ids) >= 50
    rms, mean, sigma = compared(views)
    assert rms < 0.06
    assert mean < 0.01
    assert 0.7 < sigma / rms < 1.5


@pytest.mark.parametrize("turn", [0.0, 1.5, 3.1, 4.6])
def test_colours_settle_the_order_of_an_odd_board(turn):
    photo, truth = chess_photo(turn=turn, fill=0.7)
    view = board_view(photo, CHESS)
    assert view.points_px == pytest.approx(truth[view.ids], abs=0.3)


@pytest.mark.parametrize(("columns", "rows"), [(9, 7), (8, 8), (7, 7)])
@pytest.mark.parametrize("turn", [0.2, 2.9])
def test_the_order_of_an_even_board_follows_the_picture(columns, rows, turn):
    board = Board("chessboard", columns, rows, 0.025)
    photo, truth = chess_photo(board, turn=turn, fill=0.7)
    view = board_view(photo, board)
    grid = view.points_px.reshape(board.points_down, board.points_across, 2)
    across, down = grid[0, -1] - grid[0, 0], grid[-1, 0] - grid[0, 0]
    assert across[0] * down[1] - across[1] * down[0] > 0  # never mirrored
    assert across[0] + down[1] > 0
    same = truth if turn < 1 else truth[::-1]
    assert view.points_px == pytest.approx(same, abs=0.3)


def test_a_wrong_count_is_told():
    photo, _ = chess_photo(fill=0.8)
    for wrong in ((9, 6), (11, 8), (8, 7), (10, 5), (6, 5)):
        assert "a board of 10x7 squares is there" in said(photo, Board("chessboard", *wrong, 0.025))
    assert "9x6 are its inner corners); give --squares 10x7" in said(photo, Board("chessboard", 9, 6, 0.025))


def test_too_small_a_chessboard_is_refused():
    photo, _ = chess_photo()
    with pytest.raises(InputError, match="from 4x4 on"):
        board_view(photo, Board("chessboard", 3, 7, 0.025))


@pytest.mark.parametrize("board", [CHESS, CIRCLES, CHARUCO, APRIL], ids=lambda b: b.kind)
def test_pictures_without_a_board_have_none(board):
    noise = np.random.default_rng(0).integers(0, 255, (240, 320, 3), dtype=np.uint8)
    for pixels in (np.full((240, 320, 3), 128, np.uint8), noise, np.zeros((3, 5, 3), np.uint8)):
        with pytest.raises(NothingFoundError) as caught:
            board_view(Photo(pixels, Metadata(), Path("empty.png"), "0"), board)
        assert caught.value.found < caught.value.needed
        assert "\n" not in str(caught.value)


# -- ChArUco boards --------------------------------------------------------------------------------------


def test_corners_of_charuco_are_as_good_as_their_sigma():
    views = []
    for seed, tilt in enumerate([(0.1, 0.1), (0.5, 0.3), (-0.4, 0.5)]):
        photo, truth = charuco_photo(tilt=tilt, turn=0.4 * seed, seed=seed, fill=0.9 - 0.2 * (seed > 0))
        views.append((board_view(photo, CHARUCO), truth))
    rms, mean, sigma = compared(views)
    assert rms < 0.08
    assert mean < 0.02
    assert 0.7 < sigma / rms < 1.5


def test_a_part_of_a_charuco_board_will_do():
    photo, truth = charuco_photo(fill=1.5, middle=(0.3, 0.5))
    view = board_view(photo, CHARUCO)
    assert 6 <= len(view.ids) < len(truth)
    assert view.points_px == pytest.approx(truth[view.ids], abs=0.3)


def test_old_and_new_patterns_are_told_apart():
    new, old = CHARUCO, Board("charuco", 9, 6, 0.025, 0.018, "4x4_50", legacy=True)
    photo, truth = charuco_photo(old)
    view = board_view(photo, old)
    assert view.points_px == pytest.approx(truth[view.ids], abs=0.3)
    assert "give --legacy" in said(photo, new)
    assert "leave out --legacy" in said(charuco_photo(new)[0], old)


def test_mistakes_about_a_charuco_board_are_told():
    photo, _ = charuco_photo()
    for wrong in ((8, 5), (6, 9), (12, 6)):
        assert "a board of 9x6 squares is there" in said(photo, Board("charuco", *wrong, 0.025, 0.018, "4x4_250"))
    assert "give --dictionary 4x4_50" in said(photo, Board("charuco", 9, 6, 0.025, 0.018, "6x6_250"))
    with pytest.raises(InputError, match="it has 50 markers and the board needs 120"):
        board_view(photo, Board("charuco", 20, 12, 0.025, 0.018, "4x4_50"))
    with pytest.raises(InputError, match="--dictionary"):
        board_view(photo, Board("charuco", 9, 6, 0.025, 0.018, "4x5_50"))


# -- AprilGrids ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("border", "from_top"), [(2, False), (2, True)])
def test_corners_of_an_aprilgrid_are_as_good_as_their_sigma(border, from_top):
    views = []
    for seed, tilt in enumerate([(0.1, 0.1), (0.4, 0.3)]):
        photo, truth = april_photo(border=border, from_top=from_top, tilt=tilt, turn=2.9 * seed, seed=seed, fill=0.85)
        views.append((board_view(photo, APRIL), truth))
        assert ("from the top" in views[-1][0].source) == from_top
    rms, mean, sigma = compared(views)
    assert rms < 0.08
    assert mean < 0.02
    assert 0.7 < sigma / rms < 1.5


def test_tags_without_squares_are_located_by_their_sides():
    photo, truth = april_photo(crossings=False, tilt=(0.3, 0.2))
    view = board_view(photo, APRIL)
    assert "sides" in view.source
    assert view.points_px == pytest.approx(truth[view.ids], abs=0.15)


def test_a_part_of_an_aprilgrid_will_do_and_a_wrong_count_is_told():
    photo, truth = april_photo(fill=1.4, middle=(0.4, 0.5), tilt=(0.1, 0.0), turn=0.05)
    view = board_view(photo, APRIL)
    assert 6 <= len(view.ids) < len(truth)
    assert view.points_px == pytest.approx(truth[view.ids], abs=0.3)
    whole, _ = april_photo(fill=0.85)
    assert "a board of 5x4 tags is there" in said(whole, Board("aprilgrid", 4, 5, 0.0286, 0.022, "36h11"))


# -- circles ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("radius", [0.25, 0.45])
def test_centres_of_circles_are_those_of_the_board(radius):
    """Not those of the ellipses, which the perspective shifts."""
    views = []
    for seed, tilt in enumerate([(0.7, 0.3), (-0.8, 0.2)]):
        photo, truth = circles_photo(radius, tilt=tilt, turn=3.1 * seed, seed=seed)
        views.append((board_view(photo, CIRCLES), truth))
    rms, mean, sigma = compared(views)
    assert rms < 0.04
    assert mean < 0.01
    assert 0.7 < sigma / rms < 2.5  # nothing is known to less than 0.02 px


def test_print_beside_the_circles_does_not_pull_them():
    photo, truth = circles_photo(0.35, tilt=(0.1, 0.1), turn=0.0)
    left = int(truth[:, 0].min() - 0.9 * np.ptp(truth[:, 0]) / 7)
    photo.pixels[:, left - 2 : left] = 0
    view = board_view(photo, CIRCLES)
    assert view.points_px == pytest.approx(truth[view.ids], abs=0.1)
    assert "give --squares 4x11" in said(photo, Board("circles", 11, 4, 0.02))


# -- real pictures ---------------------------------------------------------------------------------------


def calibrated(pattern, board):
    """Rms and fx of OpenCV's calibration from all pictures, each of which must be found."""
    import cv2

    files = sorted(CALIBRATION.glob(pattern))
    if not files:
        pytest.skip(f"no pictures {CALIBRATION / pattern}")
    views = [board_view(Photo.load(file), board) for file in files]
    points = [board.points_m[view.ids].astype(np.float32).reshape(-1, 1, 3) for view in views]
    seen = [view.points_px.astype(np.float32).reshape(-1, 1, 2) for view in views]
    size = (views[0].width_px, views[0].height_px)
    rms, matrix, *_ = cv2.calibrateCamera(points, seen, size, None, None)
    return len(files), rms, matrix[0, 0]


def test_opencv_pictures():
    count, rms, fx = calibrated("opencv_stereo_chess/left[0-9]*.jpg", CHESS)
    assert count == 13
    assert rms < 0.20
    assert fx == pytest.approx(532.8, abs=1)
    count, rms, fx = calibrated("opencv_stereo_chess/right[0-9]*.jpg", CHESS)
    assert count == 13
    assert rms < 0.21
    assert fx == pytest.approx(537.4, abs=1)


def test_charuco_pictures():
    count, rms, fx = calibrated("charuco_1280/*.jpg", Board("charuco", 8, 8, 0.0254, 0.01905, "4x4_1000"))
    assert count == 16
    assert rms < 0.26
    assert fx == pytest.approx(1127.5, abs=2)


def test_square_chessboards_of_a_poor_camera():
    count, rms, _ = calibrated("chess_480/*.png", Board("chessboard", 11, 11, 0.0254))
    assert count == 10
    assert rms < 0.33
