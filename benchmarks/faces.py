"""How far off the pupils' distance and the iris's width are that `detectors/faces.py` reads: `python benchmarks/faces.py FOLDER`.

FOLDER has photos with faces, some of them large; nothing of them is kept. What is printed stands as constants in the detector:

- size: large faces are shrunk by resampling with a shift, mirrored, made noisy and compressed; how both lengths change against
  the large picture's. What a network gets wrong of a person in all of these is not seen here.
- left and right: both irises of a person are equally wide (to 1 %).
- among persons: the iris's width over the pupils' distance, against 11.71 mm / 63 mm.
- turn: of the mirrored picture it is the opposite.
- noise: false faces in pictures of noise, and in a second folder of pictures without any: `... FOLDER WITHOUT_FACES`.
"""

import io
import math
import sys
from pathlib import Path

import numpy as np
from PIL import Image

from subtense.detectors.faces import LIGHTER, LIGHTER_ONE_SIDE, OPEN, contrast
from subtense.networks.face_mesh import find_faces
from subtense.subpixel import encoded_gray

EXPECTED = 11.71 / 63.0
SIZES_PX = (60, 40, 30, 22, 16)
ROUNDS = 6


def pictures(folder: Path):
    for path in sorted(folder.rglob("*")):
        if path.suffix.lower() in (".jpg", ".jpeg", ".png"):
            yield path.name, np.array(Image.open(path).convert("RGB"))


def lengths(face):
    between = face.eyes[1].centre_px - face.eyes[0].centre_px
    return math.hypot(*between), [eye.iris_width_px for eye in face.eyes]


def open_eyes(pixels, face):
    gray = encoded_gray(pixels)
    for eye in face.eyes:
        worse, better = contrast(gray, eye)
        if eye.opening_px < OPEN * eye.iris_width_px or worse < LIGHTER or better < LIGHTER_ONE_SIDE:
            return False
    return abs(face.eyes_turned_rad) < math.radians(25)


def worsened(pixels, face, eyes_px, rng):
    """The face's surroundings, shrunk until the eyes are this far apart; mirrored or not, noisy, as JPEG."""
    apart, _ = lengths(face)
    ratio = eyes_px / apart * rng.uniform(0.95, 1.05)
    middle = face.mesh_px[:, :2].mean(axis=0)
    half = 3.2 * apart
    box = np.concatenate([middle - half, middle + half]) + rng.uniform(-3, 3, 2)[[0, 1, 0, 1]]
    side = max(round(2 * half * ratio), 8)
    image = Image.fromarray(pixels).resize((side, side), Image.Resampling.BOX if ratio < 0.5 else Image.Resampling.BILINEAR,
                                           box=_clipped(box, pixels))  # fmt: skip
    wide, high = (
        _clipped(box, pixels)[2] - _clipped(box, pixels)[0],
        _clipped(box, pixels)[3] - _clipped(box, pixels)[1],
    )
    scale = np.array([side / wide, side / high])
    mirrored = rng.random() < 0.5
    if mirrored:
        image = image.transpose(Image.Transpose.FLIP_LEFT_RIGHT)
    noisy = np.clip(np.asarray(image, float) + rng.normal(0, 3, (side, side, 3)), 0, 255).astype(np.uint8)
    file = io.BytesIO()
    Image.fromarray(noisy).save(file, "JPEG", quality=85)
    return np.array(Image.open(file).convert("RGB")), scale, mirrored


def _clipped(box, pixels):
    height, width = pixels.shape[:2]
    side = min(box[2] - box[0], width, height)
    left, top = min(max(box[0], 0), width - side), min(max(box[1], 0), height - side)
    return float(left), float(top), float(left + side), float(top + side)


def told(ratios, size_px):
    return f"{np.mean(ratios) - 1:+.2%} sd {np.std(ratios):.2%} = {np.std(ratios) * size_px:.2f} px"


def by_size(large, eyes_px, rng):
    """How both lengths and the turn of the large faces change where they are small and worse."""
    eyes, iris, turned, lost = [], [], [], 0
    for _, pixels, face in large:
        apart, irises = lengths(face)
        for _ in range(ROUNDS if eyes_px < 0.92 * apart else 0):
            small, scale, mirrored = worsened(pixels, face, eyes_px, rng)
            found = find_faces(small, thorough=True)
            if not found:
                lost += 1
                continue
            best = max(found, key=lambda one: lengths(one)[0])
            got, got_irises = lengths(best)
            eyes.append(got / (apart * scale[0]))
            pair = irises[::-1] if mirrored else irises
            iris += [a / (b * scale[0]) for a, b in zip(got_irises, pair, strict=True)]
            turned.append(math.degrees(best.eyes_turned_rad * (-1 if mirrored else 1) - face.eyes_turned_rad))
    wide = eyes_px * EXPECTED * 1.07
    print(f"eyes {eyes_px:3d} px apart: n {len(eyes):3d}, lost {lost}, eyes {told(eyes, eyes_px)}")
    print(f"    iris {wide:.1f} px: {told(iris, wide)}; turn {np.mean(turned):+.1f}° sd {np.std(turned):.1f}°")


def by_mirror(large):
    """What the mirrored pictures say of the turn and of the eyes' distance."""
    turns, eyes = [], []
    for _, pixels, face in large:
        x = pixels.shape[1] - 1 - face.mesh_px[:, 0].mean()
        found = find_faces(np.ascontiguousarray(pixels[:, ::-1]))
        for same in sorted(found, key=lambda one: abs(one.mesh_px[:, 0].mean() - x))[:1]:
            turns.append(math.degrees(face.eyes_turned_rad + same.eyes_turned_rad) / 2)
            eyes.append(lengths(same)[0] / lengths(face)[0])
    print(
        f"turn and its mirror: mean {np.mean(turns):+.2f}°, sd {np.std(turns):.2f}°; eyes' distance sd {np.std(eyes):.2%}"
    )


def among_persons(persons):
    """The iris's width over the pupils' distance against what it is among adults."""
    ratios = np.array([np.mean(values) for values in persons.values()]) / EXPECTED
    each = math.sqrt(len(ratios))
    print(
        f"iris over eyes against {EXPECTED:.4f}: {ratios.mean():.3f}, sd among {len(ratios)} persons {ratios.std(ddof=1):.3f}"
    )
    print(f"    u of the mean by that {ratios.std(ddof=1) / each:.3f}, by the spread of people {0.07 / each:.3f}")


def main():
    rng = np.random.default_rng(5)
    large, agree, persons = [], [], {}
    for name, pixels in pictures(Path(sys.argv[1])):
        for number, face in enumerate(find_faces(pixels)):
            apart, irises = lengths(face)
            if not open_eyes(pixels, face):
                continue
            if min(irises) > 7:
                agree.append(math.log(irises[0] / irises[1]))
                person = f"{name} {number}" if name.startswith("sample") else name.split("_")[0]
                upright = np.mean(irises) / apart * math.cos(face.eyes_turned_rad)
                persons.setdefault(person, []).append(upright)
            if apart > 44:
                large.append((name, pixels, face))
    print(f"{len(large)} large faces, {len(persons)} persons")
    for eyes_px in SIZES_PX:
        by_size(large, eyes_px, rng)
    one = np.std(agree) / math.sqrt(2)
    print(f"left against right iris: n {len(agree)}, mean {np.mean(agree):+.2%}, one iris {one:.2%}")
    among_persons(persons)
    by_mirror(large)
    noise = [rng.integers(0, 256, (h, w, 3), dtype=np.uint8) for h, w in [(480, 640), (1500, 2000), (64, 64)]]
    print(f"noise: {sum(len(find_faces(pixels)) for pixels in noise)} faces")
    for name, pixels in pictures(Path(sys.argv[2])) if len(sys.argv) > 2 else ():
        for face in find_faces(pixels):
            print("   ", name, np.round(face.box_px), round(face.score, 2), f"eyes {lengths(face)[0]:.0f} px")


if __name__ == "__main__":
    main()
