"""Equivalent: the focal length in px that a photo's 35 mm equivalent gives, and whether another source agrees with it.

By the diagonal, as the standard has it: f_px = f35 * diagonal of the picture in pixels / 43.267 mm. A picture whose proportions
are not its sensor's (16:9 or 1:1 of a 4:3 sensor) may go by the sensor's diagonal or by its own, and a digital zoom may be in
the number or not: so there may be several readings.

Source: CIPA DC-008 (EXIF), FocalLengthIn35mmFilm; diagonal of 36 mm x 24 mm.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import product

from .assumptions import NOMINAL_FOCAL, ROUNDED
from .metadata import Metadata
from .photo import Photo
from .tagged_size import TaggedSize
from .told_camera import pixel_shape

DIAGONAL_MM = math.hypot(36.0, 24.0)
MAKERS_RULE = 0.02
"""Relative u: some makers go by the width, or by the sensor before their own lens correction."""
WIDE = 1.6
"""Pictures wider than that for their height were cut from a sensor of other proportions."""
SQUARISH = 1.2
"""And so were those nearer to a square."""
F35_MM = (4.0, 2000.0)
RATIOS = (0.8, 12.0)
"""35 mm equivalent over focal length of any camera that is made."""
WITHIN = 2.0
"""A focal length agrees with the equivalent where their logarithms differ by no more than so many combined u."""


@dataclass(frozen=True)
class Comparison:
    """A focal length against the equivalent.

    Attributes:
        factor: the equivalent's focal length, in its nearest reading, over the one compared.
        limit: how far the factor's logarithm may be from 0.
    """

    factor: float
    limit: float

    @property
    def agrees(self) -> bool:
        """Whether they are one focal length."""
        return abs(math.log(self.factor)) <= self.limit


def is_absurd(tags: Metadata) -> bool:
    """Whether the equivalent is of no camera that is made; False where there is none."""
    if tags.f35_mm is None:
        return False
    if not F35_MM[0] <= tags.f35_mm <= F35_MM[1]:
        return True
    return tags.focal_mm is not None and not RATIOS[0] <= tags.f35_mm / tags.focal_mm <= RATIOS[1]


def relative_u(f35_mm: float) -> float:
    """Relative u of a focal length by the equivalent: nominal, the maker's rule, and the tag's rounding."""
    half_digit = (
        0.5 if f35_mm == round(f35_mm) else 0.05
    )  # the tag is a whole number of mm; XMP may have a fraction of it
    return math.hypot(NOMINAL_FOCAL, MAKERS_RULE, half_digit / ROUNDED / f35_mm)


def diagonals_px(photo: Photo, size: TaggedSize) -> list[float]:
    """Diagonals that the equivalent may be of, in pixels along the width."""
    width, height = size.whole_px[0], size.whole_px[1] / pixel_shape(photo)[0]
    long, short = max(width, height), min(width, height)
    own = math.hypot(long, short)
    if SQUARISH <= long / short <= WIDE:
        return [own]
    return [own, math.hypot(long, long * 3 / 4) if long / short > WIDE else math.hypot(short, short * 4 / 3)]


def readings_px(photo: Photo, size: TaggedSize) -> list[float]:
    """Focal lengths in px that the equivalent may mean: of each diagonal, with the digital zoom in it or not."""
    f35 = photo.metadata.f35_mm
    if f35 is None or is_absurd(photo.metadata):
        return []
    return [
        f35 * diagonal / DIAGONAL_MM * zoom
        for diagonal, zoom in product(diagonals_px(photo, size), sorted({1.0, size.zoom}))
    ]


def compared(photo: Photo, size: TaggedSize, f_px: float, u: float) -> Comparison | None:
    """A focal length against the equivalent's nearest reading; None where the file tells no usable one.

    Args:
        photo: the picture.
        size: how it relates to the one that was taken.
        f_px: focal length in px of the whole picture.
        u: its relative u.
    """
    readings = readings_px(photo, size)
    if not readings or photo.metadata.f35_mm is None:
        return None
    nearest = min(readings, key=lambda one: abs(math.log(one / f_px)))
    return Comparison(nearest / f_px, WITHIN * math.hypot(u, relative_u(photo.metadata.f35_mm)))
