"""Faces in a picture: where they are, 468 points of each, and both eyes with lids and iris.

A detector (BlazeFace) looks at the whole picture and at tiles of it; each face is then looked at upright and close by the mesh,
which is turned and centred by its own points until it rests. The mesh's network has operations of its maker's own between
its parts: they cut a window around each eye out of its features. The parts are run by the engine, the window is cut here.

Source: V. Bazarevsky et al., BlazeFace, 2019; Y. Kartynnik et al., Real-time Facial Surface Geometry from Monocular Video on
Mobile GPUs, 2019; I. Grishchenko et al., Attention Mesh, 2020. The places of the windows are in the network's file.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

from ..arrays import Array, Pixels
from .boxes import blended, grid_anchors, sigmoid
from .files import model_file, packaged
from .network import Network
from .view import View, cut

DETECTOR = "face_detection_full_range_sparse.tflite"
MESH = "face_landmark_with_attention.tflite"
INPUT_PX = 192
"""Width and height of what both look at."""
LIKELY, SURE = 0.5, 0.7
"""Scores from which a box counts, and from which one of a face's boxes must be, to be believed (markers get up to 0.63)."""
HOPEFUL_MESH, SURE_MESH = 0.02, 0.9
"""The same of the mesh: at first, where the box may lie askew, and at last."""
STEADY = 0.11
"""By what part of their distance the corners of the eyes may move in a wider view: 0.01 to 0.10 in faces, 0.13 in what is none."""
SMALLEST_TILE_PX = 640
SMALLEST_TILE_THOROUGH_PX = 320
_SAME = 0.3
_OUTER = (33, 263)
_CORNERS = ((33, 133), (362, 263))
_AROUND = (
    (33, 7, 163, 144, 145, 153, 154, 155, 133, 246, 161, 160, 159, 158, 157, 173, 130, 25, 110, 24, 23, 22, 26, 112, 243, 247, 30,
     29, 27, 28, 56, 190, 226, 31, 228, 229, 230, 231, 232, 233, 244, 113, 225, 224, 223, 222, 221, 189, 35, 124, 46, 53, 52, 65,
     143, 111, 117, 118, 119, 120, 121, 128, 245, 156, 70, 63, 105, 66, 107, 55, 193),
    (263, 249, 390, 373, 374, 380, 381, 382, 362, 466, 388, 387, 386, 385, 384, 398, 359, 255, 339, 254, 253, 252, 256, 341, 463,
     467, 260, 259, 257, 258, 286, 414, 446, 261, 448, 449, 450, 451, 452, 453, 464, 342, 445, 444, 443, 442, 441, 413, 265, 353,
     276, 283, 282, 295, 372, 340, 346, 347, 348, 349, 350, 357, 465, 383, 300, 293, 334, 296, 336, 285, 417),
)  # fmt: skip
"""Points of the mesh around the right and the left eye, whose box is the eye's window."""
_LOWER, _UPPER = (0, 1, 2, 3, 4, 5, 6, 7, 8), (0, 9, 10, 11, 12, 13, 14, 15, 8)
"""Of an eye's own points, from corner to corner."""


@dataclass(frozen=True)
class Eye:
    """One eye.

    Attributes:
        iris_px: (5, 2) centre, then the four ends of the iris's horizontal and vertical diameter, alternating.
        lids_px: (71, 2); 0 to 8 along the lower lid, 0, 9 to 15, 8 along the upper one.
    """

    iris_px: Array
    lids_px: Array

    @property
    def centre_px(self) -> Array:
        """(2,) of the iris."""
        return np.asarray(self.iris_px[0])

    @property
    def iris_width_px(self) -> float:
        """Horizontal diameter of the iris as the network says it."""
        return float(np.hypot(*(self.iris_px[1] - self.iris_px[3])))

    @property
    def opening_px(self) -> float:
        """Distance of the lids across the iris."""
        along = self.lids_px[8] - self.lids_px[0]
        along = along / max(float(np.hypot(*along)), 1e-9)
        across = np.array([-along[1], along[0]])
        heights = []
        for lid in (_LOWER, _UPPER):
            points = self.lids_px[list(lid)] - self.centre_px
            order = np.argsort(points @ along)
            heights.append(float(np.interp(0.0, (points @ along)[order], (points @ across)[order])))
        return abs(heights[0] - heights[1])


@dataclass(frozen=True)
class Face:
    """One face.

    Attributes:
        box_px: (4,) left, top, right, bottom.
        score: the detector's, 0 to 1.
        mesh_px: (468, 3); x and y in the picture, z away from the camera to the same scale, 0 in the middle of the head.
        eyes: the person's right one, which stands left in the picture, then the left one.
    """

    box_px: Array
    score: float
    mesh_px: Array
    eyes: tuple[Eye, Eye]

    @property
    def eyes_turned_rad(self) -> float:
        """Angle of the line through the outer corners of the eyes to what faces the viewer; positive where its right end is
        farther."""
        across = self.mesh_px[_OUTER[1]] - self.mesh_px[_OUTER[0]]
        return math.atan2(across[2], math.hypot(across[0], across[1]))


def find_faces(
    pixels: Pixels, *, thorough: bool = False, progress: Callable[[float], None] | None = None
) -> tuple[Face, ...]:
    """All faces, from left to right.

    Args:
        pixels: (H, W, 3) RGB, upright.
        thorough: whether smaller faces are looked for, too.
        progress: is told the share done.

    Raises:
        MissingExtraError: the networks are not installed.
    """
    tiles = _tiles(pixels, SMALLEST_TILE_THOROUGH_PX if thorough else SMALLEST_TILE_PX)
    seen = []
    for number, (centre, side) in enumerate(tiles):
        seen.append(_detected(pixels, centre, side / INPUT_PX))
        if progress is not None:
            progress((number + 1) / len(tiles))
    values, scores = np.concatenate([v for v, _ in seen]), np.concatenate([s for _, s in seen])
    if not len(scores):
        return ()
    found: list[Face] = []
    for value, score in zip(*blended(values[:, :4], scores, _SAME, values), strict=True):
        face = _meshed(pixels, value, float(score)) if score >= SURE else None
        if face is not None and not any(_same(face, other) for other in found):
            found.append(face)
    return tuple(sorted(found, key=lambda face: float(face.box_px[0])))


def _same(one: Face, other: Face) -> bool:
    """Whether two are one face, seen in two tiles: their eyes lie closer together than half their own distance."""
    a, b = (np.stack([eye.centre_px for eye in face.eyes]) for face in (one, other))
    apart = min(float(np.hypot(*(eyes[1] - eyes[0]))) for eyes in (a, b))
    return bool(np.hypot(*(a.mean(axis=0) - b.mean(axis=0))) < 0.5 * apart)


def _tiles(pixels: Pixels, smallest_px: int) -> list[tuple[Array, float]]:
    """Centres and sides of the squares to look at: more than the picture (for a face that fills it), the picture, and
    overlapping parts of it, down to where a face would be too small to measure by."""
    height, width = pixels.shape[:2]
    middle, side = np.array([(width - 1) / 2, (height - 1) / 2]), float(max(width, height))
    found = [(middle, 1.6 * side), (middle, side)]
    if min(width, height) < side / 2:  # a panorama or a strip: the whole shows nothing
        side = 2.0 * min(width, height)
    while side / 2 >= smallest_px:
        side /= 2
        spots = []
        for length in (width, height):
            count = 1 + math.ceil(max(length - side, 0) / (0.7 * side))
            spots.append(np.linspace(side / 2, length - side / 2, count) if count > 1 else np.array([length / 2]))
        found += [(np.array([x - 0.5, y - 0.5]), side) for y in spots[1] for x in spots[0]]
    return found


def _detected(pixels: Pixels, centre_px: Array, scale: float) -> tuple[Array, Array]:
    """(N, 16) box and six points of each face in a square of the picture, px of the picture, and (N,) scores."""
    seen = cut(pixels, centre_px, scale, INPUT_PX, INPUT_PX)
    values, scores = _detector().run(seen.input(-1.0, 1.0))
    sure = sigmoid(scores[0, :, 0])
    kept = sure >= LIKELY
    coded, anchors = values[0][kept], INPUT_PX * grid_anchors(INPUT_PX, [(4, 1)])[kept]
    middle, half = coded[:, None, :2] + anchors[:, None], coded[:, None, 2:4] / 2
    points = np.concatenate([middle - half, middle + half, coded[:, 4:].reshape(-1, 6, 2) + anchors[:, None]], axis=1)
    return seen.in_picture(points - 0.5).reshape(-1, 16), sure[kept]


def _meshed(pixels: Pixels, value: Array, score: float) -> Face | None:
    """The face that the detector saw; None where the mesh sees none, or another one when it looks from farther away."""
    box, right, left = value[:4], value[4:6], value[6:8]
    angle = math.atan2(*(left - right)[::-1])
    centre, side = (box[:2] + box[2:]) / 2, 1.5 * float(max(box[2] - box[0], box[3] - box[1]))
    for _ in range(3):
        seen, local, features, sure = _looked(pixels, centre, side, angle)
        if not sure >= HOPEFUL_MESH:
            return None
        points = seen.in_picture(local[:, :2] - 0.5)
        angle = math.atan2(*(points[_OUTER[1]] - points[_OUTER[0]])[::-1])
        turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
        low, high = (points @ turn).min(axis=0), (points @ turn).max(axis=0)
        centre, side = turn @ ((low + high) / 2), 1.5 * float(max(high - low))
    wide, there, _, sure_too = _looked(pixels, centre, 1.25 * side, angle)
    corners = points[list(_OUTER)]
    moved = np.hypot(*(wide.in_picture(there[list(_OUTER), :2] - 0.5) - corners).T)
    if min(sure, sure_too) < SURE_MESH or not np.all(moved < STEADY * np.hypot(*(corners[1] - corners[0]))):
        return None
    eyes = (_eye(seen, local, features, 0), _eye(seen, local, features, 1))
    return Face(box, score, np.concatenate([points, local[:, 2:] * seen.scale], axis=1), eyes)


def _looked(pixels: Pixels, centre_px: Array, side_px: float, angle_rad: float) -> tuple[View, Array, Array, float]:
    """What the mesh sees in a square of the picture: the view, (468, 3) points in px of it, features, and how sure it is."""
    seen = cut(pixels, centre_px, max(side_px, 8.0) / INPUT_PX, INPUT_PX, INPUT_PX, angle_rad=angle_rad)
    points, features, flag = _mesh().run(seen.input())
    return seen, points.reshape(468, 3), features[0], float(sigmoid(flag.reshape(-1)[0]))


def _eye(seen: View, local: Array, features: Array, which: int) -> Eye:
    """Iris and lids of one eye, by the network that looks at the features in its window.

    The window is the box of the points around the eye, turned with it, half as large again; the features are 4 px apart.
    """
    first, last = _CORNERS[which]
    angle = math.atan2(*(local[last, :2] - local[first, :2])[::-1])
    turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    around = local[list(_AROUND[which]), :2] @ turn
    low, high = around.min(axis=0), around.max(axis=0)
    middle, size = turn @ ((low + high) / 2), 1.5 * (high - low)
    share = (np.arange(16) + 0.5) / 16 - 0.5
    grid = np.stack(np.meshgrid(share, share), -1) * size @ turn.T + middle
    iris, lids = _eye_part(which).run(_sampled(features, grid / 4 - 0.5)[None])

    def placed(raw: Array) -> Array:
        return seen.in_picture((raw.reshape(-1, 2) / 64 - 0.5) * size @ turn.T + middle - 0.5)

    return Eye(placed(iris), placed(lids))


def _sampled(features: Array, places: Array) -> Array:
    """Features (H, W, C) between their places (..., 2), linearly; 0 beyond them."""
    height, width = features.shape[:2]
    x, y = places[..., 0], places[..., 1]
    beyond = (x < 0) | (y < 0) | (x > width - 1) | (y > height - 1)
    left = np.clip(np.floor(x).astype(int), 0, width - 2)
    top = np.clip(np.floor(y).astype(int), 0, height - 2)
    dx, dy = (x - left)[..., None], (y - top)[..., None]
    upper = (1 - dx) * features[top, left] + dx * features[top, left + 1]
    lower = (1 - dx) * features[top + 1, left] + dx * features[top + 1, left + 1]
    return np.where(beyond[..., None], 0.0, (1 - dy) * upper + dy * lower)


def _detector() -> Network:
    return packaged(DETECTOR)


@cache
def _mesh() -> Network:
    return Network(model_file(MESH), (("input_1",), ("output_mesh", "p_re_lu_3", "conv_faceflag")))


@cache
def _eye_part(which: int) -> Network:
    side = ("left", "right")[which]  # the file says left and right as seen in the picture
    return Network(
        model_file(MESH), ((f"transform_tensor_bilinear_v2_{which + 1}",), (f"conv_{side}_iris", f"conv_{side}_eye"))
    )
