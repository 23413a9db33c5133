import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from subtense import assumptions, propagate
from subtense.camera import Camera
from subtense.errors import GeometryError
from subtense.methods.known_size import METHOD, Inputs, known_size
from subtense.observation import Observation
from subtense.quantity import Quantity

LENS = {"lens": "brown_conrady", "distortion": np.array([-0.1, 0.02, 1e-3, -5e-4, 0])}
CAMERA = Camera(1600, 1200, 1500.0, 805.0, 590.0, 1.01, cov=np.diag([100.0, 1e-6, 9, 9, 1e-4, 0, 0, 0, 0]), **LENS)

ends = st.tuples(
    st.floats(200, 1400), st.floats(200, 1000), st.floats(-150, 150), st.floats(20, 150)
).map(lambda t: np.array([[t[0], t[1]], [t[0] + t[2], t[1] + t[3]]]))  # fmt: skip
angle = st.floats(-0.5, 0.5)


def scene(points, camera=CAMERA, size=0.3, tilt=0.0, sigma=0.5):
    return Inputs(
        camera, Observation(points, sigma), Quantity.normal(size, 0.002 * size, "m"), Quantity.normal(tilt, 0.02, "rad")
    )


def numbers(inputs):
    found = propagate.first_order(METHOD, inputs)
    return np.concatenate([found.value, found.u])


@given(ends, angle, st.floats(0.01, 100))
def test_scaling_the_world_scales_the_answer(points, tilt, s):
    assert numbers(scene(points, size=0.3 * s, tilt=tilt)) == pytest.approx(
        s * numbers(scene(points, tilt=tilt)), rel=1e-8
    )


@given(ends, angle)
def test_swapping_the_ends_turns_the_tilt_around(points, tilt):
    assert numbers(scene(points[::-1], tilt=-tilt)) == pytest.approx(numbers(scene(points, tilt=tilt)), rel=1e-8)


@given(ends, angle, st.integers(1, 3))
def test_quarter_turns_change_nothing(points, tilt, quarters):
    camera, turned = CAMERA, points
    for _ in range(quarters):
        turned = np.column_stack([camera.height_px - 1 - turned[:, 1], turned[:, 0]])
        camera = camera.rotated(1)
    # f and aspect go along to first order, so u agrees to second
    assert numbers(scene(turned, camera, tilt=tilt)) == pytest.approx(numbers(scene(points, tilt=tilt)), rel=1e-4)


@given(ends, angle, st.sampled_from([(800, 600), (3200, 2400), (400, 300)]))
def test_resizing_changes_nothing(points, tilt, size):
    s = size[0] / 1600
    there = scene((points + 0.5) * s - 0.5, CAMERA.resized(*size), tilt=tilt, sigma=0.5 * s)
    assert numbers(there) == pytest.approx(numbers(scene(points, tilt=tilt)), rel=1e-7)


@given(ends, angle, st.integers(0, 200), st.integers(0, 200))
def test_cropping_changes_nothing(points, tilt, left, top):
    there = scene(points - [left, top], CAMERA.cropped(left, top, 1200, 900), tilt=tilt)
    assert numbers(there) == pytest.approx(numbers(scene(points, tilt=tilt)), rel=1e-7)


@given(ends, angle)
def test_a_mirrored_picture_gives_the_same(points, tilt):
    mirrored = Camera(1600, 1200, 1500.0, 1599 - 805.0, 590.0, 1.01, cov=CAMERA.cov, lens="brown_conrady",
                      distortion=CAMERA.coefficients * [1, 1, 1, -1, 1])  # fmt: skip
    flipped = np.column_stack([1599 - points[:, 0], points[:, 1]])
    assert numbers(scene(flipped, mirrored, tilt=tilt)) == pytest.approx(numbers(scene(points, tilt=tilt)), rel=1e-7)


@given(st.floats(-0.5, 0.5), st.floats(-0.4, 0.4), st.floats(0.5, 50), angle, st.floats(0, np.pi))
def test_finds_a_segment_that_was_put_there(x, y, depth, tilt, turn):
    """A segment of 0.3 m, its middle at depth * (x, y, 1), far end tilted away."""
    half = 0.15 * np.array([np.cos(tilt) * np.cos(turn), np.cos(tilt) * np.sin(turn), np.sin(tilt)])
    middle = depth * np.array([x, y, 1])
    pixels = CAMERA.project(np.stack([middle - half, middle + half]))
    found = known_size(scene(pixels, tilt=tilt))
    assert float(found.depth_m) == pytest.approx(depth, rel=1e-9)
    assert float(found.range_m) == pytest.approx(np.linalg.norm(middle), rel=1e-9)


def test_fisheye_and_pinhole_see_the_same_segment():
    points = np.array([[-0.2, 0.1, 2.0], [0.3, 0.2, 2.0]])
    camera = Camera(1600, 1200, 500.0, 799.5, 599.5, lens="fisheye", distortion=np.array([0.05, -0.02, 0.003, -0.001]))
    size = float(np.linalg.norm(points[1] - points[0]))
    assert float(known_size(scene(camera.project(points), camera, size=size)).depth_m) == pytest.approx(2.0)


def test_a_panorama_is_refused():
    camera = Camera(3000, 1500, 477.0, 1499.5, 749.5, lens="equirectangular")
    with pytest.raises(GeometryError, match="panorama"):
        propagate.measure(METHOD, scene(np.array([[1400.0, 700], [1500, 700]]), camera))


def test_a_point_beyond_the_turning_point_of_the_lens_is_refused():
    camera = Camera(1600, 1200, 1000.0, 799.5, 599.5, lens="brown_conrady", distortion=np.array([-0.35, 0, 0, 0, 0.0]))
    with pytest.raises(GeometryError) as caught:
        propagate.measure(METHOD, scene(np.array([[5.0, 5], [300, 300]]), camera))
    assert caught.value.code == "not_invertible"


def test_a_nominal_focal_length_gets_its_extension_continuously():
    def at(f_mm):
        camera = Camera(1600, 1200, 1500.0, 799.5, 599.5, nominal_focal_m=f_mm / 1000 if f_mm else None)
        return propagate.measure(METHOD, scene(np.array([[700.0, 600], [900, 600]]), camera))[1]

    calibrated, nominal = at(None), at(35)
    assert nominal.value == pytest.approx(calibrated.value + 0.035)
    assert nominal.u > calibrated.u
    assert at(0.001).value == pytest.approx(calibrated.value, rel=1e-5)


def test_unknown_tilt_reaches_to_the_near_side_and_is_noted():
    inputs = Inputs(
        CAMERA,
        Observation(np.array([[700.0, 600], [900, 600]]), 0.1),
        Quantity.exact(0.3, "m"),
        assumptions.unknown_tilt(),
    )
    m = propagate.measure(METHOD, inputs)[1]
    assert m.value - m.low > 2 * (m.high - m.value)
    assert "unknown_tilt" in {n.code for n in m.notes}
    assert "frontal_assumption" in {
        n.code for n in propagate.measure(METHOD, Inputs(CAMERA, inputs.ends, inputs.size))[1].notes
    }
