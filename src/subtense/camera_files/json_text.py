"""JSON to a tree: strictly, without doubled keys, without NaN, and not deeper than a calibration is."""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import Any

from ..errors import FileFormatError
from .reading import MOST_DEPTH


class _RefusedError(ValueError):
    """What the standard reader would have let through."""


def tree(path: object, text: str) -> Any:
    """The tree of a JSON text.

    Raises:
        FileFormatError: where it is none.
    """
    try:
        found = json.loads(text, object_pairs_hook=_once, parse_constant=_constant)
    except _RefusedError as error:
        raise FileFormatError(path, str(error)) from None
    except json.JSONDecodeError as error:
        raise FileFormatError(path, f"is not JSON: line {error.lineno}: {error.msg}") from None
    except RecursionError:
        raise FileFormatError(path, f"is nested deeper than {MOST_DEPTH} levels, no calibration is") from None
    except ValueError:  # a whole number of thousands of digits
        raise FileFormatError(path, "is not JSON: it holds a number of too many digits") from None
    _check_depth(path, found)
    return found


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for key, value in pairs:
        if key in found:
            raise _RefusedError(f"has the key {key[:40]!r} twice; keep the right one")
        found[key] = value
    return found


def _constant(name: str) -> float:
    raise _RefusedError(f"holds {name}; every number of a calibration is finite")


def _check_depth(path: object, found: Any) -> None:
    level = [found]
    for _ in range(MOST_DEPTH + 1):
        level = [inner for item in level if isinstance(item, (dict, list)) for inner in _inside(item)]
    if level:
        raise FileFormatError(path, f"is nested deeper than {MOST_DEPTH} levels, no calibration is")


def _inside(item: dict[str, Any] | list[Any]) -> Iterable[Any]:
    return item.values() if isinstance(item, dict) else item
