"""Two camera_info files of ROS, left and right; the right one's P holds the baseline, P[3] = -f B in metres.

Raw pictures are those of K and D; R turns each camera to the rectified axes that both share. With `rectified`, P alone counts.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..arrays import Array
from ..camera_files import ros
from ..camera_files.reading import Reading
from .reading import RigFound, RigReading, rectified_rig, rig_of, rotation


def tells(trees: tuple[Any, ...]) -> bool:
    """Whether these are two of them, or one."""
    return all(ros.tells(tree) for tree in trees)


def read(reading: RigReading) -> RigFound:
    """The rig."""
    if len(reading.trees) != 2:
        raise reading.refused("is one camera's; give the right camera's camera_info too, as a second --rig")
    readers = [reading.of(i) for i in (0, 1)]
    first, second = (_matrix(one, ("projection_matrix", "P", "p"), (12,)).reshape(3, 4) for one in readers)
    if not (first[0, 0] > 0 and second[0, 0] > 0):
        raise reading.refused(
            "its projection_matrix has no focal length above 0: it was calibrated alone, and not as a pair"
        )
    moved = second[0, 3] / second[0, 0] - first[0, 3] / first[0, 0]
    if moved == 0:
        raise reading.refused(
            "its projection_matrix has no baseline, P[3] is 0: it was calibrated alone, and not as a pair", 1
        )
    cameras = [ros.read(one).camera for one in readers]
    if reading.rectified:
        size = cameras[0].width_px, cameras[0].height_px
        return rectified_rig(reading, size, float(first[0, 0]), (float(first[0, 2]), float(first[1, 2])),
                             float(second[0, 2] - first[0, 2]), float(-moved))  # fmt: skip
    turns = [
        rotation(one, _matrix(one, ("rectification_matrix", "R", "r"), (9,)).tolist(), "rectification_matrix")
        for one in readers
    ]
    return rig_of(reading, cameras[0], cameras[1], turns[1].T @ turns[0], turns[1].T @ np.array([moved, 0.0, 0.0]))


def _matrix(one: Reading, keys: tuple[str, ...], counts: tuple[int, ...]) -> Array:
    tree = one.mapping(one.content, "the file")
    key = next((key for key in keys if tree.get(key) is not None), keys[0])
    return np.array(one.numbers(tree.get(key), key, counts))
