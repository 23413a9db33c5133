"""Numbers with their doubt: Quantity going in; Contribution, Note and Measurement coming out.

`Quantity.parse` reads what people write: `200 mm`, `6 ft 2 in`, `1.75 ± 0.03 m`, `200 ± 2 %`, `150 ± 1 px (1s)`,
`0 ± 20 deg (limits)`, `35 mm exact`. A bare ± is the half-width of a 95 % normal interval.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, Self

import numpy as np

from .arrays import Array
from .distribution import HALF_WIDTH_95, NORMAL, Distribution
from .errors import InputError
from .noun import Noun, Part, plain

UNITS: dict[str, tuple[str, float]] = {
    "m": ("m", 1.0), "mm": ("m", 1e-3), "cm": ("m", 1e-2), "dm": ("m", 0.1), "km": ("m", 1e3),
    "um": ("m", 1e-6), "µm": ("m", 1e-6), "μm": ("m", 1e-6), "nm": ("m", 1e-9),
    "in": ("m", 0.0254), "inch": ("m", 0.0254), "inches": ("m", 0.0254), '"': ("m", 0.0254), "″": ("m", 0.0254),
    "ft": ("m", 0.3048), "feet": ("m", 0.3048), "foot": ("m", 0.3048), "'": ("m", 0.3048), "′": ("m", 0.3048),
    "yd": ("m", 0.9144), "mi": ("m", 1609.344),
    "px": ("px", 1.0), "pixel": ("px", 1.0), "pixels": ("px", 1.0),
    "rad": ("rad", 1.0), "mrad": ("rad", 1e-3), "deg": ("rad", math.pi / 180), "°": ("rad", math.pi / 180),
    "s": ("s", 1.0), "ms": ("s", 1e-3),
    "1": ("1", 1.0), "%": ("1", 0.01),
}  # fmt: skip
"""Every unit a person may write: the SI (or px) unit it is kept in, and the factor to it."""

WORDS = {"m": "a length", "px": "a number of pixels", "rad": "an angle", "s": "a time", "1": "a bare number"}

Assume = Callable[[float, float], "Quantity"]
"""Makes the Quantity of a number written without ±, from its value and half its last digit (in the kept unit)."""


@dataclass(frozen=True, eq=False)
class Quantity(Noun):
    """A number, or an array of them, with one standard deviation in the same unit.

    Attributes:
        value: the best estimate; a float, or an array whose axes are all leading ones.
        u: one standard deviation, same unit and shape (or one for all); 0 only where it is meant (`exact`).
        unit: m, px, rad, s, 1, or any other word for numbers that no method reads.
        distribution: the law of (value - true) / u.
        dof: degrees of freedom of u.
        source: where the number comes from; begins with "assumed" where nobody said it.
        id: two fields that hold quantities of one id are moved together.
    """

    value: float | Array
    u: float | Array
    unit: str = "1"
    distribution: Distribution = NORMAL
    dof: float = math.inf
    source: str = ""
    id: str | None = None

    widget: ClassVar[str] = "quantity"
    core: ClassVar[Mapping[str, int]] = {"value": 0, "u": 0}

    def __post_init__(self) -> None:
        if isinstance(self.value, float) and isinstance(self.u, float):  # nearly all, and arrays take their time
            finite, fine = math.isfinite(self.value), 0 <= self.u < math.inf
        else:
            value, u = np.asarray(self.value, float), np.asarray(self.u, float)
            finite, fine = bool(np.isfinite(value).all()), bool(np.all(np.isfinite(u) & (u >= 0)))
        if not finite:
            raise InputError("value", self.value, "give finite numbers")
        if not fine:
            raise InputError("u", self.u, "give a finite standard deviation, 0 or above")
        if not self.dof > 0:
            raise InputError("dof", self.dof, "give degrees of freedom above 0")

    # -- named constructors ----------------------------------------------------------------------

    @classmethod
    def exact(cls, value: float | Array, unit: str = "1", source: str = "exact") -> Self:
        """A number without doubt: a count, a definition."""
        return cls(value, 0.0, unit, source=source)

    @classmethod
    def normal(cls, value: float | Array, u: float | Array, unit: str = "1", source: str = "stated") -> Self:
        """A normal law with standard deviation u."""
        return cls(value, u, unit, source=source)

    @classmethod
    def interval(cls, value: float | Array, half_width: float, unit: str = "1", source: str = "stated") -> Self:
        """A person's "±a": the half-width of a 95 % normal interval."""
        return cls(value, half_width / HALF_WIDTH_95, unit, source=source)

    @classmethod
    def student_t(cls, value: float, u: float, dof: float, unit: str = "1", source: str = "stated") -> Self:
        """A mean of few readings: u from dof degrees of freedom."""
        return cls(value, u, unit, Distribution("t", dof), dof, source)

    @classmethod
    def between(
        cls, low: float, high: float, unit: str = "1", law: str = "uniform", source: str = "stated limits"
    ) -> Self:
        """Limits and a symmetric law between them: `uniform`, `triangular` or `arcsine`."""
        divisor = {"uniform": 3.0, "triangular": 6.0, "arcsine": 2.0}.get(law)
        if divisor is None:
            raise InputError("law", law, "use uniform, triangular or arcsine between limits")
        if not high >= low:
            raise InputError("limits", (low, high), "the upper limit must not lie below the lower one")
        return cls((low + high) / 2, (high - low) / 2 / math.sqrt(divisor), unit, Distribution(law), source=source)

    @classmethod
    def uniform(cls, low: float, high: float, unit: str = "1", source: str = "stated limits") -> Self:
        """Anything between two limits, equally likely."""
        return cls.between(low, high, unit, "uniform", source)

    @classmethod
    def curvilinear_trapezoid(
        cls, low: float, high: float, limit_uncertainty: float, unit: str = "1", source: str = "stated limits"
    ) -> Self:
        """Limits that are themselves known to ±limit_uncertainty only (JCGM 101, 6.4.3)."""
        half = (high - low) / 2
        u = math.sqrt(half**2 / 3 + limit_uncertainty**2 / 9)
        law = Distribution("curvilinear_trapezoid", limit_uncertainty / half)
        return cls((low + high) / 2, u, unit, law, source=source)

    @classmethod
    def one_sided(cls, value: float, limit: float, unit: str = "1", source: str = "stated limit") -> Self:
        """Anything between the stated value and a limit on one side of it; u is the rms distance from the value."""
        side = math.copysign(1.0, limit - value)
        return cls(value, abs(limit - value) / math.sqrt(3.0), unit, Distribution("one_sided", side), source=source)

    @classmethod
    def parse(cls, text: str, unit: str, *, bare: str | None = None, name: str = "value",
              assume: Assume | None = None, source: str = "stated") -> Self:  # fmt: skip
        """Read what a person wrote.

        Args:
            text: number, unit, optional ± and how it is meant; see the module.
            unit: the unit to keep it in; one of m, px, rad, s, 1.
            bare: the unit of a number written without one; `unit` if None.
            name: what to call it in an error.
            assume: gives the doubt of a number written without ±; without it such a number is refused.
            source: where the number comes from.

        Raises:
            InputError: no number, an unknown or unfit unit, or no ± and nothing to assume.
        """
        read = _Reader(text, unit, bare or unit, name, source).read(assume)
        return read if type(read) is cls else cls(**vars(read))

    # -- as a noun -------------------------------------------------------------------------------

    @property
    def leading(self) -> tuple[int, ...]:
        if isinstance(self.value, float) and isinstance(self.u, float):
            return ()
        return super().leading

    @property
    def identity(self) -> Hashable:
        """The given id; else this very object: two lengths that read the same are not the same length."""
        return self.id or id(self)

    def parts(self) -> tuple[Part, ...]:
        if isinstance(self.u, float) and self.u == 0:
            return ()
        u, value = np.asarray(self.u, float), np.asarray(self.value, float)
        if not u.any():
            return ()
        part = Part("value", self.source, self.source, value[None], u[None],
                    distributions=(self.distribution,), dof=self.dof)  # fmt: skip
        return (part,)

    def moved(self, values: Mapping[str, Array]) -> Self:
        return self._with(value=values["value"][0])

    def scaled(self, factor: float, unit: str | None = None) -> Quantity:
        """The quantity times an exact number, in another unit if one is named."""
        return Quantity(self.value * factor, self.u * abs(factor), unit or self.unit,
                        self.distribution, self.dof, self.source, self.id)  # fmt: skip

    def to_json(self) -> dict[str, Any]:
        data: dict[str, Any] = {"value": plain(self.value), "u": plain(self.u), "unit": self.unit}
        if self.distribution != NORMAL:
            data["distribution"] = self.distribution.to_json()
        if math.isfinite(self.dof):
            data["dof"] = self.dof
        if self.source:
            data["source"] = self.source
        if self.id:
            data["id"] = self.id
        return data

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Self:
        """The inverse of `to_json`."""
        value, u = data["value"], data["u"]
        return cls(
            np.asarray(value, float) if isinstance(value, list) else float(value),
            np.asarray(u, float) if isinstance(u, list) else float(u),
            str(data.get("unit", "1")),
            Distribution.from_json(data.get("distribution", "normal")),
            float(data.get("dof", math.inf)),
            str(data.get("source", "")),
            data.get("id"),
        )


_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_TERM = re.compile(rf"\s*(?P<number>{_NUMBER})\s*(?P<unit>[A-Za-zµμ]+|[°%\"'″′])?")
_PLUS_MINUS = re.compile(r"±|\+/-|\+-")
_MEANING = re.compile(r"\(\s*(1s|1 ?sigma|limits|95 ?%)\s*\)\s*$", re.IGNORECASE)


@dataclass(frozen=True)
class _Reader:
    """One text being read as a Quantity; see `Quantity.parse`."""

    text: str
    unit: str
    bare: str
    name: str
    source: str

    def refuse(self, allowed: str) -> InputError:
        return InputError(self.name, self.text, allowed)

    def read(self, assume: Assume | None) -> Quantity:
        text = self.text.strip().replace("\u2212", "-")
        exact = text.lower().endswith("exact")
        if exact:
            text = text[:-5].strip()
        meaning = _MEANING.search(text)
        kind = meaning.group(1).lower().replace(" ", "") if meaning else "95%"
        if meaning:
            text = text[: meaning.start()].strip()
        head, *tail = _PLUS_MINUS.split(text)
        if len(tail) > 1:
            raise self.refuse("write one ± only, as in '200 ± 0.5 mm'")
        tail_unit = _TERM.fullmatch(tail[0].strip()) if tail else None
        if tail and tail_unit is None:
            raise self.refuse("write a number behind ±, as in '200 ± 0.5 mm'")
        borrowed = tail_unit.group("unit") if tail_unit else None
        value, half_digit, head_unit = self.terms(head, None if borrowed == "%" else borrowed)
        if exact or not tail_unit:
            return self.without_doubt(value, half_digit, exact or bool(tail), assume)
        return self.with_doubt(value, tail_unit, head_unit, kind)

    def without_doubt(self, value: float, half_digit: float, exact: bool, assume: Assume | None) -> Quantity:
        if exact:
            return Quantity.exact(value, self.unit, f"{self.source}, exact")
        if assume is None:
            raise self.refuse("say how well it is known: '200 ± 0.5 mm', or '200 mm exact'")
        return assume(value, half_digit)

    def with_doubt(self, value: float, tail: re.Match[str], head_unit: str | None, kind: str) -> Quantity:
        half = float(tail.group("number"))
        if not half >= 0:
            raise self.refuse("what stands behind ± must not be negative")
        written = tail.group("unit")
        if written == "%" and self.unit != "1":
            half *= abs(value) / 100
        else:
            half *= self.factor(written or head_unit or self.bare)
        if kind == "limits":
            return Quantity.uniform(value - half, value + half, self.unit, f"{self.source}, ± read as limits")
        if kind.startswith("1s"):
            return Quantity.normal(value, half, self.unit, f"{self.source}, ± read as one standard deviation")
        return Quantity.interval(value, half, self.unit, f"{self.source}, ± read as a 95 % interval")

    def terms(self, text: str, borrowed: str | None) -> tuple[float, float, str | None]:
        """The sum of "6 ft 2 in", half its last digit, and its last unit."""
        total, half_digit, place, unit = 0.0, 0.0, 0, None
        if not text.strip():
            raise self.refuse(f"give {WORDS.get(self.unit, 'a number')}, as in '{self.example()}'")
        while place < len(text.rstrip()):
            term = _TERM.match(text, place)
            if term is None or (place > 0 and unit is None):
                raise self.refuse(f"give {WORDS.get(self.unit, 'a number')}, as in '{self.example()}'")
            unit = term.group("unit")
            if place > 0 and unit is None:
                raise self.refuse("name the unit of every part, as in '6 ft 2 in'")
            factor = self.factor(unit or borrowed or self.bare)
            number = float(term.group("number"))
            if not math.isfinite(number):
                raise self.refuse("give a finite number")
            total += math.copysign(number, total or number) * factor if place else number * factor
            half_digit = 0.5 * 10 ** -_decimals(term.group("number")) * factor
            place = term.end()
        return total, half_digit, unit

    def factor(self, unit: str) -> float:
        kept, factor = UNITS.get(unit, UNITS.get(unit.lower(), ("", 0.0)))
        if kept != self.unit:
            fits = ", ".join(u for u, (k, _) in UNITS.items() if k == self.unit and u.isascii() and u.isalnum())
            raise self.refuse(f"give {WORDS.get(self.unit, self.unit)} in {fits}")
        return factor

    def example(self) -> str:
        return {"m": "200 ± 0.5 mm", "px": "150 ± 1 px", "rad": "20 ± 2 deg", "s": "0.5 s"}.get(self.unit, "1.5 ± 0.1")


def _decimals(number: str) -> int:
    """Digits behind the point of a number as written; a power of ten moves the point."""
    mantissa, _, power = number.lower().partition("e")
    return len(mantissa.partition(".")[2]) - (int(power) if power else 0)


# -- results -----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Note:
    """A doubt about a result: a machine-readable code, a sentence for a person, and what would cure it."""

    code: str
    text: str
    cure: str = ""

    def to_json(self) -> dict[str, str]:
        """As in the published schema."""
        return {"code": self.code, "text": self.text, "cure": self.cure}


@dataclass(frozen=True)
class Contribution:
    """One line of a budget.

    Attributes:
        name: what it is ("focal length").
        source: where its uncertainty comes from.
        u: signed sensitivity times u for one number; the root of the summed squares for a block (unit of the result).
        share: its part of the variance, 0 to 1; the shares of a budget sum to 1.
    """

    name: str
    source: str
    u: float
    share: float

    def to_json(self) -> dict[str, Any]:
        """As in the published schema."""
        return {"name": self.name, "source": self.source, "u": self.u, "share": self.share}


@dataclass(frozen=True)
class Measurement:
    """One honest number.

    Attributes:
        what: range, depth, length, size, ...
        value: the best estimate, in `unit`.
        u: one standard deviation; None with an open interval or where it has no meaning.
        low: lower limit of the interval; None where it is open.
        high: upper limit; None where it is open.
        level: the coverage of the interval, 0.95 unless asked otherwise.
        unit: m, px, rad or 1.
        method: the key of METHODS that gave it.
        label: which thing was measured, where there are several.
        evaluation: "first order", "second order", "mapped through the one uncertain input" or "Monte Carlo, n draws".
        budget: what u consists of, largest share first.
        notes: doubts.
        improve: what would improve it most, in one sentence.
        given: the inputs in JSON, enough to measure again.
    """

    what: str
    value: float
    u: float | None
    low: float | None
    high: float | None
    unit: str
    method: str
    level: float = 0.95
    label: str = ""
    evaluation: str = "first order"
    budget: tuple[Contribution, ...] = ()
    notes: tuple[Note, ...] = ()
    improve: str = ""
    given: Mapping[str, Any] = field(default_factory=dict)

    def to_json(self) -> dict[str, Any]:
        """As in the published schema: SI numbers, an open limit is null."""
        return {
            "what": self.what, "label": self.label, "value": self.value, "unit": self.unit, "u": self.u,
            "low": self.low, "high": self.high, "level": self.level, "method": self.method,
            "evaluation": self.evaluation, "budget": [c.to_json() for c in self.budget],
            "notes": [n.to_json() for n in self.notes], "improve": self.improve,
            "given": self.given if isinstance(self.given, dict) else dict(self.given),
        }  # fmt: skip
