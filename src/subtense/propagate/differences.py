"""First order: budgets and covariances by central differences, with a look at how far the response bends.

Source: JCGM 100:2008 (GUM), 5.1, 5.2, G.4, H.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from ..arrays import Array, Bools, Codes, Indices
from ..distribution import Distribution, normal_quantile, t_quantile
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
        quadratic: u and intervals from the quadratic response; None for rows.
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
    quadratic: Quadratic | None = None
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
    z, (i, j) = _offsets(m)
    values, reason = evaluate_at(model, space, z)
    y0, plus, minus = values[:, 0], values[:, 1 : m + 1], values[:, m + 1 : 2 * m + 1]
    s = (plus - minus) / 2
    hessian = np.zeros((len(values), m, m))
    np.einsum("oii->oi", hessian)[...] = plus + minus - 2 * values[:, :1]
    hessian[:, i, j] = hessian[:, j, i] = values[:, 2 * m + 1 :] - plus[:, i] - plus[:, j] + values[:, :1]
    if m > PAIRS_UP_TO:
        _fill_main_pairs(model, space, s, y0, plus, hessian)
    hessian[abs(hessian) < 1e-12 * abs(y0)[:, None, None]] = 0.0  # rounding, not response
    contributions = _by_line(space.lines, s)
    u = np.sqrt((s * s).sum(axis=1))
    u2 = np.sqrt(u * u + (hessian * hessian).sum(axis=(1, 2)) / 2)
    dof = effective_dof(u, contributions, np.array([line.dof for line in space.lines]))
    laws = tuple(law for line in space.lines for law in line.laws)
    quadratic = _quadratic(u, s, hessian, laws, level)
    return Propagated(model.names, tuple(line.name for line in space.lines), y0, u, _coverage_factors(level, dof), dof,
                      contributions, s @ s.T, u2, quadratic.bend, np.asarray(reason[0]), quadratic,
                      _own_curvature(space.lines, hessian, _moments(laws)[1]))  # fmt: skip


@lru_cache(maxsize=64)
def _offsets(m: int) -> tuple[Array, tuple[Indices, Indices]]:
    """(m, evaluations) standardised deviations: nominal, each variable up, each down, pairs up together; and the pairs.

    There are no pairs where the variables are more than PAIRS_UP_TO.
    """
    first, second = np.tril_indices(m if m <= PAIRS_UP_TO else 0, -1)
    one = np.eye(m)
    z = np.concatenate([np.zeros((m, 1)), one, -one, one[:, first] + one[:, second]], axis=1)
    z.flags.writeable = False
    return z, (first, second)


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
        count = line.count
        part = s[:, first : first + count]
        rows.append(part[:, 0] if count == 1 else np.sqrt((part * part).sum(axis=1)))
        first += count
    return np.array(rows).reshape(len(lines), len(s))


def _own_curvature(lines: Sequence[Line], hessian: Array, kurtosis: Array) -> Array:
    """(l, o) variance that the second differences within each line add to the first-order one.

    A variable z of kurtosis 3 + e has Var(h z^2 / 2) = h^2 (2 + e) / 4.
    """
    own = np.einsum("oii->io", hessian) ** 2 * ((2 + kurtosis) / 4)[:, None]
    rows, first = [], 0
    for line in lines:
        count = line.count
        row = own[first] if count == 1 else own[first : first + count].sum(axis=0)
        if count > 1:
            block = hessian[:, first : first + count, first : first + count]
            row = row + ((block * block).sum(axis=(1, 2)) - (np.einsum("oii->oi", block) ** 2).sum(axis=1)) / 2
        rows.append(row)
        first += count
    return np.array(rows).reshape(len(lines), len(hessian))


@lru_cache(maxsize=64)
def _moments(laws: tuple[Distribution, ...]) -> tuple[Array, Array, Array]:
    """(m,) mean and excess kurtosis of each variable, and whether its law is not symmetric about the mean.

    The kurtosis of t, which may not exist, is left out.
    """
    kurtosis = [0.0 if law.name == "t" else law.excess_kurtosis for law in laws]
    lopsided = [law.name == "either" for law in laws]
    found = np.array([law.mean for law in laws]), np.array(kurtosis), np.array(lopsided)
    for array in found:
        array.flags.writeable = False
    return found


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


def _coverage_factors(level: float, dof: Array) -> Array:
    """(o,) the same for each output."""
    if np.isinf(dof).all():
        return np.full(len(dof), normal_quantile(0.5 + level / 2))
    return np.array([_coverage_factor(level, d) for d in dof.tolist()])


@dataclass(frozen=True)
class Quadratic:
    """What the quadratic response says of the outputs.

    Attributes:
        u: (o,) standard deviation.
        low: (o,) lower interval limit, as offset from the nominal value.
        high: (o,) upper interval limit, likewise.
        bend: (o,) the largest distance of these limits from the first-order ones, in first-order u.
        curved: (o,) the same from those of a straight response of the same laws: what the second differences alone do.
        shift: (2, o) that they move the lower and the upper limit by.
        slopes: (o, m) of the standardised variables, at their means.
        offset: (o,) of the straight response with these slopes where all variables are 0.
        excess: (o,) kurtosis less 3, from the laws of the inputs.
        active: (o, m) whether a variable moves the output at all.
    """

    u: Array
    low: Array
    high: Array
    bend: Array
    curved: Array
    shift: Array
    slopes: Array
    offset: Array
    excess: Array
    active: Bools


def _quadratic(u: Array, s: Array, hessian: Array, laws: tuple[Distribution, ...], level: float) -> Quadratic:
    """Moments of the quadratic response, and its interval by Cornish and Fisher's expansion.

    A one-sided law has its mean beside the stated value: the response is expanded about the means, where laws are symmetric.

    Source: P. Hall, The Bootstrap and Edgeworth Expansion, 2.5.
    """
    means, kurtosis, lopsided = _moments(laws)
    bent = hessian.any(axis=1)
    active = (abs(s) > 1e-6 * u[:, None]) | bent
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        turned = hessian @ means
        slopes, offset = s + turned, -(turned @ means) / 2
        width = np.sqrt(1 - means**2)
        inner, curvature = slopes * width, hessian * np.outer(width, width)
        squared = curvature @ curvature
        straight, centre = (inner * inner).sum(axis=1), offset + slopes @ means
        variance = straight + squared.trace(0, 1, 2) / 2
        mean = centre + curvature.trace(0, 1, 2) / 2
        third = 3 * np.einsum("oi,oij,oj->o", inner, curvature, inner) + (squared * curvature).sum(axis=(1, 2))
        fourth = inner**4 @ kurtosis
        spread, excess = np.sqrt(variance), fourth / variance**2
        skew = third / (variance * spread)
        z = normal_quantile(0.5 + level / 2)
        low, high = (mean + spread * _cornish_fisher(x, skew, excess) for x in (-z, z))
        bend = np.maximum(abs(low + z * u), abs(high - z * u)) / u
        flat = np.sqrt(straight) * _cornish_fisher(z, 0.0, fourth / straight**2)
        shift = np.array([low - centre + flat, high - centre - flat])
        curved = np.where((abs(s) * lopsided > 0).any(axis=1), bend, abs(shift).max(axis=0) / u)
    known = np.isfinite(s).all(axis=1) & np.isfinite(bend) & (u > 0)
    if not known.all():
        still = (u == 0) & ~np.any(bent, axis=1)
        open_ = np.where(still, 0.0, np.inf)
        spread, low, high = (np.where(known, a, b) for a, b in ((spread, u), (low, -open_), (high, open_)))
        bend, curved, excess = (np.where(known, a, b) for a, b in ((bend, open_), (curved, open_), (excess, 0.0)))
    return Quadratic(spread, low, high, bend, curved, shift, slopes, offset, excess, active)


def _cornish_fisher(z: float, skew: Array | float, excess: Array) -> Array:
    """(o,) quantiles of standardised laws near the normal one."""
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
