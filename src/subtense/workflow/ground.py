"""Measuring on the ground of a photo: from what a person typed to a Document."""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

from ..document import Document, Shape
from ..errors import InputError
from ..methods import ground_footprint, ground_length, ground_plane, ground_sampling, ground_speed
from ..observation import Observation
from ..photo import Photo
from ..quantity import Measurement, Note, Quantity
from ..told_pose import ToldPose
from .in_photo import Item, measure_item, measure_items
from .resolve_camera import Resolved, SentFile, resolve_camera

MOST_POINTS = 1000
"""Of one call: each is measured with its own budget; `propagate.rows` serves more."""
U_TAKEOFF_M = 3.0
"""u of the ground's height above the place of the take-off, where nothing was said: 1 % over some hundred metres."""
STEEPEST_RAD = math.radians(60.0)
RESOLVED = 3.0
"""A length of less of its u is not resolved."""
NOT_BELOW_0 = {(ground_plane.METHOD.name, "ground_distance"), (ground_length.METHOD.name, "length"),
               (ground_speed.METHOD.name, "speed"), (ground_speed.METHOD.name, "length")}  # fmt: skip
"""What is a distance between two points, whose draws all lie above it where it is small."""
GROUND, START = "the ground", "the take-off"
_DATUMS = {"ground": GROUND, "the ground": GROUND, "takeoff": START, "take-off": START, "start": START, "the take-off": START,
           "the start": START}  # fmt: skip


@dataclass(frozen=True)
class GroundTexts:
    """What a person typed of how the camera stands; None where nothing was said.

    Attributes:
        height: above the ground, "1.6 ± 0.02 m"; or of a drone "40 ± 1 m above take-off", or "above" another datum with a terrain model.
        pitch: above the horizon, "-12 ± 0.5 deg"; by default as the file tells it.
        roll: right side down.
        horizon: points of the horizon.
        dip: "0" for a vanishing line, "1" for the visible edge of a sea or plain.
        parallels: two points of a level line, two of one parallel to it, and perhaps the same of another pair.
        reference: two points on the ground, instead of the height.
        reference_length: how far apart they are.
        slope: of the ground, rising ahead, "0 ± 1 deg".
        cross_slope: rising to the right; by default as doubtful as `slope`.
        rise: of the ground there above the ground, or the take-off, that the height counts from.
        point_height: of the points above the ground.
        refraction: its coefficient.
    """

    height: str | None = None
    pitch: str | None = None
    roll: str | None = None
    horizon: str | None = None
    dip: str | None = None
    parallels: str | None = None
    reference: str | None = None
    reference_length: str | None = None
    slope: str | None = None
    cross_slope: str | None = None
    rise: str | None = None
    point_height: str | None = None
    refraction: str | None = None


@dataclass(frozen=True)
class TerrainTexts:
    """A terrain model, and where in it the camera was.

    Attributes:
        file: a GeoTIFF.
        position: of the camera in the model's coordinates, "E,N" or "E,N ± 3 m".
        heading: of the picture's upper middle, clockwise from the model's north, "123 ± 3 deg".
        sigma: of the model's heights, "± 0.5 m".
        datum: what its heights count from, where the file does not name it.
    """

    file: Path
    position: str
    heading: str
    sigma: str
    datum: str | None = None


def ground_document(
    photo: Photo, feet: Sequence[str] = (), *, lengths: Sequence[str] = (), moves: Sequence[str] = (), time: str | None = None,
    readout: str | None = None, places: Sequence[str] = (), footprint: bool = False, said: GroundTexts | None = None,
    terrain: TerrainTexts | None = None, camera: str | SentFile | Resolved | None = None, level: float = 0.95, seed: int = 0,
) -> Document:  # fmt: skip
    """Distances, lengths, speeds, sampling distances and the footprint on the ground of one photo.

    Args:
        photo: the picture, upright.
        feet: points on the ground, "x,y" or several "x1,y1;x2,y2", px.
        lengths: two points each.
        moves: a foot point in this picture, and in a later one of the same standing camera.
        time: between those pictures, "0.5 ± 0.01 s", or the two times of day "12:00:01.25 to 12:00:01.75".
        readout: of a rolling shutter from the first row to the last, s.
        places: points whose ground sampling distance is wanted.
        footprint: whether the ground that the picture shows is wanted.
        said: of how the camera stands.
        terrain: a model of the ground, for `feet`.
        camera: what the user said of it; None to go by the photo.
        level: coverage of the intervals.
        seed: of the draws.

    Raises:
        InputError: nothing to measure, or a text that can't be used.
        UnknownCameraError, GeometryError: no camera, no finite answer.
        FileFormatError, MissingExtraError: a terrain model that can't be used, or its reader is not installed.
    """
    said = said or GroundTexts()
    resolved = camera if isinstance(camera, Resolved) else resolve_camera(photo, camera)
    items = _items(feet, lengths, moves, time, readout, places, footprint, said)
    datum, common, notes = standing(said, resolved.pose)
    if terrain is not None:
        from .on_terrain import on_terrain  # nothing else needs it

        items = on_terrain(items, terrain, datum, common, resolved, photo)
    elif datum not in (GROUND, START):
        raise InputError(
            "--height", said.height, "give it above the ground, or a terrain model of heights above the same datum"
        )
    else:
        items = [
            dataclasses.replace(item, inputs={**common, **item.inputs}, notes=(*item.notes, *notes)) for item in items
        ]
    if len(items) == 1:
        found = measure_item(items[0], photo, resolved, level=level, seed=seed)
    else:
        found = measure_items(items, photo, resolved, level=level, seed=seed)
    return dataclasses.replace(
        found, measurements=tuple(_resolved(m) for m in found.measurements), shapes=_drawn(found.shapes)
    )


def _drawn(shapes: Sequence[Shape]) -> tuple[Shape, ...]:
    """What all points share drawn once, and level lines each on its own."""
    kept: list[Shape] = []
    for shape in dict.fromkeys(shapes):
        if shape.label != "parallels":
            kept.append(shape)
            continue
        ends = [shape.points_px[i : i + 2] for i in range(0, len(shape.points_px), 2)]
        kept += [Shape(pair, False, "parallels") for pair in ends]
    return tuple(kept)


def _items(
    feet: Sequence[str], lengths: Sequence[str], moves: Sequence[str], time: str | None, readout: str | None,
    places: Sequence[str], footprint: bool, said: GroundTexts,
) -> list[Item]:  # fmt: skip
    """What to measure, without how the camera stands."""
    points = [one for text in feet for one in _single(Observation.parse(text, name="--point"))]
    where = [one for text in places for one in _single(Observation.parse(text, name="--sampling"))]
    above = _length(said.point_height, "--point-height")
    height = {} if above is None else {"point_height": above}
    items = [
        Item(ground_plane.METHOD, {"foot": one, **height}, _named("point", i, points))
        for i, one in enumerate(points, 1)
    ]
    ends = [Observation.parse(text, name="--length", count=2) for text in lengths]
    both = {} if above is None else {"first_height": above, "second_height": dataclasses.replace(above)}
    items += [
        Item(ground_length.METHOD, {"ends": one, **both}, _named("length", i, ends)) for i, one in enumerate(ends, 1)
    ]
    if moves and time is None:
        raise InputError("--time", None, "give the time between the two pictures, as '0.5 ± 0.01 s'")
    ways = [Observation.parse(text, name="--move", count=2) for text in moves]
    timed: dict[str, Any] = {"time": read_time(time)} if time is not None else {}
    if readout is not None:
        timed["readout"] = Quantity.parse(readout, "s", name="--readout")
    items += [
        Item(ground_speed.METHOD, {"ends": one, **timed}, _named("move", i, ways)) for i, one in enumerate(ways, 1)
    ]
    items += [
        Item(ground_sampling.METHOD, {"place": one}, _named("sampling", i, where)) for i, one in enumerate(where, 1)
    ]
    items += [Item(ground_footprint.METHOD, {}, "footprint")] if footprint else []
    if not items:
        raise InputError("--point", None, "give a point on the ground, as --point 640,410")
    if len(items) > MOST_POINTS:
        allowed = f"give {MOST_POINTS} or fewer at once; propagate.rows of the Python API measures millions"
        raise InputError("--point", f"{len(items)} points", allowed)
    return items


def _single(seen: Observation) -> list[Observation]:
    return [dataclasses.replace(seen, points_px=point[None]) for point in seen.points_px]


def _named(word: str, number: int, all_of_them: Sequence[Any]) -> str:
    return f"{word} {number}" if len(all_of_them) > 1 else word


def standing(said: GroundTexts, told: ToldPose | None) -> tuple[str, dict[str, Any], tuple[Note, ...]]:
    """How the camera stands, by what was typed and what the file tells.

    Returns:
        What the height counts from, the fields of `ground.Standing` but the camera, and notes.

    Raises:
        InputError: something is missing, contradicts, or can't be read.
    """
    datum, fields, notes = _height(said, told)
    fields |= _attitude(said, told)
    slope = _angle(said.slope, "--slope", STEEPEST_RAD)
    cross = _angle(said.cross_slope, "--cross-slope", STEEPEST_RAD)
    if slope is not None and cross is None:  # ground said to be level to so much is so both ways
        cross = Quantity(0.0, slope.u, "rad", slope.distribution, slope.dof, f"{slope.source}, across as ahead")
    k = None if said.refraction is None else Quantity.parse(said.refraction, "1", name="--refraction")
    if k is not None and not -10 < float(k.value) < 1:
        raise InputError("--refraction", said.refraction, "give a coefficient below 1, as '0.13 ± 0.1'")
    fields |= {"slope": slope, "cross_slope": cross, "refraction": k}
    return datum, {name: _known(name, value) for name, value in fields.items() if value is not None}, notes


def _known(name: str, value: Any) -> Any:
    """The noun with an identity that a document keeps, so that what several measurements share stays one there."""
    return dataclasses.replace(value, id=value.id or f"{name} {value.digest}") if isinstance(value, Quantity) else value


def _height(said: GroundTexts, told: ToldPose | None) -> tuple[str, dict[str, Any], tuple[Note, ...]]:
    rise = _length(said.rise, "--rise")
    if said.reference is not None:
        if said.height is not None:
            raise InputError("--reference", said.reference, "give either --height or a reference")
        if said.reference_length is None:
            raise InputError("--reference-length", None, "give how far apart the two points of --reference are")
        length = _length(said.reference_length, "--reference-length", above_0=True)
        return GROUND, {"reference": _marked(said.reference, "reference", 2), "reference_length": length,
                        "rise": rise}, ()  # fmt: skip
    if said.height is not None:
        text, word, name = re.sub(r"\s+", " ", said.height.strip()).partition(" above ")
        datum = _DATUMS.get(name.strip().lower(), name.strip()) if word else GROUND
        height = _length(text, "--height", above_0=True)
    elif told is not None and told.height_m is not None and told.u_height_m is not None:
        if not told.height_m > 0:
            allowed = "the file tells a height below its take-off; give --height above the ground"
            raise InputError("--height", f"{told.height_m:g} m", allowed)
        datum, height = (
            START,
            Quantity.normal(told.height_m, told.u_height_m, "m", f"{told.source}: height above the take-off"),
        )
    else:
        raise InputError(
            "--height", None, "give the camera's height above the ground, as '1.6 ± 0.02 m', or --reference"
        )
    if datum != START or rise is not None:
        return datum, {"height": height, "rise": rise}, ()
    rise = Quantity.normal(0.0, U_TAKEOFF_M, "m", f"assumed: as high as the take-off, to {U_TAKEOFF_M:g} m (1s)")
    text = f"the height counts from the take-off; the ground in the picture is taken to lie as high, to {U_TAKEOFF_M:g} m (1s)"
    cure = "give --rise, how much higher the ground there is than the take-off, or the height above the ground"
    return datum, {"height": height, "rise": rise}, (Note("height_above_takeoff", text, cure),)


def _attitude(said: GroundTexts, told: ToldPose | None) -> dict[str, Any]:
    """Pitch and roll, or the horizon, or level lines, as typed; else as the file tells."""
    typed = [name for name in ("pitch", "horizon", "parallels") if getattr(said, name) is not None]
    if len(typed) > 1:
        raise InputError(f"--{typed[1]}", getattr(said, typed[1]), f"give either --{typed[0]} or --{typed[1]}")
    found: dict[str, Any] = {"roll": _angle(said.roll, "--roll", math.pi)}
    if said.dip is not None:
        if said.horizon is None:
            raise InputError("--dip", said.dip, "it is of --horizon, so give that too")
        share = said.dip.strip()
        found["dip"] = (
            Quantity.exact(float(share), "1", "stated")
            if share in ("0", "1")
            else Quantity.parse(share, "1", name="--dip")
        )
    if said.horizon is not None:
        return {**found, "horizon": _marked(said.horizon, "horizon")}
    if said.parallels is not None:
        return {**found, "parallels": _marked(said.parallels, "parallels")}
    if said.pitch is not None:
        return {**found, "pitch": _angle(said.pitch, "--pitch", math.pi / 2)}
    if told is None:
        raise InputError("--pitch", None, "the file does not tell how the camera stood; give '--pitch \"-5 ± 0.5 deg\"', --horizon, or "
                         "--parallels")  # fmt: skip
    if found["roll"] is None:
        found["roll"] = Quantity.normal(told.roll_rad, told.u_rad, "rad", told.source)
    return {**found, "pitch": Quantity.normal(told.pitch_rad, told.u_rad, "rad", told.source)}


def _marked(text: str, field: str, count: int | None = None) -> Observation:
    """Points that tell how the camera stands, labelled for the budget."""
    return dataclasses.replace(Observation.parse(text, name=f"--{field}", count=count), label=f"the {field}")


def _angle(text: str | None, name: str, limit_rad: float) -> Quantity | None:
    if text is None:
        return None
    angle = Quantity.parse(text, "rad", bare="deg", name=name)
    if not abs(float(angle.value)) <= limit_rad + 1e-9:
        raise InputError(
            name, text, f"give an angle from -{math.degrees(limit_rad):g}° to {math.degrees(limit_rad):g}°"
        )
    return angle


def _length(text: str | None, name: str, *, above_0: bool = False) -> Quantity | None:
    if text is None:
        return None
    length = Quantity.parse(text, "m", bare="m", name=name)
    if above_0 and not float(length.value) > 0:
        raise InputError(name, text, "give a length above 0")
    return length


def read_time(text: str) -> Quantity:
    """The time between two pictures: a duration with its ±, or two times of day or dates, each cut at its last digit.

    Raises:
        InputError: neither, or a second time that is not later.
    """
    first, word, second = text.partition(" to ")
    if not word:
        time = Quantity.parse(text, "s", name="--time")
    else:
        (begin, cut), (end, cut_too) = _instant(first, text), _instant(second, text)
        u = math.sqrt((cut**2 + cut_too**2) / 12)
        seconds = (end - begin).total_seconds()
        source = "two times, each cut at its last digit"
        time = (Quantity.between(seconds - cut, seconds + cut, "s", "triangular", source) if cut == cut_too
                else Quantity.normal(seconds, u, "s", source))  # fmt: skip
    if not float(time.value) > 0:
        raise InputError("--time", text, "the second picture must be later than the first")
    return time


def _instant(text: str, whole: str) -> tuple[datetime, float]:
    """A time and the size of its last digit, s."""
    shown = re.sub(r"^(\d{4}):(\d\d):(\d\d)\b", r"\1-\2-\3", text.strip())  # as EXIF writes a date
    if re.match(r"\d\d?:\d\d", shown):
        shown = f"2000-01-01 {shown}"
    try:
        instant = datetime.fromisoformat(shown)
    except ValueError:
        raise InputError("--time", whole, "give '0.5 ± 0.01 s', or two times as '12:00:01.25 to 12:00:01.75'") from None
    digits = re.search(r"\.(\d+)", shown)
    return instant.replace(tzinfo=None), 10.0 ** -len(digits.group(1)) if digits else 1.0


def _resolved(m: Measurement) -> Measurement:
    """A length, a speed or a distance of less than three of its u, whose interval reaches down to 0: nothing shows that it is not."""
    if (m.method, m.what) not in NOT_BELOW_0 or m.u is None or m.value >= RESOLVED * m.u:
        return m
    far = "the point and the camera's foot" if m.what == "ground_distance" else "the two points"
    text = f"{far} are less than {RESOLVED:g} u apart: whether they are apart at all is not shown"
    note = Note("length_not_resolved", text, "mark the points more closely, or come nearer")
    return dataclasses.replace(m, low=0.0, notes=(*m.notes, note))
