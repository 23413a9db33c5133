"""One thing measured in every way that what was told allows: the best answer, and the others as a check on it."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..detection import Detection
from ..document import Document
from ..errors import GeometryError, UnknownCameraError
from ..methods import ground_plane
from ..observation import Observation
from ..photo import Photo
from ..quantity import Measurement, Note, Quantity
from .fuse import disagreement
from .in_photo import Item, item_inputs, measure_item
from .resolve_camera import Resolved

APART = 2.576
"""Standard deviations of their difference, beyond which two answers contradict each other: 1 % by chance."""
STANDING_GROUPS = ("body", "vehicle")
"""Of data/targets.toml: what stands on the ground."""


def ground_item(
    seen: Observation, standing: Mapping[str, Any], label: str, size: Quantity | None = None
) -> Item | None:
    """What stands upright on the ground, ranged by its foot; None for what lies across.

    Args:
        seen: its two ends.
        standing: of the camera above the ground, fields of `ground.Standing`.
        label: its name.
        size: its height; the range is then that of its middle, as by its size.
    """
    if seen.points_px.shape != (2, 2):
        return None
    step = abs(seen.points_px[1] - seen.points_px[0])
    if not step[1] > step[0]:
        return None
    low = int(np.argmax(seen.points_px[:, 1]))
    cov = None if seen.cov is None else np.asarray(seen.cov)[2 * low : 2 * low + 2, 2 * low : 2 * low + 2]
    sigma = np.asarray(seen.sigma_px)
    foot = dataclasses.replace(
        seen,
        points_px=seen.points_px[low : low + 1],
        cov=cov,
        sigma_px=float(sigma if sigma.ndim == 0 else sigma[low]),
        id=None,
    )
    inputs: dict[str, Any] = {**standing, "foot": foot}
    if size is not None:
        inputs["above"] = Quantity.normal(
            float(size.value) / 2, float(size.u) / 2, "m", f"half its height, {size.source}"
        )
    note = Note(
        "stands_on_ground",
        "its lower end is taken to be where it stands on the ground",
        "mark the point where it stands",
    )
    return Item(ground_plane.METHOD, inputs, label, (note,))


def stands(one: Detection, detector: str) -> bool:
    """Whether a thing that was found stands on the ground, as a person or a car does."""
    return detector == "objects" and one.target is not None and one.target.group in STANDING_GROUPS


def measure_ways(
    items: Sequence[Item], photo: Photo, camera: Resolved | UnknownCameraError, *, level: float = 0.95, seed: int = 0
) -> Document:
    """One thing by each of the items: first what has the narrowest interval of the range, then the others under names of their own.

    Raises:
        SubtenseError: the first item has no answer, and no other has.
    """
    if len(items) == 1:
        return measure_item(items[0], photo, camera, level=level, seed=seed)
    answers: list[tuple[Item, Document]] = []
    refused: list[Note] = []
    error: GeometryError | None = None
    for item in items:
        try:
            answers.append((item, measure_item(item, photo, camera, level=level, seed=seed)))
        except GeometryError as why:
            error = error or why
            refused.append(Note("way_refused", f"{item.method.title}: {why}"))
    if not answers:
        assert error is not None
        raise error
    answers.sort(key=lambda pair: _width(_range(pair[1])))
    (best, first), *others = answers
    notes = [*refused, *(_check(best, first, item, other, photo, camera) for item, other in others)]
    head, *rest = first.measurements
    found = [dataclasses.replace(head, notes=(*head.notes, *notes)), *rest]
    for item, other in others:
        found += [
            dataclasses.replace(m, label=f"{m.label or 'the same'}, by {item.method.name}") for m in other.measurements
        ]
    return dataclasses.replace(first, measurements=tuple(found), shapes=sum((d.shapes for _, d in answers), ()))


def other_name(label: str, method: str) -> str:
    """What a thing is called where it was measured by another way too."""
    return f"{label or 'the same'}, by {method}"


def _range(document: Document) -> Measurement:
    return next(m for m in document.measurements if m.what == "range")


def _width(m: Measurement) -> float:
    """Of the interval, as a share of the value."""
    return math.inf if m.low is None or m.high is None else (m.high - m.low) / m.value


def _check(
    best: Item, first: Document, item: Item, other: Document, photo: Photo, camera: Resolved | UnknownCameraError
) -> Note:
    """What another way says of the same range: `cross_check`, or `methods_disagree`."""
    mine, its = _range(first), _range(other)
    pairs = [(one.method, item_inputs(one, photo, camera)) for one in (best, item)]
    ends = " to ".join("open" if end is None else f"{end:.3g}" for end in (its.low, its.high))
    says = f"{item.method.name} gives a range of {its.value:.3g} m, {ends} m"
    if its.u is None or mine.u is None:
        apart = 0.0 if _overlap(mine, its) else math.inf
    else:
        apart = disagreement(pairs, "range")
    if apart <= APART:
        return Note("cross_check", f"{says}, which agrees")
    far = "" if math.isinf(apart) else f" by {apart:.1f} standard deviations of the difference"
    text = f"{says}, which contradicts {best.method.name}{far}: an assumption of one of them does not hold"
    return Note("methods_disagree", text, "check the size, how the camera stands, and where the thing stands")


def _overlap(one: Measurement, other: Measurement) -> bool:
    """Whether two intervals touch; an open end reaches everywhere."""
    low = max(m.low if m.low is not None else -math.inf for m in (one, other))
    return low <= min(m.high if m.high is not None else math.inf for m in (one, other))
