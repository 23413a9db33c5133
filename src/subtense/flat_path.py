"""Paths in a plane: how long they are, what they enclose, what angle they make."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .arrays import Array, Codes


@dataclass(frozen=True)
class Length:
    """Arrays (...): the length along the path."""

    length_m: Array
    reason: Codes


@dataclass(frozen=True)
class Area:
    """Arrays (...): the area, and the length of its outline."""

    area_m2: Array
    outline_m: Array
    reason: Codes


@dataclass(frozen=True)
class Angle:
    """Arrays (...): the angle at the corner, 0 to pi."""

    angle_rad: Array
    reason: Codes


def path_length(places: Array, *, closed: bool = False) -> Array:
    """(...) length along (..., M, 2 or 3) points, in their unit."""
    step = np.diff(places, axis=-2, append=places[..., :1, :]) if closed else np.diff(places, axis=-2)
    return np.asarray(np.sqrt(np.sum(step**2, -1)).sum(axis=-1))


def enclosed_area(places: Array) -> Array:
    """(...) area inside the outline (..., M, 2 or 3), in its unit squared: the shoelace formula."""
    from_first = places - places[..., :1, :]
    one, other = from_first, np.roll(from_first, -1, axis=-2)
    if places.shape[-1] == 2:
        return np.asarray(abs(np.sum(one[..., 0] * other[..., 1] - one[..., 1] * other[..., 0], -1)) / 2)
    whole = np.cross(one, other).sum(axis=-2)
    return np.asarray(np.sqrt(np.sum(whole**2, -1)) / 2)


def angle_between(one: Array, other: Array) -> Array:
    """(...) angle between vectors (..., 2 or 3), 0 to pi rad."""
    if one.shape[-1] == 2:
        across = abs(one[..., 0] * other[..., 1] - one[..., 1] * other[..., 0])
    else:
        across = np.sqrt(np.sum(np.cross(one, other) ** 2, -1))
    return np.asarray(np.arctan2(across, np.sum(one * other, -1)))


def crosses(points: Array) -> bool:
    """Whether any two sides of a closed outline (M, 2) cross."""
    ends = np.roll(points, -1, axis=0)
    edge = ends - points

    def side(i: int, p: Array) -> Array:
        return np.asarray(edge[i, 0] * (p[..., 1] - points[i, 1]) - edge[i, 1] * (p[..., 0] - points[i, 0]))

    n = len(points)
    for i in range(n):
        for j in range(i + 2, n - (i == 0)):
            if side(i, points[j]) * side(i, ends[j]) < 0 and side(j, points[i]) * side(j, ends[i]) < 0:
                return True
    return False
