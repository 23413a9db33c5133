"""A calibration file and the photo it is given for: turned, resized, doubted."""

import json

import numpy as np
import pytest
from PIL import Image

from subtense.camera import Camera
from subtense.camera_files import formats
from subtense.camera_files.reading import Found
from subtense.errors import FileFormatError
from subtense.photo import Photo
from subtense.workflow.resolve_camera import SentFile, resolve_camera

COV = np.diag([1.2, 0.0005, 0.8, 0.9, 0.002, 0.01, 0.0001, 0.0002, 0.001]) ** 2
CAMERA = Camera(64, 48, 90.0, 30.0, 25.0, 1.01, "brown_conrady", np.array([-0.1, 0.02, 0.003, -0.002, 0.001]), COV)
SPOT = (40, 10)


@pytest.fixture
def take(tmp_path):
    """A photo of one white pixel, stored at SPOT in 64 x 48 px, with this orientation."""

    def make(orientation=1, size=(64, 48), spot=SPOT):
        exif = Image.Exif()
        exif[0x0112] = orientation
        picture = Image.new("RGB", size)
        picture.putpixel(spot, (255, 255, 255))
        picture.save(tmp_path / "a.png", exif=exif)
        return Photo.load(tmp_path / "a.png")

    return make


def of(camera=CAMERA, **more):
    return SentFile("c.json", json.dumps({"camera": camera.to_json(), **more}).encode())


def codes(found):
    return [note.code for note in found.notes if note.code.startswith(("calibration", "model"))]


@pytest.mark.parametrize(("orientation", "turns"), [(6, 1), (8, 3), (3, 2)])
def test_a_calibration_of_the_stored_picture_is_turned_with_it(take, orientation, turns):
    photo = take(orientation)
    found = resolve_camera(photo, of(**({"frame": "stored"} if orientation == 3 else {})))
    assert codes(found) == (
        [] if orientation == 3 else ["calibration_turned"]
    )  # the file itself says so, or it is told
    row, column = np.argwhere(photo.pixels[..., 0] == 255)[0]
    x, y, z = CAMERA.rays(np.array([SPOT], float))[0]
    for _ in range(turns):
        x, y = -y, x  # clockwise, with y down
    assert found.camera.rays(np.array([[column, row]], float))[0] == pytest.approx([x, y, z], abs=1e-12)
    assert found.camera.u_f_px > 1


def test_where_sizes_tie_it_is_taken_as_upright(take):
    found = resolve_camera(take(3), of())
    assert (codes(found), found.camera.cx_px) == ([], CAMERA.cx_px)
    upright = Camera(48, 64, 90.0, 24.0, 31.0, cov=np.zeros((4, 4)))
    assert codes(resolve_camera(take(6), of(upright))) == []


def test_an_upright_calibration_is_not_turned(take):
    with pytest.raises(
        FileFormatError, match=r"it is for 64 x 48 px, and the photo has 48 x 64 px \(it is turned by a quarter\)"
    ):
        resolve_camera(take(6), of(frame="upright"))


@pytest.mark.parametrize("orientation", [5, 7])
def test_mirrored_pictures_are_refused(take, orientation):
    with pytest.raises(FileFormatError, match=rf"the photo's orientation \({orientation}\) mirrors that"):
        resolve_camera(take(orientation), of())


def test_turned_and_resized(take):
    found = resolve_camera(take(6, (128, 96)), of())
    assert codes(found) == ["calibration_turned", "calibration_size_mismatch"]
    assert (found.camera.width_px, found.camera.height_px) == (96, 128)
    assert found.camera.f_px == pytest.approx(2 * 90 * 1.01)


def test_other_proportions_are_refused(take):
    with pytest.raises(
        FileFormatError, match="it is for 64 x 48 px, and the photo has 64 x 40 px; calibrate at the photo's size"
    ):
        resolve_camera(take(1, (64, 40)), of())


def test_doubts_go_with_the_camera(take):
    doubt = {"code": "model_error", "message": "misfits of 0.4 px\nat the edges", "cure": "another lens model"}
    chosen = {"code": "camera_source", "text": "x was chosen", "cure": ""}
    found = resolve_camera(take(), of(notes=[doubt, chosen]))
    note = next(n for n in found.notes if n.code == "model_error")
    assert (note.text, note.cure) == ("misfits of 0.4 px at the edges", "another lens model")
    assert "camera_source" not in [n.code for n in found.chosen.notes]


@pytest.mark.parametrize(
    "notes",
    [{}, [1], [{"code": 1, "message": "a"}], [{"code": "a"}], [{"code": "a", "message": "b", "cure": 1}], [{}] * 51],
)
def test_notes_of_the_wrong_kind_are_refused(take, notes):
    with pytest.raises(FileFormatError, match="note"):
        resolve_camera(take(), of(notes=notes))


def test_a_file_without_uncertainty_has_it_assumed(take, tmp_path):
    path = tmp_path / "c.yml"
    path.write_bytes(formats.write(Found(CAMERA), "opencv"))
    found = resolve_camera(take(), str(path))
    assert codes(found) == ["calibration_without_uncertainty"]
    assert found.camera.u_f_px == pytest.approx(0.005 * 90)
    assert found.camera.coefficients.tolist() == CAMERA.coefficients.tolist()


def test_what_a_file_lacks_stands_behind_its_name(take, tmp_path):
    text = "M1: [90, 0, 30, 0, 90, 20, 0, 0, 1]\nM2: [95, 0, 30, 0, 95, 20, 0, 0, 1]\n"
    (tmp_path / "stereo.yml").write_text(text)
    assert resolve_camera(take(), f"{tmp_path}/stereo.yml#M2,64x48").camera.f_px == 95
    assert resolve_camera(take(), SentFile("stereo.yml#64x48,M1", text.encode())).camera.f_px == 90
    with pytest.raises(FileFormatError, match=r"stereo\.yml#M1"):
        resolve_camera(take(), f"{tmp_path}/stereo.yml")


@pytest.mark.parametrize("ending", [".yml", ".xml", ".txt", ".bin", ".cameramodel", ".json", ""])
def test_a_missing_file_is_named(take, ending):
    with pytest.raises((FileFormatError, ValueError), match="nowhere"):
        resolve_camera(take(), f"nowhere{ending}")
