"""One scene to measurements: the cheapest evaluation that keeps the tolerance of JCGM 101, 8.2, and the budget."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Array
from ..distribution import Distribution
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
NEARLY_NORMAL = 0.1
"""Excess kurtosis up to which Cornish and Fisher's expansion is trusted; beyond it the laws are convolved."""


class DrawsNeeded(Exception):
    """An interval can only be had by draws, which take a while."""


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
        draws: how many; None for as many as the adaptive procedure wants, 0 for none.
        label: which thing is measured.
        given: what to keep with each measurement, to measure again.

    Raises:
        GeometryError: this view has no finite answer.
        DrawsNeeded: `draws` is 0, and without them an interval would be wrong.
    """
    check_level(level)
    inputs = method.prepare(inputs)
    space = one_scene((inputs,))

    def doubts() -> tuple[Note, ...]:
        return method.notes(inputs, method.function(inputs, *((method.start(inputs),) if method.start else ())))

    told = Told(method.name, level, label, given or {}, doubts)
    return measure_model(model_of(method, inputs), space, method.outputs, told, seed=seed, draws=draws)


def check_level(level: float) -> None:
    """Raise for a coverage that no interval is given for."""
    if not 0.5 <= level <= HIGHEST_LEVEL:
        raise InputError("level", level, f"give a coverage from 0.5 to {HIGHEST_LEVEL}, as 0.95")


def one_scene(inputs: Sequence[Any]) -> Space:
    """The space of the inputs of one scene.

    Raises:
        InputError: they have leading axes.
    """
    space = Space(inputs)
    if space.leading:
        raise InputError("inputs", f"with leading axes {space.leading}", "one scene at a time; use rows() for many")
    return space


@dataclass(frozen=True)
class Told:
    """What goes with the numbers of a measurement.

    Attributes:
        method: its name.
        level: coverage of the intervals.
        label: which thing is measured.
        given: what to keep, to measure again.
        notes: makes the doubts, once there is an answer.
    """

    method: str
    level: float
    label: str
    given: Mapping[str, Any]
    notes: Callable[[], tuple[Note, ...]]


def measure_model(
    model: Model, space: Space, outputs: Sequence[Output], told: Told, *, seed: int = 0, draws: int | None = None
) -> tuple[Measurement, ...]:
    """The outputs of a model of one scene as measurements, as `measure` does for a method.

    Raises:
        GeometryError, DrawsNeeded: as `measure`.
    """
    nominal = scene(model, space, told.level)
    if nominal.reason:
        reason = Reason(int(nominal.reason))
        raise GeometryError(reason.text, code=reason.name.lower())
    notes = told.notes()
    answers = _answers(outputs, model, space, nominal, told.level, seed, draws)
    budgets = _budgets(space.lines, nominal, answers)
    return tuple(
        _measurement(output, value, answer, budget, told.method, told.level, told.label, notes, told.given)
        for output, value, answer, budget in zip(outputs, nominal.value.tolist(), answers, budgets, strict=True)
    )


@dataclass(frozen=True)
class _Answer:
    """u and an interval, how they were had, and what is doubtful about them."""

    u: float | None
    low: float
    high: float
    evaluation: str = "first order"
    notes: tuple[Note, ...] = ()


def _answers(
    outputs: Sequence[Output],
    model: Model,
    space: Space,
    nominal: Propagated,
    level: float,
    seed: int,
    draws: int | None,
) -> list[_Answer]:
    """One for each output, by draws where nothing cheaper will do."""
    mapped = _Mapped(model, space, level)
    found: dict[int, _Answer] = {}
    for o, output in enumerate(outputs):
        answer = _without_draws(nominal, o, output.digits, mapped)
        if answer is not None:
            found[o] = answer
    bent = [o for o in range(len(outputs)) if o not in found]
    if bent and draws == 0:
        raise DrawsNeeded
    if bent:
        from .draws import adaptive, sample_space  # many measurements need none

        digits = max(outputs[o].digits for o in bent)
        fixed = None if draws is None else sample_space(model, space, draws, np.random.default_rng(seed)).of(bent)
        drawn = fixed or adaptive(model, space, level, seed, bent, digits)
        found |= {o: _drawn(drawn, row, level, outputs[o]) for row, o in enumerate(bent)}
    return [found[o] for o in range(len(outputs))]


def _without_draws(nominal: Propagated, o: int, digits: int, mapped: _Mapped) -> _Answer | None:
    """The answer of the cheapest evaluation that keeps the tolerance of JCGM 101, 8.2; None where draws are needed."""
    value, u, bend = float(nominal.value[o]), float(nominal.u[o]), float(nominal.bend[o])
    allowed = tolerance(u, digits) / u if u > 0 else 0.0
    if bend <= allowed:
        half = float(nominal.coverage[o]) * u
        return _Answer(u, value - half, value + half)
    quadratic = nominal.quadratic
    assert quadratic is not None
    active = np.flatnonzero(quadratic.active[o])
    if len(active) == 1:
        found = mapped.answer(o, int(active[0]))
        if found:
            return found
    curved = float(quadratic.curved[o])
    # what the quadratic response leaves out is of the next order
    if curved**2 > allowed or not math.isinf(nominal.dof[o]):
        return None
    if abs(quadratic.excess[o]) < NEARLY_NORMAL:  # which the expansion is for
        low, high = value + float(quadratic.low[o]), value + float(quadratic.high[o])
        return _Answer(float(quadratic.u[o]), low, high, "second order")
    if curved > allowed:
        return None
    from .convolved import interval  # few measurements need it

    ends = interval(quadratic.slopes[o], mapped.laws, mapped.level)
    start = value + float(quadratic.offset[o])
    low, high = (start + end + float(shift) for end, shift in zip(ends, quadratic.shift[:, o], strict=True))
    return _Answer(float(quadratic.u[o]), low, high, "second order, laws convolved")


INSIDE, SPREAD = 33, 1000
"""Quantiles of the single uncertain input that show whether the response is monotone, and those that give u."""


class _Mapped:
    """The quantiles of single uncertain inputs taken through the response, once for all outputs."""

    def __init__(self, model: Model, space: Space, level: float) -> None:
        self.model, self.space, self.level = model, space, level
        self.laws = [law for line in space.lines for law in line.laws]
        self.through: dict[int, Array] = {}

    def answer(self, output: int, variable: int) -> _Answer | None:
        """The interval of the input through a monotone response; None where it is not monotone."""
        if variable not in self.through:
            law = self.laws[variable]
            z = np.zeros((len(self.laws), INSIDE + SPREAD))
            z[variable, :INSIDE] = _quantiles(law, (1 - self.level) / 2, (1 + self.level) / 2, INSIDE)
            z[variable, INSIDE:] = _quantiles(law, 0.0005, 0.9995, SPREAD)
            self.through[variable] = evaluate_at(self.model, self.space, z)[0]
        values, spread = self.through[variable][output, :INSIDE], self.through[variable][output, INSIDE:]
        step = values[1:] - values[:-1]
        if not np.isfinite(values).all() or not ((step > 0).all() or (step < 0).all()):
            return None
        low, high = sorted((float(values[0]), float(values[-1])))
        how = "mapped through the one uncertain input"
        if np.isfinite(spread).all():
            return _Answer(float(spread.std()), low, high, how)
        return _Answer(None, low, high, how, (_HEAVY_TAIL,))


@lru_cache(maxsize=64)
def _quantiles(law: Distribution, low: float, high: float, count: int) -> Array:
    """Of a law, between two shares; not to be written to."""
    return np.array([law.quantile(share) for share in np.linspace(low, high, count).tolist()])


CURE = "make the pixel extent larger or better known: come closer, use a longer lens or a larger object"
NOTHING = 1e-18
"""Share of the variance that is rounding of numbers, and no line of a budget."""
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
    output: Output, value: float, answer: _Answer, budget: tuple[Contribution, ...], method: str, level: float, label: str,
    notes: tuple[Note, ...], given: Mapping[str, Any],
) -> Measurement:  # fmt: skip
    def limit(x: float) -> float | None:
        if output.nonnegative:  # no length is below 0, whatever a symmetric interval says
            x = max(x, 0.0) if x > -math.inf else 0.0
        return x if math.isfinite(x) else None

    # a one-sided doubt puts the value at an end of what is possible; the interval is never without it
    low, high = min(answer.low, value), max(answer.high, value)
    return Measurement(
        output.what, value, answer.u, limit(low), limit(high), output.unit,
        method, level, label, answer.evaluation, budget, notes + answer.notes, given=given,
    )  # fmt: skip


def _budgets(
    lines: Sequence[Line], nominal: Propagated, answers: Sequence[_Answer]
) -> Iterator[tuple[Contribution, ...]]:
    """Of each output: lines with their shares, largest first.

    A line's variance is its first-order one and that of its own curvature; `interaction` takes what draws have beyond.
    """
    assert nominal.curvature is not None
    bent = np.array([answer.evaluation != "first order" for answer in answers])
    squared = np.nan_to_num(nominal.contributions**2 + np.where(bent, nominal.curvature, 0.0))
    for answer, signed, own in zip(answers, nominal.contributions.T.tolist(), squared.T.tolist(), strict=True):
        yield _budget(lines, signed, own, answer.u)


def _budget(
    lines: Sequence[Line], signed: Sequence[float], squared: Sequence[float], u: float | None
) -> tuple[Contribution, ...]:
    own = sum(squared)
    total = max(u**2 if u is not None else 0.0, own)
    if not total > 0:
        return ()
    found = [
        Contribution(line.name, line.source, math.copysign(math.sqrt(q), c), q / total)
        for line, c, q in zip(lines, signed, squared, strict=True)
        if q > NOTHING * total
    ]
    rest = total - own
    if rest > 1e-9 * total:
        text = "what the lines have together, beyond their own"
        found.append(Contribution("interaction", text, math.sqrt(rest), rest / total))
    return tuple(sorted(found, key=lambda c: -c.share))
