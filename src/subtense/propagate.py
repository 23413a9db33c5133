"""The only file that calculates with sigma: budgets (GUM) and Monte Carlo (JCGM 101).

`measure` is what everything calls: it moves the inputs of a method by central differences, and draws where the
response bends so much that an interval end would be off by half a unit of the second significant digit of u
(JCGM 101, 8.2). `first_order` serves millions of rows; `sample` draws; `joint` gives several outputs of several
methods with their covariance, each shared noun moved once.

Sources: JCGM 100:2008 (GUM), 5.1, 5.2, G.4, H; JCGM 101:2008, 5 to 8.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from .distribution import Array, normal_quantile, t_quantile
from .errors import GeometryError, InputError
from .method import Method, Output, Reason
from .quantity import Contribution, Measurement, Note, Quantity
from .space import Correlations, Line, Moved, Space, map_nouns

CHUNK = 8192
"""Rows or draws evaluated at once: small enough for the caches of one core."""
BLOCK = 10_000
"""Draws of one block of the adaptive procedure (JCGM 101, 7.9.4)."""
FEWEST_BLOCKS = 10
"""Two blocks can agree by chance: their scatter says nothing yet."""
NEARLY_NORMAL = 0.4
"""Excess kurtosis up to which Cornish and Fisher's expansion is trusted: a uniform input may make half the variance."""
PAIRS_UP_TO = 24
"""Variables among which all mixed second differences are taken; beyond it only those that matter most."""

Function = Callable[..., Any]


@dataclass(frozen=True)
class Model:
    """A function with named outputs, of one or several inputs."""

    names: tuple[str, ...]
    call: Callable[[tuple[Any, ...]], tuple[Array, npt.NDArray[np.int8]]]
    most_draws: int = 1_000_000


@dataclass(frozen=True)
class Propagated:
    """First-order results; o outputs, l lines, then leading axes.

    Attributes:
        names: the outputs.
        lines: names of the budget lines.
        value: (o, ...) nominal values; NaN where there is no answer.
        u: (o, ...) standard deviations.
        low: (o, ...) lower interval limits.
        high: (o, ...) upper interval limits.
        dof: (o, ...) effective degrees of freedom (Welch-Satterthwaite).
        contributions: (l, o, ...) signed sensitivity times u, or the root of the summed squares of a block.
        cov: (o, o) covariance of the outputs; None for rows.
        u_second_order: (o,) u with the second-order terms of GUM 5.1.2 (quadratic response); None for rows.
        bend: (o, ...) how far an interval end is expected to be off, in u.
        reason: (...) codes of `Reason`.
        quadratic: u and interval of each output from the quadratic response; empty for rows.
    """

    names: tuple[str, ...]
    lines: tuple[str, ...]
    value: Array
    u: Array
    low: Array
    high: Array
    dof: Array
    contributions: Array
    cov: Array | None
    u_second_order: Array | None
    bend: Array
    reason: npt.NDArray[np.int8]
    quadratic: tuple[_Bent, ...] = ()


@dataclass(frozen=True)
class Draws:
    """Monte Carlo results.

    Attributes:
        names: the outputs.
        values: (o, n) draws, NaN where a draw has no answer.
        reason: (n,) codes of `Reason`.
        stable: whether the adaptive procedure reached its tolerance.
    """

    names: tuple[str, ...]
    values: Array
    reason: npt.NDArray[np.int8]
    stable: bool = True

    @property
    def mean(self) -> Array:
        """(o,) means of the draws that have an answer."""
        return np.asarray(np.nanmean(self.values, axis=1))

    @property
    def u(self) -> Array:
        """(o,) standard deviations."""
        return np.asarray(np.nanstd(self.values, axis=1, ddof=1))

    @property
    def cov(self) -> Array:
        """(o, o) covariance of the outputs, from the draws in which all have an answer."""
        return np.atleast_2d(np.cov(self.values[:, np.all(np.isfinite(self.values), axis=0)]))

    def interval(self, output: int = 0, level: float = 0.95) -> tuple[float, float]:
        """The probability-symmetric interval; an infinite end is open."""
        low, high = _sorted_ends(self.values[output], self.reason)
        n = len(low)
        k = min(max(round((1 - level) / 2 * n), 1), n)
        return float(low[k - 1]), float(high[n - k])

    def shortest(self, output: int = 0, level: float = 0.95) -> tuple[float, float]:
        """The shortest interval that holds `level` of the draws (JCGM 101, 5.3.4)."""
        values = np.sort(self.values[output][np.isfinite(self.values[output])])
        inside = math.ceil(level * self.values.shape[1])
        if inside > len(values):
            return -math.inf, math.inf
        width = values[inside - 1 :] - values[: len(values) - inside + 1]
        first = int(np.argmin(width))
        return float(values[first]), float(values[first + inside - 1])

    @property
    def unanswered(self) -> Array:
        """(o,) the share of draws without an answer."""
        return np.asarray(np.mean(~np.isfinite(self.values), axis=1))


def _sorted_ends(values: Array, reason: npt.NDArray[np.int8]) -> tuple[Array, Array]:
    """Sorted draws twice: for the lower and the upper limit, with those that have no answer where they do most harm."""
    lost = ~np.isfinite(values)
    if not lost.any():
        ordered = np.sort(values)
        return ordered, ordered
    far = np.isin(reason, [r for r in Reason if r.far])
    low = np.sort(np.where(lost, np.where(far, np.inf, -np.inf), values))
    return low, np.sort(np.where(lost, np.inf, values))


# -- models --------------------------------------------------------------------------------------------


def model_of(method: Method | Function, inputs: Any) -> Model:
    """The model of a method at these inputs, or of a plain function of arrays named like the quantities in `inputs`.

    A plain function returns one array, or a mapping of named ones; a row without an answer is NaN.
    """
    if isinstance(method, Method):
        return _method_model(method, inputs)

    def call(moved: tuple[Any, ...]) -> tuple[Array, npt.NDArray[np.int8]]:
        result = method(**{name: q.value for name, q in moved[0].items()})
        named = result if isinstance(result, Mapping) else {"result": result}
        values = np.stack(np.broadcast_arrays(*(np.asarray(v, float) for v in named.values())))
        return values, np.zeros(values.shape[1:], np.int8)

    first = method(**{name: q.value for name, q in inputs.items()})
    return Model(tuple(first) if isinstance(first, Mapping) else ("result",), call)


def _method_model(method: Method, inputs: Any) -> Model:
    start = (method.start(inputs),) if method.start else ()
    names = tuple(output.name for output in method.outputs)

    def call(moved: tuple[Any, ...]) -> tuple[Array, npt.NDArray[np.int8]]:
        result = method.function(moved[0], *start)
        reason = np.asarray(result.reason)
        values = [np.broadcast_to(np.asarray(getattr(result, n), float), reason.shape) for n in names]
        return np.where(reason == 0, np.stack(values), np.nan), reason

    return Model(names, call, method.most_draws)


# -- first order -----------------------------------------------------------------------------------------


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
        return _rows_by_differences(model, space, level)
    return _scene(model, space, level)


def _scene(model: Model, space: Space, level: float) -> Propagated:
    """One scene: every shifted evaluation in one call, mixed second differences included."""
    m = sum(line.count for line in space.lines)
    pairs = [(i, j) for i in range(m) for j in range(i)] if m <= PAIRS_UP_TO else []
    values, reason = _evaluate_at(model, space, _offsets(m, pairs))
    y0, plus, minus = values[:, 0], values[:, 1 : m + 1], values[:, m + 1 : 2 * m + 1]
    s = (plus - minus) / 2
    hessian = _hessian(values, pairs, m)
    if m > PAIRS_UP_TO:
        _fill_main_pairs(model, space, s, y0, plus, hessian)
    hessian[abs(hessian) < 1e-12 * abs(y0)[:, None, None]] = 0.0  # rounding, not response
    contributions = _by_line(space.lines, s)
    u = np.sqrt(np.sum(s**2, axis=1))
    u2 = np.sqrt(u**2 + np.sum(hessian**2, axis=(1, 2)) / 2)
    dof = _effective_dof(u, contributions, np.array([line.dof for line in space.lines]))
    k = np.array([_coverage_factor(level, float(d)) for d in dof])
    bent = [_quadratic(s[o], hessian[o], space.lines, level) for o in range(len(u))]
    return Propagated(model.names, tuple(line.name for line in space.lines), y0, u, y0 - k * u, y0 + k * u, dof,
                      contributions, s @ s.T, u2, np.array([b.bend for b in bent]), np.asarray(reason[0]),
                      tuple(bent))  # fmt: skip


def _offsets(m: int, pairs: Sequence[tuple[int, int]]) -> Array:
    """(m, evaluations) standardised deviations: nominal, each variable up, each down, pairs up together."""
    z = np.zeros((m, 1 + 2 * m + len(pairs)))
    index = np.arange(m)
    z[index, 1 + index] = 1.0
    z[index, 1 + m + index] = -1.0
    for column, (i, j) in enumerate(pairs, 1 + 2 * m):
        z[[i, j], column] = 1.0
    return z


def _evaluate_at(model: Model, space: Space, z: Array) -> tuple[Array, npt.NDArray[np.int8]]:
    """Outputs (o, n) at standardised deviations z (m, n)."""
    if not space.lines:
        values, reason = model.call(space.inputs)
        return np.repeat(values[:, None], z.shape[1], axis=1), np.repeat(np.asarray(reason)[None], z.shape[1])
    moved: Moved = {}
    first = 0
    for line in space.lines:
        line.put(line.at(z[first : first + line.count]), moved)
        first += line.count
    return model.call(space.rebuilt(moved))


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
    values, _ = _evaluate_at(model, space, z)
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


def _effective_dof(u: Array, contributions: Array, dof: Array) -> Array:
    """Welch-Satterthwaite (GUM G.4.1), per output."""
    if not np.any(np.isfinite(dof)):
        return np.full(u.shape, np.inf)
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


# -- rows --------------------------------------------------------------------------------------------------


def _rows_by_differences(model: Model, space: Space, level: float) -> Propagated:
    """Many rows: each line moved on its own, so that what does not move is computed once."""
    y0, reason = model.call(space.inputs)
    lead = y0.shape[1:]
    variance, shift, kurtosis = np.zeros_like(y0), np.zeros_like(y0), np.zeros_like(y0)
    contributions = np.zeros((len(space.lines), *y0.shape))
    for row, line in enumerate(space.lines):
        squared = np.zeros_like(y0)
        signed = np.zeros_like(y0)
        for j, law in enumerate(line.laws):
            up, down = (_moved_line(model, space, line, sign * line.shift(j), lead) for sign in (1.0, -1.0))
            signed = (up - down) / 2
            squared += signed**2
            shift += (up + down) / 2 - y0 + signed * law.mean
            kurtosis += signed**4 * (0.0 if law.name == "t" else law.excess_kurtosis)
        contributions[row] = signed if line.count == 1 else np.sqrt(squared)
        variance += squared
    u = np.sqrt(variance)
    dof = _effective_dof(u, contributions, np.array([line.dof for line in space.lines]))
    z = normal_quantile(0.5 + level / 2)
    k = np.vectorize(lambda d: _coverage_factor(level, d))(dof) if np.any(np.isfinite(dof)) else np.float64(z)
    with np.errstate(divide="ignore", invalid="ignore"):
        bend = abs(shift) / u * (1 + (z * z - 1)) + abs(kurtosis) / variance**2 * abs(z**3 - 3 * z) / 24
    bend = np.where((u == 0) & (shift == 0), 0.0, bend)
    return Propagated(model.names, tuple(line.name for line in space.lines), y0, u, y0 - k * u, y0 + k * u, dof,
                      contributions, None, None, bend, reason)  # fmt: skip


def _moved_line(model: Model, space: Space, line: Line, change: Array, lead: tuple[int, ...]) -> Array:
    moved: Moved = {}
    line.put(line.value + change, moved)
    return np.broadcast_to(model.call(space.rebuilt(moved))[0], (len(model.names), *lead))


def rows(
    method: Method, inputs: Any, *, level: float = 0.95, chunk: int = 2 * CHUNK, threads: int | None = None
) -> Propagated:
    """`first_order` for nouns with one long leading axis, chunk by chunk and on all cores.

    Where the method gives its own derivative for these inputs, it is used in place of differences; `bend` is then NaN.
    """
    leading = Space((inputs,)).leading
    if len(leading) != 1:
        raise InputError("inputs", f"with leading axes {leading}", "give one leading axis, the rows")
    n = leading[0]
    cuts = [slice(a, min(a + chunk, n)) for a in range(0, n, chunk)]
    first = _rows_of(method, map_nouns(inputs, lambda noun: noun.rows(cuts[0])), level)
    kept = {name: getattr(first, name) for name in ("value", "u", "low", "high", "dof", "contributions", "bend", "reason")}
    whole = {name: np.empty((*a.shape[:-1], n), a.dtype) for name, a in kept.items()}

    def work(cut: slice) -> None:
        part = _rows_of(method, map_nouns(inputs, lambda noun: noun.rows(cut)), level)
        for name, array in whole.items():
            array[..., cut] = getattr(part, name)

    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(work, cuts))
    return Propagated(first.names, first.lines, **whole, cov=None, u_second_order=None)


def _rows_of(method: Method, inputs: Any, level: float) -> Propagated:
    space = Space((inputs,))
    if method.derivative is not None and all(math.isinf(line.dof) for line in space.lines):
        result = method.function(inputs)
        partials = method.derivative(inputs, result)
        if partials is not None:
            return _rows_by_derivative(method, space, result, partials, level)
    return _rows_by_differences(model_of(method, inputs), space, level)


def _rows_by_derivative(
    method: Method, space: Space, result: Any, partials: Mapping[str, Mapping[tuple[str, str], Array]], level: float
) -> Propagated:
    """Rows whose method told its own partial derivatives."""
    reason = np.asarray(result.reason)
    names = tuple(output.name for output in method.outputs)
    value = np.stack([np.broadcast_to(getattr(result, n), reason.shape) for n in names])
    fields = {noun.identity: name for name, noun in _fields(space.inputs[0])}
    contributions = np.empty((len(space.lines), *value.shape))
    for row, line in enumerate(space.lines):
        identity, key, _ = line.members[0]
        for o, name in enumerate(names):
            contributions[row, o] = _line_effect(line, partials[name][fields[identity], key])
    u = np.sqrt(np.sum(contributions**2, axis=0))
    k = normal_quantile(0.5 + level / 2)
    dof = np.broadcast_to(np.inf, value.shape)
    return Propagated(names, tuple(line.name for line in space.lines), value, u, value - k * u, value + k * u, dof,
                      contributions, None, None, np.broadcast_to(np.nan, value.shape), reason)  # fmt: skip


def _fields(inputs: Any) -> list[tuple[str, Any]]:
    return [(name, value) for name, value in vars(inputs).items() if hasattr(value, "identity")]


def _line_effect(line: Line, partial: Array) -> Array:
    """Contribution of one line: partial derivatives (k, ...) through its factor or its u."""
    if line.factor is not None:
        effect = np.tensordot(line.factor, partial, axes=(0, 0))
    else:
        assert line.u is not None
        effect = partial * line.u.reshape(*line.u.shape, *(1,) * (partial.ndim - line.u.ndim))
    return np.asarray(effect[0] if len(effect) == 1 else np.sqrt(np.einsum("i...,i...->...", effect, effect)))


# -- Monte Carlo -------------------------------------------------------------------------------------------


def sample(
    method: Method | Function, inputs: Any, draws: int, *, seed: int = 0, correlations: Correlations | None = None
) -> Draws:
    """A fixed number of draws of one scene."""
    space = Space((inputs,), correlations)
    return _sample(model_of(method, inputs), space, draws, np.random.default_rng(seed))


def _sample(model: Model, space: Space, draws: int, rng: np.random.Generator) -> Draws:
    values = np.empty((len(model.names), draws))
    reason = np.empty(draws, np.int8)
    for first in range(0, draws, CHUNK):
        cut = slice(first, min(first + CHUNK, draws))
        moved: Moved = {}
        for line in space.lines:
            line.put(line.draw(rng, cut.stop - first), moved)
        values[:, cut], reason[cut] = model.call(space.rebuilt(moved))
    return Draws(model.names, values, reason)


def monte_carlo(
    method: Method | Function, inputs: Any, *, draws: int | None = None, seed: int = 0, level: float = 0.95,
    correlations: Correlations | None = None,
) -> Draws:  # fmt: skip
    """Draws of one scene: `draws` of them, or by the adaptive procedure of JCGM 101, 7.9, with two significant digits."""
    if draws is not None:
        return sample(method, inputs, draws, seed=seed, correlations=correlations)
    space = Space((inputs,), correlations)
    return _adaptive(model_of(method, inputs), space, level, seed)


def _adaptive(model: Model, space: Space, level: float, seed: int, wanted: Sequence[int] | None = None) -> Draws:
    """Blocks of draws until the statistics of the wanted outputs (all by default) are steady."""
    outputs = list(range(len(model.names)) if wanted is None else wanted)
    rng = np.random.default_rng(seed)
    blocks: list[Draws] = []
    statistics: list[Array] = []
    while True:
        block = _sample(model, space, BLOCK, rng)
        blocks.append(block)
        ends = np.array([block.interval(o, level) for o in outputs])
        chosen = Draws(block.names, block.values[outputs], block.reason)
        statistics.append(np.stack([chosen.mean, chosen.u, ends[:, 0], ends[:, 1]]))
        stable = len(blocks) >= FEWEST_BLOCKS and _steady(np.stack(statistics))
        if stable or len(blocks) * BLOCK >= model.most_draws:
            values = np.concatenate([b.values for b in blocks], axis=1)
            return Draws(model.names, values, np.concatenate([b.reason for b in blocks]), stable)


def _steady(statistics: Array) -> bool:
    """Whether twice the standard deviation of each averaged statistic is below the tolerance; (blocks, 4, o)."""
    spread = 2 * np.std(np.where(np.isfinite(statistics), statistics, 0.0), axis=0, ddof=1) / math.sqrt(len(statistics))
    tolerance = np.array([_tolerance(float(u)) for u in np.mean(statistics[:, 1], axis=0)])
    return bool(np.all(spread <= tolerance))


def _tolerance(u: float) -> float:
    """Half a unit of the second significant digit of u (JCGM 101, 7.9.2)."""
    if not (u > 0 and math.isfinite(u)):
        return math.inf
    return 0.05 * 10 ** math.floor(math.log10(u) + 1e-12)


# -- one measurement ---------------------------------------------------------------------------------------


def measure(
    method: Method, inputs: Any, *, level: float = 0.95, seed: int = 0, label: str = "",
    given: Mapping[str, Any] | None = None,
) -> tuple[Measurement, ...]:  # fmt: skip
    """The outputs of a method as measurements, headline first.

    Raises:
        GeometryError: this view has no finite answer.
    """
    if not 0.5 <= level < 1:
        raise InputError("level", level, "give a coverage from 0.5 to below 1, as 0.95")
    inputs = method.prepare(inputs)
    space = Space((inputs,))
    if space.leading:
        raise InputError("inputs", f"with leading axes {space.leading}", "one scene at a time; use rows() for many")
    model = model_of(method, inputs)
    nominal = _scene(model, space, level)
    if nominal.reason:
        reason = Reason(int(nominal.reason))
        raise GeometryError(reason.text, code=reason.name.lower())
    result = method.function(inputs, *((method.start(inputs),) if method.start else ()))
    notes = method.notes(inputs, result)
    answers = [_without_draws(model, space, nominal, o, level) for o in range(len(method.outputs))]
    bent = [o for o, answer in enumerate(answers) if answer is None]
    draws = _adaptive(model, space, level, seed, bent) if bent else None
    found = []
    for o, output in enumerate(method.outputs):
        answer = answers[o]
        if answer is None:
            assert draws is not None
            answer = _drawn(draws, o, level, output)
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


def _without_draws(model: Model, space: Space, nominal: Propagated, o: int, level: float) -> _Answer | None:
    """The answer of the cheapest evaluation that keeps the tolerance of JCGM 101, 8.2; None where draws are needed."""
    u, bend = float(nominal.u[o]), float(nominal.bend[o])
    tolerance = _tolerance(u) / u if u > 0 else 0.0
    if bend <= tolerance:
        return _Answer(u, float(nominal.low[o]), float(nominal.high[o]))
    quadratic, value = nominal.quadratic[o], float(nominal.value[o])
    if len(quadratic.active) == 1:
        mapped = _mapped(model, space, o, quadratic.active[0], level)
        if mapped:
            return mapped
    # what the quadratic response leaves out is of the next order, and the expansion is for nearly normal sums
    if bend**2 <= tolerance and abs(quadratic.excess) < NEARLY_NORMAL and math.isinf(float(nominal.dof[o])):
        return _Answer(quadratic.u, value + quadratic.low, value + quadratic.high, "second order")
    return None


def _mapped(model: Model, space: Space, output: int, variable: int, level: float) -> _Answer | None:
    """The interval of the single uncertain input taken through a monotone response; None where it is not monotone."""
    laws = [law for line in space.lines for law in line.laws]

    def through(shares: Array) -> Array:
        z = np.zeros((len(laws), len(shares)))
        z[variable] = [laws[variable].quantile(float(share)) for share in shares]
        return _evaluate_at(model, space, z)[0][output]

    values = through(np.linspace((1 - level) / 2, (1 + level) / 2, 33))
    step = np.diff(values)
    if not np.all(np.isfinite(values)) or not (np.all(step > 0) or np.all(step < 0)):
        return None
    spread = through(np.linspace(0.0005, 0.9995, 1000))
    u = float(np.std(spread)) if np.all(np.isfinite(spread)) else None
    return _Answer(u, float(values.min()), float(values.max()), "mapped through the one uncertain input")


def _drawn(draws: Draws, o: int, level: float, output: Output) -> _Answer:
    low, high = draws.interval(o, level)
    lost = float(draws.unanswered[o])
    evaluation = f"Monte Carlo, {draws.values.shape[1]} draws"
    notes: list[Note] = []
    u: float | None = float(draws.u[o])
    cure = "make the pixel extent larger or better known: come closer, use a longer lens or a larger object"
    if math.isinf(low) or math.isinf(high):
        notes.append(_open_note(low, high, lost, output.unit, cure))
        u = None
    elif lost:
        text = f"{lost:.1%} of the draws have no answer; they count as beyond the interval".replace("%", " %")
        notes.append(Note("draws_without_answer", text, cure))
    if u is not None and not draws.stable and _heavy(draws.values[o]):
        notes.append(Note("heavy_tail", "the far tail is so long that a standard deviation has no meaning; "
                          "use the interval", cure))  # fmt: skip
        u = None
    return _Answer(u, low, high, evaluation, tuple(notes))


def _open_note(low: float, high: float, lost: float, unit: str, cure: str) -> Note:
    share = f"{lost:.0%} of the draws have no answer".replace("%", " %")
    if math.isinf(low) and math.isinf(high):
        return Note("open_interval", f"both limits are open, {share}", cure)
    if math.isinf(high):
        return Note("open_interval", f"from {low:.3g} {unit}, far limit open, {share}", cure)
    return Note("open_interval", f"up to {high:.3g} {unit}, near limit open, {share}", cure)


def _heavy(values: Array) -> bool:
    """Whether the standard deviations of ten parts of the draws scatter by more than a tenth."""
    parts = np.array([np.nanstd(part) for part in np.array_split(values, 10)])
    return bool(np.std(parts) > 0.1 * np.mean(parts))


def _measurement(
    method: Method, output: Output, nominal: Propagated, o: int, answer: _Answer, space: Space, level: float,
    label: str, notes: tuple[Note, ...], given: Mapping[str, Any],
) -> Measurement:  # fmt: skip
    def limit(x: float) -> float | None:
        return x if math.isfinite(x) else None

    budget = _budget(space.lines, nominal.contributions[:, o], answer.u)
    return Measurement(
        output.what, float(nominal.value[o]), answer.u, limit(answer.low), limit(answer.high), output.unit,
        method.name, level, label, answer.evaluation, budget, notes + answer.notes, given=given,
    )  # fmt: skip


def _budget(lines: Sequence[Line], contributions: Array, u: float | None) -> tuple[Contribution, ...]:
    """Lines with their shares, largest first; `interaction` takes what draws have beyond first order."""
    squared = contributions**2
    first_order_variance = float(np.sum(squared))
    total = max(u**2 if u is not None else 0.0, first_order_variance)
    if not total > 0:
        return ()
    found = [
        Contribution(line.name, line.source, float(c), float(q / total))
        for line, c, q in zip(lines, contributions, squared, strict=True)
        if q > 0
    ]
    rest = total - first_order_variance
    if rest > 1e-9 * total:
        found.append(Contribution("interaction", "what draws have beyond first order", math.sqrt(rest), rest / total))
    return tuple(sorted(found, key=lambda c: -c.share))


# -- several methods ---------------------------------------------------------------------------------------


def joint(
    pairs: Sequence[tuple[Method, Any]], *, draws: int = 100_000, seed: int = 0
) -> tuple[Propagated, Draws]:
    """Several measurements of one scene, each shared noun moved once.

    Returns:
        The first-order result, whose `cov` is the covariance of all outputs of all methods in order, and joint draws.
    """
    space = Space([inputs for _, inputs in pairs])
    models = [model_of(method, inputs) for method, inputs in pairs]

    def call(moved: tuple[Any, ...]) -> tuple[Array, npt.NDArray[np.int8]]:
        results = [model.call((one,)) for model, one in zip(models, moved, strict=True)]
        shape = np.broadcast_shapes(*(reason.shape for _, reason in results))
        values = np.concatenate([np.broadcast_to(v, (len(v), *shape)) for v, _ in results])
        worst = np.max(np.stack([np.broadcast_to(reason, shape) for _, reason in results]), axis=0)
        return values, worst

    names = tuple(f"{i}.{name}" for i, model in enumerate(models, 1) for name in model.names)
    model = Model(names, call)
    return _scene(model, space, 0.95), _sample(model, space, draws, np.random.default_rng(seed))


def mean_of(readings: Sequence[float], unit: str = "1", source: str = "mean of readings") -> Quantity:
    """The mean of repeated readings as a t-distributed quantity (GUM 4.2)."""
    values = np.asarray(readings, float)
    if values.size < 2:
        raise InputError("readings", f"{values.size} of them", "give two or more, or one value with its ±")
    u = float(np.std(values, ddof=1) / math.sqrt(values.size))
    return Quantity.student_t(float(values.mean()), u, values.size - 1, unit, source)
