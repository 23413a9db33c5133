"""QR codes: found and read by OpenCV, then fitted as a whole in linear light, every module's edges together.

A version v has 4 v + 17 modules a side. What is found counts only where the finder and timing patterns of ISO/IEC 18004 stand
where they must; reading the text is not needed. The side is that of the whole symbol without its quiet zone: modules times
the module's size.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from ..arrays import Array, Bools, Pixels
from ..cell_pattern import CellFit, fit_cells, homography, mapped, sampled
from ..detection import Detection, Search
from ..observation import Observation
from ..photo import Photo
from ..quantity import Note
from ..subpixel import encoded_gray

LONGEST_TEXT = 20
"""Characters of a code's text that a label shows; it may be a stranger's."""
SMALLEST_PICTURE_PX = 21
LEAST_RIGHT = 0.93
"""Share of the finder and timing modules that must have their colour."""
WORST_MISFIT = 0.2
"""Rms residual over contrast beyond which the picture does not show this pattern."""
BENT_FROM = 0.04
"""Of a module: parts that lie farther off than this (rms) are noted."""
LARGER_UP_TO = 4_000_000
SCANNED_UP_TO = 1_000_000
"""Pixels up to which a picture without a code is looked at twice as large, and by the slower scanner, unasked."""

Seen = tuple[str, Array, int | None]
"""Text, (4, 2) rough corners, and modules a side where they were counted."""


def qr_codes(photo: Photo, search: Search | None = None) -> tuple[Detection, ...]:
    """QR codes in a photo, left to right.

    Args:
        photo: the picture.
        search: `curve`, `thorough` and `progress` of it are heeded.

    Returns:
        Squares: corners top-left, top-right, bottom-right, bottom-left of the symbol as it reads, with their covariance. The
        label tells text, version and modules a side.
    """
    search = search or Search()
    if min(photo.width_px, photo.height_px) < SMALLEST_PICTURE_PX or np.ptp(photo.pixels) < 12:
        return ()
    import cv2

    gray, encoded = cv2.cvtColor(photo.pixels, cv2.COLOR_RGB2GRAY), encoded_gray(photo.pixels)
    found: list[Detection] = []
    looks = _looks(cv2, gray, search.thorough)
    for number, look in enumerate(looks, 1):
        for text, corners, modules in look():
            if any(_inside(corners.mean(axis=0), other.seen.points_px) for other in found):
                continue
            fitted = _located(encoded, corners, modules, float(search.curve.value))
            found += [_detection(text, *fitted)] if fitted else []
        search.progress(number / len(looks))
        if found and number >= 2 and not search.thorough:
            break
    search.progress(1.0)
    return tuple(sorted(found, key=lambda one: float(one.seen.points_px[:, 0].mean())))


def _looks(cv2: Any, gray: Pixels, thorough: bool) -> list[Callable[[], list[Seen]]]:
    """Ways to look: both of OpenCV's detectors; then, for want of any, on a larger picture, and the scanner from WeChat."""
    makers = [make for name in ("QRCodeDetector", "QRCodeDetectorAruco") if (make := getattr(cv2, name, None))]
    looks: list[Callable[[], list[Seen]]] = [partial(_decoded, cv2, make, gray, 1) for make in makers]
    if thorough or gray.size <= LARGER_UP_TO:
        looks += [partial(_decoded, cv2, make, gray, 2) for make in makers]
    if hasattr(cv2, "wechat_qrcode") and (thorough or gray.size <= SCANNED_UP_TO):
        looks.append(partial(_scanned, cv2, gray))
    return looks


def _decoded(cv2: Any, make: Any, gray: Pixels, larger: int) -> list[Seen]:
    """What one of OpenCV's detectors sees in the picture made `larger` times larger."""
    if larger > 1:
        gray = cv2.resize(gray, None, fx=larger, fy=larger, interpolation=cv2.INTER_CUBIC)
    try:
        _, texts, quads, straight = make().detectAndDecodeMulti(gray)
    except (cv2.error, UnicodeDecodeError):  # some pictures of noise are more than it bears; texts may be no text
        return []
    if quads is None:
        return []
    codes = list(straight) if straight is not None else [None] * len(quads)
    return [
        (text, (_four(quad) + 0.5) / larger - 0.5, code.shape[0] if code is not None and code.size > 1 else None)
        for text, quad, code in zip(texts, quads, codes, strict=False)
    ]


def _scanned(cv2: Any, gray: Pixels) -> list[Seen]:
    """Those of the scanner from WeChat, which bears more blur and takes longer; its corners are the roughest."""
    try:
        texts, quads = cv2.wechat_qrcode.WeChatQRCode().detectAndDecode(gray)
    except (cv2.error, UnicodeDecodeError):
        return []
    return [(text, _four(quad), None) for text, quad in zip(texts, quads, strict=False)]


def _four(quad: Array) -> Array:
    return np.reshape(quad, (4, 2)).astype(float)


def _inside(point: Array, quad: Array) -> bool:
    edge, to = np.roll(quad, -1, axis=0) - quad, point - quad
    turn = edge[:, 0] * to[:, 1] - edge[:, 1] * to[:, 0]
    return bool(np.all(turn > 0) or np.all(turn < 0))


def function_modules(modules: int) -> tuple[Bools, Bools]:
    """(n, n) which modules of a symbol have a colour that its version alone tells, and whether that is light.

    Source: ISO/IEC 18004:2015, 6.3.3 to 6.3.6: finder patterns, separators, timing patterns, the dark module, and the
    alignment pattern next to the corner without a finder pattern.
    """
    known, light = np.zeros((modules, modules), bool), np.zeros((modules, modules), bool)
    ring = np.maximum(*np.abs(np.mgrid[-4:5, -4:5]))
    for row, column in ((3, 3), (3, modules - 4), (modules - 4, 3)):
        rows, columns = np.mgrid[row - 4 : row + 5, column - 4 : column + 5]
        within = (rows >= 0) & (columns >= 0) & (rows < modules) & (columns < modules)
        known[rows[within], columns[within]] = True
        light[rows[within], columns[within]] = np.isin(ring, (2, 4))[within]
    along = np.arange(8, modules - 8)
    for index in ((6, along), (along, 6)):
        known[index], light[index] = True, along % 2 == 1
    known[modules - 8, 8] = True
    if modules >= 25:
        at = slice(modules - 9, modules - 4)
        known[at, at], light[at, at] = True, (ring[2:7, 2:7] == 1)
    return known, light


def _located(encoded: Array, corners: Array, modules: int | None, exponent: float) -> tuple[CellFit, int] | None:
    """The symbol fitted, and its modules a side; None where it is no QR code after all."""
    if not np.all(np.isfinite(corners)):
        return None
    sizes = [modules] if modules else _likely(encoded, corners)
    for size in sizes:
        fit = _fitted(encoded, corners, size, exponent)
        if fit is not None:
            return fit, size
    return None


def _likely(encoded: Array, corners: Array) -> list[int]:
    """The sizes whose finder and timing modules fit best, best first."""
    scores = {size: _right(_read(encoded, corners, size), size) for size in range(21, 178, 4)}
    return [size for size in sorted(scores, key=lambda size: -scores[size])[:4] if scores[size] > 0.75]


def _read(encoded: Array, corners: Array, modules: int) -> Bools:
    """(n, n) whether each module is light: its middle against the middle levels around it."""
    v, u = np.mgrid[0:modules, 0:modules] + 0.5
    at = mapped(homography(modules, corners), np.stack([u.ravel(), v.ravel()], -1))
    if not np.all(np.isfinite(at)):
        return np.zeros((modules, modules), bool)
    value = sampled(encoded, at).reshape(modules, modules)
    from scipy.ndimage import maximum_filter, minimum_filter, uniform_filter

    width = 9  # spans a finder pattern, so that both colours are in it
    middle = (minimum_filter(value, width) + maximum_filter(value, width)) / 2
    return np.asarray(value > uniform_filter(middle, width))


def _right(cells: Bools, modules: int) -> float:
    """Share of the modules known beforehand that have their colour; dark and light count alike."""
    known, light = function_modules(modules)
    same = cells == light
    return float(min(same[known & light].mean(), same[known & ~light].mean()))


def _fitted(encoded: Array, corners: Array, modules: int, exponent: float) -> CellFit | None:
    """Modules are read, the pattern is fitted to them, and both again until no module changes."""
    fit, cells = None, _read(encoded, corners, modules)
    for _ in range(4):
        known, light = function_modules(modules)
        fit = fit_cells(encoded, np.where(known, light, cells), corners, exponent=exponent)
        if fit is None:
            return None
        before, corners = cells, fit.corners_px
        cells = _read(encoded, corners, modules)
        if np.array_equal(before, cells):
            break
    if fit is None or fit.misfit > WORST_MISFIT or _right(cells, modules) < LEAST_RIGHT:
        return None
    height, width = encoded.shape
    if np.any(fit.corners_px < -0.5) or np.any(fit.corners_px > np.array([width, height]) - 0.5):
        return None
    return fit


def _detection(text: str, fit: CellFit, modules: int) -> Detection:
    shown = "".join(c for c in text if c.isprintable())[:LONGEST_TEXT]
    shown += "…" if shown and len(text) > LONGEST_TEXT else ""
    named = f"'{shown}' " if shown else ""
    label = f"QR code {named}version {(modules - 17) // 4}, {modules} modules a side"
    module_px = float(np.hypot(*(np.roll(fit.corners_px, -1, axis=0) - fit.corners_px).T).mean()) / modules
    notes: tuple[Note, ...] = ()
    if fit.bent_px > BENT_FROM * module_px:
        notes = (Note("not_flat", f"parts of the code lie {fit.bent_px:.2g} px off where a flat one has them (rms); this is in u",
                      "lay it flat, and calibrate the camera"),)  # fmt: skip
    seen = Observation(fit.corners_px, cov=fit.cov, label=label, source="modules of the code")
    return Detection(seen, "square", notes=notes)
