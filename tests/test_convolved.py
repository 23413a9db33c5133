"""Intervals of sums of independent variables without draws, against what is known in closed form and against draws."""

import math

import numpy as np
import pytest

from subtense import propagate
from subtense.distribution import Distribution
from subtense.propagate.convolved import interval
from subtense.quantity import Quantity

UNIFORM, NORMAL = Distribution("uniform"), Distribution()
R3 = math.sqrt(3)


def test_normal_variables_add_in_quadrature():
    low, high = interval(np.array([3.0, -4.0]), (NORMAL, NORMAL), 0.95)
    assert (low, high) == pytest.approx((-5 * 1.959964, 5 * 1.959964), abs=1e-4)


def test_two_equal_uniform_variables_are_a_triangle():
    """The 2.5 % quantile of a triangle of half-width h is -h (1 - sqrt(0.05))."""
    half = 2 * R3 * (1 - math.sqrt(0.05))
    assert interval(np.array([1.0, 1.0]), (UNIFORM, UNIFORM), 0.95) == pytest.approx((-half, half), abs=5e-3)


def test_four_uniform_variables():
    """JCGM 101, 9.2.3: the interval of four rectangular inputs is [-3.88, 3.88]."""
    assert interval(np.ones(4), (UNIFORM,) * 4, 0.95) == pytest.approx((-3.88, 3.88), abs=0.005)


@pytest.mark.parametrize("name", ["uniform", "one_sided", "triangular", "arcsine", "curvilinear_trapezoid"])
@pytest.mark.parametrize("share", [0.3, 1.0, 3.0])
def test_every_law_beside_a_normal_one_agrees_with_draws(name, share):
    law = Distribution(name, {"one_sided": -1.0, "curvilinear_trapezoid": 0.3}.get(name, 0.0))
    found = interval(np.array([share, 1.0]), (law, NORMAL), 0.95)
    rng = np.random.default_rng(1)
    draws = share * law.draw(rng, (1_000_000,)) + rng.standard_normal(1_000_000)
    assert found == pytest.approx(np.quantile(draws, (0.025, 0.975)), abs=0.01 * draws.std())


def test_a_straight_response_of_limits_needs_no_draws():
    """A normal and a larger uniform length, added: beyond what an expansion about the normal law can do."""
    inputs = {"a": Quantity.normal(1.0, 0.01, "m"), "b": Quantity.one_sided(2.0, 2.1, "m")}
    first = propagate.first_order(lambda a, b: a + b, inputs)
    draws = propagate.monte_carlo(lambda a, b: a + b, inputs, draws=1_000_000, seed=2)
    quadratic = first.quadratic
    assert abs(quadratic.excess[0]) > 0.1 and quadratic.curved[0] < 1e-9
    low, high = interval(quadratic.slopes[0], (NORMAL, Distribution("one_sided", 1.0)), 0.95)
    assert (3 + low, 3 + high) == pytest.approx(draws.interval(0, 0.95), abs=2e-4)
