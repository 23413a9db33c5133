"""Camera from the calibration that DJI writes into the XMP of a drone's photo.

`DewarpData` is "date;fx,fy,cx,cy,k1,k2,p1,p2,k3": the unit's own calibration, focal lengths in px, the principal point as an offset
in px from the picture's centre, and OpenCV's distortion coefficients. `DewarpFlag` tells whether the camera has applied them: 1, and
the picture is free of distortion; 0, and they hold. Where it is missing both may be, and both are in u.
`CalibratedFocalLength` is the design's focal length in px, and `CalibratedOpticalCenterX/Y` the design's centre, half the size that
these numbers are for, counted from the outer corner of the top-left pixel.

Source: DJI Mavic 3M User Manual p. 90 and Matrice 4 Series User Manual p. 90 f. (parameter sequence, "origin point: photo center",
"designed focal length"); DJI Mavic 3M Image Processing Guide, step 2 (camera matrix [fx, 0, CenterX + cx; ...], OpenCV's undistort).
"""

from __future__ import annotations

import numpy as np

from ..arrays import Array
from ..camera import Camera
from ..hypothesis import Hypothesis
from ..metadata import number, positive
from ..photo import Photo
from ..tagged_size import TaggedSize, tagged_size
from ..told_camera import told_camera, upright_camera

NAME = "dji_tags"
DESIGN_U = 0.01
"""Relative u of the design's focal length: units were seen 0.2 and 0.5 % off."""
UNIT_U = 0.003
"""Relative u of the unit's own focal length, which temperature and focus move."""
DEWARPED_U = 0.01
"""The same where the camera has straightened the picture: it may have scaled it."""
CENTRE_U = 0.0015
"""u of the principal point in picture widths."""
K1_U = 0.01


def camera(photo: Photo) -> Hypothesis:
    """The hypothesis, or its reason."""
    xmp = photo.metadata.xmp
    size = tagged_size(photo)
    scale = _scale(photo, size)
    if isinstance(scale, str):
        return Hypothesis(NAME, None, scale)
    unit = _dewarp_data(xmp.get("drone-dji:DewarpData", ""))
    if unit is not None:
        found, text = _of_unit(photo, size, unit, scale)
        return Hypothesis(NAME, found, text, size.notes)
    design = positive(xmp.get("drone-dji:CalibratedFocalLength"))
    if design is None:
        return Hypothesis(NAME, None, "no calibration by DJI")
    text = f"DJI: the design's focal length of {design:g} px"
    made = told_camera(photo, design * scale * size.zoom, DESIGN_U, text, size)
    return Hypothesis(NAME, made, text, size.notes)


def _scale(photo: Photo, size: TaggedSize) -> float | str:
    """Pixels now per pixel of the calibration, or why that is not known."""
    xmp = photo.metadata.xmp
    x, y = (positive(xmp.get(f"drone-dji:CalibratedOpticalCenter{axis}")) for axis in "XY")
    if x is None or y is None:
        return size.scale
    now, then = size.whole_px, (2 * x, 2 * y)
    across, down = now[0] / then[0], now[1] / then[1]
    if abs(across / down - 1) < 0.05:
        # the centre is not quite in the middle of every model: where the tagged size agrees, it is what counts
        return size.scale if abs(across / size.scale - 1) < 0.1 else across
    return (
        f"DJI's calibration is for {then[0]:.0f} x {then[1]:.0f} px, and the picture has {now[0]:.0f} x {now[1]:.0f} px"
    )


def _dewarp_data(text: str) -> list[float] | None:
    """The nine numbers; None where they are not there or make no camera."""
    numbers = [number(word) for word in text.rpartition(";")[2].split(",")]
    if len(numbers) < 9 or any(one is None for one in numbers[:9]):
        return None
    found = [float(one) for one in numbers[:9] if one is not None]
    plausible = 50 < found[0] < 1e6 and abs(found[1] / found[0] - 1) < 0.05 and all(abs(k) < 5 for k in found[4:])
    return found if plausible else None


def _of_unit(photo: Photo, size: TaggedSize, unit: list[float], scale: float) -> tuple[Camera, str]:
    fx, fy, cx, cy, *k = unit
    flag = photo.metadata.xmp.get("drone-dji:DewarpFlag")
    share, doubt = {"0": (1.0, 0.0), "1": (0.0, 0.0)}.get(flag or "", (0.5, 0.5))
    f_px = fx * scale * size.zoom
    applied = {"0": "not applied", "1": "applied by the camera"}.get(flag or "", "applied or not, which is not told")
    text = f"DJI: this unit's calibration of {fx:.2f} px, its distortion {applied}"
    width, height = photo.stored_size_px
    relative = float(np.hypot(UNIT_U if flag == "0" else DEWARPED_U, size.relative_u))
    centre = float(np.hypot(CENTRE_U, size.centre_u)) * width
    offset = np.array([cx, cy]) * scale * size.zoom
    moved = 0.0 if flag == "0" else 0.5  # a straightened picture may have been centred
    made = Camera(
        width, height, f_px * size.film, size.middle_px[0] + offset[0] * (1 - moved), size.middle_px[1] + offset[1] * (1 - moved),
        aspect=fy / fx, lens="brown_conrady", distortion=np.array(k) * share, source=text,
        cov=_covariance(relative * f_px * size.film, np.hypot(centre, offset * moved), np.array(k) * doubt),
    )  # fmt: skip
    return upright_camera(made, photo.metadata.orientation), text


def _covariance(u_f_px: float, u_centre_px: Array, k_doubt: Array) -> Array:
    cov = np.zeros((9, 9))
    cov[0, 0] = u_f_px**2
    cov[[2, 3], [2, 3]] = u_centre_px**2
    cov[4:, 4:] = np.outer(k_doubt, k_doubt)  # all of them or none were applied
    cov[4, 4] += K1_U**2
    return cov
