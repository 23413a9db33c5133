"""A calibration file written again in another format; nothing is half-written."""

from __future__ import annotations

import os
from pathlib import Path

from ..camera_files import formats, selector
from ..camera_sources import calibration_file
from ..errors import InputError


def convert_camera(source: str, target: Path, *, from_form: str | None = None, to_form: str | None = None) -> str:
    """Read a calibration and write it.

    Args:
        source: a file's name, with what the file lacks behind a #, as in `calib.yml#640x480`.
        target: the file to write; never the one that is read.
        from_form: a key of FORMATS; None to be told by the content.
        to_form: a key of FORMATS; None to go by the target's ending.

    Returns:
        What the written file does not keep, in a sentence; empty where it keeps all.

    Raises:
        FileFormatError: the source holds no camera that can be used.
        InputError: the format can't hold this camera, or the target can't be written.
    """
    path, pick = selector.split(source)
    form = formats.form_for(target, to_form)
    found = calibration_file.read(path, pick, from_form)
    content = formats.write(found, form)
    if target.exists() and target.samefile(path):
        raise InputError("the file to write", str(target), "it is the one to read; name another")
    _replace(target, content)
    lost = formats.lost(found, form)
    return f"{target.name}: {formats.FORMATS[form].title} does not keep {', '.join(lost)}" if lost else ""


def _replace(target: Path, content: bytes) -> None:
    """Write beside it under another name, then rename: what was there stays whole until the new file is."""
    beside = target.with_name(f".{target.name}.{os.getpid()}")
    try:
        with beside.open("xb") as file:
            file.write(content)
        beside.replace(target)
    except OSError as error:
        beside.unlink(missing_ok=True)
        raise InputError("the file to write", str(target), f"it can't be written ({error.strerror})") from None
