"""Any methods in one photo, by what a page or a project file says of them, to one Document.

What a person types here gets the same defaults as in `measure`; the photo's camera goes into every method that takes one.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .. import assumptions, propagate
from ..arrays import Array
from ..camera import Camera
from ..document import Document, Shape
from ..errors import InputError, SubtenseError, UnknownCameraError
from ..flat_view import whole_picture
from ..hypothesis import ASSUMED_DISTORTION
from ..method import Method
from ..observation import Observation
from ..photo import Photo
from ..quantity import Measurement, Note, Quantity
from ..target import Target
from .given import NAMED, given, noun_types, read_inputs
from .grade import graded_clicks
from .improve import improved
from .resolve_camera import Resolved

BARE = {"m": "mm", "rad": "deg"}
"""The unit of a bare number where a face shows it beside the field."""


@dataclass(frozen=True)
class Item:
    """One thing to measure.

    Attributes:
        method: of METHODS.
        inputs: field to JSON of its noun, or to the text a person typed.
        label: its name.
        notes: doubts about what was seen, which go with the measurement.
        judged: whether points that a person set are judged here by the picture's quality at them.
    """

    method: Method
    inputs: Mapping[str, Any]
    label: str = ""
    notes: tuple[Note, ...] = ()
    judged: bool = False


def measure_item(
    item: Item, photo: Photo | None, camera: Resolved | UnknownCameraError | None, *, level: float = 0.95, seed: int = 0
) -> Document:
    """One item as a document.

    Args:
        item: what to measure.
        photo: the picture its points lie in; None where the inputs hold all.
        camera: of the photo, or why it has none; goes into a field for a camera that the inputs leave out.
        level: coverage of the intervals.
        seed: of the draws.

    Raises:
        InputError: a field that can't be read, or a point outside the picture.
        GeometryError: no finite answer.
    """
    inputs = item_inputs(item, photo, camera)
    inputs, seen = graded_clicks(photo, inputs) if item.judged and photo is not None else (inputs, ())
    found = propagate.measure(item.method, inputs, level=level, seed=seed, label=item.label, given=given(inputs))
    doubts = (*found[0].notes, *_distortion_unknown(inputs), *seen, *item.notes)
    headed = [dataclasses.replace(found[0], notes=doubts), *(dataclasses.replace(m, notes=()) for m in found[1:])]
    return _document(photo, camera, _camera_of(inputs), headed, _shapes(item, inputs))


def measure_items(
    items: Sequence[Item], photo: Photo, camera: Resolved | UnknownCameraError, *, level: float = 0.95, seed: int = 0
) -> Document:
    """All items as one document; one that has no answer becomes a note `refused`, and does not lose the others."""
    found: list[Measurement] = []
    shapes: list[Shape] = []
    refused: list[Note] = []
    for number, item in enumerate(items, 1):
        named = dataclasses.replace(item, label=item.label or f"{item.method.name} {number}")
        try:
            one = measure_item(named, photo, camera, level=level, seed=seed)
        except SubtenseError as error:
            refused.append(Note("refused", f"{named.label}: {error}"))
            continue
        found += one.measurements
        shapes += one.shapes
    document = _document(photo, camera, None, found, shapes)
    return dataclasses.replace(document, notes=(*document.notes, *refused))


def item_inputs(item: Item, photo: Photo | None, camera: Resolved | UnknownCameraError | None) -> Any:
    """The method's Inputs: texts read with the defaults of a photo, the camera filled in, points inside the picture."""
    values = dict(item.inputs)
    kinds = noun_types(item.method.inputs)
    for field in dataclasses.fields(item.method.inputs):
        if kinds[field.name] is not Camera or values.get(field.name) is not None:
            continue
        if isinstance(camera, Resolved):
            values[field.name] = camera.camera
        elif camera is not None and field.default is dataclasses.MISSING:
            raise camera
    for field in dataclasses.fields(item.method.inputs):
        if field.metadata.get("of_photo") and photo is not None and values.get(field.name) is None:
            values[field.name] = whole_picture(photo.width_px, photo.height_px)
    texts = _with_defaults(item.method, values, in_photo=photo is not None)
    inputs = read_inputs(item.method, texts)
    if photo is not None:
        _check_inside(photo, inputs)
    return inputs


def _with_defaults(method: Method, values: Mapping[str, Any], *, in_photo: bool) -> dict[str, Any]:
    """Quantities that were typed are read with what is assumed of their field; those left out get the photo's default."""
    kinds = noun_types(method.inputs)
    found = dict(values)
    for field in dataclasses.fields(method.inputs):
        value = found.get(field.name)
        if isinstance(value, str) and kinds[field.name] is Quantity:
            bare = BARE if field.metadata.get("assume") else NAMED
            found[field.name] = read_quantity(field, value, bare.get(field.metadata["unit"]))
        elif isinstance(value, str) and kinds[field.name] is Target:
            found[field.name] = Target.parse(value, name=field.name, assume=assumptions.size)
        elif value is None and in_photo and "in_photo" in field.metadata:
            found[field.name] = field.metadata["in_photo"]()
    return found


def read_quantity(field: dataclasses.Field[Any], text: str, bare: str | None) -> Quantity:
    """What a person typed for a field of Inputs, with what is assumed of it where nothing was said.

    Args:
        field: of a Quantity.
        text: as typed.
        bare: the unit of a bare number, as `Quantity.parse` takes it.
    """
    how = field.metadata.get("assume")
    assume = getattr(assumptions, how) if how else None
    read = Quantity.parse(text, field.metadata["unit"], bare=bare, name=field.name, assume=assume)
    return read if field.metadata.get("signed") else _sensible(read, field.name, text)


def _sensible(quantity: Quantity, name: str, text: str) -> Quantity:
    """A length above 0, an angle short of edge-on."""
    value = float(quantity.value)
    if quantity.unit == "m" and not value > 0:
        raise InputError(name, text, "give a length above 0")
    if quantity.unit == "rad" and not abs(value) < math.pi / 2:
        raise InputError(name, text, "give an angle between -90° and 90°")
    return quantity


def _check_uncrossed(name: str, points_px: Array) -> None:
    """Four corners set in order go round their figure one way; crossed ones are in a wrong order, and fit a false pose."""
    edge = np.roll(points_px, -1, axis=0) - points_px
    following = np.roll(edge, -1, axis=0)
    turn = edge[:, 0] * following[:, 1] - edge[:, 1] * following[:, 0]
    if np.any(turn > 0) and np.any(turn < 0):
        ends = ";".join(f"{x:g},{y:g}" for x, y in points_px)
        raise InputError(name, ends, "the corners of a rectangle must go round it in order, none inside the others")


def _check_inside(photo: Photo, inputs: Any) -> None:
    limit = np.array([photo.width_px, photo.height_px]) - 0.5
    for field in dataclasses.fields(inputs):
        seen = getattr(inputs, field.name)
        if isinstance(seen, Observation) and field.metadata.get("closed") and seen.points_px.shape == (4, 2):
            _check_uncrossed(field.name, seen.points_px)
        if isinstance(seen, Observation) and (np.any(seen.points_px < -0.5) or np.any(seen.points_px > limit)):
            ends = ";".join(f"{x:g},{y:g}" for x, y in seen.points_px.reshape(-1, 2))
            raise InputError(
                field.name, ends, f"the picture has {photo.width_px} x {photo.height_px} px; all points must lie in it"
            )


FAR_OUT = 0.5
"""Of the half diagonal: points farther out are noted where nothing is known of the lens's distortion."""


def _distortion_unknown(inputs: Any) -> tuple[Note, ...]:
    """The note `distortion_unknown` for points far from the middle; what it may do is in u by the camera's covariance."""
    camera = _camera_of(inputs)
    if camera is None or not camera.part_sources.get("lens distortion", "").startswith(ASSUMED_DISTORTION):
        return ()
    half = math.hypot(camera.width_px, camera.height_px) / 2
    middle = np.array([float(camera.cx_px), float(camera.cy_px)])
    seen = [getattr(inputs, f.name) for f in dataclasses.fields(inputs) if not f.metadata.get("of_photo")]
    points = [one.points_px.reshape(-1, 2) for one in seen if isinstance(one, Observation)]
    farthest = max((float(np.max(np.hypot(*(p - middle).T), initial=0.0)) for p in points), default=0.0) / half
    if farthest <= FAR_OUT or camera.cov is None:
        return ()
    effect = 3 * math.sqrt(camera.cov[4, 4]) * (farthest * half / float(camera.f_px)) ** 2
    text = (f"a point lies {100 * farthest:.0f} % of the way to the corner, and nothing is known of the lens's distortion; up to "
            f"{100 * effect:.2g} % (1s) of a length there is in u")  # fmt: skip
    return (Note("distortion_unknown", text, "calibrate the camera, or measure near the middle of the picture"),)


def _camera_of(inputs: Any) -> Camera | None:
    found = getattr(inputs, "camera", None)
    return found if isinstance(found, Camera) else None


def _shapes(item: Item, inputs: Any) -> list[Shape]:
    """What to draw: each observation; the last is the one the label belongs to."""
    seen = [f for f in dataclasses.fields(inputs) if isinstance(getattr(inputs, f.name), Observation)]
    fields = [f for f in seen if not f.metadata.get("of_photo")]
    shapes = []
    for field in fields:
        points = getattr(inputs, field.name).points_px.reshape(-1, 2)
        label = item.label if field is fields[-1] else field.name
        pairs = tuple((float(x), float(y)) for x, y in points)
        shapes.append(Shape(pairs, bool(field.metadata.get("closed")), label))
    return shapes


def _document(
    photo: Photo | None,
    resolved: Resolved | UnknownCameraError | None,
    camera: Camera | None,
    found: Sequence[Measurement],
    shapes: Sequence[Shape],
) -> Document:
    said: dict[str, Any] | None = {**camera.to_json(), "u_f_px": camera.u_f_px} if camera else None
    notes = photo.notes if photo else ()
    if isinstance(resolved, Resolved):
        said, notes = resolved.to_json(), resolved.notes
    return Document(improved(tuple(found)), said, photo.to_json() if photo else None, notes, tuple(shapes))
