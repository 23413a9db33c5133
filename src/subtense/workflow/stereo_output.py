"""What a stereo pair leaves behind: its document, and files of its depth map."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..depth_map import DepthMap
from ..document import Document
from ..photo import Photo
from ..quantity import Note
from ..reports import depth_files
from .stereo import Asked, Matched, depth_of, match_pair, stereo_document


@dataclass(frozen=True)
class Wanted:
    """Files to write; None for none.

    Attributes:
        depth_map: depths.
        sigma_map: their standard deviations.
        depth_picture: depths in colour.
        cloud: points.
        error_plot: standard deviation against depth.
    """

    depth_map: Path | None = None
    sigma_map: Path | None = None
    depth_picture: Path | None = None
    cloud: Path | None = None
    error_plot: Path | None = None

    def check(self) -> None:
        """Refuse a name before the work is done rather than after.

        Raises:
            InputError: an ending that is not written, or no such folder.
        """
        for field in dataclasses.fields(self):
            path = getattr(self, field.name)
            if path is not None:
                depth_files.check(path, "--" + field.name.replace("_", "-"))

    @property
    def any(self) -> bool:
        """Whether one is wanted."""
        return any(getattr(self, field.name) is not None for field in dataclasses.fields(self))


def stereo_with_files(
    left: Photo, right: Photo, asked: Asked, wanted: Wanted | None = None, *, level: float = 0.95, seed: int = 0
) -> Document:
    """Match a pair, write the files that are wanted, and give the document.

    Args:
        left: picture of the left camera.
        right: picture of the right one.
        asked: the rig, and what is to be measured.
        wanted: files.
        level: coverage of the intervals.
        seed: of the draws.

    Raises:
        SubtenseError: as `match_pair` and `stereo_document`.
    """
    wanted = wanted or Wanted()
    wanted.check()
    matched = match_pair(left, right, asked)
    document = stereo_document(matched, asked, level=level, seed=seed)
    if document.measurements and not wanted.any:
        return document
    made = depth_of(matched)
    write_files(made, left, wanted)
    return dataclasses.replace(document, notes=(*document.notes, summary(made, matched)))


def write_files(made: DepthMap, left: Photo, wanted: Wanted) -> None:
    """Each whole or not at all."""
    if wanted.depth_map is not None:
        depth_files.write_map(made.depth_m, wanted.depth_map, "--depth-map")
    if wanted.sigma_map is not None:
        depth_files.write_map(made.sigma_m, wanted.sigma_map, "--sigma-map")
    if wanted.depth_picture is not None:
        depth_files.write_picture(made, wanted.depth_picture, "--depth-picture")
    if wanted.cloud is not None:
        depth_files.write_cloud(made, left.pixels, wanted.cloud, "--cloud")
    if wanted.error_plot is not None:
        depth_files.write_error(made, wanted.error_plot, "--error-plot")


def summary(made: DepthMap, matched: Matched) -> Note:
    """The note `depth_map`: how much is answered, how far it reaches, how well it is known."""
    seen = made.answered & ~made.filled
    facts = matched.facts
    about = f"{made.source}; disparities from {facts.low_px} to {facts.high_px} px, {facts.matches} features in both pictures"
    if not seen.any():
        return Note(
            "depth_map", f"no pixel has a depth: {about}", "point both cameras at something with texture, nearer"
        )
    low, middle, high = np.quantile(made.depth_m[seen], [0.01, 0.5, 0.99])
    relative = float(np.median(made.sigma_m[seen] / made.depth_m[seen]))
    some = f"{100 * seen.mean():.0f} % of the pixels have a depth" + (
        f", {100 * made.filled.mean():.0f} % more were filled" if made.filled.any() else ""
    )
    text = (f"{some}; from {low:.3g} to {high:.3g} m, median {middle:.3g} m, u {100 * relative:.2g} % in the middle; about "
            f"{100 * matched.found.unsure:.1f} % may be on a wrong surface, beyond 3 u; {about}")  # fmt: skip
    return Note("depth_map", text)
