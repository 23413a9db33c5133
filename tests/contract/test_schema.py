"""The JSON of every command obeys docs/schema.json; a document that does not is seen."""

import json

import pytest
from click.testing import CliRunner
from jsonschema import Draft202012Validator

from subtense.cli import main

pytestmark = pytest.mark.opencv

COMMANDS = [
    "calc --focal 35 --sensor-width 14.1 --image-width 4096 --size 200 --extent 150",
    "calc --preset smartphone --size 1.75m --distance 3m",
    "calc --focal 35 --sensor-width 14.1 --image-width 4096 --size 200 --extent 1",
    "camera {examples}/desk.jpg",
    "camera {examples}/facade.jpg --camera fov=50deg",
    "measure {examples}/desk.jpg --marker-size 50mm",
    "measure {examples}/belt.jpg --line 500,600,1033,600 --size 200",
]


@pytest.fixture(scope="module")
def validator(request):
    schema = json.loads((request.config.rootpath / "docs" / "schema.json").read_text())
    Draft202012Validator.check_schema(schema)
    return Draft202012Validator(schema)


@pytest.mark.parametrize("command", COMMANDS)
def test_obeys_the_schema(validator, examples, command):
    words = [word.replace("{examples}", str(examples)) for word in command.split()]
    result = CliRunner().invoke(main, [*words, "--format", "json"], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    document = json.loads(result.output, parse_constant=lambda name: pytest.fail(f"{name} in the JSON"))
    validator.validate(document)


@pytest.mark.parametrize("change", [{"schema": "subtense/2"}, {"extra": 1}, {"measurements": [{}]}])
def test_the_schema_sees_a_wrong_document(validator, change):
    good = {"schema": "subtense/1", "version": "0", "photo": None, "camera": None, "measurements": [], "notes": []}
    assert validator.is_valid(good)
    assert not validator.is_valid({**good, **change})
