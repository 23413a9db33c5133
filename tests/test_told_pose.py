import math
import struct

import numpy as np
import pytest
from click.testing import CliRunner
from written_photos import packet, write

from subtense.cli import main
from subtense.photo import Photo
from subtense.told_pose import told_pose
from subtense.workflow.resolve_camera import resolve_camera


@pytest.fixture
def pose(tmp_path):
    def make(xmp=None, **more):
        return told_pose(Photo.load(write(tmp_path / "a.jpg", xmp=xmp, **more)))

    return make


def apple(left, bottom, into_face):
    """Apple's maker note with an acceleration vector only."""
    values = b"".join(struct.pack(">ll", round(v * 10_000), 10_000) for v in (left, bottom, into_face))
    return b"Apple iOS\0\0\x01MM" + struct.pack(">HHHLLL", 1, 8, 10, 3, 32, 0) + values


@pytest.mark.parametrize(
    ("xmp", "pitch", "roll"),
    [
        (packet(drone_dji_GimbalPitchDegree="-89.90", drone_dji_GimbalRollDegree="+1.00"), -89.9, 1),
        (packet(drone_parrot_CameraPitchDegree="-30.5"), -30.5, 0),
        (packet(Camera_Pitch="60", Camera_Roll="2", Camera_PrincipalPoint="2,1"), -30, 2),
        (packet(GPano_PosePitchDegrees="5", GPano_PoseRollDegrees="-3"), 5, -3),
        (packet(Camera_Pitch="-90"), None, None),  # of whom, and from where?
        (packet(drone_dji_GimbalPitchDegree="nonsense"), None, None),
        (packet(drone_dji_GimbalPitchDegree="9999"), None, None),
        (None, None, None),
    ],
)
def test_pitch_and_roll_by_every_maker(pose, xmp, pitch, roll):
    found = pose(xmp)
    if pitch is None:
        assert found is None
    else:
        assert (math.degrees(found.pitch_rad), math.degrees(found.roll_rad)) == pytest.approx((pitch, roll))
        assert found.u_rad > 0


def test_the_height_is_above_the_start(pose):
    found = pose(packet(drone_dji_GimbalPitchDegree="-90", drone_dji_RelativeAltitude="+39.90"))
    assert found.height_m == pytest.approx(39.9)
    assert found.u_height_m > 1


@pytest.mark.parametrize(("roll", "turn"), [(90, 6), (-90, 8), (0, 6), (180, 3)])
def test_a_camera_hung_on_its_side_is_level_in_the_upright_picture(pose, roll, turn):
    found = pose(packet(drone_dji_GimbalPitchDegree="-10", drone_dji_GimbalRollDegree=roll), turn=turn)
    assert found.roll_rad == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize(
    ("vector", "turn", "pitch", "roll"),
    [
        ((-1, 0, 0), 1, 0, 0),  # home button at the right: the phone's right side is up
        ((1, 0, 0), 3, 0, 0),
        ((0, -1, 0), 6, 0, 0),  # upright
        ((0, 1, 0), 8, 0, 0),
        ((0, -0.8660254, -0.5), 6, -30, 0),  # the face looks up, the back down
        ((-0.9396926, -0.3420201, 0), 1, 0, 20),
        ((0, 0, -1), 6, -90, None),
    ],
)
def test_apples_acceleration_points_up(pose, vector, turn, pitch, roll):
    found = pose(make="Apple", note=apple(*vector), turn=turn)
    assert math.degrees(found.pitch_rad) == pytest.approx(pitch, abs=0.01)
    if roll is not None:
        assert math.degrees(found.roll_rad) == pytest.approx(roll, abs=0.01)


@pytest.mark.parametrize("vector", [(3, 0, 0), (0, 0, 0)])
def test_a_shaken_phone_tells_nothing(pose, vector):
    assert pose(make="Apple", note=apple(*vector)) is None


@pytest.mark.parametrize(("pitch", "roll"), [(0, 0), (-30, 0), (-89.9, 0), (10, 15), (-60, -20)])
def test_the_pose_takes_the_level_frame_to_the_cameras(pose, pitch, roll):
    """Where the horizon straight ahead, the zenith and the right come to lie, from the words of the definition."""
    found = pose(packet(drone_dji_GimbalPitchDegree=pitch, drone_dji_GimbalRollDegree=roll))
    rotation = found.camera_from_level.rotation
    assert rotation @ rotation.T == pytest.approx(np.eye(3), abs=1e-12)
    assert np.linalg.det(rotation) == pytest.approx(1)
    axis, right_side = rotation.T @ [0, 0, 1], rotation.T @ [1, 0, 0]
    assert axis == pytest.approx([0, math.cos(math.radians(pitch)), math.sin(math.radians(pitch))], abs=1e-12)
    assert right_side[2] == pytest.approx(
        -math.sin(math.radians(roll)) * math.cos(math.radians(pitch))
    )  # down with a positive roll


def test_the_covariance_is_that_of_pitch_and_roll(pose):
    """Perturbed on the left: moving pitch or roll by their u moves the rotation within it, and heading has none."""
    from subtense.told_pose import ToldPose

    found = pose(packet(drone_dji_GimbalPitchDegree="-40", drone_dji_GimbalRollDegree="10"))
    cov = np.zeros((3, 3))
    for step in ((found.u_rad, 0), (0, found.u_rad)):
        moved = ToldPose(found.pitch_rad + step[0], found.roll_rad + step[1], found.u_rad, "").camera_from_level
        turn = moved.rotation @ found.camera_from_level.rotation.T
        vector = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]) / 2
        cov += np.outer(vector, vector)
    assert found.camera_from_level.cov[:3, :3] == pytest.approx(cov, rel=1e-3, abs=1e-9)


def test_the_pose_is_shown_beside_the_camera(tmp_path):
    path = write(
        tmp_path / "a.jpg", xmp=packet(drone_dji_GimbalPitchDegree="-89.9", drone_dji_RelativeAltitude="40"), f35=24
    )
    shown = CliRunner().invoke(main, ["camera", str(path)], catch_exceptions=False).output
    assert "pose: pitch -89.9°" in shown and "40.0 m" in shown
    assert resolve_camera(Photo.load(path)).to_json()["pose"]["height_above_start_m"] == 40
