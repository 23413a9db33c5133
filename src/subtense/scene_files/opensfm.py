"""OpenSfM's reconstruction.json with its tracks.csv; OpenDroneMap keeps them in the folder opensfm.

Pixels are normalised: (0, 0) is the picture's middle, and 1 its longer side. A focal length is in longer sides. Shots have a rotation
vector and a translation, camera from world.

Source: OpenSfM's documentation, Dataset structure and Reconstruction format.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import Array
from ..camera import Camera
from ..errors import FileFormatError, InputError
from ..geometry import rotation_from_vector
from ..scene import Scene
from .colmap import U_FOCAL

MOST_BYTES = 2 * 2**30


def folder_of(folder: Path) -> Path | None:
    """Where a folder has one: itself, or opensfm below it; None if nowhere."""
    for one in (folder, folder / "opensfm"):
        if (one / "reconstruction.json").is_file():
            return one
    return None


def read(folder: Path) -> Scene:
    """The largest reconstruction; cameras get a wide covariance, as the file says nothing of it.

    Raises:
        FileFormatError: not such a file, or tracks.csv is missing.
    """
    path = folder / "reconstruction.json"
    if path.stat().st_size > MOST_BYTES:
        raise FileFormatError(path, "is larger than 2 GiB")
    try:
        parts = json.loads(path.read_text("utf-8"))
        part = max(parts, key=lambda one: len(one["shots"]))
        return _scene(folder, part)
    except FileFormatError:
        raise
    except (ValueError, KeyError, TypeError, IndexError, AttributeError, RecursionError) as error:
        raise FileFormatError(path, f"is no reconstruction of OpenSfM ({type(error).__name__})") from None


def camera_of(data: dict[str, Any]) -> Camera:
    """A camera with a wide covariance.

    Raises:
        InputError: a projection that subtense has no lens of.
    """
    kind, width, height = data["projection_type"], int(data["width"]), int(data["height"])
    if kind not in ("perspective", "brown", "fisheye_opencv", "fisheye"):
        raise InputError("camera", str(kind), "known are perspective, brown and fisheye_opencv")
    side = max(width, height)
    fx = float(data.get("focal_x", data.get("focal", 0))) * side
    aspect = float(data.get("focal_y", data.get("focal_x", 1))) / float(data["focal_x"]) if "focal_x" in data else 1.0
    cx, cy = (width - 1) / 2 + side * float(data.get("c_x", 0)), (height - 1) / 2 + side * float(data.get("c_y", 0))
    fisheye = kind.startswith("fisheye")
    names = ("k1", "k2", "k3", "k4") if fisheye else ("k1", "k2", "p1", "p2", "k3")
    k = np.array([float(data.get(name, 0)) for name in names])
    cov = np.zeros((4 + len(k), 4 + len(k)))
    spread = [
        U_FOCAL * fx,
        0.0 if aspect == 1 else 0.01,
        0.01 * side,
        0.01 * side,
        *(0.05 if n in ("k1", "k2") else 2e-3 for n in names),
    ]
    cov[np.arange(len(spread)), np.arange(len(spread))] = np.square(spread)
    if not fisheye and kind == "perspective":
        cov[6:, 6:] = 0.0
    return Camera(
        width,
        height,
        fx,
        cx,
        cy,
        aspect,
        "fisheye" if fisheye else "brown_conrady",
        k,
        cov,
        "a reconstruction of OpenSfM",
    )


def _scene(folder: Path, part: dict[str, Any]) -> Scene:
    keys, names = sorted(part["cameras"]), sorted(part["shots"])
    cameras = tuple(camera_of(part["cameras"][key]) for key in keys)
    camera_index = np.array([keys.index(part["shots"][name]["camera"]) for name in names])
    rotation = rotation_from_vector(np.array([part["shots"][name]["rotation"] for name in names], float))
    shift = np.array([part["shots"][name]["translation"] for name in names], float)
    centre = -np.einsum("vji,vj->vi", rotation, shift)
    ids = sorted(part["points"])
    points = np.array([part["points"][i]["coordinates"] for i in ids], float).reshape(-1, 3)
    colour = (
        np.array([part["points"][i].get("color", (128, 128, 128)) for i in ids], float).reshape(-1, 3).astype(np.uint8)
    )
    view, point, seen = _tracks(folder / "tracks.csv", names, {i: p for p, i in enumerate(ids)}, cameras, camera_index)
    return Scene(tuple(names), cameras, camera_index, rotation, centre, points, colour, view, point, seen)


def _tracks(
    path: Path, names: list[str], ids: dict[str, int], cameras: tuple[Camera, ...], camera_index: Any
) -> tuple[Any, Any, Array]:
    if not path.is_file() or path.stat().st_size > MOST_BYTES:
        raise FileFormatError(
            path, "no such file, or larger than 2 GiB; without it nothing tells how well the places are known"
        )
    of = {name: i for i, name in enumerate(names)}
    view, point, seen = [], [], []
    for line in path.read_text("utf-8").splitlines():
        cells = line.split("\t") if "\t" in line else line.split(",")
        if len(cells) < 5 or cells[0] not in of or cells[1] not in ids:
            continue
        camera = cameras[camera_index[of[cells[0]]]]
        side = max(camera.width_px, camera.height_px)
        view.append(of[cells[0]])
        point.append(ids[cells[1]])
        seen.append(
            (float(cells[3]) * side + (camera.width_px - 1) / 2, float(cells[4]) * side + (camera.height_px - 1) / 2)
        )
    if not view:
        raise FileFormatError(path, "has no track of a point of reconstruction.json")
    return np.array(view), np.array(point), np.array(seen)
