"""Camera from the focal length and the focal-plane resolution in a photo's metadata.

f_px = focal length * pixels per mm on the sensor, along the width. The resolution holds for the size in the EXIF tags; a picture
resized since is scaled.

Source: CIPA DC-008 (EXIF), FocalPlaneXResolution, FocalPlaneYResolution, FocalPlaneResolutionUnit.
"""

from __future__ import annotations

import math

from ..assumptions import NOMINAL_FOCAL
from ..hypothesis import Hypothesis
from ..photo import Photo
from ..tagged_size import tagged_size
from ..told_camera import SQUARE, pixel_shape, told_camera

NAME = "exif_focal_plane"
SENSOR_WIDTHS_MM = (1.5, 70.0)
"""Sensors narrower or wider than that are not built into cameras: the tags are then of another picture."""


def camera(photo: Photo) -> Hypothesis:
    """The hypothesis, or its reason."""
    tags = photo.metadata
    if tags.focal_mm is None:
        return Hypothesis(NAME, None, "the metadata has no focal length")
    if tags.focal_plane_x_per_mm is None:
        return Hypothesis(NAME, None, "the metadata has no focal-plane resolution")
    size = tagged_size(photo)
    width = max(tags.tagged_width_px or 0, size.whole_px[0] / size.scale) / tags.focal_plane_x_per_mm
    if not SENSOR_WIDTHS_MM[0] <= width <= SENSOR_WIDTHS_MM[1]:
        text = f"the focal-plane resolution makes the sensor {width:.2g} mm wide: it is of another size"
        return Hypothesis(NAME, None, text)
    x, y = tags.focal_plane_x_per_mm, tags.focal_plane_y_per_mm or tags.focal_plane_x_per_mm
    nearly_square = abs(y / x - 1) <= SQUARE
    f_px = tags.focal_mm * (math.sqrt(x * y) if nearly_square else x) * size.scale * size.zoom
    relative = math.hypot(NOMINAL_FOCAL, (x / y - 1) / 2 if nearly_square else 0.0, rounding(tags.focal_mm))
    text = f"EXIF: focal length {tags.focal_mm:g} mm and focal-plane resolution (sensor {width:.2f} mm wide)"
    found = told_camera(photo, f_px, relative, text, size)
    return Hypothesis(NAME, found, text, (*size.notes, *pixel_shape(photo)[2]))


def rounding(focal_mm: float) -> float:
    """Relative u by the rounding of the tag, taken to a tenth of a millimetre below 20 mm and to one above."""
    return (0.05 if focal_mm < 20 else 0.5) / math.sqrt(3) / focal_mm
