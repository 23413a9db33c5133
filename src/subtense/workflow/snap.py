"""Points that a person marked, moved to the edge or corner that is near: with what it did as notes."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np

from ..arrays import Array
from ..corners import Corner, corners_near
from ..document import Document
from ..edges import RIVAL_SHARE, Edge, checked, edges_across, end_covariance, line_of, no_edge, snap
from ..errors import NothingFoundError
from ..observation import Observation
from ..photo import Photo
from ..quantity import Note, Quantity

ALONG = math.cos(math.radians(15.0))
"""A line within 15 degrees of a corner's edge runs along it, and ends in the corner."""
CORNER_SHARE = 0.5
"""Of the contrast of the edge across the line: with less along the line, it is a mark on the thing and no corner of it."""
FAR_SIGMAS = 4.5
"""Of a marked point's standard deviation: a longer way to the edge is no chance of the hand."""
APART_PX = 2.0
"""Another edge that lies nearer to the chosen one is the same."""


def snapped(
    photo: Photo, observation: Observation, curve: Quantity, *, radius_px: float | None = None, unseen: bool = False
) -> tuple[Observation, tuple[Note, ...]]:
    """Marked points at the edges and corners near them, and notes on how far they moved and what else is near.

    Two points are the ends of a line: each goes to the edge that the line crosses there, or to the corner where the line runs
    along an edge. Any other number of points are corners.

    Args:
        photo: the picture.
        observation: the points as marked.
        curve: exponent of the transfer curve.
        radius_px: how far from a point; None for the default of `edges`.
        unseen: whether nobody sees where the points went before they are measured with: those that went far are then doubted.

    Returns:
        The points with their joint covariance; a curve that is unknown moves all of them out or in together.

    Raises:
        InputError: a point outside the picture.
        NothingFoundError: no edge or corner near a point.
    """
    marked = np.asarray(observation.points_px, float)
    if marked.shape == (2, 2):
        ends, notes = _line_ends(photo, observation, curve, radius_px)
    else:
        ends, notes = [_corner(photo, point, curve, radius_px) for point in marked], []
    points = np.array([place for place, _, _ in ends])
    shift = np.concatenate([moved for _, _, moved in ends])
    cov = np.outer(shift, shift)
    for i, (_, own, _) in enumerate(ends):
        cov[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] += own
    far = np.hypot(*(points - marked).T)
    cov, doubts = _moved_far(cov, points - marked, observation) if unseen else (cov, [])
    text = f"the marked points were moved to edges near them, by {', '.join(f'{px:.1f}' for px in far)} px"
    found = Observation(points, cov=cov, label=observation.label, source="edges near the marked points")
    return found, (Note("snapped", text, "look at the overlay"), *doubts, *notes)


def _moved_far(cov: Array, steps: Array, marked: Observation) -> tuple[Array, list[Note]]:
    """The covariance with half of each step added that is longer than a marked point is off by chance, and the note `snapped_far`."""
    stated = np.sqrt(np.sum(marked.standard_deviations.reshape(-1, 2) ** 2, axis=-1) / 2)
    cov, far = cov.copy(), []
    for i, step in enumerate(steps):
        length = float(np.hypot(*step))
        if length > FAR_SIGMAS * float(stated[i]):
            cov[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] += np.outer(step, step) / 4
            far.append(f"{length:.1f} px")
    if not far:
        return cov, []
    text = (f"a point was moved by {', '.join(far)}, farther than a mark is off by chance: what it was moved to may be another edge, a "
            "shadow or a pattern; half of that is in u")  # fmt: skip
    return cov, [
        Note("snapped_far", text, "mark it closer to the edge that is meant, or state how well it is marked, as ± 2px")
    ]


def snapped_lines(
    photo: Photo, lines: Sequence[Observation], curve: Quantity
) -> tuple[list[Observation], list[tuple[Note, ...]]]:
    """Each line snapped, and the notes of each; see `snapped`."""
    pairs = [snapped(photo, line, curve, unseen=True) for line in lines]
    return [line for line, _ in pairs], [notes for _, notes in pairs]


def with_line_notes(document: Document, notes: Sequence[tuple[Note, ...]]) -> Document:
    """A document of lines, in their order, with further notes on the headline of each."""
    rest, out = list(notes), []
    for m in document.measurements:
        head = m.what == "range" and rest
        out.append(dataclasses.replace(m, notes=(*m.notes, *rest.pop(0))) if head else m)
    return dataclasses.replace(document, measurements=tuple(out))


def _corner(photo: Photo, point: Array, curve: Quantity, radius_px: float | None) -> tuple[Array, Array, Array]:
    place, radius = checked(photo, point, radius_px)
    corners = corners_near(photo, place, radius_px=radius, curve=curve)
    if not corners:
        snap(photo, place, radius_px=radius, curve=curve)  # raises, and says what was looked for
        raise NothingFoundError(f"{photo.name}: no corner at {place[0]:.1f},{place[1]:.1f}")
    return corners[0].point_px, corners[0].cov, corners[0].by_curve_px


def _line_ends(
    photo: Photo, line: Observation, curve: Quantity, radius_px: float | None
) -> tuple[list[tuple[Array, Array, Array]], list[Note]]:
    ends, d, radius = line_of(photo, line, radius_px)
    spread = line.standard_deviations.reshape(-1, 2)
    found, notes = [], []
    for number, end in enumerate(ends):
        corners = [c for c in corners_near(photo, end, radius_px=radius, curve=curve) if _runs_along(c, d)]
        edges = edges_across(photo, end, d, radius_px=radius, curve=curve)
        if corners and (not edges or corners[0].contrast > CORNER_SHARE * edges[0].contrast):
            found.append((corners[0].point_px, corners[0].cov, corners[0].by_curve_px))
            continue
        if not edges:
            raise no_edge(photo, end, radius)
        beside = float(np.hypot(*(spread[number] * [-d[1], d[0]])))
        cov, shift = end_covariance(edges[0], d, beside)
        found.append((edges[0].point_px, cov, shift))
        notes += _rivals(edges, d, end, radius)
    return found, notes


def _runs_along(corner: Corner, d: Array) -> bool:
    """Whether one edge of the corner goes with the line and the other across it."""
    with_line = abs(corner.alongs @ d)
    return bool(with_line.max() > ALONG and with_line.min() < 0.8)


def _rivals(edges: tuple[Edge, ...], d: Array, end: Array, radius: float) -> list[Note]:
    chosen, *rest = edges
    rivals = [e for e in rest if e.contrast > RIVAL_SHARE * chosen.contrast
              and abs((e.point_px - chosen.point_px) @ d) > APART_PX]  # fmt: skip
    if not rivals:
        return []
    steps = ", ".join(f"{(e.point_px - chosen.point_px) @ d:+.1f}" for e in rivals)
    text = (f"near {end[0]:.0f},{end[1]:.0f} another edge lies {steps} px from the chosen one along the line; which one is meant "
            "can't be told")  # fmt: skip
    return [
        Note(
            "snap_ambiguous", text, f"mark the end nearer to its edge than to others, by less than {radius / 2:.0f} px"
        )
    ]
