"""Camera from the 35 mm equivalent focal length in a photo's metadata.

By the diagonal, as the standard has it: f_px = f35 * diagonal of the picture in pixels / 43.267 mm. A picture whose proportions
are not its sensor's (16:9 or 1:1 of a 4:3 sensor) may go by the sensor's diagonal or by its own, and a digital zoom may be in
the number or not: both readings are given, and their difference is in u.

Source: CIPA DC-008 (EXIF), FocalLengthIn35mmFilm; diagonal of 36 mm x 24 mm.
"""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import product

import numpy as np

from ..assumptions import NOMINAL_FOCAL
from ..camera import Camera
from ..hypothesis import Hypothesis
from ..metadata import Metadata
from ..photo import Photo
from ..quantity import Note
from ..tagged_size import TaggedSize, tagged_size
from ..told_camera import pixel_shape, told_camera

NAME = "exif_35mm"
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


def camera(photo: Photo) -> Hypothesis:
    """The hypothesis, or its reason."""
    tags = photo.metadata
    if tags.f35_mm is None:
        return Hypothesis(NAME, None, "the metadata has no 35 mm equivalent focal length")
    if _absurd(tags):
        text = f"the 35 mm equivalent of {tags.f35_mm:g} mm is absurd"
        note = Note("f35_invalid", f"{text} and was left out", "give the camera with --camera")
        return Hypothesis(NAME, None, text, (note,))
    size = tagged_size(photo)
    diagonals, notes = _diagonals(photo, size)
    readings = [_camera(photo, size, diagonal, zoom) for diagonal, zoom in product(diagonals, sorted({1.0, size.zoom}))]
    found = _both(readings)
    shape = pixel_shape(photo)[2]
    return Hypothesis(
        NAME, found, found.source, (*size.notes, *notes, *shape), tuple(readings) if len(readings) > 1 else ()
    )


def _absurd(tags: Metadata) -> bool:
    assert tags.f35_mm is not None
    if not F35_MM[0] <= tags.f35_mm <= F35_MM[1]:
        return True
    return tags.focal_mm is not None and not RATIOS[0] <= tags.f35_mm / tags.focal_mm <= RATIOS[1]


def _camera(photo: Photo, size: TaggedSize, diagonal_px: float, zoom: float) -> Camera:
    f35 = photo.metadata.f35_mm
    assert f35 is not None
    relative = math.hypot(NOMINAL_FOCAL, MAKERS_RULE, _half_digit(f35) / math.sqrt(3) / f35)
    text = f"EXIF: 35 mm equivalent of {f35:g} mm, by the diagonal"
    return told_camera(photo, f35 * diagonal_px / DIAGONAL_MM * zoom, relative, text, size)


def _half_digit(f35_mm: float) -> float:
    """The tag is a whole number of mm; XMP may have a fraction of it."""
    return 0.5 if f35_mm == round(f35_mm) else 0.05


def _diagonals(photo: Photo, size: TaggedSize) -> tuple[list[float], tuple[Note, ...]]:
    """Diagonals that the equivalent may be of, in pixels along the width, and a note where there are two."""
    aspect = pixel_shape(photo)[0]
    width, height = size.whole_px[0], size.whole_px[1] / aspect
    long, short = max(width, height), min(width, height)
    own = math.hypot(long, short)
    if SQUARISH <= long / short <= WIDE:
        return [own], ()
    whole = math.hypot(long, long * 3 / 4) if long / short > WIDE else math.hypot(short, short * 4 / 3)
    note = Note("aspect_mismatch", f"a picture of {round(long)} x {round(short)} px is cut from a sensor of other proportions; the "
                "35 mm equivalent may hold for either", "calibrate the camera, or use its full-sensor mode")  # fmt: skip
    return [own, whole], (note,)


def _both(readings: list[Camera]) -> Camera:
    """One camera with the mean focal length, and a u that has all readings within one of it."""
    f = [float(one.f_px) for one in readings]
    middle, half = (max(f) + min(f)) / 2, (max(f) - min(f)) / 2
    if not half:
        return readings[0]
    cov = np.array(readings[0].cov)
    cov[0, 0] = (readings[0].u_f_px * middle / f[0]) ** 2 + half**2
    return replace(readings[0], f_px=middle, cov=cov, id=None)
