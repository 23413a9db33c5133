"""Reports as files: by their ending, whole or not at all."""

import csv
import io
import json

import pytest
from PIL import Image

from subtense import InputError, Observation, Photo, Quantity, measure_lines
from subtense.workflow import report_of as table
from subtense.workflow.report_of import REPORTS, report_of, write_report


@pytest.fixture(scope="module")
def photo(tmp_path_factory):
    path = tmp_path_factory.mktemp("photo") / "a.png"
    Image.new("RGB", (400, 300), (90, 90, 90)).save(path)
    return Photo.load(path)


@pytest.fixture(scope="module")
def document(photo):
    ends = Observation([[50.0, 50.0], [250.0, 60.0]])
    return measure_lines(photo, [ends], [Quantity.interval(0.02, 0.0001, "m")], camera="f=300 ± 3 px")


def test_every_suffix_and_media_type_is_its_own():
    assert len({r.suffix for r in REPORTS.values()}) == len(REPORTS)
    assert all(r.suffix.startswith(".") and "/" in r.media_type and r.title for r in REPORTS.values())
    assert [name for name, r in REPORTS.items() if r.name != name] == []


def first_number(suffix, data):
    """The headline value in a report that a program reads."""
    if suffix == ".json":
        return json.loads(data)["measurements"][0]["value"]
    return float(next(csv.DictReader(io.StringIO(data.decode())))["value"])


@pytest.mark.parametrize("name", REPORTS)
@pytest.mark.parametrize("upper", [False, True])
def test_the_ending_says_which_report(photo, document, tmp_path, name, upper):
    suffix = REPORTS[name].suffix
    path = tmp_path / f"out{suffix.upper() if upper else suffix}"
    write_report(document, photo, path)
    assert [p.name for p in tmp_path.iterdir()] == [path.name]
    data = path.read_bytes()
    if suffix == ".pdf":
        assert data.startswith(b"%PDF-") and data.rstrip().endswith(b"%%EOF")
    elif suffix == ".png":
        with Image.open(path) as picture:
            assert picture.size == (400, 300)
            picture.load()
    elif suffix == ".txt":
        assert data.decode() == f"{REPORTS['text'].function(document, photo)}\n"
    else:
        assert first_number(suffix, data) == pytest.approx(document.measurements[0].value)


@pytest.mark.parametrize("name", [name for name, r in REPORTS.items() if not r.of_photo])
def test_without_a_photo_too(document, tmp_path, name):
    path = tmp_path / f"out{REPORTS[name].suffix}"
    write_report(document, None, path)
    assert path.stat().st_size > 100


def test_a_picture_needs_a_photo(document, tmp_path):
    with pytest.raises(InputError, match=r"ends in \.txt, \.json, \.csv, \.pdf$"):
        write_report(document, None, tmp_path / "out.png")
    with pytest.raises(InputError, match=r"give text, json, csv, pdf$"):
        report_of("overlay", photo=False)
    assert report_of("overlay").of_photo


@pytest.mark.parametrize("name", ["out", "out.doc", "out.txt.gz"])
def test_an_ending_of_no_report_is_refused(photo, document, tmp_path, name):
    with pytest.raises(InputError, match="give a name that ends in"):
        write_report(document, photo, tmp_path / name)
    assert list(tmp_path.iterdir()) == []


def test_no_folder_and_the_photo_itself_are_refused(photo, document, tmp_path):
    with pytest.raises(InputError, match="does not exist"):
        write_report(document, photo, tmp_path / "no" / "out.pdf")
    before = photo.path.read_bytes()
    with pytest.raises(InputError, match="that is the photo itself"):
        write_report(document, photo, photo.path)
    assert photo.path.read_bytes() == before


def test_an_older_file_stays_where_the_new_one_cannot_be_made(photo, document, tmp_path, monkeypatch):
    path = tmp_path / "out.json"
    path.write_text("old")

    def broken(*_):
        raise RuntimeError("half way")

    monkeypatch.setitem(table.REPORTS, "json", table.Report("json", "JSON", "application/json", ".json", broken))
    with pytest.raises(RuntimeError):
        write_report(document, photo, path)
    assert [(p.name, p.read_text()) for p in tmp_path.iterdir()] == [("out.json", "old")]


@pytest.mark.parametrize("step", ["write_bytes", "replace"])
def test_an_older_file_stays_where_the_disk_is_full(photo, document, tmp_path, monkeypatch, step):
    path = tmp_path / "out.json"
    path.write_text("old")
    real = type(path).write_bytes

    def full(self, data):
        if step == "write_bytes":
            real(self, data[:10])
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(type(path), step, full)
    with pytest.raises(InputError, match=r"it can't be written \(No space left on device\)"):
        write_report(document, photo, path)
    monkeypatch.undo()
    assert [(p.name, p.read_text()) for p in tmp_path.iterdir()] == [("out.json", "old")]


def test_a_folder_of_that_name_is_refused(photo, document, tmp_path):
    (tmp_path / "out.json").mkdir()
    with pytest.raises(InputError, match="it can't be written"):
        write_report(document, photo, tmp_path / "out.json")
    assert [p.name for p in tmp_path.iterdir()] == ["out.json"]
