"""The table of reports, apart from the others so that a calculator need not load detectors."""

from __future__ import annotations

from collections.abc import Callable

from ..document import Document
from ..errors import InputError
from ..reports import csv, json, text

REPORTS: dict[str, Callable[[Document], str]] = {"text": text.report, "json": json.report, "csv": csv.report}
"""Ways to show a document as text, by the name `--format` takes."""


def report_of(form: str) -> Callable[[Document], str]:
    """The report of a name.

    Raises:
        InputError: no such report.
    """
    if form not in REPORTS:
        raise InputError("--format", form, f"give {', '.join(REPORTS)}")
    return REPORTS[form]
