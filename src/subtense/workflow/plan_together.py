"""What reaches an accuracy where no single change does: all numbers known better, or one of them changed and the rest known better."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial

from ..planned import Combined, Entry, Share, Solution, Wanted
from .plan_solve import knobs, row_at, solutions
from .plan_ways import Setup, Way

LEAST_SHARE = 1e-6
"""Part of a doubt below which it is not lessened."""
HELPS = 0.9
"""A number that leaves more of the present error, whatever its value, is none to change."""
HALF_OF_IT = math.sqrt(0.5)
"""What is left to what a change can't lessen, of the error that is wanted: half its variance."""


def combined(way: Way, setup: Setup, distance_m: float, wanted: Wanted, found: Sequence[Solution]) -> Combined | None:
    """The way's main number changed, and what limits it even so known better; None where one change is enough, or nothing is.

    Half of the variance that is wanted is left to what the change lessens, and half to the others.

    Args:
        way: of WAYS.
        setup: its numbers.
        distance_m: planned.
        wanted: the accuracy.
        found: what one change at a time reaches.
    """
    alone = next((one for one in found if one.key == way.lever), None)
    if alone is None or alone.half_width_m is None or any(one.reached and one.key != "distance" for one in found):
        return None
    half_of_it = replace(wanted, half_width_m=HALF_OF_IT * wanted.half_width_m)
    now = row_at(way, setup, distance_m).half_width_m
    if now is None or alone.half_width_m < HELPS * now:
        entry = setup.entries[way.lever].moved(alone.best)
        better = shares(way, setup.with_entry(entry), distance_m, half_of_it.half_width_m)
    else:  # what it lessens is hidden behind what it does not: the error in the picture, by all experience
        value = _for_pixels_alone(way, setup, distance_m, half_of_it)
        if value is None:
            return None
        entry = setup.entries[way.lever].moved(value)
        pixels = [e.key for e in setup.entries.values() if e.quantity.unit == "px" and e.key != "focal"]
        better = shares(way, setup.with_entry(entry), distance_m, wanted.half_width_m, held=pixels)
    changed = setup
    for share in better:
        held = entry if share.key == entry.key else setup.entries[share.key]
        changed = changed.with_entry(held.known_to(share.u))
    [again] = solutions(knobs(way, changed, distance_m, wanted), [way.lever])
    if not better or not again.reached:
        return None
    at = changed.entries[way.lever].moved(again.low if again.low is not None else again.high or again.best)
    told = tuple(_at(share, at) if share.key == at.key else share for share in better if share.u < share.now_u)
    return Combined(again, told)


def _for_pixels_alone(way: Way, setup: Setup, distance_m: float, wanted: Wanted) -> float | None:
    """The value of the main number that reaches it, were nothing doubtful but pixels; None where the present one does."""
    certain = setup
    for entry in setup.entries.values():
        if entry.quantity.unit != "px" or entry.key == "focal":
            certain = certain.with_entry(entry.known_to(0.0))
    [found] = solutions(knobs(way, certain, distance_m, wanted), [way.lever])
    now = setup.value(way.lever)
    if found.reached and found.low is not None and found.low > now:
        return found.low
    return found.high if found.reached and found.high is not None and found.high < now else None


def _at(share: Share, entry: Entry) -> Share:
    """The share of the changed number, at the value that is told."""
    u = float(entry.quantity.u)
    return replace(share, value=float(entry.quantity.value), u=u, now_u=share.now_u * u / share.u)


def shares(
    way: Way, setup: Setup, distance_m: float, wanted_m: float, *, held: Sequence[str] = ()
) -> tuple[Share, ...]:
    """How well each number must be known where the error that is allowed is shared out equally among those that make it.

    What is known well enough for less than its share stays as it is, and leaves more to the others. Empty where what is no
    number of the set-up (the lens's distortion, a focus) makes more than is wanted.

    Args:
        way: of WAYS.
        setup: its numbers.
        distance_m: planned.
        wanted_m: half-width of the interval.
        held: keys of entries that are not to be known better.
    """
    doubtful = [e for e in setup.entries.values() if e.error_key and float(e.quantity.u) > 0 and e.key not in held]
    certain = setup
    for entry in doubtful:
        certain = certain.with_entry(entry.known_to(0.0))

    def alone(entry: Entry, u: float) -> float:
        half = row_at(way, certain.with_entry(entry.known_to(u)), distance_m).half_width_m
        return math.inf if half is None else half

    rest = alone(doubtful[0], 0.0) if doubtful else math.inf
    if not rest < wanted_m:
        return ()
    share_m = _equal_share(
        wanted_m**2 - rest**2, [math.sqrt(max(alone(e, float(e.quantity.u)) ** 2 - rest**2, 0.0)) for e in doubtful]
    )
    limit_m = math.hypot(share_m, rest)
    allowed = {e.key: _allowed(partial(alone, e), float(e.quantity.u), limit_m) for e in doubtful}
    lessened = _together(way, setup, distance_m, wanted_m, doubtful, allowed)
    if lessened is None:
        return ()
    return tuple(
        Share(
            e.key,
            e.title,
            float(e.quantity.u),
            lessened[e.key],
            float(e.quantity.value),
            e.quantity.unit,
            e.quantity.distribution.name,
        )
        for e in doubtful
    )


def _equal_share(total: float, alone: Sequence[float]) -> float:
    """The error that each may make, as a half-width, where what makes less leaves its rest to the others."""
    left, count = total, len(alone)
    for half in sorted(alone):
        if half**2 >= left / count:
            break
        left, count = left - half**2, count - 1
    return math.sqrt(left / count) if count else math.inf


def _allowed(half_width: Callable[[float], float], now: float, share_m: float) -> float:
    """The doubt, at most the present one, that makes no more than its share."""
    if half_width(now) <= share_m:
        return now
    low, high = math.log(now * LEAST_SHARE), math.log(now)
    while high - low > 5e-3:
        middle = (low + high) / 2
        if half_width(math.exp(middle)) <= share_m:
            low = middle
        else:
            high = middle
    return math.exp(low)


def _together(
    way: Way, setup: Setup, distance_m: float, wanted_m: float, doubtful: Sequence[Entry], allowed: dict[str, float]
) -> dict[str, float] | None:
    """The doubts, lessened further until all together reach what is wanted, rounded to the safe side; None where they can't."""

    def lessened(factor: float) -> dict[str, float]:
        return {
            e.key: allowed[e.key] if allowed[e.key] == float(e.quantity.u) else _floor2(factor * allowed[e.key])
            for e in doubtful
        }

    for factor in _factors():
        found = lessened(factor)
        tried = setup
        for entry in doubtful:
            tried = tried.with_entry(entry.known_to(found[entry.key]))
        half = row_at(way, tried, distance_m).half_width_m
        if half is not None and half <= wanted_m:
            return found
    return None


def _factors() -> Iterator[float]:
    yield from (1.0 - step / 50 for step in range(40))


def _floor2(u: float) -> float:
    """Down to two significant digits."""
    unit = 10.0 ** (math.floor(math.log10(u)) - 1)
    return math.floor(u / unit * (1 + 1e-9)) * unit
