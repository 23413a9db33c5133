"""People, vehicles and things: what stands is measured, what is cut, hidden or askew is not, and nothing is invented."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from onnx_files import constants

from subtense.camera import Camera
from subtense.detection import Search
from subtense.detectors.objects import objects
from subtense.errors import FileFormatError
from subtense.metadata import Metadata
from subtense.networks.kinds import KINDS, kind_of
from subtense.networks.own_detector import COCO_80, own_detector
from subtense.networks.view import View
from subtense.photo import Photo
from subtense.targets import find_target
from subtense.workflow.detect import detect
from subtense.workflow.measure import measure_detections
from subtense.workflow.resolve_camera import resolve_camera

pytestmark = pytest.mark.opencv
HEAD_PX, SOLES_PX = 499.2, 897.2
"""Of the person in street.jpg."""


def photo_of(pixels: np.ndarray) -> Photo:
    return Photo(np.ascontiguousarray(pixels), Metadata(), Path("made.png"), "0")


@pytest.fixture(scope="module")
def street(examples) -> Photo:
    return Photo.load(examples / "street.jpg")


def people(photo: Photo, search: Search | None = None):
    return [one for one in objects(photo, search) if one.label == "person"]


# -- people ------------------------------------------------------------------------------------------


def test_a_standing_person_is_seen_from_head_to_sole_within_sigma(street):
    [person] = people(street)
    (x, head), (_, sole) = person.seen.points_px
    sigma = person.seen.sigma_px
    assert person.target.name == "person"
    assert [other.name for other in person.others] == ["child"]
    assert 640 < x < 700
    assert abs(head - HEAD_PX) < 2 * sigma[0]
    assert abs(sole - SOLES_PX) < 2 * sigma[1]


def test_the_distance_holds_the_truth_and_the_height_dominates_its_budget(street, truth):
    [thing] = [t for t in truth["street.jpg"]["objects"] if t["name"] == "person"]
    range_m = np.mean([point["range_m"] for point in thing["points"]])
    document = measure_detections(detect(street, ["objects"]), street, resolve_camera(street, None), sizes={})
    range_ = document.measurements[0]
    assert range_.low < range_m < range_.high
    assert abs(range_.value - range_m) < 2 * range_.u
    assert max(range_.budget, key=lambda line: line.share).name == "size"
    assert "assumed_size" in [note.code for note in range_.notes]
    assert "child" in next(note.text for note in range_.notes if note.code == "assumed_size")


def test_what_a_person_says_is_there_is_looked_for_alone_and_not_assumed(street):
    man = find_target("man")
    found = detect(street, [], Search(targets=(man,)))
    assert {one.target.name for one in found.detections} == {"man"}
    document = measure_detections(found, street, resolve_camera(street, None), sizes={}, stated=(man,))
    assert "assumed_size" not in [note.code for m in document.measurements for note in m.notes]
    assert objects(street, Search(targets=(find_target("car"),))) == ()
    assert objects(street, Search(targets=(find_target("iris"),))) == ()


@pytest.mark.parametrize("height", [110, 160, 300])
def test_smaller_pictures_give_the_same_person(street, height):
    scale = height / (SOLES_PX - HEAD_PX)
    small = cv2.resize(street.pixels, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    [person] = people(photo_of(small))
    found = np.ptp(person.seen.points_px[:, 1]) / scale
    assert abs(found - (SOLES_PX - HEAD_PX)) < 3 * np.hypot(*person.seen.sigma_px) / scale


def test_mirroring_changes_nothing(street):
    [one], [other] = people(street), people(photo_of(street.pixels[:, ::-1]))
    assert np.allclose(one.seen.points_px[:, 1], other.seen.points_px[:, 1], atol=np.max(one.seen.sigma_px))


def test_a_small_person_in_twelve_million_pixels_is_found(street):
    scale = 130 / (SOLES_PX - HEAD_PX)
    small = cv2.resize(street.pixels, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    large = cv2.resize(street.pixels, (4000, 3000))
    large[1900 : 1900 + len(small), 2500 : 2500 + small.shape[1]] = small
    [person] = [one for one in people(photo_of(large)) if one.seen.points_px[0, 0] > 2500]
    truth = 1900 + scale * np.array([HEAD_PX, SOLES_PX])
    assert person.target is not None
    assert np.all(np.abs(person.seen.points_px[:, 1] - truth) < 3 * person.seen.sigma_px)


@pytest.mark.parametrize("below", [700, 800, 905])
def test_a_person_cut_by_the_border_has_no_size_and_says_so(street, below):
    for person in people(photo_of(street.pixels[:below])):
        assert person.target is None
        assert person.notes[0].code in ("person_cut", "person_not_standing")


def test_a_person_whose_head_is_outside_has_no_size(street):
    assert all(person.target is None for person in people(photo_of(street.pixels[530:])))


@pytest.mark.parametrize("from_row", [700, 780, 840])
def test_a_person_whose_legs_are_hidden_has_no_size(street, from_row):
    pixels = street.pixels.copy()
    pixels[from_row:960, 560:800] = (150, 140, 120)  # a wall before the legs
    assert all(person.target is None for person in people(photo_of(pixels)))


@pytest.mark.parametrize("degrees", [16, -16, 25, 90, 180])
def test_a_person_askew_has_no_size(street, degrees):
    middle = (670.0, 700.0)
    turn = cv2.getRotationMatrix2D(middle, degrees, 1.0)
    turned = cv2.warpAffine(street.pixels, turn, (1800, 1200), borderValue=(128, 128, 128))
    assert all(person.target is None for person in people(photo_of(turned)))


def test_what_is_not_measured_is_told_with_its_reason(street):
    photo = photo_of(street.pixels[:800])
    found = detect(photo, ["objects"])
    assert found.detections
    document = measure_detections(found, photo, resolve_camera(photo, "f=1829 px"), sizes={})
    assert document.measurements == ()
    assert {"person_cut", "size_unknown"} <= {note.code for note in document.notes}


# -- nothing is invented -----------------------------------------------------------------------------


@pytest.mark.parametrize("shape", [(1, 1), (2, 3000), (3000, 3), (40, 60), (700, 900)])
@pytest.mark.parametrize("fill", ["black", "gray", "noise", "ramp"])
def test_empty_pictures_give_nothing(shape, fill):
    pixels = np.zeros((*shape, 3), np.uint8)
    if fill == "gray":
        pixels[:] = 128
    elif fill == "noise":
        pixels = np.random.default_rng(5).integers(0, 256, pixels.shape, dtype=np.uint8)
    elif fill == "ramp":
        pixels[:] = np.linspace(0, 255, shape[1])[None, :, None].astype(np.uint8)
    assert objects(photo_of(pixels)) == ()


def test_progress_never_goes_back(street):
    told: list[float] = []
    objects(photo_of(street.pixels[::3, ::3]), Search(progress=told.append))
    assert told == sorted(told)
    assert min(told) >= 0
    assert max(told) <= 1


# -- things and vehicles -----------------------------------------------------------------------------


def test_every_kind_has_a_row_that_is_one_length():
    for kind in KINDS:
        for name in (kind.target, *kind.others, *kind.stated):
            assert not name or find_target(name).shape == "length"
        assert all(kind_of(word.upper()).name for word in kind.words)


def test_a_mug_on_a_desk_holds_the_truth(examples, truth):
    """Its middle stands at (0.245, 0.225, 0.048) m of the scene (tools/render_scenes.py), and is seen from 45 degrees above."""
    photo = Photo.load(examples / "desk.jpg")
    place = truth["desk.jpg"]["camera_from_world"]
    mug = np.array(place["rotation"]) @ [0.245, 0.225, 0.048] + np.array(place["translation_m"])
    document = measure_detections(detect(photo, ["objects"]), photo, resolve_camera(photo, None), sizes={})
    range_ = document.measurements[0]
    assert range_.label == "cup"
    assert abs(range_.value - np.linalg.norm(mug)) < 2 * range_.u


def kitti_depths(folder: Path, names: tuple[str, ...]):
    """Depth of each detection of a picture, with labels as (box, nearest depth, depth of the middle)."""
    for picture, calibration, labels in names:
        photo = Photo.load(folder / picture)
        text = (folder / calibration).read_text()
        line = next((row for row in text.splitlines() if row.startswith("P2:")), text.splitlines()[0])
        f, cx, cy = (float(line.removeprefix("P2:").split()[k]) for k in (0, 2, 6))
        camera = Camera(photo.width_px, photo.height_px, f, cx, cy, cov=np.diag([(0.003 * f) ** 2, 0, 1, 1]))
        yield photo, camera, [row.split() for row in (folder / labels).read_text().splitlines()]


def test_labelled_cars_and_a_pedestrian_are_held(shared_data):
    """A car's near end lies half its length before its middle, or half its width."""
    pictures = (
        ("known_size/kitti/image_2/000000.png", "known_size/kitti/calib/000000.txt", "known_size/kitti/label_2/000000.txt"),
        ("ground_plane/kitti_lidar/000008.png", "ground_plane/kitti_lidar/000008_P2.txt", "ground_plane/kitti_lidar/000008_label.txt"),
    )  # fmt: skip
    checked = []
    for photo, camera, labels in kitti_depths(shared_data, pictures):
        document = measure_detections(
            detect(photo, ["objects"]), photo, resolve_camera(photo, f"f={float(camera.f_px)} px"), sizes={}
        )
        for depth, shape in zip([m for m in document.measurements if m.what == "depth"], document.shapes, strict=True):
            x, y = np.mean(shape.points_px, axis=0)
            for row in labels:
                left, top, right, bottom = map(float, row[4:8])
                if row[0] in ("Car", "Pedestrian") and left < x < right and top < y < bottom and float(row[1]) < 0.1:
                    middle, near = float(row[13]), float(row[13]) - max(map(float, row[9:11])) / 2
                    assert depth.low < middle
                    assert depth.high > near
                    assert abs(depth.value - (near if row[0] == "Car" else middle)) < 3 * depth.u
                    checked.append(row[0])
                    break
    assert {"Car", "Pedestrian"} <= set(checked)
    assert len(checked) >= 4


# -- a detector of one's own -------------------------------------------------------------------------

BOX = (20.0, 12.0, 44.0, 52.0)
"""Left, top, right, bottom edge in an input of 64 px."""
CENTRED = (32.0, 32.0, 24.0, 40.0)
BUS = COCO_80.index("bus")


def rows_of(count: int, columns: int, **first: float) -> np.ndarray:
    """(1, count, columns) of nothing, but for the first row: its columns by number."""
    table = np.zeros((1, count, columns), np.float32)
    table[0, :, :4] = 5.0
    table[0, 0, :4] = CENTRED
    for column, value in first.items():
        table[0, 0, int(column[1:])] = value
    return table


def detr(classes: int, label: int, *, softmax: bool) -> dict[str, np.ndarray]:
    logits = np.full((1, 20, classes), -8.0, np.float32)
    if softmax:
        logits[0, 1:, -1] = 8.0
    logits[0, 0, label] = 4.0
    boxes = np.full((1, 20, 4), 0.1, np.float32)
    boxes[0, 0] = np.array(CENTRED) / 64
    return {"logits": logits, "pred_boxes": boxes}


FAMILIES = {
    "v5": {"output0": rows_of(300, 85, c4=0.9, c10=0.95)},
    "v8": {"output0": np.moveaxis(rows_of(300, 84, c9=0.9), 1, 2)},
    "end to end": {"output0": np.concatenate([np.array([[[*BOX, 0.9, BUS]]], np.float32), np.zeros((1, 299, 6), np.float32)], 1)},
    "detr": detr(92, 6, softmax=True),
    "rt-detr": detr(80, BUS, softmax=False),
    "rf-detr": detr(91, 6, softmax=False),
}  # fmt: skip


def seen_by(path: Path):
    own = own_detector(path)
    return own.look(View(np.zeros((own.size_px, own.size_px, 3)), np.eye(2, 3)))


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("free", [False, True])
def test_the_families_are_told_by_their_shapes(tmp_path, family, free):
    [thing] = seen_by(constants(tmp_path / "own.onnx", FAMILIES[family], free=free))
    assert thing.label == "bus"
    assert thing.score > 0.8
    assert np.allclose(thing.box_px, np.array(BOX) - 0.5, atol=0.01)  # edges; pixel 0 is a centre


def test_names_come_from_the_file(tmp_path):
    table = np.moveaxis(rows_of(100, 6, c5=0.8), 1, 2)
    path = constants(tmp_path / "two.onnx", {"output0": table}, names="{0: 'gate', 1: 'Bottle'}")
    assert [thing.label for thing in seen_by(path)] == ["Bottle"]
    path = constants(tmp_path / "one.onnx", {"output0": rows_of(2000, 6, c4=0.9, c5=0.9)}, names='["gate"]')
    assert [thing.label for thing in seen_by(path)] == ["gate"]
    unnamed = constants(tmp_path / "none.onnx", {"output0": table})
    assert [thing.label for thing in seen_by(unnamed)] == ["class 1"]


@pytest.mark.parametrize("inputs", [
    {"x": ("uint8", (1, 64, 64, 3))}, {"x": ("float32", ("batch", 3, "height", "width"))},
    {"x": ("float32", (1, 3, 64, 64)), "mask": ("int64", (1, 64, 64))},
    {"x": ("float32", (1, 3, 64, 64)), "sizes": ("int64", (1, 2))},
])  # fmt: skip
def test_inputs_of_other_layouts_are_served(tmp_path, inputs):
    assert seen_by(constants(tmp_path / "own.onnx", FAMILIES["rt-detr"], inputs=inputs))[0].label == "bus"


@pytest.mark.parametrize("outputs", [
    {"y": np.zeros((1, 1000), np.float32)}, {"y": np.zeros((1, 3, 64, 64), np.float32)}, {"y": np.zeros((1, 4, 300), np.float32)},
    {"a": np.zeros((1, 20, 4), np.float32), "b": np.zeros((1, 30, 80), np.float32)},
    {"a": np.zeros((1, 20, 4), np.float32), "b": np.zeros((1, 20, 80), np.float32), "c": np.zeros((1, 20), np.float32)},
])  # fmt: skip
def test_other_networks_are_refused_in_one_line_with_what_is_known(tmp_path, outputs):
    path = constants(tmp_path / "other.onnx", outputs)
    with pytest.raises(FileFormatError, match=r"known are \(1, N, 5 \+ C\)") as caught:
        objects(photo_of(np.zeros((64, 64, 3), np.uint8)), Search(model=path))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "inputs", [{"x": ("float32", (1, 10))}, {"x": ("float32", (1, 3, 64, 96))}, {"x": ("float32", (1, 1, 64, 64))}]
)
def test_networks_that_take_no_square_picture_are_refused(tmp_path, inputs):
    path = constants(tmp_path / "other.onnx", FAMILIES["v8"], inputs=inputs)
    with pytest.raises(FileFormatError, match="one square picture"):
        own_detector(path)


def test_files_that_are_no_network_and_numbers_that_are_none_are_refused(tmp_path):
    path = tmp_path / "text.onnx"
    path.write_text("no network")
    with pytest.raises(FileFormatError, match="neither"):
        objects(photo_of(np.zeros((64, 64, 3), np.uint8)), Search(model=path))
    values = FAMILIES["v8"]["output0"].copy()
    values[0, 0, 3] = np.nan
    with pytest.raises(FileFormatError, match="not finite"):
        seen_by(constants(tmp_path / "nan.onnx", {"output0": values}))


def two_boxes(tmp_path: Path, *boxes: tuple[str, tuple[float, float, float, float]]) -> Path:
    table = np.zeros((1, 50, 6), np.float32)
    for row, (label, box) in enumerate(boxes):
        table[0, row] = [*box, 0.9, COCO_80.index(label)]
    return constants(tmp_path / "boxes.onnx", {"output0": table})


def found_by(path: Path):
    return {one.label: one for one in objects(photo_of(np.full((64, 64, 3), 90, np.uint8)), Search(model=path))}


def test_a_whole_bus_is_measured_and_an_unknown_thing_only_shown(tmp_path):
    found = found_by(two_boxes(tmp_path, ("bus", (8, 20, 36, 44)), ("clock", (44, 8, 58, 26))))
    assert found["bus"].target.name == "bus"
    assert [note.code for note in found["bus"].notes] == ["level_view_assumed"]
    assert found["clock"].target is None


def test_a_vehicle_at_the_border_or_behind_another_is_not_measured(tmp_path):
    found = found_by(two_boxes(tmp_path, ("bus", (0, 20, 28, 44))))
    assert [note.code for note in found["bus"].notes] == ["object_cut"]
    found = found_by(two_boxes(tmp_path, ("bus", (10, 14, 40, 44)), ("car", (22, 30, 54, 54))))
    assert found["bus"].target is None
    assert "nearer" in found["bus"].notes[0].text
    assert found["car"].target.name == "car"


def test_a_box_of_another_shape_than_the_thing_is_not_measured(tmp_path):
    found = found_by(two_boxes(tmp_path, ("car", (26, 10, 38, 54))))
    assert found["car"].target is None
    assert "shaped" in found["car"].notes[0].text
