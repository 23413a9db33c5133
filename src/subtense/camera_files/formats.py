"""The table of calibration file formats; a file is told by what it says first, by its ending second."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..camera import Camera
from ..errors import FileFormatError, InputError
from ..lenses import LENSES
from ..quantity import Note
from . import (
    colmap,
    flow_text,
    json_text,
    kalibr,
    matlab,
    mrcal,
    open3d,
    opencv,
    opensfm,
    own,
    ros,
    xml_text,
    yaml_text,
)
from .reading import MOST_BYTES, Found, Reading
from .selector import NOTHING, Pick

_PERSPECTIVE = ("pinhole", "brown_conrady")
_ALL_BUT_PANORAMA = (*_PERSPECTIVE, "fisheye")


@dataclass(frozen=True)
class Format:
    """One row of FORMATS.

    Attributes:
        name: as in --from and --to.
        title: as people call it.
        syntax: a key of SYNTAXES.
        endings: of files written in it; the first one is the usual one.
        tells: whether a file's content, as its syntax gives it, is of this format.
        read: the reader.
        write: the writer; it gives None where the format can't hold the camera's numbers. None where there is no writer.
        lenses: of the cameras that it holds, keys of LENSES.
    """

    name: str
    title: str
    syntax: str
    endings: tuple[str, ...]
    tells: Callable[[Any], bool]
    read: Callable[[Reading], Found]
    write: Callable[[Found], str | bytes | None] | None
    lenses: tuple[str, ...]


SYNTAXES: dict[str, Callable[[object, bytes], Any]] = {
    "json": lambda path, content: json_text.tree(path, _decoded(path, content)),
    "yaml": lambda path, content: yaml_text.tree(path, _decoded(path, content)),
    "xml": xml_text.tree,
    "literal": lambda path, content: flow_text.tree(path, _decoded(path, content)),
    "text": lambda path, content: _decoded(path, content),
    "binary": lambda _, content: content,
}
"""What content can be; each gives a tree of dicts, lists, numbers and texts, or the text, or the bytes."""

FORMATS: dict[str, Format] = {
    row.name: row
    for row in (
        Format("subtense", "subtense JSON", "json", (".json",), own.tells, own.read, own.write, tuple(LENSES)),
        Format("opensfm", "OpenSfM camera_models.json", "json", (".json",), opensfm.tells, opensfm.read, opensfm.write,
               (*_ALL_BUT_PANORAMA, "equirectangular")),
        Format("matlab", "MATLAB JSON", "json", (".json",), matlab.tells, matlab.read, matlab.write, _PERSPECTIVE),
        Format("open3d", "Open3D JSON", "json", (".json",), open3d.tells, open3d.read, open3d.write, ("pinhole",)),
        Format("opencv_json", "OpenCV JSON", "json", (".json",), opencv.tells, opencv.read, opencv.write_json,
               _ALL_BUT_PANORAMA),
        Format("opencv_xml", "OpenCV XML", "xml", (".xml",), opencv.tells, opencv.read, opencv.write_xml, _ALL_BUT_PANORAMA),
        Format("ros", "ROS camera_info", "yaml", (".yaml", ".yml"), ros.tells, ros.read, ros.write, _ALL_BUT_PANORAMA),
        Format("kalibr", "Kalibr camchain", "yaml", (".yaml", ".yml"), kalibr.tells, kalibr.read, kalibr.write,
               _ALL_BUT_PANORAMA),
        Format("opencv", "OpenCV YAML", "yaml", (".yml", ".yaml"), opencv.tells, opencv.read, opencv.write_yaml,
               _ALL_BUT_PANORAMA),
        Format("mrcal", "mrcal .cameramodel", "literal", (".cameramodel",), mrcal.tells, mrcal.read, mrcal.write, _PERSPECTIVE),
        Format("colmap", "COLMAP cameras.txt", "text", (".txt",), colmap.tells_text, colmap.read_text, colmap.write_text,
               _ALL_BUT_PANORAMA),
        Format("colmap_bin", "COLMAP cameras.bin", "binary", (".bin",), colmap.tells_binary, colmap.read_binary,
               colmap.write_binary, _ALL_BUT_PANORAMA),
    )
}  # fmt: skip
"""Every format. Of one syntax the more telling ones come first."""

ENDINGS = frozenset(ending for row in FORMATS.values() for ending in row.endings)
_OF_ENDING = {".json": "subtense", ".xml": "opencv_xml", ".yml": "opencv", ".yaml": "opencv", ".txt": "colmap", ".bin": "colmap_bin",
              ".cameramodel": "mrcal"}  # fmt: skip
"""What is written where only an ending is given."""


_JSON = re.compile(r'[\[]|\{\s*["}]|\{\s*$')
"""How JSON begins; YAML's brackets have keys without double quotes."""


# -- reading -------------------------------------------------------------------------------------------


def read(path: object, content: bytes, pick: Pick = NOTHING, form: str | None = None) -> Found:
    """The camera in a file's content.

    Args:
        path: for messages, and for its ending.
        content: the file's bytes.
        pick: what was said beside the file.
        form: a key of FORMATS; None to be told by the content.

    Raises:
        FileFormatError: it holds no camera that can be used; where, and what would help.
    """
    if len(content) > MOST_BYTES:
        raise FileFormatError(path, f"is larger than {MOST_BYTES // 2**20} MiB, no calibration is")
    row, tree = _row_and_tree(path, content, form)
    with np.errstate(all="ignore"):  # absurd numbers are refused by what comes of them
        found = row.read(Reading(path, tree, pick))
        if pick.fisheye and found.camera.lens != "fisheye":
            raise FileFormatError(path, "says itself that its lens is no fisheye; leave out #fisheye")
        return _checked_lens(path, found)


def _row_and_tree(path: object, content: bytes, form: str | None) -> tuple[Format, Any]:
    if form is not None:
        row = FORMATS[_known(form, "--from")]
        return row, SYNTAXES[row.syntax](path, content)
    syntax = _syntax(path, content)
    tree = SYNTAXES[syntax](path, content)
    rows = [row for row in FORMATS.values() if row.syntax == syntax]
    for row in rows:
        if row.tells(tree):
            return row, tree
    ending = Path(str(path)).suffix.lower()
    usual = FORMATS.get(_OF_ENDING.get(ending, ""))
    if usual is not None and usual.syntax == syntax:  # its reader says best what is missing
        return usual, tree
    raise FileFormatError(path, f"holds no camera that is known here; known are {', '.join(r.title for r in rows)}")


def _syntax(path: object, content: bytes) -> str:
    """What the content looks like."""
    ending = Path(str(path)).suffix.lower()
    if b"\0" in content[:4096]:
        if ending != ".bin" and not colmap.tells_binary(content):
            raise FileFormatError(
                path, "is neither a text in UTF-8 nor a cameras.bin; give the file that the calibration wrote"
            )
        return "binary"
    text = _decoded(path, content).removeprefix("\ufeff")
    bare = "\n".join(line for line in text[:4096].splitlines() if not line.lstrip().startswith("#")).lstrip()
    if bare.startswith("<"):
        return "xml"
    if mrcal.marked(text[:4096]):
        return "literal"
    if _JSON.match(bare):
        return "json"
    if colmap.tells_text(text):
        return "text"
    return "json" if ending == ".json" else "literal" if ending == ".cameramodel" else "yaml"


def _decoded(path: object, content: bytes) -> str:
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise FileFormatError(path, "is not a text in UTF-8; give the file that the calibration wrote") from None


def _known(form: str, option: str) -> str:
    if form not in FORMATS:
        raise InputError(option, form, f"known are {', '.join(FORMATS)}")
    return form


# -- whether the lens can be used ----------------------------------------------------------------------


def _checked_lens(path: object, found: Found) -> Found:
    """That pixels have one direction, and that direction that pixel: a lens that turns back inside of the picture is refused.

    What it does in the corners, outside of the circle that the picture's shorter side holds, is noted: points there are refused
    one by one, and the others are right.
    """
    camera = found.camera
    points = _probes(camera)
    again = camera.project(camera.rays(points))
    lost = ~(np.hypot(*(again - points).T) < 1e-3)
    if not lost.any():
        return found
    radius = np.hypot(*(points[lost] - [camera.cx_px, camera.cy_px]).T).min()
    turns = f"its lens distortion turns back {radius:.0f} px from the principal point"
    cure = "calibrate again with points out to the corners"
    if radius < min(camera.width_px, camera.height_px) / 2:
        raise FileFormatError(
            path, f"{turns}, inside of the picture, so that pixels there have no direction of their own; {cure}"
        )
    text = f"the camera's {turns[4:]}: points farther out have no direction and are refused"
    return replace(found, notes=(*found.notes, Note("distortion_folds", text, cure)))


def _probes(camera: Camera) -> Any:
    across, down = np.linspace(0, camera.width_px - 1, 33), np.linspace(0, camera.height_px - 1, 33)
    points = np.stack(np.meshgrid(across, down), -1).reshape(-1, 2)
    if camera.lens != "fisheye":
        return points
    inside = np.clip([camera.cx_px, camera.cy_px], 0, [camera.width_px - 1, camera.height_px - 1])
    reach = min(*inside, *(np.array([camera.width_px, camera.height_px]) - 1 - inside))
    near = np.hypot(*(points - [camera.cx_px, camera.cy_px]).T) <= reach
    return points[near] if near.any() else inside[None]


# -- writing -------------------------------------------------------------------------------------------


def form_for(path: Path, form: str | None = None) -> str:
    """The format to write: the one that is said, or that of the file's ending."""
    if form is not None:
        return _known(form, "--to")
    found = _OF_ENDING.get(path.suffix.lower())
    if found is None:
        raise InputError("--to", None, f"{path.name} does not tell the format; known are {', '.join(FORMATS)}")
    return found


def write(found: Found, form: str) -> bytes:
    """A file's content.

    Raises:
        InputError: the format can't hold this camera; which can.
    """
    if found.camera.leading:
        raise InputError("the camera", "many cameras in one", "write them one by one")
    if (content := _written(found, FORMATS[_known(form, "--to")])) is None:
        camera = found.camera
        able = [row.name for row in FORMATS.values() if _written(found, row) is not None]
        what = camera.lens + (f" with {camera.coefficients.size} coefficients" if camera.coefficients.size else "")
        raise InputError("--to", form, f"it can't hold {what}; {', '.join(able)} can")
    return content


def _written(found: Found, row: Format) -> bytes | None:
    if row.write is None or found.camera.lens not in row.lenses:
        return None
    content = row.write(found)
    return content.encode() if isinstance(content, str) else content


def lost(found: Found, form: str) -> tuple[str, ...]:
    """What a file of this format does not keep of the camera."""
    if form == "subtense":
        return ()
    camera, kept = found.camera, replace(found.camera, cov=None)
    what = []
    if camera.cov is not None:
        what.append("the uncertainty (covariance)")
    if found.notes:
        what.append("the notes " + ", ".join(dict.fromkeys(note.code for note in found.notes)))
    if found.frame:
        what.append(f"that it is for pictures as {found.frame}")
    if kept.nominal_focal_m is not None:
        what.append("the nominal focal length")
    return tuple(what)
