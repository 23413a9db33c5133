"""Gray pictures to find boards in: green-weighted, and reduced to what finding needs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..arrays import Array, Pixels

FINDING_PX = 1280
"""Longest side of the picture that boards are searched in first."""
TWO_STEPS = 2
"""Where the full picture would show no more: what is found in it is larger than a few pixels."""


@dataclass(frozen=True, eq=False)
class Reduced:
    """A smaller picture and how its pixels relate to the full ones.

    Attributes:
        pixels: (height, width) uint8.
        scale_x: its width over the full one's.
        scale_y: its height over the full one's.
    """

    pixels: Pixels
    scale_x: float
    scale_y: float

    def full(self, points_px: Array) -> Array:
        """(N, 2) points of this picture in full pixels; pixel centres are whole numbers in both."""
        return np.asarray((points_px + 0.5) / [self.scale_x, self.scale_y] - 0.5)


def gray_of(pixels: Pixels) -> Pixels:
    """(H, W) uint8 of (H, W, 3) RGB, weighted as the eye does: mostly green, which a Bayer sensor has most of."""
    if pixels.strides[2] == 0:  # one channel seen three times
        return pixels[..., 0]
    import cv2

    return np.asarray(cv2.cvtColor(pixels, cv2.COLOR_RGB2GRAY))


def reduced(gray: Pixels, longest_px: int = FINDING_PX) -> Reduced:
    """The picture halved until its longest side is at most `longest_px`: twenty times as fast as reducing it to a given size.

    An odd row or column at the end is left out, so that pixels keep their places.
    """
    import cv2

    scale = 1.0
    while max(gray.shape) > longest_px and min(gray.shape) >= 4:
        height, width = (side // 2 for side in gray.shape)
        even = gray[: 2 * height, : 2 * width]
        gray, scale = np.asarray(cv2.resize(even, (width, height), interpolation=cv2.INTER_AREA)), scale / 2
    return Reduced(gray, scale, scale)


def steps(gray: Pixels, most: int = 3) -> Iterator[Reduced]:
    """Pictures to search one after the other, `most` of them: the reduced one, then one of twice that, then the full one."""
    full_px = max(gray.shape)
    sides = [side for side in (FINDING_PX, 2 * FINDING_PX) if side < 0.8 * full_px]
    return (reduced(gray, side) for side in (*sides, full_px)[:most])
