"""Options that several commands share, and how they print a document."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..errors import GeometryError, InputError

if TYPE_CHECKING:
    from ..document import Document
    from ..photo import Photo


def output_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """--format, --level, --seed: the same for every command that measures."""
    for option in (
        click.option("--seed", type=int, default=0, show_default=True, help="Seed of the Monte Carlo draws."),
        click.option("--level", type=float, default=0.95, show_default=True, help="Coverage of the intervals."),
        click.option("--report", "files", multiple=True, type=click.Path(path_type=Path),
                     help="Write it to this file too: .pdf, .csv, .json, .txt, or .png where there is a photo."),
        click.option("--format", "form", default="text", show_default=True, help="text, json or csv."),
    ):  # fmt: skip
        command = option(command)
    return command


def show(document: Document, form: str, files: tuple[Path, ...] = (), photo: Photo | None = None) -> None:
    """Write the files, then print the document: text goes to the terminal, a picture or a PDF to a pipe."""
    from ..workflow.report_of import report_of, write_report

    refused = [note.text for note in document.notes if note.code == "refused"]
    if refused and not document.measurements:
        more = f" (and {len(refused) - 1} more without an answer)" if len(refused) > 1 else ""
        raise GeometryError(refused[0] + more, code="refused")
    for file in files:
        write_report(document, photo, file)
    shown = report_of(form, photo=photo is not None).function(document, photo)
    if isinstance(shown, bytes) and sys.stdout.isatty():
        raise InputError("--format", form, f"{form} is no text for a terminal; write it to a file with --report")
    click.echo(shown, nl=isinstance(shown, str))


def write_overlay(document: Document, photo: Photo, file: Path | None) -> None:
    """The photo with the result drawn on it, where a file is named."""
    if file is not None:
        from ..reports.overlay import write

        write(document, photo, file)


def search_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """What to look for: the same for `measure` and `detect`."""
    for option in (
        click.option("--thorough", is_flag=True, help="Look for small things even where larger ones are found."),
        click.option("--model", type=click.Path(path_type=Path), metavar="FILE",
                     help="Find objects with this ONNX network of the YOLO or DETR family instead."),
        click.option("--curve", metavar="CURVE", help="From light to the picture's values: srgb, linear, or an exponent."
                     "  [default: near srgb]"),
        click.option("--marker-family", "family", metavar="NAME", help="Of markers, look for this family only, as 36h11 or 4x4."),
        click.option("--target-file", type=click.Path(path_type=Path), metavar="FILE",
                     help="More things of known size, from a TOML file of your own."),
        click.option("--target", "targets", multiple=True, metavar="NAME",
                     help="Look for this thing of known size, as a4, euro-1 or person; see `subtense targets`."),
        click.option("--only", multiple=True, metavar="NAME",
                     help="Look for markers, qr_codes, faces, objects, sheets or circles only."),
    ):  # fmt: skip
        command = option(command)
    return command


@contextmanager
def searching() -> Iterator[Callable[[str, float], None]]:
    """A bar on the terminal's error stream that says what is looked for; nothing where that is no terminal."""
    with click.progressbar(length=1000, label="Looking", file=sys.stderr, hidden=not sys.stderr.isatty()) as bar:

        def told(title: str, share: float) -> None:
            bar.label = f"Looking for {title}"
            bar.update(round(1000 * share) - bar.pos)

        yield told
