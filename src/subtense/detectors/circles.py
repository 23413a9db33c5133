"""Discs and balls: rims of coins, lids, round signs and balls, found by themselves and located in linear light.

Edge chains that lie on an ellipse (EDCircles) are candidates, in the picture and in smaller copies of it, so that a soft rim is
found too. Each is fitted on the pixels (see `rim`), and kept only where most of the rim is seen as one edge that is an ellipse.
What it is can't be told from its size in a picture: a person says the kind (`--target euro-1`); else it is a disc without a size.

A coin stands off the table by its thickness, about a twelfth of its diameter, and its visible rim may be the upper or the lower
edge: that moves and lengthens the short axis of a tilted coin's rim, and is in the covariance.

Source: C. Akinlar, C. Topal, EDCircles, Pattern Recognition 46, 2013 (candidates); S. Suzuki, K. Abe, border following, 1985.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..arrays import Array, Pixels
from ..detection import Detection, Search
from ..observation import Observation
from ..photo import Photo
from ..quantity import Note
from ..rim import Ellipse, Rim, fit_rim
from ..subpixel import encoded_gray
from ..targets import KnownTarget

GROUPS = ("coin", "ball", "sign", "own")
"""Of data/targets.toml; rows of a person's own file are in `own`."""
POINTS = 12
"""That stand for a fitted rim."""
LEAST_PX = 12.0
"""Diameter of the smallest rim."""
SLIMMEST = 0.25
"""Least ratio of the axes (a tilt of 75 degrees)."""
LEAST_SHARE, LEAST_SHARE_TOLD = 0.8, 0.55
"""Of the rim that must be seen, where nothing and where the kind was said."""
WIDEST_GAP_RAD = math.radians(150.0)
WORST_SCATTER = (0.12, 0.006)
"""Of the edge about the ellipse, px and share of the mean half axis, where nothing was said; three times as much where it was."""
COIN_THICKNESS = 0.085
"""Over its diameter: 0.07 (US quarter) to 0.13 (5 cent)."""
MOST_CANDIDATES = 60
SEARCHED_PX = 1600
ALIKE = 1.1
"""Ratio of sizes up to which discs of one kind are taken to lie at one distance."""


def circles(photo: Photo, search: Search | None = None) -> tuple[Detection, ...]:
    """Discs and balls in a photo, left to right.

    Args:
        photo: the picture.
        search: `targets`, `curve`, `thorough` and `progress` of it are heeded.

    Returns:
        Circles, and spheres where a ball was said to be there: 12 points of the rim with the covariance of the ellipse.
    """
    search = search or Search()
    if min(photo.width_px, photo.height_px) < 2 * LEAST_PX:
        return ()
    kinds = [target for target in search.targets if is_round(target)]
    encoded = encoded_gray(photo.pixels)
    rough = _candidates(photo.pixels, search.thorough)
    rims: list[Rim] = []
    for number, ellipse in enumerate(rough, 1):
        rim = fit_rim(encoded, ellipse, search.curve)
        if rim is not None and is_rim(rim, encoded.shape, told=bool(kinds)):
            rims.append(rim)
        search.progress(number / len(rough))
    rims = [
        rim for rim in rims if is_rim(rim, encoded.shape, told=False)
    ] or rims  # a weak one where there is no clear one
    kept = sorted(_outermost(rims), key=lambda rim: rim.ellipse.x_px)
    return tuple(_named(kept, kinds))


def is_round(target: KnownTarget) -> bool:
    """Whether the rim of a target is a circle of its size: not so of coins with seven or twelve sides."""
    return target.group in GROUPS and target.shape == "circle" and "diameter" in target.what


def is_rim(rim: Rim, shape: tuple[int, ...], *, told: bool) -> bool:
    """Whether a fitted rim is one beyond doubt, or surely enough where a person said that there is one."""
    e = rim.ellipse
    if 2 * e.a_px < LEAST_PX or e.b_px < SLIMMEST * e.a_px or rim.widest_gap_rad > WIDEST_GAP_RAD:
        return False
    limit = max(WORST_SCATTER[0], WORST_SCATTER[1] * (e.a_px + e.b_px) / 2) * (3 if told else 1)
    inside = 0 <= e.x_px < shape[1] and 0 <= e.y_px < shape[0]
    share = LEAST_SHARE_TOLD if told else LEAST_SHARE
    return bool(inside and rim.share >= share and rim.scatter_px < limit and rim.one_sign >= (0.7 if told else 0.9)
                and _is_certain(rim))  # fmt: skip


def _is_certain(rim: Rim) -> bool:
    """Whether noise alone leaves the half axes known to a tenth."""
    return bool(np.sqrt(max(rim.cov[2, 2], rim.cov[3, 3])) < 0.1 * rim.ellipse.b_px)


def _candidates(pixels: Pixels, thorough: bool) -> list[Ellipse]:
    """Rough ellipses, strong ones first, in the picture and in copies of a half, a quarter and an eighth."""
    import cv2

    gray = cv2.cvtColor(pixels, cv2.COLOR_RGB2GRAY)
    found: list[tuple[float, Ellipse]] = []
    scale = 1.0 if thorough else min(1.0, SEARCHED_PX / max(gray.shape))
    while min(gray.shape) * scale >= 2 * LEAST_PX and scale > 0.1:
        size = (max(round(gray.shape[1] * scale), 1), max(round(gray.shape[0] * scale), 1))
        small = gray if scale == 1 else cv2.resize(gray, size, interpolation=cv2.INTER_AREA)
        for x, y, a, b, angle in [*_by_chains(cv2, small), *_by_borders(cv2, small)]:
            a, b, angle = (a, b, angle) if a >= b else (b, a, angle + math.pi / 2)
            if 2 * a * 1.1 >= LEAST_PX * scale and b > 0.8 * SLIMMEST * a and a < max(size):
                here = Ellipse((x + 0.5) / scale - 0.5, (y + 0.5) / scale - 0.5, a / scale, b / scale, angle)
                if not any(_alike(here, other, 0.06) for _, other in found):
                    found.append((a / scale, here))
        scale /= 2
    return [one for _, one in sorted(found, key=lambda pair: -pair[0])][:MOST_CANDIDATES]


def _by_chains(cv2: Any, gray: Pixels) -> list[tuple[float, ...]]:
    """Ellipses of chained edges: centre, half axes, angle."""
    drawing = cv2.ximgproc.createEdgeDrawing()
    drawing.detectEdges(gray)
    found = drawing.detectEllipses()
    rows = [] if found is None else np.reshape(found, (-1, 6)).astype(float).tolist()
    return [(x, y, r + a, r + b, math.radians(angle)) for x, y, r, a, b, angle in rows if r + min(a, b) > 1]


def _by_borders(cv2: Any, gray: Pixels) -> list[tuple[float, ...]]:
    """Ellipses about the borders of what is lighter or darker than a threshold."""
    out: list[tuple[float, ...]] = []
    smooth = cv2.GaussianBlur(gray, (0, 0), 1.0)
    otsu, _ = cv2.threshold(smooth, 0, 255, cv2.THRESH_BINARY + cv2.THRESH_OTSU)
    for level in (otsu, *np.percentile(smooth, (10, 30, 70, 90))):
        _, mask = cv2.threshold(smooth, float(level), 255, cv2.THRESH_BINARY)
        borders, _ = cv2.findContours(mask, cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)
        for border in sorted(borders, key=len, reverse=True)[:40]:
            if len(border) < 20:
                break
            (x, y), (width, height), angle = cv2.fitEllipse(border)
            area = math.pi * width * height / 4
            if area > 0 and abs(cv2.contourArea(border) / area - 1) < 0.08:
                out.append((x, y, width / 2, height / 2, math.radians(angle)))
    return out


def _alike(one: Ellipse, other: Ellipse, share: float) -> bool:
    near = share * max(one.b_px, other.b_px) + 1.0
    return (math.hypot(one.x_px - other.x_px, one.y_px - other.y_px) < near
            and abs(one.a_px - other.a_px) < near and abs(one.b_px - other.b_px) < near)  # fmt: skip


def _outermost(rims: list[Rim]) -> list[Rim]:
    """One rim a thing: the largest of those about one place (a coin has an inner ring, a sign a border)."""
    kept: list[Rim] = []
    for rim in sorted(rims, key=lambda r: -r.ellipse.a_px):
        e = rim.ellipse
        inside = [
            o for o in kept if math.hypot(o.ellipse.x_px - e.x_px, o.ellipse.y_px - e.y_px) < 0.8 * o.ellipse.b_px
        ]
        if not inside:
            kept.append(rim)
    return kept


def _named(rims: list[Rim], kinds: list[KnownTarget]) -> list[Detection]:
    """Detections with what they are taken to be."""
    if not kinds:
        return [_detection(rim, None, (), "disc", thick=True) for rim in rims]
    if len(kinds) > 1:
        return [_detection(rim, kind, (), kind.title, notes) for rim, (kind, notes) in zip(rims, _told_apart(rims, kinds), strict=True)
                if kind is not None]  # fmt: skip
    kind = kinds[0]
    sizes = [rim.ellipse.a_px for rim in rims]
    doubt: tuple[Note, ...] = ()
    if sizes and max(sizes) > ALIKE * min(sizes):
        text = f"{len(rims)} discs of different size were found, and each is taken to be the {kind.title}"
        doubt = (Note("assumed_size", text, "say all kinds that are there with --target, or measure only the one"),)
    return [_detection(rim, kind, (), kind.title, doubt) for rim in rims]


def _told_apart(rims: list[Rim], kinds: list[KnownTarget]) -> list[tuple[KnownTarget | None, tuple[Note, ...]]]:
    """Which of the stated kinds each rim is, where the ratios of their sizes say so at about one distance.

    All scales at which one rim is one kind are tried; each other rim is then the kind of nearest size.
    """
    nothing: list[tuple[KnownTarget | None, tuple[Note, ...]]] = [(None, ()) for _ in rims]
    if len(rims) < 2:
        return nothing
    seen = np.log([2 * rim.ellipse.a_px for rim in rims])
    known = np.log([float(kind.size.value) for kind in kinds if kind.size is not None])
    fits = []
    for scale in (seen[:, None] - known).ravel():
        gap = abs(seen[:, None] - known - scale)
        fits.append((float(np.sqrt(np.mean(gap.min(axis=1) ** 2))), tuple(gap.argmin(axis=1))))
    fits.sort()
    best, others = fits[0], [fit for fit in fits if fit[1] != fits[0][1]]
    all_there = len(set(best[1])) == len(kinds)
    if best[0] > 0.02 or not all_there or (others and others[0][0] < 3 * best[0] + 0.02):
        return nothing
    text = "which of the stated kinds it is was told from the ratio of the discs' sizes, as if all were equally far"
    note = Note("assumed_size", text, "measure one kind at a time, with one --target")
    return [(kinds[int(i)], (note,)) for i in best[1]]


def _detection(
    rim: Rim, target: KnownTarget | None, others: tuple[KnownTarget, ...], label: str, notes: tuple[Note, ...] = (),
    *, thick: bool = False,
) -> Detection:  # fmt: skip
    """The rim as points with covariance; of a coin, or what may be one, with the doubt of its thickness."""
    ball = target is not None and target.group == "ball" and "disc" not in target.what  # a puck is in that group too
    shape = "sphere" if ball else "circle"
    if thick or (target is not None and target.group == "coin"):
        rim = Rim(rim.ellipse, rim.cov + _by_thickness(rim.ellipse), rim.share, rim.scatter_px, rim.contrast, rim.one_sign,
                  rim.blur_px, rim.widest_gap_rad)  # fmt: skip
    points, cov = rim.observed(POINTS)
    seen = Observation(points, cov=cov, label=label, score=rim.share, source="edge of the rim")
    return Detection(seen, shape, target, others, notes=notes)


def _by_thickness(e: Ellipse) -> Array:
    """(5, 5) of a coin's rim, which is its upper edge, its lower one, or upper on the far and lower on the near side."""
    sine = math.sqrt(max(1 - (e.b_px / e.a_px) ** 2, 0.0))
    height = COIN_THICKNESS * 2 * e.a_px * sine
    half_axis = np.array([0.0, 0, 0, 1, 0]) * height / 4
    centre = np.array([-math.sin(e.angle_rad), math.cos(e.angle_rad), 0, 0, 0]) * height / 4
    return np.outer(half_axis, half_axis) + np.outer(centre, centre)
