"""Dense disparity of a rectified pair: for each pixel of the left picture, how much farther left the right picture shows it.

Semi-global matching in both directions; what the two do not agree on, and what lies within the matching window of that, has no
answer. The doubt of a pixel is built from what limits a match:

* the interpolation between whole disparities, and rows that rectification leaves a part of a pixel apart;
* the noise of the pictures over the gradient in the window (Cramér and Rao): large where there is little texture;
* the difference between the two directions, which are two measurements of one number;
* a step in depth within reach of the window: the pixel may belong to either side of it.

Source: H. Hirschmüller, Stereo processing by semiglobal matching and mutual information, PAMI 30, 2008; noise: R. Szeliski, Computer
Vision, 9.1.3; D. Min et al., Fast global image smoothing based on weighted least squares, TIP 23, 2014.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from .arrays import Array, Bools, Pixels

BLOCK_PX = 3
"""Width of the matching window; the paths of semi-global matching do the rest."""
REACH_PX = 4
"""How far a depth step is felt: half the window, its prefilter, and the paths' slack."""
MOST_DIFFERENCE_PX = 1.0
"""Between the two directions of a match."""
SPECKLE_PX, SPECKLE_STEP_PX = 50, 2.0
"""Islands of fewer pixels, apart from what is around them by more than that, are mismatches."""
SUBPIXEL_PX = 1 / 12**0.5
"""Standard deviation of a match with perfect texture, as if only the whole disparity was told: interpolation is drawn to it."""
LEAST_NOISE = 1.0
"""Of gray levels; pictures of 8 bits are not better known."""
SLANT = 0.25
"""Disparity per pixel up to which what changes within reach is a slanted surface and no step."""
NEARBY_PX = 32
"""A filled pixel is taken to lie, 95 times of 100, between the least and the greatest disparity seen within this."""
UNSURE, UNSURE_BESIDE = 0.01, 0.06
"""Share of pixels more than 3 u off, as measured on real and rendered pairs: anywhere, and more beside what is hidden or unmatched."""
NOWHERE = -30000.0


@dataclass(frozen=True, eq=False)
class Disparity:
    """Of a rectified left picture.

    Attributes:
        px: (height, width) float32; NaN where there is no answer.
        sigma_px: (height, width) standard deviation, of the match alone; NaN where there is no answer.
        filled: (height, width) whether a pixel was filled from what is seen around it.
        low_px: least disparity that was looked for.
        high_px: greatest.
        unsure: estimated share of seen pixels that are on the wrong surface or mismatched, by more than their interval says.
    """

    px: Any
    sigma_px: Any
    filled: Bools
    low_px: int
    high_px: int
    unsure: float


def dense(left: Pixels, right: Pixels, low: int, high: int) -> Disparity:
    """Disparity of every pixel that both directions of matching agree on.

    Args:
        left: (height, width) uint8, rectified.
        right: likewise.
        low: least disparity to look for, px; may be negative.
        high: greatest.
    """
    count = max(16, -(-(high - low + 1) // 16) * 16)
    there = _match(left, right, low, count)
    back = _match(np.ascontiguousarray(right[:, ::-1]), np.ascontiguousarray(left[:, ::-1]), low, count)[:, ::-1]
    return _judged(left, right, there, _difference(there, back), low, low + count - 1)


def agreed(left: Pixels, right: Pixels, low: int, high: int) -> Array:
    """(n,) disparities that both directions of matching agree on, without their places; for a first look."""
    count = max(16, -(-(high - low + 1) // 16) * 16)
    there = _match(left, right, low, count)
    back = _match(np.ascontiguousarray(right[:, ::-1]), np.ascontiguousarray(left[:, ::-1]), low, count)[:, ::-1]
    kept = (_difference(there, back) <= MOST_DIFFERENCE_PX).astype(np.uint8)
    return np.asarray(there[_opencv().erode(kept, np.ones((3, 3), np.uint8)) > 0])


def of_map(left: Pixels, right: Pixels, px: Any, back: Any | None = None) -> Disparity:
    """The same for disparities that came from elsewhere, as from a network.

    Args:
        left: (height, width) uint8, rectified.
        right: likewise.
        px: (height, width) disparity of the left picture; NaN where there is none.
        back: that of the right picture, (height, width), positive too; None where there is none.
    """
    known = np.asarray(px, np.float32)
    difference = np.zeros_like(known) if back is None else _difference(known, np.asarray(back, np.float32))
    return _judged(left, right, known, difference, int(np.floor(np.nanmin(known))), int(np.ceil(np.nanmax(known))))


def _match(left: Pixels, right: Pixels, low: int, count: int) -> Any:
    """(height, width) float32 disparity by semi-global matching; NaN where there is none.

    Padded at the sides: OpenCV leaves out as many columns as it looks for disparities, though nearly all of them are seen twice.
    """
    cv2 = _opencv()
    # pixels nearer to the edge than the least disparity are seen once anyway
    before, behind = max(low + count, 0) - max(low, 0), max(-low, 0)
    matcher = cv2.StereoSGBM_create(
        minDisparity=low, numDisparities=count, blockSize=BLOCK_PX, P1=8 * BLOCK_PX**2, P2=32 * BLOCK_PX**2,
        disp12MaxDiff=1 << 20, preFilterCap=31, uniquenessRatio=0, speckleWindowSize=0, mode=cv2.STEREO_SGBM_MODE_SGBM_3WAY,
    )  # fmt: skip
    wide = [cv2.copyMakeBorder(one, 0, 0, before, behind, cv2.BORDER_REPLICATE) for one in (left, right)]
    found = matcher.compute(*wide)[:, before : before + left.shape[1]]
    px = found.astype(np.float32)
    px *= 1 / 16
    px[found < 16 * low] = np.nan
    return px


def _opencv() -> Any:
    """OpenCV, whose own annotations lack what its contributed and older parts have."""
    import cv2

    return cv2


def _difference(there: Any, back: Any) -> Any:
    """(height, width) float32: how far the two directions are apart; infinite where one has no answer."""
    import cv2

    height, width = there.shape
    x = np.arange(width, dtype=np.float32) - np.nan_to_num(there, nan=NOWHERE)
    rows = np.broadcast_to(np.arange(height, dtype=np.float32)[:, None], there.shape)
    theirs = cv2.remap(np.nan_to_num(back, nan=NOWHERE), x, rows, cv2.INTER_NEAREST, borderValue=NOWHERE)
    return np.where(theirs > NOWHERE / 2, abs(there - theirs), np.float32(np.inf))


def _judged(left: Pixels, right: Pixels, px: Any, difference: Any, low: int, high: int) -> Disparity:
    import cv2

    agreed = (difference <= MOST_DIFFERENCE_PX) & ~np.isnan(px)
    seen = cv2.erode(agreed.astype(np.uint8), cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (5, 5))) > 0
    if seen.any():
        whole = np.where(seen, np.round(16 * px), 16 * (low - 1)).astype(np.int16)
        cv2.filterSpeckles(whole, 16 * (low - 1), SPECKLE_PX, round(16 * SPECKLE_STEP_PX))
        seen = whole != 16 * (low - 1)
    near = np.ones((4 * REACH_PX + 1,) * 2, np.uint8)
    step, hole = _step(px, seen), cv2.erode(agreed.astype(np.uint8), near) == 0
    noise2 = _noise2(left, right, px, seen)[: len(px)]
    sigma = np.where(seen, difference, np.float32(0)) ** 2 / 2
    sigma += noise2 + np.float32(SUBPIXEL_PX**2) + np.square(step / np.float32(1.96))
    np.sqrt(sigma, out=sigma)
    unsure = float(UNSURE + UNSURE_BESIDE * np.mean(hole[seen])) if seen.any() else 1.0
    nothing = np.float32(np.nan)
    return Disparity(np.where(seen, px, nothing), np.where(seen, sigma, nothing).astype(np.float32),
                     np.zeros(px.shape, bool), low, high, unsure)  # fmt: skip


def _step(px: Any, seen: Bools) -> Any:
    """(height, width) float32: how much the disparity within reach departs from the pixel's, beyond what a slanted surface does."""
    greatest, least = _extremes(px, seen, REACH_PX)
    here = np.where(seen, px, np.float32(0))
    return np.where(
        seen, np.maximum(np.maximum(greatest - here, here - least) - np.float32(SLANT * REACH_PX), 0), np.float32(0)
    )


def _extremes(px: Any, seen: Bools, reach: int) -> tuple[Any, Any]:
    """(height, width) greatest and least disparity seen within a square; below and above all numbers where none is."""
    import cv2

    square = np.ones((2 * reach + 1,) * 2, np.uint8)
    greatest = cv2.dilate(np.where(seen, px, np.float32(NOWHERE)), square)
    return greatest, cv2.erode(np.where(seen, px, np.float32(-NOWHERE)), square)


def _noise2(left: Pixels, right: Pixels, px: Any, seen: Bools) -> Any:
    """(height, width) float32: square of noise over gradient, px. The noise is what the pictures differ by where they are matched.

    sigma_d = sigma_difference / sqrt(sum of squared gradients along the row), over the window that the costs are gathered in.
    """
    import cv2

    # every second row: windows are wider than that, and gradients along rows stay whole
    left, right, px, seen = left[::2], right[::2], px[::2], seen[::2]
    x = np.arange(px.shape[1], dtype=np.float32) - np.where(seen, px, np.float32(0))
    rows = np.broadcast_to(np.arange(px.shape[0], dtype=np.float32)[:, None], px.shape)
    theirs = cv2.remap(right, x, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    window = (2 * REACH_PX + 1, REACH_PX + 1)
    apart = cv2.subtract(left, theirs, dtype=cv2.CV_32F)
    mean = cv2.boxFilter(apart, -1, window)
    spread = np.maximum(cv2.sqrBoxFilter(apart, cv2.CV_32F, window) - mean * mean, np.float32(LEAST_NOISE**2))
    slope = cv2.subtract(left[:, 2:], left[:, :-2], dtype=cv2.CV_32F)
    energy = cv2.sqrBoxFilter(cv2.copyMakeBorder(slope, 0, 0, 1, 1, cv2.BORDER_REPLICATE), cv2.CV_32F, window)
    count = np.float32((2 * REACH_PX + 1) ** 2 / 4)  # pixels of the whole window; slopes are over two pixels
    return np.repeat(spread / np.maximum(count * energy, np.float32(1e-3)), 2, axis=0)


# -- filling ---------------------------------------------------------------------------------------------


def filled(found: Disparity) -> Disparity:
    """Pixels without an answer take the farther of what is seen to their left and right: what is hidden from one camera is behind.

    Their interval reaches from the least to the greatest disparity seen nearby, and as far beyond as a surface may slant on the way.
    """
    seen = ~np.isnan(found.px)
    before, behind, gap = _beside(found.px, seen)
    value = np.fmin(before, behind)
    greatest, least = _extremes(found.px, seen, NEARBY_PX)
    some = ~seen & ~np.isnan(value) & (greatest > NOWHERE / 2)
    spread = (np.maximum(greatest - value, value - least) + SLANT * gap) / 1.96
    sigma = np.sqrt(np.square(2 * SUBPIXEL_PX) + np.where(some, spread, 0) ** 2)
    return Disparity(np.where(some, value, found.px), np.where(some, sigma, found.sigma_px).astype(np.float32),
                     some, found.low_px, found.high_px, found.unsure)  # fmt: skip


def _beside(px: Any, seen: Bools) -> tuple[Any, Any, Any]:
    """(height, width) each: the nearest seen disparity to the left and to the right, NaN where there is none; and how far it is."""
    columns = np.broadcast_to(np.arange(px.shape[1], dtype=np.int32), px.shape)
    before = np.maximum.accumulate(np.where(seen, columns, -1), axis=1)
    behind = np.minimum.accumulate(np.where(seen, columns, px.shape[1])[:, ::-1], axis=1)[:, ::-1]
    sides = []
    for at, none in ((before, -1), (behind, px.shape[1])):
        value = np.take_along_axis(px, np.clip(at, 0, px.shape[1] - 1), 1)
        sides.append(np.where(at == none, np.float32(np.nan), value))
    return sides[0], sides[1], np.minimum(columns - before, behind - columns).clip(0, NEARBY_PX)


def smoothed(found: Disparity, guide: Pixels, strength: float = 300.0, colour: float = 8.0) -> Disparity:
    """Weighted least squares guided by the picture: smooth within things and sharp at their edges, and dense.

    What it moves a pixel by goes into the pixel's doubt. Pixels without an answer are filled by it, with the doubt of `filled`.

    Args:
        found: what was seen.
        guide: (height, width) or (height, width, 3) uint8, rectified.
        strength: of the smoothing.
        colour: gray levels that count as an edge.
    """
    import cv2

    seen, wide = ~np.isnan(found.px), filled(found)
    weight = np.where(seen, 1 / np.square(np.where(seen, found.sigma_px, 1)), 0).astype(np.float32)
    over = cv2.ximgproc.createFastGlobalSmootherFilter(guide, strength, colour)
    above, below = over.filter(weight * np.where(seen, found.px, 0)), over.filter(weight)
    value = above / np.maximum(below, 1e-6)
    here = ~np.isnan(wide.px)
    moved = np.where(here, value - wide.px, 0)
    return Disparity(np.where(here, value, np.float32(np.nan)), np.sqrt(wide.sigma_px**2 + moved**2).astype(np.float32),
                     wide.filled, found.low_px, found.high_px, found.unsure)  # fmt: skip


def resolved_share(found: Disparity) -> Array:
    """The share of pixels that are seen, and that are filled."""
    return np.array([np.mean(~np.isnan(found.px) & ~found.filled), np.mean(found.filled)])
