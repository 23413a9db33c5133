"""Told pose: how the camera stood, as far as its file tells: pitch and roll, the heading, the height above the start.

Frames: the level frame has its origin in the camera, z up, and y horizontal in the direction the picture looks, so x is to the right and
level. The camera frame is x right, y down, z forward, of the upright picture. Pitch is positive upwards: 0 looks at the horizon, -90°
straight down; roll is positive where the camera's right side is down. The heading is in the level frame's definition and has no u.

Source: DJI's drone-dji namespace (gimbal angles: pitch -90 is nadir, roll 0 is level); Pix4D (Camera:Pitch: 0 is nadir, 90 forward);
Google's GPano; ExifTool's documentation of Apple's AccelerationVector (seen from the front of the phone, x to its left, y to its
bottom, z into its face: what holds the phone, so the opposite of gravity is what it points to).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from .arrays import Array
from .geometry import Pose
from .metadata import Metadata, number
from .photo import Photo

GIMBAL_U_RAD = math.radians(0.5)
"""Standard deviation of a gimbal's pitch and roll to the horizon; its own reading is finer than its horizon."""
DRONE_U_RAD = math.radians(2.0)
"""Of a camera without a gimbal, by the drone's own attitude."""
PHONE_U_RAD = math.radians(1.0)
"""Of an accelerometer in a hand."""
PANORAMA_U_RAD = math.radians(2.0)
HEIGHT_U_M = 1.0
"""Of a barometer's height above the start, beside its share."""
HEIGHT_SHARE = 0.01
_TURNS = {1: 0, 2: 0, 3: 2, 4: 2, 5: 3, 6: 1, 7: 1, 8: 3}
FRAME = "camera from level: level is x right, y ahead, z up; pitch is up, roll is right side down"


@dataclass(frozen=True)
class ToldPose:
    """How the camera stood.

    Attributes:
        pitch_rad: of the optical axis above the horizon.
        roll_rad: right side down, of the upright picture.
        u_rad: standard deviation of both.
        source: the tags.
        height_m: above the place of the start, not above the ground; None where it is not told.
    """

    pitch_rad: float
    roll_rad: float
    u_rad: float
    source: str
    height_m: float | None = None

    @property
    def camera_from_level(self) -> Pose:
        """With the covariance of pitch and roll; the translation is 0 by definition."""
        turn = _about_z(-self.roll_rad)
        rotation = turn @ _about_x(-self.pitch_rad) @ np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
        axes = turn @ np.array([[1.0, 0], [0, 0], [0, 1]])
        cov = np.zeros((6, 6))
        cov[:3, :3] = self.u_rad**2 * axes @ axes.T
        return Pose(rotation, np.zeros(3), cov)

    @property
    def u_height_m(self) -> float | None:
        """Standard deviation of the height above the start."""
        return None if self.height_m is None else math.hypot(HEIGHT_U_M, HEIGHT_SHARE * self.height_m)

    def to_json(self) -> dict[str, Any]:
        """Angles in rad, the frame in words, the pose as a matrix and its covariance."""
        pose = self.camera_from_level
        assert pose.cov is not None
        return {
            "pitch_rad": self.pitch_rad, "roll_rad": self.roll_rad, "u_rad": self.u_rad, "source": self.source, "frame": FRAME,
            "height_above_start_m": self.height_m, "u_height_m": self.u_height_m,
            "camera_from_level": pose.rotation.tolist(), "cov": pose.cov.tolist(),
        }  # fmt: skip


def told_pose(photo: Photo) -> ToldPose | None:
    """The pose that the file tells; None where it tells none that is sane."""
    for read in (_dji, _parrot, _pix4d, _gpano, _apple):
        found = read(photo.metadata)
        if found is not None and abs(found.pitch_rad) <= math.radians(120):
            return found
    return None


def _angles(tags: Metadata, pitch: str, roll: str) -> tuple[float, float] | None:
    up, right = number(tags.xmp.get(pitch)), number(tags.xmp.get(roll))
    return None if up is None else (up, right or 0.0)


def _dji(tags: Metadata) -> ToldPose | None:
    found = _angles(tags, "drone-dji:GimbalPitchDegree", "drone-dji:GimbalRollDegree")
    if found is None:
        return None
    height = number(tags.xmp.get("drone-dji:RelativeAltitude"))
    return _told(found, tags, GIMBAL_U_RAD, "XMP drone-dji: gimbal angles", height)


def _parrot(tags: Metadata) -> ToldPose | None:
    found = _angles(tags, "drone-parrot:CameraPitchDegree", "drone-parrot:CameraRollDegree")
    return None if found is None else _told(found, tags, GIMBAL_U_RAD, "XMP drone-parrot: camera angles")


def _pix4d(tags: Metadata) -> ToldPose | None:
    # others write into this namespace too and count from the horizon: it must come with a calibration, or from who keeps to it
    keeps = "Camera:PrincipalPoint" in tags.xmp or (tags.make or "").lower() in ("parrot", "sensefly", "micasense")
    found = _angles(tags, "Camera:Pitch", "Camera:Roll")
    if found is None or not keeps or not -30 <= found[0] <= 120:
        return None
    return _told((found[0] - 90, found[1]), tags, DRONE_U_RAD, "XMP Camera: attitude")


def _gpano(tags: Metadata) -> ToldPose | None:
    found = _angles(tags, "GPano:PosePitchDegrees", "GPano:PoseRollDegrees")
    return None if found is None else _told(found, tags, PANORAMA_U_RAD, "XMP GPano: pose")


def _told(
    degrees: tuple[float, float], tags: Metadata, u_rad: float, source: str, height_m: float | None = None
) -> ToldPose:
    """Roll of the upright picture. Where the camera hung on its side, some writers count that into the roll: the nearer to level counts."""
    pitch, roll = (math.radians(angle) for angle in degrees)
    turned = roll - math.pi / 2 * _TURNS[tags.orientation]
    upright = min((_wrapped(roll), _wrapped(turned)), key=abs)
    return ToldPose(pitch, upright, u_rad, source, height_m)


def _wrapped(angle_rad: float) -> float:
    return math.remainder(angle_rad, 2 * math.pi)


def _apple(tags: Metadata) -> ToldPose | None:
    """From what holds the phone: its direction is up.

    The sensor's picture (orientation 1) has its top where the phone's left or right side is: held with the home button at the right the
    picture is upright, and the phone's own right side points up.
    """
    if tags.gravity_g is None or tags.orientation not in (1, 3, 6, 8) or "front" in (tags.lens or "").lower():
        return None
    left, bottom, into_face = tags.gravity_g
    # the stored picture's axes: x to the phone's top or bottom, y down, z out of its back
    stored_up = np.array([bottom, left, into_face]) / math.sqrt(left**2 + bottom**2 + into_face**2)
    up = _quarter_turns(stored_up, _TURNS[tags.orientation])
    pitch = math.asin(max(-1.0, min(1.0, float(up[2]))))
    roll = math.atan2(-float(up[0]), -float(up[1]))
    return ToldPose(pitch, roll, PHONE_U_RAD, "Apple's acceleration vector")


def _quarter_turns(vector: Array, turns: int) -> Array:
    """A vector of the stored picture's camera frame in that of the picture turned clockwise by quarter turns."""
    x, y, z = vector
    return np.array([(x, y, z), (-y, x, z), (-x, -y, z), (y, -x, z)][turns])


def _about_x(angle_rad: float) -> Array:
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    return np.array([[1.0, 0, 0], [0, c, -s], [0, s, c]])


def _about_z(angle_rad: float) -> Array:
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])
