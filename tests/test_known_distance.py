import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from subtense import assumptions, propagate
from subtense.camera import Camera
from subtense.errors import GeometryError
from subtense.methods import known_size
from subtense.methods.known_distance import METHOD, Inputs, known_distance
from subtense.observation import Observation
from subtense.quantity import Quantity

LENS = {"lens": "brown_conrady", "distortion": np.array([-0.1, 0.02, 1e-3, -5e-4, 0])}
CAMERA = Camera(1600, 1200, 1500.0, 805.0, 590.0, 1.01, cov=np.diag([100.0, 1e-6, 9, 9, 1e-4, 0, 0, 0, 0]), **LENS)
SIDE = np.array([[700.0, 600.0], [900.0, 600.0]])

ends = st.tuples(
    st.floats(200, 1400), st.floats(200, 1000), st.floats(-150, 150), st.floats(20, 150)
).map(lambda t: np.array([[t[0], t[1]], [t[0] + t[2], t[1] + t[3]]]))  # fmt: skip
angle = st.floats(-0.5, 0.5)


def scene(points, camera=CAMERA, distance=4.0, tilt=0.0, sigma=0.5):
    return Inputs(
        camera, Observation(points, sigma), Quantity.normal(distance, 0.002 * abs(distance), "m"), Quantity.normal(tilt, 0.02, "rad")
    )  # fmt: skip


def numbers(inputs):
    found = propagate.first_order(METHOD, inputs)
    return np.concatenate([found.value, found.u])


@given(st.floats(-0.5, 0.5), st.floats(-0.4, 0.4), st.floats(0.5, 50), angle, st.floats(0, np.pi))
def test_finds_the_length_of_a_segment_that_was_put_there(x, y, depth, tilt, turn):
    """A segment of 0.3 m, its middle at depth * (x, y, 1), far end tilted away."""
    half = 0.15 * np.array([np.cos(tilt) * np.cos(turn), np.cos(tilt) * np.sin(turn), np.sin(tilt)])
    middle = depth * np.array([x, y, 1])
    pixels = CAMERA.project(np.stack([middle - half, middle + half]))
    found = known_distance(scene(pixels, distance=float(np.linalg.norm(middle)), tilt=tilt))
    assert float(found.size_m) == pytest.approx(0.3, rel=1e-8)
    assert float(found.depth_m) == pytest.approx(depth, rel=1e-8)


def test_two_triangles_by_hand():
    """A pole from (1, 0, 10) to (1, 2, 10) m: 200 px at f = 1000 px; its middle (1, 1, 10) m is sqrt(102) m away."""
    camera = Camera(1600, 1200, 1000.0, 800.0, 600.0)
    points = np.array([[900.0, 600.0], [900.0, 800.0]])
    found = known_distance(scene(points, camera, 102**0.5))
    assert float(found.size_m) == pytest.approx(2.0, rel=1e-12)
    assert float(found.depth_m) == pytest.approx(10.0, rel=1e-12)


@given(ends, angle, st.floats(0.1, 30))
def test_is_the_inverse_of_known_size(points, tilt, length):
    seen = Observation(points, 0.5)
    placed = known_size.known_size(
        known_size.Inputs(CAMERA, seen, Quantity.exact(length, "m"), Quantity.exact(tilt, "rad"))
    )
    found = known_distance(
        Inputs(CAMERA, seen, Quantity.exact(float(placed.range_m), "m"), Quantity.exact(tilt, "rad"))
    )
    assert float(found.size_m) == pytest.approx(length, rel=1e-9)
    assert float(found.depth_m) == pytest.approx(float(placed.depth_m), rel=1e-9)


@given(ends, angle, st.floats(0.01, 100))
def test_scaling_the_world_scales_the_answer(points, tilt, s):
    assert numbers(scene(points, distance=4 * s, tilt=tilt)) == pytest.approx(
        s * numbers(scene(points, tilt=tilt)), rel=1e-8
    )


@given(ends, angle)
def test_swapping_the_ends_turns_the_tilt_around(points, tilt):
    assert numbers(scene(points[::-1], tilt=-tilt)) == pytest.approx(numbers(scene(points, tilt=tilt)), rel=1e-8)


@given(ends, angle)
def test_a_mirrored_picture_gives_the_same(points, tilt):
    mirrored = Camera(1600, 1200, 1500.0, 1599 - 805.0, 590.0, 1.01, cov=CAMERA.cov, lens="brown_conrady",
                      distortion=CAMERA.coefficients * [1, 1, 1, -1, 1])  # fmt: skip
    flipped = np.column_stack([1599 - points[:, 0], points[:, 1]])
    assert numbers(scene(flipped, mirrored, tilt=tilt)) == pytest.approx(numbers(scene(points, tilt=tilt)), rel=1e-7)


@given(ends, angle, st.integers(1, 3))
def test_quarter_turns_change_nothing(points, tilt, quarters):
    camera, turned = CAMERA, points
    for _ in range(quarters):
        turned = np.column_stack([camera.height_px - 1 - turned[:, 1], turned[:, 0]])
        camera = camera.rotated(1)
    assert numbers(scene(turned, camera, tilt=tilt)) == pytest.approx(numbers(scene(points, tilt=tilt)), rel=1e-4)


@given(ends, angle, st.sampled_from([(800, 600), (3200, 2400), (400, 300)]), st.integers(0, 200), st.integers(0, 200))
def test_cropping_and_resizing_change_nothing(points, tilt, size, left, top):
    s = size[0] / 1600
    there = scene(
        (points - [left, top] + 0.5) * s - 0.5, CAMERA.cropped(left, top, 1600, 1200).resized(*size), tilt=tilt, sigma=0.5 * s
    )  # fmt: skip
    assert numbers(there) == pytest.approx(numbers(scene(points, tilt=tilt)), rel=1e-7)


def test_u_is_that_of_the_distance_alone_where_nothing_else_is_uncertain():
    camera = Camera(1600, 1200, 1500.0, 799.5, 599.5)
    inputs = Inputs(camera, Observation(SIDE, 0.0), Quantity.normal(4.0, 0.04, "m"))
    size, depth = propagate.measure(METHOD, inputs)
    assert size.u / size.value == pytest.approx(0.01)
    assert depth.u / depth.value == pytest.approx(0.01)
    assert [c.name for c in size.budget] == ["distance"]


@pytest.mark.parametrize("field", ["camera", "sigma", "distance", "tilt"])
def test_u_grows_with_each_doubt(field):
    def u(factor):
        f = {"camera": 1, "sigma": 1, "distance": 1, "tilt": 1, field: factor}
        camera = Camera(1600, 1200, 1500.0, 799.5, 599.5, cov=np.diag([f["camera"] * 15.0, 0, 0, 0]) ** 2)
        return propagate.measure(METHOD, Inputs(
            camera, Observation(SIDE, 0.5 * f["sigma"]), Quantity.normal(4.0, 0.02 * f["distance"], "m"),
            Quantity.normal(0.2, 0.02 * f["tilt"], "rad"),
        ))[0].u  # fmt: skip

    assert u(1) < u(2) < u(4)


def refusal(**change):
    with pytest.raises(GeometryError) as caught:
        propagate.measure(METHOD, scene(**{"points": SIDE, **change}))
    return caught.value.code


def test_two_ends_on_one_point_have_no_length():
    assert refusal(points=np.array([[700.0, 600.0], [700.0, 600.0]])) == "zero_extent"


@pytest.mark.parametrize("distance", [0.0, -2.0])
def test_a_distance_of_zero_or_below_is_refused(distance):
    assert refusal(distance=distance) == "behind_camera"


def test_an_object_nearer_than_the_extension_of_the_lens_would_lie_behind_the_camera():
    camera = Camera(1600, 1200, 1500.0, 799.5, 599.5, nominal_focal_m=0.05)
    assert refusal(camera=camera, distance=0.04) == "behind_camera"


def oblique(along_x, along_y):
    """Ends 400 px apart about a middle 1400 px right of the axis of a lens of f = 300 px: 78 degrees off it."""
    camera = Camera(3200, 3200, 300.0, 100.0, 1600.0)
    middle, step = np.array([1500.0, 1600.0]), 200 * np.array([along_x, along_y])
    return {"camera": camera, "points": np.array([middle - step, middle + step]), "tilt": 0.5}


def test_a_tilt_that_no_place_fits_is_refused():
    assert refusal(**oblique(0.0, 1.0)) == "too_oblique"


def test_a_tilt_that_fits_behind_the_camera_only_is_refused():
    assert refusal(**oblique(1.0, 0.0)) == "behind_camera"


def test_a_panorama_is_refused():
    camera = Camera(3000, 1500, 477.0, 1499.5, 749.5, lens="equirectangular")
    assert refusal(points=np.array([[1400.0, 700], [1500, 700]]), camera=camera) == "not_pinhole"


def test_a_point_beyond_the_turning_point_of_the_lens_is_refused():
    camera = Camera(1600, 1200, 1000.0, 799.5, 599.5, lens="brown_conrady", distortion=np.array([-0.35, 0, 0, 0, 0.0]))
    assert refusal(points=np.array([[5.0, 5], [300, 300]]), camera=camera) == "not_invertible"


def test_a_nominal_focal_length_takes_its_extension_off_continuously():
    def at(f_mm):
        camera = Camera(1600, 1200, 1500.0, 799.5, 599.5, nominal_focal_m=f_mm / 1000 if f_mm else None)
        return propagate.measure(METHOD, scene(SIDE, camera))

    calibrated, nominal = at(None), at(35)
    assert nominal[0].value / calibrated[0].value == pytest.approx((nominal[1].value - 0.035) / calibrated[1].value)
    assert nominal[0].u > calibrated[0].u
    assert at(0.001)[0].value == pytest.approx(calibrated[0].value, rel=1e-5)


def test_unknown_tilt_reaches_to_the_long_side_and_is_noted():
    sharp = Camera(1600, 1200, 1500.0, 799.5, 599.5)
    known = (sharp, Observation(SIDE, 0.1), Quantity.exact(4.0, "m"))
    m = propagate.measure(METHOD, Inputs(*known, assumptions.unknown_tilt()))[0]
    assert m.high - m.value > 2 * (m.value - m.low)
    assert m.high / m.value == pytest.approx(1 / np.cos(np.radians(20)), abs=0.01)
    assert {n.code for n in m.notes} == {"unknown_tilt"}
    assert {n.code for n in propagate.measure(METHOD, Inputs(*known))[0].notes} == {"frontal_assumption"}


def test_close_up_of_a_nominal_focal_length_is_noted():
    camera = Camera(1600, 1200, 1500.0, 799.5, 599.5, nominal_focal_m=0.05)
    codes = {n.code for n in propagate.measure(METHOD, scene(SIDE, camera, distance=1.0))[0].notes}
    assert "close_focus" in codes
