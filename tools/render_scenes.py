"""The five example scenes: geometry, camera, nominal data and the points of the truth file."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
import render_shapes as rs
import render_textures as tx
from render_lens import (
    Camera,
    Nominal,
    look_at,
    rotation_x,
    rotation_y,
    rotation_z,
)

CORNERS = ("top_left", "top_right", "bottom_right", "bottom_left")


@dataclass
class Thing:
    """A measured object: its size and its named world points."""

    name: str
    what: str
    size_m: dict
    points: dict
    check: bool = False


@dataclass
class Shot:
    """One picture to take."""

    file: str
    scene: rs.Scene
    camera: Camera
    nominal: Nominal
    exposure: float
    seed: int
    things: list[Thing] = field(default_factory=list)
    orientation: int = 1
    notes: str = ""
    samples: int = 20
    quality: int = 92


def quad(name: str, what: str, size: dict, corners: np.ndarray, check: bool = True) -> Thing:
    """A rectangle with corners in the order of ``CORNERS``."""
    return Thing(name, what, size, dict(zip(CORNERS, corners, strict=True)), check)


def shifted(point, dx: float, dy: float, dz: float) -> np.ndarray:
    """A point moved by (dx, dy, dz)."""
    return np.add(point, (dx, dy, dz))


def add_all(scene: rs.Scene, items) -> None:
    """Add several shapes."""
    for item in items:
        scene.add(item)


# ---------------------------------------------------------------- desk


def desk() -> Shot:
    """A4 sheet, bank card and marker on a wooden desk, seen at 35 degrees from vertical."""
    scene = rs.Scene()
    top = rs.glossy(rs.image(tx.wood((2000, 3600), 11)), 0.25)
    scene.add(rs.panel((-0.9, 0.8, 0), (0.9, 0.8, 0), (-0.9, -0.45, 0), top))
    things = desk_objects(scene)
    desk_props(scene)
    scene.add(rs.area_light((-1.1, 0.9, 1.5), (0, 0.1, 0), 1.3, 1.1, (7.0, 6.7, 6.2)))
    scene.add({"type": "constant", "radiance": rs.colour((0.50, 0.54, 0.60))})
    target = np.array([0.0, 0.03, 0.0])
    tilt, turn = np.radians(35.0), np.radians(4.0)
    away = np.array([np.sin(tilt) * np.sin(turn), -np.sin(tilt) * np.cos(turn), np.cos(tilt)])
    centre = target + 0.63 * away
    camera = Camera(
        1600, 1200, 1207.9, 807.4, 593.2, (0.021, -0.034, 0.0004, -0.0003, 0.0),
        look_at(centre, target, 0.6), centre,
    )  # fmt: skip
    nominal = Nominal("Phone 26", 5.65, 7.53, 5.65)
    return Shot("desk.jpg", scene, camera, nominal, 1.03, 1, things)


def desk_objects(scene: rs.Scene) -> list[Thing]:
    """The three flat objects of known size."""
    paper, a4 = rs.flat((-0.135, 0.035, 0.0001), 0.210, 0.297, 7.0, rs.matte(rs.image(tx.a4_sheet())))
    print_, page = rs.flat((0.085, 0.085, 0.0002), 0.070, 0.070, -11.0, rs.matte(rs.image(tx.marker_print(7))))
    middle = page.mean(axis=0)
    black = middle + (page - middle) * (50 / 70)
    face = rs.glossy(rs.image(tx.bank_card()), 0.15)
    body, card = rs.rounded_card(np.array([0.085, -0.055, 0.0]), 14.0, (0.0856, 0.05398), 0.00318, 0.00076, face)
    add_all(scene, (paper, print_, body))
    sheet_size = {"width": 0.210, "height": 0.297}
    return [
        quad("a4", "A4 sheet lying on the desk", sheet_size, a4),
        quad(
            "card",
            "ISO/IEC 7810 ID-1 card, top face; points are the virtual sharp corners",
            {"width": 0.0856, "height": 0.05398, "corner_radius": 0.00318, "thickness": 0.00076},
            card,
        ),
        quad(
            "marker",
            "AprilTag 36h11 id 7, black square with a 10 mm white border; corners as printed",
            {"side": 0.050, "border": 0.010},
            black,
        ),
    ]


def desk_props(scene: rs.Scene) -> None:
    """Mug with coffee, pencil, eraser and a stack of books."""
    add_mug(scene, np.array([0.245, 0.225, 0.0]))
    start, end = np.array([0.190, -0.150, 0.0037]), np.array([0.235, 0.020, 0.0037])
    axis = (end - start) / np.linalg.norm(end - start)
    scene.add(rs.tube([start, (start + end) / 2, end], [0.0037] * 3, rs.glossy(tx.rgb("e2a31c")),
                      20, 6, False))  # fmt: skip
    tip = end + axis * 0.017
    scene.add(rs.tube([end, (end + tip) / 2, tip], [0.0036, 0.0018, 0.0005],
                      rs.matte(tx.rgb("d9b78a")), 12))  # fmt: skip
    scene.add(rs.tube([tip - axis * 0.004, tip - axis * 0.002, tip], [0.0010, 0.0008, 0.0005],
                      rs.matte(0.03), 8))  # fmt: skip
    tail = start - axis * 0.012
    scene.add(rs.tube([start, (start + tail) / 2, tail], [0.0040, 0.0040, 0.0038],
                      rs.matte(tx.rgb("c96a6a")), 12))  # fmt: skip
    add_all(
        scene,
        rs.box(
            (-0.44, 0.30, 0.0),
            (-0.14, 0.50, 0.030),
            {"front": rs.matte(0.72)},
            rs.glossy(tx.rgb("27506b"), 0.3),
        ),
    )
    add_all(
        scene,
        rs.box(
            (-0.42, 0.31, 0.031),
            (-0.17, 0.48, 0.055),
            {"front": rs.matte(0.68)},
            rs.glossy(tx.rgb("9c3a2c"), 0.3),
        ),
    )


def add_mug(scene: rs.Scene, base: np.ndarray) -> None:
    """A glazed mug, its handle and the coffee in it."""
    glaze = rs.glossy(tx.rgb("dfe6e2"), 0.08)
    outer = [(0.001, 0.001), (0.034, 0.001), (0.038, 0.004), (0.040, 0.02), (0.041, 0.05),
             (0.0412, 0.088), (0.0405, 0.091), (0.039, 0.092), (0.0375, 0.091),
             (0.037, 0.088), (0.036, 0.03), (0.030, 0.008), (0.001, 0.006)]  # fmt: skip
    scene.add(rs.lathe(base, outer, glaze))
    coffee = rs.glossy(tx.rgb("2a140a"), 0.06)
    scene.add(rs.lathe(base, [(0.0368, 0.068), (0.0368, 0.0705), (0.0005, 0.0705)], coffee, 96,
                       False))  # fmt: skip
    loop = [(0.039, 0, 0.074), (0.058, 0, 0.076), (0.068, 0, 0.052), (0.058, 0, 0.026),
            (0.039, 0, 0.022)]  # fmt: skip
    turn = rotation_z(-35.0)
    path = [base + turn @ np.array(p) for p in loop]
    scene.add(rs.tube(path, [0.0065, 0.0055, 0.005, 0.0055, 0.0065], glaze, 60))


# ---------------------------------------------------------------- belt


def belt() -> Shot:
    """A cardboard package on a conveyor belt seen from straight above."""
    scene = rs.Scene()
    rubber = rs.matte(rs.image(tx.belt(), (3, 6)))
    scene.add(rs.panel((-0.23, 0.5, 0), (0.23, 0.5, 0), (-0.23, -0.5, 0), rubber))
    steel = rs.matte(rs.image(tx.mottled((64, 1024), "9aa0a4", (16, 2), 60, 0.05)))
    for side in (-1, 1):
        low, high = sorted((side * 0.235, side * 0.275))
        add_all(scene, rs.box((low, -0.6, -0.05), (high, 0.6, 0.02), {}, steel))
        for y in (-0.3, -0.1, 0.1, 0.3):
            scene.add(rs.lathe((side * 0.255, y, 0.02),
                               [(0.007, 0.0), (0.007, 0.004), (0.001, 0.005)], rs.glossy(0.25, 0.2),
                               6, False))  # fmt: skip
    floor = rs.matte(rs.image(tx.mottled((512, 512), "77787a", (8, 8), 61, 0.06)))
    scene.add(rs.panel((-1, 1, -0.6), (1, 1, -0.6), (-1, -1, -0.6), floor))
    x0, x1, y0, y1, z = -0.108, 0.092, -0.068, 0.082, 0.120
    side = rs.matte(tx.rgb("b98d58"))
    top = rs.matte(rs.image(tx.package_top()))
    add_all(scene, rs.box((x0, y0, 0.0), (x1, y1, z), {"top": top}, side))
    scene.add(rs.area_light((-0.8, 0.5, 1.9), (0, 0, 0), 0.9, 0.9, (9.5, 9.3, 9.0)))
    scene.add({"type": "constant", "radiance": rs.colour((0.55, 0.57, 0.60))})
    centre = np.array([0.006, -0.004, 1.1265])
    rotation = rotation_x(0.14) @ rotation_y(-0.11) @ rotation_z(0.20) @ np.diag([1.0, -1, -1])
    camera = Camera(1600, 1200, 2685.3, 792.6, 604.7, (-0.072, 0.085, -0.0002, 0.0003, 0.0), rotation, centre)
    things = [belt_package(x0, x1, y0, y1, z)]
    nominal = Nominal("Belt 12", 12.0, 7.2, 5.4, focal_plane_resolution=True)
    return Shot("belt.jpg", scene, camera, nominal, 1.10, 2, things)


def belt_package(x0: float, x1: float, y0: float, y1: float, z: float) -> Thing:
    """Corners and side middles of the package's top face."""
    corners = np.array([(x0, y1, z), (x1, y1, z), (x1, y0, z), (x0, y0, z)])
    size = {"width": x1 - x0, "depth": y1 - y0, "height": z}
    size = {key: round(value, 6) for key, value in size.items()}
    what = "cardboard package, top face; width along image x, height above the belt at z = 0"
    package = quad("package_top", what, size, corners)
    package.points["left_edge_middle"] = np.array([x0, (y0 + y1) / 2, z])
    package.points["right_edge_middle"] = np.array([x1, (y0 + y1) / 2, z])
    return package


# ---------------------------------------------------------------- street


def street() -> Shot:
    """A person at 8 m on a crossing and a van at 14 m."""
    scene = rs.Scene()
    scene.add(rs.sky_light(tx.sky(70), 0.62))
    scene.add(rs.sun((-0.42, -0.85, 0.80), (2.6, 2.4, 2.05)))
    stripes = street_ground(scene)
    street_houses(scene)
    street_green(scene)
    person = add_person(scene, np.array([-1.05, 8.0, 0.0]))
    van = add_van(scene, 0.35, 14.0)
    centre = np.array([-0.15, 0.0, 1.60])
    target = shifted(centre, np.sin(np.radians(1.0)), np.cos(np.radians(1.0)), -np.tan(np.radians(2.0)))
    camera = Camera(
        1800, 1200, 1829.4, 906.8, 596.1, (-0.062, 0.031, 0.0003, 0.0002, 0.0),
        look_at(centre, target, -0.3), centre,
    )  # fmt: skip
    nominal = Nominal("Cam 24", 24.0, 23.5, 15.67)
    return Shot("street.jpg", scene, camera, nominal, 1.42, 3, [person, *van, *stripes], samples=9)


def street_ground(scene: rs.Scene) -> list[Thing]:
    """Road with markings, kerbs and pavements (0.12 m above the road); returns the stripes."""
    tar = tx.mottled((1024, 1024), "66676a", (24, 24), 71, 0.06)
    road = rs.matte(rs.image(tar, (2, 30)))
    scene.add(rs.panel((-3.2, 90, 0), (3.2, 90, 0), (-3.2, -6, 0), road))
    paint = rs.matte(rs.image(tx.mottled((256, 256), "dcdad2", (12, 12), 72, 0.06)))
    stripes = []
    for index, x in enumerate(np.arange(-2.75, 3.0, 1.0)):
        stripe, corners = rs.flat((x, 8.0, 0.0003), 0.5, 3.0, 0.0, paint)
        scene.add(stripe)
        size = {"width": 0.5, "length": 3.0}
        stripes.append(quad(f"stripe_{index}", "painted stripe on the road", size, corners,
                            index != 1))  # fmt: skip
    for y in np.arange(12.5, 80, 6.0):
        scene.add(rs.flat((-0.95, y, 0.0003), 0.12, 2.5, 0.0, paint)[0])
    stone = rs.matte(rs.image(tx.slabs(512, 1, 73, "b0aca4"), (1, 60)))
    paving = rs.matte(rs.image(tx.slabs(1024, 8, 74, "9a958c"), (0.8, 24)))
    for side in (-1, 1):
        inner, kerb, outer = 3.2 * side, 3.4 * side, 6.6 * side
        low, high = sorted((inner, kerb))
        add_all(scene, rs.box((low, -6, 0), (high, 90, 0.12), {"top": stone}, stone))
        low, high = sorted((kerb, outer))
        scene.add(rs.panel((low, 90, 0.12), (high, 90, 0.12), (low, -6, 0.12), paving))
    grass = rs.matte(rs.image(tx.mottled((512, 512), "6d7f4a", (20, 20), 75, 0.2), (40, 20)))
    scene.add(rs.panel((-200, 300, -0.02), (200, 300, -0.02), (-200, 84, -0.02), grass))
    return stripes


def street_houses(scene: rs.Scene) -> None:
    """Two rows of terraced houses and a closing block."""
    walls = ("c9b596", "b0603f", "d8d0c0", "8f9aa0", "c58f6a", "e0c890", "a4533f", "b9b4a8")
    for side in (-1, 1):
        y = 1.0
        for index in range(8):
            floors = (3, 4, 3, 2, 4, 3, 3, 4)[(index + 3 * (side > 0)) % 8]
            wall = walls[(index * 3 + 2 * (side > 0)) % 8]
            front = rs.matte(rs.image(tx.house_front(100 + index + 20 * side, wall, floors, 4)))
            low, high = sorted((6.6 * side, 14.6 * side))
            gable = rs.matte(tx.rgb(wall) * 0.9)
            name = "right" if side < 0 else "left"
            add_all(scene, rs.box((low, y, 0.12), (high, y + 10, 0.12 + 3 * floors), {name: front},
                                  gable))  # fmt: skip
            low, high = sorted((6.45 * side, 14.6 * side))
            add_all(scene, rs.box((low, y, 0.12 + 3 * floors), (high, y + 10, 0.4 + 3 * floors), {},
                                  rs.matte(tx.rgb("5a5450"))))  # fmt: skip
            y += 10.0
    front = rs.matte(rs.image(tx.house_front(140, "c4b7a2", 3, 14)))
    add_all(scene, rs.box((-17.5, 118, 0), (17.5, 126, 9), {"front": front}, rs.matte(0.4)))


def street_green(scene: rs.Scene) -> None:
    """Trees on the pavements and lamp posts."""
    bark, iron = rs.matte(tx.rgb("5b4a3a")), rs.glossy(tx.rgb("2f3a38"), 0.3)
    greens = [rs.matte(tx.rgb(c)) for c in ("4f6d2f", "5f7d38", "6f8c42", "43602a")]
    spots = [(-4.3, 21), (-4.3, 33), (4.3, 27), (4.3, 40), (-4.3, 47), (4.3, 55), (-4.3, 62)]
    spots += [(-9, 95), (-3, 104), (5, 98), (11, 106), (0, 110), (-14, 108)]
    for x, y in spots:
        scene.add(rs.tube([(x, y, 0), (x + 0.05, y, 1.3), (x, y, 2.8)], [0.13, 0.10, 0.08], bark))
        seed = 1000 + int(x * 7 + y * 31)
        crown = rs.foliage((x, y, 3.9), (1.35, 1.35, 1.5), 5200, 0.19, greens, seed)
        add_all(scene, crown)
    for x, y in ((3.65, 17.5), (-3.65, 28.0), (3.65, 45.0)):
        scene.add(rs.tube([(x, y, 0.1), (x, y, 2.5), (x, y, 4.6)], [0.06, 0.045, 0.04], iron))
        scene.add(rs.ellipsoid((x, y, 4.75), (0.16, 0.16, 0.22), rs.glossy(0.75, 0.1)))


def add_person(scene: rs.Scene, at: np.ndarray) -> Thing:
    """Standing person of 1.75 m, facing the camera."""
    skin, hair = rs.matte(tx.rgb("d9a585")), rs.matte(tx.rgb("3a2a20"))
    coat, trousers = rs.matte(tx.rgb("a8352c")), rs.matte(tx.rgb("2c3650"))
    shoes, shirt = rs.glossy(tx.rgb("4a2f20"), 0.2), rs.matte(tx.rgb("e6e2d8"))

    def loft(sections, material):
        table = np.add(sections, (at[2], at[0], at[1], 0, 0))
        scene.add(rs.loft(table, material))

    for s in (-1, 1):
        loft([(0.07, 0.11 * s, 0, 0.055, 0.062), (0.28, 0.108 * s, 0, 0.06, 0.066),
              (0.50, 0.104 * s, 0, 0.067, 0.07), (0.72, 0.098 * s, 0, 0.08, 0.085),
              (0.93, 0.088 * s, 0, 0.088, 0.10)], trousers)  # fmt: skip
        loft(
            [
                (0.0, 0.115 * s, -0.045, 0.045, 0.130),
                (0.03, 0.115 * s, -0.045, 0.049, 0.134),
                (0.065, 0.113 * s, -0.03, 0.045, 0.105),
                (0.10, 0.11 * s, 0, 0.045, 0.06),
            ],
            shoes,
        )
        arm = [
            at + p
            for p in np.array(
                [
                    (0.165 * s, 0, 1.395),
                    (0.208 * s, 0.01, 1.26),
                    (0.230 * s, 0.02, 1.10),
                    (0.242 * s, -0.03, 0.88),
                ]
            )
        ]
        scene.add(rs.tube(arm, [0.053, 0.052, 0.046, 0.038], coat))
        hand = at + np.array([0.243 * s, -0.045, 0.80])
        scene.add(rs.ellipsoid(hand, (0.030, 0.045, 0.078), skin))
        scene.add(rs.ellipsoid(shifted(at, 0.075 * s, 0.005, 1.625), (0.018, 0.025, 0.034), skin))
        scene.add(rs.ellipsoid(shifted(at, 0.030 * s, -0.086, 1.645), (0.010, 0.008, 0.006),
                               rs.matte(0.03)))  # fmt: skip
    loft([(0.80, 0, 0, 0.192, 0.132), (0.92, 0, 0, 0.184, 0.126), (1.07, 0, 0, 0.166, 0.114),
          (1.22, 0, 0, 0.176, 0.118), (1.34, 0, 0, 0.186, 0.114), (1.42, 0, 0, 0.178, 0.100),
          (1.47, 0, 0, 0.105, 0.075), (1.495, 0, 0, 0.062, 0.060)], coat)  # fmt: skip
    scene.add(rs.ellipsoid(shifted(at, 0, -0.045, 1.455), (0.044, 0.045, 0.045), shirt))
    neck = [shifted(at, 0, 0.01, 1.44), shifted(at, 0, 0.005, 1.50), shifted(at, 0, 0, 1.56)]
    scene.add(rs.tube(neck, [0.055, 0.052, 0.050], skin))
    scene.add(rs.ellipsoid(shifted(at, 0, 0, 1.625), (0.074, 0.094, 0.116), skin))
    scene.add(rs.ellipsoid(shifted(at, 0, -0.092, 1.612), (0.012, 0.018, 0.022), skin))
    scene.add(rs.ellipsoid(shifted(at, 0, 0.010, 1.665), (0.083, 0.095, 0.085), hair))
    points = {"soles": at, "head_top": shifted(at, 0, 0.010, 1.75)}
    what = "standing person; soles on the road midway between the feet, top of the hair"
    return Thing("person", what, {"height": 1.75}, points)


def add_van(scene: rs.Scene, left: float, y: float) -> list[Thing]:
    """Boxy van with a flat rear face at depth y."""
    right, bottom, top, back = left + 1.80, 0.28, 1.50, y + 4.40
    paint = rs.matte(tx.rgb("3a7cae"))
    add_all(scene, rs.box((left, y, bottom), (right, back - 0.9, top), {}, paint))
    add_all(scene, rs.box((left, back - 0.9, bottom), (right, back, 0.95), {}, paint))
    dark = rs.matte(0.02)
    scene.add(rs.panel((left + 0.1, y + 0.1, bottom - 0.02), (right - 0.1, y + 0.1, bottom - 0.02),
                       (left + 0.1, back, bottom - 0.02), dark))  # fmt: skip
    for x in (left + 0.12, right - 0.12):
        for axle in (y + 0.75, back - 0.8):
            disc = [(x - 0.1, axle, 0.30), (x, axle, 0.30), (x + 0.1, axle, 0.30)]
            scene.add(wheel(disc, 0.30, dark))
    e = y - 0.0003

    def decal(x0, x1, z0, z1, material):
        scene.add(rs.panel((left + x0, e, z1), (left + x1, e, z1), (left + x0, e, z0), material))

    decal(0.20, 1.60, 0.93, 1.38, rs.matte((0.030, 0.036, 0.042)))
    decal(0.04, 0.17, 0.70, 1.12, rs.matte(tx.rgb("b3141a")))
    decal(1.63, 1.76, 0.70, 1.12, rs.matte(tx.rgb("b3141a")))
    decal(0.0, 1.80, 0.30, 0.46, rs.matte(0.05))
    decal(0.86, 0.94, 0.84, 0.88, rs.matte(0.5))
    decal(0.62, 0.66, 0.95, 1.10, rs.matte(0.015))
    e = y - 0.0006
    decal(0.64, 1.16, 0.58, 0.69, rs.matte(tx.rgb("ece8da")))
    corners = np.array([(left, y, top), (right, y, top), (right, y, bottom), (left, y, bottom)])
    plate = np.array([(left + a, e, b) for a, b in ((0.64, 0.69), (1.16, 0.69), (1.16, 0.58),
                                                    (0.64, 0.58))])  # fmt: skip
    size = {"width": 1.80, "height": 1.50, "length": 4.40, "rear_face_height": 1.22}
    what = "van; points are the flat rear face, its lower edge 0.28 m and its upper 1.50 m up"
    return [
        quad("car_rear", what, size, corners, False),
        quad("number_plate", "number plate", {"width": 0.52, "height": 0.11}, plate),
    ]


def wheel(axis, radius: float, material):
    """Wheel about an x-directed axis."""
    a, b = np.asarray(axis[0]), np.asarray(axis[-1])
    angle = np.arange(48) * 2 * np.pi / 48
    ring = np.stack([np.zeros(48), radius * np.cos(angle), radius * np.sin(angle)], -1)
    return rs.ring_mesh(np.stack([a + 0.7 * ring, a + ring, b + ring, b + 0.7 * ring]), material,
                        False)  # fmt: skip


# ---------------------------------------------------------------- stereo


def stereo() -> tuple[Shot, Shot]:
    """A room with a laid table, seen by two cameras 120 mm apart."""
    scene = rs.Scene(5)
    stereo_room(scene)
    stereo_table(scene)
    scene.add(rs.area_light((-0.9, 1.2, 2.9), (0.1, 1.9, 0.6), 1.8, 1.4, (8.0, 7.6, 7.0)))
    scene.add({"type": "constant", "radiance": rs.colour((0.50, 0.52, 0.56))})
    centre = np.array([0.0, 0.0, 1.30])
    left_rotation = rotation_x(12.0) @ look_at((0, 0, 0), (0, 1, 0))
    right_rotation = rotation_x(0.08) @ rotation_y(-0.12) @ rotation_z(0.05) @ left_rotation
    inner = (1600, 1200, 1789.6, 805.3, 594.8, (-0.055, 0.042, 0.0002, -0.0003, 0.0))
    left = Camera(*inner, left_rotation, centre)
    right = Camera(*inner, right_rotation, centre + left_rotation[0] * 0.120)
    nominal = Nominal("Stereo 8", 8.0, 7.2, 5.4)
    note = "right camera centre is at (0.120, 0, 0) m in left camera axes"
    return (
        Shot("stereo_left.jpg", scene, left, nominal, 0.80, 4, notes=note),
        Shot("stereo_right.jpg", scene, right, nominal, 0.80, 5, notes=note),
    )


def stereo_room(scene: rs.Scene) -> None:
    """Floor, rug, brick wall at 4 m, shelf and poster."""
    wall = rs.matte(rs.image(tx.bricks(30, 10, 110, ("c9b8a0", "b39c80"), "d8d0c4"), (2.5, 1.6)))
    scene.add(rs.panel((-3, 4.0, 3.2), (3, 4.0, 3.2), (-3, 4.0, 0), wall))
    floor = rs.matte(rs.image(tx.wood((1600, 1600), 111, 16, "b98a5c", "80573a"), (2, 2)))
    scene.add(rs.panel((-3, 4.2, 0), (3, 4.2, 0), (-3, -1, 0), floor))
    rug = rs.matte(rs.image(tx.speckled((700, 900), "7a2f35", "c9a27a", 112, 14)))
    scene.add(rs.flat((0.2, 2.75, 0.008), 2.4, 1.5, 4.0, rug)[0])
    frame = rs.matte(rs.image(tx.poster()))
    add_all(scene, rs.box((-1.35, 3.96, 1.05), (-0.35, 3.995, 1.75), {"front": frame},
                          rs.matte(0.08)))  # fmt: skip
    timber = rs.matte(rs.image(tx.wood((300, 1200), 113, 1, "9a6a3e", "6b4426")))
    for z in (0.10, 0.52, 0.94, 1.36):
        add_all(scene, rs.box((0.25, 3.62, z - 0.03), (1.55, 3.98, z), {}, timber))
    for x in (0.22, 1.55):
        add_all(scene, rs.box((x, 3.62, 0), (x + 0.03, 3.98, 1.40), {}, timber))
    for row, z in enumerate((0.10, 0.52, 0.94)):
        spines = rs.matte(rs.image(tx.book_spines(120 + row, 18)))
        add_all(scene, rs.box((0.27, 3.68, z), (1.53, 3.96, z + 0.34), {"front": spines},
                              rs.matte(0.3)))  # fmt: skip
    pot = [(0.06, 0.0), (0.10, 0.02), (0.13, 0.12), (0.11, 0.24), (0.05, 0.30), (0.06, 0.34)]
    scene.add(rs.lathe((0.95, 3.80, 1.361), pot, rs.glossy(tx.rgb("3f7a78"), 0.1)))


def stereo_table(scene: rs.Scene) -> None:
    """Table top with boxes, a ball, books and a vase at 1 to 2.2 m."""
    cloth = rs.matte(rs.image(tx.speckled((1500, 1800), "cfc4ac", "a59f8a", 130, 14)))
    add_all(scene, rs.box((-0.95, 0.70, 0.68), (0.95, 2.20, 0.72), {"top": cloth},
                          rs.matte(tx.rgb("6b4426"))))  # fmt: skip
    for x in (-0.9, 0.84):
        for y in (0.76, 2.09):
            add_all(scene, rs.box((x, y, 0), (x + 0.06, y + 0.06, 0.68), {}, rs.matte(0.12)))
    boxes = [
        ((-0.62, 1.42, 0.72), (-0.36, 1.62, 1.06), "c7502e", "f0d9a0", 140),
        ((0.18, 1.75, 0.72), (0.52, 1.98, 1.00), "2f5f8c", "d9e2e6", 150),
        ((-0.20, 1.12, 0.72), (-0.02, 1.28, 0.84), "3c6b45", "dfe0b8", 160),
    ]
    for low, high, base, spots, seed in boxes:
        faces = {}
        for index, name in enumerate(("front", "left", "right", "top")):
            picture = tx.speckled((420, 420), base, spots, seed + index, 28)
            faces[name] = rs.matte(rs.image(picture))
        add_all(scene, rs.box(low, high, faces, rs.matte(0.2)))
    ball = tx.speckled((512, 1024), "d8b23a", "6a3f78", 170, 40)
    scene.add({"type": "sphere", "center": [0.20, 1.36, 0.83], "radius": 0.11,
               "bsdf": rs.matte(rs.image(ball))})  # fmt: skip
    for index, (tint, turn) in enumerate((("8c2f45", 12), ("d9c79a", 4), ("2f5d7c", 20))):
        add_book(scene, np.array([0.50, 1.22, 0.72 + 0.035 * index]), tint, turn, 180 + 2 * index)
    vase = [(0.05, 0.0), (0.075, 0.03), (0.085, 0.12), (0.06, 0.22), (0.035, 0.28), (0.045, 0.32)]
    scene.add(rs.lathe((-0.15, 1.95, 0.721), vase, rs.glossy(tx.rgb("d8d4c8"), 0.1)))


def add_book(scene: rs.Scene, corner: np.ndarray, tint: str, turn: float, seed: int) -> None:
    """A lying book with a mottled cover."""
    cover = rs.matte(rs.image(tx.speckled((300, 400), tint, "e8e2d0", seed, 40)))
    top, c = rs.flat(shifted(corner, 0, 0, 0.0349), 0.24, 0.17, turn, cover)
    scene.add(top)
    down = np.array([0, 0, -0.0345])
    spine = rs.matte(tx.rgb(tint) * 0.8)
    for a, b in ((3, 2), (0, 3), (2, 1), (1, 0)):
        scene.add(rs.panel(c[a], c[b], c[a] + down, spine))


# ---------------------------------------------------------------- facade

BAY, FLOOR, FLOORS = 2.40, 2.75, 4


def facade() -> Shot:
    """Brick facade turned 35 degrees, portrait picture stored with EXIF orientation 6."""
    scene = rs.Scene()
    scene.add(rs.sky_light(tx.sky(200), 0.60))
    scene.add(rs.sun((-0.62, -0.80, 0.75), (2.5, 2.3, 2.0)))
    things = add_facade(scene)
    facade_ground(scene)
    centre = np.array([-6.9, -9.83, 1.62])
    yaw, pitch = np.radians(35.0), np.radians(9.0)
    target = shifted(centre, np.sin(yaw), np.cos(yaw), np.tan(pitch))
    camera = Camera(
        1200, 1800, 1387.5, 604.6, 893.9, (-0.078, 0.062, -0.0004, 0.0003, 0.0),
        look_at(centre, target, 0.4), centre,
    )  # fmt: skip
    nominal = Nominal("Cam 18", 18.0, 15.67, 23.5)
    return Shot("facade.jpg", scene, camera, nominal, 1.36, 6, things, orientation=6,
                samples=9, quality=88)  # fmt: skip


def openings() -> list[tuple[str, float, float, float, float]]:
    """Name and x0, x1, z0, z1 of every window and of the door at x = 0."""
    out = []
    for floor in range(FLOORS):
        for bay in range(-3, 6):
            x, z = bay * BAY, 0.95 + floor * FLOOR
            if floor == 0 and bay == 0:
                out.append(("door", -0.5, 0.5, 0.16, 2.26))
            else:
                out.append((f"window_{floor}_{bay + 3}", x - 0.6, x + 0.6, z, z + 1.5))
    return out


def add_facade(scene: rs.Scene) -> list[Thing]:
    """Brick wall in the plane y = 0 with real openings; returns the measured ones."""
    holes = openings()
    add_wall(scene, holes)
    for index, hole in enumerate(holes):
        add_opening(scene, index, hole)
    band = rs.matte(rs.image(tx.mottled((64, 2048), "cfc6b4", (2, 40), 203, 0.05)))
    add_all(scene, rs.box((-9, -0.18, 11.3), (13.5, 0.3, 11.75), {"front": band}, band))
    shown = ("door", "window_0_4", "window_1_2", "window_1_3", "window_2_4", "window_2_2",
             "window_0_2", "window_3_4")  # fmt: skip
    return [opening_thing(hole) for name in shown for hole in holes if hole[0] == name]


def add_wall(scene: rs.Scene, holes, band: float = 0.12) -> None:
    """The wall cut along the openings; a light stone band surrounds each of them."""
    grown = [(a - band, b + band, c - band, d + band) for _, a, b, c, d in holes]
    xs = sorted({-9.0, 13.5, *(x for _, a, b, _, _ in holes for x in (a - band, a, b, b + band))})
    zs = sorted({0.0, 11.3, *(z for *_, c, d in holes for z in (c - band, c, d, d + band))})
    brick, stone = [], []
    for x0, x1 in pairwise(xs):
        for z0, z1 in pairwise(zs):
            mx, mz = (x0 + x1) / 2, (z0 + z1) / 2
            if any(a < mx < b and c < mz < d for _, a, b, c, d in holes):
                continue
            framed = any(a < mx < b and c < mz < d for a, b, c, d in grown)
            piece = [(x0, 0, z0), (x1, 0, z0), (x1, 0, z1), (x0, 0, z1)]
            (stone if framed else brick).append(piece)
    for pieces, picture, period in (
        (brick, tx.bricks(60, 20, 201), 4.8),
        (stone, tx.mottled((1024, 1024), "dcd6c8", (12, 12), 202, 0.04), 3.0),
    ):
        corners = np.array(pieces, float)
        material = rs.matte(rs.image(picture, (1, 1)))
        scene.add(rs.quads(corners, material, corners[..., [0, 2]] / period))


def add_opening(scene: rs.Scene, index: int, hole) -> None:
    """Dark reveals, frame and glass (or the door leaf) behind an opening."""
    name, x0, x1, z0, z1 = hole
    depth = 0.14
    reveal = rs.matte(tx.rgb("1f4a3c" if name == "door" else "3a3d40"))
    corners = [(x0, z1), (x1, z1), (x1, z0), (x0, z0)]
    for (ax, az), (bx, bz) in zip(corners, [*corners[1:], corners[0]], strict=True):
        scene.add(rs.panel((ax, 0, az), (bx, 0, bz), (ax, depth, az), reveal))
    if name == "door":
        add_door_leaf(scene, x0, x1, z0, z1, depth)
        return
    glass = np.linspace(0.05, 0.02, 64)[:, None, None] * np.array([0.8, 0.95, 1.1])
    picture = np.repeat(glass, 64, axis=1)
    rng = np.random.default_rng(300 + index)
    if rng.uniform() < 0.6:
        drop = int(rng.integers(12, 40))
        picture[:drop] = rng.uniform(0.12, 0.26)
    pane = rs.glass_front(rs.image(picture))
    scene.add(rs.panel((x0, depth, z1), (x1, depth, z1), (x0, depth, z0), pane))
    bar, t, y = rs.matte(tx.rgb("3a3d40")), 0.06, depth - 0.04
    middle, cross = (x0 + x1) / 2, z0 + 1.0
    bars = [
        (x0, x0 + t, z0, z1),
        (x1 - t, x1, z0, z1),
        (x0, x1, z0, z0 + t),
        (x0, x1, z1 - t, z1),
        (middle - 0.03, middle + 0.03, z0, z1),
        (x0, x1, cross - 0.025, cross + 0.025),
    ]
    for a, b, c, d in bars:
        add_all(scene, rs.box((a, y, c), (b, depth, d), {}, bar))


def add_door_leaf(scene: rs.Scene, x0, x1, z0, z1, depth: float) -> None:
    """Panelled door with a handle, and the step in front of it."""
    leaf = rs.glossy(tx.rgb("1f4a3c"), 0.15)
    scene.add(rs.panel((x0, depth, z1), (x1, depth, z1), (x0, depth, z0), leaf))
    for a, b in ((x0 + 0.12, x0 + 0.45), (x0 + 0.55, x1 - 0.12)):
        for c, d in ((z0 + 0.2, z0 + 0.8), (z0 + 0.95, z0 + 1.9)):
            add_all(scene, rs.box((a, depth - 0.02, c), (b, depth, d), {}, leaf))
    brass = rs.glossy(tx.rgb("c9a23f"), 0.1)
    scene.add(rs.ellipsoid((x1 - 0.09, depth - 0.05, z0 + 1.05), (0.035, 0.035, 0.035), brass))
    stone = rs.matte(rs.image(tx.mottled((256, 512), "8f8b84", (8, 16), 204, 0.08)))
    add_all(scene, rs.box((-0.8, -0.42, 0), (0.8, 0.0, 0.16), {}, stone))


def opening_thing(hole) -> Thing:
    """Truth of one opening: its corners in the plane of the facade."""
    name, x0, x1, z0, z1 = hole
    corners = np.array([(x0, 0, z1), (x1, 0, z1), (x1, 0, z0), (x0, 0, z0)])
    size = {"width": round(x1 - x0, 6), "height": round(z1 - z0, 6)}
    what = f"{name.split('_')[0]} opening; corners in the plane of the facade (y = 0)"
    return quad(name, what, size, corners)


def facade_ground(scene: rs.Scene) -> None:
    """Pavement, kerb and street in front, a plinth of planters and the ground beyond."""
    paving = rs.matte(rs.image(tx.slabs(1024, 8, 205, "aaa69c"), (10, 1)))
    scene.add(rs.panel((-20, 0, 0), (28, 0, 0), (-20, -4.8, 0), paving))
    stone = rs.matte(rs.image(tx.slabs(512, 1, 206, "bdb8ae"), (48, 1)))
    add_all(scene, rs.box((-20, -5.0, -0.14), (28, -4.8, 0.0), {"front": stone, "top": stone},
                          stone))  # fmt: skip
    tar = rs.matte(rs.image(tx.mottled((1024, 1024), "66676a", (24, 24), 207, 0.07), (20, 5)))
    scene.add(rs.panel((-40, -5, -0.14), (40, -5, -0.14), (-40, -25, -0.14), tar))
    field_ = rs.matte(tx.rgb("7f8a68"))
    scene.add(rs.panel((-90, 150, -0.16), (90, 150, -0.16), (-90, -30, -0.16), field_))
    for x in (-1.35, 1.35):
        pot = [(0.14, 0.0), (0.16, 0.02), (0.21, 0.40), (0.20, 0.42), (0.18, 0.38)]
        scene.add(rs.lathe((x, -0.45, 0.001), pot, rs.matte(tx.rgb("a8603f"))))
        leaves = [rs.matte(tx.rgb(c)) for c in ("4f7038", "648a45", "7a9a55")]
        add_all(scene, rs.foliage((x, -0.45, 0.66), (0.25, 0.25, 0.27), 900, 0.08, leaves,
                                  208 + int(x)))  # fmt: skip
