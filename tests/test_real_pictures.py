"""Real pictures with truth, never tuned to; skipped where the data is not at hand."""

import csv
import json

import numpy as np
import pytest
from click.testing import CliRunner

from subtense import Photo, Quantity, UnknownCameraError, measure_lines, resolve_camera
from subtense.cli import main
from subtense.observation import Observation

pytestmark = pytest.mark.opencv


def ends_of_green(photo):
    """Left and right end of the green strips, as the sub-pixel places where the mask's columns begin and end."""
    rgb = photo.pixels.astype(int)
    green = (rgb[..., 1] > 100) & (rgb[..., 1] > rgb[..., 0] + 80)  # the lit strips, not their glow
    columns = np.flatnonzero(green.sum(axis=0) >= 2)
    rows = np.flatnonzero(green.sum(axis=1) >= 1)
    y = float(rows.mean())
    return np.array([[columns[0] - 0.5, y], [columns[-1] + 0.5, y]])


def test_frc_2019_targets_by_their_width(shared_data):
    folder = shared_data / "known_size" / "frc2019"
    truth = json.loads((folder / "truth.json").read_text())
    size = Quantity.interval(truth["known_width_m"], 0.002, "m")
    for name, distance in truth["images"].items():
        photo = Photo.load(folder / name)
        document = measure_lines(
            photo, [Observation(ends_of_green(photo), 0.7)], [size], camera=f"f={truth['f_px']} ± 3 px"
        )
        depth = next(m for m in document.measurements if m.what == "depth")
        assert depth.value == pytest.approx(distance, rel=0.025), name
        assert depth.low < distance < depth.high, name


def april_vision(folder, tmp):
    """The calibration file of the april_vision pictures, written to `tmp`, and (picture, true range in m) of each."""
    camera = {"width_px": 800, "height_px": 800, "f_px": 1293.0912575, "cx_px": 399.5, "cy_px": 399.5}
    path = tmp / "camera.json"
    path.write_text(json.dumps({**camera, "cov": np.zeros((4, 4)).tolist()}))
    rows = {int(row["Index"]): row for row in csv.DictReader((folder / "locations.csv").read_text().splitlines())}
    return path, [(p, float(rows[int(p.stem[-3:])]["r"])) for p in sorted(folder.glob("img-*.png"))]


def test_april_vision_tags_by_the_command_line(shared_data, tmp_path):
    camera, pictures = april_vision(shared_data / "fiducial" / "april_vision_synth", tmp_path)
    errors = []
    for path, true in pictures:
        words = [
            "measure",
            path,
            "--marker-size",
            "200 mm exact",
            "--camera",
            camera,
            "--format",
            "json",
        ]
        result = CliRunner().invoke(main, [str(w) for w in words], catch_exceptions=False)
        found = json.loads(result.output)["measurements"][0]
        assert found["label"] == "36h11 id 14"
        errors.append(found["value"] - true)
    assert len(errors) == 18
    assert max(map(abs, errors)) < 0.001
    assert np.std(errors) < 0.0003  # the tag's face stands 0.6 mm nearer than the list says in all of them


@pytest.mark.parametrize(
    ("file", "f_px"),
    [
        ("exif_intrinsics/iphone8plus/IMG_1443.jpg", 3280.1),
        ("exif_intrinsics/kodak_sceaux/100_7100.JPG", 2905.88),
        ("ground_plane/drone_nadir/DJI_0024.JPG", 2344.0),
    ],
)
def test_the_calibrated_focal_length_lies_in_the_interval_from_the_metadata(shared_data, file, f_px):
    camera = resolve_camera(Photo.load(shared_data / file)).camera
    assert abs(camera.f_px - f_px) < 1.96 * camera.u_f_px


@pytest.mark.parametrize("given", ["rpi-v1", "sensor=3.67mm"])
def test_a_16_9_mode_of_a_raspberry_pi_is_in_the_interval(shared_data, given):
    """Its maker's sensor width and focal length are 8 % off in this mode; the squares on the board told 1748 px."""
    found = resolve_camera(Photo.load(shared_data / "known_size" / "agridrone" / "30cm.jpg"), given)
    assert "aspect_mismatch" in [note.code for note in found.notes]
    assert abs(found.camera.f_px - 1748) < 1.96 * found.camera.u_f_px


def test_the_drone_tells_how_it_hung(shared_data):
    folder = shared_data / "ground_plane" / "drone_nadir"
    heights = [resolve_camera(Photo.load(folder / f"DJI_00{n}.JPG")).pose for n in (24, 25)]
    assert [pose.height_m for pose in heights] == json.loads((folder / "truth.json").read_text())["relative_altitude"]
    for pose in heights:
        assert np.degrees([pose.pitch_rad, pose.roll_rad]) == pytest.approx([-89.9, 0])


def test_a_phone_tells_that_it_looked_down(shared_data):
    """The sheet's vertical edges, clicked by hand, meet below the picture: the camera looked 20 to 25 degrees down."""
    pose = resolve_camera(Photo.load(shared_data / "exif_intrinsics" / "iphone8plus" / "IMG_1443.jpg")).pose
    assert -27 < np.degrees(pose.pitch_rad) < -19 and abs(np.degrees(pose.roll_rad)) < 3


def test_every_exif_sample_gives_a_camera_or_a_named_reason(shared_data):
    for path in sorted((shared_data / "exif_intrinsics" / "exif_samples").glob("*.jpg")):
        photo = Photo.load(path)
        found, reason = _camera_or_reason(photo)
        if found is None:
            assert path.name in reason and not photo.metadata.f35_mm
        else:
            assert 0.005 < found.u_f_px / found.f_px < 0.3


def _camera_or_reason(photo):
    try:
        return resolve_camera(photo).camera, ""
    except UnknownCameraError as error:
        return None, str(error)


def test_pictures_stored_in_all_orientations_are_upright(shared_data):
    for kind, upright in (("landscape", (600, 450)), ("portrait", (450, 600))):
        photos = [
            Photo.load(p) for p in sorted((shared_data / "exif_intrinsics" / "exif_samples").glob(f"{kind}_*.jpg"))
        ]
        assert {(p.width_px, p.height_px) for p in photos} == {upright}
        cameras = [resolve_camera(p, "fov=60 ± 1 deg").camera for p in photos]
        assert {(c.width_px, c.height_px, c.f_px, c.cx_px, c.cy_px) for c in cameras} == {
            (*upright, cameras[0].f_px, (upright[0] - 1) / 2, (upright[1] - 1) / 2)
        }
        first = photos[0].pixels.astype(float)
        assert all(np.corrcoef(first.ravel(), p.pixels.astype(float).ravel())[0, 1] > 0.9 for p in photos)


def test_aruco_markers_of_the_tutorials_are_found(shared_data):
    from subtense.detectors.markers import markers

    found = markers(Photo.load(shared_data / "fiducial" / "opencv_aruco" / "singlemarkersoriginal.jpg"))
    assert {o.label for o in found} == {f"6x6 id {n}" for n in (23, 40, 62, 98, 124, 203)}


def test_two_markers_of_one_number_are_told_apart(shared_data):
    from subtense import measure_markers

    picture = shared_data / "fiducial" / "nasa_corners" / "33369213973_9d9bb4cc96_c.jpg"
    document = measure_markers(Photo.load(picture), Quantity.interval(0.1651, 0.0005, "m"), camera="fov=60 ± 5 deg")
    labels = [m.label for m in document.measurements if m.what == "range"]
    assert len(labels) == len(set(labels)) >= 2
