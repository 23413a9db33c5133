"""Discs from their rims: geometry with exact truth, any lens, and what is said where there is no answer."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from subtense import propagate
from subtense.camera import Camera
from subtense.errors import GeometryError, InputError
from subtense.geometry import rotation_from_vector
from subtense.methods import circle
from subtense.observation import Observation
from subtense.quantity import Quantity

PHONE = Camera(4032, 3024, 3028.7, 2015.5, 1511.5)
LENSES = (
    Camera(1600, 1200, 1300.0, 805.0, 590.0, 1.02),
    Camera(1600, 1200, 1300.0, 805.0, 590.0, 1.0, "brown_conrady", np.array([-0.1, 0.02, 1e-3, -5e-4, 0.0])),
    Camera(1600, 1200, 600.0, 799.5, 599.5, lens="fisheye", distortion=np.array([0.05, -0.02, 0.003, -0.001])),
)
DIAMETER = Quantity.exact(0.025, "m")


def rim_of(middle, rotation, radius=0.0125, count=9):
    around = np.linspace(0, 2 * np.pi, count, endpoint=False) + 0.1
    flat = radius * np.stack([np.cos(around), np.sin(around), 0 * around], -1)
    return flat @ rotation.T + np.asarray(middle, float)


def inputs_of(middle, rotation, camera=LENSES[0], sigma=0.3, diameter=DIAMETER, noise=0.0, **more):
    points = camera.project(rim_of(middle, rotation, float(diameter.value) / 2)) + noise
    return circle.Inputs(camera, Observation(points, sigma), diameter, **more)


def measured(inputs):
    return {m.what: m for m in propagate.measure(circle.METHOD, inputs)}


@given(
    st.sampled_from(LENSES), st.floats(-1.2, 1.2), st.floats(-0.9, 0.9),
    st.floats(-0.3, 0.3), st.floats(-0.25, 0.25), st.floats(0.15, 2.0),
)  # fmt: skip
def test_finds_a_disc_that_was_put_there(camera, turn, tip, x, y, z):
    """Exactly, whatever the lens, as the rows of a table are measured: by the rim as it is."""
    rotation, middle = rotation_from_vector(np.array([tip, turn, 0.0])), z * np.array([x, y, 1])
    normal, far = rotation[:, 2], np.linalg.norm(middle)
    if abs(normal @ middle) < 0.25 * far:
        return  # nearly edge-on
    inputs = inputs_of(middle, rotation, camera)
    found = [
        circle.circle(inputs_of(middle, rotation, camera, side=Quantity.exact(s)), circle.start(inputs))
        for s in (-1.0, 1.0)
    ]
    assert float(found[0].range_m) == pytest.approx(far, rel=1e-7)
    assert float(found[0].tilt_rad) == pytest.approx(math.acos(min(abs(normal @ middle) / far, 1)), abs=2e-4)
    assert min(abs(float(f.depth_m) / z - 1) for f in found) < 1e-7


@pytest.mark.parametrize(("tip", "nearer"), [(0.8, -1), (-0.8, 1)])
def test_the_side_tells_which_half_is_nearer(tip, nearer):
    """A positive turn about x takes the lower half (y down) farther away."""
    rotation = rotation_from_vector(np.array([tip, 0.0, 0.0]))
    middle = np.array([0.02, 0.06, 0.15])
    inputs = inputs_of(middle, rotation, side=Quantity.exact(float(nearer)))
    assert float(circle.circle(inputs, circle.start(inputs)).depth_m) == pytest.approx(0.15, rel=1e-8)
    wrong = inputs_of(middle, rotation, side=Quantity.exact(float(-nearer)))
    assert abs(float(circle.circle(wrong, circle.start(wrong)).depth_m) / 0.15 - 1) > 1e-4


@pytest.mark.parametrize(("radius", "shift_px"), [(0.020, 0.61), (0.050, 3.8)])
def test_the_middle_of_the_ellipse_is_not_that_of_the_disc(radius, shift_px):
    """A disc turned by 45 degrees, 1 m away: f r^2 sin(2 a) / (2 Z^2)."""
    rotation = rotation_from_vector(np.array([0.0, math.pi / 4, 0.0]))
    points = PHONE.project(rim_of([0, 0, 1.0], rotation, radius, 40))
    centre = (points[:, 0].min() + points[:, 0].max()) / 2
    assert abs(centre - PHONE.cx_px) == pytest.approx(shift_px, rel=0.02)
    inputs = circle.Inputs(PHONE, Observation(points, 0.1), Quantity.exact(2 * radius, "m"))
    found = circle.circle(inputs, circle.start(inputs))
    assert float(found.range_m) == pytest.approx(1.0, rel=1e-9)
    assert math.degrees(float(found.tilt_rad)) == pytest.approx(45, abs=1e-6)


def test_a_disc_that_exactly_faces_the_camera():
    found = measured(inputs_of([0, 0, 0.4], np.eye(3), sigma=0.5))
    assert found["range"].low < 0.4 < found["range"].high
    assert found["tilt"].low == pytest.approx(0.0, abs=0.05)


def test_noise_does_not_make_discs_that_face_the_camera_nearer():
    """The long axis of a noisy ellipse is too long by more than its own u; the settled flattening takes most of that off."""
    rng, errors, naive = np.random.default_rng(1), [], []
    for _ in range(30):
        inputs = inputs_of([0.03, 0, 0.6], np.eye(3), noise=rng.normal(0, 0.7, (9, 2)), sigma=0.7)
        true = float(np.linalg.norm([0.03, 0, 0.6]))
        settled = circle.prepare(inputs)
        naive.append(float(circle.circle(inputs, circle.start(inputs)).range_m) / true - 1)
        errors.append(float(circle.circle(settled, circle.start(settled)).range_m) / true - 1)
    assert np.mean(naive) < 1.4 * np.mean(errors) < 0


def test_points_stand_for_a_fitted_rim_of_rank_5():
    """Twelve points of an ellipse with the covariance of its five numbers give the range with the u of the major axis."""
    rotation = rotation_from_vector(np.array([0.9, 0.0, 0.0]))
    points = LENSES[0].project(rim_of([0, 0, 0.4], rotation, count=12))
    outward = points - points.mean(axis=0)
    around = np.linspace(0, 2 * np.pi, 12, endpoint=False)[:, None]
    # the size is known to 1 %, the shape and the place ten times as well
    moves = [(0.01, outward), (1e-3, outward * np.cos(2 * around)), (1e-3, outward * np.sin(2 * around)),
             (0.02, np.tile([1.0, 0.0], (12, 1))), (0.02, np.tile([0.0, 1.0], (12, 1)))]  # fmt: skip
    cov = sum(u**2 * np.outer(move.ravel(), move.ravel()) for u, move in moves)
    inputs = circle.Inputs(LENSES[0], Observation(points, cov=cov), DIAMETER)
    assert measured(inputs)["range"].u / 0.4 == pytest.approx(0.01, rel=0.05)
    assert not measured(inputs)["range"].notes


def test_size_and_focal_length_are_one_error_each():
    camera = Camera(1600, 1200, 1300.0, 799.5, 599.5, cov=np.diag([26.0**2, 0, 0, 0]))
    rotation = rotation_from_vector(np.array([0.5, 0.3, 0.0]))
    inputs = inputs_of([0.02, 0, 0.5], rotation, camera, 1e-4, Quantity.normal(0.025, 0.00025, "m"))
    m = measured(inputs)["depth"]
    assert m.u / m.value == pytest.approx(math.hypot(0.02, 0.01), rel=0.02)
    assert [line.name for line in m.budget[:2]] == ["focal length", "diameter"]


def test_a_nominal_focal_length_gets_its_extension():
    camera = Camera(1600, 1200, 1300.0, 799.5, 599.5, nominal_focal_m=0.02)
    found = measured(inputs_of([0, 0, 0.6], rotation_from_vector(np.array([0.6, 0, 0])), camera, 0.01))
    assert found["depth"].value == pytest.approx(0.62, rel=1e-4)
    assert "close_focus" in {n.code for n in found["range"].notes}


def test_points_that_lie_on_no_rim_are_noted():
    rotation = rotation_from_vector(np.array([0.5, 0.0, 0.0]))
    wrong = np.zeros((9, 2))
    wrong[3] = 25.0
    right, off = inputs_of([0, 0, 0.3], rotation, sigma=0.5), inputs_of([0, 0, 0.3], rotation, sigma=0.5, noise=wrong)
    assert "points_misfit" not in {n.code for n in measured(right)["range"].notes}
    assert "points_misfit" in {n.code for n in measured(off)["range"].notes}


@pytest.mark.parametrize(
    ("points", "reason"),
    [
        (np.full((6, 2), 300.0), "not_converged"),
        (np.column_stack([np.linspace(100, 500, 6), np.full(6, 300.0)]), "not_converged"),
    ],
)
def test_points_without_an_ellipse_are_refused(points, reason):
    with pytest.raises(GeometryError) as caught:
        propagate.measure(circle.METHOD, circle.Inputs(LENSES[0], Observation(points, 0.5), DIAMETER))
    assert caught.value.code == reason


def test_too_few_points_and_a_panorama_are_refused():
    with pytest.raises(InputError, match="give 5 or more"):
        circle.Inputs(LENSES[0], Observation(np.zeros((4, 2))), DIAMETER)
    camera = Camera(3000, 1500, 477.0, 1499.5, 749.5, lens="equirectangular")
    points = inputs_of([0, 0, 0.4], np.eye(3)).rim.points_px
    with pytest.raises(GeometryError, match="panorama"):
        propagate.measure(circle.METHOD, circle.Inputs(camera, Observation(points, 0.5), DIAMETER))


def test_a_table_of_rims_is_measured_row_by_row():
    rotation = rotation_from_vector(np.array([0.7, 0.2, 0.0]))
    depths = np.array([0.2, 0.4, 0.8])
    points = np.stack([LENSES[0].project(rim_of([0.02, 0, z], rotation)) for z in depths])
    found = propagate.rows(circle.METHOD, circle.Inputs(LENSES[0], Observation(points, 0.3), DIAMETER))
    one = circle.Inputs(LENSES[0], Observation(points[1], 0.3), DIAMETER)
    assert found.value[0] == pytest.approx(np.hypot(0.02, depths), rel=1e-7)
    assert found.u[0, 1] == pytest.approx(propagate.first_order(circle.METHOD, one).u[0], rel=1e-3)
