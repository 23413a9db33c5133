"""Plans as text: what a set-up gives, what makes its error, what reaches the accuracy, and the error against distance."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from textwrap import wrap

from ..distribution import HALF_WIDTH_95
from ..planned import Entry, Plan, Row, Share, Solution, Wanted
from .rounding import digits_for, fitting_unit, grouped
from .table import columns

WIDTH = 100
_BAR = 20
_LEAST_SHOWN = 0.005
"""Share of a line of the budget that is shown."""
_MATTERS = 0.98
"""A doubt is left out whose end would leave more than this part of the error."""


def report(plans: Sequence[Plan]) -> str:
    """A plan with all that belongs to it; of several, a table and the main parts of each."""
    if len(plans) == 1:
        return "\n".join(_lines(plans[0]))
    parts = ["\n".join(_lines(plan, whole=False)) for plan in plans]
    return "\n\n".join([_summary(plans), *parts, "one of them with its table and notes: --way NAME"])


def _summary(plans: Sequence[Plan]) -> str:
    rows = [("way", "what it measures", "± (95 %)", "wanted")]
    for plan in plans:
        half, wanted = plan.answer.half_width_m, plan.wanted
        found = "no answer" if plan.answer.measured is None else "open" if half is None else f"±{length(half)}"
        said = (
            "" if wanted is None else f"±{length(wanted.half_width_m)}: {'reached' if plan.reached else 'not reached'}"
        )
        rows.append((plan.way, plan.title, found, said))
    return columns(rows)


def _lines(plan: Plan, *, whole: bool = True) -> Iterator[str]:
    yield headline(plan)
    if plan.answer.measured is None:
        yield from wrap(plan.answer.reason, WIDTH, initial_indent="  ", subsequent_indent="  ")
    yield from _scale(plan)
    yield "with"
    yield columns([(f"  {e.title}", given(e), e.quantity.source) for e in plan.entries])
    if plan.answer.measured is not None:
        if whole:
            yield "what the error consists of"
            yield from _budget(plan)
        if plan.improve:
            yield from wrap(f"what would improve it most: {plan.improve}", WIDTH, subsequent_indent="  ")
    if plan.wanted:
        yield from _reaching(plan, plan.wanted)
    if plan.rows and whole:
        yield f"error against {plan.what}"
        yield _table(plan)
    for note in plan.notes if whole else ():
        cure = f"; {note.cure}" if note.cure else ""
        yield from wrap(f"note {note.code}: {note.text}{cure}", WIDTH, subsequent_indent="  ")
    if plan.notes and not whole:
        yield from wrap(f"notes: {', '.join(note.code for note in plan.notes)}", WIDTH, subsequent_indent="  ")


def _reaching(plan: Plan, wanted: Wanted) -> Iterator[str]:
    """What reaches it: one thing at a time, and all together."""
    what = f"{'what keeps' if plan.reached else 'what reaches'} ±{length(wanted.half_width_m)}"
    if plan.solutions:
        yield f"{what}, one thing changed at a time"
        yield from _solutions(plan)
    if plan.combined:
        one = plan.combined.solution
        yield f"{what} by a change and by knowing others better"
        yield from wrap(f"  {one.title}  {reaches(one)}", WIDTH, subsequent_indent="    ")
        yield columns([_share(share) for share in plan.combined.shares])
    if plan.shares:
        yield f"{what} by knowing all of it better, in equal shares"
        yield columns([_share(one) for one in plan.shares])


def headline(plan: Plan) -> str:
    """One line: the way, the distance, the error there, and whether that is what is wanted."""
    at, half = plan.answer.distance_m, plan.answer.half_width_m
    head = f"{plan.title}: {plan.what} {length(at)}"
    if plan.answer.measured is None:
        return f"{head}   no answer"
    m = plan.answer.measured
    found = "95 %: open" if half is None else f"95 %: ±{length(half)} ({percent(half / at)})"
    u = "" if m.u is None else f"   (u {length(m.u)})"
    if plan.wanted is None:
        return f"{head}   {found}{u}"
    return f"{head}   {found}{u}   wanted ±{length(plan.wanted.half_width_m)}: {'reached' if plan.reached else 'not reached'}"


def _scale(plan: Plan) -> Iterator[str]:
    if plan.sampling is not None and plan.sampling.u is not None:
        value, half = (1000 * x for x in (plan.sampling.value, HALF_WIDTH_95 * plan.sampling.u))
        decimals = max(digits_for(half), 0)
        yield f"  ground sampling distance {grouped(value, decimals)} ± {grouped(half, decimals)} mm/px (95 %)"


# -- numbers ------------------------------------------------------------------------------------------------------------


def length(value_m: float) -> str:
    """An error to two significant digits, three from 1 m, without zeros behind the point: 5 cm, 0.62 m, 0.16 mm."""
    if not value_m:
        return "0"
    name, factor = next(row for row in _ERRORS if abs(value_m) >= row[1] * (1 - 1e-9))[::2]
    return f"{_digits(value_m / factor, 3 if abs(value_m) >= 1 else 2)} {name}"


_ERRORS = (("km", 1e4, 1e3), ("m", 0.1, 1.0), ("cm", 1e-2, 1e-2), ("mm", 1e-6, 1e-3), ("µm", 0.0, 1e-6))


def _digits(value: float, digits: int) -> str:
    """A number to so many significant digits, without zeros behind the point."""
    decimals = max(digits - 1 - math.floor(math.log10(abs(value)) + 1e-12), 0) if value else 0
    text = grouped(value, decimals)
    return text.rstrip("0").rstrip(".") if "." in text else text


def _short(value: float, unit: str, digits: int) -> str:
    """A value in its fitting unit."""
    name, factor = fitting_unit(value, unit)
    return f"{_digits(value / factor, digits)}{'' if name == '°' else ' '}{name}".strip()


def percent(share: float) -> str:
    """A share to two significant digits: 3.1 %."""
    return f"{100 * share:.2g} %" if share < 1 else f"{100 * share:.0f} %"


def doubt(u: float, unit: str, law: str, of: float | None = None) -> str:
    """A standard deviation as people state a doubt: ±a of 95 %, or as limits; with its share of a length."""
    if u == 0:
        return "exact"
    wide, said = (math.sqrt(3.0), " (limits)") if law == "uniform" else (HALF_WIDTH_95, "")
    share = f" ({percent(wide * u / of)})" if of and unit in ("m", "px") else ""
    half = length(wide * u) if unit == "m" else _short(wide * u, unit, 2)
    return f"±{half}{share}{said}"


def given(entry: Entry) -> str:
    """A number of the set-up as it was given."""
    q = entry.quantity
    value, u, law = float(q.value), float(q.u), q.distribution.name
    if entry.error_key and not value and not entry.scaled:  # a doubt on its own
        return doubt(u, q.unit, law)
    shown = f"{value:.0f} px" if q.unit == "px" and entry.key == "width-px" else _short(value, q.unit, 4)
    return f"{shown} {doubt(u, q.unit, law, value)}"


# -- parts --------------------------------------------------------------------------------------------------------------


def _budget(plan: Plan) -> Iterator[str]:
    assert plan.answer.measured is not None
    budget = [c for i, c in enumerate(plan.answer.measured.budget) if not i or c.share >= _LEAST_SHOWN]
    widest = max((len(c.name) for c in budget), default=0)
    for c in budget:
        share = f"{100 * c.share:.0f} %"
        yield f"  {c.name:<{widest}}  {'█' * round(_BAR * c.share):<{_BAR}} {share:>5}   ±{length(HALF_WIDTH_95 * abs(c.u))}"


def _solutions(plan: Plan) -> Iterator[str]:
    """Each that reaches it, and of the others those that make a difference."""
    now = plan.answer.half_width_m
    shown = [
        one for one in plan.solutions
        if one.reached or not one.law or now is None or one.half_width_m is None or one.half_width_m < _MATTERS * now
    ]  # fmt: skip
    widest = max((len(one.title) for one in shown), default=0)
    for one in shown:
        first, *rest = wrap(reaches(one), WIDTH - widest - 4)
        yield f"  {one.title:<{widest}}  {first}"
        for line in rest:
            yield f"  {'':<{widest}}  {line}"
    left = len(plan.solutions) - len(shown)
    if left:
        yield f"  and {left} more ± that make{'s' if left == 1 else ''} no difference"


def _value(one: Solution, x: float, digits: int = 3) -> str:
    if one.law:
        return doubt(x, one.unit, one.law, one.of)
    return f"{x:.0f} px" if one.key == "width-px" else _short(x, one.unit, digits)


def reaches(one: Solution) -> str:
    """Which values reach what is wanted, or what stands in the way, in words."""
    if not one.reached:
        return _out_of_reach(one)
    # the thing's length in the picture belongs to the lower value where there is one, else to the higher
    seen = "" if one.seen_px is None or one.law else f" ({_digits(one.seen_px, 3)} px in the picture)"
    if one.low is not None and one.high is not None:
        text = f"{_value(one, one.low)}{seen} to {_value(one, one.high)}"
    elif one.low is not None:
        text = f"at least {_value(one, one.low)}{seen}"
    elif one.high is not None:
        text = f"at most {_value(one, one.high)}{seen}"
    else:
        least = "up" if one.law else f"from {_value(one, one.tried[0])}"
        text = f"any {least} to {_value(one, one.tried[1])}"
    return f"{text}; {one.beyond}" if one.beyond and one.high is not None else text


def _out_of_reach(one: Solution) -> str:
    """At best so much, and what stands in the way."""
    if one.half_width_m is None:
        return f"none: {one.beyond}"
    best = f"±{length(one.half_width_m)}"
    text = (
        f"none: {best} is left even if it were exact"
        if one.law
        else f"none: at best {best}, near {_value(one, one.best)}"
    )
    if one.limit_half_width_m is not None:
        text += f"; ±{length(one.limit_half_width_m)} by {one.limit} alone"
    return f"{text}; {one.beyond}" if one.beyond else text


def _share(one: Share) -> tuple[str, str, str]:
    of = one.value or None
    now = doubt(one.now_u, one.unit, one.law, of)
    return (
        f"  {one.title}",
        doubt(one.u, one.unit, one.law, of),
        "as it is" if one.u == one.now_u else f"instead of {now}",
    )


def _table(plan: Plan) -> str:
    seen = any(row.seen_px is not None for row in plan.rows)
    head = (f"  {plan.what}", "in the picture", "u", "± (95 %)", "", "largest part")
    rows = [head, *(_row(row, plan) for row in plan.rows)]
    return columns(rows if seen else [(row[0], *row[2:]) for row in rows])


def _row(row: Row, plan: Plan) -> tuple[str, ...]:
    at = f"  {_short(row.distance_m, 'm', 4)}"
    if row.measured is None:
        return at, "-", "-", "-", "", row.reason.split(";")[0]
    half, top = row.half_width_m, row.largest
    u = "-" if row.measured.u is None else _two(row.measured.u)
    seen = "-" if row.seen_px is None else f"{_digits(row.seen_px, 3)} px"
    largest = f"{top.name} {100 * top.share:.0f} %" if top else ""
    if half is None:
        return at, seen, u, "open", "", largest
    enough = plan.wanted is not None and half <= plan.wanted.at(row.distance_m)
    return (
        at,
        seen,
        u,
        f"±{_two(half)}",
        percent(half / row.distance_m),
        f"{largest}{'   reaches it' if enough else ''}",
    )


def _two(value_m: float) -> str:
    """To two significant digits, kept where they are zeros."""
    name, factor = ("m", 1.0) if value_m >= 0.1 else ("cm", 1e-2) if value_m >= 1e-2 else ("mm", 1e-3)
    return f"{grouped(value_m / factor, max(digits_for(value_m / factor), 0))} {name}"
