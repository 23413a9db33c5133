"""Pure array mathematics: rotations, poses, and where a segment of known length stands.

Nothing here knows cameras, pixels or doubt; everything broadcasts over leading axes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .arrays import Array


@dataclass(frozen=True, eq=False)
class Pose:
    """A rigid transform a_from_b: point_a = rotation @ point_b + translation.

    Attributes:
        rotation: (..., 3, 3).
        translation_m: (..., 3).
        cov: (6, 6) of (rotation vector rad, translation m), perturbed on the left; None if unknown.
    """

    rotation: Array
    translation_m: Array
    cov: Array | None = None

    def apply(self, points_m: Array) -> Array:
        """(..., N, 3) points of frame b in frame a."""
        return np.asarray(points_m @ np.swapaxes(self.rotation, -1, -2) + self.translation_m[..., None, :])

    def inverse(self) -> Pose:
        """b_from_a, without covariance."""
        back = np.swapaxes(self.rotation, -1, -2)
        return Pose(back, -(back @ self.translation_m[..., None])[..., 0])


def rotation_from_vector(vector_rad: Array) -> Array:
    """(..., 3) rotation vectors to (..., 3, 3) matrices (Rodrigues)."""
    v = np.asarray(vector_rad, float)
    angle2 = np.sum(v * v, -1)
    small = angle2 < 1e-8
    safe = np.where(small, 1.0, angle2)
    angle = np.sqrt(safe)
    a = np.where(small, 1 - angle2 / 6, np.sin(angle) / angle)
    b = np.where(small, 0.5 - angle2 / 24, (1 - np.cos(angle)) / safe)
    cross = cross_matrix(v)
    return np.asarray(np.eye(3) + a[..., None, None] * cross + b[..., None, None] * (cross @ cross))


def cross_matrix(v: Array) -> Array:
    """(..., 3) to (..., 3, 3) with cross_matrix(v) @ w = v x w."""
    x, y, z = v[..., 0], v[..., 1], v[..., 2]
    o = np.zeros_like(x)
    rows = [np.stack(r, -1) for r in ((o, -z, y), (z, o, -x), (-y, x, o))]
    return np.stack(rows, -2)


def segment_depth(ax: Array, ay: Array, bx: Array, by: Array, length: Array, tilt_rad: Array) -> tuple[Array, Array]:
    """Depth of the middle of a segment of known length that is seen between two directions.

    With end slopes m1, m2 (x/z, y/z), a = m2 - m1 and b = (m1 + m2) / 2, the end points are z1 (m1, 1) and
    z2 (m2, 1) with z2 - z1 = d = L sin(tilt), and |Z a + d b| = L cos(tilt), a quadratic in the middle's depth Z.
    Without tilt Z = L / |a|: the classical relation.

    Args:
        ax: (...) slope of end 2 less end 1, x.
        ay: (...) the same, y.
        bx: (...) mean slope, x.
        by: (...) mean slope, y.
        length: (...) the segment's length.
        tilt_rad: (...) angle of the segment to the image plane, positive where end 2 is farther.

    Returns:
        Depth (unit of `length`) and the half difference of the ends' depths; NaN where no place fits.
    """
    a2 = ax * ax + ay * ay
    with np.errstate(divide="ignore", invalid="ignore"):
        if not np.any(tilt_rad):
            return length / np.sqrt(a2), np.zeros(())
        step = length * np.sin(tilt_rad)
        across = length * np.cos(tilt_rad)
        ab = step * (ax * bx + ay * by)
        inner = ab * ab - a2 * (step * step * (bx * bx + by * by) - across * across)
        return (np.sqrt(inner) - ab) / a2, step / 2
