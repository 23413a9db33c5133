"""What a pair of pictures shows before it is matched densely: whether the two belong together and to the rig, and which disparities.

Features found in both pictures tell by how much rows differ, which side is which, and whether there is anything in common. The
range of disparities is theirs, together with that of a match at a small size.

Source: E. Rublee et al., ORB: an efficient alternative to SIFT or SURF, ICCV 2011; D. Lowe, Distinctive image features, IJCV 60, 2004.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .arrays import Array, Pixels
from .disparity import agreed
from .errors import GeometryError
from .quantity import Note

LEAST_CONTRAST = 2.0
"""Standard deviation of gray levels below which a picture shows nothing."""
ORB_PX = 640
"""Longer side of the pictures in which the first kind of features is looked for."""
ENOUGH = 30
"""Matches with which the first kind of features is enough."""
LEAST = 12
"""Matches that say something of the pair."""
ROW_TOLERANCE_PX = 0.75
"""By which rows may differ without harm."""
ROW_LIMIT_PX = 3.0
"""Beyond it matching along rows finds something else."""
SMALL_PX = 200
"""Width at which the range of disparities is looked for."""
MOST_DISPARITIES = 1024
NO_COMMON = 0.12
"""Share of pixels that matching in both directions agrees on, below which there is no overlap; chance alone makes a twentieth."""


@dataclass(frozen=True)
class PairFacts:
    """What the pictures told.

    Attributes:
        low_px: least disparity to look for.
        high_px: greatest.
        matches: features found in both.
        rows_px: median difference of rows, right less left; NaN where too few matches tell.
        notes: doubts.
    """

    low_px: int
    high_px: int
    matches: int
    rows_px: float
    notes: tuple[Note, ...] = field(default=())


def check_pair(left: Pixels, right: Pixels, doffs_px: float) -> PairFacts:
    """Look at a rectified pair.

    Args:
        left: (height, width) uint8, rectified.
        right: likewise.
        doffs_px: what is added to a disparity so that it is 0 at infinity.

    Raises:
        GeometryError: `no_texture`, `identical_pictures`, `left_right_swapped`, `not_rectified`, `no_overlap`.
    """
    _check_pictures(left, right)
    first, second = matched_features(left, right)
    rows, notes = _check_rows(left, first, second)
    apart = first[:, 0] - second[:, 0]
    straight = abs(second[:, 1] - first[:, 1] - (0.0 if math.isnan(rows) else rows)) < max(
        2.0, 2 * ROW_TOLERANCE_PX * left.shape[1] / SMALL_PX / 4
    )
    apart = apart[straight]
    _check_sides(apart + doffs_px, left.shape[1])
    low, high = _range(left, right, apart, doffs_px)
    return PairFacts(low, high, len(apart), rows, notes)


def _check_pictures(left: Pixels, right: Pixels) -> None:
    for name, one in (("left", left), ("right", right)):
        shown = one[one > 0] if np.any(one) else one  # what rectification left empty is 0
        if float(np.std(shown)) < LEAST_CONTRAST:
            raise GeometryError(
                f"the {name} picture is of one tone and shows nothing that could be found in the other; is its lens covered?",
                code="no_texture",
            )
    if left.shape == right.shape and float(np.mean(left != right)) < 1e-3:
        raise GeometryError("the two pictures are the same picture; give one of each camera", code="identical_pictures")


# -- features --------------------------------------------------------------------------------------------


def matched_features(left: Pixels, right: Pixels) -> tuple[Array, Array]:
    """(n, 2) px each: places of features that are each other's best, clearly."""
    import cv2 as opencv

    cv2: Any = opencv
    first, second = _matched(cv2.ORB_create(500), cv2.NORM_HAMMING, left, right, _scale(left, ORB_PX))
    if len(first) < ENOUGH:
        more = _matched(cv2.SIFT_create(1000), cv2.NORM_L2, left, right, _scale(left, 800))
        first, second = more if len(more[0]) > len(first) else (first, second)
    return first, second


def _scale(picture: Pixels, most_px: int) -> float:
    return float(min(1.0, most_px / max(picture.shape)))


def _matched(finder: Any, norm: int, left: Pixels, right: Pixels, scale: float) -> tuple[Array, Array]:
    import cv2

    seen = []
    for picture in (left, right):
        small = cv2.resize(picture, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA) if scale < 1 else picture
        seen.append(finder.detectAndCompute(small, None))
    nothing = np.zeros((0, 2))
    if any(described is None or len(described) < 2 for _, described in seen):
        return nothing, nothing
    pairs = cv2.BFMatcher(norm).knnMatch(seen[0][1], seen[1][1], k=2)
    good = [two[0] for two in pairs if len(two) == 2 and two[0].distance < 0.75 * two[1].distance]
    points = [np.array([seen[i][0][getattr(m, key)].pt for m in good]).reshape(-1, 2)
              for i, key in ((0, "queryIdx"), (1, "trainIdx"))]  # fmt: skip
    return points[0] / scale, points[1] / scale


def _check_rows(left: Pixels, first: Array, second: Array) -> tuple[float, tuple[Note, ...]]:
    """The median difference of rows, and what it says of the rig."""
    if len(first) < LEAST:
        text = f"only {len(first)} features are clearly the same in both pictures; whether the rig fits them could not be checked"
        return math.nan, (Note("rows_unchecked", text, "check the rig by a picture with more texture"),)
    rows = second[:, 1] - first[:, 1]
    middle = float(np.median(rows))
    near = rows[abs(rows - middle) < 2.5]
    if len(near) < max(LEAST, 0.4 * len(rows)):
        return _unlike(left, first, second, rows)
    middle = float(np.mean(near))  # places of features are whole pixels: their mean tells more than their median
    off = float(np.median(abs(near)))
    if abs(middle) > ROW_LIMIT_PX:
        raise _not_rectified(
            f"the right picture shows the same things {abs(middle):.1f} px {'lower' if middle > 0 else 'higher'}"
        )
    tolerance = max(ROW_TOLERANCE_PX, 0.35 / _scale(left, ORB_PX))
    if abs(middle) > tolerance or off > 2 * tolerance:
        text = (f"rows of the two pictures differ by {middle:.1f} px in the middle of {len(rows)} matches; the rig fits the pictures "
                "badly, and disparities may be off by as much")  # fmt: skip
        return middle, (Note("not_rectified", text, "calibrate the rig again, as it stands now"),)
    return middle, ()


def _unlike(left: Pixels, first: Array, second: Array, rows: Array) -> tuple[float, tuple[Note, ...]]:
    """Rows differ without order: pictures of one scene that are not rectified, or of different ones."""
    import cv2

    _, same = cv2.findFundamentalMat(first, second, cv2.FM_RANSAC, 1.5 / _scale(left, ORB_PX), 0.99)
    share = 0.0 if same is None else float(np.mean(same))
    if share >= 0.5 and share * len(first) >= 2 * LEAST:
        apart = float(np.median(abs(rows[np.ravel(same).astype(bool)])))
        raise _not_rectified(f"rows of the same things differ by {apart:.0f} px")
    return math.nan, ()


def _not_rectified(seen: str) -> GeometryError:
    return GeometryError(
        f"{seen}; the pair is not rectified and the rig does not fit it: give the rig that took these pictures, or leave out --rectified",
        code="not_rectified",
    )


def _check_sides(parallax: Array, width: int) -> None:
    """Nothing lies beyond infinity: where most does, left and right are exchanged."""
    beyond = parallax < -max(1.5, 0.003 * width)
    if len(parallax) >= LEAST and np.mean(beyond) > 0.6:
        raise GeometryError(
            "the right picture shows things farther to the right than the left one does; exchange the two pictures",
            code="left_right_swapped",
        )


# -- the range of disparities ----------------------------------------------------------------------------


def _range(left: Pixels, right: Pixels, apart: Array, doffs_px: float) -> tuple[int, int]:
    """Least and greatest disparity, with room; by features and by a match at a small size."""
    import cv2

    scale = min(1.0, SMALL_PX / left.shape[1])
    small = [cv2.resize(one, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA) for one in (left, right)]
    least = math.floor(-doffs_px * scale) - 2
    seen = agreed(small[0], small[1], least, least + round(0.5 * small[0].shape[1])) / scale
    # a pair in common shows most of one picture in the other; chance agrees here and there
    if len(seen) < NO_COMMON * small[0].size and len(apart) < LEAST:
        raise _nothing_in_common()
    ends = [np.quantile(seen, [0.002, 0.998])] if len(seen) > 100 else []
    ends += [np.quantile(apart, [0.01, 0.99])] if len(apart) >= LEAST else []
    if not ends:
        raise _nothing_in_common()
    low, high = min(e[0] for e in ends), max(e[1] for e in ends)
    room = 2 / scale + 0.05 * (high - low)
    low = max(low - room, -doffs_px - 2)
    high = min(max(high + room, low + 16), low + MOST_DISPARITIES, left.shape[1] - 1)
    return math.floor(low), math.ceil(high)


def _nothing_in_common() -> GeometryError:
    return GeometryError(
        "the two pictures have nothing in common that could be matched; give two pictures of one scene, taken side by side",
        code="no_overlap",
    )
