"""The inputs of a method as JSON, enough to measure again, and back from JSON or from texts."""

from __future__ import annotations

import dataclasses
import json
import types
import typing
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..errors import FileFormatError, InputError
from ..method import Method
from ..noun import Noun, fields_of
from ..observation import Observation
from ..quantity import Quantity

NAMED = {"m": "no unit", "rad": "no unit"}
"""Units that must be written: what has no unit here is refused rather than read as metres or as millimetres."""


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


def noun_types(inputs: type) -> dict[str, type]:
    """The noun (or plain type) of each field of an Inputs class; `None` beside it is left out."""
    hints = typing.get_type_hints(inputs)
    found = {}
    for field in dataclasses.fields(inputs):
        hint = hints[field.name]
        if isinstance(hint, types.UnionType):
            hint = next(arm for arm in typing.get_args(hint) if arm is not type(None))
        found[field.name] = hint
    return found


def inputs_from_json(method: Method, data: Mapping[str, Any]) -> Any:
    """The Inputs of a method from what `given` wrote.

    Raises:
        InputError: a field that the method does not have, or one that can't be read.
    """
    kinds = noun_types(method.inputs)
    for name, value in data.items():
        if value is not None and not isinstance(value, Mapping) and name in kinds and issubclass(kinds[name], Noun):
            kind = kinds[name].__name__
            raise InputError(f"{name} in the inputs", value, f"give a {kind} as an object, as `given` has it in JSON")
    return read_inputs(method, data)


def read_inputs(method: Method, values: Mapping[str, Any]) -> Any:
    """The Inputs of a method from nouns, JSON of nouns, and texts for nouns, field by field.

    Raises:
        InputError: a field that the method does not have, one that can't be read, or something missing.
    """
    kinds = noun_types(method.inputs)
    units = {field.name: field.metadata.get("unit", "") for field in dataclasses.fields(method.inputs)}
    made: dict[str, Any] = {}
    for name, value in values.items():
        if name not in kinds:
            raise InputError("inputs", name, f"{method.name} takes {', '.join(kinds)}")
        if isinstance(value, Mapping) and "$ref" in value:
            made[name] = made.get(str(value["$ref"]).rpartition("/")[2])
        elif isinstance(value, Mapping):
            made[name] = _noun_from_json(kinds[name], name, value)
        elif isinstance(value, str) and issubclass(kinds[name], Noun):
            made[name] = _noun_from_text(kinds[name], name, value, units[name])
        elif value is None or isinstance(value, kinds[name]):
            made[name] = value
        else:
            raise InputError(name, value, f"give a {kinds[name].__name__}")
    return _made(method, {name: value for name, value in made.items() if value is not None})


def inputs_from_text(method: Method, texts: Mapping[str, str]) -> Any:
    """The Inputs of a method from what a person typed, field by field; `@file.json` reads a noun from a file.

    Raises:
        InputError: a text that can't be read, or something missing.
    """
    kinds = noun_types(method.inputs)
    units = {field.name: field.metadata.get("unit", "") for field in dataclasses.fields(method.inputs)}
    values: dict[str, Any] = {}
    for name, text in texts.items():
        option = "--" + name.replace("_", "-")
        kind: Any = kinds[name]
        if text.startswith("@"):
            values[name] = _noun_from_json(kind, option, read_json(Path(text[1:])))
        elif issubclass(kind, Noun):
            values[name] = _noun_from_text(kind, option, text, units[name])
        else:
            values[name] = kind(text)
    return _made(method, values)


def from_file(text: str) -> Any:
    """What a person typed for a noun: the text, or with `@` the JSON in the file that it names."""
    return read_json(Path(text[1:])) if text.startswith("@") else text


def _noun_from_text(kind: Any, name: str, text: str, unit: str) -> Any:
    if kind is Quantity:
        return Quantity.parse(text, unit, bare=NAMED.get(unit), name=name)
    return kind.parse(text, name=name)


def read_json(path: Path) -> Any:
    """A small JSON file.

    Raises:
        FileFormatError: no such file, too large, or not JSON.
    """
    if not path.is_file():
        raise FileFormatError(path, "no such file")
    if path.stat().st_size > 2**20:
        raise FileFormatError(path, "is larger than 1 MiB")
    try:
        return json.loads(path.read_text("utf-8"))
    except (ValueError, RecursionError):
        raise FileFormatError(path, "is not JSON") from None


def _noun_from_json(kind: Any, name: str, data: Any) -> Any:
    if isinstance(data, Mapping) and not isinstance(data.get("id", ""), str | None):
        raise InputError(name, str(data["id"]), "give its id as text")
    try:
        return kind.from_json(data)
    except InputError:
        raise
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
        raise InputError(name, type(error).__name__, f"give a {kind.__name__} as JSON") from None


def _made(method: Method, values: Mapping[str, Any]) -> Any:
    needed = [f.name for f in dataclasses.fields(method.inputs)
              if f.default is dataclasses.MISSING and f.default_factory is dataclasses.MISSING]  # fmt: skip
    missing = [name for name in needed if values.get(name) is None]
    if missing:
        raise InputError("inputs", "incomplete", f"{method.name} also needs {', '.join(missing)}")
    for field in dataclasses.fields(method.inputs):
        seen, wanted = values.get(field.name), field.metadata.get("points")
        if not wanted or not isinstance(seen, Observation):
            continue
        count, more = seen.points_px.shape[-2], field.metadata.get("more", False)
        if count < wanted or (count > wanted and not more):
            raise InputError(field.name, f"{count} points", f"give {wanted}" + (" or more" if more else ""))
    return method.inputs(**values)
