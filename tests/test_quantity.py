import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from subtense import assumptions
from subtense.distribution import HALF_WIDTH_95
from subtense.errors import InputError
from subtense.quantity import UNITS, Quantity


@pytest.mark.parametrize(
    ("text", "value", "u"),
    [
        ("200 ± 0.5 mm", 0.2, 0.0005 / HALF_WIDTH_95),
        ("200 +/- 0.5 mm", 0.2, 0.0005 / HALF_WIDTH_95),
        ("5 m ± 2 cm", 5.0, 0.02 / HALF_WIDTH_95),
        ("5 m ± 2 %", 5.0, 0.1 / HALF_WIDTH_95),
        ("200 ± 1 mm (1s)", 0.2, 0.001),
        ("200 ± 3 mm (limits)", 0.2, 0.003 / np.sqrt(3)),
        ("6 ft 2 in ± 1 cm", 1.8796, 0.01 / HALF_WIDTH_95),
        ("6'2\" ± 1 in", 1.8796, 0.0254 / HALF_WIDTH_95),
        ("35 exact", 0.035, 0.0),
        ("1e3 ± 1 mm", 1.0, 0.001 / HALF_WIDTH_95),
        ("−20 ± 1 mm", -0.02, 0.001 / HALF_WIDTH_95),
    ],
)
def test_reads_what_people_write(text, value, u):
    read = Quantity.parse(text, "m", bare="mm")
    assert (read.value, read.u) == (pytest.approx(value), pytest.approx(u, abs=1e-15))


def test_says_how_plus_minus_was_read():
    assert "95 %" in Quantity.parse("1 ± 0.1 m", "m").source
    assert "limits" in Quantity.parse("1 ± 0.1 m (limits)", "m").source
    assert "one standard deviation" in Quantity.parse("1 ± 0.1 m (1s)", "m").source


@pytest.mark.parametrize(
    "text",
    [
        "",
        "abc",
        "1,5 mm",
        "200 ± mm",
        "200 ± 1 ± 2",
        "5 px",
        "5 furlong",
        "nan",
        "inf mm",
        "5 5 mm",
        "± 3",
        "2 ± -1 mm",
    ],
)
def test_refuses_with_the_name_the_text_and_the_cure(text):
    with pytest.raises(InputError) as caught:
        Quantity.parse(text, "m", bare="mm", name="--size", assume=assumptions.size)
    assert "--size" in str(caught.value)
    assert repr(text)[1:-1][:20] in str(caught.value)
    assert caught.value.allowed


def test_a_number_without_doubt_needs_an_assumption():
    with pytest.raises(InputError, match="exact"):
        Quantity.parse("200 mm", "m")
    assumed = Quantity.parse("200 mm", "m", assume=assumptions.size)
    assert assumed.u == pytest.approx(0.001)
    assert assumed.source.startswith("assumed")


def test_half_the_last_digit_is_what_was_written():
    assert Quantity.parse("14.1", "m", bare="mm", assume=assumptions.sensor_width).u == pytest.approx(5e-5 / np.sqrt(3))
    assert Quantity.parse("14", "m", bare="mm", assume=assumptions.sensor_width).u == pytest.approx(5e-4 / np.sqrt(3))


@given(st.floats(1e-3, 1e3), st.floats(1e-4, 1e2), st.sampled_from(["mm", "cm", "m", "in", "ft"]))
def test_a_change_of_unit_changes_nothing_else(value, half, unit):
    read = Quantity.parse(f"{value!r} ± {half!r} {unit}", "m")
    factor = UNITS[unit][1]
    assert read.value == pytest.approx(value * factor)
    assert read.u * HALF_WIDTH_95 == pytest.approx(half * factor)


@given(st.text(max_size=30))
def test_any_text_is_read_or_refused(text):
    try:
        read = Quantity.parse(text, "m", bare="mm", assume=assumptions.size)
    except InputError:
        return
    assert np.isfinite(read.value) and read.u >= 0


@pytest.mark.parametrize(
    "quantity",
    [
        Quantity.exact(3, "px"), Quantity.normal(1.0, 0.1, "m"), Quantity.uniform(1, 2, "m"), Quantity.student_t(1, 0.1, 4),
        Quantity.curvilinear_trapezoid(0, 1, 0.1), Quantity.one_sided(0, 1), Quantity.between(0, 1, law="arcsine"),
        Quantity.between(0, 1, law="triangular"), Quantity(np.array([1.0, 2.0]), 0.1, "m", id="a"),
    ],
    ids=lambda q: str(q.distribution.name),
)  # fmt: skip
def test_json_round_trip(quantity):
    assert Quantity.from_json(quantity.to_json()).to_json() == quantity.to_json()


@pytest.mark.parametrize(("value", "u"), [(np.nan, 1), (1, np.inf), (1, -1)])
def test_impossible_numbers_are_refused(value, u):
    with pytest.raises(InputError):
        Quantity(value, u)


def test_limits_the_wrong_way_round_are_refused():
    with pytest.raises(InputError, match="upper limit"):
        Quantity.uniform(2, 1)


def test_two_quantities_that_read_the_same_are_not_the_same():
    assert Quantity.normal(1, 0.1).identity != Quantity.normal(1, 0.1).identity
    assert Quantity(1, 0.1, id="tape").identity == Quantity(1, 0.1, id="tape").identity
