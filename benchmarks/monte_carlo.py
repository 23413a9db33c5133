"""Draws through a method, against what NumPy takes for drawing the same inputs alone."""

from __future__ import annotations

import numpy as np
from comparison import Comparison, compare, table

from subtense import Camera, Observation, Quantity, propagate
from subtense.methods.known_size import METHOD, Inputs

DRAWS = 100_000
LENS = np.array([-0.12, 0.05, 0.0006, -0.0004, -0.01])


def comparisons(turns: int = 25) -> list[Comparison]:
    """Nine uncertain inputs: four of a pinhole camera, four coordinates, one size; then with lens distortion."""
    return [
        _comparison("a pinhole", None, turns, 3),
        _comparison("Brown-Conrady, 5 fixed coefficients", LENS, turns, 7),
    ]


def _comparison(lens: str, distortion: np.ndarray | None, turns: int, target: float) -> Comparison:
    inputs = scene(distortion)
    laws = nine_laws(inputs)

    def draw_only() -> list[np.ndarray]:
        rng = np.random.default_rng(0)
        return [rng.normal(mean, sd, DRAWS) for mean, sd in laws]

    return compare(f"sample of {DRAWS:,} draws, {lens}", lambda: propagate.sample(METHOD, inputs, DRAWS, seed=0),
                   "rng.normal, the 9 inputs", draw_only, turns=turns, target=target)  # fmt: skip


def scene(distortion: np.ndarray | None) -> Inputs:
    """Half a metre seen 800 px long by a 12-megapixel camera."""
    variances = [15.0**2, 1e-3**2, 8.0**2, 6.0**2]
    lens = "pinhole" if distortion is None else "brown_conrady"
    fixed = [0.0] * (0 if distortion is None else len(distortion))
    camera = Camera(4000, 3000, 3000.0, 1999.5, 1499.5, lens=lens, distortion=distortion,
                    cov=np.diag([*variances, *fixed]))  # fmt: skip
    ends = Observation(np.array([[1500.0, 1200.0], [2290.0, 1330.0]]), 0.7)
    return Inputs(camera, ends, Quantity.normal(0.5, 0.001, "m"))


def nine_laws(inputs: Inputs) -> list[tuple[float, float]]:
    """Mean and standard deviation of each uncertain number that matters in the scene."""
    camera, ends, size = inputs.camera, inputs.ends, inputs.size
    assert camera.cov is not None
    means = [camera.f_px, camera.aspect, camera.cx_px, camera.cy_px, *ends.points_px.ravel(), size.value]
    deviations = [*np.sqrt(np.diag(camera.cov)[:4]), *ends.standard_deviations, size.u]
    return [(float(mean), float(sd)) for mean, sd in zip(means, deviations, strict=True)]


if __name__ == "__main__":
    print(table(comparisons()))
