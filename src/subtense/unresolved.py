"""The interval of a length that its own noise reaches: the distance between two places known worse than they are apart.

A length is never negative, so noise makes it longer: two points that are one are observed at a distance, and of a small
distance the draws around what was observed all lie above it. The interval is had by inverting the law of the observed
length instead (Neyman): it holds every true length under which what was observed is no surprise. In noise alike in all
directions that law is a noncentral chi; here the noise is that of the draws. What direction the true difference would have
at a given length is the likeliest one (C.-S. Chuang and T. L. Lai, Statistica Sinica 10, 2000: hybrid resampling). Where
even no length at all would rarely be observed as so short, the upper limit is taken against that (A. L. Read, J. Phys. G 28,
2002: CLs), and holds more often than stated.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from .arrays import Array

RESOLVED = 5.0
"""A length of so many of the largest standard deviation of its ends' difference needs no inversion."""
_STEPS = 40
_FLOOR = 1e-9
"""Of the largest variance: the least in any direction, so that the likelihood can be inverted."""


def largest_sigma(noise: Array) -> float:
    """The largest standard deviation of noise (3, n) in any direction."""
    return float(np.sqrt(np.linalg.eigvalsh(np.cov(noise))[-1]))


def interval(difference: Array, noise: Array, level: float = 0.95) -> tuple[float, float]:
    """The interval of the true length.

    Args:
        difference: (3,) as observed.
        noise: (3, n) draws of what is observed less what is true.
        level: coverage; each side is missed by half of the rest.

    Returns:
        Lower end, 0 where it is not shown that there is any length, and upper end.
    """
    observed = float(np.linalg.norm(difference))
    likeliest = _Likeliest(difference - noise.mean(axis=1), np.cov(noise))

    def shorter(length: float) -> float:
        """The share of observations up to the observed one, were this the true length."""
        seen = likeliest(length)[:, None] + noise
        return float(np.mean(np.einsum("in,in->n", seen, seen) <= observed**2))

    tail = (1 - level) / 2
    reach = observed + 10 * float(np.sqrt(likeliest.largest)) + float(np.linalg.norm(noise.mean(axis=1)))
    low = 0.0 if 1 - shorter(0.0) >= tail else _crossing(lambda x: (1 - shorter(x)) - tail, 0.0, reach)
    most = tail * max(shorter(0.0), 1 / noise.shape[1])
    return low, max(low, _crossing(lambda x: most - shorter(x), 0.0, reach))


def _crossing(rising: Callable[[float], float], low: float, high: float) -> float:
    """Where a rising function changes its sign, by bisection: draws make it a staircase."""
    for _ in range(_STEPS):
        middle = (low + high) / 2
        low, high = (low, middle) if rising(middle) >= 0 else (middle, high)
    return (low + high) / 2


class _Likeliest:
    """The likeliest difference of a given length: v minimising (d - v)' S^-1 (d - v) with |v| = length.

    With a multiplier k, in the axes of S: v_i = w_i d_i / (w_i + k), w the inverse variances over the smallest of them.
    """

    def __init__(self, difference: Array, cov: Array) -> None:
        values, self.turn = np.linalg.eigh(cov)
        self.largest = max(float(values[-1]), 1e-300)
        self.weights: list[float] = (self.largest / np.maximum(values, _FLOOR * self.largest)).tolist()
        self.along: list[float] = (self.turn.T @ difference).tolist()

    def __call__(self, length: float) -> Array:
        """(3,) in the frame of the difference."""
        if length <= 0:
            return np.zeros(3)
        low, high = -1.0, 1.0
        while self._length(high) > length and high < 1e18:
            high *= 4
        for _ in range(_STEPS):
            middle = (low + high) / 2
            low, high = (middle, high) if self._length(middle) > length else (low, middle)
        v = self._at(high)
        # where the difference has no part along the noisiest direction, the length is made up along it
        loose = self.weights.index(min(self.weights))
        rest = length**2 - sum(x * x for i, x in enumerate(v) if i != loose)
        v[loose] = math.copysign(math.sqrt(max(rest, 0.0)), self.along[loose])
        return np.asarray(self.turn @ np.array(v))

    def _at(self, multiplier: float) -> list[float]:
        return [w * d / max(w + multiplier, 1e-300) for w, d in zip(self.weights, self.along, strict=True)]

    def _length(self, multiplier: float) -> float:
        return math.hypot(*self._at(multiplier))
