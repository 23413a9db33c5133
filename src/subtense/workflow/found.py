"""What a photo shows by itself: found, and measured as far as its size is known, by what a person typed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from ..camera import Camera
from ..detection import Search, parse_curve, unknown_curve
from ..detectors.markers import ALL_FAMILIES
from ..document import Document
from ..errors import InputError, NothingFoundError
from ..photo import Photo
from ..quantity import Quantity
from ..target import Target
from ..targets import find_target
from .detect import Found, detect, detectors_for
from .measure import Standing, measure_detections
from .resolve_camera import resolve_camera

Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class Asked:
    """What a person said of what to look for, as texts.

    Attributes:
        only: names of DETECTORS.
        targets: names in data/targets.toml, or in a file of one's own.
        target_file: that file.
        family: of markers.
        curve: of the picture; see `parse_curve`.
        model: a network of one's own.
        thorough: whether small things are looked for even where larger ones were found.
    """

    only: tuple[str, ...] = ()
    targets: tuple[str, ...] = ()
    target_file: Path | None = None
    family: str | None = None
    curve: str | None = None
    model: Path | None = None
    thorough: bool = False

    def search(self, camera: Camera | None = None) -> Search:
        """As a Search.

        Raises:
            InputError: a name or text that can't be read.
        """
        if self.family is not None and self.family not in ALL_FAMILIES:
            raise InputError("--marker-family", self.family, f"known are {', '.join(ALL_FAMILIES)}")
        rows = tuple(find_target(name, "--target", self.target_file) for name in self.targets)
        return Search(rows, self.family, unknown_curve() if self.curve is None else parse_curve(self.curve), self.thorough,
                      self.model, camera=camera)  # fmt: skip


def found_in(photo: Photo, asked: Asked, camera: str | None = None, progress: Progress | None = None) -> Found:
    """What the detectors see.

    Raises:
        NothingFoundError: nothing at all.
        InputError: a detector, target, family or curve that there is not.
    """
    told = resolve_camera(photo, camera).camera if camera is not None else None
    found = detect(photo, asked.only, asked.search(told), progress or (lambda title, share: None))
    if not found.detections:
        raise _nothing(photo, asked, found)
    return found


def _nothing(photo: Photo, asked: Asked, found: Found) -> NothingFoundError:
    rows = detectors_for(asked.only, asked.search().targets)
    looked = "; ".join(row.title for row in rows)
    why = "".join(f"; {note.text}" for note in found.notes)
    return NothingFoundError(
        f"{photo.name}: nothing was found; looked for were {looked}{why}; give the two ends of a thing with --line, and its --size"
    )


def measured(
    photo: Photo, asked: Asked, *, size: Quantity | Target | None = None, marker_size: Quantity | None = None,
    camera: str | None = None, standing: Standing | None = None, level: float = 0.95, seed: int = 0,
    progress: Progress | None = None,
) -> Document:  # fmt: skip
    """Everything that is found and whose size is known, told, or taken to be that of its kind, as one document.

    Args:
        photo: the picture.
        asked: what to look for.
        size: of things that nothing else tells the size of: side, length or diameter, m; or width and height.
        marker_size: side of markers' black square, m.
        camera: what the user said of it; None to go by the photo.
        standing: how the camera stands above the ground.
        level: coverage of the intervals.
        seed: of the draws.
        progress: is told what is looked for, and the share of all work done.

    Raises:
        NothingFoundError: nothing, or nothing with a size.
        UnknownCameraError: no camera.
        InputError: something asked for that there is not.
    """
    search = asked.search()
    detectors_for(asked.only, search.targets)
    resolved = resolve_camera(photo, camera)
    found = detect(photo, asked.only, asked.search(resolved.camera), progress or (lambda title, share: None))
    if not found.detections:
        raise _nothing(photo, asked, found)
    sizes = {name: one for name, one in (("markers", marker_size), ("", size)) if one is not None}
    document = measure_detections(found, photo, resolved, sizes=sizes, stated=search.targets, standing=standing,
                                  level=level, seed=seed)  # fmt: skip
    if not document.measurements and all(note.code != "refused" for note in document.notes):
        seen = ", ".join(dict.fromkeys(one.label for one in found.detections))
        raise NothingFoundError(
            f"{photo.name}: found {seen}, and nothing tells the size of any; give it with --marker-size, --size or --target"
        )
    return document
