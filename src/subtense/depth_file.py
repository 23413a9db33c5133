"""Depth maps made elsewhere: 16-bit PNG with a stated unit, PFM and NPY, aligned with a picture.

A number of 0, below it, or not finite means that there is none, as depth cameras and data sets write them.

Source: PFM: P. Debevec's floating-point portable map, rows from the bottom up; NPY: NumPy's format, without objects.
"""

from __future__ import annotations

import io
import math
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .arrays import Array
from .errors import FileFormatError, InputError
from .quantity import UNITS, Quantity

MOST_BYTES = 512 * 2**20
MOST_NUMBERS = 100_000_000
ENDINGS = (".png", ".pfm", ".npy")
SAME_SHAPE = 0.01
"""By which the proportions of a map may differ from the picture's, as its sides are whole numbers."""


def read_numbers(path: Path) -> Array:
    """(h, w) float; NaN where there is no number.

    Raises:
        FileFormatError: no such file, another format, damaged, or nothing in it.
    """
    if path.suffix.lower() not in ENDINGS:
        raise FileFormatError(path, "a depth map is a 16-bit PNG, a PFM or a NPY file, and is told by its ending")
    try:
        if path.stat().st_size > MOST_BYTES:
            raise FileFormatError(path, f"is larger than {MOST_BYTES // 2**20} MiB")
        data = path.read_bytes()
    except OSError as error:
        raise FileFormatError(path, f"cannot be read: {error.strerror}") from None
    found = {".png": _png, ".pfm": _pfm, ".npy": _npy}[path.suffix.lower()](path, data)
    with np.errstate(invalid="ignore"):
        numbers = np.where(np.isfinite(found) & (found > 0), found, np.nan)
    answered = numbers[np.isfinite(numbers)]
    if answered.size == 0:
        raise FileFormatError(path, "has no number above 0")
    if answered.size > 1 and answered.min() == answered.max():
        raise FileFormatError(path, f"has the number {answered[0]:g} everywhere, which is no depth map")
    return np.asarray(numbers)


def _png(path: Path, data: bytes) -> Array:
    from PIL import Image

    try:
        with Image.open(io.BytesIO(data), formats=("PNG",)) as image:
            _check_size(path, image.width, image.height)
            if image.mode not in ("I;16", "I;16B", "I"):
                raise FileFormatError(path, f"is a PNG of mode {image.mode}; a depth map has one channel of 16 bits")
            return np.asarray(image, float)
    except FileFormatError:
        raise
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError):
        raise FileFormatError(path, "is no PNG, or a damaged one") from None


_PFM = re.compile(rb"(P[fF])\s+(\d{1,9})\s+(\d{1,9})\s+([-+]?[0-9.]+(?:[eE][-+]?\d+)?)[ \t]*\r?\n")


def _pfm(path: Path, data: bytes) -> Array:
    head = _PFM.match(data[:200])
    if head is None:
        raise FileFormatError(path, "is no PFM: its head is not 'Pf', width, height, scale")
    if head.group(1) == b"PF":
        raise FileFormatError(path, "is a PFM of three channels; a depth map has one")
    width, height = int(head.group(2)), int(head.group(3))
    _check_size(path, width, height)
    try:
        scale = float(head.group(4))
    except ValueError:
        scale = math.nan
    if not (math.isfinite(scale) and scale):
        raise FileFormatError(path, "is no PFM: its scale is no number but 0")
    body = data[head.end() :]
    if len(body) < 4 * width * height:
        raise FileFormatError(
            path, f"is cut: {width} x {height} numbers need {4 * width * height} bytes, it has {len(body)}"
        )
    numbers = np.frombuffer(body, "<f4" if scale < 0 else ">f4", width * height).reshape(height, width)
    return np.asarray(numbers[::-1], float)


def _npy(path: Path, data: bytes) -> Array:
    try:
        array = np.load(io.BytesIO(data), allow_pickle=False)
    except (ValueError, OSError, EOFError, SyntaxError, TypeError, OverflowError, MemoryError):
        raise FileFormatError(path, "is no NPY file of numbers, or a damaged one") from None
    if not isinstance(array, np.ndarray) or array.dtype.kind not in "fui":
        raise FileFormatError(path, "is no NPY file of numbers")
    array = array.squeeze()
    if array.ndim != 2 or array.size == 0:
        raise FileFormatError(
            path, f"has the shape {' x '.join(map(str, array.shape)) or '()'}; a depth map has rows of numbers"
        )
    _check_size(path, array.shape[1], array.shape[0])
    return np.asarray(array, float)


def _check_size(path: Path, width: int, height: int) -> None:
    if not 0 < width * height <= MOST_NUMBERS:
        raise FileFormatError(path, f"has {width} x {height} numbers; 1 to {MOST_NUMBERS // 10**6} million are read")


def fitted(path: Path, numbers: Array, width_px: int, height_px: int) -> tuple[Array, float]:
    """Numbers for the pixels of a picture, each that of the nearest one in the map, and pixels per number.

    Neighbours are not mixed: between near and far there is nothing in the middle.

    Raises:
        FileFormatError: the map has other proportions.
    """
    height, width = numbers.shape
    if (width, height) == (width_px, height_px):
        return numbers, 1.0
    slack = SAME_SHAPE + 0.5 / min(width, height)
    if abs(math.log((width / height) / (width_px / height_px))) > slack:
        turned = abs(math.log((height / width) / (width_px / height_px))) <= slack
        cure = "turn it as the picture is turned" if turned else "give the picture it belongs to"
        raise FileFormatError(
            path, f"has {width} x {height} numbers and the picture {width_px} x {height_px} px; {cure}"
        )
    rows = np.minimum(((np.arange(height_px) + 0.5) * height / height_px).astype(int), height - 1)
    columns = np.minimum(((np.arange(width_px) + 0.5) * width / width_px).astype(int), width - 1)
    return np.asarray(numbers[np.ix_(rows, columns)]), max(width_px / width, 1.0)


@dataclass(frozen=True)
class DepthError:
    """How well single depths are known.

    Attributes:
        relative: share of the depth, 1s.
        u_m: beside that, m, 1s.
        text: as it was said.
    """

    relative: float
    u_m: float
    text: str


def parse_unit(text: str, name: str = "--depth-unit") -> float:
    """Metres in one number of the map: `1 mm`, `mm`, `1/256 m`, `0.2 mm`.

    Raises:
        InputError: no length.
    """
    found = re.fullmatch(r"\s*(?:(\d+\.?\d*|\.\d+)\s*(?:/\s*(\d+\.?\d*|\.\d+))?)?\s*([A-Za-zµμ]+)\s*", text)
    kept, factor = UNITS.get(found.group(3), ("", 0.0)) if found else ("", 0.0)
    above, below = (float(found.group(i) or 1) for i in (1, 2)) if found else (0.0, 1.0)
    if kept != "m" or not above > 0 or not below > 0:
        raise InputError(name, text, "give the length of one number, as '1 mm', '1/256 m' or '0.2 mm'")
    return factor * above / below


def parse_error(text: str, name: str = "--depth-error") -> DepthError:
    """`1 %`, `5 mm`, `5 mm + 1 %`; half-widths of 95 %, unless (1s) or (limits) stands behind.

    Raises:
        InputError: something else, or nothing above 0.
    """
    meaning = re.search(r"\((?:1s|1 ?sigma|limits|95 ?%)\)\s*$", text)
    body, tail = (text[: meaning.start()], meaning.group(0)) if meaning else (text, "")
    relative = u_m = 0.0
    for word in body.replace("±", " ").split("+"):
        if not word.strip():
            raise InputError(name, text, "give a share, a length or both, as '1 %' or '5 mm + 1 %'")
        share = word.strip().endswith("%")
        unit = "1" if share else "m"
        try:
            u = float(Quantity.parse(f"1 ± {word.strip()} {tail}", unit, name=name).u)
        except InputError:
            raise InputError(name, text, "give a share, a length or both, as '1 %' or '5 mm + 1 %'") from None
        relative, u_m = (math.hypot(relative, u), u_m) if share else (relative, math.hypot(u_m, u))
    if not relative + u_m > 0 or relative > 1:
        raise InputError(name, text, "give an error above 0, and a share of at most 100 %")
    return DepthError(relative, u_m, text.strip())
