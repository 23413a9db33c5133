"""Camera from the XMP namespace `Camera` of Pix4D, which Parrot, senseFly and MicaSense write.

Focal length and principal point are in mm on the sensor, the point from the top-left corner; R1 R2 R3 T1 T2 of `PerspectiveDistortion` are
OpenCV's k1 k2 k3 p1 p2. Pixels per mm come from the EXIF focal-plane resolution; without it, from the principal point, which lies
near the sensor's middle. A fisheye is given by C, D, E, F in px and a polynomial rho = p0 + p1 t + p2 t^2 + p3 t^3 of
t = 2 / pi * angle; our lens has odd powers of the angle only and is fitted to it over the picture.

Source: Pix4D, "Specifications of xmp.camera tags" and "How are the internal and external camera parameters defined?". In the drawing of
the latter the origin is the lower-left corner, so cy of other makers than MicaSense carries a u that holds both.
"""

from __future__ import annotations

import math

import numpy as np

from ..arrays import Array
from ..camera import Camera
from ..hypothesis import Hypothesis
from ..lens_class import k1_u
from ..metadata import number, positive
from ..photo import Photo
from ..tagged_size import TaggedSize, tagged_size
from ..told_camera import upright_camera

NAME = "pix4d_tags"
FOCAL_U = 0.003
"""Relative u of a focal length calibrated at the factory."""
GUESSED_PITCH_U = 0.02
"""Relative u of the pixels per mm where they are had from the principal point."""
CENTRE_U = 0.002
K1_U = 0.01
FISHEYE_U = 0.005


def camera(photo: Photo) -> Hypothesis:
    """The hypothesis, or its reason."""
    xmp = photo.metadata.xmp
    size = tagged_size(photo)
    point = _numbers(xmp.get("Camera:PrincipalPoint", ""))
    if len(point) != 2 or min(point) <= 0:
        return Hypothesis(NAME, None, "no calibration in Pix4D's namespace")
    per_mm, guessed = _per_mm(photo, size, point)
    if xmp.get("Camera:ModelType", "perspective").lower() == "fisheye":
        made = _fisheye(photo, size, point, per_mm)
        text = "XMP Camera: fisheye calibration of the factory"
        reason = "the fisheye calibration in Pix4D's namespace is not one of a round lens"
        return Hypothesis(NAME, made, text, size.notes) if made else Hypothesis(NAME, None, reason)
    focal = positive(xmp.get("Camera:PerspectiveFocalLength"))
    if focal is None or xmp.get("Camera:PerspectiveFocalLengthUnits", "mm").lower() != "mm":
        return Hypothesis(NAME, None, "Pix4D's namespace has no focal length in mm")
    text = f"XMP Camera: calibrated focal length of {focal:g} mm" + (
        ", pixels per mm by the principal point" if guessed else ""
    )
    return Hypothesis(NAME, _perspective(photo, size, focal, point, per_mm, guessed, text), text, size.notes)


def _per_mm(photo: Photo, size: TaggedSize, point: list[float]) -> tuple[float, bool]:
    """Pixels of now per mm, and whether that is a guess."""
    told = photo.metadata.focal_plane_x_per_mm
    if told:
        return told * size.scale, False
    return size.whole_px[0] / 2 / point[0], True


def _perspective(
    photo: Photo, size: TaggedSize, focal_mm: float, point: list[float], per_mm: float, guessed: bool, text: str
) -> Camera:
    width, height = photo.stored_size_px
    f_px = focal_mm * per_mm * size.zoom * size.film
    r = _numbers(photo.metadata.xmp.get("Camera:PerspectiveDistortion", ""))
    k = np.array([r[0], r[1], r[3], r[4], r[2]]) if len(r) == 5 else np.zeros(5)
    cov = np.zeros((9, 9))
    cov[0, 0] = (math.hypot(FOCAL_U, GUESSED_PITCH_U if guessed else 0.0, size.relative_u) * f_px) ** 2
    cx, cy, cov[2, 2], cov[3, 3] = _centre(photo, size, point, per_mm)
    cov[4, 4] = (K1_U if len(r) == 5 else k1_u(photo.metadata, math.hypot(width, height) / 2 / f_px)) ** 2
    made = Camera(width, height, f_px, cx, cy, lens="brown_conrady", distortion=k, cov=cov, source=text)
    return upright_camera(made, photo.metadata.orientation)


def _centre(photo: Photo, size: TaggedSize, point: list[float], per_mm: float) -> tuple[float, float, float, float]:
    """Principal point and its variances, px. What is cut off moves it as it moves the whole picture's middle."""
    offset = [point[i] * per_mm - size.whole_px[i] / 2 for i in (0, 1)]
    u = math.hypot(CENTRE_U, size.centre_u) * photo.stored_size_px[0]
    lower_left = 0.0 if "micasense" in (photo.metadata.make or "").lower() else 2 * abs(offset[1])
    return size.middle_px[0] + offset[0], size.middle_px[1] + offset[1], u**2, math.hypot(u, lower_left) ** 2


def _fisheye(photo: Photo, size: TaggedSize, point: list[float], per_mm: float) -> Camera | None:
    """Our fisheye, fitted to theirs by least squares over the angles that the picture shows."""
    xmp = photo.metadata.xmp
    affine, polynomial = (_numbers(xmp.get(f"Camera:Fisheye{part}", "")) for part in ("AffineMatrix", "Polynomial"))
    if len(affine) != 4 or len(polynomial) != 4 or min(affine[0], affine[3]) <= 0:
        return None
    if abs(affine[3] / affine[0] - 1) > 0.05 or max(abs(affine[1]), abs(affine[2])) > 0.01 * affine[0]:
        return None
    width, height = photo.stored_size_px
    radius_px = affine[0] * size.scale
    angle = np.linspace(0.01, math.pi / 2, 200)
    rho_px = radius_px * np.polynomial.polynomial.polyval(2 / math.pi * angle, polynomial)
    seen = (rho_px <= 0.55 * math.hypot(width, height)) & (np.gradient(rho_px) > 0)
    f_px, k = _odd_powers(angle[seen], rho_px[seen]) if seen.sum() > 20 else (0.0, np.zeros(4))
    if f_px <= 0:
        return None
    cov = np.zeros((8, 8))
    cov[0, 0] = (math.hypot(FISHEYE_U, size.relative_u) * f_px) ** 2
    cx, cy, cov[2, 2], cov[3, 3] = _centre(photo, size, point, per_mm)
    made = Camera(width, height, f_px, cx, cy, aspect=affine[3] / affine[0], lens="fisheye", distortion=k, cov=cov,
                  source="XMP Camera: fisheye calibration of the factory")  # fmt: skip
    return upright_camera(made, photo.metadata.orientation)


def _odd_powers(angle_rad: Array, radius_px: Array) -> tuple[float, Array]:
    """f and k of radius = f (angle + k1 angle^3 + ... + k4 angle^9)."""
    powers = angle_rad[:, None] ** np.array([1, 3, 5, 7, 9])
    found = np.linalg.lstsq(powers, radius_px, rcond=None)[0]
    return float(found[0]), found[1:] / found[0]


def _numbers(text: str) -> list[float]:
    """Numbers between commas; empty where one is none."""
    found = [number(word) for word in text.split(",")]
    return [one for one in found if one is not None] if all(one is not None for one in found) else []
