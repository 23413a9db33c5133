"""What the routes of one server share."""

from __future__ import annotations

from dataclasses import dataclass
from hashlib import sha256

from fastapi import Request

from ..errors import InputError, UnknownCameraError
from ..workflow.resolve_camera import Resolved, SentFile, resolve_camera
from .children import Children
from .jobs import Jobs
from .models import Calibration
from .photos import Held, Photos
from .problems import AbsentError, LimitError
from .settings import Settings
from .uploads import shown_name


@dataclass
class State:
    """One server's settings, child processes, photos and jobs."""

    settings: Settings
    children: Children
    photos: Photos
    jobs: Jobs


def state_of(request: Request) -> State:
    """The state of the server that got a request."""
    found: State = request.app.state.subtense
    return found


def held(request: Request, photo: str) -> Held:
    """The photo of an id.

    Raises:
        AbsentError: there is none (any more).
    """
    found = state_of(request).photos.find(photo)
    if found is None:
        raise AbsentError("no such photo here; it may have been dropped, so send it again")
    return found


def camera_for(
    state: State, photo: Held, given: str | Calibration | None, *, ask_all: bool = False
) -> Resolved | UnknownCameraError:
    """The photo's camera, or why there is none; a text never names a file of this machine. `ask_all` as in `resolve_camera`.

    Raises:
        InputError, FileFormatError: `given` can't be used.
        LimitError: a calibration file that is too large.
    """
    most = state.settings.limits.calibration_bytes
    if isinstance(given, Calibration) and len(given.content.encode()) > most:
        raise LimitError("calibration_bytes", f"the calibration file is larger than {most} bytes (calibration_bytes)")
    key = sha256(repr((given, ask_all)).encode()).hexdigest()
    if key not in photo.cameras:
        sent = (
            SentFile(shown_name(given.name), given.content.encode())
            if isinstance(given, Calibration)
            else given or None
        )
        try:
            found: Resolved | UnknownCameraError = resolve_camera(photo.photo, sent, paths=False, ask_all=ask_all)
        except UnknownCameraError as error:
            found = error
        except InputError as error:
            raise InputError("camera", error.given, error.allowed) from None
        if len(photo.cameras) > 100:
            photo.cameras.clear()
        photo.cameras[key] = found
    return photo.cameras[key]  # type: ignore[no-any-return]
