"""The table of things of known size, which serve as a scale; see data/targets.toml.

Not to be mixed up with `target.Target`, the known points of one thing in its own frame.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from .errors import FileFormatError, InputError
from .quantity import Quantity

MOST_BYTES = 2**20
MOST_MM = 1e9
SIZES = {("length_mm",): "length", ("diameter_mm",): "circle", ("width_mm", "height_mm"): "rectangle"}
"""Which keys give the size of a row, and the shape that they mean."""
DOUBTS = {"tolerance_mm": "stated tolerance, as limits", "spread_mm": "stated spread of its kind"}
"""Which keys give the doubt of a row, and what is written of it where the row does not say."""
TEXTS = ("title", "group", "what", "doubt", "source")
KEYS = {*TEXTS, "aliases", *DOUBTS, *(key for keys in SIZES for key in keys)}


@dataclass(frozen=True)
class KnownTarget:
    """One row.

    Attributes:
        name: as on the command line.
        title: as people call it.
        group: paper, card, coin, ...
        what: which length, or from where to where.
        size: the one length, m; None for a rectangle.
        width: m; None without a rectangle.
        height: m; None without a rectangle.
        shape: "length", "circle" or "rectangle".
        aliases: other names it goes by.
        doubt: where its uncertainty comes from; begins with "assumed" where nobody says.
        source: who prints the size.
    """

    name: str
    title: str
    group: str
    what: str
    size: Quantity | None
    width: Quantity | None
    height: Quantity | None
    shape: str
    aliases: tuple[str, ...]
    doubt: str
    source: str

    @property
    def text(self) -> str:
        """What a person would type: one length for `Quantity.parse`, or two with an x between for `Target.parse`."""
        return " x ".join(_typed(side) for side in (self.size, self.width, self.height) if side is not None)

    def to_json(self) -> dict[str, Any]:
        """A row of a menu: the sizes as texts, null where the shape has none."""
        sides = {"size": self.size, "width": self.width, "height": self.height}
        return {
            "name": self.name, "title": self.title, "group": self.group, "what": self.what, "shape": self.shape,
            **{key: None if side is None else _typed(side) for key, side in sides.items()},
            "text": self.text, "aliases": list(self.aliases), "doubt": self.doubt, "source": self.source,
        }  # fmt: skip


def targets(extra: Path | None = None) -> dict[str, KnownTarget]:
    """All rows by name; those of a file of one's own are added, and replace rows of the same name.

    Raises:
        FileFormatError: the file cannot be read, or a row of it does not fit.
    """
    return dict(_packaged()) if extra is None else {**_packaged(), **_read(extra)}


def find_target(name: str, option: str = "target", extra: Path | None = None) -> KnownTarget:
    """The row of a name, title or alias, whatever its case.

    Raises:
        InputError: no such row; the nearest names are given.
    """
    table = targets(extra)
    wanted, names = _plain(name), {}
    for row in reversed(table.values()):
        names.update({_plain(word): row.name for word in (row.title, *row.aliases)})
    names.update({_plain(key): key for key in table})
    if wanted in names:
        return table[names[wanted]]
    import difflib

    near = dict.fromkeys(names[word] for word in difflib.get_close_matches(wanted, names, 5, 0.4))
    raise InputError(option, name, f"known are {', '.join(list(near or table)[:3])} and more: see `subtense targets`")


def search(words: str | Sequence[str], extra: Path | None = None) -> list[KnownTarget]:
    """The rows that hold every word in their name, title, aliases or group, whatever its case."""
    wanted = [word.lower() for word in (words.split() if isinstance(words, str) else words)]
    return [row for row in targets(extra).values()
            if all(word in " ".join((row.name, row.title, row.group, *row.aliases)).lower() for word in wanted)]  # fmt: skip


def _plain(name: str) -> str:
    return re.sub(r"[\s_]+", "-", name.strip().lower())


def _typed(side: Quantity) -> str:
    limits = side.distribution.name == "uniform"
    half = float(side.u) * (math.sqrt(3.0) if limits else 1.0)
    return f"{float(side.value) * 1e3:.12g} ± {half * 1e3:.12g} mm ({'limits' if limits else '1s'})"


# -- reading -----------------------------------------------------------------------------------------


@cache
def _packaged() -> dict[str, KnownTarget]:
    import tomllib
    from importlib.resources import files

    return _rows("targets.toml", tomllib.loads(files("subtense").joinpath("data/targets.toml").read_text("utf-8")))


def _read(path: Path) -> dict[str, KnownTarget]:
    """The rows of a person's own file."""
    import tomllib

    if not path.is_file():
        raise FileFormatError(path, "no such file")
    if path.stat().st_size > MOST_BYTES:
        raise FileFormatError(path, f"is larger than {MOST_BYTES // 2**20} MiB, no table of targets is")
    try:
        table = tomllib.loads(path.read_text("utf-8"))
    except (ValueError, RecursionError) as error:
        raise FileFormatError(path, f"is not TOML: {' '.join(str(error).split())}") from None
    except OSError as error:
        raise FileFormatError(path, f"cannot be read: {error.strerror}") from None
    return _rows(path, table)


def _rows(path: object, table: Mapping[str, Any]) -> dict[str, KnownTarget]:
    found = {}
    for name, row in table.items():
        if not re.fullmatch(r"[a-z0-9]+(-[a-z0-9]+)*", name):
            raise FileFormatError(path, f"row {name!r}: write its name in small letters, digits and hyphens")
        if not isinstance(row, dict):
            raise FileFormatError(path, f"row {name}: is no table; begin it with [{name}]")
        try:
            found[name] = _row(name, row)
        except InputError as error:
            raise FileFormatError(path, f"row {name}: {error}") from None
    return found


def _row(name: str, row: Mapping[str, Any]) -> KnownTarget:
    for key in row:
        if key not in KEYS:
            raise InputError(key, str(row[key]), f"a row has {', '.join(sorted(KEYS))}")
    texts = {key: _text(row, key, needed=key in ("title", "source")) for key in TEXTS}
    aliases = row.get("aliases", [])
    if not isinstance(aliases, list) or not all(isinstance(alias, str) and alias.isprintable() for alias in aliases):
        raise InputError("aliases", str(aliases), 'give a list of texts, as in aliases = ["shelf"]')
    keys = next((keys for keys in SIZES if set(keys) <= set(row)), None)
    if keys is None or any(key in row for other in SIZES if other != keys for key in other):
        raise InputError("size", None, "give one of length_mm, diameter_mm, or width_mm and height_mm")
    shape, doubt_key = SIZES[keys], _doubt_key(row)
    halves = row[doubt_key] if isinstance(row[doubt_key], list) else [row[doubt_key]] * len(keys)
    if len(halves) != len(keys):
        raise InputError(doubt_key, str(halves), f"give one number, or one for each of {', '.join(keys)}")
    doubt = texts["doubt"] or DOUBTS[doubt_key]
    source = f"{doubt} ({texts['title']})" if doubt.startswith("assumed") else f"{texts['title']}: {doubt}"
    sides = [_side(row, key, doubt_key, half, source) for key, half in zip(keys, halves, strict=True)]
    size, width, height = (None, *sides) if shape == "rectangle" else (sides[0], None, None)
    what = texts["what"] or {"circle": "diameter", "length": "length", "rectangle": "outer edges"}[shape]
    return KnownTarget(name, texts["title"], texts["group"] or "own", what, size, width, height, shape,
                       tuple(aliases), doubt, texts["source"])  # fmt: skip


def _text(row: Mapping[str, Any], key: str, *, needed: bool) -> str:
    text = row.get(key)
    if text is None and not needed:
        return ""
    if not isinstance(text, str) or not text.strip() or not text.isprintable():
        raise InputError(key, None if text is None else str(text), f'give a text on one line, as in {key} = "..."')
    return text.strip()


def _doubt_key(row: Mapping[str, Any]) -> str:
    given = [key for key in DOUBTS if key in row]
    if len(given) != 1:
        raise InputError(
            "doubt", " and ".join(given) or None, "give tolerance_mm (limits) or spread_mm (one standard deviation)"
        )
    return given[0]


def _side(row: Mapping[str, Any], key: str, doubt_key: str, half_mm: object, source: str) -> Quantity:
    value_m, half_m = _number(key, row[key]) * 1e-3, _number(doubt_key, half_mm) * 1e-3
    if half_m >= value_m:
        raise InputError(doubt_key, half_mm, f"give less than {key}, which is {row[key]}")
    if doubt_key == "spread_mm":
        return Quantity.normal(value_m, half_m, "m", source)
    return Quantity.uniform(value_m - half_m, value_m + half_m, "m", source)


def _number(key: str, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0 < value < MOST_MM:
        raise InputError(key, str(value), f"give a number of millimetres above 0 and below {MOST_MM:g}")
    return float(value)
