"""Vanishing points of lines that are parallel in the world, and heights over a plane from them.

A line through two picture points a, b is a x b, and lines that are parallel in the world meet in one point v: v is the direction of
least squares |w (a x b) . v|, with the weight w of each line from its length and its place. v is homogeneous (x, y, w) and may lie at
infinity. What stands upright at b and ends at t is seen as t ~ b + mu v, with b scaled to l . b = 1 by the plane's horizon l; mu is
proportional to its height, whatever the camera, and that of the camera itself is -1 / (l . v).

Source: A. Criminisi, I. Reid, A. Zisserman, Single view metrology, IJCV 40, 2000, sections 3.1, 4.1; R. Collins, R. Weiss, Vanishing
point calculation as a statistical inference on the unit sphere, ICCV 1990.
"""

from __future__ import annotations

import numpy as np

from .arrays import Array, Bools

DEGENERATE = 1e-10
"""Second eigenvalue, in units of the largest, below which lines have no single point in common."""


def homogeneous(points: Array) -> Array:
    """(..., N, 2) to (..., N, 3)."""
    return np.concatenate([points, np.ones((*points.shape[:-1], 1))], -1)


def lines_of(points: Array) -> Array:
    """(..., K, 3) lines through points 1 and 2, 3 and 4, ... of (..., 2K, 2); as long as they."""
    ends = homogeneous(points)
    return np.cross(ends[..., 0::2, :], ends[..., 1::2, :])


def vanishing_point(points: Array, weights: Array) -> tuple[Array, Bools]:
    """Where lines meet.

    Args:
        points: (..., 2K, 2) two points of each line.
        weights: (K,) of each, see `weights_of`.

    Returns:
        (..., 3) unit vector, and (...) whether there is none.
    """
    weighted = lines_of(points) * weights[:, None]
    if weighted.shape[-2] == 2:  # exact, and without the squares
        meet = np.cross(weighted[..., 0, :], weighted[..., 1, :])
        size = np.sqrt(np.sum(meet**2, -1))
        apart = np.sqrt(np.prod(np.sum(weighted**2, -1), -1))
        lost = np.asarray(~(size > DEGENERATE * apart))
        with np.errstate(divide="ignore", invalid="ignore"):
            return meet / size[..., None], lost
    sums = np.swapaxes(weighted, -1, -2) @ weighted
    finite = np.asarray(np.isfinite(sums).all(axis=(-1, -2)))
    values, vectors = np.linalg.eigh(np.where(finite[..., None, None], sums, np.eye(3)))
    lost = np.asarray(~finite | ~(values[..., 1] > DEGENERATE * values[..., 2]))
    return vectors[..., 0], lost


def weights_of(points: Array, sigma: Array) -> Array:
    """(K,) inverse standard deviations of (a x b) . v for the nominal lines, with the mean 1.

    Args:
        points: (2K, 2) two points of each line.
        sigma: (2K,) standard deviation of each point.
    """
    each = np.maximum(np.sqrt((sigma[0::2] ** 2 + sigma[1::2] ** 2) / 2), 1e-9 * max(float(sigma.max()), 1e-300))
    weights = np.ones(len(points) // 2)
    middles = (points[0::2] + points[1::2]) / 2
    for _ in range(5):
        v, _ = vanishing_point(points, weights)
        if not np.all(np.isfinite(v)):
            return np.ones(len(points) // 2)
        away = np.hypot(*(v[:2] - v[2] * middles).T)
        weights = 1 / (each * np.maximum(away, 1e-9 * max(float(away.max()), 1e-300)))
        weights = weights / weights.mean()
    return weights


def misses(points: Array, v: Array) -> Array:
    """(..., K) how far the ends of each line lie off the line from its middle to v (..., 3), in the unit of points."""
    middles = (points[..., 0::2, :] + points[..., 1::2, :]) / 2
    away = v[..., None, :2] - v[..., None, 2:] * middles
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.sum(lines_of(points) * v[..., None, :], -1) / np.sqrt(np.sum(away**2, -1)) / 2)


def upright_share(base: Array, top: Array, v: Array, horizon: Array) -> Array:
    """(...) mu of an upright thing, proportional to its height; NaN where it has no place.

    Args:
        base: (..., 2) on the plane.
        top: (..., 2) above it.
        v: (..., 3) vanishing point of the upright direction.
        horizon: (..., 3) of the plane.
    """
    b, t = homogeneous(base[..., None, :])[..., 0, :], homogeneous(top[..., None, :])[..., 0, :]
    across = np.cross(t, v)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(-np.sum(np.cross(t, b) * across, -1) / np.sum(across**2, -1) / np.sum(horizon * b, -1))


def camera_share(v: Array, horizon: Array) -> Array:
    """(...) the same of the camera over the plane."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(-1 / np.sum(horizon * v, -1))


def below_horizon(base: Array, horizon: Array) -> Array:
    """(...) signed place of a point (..., 2) beside the horizon; two points of the plane have the same sign."""
    return np.asarray(np.sum(homogeneous(base[..., None, :])[..., 0, :] * horizon, -1))
