"""The inputs of a method as JSON: enough to measure again."""

from __future__ import annotations

from typing import Any

from ..noun import Noun, fields_of


def given(inputs: Any) -> dict[str, Any]:
    """The inputs of a method in JSON; a noun that stands twice is written once and referred to."""
    seen: dict[Any, str] = {}
    data: dict[str, Any] = {}
    for name, value in fields_of(inputs).items():
        if isinstance(value, Noun):
            if value.identity in seen:
                data[name] = {"$ref": seen[value.identity]}
                continue
            data[name] = value.to_json()
            seen[value.identity] = f"#/given/{name}"
        else:
            data[name] = value
    return data
