"""The built page, read once into memory: what is not in it does not exist, whatever a path says."""

from __future__ import annotations

import gzip
import mimetypes
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from starlette.requests import Request
from starlette.responses import Response
from starlette.types import ASGIApp, Receive, Scope, Send

FOLDER = Path(__file__).parent / "static"
PAGES = {"/": "index.html", "/measure": "measure.html", "/api": "api.html", "/licences": "licences.md"}
PACKED = (".html", ".js", ".css", ".svg", ".json", ".txt", ".md")
HOW_TO_BUILD = (
    "the page is not in this installation (it was built with SUBTENSE_WITHOUT_PAGE=1, or npm could not be reached); the API under "
    "/api works; to have the page, install again with npm in reach"
)
_TYPES = {
    ".js": "text/javascript; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".html": "text/html; charset=utf-8",
    ".md": "text/plain; charset=utf-8",  # so that a browser shows it
}


@dataclass(frozen=True)
class Asset:
    """One file of the page, plain and packed."""

    plain: bytes
    packed: bytes | None
    media_type: str
    forever: bool

    def answer(self, request: Request) -> Response:
        """The file, packed where the browser takes that."""
        headers = {
            "cache-control": "public, max-age=31536000, immutable" if self.forever else "no-cache",
            "vary": "accept-encoding",
        }
        if self.packed is not None and "gzip" in request.headers.get("accept-encoding", ""):
            return Response(self.packed, media_type=self.media_type, headers={**headers, "content-encoding": "gzip"})
        return Response(self.plain, media_type=self.media_type, headers=headers)


@cache
def assets() -> dict[str, Asset]:
    """Path to file."""
    found = {}
    for file in sorted(FOLDER.rglob("*")) if FOLDER.is_dir() else ():
        if file.is_file() and not file.is_symlink() and not file.name.startswith("."):
            found["/" + file.relative_to(FOLDER).as_posix()] = _asset(file)
    for path, name in PAGES.items():
        if f"/{name}" in found:
            found[path] = found[f"/{name}"]
    return found


def _asset(file: Path) -> Asset:
    plain = file.read_bytes()
    packed = gzip.compress(plain, 9, mtime=0) if file.suffix in PACKED and len(plain) > 1000 else None
    kind = _TYPES.get(file.suffix) or mimetypes.guess_type(file.name)[0] or "application/octet-stream"
    return Asset(plain, packed, kind, file.parent.name == "assets")


class Page:
    """ASGI middleware: the page's files; every other path is for the routes, and absent where they have none."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        answer: ASGIApp = self.app
        if scope["type"] == "http" and scope["method"] in ("GET", "HEAD"):
            found = assets().get(scope["path"])
            if found is not None:
                answer = found.answer(Request(scope))
            elif scope["path"] in PAGES:
                answer = Response(HOW_TO_BUILD, 503, media_type="text/plain")
        await answer(scope, receive, send)
