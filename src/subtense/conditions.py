"""Conditions on lengths and angles in a plane, and the plane that meets them.

Without a camera a plane's picture is undone, but for a turn and a shift, by five numbers: X = A x / (1 + l . x),
A = ((e^(s+a), e^s k), (0, e^(s-a))). With one, viewing directions r meet the plane at e^s r / (1 + l . x): three numbers s, l.
x are picture coordinates about the middle of the points, in units of their spread. Without a known length s stays 0.
Each condition is one equation: the angle between parallels, the cosine of a right angle, the logarithm of a ratio of lengths, is 0.

Source: R. Hartley, A. Zisserman, Multiple View Geometry, 2.7 (affine and metric rectification); D. Liebowitz, A. Zisserman,
Metric rectification for perspective images of planes, CVPR 1998.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from .arrays import Array, Bools, Indices
from .errors import InputError
from .homography import Frame

KINDS = {
    "parallel": (4,),
    "right": (3, 4),
    "equal": (4,),
    "length": (2,),
    "second": (2,),
    "third": (2,),
    "rectangle": (4,),
    "square": (4,),
}
"""Kinds of conditions, and how many points each names."""
KNOWN = ("length", "second", "third")
"""Conditions on a length that is stated."""
WORDS = {"parallel": "parallel lines", "right": "right angle", "equal": "equal lengths",
         "length": "known length", "second": "second known length", "third": "third known length"}  # fmt: skip
MOST = 40
HOW = ("write them as 'rectangle 1 2 3 4; length 1 2', with square 1 2 3 4, parallel 1 2 4 3, right 1 2 3 (its corner in the "
       "middle), right 1 2 3 4 (of two lines), equal 1 2 3 4, and length, second or third with two points")  # fmt: skip


@dataclass(frozen=True)
class Condition:
    """One equation.

    Attributes:
        kind: parallel, right, equal, or one of KNOWN.
        points: indices from 0: the ends of one line, and of the other where there are two.
    """

    kind: str
    points: tuple[int, ...]


@dataclass(frozen=True)
class Conditions:
    """What holds in a plane.

    Attributes:
        each: the equations.
        quads: indices of the corners of each rectangle that was named.
    """

    each: tuple[Condition, ...]
    quads: tuple[tuple[int, ...], ...] = ()

    @property
    def scaled(self) -> bool:
        """Whether a length is known."""
        return any(one.kind in KNOWN for one in self.each)

    def needed(self, *, camera: bool) -> int:
        """How many numbers the conditions have to tell."""
        return (2 if camera else 4) + self.scaled

    @cached_property
    def told(self) -> Indices:
        """Indices of the points that conditions name."""
        return np.unique([p for one in self.each for p in one.points])

    @cached_property
    def groups(self) -> tuple[tuple[str, Indices, Indices], ...]:
        """For each kind its rows in `each`, and (k, 4) indices of points."""
        found = []
        for kind in dict.fromkeys(one.kind for one in self.each):
            rows = np.array([i for i, one in enumerate(self.each) if one.kind == kind])
            found.append((kind, rows, np.array([(*self.each[i].points, *self.each[i].points)[:4] for i in rows])))
        return tuple(found)

    @cached_property
    def order(self) -> Indices:
        """(C,) where each of `each` stands among the groups' rows."""
        return np.argsort(np.concatenate([rows for _, rows, _ in self.groups]))


@lru_cache(maxsize=64)
def read_conditions(text: str, count: int) -> Conditions:
    """The conditions of a text; a rectangle is two pairs of parallels and a right angle, a square has equal sides too.

    Args:
        text: as in HOW; points are counted from 1.
        count: how many points there are.

    Raises:
        InputError: another text, or a point that is not there.
    """
    found: list[Condition] = []
    quads = []
    for part in re.split(r"[;\n]", text):
        words = re.split(r"[\s,]+", part.strip())
        if words == [""]:
            continue
        kind, points = words[0].lower(), _numbers(part, words[1:], count)
        if kind not in KINDS or len(points) not in KINDS[kind]:
            raise InputError("conditions", part.strip(), HOW)
        _check_sides(part.strip(), kind, points)
        if kind in ("rectangle", "square"):
            a, b, c, d = points
            quads.append(points)
            found += [
                Condition("parallel", (a, b, d, c)),
                Condition("parallel", (b, c, a, d)),
                Condition("right", (b, a, b, c)),
            ]
            found += [Condition("equal", (a, b, b, c))] if kind == "square" else []
        elif kind == "right" and len(points) == 3:
            found.append(Condition(kind, (points[1], points[0], points[1], points[2])))
        else:
            found.append(Condition(kind, points))
    if not found or len(found) > MOST:
        raise InputError("conditions", f"{len(found)} of them", HOW if not found else f"give at most {MOST}")
    return Conditions(tuple(found), tuple(quads))


def _numbers(part: str, words: Sequence[str], count: int) -> tuple[int, ...]:
    """Indices from 0 of the points that a condition names."""
    if not all(word.isascii() and word.isdecimal() for word in words):
        raise InputError("conditions", part.strip(), HOW)
    points = tuple(int(word[:6]) - 1 for word in words)
    if not all(0 <= p < count for p in points):
        raise InputError("conditions", part.strip(), f"points are counted from 1 to {count}")
    return points


def _check_sides(part: str, kind: str, points: tuple[int, ...]) -> None:
    """No side may end where it starts, no two sides of a condition may be the same."""
    if kind in ("rectangle", "square") or len(points) == 3:
        fine = len(set(points)) == len(points)
    else:
        sides = [frozenset(points[i : i + 2]) for i in range(0, len(points), 2)]
        fine = all(len(side) == 2 for side in sides) and len(set(sides)) == len(sides)
    if not fine:
        raise InputError("conditions", part, "name two different points for each side, and each side once")


@dataclass(frozen=True, eq=False)
class Rectified:
    """How numbers say where points are in the plane.

    Attributes:
        conditions: that hold there.
        frame: of picture coordinates.
        camera: whether these are slopes of viewing directions.
    """

    conditions: Conditions
    frame: Frame
    camera: bool

    @property
    def count(self) -> int:
        """How many numbers there are: s (with a known length), then a, k (without a camera), then l."""
        return self.conditions.needed(camera=self.camera)

    def _parts(self, numbers: Array) -> tuple[Array, Array, Array]:
        """(..., 1) e^s, (..., 2) a and k, (..., 2) l."""
        scale = np.exp(numbers[..., :1]) if self.conditions.scaled else np.ones((*numbers.shape[:-1], 1))
        shape = np.zeros((*numbers.shape[:-1], 2)) if self.camera else numbers[..., -4:-2]
        return scale, shape, numbers[..., -2:]

    def places(self, numbers: Array, flat: Array) -> tuple[Array, Bools]:
        """(..., N, 2 or 3) places of points, m with a known length, and (...) whether all are before the plane's horizon.

        Args:
            numbers: (..., P).
            flat: (..., N, 2) picture coordinates.
        """
        scale, shape, horizon = self._parts(numbers)
        x = self.frame.enter(flat)
        with np.errstate(all="ignore"):
            along = 1 + x[..., 0] * horizon[..., :1] + x[..., 1] * horizon[..., 1:]
            by = scale / along
            if self.camera:
                one = np.broadcast_to(1.0, flat.shape[:-1])
                places = np.stack(np.broadcast_arrays(flat[..., 0] * by, flat[..., 1] * by, one * by), -1)
            else:
                wide, skew = np.exp(shape[..., :1]), shape[..., 1:]
                first = (wide * x[..., 0] + skew * x[..., 1]) * by
                places = np.stack(np.broadcast_arrays(first, x[..., 1] * by / wide), -1)
        return places, np.asarray(np.all(along > 0, axis=-1))

    def normal(self, numbers: Array) -> Array:
        """(..., 3) towards the far side of the plane; (0, 0, 1) without a camera."""
        if not self.camera:
            return np.broadcast_to(np.array([0.0, 0, 1]), (*numbers.shape[:-1], 3))
        horizon = numbers[..., -2:] / self.frame.scale
        third = 1 - np.sum(horizon * self.frame.middle, -1, keepdims=True)
        whole = np.concatenate([horizon, third], -1)
        return np.asarray(whole / np.sqrt(np.sum(whole**2, -1, keepdims=True)))

    def off(self, numbers: Array, flat: Array, known: Sequence[Array]) -> Array:
        """(..., C) by how much each condition is not met.

        Args:
            numbers: (..., P).
            flat: (..., N, 2) picture coordinates.
            known: the stated lengths in the order of KNOWN, each (...).
        """
        places, _ = self.places(numbers, flat)
        normal = self.normal(numbers)
        found = []
        with np.errstate(all="ignore"):
            for kind, _, points in self.conditions.groups:
                u = places[..., points[:, 1], :] - places[..., points[:, 0], :]
                if kind in KNOWN:
                    stated = np.asarray(known[KNOWN.index(kind)])[..., None]
                    found.append(0.5 * np.log(np.sum(u * u, -1)) - np.log(stated))
                    continue
                v = places[..., points[:, 3], :] - places[..., points[:, 2], :]
                found.append(_between(kind, u, v, normal))
        lead = np.broadcast_shapes(*(one.shape[:-1] for one in found))
        joined = [np.broadcast_to(one, (*lead, one.shape[-1])) for one in found]
        return np.asarray(np.concatenate(joined, -1)[..., self.conditions.order])

    def slopes(self, numbers: Array, flat: Array, known: Sequence[Array]) -> Array:
        """(..., C, P) of `off` by the numbers, by central differences."""
        step = 1e-6 * np.eye(self.count)
        both = np.concatenate([numbers[..., None, :] + step, numbers[..., None, :] - step], -2)
        beside = [np.asarray(one)[..., None] for one in known]
        up, down = np.split(self.off(both, flat[..., None, :, :], beside), 2, axis=-2)
        return np.asarray(np.swapaxes((up - down) / 2e-6, -1, -2))


def _between(kind: str, u: Array, v: Array, normal: Array) -> Array:
    """(..., k) by how much sides u and v are not parallel, at right angles, or equal."""
    if kind == "equal":
        return np.asarray(0.5 * np.log(np.sum(u * u, -1) / np.sum(v * v, -1)))
    dot = np.sum(u * v, -1)
    if kind == "right":
        return np.asarray(dot / np.sqrt(np.sum(u * u, -1) * np.sum(v * v, -1)))
    if u.shape[-1] == 2:
        cross = u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]
    else:
        cross = np.sum(normal[..., None, :] * np.cross(u, v), -1)
    # lines have no direction: opposite ones are as parallel
    angle = np.arctan2(cross, dot)
    return np.asarray(angle - np.pi * np.round(angle / np.pi))
