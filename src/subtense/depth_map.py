"""DepthMap: how far away what each pixel shows is, with its doubt."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .arrays import Array, Bools
from .camera import Camera
from .errors import InputError


@dataclass(frozen=True, eq=False)
class DepthMap:
    """Depth along the optical axis of a camera, for each pixel of its picture, in the camera's frame.

    Attributes:
        depth_m: (height, width); NaN where there is no answer.
        sigma_m: (height, width) standard deviation of `depth_m`, all causes together; NaN where there is no answer. For
            small disparities the law is lopsided: intervals come from the way that made the map.
        filled: (height, width) whether a pixel was filled from its neighbours rather than seen.
        camera: that has this picture; `rays` of its pixels times range give points.
        source: which way made it, and of what.
        u_scale: relative standard deviation of a factor common to all depths; it is a part of `sigma_m`, and what two points
            of one map share.
    """

    depth_m: Array
    sigma_m: Array
    filled: Bools
    camera: Camera
    source: str
    u_scale: float = 0.0

    def __post_init__(self) -> None:
        depth, sigma = np.asarray(self.depth_m), np.asarray(self.sigma_m)
        filled, size = np.asarray(self.filled, bool), (self.camera.height_px, self.camera.width_px)
        for name, array in (("depth_m", depth), ("sigma_m", sigma), ("filled", filled)):
            if array.shape != size:
                raise InputError(
                    name, f"of shape {array.shape}", f"give {size[0]} rows of {size[1]}, as the camera has"
                )
            object.__setattr__(self, name, array)
        answered = ~np.isnan(depth)
        if not np.all(np.isfinite(depth[answered]) & (depth[answered] > 0)):
            raise InputError("depth_m", "infinite or not above 0", "give depths above 0, and NaN where there is none")
        if not np.all(np.isfinite(sigma[answered]) & (sigma[answered] >= 0)):
            raise InputError(
                "sigma_m", "missing at a depth", "give a standard deviation of 0 or above with every depth"
            )
        if not 0 <= self.u_scale < np.inf:
            raise InputError("u_scale", self.u_scale, "give a relative standard deviation of 0 or above")

    @property
    def answered(self) -> Bools:
        """(height, width) where there is a depth, seen or filled."""
        return np.asarray(~np.isnan(self.depth_m))

    def points_m(self) -> Array:
        """(height, width, 3) places in the camera's frame, x right, y down, z forward; NaN where there is no answer."""
        x, y = np.meshgrid(np.arange(self.camera.width_px, dtype=float), np.arange(self.camera.height_px, dtype=float))
        rays = self.camera.rays(np.stack([x, y], -1))
        with np.errstate(invalid="ignore", divide="ignore"):
            scale = self.depth_m / rays[..., 2]
        return np.asarray(np.where(rays[..., 2:] > 0, rays * scale[..., None], np.nan))
