"""The curve of a chart, against single calculations."""

import dataclasses

import numpy as np
import pytest

from subtense.errors import InputError
from subtense.quantity import Quantity
from subtense.workflow.calculate import calculate, curve
from subtense.workflow.calculator_input import calculator_input

BELT = {
    "focal": "35 ± 0.4 mm", "sensor_width": "14.1 ± 0.05 mm", "image_width": "4096", "size": "200 ± 1 mm",
    "extent": "150 ± 1 px", "distance": "13.5565 ± 0.8 m",
}  # fmt: skip
UNKNOWNS = {"distance": "distance", "size": "size", "extent": "extent", "focal": "focal_length",
            "sensor_width": "sensor_width", "image_width": "image_width"}  # fmt: skip


def inputs_of(unknown, **change):
    return calculator_input({**BELT, **change, unknown: None})[0]


def single(inputs, moved, x, u):
    """The calculation at another extent or distance of the same doubt."""
    at = dataclasses.replace(getattr(inputs, moved), value=float(x), u=float(u))
    return calculate(dataclasses.replace(inputs, **{moved: at})).measurements[0]


@pytest.mark.parametrize("unknown", UNKNOWNS)
def test_agrees_with_single_calculations(unknown):
    inputs = inputs_of(unknown)
    found = curve(inputs)
    moved = "distance" if unknown == "extent" else "extent"
    assert (found["x_what"], found["y_what"]) == (moved, UNKNOWNS[unknown])
    assert found["x_unit"] == ("m" if moved == "distance" else "px")
    assert found["y_unit"] == ("px" if unknown in ("extent", "image_width") else "m")
    at = getattr(inputs, moved)
    for i in np.flatnonzero(abs(np.log(np.array(found["x"]) / float(at.value))) < 0.3):
        x = found["x"][i]
        u = float(at.u) * (x / float(at.value) if moved == "distance" else 1)
        m = single(inputs, moved, x, u)
        assert found["value"][i] == pytest.approx(m.value, rel=1e-9)
        tolerance = 0.05 * (m.high - m.low)
        assert found["low"][i] == pytest.approx(m.low, abs=tolerance)
        assert found["high"][i] == pytest.approx(m.high, abs=tolerance)


@pytest.mark.parametrize("unknown", UNKNOWNS)
def test_reaches_a_factor_of_20_each_way_and_holds_the_asked_value(unknown):
    inputs = inputs_of(unknown)
    found = curve(inputs, points=9)
    at = float((inputs.distance if unknown == "extent" else inputs.extent).value)
    assert found["x"] == pytest.approx(at * 20.0 ** np.linspace(-1, 1, 9))
    headline = calculate(inputs).measurements[0]
    assert found["value"][4] == pytest.approx(headline.value, rel=1e-12)
    assert all(np.array(found["low"]) > 0)
    assert all(np.array(found["low"]) <= found["value"])
    assert all(np.array(found["high"]) >= found["value"])


@pytest.mark.parametrize(
    "change",
    [
        {"tilt": "0 ± 20 deg (limits)"}, {"distance": None, "extent": "4000 ± 5 px"}, {"focal": "35 ± 5 mm"},
        {"extent": "20 ± 6 px"},
    ],
)  # fmt: skip
def test_is_the_interval_where_the_response_bends(change):
    """A tilt, a lens focused close, a wide doubt: what the interval does, the band does."""
    inputs = inputs_of("distance", **change)
    found, m = curve(inputs), calculate(inputs).measurements[0]
    asked = found["x"].index(pytest.approx(float(inputs.extent.value)))
    tolerance = 0.05 * (m.high - m.low)
    assert (found["low"][asked], found["high"][asked]) == pytest.approx((m.low, m.high), abs=tolerance)


def test_no_extent_is_wider_than_the_picture():
    found = curve(inputs_of("distance", extent="1000 ± 1 px"))
    assert max(found["x"]) <= 4096
    assert len(found["x"]) < 49


def test_a_higher_level_is_a_wider_band():
    inputs = inputs_of("distance")
    narrow, wide = (curve(inputs, level=level) for level in (0.68, 0.99))
    assert all(np.array(narrow["high"]) < wide["high"]) and all(np.array(narrow["low"]) > wide["low"])


def test_points_without_an_answer_are_left_out():
    """Far off the axis a steep object can't look that long."""
    inputs = inputs_of(
        "distance", tilt="60 exact", offset="2000,0", focal="8 ± 0.1 mm", extent="400 ± 1 px", aspect="1"
    )
    found = curve(inputs)
    columns = [found[name] for name in ("x", "value", "low", "high")]
    assert len({len(column) for column in columns}) == 1
    assert np.isfinite(columns).all()


def test_exact_inputs_have_no_band():
    exact = {name: f"{text.split()[0]} exact" for name, text in BELT.items() if name != "distance"}
    inputs = dataclasses.replace(
        calculator_input({**exact, "image_width": "4096"})[0], focus=Quantity.exact(0.0, "1", "left out")
    )
    found = curve(inputs)
    assert found["low"] == found["value"] == found["high"]


def test_several_scenes_at_once_are_refused():
    inputs = dataclasses.replace(inputs_of("distance"), size=Quantity.exact(np.array([0.1, 0.2]), "m"))
    with pytest.raises(InputError, match="one scene at a time"):
        calculate(inputs)
