"""Coins, balls and round signs found by themselves: drawn with exact truth, and real pictures."""

import sys
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image

sys.path.insert(0, str(Path(__file__).parent / "synthetic"))
from rims import CAMERA, drawn, encoded, photo_of

from subtense import Photo, propagate
from subtense.cli import main
from subtense.detection import Search
from subtense.detectors.circles import circles
from subtense.methods import circle, sphere
from subtense.quantity import Quantity
from subtense.rim import Ellipse, fit_rim
from subtense.subpixel import encoded_gray
from subtense.targets import find_target

pytestmark = pytest.mark.opencv
TOLD = Quantity.exact(2.2, "1", "stated")


def told(*names, curve=TOLD):
    return Search(targets=tuple(find_target(name) for name in names), curve=curve)


def range_of(found, size, method=circle):
    inputs = method.Inputs(CAMERA, found.seen, Quantity.exact(size, "m"))
    return propagate.measure(method.METHOD, inputs, draws=20_000)[0]


@pytest.mark.parametrize(("tilt", "blur", "dark"), [(0.0, 0.5, False), (0.7, 1.0, True), (1.1, 2.0, False)])
def test_a_disc_is_found_and_its_range_holds_the_truth(tilt, blur, dark):
    middle = np.array([0.06, -0.04, 1.0])
    look = {"inside": 0.05, "outside": 0.5} if dark else {}
    pixels = drawn(middle, 0.05, tilt, 0.4, blur=blur, noise=4, **look)
    [found] = circles(photo_of(pixels), told("speed-limit-de"))
    m, true = range_of(found, 0.1), np.linalg.norm(middle)
    assert found.shape == "circle" and abs(m.value - true) < 3 * m.u
    assert m.value == pytest.approx(true, rel=2e-3)


@pytest.mark.parametrize("blur", [0.5, 2.0])
def test_a_ball_off_the_axis_is_measured_by_its_centre(blur):
    middle = np.array([0.2, 0.12, 1.1])
    [found] = circles(photo_of(drawn(middle, 0.0335, blur=blur)), told("tennis-ball"))
    assert found.shape == "sphere" and found.target.name == "tennis-ball"
    m, true = range_of(found, 0.067, sphere), np.linalg.norm(middle)
    assert m.low <= true <= m.high and m.value == pytest.approx(true, rel=2e-3)


@pytest.mark.parametrize(("exponent", "light"), [(1.8, 0.6), (2.6, 0.9)])
def test_an_unknown_transfer_curve_is_in_u(exponent, light):
    """Read as sRGB, a disc of another curve is off; u says by how much where the curve was not told."""
    middle = np.array([0.0, 0.0, 1.0])
    photo = photo_of(drawn(middle, 0.03, 0.5, blur=2.0, noise=2, exponent=exponent, inside=light, outside=0.02))
    [unknown] = circles(photo, Search(targets=(find_target("speed-limit-de"),)))
    [exact] = circles(photo, told("speed-limit-de"))
    m, narrow = range_of(unknown, 0.06), range_of(exact, 0.06)
    assert m.low <= 1.0 <= m.high
    assert m.u > 3 * narrow.u and not narrow.low <= 1.0 <= narrow.high


def test_errors_of_rims_are_as_large_as_stated():
    """40 rims of 20 to 120 px: rms of error over u of the mean half axis, where the curve is told."""
    rng, z, relative = np.random.default_rng(2), [], []
    for k in range(40):
        a = rng.uniform(10, 60)
        b, turn, size = a * rng.uniform(0.4, 1), rng.uniform(0, np.pi), int(2 * a + 30)
        x, y = size / 2 + rng.uniform(-0.5, 0.5, 2)
        e = Ellipse(x, y, a, b, turn)
        steps = (np.arange(8) + 0.5) / 8 - 0.5
        yy, xx = np.mgrid[0:size, 0:size]
        c, s = np.cos(turn), np.sin(turn)
        cover = sum(((c * (xx + i - x) + s * (yy + j - y)) / a) ** 2 + ((c * (yy + j - y) - s * (xx + i - x)) / b) ** 2 <= 1
                    for i in steps for j in steps) / 64  # fmt: skip
        pixels = encoded(cover, blur=rng.uniform(0.5, 2 if b > 12 else 1), noise=rng.uniform(2, 8), seed=k)
        rim = fit_rim(encoded_gray(pixels), Ellipse(x + 0.8, y - 0.5, e.a_px * 1.02, e.b_px * 0.98, turn + 0.02), TOLD)
        assert rim is not None
        found, both = rim.ellipse, np.array([0, 0, 1.0, 1.0, 0])
        off = found.a_px + found.b_px - a - b
        z.append(off / np.sqrt(both @ rim.cov @ both))
        relative.append(off / (a + b) if a >= 15 else 0.0)
    assert 0.7 < np.sqrt(np.mean(np.square(z))) < 1.25
    assert abs(np.mean(relative)) < 1e-3


def test_a_rim_that_is_partly_hidden():
    middle = np.array([0.0, 0.0, 1.0])
    hide = np.ones((480, 640))
    hide[:, 350:] = 0  # a quarter of the rim and more
    pixels = drawn(middle, 0.05, 0.6, 1.0, hide=hide)
    [found] = circles(photo_of(pixels), told("speed-limit-de"))
    m = range_of(found, 0.1)
    assert m.low <= 1.0 <= m.high and found.seen.score < 0.9
    assert circles(photo_of(pixels)) == ()  # where nothing is told, only whole rims are


@pytest.mark.parametrize(
    "pixels",
    [
        np.zeros((1, 1, 3)), np.zeros((480, 640, 3)), np.full((480, 640, 3), 255), np.zeros((3, 500, 3)),
        np.random.default_rng(0).integers(0, 256, (300, 400, 3)),
        np.repeat(np.repeat(np.indices((12, 16)).sum(0) % 2 * 255, 25, 0), 25, 1)[..., None].repeat(3, 2),
    ],
    ids=["one pixel", "black", "white", "a strip", "noise", "chessboard"],
)  # fmt: skip
@pytest.mark.parametrize("names", [(), ("euro-1",)])
def test_nothing_is_invented(pixels, names):
    assert circles(photo_of(pixels), told(*names)) == ()


def test_a_polygon_and_a_rounded_square_are_no_discs():
    import cv2

    cover = np.zeros((480, 640), np.uint8)
    angles = np.arange(6) * np.pi / 3
    cv2.fillPoly(
        cover, [np.round(np.stack([170 + 90 * np.cos(angles), 240 + 90 * np.sin(angles)], -1)).astype(np.int32)], 1
    )
    cv2.rectangle(cover, (400, 170), (520, 310), 1, 30)
    assert circles(photo_of(encoded(cover.astype(float)))) == ()


def test_what_is_not_told_has_no_size_and_a_coin_its_thickness():
    photo = photo_of(drawn([0, 0, 1.0], 0.05, 0.8))
    [unknown] = circles(photo)
    [coin], [sign] = circles(photo, told("euro-1")), circles(photo, told("speed-limit-de"))
    assert unknown.target is None and unknown.shape == "circle"
    assert coin.target.name == "euro-1" and np.trace(coin.seen.cov) > 4 * np.trace(sign.seen.cov)


def test_two_stated_kinds_tell_each_other():
    one, two = (drawn([x, 0, 1.0], d / 2 * 4, 0.3).astype(int) for x, d in ((-0.1, 0.02575), (0.1, 0.02125)))
    photo = photo_of(np.maximum(one, two))
    found = circles(photo, told("euro-2", "euro-5-cent"))
    assert [d.target.name for d in found] == ["euro-2", "euro-5-cent"]
    assert all("assumed_size" in {n.code for n in d.notes} for d in found)
    # of one stated kind with two sizes of disc, the doubt is noted
    assert all("assumed_size" in {n.code for n in d.notes} for d in circles(photo, told("euro-2")))


def test_coins_that_are_no_discs_are_not_taken_for_them():
    [found] = circles(photo_of(drawn([0, 0, 1.0], 0.05, 0.2)), told("uk-50p"))
    assert found.target is None


def test_on_the_command_line(tmp_path):
    Image.fromarray(drawn([0.05, 0, 0.3], 0.023250 / 2, 0.4)).save(tmp_path / "coin.png")
    command = ["measure", str(tmp_path / "coin.png"), "--target", "euro-1", "--camera", "f=1200 ± 2 px"]
    result = CliRunner().invoke(main, command)
    assert result.exit_code == 0, result.output
    assert "1 euro coin" in result.output and "30" in result.output


# -- real pictures -----------------------------------------------------------------------------------------


def test_three_coins_and_nothing_else(shared_data):
    """A quarter (24.26 mm), another, and a nickel (21.21 mm) near it; a logo and game cartridges are there too."""
    photo = Photo.load(shared_data / "reference_object" / "coins_card" / "example_01.png")
    found = circles(photo)
    middles = np.array([d.seen.points_px.mean(axis=0) for d in found])
    assert middles == pytest.approx(np.array([[66.0, 213.3], [371.1, 206.0], [520.0, 226.3]]), abs=0.7)
    size = [np.hypot(*(d.seen.points_px - m).T).max() for d, m in zip(found, middles, strict=True)]
    assert 24.26 * size[2] / size[1] == pytest.approx(21.21, rel=0.02)
    named = circles(photo, told("us-quarter", "us-nickel"))
    assert [d.target.name for d in named] == ["us-quarter", "us-quarter", "us-nickel"]


def test_round_spots_of_a_stair_have_one_tilt(shared_data):
    """Four black spots of one row on a tread: alike in size, and turned alike."""
    photo = Photo.load(shared_data / "reference_object" / "step_card" / "stepA_1.jpg")
    found = circles(photo)
    ratios, sizes = [], []
    for one in found:
        far = np.hypot(*(one.seen.points_px - one.seen.points_px.mean(axis=0)).T)
        ratios.append(far.min() / far.max())
        sizes.append(far.max())
    assert len(found) >= 3
    assert np.ptp(ratios) < 0.05 and np.std(sizes) / np.mean(sizes) < 0.03


def test_pictures_without_discs_have_none(examples):
    for name in ("belt.jpg", "street.jpg"):
        assert circles(Photo.load(examples / name)) == (), name
