"""Camera from COLMAP's table of sensor widths, which pycolmap carries (extra `sfm`).

The table has no call of its own. It is reached by asking pycolmap for the camera of a tiny picture that carries the maker's and
model's name and a focal length of 10 mm: the focal length in px that comes back holds the width. Some of its widths are of the class
of a sensor, some of one lens of several, and it has errors: so an equivalent must agree with it, and a phone or a drone without
one is not looked up.

Source: COLMAP, src/colmap/sensor/specs.cc. Its widths lie up to 3 % from those of our own table, and 4 % from the equivalent.
"""

from __future__ import annotations

import math
from functools import cache
from importlib.util import find_spec

from ..assumptions import NOMINAL_FOCAL
from ..equivalent import SQUARISH, WIDE, compared
from ..hypothesis import Hypothesis
from ..lens_class import LENS_CLASSES, lens_class
from ..photo import Photo
from ..tagged_size import TaggedSize, tagged_size
from ..told_camera import told_camera

NAME = "colmap_sensors"
WIDTH_U = 0.03
CUT_U = 0.08
"""Relative u where a picture has other proportions than sensors have: it may span a part of it only."""
MOST_GAP = 0.05
"""How far the equivalent may lie from the table, besides its own u."""
SENSOR_WIDTHS_MM = (1.0, 70.0)
MOST_NAME = 64
PROBE_MM = 10
PROBE_PX = (256, 192)


def camera(photo: Photo) -> Hypothesis:
    """The hypothesis, or its reason."""
    tags = photo.metadata
    if tags.focal_mm is None:
        return Hypothesis(NAME, None, "the metadata has no focal length")
    if not tags.make or not tags.model:
        return Hypothesis(NAME, None, "the metadata does not name the camera")
    if find_spec("pycolmap") is None:
        return Hypothesis(NAME, None, "pycolmap is not installed: pip install 'subtense[sfm]'")
    if tags.f35_mm is None and lens_class(tags) is not LENS_CLASSES["unknown"]:
        return Hypothesis(
            NAME, None, f"{tags.model} may have several cameras, and no 35 mm equivalent tells which one it was"
        )
    width_mm = sensor_width_mm(tags.make, tags.model)
    if width_mm is None:
        return Hypothesis(NAME, None, f"COLMAP's table has no {tags.model}")
    size = tagged_size(photo)
    f_px = tags.focal_mm / width_mm * max(size.whole_px) * size.zoom
    u = math.hypot(NOMINAL_FOCAL, WIDTH_U, 0.05 / math.sqrt(3) / tags.focal_mm, CUT_U if _is_cut(size) else 0.0)
    against = compared(photo, size, f_px, size.relative_u)
    if against is not None and abs(math.log(against.factor)) > MOST_GAP + against.limit / 2:
        return Hypothesis(NAME, None, f"COLMAP's table has a sensor {width_mm:.2f} mm wide, which the 35 mm equivalent of "
                          f"{tags.f35_mm:g} mm contradicts by {100 * abs(against.factor - 1):.0f} %")  # fmt: skip
    text = f"COLMAP's table: sensor {width_mm:.2f} mm wide, focal length {tags.focal_mm:g} mm"
    return Hypothesis(NAME, told_camera(photo, f_px, u, text, size), text, size.notes)


def _is_cut(size: TaggedSize) -> bool:
    proportions = max(size.whole_px) / min(size.whole_px)
    return not SQUARISH <= proportions <= WIDE


@cache
def sensor_width_mm(make: str, model: str) -> float | None:
    """Width in COLMAP's table; None where it has no such camera."""
    make, model = (_plain(name) for name in (make, model))
    if not make or not model:
        return None
    f_px = _focal_px(make, model)
    width = PROBE_MM * PROBE_PX[0] / f_px if f_px else None
    return width if width and SENSOR_WIDTHS_MM[0] <= width <= SENSOR_WIDTHS_MM[1] else None


def _plain(name: str) -> str:
    """Names are a stranger's: only what a name of the table may have, and not much of it."""
    return "".join(c for c in name if c.isascii() and c.isprintable())[:MOST_NAME].strip()


def _focal_px(make: str, model: str) -> float | None:
    """What pycolmap makes of a picture of this camera; its own messages are not for whoever asked us."""
    import tempfile
    from pathlib import Path

    import pycolmap
    from PIL import Image
    from PIL.TiffImagePlugin import IFDRational

    exif = Image.Exif()
    exif[0x010F], exif[0x0110] = make, model
    exif.get_ifd(0x8769)[0x920A] = IFDRational(PROBE_MM, 1)  # a float would be written as DOUBLE, which no reader takes
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "probe.jpg"
        Image.new("L", PROBE_PX).save(path, exif=exif)
        level = pycolmap.logging.minloglevel
        try:
            pycolmap.logging.minloglevel = int(pycolmap.logging.Level.FATAL)
            found = pycolmap.infer_camera_from_image(str(path))
        except (RuntimeError, ValueError):
            return None
        finally:
            pycolmap.logging.minloglevel = level
    return float(found.focal_length) if found.has_prior_focal_length else None
