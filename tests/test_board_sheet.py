"""Boards to print: what is on the sheet, at which scale, and that it is found by its own detector."""

import itertools
import re
import shutil
import subprocess
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from subtense.board import Board
from subtense.board_pattern import outlines, pattern
from subtense.cli import main
from subtense.detectors.boards import board_view
from subtense.errors import InputError
from subtense.photo import Metadata, Photo
from subtense.reports.board_sheet import LETTER, paper_mm, pdf, sheet, svg, write

CHESS = Board("chessboard", 10, 7, 0.025)
CHARUCO = Board("charuco", 10, 7, 0.025, 0.018, "4x4_50")
OLD = Board("charuco", 8, 6, 0.03, 0.0225, "5x5_50", legacy=True)
CIRCLES = Board("circles", 4, 11, 0.02)
APRIL = Board("aprilgrid", 6, 6, 0.0286, 0.022, "36h11")
BOARDS = [CHESS, CHARUCO, OLD, CIRCLES, APRIL]
names = [f"{b.kind}{'_old' * b.legacy}" for b in BOARDS]


def photo_of(gray):
    return Photo(np.repeat(gray[..., None], 3, axis=2), Metadata(), Path("sheet.png"), "0")


def first_point_mm(board, drawn):
    """Where the board's first point is on the sheet."""
    made = pattern(board)
    inside = board.square_m if board.kind in ("chessboard", "charuco") else made.across_m[0]
    return np.array(drawn.corner_mm) + inside * 1000


# -- what OpenCV and Kalibr draw ---------------------------------------------------------------------------


def black_at(made, x, y):
    """Whether points in metres are black, by the even-odd rule."""
    black = np.zeros(x.shape, bool)
    for area in made.areas:
        inside = np.zeros(x.shape, bool)
        for loop in area:
            for (x0, y0), (x1, y1) in zip(loop, np.roll(loop, -1, axis=0), strict=True):
                if y0 != y1:
                    inside ^= ((y0 > y) != (y1 > y)) & (x0 + (y - y0) / (y1 - y0) * (x1 - x0) > x)
        black |= inside
    return black


@pytest.mark.opencv
@pytest.mark.parametrize(
    ("board", "side"),
    [(CHARUCO, 50), (OLD, 56), (Board("charuco", 5, 7, 0.03, 0.02, "36h11"), 60)],
    ids=lambda b: str(b)[:20],
)
def test_charuco_boards_are_as_opencv_draws_them(board, side):
    """Drawn with as many pixels to a square as make its modules whole."""
    import cv2

    from subtense.board_points.dictionaries import dictionary

    theirs = cv2.aruco.CharucoBoard(
        (board.columns, board.rows), board.square_m, board.marker_m, dictionary(board.dictionary)
    )
    theirs.setLegacyPattern(board.legacy)
    white = theirs.generateImage((side * board.columns, side * board.rows), None, 0, 1) > 128
    rows, columns = (np.arange(1, n * side, 3) for n in (board.rows, board.columns))
    y, x = np.meshgrid((rows + 0.5) / side * board.square_m, (columns + 0.5) / side * board.square_m, indexing="ij")
    ours = black_at(pattern(board), x, y)
    assert np.array_equal(ours, ~white[np.ix_(rows, columns)])


@pytest.mark.opencv
def test_the_first_tag_of_an_aprilgrid_is_kalibrs():
    """Bottom-left, two modules of black around, and the code of 36h11 with its first bit at the top-left."""
    made = pattern(APRIL)
    gap, module = APRIL.square_m - APRIL.marker_m, APRIL.marker_m / 10
    top = made.height_m - gap - APRIL.marker_m
    middles = (np.arange(10) + 0.5) * module
    x, y = np.meshgrid(gap + middles, top + middles)
    black = black_at(made, x, y)
    assert black[:2].all() and black[:, :2].all() and black[-2:].all() and black[:, -2:].all()
    bits = "".join("0" if b else "1" for b in black[2:8, 2:8].ravel())
    assert int(bits, 2) == 0xD5D628584
    assert black_at(made, np.array([gap / 2, gap + APRIL.marker_m + gap / 2]), np.full(2, gap / 2)).all()
    assert not black_at(made, np.array([gap + APRIL.marker_m / 2]), np.array([gap / 2])).any()


def test_outlines_enclose_what_is_black():
    black = np.random.default_rng(0).random((9, 7)) < 0.5
    loops = tuple(outlines(black))
    y, x = np.meshgrid(np.arange(9) + 0.5, np.arange(7) + 0.5, indexing="ij")
    inside = np.zeros(black.shape, bool)
    for loop in loops:
        for (x0, y0), (x1, y1) in zip(loop, np.roll(loop, -1, axis=0), strict=True):
            assert (x0 == x1) != (y0 == y1)
            inside ^= ((y0 > y) != (y1 > y)) & (x0 > x)
    assert np.array_equal(inside, black)


# -- printed and seen again --------------------------------------------------------------------------------


@pytest.mark.opencv
@pytest.mark.parametrize(("board", "dpi"), list(zip(BOARDS, (100, 150, 72, 100, 150), strict=True)), ids=names)
def test_the_pdf_is_found_at_its_scale(board, dpi, tmp_path):
    from PIL import Image

    if shutil.which("pdftoppm") is None:
        pytest.skip("no pdftoppm (poppler-utils)")
    drawn = write(board, tmp_path / "board.pdf", "A3")
    subprocess.run(
        ["pdftoppm", "-r", str(dpi), "-gray", "-png", "-singlefile", "board.pdf", "board"], cwd=tmp_path, check=True
    )
    with Image.open(tmp_path / "board.png") as opened:
        gray = np.asarray(opened.convert("L"))
    assert gray.shape == pytest.approx((drawn.height_mm / 25.4 * dpi, drawn.width_mm / 25.4 * dpi), abs=1)
    view = board_view(photo_of(gray), board)
    assert len(view.ids) == len(board.points_m)
    truth = (board.points_m[:, :2] * 1000 + first_point_mm(board, drawn)) / 25.4 * dpi - 0.5
    assert view.points_px == pytest.approx(truth, abs=0.6)  # poppler puts edges on whole pixels
    for axis in (0, 1):
        scale = np.polyfit(truth[:, axis], view.points_px[:, axis], 1)[0]
        assert scale == pytest.approx(1, abs=1e-3)


def rastered(root, size, scale):
    """Paths of lines along x and y, and circles, at `scale` px per mm with four samples a pixel each way."""
    import cv2

    fine = 4 * scale
    black = np.zeros((round(size[1] * fine), round(size[0] * fine)), bool)
    for element in root.iter():
        tag = element.tag.split("}")[1]
        if tag == "path":
            parts = [part for part in element.get("d").split("Z") if part]
            loops = [
                np.rint(np.array(re.findall(r"[\d.]+", part), float).reshape(-1, 2) * fine).astype(int)
                for part in parts
            ]
            low = np.concatenate(loops).min(axis=0)
            high = np.concatenate(loops).max(axis=0)
            inside = np.zeros(high[::-1] - low[::-1], bool)
            for loop in loops:
                for (x, y0), (_, y1) in zip(loop - low, np.roll(loop - low, -1, axis=0), strict=True):
                    inside[min(y0, y1) : max(y0, y1), x:] ^= True
            black[low[1] : high[1], low[0] : high[0]] |= inside
        if tag == "circle":
            x, y, r = (float(element.get(key)) * fine for key in ("cx", "cy", "r"))
            rows, columns = np.ogrid[int(y - r) - 2 : int(y + r) + 3, int(x - r) - 2 : int(x + r) + 3]
            black[rows, columns] |= np.hypot(columns + 0.5 - x, rows + 0.5 - y) < r
    light = np.where(black, 0, 255).astype(np.uint8)
    return cv2.resize(light, (round(size[0] * scale), round(size[1] * scale)), interpolation=cv2.INTER_AREA)


@pytest.mark.opencv
@pytest.mark.parametrize("board", BOARDS, ids=names)
def test_the_svg_is_found_at_its_scale(board, tmp_path):
    write(board, tmp_path / "board.svg", "A3")
    root = ET.parse(tmp_path / "board.svg").getroot()
    size = [float(root.get(side).removesuffix("mm")) for side in ("width", "height")]
    assert root.get("viewBox").split() == ["0", "0", *(f"{side:g}" for side in size)]
    drawn, scale = sheet(board, "A3"), 4.0
    gray = rastered(root, size, scale)
    view = board_view(photo_of(gray), board)
    assert len(view.ids) == len(board.points_m)
    truth = (board.points_m[:, :2] * 1000 + first_point_mm(board, drawn)) * scale - 0.5
    assert view.points_px == pytest.approx(truth, abs=0.2)
    assert np.ptp(view.points_px, axis=0) == pytest.approx(np.ptp(truth, axis=0), rel=1e-3)


# -- layout ------------------------------------------------------------------------------------------------


def boxes(drawn):
    """(left, top, right, bottom) of the pattern, and of each text."""
    texts = []
    for text in drawn.texts:
        wide = LETTER * text.size_mm * len(text.text)
        left = text.x_mm - {"start": 0, "middle": wide / 2, "end": wide}[text.anchor]
        box = (left, text.y_mm - 0.8 * text.size_mm, left + wide, text.y_mm + 0.25 * text.size_mm)
        if text.turned:
            low = text.y_mm - wide / 2
            box = (text.x_mm - 0.8 * text.size_mm, low, text.x_mm + 0.25 * text.size_mm, low + wide)
        texts.append(box)
    return texts


def overlap(a, b):
    return min(a[2], b[2]) > max(a[0], b[0]) and min(a[3], b[3]) > max(a[1], b[1])


@pytest.mark.opencv
@pytest.mark.parametrize("paper", ["A3", "tabloid", "500x340 mm"])
@pytest.mark.parametrize("board", BOARDS, ids=names)
def test_nothing_overlaps_and_the_margins_are_free(board, paper):
    drawn, made = sheet(board, paper), pattern(board)
    left, top = drawn.corner_mm
    middle = (left, top, left + made.width_m * 1000, top + made.height_m * 1000)
    texts = boxes(drawn)
    assert middle[0] + middle[2] == pytest.approx(drawn.width_mm)
    for box in [*texts, middle]:
        assert min(box[0], box[1]) >= 4.9
        assert box[2] <= drawn.width_mm - 4.9
        assert box[3] <= drawn.height_mm - 4.9
    assert not any(overlap(a, b) for a, b in itertools.combinations([*texts, middle], 2))
    lines = [loop for area in drawn.areas[len(made.areas) :] for loop in area]
    for loop in lines:
        box = (*loop.min(axis=0), *loop.max(axis=0))
        assert not overlap(box, middle)
        assert not any(overlap(box, text) for text in texts)


@pytest.mark.opencv
@pytest.mark.parametrize("board", BOARDS, ids=names)
def test_the_outer_marks_are_what_printed_measures(board):
    drawn, made = sheet(board, "A3"), pattern(board)
    marks = [area[0] for area in drawn.areas[len(made.areas) :] if np.ptp(area[0], axis=0).max() == pytest.approx(4.0)]
    across = sorted(float(loop[:, 0].mean()) for loop in marks if np.ptp(loop[:, 1]) > 1)
    assert np.diff(across) == pytest.approx(board.width_m * 1000)
    assert any(f"{board.width_m * 1000:.6g} mm across" in text.text for text in drawn.texts)
    assert any(f"--squares {board.columns}x{board.rows}" in text.text for text in drawn.texts)


def test_a_board_too_large_for_its_paper_names_the_largest():
    with pytest.raises(
        InputError, match=r"the pattern is 400 x 280 mm; on A4 the largest is --square '25(\.5)? mm'"
    ) as caught:
        sheet(Board("chessboard", 10, 7, 0.04), "A4")
    largest = float(re.search(r"--square '([\d.]+) mm'", str(caught.value))[1]) / 1000
    sheet(Board("chessboard", 10, 7, largest), "A4")
    with pytest.raises(InputError):
        sheet(Board("chessboard", 10, 7, largest + 0.0005), "A4")


@pytest.mark.parametrize("text", ["A9", "", "10x10", "210", "x", "nan x 3", "99999x5"])
def test_strange_papers_are_refused(text):
    with pytest.raises(InputError, match="--paper"):
        paper_mm(text)


def test_papers():
    assert paper_mm("a4") == (210.0, 297.0)
    assert paper_mm("Letter") == (215.9, 279.4)
    assert paper_mm("300 x 400.5 mm") == (300.0, 400.5)


def test_the_files_are_the_same_each_time():
    drawn = sheet(CHESS)
    assert pdf(drawn) == pdf(drawn)
    assert svg(drawn) == svg(drawn)
    assert b"/PrintScaling /None" in pdf(drawn)


# -- the command line --------------------------------------------------------------------------------------


def run(*words):
    return CliRunner().invoke(main, ["board", *words])


@pytest.mark.opencv
def test_the_command_writes_a_board(tmp_path):
    out = tmp_path / "board.pdf"
    result = run(
        "charuco",
        "--squares",
        "10x7",
        "--square",
        "25 mm",
        "--marker",
        "18 mm",
        "--dictionary",
        "DICT_4X4_50",
        "-o",
        str(out),
    )
    assert result.exit_code == 0, result.output
    assert "measure 250 mm across" in result.output
    assert out.read_bytes().startswith(b"%PDF")
    assert [p.name for p in tmp_path.iterdir()] == ["board.pdf"]


@pytest.mark.opencv
@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("ring", "--squares", "10x7", "--square", "25"), "--board is 'ring'; known are chessboard"),
        (("chessboard", "--squares", "10", "--square", "25"), "--squares is '10'; write across x down"),
        (("chessboard", "--square", "25"), "--squares is missing"),
        (("chessboard", "--squares", "10x7"), "--square is missing"),
        (("chessboard", "--squares", "10x7", "--square", "40"), "on A4 the largest is"),
        (("chessboard", "--squares", "100x100", "--square", "25", "--paper", "50x50"), "give a larger --paper"),
        (("charuco", "--squares", "10x7", "--square", "25", "--dictionary", "4x4_50"), "--marker is missing"),
        (("charuco", "--squares", "10x7", "--square", "25", "--marker", "18"), "--dictionary is missing"),
        (
            ("charuco", "--squares", "10x7", "--square", "25", "--marker", "18", "--dictionary", "9x9"),
            "--dictionary is '9x9'",
        ),
        (
            ("aprilgrid", "--squares", "9x9", "--square", "20", "--marker", "15", "--dictionary", "16h5"),
            "has 30 markers",
        ),
    ],
)
def test_mistakes_are_one_line(words, said, tmp_path):
    result = run(*words, "-o", str(tmp_path / "board.svg"))
    assert result.exit_code == 2
    assert said in result.output
    assert result.output.count("\n") == 1
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["board.png", "board", "none/board.pdf"])
def test_files_that_can_not_be_written(name, tmp_path):
    result = run("chessboard", "--squares", "10x7", "--square", "25", "-o", str(tmp_path / name))
    assert result.exit_code == 2
    assert "--output" in result.output
    assert not list(tmp_path.iterdir())
