"""The camera of the stored picture, taken to the upright one: pixels and rays must go together, and the covariance with them."""

from dataclasses import replace

import numpy as np
import pytest

from subtense.camera import Camera
from subtense.told_camera import upright_camera

W, H = 400, 300
PIXEL = {
    1: lambda x, y: (x, y), 2: lambda x, y: (W - 1 - x, y), 3: lambda x, y: (W - 1 - x, H - 1 - y), 4: lambda x, y: (x, H - 1 - y),
    5: lambda x, y: (y, x), 6: lambda x, y: (H - 1 - y, x), 7: lambda x, y: (H - 1 - y, W - 1 - x), 8: lambda x, y: (y, W - 1 - x),
}  # fmt: skip
"""Where a stored pixel comes to lie, by the words of the EXIF standard on what row 0 and column 0 are."""
SIGNS = {1: (1, 1), 2: (-1, 1), 3: (-1, -1), 4: (1, -1), 5: (1, 1), 6: (-1, 1), 7: (-1, -1), 8: (1, -1)}


def stored():
    rng = np.random.default_rng(3)
    root = rng.normal(size=(9, 9)) * np.array([5, 0.01, 3, 3, 0.01, 0.01, 0.001, 0.001, 0.001])[:, None]
    return Camera(W, H, 350.0, 190.0, 160.0, aspect=1.05, lens="brown_conrady", distortion=np.array([-0.1, 0.03, 0.004, -0.007, 0.01]),
                  cov=root @ root.T)  # fmt: skip


def vector(camera):
    return np.array([camera.f_px, camera.aspect, camera.cx_px, camera.cy_px, *camera.coefficients])


def with_vector(camera, v):
    return replace(camera, f_px=v[0], aspect=v[1], cx_px=v[2], cy_px=v[3], distortion=v[4:])


@pytest.mark.parametrize("turn", range(1, 9))
def test_a_stored_pixel_and_its_upright_one_see_the_same(turn):
    points = np.array([[0.2, 0.1, 1.0], [-0.3, 0.25, 1.0], [0.1, -0.35, 1.0]])
    x, y = stored().project(points).T
    (sx, sy), swapped = SIGNS[turn], turn >= 5
    across, down = (points[:, 1], points[:, 0]) if swapped else (points[:, 0], points[:, 1])
    seen = upright_camera(stored(), turn).project(np.stack([sx * across, sy * down, points[:, 2]], -1))
    assert seen == pytest.approx(np.stack(PIXEL[turn](x, y), -1), abs=1e-9)


@pytest.mark.parametrize("turn", range(1, 9))
def test_the_covariance_goes_along(turn):
    camera = stored()
    middle = vector(camera)
    jacobian = np.empty((9, 9))
    for i in range(9):
        step = np.zeros(9)
        step[i] = 1e-5 * max(abs(middle[i]), 0.1)
        ends = [vector(upright_camera(with_vector(camera, middle + sign * step), turn)) for sign in (1, -1)]
        jacobian[:, i] = (ends[0] - ends[1]) / (2 * step[i])
    expected = jacobian @ camera.cov @ jacobian.T
    scale = np.sqrt(np.diag(expected))
    assert upright_camera(camera, turn).cov / np.outer(scale, scale) == pytest.approx(
        expected / np.outer(scale, scale), abs=1e-6
    )
