"""KITTI's calib.txt (P0 to P3, or lines of 12 numbers) and calib_cam_to_cam.txt, of rectified and of raw pictures.

P = K [I | t] in pixels and metres, of cameras that share one orientation; cameras 0 and 1 are gray, 2 and 3 in colour. Raw
pictures have K, D, R, T with x_i = R_i x_0 + T_i.
"""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from ..arrays import Array
from ..camera_files import scalars
from ..quantity import Note
from .reading import RigFound, RigReading, rectified_rig, rig_of, rotation

_NAMED = re.compile(r"\s*([A-Za-z]\w{0,30})\s*:\s*(.{0,1000}?)\s*", re.ASCII)
_PAIRS = ((0, 1), (2, 3))


def tells(trees: tuple[Any, ...]) -> bool:
    """Whether this is one."""
    if len(trees) != 1 or not isinstance(trees[0], str):
        return False
    return bool(_rows(trees[0])) or bool(re.search(r"(?m)^\s*P(?:_rect_0)?\d\s*:", trees[0]))


def _rows(text: str) -> list[list[str]]:
    """Lines of 12 numbers without names, if there is nothing else."""
    lines = [line.split() for line in text.splitlines()[:200] if line.strip()]
    whole = len(lines) in (2, 4) and all(len(line) == 12 for line in lines)
    return lines if whole and all(isinstance(scalars.value(word), (int, float)) for word in lines[0]) else []


def read(reading: RigReading) -> RigFound:
    """The rig of two of the cameras."""
    text = reading.trees[0]
    rows = _rows(text)
    said: dict[str, list[str]] = {f"P{i}": row for i, row in enumerate(rows)}
    if not rows:
        said = {m[1]: m[2].split() for line in text.splitlines()[:200] if (m := _NAMED.fullmatch(line))}
    raw = {k: v for k, v in said.items() if re.fullmatch(r"(?:K|D|R|T|S)_0\d", k)}
    key = "P_rect_0{}" if "P_rect_00" in said else "P{}"
    pairs = [pair for pair in _PAIRS if all(key.format(i) in said for i in pair)]
    if not pairs:
        raise reading.refused("has no two cameras side by side; P0 and P1, or P2 and P3 are needed")
    pair = _chosen(reading, pairs)
    found = _raw(reading, raw, pair) if raw and _is_raw(reading, said, pair) else _rectified(reading, said, key, pair)
    if len(pairs) > 1 and reading.pick.name is None:
        text = "the file has four cameras; 0 and 1, which are gray, were taken; 2 and 3 are those in colour"
        return RigFound(
            found.rig,
            (*found.notes, Note("rig_pair_chosen", text, "write calib.txt#P2 for cameras 2 and 3")),
            found.rectified,
        )
    return found


def _chosen(reading: RigReading, pairs: list[tuple[int, int]]) -> tuple[int, int]:
    name = reading.pick.name
    if name is None:
        return pairs[0]
    digits = re.fullmatch(r"\D*0?(\d)", name)
    for pair in pairs:
        if digits and int(digits[1]) in pair:
            return pair
    raise reading.refused(f"has no camera {name!r}; write #P0 or #P2")


def _is_raw(reading: RigReading, said: dict[str, list[str]], pair: tuple[int, int]) -> bool:
    """By the pictures' size: raw ones are larger than rectified ones."""
    size = _numbers(reading, said, f"S_0{pair[0]}", (2,))
    return not reading.rectified and reading.size_px is not None and tuple(size.tolist()) == reading.size_px


def _rectified(reading: RigReading, said: dict[str, list[str]], key: str, pair: tuple[int, int]) -> RigFound:
    first, second = (_numbers(reading, said, key.format(i), (12,)).reshape(3, 4) for i in pair)
    if abs(first[0, 0] - second[0, 0]) > 1e-3 * abs(first[0, 0]) or not first[0, 0] > 0:
        raise reading.refused("its two cameras have other focal lengths, so that they are no rectified pair")
    size_key = f"S_rect_0{pair[0]}"
    size = _numbers(reading, said, size_key, (2,)).tolist() if size_key in said else (None, None)
    baseline = (first[0, 3] - second[0, 3]) / first[0, 0]
    return rectified_rig(reading, reading.of().size(*size), float(first[0, 0]), (float(first[0, 2]), float(first[1, 2])),
                         float(second[0, 2] - first[0, 2]), float(baseline))  # fmt: skip


def _raw(reading: RigReading, said: dict[str, list[str]], pair: tuple[int, int]) -> RigFound:
    one, cameras, poses = reading.of(), [], []
    for i in pair:
        matrix = _numbers(reading, said, f"K_0{i}", (9,)).tolist()
        fx, fy, cx, cy = one.focal_and_centre(matrix, f"K_0{i}")
        size = one.size(*_numbers(reading, said, f"S_0{i}", (2,)).tolist())
        cameras.append(
            one.camera(size, (fx, fy), (cx, cy), "brown_conrady", _numbers(reading, said, f"D_0{i}", (5,)).tolist())
        )
        turn = rotation(one, _numbers(reading, said, f"R_0{i}", (9,)).tolist(), f"R_0{i}")
        poses.append((turn, _numbers(reading, said, f"T_0{i}", (3,))))
    turn = poses[1][0] @ poses[0][0].T
    return rig_of(reading, cameras[0], cameras[1], turn, poses[1][1] - turn @ poses[0][1])


def _numbers(reading: RigReading, said: dict[str, list[str]], name: str, counts: tuple[int, ...]) -> Array:
    words = [scalars.value(word) for word in said.get(name, [])]
    return np.array(reading.of().numbers(words, name, counts))
