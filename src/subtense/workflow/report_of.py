"""The table of reports, apart from the others so that a calculator need not load detectors."""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from ..document import Document
from ..errors import InputError
from ..reports import csv, json, text

if TYPE_CHECKING:
    from ..photo import Photo


@dataclass(frozen=True)
class Report:
    """One way to show a document.

    Attributes:
        name: the key in REPORTS.
        title: what a menu says.
        media_type: as HTTP names it.
        suffix: of a file of it.
        function: the document, and the photo where there is one, to text or bytes.
        of_photo: whether there is none without a photo.
    """

    name: str
    title: str
    media_type: str
    suffix: str
    function: Callable[[Document, Photo | None], str | bytes]
    of_photo: bool = False


def _pdf(document: Document, photo: Photo | None) -> bytes:
    from ..reports import overlay, pdf
    from .tables import METHODS

    picture = overlay.draw(document, photo) if photo is not None else None
    return pdf.report(document, picture, assumes={name: method.assumes for name, method in METHODS.items()})


def _overlay(document: Document, photo: Photo | None) -> bytes:
    from ..reports import overlay

    assert photo is not None
    out = io.BytesIO()
    overlay.draw(document, photo).save(out, "PNG", compress_level=3)
    return out.getvalue()


REPORTS: dict[str, Report] = {
    r.name: r
    for r in (
        Report("text", "text", "text/plain; charset=utf-8", ".txt", lambda document, _: text.report(document)),
        Report("json", "JSON", "application/json", ".json", lambda document, _: json.report(document)),
        Report("csv", "CSV table", "text/csv; charset=utf-8", ".csv", lambda document, _: csv.report(document)),
        Report("pdf", "PDF report", "application/pdf", ".pdf", _pdf),
        Report("overlay", "annotated picture", "image/png", ".png", _overlay, of_photo=True),
    )
}  # fmt: skip
"""Ways to show a document, by the name `--format` takes."""


def report_of(form: str, *, photo: bool = True) -> Report:
    """The report of a name.

    Raises:
        InputError: no such report, or one that needs a photo where there is none.
    """
    names = [r.name for r in REPORTS.values() if photo or not r.of_photo]
    if form not in names:
        raise InputError("--format", form, f"give {', '.join(names)}")
    return REPORTS[form]


def write_report(document: Document, photo: Photo | None, path: Path) -> None:
    """Write the report that a file's ending names; whole or not at all.

    Raises:
        InputError: an ending of no report, no such folder, or the photo itself.
    """
    form = {r.suffix: r.name for r in REPORTS.values() if photo is not None or not r.of_photo}
    if path.suffix.lower() not in form:
        raise InputError("--report", str(path), f"give a name that ends in {', '.join(form)}")
    if not path.parent.is_dir():
        raise InputError("--report", str(path), "its folder does not exist")
    if photo is not None and path.exists() and photo.path.exists() and path.samefile(photo.path):
        raise InputError("--report", str(path), "that is the photo itself; give another name")
    shown = REPORTS[form[path.suffix.lower()]].function(document, photo)
    part = path.with_name(f".{path.name}.part")
    try:
        part.write_bytes(shown if isinstance(shown, bytes) else f"{shown}\n".encode())
        part.replace(path)
    except OSError as error:
        part.unlink(missing_ok=True)
        raise InputError("--report", str(path), f"it can't be written ({error.strerror or error})") from None
