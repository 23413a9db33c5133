"""Procedural surface textures: float32 arrays of linear reflectance, all with fixed seeds."""

from __future__ import annotations

from itertools import pairwise

import cv2
import numpy as np
from PIL import Image, ImageDraw, ImageFont
from render_lens import decode_srgb
from scipy import ndimage


def rgb(code: str) -> np.ndarray:
    """Linear reflectance of an sRGB colour such as "c8a070"."""
    return decode_srgb(np.array([int(code[i : i + 2], 16) for i in (0, 2, 4)]))


def noise(shape, cells, seed: int, octaves: int = 4) -> np.ndarray:
    """Periodic fractal value noise with zero mean and unit standard deviation."""
    rng = np.random.default_rng(seed)
    total = np.zeros(shape)
    y, x = np.arange(shape[0]) / shape[0], np.arange(shape[1]) / shape[1]
    for octave in range(octaves):
        ny, nx = cells[0] * 2**octave, cells[1] * 2**octave
        if ny > shape[0] or nx > shape[1]:
            break
        grid = rng.normal(size=(ny, nx))
        grid = np.pad(grid, 3, mode="wrap")
        rows = ndimage.map_coordinates(grid, np.meshgrid(y * ny + 3, np.arange(nx + 6), indexing="ij"), order=2)
        full = ndimage.map_coordinates(rows, np.meshgrid(np.arange(shape[0]), x * nx + 3, indexing="ij"), order=2)
        total += full * 0.55**octave
    return (total - total.mean()) / total.std()


def mix(a, b, t: np.ndarray) -> np.ndarray:
    """Blend two colours (or pictures) by a map t in 0..1."""
    t = np.clip(t, 0, 1)[..., None]
    return (np.asarray(a) * (1 - t) + np.asarray(b) * t).astype(np.float32)


def mottled(shape, colour: str, cells, seed: int, amount: float = 0.08) -> np.ndarray:
    """One colour with fractal brightness variation."""
    factor = np.exp(amount * noise(shape, cells, seed, 6))
    return np.clip(rgb(colour) * factor[..., None], 0.003, 0.9).astype(np.float32)


def wood(shape, seed: int, planks: int = 6, light: str = "c99a66", dark: str = "8a5a31"):
    """Planks with grain running along x."""
    h = shape[0]
    rows = np.minimum(np.arange(h) * planks // h, planks - 1)
    warp = noise(shape, (planks * 2, 3), seed, 3)
    fine = noise(shape, (h // 6, 8), seed + 1, 2)
    shift = np.random.default_rng(seed + 2).uniform(0, 9, planks)[rows][:, None]
    y = np.arange(h)[:, None] / h * planks
    rings = 0.5 + 0.5 * np.sin(2 * np.pi * (y * 5 + shift + 0.55 * warp))
    tone = np.random.default_rng(seed + 3).uniform(-0.12, 0.12, planks)[rows][:, None]
    base = mix(rgb(light), rgb(dark), 0.28 + 0.30 * rings**2 + 0.10 * fine + tone)
    within = (np.arange(h) * planks / h) % 1
    seam = np.minimum(within, 1 - within) * h / planks < 1.6
    base[seam] *= 0.35
    return base


def font(size: int):
    """Pillow's built-in outline font: the same on every machine."""
    return ImageFont.load_default(size)


def to_reflectance(image: Image.Image, white: float = 0.82) -> np.ndarray:
    """A drawn sRGB picture as reflectance with the given white."""
    return (0.02 + (white - 0.02) * decode_srgb(np.asarray(image.convert("RGB")))).astype(np.float32)


TEXT = (
    "An object of known size tells how far away it is. Measure the angle it",
    "subtends in the picture, divide the size by that angle, and the range",
    "follows. The care is in the details: the lens bends straight lines, the",
    "plane is seen at a slant, the edge is soft, the size has a tolerance and",
    "the focal length printed on the lens is a rounded number. Each of these",
    "adds to the uncertainty, and an honest answer states it with the result.",
)


def a4_sheet() -> np.ndarray:
    """Printed A4 page, 8 pixels per millimetre."""
    image = Image.new("RGB", (1680, 2376), "white")
    draw = ImageDraw.Draw(image)
    draw.text((170, 170), "Delivery note 2026-0417", font=font(92), fill="#15203a")
    draw.text((170, 285), "Distances from pictures", font=font(52), fill="#555555")
    draw.line((170, 370, 1510, 370), fill="#15203a", width=7)
    y = 430
    for _ in range(2):
        for line in TEXT:
            draw.text((170, y), line, font=font(41), fill="#222222")
            y += 60
        y += 50
    draw_table(draw, 170, y, 1340)
    for line in TEXT[:4]:
        draw.text((170, 1980 + 60 * TEXT.index(line)), line, font=font(41), fill="#222222")
    return to_reflectance(image, 0.80)


def draw_table(draw: ImageDraw.ImageDraw, x: int, y: int, width: int) -> None:
    """A small ruled table with a shaded head."""
    rows = ["Item|Width|Height", "Sheet A4|210 mm|297 mm", "Card ID-1|85.60 mm|53.98 mm"]
    rows += ["Marker 36h11|50 mm|50 mm", "Package|200 mm|120 mm", "Door|1.00 m|2.10 m"]
    draw.rectangle((x, y, x + width, y + 80), fill="#cfd8e6")
    for index, row in enumerate(rows):
        for cell, text in enumerate(row.split("|")):
            draw.text((x + 25 + cell * 460, y + 16), text, font=font(44), fill="#222222")
        y += 80
        draw.line((x, y, x + width, y), fill="#666666", width=3 if index else 5)


def bank_card() -> np.ndarray:
    """Specimen bank card, 20 pixels per millimetre (85.60 x 53.98 mm)."""
    w, h = 1712, 1080
    v, u = np.mgrid[:h, :w]
    wave = 0.5 + 0.5 * np.sin(u / 260 + 1.3 * np.sin(v / 300))
    base = mix(rgb("dfe5ea"), rgb("9fc3dd"), 0.15 + 0.5 * u / w + 0.2 * (wave - 0.5))
    image = Image.new("L", (w, h), 0)
    draw = ImageDraw.Draw(image)
    draw.text((110, 90), "SPECIMEN BANK", font=font(110), fill=255)
    draw.text((110, 640), "0000 0000 0000 0000", font=font(140), fill=255)
    draw.text((110, 870), "A. SAMPLE", font=font(85), fill=255)
    draw.text((1180, 870), "12/30", font=font(85), fill=255)
    base = mix(base, rgb("1b3358"), np.asarray(image) / 255)
    return draw_chip(base)


def draw_chip(card: np.ndarray) -> np.ndarray:
    """Gold contact plate with its grooves."""
    image = Image.new("L", (card.shape[1], card.shape[0]), 0)
    draw = ImageDraw.Draw(image)
    draw.rounded_rectangle((150, 330, 390, 530), 30, fill=255)
    card = mix(card, rgb("d9b45a"), np.asarray(image) / 255)
    grooves = Image.new("L", image.size, 0)
    draw = ImageDraw.Draw(grooves)
    for y in (396, 463):
        draw.line((150, y, 390, y), fill=255, width=6)
    draw.rounded_rectangle((225, 375, 315, 485), 20, outline=255, width=6)
    return mix(card, rgb("6b5420"), np.asarray(grooves) / 255)


def marker_print(marker_id: int) -> np.ndarray:
    """AprilTag 36h11: 50 mm black square and 10 mm white border, 16 pixels per millimetre."""
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36H11)
    tag = cv2.aruco.generateImageMarker(dictionary, marker_id, 8, borderBits=1)
    big = np.kron(tag, np.ones((100, 100), np.uint8))
    page = np.pad(big, 160, constant_values=255)
    return np.repeat(np.where(page > 0, 0.80, 0.025).astype(np.float32)[..., None], 3, axis=2)


def package_top() -> np.ndarray:
    """Cardboard top (200 x 150 mm, 6 pixels per millimetre) with tape and an address label."""
    shape = (900, 1200)
    flutes = 0.02 * np.sin(np.arange(900) / 900 * 2 * np.pi * 38)[:, None]
    board = mottled(shape, "c79a62", (6, 8), 40, 0.05) * (1 + flutes)[..., None]
    board[446:454] *= 0.45
    board[390:510] = board[390:510] * 0.72 + rgb("d8b988") * 0.25
    label = Image.new("RGB", (440, 290), "white")
    draw = ImageDraw.Draw(label)
    draw.text((20, 14), "SUBTENSE EXPRESS", font=font(38), fill="black")
    draw.text((20, 70), "Parcel 200 x 150 x 120 mm", font=font(26), fill="black")
    draw_barcode(draw, 20, 120, 400, 110)
    draw.text((90, 238), "0417 2026 0012 3", font=font(32), fill="black")
    board[560:850, 690:1130] = to_reflectance(label, 0.78)
    return board.astype(np.float32)


def draw_barcode(draw: ImageDraw.ImageDraw, x: int, y: int, width: int, height: int) -> None:
    """Bars of pseudo-random widths."""
    rng = np.random.default_rng(5)
    position = x
    while position < x + width - 12:
        bar, gap = rng.integers(2, 8, 2)
        draw.rectangle((position, y, position + int(bar), y + height), fill="black")
        position += int(bar + gap) + 1


def belt() -> np.ndarray:
    """Dark rubber with a fine crosswise rib pattern; repeats."""
    shape = (1024, 1024)
    y, x = np.mgrid[:1024, :1024] * 2 * np.pi / 1024
    ribs = np.maximum(np.sin(40 * x + 40 * y), np.sin(40 * x - 40 * y))
    scuffs = noise(shape, (4, 24), 52, 5)
    base = mottled(shape, "38393b", (8, 8), 51, 0.10)
    return (base * (1 + 0.15 * ribs + 0.10 * scuffs)[..., None]).astype(np.float32)


def bricks(rows: int, columns: int, seed: int, colours=("8f4b38", "6f3527"), mortar="a59c90"):
    """Running-bond brickwork, 24 x 8 cm per brick at 2.5 mm per pixel; repeats."""
    bh, bw = 32, 96
    rng = np.random.default_rng(seed)
    h, w = rows * bh, columns * bw
    v, u = np.mgrid[:h, :w]
    course = v // bh
    shifted = (u + (course % 2) * bw // 2) % w
    tone = rng.uniform(0, 1, (rows, columns))[course, shifted // bw]
    grain = noise((h, w), (rows * 2, columns * 4), seed + 1, 4)
    wall = mix(rgb(colours[0]), rgb(colours[1]), tone + 0.12 * grain)
    edge = np.minimum(v % bh, bh - 1 - v % bh)
    edge = np.minimum(edge, np.minimum(shifted % bw, bw - 1 - shifted % bw))
    joint = mottled((h, w), mortar, (rows, columns), seed + 2, 0.06)
    return mix(wall, joint, (edge < 2).astype(float))


def slabs(size: int, count: int, seed: int, colour: str = "a8a49c") -> np.ndarray:
    """Square paving slabs with dark joints; repeats."""
    rng = np.random.default_rng(seed)
    v, u = np.mgrid[:size, :size] * count // size
    tone = rng.normal(0, 0.06, (count, count))[v, u]
    base = mottled((size, size), colour, (count, count), seed + 1, 0.07)
    base *= np.exp(tone)[..., None]
    step = size // count
    joint = (np.mgrid[:size, :size] % step < 3).any(axis=0)
    base[joint] *= 0.45
    return base


def house_front(seed: int, wall: str, floors: int, bays: int) -> np.ndarray:
    """Front of a terraced house: 64 pixels per metre, 3 m floors and 2.5 m bays."""
    height, width = floors * 192, bays * 160
    front = mottled((height, width), wall, (floors * 2, bays * 2), seed, 0.05)
    for floor in range(floors):
        for bay in range(bays):
            top, left = height - floor * 192 - 160, bay * 160 + 40
            bottom = top + (150 if floor == 0 and bay % 3 == 1 else 100)
            draw_window(front, top, bottom, left, left + 80)
    for floor in range(1, floors):
        row = height - floor * 192
        front[row - 6 : row + 4] = front[row - 6 : row + 4] * 0.5 + 0.3
    return front


def draw_window(front: np.ndarray, top: int, bottom: int, left: int, right: int) -> None:
    """Light surround, frame cross and dark glass."""
    front[top - 8 : bottom + 8, left - 8 : right + 8] = rgb("d8d2c4")
    glass = np.linspace(0.22, 0.07, bottom - top)[:, None, None] * np.array([0.75, 0.9, 1.1])
    front[top:bottom, left:right] = glass
    middle = (left + right) // 2
    for a, b in ((left, left + 5), (middle - 3, middle + 3), (right - 5, right)):
        front[top:bottom, a:b] = 0.7
    third = top + (bottom - top) // 3
    for a, b in ((top, top + 5), (third, third + 5), (bottom - 5, bottom)):
        front[a:b, left:right] = 0.7


def speckled(shape, base: str, spots: str, seed: int, scale: int) -> np.ndarray:
    """Two-colour random blobs: a texture that stereo matching likes."""
    field = noise(shape, (shape[0] // scale, shape[1] // scale), seed, 4)
    tint = noise(shape, (4, 4), seed + 1, 3)
    picture = mix(rgb(base), rgb(spots), 0.5 + 0.9 * field)
    return (picture * np.exp(0.10 * tint)[..., None]).astype(np.float32)


def poster() -> np.ndarray:
    """Printed landscape poster."""
    h, w = 700, 1000
    v, u = np.mgrid[:h, :w]
    picture = mix(rgb("f0c98c"), rgb("5b8fc4"), 1 - v / (h * 0.6))
    for layer, colour in enumerate(("7f93a8", "54708a", "33515f", "2c4a35")):
        ridge = 300 + 90 * layer + 55 * noise((1, w), (1, 4 + 2 * layer), 80 + layer, 5)[0]
        picture = np.where((v > ridge)[..., None], rgb(colour), picture)
    sun = (u - 720) ** 2 + (v - 190) ** 2 < 60**2
    picture[sun] = rgb("fff2c8")
    picture = picture * np.exp(0.10 * noise((h, w), (40, 60), 90, 3))[..., None]
    picture[:25] = picture[-25:] = 0.75
    picture[:, :25] = picture[:, -25:] = 0.75
    return picture.astype(np.float32)


def book_spines(seed: int, count: int = 16) -> np.ndarray:
    """A row of books seen from the spine side."""
    rng = np.random.default_rng(seed)
    image = Image.new("RGB", (1200, 400), "#1c1712")
    draw = ImageDraw.Draw(image)
    palette = [
        "a33b2e",
        "2f5d7c",
        "d9c79a",
        "3d6b45",
        "7a4f8a",
        "c9822b",
        "24303f",
        "e3ddd0",
        "8c2f45",
        "4f7f86",
    ]
    edges = np.concatenate([[0], np.cumsum(rng.uniform(0.7, 1.4, count))])
    edges = (edges / edges[-1] * 1200).astype(int)
    for left, right in pairwise(edges):
        top = int(rng.integers(10, 110))
        colour = "#" + palette[int(rng.integers(len(palette)))]
        draw.rectangle((int(left) + 2, top, int(right) - 2, 399), fill=colour)
        for y in (top + 30, top + 42, 350):
            draw.line((int(left) + 6, y, int(right) - 6, y), fill="#e8d9a8", width=4)
        for y in range(top + 80, 320, 34):
            width = (right - left) * rng.uniform(0.15, 0.35)
            middle = (left + right) / 2
            draw.rectangle((middle - width, y, middle + width, y + 16), fill="#f0e8d0")
    return to_reflectance(image, 0.7)


def sky(seed: int) -> np.ndarray:
    """Latitude-longitude sky with soft clouds; row 0 is the zenith."""
    h, w = 512, 1024
    elevation = (0.5 - (np.arange(h) + 0.5) / h) * np.pi
    t = np.clip(np.sin(elevation), 0, 1)[:, None] ** 0.45
    picture = mix(np.array([0.80, 0.88, 0.96]), np.array([0.22, 0.40, 0.75]), t + np.zeros((1, w)))
    stretch = np.clip(elevation / 0.5, 0, 1)[:, None]
    cloud = noise((h, w), (10, 8), seed, 6) * 0.5 + 0.05
    picture = mix(picture, np.array([0.95, 0.95, 0.97]), cloud * np.minimum(1, stretch * 3 + 0.2))
    picture[elevation < 0] = np.array([0.30, 0.29, 0.27])
    return picture
