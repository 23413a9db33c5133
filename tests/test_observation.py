import json

import numpy as np
import pytest

from subtense.errors import InputError
from subtense.observation import CLICK_SIGMA_PX, Observation


@pytest.mark.parametrize("text", ["1,2;3,4", "1,2,3,4", "1, 2; 3, 4", " 1 2 3 4 "])
def test_reads_points_as_people_write_them(text):
    assert Observation.parse(text).points_px.tolist() == [[1, 2], [3, 4]]


def test_a_click_is_assumed_and_a_stated_doubt_is_read():
    assert Observation.parse("1,2;3,4").sigma_px == CLICK_SIGMA_PX
    assert Observation.parse("1,2;3,4 ± 0.5px (1s)").sigma_px == 0.5
    assert Observation.parse("1,2;3,4 ± 0.98 px").sigma_px == pytest.approx(0.5, rel=1e-3)


@pytest.mark.parametrize("text", ["", "1,2,3", "a,b", "1,2;3,inf", "1,2;3,4 ± x"])
def test_refuses_what_are_no_points(text):
    with pytest.raises(InputError):
        Observation.parse(text)


@pytest.mark.parametrize(
    "more", [{}, {"sigma_px": np.array([0.1, 0.2])}, {"cov": np.diag([1.0, 2, 3, 4])}, {"label": "a", "id": "b"}]
)
def test_json_round_trip(more):
    seen = Observation(np.array([[1.0, 2], [3, 4]]), **more)
    assert Observation.from_json(json.loads(json.dumps(seen.to_json()))).to_json() == seen.to_json()


def test_impossible_observations_are_refused():
    for points, more in (
        ([[1.0]], {}),
        ([[1, np.nan]], {}),
        ([[1.0, 2]], {"sigma_px": -1}),
        ([[1.0, 2]], {"cov": np.eye(3)}),
    ):
        with pytest.raises(InputError):
            Observation(np.array(points), **more)
