"""The example pictures against their truth: every interval holds it."""

import numpy as np
import pytest

from subtense import Photo, Quantity, measure_lines, measure_markers
from subtense.observation import Observation

pytestmark = pytest.mark.opencv


def points(picture, name):
    return {p["name"]: p for p in next(o for o in picture["objects"] if o["name"] == name)["points"]}


def middle(*ends):
    return np.mean([p["camera_m"] for p in ends], axis=0)


def holds(document, camera_m, most_u=3.0):
    found = {m.what: m for m in document.measurements}
    for what, true in (("range", np.linalg.norm(camera_m)), ("depth", camera_m[2])):
        m = found[what]
        assert m.low <= true <= m.high, f"{what} {true} not in [{m.low}, {m.high}]"
        assert abs(m.value - true) < most_u * m.u
    return found


def test_desk_marker(examples, truth):
    corners = points(truth["desk.jpg"], "marker")
    document = measure_markers(Photo.load(examples / "desk.jpg"), Quantity.interval(0.05, 0.0002, "m"))
    assert [m.label for m in document.measurements] == ["36h11 id 7"] * 3
    holds(document, middle(*corners.values()))


def test_desk_marker_with_the_true_camera(examples, truth, tmp_path):
    """What is left are the corners: 0.2 %."""
    import json

    t = truth["desk.jpg"]["camera"]
    camera = {
        "width_px": 1600,
        "height_px": 1200,
        "lens": "brown_conrady",
        **{k: t[k] for k in ("f_px", "aspect", "cx_px", "cy_px")},
    }
    path = tmp_path / "camera.json"
    path.write_text(json.dumps({**camera, "distortion": t["distortion"], "cov": np.zeros((9, 9)).tolist()}))
    photo = Photo.load(examples / "desk.jpg")
    document = measure_markers(photo, Quantity.exact(0.05, "m"), camera=str(path))
    true = middle(*points(truth["desk.jpg"], "marker").values())
    found = holds(document, true)
    assert found["range"].value == pytest.approx(np.linalg.norm(true), rel=0.002)
    assert found["range"].u / found["range"].value < 0.004


@pytest.mark.parametrize(("side", "wrong"), [("50 mm", False), ("62.5 mm", True), ("49 mm", False)])
def test_a_marker_measured_with_its_border_is_told_by_the_sheet_beside_it(examples, side, wrong):
    """A tag of 8 cells with its white border is 10/8 as large, and so is every distance by it."""
    from subtense.workflow.found import Asked
    from subtense.workflow.measure_input import measure_document

    document = measure_document(Photo.load(examples / "desk.jpg"), marker_size=side, asked=Asked(targets=("a4",)))
    assert [note.code for note in document.notes if note.code == "size_convention"] == ["size_convention"] * wrong
    assert {m.label for m in document.measurements} == {"36h11 id 7", "a4"}


@pytest.mark.parametrize(
    ("file", "thing", "ends", "size"),
    [
        ("belt.jpg", "package_top", ("left_edge_middle", "right_edge_middle"), 0.200),
        ("street.jpg", "person", ("soles", "head_top"), 1.75),
        ("street.jpg", "car_rear", ("bottom_left", "bottom_right"), 1.80),
        ("facade.jpg", "door", ("bottom_left", "top_left"), 2.10),
    ],
)
def test_lines_of_known_size(examples, truth, file, thing, ends, size):
    known = points(truth[file], thing)
    pair = [known[name] for name in ends]
    rng = np.random.default_rng(1)
    clicked = np.array([p["pixel_px"] for p in pair]) + rng.normal(0, 0.5, (2, 2))
    document = measure_lines(
        Photo.load(examples / file), [Observation(clicked)], [Quantity.interval(size, 0.005 * size, "m")]
    )
    holds(document, middle(*pair))


def test_pictures_turned_by_exif_have_the_camera_of_the_upright_picture(examples, truth):
    photo = Photo.load(examples / "facade.jpg")
    assert (
        (photo.width_px, photo.height_px)
        == (truth["facade.jpg"]["width_px"], truth["facade.jpg"]["height_px"])
        == (1200, 1800)
    )
