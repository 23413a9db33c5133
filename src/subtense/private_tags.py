"""Private tags: where a picture was taken and with which specimen of a camera. Read only where somebody asks for it by name.

A report, a page and a calibration never have them; a reconstruction reads positions where a person asks for those of the files.

Source: Exif 2.32, GPS IFD (4.6.6) and BodySerialNumber, LensSerialNumber; DJI's drone-dji namespace; Adobe's aux.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from .decode import open_picture
from .metadata import number, text_of
from .photo import check_size, file_bytes
from .tiff_tags import private_tags as tags_of
from .xmp import properties

_SERIALS = {0xA431: "camera serial number", 0xA435: "lens serial number", 0xC62F: "camera serial number"}
_DJI, _AUX = "http://www.dji.com/drone-dji/1.0", "http://ns.adobe.com/exif/1.0/aux"
_DJI_NAMES = {
    "GpsLatitude": "latitude", "GpsLongitude": "longitude", "GpsLongtitude": "longitude", "AbsoluteAltitude": "altitude above the sea",
    "CameraSerialNumber": "camera serial number", "LensSerialNumber": "lens serial number", "DroneSerialNumber": "drone serial number",
}  # fmt: skip
_AUX_NAMES = {"SerialNumber": "camera serial number", "LensSerialNumber": "lens serial number"}


def private_tags(path: Path) -> dict[str, str]:
    """Position, altitude above the sea and serial numbers of a picture's file, by what they are; empty where it tells none.

    Raises:
        FileFormatError: no such file, or no picture.
    """
    opened = open_picture(file_bytes(path, path), path, path.suffix)
    check_size(path, opened.width_px, opened.height_px)
    opened.tags()  # of a PNG they may stand behind the pixels
    beside = opened.beside()
    found: dict[str, str] = {}
    if beside.exif is not None:
        found |= _by_exif(tags_of(*beside.exif))
    if beside.xmp is not None:
        wanted = {_DJI: ("drone-dji", frozenset(_DJI_NAMES)), _AUX: ("aux", frozenset(_AUX_NAMES))}
        for name, value in (properties(beside.xmp, wanted) or {}).items():
            what = (_DJI_NAMES if name.startswith("drone") else _AUX_NAMES)[name.partition(":")[2]]
            found.setdefault(what, value + (" m" if what.startswith("altitude") else ""))
    return found


def position_of(path: Path) -> tuple[float, float, float] | None:
    """Latitude and longitude (degrees) and altitude above the sea (m) of a picture's file; None where it does not tell all three.

    Raises:
        FileFormatError: no such file, or no picture.
    """
    found = private_tags(path)
    try:
        latitude, longitude = float(found["latitude"]), float(found["longitude"])
        altitude = float(found["altitude above the sea"].removesuffix(" m"))
    except (KeyError, ValueError):
        return None
    return latitude, longitude, altitude


def _by_exif(tags: Mapping[int, Any]) -> dict[str, str]:
    found = {}
    for what, tag, negative in (("latitude", 2, "S"), ("longitude", 4, "W")):
        angle = _degrees(tags.get(tag))
        if angle is not None:
            found[what] = f"{-angle if tags.get(tag - 1) == negative else angle:.8f}"
    height = number(tags.get(6))
    if height is not None:
        below = tags.get(5) == 1
        found["altitude above the sea"] = f"{-height if below else height:.3f} m"
    serials = ((what, text_of(tags.get(tag))) for tag, what in _SERIALS.items())
    return found | {what: text for what, text in serials if text}


def _degrees(value: Any) -> float | None:
    """Degrees, minutes, seconds."""
    parts = [number(one) for one in value] if isinstance(value, tuple) and len(value) == 3 else []
    if not parts or parts[0] is None:
        return None
    return parts[0] + (parts[1] or 0.0) / 60 + (parts[2] or 0.0) / 3600
