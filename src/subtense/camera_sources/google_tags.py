"""Camera from the imaging model of Google's Dynamic Depth, which phones write beside a depth map.

`FocalLengthX/Y` are in px of the `ImageWidth` x `ImageHeight` that stand beside them, or, as some writers have it, fractions of the
longer side; `PrincipalPointX/Y` are fractions of the size, the middle where they are missing. The table of distortions is left out:
what the phone's class may distort is in u.

Source: Dynamic Depth 1.0; `ImagingModelParams` of Android's library dynamic_depth (focal length "in pixels", principal point (0.5, 0.5)
unless given).
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ..hypothesis import Hypothesis
from ..metadata import positive
from ..photo import Photo
from ..tagged_size import tagged_size
from ..told_camera import told_camera

NAME = "google_tags"
PIXELS_U = 0.01
"""Relative u of a focal length in px: the phone's own, without its focus and its stabiliser."""
FRACTION_U = 0.03
"""And of one that is a fraction, of which side is not sure."""
MOST_FRACTION = 30.0


def camera(photo: Photo) -> Hypothesis:
    """The hypothesis, or its reason."""
    xmp = photo.metadata.xmp
    names = ("FocalLengthX", "FocalLengthY", "ImageWidth", "ImageHeight")
    fx, fy, width, height = (positive(xmp.get(f"ImagingModel:{name}")) for name in names)
    if fx is None or fy is None or width is None or height is None:
        return Hypothesis(NAME, None, "no imaging model by Google")
    now = photo.stored_size_px
    if abs(now[0] / now[1] / (width / height) - 1) > 0.02:
        text = f"Google's imaging model is for {width:g} x {height:g} px, of other proportions than the picture's"
        return Hypothesis(NAME, None, text)
    fraction = fx < MOST_FRACTION
    fx, fy = _in_px(fx, fy, width, height) if fraction else (fx, fy)
    if not 0.9 < fy / fx < 1.1:
        return Hypothesis(NAME, None, "the focal lengths of Google's imaging model contradict each other")
    size = tagged_size(photo)
    text = f"Google's imaging model: focal length {fx:.1f} px of {width:g}"
    relative = math.hypot(FRACTION_U if fraction else PIXELS_U, math.log(fy / fx) / 2)
    made = told_camera(photo, math.sqrt(fx * fy) * now[0] / width, relative, text, size)
    # the model is of the picture as it is, and has no mark of film or focus
    return Hypothesis(NAME, replace(made, nominal_focal_m=None, cov=np.array(made.cov), id=None), text, size.notes)


def _in_px(fx: float, fy: float, width: float, height: float) -> tuple[float, float]:
    """Fractions of the longer side where both are equal, and each of its own side where that makes them equal."""
    each, longer = (fx * width, fy * height), (fx * max(width, height), fy * max(width, height))
    return min(each, longer, key=lambda pair: abs(math.log(pair[1] / pair[0])))
