"""What a server may be asked for: where it listens, who may ask, and the limits on what strangers send."""

from __future__ import annotations

import dataclasses
import ipaddress
from dataclasses import dataclass, field

from ..errors import InputError

MIB = 2**20
DEFAULT_PORT = 8517
"""Fixed, so that a browser finds what it stored and links stay good."""


@dataclass(frozen=True)
class Limits:
    """Limits on what is sent; each is named in the error it leads to.

    Attributes:
        upload_bytes: of one picture.
        request_bytes: of one request with pictures.
        parts: of one multipart request.
        part_header_bytes: of the headers of one part.
        pixels: of one picture.
        cpu_s: processor time of one decoding.
        wall_s: of one decoding.
        job_s: of one search in a picture, processor and wall time.
        memory_bytes: address space of one decoding.
        at_once: pictures decoded or searched at once.
        queue: how many more may wait.
        json_bytes: of a JSON body.
        json_depth: of its nesting.
        calibration_bytes: of a calibration file.
        photos: held at once.
        photo_bytes: of all held pixels.
        idle_s: a photo that no page asks for so long is dropped.
    """

    upload_bytes: int = 64 * MIB
    request_bytes: int = 256 * MIB
    parts: int = 32
    part_header_bytes: int = 8192
    pixels: int = 250_000_000
    cpu_s: int = 10
    wall_s: float = 20.0
    job_s: float = 120.0
    memory_bytes: int = 1536 * MIB
    at_once: int = 4
    queue: int = 32
    json_bytes: int = 2 * MIB
    json_depth: int = 32
    calibration_bytes: int = MIB
    photos: int = 64
    photo_bytes: int = 4096 * MIB
    idle_s: float = 120.0

    def changed(self, texts: tuple[str, ...]) -> Limits:
        """The limits with `name=value` texts applied."""
        kinds = {f.name: type(getattr(self, f.name)) for f in dataclasses.fields(self)}
        changes = {}
        for text in texts:
            name, _, value = text.partition("=")
            if name not in kinds:
                raise InputError("--limit", text, f"known are {', '.join(kinds)}, as in upload_bytes=100000000")
            try:
                changes[name] = kinds[name](value)
            except ValueError:
                raise InputError("--limit", text, "give a number behind the =") from None
            if not changes[name] > 0:
                raise InputError("--limit", text, "give a number above 0")
        return dataclasses.replace(self, **changes)


@dataclass(frozen=True)
class Settings:
    """One server.

    Attributes:
        token: what a browser must show; a cookie after its first use.
        password: what opens the page from other machines; None on loopback.
        port: of the server.
        names: host names, without port, that a request may be addressed to.
        limits: on what is sent.
    """

    token: str
    password: str | None = None
    port: int = DEFAULT_PORT
    names: tuple[str, ...] = ("127.0.0.1", "localhost", "[::1]")
    limits: Limits = field(default_factory=Limits)

    @property
    def hosts(self) -> frozenset[str]:
        """Allowed values of the Host header."""
        return frozenset(f"{name}:{self.port}" for name in self.names) | (
            frozenset(self.names) if self.port == 80 else frozenset()
        )

    @property
    def cookie(self) -> str:
        """The cookie's name; cookies are shared by all ports of a host, so it names the port."""
        return f"subtense_{self.port}"


def is_loopback(host: str) -> bool:
    """Whether a host is this machine only."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return False
