"""Photos as they arrive: a multipart body, of which nothing is kept that is over a limit."""

from __future__ import annotations

from starlette.datastructures import FormData
from starlette.formparsers import MultiPartException, MultiPartParser
from starlette.requests import Request

from ..errors import InputError
from .problems import LimitError
from .settings import Limits


class _Parts(MultiPartParser):
    """Counts parts, the bytes of their headers, and those of each file."""

    def __init__(self, request: Request, limits: Limits) -> None:
        super().__init__(request.headers, request.stream(), max_files=limits.parts, max_fields=limits.parts)
        self._limits = limits
        self._count = self._header_bytes = self._file_bytes = 0

    def on_part_begin(self) -> None:
        self._count, self._header_bytes, self._file_bytes = self._count + 1, 0, 0
        if self._count > self._limits.parts:
            raise LimitError(
                "parts", f"the request has more than {self._limits.parts} parts (parts); send the rest in another"
            )
        super().on_part_begin()

    def on_header_field(self, data: bytes, start: int, end: int) -> None:
        self._grow_header(end - start)
        super().on_header_field(data, start, end)

    def on_header_value(self, data: bytes, start: int, end: int) -> None:
        self._grow_header(end - start)
        super().on_header_value(data, start, end)

    def on_part_data(self, data: bytes, start: int, end: int) -> None:
        self._file_bytes += end - start
        most = self._limits.upload_bytes
        if self._file_bytes > most:
            raise LimitError("upload_bytes", f"the file is larger than {most} bytes (upload_bytes)")
        super().on_part_data(data, start, end)

    def _grow_header(self, count: int) -> None:
        self._header_bytes += count
        if self._header_bytes > self._limits.part_header_bytes:
            raise _header_too_long(self._limits)


def _header_too_long(limits: Limits) -> LimitError:
    most = limits.part_header_bytes
    return LimitError("part_header_bytes", f"the headers of a part are too long; {most} bytes are allowed, and 4096 of a line "
                      "(part_header_bytes)")  # fmt: skip


async def read_form(request: Request, limits: Limits) -> FormData:
    """The parts of a multipart request; close it when done.

    Raises:
        LimitError: over a limit.
        InputError: not multipart.
    """
    try:
        return await _Parts(request, limits).parse()
    except MultiPartException as error:
        if "header" in str(error.__cause__):  # the parser has limits of its own on lines of a header
            raise _header_too_long(limits) from None
        raise InputError("body", "damaged", f"it is no multipart/form-data ({error.message.rstrip('.')})") from None


def shown_name(name: str | None) -> str:
    """The last part of a stranger's file name, printable and not long."""
    last = (name or "").replace("\\", "/").rsplit("/", 1)[-1]
    return " ".join("".join(c if c.isprintable() else " " for c in last).split())[:200].strip() or "photo"
