"""Render the example pictures and write their exact truth.

    python tools/render_examples.py                 # everything, final quality
    python tools/render_examples.py --samples 4 --only desk
    python tools/render_examples.py --check         # compare shipped pictures with the truth

Needs mitsuba 3.9.1, numpy, pillow, opencv-contrib-python-headless and scipy. The result is
deterministic: all seeds are fixed.
"""

from __future__ import annotations

import argparse
import functools
import json
import sys
import time
from pathlib import Path

import cv2
import mitsuba as mi
import numpy as np
import render_scenes
from PIL import Image
from render_check import run_check
from render_lens import covering_pinhole, develop, resample, save_jpeg
from render_scenes import Shot

DEPTH_UNIT_M = 1e-4
NAMES = ("desk", "belt", "street", "stereo", "facade")


@functools.cache
def shots_of(name: str) -> list[Shot]:
    """The shots of one example."""
    made = getattr(render_scenes, name)()
    return list(made) if isinstance(made, tuple) else [made]


def tame_sparks(picture: np.ndarray) -> np.ndarray:
    """Limit isolated Monte Carlo sparks to 2.5 times the median of their 5 x 5 neighbours."""
    luminance = picture @ np.array([0.2126, 0.7152, 0.0722], np.float32)
    limit = 2.5 * cv2.medianBlur(np.ascontiguousarray(luminance, np.float32), 5) + 0.15
    factor = np.minimum(1, limit / np.maximum(luminance, 1e-6))
    return picture * factor[..., None]


def render_linear(shot: Shot, samples: int, oversampling: float) -> np.ndarray:
    """Linear-light lens picture of one shot."""
    pinhole = covering_pinhole(shot.camera, oversampling)
    scene = shot.scene.load(shot.camera, pinhole, samples, shot.seed)
    source = np.array(mi.render(scene, spp=samples, seed=shot.seed))[..., :3]
    return resample(tame_sparks(source), pinhole, shot.camera)


def take(shot: Shot, folder: Path, samples: int | None, oversampling: float) -> None:
    """Render, develop and save one picture."""
    start = time.time()
    linear = render_linear(shot, samples or shot.samples, oversampling)
    bright = np.percentile(linear.max(axis=2), 99.5) * shot.exposure
    codes = develop(linear, shot.camera, shot.exposure, 1000 + shot.seed)
    save_jpeg(folder / shot.file, codes, shot.nominal, shot.orientation, shot.quality)
    size = (folder / shot.file).stat().st_size // 1000
    print(f"{shot.file}: {time.time() - start:.0f} s, {size} kB, 99.5 % level {bright:.2f}")


# ---------------------------------------------------------------- truth


def numbers(values, digits: int = 9) -> list:
    """Array as nested lists of rounded floats."""
    return np.round(np.asarray(values, float), digits).tolist()


def point_truth(shot: Shot, name: str, world: np.ndarray) -> dict:
    """Truth of one point."""
    eye = shot.camera.to_camera(world[None])[0]
    return {
        "name": name,
        "world_m": numbers(world),
        "camera_m": numbers(eye),
        "pixel_px": numbers(shot.camera.project(world[None])[0], 6),
        "depth_m": round(float(eye[2]), 9),
        "range_m": round(float(np.linalg.norm(eye)), 9),
    }


def picture_truth(shot: Shot) -> dict:
    """Truth of one picture."""
    camera, nominal = shot.camera, shot.nominal
    sideways = shot.orientation == 6
    stored = (camera.height, camera.width) if sideways else (camera.width, camera.height)
    return {
        "file": shot.file,
        "width_px": camera.width,
        "height_px": camera.height,
        "stored_width_px": stored[0],
        "stored_height_px": stored[1],
        "orientation": shot.orientation,
        "notes": shot.notes,
        "camera": camera.as_dict(),
        "camera_from_world": {
            "rotation": numbers(camera.rotation, 15),
            "translation_m": numbers(camera.translation, 12),
        },
        "nominal": {
            "model": nominal.model,
            "focal_mm": nominal.focal_mm,
            "sensor_width_mm": nominal.sensor_width_mm,
            "sensor_height_mm": nominal.sensor_height_mm,
            "f35": nominal.f35,
        },
        "objects": [
            {
                "name": thing.name,
                "what": thing.what,
                "size_m": thing.size_m,
                "checked": thing.check,
                "points": [point_truth(shot, name, np.asarray(p, float)) for name, p in thing.points.items()],
            }
            for thing in shot.things
        ],
    }


def depth_picture(shot: Shot) -> np.ndarray:
    """Depth along z (m) at the centre of every distorted pixel, by one exact ray each."""
    camera = shot.camera
    scene = shot.scene.load(camera, covering_pinhole(camera, 1.0), 1, 0)
    v, u = np.mgrid[: camera.height, : camera.width].astype(float)
    xy = camera.normalised_of_pixel(np.stack([u, v], -1))
    rays = np.concatenate([xy, np.ones_like(xy[..., :1])], -1) @ camera.rotation
    origin = mi.ScalarPoint3f(*camera.centre)
    hit = [
        scene.ray_intersect_preliminary(mi.Ray3f(origin, mi.ScalarVector3f(*direction))).t
        for direction in rays.reshape(-1, 3).tolist()
    ]
    depth = np.array(hit).reshape(camera.height, camera.width)
    return np.where(np.isfinite(depth), depth, 0.0)


def write_depth(depth: np.ndarray, path: Path) -> None:
    """16-bit picture in units of 0.1 mm; 0 means no surface."""
    codes = np.round(depth / DEPTH_UNIT_M)
    codes[codes > 65535] = 0
    Image.fromarray(codes.astype(np.uint16)).save(path, optimize=True)


def stereo_truth(left: Shot, right: Shot, folder: Path) -> dict:
    """A dozen corner-like points on smooth surfaces that both cameras see."""
    depth = np.asarray(Image.open(folder / "stereo_depth.png")).astype(float) * DEPTH_UNIT_M
    grey = np.asarray(Image.open(folder / left.file).convert("L"))
    corners = cv2.goodFeaturesToTrack(grey, 6000, 0.02, 9, blockSize=11).reshape(-1, 2)
    scene = left.scene.load(left.camera, covering_pinhole(left.camera, 1.0), 1, 0)
    chosen: list[dict] = []
    for pixel in corners.astype(int):
        point = stereo_point(left, right, scene, depth, pixel, len(chosen) + 1)
        if point and all(apart(point, other) for other in chosen):
            chosen.append(point)
        if len(chosen) == 14:
            break
    size = {"baseline": 0.120}
    what = "well-textured surface points seen by both cameras"
    return {"name": "points", "what": what, "size_m": size, "checked": False, "points": chosen}


def apart(point: dict, other: dict) -> bool:
    """Chosen points keep 150 px from each other."""
    return float(np.hypot(*np.subtract(point["pixel_px"], other["pixel_px"]))) > 150


def stereo_point(left: Shot, right: Shot, scene, depth, pixel, number: int) -> dict | None:
    """Truth of one candidate pixel, or None when it lies near an edge or is hidden."""
    u, v = int(pixel[0]), int(pixel[1])
    r = 16
    patch = depth[v - r : v + r + 1, u - r : u + r + 1]
    if patch.shape != (2 * r + 1, 2 * r + 1) or patch.min() <= 0:
        return None
    if patch.max() - patch.min() > 0.035 * depth[v, u]:
        return None
    xy = left.camera.normalised_of_pixel(np.array([[u, v]], float))[0]
    direction = np.array([xy[0], xy[1], 1.0]) @ left.camera.rotation
    origin = mi.ScalarPoint3f(*left.camera.centre)
    t = scene.ray_intersect_preliminary(mi.Ray3f(origin, mi.ScalarVector3f(*direction))).t
    world = left.camera.centre + t * direction
    u2, v2 = right.camera.project(world[None])[0]
    if not (20 < u2 < right.camera.width - 20 and 20 < v2 < right.camera.height - 20):
        return None
    to_point = world - right.camera.centre
    ray = mi.Ray3f(mi.ScalarPoint3f(*right.camera.centre), mi.ScalarVector3f(*to_point))
    if abs(scene.ray_intersect_preliminary(ray).t - 1) > 1e-4:
        return None
    out = point_truth(left, f"point_{number:02d}", world)
    eye = right.camera.to_camera(world[None])[0]
    out["pixel_right_px"] = numbers([u2, v2], 6)
    out["camera_right_m"] = numbers(eye)
    return out


def write_truth(folder: Path) -> None:
    """Truth of all five examples."""
    pictures = []
    for name in NAMES:
        shots = shots_of(name)
        entries = [picture_truth(shot) for shot in shots]
        if name == "stereo" and (folder / "stereo_depth.png").exists():
            entries[0]["objects"].append(stereo_truth(shots[0], shots[1], folder))
        pictures += entries
    truth = {
        "conventions": {
            "pixel": "(0, 0) is the centre of the top-left pixel of the upright picture",
            "camera_axes": "x right, y down, z forward",
            "world_axes": "z up, metres",
            "pose": "X_camera = rotation * X_world + translation_m",
            "distortion": "k1, k2, p1, p2, k3 as in OpenCV; fx = f_px, fy = f_px * aspect",
            "sensor_width_mm": "along the upright picture's width",
            "lens": "pinhole rendering: no focus extension; f_px is exact at every distance",
        },
        "stereo_depth": {
            "file": "stereo_depth.png",
            "unit_m": DEPTH_UNIT_M,
            "meaning": "depth along z of the left camera at each pixel centre of the distorted left picture; 0 = none",
        },
        "pictures": pictures,
    }
    text = json.dumps(truth, indent=1, ensure_ascii=False)
    (folder / "truth.json").write_text(text + "\n", encoding="utf-8")


# ---------------------------------------------------------------- command line


def parse_arguments() -> argparse.Namespace:
    """Command line."""
    parser = argparse.ArgumentParser(description="Render the example pictures.")
    default = Path(__file__).resolve().parent.parent / "examples"
    parser.add_argument("--out", type=Path, default=default, help="folder to write to")
    parser.add_argument("--samples", type=int, help="rays per source pixel (default: by picture)")
    parser.add_argument("--oversampling", type=float, default=1.5, help="source pixels per pixel")
    parser.add_argument("--only", choices=NAMES, nargs="+", default=list(NAMES))
    parser.add_argument("--check", action="store_true", help="only compare pictures with truth")
    return parser.parse_args()


def main() -> int:
    """Render, write the truth, compare."""
    options = parse_arguments()
    if options.check:
        return 0 if run_check(options.out) else 1
    options.out.mkdir(parents=True, exist_ok=True)
    for name in options.only:
        shots = shots_of(name)
        for shot in shots:
            take(shot, options.out, options.samples, options.oversampling)
        if name == "stereo":
            write_depth(depth_picture(shots[0]), options.out / "stereo_depth.png")
    write_truth(options.out)
    return 0 if run_check(options.out) else 1


if __name__ == "__main__":
    sys.exit(main())
