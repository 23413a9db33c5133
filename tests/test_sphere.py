"""Balls from their outlines: geometry with exact truth, and the two errors of taking a ball for a disc."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from subtense import propagate
from subtense.camera import Camera
from subtense.errors import GeometryError, InputError
from subtense.methods import circle, known_size, sphere
from subtense.observation import Observation
from subtense.quantity import Quantity

PHONE = Camera(4032, 3024, 3028.7, 2015.5, 1511.5)
LENSES = (
    Camera(1600, 1200, 1300.0, 805.0, 590.0, 1.02),
    Camera(1600, 1200, 1300.0, 805.0, 590.0, 1.0, "brown_conrady", np.array([-0.1, 0.02, 1e-3, -5e-4, 0.0])),
    Camera(1600, 1200, 600.0, 799.5, 599.5, lens="fisheye", distortion=np.array([0.05, -0.02, 0.003, -0.001])),
)


def seen(middle, radius=0.1, camera=LENSES[0], sigma=0.3, count=8):
    points = camera.project(sphere.outline(np.asarray(middle, float), radius, count))
    return sphere.Inputs(camera, Observation(points, sigma), Quantity.exact(2 * radius, "m"))


@given(st.sampled_from(LENSES), st.floats(-0.35, 0.35), st.floats(-0.3, 0.3), st.floats(0.25, 20), st.integers(3, 12))
def test_finds_a_ball_that_was_put_there(camera, x, y, z, count):
    inputs = seen(z * np.array([x, y, 1]), camera=camera, count=count)
    found = sphere.sphere(inputs, sphere.start(inputs))
    assert float(found.range_m) == pytest.approx(z * math.sqrt(1 + x * x + y * y), rel=1e-7)
    assert float(found.depth_m) == pytest.approx(z, rel=1e-7)


@pytest.mark.parametrize(("share", "error"), [(0.1, -0.005), (0.2, -0.020), (0.5, -0.134)])
def test_a_ball_is_no_disc(share, error):
    """Radius over range; taken for a disc it reads sqrt(1 - share^2) of its range."""
    inputs = seen([0, 0, 0.1 / share], count=12)
    assert propagate.measure(sphere.METHOD, inputs)[0].value == pytest.approx(0.1 / share, rel=1e-8)
    disc = circle.Inputs(inputs.camera, inputs.rim, inputs.diameter)
    assert float(circle.circle(disc, circle.start(disc)).range_m) / (0.1 / share) - 1 == pytest.approx(error, abs=6e-4)


def test_off_the_middle_the_outline_is_wider_and_its_middle_is_not_the_balls():
    """30 degrees off the axis: 15.7 % wider than high with a share of 0.1, and 3.5 px and more from the ball's middle."""
    middle = np.array([math.sin(math.radians(30)), 0, math.cos(math.radians(30))])
    inputs = seen(middle, camera=PHONE, count=400)
    x, y = inputs.rim.points_px.T
    width, height = np.ptp(x), np.ptp(y)
    assert width / height - 1 == pytest.approx(0.157, abs=0.003)
    assert (x.min() + x.max()) / 2 - PHONE.project(middle[None])[0, 0] > 3.5
    few = seen(middle, camera=PHONE, sigma=0.1)
    found = propagate.measure(sphere.METHOD, few)
    assert found[0].value == pytest.approx(1.0, rel=1e-8)
    assert found[1].value == pytest.approx(math.cos(math.radians(30)), rel=1e-8)
    ends = Observation(np.array([[x.min(), PHONE.cy_px], [x.max(), PHONE.cy_px]]), 0.1)
    by_width = known_size.known_size(known_size.Inputs(PHONE, ends, inputs.diameter))
    assert abs(float(by_width.range_m) - 1) > 0.1  # what the cone is for


def test_a_part_of_the_outline_does():
    truth = np.array([0.3, -0.1, 1.5])
    points = LENSES[0].project(sphere.outline(truth, 0.1, 24))[3:11]
    inputs = sphere.Inputs(LENSES[0], Observation(points, 0.3), Quantity.exact(0.2, "m"))
    m = propagate.measure(sphere.METHOD, inputs)[0]
    assert m.value == pytest.approx(np.linalg.norm(truth), rel=1e-7)
    assert m.u > 3 * propagate.measure(sphere.METHOD, seen(truth))[0].u


def test_u_is_the_spread_of_repeated_answers():
    rng, truth = np.random.default_rng(4), np.array([0.2, 0.1, 2.0])
    exact = seen(truth, sigma=0.5)
    found = []
    for _ in range(150):
        points = exact.rim.points_px + rng.normal(0, 0.5, (8, 2))
        inputs = sphere.Inputs(exact.camera, Observation(points, 0.5), exact.diameter)
        found.append(float(sphere.sphere(inputs, sphere.start(inputs)).range_m))
    assert propagate.measure(sphere.METHOD, exact)[0].u == pytest.approx(np.std(found), rel=0.17)


def test_a_nominal_focal_length_gets_its_extension():
    camera = Camera(1600, 1200, 1300.0, 799.5, 599.5, nominal_focal_m=0.02)
    found = propagate.measure(sphere.METHOD, seen([0, 0, 0.6], camera=camera))
    assert found[1].value == pytest.approx(0.62, rel=1e-6)
    assert "close_focus" in {n.code for n in found[0].notes}


def test_what_is_no_outline_is_noted_or_refused():
    disc = seen([0, 0, 1.0], count=10)
    flat = disc.rim.points_px * [1, 0.8] + [0, 100]
    m = propagate.measure(sphere.METHOD, sphere.Inputs(disc.camera, Observation(flat, 0.3), disc.diameter))[0]
    assert "points_misfit" in {n.code for n in m.notes}
    with pytest.raises(InputError, match="give 3 or more"):
        sphere.Inputs(disc.camera, Observation(flat[:2], 0.3), disc.diameter)
    with pytest.raises(GeometryError):
        propagate.measure(
            sphere.METHOD, sphere.Inputs(disc.camera, Observation(np.full((5, 2), 9.0), 0.3), disc.diameter)
        )
