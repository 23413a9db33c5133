"""Measuring in a photo: what was seen, with the camera that saw it, to a Document."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from ..detectors.markers import FAMILIES, markers
from ..distribution import normal_quantile
from ..document import Document
from ..edited import refusal
from ..errors import FileFormatError, InputError, NothingFoundError, UnknownCameraError
from ..method import Method
from ..methods import known_size, pose
from ..observation import Observation
from ..photo import Photo
from ..quantity import Measurement, Note, Quantity
from ..target import Target
from .given import inputs_from_json, inputs_from_text, read_json
from .in_photo import Item, measure_item
from .resolve_camera import CAMERA_SOURCES, Resolved, resolve_camera


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
    items = []
    for number, (line, size) in enumerate(zip(lines, each, strict=True), 1):
        label = line.label or (f"line {number}" if len(lines) > 1 else "")
        items.append(Item(known_size.METHOD, {"ends": line, "size": size, **({"tilt": tilt} if tilt else {})}, label))
    return joined([measure_item(item, photo, resolved, level=level, seed=seed) for item in items])


def measure_markers(
    photo: Photo,
    size: Quantity,
    *,
    family: str | None = None,
    camera: str | None = None,
    level: float = 0.95,
    seed: int = 0,
) -> Document:
    """Range, depth and tilt of every marker in a photo.

    Args:
        photo: the picture.
        size: side of the markers' black square, m.
        family: of the markers; None to try all.
        camera: what the user said of it; None to go by the photo.
        level: coverage of the intervals.
        seed: of the draws.

    Raises:
        NothingFoundError: no marker.
        UnknownCameraError: no camera.
    """
    if family is not None and family not in FAMILIES:
        raise InputError("--marker-family", family, f"known are {', '.join(FAMILIES)}")
    resolved = resolve_camera(photo, camera)
    seen = _told_apart(markers(photo, family))
    if not seen:
        raise NothingFoundError(f"{photo.name}: no marker found, one is needed; it must be sharp, whole, with a light border, "
                                "and at least 15 px wide")  # fmt: skip
    target = Target.square(size, "marker")
    items = [Item(pose.METHOD, {"points": one, "target": target}, one.label) for one in seen]
    return joined([measure_item(item, photo, resolved, level=level, seed=seed) for item in items])


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


def _told_apart(seen: Sequence[Observation]) -> list[Observation]:
    """Observations with labels of their own: a second marker of one number gets "(2)"."""
    counts: dict[str, int] = {}
    found = []
    for one in seen:
        counts[one.label] = counts.get(one.label, 0) + 1
        again = counts[one.label] > 1
        found.append(dataclasses.replace(one, label=f"{one.label} ({counts[one.label]})") if again else one)
    return found


def _check_inside(photo: Photo, line: Observation) -> None:
    limit = np.array([photo.width_px, photo.height_px]) - 0.5
    if np.any(line.points_px < -0.5) or np.any(line.points_px > limit):
        ends = ";".join(f"{x:g},{y:g}" for x, y in line.points_px)
        raise InputError(
            "--line", ends, f"the picture has {photo.width_px} x {photo.height_px} px; both ends must lie in it"
        )
