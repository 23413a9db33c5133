"""Scale: what turns a scene's own unit into metres, from everything of known size in it.

Each known thing says  scale = its size / its size in the scene's unit. All of them are combined by least squares with their joint
covariance: the sizes' own doubt, that of the points set in the pictures, and that of the scene's places, which they share. What the
places contribute stays in the scene's covariance, with its sign, so that a length near a reference is better known than one far away.
Known sizes that were kept apart check the result.

Source: JCGM 102, 6; weighted means of correlated results: M. Cox, Metrologia 39, 2002 (chi-squared test, Birge ratio).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .arrays import Array
from .errors import GeometryError, InputError
from .method import Reason
from .quantity import Note, Quantity
from .scene import WHAT_TO_GIVE, Scene
from .sighting import located, start_of
from .views import Track, Views

KINDS = ("points", "cameras", "shape", "height", "positions")
CHANCE_Z = 3.09
"""Normal quantile (1 in 1000) beyond which known sizes that do not fit together are no chance."""
DOUBTFUL_SCALE = 0.05
"""Relative u of a scale that is noted."""


@dataclass(frozen=True, eq=False)
class Known:
    """One thing of known size in a scene.

    Attributes:
        kind: `points` (two tracks), `cameras` (two pictures' places), `shape` (tracks of points whose places in the thing are known),
            `height` (of a picture's place above the plane of three tracks or more), `positions` (of pictures, in metres).
        length: its size, m; of a shape or positions, 1 with the relative u that all of it has together.
        tracks: where its points are seen.
        names: the pictures of `cameras`, `height` or `positions`.
        places_m: (N, 3) of the shape's points, or of the pictures.
        sigma_m: standard deviations of `places_m`, one or (N, 3).
        label: its name.
        check: whether it is kept apart, to check the scale.
    """

    kind: str
    length: Quantity
    tracks: tuple[Track, ...] = ()
    names: tuple[str, ...] = ()
    places_m: Array | None = None
    sigma_m: Array | float = 0.0
    label: str = ""
    check: bool = False

    @property
    def pictures(self) -> tuple[str, ...]:
        """All pictures it stands in."""
        return tuple(dict.fromkeys([name for track in self.tracks for name in track.names] + list(self.names)))


@dataclass(frozen=True)
class Said:
    """What one known thing says of the scale.

    Attributes:
        label: of the known thing.
        kind: of KINDS.
        length_m: its size.
        found_m: its size in the scaled scene.
        u_m: standard deviation of the difference, all causes, were it independent of the others.
        weight: in the scale; 0 for one that was kept apart.
        check: whether it was kept apart.
    """

    label: str
    kind: str
    length_m: float
    found_m: float
    u_m: float
    weight: float
    check: bool = False

    def to_json(self) -> dict[str, Any]:
        """As its attributes."""
        return dict(vars(self))


@dataclass(frozen=True, eq=False)
class Scaled:
    """A scene in metres, and what its scale rests on.

    Attributes:
        scene: in metres.
        factor: metres for one of the scene's own units.
        relative_u: of the factor, all causes.
        said: what each known thing says, the checks among them.
        check_rms_m: of the check sizes' differences; None without checks.
        notes: doubts.
    """

    scene: Scene
    factor: float
    relative_u: float
    said: tuple[Said, ...]
    check_rms_m: float | None
    notes: tuple[Note, ...]


def size_in(nominal: Views, views: Views, known: Known, tracks: Sequence[Track]) -> Array:
    """(...) the known thing's size in the views' unit; of a shape or positions, over that in metres. NaN without an answer.

    Args:
        nominal: the views unmoved, where the points are sought first.
        views: as they are moved.
        known: the thing.
        tracks: its points, as they are moved.
    """
    if known.kind == "cameras":
        a, b = (views.places_m[..., views.index(name), :] for name in known.names)
        return np.asarray(np.linalg.norm(a - b, axis=-1))
    if known.kind == "positions":
        assert known.places_m is not None
        return _over_positions(views.places_m[..., [views.index(name) for name in known.names], :], known.places_m)
    found = [_point(nominal, views, known.tracks[i], track) for i, track in enumerate(tracks)]
    points = np.stack(np.broadcast_arrays(*found), -2)
    if known.kind == "points":
        return np.asarray(np.linalg.norm(points[..., 1, :] - points[..., 0, :], axis=-1))
    middle = points.mean(axis=-2, keepdims=True)
    if known.kind == "height":
        normal = np.linalg.svd(np.nan_to_num(points - middle), full_matrices=False)[2][..., 2, :]
        place = views.places_m[..., views.index(known.names[0]), :] - middle[..., 0, :]
        return np.asarray(abs(np.sum(place * normal, -1)))
    assert known.places_m is not None
    true = known.places_m - known.places_m.mean(axis=0)
    return np.asarray(np.sqrt(np.sum((points - middle) ** 2, axis=(-1, -2)) / np.sum(true**2)))


def _point(nominal: Views, views: Views, before: Track, track: Track) -> Array:
    _, world, code = located(views, track, None, start_of(nominal, before))
    return np.where((code == 0)[..., None], world, np.nan)


def _over_positions(own: Array, places_m: Array) -> Array:
    """(...) places in the scene's unit over those in metres, by the similarity that fits: noise of the positions cancels to first
    order, which the mere ratio of their spreads would not do."""
    true = places_m - places_m.mean(axis=0)
    mine = own - own.mean(axis=-2, keepdims=True)
    u, d, v = np.linalg.svd(np.swapaxes(mine, -1, -2) @ true)
    sign = np.where(np.linalg.det(u @ v) < 0, -1.0, 1.0)
    return np.asarray(np.sum(mine**2, axis=(-1, -2)) / (d[..., 0] + d[..., 1] + sign * d[..., 2]))


@dataclass(frozen=True, eq=False)
class _Ratio:
    """The logarithm of what one thing says of the scale, and what it depends on.

    Attributes:
        log: ln(metres for a unit).
        by_numbers: (n,) its slopes by the numbers of the views' covariance.
        u_own: its deviation by the points set for it and by its places.
        u_length: its deviation by its size.
    """

    log: float
    by_numbers: Array
    u_own: float
    u_length: float


def _ratio(views: Views, known: Known) -> _Ratio:
    """Raises GeometryError where the thing has no size in the scene."""
    if not np.all(np.asarray(known.length.value) > 0):
        raise InputError(known.label or "length", float(known.length.value), "give a length above 0")
    rows = views.numbers_of(known.pictures)
    part = views.subset(known.pictures)
    size = float(size_in(part, part, known, known.tracks))
    if not size > 0:
        raise GeometryError(f"{known.label}: its points do not meet in front of the cameras; check them in each picture",
                            code=Reason.PARALLEL_RAYS.name.lower())  # fmt: skip
    nominal, step = part.nominal, np.sqrt(np.diag(part.covariance))
    moving = np.flatnonzero(step > 0)
    shifts = np.zeros((len(nominal), 2 * len(moving)))
    shifts[moving, np.arange(len(moving))], shifts[moving, len(moving) + np.arange(len(moving))] = (
        step[moving],
        -step[moving],
    )
    moved = part.moved({",".join(map(str, moving)): (nominal[:, None] + shifts)[moving]}) if len(moving) else part
    by_numbers = np.zeros(len(views.covariance))
    if len(moving):
        log = np.log(size_in(part, moved, known, known.tracks))
        slopes = (log[: len(moving)] - log[len(moving) :]) / (2 * step[moving])
        by_numbers[np.array(rows)[moving]] = -slopes
    own = math.hypot(_by_points(part, known, size), _by_places(known))
    length = float(known.length.value)
    return _Ratio(math.log(length / size), by_numbers, own, float(known.length.u) / length)


def positions_misfit(scene: Scene, known: Known) -> float:
    """How many times their u the positions of pictures are off the scene, where that is beyond chance; 1 else."""
    assert known.places_m is not None
    rows = [scene.names.index(name) for name in known.names]
    mine, true = (x - x.mean(axis=0) for x in (scene.centre[rows], known.places_m))
    u, d, v = np.linalg.svd(true.T @ mine)
    signs = np.array([1.0, 1.0, np.linalg.det(u @ v)])
    fitted = mine @ (u @ np.diag(signs) @ v).T * float(d @ signs) / float(np.sum(mine**2))
    sigma = np.maximum(np.broadcast_to(known.sigma_m, true.shape), 1e-9)
    freedom = max(3 * len(rows) - 7, 1)
    chi2 = float(np.sum(((fitted - true) / sigma) ** 2))
    spread = 2 / (9 * freedom)
    if chi2 <= freedom * (1 - spread + CHANCE_Z * math.sqrt(spread)) ** 3:  # Wilson and Hilferty's quantile of chi^2
        return 1.0
    return math.sqrt(chi2 / freedom)


def on_positions(scene: Scene, known: Known, frame: str) -> Scene:
    """A scene in metres turned and shifted onto the positions of its pictures, with their middle as its origin."""
    assert known.places_m is not None
    rows = [scene.names.index(name) for name in known.names]
    origin = known.places_m.mean(axis=0)
    mine = scene.centre[rows]
    u, _, v = np.linalg.svd((known.places_m - origin).T @ (mine - mine.mean(axis=0)))
    turn = u @ np.diag([1.0, 1.0, np.linalg.det(u @ v)]) @ v
    return scene.moved(np.asarray(turn), np.asarray(-turn @ mine.mean(axis=0)), frame, origin)


def _by_points(views: Views, known: Known, size: float) -> float:
    """Relative deviation of a size by the pixels of its points; each track is moved by itself."""
    total = 0.0
    for i, track in enumerate(known.tracks):
        for part in track.parts():
            root = np.diag(part.u) if part.u is not None else _root(part.cov)
            ends = part.value[:, None] + np.concatenate([root, -root], axis=1)
            tracks = [*known.tracks]
            tracks[i] = track.moved({part.key: ends})
            log = np.log(size_in(views, views, known, tracks) / size)
            total += float(np.sum(((log[: root.shape[1]] - log[root.shape[1] :]) / 2) ** 2))
    return math.sqrt(total)


def _root(cov: Array | None) -> Array:
    values, vectors = np.linalg.eigh(np.asarray(cov))
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0)))


def _by_places(known: Known) -> float:
    """Relative deviation of a size by its points' places in the thing, or by the stated positions."""
    if known.places_m is None:
        return 0.0
    true = known.places_m - known.places_m.mean(axis=0)
    return float(np.sqrt(np.sum((known.sigma_m * true) ** 2)) / np.sum(true**2))


def _joint(ratios: Sequence[_Ratio], known: Sequence[Known]) -> tuple[Array, Array]:
    """(k, k) covariance of the logarithms without what the places contribute, and (k, n) slopes by their numbers."""
    apart = np.diag([ratio.u_own**2 for ratio in ratios])
    for i, one in enumerate(known):
        for j, other in enumerate(known):
            if one.length.identity == other.length.identity:  # one tape, one print: one error
                apart[i, j] += ratios[i].u_length * ratios[j].u_length
    return apart, np.stack([ratio.by_numbers for ratio in ratios])


def scaled(scene: Scene, known: Sequence[Known]) -> Scaled:
    """The scene in metres.

    Args:
        scene: in its own unit, with the covariance of its places.
        known: things of known size; those that are kept apart check the result.

    Raises:
        InputError: nothing tells a scale.
        GeometryError: a known thing has no size in the scene.
    """
    used, checks = [one for one in known if not one.check], [one for one in known if one.check]
    if not used:
        raise InputError("scale", None, WHAT_TO_GIVE)
    views = replace(scene, u_scale=0.0, notes=()).views()
    ratios = [_ratio(views, one) for one in (*used, *checks)]
    apart, slopes = _joint(ratios, (*used, *checks))
    whole = apart + slopes @ views.covariance @ slopes.T
    n = len(used)
    logs = np.array([ratio.log for ratio in ratios])
    weights, chi2 = _weights(whole[:n, :n], logs[:n])
    log = float(weights @ logs[:n])
    widen, notes = _agreement(chi2, n - 1, used, logs[:n] - log)
    u_apart = math.sqrt(max(float(weights @ apart[:n, :n] @ weights), 0.0)) * widen
    factor, by_numbers = math.exp(log), weights @ slopes[:n]
    source = f"{', '.join(dict.fromkeys(one.label or one.kind for one in used))}"
    done = scene.scaled(factor, _metric_cov(scene, factor, by_numbers), u_apart, source)
    relative = math.hypot(u_apart, math.sqrt(max(float(by_numbers @ views.covariance @ by_numbers), 0.0)))
    said = _said(used, checks, logs, log, whole, weights)
    if relative > DOUBTFUL_SCALE:
        notes = (*notes, Note("scale_doubtful", f"the scale is known to {100 * relative:.2g} % (1s) only, and every length with it",
                              "give a longer distance, or more exact positions"))  # fmt: skip
    return Scaled(
        replace(done, notes=(*scene.notes, *notes)), factor, relative, said, _rms(said), (*notes, *_checked(said))
    )


def _weights(cov: Array, logs: Array) -> tuple[Array, float]:
    """Of the generalised mean, and the chi-square of the residuals."""
    inverse = np.linalg.pinv(cov, hermitian=True) if np.any(cov) else np.eye(len(cov))
    weights = inverse.sum(axis=0) / inverse.sum()
    left = logs - weights @ logs
    return weights, float(left @ inverse @ left)


def _agreement(chi2: float, freedom: int, used: Sequence[Known], left: Array) -> tuple[float, tuple[Note, ...]]:
    """How much to widen the scale's u, and a note where its sources contradict each other."""
    if freedom < 1:
        return 1.0, ()
    spread = 2 / (9 * freedom)
    if chi2 <= freedom * (1 - spread + CHANCE_Z * math.sqrt(spread)) ** 3:  # Wilson and Hilferty's quantile of chi^2
        return 1.0, ()
    worst = int(np.argmax(abs(left)))
    widen = math.sqrt(chi2 / freedom)
    which = used[worst].label or used[worst].kind
    text = (f"what is known of the scale does not fit together: {which} is off by {100 * left[worst]:+.2g} %; the u of the scale was "
            f"widened {widen:.2g} times")  # fmt: skip
    return widen, (Note("scales_disagree", text, "check that size, its points, and how well each is known"),)


def _said(
    used: Sequence[Known], checks: Sequence[Known], logs: Array, log: float, whole: Array, weights: Array
) -> tuple[Said, ...]:
    found = []
    n = len(used)
    for i, one in enumerate((*used, *checks)):
        length = float(one.length.value)
        row = np.zeros(len(logs))
        row[i] += 1.0
        row[:n] -= weights
        u = math.sqrt(max(float(row @ whole @ row), 0.0))
        found.append(Said(one.label or one.kind, one.kind, length, length * math.exp(log - logs[i]), u * length,
                          float(weights[i]) if i < n else 0.0, one.check))  # fmt: skip
    return tuple(found)


def _rms(said: Sequence[Said]) -> float | None:
    apart = [one.found_m - one.length_m for one in said if one.check]
    return math.sqrt(sum(d * d for d in apart) / len(apart)) if apart else None


def _checked(said: Sequence[Said]) -> tuple[Note, ...]:
    """A note for each check size that is off by more than it may."""
    found = []
    for one in said:
        apart = abs(one.found_m - one.length_m)
        if one.check and apart > 3 * one.u_m:
            text = (f"{one.label}: {one.found_m:.4g} m in the scene, {one.length_m:.4g} m as stated; they differ by "
                    f"{apart / max(one.u_m, 1e-300):.1f} times their u")  # fmt: skip
            found.append(
                Note("check_failed", text, "check its points and the scale; do not rely on the lengths until it fits")
            )
    return tuple(found)


def _metric_cov(scene: Scene, factor: float, by_numbers: Array) -> Array:
    """Of the numbers in metres: the scale moves with the places it was had from, C' = s (C - middle), ds = s (slopes . dC)."""
    assert scene.cov is not None
    jacobian = np.eye(len(scene.cov))
    middle = scene.centre.mean(axis=0)
    for i, centre in enumerate(scene.centre):
        rows = slice(6 * i + 3, 6 * i + 6)
        jacobian[rows] *= factor
        jacobian[rows] += factor * np.outer(centre - middle, by_numbers)
    found = jacobian @ scene.cov @ jacobian.T
    return np.asarray((found + found.T) / 2)
