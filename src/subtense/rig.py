"""Rig: two cameras fixed to each other, and how well their places are known."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np

from .arrays import Array
from .camera import Camera
from .errors import InputError
from .geometry import Pose, rotation_from_vector
from .noun import Noun, Part, unchecked
from .quantity import Quantity

_INTRINSICS = ("f_px", "aspect", "cx_px", "cy_px")
_GROUPS = (
    "focal length",
    "pixel aspect",
    "principal points",
    "lens distortion",
    "rotation between the cameras",
    "baseline",
)


@dataclass(frozen=True, eq=False)
class Rig(Noun):
    """A left and a right camera.

    Attributes:
        left: its covariance is a part of `cov`.
        right: likewise.
        right_from_left: where the right camera sees what the left one sees; its covariance is a part of `cov`.
        cov: of all numbers together: left camera, right camera (each in `Camera.cov`'s order), rotation vector (rad) and
            translation (m) perturbed on the left.
        source: where it comes from.
        part_sources: where single lines come from, by their name in the budget ("baseline"), if not from `source`.
        id: given, or the digest of the content.
    """

    left: Camera
    right: Camera
    right_from_left: Pose
    cov: Array
    source: str = "stated"
    part_sources: Mapping[str, str] = field(default_factory=dict)
    id: str | None = None

    widget: ClassVar[str] = "rig"

    def __post_init__(self) -> None:
        n = 14 + self.left.coefficients.shape[-1] + self.right.coefficients.shape[-1]
        cov = np.asarray(self.cov, float)
        if cov.shape != (n, n) or not np.all(np.isfinite(cov)):
            raise InputError("cov", f"of shape {np.shape(self.cov)}", f"give {n} x {n} finite numbers")
        scale = np.sqrt(np.diag(cov).clip(0.0))
        if np.any(abs(cov - cov.T) > 1e-6 * np.outer(scale, scale)) or np.any(np.diag(cov) < 0):
            raise InputError("cov", "not a covariance", "it must be symmetric with variances of 0 or above")
        rotation, moved = np.asarray(self.right_from_left.rotation), np.asarray(self.right_from_left.translation_m)
        if rotation.shape[-2:] != (3, 3) or not np.allclose(
            rotation @ np.swapaxes(rotation, -1, -2), np.eye(3), atol=1e-4
        ):
            raise InputError("right_from_left", "no rotation", "give a rotation matrix of 3 x 3 numbers")
        if moved.shape[-1:] != (3,) or not np.all(np.isfinite(moved)) or not np.all(np.any(moved, axis=-1)):
            raise InputError("right_from_left", "without a baseline", "the two cameras must stand at different places")

    @property
    def baseline_m(self) -> float:
        """Distance between the two entrance pupils."""
        return float(np.linalg.norm(self.right_from_left.translation_m))

    @property
    def u_baseline_m(self) -> float:
        """Its standard deviation."""
        along = self.right_from_left.translation_m / self.baseline_m
        return float(np.sqrt(along @ self.cov[-3:, -3:] @ along))

    def resized(self, width_px: int, height_px: int) -> Rig:
        """The rig of both pictures resampled to another size."""
        jacobian = np.eye(len(self.cov))
        cameras, first = [], 0
        for camera in (self.left, self.right):
            sx, sy = width_px / camera.width_px, height_px / camera.height_px
            at = range(first, first + 4)
            jacobian[at, at] = sx, sy / sx, sx, sy
            cameras.append(camera.resized(width_px, height_px))
            first += 4 + camera.coefficients.shape[-1]
        return replace(self, left=cameras[0], right=cameras[1], cov=jacobian @ self.cov @ jacobian.T, id=None)

    # -- as a noun -----------------------------------------------------------------------------------

    @cached_property
    def digest(self) -> str:
        return super().digest

    @property
    def leading(self) -> tuple[int, ...]:
        shapes = self.left.leading, self.right.leading, np.shape(self.right_from_left.rotation)[:-2]
        return np.broadcast_shapes(*shapes, np.shape(self.right_from_left.translation_m)[:-1])

    def rows(self, where: slice) -> Self:
        """The rig itself: one rig sees all rows."""
        del where
        return self

    def _group_of(self) -> list[str]:
        """The name in the budget of each of the numbers of `cov`."""
        names: list[str] = []
        for camera in (self.left, self.right):
            names += [_GROUPS[0], _GROUPS[1], _GROUPS[2], _GROUPS[2], *[_GROUPS[3]] * camera.coefficients.shape[-1]]
        return [*names, *[_GROUPS[4]] * 3, *[_GROUPS[5]] * 3]

    def _vector(self) -> Array:
        """(n, ...) all numbers in the order of `cov`; the rotation vector is that from the nominal rotation: 0."""
        columns: list[Any] = []
        for camera in (self.left, self.right):
            columns += [getattr(camera, name) for name in _INTRINSICS]
            columns += list(np.moveaxis(camera.coefficients, -1, 0))
        columns += [0.0, 0.0, 0.0, *np.moveaxis(np.asarray(self.right_from_left.translation_m), -1, 0)]
        return np.stack(np.broadcast_arrays(*(np.asarray(c, float) for c in columns)))

    def parts(self) -> tuple[Part, ...]:
        vector, names = self._vector(), self._group_of()
        moving = [i for i in range(len(names)) if self.cov[i, i] > 0]
        groups: list[list[int]] = []
        for name in _GROUPS:
            mine = [i for i in moving if names[i] == name]
            tied = [g for g in groups if np.any(self.cov[np.ix_(g, mine)])]
            groups = [g for g in groups if g not in tied] + ([[i for g in tied for i in g] + mine] if mine else [])
        return tuple(self._part(group, names, vector) for group in groups)

    def _part(self, group: list[int], names: list[str], vector: Array) -> Part:
        said = list(dict.fromkeys(names[i] for i in group))
        source = "; ".join(dict.fromkeys(self.part_sources.get(name, self.source) for name in said))
        return Part(
            ",".join(map(str, group)), ", ".join(said), source, vector[group], cov=self.cov[np.ix_(group, group)]
        )

    def moved(self, values: Mapping[str, Array]) -> Self:
        numbers: dict[int, Array] = {}
        for key, array in values.items():
            numbers.update(zip(map(int, key.split(",")), array, strict=True))
        left, first = _moved_camera(self.left, numbers, 0)
        right, first = _moved_camera(self.right, numbers, first)
        pose = self.right_from_left
        vector = [numbers.get(first + i) for i in range(6)]
        rotation, place = np.asarray(pose.rotation), np.asarray(pose.translation_m)
        if any(v is not None for v in vector[:3]):
            turn = np.stack(np.broadcast_arrays(*(0.0 if v is None else v for v in vector[:3])), -1)
            rotation = rotation_from_vector(turn) @ rotation
        if any(v is not None for v in vector[3:]):
            ends = [place[..., i] if v is None else v for i, v in enumerate(vector[3:])]
            place = np.stack(np.broadcast_arrays(*ends), -1)
        new = unchecked(self, left=left, right=right, right_from_left=Pose(rotation, place))
        new.__dict__.pop("digest", None)
        return new

    @classmethod
    def parse(cls, text: str, *, name: str = "rig") -> Self:
        """Read `640x480, f=700 ± 2 px, baseline=120 ± 0.5 mm[, centre=319.5;239.5][, doffs=0 ± 0.2 px]` of a rectified pair.

        `doffs` is the disparity's offset: principal point of the right picture less that of the left one, along x.
        """
        words = [word.strip() for word in text.split(",")]
        said = {key.strip(): value for key, _, value in (w.partition("=") for w in words if "=" in w)}
        if "baseline" not in said or "f" not in said or set(said) - {"baseline", "f", "doffs", "centre"}:
            raise InputError(name, text, "write '640x480, f=700 ± 2 px, baseline=120 ± 0.5 mm', or @rig.json")
        own = [w for w in words if w.partition("=")[0].strip() not in ("baseline", "doffs")]
        baseline = Quantity.parse(said["baseline"], "m", bare="no unit", name=name)
        doffs = Quantity.parse(said.get("doffs", "0 exact"), "px", name=name)
        return cls.of_rectified(Camera.parse(", ".join(own), name=name), baseline, doffs)

    @classmethod
    def of_rectified(cls, camera: Camera, baseline: Quantity, doffs: Quantity, source: str = "stated") -> Self:
        """The rig of a rectified pair: one pinhole camera twice, side by side.

        Args:
            camera: of both pictures; what is doubtful of it is alike in both.
            baseline: m.
            doffs: principal point of the right picture less that of the left one, along x, px.
            source: what to call it.

        Raises:
            InputError: a baseline of 0 or below.
        """
        if not float(baseline.value) > 0:
            raise InputError("baseline", f"{float(baseline.value):g} m", "give a length above 0")
        n = 4 + camera.coefficients.shape[-1]
        own = np.zeros((n, n)) if camera.cov is None else np.asarray(camera.cov)
        cov = np.zeros((2 * n + 6, 2 * n + 6))
        for row in (0, n):
            for column in (0, n):
                cov[row : row + n, column : column + n] = own
        cov[n + 2, n + 2] += float(doffs.u) ** 2
        cov[2 * n + 3, 2 * n + 3] = float(baseline.u) ** 2
        right = camera._with(cx_px=float(camera.cx_px) + float(doffs.value))
        lines = {"baseline": baseline.source, "focal length": camera.source}
        pose = Pose(np.eye(3), np.array([-float(baseline.value), 0.0, 0.0]), cov[-6:, -6:])
        return cls(camera, right, pose, cov, source, {k: v for k, v in lines.items() if v})

    def to_json(self) -> dict[str, Any]:
        """Both cameras, the pose, and the covariance of all."""
        pose = self.right_from_left
        data: dict[str, Any] = {
            "left": self.left.to_json(), "right": self.right.to_json(), "cov": np.asarray(self.cov).tolist(), "source": self.source,
            "right_from_left": {"rotation": pose.rotation.tolist(), "translation_m": pose.translation_m.tolist()},
            **({"part_sources": dict(self.part_sources)} if self.part_sources else {}),
        }  # fmt: skip
        return {**data, "id": self.id} if self.id else data

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Self:
        """The inverse of `to_json`; what `subtense calibrate --stereo` writes is read too."""
        data = data["rig"] if isinstance(data.get("rig"), Mapping) else data
        cov = np.asarray(data["cov"], float)
        pose = data["right_from_left"]
        right_from_left = Pose(
            np.asarray(pose["rotation"], float), np.asarray(pose["translation_m"], float), cov[-6:, -6:]
        )
        return cls(
            Camera.from_json(data["left"]), Camera.from_json(data["right"]), right_from_left, cov, str(data.get("source", "")),
            dict(data.get("part_sources", {})), data.get("id"),
        )  # fmt: skip


def _moved_camera(camera: Camera, numbers: Mapping[int, Array], first: int) -> tuple[Camera, int]:
    """A camera with its numbers among the rig's in place, and where the next camera's begin."""
    end = first + 4 + camera.coefficients.shape[-1]
    mine = {str(i - first): numbers[i][None] for i in range(first, end) if i in numbers}
    return (camera.moved(mine) if mine else camera), end
