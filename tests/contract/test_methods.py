"""What every row of METHODS must keep, so that a new one gets the rest for nothing."""

import dataclasses
import json

import numpy as np
import pytest
from click.testing import CliRunner

from subtense import propagate
from subtense.camera import Camera
from subtense.cli import main
from subtense.noun import Noun
from subtense.quantity import Quantity
from subtense.workflow.given import given, inputs_from_json, noun_types
from subtense.workflow.tables import METHODS

pytestmark = pytest.mark.opencv


@pytest.fixture(params=METHODS)
def method(request):
    return METHODS[request.param]


def test_is_documented(method):
    assert method.name == next(name for name, m in METHODS.items() if m is method)
    assert method.function.__doc__ and "Source" in method.function.__doc__
    assert method.assumes and method.source and method.typical and method.needs
    for field in dataclasses.fields(method.inputs):
        assert f"{field.name}: " in method.inputs.__doc__


def test_inputs_are_frozen_and_hold_nouns_quantities_or_plain_choices(method):
    assert method.inputs.__dataclass_params__.frozen
    for name, kind in noun_types(method.inputs).items():
        assert issubclass(kind, (Noun, bool, str)), f"{name} is a {kind}"
        if kind is Quantity:
            field = next(f for f in dataclasses.fields(method.inputs) if f.name == name)
            assert field.metadata.get("unit"), f"{name} has no unit"


def test_contains_no_sigma(method):
    """The function sees numbers only: the same whatever the u of its inputs."""
    import inspect

    source = inspect.getsource(method.function)
    assert ".cov" not in source and "sigma" not in source.split('"""')[-1]


def test_example_is_measured_and_its_budget_sums_to_one(method):
    found = propagate.measure(method, method.example(), given=given(method.example()))
    assert [m.what for m in found] == [output.what for output in method.outputs]
    for m, output in zip(found, method.outputs, strict=True):
        assert m.unit == output.unit and m.method == method.name
        assert m.low <= m.value <= m.high
        assert sum(c.share for c in m.budget) == pytest.approx(1) or not m.budget
        assert json.dumps(m.to_json(), allow_nan=False)


def test_survives_json(method):
    inputs = method.example()
    again = inputs_from_json(method, json.loads(json.dumps(given(inputs))))
    first, second = (propagate.measure(method, i) for i in (inputs, again))
    assert [(m.value, m.u, m.low, m.high) for m in first] == [(m.value, m.u, m.low, m.high) for m in second]


def test_broadcasts_over_draws(method):
    draws = propagate.sample(method, method.example(), 50, seed=1)
    assert draws.values.shape == (len(method.outputs), 50)
    assert np.isfinite(draws.values).all()
    assert (draws.reason == 0).all()


def test_is_on_the_command_line(method, tmp_path):
    path = tmp_path / "inputs.json"
    path.write_text(json.dumps(given(method.example())))
    runner = CliRunner()
    help_text = runner.invoke(main, ["method", method.name, "--help"], catch_exceptions=False).output
    for field in dataclasses.fields(method.inputs):
        assert "--" + field.name.replace("_", "-") in help_text
    result = runner.invoke(
        main, ["method", method.name, "--inputs", str(path), "--format", "json"], catch_exceptions=False
    )
    assert result.exit_code == 0
    value = propagate.measure(method, method.example())[0].value
    assert json.loads(result.output)["measurements"][0]["value"] == pytest.approx(value)


def test_places_what_it_ranges(method):
    """Range and depth are those of the place, whatever is moved."""
    names = [output.name for output in method.outputs]
    if method.place is None:
        assert method.name not in ("known_size", "pose", "ground_plane", "circle", "sphere")
        return
    inputs = method.prepare(method.example())
    start = (method.start(inputs),) if method.start else ()
    grown = inputs.camera.moved({"0": np.asarray(inputs.camera.f_px) * np.array([[1.0, 1.03]])})
    inputs = dataclasses.replace(inputs, camera=grown)
    place, result = method.place(inputs, *start), method.function(inputs, *start)
    assert place.shape == (2, 3)
    assert np.linalg.norm(place, axis=-1) == pytest.approx(result.range_m, rel=1e-9)
    assert "depth_m" not in names or place[..., 2] == pytest.approx(result.depth_m, rel=1e-9)


@pytest.mark.parametrize("only", range(4), ids=("f_px", "aspect", "cx_px", "cy_px"))
def test_a_camera_with_one_doubtful_number(method, only):
    inputs = method.example()
    camera = getattr(inputs, "camera", None)
    if not isinstance(camera, Camera):
        return
    cov = np.zeros((4 + camera.coefficients.size,) * 2)
    cov[only, only] = 1e-8 if only == 1 else 1.0
    inputs = dataclasses.replace(inputs, camera=dataclasses.replace(camera, cov=cov))
    for m in propagate.measure(method, inputs, draws=2_000):
        assert m.low <= m.value <= m.high
