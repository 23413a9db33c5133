"""How a flat board lies in a picture: a homography and the lens's low orders, fitted to points seen.

With q = H(board point) in half diagonals from the picture's middle and r = |q|, the picture has
q (1 + k1 r^2 + k2 r^4) + tangential(p1, p2). This is no calibration: it judges points against each other, tells which way
the board lies and how large its squares are in pixels, and what the points' scatter is.

Source: D. C. Brown, Close-range camera calibration (1971), for the lens terms.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Array, Bools, Indices

FEWEST = 6
"""Points below which a lattice says nothing about its own fit."""
_ITERATIONS = 12
_STRAY_SIGMAS, _STRAY_PX = 6.0, 0.35


@dataclass(frozen=True, eq=False)
class Lattice:
    """A fitted board.

    Attributes:
        homography: (3, 3) from board lengths (in `unit`) to half diagonals from the picture's middle.
        lens: (4,) k1, k2, p1, p2; those not fitted are 0.
        middle_px: (2,) the picture's middle.
        half_px: half its diagonal.
        unit: board length per unit of the homography.
        residuals_px: (n, 2) seen less fitted, of the points it was fitted to.
        parameters: how many were fitted.
    """

    homography: Array
    lens: Array
    middle_px: Array
    half_px: float
    unit: float
    residuals_px: Array
    parameters: int

    def project(self, board: Array) -> Array:
        """(..., 2) board points, in the unit they were fitted in, to (..., 2) pixels."""
        return _bent(_mapped(self.homography, board / self.unit), self.lens) * self.half_px + self.middle_px

    def jacobian(self, board: Array, step: float) -> Array:
        """(..., 2, 2) pixels per board length, by central differences over `step` board lengths; columns along x and y."""
        moves = np.array([[step, 0.0], [0.0, step]]) / 2
        return np.stack([(self.project(board + m) - self.project(board - m)) / step for m in moves], axis=-1)

    @property
    def rms_px(self) -> float:
        """Root mean square of a residual's coordinate."""
        return float(np.sqrt(np.mean(self.residuals_px**2)))

    @property
    def sigma_px(self) -> float:
        """Standard deviation of a coordinate that the residuals tell; infinite where they tell nothing."""
        spare = self.residuals_px.size - self.parameters
        return float(np.sqrt(np.sum(self.residuals_px**2) / spare)) if spare > 0 else np.inf


def fit(board: Array, points_px: Array, width_px: int, height_px: int) -> Lattice | None:
    """Fit a lattice; None where the points lie on a line or are too few.

    Args:
        board: (n, 2) points of the board, in any unit of length.
        points_px: (n, 2) where they are seen.
        width_px: of the picture.
        height_px: of the picture.
    """
    board, points_px = np.asarray(board, float), np.asarray(points_px, float)
    spread = np.linalg.svd(board - board.mean(axis=0), compute_uv=False) if len(board) >= 4 else np.zeros(2)
    if spread[1] <= 1e-6 * spread[0]:
        return None
    unit = float(np.abs(board).max()) or 1.0
    middle_px, half_px = np.array([width_px - 1, height_px - 1]) / 2, float(np.hypot(width_px, height_px)) / 2
    b, seen = board / unit, (points_px - middle_px) / half_px
    start = _homography(b, seen)
    lens_terms = 4 if len(board) >= 20 else 1 if len(board) >= 10 else 0
    x = _refined(np.concatenate([start.ravel()[:8] / start[2, 2], np.zeros(lens_terms)]), b, seen)
    h, lens = _unpacked(x)
    residuals = (seen - _bent(_mapped(h, b), lens)) * half_px
    if not np.all(np.isfinite(residuals)):
        return None
    return Lattice(h, lens, middle_px, half_px, unit, residuals, len(x))


def fit_without_strays(board: Array, points_px: Array, width_px: int, height_px: int) -> tuple[Lattice | None, Bools]:
    """Fit, leave out the points that contradict the others, and fit again; which are kept."""
    keep = np.ones(len(board), bool)
    found = fit(board, points_px, width_px, height_px)
    for _ in range(3):
        if found is None:
            break
        off = np.hypot(*(points_px - found.project(board)).T)
        limit = max(
            _STRAY_PX, _STRAY_SIGMAS * 0.85 * float(np.median(off[keep]))
        )  # 0.85 median = sigma of a coordinate
        now = off <= limit
        if np.array_equal(now, keep) or now.sum() < FEWEST:
            break
        keep, found = now, fit(board[now], points_px[now], width_px, height_px)
    return found, keep


def scatter_px(lattice: Lattice, ids: Indices, points_px: Array, across: int, down: int) -> float:
    """Standard deviation of a coordinate, from residuals or from third differences along the rows, whichever is less.

    Both are too large where the lens bends the board more than they can follow, so the smaller one is nearer the truth.
    """
    seen = np.full((down * across, 2), np.nan)
    seen[ids] = points_px
    grid = seen.reshape(down, across, 2)
    thirds = np.concatenate([np.diff(grid, 3, axis=axis).reshape(-1, 2) for axis in (0, 1)])
    thirds = thirds[np.isfinite(thirds).all(axis=1)]
    rough = float(np.sqrt(np.mean(thirds**2) / 20)) if len(thirds) >= 12 else np.inf  # 1 + 9 + 9 + 1
    return min(lattice.sigma_px, rough)


def _mapped(h: Array, board: Array) -> Array:
    w = board @ h[2, :2] + h[2, 2]
    return np.asarray((board @ h[:2, :2].T + h[:2, 2]) / w[..., None])


def _bent(q: Array, lens: Array) -> Array:
    k1, k2, p1, p2 = lens
    x, y = q[..., 0], q[..., 1]
    r2 = x * x + y * y
    radial = 1 + r2 * (k1 + k2 * r2)
    return np.stack([x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
                     y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y], axis=-1)  # fmt: skip


def _unpacked(x: Array) -> tuple[Array, Array]:
    return np.append(x[:8], 1.0).reshape(3, 3), np.concatenate([x[8:], np.zeros(12 - len(x))])


def _homography(board: Array, seen: Array) -> Array:
    """Direct linear transform of points that are already of order one."""
    ones, zeros = np.ones(len(board)), np.zeros((len(board), 3))
    b = np.column_stack([board, ones])
    rows = np.concatenate([np.hstack([b, zeros, -seen[:, :1] * b]), np.hstack([zeros, b, -seen[:, 1:] * b])])
    return np.asarray(np.linalg.svd(rows, full_matrices=False)[2][-1].reshape(3, 3))


def _refined(x: Array, board: Array, seen: Array) -> Array:
    """Levenberg-Marquardt with the derivatives by differences: a dozen parameters, some hundred points."""

    def residuals(p: Array) -> Array:
        h, lens = _unpacked(p)
        return (seen - _bent(_mapped(h, board), lens)).ravel()

    damping, now = 1e-4, residuals(x)
    for _ in range(_ITERATIONS):
        steps = 1e-6 * np.maximum(abs(x), 1e-2)
        jac = np.stack([(residuals(x + d) - now) / s for d, s in zip(np.diag(steps), steps, strict=True)], axis=-1)
        normal = jac.T @ jac
        move = -np.linalg.solve(normal + damping * np.diag(np.diag(normal) + 1e-12), jac.T @ now)
        then = residuals(x + move)
        if then @ then < now @ now:
            done = now @ now - then @ then < 1e-9 * (now @ now)
            x, now, damping = x + move, then, damping / 10
            if done:
                break
        else:
            damping *= 10
    return x
