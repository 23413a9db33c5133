"""Camera from a calibration file, in any of the formats of `camera_files`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from ..camera import Camera
from ..camera_files import formats
from ..camera_files.reading import MOST_BYTES, Found
from ..camera_files.selector import NOTHING, Pick
from ..errors import FileFormatError
from ..hypothesis import Hypothesis, scaled_to
from ..photo import Photo
from ..quantity import Note

NAME = "calibration_file"
ASSUMED_FOCAL = 0.005
"""Relative u of the focal length of a calibration that does not tell it."""
ASSUMED_CENTRE = 0.005
"""u of its principal point, in picture widths."""


def camera(path: Path, photo: Photo, data: bytes | None = None, pick: Pick = NOTHING) -> Hypothesis:
    """The file's camera for this photo.

    Args:
        path: the file, or only its name where `data` is given.
        photo: the picture.
        data: the file's content where it was sent rather than named; nothing is then read from the disk.
        pick: what was said beside the file: which of its cameras, the size of its pictures.

    Raises:
        FileFormatError: no such file, not a camera, or a camera of another picture size.
    """
    said = read(path, pick) if data is None else formats.read(path, data, pick)
    doubtful = said.camera.cov is None
    found = scaled_to(_with_assumed_u(said.camera) if doubtful else said.camera, photo, said.frame)
    if isinstance(found, str):
        raise FileFormatError(path, f"{found}; calibrate at the photo's size or give a photo of the calibration's")
    camera, notes = found
    if doubtful:
        text = f"the calibration has no covariance; its focal length is taken to {ASSUMED_FOCAL:.1%}, its centre to {ASSUMED_CENTRE:.1%}"
        cure = "calibrate with a tool that tells it, or write a cov of zeros if it is exact"
        notes = (*notes, Note("calibration_without_uncertainty", text.replace("%", " %"), cure))
    return Hypothesis(NAME, camera, f"calibration file {path.name}", (*said.notes, *notes))


def read(path: Path, pick: Pick = NOTHING, form: str | None = None) -> Found:
    """What a file says.

    Args:
        path: the file.
        pick: what was said beside it.
        form: a key of FORMATS; None to be told by the content.

    Raises:
        FileFormatError: no such file, or not a camera.
    """
    return formats.read(path, _bytes(path), pick, form)


def _with_assumed_u(camera: Camera) -> Camera:
    cov = np.zeros((4 + camera.coefficients.shape[-1],) * 2)
    cov[0, 0] = (ASSUMED_FOCAL * float(camera.f_px)) ** 2
    cov[2, 2] = cov[3, 3] = (ASSUMED_CENTRE * camera.width_px) ** 2
    return replace(camera, cov=cov, source=f"{camera.source}; u assumed", id=None)


def _bytes(path: Path) -> bytes:
    if not path.is_file():
        raise FileFormatError(path, "no such file")
    with path.open("rb") as file:
        return file.read(MOST_BYTES + 1)
