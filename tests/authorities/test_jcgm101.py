"""Worked examples of GUM Supplement 1, by draws, to the printed digits.

Source: JCGM 101:2008, clause 9. The inputs of 9.3 and 9.5 as transcribed in the R package propagate
(github.com/cran/propagate, man/propagate.Rd: its tables 5 and 10) and in the help of the DB48x calculator.
"""

import numpy as np
import pytest

from subtense import propagate
from subtense.quantity import Quantity

MANY = 2_000_000


def total(a, b, c, d):
    """9.2: Y = X1 + X2 + X3 + X4."""
    return a + b + c + d


def four(make, *last):
    quantities = [make() for _ in range(4 - len(last))] + list(last)
    return dict(zip("abcd", quantities, strict=True))


def rectangular(u=1.0):
    return Quantity.uniform(-np.sqrt(3) * u, np.sqrt(3) * u)


def test_9_2_2_normal_sum():
    draws = propagate.sample(total, four(lambda: Quantity.normal(0, 1)), MANY)
    assert draws.u[0] == pytest.approx(2.0, abs=0.005)
    assert draws.interval() == pytest.approx((-3.92, 3.92), abs=0.012)


def test_9_2_3_rectangular_sum_of_equal_widths():
    draws = propagate.sample(total, four(rectangular), MANY)
    assert draws.u[0] == pytest.approx(2.0, abs=0.005)
    assert draws.interval() == pytest.approx((-3.88, 3.88), abs=0.012)


def test_9_2_4_one_dominating_rectangle():
    inputs = four(rectangular, rectangular(10.0))
    draws = propagate.sample(total, inputs, MANY)
    assert draws.u[0] == pytest.approx(10.1, abs=0.06)  # sqrt(103) = 10.149 is printed as 10.1
    assert draws.interval() == pytest.approx((-17.0, 17.0), abs=0.05)
    assert propagate.first_order(total, inputs).high[0] == pytest.approx(19.9, abs=0.05)


def mass(m_r, d_m_r, rho_a, rho_w, rho_r):
    """9.3: deviation from nominal of a weight of 100 g, in mg."""
    return (m_r + d_m_r) * (1 + (rho_a - 1.2) * (1 / rho_w - 1 / rho_r)) - 100_000.0


def test_9_3_mass_calibration():
    inputs = {
        "m_r": Quantity.normal(100_000.0, 0.050), "d_m_r": Quantity.normal(1.234, 0.020),
        "rho_a": Quantity.uniform(1.10, 1.30), "rho_w": Quantity.uniform(7000, 9000),
        "rho_r": Quantity.uniform(7950, 8050),
    }  # fmt: skip
    first = propagate.first_order(mass, inputs)
    assert first.value[0] == pytest.approx(1.2340, abs=0.0001)
    assert first.u[0] == pytest.approx(0.0539, abs=0.00005)
    draws = propagate.sample(mass, inputs, MANY)
    assert draws.mean[0] == pytest.approx(1.2340, abs=0.0002)
    assert draws.u[0] == pytest.approx(0.0754, abs=0.0001)
    low, high = draws.shortest()
    # the printed [1.0834, 1.3825] is one run's shortest interval: its length is well determined, its place is not
    assert high - low == pytest.approx(1.3825 - 1.0834, abs=0.0005)
    assert (low, high) == pytest.approx((1.0834, 1.3825), abs=0.002)
    assert first.bend[0] > 0.05  # the switch to draws would be taken


def comparison_loss(x1, x2):
    """9.4: Y = X1^2 + X2^2, in 10^-6 with x in 10^-3; also the square of a distance between near points."""
    return x1**2 + x2**2


@pytest.mark.parametrize(
    ("x1", "mean", "u", "low", "high"), [(0, 50, 50, 0, 150), (10, 150, 112, 0, 367), (50, 2551, 502, 1590, 3543)]
)
def test_9_4_comparison_loss(x1, mean, u, low, high):
    inputs = {"x1": Quantity.normal(x1, 5), "x2": Quantity.normal(0, 5)}
    draws = propagate.sample(comparison_loss, inputs, MANY)
    assert draws.mean[0] == pytest.approx(mean, abs=1)
    assert draws.u[0] == pytest.approx(u, abs=1)
    assert draws.shortest() == pytest.approx((low, high), abs=0.5 if high < 200 else 6)


def test_9_4_first_order_says_zero_and_the_check_sees_it():
    first = propagate.first_order(comparison_loss, {"x1": Quantity.normal(0, 5), "x2": Quantity.normal(0, 5)})
    assert first.u[0] == 0
    assert first.bend[0] == np.inf


def gauge(l_s, d, d1, d2, alpha_s, theta_0, swing, d_alpha, d_theta):
    """9.5: deviation from 50 mm of a gauge block, in nm."""
    return l_s + d + d1 + d2 - l_s * (d_alpha * (theta_0 + swing) + alpha_s * d_theta) - 50_000_000.0


def test_9_5_gauge_block():
    inputs = {
        "l_s": Quantity.student_t(50_000_623, 25, 18), "d": Quantity.student_t(215, 6, 24),
        "d1": Quantity.student_t(0, 4, 5), "d2": Quantity.student_t(0, 7, 8),
        "alpha_s": Quantity.uniform(9.5e-6, 13.5e-6), "theta_0": Quantity.normal(-0.1, 0.2),
        "swing": Quantity.between(-0.5, 0.5, law="arcsine"),
        "d_alpha": Quantity.curvilinear_trapezoid(-1.0e-6, 1.0e-6, 0.1e-6),
        "d_theta": Quantity.curvilinear_trapezoid(-0.050, 0.050, 0.025),
    }  # fmt: skip
    draws = propagate.sample(gauge, inputs, MANY)
    assert draws.mean[0] == pytest.approx(838, abs=0.5)
    assert draws.u[0] == pytest.approx(36, abs=0.5)
    assert draws.shortest(level=0.99) == pytest.approx((745, 932), abs=2)
    assert propagate.first_order(gauge, inputs).u[0] == pytest.approx(32, abs=0.5)


def test_adaptive_procedure_meets_its_tolerance():
    draws = propagate.monte_carlo(total, four(lambda: Quantity.normal(0, 1)))
    assert draws.stable
    assert draws.u[0] == pytest.approx(2.0, abs=0.05)
    assert draws.interval() == pytest.approx((-3.92, 3.92), abs=0.05)
