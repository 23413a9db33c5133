"""Numbers as people read them: a fitting unit, and as many digits as the uncertainty leaves."""

from __future__ import annotations

import math

from ..distribution import HALF_WIDTH_95

_LENGTHS = (("km", 1e4, 1e3), ("m", 1.0, 1.0), ("mm", 1e-3, 1e-3), ("µm", 0.0, 1e-6))
_FIXED = {
    "px": ("px", 1.0), "rad": ("°", math.pi / 180), "px/m": ("px/mm", 1e3), "m/px": ("mm/px", 1e-3), "1": ("", 1.0),
    "s": ("s", 1.0),
}  # fmt: skip


def fitting_unit(value: float, unit: str) -> tuple[str, float]:
    """The unit to print a number of an SI unit in, and the factor it stands for."""
    if unit == "m":
        name, _, factor = next(row for row in _LENGTHS if abs(value) >= row[1])
        return name, factor
    return _FIXED.get(unit, (unit, 1.0))


def digits_for(u: float) -> int:
    """Decimals that show two significant digits of u; negative for tens and hundreds."""
    return 1 - math.floor(math.log10(u) + 1e-12) if u > 0 and math.isfinite(u) else 6


def grouped(value: float, decimals: int) -> str:
    """A number with thin groups of three: 13 556.50."""
    if decimals < 0:
        value, decimals = round(value, decimals), 0
    return f"{value:,.{decimals}f}".replace(",", " ")


def number(value: float, unit: str, doubt: float | None, reference: float | None = None) -> str:
    """A number with its unit, to two significant digits of its doubt; `reference` decides the unit."""
    name, factor = fitting_unit(value if reference is None else reference, unit)
    if doubt:
        shown = grouped(value / factor, max(digits_for(doubt / factor), 0))
    else:
        shown = f"{value / factor:.7g}"
    return f"{shown}{'' if name == '°' else ' '}{name}".strip()


def rounded(value: float, unit: str, u: float) -> str:
    """A number with its unit, to two significant digits of u; to four of its own where u is 0."""
    if u:
        return number(value, unit, u)
    name, factor = fitting_unit(value, unit)
    return f"{value / factor:.4g}{'' if name == '°' else ' '}{name}".strip()


def interval(value: float, unit: str, u: float) -> str:
    """The ends of the normal law's 95 % interval, as "13.1 to 14.2 m"."""
    name, factor = fitting_unit(value, unit)
    decimals = max(digits_for(u / factor), 0)
    low, high = (grouped((value + sign * HALF_WIDTH_95 * u) / factor, decimals) for sign in (-1, 1))
    return f"{low} to {high}{'' if name == '°' else ' '}{name}".strip()
