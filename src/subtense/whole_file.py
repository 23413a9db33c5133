"""Writing a file whole or not at all."""

from __future__ import annotations

import os
from pathlib import Path

from .errors import InputError


def write_whole(path: Path, content: bytes | str, option: str) -> None:
    """Write beside the file under another name, then rename: what was there stays whole until the new one is.

    Args:
        path: the file.
        content: all of it; text becomes UTF-8.
        option: what named the file, for errors.

    Raises:
        InputError: no such folder, or it can't be written.
    """
    if not path.parent.is_dir():
        raise InputError(option, str(path), "its folder does not exist")
    if path.is_dir():
        raise InputError(option, str(path), "it is a folder; name a file in it")
    beside = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        with beside.open("xb") as file:
            file.write(content.encode() if isinstance(content, str) else content)
        beside.replace(path)
    except OSError as error:
        beside.unlink(missing_ok=True)
        raise InputError(option, str(path), f"it can't be written ({error.strerror or error})") from None
