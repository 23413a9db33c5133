"""How good a picture is where something was measured in it: sharpness, noise, clipping, contrast, compression, size in pixels.

Edges are looked at by profiles across them: the sides of a closed figure at several places, the rim of a curve, or the edges
nearest to the two ends of a line. A blurred step in light has a quarter and three quarters of its height 1.349 standard deviations of
its blur apart; of a motion's box they lie half its length apart. The blur has an ellipse as its covariance (motion is its
long axis), of which each edge shows the extent along its normal.

Noise is told by second differences, which a picture's slopes leave out. JPEG's blocks are told by steps at every eighth
column and row that their neighbours do not have.

Source: the slanted-edge idea of ISO 12233, in light; J. Immerkær, Fast noise variance estimation, CVIU 64 (1996).
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .arrays import Array, Pixels
from .observation import Observation
from .quantity import Note
from .subpixel import CURVE, PIXEL_BLUR, encoded_gray

if TYPE_CHECKING:
    from .photo import Photo

BLURRED_FROM_PX = 2.0
"""Standard deviation of the blur from which it is noted: three times that of a sharp lens. Between narrow bars it shows less."""
MOTION_RATIO = 2.0
"""Long over short axis of the blur from which it is taken for motion."""
MOTION_FROM_PX = 1.5
"""Long axis from which it is."""
LEAST_CONTRAST = 0.06
"""Encoded contrast (0 to 1) of an edge below which it is noted."""
LEAST_CONTRAST_TO_NOISE = 5.0
FEW_PIXELS = 20.0
"""Length of a line, or shortest side of a figure, below which it is noted, px."""
CLIPPED_FROM = 254
CLIPPED_SHARE = 0.6
"""Of the pixels on an edge's light side that are at the upper end of their range."""
BLOCKS_FROM = 2.0 / 255
"""Encoded step at the borders of JPEG's blocks beyond those beside them, from which it is noted: a quality below about 30."""
BLOCKS_RATIO = 0.2
"""Of the steps beside them: what stands out less is the scene's own."""
CLICK_HOLDS_PX = 1.0
"""The sigma of a click holds blurs up to this."""
CLICK_PER_BLUR = 0.6
"""How far a click on a blurred edge is off in blur radii: one sees encoded values, whose middle lies in the dark."""
CLIPPED_PER_BLUR = 1.6
"""How far a clipped edge is off in radii of the blur that is left of it: 0.8 for twice too much light, 2.2 for four times,
3.8 for eight times; how much it was, the picture does not tell."""
COARSE_PX = 3.0
"""Points known worse than this are not on edges: nothing is said of edges."""
REACH_PX = 14.0
_STEP_PX = 0.5
_MOST_SITES = 24
_QUARTERS = 1.349


@dataclass(frozen=True)
class Quality:
    """What the picture is like at the measured edges; NaN where there was no edge to tell it.

    Attributes:
        blur_px: standard deviation of the blur across the edges (median), in light.
        blur_long_px: of its longest direction, where edges of several directions tell it; else as `blur_px`.
        blur_short_px: of its shortest direction.
        noise: standard deviation of encoded values, 0 to 1.
        contrast: encoded step at the edges (median), 0 to 1.
        clipped: share of the light side's pixels at the upper end of their range.
        blocks: encoded step at the borders of JPEG's blocks beyond those beside them (mean); 0 without compression.
        extent_px: length of the line, or the shortest side of the figure.
        edges: how many profiles showed an edge.
        notes: doubts: `blurred`, `motion_blurred`, `clipped`, `low_contrast`, `few_pixels`, `compressed`.
    """

    blur_px: float
    blur_long_px: float
    blur_short_px: float
    noise: float
    contrast: float
    clipped: float
    blocks: float
    extent_px: float
    edges: int
    notes: tuple[Note, ...] = ()


def quality(photo: Photo, seen: Observation, *, closed: bool = False) -> Quality:
    """The picture's quality where something was seen in it.

    Args:
        photo: the picture.
        seen: two ends of a line, corners of a figure, or points of a rim.
        closed: whether the points go round a figure, whose sides are edges.
    """
    points = np.asarray(seen.points_px, float).reshape(-1, 2)
    extent = _extent(points, closed=closed)
    coarse = float(np.median(seen.standard_deviations)) > COARSE_PX
    sites = [] if coarse else _sites(photo.pixels, points, extent, closed=closed)
    profiles = [p for site in sites if (p := _profile(photo.pixels, *site))]
    noise, blocks = _noise(photo.pixels, points), _blocks(photo.pixels, points)
    nan = math.nan
    if profiles:
        blurs, normals = np.array([p.blur_px for p in profiles]), np.array([p.normal for p in profiles])
        blur, contrast = float(np.median(blurs)), float(np.median([p.contrast for p in profiles]))
        long, short = _axes(blurs, normals, blur)
        clipped = float(np.median([p.clipped for p in profiles]))
    else:
        blur, contrast, long, short, clipped = nan, nan, nan, nan, nan
    found = Quality(blur, long, short, noise, contrast, clipped, blocks, extent, len(profiles))
    return dataclasses.replace(found, notes=_notes(found))


def widened(seen: Observation, found: Quality, *, closed: bool = False, clicked: bool = False) -> Observation:
    """The observation with what its source does not know of: what a click does not hold of a blur, and clipping.

    Detectors hold blur, noise and compression in their own residuals; a clipped light side they can't see, as it looks like
    a darker one. It moves all edges of a figure out or in together.

    Args:
        seen: the points.
        found: the picture's quality at them.
        closed: whether the points go round a figure.
        clicked: whether a person set them.
    """
    extra = np.zeros((2 * seen.points_px.shape[-2],) * 2)
    if clicked and found.blur_px > CLICK_HOLDS_PX:
        extra += CLICK_PER_BLUR**2 * (found.blur_px**2 - CLICK_HOLDS_PX**2) * np.eye(len(extra))
    if found.clipped >= CLIPPED_SHARE and found.blur_px > 0:
        out = outward(seen.points_px, closed=closed).ravel() * CLIPPED_PER_BLUR * math.hypot(found.blur_px, PIXEL_BLUR)
        extra += np.outer(out, out)
    if not extra.any() or seen.points_px.ndim != 2:
        return seen
    own = np.diag(seen.standard_deviations**2) if seen.cov is None else seen.cov
    return dataclasses.replace(seen, cov=own + extra, source=f"{seen.source}, widened by the picture's quality")


def outward(points_px: Array, *, closed: bool) -> Array:
    """(N, 2) how each point moves where all edges move out by 1 px: corners along their bisectors, ends along their line."""
    points = np.asarray(points_px, float)
    if not closed:
        d = points - points.mean(axis=0)
        return np.asarray(d / np.maximum(np.hypot(*d.T), 1e-9)[:, None])
    area = np.sum(points[:, 0] * np.roll(points[:, 1], -1) - points[:, 1] * np.roll(points[:, 0], -1))
    edge = np.roll(points, -1, axis=0) - points
    normal = (
        np.stack([edge[:, 1], -edge[:, 0]], -1) / np.maximum(np.hypot(*edge.T), 1e-9)[:, None] * np.sign(area or 1.0)
    )
    before = np.roll(normal, 1, axis=0)
    both = normal + before
    return np.asarray(2 * both / np.maximum(np.sum(both**2, axis=1), 0.2)[:, None])


# -- where to look ------------------------------------------------------------------------------------


def _extent(points: Array, *, closed: bool) -> float:
    if len(points) < 2:
        return math.nan
    if closed and len(points) > 8:  # a rim: its narrowest width
        turned = [np.ptp(points @ [math.cos(a), math.sin(a)]) for a in np.linspace(0, math.pi, 12, endpoint=False)]
        return float(min(turned))
    step = np.hypot(*(np.roll(points, -1, axis=0) - points).T)
    return float(step.min() if closed else step[:-1].min())


def _sites(pixels: Pixels, points: Array, extent: float, *, closed: bool) -> list[tuple[Array, Array, float]]:
    """(place, normal, reach) of profiles."""
    if closed and len(points) >= 3:
        edge = np.roll(points, -1, axis=0) - points
        length = np.hypot(*edge.T)
        shares = (0.2, 0.35, 0.5, 0.65, 0.8) if len(points) <= 8 else (0.5,)
        reach = min(REACH_PX, 0.4 * extent)
        sites = [(points[i] + s * edge[i], np.array([edge[i, 1], -edge[i, 0]]) / length[i], reach)
                 for i in range(len(points)) for s in shares if length[i] > 1e-6]  # fmt: skip
        return sites[:: max(1, -(-len(sites) // _MOST_SITES))]
    reach = min(REACH_PX, 0.4 * extent) if math.isfinite(extent) else REACH_PX
    return [site for point in points if (site := _steepest(pixels, point, reach))]


def _steepest(pixels: Pixels, point: Array, reach: float) -> tuple[Array, Array, float] | None:
    """The strongest edge within 5 px of an end: its place and normal."""
    half = 9
    x, y = (round(float(v)) for v in point)
    y0, x0 = max(y - half, 0), max(x - half, 0)
    gray = encoded_gray(pixels[y0 : y + half + 1, x0 : x + half + 1])
    if min(gray.shape) < 5:
        return None
    from scipy.ndimage import gaussian_filter

    gray = gaussian_filter(gray, 1.0)
    by_y, by_x = np.gradient(gray)
    yy, xx = np.mgrid[0 : gray.shape[0], 0 : gray.shape[1]]
    away = np.hypot(xx + x0 - point[0], yy + y0 - point[1])
    strength = np.hypot(by_x, by_y) * np.exp(-((away / 5.0) ** 2))
    j, i = np.unravel_index(int(np.argmax(strength)), strength.shape)
    size = float(np.hypot(by_x[j, i], by_y[j, i]))
    if not size > 1e-3:
        return None
    return np.array([i + x0, j + y0], float), np.array([by_x[j, i], by_y[j, i]]) / size, reach


# -- what a profile shows -----------------------------------------------------------------------------


@dataclass(frozen=True)
class _Profile:
    blur_px: float
    contrast: float
    clipped: float
    normal: Array


def _profile(pixels: Pixels, place: Array, normal: Array, reach: float) -> _Profile | None:
    """One edge: the rise around the steepest place, as far as it goes on rising."""
    height, width = pixels.shape[:2]
    if reach < 1.5:
        return None
    n = np.arange(-reach, reach + _STEP_PX / 2, _STEP_PX)
    t = np.arange(-2.0, 2.5, 1.0)
    along = np.array([-normal[1], normal[0]])
    at = place + n[:, None, None] * normal + t[None, :, None] * along
    if np.any(at < 0) or np.any(at > np.array([width - 1, height - 1])):
        return None
    gray, top = _read(pixels, at)
    encoded = gray.mean(axis=1)
    slope = np.gradient(encoded)
    near = np.abs(n) <= max(2.0, 0.35 * reach)
    peak = int(np.flatnonzero(near)[np.argmax(np.abs(slope[near]))])
    sign = math.copysign(1.0, float(slope[peak]))
    low_at, high_at = _run(sign * slope, peak)
    if sign < 0:
        encoded, top, n_up = encoded[::-1], top[::-1], n[::-1] * -1
        low_at, high_at = len(n) - 1 - high_at, len(n) - 1 - low_at
    else:
        n_up = n
    low, high = float(encoded[low_at]), float(encoded[high_at])
    if not high - low > 0.02:
        return None
    light = encoded[low_at : high_at + 1] ** CURVE
    share = (light - light[0]) / (light[-1] - light[0])
    quarters = np.interp([0.25, 0.75], np.maximum.accumulate(share), n_up[low_at : high_at + 1])
    sigma = float(quarters[1] - quarters[0]) / _QUARTERS
    blur = math.sqrt(max(sigma**2 - 2 * PIXEL_BLUR**2, 0.0))  # of the pixel, and of reading between pixels
    clipped = float(np.mean(top[high_at : high_at + 5] >= CLIPPED_FROM))
    return _Profile(blur, high - low, clipped, normal)


def _run(rise: Array, peak: int) -> tuple[int, int]:
    """First and last sample of the rise around a peak: as far as it keeps 4 % of the peak's."""
    least = 0.04 * rise[peak]
    low = high = peak
    while low > 0 and rise[low - 1] > least:
        low -= 1
    while high < len(rise) - 1 and rise[high + 1] > least:
        high += 1
    return low, high


def _read(pixels: Pixels, at: Array) -> tuple[Array, Array]:
    """Encoded luminance (0 to 1, bilinear) and the green value of the nearest pixel, at (..., 2) places."""
    height, width = pixels.shape[:2]
    x, y = at[..., 0], at[..., 1]
    x0, y0 = np.minimum(x.astype(int), width - 2), np.minimum(y.astype(int), height - 2)
    a, b = (x - x0)[..., None], (y - y0)[..., None]
    value = (pixels[y0, x0] * (1 - a) + pixels[y0, x0 + 1] * a) * (1 - b)
    value = value + (pixels[y0 + 1, x0] * (1 - a) + pixels[y0 + 1, x0 + 1] * a) * b
    green = pixels[np.round(y).astype(int), np.round(x).astype(int), 1]
    return encoded_gray(value), np.asarray(green, float)


def _axes(blurs: Array, normals: Array, blur: float) -> tuple[float, float]:
    """Standard deviations of the blur's longest and shortest direction, from b^2 = n' C n over the edges."""
    design = np.stack([normals[:, 0] ** 2, 2 * normals[:, 0] * normals[:, 1], normals[:, 1] ** 2], -1)
    if len(blurs) < 6 or np.linalg.svd(design, compute_uv=False)[1] < 0.25 * math.sqrt(len(blurs)):
        return blur, blur
    square = np.median(blurs**2)  # a prior of a round blur where the directions leave it open
    weight = 0.05 * len(blurs)
    normal = design.T @ design + weight * np.diag([1.0, 2.0, 1.0])
    c = np.linalg.solve(normal, design.T @ blurs**2 + weight * np.array([square, 0.0, square]))
    values = np.linalg.eigvalsh([[c[0], c[1]], [c[1], c[2]]])
    short, long = np.sqrt(np.maximum(values, 0.0))
    return float(long), float(short)


# -- noise and compression ----------------------------------------------------------------------------


def _patch(pixels: Pixels, points: Array, most: int) -> Array:
    """Encoded luminance around the points, at least 96 and at most `most` px a side; begins at a border of blocks."""
    height, width = pixels.shape[:2]
    low, high = points.min(axis=0), points.max(axis=0)
    half = np.clip((high - low) / 2 + 16, 48, most / 2)
    middle = np.clip((low + high) / 2, half, np.maximum([width, height] - half, half))
    x0, y0 = (max(int(v) // 8 * 8, 0) for v in middle - half)
    x1, y1 = (int(v) for v in middle + half)
    return encoded_gray(pixels[y0 : min(y1, height), x0 : min(x1, width)])


def _noise(pixels: Pixels, points: Array) -> float:
    """Standard deviation of encoded values: median of the quietest half's mixed second differences."""
    gray = _patch(pixels, points, 256)
    if min(gray.shape) < 8:
        return math.nan
    mixed = (gray[:-1, :-1] - gray[1:, :-1] - gray[:-1, 1:] + gray[1:, 1:]) / 2
    rows, columns = (size // 8 * 8 for size in mixed.shape)
    if not rows or not columns:
        return math.nan
    cells = mixed[:rows, :columns].reshape(rows // 8, 8, columns // 8, 8).std(axis=(1, 3))
    return float(np.median(np.sort(cells.ravel())[: max(cells.size // 2, 1)]))


def _blocks(pixels: Pixels, points: Array) -> float:
    """Mean step at borders of blocks beyond that beside them, encoded; 0 where there are too few pixels to tell."""
    gray = _patch(pixels, points, 512)
    if min(gray.shape) < 64:
        return 0.0
    steps: list[float] = []
    for across in (gray, gray.T):
        step = np.abs(np.diff(across, axis=1))
        # what curves at the border beyond what curves beside it: slopes and edges of the scene do so anywhere
        jump = np.maximum(step[:, 1:-1] - (step[:, :-2] + step[:, 2:]) / 2, 0.0)
        jump = np.minimum(jump, 0.06)  # an edge of the scene is not a block
        phase = np.array([jump[:, p::8].mean() for p in range(8)])
        beside = np.delete(phase, 6)
        excess = float(phase[6] - beside.mean())
        steps.append(excess if excess > BLOCKS_RATIO * beside.mean() and excess > 4 * beside.std() else 0.0)
    return max(min(steps), 0.0)


# -- notes --------------------------------------------------------------------------------------------


def _notes(found: Quality) -> tuple[Note, ...]:
    notes = []
    noise, contrast = found.noise, found.contrast
    moved = found.blur_long_px > max(MOTION_RATIO * found.blur_short_px, MOTION_FROM_PX)
    if moved:
        notes.append(Note("motion_blurred", f"edges there are blurred by {found.blur_long_px:.2g} px in one direction and "
                          f"{found.blur_short_px:.2g} px in the other (1s): the camera or the thing moved",
                          "hold the camera still, or take more light"))  # fmt: skip
    elif found.blur_px > BLURRED_FROM_PX:
        notes.append(
            Note("blurred", f"edges there are blurred by {found.blur_px:.2g} px (1s)", "focus on it, or come closer")
        )
    if found.clipped >= CLIPPED_SHARE:
        notes.append(Note("clipped", f"{100 * found.clipped:.0f} % of the pixels on the light side of its edges are at the end of "
                          "their range; the edges may lie farther in the light than they seem, which is in u",
                          "expose it less"))  # fmt: skip
    if contrast < max(LEAST_CONTRAST, LEAST_CONTRAST_TO_NOISE * noise):
        notes.append(Note("low_contrast", f"its edges stand out by {255 * contrast:.0f} of 255 levels, with noise of "
                          f"{255 * noise:.1f}", "another light or ground"))  # fmt: skip
    if found.extent_px < FEW_PIXELS:
        notes.append(Note("few_pixels", f"it is {found.extent_px:.0f} px in the picture, of which half a pixel is "
                          f"{50 / max(found.extent_px, 0.5):.0f} %", "come closer, or zoom with the lens"))  # fmt: skip
    if found.blocks > BLOCKS_FROM:
        notes.append(Note("compressed", "the picture is compressed so strongly that its blocks of 8 px show; edges are moved by "
                          "them", "use the original picture, or a higher quality"))  # fmt: skip
    return tuple(notes)
