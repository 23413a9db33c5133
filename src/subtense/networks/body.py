"""Body: where the joints of a person are in a picture, and which pixels are the person's, by the packaged network.

Source: V. Bazarevsky et al., BlazePose: On-device Real-time Body Pose Tracking, 2020.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Array, Pixels
from .boxes import sigmoid
from .files import packaged
from .view import View, cut

FILE = "pose_landmark_lite.tflite"
SIZE_PX = 256
AROUND = (1.5, 1.25)
"""Sides of two views in longer sides of the person's box, with a margin for what the box has left out."""

EYES, SHOULDERS, HIPS, KNEES, ANKLES = (2, 5), (11, 12), (23, 24), (25, 26), (27, 28)
FEET = ((27, 29, 31), (28, 30, 32))
"""Ankle, heel and toes of the left and the right foot."""


@dataclass(frozen=True)
class Body:
    """A person.

    Attributes:
        joints_px: (33, 2) px of the picture.
        seen: (33,) how surely each is visible, 0 to 1.
        joints_m: (33, 3) about the hips, x right, y down, z away; their scale is a guess of the network.
        score: how surely there is a person, 0 to 1.
        top_px: highest edge of the person's pixels, y in the picture.
        bottom_px: lowest edge.
        left_px: leftmost edge, x in the picture.
        right_px: rightmost edge.
        pixel: pixels of the picture in one of the network's.
    """

    joints_px: Array
    seen: Array
    joints_m: Array
    score: float
    top_px: float
    bottom_px: float
    left_px: float
    right_px: float
    pixel: float

    @property
    def height_px(self) -> float:
        """From the highest to the lowest edge."""
        return self.bottom_px - self.top_px

    def middle(self, joints: tuple[int, int]) -> Array:
        """(2,) halfway between two joints, px."""
        return np.asarray(self.joints_px[list(joints)].mean(axis=0))


def body_in(pixels: Pixels, box_px: Array, around: float = AROUND[0]) -> Body | None:
    """The person in a box, or None where the network marks no pixels as one's.

    Args:
        pixels: (H, W, 3) of the picture.
        box_px: (4,) left, top, right, bottom, px.
        around: side of the view, longer sides of the box.

    Raises:
        MissingExtraError: the installation was made without networks, or without what runs them.
    """
    side = around * float(max(box_px[2] - box_px[0], box_px[3] - box_px[1]))
    view = cut(pixels, (box_px[:2] + box_px[2:]) / 2, side / SIZE_PX, SIZE_PX, SIZE_PX)
    joints, score, mask, _, metres = packaged(FILE).run(view.input())
    edges = _edges(mask[0, :, :, 0], view)
    if edges is None:
        return None
    table = joints.reshape(39, 5)[:33]
    return Body(
        view.in_picture(table[:, :2]), sigmoid(table[:, 3]), metres.reshape(39, 3)[:33], float(score.ravel()[0]),
        *edges, view.scale,
    )  # fmt: skip


def _edges(mask: Array, view: View) -> tuple[float, float, float, float] | None:
    """Top, bottom, left and right of the largest connected part of a mask of logits, px of the picture."""
    import cv2

    count, parts, stats, _ = cv2.connectedComponentsWithStats((mask > 0).astype(np.uint8))
    if count < 2:
        return None
    part = np.where(parts == 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA])), mask, np.minimum(mask, -1.0))
    top, bottom = _ends(part.max(axis=1))
    left, right = _ends(part.max(axis=0))
    (left, top), (right, bottom) = view.in_picture(np.array([[left, top], [right, bottom]]))
    return float(top), float(bottom), float(left), float(right)


def _ends(logits: Array) -> tuple[float, float]:
    """Where a row of logits first and last passes zero, between its pixels."""
    inside = np.flatnonzero(logits > 0)
    first, last = int(inside[0]), int(inside[-1])
    return first - _share(logits, first, first - 1), last + _share(logits, last, last + 1)


def _share(logits: Array, inside: int, outside: int) -> float:
    """How far from one pixel to the next the logits are zero; half of it at the end of the row."""
    if not 0 <= outside < len(logits):
        return 0.5
    return float(logits[inside] / (logits[inside] - logits[outside]))
