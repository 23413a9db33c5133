"""First order: budgets and covariances by central differences, with a look at how far the response bends.

Source: JCGM 100:2008 (GUM), 5.1, 5.2, G.4, H.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import Array, Codes
from ..distribution import normal_quantile, t_quantile
from ..method import Method
from ..space import Correlations, Line, Moved, Space
from .model import Function, Model, evaluate_at, model_of

PAIRS_UP_TO = 24
"""Variables among which all mixed second differences are taken; beyond it only those that matter most."""


@dataclass(frozen=True)
class Propagated:
    """First-order results; o outputs, l lines, then leading axes.

    Attributes:
        names: the outputs.
        lines: names of the budget lines.
        value: (o, ...) nominal values; NaN where there is no answer.
        u: (o, ...) standard deviations.
        coverage: (o, ...) coverage factor: the interval is value -+ coverage * u.
        dof: (o, ...) effective degrees of freedom (Welch-Satterthwaite).
        contributions: (l, o, ...) signed sensitivity times u, or the root of the summed squares of a block.
        cov: (o, o) covariance of the outputs; None for rows.
        u_second_order: (o,) u with the second-order terms of GUM 5.1.2 (quadratic response); None for rows.
        bend: (o, ...) how far an interval end is expected to be off, in u.
        reason: (...) codes of `Reason`.
        quadratic: u and interval of each output from the quadratic response; empty for rows.
        curvature: (l, o) variance that each line's own second differences add; None for rows.
    """

    names: tuple[str, ...]
    lines: tuple[str, ...]
    value: Array
    u: Array
    coverage: Array
    dof: Array
    contributions: Array
    cov: Array | None
    u_second_order: Array | None
    bend: Array
    reason: Codes
    quadratic: tuple[_Bent, ...] = ()
    curvature: Array | None = None

    @property
    def low(self) -> Array:
        """(o, ...) lower interval limits."""
        return np.asarray(self.value - self.coverage * self.u)

    @property
    def high(self) -> Array:
        """(o, ...) upper interval limits."""
        return np.asarray(self.value + self.coverage * self.u)


def first_order(
    method: Method | Function, inputs: Any, *, level: float = 0.95, correlations: Correlations | None = None
) -> Propagated:
    """Propagate by central differences of one standard deviation.

    Args:
        method: a Method and its Inputs, or a plain function and a mapping of quantities named like its arguments.
        inputs: nouns with or without leading axes.
        level: coverage of the interval.
        correlations: between named quantities, {("V", "I"): -0.36}.
    """
    space = Space((inputs,), correlations)
    model = model_of(method, inputs)
    if space.leading:
        return rows_by_differences(model, space, level)
    return scene(model, space, level)


def scene(model: Model, space: Space, level: float) -> Propagated:
    """One scene: every shifted evaluation in one call, mixed second differences included."""
    m = sum(line.count for line in space.lines)
    pairs = [(i, j) for i in range(m) for j in range(i)] if m <= PAIRS_UP_TO else []
    values, reason = evaluate_at(model, space, _offsets(m, pairs))
    y0, plus, minus = values[:, 0], values[:, 1 : m + 1], values[:, m + 1 : 2 * m + 1]
    s = (plus - minus) / 2
    hessian = _hessian(values, pairs, m)
    if m > PAIRS_UP_TO:
        _fill_main_pairs(model, space, s, y0, plus, hessian)
    hessian[abs(hessian) < 1e-12 * abs(y0)[:, None, None]] = 0.0  # rounding, not response
    contributions = _by_line(space.lines, s)
    u = np.sqrt(np.sum(s**2, axis=1))
    u2 = np.sqrt(u**2 + np.sum(hessian**2, axis=(1, 2)) / 2)
    dof = effective_dof(u, contributions, np.array([line.dof for line in space.lines]))
    k = np.array([_coverage_factor(level, float(d)) for d in dof])
    bent = [_quadratic(s[o], hessian[o], space.lines, level) for o in range(len(u))]
    return Propagated(model.names, tuple(line.name for line in space.lines), y0, u, k, dof,
                      contributions, s @ s.T, u2, np.array([b.bend for b in bent]), np.asarray(reason[0]),
                      tuple(bent), _own_curvature(space.lines, hessian))  # fmt: skip


def _offsets(m: int, pairs: Sequence[tuple[int, int]]) -> Array:
    """(m, evaluations) standardised deviations: nominal, each variable up, each down, pairs up together."""
    z = np.zeros((m, 1 + 2 * m + len(pairs)))
    index = np.arange(m)
    z[index, 1 + index] = 1.0
    z[index, 1 + m + index] = -1.0
    for column, (i, j) in enumerate(pairs, 1 + 2 * m):
        z[[i, j], column] = 1.0
    return z


def _hessian(values: Array, pairs: Sequence[tuple[int, int]], m: int) -> Array:
    """(o, m, m) second differences; mixed ones where there are pairs."""
    y0, plus, minus = values[:, :1], values[:, 1 : m + 1], values[:, m + 1 : 2 * m + 1]
    hessian = np.zeros((len(values), m, m))
    index = np.arange(m)
    hessian[:, index, index] = plus + minus - 2 * y0
    for column, (i, j) in enumerate(pairs, 1 + 2 * m):
        mixed = values[:, column] - plus[:, i] - plus[:, j] + y0[:, 0]
        hessian[:, i, j] = hessian[:, j, i] = mixed
    return hessian


def _fill_main_pairs(model: Model, space: Space, s: Array, y0: Array, plus: Array, hessian: Array) -> None:
    """Mixed second differences among the variables that matter most, where there are too many for all."""
    share = np.nan_to_num(s**2 / np.maximum(np.sum(s**2, axis=1, keepdims=True), 1e-300)).max(axis=0)
    main = np.argsort(share)[-12:]
    pairs = [(int(i), int(j)) for a, i in enumerate(main) for j in main[:a]]
    z = np.zeros((s.shape[1], len(pairs)))
    for column, (i, j) in enumerate(pairs):
        z[[i, j], column] = 1.0
    values, _ = evaluate_at(model, space, z)
    for column, (i, j) in enumerate(pairs):
        hessian[:, i, j] = hessian[:, j, i] = values[:, column] - plus[:, i] - plus[:, j] + y0


def _by_line(lines: Sequence[Line], s: Array) -> Array:
    """(l, o) contributions: signed for a line of one variable, else the root of the summed squares."""
    rows, first = [], 0
    for line in lines:
        part = s[:, first : first + line.count]
        rows.append(part[:, 0] if line.count == 1 else np.sqrt(np.sum(part**2, axis=1)))
        first += line.count
    return np.array(rows).reshape(len(lines), len(s))


def _own_curvature(lines: Sequence[Line], hessian: Array) -> Array:
    """(l, o) variance that the second differences within each line add to the first-order one.

    A variable z of kurtosis 3 + e has Var(h z^2 / 2) = h^2 (2 + e) / 4.
    """
    rows, first = [], 0
    for line in lines:
        block = hessian[:, first : first + line.count, first : first + line.count]
        excess = np.array([0.0 if law.name == "t" else law.excess_kurtosis for law in line.laws])
        own = np.einsum("oii->oi", block) ** 2 @ (2 + excess) / 4
        mixed = (np.sum(block**2, axis=(1, 2)) - np.sum(np.einsum("oii->oi", block) ** 2, axis=1)) / 2
        rows.append(own + mixed)
        first += line.count
    return np.array(rows).reshape(len(lines), len(hessian))


def effective_dof(u: Array, contributions: Array, dof: Array) -> Array:
    """Welch-Satterthwaite (GUM G.4.1), per output."""
    if not np.any(np.isfinite(dof)):
        return np.broadcast_to(np.inf, u.shape)
    finite = np.isfinite(dof).reshape(-1, *(1,) * u.ndim)
    with np.errstate(divide="ignore", invalid="ignore"):
        weight = np.sum(np.where(finite, contributions**4 / dof.reshape(finite.shape), 0.0), axis=0)
        return np.asarray(np.where(weight > 0, u**4 / weight, np.inf))


def _coverage_factor(level: float, dof: float) -> float:
    """t of the truncated degrees of freedom (GUM G.4.1, note 1)."""
    whole = max(math.floor(dof + 1e-9), 1) if math.isfinite(dof) else dof
    return t_quantile(0.5 + level / 2, whole)


@dataclass(frozen=True)
class _Bent:
    """What the quadratic response says of one output.

    Attributes:
        u: standard deviation.
        low: lower interval limit, as offset from the nominal value.
        high: upper interval limit, likewise.
        bend: the largest distance of these limits from the first-order ones, in first-order u.
        excess: kurtosis less 3, from the laws of the inputs.
        active: the variables that move the output at all.
    """

    u: float
    low: float
    high: float
    bend: float
    excess: float = 0.0
    active: tuple[int, ...] = ()


def _quadratic(s: Array, hessian: Array, lines: Sequence[Line], level: float) -> _Bent:
    """Moments of the quadratic response, and its interval by Cornish and Fisher's expansion.

    Source: P. Hall, The Bootstrap and Edgeworth Expansion, 2.5.
    """
    u = float(np.sqrt(np.sum(s**2)))
    active = tuple(int(i) for i in np.flatnonzero((abs(s) > 1e-6 * u) | np.any(hessian, axis=0)))
    if not np.all(np.isfinite(s)) or not np.all(np.isfinite(hessian)) or (u == 0 and np.any(hessian)):
        return _Bent(u, -math.inf, math.inf, math.inf, active=active)
    if u == 0:
        return _Bent(0.0, 0.0, 0.0, 0.0)
    laws = [law for line in lines for law in line.laws]
    means = np.array([law.mean for law in laws])
    kurtosis = np.array([0.0 if law.name == "t" else law.excess_kurtosis for law in laws])
    centred = s**2 * (1 - means**2)
    mean = float(np.trace(hessian)) / 2 + float(s @ means)
    variance = float(np.sum(centred) + np.sum(hessian**2) / 2)
    skew = float(3 * s @ hessian @ s + np.trace(hessian @ hessian @ hessian)) / variance**1.5
    excess = float(np.sum(centred**2 * kurtosis)) / variance**2
    z = normal_quantile(0.5 + level / 2)
    spread = math.sqrt(variance)
    low, high = (mean + spread * _cornish_fisher(x, skew, excess) for x in (-z, z))
    return _Bent(spread, low, high, max(abs(low + z * u), abs(high - z * u)) / u, excess, active)


def _cornish_fisher(z: float, skew: float, excess: float) -> float:
    """Quantile of a standardised law near the normal one."""
    return z + (z * z - 1) * skew / 6 + (z**3 - 3 * z) * excess / 24 - (2 * z**3 - 5 * z) * skew**2 / 36


def rows_by_differences(model: Model, space: Space, level: float) -> Propagated:
    """Many rows: each variable moved on its own, so that what does not move is computed once.

    The bend is that of each variable's own second difference and kurtosis; mixed differences are left out.
    """
    y0, reason = model.call(space.inputs)
    variance, shift, fourth = np.zeros_like(y0), np.zeros_like(y0), np.zeros(())
    contributions = np.zeros((len(space.lines), *y0.shape))
    for effect, line in zip(contributions, space.lines, strict=True):
        own = () if line.u is None else line.u.shape
        numbers = np.array(np.broadcast_to(line.value, np.broadcast_shapes(line.value.shape, own)))  # room to move in
        for j, law in enumerate(line.laws):
            up, down = (_moved_line(model, space, line, j, sign, numbers, y0.shape) for sign in (1.0, -1.0))
            shift += up
            shift += down
            shift -= 2 * y0
            up -= down  # twice the contribution
            if law.mean:
                shift += law.mean * up
            if law.excess_kurtosis and law.name != "t":
                fourth = fourth + np.square(np.square(up)) * (law.excess_kurtosis / 16)
            if line.count == 1:
                np.multiply(up, 0.5, out=effect)
            up *= up
            variance += up
            if line.count > 1:
                effect += up
        if line.count > 1:
            effect *= 0.25
            np.sqrt(effect, out=effect)
    variance *= 0.25
    shift *= 0.5
    return _rows(model, space, y0, reason, contributions, variance, shift, fourth, level)


def _rows(
    model: Model, space: Space, y0: Array, reason: Codes, contributions: Array, variance: Array,
    shift: Array, fourth: Array, level: float,
) -> Propagated:  # fmt: skip
    """Rows from their variance, mean shift and fourth cumulant."""
    u = np.sqrt(variance)
    dof = effective_dof(u, contributions, np.array([line.dof for line in space.lines]))
    z = normal_quantile(0.5 + level / 2)
    k = np.vectorize(lambda d: _coverage_factor(level, d))(dof) if np.any(np.isfinite(dof)) else np.float64(z)
    still = (u == 0) & (shift == 0) if np.min(u, initial=1.0) == 0 else None
    with np.errstate(divide="ignore", invalid="ignore"):
        bend = np.abs(shift, out=shift)
        bend /= u
        bend *= z * z
        if fourth.ndim:
            bend += abs(fourth) / variance**2 * (abs(z**3 - 3 * z) / 24)
    if still is not None:
        bend[still] = 0.0
    return Propagated(model.names, tuple(line.name for line in space.lines), y0, u, np.broadcast_to(k, u.shape), dof,
                      contributions, None, None, bend, reason)  # fmt: skip


def _moved_line(
    model: Model, space: Space, line: Line, j: int, sign: float, numbers: Array, shape: tuple[int, ...]
) -> Array:
    """Outputs with variable j of a line moved, writable and of the rows' shape; `numbers` is left as it was."""
    if line.u is None:
        moved_numbers = numbers + sign * line.shift(j)
    else:
        moved_numbers = numbers
        numbers[j] += sign * line.u[j]
    moved: Moved = {}
    line.put(moved_numbers, moved)
    values, _ = model.call(space.rebuilt(moved))
    if line.u is not None:
        numbers[j] = line.value[j]
    return values if values.shape == shape else np.broadcast_to(values, shape).copy()


def tolerance(u: float, digits: int = 2) -> float:
    """Half a unit of the last significant digit of u (JCGM 101, 7.9.2)."""
    if not (u > 0 and math.isfinite(u)):
        return math.inf
    return float(5.0 * 10.0 ** (math.floor(math.log10(u) + 1e-12) - digits))
