"""COLMAP's cameras.txt and cameras.bin.

COLMAP's pixel (0, 0) is the outer corner of the top-left pixel, so half a pixel is taken off the principal point. Several
cameras go by their CAMERA_ID. SIMPLE_FISHEYE and FISHEYE are Kannala-Brandt without coefficients.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from . import scalars
from .exact import focal_px, moved_centre_px, shortened
from .reading import MOST_SIDE_PX, Found, Reading

HALF = 0.5
_MOST_CAMERAS = 20_000


@dataclass(frozen=True)
class _Model:
    """One camera model: its number in cameras.bin, how many focal lengths come first, and what follows the centre.

    Attributes:
        number: in cameras.bin.
        count: of all parameters.
        focal: 1 or 2 focal lengths.
        lens: ours; empty where we have none.
        order: place of each following parameter in our coefficients.
    """

    number: int
    count: int
    focal: int = 0
    lens: str = ""
    order: tuple[int, ...] = ()


MODELS: dict[str, _Model] = {
    "SIMPLE_PINHOLE": _Model(0, 3, 1, "pinhole"),
    "PINHOLE": _Model(1, 4, 2, "pinhole"),
    "SIMPLE_RADIAL": _Model(2, 4, 1, "brown_conrady", (0,)),
    "RADIAL": _Model(3, 5, 1, "brown_conrady", (0, 1)),
    "OPENCV": _Model(4, 8, 2, "brown_conrady", (0, 1, 2, 3)),
    "OPENCV_FISHEYE": _Model(5, 8, 2, "fisheye", (0, 1, 2, 3)),
    "FULL_OPENCV": _Model(6, 12, 2, "brown_conrady", (0, 1, 2, 3, 4, 5, 6, 7)),
    "FOV": _Model(7, 5),
    "SIMPLE_RADIAL_FISHEYE": _Model(8, 4, 1, "fisheye", (0,)),
    "RADIAL_FISHEYE": _Model(9, 5, 1, "fisheye", (0, 1)),
    "THIN_PRISM_FISHEYE": _Model(10, 12),
    "RAD_TAN_THIN_PRISM_FISHEYE": _Model(11, 16),
    "SIMPLE_DIVISION": _Model(12, 4),
    "DIVISION": _Model(13, 5),
    "SIMPLE_FISHEYE": _Model(14, 3, 1, "fisheye"),
    "FISHEYE": _Model(15, 4, 2, "fisheye"),
}
"""COLMAP's camera models, by name; those without a lens are known and refused."""
_READ = ", ".join(name for name, model in MODELS.items() if model.lens)
_LINE = re.compile(r"\s*\d+\s+[A-Z][A-Z_]+\s+\d+\s+\d+(?:\s|$)", re.ASCII)

_Row = tuple[str, Any, Any, Sequence[Any]]


def tells_text(text: str) -> bool:
    """Whether this is a cameras.txt."""
    lines = (line for line in text[:20_000].splitlines() if line.strip())
    first = next((line for line in lines if not line.lstrip().startswith("#")), "")
    return bool(_LINE.match(first)) or "# Camera list" in text[:200]


def tells_binary(content: bytes) -> bool:
    """Whether this is a cameras.bin: its first eight bytes are a number of cameras that fit into it."""
    return len(content) >= 8 and struct.unpack_from("<Q", content)[0] * (24 + 8 * 3) <= len(content) - 8


def read_text(reading: Reading) -> Found:
    """The camera of a cameras.txt."""
    cameras: dict[str, _Row] = {}
    for number, line in enumerate(str(reading.content).splitlines(), 1):
        words = line.split()
        if not words or words[0].startswith("#"):
            continue
        if len(words) < 5 or len(words) > 30:
            raise reading.refused(f"line {number}: CAMERA_ID MODEL WIDTH HEIGHT PARAMS are needed")
        if words[0] in cameras:
            raise reading.refused(f"line {number}: camera {words[0][:20]} stands here twice; keep the right one")
        cameras[words[0]] = (words[1], *map(scalars.value, words[2:4]), [scalars.value(word) for word in words[4:]])
    return _found(reading, cameras)


def read_binary(reading: Reading) -> Found:
    """The camera of a cameras.bin."""
    data = bytes(reading.content)
    names = {model.number: name for name, model in MODELS.items()}
    cameras: dict[str, _Row] = {}
    try:
        (count,), place = struct.unpack_from("<Q", data), 8
        if count > _MOST_CAMERAS:
            raise reading.refused(f"says that it has {count} cameras; it is no cameras.bin, or damaged")
        for _ in range(count):
            id_, number, width, height = struct.unpack_from("<IiQQ", data, place)
            if number not in names:
                raise reading.refused(
                    f"camera {id_} is of model number {number}, which is not known; write cameras.txt instead"
                )
            name = names[number]
            params = struct.unpack_from(f"<{MODELS[name].count}d", data, place + 24)
            place += 24 + 8 * MODELS[name].count
            cameras[str(id_)] = (name, width, height, params)
    except struct.error:
        raise reading.refused("ends too early for a cameras.bin; the file may be cut off") from None
    if place != len(data) or len(cameras) != count:
        raise reading.refused(
            "is no cameras.bin: bytes are left behind its last camera, or a camera stands there twice"
        )
    return _found(reading, cameras)


def _found(reading: Reading, cameras: dict[str, _Row]) -> Found:
    id_, (name, width, height, params) = reading.one(cameras)
    model = MODELS.get(name)
    if model is None or not model.lens:
        raise reading.refused(f"camera {id_} has the model {name[:40]}, which is not read; {_READ} are")
    values = reading.numbers(list(params), f"PARAMS of {name}", (model.count,))
    focal = (values[0], values[model.focal - 1])
    cx, cy, *rest = values[model.focal :]
    k = [0.0] * (4 if model.lens == "fisheye" else len(rest))
    for place, value in zip(model.order, rest, strict=True):
        k[place] = value
    return Found(reading.camera(reading.size(width, height), focal, (cx - HALF, cy - HALF), model.lens, k))


# -- writing -------------------------------------------------------------------------------------------


def _model_of(found: Found) -> tuple[str, list[float]] | None:
    """The smallest model that holds the camera, and its parameters."""
    camera = found.camera
    if camera.lens == "equirectangular":
        return None
    choices = {"pinhole": {0: "PINHOLE"}, "fisheye": {4: "OPENCV_FISHEYE"}}.get(
        camera.lens, {4: "OPENCV", 8: "FULL_OPENCV"}
    )
    k = shortened(camera.coefficients, list(choices))
    if k is None:
        return None
    return choices[len(k)], [*focal_px(camera), *moved_centre_px(camera, HALF), *k]


def write_text(found: Found) -> str | None:
    """A cameras.txt of one camera, with the id 1."""
    if (chosen := _model_of(found)) is None:
        return None
    name, params = chosen
    head = "# Camera list with one line of data per camera:\n#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n# Number of cameras: 1\n"
    return f"{head}1 {name} {found.camera.width_px} {found.camera.height_px} {' '.join(map(repr, params))}\n"


def write_binary(found: Found) -> bytes | None:
    """A cameras.bin of one camera, with the id 1."""
    if (chosen := _model_of(found)) is None or max(found.camera.width_px, found.camera.height_px) > MOST_SIDE_PX:
        return None
    name, params = chosen
    head = struct.pack("<QIiQQ", 1, 1, MODELS[name].number, found.camera.width_px, found.camera.height_px)
    return head + struct.pack(f"<{len(params)}d", *params)
