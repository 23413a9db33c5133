"""What the routes of one server share."""

from __future__ import annotations

from dataclasses import dataclass

from fastapi import Request

from ..errors import InputError, UnknownCameraError
from ..workflow.resolve_camera import Resolved, SentFile, resolve_camera
from .children import Children
from .jobs import Jobs
from .models import Calibration
from .photos import Held, Photos
from .problems import AbsentError
from .settings import Settings


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


def camera_for(photo: Held, given: str | Calibration | None) -> Resolved | UnknownCameraError:
    """The photo's camera, or why there is none; a text never names a file of this machine."""
    key = repr(given)
    if key not in photo.cameras:
        sent = SentFile(given.name, given.content.encode()) if isinstance(given, Calibration) else given or None
        try:
            found: Resolved | UnknownCameraError = resolve_camera(photo.photo, sent, paths=False)
        except UnknownCameraError as error:
            found = error
        except InputError as error:
            raise InputError("camera", error.given, error.allowed) from None
        if len(photo.cameras) > 100:
            photo.cameras.clear()
        photo.cameras[key] = found
    return photo.cameras[key]  # type: ignore[no-any-return]
