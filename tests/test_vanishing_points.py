import json
from pathlib import Path

import numpy as np
import pytest

from subtense import Photo
from subtense.camera import Camera
from subtense.camera_sources import vanishing_points
from subtense.errors import FileFormatError, InputError, UnknownCameraError
from subtense.horizon import level_from_angles
from subtense.line_camera import camera_from_lines
from subtense.metadata import Metadata
from subtense.observation import Observation
from subtense.workflow.resolve_camera import resolve_camera

pytestmark = pytest.mark.opencv
WIDTH, HEIGHT, F = 1600, 1200, 1500.0
PITCH, ROLL, YAW = np.radians(-8.0), np.radians(2.0), np.radians(35.0)
CAMERA = Camera(WIDTH, HEIGHT, F, 799.5, 599.5)


def directions(pitch=PITCH, roll=ROLL, yaw=YAW):
    """First level direction, second, up; in the camera frame."""
    level = level_from_angles(pitch, roll)
    along = np.cos(yaw) * level.right + np.sin(yaw) * level.ahead
    return along, np.cross(level.up, along), level.up


def lines(way, count=6, seed=0, camera=CAMERA):
    """(count, 4) ends of lines of one direction all over the picture."""
    rng, found = np.random.default_rng(seed), []
    while len(found) < count:
        middle = np.array([rng.uniform(-0.5, 0.5), rng.uniform(-0.38, 0.38), 1]) * rng.uniform(4, 9)
        ends = middle + np.outer([-1, 1], rng.uniform(0.7, 1.8) * way)
        pixels = camera.project(ends)
        if np.isfinite(pixels).all() and np.all((pixels > 1) & (pixels < [WIDTH - 2, HEIGHT - 2])):
            found.append(pixels.reshape(-1))
    return np.array(found)


def photo(pixels=None):
    blank = np.full((HEIGHT, WIDTH, 3), 128, np.uint8) if pixels is None else pixels
    return Photo(blank, Metadata(), Path("drawn.png"), "")


def told(tmp_path, sets, **more):
    path = tmp_path / "lines.json"
    path.write_text(json.dumps({**{name: np.asarray(one).tolist() for name, one in sets.items()}, **more}))
    return vanishing_points.camera(f"lines=@{path}", photo())


def all_sets(seed=0, **more):
    ways = dict(zip(("parallels", "others", "verticals"), directions(**more), strict=True))
    return {name: lines(way, seed=seed + i) for i, (name, way) in enumerate(ways.items())}


def test_exact_lines_tell_the_camera_and_how_it_stood(tmp_path):
    found = told(tmp_path, all_sets(), sigma_px=0.01)
    assert found.camera.f_px == pytest.approx(F, rel=2e-3)
    assert (found.pose.pitch_rad, found.pose.roll_rad) == pytest.approx((PITCH, ROLL), abs=3e-3)
    assert found.source == "vanishing_points" and not found.notes


@pytest.mark.parametrize("left_out", ["verticals", "parallels", "others"])
def test_two_directions_are_enough(tmp_path, left_out):
    sets = {name: one for name, one in all_sets(pitch=np.radians(-20.0)).items() if name != left_out}
    found = told(tmp_path, sets, sigma_px=0.2)
    assert abs(found.camera.f_px - F) < 3 * found.camera.u_f_px
    assert found.pose.pitch_rad == pytest.approx(np.radians(-20), abs=0.03)


def test_u_grows_with_what_is_stated_of_the_lines_and_with_their_scatter():
    rng = np.random.default_rng(3)
    sets = [one.reshape(-1, 2) for one in all_sets().values()]

    def found(stated, noise):
        along, across, up = (Observation(one + rng.normal(0, noise, one.shape), stated) for one in sets)
        return camera_from_lines(WIDTH, HEIGHT, up, along, across)

    assert found(2.0, 0.5).camera.u_f_px > found(0.7, 0.5).camera.u_f_px
    scattered = found(0.7, 5.0)
    assert scattered.scatter > 3 and scattered.camera.u_f_px > 2 * found(0.7, 0.5).camera.u_f_px
    assert abs(scattered.camera.f_px - F) < 3 * scattered.camera.u_f_px


def test_a_line_of_another_direction_is_noted(tmp_path):
    sets = all_sets()
    sets["parallels"][2, 3] += 40
    [note] = told(tmp_path, sets).notes
    assert note.code == "lines_misfit" and "line 3" in note.text


def test_lines_that_hardly_run_together_are_refused(tmp_path):
    facing = all_sets(pitch=0.0, roll=0.0, yaw=np.radians(1.0))
    found = told(tmp_path, facing)
    assert found.camera is None and ("focal length" in found.reason)
    one = told(tmp_path, {"verticals": all_sets()["verticals"]})
    assert one.camera is None and "two" in one.reason


def test_lines_that_coincide_are_refused(tmp_path):
    same = np.tile(all_sets()["parallels"][:1], (3, 1))
    found = told(tmp_path, {"parallels": same, "others": same})
    assert found.camera is None


BAD = (
    "", "[]", "{", "null", '{"verticals": 5}', '{"verticals": [[1, 2, 3]]}', '{"verticals": [["a", 1, 2, 3]]}', '{"lines": []}',
    '{"others": [[1e999, 1, 2, 3], [1, 2, 3, 4]]}', '{"sigma_px": -1, "others": [[1, 2, 3, 4]]}', "[" * 5000,
)  # fmt: skip


@pytest.mark.parametrize("content", BAD, ids=range(len(BAD)))
def test_bad_files_are_an_error_in_one_line(tmp_path, content):
    path = tmp_path / "lines.json"
    path.write_text(content)
    with pytest.raises(FileFormatError) as caught:
        vanishing_points.camera(f"lines=@{path}", photo())
    assert "\n" not in str(caught.value)


def test_bad_lines_and_texts_are_input_errors(tmp_path):
    with pytest.raises(InputError, match="outside"):
        told(tmp_path, {"verticals": [[0, 0, 5000, 5], [1, 2, 3, 4]]})
    with pytest.raises(InputError, match="one point"):
        told(tmp_path, {"verticals": [[5, 5, 5, 5], [1, 2, 3, 4]]})
    with pytest.raises(InputError, match="2 to"):
        told(tmp_path, {"verticals": [[5, 5, 50, 5]]})
    for text in ("lines=file.json", "lines = 5", "lines=[1,2,3,4]"):
        with pytest.raises(InputError):
            resolve_camera(photo(), text)
    with pytest.raises(InputError, match="can't be named"):
        resolve_camera(photo(), "lines=@/etc/passwd", paths=False)
    with pytest.raises(FileFormatError, match="no such file"):
        resolve_camera(photo(), "lines=@nowhere.json")


def test_it_is_a_camera_as_any_other(tmp_path):
    path = tmp_path / "lines.json"
    path.write_text(json.dumps({name: one.tolist() for name, one in all_sets().items()}))
    resolved = resolve_camera(photo(), f"lines=@{path}")
    assert resolved.chosen.source == "vanishing_points" and resolved.camera.f_px == pytest.approx(F, rel=0.02)
    assert resolved.pose.pitch_rad == pytest.approx(PITCH, abs=0.01)


# -- lines that are found ----------------------------------------------------------------------------------------------


def drawn(yaw, pitch, seed=0, count=25):
    """A picture of grey strips along three directions at right angles."""
    import cv2

    pixels = np.full((HEIGHT, WIDTH, 3), 200, np.uint8)
    rng = np.random.default_rng(seed)
    for i, way in enumerate(directions(pitch, ROLL, yaw)):
        for ends in lines(way, count, seed + i):
            a, b = np.round(ends.reshape(2, 2) * 16).astype(int)
            cv2.line(
                pixels, tuple(map(int, a)), tuple(map(int, b)), (int(rng.integers(20, 120)),) * 3, 3, cv2.LINE_AA, 4
            )
    return photo(pixels)


@pytest.mark.parametrize(("yaw", "pitch"), [(40.0, -20.0), (30.0, 15.0), (55.0, -25.0)])
def test_found_lines_hold_the_truth_and_say_that_nobody_looked(yaw, pitch):
    found = vanishing_points.camera("lines", drawn(np.radians(yaw), np.radians(pitch)))
    assert found.camera is not None, found.reason
    assert abs(found.camera.f_px - F) < 2 * found.camera.u_f_px
    assert found.pose.pitch_rad == pytest.approx(np.radians(pitch), abs=0.03)
    assert [n.code for n in found.notes] == ["lines_found"]


@pytest.mark.parametrize("kind", ["blank", "noise", "dot", "disc"])
def test_pictures_without_such_lines_tell_nothing(kind):
    rng = np.random.default_rng(0)
    pixels = np.full((300, 400, 3), 90, np.uint8)
    if kind == "noise":
        pixels = rng.integers(0, 255, (300, 400, 3), np.uint8)
    elif kind == "dot":
        pixels = pixels[:1, :1]
    elif kind == "disc":
        import cv2

        pixels = cv2.circle(np.ascontiguousarray(pixels), (200, 150), 80, (255, 255, 255), -1)
    with pytest.raises(UnknownCameraError):
        resolve_camera(photo(pixels), "lines")


def test_real_pictures_of_known_focal_length_are_right_or_refused(shared_data):
    known = {"metric_depth/rgbd_sequence/00000.jpg": 585.0, "sfm/fountain_P11/0002.jpg": 2759.5, "sfm/fountain_P11/0004.jpg": 2759.5,
             "ground_plane/town_centre/oxford_town_background.png": 2696.4, "exif_intrinsics/kodak_sceaux/100_7100.JPG": 2905.9,
             "metric_depth/kitti/0000000005.png": 721.5, "metric_depth/nyu/rgb_00050.jpg": 518.9}  # fmt: skip
    for path, f in known.items():
        found = vanishing_points.camera("lines", Photo.load(shared_data / path))
        assert found.camera is None or abs(found.camera.f_px - f) < 2 * found.camera.u_f_px, path
