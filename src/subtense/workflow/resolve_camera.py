"""Which camera took this photo: every source asked, the best taken, the others compared with it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..camera import Camera
from ..camera_files import selector
from ..camera_files.formats import ENDINGS
from ..camera_sources import calibration_file, exif_35mm, exif_focal_plane, typed
from ..errors import InputError, UnknownCameraError
from ..hypothesis import Hypothesis
from ..photo import Photo
from ..quantity import Note

CAMERA_SOURCES: dict[str, Callable[[Photo], Hypothesis]] = {
    exif_focal_plane.NAME: exif_focal_plane.camera,
    exif_35mm.NAME: exif_35mm.camera,
}
"""Sources that need nothing but the photo, in order of trust where their u is equal."""

WHAT_TO_GIVE = "give --camera: a calibration file, f=1500px, f=35mm,sensor=14.1mm, fov=70deg, or a preset"
AGREE_WITHIN = 2.0
"""Two sources contradict each other where their logarithms differ by more than so many combined u."""


@dataclass(frozen=True)
class SentFile:
    """A calibration file that was sent rather than named.

    Attributes:
        name: for messages.
        content: its bytes.
    """

    name: str
    content: bytes


@dataclass(frozen=True)
class Resolved:
    """The camera, and what every source said.

    Attributes:
        camera: of the upright photo.
        chosen: the hypothesis it comes from.
        hypotheses: all, the chosen one among them.
        notes: doubts about the camera.
    """

    camera: Camera
    chosen: Hypothesis
    hypotheses: tuple[Hypothesis, ...]
    notes: tuple[Note, ...]

    def to_json(self) -> dict[str, Any]:
        """The camera with its u and what the other sources said."""
        said = [
            {"source": h.source, "f_px": float(h.camera.f_px) if h.camera else None,
             "u_f_px": h.camera.u_f_px if h.camera else None, "text": h.reason, "chosen": h is self.chosen}
            for h in self.hypotheses
        ]  # fmt: skip
        return {**self.camera.to_json(), "u_f_px": self.camera.u_f_px, "hypotheses": said}


def resolve_camera(photo: Photo, given: str | SentFile | None = None, *, paths: bool = True) -> Resolved:
    """The camera of a photo.

    Args:
        photo: the picture.
        given: what the user said: a calibration file, `f=...`, `fov=...`, or a preset; None to go by the photo alone.
        paths: whether a text may name a file of this machine.

    Raises:
        UnknownCameraError: no source has a camera; it lists why, and what to give.
        InputError, FileFormatError: `given` can't be used.
    """
    hypotheses = [source(photo) for source in CAMERA_SOURCES.values()]
    if given is not None:
        chosen = _given(given, photo, paths=paths)
        hypotheses.insert(0, chosen)
    else:
        chosen = min(hypotheses, key=lambda h: h.relative_u)
    if chosen.camera is None:
        tried = tuple((h.source, h.reason) for h in hypotheses)
        why = "; ".join(reason for _, reason in tried)
        raise UnknownCameraError(f"{photo.name}: no camera ({why}); {WHAT_TO_GIVE}", tried)
    camera, disagreement = _compared(chosen, hypotheses, widen=given is None)
    refused = tuple(n for h in hypotheses if h.camera is None for n in h.notes)
    notes = dict.fromkeys((*photo.notes, *chosen.notes, *(() if given else refused), *disagreement))
    return Resolved(camera, chosen, tuple(hypotheses), tuple(notes))


def _given(text: str | SentFile, photo: Photo, *, paths: bool) -> Hypothesis:
    if isinstance(text, SentFile):
        sent, pick = selector.split(text.name, there=False)
        return calibration_file.camera(sent, photo, text.content, pick)
    if not text.strip():
        raise InputError("--camera", text, WHAT_TO_GIVE)
    if not paths:
        return typed.camera(text, photo)
    path, pick = selector.split(text)
    if path.suffix.lower() in ENDINGS or ("=" not in text and path.is_file()):
        return calibration_file.camera(path, photo, pick=pick)
    return typed.camera(text, photo)


def _compared(chosen: Hypothesis, hypotheses: list[Hypothesis], *, widen: bool) -> tuple[Camera, tuple[Note, ...]]:
    """The chosen camera; where another source contradicts it, a note, and a u that holds both."""
    assert chosen.camera is not None
    f = float(chosen.camera.f_px)
    worst = 0.0
    texts = []
    for other in hypotheses:
        if other is chosen or other.camera is None:
            continue
        gap = math.log(float(other.camera.f_px) / f)
        if abs(gap) > AGREE_WITHIN * math.hypot(chosen.relative_u, other.relative_u):
            worst = max(worst, abs(gap))
            texts.append(f"{other.source} says {float(other.camera.f_px):.0f} px")
    if not texts:
        return chosen.camera, ()
    note = Note("camera_sources_disagree", f"{chosen.source} says f = {f:.0f} px, but {', '.join(texts)}"
                + ("; the u holds both" if widen else ""), "calibrate the camera")  # fmt: skip
    return (_widened(chosen.camera, worst * f) if widen else chosen.camera), (note,)


def _widened(camera: Camera, u_f_px: float) -> Camera:
    cov = np.array(camera.cov if camera.cov is not None else np.zeros((4 + camera.coefficients.size,) * 2))
    cov[0, 0] = max(cov[0, 0], u_f_px**2)
    return replace(camera, cov=cov, id=None)
