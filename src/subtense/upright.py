"""What the methods over a plane share: the upright direction and the horizon of a nominal scene, and of moved ones.

Coordinates are slopes of viewing directions with a camera, else pixels about the picture's middle in half diagonals, without the lens's
distortion.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .arrays import Array, Bools
from .camera import Camera
from .errors import InputError
from .flat_view import MOST_POINTS, Disc, straight_view
from .homography import covariance_by
from .observation import Observation
from .quantity import Note, Quantity
from .vanishing import misses, vanishing_point, weights_of

MISFIT = 4.0
"""Standard deviations beyond which a line that misses its vanishing point is no chance."""


@dataclass(frozen=True, eq=False)
class Lines:
    """How the lines of a nominal scene are weighted.

    Attributes:
        disc: of the picture.
        verticals: (K,) weights.
        parallels: (K,) weights of one level direction; None where it was not marked.
        others: (K,) of another one.
    """

    disc: Disc
    verticals: Array
    parallels: Array | None = None
    others: Array | None = None


def check_lines(name: str, lines: Observation | None) -> None:
    """Pairs of points, two lines or more.

    Raises:
        InputError: they are not.
    """
    if lines is None:
        return
    count = lines.points_px.shape[-2]
    if count < 4 or count % 2:
        raise InputError(name, f"{count} points", "give two points of each line, and two lines or more")
    if count > MOST_POINTS:
        raise InputError(name, f"{count} points", f"give {MOST_POINTS // 2} lines at most; more tell nothing more")


def view(camera: Camera | None, points: Observation, distortion: Quantity, disc: Disc) -> Array:
    """(..., N, 2) coordinates of points; see the module."""
    seen = straight_view(camera, points.points_px, distortion, disc)
    return seen if camera is not None else np.asarray((seen - disc.middle_px) / disc.radius_px)


def line_weights(camera: Camera | None, lines: Observation | None, distortion: Quantity, disc: Disc) -> Array | None:
    """(K,) weights of the lines of one direction."""
    if lines is None:
        return None
    u = lines.standard_deviations.reshape(-1, 2)
    return weights_of(view(camera, lines, distortion, disc), np.hypot(u[:, 0], u[:, 1]))


def horizon_of(
    camera: Camera | None, upright: Array, horizon: Observation | None, parallels: Observation | None, others: Observation | None,
    distortion: Quantity, lines: Lines,
) -> tuple[Array, Bools]:  # fmt: skip
    """(..., 3) the plane's horizon as a line, and (...) whether there is none: by what was marked, else by the camera.

    With a camera the horizon of all planes across a direction is that direction itself, in slopes.
    """
    if horizon is not None:
        ends = view(camera, horizon, distortion, lines.disc)
        one, other = (np.concatenate([ends[..., i, :], np.ones((*ends.shape[:-2], 1))], -1) for i in (0, 1))
        line = np.cross(one, other)
        return line, np.asarray(~(np.sum(line**2, -1) > 0))
    if parallels is not None and others is not None:
        assert lines.parallels is not None and lines.others is not None
        one, lost = vanishing_point(view(camera, parallels, distortion, lines.disc), lines.parallels)
        other, gone = vanishing_point(view(camera, others, distortion, lines.disc), lines.others)
        line = np.cross(one, other)
        return line, np.asarray(lost | gone | ~(np.sum(line**2, -1) > 1e-20))
    return upright, np.zeros(upright.shape[:-1], bool)


def line_notes(
    name: str,
    camera: Camera | None,
    lines: Observation | None,
    distortion: Quantity,
    weighted: Array | None,
    disc: Disc,
) -> list[Note]:
    """`lines_misfit` where lines of one direction do not meet, as far as there are more than two."""
    if lines is None or weighted is None or lines.points_px.shape[-2] < 6:
        return []

    def off(c: Camera | None, seen: Observation, d: Quantity) -> Array:
        points = view(c, seen, d, disc)
        return misses(points, vanishing_point(points, weighted)[0])

    nominal = off(camera, lines, distortion)
    cov = covariance_by((camera, lines, distortion), off, len(nominal))
    # its rank is less by two, so only what stands out of its own deviation counts
    u = np.sqrt(np.maximum(np.diag(cov), 1e-18))
    worst = int(np.argmax(abs(nominal) / u))
    times = float(abs(nominal[worst]) / u[worst])
    if times <= MISFIT or not math.isfinite(times):
        return []
    return [Note("lines_misfit", f"the {name} do not meet in one point: line {worst + 1} is off by {times:.2g} times what is stated of "
                 "it, and the interval is too narrow", f"look at line {worst + 1} of the {name} again")]  # fmt: skip


def leaning(
    name: str,
    camera: Camera | None,
    thing: Observation,
    verticals: Observation,
    distortion: Quantity,
    weights: Array,
    disc: Disc,
) -> list[Note]:
    """`not_upright` where the line from a thing's base to its top does not run to the vanishing point of the upright lines."""

    def off(c: Camera | None, seen: Observation, lines: Observation, d: Quantity) -> Array:
        v, _ = vanishing_point(view(c, lines, d, disc), weights)
        return misses(view(c, seen, d, disc), v)

    nominal = float(off(camera, thing, verticals, distortion)[0])
    u = math.sqrt(float(covariance_by((camera, thing, verticals, distortion), off, 1)[0, 0]))
    if not abs(nominal) > MISFIT * u or not math.isfinite(nominal):
        return []
    times = f"by {abs(nominal) / u:.2g} times what is stated" if u > 0 else "though all is stated as exact"
    return [Note("not_upright", f"the {name} does not stand upright as the vertical lines do: its top is beside its base {times}",
                 "mark the top right above the base, and look at the vertical lines again")]  # fmt: skip
