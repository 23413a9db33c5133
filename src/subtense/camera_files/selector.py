"""What stands behind the # of a calibration file's name: what the file itself does not say.

calib.yml#640x480       the picture's size, where the file lacks it
stereo.yml#M2           which of several cameras
lens.yml#fisheye        four coefficients are those of cv2.fisheye
rig.yml#M2,640x480      several of these
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

MARK = "#"
_SIZE = re.compile(r"(\d{1,6}) ?[x×] ?(\d{1,6})(?: ?px)?", re.IGNORECASE | re.ASCII)


@dataclass(frozen=True)
class Pick:
    """What was said of a file beside its content.

    Attributes:
        size_px: width and height of the calibration's pictures.
        fisheye: that the coefficients are those of cv2.fisheye.
        name: which of the file's cameras.
    """

    size_px: tuple[int, int] | None = None
    fisheye: bool = False
    name: str | None = None


NOTHING = Pick()
"""Nothing was said."""


def split(text: str, *, there: bool = True) -> tuple[Path, Pick]:
    """A file's name and what stands behind its last #.

    Args:
        text: as typed.
        there: whether a file of the whole name counts; it then has no selector.
    """
    name, mark, behind = text.rpartition(MARK)
    if not mark or not name or (there and Path(text).is_file()):
        return Path(text), NOTHING
    return Path(name), parse(behind)


def parse(text: str) -> Pick:
    """What stands behind the #, in any order, with commas between."""
    size, fisheye, names = None, False, []
    for word in text.split(","):
        if found := _SIZE.fullmatch(word.strip()):
            size = int(found[1]), int(found[2])
        elif word.strip().lower() == "fisheye":
            fisheye = True
        elif word.strip():
            names.append(word)  # a name may hold a comma itself
    return Pick(size, fisheye, ",".join(names).strip() or None)
