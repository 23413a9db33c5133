"""How often the 95 % interval of the methods of a plane holds the truth, and whether gross clicks are flagged.

1,000 scenes a geometry must give 92.6 to 97.1 %, 150 must give 88 % or more (binomial, 0.1 % two-sided), with the misses on both
sides. benchmarks/planes.py has 5,000 scenes of all.
"""

from dataclasses import replace

import numpy as np
import pytest

from subtense import propagate
from subtense.camera import Camera
from subtense.geometry import Pose, rotation_from_vector
from subtense.methods import plane, plane_distance
from subtense.observation import Observation
from subtense.quantity import Quantity
from subtense.target import Target

SCENES, FEWER = 1000, 150
BOUNDS = {SCENES: (0.926, 0.971), FEWER: (0.88, 1.0)}
WIDTH, HEIGHT = 1600, 1200
CLICK_PX = 0.7
U_CAMERA = np.array([15.0, 0.0, 8.0, 8.0, 0.01, 0, 0, 0, 0])
FRAME = Observation(np.array([[-0.5, -0.5], [WIDTH - 0.5, HEIGHT - 0.5]]), 0.0, label="picture")

# how much the plane is tilted (degrees), depth in sizes of the reference, how far out the wanted points lie, reference points
PLANES = {
    "good": ((20, 50), (2.0, 3.0), 0.6, 9),
    "typical": ((30, 60), (2.5, 5.0), 1.0, 4),
    "bad": ((65, 75), (6.0, 9.0), 2.5, 4),
}


def cameras(rng):
    """The true camera and the one the tool is told, which is off by its own covariance."""
    truth = np.array([1500.0, 1.0, 805.0, 592.0, rng.uniform(-0.05, 0.02), 0.01, 1e-4, -1e-4, 0.0])
    told = truth + U_CAMERA * rng.standard_normal(9)

    def make(v, cov=None):
        return Camera(WIDTH, HEIGHT, v[0], v[2], v[3], v[1], "brown_conrady", v[4:], cov)

    return make(truth), make(told, np.diag(U_CAMERA**2))


def reference(count, rng):
    """(count, 3) points of a reference about 1 m wide: its corners, and more inside."""
    w, h = rng.uniform(0.4, 0.6), rng.uniform(0.3, 0.5)
    corners = np.array([[-w, -h], [w, -h], [w, h], [-w, h]])
    more = rng.uniform(-1, 1, (count - 4, 2)) * [w, h]
    return np.column_stack([np.concatenate([corners, more]), np.zeros(count)])


def placed(kind, rng, reach, wanted):
    """The true camera, the told one, the pose of a plane that has all in the picture, its reference points, and wanted ones."""
    tilts, depths, _, count = PLANES[kind]
    while True:
        truth, told = cameras(rng)
        known = reference(count, rng)
        around = rng.uniform(0, 2 * np.pi)
        lean = rotation_from_vector(np.radians(rng.uniform(*tilts)) * np.array([np.cos(around), np.sin(around), 0]))
        turn = lean @ rotation_from_vector(np.array([0, 0, rng.uniform(-3, 3)]))
        place = rng.uniform(*depths) * np.array([rng.uniform(-0.15, 0.15), rng.uniform(-0.1, 0.1), 1])
        points = np.column_stack([rng.uniform(-reach, reach, (wanted, 2)), np.zeros(wanted)])
        pose = Pose(turn, place)
        pixels = truth.project(pose.apply(np.concatenate([known, points])))
        inside = np.all((pixels > 0) & (pixels < [WIDTH, HEIGHT])) and np.isfinite(pixels).all()
        apart = np.min(np.linalg.norm(np.diff(points[:, :2], axis=0), axis=-1), initial=np.inf) > 0.3
        if inside and apart:
            return truth, told, pose, known, points, pixels


def in_plane(kind, rng, method, wanted, *, camera=True, gross_px=0.0):
    """Inputs as a tool would have them, and the places of the wanted points."""
    truth, told, _, known, points, pixels = placed(kind, rng, PLANES[kind][2], wanted)
    if not camera:  # a lens that distorts by what is assumed of unknown ones, as it is modelled there
        share, middle = 0.02 * rng.standard_normal(), (np.array([WIDTH, HEIGHT]) - 1) / 2
        pixels = _distorted(truth, pixels, share, middle)
    seen = pixels + rng.normal(0, CLICK_PX, pixels.shape)
    n = len(known)
    if gross_px:
        around = rng.uniform(0, 2 * np.pi)
        seen[rng.integers(n)] += gross_px * np.array([np.cos(around), np.sin(around)])
    places = known + rng.normal(0, 0.001, known.shape) * [1, 1, 0]
    scale = 1 + 0.002 * rng.standard_normal()
    target = Target("reference", places * scale, 0.002, 0.001)
    inputs = method.inputs(Observation(seen[:n], CLICK_PX), target, Observation(seen[n:], CLICK_PX), told if camera else None,
                           frame=FRAME)  # fmt: skip
    return inputs, points[:, :2]


def _distorted(truth, pixels, share, middle):
    """Pixels that the inverse model q + share q r^2 takes to those without distortion."""
    straight = np.stack(truth.slopes(pixels), -1) * 1500 + [805, 592]
    seen = straight.copy()
    for _ in range(30):
        away = (seen - middle) / (np.hypot(WIDTH, HEIGHT) / 2)
        seen = straight - share * (seen - middle) * np.sum(away**2, -1, keepdims=True)
    return seen


def length_scene(kind, rng):
    inputs, p = in_plane(kind, rng, plane.METHOD, 3)
    return inputs, np.array([np.linalg.norm(np.diff(p, axis=0), axis=-1).sum()])


def without_camera_scene(kind, rng):
    inputs, p = in_plane(kind, rng, plane.METHOD, 2, camera=False)
    return inputs, np.array([np.linalg.norm(p[1] - p[0])])


def area_scene(kind, rng):
    while True:
        inputs, p = in_plane(kind, rng, plane.AREA, 3)
        area = abs(np.linalg.det(p[1:] - p[0])) / 2
        if area > 0.05:
            return inputs, np.array([area])


def angle_scene(kind, rng):
    while True:
        inputs, p = in_plane(kind, rng, plane.ANGLE, 3)
        a, b = p[0] - p[1], p[2] - p[1]
        angle = np.arccos(a @ b / np.linalg.norm(a) / np.linalg.norm(b))
        if 0.3 < angle < 2.8:
            return inputs, np.array([angle])


def off_plane_scene(kind, rng):
    """A length on a box of which it is only known about how high it is."""
    truth, told, pose, known, points, _ = placed(kind, rng, 0.6, 2)
    side = -np.sign(pose.rotation[:, 2] @ pose.translation_m)  # towards the camera, along the plane's normal
    height = rng.uniform(0.02, 0.2)
    points = points + np.array([0, 0, side * height])
    pixels = truth.project(pose.apply(np.concatenate([known, points]))) + rng.normal(0, CLICK_PX, (len(known) + 2, 2))
    n = len(known)
    stated = Quantity.normal(height + 0.02 * rng.standard_normal(), 0.02, "m")
    target = Target("reference", known * (1 + 0.002 * rng.standard_normal()), 0.002)
    inputs = plane.Inputs(Observation(pixels[:n], CLICK_PX), target, Observation(pixels[n:], CLICK_PX), told, stated)
    return inputs, np.array([np.linalg.norm(points[1] - points[0])])


def distance_scene(kind, rng):
    _truth, told, pose, known, points, pixels = placed(kind, rng, 1.5, 1)
    seen = pixels + rng.normal(0, CLICK_PX, pixels.shape)
    n = len(known)
    there = pose.apply(points)[0]
    target = Target("reference", known * (1 + 0.002 * rng.standard_normal()), 0.002)
    inputs = plane_distance.Inputs(told, Observation(seen[:n], CLICK_PX), target, Observation(seen[n:], CLICK_PX))
    return inputs, np.array([np.linalg.norm(there), there[2]])


SCENARIOS = {
    "length": (plane.METHOD, length_scene), "length without camera": (plane.METHOD, without_camera_scene),
    "area": (replace(plane.AREA, outputs=plane.AREA.outputs[:1]), area_scene), "angle": (plane.ANGLE, angle_scene),
    "off plane": (plane.METHOD, off_plane_scene),
    "distance": (replace(plane_distance.METHOD, outputs=plane_distance.METHOD.outputs[:2]), distance_scene),
}  # fmt: skip


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


def check(hit, below):
    share = hit.mean(axis=0)
    least, most = BOUNDS[len(hit)]
    assert np.all((share >= least) & (share <= most)), f"{share} of the intervals hold the truth"
    assert np.all(below.mean(axis=0) < 0.8 * (1 - share) + 0.01), "nearly all misses lie on one side"


@pytest.mark.parametrize(("kind", "scenes"), [("good", FEWER), ("typical", SCENES), ("bad", FEWER)])
def test_length(kind, scenes):
    hit, below, z = score("length", kind, scenes, draws=4_000)
    check(hit, below)
    assert np.abs(z).max() < 6


@pytest.mark.parametrize("name", [name for name in SCENARIOS if name != "length"])
def test_others(name):
    hit, below, _ = score(name, "typical", FEWER, draws=4_000)
    check(hit, below)


@pytest.mark.parametrize("gross_px", [10, 30, 100])
def test_a_gross_click_among_nine_reference_points_is_flagged_or_does_no_harm(gross_px):
    rng = np.random.default_rng(gross_px)
    fine = []
    for i in range(60):
        inputs, p = in_plane("good", rng, plane.METHOD, 2, gross_px=gross_px)
        [m] = propagate.measure(plane.METHOD, inputs, draws=20_000, seed=i)
        fine.append("points_misfit" in {n.code for n in m.notes} or m.low <= np.linalg.norm(p[1] - p[0]) <= m.high)
    assert np.mean(fine) >= 0.95


def test_right_clicks_are_not_called_wrong():
    rng = np.random.default_rng(5)
    notes = [propagate.measure(plane.METHOD, in_plane("good", rng, plane.METHOD, 2)[0])[0].notes for _ in range(150)]
    assert sum("points_misfit" in {n.code for n in one} for one in notes) <= 2  # three in a thousand are expected
