"""Limits on bodies, applied while they arrive: bytes of any, nesting of JSON."""

from __future__ import annotations

import re

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from .problems import LimitError
from .security import problem
from .settings import Limits

_STRING = re.compile(rb'"(?:[^"\\]|\\.)*"')
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
        await self.app(scope, _replayed(body, receive), send)


def _announced(scope: Scope) -> int:
    """The content-length, 0 where there is none or nonsense."""
    for name, value in scope["headers"]:
        if name == b"content-length" and value.isdigit():
            return int(value)
    return 0


def _counted(receive: Receive, name: str, most: int, announced: int) -> Receive:
    seen = 0

    async def counted() -> Message:
        nonlocal seen
        message = await receive()
        seen += len(message.get("body", b""))
        if max(seen, announced) > most:
            raise LimitError(name, f"the request is larger than {most} bytes ({name})")
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
    for byte in _STRING.sub(b"", body):
        if byte in b"[{":
            depth += 1
            if depth > most:
                return True
        elif byte in b"]}":
            depth -= 1
    return False
