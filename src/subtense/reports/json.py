"""The document as JSON, schema in docs/schema.json: SI numbers, no NaN or Infinity, an open limit is null."""

from __future__ import annotations

import math
from json.encoder import encode_basestring as _quoted
from types import NoneType
from typing import Any

from ..document import Document


def report(document: Document) -> str:
    """The document as indented JSON, two spaces a level."""
    return _text(document.to_json(), "\n", {})


def _number(value: float) -> str:
    if not math.isfinite(value):
        raise ValueError(f"{value} has no place in JSON")
    return float.__repr__(value)


_LEAVES: dict[type, Any] = {
    str: _quoted, float: _number, int: int.__repr__, bool: {True: "true", False: "false"}.get, NoneType: lambda _: "null",
}  # fmt: skip


def _text(value: Any, line: str, written: dict[tuple[int, str], str]) -> str:
    """What `json.dumps` gives with `indent=2, ensure_ascii=False, allow_nan=False`, several times as fast.

    Args:
        value: plain Python data.
        line: a line break and the indentation that the value stands in.
        written: the text of each object by identity and place: all measurements of a scene hold the same inputs.
    """
    leaf, inner = _LEAVES.get, f"{line}  "
    if write := leaf(type(value)):
        return str(write(value))
    if isinstance(value, dict):
        if (id(value), line) not in written:
            items = [
                f"{_quoted(key)}: {write(item) if (write := leaf(type(item))) else _text(item, inner, written)}"
                for key, item in value.items()
            ]
            written[id(value), line] = f"{{{inner}{f',{inner}'.join(items)}{line}}}" if items else "{}"
        return written[id(value), line]
    if isinstance(value, (list, tuple)):
        items = [_text(item, inner, written) for item in value]
        return f"[{inner}{f',{inner}'.join(items)}{line}]" if items else "[]"
    if isinstance(value, float):  # of NumPy
        return _number(value)
    raise TypeError(f"{type(value).__name__} has no place in JSON")
