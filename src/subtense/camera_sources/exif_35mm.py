"""Camera from the 35 mm equivalent focal length in a photo's metadata.

By the diagonal, as the standard has it: f_px = f35 * diagonal of the picture in pixels / 43.267 mm. A picture whose proportions
are not its sensor's (16:9 or 1:1 of a 4:3 sensor) may go by the sensor's diagonal or by its own, and a digital zoom may be in
the number or not: both readings are given, and their difference is in u.

Source: CIPA DC-008 (EXIF), FocalLengthIn35mmFilm; diagonal of 36 mm x 24 mm.
"""

from __future__ import annotations

from ..equivalent import diagonals_px, is_absurd, readings_px, relative_u
from ..hypothesis import Hypothesis
from ..photo import Photo
from ..quantity import Note
from ..tagged_size import TaggedSize, tagged_size
from ..told_camera import held_together, pixel_shape, told_camera

NAME = "exif_35mm"


def camera(photo: Photo) -> Hypothesis:
    """The hypothesis, or its reason."""
    tags = photo.metadata
    if tags.f35_mm is None:
        return Hypothesis(NAME, None, "the metadata has no 35 mm equivalent focal length")
    if is_absurd(tags):
        text = f"the 35 mm equivalent of {tags.f35_mm:g} mm is absurd"
        note = Note("f35_invalid", f"{text} and was left out", "give the camera with --camera")
        return Hypothesis(NAME, None, text, (note,))
    size = tagged_size(photo)
    text = f"EXIF: 35 mm equivalent of {tags.f35_mm:g} mm, by the diagonal"
    readings = [told_camera(photo, f_px, relative_u(tags.f35_mm), text, size) for f_px in readings_px(photo, size)]
    found = held_together(readings)
    notes = (*size.notes, *_cut_note(photo, size), *pixel_shape(photo)[2])
    return Hypothesis(NAME, found, found.source, notes, tuple(readings) if len(readings) > 1 else ())


def _cut_note(photo: Photo, size: TaggedSize) -> tuple[Note, ...]:
    """Where there are two diagonals."""
    if len(diagonals_px(photo, size)) == 1:
        return ()
    width, height = size.whole_px[0], size.whole_px[1] / pixel_shape(photo)[0]
    long, short = max(width, height), min(width, height)
    return (Note("aspect_mismatch", f"a picture of {round(long)} x {round(short)} px is cut from a sensor of other proportions; the "
                 "35 mm equivalent may hold for either", "calibrate the camera, or use its full-sensor mode"),)  # fmt: skip
