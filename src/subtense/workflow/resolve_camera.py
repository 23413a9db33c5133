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
from ..camera_sources import (
    calibration_file,
    colmap_sensors,
    dji_tags,
    exif_35mm,
    exif_focal_plane,
    google_tags,
    heic_matrix,
    lens_database,
    panorama_tags,
    pix4d_tags,
    sensor_database,
    typed,
    vanishing_points,
)
from ..edited import refusal
from ..errors import InputError, UnknownCameraError
from ..hypothesis import ASSUMED_DISTORTION, Hypothesis
from ..photo import Photo
from ..quantity import Note
from ..told_pose import ToldPose, told_pose

CAMERA_SOURCES: dict[str, Callable[[Photo], Hypothesis]] = {
    panorama_tags.NAME: panorama_tags.camera,
    dji_tags.NAME: dji_tags.camera,
    pix4d_tags.NAME: pix4d_tags.camera,
    heic_matrix.NAME: heic_matrix.camera,
    google_tags.NAME: google_tags.camera,
    exif_focal_plane.NAME: exif_focal_plane.camera,
    sensor_database.NAME: sensor_database.camera,
    lens_database.NAME: lens_database.camera,
    exif_35mm.NAME: exif_35mm.camera,
    colmap_sensors.NAME: colmap_sensors.camera,
}
"""Sources that need nothing but the photo, in order of trust where their u is equal."""
LAST_RESORTS = (colmap_sensors.NAME,)
"""Those that take 0.2 s and know less than the others: asked where no other answers, or who asks wants to see all."""

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
        pose: how the camera stood, where the file tells it.
    """

    camera: Camera
    chosen: Hypothesis
    hypotheses: tuple[Hypothesis, ...]
    notes: tuple[Note, ...]
    pose: ToldPose | None = None

    def to_json(self) -> dict[str, Any]:
        """The camera with its u and what the other sources said."""
        said = [
            {"source": h.source, "f_px": float(h.camera.f_px) if h.camera else None,
             "u_f_px": h.camera.u_f_px if h.camera else None, "text": h.reason, "chosen": h is self.chosen}
            for h in self.hypotheses
        ]  # fmt: skip
        pose = {"pose": self.pose.to_json()} if self.pose else {}
        return {**self.camera.to_json(), "u_f_px": self.camera.u_f_px, "hypotheses": said, **pose}


def resolve_camera(
    photo: Photo, given: str | SentFile | None = None, *, paths: bool = True, ask_all: bool = False
) -> Resolved:
    """The camera of a photo.

    Args:
        photo: the picture.
        given: what the user said: a calibration file, `f=...`, `fov=...`, or a preset; None to go by the photo alone.
        paths: whether a text may name a file of this machine.
        ask_all: whether LAST_RESORTS are asked where others have answered.

    Raises:
        UnknownCameraError: no source has a camera; it lists why, and what to give.
        InputError, FileFormatError: `given` can't be used.
    """
    hypotheses = _settled(_without_pinholes(photo, _asked(photo, ask_all=ask_all, given=given is not None)))
    if given is not None:
        chosen = _without_pinholes(photo, [_given(given, photo, paths=paths)])[0]
        hypotheses.insert(0, chosen)
    else:
        chosen = min(hypotheses, key=lambda h: h.relative_u)
    if chosen.camera is None:
        raise _unknown(photo, hypotheses)
    camera, disagreement = _compared(chosen, hypotheses, widen=given is None)
    lens_notes: tuple[Note, ...] = ()
    if given is None:
        camera, lens_notes = _with_lens(camera, hypotheses)
    refused = tuple(n for h in hypotheses if h.camera is None for n in h.notes)
    notes = dict.fromkeys((*photo.notes, *chosen.notes, *(() if given else refused), *lens_notes, *disagreement))
    return Resolved(camera, chosen, tuple(hypotheses), tuple(notes), chosen.pose or told_pose(photo))


def _asked(photo: Photo, *, ask_all: bool, given: bool) -> list[Hypothesis]:
    """What every source says, LAST_RESORTS only where they are needed."""
    said = {name: source(photo) for name, source in CAMERA_SOURCES.items() if name not in LAST_RESORTS}
    needed = ask_all or not (given or any(one.camera for one in said.values()))
    for name in LAST_RESORTS:
        reason = "not asked, as another source has answered; `subtense camera` asks it"
        said[name] = CAMERA_SOURCES[name](photo) if needed else Hypothesis(name, None, reason)
    return [said[name] for name in CAMERA_SOURCES]


def _with_lens(camera: Camera, hypotheses: list[Hypothesis]) -> tuple[Camera, tuple[Note, ...]]:
    """The camera with the lens database's distortion, where nothing else tells one, and what it notes of it.

    Its u of the focal length comes along: with the distortion it is in doubt where in the picture the nominal one holds.
    """
    found = next((h for h in hypotheses if h.source == lens_database.NAME and h.camera is not None), None)
    assumed = camera.part_sources.get("lens distortion", "").startswith(ASSUMED_DISTORTION)
    if found is None or found.camera is None or not assumed or camera.lens != found.camera.lens:
        return camera, ()
    lens, f = found.camera, float(camera.f_px)
    cov = np.array(camera.cov)
    assert lens.cov is not None
    notes = tuple(note for note in found.notes if note.code == "distortion_corrected")
    if not notes:  # perhaps corrected by the camera: no coefficients, but a doubt of their size
        cov[4, 4] = max(cov[4, 4], lens.cov[4, 4])
        return replace(camera, cov=cov, id=None), ()
    cov[4:, :], cov[:, 4:] = 0.0, 0.0
    cov[4:, 4:] = lens.cov[4:, 4:]
    cov[0, 0] = max(cov[0, 0], (found.relative_u * f) ** 2)
    sources = {**camera.part_sources, "lens distortion": lens.part_sources["lens distortion"]}
    return replace(camera, distortion=lens.coefficients, cov=cov, part_sources=sources, id=None), notes


def _unknown(photo: Photo, hypotheses: list[Hypothesis]) -> UnknownCameraError:
    """No camera: each source and why, and what to give."""
    tried = tuple((h.source, h.reason) for h in hypotheses)
    tags, note = photo.metadata, refusal(photo)
    if note is not None:
        return UnknownCameraError(f"{photo.name}: {note.text}; {note.cure}", tried, code=note.code)
    why = "; ".join(dict.fromkeys(reason for _, reason in tried))
    code = "unknown_camera" if tags.focal_mm or tags.f35_mm else "no_focal_length"
    return UnknownCameraError(f"{photo.name}: no camera ({why}); {WHAT_TO_GIVE}", tried, code=code)


def _without_pinholes(photo: Photo, hypotheses: list[Hypothesis]) -> list[Hypothesis]:
    """A panorama and an edited perspective are no pinhole's picture, whatever the tags say: only a panorama's lens may stay."""
    note = refusal(photo)
    if note is None:
        return hypotheses
    kept = []
    for one in hypotheses:
        panorama = note.code == "panorama" and one.camera is not None and one.camera.lens == "equirectangular"
        reason = one.reason if one.camera is None else f"{note.code}: no pinhole took this picture"
        kept.append(one if panorama else Hypothesis(one.source, None, reason))
    return kept


def _settled(hypotheses: list[Hypothesis]) -> list[Hypothesis]:
    """Where tags have two readings and the other sources fit one of them only, that one is taken."""
    return [_read(one, [h for h in hypotheses if h is not one and h.camera and not h.either]) for one in hypotheses]


def _read(one: Hypothesis, others: list[Hypothesis]) -> Hypothesis:
    if not one.either or not others:
        return one
    fitting = [
        camera for camera in one.either
        if all(_gap(camera, other.camera) <= AGREE_WITHIN for other in others if other.camera is not None)
    ]  # fmt: skip
    if len(fitting) != 1:
        return one
    return replace(
        one, camera=fitting[0], reason=f"{one.reason} (of two readings the one that fits the other sources)", either=()
    )


def _gap(a: Camera, b: Camera) -> float:
    """How many combined u the focal lengths of two cameras differ by."""
    fa, fb = float(a.f_px), float(b.f_px)
    return abs(math.log(fa / fb)) / max(math.hypot(a.u_f_px / fa, b.u_f_px / fb), 1e-12)


def _given(text: str | SentFile, photo: Photo, *, paths: bool) -> Hypothesis:
    if isinstance(text, SentFile):
        sent, pick = selector.split(text.name, there=False)
        return calibration_file.camera(sent, photo, text.content, pick)
    if not text.strip():
        raise InputError("--camera", text, WHAT_TO_GIVE)
    if text.split("=")[0].strip() == "lines":
        return vanishing_points.camera(text, photo, paths=paths)
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
