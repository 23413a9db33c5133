"""Rendered pictures of a corner of a room, textured walls and floor with a marker and an A4 sheet on them, with exact truth."""

import numpy as np

from subtense.geometry import rotation_from_vector

WIDTH, HEIGHT, F = 640, 480, 600.0
SIZE = 3.0  # m, of each plane
PX_PER_M = 300
MARKER_M, MARKER_AT = 0.3, (1.0, 1.1)
TAKEN = (
    (0.9, -1.3, 0.5),
    (1.3, -1.35, 0.35),
    (1.75, -1.4, 0.3),
    (2.2, -1.25, 0.45),
    (1.5, -1.8, 0.4),
    (1.1, -1.6, 0.2),
)


def _texture(rng, n):
    """Blobs of all sizes, so that features are found near and far."""
    import cv2

    out = np.zeros((n, n), np.float32)
    for cell, weight in ((4, 0.6), (9, 0.8), (20, 1.0), (50, 1.0), (130, 0.8)):
        coarse = rng.standard_normal((n // cell + 2, n // cell + 2)).astype(np.float32)
        out += weight * cv2.resize(coarse, (n, n), interpolation=cv2.INTER_CUBIC)
    return np.clip(128 + 45 * out, 5, 250)


def planes(seed=0):
    """Three planes: (3, 3) of origin, first and second axis (m), and the picture on each."""
    import cv2

    rng = np.random.default_rng(seed)
    n = round(SIZE * PX_PER_M)
    pictures = [_texture(rng, n) for _ in range(3)]
    side = round(MARKER_M * PX_PER_M)
    marker = cv2.aruco.generateImageMarker(cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50), 7, side)
    quiet = side // 5
    x, y = (round(v * PX_PER_M) for v in MARKER_AT)
    pictures[0][y - quiet : y + side + quiet, x - quiet : x + side + quiet] = 240
    pictures[0][y : y + side, x : x + side] = np.where(marker > 127, 240, 15)
    corner = np.array([0.0, -SIZE, SIZE])  # x right, y down, z forward; the back wall is at z = SIZE
    return [
        (np.array([corner, [1, 0, 0], [0, 1, 0]]), pictures[0]),
        (np.array([[0, -SIZE, 0], [0, 0, 1], [0, 1, 0]]), pictures[1]),
        (np.array([[0, 0, 0], [1, 0, 0], [0, 0, 1]]), pictures[2]),
    ]  # fmt: skip


def poses(taken=TAKEN, look=(1.3, -1.2, 3.0)):
    """(V, 3, 3) camera_from_world and (V, 3) centres, all looking at about one place."""
    centre = np.array(taken, float)
    turns = []
    for i, place in enumerate(centre):
        z = np.array(look) + 0.1 * np.array([np.sin(i), np.cos(2 * i), 0]) - place
        z = z / np.linalg.norm(z)
        x = np.cross([0, 1.0, 0], z)
        x = x / np.linalg.norm(x)
        turns.append(rotation_from_vector(np.array([0, 0, 0.03 * i])) @ np.stack([x, np.cross(z, x), z]))
    return np.array(turns), centre


def matrix():
    return np.array([[F, 0, (WIDTH - 1) / 2], [0, F, (HEIGHT - 1) / 2], [0, 0, 1]])


def render(rotation, centre, drawn, rng, *, supersample=2, noise=2.0):
    """A picture (H, W) of the planes, blurred by the pixels' area, with noise."""
    import cv2

    k = np.diag([supersample, supersample, 1.0]) @ matrix()
    k[:2, 2] += (supersample - 1) / 2
    size = (WIDTH * supersample, HEIGHT * supersample)
    out, nearest = np.full(size[::-1], 30, np.float32), np.full(size[::-1], np.inf, np.float32)
    u, v = np.meshgrid(np.arange(size[0]), np.arange(size[1]))
    rays = np.stack([(u - k[0, 2]) / k[0, 0], (v - k[1, 2]) / k[1, 1], np.ones_like(u)], -1)
    for frame, picture in drawn:
        origin, a, b = frame
        normal = rotation @ np.cross(a, b)
        with np.errstate(divide="ignore", invalid="ignore"):
            depth = normal @ (rotation @ (origin - centre)) / (rays @ normal)
        to_pixels = (
            k @ rotation @ np.column_stack([a / PX_PER_M, b / PX_PER_M, origin + (a + b) * 0.5 / PX_PER_M - centre])
        )
        warped = cv2.warpPerspective(picture, to_pixels, size, flags=cv2.INTER_LINEAR, borderValue=-1)
        mine = (warped >= 0) & (depth > 0.05) & (depth < nearest)
        out[mine], nearest[mine] = warped[mine], depth[mine]
    small = cv2.resize(out, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA)
    return np.clip(np.round(small + rng.normal(0, noise, small.shape)), 0, 255).astype(np.uint8)


def write(folder, taken=TAKEN, *, look=(1.3, -1.2, 3.0), seed=0):
    """Pictures 0.png, 1.png, ... in a folder; the rotations and centres."""
    import cv2

    rng, drawn = np.random.default_rng(seed + 1), planes(seed)
    rotation, centre = poses(taken, look)
    folder.mkdir(parents=True, exist_ok=True)
    for i in range(len(centre)):
        cv2.imwrite(str(folder / f"{i}.png"), render(rotation[i], centre[i], drawn, rng))
    return rotation, centre


def marker_corners():
    """(4, 3) of the marker's black square."""
    x, y = MARKER_AT
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * MARKER_M + [x, y]
    return np.column_stack([square[:, 0], square[:, 1] - SIZE, np.full(4, SIZE)])


def seen(rotation, centre, point):
    """Pixel of a point of the world."""
    own = rotation @ (point - centre)
    return (matrix() @ (own / own[2]))[:2]
