"""What is assumed where nobody said how well a number is known: honest, listed, and marked "assumed" in every budget.

Each function takes the number and half its last written digit, in SI units or pixels, as `Quantity.parse` gives them.
"""

from __future__ import annotations

import math

from .quantity import Quantity

CLICK_SIGMA_PX = 0.7
"""Standard deviation of a clicked end, per coordinate, where nothing was said."""
NOMINAL_FOCAL = 0.015
"""Relative u of a focal length as engraved or written into a picture: makers round, and it holds at infinity."""
REAL_SIZE = 0.005
"""Relative u of the real size of an object."""
TILT_LIMIT_RAD = math.radians(20.0)
"""How far an object that seems to face the camera may be turned."""
UNKNOWN_TILT = "assumed: within"
"""How the source of a tilt begins of which nothing was said."""
UNKNOWN_K1 = 0.05
"""u of the first radial distortion coefficient of a lens of which nothing is known; `lens_class` tells better."""
UNKNOWN_CENTRE = 0.01
"""u of the principal point in picture widths, where the picture's middle stands for it."""
ROUNDED = math.sqrt(3.0)
"""A last digit's half, divided by this, is its u."""


def focal_length(value: float, half_digit: float) -> Quantity:
    """A nominal focal length: 1.5 % besides its rounding."""
    u = math.hypot(NOMINAL_FOCAL * value, half_digit / ROUNDED)
    return Quantity(value, u, "m", source="assumed: nominal focal length, 1.5 % and its rounding")


def sensor_width(value: float, half_digit: float) -> Quantity:
    """A sensor's width, height or diagonal: half its last digit, as limits."""
    return Quantity.uniform(value - half_digit, value + half_digit, "m", "assumed: half its last digit")


def size(value: float, _: float) -> Quantity:
    """The real size of an object, or a distance that was measured: 0.5 %."""
    return Quantity.normal(value, REAL_SIZE * abs(value), "m", "assumed: 0.5 %")


def extent(value: float, _: float) -> Quantity:
    """A length in the picture between two clicked ends: 0.7 px each."""
    text = f"assumed: two ends clicked to {CLICK_SIGMA_PX} px each"
    return Quantity.normal(value, CLICK_SIGMA_PX * math.sqrt(2.0), "px", text)


def count(value: float, _: float) -> Quantity:
    """A number of pixels: exact."""
    return Quantity.exact(value, "px", "a count")


def ratio(value: float, _: float) -> Quantity:
    """A pixel aspect ratio: exact."""
    return Quantity.exact(value, "1", "stated")


def angle(value: float, half_digit: float) -> Quantity:
    """A stated angle: half its last digit, as limits."""
    return Quantity.uniform(value - half_digit, value + half_digit, "rad", "assumed: half its last digit")


def frontal() -> Quantity:
    """An object that faces the camera."""
    return Quantity.exact(0.0, "rad", "assumed: the object faces the camera")


def unknown_tilt() -> Quantity:
    """The tilt of an object of which nothing was said: within 20 degrees either way."""
    text = f"{UNKNOWN_TILT} 20° of facing the camera"
    return Quantity.uniform(-TILT_LIMIT_RAD, TILT_LIMIT_RAD, "rad", text)


LISTED: tuple[tuple[str, str], ...] = (
    ("nominal focal length", "1.5 % (1s), besides its rounding (half the last digit, as limits)"),
    ("35 mm equivalent", "its rounding (±0.5 mm, as limits) and 2 % (1s) for the maker's rule"),
    ("sensor width, height, diagonal", "half the last digit, as limits"),
    ("preset", "its range, as limits"),
    ("clicked end", f"{CLICK_SIGMA_PX} px (1s) per coordinate"),
    ("real size", "0.5 % (1s)"),
    ("tilt of an object in a photo", "within 20° either way, as limits; `calc` takes it as facing the camera"),
    ("focus extension of a nominal focal length", "`measure` adds all of the thin-lens value and takes as much for its u; "
     "`calc` leaves it out and takes its full size as a one-sided limit"),
    ("lens distortion of a camera known from metadata only", f"k1 = 0 with u = {UNKNOWN_K1}; phone 0.02, industrial 0.1, action 0.25"),
    ("principal point of such a camera", "the middle of the picture, 1 % of its width (1s)"),
    ("slope of the ground", "0, 1 % (1s) each way"),
    ("roll of a camera above the ground", "0, 1.5° (1s), where neither file nor person tells it"),
    ("ground seen by a drone", "as high as its take-off, 3 m (1s)"),
    ("refraction of light along the ground", "k = 0.13, as much for its u"),
    ("what was marked as the horizon", "between a vanishing line and the visible horizon, as limits"),
    ("readout of a rolling shutter", "up to 60 ms either way, as limits"),
    ("counts of pixels", "exact"),
)  # fmt: skip
"""Every default, as the documentation prints it."""
