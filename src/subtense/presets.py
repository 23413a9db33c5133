"""The table of camera presets: classes with their ranges, and single sensors; see data/presets.toml."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from typing import Any

from .errors import InputError
from .quantity import Quantity
from .sensors import Sensor, sensors


@dataclass(frozen=True)
class Preset:
    """One row; a range is an uncertainty (limits), and what a row does not say is None.

    Attributes:
        name: as on the command line.
        title: as people call it.
        kind: "class" or "sensor".
        sensor_width: m.
        sensor_height: m.
        focal_length: m.
        image_width: px.
        aliases: other names it goes by.
        source: who says so.
    """

    name: str
    title: str
    kind: str
    sensor_width: Quantity
    sensor_height: Quantity | None
    focal_length: Quantity | None
    image_width: Quantity | None
    aliases: tuple[str, ...]
    source: str

    def to_json(self) -> dict[str, Any]:
        """For a menu: names, source, and the limits of each number in mm or px; null where the row does not say it."""

        def limits(quantity: Quantity | None, factor: float) -> list[float] | None:
            if quantity is None:
                return None
            half = float(quantity.u) * math.sqrt(3)
            return [round((float(quantity.value) + sign * half) / factor, 6) for sign in (-1, 1)]

        return {
            "name": self.name, "title": self.title, "kind": self.kind, "aliases": list(self.aliases), "source": self.source,
            "sensor_width_mm": limits(self.sensor_width, 1e-3), "sensor_height_mm": limits(self.sensor_height, 1e-3),
            "focal_mm": limits(self.focal_length, 1e-3), "image_width_px": limits(self.image_width, 1.0),
        }  # fmt: skip


@cache
def presets() -> dict[str, Preset]:
    """All presets by name."""
    import tomllib
    from importlib.resources import files

    table = tomllib.loads(files("subtense").joinpath("data/presets.toml").read_text("utf-8"))
    return {**{name: _class(name, row) for name, row in table["class"].items()},
            **{name: _sensor(name, row) for name, row in table["sensor"].items()}}  # fmt: skip


def find_preset(name: str, option: str = "preset") -> Preset:
    """The preset of a name or alias, whatever its case; names of the table of sensors are presets too.

    Raises:
        InputError: no such preset; the nearest names are given.
    """
    wanted = _plain(name)
    for preset in presets().values():
        if wanted in map(_plain, (preset.name, preset.title, *preset.aliases)):
            return preset
    if wanted in sensors():
        return _of_table(sensors()[wanted])
    import difflib

    near = difflib.get_close_matches(wanted, presets(), 3, 0.4) or list(presets())[:5]
    raise InputError(option, name, f"known are {', '.join(near)} and more: see `subtense presets`")


def _of_table(row: Sensor) -> Preset:
    """A row of the table of sensors, whose list is apart."""
    text = f"sensor {row.name}: spread and rounding of published sizes"
    width, height = (
        Quantity.normal(side / 1000, row.u * side / 1000, "m", text) for side in (row.width_mm, row.height_mm)
    )
    return Preset(row.name, row.title, "sensor", width, height, None, None, (), row.source)


def _plain(name: str) -> str:
    return name.lower().replace('"', "").replace(" ", "-").removesuffix("-inch")


def _limits(row: dict[str, list[float]], key: str, unit: str, factor: float, name: str) -> Quantity:
    low, high = (x * factor for x in row[key])
    return Quantity.uniform(low, high, unit, f"preset {name}: its range")


def _class(name: str, row: dict) -> Preset:  # type: ignore[type-arg]
    return Preset(
        name, row["title"], "class", _limits(row, "sensor_width_mm", "m", 1e-3, name), None,
        _limits(row, "focal_mm", "m", 1e-3, name), _limits(row, "image_width_px", "px", 1.0, name), (), row["source"],
    )  # fmt: skip


def _sensor(name: str, row: dict) -> Preset:  # type: ignore[type-arg]
    width, height = row["width_mm"] * 1e-3, row["height_mm"] * 1e-3
    u = row["spread_mm"] * 1e-3 / 2 / math.sqrt(3)
    text = f"preset {name}: spread of published sizes"
    around = [Quantity.uniform(x - u * math.sqrt(3), x + u * math.sqrt(3), "m", text) for x in (width, height)]
    return Preset(name, row["title"], "sensor", around[0], around[1], None, None, tuple(row["aliases"]), row["source"])
