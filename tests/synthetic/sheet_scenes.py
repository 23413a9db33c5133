"""Sheets and bars drawn with exact truth: blurred in linear light, encoded, with noise."""

from pathlib import Path

import numpy as np

from subtense import Camera
from subtense.geometry import rotation_from_vector
from subtense.photo import Metadata, Photo
from subtense.transfer import encoded_of, light_of


def photo_of(encoded, seed, noise):
    """A gray photo of encoded values, 0 to 1."""
    value = 255 * encoded + np.random.default_rng(seed).normal(0, noise, encoded.shape)
    gray = np.clip(np.round(value), 0, 255).astype(np.uint8)
    return Photo(np.repeat(gray[..., None], 3, axis=2), Metadata(), Path("drawn.png"), "0")


def reduced(fine, factor):
    """Means of blocks: what pixels see."""
    height, width = (side // factor for side in fine.shape)
    return fine.reshape(height, factor, width, factor).mean(axis=(1, 3))


def lights(dark, light, exponent):
    """Light of two encoded values of 0 to 255."""
    return light_of(np.array([dark, light]) / 255, exponent)


def bar(width, angle, *, blur=1.0, noise=2.0, dark=40, light=200, exponent=2.2, seed=0, inverted=False, size=120,
        middle=(60.3, 59.6)):  # fmt: skip
    """A bar across the whole picture; its normal stands at `angle` to the x axis."""
    from scipy.special import ndtr

    fine = 5
    y, x = (np.mgrid[0 : size * fine, 0 : size * fine] + 0.5) / fine - 0.5
    n = (x - middle[0]) * np.cos(angle) + (y - middle[1]) * np.sin(angle)
    inside = reduced(ndtr((n + width / 2) / blur) - ndtr((n - width / 2) / blur), fine)
    low, high = lights(dark, light, exponent)
    share = 1 - inside if inverted else inside
    return photo_of(encoded_of(low + (high - low) * share, exponent), seed, noise)


def wedge(angle, opening, *, blur=1.0, noise=2.0, dark=40, light=200, exponent=2.2, seed=0, inverted=False, size=110,
          corner=(55.3, 54.6)):  # fmt: skip
    """Light between two half lines from the corner, at `angle` and `angle + opening`."""
    import cv2

    fine = 5
    y, x = (np.mgrid[0 : size * fine, 0 : size * fine] + 0.5) / fine - 0.5
    x, y = x - corner[0], y - corner[1]
    after = np.clip(
        fine * (np.cos(angle) * y - np.sin(angle) * x) + 0.5, 0, 1
    )  # the share of a fine pixel that is light
    before = np.clip(fine * (np.sin(angle + opening) * x - np.cos(angle + opening) * y) + 0.5, 0, 1)
    share = reduced(cv2.GaussianBlur(after * before, (0, 0), blur * fine), fine)
    low, high = lights(dark, light, exponent)
    return photo_of(encoded_of(low + (high - low) * (1 - share if inverted else share), exponent), seed, noise)


def sheet(width_m=0.297, height_m=0.210, *, tilt=30.0, axis=40.0, turn=20.0, distance_m=0.8, f_px=750.0, size=(640, 480),
          blur=0.8, noise=2.0, dark=70, light=225, exponent=2.2, seed=0, rounded_m=0.0, hidden=(), offset=(0.03, -0.02)):  # fmt: skip
    """(photo, (4, 2) corners, camera, range in m) of a sheet on an uneven ground; `hidden` are discs (x, y, radius) in px."""
    import cv2

    fine, (wide, high) = 4, size
    camera = Camera(wide, high, f_px, (wide - 1) / 2, (high - 1) / 2, cov=np.diag([(0.003 * f_px) ** 2, 0, 1.0, 1.0]))
    about = np.radians(tilt) * np.array([np.cos(np.radians(axis)), np.sin(np.radians(axis)), 0])
    rotation = rotation_from_vector(about) @ rotation_from_vector(np.array([0, 0, np.radians(turn)]))
    place = np.array([*offset, distance_m])
    half = (
        np.array([[-width_m, -height_m, 0], [width_m, -height_m, 0], [width_m, height_m, 0], [-width_m, height_m, 0]])
        / 2
    )
    corners = camera.project(half @ rotation.T + place)
    back = np.linalg.inv(camera.matrix @ np.column_stack([rotation[:, 0], rotation[:, 1], place]))
    y, x = ((np.mgrid[0 : high * fine, 0 : wide * fine] + 0.5) / fine - 0.5).astype(np.float32)
    u, v, w = (back[i, 0] * x + back[i, 1] * y + back[i, 2] for i in range(3))
    qx, qy = abs(u / w) - (width_m / 2 - rounded_m), abs(v / w) - (height_m / 2 - rounded_m)
    inside = (qx < rounded_m) & (qy < rounded_m)
    if rounded_m:
        inside &= ~((qx > 0) & (qy > 0) & (np.hypot(qx, qy) > rounded_m))
    low, bright = lights(dark, light, exponent)
    uneven = cv2.resize(np.random.default_rng(seed).normal(0, 0.2, (high // 40 + 2, wide // 40 + 2)), (wide * fine, high * fine),
                        interpolation=cv2.INTER_CUBIC)  # fmt: skip
    scene = np.where(inside, bright, low * (1 + uneven))
    for cx, cy, radius in hidden:
        scene[np.hypot(x - cx, y - cy) < radius] = 3 * low
    scene = reduced(cv2.GaussianBlur(np.clip(scene, 0, 1), (0, 0), blur * fine), fine)
    return photo_of(encoded_of(scene, exponent), seed, noise), corners, camera, float(np.linalg.norm(place))


def in_order(found, corners):
    """(4, 2) truths in the order of the corners found."""
    return np.array([corners[np.argmin(np.hypot(*(corners - point).T))] for point in found])
