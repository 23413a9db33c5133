"""QR codes drawn with exact truth: any pose, blurred in linear light, encoded, with noise."""

import io
from pathlib import Path

import numpy as np
import pytest

from subtense.cell_pattern import homography
from subtense.detection import Search
from subtense.detectors.qr_codes import function_modules, qr_codes
from subtense.photo import Metadata, Photo

pytestmark = pytest.mark.opencv


def photo_of(gray):
    return Photo(np.repeat(gray[..., None], 3, axis=2), Metadata(), Path("drawn.png"), "0")


def code(text="http://e.org", version=2):
    """(n, n) True where light."""
    import cv2

    parameters = cv2.QRCodeEncoder_Params()
    parameters.version = version
    drawn = cv2.QRCodeEncoder_create(parameters).encode(text) > 0
    rows = np.flatnonzero(~drawn.all(axis=1))
    return drawn[rows[0] : rows[-1] + 1, rows[0] : rows[-1] + 1]


def encoded(light, exponent):
    if exponent is not None:
        return light ** (1 / exponent)
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)


def corners_of(side, turn=0.3, tilt=0.0, middle=(130.3, 128.6)):
    """Corners of a square that is turned in the picture and tilted from it, 500 px of focal length away."""
    q = side / 2 * np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]])
    q = q @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    return q * [np.cos(tilt), 1] / (1 + q[:, :1] * np.sin(tilt) / 500) + middle


def picture(cells, corners, blur=0.8, noise=1.5, exponent=None, seed=0, bend=0.0, size=260):
    """A photo of the code: drawn 5 times larger in linear light, blurred, sampled, encoded."""
    import cv2

    scale, n = 5, len(cells)
    y, x = (np.mgrid[0 : size * scale, 0 : size * scale] + 0.5) / scale - 0.5
    h = np.linalg.inv(homography(n, corners))
    w = h[2, 0] * x + h[2, 1] * y + h[2, 2]
    u, v = (h[0, 0] * x + h[0, 1] * y + h[0, 2]) / w, (h[1, 0] * x + h[1, 1] * y + h[1, 2]) / w
    u = u + bend * np.sin(np.pi * u / n)
    inside = (u >= 0) & (u < n) & (v >= 0) & (v < n)
    light = np.full(u.shape, 0.8)
    light[inside] = np.where(cells[v[inside].astype(int), u[inside].astype(int)], 0.8, 0.04)
    light = cv2.GaussianBlur(light, (0, 0), blur * scale).reshape(size, scale, size, scale).mean(axis=(1, 3))
    value = 255 * encoded(light, exponent) + np.random.default_rng(seed).normal(0, noise, light.shape)
    return photo_of(np.clip(np.round(value), 0, 255).astype(np.uint8))


def jpeg(photo, quality):
    from PIL import Image

    buffer = io.BytesIO()
    Image.fromarray(photo.pixels).save(buffer, "JPEG", quality=quality)
    return Photo(np.asarray(Image.open(buffer)), Metadata(), Path("drawn.jpg"), "0")


def normalised(seen, corners):
    """Mean square of the eight errors in their standard deviations; 1 where the covariance holds exactly."""
    error = (seen.points_px - corners).ravel()
    return error @ np.linalg.solve(seen.cov, error) / 8


def side(points):
    return np.hypot(*(np.roll(points, -1, axis=0) - points).T).mean()


@pytest.mark.parametrize("exponent", [None, 1.8, 2.8])
@pytest.mark.parametrize("version", [1, 3, 6])
def test_corners_are_unbiased_and_hold_their_covariance(version, exponent):
    for seed in range(3):
        corners = corners_of(90 + 12 * version, turn=2.1 * seed, tilt=0.4 * (seed - 1))
        (found,) = qr_codes(picture(code(version=version), corners, exponent=exponent, seed=seed))
        assert normalised(found.seen, corners) < 2.5
        assert side(found.seen.points_px) == pytest.approx(side(corners), rel=3e-4)


def test_label_tells_text_version_and_modules():
    (found,) = qr_codes(picture(code("http://example.org/a/long/way", 3), corners_of(120)))
    assert found.label == "QR code 'http://example.org/a…' version 3, 29 modules a side"
    assert found.shape == "square" and found.target is None


def test_an_unprintable_text_stays_on_one_line():
    (found,) = qr_codes(picture(code("a\n\x1b[31mb\tc", 2), corners_of(120)))
    assert found.label == "QR code 'a[31mbc' version 2, 25 modules a side"


@pytest.mark.parametrize("degraded", ["jpeg", "blurred", "sharpened", "resized", "small"])
def test_poor_pictures_hold_their_covariance(degraded):
    import cv2

    seen = []
    for seed in range(3):
        corners = corners_of(70 if degraded == "small" else 130, turn=0.7 + seed, tilt=0.3)
        photo = picture(code(version=2), corners, seed=seed, blur=1.8 if degraded == "blurred" else 0.8)
        if degraded == "jpeg":
            photo = jpeg(photo, 20)
        if degraded == "sharpened":
            photo = photo_of(
                cv2.addWeighted(photo.pixels, 2, cv2.GaussianBlur(photo.pixels, (0, 0), 1.2), -1, 0)[..., 0]
            )
        if degraded == "resized":
            photo = photo_of(cv2.resize(cv2.resize(photo.pixels[..., 0], (340, 340)), (260, 260)))
        seen += [normalised(found.seen, corners) for found in qr_codes(photo)]
    assert len(seen) == 3
    assert max(seen) < 2.5


def test_a_bent_code_is_noted_and_its_covariance_holds():
    corners = corners_of(150)
    (flat,) = qr_codes(picture(code(version=3), corners))
    (bent,) = qr_codes(picture(code(version=3), corners, bend=0.5))
    assert [note.code for note in flat.notes] == []
    assert [note.code for note in bent.notes] == ["not_flat"]
    assert normalised(bent.seen, corners) < 2.5


@pytest.mark.parametrize("spread", [-0.05, 0.1, 0.2])
def test_ink_that_spread_is_no_size(spread):
    """Dark modules that grew by a share of a module on every side, drawn 20 times finer."""
    import cv2

    cells, corners = code(version=2), corners_of(130, turn=0.9, tilt=0.3)
    fine = np.pad(np.kron(cells, np.ones((20, 20), np.uint8)), 40, constant_values=1).astype(np.uint8)
    window = np.ones((2 * round(20 * abs(spread)) + 1,) * 2, np.uint8)
    grown = cv2.erode(fine, window) if spread > 0 else cv2.dilate(fine, window)
    middle = corners.mean(axis=0)
    with_margin = homography(len(cells), corners) @ [[-2, -2, len(cells) + 2, len(cells) + 2],
                                                     [-2, len(cells) + 2, len(cells) + 2, -2], [1, 1, 1, 1]]  # fmt: skip
    outer = (with_margin[:2] / with_margin[2]).T[[0, 3, 2, 1]]
    (found,) = qr_codes(picture(grown > 0, outer))
    assert side(found.seen.points_px) == pytest.approx(side(corners), rel=3e-4)
    assert normalised(found.seen, corners) < 2.5 and np.hypot(*(found.seen.points_px.mean(axis=0) - middle)) < 0.1


def test_two_codes_are_found_left_to_right():
    left = picture(code("left", 1), corners_of(90, middle=(62.0, 128.0)))
    right = picture(code("right", 2), corners_of(100, middle=(190.0, 128.0)))
    both = np.where(np.arange(260)[None, :] < 125, left.pixels[..., 0], right.pixels[..., 0])
    assert [one.label.split("'")[1] for one in qr_codes(photo_of(both))] == ["left", "right"]


def test_nothing_is_invented():
    """Noise, blank, tiny pictures, and three finder patterns without a code between them."""
    noise = np.random.default_rng(0).integers(0, 255, (260, 260), dtype=np.uint8)
    cells = code(version=2)
    known, light = function_modules(25)
    bare = np.where(known & ~light, False, True)
    bare[6, 8:17] = bare[8:17, 6] = True
    for gray in (noise, np.zeros((260, 260), np.uint8), np.full((1, 1), 9, np.uint8), np.full((3, 400), 200, np.uint8)):
        assert qr_codes(photo_of(gray)) == ()
    assert qr_codes(picture(bare, corners_of(130))) == ()
    assert len(qr_codes(picture(cells, corners_of(130)))) == 1


def test_progress_ends_at_one():
    told = []
    qr_codes(photo_of(np.full((60, 60), 200, np.uint8)), Search(progress=told.append))
    qr_codes(picture(code(), corners_of(120)), Search(progress=told.append))
    assert told[-1] == 1.0


def test_real_pictures_without_codes_give_none(examples):
    for name in ("desk.jpg", "street.jpg"):
        assert qr_codes(Photo.load(examples / name)) == ()
