"""A calibration board to print: PDF or SVG at exact scale, with a ruler along two sides to check the print.

The sheet is laid out once, in millimetres from the paper's top-left corner, as outlines, discs and text; two writers put it
into a file. The rulers' outer marks lie where `Board.width_m` begins and ends, so that what is measured between them is what
`--printed` asks for. There are two because printers scale along and across the paper differently.
"""

from __future__ import annotations

import io
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape

import numpy as np

from ..board import Board
from ..board_pattern import Loop, Pattern, pattern
from ..errors import InputError, MissingExtraError

PAPERS_MM = {
    "A4": (210.0, 297.0), "A3": (297.0, 420.0), "A2": (420.0, 594.0), "letter": (215.9, 279.4), "legal": (215.9, 355.6),
    "tabloid": (279.4, 431.8),
}  # fmt: skip
MARGIN_MM = 5.0
"""Printers leave 3 to 5 mm blank."""
CLEAR_MM = 4.0
"""White between the pattern and a ruler, at least; a board is found by its margin."""
TICK_MM, OUTER_TICK_MM = (0.9, 1.5, 2.3), 4.0
"""Ticks of 1, 5 and 10 mm; the marks to measure between."""
FINE_MM, STRONG_MM = 0.1, 0.2
"""Widths of lines."""
NUMBER_MM, TEXT_MM, LINE_MM = 2.0, 2.3, 3.3
"""Heights of letters, and from line to line."""
RULER_MM = OUTER_TICK_MM + 0.6 + NUMBER_MM
LETTER = 0.62
"""Width of a letter over its height, on average and rounded up."""
NUMBER_EVERY_MM, NUMBER_APART_MM = 10, 9.0
MM_PT = 72 / 25.4
ENDINGS = (".pdf", ".svg")


@dataclass(frozen=True)
class Text:
    """A line of text; `turned` reads upwards."""

    x_mm: float
    y_mm: float
    size_mm: float
    text: str
    anchor: str = "start"
    turned: bool = False


@dataclass(frozen=True, eq=False)
class Sheet:
    """What is printed, in mm from the paper's top-left corner, all of it black.

    Attributes:
        width_mm: of the paper.
        height_mm: of the paper.
        areas: each is outlines that are filled by the even-odd rule.
        discs: (x, y, radius).
        texts: the lines.
        corner_mm: where the pattern's top-left corner is.
        title: what it is.
    """

    width_mm: float
    height_mm: float
    areas: tuple[tuple[Loop, ...], ...]
    discs: tuple[tuple[float, float, float], ...]
    texts: tuple[Text, ...]
    corner_mm: tuple[float, float]
    title: str


def write(board: Board, path: Path, paper: str = "A4") -> Sheet:
    """Write the board for printing; whole or not at all.

    Args:
        board: what to draw.
        path: ends in .pdf or .svg.
        paper: a key of PAPERS_MM, or width and height in mm, as "300x400".

    Raises:
        InputError: another ending, no such folder, or the board does not fit.
        MissingExtraError: a PDF without reportlab.
    """
    if path.suffix.lower() not in ENDINGS:
        raise InputError("--output", str(path), f"give a name that ends in {' or '.join(ENDINGS)}")
    if not path.parent.is_dir():
        raise InputError("--output", str(path), "its folder does not exist")
    drawn = sheet(board, paper)
    data = pdf(drawn) if path.suffix.lower() == ".pdf" else svg(drawn).encode()
    part = path.with_name(f".{path.stem}.part{path.suffix}")
    try:
        part.write_bytes(data)
        part.replace(path)
    except OSError as error:
        part.unlink(missing_ok=True)
        raise InputError("--output", str(path), f"it can't be written ({error.strerror or error})") from None
    return drawn


# -- layout ----------------------------------------------------------------------------------------------


def sheet(board: Board, paper: str = "A4") -> Sheet:
    """The board in the middle of the paper, upright or across as it fits, with rulers and what it is.

    Raises:
        InputError: no such paper, or the board does not fit.
    """
    drawn = pattern(board)
    least, most = sorted(paper_mm(paper))
    wide = drawn.width_m > drawn.height_m
    tried = ((most, least), (least, most)) if wide else ((least, most), (most, least))
    for width, height in tried:
        room = _room_mm(board, width, height)
        if drawn.width_m * 1000 <= room[0] + 1e-6 and drawn.height_m * 1000 <= room[1] + 1e-6:
            return _laid_out(board, drawn, width, height)
    raise InputError("--square", f"{board.square_m * 1000:g} mm", _too_large(board, drawn, tried, paper))


def _too_large(board: Board, drawn: Pattern, tried: tuple[tuple[float, float], ...], paper: str) -> str:
    """What would fit, in steps of half a millimetre."""
    sizes = [
        board.square_m * min(room[0] / drawn.width_m, room[1] / drawn.height_m)
        for room in (_room_mm(board, *size) for size in tried)
    ]
    largest = math.floor(max(sizes) * 2 + 1e-9) / 2
    needs = f"the pattern is {drawn.width_m * 1000:.4g} x {drawn.height_m * 1000:.4g} mm"
    if largest <= 0:
        return f"{needs} and {paper} has no room for it; give a larger --paper"
    marker = (
        f" and --marker '{math.floor(10 * largest * board.marker_m / board.square_m + 1e-9) / 10:g} mm'"
        if board.marker_m
        else ""
    )
    return f"{needs}; on {paper} the largest is --square '{largest:g} mm'{marker}, or give a larger --paper"


def paper_mm(text: str) -> tuple[float, float]:
    """Width and height of a paper, by name or as "300x400"; in mm.

    Raises:
        InputError: neither.
    """
    for name, size in PAPERS_MM.items():
        if text.strip().lower() == name.lower():
            return size
    found = re.fullmatch(r"\s*(\d{1,5}(?:\.\d+)?)\s*[x×]\s*(\d{1,5}(?:\.\d+)?)\s*(?:mm)?\s*", text)
    if not found or not all(50 <= float(side) <= 5000 for side in found.groups()):
        raise InputError(
            "--paper", text, f"give {', '.join(PAPERS_MM)}, or width x height in mm (50 to 5000), as 300x400"
        )
    return float(found[1]), float(found[2])


def _room_mm(board: Board, width: float, height: float) -> tuple[float, float]:
    """Width and height left for the pattern; the ruler at its left needs as much at its right, as it stands in the middle."""
    below = CLEAR_MM + RULER_MM + 1.5 + LINE_MM * len(_wrapped(board, width))
    return width - 2 * (MARGIN_MM + RULER_MM + CLEAR_MM), height - 2 * MARGIN_MM - below


def _laid_out(board: Board, drawn: Pattern, width: float, height: float) -> Sheet:
    size = np.array([drawn.width_m, drawn.height_m]) * 1000
    spare = _room_mm(board, width, height)[1] - size[1]
    corner = np.array([(width - size[0]) / 2, MARGIN_MM + spare / 2])
    areas = [tuple(1000 * loop + corner for loop in area) for area in drawn.areas]
    discs = tuple((1000 * x + corner[0], 1000 * y + corner[1], 1000 * r) for x, y, r in drawn.discs)
    across, down = (np.array(ends) * 1000 + c for ends, c in zip((drawn.across_m, drawn.down_m), corner, strict=True))
    base = corner[1] + size[1] + CLEAR_MM
    texts: list[Text] = []
    for start, end, offset, turned in ((*across, base, False), (*down, corner[0] - CLEAR_MM, True)):
        areas += [(loop,) for loop in _ticks(start, end, offset, turned)]
        texts += _numbers(start, end, offset, turned)
    first = base + RULER_MM + 1.5 + TEXT_MM
    texts += [
        Text(width / 2, first + i * LINE_MM, TEXT_MM, line, "middle") for i, line in enumerate(_wrapped(board, width))
    ]
    return Sheet(width, height, tuple(areas), discs, tuple(texts), (float(corner[0]), float(corner[1])), board.text)


def _ticks(start: float, end: float, offset: float, turned: bool) -> Iterator[Loop]:
    """The lines of a ruler: along it, at each millimetre, and the two to measure between, which are centred on the ends."""
    way = -1.0 if turned else 1.0

    def bar(t: float, wide: float, long: float) -> Loop:
        return _bar(t - wide / 2, t + wide / 2, offset, offset + way * long, turned)

    yield _bar(start, end, offset - STRONG_MM / 2, offset + STRONG_MM / 2, turned)
    for i in range(1, math.ceil(end - start - 1e-6)):
        kind = 2 if i % 10 == 0 else 1 if i % 5 == 0 else 0
        yield bar(start + i, STRONG_MM if kind == 2 else FINE_MM, TICK_MM[kind])
    for t in (start, end):
        yield bar(t, STRONG_MM, OUTER_TICK_MM)


def _bar(t0: float, t1: float, n0: float, n1: float, turned: bool) -> Loop:
    corners = np.array([[t0, n0], [t1, n0], [t1, n1], [t0, n1]])
    return corners[:, ::-1] if turned else corners


def _numbers(start: float, end: float, offset: float, turned: bool) -> Iterator[Text]:
    length = end - start
    shown = [i for i in range(0, int(length) + 1, NUMBER_EVERY_MM) if length - i > NUMBER_APART_MM]
    labels = [(float(i), f"{i}") for i in shown] + [(length, f"{length:.6g} mm")]
    for t, text in labels:
        if turned:
            yield Text(offset - OUTER_TICK_MM - 0.6, start + t, NUMBER_MM, text, "middle", True)
        else:
            yield Text(start + t, offset + OUTER_TICK_MM + 0.6 + 0.75 * NUMBER_MM, NUMBER_MM, text, "middle")


def _wrapped(board: Board, width: float) -> list[str]:
    """The lines below the board, no longer than the paper."""
    most = int((width - 2 * MARGIN_MM - 4) / (LETTER * TEXT_MM))
    lines: list[str] = []
    for text in _described(board):
        line = ""
        for word in text.split(" "):
            if line and len(line) + 1 + len(word) > most:
                lines.append(line)
                line = word
            else:
                line = f"{line} {word}" if line else word
        lines.append(line)
    return lines


def _described(board: Board) -> Iterator[str]:
    """What it is, in words and as options, and how to check the print."""
    drawn = pattern(board)
    options = f'--board {board.kind} --squares {board.columns}x{board.rows} --square "{board.square_m * 1000:.6g} mm"'
    if board.marker_m:
        options += f' --marker "{board.marker_m * 1000:.6g} mm" --dictionary {board.dictionary}'
    if board.legacy:
        options += " --legacy"
    yield f"{board.text[0].upper()}{board.text[1:]}:  {options}"
    across, down = (1000 * (b - a) for a, b in (drawn.across_m, drawn.down_m))
    yield "Print it at 100 %, not fitted to the page, and glue it onto something flat."
    yield (f"Measure between the rulers' outer marks: {across:.6g} mm across, {down:.6g} mm down. Give what you measure across "
           "with --printed.")  # fmt: skip


# -- writers ---------------------------------------------------------------------------------------------


def svg(drawn: Sheet) -> str:
    """The sheet as SVG: one unit is one millimetre."""
    w, h = _shown(drawn.width_mm), _shown(drawn.height_mm)
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{w}mm" height="{h}mm" viewBox="0 0 {w} {h}">',
        f"<title>{escape(drawn.title)}</title>",
        f'<rect width="{w}" height="{h}" fill="#fff"/>',
        '<g fill="#000" fill-rule="evenodd">',
        *(f'<path d="{_path(area)}"/>' for area in drawn.areas),
        *(f'<circle cx="{_shown(x)}" cy="{_shown(y)}" r="{_shown(r)}"/>' for x, y, r in drawn.discs),
        "</g>",
        '<g fill="#000" font-family="Verdana, DejaVu Sans, Bitstream Vera Sans, sans-serif">',
        *(_svg_text(text) for text in drawn.texts),
        "</g>",
        "</svg>",
    ]
    return "\n".join(lines) + "\n"


def _shown(value: float) -> str:
    """Millimetres to a tenth of a micrometre."""
    return f"{value:.4f}".rstrip("0").rstrip(".")


def _path(area: tuple[Loop, ...]) -> str:
    return "".join(f"M{'L'.join(f'{_shown(x)} {_shown(y)}' for x, y in loop)}Z" for loop in area)


def _svg_text(text: Text) -> str:
    x, y = _shown(text.x_mm), _shown(text.y_mm)
    turn = f' transform="rotate(-90 {x} {y})"' if text.turned else ""
    return (
        f'<text x="{x}" y="{y}" font-size="{text.size_mm}" text-anchor="{text.anchor}"{turn}>{escape(text.text)}</text>'
    )


def pdf(drawn: Sheet) -> bytes:
    """The sheet as a PDF of one page, which asks the viewer not to scale it.

    Raises:
        MissingExtraError: reportlab is not installed.
    """
    try:
        from reportlab.pdfgen.canvas import Canvas
    except ImportError:
        raise MissingExtraError("a board as PDF", "pdf") from None
    from .. import __version__

    out = io.BytesIO()
    canvas = Canvas(
        out, pagesize=(drawn.width_mm * MM_PT, drawn.height_mm * MM_PT), invariant=1, pageCompression=1, lang="en"
    )
    canvas.setTitle(drawn.title)
    canvas.setCreator(f"subtense {__version__}")
    canvas.setViewerPreference("PrintScaling", "None")
    font = _font()
    canvas.translate(0, drawn.height_mm * MM_PT)
    canvas.scale(MM_PT, -MM_PT)  # millimetres, y down
    for area in drawn.areas:
        path = canvas.beginPath()
        for loop in area:
            path.moveTo(*loop[0])
            for corner in loop[1:]:
                path.lineTo(*corner)
            path.close()
        canvas.drawPath(path, stroke=0, fill=1, fillMode=0)  # even-odd
    for x, y, r in drawn.discs:
        canvas.circle(x, y, r, stroke=0, fill=1)
    for text in drawn.texts:
        _pdf_text(canvas, text, font)
    canvas.showPage()
    canvas.save()
    return out.getvalue()


def _font() -> str:
    """A font that the file embeds."""
    from reportlab.pdfbase.pdfmetrics import getRegisteredFontNames, registerFont
    from reportlab.pdfbase.ttfonts import TTFont

    if "Vera" not in getRegisteredFontNames():
        registerFont(TTFont("Vera", "Vera.ttf"))
    return "Vera"


def _pdf_text(canvas: Any, text: Text, font: str) -> None:
    canvas.saveState()
    canvas.translate(text.x_mm, text.y_mm)
    canvas.scale(1, -1)
    if text.turned:
        canvas.rotate(90)
    canvas.setFont(font, text.size_mm)
    draw = {"start": canvas.drawString, "middle": canvas.drawCentredString, "end": canvas.drawRightString}[text.anchor]
    draw(0, 0, text.text)
    canvas.restoreState()
