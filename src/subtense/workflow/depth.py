"""Measuring in a depth map: distances at points and in boxes, and between points, with what the map leaves in doubt."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .. import propagate
from ..anchoring import Alignment, aligned
from ..arrays import Array
from ..depth_map import DepthMap
from ..document import Document, Shape
from ..errors import GeometryError, InputError
from ..methods import depth_map
from ..observation import Observation
from ..photo import Photo
from ..quantity import Measurement, Note, Quantity
from ..raw_depth import RawDepth, Sample, at_point, in_box
from .between import between
from .depth_anchors import Anchors, anchors_of
from .depth_source import DepthTexts, raw_depth
from .found import Progress
from .given import given
from .ground import GroundTexts
from .improve import improved
from .resolve_camera import Resolved, resolve_camera

MOST_UNRESOLVED = 3.0
"""Depths that are known to a factor worse than this are no measurement."""


@dataclass(frozen=True)
class Wanted:
    """What to measure, as texts.

    Attributes:
        points: "x,y".
        boxes: "left,top,right,bottom".
        pairs: "x1,y1;x2,y2".
    """

    points: Sequence[str] = ()
    boxes: Sequence[str] = ()
    pairs: Sequence[str] = ()


@dataclass(frozen=True)
class Anchored:
    """A map with what its numbers mean.

    Attributes:
        raw: the map.
        fit: scale and offset by anchors; None where it has none.
        resolved: the camera.
        notes: doubts about map and anchors.
    """

    raw: RawDepth
    fit: Alignment | None
    resolved: Resolved
    notes: tuple[Note, ...]
    scale: Quantity
    offset: Quantity
    pivot: Quantity
    log_factor: Quantity
    focal: Quantity | None


def anchored(
    photo: Photo, said: DepthTexts, anchors: Sequence[str] = (), things: Sequence[str] = (), ground: GroundTexts | None = None,
    camera: str | None = None, progress: Progress | None = None,
) -> Anchored:  # fmt: skip
    """The depth map of a photo, its scale (and shift) fixed by anchors where there are any.

    Raises:
        InputError: a text that can't be read, or a relative map without anchors.
        UnknownCameraError: no camera.
        FileFormatError, MissingExtraError: a map or network that can't be used.
    """
    resolved = resolve_camera(photo, camera)
    raw = raw_depth(photo, resolved.camera, said)
    found = anchors_of(photo, raw, resolved, anchors, things, ground or GroundTexts(), progress)
    return _meaning(raw, resolved, found)


def _meaning(raw: RawDepth, resolved: Resolved, found: Anchors) -> Anchored:
    notes = (*raw.notes, *found.notes)
    if found.anchors or raw.relative:
        fit = aligned(raw, found.anchors, found.cov_m2)
        told = f"fitted to {fit.source}"
        text = f"{raw.source}: {told}; single depths are known to {100 * fit.u_local:.2g} % (1s)"
        scale = Quantity.normal(fit.scale, fit.u_scale, "1", told)
        offset = Quantity.normal(fit.offset, fit.u_offset, "1", told)
        pivot = Quantity.exact(fit.pivot, "1", "of the fit")
        notes = (Note("anchored_depth", text), *notes, *fit.notes)
        return Anchored(raw, fit, resolved, notes, scale, offset, pivot, depth_map.nothing(), None)
    if raw.published:
        total = math.hypot(raw.u_factor, raw.u_local)
        text = f"{raw.source} without an anchor: its depths are known to {100 * total:.2g} % (1s; {raw.doubt})"
        notes = (
            Note(
                "unanchored_depth", text, "give one known distance in the picture, as --anchor '320,240 = 3.2 ± 0.1 m'"
            ),
            *notes,
        )
    factor = Quantity.normal(0.0, raw.u_factor, "1", raw.doubt) if raw.u_factor else depth_map.nothing()
    f = Quantity.exact(float(resolved.camera.f_px), "px", "of the picture's camera") if raw.focal else None
    return Anchored(raw, None, resolved, notes, depth_map.one(), depth_map.nothing(), depth_map.nothing(), factor, f)


def depth_document(
    photo: Photo, said: DepthTexts, wanted: Wanted, *, anchors: Sequence[str] = (), things: Sequence[str] = (),
    ground: GroundTexts | None = None, camera: str | None = None, level: float = 0.95, seed: int = 0,
    progress: Progress | None = None,
) -> tuple[Document, Anchored]:  # fmt: skip
    """Distances in the depth map of a photo, as one document, and the map.

    Args:
        photo: the picture.
        said: of the map, or the network that makes it.
        wanted: what to measure.
        anchors: places whose distance or size is known; see `depth_anchors`.
        things: what to look for in the picture to anchor the map by.
        ground: how the camera stands, for anchors on the ground.
        camera: what the user said of it; None to go by the photo.
        level: coverage of the intervals.
        seed: of the draws.
        progress: is told what is looked for.

    Raises:
        InputError, FileFormatError, UnknownCameraError, MissingExtraError: as `anchored`.
        GeometryError: the map has no depth there.
    """
    map_ = anchored(photo, said, anchors, things, ground, camera, progress)
    found: list[Measurement] = []
    shapes: list[Shape] = []
    count = len(wanted.points) + len(wanted.boxes) + len(wanted.pairs)

    def label(kind: str, number: int) -> str:
        return f"{kind} {number}" if count > 1 else kind

    for number, text in enumerate(wanted.points, 1):
        at = Observation.parse(text, name="--point", count=1)
        found += _measured(map_, at, _at(map_, at), label("point", number), level, seed)
        shapes.append(_shape(at.points_px, label("point", number), closed=False))
    for number, text in enumerate(wanted.boxes, 1):
        box = _box(text)
        middle = Observation((box[:2] + box[2:])[None] / 2, 0.0, source="middle of the box")
        found += _measured(map_, middle, in_box(map_.raw, box.tolist()), label("box", number), level, seed)
        corners = box[[0, 1, 2, 1, 2, 3, 0, 3]].reshape(4, 2)
        shapes.append(_shape(corners, label("box", number), closed=True))
    for number, text in enumerate(wanted.pairs, 1):
        ends = Observation.parse(text, name="--between", count=2)
        found += _between(map_, ends, label("between", number), level, seed)
        shapes.append(_shape(ends.points_px, label("between", number), closed=False))
    notes = (*photo.notes, *map_.resolved.notes, *map_.notes)
    return Document(improved(tuple(found)), map_.resolved.to_json(), photo.to_json(), notes, tuple(shapes)), map_


def _shape(points: Array, label: str, *, closed: bool) -> Shape:
    return Shape(tuple((float(x), float(y)) for x, y in points), closed, label)


def _box(text: str) -> Array:
    try:
        numbers = np.array([float(word) for word in text.replace(";", ",").split(",")])
    except ValueError:
        numbers = np.zeros(0)
    if numbers.size != 4 or not np.isfinite(numbers).all():
        raise InputError("--box", text, "give left, top, right and bottom, px, as 100,80,300,240")
    return numbers


def _at(map_: Anchored, at: Observation) -> Sample:
    return at_point(map_.raw, at.points_px[0], float(np.max(at.standard_deviations)))


def _inputs(map_: Anchored, at: Observation, sample: Sample) -> depth_map.Inputs:
    """The method's inputs; the number's u holds the map's local error and what lies about the place."""
    raw, fit = map_.raw, map_.fit
    x = float(fit.x(np.array(sample.value))) if fit else sample.value
    local = fit.u_local if fit else raw.u_local
    slope = x**2 if raw.inverse else 1.0
    scale = fit.scale if fit else 1.0
    u = math.sqrt((local * x) ** 2 + (raw.u_m * slope) ** 2 + (scale * sample.spread) ** 2) / scale
    told = f"{'what the anchors leave of ' if fit else ''}{raw.doubt}"
    if sample.spread > 0.7 * u:
        told = "depths about the place differ"
    value = Quantity.normal(sample.value, u, "1", told)
    space = "disparity" if raw.inverse else "depth"
    camera = map_.resolved.camera
    return depth_map.Inputs(camera, at, value, map_.scale, map_.offset, map_.pivot, map_.log_factor, map_.focal, space)


def _measured(
    map_: Anchored, at: Observation, sample: Sample, label: str, level: float, seed: int
) -> list[Measurement]:
    inputs = _inputs(map_, at, sample)
    head, *rest = propagate.measure(depth_map.METHOD, inputs, level=level, seed=seed, label=label, given=given(inputs))
    return [dataclasses.replace(head, notes=(*head.notes, *_doubts(map_, sample))), *rest]


def _between(map_: Anchored, ends: Observation, label: str, level: float, seed: int) -> list[Measurement]:
    pairs: list[tuple[Any, Any]] = []
    notes: tuple[Note, ...] = ()
    for i in range(2):
        at = Observation(ends.points_px[i : i + 1], float(ends.standard_deviations[2 * i]), source=ends.source)
        sample = _at(map_, at)
        pairs.append((depth_map.METHOD, _inputs(map_, at, sample)))
        notes = (*notes, *_doubts(map_, sample))
    head, *rest = between(pairs[0], pairs[1], level=level, seed=seed, label=label)
    return [dataclasses.replace(head, notes=(*head.notes, *dict.fromkeys(notes))), *rest]


def _doubts(map_: Anchored, sample: Sample) -> tuple[Note, ...]:
    """`depth_edge` and `depth_extrapolated`."""
    raw, fit = map_.raw, map_.fit
    found = []
    if sample.edge:
        near, far = _depths_of(map_, sample)
        text = f"about the place the map runs from {near:.3g} to {far:.3g} m; which of it is meant is in u"
        found.append(Note("depth_edge", text, "choose a place within the thing"))
    if fit is not None and raw.kind in ("affine", "disparity") and fit.beyond(sample.value):
        text = "the place lies much nearer or farther than all anchors, where nothing checks scale and shift"
        found.append(Note("depth_extrapolated", text, "give an anchor about as far away"))
    return tuple(found)


def _depths_of(map_: Anchored, sample: Sample) -> tuple[float, float]:
    """Depths, m, that the numbers about a place stand for; infinite beyond what the map can tell."""
    ends = np.array([sample.near, sample.far])
    x = map_.fit.x(ends) if map_.fit else ends
    with np.errstate(divide="ignore"):
        depths = np.where(x > 0, 1 / x, np.inf) if map_.raw.inverse else x
    return float(depths.min()), float(depths.max())


def depth_map_of(map_: Anchored) -> DepthMap:
    """The map in metres with a deviation for each pixel; NaN where the map has nothing, or nothing in front of the camera.

    Raises:
        GeometryError: nowhere is there a depth.
    """
    raw, fit = map_.raw, map_.fit
    values = np.asarray(raw.values, float)
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        x = fit.x(values) if fit else values
        depth = np.where(x > 0, 1 / x if raw.inverse else x, np.nan)
        local, common = (fit.u_local, 0.0) if fit else (raw.u_local, raw.u_factor)
        variance = (local * depth) ** 2 + raw.u_m**2 + (common * depth) ** 2
        if fit is not None:
            moved = fit.u_offset**2 + (fit.u_scale * (values - fit.pivot)) ** 2
            variance = variance + moved * (depth**4 if raw.inverse else 1.0)
        sigma = np.sqrt(variance)
    known = np.isfinite(depth) & np.isfinite(sigma) & (sigma < MOST_UNRESOLVED * depth)
    if not known.any():
        raise GeometryError("the map has no depth in front of the camera", code="no_depth")
    depth, sigma = np.where(known, depth, np.nan), np.where(known, sigma, np.nan)
    shared = fit.u_scale / fit.scale if fit is not None and not raw.inverse else common
    least = float(np.nanmin(sigma / depth))
    camera = map_.resolved.camera
    return DepthMap(depth, sigma, np.zeros(depth.shape, bool), camera, raw.source, u_scale=min(shared, least))
