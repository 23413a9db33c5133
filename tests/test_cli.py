"""The command line: what it prints, and how it refuses."""

import json
import re
import subprocess
import sys

import click
import pytest
from click.testing import CliRunner
from PIL import Image

from subtense import __version__
from subtense.cli import main

BELT = ["calc", "--focal", "35", "--sensor-width", "14.1", "--image-width", "4096", "--size", "200", "--extent", "150"]


def run(*arguments):
    return CliRunner().invoke(main, [str(a) for a in arguments], catch_exceptions=False)


@pytest.fixture
def photo(tmp_path):
    path = tmp_path / "a.jpg"
    Image.new("RGB", (400, 300), "gray").save(path)
    return path


def test_the_worked_example_is_printed_to_its_digits():
    text = run(*BELT).output
    for number in ("13.56 m", "13 556.50 mm", "290.496 px/mm", "10 167.376 px", "1.3333 mm/px", "22.777°", "0.845°"):
        assert number in text
    for part in ("what it consists of", "to improve it", "assumed", "note frontal_assumption", "95 %"):
        assert part in text


def test_a_stated_doubt_is_printed_as_it_was_read():
    text = run(*BELT[:-4], "--size", "200 ± 0.5 mm", "--extent", "150 ± 1 px (limits)").output
    assert "± read as a 95 % interval" in text
    assert "± read as limits" in text


def test_version_and_help():
    assert __version__ in run("--version").output
    for command in ("calc", "camera", "measure", "method", "presets"):
        assert command in run("--help").output
        assert run(command, "--help").exit_code == 0


def test_presets_can_be_searched():
    text = run("presets", "aps").output
    assert "aps-c" in text and "full-frame" not in text


@pytest.mark.parametrize("form", ["json", "csv"])
def test_machine_formats_stand_alone_on_the_output(form):
    text = run(*BELT, "--format", form).output
    if form == "json":
        assert json.loads(text)["measurements"][0]["value"] == pytest.approx(13.5565, abs=1e-4)
    else:
        head, *rows = text.strip().split("\n")
        assert head.startswith("photo,label,what,value,unit,u,low,high")
        assert len(rows) == 7


@pytest.mark.parametrize(
    ("arguments", "code", "says"),
    [
        (["calc", "--focal", "abc", *BELT[3:]], 2, r"--focal is 'abc'; give a length"),
        ([*BELT[:-1], "0"], 2, r"--extent is '0'; give a number above 0"),
        ([*BELT[:-1], "5000"], 2, r"extent is '5000 px'; the picture has 4096 px"),
        ([*BELT, "--distance", "3 m"], 2, "leave out exactly one"),
        ([*BELT, "--format", "xml"], 2, "--format is 'xml'; give text, json, csv"),
        ([*BELT, "--level", "95"], 2, r"level is 95.0; give a coverage from 0.5 to 0.999"),
        (["calc", "--size", "3"], 2, "--image-width is missing"),
        ([*BELT, "--size", "6 ft 2"], 2, "name the unit of every part"),
        (["calc", "--preset", "hubble", "--size", "3", "--extent", "3"], 2, "--preset is 'hubble'"),
        (["measure", "{photo}", "--line", "0,0,100,0", "--size", "20"], 2, "no camera .* give --camera"),
        (["measure", "{photo}"], 2, "no camera .* give --camera"),
        (["measure", "{photo}", "--camera", "f=300px", "--only", "markers"], 3, "nothing was found; looked for were ArUco"),
        (["measure", "{photo}", "--camera", "f=300px", "--only", "lasers"], 2, "--only is 'lasers'; known are markers"),
        (["measure", "{photo}", "--camera", "f=300px", "--target", "moon"], 2, "--target is 'moon'"),
        (["measure", "{photo}", "--camera", "f=300px", "--only", "markers", "--curve", "film"], 2, "--curve is 'film'; write srgb"),
        (["detect", "{photo}", "--only", "markers"], 3, "nothing was found"),
        (["measure", "{photo}", "--line", "0,0,100,0"], 2, "--size is missing"),
        (["measure", "{photo}", "--size", "20", "--size", "30"], 2, "--line is missing"),
        (["measure", "{photo}", "--line", "0,0,100", "--size", "20"], 2, "--line is '0,0,100'; give 2 points"),
        (["measure", "{photo}", "--line", "0,0,900,0", "--size", "20", "--camera", "f=300px"], 2, "400 x 300 px"),
        (["measure", "{photo}", "--line", "5,5,5,5", "--size", "20", "--camera", "f=300px"], 3, "no extent in the picture"),
        (["measure", "{photo}", "--line", "0,0,9,9", "--size", "-2", "--camera", "f=300px"], 2, "--size is '-2'"),
        (["measure", "{photo}", "--line", "0,0,9,9", "--size", "2", "--size", "3", "--camera", "f=300px"], 2, "2 sizes for 1 lines"),
        (["measure", "{photo}", "--marker-size", "50", "--camera", "f=300px"], 3, "nothing was found; looked for were ArUco"),
        (["measure", "{photo}", "--marker-size", "50", "--camera", "f=300px", "--marker-family", "x"], 2, "--marker-family is 'x'"),
        (["measure", "{photo}", "--line", "0,0,9,9", "--size", "2", "--camera", "f=300px", "--overlay", "a.txt"], 2, "--overlay is"),
        (["measure", "{photo}", "--line", "0,0,9,9", "--size", "2", "--camera", "f=300px", "--overlay", "no/a.png"], 2, "does not exist"),
        (["measure", "missing.jpg", "--marker-size", "50"], 2, "missing.jpg: no such file"),
        (["measure", ".", "--marker-size", "50"], 2, "is a folder"),
        (["camera", "{photo}"], 2, "no camera"),
        (["camera", "{photo}", "--camera", "cal.yaml"], 2, "cal.yaml: no such file"),
        (["method", "known_size", "--size", "3 mm"], 2, "say how well it is known"),
        (["method", "known_size", "--size", "0.2 exact"], 2, "give a length in m, mm"),
        ([*BELT[:-2], "--distance", "10 mm"], 3, "inside the focal length"),
        ([*BELT[:-2], "--distance", "50 mm"], 3, "the picture has 4096 px along its width"),
        (["method", "known_size", "--size", "3 ± 1 mm"], 2, "also needs camera, ends"),
        (["method", "known_size"], 2, "give either --inputs FILE or the single inputs"),
    ],
    ids=lambda x: " ".join(x)[:60] if isinstance(x, list) else None,
)  # fmt: skip
def test_bad_input_is_one_line_with_its_exit_code(photo, arguments, code, says):
    result = run(*[a.replace("{photo}", str(photo)) for a in arguments])
    assert result.exit_code == code, result.output
    assert result.stdout == ""
    assert re.search(says, result.stderr), result.stderr
    assert result.stderr.count("\n") == 1 and "Traceback" not in result.stderr


def test_nothing_is_written_when_nothing_was_measured(photo, tmp_path):
    out = tmp_path / "out.png"
    run("measure", photo, "--marker-size", "50", "--camera", "f=300px", "--overlay", out)
    assert not out.exists()


def test_overlay_is_written_whole_and_of_the_pictures_size(photo, tmp_path):
    out = tmp_path / "out.png"
    result = run("measure", photo, "--line", "50,50,250,60", "--size", "20", "--camera", "f=300px", "--overlay", out)
    assert result.exit_code == 0
    with Image.open(out) as picture:
        assert picture.size == (400, 300)
    assert {p.name for p in tmp_path.iterdir()} == {"a.jpg", "out.png"}


def test_several_lines_are_labelled_and_share_the_camera(photo):
    lines = ["--line", "50,50,250,60", "--line", "50,100,250,110"]
    data = json.loads(run("measure", photo, *lines, "--size", "20", "--camera", "f=300px", "--format", "json").output)
    assert [m["label"] for m in data["measurements"]] == ["line 1", "line 1", "line 2", "line 2"]


def test_a_measurement_can_be_measured_again_from_what_was_given(photo, tmp_path):
    text = run(
        "measure", photo, "--line", "50,50,250,60", "--size", "20", "--camera", "f=300px", "--format", "json"
    ).output
    first = json.loads(text)["measurements"][0]
    (tmp_path / "again.json").write_text(json.dumps(first))
    again = json.loads(run("method", "known_size", "--inputs", tmp_path / "again.json", "--format", "json").output)[
        "measurements"
    ][0]
    assert {k: again[k] for k in ("value", "u", "low", "high")} == {k: first[k] for k in ("value", "u", "low", "high")}


def test_control_characters_of_a_file_name_do_not_reach_the_terminal(tmp_path):
    result = run("measure", tmp_path / "a\x1b[31m\n.jpg", "--marker-size", "50")
    assert result.exit_code == 2
    assert "\x1b" not in result.stderr and result.stderr.count("\n") == 1


def test_help_and_calc_load_nothing_heavy():
    code = (
        "import sys; from click.testing import CliRunner; from subtense.cli import main;"
        "CliRunner().invoke(main, {arguments!r}, catch_exceptions=False);"
        "print([m for m in {modules!r} if m in sys.modules])"
    )
    for arguments, modules in (
        (["--help"], ["numpy", "PIL", "cv2", "scipy"]),
        (BELT, ["PIL", "cv2", "scipy", "tomllib"]),
    ):
        command = [sys.executable, "-c", code.format(arguments=arguments, modules=modules)]
        assert subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip() == "[]"


def test_the_photo_itself_is_never_written_over(photo):
    before = photo.read_bytes()
    result = run("measure", photo, "--line", "50,50,250,60", "--size", "20", "--camera", "f=300px", "--overlay", photo)
    assert result.exit_code == 2 and "the photo itself" in result.stderr
    assert photo.read_bytes() == before


@pytest.mark.parametrize(
    "content", ['{"size": 0.2}', '{"size": "0.2 m exact"}', "[]", "{", '{"size": {}}', '{"what": 1}']
)
def test_inputs_that_are_no_nouns_are_one_line(tmp_path, content):
    path = tmp_path / "inputs.json"
    path.write_text(content)
    result = run("method", "known_size", "--inputs", path)
    assert result.exit_code == 2 and result.stderr.count("\n") == 1


def test_commands_that_are_loaded_later_say_in_the_list_what_they_say_themselves():
    from subtense.cli import _ELSEWHERE

    context = click.Context(main)
    listed = CliRunner().invoke(main, ["--help"]).output
    for name, (_, text) in _ELSEWHERE.items():
        assert main.get_command(context, name).get_short_help_str(1000) == text
        assert f"  {name} " in listed
