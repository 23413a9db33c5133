"""A flat pattern of dark and light square cells, fitted to a picture as a whole: its four corners with covariance.

Every pixel over the pattern is compared with v = (low^g + (high^g - low^g) T)^(1/g): T is the share of light of the pattern,
blurred in linear light, seen through the homography of the four corners; low and high are encoded levels that may run evenly
over the pattern; g is the exponent of the transfer curve. The corners, the blur, the levels, and how far dark spreads into
light are fitted together. Ink that spreads, or a transfer curve other than g, moves all edges to one side alike; edges of
both kinds are there, so that this is told apart from the size, and the corners are those of the even grid.

Source: least squares image matching, W. Förstner and B. Wrobel, Photogrammetric Computer Vision, 13.4; the covariance of
the parts' shifts takes the place of that of the noise alone, which knows nothing of creased paper.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .arrays import Array, Bools
from .subpixel import CURVE, PIXEL_BLUR

MARGIN = 1
"""Cells of light ground around the pattern that are fitted with it."""
FINE = 8
"""Samples of the model across a cell."""
MOST_PIXELS = 30_000
SMALLEST_CELL_PX = 1.6
CORNER_SIGMA_PX = 0.02
"""How far a corner may lie off, whatever the residuals say: uneven prints, resampled pictures."""
PARTS = 4
"""The pattern is looked at in PARTS x PARTS parts, to see whether they lie where one plane has them."""
BENT_CORNERS = 3.0
"""A sheet bent about one axis puts its corners this many times farther off than its parts are (rms)."""
_AROUND = 3  # cells of light ground in the model, more than a blur reaches
_DARKEST = 1e-3


@dataclass(frozen=True)
class CellFit:
    """A fitted pattern.

    Attributes:
        corners_px: (4, 2) top-left, top-right, bottom-right, bottom-left corner of the grid as it reads, px.
        cov: (8, 8) of (x1, y1, x2, ...), px^2.
        misfit: rms residual over contrast; encoded.
        contrast: encoded high less low.
        blur_px: standard deviation of the blur, px.
        spread_px: how far dark spreads into light, px; with the error of the transfer curve.
        bent_px: rms distance of the pattern's parts from where one plane has them, beyond their noise, px.
    """

    corners_px: Array
    cov: Array
    misfit: float
    contrast: float
    blur_px: float
    spread_px: float
    bent_px: float


@dataclass(frozen=True)
class _State:
    """What is fitted: corners px, blur in px, spread in cells, encoded levels (low, high) at the middle and their slopes."""

    corners: Array
    blur: float
    spread: float
    levels: Array  # (2, 3): low and high; constant, along u, along v (u, v from -1 to 1)


def homography(size: float, corners_px: Array) -> Array:
    """(3, 3) from cells, 0 to `size` in both directions, to pixels; the corners top-left, top-right, bottom-right, bottom-left."""
    x, y = np.asarray(corners_px, float).T
    dx1, dx2, dx3 = x[1] - x[2], x[3] - x[2], x[0] - x[1] + x[2] - x[3]
    dy1, dy2, dy3 = y[1] - y[2], y[3] - y[2], y[0] - y[1] + y[2] - y[3]
    area = dx1 * dy2 - dx2 * dy1
    with np.errstate(divide="ignore", invalid="ignore"):
        g, h = (dx3 * dy2 - dx2 * dy3) / area, (dx1 * dy3 - dx3 * dy1) / area
    unit = np.array([[x[1] - x[0] + g * x[1], x[3] - x[0] + h * x[3], x[0]],
                     [y[1] - y[0] + g * y[1], y[3] - y[0] + h * y[3], y[0]], [g, h, 1.0]])  # fmt: skip
    return np.asarray(unit @ np.diag([1 / size, 1 / size, 1.0]))


def _cell_from_pixel(n: int, corners: Array) -> Array:
    return np.asarray(np.linalg.inv(homography(n, corners)), float)


def mapped(matrix: Array, points: Array) -> Array:
    """(N, 2) points through a (3, 3) homography."""
    out = points @ matrix[:, :2].T + matrix[:, 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(out[:, :2] / out[:, 2:])


def fit_cells(
    gray: Array, cells: Bools, corners_px: Array, *, exponent: float = CURVE, rounds: int = 12
) -> CellFit | None:
    """Fit a pattern whose cells are known.

    Args:
        gray: (H, W) encoded luminance, 0 to 1.
        cells: (n, n) True where light, rows from the top.
        corners_px: (4, 2) rough corners, off by less than half a cell.
        exponent: of the transfer curve.
        rounds: steps at most.

    Returns:
        The fit, or None where the pattern is too small, or does not settle.
    """
    state = _start(gray, cells, np.asarray(corners_px, float))
    if state is None:
        return None
    picked = _pixels(gray, len(cells), state.corners)
    if len(picked[1]) < 200:
        return None
    for _ in range(rounds):
        found = _step(state, cells, *picked, exponent)
        if found is None:
            return None
        state, moved = found
        if moved < 1e-4:
            break
    return _result(state, cells, *picked, exponent)


def _start(gray: Array, cells: Bools, corners: Array) -> _State | None:
    """Levels from the middles of the cells; a blur of a pixel."""
    n = len(cells)
    if _cell_px(n, corners) < SMALLEST_CELL_PX or not np.all(np.isfinite(corners)):
        return None
    v, u = np.mgrid[0:n, 0:n] + 0.5
    at = mapped(homography(n, corners), np.stack([u.ravel(), v.ravel()], -1))
    value = sampled(gray, at)
    light = cells.ravel()
    if not light.any() or light.all():
        return None
    low, high = float(np.median(value[~light])), float(np.median(value[light]))
    if not high - low > 0.05:
        return None
    return _State(corners, 0.7, 0.0, np.array([[low, 0, 0], [high, 0, 0]], float))


def sampled(gray: Array, points: Array) -> Array:
    """(N,) values at (N, 2) places, bilinear; beyond the picture those of its border."""
    height, width = gray.shape
    x, y = np.clip(points[:, 0], 0, width - 1), np.clip(points[:, 1], 0, height - 1)
    x0, y0 = np.minimum(x.astype(int), width - 2), np.minimum(y.astype(int), height - 2)
    a, b = x - x0, y - y0
    top = gray[y0, x0] * (1 - a) + gray[y0, x0 + 1] * a
    return np.asarray(top * (1 - b) + (gray[y0 + 1, x0] * (1 - a) + gray[y0 + 1, x0 + 1] * a) * b)


def _cell_px(n: int, corners: Array) -> float:
    return float(np.hypot(*(np.roll(corners, -1, axis=0) - corners).T).min()) / n


def _pixels(gray: Array, n: int, corners: Array) -> tuple[Array, Array]:
    """(N, 2) places and (N,) values of the pixels over the pattern and its margin; evenly thinned."""
    edge = np.array([[-MARGIN, -MARGIN], [n + MARGIN, -MARGIN], [n + MARGIN, n + MARGIN], [-MARGIN, n + MARGIN]], float)
    around = mapped(homography(n, corners), edge)
    x0, y0 = np.maximum(np.floor(around.min(axis=0)).astype(int), 0)
    x1, y1 = np.minimum(np.ceil(around.max(axis=0)).astype(int) + 1, gray.shape[::-1])
    if x1 - x0 < 2 or y1 - y0 < 2:
        return np.zeros((0, 2)), np.zeros(0)
    yy, xx = np.mgrid[y0:y1, x0:x1]
    places = np.stack([xx.ravel(), yy.ravel()], -1).astype(float)
    cell = mapped(_cell_from_pixel(n, corners), places)
    inside = np.flatnonzero(np.all((cell > -MARGIN) & (cell < n + MARGIN), axis=-1))
    if len(inside) > MOST_PIXELS:  # a fixed draw: any stride would beat with the cells
        inside = np.sort(np.random.default_rng(1).choice(inside, MOST_PIXELS, replace=False))
    return places[inside], gray[y0:y1, x0:x1].ravel()[inside]


def _pattern(cells: Bools, blur_cells: tuple[float, float]) -> tuple[Array, ...]:
    """Share of light, blurred, FINE samples a cell with light ground around it, and its slopes along u and v per cell."""
    from scipy.ndimage import gaussian_filter1d

    light = np.pad(np.asarray(cells, float), _AROUND, constant_values=1.0)
    fine = np.repeat(np.repeat(light, FINE, axis=0), FINE, axis=1)
    for axis, blur in ((1, blur_cells[0]), (0, blur_cells[1])):
        fine = gaussian_filter1d(fine, blur * FINE, axis=axis, mode="nearest", truncate=3.5)
    by_v, by_u = np.gradient(fine)
    return fine, by_u * FINE, by_v * FINE


def _model(state: _State, cells: Bools, places: Array, exponent: float) -> tuple[Array, Array]:
    """(N,) encoded values and (N, 16) derivatives: corners 8, blur, spread, levels 6."""
    n = len(cells)
    inverse = _cell_from_pixel(n, state.corners)
    cell = mapped(inverse, places)
    across = [float(np.hypot(*(state.corners[[1, 3]] - state.corners[[0, 2]])[i])) for i in (0, 1)]
    down = [float(np.hypot(*(state.corners[[3, 2]] - state.corners[[0, 1]])[i])) for i in (0, 1)]
    cell_px = (sum(across) / 2 / n, sum(down) / 2 / n)
    width = float(np.hypot(state.blur, PIXEL_BLUR))
    fine = _pattern(cells, (width / cell_px[0], width / cell_px[1]))
    wider = _pattern(cells, ((width + 0.02) / cell_px[0], (width + 0.02) / cell_px[1]))
    at = (cell + _AROUND) * FINE - 0.5
    share, by_u, by_v = (sampled(part, at) for part in fine)
    by_blur = (sampled(wider[0], at) - share) / 0.02 * state.blur / width
    steep = np.sqrt(by_u**2 + by_v**2 + 1e-12)
    share, by_spread = np.clip(share - state.spread * steep, 0.0, 1.0), -steep
    uv = 2 * cell / n - 1
    basis = np.stack([np.ones(len(uv)), uv[:, 0], uv[:, 1]], -1)
    low, high = np.maximum(basis @ state.levels[0], _DARKEST), np.maximum(basis @ state.levels[1], _DARKEST)
    low_light, high_light = low**exponent, high**exponent
    light = np.maximum(low_light + (high_light - low_light) * share, _DARKEST**exponent)
    value = light ** (1 / exponent)
    encode = value / (exponent * light)
    by_share = encode * (high_light - low_light)
    moved = _by_corners(state.corners, n, places, cell)
    jac = np.empty((len(places), 16))
    jac[:, :8] = by_share[:, None] * (by_u[:, None] * moved[..., 0] + by_v[:, None] * moved[..., 1])
    jac[:, 8], jac[:, 9] = by_share * by_blur, by_share * by_spread
    jac[:, 10:13] = (encode * exponent * low_light / low * (1 - share))[:, None] * basis
    jac[:, 13:16] = (encode * exponent * high_light / high * share)[:, None] * basis
    return value, jac


def _by_corners(corners: Array, n: int, places: Array, cell: Array) -> Array:
    """(N, 8, 2) change of a pixel's place in cells with each corner's coordinate."""
    out = np.empty((len(places), 8, 2))
    for k in range(8):
        moved = corners.copy()
        moved.flat[k] += 0.01
        out[:, k] = (mapped(_cell_from_pixel(n, moved), places) - cell) / 0.01
    return out


def _step(state: _State, cells: Bools, places: Array, value: Array, exponent: float) -> tuple[_State, float] | None:
    """A Gauss-Newton step, no wider than a third of a cell, and how far the corners moved."""
    model, jac = _model(state, cells, places, exponent)
    scale = np.sqrt(np.sum(jac**2, axis=0)) + 1e-12
    normal = (jac / scale).T @ (jac / scale) + 1e-9 * np.eye(16)
    step = np.linalg.solve(normal, (jac / scale).T @ (value - model)) / scale
    if not np.all(np.isfinite(step)):
        return None
    most, cell = float(np.abs(step[:8]).max()), _cell_px(len(cells), state.corners)
    step[:8] *= min(1.0, cell / 3 / max(most, 1e-12))
    corners = state.corners + step[:8].reshape(4, 2)
    if _cell_px(len(cells), corners) < SMALLEST_CELL_PX:
        return None
    blur = float(np.clip(state.blur + np.clip(step[8], -0.5, 0.5), 0.05, 0.8 * cell))
    spread = float(np.clip(state.spread + step[9], -0.3, 0.3))
    return _State(corners, blur, spread, state.levels + step[10:].reshape(2, 3)), most


def _result(state: _State, cells: Bools, places: Array, value: Array, exponent: float) -> CellFit | None:
    model, jac = _model(state, cells, places, exponent)
    residual = value - model
    contrast = float(state.levels[1, 0] - state.levels[0, 0])
    if not contrast > 0.05:
        return None
    rms = float(np.sqrt(np.mean(residual**2)))
    n = len(cells)
    noise = np.linalg.pinv(jac.T @ jac)[:8, :8] * rms**2
    parts, bent = _parts_cov(state, n, places, residual, jac)
    cov = (
        np.maximum(np.trace(noise), np.trace(parts)) / max(np.trace(noise), 1e-30) * noise
        if bent == 0
        else noise + parts
    )
    cov = cov + CORNER_SIGMA_PX**2 * np.eye(8)
    fit = CellFit(state.corners, (cov + cov.T) / 2, rms / contrast, contrast, state.blur, 0.0, bent)
    return replace(fit, spread_px=state.spread * _cell_px(n, state.corners))


def _parts_cov(state: _State, n: int, places: Array, residual: Array, jac: Array) -> tuple[Array, float]:
    """(8, 8) covariance from how far the pattern's parts lie from the fit, and their rms distance beyond noise, px.

    Where paper is bent, or the lens bends it, parts lie off together and the corners farthest: what is beyond noise counts
    several times for them.
    """
    cell = mapped(_cell_from_pixel(n, state.corners), places)
    number = np.clip((cell / n * PARTS).astype(int), 0, PARTS - 1) @ np.array([1, PARTS])
    # derivative by a shift in x and in y: all corners moved alike
    by_shift = np.stack([jac[:, 0:8:2].sum(axis=1), jac[:, 1:8:2].sum(axis=1)], -1)
    shifts, expected = [], []
    for part in range(PARTS * PARTS):
        of = number == part
        normal = by_shift[of].T @ by_shift[of]
        if of.sum() < 12 or np.linalg.cond(normal) > 1e4:
            continue
        inverse = np.linalg.inv(normal)
        shifts.append(inverse @ by_shift[of].T @ residual[of])
        expected.append(np.trace(inverse) / 2 * float(np.mean(residual[of] ** 2)))
    if len(shifts) < 6:
        return np.zeros((8, 8)), 0.0
    seen = float(np.sum(np.square(shifts))) / max(2 * len(shifts) - 8, 1)
    beyond = max(seen - 1.5 * float(np.mean(expected)), 0.0)
    corner = _corner_by_parts(n, state.corners)
    return corner * seen + BENT_CORNERS**2 * beyond * np.eye(8), float(np.sqrt(beyond))


def _corner_by_parts(n: int, corners: Array) -> Array:
    """(8, 8) covariance of the corners where each part's middle is known to 1 px in x and y."""
    step = n / PARTS
    v, u = (np.mgrid[0:PARTS, 0:PARTS] + 0.5) * step
    at = np.stack([u.ravel(), v.ravel()], -1)
    begin = mapped(homography(n, corners), at)
    jac = np.empty((2 * PARTS * PARTS, 8))
    for k in range(8):
        moved = corners.copy()
        moved.flat[k] += 0.01
        jac[:, k] = (mapped(homography(n, moved), at) - begin).ravel() / 0.01
    return np.asarray(np.linalg.pinv(jac.T @ jac))
