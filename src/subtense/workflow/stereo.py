"""Distances and depth maps from the two pictures of a rig: the rig, the rectified pair, the match, and the methods, put together."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from .. import propagate
from ..arrays import Array, Pixels
from ..camera import Camera
from ..depth_map import DepthMap
from ..disparity import Disparity, dense, filled, smoothed
from ..document import Document, Shape
from ..errors import FileFormatError, InputError
from ..methods import stereo as method
from ..observation import Observation
from ..pair_check import MOST_DISPARITIES, PairFacts, check_pair
from ..photo import Photo
from ..quantity import Measurement, Note, Quantity
from ..rectified_pair import Rectified, rectified, smooth_map
from ..rig import Rig
from ..rig_files import formats
from ..rig_files.reading import ASSUMED_OFFSET_PX, RigFound
from ..stereo_depth import depth_map
from .given import given
from .resolve_camera import resolve_camera
from .stereo_point import BoxMatch, SpotMatch, box_match, spot_match

MOST_WORK = 1_500_000_000
"""Pixels times disparities; larger pairs are matched densely at a smaller size."""
LEAST_SIDE_PX = 16
"""Smaller pictures have no window to match."""
SAME_SHAPE = 0.01
"""Relative difference of proportions up to which a rig is for pictures of another size."""


@dataclass(frozen=True)
class Asked:
    """What a person says of a pair, as texts.

    Attributes:
        rig: files of the rig; empty where --baseline and --camera tell it.
        camera: what is known of the camera of a rectified pair, without a rig's file.
        baseline: length; in place of the rig's.
        doffs: offset of the disparity of a typed rig.
        unit: of lengths in files that do not tell it.
        rectified: that the pictures are rectified.
        at: pixels of the left picture, "x,y".
        boxes: boxes in it, "x1,y1,x2,y2".
        between: pairs of pixels, "x1,y1;x2,y2".
        disparities: "low:high", px; empty to go by the pictures.
        shutter: "rolling" or "global".
        model: a network in place of semi-global matching.
        fill: whether pixels without a match get one from around them.
        smooth: whether the disparities are smoothed along the picture.
    """

    rig: tuple[str, ...] = ()
    camera: str | None = None
    baseline: str | None = None
    doffs: str | None = None
    unit: str = ""
    rectified: bool = False
    at: tuple[str, ...] = ()
    boxes: tuple[str, ...] = ()
    between: tuple[str, ...] = ()
    disparities: str = ""
    shutter: str = "global"
    model: Path | None = None
    fill: bool = False
    smooth: bool = False


@dataclass(frozen=True, eq=False)
class Matched:
    """A pair on its way: rectified, looked at, matched.

    Attributes:
        photo: the left picture.
        pair: the rectified rig.
        left: (height, width) uint8, rectified.
        right: likewise.
        facts: what the pictures showed of themselves.
        found: the disparities.
        notes: doubts about rig and pictures.
    """

    photo: Photo
    pair: Rectified
    left: Pixels
    right: Pixels
    facts: PairFacts
    found: Disparity
    notes: tuple[Note, ...]


def match_pair(left: Photo, right: Photo, asked: Asked) -> Matched:
    """Rectify, check and match two pictures.

    Raises:
        InputError, FileFormatError, UnknownCameraError: no rig that fits the pictures.
        GeometryError: pictures that are no pair of this rig; see `pair_check`.
    """
    found = rig_for(left, right, asked)
    pair = rectified(found.rig)
    grays = [_gray(photo) for photo in (left, right)]
    one, two = pair.pair(*grays)
    facts = check_pair(one, two, pair.doffs_px)
    if asked.disparities:
        low, high = _limits(asked.disparities, one.shape[1])
        facts = dataclasses.replace(facts, low_px=low, high_px=high)
    disparity, notes = _disparity(left, right, pair, (one, two), facts, asked)
    notes = (*left.notes, *found.notes, *facts.notes, *notes, *_shutter(asked.shutter))
    return Matched(left, pair, one, two, facts, disparity, notes)


def stereo_document(matched: Matched, asked: Asked, *, level: float = 0.95, seed: int = 0) -> Document:
    """What was asked of single places, as a document.

    Raises:
        InputError: a place that can't be read, or that lies outside the left picture.
        GeometryError: a disparity that tells no distance, or no match.
    """
    measured: list[Measurement] = []
    shapes: list[Shape] = []
    spots = [_points(text, 1, "--at", matched.photo) for text in asked.at]
    for number, spot in enumerate(spots, 1):
        label = f"point {number}" if len(spots) + len(asked.boxes) + len(asked.between) > 1 else ""
        measured += _at(matched, spot, label, level, seed)
        shapes.append(_shape(spot.points_px, label, closed=False))
    for number, text in enumerate(asked.boxes, 1):
        label, corners = f"box {number}", _box(text, matched.photo)
        measured += _in_box(matched, corners, label, level, seed)
        x1, y1, x2, y2 = corners
        shapes.append(Shape(((x1, y1), (x2, y1), (x2, y2), (x1, y2)), True, label))
    for number, text in enumerate(asked.between, 1):
        ends, label = _points(text, 2, "--between", matched.photo), f"between {number}"
        measured += _length(matched, ends, label, level, seed)
        shapes.append(_shape(ends.points_px, label, closed=False))
    camera = matched.pair.rig.left
    said = {**camera.to_json(), "u_f_px": float(np.sqrt(matched.pair.rig.cov[0, 0]))}
    return Document(tuple(measured), said, matched.photo.to_json(), matched.notes, tuple(shapes))


def depth_of(matched: Matched) -> DepthMap:
    """The depth map of the left picture."""
    return depth_map(matched.found, matched.pair, method.located, f"stereo, {matched.pair.rig.source}")


# -- the rig ---------------------------------------------------------------------------------------------


def rig_for(left: Photo, right: Photo, asked: Asked) -> RigFound:
    """The rig for two pictures, from its file or as typed, at their size.

    Raises:
        InputError, FileFormatError: no rig, or one of another picture size.
    """
    size = (left.width_px, left.height_px)
    if size != (right.width_px, right.height_px):
        raise InputError(
            "RIGHT",
            f"{right.width_px} x {right.height_px} px",
            f"LEFT has {size[0]} x {size[1]}; give a pair of one size",
        )
    if min(size) < LEAST_SIDE_PX:
        raise InputError(
            "LEFT", f"{size[0]} x {size[1]} px", f"give pictures of {LEAST_SIDE_PX} px or more on each side"
        )
    for photo in (left, right):
        if photo.metadata.orientation != 1:
            raise InputError(photo.name, f"turned by its EXIF orientation {photo.metadata.orientation}",
                             "a rig is for pictures as they were taken; save the pair without orientation")  # fmt: skip
    baseline = (
        Quantity.parse(asked.baseline, "m", bare="mm", name="--baseline", assume=_known_baseline)
        if asked.baseline
        else None
    )
    if asked.rig:
        if asked.camera or asked.doffs:
            raise InputError("--rig", " ".join(asked.rig), "leave out --camera and --doffs, which it tells")
        found = formats.read(asked.rig, size_px=size, unit=asked.unit, baseline=baseline, rectified=asked.rectified)
        return _scaled(asked.rig[0], found, size)
    if baseline is None:
        raise InputError("--rig", None, "give the rig's file, or --baseline and --camera of a rectified pair")
    return _typed(left, asked, baseline)


def _known_baseline(value: float, half_digit: float) -> Quantity:
    return Quantity.normal(
        value, max(0.005 * value, half_digit / 3**0.5), "m", "assumed: a baseline typed without ±, 0.5 %"
    )


def _typed(left: Photo, asked: Asked, baseline: Quantity) -> RigFound:
    """A rectified pair of which only focal length and baseline are known."""
    seen = resolve_camera(left, asked.camera).camera
    doffs = (Quantity.parse(asked.doffs, "px", name="--doffs", assume=lambda v, _: Quantity.normal(v, ASSUMED_OFFSET_PX, "px"))
             if asked.doffs else Quantity.normal(0.0, ASSUMED_OFFSET_PX, "px"))  # fmt: skip
    keep = np.zeros((4, 4)) if seen.cov is None else np.diag(np.diag(seen.cov)[:4])
    camera = Camera(seen.width_px, seen.height_px, seen.f_px, seen.cx_px, seen.cy_px, cov=keep, source=seen.source)
    notes: tuple[Note, ...] = ()
    if not asked.doffs:
        text = f"the pictures are taken as rectified, with one principal point in both, to {ASSUMED_OFFSET_PX:g} px (1s) of disparity"
        notes = (Note("rectified_assumed", text, "give the rig's file, or the --doffs of the pair"),)
    return RigFound(Rig.of_rectified(camera, baseline, doffs), notes, True)


def _scaled(name: str, found: RigFound, size: tuple[int, int]) -> RigFound:
    """The rig at the pictures' size."""
    rig = found.rig
    sizes = {(camera.width_px, camera.height_px) for camera in (rig.left, rig.right)}
    if sizes == {size}:
        return found
    was = " and ".join(f"{width} x {height}" for width, height in sorted(sizes))
    if len(sizes) > 1 or any(abs(size[0] * height / (size[1] * width) - 1) > SAME_SHAPE for width, height in sizes):
        raise FileFormatError(name, f"is for {was} px, and the pictures have {size[0]} x {size[1]}; give the rig of these pictures",
                              code="calibration_size_mismatch")  # fmt: skip
    text = f"the rig is for {was} px; it was scaled to the pictures' size, which is right if they were resized and wrong if cropped"
    note = Note("calibration_size_mismatch", text, "calibrate at this size")
    return RigFound(rig.resized(*size), (*found.notes, note), found.rectified)


# -- the match -------------------------------------------------------------------------------------------


def _gray(photo: Photo) -> Pixels:
    import cv2

    return np.asarray(cv2.cvtColor(photo.pixels, cv2.COLOR_RGB2GRAY))


def _limits(text: str, width: int) -> tuple[int, int]:
    words = text.split(":")
    try:
        low, high = (int(word) for word in words)
    except ValueError:
        low, high = 0, 0
    if not -width < low < high < width or high - low > MOST_DISPARITIES:
        allowed = f"write the least and the greatest in whole pixels, as 0:128, at most {MOST_DISPARITIES} apart and within the width"
        raise InputError("--disparities", text, allowed)
    return low, high


def _disparity(left: Photo, right: Photo, pair: Rectified, grays: tuple[Pixels, Pixels], facts: PairFacts,
               asked: Asked) -> tuple[Disparity, tuple[Note, ...]]:  # fmt: skip
    notes: tuple[Note, ...] = ()
    if asked.model is not None:
        from ..networks.disparity import network_disparity

        found = network_disparity(asked.model, *pair.pair(left.pixels, right.pixels))
    else:
        found, notes = _dense(*grays, facts.low_px, facts.high_px)
    found = _within(found, pair)
    if asked.smooth:
        found = smoothed(found, np.ascontiguousarray(pair.pair(left.pixels, right.pixels)[0]))
    elif asked.fill:
        found = filled(found)
    return (_within(found, pair) if asked.smooth or asked.fill else found), notes


def _within(found: Disparity, pair: Rectified) -> Disparity:
    """Without what rectification left empty at the edges: there nothing matches nothing."""
    if pair.as_taken:
        return found
    camera = pair.rig.left
    places = smooth_map(pair.to_left, pair.width_px, pair.height_px)
    x, y = places[0], places[1]
    inside = (x > 0) & (y > 0) & (x < camera.width_px - 1) & (y < camera.height_px - 1)
    nothing = np.float32(np.nan)
    return dataclasses.replace(found, px=np.where(inside, found.px, nothing), sigma_px=np.where(inside, found.sigma_px, nothing),
                               filled=found.filled & inside)  # fmt: skip


def _dense(left: Pixels, right: Pixels, low: int, high: int) -> tuple[Disparity, tuple[Note, ...]]:
    """At full size, or at a smaller one where that would take too long."""
    import cv2

    work = left.size * (high - low + 1)
    by = int(np.ceil((work / MOST_WORK) ** (1 / 3)))
    if by <= 1:
        return dense(left, right, low, high), ()
    size = (left.shape[1] // by, left.shape[0] // by)
    small = [cv2.resize(one, size, interpolation=cv2.INTER_AREA) for one in (left, right)]
    found = dense(small[0], small[1], int(np.floor(low / by)), int(np.ceil(high / by)))
    wide = (left.shape[1], left.shape[0])
    grown = [cv2.resize(one * by, wide, interpolation=cv2.INTER_NEAREST) for one in (found.px, found.sigma_px)]
    text = f"the pictures are large: they were matched densely at 1/{by} of their size; single points are matched at full size"
    note = Note("reduced_resolution", text, "give a cut-out, or smaller --disparities")
    return Disparity(grown[0], grown[1], np.zeros(left.shape, bool), low, high, found.unsure), (note,)


def _shutter(kind: str) -> tuple[Note, ...]:
    if kind not in ("rolling", "global"):
        raise InputError("--shutter", kind, "write rolling or global")
    if kind == "global":
        return ()
    text = ("rows were taken one after the other, over 10 to 60 ms: what moves, or all if the rig moved, lies elsewhere in the two "
            "pictures unless both shutters ran together; intervals hold for what stood still")  # fmt: skip
    return (Note("rolling_shutter", text, "let rig and scene stand still, or use cameras with a global shutter"),)


# -- measuring -------------------------------------------------------------------------------------------


def _at(matched: Matched, spot: Observation, label: str, level: float, seed: int) -> Sequence[Measurement]:
    found = spot_match(matched.left, matched.right, matched.found, matched.pair, spot.points_px[0])
    inputs = method.Inputs(
        rig=matched.pair.rig,
        spot=Observation(spot.points_px, 0.0, source="a pixel, as named"),
        disparity=_quantity(found),
    )
    return _measured(method.METHOD, inputs, found.notes, label, level, seed)


def _in_box(matched: Matched, box: tuple[float, ...], label: str, level: float, seed: int) -> Sequence[Measurement]:
    found: BoxMatch = box_match(matched.found, matched.pair, box)
    middle = Observation(found.spot_px[None], 0.0, source="the middle of the box")
    inputs = method.Inputs(rig=matched.pair.rig, spot=middle, disparity=_quantity(found))
    return _measured(method.METHOD, inputs, found.notes, label, level, seed)


def _length(matched: Matched, ends: Observation, label: str, level: float, seed: int) -> Sequence[Measurement]:
    found = [spot_match(matched.left, matched.right, matched.found, matched.pair, one) for one in ends.points_px]
    first, second = map(_quantity, found)
    inputs = method.LengthInputs(rig=matched.pair.rig, ends=ends, first=first, second=second)
    notes = tuple({note.code: note for one in found for note in one.notes}.values())
    return _measured(method.LENGTH, inputs, notes, label, level, seed)


def _quantity(found: SpotMatch | BoxMatch) -> Quantity:
    return Quantity.normal(found.disparity_px, found.sigma_px, "px", found.source)


def _measured(
    way: Any, inputs: Any, notes: tuple[Note, ...], label: str, level: float, seed: int
) -> tuple[Measurement, ...]:
    measured = propagate.measure(way, inputs, level=level, seed=seed, label=label, given=given(inputs))
    return (dataclasses.replace(measured[0], notes=(*measured[0].notes, *notes)), *measured[1:])


# -- places ----------------------------------------------------------------------------------------------


def _points(text: str, count: int, name: str, photo: Photo) -> Observation:
    seen = Observation.parse(text, name=name, count=count)
    limit = np.array([photo.width_px, photo.height_px]) - 0.5
    if np.any(seen.points_px < -0.5) or np.any(seen.points_px > limit):
        raise InputError(
            name, text, f"the picture has {photo.width_px} x {photo.height_px} px; all points must lie in it"
        )
    return seen


def _box(text: str, photo: Photo) -> tuple[float, float, float, float]:
    corners = _points(text, 2, "--box", photo).points_px
    (x1, y1), (x2, y2) = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
    if x2 - x1 < 2 or y2 - y1 < 2:
        raise InputError("--box", text, "give two opposite corners, more than 2 px apart")
    return x1, y1, x2, y2


def _shape(points_px: Array, label: str, *, closed: bool) -> Shape:
    return Shape(tuple((float(x), float(y)) for x, y in points_px), closed, label)
