import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from subtense.camera import Camera
from subtense.errors import InputError

BROWN = {
    5: [-0.28, 0.07, 1e-3, -5e-4, 0.01],
    8: [0.03, -0.05, 1e-3, -5e-4, 0.02, 0.01, 0.02, -0.01],
    12: [-0.1, 0.02, 1e-3, -5e-4, 0, 0.01, 0.02, -0.01, 1e-3, -2e-3, 5e-4, 1e-3],
    14: [-0.1, 0.02, 1e-3, -5e-4, 0, 0.01, 0.02, -0.01, 1e-3, -2e-3, 5e-4, 1e-3, 0.02, -0.03],
}
FISHEYE = [0.05, -0.02, 0.003, -0.001]


def camera(lens="brown_conrady", k=None, **more):
    return Camera(
        1600, 1200, more.pop("f_px", 1300.0), 805.0, 610.0, 1.01, lens, None if k is None else np.array(k), **more
    )


def scene(n=400, seed=0, wide=0.6):
    rng = np.random.default_rng(seed)
    direction = np.column_stack([rng.uniform(-wide, wide, n), rng.uniform(-0.45, 0.45, n), np.ones(n)])
    return direction * rng.uniform(1, 9, (n, 1))


def unit(points):
    return points / np.linalg.norm(points, axis=-1, keepdims=True)


@pytest.mark.opencv
@pytest.mark.parametrize("count", BROWN)
def test_brown_conrady_projects_as_opencv(count):
    import cv2

    points, mine = scene(), camera(k=BROWN[count])
    theirs, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), mine.matrix, np.array(BROWN[count], float))
    assert mine.project(points) == pytest.approx(theirs.reshape(-1, 2), abs=1e-9)


@pytest.mark.opencv
def test_fisheye_projects_as_opencv():
    import cv2

    points, mine = scene(wide=3.0), camera("fisheye", FISHEYE, f_px=400.0)
    theirs, _ = cv2.fisheye.projectPoints(points[None], np.zeros(3), np.zeros(3), mine.matrix, np.array(FISHEYE))
    assert mine.project(points) == pytest.approx(theirs.reshape(-1, 2), abs=1e-9)


@pytest.mark.parametrize(
    "mine",
    [
        camera("pinhole"),
        *(camera(k=k) for k in BROWN.values()),
        camera("fisheye", FISHEYE, f_px=400.0),
        camera("equirectangular"),
    ],
    ids=lambda c: f"{c.lens}-{c.coefficients.size}",
)
def test_rays_invert_the_projection_to_1e_10(mine):
    points = scene()
    assert mine.rays(mine.project(points)) == pytest.approx(unit(points), abs=1e-10)


def test_rays_of_a_fisheye_reach_beyond_the_side():
    angle = np.radians([95.0, 100.0])
    points = np.column_stack([np.sin(angle), np.zeros(2), np.cos(angle)])
    mine = camera("fisheye", FISHEYE, f_px=400.0)
    assert mine.rays(mine.project(points)) == pytest.approx(points, abs=1e-10)


@given(st.lists(st.floats(-0.3, 0.3), min_size=2, max_size=2), st.floats(0, 1600), st.floats(0, 1200))
def test_a_ray_projects_onto_its_pixel_or_there_is_none(k, x, y):
    mine = camera(k=[k[0], k[1], 0, 0, 0])
    ray = mine.rays(np.array([[x, y]]))
    if np.all(np.isfinite(ray)):
        assert mine.project(ray)[0] == pytest.approx([x, y], abs=1e-6)


def test_says_where_distortion_folds_back():
    mine = Camera(1600, 1200, 1000.0, 799.5, 599.5, lens="brown_conrady", distortion=np.array([-0.35, 0, 0, 0, 0.0]))
    # r (1 - 0.35 r^2) turns at r = 0.976, where it is 0.651: 651 px from the centre
    inside = mine.invertible(np.array([[799.5 + 640, 599.5], [799.5 + 655, 599.5], [0, 0]]))
    assert inside.tolist() == [True, False, False]
    assert np.isnan(mine.rays(np.array([[0.0, 0.0]]))).all()


def test_behind_the_camera_is_nan():
    assert np.isnan(camera("pinhole").project(np.array([[0.1, 0.1, -1.0]]))).all()


def test_broadcasts_over_leading_axes():
    f = np.array([1000.0, 1100.0, 1200.0])
    points = scene(7)
    many = camera("pinhole", f_px=f).project(points)
    assert many.shape == (3, 7, 2)
    assert many[1] == pytest.approx(camera("pinhole", f_px=1100.0).project(points))


def full_covariance(n=9, seed=3):
    root = np.random.default_rng(seed).normal(size=(n, n)) * np.array([5, 1e-3, 3, 3, *([1e-2] * (n - 4))])[:, None]
    return root @ root.T


def transformed(kind):
    return {
        "resized": (lambda c: c.resized(800, 900), lambda p: (p + 0.5) * [0.5, 0.75] - 0.5),
        "cropped": (lambda c: c.cropped(100, 50, 1000, 900), lambda p: p - [100, 50]),
        "quarter": (lambda c: c.rotated(1), lambda p: np.column_stack([1199 - p[:, 1], p[:, 0]])),
        "half": (lambda c: c.rotated(2), lambda p: [1599, 1199] - p),
        "three quarters": (lambda c: c.rotated(3), lambda p: np.column_stack([p[:, 1], 1599 - p[:, 0]])),
    }[kind]


TURN = {"quarter": 1, "half": 2, "three quarters": 3}


def turned(points, quarters):
    for _ in range(quarters):
        points = np.column_stack([-points[:, 1], points[:, 0], points[:, 2]])
    return points


@pytest.mark.parametrize("kind", ["resized", "cropped", "quarter", "half", "three quarters"])
@pytest.mark.parametrize("count", [5, 8, 12])
def test_the_same_camera_of_another_picture(kind, count):
    change, move = transformed(kind)
    mine, points = camera(k=BROWN[count]), scene()
    there = change(mine).project(turned(points, TURN.get(kind, 0)))
    assert there == pytest.approx(move(mine.project(points)), abs=1e-8)


@pytest.mark.parametrize("kind", ["resized", "cropped", "quarter", "half", "three quarters"])
def test_covariance_goes_along(kind):
    """The spread of projected points is that of the original, moved: drawn cameras, then changed or changed then drawn."""
    change, move = transformed(kind)
    mine = camera(k=BROWN[5], cov=full_covariance() * 1e-4)
    points = scene(3)

    def jacobian(c, at):
        step = np.sqrt(np.diag(c.cov))
        columns = []
        for j in range(9):
            moved = []
            for sign in (1, -1):
                vector = np.array([c.f_px, c.aspect, c.cx_px, c.cy_px, *c.coefficients])
                vector[j] += sign * step[j]
                moved.append(
                    Camera(c.width_px, c.height_px, *vector[[0, 2, 3, 1]], c.lens, vector[4:]).project(at).ravel()
                )
            columns.append((moved[0] - moved[1]) / (2 * step[j]))
        return np.array(columns).T

    before = jacobian(mine, points)
    after_camera = change(mine)
    after = jacobian(after_camera, turned(points, TURN.get(kind, 0)))
    zero = move(np.zeros((1, 2)))
    linear = np.stack([(move(np.eye(2)[[i]]) - zero)[0] for i in range(2)], axis=1)
    spread = np.kron(np.eye(3), linear) @ (before @ mine.cov @ before.T) @ np.kron(np.eye(3), linear).T
    assert after @ after_camera.cov @ after.T == pytest.approx(spread, rel=1e-3, abs=1e-9)


def test_a_tilted_sensor_is_not_turned():
    with pytest.raises(InputError, match="tilted"):
        camera(k=BROWN[14]).rotated(1)


def test_json_round_trip_keeps_every_digit():
    mine = camera(
        k=BROWN[8], cov=full_covariance(12), nominal_focal_m=0.035, part_sources={"principal point": "assumed"}
    )
    back = Camera.from_json(json.loads(json.dumps(mine.to_json())))
    assert back.to_json() == mine.to_json()
    assert back.digest == mine.digest


@pytest.mark.parametrize(
    ("change", "name"),
    [
        ({"f_px": 0}, "f_px"), ({"f_px": np.nan}, "f_px"), ({"width_px": 0}, "width_px"), ({"height_px": 10.5}, "height_px"),
        ({"lens": "magic"}, "lens"), ({"distortion": np.zeros(7), "lens": "brown_conrady"}, "distortion"),
        ({"cov": np.eye(3)}, "cov"), ({"cov": -np.eye(4)}, "cov"), ({"aspect": -1}, "aspect"),
    ],
)  # fmt: skip
def test_refuses_what_no_camera_has(change, name):
    good = {"width_px": 100, "height_px": 100, "f_px": 100.0, "cx_px": 50, "cy_px": 50}
    with pytest.raises(InputError) as caught:
        Camera(**{**good, **change})
    assert caught.value.name == name


def test_independent_numbers_are_separate_lines_and_tied_ones_one():
    cov = np.diag([4.0, 0, 1, 1, 1e-4, 0, 0, 0, 0])
    assert [p.label for p in camera(k=BROWN[5], cov=cov).parts()] == [
        "focal length",
        "principal point",
        "lens distortion",
    ]
    cov[0, 2] = cov[2, 0] = 0.5
    assert [p.label for p in camera(k=BROWN[5], cov=cov).parts()] == [
        "focal length, principal point",
        "lens distortion",
    ]


def test_parse_reads_a_camera_or_says_how_to_write_one():
    read = Camera.parse("1600x1200, f=1500 ± 10 px, centre=790;600, distortion=-0.1;0.01;0;0;0")
    assert (read.width_px, read.f_px, read.cx_px, read.coefficients[0]) == (1600, 1500.0, 790.0, -0.1)
    for text in ("1600", "1600x1200", "1600x1200, g=3", "axb, f=3 px", "1600x1200, f=3 ± 1 px, centre=5"):
        with pytest.raises(InputError):
            Camera.parse(text)
