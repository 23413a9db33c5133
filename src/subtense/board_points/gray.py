"""Gray pictures to find boards in: green-weighted, and reduced to what finding needs."""

from __future__ import annotations

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
    import cv2

    return np.asarray(cv2.cvtColor(pixels, cv2.COLOR_RGB2GRAY))


def reduced(gray: Pixels, longest_px: int = FINDING_PX) -> Reduced:
    """The picture with its longest side at most `longest_px`; the picture itself if it is no longer."""
    import cv2

    height, width = gray.shape
    scale = longest_px / max(width, height)
    if scale >= 1:
        return Reduced(gray, 1.0, 1.0)
    size = (max(round(width * scale), 1), max(round(height * scale), 1))
    return Reduced(np.asarray(cv2.resize(gray, size, interpolation=cv2.INTER_AREA)), size[0] / width, size[1] / height)


def steps(gray: Pixels, most: int = 3) -> tuple[Reduced, ...]:
    """Pictures to search one after the other, `most` of them: the reduced one, then one of twice that, then the full one."""
    full_px = max(gray.shape)
    sides = [side for side in (FINDING_PX, 2 * FINDING_PX) if side < 0.8 * full_px]
    return tuple(reduced(gray, side) for side in (*sides, full_px)[:most])
