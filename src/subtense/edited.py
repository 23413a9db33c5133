"""Edited: pictures that no pinhole took, as far as their files tell: panoramas, straightened perspectives, frames of films.

Source: Adobe's camera-raw-settings namespace (crs), Google's GPano, Apple's CustomRendered (6 is a panorama).
"""

from __future__ import annotations

import re

from .metadata import Metadata, number
from .photo import Photo
from .quantity import Note

VIDEO_MODES = {
    (7680, 4320), (5312, 2988), (4096, 2160), (3840, 2160), (2720, 1530), (2704, 1520), (2560, 1440), (1920, 1080), (1280, 720),
    (854, 480), (848, 480), (720, 576), (720, 480), (640, 360),
}  # fmt: skip
_STRAIGHTENED = ("PerspectiveVertical", "PerspectiveHorizontal", "PerspectiveRotate", "PerspectiveAspect", "PerspectiveUpright",
                 "PerspectiveX", "PerspectiveY")  # fmt: skip
_STRAIGHTENERS = re.compile(
    r"viewpoint|skrwt|perspective|camscanner|adobe scan|office lens|microsoft lens|genius scan|scanbot", re.I
)
_FILM_TOOLS = re.compile(r"ffmpeg|lavf|lavc|\bvlc\b|quicktime|premiere|davinci|gopro studio|quik|video", re.I)
APPLE_PANORAMA = 6


def refusal(photo: Photo) -> Note | None:
    """The note `panorama` or `perspective_edited`: a pinhole would be wrong; None where nothing tells so."""
    tags = photo.metadata
    if is_panorama(tags):
        return Note("panorama", "the picture is a panorama, put together from several or from a turning camera; no pinhole took it",
                    "use a single still, or give an equirectangular camera with --camera")  # fmt: skip
    how = _straightened(tags)
    if how:
        return Note("perspective_edited", f"the perspective was edited ({how}); distances would be off by 6 % for 20° and more "
                    "above", "use the original picture")  # fmt: skip
    return None


def is_panorama(tags: Metadata) -> bool:
    """By its GPano tags, or by Apple's mark."""
    told = any(name in tags.xmp for name in ("GPano:ProjectionType", "GPano:FullPanoWidthPixels"))
    return told or (tags.custom_rendered == APPLE_PANORAMA and (tags.make or "").lower() == "apple")


def is_applied(tags: Metadata) -> bool | None:
    """Whether the edits that a crs block tells are in the pixels; None where it does not say."""
    said = tags.xmp.get("crs:AlreadyApplied", "").lower()
    if tags.form == "RAW":
        return False
    return {"true": True, "false": False}.get(said)


def is_film_frame(photo: Photo) -> bool:
    """Whether the picture is, or may well be, a frame of a film: its size is a film's, and it has no tags of a still, or a
    film's."""
    tags = photo.metadata
    size = tuple(sorted(photo.stored_size_px, reverse=True))
    if any(name.startswith("xmpDM:video") for name in tags.xmp):
        return True
    if size not in VIDEO_MODES:
        return False
    return bool(_FILM_TOOLS.search(tags.software or "")) or (tags.f_number is None and tags.exposure_s is None)


def _straightened(tags: Metadata) -> str:
    """What was done to the perspective; empty where nothing was."""
    if is_applied(tags) is not False:
        for name in _STRAIGHTENED:
            if (number(tags.xmp.get(f"crs:{name}")) or 0.0) != 0.0:
                return f"crs:{name} = {tags.xmp[f'crs:{name}']}"
        if (number(tags.xmp.get("crs:PerspectiveScale")) or 100.0) != 100.0:
            return f"crs:PerspectiveScale = {tags.xmp['crs:PerspectiveScale']}"
    found = _STRAIGHTENERS.search(tags.software or "")
    return f"by {tags.software}" if found else ""
