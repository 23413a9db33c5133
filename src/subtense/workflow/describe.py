"""The tables in words and JSON Schema, for faces that build their forms and checks from them."""

from __future__ import annotations

import dataclasses
import re
from typing import Any

from ..camera import Camera
from ..method import Method
from ..noun import Noun
from ..observation import Observation
from ..quantity import Quantity
from ..rig import Rig
from ..target import Target
from ..views import Track, Views
from .given import given, noun_types
from .tables import DETECTORS, METHODS

_NUMBER = {"type": "number"}
_NUMBERS = {"type": "array", "items": _NUMBER}
_TEXT = {"type": "string"}
_LAW = {"anyOf": [_TEXT, {"type": "object"}]}

NOUNS: dict[type, dict[str, Any]] = {
    Quantity: {
        "required": ["value", "u"],
        "properties": {"value": _NUMBER, "u": {"type": "number", "minimum": 0}, "unit": _TEXT, "distribution": _LAW,
                       "dof": _NUMBER, "source": _TEXT, "id": _TEXT},
    },
    Observation: {
        "required": ["points_px"],
        "properties": {
            "points_px": {"type": "array", "items": {"type": "array", "items": _NUMBER, "minItems": 2, "maxItems": 2}},
            "sigma_px": {"anyOf": [{"type": "number", "minimum": 0}, _NUMBERS]},
            "cov": {"type": ["array", "null"], "items": _NUMBERS}, "label": _TEXT, "score": _NUMBER, "source": _TEXT,
            "id": _TEXT,
        },
    },
    Target: {
        "required": ["name", "points_m"],
        "properties": {"name": _TEXT, "points_m": {"type": "array", "items": _NUMBERS}, "u_scale": _NUMBER,
                       "sigma_m": _NUMBER, "scale_distribution": _LAW, "source": _TEXT, "id": _TEXT},
    },
    Camera: {
        "required": ["width_px", "height_px", "f_px", "cx_px", "cy_px"],
        "properties": {"width_px": {"type": "integer", "minimum": 1}, "height_px": {"type": "integer", "minimum": 1},
                       "f_px": _NUMBER, "cx_px": _NUMBER, "cy_px": _NUMBER, "aspect": _NUMBER, "lens": _TEXT,
                       "distortion": _NUMBERS, "cov": {"type": ["array", "null"], "items": _NUMBERS}},
    },
    Rig: {
        "required": ["left", "right", "right_from_left", "cov"],
        "properties": {"left": {"type": "object"}, "right": {"type": "object"}, "right_from_left": {"type": "object"},
                       "cov": {"type": "array", "items": _NUMBERS}, "source": _TEXT, "part_sources": {"type": "object"},
                       "id": _TEXT},
    },
    Views: {
        "required": ["names", "cameras", "rotation", "centre_m"],
        "properties": {"names": {"type": "array", "items": _TEXT}, "cameras": {"type": "array", "items": {"type": "object"}},
                       "rotation": {"type": "array"}, "centre_m": {"type": "array", "items": _NUMBERS},
                       "camera_of": {"type": ["array", "null"], "items": {"type": "integer", "minimum": 0}},
                       "cov": {"type": ["array", "null"], "items": _NUMBERS}, "u_scale": {"type": "number", "minimum": 0},
                       "source": _TEXT, "scale_source": _TEXT, "id": _TEXT},
    },
    Track: {
        "required": ["names", "seen"],
        "properties": {"names": {"type": "array", "items": _TEXT}, "seen": {"type": "object"}, "id": _TEXT},
    },
}  # fmt: skip
"""The JSON of each noun, as `to_json` writes it."""

_SAME = {"type": "object", "required": ["$ref"], "properties": {"$ref": {**_TEXT, "pattern": "^#/given/[a-z_]+$"}},
         "description": "the very same as an earlier field"}  # fmt: skip
_ALSO_TYPED = "as an object, or as text as on the command line"


def methods() -> list[dict[str, Any]]:
    """Every row of METHODS: words, outputs, and the JSON Schema of its inputs."""
    return [describe(method) for method in METHODS.values()]


def describe(method: Method) -> dict[str, Any]:
    """One method: what it needs, assumes and gives."""
    return {
        "name": method.name, "title": method.title, "button": method.button or method.name, "needs": method.needs,
        "assumes": list(method.assumes),
        "source": method.source, "typical": method.typical,
        "outputs": [{"what": o.what, "unit": o.unit, "title": o.title} for o in method.outputs],
        "inputs": schema(method), "example": given(method.example()),
    }  # fmt: skip


def schema(method: Method) -> dict[str, Any]:
    """JSON Schema (2020-12) of a method's inputs; `x-` keys tell a form what to show."""
    kinds = noun_types(method.inputs)
    fields = dataclasses.fields(method.inputs)
    required = [f.name for f in fields if f.default is dataclasses.MISSING and f.default_factory is dataclasses.MISSING]
    return {
        "type": "object", "additionalProperties": False, "required": required,
        "properties": {f.name: _property(method.inputs, f, kinds[f.name]) for f in fields},
    }  # fmt: skip


def _property(inputs: type, field: Any, kind: type) -> dict[str, Any]:
    text = field_text(inputs, field.name)
    if not issubclass(kind, Noun):
        return {"type": {bool: "boolean", str: "string"}[kind], "description": text, "x-widget": "text"}
    found: dict[str, Any] = {
        "description": text, "x-noun": kind.__name__, "x-widget": kind.widget,
        "anyOf": [{"type": "string", "description": _ALSO_TYPED}, {"type": "object", **NOUNS[kind]}, _SAME],
    }  # fmt: skip
    for key in ("unit", "points", "least", "more", "closed"):
        if key in field.metadata:
            found[f"x-{key}"] = field.metadata[key]
    found["x-typed"] = "assume" in field.metadata or (kind is not Quantity)
    return found


def field_text(inputs: type, name: str) -> str:
    """What the Inputs' docstring says of a field."""
    match = re.search(rf"^\s*{name}: (.*?)(?=^\s*\w+: |\Z)", inputs.__doc__ or "", re.MULTILINE | re.DOTALL)
    return " ".join(match.group(1).split()) if match else ""


def detectors() -> list[dict[str, Any]]:
    """Every row of DETECTORS."""
    names = ("name", "title", "groups", "asks", "automatic", "extra")
    return [{name: getattr(detector, name) for name in names} for detector in DETECTORS.values()]
