"""Camera from what a person types: `f=1500px`, `f=35mm,sensor=14.1mm`, `fov=70deg`, a preset or a sensor's name.

A bare ± is a 95 % half-width; what is said without one gets the defaults of `assumptions`. With the name or the width of
a sensor alone, the focal length is taken from the photo's metadata.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from .. import assumptions
from ..camera import Camera
from ..errors import InputError
from ..hypothesis import Hypothesis, unknown_lens
from ..lens_class import k1_u, lens_class
from ..photo import Photo
from ..presets import Preset, find_preset
from ..quantity import Note, Quantity
from ..tagged_size import tagged_size
from ..told_camera import told_camera

NAME = "typed"
CUT_U = 0.08
"""Relative u where a picture does not have its sensor's proportions: a 16:9 mode of a 4:3 sensor was seen 8 % off either way."""
SQUARISH, WIDE = 1.2, 1.6
"""Long side over short of pictures that have their sensor's usual proportions."""
KEYS = ("f", "sensor", "fov")


def camera(text: str, photo: Photo) -> Hypothesis:
    """The camera of this text for this photo.

    Raises:
        InputError: neither key=value pairs nor a known name, or something missing.
    """
    found = _from_pairs(text, photo) if "=" in text else _from_preset(text, photo)
    # a focal length in pixels is of the picture at hand; every other text is of the whole, unzoomed sensor
    notes = tagged_size(photo).notes if found.nominal_focal_m else ()
    if not _is_cut(text, photo):
        return Hypothesis(NAME, found, found.source, notes)
    return Hypothesis(NAME, _widened(found), found.source, (*notes, _cut_note(photo)))


def _from_pairs(text: str, photo: Photo) -> Camera:
    said = {}
    for pair in text.split(","):
        key, _, value = pair.partition("=")
        if key.strip() not in KEYS or key.strip() in said:
            raise InputError("--camera", text, "write f=1500px, or f=35mm,sensor=14.1mm, or fov=70deg")
        said[key.strip()] = value.strip()
    if set(said) == {"fov"}:
        return _from_field_of_view(said["fov"], photo)
    if set(said) == {"f"} and said["f"].rstrip(" )").lower().endswith(("px", "pixels", "pixel", "%", "exact")):
        return _from_pixels(said["f"], photo)
    if set(said) == {"f", "sensor"}:
        focal = Quantity.parse(said["f"], "m", bare="mm", name="--camera f", assume=assumptions.focal_length)
        sensor = Quantity.parse(said["sensor"], "m", bare="mm", name="--camera sensor", assume=assumptions.sensor_width)
        return _from_lengths(focal, sensor, photo, "focal length and sensor width as stated")
    if set(said) == {"sensor"}:
        sensor = Quantity.parse(said["sensor"], "m", bare="mm", name="--camera sensor", assume=assumptions.sensor_width)
        return _from_lengths(_tagged_focal(text, photo), sensor, photo, "sensor width as stated, EXIF focal length")
    raise InputError(
        "--camera", text, "write f=1500px, or f=35mm,sensor=14.1mm, or fov=70deg; a focal length in mm needs the sensor"
    )


def _from_pixels(text: str, photo: Photo) -> Camera:
    """A focal length in pixels is a calibrated one: without ± it is taken to 0.5 %."""

    def assume(value: float, _: float) -> Quantity:
        return Quantity.normal(value, 0.005 * value, "px", "assumed: 0.5 %")

    f = Quantity.parse(text, "px", name="--camera f", assume=assume)
    _above_zero("--camera f", f, text)
    return _of_this_picture(photo, float(f.value), float(f.u), f"focal length in pixels, {f.source}")


def _of_this_picture(photo: Photo, f_px: float, u_f_px: float, source: str, nominal_m: float | None = None) -> Camera:
    """A camera whose focal length is that of the upright picture, with the distortion that its class of lens may have."""
    corner = math.hypot(photo.width_px, photo.height_px) / 2 / f_px
    return unknown_lens(photo.width_px, photo.height_px, f_px, u_f_px, source, nominal_m,
                        k1_u=k1_u(photo.metadata, corner), lens=lens_class(photo.metadata).title)  # fmt: skip


def _from_field_of_view(text: str, photo: Photo) -> Camera:
    """The angle across the picture's width: f = W / (2 tan(angle / 2))."""
    fov = Quantity.parse(text, "rad", bare="deg", name="--camera fov", assume=assumptions.angle)
    angle = float(fov.value)
    if not 0.01 < angle < math.radians(175):
        raise InputError("--camera fov", text, "give the angle across the picture's width, 1 to 175 deg")
    f_px = photo.width_px / 2 / math.tan(angle / 2)
    u = float(fov.u) * photo.width_px / 4 / math.sin(angle / 2) ** 2
    return _of_this_picture(photo, f_px, math.hypot(u, assumptions.NOMINAL_FOCAL * f_px),
                            f"field of view across the width, {fov.source}",
                            photo.metadata.focal_mm / 1000 if photo.metadata.focal_mm else None)  # fmt: skip


def _from_lengths(focal: Quantity, sensor: Quantity, photo: Photo, source: str) -> Camera:
    """f_px = f * W / sensor width, W the whole picture's side that lies along the sensor's width; corrected for a digital zoom."""
    _above_zero("--camera f", focal, f"{float(focal.value)} m")
    _above_zero("--camera sensor", sensor, f"{float(sensor.value)} m")
    size = tagged_size(photo)
    f_px = float(focal.value) / float(sensor.value) * max(size.whole_px) * size.zoom
    relative = math.hypot(float(focal.u / focal.value), float(sensor.u / sensor.value))
    return replace(told_camera(photo, f_px, relative, source, size), nominal_focal_m=float(focal.value), id=None)


def _tagged_focal(text: str, photo: Photo) -> Quantity:
    if photo.metadata.focal_mm is None:
        raise InputError(
            "--camera", text, "the photo's metadata has no focal length; add it, as in f=35mm,sensor=14.1mm"
        )
    return assumptions.focal_length(photo.metadata.focal_mm / 1000, 5e-5)


def _from_preset(text: str, photo: Photo) -> Camera:
    preset = find_preset(text, "--camera")
    if preset.focal_length is None:
        made = _from_lengths(
            _tagged_focal(text, photo), preset.sensor_width, photo, f"preset {preset.name}, EXIF focal length"
        )
    else:
        made = _from_lengths(
            preset.focal_length, preset.sensor_width, photo, f"preset {preset.name}: the range of its class"
        )
    return made


def _cut_from(preset: Preset, photo: Photo) -> bool:
    """Whether the photo's proportions are not those of the preset's sensor: a mode that may use a part of it only."""
    if preset.sensor_height is None:
        return False
    long, short = max(photo.stored_size_px), min(photo.stored_size_px)
    return abs(long / short / float(preset.sensor_width.value / preset.sensor_height.value) - 1) > 0.04


def _is_cut(text: str, photo: Photo) -> bool:
    """Whether the text tells a sensor of other proportions than the photo's. Of a sensor's width alone they are taken as usual ones."""
    if "=" not in text:
        return _cut_from(find_preset(text, "--camera"), photo)
    long, short = max(photo.stored_size_px), min(photo.stored_size_px)
    return text.lstrip().startswith("sensor") and "," not in text and not SQUARISH <= long / short <= WIDE


def _widened(made: Camera) -> Camera:
    cov = np.array(made.cov)
    cov[0, 0] += (CUT_U * float(made.f_px)) ** 2
    return replace(made, cov=cov, id=None)


def _cut_note(photo: Photo) -> Note:
    size = f"{photo.width_px} x {photo.height_px} px"
    return Note("aspect_mismatch", f"a picture of {size} does not have the sensor's proportions: this mode of the camera may use "
                f"a part of the sensor only; u is widened by {100 * CUT_U:.0f} %", "calibrate the camera in this mode")  # fmt: skip


def _above_zero(name: str, quantity: Quantity, text: str) -> None:
    if not float(quantity.value) > 0:
        raise InputError(name, text, "give a number above 0")
