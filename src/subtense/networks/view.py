"""View: a rectangle of a picture, turned and scaled to the input of a network, and the way back to the picture's pixels.

Both axes have one scale, so nothing is squeezed; what lies beyond the picture is gray or black. Pixel (0, 0) is the centre of
the top-left pixel on both sides.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..arrays import Array, Pixels


@dataclass(frozen=True)
class View:
    """What a network looks at.

    Attributes:
        pixels: (height, width, 3) RGB, 0 to 255.
        to_picture: (2, 3); picture px = to_picture @ (x, y, 1) of the view's px.
    """

    pixels: Array
    to_picture: Array

    def in_picture(self, points_px: Array) -> Array:
        """(..., 2) px of the view to px of the picture."""
        return np.asarray(points_px @ self.to_picture[:, :2].T + self.to_picture[:, 2])

    def input(self, low: float = 0.0, high: float = 1.0) -> Array:
        """(1, height, width, 3), black and white becoming low and high."""
        return np.asarray(self.pixels[None] * ((high - low) / 255.0) + low)

    @property
    def scale(self) -> float:
        """Pixels of the picture in one of the view."""
        return float(np.hypot(self.to_picture[0, 0], self.to_picture[1, 0]))


def whole(pixels: Pixels, width_px: int, height_px: int, beyond: float = 0.0) -> View:
    """All of a picture in the middle of a view (letterboxed).

    Args:
        pixels: (H, W, 3) of the picture.
        width_px: of the view.
        height_px: of the view.
        beyond: value 0 to 255 around the picture.
    """
    height, width = pixels.shape[:2]
    scale = max(width / width_px, height / height_px)
    return cut(pixels, np.array([(width - 1) / 2, (height - 1) / 2]), scale, width_px, height_px, beyond=beyond)


def cut(
    pixels: Pixels, centre_px: Array, scale: float, width_px: int, height_px: int, *, angle_rad: float = 0.0,
    beyond: float = 0.0,
) -> View:  # fmt: skip
    """A turned rectangle of a picture.

    Args:
        pixels: (H, W, 3) of the picture.
        centre_px: (2,) of the rectangle, px of the picture.
        scale: pixels of the picture in one of the view.
        width_px: of the view.
        height_px: of the view.
        angle_rad: by which the rectangle is turned in the picture, clockwise as y points down.
        beyond: value 0 to 255 where there is no picture.
    """
    import cv2

    cos, sin = scale * math.cos(angle_rad), scale * math.sin(angle_rad)
    turn = np.array([[cos, -sin], [sin, cos]])
    middle = np.array([(width_px - 1) / 2, (height_px - 1) / 2])
    to_picture = np.concatenate([turn, (centre_px - turn @ middle)[:, None]], -1)
    source, to_source = _shrunk(cv2, pixels, to_picture, width_px, height_px, scale)
    if source is None:
        return View(np.full((height_px, width_px, 3), beyond), to_picture)
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    seen = cv2.warpAffine(source.astype(np.float32), to_source, (width_px, height_px), flags=flags,
                          borderMode=cv2.BORDER_CONSTANT, borderValue=(beyond,) * 3)  # fmt: skip
    return View(np.asarray(seen, float), to_picture)


def _shrunk(
    cv2: object, pixels: Pixels, to_picture: Array, width_px: int, height_px: int, scale: float
) -> tuple[Pixels | None, Array]:
    """The part of the picture that is looked at, averaged to about the view's scale, and the way to it from the view.

    Interpolating between single pixels of a much larger picture would look at few of them.
    """
    height, width = pixels.shape[:2]
    corners = np.array([[-1, -1, 1], [width_px, -1, 1], [-1, height_px, 1], [width_px, height_px, 1]], float)
    seen = corners @ to_picture.T
    left, top = np.clip(np.floor(seen.min(axis=0)).astype(int) - 1, 0, [width, height])
    right, bottom = np.clip(np.ceil(seen.max(axis=0)).astype(int) + 2, 0, [width, height])
    if right <= left or bottom <= top:
        return None, to_picture
    part = pixels[top:bottom, left:right]
    move = np.array([left, top], float)
    across, down = max(round((right - left) / scale), 1), max(round((bottom - top) / scale), 1)
    to_part = to_picture.copy()
    to_part[:, 2] -= move
    if scale < 1.2 or across >= right - left or down >= bottom - top:
        return part, to_part
    ratio = np.array([across / (right - left), down / (bottom - top)])
    small = cv2.resize(np.ascontiguousarray(part), (across, down), interpolation=cv2.INTER_AREA)  # type: ignore[attr-defined]
    to_small = ratio[:, None] * to_part
    to_small[:, 2] += 0.5 * ratio - 0.5  # centres of pixels: s' = (s + 0.5) ratio - 0.5
    return np.asarray(small), to_small
