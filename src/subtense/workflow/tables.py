"""The tables of all ways: to add one, write its file and add its line here."""

from __future__ import annotations

from collections.abc import Callable

from ..document import Document
from ..errors import InputError
from ..method import Method
from ..methods import calculator, known_size
from ..reports import csv, json, text

METHODS: dict[str, Method] = {m.name: m for m in (calculator.METHOD, known_size.METHOD)}
"""Ways to measure, by name."""

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
