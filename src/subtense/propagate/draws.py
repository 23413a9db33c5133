"""Monte Carlo: draws of a scene, as many as the adaptive procedure wants.

Source: JCGM 101:2008, 5 to 8.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ..arrays import Array, Bools, Codes
from ..method import Method, Reason
from ..space import Correlations, Moved, Space
from .differences import tolerance
from .model import Function, Model, evaluate, model_of

CHUNK = 8192
"""Draws evaluated at once: small enough for the caches of one core."""
BLOCK = 10_000
"""Draws of one block of the adaptive procedure (JCGM 101, 7.9.4)."""
FEWEST_BLOCKS = 10
"""Two blocks can agree by chance: their scatter says nothing yet."""


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
    reason: Codes
    stable: bool = True

    @property
    def mean(self) -> Array:
        """(o,) means of the draws that have an answer."""
        return np.asarray(np.nanmean(self.values, axis=1) if self.lost.any() else self.values.mean(axis=1))

    @cached_property
    def u(self) -> Array:
        """(o,) standard deviations."""
        deviation = np.nanstd if self.lost.any() else np.std
        return np.asarray(deviation(self.values, axis=1, ddof=1))

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

    @cached_property
    def unanswered(self) -> Array:
        """(o,) the share of draws without an answer."""
        return np.asarray(np.mean(self.lost, axis=1))

    @cached_property
    def lost(self) -> Bools:
        """(o, n) whether a draw has no answer."""
        return np.asarray(~np.isfinite(self.values))

    def of(self, outputs: Sequence[int]) -> Draws:
        """The draws of some outputs."""
        chosen = list(outputs)
        return Draws(tuple(self.names[o] for o in chosen), self.values[chosen], self.reason, self.stable)


def _sorted_ends(values: Array, reason: Codes) -> tuple[Array, Array]:
    """Sorted draws twice: for the lower and the upper limit, with those that have no answer where they do most harm."""
    lost = ~np.isfinite(values)
    if not lost.any():
        ordered = np.sort(values)
        return ordered, ordered
    far = np.isin(reason, [r for r in Reason if r.far])
    low = np.sort(np.where(lost, np.where(far, np.inf, -np.inf), values))
    return low, np.sort(np.where(lost, np.inf, values))


def sample(
    method: Method | Function, inputs: Any, draws: int, *, seed: int = 0, correlations: Correlations | None = None
) -> Draws:
    """A fixed number of draws of one scene."""
    space = Space((inputs,), correlations)
    return sample_space(model_of(method, inputs), space, draws, np.random.default_rng(seed))


def sample_space(model: Model, space: Space, draws: int, rng: np.random.Generator) -> Draws:
    """A fixed number of draws of a space, chunk by chunk."""
    values = np.empty((len(model.names), draws))
    reason = np.empty(draws, np.int8)
    for first in range(0, draws, CHUNK):
        cut = slice(first, min(first + CHUNK, draws))
        moved: Moved = {}
        for line in space.lines:
            line.put(line.draw(rng, cut.stop - first), moved)
        values[:, cut], reason[cut] = evaluate(model, space, moved, cut.stop - first)
    return Draws(model.names, values, reason)


def monte_carlo(
    method: Method | Function, inputs: Any, *, draws: int | None = None, seed: int = 0, level: float = 0.95,
    correlations: Correlations | None = None,
) -> Draws:  # fmt: skip
    """Draws of one scene: `draws` of them, or by the adaptive procedure of JCGM 101, 7.9, with two significant digits."""
    if draws is not None:
        return sample(method, inputs, draws, seed=seed, correlations=correlations)
    space = Space((inputs,), correlations)
    return adaptive(model_of(method, inputs), space, level, seed)


def adaptive(
    model: Model, space: Space, level: float, seed: int, wanted: Sequence[int] | None = None, digits: int = 2
) -> Draws:
    """Blocks of draws of the wanted outputs (all by default) until their statistics are steady."""
    rng = np.random.default_rng(seed)
    blocks: list[Draws] = []
    statistics: list[Array] = []
    while True:
        block = sample_space(model, space, BLOCK, rng)
        block = block if wanted is None else block.of(wanted)
        blocks.append(block)
        ends = np.array([block.interval(o, level) for o in range(len(block.names))])
        statistics.append(np.stack([block.mean, block.u, ends[:, 0], ends[:, 1]]))
        stable = len(blocks) >= FEWEST_BLOCKS and _steady(np.stack(statistics), digits)
        if stable or len(blocks) * BLOCK >= model.most_draws:
            values = np.concatenate([b.values for b in blocks], axis=1)
            return Draws(block.names, values, np.concatenate([b.reason for b in blocks]), stable)


def _steady(statistics: Array, digits: int) -> bool:
    """Whether twice the standard deviation of each averaged statistic is below the tolerance; (blocks, 4, o)."""
    spread = 2 * np.std(np.where(np.isfinite(statistics), statistics, 0.0), axis=0, ddof=1) / math.sqrt(len(statistics))
    allowed = np.array([tolerance(float(u), digits) for u in np.mean(statistics[:, 1], axis=0)])
    return bool(np.all(spread <= allowed))
