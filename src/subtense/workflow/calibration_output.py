"""What a calibration leaves behind: a camera file, a report, pictures; each whole or not at all."""

from __future__ import annotations

from pathlib import Path

from ..calibration import Calibration
from ..errors import InputError, MissingExtraError
from ..whole_file import write_whole


def camera_file(calibration: Calibration, path: Path) -> str:
    """Write the camera or the rig: our own JSON by the ending .json, another tool's format by another one.

    Returns:
        What the format does not keep, in a sentence; empty where it keeps all.

    Raises:
        InputError: the format can't hold it, or the file can't be written.
    """
    from ..camera_files import formats
    from ..camera_files.reading import Found

    if path.suffix.lower() == ".json":
        write_whole(path, _json(calibration), "--output")
        return ""
    if calibration.rig is not None:
        raise InputError("--output", str(path), "two cameras are written as .json only")
    form = formats.form_for(path)
    found = Found(calibration.camera, calibration.notes)
    write_whole(path, formats.write(found, form), "--output")
    lost = formats.lost(found, form)
    return f"{path.name}: {formats.FORMATS[form].title} does not keep {', '.join(lost)}" if lost else ""


def report_file(calibration: Calibration, path: Path) -> None:
    """Write the report: .html with pictures, .txt or .json.

    Raises:
        InputError: another ending, or the file can't be written.
    """
    check_report(path)
    ways = {".html": _html, ".txt": _text, ".json": _json}
    write_whole(path, ways[path.suffix.lower()](calibration), "--report")


def _html(calibration: Calibration) -> str:
    """With pictures where their extra is installed; the page says so where it is not."""
    from ..reports.calibration_html import html
    from ..reports.calibration_plots import plots

    try:
        drawn = plots(calibration)
    except MissingExtraError:
        drawn = ()
    return html(calibration, drawn)


def _text(calibration: Calibration) -> str:
    from ..reports.calibration_text import text

    return text(calibration) + "\n"


def _json(calibration: Calibration) -> str:
    import json

    return json.dumps(calibration.to_json(), indent=1, allow_nan=False) + "\n"


def check_report(path: Path) -> None:
    """Refuse a report's name before the work is done rather than after.

    Raises:
        InputError: an ending of no report, or no such folder.
    """
    if path.suffix.lower() not in (".html", ".txt", ".json"):
        raise InputError("--report", str(path), "give a name that ends in .html, .txt or .json")
    if not path.parent.is_dir():
        raise InputError("--report", str(path), "its folder does not exist")
