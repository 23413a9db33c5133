"""Camera from a calibration file: a Camera in our own JSON, as `subtense camera PHOTO --format json` prints it."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..camera import Camera
from ..errors import FileFormatError, InputError
from ..hypothesis import Hypothesis, scaled_to
from ..photo import Photo
from ..quantity import Note

NAME = "calibration_file"
MOST_BYTES = 2**20
ASSUMED_FOCAL = 0.005
"""Relative u of the focal length of a calibration that does not tell it."""
ASSUMED_CENTRE = 0.005
"""u of its principal point, in picture widths."""


def camera(path: Path, photo: Photo, data: bytes | None = None) -> Hypothesis:
    """The file's camera for this photo.

    Args:
        path: the file, or only its name where `data` is given.
        photo: the picture.
        data: the file's content where it was sent rather than named; nothing is then read from the disk.

    Raises:
        FileFormatError: no such file, not a camera, or a camera of another picture size.
    """
    own = parse(path, _bytes(path) if data is None else data)
    doubtful = own.cov is None
    found = scaled_to(_with_assumed_u(own) if doubtful else own, photo)
    if isinstance(found, str):
        raise FileFormatError(path, f"{found}; calibrate at the photo's size or give a photo of the calibration's")
    camera, notes = found
    if doubtful:
        text = f"the calibration has no covariance; its focal length is taken to {ASSUMED_FOCAL:.1%}, its centre to {ASSUMED_CENTRE:.1%}"
        cure = "calibrate with a tool that tells it, or write a cov of zeros if it is exact"
        notes = (*notes, Note("calibration_without_uncertainty", text.replace("%", " %"), cure))
    return Hypothesis(NAME, camera, f"calibration file {path.name}", notes)


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


def parse(path: Path, content: bytes) -> Camera:
    """The camera in a file's content: the object itself, or one under "camera"; `path` is for messages."""
    if len(content) > MOST_BYTES:
        raise FileFormatError(path, f"is larger than {MOST_BYTES // 2**20} MiB, no calibration is")
    try:
        data: Any = json.loads(content.decode("utf-8"))
    except (ValueError, RecursionError):
        raise FileFormatError(
            path, "is not JSON; give a camera as `subtense camera PHOTO --format json` prints it (no YAML, XML)"
        ) from None
    if isinstance(data, dict) and isinstance(data.get("camera"), dict):
        data = data["camera"]
    if not isinstance(data, dict):
        raise FileFormatError(path, "holds no camera")
    for key in ("width_px", "height_px", "f_px", "cx_px", "cy_px"):
        if not isinstance(data.get(key), (int, float)) or isinstance(data.get(key), bool):
            raise FileFormatError(path, f"{key} is missing or no number")
    try:
        return Camera.from_json({"source": f"calibration file {path.name}", **data})
    except InputError as error:
        raise FileFormatError(path, str(error)) from None
    except (TypeError, ValueError):
        raise FileFormatError(path, "holds values of the wrong kind") from None
