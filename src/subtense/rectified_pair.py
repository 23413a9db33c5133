"""Rectified: the two pictures of a rig turned so that the same point lies in the same row of both, and back.

Both pictures are seen again through pinhole cameras with one orientation, whose x axis is the baseline. There the depth along the
common axis is Z = f B / (d + doffs). A pair that is rectified already stays as it is, pixel by pixel.

Source: A. Fusiello, E. Trucco, A. Verri, A compact algorithm for rectification of stereo pairs, MVA 12, 2000.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from .arrays import Array, Pixels
from .camera import Camera
from .errors import GeometryError
from .rig import Rig

MOST_TURN_RAD = 0.7
"""Between a camera's axis and the rectified one: beyond it the pictures would be torn apart."""
MAP_STEP_PX, OUTSIDE = 4, -1e5
"""Lens distortion is straight to a hundredth of a pixel over so many pixels."""
SAME = 1e-6
"""Relative difference up to which two numbers of a rig that is rectified already are one."""


@dataclass(frozen=True, eq=False)
class Rectified:
    """Two pinhole cameras side by side, and how the rig's pictures become theirs.

    Attributes:
        rig: what it was made of.
        f_px: focal length of both.
        cx_px: principal point of the left picture, x.
        cy_px: of both, y.
        doffs_px: principal point of the right picture less that of the left one, x.
        baseline_m: between the two entrance pupils.
        rect_from_left: (3, 3) rotation.
        rect_from_right: (3, 3) rotation.
        as_taken: whether the pictures were rectified already.
    """

    rig: Rig
    f_px: float
    cx_px: float
    cy_px: float
    doffs_px: float
    baseline_m: float
    rect_from_left: Array
    rect_from_right: Array
    as_taken: bool

    @property
    def width_px(self) -> int:
        """Of both rectified pictures."""
        return self.rig.left.width_px

    @property
    def height_px(self) -> int:
        """Of both rectified pictures."""
        return self.rig.left.height_px

    def pair(self, left: Pixels, right: Pixels) -> tuple[Pixels, Pixels]:
        """The rectified pictures; 0 where a camera saw nothing."""
        if self.as_taken:
            return left, right
        return self._seen(left, self.rig.left, self.rect_from_left, self.cx_px), self._seen(
            right, self.rig.right, self.rect_from_right, self.cx_px + self.doffs_px
        )

    def _seen(self, picture: Pixels, camera: Camera, rect_from_camera: Array, cx_px: float) -> Pixels:
        import cv2

        def places(points: Array) -> Array:
            ways = np.column_stack([(points - [cx_px, self.cy_px]) / self.f_px, np.ones(len(points))])
            return camera.project(ways @ rect_from_camera)

        maps = smooth_map(places, self.width_px, self.height_px, MAP_STEP_PX)
        return np.asarray(cv2.remap(picture, maps[0], maps[1], cv2.INTER_CUBIC, borderValue=0))

    # -- pixels ------------------------------------------------------------------------------------------

    def from_left(self, points_px: Array) -> Array:
        """(..., 2) pixels of the left picture in the rectified left one; NaN where they lie beyond it."""
        if self.as_taken:
            return np.asarray(points_px, float)
        return self._from(self.rig.left, self.rect_from_left, points_px, self.cx_px)

    def from_right(self, points_px: Array) -> Array:
        """(..., 2) pixels of the right picture in the rectified right one."""
        if self.as_taken:
            return np.asarray(points_px, float)
        return self._from(self.rig.right, self.rect_from_right, points_px, self.cx_px + self.doffs_px)

    def _from(self, camera: Camera, rect_from_camera: Array, points_px: Array, cx_px: float) -> Array:
        points = np.asarray(points_px, float)
        ways = camera.rays(points.reshape(-1, 2)) @ rect_from_camera.T
        with np.errstate(divide="ignore", invalid="ignore"):
            x, y = (np.where(ways[:, 2] > 0, ways[:, i] / ways[:, 2], np.nan) for i in (0, 1))
        return np.stack([self.f_px * x + cx_px, self.f_px * y + self.cy_px], -1).reshape(points.shape)

    def to_right(self, points_px: Array) -> Array:
        """(..., 2) pixels of the rectified right picture in the right one as it was taken."""
        points = np.asarray(points_px, float)
        if self.as_taken:
            return points
        x = (points[..., 0] - self.cx_px - self.doffs_px) / self.f_px
        ways = np.stack([x, (points[..., 1] - self.cy_px) / self.f_px, np.ones_like(x)], -1)
        return self.rig.right.project((ways @ self.rect_from_right).reshape(-1, 3)).reshape(points.shape)

    def to_left(self, points_px: Array) -> Array:
        """(..., 2) pixels of the rectified left picture in the left one as it was taken."""
        points = np.asarray(points_px, float)
        if self.as_taken:
            return points
        x = (points[..., 0] - self.cx_px) / self.f_px
        ways = np.stack([x, (points[..., 1] - self.cy_px) / self.f_px, np.ones_like(x)], -1)
        return self.rig.left.project((ways @ self.rect_from_left).reshape(-1, 3)).reshape(points.shape)

    def depth_m(self, disparity_px: Any) -> Any:
        """Depth along the rectified axis; infinite or negative at and beyond infinity."""
        with np.errstate(divide="ignore"):
            return self.f_px * self.baseline_m / (np.asarray(disparity_px) + self.doffs_px)


def rectified(rig: Rig) -> Rectified:
    """The rectified pair of a rig.

    Raises:
        GeometryError: `left_right_swapped`, `not_side_by_side`: the cameras can't be a left and a right one.
    """
    pose = rig.right_from_left
    place = -(pose.rotation.T @ pose.translation_m)  # the right camera, seen by the left one
    if place[0] < 0 and abs(place[0]) > abs(place[1]):
        raise GeometryError(
            "by the rig the right camera stands to the left of the left one; exchange the two pictures, or the rig's cameras",
            code="left_right_swapped",
        )
    if abs(place[1]) > abs(place[0]) or abs(place[2]) > abs(place[0]):
        raise GeometryError(
            "by the rig the cameras do not stand side by side; turn pictures and calibration by a quarter if one stands above the other",
            code="not_side_by_side",
        )
    if _is_rectified(rig):
        left, right = rig.left, rig.right
        return Rectified(
            rig, float(left.f_px), float(left.cx_px), float(left.cy_px), float(right.cx_px) - float(left.cx_px),
            rig.baseline_m, np.eye(3), np.eye(3), True,
        )  # fmt: skip
    return _turned(rig, place)


def _is_rectified(rig: Rig) -> bool:
    """Pinholes of one focal length and row, without a turn and with the baseline along x."""
    left, right, pose = rig.left, rig.right, rig.right_from_left
    return (
        left.lens == right.lens == "pinhole"
        and (left.width_px, left.height_px) == (right.width_px, right.height_px)
        and np.allclose(pose.rotation, np.eye(3), atol=SAME)
        and bool(np.all(abs(pose.translation_m[1:]) <= SAME * rig.baseline_m))
        and all(abs(float(getattr(left, n)) / float(getattr(right, n)) - 1) < SAME for n in ("f_px", "aspect", "cy_px"))
        and abs(float(left.aspect) - 1) < SAME
    )


def _turned(rig: Rig, place: Array) -> Rectified:
    pose = rig.right_from_left
    along = place / np.linalg.norm(place)
    ahead = np.array([0.0, 0.0, 1.0]) + pose.rotation.T @ np.array([0.0, 0.0, 1.0])
    down = np.cross(ahead, along)
    if np.linalg.norm(down) < np.sin(np.pi / 2 - MOST_TURN_RAD) * np.linalg.norm(ahead) or ahead[2] < 1:
        raise GeometryError(
            "by the rig the cameras look along the line between them, or apart; rectified pictures would show nothing in common",
            code="not_side_by_side",
        )
    down /= np.linalg.norm(down)
    rect_from_left = np.stack([along, down, np.cross(along, down)])
    rect_from_right = rect_from_left @ pose.rotation.T
    f = float(np.sqrt(float(rig.left.f_px) * float(rig.left.f_px) * float(rig.left.aspect)))
    middle = np.array([(rig.left.width_px - 1) / 2, (rig.left.height_px - 1) / 2])
    centres = []
    for camera, turn in ((rig.left, rect_from_left), (rig.right, rect_from_right)):
        seen = np.array([[(camera.width_px - 1) / 2, (camera.height_px - 1) / 2]])
        way = turn @ camera.rays(seen)[0]
        centres.append(middle - f * way[:2] / way[2])
    cy = float((centres[0][1] + centres[1][1]) / 2)
    return Rectified(rig, f, float(centres[0][0]), cy, float(centres[1][0] - centres[0][0]), rig.baseline_m,
                     rect_from_left, rect_from_right, False)  # fmt: skip


def smooth_map(function: Callable[[Array], Array], width_px: int, height_px: int, step_px: int = 8) -> Any:
    """(k, height, width) float32 values of a smooth function of pixels, evaluated at some and interpolated between them.

    Args:
        function: (n, 2) pixels to (n, k); NaN counts as far outside.
        width_px: of the picture.
        height_px: likewise.
        step_px: between the pixels at which it is evaluated.
    """
    across, down = (max(2, -(-side // step_px) + 1) for side in (width_px, height_px))
    x, y = np.meshgrid(np.linspace(0, width_px - 1, across), np.linspace(0, height_px - 1, down))
    found = np.nan_to_num(
        np.asarray(function(np.stack([x, y], -1).reshape(-1, 2))), nan=OUTSIDE, posinf=OUTSIDE, neginf=OUTSIDE
    )
    grid = found.reshape(down, across, -1).astype(np.float32)
    over, under = _weights(width_px, across), _weights(height_px, down)
    return np.stack([under @ grid[..., i] @ over.T for i in range(grid.shape[-1])])


def _weights(count: int, knots: int) -> Any:
    """(count, knots) weights of linear interpolation. OpenCV's remap would round places to a thirty-second of the knots' distance."""
    at = np.linspace(0, knots - 1, count)
    first = np.minimum(at.astype(int), knots - 2)
    found = np.zeros((count, knots), np.float32)
    found[np.arange(count), first] = 1 - (at - first)
    found[np.arange(count), first + 1] = at - first
    return found
