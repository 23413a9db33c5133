"""Methods on the ground: known triangles, traps, bad input, what is said of the height, terrain models."""

import math
import warnings

import numpy as np
import pytest

from subtense import Photo, propagate
from subtense.camera import Camera
from subtense.errors import FileFormatError, GeometryError, InputError, MissingExtraError
from subtense.ground import Standing
from subtense.horizon import dip_rad, level_from_angles, level_from_horizon, level_from_parallels
from subtense.metadata import Metadata
from subtense.methods import (
    ground_footprint,
    ground_length,
    ground_plane,
    ground_sampling,
    ground_speed,
    surveyed_ground,
)
from subtense.observation import Observation
from subtense.quantity import Quantity
from subtense.target import Target
from subtense.told_pose import ToldPose
from subtense.workflow.ground import GroundTexts, TerrainTexts, ground_document, read_time

DEG = math.pi / 180
CAMERA = Camera(1600, 1200, 1500.0, 799.5, 599.5)
LEVEL = {"slope": Quantity.exact(0.0, "rad"), "cross_slope": Quantity.exact(0.0, "rad")}
FLAT = {**LEVEL, "refraction": Quantity.exact(1.0, "1"), "roll": Quantity.exact(0.0, "rad")}


def exact(value, unit="m"):
    return Quantity.exact(value, unit)


def standing(height=1.6, pitch=0.0, u_pitch=0.0, **more):
    return {"camera": CAMERA, "height": exact(height), "pitch": Quantity.normal(pitch, u_pitch, "rad"), **FLAT, **more}


def row(angle):
    """The pixel row that is seen so far below the optical axis."""
    return 599.5 + 1500 * math.tan(angle)


def point(x, y, sigma=0.0):
    return Observation(np.array([[x, y]]), sigma)


def measured(**inputs):
    return propagate.measure(ground_plane.METHOD, ground_plane.Inputs(**inputs))


# -- known triangles ---------------------------------------------------------------------------------------


def test_distance_is_height_over_the_tangent():
    far, range_, depth = measured(**standing(1.6, -5 * DEG), foot=point(799.5, row(3 * DEG)))
    assert far.value == pytest.approx(1.6 / math.tan(8 * DEG), rel=1e-7)
    assert range_.value == pytest.approx(1.6 / math.sin(8 * DEG), rel=1e-7)
    assert depth.value == pytest.approx(range_.value * math.cos(3 * DEG), rel=1e-9)


def test_pitch_and_roll_are_those_of_a_told_pose():
    told = ToldPose(-0.2, 0.1, 0.01, "tags").camera_from_level.rotation
    level = level_from_angles(np.float64(-0.2), np.float64(0.1))
    assert np.allclose(np.stack([level.right, level.ahead, level.up], -1), told)
    assert float(level.pitch_rad) == pytest.approx(-0.2) and float(level.roll_rad) == pytest.approx(0.1)


def test_straight_down_the_height_over_f_is_a_pixel():
    inputs = ground_sampling.Inputs(**standing(40, -90 * DEG), place=point(799.5, 599.5))
    across, along, range_ = propagate.measure(ground_sampling.METHOD, inputs)
    assert (
        across.value == pytest.approx(40 / 1500)
        and along.value == pytest.approx(40 / 1500)
        and range_.value == pytest.approx(40)
    )
    area, near, far, length = propagate.measure(
        ground_footprint.METHOD, ground_footprint.Inputs(**standing(40, -90 * DEG))
    )
    assert area.value == pytest.approx(1600 * 1200 * (40 / 1500) ** 2)
    assert (near.value, far.value, length.value) == pytest.approx(
        (1600 * 40 / 1500, 1600 * 40 / 1500, 1200 * 40 / 1500)
    )


def test_length_between_two_points_and_speed():
    ends = Observation(np.array([[799.5, 599.5], [949.5, 599.5]]), 0.0)
    [length] = propagate.measure(ground_length.METHOD, ground_length.Inputs(**standing(30, -90 * DEG), ends=ends))
    assert length.value == pytest.approx(3.0)
    inputs = ground_speed.Inputs(**standing(30, -90 * DEG), ends=ends, time=Quantity.exact(2.0, "s"))
    speed, way = propagate.measure(ground_speed.METHOD, inputs)
    assert (speed.value, way.value) == pytest.approx((1.5, 3.0)) and speed.unit == "m/s"


def test_a_point_above_the_ground_and_ground_that_lies_higher():
    foot = point(799.5, row(3 * DEG))
    lifted = measured(**standing(1.6, -5 * DEG), foot=foot, point_height=exact(0.4))[0]
    risen = measured(**standing(1.6, -5 * DEG, rise=exact(0.4)), foot=foot)[0]
    assert lifted.value == risen.value == pytest.approx(1.2 / math.tan(8 * DEG))
    tree = measured(**standing(1.6, 10 * DEG), foot=point(799.5, 599.5), point_height=exact(11.6))[0]
    assert tree.value == pytest.approx(10 / math.tan(10 * DEG))


def test_roll_turns_the_ground_about_the_axis():
    roll = 7 * DEG
    c, s = math.cos(-roll), math.sin(-roll)
    down = np.array([0.0, row(6 * DEG) - 599.5])
    seen = np.array([799.5, 599.5]) + np.array([[c, -s], [s, c]]) @ down
    turned = measured(**standing(2, -4 * DEG, roll=exact(roll, "rad")), foot=point(*seen))[0]
    assert turned.value == pytest.approx(2 / math.tan(10 * DEG))


def test_a_slope_that_rises_ahead_brings_the_ground_nearer():
    slope = {"slope": exact(math.atan(0.01), "rad")}
    far = measured(**{**standing(1.6, -5 * DEG), **slope}, foot=point(799.5, 599.5))[0]
    assert far.value == pytest.approx(1.6 / (math.tan(5 * DEG) + 0.01))


# -- horizon, level lines, a reference ---------------------------------------------------------------------


def rotation(pitch, roll):
    level = level_from_angles(np.float64(pitch), np.float64(roll))
    return np.stack([level.right, level.ahead, level.up])  # rows: level axes in the camera's frame


def test_up_from_the_horizon_and_from_level_lines():
    axes = rotation(-0.15, 0.06)
    dip = 0.003
    ways = np.array([[math.sin(a), math.cos(a), -math.tan(dip)] for a in (-0.4, 0.1, 0.3)])
    rays = ways / np.linalg.norm(ways, axis=1)[:, None] @ axes
    for seen in (rays, rays[:2]):
        level = level_from_horizon(seen, np.float64(dip))
        assert (float(level.pitch_rad), float(level.roll_rad)) == pytest.approx((-0.15, 0.06), abs=1e-9)
    one = level_from_horizon(rays[:1], np.float64(dip), np.float64(0.06))
    assert float(one.pitch_rad) == pytest.approx(-0.15, abs=1e-9)
    first, second = np.array([0.3, 1.0, 0]), np.array([-0.5, 1.0, 0])
    lines = [[-2, 4, -1.5], [-2, 4, -1.5] + 3 * first, [3, 5, -1.5], [3, 5, -1.5] + 2 * first,
             [-1, 6, 1], [-1, 6, 1] + 2 * second, [2, 4, -1], [2, 4, -1] + 4 * second]  # fmt: skip
    rays = np.array(lines) @ axes
    rays /= np.linalg.norm(rays, axis=1)[:, None]
    level = level_from_parallels(rays)
    assert (float(level.pitch_rad), float(level.roll_rad)) == pytest.approx((-0.15, 0.06), abs=1e-9)
    level = level_from_parallels(rays[:4], np.float64(0.06))
    assert float(level.pitch_rad) == pytest.approx(-0.15, abs=1e-9)


def test_a_marked_horizon_frees_the_distance_of_the_principal_point():
    """A camera whose axis is off by 3 degrees gives the same distance, as the angle between horizon and foot is what counts."""
    cov = np.diag([0, 0, 20.0**2, 30.0**2])
    camera = Camera(1600, 1200, 1500.0, 799.5, 599.5, cov=cov)
    base = {"camera": camera, "height": exact(1.6), **FLAT, "foot": point(850, 700, 0.5)}
    line = Observation(np.array([[100.0, 560.0], [1500.0, 560.0]]), 0.5)
    far = measured(**{**base, "roll": exact(0, "rad")}, horizon=line, dip=exact(0.0, "1"))[0]
    by_pitch = measured(**base, pitch=exact(-math.atan(39.5 / 1500), "rad"))[0]
    assert far.u / far.value < 0.02 < 0.2 < by_pitch.u / far.value


def test_the_visible_horizon_lies_lower():
    assert float(dip_rad(np.float64(1.6), np.float64(0.0))) == pytest.approx(math.radians(2.44 / 60), rel=0.01)
    base = {"camera": CAMERA, "height": exact(10.0), **LEVEL, "foot": point(799.5, 650)}
    line = Observation(np.array([[100.0, 560.0], [1500.0, 560.0]]), 0.2)
    sea, vanishing, unknown = (
        measured(**base, horizon=line, **dip)[0] for dip in ({"dip": exact(1.0, "1")}, {"dip": exact(0.0, "1")}, {})
    )
    assert sea.value < unknown.value < vanishing.value
    assert {"horizon_assumed"} <= {n.code for n in unknown.notes} and not any(
        n.code == "horizon_assumed" for n in sea.notes
    )
    assert unknown.low < 1.003 * sea.value and 0.997 * vanishing.value < unknown.high


def test_a_reference_on_the_ground_gives_the_height():
    base = {"camera": CAMERA, "pitch": exact(-0.3, "rad"), **FLAT}
    ends = Observation(np.array([[700.0, 700.0], [1000.0, 760.0]]), 0.0)
    [length] = propagate.measure(ground_length.METHOD, ground_length.Inputs(**base, height=exact(3.0), ends=ends))
    foot = point(500, 500)
    told = measured(**base, height=exact(3.0), foot=foot)[0]
    found = measured(**base, reference=ends, reference_length=exact(length.value), foot=foot)[0]
    assert found.value == pytest.approx(told.value, rel=1e-9)


# -- traps -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("far", "degrees", "error"), [(5, 0.1, 0.006), (20, 0.1, 0.022), (20, 1.0, 0.28), (100, 0.1, 0.12)]
)
def test_trap_32_pitch(far, degrees, error):
    """(R/h + h/R) dphi at 1.6 m: in u of a pitch so doubtful, and in the distance of one that is so wrong."""
    pitch = -math.atan(1.6 / far)
    m = measured(**standing(1.6, pitch, degrees * DEG), foot=point(799.5, 599.5))[0]
    if degrees < 1:
        assert m.u / m.value == pytest.approx(error, rel=0.12)
    wrong = measured(**standing(1.6, pitch + degrees * DEG), foot=point(799.5, 599.5))[0]
    assert wrong.value / far - 1 == pytest.approx(error, rel=0.15)


def test_trap_32_slope():
    flat = measured(**standing(1.6, -math.atan(1.6 / 20)), foot=point(799.5, 599.5))[0]
    assert flat.value / (1.6 / (1.6 / 20 + 0.01)) - 1 == pytest.approx(0.14, abs=0.02)
    told = {**standing(1.6, -math.atan(1.6 / 20)), "slope": Quantity.normal(0.0, 0.01, "rad")}
    assert 0.1 < measured(**told, foot=point(799.5, 599.5))[0].u / 20 < 0.2


@pytest.mark.parametrize(("far", "drop"), [(1000, 0.068), (5000, 1.7)])
def test_trap_33_curvature(far, drop):
    """The ground lies d^2 (1 - k) / 2R lower; taken into account always, and told beyond 500 m."""
    inputs = {**standing(30, -math.atan((30 + drop) / far)), "refraction": exact(0.13, "1")}
    found = measured(**inputs, foot=point(799.5, 599.5))
    assert found[0].value == pytest.approx(far, rel=1e-3)
    note = next(n for n in found[0].notes if n.code == "earth_curvature")
    assert f"{drop:.2g}" in note.text
    assert measured(**{**inputs, "refraction": exact(1.0, "1")}, foot=point(799.5, 599.5))[0].value < far * (
        1 - drop / 34
    )


def test_trap_33_nothing_is_seen_beyond_the_horizon_of_the_sea():
    with pytest.raises(GeometryError) as error:
        measured(**{**standing(1.6, -0.0005), "refraction": exact(0.13, "1")}, foot=point(799.5, 599.5))
    assert error.value.code == "at_or_above_horizon"


def test_trap_24_rolling_shutter():
    """A thing that moved by half the picture's rows was seen up to half a readout earlier or later than the pictures' times tell."""
    ends = Observation(np.array([[799.5, 400.0], [799.5, 1000.0]]), 0.0)
    rolling, stated = (
        propagate.measure(
            ground_speed.METHOD, ground_speed.Inputs(**standing(5, -0.4), ends=ends, time=exact(0.4, "s"), **more)
        )[0]
        for more in ({}, {"readout": exact(0.03, "s")})
    )
    assert "rolling_shutter" in {n.code for n in rolling.notes} and rolling.u / rolling.value > 0.03
    assert stated.value == pytest.approx(rolling.value * 0.4 / 0.415) and rolling.low < stated.value < rolling.high
    assert "rolling_shutter" not in {n.code for n in stated.notes}


def test_trap_35_clicks():
    """A click of 1 px at 20 m from a height of 1.6 m and f = 1500 px is (R/h) / f of the range."""
    clicked = measured(**standing(1.6, -math.atan(1.6 / 20)), foot=point(799.5, 599.5, 1.0))[0]
    assert clicked.u / clicked.value == pytest.approx((20 / 1.6 + 1.6 / 20) / 1500, rel=0.01)


# -- near and at the horizon -------------------------------------------------------------------------------


def test_near_the_horizon_the_far_limit_is_open():
    m = measured(**standing(1.6, -1 * DEG, 1 * DEG), foot=point(799.5, 599.5))[0]
    assert m.high is None and m.u is None and m.low < 45
    assert {"open_interval", "near_horizon"} <= {n.code for n in m.notes}


@pytest.mark.parametrize("pitch", [0.0, 2.0, 90.0])
def test_at_or_above_the_horizon_is_refused(pitch):
    with pytest.raises(GeometryError, match="horizon") as error:
        measured(**standing(1.6, pitch * DEG), foot=point(799.5, 599.5))
    assert error.value.code == "at_or_above_horizon"


def test_a_point_higher_than_the_camera_is_not_seen_below_it():
    with pytest.raises(GeometryError):
        measured(**standing(1.6, -5 * DEG), foot=point(799.5, 599.5), point_height=exact(2.0))
    with pytest.raises(GeometryError):
        measured(**standing(1.6, -5 * DEG), foot=point(799.5, 599.5), point_height=exact(1.6))


def test_rows_broadcast():
    many = ground_plane.Inputs(
        **{**standing(), "pitch": Quantity(np.linspace(-0.3, 0.2, 5), 0.001, "rad")}, foot=point(799.5, 599.5)
    )
    result = ground_plane.ground_plane(many)
    assert result.ground_distance_m.shape == (5,) and list(result.reason > 0) == [False] * 3 + [True] * 2
    found = propagate.rows(ground_plane.METHOD, many)
    assert found.value[0, 0] == pytest.approx(1.6 / math.tan(0.3))


# -- bad input ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "name"),
    [
        ({"height": exact(0.0)}, "height"), ({"height": exact(-2.0)}, "height"), ({"height": None}, "height"),
        ({"pitch": None}, "pitch"), ({"horizon": point(1, 1)}, "pitch"),
        ({"pitch": None, "parallels": Observation(np.zeros((3, 2)))}, "parallels"),
        ({"pitch": None, "horizon": Observation(np.ones((2, 2)))}, "horizon"),
        ({"height": None, "reference": Observation(np.ones((2, 2)))}, "reference"),
        ({"height": None, "reference": Observation(np.ones((2, 2))), "reference_length": exact(1.0)}, "reference"),
        ({"height": None, "reference": Observation(np.array([[1.0, 2], [3, 4]])), "reference_length": exact(-1.0)}, "reference_length"),
    ],
)  # fmt: skip
def test_standing_that_can_not_be(change, name):
    with pytest.raises(InputError) as error:
        Standing(**{**standing(), **change})
    assert error.value.name == name


PHOTO = Photo(np.zeros((1200, 1600, 3), np.uint8), Metadata(), None, "0" * 64, (), "ground.png")
SAID = GroundTexts(height="1.6 ± 0.02 m", pitch="-5 ± 0.2 deg", roll="0 ± 0.2 deg", slope="0 ± 0.2 deg")
GIVEN = "f=1500 ± 10px"


def document(*feet, said=SAID, camera=GIVEN, **more):
    return ground_document(PHOTO, feet, said=said, camera=camera, **more)


@pytest.mark.parametrize(
    ("texts", "name"),
    [
        ({"height": "0 ± 1 m"}, "--height"), ({"height": "-2 ± 1 m"}, "--height"), ({"height": "1.6 m"}, "--height"),
        ({"height": None}, "--height"), ({"height": "40 ± 1 m above sea"}, "--height"), ({"pitch": "-5 deg"}, "--pitch"),
        ({"pitch": "95 ± 1 deg"}, "--pitch"), ({"pitch": None}, "--pitch"), ({"horizon": "1,500;900,500"}, "--horizon"),
        ({"slope": "70 ± 1 deg"}, "--slope"), ({"dip": "1"}, "--dip"), ({"refraction": "1.2 ± 0.1"}, "--refraction"),
        ({"reference": "1,1;2,2"}, "--reference"), ({"height": None, "reference": "1,900;9,900"}, "--reference-length"),
    ],
)  # fmt: skip
def test_texts_that_can_not_be_used(texts, name):
    from dataclasses import replace

    with pytest.raises(InputError) as error:
        document("800,700", said=replace(SAID, **texts))
    assert error.value.name == name and "\n" not in str(error.value)


def test_a_horizon_through_the_thing_is_refused():
    for line in ("1,700;1500,700", "1,800;1500,800", "1,600;1500,800"):
        with pytest.raises(GeometryError) as error:
            document("800,700", said=GroundTexts(height="1.6 ± 0.02 m", horizon=line))
        assert error.value.code == "at_or_above_horizon"


def test_straight_down_and_straight_up():
    from dataclasses import replace

    down = document("800,700", said=replace(SAID, pitch="-90 ± 1 deg")).measurements[1]
    assert down.value == pytest.approx(1.6, rel=0.01)
    with pytest.raises(GeometryError):
        document("800,700", said=replace(SAID, pitch="90 ± 1 deg"))


def test_nothing_too_many_and_outside():
    with pytest.raises(InputError, match="--point is missing"):
        document()
    with pytest.raises(InputError, match="10000 points"):
        document(";".join("800,700" for _ in range(10_000)))
    with pytest.raises(InputError, match="must lie in it"):
        document("800,1300")


def test_several_points_of_which_one_is_in_the_sky():
    found = document("800,700;800,10")
    assert {m.label for m in found.measurements} == {"point 1"}
    assert [n.text[:8] for n in found.notes if n.code == "refused"] == ["point 2:"]


def test_points_that_coincide_and_points_that_are_not_resolved():
    for ends in ("800,700;800,700", "800,700;800,701"):
        m = document(lengths=[ends]).measurements[0]
        assert m.low == 0 and m.high < 0.3 and "length_not_resolved" in {n.code for n in m.notes}
    far = document(lengths=["400,700;1200,700"]).measurements[0]
    assert far.low > 0 and "length_not_resolved" not in {n.code for n in far.notes}


def test_times():
    assert (read_time("0.5 ± 0.02 s").value, read_time("12:00:01.25 to 12:00:01.75").value) == (0.5, 0.5)
    cut = read_time("2024:05:01 12:00:01 to 2024:05:01 12:00:04")
    assert cut.value == 3 and cut.u == pytest.approx(1 / math.sqrt(6))
    for text in ("1 to 2", "12:00:01 to 12:00:01", "-1 ± 0.1 s", "noon to 12:30"):
        with pytest.raises(InputError, match="--time"):
            read_time(text)
    with pytest.raises(InputError, match="--time is missing"):
        document(moves=["800,700;900,700"])


ZEBRA = "87,982;331,842;1605,969;1379,834;87,982;1605,969;331,842;1379,834"


def test_a_zebra_crossing_gives_height_and_horizon(examples):
    """Its stripes are 3 m long, and their edges level lines in two directions; the person stands 8.05 m away."""
    said = GroundTexts(parallels=ZEBRA, reference="640,980;714,840", reference_length="3 ± 0.02 m", slope="0 exact")
    photo = Photo.load(examples / "street.jpg")
    m = ground_document(photo, ["672,897"], said=said, camera="f=1829 ± 10px").measurements[0]
    assert m.low < 8.05 < m.high and m.u / m.value < 0.02


def test_a_horizon_that_leans_is_doubted():
    said = GroundTexts(height="1.6 ± 0.02 m", horizon="1,200;1500,500")
    assert "horizon_leans" in {n.code for n in document("400,1100", said=said).measurements[0].notes}
    level = GroundTexts(height="1.6 ± 0.02 m", horizon="1,500;1500,510")
    assert "horizon_leans" not in {n.code for n in document("400,1100", said=level).measurements[0].notes}


# -- what the height counts from ---------------------------------------------------------------------------


def drone(**xmp):
    tags = {"GimbalPitchDegree": "-60.0", "GimbalRollDegree": "0.0", "RelativeAltitude": "+40.0", **xmp}
    metadata = Metadata(xmp={f"drone-dji:{name}": value for name, value in tags.items()})
    return Photo(np.zeros((1200, 1600, 3), np.uint8), metadata, None, "0" * 64, (), "drone.jpg")


def test_a_drones_own_height_counts_from_its_take_off():
    found = ground_document(drone(), ["799.5,599.5"], camera=GIVEN)
    far, range_ = found.measurements[:2]
    assert range_.value == pytest.approx(40 / math.sin(60 * DEG), rel=1e-3)
    assert "height_above_takeoff" in {n.code for n in far.notes}
    assert -next(c for c in range_.budget if c.name == "rise").u == pytest.approx(3 / math.sin(60 * DEG), rel=0.02)
    known = ground_document(drone(), ["799.5,599.5"], camera=GIVEN, said=GroundTexts(rise="-5 ± 0.5 m"))
    assert known.measurements[1].value == pytest.approx(45 / math.sin(60 * DEG), rel=1e-3)
    assert "height_above_takeoff" not in {n.code for n in known.measurements[0].notes}
    stated = ground_document(drone(), ["799.5,599.5"], camera=GIVEN, said=GroundTexts(height="40 ± 1 m above ground"))
    assert "height_above_takeoff" not in {n.code for n in stated.measurements[0].notes}


def test_a_drone_below_its_take_off_needs_its_height():
    with pytest.raises(InputError, match="below its take-off"):
        ground_document(drone(RelativeAltitude="-3.0"), ["799.5,599.5"], camera=GIVEN)


# -- beside surveyed points --------------------------------------------------------------------------------


@pytest.mark.opencv
def test_surveyed_points_place_the_camera_and_find_its_focal_length():
    inputs = surveyed_ground.example()
    cov = np.diag([500.0**2, 0, 8.0**2, 8.0**2])
    vague = surveyed_ground.Inputs(**{**vars(inputs), "camera": Camera(1920, 1080, 1100.0, 959.5, 539.5, cov=cov)})
    for told in (inputs, vague):
        far, range_, _, x, y = propagate.measure(surveyed_ground.METHOD, told)
        assert (x.value, y.value) == pytest.approx((2.0, 28.0), abs=0.02)
        assert (
            range_.value == pytest.approx(math.dist((2, 28, 0.4), (0, 0, 8)), rel=1e-3)
            and far.low < math.hypot(2, 28) < far.high
        )


@pytest.mark.opencv
def test_surveyed_points_that_do_not_fit_widen_the_interval():
    inputs = surveyed_ground.example()
    good = propagate.measure(surveyed_ground.METHOD, inputs)[1]
    off = inputs.control.points_px + np.random.default_rng(3).normal(0, 8, inputs.control.points_px.shape)
    bad = propagate.measure(
        surveyed_ground.METHOD, surveyed_ground.Inputs(**{**vars(inputs), "control": Observation(off, 0.7)})
    )
    assert "points_misfit" in {n.code for n in bad[0].notes} and bad[1].u > 3 * good.u
    assert bad[1].low < good.value < bad[1].high


@pytest.mark.opencv
def test_surveys_that_can_not_be():
    inputs = vars(surveyed_ground.example())
    line = Target("survey", np.outer(np.arange(8.0), [1, 2, 0]))
    with pytest.raises(InputError, match="one line"):
        surveyed_ground.Inputs(**{**inputs, "survey": line})
    with pytest.raises(InputError, match="same number"):
        surveyed_ground.Inputs(**{**inputs, "control": Observation(np.zeros((5, 2)))})
    with pytest.raises(GeometryError) as error:
        propagate.measure(surveyed_ground.METHOD, surveyed_ground.Inputs(**{**inputs, "elevation": exact(30.0)}))
    assert error.value.code == "at_or_above_horizon"


# -- terrain models ----------------------------------------------------------------------------------------


def hill(x, y):
    """Heights above the datum: a slope of 10 % to the north, with a hill."""
    return 100 + 0.1 * (y - 5_000_000) + 6 * np.exp(-((x - 500_030) ** 2 + (y - 5_000_140) ** 2) / 1800)


@pytest.fixture
def model(tmp_path):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        rasterio = pytest.importorskip("rasterio")
        from rasterio.transform import Affine

    def write(name="hill.tif", crs="EPSG:32632", shift=None, heights=None):
        shift = shift or Affine(2, 0, 499_700, 0, -2, 5_000_500)
        if heights is None:
            x, y = np.meshgrid(499_701 + 2 * np.arange(300), 5_000_499 - 2 * np.arange(400))
            heights = hill(x, y)
        path = tmp_path / name
        size = {"width": heights.shape[1], "height": heights.shape[0], "count": 1, "dtype": "float32"}
        with (
            warnings.catch_warnings(action="ignore"),
            rasterio.open(path, "w", "GTiff", crs=crs, transform=shift, **size) as out,
        ):
            out.write(heights.astype("float32"), 1)
        return path

    return write


def on_hill(
    path,
    pixel="799.5,599.5",
    height="160 ± 1 m above EGM2008",
    datum="EGM2008",
    position="500000,5000000 ± 2 m",
    pitch="-18 ± 0.3 deg",
):
    told = TerrainTexts(path, position, "15 ± 1 deg", "0.5 m", datum)
    said = GroundTexts(height=height, pitch=pitch, roll="0 ± 0.2 deg")
    return ground_document(PHOTO, [pixel], said=said, terrain=told, camera=GIVEN)


def truth_on_hill(pitch, height=160.0):
    way = np.array([math.sin(15 * DEG) * math.cos(pitch), math.cos(15 * DEG) * math.cos(pitch), math.sin(pitch)])
    t = np.arange(0, 500, 0.01)
    line = np.array([500_000, 5_000_000, height])[:, None] + way[:, None] * t
    return t[np.argmax(line[2] <= hill(line[0], line[1]))]


def test_a_line_of_sight_meets_the_terrain(model):
    found = on_hill(model())
    range_ = found.measurements[1]
    true = truth_on_hill(-18 * DEG)
    assert range_.low < true < range_.high and range_.value == pytest.approx(true, rel=0.005)
    assert {"rise", "pitch", "height"} <= {c.name for c in range_.budget}
    above = on_hill(model(), height="60 ± 1 m above ground").measurements[1]
    assert above.value == pytest.approx(true, rel=0.005)


def test_intervals_on_a_terrain_hold_the_truth(model):
    path, rng = model(), np.random.default_rng(5)
    hits = 0
    for _ in range(20):
        pitch = math.radians(rng.uniform(-25, -14))
        height, told = 160 + rng.normal(0, 1), pitch + math.radians(rng.normal(0, 0.3))
        m = on_hill(
            path, height=f"{160.0} ± 1.96 m above EGM2008", pitch=f"{math.degrees(told)} ± 0.588 deg"
        ).measurements[1]
        hits += m.low <= truth_on_hill(pitch, height) <= m.high
    assert hits >= 16


def test_terrain_models_that_can_not_be_used(model, tmp_path):
    from rasterio.transform import Affine

    with pytest.raises(FileFormatError, match="no georeference"):
        on_hill(model(crs=None))
    with pytest.raises(FileFormatError, match="no georeference"):
        on_hill(model(shift=Affine.identity()))
    with pytest.raises(FileFormatError, match="degrees"):
        on_hill(model(crs="EPSG:4326", shift=Affine(0.001, 0, 9, 0, -0.001, 48)))
    with pytest.raises(FileFormatError, match="no terrain around"):
        on_hill(model(), position="900000,100 ± 2 m")
    with pytest.raises(InputError, match="no vertical datum"):
        on_hill(model(), datum=None)
    with pytest.raises(InputError, match="above EGM2008"):
        on_hill(model(), height="160 ± 1 m above WGS84 ellipsoid")
    with pytest.raises(InputError, match="EGM"):
        on_hill(model(crs="EPSG:32632+3855"), datum="DHHN2016")
    with pytest.raises(InputError, match="take-off"):
        on_hill(model(), height="60 ± 1 m above take-off")
    with pytest.raises(InputError, match="above the camera"):
        on_hill(model(), height="50 ± 1 m above EGM2008")
    with pytest.raises(InputError, match="position"):
        on_hill(model(), position="500000,5000000")
    with pytest.raises(GeometryError, match="terrain"):
        on_hill(model(), pitch="20 ± 1 deg")
    with pytest.raises(FileFormatError, match="no such file"):
        on_hill(tmp_path / "none.tif")
    (tmp_path / "text.tif").write_text("no picture")
    with pytest.raises(FileFormatError, match="GeoTIFF"):
        on_hill(tmp_path / "text.tif")


def test_a_terrain_file_may_name_its_datum(model):
    assert on_hill(model(crs="EPSG:32632+3855"), datum=None, height="160 ± 1 m above EGM2008 height").measurements


def test_a_ridge_that_another_line_of_sight_would_meet_first_is_told(model):
    x, y = np.meshgrid(499_701 + 2 * np.arange(300), 5_000_499 - 2 * np.arange(400))
    ridge = 100 + np.where(abs(y - 5_000_170) < 6, 12.0, 0.0) + 0 * x
    rough = on_hill(model(heights=ridge), pitch="-14 ± 2 deg").measurements[0]
    assert "terrain_uneven" in {n.code for n in rough.notes}
    plain = on_hill(model(heights=100 + 0.02 * (y - 5_000_000) + 0.0 * x), pitch="-18 ± 0.3 deg").measurements[0]
    assert "terrain_uneven" not in {n.code for n in plain.notes}


def test_without_rasterio_a_terrain_model_says_what_to_install(model, monkeypatch):
    import sys

    path = model()
    monkeypatch.setitem(sys.modules, "rasterio", None)
    with pytest.raises(MissingExtraError, match=r"subtense\[terrain\]"):
        on_hill(path)
