"""Reconstruction end to end: a folder of pictures, or a scene of another program, to a scene in metres and what is measured in it."""

from __future__ import annotations

import contextlib
import dataclasses
import math
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..bundle import adjust, thinned
from ..camera import Camera
from ..errors import InputError, NothingFoundError, UnknownCameraError
from ..hypothesis import unknown_lens
from ..methods import reconstruction
from ..methods.reconstruction import Picture, Settings
from ..photo import Photo
from ..quantity import Note
from ..scene import Scene
from .calibrate_input import PICTURES
from .resolve_camera import resolve_camera
from .triangulate import unique_names

CELLS = 18
"""Points of the final adjustment are spread over so many cells across and down each picture."""
UNKNOWN_FOCAL = 1.2
"""Of the longer side, where nothing tells the focal length; COLMAP's guess."""
U_UNKNOWN_FOCAL = 0.3
FURTHER_LENS = 0.05
"""Standard deviation of a lens's second coefficient where its first is open; it is rarely larger than the first."""
ENGINE_READS = frozenset((".jpg", ".jpeg", ".png", ".bmp", ".tif", ".tiff"))
ONE_PLACE = 0.2
"""Relative u of the longest distance between cameras, in the shape of the scene, from which they stood at one place."""
Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class Told:
    """Pictures as they are told apart, and their cameras.

    Attributes:
        pictures: for the engine.
        cameras: what is known of each.
        photos: paths of the pictures by name.
        notes: doubts about pictures and cameras.
    """

    pictures: tuple[Picture, ...]
    cameras: tuple[Camera, ...]
    photos: dict[str, Path]
    notes: tuple[Note, ...]


def pictures_in(folder: Path) -> list[Path]:
    """The pictures of a folder, by name.

    Raises:
        InputError: no folder, or fewer than two pictures.
    """
    if not folder.is_dir():
        raise InputError(
            "FOLDER", str(folder), "give a folder of pictures, or a scene of COLMAP, OpenSfM or OpenDroneMap"
        )
    found = sorted(p for p in folder.iterdir() if p.suffix.lower() in PICTURES and not p.name.startswith("."))
    if len(found) < 2:
        raise InputError(
            "FOLDER",
            f"{folder} with {len(found)} pictures",
            "give two pictures or more of the same things from different places",
        )
    return found


def reconstructed(
    paths: Sequence[Path], *, camera: str | None = None, settings: Settings | None = None,
    positions: dict[str, tuple[float, float, float]] | None = None, progress: Progress | None = None,
) -> Scene:  # fmt: skip
    """The scene that pictures give, adjusted, in a unit of its own.

    Args:
        paths: of two pictures or more.
        camera: what is known of the camera; None to go by each picture.
        settings: of the engine.
        positions: where pictures were taken, for matching by position.
        progress: is told what is done, and the share of all work.

    Raises:
        NothingFoundError: the pictures do not make a scene, or were all taken from one place.
    """
    say = progress or (lambda _title, _share: None)
    with told(paths, camera, positions or {}) as these:
        start = reconstruction.reconstruct(these.pictures, these.cameras, settings, say)
    say("adjusting", 0.95)
    scene = settled(start, these.cameras)
    _check_places(scene)
    return dataclasses.replace(scene, notes=(*these.notes, *scene.notes, *_left_out(scene)))


def settled(start: Scene, known: Sequence[Camera]) -> Scene:
    """A scene adjusted with what was known of its cameras, with the covariance of its places."""
    bundle = adjust(thinned(start.network, CELLS), known)
    scene = start.adjusted(bundle)
    moved = [float(np.max(np.abs(shift), initial=0.0)) for shift in bundle.prior_shift]
    notes = []
    for c, far in enumerate(moved):
        if far > CONTRADICTED:
            text = (f"the scene moves the camera of {_first_of(scene, c)} by {far:.1f} times what was stated of it; the lengths rest on "
                    "the scene's camera")  # fmt: skip
            notes.append(Note("camera_contradicted", text, "check what was said of the camera, or calibrate it"))
    return dataclasses.replace(scene, notes=(*scene.notes, *notes))


CONTRADICTED = 4.0
"""Of its u, how far an adjustment may move a camera's number before that is noted."""


def _first_of(scene: Scene, camera: int) -> str:
    return next((name for name, c in zip(scene.names, scene.camera_of, strict=True) if c == camera), "no picture")


def _left_out(scene: Scene) -> tuple[Note, ...]:
    if not scene.left_out:
        return ()
    shown = ", ".join(scene.left_out[:5]) + (", ..." if len(scene.left_out) > 5 else "")
    text = f"{len(scene.left_out)} of {len(scene.left_out) + len(scene.names)} pictures have no place: {shown}"
    return (Note("pictures_left_out", text, "take more pictures between them and the others"),)


def _check_places(scene: Scene) -> None:
    """Refuses a scene whose pictures were taken from one place: it has directions, and no distances."""
    assert scene.cov is not None
    apart = scene.centre[:, None] - scene.centre[None]
    far = np.linalg.norm(apart, axis=-1)
    i, j = np.unravel_index(int(np.argmax(far)), far.shape)
    depth = float(np.median(np.linalg.norm(scene.points[scene.point] - scene.centre[scene.view], axis=1)))
    along = apart[i, j] / far[i, j]
    rows = [6 * int(i) + 3 + k for k in range(3)] + [6 * int(j) + 3 + k for k in range(3)]
    slope = np.concatenate([along, -along])
    u = math.sqrt(max(float(slope @ scene.cov[np.ix_(rows, rows)] @ slope), 0.0))
    pixel = scene.sigma_px / float(scene.cameras[0].f_px)
    if u > ONE_PLACE * far[i, j] or far[i, j] / depth < 10 * pixel:
        raise NothingFoundError("no scene: all pictures were taken from one place, as far as they tell; move between them, by a "
                                "tenth of the distance or more", found=0, needed=2)  # fmt: skip


@contextlib.contextmanager
def told(paths: Sequence[Path], camera: str | None, positions: dict[str, tuple[float, float, float]]) -> Iterator[Told]:
    """Pictures and cameras for the engine; upright copies of what it would read otherwise last as long as this."""
    names = unique_names(paths)
    cameras: dict[object, int] = {}
    found: list[Camera] = []
    pictures: list[Picture] = []
    notes: list[Note] = []
    with tempfile.TemporaryDirectory(prefix="subtense-") as folder:
        for name, path in zip(names, paths, strict=True):
            photo = Photo.load(path)
            tags = photo.metadata
            key = (photo.width_px, photo.height_px, tags.make, tags.model, tags.lens, tags.focal_mm, tags.f35_mm)
            if key not in cameras:
                cameras[key] = len(found)
                known, doubts = camera_of(photo, camera)
                found.append(known)
                notes += doubts
            use = path
            if tags.orientation != 1 or path.suffix.lower() not in ENGINE_READS:
                use = Path(folder) / f"{len(pictures)}.png"
                _write(photo, use)
            pictures.append(Picture(name.replace("/", "_"), use, cameras[key], positions.get(name)))
        yield Told(
            tuple(pictures),
            tuple(found),
            dict(zip((p.name for p in pictures), paths, strict=True)),
            tuple(dict.fromkeys(notes)),
        )


def _write(photo: Photo, path: Path) -> None:
    from PIL import Image

    Image.fromarray(np.asarray(photo.pixels)).save(path, compress_level=1)


def camera_of(photo: Photo, text: str | None) -> tuple[Camera, tuple[Note, ...]]:
    """What is known of a picture's camera, opened as far as it may be wrong; a wide guess where nothing is."""
    try:
        resolved = resolve_camera(photo, text)
    except UnknownCameraError as error:
        if text is not None or error.code in ("panorama", "perspective_edited"):
            raise
        f = UNKNOWN_FOCAL * max(photo.width_px, photo.height_px)
        guess = unknown_lens(
            photo.width_px, photo.height_px, f, U_UNKNOWN_FOCAL * f, "assumed: 1.2 times the picture's longer side"
        )
        text = f"nothing tells the focal length of {photo.name}; the scene tells it, from 1.2 times the longer side to 30 %"
        note = Note("focal_assumed", text, "calibrate the camera, or give --camera")
        return opened(guess), (note,)
    # the scene's focal length is that of the pictures as they were focused
    return opened(dataclasses.replace(resolved.camera, nominal_focal_m=None, id=None)), resolved.notes


def opened(camera: Camera) -> Camera:
    """A camera whose first coefficient of distortion is open has its second and the tangential ones open too."""
    if camera.cov is None or camera.lens != "brown_conrady" or camera.cov[4, 4] == 0:
        return camera
    cov = np.array(camera.cov)
    for index, u in ((5, min(FURTHER_LENS, 2 * math.sqrt(cov[4, 4]))), (6, 1e-3), (7, 1e-3)):
        cov[index, index] = max(cov[index, index], u**2)
    return dataclasses.replace(camera, cov=cov, id=None)


def opened_scene(folder: Path) -> Scene | None:
    """A scene of COLMAP, OpenSfM or OpenDroneMap in a folder, adjusted once more for its covariance; None if there is none.

    Raises:
        FileFormatError: it can't be read.
    """
    from ..scene_files import colmap, opensfm

    for one in (folder, folder / "sparse" / "0", folder / "sparse", folder / "0"):
        if one.is_dir() and colmap.is_model(one):
            scene = colmap.read(one)
            break
    else:
        place = opensfm.folder_of(folder) if folder.is_dir() else None
        if place is None:
            return None
        scene = opensfm.read(place)
    scene = settled(scene, scene.cameras)
    _check_places(scene)
    return scene


def photos_of(scene: Scene, folder: Path, photos: Path | None) -> dict[str, Path]:
    """The files of a scene's pictures: in `photos`, or in the scene's folder, or in `images` in or beside it."""
    places = (
        [photos]
        if photos is not None
        else [folder, folder / "images", folder.parent / "images", folder.parent.parent / "images"]
    )
    found = {}
    for name in scene.names:
        for place in places:
            if (place / name).is_file():
                found[name] = place / name
                break
    return found
