"""COLMAP's sparse models, as text or binary in, as text out.

COLMAP's first pixel has its centre at (0.5, 0.5). cam_from_world is a quaternion w, x, y, z and a translation.

Source: COLMAP's documentation, Output format.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import Array
from ..camera import Camera
from ..errors import FileFormatError, InputError
from ..scene import Scene

MODELS: dict[int, tuple[str, int]] = {
    0: ("SIMPLE_PINHOLE", 3), 1: ("PINHOLE", 4), 2: ("SIMPLE_RADIAL", 4), 3: ("RADIAL", 5), 4: ("OPENCV", 8), 5: ("OPENCV_FISHEYE", 8),
    6: ("FULL_OPENCV", 12),
}  # fmt: skip
MOST_BYTES = 4 * 2**30
U_FOCAL = 0.05
"""Relative deviation of a focal length of which a model does not say how well it is known; the scene tells it better."""


def is_model(folder: Path) -> bool:
    """Whether a folder holds one."""
    return any((folder / f"cameras{end}").is_file() and (folder / f"images{end}").is_file() for end in (".bin", ".txt"))


def read(folder: Path) -> Scene:
    """A sparse model; cameras get a wide covariance, as a model says nothing of it.

    Raises:
        FileFormatError: a file is missing, cut, or of another kind.
    """
    binary = (folder / "cameras.bin").is_file()
    end = ".bin" if binary else ".txt"
    cameras = _read(folder / f"cameras{end}", _cameras_bin if binary else _cameras_txt)
    images = _read(folder / f"images{end}", _images_bin if binary else _images_txt)
    points = _read(folder / f"points3D{end}", _points_bin if binary else _points_txt)
    if not images or not points:
        raise FileFormatError(folder, "a model without pictures or points")
    return _scene(folder, cameras, images, points)


def _read(path: Path, how: Callable[[bytes], Any]) -> Any:
    if not path.is_file():
        raise FileFormatError(path, "no such file")
    if path.stat().st_size > MOST_BYTES:
        raise FileFormatError(path, "is larger than 4 GiB")
    try:
        return how(path.read_bytes())
    except FileFormatError:
        raise
    except (struct.error, ValueError, IndexError, KeyError, UnicodeDecodeError, OverflowError, MemoryError) as error:
        raise FileFormatError(path, f"is cut, or no file of COLMAP ({type(error).__name__})") from None


def _cameras_txt(data: bytes) -> dict[int, tuple[str, int, int, list[float]]]:
    rows = [line.split() for line in data.decode().splitlines() if line.strip() and not line.startswith("#")]
    return {int(r[0]): (r[1], int(r[2]), int(r[3]), [float(x) for x in r[4:]]) for r in rows}


def _cameras_bin(data: bytes) -> dict[int, tuple[str, int, int, list[float]]]:
    (count,), at = struct.unpack_from("<Q", data), 8
    found = {}
    for _ in range(count):
        key, model, width, height = struct.unpack_from("<iiQQ", data, at)
        if model not in MODELS:
            raise ValueError
        name, n = MODELS[model]
        found[key] = (name, width, height, list(struct.unpack_from(f"<{n}d", data, at + 24)))
        at += 24 + 8 * n
    return found


_Image = tuple[Array, Array, int, str, Array, Any]


def _images_txt(data: bytes) -> list[_Image]:
    lines = [line for line in data.decode().splitlines() if not line.startswith("#")]
    while lines and not lines[-1].strip():
        lines.pop()
    found = []
    for head, body in zip(lines[::2], [*lines[1::2], ""], strict=False):
        words = head.split(maxsplit=9)
        values = np.array([float(x) for x in body.split()]).reshape(-1, 3)
        found.append((np.array(words[1:5], float), np.array(words[5:8], float), int(words[8]), words[9].strip(), values[:, :2],
                      values[:, 2].astype(np.int64)))  # fmt: skip
    return found


def _images_bin(data: bytes) -> list[_Image]:
    (count,), at = struct.unpack_from("<Q", data), 8
    found = []
    for _ in range(count):
        _, *pose, camera = struct.unpack_from("<I7dI", data, at)
        end = data.index(b"\0", at + 64)
        (n,) = struct.unpack_from("<Q", data, end + 1)
        rows = np.frombuffer(data, [("xy", "<f8", 2), ("point", "<i8")], n, end + 9)
        found.append(
            (
                np.array(pose[:4]),
                np.array(pose[4:]),
                camera,
                data[at + 64 : end].decode(),
                rows["xy"].copy(),
                rows["point"].copy(),
            )
        )
        at = end + 9 + 24 * n
    return found


def _points_txt(data: bytes) -> dict[int, tuple[Array, Array]]:
    rows = [line.split() for line in data.decode().splitlines() if line.strip() and not line.startswith("#")]
    return {int(r[0]): (np.array(r[1:4], float), np.array(r[4:7], float)) for r in rows}


def _points_bin(data: bytes) -> dict[int, tuple[Array, Array]]:
    (count,), at = struct.unpack_from("<Q", data), 8
    found = {}
    for _ in range(count):
        key, x, y, z, r, g, b, _, n = struct.unpack_from("<QdddBBBdQ", data, at)
        found[key] = (np.array([x, y, z]), np.array([r, g, b], float))
        at += 51 + 8 * n
    if at > len(data):
        raise ValueError
    return found


def camera_of(model: str, width: int, height: int, params: list[float]) -> Camera:
    """A camera of COLMAP with a wide covariance.

    Raises:
        InputError: a model that subtense has no lens of.
    """
    shared = model in ("SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL")
    f, aspect, rest = (params[0], 1.0, params[1:]) if shared else (params[0], params[1] / params[0], params[2:])
    cx, cy, *k = rest
    if model not in {name for name, _ in MODELS.values()}:
        raise InputError("camera", model, f"known are {', '.join(name for name, _ in MODELS.values())}")
    fisheye = model == "OPENCV_FISHEYE"
    lens = "fisheye" if fisheye else "brown_conrady"
    counts = 4 if fisheye else 8 if model == "FULL_OPENCV" else 5
    distortion = np.zeros(counts)
    distortion[: len(k)] = k
    cov = np.zeros((4 + counts, 4 + counts))
    spread = [U_FOCAL * f, 0.0 if shared else 0.01, 0.01 * width, 0.01 * width]
    spread += [0.05 if i in (0, 1) and len(k) > i else 2e-3 if value else 0.0 for i, value in enumerate(distortion)]
    cov[np.arange(len(spread)), np.arange(len(spread))] = np.square(spread)
    return Camera(width, height, f, cx - 0.5, cy - 0.5, aspect, lens, distortion, cov, "a model of COLMAP")


def _rotation(q: Array) -> Array:
    w, x, y, z = q / np.linalg.norm(q)
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                     [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])  # fmt: skip


def quaternion(rotation: Array) -> Array:
    """(4,) w, x, y, z of a rotation, w not negative."""
    values, vectors = np.linalg.eigh(_quaternion_form(rotation))
    q = vectors[:, np.argmax(values)][[3, 0, 1, 2]]
    return np.asarray(q if q[0] >= 0 else -q)


def _quaternion_form(r: Array) -> Array:
    """(4, 4) whose first eigenvector is the quaternion x, y, z, w (I. Bar-Itzhack, 2000)."""
    return np.array([[r[0, 0] - r[1, 1] - r[2, 2], r[1, 0] + r[0, 1], r[2, 0] + r[0, 2], r[2, 1] - r[1, 2]],
                     [r[1, 0] + r[0, 1], r[1, 1] - r[0, 0] - r[2, 2], r[2, 1] + r[1, 2], r[0, 2] - r[2, 0]],
                     [r[2, 0] + r[0, 2], r[2, 1] + r[1, 2], r[2, 2] - r[0, 0] - r[1, 1], r[1, 0] - r[0, 1]],
                     [r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1], r[0, 0] + r[1, 1] + r[2, 2]]]) / 3  # fmt: skip


def _scene(
    folder: Path, cameras: dict[int, Any], images: list[_Image], points: dict[int, tuple[Array, Array]]
) -> Scene:
    keys = sorted(cameras)
    ids = np.array(sorted(points), np.int64)
    images = sorted(images, key=lambda image: image[3])
    view, point, seen, rotation, centre = [], [], [], [], []
    for i, (q, shift, camera, name, xy, of) in enumerate(images):
        if camera not in cameras or not np.all(np.isfinite([*q, *shift])) or not np.any(q):
            raise FileFormatError(folder, f"{name}: no such camera, or no pose")
        turn = _rotation(q)
        rotation.append(turn)
        centre.append(-turn.T @ shift)
        mine = np.isin(of, ids)
        view.append(np.full(int(mine.sum()), i))
        point.append(np.searchsorted(ids, of[mine]))
        seen.append(xy[mine] - 0.5)
    return Scene(
        tuple(image[3] for image in images), tuple(camera_of(*cameras[key]) for key in keys), np.array([keys.index(i[2]) for i in images]),
        np.array(rotation), np.array(centre), np.array([points[i][0] for i in ids.tolist()]),
        np.array([points[i][1] for i in ids.tolist()]).astype(np.uint8), np.concatenate(view), np.concatenate(point), np.concatenate(seen),
    )  # fmt: skip


def write(scene: Scene, folder: Path) -> None:
    """cameras.txt, images.txt and points3D.txt in a folder that exists."""
    from ..bundle import numbers

    lines = ["# subtense"]
    for c, camera in enumerate(scene.cameras, 1):
        f, aspect, cx, cy, *k = numbers(camera).tolist()
        fisheye = camera.lens == "fisheye"
        padded = [*k, *[0.0] * 8][: 4 if fisheye or not any(k[4:]) else 8]
        model = "OPENCV_FISHEYE" if fisheye else "OPENCV" if len(padded) == 4 else "FULL_OPENCV"
        params = " ".join(f"{x:.17g}" for x in (f, f * aspect, cx + 0.5, cy + 0.5, *padded))
        lines.append(f"{c} {model} {camera.width_px} {camera.height_px} {params}")
    (folder / "cameras.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")
    lines = ["# subtense"]
    for i, name in enumerate(scene.names):
        q, shift = quaternion(scene.rotation[i]), -scene.rotation[i] @ scene.centre[i]
        mine = scene.view == i
        pose = " ".join(f"{x:.17g}" for x in (*q, *shift))
        lines.append(f"{i + 1} {pose} {int(scene.camera_of[i]) + 1} {name}")
        lines.append(
            " ".join(
                f"{x + 0.5:.4f} {y + 0.5:.4f} {p + 1}"
                for (x, y), p in zip(scene.seen_px[mine], scene.point[mine], strict=True)
            )
        )
    (folder / "images.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")
    (folder / "points3D.txt").write_text("\n".join(_point_lines(scene)) + "\n", encoding="utf-8")


def _point_lines(scene: Scene) -> list[str]:
    place = np.zeros(len(scene.view), int)
    for i in range(len(scene.names)):
        mine = scene.view == i
        place[mine] = np.arange(int(mine.sum()))
    error = np.linalg.norm(np.nan_to_num(scene.residual_px()), axis=1)
    order = np.argsort(scene.point, kind="stable")
    bounds = np.searchsorted(scene.point[order], np.arange(len(scene.points) + 1))
    lines = ["# subtense"]
    for p, (xyz, rgb) in enumerate(zip(scene.points, scene.colour, strict=True)):
        mine = order[bounds[p] : bounds[p + 1]]
        track = " ".join(f"{scene.view[m] + 1} {place[m]}" for m in mine)
        mean = float(error[mine].mean()) if len(mine) else 0.0
        lines.append(
            f"{p + 1} " + " ".join(f"{x:.17g}" for x in xyz) + f" {rgb[0]} {rgb[1]} {rgb[2]} {mean:.4f} {track}"
        )
    return lines
