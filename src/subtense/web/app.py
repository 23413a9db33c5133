"""The application: routes on the tables of the house, behind the guard."""

from __future__ import annotations

import asyncio
import sys
import time
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from pathlib import Path
from urllib.parse import parse_qs

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from starlette.exceptions import HTTPException
from starlette.responses import JSONResponse, RedirectResponse, Response

from .. import __version__
from ..errors import SubtenseError
from . import login, openapi, routes_numbers, routes_photos, static
from .bodies import Bodies
from .children import BusyError, Children
from .jobs import Jobs
from .photos import Photos, sweeping
from .problems import AbsentError, LimitError, problem_of
from .security import HEADERS, Guard, problem, same, welcomed
from .settings import Settings
from .state import State

DESCRIPTION = """Distances from images, each with the uncertainty it deserves.

Numbers are SI (or px, rad). A document is what `--format json` prints. An error is one object with one line that names the value
and the cure."""


def create_app(settings: Settings, photos: tuple[Path, ...] = ()) -> FastAPI:
    """The server's application.

    Args:
        settings: who may ask, and how much.
        photos: pictures to hold from the start.
    """
    children = Children(settings.limits)
    state = State(settings, children, Photos(settings.limits, children), Jobs())

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        sweeper = asyncio.create_task(sweeping(state.photos))
        try:
            for path in photos:
                try:
                    await state.photos.add(path, path.name, kept=True)
                except SubtenseError as error:  # the others are still wanted
                    print(f"subtense: {error}", file=sys.stderr)
            yield
        finally:
            sweeper.cancel()
            await state.jobs.close()
            state.photos.close()

    app = FastAPI(title="subtense", version=__version__, description=DESCRIPTION, lifespan=lifespan, docs_url=None, redoc_url=None,
                  openapi_url="/api/openapi.json")  # fmt: skip
    app.state.subtense = state
    app.include_router(routes_numbers.router)
    app.include_router(routes_photos.router)
    openapi.install(app)
    _handle_errors(app)
    _add_login(app, settings)
    app.add_middleware(static.Page)
    app.add_middleware(Bodies, limits=settings.limits)
    app.add_middleware(Guard, settings=settings)
    return app


def _handle_errors(app: FastAPI) -> None:
    async def ours(_: Request, error: Exception) -> Response:
        status, found = problem_of(error)
        headers = {"retry-after": "2"} if status == 503 else None
        return JSONResponse({"error": found}, status, headers)

    for kind in (SubtenseError, LimitError, AbsentError, BusyError):
        app.add_exception_handler(kind, ours)

    @app.exception_handler(RequestValidationError)
    async def invalid(_: Request, error: RequestValidationError) -> Response:
        first = error.errors()[0]
        place = _place(first["loc"])
        if first["type"] == "json_invalid":
            return problem(400, "body", "the body is not JSON")
        return problem(422, place or "body", f"{place or 'the body'}: {first['msg']}"[:500], "InputError")

    @app.exception_handler(HTTPException)
    async def http(_: Request, error: HTTPException) -> Response:
        headers = {name.replace("-", "_"): value for name, value in (error.headers or {}).items()}
        return problem(error.status_code, "request", str(error.detail), "Refused", **headers)

    @app.exception_handler(Exception)
    async def unexpected(_: Request, error: Exception) -> Response:
        """Answers from outside the guard, so with its headers; uvicorn prints the traceback."""
        status, found = problem_of(error)
        return JSONResponse({"error": found}, status, HEADERS)


def _place(words: Sequence[int | str]) -> str:
    """The field that a validation error is about, without the arms of a union behind it."""
    inner = [str(word) for word in words[1:]]
    return ".".join(inner[: inner.index("camera") + 1] if "camera" in inner else inner)


def _add_login(app: FastAPI, settings: Settings) -> None:
    attempts = login.Attempts()

    @app.post(login.PATH, include_in_schema=False)
    async def post_login(request: Request) -> Response:
        wait_s = attempts.wait_s(time.monotonic())
        asks = settings.password is not None
        if wait_s:
            return login.page(password=asks, message=f"Too many attempts; wait {wait_s:.0f} seconds.", status=429)
        said = parse_qs((await request.body()).decode("utf-8", "replace")).get("secret", [""])[0]
        if not same(said.strip(), settings.password or settings.token):
            attempts.wrong.append(time.monotonic())
            await asyncio.sleep(0.3)
            return login.page(password=asks, message="That is not it.")
        return welcomed(RedirectResponse("/", 303), settings)
