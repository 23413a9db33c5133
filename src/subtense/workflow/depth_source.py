"""Which depth map is used: a file made elsewhere, or a network that was named or is the only one here."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..arrays import Array
from ..camera import Camera
from ..depth_file import ENDINGS, DepthError, fitted, parse_error, parse_unit, read_numbers
from ..depth_models import ASSUMED_LOCAL, KINDS, TAKES, DepthModel, depth_models, find_depth_model
from ..detectors.learned_depth import onnx_depth, transformers_depth
from ..errors import InputError
from ..photo import Photo
from ..quantity import Note
from ..raw_depth import RawDepth

BY_FILE = (*KINDS, "range")
"""What the numbers of a file may be."""


@dataclass(frozen=True)
class DepthTexts:
    """What a person said of the map, as texts.

    Attributes:
        file: a depth map made elsewhere.
        unit: metres in one of its numbers.
        error: how well single depths are known; of a network in place of its published error.
        gives: what the numbers are.
        prefer: name of a network in the table, or of a repository of transformers.
        model: a network's ONNX file.
        takes: how a network that is not in the table takes pixels.
        folder: where networks' files lie.
    """

    file: Path | None = None
    unit: str | None = None
    error: str | None = None
    gives: str | None = None
    prefer: str | None = None
    model: Path | None = None
    takes: str | None = None
    folder: Path = Path("depth_models")


def raw_depth(photo: Photo, camera: Camera, said: DepthTexts) -> RawDepth:
    """The map of a photo.

    Raises:
        InputError: what was said does not go together, or no network is named and there is not just one.
        FileFormatError: a file that can't be used.
        MissingExtraError: what runs the network is not installed.
    """
    error = None if said.error is None else parse_error(said.error)
    if said.file is not None:
        return _of_file(photo, camera, said, said.file, error)
    if said.unit is not None:
        raise InputError("--depth-unit", said.unit, "it is of a map in a file; name that with --depth")
    row, path, notes = _network(said)
    found = transformers_depth(photo, row, camera) if path is None else onnx_depth(photo, row, path, camera)
    found = dataclasses.replace(found, notes=(*notes, *found.notes))
    return found if error is None else _stated(found, error)


def _stated(raw: RawDepth, error: DepthError) -> RawDepth:
    """The map with a stated error. Nobody says what of it all depths share; half of the variance is taken to be."""
    part = error.relative / math.sqrt(2)
    local = max(part, 1e-6)
    doubt = f"stated: {error.text}, half of its variance common to all"
    return dataclasses.replace(raw, u_factor=part, u_local=local, u_m=error.u_m, doubt=doubt, published=False)


# -- a file ------------------------------------------------------------------------------------------------


def _of_file(photo: Photo, camera: Camera, said: DepthTexts, path: Path, error: DepthError | None) -> RawDepth:
    if said.prefer is not None or said.model is not None:
        raise InputError("--depth", str(path), "give a map or a network, not both")
    gives = said.gives or "metric"
    if gives not in BY_FILE:
        raise InputError("--gives", gives, f"known are {', '.join(BY_FILE)}")
    metric = gives in ("metric", "range")
    if not metric and said.unit is not None:
        raise InputError("--depth-unit", said.unit, f"numbers that are {gives} have no unit; leave it out")
    if metric and said.unit is None and path.suffix.lower() == ".png":
        raise InputError("--depth-unit", None, "say what one number is, as '1 mm' or '1/256 m'")
    if error is None and metric:
        raise InputError("--depth-error", None, "say how well its depths are known, as '1 %' or '5 mm + 1 %'")
    numbers = read_numbers(path)
    notes: tuple[Note, ...] = ()
    if metric and said.unit is None:
        text = f"nothing was said of the unit of {path.name}; its numbers are taken as metres"
        notes = (Note("depth_unit_assumed", text, "say it, as --depth-unit '1 m'"),)
    values, cell = fitted(path, numbers, photo.width_px, photo.height_px)
    if metric:
        values = values * (1.0 if said.unit is None else parse_unit(said.unit))
    if gives == "range":
        values = values * _forward(camera)
    raw = RawDepth(
        values, "metric" if metric else gives, path.name, 0.0, ASSUMED_LOCAL, doubt=ASSUMED, cell_px=cell, notes=notes
    )
    return raw if error is None else _stated(raw, error)


ASSUMED = "assumed: as of Depth Anything V2 once scale and shift are fitted (arXiv 2406.09414, table 2)"


def _forward(camera: Camera) -> Array:
    """(height, width) cosines of the lines of sight to the axis."""
    x, y = np.meshgrid(np.arange(camera.width_px, dtype=float), np.arange(camera.height_px, dtype=float))
    return np.asarray(camera.rays(np.stack([x, y], -1))[..., 2])


# -- a network ---------------------------------------------------------------------------------------------


def _network(said: DepthTexts) -> tuple[DepthModel, Path | None, tuple[Note, ...]]:
    """The row, its file (None for transformers), and how it was chosen."""
    if said.model is not None:
        return _by_file(said, said.model), said.model, ()
    if said.gives is not None or said.takes is not None:
        raise InputError(
            "--gives",
            said.gives or said.takes,
            "networks of the table say that themselves; it is for a file, --model or --depth",
        )
    if said.prefer is not None:
        row = find_depth_model(said.prefer)
        if row.runs == "transformers" and not here(row, said.folder):
            return row, None, ()
        return row, _file_of(row, said.folder), ()
    found = [row for row in depth_models().values() if here(row, said.folder)]
    if not found:
        how = next(iter(depth_models().values())).how_to_have(said.folder)
        others = "others: `subtense depth-models`; or give a map that was made elsewhere, --depth"
        raise InputError(
            "--prefer", None, f"no network of depth is in {said.folder}; fetch one, as by: {how}; {others}"
        )
    if len(found) > 1:
        raise InputError(
            "--prefer", None, f"{len(found)} networks are here; name one: {', '.join(row.name for row in found)}"
        )
    text = f"{found[0].title} gave the depths, the only network in {said.folder}"
    return found[0], _file_of(found[0], said.folder), (Note("depth_model_chosen", text, "name it with --prefer"),)


def _by_file(said: DepthTexts, path: Path) -> DepthModel:
    """The row of a file: the one that was named, or whose name the file's path has; one made of what was said else."""
    if path.suffix.lower() in ENDINGS:
        raise InputError("--model", str(path), "that is no network; give a map that was made elsewhere with --depth")
    if said.prefer is not None:
        return find_depth_model(said.prefer)
    if said.gives is None:
        text = str(path).lower()
        rows = [
            row
            for row in depth_models().values()
            if row.name in text or row.repository.rpartition("/")[2].lower() in text
        ]
        if rows:
            return max(rows, key=lambda row: len(row.name))
        raise InputError(
            "--model",
            str(path),
            f"its name is of no known network; say which with --prefer, or what it gives with --gives ({', '.join(KINDS)})",
        )
    if said.gives not in KINDS:
        raise InputError("--gives", said.gives, f"known are {', '.join(KINDS)}")
    if said.takes is not None and said.takes not in TAKES:
        raise InputError("--takes", said.takes, f"known are {', '.join(TAKES)}")
    if said.gives == "metric" and said.error is None:
        raise InputError(
            "--depth-error", None, "say how well its depths are known, as '15 %': the network is not in the table"
        )
    return DepthModel(
        path.stem,
        path.stem,
        said.gives,
        "none",
        said.takes or "imagenet",
        "onnx",
        "",
        "not told",
        0.0,
        "a file of one's own",
    )


def here(row: DepthModel, folder: Path) -> list[Path]:
    """The ONNX files of a row in a folder."""
    single = folder / f"{row.name}.onnx"
    return [single] if single.is_file() else sorted((folder / row.name).glob("**/*.onnx"))


def _file_of(row: DepthModel, folder: Path) -> Path:
    found = here(row, folder)
    if not found:
        raise InputError("--prefer", row.name, f"its file is not in {folder}; fetch it: {row.how_to_have(folder)}")
    if len(found) > 1:
        raise InputError(
            "--prefer", row.name, f"{len(found)} files of it are in {folder / row.name}; name one with --model"
        )
    return found[0]
