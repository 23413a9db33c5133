"""What the file says of the picture's size against the size at hand: resized since, cropped since, or as it was taken.

A crop moves the axis out of the picture's middle, and everything that goes by the whole picture (an angle of view, a 35 mm
equivalent) holds for the whole one. Where the file tells the rectangle (crs of Camera Raw and Lightroom, as fractions of the
whole), both are corrected exactly; where it tells that something was cut off and not what, u holds what is possible.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace

from .edited import is_applied, is_film_frame
from .lens_class import is_phone
from .metadata import Metadata, number
from .photo import Photo
from .quantity import Note

CROPPED_U = 0.15
"""Relative u of a focal length whose picture was cropped by an unknown amount (80 % left make 20 %)."""
CROPPED_CENTRE = 0.10
"""u of its principal point, in picture widths."""
ZOOMED_U = 0.05
"""Relative u that stays when a digital zoom is corrected by its tag."""
FILM_FACTORS = (1.0, 1.5)
"""How much a film's frame is narrower than a still of the same camera (traps 11; an iPhone 7 was measured at 1.28)."""
USUAL_ASPECTS = (
    1.0,
    5 / 4,
    4 / 3,
    7 / 5,
    3 / 2,
    16 / 10,
    5 / 3,
    16 / 9,
    17 / 9,
    256 / 135,
    2.0,
    18.5 / 9,
    19.5 / 9,
    20 / 9,
    21 / 9,
    65 / 24,
)
"""Long side over short of what cameras make; another one was cut."""
ASPECT_TOLERANCE = 0.012
LENS_TOLERANCE = 0.06
"""Logarithm of focal length over that in the lens's name, within which both are of one lens: names are rounded."""

Pair = tuple[float, float]


@dataclass(frozen=True)
class TaggedSize:
    """How a picture relates to the one that was taken. All in the stored frame.

    Attributes:
        scale: pixels now per pixel then; 1 where nothing is known.
        zoom: digital zoom ratio.
        relative_u: what this adds to the focal length's relative u.
        notes: what was seen.
        whole_px: width and height that the whole picture has, or would have, in pixels of now.
        middle_px: where the middle of the whole picture lies.
        centre_u: what this adds to the principal point's u, in picture widths.
        film: how much narrower than a still the picture is, its middle value; 1 for a still.
    """

    scale: float = 1.0
    zoom: float = 1.0
    relative_u: float = 0.0
    notes: tuple[Note, ...] = ()
    whole_px: Pair = (0.0, 0.0)
    middle_px: Pair = (0.0, 0.0)
    centre_u: float = 0.0
    film: float = 1.0


def tagged_size(photo: Photo) -> TaggedSize:
    """Compare the stored size with the tags; swapped tags are read the other way round."""
    now = photo.stored_size_px
    found = TaggedSize(whole_px=(float(now[0]), float(now[1])), middle_px=((now[0] - 1) / 2, (now[1] - 1) / 2))
    for look in (_zoomed, _cut, _film, _lens):
        found = look(photo, found)
    return found


def _noted(found: TaggedSize, note: Note, relative_u: float = 0.0) -> TaggedSize:
    return replace(found, notes=(*found.notes, note), relative_u=math.hypot(found.relative_u, relative_u))


def _zoomed(photo: Photo, found: TaggedSize) -> TaggedSize:
    zoom = photo.metadata.digital_zoom
    if not zoom or not 1.01 < zoom < 100:
        return found
    text = f"taken with a digital zoom of {zoom:g}; the focal length is corrected by it where its tag does not hold it"
    return _noted(
        replace(found, zoom=zoom), Note("digital_zoom", text, "take the picture without digital zoom"), ZOOMED_U
    )


def _film(photo: Photo, found: TaggedSize) -> TaggedSize:
    """A frame of a film: the stabiliser and the mode use an unknown part of the sensor."""
    if not is_film_frame(photo):
        return found
    low, high = FILM_FACTORS
    middle = (low + high) / 2
    text = (f"the picture has the size of a film and no mark of a still; a film's frame is {low:g} to {high:g} times narrower "
            "than a still, which is in u")  # fmt: skip
    u = (high - low) / math.sqrt(12) / middle
    return _noted(replace(found, film=middle), Note("video_crop", text, "calibrate the camera in this film mode"), u)


_MILLIMETRES = re.compile(r"(\d+(?:\.\d+)?)\s?mm")


def _lens(photo: Photo, found: TaggedSize) -> TaggedSize:
    """A phone has several lenses: which one it was, lens model and focal length must tell alike."""
    tags = photo.metadata
    if not is_phone(tags) or not tags.focal_mm:
        return found
    named = [float(text) for text in _MILLIMETRES.findall(tags.lens or "")] or list(tags.lens_focal_mm or ())
    gaps = [abs(math.log(one / tags.focal_mm)) for one in named if one > 0]
    if not gaps or min(gaps) < LENS_TOLERANCE:
        return found
    text = (f"the lens is called {tags.lens!r}, and the focal length is {tags.focal_mm:g} mm: the tags are of two lenses of "
            "this phone")  # fmt: skip
    return _noted(found, Note("lens_ambiguous", text, "give the camera with --camera"), min(min(gaps), 1.0))


# -- resized and cropped -----------------------------------------------------------------------------------


def _cut(photo: Photo, found: TaggedSize) -> TaggedSize:
    rectangle = _rectangle(photo.metadata)
    if rectangle is not None:
        return _by_rectangle(found, rectangle)
    by_size = _by_size(photo, found)
    if any(note.code == "cropped" for note in by_size.notes):
        return by_size
    why = _signs_of_a_cut(photo)
    return _by_unknown(by_size, f"the picture was cropped ({why}), by an unknown part") if why else by_size


def _by_unknown(found: TaggedSize, text: str) -> TaggedSize:
    wider = replace(found, centre_u=CROPPED_CENTRE)
    return _noted(wider, Note("cropped", text, "use the original picture"), CROPPED_U)


def _rectangle(tags: Metadata) -> tuple[float, float, float, float, float] | None:
    """Left, top, right, bottom of an applied crop as fractions of the whole, and its angle in rad."""
    if tags.xmp.get("crs:HasCrop", "").lower() != "true" or is_applied(tags) is not True:
        return None
    sides = [number(tags.xmp.get(f"crs:Crop{side}")) for side in ("Left", "Top", "Right", "Bottom")]
    left, top, right, bottom = (side if side is not None else -1.0 for side in sides)
    if not (0 <= left < right <= 1 and 0 <= top < bottom <= 1 and (right - left) * (bottom - top) > 1e-4):
        return None
    return left, top, right, bottom, math.radians(number(tags.xmp.get("crs:CropAngle")) or 0.0)


def _by_rectangle(found: TaggedSize, rectangle: tuple[float, float, float, float, float]) -> TaggedSize:
    """The whole picture from the fractions, in whichever frame they make a usual picture.

    The fractions hold for the raw picture; the writer may have turned it since. An angle turns the rectangle too: its effect
    on size and middle is in u.
    """
    left, top, right, bottom, angle = rectangle
    width, height = found.whole_px
    across, down = right - left, bottom - top
    as_is, turned = (width / across, height / down), (width / down, height / across)
    straight = _usual(as_is) or not _usual(turned)
    whole = as_is if straight else turned
    shift = ((0.5 - (left + right) / 2) * whole[0], (0.5 - (top + bottom) / 2) * whole[1])
    # turned by a quarter one way or the other: the middle lies on either side
    sure = straight and (abs(across - down) < 1e-6 or not _usual(turned))
    middle = (found.middle_px[0] + shift[0], found.middle_px[1] + shift[1]) if straight else found.middle_px
    unsure = 0.0 if sure else math.hypot(*shift) / width
    tilt = abs(math.sin(angle))
    text = (f"the picture was cropped to {100 * across:.0f} % of the width and {100 * down:.0f} % of the height of "
            f"{round(whole[0])} x {round(whole[1])} px; the camera is corrected by it")  # fmt: skip
    placed = replace(found, whole_px=whole, middle_px=middle, centre_u=math.hypot(unsure, 0.5 * tilt))
    return _noted(placed, Note("cropped", text, "use the original picture"), tilt)


def _usual(size: Pair) -> bool:
    aspect = max(size) / min(size)
    return any(abs(aspect / usual - 1) < ASPECT_TOLERANCE + 1 / min(size) for usual in USUAL_ASPECTS)


def _by_size(photo: Photo, found: TaggedSize) -> TaggedSize:
    tags, now = photo.metadata, photo.stored_size_px
    if not tags.tagged_width_px or not tags.tagged_height_px:
        return found
    then = (tags.tagged_width_px, tags.tagged_height_px)
    if (now[0] > now[1]) != (then[0] > then[1]) and now[0] != now[1]:
        then = then[::-1]
    sx, sy = now[0] / then[0], now[1] / then[1]
    if max(abs(sx - 1) * then[0], abs(sy - 1) * then[1]) < 1:
        return found
    sizes = f"taken with {then[0]} x {then[1]} px, now {now[0]} x {now[1]} px"
    if abs(sx / sy - 1) < 0.01:
        text = (f"the picture is taken to be resized ({sizes}), and the focal length is scaled with it; if a part of these very "
                f"proportions was cut out instead, all distances are {1 / sx:.3g} times what is told")  # fmt: skip
        return _noted(replace(found, scale=sx), Note("resized", text, "use the original picture, or give the camera"))
    # the whole picture, scaled, holds this one: between cut in one direction only and cut without being resized
    least = max(sx, sy)
    scale = (least + 1) / 2 if least < 1 else least
    cut = replace(found, scale=scale, whole_px=(then[0] * scale, then[1] * scale))
    return _by_unknown(cut, f"the picture was cropped ({sizes}), by an unknown part")


def _signs_of_a_cut(photo: Photo) -> str:
    """Why the picture must have been cut; empty where nothing tells so."""
    tags, now = photo.metadata, photo.stored_size_px
    if tags.xmp.get("crs:HasCrop", "").lower() == "true" and is_applied(tags) is not False:
        return "its edits tell of a crop and not of its rectangle"
    if not _usual(now):
        return f"no camera makes {now[0]} x {now[1]} px"
    if tags.thumbnail_size_px and _differs(tags.thumbnail_size_px, now):
        width, height = tags.thumbnail_size_px
        return f"its preview has {width} x {height} px, of other proportions"
    return ""


def _differs(preview: tuple[int, int], now: tuple[int, int]) -> bool:
    """Whether the preview is of another picture. One of 4:3 often has black bars, so it proves nothing."""
    own, other = max(now) / min(now), max(preview) / min(preview)
    return abs(other / (4 / 3) - 1) > 0.02 and abs(own / other - 1) > 0.04 + 1 / min(preview)
