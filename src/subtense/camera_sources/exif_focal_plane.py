"""Camera from the focal length and the focal-plane resolution in a photo's metadata.

f_px = focal length * pixels per mm on the sensor. The resolution holds for the size in the EXIF tags; a picture resized
since is scaled.
"""

from __future__ import annotations

import math

from ..assumptions import NOMINAL_FOCAL
from ..hypothesis import Hypothesis, unknown_lens
from ..photo import Photo
from ..tagged_size import tagged_size

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
    width = (tags.tagged_width_px or photo.stored_size_px[0]) / tags.focal_plane_x_per_mm
    if not SENSOR_WIDTHS_MM[0] <= width <= SENSOR_WIDTHS_MM[1]:
        return Hypothesis(
            NAME, None, f"the focal-plane resolution makes the sensor {width:.2g} mm wide: it is of another size"
        )
    x, y = tags.focal_plane_x_per_mm, tags.focal_plane_y_per_mm or tags.focal_plane_x_per_mm
    f_px = tags.focal_mm * math.sqrt(x * y) * size.scale * size.zoom
    relative = math.hypot(NOMINAL_FOCAL, (x / y - 1) / 2, _rounding(tags.focal_mm), size.relative_u)
    text = f"EXIF: focal length {tags.focal_mm:g} mm and focal-plane resolution (sensor {width:.2f} mm wide)"
    found = unknown_lens(photo.width_px, photo.height_px, f_px, relative * f_px, text, tags.focal_mm / 1000)
    return Hypothesis(NAME, found, text, size.notes)


def _rounding(focal_mm: float) -> float:
    """Relative u by the rounding of the tag, taken to a tenth of a millimetre below 20 mm and to one above."""
    return (0.05 if focal_mm < 20 else 0.5) / math.sqrt(3) / focal_mm
