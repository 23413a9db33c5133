import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from subtense.geometry import Pose, cross_matrix, rotation_from_vector

vectors = st.tuples(*[st.floats(-3, 3)] * 3).map(np.array)


@given(vectors)
def test_rotations_are_rotations_and_keep_their_axis(v):
    r = rotation_from_vector(v)
    assert r @ r.T == pytest.approx(np.eye(3), abs=1e-12)
    assert np.linalg.det(r) == pytest.approx(1)
    assert r @ v == pytest.approx(v, abs=1e-9)


def test_a_quarter_turn_about_z_takes_x_to_y():
    assert rotation_from_vector(np.array([0, 0, np.pi / 2])) @ [1, 0, 0] == pytest.approx([0, 1, 0])


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-5, 1e-4, 1e-3])
def test_small_angles_are_as_exact_as_large_ones(angle):
    assert rotation_from_vector(np.array([0, 0, angle]))[1, 0] == pytest.approx(np.sin(angle), rel=1e-12, abs=1e-300)


@given(vectors, vectors)
def test_cross_matrix(v, w):
    assert cross_matrix(v) @ w == pytest.approx(np.cross(v, w))


@given(vectors, vectors, vectors)
def test_a_pose_and_its_inverse_cancel(v, t, p):
    pose = Pose(rotation_from_vector(v), t)
    assert pose.inverse().apply(pose.apply(p[None])) == pytest.approx(p[None], abs=1e-9)
