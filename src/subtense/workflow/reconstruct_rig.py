"""Two pictures of a scene in metres as a rig, for `subtense stereo`: a depth for every pixel, with the scene's joint covariance."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..arrays import Array
from ..errors import InputError
from ..geometry import Pose
from ..rig import Rig
from ..scene import Scene
from ..views import Views
from .reconstruct_output import written


def read_pairs(texts: Sequence[str]) -> list[tuple[str, str, Path]]:
    """`a.jpg, b.jpg = rig.json` each.

    Raises:
        InputError: a text that can't be read, or a file that can't be written.
    """
    found = []
    for text in texts:
        names, equals, file = text.rpartition("=")
        pair = [name.strip() for name in names.split(",")]
        path = Path(file.strip())
        if not equals or len(pair) != 2 or not all(pair) or pair[0] == pair[1] or path.suffix.lower() != ".json":
            raise InputError(
                "--pair", text, "write the left picture, the right one and a file: 'a.jpg, b.jpg = rig.json'"
            )
        if not path.absolute().parent.is_dir():
            raise InputError("--pair", text, "its folder does not exist")
        found.append((pair[0], pair[1], path))
    return found


def write_pairs(scene: Scene, pairs: Sequence[tuple[str, str, Path]]) -> None:
    """A rig's file for each pair.

    Raises:
        InputError: no such picture, or a file that can't be written.
    """
    for left, right, path in pairs:
        rig = rig_of(scene.views(), left, right)
        written(path, json.dumps({"rig": rig.to_json()}, allow_nan=False).encode(), "--pair")


def rig_of(views: Views, left: str, right: str) -> Rig:
    """The rig of two views. What its two cameras share, they share in its covariance too; the scale is in that of the translation."""
    part = views.subset((left, right))
    cameras = [part.camera(0), part.camera(1)]
    rotation, shift = _right_from_left(part.rotation, part.places_m)
    sizes = [4 + camera.coefficients.shape[-1] for camera in cameras]
    jacobian = np.zeros((sum(sizes) + 6, len(part.covariance)))
    for side, first in ((0, 0), (1, sizes[0])):
        start = part.starts[part.of_view[side]]
        jacobian[first : first + sizes[side], start : start + sizes[side]] = np.eye(sizes[side])
    step = 1e-6
    for column in range(12):
        moved = [part.moved({str(column): np.array([sign * step])}) for sign in (1.0, -1.0)]
        ends = [_right_from_left(one.rotation, one.places_m) for one in moved]
        turn = ends[0][0] @ ends[1][0].T
        vector = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]) / 2
        jacobian[-6:, column] = np.concatenate([vector, ends[0][1] - ends[1][1]]) / (2 * step)
    cov = jacobian @ part.covariance @ jacobian.T
    cov[-3:, -3:] += part.u_scale**2 * np.outer(shift, shift)
    cov = (cov + cov.T) / 2
    return Rig(
        cameras[0],
        cameras[1],
        Pose(rotation, shift, cov[-6:, -6:]),
        cov,
        f"a scene of pictures, scale by {views.scale_source}",
    )


def _right_from_left(rotation: Array, places_m: Array) -> tuple[Array, Array]:
    """Of two views: the rotation, and where the right camera sees the left one's place."""
    turn = rotation[..., 1, :, :] @ np.swapaxes(rotation[..., 0, :, :], -1, -2)
    shift = (rotation[..., 1, :, :] @ (places_m[..., 0, :] - places_m[..., 1, :])[..., None])[..., 0]
    return np.asarray(turn.reshape(-1, 3, 3)[0]), np.asarray(shift.reshape(-1, 3)[0])
