"""A scene into files: by their ending PLY, LAS, GeoJSON and JSON, or a folder for COLMAP."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from ..document import Document
from ..errors import InputError
from ..scale import Scaled
from ..scene import Scene
from ..scene_files import colmap, geojson, las, ply

SCHEMA = "subtense-scene/1"
WRITERS: dict[str, Callable[[Scene], bytes]] = {".ply": ply.write, ".las": las.write, ".laz": las.write_compressed,
                                              ".geojson": geojson.write}  # fmt: skip


def check_outputs(paths: Sequence[Path]) -> None:
    """Refuses what can't be written, before anything is worked out.

    Raises:
        InputError: an ending of no format, or no such folder.
    """
    for path in paths:
        if path.suffix.lower() not in (*WRITERS, ".json", ""):
            raise InputError(
                "--output",
                str(path),
                f"give a name that ends in {', '.join(WRITERS)} or .json, or a folder for COLMAP's files",
            )
        if not path.absolute().parent.is_dir():
            raise InputError("--output", str(path), "its folder does not exist")


def scene_json(scene: Scene, done: Scaled | None, document: Document | None) -> dict[str, Any]:
    """The scene's figures, its views with their covariance, the scale's sources, and the measurements."""
    data: dict[str, Any] = {"schema": SCHEMA, "scene": scene.to_json()}
    if scene.metric and scene.cov is not None:
        data["views"] = scene.views().to_json()
    if done is not None:
        data["scale"] = {"factor": done.factor, "relative_u": done.relative_u, "source": scene.scale_source,
                         "said": [one.to_json() for one in done.said], "check_rms_m": done.check_rms_m}  # fmt: skip
    data["document"] = None if document is None else document.to_json()
    return data


def write(path: Path, scene: Scene, done: Scaled | None, document: Document | None) -> None:
    """One file, whole or not at all; or a folder of COLMAP's.

    Raises:
        InputError: it can't be written, or the scene lacks what the format needs.
    """
    if not path.suffix:
        try:
            path.mkdir(exist_ok=True)
            colmap.write(scene, path)
        except OSError as error:
            raise InputError("--output", str(path), f"it can't be written ({error.strerror or error})") from None
        return
    form = path.suffix.lower()
    data = scene_json(scene, done, document)
    written(path, json.dumps(data, allow_nan=False).encode() if form == ".json" else WRITERS[form](scene), "--output")


def written(path: Path, content: bytes, option: str) -> None:
    """A file, whole or not at all.

    Raises:
        InputError: it can't be written.
    """
    part = path.with_name(f".{path.name}.part")
    try:
        part.write_bytes(content)
        part.replace(path)
    except OSError as error:
        raise InputError(option, str(path), f"it can't be written ({error.strerror or error})") from None
