"""Quadrilaterals of a picture: straight segments, joined where they lie on one line, and rings of four of them.

A ring's corners are where neighbouring lines meet, which need not be seen: something may lie over them, and cards have them
rounded. Nothing is said here of what a quadrilateral is.

Source: the segments are those of R. Grompone von Gioi, J. Jakubowicz, J.-M. Morel, G. Randall, LSD, IPOL 2012.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .arrays import Array, Bools, Pixels

MOST_SEGMENTS = 900
MOST_LINES = 1200
MOST_MIXED = 140
"""Lines where sides may be lighter or darker than their ground, each for itself: there are eight times as many rings."""
LEAST_SIDE_PX = 12.0
SHORTEST_PX = 9.0
ALIKE = math.radians(2.5)
"""Segments that differ by less in direction may be of one line."""
BESIDE_PX = 1.6
JUMPS = (0.8, 2.0)
"""Of the longer segment: a gap that two segments of a line may have between them; each makes lines of its own."""
BEYOND = 0.45
"""Of a line's length: how far from its end a corner may lie."""
BEFORE = 0.12
"""Of a line's length: how far before its end a corner may lie."""
LEAST_TURN = math.radians(28.0)
LEAST_COVERED = 0.25
LEAST_MEAN_COVERED = 0.55
_MOST_RINGS = 100_000


@dataclass(frozen=True, eq=False)
class Rough:
    """A quadrilateral as found.

    Attributes:
        corners_px: (4, 2) clockwise as seen.
        covered: mean share of its sides on which segments were seen.
        light: whether it is lighter than what is around it; None where its sides differ.
    """

    corners_px: Array
    covered: float
    light: bool | None

    @property
    def weight(self) -> float:
        """For an order: what is mostly seen, and of that the larger, which chance makes less often."""
        return float(self.covered**2 * self.area**0.25)

    @property
    def area(self) -> float:
        """Square pixels."""
        x, y = self.corners_px.T
        return float(abs(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))) / 2)


def straight_lines(gray: Pixels) -> Array:
    """(L, 2, 2) ends of straight lines in a picture, longest first; the light is on the same side of all.

    Args:
        gray: (H, W) uint8.
    """
    return _lines(_segments(gray)) if min(gray.shape) >= 16 else np.zeros((0, 2, 2))


def quads(lines: Array, *, least_side_px: float = LEAST_SIDE_PX, mixed: bool = False) -> list[Rough]:
    """Quadrilaterals with their sides mostly seen, best seen first.

    Args:
        lines: (L, 2, 2) of `straight_lines`.
        least_side_px: shorter sides are left out.
        mixed: whether some sides may be lighter and some darker than what is beside them; else all are alike.
    """
    if len(lines) < 4:
        return []
    rings = _rings(lines[:MOST_MIXED]) if mixed else _rings_of_one_kind(lines)
    return sorted(_roughs(lines, rings, least_side_px, mixed=mixed), key=lambda one: -one.weight)


def distinct(found: Sequence[Rough], apart_px: float) -> list[Rough]:
    """Those whose corners differ from all better ones by more than `apart_px` somewhere."""
    kept: list[Rough] = []
    places = np.zeros((0, 4, 2))
    for one in found:
        turned = np.stack([np.roll(one.corners_px, k, axis=0) for k in range(4)])
        apart = np.abs(places[:, None] - turned[None]).max(axis=(2, 3))
        if not len(kept) or apart.min() > apart_px:
            kept.append(one)
            places = np.concatenate([places, one.corners_px[None]])
    return kept


def _segments(gray: Pixels) -> Array:
    """(N, 2, 2) ends of straight segments, longest first; the light is on the same side of all, as seen from the first end."""
    import cv2

    found = cv2.createLineSegmentDetector(cv2.LSD_REFINE_STD).detect(np.ascontiguousarray(gray))[0]
    if found is None:
        return np.zeros((0, 2, 2))
    ends = np.asarray(found, float).reshape(-1, 2, 2)
    length = np.hypot(*(ends[:, 1] - ends[:, 0]).T)
    order = np.argsort(-length)
    return np.asarray(ends[order[length[order] >= 0.6 * SHORTEST_PX]][:MOST_SEGMENTS])


def _lines(segments: Array) -> Array:
    """(L, 2, 2) ends of lines, longest first; the parts of a joined line are lines too."""
    grown = (tuple(_grown(segments, i, jump)) for jump in JUMPS for i in range(len(segments)))
    groups = [list(group) for group in dict.fromkeys(grown) if len(group) > 1]
    single = [[i] for i in range(len(segments))]
    every = np.array([_span(segments, group) for group in (*groups, *single)]).reshape(-1, 2, 2)
    length = np.hypot(*(every[:, 1] - every[:, 0]).T)
    order = np.argsort(-length)
    return np.asarray(every[order[length[order] >= SHORTEST_PX]][:MOST_LINES])


def _grown(segments: Array, seed: int, jump: float) -> list[int]:
    """The seed and what lies on its line without too long a gap."""
    a, b = segments[seed]
    group = [seed]
    for _ in range(3):
        length = float(np.hypot(*(b - a)))
        along = (b - a) / length
        across = np.array([-along[1], along[0]])
        off = (segments - a) @ across
        place = (segments - a) @ along
        own = segments[:, 1] - segments[:, 0]
        turn = np.where(own @ along > 0, abs(own @ across) / np.maximum(np.hypot(*own.T), 1e-9), np.inf)
        gap = np.maximum(place.min(axis=1) - length, -place.max(axis=1))
        near = (
            (np.abs(off).max(axis=1) < BESIDE_PX + 0.006 * length)
            & (turn < math.sin(2 * ALIKE))
            & (gap < max(12.0, jump * length))
        )
        new = sorted({seed, *np.flatnonzero(near).tolist()})
        if new == group:
            break
        group = new
        a, b = _span(segments, group)
    return group


def _span(segments: Array, group: list[int]) -> tuple[Array, Array]:
    """The ends of the line through segments, weighted by their lengths."""
    ends = segments[group]
    if len(group) == 1:
        return ends[0, 0], ends[0, 1]
    weight = np.repeat(np.hypot(*(ends[:, 1] - ends[:, 0]).T), 2)
    points = ends.reshape(-1, 2)
    middle = np.average(points, axis=0, weights=weight)
    spread = (points - middle).T @ ((points - middle) * weight[:, None])
    along = np.linalg.eigh(spread)[1][:, 1]
    along = along if along @ (ends[0, 1] - ends[0, 0]) > 0 else -along
    place = (points - middle) @ along
    return middle + place.min() * along, middle + place.max() * along


def _rings_of_one_kind(lines: Array) -> Array:
    """(R, 4) lines, each from its end on to the start of the next: the light is within all of them, or beyond all."""
    place, turned, length = _places(lines)
    at_end = turned & _near_end(place, length, last=True) & _near_end(place, length, last=False).T
    after = [np.flatnonzero(row) for row in at_end]
    found: list[tuple[int, int, int, int]] = []
    for i in range(len(lines)):
        before = at_end[:, i]
        for j in after[i][after[i] > i]:
            for k in after[j][after[j] > i]:
                last = after[k][before[after[k]]]
                found += [(i, int(j), int(k), int(m)) for m in last if m > i and m != j]
        if len(found) >= _MOST_RINGS:
            break
    return np.array(found, int).reshape(-1, 4)


def _rings(lines: Array) -> Array:
    """(R, 4) lines, each joined by its two ends to the one before and the one after."""
    joined = _joined(lines)
    after = [[np.flatnonzero(joined[i, e].any(axis=1)) for e in (0, 1)] for i in range(len(lines))]
    found: list[tuple[int, int, int, int]] = []
    for i in range(len(lines)):
        for j in after[i][1]:
            if j < i:
                continue
            for f in np.flatnonzero(joined[i, 1, j]):
                for k in after[j][1 - f]:
                    if k <= i or k == j:
                        continue
                    for g in np.flatnonzero(joined[j, 1 - f, k]):
                        for last in after[k][1 - g]:
                            if last <= i or last in (j, k):
                                continue
                            for h in np.flatnonzero(joined[k, 1 - g, last]):
                                if joined[last, 1 - h, i, 0]:
                                    found.append((i, int(j), int(k), int(last)))
                                    if len(found) >= _MOST_RINGS:
                                        return np.array(found, int)
    return np.array(found, int).reshape(-1, 4)


def _joined(lines: Array) -> Bools:
    """(L, 2, L, 2) whether end e of line i meets end f of line j in a corner."""
    place, turned, length = _places(lines)
    at_end = np.stack([_near_end(place, length, last=last) for last in (False, True)], 1)
    return np.asarray(turned[:, None, :, None] & at_end[:, :, :, None] & at_end.transpose(2, 0, 1)[:, None])


def _places(lines: Array) -> tuple[Array, Bools, Array]:
    """(L, L) where along line i it meets line j, whether the two stand at an angle, and (L,) their lengths."""
    start, step = lines[:, 0], lines[:, 1] - lines[:, 0]
    length = np.hypot(*step.T)
    along = step / length[:, None]
    cross = along[:, None, 0] * along[None, :, 1] - along[:, None, 1] * along[None, :, 0]
    turned = abs(cross) > math.sin(LEAST_TURN)
    apart = start[None, :] - start[:, None]
    place = (apart[..., 0] * along[None, :, 1] - apart[..., 1] * along[None, :, 0]) / np.where(turned, cross, 1.0)
    return place, turned, length


def _near_end(place: Array, length: Array, *, last: bool) -> Bools:
    """(L, L) whether a meeting point is at the last (or first) end of line i."""
    beyond, before, end = (BEYOND * length + 5.0)[:, None], (BEFORE * length + 3.0)[:, None], length[:, None]
    if last:
        return (place > end - before) & (place < end + beyond)
    return (place > -beyond) & (place < before)


def _roughs(lines: Array, rings: Array, least: float, *, mixed: bool) -> list[Rough]:
    """The rings that are convex, large enough, and mostly seen."""
    if not len(rings):
        return []
    four = lines[rings]
    corners = np.stack([_cross(four[:, i - 1], four[:, i]) for i in range(4)], 1)
    edge = np.roll(corners, -1, axis=1) - corners
    following = np.roll(edge, -1, axis=1)
    turn = edge[..., 0] * following[..., 1] - edge[..., 1] * following[..., 0]
    sides = np.hypot(edge[..., 0], edge[..., 1])
    with np.errstate(invalid="ignore", divide="ignore"):
        along = edge / sides[..., None]
        place = np.sort(np.sum((four - corners[:, :, None]) * along[:, :, None], -1), axis=-1)
        covered = (np.minimum(place[..., 1], sides) - np.maximum(place[..., 0], 0.0)).clip(0.0) / sides
        good = (np.all(turn > 0, axis=1) | np.all(turn < 0, axis=1)) & (sides.min(axis=1) >= least)
        good &= (covered.min(axis=1) >= LEAST_COVERED) & (covered.mean(axis=1) >= LEAST_MEAN_COVERED)
    good &= np.isfinite(corners).all(axis=(1, 2))
    out = []
    for ring in np.flatnonzero(good):
        clockwise = bool(turn[ring, 0] > 0)
        light = None if mixed else not clockwise  # segments have the light on their left
        out.append(Rough(corners[ring] if clockwise else corners[ring, ::-1], float(covered[ring].mean()), light))
    return out


def _cross(one: Array, other: Array) -> Array:
    """(R, 2) where lines (R, 2, 2) meet."""
    d, e, apart = one[:, 1] - one[:, 0], other[:, 1] - other[:, 0], other[:, 0] - one[:, 0]
    den = d[:, 0] * e[:, 1] - d[:, 1] * e[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(one[:, 0] + ((apart[:, 0] * e[:, 1] - apart[:, 1] * e[:, 0]) / den)[:, None] * d)
