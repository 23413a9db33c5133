"""One number from several measurements of one thing, with what they have in common treated as common."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import Array
from ..errors import InputError
from ..method import Method, Output
from ..noun import Noun, fields_of
from ..propagate import Combination, joint, measure, measure_together
from ..quantity import Measurement, Note, Quantity
from ..space import map_nouns
from .given import given

DOUBT = 0.01
"""Probability of so large a contradiction by chance, below which it is noted."""
DRAWS = 20_000


@dataclass(frozen=True)
class Fused:
    """Several measurements of one thing, and what they say together.

    Attributes:
        one: the combined measurement.
        each: what each says alone, in the order they were given.
        weights: of each in the combination; 0 for one that was left out or adds nothing.
        chi2: how far they are from each other, squared, in what they should scatter; of `freedom` degrees.
    """

    one: Measurement
    each: tuple[Measurement, ...]
    weights: tuple[float, ...]
    chi2: float
    freedom: int


def fuse(
    pairs: Sequence[tuple[Method, Any]], what: str | None = None, *, level: float = 0.95, seed: int = 0, draws: int | None = None,
    label: str = "", labels: Sequence[str] = (),
) -> Fused:  # fmt: skip
    """The weighted mean of what several methods say of one number.

    Each weight is what makes the variance of the mean least, with the covariance of all by the nouns that they share
    (a camera, a reference), and none is below 0. Where they contradict each other beyond chance, one that alone is to
    blame is left out; else the interval is widened by the square root of chi-square over its degrees of freedom (Birge).

    Args:
        pairs: two or more methods and their Inputs; nouns that are the same are moved together.
        what: the output that all of them have; the first that they share where it is None.
        level: coverage of the interval.
        seed: of the draws.
        draws: how many; None for as many as two digits of u need.
        label: what is measured.
        labels: of each, for the notes.

    Raises:
        InputError: fewer than two, or nothing that all of them give.
        GeometryError: one has no finite answer.

    Source: weighted means of correlated quantities, GUM H.2 and A. C. Aitken, 1936; R. T. Birge, Phys. Rev. 40, 1932.
    """
    if len(pairs) < 2:
        raise InputError("measurements", f"{len(pairs)}", "give two or more of the same thing")
    names = [labels[i] if i < len(labels) and labels[i] else f"{m.name} {i + 1}" for i, (m, _) in enumerate(pairs)]
    outputs = _outputs(pairs, what)
    ready = [(method, method.prepare(inputs)) for method, inputs in pairs]
    each = tuple(
        _alone(pair, output, level, seed, draws, name)
        for pair, (output, _), name in zip(ready, outputs, names, strict=True)
    )
    values, cov = np.array([m.value for m in each]), _covariance(ready, [row for _, row in outputs], draws or DRAWS)
    kept, notes = _kept(values, cov, names, each)
    weights = np.zeros(len(values))
    weights[kept] = _weights(cov[np.ix_(kept, kept)])
    chi2 = _chi2(values[kept], cov[np.ix_(kept, kept)])
    rows = [row for _, row in outputs]

    def mean(answers: Sequence[Array]) -> Array:
        return np.asarray(sum(w * answer[row] for w, answer, row in zip(weights, answers, rows, strict=True) if w))[
            None
        ]

    output = dataclasses.replace(outputs[0][0], name="mean")
    kept_given = {
        f"part_{i}": {"method": method.name, "given": given(inputs)} for i, (method, inputs) in enumerate(pairs, 1)
    }
    (one,) = measure_together(
        ready, Combination("fuse", (output,), mean), level=level, seed=seed, draws=draws, label=label, given=kept_given
    )
    freedom = len(kept) - 1
    one, widened = _widened(one, chi2, freedom, names, values)
    notes += widened + _doubts(each, weights)
    return Fused(dataclasses.replace(one, notes=tuple(notes)), each, tuple(weights.tolist()), chi2, freedom)


def disagreement(pairs: Sequence[tuple[Method, Any]], what: str) -> float:
    """How far two measurements of one thing are apart, in standard deviations of their difference.

    Args:
        pairs: two methods and their Inputs; what they share cancels as far as it moves both alike.
        what: the output that both have.
    """
    outputs = _outputs(pairs, what)
    ready = [(method, method.prepare(inputs)) for method, inputs in pairs]
    values = np.array([float(_nominal(pair, output)) for pair, (output, _) in zip(ready, outputs, strict=True)])
    return math.sqrt(_chi2(values, _covariance(ready, [row for _, row in outputs])))


def _nominal(pair: tuple[Method, Any], output: Output) -> float:
    method, inputs = pair
    result = method.function(inputs, *((method.start(inputs),) if method.start else ()))
    return float(getattr(result, output.name))


def _outputs(pairs: Sequence[tuple[Method, Any]], what: str | None) -> list[tuple[Output, int]]:
    """Of each method the output that is wanted, and which it is."""
    shared = [o.what for o in pairs[0][0].outputs if all(o.what in {p.what for p in m.outputs} for m, _ in pairs)]
    if (what or "") not in shared and (what is not None or not shared):
        have = "; ".join(f"{m.name}: {', '.join(o.what for o in m.outputs)}" for m, _ in pairs)
        raise InputError("what", what, f"give what all of them measure ({have})")
    wanted = what or shared[0]
    found = []
    for method, _ in pairs:
        row = next(i for i, o in enumerate(method.outputs) if o.what == wanted)
        found.append((method.outputs[row], row))
    return found


def _alone(
    pair: tuple[Method, Any], output: Output, level: float, seed: int, draws: int | None, name: str
) -> Measurement:
    method, inputs = pair
    return next(
        m for m in measure(method, inputs, level=level, seed=seed, draws=draws, label=name) if m.what == output.what
    )


def _covariance(ready: Sequence[tuple[Method, Any]], rows: Sequence[int], draws: int = DRAWS) -> Array:
    """Of the wanted output of each: by draws, as u from draws is what counts where a response bends."""
    _, drawn = joint(ready, draws=draws)
    starts = np.cumsum([0, *(len(method.outputs) for method, _ in ready)])
    values = drawn.values[[int(start) + row for start, row in zip(starts, rows, strict=False)]]
    whole = values[:, np.isfinite(values).all(axis=0)]
    if whole.shape[1] < 0.9 * draws:
        raise InputError("fuse", "measurements with an open interval", "leave out what has no finite interval")
    return np.atleast_2d(np.cov(whole))


def _inverse(cov: Array) -> Array:
    """A generalised inverse: what two measurements share wholly tells nothing of either."""
    scale = np.sqrt(np.diag(cov))
    safe = np.where(scale > 0, scale, 1.0)
    return np.asarray(np.linalg.pinv(cov / np.outer(safe, safe), rcond=1e-9, hermitian=True) / np.outer(safe, safe))


def _weights(cov: Array) -> Array:
    """(n,) weights that sum to 1, none below 0, for the least variance of the mean."""
    active = list(range(len(cov)))
    while True:
        weights = _inverse(cov[np.ix_(active, active)]).sum(axis=1)
        if not weights.sum() > 0:  # known exactly
            weights = np.ones(len(active))
        weights = weights / weights.sum()
        if np.all(weights >= -1e-9):
            found = np.zeros(len(cov))
            found[active] = np.maximum(weights, 0.0)
            return found
        active.pop(int(np.argmin(weights)))


def _chi2(values: Array, cov: Array) -> float:
    if len(values) < 2:
        return 0.0
    inverse = _inverse(cov)
    total = float(inverse.sum())
    rest = values - float((inverse @ values).sum()) / total if total > 0 else values - values.mean()
    return float(rest @ inverse @ rest)


def _chance(chi2: float, freedom: int) -> float:
    from scipy.stats import chi2 as law

    return float(law.sf(chi2, freedom)) if freedom > 0 else 1.0


def _kept(values: Array, cov: Array, names: Sequence[str], each: Sequence[Measurement]) -> tuple[list[int], list[Note]]:
    """Which measurements count: all, or all but one that alone contradicts the rest."""
    everyone = list(range(len(values)))
    if _chance(_chi2(values, cov), len(values) - 1) >= DOUBT or len(values) < 3:
        return everyone, []
    rests = [[i for i in everyone if i != out] for out in everyone]
    chances = [_chance(_chi2(values[rest], cov[np.ix_(rest, rest)]), len(rest) - 1) for rest in rests]
    out = int(np.argmax(chances))
    if chances[out] < DOUBT or sorted(chances)[-2] >= DOUBT:  # none alone, or it could be another as well
        return everyone, []
    text = f"{names[out]} ({each[out].value:.4g} {each[out].unit}) contradicts the others, which agree; it is left out"
    return rests[out], [Note("methods_disagree", text, f"check what {names[out]} rests on")]


def _widened(
    one: Measurement, chi2: float, freedom: int, names: Sequence[str], values: Array
) -> tuple[Measurement, list[Note]]:
    """The mean with its interval widened where what it is made of disagrees beyond chance."""
    if _chance(chi2, freedom) >= DOUBT or one.u is None:
        return one, []
    factor = math.sqrt(chi2 / freedom)
    low, high = (None if end is None else one.value + factor * (end - one.value) for end in (one.low, one.high))
    # the interval never leaves out what any of them says: which one is wrong is not known
    low = None if low is None else min(low, float(values.min()))
    high = None if high is None else max(high, float(values.max()))
    said = ", ".join(f"{name}: {value:.4g} {one.unit}" for name, value in zip(names, values, strict=True))
    text = f"the measurements contradict each other beyond their u ({said}); the interval is widened {factor:.2g} times"
    budget = tuple(dataclasses.replace(line, u=line.u * factor) for line in one.budget)
    wider = dataclasses.replace(
        one, u=one.u * factor, budget=budget, low=None if low is None else max(low, 0.0), high=high
    )
    return wider, [Note("methods_disagree", text, "check the assumptions of each; one of them does not hold")]


def _doubts(each: Sequence[Measurement], weights: Array) -> list[Note]:
    """The doubts of what counts, once."""
    return list(dict.fromkeys(note for m, w in zip(each, weights, strict=True) if w > 0 for note in m.notes))


def with_common_causes(inputs: Sequence[Any]) -> list[Any]:
    """The inputs of measurements from several documents, with what reads the same in a field of the same name made one.

    A quantity of a document has no identity beyond it: that two of the same value, u and source are the same cause (one marker's
    print, one assumed slope) is the safe reading, as a mean does not lessen it.
    """
    known: dict[tuple[str, str], Noun] = {}
    found = []
    for one in inputs:
        names = {id(noun): name for name, noun in fields_of(one).items() if isinstance(noun, Noun)}

        def shared(noun: Noun, names: Mapping[int, str] = names) -> Noun:
            if not isinstance(noun, Quantity):
                return noun
            return known.setdefault((names.get(id(noun), ""), noun.digest), noun)

        found.append(map_nouns(one, shared))
    return found
