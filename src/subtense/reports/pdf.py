"""A PDF that somebody can sign: results, the annotated picture, the camera, and what every number rests on.

It is the same, byte for byte, for the same document. The fonts are those that reportlab brings along, embedded; a character
they lack is printed as "?".
"""

from __future__ import annotations

import io
import math
import unicodedata
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape

from ..distribution import HALF_WIDTH_95
from ..document import Document
from ..errors import MissingExtraError
from ..quantity import Contribution, Measurement, Note
from .inputs import NO_BREAK, input_row, short, typeset, with_doubt
from .rounding import digits_for, fitting_unit, grouped

PAGE_PT = (595.276, 841.89)
"""A4 portrait."""
MM_PT = 72 / 25.4
MARGIN_MM, BOTTOM_MM = 20.0, 24.0
WIDTH_MM = 210.0 - 2 * MARGIN_MM
PICTURE_HEIGHT_MM = 130.0
PICTURE_DPI, PICTURE_QUALITY = 300, 88
ACCENT, INK, QUIET, RULE, TRACK = "#1f5673", "#1c1c1c", "#5c6670", "#c3cad0", "#e9edf0"
LONGEST = 600
"""Characters of one cell; a row that is higher than a page can't be set."""
SHORT = 72
"""Characters of a label where it stands beside numbers; it is whole over its section."""

_TITLES = {
    "size": "real size",
    "extent": "extent in the picture",
    "focal_length_px": "focal length in pixels",
    "sensor_scale": "scale on the sensor",
    "object_scale": "scale at the object",
    "field_of_view": "field of view across the width",
    "angle": "angle the object subtends",
    "tilt": "tilt to the line of sight",
}
_MEANINGS = {
    "range": "Range is the distance from the entrance pupil of the lens.",
    "depth": "Depth is the distance along the optical axis.",
}
_WRITTEN_AS = {"\u2009": NO_BREAK, "\u202f": NO_BREAK, "\u2007": NO_BREAK, "μ": "µ", "′": "'", "″": '"'}
_FONTS = {"Vera": "Vera.ttf", "VeraBd": "VeraBd.ttf"}
_STYLES: dict[str, dict[str, Any]] = {
    "title": {"fontName": "VeraBd", "fontSize": 18, "leading": 23, "textColor": ACCENT},
    "subtitle": {"fontSize": 10.5, "leading": 14, "spaceAfter": 10},
    "section": {"fontName": "VeraBd", "fontSize": 11.5, "leading": 15, "textColor": ACCENT, "spaceBefore": 14,
                "spaceAfter": 4, "keepWithNext": 1},
    "part": {"fontName": "VeraBd", "fontSize": 8, "leading": 11, "spaceBefore": 8, "spaceAfter": 2, "keepWithNext": 1},
    "body": {}, "small": {"fontSize": 7, "leading": 10, "textColor": QUIET, "spaceBefore": 4},
    "strong": {"fontName": "VeraBd"}, "term": {"textColor": QUIET},
    "head": {"fontSize": 7, "leading": 9.5, "textColor": QUIET},
    "right": {"alignment": 2}, "strong_right": {"fontName": "VeraBd", "alignment": 2},
    "head_right": {"fontSize": 7, "leading": 9.5, "textColor": QUIET, "alignment": 2},
}  # fmt: skip


def report(
    document: Document,
    picture: Any | None = None,
    *,
    assumes: Mapping[str, Sequence[str]] | None = None,
    date: str = "",
) -> bytes:
    """The document as a PDF of A4 pages, with a place to sign on the last.

    Args:
        document: what was measured.
        picture: the annotated photo as a Pillow image; None to leave it out.
        assumes: what must hold for an interval to hold, by the name of the method.
        date: beside the signature; empty to leave it to the hand that signs.

    Raises:
        MissingExtraError: reportlab is not installed.
    """
    try:
        import reportlab  # noqa: F401
    except ImportError:
        raise MissingExtraError("a PDF report", "pdf") from None
    jpeg = None if picture is None else _jpeg(picture)
    _, pages = _built(document, jpeg, assumes or {}, date, 0)
    data, _ = _built(document, jpeg, assumes or {}, date, pages)  # "of m" is known only now
    return data


def _built(
    document: Document, jpeg: bytes | None, assumes: Mapping[str, Sequence[str]], date: str, pages: int
) -> tuple[bytes, int]:
    """The file and its number of pages, with `pages` printed as that number."""
    from reportlab.platypus import SimpleDocTemplate

    from .. import __version__

    _fonts()
    out = io.BytesIO()
    side_pt = MARGIN_MM * MM_PT - 6.0  # reportlab pads its frame by 6 pt
    name = str(document.photo["name"]) if document.photo else ""
    template = SimpleDocTemplate(
        out, pagesize=PAGE_PT, leftMargin=side_pt, rightMargin=side_pt,
        topMargin=MARGIN_MM * MM_PT, bottomMargin=BOTTOM_MM * MM_PT, invariant=1, lang="en",
        title=_clean(f"Measurement report: {name}" if name else "Measurement report", LONGEST), author="",
        subject="Measurements with their uncertainty", creator=f"subtense {__version__}",
    )  # fmt: skip
    footer = _footer(document, pages)
    template.build(list(_story(document, jpeg, assumes, date)), onFirstPage=footer, onLaterPages=footer)
    return out.getvalue(), template.page


def _footer(document: Document, pages: int) -> Callable[[Any, Any], None]:
    from .. import __version__

    photo = document.photo or {}
    digest = str(photo.get("sha256") or "")
    origin = f"SHA-256 of the picture {digest}" if digest else "calculated from stated numbers, without a picture"
    left, right, base = MARGIN_MM * MM_PT, PAGE_PT[0] - MARGIN_MM * MM_PT, 12 * MM_PT

    def draw(canvas: Any, template: Any) -> None:
        canvas.saveState()
        canvas.setStrokeColor(RULE)
        canvas.setLineWidth(0.5)
        canvas.line(left, base + 20, right, base + 20)
        canvas.setFillColor(QUIET)
        canvas.setFont("Vera", 6.5)
        canvas.drawString(left, base + 9, _clean(origin))
        canvas.drawString(left, base - 1, _clean(f"subtense {__version__}"))
        canvas.drawRightString(right, base - 1, f"page {template.page} of {pages}")
        canvas.restoreState()

    return draw


def _story(document: Document, jpeg: bytes | None, assumes: Mapping[str, Sequence[str]], date: str) -> Iterator[Any]:
    """All that stands on the pages, in order."""
    yield _paragraph("Measurement report", "title")
    yield _paragraph(_subtitle(document), "subtitle", most=None)
    yield from _results(document)
    yield from _notes(document.notes)
    if jpeg is not None:
        yield from _picture(jpeg)
    if document.camera:
        yield from _camera(document.camera)
    for label in dict.fromkeys(m.label for m in document.measurements):
        group = [m for m in document.measurements if m.label == label]
        yield from _section(group, assumes, document.camera)
    yield _signature(date)


def _subtitle(document: Document) -> str:
    if not document.photo:
        return "Calculated from stated numbers, without a picture"
    p = document.photo
    return f"{p['name']}, {p['width_px']} × {p['height_px']} px"


# -- results -----------------------------------------------------------------------------------------


def _results(document: Document) -> Iterator[Any]:
    """The table of all results, and how to read it."""
    found = document.measurements
    if not found:
        yield _paragraph("Nothing was measured.")
        return
    levels = {m.level for m in found}
    one_level = len(levels) == 1
    labelled = any(m.label for m in found)
    head = ["what", "value", f"{_percent(found[0].level)} interval" if one_level else "interval", "u", "method"]
    rows, starts, last = [["label", *head] if labelled else head], [], None
    for m in found:
        if m.label != last:
            starts.append(len(rows))
            last = m.label
        level = "" if one_level or m.u == 0 else f"{_percent(m.level)}: "
        row = [_title(m), _value(m), level + _interval(m), _u(m), _paragraph(m.method, most=SHORT)]
        rows.append([_shortened(m.label), *row] if labelled else row)
    widths_mm = (30.0, 31.0, 27.0, 38.0, 18.0, 26.0) if labelled else (44.0, 29.0, 44.0, 26.0, 27.0)
    numbers = (2, 3, 4) if labelled else (1, 2, 3)
    yield _table(rows, widths_mm, right=numbers, strong=starts)
    yield _paragraph(" ".join(_explained(found)), "small")


def _explained(found: Sequence[Measurement]) -> Iterator[str]:
    """How to read the table, of what stands in it."""
    yield "u is the standard uncertainty (one standard deviation)."
    if any(m.u is None for m in found):
        yield "Where an interval is open or its tail too long, u has no meaning and none is given."
    yield "An interval holds where the assumptions of its method hold."
    yield from (text for what, text in _MEANINGS.items() if any(m.what == what for m in found))


def _title(m: Measurement) -> str:
    return _TITLES.get(m.what, m.what.replace("_", " "))


def _percent(level: float) -> str:
    return f"{100 * level:.8g}{NO_BREAK}%"


def _doubt(m: Measurement) -> float:
    """u, or what stands for it in rounding where it has no meaning."""
    if m.u is not None:
        return m.u
    ends = [end for end in (m.low, m.high) if end is not None]
    return max((abs(m.value - end) for end in ends), default=abs(m.value)) / 2


def _value(m: Measurement) -> str:
    return with_doubt(m.value, m.unit, _doubt(m))


def _u(m: Measurement) -> str:
    if m.u is None:
        return "none"
    return "0" if m.u == 0 else short(m.u, m.unit, m.value)


def _interval(m: Measurement) -> str:
    """Both ends in the value's unit; an open one is told in words."""
    if m.u == 0:
        return "exact"
    if m.low is None and m.high is None:
        return "open on both sides"
    name, factor = fitting_unit(m.value or _doubt(m), m.unit)
    decimals = max(digits_for(_doubt(m) / factor), 0)
    unit = name if name == "°" else f" {name}"
    low, high = (None if x is None else typeset(grouped(x / factor, decimals)) for x in (m.low, m.high))
    if high is None:
        return f"from {low}{typeset(unit)}, upper limit open"
    if low is None:
        return f"up to {high}{typeset(unit)}, lower limit open"
    return f"{low} to {high}{typeset(unit)}".strip(NO_BREAK)


# -- the picture -------------------------------------------------------------------------------------


def _printed_pt(width_px: int, height_px: int) -> tuple[float, float]:
    """Printed width and height of a picture, as large as the page leaves room for."""
    scale = min(WIDTH_MM * MM_PT / width_px, PICTURE_HEIGHT_MM * MM_PT / height_px)
    return width_px * scale, height_px * scale


def _jpeg(picture: Any) -> bytes:
    """The picture with no more pixels than print shows."""
    from PIL import Image

    width_pt, height_pt = _printed_pt(*picture.size)
    size = [max(round(side_pt / 72 * PICTURE_DPI), 1) for side_pt in (width_pt, height_pt)]
    picture = picture.convert("RGB")
    if size[0] < picture.width:
        picture = picture.resize(size, Image.Resampling.LANCZOS)
    out = io.BytesIO()
    picture.save(out, "JPEG", quality=PICTURE_QUALITY)
    return out.getvalue()


def _picture(jpeg: bytes) -> Iterator[Any]:
    from PIL import Image as PillowImage
    from reportlab.platypus import Image, KeepTogether

    with PillowImage.open(io.BytesIO(jpeg)) as opened:
        width_pt, height_pt = _printed_pt(*opened.size)
    drawn = Image(io.BytesIO(jpeg), width_pt, height_pt, hAlign="LEFT")
    yield KeepTogether([_paragraph("The picture, annotated", "section"), drawn])


# -- the camera --------------------------------------------------------------------------------------


def _camera(camera: Mapping[str, Any]) -> Iterator[Any]:
    """Focal length with its interval, where it comes from, and what the other sources said."""
    if "lens" not in camera:  # a calculator's focal length stands among its results
        return
    rows = [("focal length", _focal(camera["f_px"], camera.get("u_f_px"))), ("source", str(camera.get("source", "")))]
    rows += [(str(name), str(text)) for name, text in (camera.get("part_sources") or {}).items()]
    rows.append(("lens model", f"{camera['lens']}, for {camera['width_px']} × {camera['height_px']} px"))
    for other in camera.get("hypotheses", ()):
        if not other["chosen"]:
            said = _focal(other["f_px"], other["u_f_px"]) if other["f_px"] else "nothing"
            rows.append((f"{other['source']} says", f"{said}; {other['text']}"))
    yield _paragraph("Camera", "section")
    yield _terms(rows)


def _focal(f_px: float, u_px: float | None) -> str:
    if not u_px:
        return f"{with_doubt(f_px, 'px', None)}, taken as exact"
    half_px = HALF_WIDTH_95 * u_px
    decimals = max(digits_for(u_px), 0)
    low, high = (typeset(grouped(end_px, decimals)) for end_px in (f_px - half_px, f_px + half_px))
    return f"{with_doubt(f_px, 'px', u_px)}, {_percent(0.95)}: {low} to {high}{NO_BREAK}px (u{NO_BREAK}{with_doubt(u_px, 'px', u_px)})"


# -- one thing that was measured ---------------------------------------------------------------------


def _section(
    group: list[Measurement], assumes: Mapping[str, Sequence[str]], camera: Mapping[str, Any] | None
) -> Iterator[Any]:
    """What the results of one label rest on; the headline's inputs and budget."""
    from reportlab.platypus import CondPageBreak

    head = group[0]
    yield CondPageBreak(60 * MM_PT)
    yield _paragraph(head.label or "What the results rest on", "section", most=None)
    yield _terms(list(_method_rows(group, assumes)))
    if head.given:
        yield _paragraph("Inputs", "part")
        inputs = [input_row(name, value, camera) for name, value in head.given.items()]
        yield _table([["input", "value", "u", "law, source"], *inputs], (28.0, 62.0, 27.0, 53.0), right=(2,))
    if head.budget:
        yield _paragraph(f"Uncertainty budget of the {_title(head)}", "part")
        yield _budget(head)
    yield from _notes(tuple(dict.fromkeys(note for m in group for note in m.notes)))
    if head.improve:
        yield _paragraph("What would improve it most", "part")
        yield _paragraph(head.improve[0].upper() + head.improve[1:])


def _method_rows(group: list[Measurement], assumes: Mapping[str, Sequence[str]]) -> Iterator[tuple[str, str]]:
    head = group[0]
    yield _title(head), f"{_value(head)}, {_percent(head.level)} interval: {_interval(head)}"
    for method in dict.fromkeys(m.method for m in group):
        yield "method", method
        for i, sentence in enumerate(assumes.get(method, ())):
            yield "" if i else "it assumes", sentence
    evaluations = list(dict.fromkeys(m.evaluation for m in group))
    for i, evaluation in enumerate(evaluations):
        whats = ", ".join(_title(m) for m in group if m.evaluation == evaluation)
        yield "" if i else "evaluated", evaluation if len(evaluations) == 1 else f"{evaluation} ({whats})"


def _notes(notes: Sequence[Note]) -> Iterator[Any]:
    if notes:
        yield _paragraph("Notes", "part")
        rows = []
        for note in notes:
            cure = f" Cure: {note.cure}." if note.cure else ""
            rows.append((note.code.replace("_", " "), f"{note.text}.{cure}"))
        yield _terms(rows)


def _budget(m: Measurement) -> Any:
    """One line per contribution, the largest on top, with its share of the variance as a bar."""
    rows: list[list[Any]] = [["contribution", "source", "share of the variance", "", "u"]]
    for c in m.budget:
        rows.append([c.name, c.source, _bar(c), _share(c), _part_of(m, c)])
    strong = []
    if m.u:
        strong.append(len(rows))
        rows.append(["combined", "", "", typeset("100 %"), short(m.u, m.unit, m.value)])
    return _table(rows, (42.0, 59.0, 32.0, 15.0, 22.0), right=(3, 4), strong=strong)


def _part_of(m: Measurement, c: Contribution) -> str:
    """The u of a contribution; what is lost in the sum is told as a limit."""
    least = math.hypot(*(other.u for other in m.budget)) / 1000
    return short(c.u, m.unit, m.value) if abs(c.u) >= least else f"<{short(least, m.unit, m.value)}"


def _share(c: Contribution) -> str:
    return typeset(f"{100 * c.share:.0f} %" if c.share >= 0.005 else "<1 %")


def _bar(c: Contribution) -> Any:
    from reportlab.graphics.shapes import Drawing, Rect
    from reportlab.lib.colors import HexColor

    width_pt, height_pt = 30 * MM_PT, 5.0
    drawing = Drawing(width_pt, height_pt + 3)
    share = min(max(c.share, 0.0), 1.0) if math.isfinite(c.share) else 0.0
    for length_pt, colour in ((width_pt, TRACK), (share * width_pt, ACCENT)):
        bar = Rect(0, 0, length_pt, height_pt)
        bar.fillColor, bar.strokeColor = HexColor(colour), None
        drawing.add(bar)
    return drawing


# -- paper -------------------------------------------------------------------------------------------


def _signature(date: str) -> Any:
    """Lines for place, date, name and signature, kept together at the end."""
    from reportlab.platypus import KeepTogether, Table

    columns_pt = [81 * MM_PT, 8 * MM_PT, 81 * MM_PT]
    empty = _paragraph("", "body")
    rows = [
        [empty, "", _paragraph(date)], [_paragraph("place", "head"), "", _paragraph("date", "head")],
        [empty, "", empty], [_paragraph("name", "head"), "", _paragraph("signature", "head")],
    ]  # fmt: skip
    lines = [("LINEBELOW", (column, row), (column, row), 0.6, INK) for column in (0, 2) for row in (0, 2)]
    place = [("VALIGN", (0, 0), (-1, -1), "BOTTOM"), ("LEFTPADDING", (0, 0), (-1, -1), 0),
             ("VALIGN", (0, 1), (-1, 1), "TOP"), ("VALIGN", (0, 3), (-1, 3), "TOP")]  # fmt: skip
    heights_pt = [11 * MM_PT, 6 * MM_PT, 13 * MM_PT, 6 * MM_PT]
    block = Table(rows, columns_pt, heights_pt, style=[*lines, *place], hAlign="LEFT")
    return KeepTogether([_paragraph("Signature", "section"), block])


def _terms(rows: Sequence[tuple[str, str]]) -> Any:
    """Terms on the left, what they are on the right."""
    from reportlab.platypus import Table

    cells = [[_paragraph(term, "term", SHORT), _paragraph(text)] for term, text in rows]
    style = [("VALIGN", (0, 0), (-1, -1), "TOP"), ("LEFTPADDING", (0, 0), (-1, -1), 0),
             ("RIGHTPADDING", (0, 0), (-1, -1), 4), ("TOPPADDING", (0, 0), (-1, -1), 1),
             ("BOTTOMPADDING", (0, 0), (-1, -1), 1)]  # fmt: skip
    return Table(cells, [36 * MM_PT, (WIDTH_MM - 36) * MM_PT], style=style, hAlign="LEFT")


def _table(
    rows: Sequence[Sequence[Any]], widths_mm: Sequence[float], *, right: Sequence[int] = (), strong: Sequence[int] = ()
) -> Any:
    """Ruled rows under a head that returns on every page; `strong` rows are bold, with a line above."""
    from reportlab.platypus import Table

    def cell(content: Any, row: int, column: int) -> Any:
        if not isinstance(content, str):
            return content
        style = "head" if row == 0 else "strong" if row in strong else ""
        side = "right" if column in right else ""
        named = "_".join(part for part in (style, side) if part) or "body"
        return _paragraph(content, named, min(int(10 * widths_mm[column]), LONGEST))

    cells = [[cell(content, i, j) for j, content in enumerate(row)] for i, row in enumerate(rows)]
    style: list[Any] = [
        ("VALIGN", (0, 0), (-1, -1), "TOP"), ("VALIGN", (0, 0), (-1, 0), "BOTTOM"),
        ("LEFTPADDING", (0, 0), (-1, -1), 0), ("RIGHTPADDING", (0, 0), (-1, -1), 6),
        ("RIGHTPADDING", (-1, 0), (-1, -1), 0), ("LEFTPADDING", (-1, 0), (-1, -1), 6),
        ("TOPPADDING", (0, 0), (-1, -1), 2), ("BOTTOMPADDING", (0, 0), (-1, -1), 2),
        ("LINEBELOW", (0, 0), (-1, 0), 0.8, ACCENT), ("LINEBELOW", (0, 1), (-1, -1), 0.25, TRACK),
        ("LINEBELOW", (0, -1), (-1, -1), 0.5, RULE),
        *(("LINEABOVE", (0, row), (-1, row), 0.5, RULE) for row in strong if row > 1),
    ]  # fmt: skip
    return Table(cells, [w * MM_PT for w in widths_mm], style=style, repeatRows=1, hAlign="LEFT")


def _paragraph(text: str, style: str = "body", most: int | None = LONGEST) -> Any:
    """Text as it is, nothing of it read as markup."""
    from reportlab.platypus import Paragraph

    return Paragraph(escape(_clean(text, most)), _style(style))


@cache
def _style(name: str) -> Any:
    from reportlab.lib.styles import ParagraphStyle

    _fonts()
    return ParagraphStyle(name, **{"fontName": "Vera", "fontSize": 8, "leading": 11, "textColor": INK, **_STYLES[name]})


@cache
def _fonts() -> frozenset[int]:
    """Registers the fonts; the characters that all of them have."""
    import reportlab
    from reportlab.pdfbase import pdfmetrics
    from reportlab.pdfbase.ttfonts import TTFont

    folder = Path(reportlab.__file__).parent / "fonts"
    fonts = [TTFont(name, str(folder / file)) for name, file in _FONTS.items()]
    for font in fonts:
        pdfmetrics.registerFont(font)
    return frozenset.intersection(*(frozenset(font.face.charToGlyph) for font in fonts))


def _clean(text: str, most: int | None = None) -> str:
    """Text of characters that the fonts have; others are "?", breaks and tabs are spaces."""
    composed = unicodedata.normalize("NFC", text)
    if most is not None:
        composed = _shortened(composed, most)
    composed = composed.replace(" %", f"{NO_BREAK}%")
    known = _fonts()
    written = (_WRITTEN_AS.get(c, c) for c in composed)
    return "".join(
        c if c == NO_BREAK else " " if c.isspace() else c if ord(c) in known and c.isprintable() else "?"
        for c in written
    )


def _shortened(text: str, most: int = SHORT) -> str:
    """The beginning and the end of a text that is too long."""
    return text if len(text) <= most else f"{text[: most * 2 // 3]}…{text[-(most // 3) + 1 :]}"
