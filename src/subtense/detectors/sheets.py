"""Rectangles of known kinds: sheets of paper, cards, banknotes, plates, signs, found by their sides.

Quadrilaterals are found in a reduced picture (`quads`), their sides located again in the full one (`straight`), and told
apart by aspect and right angles under perspective (`sheet_kinds`). Shape does not tell size: all A sizes are alike, and so is
a window of their proportions. So a kind is taken only where a person said that it is there; unasked, plain bright sheets are
reported with the kinds that they may be and no size. The one exception is a bank card, which its rounded corners tell; that is
a guess, and noted as one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Array, Pixels
from ..board_points.gray import FINDING_PX, Reduced, gray_of, reduced
from ..camera import Camera
from ..detection import Detection, Search
from ..edges import LEAST_STEP, Patch
from ..observation import Observation
from ..photo import Photo
from ..quads import LEAST_SIDE_PX, Rough, distinct, quads, straight_lines
from ..quantity import Note
from ..sheet_kinds import AS_WELL, KindFit, kind_fits, usual_cameras
from ..straight import Outline, outline
from ..targets import KnownTarget, targets

GROUPS = ("paper", "card", "banknote", "plate", "sign", "media", "own")
"""Of data/targets.toml; rows of a person's own file are in `own`."""
UNASKED = ("paper", "card", "banknote", "plate")
"""Groups whose kinds are named where nothing was told."""
PICTURE_PX = 640
"""Smaller pictures are enlarged for finding: segments of few pixels are not seen."""
MOST_ENLARGED = 4.0
ROUGH_PX = 1.5
"""Standard deviation of a corner of the reduced picture."""
QUICK_PX = 0.5
"""The same after a quick look at the sides."""
MOST_ROUGH = 1500
MOST_LOOKED_AT = 120
MOST_LOCATED = 6
"""Quadrilaterals that are found, looked at quickly, and located."""
TELLS_LITTLE = 0.1
"""Relative standard deviation of the aspect beyond which it says little of the kind."""
HIDDEN = 0.8
"""Share of a side that must be seen for its being whole to go without a note."""
LEAST_RADIUS_PX = 2.5
"""Smaller radii are lost in the blur."""
CARD_ROUNDING = 3.18 / 85.6
"""Radius of a bank card's corners over its width (ISO/IEC 7810)."""
ROUNDING_WITHIN = (0.6, 1.5)
"""Of that: how far a measured radius may be off."""


@dataclass(frozen=True, eq=False)
class _Located:
    """A quadrilateral with its sides located, and the kinds that fit."""

    shape: Outline
    patch: Patch
    rough: Rough
    fits: list[KindFit]


@dataclass(frozen=True)
class _Rules:
    """How much must be seen: mean and least support of the sides, and how one-sided the light is."""

    mean: float
    least: float
    one_sided: float


STRICT, WILLING = _Rules(0.85, 0.6, 0.9), _Rules(0.75, 0.3, 0.6)


def sheets(photo: Photo, search: Search | None = None) -> tuple[Detection, ...]:
    """Rectangles in a photo, left to right.

    Args:
        photo: the picture.
        search: `targets`, `curve`, `camera`, `thorough` and `progress` of it are heeded.

    Returns:
        Rectangles: corners clockwise as seen, so that the first side is the target's width: the longer one, but of things that
        stand up. `target` is a kind that was told; else None, with the kinds that fit in `others`.
    """
    search = search or Search()
    told = tuple(one for one in search.targets if one.shape == "rectangle" and one.group in GROUPS)
    if search.targets and not told:
        return ()
    cameras = [(search.camera, 1.0)] if search.camera else usual_cameras(photo.width_px, photo.height_px)
    kinds = told or tuple(one for one in targets().values() if one.shape == "rectangle" and one.group in UNASKED)
    pictures = _pictures(gray_of(photo.pixels), several=bool(told) or search.thorough)
    for number, picture in enumerate(pictures):
        lines = straight_lines(picture.pixels)
        for mixed in (False, True) if told and number == 0 else (False,):
            found = _found(photo, picture, lines, search, (cameras, kinds), told=bool(told), mixed=mixed)
            search.progress((number + 1) / len(pictures))
            if found:
                return tuple(sorted(found, key=lambda one: float(one.seen.points_px[:, 0].mean())))
    return ()


def reach_px(photo: Photo, search: Search, found: bool) -> float:
    """Shortest side of a sheet that the search came down to, px of the photo."""
    longest, several = max(photo.width_px, photo.height_px), bool(search.targets) or search.thorough
    if longest < PICTURE_PX:
        return LEAST_SIDE_PX / min(MOST_ENLARGED, 1.5 * PICTURE_PX / longest)
    most = 2 * FINDING_PX if several and longest > 2 * FINDING_PX and not found else FINDING_PX
    halvings = max(0, math.ceil(math.log2(longest / most)))
    return float(LEAST_SIDE_PX * 2**halvings)


def _pictures(gray: Pixels, *, several: bool) -> list[Reduced]:
    """What to search: a reduced or enlarged picture; then one of twice that, where asked for."""
    import cv2

    longest = max(gray.shape)
    if longest < PICTURE_PX:
        scale = min(MOST_ENLARGED, 1.5 * PICTURE_PX / longest)
        height, width = (round(scale * side) for side in gray.shape)
        larger = np.asarray(cv2.resize(gray, (width, height), interpolation=cv2.INTER_CUBIC))
        return [Reduced(larger, width / gray.shape[1], height / gray.shape[0])]
    sides = [FINDING_PX, 2 * FINDING_PX] if several and longest > 2 * FINDING_PX else [FINDING_PX]
    return [reduced(gray, side) for side in sides]


Choice = tuple[Sequence[tuple[Camera, float]], Sequence[KnownTarget]]
"""What the camera may be, with weights, and the kinds that are looked for."""


def _found(
    photo: Photo, picture: Reduced, lines: Array, search: Search, choice: Choice, *, told: bool, mixed: bool
) -> list[Detection]:  # fmt: skip
    cameras, kinds = choice
    rules = WILLING if told and not mixed else STRICT
    located: list[_Located] = []
    tried = 0
    for one, corners in _candidates(photo, picture, lines, choice, mixed=mixed):
        patch = _patch(photo, corners, search, 2.0 + 2.0 / picture.scale_x)
        quick = outline(patch, corners, reach_px=2.0 + 2.0 / picture.scale_x, fine=False)
        if quick is None or not _seen_enough(quick, rules, one.light) or not kind_fits(
            quick.corners_px, quick.cov + QUICK_PX**2 * np.eye(8), cameras, kinds
        ):  # fmt: skip
            continue
        if any(_overlap(quick.corners_px, other.shape.corners_px) for other in located):
            continue
        tried += 1
        if tried > MOST_LOCATED:
            break
        shape = outline(patch, quick.corners_px, reach_px=3.0)
        if shape is None or not _seen_enough(shape, rules, one.light):
            continue
        fits = kind_fits(shape.corners_px, shape.cov, cameras, kinds)
        if fits:
            located.append(_Located(shape, patch, one, fits))
    if told:
        return _told(located)
    return [found for one in located if (found := _unasked(picture, one)) is not None]


def _candidates(
    photo: Photo, picture: Reduced, lines: Array, choice: Choice, *, mixed: bool
) -> list[tuple[Rough, Array]]:
    """Quadrilaterals that may be one of the kinds, with their corners in full pixels; best seen first."""
    cameras, kinds = choice
    spread = (ROUGH_PX / min(picture.scale_x, picture.scale_y)) ** 2 * np.eye(8)
    fitting = []
    for one in quads(lines, mixed=mixed)[:MOST_ROUGH]:
        corners = picture.full(one.corners_px)
        if _inside(photo, corners) and kind_fits(corners, spread, cameras, kinds):
            fitting.append(one)
    return [(one, picture.full(one.corners_px)) for one in distinct(fitting, 3.0)[:MOST_LOOKED_AT]]


def _patch(photo: Photo, corners: Array, search: Search, reach: float) -> Patch:
    around = reach + 14.0
    return Patch.of(photo.pixels, corners.min(axis=0) - around, corners.max(axis=0) + around, search.curve)


def _inside(photo: Photo, corners: Array) -> bool:
    """At least half of the corners well within the picture: of the others, only their sides are seen."""
    size = np.array([photo.width_px, photo.height_px])
    return bool(np.all((corners > -0.5) & (corners < size - 0.5)))


def _seen_enough(shape: Outline, rules: _Rules, light: bool | None) -> bool:
    support = [side.support for side in shape.sides]
    if np.mean(support) < rules.mean or min(support) < rules.least:
        return False
    if light is None:
        return True
    wanted = -1.0 if light else 1.0
    return all(wanted * side.outward >= rules.one_sided for side in shape.sides)


def _overlap(one: Array, other: Array) -> bool:
    """The same quadrilateral: corners within a twentieth of its size."""
    size = math.sqrt(
        abs(float(np.sum(other[:, 0] * np.roll(other[:, 1], -1) - other[:, 1] * np.roll(other[:, 0], -1)))) / 2
    )
    return any(np.abs(np.roll(one, k, axis=0) - other).max() < max(2.0, 0.05 * size) for k in range(4))


def _plain(gray: Pixels, one: Rough) -> bool:
    """A light, mostly even face: paper with print, not a window or a picture."""
    import cv2

    if not one.light:
        return False
    mask = np.zeros(gray.shape, np.uint8)
    middle = one.corners_px.mean(axis=0)
    cv2.fillConvexPoly(mask, np.round(middle + 0.9 * (one.corners_px - middle)).astype(np.int32), 1)
    inside = gray[mask > 0]
    if len(inside) < 100:
        return False
    level = float(np.quantile(inside, 0.8))
    return level > 90 and float(np.mean(abs(inside - level) < 0.14 * level)) > 0.55


# -- what it is ---------------------------------------------------------------------------------------


def _as_well(fits: Sequence[KindFit]) -> list[KindFit]:
    return [fit for fit in fits if fit.likelihood > AS_WELL * fits[0].likelihood]


def _told(located: Sequence[_Located]) -> list[Detection]:
    """What was told to be there: the kind that fits, where one of those told does."""
    likely = _likely(located)
    counts: dict[str, int] = {}
    for _, fits in likely:
        for fit in fits:
            counts[fit.target.name] = counts.get(fit.target.name, 0) + 1
    found = []
    for place, (best, *others) in likely:
        seen = _detection(place.shape, best, tuple(fit.target for fit in others))
        if not others and counts[best.target.name] > 1:
            text = (f"{counts[best.target.name]} rectangles in the picture fit the {best.target.title}; which of them is one can't be "
                    "told from their shape")  # fmt: skip
            seen = _noted(seen, Note("several_fit", text, "look at the overlay, and keep the one that is meant"))
        found.append(seen)
    return found


def _likely(located: Sequence[_Located]) -> list[tuple[_Located, list[KindFit]]]:
    """Each place with the kinds it may be; not those that another place shows far more clearly."""
    round_or_unseen = [one for one in located
                       if one.fits[0].target.name != "id-1" or _rounding(one, one.fits[0]) is not False]  # fmt: skip
    best: dict[str, float] = {}
    for one in round_or_unseen:
        for fit in one.fits:
            best[fit.target.name] = max(best.get(fit.target.name, 0.0), fit.likelihood)
    pairs = []
    for one in round_or_unseen:
        fits = [fit for fit in _as_well(one.fits) if fit.likelihood > AS_WELL * best[fit.target.name]]
        if fits:
            pairs.append((one, fits))
    return pairs


def _unasked(picture: Reduced, place: _Located) -> Detection | None:
    """What shows itself: a bank card by its corners; else a plain sheet whose size must be told."""
    as_well = _as_well(place.fits)
    card = next((fit for fit in as_well if fit.target.name == "id-1"), None)
    if card is not None and _rounding(place, card) is True:
        return _detection(place.shape, card, ())
    if not _plain(picture.pixels, place.rough):
        return None
    return _detection(place.shape, as_well[0], tuple(fit.target for fit in as_well), known=False)


def _rounding(place: _Located, fit: KindFit) -> bool | None:
    """Whether the corners are rounded as a bank card's; None where that can't be seen.

    The edge on a corner's bisector lies 0.41 radii within where the sides meet.
    """
    corners = np.roll(place.shape.corners_px, -fit.first, axis=0)
    width = float(np.hypot(*(corners[1] - corners[0])) + np.hypot(*(corners[2] - corners[3]))) / 2
    expected = CARD_ROUNDING * width
    if expected < LEAST_RADIUS_PX:
        return None
    found = [_corner_radius(place.patch, corners, i, expected) for i in range(4)]
    radii = [radius for radius in found if radius is not None]
    low, high = (share * expected for share in ROUNDING_WITHIN)
    return low < float(np.median(radii)) < high if len(radii) >= 3 else None


def _corner_radius(patch: Patch, corners: Array, i: int, expected: float) -> float | None:
    corner, middle = corners[i], corners.mean(axis=0)
    one, other = (corners[(i + k) % 4] - corner for k in (1, 3))
    inward = one / np.hypot(*one) + other / np.hypot(*other)
    n = np.arange(-3.0, 1.2 * expected + 4.0, 0.25)
    profile = patch.values(corner + n[:, None] * inward / np.hypot(*inward))
    level = float(patch.values(corner + 2.5 * expected * (middle - corner) / np.hypot(*(middle - corner))))
    crossed = np.flatnonzero(abs(profile - profile[0]) > 0.5 * abs(level - profile[0]))
    if not len(crossed) or not abs(level - profile[0]) > 2 * LEAST_STEP:
        return None
    return float(n[crossed[0]]) / (math.sqrt(2) - 1)


def _kind_unknown(kinds: Sequence[KnownTarget]) -> tuple[Note, ...]:
    if not kinds:
        return ()
    names = ", ".join(kind.name for kind in kinds)
    text = f"its proportions are those of {names}; shape does not tell size"
    return (
        Note("kind_unknown", text, f"say which is there, as with --target {kinds[0].name}, or give width and height"),
    )


def _detection_notes(shape: Outline, fit: KindFit) -> list[Note]:
    notes = []
    hidden = [side.support for side in shape.sides if side.support < HIDDEN]
    if hidden:
        text = (f"of {len(hidden)} of its sides no more than {100 * max(hidden):.0f} % was seen; its corners are where the sides "
                "meet")  # fmt: skip
        notes.append(Note("partly_hidden", text, "look at the overlay"))
    if fit.u_aspect > TELLS_LITTLE:
        text = (f"it is seen so small or so doubtfully that its proportions are known to {100 * fit.u_aspect:.0f} % only; things of "
                "other proportions would fit as well")  # fmt: skip
        notes.append(Note("shape_tells_little", text, "look at the overlay, or come closer"))
    return notes


def _detection(shape: Outline, fit: KindFit, others: tuple[KnownTarget, ...], *, known: bool = True) -> Detection:
    turn = -fit.first
    index = np.roll(np.arange(4), turn)
    order = (2 * index[:, None] + [0, 1]).ravel()
    unlike = known and not others
    seen = Observation(
        shape.corners_px[index], cov=shape.cov[np.ix_(order, order)], label=fit.target.name if unlike else "sheet",
        score=float(np.mean([side.support for side in shape.sides])), source="sides of the sheet",
    )  # fmt: skip
    if known and others:  # of those told, several fit: none is taken
        others = (fit.target, *others)
    notes = (*_detection_notes(shape, fit), *_kind_unknown(others if not unlike else ()))
    return Detection(seen, "rectangle", fit.target if unlike else None, others, notes=notes)


def _noted(one: Detection, note: Note) -> Detection:
    return Detection(one.seen, one.shape, one.target, one.others, one.tilt, (*one.notes, note))
