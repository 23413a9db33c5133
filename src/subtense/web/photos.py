"""The photos a server holds: decoded by a child into a private folder, cut into tiles, dropped when no page wants them."""

from __future__ import annotations

import asyncio
import json
import shutil
import tempfile
import time
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import Pixels
from ..photo import Metadata, Photo
from ..quantity import Note
from .children import ChildError, Children, Progress, unwatched
from .settings import Limits

TILE_PX = 512
JPEG_QUALITY = 92
TAGS = "metadata.json"
"""Beside the pixels."""
MOST_TILES = 256
"""Kept ready of each photo; a browser keeps those it has seen itself."""


@dataclass
class Held:
    """One photo of a server.

    Attributes:
        id: from its content: a photo that is sent again has the same one.
        photo: with its pixels in a file of the private folder.
        levels: pixels at full size, half, a quarter, ... down to one tile.
        folder: its own; gone with it.
        kept: whether it stays without a page (it was named on the command line).
        source: the file, of a photo that is kept.
        asked_s: when it was last asked for, monotonic clock.
        tiles: the tiles that were cut already.
        cameras: cameras that were resolved already, by what was given.
    """

    id: str
    photo: Photo
    levels: tuple[Pixels, ...]
    folder: Path
    kept: bool = False
    source: Path | None = None
    asked_s: float = 0.0
    tiles: dict[tuple[int, int, int, str], bytes] = field(default_factory=dict)
    cameras: dict[str, Any] = field(default_factory=dict)

    @property
    def bytes(self) -> int:
        """Of all its levels."""
        return sum(level.nbytes for level in self.levels)

    def to_json(self) -> dict[str, Any]:
        """What a page needs to show it: no path, no position, no serial number."""
        m = self.photo.metadata
        tags = {"make": m.make, "model": m.model, "lens": m.lens, "focal_mm": m.focal_mm, "f35_mm": m.f35_mm}
        return {
            "id": self.id, **self.photo.to_json(), "tile_px": TILE_PX, "levels": len(self.levels),
            "tags": {name: value for name, value in tags.items() if value is not None},
            "notes": [note.to_json() for note in self.photo.notes], "kept": self.kept,
        }  # fmt: skip


class Photos:
    """The photos of one server, by id."""

    def __init__(self, limits: Limits, children: Children) -> None:
        self.limits, self.children = limits, children
        self.folder = Path(tempfile.mkdtemp(prefix="subtense-"))  # only its owner may look into it
        self.held: dict[str, Held] = {}

    def close(self) -> None:
        """Drop all."""
        self.held.clear()
        shutil.rmtree(self.folder, ignore_errors=True)

    def find(self, photo: str) -> Held | None:
        """The photo of an id, which is thereby wanted for a while longer."""
        found = self.held.get(photo)
        if found is not None:
            found.asked_s = time.monotonic()
        return found

    def drop(self, photo: str) -> bool:
        """Forget a photo; whether there was one."""
        found = self.held.pop(photo, None)
        if found is not None:
            shutil.rmtree(found.folder, ignore_errors=True)
        return found is not None

    def sweep(self) -> None:
        """Drop what no page has asked for lately, and the longest unasked for where there are too many."""
        now_s = time.monotonic()
        idle = sorted((h for h in self.held.values() if not h.kept), key=lambda h: h.asked_s)
        total, count = sum(h.bytes for h in self.held.values()), len(self.held)
        for held in idle:
            over = count > self.limits.photos or total > self.limits.photo_bytes
            if over or now_s - held.asked_s > self.limits.idle_s:
                self.drop(held.id)
                total, count = total - held.bytes, count - 1

    async def add(self, source: Path, name: str, *, kept: bool = False, progress: Progress = unwatched) -> Held:
        """Decode a file (it is moved into the private folder, or copied if `kept`) and hold the photo.

        Raises:
            ChildError: it is no picture, or over a limit.
            BusyError: too many are waiting.
        """
        async with self.children.place():
            folder = Path(tempfile.mkdtemp(dir=self.folder))
            try:
                (shutil.copyfile if kept else shutil.move)(source, folder / "input")
                task = {"do": "decode", "name": name, "tile_px": TILE_PX}
                room = self.limits.pixels * 4 + 2**26
                made = await self.children.run(task, folder, cpu_s=self.limits.cpu_s, wall_s=self.limits.wall_s,
                                               file_bytes=room, memory_bytes=self.limits.memory_bytes, progress=progress)  # fmt: skip
                (folder / "input").unlink()
                held = self._held(made, name, folder, kept)
            except BaseException:
                shutil.rmtree(folder, ignore_errors=True)
                raise
        old = self.held.get(held.id)
        if old is not None:
            shutil.rmtree(held.folder, ignore_errors=True)
            old.kept, old.asked_s = old.kept or kept, time.monotonic()
            old.photo = replace(old.photo, name=held.photo.name)
            old.source = source if kept else old.source
            return old
        held.source = source if kept else None
        self.held[held.id] = held
        self.sweep()
        return held

    def _held(self, made: dict[str, Any], name: str, folder: Path, kept: bool) -> Held:
        """The child's outcome, believed only as far as the file it wrote goes."""
        sizes = [(int(w), int(h)) for w, h in made["sizes"]]
        path = folder / "pixels.bin"
        if path.stat().st_size != sum(3 * w * h for w, h in sizes) or not all(w > 0 and h > 0 for w, h in sizes):
            raise ChildError("FileFormatError", f"{name}: its decoder wrote something else than a picture")
        levels, start = [], 0
        for width, height in sizes:
            levels.append(np.memmap(path, np.uint8, "r", start, (height, width, 3)))
            start += 3 * width * height
        notes = tuple(Note(**note) for note in made["notes"])
        (folder / TAGS).write_text(json.dumps(made["metadata"]), "utf-8")  # what a search is told of the file
        photo = Photo(levels[0], Metadata.from_json(made["metadata"]), Path(name), str(made["digest"]), notes, name)
        return Held(photo.digest[:32], photo, tuple(levels), folder, kept, asked_s=time.monotonic())


def tile(held: Held, level: int, column: int, row: int, form: str) -> bytes | None:
    """One tile of 512 px as JPEG or PNG; level 0 is the smallest, as deep-zoom viewers count. None where there is none."""
    key = (level, column, row, form)
    if key in held.tiles:
        return held.tiles[key]
    if not 0 <= level < len(held.levels):
        return None
    pixels = held.levels[len(held.levels) - 1 - level]
    top, left = row * TILE_PX, column * TILE_PX
    if not (0 <= top < pixels.shape[0] and 0 <= left < pixels.shape[1]):
        return None
    found = encoded(pixels[top : top + TILE_PX, left : left + TILE_PX], form)
    if len(held.tiles) < MOST_TILES:
        held.tiles[key] = found
    return found


def encoded(pixels: Pixels, form: str) -> bytes:
    """RGB pixels as JPEG (without chroma subsampling) or PNG."""
    import cv2

    bgr = cv2.cvtColor(np.ascontiguousarray(pixels), cv2.COLOR_RGB2BGR)
    if form == "png":
        return bytes(cv2.imencode(".png", bgr, [cv2.IMWRITE_PNG_COMPRESSION, 1])[1])
    quality = [
        cv2.IMWRITE_JPEG_QUALITY,
        JPEG_QUALITY,
        cv2.IMWRITE_JPEG_SAMPLING_FACTOR,
        cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444,
    ]
    return bytes(cv2.imencode(".jpg", bgr, quality)[1])


async def sweeping(photos: Photos, every_s: float = 10.0) -> None:
    """Sweep for ever."""
    while True:
        await asyncio.sleep(every_s)
        photos.sweep()
