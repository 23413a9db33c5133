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
from ..detection import Detection, Search
from ..edges import Patch
from ..observation import Observation
from ..photo import Photo
from ..quads import Rough, distinct, quads
from ..quantity import Note
from ..sheet_kinds import AS_WELL, KindFit, kind_fits, usual_cameras
from ..straight import Outline, outline
from ..targets import KnownTarget, targets

GROUPS = ("paper", "card", "banknote", "plate", "sign", "media", "own")
"""Of data/targets.toml; rows of a person's own file are in `own`."""
PICTURE_PX = 640
"""Smaller pictures are enlarged for finding: segments of few pixels are not seen."""
MOST_ENLARGED = 4.0
ROUGH_PX = 1.5
"""Standard deviation of a corner of the reduced picture."""
MOST_LOCATED = 14
"""Quadrilaterals whose sides are located."""
HIDDEN = 0.8
"""Share of a side that must be seen for its being whole to go without a note."""
CARD_ROUNDING = 3.18 / 85.6
"""Radius of a bank card's corners over its width (ISO/IEC 7810)."""
ROUNDING_WITHIN = (0.6, 1.5)
"""Of that: how far a measured radius may be off."""


@dataclass(frozen=True)
class _Rules:
    """How much must be seen: mean and least support of the sides, and how one-sided the light is."""

    mean: float
    least: float
    one_sided: float


STRICT, WILLING = _Rules(0.85, 0.6, 0.9), _Rules(0.6, 0.3, 0.6)


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
    kinds = told or tuple(one for one in targets().values() if one.shape == "rectangle" and one.group in GROUPS)
    gray = gray_of(photo.pixels)
    for number, picture in enumerate(_pictures(gray, several=bool(told) or search.thorough)):
        for mixed in (False, True) if told else (False,):
            found = _found(photo, gray, picture, search, (cameras, kinds), told=bool(told), mixed=mixed)
            search.progress(min(1.0, 0.4 * (number + 1) + 0.2 * mixed))
            if found:
                return tuple(sorted(found, key=lambda one: float(one.seen.points_px[:, 0].mean())))
    return ()


def _pictures(gray: Pixels, *, several: bool) -> list[Reduced]:
    """What to search: a reduced or enlarged picture; then one of twice that, where asked for."""
    import cv2

    longest = max(gray.shape)
    if longest < PICTURE_PX:
        scale = min(MOST_ENLARGED, 1.5 * PICTURE_PX / longest)
        height, width = (round(scale * side) for side in gray.shape)
        larger = np.asarray(cv2.resize(gray, (width, height), interpolation=cv2.INTER_CUBIC))
        return [Reduced(larger, width / gray.shape[1], height / gray.shape[0])]
    sides = [FINDING_PX, 2 * FINDING_PX] if several and longest > FINDING_PX else [FINDING_PX]
    return [reduced(gray, side) for side in sides]


Choice = tuple[Sequence[tuple[object, float]], Sequence[KnownTarget]]


def _found(
    photo: Photo, gray: Pixels, picture: Reduced, search: Search, choice: tuple, *, told: bool, mixed: bool
) -> list[Detection]:  # fmt: skip
    cameras, kinds = choice
    rough = []
    spread = (ROUGH_PX / min(picture.scale_x, picture.scale_y)) ** 2 * np.eye(8)
    for one in distinct(quads(picture.pixels, mixed=mixed), 3.0):
        corners = picture.full(one.corners_px)
        if not _inside(photo, corners):
            continue
        fits = kind_fits(corners, spread, cameras, kinds)
        if fits and (told or _plain(picture.pixels, one) or _is_card_like(fits)):
            rough.append((one, corners))
    located: list[tuple[Outline, Patch, Rough, list[KindFit]]] = []
    for one, corners in rough[:MOST_LOCATED]:
        patch, shape = _located(photo, corners, search, 2.0 + 2.0 / picture.scale_x)
        if shape is None or not _seen_enough(shape, WILLING if told else STRICT, one.light):
            continue
        if any(_overlap(shape.corners_px, other.corners_px) for other, _, _, _ in located):
            continue
        fits = kind_fits(shape.corners_px, shape.cov, cameras, kinds)
        if fits:
            located.append((shape, patch, one, fits))
    if told:
        return _told(located)
    return [d for shape, patch, one, fits in located if (d := _unasked(picture, shape, patch, one, fits)) is not None]


def _located(photo: Photo, corners: Array, search: Search, reach: float) -> tuple[Patch, Outline | None]:
    around = reach + 14.0
    patch = Patch.of(photo.pixels, corners.min(axis=0) - around, corners.max(axis=0) + around, search.curve)
    return patch, outline(patch, corners, reach_px=reach)


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


def _is_card_like(fits: Sequence[KindFit]) -> bool:
    return any(fit.target.name == "id-1" and fit.likelihood > AS_WELL * fits[0].likelihood for fit in fits)


# -- what it is ---------------------------------------------------------------------------------------


def _as_well(fits: Sequence[KindFit]) -> list[KindFit]:
    return [fit for fit in fits if fit.likelihood > AS_WELL * fits[0].likelihood]


def _told(located: Sequence[tuple[Outline, Patch, Rough, list[KindFit]]]) -> list[Detection]:
    """What was told to be there: the kind that fits, where one of those told does."""
    counts: dict[str, int] = {}
    for _, _, _, fits in located:
        for fit in _as_well(fits):
            counts[fit.target.name] = counts.get(fit.target.name, 0) + 1
    found = []
    for shape, _, _, fits in located:
        best, *others = _as_well(fits)
        one = _detection(shape, best, tuple(fit.target for fit in others))
        if not others and counts[best.target.name] > 1:
            text = (f"{counts[best.target.name]} rectangles in the picture fit the {best.target.title}; which of them is one can't be "
                    "told from their shape")  # fmt: skip
            note = Note("several_fit", text, "look at the overlay, and keep the one that is meant")
            one = _noted(one, note)
        found.append(one)
    return found


def _unasked(picture: Reduced, shape: Outline, patch: Patch, one: Rough, fits: list[KindFit]) -> Detection | None:
    """What shows itself: a bank card by its corners; else a plain sheet whose size must be told."""
    as_well = _as_well(fits)
    card = next((fit for fit in as_well if fit.target.name == "id-1"), None)
    if card is not None and _rounded(patch, shape, card):
        return _detection(shape, card, ())
    if not _plain(picture.pixels, one):
        return None
    return _detection(shape, as_well[0], tuple(fit.target for fit in as_well), known=False)


def _rounded(patch: Patch, shape: Outline, fit: KindFit) -> bool:
    """Whether the corners are rounded as a bank card's: the edge on a corner's bisector lies 0.41 radii within."""
    corners = np.roll(shape.corners_px, -fit.first, axis=0)
    middle, radii = corners.mean(axis=0), []
    width = float(np.hypot(*(corners[1] - corners[0])) + np.hypot(*(corners[2] - corners[3]))) / 2
    expected = CARD_ROUNDING * width
    if expected < 2.5:
        return False
    for i, corner in enumerate(corners):
        to_one, to_other = (corners[(i + k) % 4] - corner for k in (1, 3))
        inward = to_one / np.hypot(*to_one) + to_other / np.hypot(*to_other)
        inward = inward / np.hypot(*inward)
        n = np.arange(-3.0, 1.2 * expected + 4.0, 0.25)
        profile = patch.values(corner + n[:, None] * inward)
        level = patch.values(corner + (2.5 * expected) * (middle - corner) / np.hypot(*(middle - corner)))
        outside = profile[0]
        crossed = np.flatnonzero(abs(profile - outside) > 0.5 * abs(level - outside))
        if len(crossed) and abs(level - outside) > 0.08:
            radii.append(float(n[crossed[0]]) / (math.sqrt(2) - 1))
    low, high = (share * expected for share in ROUNDING_WITHIN)
    return len(radii) >= 3 and low < float(np.median(radii)) < high


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
    found = Detection(seen, "rectangle", fit.target if unlike else None, others)
    hidden = [side.support for side in shape.sides if side.support < HIDDEN]
    if not hidden:
        return found
    text = f"of {len(hidden)} of its sides only {100 * min(hidden):.0f} % or more was seen; its corners are where the sides meet"
    return _noted(found, Note("partly_hidden", text, "look at the overlay"))


def _noted(one: Detection, note: Note) -> Detection:
    return Detection(one.seen, one.shape, one.target, one.others, one.tilt, (*one.notes, note))
