"""Camera and lens from Lensfun's database (extra `lenses`): the sensor by the crop factor, and the lens's distortion.

Only whole names match, apart from case, spaces and punctuation: the database's own search gives a wrong camera with confidence.
f_px = focal length * crop factor * diagonal in px / 43.267 mm.

The database has the distortion as ptlens, poly3 or poly5, around the picture's middle, scaled so that one radius keeps its place. It is
asked for places (`Modifier`), and Brown-Conrady coefficients k1, k2, k3 are fitted to them by least squares, with a free scale; how
far the fit misses, the scale, and the lens's specimen are in u. Two calibrations of one lens in the database differ by 19 % of the
distortion in the corner in the median, 31 % in two of three pairs (120 pairs that distort by more than 1 %): one of them is
taken to 31 % / sqrt(2).

Most cameras correct distortion themselves before they write a JPEG, and editors may: then the coefficients would correct twice. So
they are applied to developed raw pictures, and to JPEGs as single-lens reflex cameras write them, which do not correct unless
told to. For every other picture k1 stays 0, with a u of the size of the database's correction.

Source: Lensfun's database and its reference of models, https://lensfun.github.io/manual/latest/corrections.html.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace
from functools import cache
from importlib.util import find_spec
from typing import Any

import numpy as np

from ..arrays import Array
from ..assumptions import NOMINAL_FOCAL
from ..camera import Camera
from ..equivalent import DIAGONAL_MM, compared
from ..hypothesis import Hypothesis
from ..lens_class import is_phone
from ..metadata import Metadata
from ..photo import Photo
from ..quantity import Note
from ..tagged_size import TaggedSize, tagged_size
from ..told_camera import told_camera

NAME = "lens_database"
CROP_U = 0.015
"""Relative u of a crop factor: it is of the class, as 1.5 or 1.6, or of one measured sensor."""
SPECIMEN_U = 0.22
"""Relative u of a lens's distortion, of another specimen of it."""
REFLEX_MOUNTS = ("Canon EF", "Canon EF-S", "Nikon F AF", "Pentax KAF", "Sony Alpha", "Minolta AF", "Sigma SA")
"""Their cameras write JPEGs with the lens's distortion, unless told otherwise."""
LONG_SIDE_PX = 1200
"""Of the picture for which the database is asked: its map is true to some tenths of a pixel, so a small one would be too rough."""
STEP_PX = 10
"""Of these pixels every tenth is fitted."""
ZOOM_SLACK = 1.02
"""A tagged focal length may lie so far outside of the lens's range."""
_EDITORS = re.compile(
    r"lightroom|photoshop|camera raw|darktable|rawtherapee|capture one|dxo|gimp|affinity|luminar|on1|snapseed|digikam|ptlens",
    re.I,
)


@dataclass(frozen=True)
class Distortion:
    """What the database says of a lens at one focal length, as Brown-Conrady.

    Attributes:
        k: k1, k2, k3 in the units of slopes.
        cov: their covariance: specimen and fit.
        scale: by how much the middle is larger than the radius that the database's model leaves in place.
        miss: largest distance of the fit from the database's places, as a share of the half diagonal.
        model: the database's.
    """

    k: Array
    cov: Array
    scale: float
    miss: float
    model: str


def camera(photo: Photo) -> Hypothesis:
    """The hypothesis, or its reason."""
    tags = photo.metadata
    if tags.focal_mm is None:
        return Hypothesis(NAME, None, "the metadata has no focal length")
    if not tags.make or not tags.model:
        return Hypothesis(NAME, None, "the metadata does not name the camera")
    if is_phone(tags):
        return Hypothesis(NAME, None, "Lensfun's database has next to no phones, and not their single lenses")
    if find_spec("lensfunpy") is None:
        return Hypothesis(NAME, None, "lensfunpy is not installed: pip install 'subtense[lenses]'")
    body = _body(tags.make, tags.model)
    if body is None:
        return Hypothesis(NAME, None, f"Lensfun's database has no {tags.model}")
    size = tagged_size(photo)
    f_px = tags.focal_mm * body.crop_factor * math.hypot(*size.whole_px) / DIAGONAL_MM * size.zoom
    relative = math.hypot(NOMINAL_FOCAL, CROP_U, (0.05 if tags.focal_mm < 20 else 0.5) / math.sqrt(3) / tags.focal_mm)
    against = compared(photo, size, f_px, math.hypot(relative, size.relative_u))
    if against is not None and not against.agrees:
        return Hypothesis(NAME, None, f"Lensfun's crop factor of {body.crop_factor:.3g} makes the equivalent "
                          f"{tags.focal_mm * body.crop_factor:.3g} mm, and the metadata says {tags.f35_mm:g} mm")  # fmt: skip
    return _hypothesis(photo, size, body, f_px, relative)


def _hypothesis(photo: Photo, size: TaggedSize, body: Any, f_px: float, relative: float) -> Hypothesis:
    tags = photo.metadata
    assert tags.focal_mm is not None
    text = f"Lensfun: crop factor {body.crop_factor:.3g}, focal length {tags.focal_mm:g} mm"
    lens = _lens(tags, body)
    distortion = lens and _distortion(
        lens, body.crop_factor, tags.focal_mm, _stored_proportions(size), f_px / max(size.whole_px)
    )
    if not lens or not distortion:
        why = f"lens {tags.lens or 'without a name'} is not in it" if not lens else f"no distortion of {lens.model}"
        return Hypothesis(
            NAME, told_camera(photo, f_px, relative, f"{text}; {why}", size), f"{text}; {why}", size.notes
        )
    if not is_uncorrected(tags, str(body.mount)):
        made = told_camera(photo, f_px, relative, text, size)
        return Hypothesis(
            NAME, _doubted(made, distortion), f"{text}; {lens.model}, perhaps corrected by the camera", size.notes
        )
    # where in the picture the nominal focal length holds, in the middle or at the radius that the database leaves, nobody says
    made = told_camera(photo, f_px, math.hypot(relative, distortion.scale - 1), text, size)
    note = Note("distortion_corrected", f"the distortion of {lens.model} is corrected by Lensfun's database ({distortion.model}, another "
                f"specimen: to {100 * SPECIMEN_U:.0f} %)", "calibrate the camera; give it with --camera if the picture was corrected "
                "before")  # fmt: skip
    return Hypothesis(NAME, _corrected(made, distortion, lens.model), f"{text}; {lens.model}", (*size.notes, note))


def _stored_proportions(size: TaggedSize) -> float:
    """Long side over short."""
    return max(size.whole_px) / min(size.whole_px)


def is_uncorrected(tags: Metadata, mount: str) -> bool:
    """Whether a picture still has its lens's distortion: developed raw, or the JPEG of a reflex camera that no editor wrote."""
    edited = bool(_EDITORS.search(tags.software or "")) or any(name.startswith("crs:") for name in tags.xmp)
    if tags.form == "RAW":
        return True
    return tags.form == "JPEG" and mount.startswith(REFLEX_MOUNTS) and not edited


def _doubted(made: Camera, distortion: Distortion) -> Camera:
    """k1 = 0 to the size of the database's correction at the corner."""
    corner2 = ((made.width_px**2 + made.height_px**2) / 4) / float(made.f_px) ** 2
    k1 = float(distortion.k @ (1.0, corner2, corner2**2))
    cov = np.array(made.cov)
    cov[4, 4] = max(cov[4, 4], k1**2)
    return replace(made, cov=cov, id=None)


def _corrected(made: Camera, distortion: Distortion, lens: str) -> Camera:
    """With the coefficients, whose radial part turns and mirrors into itself."""
    cov = np.array(made.cov)
    places = [4, 5, 8]  # k1 k2 p1 p2 k3
    cov[4:, :], cov[:, 4:] = 0.0, 0.0
    cov[np.ix_(places, places)] = distortion.cov
    k = np.array([distortion.k[0], distortion.k[1], 0.0, 0.0, distortion.k[2]])
    sources = {
        **made.part_sources,
        "lens distortion": f"Lensfun: {lens}, {distortion.model}, to {100 * SPECIMEN_U:.0f} %",
    }
    return replace(made, distortion=k, cov=cov, part_sources=sources, id=None)


# -- the database ------------------------------------------------------------------------------------


@cache
def _database() -> Any:
    import lensfunpy

    return lensfunpy.Database()


def _plain(name: str, maker: str = "") -> str:
    """Letters and digits only, without the maker in front, which some write and others do not."""
    plain = re.sub(r"[^a-z0-9]", "", name.lower())
    return plain.removeprefix(_first(maker)) or plain


def _first(maker: str) -> str:
    """The maker's first word: one writes Nikon, another NIKON CORPORATION."""
    return re.sub(r"[^a-z0-9]", "", (maker.lower().split() or [""])[0])


@cache
def _body(make: str, model: str) -> Any | None:
    """The one camera of that whole name."""
    found = [c for c in _database().cameras if _first(c.maker) == _first(make)
             and _plain(c.model, c.maker) == _plain(model, make) and not c.variant]  # fmt: skip
    return found[0] if len({c.crop_factor for c in found}) == 1 else None


def _lens(tags: Metadata, body: Any) -> Any | None:
    """The one lens of that whole name for this camera; of a camera with a fixed lens, the only one."""
    assert tags.focal_mm is not None
    mount = str(body.mount)
    lenses = [one for one in _database().lenses if mount in one.mounts]
    if mount[:1].isupper() or mount[:1].isdigit():
        named = _plain(tags.lens or "", tags.make or "")
        lenses = [
            one
            for one in _for_body(body)
            if named and _plain(one.model, one.maker) in (named, _plain(tags.lens or "", one.maker))
        ]
    lenses = [one for one in lenses if "RECTILINEAR" in str(one.type) and one.calib_distortion]
    if len({one.model for one in lenses}) != 1:
        return None
    # of one lens there may be calibrations on several sensors: one on a larger sensor holds, the nearest above
    larger = [one for one in lenses if one.crop_factor <= body.crop_factor * ZOOM_SLACK] or lenses
    lens = max(larger, key=lambda one: one.crop_factor)
    low, high = lens.min_focal, max(lens.max_focal, lens.min_focal)
    return lens if low / ZOOM_SLACK <= tags.focal_mm <= high * ZOOM_SLACK else None


def _for_body(body: Any) -> list[Any]:
    """Lenses whose mount is this camera's, or one that fits on it, as the database says."""
    return list(_database().find_lenses(body))


def _distortion(
    lens: Any, crop: float, focal_mm: float, proportions: float, f_in_long_sides: float
) -> Distortion | None:
    """The database's distortion as Brown-Conrady, fitted over the picture.

    Args:
        lens: of the database.
        crop: crop factor of the camera.
        focal_mm: focal length of the picture.
        proportions: long side of the picture over its short one.
        f_in_long_sides: focal length in long sides of the picture.
    """
    size = (LONG_SIDE_PX, round(LONG_SIDE_PX / proportions))
    places = distorted_places(lens, crop, focal_mm, size)
    if places is None:
        return None
    f_px = f_in_long_sides * size[0]
    middle = np.array([(size[0] - 1) / 2, (size[1] - 1) / 2])
    ideal = (np.stack(np.meshgrid(np.arange(size[0]), np.arange(size[1])), -1) - middle)[::STEP_PX, ::STEP_PX]
    radius = np.hypot(*np.moveaxis(ideal, -1, 0)).ravel() / f_px
    factor = np.hypot(*np.moveaxis(places[::STEP_PX, ::STEP_PX] - middle, -1, 0)).ravel() / f_px / radius
    terms = radius[:, None] ** np.array([0, 2, 4, 6])
    fit = np.linalg.lstsq(terms * radius[:, None], factor * radius, rcond=None)[0]  # misses count by their distance
    scale = float(fit[0])
    miss = float(np.max(abs(terms @ fit - factor) * radius) / radius.max())
    outwards = np.linspace(0.0, 1.05 * radius.max(), 64)
    if np.any(np.diff(outwards * (outwards[:, None] ** np.array([0, 2, 4, 6]) @ fit)) <= 0):
        return None  # it would turn back inside of the picture
    # the middle keeps the nominal focal length: slopes there are scale times the database's
    k = fit[1:] / scale / scale ** np.array([2.0, 4.0, 6.0])
    corner2 = (radius.max() * scale) ** 2
    cov = np.outer(k, k) * SPECIMEN_U**2
    cov[0, 0] += (miss / corner2) ** 2
    return Distortion(k, cov, scale, miss, str(lens.interpolate_distortion(focal_mm).model).rpartition(".")[2].lower())


def distorted_places(lens: Any, crop: float, focal_mm: float, size_px: tuple[int, int]) -> Array | None:
    """(height, width, 2) pixels of the picture as taken for every pixel of one without distortion; None where the lens has none.

    The database's own scale is kept: it would otherwise fill the picture.
    """
    import lensfunpy

    modifier = lensfunpy.Modifier(lens, crop, *size_px)
    modifier.initialize(focal_mm, 8.0, 1000.0, 1.0, flags=lensfunpy.ModifyFlags.DISTORTION)
    places = modifier.apply_geometry_distortion()
    return None if places is None else np.asarray(places, float)
