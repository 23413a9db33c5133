"""Measuring in a photo: what was seen, with the camera that saw it, to a Document."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

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
from .given import NAMED, from_file, inputs_from_json, inputs_from_text, read_json
from .grade import graded_line
from .in_photo import Item, item_inputs, measure_item, read_quantity
from .resolve_camera import CAMERA_SOURCES, Resolved, resolve_camera
from .size_convention import planes_of, size_convention
from .ways import ground_item, measure_ways, stands

Standing = Callable[[Resolved], Mapping[str, Any]]
"""How a camera stands above the ground: from what is known of it to fields of `ground.Standing`."""


def measure_lines(
    photo: Photo, lines: Sequence[Observation], sizes: Sequence[Quantity], *, camera: str | None = None,
    tilt: Quantity | None = None, standing: Standing | None = None, level: float = 0.95, seed: int = 0,
) -> Document:  # fmt: skip
    """Distance of objects of known size, each from its two ends.

    Args:
        photo: the picture.
        lines: two points each, px of the upright picture.
        sizes: real size of each, m; one for all is enough. None at all where `standing` is told: things are then ranged by
            where they stand.
        camera: what the user said of it; None to go by the photo.
        tilt: of the objects to the image plane, rad; None takes them as within 20 degrees of facing the camera.
        standing: how the camera stands above the ground, by which upright things are ranged too.
        level: coverage of the intervals.
        seed: of the draws.

    Raises:
        InputError: an end outside the picture, or sizes that don't match.
        UnknownCameraError, GeometryError: no camera, no finite answer.
    """
    if len(sizes) not in ((1, len(lines)) if standing is None else (0, 1, len(lines))):
        raise InputError("--size", f"{len(sizes)} sizes for {len(lines)} lines", "give one for all, or one for each")
    for line in lines:
        _check_inside(photo, line)
    resolved = resolve_camera(photo, camera)
    each = _sizes_of_lines(sizes, len(lines))
    ground = None if standing is None else standing(resolved)
    documents = []
    for number, (line, size) in enumerate(zip(lines, each, strict=True), 1):
        label = line.label or (f"line {number}" if len(lines) > 1 else "")
        seen, doubts = graded_line(photo, line)
        items = [
            Item(known_size.METHOD, {"ends": seen, "size": size, **({"tilt": tilt} if tilt else {})}, label)
            if size is not None
            else None,
            None if ground is None else ground_item(seen, ground, label, size),
        ]
        ways = [item for item in items if item is not None]
        if not ways:
            raise InputError(
                "--line",
                label,
                "it lies across: what stands on the ground is marked from head to foot; else give its --size",
            )
        documents.append(_with_notes(measure_ways(ways, photo, resolved, level=level, seed=seed), doubts))
    return joined(documents)


def _sizes_of_lines(sizes: Sequence[Quantity], count: int) -> list[Quantity | None]:
    """One for each line; that for all of them is one and the same doubt."""
    if len(sizes) == 1 and count > 1:
        return [dataclasses.replace(sizes[0], id=sizes[0].id or f"size {sizes[0].digest}")] * count
    return list(sizes) or [None] * count


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
    stated: Sequence[KnownTarget] = (), standing: Standing | None = None, level: float = 0.95, seed: int = 0,
) -> Document:  # fmt: skip
    """Measure each thing that was found and whose size is known or taken to be known.

    Args:
        found: by `detect`.
        photo: the picture.
        camera: of it.
        sizes: by the name of the detector, or "" for any, of things whose size must be told.
        stated: kinds that a person said are in the picture; the size of others is assumed, which is noted.
        standing: how the camera stands above the ground, by which people and vehicles are ranged too.
        level: coverage of the intervals.
        seed: of the draws.

    Returns:
        A document; what has no answer is a note `refused`, and what has no size a note `size_unknown`.
    """
    documents, notes = [], [*found.notes]
    ground = standing(camera) if standing is not None and isinstance(camera, Resolved) else None
    flat: list[tuple[Detection, object]] = []
    for one, detector in zip(found.detections, found.detectors, strict=True):
        item = item_of(one, sizes.get(detector, sizes.get("")) if one.target is None else None)
        if item is None:
            notes += [dataclasses.replace(note, text=f"{one.label}: {note.text}") for note in one.notes]
            cure = "give its width and height, as 210 x 297 mm" if one.shape == "rectangle" else "give its size"
            notes.append(Note("size_unknown", f"{one.label}: found, and nothing tells its size", cure))
            continue
        ways = [item]
        if ground is not None and stands(one, detector):
            size = item.inputs.get("size")
            by_foot = ground_item(one.seen, ground, item.label, size if isinstance(size, Quantity) else None)
            ways += [] if by_foot is None else [by_foot]
        try:
            document = measure_ways(ways, photo, camera, level=level, seed=seed)
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
    method: Method, file: Path | None, texts: Mapping[str, str], *, photo: Photo | None = None, level: float = 0.95,
    seed: int = 0,
) -> Document:  # fmt: skip
    """Any method, by a JSON file of its inputs or by texts for its fields.

    Args:
        method: of METHODS.
        file: of its inputs; with a photo, what it leaves out is as in `measure_item`.
        texts: for its fields, instead; in a photo, `camera` is what is known of it.
        photo: the picture that its points lie in, which tells the camera too.
        level: coverage of the intervals.
        seed: of the draws.

    Raises:
        InputError, FileFormatError: inputs that can't be read, or both or neither given.
        UnknownCameraError: the method needs a camera, and nothing tells it.
        GeometryError: no finite answer.
    """
    if (file is None) == (not texts):
        raise InputError(
            "inputs", "neither" if file is None else "both", "give either --inputs FILE or the single inputs"
        )
    if file is not None:
        data = read_json(file)
        if not isinstance(data, dict):
            raise FileFormatError(file, "holds no object of inputs")
        given = dict(data.get("given", data))
    if photo is not None:
        values = _typed_in_photo(method, texts) if file is None else given
        told = values.pop("camera", None) if isinstance(values.get("camera"), str) else None
        return measure_item(Item(method, values, judged=True), photo, camera_of(photo, told), level=level, seed=seed)
    inputs = inputs_from_text(method, texts) if file is None else inputs_from_json(method, given)
    return measure_item(
        Item(method, {k: v for k, v in vars(inputs).items() if v is not None}), None, None, level=level, seed=seed
    )


def _typed_in_photo(method: Method, texts: Mapping[str, str]) -> dict[str, Any]:
    """Texts as typed; a quantity needs its unit, as no field stands beside it that shows one."""
    values: dict[str, Any] = {name: from_file(text) for name, text in texts.items()}
    for field in dataclasses.fields(method.inputs):
        text = values.get(field.name)
        if isinstance(text, str) and "unit" in field.metadata:
            values[field.name] = read_quantity(field, text, NAMED.get(field.metadata["unit"]))
    return values


def camera_of(photo: Photo, told: str | None = None) -> Resolved | UnknownCameraError:
    """The camera of a photo, or why it has none: methods that need none are served without."""
    try:
        return resolve_camera(photo, told)
    except UnknownCameraError as error:
        return error


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
