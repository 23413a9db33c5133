"""How often the 95 % interval of heights, walls, and cameras from lines holds the truth; bounds as in test_plane_coverage."""

import math
from dataclasses import replace

import numpy as np
import pytest

from subtense import propagate
from subtense.camera import Camera
from subtense.horizon import level_from_angles
from subtense.line_camera import camera_from_lines
from subtense.methods import height, wall
from subtense.observation import Observation
from subtense.quantity import Quantity

SCENES, FEWER = 1000, 150
BOUNDS = {SCENES: (0.926, 0.971), FEWER: (0.88, 1.0)}
WIDTH, HEIGHT = 1600, 1200
CLICK_PX = 0.7
U_CAMERA = np.array([15.0, 0.0, 8.0, 8.0, 0.01, 0, 0, 0, 0])
FRAME = Observation(np.array([[-0.5, -0.5], [WIDTH - 0.5, HEIGHT - 0.5]]), 0.0, label="picture")
KINDS = ("good", "typical", "bad")
PITCH = {"good": (-25, -12), "typical": (-15, -5), "bad": (-6, -2)}
LINES = {"good": 6, "typical": 3, "bad": 2}


class Room:
    """A camera over a level floor; everything it draws is clicked with noise."""

    def __init__(self, kind, rng):
        self.rng = rng
        truth = np.array([1500.0, 1.0, 805.0, 592.0, rng.uniform(-0.05, 0.02), 0.01, 1e-4, -1e-4, 0.0])
        told = truth + U_CAMERA * rng.standard_normal(9)
        self.truth, self.told = self.camera(truth), self.camera(told, np.diag(U_CAMERA**2))
        self.over = rng.uniform(1.3, 2.5)
        level = level_from_angles(np.radians(rng.uniform(*PITCH[kind])), np.radians(rng.uniform(-4, 4)))
        self.turn = np.stack([level.right, level.ahead, level.up], -1)

    @staticmethod
    def camera(v, cov=None):
        return Camera(WIDTH, HEIGHT, v[0], v[2], v[3], v[1], "brown_conrady", v[4:], cov)

    def pixels(self, points):
        return self.truth.project((np.asarray(points) - [0, 0, self.over]) @ self.turn.T)

    def inside(self, points):
        pixels = self.pixels(points)
        return bool(np.all((pixels > 0) & (pixels < [WIDTH, HEIGHT])) and np.isfinite(pixels).all())

    def seen(self, points, label=""):
        pixels = self.pixels(points)
        return Observation(pixels + self.rng.normal(0, CLICK_PX, pixels.shape), CLICK_PX, label=label)

    def upright(self, low, high, near=(3.5, 8.0)):
        """Base and top of something upright in the picture."""
        for _ in range(300):
            ahead = self.rng.uniform(*near)
            base = np.array([self.rng.uniform(-0.45, 0.45) * ahead, ahead, 0.0])
            ends = np.stack([base, base + np.array([0, 0, self.rng.uniform(low, high)])])
            if self.inside(ends):
                return ends
        return None

    def posts(self, count):
        """Ends of upright lines all over the picture."""
        lines = [self.upright(1.0, 2.5, (4, 9)) for _ in range(count)]
        return None if any(line is None for line in lines) else np.concatenate(lines)

    def level_lines(self, angle, count):
        """Ends of level lines of one direction at different heights."""
        way, ends = np.array([np.sin(angle), np.cos(angle), 0]), []
        for _ in range(3000):
            ahead = self.rng.uniform(4, 9)
            middle = np.array([self.rng.uniform(-0.5, 0.5) * ahead, ahead, self.rng.uniform(0, 2.5)])
            half = self.rng.uniform(0.7, 2.0) * way
            if self.inside([middle - half, middle + half]):
                ends += [middle - half, middle + half]
            if len(ends) == 2 * count:
                return np.array(ends)
        return None


def room(kind, rng, *wanted):
    """A room that has all that is wanted, each a function of the room that gives points or None."""
    while True:
        one = Room(kind, rng)
        points = [make(one) for make in wanted]
        if all(p is not None for p in points):
            return one, points


def uprights(kind):
    def make(one):
        lines = [one.upright(1.0, 2.5) for _ in range(LINES[kind])]
        if any(line is None for line in lines):
            return None
        x = one.pixels([line[0] for line in lines])[:, 0]
        return np.concatenate(lines) if np.ptp(x) > 300 else None

    return make


def stated_height(rng, true):
    return Quantity.normal(true + 0.005 * rng.standard_normal(), 0.005, "m")


def height_scene(kind, rng):
    one, (lines, known, wanted) = room(
        kind, rng, uprights(kind), lambda r: r.upright(1.5, 2.2), lambda r: r.upright(0.8, 2.2)
    )
    inputs = height.Inputs(
        one.seen(lines), one.seen(known), one.seen(wanted), stated_height(rng, known[1, 2]), camera=one.told
    )
    return inputs, np.array([wanted[1, 2], one.over])


def level_lines_scene(kind, rng):
    """Without a camera, through a lens without distortion."""
    angle = rng.uniform(0.4, 1.1)
    one, (lines, known, wanted, along, across) = room(
        kind, rng, uprights(kind), lambda r: r.upright(1.5, 2.2), lambda r: r.upright(0.8, 2.2),
        lambda r: r.level_lines(angle, LINES[kind] + 1), lambda r: r.level_lines(angle - math.pi / 2, LINES[kind] + 1),
    )  # fmt: skip
    one.truth = Room.camera(np.array([1500.0, 1.0, 805.0, 592.0, 0, 0, 0, 0, 0]))
    inputs = height.Inputs(one.seen(lines), one.seen(known), one.seen(wanted), stated_height(rng, known[1, 2]),
                           parallels=one.seen(along), others=one.seen(across), frame=FRAME,
                           distortion=Quantity.exact(0.0, "1"))  # fmt: skip
    return inputs, np.array([wanted[1, 2], one.over])


def wall_scene(kind, rng):
    def front(one):
        slant = rng.uniform(-0.8, 0.8)
        way = np.array([np.cos(slant), np.sin(slant), 0])
        start = np.array([rng.uniform(-2, -0.5), rng.uniform(4.5, 7), 0])
        foot = np.stack([start, start + rng.uniform(1.5, 3.0) * way])
        ends = (
            foot[0]
            + np.outer(rng.uniform(0.1, 1.0, 2) * [1, 2], way)
            + [[0, 0, rng.uniform(0.3, 1.0)], [0, 0, rng.uniform(1.0, 2.0)]]
        )
        fine = one.inside(np.concatenate([foot, ends])) and np.linalg.norm(ends[1] - ends[0]) > 0.4
        return np.concatenate([foot, ends]) if fine else None

    one, (lines, known, points) = room(kind, rng, uprights(kind), lambda r: r.upright(1.5, 2.2), front)
    inputs = wall.Inputs(one.told, one.seen(lines), one.seen(known), stated_height(rng, known[1, 2]), one.seen(points[:2]),
                         one.seen(points[2:]))  # fmt: skip
    return inputs, np.array([np.linalg.norm(points[3] - points[2])])


SCENARIOS = {
    "height": (height.METHOD, height_scene), "height by level lines": (height.METHOD, level_lines_scene),
    "wall": (replace(wall.METHOD, outputs=wall.METHOD.outputs[:1]), wall_scene),
}  # fmt: skip
PLANES = KINDS  # the name under which benchmarks look for kinds


def score(name, kind, scenes, seed=0, draws=20_000):
    """(scenes, outputs) whether the interval holds the truth, whether the truth lies below it, and z values."""
    method, make = SCENARIOS[name]
    rng = np.random.default_rng([seed, *map(ord, name + kind)])
    hit, below, z = [], [], []
    for i in range(scenes):
        inputs, true = make(kind, rng)
        found = propagate.measure(method, inputs, draws=draws, seed=i)
        ends = [(-np.inf if m.low is None else m.low, np.inf if m.high is None else m.high) for m in found]
        hit.append([low <= t <= high for (low, high), t in zip(ends, true, strict=True)])
        below.append([t < low for (low, _), t in zip(ends, true, strict=True)])
        z.append([(m.value - t) / m.u if m.u else 0.0 for m, t in zip(found, true, strict=True)])
    return np.array(hit), np.array(below), np.array(z)


def lines_scene(rng, sets=(0, 1, 2), count=6):
    """Lines at right angles, seen by a camera that is off by what is assumed of unknown ones; and its truth."""
    while True:
        middle = (np.array([WIDTH, HEIGHT]) - 1) / 2 + rng.normal(0, 0.01 * WIDTH, 2)
        one = Room("typical", rng)
        one.truth = Camera(WIDTH, HEIGHT, rng.uniform(1200, 2500), *middle, lens="brown_conrady",
                           distortion=np.array([rng.normal(0, 0.02), 0, 0, 0, 0]))  # fmt: skip
        pitch, roll = np.radians(rng.uniform(-15, 15)), np.radians(rng.uniform(-5, 5))
        level = level_from_angles(pitch, roll)
        one.turn = np.stack([level.right, level.ahead, level.up], -1)
        yaw = rng.uniform(0.45, 1.1)
        lines = (one.level_lines(yaw, count), one.level_lines(yaw - math.pi / 2, count), one.posts(count))
        if all(lines[k] is not None for k in sets):
            return {k: one.seen(lines[k]) for k in sets}, one.truth.f_px, np.array([pitch, roll])


def line_cameras(scenes, sets, seed=0):
    """(n, 3) z values of the logarithm of the focal length, pitch and roll, and how many scenes were refused."""
    rng, z, refused = np.random.default_rng([seed, *sets]), [], 0
    for _ in range(scenes):
        given, f, angles = lines_scene(rng, sets)
        found = camera_from_lines(WIDTH, HEIGHT, given.get(2), given.get(0), given.get(1), k1_u=0.02)
        if isinstance(found, str):
            refused += 1
            continue
        u = np.sqrt(np.diag(found.level_cov))
        made = float(found.camera.f_px)
        z.append([(made - f) / found.camera.u_f_px, *((np.array([found.pitch_rad, found.roll_rad]) - angles) / u)])
    return np.array(z), refused


def check(hit, below):
    share = hit.mean(axis=0)
    least, most = BOUNDS[len(hit)]
    assert np.all((share >= least) & (share <= most)), f"{share} of the intervals hold the truth"
    assert np.all(below.mean(axis=0) < 0.8 * (1 - share) + 0.01), "nearly all misses lie on one side"


@pytest.mark.parametrize("name", SCENARIOS)
def test_heights_and_walls(name):
    hit, below, _ = score(name, "typical", FEWER, draws=4_000)
    check(hit, below)


@pytest.mark.parametrize("sets", [(0, 1, 2), (0, 1)])
def test_cameras_from_lines(sets):
    z, refused = line_cameras(25, sets)
    assert refused < 4
    assert np.all(np.mean(abs(z) < 1.96, axis=0) > 0.8) and np.abs(z).max() < 5
    assert np.all(z.std(axis=0) > 0.6), "u is padded"
