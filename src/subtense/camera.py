"""Camera: which way each pixel looks, and how well that is known."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np

from .arrays import Array, Bools
from .errors import InputError
from .lenses import LENSES
from .noun import Noun, Part, plain
from .quantity import Quantity

_INTRINSICS = ("f_px", "aspect", "cx_px", "cy_px")
_GROUPS = (("focal length", 0, 1), ("pixel aspect", 1, 2), ("principal point", 2, 4), ("lens distortion", 4, None))


@dataclass(frozen=True, eq=False)
class Camera(Noun):
    """A camera's intrinsics and their covariance.

    Pixel (0, 0) is the centre of the top-left pixel; axes are x right, y down, z forward.

    Attributes:
        width_px: picture width.
        height_px: picture height.
        f_px: focal length along x; (...).
        cx_px: principal point, x; (...).
        cy_px: principal point, y; (...).
        aspect: fy / fx; (...).
        lens: a key of LENSES.
        distortion: (..., k) coefficients in the lens model's order.
        cov: (4 + k, 4 + k) covariance of (f_px, aspect, cx_px, cy_px, distortion...); None means exactly known.
        source: where it comes from.
        nominal_focal_m: the physical focal length, given only where f_px stands for focus at infinity (metadata,
            preset, typed in); None for a calibrated camera, whose f_px already holds the focus extension.
        part_sources: where single lines come from, by their name in the budget ("principal point"), if not from `source`.
        id: given, or the digest of the content.
    """

    width_px: int
    height_px: int
    f_px: float | Array
    cx_px: float | Array
    cy_px: float | Array
    aspect: float | Array = 1.0
    lens: str = "pinhole"
    distortion: Array | None = None
    cov: Array | None = None
    source: str = "stated"
    nominal_focal_m: float | None = None
    part_sources: Mapping[str, str] = field(default_factory=dict)
    id: str | None = None

    widget: ClassVar[str] = "camera"
    core: ClassVar[Mapping[str, int]] = {"f_px": 0, "aspect": 0, "cx_px": 0, "cy_px": 0, "distortion": 1}

    def __post_init__(self) -> None:
        if self.lens not in LENSES:
            raise InputError("lens", self.lens, f"known are {', '.join(LENSES)}")
        for name in ("width_px", "height_px"):
            size = getattr(self, name)
            if not (size > 0 and size == int(size)):
                raise InputError(name, size, "give a whole number of pixels above 0")
            object.__setattr__(self, name, int(size))
        for name in ("f_px", "aspect", "cx_px", "cy_px"):
            value = np.asarray(getattr(self, name), float)
            if not np.all(np.isfinite(value)) or (name in ("f_px", "aspect") and np.any(value <= 0)):
                raise InputError(name, getattr(self, name), "give a finite number, above 0 for f_px and aspect")
            object.__setattr__(self, name, float(value) if value.ndim == 0 else value)
        self._check_distortion()
        self._check_cov()

    def _check_distortion(self) -> None:
        counts = LENSES[self.lens].counts
        k = np.zeros(counts[0]) if self.distortion is None else np.asarray(self.distortion, float)
        if self.lens == "brown_conrady" and k.ndim == 1 and k.size in (1, 2, 4):
            k = np.concatenate([k, np.zeros(5 - k.size)])
        if k.ndim < 1 or k.shape[-1] not in counts or not np.all(np.isfinite(k)):
            raise InputError("distortion", k.tolist(), f"{self.lens} takes {' or '.join(map(str, counts))} numbers")
        object.__setattr__(self, "distortion", k)

    def _check_cov(self) -> None:
        if self.cov is None:
            return
        cov, n = np.asarray(self.cov, float), 4 + self.coefficients.shape[-1]
        if cov.shape != (n, n) or not np.all(np.isfinite(cov)):
            raise InputError("cov", f"of shape {cov.shape}", f"give {n} x {n} finite numbers, in the camera's order")
        scale = np.sqrt(np.diag(cov).clip(0.0))
        if np.any(abs(cov - cov.T) > 1e-6 * np.outer(scale, scale)) or np.any(np.diag(cov) < 0):
            raise InputError("cov", "not a covariance", "it must be symmetric with variances of 0 or above")
        object.__setattr__(self, "cov", (cov + cov.T) / 2)

    # -- derived -----------------------------------------------------------------------------------

    @property
    def coefficients(self) -> Array:
        """(..., k) distortion coefficients, never None."""
        assert self.distortion is not None
        return self.distortion

    @property
    def matrix(self) -> Array:
        """(3, 3) camera matrix K, OpenCV's convention."""
        f, aspect = float(self.f_px), float(self.aspect)
        return np.array([[f, 0, float(self.cx_px)], [0, f * aspect, float(self.cy_px)], [0, 0, 1.0]])

    @property
    def u_f_px(self) -> float:
        """Standard deviation of the focal length."""
        return 0.0 if self.cov is None else float(np.sqrt(self.cov[0, 0]))

    @property
    def field_of_view_rad(self) -> tuple[float, float]:
        """Horizontal and vertical angle between the outer edges of the picture, through the principal point."""
        middle = np.array([self.cx_px, self.cy_px], float)
        right, bottom = self.width_px - 0.5, self.height_px - 0.5
        ends = np.array([[-0.5, middle[1]], [right, middle[1]], [middle[0], -0.5], [middle[0], bottom]])
        rays = self.rays(ends)
        angle = np.arctan2(rays[:, :2], rays[:, 2:])
        return float(angle[1, 0] - angle[0, 0]), float(angle[3, 1] - angle[2, 1])

    @cached_property
    def digest(self) -> str:
        return super().digest

    # -- geometry ----------------------------------------------------------------------------------

    def _coefficient_list(self) -> list[Array]:
        """k arrays that broadcast against (..., N)."""
        k = self.coefficients
        return [k[..., i, None] if k.ndim > 1 else k[..., i] for i in range(k.shape[-1])]

    def _plane(self, points_px: Array) -> tuple[Array, Array]:
        """(..., N) normalised image coordinates, still distorted."""
        f, aspect, cx, cy = (
            v if isinstance(v := getattr(self, n), float) else np.asarray(v)[..., None] for n in _INTRINSICS
        )
        return (points_px[..., 0] - cx) * (1 / f), (points_px[..., 1] - cy) * (1 / (f * aspect))

    def _directions(self, points_px: Array) -> tuple[Array, Array, Array]:
        return LENSES[self.lens].to_ray(*self._plane(points_px), self._coefficient_list())

    def rays(self, points_px: Array) -> Array:
        """Unit viewing directions of pixels.

        Args:
            points_px: (..., N, 2).

        Returns:
            (..., N, 3) in the camera frame; NaN rows where the distortion can't be inverted.
        """
        x, y, z = self._directions(np.asarray(points_px, float))
        return np.stack(np.broadcast_arrays(x, y, z), -1) / np.sqrt(x * x + y * y + z * z)[..., None]

    def slopes(self, points_px: Array) -> tuple[Array, Array]:
        """(..., N) x/z and y/z of viewing directions: where they pierce the plane at depth 1; NaN if they don't."""
        if self.lens == "pinhole":
            return self._plane(points_px)
        x, y, z = self._directions(points_px)
        if self.lens == "brown_conrady":
            return x, y
        with np.errstate(divide="ignore", invalid="ignore"):
            z = np.where(z > 0, z, np.nan)
            return x / z, y / z

    def normalised(self, points_px: Array) -> Array:
        """(..., N, 2) the slopes of `slopes` as one array: normalised picture coordinates."""
        return np.stack(np.broadcast_arrays(*self.slopes(points_px)), -1)

    def project(self, points_m: Array) -> Array:
        """Pixels of points in the camera frame.

        Args:
            points_m: (..., N, 3), any length unit.

        Returns:
            (..., N, 2); NaN rows behind the camera or beyond the lens model's turning point.
        """
        points = np.asarray(points_m, float)
        x, y = LENSES[self.lens].to_plane(points[..., 0], points[..., 1], points[..., 2], self._coefficient_list())
        f, aspect, cx, cy = (np.asarray(getattr(self, n))[..., None] for n in _INTRINSICS)
        return np.stack([f * x + cx, f * aspect * y + cy], -1)

    def invertible(self, points_px: Array) -> Bools:
        """(..., N) whether the lens model gives a direction for these pixels."""
        return np.isfinite(self._directions(np.asarray(points_px, float))[0])

    # -- the same camera, another picture ------------------------------------------------------------

    def _mapped(self, jacobian: Array, **changes: Any) -> Camera:
        """Changes, with the covariance taken along by the Jacobian of the first four numbers and the distortion."""
        cov = None if self.cov is None else jacobian @ self.cov @ jacobian.T
        own: dict[str, Any] = {f.name: getattr(self, f.name) for f in fields(self)}
        return Camera(**{**own, "id": None, "cov": cov, **changes})

    def resized(self, width_px: int, height_px: int) -> Camera:
        """The camera of the picture resampled to another size: f' = s f, c' = (c + 0.5) s - 0.5."""
        sx, sy = width_px / self.width_px, height_px / self.height_px
        jacobian = np.eye(4 + self.coefficients.shape[-1])
        jacobian[[0, 1, 2, 3], [0, 1, 2, 3]] = sx, sy / sx, sx, sy
        return self._mapped(
            jacobian, width_px=width_px, height_px=height_px, f_px=self.f_px * sx, aspect=self.aspect * sy / sx,
            cx_px=(self.cx_px + 0.5) * sx - 0.5, cy_px=(self.cy_px + 0.5) * sy - 0.5,
        )  # fmt: skip

    def cropped(self, left_px: int, top_px: int, width_px: int, height_px: int) -> Camera:
        """The camera of a cut-out whose top-left pixel was (left_px, top_px)."""
        return self._mapped(np.eye(4 + self.coefficients.shape[-1]), width_px=width_px, height_px=height_px,
                            cx_px=self.cx_px - left_px, cy_px=self.cy_px - top_px)  # fmt: skip

    def rotated(self, quarter_turns: int) -> Camera:
        """The camera of the picture turned clockwise by quarter turns."""
        camera = self
        for _ in range(quarter_turns % 4):
            camera = camera._rotated_once()
        return camera

    def _rotated_once(self) -> Camera:
        k, n = self.coefficients, self.coefficients.shape[-1]
        if n == 14 and np.any(k[..., 12:]):
            raise InputError("distortion", "a tilted sensor", "turn the pictures before calibrating them")
        jacobian = np.eye(4 + n)
        jacobian[0, :2] = float(self.aspect), float(self.f_px)
        jacobian[1, 1] = -1 / float(self.aspect) ** 2
        jacobian[2:4, 2:4] = [[0, -1], [1, 0]]
        if self.lens == "brown_conrady":  # x' = -y, y' = x: p1' = p2, p2' = -p1, (s1 s2 s3 s4)' = (-s3 -s4 s1 s2)
            jacobian[6:8, 6:8] = [[0, 1], [-1, 0]]
            if n >= 12:
                jacobian[12:16, 12:16] = [[0, 0, -1, 0], [0, 0, 0, -1], [1, 0, 0, 0], [0, 1, 0, 0]]
        return self._mapped(
            jacobian, width_px=self.height_px, height_px=self.width_px, f_px=self.f_px * self.aspect,
            aspect=1 / self.aspect, cx_px=self.height_px - 1 - self.cy_px, cy_px=self.cx_px,
            distortion=k @ jacobian[4:, 4:].T,
        )  # fmt: skip

    # -- as a noun -----------------------------------------------------------------------------------

    def parts(self) -> tuple[Part, ...]:
        if self.cov is None or not np.any(self.cov):
            return ()
        vector = self._vector()
        return tuple(self._part(group, vector) for group in self._independent_groups())

    def _vector(self) -> Array:
        """(4 + k, ...) all intrinsics, component first."""
        k = np.moveaxis(self.coefficients, -1, 0)
        return np.stack(np.broadcast_arrays(*(np.asarray(getattr(self, n), float) for n in _INTRINSICS), *k))

    def _independent_groups(self) -> list[list[int]]:
        """Indices that vary together: the named groups, merged where the covariance ties them."""
        assert self.cov is not None
        groups: list[list[int]] = []
        for _, first, last in _GROUPS:
            moving = [i for i in range(first, last or len(self.cov)) if self.cov[i, i] > 0]
            tied = [g for g in groups if np.any(self.cov[np.ix_(g, moving)])]
            groups = [g for g in groups if g not in tied] + ([[i for g in tied for i in g] + moving] if moving else [])
        return groups

    def _part(self, group: list[int], vector: Array) -> Part:
        assert self.cov is not None
        names = [name for name, first, last in _GROUPS if any(first <= i < (last or 99) for i in group)]
        cov = self.cov[np.ix_(group, group)]
        diagonal = not np.any(cov - np.diag(np.diag(cov)))
        u = np.sqrt(np.diag(cov)).reshape(-1, *(1,) * (vector.ndim - 1))
        source = "; ".join(dict.fromkeys(self.part_sources.get(name, self.source) for name in names))
        return Part(",".join(map(str, group)), ", ".join(names), source, vector[group],
                    u if diagonal else None, None if diagonal else cov)  # fmt: skip

    def moved(self, values: Mapping[str, Array]) -> Self:
        changes: dict[str, Any] = {}
        k: dict[int, Array] = {}
        for key, array in values.items():
            for row, index in zip(array, map(int, key.split(",")), strict=True):
                if index < 4:
                    changes[_INTRINSICS[index]] = row
                else:
                    k[index - 4] = row
        if k:
            columns = [k.get(i, self.coefficients[..., i]) for i in range(self.coefficients.shape[-1])]
            changes["distortion"] = np.stack(np.broadcast_arrays(*columns), -1)
        return self._with(**changes)

    @classmethod
    def parse(cls, text: str, *, name: str = "camera") -> Self:
        """Read `1600x1200, f=1500 ± 10 px[, centre=799.5;599.5][, distortion=k1;k2;p1;p2;k3]`."""
        size, *pairs = (word.strip() for word in text.split(","))
        said = dict(pair.partition("=")[::2] for pair in pairs)
        try:
            width, height = (int(word) for word in size.lower().split("x"))
            lists = {key: [float(x) for x in said[key].split(";")] for key in ("centre", "distortion") if key in said}
        except ValueError:
            lists, said = {}, {}
        if len(lists.get("centre", (0, 0))) != 2:
            said = {}
        if "f" not in said or set(said) - {"f", "centre", "distortion"}:
            raise InputError(name, text, "write '1600x1200, f=1500 ± 10 px, centre=799.5;599.5', or @file.json")
        f = Quantity.parse(said["f"], "px", name=name)
        cx, cy = lists.get("centre", [(width - 1) / 2, (height - 1) / 2])
        k = lists.get("distortion")
        camera = cls(
            width,
            height,
            float(f.value),
            cx,
            cy,
            lens="brown_conrady" if k else "pinhole",
            distortion=np.array(k) if k else None,
            source=f.source,
        )
        cov = np.zeros((4 + camera.coefficients.size,) * 2)
        cov[0, 0] = float(f.u) ** 2
        return camera._with(cov=cov)

    def to_json(self) -> dict[str, Any]:
        data: dict[str, Any] = {
            "width_px": self.width_px, "height_px": self.height_px, "lens": self.lens, "f_px": plain(self.f_px),
            "aspect": plain(self.aspect), "cx_px": plain(self.cx_px), "cy_px": plain(self.cy_px),
            "distortion": self.coefficients.tolist(), "cov": None if self.cov is None else self.cov.tolist(),
            "source": self.source, "nominal_focal_m": self.nominal_focal_m, "part_sources": dict(self.part_sources),
        }  # fmt: skip
        return {**data, "id": self.id} if self.id else data

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Self:
        """The inverse of `to_json`."""
        known = {f.name: data[f.name] for f in fields(cls) if f.name in data}
        for name in ("f_px", "aspect", "cx_px", "cy_px", "distortion", "cov"):
            if isinstance(known.get(name), list):
                known[name] = np.asarray(known[name], float)
        return cls(**known)
