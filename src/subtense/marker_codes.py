"""The codes of marker families, and reading them from a picture: which marker a quadrilateral is, if any.

A marker is a black square with a border one cell wide around cells of bits, on a light ground. Its cells are sampled through the
homography of its corners; where they are only few pixels wide, they are had from the pixels by least squares through the blur,
since a cell then shines into its neighbours.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from .arrays import Array, Indices, Pixels

FAMILIES: dict[str, tuple[str, int]] = {
    "36h11": ("DICT_APRILTAG_36h11", 8), "25h9": ("DICT_APRILTAG_25h9", 7), "36h10": ("DICT_APRILTAG_36h10", 8),
    "16h5": ("DICT_APRILTAG_16h5", 6), "aruco_mip_36h12": ("DICT_ARUCO_MIP_36h12", 8),
    "aruco_original": ("DICT_ARUCO_ORIGINAL", 7), "7x7": ("DICT_7X7_1000", 9), "6x6": ("DICT_6X6_1000", 8),
    "5x5": ("DICT_5X5_1000", 7), "4x4": ("DICT_4X4_1000", 6),
}  # fmt: skip
"""Family: OpenCV's name, and cells across its black square. Earlier families win where a marker reads in two. OpenCV's
dictionaries of 50, 100 and 250 are the first markers of those of 1000."""
WEAK = ("16h5", "aruco_original", "4x4")
"""Families of which every 16th dark square reads as a marker, or a dark square with a stripe."""
BORDER_SEEN = 0.85
"""Share of the border's cells that must read dark."""
BORDER_GUESSED = 0.6
"""The same before the blur is undone."""
LEAST_CONTRAST = 12
"""Of the ring around a marker over its border, encoded values of 255."""
FINE_CELL_PX = 4.5
"""Cells narrower than this are read through the blur."""
CONJUGATE_STEPS = 12
READING_BLUR_PX = 0.9
"""Radius of the blur that is assumed in reading."""


@dataclass(frozen=True)
class Reading:
    """A marker that a quadrilateral reads as.

    Attributes:
        family: of FAMILIES.
        number: its id.
        turns: quarter turns, so that corner (i - turns) % 4 of the quadrilateral is corner i of the marker.
        wrong: bits that were corrected.
    """

    family: str
    number: int
    turns: int
    wrong: int


@cache
def codes(family: str) -> Array:
    """(markers, 4, bits, bits) bool, True light: every marker, and as it reads after 0 to 3 quarter turns of the corners."""
    import cv2

    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, FAMILIES[family][0]))
    size = int(dictionary.markerSize)
    read = cv2.aruco.Dictionary.getBitsFromByteList
    bits = np.stack([np.asarray(read(dictionary.bytesList[i : i + 1], size)) for i in range(len(dictionary.bytesList))])
    return np.stack([np.rot90(bits, turn, axes=(1, 2)) for turn in range(4)], axis=1).astype(bool)


@cache
def _numbers(family: str) -> tuple[Any, dict[int, int]]:
    """(4 markers,) the codes as whole numbers, marker by marker and turn by turn; and where each stands."""
    known = codes(family)
    numbers = _number(known.reshape(-1, known.shape[2] * known.shape[3]))
    places: dict[int, int] = {}
    for place, number in enumerate(numbers.tolist()):
        places.setdefault(number, place)
    return numbers, places


def _number(bits: Array) -> Any:
    """(...) whole numbers of (..., bits)."""
    return np.asarray(bits.astype(np.uint64) @ (np.uint64(1) << np.arange(bits.shape[-1], dtype=np.uint64)))


def _ones(numbers: Any) -> Indices:
    """How many bits of whole numbers are 1."""
    return np.asarray(np.unpackbits(np.ascontiguousarray(numbers)[:, None].view(np.uint8), axis=1).sum(axis=1))


@cache
def _corrected(family: str) -> int:
    """How many wrong bits its distance would let one correct."""
    import cv2

    return int(cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, FAMILIES[family][0])).maxCorrectionBits)


def cells_of(family: str, number: int) -> Array:
    """(n, n) cells of a marker with its border, 1 light."""
    return np.pad(codes(family)[number, 0].astype(float), 1)


def rimmed(gray: Pixels, quads: list[Array]) -> list[Array]:
    """Those of the quadrilaterals that are darker along their sides within than without, as markers are; clearest first."""
    import cv2

    if not quads:
        return []
    along = (np.arange(6) + 0.5) / 6
    inset = np.array([0.06, -0.06])
    a, b = (part.ravel() for part in np.meshgrid(along, inset))
    square = np.concatenate([np.stack(pair, -1) for pair in ((a, b), (1 - b, a), (a, 1 - b), (b, a))])
    maps = np.stack([_map(quad) for quad in quads])
    places = np.concatenate([square, np.ones((len(square), 1))], axis=1) @ np.swapaxes(maps, 1, 2)
    with np.errstate(all="ignore"):
        x, y = (np.nan_to_num(places[..., i] / places[..., 2], nan=-1e4).astype(np.float32) for i in range(2))
    seen = cv2.remap(gray, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE).astype(float)
    within = np.tile(b >= 0, 4)
    dark, light = np.median(seen[:, within], axis=1), np.median(seen[:, ~within], axis=1)
    darker = np.mean(seen[:, within] < ((dark + light) / 2)[:, None], axis=1)
    rank = np.where((light - dark >= LEAST_CONTRAST / 2) & (darker >= BORDER_GUESSED), light - dark, 0.0)
    return [quads[i] for i in np.argsort(-rank, kind="stable") if rank[i] > 0]


class Reader:
    """Reads one quadrilateral; what was sampled for one family serves the others of its size.

    Args:
        gray: (H, W) uint8.
        corners_px: (4, 2) in order around, clockwise as seen.
    """

    def __init__(self, gray: Pixels, corners_px: Array) -> None:
        self._gray, self._corners = gray, np.asarray(corners_px, float)
        self._side_px = float(np.mean(np.hypot(*(np.roll(self._corners, -1, axis=0) - self._corners).T)))
        self._sampled: dict[tuple[int, bool], Array | None] = {}

    def read(self, family: str, correct: float = 0.0, *, fine: bool = False) -> Reading | None:
        """What it is in a family.

        Args:
            family: of FAMILIES.
            correct: share of the correctable bits that may be corrected.
            fine: whether narrow cells are read through the blur.
        """
        size = FAMILIES[family][1]
        if fine and self._side_px >= FINE_CELL_PX * size:
            fine = False
        if (size, fine) not in self._sampled:
            self._sampled[size, fine] = _bits(self._gray, self._corners, size, fine=fine)
        seen = self._sampled[size, fine]
        if seen is None:
            return None
        numbers, places = _numbers(family)
        number = _number(seen.ravel())
        place = places.get(int(number))
        if place is not None:
            return Reading(family, *divmod(place, 4), 0)
        most = int(correct * _corrected(family))
        if most == 0:
            return None
        wrong = _ones(numbers ^ number)
        place = int(np.argmin(wrong))
        return Reading(family, *divmod(place, 4), int(wrong[place])) if wrong[place] <= most else None


def _bits(gray: Pixels, corners: Array, size: int, *, fine: bool) -> Array | None:
    """(bits, bits) True light; None where the border is not dark."""
    values = _sampled(gray, corners, size)
    border = np.ones((size, size), bool)
    border[1:-1, 1:-1] = False
    for again in (False, True):
        if values is None:
            return None
        dark, light = float(np.median(values[1:-1, 1:-1][border])), float(np.median(_ring(values)))
        if light - dark < LEAST_CONTRAST:
            return None
        bits = values[1:-1, 1:-1] > (dark + light) / 2
        if np.mean(~bits[border]) < (BORDER_SEEN if again or not fine else BORDER_GUESSED):
            return None
        if again or not fine:
            break
        values = _unblurred(gray, corners, size)
    return np.asarray(bits[1:-1, 1:-1])


def _ring(values: Array) -> Array:
    """The outermost cells."""
    return np.concatenate([values[0], values[-1], values[1:-1, 0], values[1:-1, -1]])


def _map(corners: Array) -> Array:
    """(3, 3) from the unit square to pixels."""
    import cv2

    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
    return np.asarray(cv2.getPerspectiveTransform(square, corners.astype(np.float32)), float)


def _sampled(gray: Pixels, corners: Array, size: int) -> Array | None:
    """(size + 2, size + 2) mean of each cell's middle, with the ring of light cells around."""
    import cv2

    offsets = np.array([-0.2, 0.0, 0.2])
    at = ((np.arange(-1, size + 1) + 0.5)[:, None] + offsets).ravel() / size
    a, b = np.meshgrid(at, at)
    places = np.stack([a.ravel(), b.ravel(), np.ones(a.size)], -1) @ _map(corners).T
    if np.any(places[:, 2] * places[0, 2] <= 0):
        return None
    x, y = places[:, 0] / places[:, 2], places[:, 1] / places[:, 2]
    grid = (len(at), len(at))
    seen = cv2.remap(gray, x.reshape(grid).astype(np.float32), y.reshape(grid).astype(np.float32), cv2.INTER_LINEAR,
                     borderMode=cv2.BORDER_REPLICATE)  # fmt: skip
    return np.asarray(seen.reshape(size + 2, 3, size + 2, 3).mean(axis=(1, 3)), float)


def _unblurred(gray: Pixels, corners: Array, size: int) -> Array | None:
    """The same by least squares: each pixel is a sum of cells, weighed by how far the blur carries them."""
    from scipy.special import ndtr

    n = size + 2
    margin = float(np.max(np.ptp(corners, axis=0))) / size
    low = np.maximum(np.floor(corners.min(axis=0) - margin).astype(int), 0)
    high = np.minimum(np.ceil(corners.max(axis=0) + margin).astype(int) + 1, gray.shape[::-1])
    yy, xx = np.mgrid[low[1] : high[1], low[0] : high[0]]
    inverse = np.linalg.pinv(_map(corners))
    seen = np.stack([xx.ravel(), yy.ravel(), np.ones(xx.size)], -1) @ inverse.T
    with np.errstate(all="ignore"):
        a, b = (seen[:, i] / seen[:, 2] * size + 1 for i in range(2))
    inside = (a > 0.2) & (a < n - 0.2) & (b > 0.2) & (b < n - 0.2)
    if np.count_nonzero(inside) < n * n:
        return None
    side = float(np.mean(np.hypot(*(np.roll(corners, -1, axis=0) - corners).T)))
    sigma = READING_BLUR_PX / side * size
    edges = np.arange(n + 1)
    in_a = -np.diff(ndtr((a[inside, None] - edges) / sigma), axis=1)
    in_b = -np.diff(ndtr((b[inside, None] - edges) / sigma), axis=1)
    weights = (in_b[:, :, None] * in_a[:, None, :]).reshape(-1, n * n)
    values = gray[yy.ravel()[inside], xx.ravel()[inside]].astype(float)
    middle = values.mean()
    return np.asarray(_damped(weights, values - middle).reshape(n, n) + middle)


def _damped(weights: Array, values: Array) -> Array:
    """(cells,) least squares by conjugate gradients, ended early, which leaves what the pixels can't tell near the mean."""
    x = np.zeros(weights.shape[1])
    residual = weights.T @ values
    step, size = residual.copy(), float(residual @ residual)
    for _ in range(CONJUGATE_STEPS):
        moved = weights @ step
        length = float(moved @ moved)
        if length <= 0:
            break
        rate = size / length
        x += rate * step
        residual -= rate * (weights.T @ moved)
        last, size = size, float(residual @ residual)
        step = residual + size / max(last, 1e-12) * step
    return x
