"""How often the intervals of discs and balls hold the truth; scenes and bounds as in test_coverage."""

import numpy as np
import pytest
from test_coverage import cameras, score

from subtense.geometry import Pose, rotation_from_vector
from subtense.methods import circle, sphere
from subtense.observation import Observation
from subtense.quantity import Quantity

# depth in diameters, tilt in degrees, points clicked, share of the rim seen, noise in px
DISCS = {
    "facing": ((8, 20), (0, 0), 8, 1.0, 0.7),
    "typical": ((8, 20), (0, 60), 8, 1.0, 0.7),
    "any direction": ((8, 20), None, 8, 1.0, 0.7),
    "far": ((40, 60), None, 8, 1.0, 0.7),
    "half seen": ((8, 15), (20, 60), 12, 0.5, 0.5),
    "edge-on": ((8, 15), (70, 80), 10, 1.0, 0.5),
}
BALLS = {
    "near": ((1.5, 3), 8, 1.0, 0.7),
    "typical": ((8, 20), 8, 1.0, 0.7),
    "far": ((60, 100), 5, 1.0, 0.7),
    "a third seen": ((5, 10), 9, 0.35, 0.5),
}


def rim_of(rng, count, share):
    """Angles of clicked points: roughly even, over a share of the rim."""
    first = rng.uniform(0, 2 * np.pi)
    return first + 2 * np.pi * share * (np.arange(count) + rng.uniform(-0.3, 0.3, count)) / count


def place_of(rng, depths, size):
    return size * rng.uniform(*depths) * np.array([rng.uniform(-0.3, 0.3), rng.uniform(-0.2, 0.2), 1])


def disc_scene(kind, rng):
    """Inputs as a tool would have them for a disc, and its true range and depth."""
    depths, tilts, count, share, sigma = DISCS[kind]
    truth, told = cameras(rng)
    size = 0.025
    middle = place_of(rng, depths, size)
    tilt = np.arccos(rng.uniform(0.25, 1)) if tilts is None else np.radians(rng.uniform(*tilts))
    sight, turn = middle / np.linalg.norm(middle), rng.uniform(0, 2 * np.pi)
    facing = circle_frame(sight)
    lean = rotation_from_vector(tilt * np.array([np.cos(turn), np.sin(turn), 0]))
    around = rim_of(rng, count, share)
    rim = size / 2 * np.stack([np.cos(around), np.sin(around), 0 * around], -1)
    pixels = truth.project(Pose(facing.T @ lean, middle).apply(rim)) + rng.normal(0, sigma, (count, 2))
    stated = Quantity.normal(size + rng.normal(0, 0.0001), 0.0001, "m")
    return circle.Inputs(told, Observation(pixels, sigma), stated), np.array([np.linalg.norm(middle), middle[2]])


def circle_frame(axis):
    first = np.cross([0.0, 1.0, 0.0], axis)
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(axis, first), axis])


def ball_scene(kind, rng):
    """The same for a ball."""
    depths, count, share, sigma = BALLS[kind]
    truth, told = cameras(rng)
    size = 0.2
    middle = place_of(rng, depths, size)
    far, radius = np.linalg.norm(middle), size / 2
    frame, around = circle_frame(middle / far), rim_of(rng, count, share)
    sine = radius / far
    touch = np.stack([np.cos(around), np.sin(around), 0 * around], -1) * radius * np.sqrt(1 - sine**2)
    points = touch @ frame + (1 - sine**2) * middle
    pixels = truth.project(points) + rng.normal(0, sigma, (count, 2))
    stated = Quantity.normal(size + rng.normal(0, 0.001), 0.001, "m")
    return sphere.Inputs(told, Observation(pixels, sigma), stated), np.array([far, middle[2]])


def without_tilt():
    """The tilt needs draws in many scenes, and has a test of its own."""
    from dataclasses import replace

    return replace(circle.METHOD, outputs=circle.METHOD.outputs[:2])


FEW = 80
"""Scenes of a geometry here; benchmarks/accuracy.py has 1,000. The share that holds the truth is then 0.86 or more (0.1 %)."""


@pytest.mark.parametrize(
    ("method", "make", "kind"),
    [*((without_tilt(), disc_scene, kind) for kind in ("facing", "any direction", "half seen")),
     *((sphere.METHOD, ball_scene, kind) for kind in BALLS)],
    ids=lambda x: x if isinstance(x, str) else "",
)  # fmt: skip
def test_intervals_hold_the_truth(method, make, kind):
    hit, below, z, width, error = score(method, make, kind, FEW)
    assert np.all(hit.mean(axis=0) >= 0.86)
    assert np.abs(z).max() < 4.5
    assert np.all(width.mean(axis=0) < 1.4 * 3.92 * np.sqrt(np.mean(error**2, axis=0)))
    assert np.all(below.mean(axis=0) < 0.1)
