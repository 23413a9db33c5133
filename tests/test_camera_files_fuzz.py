"""Calibration files from strangers: whatever stands there, a reader answers with a camera or with one line, and soon."""

import random
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from subtense.camera import Camera
from subtense.camera_files import formats, selector
from subtense.camera_files.reading import Found
from subtense.errors import SubtenseError

HERE = Path(__file__).parent / "data" / "camera_files"
CAMERAS = {
    "brown": Camera(640, 480, 900.5, 321.25, 239.75, 1.001, "brown_conrady", np.array([-0.1, 0.02, 0.001, 0.002, 0.0])),
    "pinhole": Camera(640, 480, 900.5, 321.25, 239.75),
}
SEEDS = {
    **{
        row: formats.write(Found(CAMERAS["pinhole" if row in ("open3d", "kalibr") else "brown"]), row)
        for row in formats.FORMATS
    },
    **{path.name: path.read_bytes() for path in sorted(HERE.iterdir()) if path.suffix != ".md"},
}
PARTS = [b"[", b"]", b"{", b"}", b"(", b'"', b"'", b"#", b":", b"- ", b"\n", b"\n  ", b"<a>", b"</a>", b"&amp;", b"&x;", b"<!DOCTYPE a>",
         b"nan", b".inf", b"1e999", b"-1e308", b"9" * 400, b"null", b"&a", b"*a", b"!!python/object", b"|", b"\0", b"\xff", b"\t", b"\\",
         "\u2028é".encode(), b"%YAML", b"---\n", b"b'"]  # fmt: skip
FILES = [
    "a.yml",
    "a.json",
    "a.xml",
    "a.txt",
    "a.bin",
    "a.cameramodel",
    "a",
    "a.yml#640x480",
    "a.yml#fisheye,M1",
    "a.txt#1",
]


def answered(content, name="a.yml", form=None):
    """A camera, or an error of ours on one line; within a second."""
    path, pick = selector.split(name, there=False)
    start, found, said = time.process_time(), None, ""
    try:
        found = formats.read(path, content, pick, form)
    except SubtenseError as error:
        said = str(error)
    assert "\n" not in said and len(said) < 600
    assert time.process_time() - start < 2
    if found is not None:
        assert (
            np.isfinite(found.camera.rays(np.array([[found.camera.cx_px, found.camera.cy_px]]))).all()
            or found.camera.lens
        )
        formats.write(found, "subtense")
    return found


def test_the_seeds_are_read():
    for name, content in SEEDS.items():
        if name not in ("projections.json", "stereographic.cameramodel"):
            ending = formats.FORMATS[name].endings[0] if name in formats.FORMATS else Path(name).suffix
            assert answered(content, "a" + ending + ("#5" if name.startswith("cameras") else "")), name


@settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck), derandomize=True)
@given(st.binary(max_size=300), st.sampled_from(FILES))
def test_any_bytes(content, name):
    answered(content, name)


@settings(max_examples=200, deadline=None, suppress_health_check=list(HealthCheck), derandomize=True)
@given(st.sampled_from(list(SEEDS)), st.integers(0, 2**32), st.integers(1, 4), st.sampled_from(FILES))
def test_files_with_pieces_cut_doubled_and_put_in(seed, dice, times, name):
    content, rng = SEEDS[seed], random.Random(dice)
    for _ in range(times):
        a, b = sorted((rng.randrange(len(content) + 1), rng.randrange(len(content) + 1)))
        b = min(b, a + 40)
        content = rng.choice([
            content[:a], content[:a] + content[b:], content[:b] + content[a:], content[:a] + rng.choice(PARTS) + content[a:],
            content[:a] + rng.choice(PARTS) + content[b:], content[:a] + bytes([rng.randrange(256)]) + content[a + 1 :],
        ])  # fmt: skip
    answered(content, name)
    answered(content, name, rng.choice(list(formats.FORMATS)))


@settings(max_examples=80, deadline=None, suppress_health_check=list(HealthCheck), derandomize=True)
@given(st.sampled_from(["opencv", "opencv_xml", "opencv_json", "ros", "mrcal", "colmap", "opensfm", "matlab", "subtense"]),
       st.floats(), st.integers(0, 30))  # fmt: skip
def test_any_number_in_the_place_of_any(form, value, place):
    words = (
        SEEDS[form]
        .decode()
        .replace("[", "[ ")
        .replace(",", " ,")
        .replace("]", " ]")
        .replace("<", " <")
        .replace(">", "> ")
        .split(" ")
    )
    numbers = [i for i, word in enumerate(words) if word.replace(".", "", 1).replace("-", "").isdigit()]
    words[numbers[place % len(numbers)]] = repr(value)
    answered(" ".join(words).encode(), "a", form)


LONG = 2**20 - 100
OPENINGS = [
    "[", "{a: ", "- ", "(", '"', "'", '"\\"', "a: ", "a:\n ", "<a>", "#", "a ", "a: - ", "a: [", "a: '", 'a: "\\"', "a: |\n ", "a: b\n c",
    " : ", "x: [1, ", "\n", "a: {b: ", "- a: ", '{"a": ', "'a': ", "1 A 1 1 ", "?", "!!", "a: x #'", "!a ",
    "{'lens_model': 'LENSMODEL_PINHOLE', ",
]  # fmt: skip


@pytest.mark.parametrize("opening", OPENINGS)
@pytest.mark.parametrize(
    "before", ["", "<opencv_storage>", "{'lens_model': 'LENSMODEL_PINHOLE', 'a': ", "a: ", "%YAML:1.0\n---\nk: "]
)
def test_a_mebibyte_of_one_thing(before, opening):
    content = (before + opening * (LONG // len(opening)))[:LONG].encode()
    answered(content, "a.yml")


def test_many_keys_are_no_trouble():
    answered("\n".join(f"k{i}: {i}" for i in range(80_000)).encode())
    answered(("{" + ",".join(f'"k{i}":{i}' for i in range(70_000)) + ', "k69999": 1}').encode(), "a.json")
