"""Quadrilaterals of a picture: straight segments, joined where they lie on one line, and rings of four of them.

A ring's corners are where neighbouring lines meet, which need not be seen: something may lie over them, and cards have them
rounded. Nothing is said here of what a quadrilateral is.

Source: the segments are those of R. Grompone von Gioi, J. Jakubowicz, J.-M. Morel, G. Randall, LSD, IPOL 2012.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .arrays import Array, Pixels

MOST_SEGMENTS = 900
MOST_LINES = 400
MOST_MIXED = 140
"""Lines where sides may be lighter or darker than their ground, each for itself: there are eight times as many rings."""
SHORTEST_PX = 9.0
ALIKE = math.radians(2.5)
"""Segments that differ by less in direction may be of one line."""
BESIDE_PX = 1.6
JUMP = 0.8
"""Of the longer segment: a gap that two segments of a line may have between them."""
BEYOND = 0.45
"""Of a line's length: how far from its end a corner may lie."""
BEFORE = 0.12
"""Of a line's length: how far before its end a corner may lie."""
LEAST_TURN = math.radians(28.0)
LEAST_COVERED = 0.25
LEAST_MEAN_COVERED = 0.55
_MOST_RINGS = 30_000


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
    def area(self) -> float:
        """Square pixels."""
        x, y = self.corners_px.T
        return float(abs(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))) / 2)


def quads(gray: Pixels, *, least_side_px: float = 12.0, mixed: bool = False) -> list[Rough]:
    """Quadrilaterals with their sides mostly seen, best covered first.

    Args:
        gray: (H, W) uint8.
        least_side_px: shorter sides are left out.
        mixed: whether some sides may be lighter and some darker than what is beside them; else all are alike.
    """
    if min(gray.shape) < 16:
        return []
    lines = _lines(_segments(gray))
    if len(lines) < 4:
        return []
    rings = _rings(lines[:MOST_MIXED]) if mixed else _rings_of_one_kind(lines)
    found = [_rough(lines, ring, least_side_px, mixed=mixed) for ring in rings]
    return sorted((one for one in found if one is not None), key=lambda one: -one.covered)


def distinct(found: list[Rough], apart_px: float) -> list[Rough]:
    """Those whose corners differ from all better ones by more than `apart_px` somewhere."""
    kept: list[Rough] = []
    for one in found:
        turned = [np.roll(one.corners_px, k, axis=0) for k in range(4)]
        if all(min(np.abs(t - other.corners_px).max() for t in turned) > apart_px for other in kept):
            kept.append(one)
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
    groups: list[list[int]] = []
    used: set[int] = set()
    for i in range(len(segments)):
        group = _grown(segments, i)
        if len(group) > 1 and not set(group) <= used:
            groups.append(group)
            used |= set(group)
    single = [[i] for i in range(len(segments))]
    every = np.array([_span(segments, group) for group in (*groups, *single)]).reshape(-1, 2, 2)
    length = np.hypot(*(every[:, 1] - every[:, 0]).T)
    order = np.argsort(-length)
    return np.asarray(every[order[length[order] >= SHORTEST_PX]][:MOST_LINES])


def _grown(segments: Array, seed: int) -> list[int]:
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
            & (gap < max(12.0, JUMP * length))
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


def _rings_of_one_kind(lines: Array) -> list[tuple[int, int, int, int]]:
    """Four lines, each from its end on to the start of the next: the light is within all of them, or beyond all."""
    joined = _joined(lines)[:, 1, :, 0]
    after = [np.flatnonzero(row) for row in joined]
    found: list[tuple[int, int, int, int]] = []
    for i in range(len(lines)):
        for j in after[i][after[i] > i]:
            for k in after[j][(after[j] > i) & (after[j] != j)]:
                last = np.flatnonzero(joined[k] & joined[:, i])
                found += [(i, int(j), int(k), int(m)) for m in last if m > i and m not in (j, k)]
        if len(found) >= _MOST_RINGS:
            break
    return found


def _rings(lines: Array) -> list[tuple[int, int, int, int]]:
    """Four lines, each joined by its two ends to the one before and the one after."""
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
                                        return found
    return found


def _joined(lines: Array) -> Array:
    """(L, 2, L, 2) whether end e of line i meets end f of line j in a corner."""
    start, step = lines[:, 0], lines[:, 1] - lines[:, 0]
    length = np.hypot(*step.T)
    along = step / length[:, None]
    cross = along[:, None, 0] * along[None, :, 1] - along[:, None, 1] * along[None, :, 0]
    turned = abs(cross) > math.sin(LEAST_TURN)
    safe = np.where(turned, cross, 1.0)
    apart = start[None, :] - start[:, None]
    place = (apart[..., 0] * along[None, :, 1] - apart[..., 1] * along[None, :, 0]) / safe  # along i, from its start
    beyond, before = BEYOND * length + 5.0, BEFORE * length + 3.0
    at_end = np.stack(
        [(place > -beyond[:, None]) & (place < before[:, None]),
         (place > (length - before)[:, None]) & (place < (length + beyond)[:, None])], 1
    )  # fmt: skip
    return np.asarray(turned[:, None, :, None] & at_end[:, :, :, None] & at_end.transpose(2, 0, 1)[:, None])


def _rough(lines: Array, ring: tuple[int, ...], least: float, *, mixed: bool) -> Rough | None:
    four = lines[list(ring)]
    corners = np.array([_cross(four[i - 1], four[i]) for i in range(4)])
    if not np.all(np.isfinite(corners)):
        return None
    edge = np.roll(corners, -1, axis=0) - corners
    following = np.roll(edge, -1, axis=0)
    turn = edge[:, 0] * following[:, 1] - edge[:, 1] * following[:, 0]
    sides = np.hypot(*edge.T)
    if not (np.all(turn > 0) or np.all(turn < 0)) or sides.min() < least:
        return None
    covered = []
    for i in range(4):
        along = edge[i] / sides[i]
        place = np.sort((four[i] - corners[i]) @ along)
        covered.append(max(0.0, min(place[1], sides[i]) - max(place[0], 0.0)) / sides[i])
    if min(covered) < LEAST_COVERED or np.mean(covered) < LEAST_MEAN_COVERED:
        return None
    light = None if mixed else bool(turn[0] < 0)  # segments have the light on their left
    return Rough(corners if turn[0] > 0 else corners[::-1], float(np.mean(covered)), light)


def _cross(one: Array, other: Array) -> Array:
    d, e = one[1] - one[0], other[1] - other[0]
    den = d[0] * e[1] - d[1] * e[0]
    if abs(den) < 1e-9:
        return np.full(2, np.nan)
    apart = other[0] - one[0]
    return np.asarray(one[0] + (apart[0] * e[1] - apart[1] * e[0]) / den * d)
