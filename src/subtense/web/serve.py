"""Starts a server: its token, the names it answers to, the browser."""

from __future__ import annotations

import contextlib
import os
import secrets
import socket
import webbrowser
from collections.abc import Callable
from pathlib import Path

import click

from ..errors import FileFormatError, InputError
from .settings import Limits, Settings, is_loopback


def settings_for(
    host: str, port: int, password: str | None, limits: tuple[str, ...] = (), names: tuple[str, ...] = ()
) -> Settings:
    """Who may ask a server that listens on `host`.

    Raises:
        InputError: a host that others reach, without a password.
    """
    bound, names = Limits().changed(limits), tuple(name.lower() for name in names)
    if is_loopback(host):
        return Settings(
            stored_token(), None, port, ("127.0.0.1", "localhost", "[::1]", _bracketed(host), *names), bound
        )
    if not password or len(password) < 8:
        raise InputError("--host", host, "others reach this address: set a password of 8 characters or more in the environment "
                         "variable SUBTENSE_PASSWORD")  # fmt: skip
    own = own_names() if host in ("0.0.0.0", "::") else (_bracketed(host),)
    return Settings(secrets.token_urlsafe(32), password, port, ("127.0.0.1", "localhost", *own, *names), bound)


def _bracketed(host: str) -> str:
    """A host as an address has it: IPv6 in brackets."""
    return f"[{host.strip('[]')}]" if ":" in host else host.lower()


def own_names() -> tuple[str, ...]:
    """This machine's names and addresses, by which others may call it."""
    name = socket.gethostname()
    found = {name.lower()}
    with contextlib.suppress(OSError):
        found |= {str(row[4][0]) for row in socket.getaddrinfo(name, None, socket.AF_INET)}
    with contextlib.suppress(OSError), socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.connect(("192.0.2.1", 9))  # a documentation address: nothing is sent, only a way out is chosen
        found.add(probe.getsockname()[0])
    return tuple(sorted(found))


def stored_token() -> str:
    """The token of this user, kept so that a page goes on after the server was started again."""
    path = Path(os.environ.get("SUBTENSE_STATE") or click.get_app_dir("subtense")) / "token"
    with contextlib.suppress(OSError, UnicodeDecodeError):
        found = path.read_text("ascii").strip()
        if len(found) >= 32:
            return found
    token = secrets.token_urlsafe(32)
    with contextlib.suppress(OSError):  # without a home the token lives as long as the server
        path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        path.unlink(missing_ok=True)
        with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w") as file:
            file.write(token)
    return token


def serve(
    settings: Settings, host: str, photos: tuple[Path, ...], *, browser: bool, say: Callable[[str], None]
) -> None:
    """Run until interrupted.

    Raises:
        InputError: the port is taken.
        FileFormatError: a photo that does not exist.
    """
    import uvicorn

    from .app import create_app
    from .server import Server

    for photo in photos:
        if not photo.is_file():
            raise FileFormatError(photo, "no such file")
    bound = _bound(host, settings.port)
    address = f"http://{'127.0.0.1' if host in ('0.0.0.0', '::') else _bracketed(host)}:{settings.port}/"
    page = address + ("measure" if photos else "")
    opened = page if settings.password else f"{page}?token={settings.token}"
    say(f"subtense is at {opened}")
    if settings.password:
        say(
            f"it answers to {', '.join(settings.names)}; it asks for the password, and sends it unencrypted: use it in a network you trust"
        )
    say("photos stay on this machine; end with Ctrl+C")
    if browser:
        _open_soon(opened)
    app = create_app(settings, photos)
    config = uvicorn.Config(app, log_level="error", server_header=False, proxy_headers=False,
                            access_log=False, timeout_graceful_shutdown=2, ws="none")  # fmt: skip
    Server(config, app.state.subtense.jobs).run(sockets=[bound])


def _bound(host: str, port: int) -> socket.socket:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    # the protocol is named, for only then asyncio sends small packets at once; else each answer waits 40 ms for the browser
    made = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        made.bind((host.strip("[]"), port))
    except OSError as error:
        made.close()
        raise InputError("--port", f"{host}:{port}", f"it can't be listened on ({error.strerror}); give another --port, or end the "
                         "server that has it") from None  # fmt: skip
    made.listen(128)
    return made


def _open_soon(address: str) -> None:
    """Open the browser once the server has had time to start."""
    import threading

    timer = threading.Timer(0.6, webbrowser.open, (address,))
    timer.daemon = True
    timer.start()
