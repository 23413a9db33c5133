"""The plane that meets conditions on lengths and angles best, of one nominal scene and of scenes moved from it.

Conditions are weighted by what all that is doubtful of points, camera and stated lengths does to each. The nominal plane is looked for
from many sides, so that a second one that meets the conditions as well is not overlooked. Moved scenes are refined from it.

Source: E. Mikhail, F. Ackermann, Observations and Least Squares, 9 (conditions with unknowns); W. Baarda, A testing procedure
for use in geodetic networks, 1968 (what each condition says against the others).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from .arrays import Array, Bools
from .conditions import KNOWN, Conditions, Rectified
from .flat_view import Disc
from .homography import FLOOR_PX, MISFIT_Z, ONE_OFF, Frame, chi2_limit, covariance_by
from .method import Reason
from .noun import Noun
from .observation import Observation

SECOND = 16.0
"""Difference of chi^2 below which a second plane can't be ruled out."""
HOPELESS = 1e4
"""Difference of chi^2 after some steps beyond which a plane is no longer followed."""
UNLIKE = 0.02
"""Relative difference of lengths that makes two planes two."""
LEVERAGE = 16.0
"""What conditions tell of the plane's weakest number must be this many times what noise alone makes them seem to tell."""
SAME = 1e-5
"""Eigenvalue of the correlation of conditions below which one of them follows from the others."""
COARSE, FINE, KEPT, ROUNDS = 12, 80, 16, 3
"""Steps from every start, steps of the best ones, how many these are, and how often they are weighted anew."""
QUICK, SLOW = 10, 30
"""Steps of a moved scene by the nominal slopes, and by its own where these do not settle."""
SETTLED, NEAR, STUCK = 1e-10, 1e-6, 1e6
REACH = 0.9
"""How near to its horizon a plane starts, as share of the way to the farthest point."""


@dataclass(frozen=True, eq=False)
class Scene:
    """What a plane is told by, in numbers: leading axes are moved scenes.

    Attributes:
        flat: (..., N, 2) picture coordinates of the points.
        known: stated lengths in the order of KNOWN, each (...).
    """

    flat: Array
    known: tuple[Array, ...]

    @property
    def usable(self) -> bool:
        """Whether all is finite, and all lengths are above 0."""
        return bool(np.all(np.isfinite(self.flat))) and all(bool(np.all(one > 0)) for one in self.known)


@dataclass(frozen=True, eq=False)
class Plane:
    """The nominal plane.

    Attributes:
        rectified: what its numbers mean.
        disc: where a lens of which nothing is known may distort.
        numbers: (P,); NaN where there is none.
        reason: why there is none.
        whiten: (R, C) of conditions, R of which do not follow from each other.
        gain: (P, C) change of the numbers by the conditions.
        chi2: sum of squares.
        freedom: spare conditions.
        lone: (C,) by how many standard deviations each is off what the others say.
    """

    rectified: Rectified
    disc: Disc
    numbers: Array
    reason: Reason
    whiten: Array
    gain: Array
    chi2: float = 0.0
    freedom: int = 0
    lone: Array | None = None

    @property
    def misfit(self) -> bool:
        """Whether the conditions contradict each other beyond chance, all together or one alone."""
        if self.freedom <= 0 or self.lone is None:
            return False
        alone = min(math.sqrt(-2 * math.log(ONE_OFF / len(self.lone))), MISFIT_Z)
        return self.chi2 > chi2_limit(self.freedom) or float(self.lone.max()) > alone


Numbers = Callable[..., Scene]
"""From nouns, one of them perhaps with a leading axis, to the scene that they make."""


def nominal_plane(
    conditions: Conditions,
    nouns: Sequence[Noun | None],
    scene: Numbers,
    disc: Disc,
    *,
    camera: bool,
    wanted: tuple[int, ...],
) -> Plane:
    """The plane of one nominal scene.

    Args:
        conditions: that hold in it.
        nouns: all that is doubtful of the scene; the first are the points.
        scene: of these nouns.
        disc: of the picture.
        camera: whether picture coordinates are slopes.
        wanted: indices of the points that matter to the answer.
    """
    seen = scene(*nouns)
    count, free = len(conditions.each), conditions.needed(camera=camera)
    rectified = Rectified(conditions, Frame(np.zeros(2), 1.0), camera)
    none = Plane(
        rectified, disc, np.full(free, np.nan), Reason.COLLINEAR, np.zeros((0, count)), np.zeros((free, count))
    )
    if not seen.usable:
        return none
    rectified = Rectified(conditions, Frame.of(seen.flat[conditions.told]), camera)
    none = replace(none, rectified=rectified)
    if _one_place(rectified, seen):
        return none
    none = replace(none, reason=Reason.FOLDED)
    if not all(_convex(seen.flat[list(quad)]) for quad in conditions.quads):
        return none
    found = _several(rectified, nouns, scene, seen)
    if found is None:
        return none
    numbers, chi2, settled, whiten = found
    if not settled[0]:  # it runs away along what the conditions leave open, or into the horizon
        fits = chi2[0] < chi2_limit(max(len(whiten) - free, 1))
        return replace(none, reason=Reason.UNDETERMINED if fits else Reason.FOLDED)
    return _judged(replace(none, whiten=whiten), nouns, scene, numbers, chi2, wanted)


def _one_place(rectified: Rectified, seen: Scene) -> bool:
    """Whether a side of a condition has no length in the picture."""
    ends = np.concatenate([points for _, _, points in rectified.conditions.groups]).reshape(-1, 2)
    x = rectified.frame.enter(seen.flat)
    return bool(np.any(np.hypot(*(x[ends[:, 1]] - x[ends[:, 0]]).T) < NEAR))


def _convex(corners: Array) -> bool:
    """Whether four corners (4, 2) go round a figure, none inside the others."""
    edge = np.roll(corners, -1, axis=0) - corners
    following = np.roll(edge, -1, axis=0)
    turn = edge[:, 0] * following[:, 1] - edge[:, 1] * following[:, 0]
    return bool(np.all(turn > 0) or np.all(turn < 0))


def _several(
    rectified: Rectified, nouns: Sequence[Noun | None], scene: Numbers, seen: Scene
) -> tuple[Array, Array, Bools, Array] | None:
    """(S, P) planes that meet the conditions, best first, their chi^2 (S,), whether they stay, and the weights; None for none."""
    rough, cost, _ = solved(
        rectified, _starts(rectified, seen), seen, 100.0 * np.eye(len(rectified.conditions.each)), COARSE
    )
    rough = _apart(rough, cost)
    if not len(rough):
        return None
    whiten, _ = _weights(rectified, nouns, scene, rough[0])
    numbers, chi2, _ = solved(rectified, rough, seen, whiten, COARSE)
    rough = _apart(numbers[chi2 < chi2.min() + HOPELESS], chi2[chi2 < chi2.min() + HOPELESS])
    for _ in range(ROUNDS):
        numbers, chi2, settled = solved(rectified, rough, seen, whiten, FINE)
        order = np.argsort(chi2)
        numbers, chi2, settled = numbers[order], chi2[order], settled[order]
        again = bool(np.max(abs(numbers[0] - rough[0])) < NEAR)
        if again:
            break
        near = chi2 < chi2[0] + 100 * SECOND
        whiten, _ = _weights(rectified, nouns, scene, numbers[0])
        rough = _apart(numbers[near], chi2[near])
    return numbers, chi2, settled, whiten


def _apart(numbers: Array, cost: Array) -> Array:
    """The best (S, P), those alike but once."""
    kept: list[Array] = []
    for one in numbers[np.argsort(cost)][: int(np.isfinite(cost).sum())]:
        if all(np.max(abs(one - other)) > 1e-3 for other in kept):
            kept.append(one)
        if len(kept) == KEPT:
            break
    return np.array(kept).reshape(-1, numbers.shape[-1])


def _starts(rectified: Rectified, seen: Scene) -> Array:
    """(S, P) numbers to start from: planes turned every way, their scale by a stated length."""
    around = np.arange(8) * (math.pi / 4)
    ways = np.column_stack([np.cos(around), np.sin(around)])
    # slopes of the plane with a camera; without one the horizon is as far as its picture converges
    steep = np.array([0.4, 1.0, 2.5, 6.0]) * rectified.frame.scale if rectified.camera else np.array([0.2, 0.5])
    horizon = np.concatenate([np.zeros((1, 2)), *(one * ways for one in steep)])
    near = np.max(-horizon @ rectified.frame.enter(seen.flat[rectified.conditions.told]).T, axis=1)
    horizon *= np.minimum(1.0, REACH / np.maximum(near, 1e-12))[:, None]
    if rectified.camera:
        numbers = horizon
    else:
        shape = np.stack(np.meshgrid([-0.5, 0.0, 0.5], [-0.6, 0.0, 0.6]), -1).reshape(-1, 2)
        numbers = np.concatenate([np.repeat(shape, len(horizon), axis=0), np.tile(horizon, (len(shape), 1))], -1)
    if not rectified.conditions.scaled:
        return numbers
    numbers = np.column_stack([np.zeros(len(numbers)), numbers])
    first = next(i for i, one in enumerate(rectified.conditions.each) if one.kind in KNOWN)
    numbers[:, 0] = -rectified.off(numbers, seen.flat, seen.known)[:, first]
    return numbers


def solved(rectified: Rectified, starts: Array, seen: Scene, whiten: Array, steps: int) -> tuple[Array, Array, Bools]:
    """Planes that meet the conditions best, by damped Gauss-Newton from each start; a step behind the horizon is not taken.

    Args:
        rectified: what numbers mean.
        starts: (S, P).
        seen: one scene, or S of them.
        whiten: (R, C).
        steps: at most.

    Returns:
        (S, P) numbers, chi^2 (S,), infinite behind the horizon, and (S,) whether the last step was small.
    """

    told = seen.flat[..., rectified.conditions.told, :]

    def white(numbers: Array) -> tuple[Array, Array]:
        residual = rectified.off(numbers, seen.flat, seen.known) @ whiten.T
        before = rectified.places(numbers, told)[1]
        return residual, np.where(before, np.nan_to_num(np.sum(residual**2, -1), nan=np.inf), np.inf)

    numbers, damp = starts.copy(), np.full(len(starts), 1e-3)
    residual, cost = white(numbers)
    settled = np.zeros(len(starts), bool)
    for _ in range(steps):
        jacobian = np.nan_to_num(whiten @ rectified.slopes(numbers, seen.flat, seen.known), posinf=0.0, neginf=0.0)
        turned = np.swapaxes(jacobian, -1, -2)
        normal = turned @ jacobian
        size = np.einsum("sii->si", normal) * damp[:, None] + 1e-12
        gradient = turned @ np.nan_to_num(residual, posinf=0.0, neginf=0.0)[..., None]
        step = -np.linalg.solve(normal + size[:, :, None] * np.eye(normal.shape[-1]), gradient)[..., 0]
        trial = numbers + np.clip(step, -1.0, 1.0)
        there, new = white(trial)
        # at the bottom rounding decides
        better = (new <= cost) & np.isfinite(new)
        numbers, cost = np.where(better[:, None], trial, numbers), np.where(better, new, cost)
        residual = np.where(better[:, None], there, residual)
        settled = (np.abs(step).max(axis=-1) < NEAR) & ((damp < 1e-2) | settled)
        damp = np.clip(np.where(better, damp / 5, damp * 5), 1e-12, 1e12)
        if np.all((np.abs(step).max(axis=-1) < SETTLED) | (damp > STUCK)):
            break
    return numbers, cost, settled


def _weights(rectified: Rectified, nouns: Sequence[Noun | None], scene: Numbers, numbers: Array) -> tuple[Array, Array]:
    """(R, C) inverse root of the covariance of the conditions at a plane, without what follows from others, and that of clicks alone."""

    def off(*moved: Noun | None) -> Array:
        one = scene(*moved)
        return rectified.off(numbers, one.flat, one.known)

    count = len(rectified.conditions.each)
    cov = covariance_by(nouns, off, count)
    points = nouns[0]
    assert isinstance(points, Observation)
    exact = replace(points, sigma_px=FLOOR_PX, cov=None, id=None)
    floor = covariance_by((exact,), lambda p: off(p, *nouns[1:]), count)
    # what follows from what is told by clicks alone: a lens that bends all conditions together makes none of them follow from others
    stated = np.array([one.kind in KNOWN for one in rectified.conditions.each])
    alone = floor + np.diag(np.diag(floor) * stated)
    root = np.sqrt(np.maximum(np.diag(alone), 1e-20))
    values, vectors = np.linalg.eigh(alone / np.outer(root, root))
    keep = values > SAME
    basis = (vectors[:, keep] / np.sqrt(values[keep])).T / root
    whiten = np.linalg.inv(np.linalg.cholesky(basis @ (cov + floor) @ basis.T)) @ basis
    return np.asarray(whiten), np.asarray(basis)


def _judged(
    none: Plane, nouns: Sequence[Noun | None], scene: Numbers, numbers: Array, chi2: Array, wanted: tuple[int, ...]
) -> Plane:
    """The best plane, or the reason why it can't be told."""
    rectified, seen, best, whiten = none.rectified, scene(*nouns), numbers[0], none.whiten
    freedom = len(whiten) - len(best)
    jacobian = whiten @ rectified.slopes(best, seen.flat, seen.known)
    undetermined = replace(none, reason=Reason.UNDETERMINED)
    if freedom < 0:
        return undetermined
    if freedom == 0 and chi2[0] > 1e-6:  # just enough of independent conditions are met exactly
        return undetermined if chi2[0] < chi2_limit(1) else none
    # by the weights of clicks too: a lens that weakens a number must not be all that it is compared with
    _, clicks = _weights(rectified, nouns, scene, best)
    only = (nouns[0], *(None for _ in nouns[1:]))
    if not (_told(rectified, nouns, scene, best, clicks, nouns) and _told(rectified, nouns, scene, best, whiten, only)):
        return undetermined
    if any(_unlike(rectified, seen, best, other, wanted) for other in numbers[1:][chi2[1:] < chi2[0] + SECOND]):
        return undetermined
    gain = np.linalg.pinv(jacobian) @ whiten
    off = rectified.off(best, seen.flat, seen.known)
    return replace(none, numbers=best, reason=Reason.OK, gain=gain, chi2=float(chi2[0]), freedom=freedom,
                   lone=_lone(whiten, jacobian, off))  # fmt: skip


def _told(
    rectified: Rectified,
    nouns: Sequence[Noun | None],
    scene: Numbers,
    best: Array,
    weights: Array,
    doubtful: Sequence[Noun | None],
) -> bool:
    """Whether the conditions tell the plane's weakest number by more than what noise of the doubtful nouns alone would seem to tell."""
    seen = scene(*nouns)
    _, values, vectors = np.linalg.svd(weights @ rectified.slopes(best, seen.flat, seen.known))
    weakest = vectors[-1]

    def told(*moved: Noun | None) -> Array:
        one = scene(*(new if new is not None else old for new, old in zip(moved, nouns, strict=True)))
        return np.asarray(weights @ rectified.slopes(best, one.flat, one.known) @ weakest)

    noise = float(np.trace(covariance_by(doubtful, told, len(weights))))
    return bool(values[-1] ** 2 > max(LEVERAGE * noise, 1e-12))


def _unlike(rectified: Rectified, seen: Scene, one: Array, other: Array, wanted: tuple[int, ...]) -> bool:
    """Whether the wanted points lie otherwise in two planes."""
    sizes = []
    for numbers in (one, other):
        places, before = rectified.places(numbers, seen.flat[list(wanted)])
        if not before:  # behind the horizon of the first there is no answer anyway
            return numbers is other
        i, j = np.triu_indices(len(wanted), 1)
        size = np.sqrt(np.sum((places[i] - places[j]) ** 2, -1))
        sizes.append(size if rectified.conditions.scaled else size / max(float(size.mean()), 1e-300))
    return bool(np.any(abs(sizes[0] - sizes[1]) > UNLIKE * sizes[0].max()))


def _lone(whiten: Array, jacobian: Array, off: Array) -> Array:
    """(C,) by how many standard deviations each condition is off what the others say (Baarda's w)."""
    inner = np.eye(len(whiten)) - jacobian @ np.linalg.pinv(jacobian)
    weight = whiten.T @ inner @ whiten
    pulled, spread = whiten.T @ (inner @ (whiten @ off)), np.diag(weight)
    # what nothing checks has no spread but that of rounding
    checked = spread > 1e-6 * np.sum(whiten**2, axis=0)
    return np.where(checked, abs(pulled) / np.sqrt(np.where(checked, spread, 1.0)), 0.0)


def moved_plane(plane: Plane, seen: Scene, lead: tuple[int, ...]) -> tuple[Array, Bools]:
    """(..., P) numbers of moved scenes, and (...) whether none was found.

    Args:
        plane: the nominal one.
        seen: the scenes.
        lead: their leading axes.
    """
    rectified = plane.rectified
    numbers = np.broadcast_to(plane.numbers, (*lead, plane.numbers.size))
    if plane.reason is not Reason.OK:
        return numbers, np.ones(lead, bool)
    for _ in range(QUICK):
        off = np.nan_to_num(rectified.off(numbers, seen.flat, seen.known), posinf=0.0, neginf=0.0)
        step = np.clip(off @ plane.gain.T, -1.0, 1.0)
        numbers = numbers - step
        if np.max(abs(step), initial=0.0) < SETTLED * 10:
            break
    rest = np.broadcast_to(~(np.max(abs(step), axis=-1, initial=0.0) < NEAR), lead)
    if not rest.any():
        return numbers, np.zeros(lead, bool)
    numbers, lost = np.array(numbers), np.zeros(lead, bool)
    some = Scene(
        np.broadcast_to(seen.flat, (*lead, *seen.flat.shape[-2:]))[rest],
        tuple(np.broadcast_to(one, lead)[rest] for one in seen.known),
    )
    starts = np.broadcast_to(plane.numbers, (int(rest.sum()), plane.numbers.size))
    numbers[rest], _, settled = solved(rectified, starts, some, plane.whiten, SLOW)
    lost[rest] = ~settled
    return numbers, lost
