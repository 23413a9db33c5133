from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from subtense import propagate
from subtense.camera import Camera
from subtense.errors import GeometryError, InputError
from subtense.method import Method, Output, Reason
from subtense.methods import known_size
from subtense.observation import Observation
from subtense.quantity import Quantity

CAMERA = Camera(1600, 1200, 1500.0, 799.5, 599.5, cov=np.diag([15.0**2, 1e-6, 16.0, 16.0]))


def scene(camera=CAMERA, ends=((700, 600), (900, 620)), sigma=0.7, size=None, **more):
    size = size or Quantity.normal(0.2, 0.001, "m")
    return known_size.Inputs(camera, Observation(np.array(ends, float), sigma), size, **more)


def measured(inputs, **more):
    return propagate.measure(known_size.METHOD, inputs, **more)


def stub(function, **more):
    """A method of one number from one quantity, `x`."""
    from dataclasses import make_dataclass

    inputs = make_dataclass("Inputs", [("x", Quantity)], frozen=True)
    result = make_dataclass("Result", ["y", "reason"], frozen=True)

    def run(given):
        value, reason = function(np.asarray(given.x.value, float))
        return result(value, np.asarray(reason, np.int8))

    method = Method(
        "stub",
        "a stub",
        inputs,
        (Output("y", "length", "m", "y"),),
        run,
        ("none",),
        "none",
        "none",
        lambda: None,
        **more,
    )
    return method, inputs


def test_budget_shares_sum_to_one_and_the_largest_stands_first():
    for m in measured(scene()):
        shares = [c.share for c in m.budget]
        assert sum(shares) == pytest.approx(1.0)
        assert shares == sorted(shares, reverse=True)


def test_differences_agree_with_draws():
    inputs = scene()
    first = propagate.first_order(known_size.METHOD, inputs)
    draws = propagate.sample(known_size.METHOD, inputs, 300_000)
    assert first.u == pytest.approx(draws.u, rel=0.01)
    assert first.cov == pytest.approx(draws.cov, rel=0.02)


def test_differences_agree_with_the_methods_own_derivative():
    rng = np.random.default_rng(4)
    start = rng.uniform(100, 1000, (500, 1, 2))
    points = np.concatenate([start, start + rng.uniform(50, 300, (500, 1, 2))], axis=1)
    camera = Camera(
        1600, 1200, 1500.0, 799.5, 599.5, 1.01, cov=np.diag([15.0**2, 1e-6, 16.0, 16.0]), nominal_focal_m=0.02
    )
    inputs = known_size.Inputs(camera, Observation(points, 0.05), Quantity(rng.uniform(0.1, 1, 500), 1e-4, "m"))
    own, by_differences = propagate.rows(known_size.METHOD, inputs), propagate.first_order(known_size.METHOD, inputs)
    assert own.lines == by_differences.lines
    assert own.value == pytest.approx(by_differences.value)
    assert own.contributions == pytest.approx(by_differences.contributions, rel=1e-4, abs=1e-9)


def test_rows_give_what_single_scenes_give():
    points = np.array([[[700, 600], [900, 620]], [[100, 100], [180, 90]], [[800, 200], [800, 900]]], float)
    sizes = np.array([0.2, 0.3, 1.0])
    many = propagate.rows(
        known_size.METHOD, known_size.Inputs(CAMERA, Observation(points), Quantity(sizes, 0.001, "m")), chunk=2
    )
    for i in range(3):
        one = propagate.first_order(
            known_size.METHOD, scene(ends=points[i], size=Quantity.normal(sizes[i], 0.001, "m"))
        )
        assert many.value[:, i] == pytest.approx(one.value)
        assert many.u[:, i] == pytest.approx(one.u, rel=1e-3)


def test_rows_may_differ_in_their_sigma():
    points = np.tile(np.array([[700.0, 600], [900, 620]]), (5, 1, 1))
    sigma = np.linspace(0.1, 0.5, 5)[:, None] * np.ones(2)
    inputs = known_size.Inputs(CAMERA, Observation(points, sigma), Quantity.normal(0.2, 0.001, "m"))
    for method in (known_size.METHOD, replace(known_size.METHOD, derivative=None)):
        found = propagate.rows(method, inputs, chunk=2)
        for i in range(5):
            one = propagate.first_order(known_size.METHOD, scene(sigma=float(sigma[i, 0])))
            assert found.u[:, i] == pytest.approx(one.u, rel=1e-3)


def test_one_noun_in_two_fields_stays_one_over_rows():
    @dataclass(frozen=True)
    class Pair:
        a: Quantity
        b: Quantity

    @dataclass(frozen=True)
    class Gap:
        y: np.ndarray
        reason: np.ndarray

    def gap(pair):
        y = np.asarray(pair.a.value) - np.asarray(pair.b.value)
        return Gap(y, np.zeros(y.shape, np.int8))

    method = Method(
        "gap", "a stub", Pair, (Output("y", "length", "m", "y"),), gap, ("none",), "none", "none", lambda: None
    )
    rows = Quantity(np.arange(1.0, 8), 0.1, "m")
    other = Quantity(np.arange(1.0, 8), 0.1, "m")
    assert propagate.rows(method, Pair(rows, rows), chunk=3).u == pytest.approx(0)
    assert propagate.rows(method, Pair(rows, other), chunk=3).u == pytest.approx(0.1 * np.sqrt(2))


def test_a_row_without_an_answer_is_nan_with_its_reason():
    points = np.array([[[700, 600], [900, 620]], [[100, 100], [100, 100]]], float)
    found = propagate.rows(
        known_size.METHOD, known_size.Inputs(CAMERA, Observation(points), Quantity.normal(0.2, 0.001, "m"))
    )
    assert found.reason.tolist() == [Reason.OK, Reason.ZERO_EXTENT]
    assert np.isfinite(found.value[:, 0]).all() and np.isnan(found.value[:, 1]).all()


def test_one_scene_without_an_answer_is_an_error_with_its_code():
    with pytest.raises(GeometryError) as caught:
        measured(scene(ends=((700, 600), (700, 600))))
    assert caught.value.code == "zero_extent"


def test_a_bent_response_is_drawn_and_its_interval_is_lopsided():
    m = measured(scene(ends=((700, 600), (710, 600)), sigma=1.0))[0]
    assert m.evaluation.startswith("Monte Carlo")
    assert m.high - m.value > 1.2 * (m.value - m.low)
    assert "interaction" in {c.name for c in m.budget}


def test_the_second_order_interval_is_that_of_draws():
    inputs = scene(sigma=2.0)
    m = measured(inputs)[0]
    assert m.evaluation == "second order"
    low, high = propagate.sample(known_size.METHOD, inputs, 1_000_000, seed=3).interval(0)
    assert (m.low, m.high) == pytest.approx((low, high), abs=0.02 * m.u)


def test_a_single_uncertain_input_is_mapped_exactly():
    camera = Camera(1600, 1200, 1500.0, 799.5, 599.5)
    m = measured(scene(camera, sigma=0.0, size=Quantity.uniform(0.1, 0.3, "m")))[1]
    per_metre = m.value / 0.2
    assert m.evaluation.startswith("mapped")
    assert (m.low, m.high) == pytest.approx((0.105 * per_metre, 0.295 * per_metre))


def test_clause_8_of_jcgm_101_holds_for_what_is_given_at_first_order():
    """Where the switch stays at first order, draws move no interval end by more than the tolerance."""
    rng = np.random.default_rng(7)
    checked = 0
    for _ in range(25):
        inputs = scene(ends=((700, 600), (700 + rng.uniform(100, 800), 600)), sigma=rng.uniform(0.1, 1.0))
        m = measured(inputs)[0]
        if m.evaluation == "first order":
            low, high = propagate.sample(known_size.METHOD, inputs, 400_000).interval(0)
            tolerance = 0.05 * 10 ** np.floor(np.log10(m.u))
            assert abs(m.low - low) < tolerance + 0.01 * m.u and abs(m.high - high) < tolerance + 0.01 * m.u
            checked += 1
    assert checked >= 5


def open_far(x):
    """1 / x, which has no answer at or below 0 and grows without limit on the way there."""
    with np.errstate(divide="ignore"):
        return np.where(x > 0, 1 / x, np.nan), np.where(x > 0, Reason.OK, Reason.ZERO_EXTENT)


def test_an_open_interval_is_told():
    method, inputs = stub(open_far)
    (m,) = propagate.measure(method, inputs(Quantity.normal(1.0, 1.2)))
    assert m.high is None and m.u is None
    assert m.low == pytest.approx(1 / (1 + 1.96 * 1.2), rel=0.02)
    note = next(n for n in m.notes if n.code == "open_interval")
    assert "far limit open" in note.text and "20 % of the draws have no answer" in note.text


def test_a_tail_without_a_standard_deviation_is_told():
    method, inputs = stub(open_far)
    (m,) = propagate.measure(method, inputs(Quantity.normal(1.0, 0.45)))
    assert m.high is not None and m.u is None
    assert [n.code for n in m.notes] == ["heavy_tail"]


def test_too_few_answers_leave_both_limits_open():
    method, inputs = stub(
        lambda x: (np.where(abs(x) < 0.1, x, np.nan), np.where(abs(x) < 0.1, 0, Reason.NOT_CONVERGED))
    )
    (m,) = propagate.measure(method, inputs(Quantity.normal(0.0, 1.0)))
    assert m.low == 0 and m.high is None  # a length: below 0 it can't be


def test_the_same_noun_is_moved_once():
    """Two distances through one camera: their difference does not feel the focal length."""
    exact = Quantity.exact(0.2, "m")
    pairs = [(known_size.METHOD, scene(sigma=0.0, size=exact)), (known_size.METHOD, scene(sigma=0.0, size=exact))]
    first, draws = propagate.joint(pairs, draws=20_000)
    assert first.names == ("1.range_m", "1.depth_m", "2.range_m", "2.depth_m")
    assert np.std(draws.values[0] - draws.values[2]) == pytest.approx(0, abs=1e-12)
    assert first.cov[0, 2] == pytest.approx(first.cov[0, 0])
    other = replace(CAMERA, source="another camera")
    _, apart = propagate.joint([pairs[0], (known_size.METHOD, scene(other, sigma=0.0, size=exact))], draws=20_000)
    assert np.std(apart.values[0] - apart.values[2]) == pytest.approx(np.sqrt(2) * np.std(draws.values[0]), rel=0.05)


def test_equal_texts_are_two_quantities():
    def total(a, b):
        return a + b

    def q(**more):
        return Quantity(1.0, 0.1, **more)

    assert propagate.first_order(total, {"a": q(), "b": q()}).u[0] == pytest.approx(0.1 * np.sqrt(2))
    assert propagate.first_order(total, {"a": q(id="tape"), "b": q(id="tape")}).u[0] == pytest.approx(0.2)


@given(st.floats(-0.99, 0.99))
def test_correlation_of_a_sum(r):
    found = propagate.first_order(
        lambda a, b: a + b, {"a": Quantity.normal(1, 0.3), "b": Quantity.normal(1, 0.4)}, correlations={("a", "b"): r}
    )
    assert found.u[0] ** 2 == pytest.approx(0.25 + 2 * r * 0.12)
    assert found.lines == ("a, b",)


def test_impossible_correlations_are_refused():
    q = {"a": Quantity.normal(1, 1), "b": Quantity.normal(1, 1), "c": Quantity.exact(1)}
    for pairs in ({("a", "b"): 1.5}, {("a", "x"): 0.1}, {("a", "c"): 0.1}):
        with pytest.raises(InputError):
            propagate.first_order(lambda a, b, c: a + b + c, q, correlations=pairs)
    q["c"] = Quantity.normal(1, 1)
    with pytest.raises(InputError, match="semi-definite"):
        propagate.first_order(
            lambda a, b, c: a + b + c, q, correlations={("a", "b"): 0.9, ("b", "c"): 0.9, ("a", "c"): -0.9}
        )


def test_four_times_the_draws_change_u_by_less_than_half_a_percent():
    u = [propagate.sample(known_size.METHOD, scene(), n, seed=n).u[0] for n in (100_000, 400_000)]
    assert u[0] == pytest.approx(u[1], rel=0.005)


def test_the_seed_decides():
    draws = [propagate.sample(known_size.METHOD, scene(), 1000, seed=s).values for s in (1, 1, 2)]
    assert (draws[0] == draws[1]).all()
    assert not (draws[0] == draws[2]).all()


def test_zero_noise_leaves_the_reference_only():
    camera = Camera(1600, 1200, 1500.0, 799.5, 599.5)
    m = measured(scene(camera, sigma=0.0))[0]
    assert [c.name for c in m.budget] == ["size"]
    assert m.u / m.value == pytest.approx(0.005)
    exact = measured(scene(camera, sigma=0.0, size=Quantity.exact(0.2, "m")))[0]
    assert (exact.u, exact.low, exact.high, exact.budget) == (0.0, exact.value, exact.value, ())


@given(st.sampled_from(["size", "sigma", "focal", "tilt"]), st.floats(1.05, 5))
def test_u_grows_with_the_u_of_every_input(what, factor):
    def u(k):
        camera = Camera(
            1600, 1200, 1500.0, 799.5, 599.5, cov=np.diag([(10 * (k if what == "focal" else 1)) ** 2, 0, 1, 1])
        )
        inputs = scene(
            camera,
            sigma=0.3 * (k if what == "sigma" else 1),
            size=Quantity.normal(0.2, 1e-3 * (k if what == "size" else 1), "m"),
            tilt=Quantity.normal(0.3, 0.01 * (k if what == "tilt" else 1), "rad"),
        )
        return propagate.first_order(known_size.METHOD, inputs).u

    assert (u(factor) > u(1.0)).all()


def test_level_and_leading_axes_are_checked():
    with pytest.raises(InputError, match="coverage"):
        measured(scene(), level=1.5)
    with pytest.raises(InputError, match="one scene"):
        measured(scene(size=Quantity(np.array([0.1, 0.2]), 0.01, "m")))


def test_wider_levels_give_wider_intervals():
    spans = [m.high - m.low for m in (measured(scene(), level=level)[0] for level in (0.5, 0.68, 0.95, 0.99))]
    assert spans == sorted(spans)


def test_mean_of_readings_has_their_degrees_of_freedom():
    q = propagate.mean_of([1.0, 1.1, 0.9, 1.0], "m")
    assert (q.value, q.dof) == (pytest.approx(1.0), 3)
    assert q.u == pytest.approx(np.std([1.0, 1.1, 0.9, 1.0], ddof=1) / 2)
    with pytest.raises(InputError, match="two or more"):
        propagate.mean_of([1.0])


def test_shortest_interval_of_a_skewed_law_is_shorter():
    draws = propagate.sample(lambda x: x**2, {"x": Quantity.normal(0, 1)}, 100_000)
    low, high = draws.interval()
    short = draws.shortest()
    assert short[1] - short[0] < high - low
    assert short[0] == pytest.approx(0, abs=0.01)
