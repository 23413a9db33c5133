"""What `subtense` exports: a forgotten or an accidental name fails here."""

import subprocess
import sys

import pytest

import subtense

NAMES = [
    "Board",
    "Camera",
    "Document",
    "FileFormatError",
    "GeometryError",
    "InputError",
    "METHODS",
    "Measurement",
    "Method",
    "MissingExtraError",
    "NothingFoundError",
    "Observation",
    "Photo",
    "Quantity",
    "SubtenseError",
    "Target",
    "UnknownCameraError",
    "calculate",
    "calculator_input",
    "calibrate",
    "calibrate_rig",
    "measure_lines",
    "measure_markers",
    "propagate",
    "resolve_camera",
]


def test_the_names_are_these():
    assert sorted(NAMES) == subtense.__all__
    assert set(NAMES) <= set(dir(subtense))
    for name in NAMES:
        assert getattr(subtense, name) is not None


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="nothing"):
        subtense.nothing  # noqa: B018


def test_importing_the_package_loads_nothing_else():
    code = (
        "import sys, subtense; print(sorted(m for m in ('numpy', 'PIL', 'cv2', 'scipy', 'click') if m in sys.modules))"
    )
    assert (
        subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.strip() == "[]"
    )


def test_all_extras_bring_one_opencv_and_no_torch():
    from importlib.metadata import requires

    needed = {
        line.split(";")[0].split(">")[0].split("=")[0].split("<")[0].strip() for line in requires("subtense") or []
    }
    assert {name for name in needed if "opencv" in name} == {"opencv-contrib-python-headless"}
    assert not needed & {"torch", "tensorflow", "torchvision"}
