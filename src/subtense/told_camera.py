"""Told camera: from a focal length that a file tells to a Camera of the upright picture, with what is not told assumed.

Tags are in the frame the sensor stored. The camera is made there and turned as the picture is.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from .assumptions import UNKNOWN_CENTRE
from .camera import Camera
from .hypothesis import unknown_lens
from .lens_class import k1_u, lens_class
from .photo import Photo
from .quantity import Note
from .tagged_size import TaggedSize

SQUARE = 0.005
"""Pixels whose sides differ by less count as square."""
_TURNS = {1: 0, 2: 0, 3: 2, 4: 2, 5: 3, 6: 1, 7: 1, 8: 3}
"""Quarter turns clockwise by EXIF orientation, after the mirroring."""
_MIRRORED = (2, 4, 5, 7)


def told_camera(photo: Photo, f_px: float, relative_u: float, source: str, size: TaggedSize) -> Camera:
    """The camera of the upright picture.

    Args:
        photo: the picture.
        f_px: focal length along the stored width, of a still.
        relative_u: of it, with all but what `size` adds.
        source: what to call it.
        size: how the picture relates to the one that was taken.
    """
    width, height = photo.stored_size_px
    f = f_px * size.film
    corner = math.hypot(width, height) / 2 / f
    tags = photo.metadata
    nominal = tags.focal_mm / 1000 if tags.focal_mm else None
    made = unknown_lens(width, height, f, math.hypot(relative_u, size.relative_u) * f, source, nominal,
                        k1_u=k1_u(tags, corner), lens=lens_class(tags).title)  # fmt: skip
    cov = np.array(made.cov)
    aspect, aspect_u, _ = pixel_shape(photo)
    cov[1, 1] = aspect_u**2
    centre_u = math.hypot(UNKNOWN_CENTRE, size.centre_u)
    cov[[2, 3], [2, 3]] = (centre_u * max(width, height)) ** 2
    sources = {
        **made.part_sources,
        "principal point": f"assumed: the middle of the whole picture, to {100 * centre_u:.2g} % of the width",
    }
    made = replace(made, cx_px=size.middle_px[0], cy_px=size.middle_px[1], aspect=aspect, cov=cov, part_sources=sources)
    return upright_camera(made, tags.orientation)


def held_together(readings: Sequence[Camera]) -> Camera:
    """One camera with the mean focal length of several readings, and a u that has all of them within one of it."""
    f = [float(one.f_px) for one in readings]
    middle, half = (max(f) + min(f)) / 2, (max(f) - min(f)) / 2
    if not half:
        return readings[0]
    cov = np.array(readings[0].cov)
    cov[0, 0] = (readings[0].u_f_px * middle / f[0]) ** 2 + half**2
    return replace(readings[0], f_px=middle, cov=cov, id=None)


def pixel_shape(photo: Photo) -> tuple[float, float, tuple[Note, ...]]:
    """fy / fx in the stored frame, its u, and the note `nonsquare_pixels` where it is not 1.

    A density tag may be a slip of an editor, so a part of what it says stays in doubt.
    """
    tags = photo.metadata
    x, y = tags.focal_plane_x_per_mm, tags.focal_plane_y_per_mm
    told = [y / x if x and y else 1.0, tags.pixel_aspect or 1.0]
    aspect = max(told, key=lambda one: abs(math.log(one)))
    if abs(aspect - 1) <= SQUARE:
        return 1.0, 0.0, ()
    agree = abs(told[0] / told[1] - 1) < SQUARE
    doubt = (0.02 if agree else 0.3) * abs(aspect - 1)
    note = Note("nonsquare_pixels", f"a pixel is {aspect:.4g} times as wide as high, by the file's resolutions",
                "calibrate the camera, or resample the picture to square pixels")  # fmt: skip
    return aspect, doubt, (note,)


def upright_camera(camera: Camera, orientation: int) -> Camera:
    """The camera of the picture that the EXIF orientation makes of the stored one."""
    turned = _mirrored(camera) if orientation in _MIRRORED else camera
    return turned.rotated(_TURNS[orientation])


def _mirrored(camera: Camera) -> Camera:
    """Left and right exchanged: the principal point moves to the other side, and p2 changes its sign."""
    n = 4 + camera.coefficients.shape[-1]
    sign = np.ones(n)
    sign[2] = -1
    if camera.lens == "brown_conrady":
        sign[7] = -1
    cov = None if camera.cov is None else camera.cov * np.outer(sign, sign)
    return replace(
        camera,
        cx_px=camera.width_px - 1 - float(camera.cx_px),
        distortion=camera.coefficients * sign[4:],
        cov=cov,
        id=None,
    )
