"""The depth map of a disparity: in the left camera's own picture, with the doubt of the match and of the rig.

Inverse depth is straight in the disparity and nearly so in the rig's numbers: an error of the rig shifts it (a turn, doffs) and stretches
it (focal length, baseline). Both are had by moving the rig at some places of the picture, and interpolated between them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from .arrays import Array
from .depth_map import DepthMap
from .disparity import Disparity
from .geometry import Pose
from .rectified_pair import Rectified, smooth_map
from .rig import Rig
from .space import Space

LEAST_U = 3.0
"""Disparities of fewer u beyond infinity have no depth."""
FARTHEST = 1.0
"""Parallax in px that a filled pixel has at least."""
ACROSS, DOWN = 9, 7
"""Places at which the rig's doubt is had."""
PARALLAXES_PX = (5.0, 50.0)

Located = Callable[[Rig, Array, Array], Array]
"""(..., 3) places from a rig, (..., 2) pixels of the left picture and (...) disparities; `methods.stereo.located`."""


def depth_map(found: Disparity, pair: Rectified, located: Located, source: str) -> DepthMap:
    """Depths along the left camera's axis, in its picture as it was taken.

    Args:
        found: in the rectified left picture.
        pair: the rectified rig.
        located: the triangulation.
        source: what to call it.
    """
    scale = 1 / (pair.f_px * pair.baseline_m)
    inverse = (found.px + np.float32(pair.doffs_px)) * np.float32(scale)
    shift, both, stretch = (np.asarray(one) for one in _rig_variance(pair, located))
    lean = _lean(pair)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        sigma2 = (
            np.square(found.sigma_px * np.float32(scale)) + shift + 2 * both * inverse + stretch * inverse * inverse
        )
        # filled ones keep their place: what is far from sure there is said by their sigma
        resolved = (inverse >= LEAST_U * np.sqrt(sigma2)) | (found.filled & (inverse > FARTHEST * scale))
        depth = np.where(resolved, lean / inverse, np.nan)
        sigma = np.where(resolved, np.sqrt(sigma2) * depth / inverse, np.nan)
    filled = found.filled & resolved
    if not pair.as_taken:
        depth, sigma, filled = _as_taken(pair, depth, sigma, filled)
    middle = float(stretch[stretch.shape[0] // 2, stretch.shape[1] // 2])
    return DepthMap(depth, sigma, filled, pair.rig.left, source, float(np.sqrt(max(middle, 0.0))))


def _lean(pair: Rectified) -> Any:
    """Depth along the left camera's axis per depth along the rectified one: 1, or (height, width)."""
    if pair.as_taken:
        return np.float32(1.0)
    x, y = np.meshgrid(np.arange(pair.width_px, dtype=np.float32), np.arange(pair.height_px, dtype=np.float32))
    axis = pair.rect_from_left[:, 2]
    return (x - pair.cx_px) / pair.f_px * axis[0] + (y - pair.cy_px) / pair.f_px * axis[1] + axis[2]


def _as_taken(pair: Rectified, depth: Any, sigma: Any, filled: Any) -> tuple[Any, Any, Any]:
    """Maps of the rectified picture in the left one as it was taken; each pixel takes the nearest."""
    import cv2

    places = smooth_map(pair.from_left, pair.rig.left.width_px, pair.rig.left.height_px)
    x, y = (places[i] for i in (0, 1))

    def seen(one: Any) -> Any:
        return cv2.remap(one.astype(np.float32), x, y, cv2.INTER_NEAREST, borderValue=np.nan)

    return seen(depth), seen(sigma), seen(filled) > 0.5


# -- the rig's doubt -------------------------------------------------------------------------------------


def _rig_variance(pair: Rectified, located: Located) -> tuple[Any, Any, Any]:
    """(height, width) each: of inverse depth r, variance of its shift, covariance, and variance of its stretch: a + 2 b r + c r^2."""
    rig = pair.rig
    moved = _moved_rigs(rig)
    if not moved:
        nothing = np.zeros((pair.height_px, pair.width_px), np.float32)
        return nothing, nothing, nothing

    def variance(points: Array) -> Array:
        shift, stretch = _responses(pair, located, points, moved)
        return np.stack([np.sum(shift**2, 0), np.sum(shift * stretch, 0), np.sum(stretch**2, 0)], -1)

    step = max(pair.width_px // (ACROSS - 1), pair.height_px // (DOWN - 1), 8)
    layers = smooth_map(lambda points: variance(pair.to_left(points)), pair.width_px, pair.height_px, step)
    return layers[0], layers[1], layers[2]


def _moved_rigs(rig: Rig) -> list[Rig]:
    """The rig with each of its independent numbers moved by one u."""
    space = Space(({"rig": rig},))
    found = []
    for line in space.lines:
        for j in range(line.count):
            moved: dict[Any, dict[str, Array]] = {}
            line.put(line.value + line.shift(j), moved)
            found.append(space.rebuilt(moved)[0]["rig"])
    return found


def _responses(pair: Rectified, located: Located, points: Array, moved: list[Rig]) -> tuple[Array, Array]:
    """(rigs, n) each: how inverse depth shifts and stretches with each moved rig, at pixels of the left picture."""
    rig = pair.rig
    slopes = np.stack(np.broadcast_arrays(*rig.left.slopes(points), 1.0), -1)
    changes, inverses = [], []
    for parallax in PARALLAXES_PX:
        depth = pair.f_px * pair.baseline_m / parallax
        pose: Pose = rig.right_from_left
        column = rig.right.project(pose.apply(slopes * depth))[..., 0]
        apart = points[..., 0] - column
        with np.errstate(divide="ignore", invalid="ignore"):
            nominal = 1 / located(rig, points, apart)[..., 2]
            changes.append(np.stack([1 / located(one, points, apart)[..., 2] - nominal for one in moved]))
        inverses.append(nominal)
    stretch = (changes[1] - changes[0]) / (inverses[1] - inverses[0])
    shift = changes[0] - stretch * inverses[0]
    return np.nan_to_num(shift), np.nan_to_num(stretch)
