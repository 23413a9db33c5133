"""The OpenAPI document holds: for any request it allows or not, the server keeps to what it says of its answers."""

import json

import pytest
import schemathesis
from hypothesis import HealthCheck, settings
from jsonschema import Draft202012Validator
from running import picture
from schemathesis.checks import not_a_server_error
from schemathesis.core.failures import FailureGroup
from schemathesis.specs.openapi import checks

from subtense.web.app import create_app
from subtense.web.settings import Settings


def described() -> dict:
    app = create_app(Settings("t" * 32))
    app.state.subtense.photos.close()
    return app.openapi()


DOCUMENT = described()
SCHEMA = schemathesis.openapi.from_dict(DOCUMENT)
OPERATIONS = [(path, method) for path, item in DOCUMENT["paths"].items() for method in item]
CHECKS = [
    not_a_server_error, checks.status_code_conformance, checks.content_type_conformance, checks.response_schema_conformance,
    checks.response_headers_conformance, checks.negative_data_rejection,
]  # fmt: skip


@pytest.fixture(scope="module")
def photo(server, examples) -> str:
    return server.photo((examples / "desk.jpg").read_bytes(), "desk.jpg")["id"]


# -- the document itself ---------------------------------------------------------------------------------


def test_the_server_gives_this_document(server):
    assert server.client.get("/api/openapi.json").json() == json.loads(json.dumps(DOCUMENT))
    assert server.ask("GET /api/openapi.json", token=False).status == 401
    for path in ("/docs", "/redoc", "/docs/oauth2-redirect", "/openapi.json"):
        assert server.client.get(path).status_code == 404


def test_the_document_is_valid():
    assert DOCUMENT["openapi"].startswith("3.1.")
    SCHEMA.validate()
    for schema in DOCUMENT["components"]["schemas"].values():
        Draft202012Validator.check_schema(schema)
    assert (
        DOCUMENT["security"] == [{"token": []}]
        and DOCUMENT["components"]["securitySchemes"]["token"]["scheme"] == "bearer"
    )


def references(node) -> set[str]:
    if isinstance(node, dict):
        found = {node["$ref"]} if isinstance(node.get("$ref"), str) else set()
        return found.union(*(references(value) for value in node.values()))
    return set().union(*(references(value) for value in node)) if isinstance(node, list) else set()


def test_every_schema_is_there_and_used():
    used = {name for name in references(DOCUMENT) if name.startswith("#/components")}
    assert used == {f"#/components/schemas/{name}" for name in DOCUMENT["components"]["schemas"]}


def resolved(schema: dict) -> dict:
    return DOCUMENT["components"]["schemas"][schema["$ref"].rpartition("/")[2]] if "$ref" in schema else schema


def json_body(path, method):
    """What an operation takes as JSON; None where it takes a picture or nothing."""
    return DOCUMENT["paths"][path][method].get("requestBody", {}).get("content", {}).get("application/json")


@pytest.mark.parametrize(("path", "method"), OPERATIONS)
def test_every_operation_is_described(path, method):
    operation = DOCUMENT["paths"][path][method]
    assert operation["summary"] and operation["description"]
    ids = [o["operationId"] for item in DOCUMENT["paths"].values() for o in item.values()]
    assert ids.count(operation["operationId"]) == 1
    good = [answer for status, answer in operation["responses"].items() if status.startswith("2")]
    assert len(good) == 1
    for kind, content in good[0].get("content", {}).items():
        schema = resolved(content["schema"])
        assert schema.get("properties") or schema.get("type") == "string", kind
    body = json_body(path, method)
    if body:
        schema = resolved(body["schema"])
        assert schema["examples"] and schema["additionalProperties"] is False
        whole = {**schema, "components": DOCUMENT["components"]}
        for example in schema["examples"]:
            Draft202012Validator(whole).validate(example)


@pytest.mark.parametrize(("path", "method"), [(p, m) for p, m in OPERATIONS if json_body(p, m)])
def test_every_example_works(server, photo, path, method):
    for example in resolved(json_body(path, method)["schema"])["examples"]:
        place = path.replace("{method}", "known_size").replace("{name}", "markers")
        answer = server.client.request(method, place, json=example)
        assert answer.is_success, answer.text


@pytest.mark.parametrize(("path", "method"), OPERATIONS)
def test_nothing_is_answered_without_the_token(server, path, method):
    answer = server.ask(f"{method.upper()} {path.replace('{', '').replace('}', '')}", token=False)
    assert answer.status == 401 and answer.error["name"] == "token"


# -- the server against the document -----------------------------------------------------------------------


@SCHEMA.parametrize()
@settings(max_examples=12, derandomize=True, deadline=None, suppress_health_check=list(HealthCheck))
def test_answers_are_as_the_document_says(case, server, photo):
    """Where a request is meant to be good, its photo is one that is held, and a sheet is short, for time."""
    body = case.body if isinstance(case.body, dict) else {}
    if case.meta.generation.mode.is_positive:
        if "photo" in case.path_parameters and case.method == "GET":
            case.path_parameters["photo"] = photo
        if "photo" in body:
            case.body = {**body, "photo": photo}
        if "items" in body:
            case.body = {**case.body, "items": body["items"][:3]}
        if "file" in body:
            case.body = {"file": picture(20, 10)}
    # a part of any kind is no photo, but a made-up multipart body may hold one all the same
    asked = [
        check for check in CHECKS if case.operation.path != "/api/photos" or check is not checks.negative_data_rejection
    ]
    case.call_and_validate(base_url=server.address, headers=bearer(server), checks=asked, timeout=60)


def bearer(server) -> dict[str, str]:
    return {"authorization": f"Bearer {server.token}"}


def test_the_check_sees_an_answer_that_is_not_as_described(server, photo):
    """The document is changed, and the server no longer keeps to it."""
    other = json.loads(json.dumps(DOCUMENT))
    other["components"]["schemas"]["Photos"]["properties"]["photos"]["items"] = {"type": "string"}
    case = schemathesis.openapi.from_dict(other)["/api/photos"]["GET"].Case()
    with pytest.raises(FailureGroup, match="1 distinct failure") as seen:
        case.call_and_validate(base_url=server.address, headers=bearer(server), checks=CHECKS)
    assert "Response violates schema" in str(seen.value.exceptions[0])
