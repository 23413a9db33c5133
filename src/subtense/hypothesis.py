"""Hypothesis: what one camera source says, or why it can't say anything."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .assumptions import UNKNOWN_CENTRE, UNKNOWN_K1
from .camera import Camera
from .quantity import Note

if TYPE_CHECKING:
    from .photo import Photo


@dataclass(frozen=True)
class Hypothesis:
    """What one source says of the camera.

    Attributes:
        source: the key of CAMERA_SOURCES.
        camera: of the upright picture; None where the source has nothing.
        reason: how it was had, or why it was not.
        notes: doubts.
    """

    source: str
    camera: Camera | None
    reason: str
    notes: tuple[Note, ...] = ()

    @property
    def relative_u(self) -> float:
        """Relative u of the focal length; infinite without a camera."""
        return self.camera.u_f_px / float(self.camera.f_px) if self.camera else math.inf


_ASSUMED = {
    "principal point": f"assumed: the middle of the picture, to {UNKNOWN_CENTRE:.0%} of its width".replace("%", " %"),
    "lens distortion": f"assumed: none, k1 to {UNKNOWN_K1}",
}


def unknown_lens(
    width_px: int, height_px: int, f_px: float, u_f_px: float, source: str, nominal_focal_m: float | None = None
) -> Camera:
    """A camera of which only the focal length is known: the rest is assumed, with its u.

    The principal point is the picture's middle, and the distortion k1 = 0, both doubtful (see `assumptions`).
    """
    cov = np.zeros((9, 9))
    centre = UNKNOWN_CENTRE * max(width_px, height_px)
    cov[[0, 2, 3, 4], [0, 2, 3, 4]] = u_f_px**2, centre**2, centre**2, UNKNOWN_K1**2
    return Camera(width_px, height_px, f_px, (width_px - 1) / 2, (height_px - 1) / 2, lens="brown_conrady", cov=cov,
                  source=source, nominal_focal_m=nominal_focal_m, part_sources=_ASSUMED)  # fmt: skip


def scaled_to(camera: Camera, photo: Photo) -> tuple[Camera, tuple[Note, ...]] | str:
    """The camera for a photo of another size and the same proportions, or why that can't be."""
    size = (photo.width_px, photo.height_px)
    if (camera.width_px, camera.height_px) == size:
        return camera, ()
    was = f"{camera.width_px} x {camera.height_px} px"
    sx, sy = size[0] / camera.width_px, size[1] / camera.height_px
    if abs(sx / sy - 1) > 0.005:
        turned = " (it is turned by a quarter)" if size == (camera.height_px, camera.width_px) else ""
        return f"it is for {was}, and the photo has {size[0]} x {size[1]} px{turned}"
    note = Note("calibration_size_mismatch", f"the camera is for {was}; it was scaled to the photo's size, which is right if "
                "the photo was resized and wrong if another mode of the camera took it", "calibrate at this size")  # fmt: skip
    return camera.resized(*size), (note,)
