"""The audit of a stated camera as text for a terminal."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..calibration import Audit

WIDTH = 100


def text(audit: Audit) -> str:
    """The verdict first, what it rests on, and what to do."""
    own = audit.calibration
    verdict = "these pictures bear the camera out" if audit.trusted else "these pictures contradict the camera"
    lines = [
        verdict.capitalize() + ".", "",
        f"stated   f = {float(audit.camera.f_px):.2f} px, u = {audit.camera.u_f_px:.2f} px   ({audit.camera.source})",
        f"pictures f = {float(own.camera.f_px):.2f} px, u = {own.camera.u_f_px:.2f} px   ({own.camera.source})", "",
    ]  # fmt: skip
    for check in audit.checks:
        lines += _wrapped(f"{'ok ' if check.passed else 'NO '} {check.name}: {check.found}", "     ")
        if not check.passed:
            lines += _wrapped(f"     -> {check.cure}", "        ")
    for note in (*audit.notes, *own.notes):
        lines += _wrapped(f"note {note.code}: {note.text}", "     ")
    return "\n".join(lines)


def _wrapped(line: str, indent: str) -> list[str]:
    whole = line.replace(" %", "\N{NO-BREAK SPACE}%")
    lines = textwrap.wrap(whole, WIDTH, subsequent_indent=indent, break_long_words=False) or [""]
    return [part.replace("\N{NO-BREAK SPACE}", " ") for part in lines]
