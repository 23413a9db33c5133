"""Compare the shipped pictures with their truth: fitted edges and matched stereo points."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
from PIL import Image, ImageOps
from render_lens import Camera, decode_srgb
from scipy import ndimage

CORNERS = ("top_left", "top_right", "bottom_right", "bottom_left")


def load_linear(path: Path) -> np.ndarray:
    """Upright picture as linear luminance."""
    codes = np.asarray(ImageOps.exif_transpose(Image.open(path)).convert("RGB"))
    return decode_srgb(codes) @ np.array([0.2126, 0.7152, 0.0722])


def camera_of(entry: dict) -> Camera:
    """Truth camera of one picture."""
    intrinsics, pose = entry["camera"], entry["camera_from_world"]
    rotation = np.array(pose["rotation"])
    return Camera(
        entry["width_px"],
        entry["height_px"],
        intrinsics["f_px"],
        intrinsics["cx_px"],
        intrinsics["cy_px"],
        tuple(intrinsics["distortion"]),
        rotation,
        -rotation.T @ np.array(pose["translation_m"]),
        intrinsics["aspect"],
    )


def edge_points(picture: np.ndarray, camera: Camera, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Edge points near the side a-b (normalised coordinates), undistorted again."""
    t = np.linspace(0.12, 0.88, 90)[:, None]
    base = camera.pixel_of_normalised(camera.distort(a + t * (b - a)))
    along = np.gradient(base, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    normal = np.stack([-along[:, 1], along[:, 0]], -1)
    s = np.linspace(-5, 5, 101)
    at = base[:, None] + s[:, None] * normal[:, None]
    profile = ndimage.map_coordinates(picture, [at[..., 1], at[..., 0]], order=3, mode="nearest")
    slope = np.gradient(ndimage.gaussian_filter1d(profile, 4, axis=1), axis=1)
    slope *= np.sign(np.median(slope[:, 30:71].sum(axis=1)) or 1.0)
    peak = 25 + np.argmax(slope[:, 25:76], axis=1)
    near = np.abs(np.arange(101) - peak[:, None]) <= 22
    weight = np.where(near, np.maximum(slope, 0), 0)
    offset = (weight * s).sum(axis=1) / np.maximum(weight.sum(axis=1), 1e-12)
    return camera.normalised_of_pixel(base + offset[:, None] * normal)


def fit_line(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Robust total-least-squares line: a point on it and its normal."""
    keep = np.ones(len(points), bool)
    for _ in range(4):
        middle = points[keep].mean(axis=0)
        normal = np.linalg.svd(points[keep] - middle)[2][1]
        distance = np.abs((points - middle) @ normal)
        keep = distance <= max(3.0 * np.median(distance), 1e-9)
    return middle, normal


def measured_corners(picture: np.ndarray, camera: Camera, world: np.ndarray) -> np.ndarray:
    """Corners of a planar quadrilateral from four fitted edges, in pixels."""
    eye = camera.to_camera(world)
    corners = eye[:, :2] / eye[:, 2:]
    lines = [fit_line(edge_points(picture, camera, corners[i], corners[(i + 1) % 4])) for i in range(4)]
    found = []
    for i in range(4):
        (m0, n0), (m1, n1) = lines[i - 1], lines[i]
        found.append(np.linalg.solve(np.stack([n0, n1]), [n0 @ m0, n1 @ m1]))
    return camera.pixel_of_normalised(camera.distort(np.array(found)))


def check_objects(folder: Path, entry: dict) -> list[float]:
    """Print and return the corner errors (px) of all objects marked for checking."""
    picture, camera = load_linear(folder / entry["file"]), camera_of(entry)
    errors = []
    for thing in entry["objects"]:
        if not thing.get("checked"):
            continue
        points = {p["name"]: p for p in thing["points"]}
        world = np.array([points[name]["world_m"] for name in CORNERS])
        truth = np.array([points[name]["pixel_px"] for name in CORNERS])
        difference = measured_corners(picture, camera, world) - truth
        size = np.linalg.norm(difference, axis=1)
        errors += list(size)
        mean = difference.mean(axis=0)
        text = " ".join(f"{e:.3f}" for e in size)
        print(f"  {thing['name']:14s} corner errors {text} px, mean shift "
              f"({mean[0]:+.3f}, {mean[1]:+.3f}) px")  # fmt: skip
    return errors


def check_person(folder: Path, entry: dict) -> None:
    """Top of the head: strongest step down its column (one noisy column, so only printed)."""
    picture = load_linear(folder / entry["file"])
    for thing in entry["objects"]:
        for point in thing["points"]:
            if point["name"] == "head_top":
                u, v = point["pixel_px"]
                s = np.linspace(-5, 5, 101)
                profile = ndimage.map_coordinates(picture, [v + s, np.full(101, u)], order=3)
                slope = np.gradient(ndimage.gaussian_filter1d(profile, 4))
                slope = np.maximum(slope * np.sign(slope[np.argmax(np.abs(slope))]), 0)
                near = np.abs(np.arange(101) - np.argmax(slope)) <= 18
                offset = (slope * s)[near].sum() / slope[near].sum()
                print(f"  head top {offset:+.3f} px")


def check_stereo(folder: Path, left: dict, right: dict) -> list[float]:
    """Match the textured points from left to right and compare with the truth."""
    points = [p for t in left["objects"] for p in t["points"] if "pixel_right_px" in p]
    pictures = [np.asarray(Image.open(folder / e["file"]).convert("L")).astype(np.uint8) for e in (left, right)]
    a = np.array([p["pixel_px"] for p in points], np.float32).reshape(-1, 1, 2)
    b = np.array([p["pixel_right_px"] for p in points], np.float32).reshape(-1, 1, 2)
    stop = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 100, 1e-4)
    found, _, _ = cv2.calcOpticalFlowPyrLK(
        pictures[0], pictures[1], a, b.copy(), winSize=(21, 21), maxLevel=0, criteria=stop,
        flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
    )  # fmt: skip
    error = (found - b).reshape(-1, 2)
    size = np.linalg.norm(error, axis=1)
    print(f"  stereo matches: mean {size.mean():.3f} px, worst {size.max():.3f} px, mean shift "
          f"({error[:, 0].mean():+.3f}, {error[:, 1].mean():+.3f}) px")  # fmt: skip
    return list(size)


def run_check(folder: Path) -> bool:
    """Check every picture; true when each mean error is within 0.1 px."""
    truth = json.loads((folder / "truth.json").read_text(encoding="utf-8"))
    entries = {entry["file"]: entry for entry in truth["pictures"]}
    good = True
    for name, entry in entries.items():
        if not (folder / name).exists():
            continue
        print(name)
        errors = check_objects(folder, entry)
        check_person(folder, entry)
        if name == "stereo_left.jpg":
            errors += check_stereo(folder, entry, entries["stereo_right.jpg"])
        if errors:
            mean = float(np.mean(errors))
            verdict = "ok" if mean <= 0.1 else "TOO LARGE"
            print(f"  mean of {len(errors)}: {mean:.3f} px, {verdict}")
            good &= mean <= 0.1
    return good
