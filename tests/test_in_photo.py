"""Any method in a photo, by what a page or a project file says."""

import json
import math

import numpy as np
import pytest

from subtense import METHODS, Photo, UnknownCameraError, propagate, resolve_camera
from subtense.camera import Camera
from subtense.errors import GeometryError, InputError
from subtense.observation import Observation
from subtense.quantity import Quantity
from subtense.workflow.given import given
from subtense.workflow.in_photo import Item, item_inputs, measure_item, measure_items

PERSON = "672,897;668,499"
NO_CAMERA = UnknownCameraError("street.jpg: no camera", (("exif_35mm", "nothing"),))


@pytest.fixture(scope="module")
def street(examples):
    return Photo.load(examples / "street.jpg")


@pytest.fixture(scope="module")
def desk(examples):
    return Photo.load(examples / "desk.jpg")


@pytest.fixture(scope="module")
def camera(street):
    return resolve_camera(street)


def item(method, label="", **inputs):
    return Item(METHODS[method], inputs, label)


KNOWN_SIZE = item("known_size", ends=PERSON, size="1.75 m")
KNOWN_DISTANCE = item("known_distance", ends=PERSON, distance="8.09 m")
SAME_PLANE = item("same_plane", reference="940,545;1174,544", ends="940,545;941,704", length="1.8 m")


def test_a_person_on_the_street(street, camera, truth):
    points = {p["name"]: p for p in next(o for o in truth["street.jpg"]["objects"] if o["name"] == "person")["points"]}
    soles, top = (np.array(points[name]["camera_m"]) for name in ("soles", "head_top"))
    range_m, size_m = np.linalg.norm((soles + top) / 2), np.linalg.norm(soles - top)
    far = measure_item(KNOWN_SIZE, street, camera).measurements[0]
    assert far.low < range_m < far.high
    tall = measure_item(item("known_distance", ends=PERSON, distance=f"{range_m} m"), street, camera).measurements[0]
    assert tall.low < size_m < tall.high


def test_a_car_beside_its_number_plate(street, camera, truth):
    objects = {
        o["name"]: {p["name"]: p for p in o["points"]} for o in truth["street.jpg"]["objects"] if o["name"] != "person"
    }
    ends = [objects[name][corner] for name in ("number_plate", "car_rear") for corner in ("top_left", "top_right")]
    pixels = np.array([p["pixel_px"] for p in ends])
    metres = np.array([p["camera_m"] for p in ends])
    asked = item(
        "same_plane", reference=Observation(pixels[:2], 0.3), ends=Observation(pixels[2:], 0.3),
        length=Quantity.exact(float(np.linalg.norm(metres[1] - metres[0])), "m"), turn="0 ± 5 deg", tip="0 ± 5 deg",
    )  # fmt: skip
    wide = measure_item(asked, street, camera).measurements[0]
    assert wide.low < np.linalg.norm(metres[3] - metres[2]) < wide.high


def test_typed_numbers_get_the_defaults_of_their_field(street, camera):
    inputs = item_inputs(KNOWN_SIZE, street, camera)
    assert float(inputs.size.u) == pytest.approx(0.005 * 1.75)
    assert inputs.size.source == "assumed: 0.5 %"
    assert float(inputs.ends.sigma_px) == 0.7
    assert inputs.ends.source.startswith("assumed")
    assert inputs.camera is camera.camera


@pytest.mark.parametrize(
    ("asked", "field", "metres"),
    [
        (item("known_size", ends=PERSON, size="1750"), "size", 1.75),
        (item("known_distance", ends=PERSON, distance="8090"), "distance", 8.09),
    ],
)
def test_a_bare_number_is_millimetres(street, camera, asked, field, metres):
    assert float(getattr(item_inputs(asked, street, camera), field).value) == pytest.approx(metres)


def test_a_bare_angle_is_degrees_and_a_stated_doubt_is_kept(street, camera):
    asked = item("known_size", ends=f"{PERSON} ± 2px", size="1.75 ± 0.03 m", tilt="10")
    inputs = item_inputs(asked, street, camera)
    assert float(inputs.tilt.value) == pytest.approx(math.radians(10))
    assert float(inputs.tilt.u) == pytest.approx(math.radians(0.5) / math.sqrt(3))  # half the last digit, as limits
    assert float(inputs.size.u) == pytest.approx(0.03 / 1.96, rel=1e-3)
    assert float(inputs.ends.sigma_px) == pytest.approx(2 / 1.96, rel=1e-3)


@pytest.mark.parametrize(
    ("asked", "angles"), [(KNOWN_SIZE, ["tilt"]), (KNOWN_DISTANCE, ["tilt"]), (SAME_PLANE, ["turn", "tip"])]
)
def test_in_a_photo_an_angle_of_which_nothing_is_said_is_within_20_degrees(street, camera, asked, angles):
    inputs = item_inputs(asked, street, camera)
    for name in angles:
        tilt = getattr(inputs, name)
        assert tilt.distribution.name == "uniform"
        assert float(tilt.u) == pytest.approx(math.radians(20) / math.sqrt(3))
    assert "unknown_tilt" in {n.code for n in measure_item(asked, street, camera).measurements[0].notes}


def test_without_a_photo_it_faces_the_camera():
    seen = {"ends": Observation(np.array([[500.0, 600.0], [900.0, 600.0]])), "size": Quantity.exact(0.2, "m")}
    inputs = item_inputs(item("known_size", camera=Camera(1600, 1200, 1500.0, 800.0, 600.0), **seen), None, None)
    assert (float(inputs.tilt.value), float(inputs.tilt.u)) == (0.0, 0.0)


@pytest.mark.parametrize(
    ("asked", "field"),
    [
        (item("known_size", ends="672,897;668,-1", size="2 m"), "ends"),
        (item("known_distance", ends="672,897;1799.6,9", distance="2 m"), "ends"),
        (item("same_plane", reference="9,9;9,1199.6", ends=PERSON, length="2 m"), "reference"),
        (item("same_plane", reference=PERSON, ends="-0.6,9;9,9", length="2 m"), "ends"),
    ],
)
def test_points_outside_the_picture_are_refused(street, camera, asked, field):
    with pytest.raises(InputError, match=f"^{field} is .*1800 x 1200 px"):
        measure_item(asked, street, camera)


def test_the_outermost_edge_of_the_picture_is_inside(street, camera):
    item_inputs(item("known_size", ends="-0.5,-0.5;1799.5,1199.5", size="2 m"), street, camera)


@pytest.mark.parametrize(
    ("asked", "says"),
    [
        (item("known_size", ends=PERSON), "also needs size"),
        (item("known_size", ends=PERSON, size="2 m", colour="red"), "known_size takes camera, ends"),
        (item("known_size", ends=PERSON, size="2 px"), "size is '2 px'"),
        (item("known_size", ends="1,2,3", size="2 m"), "ends is '1,2,3'"),
        (item("known_size", ends="1,2;3,4;5,6", size="2 m"), "ends is '3 points'; give 2"),
        (item("same_plane", reference="1,2;3,4", ends="5,6", length="2 m"), "ends is '1 points'; give 2"),
        (item("known_size", ends=PERSON, size=7), "size is 7"),
        (item("known_size", ends=PERSON, size={"value": 2}), "size is 'KeyError'"),
    ],
)
def test_what_cannot_be_read_is_named(street, camera, asked, says):
    with pytest.raises(InputError, match=says):
        measure_item(asked, street, camera)


@pytest.mark.parametrize("asked", [KNOWN_SIZE, KNOWN_DISTANCE])
def test_a_method_that_needs_a_camera_says_why_there_is_none(street, asked):
    with pytest.raises(UnknownCameraError) as caught:
        measure_item(asked, street, NO_CAMERA)
    assert caught.value.tried == NO_CAMERA.tried


def test_a_method_that_can_do_without_takes_parallel_rays(street, camera):
    without = measure_item(SAME_PLANE, street, NO_CAMERA)
    assert "parallel_rays" in {n.code for n in without.measurements[0].notes}
    assert without.camera is None
    assert "camera" not in without.measurements[0].given or without.measurements[0].given["camera"] is None
    seen = measure_item(SAME_PLANE, street, camera)
    assert "parallel_rays" not in {n.code for n in seen.measurements[0].notes}
    assert seen.camera["f_px"] == pytest.approx(float(camera.camera.f_px))


def test_a_stated_camera_goes_before_that_of_the_photo(street, camera):
    own = Camera(1800, 1200, 1829.0, 899.5, 599.5)
    inputs = item_inputs(item("known_size", ends=PERSON, size="1.75 m", camera=own.to_json()), street, camera)
    assert float(inputs.camera.f_px) == 1829.0


def test_one_item_is_what_the_method_says(street, camera):
    document = measure_item(item("known_size", "person", ends=PERSON, size="1.75 m"), street, camera)
    inputs = item_inputs(KNOWN_SIZE, street, camera)
    wanted = propagate.measure(METHODS["known_size"], inputs)
    assert [(m.what, m.value, m.u, m.low, m.high) for m in document.measurements] == [
        (m.what, m.value, m.u, m.low, m.high) for m in wanted
    ]
    assert {m.label for m in document.measurements} == {"person"}
    assert document.measurements[1].notes == ()
    assert document.measurements[0].improve
    assert document.photo["name"] == "street.jpg"
    [shape] = document.shapes
    assert (shape.points_px, shape.closed, shape.label) == (((672.0, 897.0), (668.0, 499.0)), False, "person")


def test_shapes_of_reference_and_wanted(street, camera):
    shapes = measure_item(item("same_plane", "height", **SAME_PLANE.inputs), street, camera).shapes
    assert [shape.label for shape in shapes] == ["reference", "height"]


def test_measures_again_from_its_own_given(street, camera):
    first = measure_item(SAME_PLANE, street, camera).measurements[0]
    again = measure_item(Item(SAME_PLANE.method, json.loads(json.dumps(first.given))), None, None).measurements[0]
    assert (again.value, again.u, again.low, again.high) == (first.value, first.u, first.low, first.high)


def test_several_items_are_one_document(street, camera):
    document = measure_items([KNOWN_SIZE, SAME_PLANE, item("known_size", "me", **KNOWN_SIZE.inputs)], street, camera)
    assert list(dict.fromkeys(m.label for m in document.measurements)) == ["known_size 1", "same_plane 2", "me"]
    assert not [n for n in document.notes if n.code == "refused"]
    assert len(document.shapes) == 4
    first = document.measurements[0]
    assert first.value == measure_item(KNOWN_SIZE, street, camera).measurements[0].value
    assert first.given == given(item_inputs(KNOWN_SIZE, street, camera))


@pytest.mark.parametrize(
    ("bad", "error"),
    [
        (item("known_size", "bad", ends="9,9;9,9", size="2 m"), GeometryError),
        (item("known_size", "bad", ends="9,9;9,99999", size="2 m"), InputError),
        (item("known_size", "bad", ends=PERSON), InputError),
    ],
)
def test_one_refused_item_does_not_lose_the_others(street, camera, bad, error):
    with pytest.raises(error) as caught:
        measure_item(bad, street, camera)
    document = measure_items([KNOWN_SIZE, bad, SAME_PLANE], street, camera)
    assert list(dict.fromkeys(m.label for m in document.measurements)) == ["known_size 1", "same_plane 3"]
    [refused] = [n for n in document.notes if n.code == "refused"]
    assert refused.text == f"bad: {caught.value}"
    assert "bad" not in {shape.label for shape in document.shapes}


def test_without_a_camera_only_what_needs_one_is_refused(street):
    document = measure_items([KNOWN_SIZE, SAME_PLANE], street, NO_CAMERA)
    assert {m.label for m in document.measurements} == {"same_plane 2"}
    [refused] = [n for n in document.notes if n.code == "refused"]
    assert refused.text.startswith("known_size 1: street.jpg: no camera")


@pytest.mark.parametrize(("method", "field", "text", "says"), [
    ("known_size", "size", "-5", "above 0"), ("known_size", "size", "0 mm", "above 0"), ("same_plane", "length", "-200 mm", "above 0"),
    ("known_distance", "distance", "0", "above 0"), ("known_size", "tilt", "200", "-90° and 90°"),
])  # fmt: skip
def test_impossible_numbers_are_refused_by_their_field(desk, method, field, text, says):
    points = {"known_size": {"ends": "500,466;857,535", "size": "200"}, "known_distance": {"ends": "500,466;857,535"},
              "same_plane": {"reference": "100,100;300,100", "ends": "500,466;857,535"}}[method]  # fmt: skip
    one = Item(METHODS[method], {**points, field: text})
    with pytest.raises(InputError, match=says) as refused:
        measure_item(one, desk, resolve_camera(desk))
    assert refused.value.name == field


def test_crossed_corners_are_refused(desk):
    one = Item(METHODS["pose"], {"points": "394,372;756,822;748,368;296,842", "target": "rectangle 210 x 297"})
    with pytest.raises(InputError, match="in order"):
        measure_item(one, desk, resolve_camera(desk))


def test_a_stated_tilt_is_not_called_unknown(desk):
    one = Item(METHODS["known_size"], {"ends": "500,466;857,535", "size": "200", "tilt": "5"})
    codes = {n.code for n in measure_item(one, desk, resolve_camera(desk)).measurements[0].notes}
    assert "unknown_tilt" not in codes
