"""The picture's quality where something was measured: on drawn squares with exact truth, and on real pictures."""

import io
from pathlib import Path

import numpy as np
import pytest

from subtense.detection import Detection, Search
from subtense.detectors.markers import markers
from subtense.observation import Observation
from subtense.photo import Metadata, Photo
from subtense.quality import quality, widened
from subtense.subpixel import encoded_gray, refine_quad
from subtense.workflow.grade import graded, graded_line

pytestmark = pytest.mark.opencv


def photo_of(pixels):
    pixels = np.asarray(pixels)
    whole = np.repeat(pixels[..., None], 3, axis=2) if pixels.ndim == 2 else pixels
    return Photo(np.ascontiguousarray(whole), Metadata(), Path("drawn.png"), "0")


def square(side=90.0, turn=0.3, blur=0.7, noise=1.0, light=0.8, dark=0.03, seed=0):
    """A dark square on a light ground, drawn 5 times larger in linear light; more light than 1 is clipped. And its corners."""
    import cv2

    scale, size = 5, 160
    y, x = (np.mgrid[0 : size * scale, 0 : size * scale] + 0.5) / scale - 0.5
    u, v = x - 80.3, y - 79.1
    cos, sin = np.cos(turn), np.sin(turn)
    inside = (abs(cos * u + sin * v) < side / 2) & (abs(-sin * u + cos * v) < side / 2)
    scene = cv2.GaussianBlur(np.where(inside, dark, light), (0, 0), blur * scale)
    scene = np.minimum(scene.reshape(size, scale, size, scale).mean(axis=(1, 3)), 1.0)
    value = np.where(scene <= 0.0031308, 12.92 * scene, 1.055 * scene ** (1 / 2.4) - 0.055)
    value = 255 * value + np.random.default_rng(seed).normal(0, noise, value.shape)
    corners = side / 2 * np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]]) @ np.array([[cos, sin], [-sin, cos]])
    return photo_of(np.clip(np.round(value), 0, 255).astype(np.uint8)), Observation(corners + np.array([80.3, 79.1]))


def jpeg(photo, level):
    from PIL import Image

    buffer = io.BytesIO()
    Image.fromarray(photo.pixels).save(buffer, "JPEG", quality=level)
    return photo_of(np.asarray(Image.open(buffer)))


def motion(photo, length):
    import cv2

    return photo_of(cv2.filter2D(photo.pixels, -1, np.ones((1, length)) / length))


def codes(photo, seen, closed=True):
    return [note.code for note in quality(photo, seen, closed=closed).notes]


@pytest.mark.parametrize("turn", [0.0, 0.3, 0.78])
@pytest.mark.parametrize("blur", [0.7, 1.0, 2.0, 4.0])
def test_blur_is_told_to_a_tenth(blur, turn):
    found = quality(*square(blur=blur, turn=turn), closed=True)
    assert found.blur_px == pytest.approx(blur, abs=0.05 + 0.06 * blur)
    assert found.blur_long_px / found.blur_short_px < 1.3
    assert found.edges == 20


@pytest.mark.parametrize("noise", [1.0, 4.0, 10.0])
def test_noise_is_told_from_the_picture_itself(noise):
    photo, seen = square(noise=noise)
    assert 255 * quality(photo, seen, closed=True).noise == pytest.approx(noise, rel=0.2)


def test_motion_is_told_from_being_out_of_focus():
    photo, seen = square(blur=0.6)
    for length in (9, 15):
        found = quality(motion(photo, length), seen, closed=True)
        assert found.blur_long_px == pytest.approx(length / 12**0.5, rel=0.15)
        assert [note.code for note in found.notes] == ["motion_blurred"]
    assert codes(*square(blur=3.0)) == ["blurred"]


def test_each_fault_gets_its_own_note_and_no_other():
    photo, seen = square()
    assert codes(photo, seen) == []
    assert codes(*square(light=2.0)) == ["clipped"]
    assert codes(photo_of((photo.pixels * 0.06 + 100).astype(np.uint8)), seen) == ["low_contrast"]
    assert codes(*square(side=17.0)) == ["few_pixels"]


def textured(photo):
    """The photo over a ground that is not even, as JPEG's blocks show only there."""
    import cv2

    rough = np.random.default_rng(3).normal(0, 60, (*photo.pixels.shape[:2], 1))
    rough = cv2.GaussianBlur(rough, (0, 0), 3.0)[..., None]
    return photo_of(np.clip(photo.pixels * 0.7 + 20 + rough, 0, 255).astype(np.uint8))


def test_blocks_of_strong_compression_are_noted():
    photo, seen = square()
    photo = textured(photo)
    for level in (100, 90, 75):
        assert "compressed" not in codes(jpeg(photo, level), seen)
    for level in (20, 10):
        assert "compressed" in codes(jpeg(photo, level), seen)


def shown(corners, seen):
    """Mean square of the errors in standard deviations; 1 where the covariance holds exactly."""
    error = (seen.points_px - corners.points_px).ravel()
    return error @ np.linalg.solve(seen.cov, error) / 8


@pytest.mark.parametrize("blur", [0.6, 1.2, 2.0])
def test_clipped_edges_hold_the_truth_once_widened(blur):
    """Light beyond the end of the range makes the dark square smaller by up to 3 px, which no residual shows."""
    before, after = [], []
    for light in (1.6, 3.2, 6.4):
        for seed in range(3):
            photo, truth = square(blur=blur, light=light, seed=seed, turn=0.2 + 0.3 * seed)
            fitted = refine_quad(encoded_gray(photo.pixels), truth.points_px, 12.0)
            seen = Observation(fitted.corners_px, cov=fitted.cov)
            wide = widened(seen, quality(photo, seen, closed=True), closed=True)
            before.append(shown(truth, seen))
            after.append(shown(truth, wide))
    assert max(before) > 9
    assert np.mean(after) < 1.2
    assert max(after) < 3.0


def test_a_good_edge_is_left_alone():
    photo, truth = square()
    fitted = refine_quad(encoded_gray(photo.pixels), truth.points_px, 12.0)
    seen = Observation(fitted.corners_px, cov=fitted.cov)
    assert widened(seen, quality(photo, seen, closed=True), closed=True) is seen


def test_clicks_on_blurred_edges_hold_the_truth():
    """A person sees the middle of an edge where its encoded value is in the middle, which lies in the dark."""
    rng = np.random.default_rng(0)
    for blur in (0.7, 2.0, 4.0):
        z = []
        photo, _ = square(blur=blur, turn=0.0)
        for _ in range(20):
            row = photo.pixels[79, :, 0].astype(float)
            middle = (row.max() + row.min()) / 2
            left = np.interp(-middle, -row[:80], np.arange(80.0))
            right = np.interp(middle, row[80:], np.arange(80.0, 160.0))
            ends = np.array([[left, 79.0], [right, 79.0]]) + rng.normal(0, 0.5, (2, 2))
            line, _ = graded_line(photo, Observation(ends, 0.7))
            sigma = line.standard_deviations
            z.append((np.ptp(ends[:, 0]) - 90.0) / np.hypot(sigma[0], sigma[2]))
        assert np.sqrt(np.mean(np.square(z))) < 1.5, blur
        assert (line.cov is None) == (blur < 1)


def test_points_known_coarsely_are_not_taken_for_edges():
    photo, seen = square(blur=4.0)
    coarse = Observation(seen.points_px, 8.0)
    assert quality(photo, coarse, closed=True).edges == 0
    assert codes(photo, coarse) == []


def test_a_detection_is_graded_once():
    photo, seen = square(light=3.0, blur=1.0)
    once = graded(photo, Detection(seen, "square"))
    assert [note.code for note in once.notes] == ["clipped"]
    assert np.all(once.seen.standard_deviations > seen.standard_deviations)
    assert [note.code for note in graded(photo, once).notes] == ["clipped"]


@pytest.mark.parametrize("size", [1, 3, 40])
def test_small_and_plain_pictures_are_borne(size):
    photo = photo_of(np.full((size, size), 120, np.uint8))
    middle = (size - 1) / 2
    found = quality(photo, Observation(np.array([[0.0, middle], [size - 1.0, middle]])))
    assert found.edges == 0
    assert [note.code for note in found.notes] == (["few_pixels"] if size < 20 else [])


def test_examples_have_no_fault(examples):
    for name in ("desk.jpg",):
        photo = Photo.load(examples / name)
        for one in markers(photo, Search(family="36h11")):
            assert codes(photo, one.seen) == []


def test_real_pictures_have_few_notes_and_their_bad_copies_the_right_one(shared_data):
    """Markers in sharp pictures: no note in nine of ten; of blurred and shaken copies: in three of four."""
    import cv2

    folders = {"calibration/charuco_1280": "4x4", "fiducial/april_vision_synth": "36h11", "fiducial/frc2024": "36h11"}
    count, noted, blurred, shaken = 0, 0, 0, 0
    files = [
        (file, family)
        for folder, family in folders.items()
        for file in sorted((shared_data / folder).glob("*.[jp][pn]g"))[:1]
    ]
    for file, family in files:
        photo = Photo.load(file)
        soft, moved = photo_of(cv2.GaussianBlur(photo.pixels, (0, 0), 4.0)), motion(photo, 13)
        for one in markers(photo, Search(family=family))[:10]:
            count += 1
            noted += bool(codes(photo, one.seen))
            blurred += "blurred" in codes(soft, one.seen)
            shaken += "motion_blurred" in codes(moved, one.seen)
    assert count >= 10
    assert noted <= 0.1 * count
    assert blurred >= 0.75 * count
    assert shaken >= 0.75 * count
