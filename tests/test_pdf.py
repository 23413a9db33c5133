"""The PDF report, read back with poppler's pdftotext."""

import re
import shutil
import subprocess
import sys

import pytest
from PIL import Image

from subtense import METHODS, __version__, propagate
from subtense.document import Document
from subtense.errors import MissingExtraError
from subtense.quantity import Contribution, Measurement, Note
from subtense.reports.pdf import report
from subtense.workflow.given import given

pytest.importorskip("reportlab", reason="the PDF report needs reportlab")
needs_pdftotext = pytest.mark.skipif(not shutil.which("pdftotext"), reason="reading it back needs poppler's pdftotext")

SHA256 = "0123456789abcdef" * 4
PHOTO = {"name": "quay.jpg", "width_px": 800, "height_px": 600, "sha256": SHA256}
CAMERA = {
    "f_px": 1201.85, "u_f_px": 32.9, "width_px": 800, "height_px": 600, "lens": "pinhole", "source": "a calibration",
    "hypotheses": [{"source": "exif_35mm", "f_px": 1300.0, "u_f_px": 40.0, "text": "the tags", "chosen": False}],
}  # fmt: skip


def measurement(**more):
    fields = {
        "what": "range", "value": 2.0, "u": 0.11, "low": 1.8, "high": 2.2, "unit": "m", "method": "known_size",
        "budget": (Contribution("tape", "stated", 0.1, 0.8), Contribution("clicks", "assumed", -0.05, 0.2)),
        "evaluation": "second order", "improve": "use a better tape",
        "given": {"size": {"value": 1.5, "u": 0.012, "unit": "m", "source": "a tape"}, "distance": None},
    }  # fmt: skip
    return Measurement(**{**fields, **more})


def pages(document, *rest, **more):
    """The text of each page, with plain spaces."""
    command = ["pdftotext", "-raw", "-", "-"]
    out = subprocess.run(command, input=report(document, *rest, **more), stdout=subprocess.PIPE, check=True).stdout
    text = out.decode().replace("\u00a0", " ")
    return [re.sub(r"[ \n]+", " ", page) for page in text.split("\f")[:-1]]


def test_it_is_the_same_for_the_same_document():
    document = Document((measurement(),), CAMERA, PHOTO)
    first, second = (report(document, Image.new("RGB", (80, 60), "red")) for _ in range(2))
    assert first.startswith(b"%PDF")
    assert first == second
    assert b"D:20000101" in first  # reportlab's stand-in for the clock


@needs_pdftotext
def test_it_says_what_was_found_and_what_it_rests_on():
    note = Note("far_away", "a doubt", "go nearer")
    document = Document((measurement(notes=(note,)),), CAMERA, PHOTO)
    shown = " ".join(pages(document, assumes={"known_size": ("the ends are seen",), "pose": ("another thing",)}))
    for part in (
        "Measurement report", "quay.jpg, 800 × 600 px", "2.00 m 1.80 to 2.20 m 0.11 m known_size", "95 % interval",
        "1 202 px, 95 %: 1 137 to 1 266 px (u 33 px)", "a calibration", "exif_35mm says 1 300 px", "the tags",
        "the ends are seen", "second order", "size 1.500 m 0.012 m normal; a tape", "distance not given",
        "tape stated 80 % 0.10 m", "clicks assumed 20 % 0.050 m", "combined 100 % 0.11 m",
        "far away a doubt. Cure: go nearer.", "Use a better tape", f"subtense {__version__}", SHA256, "page 1 of",
    ):  # fmt: skip
        assert part in shown, part
    assert "another thing" not in shown


@needs_pdftotext
@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"high": None, "u": None}, "from 1.80 m, upper limit open none known_size"),
        ({"low": None, "u": None}, "up to 2.20 m, lower limit open none known_size"),
        ({"low": None, "high": None, "u": None}, "open on both sides none known_size"),
        ({"u": 0.0, "low": 2.0, "high": 2.0, "budget": ()}, "2 m exact 0 known_size"),
        ({"value": -2.0, "low": -2.2, "high": -1.8}, "−2.00 m −2.20 to −1.80 m 0.11 m"),
        ({"level": 0.68}, "68 % interval"),
    ],
)
def test_every_kind_of_interval_is_told(change, says):
    assert says in pages(Document((measurement(**change),)))[0]


@needs_pdftotext
def test_different_levels_stand_at_their_intervals():
    shown = pages(Document((measurement(), measurement(what="depth", level=0.68))))[0]
    assert "95 %: 1.80 to 2.20 m" in shown and "68 %: 1.80 to 2.20 m" in shown


@needs_pdftotext
def test_names_are_printed_as_they_are():
    hostile = '<b>x</b>&"'
    document = Document((measurement(label=hostile),), photo={**PHOTO, "name": f"{hostile}.jpg"})
    shown = " ".join(pages(document))
    assert f"{hostile}.jpg" in shown
    assert shown.count(hostile) == 3  # the title, the table, the section


@needs_pdftotext
def test_characters_without_a_glyph_are_question_marks():
    shown = pages(Document((measurement(label="Łódź, e\u0301 ±µμ°² 1\u202f000\u2009m 窓\x00\udcff"),)))[0]
    assert "Ł" in shown and "é ±µµ°² 1 000 m ???" in shown


@needs_pdftotext
def test_many_measurements_fill_pages_and_one_is_signed():
    found = tuple(measurement(label=f"post {i}") for i in range(20))
    shown = pages(Document(found, photo=PHOTO), date="4 May 2026")
    assert len(shown) >= 5
    for i, page in enumerate(shown, 1):
        assert f"page {i} of {len(shown)}" in page and SHA256 in page
        assert ("Signature" in page and "4 May 2026" in page) == (i == len(shown))
    assert all(f"post {i} range" in " ".join(shown) for i in range(20))


@pytest.mark.parametrize("long", ["W" * 9000, "wide words " * 900])
def test_no_text_is_too_long(long):
    budget = (Contribution(long, long, 0.1, 1.0),)
    notes = (Note(long, long, long),)
    m = measurement(label=long, what=long, method=long, evaluation=long, budget=budget, notes=notes, given={long: long})
    document = Document((m,), {**CAMERA, "source": long}, {**PHOTO, "name": long}, notes)
    assert report(document, Image.new("RGB", (10, 4000)), assumes={long: (long,)}, date=long)


def test_a_large_picture_is_printed_with_300_dots_per_inch():
    data = report(Document(photo=PHOTO), Image.effect_noise((6000, 3000), 50))
    assert re.findall(rb"/Width (\d+)", data) == [b"2008"]  # 170 mm at 300 per inch
    small = report(Document(photo=PHOTO), Image.new("RGB", (300, 200)))
    assert re.findall(rb"/Width (\d+)", small) == [b"300"]


@needs_pdftotext
def test_without_a_picture():
    shown = pages(Document((measurement(),)))
    assert "without a picture" in shown[0] and "SHA-256" not in shown[0]


@needs_pdftotext
@pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
def test_inputs_of_every_method_are_readable(method):
    inputs = method.example()
    found = propagate.measure(method, inputs, given=given(inputs), label="")
    shown = " ".join(pages(Document(tuple(found)), assumes={method.name: method.assumes}))
    table = shown.partition("law, source ")[2]
    assert all(name.replace("_", " ") in table for name in found[0].given)
    assert not re.search(r"[{}\[\]$#]|_px\b|None", table)


def test_reportlab_is_asked_for_where_it_is_missing(monkeypatch):
    monkeypatch.setitem(sys.modules, "reportlab", None)
    with pytest.raises(MissingExtraError, match="PDF"):
        report(Document())
