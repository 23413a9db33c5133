"""Metadata: what a picture's file says of its camera, each value on its own, each bounded.

Positions, altitudes above the sea and serial numbers are not among it: they are not even read here.

Source: Exif 2.32 (CIPA DC-008); TIFF 6.0; PNG (pHYs); JFIF 1.02 (density).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

from .decode import Beside
from .quantity import Note
from .tiff_tags import apple_acceleration

MOST_TEXT = 4096
"""Characters of a tag that are looked at."""
SHOWN_TEXT = 100
PIXEL_ASPECTS = (0.25, 4.0)
"""Beyond that a resolution tag is damaged and no shape of a pixel."""


@dataclass(frozen=True)
class Metadata:
    """What a file says of its camera; None where it says nothing usable. Lengths in mm as in the tags.

    Attributes:
        make: camera maker.
        model: camera model.
        lens: lens model.
        lens_make: lens maker.
        software: what wrote the file last, or the camera's firmware.
        focal_mm: focal length.
        f35_mm: focal length in 35 mm equivalents.
        f_number: aperture.
        exposure_s: exposure time.
        subject_distance_m: focus distance, as the camera tells it.
        lens_focal_mm: shortest and longest focal length of the lens.
        lens_f_number: its largest apertures at these.
        focal_plane_x_per_mm: pixels per mm on the sensor along the stored width.
        focal_plane_y_per_mm: the same along the stored height.
        tagged_width_px: stored width by the EXIF tags.
        tagged_height_px: stored height by the EXIF tags.
        digital_zoom: ratio; 1 for none.
        orientation: 1 to 8: from the frame that the other tags are in to the upright picture, whoever applied it.
        pixel_aspect: width of a pixel over its height, in the stored frame, by the file's resolutions.
        thumbnail_size_px: width and height of the preview within, as stored.
        custom_rendered: how the camera made the picture: 6 is a panorama, by Apple.
        form: "JPEG", "PNG", "TIFF", "WEBP", "AVIF", "BMP", "HEIC", "RAW": the pipeline the pixels came out of.
        intrinsic_matrix: 3 x 3 camera matrix row by row, px of the upright picture, origin its outer top-left corner; of a
            HEIC that carries one.
        gravity_g: Apple's acceleration vector in the phone's own axes, units of g.
        xmp: properties of the XMP packet that tell of the camera, by their usual prefixed name ("drone-dji:GimbalPitchDegree").
    """

    make: str | None = None
    model: str | None = None
    lens: str | None = None
    lens_make: str | None = None
    software: str | None = None
    focal_mm: float | None = None
    f35_mm: float | None = None
    f_number: float | None = None
    exposure_s: float | None = None
    subject_distance_m: float | None = None
    lens_focal_mm: tuple[float, float] | None = None
    lens_f_number: tuple[float, float] | None = None
    focal_plane_x_per_mm: float | None = None
    focal_plane_y_per_mm: float | None = None
    tagged_width_px: int | None = None
    tagged_height_px: int | None = None
    digital_zoom: float | None = None
    orientation: int = 1
    pixel_aspect: float | None = None
    thumbnail_size_px: tuple[int, int] | None = None
    custom_rendered: int | None = None
    form: str = ""
    intrinsic_matrix: tuple[float, ...] | None = None
    gravity_g: tuple[float, float, float] | None = None
    xmp: Mapping[str, str] = field(default_factory=dict, hash=False)

    def to_json(self) -> dict[str, Any]:
        """The values that are told."""
        told = {f.name: getattr(self, f.name) for f in fields(self) if getattr(self, f.name) is not None}
        return {**told, "xmp": dict(self.xmp)}

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Metadata:
        """The inverse of `to_json`: JSON has lists for tuples."""
        known: dict[str, Any] = {
            name: tuple(value) if isinstance(value, list) else value for name, value in data.items()
        }
        return cls(**known)


_BY_XMP = {
    0x010F: "tiff:Make", 0x0110: "tiff:Model", 0x0131: "tiff:Software", 0x920A: "exif:FocalLength", 0xA405: "exif:FocalLengthIn35mmFilm",
    0xA002: "exif:PixelXDimension", 0xA003: "exif:PixelYDimension", 0xA20E: "exif:FocalPlaneXResolution", 0x829D: "exif:FNumber",
    0xA20F: "exif:FocalPlaneYResolution", 0xA210: "exif:FocalPlaneResolutionUnit", 0xA404: "exif:DigitalZoomRatio",
    0x9206: "exif:SubjectDistance", 0x829A: "exif:ExposureTime", 0xA434: "exifEX:LensModel", 0xA433: "exifEX:LensMake",
}  # fmt: skip
"""EXIF tags that XMP repeats: what a PNG or a converted file has of them."""


def metadata_of(
    tags: Mapping[int, Any], beside: Beside, xmp: Mapping[str, str], *, form: str
) -> tuple[Metadata, tuple[Note, ...]]:
    """All that is told, each on its own: one damaged value does not hide the others.

    Args:
        tags: EXIF, by number.
        beside: what else the file tells.
        xmp: properties of its XMP packet; they stand in where EXIF is silent.
        form: the format, as in `Metadata`.
    """
    tags = {**{tag: xmp[name] for tag, name in _BY_XMP.items() if name in xmp}, **tags}
    orientation, notes = _orientation(tags.get(0x0112, 1), turns=form not in ("HEIC", "RAW"))
    per_mm = {2: 1 / 25.4, 3: 0.1, 4: 1.0, 5: 1000.0}.get(whole(tags.get(0xA210, 2)) or 0)
    focal, apertures = lens_specification(tags.get(0xA432))
    return Metadata(
        make=text_of(tags.get(0x010F)), model=text_of(tags.get(0x0110)), lens=text_of(tags.get(0xA434)) or text_of(xmp.get("aux:Lens")),
        lens_make=text_of(tags.get(0xA433)), software=text_of(tags.get(0x0131)) or text_of(xmp.get("xmp:CreatorTool")),
        focal_mm=positive(tags.get(0x920A)), f35_mm=positive(tags.get(0xA405)), f_number=positive(tags.get(0x829D)),
        exposure_s=positive(tags.get(0x829A)), subject_distance_m=_distance(tags.get(0x9206)), lens_focal_mm=focal, lens_f_number=apertures,
        focal_plane_x_per_mm=_scaled(tags.get(0xA20E), per_mm), focal_plane_y_per_mm=_scaled(tags.get(0xA20F), per_mm),
        tagged_width_px=whole(tags.get(0xA002)), tagged_height_px=whole(tags.get(0xA003)),
        digital_zoom=positive(tags.get(0xA404)), orientation=orientation, form=form,
        custom_rendered=whole(tags.get(0xA401)), pixel_aspect=_pixel_aspect(tags, beside), thumbnail_size_px=beside.preview_px,
        intrinsic_matrix=beside.intrinsic_matrix, gravity_g=apple_acceleration(tags.get(0x927C)), xmp=dict(xmp),
    ), notes  # fmt: skip


def _orientation(value: Any, turns: bool) -> tuple[int, tuple[Note, ...]]:
    """1 to 8; an invalid one is noted where the tag is what turns the picture."""
    if value in range(1, 9):
        return int(value), ()
    note = Note("orientation_invalid", f"the orientation tag is {str(value)[:20]!r}, not 1 to 8; the picture is "
                "taken as it is stored", "check that it is upright")  # fmt: skip
    return 1, (note,) if turns else ()


def _pixel_aspect(tags: Mapping[int, Any], beside: Beside) -> float | None:
    """By the EXIF resolutions, unless the picture's own format tells of pixels that are not square."""
    own = pixel_aspect(*beside.densities) if beside.densities else None
    told = pixel_aspect(tags.get(0x011A), tags.get(0x011B))
    return own if told is None or (own is not None and own != 1.0) else told


def text_of(value: Any) -> str | None:
    """A tag's text, printable and short."""
    if not isinstance(value, str):
        return None
    shown = " ".join("".join(c if c.isprintable() else " " for c in value[:MOST_TEXT]).split())[:SHOWN_TEXT]
    return shown or None


def number(value: Any) -> float | None:
    """A finite number, also one that is written as a fraction."""
    try:
        above, slash, below = value.partition("/") if isinstance(value, str) else (value, "", "")
        found = float(above) / float(below) if slash else float(above)
    except (TypeError, ValueError, ZeroDivisionError, OverflowError):
        return None
    return found if math.isfinite(found) else None


def positive(value: Any) -> float | None:
    """A finite number above 0."""
    found = number(value)
    return found if found and found > 0 else None


def whole(value: Any) -> int | None:
    """A whole number above 0, of pixels."""
    found = positive(value)
    return int(found) if found and 1 <= found < 2**31 else None


def lens_specification(value: Any) -> tuple[tuple[float, float] | None, tuple[float, float] | None]:
    """Shortest and longest focal length, mm, and the largest apertures at these."""
    try:
        numbers = [positive(one) for one in value][:4]
    except TypeError:
        return None, None
    pairs = [(numbers[i], numbers[i + 1]) if len(numbers) > i + 1 else (None, None) for i in (0, 2)]
    return tuple((a, b) if a and b and a <= b else None for a, b in pairs)  # type: ignore[return-value]


def pixel_aspect(x_per_length: Any, y_per_length: Any) -> float | None:
    """Width of a pixel over its height, from how many there are along a length."""
    x, y = positive(x_per_length), positive(y_per_length)
    return y / x if x and y and PIXEL_ASPECTS[0] <= y / x <= PIXEL_ASPECTS[1] else None


def _distance(value: Any) -> float | None:
    """Focus distance; 0xffffffff and 0 stand for infinity and for unknown."""
    found = positive(value)
    return found if found and found < 1e6 else None


def _scaled(value: Any, factor: float | None) -> float | None:
    found = positive(value)
    return found * factor if found and factor else None
