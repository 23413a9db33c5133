"""A rendered room for the two cameras of any rig: a wall, a floor, a slanted board, a crate and a ball, with exact depth."""

import numpy as np

from subtense.camera import Camera
from subtense.geometry import Pose, rotation_from_vector
from subtense.quantity import Quantity
from subtense.rig import Rig

WALL_M, FLOOR_M = 4.0, 0.9
BALL = (np.array([0.55, 0.1, 2.4]), 0.35)
CRATE = (np.array([-0.95, 0.25, 2.6]), np.array([-0.35, 0.9, 3.1]))
BOARD = (np.array([0.05, -0.5, 3.2]), np.array([0.5, 0.0, -0.86]))
"""A point and the normal of a board that is slanted by 30 degrees, 0.9 m wide."""


def rectified_rig(width=480, height=320, f=460.0, baseline=0.12, u=0.0):
    """Two pinhole cameras side by side."""
    camera = Camera(width, height, f, (width - 1) / 2, (height - 1) / 2, cov=np.diag([(u * f) ** 2, 0, 0, 0]))
    return Rig.of_rectified(
        camera, Quantity.normal(baseline, u * baseline, "m", "stated"), Quantity.normal(0.0, 50 * u, "px", "stated")
    )


def turned_rig(width=480, height=320):
    """Two cameras with lens distortion, turned towards each other and of unlike focal lengths."""
    k = np.array([-0.12, 0.03, 0.0005, -0.0004, 0.0])
    left = Camera(width, height, 440.0, 236.0, 163.0, 1.001, "brown_conrady", k)
    right = Camera(width, height, 446.0, 243.0, 157.0, 0.999, "brown_conrady", k * 1.1)
    turn = rotation_from_vector(np.array([0.012, -0.05, 0.02]))
    return Rig(left, right, Pose(turn, turn @ np.array([-0.13, 0.004, -0.006])), np.zeros((24, 24)))


def _noise(u, v, seed):
    """Smooth noise of several octaves, 0 to 1."""
    total, weight = np.zeros_like(u), 0.0
    for octave in range(5):
        rng = np.random.default_rng(seed + octave)
        table = rng.random((64, 64))
        x, y = u * 5 * 2**octave, v * 5 * 2**octave
        i, j = np.floor(x).astype(int), np.floor(y).astype(int)
        a, b = x - i, y - j
        a, b = a * a * (3 - 2 * a), b * b * (3 - 2 * b)
        corner = [[table[(j + q) % 64, (i + p) % 64] for p in (0, 1)] for q in (0, 1)]
        value = (corner[0][0] * (1 - a) + corner[0][1] * a) * (1 - b) + (corner[1][0] * (1 - a) + corner[1][1] * a) * b
        total += value * 0.75**octave
        weight += 0.75**octave
    return total / weight


def _hits(origin, ways):
    """For each ray the distance along it and the brightness of what it meets first."""
    best, shade = np.full(len(ways), np.inf), np.zeros(len(ways))

    def take(t, inside, brightness):
        nearer = inside & (t > 0) & (t < best)
        best[nearer], shade[nearer] = t[nearer], brightness[nearer]

    with np.errstate(divide="ignore", invalid="ignore"):
        t = (WALL_M - origin[2]) / ways[:, 2]
        p = origin + t[:, None] * ways
        take(t, np.isfinite(t), 0.25 + 0.6 * _noise(p[:, 0], p[:, 1], 1))
        t = (FLOOR_M - origin[1]) / ways[:, 1]
        p = origin + t[:, None] * ways
        take(t, np.isfinite(t) & (p[:, 2] < WALL_M), 0.1 + 0.7 * _noise(p[:, 0], p[:, 2], 11))
        point, normal = BOARD
        t = ((point - origin) @ normal) / (ways @ normal)
        p = origin + t[:, None] * ways - point
        along = p @ np.array([0.86, 0.0, 0.5])
        take(t, (abs(along) < 0.45) & (abs(p[:, 1]) < 0.45), 0.2 + 0.75 * _noise(along * 1.3 + 3, p[:, 1] * 1.3, 21))
        centre, radius = BALL
        b = ways @ (origin - centre)
        root = b * b - (np.sum((origin - centre) ** 2) - radius**2)
        t = -b - np.sqrt(np.where(root > 0, root, np.nan))
        p = (origin + t[:, None] * ways - centre) / radius
        around = np.arctan2(p[:, 0], -p[:, 2])
        take(t, np.isfinite(t), 0.15 + 0.8 * _noise(around + 5, np.arcsin(np.clip(p[:, 1], -1, 1)), 31))
        low, high = CRATE
        first, second = (low - origin) / ways, (high - origin) / ways
        t = np.max(np.minimum(first, second), 1)
        p = origin + t[:, None] * ways
        inside = t < np.min(np.maximum(first, second), 1)
        take(t, inside, 0.1 + 0.85 * _noise(p[:, 0] + p[:, 2] + 7, p[:, 1] + 0.3 * p[:, 2], 41))
    return best, shade


def _seen(camera, turn, origin, samples):
    """Gray levels and depth of a camera's pixels; `turn` takes the world's axes to the camera's."""
    x, y = np.meshgrid(np.arange(camera.width_px, dtype=float), np.arange(camera.height_px, dtype=float))
    steps = (np.arange(samples) + 0.5) / samples - 0.5
    total = np.zeros(x.size)
    for a in steps:
        for b in steps:
            rays = camera.rays(np.stack([x.ravel() + a, y.ravel() + b], -1))
            total += _hits(origin, rays @ turn)[1]
    rays = camera.rays(np.stack([x.ravel(), y.ravel()], -1))
    far, _ = _hits(origin, rays @ turn)
    return (total / samples**2).reshape(x.shape), (far * rays[:, 2]).reshape(x.shape)


def render(rig, samples=2, noise=1.5, seed=0):
    """Left and right picture (height, width, 3) uint8, and the left one's depth, m."""
    pose = rig.right_from_left
    left, depth = _seen(rig.left, np.eye(3), np.zeros(3), samples)
    right, _ = _seen(rig.right, pose.rotation, -(pose.rotation.T @ pose.translation_m), samples)
    rng = np.random.default_rng(seed)
    pictures = []
    for light in (left, right):
        gray = 255 * np.clip(light, 0, 1) ** (1 / 2.2) + rng.normal(0, noise, light.shape)
        pictures.append(np.repeat(np.clip(np.rint(gray), 0, 255).astype(np.uint8)[..., None], 3, 2))
    return pictures[0], pictures[1], depth
