"""Measuring in a photo: what was seen, with the camera that saw it, to a Document."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from ..detection import Detection, Search, unknown_curve
from ..detectors.markers import ALL_FAMILIES
from ..distribution import normal_quantile
from ..document import Document
from ..edited import refusal
from ..errors import FileFormatError, InputError, NothingFoundError, SubtenseError, UnknownCameraError
from ..method import Method
from ..methods import known_size
from ..observation import Observation
from ..photo import Photo
from ..quantity import Measurement, Note, Quantity
from ..target import Target
from ..targets import KnownTarget
from .detect import Found, detect, item_of
from .given import inputs_from_json, inputs_from_text, read_json
from .grade import graded_line
from .in_photo import Item, item_inputs, measure_item
from .resolve_camera import CAMERA_SOURCES, Resolved, resolve_camera
from .size_convention import planes_of, size_convention


def measure_lines(
    photo: Photo, lines: Sequence[Observation], sizes: Sequence[Quantity], *, camera: str | None = None,
    tilt: Quantity | None = None, level: float = 0.95, seed: int = 0,
) -> Document:  # fmt: skip
    """Distance of objects of known size, each from its two ends.

    Args:
        photo: the picture.
        lines: two points each, px of the upright picture.
        sizes: real size of each, m; one for all is enough.
        camera: what the user said of it; None to go by the photo.
        tilt: of the objects to the image plane, rad; None takes them as within 20 degrees of facing the camera.
        level: coverage of the intervals.
        seed: of the draws.

    Raises:
        InputError: an end outside the picture, or sizes that don't match.
        UnknownCameraError, GeometryError: no camera, no finite answer.
    """
    if len(sizes) not in (1, len(lines)):
        raise InputError("--size", f"{len(sizes)} sizes for {len(lines)} lines", "give one for all, or one for each")
    for line in lines:
        _check_inside(photo, line)
    resolved = resolve_camera(photo, camera)
    each = list(sizes) * len(lines) if len(sizes) == 1 else list(sizes)
    documents = []
    for number, (line, size) in enumerate(zip(lines, each, strict=True), 1):
        label = line.label or (f"line {number}" if len(lines) > 1 else "")
        seen, doubts = graded_line(photo, line)
        item = Item(known_size.METHOD, {"ends": seen, "size": size, **({"tilt": tilt} if tilt else {})}, label)
        documents.append(_with_notes(measure_item(item, photo, resolved, level=level, seed=seed), doubts))
    return joined(documents)


def measure_markers(
    photo: Photo, size: Quantity, *, family: str | None = None, curve: Quantity | None = None, camera: str | None = None,
    level: float = 0.95, seed: int = 0,
) -> Document:  # fmt: skip
    """Range, depth and tilt of every marker in a photo.

    Args:
        photo: the picture.
        size: side of the markers' black square, m.
        family: of the markers; None to try all.
        curve: exponent of the transfer curve; None where it is unknown.
        camera: what the user said of it; None to go by the photo.
        level: coverage of the intervals.
        seed: of the draws.

    Raises:
        NothingFoundError: no marker.
        UnknownCameraError: no camera.
    """
    if family is not None and family not in ALL_FAMILIES:
        raise InputError("--marker-family", family, f"known are {', '.join(ALL_FAMILIES)}")
    resolved = resolve_camera(photo, camera)
    found = detect(photo, ["markers"], Search(family=family, curve=curve or unknown_curve(), camera=resolved.camera))
    if not found.detections:
        raise NothingFoundError(f"{photo.name}: no marker found, one is needed; it must be sharp, whole, with a light border, "
                                "and at least 15 px wide")  # fmt: skip
    target = Target.square(size, "marker")
    return measure_detections(found, photo, resolved, sizes={"markers": target}, level=level, seed=seed)


def measure_detections(
    found: Found, photo: Photo, camera: Resolved | UnknownCameraError, *, sizes: Mapping[str, Target | Quantity],
    stated: Sequence[KnownTarget] = (), level: float = 0.95, seed: int = 0,
) -> Document:  # fmt: skip
    """Measure each thing that was found and whose size is known or taken to be known.

    Args:
        found: by `detect`.
        photo: the picture.
        camera: of it.
        sizes: by the name of the detector, or "" for any, of things whose size must be told.
        stated: kinds that a person said are in the picture; the size of others is assumed, which is noted.
        level: coverage of the intervals.
        seed: of the draws.

    Returns:
        A document; what has no answer is a note `refused`, and what has no size a note `size_unknown`.
    """
    documents, notes = [], [*found.notes]
    flat: list[tuple[Detection, object]] = []
    for one, detector in zip(found.detections, found.detectors, strict=True):
        item = item_of(one, sizes.get(detector, sizes.get("")) if one.target is None else None)
        if item is None:
            notes += [dataclasses.replace(note, text=f"{one.label}: {note.text}") for note in one.notes]
            notes.append(Note("size_unknown", f"{one.label}: found, and nothing tells its size", "give its size"))
            continue
        try:
            document = measure_item(item, photo, camera, level=level, seed=seed)
        except SubtenseError as error:
            if len(found.detections) == 1:
                raise
            notes.append(Note("refused", f"{one.label}: {error}"))
            continue
        documents.append(_with_notes(document, (*assumed(one, stated), *one.notes)))
        flat.append((one, item_inputs(item, photo, camera)))
    if not documents:
        told = camera.to_json() if isinstance(camera, Resolved) else None
        return Document((), told, photo.to_json(), (*photo.notes, *notes))
    whole = joined(documents)
    return dataclasses.replace(whole, notes=(*whole.notes, *notes, *size_convention(planes_of(flat))))


def assumed(one: Detection, stated: Sequence[KnownTarget]) -> tuple[Note, ...]:
    """The note `assumed_size` where the kind of a thing, and so its size, was not said by a person."""
    if one.target is None or any(one.target.name == target.name for target in stated):
        return ()
    text = f"its size is taken to be that of the {one.target.title} ({one.target.doubt})"
    if one.others:
        text += f"; it may as well be the {', the '.join(other.title for other in one.others)}"
    return (
        Note("assumed_size", text, f"say what it is with --target {one.target.name}, or measure it and give its size"),
    )


def _with_notes(document: Document, notes: Sequence[Note]) -> Document:
    """The document with notes on its first measurement, which is the headline."""
    if not notes or not document.measurements:
        return document
    head, *rest = document.measurements
    return dataclasses.replace(document, measurements=(dataclasses.replace(head, notes=(*head.notes, *notes)), *rest))


def measure_inputs(
    method: Method, file: Path | None, texts: Mapping[str, str], *, level: float = 0.95, seed: int = 0
) -> Document:
    """Any method, by a JSON file of its inputs or by texts for its fields.

    Raises:
        InputError, FileFormatError: inputs that can't be read, or both or neither given.
        GeometryError: no finite answer.
    """
    if (file is None) == (not texts):
        raise InputError(
            "inputs", "neither" if file is None else "both", "give either --inputs FILE or the single inputs"
        )
    if file is None:
        inputs = inputs_from_text(method, texts)
    else:
        data = read_json(file)
        if not isinstance(data, dict):
            raise FileFormatError(file, "holds no object of inputs")
        inputs = inputs_from_json(method, data.get("given", data))
    return measure_item(
        Item(method, {k: v for k, v in vars(inputs).items() if v is not None}), None, None, level=level, seed=seed
    )


def no_camera_document(photo: Photo, why: UnknownCameraError) -> Document:
    """A photo whose camera nothing tells, which is no failure of the one who asks: a document with notes."""
    reason = refusal(photo) or (
        Note("no_focal_length", "the metadata has neither a focal length nor its 35 mm equivalent", "give the camera")
        if why.code == "no_focal_length"
        else None
    )
    notes = (*photo.notes, *((reason,) if reason else ()), Note("unknown_camera", str(why)))
    return Document((), None, photo.to_json(), notes)


def camera_document(photo: Photo, given_camera: str | Resolved | None = None, *, level: float = 0.95) -> Document:
    """The camera of a photo alone: its focal length in pixels, and what every source says."""
    resolved = given_camera if isinstance(given_camera, Resolved) else resolve_camera(photo, given_camera, ask_all=True)
    camera = resolved.camera
    half = normal_quantile(0.5 + level / 2) * camera.u_f_px
    f = float(camera.f_px)
    why = "the smallest relative u of all sources" if resolved.chosen.source in CAMERA_SOURCES else "what was given"
    notes = (Note("camera_source", f"{resolved.chosen.source} was chosen: {why}"),)
    m = Measurement(
        "focal_length_px", f, camera.u_f_px, f - half, f + half, "px", resolved.chosen.source, level, notes=notes
    )
    return Document((m,), resolved.to_json(), photo.to_json(), resolved.notes)


def joined(documents: Sequence[Document]) -> Document:
    """Documents of one photo as one."""
    return dataclasses.replace(
        documents[0], measurements=sum((d.measurements for d in documents), ()), shapes=sum((d.shapes for d in documents), ()),
    )  # fmt: skip


def _check_inside(photo: Photo, line: Observation) -> None:
    limit = np.array([photo.width_px, photo.height_px]) - 0.5
    if np.any(line.points_px < -0.5) or np.any(line.points_px > limit):
        ends = ";".join(f"{x:g},{y:g}" for x, y in line.points_px)
        raise InputError(
            "--line", ends, f"the picture has {photo.width_px} x {photo.height_px} px; both ends must lie in it"
        )
