"""The laws an uncertain number can follow: normal, uniform, triangular, arcsine, t, curvilinear trapezoid,
one-sided, and one of two values.

A `Distribution` is standardised: it describes z, and the number is `value + u * z`. All but `t` have a
root mean square of 1 about the stated value, so that u is what the law of propagation (GUM 5.1.2) needs;
`t` is the scaled and shifted t of JCGM 101 6.4.9, whose draws spread by sqrt(dof / (dof - 2)) more than u.

Source: JCGM 101:2008, 6.4.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from .arrays import Array
from .errors import InputError

Shape = tuple[int, ...]

_ROOT3 = math.sqrt(3.0)
HALF_WIDTH_95 = 1.959963984540054
"""Half-width of a 95 % normal interval in standard deviations."""


@dataclass(frozen=True)
class Distribution:
    """The law of one standardised variable z.

    Attributes:
        name: a key of LAWS.
        shape: the law's own parameter: degrees of freedom of `t`; ratio of the limits' half-uncertainty to the
            half-width for `curvilinear_trapezoid`; the side (+1 or -1) of `one_sided`; the probability of the other
            value for `either`; unused (0) elsewhere.
    """

    name: str = "normal"
    shape: float = 0.0

    def __post_init__(self) -> None:
        if self.name not in LAWS:
            raise InputError("distribution", self.name, f"known are {', '.join(LAWS)}")

    def draw(self, rng: np.random.Generator, size: Shape) -> Array:
        """Standardised random draws, shape `size`."""
        return LAWS[self.name].draw(rng, size, self.shape)

    def quantile(self, probability: float) -> float:
        """The z below which the given share of the draws lies."""
        return LAWS[self.name].quantile(probability, self.shape)

    @property
    def mean(self) -> float:
        """Mean of z: 0 for all laws that are symmetric about the stated value."""
        if self.name == "one_sided":
            return self.shape * _ROOT3 / 2.0
        return math.sqrt(self.shape) if self.name == "either" else 0.0

    @property
    def excess_kurtosis(self) -> float:
        """Fourth standardised moment less 3; 0 for the normal law."""
        return LAWS[self.name].excess_kurtosis(self.shape)

    def to_json(self) -> str | dict[str, Any]:
        """The bare name where there is no shape, else name and shape."""
        return {"name": self.name, "shape": self.shape} if self.shape else self.name

    @classmethod
    def from_json(cls, data: str | dict[str, Any]) -> Distribution:
        """The inverse of `to_json`."""
        return cls(data) if isinstance(data, str) else cls(str(data["name"]), float(data["shape"]))


@dataclass(frozen=True)
class Law:
    """How a named law draws, and its quantiles and kurtosis; each takes the law's shape last."""

    draw: Callable[[np.random.Generator, Shape, float], Array]
    quantile: Callable[[float, float], float]
    excess_kurtosis: Callable[[float], float]


def normal_quantile(probability: float) -> float:
    """Quantile of the standard normal law."""
    if probability == 0.975:
        return HALF_WIDTH_95  # what nearly every interval asks for, without a slow import
    from statistics import NormalDist

    return NormalDist().inv_cdf(probability)


def t_quantile(probability: float, dof: float) -> float:
    """Quantile of Student's t; the normal one for infinite degrees of freedom."""
    if not math.isfinite(dof):
        return normal_quantile(probability)
    from scipy.special import stdtrit  # slow to import, and rarely needed

    return float(stdtrit(dof, probability))


def _triangular_quantile(p: float, _: float) -> float:
    half = math.sqrt(6.0)
    return half * (math.sqrt(2 * p) - 1) if p < 0.5 else half * (1 - math.sqrt(2 * (1 - p)))


def _one_sided_quantile(p: float, side: float) -> float:
    return side * _ROOT3 * (p if side > 0 else 1 - p)


def _trapezoid_scale(d: float) -> float:
    """Half-width, in units of u, of a curvilinear trapezoid whose limits are known to +-d half-widths."""
    return 1.0 / math.sqrt(1.0 / 3.0 + d * d / 9.0)


def _draw_trapezoid(rng: np.random.Generator, size: Shape, d: float) -> Array:
    """JCGM 101 6.4.3.4: a limit drawn within its own limits, then uniform between the two."""
    half = 1.0 + d * (2.0 * rng.random(size) - 1.0)
    return np.asarray(_trapezoid_scale(d) * half * (2.0 * rng.random(size) - 1.0))


def _trapezoid_quantile(p: float, d: float) -> float:
    """By bisection on the distribution function, which is that of a uniform law averaged over its half-width."""
    if d == 0:
        return _ROOT3 * (2 * p - 1)

    def below(z: float) -> float:
        half_low, half_high, side = 1 - d, 1 + d, abs(z)
        edge = min(max(side, half_low), half_high)
        inside = (edge - half_low) * 1.0 + side * math.log(half_high / edge)
        share = inside / (half_high - half_low)
        return 0.5 + math.copysign(share / 2, z)

    low, high = -1 - d, 1 + d
    for _ in range(80):
        middle = (low + high) / 2
        low, high = (middle, high) if below(middle) < p else (low, middle)
    return (low + high) / 2 * _trapezoid_scale(d)


def _trapezoid_kurtosis(d: float) -> float:
    fourth = _trapezoid_scale(d) ** 4 * (1 + 2 * d * d + d**4 / 5) / 5
    return fourth - 3.0


LAWS: dict[str, Law] = {
    "normal": Law(lambda r, n, _: r.standard_normal(n), lambda p, _: normal_quantile(p), lambda _: 0.0),
    "uniform": Law(lambda r, n, _: r.uniform(-_ROOT3, _ROOT3, n), lambda p, _: _ROOT3 * (2 * p - 1), lambda _: -1.2),
    "triangular": Law(
        lambda r, n, _: math.sqrt(6.0) * (r.random(n) - r.random(n)), _triangular_quantile, lambda _: -0.6
    ),
    "arcsine": Law(
        lambda r, n, _: np.asarray(math.sqrt(2.0) * np.sin(r.uniform(0.0, 2 * math.pi, n))),
        lambda p, _: math.sqrt(2.0) * math.sin(math.pi * (p - 0.5)),
        lambda _: -1.5,
    ),
    "t": Law(
        lambda r, n, dof: r.standard_t(dof, n),
        t_quantile,
        lambda dof: 6.0 / (dof - 4.0) if dof > 4 else math.inf,
    ),
    "curvilinear_trapezoid": Law(_draw_trapezoid, _trapezoid_quantile, _trapezoid_kurtosis),
    "either": Law(
        lambda r, n, p: (r.random(n) < p) / math.sqrt(p),
        lambda q, p: 0.0 if q < 1 - p else 1 / math.sqrt(p),
        lambda p: (1 - 6 * p * (1 - p)) / (p * (1 - p)),
    ),
    "one_sided": Law(lambda r, n, side: side * _ROOT3 * r.random(n), _one_sided_quantile, lambda _: -1.2),
}
NORMAL = Distribution()
