"""Measuring by an outline: one click or one box, a real size, and which extent has it, to a Document."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from .. import assumptions
from ..arrays import Array
from ..detection import Search
from ..detectors.outline import outline
from ..document import Document, Shape
from ..errors import InputError
from ..methods import known_size
from ..observation import Observation
from ..outline import EXTENTS, Outline
from ..photo import Photo
from ..quantity import Note, Quantity
from .grade import graded_contour
from .in_photo import Item, measure_item
from .measure import joined
from .measure_input import read_length
from .resolve_camera import resolve_camera

PEOPLE = "selfie_segmentation.tflite"
"""The packaged network that cuts people out."""


def outline_document(
    photo: Photo, where: Sequence[str], sizes: Sequence[str], *, extent: str = "longest", model: str | None = None,
    tilt: str | None = None, camera: str | None = None, level: float = 0.95, seed: int = 0, beside: bool = False,
) -> Document:  # fmt: skip
    """Distances of things of known size, each by its outline.

    Args:
        photo: the picture.
        where: for each thing `X,Y` of a point on it, or `X1,Y1,X2,Y2` of a box around it, px.
        sizes: real size of the extent; one for all is enough.
        extent: of EXTENTS, which one has that size.
        model: an ONNX or TFLite network from a picture to a mask, or `person`; None for GrabCut.
        tilt: of the things to the image plane; None takes them as within 20 degrees of facing the camera.
        camera: what the user said of it; None to go by the photo.
        level: coverage of the intervals.
        seed: of the draws.
        beside: whether lines or markers were asked for too.

    Raises:
        InputError: a text that can't be read, no size, or a place outside the picture.
        NothingFoundError: nothing there stands out from its ground.
        UnknownCameraError: no camera.
    """
    if beside:
        raise InputError(
            "--outline", ";".join(where), "measure outlines by themselves, and lines and markers in another run"
        )
    if not sizes:
        raise InputError("--size", None, "give the real size of the outline's extent, as --size '210 mm'")
    if len(sizes) not in (1, len(where)):
        raise InputError("--size", f"{len(sizes)} sizes for {len(where)} outlines", "give one for all, or one for each")
    if extent not in EXTENTS:
        raise InputError("--extent", extent, f"known are {', '.join(EXTENTS)}")
    lengths = [read_length(text, "--size") for text in sizes]
    angle = None if tilt is None else Quantity.parse(tilt, "rad", bare="deg", name="--tilt", assume=assumptions.angle)
    resolved = resolve_camera(photo, camera)
    documents = []
    for number, text in enumerate(where):
        label = f"outline {number + 1}" if len(where) > 1 else "outline"
        found = outline(photo, place(text), Search(model=_model(model)))
        seen, doubts = graded_contour(photo, found.extents[extent], found.contour.points_px)
        size = lengths[number] if len(lengths) > 1 else lengths[0]
        inputs = {"ends": seen, "size": size, **({"tilt": angle} if angle else {})}
        document = measure_item(Item(known_size.METHOD, inputs, label), photo, resolved, level=level, seed=seed)
        notes = (*found.notes, *doubts, *(_across_corners(found) if extent == "longest" else ()))
        documents.append(_whole(document, found, notes, label))
    return joined(documents)


CORNERED = 1.03
"""Longest extent over the longer side of the narrowest box, beyond which it goes from corner to corner."""


def _across_corners(found: Outline) -> tuple[Note, ...]:
    """The note `across_corners` on a thing that is longer from corner to corner than its side is."""
    box = found.extents["box"].points_px
    side = max(float(np.hypot(*(box[i] - box[i - 1]))) for i in (1, 2))
    longest = float(np.hypot(*np.diff(found.extents["longest"].points_px, axis=0)[0]))
    if longest <= CORNERED * side:
        return ()
    text = (f"its longest extent goes from corner to corner, and is {100 * (longest / side - 1):.0f} % longer than the longer side of "
            "the narrowest box around it; the size given must be that")  # fmt: skip
    return (
        Note(
            "across_corners",
            text,
            "if the size is that of a side, give --extent width or height, or mark the side with --line",
        ),
    )


def outlined(
    photo: Photo, where: Array, *, person: bool = False
) -> tuple[Outline, dict[str, Observation], tuple[Note, ...]]:
    """An outline, its extents judged by the picture's quality, and all doubts.

    Args:
        photo: the picture.
        where: (2,) a point on the thing, or (4,) a box around it, px.
        person: whether it is a person, whom a network cuts out.

    Raises:
        InputError, NothingFoundError, MissingExtraError: as `detectors.outline`.
    """
    found = outline(photo, where, Search(model=_model("person" if person else None)))
    graded = {name: graded_contour(photo, seen, found.contour.points_px) for name, seen in found.extents.items()}
    doubts = next(iter(graded.values()))[1]  # of the contour, and so of all extents
    return found, {name: seen for name, (seen, _) in graded.items()}, (*found.notes, *doubts)


def place(text: str) -> Array:
    """(2,) or (4,) from `X,Y` or `X1,Y1,X2,Y2`.

    Raises:
        InputError: something else.
    """
    try:
        numbers = [float(word) for word in text.replace(";", ",").split(",")]
    except ValueError:
        numbers = []
    if len(numbers) not in (2, 4) or not np.all(np.isfinite(numbers)):
        raise InputError("--outline", text, "give X,Y of a point on the thing, or X1,Y1,X2,Y2 of a box around it, px")
    return np.array(numbers)


def _model(name: str | None) -> Path | None:
    if name is None:
        return None
    if name == "person":
        from ..networks import model_file

        return model_file(PEOPLE)
    return Path(name)


def _whole(document: Document, found: Outline, notes: tuple[Note, ...], label: str) -> Document:
    """The document with the contour drawn and the outline's doubts on its headline."""
    points = found.contour.points_px
    contour = Shape(tuple((float(x), float(y)) for x, y in points), True, label)
    head, *rest = document.measurements
    headed = dataclasses.replace(head, notes=(*head.notes, *notes))
    return dataclasses.replace(document, measurements=(headed, *rest), shapes=(contour, *document.shapes))
