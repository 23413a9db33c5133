"""Dark quadrilaterals in a picture: outlines of what is darker than its surroundings, with four straight sides."""

from __future__ import annotations

from typing import Any

import numpy as np

from .arrays import Array, Pixels

WINDOWS_PX = (5, 13, 23)
"""Surroundings whose mean a pixel is compared with; small ones part what lies close, large ones bridge soft edges."""
LEAST_CONTRAST = 7
FULL = 0.012
"""Least area over the square of the outline's length; a square has 1/16, one turned by 80 degrees 0.03."""
STRAIGHT = 0.035
"""Of the outline's length: how far it may stray from its four sides."""


def dark_quads(gray: Pixels, smallest_px: float) -> list[Array]:
    """Dark quadrilaterals, each (4, 2), clockwise as seen; one thing may come several times.

    Args:
        gray: (H, W) uint8.
        smallest_px: shortest mean side.
    """
    import cv2

    found: list[Array] = []
    if min(gray.shape) < 5:
        return found
    for window in WINDOWS_PX:
        if window > min(gray.shape):
            break
        binary = cv2.adaptiveThreshold(
            gray, 255, cv2.ADAPTIVE_THRESH_MEAN_C, cv2.THRESH_BINARY_INV, window, LEAST_CONTRAST
        )
        outlines, _ = cv2.findContours(binary, cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)
        for outline in outlines:
            if len(outline) >= 3.4 * smallest_px and (quad := _quad(cv2, outline, smallest_px)) is not None:
                found.append(quad)
    return _apart(found)


def _quad(cv2: Any, outline: Any, smallest_px: float) -> Array | None:
    if cv2.contourArea(outline) < FULL * len(outline) ** 2:
        return None
    polygon = cv2.approxPolyDP(outline, STRAIGHT * len(outline), True)
    if len(polygon) != 4 or not cv2.isContourConvex(polygon):
        return None
    corners = np.reshape(polygon, (4, 2)).astype(float)
    edges = np.roll(corners, -1, axis=0) - corners
    sides = np.hypot(*edges.T)
    if sides.mean() < smallest_px or sides.min() < 0.15 * sides.max():
        return None
    corners = _straightened(np.reshape(outline, (-1, 2)).astype(float), corners)
    turn = edges[0, 0] * edges[1, 1] - edges[0, 1] * edges[1, 0]
    return corners if turn > 0 else corners[::-1].copy()


def _straightened(outline: Array, corners: Array) -> Array:
    """Where lines through the outline's sides meet; the rough corners where that leads away."""
    at = [int(np.argmin(np.abs(outline - corner).sum(axis=1))) for corner in corners]
    forward = sum((at[(i + 1) % 4] - at[i]) % len(outline) for i in range(4)) == len(outline)
    lines = []
    for i in range(4):
        first, last = (at[i], at[(i + 1) % 4]) if forward else (at[(i + 1) % 4], at[i])
        count = (last - first) % len(outline)
        skip = max(1, count // 8)
        points = outline[(first + np.arange(skip, max(count - skip + 1, skip + 2))) % len(outline)]
        middle = points.mean(axis=0)
        dx, dy = (points - middle).T
        angle = 0.5 * np.arctan2(2 * float(dx @ dy), float(dx @ dx - dy @ dy))
        normal = np.array([-np.sin(angle), np.cos(angle)])
        lines.append((normal, float(normal @ middle)))
    out = corners.copy()
    for i in range(4):
        (n1, c1), (n2, c2) = lines[i - 1], lines[i]
        det = n1[0] * n2[1] - n1[1] * n2[0]
        if abs(det) > 0.1:
            meet = np.array([c1 * n2[1] - c2 * n1[1], n1[0] * c2 - n2[0] * c1]) / det
            if np.hypot(*(meet - corners[i])) < 4:
                out[i] = meet
    return out


def _apart(found: list[Array]) -> list[Array]:
    """Without what is the same within two pixels, from either side of one line."""
    kept: list[Array] = []
    places: set[tuple[int, ...]] = set()
    for quad in found:
        start = int(np.argmin(quad.sum(axis=1)))
        key = tuple(np.round(np.roll(quad, -start, axis=0).ravel() / 2).astype(int).tolist())
        if key not in places:
            places.add(key)
            kept.append(quad)
    return kept
