"""Anchoring: scale and shift of a depth map from places whose depth is known, with what they leave in doubt.

With x the depth, or its inverse for maps of disparity, the map's number v is taken as  x = offset + scale (v - pivot)  up to
an error that is local: tau times x at each place. Known depths fix offset and scale by generalised least squares, with their full
covariance, as anchors measured with one camera err together. A map of metres, or up to a factor, has its offset about 0, known
to tau times the anchors' x; one that is open to a shift needs two anchors. tau is what was stated or published of the network, as
if it came from PRIOR_DOF residuals, and what the residuals of this picture say: it makes their weighted sum of squares what it
should be.
As its own doubt widens what follows from it, all are taken as normal with the standard deviation of t's law. The pivot is chosen so
that offset and scale do not err together. An anchor that lies far off the others gets less weight.

Source: generalised least squares with a prior: A. Tarantola, Inverse Problem Theory, SIAM 2005, 3.2; weights: P. J. Huber, Robust
Statistics, Wiley 1981; alignment of disparity: R. Ranftl et al., Towards robust monocular depth estimation, PAMI 2022.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .arrays import Array
from .errors import InputError
from .quantity import Note
from .raw_depth import RawDepth

PRIOR_DOF = 4.0
"""How many residuals the stated or published local error counts for."""
FAR_OFF = 3.0
"""Standard deviations from which an anchor is named as one that contradicts the rest."""
HUBER = 2.5
"""Standard deviations from which an anchor loses weight; with fewer than four, none can be told from the others."""
ROUNDS = 5
"""Of weights and local error by turns."""
BEYOND = 0.5
"""Of the range of the anchors' numbers: how far beyond it a place is extrapolated."""


@dataclass(frozen=True)
class Anchor:
    """A place whose depth is known.

    Attributes:
        point_px: (2,).
        value: the map's number there.
        spread: standard deviation of that number as far as it hangs on where the place is.
        depth_m: as known.
        u_m: its standard deviation.
        label: what it is.
    """

    point_px: Array
    value: float
    spread: float
    depth_m: float
    u_m: float
    label: str


@dataclass(frozen=True)
class Alignment:
    """x = offset + scale (v - pivot); offset and scale are uncorrelated.

    Attributes:
        scale: x per number of the map.
        u_scale: its standard deviation.
        offset: x at the pivot.
        u_offset: its standard deviation.
        pivot: a number of the map.
        u_local: relative standard deviation of single depths about the fit.
        numbers: smallest and largest number of the anchors.
        notes: anchors that contradict each other or the map.
        source: what it rests on.
    """

    scale: float
    u_scale: float
    offset: float
    u_offset: float
    pivot: float
    u_local: float
    numbers: tuple[float, float]
    notes: tuple[Note, ...] = ()
    source: str = ""

    def x(self, values: Array) -> Array:
        """Depth or its inverse, of numbers of the map."""
        return np.asarray(self.offset + self.scale * (values - self.pivot))

    def beyond(self, value: float) -> bool:
        """Whether a number of the map lies far from those of all anchors."""
        low, high = self.numbers
        reach = BEYOND * (high - low)
        return not low - reach <= value <= high + reach


def aligned(raw: RawDepth, anchors: Sequence[Anchor], cov_m2: Array | None = None) -> Alignment:
    """The alignment of a map.

    Args:
        raw: the map.
        anchors: one or more for maps of metres or up to a factor, two or more at different depths for others.
        cov_m2: (n, n) covariance of the anchors' depths; None where they err independently.

    Raises:
        InputError: too few anchors, or they say that the map's numbers mean something else.
    """
    open_shift = raw.kind in ("affine", "disparity")
    _check_enough(raw, anchors, open_shift)
    v, z = np.array([a.value for a in anchors]), np.array([a.depth_m for a in anchors])
    known = np.diag(np.array([a.u_m for a in anchors]) ** 2) if cov_m2 is None else np.asarray(cov_m2, float)
    x, slope = (1 / z, 1 / z**2) if raw.inverse else (z, np.ones_like(z))
    known = known * np.outer(slope, slope)
    prior = None if open_shift else raw.u_local * float(np.exp(np.mean(np.log(x))))
    fit = _Fit(v, x, known, np.array([a.spread for a in anchors]), raw, slope, prior)
    try:
        tau, weights = fit.settled()
        theta, _ = fit.solved(tau, weights)
    except np.linalg.LinAlgError:
        text = "; ".join(a.label for a in anchors)
        raise InputError("--anchor", text, "they do not determine the map; give others at different depths") from None
    if not theta[1] > 0:
        raise _turned_round(raw, anchors)
    count = len(anchors)
    wider = _wider(PRIOR_DOF + count - fit.free)
    cov = fit.covariance(tau, weights, wider)
    tied = float(cov[0, 1] / cov[1, 1])
    pivot = fit.middle - tied
    offset, variance = float(theta[0] - theta[1] * tied), float(cov[0, 0] - cov[0, 1] * tied)
    source = f"{count} anchor{'s' if count > 1 else ''}: {', '.join(a.label for a in anchors)}"
    numbers = (float(v.min()), float(v.max()))
    notes = _doubts(raw, anchors, fit, theta, tau)
    u_scale, u_offset = math.sqrt(float(cov[1, 1])), math.sqrt(max(variance, 0.0))
    return Alignment(float(theta[1]), u_scale, offset, u_offset, pivot, wider * tau, numbers, notes, source)


def _wider(dof: float) -> float:
    """Standard deviation of t's law: that of a number whose u has so many degrees of freedom, which is taken as normal. Its interval
    of 95 % is that of t within 2 %.
    """
    return math.sqrt(dof / (dof - 2))


def _turned_round(raw: RawDepth, anchors: Sequence[Anchor]) -> InputError:
    larger, other = ("smaller", "disparity, whose larger numbers are nearer")
    if raw.inverse:
        larger, other = ("larger", "depth, whose larger numbers are farther")
    text = f"by them farther places have {larger} numbers: check them, or is it a map of {other} (--gives)?"
    return InputError("--anchor", "; ".join(a.label for a in anchors), text)


def _check_enough(raw: RawDepth, anchors: Sequence[Anchor], open_shift: bool) -> None:
    what = "; ".join(a.label for a in anchors) or None
    if len(anchors) < (2 if open_shift else 1):
        left, needed = "the scale", "one known distance"
        if open_shift:
            left, needed = "scale and shift", "two known distances at different depths"
        raise InputError(
            "--anchor", what, f"{raw.source} leaves {left} open: give {needed}, as --anchor '320,240 = 3.2 m'"
        )
    values = np.array([a.value for a in anchors])
    if open_shift and not np.ptp(values) > 1e-6 * np.max(np.abs(values)):
        raise InputError("--anchor", what, "the map has one number at all of them; give anchors at different depths")


@dataclass(frozen=True)
class _Fit:
    """Least squares of one map at given tau."""

    v: Array
    x: Array
    known: Array
    spread: Array
    raw: RawDepth
    slope: Array
    prior: float | None

    @property
    def middle(self) -> float:
        """Of the numbers; the pivot while solving."""
        return float(self.v.mean())

    @property
    def free(self) -> int:
        """Parameters that the anchors alone determine."""
        return 2 if self.prior is None else 1

    def variance(self, tau: float, scale: float, weights: Array) -> Array:
        """(n, n) of x, besides what scale and offset do."""
        local = (tau * self.x) ** 2 + (self.raw.u_m * self.slope) ** 2 + (scale * self.spread) ** 2
        total = self.known + np.diag(local)
        return np.asarray(total / np.sqrt(np.outer(weights, weights)))

    def solved(self, tau: float, weights: Array) -> tuple[Array, Array]:
        """(2,) offset at the middle and scale, and their covariance."""
        scale = self._rough()
        rows = np.stack([np.ones_like(self.v), self.v - self.middle], -1)
        for _ in range(3 if self.spread.any() else 1):  # the spread's share grows with the scale
            weighted = np.linalg.solve(self.variance(tau, scale, weights), rows)
            normal, right = rows.T @ weighted, weighted.T @ self.x
            if self.prior is not None:  # offset - scale * middle, x at v = 0, is 0 within the prior
                row = np.array([1.0, -self.middle])
                normal = normal + np.outer(row, row) / self.prior**2
            cov = np.linalg.inv(normal)
            theta = cov @ right
            scale = abs(float(theta[1]))
        return np.asarray(theta), np.asarray(cov)

    def covariance(self, tau: float, weights: Array, wider: float) -> Array:
        """(2, 2) of offset and scale; what follows from tau, which is itself doubtful, is widened."""
        theta, cov = self.solved(tau, weights)
        rows = np.stack([np.ones_like(self.v), self.v - self.middle], -1)
        gain = cov @ np.linalg.solve(self.variance(tau, abs(float(theta[1])), weights), rows).T
        known = gain @ self.known @ gain.T
        return np.asarray(known + wider**2 * (cov - known))

    def _rough(self) -> float:
        if self.prior is not None:
            return float(abs(np.mean(self.x / self.v))) if np.all(self.v > 0) else 1.0
        return float(np.std(self.x) / np.std(self.v))

    def residuals(self, theta: Array) -> Array:
        """(n,) known less fitted x."""
        return np.asarray(self.x - theta[0] - theta[1] * (self.v - self.middle))

    def settled(self) -> tuple[float, Array]:
        """tau at which residuals and the prior knowledge of it agree, and the anchors' weights."""
        weights, tau = np.ones_like(self.v), self.raw.u_local
        for _ in range(ROUNDS):
            tau = self._tau(weights)
            if len(self.v) < 4:
                break
            theta, _cov = self.solved(tau, weights)
            sigma = np.sqrt(np.diag(self.variance(tau, abs(float(theta[1])), np.ones_like(weights))))
            off = np.abs(self.residuals(theta)) / sigma
            weights = np.minimum(1.0, HUBER / np.maximum(off, 1e-12))
        return tau, weights

    def _tau(self, weights: Array) -> float:
        """The root of a function that falls with tau; PRIOR_DOF residuals of the size of the known tau stand beside the anchors'."""
        from scipy.optimize import brentq

        start = self.raw.u_local
        wanted = len(self.v) - self.free + PRIOR_DOF

        def excess(log_tau: float) -> float:
            tau = math.exp(log_tau)
            theta, _ = self.solved(tau, weights)
            off = self.residuals(theta)
            chi2 = off @ np.linalg.solve(self.variance(tau, abs(float(theta[1])), weights), off)
            return float(chi2) + PRIOR_DOF * (start / tau) ** 2 - wanted

        low, high = math.log(start / 20), math.log(max(start * 1000, 10.0))
        if excess(low) <= 0:  # of thousands of anchors, all of which fit
            return math.exp(low)
        if excess(high) >= 0:  # anchors that nothing brings together
            return math.exp(high)
        return math.exp(float(brentq(excess, low, high, xtol=1e-3)))


def _doubts(raw: RawDepth, anchors: Sequence[Anchor], fit: _Fit, theta: Array, tau: float) -> tuple[Note, ...]:
    """`anchors_disagree` and `anchor_unlikely`."""
    found = []
    sigma = np.sqrt(np.diag(fit.variance(raw.u_local, abs(float(theta[1])), np.ones_like(fit.v))))
    off = np.abs(fit.residuals(theta)) / sigma
    worst = int(np.argmax(off))
    if off[worst] > FAR_OFF:
        what = "scale" if fit.prior is not None else "scale and shift"
        text = (
            f"with one {what} the map misses the anchor {anchors[worst].label} by {off[worst]:.1f} times what is expected of "
            f"it; single depths are taken to be known to {100 * tau:.2g} % (1s)"
        )
        found.append(Note("anchors_disagree", text, "check where it is and how far away, or give more anchors"))
    factor, expected = float(np.median(fit.x / fit.v)), math.hypot(raw.u_factor, raw.u_local)
    if not raw.relative and factor > 0 and abs(math.log(factor)) > FAR_OFF * expected:
        times = abs(math.log(factor)) / expected
        text = f"the anchors make the map's depths {factor:.3g} times as long, {times:.1f} times what is expected of it"
        found.append(
            Note("anchor_unlikely", text, "check the anchors, their unit, and that the map is of this picture")
        )
    return tuple(found)
