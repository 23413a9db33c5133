"""Camera of an equirectangular panorama whose GPano tags tell the whole geometry.

The full panorama is 2 pi wide and pi high: f = full width / 2 pi pixels per radian across, full height / pi down; the picture is a part
of it whose left and top are told. Its middle looks along the axis.

Source: Google, Photo Sphere XMP metadata (GPano).
"""

from __future__ import annotations

import math

import numpy as np

from ..camera import Camera
from ..edited import is_panorama, refusal
from ..hypothesis import Hypothesis
from ..metadata import number, positive
from ..photo import Photo

NAME = "panorama_tags"
STITCHED_U = 0.005
"""Relative u of the scale of a part: seams are drawn together."""
CENTRE_U = 0.002


def camera(photo: Photo) -> Hypothesis:
    """The hypothesis, or its reason."""
    tags = photo.metadata
    if not is_panorama(tags):
        return Hypothesis(NAME, None, "no panorama")
    note = refusal(photo)
    notes = (note,) if note else ()
    geometry = _geometry(photo)
    if isinstance(geometry, str):
        return Hypothesis(NAME, None, geometry, notes)
    full_width, full_height, left, top = geometry
    f_px, fy_px = full_width / (2 * math.pi), full_height / math.pi
    cov = np.diag([STITCHED_U * f_px, STITCHED_U, CENTRE_U * photo.width_px, CENTRE_U * photo.width_px]) ** 2
    text = f"GPano: a part of an equirectangular panorama of {full_width:.0f} x {full_height:.0f} px"
    made = Camera(photo.width_px, photo.height_px, f_px, full_width / 2 - left - 0.5, full_height / 2 - top - 0.5,
                  aspect=fy_px / f_px, lens="equirectangular", cov=cov, source=text)  # fmt: skip
    return Hypothesis(NAME, made, text, notes)


def _geometry(photo: Photo) -> tuple[float, float, float, float] | str:
    """Full width and height, left and top, in pixels of now; or what is missing."""
    tags = photo.metadata
    if tags.xmp.get("GPano:ProjectionType", "").lower() != "equirectangular":
        return "the panorama is not told to be equirectangular"
    if tags.orientation != 1:
        return "the panorama is turned by its orientation tag"
    names = (
        "FullPanoWidthPixels",
        "FullPanoHeightPixels",
        "CroppedAreaImageWidthPixels",
        "CroppedAreaImageHeightPixels",
    )
    full_width, full_height, width, height = (positive(tags.xmp.get(f"GPano:{name}")) for name in names)
    left, top = (number(tags.xmp.get(f"GPano:CroppedArea{side}Pixels")) for side in ("Left", "Top"))
    if full_width is None or full_height is None or width is None or height is None or left is None or top is None:
        return "the panorama's tags don't tell its whole size and which part of it this is"
    across, down = photo.width_px / width, photo.height_px / height
    inside = left >= 0 and top >= 0 and left + width <= full_width + 1 and top + height <= full_height + 1
    if not inside or abs(across / down - 1) > 0.01 or abs(full_width / full_height / 2 - 1) > 0.01:
        return "the panorama's tags contradict each other"
    return full_width * across, full_height * down, left * across, top * down
