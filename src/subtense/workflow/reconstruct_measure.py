"""A scene in metres from what is known of its size, and measurements in it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..board import Board
from ..detection import Search
from ..document import Document
from ..errors import InputError, NothingFoundError, SubtenseError
from ..methods import triangulation
from ..photo import Photo
from ..quantity import Measurement, Note, Quantity
from ..scale import Known, Scaled, on_positions, positions_misfit, scaled
from ..scene import Scene
from ..target import Target
from ..views import Track, Views
from .correspond import Finder
from .detect import detect, size_of
from .improve import improved
from .reconstruct_board import known_board
from .reconstruct_input import (
    known_baselines,
    known_heights,
    known_lengths,
    known_positions,
    measured_ends,
    positions_told,
)
from .triangulate import measured


@dataclass(frozen=True)
class Asked:
    """What a person says of a scene's size and wants to know.

    Attributes:
        distances: `END -> END = LENGTH`.
        checks: the same, kept apart.
        baseline: of a stereo rig, `LEFT, RIGHT = LENGTH`.
        heights: of pictures over the ground.
        positions: a table of where pictures were taken.
        accuracy: of its rows that state none.
        marker_size: side of markers, to be found by themselves.
        targets: whether sheets, cards and codes of known size are looked for.
        board: a calibration board that is looked for.
        measures: `END` or `END -> END`.
    """

    distances: Sequence[str] = ()
    checks: Sequence[str] = ()
    baseline: str | None = None
    heights: Sequence[str] = ()
    positions: Path | None = None
    accuracy: str | None = None
    marker_size: Quantity | None = None
    targets: bool = False
    board: Board | None = None
    measures: Sequence[str] = ()

    @property
    def scale(self) -> bool:
        """Whether anything tells a scale."""
        return bool(
            self.distances
            or self.baseline
            or self.heights
            or self.positions
            or self.marker_size
            or self.targets
            or self.board
        )


def metric(scene: Scene, photos: Mapping[str, Path], asked: Asked) -> Scaled:
    """The scene in metres.

    Raises:
        InputError: nothing tells a scale, or a text that can't be read.
        NothingFoundError: the things that were to be found are not seen in two pictures.
    """
    views = plain_views(scene)
    finder = Finder(scene, photos)
    known = [*known_lengths(asked.distances, views, finder.found), *known_baselines(asked.baseline, views),
             *known_heights(asked.heights, views, finder.found)]  # fmt: skip
    placed, frame = None, ""
    doubts: tuple[Note, ...] = ()
    if asked.positions is not None:
        told = positions_told(asked.positions, photos)
        placed, frame = known_positions(told, asked.accuracy, scene), told.frame
        placed, doubts = _widened(scene, placed)
        known.append(placed)
    if asked.marker_size is not None or asked.targets:
        known += known_things(scene, views, photos, asked)
    if asked.board is not None:
        known.append(known_board(scene, photos, asked.board))
    known += known_lengths(asked.checks, views, finder.found, check=True)
    doubts = (*doubts, *finder.notes)
    done = scaled(replace(scene, notes=(*scene.notes, *doubts)), known)
    done = replace(done, notes=(*doubts, *done.notes))
    return done if placed is None else replace(done, scene=on_positions(done.scene, placed, frame))


def _widened(scene: Scene, known: Known) -> tuple[Known, tuple[Note, ...]]:
    """Positions as doubtful as their misfit shows."""
    times = positions_misfit(scene, known)
    if times == 1.0:
        return known, ()
    text = f"the positions of the pictures are off the scene by {times:.2g} times what is stated of them; their u was widened by that"
    note = Note(
        "positions_misfit", text, "check the table's columns, its axes (x, y, z of a right-handed frame) and each row"
    )
    return replace(known, sigma_m=np.asarray(known.sigma_m) * times), (note,)


def plain_views(scene: Scene) -> Views:
    """The pictures of a scene in its own unit, for picking points."""
    return replace(scene, u_scale=0.0 if scene.u_scale is None else scene.u_scale).views()


def known_things(scene: Scene, views: Views, photos: Mapping[str, Path], asked: Asked) -> list[Known]:
    """Things of known size that are found in two pictures of the scene or more: markers by their side, sheets and cards by what they are.

    Raises:
        NothingFoundError: none is.
    """
    seen: dict[str, dict[str, object]] = {}
    targets: dict[str, Target] = {}
    for name in scene.names:
        photo = Photo.load(photos[name])
        camera = views.camera(views.index(name))
        only = (
            ("markers",) if asked.marker_size is not None and not asked.targets else ("markers", "qr_codes", "sheets")
        )
        for one in detect(photo, only, Search(camera=camera)).detections:
            if one.shape not in ("square", "rectangle"):
                continue
            size = (
                Target.square(asked.marker_size, one.label)
                if asked.marker_size is not None and one.shape == "square"
                else size_of(one)
            )
            if isinstance(size, Target):
                seen.setdefault(one.label, {})[name] = one.seen
                targets.setdefault(one.label, size)
    known = []
    for label, by_picture in seen.items():
        if len(by_picture) >= 2:
            known.append(_thing(label, by_picture, targets[label], asked.marker_size))
    if not known:
        raise NothingFoundError(
            "no marker, sheet or card of known size was found in two pictures of the scene", found=len(seen), needed=1
        )
    return known


def _thing(label: str, by_picture: Mapping[str, object], target: Target, size: Quantity | None) -> Known:
    """Corners as tracks: within a picture their errors hang together, which is kept by taking each corner's own covariance."""
    from ..observation import Observation

    tracks = []
    for corner in range(4):
        points, covs = [], []
        for found in by_picture.values():
            assert isinstance(found, Observation)
            points.append(found.points_px[corner])
            whole = found.cov if found.cov is not None else np.diag(found.standard_deviations**2)
            covs.append(whole[2 * corner : 2 * corner + 2, 2 * corner : 2 * corner + 2])
        cov = np.zeros((2 * len(points), 2 * len(points)))
        for i, one in enumerate(covs):
            cov[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = one
        tracks.append(
            Track(tuple(by_picture), Observation(np.array(points), cov=cov, label=f"{label}, corner {corner + 1}"))
        )
    relative = float(size.u) / float(size.value) if size is not None else target.u_scale
    identity = None if size is None else f"print of {size.identity}"
    length = Quantity(1.0, relative, "1", source=f"size of {label}", id=identity)
    return Known(
        "shape", length, tuple(tracks), places_m=np.asarray(target.points_m, float), sigma_m=target.sigma_m, label=label
    )


def measurements(
    done: Scaled, photos: Mapping[str, Path], texts: Sequence[str], *, level: float = 0.95, seed: int = 0
) -> Document:
    """What is asked for in a scene in metres: a point's range from the picture it was set in first, or a length between two ends.

    One that has no answer becomes a note `refused`, and does not lose the others.
    """
    scene = done.scene
    views, finder = scene.views(), Finder(scene, photos)
    found: list[Measurement] = []
    refused: list[Note] = []
    for number, text in enumerate(texts, 1):
        try:
            finder.notes.clear()
            tracks, label = measured_ends(text, views, number, finder.found)
            doubts = tuple(finder.notes)
            part = views.subset([name for track in tracks for name in track.names])
            if len(tracks) == 1:
                inputs: object = triangulation.Inputs(part, tracks[0])
                answers = measured(triangulation.METHOD, inputs, label, level, seed)[:2]
            else:
                answers = measured(
                    triangulation.LENGTH, triangulation.LengthInputs(part, tracks[0], tracks[1]), label, level, seed
                )
            found += [replace(answers[0], notes=(*answers[0].notes, *doubts)), *answers[1:]]
        except SubtenseError as error:
            if len(texts) == 1 or isinstance(error, InputError):
                raise
            refused.append(Note("refused", f"{text}: {error}"))
    return Document(improved(tuple(found)), None, None, (*scene.notes, *done.notes, *refused))
