"""Numbers on their way out: every digit, and such that the reader's arithmetic gives back what was there."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence

from ..camera import Camera


def undone(wanted: float, guess: float, reads: Callable[[float], float]) -> float:
    """The number near `guess` that reads as `wanted`; of several the shortest, and `guess` where none does."""
    near, up, down = [guess], guess, guess
    for _ in range(3):
        up, down = math.nextafter(up, math.inf), math.nextafter(down, -math.inf)
        near += [up, down]
    return min((x for x in near if reads(x) == wanted), key=lambda x: len(repr(x)), default=guess)


def focal_px(camera: Camera) -> tuple[float, float]:
    """fx and fy; fy such that fy / fx is the camera's aspect to the last digit, wherever there is such a number."""
    f, aspect = float(camera.f_px), float(camera.aspect)
    return f, undone(aspect, f * aspect, lambda fy: fy / f)


def moved_centre_px(camera: Camera, offset: float) -> tuple[float, float]:
    """The principal point in pixels that begin at `offset` where ours begin at 0."""
    x, y = (undone(float(c), float(c) + offset, lambda v: v - offset) for c in (camera.cx_px, camera.cy_px))
    return x, y


def shortened(k: Iterable[float], counts: Sequence[int]) -> list[float] | None:
    """Coefficients as one of these numbers of them: as many as there are, else the fewest that hold all but zeros."""
    k = [float(c) for c in k]
    if len(k) in counts:
        return k
    needed = max((i + 1 for i, c in enumerate(k) if c != 0), default=0)
    count = min((n for n in counts if n >= needed), default=None)
    return None if count is None else (k + [0.0] * count)[:count]
