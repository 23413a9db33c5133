"""Camera from the intrinsic matrix that a HEIC may carry (box `cmin`), as Apple's phones write it for spatial photos.

The matrix is of the picture as it is looked at: `heif_boxes` takes it through the container's own turn and crop. Its origin is the
outer corner of the top-left pixel. Distortion is not part of it; phones correct it, within what is assumed of their class.

Source: ISO/IEC 23008-12, CameraIntrinsicMatrixProperty.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ..hypothesis import Hypothesis, unknown_lens
from ..lens_class import k1_u, lens_class
from ..photo import Photo

NAME = "heic_matrix"
FOCAL_U = 0.007
"""Relative u: a factory's calibration, moved by focus and stabiliser."""
CENTRE_U = 0.005
"""u of the principal point in picture widths."""
FOCAL_PER_DIAGONAL = (0.15, 60.0)


def camera(photo: Photo) -> Hypothesis:
    """The hypothesis, or its reason."""
    matrix = photo.metadata.intrinsic_matrix
    if matrix is None:
        return Hypothesis(NAME, None, "no camera matrix")
    fx, _, cx, _, fy, cy = matrix[:6]
    width, height = photo.width_px, photo.height_px
    diagonal = math.hypot(width, height)
    sane = FOCAL_PER_DIAGONAL[0] < fx / diagonal < FOCAL_PER_DIAGONAL[1] and fy > 0 and abs(fy / fx - 1) < 0.1
    if not sane or not (0 < cx < width and 0 < cy < height):
        return Hypothesis(NAME, None, f"the file's camera matrix (fx = {fx:.4g}, cx = {cx:.4g}) is of another picture")
    text = f"HEIC camera matrix: fx = {fx:.1f} px"
    tags = photo.metadata
    made = unknown_lens(
        width, height, fx, FOCAL_U * fx, text, k1_u=k1_u(tags, diagonal / 2 / fx), lens=lens_class(tags).title
    )
    cov = np.array(made.cov)
    cov[[2, 3], [2, 3]] = (CENTRE_U * width) ** 2
    sources = {"lens distortion": made.part_sources["lens distortion"]}
    made = replace(made, aspect=fy / fx, cx_px=cx - 0.5, cy_px=cy - 0.5, cov=cov, part_sources=sources, id=None)
    return Hypothesis(NAME, made, text)
