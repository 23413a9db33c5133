"""Camera from the 35 mm equivalent focal length in a photo's metadata.

By the diagonal, as the standard has it: f_px = f35 * diagonal of the picture in pixels / 43.267 mm. A 16:9 picture cut from
a 4:3 sensor may go by the sensor's diagonal or by its own; the two are averaged and their difference is in u.

Source: CIPA DC-008 (EXIF), FocalLengthIn35mmFilm; diagonal of 36 mm x 24 mm.
"""

from __future__ import annotations

import math

from ..assumptions import NOMINAL_FOCAL
from ..hypothesis import Hypothesis, unknown_lens
from ..photo import Photo
from ..quantity import Note
from ..tagged_size import tagged_size

NAME = "exif_35mm"
DIAGONAL_MM = math.hypot(36.0, 24.0)
MAKERS_RULE = 0.02
"""Relative u: some makers go by the width, or by the sensor before their own lens correction."""
WIDE = 1.6
"""Pictures wider than that for their height were cut from a sensor of other proportions."""


def camera(photo: Photo) -> Hypothesis:
    """The hypothesis, or its reason."""
    tags = photo.metadata
    f35 = tags.f35_mm
    if f35 is None:
        return Hypothesis(NAME, None, "the metadata has no 35 mm equivalent focal length")
    if not 4 <= f35 <= 2000 or (tags.focal_mm and not 0.8 <= f35 / tags.focal_mm <= 12):
        note = Note(
            "f35_invalid",
            f"the 35 mm equivalent of {f35:g} mm is absurd and was left out",
            "give the camera with --camera",
        )
        return Hypothesis(NAME, None, f"the 35 mm equivalent of {f35:g} mm is absurd", (note,))
    size = tagged_size(photo)
    diagonal, relative_shape, notes = _diagonal(photo)
    f_px = f35 * diagonal / DIAGONAL_MM
    relative = math.hypot(
        NOMINAL_FOCAL, MAKERS_RULE, 0.5 / math.sqrt(3) / f35, relative_shape, size.relative_u, 1 - 1 / size.zoom
    )
    text = f"EXIF: 35 mm equivalent of {f35:g} mm, by the diagonal"
    focal_m = tags.focal_mm / 1000 if tags.focal_mm else None
    found = unknown_lens(photo.width_px, photo.height_px, f_px, relative * f_px, text, focal_m)
    return Hypothesis(NAME, found, text, size.notes + notes)


def _diagonal(photo: Photo) -> tuple[float, float, tuple[Note, ...]]:
    """The picture's diagonal in px, its relative u, and a note where the sensor has other proportions."""
    long, short = max(photo.stored_size_px), min(photo.stored_size_px)
    own = math.hypot(long, short)
    if long / short <= WIDE:
        return own, 0.0, ()
    whole = math.hypot(long, long * 3 / 4)
    note = Note("aspect_mismatch", f"a picture of {long} x {short} px is cut from a sensor of other proportions; the 35 mm "
                "equivalent may hold for either", "calibrate the camera, or use its full-sensor mode")  # fmt: skip
    return (own + whole) / 2, (whole - own) / (whole + own), (note,)
