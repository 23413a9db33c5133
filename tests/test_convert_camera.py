"""`subtense camera convert`: one calibration file from another, whole or not at all."""

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from subtense.camera_files import formats
from subtense.cli import main

HERE = Path(__file__).parent / "data" / "camera_files"


@pytest.fixture
def run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def call(*words):
        return CliRunner().invoke(main, ["camera", *map(str, words)])

    return call


def test_formats_by_content_and_by_ending(run):
    assert run("convert", f"{HERE / 'cameras.txt'}#5", "c.yml").output == ""
    for name in ("c.xml", "c.bin", "c.cameramodel", "c.txt", "c.json"):
        assert run("convert", "c.yml", name).exit_code == 0
        assert run("convert", name, "again.yml").exit_code == 0
        assert Path("again.yml").read_bytes() == Path("c.yml").read_bytes()
    assert set(json.loads(Path("c.json").read_text())) == {"camera", "notes"}
    assert run("convert", "c.yml", "c.dat", "--to", "ros", "--from", "opencv").exit_code == 0
    assert "distortion_model: plumb_bob" in Path("c.dat").read_text()
    assert sorted(p.name for p in Path().iterdir()) == sorted(
        ["c.yml", "c.xml", "c.bin", "c.cameramodel", "c.txt", "c.json", "again.yml", "c.dat"]
    )


def test_what_is_lost_is_said_in_one_line(run):
    run("convert", f"{HERE / 'cameras.txt'}#5", "c.json")
    tree = json.loads(Path("c.json").read_text())
    tree["camera"]["cov"] = [[0.0] * 9] * 9
    tree["notes"] = [{"code": "model_error", "message": "a", "cure": "b"}]
    Path("c.json").write_text(json.dumps(tree))
    found = run("convert", "c.json", "c.yml")
    assert found.exit_code == 0
    assert (
        found.stderr == "note: c.yml: OpenCV YAML does not keep the uncertainty (covariance), the notes model_error\n"
    )


def test_a_format_that_cannot_hold_the_lens_leaves_nothing_behind(run):
    found = run("convert", f"{HERE / 'cameras.txt'}#7", "c.yaml", "--to", "kalibr")
    assert found.exit_code == 2
    assert "--to is 'kalibr'; it can't hold brown_conrady with 8 coefficients; subtense, opencv_json" in found.stderr
    assert not list(Path().iterdir())


def test_the_file_to_read_is_never_written(run):
    run("convert", f"{HERE / 'cameras.txt'}#5", "c.yml")
    before = Path("c.yml").read_bytes()
    Path("link.txt").symlink_to("c.yml")
    for target in ("c.yml", "./c.yml", "link.txt"):
        found = run("convert", "c.yml#640x480", target)
        assert found.exit_code == 2 and "it is the one to read; name another" in found.stderr
    assert Path("c.yml").read_bytes() == before


def test_a_write_that_fails_leaves_what_was_there(run, monkeypatch):
    run("convert", f"{HERE / 'cameras.txt'}#5", "c.yml")
    Path("old.txt").write_text("old")

    def full(self, target):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "replace", full)
    found = run("convert", "c.yml", "old.txt")
    assert found.stderr == "subtense: the file to write is 'old.txt'; it can't be written (No space left on device)\n"
    assert sorted(p.name for p in Path().iterdir()) == ["c.yml", "old.txt"] and Path("old.txt").read_text() == "old"


@pytest.mark.parametrize(
    ("words", "wrong"),
    [
        (("convert", "none.yml", "c.json"), "none.yml: no such file"),
        (("convert", "none.yml", "c.dat"), "--to is missing; c.dat does not tell the format; known are subtense"),
        (("convert", "none.yml", "c.json", "--to", "exif"), "--to is 'exif'; known are subtense"),
        (("convert", HERE / "cameras.bin", "c.json"), r"has 13 cameras (1, 2, 3"),
    ],
)
def test_refusals(run, words, wrong):
    found = run(*words)
    assert found.exit_code == 2 and wrong in found.stderr and found.stderr.count("\n") == 1


def test_camera_of_a_photo_is_as_it_was(run):
    photo = Path(__file__).parent.parent / "examples" / "belt.jpg"
    assert run(photo).output == run(photo, "--format", "text").output == run("--format", "text", photo).output
    assert run(photo).output.startswith("belt.jpg, 1600 x 1200 px\ncamera: f = 2 667 px")
    assert "Missing argument 'PHOTO'" in run().stderr and run().exit_code == 2
    assert "convert: no such file" in run("./convert").stderr
    assert "--camera CAMERA" in run("--help").output and "convert  Write" in run("--help").output


def test_help_names_every_format(run):
    said = run("convert", "--help").output
    assert all(name in said.replace("\n ", " ") for name in formats.FORMATS)
