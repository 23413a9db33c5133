"""uvicorn's server, which ends its jobs first: pages that watch one would else keep it from ending."""

from __future__ import annotations

import socket

import uvicorn

from .jobs import Jobs


class Server(uvicorn.Server):
    """A server of an application with jobs."""

    def __init__(self, config: uvicorn.Config, jobs: Jobs) -> None:
        super().__init__(config)
        self.jobs = jobs

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Take no more requests, and let those that run come to their end."""
        await self.jobs.close()
        await super().shutdown(sockets)
