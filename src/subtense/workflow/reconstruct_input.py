"""What `subtense reconstruct` is told, as nouns: known sizes for the scale, checks, positions, and what to measure."""

from __future__ import annotations

import csv
import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .. import assumptions
from ..arrays import Array
from ..errors import FileFormatError, InputError
from ..quantity import Quantity
from ..scale import Known
from ..scene import Scene
from ..scene_files import geojson
from ..views import Track, Views
from .triangulate import track_of

EXAMPLE = "'a.jpg:120,80; b.jpg:95,82 -> a.jpg:640,80; b.jpg:610,82 = 1.20 m'"
Found = Callable[[Track], Track]
"""A point set in one picture to the same point in others."""


def split_ends(text: str, option: str) -> list[str]:
    """The ends of `END -> END`.

    Raises:
        InputError: none, or more than two.
    """
    ends = [end.strip() for end in text.replace("→", "->").split("->")]
    if not 1 <= len(ends) <= 2 or not all(ends):
        raise InputError(option, text, f"write one or two ends, as {EXAMPLE}")
    return ends


def end_of(text: str, views: Views, label: str, option: str, found: Found) -> Track:
    """A point in pictures, found in others where it is set in one only; or a picture's own place, by its name."""
    if text in views.names:
        return Track.place(text)
    track = track_of(text, views, label, option)
    return found(track) if len(track.names) == 1 else track


def known_lengths(texts: Sequence[str], views: Views, found: Found, *, check: bool = False) -> list[Known]:
    """`END -> END = LENGTH` each; an end is a point in pictures, or a picture's name for the place where it was taken."""
    option = "--check" if check else "--distance"
    known = []
    for i, text in enumerate(texts, 1):
        what, equals, length = text.rpartition("=")
        ends = split_ends(what, option) if equals else []
        if len(ends) != 2:
            raise InputError(option, text, f"write two ends and a length, as {EXAMPLE}")
        size = Quantity.parse(length.strip(), "m", bare="no unit", name=option, assume=assumptions.size)
        label = f"{'check' if check else 'distance'} {i}"
        tracks = tuple(end_of(end, views, f"{label}, end {k}", option, found) for k, end in enumerate(ends, 1))
        places = [track for track in tracks if track.is_place]
        if len(places) == 2:
            names = tuple(track.names[0] for track in places)
            known.append(Known("cameras", size, names=names, label=f"{names[0]} to {names[1]}", check=check))
        else:
            known.append(Known("points", size, tracks, label=label, check=check))
    return known


def known_baselines(text: str | None, views: Views) -> list[Known]:
    """`LEFT, RIGHT = LENGTH`: pictures of a stereo rig, by the beginnings of their names; each pair is as far apart."""
    if text is None:
        return []
    pair, equals, length = text.rpartition("=")
    sides = [side.strip() for side in pair.split(",")]
    if not equals or len(sides) != 2 or not all(sides):
        raise InputError(
            "--baseline",
            text,
            "write how the left and the right pictures begin, and their distance: 'left, right = 120 mm'",
        )
    size = Quantity.parse(length.strip(), "m", bare="no unit", name="--baseline", assume=assumptions.size)
    rest = [{name.removeprefix(side): name for name in views.names if name.startswith(side)} for side in sides]
    pairs = [(rest[0][key], rest[1][key]) for key in rest[0] if key in rest[1]]
    if not pairs:
        raise InputError("--baseline", text, "no two pictures have names that differ in these beginnings only")
    return [Known("cameras", size, names=pair, label=f"baseline of {pair[0]}") for pair in pairs]


def known_heights(texts: Sequence[str], views: Views, found: Found) -> list[Known]:
    """`a.jpg = 1.60 m over a.jpg:1,2; b.jpg:3,4 | ... | ...`: a picture's height over three points of the ground or more."""
    known = []
    for text in texts:
        head, over, ground = text.partition(" over ")
        name, equals, length = head.partition("=")
        ends = [end.strip() for end in ground.split("|")]
        if not over or not equals or len(ends) < 3:
            raise InputError("--camera-height", text, "write a picture, its height, and three points of the ground: "
                             "'a.jpg = 1.6 m over a.jpg:1,2; b.jpg:3,4 | a.jpg:5,6; b.jpg:7,8 | ...'")  # fmt: skip
        views.index(name.strip())
        size = Quantity.parse(length.strip(), "m", bare="no unit", name="--camera-height", assume=assumptions.size)
        tracks = tuple(
            end_of(end, views, f"ground point {k}", "--camera-height", found) for k, end in enumerate(ends, 1)
        )
        known.append(Known("height", size, tracks, (name.strip(),), label=f"height of {name.strip()}"))
    return known


@dataclass(frozen=True)
class Positions:
    """Where pictures were taken.

    Attributes:
        of: by the picture's name, the place and its standard deviations, m; NaN where a row states none.
        frame: what the places count from.
    """

    of: Mapping[str, tuple[Array, Array]]
    frame: str


TAGS = "tags"
"""Instead of a table: the positions in the pictures' own files, read because a person asks for them by this name."""


def positions_told(told: Path, photos: Mapping[str, Path]) -> Positions:
    """Of each picture its position, from a table or, where `told` is TAGS, from the pictures' own files.

    Raises:
        FileFormatError: a table that can't be read.
        InputError: fewer than three files tell a position.
    """
    if str(told) != TAGS:
        return read_positions(told)
    from ..private_tags import position_of

    unknown = np.full(3, math.nan)
    found = {
        name: (np.array(place), unknown) for name, path in photos.items() if (place := position_of(path)) is not None
    }
    if len(found) < 3:
        raise InputError(
            "--positions",
            TAGS,
            f"{len(found)} of {len(photos)} pictures tell a position; give a table of three or more",
        )
    return _geographic(found)


def read_positions(path: Path) -> Positions:
    """Of each picture its position and its standard deviations, m, from a table `name,x,y,z[,u][,u_z]`, or `name,lat,lon,alt[,u][,u_z]`.

    Latitude and longitude become metres to the east and north of the first row (WGS 84), altitudes metres up from it.

    Raises:
        FileFormatError: no such file, no such columns, or a row that can't be read.
    """
    if not path.is_file() or path.stat().st_size > 2**24:
        raise FileFormatError(path, "no such file, or larger than 16 MiB")
    rows = list(csv.reader(path.read_text("utf-8", errors="replace").splitlines()))
    head = [cell.strip().lower() for cell in rows[0]] if rows else []
    geographic = head[:4] in (["name", "lat", "lon", "alt"], ["name", "latitude", "longitude", "altitude"])
    if not geographic and head[:4] != ["name", "x", "y", "z"]:
        raise FileFormatError(path, "its first line must be name,x,y,z[,u][,u_z] or name,lat,lon,alt[,u][,u_z]")
    found: dict[str, tuple[Array, Array]] = {}
    for number, row in enumerate(rows[1:], 2):
        if not any(cell.strip() for cell in row):
            continue
        try:
            values = np.array([float(cell) for cell in row[1:]])
        except ValueError:
            values = np.zeros(0)
        if not 3 <= len(values) <= 5 or not np.all(np.isfinite(values)) or np.any(values[3:] < 0):
            raise FileFormatError(path, f"line {number}: three numbers behind the name, and their u in metres")
        u = values[3] if len(values) > 3 else math.nan
        found[row[0].strip()] = (values[:3], np.array([u, u, values[4] if len(values) > 4 else u]))
    if geographic and found:
        return _geographic(found)
    return Positions(found, f"the positions of {path.name}")


def _geographic(found: Mapping[str, tuple[Array, Array]]) -> Positions:
    first = next(iter(found.values()))[0]
    return Positions(_in_metres(found), geojson.FRAME + ",".join(f"{x:.9f}" for x in first))


def _in_metres(found: Mapping[str, tuple[Array, Array]]) -> dict[str, tuple[Array, Array]]:
    """East, north and up of the first row, by the radii of curvature of WGS 84 there; good to 1e-6 within a few kilometres."""
    first = next(iter(found.values()))[0]
    east, north = geojson.radii_m(math.radians(float(first[0])), float(first[2]))
    out = {}
    for name, (place, u) in found.items():
        d = np.radians(place[:2] - first[:2])
        out[name] = (np.array([east * d[1], north * d[0], place[2] - first[2]]), u)
    return out


def known_positions(told: Positions, accuracy: str | None, scene: Scene) -> Known:
    """The positions of the scene's pictures as one known thing; `accuracy` is that of rows that state none."""
    positions = told.of
    names = [name for name in scene.names if name in positions]
    if len(names) < 3:
        raise InputError(
            "--positions",
            f"of {len(names)} pictures of the scene",
            "give those of three pictures or more, by their names",
        )
    stated = (
        None
        if accuracy is None
        else float(Quantity.parse(accuracy_text(accuracy), "m", bare="no unit", name="--accuracy").u)
    )
    u = np.array([positions[name][1] for name in names])
    if np.any(np.isnan(u)) and stated is None:
        raise InputError(
            "--accuracy", None, "say how well the positions are known: '2 cm (1s)' for RTK, '3 m (1s)' for plain GPS"
        )
    u = np.where(np.isnan(u), stated if stated is not None else 0.0, u)
    places = np.array([positions[name][0] for name in names])
    one = Quantity.exact(1.0, "1", "positions")
    return Known("positions", one, names=tuple(names), places_m=places, sigma_m=u, label="positions")


def accuracy_text(text: str) -> str:
    """A bare length as the ± of a quantity."""
    return text if "±" in text or "+-" in text else f"0 ± {text}"


def measured_ends(text: str, views: Views, number: int, found: Found) -> tuple[list[Track], str]:
    """The ends of what is to be measured, and its label."""
    ends = split_ends(text, "--measure")
    tracks = [
        end_of(end, views, f"point {number}" + ("ab"[k] if len(ends) > 1 else ""), "--measure", found)
        for k, end in enumerate(ends)
    ]
    labels = [track.names[0] if track.is_place else track.seen.label for track in tracks]
    return [dataclasses.replace(track) for track in tracks], " to ".join(labels)
