"""One run of `subtense reconstruct`: what was asked, checked before minutes are spent, then the scene, its scale, measurements, files."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .. import assumptions
from ..document import Document
from ..errors import InputError
from ..methods.reconstruction import MAPPING, MATCHING, Settings, engine
from ..quantity import Quantity
from ..reports import scene_text
from ..reports import text as text_report
from ..scale import Scaled
from ..scene import WHAT_TO_GIVE, Scene
from .reconstruct import opened_scene, photos_of, pictures_in, reconstructed
from .reconstruct_board import read_board
from .reconstruct_input import positions_told
from .reconstruct_measure import Asked, measurements, metric
from .reconstruct_output import check_outputs, scene_json, write
from .reconstruct_rig import read_pairs, write_pairs
from .triangulate import unique_names


@dataclass(frozen=True)
class Run:
    """What was asked.

    Attributes:
        folder: of pictures, or with a scene of another program.
        measures: what to measure.
        camera: what is known of it.
        matching: of MATCHING.
        mapping: of MAPPING.
        features: most of a picture.
        photos: where the pictures of an existing scene are.
        outputs: files to write.
        level: coverage of the intervals.
        seed: of the draws.
        pairs: of pictures, to be written as rigs.
        unscaled: whether a scene without a scale is wanted.
        known: what tells the scale: distances, checks, marker_size, targets, board, baseline, heights, positions, accuracy.
    """

    folder: Path
    measures: tuple[str, ...]
    camera: str | None
    matching: str
    mapping: str
    features: int
    photos: Path | None
    outputs: tuple[Path, ...]
    level: float
    seed: int
    pairs: tuple[str, ...]
    unscaled: bool
    known: Mapping[str, Any]


def run(asked: Run, form: str, progress: Callable[[str, float], None]) -> str:
    """The whole run, as text or JSON.

    Raises:
        InputError: something missing or impossible, or no scale.
        NothingFoundError: the pictures make no scene.
    """
    known, pairs = _known(asked), read_pairs(asked.pairs)
    scene, photos = _scene(asked, known, progress)
    done: Scaled | None = None
    document: Document | None = None
    if known.scale:
        progress("measuring", 0.99)
        done = metric(scene, photos, known)
        scene = done.scene
        if asked.measures:
            document = measurements(done, photos, asked.measures, level=asked.level, seed=asked.seed)
    write_pairs(scene, pairs)
    for path in asked.outputs:
        write(path, scene, done, document)
    if form == "json":
        return json.dumps(scene_json(scene, done, document), allow_nan=False)
    parts = [scene_text.text(scene, done)]
    if document is not None:
        parts += ["", text_report.report(Document(document.measurements, None, None, _further(document, scene)))]
    return "\n".join(parts)


def _further(document: Document, scene: Scene) -> tuple[Any, ...]:
    """Notes that the scene's text has not told yet."""
    return tuple(dict.fromkeys(note for note in document.notes if note not in scene.notes))


def _known(asked: Run) -> Asked:
    """What tells the scale, read; refused here if it can't be used."""
    told = dict(asked.known)
    size = told.pop("marker_size")
    if size is not None:
        size = Quantity.parse(size, "m", bare="mm", name="--marker-size", assume=assumptions.size)
    board = told.pop("board", None)
    known = Asked(**told, marker_size=size, board=None if board is None else read_board(board), measures=asked.measures)
    check_outputs(asked.outputs)
    if not known.scale and not asked.unscaled:
        raise InputError("scale", None, f"{WHAT_TO_GIVE}; or --unscaled for a scene in a unit of its own")
    if not known.scale and (asked.measures or known.checks or asked.pairs):
        raise InputError("--measure", "without a scale", WHAT_TO_GIVE)
    if not 0.5 <= asked.level <= 0.999:
        raise InputError("--level", asked.level, "give a coverage from 0.5 to 0.999, as 0.95")
    for option, value, allowed in (("--matching", asked.matching, MATCHING), ("--mapping", asked.mapping, MAPPING)):
        if value not in allowed:
            raise InputError(option, value, f"give {', '.join(allowed)}")
    return known


def _scene(asked: Run, known: Asked, progress: Callable[[str, float], None]) -> tuple[Scene, dict[str, Path]]:
    opened = opened_scene(asked.folder)
    if opened is not None:
        return opened, photos_of(opened, asked.folder, asked.photos)
    paths = pictures_in(asked.folder)
    engine()
    positions = None
    if known.positions is not None:
        found = positions_told(known.positions, dict(zip(unique_names(paths), paths, strict=True))).of
        positions = {name: (float(p[0]), float(p[1]), float(p[2])) for name, (p, _) in found.items()}
    settings = Settings(asked.matching, asked.mapping, asked.features)
    scene = reconstructed(paths, camera=asked.camera, settings=settings, positions=positions, progress=progress)
    return scene, dict(zip(unique_names(paths), paths, strict=True))
