"""Reconstruction: a scene from pictures alone, by COLMAP's structure from motion.

Features (SIFT), matching (all pairs, neighbours in the order of names, or neighbours by position), geometric verification, and
incremental or global mapping are COLMAP's. Pixel (0, 0) is the centre of the first pixel here and at (0.5, 0.5) there.

Source: J. Schoenberger, J.-M. Frahm, Structure-from-motion revisited, CVPR 2016; L. Pan et al., Global structure-from-motion
revisited, ECCV 2024.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..camera import Camera
from ..errors import InputError, MissingExtraError, NothingFoundError
from ..scene import Scene

MATCHING = ("exhaustive", "sequential", "position")
MAPPING = ("incremental", "global")
WELL_KNOWN = 0.005
"""Relative u of a focal length below which the mapper holds the camera; the final adjustment frees it as far as its u allows."""
SMALL_ANGLE_DEG = 0.4
"""Least angle between two lines of sight of a point, where pictures taken close together give no scene otherwise."""
LEAST_POINTS = 30
Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class Picture:
    """One picture to be used.

    Attributes:
        name: unique.
        path: of a file that COLMAP reads, upright.
        camera: index of its camera.
        position_m: (x, y, z) where it was taken, for matching by position; None if unknown.
    """

    name: str
    path: Path
    camera: int
    position_m: tuple[float, float, float] | None = None


@dataclass(frozen=True)
class Settings:
    """How to go about it.

    Attributes:
        matching: of MATCHING.
        mapping: of MAPPING.
        most_features: of a picture.
        threads: None for as many as there are cores.
    """

    matching: str = "exhaustive"
    mapping: str = "incremental"
    most_features: int = 8192
    threads: int | None = None


def engine() -> Any:
    """The module pycolmap, quiet.

    Raises:
        MissingExtraError: it is not installed.
    """
    try:
        import pycolmap
    except ImportError:
        raise MissingExtraError("reconstruction", "sfm") from None
    pycolmap.logging.minloglevel = 2
    return pycolmap


def reconstruct(
    pictures: Sequence[Picture], cameras: Sequence[Camera], settings: Settings | None = None,
    progress: Progress | None = None,
) -> Scene:  # fmt: skip
    """The largest scene that the pictures give, in a unit of its own, not yet adjusted.

    Args:
        pictures: two or more.
        cameras: what is known of each, with covariance.
        settings: how to go about it.
        progress: is told what is done, and the share of all work.

    Raises:
        NothingFoundError: the pictures do not make a scene.
    """
    settings = settings or Settings()
    say = progress or _silent
    if settings.matching not in MATCHING:
        raise InputError("--matching", settings.matching, f"give {', '.join(MATCHING)}")
    if settings.mapping not in MAPPING:
        raise InputError("--mapping", settings.mapping, f"give {', '.join(MAPPING)}")
    colmap = engine()
    with tempfile.TemporaryDirectory(prefix="subtense-") as folder, _quiet(colmap):
        work = _Work(colmap, Path(folder), pictures, cameras, settings)
        work.features(say)
        say("matching", 0.5)
        work.match()
        say("placing pictures", 0.65)
        found = work.mapped()
        say("placing pictures", 0.95)
        return scene_of(
            found, tuple(picture.name for picture in pictures), cameras, {p.name: p.camera for p in pictures}
        )


def _silent(_title: str, _share: float) -> None:
    """Nobody wants to be told."""


@contextmanager
def _quiet(colmap: Any) -> Iterator[None]:
    """Without the engine's own lines on the error stream."""
    before = colmap.logging.minloglevel
    colmap.logging.minloglevel = 3
    try:
        yield
    finally:
        colmap.logging.minloglevel = before


@dataclass(frozen=True)
class _Work:
    """One run of the engine in a folder of its own."""

    colmap: Any
    folder: Path
    pictures: Sequence[Picture]
    cameras: Sequence[Camera]
    settings: Settings

    @property
    def images(self) -> Path:
        return self.folder / "images"

    @property
    def database(self) -> Path:
        return self.folder / "database.db"

    def features(self, progress: Progress) -> None:
        """Keypoints of every picture, camera by camera."""
        self.images.mkdir()
        done = 0
        for c, camera in enumerate(self.cameras):
            mine = [picture for picture in self.pictures if picture.camera == c]
            reader = self.colmap.ImageReaderOptions()
            reader.camera_model, params = colmap_camera(camera)
            reader.camera_params = ",".join(repr(float(x)) for x in params)
            options = self.colmap.FeatureExtractionOptions()
            options.sift.max_num_features = self.settings.most_features
            if self.settings.threads:
                options.num_threads = self.settings.threads
            for picture in mine:
                (self.images / picture.name).parent.mkdir(parents=True, exist_ok=True)
                (self.images / picture.name).symlink_to(picture.path.resolve())
            share = max(
                2 * (self.settings.threads or os.cpu_count() or 1), -(-len(mine) // 8)
            )  # in parts, so that there is something to tell
            camera_id = None
            for first in range(0, len(mine), share):
                progress("finding features", 0.5 * done / len(self.pictures))
                part = [picture.name for picture in mine[first : first + share]]
                if camera_id is not None:
                    reader.existing_camera_id = camera_id
                self.colmap.extract_features(self.database, self.images, image_names=part, camera_mode=self.colmap.CameraMode.SINGLE,
                                             reader_options=reader, extraction_options=options)  # fmt: skip
                camera_id = self._camera_of(part[0])
                done += len(part)

    def _camera_of(self, name: str) -> int:
        with self.colmap.Database.open(self.database) as database:
            return int(database.read_image_with_name(name).camera_id)

    def match(self) -> None:
        """Pairs of pictures, verified."""
        if self.settings.matching == "sequential":
            self.colmap.match_sequential(self.database)
        elif self.settings.matching == "position":
            self._write_positions()
            self.colmap.match_spatial(self.database)
        else:
            self.colmap.match_exhaustive(self.database)

    def _write_positions(self) -> None:
        if any(picture.position_m is None for picture in self.pictures):
            raise InputError(
                "--matching", "position", "it needs the position of every picture; use exhaustive or sequential"
            )
        with self.colmap.Database.open(self.database) as database:
            for picture in self.pictures:
                image = database.read_image_with_name(picture.name)
                prior = self.colmap.PosePrior()
                prior.position = np.array(picture.position_m)
                prior.coordinate_system = self.colmap.PosePriorCoordinateSystem.CARTESIAN
                prior.corr_data_id = image.data_id
                database.write_pose_prior(prior)

    def mapped(self) -> Any:
        """The largest model; where none is found, one of small parallax is looked for.

        Raises:
            NothingFoundError: there is none.
        """
        for least_rad in (None, SMALL_ANGLE_DEG):
            models = [
                m for m in self._models(least_rad) if m.num_reg_images() >= 2 and m.num_points3D() >= LEAST_POINTS
            ]
            if models:
                return max(models, key=lambda model: (model.num_reg_images(), model.num_points3D()))
        raise NothingFoundError(f"no scene: the {len(self.pictures)} pictures do not see enough of the same from different places"
                                "; take them overlapping by two thirds, and move between them rather than turn",
                                found=0, needed=2)  # fmt: skip

    def _models(self, least_deg: float | None) -> list[Any]:
        out = self.folder / ("models" if least_deg is None else "close")
        out.mkdir()
        held = all(camera.cov is None or camera.u_f_px < WELL_KNOWN * float(camera.f_px) for camera in self.cameras)
        if self.settings.mapping == "global":
            if least_deg is not None:
                return []
            return list(
                self.colmap.global_mapping(
                    self.database, self.images, out, self.colmap.GlobalPipelineOptions()
                ).values()
            )
        options = self.colmap.IncrementalPipelineOptions()
        options.min_model_size = 2
        options.max_num_models = 3
        options.random_seed = 1
        options.ba_refine_focal_length = options.ba_refine_extra_params = not held
        if self.settings.threads:
            options.num_threads = self.settings.threads
        if least_deg is not None:
            options.mapper.init_min_tri_angle = 2 * least_deg
            options.mapper.filter_min_tri_angle = options.triangulation.min_angle = least_deg
            options.triangulation.ignore_two_view_tracks = False
        return list(self.colmap.incremental_mapping(self.database, self.images, out, options).values())


def colmap_camera(camera: Camera) -> tuple[str, list[float]]:
    """COLMAP's model and parameters; its first pixel's centre is at (0.5, 0.5).

    Raises:
        InputError: a lens that COLMAP has no model of.
    """
    fx, fy = float(camera.f_px), float(camera.f_px) * float(camera.aspect)
    inner = [fx, fy, float(camera.cx_px) + 0.5, float(camera.cy_px) + 0.5]
    k = camera.coefficients.tolist()
    if camera.lens in ("pinhole", "brown_conrady") and float(camera.aspect) == 1 and not any(k[2:]):
        return "RADIAL", [inner[0], *inner[2:], *(k[:2] if k else (0.0, 0.0))]  # one focal length: less to go astray
    if camera.lens == "fisheye":
        return "OPENCV_FISHEYE", [*inner, *k]
    if camera.lens == "pinhole":
        return "OPENCV", [*inner, 0.0, 0.0, 0.0, 0.0]
    if camera.lens == "brown_conrady" and not any(k[8:]):
        if not any(k[4:]):
            return "OPENCV", [*inner, *k[:4]]
        return "FULL_OPENCV", [*inner, *k[:5], *(k[5:8] if len(k) > 5 else (0.0, 0.0, 0.0))]
    raise InputError("camera", f"of the lens {camera.lens}", "reconstruct from perspective or fisheye pictures")


def camera_with(camera: Any, before: Camera) -> Camera:
    """The camera that COLMAP ended with, as far as its numbers were open, with what was known of it before as its covariance."""
    if before.cov is None:
        return before
    fx, fy = camera.focal_length_x, camera.focal_length_y
    extra = {"RADIAL": (3, 5), "OPENCV": (4, 8), "FULL_OPENCV": (4, 9), "OPENCV_FISHEYE": (4, 8)}[camera.model.name]
    k = [float(x) for x in camera.params[slice(*extra)]]
    open_k = np.diag(before.cov)[4:] > 0
    now = np.zeros(before.coefficients.size)
    now[: len(k)] = k[: len(now)]
    aspect = fy / fx if before.cov[1, 1] > 0 else float(before.aspect)
    kept = np.where(open_k, now, before.coefficients)
    return replace(before, f_px=float(fx), aspect=float(aspect), distortion=kept if len(kept) else None, id=None)


def scene_of(model: Any, names: Sequence[str], cameras: Sequence[Camera], camera_of: dict[str, int]) -> Scene:
    """A COLMAP reconstruction as a Scene."""
    images = sorted(
        (image for image in model.images.values() if image.has_pose), key=lambda image: list(names).index(image.name)
    )
    ids = np.array(sorted(model.points3D), dtype=np.int64)
    view, point, seen = [], [], []
    now = list(cameras)
    for i, image in enumerate(images):
        which = camera_of[image.name]
        now[which] = camera_with(model.cameras[image.camera_id], cameras[which])
        own = [(p.point3D_id, p.xy) for p in image.points2D if p.has_point3D()]
        view.append(np.full(len(own), i))
        point.append(np.searchsorted(ids, np.array([one[0] for one in own], dtype=np.int64)))
        seen.append(np.array([one[1] for one in own]).reshape(-1, 2) - 0.5)
    poses = [image.cam_from_world() for image in images]
    return Scene(
        tuple(image.name for image in images), tuple(now), np.array([camera_of[image.name] for image in images]),
        np.array([pose.rotation.matrix() for pose in poses]), np.array([image.projection_center() for image in images]),
        np.array([model.points3D[i].xyz for i in ids]).reshape(-1, 3),
        np.array([model.points3D[i].color for i in ids], np.uint8).reshape(-1, 3),
        np.concatenate(view), np.concatenate(point), np.concatenate(seen),
        left_out=tuple(name for name in names if name not in {image.name for image in images}),
    )  # fmt: skip
