"""What a photo fills into the calculator: the camera side of the relation, with the camera's u."""

from __future__ import annotations

from ..photo import Photo
from ..quantity import Quantity
from .resolve_camera import Resolved

FULL_FRAME_M = 0.036


def calculator_of(photo: Photo, resolved: Resolved) -> dict[str, str]:
    """Texts for `focal`, `sensor_width` and `image_width` that give the camera's focal length in pixels.

    The relation needs the ratio of focal length and sensor width only. Where the photo tells its focal length, that is taken
    and the sensor's width carries the doubt; else the sensor is that of 35 mm film and the focal length carries it.
    """
    camera = resolved.camera
    relative = camera.u_f_px / float(camera.f_px)
    per_width = float(camera.f_px) / photo.width_px
    focal_m = photo.metadata.focal_mm / 1000 if photo.metadata.focal_mm else None
    if focal_m is not None:
        sensor = Quantity.normal(focal_m / per_width, relative * focal_m / per_width, "m")
        return {
            "focal": f"{focal_m * 1000:.6g} mm exact",
            "sensor_width": _text(sensor),
            "image_width": f"{photo.width_px} px exact",
        }
    focal = Quantity.normal(FULL_FRAME_M * per_width, relative * FULL_FRAME_M * per_width, "m")
    return {
        "focal": _text(focal),
        "sensor_width": f"{FULL_FRAME_M * 1000:g} mm exact",
        "image_width": f"{photo.width_px} px exact",
    }


def _text(quantity: Quantity) -> str:
    return f"{float(quantity.value) * 1000:.7g} ± {float(quantity.u) * 1000:.3g} mm (1s)"
