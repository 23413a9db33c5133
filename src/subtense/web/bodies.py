"""Limits on bodies, applied while they arrive: bytes of any, nesting of JSON."""

from __future__ import annotations

import json
import math
import re
from typing import Any

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from .problems import LimitError
from .security import problem
from .settings import Limits

_STRING = re.compile(rb'"(?:[^"\\]|\\.)*+(?:"|\\?\Z)', re.DOTALL)  # one that is never closed goes to the end, in one go
_BRACKETS = b"[]{}"
_OTHER = bytes(set(range(256)) - set(_BRACKETS))
_PICTURES = "/api/photos"


class Bodies:
    """ASGI middleware: a body over its limit is refused before it is read to the end, JSON before it is parsed."""

    def __init__(self, app: ASGIApp, limits: Limits) -> None:
        self.app, self.limits = app, limits

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http" or scope["method"] in ("GET", "HEAD", "OPTIONS"):
            await self.app(scope, receive, send)
            return
        pictures = scope["path"] == _PICTURES
        name, most = (
            ("request_bytes", self.limits.request_bytes) if pictures else ("json_bytes", self.limits.json_bytes)
        )
        try:
            if pictures:
                await self.app(scope, _counted(receive, name, most, _announced(scope)), send)
                return
            body = await _read(_counted(receive, name, most, _announced(scope)))
            if depth_over(body, self.limits.json_depth):
                raise LimitError("json_depth", f"the JSON is nested deeper than {self.limits.json_depth} (json_depth)")
        except LimitError as error:
            await problem(error.status, error.name, str(error), "Limit")(scope, receive, send)
            return
        fault = json_fault(body) if body and scope["path"].startswith("/api") else None
        if fault is not None:
            await problem(400, "body", fault, "InputError")(scope, receive, send)
            return
        await self.app(scope, _replayed(body, receive), send)


def _announced(scope: Scope) -> int:
    """The content-length, 0 where there is none or nonsense."""
    for name, value in scope["headers"]:
        if name == b"content-length" and value.isdigit():
            return int(value)
    return 0


def _counted(receive: Receive, name: str, most: int, announced: int) -> Receive:
    seen = 0
    over = LimitError(name, f"the request is larger than {most} bytes ({name})")

    async def counted() -> Message:
        nonlocal seen
        if announced > most:  # before any of it is awaited
            raise over
        message = await receive()
        seen += len(message.get("body", b""))
        if seen > most:
            raise over
        return message

    return counted


async def _read(receive: Receive) -> bytes:
    parts = []
    while True:
        message = await receive()
        if message["type"] != "http.request":
            break
        parts.append(message.get("body", b""))
        if not message.get("more_body"):
            break
    return b"".join(parts)


def _replayed(body: bytes, receive: Receive) -> Receive:
    sent = False

    async def replayed() -> Message:
        nonlocal sent
        if sent:
            return await receive()
        sent = True
        return {"type": "http.request", "body": body, "more_body": False}

    return replayed


def depth_over(body: bytes, most: int) -> bool:
    """Whether JSON is nested deeper than so many brackets, strings left out."""
    if body.count(b"[") + body.count(b"{") <= most:
        return False
    depth = 0
    for byte in _STRING.sub(b"", body).translate(None, _OTHER):
        if byte in b"[{":
            depth += 1
            if depth > most:
                return True
        elif byte in b"]}":
            depth -= 1
    return False


class _FaultError(ValueError):
    """What Python's JSON reader takes and others do not."""


def json_fault(body: bytes) -> str | None:
    """Why this is no JSON that every reader understands alike, or None."""
    try:
        found = json.loads(body.decode("utf-8"), parse_constant=_constant, parse_float=_finite, parse_int=_whole,
                           object_pairs_hook=_once)  # fmt: skip
        if b"\\ud" in body.lower():
            json.dumps(found, ensure_ascii=False).encode("utf-8")
    except UnicodeDecodeError:
        return "the body is not UTF-8"
    except UnicodeEncodeError:
        return "the body has half a character in it (a lone surrogate)"
    except _FaultError as error:
        return f"the body is not JSON: {error}"
    except (ValueError, RecursionError):
        return "the body is not JSON"
    return None


def _constant(name: str) -> float:
    raise _FaultError(f"{name} is no number")


def _finite(text: str) -> float:
    number = float(text)
    if not math.isfinite(number):
        raise _FaultError(f"{text[:20]} is too large")
    return number


def _whole(text: str) -> int:
    if len(text) > 300:
        raise _FaultError("a number of more than 300 digits")
    return int(text)


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        names = [name for name, _ in pairs]
        twice = next(name for i, name in enumerate(names) if name in names[:i])
        raise _FaultError(f"{twice[:40]!r} stands twice in an object")
    return found
