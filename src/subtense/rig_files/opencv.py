"""OpenCV's stereo calibration: M1 D1 M2 D2 R T in one file, or in intrinsics.yml and extrinsics.yml as its sample writes them.

x_right = R x_left + T, as here. The unit of T is that of the board's squares, which no file tells. With `rectified`, P1 and P2 count.
"""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from ..camera import Camera
from ..camera_files import opencv
from ..camera_files.reading import Reading
from ..camera_files.selector import Pick
from .reading import RigFound, RigReading, rectified_rig, rig_of, rotation

_MATRIX = re.compile(r"(left|right|l|r)?(?:cameramatrix|cammatrix|intrinsics?|matrix|mtx|k|m)(left|right|l|r|[012])?")
_LEFT, _RIGHT = ("left", "l", "1"), ("right", "r", "2")
_TURNS, _MOVES = ("r", "rotation", "rotationmatrix", "rstereo"), ("t", "translation", "translationvector", "tstereo")


def _plain(key: str) -> str:
    return key.lower().replace("_", "").replace("-", "").replace(" ", "")


def _matrices(tree: dict[str, Any]) -> dict[str, str]:
    """Key of each side's camera matrix, by "left" and "right"."""
    tags = {match[1] or match[2] or "": key for key in tree if (match := _MATRIX.fullmatch(_plain(key)))}
    if "0" in tags and "1" in tags and "2" not in tags:
        return {"left": tags["0"], "right": tags["1"]}
    found = {}
    for side, names in (("left", _LEFT), ("right", _RIGHT)):
        for name in names:
            if name in tags:
                found[side] = tags[name]
    return found


def _whole(trees: tuple[Any, ...]) -> dict[str, Any]:
    whole: dict[str, Any] = {}
    for tree in trees:
        whole.update(tree if isinstance(tree, dict) else {})
    return whole


def tells(trees: tuple[Any, ...]) -> bool:
    """Whether this is one."""
    if not all(isinstance(tree, dict) for tree in trees):
        return False
    whole = _whole(trees)
    keys = {_plain(key) for key in whole}
    return (len(_matrices(whole)) == 2 and bool(keys & {*_MOVES})) or {"p1", "p2"} <= keys


def read(reading: RigReading) -> RigFound:
    """The rig."""
    whole = _whole(reading.trees)
    plain = {_plain(key): key for key in whole}
    one = Reading(reading.paths[0], whole, Pick(reading.pick.size_px or reading.size_px, reading.pick.fisheye))
    if reading.rectified or ("t" not in plain and not {*_MOVES} & set(plain)):
        return _rectified(reading, one, whole, plain)
    keys = _matrices(whole)
    if len(keys) < 2:
        raise reading.refused("has no two camera matrices, M1 and M2; give intrinsics.yml too, as a second --rig")
    left, right = (_camera(one, whole, keys[side]) for side in ("left", "right"))
    turn_key = next((plain[name] for name in _TURNS if name in plain), None)
    move_key = next((plain[name] for name in _MOVES if name in plain), None)
    if turn_key is None or move_key is None:
        raise reading.refused("has no R and T between the cameras; give extrinsics.yml too, as a second --rig")
    turn = rotation(one, whole[turn_key], turn_key)
    moved = np.array(one.numbers(whole[move_key], move_key, (3,))) * reading.scale()
    return rig_of(reading, left, right, turn, moved)


def _camera(one: Reading, whole: dict[str, Any], key: str) -> Camera:
    return opencv.read(Reading(one.path, whole, Pick(one.pick.size_px, one.pick.fisheye, key))).camera


def _rectified(reading: RigReading, one: Reading, whole: dict[str, Any], plain: dict[str, str]) -> RigFound:
    if not {"p1", "p2"} <= set(plain):
        raise reading.refused("has no P1 and P2, which rectified pictures need")
    first, second = (np.array(one.numbers(whole[plain[name]], name, (12,))).reshape(3, 4) for name in ("p1", "p2"))
    if not first[0, 0] > 0:
        raise reading.refused("P1 has no focal length above 0")
    return rectified_rig(reading, one.size(None, None), float(first[0, 0]), (float(first[0, 2]), float(first[1, 2])),
                         float(second[0, 2] - first[0, 2]), float(-second[0, 3] / first[0, 0]) * reading.scale())  # fmt: skip
