import csv
import io
import json

import numpy as np
import pytest
from PIL import Image

from subtense.document import Document, Shape
from subtense.photo import Photo
from subtense.quantity import Contribution, Measurement, Note
from subtense.reports import csv as csv_report
from subtense.reports import json as json_report
from subtense.reports import overlay, text
from subtense.reports.rounding import grouped, number


@pytest.mark.parametrize(
    ("value", "unit", "doubt", "shown"),
    [
        (13.5565, "m", 0.26, "13.56 m"), (0.0123456, "m", 0.0001, "12.35 mm"), (232851.06, "m", 500.0, "232.85 km"),
        (1500.0, "px", 10.0, "1 500 px"), (0.5, "rad", 0.01, "28.65°"), (2e-5, "m", 1e-6, "20.0 µm"), (5.0, "m", None, "5 m"),
    ],
)  # fmt: skip
def test_numbers_keep_two_digits_of_their_doubt(value, unit, doubt, shown):
    assert number(value, unit, doubt) == shown


def test_groups_of_three():
    assert grouped(13556.5, 2) == "13 556.50"
    assert grouped(-1234567.8, 0) == "-1 234 568"
    assert grouped(1234.0, -2) == "1 200"


def measurement(**more):
    budget = (Contribution("tape", "stated", 0.1, 0.8), Contribution("clicks", "assumed", -0.05, 0.2))
    fields = {
        "what": "range",
        "value": 2.0,
        "u": 0.11,
        "low": 1.8,
        "high": 2.2,
        "unit": "m",
        "method": "known_size",
        "budget": budget,
    }
    return Measurement(**{**fields, **more})


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({}, "2.00 m   95 %: 1.80 to 2.20 m   (u 0.11 m)"),
        ({"high": None, "u": None}, "95 %: from 1.80 m, far limit open"),
        ({"low": None, "u": None}, "95 %: up to 2.20 m, near limit open"),
        ({"low": None, "high": None, "u": None}, "95 %: open on both sides"),
        ({"u": 0.0, "low": 2.0, "high": 2.0, "budget": ()}, "2 m   exact"),
        ({"level": 0.68}, "68 %: 1.80"),
    ],
)
def test_every_kind_of_interval_is_told(change, says):
    assert says in text.report(Document((measurement(**change),)))


def test_the_report_has_budget_notes_and_cures():
    shown = text.report(Document((measurement(notes=(Note("a_code", "a doubt", "a cure"),), improve="use a tape"),)))
    for part in ("tape", "80 %", "clicks", "20 %", "note a_code: a doubt; a cure", "to improve it: use a tape"):
        assert part in shown


@pytest.mark.parametrize(
    "given",
    [
        {}, {"a": {"value": 1.0, "points": [[1.0, 2.5e-7], []], "none": None, "yes": True, "no": False, "n": -3}, "b": {}},
        {"text": "±°\"\\\n\u2028\x00😀", "np": np.float64(0.1), "big": 1e22, "small": -5e-324, "tuple": (1, 2)},
    ],
)  # fmt: skip
def test_json_is_what_the_standard_library_writes(given):
    shared = {"one": {"deep": [given, given]}, "two": given}
    document = Document(
        (measurement(given=shared), measurement(given=shared, u=None, label="é")), {"f_px": 1.5, "hypotheses": []}
    )
    wanted = json.dumps(document.to_json(), indent=2, ensure_ascii=False, allow_nan=False)
    assert json_report.report(document) == wanted


@pytest.mark.parametrize("wrong", [float("nan"), float("inf"), np.float64("nan"), {1, 2}, np.int64(3), b"x"])
def test_json_has_no_place_for_what_is_not_plain(wrong):
    for given in ({"x": wrong}, {"x": [wrong]}):
        with pytest.raises((ValueError, TypeError)):
            json_report.report(Document((measurement(given=given),)))


def test_csv_is_read_back_and_no_formula_reaches_a_spreadsheet():
    rows = list(csv.DictReader(io.StringIO(csv_report.report(Document((measurement(label="=1+1", high=None),))))))
    assert float(rows[0]["value"]) == 2.0
    assert rows[0]["high"] == ""
    assert rows[0]["label"] == "'=1+1"


def test_overlay_draws_on_the_ends_and_leaves_the_rest(tmp_path):
    path = tmp_path / "a.png"
    Image.new("RGB", (800, 600), (90, 90, 90)).save(path)
    photo = Photo.load(path)
    shapes = (Shape(((100.0, 100.0), (700.0, 100.0)), False, ""),)
    drawn = overlay.draw(Document((measurement(),), shapes=shapes), photo)
    changed = [drawn.getpixel(p) != (90, 90, 90) for p in ((400, 100), (100, 100), (400, 500), (50, 300))]
    assert changed == [True, True, False, False]
    assert drawn.getpixel((110, 560)) == (90, 90, 90)
