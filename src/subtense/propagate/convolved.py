"""The law of a weighted sum of independent variables, by its characteristic function: an interval without draws.

The density is a cosine series whose coefficients are values of the characteristic function, which is the product of those of
the variables; what is summed is smooth where a normal variable takes part, and the series is then short.

Source: F. Fang, C. W. Oosterlee, A novel pricing method for European options based on Fourier-cosine series expansions,
SIAM J. Sci. Comput. 31 (2008), 2.1; laws: JCGM 101:2008, 6.4.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from ..arrays import Array
from ..distribution import Distribution

TERMS = 512
"""Of the series; a sum that is nearly one uniform law needs them all for three digits of its quantiles."""
REACH = 7.0
"""Half-width of the range in standard deviations."""
POINTS = 256
"""Quantiles that stand for a law without a closed characteristic function here."""

_ROOT3, _ROOT6 = math.sqrt(3.0), math.sqrt(6.0)
Complex = Any


def interval(slopes: Array, laws: Sequence[Distribution], level: float) -> tuple[float, float]:
    """Probabilistically symmetric interval of sum(slopes * z).

    Args:
        slopes: (m,) finite, not all 0.
        laws: of z, m of them, none of them `t`.
        level: coverage.
    """
    means = np.array([law.mean for law in laws])
    mean = float(slopes @ means)
    spread = math.sqrt(float(np.sum(slopes**2 * (1 - means**2))))
    width = 2 * REACH * spread
    start = mean - REACH * spread
    k = np.arange(1, TERMS) * (math.pi / width)
    product = np.exp(-1j * k * start)
    for slope, law in zip(slopes.tolist(), laws, strict=True):
        if slope:
            product = product * _characteristic(law, k * slope)
    terms = 2 * product.real / (k * width)

    def below(x: float) -> float:
        return (x - start) / width + float(terms @ np.sin(k * (x - start)))

    return tuple(_where(below, share, mean, spread) for share in ((1 - level) / 2, (1 + level) / 2))  # type: ignore[return-value]


def _where(below: Callable[[float], float], share: float, mean: float, spread: float) -> float:
    """The x below which a share lies: bisection, which a wiggle of the series does not mislead."""
    low, high = mean - REACH * spread, mean + REACH * spread
    for _ in range(22):
        middle = (low + high) / 2
        low, high = (middle, high) if below(middle) < share else (low, middle)
    return (low + high) / 2


def _characteristic(law: Distribution, t: Array) -> Complex:
    """E exp(i t z)."""
    if law.name == "normal":
        return np.exp(-t * t / 2)
    if law.name == "uniform":
        return np.sinc(t * (_ROOT3 / math.pi))
    if law.name == "one_sided":  # uniform from 0 to a root of 3, on one side
        half = law.shape * _ROOT3 / 2
        return np.exp(1j * half * t) * np.sinc(t * (half / math.pi))
    if law.name == "triangular":
        return np.sinc(t * (_ROOT6 / (2 * math.pi))) ** 2
    return np.exp(1j * np.outer(t, _typical(law))).mean(axis=1)


@lru_cache(maxsize=64)
def _typical(law: Distribution) -> Array:
    """Equally likely values of a law."""
    return np.array([law.quantile((i + 0.5) / POINTS) for i in range(POINTS)])
