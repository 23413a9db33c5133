"""Faces: what is seen of a real stereo pair, against its stereo depth, and that nothing is seen where there is no face."""

import math
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from subtense.camera import Camera
from subtense.detection import Search
from subtense.detectors.faces import faces
from subtense.metadata import Metadata
from subtense.methods.known_size import METHOD, Inputs
from subtense.networks.face_mesh import find_faces
from subtense.photo import Photo
from subtense.propagate import measure
from subtense.quantity import Quantity
from subtense.targets import find_target
from subtense.workflow.detect import detect, item_of

pytestmark = pytest.mark.opencv

FOLDER = Path(__file__).parent / "data" / "faces"
F_PX, BASE_M = 451.034, 0.075
CAMERA = Camera(640, 480, F_PX, cx_px=299.038, cy_px=255.165, cov=np.diag([1.0, 0.0, 1.0, 1.0]))


@pytest.fixture(scope="module")
def selfies() -> tuple[Photo, Photo]:
    return Photo.load(FOLDER / "selfie_left.jpg"), Photo.load(FOLDER / "selfie_right.jpg")


@pytest.fixture(scope="module")
def stereo_depth_m(selfies) -> float:
    """Depth of the eyes by their disparity, which owes nothing to any size."""
    left, right = (find_faces(photo.pixels)[0] for photo in selfies)
    disparities = [a.centre_px[0] - b.centre_px[0] for a, b in zip(left.eyes, right.eyes, strict=True)]
    return F_PX * BASE_M / float(np.mean(disparities))


def photo_of(pixels) -> Photo:
    pixels = np.ascontiguousarray(pixels)
    return Photo(pixels, Metadata(), Path("made.png"), "0")


def depth(detection):
    size = detection.target.size
    _, found = measure(METHOD, Inputs(CAMERA, detection.seen, size, tilt=detection.tilt))
    return found


def test_the_distance_of_a_face_holds_its_stereo_depth(selfies, stereo_depth_m):
    assert stereo_depth_m == pytest.approx(0.591, abs=0.01)
    for photo in selfies:
        found = faces(photo, Search(camera=CAMERA))
        assert [one.label for one in found] == ["face 1 eyes", "face 1 iris"]
        assert [one.target.name for one in found] == ["eye-distance", "iris"]
        for one in found:
            answer = depth(one)
            assert answer.low < stereo_depth_m < answer.high
            assert answer.u < 0.08 * answer.value


def test_the_pixels_alone_agree_between_both_pictures(selfies):
    (left, _), (right, _) = (faces(photo) for photo in selfies)
    one, other = (depth(d) for d in (left, right))
    by_pixels = [sum(c.share for c in m.budget if "pixel" in c.name or c.name == "tilt") * m.u**2 for m in (one, other)]
    assert abs(one.value - other.value) < 2 * math.sqrt(sum(by_pixels))


def test_it_goes_through_detect_and_the_method_that_its_shape_asks_for(selfies):
    found = detect(selfies[0], ["faces"])
    assert [one.label for one in found.detections] == ["face 1 eyes", "face 1 iris"]
    item = item_of(found.detections[0])
    assert item.method.name == "known_size" and item.inputs["tilt"] is found.detections[0].tilt


def test_a_small_iris_is_noted(selfies):
    _, iris = faces(selfies[0])
    assert np.hypot(*np.diff(iris.seen.points_px, axis=0)[0]) < 10
    assert [note.code for note in iris.notes] == ["small_iris"]


def test_only_what_a_person_said_is_measured(selfies):
    photo = selfies[0]
    assert [d.target.name for d in faces(photo, Search((find_target("iris"),)))] == ["iris"]
    assert [d.target.name for d in faces(photo, Search((find_target("eye-distance-man"),)))] == ["eye-distance-man"]
    assert faces(photo, Search((find_target("man-height"),))) == ()


def resized(photo, ratio):
    image = Image.fromarray(photo.pixels)
    return photo_of(np.array(image.resize([round(ratio * n) for n in image.size], Image.Resampling.LANCZOS)))


@pytest.mark.parametrize("ratio", [0.45, 0.7, 1.6, 2.5])
def test_size_scales_with_the_picture(selfies, ratio):
    whole, other = faces(selfies[0])[0], faces(resized(selfies[0], ratio))[0]
    there = (whole.seen.points_px + 0.5) * ratio - 0.5
    sigma = np.hypot(other.seen.sigma_px, ratio * whole.seen.sigma_px)
    assert np.all(abs(other.seen.points_px - there) < 2.5 * sigma)


def test_the_mirrored_face_is_turned_the_other_way(selfies):
    whole, other = faces(selfies[1])[0], faces(photo_of(selfies[1].pixels[:, ::-1]))[0]
    assert float(whole.tilt.value) == pytest.approx(-float(other.tilt.value), abs=math.radians(4))
    there = (selfies[1].width_px - 1 - whole.seen.points_px[::-1, 0], whole.seen.points_px[::-1, 1])
    assert np.allclose(np.stack(there, -1), other.seen.points_px, atol=1.0)


def test_a_rolled_head_is_found_along_its_eyes(selfies):
    turned = photo_of(np.rot90(selfies[0].pixels, 1)[:, :])
    upright = faces(selfies[0])[0]
    for one in faces(turned, Search(thorough=True)):
        if one.label.endswith("eyes"):
            apart = [float(np.hypot(*np.diff(d.seen.points_px, axis=0)[0])) for d in (one, upright)]
            assert apart[0] == pytest.approx(apart[1], rel=0.06)


def test_shut_or_hidden_eyes_give_no_iris(selfies):
    pixels = selfies[0].pixels.copy()
    face = find_faces(pixels)[0]
    for eye in face.eyes:  # sunglasses
        x, y = eye.centre_px.round().astype(int)
        pixels[y - 12 : y + 13, x - 17 : x + 18] = 30
    found = faces(photo_of(pixels))
    assert not any(one.label.endswith("iris") for one in found)
    for one in found:
        assert "eyes_unclear" in [note.code for note in one.notes]
        assert float(one.seen.sigma_px) > 1.5 * float(faces(selfies[0])[0].seen.sigma_px)


def test_a_small_face_in_a_large_picture(selfies):
    large = np.full((2400, 3600, 3), 120, np.uint8)
    large[1500:1980, 2700:3340] = selfies[0].pixels
    found = [one for one in faces(photo_of(large)) if one.label == "face 1 eyes"]
    assert len(found) == 1
    assert np.allclose(found[0].seen.points_px - [2700, 1500], faces(selfies[0])[0].seen.points_px, atol=1.2)


@pytest.mark.parametrize("shape", [(1, 1), (2, 700), (480, 640), (3000, 40), (40, 3000)])
@pytest.mark.parametrize("kind", ["black", "white", "noise"])
def test_nothing_is_seen_in_nothing(shape, kind):
    noise = np.random.default_rng(7).integers(0, 256, (*shape, 3), dtype=np.uint8)
    pixels = noise if kind == "noise" else np.full((*shape, 3), 255 * (kind == "white"), np.uint8)
    assert faces(photo_of(pixels)) == ()


@pytest.mark.parametrize("name", ["desk.jpg", "facade.jpg", "belt.jpg"])
def test_no_face_in_pictures_without(examples, name):
    assert faces(Photo.load(examples / name)) == ()


def test_a_face_of_15_px_across_the_street(examples, truth):
    """A drawn person whose eyes are 63 mm apart; the depth is that of the rendering."""
    camera = truth["street.jpg"]["camera"]
    lens = Camera(1800, 1200, camera["f_px"], cx_px=camera["cx_px"], cy_px=camera["cy_px"], cov=np.eye(4) * 1e-6)
    person = next(thing for thing in truth["street.jpg"]["objects"] if thing["name"] == "person")
    [eyes] = faces(Photo.load(examples / "street.jpg"))
    size = Quantity.exact(0.063, "m")
    _, answer = measure(METHOD, Inputs(lens, eyes.seen, size, tilt=eyes.tilt))
    assert answer.low < person["points"][1]["depth_m"] < answer.high
    assert answer.u < 0.05 * answer.value


def test_part_of_a_face_does_no_harm(selfies):
    x, y = (int(n) for n in find_faces(selfies[0].pixels)[0].eyes[0].centre_px)
    for part in (selfies[0].pixels[:, x - 1 :], selfies[0].pixels[y - 1 :], selfies[0].pixels[: y + 4, : x + 60]):
        for one in faces(photo_of(part)):
            assert np.all(one.seen.points_px >= -0.5) and np.all(np.isfinite(one.seen.points_px))


def test_progress_reaches_the_end(selfies):
    shares = []
    faces(selfies[0], Search(progress=shares.append))
    assert shares == sorted(shares) and shares[-1] == pytest.approx(1.0)


def test_the_tilt_is_that_to_the_picture_and_not_to_the_line_of_sight(selfies):
    """The pair is rectified: moved by the base, the face is seen under another line of sight, and lies the same to both. How
    it lies is told by the disparities of the outer corners of the eyes, which stand some 95 mm apart."""
    with_camera = Search(camera=CAMERA)
    left, right = (faces(photo, with_camera)[0].tilt for photo in selfies)
    assert float(left.value) == pytest.approx(float(right.value), abs=math.radians(3))
    corners = [find_faces(photo.pixels)[0].mesh_px[[33, 263], :2] for photo in selfies]
    depth_m = F_PX * BASE_M / (corners[0] - corners[1])[:, 0]
    across_m = float(np.diff(corners[0][:, 0])[0]) * depth_m.mean() / F_PX
    assert float(left.value) == pytest.approx(math.atan2(depth_m[1] - depth_m[0], across_m), abs=math.radians(5))


def test_without_a_camera_the_tilt_is_less_certain(selfies):
    known, unknown = faces(selfies[0], Search(camera=CAMERA))[0].tilt, faces(selfies[0])[0].tilt
    assert unknown.u > known.u
    assert abs(float(unknown.value) - float(known.value)) < 2 * math.sqrt(unknown.u**2 - known.u**2)


def test_what_looks_like_a_face_at_first_is_none(shared_data):
    """Markers of a board and parts of a motorcycle get scores of faces; a look from farther away shows what they are."""
    board = sorted((shared_data / "calibration" / "charuco_1280").glob("*.jpg"))[4:9:4]
    motorcycle = sorted((shared_data / "stereo" / "middlebury_motorcycle").glob("*.png"))[:2]
    for path in (*board, *motorcycle):
        assert find_faces(np.array(Image.open(path).convert("RGB")), thorough=True) == (), path.name
