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


class BusyError(Exception):
    """Too many are waiting already."""


class ChildError(SubtenseError):
    """A child's own error, or its end by a limit.

    Attributes:
        kind: the name of the exception it stands for.
    """

    def __init__(self, kind: str, message: str) -> None:
        self.kind = kind
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
        progress: Callable[[float], None] = lambda share: None,
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
        try:
            async with asyncio.timeout(wall_s):
                return await self._outcome(process, task["name"], cpu_s, memory_bytes, progress)
        except TimeoutError:
            raise ChildError("FileFormatError", f"{task['name']}: took longer than {wall_s:g} s (wall_s)") from None
        finally:
            if process.returncode is None:
                process.kill()
            await process.wait()

    async def _outcome(
        self,
        process: asyncio.subprocess.Process,
        name: str,
        cpu_s: float,
        memory_bytes: int,
        progress: Callable[[float], None],
    ) -> Any:
        assert process.stdout is not None and process.stderr is not None
        async for line in process.stdout:
            said = json.loads(line)
            if "progress" in said:
                progress(float(said["progress"]))
            elif "error" in said:
                raise ChildError(said["error"]["type"], said["error"]["message"])
            elif "result" in said:
                return said["result"]
        complaint = (await process.stderr.read(4096)).decode("utf-8", "replace")
        status = await process.wait()
        if hasattr(signal, "SIGXCPU") and status in (-signal.SIGXCPU, -signal.SIGKILL):
            raise ChildError("FileFormatError", f"{name}: took more than {cpu_s:g} s of processor time (cpu_s)")
        if "MemoryError" in complaint or "failed to allocate" in complaint.lower():
            mib = memory_bytes // 2**20
            raise ChildError(
                "FileFormatError", f"{name}: takes more than {mib} MiB of memory (memory_bytes); resize it"
            )
        raise ChildError("FileFormatError", f"{name}: is cut or damaged; its decoder ended (status {status})")
