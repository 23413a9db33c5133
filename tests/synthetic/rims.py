"""Pictures of discs and balls with exact truth: shares of pixels, blurred in linear light, encoded, with noise."""

from pathlib import Path

import numpy as np
from scipy.ndimage import gaussian_filter

from subtense.camera import Camera
from subtense.geometry import rotation_from_vector
from subtense.metadata import Metadata
from subtense.photo import Photo
from subtense.transfer import encoded_of

CAMERA = Camera(640, 480, 1200.0, 319.5, 239.5)
SHARES = 6


def photo_of(pixels):
    return Photo(np.ascontiguousarray(pixels, np.uint8), Metadata(), Path("drawn.png"), "")


def frame_towards(sight, tilt, turn):
    """Camera from disc: a disc whose normal stands at an angle to the line of sight."""
    axis = sight / np.linalg.norm(sight)
    first = np.cross([0.0, 1.0, 0.0], axis)
    first /= np.linalg.norm(first)
    facing = np.stack([first, np.cross(axis, first), axis], -1)
    return facing @ rotation_from_vector(tilt * np.array([np.cos(turn), np.sin(turn), 0.0]))


def drawn(middle, radius, tilt=None, turn=0.0, camera=CAMERA, hide=None, **look):
    """(H, W, 3) picture of a disc, or without a tilt of a ball."""
    middle = np.asarray(middle, float)
    steps = (np.arange(SHARES) + 0.5) / SHARES - 0.5
    yy, xx = np.mgrid[0 : camera.height_px, 0 : camera.width_px].astype(float)
    cover = np.zeros(xx.shape)
    far = np.linalg.norm(middle)
    normal = frame_towards(middle, tilt, turn)[:, 2] if tilt is not None else None
    centre = camera.project(middle[None])[0]
    reach = camera.f_px * radius / (middle[2] - radius) * 1.6 + 8  # outside it nothing is covered
    rows, columns = (slice(max(int(c - reach), 0), max(int(c + reach), 1)) for c in centre[::-1])
    x, y = xx[rows, columns], yy[rows, columns]
    for dy in steps:
        for dx in steps:
            rays = camera.rays(np.stack([x + dx, y + dy], -1))
            if normal is None:
                inside = rays @ middle >= far * np.sqrt(1 - (radius / far) ** 2)
            else:
                at = rays * ((normal @ middle) / (rays @ normal))[..., None]
                inside = np.sum((at - middle) ** 2, -1) <= radius**2
            cover[rows, columns] += inside / SHARES**2
    return encoded(cover if hide is None else cover * hide, **look)


def encoded(cover, blur=1.0, noise=3.0, inside=0.6, outside=0.08, exponent=2.2, seed=0):
    light = gaussian_filter(outside + (inside - outside) * cover, blur)
    value = 255 * encoded_of(light, exponent) + np.random.default_rng(seed).normal(0, noise, light.shape)
    return np.repeat(np.clip(np.round(value), 0, 255)[..., None], 3, axis=2).astype(np.uint8)
