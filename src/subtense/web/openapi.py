"""The OpenAPI document: schemas of documents and problems, and what every route may answer."""

from __future__ import annotations

import json
from importlib.resources import files
from typing import Any

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi
from pydantic import BaseModel

PROBLEM = {
    "type": "object", "required": ["error"],
    "properties": {"error": {
        "type": "object", "required": ["type", "name", "message"],
        "properties": {
            "type": {"type": "string", "description": "InputError, GeometryError, UnknownCameraError, FileFormatError, Limit, ..."},
            "name": {"type": ["string", "null"], "description": "the field, limit or reason it is about"},
            "given": {"description": "what was given for it"},
            "message": {"type": "string", "description": "one line: the value, what is allowed, what to do"},
        },
    }},
}  # fmt: skip
STATUSES = {
    400: "no JSON, or no or several Host headers", 401: "no token", 403: "from another site, or to another name",
    404: "no such thing here (any more)", 405: "no such method", 413: "over a limit", 415: "not the content type the route takes",
    422: "can't be used, or has no honest answer: the message says why", 501: "needs an extra that is not installed",
    503: "too many are waiting; Retry-After says for how long",
}  # fmt: skip
JSON = "application/json"


def ref(name: str) -> dict[str, Any]:
    """A reference to a schema of this document."""
    return {"$ref": f"#/components/schemas/{name}"}


def gives(model: type[BaseModel], status: int = 200) -> dict[int | str, Any]:
    """`responses` of a route that gives JSON of this model."""
    return {status: {"description": "the answer", "model": model}}


def answers(schema: dict[str, Any], *, status: int = 200, more: dict[str, Any] | None = None) -> dict[int | str, Any]:
    """`responses` of a route that gives JSON of this schema; `more` are further content types."""
    return {status: {"description": "the answer", "content": {JSON: {"schema": schema}, **(more or {})}}}


def reports() -> dict[str, Any]:
    """Content types of `?format=` besides JSON."""
    from ..workflow.report_of import REPORTS

    types = [r.media_type for r in REPORTS.values() if r.media_type != JSON]
    binary = {"type": "string", "format": "binary"}
    return {kind: {"schema": {"type": "string"} if kind.startswith("text/") else binary} for kind in types}


def document_schemas() -> dict[str, Any]:
    """The schema of `--format json`, its parts as schemas of their own."""
    text = (
        files("subtense").joinpath("data/schema.json").read_text("utf-8").replace("#/$defs/", "#/components/schemas/")
    )
    whole = json.loads(text)
    parts = whole.pop("$defs")
    for key in ("$schema", "$id"):
        whole.pop(key)
    return {"document": whole, **parts}


def install(app: FastAPI) -> None:
    """Have the app give this document."""

    def made() -> dict[str, Any]:
        if app.openapi_schema is None:
            found = get_openapi(title=app.title, version=app.version, summary=app.summary, description=app.description,
                                routes=app.routes, openapi_version="3.1.0")  # fmt: skip
            _complete(found)
            app.openapi_schema = found
        return app.openapi_schema

    app.openapi = made  # type: ignore[method-assign]


def _complete(found: dict[str, Any]) -> None:
    schemas = found.setdefault("components", {}).setdefault("schemas", {})
    for name in ("HTTPValidationError", "ValidationError"):
        schemas.pop(name, None)
    schemas |= {**document_schemas(), "Problem": PROBLEM}
    found["components"]["securitySchemes"] = {"token": {"type": "http", "scheme": "bearer"}}
    found["security"] = [{"token": []}]
    for operations in found["paths"].values():
        for operation in operations.values():
            for status, text in STATUSES.items():
                operation["responses"][str(status)] = {
                    "description": text,
                    "content": {JSON: {"schema": ref("Problem")}},
                }
