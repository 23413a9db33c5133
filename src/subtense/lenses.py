"""Lens models: from a direction to normalised image coordinates and back.

A lens is a pair of functions on arrays. `to_plane(x, y, z, k)` takes directions in the camera frame (x right, y down,
z forward) to the normalised image plane, in which pixel = f_px * value + principal point. `to_ray(x, y, k)` is its
inverse; it gives NaN where the model can't be inverted, because the image radius has a turning point.

To add a lens: write the pair, and add a line to LENSES.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from .arrays import Array

Coefficients = Sequence[Array]
Pair = tuple[Array, Array]
Triple = tuple[Array, Array, Array]


@dataclass(frozen=True)
class Lens:
    """One row of LENSES.

    Attributes:
        title: the name people use.
        counts: how many distortion coefficients it may have.
        to_plane: directions to normalised image coordinates; NaN behind the camera.
        to_ray: normalised image coordinates to directions, not of unit length; NaN where there is none.
        perspective: whether straight lines stay straight but for distortion, as the pinhole methods need.
        formula: `to_plane` without the refusal where the image folds over: smooth, for who estimates coefficients; None where
            nothing folds.
        linear: coefficients that the image is linear in.
    """

    title: str
    counts: tuple[int, ...]
    to_plane: Callable[[Array, Array, Array, Coefficients], Pair]
    to_ray: Callable[[Array, Array, Coefficients], Triple]
    perspective: bool = True
    formula: Callable[[Array, Array, Array, Coefficients], Pair] | None = None
    linear: tuple[int, ...] = ()


# -- pinhole ---------------------------------------------------------------------------------------


def _in_front(x: Array, y: Array, z: Array) -> Pair:
    """x / z and y / z; NaN where the point is not in front of the camera."""
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = np.where(z > 0, z, np.nan)
        return x / depth, y / depth


def _pinhole_to_plane(x: Array, y: Array, z: Array, _: Coefficients) -> Pair:
    return _in_front(x, y, z)


def _pinhole_to_ray(x: Array, y: Array, _: Coefficients) -> Triple:
    return x, y, np.broadcast_to(1.0, x.shape)


# -- Brown-Conrady, as OpenCV has it: k1 k2 p1 p2 k3 | k4 k5 k6 | s1 s2 s3 s4 | tau_x tau_y ---------------


def _radial(r2: Array, k: Coefficients) -> Pair:
    """The radial factor R and its derivative by r squared."""
    top = 1 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]))
    slope = k[0] + r2 * (2 * k[1] + 3 * r2 * k[4])
    if len(k) < 8:
        return top, slope
    bottom = 1 + r2 * (k[5] + r2 * (k[6] + r2 * k[7]))
    bottom_slope = k[5] + r2 * (2 * k[6] + 3 * r2 * k[7])
    factor = top / bottom
    return factor, (slope - factor * bottom_slope) / bottom


def _distorted(x: Array, y: Array, k: Coefficients) -> tuple[Array, Array, Array, Array, Array, Array]:
    """Distorted coordinates without sensor tilt, and the Jacobian (xx, xy, yx, yy)."""
    x2, y2, xy = x * x, y * y, x * y
    r2 = x2 + y2
    factor, slope = _radial(r2, k)
    p1, p2 = k[2], k[3]
    xd = x * factor + 2 * p1 * xy + p2 * (r2 + 2 * x2)
    yd = y * factor + p1 * (r2 + 2 * y2) + 2 * p2 * xy
    slope2 = 2 * slope
    cross = slope2 * xy + 2 * (p1 * x + p2 * y)
    jxx = factor + slope2 * x2 + 2 * p1 * y + 6 * p2 * x
    jyy = factor + slope2 * y2 + 6 * p1 * y + 2 * p2 * x
    if len(k) < 12:
        return xd, yd, jxx, cross, cross, jyy
    s1, s2, s3, s4 = k[8:12]
    across, down = 2 * (s1 + 2 * s2 * r2), 2 * (s3 + 2 * s4 * r2)
    return (xd + r2 * (s1 + s2 * r2), yd + r2 * (s3 + s4 * r2),
            jxx + across * x, cross + across * y, cross + down * x, jyy + down * y)  # fmt: skip


def _tilt(k: Coefficients) -> Array:
    """The 3 x 3 homography of a tilted sensor (Scheimpflug), leading axes first."""
    cx, sx, cy, sy = np.cos(k[12]), np.sin(k[12]), np.cos(k[13]), np.sin(k[13])
    zero = np.zeros_like(cx)
    turn = np.stack([np.stack([cy, sy * sx, -sy * cx], -1), np.stack([zero, cx, sx], -1),
                     np.stack([sy, -cy * sx, cy * cx], -1)], -2)  # fmt: skip
    one = np.ones_like(zero)
    project = np.stack([np.stack([turn[..., 2, 2], zero, -turn[..., 0, 2]], -1),
                        np.stack([zero, turn[..., 2, 2], -turn[..., 1, 2]], -1),
                        np.stack([zero, zero, one], -1)], -2)  # fmt: skip
    return np.asarray(project @ turn)


def _through(homography: Array, x: Array, y: Array) -> Pair:
    h = homography
    w = h[..., 2, 0] * x + h[..., 2, 1] * y + h[..., 2, 2]
    return (h[..., 0, 0] * x + h[..., 0, 1] * y + h[..., 0, 2]) / w, (
        h[..., 1, 0] * x + h[..., 1, 1] * y + h[..., 1, 2]
    ) / w


def _brown_formula(x: Array, y: Array, z: Array, k: Coefficients) -> Pair:
    x, y = _in_front(x, y, z)
    xd, yd = _distorted(x, y, k)[:2]
    return _through(_tilt(k), xd, yd) if len(k) >= 14 else (xd, yd)


def _brown_to_plane(x: Array, y: Array, z: Array, k: Coefficients) -> Pair:
    x, y = _in_front(x, y, z)
    xd, yd = _distorted(x, y, k)[:2]
    folded = x * x + y * y > _turning_radius(k) ** 2
    xd, yd = np.where(folded, np.nan, xd), np.where(folded, np.nan, yd)
    return _through(_tilt(k), xd, yd) if len(k) >= 14 else (xd, yd)


_GRID = np.linspace(0.0, 4.0, 513)[1:]  # radii up to 76 degrees off the axis


def _turning_radius(k: Coefficients) -> Array:
    """The undistorted radius at which the distorted one stops growing; inf if it never does within 76 degrees."""
    lead = np.broadcast_shapes(*(np.shape(c) for c in k))
    if int(np.prod(lead)) > 64:  # draws: the smallest turning point of a few dozen serves them all
        k = [c.reshape(-1)[:: max(1, c.size // 64)] if c.size > 1 else c.reshape(-1) for c in map(np.asarray, k)]
    radius = _GRID.reshape(-1, *(1,) * np.ndim(k[0]))
    factor, slope = _radial(radius**2, k)
    bent = factor + 2 * radius**2 * slope <= 0
    first = np.where(bent.any(axis=0), _GRID[np.argmax(bent, axis=0)] - _GRID[0], np.inf)
    return np.asarray(first.min() if int(np.prod(lead)) > 64 else first)


def _newton_step(x: Array, y: Array, xd: Array, yd: Array, k: Coefficients) -> tuple[Array, Array, Array]:
    """One Newton step towards the undistorted point, and the residual before it."""
    xe, ye, jxx, jxy, jyx, jyy = _distorted(x, y, k)
    ex, ey = xe - xd, ye - yd
    with np.errstate(divide="ignore", invalid="ignore"):
        det = 1.0 / (jxx * jyy - jxy * jyx)
        return x - det * (jyy * ex - jxy * ey), y - det * (jxx * ey - jyx * ex), np.maximum(abs(ex), abs(ey))


_LAST_STEP = 3e-7  # a residual below this is below 1e-12 after one more quadratic step


def _brown_to_ray(xd: Array, yd: Array, k: Coefficients) -> Triple:
    if len(k) >= 14:
        xd, yd = _through(np.asarray(np.linalg.inv(_tilt(k)), float), xd, yd)
    limit = _turning_radius(k)
    x, y = _start(xd, yd, k, limit)
    residual = np.zeros_like(x)
    for _ in range(4):
        x, y, residual = _newton_step(x, y, xd, yd, k)
        if np.max(residual, initial=0.0) < _LAST_STEP:
            break
    else:
        x, y = _finish(x, y, xd, yd, k, limit, residual)
    with np.errstate(invalid="ignore"):
        lost = ~(x * x + y * y <= limit * limit)
    if lost.any():
        x, y = np.where(lost, np.nan, x), np.where(lost, np.nan, y)
    return x, y, np.ones_like(x)


def _start(xd: Array, yd: Array, k: Coefficients, limit: Array) -> Pair:
    """A first guess on the near side of the turning point: one fixed-point step, held back at the limit."""
    rd2 = xd * xd + yd * yd
    factor = 1.0 / np.maximum(_radial(rd2, k)[0], 0.3)
    if not np.all(np.isinf(limit)):
        with np.errstate(divide="ignore"):
            factor = np.minimum(factor, 0.9 * limit / np.sqrt(rd2))
    return xd * factor, yd * factor


def _finish(x: Array, y: Array, xd: Array, yd: Array, k: Coefficients, limit: Array, residual: Array) -> Pair:
    """The few stubborn points, step by step, held inside the turning point; NaN where nothing converges."""
    x, y, xd, yd, limit, *k = (np.array(a) for a in np.broadcast_arrays(x, y, xd, yd, limit, *k))
    hard = ~(residual < _LAST_STEP)
    hx, hy, hxd, hyd, hk, hlimit = x[hard], y[hard], xd[hard], yd[hard], [c[hard] for c in k], limit[hard]
    bad = ~np.isfinite(hx + hy)
    hx, hy = np.where(bad, 0.0, hx), np.where(bad, 0.0, hy)
    for _ in range(40):
        nx, ny, error = _newton_step(hx, hy, hxd, hyd, hk)
        old, new = np.hypot(hx, hy), np.hypot(nx, ny)
        held = np.where(new < hlimit, new, (old + np.minimum(hlimit, 1e3)) / 2)
        with np.errstate(divide="ignore", invalid="ignore"):
            scale = np.where(new > 0, held / new, 1.0)
        hx, hy = nx * scale, ny * scale
        if np.nanmax(error, initial=0.0) < _LAST_STEP * 1e-3:
            break
    error = _newton_step(hx, hy, hxd, hyd, hk)[2]
    found = error < 1e-10
    x[hard], y[hard] = np.where(found, hx, np.nan), np.where(found, hy, np.nan)
    return x, y


# -- Kannala-Brandt fisheye, as OpenCV's cv2.fisheye: k1 to k4 on the angle ------------------------------------


def _fisheye_radius(angle: Array, k: Coefficients) -> Pair:
    """Image radius of an angle off the axis, and its derivative."""
    t = angle * angle
    radius = angle * (1 + t * (k[0] + t * (k[1] + t * (k[2] + t * k[3]))))
    return radius, 1 + t * (3 * k[0] + t * (5 * k[1] + t * (7 * k[2] + t * 9 * k[3])))


def _fisheye_formula(x: Array, y: Array, z: Array, k: Coefficients) -> Pair:
    across = np.hypot(x, y)
    radius, _ = _fisheye_radius(np.arctan2(across, z), k)
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = np.where(across > 0, radius / across, 0.0)
    return x * scale, y * scale


def _fisheye_to_plane(x: Array, y: Array, z: Array, k: Coefficients) -> Pair:
    xd, yd = _fisheye_formula(x, y, z, k)
    folded = np.arctan2(np.hypot(x, y), z) > _fisheye_turning_angle(k)
    return np.where(folded, np.nan, xd), np.where(folded, np.nan, yd)


def _fisheye_turning_angle(k: Coefficients) -> Array:
    """The angle at which the image radius stops growing; pi if it never does."""
    angles = np.linspace(0.0, np.pi, 361)[1:].reshape(-1, *(1,) * np.ndim(k[0]))
    bent = _fisheye_radius(angles, k)[1] <= 0
    flat = angles.reshape(-1)
    return np.asarray(np.where(bent.any(axis=0), flat[np.argmax(bent, axis=0)] - flat[0], np.pi))


def _fisheye_to_ray(xd: Array, yd: Array, k: Coefficients) -> Triple:
    radius = np.hypot(xd, yd)
    limit = _fisheye_turning_angle(k)
    angle = np.minimum(radius, 0.95 * limit)
    for _ in range(12):
        seen, slope = _fisheye_radius(angle, k)
        step = (seen - radius) / np.where(slope > 0.05, slope, 0.05)
        angle = np.clip(angle - step, 0.0, limit)
        if np.max(abs(step), initial=0.0) < 1e-13:
            break
    lost = ~(abs(_fisheye_radius(angle, k)[0] - radius) < 1e-10)
    angle = np.where(lost, np.nan, angle)
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = np.where(radius > 0, np.sin(angle) / radius, 1.0)
    return xd * scale, yd * scale, np.cos(angle)


# -- equirectangular panorama: longitude across, latitude down ---------------------------------------------


def _panorama_to_plane(x: Array, y: Array, z: Array, _: Coefficients) -> Pair:
    return np.arctan2(x, z), np.arctan2(y, np.hypot(x, z))


def _panorama_to_ray(x: Array, y: Array, _: Coefficients) -> Triple:
    y = np.where(abs(y) > np.pi / 2, np.nan, y)
    return np.cos(y) * np.sin(x), np.sin(y), np.cos(y) * np.cos(x)


LENSES: dict[str, Lens] = {
    "pinhole": Lens("pinhole", (0,), _pinhole_to_plane, _pinhole_to_ray),
    "brown_conrady": Lens(
        "Brown-Conrady (OpenCV)", (5, 8, 12, 14), _brown_to_plane, _brown_to_ray, True, _brown_formula
    ),
    "fisheye": Lens(
        "Kannala-Brandt fisheye", (4,), _fisheye_to_plane, _fisheye_to_ray, True, _fisheye_formula, (0, 1, 2, 3)
    ),
    "equirectangular": Lens("equirectangular panorama", (0,), _panorama_to_plane, _panorama_to_ray, False),
}
"""Every lens model. In a file or an option they go by these names."""
