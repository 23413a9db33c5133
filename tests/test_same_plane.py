import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from subtense import assumptions, propagate
from subtense.camera import Camera
from subtense.errors import GeometryError
from subtense.methods.same_plane import METHOD, Inputs, same_plane
from subtense.observation import Observation
from subtense.quantity import Quantity

LENS = {"lens": "brown_conrady", "distortion": np.array([-0.1, 0.02, 1e-3, -5e-4, 0])}
CAMERA = Camera(1600, 1200, 1500.0, 805.0, 590.0, 1.01, cov=np.diag([100.0, 1e-6, 9, 9, 1e-4, 0, 0, 0, 0]), **LENS)
PINHOLE = Camera(1600, 1200, 1000.0, 800.0, 600.0)
REFERENCE = np.array([[500.0, 300.0], [700.0, 320.0]])
WANTED = np.array([[900.0, 400.0], [950.0, 800.0]])

place = st.tuples(st.floats(-0.3, 0.3), st.floats(-0.2, 0.2))
angle = st.floats(-0.6, 0.6)


def scene(reference=REFERENCE, ends=WANTED, camera=CAMERA, length=0.2, turn=0.0, tip=0.0, sigma=0.5, u=0.02):
    return Inputs(
        Observation(reference, sigma), Observation(ends, sigma), Quantity.normal(length, 0.002 * abs(length), "m"),
        Quantity.normal(turn, u, "rad"), Quantity.normal(tip, u, "rad"), camera,
    )  # fmt: skip


def numbers(inputs):
    found = propagate.first_order(METHOD, inputs)
    return np.concatenate([found.value, found.u])


def length_of(**change):
    return float(same_plane(scene(**change)).length_m)


def drawn(points, turn, tip, depth=2.0):
    """Points of a drawing (N, 2) in m on a plane 2 m away, as (N, 3) in the camera frame.

    The drawing's x axis goes right and its y axis down; both stay in the plane, which falls by tan(turn) to the right and by
    tan(tip) downwards:

        z = depth - x tan(turn) - y tan(tip)
    """
    right = np.array([1.0, 0.0, -np.tan(turn)])
    right /= np.linalg.norm(right)
    normal = np.array([np.tan(turn), np.tan(tip), 1.0])
    down = np.cross(normal / np.linalg.norm(normal), right)
    return np.array([0, 0, depth]) + np.asarray(points) @ np.stack([right, down])


SKETCH = [(-0.5, -0.4), (-0.1, -0.3), (0.2, -0.1), (0.4, 0.5)]  # reference: 0.4123 m; wanted: 0.6325 m


@pytest.mark.parametrize(("turn", "tip"), [(0, 0), (0.5, 0), (-0.5, 0), (0, 0.5), (0, -0.5), (0.4, -0.3)])
def test_a_sketch_on_a_turned_board(turn, tip):
    pixels = CAMERA.project(drawn(SKETCH, turn, tip))
    found = length_of(
        reference=pixels[:2], ends=pixels[2:], length=float(np.hypot(0.4, 0.1)), turn=turn, tip=tip
    )  # fmt: skip
    assert found == pytest.approx(np.hypot(0.2, 0.6), rel=1e-9)


@given(place, place, place, place, angle, angle)
def test_any_two_lengths_of_any_plane(a, b, c, d, turn, tip):
    known, wanted = np.hypot(a[0] - b[0], a[1] - b[1]), np.hypot(c[0] - d[0], c[1] - d[1])
    assume(known > 0.02 and wanted > 0.02)
    pixels = CAMERA.project(drawn([a, b, c, d], turn, tip, depth=1.5))
    assume(np.isfinite(pixels).all())
    found = length_of(reference=pixels[:2], ends=pixels[2:], length=float(known), turn=turn, tip=tip)
    assert found == pytest.approx(wanted, rel=1e-7)


def test_by_hand_on_a_wall_that_comes_nearer_to_the_right():
    """A wall z = 2 - x: at x = 0 it is 2 m away, at x = 1 it is 1 m away. turn = atan 1 = 45 degrees.

    At f = 1000 px a metre of height spans 500 px at x = 0 and 1000 px at x = 1, which is 1000 px right of the middle.
    """
    far, near = np.array([[800.0, 350.0], [800.0, 850.0]]), np.array([[1800.0, 100.0], [1800.0, 1100.0]])
    found = length_of(reference=far, ends=near, camera=PINHOLE, length=1.0, turn=np.pi / 4)
    assert found == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize(("axis", "field"), [(0, "turn"), (1, "tip")])
def test_a_positive_angle_makes_the_right_and_the_lower_side_nearer(axis, field):
    """Nearer things look larger: what looks as large on the nearer side is shorter."""
    across = np.array([[-50.0, 0.0], [50.0, 0.0]])[:, :: 1 if axis else -1]
    step = 300.0 * np.eye(2)[axis]
    middle = np.array([800.0, 600.0])
    before, behind = across + middle - step, across + middle + step
    assert length_of(reference=before, ends=behind, camera=PINHOLE, **{field: 0.3}) < 0.2
    assert length_of(reference=before, ends=behind, camera=PINHOLE, **{field: -0.3}) > 0.2
    assert length_of(reference=before, ends=behind, camera=PINHOLE) == pytest.approx(0.2)


# -- without a camera ------------------------------------------------------------------------------------------


@given(place, place, place, place, angle, angle)
def test_parallel_rays_see_the_foreshortening(a, b, c, d, turn, tip):
    """A drawing seen from infinity: its points without their depth."""
    known, wanted = np.hypot(a[0] - b[0], a[1] - b[1]), np.hypot(c[0] - d[0], c[1] - d[1])
    assume(known > 0.02 and wanted > 0.02)
    flat = 1000 * drawn([a, b, c, d], turn, tip)[:, :2]
    found = length_of(reference=flat[:2], ends=flat[2:], camera=None, length=float(known), turn=turn, tip=tip)
    assert found == pytest.approx(wanted, rel=1e-8)


def test_a_long_lens_sees_as_parallel_rays_do():
    camera = Camera(1600, 1200, 1e7, 800.0, 600.0)
    found = length_of(camera=camera, turn=0.4, tip=-0.3)
    assert found == pytest.approx(length_of(camera=None, turn=0.4, tip=-0.3), rel=1e-4)
    assert length_of(camera=PINHOLE, turn=0.4, tip=-0.3) != pytest.approx(found, rel=1e-2)


def test_a_plane_that_faces_the_camera_has_one_scale_with_and_without_a_camera():
    pixels = np.hypot(50, 400) / np.hypot(200, 20)
    for camera in (None, PINHOLE):
        assert length_of(camera=camera) == pytest.approx(0.2 * pixels)


# -- invariances -----------------------------------------------------------------------------------------------


@given(angle, angle, st.floats(0.01, 100), st.booleans())
def test_scaling_the_world_scales_the_answer(turn, tip, s, with_camera):
    more = {"camera": CAMERA if with_camera else None, "turn": turn, "tip": tip}
    assert numbers(scene(length=0.2 * s, **more)) == pytest.approx(s * numbers(scene(length=0.2, **more)), rel=1e-8)


@given(angle, angle, st.booleans())
def test_swapping_the_ends_of_either_changes_nothing(turn, tip, with_camera):
    more = {"camera": CAMERA if with_camera else None, "turn": turn, "tip": tip}
    first = numbers(scene(**more))
    assert numbers(scene(reference=REFERENCE[::-1], **more)) == pytest.approx(first, rel=1e-8)
    assert numbers(scene(ends=WANTED[::-1], **more)) == pytest.approx(first, rel=1e-8)


@given(angle, angle, st.booleans())
def test_swapping_reference_and_wanted_inverts_the_ratio(turn, tip, with_camera):
    more = {"camera": CAMERA if with_camera else None, "turn": turn, "tip": tip}
    there = length_of(**more) / 0.2
    assert length_of(reference=WANTED, ends=REFERENCE, **more) / 0.2 == pytest.approx(1 / there, rel=1e-9)


@given(angle, angle, st.booleans())
def test_a_mirrored_picture_turns_the_other_way_and_gives_the_same(turn, tip, with_camera):
    mirrored = Camera(1600, 1200, 1500.0, 1599 - 805.0, 590.0, 1.01, cov=CAMERA.cov, lens="brown_conrady",
                      distortion=CAMERA.coefficients * [1, 1, 1, -1, 1])  # fmt: skip
    flip = ([1599, 0], [-1, 1])
    reference, ends = (flip[0] + np.array(flip[1]) * points for points in (REFERENCE, WANTED))
    there = scene(reference, ends, mirrored if with_camera else None, turn=-turn, tip=tip)
    here = scene(camera=CAMERA if with_camera else None, turn=turn, tip=tip)
    assert numbers(there) == pytest.approx(numbers(here), rel=1e-7)


@given(angle, angle, st.booleans())
def test_a_quarter_turn_of_the_picture_makes_tip_of_turn(turn, tip, with_camera):
    """Clockwise: what was the lower side is the left one, what was the right side is the lower one."""
    reference, ends = (np.column_stack([1199 - p[:, 1], p[:, 0]]) for p in (REFERENCE, WANTED))
    there = scene(reference, ends, CAMERA.rotated(1) if with_camera else None, turn=-tip, tip=turn)
    here = scene(camera=CAMERA if with_camera else None, turn=turn, tip=tip)
    # f and aspect go along to first order, so u agrees to second
    assert numbers(there) == pytest.approx(numbers(here), rel=1e-4)


@given(angle, angle, st.sampled_from([(800, 600), (3200, 2400)]), st.integers(0, 200), st.integers(0, 200))
def test_cropping_and_resizing_change_nothing(turn, tip, size, left, top):
    s = size[0] / 1600
    camera = CAMERA.cropped(left, top, 1600, 1200).resized(*size)
    reference, ends = ((p - [left, top] + 0.5) * s - 0.5 for p in (REFERENCE, WANTED))
    there = scene(reference, ends, camera, turn=turn, tip=tip, sigma=0.5 * s)
    assert numbers(there) == pytest.approx(numbers(scene(turn=turn, tip=tip)), rel=1e-7)


def test_u_is_that_of_the_reference_alone_where_nothing_else_is_uncertain():
    inputs = Inputs(Observation(REFERENCE, 0.0), Observation(WANTED, 0.0), Quantity.normal(0.2, 0.002, "m"))
    m = propagate.measure(METHOD, inputs)[0]
    assert m.u / m.value == pytest.approx(0.01)
    assert [c.name for c in m.budget] == ["length"]


def test_the_reference_measured_by_itself_is_as_certain_as_it_is():
    """The same clicks are the same: their errors cancel."""
    inputs = Inputs(Observation(REFERENCE, 2.0), Observation(REFERENCE, 2.0), Quantity.normal(0.2, 0.002, "m"),
                    assumptions.unknown_tilt(), assumptions.unknown_tilt(), CAMERA)  # fmt: skip
    m = propagate.measure(METHOD, inputs)[0]
    assert (m.value, m.u) == pytest.approx((0.2, 0.002))


@pytest.mark.parametrize("field", ["sigma", "u"])
def test_u_grows_with_each_doubt(field):
    found = [
        propagate.measure(METHOD, scene(turn=0.2, tip=0.2, **{field: x * {"sigma": 0.5, "u": 0.01}[field]}))[0].u
        for x in (1, 2, 4)
    ]
    assert found[0] < found[1] < found[2]


# -- refusals and notes ----------------------------------------------------------------------------------------


def refusal(**change):
    with pytest.raises(GeometryError) as caught:
        propagate.measure(METHOD, scene(**change))
    return caught.value.code


@pytest.mark.parametrize("field", ["reference", "ends"])
def test_two_ends_on_one_point_are_refused(field):
    assert refusal(**{field: np.array([[500.0, 300.0], [500.0, 300.0]])}) == "zero_extent"


def test_a_reference_without_length_is_refused():
    assert refusal(length=0.0) == "out_of_range"


@pytest.mark.parametrize("field", ["reference", "ends"])
def test_a_plane_turned_so_far_that_a_point_looks_past_it_is_refused(field):
    """At f = 1000 px a plane turned by 60 degrees to the left is met by rays up to 577 px right of the middle only."""
    seen = {"reference": np.array([[600.0, 600.0], [700.0, 600.0]]), "ends": np.array([[700.0, 500.0], [700.0, 700.0]])}
    assert length_of(**seen, camera=PINHOLE, turn=-np.pi / 3) > 0
    beyond = {**seen, field: np.array([[1380.0, 600.0], [1370.0, 600.0]])}
    assert refusal(**beyond, camera=PINHOLE, turn=-np.pi / 3, sigma=0.0) == "too_oblique"
    inside = {**seen, field: np.array([[1370.0, 600.0], [1360.0, 600.0]])}
    assert length_of(**inside, camera=PINHOLE, turn=-np.pi / 3) > 0


def test_a_panorama_is_refused():
    camera = Camera(3000, 1500, 477.0, 1499.5, 749.5, lens="equirectangular")
    assert refusal(camera=camera) == "not_pinhole"


def test_a_point_beyond_the_turning_point_of_the_lens_is_refused():
    camera = Camera(1600, 1200, 1000.0, 799.5, 599.5, lens="brown_conrady", distortion=np.array([-0.35, 0, 0, 0, 0.0]))
    assert refusal(camera=camera, ends=np.array([[5.0, 5], [300, 300]])) == "not_invertible"


def test_doubts_are_noted():
    def codes(*angles, camera):
        seen = (Observation(REFERENCE), Observation(WANTED), Quantity.exact(0.2, "m"))
        return {n.code for n in propagate.measure(METHOD, Inputs(*seen, *angles, camera=camera))[0].notes}

    said = Quantity.normal(0.0, 0.02, "rad")
    assert codes(camera=None) == {"frontal_assumption", "parallel_rays"}
    assert codes(said, said, camera=None) == {"parallel_rays"}
    assert codes(said, said, camera=PINHOLE) == set()
    assert codes(said, camera=PINHOLE) == {"frontal_assumption"}
    assert codes(said, assumptions.unknown_tilt(), camera=PINHOLE) == {"unknown_tilt"}
    assert codes(camera=PINHOLE) == {"frontal_assumption"}
