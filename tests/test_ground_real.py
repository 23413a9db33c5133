"""Real pictures with surveyed, scanned or stated ground: how far off, and whether the interval holds the truth.

`benchmarks/ground.py` prints what these find. Nothing of the package was tuned to them.
"""

import json
import math

import numpy as np
import pytest

from subtense import Photo, propagate
from subtense.camera import Camera
from subtense.methods import ground_length, ground_plane, surveyed_ground
from subtense.observation import Observation
from subtense.quantity import Quantity
from subtense.target import Target
from subtense.workflow.ground import ground_document

pytestmark = pytest.mark.opencv

JUNCAL_HEIGHT_M, JUNCAL_U_M = 648.07, 0.58
"""Mean and standard deviation of the surveyed heights: what is known of a point's height where it was not surveyed."""
CLICK_PX, SURVEY_M = 2.0, 0.02


def juncal(folder, half, known):
    """(value, u, low, high, true) of the ranges of every other point, the camera placed and calibrated by the rest.

    Of the camera only its picture's size is known: f = 1600 px to 40 %, any distortion up to k1 = 0.3 (1s).
    """
    points = json.loads((folder / "ground_plane/river_juncal/truth.json").read_text())["points"]
    places, pixels = (np.array([p[name] for p in points]) for name in ("XYZ", "px"))
    cov = np.zeros((9, 9))
    np.fill_diagonal(cov, [640.0**2, 0, 20.0**2, 20.0**2, 0.3**2, 0, 0, 0, 0])
    camera = Camera(1920, 1080, 1600.0, 959.5, 539.5, lens="brown_conrady", distortion=np.zeros(5), cov=cov)
    control = np.arange(len(points)) % 2 == half
    survey = Target("survey", places[control], sigma_m=SURVEY_M)
    seen = Observation(pixels[control], CLICK_PX)
    place = None
    rows = []
    for pixel, true in zip(pixels[~control], places[~control], strict=True):
        height = Quantity.normal(true[2], SURVEY_M, "m") if known else Quantity.normal(JUNCAL_HEIGHT_M, JUNCAL_U_M, "m")
        inputs = surveyed_ground.Inputs(
            camera=camera, control=seen, survey=survey, foot=Observation(pixel[None], CLICK_PX), elevation=height
        )
        begin = surveyed_ground.start(inputs)
        assert begin is not None
        place = begin.pose.inverse().translation_m + begin.origin_m
        m = propagate.measure(surveyed_ground.METHOD, inputs)[1]
        rows.append((m.value, m.u, m.low, m.high, float(np.linalg.norm(true - place))))
    return np.array(rows)


@pytest.mark.parametrize("half", [0, 1])
def test_juncal_with_surveyed_heights(shared_data, half):
    value, _, low, high, true = juncal(shared_data, half, known=True).T
    assert np.median(abs(value / true - 1)) < 0.01
    assert np.all((low <= true) & (true <= high)), "at most one of 23 may miss by chance"


def test_juncal_with_unknown_heights(shared_data):
    rows = np.concatenate([juncal(shared_data, half, known=False) for half in (0, 1)])
    value, u, low, high, true = rows.T
    assert np.sum((low <= true) & (true <= high)) >= 20  # of 23; fewer by chance in 1 of 40
    assert 0.7 < np.sqrt(np.mean(((value - true) / u) ** 2)) < 1.4
    assert np.median(u / value) < 0.07


def town_centre(folder):
    """The camera of the calibration, its height, pitch and roll, and the homography from pixels to metres on the ground."""
    data = folder / "ground_plane/town_centre"
    lines = (line.split("=") for line in (data / "TownCentre-calibration.ci").read_text().splitlines() if "=" in line)
    told = {name.strip(): float(value) for name, value in lines}
    x, y, z, w = (told[f"Rotation{axis}"] for axis in "XYZW")
    rotation = np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                         [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                         [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])  # fmt: skip
    place = -rotation.T @ [told[f"Translation{axis}"] for axis in "XYZ"]
    up = rotation[:, 2]
    pitch, roll = math.asin(up[2]), math.atan2(-up[0], -up[1])
    camera = Camera(1920, 1080, told["FocalLengthX"], told["PrincipalPointX"], told["PrincipalPointY"])
    return camera, place, pitch, roll, np.loadtxt(data / "oxford_town_matrix_cam2world.txt")


def test_town_centre(shared_data):
    """Distances and lengths on the square, by height, pitch and roll, against the published homography."""
    camera, place, pitch, roll, homography = town_centre(shared_data)
    pixels = np.array([[960, 540], [300, 900], [1500, 900], [1500, 300], [600, 300.0]])
    there = np.column_stack([pixels, np.ones(5)]) @ homography.T
    there = there[:, :2] / there[:, 2:]
    common = {
        "camera": camera, "height": Quantity.exact(place[2], "m"), "pitch": Quantity.exact(pitch, "rad"),
        "roll": Quantity.exact(roll, "rad"), "slope": Quantity.exact(0.0, "rad"), "cross_slope": Quantity.exact(0.0, "rad"),
    }  # fmt: skip
    for pixel, ground in zip(pixels, there, strict=True):
        m = propagate.measure(ground_plane.METHOD, ground_plane.Inputs(**common, foot=Observation(pixel[None], 0.0)))[0]
        assert m.value == pytest.approx(np.linalg.norm(ground - place[:2]), rel=1e-4)
    for i, j in ((0, 1), (1, 2), (3, 4)):
        m = propagate.measure(
            ground_length.METHOD, ground_length.Inputs(**common, ends=Observation(pixels[[i, j]], 0.0))
        )[0]
        assert m.value == pytest.approx(np.linalg.norm(there[i] - there[j]), rel=1e-4)


def kitti(folder, step=150):
    """(value, low, high, true) of ground distances to lidar points of the road; nothing is known of the car's pitch but that it is level
    to half a degree, and of the road but that it is level to 1 %."""
    data = folder / "ground_plane/kitti_lidar"
    lines = (line.partition(":") for line in (data / "000008_calib.txt").read_text().splitlines() if ":" in line)
    calib = {name: np.array(values.split(), float) for name, _, values in lines}
    projection, rect, velo = (
        calib["P2"].reshape(3, 4),
        calib["R0_rect"].reshape(3, 3),
        calib["Tr_velo_to_cam"].reshape(3, 4),
    )
    scan = np.fromfile(data / "000008_reduced.bin", np.float32).reshape(-1, 4)[:, :3].astype(float)
    points = (scan @ velo[:, :3].T + velo[:, 3]) @ rect.T
    points = points + np.array([projection[0, 3] / projection[0, 0], 0, 0])  # from the first camera to the second
    # what is on the road: within the lane, near the height the data's authors tell of their camera
    road = (
        (abs(points[:, 0]) < 4)
        & (points[:, 2] > 6)
        & (points[:, 2] < 40)
        & (abs(points[:, 1] - 1.65) < 0.012 * points[:, 2] + 0.1)
    )
    points = points[road][::step]
    f = projection[0, 0]
    camera = Camera(1242, 375, f, projection[0, 2], projection[1, 2], cov=np.diag([(0.002 * f) ** 2, 0, 1.0, 1.0]))
    level = {name: Quantity.normal(0.0, math.radians(0.5), "rad") for name in ("pitch", "roll")}
    rows = []
    for point in points:
        foot = Observation(camera.project(point[None]), 0.5)
        m = propagate.measure(
            ground_plane.METHOD,
            ground_plane.Inputs(camera=camera, height=Quantity.normal(1.65, 0.03, "m"), **level, foot=foot),
            draws=10_000,
        )[0]
        rows.append((m.value, m.low, math.inf if m.high is None else m.high, math.hypot(point[0], point[2])))
    return np.array(rows)


def test_kitti_road_by_lidar(shared_data):
    value, low, high, true = kitti(shared_data).T
    assert len(true) > 20 and np.mean((low <= true) & (true <= high)) > 0.9
    near = true < 15
    assert np.median(abs(value[near] / true[near] - 1)) < 0.05


def drone(folder):
    """The way between two pictures straight down: where the middle of the first is in the second, on the ground; m, and by GPS."""
    import cv2

    pictures = [Photo.load(folder / f"ground_plane/drone_nadir/DJI_00{n}.JPG") for n in (24, 25)]
    small = [
        cv2.resize(cv2.cvtColor(p.pixels, cv2.COLOR_RGB2GRAY), None, fx=0.25, fy=0.25, interpolation=cv2.INTER_AREA)
        for p in pictures
    ]
    finder = cv2.ORB_create(3000)
    (first, one), (second, other) = (finder.detectAndCompute(image, None) for image in small)
    pairs = cv2.BFMatcher(cv2.NORM_HAMMING, crossCheck=True).match(one, other)
    start = np.array([first[p.queryIdx].pt for p in pairs])
    end = np.array([second[p.trainIdx].pt for p in pairs])
    cv2.setRNGSeed(0)
    turn, _ = cv2.estimateAffinePartial2D(end, start, ransacReprojThreshold=2.0)
    middle = np.array([499.5, 280.875])
    there = (turn[:, :2] @ middle + turn[:, 2] + 0.5) * 4 - 0.5
    text = f"1999.5,1124.5;{there[0]:.1f},{there[1]:.1f} ± 10px"
    return ground_document(pictures[0], lengths=[text])


GPS_M = 14.1
"""Between the two pictures by their positions, to about 1 m (1s)."""


def test_drone_straight_down(shared_data):
    found = drone(shared_data)
    m = found.measurements[0]
    assert "height_above_takeoff" in {n.code for n in m.notes}
    # both pictures hang level to half a degree, which moves the way by 0.35 m each
    assert abs(m.value - GPS_M) < 1.96 * math.hypot(m.u, 1.0, 0.5)
