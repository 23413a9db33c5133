"""Runs the real server in a process of its own, and asks it."""

import asyncio
import contextlib
import io
import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

import httpx
import numpy as np
import pytest
from PIL import Image

STATIC = Path(__file__).parents[2] / "src" / "subtense" / "web" / "static"
needs_page = pytest.mark.skipif(not (STATIC / "index.html").is_file(), reason="the page is not built here")


@dataclass
class Answer:
    """What came back over a raw socket; header names are lower case."""

    status: int
    headers: list[tuple[str, str]]
    body: bytes

    def all(self, name: str) -> list[str]:
        return [value for key, value in self.headers if key == name]

    def get(self, name: str) -> str | None:
        return next(iter(self.all(name)), None)

    @property
    def error(self) -> dict:
        return json.loads(self.body)["error"]


@dataclass
class Server:
    """A server that runs.

    Attributes:
        process: its process.
        port: where it listens.
        token: what it wants to be shown.
        temp: its folder for temporary files.
        said: what it printed up to the time it listened.
    """

    process: subprocess.Popen
    port: int
    token: str
    temp: Path
    log: Path
    said: str = ""
    client: httpx.Client = field(init=False)

    def __post_init__(self) -> None:
        self.client = httpx.Client(base_url=self.address, headers={"authorization": f"Bearer {self.token}"}, timeout=60)

    @property
    def host(self) -> str:
        return f"127.0.0.1:{self.port}"

    @property
    def address(self) -> str:
        return f"http://{self.host}"

    def send(self, picture: bytes, name: str = "a.png") -> httpx.Response:
        return self.client.post("/api/photos", files={"file": (name, picture)})

    def photo(self, picture: bytes, name: str = "a.png") -> dict:
        answer = self.send(picture, name)
        assert answer.status_code == 201, answer.text
        return answer.json()["photos"][0]

    def raw(self, request: bytes, *, close: bool = True) -> Answer:
        """Bytes as they are, and the answer to them."""
        with socket.create_connection(("127.0.0.1", self.port), 20) as sock:
            sock.settimeout(20)
            with contextlib.suppress(BrokenPipeError, ConnectionResetError):
                sock.sendall(request)
            return read_answer(sock)

    def ask(self, line: str, *headers: str, host: str | None = "", token: bool = True, body: bytes = b"") -> Answer:
        """A request line and headers; the right Host and the token unless told otherwise."""
        lines = [f"{line} HTTP/1.1", *headers, "Connection: close"]
        if host is not None:
            lines.append(f"Host: {host or self.host}")
        if token:
            lines.append(f"Authorization: Bearer {self.token}")
        if body:
            lines.append(f"Content-Length: {len(body)}")
        return self.raw("\r\n".join([*lines, "", ""]).encode("latin-1") + body)

    def children(self) -> list[int]:
        """Processes that this one started and that still run."""
        found = []
        for stat in Path("/proc").glob("[0-9]*/stat"):
            with contextlib.suppress(OSError):
                words = stat.read_text().rpartition(")")[2].split()
                if int(words[1]) == self.process.pid and words[0] != "Z":
                    found.append(int(stat.parent.name))
        return found

    def stop(self) -> None:
        self.client.close()
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGTERM)
            try:
                self.process.wait(15)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait()


def read_answer(sock: socket.socket) -> Answer:
    data = b""
    with contextlib.suppress(ConnectionResetError, TimeoutError):
        while chunk := sock.recv(65536):
            data += chunk
            head, found, body = data.partition(b"\r\n\r\n")
            lengths = [line for line in head.lower().split(b"\r\n") if line.startswith(b"content-length:")]
            if found and lengths and len(body) >= int(lengths[0].split(b":")[1]):
                break
    head, _, body = data.partition(b"\r\n\r\n")
    first, *lines = head.decode("latin-1").split("\r\n")
    pairs = [tuple(part.strip() for part in line.split(":", 1)) for line in lines]
    return Answer(int([*first.split(), "0", "0"][1]), [(name.lower(), value) for name, value in pairs], body)


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def command(*words: str) -> list[str]:
    return [sys.executable, "-c", "from subtense.cli import main; main()", "serve", *words]


@contextlib.contextmanager
def serving(
    folder: Path, *words: str, password: str | None = None, port: int | None = None, state: Path | None = None
) -> Iterator[Server]:
    """A server with its own state and temporary files in a folder; `words` are further arguments."""
    temp = folder / "tmp"
    temp.mkdir(parents=True)
    environment = {k: v for k, v in os.environ.items() if k != "SUBTENSE_PASSWORD"}
    environment |= {"SUBTENSE_STATE": str(state or folder / "state"), "TMPDIR": str(temp)}
    if password:
        environment["SUBTENSE_PASSWORD"] = password
    port, log = port or free_port(), folder / "log"
    with log.open("wb") as out:
        process = subprocess.Popen(command("--no-browser", "--port", str(port), *words), env=environment, stdout=out,
                                   stderr=out, stdin=subprocess.DEVNULL)  # fmt: skip
    until = time.monotonic() + 60
    while not answers(port):
        assert process.poll() is None and time.monotonic() < until, log.read_text()
        time.sleep(0.05)
    token = (state or folder / "state") / "token"
    server = Server(process, port, token.read_text() if token.exists() else "", temp, log, log.read_text())
    try:
        yield server
    finally:
        server.stop()


def answers(port: int) -> bool:
    """Whether requests are answered: the port listens a little earlier than that."""
    try:
        return httpx.get(f"http://127.0.0.1:{port}/", timeout=1).status_code > 0
    except httpx.HTTPError:
        return False


def awaited(coroutine):
    """Its outcome, from a thread of its own: a browser's loop may run in this one."""
    with ThreadPoolExecutor(1) as threads:
        return threads.submit(asyncio.run, coroutine).result()


def until(what, seconds: float = 60.0) -> bool:
    """Whether it comes true in time."""
    end = time.monotonic() + seconds
    while not what():
        if time.monotonic() > end:
            return False
        time.sleep(0.02)
    return True


def picture(width: int, height: int, form: str = "PNG", seed: int = 1, **options) -> bytes:
    """A picture with detail in it, the same for the same numbers."""
    rng = np.random.default_rng(seed)
    coarse = rng.integers(0, 256, ((height + 7) // 8, (width + 7) // 8, 3), np.uint8)
    pixels = np.ascontiguousarray(np.kron(coarse, np.ones((8, 8, 1), np.uint8))[:height, :width])
    out = io.BytesIO()
    Image.fromarray(pixels).save(out, form, **options)
    return out.getvalue()
