"""Camera model, lens resampling and film development of the example pictures."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from PIL import ExifTags, Image
from PIL.TiffImagePlugin import IFDRational
from scipy import ndimage

FULL_FRAME_DIAGONAL_MM = 43.267


@dataclass(frozen=True)
class Camera:
    """Brown-Conrady camera with a pose; pixel (0, 0) is the centre of the top-left pixel."""

    width: int
    height: int
    f_px: float
    cx: float
    cy: float
    distortion: tuple[float, float, float, float, float]
    rotation: np.ndarray
    centre: np.ndarray
    aspect: float = 1.0

    @property
    def translation(self) -> np.ndarray:
        """Translation t of X_camera = R X_world + t."""
        return -self.rotation @ self.centre

    def to_camera(self, world: np.ndarray) -> np.ndarray:
        """World points (N, 3) in camera axes."""
        return np.asarray(world, float) @ self.rotation.T + self.translation

    def distort(self, xy: np.ndarray) -> np.ndarray:
        """Normalised pinhole coordinates to distorted ones."""
        k1, k2, p1, p2, k3 = self.distortion
        x, y = xy[..., 0], xy[..., 1]
        r2 = x * x + y * y
        radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
        xd = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
        yd = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
        return np.stack([xd, yd], axis=-1)

    def undistort(self, xyd: np.ndarray) -> np.ndarray:
        """Invert :meth:`distort` by fixed-point iteration down to rounding error."""
        xy = np.array(xyd, float)
        for _ in range(100):
            step = xyd - self.distort(xy)
            xy += step
            if np.abs(step).max() < 1e-13:
                break
        return xy

    def pixel_of_normalised(self, xyd: np.ndarray) -> np.ndarray:
        """Distorted normalised coordinates to pixels."""
        scale = np.array([self.f_px, self.f_px * self.aspect])
        return xyd * scale + np.array([self.cx, self.cy])

    def normalised_of_pixel(self, pixel: np.ndarray) -> np.ndarray:
        """Pixels to undistorted normalised coordinates."""
        scale = np.array([self.f_px, self.f_px * self.aspect])
        return self.undistort((np.asarray(pixel, float) - [self.cx, self.cy]) / scale)

    def project(self, world: np.ndarray) -> np.ndarray:
        """World points (N, 3) to distorted pixels (N, 2)."""
        p = self.to_camera(world)
        return self.pixel_of_normalised(self.distort(p[..., :2] / p[..., 2:]))

    def as_dict(self) -> dict:
        """Intrinsics as written to the truth file."""
        return {
            "model": "brown_conrady",
            "f_px": self.f_px,
            "aspect": self.aspect,
            "cx_px": self.cx,
            "cy_px": self.cy,
            "distortion": list(self.distortion),
        }


def look_at(centre, target, roll_deg: float = 0.0, up=(0.0, 0.0, 1.0)) -> np.ndarray:
    """Camera-from-world rotation (x right, y down, z forward) looking at a target."""
    forward = np.subtract(target, centre).astype(float)
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, up)
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(forward, right), forward])
    return rotation_z(roll_deg) @ rotation


def rotation_x(deg: float) -> np.ndarray:
    """Rotation matrix about x."""
    c, s = math.cos(math.radians(deg)), math.sin(math.radians(deg))
    return np.array([[1, 0, 0], [0, c, -s], [0, s, c]])


def rotation_y(deg: float) -> np.ndarray:
    """Rotation matrix about y."""
    c, s = math.cos(math.radians(deg)), math.sin(math.radians(deg))
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


def rotation_z(deg: float) -> np.ndarray:
    """Rotation matrix about z."""
    c, s = math.cos(math.radians(deg)), math.sin(math.radians(deg))
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])


@dataclass(frozen=True)
class Pinhole:
    """Centred, distortion-free camera of the renderer; it covers the whole lens picture."""

    width: int
    height: int
    f_px: float

    @property
    def fov_x_deg(self) -> float:
        """Horizontal field of view in degrees."""
        return 2 * math.degrees(math.atan(self.width / (2 * self.f_px)))


def covering_pinhole(camera: Camera, oversampling: float) -> Pinhole:
    """Smallest centred pinhole picture that covers all of the distorted picture."""
    w, h = camera.width, camera.height
    u, v = np.linspace(-0.5, w - 0.5, 401), np.linspace(-0.5, h - 0.5, 401)
    border = [np.stack([u, np.full_like(u, e)], -1) for e in (-0.5, h - 0.5)]
    border += [np.stack([np.full_like(v, e), v], -1) for e in (-0.5, w - 0.5)]
    xy = np.abs(camera.normalised_of_pixel(np.concatenate(border))).max(axis=0)
    f_px = camera.f_px * oversampling
    size = [2 * (math.ceil(extent * f_px) + 2) for extent in xy]
    return Pinhole(size[0], size[1], f_px)


def resample(source: np.ndarray, pinhole: Pinhole, camera: Camera, sub: int = 4) -> np.ndarray:
    """Linear-light pinhole picture to the lens picture: mean of sub x sub rays per pixel."""
    out = np.empty((camera.height, camera.width, 3), np.float32)
    offsets = (np.arange(sub) + 0.5) / sub - 0.5
    u = (np.arange(camera.width)[:, None] + offsets).ravel()
    for top in range(0, camera.height, 60):
        rows = np.arange(top, min(top + 60, camera.height))
        v = (rows[:, None] + offsets).ravel()
        xy = camera.normalised_of_pixel(np.stack(np.meshgrid(u, v), -1))
        # The film's continuous coordinate is 0 at the left edge of source pixel 0.
        column = xy[..., 0] * pinhole.f_px + pinhole.width / 2 - 0.5
        row = xy[..., 1] * pinhole.f_px + pinhole.height / 2 - 0.5
        for channel in range(3):
            fine = ndimage.map_coordinates(source[..., channel], [row, column], order=1, mode="nearest")
            fine = fine.reshape(len(rows), sub, camera.width, sub)
            out[rows, :, channel] = fine.mean(axis=(1, 3))
    return out


def vignette(linear: np.ndarray, camera: Camera, strength: float) -> np.ndarray:
    """Darken the corners: 1 - strength at the farthest corner, growing with radius squared."""
    v, u = np.mgrid[: camera.height, : camera.width]
    r2 = (u - camera.cx) ** 2 + (v - camera.cy) ** 2
    return linear * (1 - strength * r2 / r2.max())[..., None].astype(np.float32)


def add_noise(linear: np.ndarray, seed: int) -> np.ndarray:
    """Shot and read noise in linear light (about 1 grey level after encoding)."""
    rng = np.random.default_rng(seed)
    sigma = np.sqrt(6e-5 * np.maximum(linear, 0) + 0.0006**2)
    return linear + rng.normal(size=linear.shape) * sigma


def encode_srgb(linear: np.ndarray) -> np.ndarray:
    """Linear light in 0..1 to 8-bit sRGB codes (IEC 61966-2-1)."""
    x = np.clip(linear, 0, 1)
    code = np.where(x <= 0.0031308, 12.92 * x, 1.055 * np.power(x, 1 / 2.4) - 0.055)
    return np.round(code * 255).astype(np.uint8)


def decode_srgb(code: np.ndarray) -> np.ndarray:
    """8-bit sRGB codes to linear light."""
    x = np.asarray(code, float) / 255
    return np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4)


def develop(linear: np.ndarray, camera: Camera, exposure: float, seed: int) -> np.ndarray:
    """Optical blur, vignetting, exposure, noise and the sRGB curve, in that order."""
    blurred = ndimage.gaussian_filter(linear, (0.6, 0.6, 0))
    return encode_srgb(add_noise(vignette(blurred, camera, 0.12) * exposure, seed))


@dataclass(frozen=True)
class Nominal:
    """What the maker prints on the camera: used for EXIF, not for rendering."""

    model: str
    focal_mm: float
    sensor_width_mm: float
    sensor_height_mm: float
    focal_plane_resolution: bool = False

    @property
    def f35(self) -> int:
        """Equivalent focal length by the diagonal rule."""
        diagonal = math.hypot(self.sensor_width_mm, self.sensor_height_mm)
        return round(self.focal_mm * FULL_FRAME_DIAGONAL_MM / diagonal)


def build_exif(nominal: Nominal, stored_size: tuple[int, int], orientation: int) -> Image.Exif:
    """EXIF block of one picture; sizes are those of the stored (unrotated) pixels."""
    exif = Image.Exif()
    exif[ExifTags.Base.Make] = "subtense"
    exif[ExifTags.Base.Model] = nominal.model
    exif[ExifTags.Base.Orientation] = orientation
    exif[ExifTags.Base.Software] = "render_examples"
    sub = exif.get_ifd(ExifTags.IFD.Exif)
    sub[ExifTags.Base.FocalLength] = IFDRational(round(nominal.focal_mm * 100), 100)
    sub[ExifTags.Base.FocalLengthIn35mmFilm] = nominal.f35
    sub[ExifTags.Base.ExifImageWidth] = stored_size[0]
    sub[ExifTags.Base.ExifImageHeight] = stored_size[1]
    if nominal.focal_plane_resolution:
        sides_um = (round(nominal.sensor_width_mm * 1000), round(nominal.sensor_height_mm * 1000))
        sub[ExifTags.Base.FocalPlaneXResolution] = IFDRational(stored_size[0] * 10000, sides_um[0])
        sub[ExifTags.Base.FocalPlaneYResolution] = IFDRational(stored_size[1] * 10000, sides_um[1])
        sub[ExifTags.Base.FocalPlaneResolutionUnit] = 3
    return exif


def save_jpeg(path, upright: np.ndarray, nominal: Nominal, orientation: int, quality: int) -> None:
    """Write a JPEG; orientation 6 stores the picture turned 90 degrees counter-clockwise."""
    stored = np.rot90(upright) if orientation == 6 else upright
    image = Image.fromarray(np.ascontiguousarray(stored))
    exif = build_exif(nominal, image.size, orientation)
    image.save(path, quality=quality, subsampling=0, optimize=True, exif=exif)
