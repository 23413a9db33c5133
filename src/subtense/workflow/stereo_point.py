"""The disparity of one pixel, or of what a box shows: a point matched by itself, checked against the dense match around it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Array, Pixels
from ..disparity import Disparity
from ..errors import GeometryError, InputError
from ..point_match import HALF_PX, match_point
from ..quantity import Note
from ..rectified_pair import Rectified

CONTRADICT = 3.0
"""u apart at which the two matches of a point contradict each other."""
BESIDE_PX, BESIDE_SHARE = 8, 0.95
"""Pixels with less of their surroundings matched lie beside what one camera does not see, and may show the other side of an edge."""
BESIDE_STEP_PX = 4.0
"""A change of disparity around the pixel that is an edge in depth."""
WINDOW_PX = 81
"""Pixels of a dense match that go together."""
BOX_FLOOR_PX = 0.1
"""Least u of a box's disparity: what all pixels err by alike."""
LEAST_SEEN = 0.1
"""Share of a box that must be matched."""
MANY_DEPTHS = 0.1
"""Relative spread of depths in a box from which it shows more than one thing."""


@dataclass(frozen=True)
class SpotMatch:
    """A pixel's disparity, in the pictures as they were taken.

    Attributes:
        disparity_px: column in the left picture less that in the right one.
        sigma_px: its standard deviation.
        source: how it was had.
        notes: doubts.
    """

    disparity_px: float
    sigma_px: float
    source: str
    notes: tuple[Note, ...] = ()


@dataclass(frozen=True)
class BoxMatch(SpotMatch):
    """The same of a box; `spot_px` is the pixel that it is taken for."""

    spot_px: Array = None  # type: ignore[assignment]


def spot_match(left: Pixels, right: Pixels, found: Disparity, pair: Rectified, spot_px: Array) -> SpotMatch:
    """The disparity of a pixel of the left picture.

    Raises:
        GeometryError: `no_match`: it is not seen in the right picture, or nothing tells it from its neighbours.
    """
    spot = pair.from_left(np.asarray(spot_px, float))
    inside = np.all(np.isfinite(spot)) and 0 <= round(spot[0]) < pair.width_px and 0 <= round(spot[1]) < pair.height_px
    if not inside:
        raise _no_match(spot_px, "lies outside of what rectification keeps")
    x, y = round(float(spot[0])), round(float(spot[1]))
    known, u_known = float(found.px[y, x]), float(found.sigma_px[y, x])
    if np.isnan(known):
        raise _no_match(
            spot_px,
            "has no match in the right picture that holds both ways: hidden there, without texture, or a reflection",
        )
    if bool(found.filled[y, x]):
        text = "the pixel has no match of its own; its distance is taken from what is seen around it"
        note = Note("filled", text, "name a pixel with texture that both cameras see")
        return _as_taken(pair, spot_px, spot, known, u_known, "filled from around the pixel", (note,))
    one = match_point(left, right, spot, found.low_px, found.high_px, known)
    beside = _beside(found, x, y)
    if one is None:
        return _as_taken(pair, spot_px, spot, known, u_known, "dense match", beside)
    uneven, share = _unevenness(found, x, y)
    apart = one.disparity_px - known
    sigma = float(np.sqrt(one.sigma_px**2 + uneven**2 + (apart / 2) ** 2))
    notes: tuple[Note, ...] = ()
    if abs(apart) > CONTRADICT * float(np.hypot(one.sigma_px, u_known)):
        text = f"the point alone is matched {abs(apart):.1f} px from where its neighbours say; its u reaches over both"
        notes = (_ambiguous(text),)
        sigma = max(sigma, abs(apart))
    elif np.isfinite(one.rival_px) and abs(one.rival_px - known) > 3:
        text = f"a second place in the right picture looks alike, {abs(one.rival_px - known):.0f} px away: a pattern that repeats"
        notes = (_ambiguous(text),)
    if share < 0.8:  # beside what is hidden the window holds two depths
        sigma = max(sigma, u_known)
    return _as_taken(pair, spot_px, spot, one.disparity_px, sigma, "matched point", (*notes, *beside))


def _beside(found: Disparity, x: int, y: int) -> tuple[Note, ...]:
    """The note `beside_unmatched`."""
    part = found.px[max(y - BESIDE_PX, 0) : y + BESIDE_PX + 1, max(x - BESIDE_PX, 0) : x + BESIDE_PX + 1]
    seen = ~np.isnan(part)
    step = float(np.ptp(part[seen])) if seen.any() else 0.0
    if seen.mean() >= BESIDE_SHARE and step < BESIDE_STEP_PX:
        return ()
    text = "the pixel lies beside an edge, or beside what has no match: there about 1 in 14 matches is of the other side, beyond 3 u"
    return (Note("beside_unmatched", text, "name a pixel farther inside of the thing, or draw a --box around it"),)


def _ambiguous(text: str) -> Note:
    return Note("match_ambiguous", text, "name a pixel that nothing near it resembles, or limit the --disparities")


def _no_match(spot_px: Array, why: str) -> GeometryError:
    x, y = (float(v) for v in spot_px)
    return GeometryError(
        f"the pixel {x:g},{y:g} {why}; name one nearby that both cameras see, or add --fill", code="no_match"
    )


def _as_taken(pair: Rectified, spot_px: Array, spot: Array, disparity: float, sigma: float, source: str,
              notes: tuple[Note, ...]) -> SpotMatch:  # fmt: skip
    """A rectified disparity in the pictures as they were taken."""
    x = spot[0] - np.array([disparity, disparity - 0.5, disparity + 0.5])
    columns = pair.to_right(np.stack([x, np.full(3, spot[1])], -1))[:, 0]
    if not np.all(np.isfinite(columns)):
        raise _no_match(spot_px, "would lie outside of the right picture")
    along = abs(float(columns[1] - columns[2]))
    return SpotMatch(float(spot_px[0] - columns[0]), sigma * along, source, notes)


def _unevenness(found: Disparity, x: int, y: int) -> tuple[float, float]:
    """By what the dense disparities around a pixel depart from a plane, px rms, and the share of the window that has any."""
    top, first = max(y - HALF_PX, 0), max(x - HALF_PX, 0)
    part = found.px[top : y + HALF_PX + 1, first : x + HALF_PX + 1].astype(float)
    dy, dx = np.mgrid[top : top + part.shape[0], first : first + part.shape[1]] - np.array([y, x])[:, None, None]
    whole = np.exp(-(dx**2 + dy**2) / (2 * (HALF_PX / 1.5) ** 2))
    weight = np.where(np.isnan(part), 0.0, whole)
    root = np.sqrt(weight).ravel()[:, None]
    columns = np.stack([np.ones(part.size), dx.ravel(), dy.ravel()], 1)
    values = np.nan_to_num(part).ravel()
    plane = np.linalg.lstsq(columns * root, values * root[:, 0], rcond=None)[0]
    rest = values - columns @ plane
    return float(np.sqrt(weight.ravel() @ rest**2 / weight.sum())), float(weight.sum() / whole.sum())


# -- a box -----------------------------------------------------------------------------------------------


def box_match(found: Disparity, pair: Rectified, box: tuple[float, ...]) -> BoxMatch:
    """The median disparity of what a box of the left picture shows.

    Raises:
        GeometryError: `no_match`: too little of it is seen by both cameras.
    """
    x1, y1, x2, y2 = box
    if not (x2 > x1 and y2 > y1):
        raise InputError("--box", box, "give two opposite corners")
    step = max(1, int(np.sqrt((x2 - x1) * (y2 - y1) / 20_000)))
    x, y = np.meshgrid(np.arange(np.ceil(x1), x2 + 1e-9, step), np.arange(np.ceil(y1), y2 + 1e-9, step))
    spots = pair.from_left(np.stack([x.ravel(), y.ravel()], -1))
    kept = np.all(np.isfinite(spots), axis=-1) & np.all(spots > -0.5, axis=-1)
    kept &= (spots[:, 0] < pair.width_px - 0.5) & (spots[:, 1] < pair.height_px - 0.5)
    columns, rows = np.rint(spots[kept]).astype(int).T
    known = found.px[rows, columns]
    seen = ~np.isnan(known)
    share = float(seen.sum()) / max(len(spots), 1)
    if share < LEAST_SEEN:
        seen_text = f"only {100 * share:.0f} % of the box has a match in the right picture"
        raise GeometryError(f"{seen_text}; give one that both cameras see, with texture", code="no_match")
    known = known[seen].astype(float)
    median = float(np.median(known))
    spread = 1.4826 * float(np.median(abs(known - median)))
    own = float(np.median(found.sigma_px[rows, columns][seen]))
    count = max(seen.sum() * step**2 / WINDOW_PX, 1.0)
    sigma = float(np.sqrt(BOX_FLOOR_PX**2 + (1.2533 * max(spread, own)) ** 2 / count))
    middle = np.array([(x1 + x2) / 2, (y1 + y2) / 2])
    one = _as_taken(
        pair, middle, pair.from_left(middle), median, sigma, "median of the box", _box_notes(pair, known, share)
    )
    return BoxMatch(one.disparity_px, one.sigma_px, one.source, one.notes, middle)


def _box_notes(pair: Rectified, known: Array, share: float) -> tuple[Note, ...]:
    near, far = (float(pair.depth_m(q)) for q in np.quantile(known, [0.9, 0.1]))
    middle = float(pair.depth_m(np.median(known)))
    if 0 < far - near <= MANY_DEPTHS * middle:
        return ()
    reach = f"{near:.3g} m to {far:.3g} m" if far > 0 else f"{near:.3g} m to infinity"
    text = f"the middle four fifths of the box's depths are {reach}; its distance is the median of the {100 * share:.0f} % matched"
    return (Note("box_of_several_depths", text, "draw the box around one thing alone"),)
