"""The table of sensors: of phones' lenses, drones, camera boards and single sensors; see data/sensors.toml.

Not to be mixed up with `presets`, the classes that a person names where nothing better is known.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import cache
from typing import Any

from .errors import FileFormatError
from .metadata import Metadata

FOCAL_TOLERANCE = 0.02
"""Logarithm of focal lengths within which both are of one lens: phones round to a few digits."""
F35_TOLERANCE = 0.05
"""The same of 35 mm equivalents, besides half a millimetre of rounding."""
F_NUMBER_TOLERANCE = 0.04
GROUPS = ("phone", "drone", "board", "sensor")
KEYS = {"title", "group", "makes", "models", "focal_mm", "f35_mm", "f_number", "pitch_um", "width_mm", "height_mm", "native_px", "u",
        "modes", "k1", "several", "varies", "holds", "source"}  # fmt: skip


@dataclass(frozen=True)
class Mode:
    """A mode of a camera that reads a part of its sensor, or bins it.

    Attributes:
        width_px: of its pictures.
        height_px: of its pictures.
        native_px: how many of the sensor's pixels their width spans.
    """

    width_px: int
    height_px: int
    native_px: int


@dataclass(frozen=True)
class Sensor:
    """One row; what it does not say is None. Lengths in mm as in the tags.

    Attributes:
        name: of the row.
        title: as people call it.
        group: phone, drone, board, sensor.
        makes: camera makers as in EXIF; none for a sensor that goes by its name.
        models: camera models as in EXIF, whole; a star stands for anything.
        focal_mm: focal length that this lens writes into its pictures.
        f35_mm: 35 mm equivalent that it writes without digital zoom.
        f_number: its aperture.
        width_mm: of the active area.
        height_mm: of the active area.
        native_px: its pixels across and down.
        u: relative u of the width, as published figures spread.
        modes: picture sizes that do not span the sensor, and which also do.
        k1: first radial distortion coefficient of a published calibration.
        several: the model's name is of several cameras.
        varies: boards with this sensor are sold with other lenses, and the tags do not tell.
        holds: of which mode, empty for all.
        source: who prints the figures.
    """

    name: str
    title: str
    group: str
    makes: tuple[str, ...]
    models: tuple[str, ...]
    focal_mm: float | None
    f35_mm: float | None
    f_number: float | None
    width_mm: float
    height_mm: float
    native_px: tuple[int, int]
    u: float
    modes: tuple[Mode, ...]
    k1: float | None
    several: bool
    varies: bool
    holds: str
    source: str

    @property
    def crop_factor(self) -> float:
        """35 mm equivalent over focal length, by the diagonal."""
        return math.hypot(36.0, 24.0) / math.hypot(self.width_mm, self.height_mm)

    def to_json(self) -> dict[str, Any]:
        """A row of a menu."""
        names = ("name", "title", "group", "focal_mm", "f35_mm", "f_number", "width_mm", "height_mm", "u", "source")
        return {**{name: getattr(self, name) for name in names}, "native_px": list(self.native_px)}


@cache
def sensors() -> dict[str, Sensor]:
    """All rows by name."""
    import tomllib
    from importlib.resources import files

    table = tomllib.loads(files("subtense").joinpath("data/sensors.toml").read_text("utf-8"))
    return {name: _row(name, row) for name, row in table.items()}


def search(words: str | Sequence[str]) -> list[Sensor]:
    """The rows that hold every word in their name, title, group, makes or models, whatever its case."""
    wanted = [word.lower() for word in (words.split() if isinstance(words, str) else words)]
    return [row for row in sensors().values()
            if all(word in " ".join((row.name, row.title, row.group, *row.makes, *row.models)).lower() for word in wanted)]  # fmt: skip


def of_model(tags: Metadata) -> list[Sensor]:
    """The rows of a camera, by its whole maker's and model's name."""
    make, model = (tags.make or "").lower(), (tags.model or "").lower()
    return [row for row in sensors().values() if make in map(str.lower, row.makes)
            and any(fnmatchcase(model, pattern.lower()) for pattern in row.models)]  # fmt: skip


def single_out(tags: Metadata, rows: Sequence[Sensor]) -> list[Sensor]:
    """Those rows of a camera that its lens may be: focal length, aperture and equivalent must all fit, where both tell them.

    A digital zoom makes the equivalent longer, so a longer one fits too; where several rows are left, only what agrees counts.
    """
    fitting = [row for row in rows if _fits(tags, row)]
    near = [row for row in fitting if _near_f35(tags, row)]
    return near if len(fitting) > 1 and near else fitting


def _fits(tags: Metadata, row: Sensor) -> bool:
    if row.group == "phone" and "front" in (tags.lens or "").lower():
        return False
    same_focal = not (row.focal_mm and tags.focal_mm) or _gap(tags.focal_mm, row.focal_mm) <= FOCAL_TOLERANCE
    same_stop = not (row.f_number and tags.f_number) or _gap(tags.f_number, row.f_number) <= F_NUMBER_TOLERANCE
    long_enough = not (row.f35_mm and tags.f35_mm) or tags.f35_mm > row.f35_mm or _near_f35(tags, row)
    return same_focal and same_stop and long_enough


def _near_f35(tags: Metadata, row: Sensor) -> bool:
    told, own = tags.f35_mm, row.f35_mm or (row.crop_factor * tags.focal_mm if tags.focal_mm else None)
    return not (told and own) or _gap(told, own) <= F35_TOLERANCE + 0.5 / told


def _gap(a: float, b: float) -> float:
    return abs(math.log(a / b))


# -- reading -----------------------------------------------------------------------------------------


def _row(name: str, row: Mapping[str, Any]) -> Sensor:
    if not set(row) <= KEYS or row["group"] not in GROUPS:
        raise FileFormatError(
            "sensors.toml", f"row {name}: a row has {', '.join(sorted(KEYS))}, a group is one of {GROUPS}"
        )
    width, height = row["native_px"]
    pitch_mm = row["pitch_um"] / 1000 if "pitch_um" in row else None
    return Sensor(
        name, row["title"], row["group"], tuple(row.get("makes", ())), tuple(row.get("models", ())),
        row.get("focal_mm"), row.get("f35_mm"), row.get("f_number"),
        pitch_mm * width if pitch_mm else row["width_mm"], pitch_mm * height if pitch_mm else row["height_mm"],
        (width, height), row["u"], tuple(Mode(*mode) for mode in row.get("modes", ())), row.get("k1"),
        row.get("several", False), row.get("varies", False), row.get("holds", ""), row["source"],
    )  # fmt: skip
