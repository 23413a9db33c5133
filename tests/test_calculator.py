import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from subtense.errors import GeometryError, InputError
from subtense.methods.calculator import UNKNOWNS, Inputs, calculator
from subtense.quantity import Quantity
from subtense.workflow.calculate import calculate
from subtense.workflow.calculator_input import calculator_input


def typed(**text):
    inputs, height = calculator_input({name: str(value) for name, value in text.items()})
    return calculate(inputs, image_height=height)


def by_what(document):
    return {m.what: m for m in document.measurements}


BELT = {"focal": 35, "sensor_width": 14.1, "image_width": 4096, "size": 200, "extent": 150}
STATUE = {"focal": 24, "sensor_width": 23.5, "image_width": 5472, "size": 5000, "extent": 120}


def test_a_package_on_a_conveyor_belt():
    found = by_what(typed(**BELT))
    assert found["depth"].value * 1000 == pytest.approx(13_556.50, abs=0.005)
    assert found["sensor_scale"].value / 1000 == pytest.approx(290.496, abs=0.0005)
    assert found["focal_length_px"].value == pytest.approx(10_167.376, abs=0.0005)
    assert found["object_scale"].value * 1000 == pytest.approx(1.3333, abs=0.00005)
    assert math.degrees(found["field_of_view"].value) == pytest.approx(2 * math.degrees(math.atan(14.1 / 70)))
    assert math.degrees(found["angle"].value) == pytest.approx(2 * math.degrees(math.atan(0.1 / 13.5565)), rel=1e-5)


def test_a_statue_from_a_drone():
    assert typed(**STATUE).measurements[0].value * 1000 == pytest.approx(232_851.06, abs=0.005)


@pytest.mark.parametrize("unknown", ["focal", "size", "extent", "distance", "sensor_width", "image_width"])
def test_any_one_can_be_left_out(unknown):
    texts = {**BELT, "distance": "13556.5012 mm"}
    known = texts.pop(unknown)
    m = typed(**texts).measurements[0]
    scale = 1 if unknown in ("extent", "image_width") else 1000
    assert m.value * scale == pytest.approx(float(str(known).split()[0]), rel=1e-6)
    assert m.low < m.value < m.high


@given(
    st.sampled_from(UNKNOWNS), st.floats(-0.6, 0.6), st.floats(-1500, 1500), st.floats(-1000, 1000),
    st.sampled_from(["width", "height"]), st.floats(0.7, 1.4), st.floats(0, 1),
)  # fmt: skip
def test_solving_for_each_value_gives_back_the_others(unknown, tilt, x, y, along, aspect, focus):
    def q(value, unit):
        return Quantity.exact(value, unit)

    more = {
        "along": along, "aspect": q(aspect, "1"), "tilt": q(tilt, "rad"), "offset_x": q(x, "px"), "offset_y": q(y, "px"),
        "focus": q(focus, "1"),
    }  # fmt: skip
    known = {
        "focal_length": q(0.035, "m"), "sensor_width": q(0.0141, "m"), "image_width": q(4096, "px"),
        "size": q(0.2, "m"), "extent": q(150, "px"),
    }  # fmt: skip
    first = calculator(Inputs(**known, **more))
    known["distance"] = q(float(first.distance_m), "m")
    wanted = known.pop(unknown)
    again = calculator(Inputs(**known, **more))
    assert float(getattr(again, f"{unknown}_{wanted.unit}")) == pytest.approx(float(wanted.value), rel=1e-9)
    assert float(again.range_m) == pytest.approx(float(first.range_m), rel=1e-9)


def test_tilt_and_place_agree_with_a_drawn_triangle():
    """A 2 m pole, middle at (1, 0, 10) m, far end turned away by 30 degrees: seen by f = 1000 px.

    0.134 -------- 1.866 across, 9.5 to 10.5 deep
    """
    z = np.array([9.5, 10.5])
    x = 1 + math.cos(math.radians(30)) * np.array([-1.0, 1.0])
    left, right = 1000 * x / z
    q = Quantity.exact
    found = calculator(
        Inputs(q(0.036, "m"), q(3600, "px"), q(0.010, "m"), q(2.0, "m"), q(right - left, "px"), tilt=q(math.radians(30), "rad"),
               offset_x=q((left + right) / 2, "px"), focus=q(0, "1"))
    )  # fmt: skip
    assert float(found.distance_m) == pytest.approx(10.0)
    assert float(found.range_m) == pytest.approx(math.hypot(10, 1))


def test_sensor_by_height_and_by_diagonal():
    wide = {"focal": 35, "image_width": 4000, "image_height": 3000, "size": 200, "extent": 150}
    expected = typed(**wide, sensor_width="36 exact").measurements[0].value
    assert typed(**wide, sensor_height="27 exact").measurements[0].value == pytest.approx(expected)
    assert typed(**wide, sensor_diagonal="45 exact").measurements[0].value == pytest.approx(expected)


def test_extent_along_the_height_of_oblong_pixels():
    found = typed(**{**BELT, "image_height": 3000, "along": "height", "aspect": "2"})
    assert found.measurements[0].value * 1000 == pytest.approx(2 * 13_556.50, abs=0.01)


def test_depth_and_range_are_both_given_off_the_axis():
    found = by_what(typed(**BELT, offset="2000,1000"))
    f = 35 / 14.1 * 4096
    assert found["depth"].value * 1000 == pytest.approx(13_556.50, abs=0.005)
    assert found["range"].value / found["depth"].value == pytest.approx(math.hypot(1, 2000 / f, 1000 / f))
    assert "off_axis" in {n.code for n in found["depth"].notes}


def test_defaults_are_marked_assumed():
    budget = {c.name: c.source for c in typed(**BELT).measurements[0].budget}
    assert set(budget) >= {"focal length", "sensor width", "size", "extent", "focus"}
    assert all(source.startswith("assumed") for source in budget.values())


def close_up(distance):
    """The headline and the notes of a 35 mm lens at a classical distance, in m."""
    extent = 0.2 * 35 / 14.1 * 4096 / distance
    document = typed(**{**BELT, "image_width": 4096, "size": "20 exact", "extent": f"{extent / 10} px exact"})
    return document.measurements[0]


def test_close_up_the_classical_value_stays_and_the_thin_lens_value_is_noted():
    near = close_up(1.0)
    assert near.value == pytest.approx(1.0)
    note = next(n for n in near.notes if n.code == "close_focus")
    assert "1035.00 mm" in note.text
    assert "close_focus" not in {n.code for n in close_up(2.0).notes}


def test_the_focus_term_has_no_jump_at_the_limit_of_the_note():
    u = [close_up(d) for d in (1.7499, 1.7501)]
    assert u[0].u == pytest.approx(u[1].u, rel=1e-3)
    share = {c.name: c.share for c in u[0].budget}["focus"]
    assert share > 0.05


def test_presets_are_ranges():
    found = typed(preset="smartphone", size="1.75 m", extent=600)
    assert found.measurements[0].high / found.measurements[0].low > 1.5
    assert any("preset smartphone" in c.source for c in found.measurements[0].budget)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"size": 0}, "--size"), ({"size": -3}, "--size"), ({"focal": "abc"}, "--focal"), ({"extent": 5000}, "extent"),
        ({"sensor_width": "5 px"}, "--sensor-width"), ({"image_width": "0"}, "--image-width"), ({"preset": "hubble"}, "preset"),
        ({"tilt": "90"}, "tilt"), ({"offset": "a,b"}, "--offset"), ({"distance": "3 m"}, "leave out exactly one"),
    ],
)  # fmt: skip
def test_bad_input_is_named(change, says):
    with pytest.raises(InputError, match=says):
        typed(**{**BELT, **change})


def test_an_extent_higher_than_the_picture_is_refused():
    with pytest.raises(InputError, match="3000 px along its height"):
        typed(**{**BELT, "image_height": 3000, "along": "height", "extent": 3500})


def test_two_unknowns_are_refused():
    texts = dict(BELT)
    del texts["size"]
    with pytest.raises(InputError, match="exactly one"):
        typed(**texts)


def test_an_impossible_tilt_has_no_answer():
    with pytest.raises(GeometryError):
        typed(**{**BELT, "focal": 8, "tilt": "89 exact", "offset": "2000,0", "size": "200"})


def test_the_interval_is_never_without_the_value():
    for distance in (0.06, 0.1, 1.0):
        near = close_up(distance)
        assert near.low <= near.value <= near.high
