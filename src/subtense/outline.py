"""The outline of a thing in a picture: its contour located at the edges, and its extents with their covariance.

A segmentation gives a mask, which is good to a pixel or two. Each point of its contour is moved along its normal to the step that is
there, where light is in the middle between both sides; points without a step stay, and are known that much worse. An extent
is the distance between two parallel lines that touch the outline (Feret); where each touches is fitted over the stretch
of contour near it, as the farthest of many scattered points would lie too far out. Sigma of a touching line has the
scatter of its stretch, how other runs of the segmentation put it, and the transfer curve, which moves both out or in together.

Source: H. Freeman, R. Shapira, Determining the minimum-area encasing rectangle for an arbitrary closed curve, CACM 18 (1975).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from .arrays import Array, Bools, Pixels
from .observation import Observation
from .quantity import Note
from .subpixel import CURVE, CURVE_U, PIXEL_BLUR

EXTENTS = ("longest", "shortest", "width", "height")
LEAST_STEP = 0.04
"""Encoded step of the weakest edge that a contour is moved to."""
EDGE_SIGMA_PX = 0.15
"""How far a located edge may lie off, whatever its scatter says: uneven grounds, light around rims."""
ROUNDED_PX = 4.0
"""How far on either side of a corner the located contour is rounded by smoothing and blur."""
MOST_ADDED_PX = 2.5
MOST_POINTS = 720
_STEP_PX = 0.5


@dataclass(frozen=True, eq=False)
class Contour:
    """A closed line around a thing.

    Attributes:
        points_px: (N, 2), evenly spaced.
        sigma_px: (N,) standard deviation across, of each by itself.
        located: (N,) whether an edge was found there.
        blur_px: of the edges, the median.
    """

    points_px: Array
    sigma_px: Array
    located: Bools
    blur_px: float


@dataclass(frozen=True, eq=False)
class Outline:
    """A thing in a picture.

    Attributes:
        mask: (H, W) True on it.
        contour: around it.
        extents: by EXTENTS: the two ends of each, with covariance; `box`: four corners of the narrowest box around it.
        area_px: in square pixels.
        u_area_px: its standard deviation.
        notes: `outline_ambiguous`, `outline_unsharp`, `cut_by_border`.
    """

    mask: Bools
    contour: Contour
    extents: Mapping[str, Observation]
    area_px: float
    u_area_px: float
    notes: tuple[Note, ...] = ()


# -- the contour --------------------------------------------------------------------------------------


def evenly(points: Array, count: int) -> Array:
    """(count, 2) points at even distances along a closed line."""
    closed = np.concatenate([points, points[:1]])
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(closed, axis=0).T))])
    at = np.arange(count) * along[-1] / count
    return np.stack([np.interp(at, along, closed[:, k]) for k in (0, 1)], -1)


def smoothed(values: Array, width: float) -> Array:
    """Along a closed line, by a Gaussian of `width` points."""
    from scipy.ndimage import gaussian_filter1d

    return np.asarray(gaussian_filter1d(values, max(width, 1e-3), axis=0, mode="wrap"))


def normals_of(points: Array) -> Array:
    """(N, 2) outward unit normals of a closed line."""
    along = np.roll(points, -1, axis=0) - np.roll(points, 1, axis=0)
    normal = np.stack([along[:, 1], -along[:, 0]], -1)
    normal /= np.maximum(np.hypot(*normal.T), 1e-9)[:, None]
    return normal if signed_area(points) > 0 else -normal


def signed_area(points: Array) -> float:
    """Area in a closed line, above 0 where it goes round clockwise as seen (y down)."""
    x, y = points.T
    return float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)) / 2


def located(pixels: Pixels, rough: Array, doubt_px: float) -> Contour:
    """Move a rough contour to the edges near it.

    Args:
        pixels: (H, W, 3) encoded.
        rough: (N, 2) closed, as a mask has it.
        doubt_px: how far off it may be (1s).
    """
    length = float(np.sum(np.hypot(*(np.roll(rough, -1, axis=0) - rough).T)))
    count = int(np.clip(length, 24, MOST_POINTS))
    points, spacing = evenly(rough, count), length / count
    blur = np.full(count, np.nan)
    sure = np.zeros(count, bool)
    for reach in (2.5 * doubt_px + 2.0, 3.0):
        points = smoothed(points, max(0.7 * min(doubt_px, reach / 2) / spacing, 0.5))
        normal = normals_of(points)
        moved, blur, sure = _steps(pixels, points, normal, reach)
        moved, sure = _agreeing(moved, sure, spacing)
        points = points + moved[:, None] * normal
    scatter = moved - smoothed(moved, 2.0)
    own = 1.4826 * float(np.median(np.abs(scatter[sure]))) if sure.sum() > 8 else doubt_px
    sigma = np.where(sure, max(own, 0.05), doubt_px)
    known = blur[sure & np.isfinite(blur)]
    return Contour(points, sigma, sure, float(np.median(known)) if len(known) else math.nan)


def _steps(pixels: Pixels, points: Array, normal: Array, reach: float) -> tuple[Array, Array, Bools]:
    """(N,) how far along its normal each point's edge lies, its blur, and whether there is one."""
    n = np.arange(-reach - 3.0, reach + 3.0 + _STEP_PX / 2, _STEP_PX)
    along = np.stack([-normal[:, 1], normal[:, 0]], -1)
    profile = np.zeros((len(points), len(n), 3))
    for t in (-1.0, 0.0, 1.0):
        profile += _read(pixels, points[:, None] + n[:, None] * normal[:, None] + t * along[:, None]) / 3
    inner, outer = n < -reach * 0.4, n > reach * 0.4
    # of the colours the one in which inside and outside differ most there, averaged along the contour
    apart = smoothed(profile[:, inner].mean(axis=1) - profile[:, outer].mean(axis=1), 3.0)
    weight = apart / np.maximum(np.linalg.norm(apart, axis=1), 1e-9)[:, None]
    value = np.einsum("pnc,pc->pn", profile, np.abs(weight) * np.sign(weight))
    slope = -np.gradient(value, axis=1)  # outward it falls
    strength = slope * np.exp(-((n / (reach + 1)) ** 2))
    strength[:, np.abs(n) > reach] = 0
    moved, blur, sure = np.zeros(len(points)), np.full(len(points), np.nan), np.zeros(len(points), bool)
    for i, peak in enumerate(np.argmax(strength, axis=1)):
        found = _middle(
            profile[i] @ np.abs(weight[i]) if np.all(weight[i] * weight[i].sum() >= 0) else value[i], n, peak
        )
        if found is not None:
            moved[i], blur[i], sure[i] = *found, True
    return moved, blur, sure


def _middle(value: Array, n: Array, peak: int) -> tuple[float, float] | None:
    """Where light is in the middle of the step around a place, and its blur; None where there is no step."""
    slope = np.gradient(value)
    sign = math.copysign(1.0, float(slope[peak]))
    rise, low, high = sign * slope, peak, peak
    least = 0.08 * rise[peak]
    while low > 0 and rise[low - 1] > least:
        low -= 1
    while high < len(n) - 1 and rise[high + 1] > least:
        high += 1
    if not abs(value[high] - value[low]) > LEAST_STEP or high - low < 2:
        return None
    light = np.sign(value) * np.abs(value) ** CURVE
    share = (light[low : high + 1] - light[low]) / (light[high] - light[low])
    quarters = np.interp([0.25, 0.5, 0.75], np.maximum.accumulate(share), n[low : high + 1])
    sigma = (quarters[2] - quarters[0]) / 1.349
    return float(quarters[1]), math.sqrt(max(sigma**2 - 2 * PIXEL_BLUR**2, 0.0))


def _agreeing(moved: Array, sure: Bools, spacing: float) -> tuple[Array, Bools]:
    """Moves of points that agree with their neighbours; the others get their neighbours' move."""
    from scipy.ndimage import median_filter

    if sure.sum() < 5:
        return np.zeros_like(moved), np.zeros_like(sure)
    at = np.arange(len(moved))
    filled = np.interp(at, at[sure], moved[sure], period=len(moved))
    width = int(np.clip(round(12 / spacing), 5, max(len(moved) // 4, 5))) | 1
    middle = median_filter(filled, width, mode="wrap")
    off = np.abs(filled - middle)
    most = max(4 * 1.4826 * float(np.median(off)), 0.75)
    good = sure & (off <= most)
    if good.sum() < 5:
        return np.zeros_like(moved), np.zeros_like(sure)
    return np.interp(at, at[good], moved[good], period=len(moved)), good


def _read(pixels: Pixels, at: Array) -> Array:
    """(..., 3) encoded colours, 0 to 1, bilinear; beyond the picture those of its border."""
    height, width = pixels.shape[:2]
    x, y = np.clip(at[..., 0], 0, width - 1), np.clip(at[..., 1], 0, height - 1)
    x0, y0 = np.minimum(x.astype(int), max(width - 2, 0)), np.minimum(y.astype(int), max(height - 2, 0))
    x1, y1 = np.minimum(x0 + 1, width - 1), np.minimum(y0 + 1, height - 1)
    a, b = (x - x0)[..., None], (y - y0)[..., None]
    top = pixels[y0, x0] * (1 - a) + pixels[y0, x1] * a
    return np.asarray((top * (1 - b) + (pixels[y1, x0] * (1 - a) + pixels[y1, x1] * a) * b) / 255.0)


def overlap(pixels: Pixels, contour: Contour) -> float:
    """Share of the pixels beside a contour whose colour is that of its other side, by the best straight cut of colours.

    Source: R. A. Fisher, The use of multiple measurements in taxonomic problems, Annals of Eugenics 7 (1936).
    """
    points, normal = contour.points_px, normals_of(smoothed(contour.points_px, 5.0))  # scatter turns normals
    clear = 2 * contour.blur_px if math.isfinite(contour.blur_px) else 0.0  # of the edge's own blur
    away = [clear + k for k in (3, 5, 7)]
    inner, outer = (np.concatenate([_read(pixels, points + way * k * normal) for k in away]) for way in (-1, 1))
    spread = (np.cov(inner.T) + np.cov(outer.T)) / 2 + 1e-5 * np.eye(3)
    cut = np.linalg.solve(spread, inner.mean(axis=0) - outer.mean(axis=0))
    a, b = inner @ cut, outer @ cut
    between = (a.mean() + b.mean()) / 2
    return float(np.mean(a < between) + np.mean(b > between)) / 2


# -- extents ------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Touch:
    """Where a line square to a direction touches: how far out, with u, and the place."""

    height: float
    u: float
    place: Array


def touch(contour: Contour, angle: float) -> _Touch:
    """The outermost place of a contour in a direction, fitted over the stretches on both sides of it.

    A parabola is fitted to each side, but for the nearest few pixels, where the picture's blur and the smoothing round a
    corner; the outline lies below both, so that its top is where the lower of them is highest.
    """
    d = np.array([math.cos(angle), math.sin(angle)])
    points, count = contour.points_px, len(contour.points_px)
    height = points @ d
    top = int(np.argmax(height))
    spacing = max(float(np.sum(np.hypot(*(np.roll(points, -1, axis=0) - points).T))) / count, 1e-6)
    far = float(np.clip(0.1 * np.ptp(height), 8.0, 30.0))
    offset = (np.arange(count) - top + count // 2) % count - count // 2
    s = np.asarray(offset * spacing, float)
    own = float(np.median(contour.sigma_px[np.abs(s) <= far]))
    sides = [(way * s > ROUNDED_PX) & (way * s <= ROUNDED_PX + far) for way in (-1, 1)]
    fits = [_parabola(s[side], height[side], own) for side in sides]
    if any(fit is None for fit in fits):
        return _Touch(float(height[top]), math.hypot(own, 0.5), points[top])
    at = np.linspace(-ROUNDED_PX, ROUNDED_PX, 65)
    (left, u_left), (right, u_right) = ((np.polynomial.polynomial.polyval(at, fit[0]), fit[1]) for fit in fits if fit)
    lower = np.minimum(left, right)
    level = float(lower.max())
    seen = float(height[top])
    # what was extrapolated is not all believed where it is much: corners may be round
    added = level - seen
    level = seen + float(np.clip(added, -1.5, MOST_ADDED_PX))
    u = math.sqrt(u_left**2 / 2 + u_right**2 / 2 + (0.3 * added) ** 2)
    return _Touch(level, u, points[top] + (level - seen) * d)


def _parabola(s: Array, height: Array, own: float) -> tuple[Array, float] | None:
    """Coefficients of height over place, and u of the height at 0; None for too few points."""
    if len(s) < 6:
        return None
    scale = float(np.abs(s).max())
    design = np.stack([np.ones_like(s), s / scale, (s / scale) ** 2], -1)
    normal = design.T @ design
    x = np.linalg.solve(normal, design.T @ height)
    left = height - design @ x
    sigma = math.hypot(own, float(np.sqrt(np.sum(left**2) / max(len(s) - 3, 1))))
    # neighbours share their pixels, so that three points tell as much as one alone
    u = sigma * math.sqrt(3 * float(np.linalg.inv(normal)[0, 0]))
    return x / scale ** np.arange(3), min(u, 3.0)


def calliper(contour: Contour, angle: float) -> tuple[_Touch, _Touch]:
    """The two lines square to a direction that touch: outermost in it, and against it."""
    return touch(contour, angle), touch(contour, angle + math.pi)


def width_at(contour: Contour, angle: float) -> float:
    """Distance of the two touching lines square to a direction."""
    return float(np.ptp(contour.points_px @ [math.cos(angle), math.sin(angle)]))


def angles_of(contour: Contour) -> dict[str, float]:
    """Direction of each extent, rad."""
    turns = np.linspace(0, math.pi, 720, endpoint=False)
    spans = np.array([width_at(contour, a) for a in turns])
    return {"longest": float(turns[np.argmax(spans)]), "shortest": float(turns[np.argmin(spans)]), "width": 0.0,
            "height": math.pi / 2}  # fmt: skip


def extents_of(contour: Contour, others: Sequence[Contour], mixed_px: float = 0.0) -> dict[str, Observation]:
    """The ends of each extent, and the corners of the narrowest box, with their covariance.

    Args:
        contour: the outline.
        others: outlines of the same thing by other runs of the segmentation.
        mixed_px: further u of each side, where thing and ground have the same colours.
    """
    found = {}
    angles = angles_of(contour)
    for name, angle in angles.items():
        found[name] = _ends(contour, others, angle, mixed_px, name)
    found["box"] = _box(contour, others, angles["shortest"], mixed_px)
    return found


def _sides(
    contour: Contour, others: Sequence[Contour], angle: float, mixed: float
) -> tuple[_Touch, _Touch, float, float]:
    """The touching lines and u of each, but for what moves all edges together."""
    far, near = calliper(contour, angle)
    again = [calliper(other, angle) for other in others] or [(far, near)]
    spread = [
        math.sqrt(float(np.mean([(one[k].height - (far, near)[k].height) ** 2 for one in again]))) for k in (0, 1)
    ]
    u_far, u_near = (
        math.sqrt(side.u**2 + spread[k] ** 2 + EDGE_SIGMA_PX**2 + mixed**2) for k, side in enumerate((far, near))
    )
    return far, near, u_far, u_near


def together_px(contour: Contour) -> float:
    """How far all edges may lie out or in together, by the transfer curve (1s), px."""
    blur = contour.blur_px if math.isfinite(contour.blur_px) else 1.0
    return 0.6 * CURVE_U * math.hypot(blur, PIXEL_BLUR)


def _ends(contour: Contour, others: Sequence[Contour], angle: float, mixed: float, name: str) -> Observation:
    d = np.array([math.cos(angle), math.sin(angle)])
    e = np.array([-d[1], d[0]])
    far, near, u_far, u_near = _sides(contour, others, angle, mixed)
    across = float((far.place + near.place) @ e) / 2
    ends = np.array([-near.height * d + across * e, far.height * d + across * e])
    cov = np.zeros((4, 4))
    for k, u in enumerate((u_near, u_far)):
        own = slice(2 * k, 2 * k + 2)
        cov[own, own] = u**2 * np.outer(d, d) + max(u, 0.5) ** 2 * np.outer(e, e)
    out = together_px(contour) * np.concatenate([-d, d])
    return Observation(ends, cov=cov + np.outer(out, out), label=name, source="outline")


def _box(contour: Contour, others: Sequence[Contour], angle: float, mixed: float) -> Observation:
    """Corners of the box whose shorter side lies in a direction, in order around."""
    d = np.array([math.cos(angle), math.sin(angle)])
    e = np.array([-d[1], d[0]])
    far, near, u_far, u_near = _sides(contour, others, angle, mixed)
    right, left, u_right, u_left = _sides(contour, others, angle + math.pi / 2, mixed)
    a, b = (-near.height, far.height), (-left.height, right.height)
    order = ((0, 0), (1, 0), (1, 1), (0, 1))
    corners = np.array([a[i] * d + b[j] * e for i, j in order])
    cov = 1e-4 * np.eye(8)
    for side, u in ((0, u_near), (1, u_far)):
        g = np.concatenate([d * (i == side) for i, _ in order])
        cov += u**2 * np.outer(g, g)
    for side, u in ((0, u_left), (1, u_right)):
        g = np.concatenate([e * (j == side) for _, j in order])
        cov += u**2 * np.outer(g, g)
    g = together_px(contour) * np.concatenate([(2 * i - 1) * d + (2 * j - 1) * e for i, j in order])
    return Observation(corners, cov=cov + np.outer(g, g), label="box", source="outline")


def area_of(contour: Contour, others: Sequence[Contour]) -> tuple[float, float]:
    """Area in square pixels and its u."""
    area = abs(signed_area(contour.points_px))
    around = float(np.sum(np.hypot(*(np.roll(contour.points_px, -1, axis=0) - contour.points_px).T)))
    spread = math.sqrt(float(np.mean([(abs(signed_area(o.points_px)) - area) ** 2 for o in others]))) if others else 0.0
    return area, math.sqrt(spread**2 + (around * math.hypot(together_px(contour), 0.3 * EDGE_SIGMA_PX)) ** 2)
