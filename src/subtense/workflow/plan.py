"""Planning: what a set-up will measure and how well, and what would have to change for an accuracy that is wanted.

Every number comes from the method that measures, through `propagate`, of a picture that the set-up would give: so what is
planned is what will stand in the report.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np

from .. import propagate
from ..errors import GeometryError, InputError
from ..methods import ground_sampling
from ..planned import Plan, Wanted
from ..quantity import Measurement, Note
from .improve import improve
from .plan_input import PlanTexts, distance_of, length_with_unit, setup_of, wanted_of, ways_of
from .plan_solve import knobs, row_at, solutions
from .plan_together import combined, shares
from .plan_ways import Setup, Way

STEPS = (1.0, 2.0, 5.0)
"""First digits of the distances in the table."""
AROUND = 10.0
"""The table and the chart go so many times nearer and farther than the planned distance."""
CURVE_POINTS = 49
MOST_APART = 1e5
"""Farthest over nearest of a range that was said."""
_SCALE = dataclasses.replace(ground_sampling.METHOD, outputs=ground_sampling.METHOD.outputs[:1])


def plan(
    said: PlanTexts, *, solve: Sequence[str] = (), between: str | None = None, curve: bool = False
) -> tuple[Plan, ...]:
    """Plan a measurement in one way, or in all that fit what was said.

    Args:
        said: distance, accuracy and set-up, as typed.
        solve: numbers to solve for; all that there are where empty. Nothing is solved for without an accuracy.
        between: "1 m to 50 m", the distances of the table; around the planned one where nothing was said.
        curve: whether rows close together are wanted too, for a chart.

    Returns:
        A plan for each way. Where several were tried, one that has no answer at this distance has a note `refused`.

    Raises:
        InputError: a text that can't be used.
        GeometryError: the one way that was asked for shows nothing at this distance.
    """
    ways = ways_of(said)
    distance_m = distance_of(said)
    wanted = wanted_of(said.accuracy, distance_m)
    if solve and wanted is None:
        raise InputError("--solve", ", ".join(solve), "say what is to be reached, as --accuracy '5 cm'")
    ends = _ends(between, distance_m)
    setups = [(way, setup_of(way, said, distance_m)) for way in ways]
    if len(setups) == 1:
        setups[0][0].inputs(setups[0][1], distance_m)  # the reason why nothing is seen there is the error
    plans = [_plan(way, setup, distance_m, wanted, solve, ends, curve=curve) for way, setup in setups]
    return tuple(plans)


def _plan(
    way: Way, setup: Setup, distance_m: float, wanted: Wanted | None, solve: Sequence[str], ends: tuple[float, float], *,
    curve: bool,
) -> Plan:  # fmt: skip
    answer = row_at(way, setup, distance_m, draws=None)
    made = Plan(way.name, way.title, way.what, way.method.name, wanted, tuple(setup.entries.values()), answer)
    try:
        way.inputs(setup, distance_m)
    except GeometryError as error:
        return dataclasses.replace(made, notes=(Note("refused", str(error)),))
    rows = tuple(row_at(way, setup, x) if x != distance_m else answer for x in _steps(*ends, distance_m))
    made = dataclasses.replace(
        made, rows=rows, improve=improve(answer.measured) if answer.measured else "", sampling=_sampling(way, setup)
    )
    if curve:
        close = np.geomspace(*ends, CURVE_POINTS).tolist()
        made = dataclasses.replace(made, curve=tuple(row_at(way, setup, x) for x in close))
    if wanted is not None:
        found = solutions(knobs(way, setup, distance_m, wanted), solve)
        made = dataclasses.replace(made, solutions=found)
        if not made.reached and not solve:
            together = combined(way, setup, distance_m, wanted, found)
            made = dataclasses.replace(
                made, shares=shares(way, setup, distance_m, wanted.half_width_m), combined=together
            )
    return dataclasses.replace(made, notes=_notes(made))


def _sampling(way: Way, setup: Setup) -> Measurement | None:
    return propagate.measure(_SCALE, way.sampling(setup), draws=2000)[0] if way.sampling else None


def _ends(between: str | None, distance_m: float) -> tuple[float, float]:
    """The nearest and the farthest distance of the table."""
    if between is None:
        return distance_m / AROUND, distance_m * AROUND
    first, word, last = between.partition(" to ")
    if not word:
        raise InputError("--between", between, "give two distances, as '1 m to 50 m'")
    near, far = (length_with_unit(text.strip(), "--between") for text in (first, last))
    if not near < far <= MOST_APART * near:
        raise InputError("--between", between, "give a nearer and a farther distance, at most 100000 times as far")
    return near, far


def _steps(near: float, far: float, planned: float) -> list[float]:
    """1, 2, 5, 10, ... between two distances, the ends and the planned one."""
    powers = range(math.floor(math.log10(near)), math.ceil(math.log10(far)) + 1)
    round_ones = [round(step * 10.0**power, 12) for power in powers for step in STEPS]
    inside = {x for x in round_ones if near * (1 - 1e-9) <= x <= far * (1 + 1e-9)}
    return sorted({*inside, planned} if near <= planned <= far else inside) or [near, far]


def _notes(made: Plan) -> tuple[Note, ...]:
    """Those of the measurement, of what is assumed, and that nothing alone reaches what is wanted."""
    found = list(made.answer.measured.notes) if made.answer.measured else []
    assumed = [entry.title for entry in made.entries if entry.assumed]
    if assumed:
        text = f"nobody said: {', '.join(assumed)}; what is assumed of them stands beside them"
        found.append(Note("setup_assumed", text, "say what your set-up has"))
    if made.wanted is not None and not any(one.reached for one in made.solutions):
        text = "no single change of the set-up reaches what is wanted"
        cure = (
            "better know all that makes the error, as listed, or measure from nearer"
            if made.shares
            else "measure in another way"
        )
        found.append(Note("accuracy_out_of_reach", text, cure))
    return tuple(dict.fromkeys(found))
