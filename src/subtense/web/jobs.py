"""Long work that a page watches: progress as server-sent events, and an end when it is no longer wanted."""

from __future__ import annotations

import asyncio
import json
import secrets
import sys
import traceback
from collections.abc import AsyncIterator, Awaitable, Callable
from dataclasses import dataclass, field
from typing import Any

from .problems import problem_of

KEPT = 200
"""Finished jobs that are remembered."""
HEARTBEAT_S = 10.0


@dataclass
class Job:
    """One piece of work.

    Attributes:
        id: unguessable.
        kind: what it does.
        state: "running", "done", "failed" or "cancelled".
        progress: share done, 0 to 1.
        doing: what it is at.
        result: of a job that is done.
        error: of one that failed.
    """

    id: str
    kind: str
    state: str = "running"
    progress: float = 0.0
    doing: str = ""
    result: Any = None
    error: dict[str, Any] | None = None
    task: asyncio.Task[None] | None = field(default=None, repr=False)
    changed: asyncio.Event = field(default_factory=asyncio.Event, repr=False)

    def to_json(self) -> dict[str, Any]:
        """As the API gives it."""
        return {"id": self.id, "kind": self.kind, "state": self.state, "progress": self.progress, "doing": self.doing,
                "result": self.result, "error": self.error}  # fmt: skip

    def moved(self, share: float, doing: str = "") -> None:
        """So much is done, and what it is at."""
        self.progress, self.doing = max(self.progress, min(share, 1.0)), doing or self.doing
        self.tell()

    def tell(self) -> None:
        """Wake who watches."""
        self.changed.set()
        self.changed = asyncio.Event()


class Jobs:
    """The jobs of one server."""

    def __init__(self) -> None:
        self.all: dict[str, Job] = {}

    def start(self, kind: str, work: Callable[[Job], Awaitable[Any]]) -> Job:
        """Begin; `work` takes the job to report progress to."""
        job = Job(secrets.token_urlsafe(12), kind)
        self.all[job.id] = job
        job.task = asyncio.create_task(self._run(job, work))
        for old in [j.id for j in self.all.values() if j.state != "running"][: max(len(self.all) - KEPT, 0)]:
            del self.all[old]
        return job

    async def _run(self, job: Job, work: Callable[[Job], Awaitable[Any]]) -> None:
        try:
            job.result = await work(job)
            job.state, job.progress = "done", 1.0
        except asyncio.CancelledError:
            job.state = "cancelled"
        except Exception as error:  # whatever it was, who watches must learn that it ended
            status, job.error = problem_of(error)
            job.state = "failed"
            if status == 500:
                traceback.print_exception(error, file=sys.stderr)
        job.tell()

    def cancel(self, job: Job) -> None:
        """End it; a job that has ended stays as it is."""
        if job.task is not None and not job.task.done():
            job.task.cancel()

    async def close(self) -> None:
        """End all."""
        running = [job.task for job in self.all.values() if job.task is not None and not job.task.done()]
        for task in running:
            task.cancel()
        await asyncio.gather(*running, return_exceptions=True)


async def events(job: Job) -> AsyncIterator[str]:
    """The job's states as server-sent events until it ends."""
    while True:
        changed = job.changed
        yield f"event: {job.state}\ndata: {json.dumps(job.to_json(), allow_nan=False)}\n\n"
        if job.state != "running":
            return
        try:
            await asyncio.wait_for(changed.wait(), HEARTBEAT_S)
        except TimeoutError:
            yield ": still there\n\n"
