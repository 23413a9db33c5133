"""Which values of one number of a set-up reach an accuracy, all others held.

Each value is tried by the method itself. Where the error crosses what is wanted is found by bracketing on logarithms, so
nothing here knows how an error grows.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence

import numpy as np

from .. import propagate
from ..distribution import HALF_WIDTH_95
from ..errors import GeometryError, InputError
from ..planned import Entry, Row, Solution, Wanted
from .improve import cure_of
from .plan_ways import Setup, Way

TRIED = 17
"""Values over a range, before a crossing between two of them is sought."""
NEARLY_BEST = 1.02
"""Values whose error is within that of the smallest one count as alike: the nearest to the present one is named."""
DRAWS = 20_000
"""Of one value that is tried, where draws are needed; the same for all, so that the error runs smoothly."""
FINE = 3e-4
"""Relative step to which a crossing is found."""
TIMES_DISTANCE = 100.0
"""How much nearer and farther than the planned distance is tried."""
ERROR_RANGE = 1e-4, 100.0
"""Doubts that are tried, in those of the set-up."""
LARGEST_ANGLE_RAD = 0.35
"""u of an angle beyond which nothing is tried."""


def row_at(way: Way, setup: Setup, distance_m: float, *, draws: int | None = DRAWS) -> Row:
    """What the set-up gives at a distance, by the way's method; its reason where it gives nothing.

    Args:
        way: of WAYS.
        setup: its numbers.
        distance_m: of what is measured, or its length.
        draws: where they are needed; None for as many as a measurement takes.
    """
    try:
        inputs = way.inputs(setup, distance_m)
        try:
            [found] = propagate.measure(way.headline, inputs, draws=0)
        except propagate.DrawsNeeded:
            [found] = propagate.measure(way.headline, inputs, draws=draws)
    except GeometryError as error:
        return Row(distance_m, None, str(error))
    return Row(distance_m, found, seen_px=way.seen_px(inputs) if way.seen_px else None)


# -- one number at a time -----------------------------------------------------------------------------------------------


@dataclasses.dataclass(frozen=True)
class Knob:
    """A number that can be turned.

    Attributes:
        key: of the entry, its doubt, or "distance".
        title: what it is.
        unit: m, px or rad.
        now: its present value.
        low: the smallest that is tried.
        high: the largest.
        row: what the set-up gives at a value.
        wanted_m: half-width that is wanted at a value.
        entry: that it belongs to; None for the distance.
        doubt: whether it is a doubt, one standard deviation.
    """

    key: str
    title: str
    unit: str
    now: float
    low: float
    high: float
    row: Callable[[float], Row]
    wanted_m: Callable[[float], float]
    entry: Entry | None = None
    doubt: bool = False


def knobs(way: Way, setup: Setup, distance_m: float, wanted: Wanted) -> tuple[Knob, ...]:
    """All numbers that can be asked for: values first, then doubts, then the distance."""

    def here(_: float) -> float:
        return wanted.half_width_m

    def of_value(entry: Entry) -> Callable[[float], Row]:
        return lambda x: row_at(way, setup.with_entry(entry.moved(x)), distance_m)

    def of_doubt(entry: Entry) -> Callable[[float], Row]:
        return lambda x: row_at(way, setup.with_entry(entry.known_to(x)), distance_m)

    found = []
    entries = list(setup.entries.values())
    for entry in entries:
        if entry.low is not None and entry.high is not None:
            q = entry.quantity
            found.append(
                Knob(
                    entry.key, entry.title, q.unit, float(q.value), entry.low, entry.high, of_value(entry), here, entry
                )
            )
    for entry in entries:
        u = float(entry.quantity.u)
        if entry.error_key and u > 0:
            low, high = (factor * u for factor in ERROR_RANGE)
            high = min(high, LARGEST_ANGLE_RAD) if entry.quantity.unit == "rad" else high
            if entry.quantity.value and entry.quantity.unit == "m":
                high = min(high, float(entry.quantity.value) / 3)
            found.append(Knob(entry.error_key, entry.error_title, entry.quantity.unit, u, low, max(high, u), of_doubt(entry), here,
                              entry, True))  # fmt: skip
    found.append(Knob("distance", way.what, "m", distance_m, distance_m / TIMES_DISTANCE, distance_m * TIMES_DISTANCE,
                      lambda x: row_at(way, setup, x), wanted.at))  # fmt: skip
    return tuple(found)


def solutions(knobs: Sequence[Knob], only: Sequence[str] = ()) -> tuple[Solution, ...]:
    """Each number solved for, one at a time.

    Args:
        knobs: of `knobs`.
        only: the keys that are asked for; all where empty.

    Raises:
        InputError: a key that this set-up does not have.
    """
    known = {knob.key: knob for knob in knobs}
    for key in only:
        if key not in known:
            raise InputError("--solve", key, f"what can be solved for here is {', '.join(known)}")
    return tuple(_solution(known[key]) for key in (dict.fromkeys(only) or known))


class _Tried:
    """Rows at the values that were tried, each once, and the error over what is wanted."""

    def __init__(self, knob: Knob) -> None:
        self.knob, self.rows = knob, dict[float, Row]()

    def row(self, x: float) -> Row:
        if x not in self.rows:
            self.rows[x] = self.knob.row(x)
        return self.rows[x]

    def ratio(self, x: float) -> float:
        half = self.row(x).half_width_m
        return math.inf if half is None else half / self.knob.wanted_m(x)


def _solution(knob: Knob) -> Solution:
    tried = _Tried(knob)
    # the error grows with every doubt, so that its ends tell all; how it runs with a value is not known
    spread = [knob.low, knob.high] if knob.doubt else np.geomspace(knob.low, knob.high, TRIED).tolist()
    grid = sorted({*spread, min(max(knob.now, knob.low), knob.high)})
    ratios = [tried.ratio(x) for x in grid]
    if not knob.doubt and 1 < min(ratios) < math.inf:
        grid, ratios = _with_lowest(tried, grid, ratios)
    best = knob.low if knob.doubt else _best(grid, ratios, knob.now)
    tells = (
        {"law": knob.entry.quantity.distribution.name, "of": float(knob.entry.quantity.value)}
        if knob.doubt and knob.entry
        else {}
    )
    made = Solution(knob.key, knob.title, knob.unit, None, None, (knob.low, knob.high), best, tried.row(best).half_width_m, False,
                    **tells)  # type: ignore[arg-type]  # fmt: skip
    run = _run(grid, ratios, knob.now)
    if run is None:
        return _with_limit(made, tried, grid)
    first, last = run
    low = None if first == 0 else _edge(tried, grid[first - 1], grid[first])
    high = None if last == len(grid) - 1 else _edge(tried, grid[last + 1], grid[last])
    whole = knob.unit == "px" and not knob.doubt and knob.key == "width-px"
    low = None if low is None else _rounded(tried, low, up=True, whole=whole)
    high = None if high is None else _rounded(tried, high, up=False, whole=whole)
    at = low if low is not None else high if high is not None else best
    beside = (
        tried.row(grid[last + 1]).reason
        if high is not None
        else tried.row(grid[first - 1]).reason
        if low is not None
        else ""
    )
    return dataclasses.replace(
        made, low=low, high=high, reached=True, half_width_m=tried.row(at).half_width_m,
        seen_px=tried.row(at).seen_px, beyond=beside,
    )  # fmt: skip


def _best(grid: Sequence[float], ratios: Sequence[float], now: float) -> float:
    """The value of the smallest error; of many about alike, the nearest to the present one."""
    alike = [x for x, ratio in zip(grid, ratios, strict=True) if ratio <= NEARLY_BEST * min(ratios)]
    return min(alike, key=lambda x: abs(math.log(x / now)))


def _with_lowest(tried: _Tried, grid: list[float], ratios: list[float]) -> tuple[list[float], list[float]]:
    """The values with that of the smallest error between its neighbours: what is wanted may be reached there only."""
    from scipy.optimize import minimize_scalar

    i = int(np.argmin(ratios))
    between = math.log(grid[max(i - 1, 0)]), math.log(grid[min(i + 1, len(grid) - 1)])
    found = minimize_scalar(lambda t: min(tried.ratio(math.exp(t)), 1e6), bounds=between, method="bounded",
                            options={"xatol": 0.02, "maxiter": 12})  # fmt: skip
    grid = sorted({*grid, math.exp(float(found.x))})
    return grid, [tried.ratio(x) for x in grid]


def _run(grid: Sequence[float], ratios: Sequence[float], now: float) -> tuple[int, int] | None:
    """First and last of neighbouring values that all reach what is wanted: those around the present value, or nearest to it."""
    runs: list[tuple[int, int]] = []
    for i, ratio in enumerate(ratios):
        if ratio > 1:
            continue
        if runs and runs[-1][1] == i - 1:
            runs[-1] = runs[-1][0], i
        else:
            runs.append((i, i))
    if not runs:
        return None

    def away(run: tuple[int, int]) -> float:
        return max(math.log(grid[run[0]] / now), math.log(now / grid[run[1]]), 0.0)

    return min(runs, key=away)


def _edge(tried: _Tried, outside: float, inside: float) -> float:
    """Where what is wanted is just reached, between a value that does not and one that does."""
    out, into = math.log(outside), math.log(inside)
    if math.isfinite(tried.ratio(outside)) and tried.ratio(inside) < 1:
        from scipy.optimize import brentq

        # nothing reaches less than e^-50 of what is wanted; an open interval between the two is as far above it
        def over(t: float) -> float:
            return math.log(min(max(tried.ratio(math.exp(t)), math.exp(-50)), math.exp(50)))

        return math.exp(brentq(over, out, into, xtol=FINE))
    while abs(out - into) > FINE:
        middle = (out + into) / 2
        if tried.ratio(math.exp(middle)) <= 1:
            into = middle
        else:
            out = middle
    return math.exp(into)


def _rounded(tried: _Tried, x: float, *, up: bool, whole: bool) -> float:
    """To three significant digits on the safe side, or to more where that would leave what reaches it."""
    step = math.ceil if up else math.floor
    for digits in (3, 4, 5, 6):
        unit = 10.0 ** (math.floor(math.log10(abs(x))) + 1 - digits)
        unit = max(unit, 1.0) if whole else unit
        near = round(step(x / unit * (1 - 1e-9 if up else 1 + 1e-9)) * unit, 12)
        if tried.ratio(near) <= 1:
            return near
    return x


def _with_limit(made: Solution, tried: _Tried, grid: Sequence[float]) -> Solution:
    """What stands in the way, where no value reaches what is wanted."""
    best = tried.row(made.best)
    if best.measured is None or not best.measured.budget:
        return dataclasses.replace(made, beyond=best.reason or "the interval is open whatever its value")
    top = next((line for line in best.measured.budget if line.name != "interaction"), best.measured.budget[0])
    i = list(grid).index(made.best)
    beside = [tried.row(grid[j]) for j in (i - 1, i + 1) if 0 <= j < len(grid)]
    reason = next((row.reason for row in beside if row.reason), "")
    return dataclasses.replace(made, limit=top.name, limit_half_width_m=HALF_WIDTH_95 * abs(top.u),
                               cure=cure_of(top.name), beyond=reason)  # fmt: skip
