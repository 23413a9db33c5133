"""The distance between two things that were placed in one picture."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.stats import chi2, ncx2

from subtense import Camera, Observation, Quantity, propagate
from subtense.errors import GeometryError, InputError
from subtense.geometry import rotation_from_vector
from subtense.methods import ground_length, ground_plane, known_size, pose, same_plane
from subtense.target import Target
from subtense.unresolved import interval
from subtense.workflow.between import between

CAMERA = Camera(4000, 3000, 3000.0, 1999.5, 1499.5, cov=np.diag([15.0**2, 0, 8.0**2, 8.0**2]))


def upright(place, height=1.75, u=0.01, sigma=0.5, camera=CAMERA, noise=0.0):
    """Something upright whose middle is at a place, seen and of known size."""
    ends = np.array(place) + np.array([[0, -height / 2, 0], [0, height / 2, 0]])
    seen = camera.project(ends) + noise
    return known_size.METHOD, known_size.Inputs(camera, Observation(seen, sigma), Quantity.normal(height, u, "m"))


def test_is_the_distance_of_the_places():
    first, second = np.array([-2.0, 0.1, 10.0]), np.array([3.0, 0.4, 14.0])
    length, deeper = between(upright(first), upright(second))
    assert (length.what, length.method) == ("length", "between")
    assert length.value == pytest.approx(np.linalg.norm(second - first), rel=1e-6)
    assert deeper.value == pytest.approx(4.0, rel=1e-6)
    assert length.low < length.value < length.high
    assert sum(c.share for c in length.budget) == pytest.approx(1)


def test_two_points_on_the_ground_are_what_ground_length_says():
    base = ground_plane.example()
    other = dataclasses.replace(base, foot=Observation(np.array([[300.0, 680.0]]), base.foot.sigma_px))
    found = between((ground_plane.METHOD, base), (ground_plane.METHOD, other))[0]
    standing = {
        f.name: getattr(base, f.name)
        for f in dataclasses.fields(base)
        if f.name not in ("foot", "point_height", "above")
    }
    ends = Observation(np.array([[900.0, 670.0], [300.0, 680.0]]), base.foot.sigma_px)
    same = propagate.measure(ground_length.METHOD, ground_length.Inputs(**standing, ends=ends))[0]
    assert found.value == pytest.approx(same.value, rel=1e-9)
    assert found.u == pytest.approx(same.u, rel=0.01)


def test_what_both_share_is_moved_together():
    """Side by side at 20 m, a wrong focal length moves both away alike: the distance between them keeps its share of it."""
    loose = dataclasses.replace(CAMERA, cov=np.diag([90.0**2, 0, 0, 0]))
    length = between(*(upright([x, 0, 20.0], camera=loose, u=1e-6, sigma=1e-3) for x in (-3.0, 3.0)))[0]
    assert length.u / 6 < 0.001  # x does not depend on f where size and ends are known
    deep = between(*(upright([0, 0, z], camera=loose, u=1e-6, sigma=1e-3) for z in (10.0, 20.0)))[0]
    assert deep.u / 10 == pytest.approx(0.03, rel=0.01)


def test_any_two_ways_go_together():
    marker = Target.square(Quantity.normal(0.2, 1e-5, "m"), "marker")
    turned = rotation_from_vector(np.array([0.2, 0.5, 0.1]))
    place = np.array([1.0, 0.2, 6.0])
    seen = Observation(CAMERA.project(marker.points_m @ turned.T + place), 0.05)
    length = between((pose.METHOD, pose.Inputs(CAMERA, seen, marker)), upright([-1.0, 0.2, 9.0]))[0]
    assert length.low < math.sqrt(4 + 9) < length.high
    assert length.value == pytest.approx(math.sqrt(13), rel=1e-3)


def test_an_unresolved_distance_reaches_down_to_zero():
    """Two people a metre apart, each known to 5 % of 20 m."""
    length = between(upright([-0.5, 0, 20.0], u=0.09), upright([0.5, 0, 20.3], u=0.09))[0]
    assert "length_not_resolved" in {note.code for note in length.notes}
    assert length.low == 0.0 and length.high > 3
    assert "inverted" in length.evaluation


def test_the_law_in_equal_noise_is_noncentral_chi():
    noise = np.random.default_rng(1).standard_normal((3, 200_000))
    for seen in (0.5, 2.0, 3.5, 4.5):
        low, high = interval(np.array([0.0, seen, 0.0]), noise)
        none = chi2.sf(seen**2, 3) >= 0.025
        right_low = 0.0 if none else brentq(lambda x, s=seen: ncx2.sf(s**2, 3, x * x) - 0.025, 1e-6, 20)
        right_high = brentq(lambda x, s=seen: ncx2.cdf(s**2, 3, x * x) - 0.025 * chi2.cdf(s**2, 3), 1e-6, 30)
        assert low == pytest.approx(right_low, abs=0.05)
        assert high == pytest.approx(right_high, abs=0.05)


@pytest.mark.parametrize("true", [[0, 0, 0.0], [0.5, 0, 0], [0, 0, 2.0], [3, 0, 0], [2, 0, 5.0]])
def test_covers_where_noise_along_the_sight_is_far_larger_than_across(true):
    rng = np.random.default_rng(2)
    spread = np.array([0.1, 0.1, 1.4])[:, None]
    noise = spread * rng.standard_normal((3, 4_000))
    length = np.linalg.norm(true)
    hits = 0
    for step in (spread * rng.standard_normal((3, 200))).T:
        seen = np.array(true) + step
        low, high = interval(seen, noise)
        hits += low <= length <= max(high, float(np.linalg.norm(seen)))
    assert hits / 200 >= 0.905  # 94 % is promised; two standard deviations of 200 are 3.4 %


def test_places_of_two_cameras_are_refused():
    other = dataclasses.replace(CAMERA, f_px=2900.0)
    with pytest.raises(InputError, match="two cameras"):
        between(upright([0, 0, 10.0]), upright([1, 0, 10.0], camera=other))


def test_a_method_without_a_place_is_refused():
    with pytest.raises(InputError, match="gives no place"):
        between(upright([0, 0, 10.0]), (same_plane.METHOD, same_plane.example()))


def test_what_has_no_answer_is_told():
    one, inputs = upright([0, 0, 10.0])
    flat = dataclasses.replace(inputs, ends=Observation(np.array([[100.0, 100.0], [100.0, 100.0]])))
    with pytest.raises(GeometryError):
        between((one, flat), upright([1, 0, 10.0]))
