"""Runs the limited child processes: so many at once, so many waiting, each with a time limit, each can be ended."""

from __future__ import annotations

import asyncio
import json
import os
import signal
import sys
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

from ..errors import SubtenseError
from .settings import Limits

_NO_MEMORY = (
    "memoryerror",
    "failed to allocate",
    "cannot allocate memory",
    "failed to map segment",
    "insufficient memory",
)
"""What a child complains that got too little."""


Progress = Callable[[float, str], None]
"""Is told the share done, and what is being done."""


def unwatched(share: float, doing: str) -> None:
    """Progress that nobody looks at."""


class BusyError(Exception):
    """Too many are waiting already."""


class ChildError(SubtenseError):
    """A child's own error, or its end by a limit.

    Attributes:
        kind: the name of the exception it stands for.
        limit: the name of the limit it went over, if it did.
    """

    def __init__(self, kind: str, message: str, limit: str | None = None) -> None:
        self.kind, self.limit = kind, limit
        super().__init__(message)


class Children:
    """Child processes of one server."""

    def __init__(self, limits: Limits) -> None:
        self.limits = limits
        self._places = asyncio.Semaphore(limits.at_once)
        self._waiting = 0

    def check(self) -> None:
        """Raise BusyError where as many as may wait are waiting."""
        if self._places.locked() and self._waiting >= self.limits.queue:
            raise BusyError

    @asynccontextmanager
    async def place(self) -> AsyncIterator[None]:
        """A place among those that run at once.

        Raises:
            BusyError: as many as may wait are waiting.
        """
        self.check()
        self._waiting += 1
        try:
            await self._places.acquire()
        finally:
            self._waiting -= 1
        try:
            yield
        finally:
            self._places.release()

    async def run(
        self, task: dict[str, Any], folder: Path, *, cpu_s: float, wall_s: float, file_bytes: int, memory_bytes: int,
        progress: Progress = unwatched,
    ) -> Any:  # fmt: skip
        """What a child makes of a task in a folder; it is ended when this is cancelled.

        Raises:
            ChildError: it could not, or went over a limit.
        """
        limits = {
            "memory_bytes": memory_bytes,
            "cpu_s": int(cpu_s),
            "file_bytes": file_bytes,
            "pixels": self.limits.pixels,
        }
        text = json.dumps({**task, "limits": limits})
        environment = {"PATH": os.defpath, "TMPDIR": str(folder), "HOME": str(folder), "OPENBLAS_NUM_THREADS": "1",
                       "OPENBLAS_CORETYPE": os.environ.get("OPENBLAS_CORETYPE", ""), "LANG": "C.UTF-8"}  # fmt: skip
        environment = {name: value for name, value in environment.items() if value}
        process = await asyncio.create_subprocess_exec(
            sys.executable, "-I", "-m", "subtense.web.child", text, cwd=folder, env=environment, stdin=asyncio.subprocess.DEVNULL,
            stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.PIPE, limit=2**24,
        )  # fmt: skip
        assert process.stderr is not None
        complaints = asyncio.create_task(_last(process.stderr))  # read all the while: a full pipe would stop the child
        try:
            async with asyncio.timeout(wall_s):
                return await self._outcome(process, complaints, task["name"], cpu_s, memory_bytes, progress)
        except TimeoutError:
            message = f"{task['name']}: took longer than {wall_s:g} s (wall_s)"
            raise ChildError("FileFormatError", message, "wall_s") from None
        finally:
            complaints.cancel()
            if process.returncode is None:
                process.kill()
            await process.wait()

    async def _outcome(
        self, process: asyncio.subprocess.Process, complaints: asyncio.Task[str], name: str, cpu_s: float, memory_bytes: int,
        progress: Progress,
    ) -> Any:  # fmt: skip
        assert process.stdout is not None
        async for line in process.stdout:
            said = _said(line)
            if "progress" in said:
                progress(float(said["progress"]), str(said.get("doing", "")))
            elif "error" in said:
                raise ChildError(said["error"]["type"], said["error"]["message"], said["error"]["name"])
            elif "result" in said:
                return said["result"]
        complaint, status = await complaints, await process.wait()
        if hasattr(signal, "SIGXCPU") and status in (-signal.SIGXCPU, -signal.SIGKILL):
            message = f"{name}: took more than {cpu_s:g} s of processor time (cpu_s)"
            raise ChildError("FileFormatError", message, "cpu_s")
        if any(words in complaint.lower() for words in _NO_MEMORY):
            message = f"{name}: takes more than {memory_bytes // 2**20} MiB of memory (memory_bytes); resize it"
            raise ChildError("FileFormatError", message, "memory_bytes")
        raise ChildError("FileFormatError", f"{name}: is cut or damaged; its decoder ended (status {status})")


async def _last(stream: asyncio.StreamReader) -> str:
    """The end of what a child complains."""
    last = b""
    while data := await stream.read(2**16):
        last = (last + data)[-4096:]
    return last.decode("utf-8", "replace")


def _said(line: bytes) -> dict[str, Any]:
    """A line of a child; what is none, a decoder wrote."""
    try:
        said = json.loads(line)
    except ValueError:
        return {}
    return said if isinstance(said, dict) else {}
