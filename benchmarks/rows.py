"""Millions of rows with uncertainty, against the same values by plain NumPy without, and against `uncertainties`."""

from __future__ import annotations

import dataclasses

import numpy as np
from comparison import Comparison, compare, table
from uncertainties import ufloat, unumpy

from subtense import Camera, Observation, Quantity, propagate
from subtense.methods.known_size import METHOD, Inputs

ROWS = 10_000_000
FEW_ROWS = 100_000
BY_DIFFERENCES = dataclasses.replace(METHOD, derivative=None)


def comparisons(turns: int = 5, rows: int = ROWS) -> list[Comparison]:
    """By differences, by the method's derivative, and both against `uncertainties` on fewer rows."""
    many, few = scene(rows), scene(FEW_ROWS)
    check(few)
    ways = ((BY_DIFFERENCES, "by differences", 6), (METHOD, "by derivative", 2))
    against_numpy = [
        compare(f"rows() of {rows:,}, {way}", lambda m=method: propagate.rows(m, many), "NumPy, values only",
                lambda: values_only(many), turns=turns, target=target)
        for method, way, target in ways
    ]  # fmt: skip
    against_package = [
        compare(f"rows() of {FEW_ROWS:,}, {way}", lambda m=method: propagate.rows(m, few), "uncertainties.unumpy",
                lambda: with_package(few), turns=min(turns, 3))
        for method, way, _ in ways
    ]  # fmt: skip
    return against_numpy + against_package


def scene(rows: int) -> Inputs:
    """One camera with doubt in f, cx and cy; ends and sizes with their own doubt in every row."""
    rng = np.random.default_rng(1)
    camera = Camera(4000, 3000, 3000.0, 1999.5, 1499.5, cov=np.diag([15.0**2, 0.0, 8.0**2, 6.0**2]))
    first = rng.uniform((200.0, 200.0), (2000.0, 2800.0), (rows, 2))
    step = rng.uniform((100.0, -100.0), (1500.0, 100.0), (rows, 2))
    ends = Observation(np.stack([first, first + step], axis=1), rng.uniform(0.3, 1.0, (rows, 2)))
    size = rng.uniform(0.2, 2.0, rows)
    return Inputs(camera, ends, Quantity(size, 0.01 * size, "m", source="stated"))


def values_only(inputs: Inputs) -> tuple[np.ndarray, np.ndarray]:
    """Range and depth as one writes them in NumPy, on whole arrays."""
    camera, points, size = inputs.camera, inputs.ends.points_px, inputs.size.value
    x = (points[..., 0] - camera.cx_px) / camera.f_px
    y = (points[..., 1] - camera.cy_px) / (camera.f_px * camera.aspect)
    ax, ay = x[:, 1] - x[:, 0], y[:, 1] - y[:, 0]
    bx, by = (x[:, 0] + x[:, 1]) / 2, (y[:, 0] + y[:, 1]) / 2
    depth = size / np.sqrt(ax * ax + ay * ay)
    return depth * np.sqrt(1 + bx * bx + by * by), depth


def with_package(inputs: Inputs) -> tuple[np.ndarray, np.ndarray]:
    """Values and standard deviations (2, rows) of the same two outputs by `uncertainties`."""
    camera, ends, size = inputs.camera, inputs.ends, inputs.size
    assert camera.cov is not None
    f, cx, cy = (
        ufloat(getattr(camera, n), np.sqrt(camera.cov[i, i])) for n, i in (("f_px", 0), ("cx_px", 2), ("cy_px", 3))
    )
    points = unumpy.uarray(ends.points_px, ends.standard_deviations.reshape(ends.points_px.shape))
    x, y = (points[..., 0] - cx) / f, (points[..., 1] - cy) / f
    ax, ay = x[:, 1] - x[:, 0], y[:, 1] - y[:, 0]
    bx, by = (x[:, 0] + x[:, 1]) / 2, (y[:, 0] + y[:, 1]) / 2
    depth = unumpy.uarray(size.value, size.u) / unumpy.sqrt(ax * ax + ay * ay)
    both = np.stack([depth * unumpy.sqrt(1 + bx * bx + by * by), depth])
    return unumpy.nominal_values(both), unumpy.std_devs(both)


def check(inputs: Inputs, rows: int = 500) -> None:
    """All four ways agree on the first rows; a benchmark of a wrong answer is worth nothing."""
    inputs = Inputs(inputs.camera, inputs.ends.rows(slice(rows)), inputs.size.rows(slice(rows)))
    value, u = with_package(inputs)
    np.testing.assert_allclose(np.stack(values_only(inputs)), value, rtol=1e-12)
    for method, tolerance in ((METHOD, 1e-9), (BY_DIFFERENCES, 1e-3)):
        found = propagate.rows(method, inputs)
        np.testing.assert_allclose(found.value, value, rtol=1e-12)
        np.testing.assert_allclose(found.u, u, rtol=tolerance)


if __name__ == "__main__":
    print(table(comparisons()))
