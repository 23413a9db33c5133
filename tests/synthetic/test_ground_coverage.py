"""How often the 95 % interval on the ground holds the truth: scenes with exact truth, noise of the stated law on everything.

1,000 scenes a geometry must give 92.6 to 97.1 %, 300 must give 90.3 to 98.7 %, 150 must give 88 to 99.4 % (binomial, 0.1 %
two-sided), and neither side may have more than 4.6, 6 or 7.4 % of misses; benchmarks/ground.py has 5,000, for 93.96 to 95.98 %,
and 1.8 to 3.3 % on each side.
"""

import math

import numpy as np
import pytest

from subtense import propagate
from subtense.camera import Camera
from subtense.methods import (
    ground_length,
    ground_plane,
    ground_sampling,
    ground_speed,
    surveyed_ground,
)
from subtense.observation import Observation
from subtense.quantity import Quantity
from subtense.target import Target

SCENES, FEWER, FEWEST = 1000, 300, 150
BOUNDS = {SCENES: (0.926, 0.971), FEWER: (0.903, 0.987), FEWEST: (0.880, 0.994)}
MOST_ON_ONE_SIDE = {SCENES: 0.046, FEWER: 0.060, FEWEST: 0.074}
WIDTH, HEIGHT = 1600, 1200
EARTH_M = 6_371_000.0
U_CAMERA = np.array([0.01 * 1500, 0.0, 4.0, 4.0, 0.005, 0, 0, 0, 0])


def cameras(rng):
    """The true camera, and the one that the tool is told, which is off by its own covariance."""
    truth = np.array([1500.0, 1.0, 805.0, 592.0, rng.uniform(-0.05, 0.02), 0.01, 1e-4, -1e-4, 0.0])
    told = truth + U_CAMERA * rng.standard_normal(9)

    def make(v, cov=None):
        return Camera(WIDTH, HEIGHT, v[0], v[2], v[3], v[1], "brown_conrady", v[4:], cov)

    return make(truth), make(told, np.diag(U_CAMERA**2))


def about(true, u, unit, rng):
    """A quantity that is off by its own u."""
    return Quantity.normal(true + rng.normal(0, u), u, unit)


def camera_from_level(pitch, roll):
    """Rows: the camera's right, down and forward in the level frame (right, ahead, up); written independently of the package."""
    forward = np.array([0, math.cos(pitch), math.sin(pitch)])
    down = np.array([0, math.sin(pitch), -math.cos(pitch)])
    right = np.array([1.0, 0, 0])
    c, s = math.cos(roll), math.sin(roll)
    return np.stack([c * right + s * down, -s * right + c * down, forward])


# height of the camera; pitch in degrees; how far the points are, in heights; u of pitch and roll in degrees, and of the slope
GEOMETRY = {
    "good": ((4, 12), (-35, -25), (1.2, 2.2), 0.1, 0.002),
    "typical": ((1.5, 6), (-9, -6), (5, 8), 0.3, 0.004),
    "bad": ((1.5, 2.5), (-4, -2), (12, 16), 0.6, 0.008),
    "far": ((20, 60), (-3, -2), (25, 32), 0.1, 0.001),
    "nadir": ((30, 100), (-90, -85), (0.05, 0.3), 0.5, 0.01),
}


def scene(kind, rng, count):
    """What the tool is told of the standing, and `count` points on the ground: their pixels and places, camera at (0, 0, height)."""
    heights, pitches, distances, u_deg, u_slope = GEOMETRY[kind]
    height, pitch, roll = rng.uniform(*heights), math.radians(rng.uniform(*pitches)), math.radians(rng.normal(0, 2))
    u = math.radians(u_deg)
    slope, cross = rng.normal(0, u_slope, 2)
    k = rng.normal(0.13, 0.13)
    truth, told = cameras(rng)
    bearing = math.radians(10)
    way = rng.uniform(-bearing, bearing, count) if kind != "nadir" else rng.uniform(-math.pi, math.pi, count)
    far = height * rng.uniform(*distances, count)
    x, y = far * np.sin(way), far * np.cos(way)
    if kind == "nadir":  # about the picture's middle, not the camera's foot
        y = y + height * math.tan(math.pi / 2 + pitch)
    z = x * math.tan(cross) + y * math.tan(slope) - (x**2 + y**2) * (1 - k) / (2 * EARTH_M)
    ground = np.stack([x, y, z], -1)
    camera_frame = (ground - [0, 0, height]) @ camera_from_level(pitch, roll).T
    pixels = truth.project(camera_frame)
    common = {
        "camera": told, "height": about(height, 0.01 * height, "m", rng), "pitch": about(pitch, u, "rad", rng),
        "roll": about(roll, u, "rad", rng), "slope": Quantity.normal(0.0, u_slope, "rad"),
        "cross_slope": Quantity.normal(0.0, u_slope, "rad"),
    }  # fmt: skip
    return common, pixels + rng.normal(0, 0.7, (count, 2)), ground, camera_frame, (height, roll, truth)


def point(kind, rng):
    common, pixels, ground, seen, _ = scene(kind, rng, 1)
    inputs = ground_plane.Inputs(**common, foot=Observation(pixels, 0.7))
    return inputs, np.array([math.hypot(*ground[0, :2]), np.linalg.norm(seen[0]), seen[0, 2]])


def length(kind, rng):
    common, pixels, ground, _, _ = scene(kind, rng, 2)
    return ground_length.Inputs(**common, ends=Observation(pixels, 0.7)), np.array(
        [np.linalg.norm(ground[1] - ground[0])]
    )


def speed(kind, rng):
    common, pixels, ground, _, _ = scene(kind, rng, 2)
    time, readout = rng.uniform(0.5, 2.0), rng.uniform(-0.06, 0.06)
    way = float(np.linalg.norm(ground[1] - ground[0]))
    passed = time + readout * (pixels[1, 1] - pixels[0, 1]) / HEIGHT
    inputs = ground_speed.Inputs(**common, ends=Observation(pixels, 0.7), time=about(time, 0.01 * time, "s", rng))
    return inputs, np.array([way / passed, way])


def horizon(kind, rng):
    """The same point, with the vanishing line of the ground's horizon marked instead of a stated pitch."""
    common, _, _, _, (_, roll, truth) = scene(kind, rng, 1)
    del common["pitch"], common["roll"]
    pitch = math.radians(rng.uniform(-4, 2))
    axes = camera_from_level(pitch, roll)
    height = rng.uniform(*GEOMETRY[kind][0])
    far = height * rng.uniform(*GEOMETRY[kind][2])
    foot = np.array([0.05 * far, far, 0.0])
    slope, cross = rng.normal(0, GEOMETRY[kind][4], 2)
    foot[2] = foot[0] * math.tan(cross) + foot[1] * math.tan(slope)
    seen = (foot - [0, 0, height]) @ axes.T
    line = np.array([[-0.4, 1, 0], [0.4, 1, 0], [0.1, 1, 0]]) @ axes.T
    marked = truth.project(line) + rng.normal(0, 1.5, (3, 2))
    inputs = ground_plane.Inputs(
        **{**common, "height": about(height, 0.01 * height, "m", rng)}, horizon=Observation(marked, 1.5),
        dip=Quantity.exact(0.0, "1"), refraction=Quantity.exact(0.9999, "1"),
        foot=Observation(truth.project(seen[None]) + rng.normal(0, 0.7, (1, 2)), 0.7),
    )  # fmt: skip
    return inputs, np.array([math.hypot(*foot[:2]), np.linalg.norm(seen), seen[2]])


def sampling(kind, rng):
    """Ground per pixel at the picture's middle of a camera that looks down on level ground."""
    common, _, _, _, (height, roll, truth) = scene(kind, rng, 1)
    pitch = -math.pi / 2
    common |= {"pitch": about(pitch, math.radians(0.5), "rad", rng), "roll": about(roll, math.radians(0.5), "rad", rng)}
    common |= {"slope": Quantity.exact(0.0, "rad"), "cross_slope": Quantity.exact(0.0, "rad")}
    middle = np.array([[truth.cx_px, truth.cy_px]])
    exact = height / truth.f_px
    return ground_sampling.Inputs(**common, place=Observation(middle, 0.0)), np.array([exact, exact])


def surveyed(kind, rng):
    """Points surveyed to 2 cm, in a picture of a camera of which little is known."""
    count, known = {"good": (14, 0.01), "bad": (8, 0.3)}[kind]
    pitch, roll = math.radians(rng.uniform(-22, -15)), math.radians(rng.normal(0, 2))
    apart = rng.standard_normal()
    while known * apart < -0.9:  # no focal length is below 0
        apart = rng.standard_normal()
    vector = np.array([1500.0 * (1 + known * apart), 1.0, 799.5 + rng.normal(0, 5), 599.5 + rng.normal(0, 5)])
    bend = rng.normal(0, 0.02)
    true = Camera(WIDTH, HEIGHT, vector[0], vector[2], vector[3], 1.0, "brown_conrady", np.array([bend, 0, 0, 0, 0]))
    cov = np.diag([(known * 1500) ** 2, 0, 25.0, 25.0, 0.02**2, 0, 0, 0, 0])
    told = Camera(WIDTH, HEIGHT, 1500.0, 799.5, 599.5, 1.0, "brown_conrady", np.zeros(5), cov)
    ground = np.zeros((0, 3))
    axes, place = camera_from_level(pitch, roll), np.array([0, 0, 10.0])
    while len(ground) < count + 1:  # only what is in the picture
        more = np.stack([rng.uniform(-12, 12, 40), rng.uniform(14, 60, 40), rng.uniform(0, 3, 40)], -1)
        seen = true.project((more - place) @ axes.T)
        ground = np.concatenate([ground, more[np.all((seen > 5) & (seen < [WIDTH - 5, HEIGHT - 5]), axis=1)]])
    ground = ground[: count + 1]
    pixels = true.project((ground - place) @ axes.T) + rng.normal(0, 0.7, (count + 1, 2))
    survey = Target("survey", ground[1:] + rng.normal(0, 0.02, (count, 3)) + [5e5, 6e6, 400], sigma_m=0.02)
    elevation = about(ground[0, 2] + 400, 0.05, "m", rng)
    inputs = surveyed_ground.Inputs(camera=told, control=Observation(pixels[1:], 0.7), survey=survey,
                                    foot=Observation(pixels[:1], 0.7), elevation=elevation)  # fmt: skip
    away = ground[0] - place
    return inputs, np.array(
        [math.hypot(*away[:2]), np.linalg.norm(away), (away @ axes.T)[2], ground[0, 0] + 5e5, ground[0, 1] + 6e6]
    )


MADE = {
    **{f"point {kind}": (ground_plane.METHOD, point, kind) for kind in GEOMETRY},
    **{f"horizon {kind}": (ground_plane.METHOD, horizon, kind) for kind in ("typical", "bad")},
    **{f"length {kind}": (ground_length.METHOD, length, kind) for kind in ("good", "typical", "nadir")},
    "speed good": (ground_speed.METHOD, speed, "good"),
    "sampling nadir": (ground_sampling.METHOD, sampling, "nadir"),
    **{f"surveyed {kind}": (surveyed_ground.METHOD, surveyed, kind) for kind in ("good", "bad")},
}


def score(name, scenes):
    """(scenes, outputs) whether the interval holds the truth, whether the truth lies below, and u over the value."""
    method, make, kind = MADE[name]
    rng = np.random.default_rng(sum(map(ord, name)))
    rows = []
    for i in range(scenes):
        inputs, true = make(kind, rng)
        found = propagate.measure(method, inputs, draws=4_000, seed=i)[: len(true)]
        low = np.array([m.low for m in found])
        high = np.array([math.inf if m.high is None else m.high for m in found])
        rows.append(((low <= true) & (true <= high), true < low, (high - low) / abs(true)))
    return tuple(np.array(column) for column in zip(*rows, strict=True))


@pytest.mark.parametrize("name", ["point good", "point typical", "point bad"])
def test_intervals_hold_the_truth_as_often_as_they_say(name):
    check(*score(name, SCENES)[:2])


@pytest.mark.parametrize(
    "name",
    ["point far", "point nadir", "horizon bad", "length typical", "length nadir", "speed good", "sampling nadir"],
)
def test_intervals_of_other_views_and_lengths(name):
    check(*score(name, FEWER)[:2])


@pytest.mark.opencv
@pytest.mark.parametrize("name", [n for n in MADE if n.startswith("surveyed")])
def test_intervals_beside_surveyed_points(name):
    check(*score(name, FEWEST)[:2])


def check(hit, below):
    share, low = hit.mean(axis=0), below.mean(axis=0)
    least, most = BOUNDS[len(hit)]
    assert np.all((share >= least) & (share <= most)), f"{share} of the intervals hold the truth"
    side = MOST_ON_ONE_SIDE[len(hit)]
    assert np.all(low <= side) and np.all(1 - share - low <= side), f"misses: {low} below, {1 - share - low} above"


def test_the_check_sees_intervals_that_are_too_narrow_or_too_wide():
    rng = np.random.default_rng(0)
    error = rng.normal(0, 1, (SCENES, 2))
    check(abs(error) < 1.96, error < -1.96)
    for half in (1.6, 2.6):
        with pytest.raises(AssertionError):
            check(abs(error) < half, error < -half)
