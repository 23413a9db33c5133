import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from subtense import propagate
from subtense.camera import Camera
from subtense.errors import GeometryError, InputError
from subtense.horizon import level_from_angles
from subtense.methods import height, wall
from subtense.observation import Observation
from subtense.quantity import Quantity
from subtense.vanishing import vanishing_point

CAMERA = Camera(1600, 1200, 1300.0, 790.0, 610.0, 1.0, lens="brown_conrady", distortion=np.array([-0.05, 0.01, 0, 0, 0]),
                cov=np.diag([13.0**2, 0, 64, 64, 1e-4, 0, 0, 0, 0]))  # fmt: skip
PINHOLE = Camera(1600, 1200, 1300.0, 799.5, 599.5)
EXACT = Quantity.exact(0.0, "1")


def seen(points, pitch=-12.0, roll=3.0, over=1.6, camera=PINHOLE, sigma=0.7):
    """Points x right, y ahead, z up over a level ground, from a camera above its origin."""
    level = level_from_angles(np.radians(pitch), np.radians(roll))
    turn = np.stack([level.right, level.ahead, level.up], -1)
    return Observation(camera.project((np.asarray(points, float) - [0, 0, over]) @ turn.T), sigma)


VERTICALS = [(-1.5, 5, 0.2), (-1.5, 5, 2.2), (1.5, 4, 0.2), (1.5, 4, 2.0), (0.2, 6, 0), (0.2, 6, 2.3)]
ALONG = [(-1, 4, 0), (-1, 8, 0), (1, 4, 0), (1, 8, 0), (1.5, 5, 2), (1.5, 9, 2)]
ACROSS = [(-1, 5, 0), (1, 5, 0), (-1, 8, 0), (1, 8, 0), (-1.5, 6, 2), (1, 6, 2)]


def scene(tall=1.75, camera=PINHOLE, given=None, lines=VERTICALS, **more):
    view = {"camera": camera or PINHOLE, **more}
    given = given if given is not None else ({"camera": camera} if camera else {})
    return height.Inputs(
        seen(lines, **view), seen([(-1, 5, 0), (-1, 5, 2.02)], **view), seen([(0.8, 4, 0), (0.8, 4, tall)], **view),
        Quantity.normal(2.02, 0.005, "m"), distortion=EXACT, **given,
    )  # fmt: skip


def values(one):
    return [m.value for m in propagate.measure(height.METHOD, one, draws=20_000)]


def codes(one):
    return {n.code for n in propagate.measure(height.METHOD, one, draws=20_000)[0].notes}


def refusal(method, one):
    with pytest.raises(GeometryError) as caught:
        propagate.measure(method, one, draws=20_000)
    return caught.value.code


@given(st.floats(-35, 10), st.floats(-15, 15), st.floats(0.3, 2.5), st.floats(0.8, 3.0))
def test_heights_from_a_camera_whatever_way_it_looks(pitch, roll, tall, over):
    one = scene(tall, CAMERA if pitch > -20 else PINHOLE, pitch=pitch, roll=roll, over=over)
    if all(np.isfinite(o.points_px).all() for o in (one.verticals, one.reference, one.ends)):
        assert values(one) == pytest.approx([tall, over], rel=1e-6)


@pytest.mark.parametrize("pitch", [-12.0, -30.0, 0.0])
def test_heights_without_a_camera_by_the_horizon_or_by_level_lines(pitch):
    far = seen([(-3e6, 1e7, 1.6), (2e6, 1e7, 1.6)], pitch=pitch)
    lines = {"parallels": seen(ALONG, pitch=pitch), "others": seen(ACROSS, pitch=pitch)}
    for given_ in ({"horizon": far}, lines):
        assert values(scene(camera=None, given=given_, pitch=pitch)) == pytest.approx([1.75, 1.6], rel=1e-5)


def test_upright_lines_that_are_parallel_in_the_picture_meet_at_infinity():
    v, lost = vanishing_point(np.array([[0.0, 0], [0, 1], [1, 0], [1, 1], [2, 0], [2, 3]]), np.ones(3))
    assert not lost and abs(v[2]) < 1e-12 and abs(v[1]) == pytest.approx(1)
    assert values(scene(pitch=0.0, roll=0.0)) == pytest.approx([1.75, 1.6], rel=1e-9)


def test_the_reference_by_itself_is_as_certain_as_it_is():
    one = scene()
    same = height.Inputs(one.verticals, one.reference, one.reference, one.height, camera=PINHOLE)
    m = propagate.measure(height.METHOD, same)[0]
    assert (m.value, m.u) == pytest.approx((2.02, 0.005))


def test_doubts_of_all_inputs_are_in_the_budget():
    view = {"camera": CAMERA}
    names = {c.name for c in propagate.measure(height.METHOD, scene(camera=CAMERA))[0].budget}
    assert {"focal length", "principal point", "height"} <= names and view


# -- doubts and refusals -----------------------------------------------------------------------------------------------


def test_right_clicks_have_no_notes():
    assert codes(scene()) == set()


def test_a_top_beside_its_base_is_noted():
    one = scene()
    points = one.ends.points_px.copy()
    points[1] += [15, 0]
    assert codes(height.Inputs(one.verticals, one.reference, Observation(points, 0.7), one.height, camera=PINHOLE)) == {
        "not_upright"
    }


def test_a_vertical_line_that_leans_is_named():
    leaning = [*VERTICALS, (-0.5, 6, 0), (-0.45, 6, 2), (1.0, 7, 0), (1.0, 7, 2)]
    [note] = [n for n in propagate.measure(height.METHOD, scene(lines=leaning))[0].notes if n.code == "lines_misfit"]
    assert "line 4" in note.text


def test_two_level_lines_of_a_direction_are_unchecked_and_distortion_unknown():
    one = scene(camera=None, given={"parallels": seen(ALONG[:4]), "others": seen(ACROSS)})
    assert codes(one) == {"lines_unchecked"}
    plain = height.Inputs(
        one.verticals, one.reference, one.ends, one.height, parallels=one.parallels, others=one.others
    )
    assert codes(plain) == {"lines_unchecked", "distortion_unknown"}


def test_degenerate_input_is_refused():
    one = scene()
    line = Observation(one.verticals.points_px[[0, 1, 0, 1]], 0.0)
    assert (
        refusal(height.METHOD, height.Inputs(line, one.reference, one.ends, one.height, camera=PINHOLE))
        == "no_vanishing_point"
    )
    turned = Observation(scene(1.0).ends.points_px[::-1], 0.7)
    assert (
        refusal(height.METHOD, height.Inputs(one.verticals, one.reference, turned, one.height, camera=PINHOLE))
        == "upside_down"
    )
    short = Observation(seen([(-1, 5, 0), (-1, 5, 1.02)]).points_px[::-1], 0.7)
    exchanged = height.Inputs(one.verticals, short, turned, one.height, camera=PINHOLE)
    assert refusal(height.METHOD, exchanged) == "upside_down"
    tall = Observation(one.reference.points_px[::-1], 0.7)  # its top, taken as base, lies above the horizon
    assert (
        refusal(height.METHOD, height.Inputs(one.verticals, tall, one.ends, one.height, camera=PINHOLE))
        == "beyond_horizon"
    )
    point = Observation(one.reference.points_px[[0, 0]], 0.0)
    assert (
        refusal(height.METHOD, height.Inputs(one.verticals, point, one.ends, one.height, camera=PINHOLE)) == "no_height"
    )
    assert (
        refusal(height.METHOD, height.Inputs(one.verticals, one.reference, point, one.height, camera=PINHOLE))
        == "zero_extent"
    )
    none = Quantity.exact(0.0, "m")
    assert (
        refusal(height.METHOD, height.Inputs(one.verticals, one.reference, one.ends, none, camera=PINHOLE))
        == "out_of_range"
    )
    floating = Observation(one.ends.points_px - np.array([0, 700.0]), 0.7)
    assert (
        refusal(height.METHOD, height.Inputs(one.verticals, one.reference, floating, one.height, camera=PINHOLE))
        == "beyond_horizon"
    )


def test_what_is_missing_is_said():
    one = scene()
    with pytest.raises(InputError, match="camera"):
        height.Inputs(one.verticals, one.reference, one.ends, one.height)
    with pytest.raises(InputError, match="others"):
        height.Inputs(one.verticals, one.reference, one.ends, one.height, parallels=seen(ALONG))
    with pytest.raises(InputError, match="two lines"):
        height.Inputs(one.reference, one.reference, one.ends, one.height, camera=PINHOLE)


# -- walls -------------------------------------------------------------------------------------------------------------


@given(st.floats(-20, 5), st.floats(-8, 8), st.floats(-0.6, 1.2))
def test_width_and_height_on_a_wall(pitch, roll, slant):
    foot = np.array([[-1.2, 5, 0], [1.2, 5 + 2.4 * slant, 0]])
    along = (foot[1] - foot[0]) / np.linalg.norm(foot[1] - foot[0])
    ends = foot[0] + np.array([0.5 * along + [0, 0, 0.6], 1.7 * along + [0, 0, 1.5]])
    view = {"pitch": pitch, "roll": roll, "camera": PINHOLE}
    one = wall.Inputs(PINHOLE, seen(VERTICALS, **view), seen([(-0.6, 4.5, 0), (-0.6, 4.5, 2.0)], **view),
                      Quantity.normal(2.0, 0.005, "m"), seen(foot, **view), seen(ends, **view))  # fmt: skip
    found = [m.value for m in propagate.measure(wall.METHOD, one, draws=20_000)]
    assert found == pytest.approx([1.5, 1.2, 0.9], rel=1e-6)


def test_a_wall_seen_edge_on_or_a_foot_above_the_horizon_is_refused():
    one = wall.example()
    sky = Observation(one.foot.points_px - np.array([0, 700.0]), 0.7)
    assert (
        refusal(wall.METHOD, wall.Inputs(one.camera, one.verticals, one.reference, one.height, sky, one.ends))
        == "beyond_horizon"
    )
    turned = Observation(one.reference.points_px[::-1], 0.7)
    exchanged = wall.Inputs(one.camera, one.verticals, turned, one.height, one.foot, one.ends)
    assert refusal(wall.METHOD, exchanged) in {"upside_down", "beyond_horizon"}
