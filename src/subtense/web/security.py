"""Who may ask, and how: checks before any route, and the headers of every answer.

A page elsewhere on the web can make a browser send requests to this machine. What stops it: only named hosts are
answered (a foreign name that points here is not one), a request that says it comes from another origin is refused, and
without the token, which such a page can't read, there is nothing but a form that asks for it.
"""

from __future__ import annotations

import hashlib
import hmac
import re
from http.cookies import CookieError, SimpleCookie
from typing import Any
from urllib.parse import parse_qs

from starlette.responses import JSONResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from . import login
from .settings import Settings

SAFE = ("GET", "HEAD", "OPTIONS")
JSON_TYPES = re.compile(r"application/(?:[\w.+-]+\+)?json(?:\s*;.*)?$", re.IGNORECASE)
HEADERS = {
    "content-security-policy": "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; "
    "connect-src 'self'; font-src 'self'; manifest-src 'self'; form-action 'self'; base-uri 'none'; "
    "frame-ancestors 'none'",
    "x-content-type-options": "nosniff", "referrer-policy": "same-origin", "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin", "x-frame-options": "DENY",
    "permissions-policy": "camera=(self), geolocation=(), microphone=(), usb=(), payment=()",
}  # fmt: skip


class Guard:
    """ASGI middleware: refuses what must not be answered, before anything else runs."""

    def __init__(self, app: ASGIApp, settings: Settings) -> None:
        self.app, self.settings = app, settings
        self.headers = [(name.encode(), value.encode()) for name, value in HEADERS.items()]

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "lifespan":
            await self.app(scope, receive, send)
            return
        if scope["type"] != "http":  # there is no WebSocket: closed before the upgrade, whoever asks
            await send({"type": "websocket.close", "code": 1008})
            return

        async def sealed(message: Message) -> None:
            if message["type"] == "http.response.start":
                own = message.get("headers", ())
                said = {name for name, _ in own}
                message["headers"] = [*own, *((name, value) for name, value in self.headers if name not in said)]
            await send(message)

        refusal = self.refusal(scope)
        await (refusal or self.app)(scope, receive, sealed)

    def refusal(self, scope: Scope) -> Response | None:
        """The answer to a request that must not pass, or None."""
        headers: dict[str, list[str]] = {}
        for name, value in scope["headers"]:
            headers.setdefault(name.decode("latin-1"), []).append(value.decode("latin-1"))
        return (
            self._wrong_host(headers)
            or self._wrong_origin(scope, headers)
            or self._stranger(scope, headers)
            or _upgrade(headers)
            or _wrong_type(scope, headers)
        )

    def _wrong_host(self, headers: dict[str, list[str]]) -> Response | None:
        host = headers.get("host", [])
        if len(host) != 1 or not host[0]:
            return problem(400, "host", "the request names no host, or several")
        if host[0].lower() not in self.settings.hosts:
            return problem(403, "host", "the server does not answer to this name; open it by the address it printed, or start it "
                           "with --host NAME")  # fmt: skip
        return None

    def _wrong_origin(self, scope: Scope, headers: dict[str, list[str]]) -> Response | None:
        origin = headers.get("origin")
        if origin is not None and origin != [f"{scope['scheme']}://{headers['host'][0]}".lower()]:
            return problem(403, "origin", "requests from other sites are refused")
        site = headers.get("sec-fetch-site", ["none"])[-1]
        page = scope["method"] in SAFE and headers.get("sec-fetch-mode", [""])[-1] == "navigate"
        if (
            site not in ("none", "same-origin")
            and not page
            and (scope["method"] not in SAFE or scope["path"].startswith("/api"))
        ):
            return problem(403, "origin", "requests from other sites are refused")
        return None

    def _stranger(self, scope: Scope, headers: dict[str, list[str]]) -> Response | None:
        path, method = scope["path"], scope["method"]
        said = parse_qs(scope["query_string"].decode("latin-1")).get("token")
        if said and method == "GET" and self.settings.password is None and same(said[-1], self.settings.token):
            answer: Response = RedirectResponse(
                path if path.startswith("/") and not path.startswith("//") else "/", 303
            )
            return welcomed(answer, self.settings)
        if (path == login.PATH and method == "POST") or same(self._shown(headers), self.settings.token):
            return None
        if method in SAFE and not path.startswith("/api") and "text/html" in headers.get("accept", [""])[-1]:
            return login.page(password=self.settings.password is not None)
        return problem(401, "token", _HOW)

    def _shown(self, headers: dict[str, list[str]]) -> str:
        """The token of a request: a bearer header, else the cookie."""
        for value in headers.get("authorization", ()):
            kind, _, token = value.partition(" ")
            if kind.lower() == "bearer":
                return token.strip()
        for value in headers.get("cookie", ()):
            try:
                morsel = SimpleCookie(value).get(self.settings.cookie)
            except CookieError:
                continue
            if morsel is not None:
                return morsel.value
        return ""


def welcomed(answer: Response, settings: Settings) -> Response:
    """The answer with the token as a cookie that no script can read."""
    answer.set_cookie(settings.cookie, settings.token, max_age=400 * 86400, httponly=True, samesite="lax", path="/")
    return answer


_HOW = "show the token: open the address that `subtense serve` printed, or send it as Authorization: Bearer"


def _upgrade(headers: dict[str, list[str]]) -> Response | None:
    """There is nothing to upgrade to."""
    asked = any("websocket" in value.lower() for value in headers.get("upgrade", ()))
    return (
        problem(400, "upgrade", "there is no WebSocket here; jobs tell their progress by GET /api/jobs/{job}/events")
        if asked
        else None
    )


def _wrong_type(scope: Scope, headers: dict[str, list[str]]) -> Response | None:
    """JSON routes take JSON only: a form of another site can't be one."""
    if scope["method"] in SAFE or scope["method"] == "DELETE" or not scope["path"].startswith("/api"):
        return None
    kind = headers.get("content-type", [""])[-1]
    if scope["path"] == "/api/photos":
        good = kind.lower().startswith("multipart/form-data")
        return (
            None
            if good
            else problem(415, "content-type", "send the picture as multipart/form-data, in a field named file")
        )
    return None if JSON_TYPES.match(kind) else problem(415, "content-type", "send application/json")


def same(said: str, wanted: str) -> bool:
    """Whether two secrets agree, in a time that does not tell how far."""
    one, other = (hashlib.sha256(text.encode("utf-8", "surrogateescape")).digest() for text in (said, wanted))
    return hmac.compare_digest(one, other) and bool(wanted)


def problem(status: int, name: str, message: str, kind: str = "Refused", **more: Any) -> JSONResponse:
    """An error as the API gives it; `more` are headers."""
    body = {"error": {"type": kind, "name": name, "message": message}}
    return JSONResponse(body, status, headers={key.replace("_", "-"): value for key, value in more.items()})
