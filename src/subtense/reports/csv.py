"""One row per measurement: what, value, u, limits in SI units, the shares of the budget and the codes of the notes."""

from __future__ import annotations

import csv
import io

from ..document import Document

COLUMNS = (
    "photo",
    "label",
    "what",
    "value",
    "unit",
    "u",
    "low",
    "high",
    "level",
    "method",
    "evaluation",
    "budget",
    "notes",
)


def report(document: Document) -> str:
    """The document as CSV with a header line."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(COLUMNS)
    name = document.photo["name"] if document.photo else ""
    for m in document.measurements:
        budget = "; ".join(f"{c.name} {c.share:.4f}" for c in m.budget)
        codes = " ".join(dict.fromkeys(n.code for n in m.notes))
        row = (
            name,
            m.label,
            m.what,
            m.value,
            m.unit,
            m.u,
            m.low,
            m.high,
            m.level,
            m.method,
            m.evaluation,
            budget,
            codes,
        )
        writer.writerow([_safe(cell) for cell in row])
    return out.getvalue().rstrip("\n")


def _safe(cell: object) -> object:
    """A text that a spreadsheet would take for a formula is quoted with an apostrophe."""
    return f"'{cell}" if isinstance(cell, str) and cell[:1] in ("=", "+", "-", "@", "\t", "\r") else cell
