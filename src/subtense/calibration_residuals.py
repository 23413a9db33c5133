"""The residuals of a calibration, seen from several sides: by picture, by radius, by point of the board, and the lens curve."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .adjustment import Adjusted, linearised
from .arrays import Array, Indices
from .calibration_summary import moved_camera
from .camera import Camera
from .distribution import HALF_WIDTH_95


@dataclass(frozen=True, eq=False)
class Residuals:
    """All points of one camera that were used.

    Attributes:
        frame: (n,) which place of the board.
        ids: (n,) which point of the board.
        seen_px: (n, 2) where it was seen.
        off_px: (n, 2) projected - seen.
    """

    frame: Indices
    ids: Indices
    seen_px: Array
    off_px: Array


def residuals_of(solution: Adjusted, camera: int) -> Residuals:
    """The points of one camera."""
    block = solution.problem.blocks[camera]
    present = block.weight > 0
    frame = np.broadcast_to(np.arange(len(present))[:, None], present.shape)
    return Residuals(frame[present], block.ids[present], block.seen_px[present], solution.residuals_px[camera][present])


def by_radius(residuals: Residuals, camera: Camera) -> tuple[Array, Array, Array]:
    """(n,) radius from the principal point, and the residuals' parts away from it and across (clockwise as seen), px."""
    arm = residuals.seen_px - [camera.cx_px, camera.cy_px]
    radius = np.hypot(arm[:, 0], arm[:, 1])
    unit = arm / np.maximum(radius, 1e-9)[:, None]
    off = residuals.off_px
    return radius, np.sum(off * unit, 1), unit[:, 0] * off[:, 1] - unit[:, 1] * off[:, 0]


def running_mean(x: Array, y: Array, groups: int = 12) -> tuple[Array, Array, Array]:
    """Middle and mean of groups of equally many points along x, and the half-width of the mean's 95 % interval."""
    order = np.argsort(x, kind="stable")
    parts = [p for p in np.array_split(order, max(1, min(groups, x.size // 8))) if p.size > 1]
    middle = np.array([x[p].mean() for p in parts])
    mean = np.array([y[p].mean() for p in parts])
    half = np.array([HALF_WIDTH_95 * y[p].std(ddof=1) / np.sqrt(p.size) for p in parts])
    return middle, mean, half


def board_shifts_m(solution: Adjusted) -> tuple[Array, Array]:
    """Where each point of the board seems to lie besides its place, in the board's plane, from all pictures together.

    Returns:
        (points, 2) m, and (points,) u of each coordinate, m, by the noise that was seen; NaN for points that nobody saw.
    """
    problem, state = solution.problem, solution.state
    count = len(problem.board.points_m)
    normal, right = np.zeros((count, 2, 2)), np.zeros((count, 2))
    for camera, block in enumerate(problem.blocks):
        by_place = linearised(problem, state, camera, block.ids)[2][..., 3:]
        inner = (by_place @ state.boards.rotation[:, None, :, :2]) * block.weight[..., None, None]
        seen = np.nan_to_num(-solution.residuals_px[camera]) * block.weight[..., None]
        present = block.weight > 0
        ids, inner, seen = block.ids[present], inner[present], seen[present]
        np.add.at(normal, ids, inner.swapaxes(1, 2) @ inner)
        np.add.at(right, ids, np.einsum("nij,ni->nj", inner, seen))
    shifts, u = np.full((count, 2), np.nan), np.full(count, np.nan)
    known = np.linalg.det(normal) > 0
    shifts[known] = np.linalg.solve(normal[known], right[known][..., None])[..., 0]
    cov = np.linalg.inv(normal[known]) * solution.factor**2
    u[known] = np.sqrt(np.trace(cov, axis1=1, axis2=2) / 2)
    return shifts, u


def lens_curve(camera: Camera, samples: int = 60) -> tuple[Array, Array, Array]:
    """How far a lens moves a point away from the middle, mean of all directions.

    Compared with f tan(angle), for a fisheye with f times the angle.

    Returns:
        (samples,) radius in the picture, shift, and half-width of its 95 % interval, px.
    """
    angles = np.linspace(0, _widest_rad(camera), samples)
    radius, shift = _curve(camera, angles)
    cov = np.zeros((4 + camera.coefficients.size,) * 2) if camera.cov is None else camera.cov
    theta = np.concatenate([[camera.f_px, camera.aspect, camera.cx_px, camera.cy_px], camera.coefficients])
    slopes = np.zeros((theta.size, samples))
    for i in (0, *range(4, theta.size)):
        step = np.sqrt(cov[i, i]) / 10
        if step:
            moved = np.eye(theta.size)[i] * step
            above, below = (_curve(moved_camera(camera, theta + sign * moved), angles)[1] for sign in (1, -1))
            slopes[i] = (above - below) / (2 * step)
    u = np.sqrt(np.einsum("is,ij,js->s", slopes, cov, slopes).clip(0))
    return radius, shift, HALF_WIDTH_95 * u


def _widest_rad(camera: Camera) -> float:
    """The largest angle from the axis on the picture's rim that the lens model has."""
    x, y = np.meshgrid(np.linspace(0, camera.width_px - 1, 9), np.linspace(0, camera.height_px - 1, 9))
    z = camera.rays(np.column_stack([x.ravel(), y.ravel()]))[:, 2]
    return float(np.arccos(np.clip(np.nanmin(z), -1, 1)))


def _curve(camera: Camera, angles: Array) -> tuple[Array, Array]:
    around = np.arange(16) * np.pi / 8
    a, b = np.broadcast_arrays(angles[:, None], around)
    rays = np.stack([np.sin(a) * np.cos(b), np.sin(a) * np.sin(b), np.cos(a)], -1)
    pixels = camera.project(rays.reshape(-1, 3)).reshape(*a.shape, 2)
    arm = (pixels - [camera.cx_px, camera.cy_px]) / [1.0, camera.aspect]
    radius = np.mean(np.sum(arm * np.stack([np.cos(b), np.sin(b)], -1), -1), 1)
    ideal = angles if camera.lens == "fisheye" else np.tan(angles)
    return np.asarray(radius), np.asarray(radius - camera.f_px * ideal)
