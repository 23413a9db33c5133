"""Camera from a calibration file: a Camera in our own JSON, as `subtense camera PHOTO --format json` prints it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from ..camera import Camera
from ..errors import FileFormatError, InputError
from ..hypothesis import Hypothesis, scaled_to
from ..photo import Photo

NAME = "calibration_file"
MOST_BYTES = 2**20


def camera(path: Path, photo: Photo) -> Hypothesis:
    """The file's camera for this photo.

    Raises:
        FileFormatError: no such file, not a camera, or a camera of another picture size.
    """
    found = scaled_to(read(path), photo)
    if isinstance(found, str):
        raise FileFormatError(path, f"{found}; calibrate at the photo's size or give a photo of the calibration's")
    camera, notes = found
    return Hypothesis(NAME, camera, f"calibration file {path.name}", notes)


def read(path: Path) -> Camera:
    """The camera in a file: the object itself, or one under "camera"."""
    if not path.is_file():
        raise FileFormatError(path, "no such file")
    if path.stat().st_size > MOST_BYTES:
        raise FileFormatError(path, f"is larger than {MOST_BYTES // 2**20} MiB, no calibration is")
    try:
        data: Any = json.loads(path.read_text("utf-8"))
    except (ValueError, RecursionError):
        raise FileFormatError(
            path, "is not JSON; give a camera as `subtense camera PHOTO --format json` prints it"
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
