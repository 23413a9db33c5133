"""GeoJSON: the places of the pictures on the earth.

Source: RFC 7946: WGS 84, longitude before latitude, height above the ellipsoid as the positions had it.
"""

from __future__ import annotations

import json
import math

import numpy as np

from ..errors import InputError
from ..scene import Scene

FRAME = "WGS 84, metres to the east, north and up of "
"""Begins the name of a scene's frame that has latitude and longitude."""
_A, _E2 = 6378137.0, 6.69437999014e-3


def radii_m(latitude_rad: float, height_m: float) -> tuple[float, float]:
    """Metres for a radian to the east and to the north."""
    w = math.sqrt(1 - _E2 * math.sin(latitude_rad) ** 2)
    return (_A / w + height_m) * math.cos(latitude_rad), _A * (1 - _E2) / w**3 + height_m


def write(scene: Scene) -> bytes:
    """A feature for each picture.

    Raises:
        InputError: the scene is not placed on the earth.
    """
    if not scene.frame.startswith(FRAME):
        raise InputError(
            "GeoJSON", "a scene that is not placed on the earth", "give --positions with latitude and longitude"
        )
    lat, lon, height = (float(x) for x in scene.frame.removeprefix(FRAME).split(","))
    east, north = radii_m(math.radians(lat), height)
    features = []
    for name, (x, y, z) in zip(
        scene.names, scene.centre + (scene.origin_m if scene.origin_m is not None else 0.0), strict=True
    ):
        place = [lon + math.degrees(x / east), lat + math.degrees(y / north), height + z]
        features.append({"type": "Feature", "properties": {"name": name}, "geometry": {
            "type": "Point", "coordinates": [round(place[0], 9), round(place[1], 9), round(float(place[2]), 4)]}})  # fmt: skip
    assert np.isfinite(scene.centre).all()
    return json.dumps({"type": "FeatureCollection", "features": features}, allow_nan=False).encode()
