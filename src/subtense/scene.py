"""Scene: posed pictures, the points they see, and how well all of that is known.

What pictures alone tell has no scale: a scene of which nobody said one is in units of its own, and says so. Lengths in metres come from a
scene with a scale only.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from .arrays import Array, Indices, Pixels
from .bundle import Bundle, Network
from .camera import Camera
from .errors import InputError
from .quantity import Note
from .views import Views

WHAT_TO_GIVE = (
    "give a scale: a known distance between two points or two cameras, markers of known size, positions, or a baseline"
)


@dataclass(frozen=True, eq=False)
class Scene:
    """A reconstruction.

    Attributes:
        names: of the pictures that have a place, V of them.
        cameras: the distinct cameras, with their covariance as it is now known.
        camera_of: (V,) which took each picture.
        rotation: (V, 3, 3) camera_from_world.
        centre: (V, 3) of the entrance pupils; metres where `u_scale` is not None, else the scene's own unit.
        points: (P, 3), in the same unit.
        colour: (P, 3) uint8.
        view: (M,) the picture of each observation.
        point: (M,) its point.
        seen_px: (M, 2).
        cov: as `Views.cov`, in the same unit; None where nothing tells it (a file of another program).
        u_scale: relative standard deviation of the scale, beside what `cov` holds of it; None without a scale.
        sigma_px: of an observation, as the residuals show.
        inflation: by how much `cov` was widened because residuals hang together.
        left_out: pictures that have no place.
        origin_m: (3,) what is to be added to places to get those of the reference frame; None where there is none.
        frame: what the reference frame is, as "EPSG:32632"; empty where there is none.
        scale_source: where the scale comes from.
        notes: doubts about the whole.
    """

    names: tuple[str, ...]
    cameras: tuple[Camera, ...]
    camera_of: Indices
    rotation: Array
    centre: Array
    points: Array
    colour: Pixels
    view: Indices
    point: Indices
    seen_px: Array
    cov: Array | None = None
    u_scale: float | None = None
    sigma_px: float = 0.0
    inflation: float = 1.0
    left_out: tuple[str, ...] = ()
    origin_m: Array | None = None
    frame: str = ""
    scale_source: str = ""
    notes: tuple[Note, ...] = field(default=())

    @property
    def metric(self) -> bool:
        """Whether it is in metres."""
        return self.u_scale is not None

    @property
    def network(self) -> Network:
        """What a bundle adjustment takes."""
        return Network(
            self.cameras, self.camera_of, self.rotation, self.centre, self.points, self.view, self.point, self.seen_px
        )

    def adjusted(self, bundle: Bundle) -> Scene:
        """With the places and cameras of an adjustment of some of its points; the points follow by themselves."""
        n = bundle.network
        found = replace(self, cameras=n.cameras, rotation=n.rotation, centre=n.centre, cov=bundle.cov, sigma_px=bundle.sigma_px,
                        inflation=bundle.inflation)  # fmt: skip
        return replace(found, points=found.intersected())

    def intersected(self) -> Array:
        """(P, 3) each point where its lines of sight are nearest to each other, weighed by their nearness."""
        direction = np.empty((len(self.view), 3))
        for c, camera in enumerate(self.cameras):
            mine = self.camera_of[self.view] == c
            direction[mine] = camera.rays(self.seen_px[mine])
        direction = np.einsum("mji,mj->mi", self.rotation[self.view], direction)
        start = self.centre[self.view]
        far = np.maximum(np.linalg.norm(self.points[self.point] - start, axis=1), 1e-12)
        weight = np.where(np.isfinite(direction).all(axis=1), 1 / far**2, 0.0)
        across = (np.eye(3) - direction[:, :, None] * direction[:, None, :]) * weight[:, None, None]
        across = np.nan_to_num(across)
        normal, right = np.zeros((len(self.points), 3, 3)), np.zeros((len(self.points), 3))
        np.add.at(normal, self.point, across)
        np.add.at(right, self.point, np.einsum("mij,mj->mi", across, start))
        trace = np.trace(normal, axis1=1, axis2=2)
        fine = np.linalg.det(normal) > 1e-12 * np.maximum(trace, 1e-300) ** 3
        normal[~fine] = np.eye(3)
        found = np.linalg.solve(normal, right[..., None])[..., 0]
        return np.where(fine[:, None], found, self.points)

    def residual_px(self) -> Array:
        """(M, 2) projected less seen."""
        return self.network.residual_px()

    @property
    def tracks(self) -> Array:
        """(P,) in how many pictures each point is seen."""
        return np.bincount(self.point, minlength=len(self.points)).astype(float)

    def views(self) -> Views:
        """Its pictures with their places.

        Raises:
            InputError: it has no scale, or nothing tells how well its places are known.
        """
        if self.u_scale is None:
            raise InputError("scale", None, WHAT_TO_GIVE)
        return Views(self.names, self.cameras, self.rotation, self.centre, tuple(map(int, self.camera_of)), self.cov, self.u_scale,
                     source="bundle adjustment", scale_source=self.scale_source)  # fmt: skip

    def scaled(self, factor: float, cov: Array, u_scale: float, source: str) -> Scene:
        """In metres: all lengths times `factor`, with the covariance that goes with it."""
        return replace(
            self,
            centre=self.centre * factor,
            points=self.points * factor,
            cov=cov,
            u_scale=u_scale,
            scale_source=source,
        )

    def moved(self, turn: Array, shift_m: Array, frame: str = "", origin_m: Array | None = None) -> Scene:
        """In another frame: a place p becomes turn @ p + shift."""
        cov = None
        if self.cov is not None:
            jacobian = np.eye(len(self.cov))
            for i in range(len(self.names)):
                jacobian[6 * i + 3 : 6 * i + 6, 6 * i + 3 : 6 * i + 6] = turn
            cov = jacobian @ self.cov @ jacobian.T
        return replace(self, rotation=self.rotation @ turn.T, centre=self.centre @ turn.T + shift_m, points=self.points @ turn.T + shift_m,
                       cov=cov, frame=frame, origin_m=origin_m)  # fmt: skip

    def to_json(self) -> dict[str, Any]:
        """Pictures, cameras and figures; not the points."""
        residual = self.residual_px()
        rms = float(np.sqrt(np.nanmean(residual**2))) if len(residual) else None
        return {
            "names": list(self.names), "left_out": list(self.left_out), "cameras": [camera.to_json() for camera in self.cameras],
            "camera_of": [int(c) for c in self.camera_of], "rotation": self.rotation.tolist(), "centre": self.centre.tolist(),
            "unit": "m" if self.metric else "of its own", "u_scale": self.u_scale, "scale_source": self.scale_source,
            "points": len(self.points), "observations": len(self.view), "rms_px": rms, "sigma_px": self.sigma_px,
            "inflation": self.inflation, "origin_m": None if self.origin_m is None else self.origin_m.tolist(), "frame": self.frame,
            "notes": [note.to_json() for note in self.notes],
        }  # fmt: skip
