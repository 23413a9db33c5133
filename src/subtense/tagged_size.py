"""What the EXIF picture size says against the size at hand: resized since, cropped since, or as it was taken."""

from __future__ import annotations

from dataclasses import dataclass

from .photo import Photo
from .quantity import Note

CROPPED_U = 0.15
"""Relative u of a focal length whose picture was cropped by an unknown amount (80 % left make 20 %)."""
ZOOMED_U = 0.05
"""Relative u that stays when a digital zoom is corrected by its tag."""


@dataclass(frozen=True)
class TaggedSize:
    """How a picture relates to the size its tags tell.

    Attributes:
        scale: pixels now per pixel then; 1 where nothing is known.
        zoom: digital zoom ratio.
        relative_u: what this adds to the focal length's relative u.
        notes: what was seen.
    """

    scale: float = 1.0
    zoom: float = 1.0
    relative_u: float = 0.0
    notes: tuple[Note, ...] = ()


def tagged_size(photo: Photo) -> TaggedSize:
    """Compare the stored size with the EXIF tags; swapped tags are read the other way round."""
    tags = photo.metadata
    zoom = tags.digital_zoom if tags.digital_zoom and 1.01 < tags.digital_zoom < 100 else 1.0
    notes: tuple[Note, ...] = ()
    u = 0.0
    if zoom > 1:
        u = ZOOMED_U
        notes = (Note("digital_zoom", f"taken with a digital zoom of {zoom:g}; the focal length is corrected by it where "
                "its tag does not hold it",
                      "take the picture without digital zoom"),)  # fmt: skip
    if not tags.tagged_width_px or not tags.tagged_height_px:
        return TaggedSize(1.0, zoom, u, notes)
    now = photo.stored_size_px
    then = (tags.tagged_width_px, tags.tagged_height_px)
    if (now[0] > now[1]) != (then[0] > then[1]) and now[0] != now[1]:
        then = then[::-1]
    sx, sy = now[0] / then[0], now[1] / then[1]
    if max(abs(sx - 1) * then[0], abs(sy - 1) * then[1]) < 1:
        return TaggedSize(1.0, zoom, u, notes)
    sizes = f"taken with {then[0]} x {then[1]} px, now {now[0]} x {now[1]} px"
    if abs(sx / sy - 1) < 0.01:
        note = Note("resized", f"the picture was resized ({sizes}); the focal length is scaled with it",
                    "use the original picture")  # fmt: skip
        return TaggedSize(sx, zoom, u, (*notes, note))
    note = Note("cropped", f"the picture was cropped ({sizes}), by an unknown part", "use the original picture")
    return TaggedSize(max(sx, sy), zoom, max(u, CROPPED_U), (*notes, note))
