import json

import numpy as np
import pytest

from subtense.errors import InputError
from subtense.quantity import Quantity
from subtense.target import Target


def test_square_and_rectangle_have_their_corners_in_reading_order():
    square = Target.parse("square 50 ± 0.2 mm")
    assert square.points_m[:, :2].tolist() == [[-0.025, -0.025], [0.025, -0.025], [0.025, 0.025], [-0.025, 0.025]]
    sheet = Target.parse("rectangle 297 ± 1 mm x 210 ± 1 mm")
    assert np.ptp(sheet.points_m, axis=0) == pytest.approx([0.297, 0.210, 0])
    assert sheet.u_scale == pytest.approx(1 / 1.959964 / 210, rel=1e-4)


@pytest.mark.parametrize("text", ["", "circle 5 mm", "square", "square 5 mm", "rectangle 5 ± 1 mm", "square 0 exact"])
def test_refuses_what_is_no_target(text):
    with pytest.raises(InputError):
        Target.parse(text)


def test_json_round_trip():
    target = Target.square(Quantity.uniform(0.049, 0.051, "m"), "marker")
    assert Target.from_json(json.loads(json.dumps(target.to_json()))).to_json() == target.to_json()


def test_its_size_is_one_part_and_its_shape_another():
    target = Target("a", np.eye(3), u_scale=0.01, sigma_m=0.001)
    assert [part.label for part in target.parts()] == ["size of the a", "shape of the a"]
    grown = target.moved({"scale": np.array([1.1])})
    assert grown.points_m == pytest.approx(1.1 * np.eye(3))
