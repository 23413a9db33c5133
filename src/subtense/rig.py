"""Rig: two cameras fixed to each other, and how well their places are known."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from .arrays import Array
from .camera import Camera
from .errors import InputError
from .geometry import Pose


@dataclass(frozen=True, eq=False)
class Rig:
    """A left and a right camera.

    Attributes:
        left: its covariance is a part of `cov`.
        right: likewise.
        right_from_left: where the right camera sees what the left one sees; its covariance is a part of `cov`.
        cov: of all numbers together: left camera, right camera (each in `Camera.cov`'s order), rotation vector (rad) and
            translation (m) perturbed on the left.
        source: where it comes from.
    """

    left: Camera
    right: Camera
    right_from_left: Pose
    cov: Array
    source: str = "stated"

    def __post_init__(self) -> None:
        n = 14 + self.left.coefficients.size + self.right.coefficients.size
        if np.shape(self.cov) != (n, n) or not np.all(np.isfinite(self.cov)):
            raise InputError("cov", f"of shape {np.shape(self.cov)}", f"give {n} x {n} finite numbers")

    @property
    def baseline_m(self) -> float:
        """Distance between the two entrance pupils."""
        return float(np.linalg.norm(self.right_from_left.translation_m))

    @property
    def u_baseline_m(self) -> float:
        """Its standard deviation."""
        along = self.right_from_left.translation_m / self.baseline_m
        return float(np.sqrt(along @ self.cov[-3:, -3:] @ along))

    def to_json(self) -> dict[str, Any]:
        """Both cameras, the pose, and the covariance of all."""
        pose = self.right_from_left
        return {
            "left": self.left.to_json(), "right": self.right.to_json(), "cov": np.asarray(self.cov).tolist(), "source": self.source,
            "right_from_left": {"rotation": pose.rotation.tolist(), "translation_m": pose.translation_m.tolist()},
        }  # fmt: skip

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Self:
        """The inverse of `to_json`."""
        cov = np.asarray(data["cov"], float)
        pose = data["right_from_left"]
        right_from_left = Pose(
            np.asarray(pose["rotation"], float), np.asarray(pose["translation_m"], float), cov[-6:, -6:]
        )
        return cls(
            Camera.from_json(data["left"]),
            Camera.from_json(data["right"]),
            right_from_left,
            cov,
            str(data.get("source", "")),
        )
