"""DepthMap: the noun that stereo, learned depth and reconstruction make."""

import numpy as np
import pytest

from subtense.camera import Camera
from subtense.depth_map import DepthMap
from subtense.errors import InputError

CAMERA = Camera(4, 3, 100.0, 1.5, 1.0)


def made(depth_m, sigma_m=0.01, **more):
    depth = np.broadcast_to(np.asarray(depth_m, float), (3, 4))
    sigma = np.broadcast_to(np.asarray(sigma_m, float), (3, 4))
    return DepthMap(depth, sigma, np.zeros((3, 4), bool), CAMERA, "made up", **more)


def test_points_have_the_depth_as_their_third_coordinate_and_project_back():
    depth = np.full((3, 4), 2.0)
    depth[0, 0] = np.nan
    points = made(depth).points_m()
    assert np.isnan(points[0, 0]).all() and not made(depth).answered[0, 0]
    assert points[2, 3] == pytest.approx([0.03, 0.02, 2.0])
    assert CAMERA.project(points[1:2, 1]) == pytest.approx(np.array([[1.0, 1.0]]))


@pytest.mark.parametrize(
    ("depth", "sigma"), [(0.0, 0.1), (-1.0, 0.1), (np.inf, 0.1), (1.0, np.nan), (1.0, -0.1), (1.0, np.inf)]
)
def test_a_depth_without_meaning_or_doubt_is_refused(depth, sigma):
    with pytest.raises(InputError):
        made(depth, sigma)


def test_another_size_than_the_camera_s_is_refused():
    with pytest.raises(InputError, match="depth_m"):
        DepthMap(np.ones((4, 3)), np.ones((4, 3)), np.zeros((4, 3), bool), CAMERA, "made up")


def test_a_common_factor_is_not_negative():
    with pytest.raises(InputError, match="u_scale"):
        made(1.0, u_scale=-0.1)
