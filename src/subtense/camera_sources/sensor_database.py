"""Camera from our own table of sensors: phones' lenses, drones, camera boards (data/sensors.toml).

f_px = focal length / sensor width * native pixels that the picture's width spans. A phone's lenses are told apart by model, focal
length, aperture and 35 mm equivalent together; where these do not single out one row, nothing is said. The equivalent must agree
with the row; one that is longer by more than both allow is a digital zoom, if the row is singled out without it.

A picture of the sensor's own proportions spans all of it, however it was binned. One of another size may be a mode that reads a part
of the sensor, or cut from all of it: where the table knows such a mode, both readings are given.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ..assumptions import NOMINAL_FOCAL
from ..camera import Camera
from ..equivalent import Comparison, compared
from ..hypothesis import Hypothesis
from ..photo import Photo
from ..quantity import Note
from ..sensors import Sensor, of_model, single_out
from ..tagged_size import ZOOMED_U, TaggedSize, tagged_size
from ..told_camera import held_together, told_camera

NAME = "sensor_database"
SAME_PROPORTIONS = 0.02
CUT_U = 0.08
"""Relative u where a picture has other proportions than its sensor and no known mode: it may span a part of it only."""
OTHER_LENS_U = 0.05
"""Relative u where boards with this sensor are sold with other lenses too."""
LEAST_ZOOM = 1.12
"""An equivalent that is longer than the row's by less is no zoom, but a contradiction."""


@dataclass(frozen=True)
class _Told:
    """What the equivalent adds to the row: which readings it leaves, the digital zoom, its u, and a note."""

    f_px: list[float]
    zoom: float = 1.0
    u: float = 0.0
    notes: tuple[Note, ...] = ()


def camera(photo: Photo) -> Hypothesis:
    """The hypothesis, or its reason."""
    tags = photo.metadata
    if tags.focal_mm is None:
        return Hypothesis(NAME, None, "the metadata has no focal length")
    rows = of_model(tags)
    if not rows:
        return Hypothesis(NAME, None, f"the table of sensors has no {tags.model or 'camera without a name'}")
    left = single_out(tags, rows)
    if len(left) != 1:
        return _not_singled_out(photo, left)
    row = left[0]
    if row.several and tags.f35_mm is None:
        return Hypothesis(
            NAME, None, f"{tags.model} has several cameras, and no 35 mm equivalent tells which one it was"
        )
    size = tagged_size(photo)
    spans, span_notes = _spans(row, size)
    return _hypothesis(photo, row, size, spans, span_notes)


def _not_singled_out(photo: Photo, left: list[Sensor]) -> Hypothesis:
    tags = photo.metadata
    said = f"{tags.focal_mm:g} mm" + (f" and an equivalent of {tags.f35_mm:g} mm" if tags.f35_mm else "")
    if not left:
        return Hypothesis(NAME, None, f"the table of sensors has no lens of {tags.model} with {said}")
    text = f"{said} may be of {' or '.join(row.title for row in left)}"
    return Hypothesis(NAME, None, text, (Note("lens_ambiguous", text, "give the camera with --camera"),))


def _hypothesis(photo: Photo, row: Sensor, size: TaggedSize, spans: list[float], notes: tuple[Note, ...]) -> Hypothesis:
    focal = photo.metadata.focal_mm
    assert focal is not None
    relative = math.hypot(
        NOMINAL_FOCAL, row.u, _rounding(focal), CUT_U if notes else 0.0, OTHER_LENS_U if row.varies else 0.0
    )
    f_px = [focal / row.width_mm * row.native_px[0] * max(size.whole_px) / span * size.zoom for span in spans]
    told = _by_equivalent(photo, row, size, f_px, math.hypot(relative, size.relative_u))
    if isinstance(told, str):
        return Hypothesis(NAME, None, told)
    text = f"table: {row.title}, sensor {row.width_mm:.3g} mm wide, focal length {focal:g} mm"
    u = math.hypot(relative, told.u)
    readings = [_distorted(told_camera(photo, f * told.zoom, u, text, size), row) for f in told.f_px]
    return Hypothesis(NAME, held_together(readings), text, (*size.notes, *notes, *_lens_note(row), *told.notes),
                      tuple(readings) if len(readings) > 1 else ())  # fmt: skip


def _rounding(focal_mm: float) -> float:
    """Relative u by the rounding of the tag: to a hundredth where it has one, else to a tenth."""
    tenths = abs(focal_mm * 10 - round(focal_mm * 10)) < 1e-6
    return (0.05 if tenths else 0.005) / math.sqrt(3) / focal_mm


def _spans(row: Sensor, size: TaggedSize) -> tuple[list[float], tuple[Note, ...]]:
    """How many native pixels the picture's long side may span, and a note where that is a guess."""
    native = max(row.native_px)
    long, short = max(size.whole_px) / size.scale, min(size.whole_px) / size.scale
    own = native / min(row.native_px)
    modes = {
        mode.native_px for mode in row.modes if abs(mode.width_px - long) < 1.5 and abs(mode.height_px - short) < 1.5
    }
    if modes:
        whole = {float(native)} if long / short >= own * (1 - SAME_PROPORTIONS) else set()
        return sorted({float(one) for one in modes} | whole), ()
    if abs(long / short / own - 1) <= SAME_PROPORTIONS or abs(long - native) < 0.01 * native:
        return [float(native)], ()
    if abs(short - min(row.native_px)) < 0.01 * min(row.native_px):  # its height whole, its sides cut off
        return [min(row.native_px) * long / short], ()
    text = (f"a picture of {round(long)} x {round(short)} px does not have the proportions of its sensor "
            f"({row.native_px[0]} x {row.native_px[1]} px): it may span a part of it only")  # fmt: skip
    note = Note("aspect_mismatch", text, "calibrate the camera in this mode, or use its full-sensor mode")
    # the whole sensor holds the picture: all of its width, or all of its height
    return [native if long / short > own else min(row.native_px) * long / short], (note,)


def _by_equivalent(photo: Photo, row: Sensor, size: TaggedSize, f_px: list[float], u: float) -> _Told | str:
    """Which readings fit the equivalent, and the digital zoom that it tells of; or why it contradicts the row."""
    found = [one for one in (compared(photo, size, f, u) for f in f_px) if one is not None]
    fitting = [f for f, one in zip(f_px, found, strict=False) if one.agrees]
    if not found or fitting:
        return _Told(fitting or f_px)
    nearest: Comparison = min(found, key=lambda one: abs(math.log(one.factor)))
    f35 = photo.metadata.f35_mm or 0.0
    sure = row.focal_mm is not None or row.f_number is not None
    if size.zoom == 1.0 and nearest.factor >= LEAST_ZOOM and sure and len(f_px) == 1:
        text = (f"an equivalent of {f35:g} mm is {nearest.factor:.2f} times that of this lens: taken with a digital zoom, "
                "or cropped by the camera; the focal length is corrected by it")  # fmt: skip
        note = Note("digital_zoom", text, "take the picture without digital zoom")
        return _Told(f_px, nearest.factor, ZOOMED_U, (note,))
    return (f"{row.title}: the sensor's width makes the equivalent {f35 / nearest.factor:.3g} mm, and the metadata "
            f"says {f35:g} mm")  # fmt: skip


def _distorted(made: Camera, row: Sensor) -> Camera:
    """A published coefficient is of another specimen and perhaps of uncorrected pictures: it only widens the doubt of none."""
    if row.k1 is None:
        return made
    cov = np.array(made.cov)
    cov[4, 4] = max(cov[4, 4], row.k1**2)
    return replace(made, cov=cov, id=None)


def _lens_note(row: Sensor) -> tuple[Note, ...]:
    if not row.varies:
        return ()
    text = (f"{row.title}: boards with this sensor are sold with other lenses too, and the focal length in the tags is always "
            "the maker's own")  # fmt: skip
    return (Note("lens_varies", text, "calibrate the camera, or give its focal length with --camera"),)
