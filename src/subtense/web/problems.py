"""Errors as the API gives them: one object, whatever went wrong, and the status it has."""

from __future__ import annotations

import math
from typing import Any

from ..errors import (
    FileFormatError,
    GeometryError,
    InputError,
    MissingExtraError,
    NothingFoundError,
    SubtenseError,
    UnknownCameraError,
)
from .children import BusyError, ChildError


class LimitError(Exception):
    """Something sent is over a limit of the server.

    Attributes:
        name: of the limit.
        status: HTTP's.
    """

    def __init__(self, name: str, message: str, status: int = 413) -> None:
        self.name, self.status = name, status
        super().__init__(message)


class AbsentError(Exception):
    """What is asked for is not here (any more)."""


def problem_of(error: Exception) -> tuple[int, dict[str, Any]]:
    """Status, and the `error` object: type, message, and where known the field's name and what was given."""
    found: dict[str, Any] = {
        "type": type(error).__name__,
        "name": None,
        "given": None,
        "message": " ".join(str(error).split()),
    }
    if isinstance(error, InputError):
        found |= {"name": error.name.lstrip("-").replace("-", "_").replace(" ", "_"), "given": _shown(error.given)}
        return 422, found
    if isinstance(error, ChildError):
        return 501 if error.kind == "MissingExtraError" else 422, {**found, "type": error.kind, "name": error.limit}
    if isinstance(error, MissingExtraError):
        return 501, {**found, "name": error.extra}
    if isinstance(error, GeometryError):
        return 422, {**found, "name": error.code}
    if isinstance(error, (FileFormatError, UnknownCameraError, NothingFoundError, SubtenseError)):
        return 422, found
    if isinstance(error, BusyError):
        return 503, {**found, "type": "Busy", "message": "too many pictures are waiting; try again in a few seconds"}
    if isinstance(error, LimitError):
        return error.status, {**found, "type": "Limit", "name": error.name}
    if isinstance(error, AbsentError):
        return 404, {**found, "type": "Absent"}
    return 500, {**found, "type": "Failure", "message": "the server failed; its terminal says how"}


def _shown(given: object) -> Any:
    """What was given, if JSON can hold it."""
    if isinstance(given, float):
        return given if math.isfinite(given) else str(given)
    return given if given is None or isinstance(given, (str, int, bool)) else str(given)[:200]
