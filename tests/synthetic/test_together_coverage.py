"""How often the interval of a distance between two things, and of a number from several measurements, holds the truth.

Everything is noisy: the camera, the sizes, how the camera stands, the pixels. 95 % are promised; below 5 of its noise, the distance
between two things at least 94 %. benchmarks/together.py counts more scenes.
"""

import dataclasses

import numpy as np
import pytest

from subtense.camera import Camera
from subtense.ground import level_ground
from subtense.methods import ground_plane, known_size
from subtense.observation import Observation
from subtense.quantity import Quantity
from subtense.workflow.between import between
from subtense.workflow.fuse import fuse

SCENES = 100
U_F, U_C = 15.0, 6.0
# distance of the two from the camera, and from each other, m; u of each one's size as a share
APART = {
    "good": (8.0, 6.0, 0.005),
    "typical": (15.0, 5.0, 0.02),
    "bad": (30.0, 6.0, 0.04),
    "side by side": (20.0, 1.0, 0.04),
    "nearly one": (20.0, 0.1, 0.03),
}


def cameras(rng):
    """The true camera, and the one that is told."""
    true = Camera(1600, 1200, 1500.0, 799.5, 599.5)
    cov = np.diag([U_F**2, 0, U_C**2, U_C**2])
    f, x, y = np.array([1500.0, 799.5, 599.5]) + np.array([U_F, U_C, U_C]) * rng.standard_normal(3)
    return true, Camera(1600, 1200, f, x, y, cov=cov)


def sized(rng, true, told, place, u):
    """Something upright at a place, seen by the true camera; its size is told with a relative u."""
    height = 1.7 * (1 + u * rng.standard_normal())
    ends = place + np.array([[0, -height / 2, 0], [0, height / 2, 0]])
    seen = Observation(true.project(ends) + rng.normal(0, 0.7, (2, 2)), 0.7)
    return known_size.METHOD, known_size.Inputs(told, seen, Quantity.normal(1.7, 1.7 * u, "m"))


def apart(kind, rng):
    """Two things in a direction of chance from each other, and how far apart they are."""
    far, length, u = APART[kind]
    true, told = cameras(rng)
    way = rng.standard_normal(3) * np.array([1.0, 0.1, 1.0])
    way = np.array([1.0, 0, 0]) if kind == "side by side" else way / np.linalg.norm(way)
    middle = np.array([rng.uniform(-0.15, 0.15) * far, 0, far])
    first, second = middle - way * length / 2, middle + way * length / 2
    return sized(rng, true, told, first, u), sized(rng, true, told, second, u), length


def standing(rng, kind):
    """A person by size and by where the feet are: two ways, and the true range of the middle."""
    far, u, u_pitch = {"good": (6.0, 0.01, 0.1), "typical": (12.0, 0.04, 0.3), "bad": (25.0, 0.06, 0.3)}[kind]
    true, told = cameras(rng)
    pitch, height = np.radians(u_pitch) * rng.standard_normal(), 1.6 + 0.02 * rng.standard_normal()
    slope = level_ground().u * rng.standard_normal()
    place = np.array([rng.uniform(-0.1, 0.1) * far, 0.0, far])
    down = 1.6 - np.tan(slope) * far  # the ground under the feet, below the camera; its cross slope is left level
    person = 1.7 * (1 + u * rng.standard_normal())
    ends = place + np.array([[0, down - person, 0], [0, down, 0]])
    seen = true.project(ends) + rng.normal(0, 0.7, (2, 2))
    by_size = known_size.Inputs(told, Observation(seen, 0.7), Quantity.normal(1.7, 1.7 * u, "m"))
    by_foot = ground_plane.Inputs(
        camera=told, height=Quantity.normal(height, 0.02, "m"), pitch=Quantity.normal(pitch, np.radians(u_pitch), "rad"),
        roll=Quantity.exact(0.0, "rad"), cross_slope=Quantity.exact(0.0, "rad"), foot=Observation(seen[1:], 0.7),
        above=Quantity.normal(0.85, 0.85 * u, "m"),
    )  # fmt: skip
    middle = place + np.array([0, down - person / 2, 0])
    return [(known_size.METHOD, by_size), (ground_plane.METHOD, by_foot)], float(np.linalg.norm(middle))


def score(kind, scenes, what="between", seed=0, draws=2_000):
    """(scenes,) whether the interval holds the truth, and whether the truth lies below it."""
    rng = np.random.default_rng([seed, *map(ord, kind)])
    hit, below = [], []
    for i in range(scenes):
        if what == "between":
            first, second, true = apart(kind, rng)
            m = between(first, second, seed=i, draws=draws)[0]
        else:
            pairs, true = standing(rng, kind)
            m = fuse(pairs, "range", seed=i, draws=draws).one
        low, high = (-np.inf if m.low is None else m.low), (np.inf if m.high is None else m.high)
        hit.append(low <= true <= high)
        below.append(true < low)
    return np.array(hit), np.array(below)


@pytest.mark.parametrize("kind", ["typical", "side by side", "nearly one"])
def test_between(kind):
    hit, _ = score(kind, SCENES)
    assert hit.mean() >= 0.87  # 94 % less three standard deviations of 100
    if kind == "typical":
        assert hit.mean() <= 0.995


def test_fused():
    hit, _ = score("typical", SCENES // 2, "fuse")
    assert hit.mean() >= 0.84


def test_a_doubt_left_out_is_noticed():
    """The same scenes with the camera's doubt left out hold too rarely: the count can fail."""
    rng = np.random.default_rng(4)
    hit = []
    for i in range(60):
        (method, one), (_, other), true = apart("good", rng)
        bare = [(method, dataclasses.replace(x, camera=dataclasses.replace(x.camera, cov=None),
                                             size=dataclasses.replace(x.size, u=1e-6))) for x in (one, other)]  # fmt: skip
        m = between(*bare, seed=i, draws=2_000)[0]
        hit.append(m.low <= true <= m.high)
    assert np.mean(hit) < 0.85
