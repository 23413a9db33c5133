"""Lens class: what kind of lens took a picture, as far as its metadata tells, and how much such a lens may distort.

A lens of which no coefficients are known is taken as free of distortion, with a u of k1 that holds what lenses of its class
do. A bound on k1 alone would be too small for a long lens, whose slopes are small: so it is at least what makes the class's
usual error in the picture's corner.

Source: `docs/camera.md`, distortion; the effect is k1 r^2 on a place and 3 k1 r^2 on a short radial length, r the slope of the
ray: k1 = -0.05 at r = 0.6 makes -1.8 % and -5.4 %, k1 = -0.25 at r = 1 makes -25 % and -75 %.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from .metadata import Metadata


@dataclass(frozen=True)
class LensClass:
    """One row of LENS_CLASSES.

    Attributes:
        title: the name people use.
        k1_u: u of the first radial coefficient.
        corner_u: relative error of a place in the corner that is usual at the least.
        makes: what the maker, model or lens is searched for, lower case.
    """

    title: str
    k1_u: float
    corner_u: float
    makes: re.Pattern[str]


def _row(title: str, k1_u: float, corner_u: float, words: str) -> LensClass:
    return LensClass(title, k1_u, corner_u, re.compile(rf"\b({words})"))


LENS_CLASSES: dict[str, LensClass] = {
    "action": _row("an action camera or fisheye", 0.25, 0.10,
                   "gopro|hero\\d|insta360|osmo action|ac00\\d|sjcam|yi action|akaso|virb|hdr-as|fdr-x\\d|contour|fish-?eye|ricoh theta"),
    "drone": _row("a drone's camera", 0.05, 0.01,
                  "dji|fc\\d{3,4}|parrot|anafi|autel|skydio|sensefly|micasense|rededge|altum|sequoia|yuneec|l1d-20c|zenmuse"),
    "phone": _row("a phone, corrected in the camera", 0.02, 0.005,
                  "apple|iphone|ipad|samsung|google|pixel|huawei|honor|xiaomi|redmi|poco|oneplus|oppo|vivo|realme|motorola|moto|"
                  "lge?|htc|nokia|hmd|asus|zte|meizu|nothing|fairphone|xperia|tcl|lenovo"),
    "industrial": _row("an industrial or board camera", 0.10, 0.02,
                       "raspberrypi|raspberry pi|basler|flir|point grey|ids|ueye|allied vision|ximea|lucid|baumer|teledyne|"
                       "matrix vision|daheng|hikrobot|e-con|arducam|logitech"),
    "unknown": _row("a lens of an unknown or usual kind", 0.05, 0.01, ""),
}  # fmt: skip
"""In the order they are asked. A maker of phones makes other cameras too: their lens has a name of its own."""
RAW_FACTOR = 2.0
"""A RAW has not been through the correction that the camera applies to its JPEG (several per cent are usual)."""


def lens_class(tags: Metadata) -> LensClass:
    """The class of a picture's lens."""
    said = " ".join(text for text in (tags.make, tags.model, tags.lens) if text).lower()
    for name, row in LENS_CLASSES.items():
        if said and row.makes.search(said) and not (name == "phone" and _interchangeable(tags)):
            return row
    return LENS_CLASSES["unknown"]


def is_phone(tags: Metadata) -> bool:
    """Whether a phone took it: several lenses behind one model name."""
    return lens_class(tags) is LENS_CLASSES["phone"]


def k1_u(tags: Metadata, half_diagonal: float) -> float:
    """u of k1 for a picture.

    Args:
        tags: of the picture.
        half_diagonal: slope of the ray to its corner: half the diagonal in px over the focal length in px.
    """
    row = lens_class(tags)
    own = max(row.k1_u, row.corner_u / max(half_diagonal, 0.02) ** 2)
    return own * RAW_FACTOR if tags.form == "RAW" else own


def _interchangeable(tags: Metadata) -> bool:
    """A focal length that no phone has: Samsung's and Google's makers' names are on other cameras too."""
    return bool(tags.focal_mm and tags.focal_mm >= 15 and (not tags.f35_mm or tags.f35_mm < 3 * tags.focal_mm))
