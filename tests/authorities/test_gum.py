"""Worked examples of the GUM, to the printed digits.

Source: JCGM 100:2008, annex H. The GUM rounds intermediate results, so one unit of the last printed digit is allowed.
"""

import numpy as np
import pytest

from subtense import propagate
from subtense.distribution import t_quantile
from subtense.quantity import Quantity


def end_gauge(l_s, d, alpha_s, theta, d_alpha, d_theta):
    """H.1: length in nm of an end gauge compared with a standard."""
    return l_s + d - l_s * (d_alpha * theta + alpha_s * d_theta)


@pytest.fixture(scope="module")
def end_gauge_inputs():
    return {
        "l_s": Quantity(50_000_623.0, 25.0, "nm", dof=18),
        "d": Quantity(215.0, 9.7, "nm", dof=25.6),
        "alpha_s": Quantity.normal(11.5e-6, 1.2e-6),
        "theta": Quantity.normal(-0.1, 0.41),
        "d_alpha": Quantity(0.0, 0.58e-6, dof=50),
        "d_theta": Quantity(0.0, 0.029, dof=2),
    }


def test_h1_end_gauge_value_and_uncertainty(end_gauge_inputs):
    result = propagate.first_order(end_gauge, end_gauge_inputs, level=0.99)
    assert round(result.value[0]) == 50_000_838
    assert round(result.u[0]) == 32
    assert int(result.dof[0]) == 16
    assert t_quantile(0.995, 16) == pytest.approx(2.92, abs=0.005)
    assert (result.high - result.low)[0] / 2 == pytest.approx(93, abs=1)


def test_h1_end_gauge_second_order(end_gauge_inputs):
    assert round(propagate.first_order(end_gauge, end_gauge_inputs).u_second_order[0]) == 34


VOLT = (5.007, 4.994, 5.005, 4.990, 4.999)
AMPERE = (19.663e-3, 19.639e-3, 19.640e-3, 19.685e-3, 19.678e-3)
PHASE = (1.0456, 1.0438, 1.0468, 1.0428, 1.0433)


def impedance(v, i, phi):
    """H.2: resistance, reactance and impedance."""
    return {"R": v / i * np.cos(phi), "X": v / i * np.sin(phi), "Z": v / i}


@pytest.fixture(scope="module")
def impedance_inputs():
    readings = {"v": VOLT, "i": AMPERE, "phi": PHASE}
    return {name: Quantity.normal(np.mean(x), np.std(x, ddof=1) / np.sqrt(5)) for name, x in readings.items()}


def test_h2_outputs_with_their_joint_covariance(impedance_inputs):
    r = np.corrcoef([VOLT, AMPERE, PHASE])
    assert r[np.triu_indices(3, 1)] == pytest.approx([-0.36, 0.86, -0.65], abs=0.006)
    correlations = {("v", "i"): r[0, 1], ("v", "phi"): r[0, 2], ("i", "phi"): r[1, 2]}
    result = propagate.first_order(impedance, impedance_inputs, correlations=correlations)
    assert result.names == ("R", "X", "Z")
    assert result.value == pytest.approx([127.732, 219.847, 254.260], abs=0.001)
    assert result.u == pytest.approx([0.071, 0.295, 0.236], abs=0.001)
    scale = np.sqrt(np.diag(result.cov))
    assert (result.cov / np.outer(scale, scale))[np.triu_indices(3, 1)] == pytest.approx(
        [-0.588, -0.485, 0.993], abs=0.001
    )


def test_h2_without_correlations_is_wrong_by_the_known_factors(impedance_inputs):
    r = np.corrcoef([VOLT, AMPERE, PHASE])
    correlations = {("v", "i"): r[0, 1], ("v", "phi"): r[0, 2], ("i", "phi"): r[1, 2]}
    right = propagate.first_order(impedance, impedance_inputs, correlations=correlations)
    wrong = propagate.first_order(impedance, impedance_inputs)
    assert (wrong.u / right.u)[:2] == pytest.approx([2.74, 0.68], abs=0.01)


def test_h2_by_monte_carlo_agrees(impedance_inputs):
    r = np.corrcoef([VOLT, AMPERE, PHASE])
    correlations = {("v", "i"): r[0, 1], ("v", "phi"): r[0, 2], ("i", "phi"): r[1, 2]}
    draws = propagate.sample(impedance, impedance_inputs, 200_000, seed=1, correlations=correlations)
    assert draws.u == pytest.approx([0.071, 0.295, 0.236], rel=0.01)


TEMPERATURE = np.array([21.521, 22.012, 22.512, 23.003, 23.507, 23.999, 24.513, 25.002, 25.503, 26.010, 26.511])
CORRECTION = -np.array([0.171, 0.169, 0.166, 0.159, 0.164, 0.165, 0.156, 0.157, 0.159, 0.161, 0.160])


def fitted_line(**readings):
    """H.3: intercept at 20 degrees and slope of the least-squares line, as a function of the readings."""
    t = TEMPERATURE - 20.0
    b = np.stack(list(readings.values()))
    centred = (t - t.mean()).reshape(-1, *(1,) * (b.ndim - 1))
    slope = (centred * b).sum(axis=0) / (centred**2).sum()
    return {"y1": b.mean(axis=0) - slope * t.mean(), "y2": slope}


def test_h3_line_fit_keeps_the_covariance_of_its_parameters():
    y = fitted_line(**{f"b{i}": b for i, b in enumerate(CORRECTION)})
    residual = CORRECTION - y["y1"] - y["y2"] * (TEMPERATURE - 20)
    s = np.sqrt((residual**2).sum() / 9)
    assert s == pytest.approx(0.0035, abs=0.00005)
    readings = {f"b{i}": Quantity.normal(float(b), float(s)) for i, b in enumerate(CORRECTION)}
    fit = propagate.first_order(fitted_line, readings)
    assert fit.value == pytest.approx([-0.1712, 0.00218], abs=0.00005)
    assert fit.u == pytest.approx([0.0029, 0.00067], rel=0.02)
    r = fit.cov[0, 1] / fit.u.prod()
    assert r == pytest.approx(-0.930, abs=0.0005)
    at_30 = {"y1": Quantity.normal(fit.value[0], fit.u[0]), "y2": Quantity.normal(fit.value[1], fit.u[1])}

    def corrected(y1, y2):
        return y1 + y2 * 10

    with_covariance = propagate.first_order(corrected, at_30, correlations={("y1", "y2"): r})
    assert with_covariance.value[0] == pytest.approx(-0.1494, abs=0.00005)
    assert with_covariance.u[0] == pytest.approx(0.0041, abs=0.00005)
    assert propagate.first_order(corrected, at_30).u[0] == pytest.approx(0.0073, abs=0.00005)
