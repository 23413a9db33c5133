"""AprilTag families whose data lie outside the border too, found by the AprilTag library (extra `apriltag`).

The library's pixels begin at their edges, half a pixel before ours. Its corners are those of the border, which is what the size
of such a tag is measured at: across the whole pattern it would be 9/5 as large, or 10/6, or 11/5. They are fitted again with the
whole pattern, whose cells are read from the picture.

Source: M. Krogius, A. Haggenmiller, E. Olson, Flexible layouts for fiducial tags, IROS 2019.
"""

from __future__ import annotations

import threading
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from .arrays import Array, Pixels
from .errors import MissingExtraError
from .pattern import fit_pattern
from .quantity import Quantity

FAMILIES: dict[str, tuple[str, int, int]] = {
    "standard41h12": ("tagStandard41h12", 9, 5), "standard52h13": ("tagStandard52h13", 10, 6),
    "circle21h7": ("tagCircle21h7", 9, 5), "circle49h12": ("tagCircle49h12", 11, 5),
    "custom48h12": ("tagCustom48h12", 10, 6),
}  # fmt: skip
"""Family: the library's name, cells across the whole pattern, and across the border."""
LEAST_MARGIN = 40.0
"""The library's decision margin below which a tag is not believed."""
_ONE_AT_A_TIME = threading.Lock()


@dataclass(frozen=True)
class Tag:
    """A tag that the library found.

    Attributes:
        number: its id.
        corners_px: (4, 2) of its border: top-left, top-right, bottom-right, bottom-left as printed.
    """

    number: int
    corners_px: Array


@cache
def _detector(name: str) -> Any:
    try:
        import pyapriltags
    except ImportError:
        raise MissingExtraError("tags of this family are found by the AprilTag library", "apriltag") from None
    return pyapriltags.Detector(families=name, quad_decimate=1.0)


def find(gray: Pixels, family: str) -> list[Tag]:
    """Tags of a family in a (H, W) uint8 picture.

    Raises:
        MissingExtraError: the library is not installed.
    """
    if min(gray.shape) < 16:
        return []
    with _ONE_AT_A_TIME:
        found = _detector(FAMILIES[family][0]).detect(np.ascontiguousarray(gray))
    return [Tag(int(one.tag_id), np.asarray(one.corners, float)[::-1] - 0.5)
            for one in found if one.decision_margin >= LEAST_MARGIN and one.hamming == 0]  # fmt: skip


def located(gray: Array, tag: Tag, family: str, curve: Quantity, floor_px: float) -> tuple[Array, Array, float] | None:
    """The border's corners (4, 2) with covariance (8, 8) and the misfit, by a fit of the whole pattern.

    Args:
        gray: (H, W) encoded luminance, 0 to 1.
        tag: as found.
        family: of FAMILIES.
        curve: exponent of the transfer curve.
        floor_px: see `pattern.FLOOR_PX`.

    Returns:
        None where no such pattern is to be seen.
    """
    _, total, border = FAMILIES[family]
    outer = (total - border) / 2 / border
    inner = outer / (1 + 2 * outer)
    whole = _carried(tag.corners_px, -outer)
    fitted = fit_pattern(gray, whole, _cells(gray, whole, total), curve, floor_px)
    if fitted is None:
        return None
    corners = _carried(fitted.corners_px, inner)
    jac = np.empty((8, 8))
    for i in range(8):
        moved = fitted.corners_px.ravel().copy()
        moved[i] += 1e-3
        jac[:, i] = (_carried(moved.reshape(4, 2), inner) - corners).ravel() / 1e-3
    return corners, jac @ fitted.cov @ jac.T, fitted.misfit


def _carried(corners: Array, inset: float) -> Array:
    """(4, 2) corners of the square that lies `inset` of a side within (or, negative, around) a square seen in perspective."""
    square = np.array([[inset, inset], [1 - inset, inset], [1 - inset, 1 - inset], [inset, 1 - inset]])
    return _places(corners, square)


def _places(corners: Array, square: Array) -> Array:
    """(k, 2) pixels of places in the unit square."""
    import cv2

    unit = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
    middle = corners.mean(axis=0)  # single precision holds what lies about 0
    matrix = np.asarray(cv2.getPerspectiveTransform(unit, (corners - middle).astype(np.float32)), float)
    seen = np.concatenate([square, np.ones((len(square), 1))], axis=1) @ matrix.T
    return np.asarray(seen[:, :2] / seen[:, 2:] + middle)


def _cells(gray: Array, corners: Array, count: int) -> Array:
    """(count, count) 1 light, 0 dark, as the cells' middles look."""
    import cv2

    at = (np.arange(count) + 0.5) / count
    a, b = np.meshgrid(at, at)
    x, y = _places(corners, np.stack([a.ravel(), b.ravel()], -1)).T.astype(np.float32)
    soft = cv2.blur(gray.astype(np.float32), (3, 3))
    seen = cv2.remap(soft, x[None], y[None], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)[0]
    return np.asarray((seen > (seen.min() + seen.max()) / 2).astype(float).reshape(count, count))
