"""Horizon: which way is up in a picture, from its pitch and roll, from its horizon, or from level lines that run side by side.

Directions are in the camera's frame: x right, y down, z forward. Pitch is positive upwards (0 looks at the horizon, -90° straight
down), roll is positive where the camera's right side is down, as in `told_pose`. Everything broadcasts over leading axes.

Source: R. Hartley, A. Zisserman, Multiple View Geometry, 8.6 (vanishing points and lines); the dip of the horizon: N. Bowditch,
The American Practical Navigator (a sphere, and a ray of light as an arc of it).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .arrays import Array

EARTH_RADIUS_M = 6_371_000.0
"""Mean radius of the earth."""


@dataclass(frozen=True, eq=False)
class Level:
    """The level frame of a camera: its axes as unit vectors (..., 3) in the camera's frame.

    Attributes:
        up: away from the centre of the earth.
        right: level, to the right of the picture.
        ahead: level, the way the picture looks; of one that looks straight down, to its upper edge.
    """

    up: Array
    right: Array
    ahead: Array

    @property
    def pitch_rad(self) -> Array:
        """(...) of the optical axis above the horizon."""
        return np.asarray(np.arcsin(np.clip(self.up[..., 2], -1.0, 1.0)))

    @property
    def roll_rad(self) -> Array:
        """(...) right side down."""
        return np.asarray(np.arctan2(self.right[..., 1], self.right[..., 0]) * -1.0)


def effective_radius_m(refraction: Array) -> Array:
    """(...) radius of an earth on which bent rays are straight: R / (1 - k), at most a thousand R."""
    return np.asarray(EARTH_RADIUS_M / np.maximum(1 - np.asarray(refraction), 1e-3))


def dip_rad(height_m: Array, refraction: Array) -> Array:
    """(...) how far the visible horizon of a smooth earth lies below the level, from a height above it; 0 from the ground."""
    return np.asarray(np.sqrt(2 * np.maximum(height_m, 0.0) / effective_radius_m(refraction)))


def level_from_angles(pitch_rad: Array, roll_rad: Array) -> Level:
    """The level frame of a camera of known pitch and roll (...)."""
    pitch, roll = np.broadcast_arrays(np.asarray(pitch_rad, float), np.asarray(roll_rad, float))
    cos_p, sin_p, cos_r, sin_r = np.cos(pitch), np.sin(pitch), np.cos(roll), np.sin(roll)
    up = np.stack([-sin_r * cos_p, -cos_r * cos_p, sin_p], -1)
    right = np.stack([cos_r, -sin_r, np.zeros_like(cos_r)], -1)
    return Level(up, right, np.cross(up, right))


def level_from_up(up: Array) -> Level:
    """The level frame from the upward direction (..., 3), of any length; turned so that it points to the picture's upper edge."""
    with np.errstate(invalid="ignore", divide="ignore"):
        up = up / np.sqrt(np.sum(up * up, -1))[..., None]
        up = np.where(up[..., 1:2] > 0, -up, up)
        across = np.hypot(up[..., 0], up[..., 1])
        right = np.stack([-up[..., 1] / across, up[..., 0] / across, np.zeros_like(across)], -1)
    return Level(up, right, np.cross(up, right))


def level_from_horizon(rays: Array, dip: Array, roll_rad: Array | None = None) -> Level:
    """The level frame from directions to the horizon.

    All of them lie `dip` below the level: up . ray = -sin(dip). Of more than two the least squares are taken.

    Args:
        rays: (..., N, 3) unit vectors; one, where the roll is known, or more.
        dip: (...) of what was seen, rad; 0 for a vanishing line.
        roll_rad: (...) needed where there is one direction only.
    """
    sine = np.sin(np.asarray(dip, float))
    if rays.shape[-2] == 1:
        assert roll_rad is not None
        return level_from_angles(_pitch_through(rays[..., 0, :], sine, roll_rad), roll_rad)
    sums = np.swapaxes(rays, -1, -2) @ rays
    values, vectors = np.linalg.eigh(np.nan_to_num(sums))
    normal, within = vectors[..., :, 0], vectors[..., :, 1:]
    normal = np.where(normal[..., 1:2] > 0, -normal, normal)
    with np.errstate(invalid="ignore", divide="ignore"):
        along = np.sum(rays @ within, axis=-2) / values[..., 1:]
        lean = -sine[..., None] * along
    rest = np.sqrt(np.clip(1 - np.sum(lean**2, -1), 0.0, None))
    up = rest[..., None] * normal + (within @ lean[..., None])[..., 0]
    finite = np.asarray(np.isfinite(sums).all(axis=(-1, -2)))
    return level_from_up(np.where(finite[..., None], up, np.nan))


def level_from_parallels(rays: Array, roll_rad: Array | None = None) -> Level:
    """The level frame from level lines, in pairs that run side by side, each by two of its points.

    Two lines that are parallel in the world meet in their vanishing point, which lies on the horizon if they are level. Two such
    points in different directions make the horizon; one does where the roll is known.

    Args:
        rays: (..., 4 or 8, 3) unit vectors: two points of a line, two of its parallel, and the same of another pair.
        roll_rad: (...) needed where there is one pair only.
    """
    planes = np.cross(rays[..., 0::2, :], rays[..., 1::2, :])
    meets = np.cross(planes[..., 0::2, :], planes[..., 1::2, :])
    if meets.shape[-2] == 1:
        assert roll_rad is not None
        point = meets[..., 0, :]
        with np.errstate(invalid="ignore", divide="ignore"):
            point = point / np.sqrt(np.sum(point * point, -1))[..., None]
        return level_from_angles(_pitch_through(point, np.zeros(()), roll_rad), roll_rad)
    return level_from_up(np.cross(meets[..., 0, :], meets[..., 1, :]))


def _pitch_through(ray: Array, sine: Array, roll_rad: Array) -> Array:
    """(...) pitch of a camera of known roll that sees a direction (..., 3) `asin(sine)` below the level.

    up . ray = z sin(p) - (x sin(r) + y cos(r)) cos(p) = -sine.
    """
    ray = np.where(ray[..., 2:] < 0, -ray, ray) if not np.any(sine) else ray
    down = ray[..., 0] * np.sin(roll_rad) + ray[..., 1] * np.cos(roll_rad)
    length = np.hypot(ray[..., 2], down)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.arctan2(down, ray[..., 2]) - np.arcsin(sine / length))
