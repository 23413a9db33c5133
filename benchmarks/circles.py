"""How well discs and balls are found and measured: rendered ones with exact truth, and real pictures with stated sizes.

Blur 0.5 to 2 px in linear light, noise of 2 to 8 of 255, tilts to 70 degrees, 15 to 400 px. Run it for the tables; `rows()`
gives what docs/circles.md prints.
"""

import dataclasses
import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT / "tests" / "synthetic"))

from rims import CAMERA, drawn, photo_of  # noqa: E402

from subtense import Photo, propagate  # noqa: E402
from subtense.detection import Search  # noqa: E402
from subtense.detectors.circles import circles  # noqa: E402
from subtense.methods import circle, sphere  # noqa: E402
from subtense.quantity import Quantity  # noqa: E402
from subtense.targets import find_target  # noqa: E402

DATA = ROOT.parent / "shared" / "data"
Row = tuple[str, ...]
TOLD = Quantity.exact(2.2, "1", "stated")
CASES = (
    ("disc", 15, (0, 30), (0.5, 1.0)), ("disc", 30, (0, 50), (0.5, 2.0)), ("disc", 60, (0, 60), (0.5, 2.0)),
    ("disc", 120, (0, 70), (0.5, 2.0)), ("disc", 400, (0, 70), (0.5, 2.0)),
    ("ball", 15, None, (0.5, 1.0)), ("ball", 30, None, (0.5, 2.0)), ("ball", 100, None, (0.5, 2.0)), ("ball", 400, None, (0.5, 2.0)),
)  # fmt: skip
"""Shape, diameter in px, tilt in degrees, blur in px."""


def scene(size, tilts, blurs, rng):
    """Picture, true middle and what the method gives."""
    radius, exponent = 0.05, 2.2
    depth = 2 * radius * CAMERA.f_px / size
    room = max(min(0.5 * (460 - size), 120), 5) / CAMERA.f_px
    middle = depth * np.array([rng.uniform(-room, room), rng.uniform(-room, room), 1])
    tilt = None if tilts is None else np.radians(rng.uniform(*tilts))
    dark = rng.random() < 0.5
    look = {"inside": 0.05, "outside": 0.5} if dark else {"inside": 0.6, "outside": 0.08}
    return middle, drawn(middle, radius, tilt, rng.uniform(0, np.pi), blur=rng.uniform(*blurs), noise=rng.uniform(2, 8),
                         exponent=exponent, seed=int(rng.integers(1 << 30)), **look)  # fmt: skip


def measured(found, shape):
    """Range of the nearest disc or ball of 100 mm, with the camera exactly known."""
    method = circle if shape == "disc" else sphere
    inputs = method.Inputs(CAMERA, found.seen, Quantity.exact(0.1, "m"))
    one = method.METHOD.outputs[:1]
    return propagate.measure(dataclasses.replace(method.METHOD, outputs=one), inputs, draws=20_000)[0]


def rendered(scenes: int = 24) -> list[Row]:
    """By shape and size: how many are found, mean error of the range and its scatter, normalised errors, coverage."""
    table = [("what", "diameter", "found", "mean error of the range", "scatter", "rms of error / u", "in 95 %")]
    for shape, size, tilts, blurs in CASES:
        rng = np.random.default_rng(size)
        errors, z, hits, found = [], [], 0, 0
        for _ in range(scenes):
            middle, pixels = scene(size, tilts, blurs, rng)
            kind = "tennis-ball" if shape == "ball" else "euro-1"
            seen = circles(photo_of(pixels), Search(targets=(find_target(kind),), curve=TOLD))
            seen = [
                d
                for d in seen
                if np.hypot(*(d.seen.points_px.mean(0) - CAMERA.project(middle[None])[0])) < 0.2 * size + 2
            ]
            if not seen:
                continue
            if shape == "disc":  # without the thickness of a coin, which was not drawn
                seen = list(circles(photo_of(pixels), Search(targets=(find_target("speed-limit-de"),), curve=TOLD)))
            found += 1
            m, true = measured(seen[0], shape), float(np.linalg.norm(middle))
            errors.append(m.value / true - 1)
            z.append((m.value - true) / m.u)
            hits += m.low <= true <= m.high
        mean, spread = 100 * np.mean(errors), 100 * np.std(errors)
        table.append((shape, f"{size} px", f"{found} of {scenes}", f"{mean:+.3f} %", f"{spread:.3f} %",
                      f"{np.sqrt(np.mean(np.square(z))):.2f}", f"{100 * hits / max(found, 1):.0f} %"))  # fmt: skip
        print(table[-1], flush=True)
    return table


def rows() -> list[Row]:
    """Coins of the real picture: diameters told from the leftmost quarter, as if all were equally far and frontal."""
    table: list[Row] = [("picture", "coin", "true", "measured", "95 %", "error")]
    photo = Photo.load(DATA / "reference_object" / "coins_card" / "example_01.png")
    found = circles(photo)
    if len(found) != 3:
        return table
    sizes = [across(one) for one in found]
    for name, true, (size, u) in zip(("second quarter", "nickel"), (24.26, 21.21), sizes[1:], strict=True):
        value = 24.26 * size / sizes[0][0]
        # the picture was taken by hand: parts of it may be 2 % farther off
        half = 1.96 * value * float(np.hypot(np.hypot(u / size, sizes[0][1] / sizes[0][0]), 0.02))
        table.append(("coins_card", name, f"{true:.2f} mm", f"{value:.2f} mm", f"{value - half:.2f} to {value + half:.2f} mm",
                      f"{100 * (value / true - 1):+.1f} %"))  # fmt: skip
    return table


def across(one):
    """Diameter of the long axis and its u, px."""
    points, cov = one.seen.points_px, one.seen.cov
    middle = points.mean(axis=0)
    far = np.hypot(*(points - middle).T)
    i = int(np.argmax(far))
    j = (i + len(points) // 2) % len(points)
    way = (points[i] - points[j]) / np.hypot(*(points[i] - points[j]))
    pick = np.zeros(2 * len(points))
    pick[2 * i : 2 * i + 2], pick[2 * j : 2 * j + 2] = way, -way
    return float(np.hypot(*(points[i] - points[j]))), float(np.sqrt(pick @ cov @ pick))


def noise_alone(pictures: int = 40) -> int:
    """How many discs are found in pictures without any."""
    rng = np.random.default_rng(0)
    return sum(len(circles(photo_of(rng.integers(0, 256, (240, 320, 3))))) for _ in range(pictures))


if __name__ == "__main__":
    print("found in noise:", noise_alone())
    for row in rendered(int(sys.argv[1]) if len(sys.argv) > 1 else 24):
        print("| " + " | ".join(row) + " |")
    if DATA.is_dir():
        for row in rows():
            print("| " + " | ".join(row) + " |")
