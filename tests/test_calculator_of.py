import dataclasses

import numpy as np
import pytest

from subtense import Photo, resolve_camera
from subtense.camera import Camera
from subtense.workflow.calculate import calculate
from subtense.workflow.calculator_input import calculator_input
from subtense.workflow.calculator_of import calculator_of


def back(photo, resolved):
    """f_px and its u as the calculator has them from what the photo fills in."""
    texts = calculator_of(photo, resolved)
    assert set(texts) == {"focal", "sensor_width", "image_width"}
    document = calculate(calculator_input({**texts, "size": "1 m exact", "extent": "100 px exact"})[0])
    found = {m.what: m for m in document.measurements}["focal_length_px"]
    return found.value, found.u


@pytest.mark.parametrize("name", ["belt.jpg", "desk.jpg", "facade.jpg", "street.jpg"])
@pytest.mark.parametrize("tagged", [True, False])
def test_gives_back_the_focal_length_of_the_camera_and_its_u(examples, name, tagged):
    photo = Photo.load(examples / name)
    resolved = resolve_camera(photo)
    if not tagged:
        photo = dataclasses.replace(photo, metadata=dataclasses.replace(photo.metadata, focal_mm=None))
    f_px, u = back(photo, resolved)
    assert f_px == pytest.approx(float(resolved.camera.f_px), rel=1e-5)
    assert u == pytest.approx(resolved.camera.u_f_px, rel=0.02)  # three digits, and 1 / sensor width bends


def test_shows_the_focal_length_that_the_photo_tells(examples):
    photo = Photo.load(examples / "street.jpg")
    assert calculator_of(photo, resolve_camera(photo))["focal"] == "24 mm exact"


@pytest.mark.parametrize("cov", [None, np.diag([4.0, 0, 0, 0])])
def test_a_calibrated_camera(examples, cov):
    photo = Photo.load(examples / "desk.jpg")
    resolved = dataclasses.replace(
        resolve_camera(photo), camera=Camera(1600, 1200, 1208.0, 799.5, 599.5, cov=cov)
    )  # fmt: skip
    assert back(photo, resolved) == pytest.approx((1208.0, 0.0 if cov is None else 2.0), rel=1e-3)
