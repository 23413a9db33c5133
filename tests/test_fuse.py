"""One number from several measurements of one thing."""

import dataclasses
import json

import numpy as np
import pytest
from click.testing import CliRunner

from subtense import Camera, Observation, Quantity
from subtense.cli import main
from subtense.errors import InputError
from subtense.methods import ground_plane, known_size, same_plane
from subtense.workflow.fuse import fuse

SHARP = Camera(4000, 3000, 3000.0, 1999.5, 1499.5)
LOOSE = dataclasses.replace(SHARP, cov=np.diag([60.0**2, 0, 0, 0]))


def ranged(distance=10.0, size=None, camera=SHARP, sigma=1.0, x=0.0):
    """Seen at places of their own: what reads the same is one observation."""
    size = size or Quantity.normal(0.5, 0.005, "m")
    ends = np.array([[x - 0.25, 0, distance], [x + 0.25, 0, distance]])
    return known_size.METHOD, known_size.Inputs(camera, Observation(camera.project(ends), sigma), size)


def test_independent_readings_average_down():
    found = fuse([ranged(x=x) for x in (-0.3, -0.1, 0.1, 0.3)], "depth")
    assert found.one.value == pytest.approx(10.0)
    assert found.one.u == pytest.approx(found.each[0].u / 2, rel=0.02)
    assert found.weights == pytest.approx([0.25] * 4, abs=0.02)
    assert not found.one.notes or {n.code for n in found.one.notes} <= {"frontal_assumption"}


def test_what_they_share_does_not_average_away():
    """The same camera and the same size: only the clicks average."""
    size = Quantity.normal(0.5, 0.005, "m")
    found = fuse([ranged(size=size, camera=LOOSE, sigma=0.01, x=x) for x in range(9)], "depth")
    assert found.one.u == pytest.approx(found.each[0].u, rel=0.02)
    lines = {c.name: c.share for c in found.one.budget}
    assert lines["focal length"] == pytest.approx(0.8, abs=0.03) and lines["size"] == pytest.approx(0.2, abs=0.03)


def test_the_better_one_weighs_more():
    found = fuse(
        [ranged(size=Quantity.normal(0.5, 0.001, "m")), ranged(size=Quantity.normal(0.5, 0.05, "m"), x=1.0)], "depth"
    )
    assert found.weights[0] > 0.9
    assert found.one.u < min(m.u for m in found.each)


def test_no_weight_is_below_zero():
    """With much in common the least variance would extrapolate beyond both; the mean stays between them."""
    size = Quantity.normal(0.5, 0.025, "m")
    found = fuse(
        [ranged(10.0, size, sigma=0.2), ranged(11.0, dataclasses.replace(size, u=0.025), SHARP, 30.0)], "depth"
    )
    assert min(found.weights) >= 0
    assert 9.9 <= found.one.value <= 11.1


def test_two_that_contradict_each_other_are_told_and_the_interval_holds_both():
    found = fuse([ranged(10.0), ranged(12.0)], "depth", labels=["near", "far"])
    note = next(n for n in found.one.notes if n.code == "methods_disagree")
    assert "near: 10" in note.text and "far: 12" in note.text
    assert found.one.low <= 10 and found.one.high >= 12


def test_one_of_three_that_is_wrong_is_left_out():
    found = fuse([ranged(10.0), ranged(10.05), ranged(13.0)], "depth", labels=["a", "b", "c"])
    assert found.weights[2] == 0
    assert 9.9 < found.one.value < 10.1
    assert any(n.code == "methods_disagree" and n.text.startswith("c ") for n in found.one.notes)


def test_covers_what_is_true():
    """Scenes of three readings that share a camera: the interval holds the truth in 95 of 100, and chi-square is no surprise."""
    rng = np.random.default_rng(5)
    hits = flagged = 0
    for _ in range(150):
        f = 3000.0 + 60 * rng.standard_normal()
        true = dataclasses.replace(SHARP, f_px=f)
        pairs = []
        for u in (0.005, 0.01, 0.02):
            size = 0.5 + u * rng.standard_normal()
            ends = np.array([[-size / 2, 0, 10.0], [size / 2, 0, 10.0]])
            seen = Observation(true.project(ends) + rng.standard_normal((2, 2)), 1.0)
            pairs.append((known_size.METHOD, known_size.Inputs(LOOSE, seen, Quantity.normal(0.5, u, "m"))))
        m = fuse(pairs, "depth").one
        hits += m.low <= 10 <= m.high
        flagged += any(n.code == "methods_disagree" for n in m.notes)
    assert 0.91 <= hits / 150 <= 0.99
    assert flagged / 150 <= 0.04


def test_needs_two_of_the_same_kind():
    with pytest.raises(InputError, match="two or more"):
        fuse([ranged()])
    with pytest.raises(InputError, match="all of them measure"):
        fuse([ranged(), (same_plane.METHOD, same_plane.example())])
    with pytest.raises(InputError, match="speed"):
        fuse([ranged(), ranged()], "speed")


def test_a_person_by_size_and_by_where_they_stand():
    ground = ground_plane.example()
    person = known_size.Inputs(
        ground.camera, Observation(np.array([[900.0, 448.0], [900.0, 670.0]]), 1.0), Quantity.normal(1.75, 0.07, "m")
    )
    by_foot = dataclasses.replace(ground, above=Quantity.exact(0.875, "m"))
    found = fuse([(known_size.METHOD, person), (ground_plane.METHOD, by_foot)])
    assert found.one.what == "range"
    assert found.one.u < min(m.u for m in found.each)


def run(*words):
    return CliRunner().invoke(main, list(words), catch_exceptions=False)


def test_files_of_several_pictures(tmp_path, examples):
    line = ["--line", "120,80,640,80", "--camera", "f=1200 ± 20px", "--tilt", "0 ± 1 deg", "--format", "json"]
    for name, size in (("a", "500 ± 5 mm"), ("b", "505 ± 5 mm")):
        (tmp_path / f"{name}.json").write_text(run("measure", str(examples / "desk.jpg"), *line, "--size", size).output)
    told = run("fuse", str(tmp_path / "a.json"), str(tmp_path / "b.json"), "--format", "json")
    found = json.loads(told.output)["measurements"]
    assert [m["method"] for m in found] == ["fuse", "known_size", "known_size"]
    assert min(m["value"] for m in found[1:]) <= found[0]["value"] <= max(m["value"] for m in found[1:])
    assert found[0]["u"] < min(m["u"] for m in found[1:])
    # the focal length is one doubt in both
    assert next(c["share"] for c in found[0]["budget"] if c["name"] == "focal length") > next(
        c["share"] for c in found[1]["budget"] if c["name"] == "focal length"
    )


def test_bad_files_are_told_in_a_line(tmp_path):
    (tmp_path / "x.json").write_text('{"measurements": []}')
    (tmp_path / "y.json").write_text("[1, 2]")
    for name in ("x.json", "y.json", "none.json"):
        told = run("fuse", str(tmp_path / name), str(tmp_path / name))
        assert told.exit_code != 0 and told.output.startswith("subtense: ") and len(told.output.splitlines()) == 1
    told = run("fuse", str(tmp_path / "x.json"))
    assert told.exit_code != 0 and len(told.output.splitlines()) == 1
