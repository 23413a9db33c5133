"""AprilTag families with data outside the border, drawn from the library's own pictures of them."""

import ctypes
from pathlib import Path

import numpy as np
import pytest

from subtense.apriltag_library import FAMILIES
from subtense.detection import Search
from subtense.detectors.markers import markers
from subtense.photo import Metadata, Photo

pytestmark = pytest.mark.opencv
SIZE, SAMPLES = 240, 5
LIGHT = (0.03, 0.8)


def printed(family, number):
    """(n, n) cells of a tag as its authors' library draws them, 1 light."""
    from pyapriltags.apriltags import Detector, _image_u8_get_array, _ImageU8

    name = FAMILIES[family][0]
    library = Detector(families=name)
    library.libc.apriltag_to_image.restype = ctypes.POINTER(_ImageU8)
    drawn = library.libc.apriltag_to_image(library.tag_families[name], ctypes.c_uint32(number))
    return (_image_u8_get_array(drawn)[:, : FAMILIES[family][1]] > 127).astype(float)


def picture(family, number, whole, seed=0):
    """A photo of a tag whose whole pattern has the corners `whole`, blurred in linear light, encoded, with noise."""
    import cv2

    cells = printed(family, number)
    n = len(cells)
    unit = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
    back = np.linalg.inv(cv2.getPerspectiveTransform(unit, whole.astype(np.float32)).astype(float))
    y, x = (np.mgrid[0 : SIZE * SAMPLES, 0 : SIZE * SAMPLES] + 0.5) / SAMPLES - 0.5
    a, b, d = (back[i, 0] * x + back[i, 1] * y + back[i, 2] for i in range(3))
    a, b = a / d, b / d
    inside = (a >= 0) & (a < 1) & (b >= 0) & (b < 1)
    light = np.full(x.shape, LIGHT[1])
    light[inside] = LIGHT[0] + (LIGHT[1] - LIGHT[0]) * cells[(b[inside] * n).astype(int), (a[inside] * n).astype(int)]
    light = cv2.GaussianBlur(light, (0, 0), 0.8 * SAMPLES).reshape(SIZE, SAMPLES, SIZE, SAMPLES).mean(axis=(1, 3))
    value = 255 * (1.055 * light ** (1 / 2.4) - 0.055) + np.random.default_rng(seed).normal(0, 2, light.shape)
    gray = np.clip(np.round(value), 0, 255).astype(np.uint8)
    return Photo(np.repeat(gray[..., None], 3, axis=2), Metadata(), Path("drawn.png"), "0")


def border_of(family, whole):
    import cv2

    _, total, border = FAMILIES[family]
    inset = (total - border) / 2 / total
    unit = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
    matrix = cv2.getPerspectiveTransform(unit, whole.astype(np.float32))
    square = np.array([[[inset, inset], [1 - inset, inset], [1 - inset, 1 - inset], [inset, 1 - inset]]], np.float32)
    return cv2.perspectiveTransform(square, matrix)[0].astype(float)


QUICK = ("standard41h12", "circle21h7")
"""The library takes 20 to 50 s to build the tables of each other family; `benchmarks/accuracy.py families` looks at all of them."""


def located(family):
    """What is found of a drawn tag, and how far its corners are off, px."""
    whole = np.array([[50.3, 61.2], [181.7, 44.9], [193.2, 170.4], [62.8, 188.1]])
    (found,) = markers(picture(family, 3, whole), Search(family=family))
    return found, (found.seen.points_px - border_of(family, whole)).ravel()


@pytest.mark.parametrize("family", QUICK)
def test_the_border_is_located(family):
    pytest.importorskip("pyapriltags")
    found, error = located(family)
    assert found.label == f"{family} id 3" and found.shape == "square"
    assert np.abs(error).max() < 0.08
    assert error @ np.linalg.solve(found.seen.cov, error) / 8 < 3


def test_there_are_none_in_noise_and_in_tiny_pictures():
    pytest.importorskip("pyapriltags")
    noise = np.random.default_rng(0).integers(0, 255, (200, 200, 3), dtype=np.uint8)
    for pixels in (noise, np.zeros((1, 1, 3), np.uint8), np.full((50, 80, 3), 255, np.uint8)):
        assert markers(Photo(pixels, Metadata(), Path("a.png"), "0"), Search(family="standard41h12")) == ()
