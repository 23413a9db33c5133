"""Planned: how well a set-up will measure, and what would have to change for it to measure as well as is wanted."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from .quantity import Contribution, Measurement, Note, Quantity


@dataclass(frozen=True)
class Wanted:
    """The accuracy that is asked for, as the half-width of a 95 % interval.

    Attributes:
        half_width_m: at the planned distance.
        share: of the distance, where it was said in per cent; None where as a length.
        text: as it was typed.
    """

    half_width_m: float
    share: float | None
    text: str

    def at(self, distance_m: float) -> float:
        """Half-width at another distance, m."""
        return self.half_width_m if self.share is None else self.share * distance_m

    def to_json(self) -> dict[str, Any]:
        """As in the published schema."""
        return {"half_width_m": self.half_width_m, "share": self.share, "text": self.text}


@dataclass(frozen=True)
class Entry:
    """One number of a set-up: what it is, how well it is known, and where it may be looked for.

    Attributes:
        key: "focal", as `--solve` names it; that of its doubt is `error_key`.
        title: "focal length".
        quantity: value and doubt, in m, px or rad.
        scaled: its doubt is so many per cent of it, and goes with it where another value is tried.
        low: the smallest value that is tried; None where its value is not asked for.
        high: the largest.
        error_key: "focal-error" where its doubt can be asked for; empty where not.
        error_title: "± of the focal length".
    """

    key: str
    title: str
    quantity: Quantity
    scaled: bool = False
    low: float | None = None
    high: float | None = None
    error_key: str = ""
    error_title: str = ""

    @property
    def assumed(self) -> bool:
        """Whether nobody said it."""
        return self.quantity.source.startswith("assumed")

    def moved(self, value: float) -> Entry:
        """The entry with another value; its doubt stays, or goes with it."""
        old = self.quantity
        u = float(old.u) * (abs(value / float(old.value)) if self.scaled and old.value else 1.0)
        return replace(self, quantity=replace(old, value=value, u=u))

    def known_to(self, u: float) -> Entry:
        """The entry with another doubt, of the same law."""
        return replace(self, quantity=replace(self.quantity, u=u))

    def to_json(self) -> dict[str, Any]:
        """As in the published schema: value and u in `unit`."""
        q = self.quantity
        return {
            "key": self.key, "title": self.title, "value": float(q.value), "u": float(q.u), "unit": q.unit,
            "distribution": q.distribution.name, "source": q.source, "assumed": self.assumed,
        }  # fmt: skip


@dataclass(frozen=True)
class Row:
    """What a set-up gives at one distance.

    Attributes:
        distance_m: of the thing that is measured, or its length where that is what is measured.
        measured: what the method gives there; None where it has no answer.
        reason: why it has none; empty where it has.
        seen_px: how long it is in the picture, or its disparity; None where that has no meaning.
    """

    distance_m: float
    measured: Measurement | None
    reason: str = ""
    seen_px: float | None = None

    @property
    def half_width_m(self) -> float | None:
        """The larger side of the 95 % interval; None where it is open or there is no answer."""
        m = self.measured
        if m is None or m.low is None or m.high is None:
            return None
        return max(m.value - m.low, m.high - m.value)

    @property
    def largest(self) -> Contribution | None:
        """The line of the budget with the largest share."""
        return self.measured.budget[0] if self.measured and self.measured.budget else None

    def to_json(self) -> dict[str, Any]:
        """As in the published schema; numbers are null where there is no answer."""
        m, top = self.measured, self.largest
        return {
            "distance_m": self.distance_m, "u_m": m.u if m else None, "low_m": m.low if m else None,
            "high_m": m.high if m else None, "half_width_m": self.half_width_m, "evaluation": m.evaluation if m else None,
            "largest": top.to_json() if top else None, "reason": self.reason, "seen_px": self.seen_px,
        }  # fmt: skip


@dataclass(frozen=True)
class Solution:
    """Which values of one number reach what is wanted, all others held.

    Attributes:
        key: of the entry or of its doubt, or "distance".
        title: what it is.
        unit: of `low`, `high` and `best`: m, px, rad.
        low: the smallest value that reaches it, rounded to the safe side; None where all down to the limit do, or none does.
        high: the largest, likewise.
        tried: the limits within which values were tried.
        best: the value that comes nearest.
        half_width_m: at `low` or `high` where there is one, else at `best`.
        reached: whether any value reaches it.
        law: of a doubt, whose `low`, `high` and `best` are standard deviations: "normal", "uniform"; empty for a value.
        of: the value that a doubt is of.
        limit: where none does, what stands in the way.
        limit_half_width_m: what that alone makes, as the half-width of a 95 % interval.
        cure: what lessens that.
        seen_px: how long the thing is in the picture there, or its disparity; None where that has no meaning.
        beyond: why values beyond `high` (or `low`, or the best) have no answer, where they have none.
    """

    key: str
    title: str
    unit: str
    low: float | None
    high: float | None
    tried: tuple[float, float]
    best: float
    half_width_m: float | None
    reached: bool
    law: str = ""
    of: float | None = None
    limit: str = ""
    limit_half_width_m: float | None = None
    cure: str = ""
    seen_px: float | None = None
    beyond: str = ""

    def to_json(self) -> dict[str, Any]:
        """As in the published schema."""
        return {
            "key": self.key, "title": self.title, "unit": self.unit, "reached": self.reached, "low": self.low, "high": self.high,
            "tried": list(self.tried), "best": self.best, "half_width_m": self.half_width_m, "law": self.law, "of": self.of,
            "limit": self.limit, "limit_half_width_m": self.limit_half_width_m, "cure": self.cure,
            "seen_px": self.seen_px, "beyond": self.beyond,
        }  # fmt: skip


@dataclass(frozen=True)
class Share:
    """How well one number must be known where the error that is allowed is shared out among all.

    Attributes:
        key: of the entry.
        title: of the entry.
        now_u: as it is known now, in `unit`.
        u: as it must be known; the same as `now_u` where that is well enough.
        value: of the entry.
        unit: of all three.
        law: of the doubt.
    """

    key: str
    title: str
    now_u: float
    u: float
    value: float
    unit: str
    law: str

    def to_json(self) -> dict[str, Any]:
        """As in the published schema."""
        return {
            "key": self.key,
            "title": self.title,
            "value": self.value,
            "now_u": self.now_u,
            "u": self.u,
            "unit": self.unit,
            "law": self.law,
        }


@dataclass(frozen=True)
class Combined:
    """What reaches the accuracy where no single change does.

    Attributes:
        solution: the values of the way's main number that do.
        shares: how well others must be known beside it.
    """

    solution: Solution
    shares: tuple[Share, ...]

    def to_json(self) -> dict[str, Any]:
        """As in the published schema."""
        return {"solution": self.solution.to_json(), "shares": [one.to_json() for one in self.shares]}


@dataclass(frozen=True)
class Plan:
    """One way to measure, planned.

    Attributes:
        way: known_size, ground, stereo or drone.
        title: a few words.
        what: what is measured: "distance", or "length on the ground".
        method: of METHODS, which gave all numbers here.
        wanted: the accuracy; None where only what the set-up gives is asked.
        entries: the set-up.
        answer: what it gives at the planned distance.
        rows: what it gives at others.
        solutions: what reaches the accuracy, one number changed at a time.
        shares: what reaches it by knowing all numbers better.
        combined: what reaches it by a change and by knowing others better; None where one change is enough, or nothing is.
        curve: rows close together, for a chart.
        sampling: ground per pixel, of a picture from above; None for others.
        notes: doubts.
        improve: what would improve it most, in one sentence.
    """

    way: str
    title: str
    what: str
    method: str
    wanted: Wanted | None
    entries: tuple[Entry, ...]
    answer: Row
    rows: tuple[Row, ...] = ()
    solutions: tuple[Solution, ...] = ()
    shares: tuple[Share, ...] = ()
    combined: Combined | None = None
    curve: tuple[Row, ...] = ()
    sampling: Measurement | None = None
    notes: tuple[Note, ...] = ()
    improve: str = ""
    level: float = field(default=0.95, init=False)

    @property
    def reached(self) -> bool | None:
        """Whether the set-up as it is reaches what is wanted; None where nothing is."""
        if self.wanted is None:
            return None
        half = self.answer.half_width_m
        return half is not None and half <= self.wanted.half_width_m

    def to_json(self) -> dict[str, Any]:
        """As in the published schema."""
        budget = self.answer.measured.budget if self.answer.measured else ()
        scale: Mapping[str, Any] | None = None
        if self.sampling:
            scale = {"m_px": self.sampling.value, "u_m_px": self.sampling.u}
        return {
            "way": self.way, "title": self.title, "what": self.what, "method": self.method, "level": self.level,
            "wanted": self.wanted.to_json() if self.wanted else None, "reached": self.reached,
            "given": [entry.to_json() for entry in self.entries], "answer": self.answer.to_json(),
            "budget": [line.to_json() for line in budget], "improve": self.improve, "sampling": scale,
            "rows": [row.to_json() for row in self.rows], "solutions": [one.to_json() for one in self.solutions],
            "shares": [one.to_json() for one in self.shares],
            "combined": self.combined.to_json() if self.combined else None, "notes": [note.to_json() for note in self.notes],
        }  # fmt: skip
