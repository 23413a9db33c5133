"""How a calibration is shown: in words, in pictures, as a page; every number in them is the calibration's."""

import base64
import hashlib
import json
import re
import sys
from dataclasses import replace
from functools import cache
from html.parser import HTMLParser
from itertools import pairwise

import numpy as np
import pytest
from PIL import Image
from tests.synthetic.boards import CHESSBOARD, NOISE_PX, SIZE_PX, scene, true_intrinsics

from subtense.adjustment import project
from subtense.board import BoardView
from subtense.calibration_residuals import board_shifts_m, lens_curve, residuals_of, running_mean
from subtense.calibration_summary import camera_numbers, percent, rig_numbers, stereo_relative_u, verdict
from subtense.camera import Camera
from subtense.errors import InputError, MissingExtraError
from subtense.geometry import Pose, rotation_from_vector
from subtense.reports import calibration_plots as drawn
from subtense.reports.calibration_html import html
from subtense.reports.calibration_text import text
from subtense.rig import Rig
from subtense.workflow.calibrate import Seen, calibrate_rig_views, calibrate_views, printed_scale

STRANGE = "<script>alert('x')</script> $x_1$ & a very long name of a picture \u65e5\u672c \x1b[31m.jpg"
LOST = "nothing like a board in it"
STATED, STATED_NOTES = printed_scale(replace(CHESSBOARD, relative_u=0.0, source="stated"), None)
RIGHT_FROM_LEFT = Pose(rotation_from_vector(np.array([0.0, 0.12, 0.0])), np.array([-0.12, 0.001, 0.004]))


def seen(views, lost=(), names=None):
    """As the detectors tell it, some pictures without a board."""
    names = list(names or (v.name for v in views))
    return Seen(tuple(None if i in lost else v for i, v in enumerate(views)),
                tuple(f"folder/{names[i]}: {LOST}" if i in lost else "" for i in range(len(views))), tuple(names))  # fmt: skip


def pair(rng, count=12):
    """Views of two cameras at once: the left one's are made anew for the right one from the board's true place."""
    left, right, theta = [], [], true_intrinsics()
    points = CHESSBOARD.points_m - CHESSBOARD.points_m.mean(0)
    while len(left) < count:
        pose = Pose(
            rotation_from_vector(rng.normal(0, 0.4, 3)), np.array([*rng.uniform(-0.15, 0.15, 2), rng.uniform(0.5, 0.9)])
        )
        sides = [
            project("brown_conrady", theta, p) for p in (pose.apply(points), RIGHT_FROM_LEFT.apply(pose.apply(points)))
        ]
        if all((s > 0).all() and (s < np.array(SIZE_PX) - 1).all() for s in sides):
            for found, side in zip((left, right), sides, strict=True):
                noisy = side + rng.normal(0, NOISE_PX, side.shape)
                found.append(BoardView(f"{len(found):02d}.jpg", *SIZE_PX, np.arange(len(points)), noisy, NOISE_PX))
    return left, right


@cache
def calibration(name):
    rng = np.random.default_rng(11)
    if name == "rig":
        left, right = pair(rng)
        return calibrate_rig_views(seen(left, lost=(2,)), seen(right), STATED, model="opencv4", notes=STATED_NOTES)
    if name == "left out":
        views = scene(rng, views=14, spread=(0.1, 0.9))
        views[4] = replace(views[4], points_px=views[4].points_px + rng.normal(0, 5, views[4].points_px.shape))
        names = [v.name for v in views]
        names[6] = STRANGE
        return calibrate_views(seen(views, lost=(9,), names=names), CHESSBOARD, model="opencv4")
    views, model = {
        "good": lambda: (scene(rng, spread=(0.1, 0.9), depth_m=(0.3, 0.9)), None),
        "bowed": lambda: (scene(rng, warp_m=(0.001, 0.0003)), "opencv4"), "three": lambda: (scene(rng, views=3), "k1"),
        "sixty": lambda: (scene(rng, views=60), "opencv4"),
        "pinhole": lambda: (scene(rng, intrinsics=true_intrinsics(())[:4], lens="pinhole"), "pinhole"),
        "fisheye": lambda: (scene(rng, "fisheye", true_intrinsics((0.02, -0.01, 0.003, 0.0), 450.0)), "fisheye"),
    }[name]()  # fmt: skip
    return calibrate_views(seen(views), STATED, model=model, notes=STATED_NOTES)


NAMES = ("good", "bowed", "three", "left out", "rig", "pinhole", "fisheye")


@cache
def plots(name):
    return drawn.plots(calibration(name))


# -- in words --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", [*NAMES, "sixty"])
def test_text_fits_a_terminal_and_begins_with_the_verdict(name):
    lines = text(calibration(name)).splitlines()
    assert max(map(len, lines)) <= 100
    assert lines[0] == f"{verdict(calibration(name)).title}."
    assert all(line.isprintable() and line == line.rstrip() for line in lines)


def test_focal_length_has_its_interval_and_two_digits_of_u():
    camera = calibration("good").camera
    line = next(one for one in text(calibration("good")).splitlines() if "focal length " in one)
    value, low, high, u = (float(re.sub(r"\s", "", part)) for part in re.search(
        r"focal length\s+([\d .]+) px\s+95 %: ([\d .]+) to ([\d .]+) px\s+\(u ([\d.]+) px", line).groups())  # fmt: skip
    assert value == pytest.approx(camera.f_px, abs=camera.u_f_px / 10)
    assert [low, high] == pytest.approx(
        [camera.f_px - 1.96 * camera.u_f_px, camera.f_px + 1.96 * camera.u_f_px], abs=u / 10
    )
    assert u == float(f"{camera.u_f_px:.2g}")


def test_field_of_view_has_the_u_of_focal_length():
    camera = Camera(1000, 800, 500.0, 499.5, 399.5, cov=np.diag([25.0, 0, 0, 0]))
    view = next(n for n in camera_numbers(camera) if n.name == "field of view across")
    assert view.value == pytest.approx(2 * np.arctan(500 / 500))
    assert view.u == pytest.approx(2 * (5 / 500) / (1 + 1), rel=1e-6)  # d(2 atan(w/f)) = 2 w/f^2 / (1 + w^2/f^2) df


@pytest.mark.parametrize("name", NAMES)
def test_checks_that_failed_stand_first_with_their_cure(name):
    shown = re.sub(r"\s+", " ", text(calibration(name)))
    order = re.findall(r" (ok|NO) ", shown)
    assert order == sorted(order)
    for check in calibration(name).checks:
        assert f"{'ok' if check.passed else 'NO'} {check.name}: {check.found}" in shown
        assert (bool(check.cure) and f"-> {check.cure}" in shown) == (not check.passed)


def test_verdict_goes_by_the_checks():
    passed = tuple(replace(c, passed=True) for c in calibration("good").checks)
    good = replace(calibration("good"), checks=passed, notes=())
    assert verdict(good).grade == "good"
    gaps = replace(
        good, checks=tuple(replace(c, passed=c.note is None or c.note.code != "low_coverage") for c in passed)
    )
    assert verdict(gaps).grade == "gaps" and verdict(gaps).sentences[-1] == "Weak: coverage of the picture."
    assert verdict(calibration("bowed")).grade == "doubtful"
    assert "board flatness" in verdict(calibration("bowed")).sentences[0]


def test_pictures_left_out_are_named_with_the_reason_once():
    for shown in (text(calibration("left out")), html(calibration("left out"))):
        flat = re.sub(r"<[^>]*>|\s+", " ", shown.partition("<pre")[0])
        assert re.search(r"shot04.jpg.{1,40}its points are off by", flat)
        assert re.search(rf"shot09.jpg.{{1,30}}{LOST}", flat) and "folder/shot09" not in flat
        assert "\x1b" not in shown


def test_lengths_rest_on_the_stated_square_unless_the_print_was_measured():
    for name, measured in (("good", False), ("left out", True), ("rig", False)):
        for shown in (text(calibration(name)), html(calibration(name))):
            flat = re.sub(r"<[^>]*>|&nbsp;|\s+", " ", shown).lower()
            assert ("--printed" in flat) == ("stated square of 30 mm" in flat) == (not measured)
            assert ("u 0.50 %" if not measured else "u 0.10 %") in flat.replace("  ", " ")


def test_percent_has_two_digits():
    assert [percent(x) for x in (0.00123, 0.0099, 0.0101, 0.123, 1.234, 0.0)] == [
        "0.12 %",
        "0.99 %",
        "1.0 %",
        "12 %",
        "123 %",
        "0 %",
    ]


# -- two cameras -------------------------------------------------------------------------------------------------------------


def test_rig_numbers_hold_the_truth():
    baseline, angle, off = rig_numbers(calibration("rig"))
    truth = float(np.linalg.norm(RIGHT_FROM_LEFT.translation_m))
    assert abs(baseline.value - truth) < 4 * baseline.u
    assert abs(angle.value - 0.12) < 4 * angle.u
    assert off.value == pytest.approx(NOISE_PX * np.sqrt(2), rel=0.15)  # noise of the point and of its line
    assert "baseline" in text(calibration("rig")) and "right camera" in text(calibration("rig"))


def rig_with(cov_index, u):
    left = Camera(1600, 1200, 1200.0, 799.5, 599.5)
    cov = np.zeros((14, 14))
    cov[cov_index, cov_index] = u**2
    return Rig(left, left, Pose(np.eye(3), np.array([-0.2, 0.0, 0.0]), cov[-6:, -6:]), cov)


def test_stereo_depth_goes_with_the_baseline_and_turns_matter_more_far_away():
    assert [stereo_relative_u(rig_with(11, 0.001), d) for d in (1.0, 20.0)] == pytest.approx([0.005, 0.005], rel=1e-3)
    assert stereo_relative_u(rig_with(9, 1e-4), 20.0) == pytest.approx(20.0 / 0.2 * 1e-4, rel=1e-3)  # dZ/Z = Z da / B


# -- residuals from several sides ----------------------------------------------------------------------------------------------


def test_lens_curve_is_the_formula_of_k1():
    cov = np.zeros((9, 9))
    cov[4, 4] = 0.01**2
    camera = Camera(
        1600, 1200, 1200.0, 799.5, 599.5, lens="brown_conrady", distortion=np.array([-0.1, 0, 0, 0, 0]), cov=cov
    )
    radius, shift, half = lens_curve(camera)
    ideal = radius - shift
    assert shift == pytest.approx(-0.1 * ideal**3 / 1200**2, abs=1e-6)
    assert half == pytest.approx(1.96 * 0.01 * ideal**3 / 1200**2, rel=1e-3, abs=1e-6)


def test_a_point_of_the_board_that_lies_elsewhere_is_seen():
    state, rng = calibration("good").solution.state, np.random.default_rng(1)
    points, moved = CHESSBOARD.points_m.copy(), np.array([0.0003, -0.0002, 0.0])
    points[20] += moved
    shot = []
    for r, t in zip(state.boards.rotation, state.boards.translation_m, strict=True):
        pixels = project("brown_conrady", state.intrinsics[0], Pose(r, t).apply(points))
        noisy = pixels + rng.normal(0, 0.2, pixels.shape)
        shot.append(BoardView(f"{len(shot)}", *SIZE_PX, np.arange(54), noisy, 0.2))
    shifts, u = board_shifts_m(calibrate_views(seen(shot), CHESSBOARD, model=calibration("good").models[0]).solution)
    off = np.abs(shifts - np.where(np.arange(54)[:, None] == 20, moved[:2], 0.0))
    assert off[20].max() < 0.1 * np.linalg.norm(moved) + 3 * u[20]
    assert (off / u[:, None]).max() < 4.5 and np.mean(off < 1.96 * u[:, None]) > 0.85


def test_running_mean_follows_a_wave():
    x = np.linspace(0, 100, 600)
    middle, mean, half = running_mean(x, np.sin(x / 20))
    assert mean == pytest.approx(np.sin(middle / 20), abs=0.02)
    assert len(middle) == 12 and (half > 0).all()


# -- in pictures ---------------------------------------------------------------------------------------------------------------


def test_files_are_whole_pngs_and_the_same_whatever_the_user_has_set(tmp_path):
    import matplotlib

    folder = tmp_path / "new" / "plots"
    paths = drawn.png_files(calibration("left out"), folder)
    assert sorted(paths) == sorted(folder.iterdir())  # nothing half-written beside them
    assert {p.stem for p in paths} == {
        "range-uncertainty", "projection-uncertainty", "coverage", "residuals-per-picture", "reprojection-vectors",
        "residuals-over-radius", "lens-distortion", "board", "places"}  # fmt: skip
    first = {p.name: p.read_bytes() for p in paths}
    for content in first.values():
        assert content.startswith(b"\x89PNG") and b"Software" not in content and b"tIME" not in content
    with matplotlib.rc_context({"axes.facecolor": "black", "font.size": 30, "savefig.dpi": 10}):
        assert {f"{plot.name}.png": plot.png for plot in plots("left out")} == first
        assert matplotlib.rcParams["font.size"] == 30
    for path in paths:
        with Image.open(path) as picture:
            picture.load()
            assert picture.width == 1200 and 500 < picture.height < 1600


def test_a_rig_has_pictures_of_both_cameras():
    names = [plot.name for plot in plots("rig")]
    assert len(set(names)) == len(names)
    assert {"coverage-left", "coverage-right", "board", "residuals-per-picture"} <= set(names)


def test_a_pinhole_has_no_picture_of_its_distortion():
    assert drawn.lens(calibration("pinhole")) is None
    assert drawn.lens(calibration("fisheye")) is not None


@pytest.mark.parametrize("name", ["three", "sixty", "left out", "rig"])
def test_bars_are_the_rms_and_labels_do_not_overlap(name):
    found = calibration(name)
    with drawn._own_style():
        figure = drawn.picture_residuals(found)
        figure.draw_without_rendering()
    assert len(figure.axes) == len(found.cameras)
    heights = [bar.get_height() for ax in figure.axes for bar in ax.patches]
    assert heights == [p.rms_px for p in found.pictures if not p.left_out]
    for ax in figure.axes:
        boxes = [label.get_window_extent() for label in ax.get_xticklabels() if label.get_text()]
        assert not any(a.overlaps(b) for i, a in enumerate(boxes) for b in boxes[:i])
        assert all(box.y0 >= 0 for box in boxes)


def test_a_name_is_no_formula_and_has_glyphs():
    with drawn._own_style():
        shown = drawn._short(STRANGE)
        axes = drawn.picture_residuals(calibration("left out")).axes[0]
    assert len(shown) <= 20 and shown.startswith("<script>al")
    assert drawn._short("\u65e5\u672c.jpg") == "??.jpg"
    assert not any(label.get_parse_math() for label in axes.get_xticklabels())


def test_coverage_counts_all_points():
    found = calibration("three")
    with drawn._own_style():
        axes = drawn.coverage(found).axes[0]
    words = [t.get_text() for t in axes.texts]
    assert sum(int(w) for w in words if w != "none") == len(residuals_of(found.solution, 0).seen_px)
    cells = sum(w != "none" for w in words)
    assert next(
        c for c in found.checks if c.name.startswith("coverage")
    ).found == f"points in {cells / 20:.0%} of the picture".replace("%", " %")
    assert axes.get_ylim()[0] > axes.get_ylim()[1] and axes.get_aspect() == 1  # y down, square pixels


@pytest.mark.parametrize(
    ("low", "high"), [(0.19, 0.245), (0.25, 1.05), (0.2, 5.0), (0.001, 3000.0), (0.5, 0.5000001), (0.3, 0.3)]
)
def test_contours_are_round_values_inside_and_not_too_many(low, high):
    levels, _ = drawn._levels(low, high)
    assert 1 <= len(levels) <= 9
    assert all(a < b for a, b in pairwise(levels))
    assert low == pytest.approx(high, rel=1e-3) or all(low < v < high for v in levels)


def test_without_matplotlib_it_says_what_to_install(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(MissingExtraError, match=r"subtense\[plots\]"):
        drawn.png_files(calibration("good"), tmp_path)
    assert "subtense[plots]" in html(calibration("good"))


def test_a_folder_that_cannot_be_made_is_an_error(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="--plots"):
        drawn.png_files(calibration("pinhole"), tmp_path / "file")


# -- as a page -------------------------------------------------------------------------------------------------------------------


class Page(HTMLParser):
    """Tags with their attributes, and text."""

    def __init__(self, source):
        super().__init__()
        self.tags, self.text = [], ""
        self.feed(source)

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))

    def handle_data(self, data):
        self.text += data


@pytest.mark.parametrize("name", NAMES)
def test_page_is_one_file_without_script(name):
    source = html(calibration(name), plots(name) if name in ("rig", "left out") else ())
    page = Page(source)
    assert not {tag for tag, _ in page.tags} & {"script", "link", "iframe", "object", "a", "form"}
    assert not [a for _, attrs in page.tags for a in attrs if a.startswith("on") or a in ("style", "href")]
    assert all(attrs["src"].startswith("data:image/png;base64,") for tag, attrs in page.tags if tag == "img")
    style = re.search(r"<style>(.*?)</style>", source, re.DOTALL)[1]
    policy = next(attrs["content"] for _, attrs in page.tags if attrs.get("http-equiv"))
    assert base64.b64encode(hashlib.sha256(style.encode()).digest()).decode() in policy
    assert policy.startswith("default-src 'none'") and "unsafe" not in policy
    assert "nan" not in re.findall(
        r"[a-z]+", re.sub(r"<pre.*?</pre>|base64,[^\"]*", "", source, flags=re.DOTALL).lower()
    )


def test_page_holds_checks_cures_and_the_whole_file():
    found = calibration("bowed")
    page = Page(html(found))
    flat = page.text.replace("\u00a0", " ")
    for check in found.checks:
        assert check.name in flat and check.found in flat
        assert (bool(check.cure) and f"Cure: {check.cure}" in flat) == (not check.passed)
    whole = page.text[page.text.index('{\n "schema"') :].strip()
    assert json.loads(whole) == json.loads(json.dumps(found.to_json()))
    assert html(found) == html(found)


def test_names_of_strangers_are_text():
    source = html(calibration("left out"), plots("left out"))
    assert "<script" not in source and "&lt;script&gt;alert(&#x27;x&#x27;)" in source
    assert STRANGE.replace("\x1b", "?") in Page(source).text


def test_figures_have_words():
    page = Page(html(calibration("rig"), plots("rig")))
    images = [attrs for tag, attrs in page.tags if tag == "img"]
    assert len(images) == len(plots("rig")) == sum(tag == "figcaption" for tag, _ in page.tags)
    assert len({attrs["alt"] for attrs in images}) == len(images)
    assert all(plot.caption.endswith(".") and plot.caption in page.text for plot in plots("rig"))
