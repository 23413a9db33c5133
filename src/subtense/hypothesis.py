"""Hypothesis: what one camera source says, or why it can't say anything."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .assumptions import UNKNOWN_CENTRE, UNKNOWN_K1
from .camera import Camera
from .errors import InputError
from .quantity import Note

if TYPE_CHECKING:
    from .photo import Photo
    from .told_pose import ToldPose


SAME_PROPORTIONS = 0.005
"""Two sizes are taken as one picture, resized, where width / height differs by no more than that."""


@dataclass(frozen=True)
class Hypothesis:
    """What one source says of the camera.

    Attributes:
        source: the key of CAMERA_SOURCES.
        camera: of the upright picture; None where the source has nothing.
        reason: how it was had, or why it was not.
        notes: doubts.
        either: where the tags may be read in two ways, a camera for each; `camera` then holds both in its u.
        pose: how the camera stood, where the source tells it too.
    """

    source: str
    camera: Camera | None
    reason: str
    notes: tuple[Note, ...] = ()
    either: tuple[Camera, ...] = ()
    pose: ToldPose | None = None

    @property
    def relative_u(self) -> float:
        """Relative u of the focal length; infinite without a camera."""
        return self.camera.u_f_px / float(self.camera.f_px) if self.camera else math.inf


ASSUMED_DISTORTION = "assumed: none"
"""How the source of a distortion begins of which nothing is known."""
_CENTRE = f"assumed: the middle of the picture, to {UNKNOWN_CENTRE:.0%} of its width".replace("%", " %")


def unknown_lens(
    width_px: int, height_px: int, f_px: float, u_f_px: float, source: str, nominal_focal_m: float | None = None, *,
    k1_u: float = UNKNOWN_K1, lens: str = "",
) -> Camera:  # fmt: skip
    """A camera of which only the focal length is known: the rest is assumed, with its u.

    The principal point is the picture's middle, and the distortion k1 = 0, both doubtful (see `assumptions`).

    Args:
        width_px: picture width.
        height_px: picture height.
        f_px: focal length.
        u_f_px: its u.
        source: what to call it.
        nominal_focal_m: where f_px stands for focus at infinity.
        k1_u: u of k1, as the lens's class has it (see `lens_class`).
        lens: what kind of lens that is.
    """
    cov = np.zeros((9, 9))
    centre = UNKNOWN_CENTRE * max(width_px, height_px)
    cov[[0, 2, 3, 4], [0, 2, 3, 4]] = u_f_px**2, centre**2, centre**2, k1_u**2
    distortion = f"{ASSUMED_DISTORTION}, k1 to {k1_u:.2g}" + (f" ({lens})" if lens else "")
    return Camera(width_px, height_px, f_px, (width_px - 1) / 2, (height_px - 1) / 2, lens="brown_conrady", cov=cov,
                  source=source, nominal_focal_m=nominal_focal_m,
                  part_sources={"principal point": _CENTRE, "lens distortion": distortion})  # fmt: skip


_TURNS = {1: 0, 3: 2, 6: 1, 8: 3}
"""Clockwise quarter turns from the stored picture to the upright one, by EXIF orientation; the others mirror it."""


def scaled_to(camera: Camera, photo: Photo, frame: str = "") -> tuple[Camera, tuple[Note, ...]] | str:
    """The camera for a photo that is turned, or of another size and the same proportions; or why that can't be.

    Args:
        camera: of a calibration.
        photo: the picture.
        frame: "stored" where the calibration is of pictures before their EXIF orientation, "upright" where of those after
            it; empty to go by the size: the upright picture's, else that of the stored one.
    """
    size = (photo.width_px, photo.height_px)
    stored = frame == "stored" or (not frame and not _alike(camera, size) and _alike(camera, photo.stored_size_px))
    turned: tuple[Note, ...] = ()
    if stored and photo.metadata.orientation != 1:
        upright = _turned(camera, photo.metadata.orientation)
        if isinstance(upright, str):
            return upright
        camera, turned = upright
        if frame == "stored":  # the file says so itself: no doubt to note
            turned = ()
    if (camera.width_px, camera.height_px) == size:
        return camera, turned
    was = f"{camera.width_px} x {camera.height_px} px"
    if not _alike(camera, size):
        other = " (it is turned by a quarter)" if size == (camera.height_px, camera.width_px) else ""
        return f"it is for {was}, and the photo has {size[0]} x {size[1]} px{other}"
    note = Note("calibration_size_mismatch", f"the camera is for {was}; it was scaled to the photo's size, which is right if "
                "the photo was resized and wrong if another mode of the camera took it", "calibrate at this size")  # fmt: skip
    return camera.resized(*size), (*turned, note)


def _alike(camera: Camera, size_px: tuple[int, int]) -> bool:
    """Whether a size has the proportions of the camera's."""
    return abs(size_px[0] * camera.height_px / (size_px[1] * camera.width_px) - 1) <= SAME_PROPORTIONS


def _turned(camera: Camera, orientation: int) -> tuple[Camera, tuple[Note, ...]] | str:
    """A camera of stored pictures, turned as the photo was."""
    if orientation not in _TURNS:
        return f"it is for the picture as stored, and the photo's orientation ({orientation}) mirrors that"
    try:
        turned = camera.rotated(_TURNS[orientation])
    except InputError as error:
        return f"it is for the picture as stored and can't be turned: {error}"
    degrees = 90 * _TURNS[orientation]
    text = f"the camera is for the picture as stored; it was turned by {degrees}° as the photo's orientation says"
    return turned, (Note("calibration_turned", text, "none is needed if the calibration's pictures were not turned"),)
