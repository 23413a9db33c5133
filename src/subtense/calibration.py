"""Calibration: a camera, or two, from pictures of a board, with what was seen, left out, checked and doubted."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .adjustment import Adjusted
from .board import Board
from .calibration_checks import Check
from .camera import Camera
from .quantity import Note
from .rig import Rig


@dataclass(frozen=True)
class Picture:
    """What became of one picture.

    Attributes:
        name: of the file.
        camera: which camera took it, from 0.
        points: how many points of the board were used.
        rms_px: root mean square distance between points projected and seen; None where it was left out.
        tilt_rad: angle between the board and the image plane; None where it was left out.
        range_m: from the camera to the board's middle; None where it was left out.
        detector: who saw the points.
        left_out: why it was not used; "" where it was.
    """

    name: str
    camera: int = 0
    points: int = 0
    rms_px: float | None = None
    tilt_rad: float | None = None
    range_m: float | None = None
    detector: str = ""
    left_out: str = ""

    def to_json(self) -> dict[str, Any]:
        """All fields."""
        return {name: getattr(self, name) for name in type(self).__dataclass_fields__}


@dataclass(frozen=True, eq=False)
class Calibration:
    """The outcome of a calibration.

    Attributes:
        cameras: one, or left and right; their covariance holds what the checks showed.
        board: with its scale as it was used.
        models: the lens model of each camera.
        pictures: all of them, those left out with the reason.
        checks: each question, with its answer.
        tried: rms of the pictures that a model did not see, by model; empty where the model was given.
        next_picture: which picture would improve the calibration most.
        solution: the adjustment, for plots and further questions.
        rig: the two cameras together; None for one.
        notes: doubts.
    """

    cameras: tuple[Camera, ...]
    board: Board
    models: tuple[str, ...]
    pictures: tuple[Picture, ...]
    checks: tuple[Check, ...]
    tried: Mapping[str, float]
    next_picture: str
    solution: Adjusted = field(repr=False)
    rig: Rig | None = None
    notes: tuple[Note, ...] = ()

    @property
    def camera(self) -> Camera:
        """The camera, or the left one."""
        return self.cameras[0]

    @property
    def used(self) -> tuple[Picture, ...]:
        """The pictures that were used."""
        return tuple(p for p in self.pictures if not p.left_out)

    @property
    def trusted(self) -> bool:
        """Whether no check of model, board and noise failed."""
        return not any(n.code == "model_error" for n in self.notes)

    def to_json(self) -> dict[str, Any]:
        """A calibration file: a camera under "camera" (two under "rig"), its notes, and how it was had."""
        from . import __version__

        told = {
            "board": self.board.to_json(), "models": list(self.models), "rms_px": self.solution.rms_px,
            "noise_over_detector": self.solution.factor, "tried_rms_px": dict(self.tried),
            "pictures": [p.to_json() for p in self.pictures],
            "checks": [{"name": c.name, "passed": c.passed, "found": c.found, "cure": c.cure} for c in self.checks],
            "board_warp_m": self.solution.state.warp_m.tolist(), "next_picture": self.next_picture,
        }  # fmt: skip
        what = {"rig": self.rig.to_json()} if self.rig else {"camera": self.camera.to_json(), "frame": "stored"}
        return {"schema": "subtense-calibration/1", "version": __version__, **what,
                "notes": [n.to_json() for n in self.notes], "calibration": told}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Audit:
    """What pictures say of a stated camera.

    Attributes:
        camera: as stated, at the pictures' size.
        calibration: the camera by the pictures themselves.
        rms_px: of the pictures explained by the stated camera, with only the board's places free.
        relative_range_error: by how much ranges by the stated camera come out too long, mean over the pictures.
        u_relative_range_error: its standard deviation, of both cameras.
        off_px: root mean square difference of the two cameras where the board was seen, a turn apart.
        off_in_u: the same in what their uncertainties let expect.
        checks: the questions of the audit.
        notes: doubts.
    """

    camera: Camera
    calibration: Calibration
    rms_px: float
    relative_range_error: float
    u_relative_range_error: float
    off_px: float
    off_in_u: float
    checks: tuple[Check, ...]
    notes: tuple[Note, ...] = ()

    @property
    def trusted(self) -> bool:
        """Whether the pictures bear the stated camera out, within its stated uncertainty."""
        return all(c.passed for c in self.checks)

    def to_json(self) -> dict[str, Any]:
        """The verdict, what it rests on, both cameras."""
        return {
            "schema": "subtense-audit/1", "trusted": self.trusted, "camera": self.camera.to_json(),
            "rms_px": self.rms_px, "relative_range_error": self.relative_range_error,
            "u_relative_range_error": self.u_relative_range_error, "off_px": self.off_px,
            "off_in_u": self.off_in_u if math.isfinite(self.off_in_u) else None,
            "checks": [{"name": c.name, "passed": c.passed, "found": c.found, "cure": c.cure} for c in self.checks],
            "notes": [n.to_json() for n in self.notes], "pictures": self.calibration.to_json(),
        }  # fmt: skip


def doubts(checks: tuple[Check, ...]) -> tuple[Note, ...]:
    """The notes of checks that did not pass: one for the model, with all that it rests on, and one for each other kind."""
    wrong = [c for c in checks if not c.passed]
    model = [c for c in wrong if c.note is None]
    notes = [c.note for c in wrong if c.note is not None]
    if model:
        text = "; ".join(c.found for c in model) + "; the uncertainty holds what this showed"
        notes.insert(0, Note("model_error", text, "; ".join(dict.fromkeys(c.cure for c in model))))
    return tuple(notes)


def relative_u(camera: Camera) -> float:
    """Relative standard deviation of the focal length."""
    return float(camera.u_f_px / np.asarray(camera.f_px))
