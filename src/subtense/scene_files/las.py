"""The points of a scene as LAS or LAZ, for programs of surveyors."""

from __future__ import annotations

import numpy as np

from ..errors import InputError
from ..las import LARGEST, STEP_M, las, laz
from ..scene import Scene


def write(scene: Scene) -> bytes:
    """The points of a scene in metres.

    Raises:
        InputError: the scene has no scale, or no points.
    """
    if not scene.metric:
        raise InputError("LAS", "a scene without a scale", "give one: LAS holds metres")
    fine = np.isfinite(scene.points).all(axis=1) & (abs(scene.points) < STEP_M * LARGEST).all(axis=1)
    if not fine.any():
        raise InputError("LAS", "a scene of no points", "reconstruct one with points")
    return las(scene.points[fine], scene.colour[fine], scene.origin_m)


def write_compressed(scene: Scene) -> bytes:
    """The same as LAZ.

    Raises:
        InputError, MissingExtraError: as `write`, and `las.laz`.
    """
    return laz(write(scene))
