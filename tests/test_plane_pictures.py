"""Real pictures with truth (../shared/data): lengths in planes, and heights, by clicks that were made once by hand.

Truths: HGU-CGV height estimation (door 202 cm, lockers 182 cm, taped); coins of the US mint (24.26 and 21.21 mm) beside a business card of
3.5 x 2 in; a computer mouse of 65 mm on a board with a chessboard of 33 mm squares, 70 cm away by hand; a step of about 17 cm (6 %) behind
a bank card; four stakes on a river's water line, all six distances measured.
"""

import json
from dataclasses import dataclass

import numpy as np
import pytest

from subtense import Photo, propagate
from subtense.line_camera import camera_from_lines
from subtense.methods import height, plane, plane_distance
from subtense.observation import Observation
from subtense.quantity import Quantity
from subtense.target import Target
from subtense.workflow.resolve_camera import resolve_camera

pytestmark = pytest.mark.opencv
CLICK_PX = 1.0


@dataclass(frozen=True)
class Case:
    """One number of a picture, and its truth with the half-width that this is known to."""

    name: str
    what: str
    measured: object
    truth: float
    known_to: float

    @property
    def inside(self) -> bool:
        m = self.measured
        return m.low - self.known_to <= self.truth <= m.high + self.known_to


def clicks(*points, sigma=CLICK_PX, label=""):
    return Observation(np.array(points, float).reshape(-1, 2), sigma, label=label)


# -- a corridor: px of i_NTH.jpeg, 1440 x 1080 -------------------------------------------------------------------------

DOOR = clicks(582.0, 713.5, 582.0, 315.5)
LOCKERS = [
    clicks(777.8, 786.8, 789.1, 355.5),
    clicks(901.2, 878.8, 923.9, 350.5),
    clicks(1097.2, 1020.2, 1144.5, 345.5),
]
VERTICALS = clicks(
    302.2, 307.8, 317.5, 739.5, 905.2, 756.2, 920.1, 419.5, 1109.5, 822.8, 1140.5, 419.5, 736.5, 697.5, 741.9, 323.9
)
ALONG = clicks(447, 741, 619.5, 998.5, 359.5, 752, 462, 998.5, 529.5, 729.5, 759.5, 979.5, 777.8, 786.8, 1097.2, 1020.2,
               790.5, 364.9, 1144.5, 360.1)  # fmt: skip
ACROSS = clicks(
    139.5,
    967,
    547,
    889.5,
    274.5,
    836,
    490.5,
    803.5,
    327,
    753.5,
    572,
    719.5,
    3.5,
    531,
    572,
    513,
    581.5,
    315.1,
    746.5,
    323.9,
)
TAPED = 0.005


def corridor(data):
    photo = Photo.load(data / "single_view_metrology" / "corridor" / "i_NTH.jpeg")
    frame = Observation(np.array([[-0.5, -0.5], [photo.width_px - 0.5, photo.height_px - 0.5]]), 0.0)
    told = camera_from_lines(photo.width_px, photo.height_px, VERTICALS, ALONG, ACROSS, k1_u=0.02)
    door, locker = Quantity.normal(2.02, 0.007, "m"), Quantity.normal(1.82, 0.007, "m")
    for way, more in (
        ("level lines", {"parallels": ALONG, "others": ACROSS, "frame": frame}),
        ("camera from lines", {"camera": told.camera}),
    ):
        for number, one in enumerate(LOCKERS, 1):
            found = propagate.measure(height.METHOD, height.Inputs(VERTICALS, DOOR, one, door, **more), draws=20_000)[0]
            yield Case("corridor", f"locker {number} by the door, {way}", found, 1.82, TAPED)
        found = propagate.measure(
            height.METHOD, height.Inputs(VERTICALS, LOCKERS[0], DOOR, locker, **more), draws=20_000
        )[0]
        yield Case("corridor", f"door by locker 1, {way}", found, 2.02, TAPED)


# -- things in a plane -------------------------------------------------------------------------------------------------


def coins(data):
    photo = Photo.load(data / "reference_object" / "coins_card" / "example_01.png")
    frame = Observation(np.array([[-0.5, -0.5], [photo.width_px - 0.5, photo.height_px - 0.5]]), 0.0)
    card = clicks(172.5, 95.2, 342.2, 60.2, 361.5, 156.8, 193.2, 191.8, sigma=0.7)
    target = Target.rectangle(
        Quantity.normal(0.0889, 0.0004, "m"), Quantity.normal(0.0508, 0.0004, "m"), "business card"
    )
    things = {"left quarter": ((42.2, 212.8, 90.2, 212.8), 0.02426), "right quarter": ((347.8, 205.5, 394.5, 205.5), 0.02426),
              "nickel": ((498.8, 226.5, 540.2, 226.5), 0.02121)}  # fmt: skip
    for name, (ends, true) in things.items():
        [found] = propagate.measure(plane.METHOD, plane.Inputs(card, target, clicks(*ends, sigma=0.7), frame=frame))
        yield Case("coins and card", name, found, true, 0.0)


def board(data):
    import cv2

    photo = Photo.load(data / "reference_object" / "mouse_on_chessboard" / "object.jpg")
    gray = cv2.cvtColor(photo.pixels, cv2.COLOR_RGB2GRAY)
    corners = cv2.findChessboardCornersSB(gray, (7, 5))[1].reshape(-1, 2).astype(float)
    grid = 0.033 * np.column_stack(
        [*(axis.T.reshape(-1) for axis in np.meshgrid(np.arange(7), np.arange(5), indexing="ij")), np.zeros(35)]
    )
    target = Target("chessboard", grid, 0.003)
    camera = resolve_camera(photo, "f=693.6px ± 1%").camera
    seen = Observation(corners, 0.3)
    wide = plane.Inputs(seen, target, clicks(676.2, 155.2, 751.4, 151.0), camera, Quantity.normal(0.010, 0.005, "m"))
    yield Case("mouse on a board", "width", propagate.measure(plane.METHOD, wide)[0], 0.065, 0.001)
    spot = plane_distance.Inputs(camera, seen, target, Observation(corners[17:18], 0.3))
    yield Case(
        "mouse on a board", "distance of the board", propagate.measure(plane_distance.METHOD, spot)[1], 0.70, 0.02
    )


def step(data):
    photo = Photo.load(data / "reference_object" / "step_card" / "stepA_1.jpg")
    card = clicks(360.9, 355.9, 507.9, 348.9, 503.1, 425.1, 362.5, 433.5, sigma=0.7)
    target = Target.rectangle(Quantity.normal(0.0856, 0.0001, "m"), Quantity.normal(0.05398, 0.0001, "m"), "bank card")
    camera = resolve_camera(photo).camera
    nose = Quantity.normal(0.01, 0.01, "m")  # the upper edge overhangs, the lower end does not
    inputs = plane.Inputs(card, target, clicks(432.8, 429.3, 431.0, 155.6), camera, nose)
    yield Case("step and card", "height of the step", propagate.measure(plane.METHOD, inputs)[0], 0.17, 0.06 * 0.17)


# -- a water line: four stakes, five of their distances place them, the sixth is measured in the picture ------------------


def beside(r1, r3, base, side):
    """The point r1 from the origin and r3 from (base, 0), on one side of the line between them."""
    x = (r1**2 - r3**2 + base**2) / (2 * base)
    return x, side * np.sqrt(r1**2 - x**2), 0.0


def water_line(data):
    folder = data / "ground_plane" / "river_pisco"
    told = json.loads((folder / "truth.json").read_text())
    photo = Photo.load(folder / "pisco.jpg")
    base = told["d13"]
    stakes = np.array(
        [(0, 0, 0), beside(told["d12"], told["d23"], base, 1), (base, 0, 0), beside(told["d41"], told["d34"], base, -1)]
    )
    seen = clicks(*(told["px"][name] for name in "1234"))
    frame = Observation(np.array([[-0.5, -0.5], [photo.width_px - 0.5, photo.height_px - 0.5]]), 0.0)
    across = clicks(told["px"]["2"], told["px"]["4"])
    inputs = plane.Inputs(seen, Target("stakes", stakes, sigma_m=0.03), across, frame=frame)
    yield Case(
        "river, stakes on the water line",
        "sixth distance",
        propagate.measure(plane.METHOD, inputs)[0],
        told["d24"],
        0.05,
    )


PICTURES = (corridor, coins, board, step, water_line)


@pytest.mark.parametrize("picture", PICTURES)
def test_the_truth_is_in_the_interval(shared_data, picture):
    cases = list(picture(shared_data))
    wrong = [f"{c.what}: {c.measured.low:.4f} to {c.measured.high:.4f}, truth {c.truth}" for c in cases if not c.inside]
    assert not wrong
