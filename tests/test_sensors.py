"""The table of sensors: every row against itself, and who is found under which name."""

import math
from collections import Counter
from dataclasses import replace

import pytest
from click.testing import CliRunner

from subtense.assumptions import NOMINAL_FOCAL
from subtense.cli import main
from subtense.equivalent import MAKERS_RULE
from subtense.metadata import Metadata
from subtense.presets import find_preset
from subtense.sensors import GROUPS, of_model, search, sensors, single_out

PHONES = [row for row in sensors().values() if row.group == "phone"]
WITH_ALL = [row for row in sensors().values() if row.focal_mm and row.f35_mm]


def is_consistent(row):
    """Whether focal length, equivalent and sensor of a row fit, each within its rounding and nominal u."""
    u = math.hypot(NOMINAL_FOCAL, MAKERS_RULE, row.u, 0.5 / math.sqrt(3) / row.f35_mm)
    return abs(math.log(row.f35_mm / (row.focal_mm * row.crop_factor))) < 2 * u


def names(tags):
    return [row.name for row in single_out(tags, of_model(tags))]


@pytest.mark.parametrize("row", sensors().values(), ids=lambda row: row.name)
def test_a_row_is_whole_and_says_who_prints_it(row):
    assert row.title and row.group in GROUPS
    assert all(word.startswith("https://") for word in row.source.split()) and row.source
    assert 1 < row.width_mm < 60 and 0.2 < row.height_mm / row.width_mm <= 1
    assert 0 < row.u <= 0.04
    pitch = [1000 * side / count for side, count in zip((row.width_mm, row.height_mm), row.native_px, strict=True)]
    assert 0.5 < pitch[0] < 12 and pitch[1] == pytest.approx(pitch[0], rel=0.06)
    assert bool(row.makes) == bool(row.models) == (row.group != "sensor")
    for mode in row.modes:
        assert 0 < mode.native_px <= row.native_px[0] + 8


@pytest.mark.parametrize("row", WITH_ALL, ids=lambda row: row.name)
def test_focal_length_equivalent_and_sensor_of_a_row_fit(row):
    assert is_consistent(row)


def test_a_slip_in_a_row_is_seen():
    row = sensors()["iphone-13-pro-wide"]
    for slip in ({"focal_mm": 7.5}, {"f35_mm": 62.0}, {"width_mm": row.width_mm / 2, "height_mm": row.height_mm / 2}):
        assert not is_consistent(replace(row, **slip))


def test_no_lens_of_a_model_is_there_twice():
    lenses = Counter(
        (make, model, row.focal_mm, row.f35_mm, row.f_number)
        for row in sensors().values() for make in row.makes for model in row.models
    )  # fmt: skip
    assert max(lenses.values()) == 1
    titles = Counter(row.title for row in sensors().values())
    assert max(titles.values()) == 1


def test_there_are_enough_rows_of_each_group():
    counts = Counter(row.group for row in sensors().values())
    assert all(counts[group] >= least for group, least in (("phone", 20), ("drone", 35), ("board", 5), ("sensor", 40)))


@pytest.mark.parametrize(
    ("make", "model", "focal", "f35", "stop", "expected"),
    [
        ("Apple", "iPhone 13 Pro", 5.7, 26, 1.5, ["iphone-13-pro-wide"]),
        ("Apple", "iPhone 13 Pro", 1.57, 13, 1.8, ["iphone-13-pro-ultra-wide"]),
        (
            "Apple",
            "iPhone 13 Pro",
            1.57,
            26,
            1.8,
            ["iphone-13-pro-ultra-wide"],
        ),  # cropped for a close-up: the lens is the same
        ("Apple", "iPhone 13 Pro", 5.7, 52, 1.5, ["iphone-13-pro-wide"]),  # digital zoom
        ("Apple", "iPhone 13 Pro", 9.0, 77, 2.8, []),  # the tele has no row
        ("Apple", "iPhone 13 Pro", 5.7, 13, 1.5, []),  # an equivalent that is too short is of another lens
        ("Apple", "iPhone 14 Pro", 2.22, 14, 2.2, ["iphone-14-pro-ultra-wide"]),
        ("Xiaomi", "Mi 9T Pro", 4.77, 26, 1.75, ["mi-9t-pro-wide"]),
        ("Xiaomi", "Mi 9T Pro", 5.45, 53, 2.4, ["mi-9t-pro-tele"]),
    ],
)
def test_the_lenses_of_a_phone_are_told_apart(make, model, focal, f35, stop, expected):
    tags = Metadata(make=make, model=model, focal_mm=focal, f35_mm=f35, f_number=stop)
    assert names(tags) == expected


@pytest.mark.parametrize("row", [row for row in PHONES if row.f35_mm], ids=lambda row: row.name)
def test_the_equivalent_of_another_lens_never_fits(row):
    """13 mm of a phone are not 26: the model's name alone must not choose."""
    for factor in (0.5, 0.25):
        tags = Metadata(make=row.makes[0], model=row.models[0], focal_mm=row.focal_mm, f35_mm=row.f35_mm * factor)
        assert row.name not in names(tags)


@pytest.mark.parametrize(
    ("make", "model"),
    [("Apple", "iPhone 14 Pro Ma"), ("Apple", "iPhone 1"), ("Apple", "iPhone 14 Pr"), ("Google", "iPhone 14 Pro"), ("DJI", "FC63"),
     ("DJI", "FC6310X"), ("Apple", ""), ("", ""), ("Raspberry Pi", "imx7080"), ("Sony", "imx541"), ("Skydio", "22")],
)  # fmt: skip
def test_a_part_of_a_name_is_no_name(make, model):
    assert of_model(Metadata(make=make or None, model=model or None)) == []


def test_names_are_whole_but_their_case_does_not_matter():
    found = of_model(Metadata(make="APPLE", model="iphone 14 pro"))
    assert [row.name for row in found] == ["iphone-14-pro-wide", "iphone-14-pro-ultra-wide"]
    found = of_model(Metadata(make="Raspberry Pi", model="/base/soc/i2c0mux/i2c@1/imx219@10"))
    assert [row.name for row in found] == ["rpi-camera-v2"]


def test_the_front_camera_has_no_row():
    tags = Metadata(make="Apple", model="iPhone 12", lens="iPhone 12 front camera 2.71mm f/2.2", f_number=1.6)
    assert names(tags) == []


def test_a_sensor_is_a_preset_by_its_name():
    preset = find_preset("IMX541")
    assert preset.sensor_width.value == pytest.approx(4512 * 2.74e-6)
    assert preset.sensor_width.u / preset.sensor_width.value == pytest.approx(sensors()["imx541"].u)


def test_the_command_lists_what_holds_every_word():
    shown = CliRunner().invoke(main, ["sensors", "raspberry", "imx219"]).output.splitlines()
    assert len(shown) == 2 and shown[1].split()[:4] == ["rpi-camera-v2", "3.67", "x", "2.76"]
    assert len(search("pregius")) == 0 and len(search("sony imx54")) == 7
    assert sensors()["rpi-camera-v2"].to_json()["native_px"] == [3280, 2464]
