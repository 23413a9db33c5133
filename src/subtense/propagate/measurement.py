"""One scene to measurements: the cheapest evaluation that keeps the tolerance of JCGM 101, 8.2, and the budget."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Array
from ..errors import GeometryError, InputError
from ..method import Method, Output, Reason
from ..quantity import Contribution, Measurement, Note
from ..space import Line, Space
from .differences import Propagated, scene, tolerance
from .model import Model, evaluate_at, model_of

if TYPE_CHECKING:
    from .draws import Draws

HIGHEST_LEVEL = 0.999
"""Beyond it the tails of no law are known well enough, and draws don't reach them."""
NEARLY_NORMAL = 0.4
"""Excess kurtosis up to which Cornish and Fisher's expansion is trusted: a uniform input may make half the variance."""


def measure(
    method: Method, inputs: Any, *, level: float = 0.95, seed: int = 0, draws: int | None = None, label: str = "",
    given: Mapping[str, Any] | None = None,
) -> tuple[Measurement, ...]:  # fmt: skip
    """The outputs of a method as measurements, headline first.

    Args:
        method: of METHODS.
        inputs: its Inputs, one scene.
        level: coverage of the intervals.
        seed: of the draws, where they are needed.
        draws: how many; None for as many as the adaptive procedure wants.
        label: which thing is measured.
        given: what to keep with each measurement, to measure again.

    Raises:
        GeometryError: this view has no finite answer.
    """
    if not 0.5 <= level <= HIGHEST_LEVEL:
        raise InputError("level", level, f"give a coverage from 0.5 to {HIGHEST_LEVEL}, as 0.95")
    inputs = method.prepare(inputs)
    space = Space((inputs,))
    if space.leading:
        raise InputError("inputs", f"with leading axes {space.leading}", "one scene at a time; use rows() for many")
    model = model_of(method, inputs)
    nominal = scene(model, space, level)
    if nominal.reason:
        reason = Reason(int(nominal.reason))
        raise GeometryError(reason.text, code=reason.name.lower())
    result = method.function(inputs, *((method.start(inputs),) if method.start else ()))
    notes = method.notes(inputs, result)
    answers = [
        _without_draws(model, space, nominal, o, level, output.digits) for o, output in enumerate(method.outputs)
    ]
    bent = [o for o, answer in enumerate(answers) if answer is None]
    drawn = None
    if bent:
        from .draws import adaptive, sample_space  # many measurements need none

        digits = max(method.outputs[o].digits for o in bent)
        fixed = None if draws is None else sample_space(model, space, draws, np.random.default_rng(seed))
        drawn = fixed or adaptive(model, space, level, seed, bent, digits)
    found = []
    for o, output in enumerate(method.outputs):
        answer = answers[o]
        if answer is None:
            assert drawn is not None
            answer = _drawn(drawn, o, level, output)
        found.append(_measurement(method, output, nominal, o, answer, space, level, label, notes, given or {}))
    return tuple(found)


@dataclass(frozen=True)
class _Answer:
    """u and an interval, how they were had, and what is doubtful about them."""

    u: float | None
    low: float
    high: float
    evaluation: str = "first order"
    notes: tuple[Note, ...] = ()


def _without_draws(
    model: Model, space: Space, nominal: Propagated, o: int, level: float, digits: int
) -> _Answer | None:
    """The answer of the cheapest evaluation that keeps the tolerance of JCGM 101, 8.2; None where draws are needed."""
    u, bend = float(nominal.u[o]), float(nominal.bend[o])
    allowed = tolerance(u, digits) / u if u > 0 else 0.0
    if bend <= allowed:
        return _Answer(u, float(nominal.low[o]), float(nominal.high[o]))
    quadratic, value = nominal.quadratic[o], float(nominal.value[o])
    if len(quadratic.active) == 1:
        mapped = _mapped(model, space, o, quadratic.active[0], level)
        if mapped:
            return mapped
    # what the quadratic response leaves out is of the next order, and the expansion is for nearly normal sums
    if bend**2 <= allowed and abs(quadratic.excess) < NEARLY_NORMAL and math.isinf(float(nominal.dof[o])):
        return _Answer(quadratic.u, value + quadratic.low, value + quadratic.high, "second order")
    return None


def _mapped(model: Model, space: Space, output: int, variable: int, level: float) -> _Answer | None:
    """The interval of the single uncertain input taken through a monotone response; None where it is not monotone."""
    laws = [law for line in space.lines for law in line.laws]

    def through(shares: Array) -> Array:
        z = np.zeros((len(laws), len(shares)))
        z[variable] = [laws[variable].quantile(float(share)) for share in shares]
        return np.asarray(evaluate_at(model, space, z)[0][output])

    values = through(np.linspace((1 - level) / 2, (1 + level) / 2, 33))
    step = np.diff(values)
    if not np.all(np.isfinite(values)) or not (np.all(step > 0) or np.all(step < 0)):
        return None
    spread = through(np.linspace(0.0005, 0.9995, 1000))
    how = "mapped through the one uncertain input"
    if np.all(np.isfinite(spread)):
        return _Answer(float(np.std(spread)), float(values.min()), float(values.max()), how)
    return _Answer(None, float(values.min()), float(values.max()), how, (_HEAVY_TAIL,))


CURE = "make the pixel extent larger or better known: come closer, use a longer lens or a larger object"
_HEAVY_TAIL = Note(
    "heavy_tail", "the far tail is so long that a standard deviation has no meaning; use the interval", CURE
)


def _drawn(draws: Draws, o: int, level: float, output: Output) -> _Answer:
    low, high = draws.interval(o, level)
    lost = float(draws.unanswered[o])
    evaluation = f"Monte Carlo, {draws.values.shape[1]} draws"
    notes: list[Note] = []
    u: float | None = float(draws.u[o])
    if math.isinf(low) or math.isinf(high):
        notes.append(_open_note(low, high, lost, output.unit))
        u = None
    elif lost:
        text = f"{lost:.1%} of the draws have no answer; they count as beyond the interval".replace("%", " %")
        notes.append(Note("draws_without_answer", text, CURE))
    if u is not None and not draws.stable and _heavy(draws.values[o]):
        notes.append(_HEAVY_TAIL)
        u = None
    return _Answer(u, low, high, evaluation, tuple(notes))


def _open_note(low: float, high: float, lost: float, unit: str) -> Note:
    share = f"{lost:.0%} of the draws have no answer".replace("%", " %")
    if math.isinf(low) and math.isinf(high):
        return Note("open_interval", f"both limits are open, {share}", CURE)
    if math.isinf(high):
        return Note("open_interval", f"from {low:.3g} {unit}, far limit open, {share}", CURE)
    return Note("open_interval", f"up to {high:.3g} {unit}, near limit open, {share}", CURE)


def _heavy(values: Array) -> bool:
    """Whether the standard deviations of ten parts of the draws scatter by more than a tenth."""
    parts = np.array([np.nanstd(part) for part in np.array_split(values, 10)])
    return bool(np.std(parts) > 0.1 * np.mean(parts))


def _measurement(
    method: Method, output: Output, nominal: Propagated, o: int, answer: _Answer, space: Space, level: float,
    label: str, notes: tuple[Note, ...], given: Mapping[str, Any],
) -> Measurement:  # fmt: skip
    def limit(x: float) -> float | None:
        if output.nonnegative:  # no length is below 0, whatever a symmetric interval says
            x = max(x, 0.0) if x > -math.inf else 0.0
        return x if math.isfinite(x) else None

    curvature = nominal.curvature[:, o] if nominal.curvature is not None and answer.evaluation != "first order" else 0.0
    budget = _budget(space.lines, nominal.contributions[:, o], curvature, answer.u)
    value = float(nominal.value[o])
    # a one-sided doubt puts the value at an end of what is possible; the interval is never without it
    low, high = min(answer.low, value), max(answer.high, value)
    return Measurement(
        output.what, value, answer.u, limit(low), limit(high), output.unit,
        method.name, level, label, answer.evaluation, budget, notes + answer.notes, given=given,
    )  # fmt: skip


def _budget(
    lines: Sequence[Line], contributions: Array, curvature: Array | float, u: float | None
) -> tuple[Contribution, ...]:
    """Lines with their shares, largest first.

    A line's variance is its first-order one and that of its own curvature; `interaction` takes what draws have beyond.
    """
    squared = np.nan_to_num(contributions**2 + curvature)
    own = float(np.sum(squared))
    total = max(u**2 if u is not None else 0.0, own)
    if not total > 0:
        return ()
    found = [
        Contribution(line.name, line.source, math.copysign(math.sqrt(q), c), float(q / total))
        for line, c, q in zip(lines, contributions, squared, strict=True)
        if q > 0
    ]
    rest = total - own
    if rest > 1e-9 * total:
        text = "what the lines have together, beyond their own"
        found.append(Contribution("interaction", text, math.sqrt(rest), rest / total))
    return tuple(sorted(found, key=lambda c: -c.share))
