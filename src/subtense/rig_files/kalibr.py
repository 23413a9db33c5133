"""Kalibr's camchain of two cameras, cam0 and cam1; T_cn_cnm1 of cam1 takes a point from cam0's frame to its own, m."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..camera_files import kalibr
from .reading import RigFound, RigReading, rig_of, rotation


def tells(trees: tuple[Any, ...]) -> bool:
    """Whether this is one."""
    return len(trees) == 1 and isinstance(trees[0], dict) and not kalibr.tells({}) and kalibr.tells(trees[0])


def read(reading: RigReading) -> RigFound:
    """The rig of the first two cameras, or of the named one and the next."""
    tree = reading.of().mapping(reading.trees[0], "the file")
    names = [name for name, value in tree.items() if isinstance(value, dict) and "camera_model" in value]
    first = names.index(reading.pick.name) if reading.pick.name in names else 0
    if len(names) < first + 2:
        raise reading.refused("has one camera; a camchain of two is needed")
    pair = names[first], names[first + 1]
    one = reading.of()
    if tree[pair[1]].get("T_cn_cnm1") is None:
        raise reading.refused(f"{pair[1]} has no T_cn_cnm1, which tells where it stands")
    transform = np.array(one.numbers(tree[pair[1]]["T_cn_cnm1"], "T_cn_cnm1", (16,))).reshape(4, 4)
    turn = rotation(one, transform[:3, :3].ravel().tolist(), "T_cn_cnm1")
    left, right = (kalibr.read(reading.of(0, name)).camera for name in pair)
    return rig_of(reading, left, right, turn, transform[:3, 3])
