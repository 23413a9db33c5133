"""What a reader of rig files gets and gives, and what is assumed where a file tells no uncertainty."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import Array
from ..camera import Camera
from ..camera_files.reading import Reading
from ..camera_files.selector import NOTHING, Pick
from ..errors import FileFormatError, InputError
from ..geometry import Pose
from ..quantity import Note, Quantity
from ..rig import Rig

ASSUMED_FOCAL = 0.005
"""Relative u of the focal lengths of a rig whose file does not tell it, alike in both cameras."""
ASSUMED_BASELINE = 0.005
"""Relative u of its baseline."""
ASSUMED_OFFSET_PX = 0.25
"""u of the disparity of infinitely far points: of doffs, or of the turn between the cameras."""
UNITS_M = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254}
MOST_TURN = 1e-3
"""By which nine numbers may fail to be a rotation: files round."""


@dataclass(frozen=True)
class RigFound:
    """What a file says of two cameras.

    Attributes:
        rig: with a covariance that is assumed where the file has none.
        notes: doubts.
        rectified: whether it is for rectified pictures.
    """

    rig: Rig
    notes: tuple[Note, ...] = ()
    rectified: bool = False


@dataclass(frozen=True)
class RigReading:
    """One rig on its way in.

    Attributes:
        paths: the files, for messages.
        trees: their contents.
        size_px: width and height of the pictures that it is wanted for; for files that do not tell it.
        pick: what was said beside the file.
        unit: of lengths, for files that do not tell it; empty where nothing was said.
        baseline: as a person typed it; takes the place of the file's.
        rectified: that the pictures are rectified.
    """

    paths: tuple[Any, ...]
    trees: tuple[Any, ...]
    size_px: tuple[int, int] | None = None
    pick: Pick = NOTHING
    unit: str = ""
    baseline: Quantity | None = None
    rectified: bool = False

    def of(self, index: int = 0, name: str | None = None) -> Reading:
        """A reader of one camera in one of the files."""
        size = self.pick.size_px or self.size_px
        return Reading(self.paths[index], self.trees[index], Pick(size, self.pick.fisheye, name))

    def refused(self, reason: str, index: int = 0) -> FileFormatError:
        """The error of one of the files."""
        return FileFormatError(self.paths[index], reason)

    def scale(self) -> float:
        """Metres per unit of a file that names none; 1 where a typed baseline gives the scale."""
        if self.unit:
            if self.unit not in UNITS_M:
                raise InputError("--unit", self.unit, f"known are {', '.join(UNITS_M)}")
            return UNITS_M[self.unit]
        if self.baseline is not None:
            return 1.0
        raise self.refused("does not tell the unit of its translation; say it with --unit mm, or type the --baseline")


def rotation(reading: Reading, value: Any, name: str) -> Array:
    """(3, 3) the rotation nearest to nine numbers."""
    found = np.array(reading.numbers(value, name, (9,))).reshape(3, 3)
    u, _, vt = np.linalg.svd(found)
    near = u @ vt
    if np.abs(near - found).max() > MOST_TURN or np.linalg.det(near) < 0:
        raise reading.refused(f"{name} is no rotation; give the file that the calibration wrote")
    return np.asarray(near)


def rig_of(
    reading: RigReading, left: Camera, right: Camera, turn: Array, moved_m: Array, *, rectified: bool = False
) -> RigFound:
    """A rig with what is assumed of its doubt, or typed of its baseline.

    Args:
        reading: where it comes from.
        left: camera; its covariance, where it has one, is kept.
        right: likewise.
        turn: (3, 3) rotation from left to right.
        moved_m: (3,) translation of the same.
        rectified: whether it is for rectified pictures.
    """
    length = float(np.linalg.norm(moved_m))
    if not (np.isfinite(length) and length > 0):
        raise reading.refused("has no baseline: its cameras stand at one place")
    name = " and ".join(str(getattr(path, "name", path)) for path in reading.paths)
    assumed = [] if left.cov is not None and right.cov is not None else ["focal lengths", "turn between the cameras"]
    along, source = np.asarray(moved_m) / length, f"rig file {name}"
    sources = {}
    if reading.baseline is not None:
        length, u_baseline = float(reading.baseline.value), float(reading.baseline.u)
        sources["baseline"] = reading.baseline.source
    else:
        u_baseline = ASSUMED_BASELINE * length
        assumed.append("baseline")
    if not length > 0:
        raise InputError("--baseline", f"{length:g} m", "give a length above 0")
    cov = _covariance(left, right, along, u_baseline)
    rig = Rig(
        left,
        right,
        Pose(turn, along * length, cov[-6:, -6:]),
        cov,
        f"{source}; u assumed" if assumed else source,
        sources,
    )
    return RigFound(rig, (_assumed(source, assumed),) if assumed else (), rectified)


def _covariance(left: Camera, right: Camera, along: Array, u_baseline: float) -> Array:
    sizes = [4 + camera.coefficients.size for camera in (left, right)]
    cov = np.zeros((sum(sizes) + 6,) * 2)
    f = [0, sizes[0]]
    if left.cov is None or right.cov is None:
        u = np.array([ASSUMED_FOCAL * float(left.f_px), ASSUMED_FOCAL * float(right.f_px)])
        cov[np.ix_(f, f)] = np.outer(u, u)  # one board, one scale: what errs in one errs in the other
    for at, camera in zip(f, (left, right), strict=True):
        if left.cov is not None and right.cov is not None and camera.cov is not None:
            n = 4 + camera.coefficients.size
            cov[at : at + n, at : at + n] = camera.cov
    turn = sum(sizes)
    cov[range(turn, turn + 3), range(turn, turn + 3)] = (ASSUMED_OFFSET_PX / float(left.f_px)) ** 2
    cov[-3:, -3:] = np.outer(along, along) * u_baseline**2
    return cov


def _assumed(source: str, what: Sequence[str]) -> Note:
    text = (f"{source} has no covariance; assumed are {ASSUMED_FOCAL:.1%} of the focal lengths, {ASSUMED_BASELINE:.1%} of the baseline, "
            f"and {ASSUMED_OFFSET_PX:g} px in every disparity (of these: {', '.join(what)})").replace("%", " %")  # fmt: skip
    return Note(
        "rig_without_uncertainty",
        text,
        "calibrate with `subtense calibrate --stereo`, which tells it, or type the --baseline",
    )


def rectified_rig(
    reading: RigReading,
    size_px: tuple[int, int],
    f_px: float,
    centre_px: tuple[float, float],
    doffs_px: float,
    baseline_m: float,
) -> RigFound:
    """The rig of a rectified pair, from the few numbers that such files have."""
    if not (f_px > 0 and np.isfinite([f_px, *centre_px, doffs_px, baseline_m]).all()):
        raise reading.refused("has no focal length above 0, or numbers that are not finite")
    if not baseline_m > 0:
        raise reading.refused(
            f"has a baseline of {baseline_m:g} m: its second camera does not stand to the right; exchange the two"
        )
    names = " and ".join(str(getattr(path, "name", path)) for path in reading.paths)
    source, typed = f"rig file {names}", reading.baseline
    cov = np.diag([(ASSUMED_FOCAL * f_px) ** 2, 0.0, 0.0, 0.0])
    try:
        camera = Camera(
            *size_px,
            f_px,
            *centre_px,
            cov=cov,
            source=f"{source}; u assumed",
        )
    except InputError as error:
        raise reading.refused(str(error)) from None
    assumed = Quantity.normal(baseline_m, ASSUMED_BASELINE * baseline_m, "m", f"{source}; u assumed")
    offset = Quantity.normal(doffs_px, ASSUMED_OFFSET_PX, "px")
    rig = Rig.of_rectified(camera, typed or assumed, offset, f"{source}; u assumed")
    what = ["focal length", "doffs", *([] if typed else ["baseline"])]
    return RigFound(rig, (_assumed(source, what),), True)
