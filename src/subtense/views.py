"""Views: pictures of one scene with the places they were taken from; Track: one point in several of them.

A view is a camera with its rotation camera_from_world and its centre (the entrance pupil) in the world's frame. All their numbers have
one joint covariance, because what is known of two pictures is rarely independent: they share a camera, or a bundle adjustment.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np

from .arrays import Array
from .assumptions import CLICK_SIGMA_PX
from .camera import Camera
from .errors import InputError
from .geometry import rotation_from_vector
from .noun import Noun, Part
from .observation import Observation
from .quantity import Quantity

_PLACE = 6
_CAMERA_GROUPS = (
    ("focal length", 0, 1),
    ("pixel aspect", 1, 2),
    ("principal point", 2, 4),
    ("lens distortion", 4, None),
)


@dataclass(frozen=True, eq=False)
class Views(Noun):
    """Posed cameras.

    Attributes:
        names: of the pictures, V of them, all different.
        cameras: the distinct cameras; pictures of one camera share its errors.
        camera_of: (V,) which of `cameras` took each picture; None where there is one camera, or one for each picture.
        rotation: (..., V, 3, 3) camera_from_world.
        centre_m: (..., V, 3) of the entrance pupils, in the world's frame.
        cov: (6 V + sum of cameras' numbers) square: for each view the rotation vector (rad, in the camera's frame, on the left) and the
            centre (m), then for each camera its numbers in the order of `Camera.cov`. None: places exact, cameras by their own.
        u_scale: relative standard deviation of all lengths of the world's frame together, beside `cov`.
        scale: what the centres are multiplied by, 1 but for draws; (...).
        source: where it comes from.
        scale_source: where the scale comes from.
        id: given, or the digest of the content.
    """

    names: tuple[str, ...]
    cameras: tuple[Camera, ...]
    rotation: Array
    centre_m: Array
    camera_of: tuple[int, ...] | None = None
    cov: Array | None = None
    u_scale: float = 0.0
    scale: float | Array = 1.0
    source: str = "stated"
    scale_source: str = "stated"
    id: str | None = None

    widget: ClassVar[str] = "text"
    core: ClassVar[Mapping[str, int]] = {"rotation": 3, "centre_m": 2, "scale": 0}

    def __post_init__(self) -> None:
        count = len(self.names)
        if count < 1 or len(set(self.names)) != count:
            raise InputError("views", ", ".join(self.names) or "none", "give each picture once, by its own name")
        if self.camera_of is None:
            same = len(self.cameras) == 1
            object.__setattr__(self, "camera_of", (0,) * count if same else tuple(range(count)))
        places = (np.shape(self.rotation)[-3:], np.shape(self.centre_m)[-2:])
        if places != ((count, 3, 3), (count, 3)):
            raise InputError(
                "views",
                f"{count} names, rotations {places[0]}, centres {places[1]}",
                "give one of each for each picture",
            )
        if len(self.of_view) != count or not all(0 <= c < len(self.cameras) for c in self.of_view):
            raise InputError(
                "camera_of", self.camera_of, f"give one of the {len(self.cameras)} cameras for each of {count} pictures"
            )
        object.__setattr__(self, "rotation", np.asarray(self.rotation, float))
        object.__setattr__(self, "centre_m", np.asarray(self.centre_m, float))
        if not (np.all(np.isfinite(self.rotation)) and np.all(np.isfinite(self.centre_m))):
            raise InputError("views", "a place that is not finite", "give finite rotations and centres")
        self._check_cov()

    def _check_cov(self) -> None:
        size = self.starts[-1]
        if self.cov is None:
            cov = np.zeros((size, size))
            for camera, start in zip(self.cameras, self.starts, strict=False):
                if camera.cov is not None:
                    cov[start : start + len(camera.cov), start : start + len(camera.cov)] = camera.cov
            object.__setattr__(self, "cov", cov)
        elif np.shape(self.cov) != (size, size) or not np.all(np.isfinite(self.cov)):
            raise InputError(
                "cov", f"of shape {np.shape(self.cov)}", f"give {size} x {size} finite numbers, places then cameras"
            )

    @property
    def of_view(self) -> tuple[int, ...]:
        """Which camera took each picture."""
        assert self.camera_of is not None
        return self.camera_of

    @property
    def covariance(self) -> Array:
        """The joint covariance, never None."""
        assert self.cov is not None
        return self.cov

    @cached_property
    def starts(self) -> tuple[int, ...]:
        """Where each camera's numbers begin in the covariance, and its size."""
        sizes = [4 + camera.coefficients.shape[-1] for camera in self.cameras]
        return tuple(int(n) for n in np.cumsum([_PLACE * len(self.names), *sizes]))

    @cached_property
    def digest(self) -> str:
        return super().digest

    @classmethod
    def independent(
        cls, names: Sequence[str], cameras: Sequence[Camera], rotation: Array, centre_m: Array, *,
        u_rotation_rad: float | Array = 0.0, u_centre_m: float | Array = 0.0, **more: Any,
    ) -> Self:  # fmt: skip
        """Views whose places are known independently of each other.

        Args:
            names: of the pictures.
            cameras: one, or one for each picture.
            rotation: (V, 3, 3) camera_from_world.
            centre_m: (V, 3).
            u_rotation_rad: about each axis of the camera; one, or (V, 3).
            u_centre_m: of each coordinate; one, or (V, 3).
            more: further fields.
        """
        made = cls(tuple(names), tuple(cameras), rotation, centre_m, **more)
        u = np.concatenate([np.broadcast_to(x, (len(names), 3)) for x in (u_rotation_rad, u_centre_m)], axis=1)
        cov = np.array(made.covariance)
        cov[: u.size, : u.size] = np.diag(u.reshape(-1) ** 2)
        return replace(made, cov=cov)

    def index(self, name: str) -> int:
        """Which view has this name.

        Raises:
            InputError: none has.
        """
        if name not in self.names:
            shown = ", ".join(self.names[:6]) + (", ..." if len(self.names) > 6 else "")
            raise InputError("picture", name, f"known are {shown}")
        return self.names.index(name)

    def camera(self, view: int) -> Camera:
        """The camera of a view."""
        return self.cameras[self.of_view[view]]

    def numbers_of(self, names: Sequence[str]) -> list[int]:
        """Which numbers of the covariance are those of these pictures: their places, then their cameras."""
        picked = [self.index(name) for name in dict.fromkeys(names)]
        cameras = sorted({self.of_view[i] for i in picked})
        places = [_PLACE * i + k for i in picked for k in range(_PLACE)]
        return places + [k for c in cameras for k in range(self.starts[c], self.starts[c + 1])]

    def subset(self, names: Sequence[str]) -> Views:
        """These pictures only, in this order, with their joint covariance."""
        picked = [self.index(name) for name in dict.fromkeys(names)]
        cameras = sorted({self.of_view[i] for i in picked})
        rows = self.numbers_of(names)
        return replace(
            self, names=tuple(self.names[i] for i in picked), cameras=tuple(self.cameras[c] for c in cameras),
            rotation=self.rotation[..., picked, :, :], centre_m=self.centre_m[..., picked, :],
            camera_of=tuple(cameras.index(self.of_view[i]) for i in picked), cov=self.covariance[np.ix_(rows, rows)], id=None,
        )  # fmt: skip

    @property
    def nominal(self) -> Array:
        """(n,) the numbers of the covariance: places count from where they are."""
        return np.concatenate([np.zeros(_PLACE * len(self.names)), *(camera._vector() for camera in self.cameras)])

    @property
    def places_m(self) -> Array:
        """(..., V, 3) centres with the scale."""
        return np.asarray(self.centre_m * np.asarray(self.scale)[..., None, None])

    # -- as a noun -----------------------------------------------------------------------------------

    @property
    def leading(self) -> tuple[int, ...]:
        return np.broadcast_shapes(super().leading, *(camera.leading for camera in self.cameras))

    def parts(self) -> tuple[Part, ...]:
        found = []
        if self.u_scale:
            found.append(Part("scale", "scale", self.scale_source, np.ones(1), np.array([self.u_scale])))
        nominal = self.nominal
        for names, rows in self._independent():
            cov = self.covariance[np.ix_(rows, rows)]
            diagonal = not np.any(cov - np.diag(np.diag(cov)))
            label = ", ".join(names) if len(names) < 4 else "cameras and their places"
            source, u = self._source_of(rows, names), None if not diagonal else np.sqrt(np.diag(cov))
            found.append(Part(",".join(map(str, rows)), label, source, nominal[rows], u, None if diagonal else cov))
        return tuple(found)

    def _source_of(self, rows: list[int], names: list[str]) -> str:
        """That of the camera for numbers of one camera alone; that of the views else."""
        of = {int(np.searchsorted(self.starts, row, "right")) - 1 for row in rows}
        if len(of) != 1 or -1 in of:
            return self.source
        camera = self.cameras[of.pop()]
        kinds = [name.split(" of camera ")[0] for name in names]
        return "; ".join(dict.fromkeys(camera.part_sources.get(kind, camera.source) for kind in kinds))

    def _blocks(self) -> list[tuple[str, list[int]]]:
        """Named groups of numbers that are uncertain at all."""
        groups: list[tuple[str, list[int]]] = []
        for i, name in enumerate(self.names):
            groups += [
                (f"rotation of {name}", [6 * i, 6 * i + 1, 6 * i + 2]),
                (f"place of {name}", [6 * i + 3, 6 * i + 4, 6 * i + 5]),
            ]
        for c in range(len(self.cameras)):
            start, end = self.starts[c], self.starts[c + 1]
            for what, first, last in _CAMERA_GROUPS:
                of = what if len(self.cameras) == 1 else f"{what} of camera {c + 1}"
                groups.append((of, list(range(start + first, end if last is None else start + last))))
        moving = np.diag(self.covariance) > 0
        kept = [(name, [row for row in rows if moving[row]]) for name, rows in groups]
        return [(name, rows) for name, rows in kept if rows]

    def _independent(self) -> list[tuple[list[str], list[int]]]:
        """Groups joined where the covariance ties them."""
        joined: list[tuple[list[str], list[int]]] = []
        for name, rows in self._blocks():
            tied = [one for one in joined if np.any(self.covariance[np.ix_(one[1], rows)])]
            names = [n for one in tied for n in one[0]] + [name]
            merged = [r for one in tied for r in one[1]] + rows
            joined = [one for one in joined if one not in tied] + [(names, merged)]
        return joined

    def moved(self, values: Mapping[str, Array]) -> Self:
        rest = dict(values)
        changes: dict[str, Any] = {}
        if "scale" in rest:
            changes["scale"] = rest.pop("scale")[0]
        rows = {
            int(index): row for key, array in rest.items() for index, row in zip(key.split(","), array, strict=True)
        }
        lead = np.broadcast_shapes(*(np.shape(row) for row in rows.values())) if rows else ()
        places = {index: row for index, row in rows.items() if index < self.starts[0]}
        if places:
            step = np.zeros((*lead, len(self.names), _PLACE))
            for index, row in places.items():
                step[..., index // _PLACE, index % _PLACE] = row
            changes["rotation"] = rotation_from_vector(step[..., :3]) @ self.rotation
            changes["centre_m"] = self.centre_m + step[..., 3:]
        cameras = list(self.cameras)
        for c, start in enumerate(self.starts[:-1]):
            own = {i - start: rows[i] for i in range(start, self.starts[c + 1]) if i in rows}
            if own:
                cameras[c] = cameras[c].moved({",".join(map(str, own)): np.stack(np.broadcast_arrays(*own.values()))})
        return self._with(cameras=tuple(cameras), **changes)

    @classmethod
    def parse(cls, text: str, *, name: str = "views") -> Self:
        """Read `CAMERA | a.jpg 0,0,0 | b.jpg 0.5,0,0 [± 1mm]`: pictures of one camera that all look the same way, places in m."""
        head, *rest = text.split("|")
        if len(rest) < 2:
            raise InputError(
                name, text, "write '1600x1200, f=1500 ± 10 px | a.jpg 0,0,0 | b.jpg 0.5,0,0 ± 1mm', or @file.json"
            )
        names, centres, u = [], [], []
        for one in rest:
            place, _, doubt = one.replace("+-", "±").partition("±")
            word, _, numbers = place.strip().partition(" ")
            try:
                xyz = [float(x) for x in numbers.replace(";", ",").split(",")]
            except ValueError:
                xyz = []
            if len(xyz) != 3 or not np.all(np.isfinite(xyz)):
                raise InputError(
                    name, one.strip(), "write a picture and its place x,y,z in m, as 'b.jpg 0.5,0,0 ± 1mm'"
                )
            names.append(word)
            centres.append(xyz)
            u.append(float(Quantity.parse(f"0 ± {doubt.strip()}", "m", name=name).u) if doubt else 0.0)
        turns = np.broadcast_to(np.eye(3), (len(names), 3, 3))
        return cls.independent(names, [Camera.parse(head.strip(), name=name)], turns, np.array(centres),
                               u_centre_m=np.array(u)[:, None])  # fmt: skip

    def to_json(self) -> dict[str, Any]:
        data: dict[str, Any] = {
            "names": list(self.names), "cameras": [camera.to_json() for camera in self.cameras], "camera_of": list(self.of_view),
            "rotation": self.rotation.tolist(), "centre_m": self.centre_m.tolist(), "cov": self.covariance.tolist(),
            "u_scale": self.u_scale, "source": self.source, "scale_source": self.scale_source,
        }  # fmt: skip
        return {**data, "id": self.id} if self.id else data

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Self:
        """The inverse of `to_json`."""
        cov = data.get("cov")
        return cls(
            tuple(map(str, data["names"])), tuple(Camera.from_json(one) for one in data["cameras"]),
            np.asarray(data["rotation"], float), np.asarray(data["centre_m"], float),
            tuple(map(int, data["camera_of"])) if data.get("camera_of") is not None else None,
            None if cov is None else np.asarray(cov, float), float(data.get("u_scale", 0.0)),
            source=str(data.get("source", "stated")), scale_source=str(data.get("scale_source", "stated")), id=data.get("id"),
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class Track(Noun):
    """One point of the scene in several pictures.

    Attributes:
        names: of the pictures it is seen in; of one picture without a point, it is the place where that was taken.
        seen: point i lies in picture i.
        id: given, or the digest of the content.
    """

    names: tuple[str, ...]
    seen: Observation
    id: str | None = field(default=None)

    widget: ClassVar[str] = "text"

    def __post_init__(self) -> None:
        place = len(self.names) == 1 and self.seen.points_px.shape[-2] == 0
        if not place and (len(self.names) != self.seen.points_px.shape[-2] or len(set(self.names)) != len(self.names)):
            raise InputError(
                "track", ", ".join(self.names), "give one point in each picture, as 'a.jpg:120,80; b.jpg:95,82'"
            )

    @classmethod
    def place(cls, name: str) -> Self:
        """The place where a picture was taken."""
        return cls((name,), Observation(np.zeros((0, 2)), 0.0, label=name))

    @property
    def is_place(self) -> bool:
        """Whether it is the place of a picture rather than a point in some."""
        return bool(self.seen.points_px.shape[-2] == 0)

    @property
    def leading(self) -> tuple[int, ...]:
        return self.seen.leading

    def parts(self) -> tuple[Part, ...]:
        return () if self.is_place else self.seen.parts()

    def moved(self, values: Mapping[str, Array]) -> Self:
        return self._with(seen=self.seen.moved(values))

    @classmethod
    def parse(cls, text: str, *, name: str = "point", sigma_px: float = CLICK_SIGMA_PX) -> Self:
        """Read `a.jpg:120,80; b.jpg:95,82[ ± 0.5px]`."""
        head, _, tail = text.replace("+-", "±").partition("±")
        names, points = [], []
        for one in filter(None, (word.strip() for word in head.split(";"))):
            picture, _, place = one.rpartition(":")
            try:
                xy = [float(x) for x in place.split(",")]
            except ValueError:
                xy = []
            if not picture.strip() or len(xy) != 2 or not np.all(np.isfinite(xy)):
                raise InputError(name, one, "write a picture and a point in it, as 'a.jpg:120,80; b.jpg:95,82 ± 0.5px'")
            names.append(picture.strip())
            points.append(xy)
        if not names:
            raise InputError(name, text, "write a picture and a point in it, as 'a.jpg:120,80; b.jpg:95,82 ± 0.5px'")
        if tail:
            doubt = Quantity.parse(f"0 ± {tail.strip()}", "px", name=name)
            return cls(tuple(names), Observation(np.array(points), float(doubt.u), label=name, source=doubt.source))
        source = f"assumed: a clicked end is known to {sigma_px:g} px"
        return cls(tuple(names), Observation(np.array(points), sigma_px, label=name, source=source))

    def to_json(self) -> dict[str, Any]:
        data = {"names": list(self.names), "seen": self.seen.to_json()}
        return {**data, "id": self.id} if self.id else data

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Self:
        """The inverse of `to_json`."""
        return cls(tuple(map(str, data["names"])), Observation.from_json(data["seen"]), data.get("id"))
