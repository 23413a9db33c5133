"""Camera from lines along directions at right angles: marked by a person (`lines=@file.json`), or found in the picture (`lines`).

The file is an object of up to three lists of lines x1,y1,x2,y2 in pixels: `verticals` (upright ones), `parallels` (level ones of one
direction), `others` (level ones at right angles to these), and perhaps `sigma_px`, the standard deviation of an end. In the picture
straight segments are found, and a focal length and a rotation sought with which most of them run along three such directions.

Source: see `line_camera`; segments: R. Grompone von Gioi et al., LSD, a line segment detector, IPOL 2012; the search: M. Fischler,
R. Bolles, Random sample consensus, 1981.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import Array
from ..assumptions import CLICK_SIGMA_PX
from ..errors import FileFormatError, InputError
from ..hypothesis import Hypothesis
from ..lens_class import k1_u
from ..line_camera import LineCamera, camera_from_lines
from ..observation import Observation
from ..photo import Photo
from ..quantity import Note
from ..told_pose import ToldPose

NAME = "vanishing_points"
SETS = ("verticals", "parallels", "others")
WRITE = "write lines=@file.json with lines x1,y1,x2,y2 under verticals, parallels, others, or lines to have them found"
MOST_BYTES = 2**20
MOST_LINES = 500
WORK_PX = 1600
"""Longer side of the picture in which segments are found; their ends are no better known in a larger one."""
SHORTEST_SEGMENT = 0.03
"""Of the diagonal."""
SEGMENT_SIGMA_PX = 0.5
"""Of a segment's end across it, in the picture of WORK_PX; where they scatter more, that is taken."""
TRIES = 4000
RUNS_ALONG_RAD = math.radians(1.5)
"""How far a segment may be turned from the vanishing point that it is counted to."""
FEWEST, FEWEST_OF_ONE = 20, 5
LEAST_SHARE = 0.5
"""Of the length of all segments that must run along the three directions: else it is no scene of right angles."""
NEARLY_AS_GOOD = 0.8
"""Of the best score: focal lengths that explain the segments so well are in u. In pictures of known focal length those of 0.9 were
often off by more; clutter has lines for any focal length."""
WORST_FOUND_U = 0.25
"""Relative u beyond which found lines are said not to tell the focal length."""


FOUND_LEVEL_RAD = math.radians(0.5)
"""The same of pitch and roll."""


def camera(text: str, photo: Photo, *, paths: bool = True) -> Hypothesis:
    """The camera of a photo by the lines that this text tells.

    Raises:
        InputError: another text, a line outside the picture, or too few of them.
        FileFormatError: the file can't be read.
    """
    head, _, tail = text.strip().partition("=")
    if head.strip() != "lines" or (tail and not tail.strip().startswith("@")):
        raise InputError("--camera", text, WRITE)
    if not tail:
        return _found(photo)
    if not paths:
        raise InputError("--camera", text, "a file can't be named here; write lines to have them found")
    return _marked(read_lines(Path(tail.strip()[1:]), photo), photo)


def read_lines(path: Path, photo: Photo) -> dict[str, Observation]:
    """The lines of a file, by set.

    Raises:
        FileFormatError: no such file, too large, not JSON, or of another form.
        InputError: a line outside the picture.
    """
    if not path.is_file():
        raise FileFormatError(path, "no such file")
    if path.stat().st_size > MOST_BYTES:
        raise FileFormatError(path, "is larger than 1 MiB")
    try:
        data = json.loads(path.read_text("utf-8"))
    except (ValueError, RecursionError):
        raise FileFormatError(path, "is not JSON") from None
    return lines_of(data, path, photo)


def lines_of(data: Any, path: Path, photo: Photo) -> dict[str, Observation]:
    """The lines of a file's content; see `read_lines`."""
    if not isinstance(data, Mapping) or set(data) - {*SETS, "sigma_px"}:
        raise FileFormatError(path, f"must be an object of {', '.join(SETS)}, and perhaps sigma_px")
    try:
        sigma = float(data.get("sigma_px", CLICK_SIGMA_PX))
        sets = {name: np.array(data[name], float).reshape(-1, 4) for name in SETS if data.get(name)}
    except (TypeError, ValueError, OverflowError):
        raise FileFormatError(path, "each line must be four numbers: x1, y1, x2, y2") from None
    if not 0 < sigma < math.inf or not all(np.all(np.isfinite(one)) for one in sets.values()):
        raise FileFormatError(path, "numbers must be finite, and sigma_px above 0")
    limit = np.array([photo.width_px, photo.height_px]) - 0.5
    for name, lines in sets.items():
        points = lines.reshape(-1, 2)
        if len(lines) < 2 or len(lines) > MOST_LINES:
            raise InputError(name, f"{len(lines)} lines", f"give 2 to {MOST_LINES}")
        if np.any(points < -0.5) or np.any(points > limit):
            raise InputError(
                name, "a line outside the picture", f"the picture has {photo.width_px} x {photo.height_px} px"
            )
        if np.any(np.all(lines[:, :2] == lines[:, 2:], axis=1)):
            raise InputError(name, "a line whose ends are one point", "give two different ends")
    return {name: Observation(lines.reshape(-1, 2), sigma, label=name) for name, lines in sets.items()}


def _marked(sets: Mapping[str, Observation], photo: Photo) -> Hypothesis:
    told = camera_from_lines(
        photo.width_px, photo.height_px, sets.get("verticals"), sets.get("parallels"), sets.get("others"),
        k1_u=_k1_u(photo), source="vanishing points of the lines that were marked",
    )  # fmt: skip
    if isinstance(told, str):
        return Hypothesis(NAME, None, told)
    notes: tuple[Note, ...] = ()
    if told.scatter > 2.0:
        worst = int(np.argmax(abs(told.misses_px))) + 1
        notes = (Note("lines_misfit", f"the lines do not run along directions at right angles as closely as stated: they are off by "
                      f"{told.scatter:.2g} times that, line {worst} most; u is widened by as much",
                      "look at that line again, and mark edges that are at right angles only"),)  # fmt: skip
    count = sum(one.points_px.shape[-2] // 2 for one in sets.values())
    return _hypothesis(told, f"vanishing points of {count} marked lines", notes)


def _hypothesis(told: LineCamera, reason: str, notes: tuple[Note, ...]) -> Hypothesis:
    u = math.sqrt(max(told.level_cov[0, 0], told.level_cov[1, 1]))
    pose = ToldPose(told.pitch_rad, told.roll_rad, u, reason)
    return Hypothesis(NAME, told.camera, reason, notes, pose=pose)


# -- lines that are found ------------------------------------------------------------------------------------------------------


def segments(photo: Photo) -> tuple[Array, float]:
    """(N, 2, 2) ends of straight segments, longest first, px of the picture; and how many of its pixels one of the search is."""
    import cv2

    scale = max(1.0, max(photo.width_px, photo.height_px) / WORK_PX)
    size = (round(photo.width_px / scale), round(photo.height_px / scale))
    gray = cv2.resize(cv2.cvtColor(photo.pixels, cv2.COLOR_RGB2GRAY), size, interpolation=cv2.INTER_AREA)
    found = cv2.createLineSegmentDetector(cv2.LSD_REFINE_STD).detect(gray)[0]
    if found is None:
        return np.zeros((0, 2, 2)), scale
    ends = np.asarray(found, float).reshape(-1, 2, 2)
    ends = (ends + 0.5) * [photo.width_px / size[0], photo.height_px / size[1]] - 0.5
    length = np.hypot(*(ends[:, 1] - ends[:, 0]).T)
    order = np.argsort(-length)[:MOST_LINES]
    return ends[order[length[order] > SHORTEST_SEGMENT * math.hypot(photo.width_px, photo.height_px)]], scale


FEW = "too few straight lines along three directions at right angles were found; mark them, lines=@file.json"


def _found(photo: Photo) -> Hypothesis:
    ends, scale = segments(photo)
    drawn = _manhattan(ends, photo) if len(ends) >= FEWEST else None
    if drawn is None:
        return Hypothesis(NAME, None, FEW)
    axis, low, high = drawn
    told = _by_axis(ends, axis, SEGMENT_SIGMA_PX * scale, photo)
    for _ in range(2):
        if isinstance(told, str):
            return Hypothesis(NAME, None, told)
        axis = _sorted(ends, told.rotation[None], np.array([float(told.camera.f_px)]), photo)[0]
        told = _by_axis(ends, axis, SEGMENT_SIGMA_PX * scale, photo)
    if isinstance(told, str):
        return Hypothesis(NAME, None, told)
    length = np.hypot(*(ends[:, 1] - ends[:, 0]).T)
    count, share = int(np.sum(axis >= 0)), float(length[axis >= 0].sum() / length.sum())
    if share < LEAST_SHARE or count < FEWEST:
        return Hypothesis(NAME, None, FEW)
    f = float(told.camera.f_px)
    u = max(abs(math.log(high / f)), abs(math.log(low / f)))
    if u > WORST_FOUND_U:
        return Hypothesis(NAME, None, f"focal lengths from {low:.0f} to {high:.0f} px fit the lines that were found nearly as well; mark "
                          "the right ones, lines=@file.json")  # fmt: skip
    cov = np.array(told.camera.cov)
    cov[0, 0] += (u * f) ** 2
    widened = replace(
        told, camera=replace(told.camera, cov=cov, id=None), level_cov=told.level_cov + FOUND_LEVEL_RAD**2 * np.eye(2)
    )
    note = Note("lines_found", f"the camera is told by {count} lines found in the picture ({100 * share:.0f} % of all by length), "
                "taken to be upright, or level and at right angles", "mark the lines yourself, or calibrate the camera")  # fmt: skip
    return _hypothesis(widened, f"vanishing points of {count} lines found in the picture", (note,))


def _by_axis(ends: Array, axis: Array, sigma_px: float, photo: Photo) -> LineCamera | str:
    """The camera of segments by the axis they run along; an axis of few is left out."""
    sets = [Observation(ends[axis == one].reshape(-1, 2), sigma_px) for one in range(3)]
    kept = [one if one.points_px.shape[-2] >= 2 * FEWEST_OF_ONE else None for one in sets]
    return camera_from_lines(photo.width_px, photo.height_px, kept[2], kept[0], kept[1], k1_u=_k1_u(photo),
                             source="vanishing points of lines in the picture")  # fmt: skip


def _k1_u(photo: Photo) -> float:
    """Of the lens's class, its corner taken as that of a focal length as long as the picture."""
    return k1_u(photo.metadata, math.hypot(photo.width_px, photo.height_px) / 2 / max(photo.width_px, photo.height_px))


def _manhattan(ends: Array, photo: Photo) -> tuple[Array, float, float] | None:
    """(N,) axis of each segment (2 is the upright one), -1 for none, by the best of many draws of two pairs of lines.

    And the shortest and the longest focal length (px) of draws that are nearly as good.
    """
    rng = np.random.default_rng(0)
    longer = max(photo.width_px, photo.height_px)
    middle = (np.array([photo.width_px, photo.height_px]) - 1) / 2
    points = np.concatenate([(ends - middle) / longer, np.ones((*ends.shape[:2], 1))], -1)
    lines = np.cross(points[:, 0], points[:, 1])
    length = np.hypot(*(ends[:, 1] - ends[:, 0]).T)
    four = rng.choice(len(ends), (TRIES, 4), p=length / length.sum())
    one, other = np.cross(lines[four[:, 0]], lines[four[:, 1]]), np.cross(lines[four[:, 2]], lines[four[:, 3]])
    with np.errstate(divide="ignore", invalid="ignore"):
        f2 = -(one[:, 0] * other[:, 0] + one[:, 1] * other[:, 1]) / (one[:, 2] * other[:, 2])
        fine = (f2 > 0.3**2) & (f2 < 5.0**2)
        f = np.sqrt(np.where(fine, f2, 1.0))
        first, second = (np.column_stack([v[:, :2], v[:, 2] * f]) for v in (one, other))
        first, second = (v / np.linalg.norm(v, axis=1, keepdims=True) for v in (first, second))
    rotation = np.stack([first, second, np.cross(first, second)], -1)
    fine &= np.isfinite(rotation).all(axis=(1, 2))
    if not fine.any():
        return None
    rotation, f = rotation[fine], f[fine] * longer
    score = np.concatenate([
        (length * np.clip(1 - (_sines(ends, rotation[i : i + 200], f[i : i + 200], photo).min(axis=-1) / math.sin(RUNS_ALONG_RAD)) ** 2,
                          0.0, None)).sum(axis=1)
        for i in range(0, len(f), 200)
    ])  # fmt: skip
    best = int(np.argmax(score))
    turn = rotation[best]
    upright = int(np.argmax(abs(turn[1])))
    level = [axis for axis in range(3) if axis != upright]
    good = f[score >= NEARLY_AS_GOOD * score[best]]
    axis = _sorted(ends, turn[None][..., [*level, upright]], f[best : best + 1], photo)[0]
    return axis, float(good.min()), float(good.max())


def _sorted(ends: Array, rotation: Array, f_px: Array, photo: Photo) -> Array:
    """(T, N) axis to whose vanishing point each segment runs, -1 for none; see `_sines`."""
    sine = _sines(ends, rotation, f_px, photo)
    return np.where(np.min(sine, axis=-1) < math.sin(RUNS_ALONG_RAD), np.argmin(sine, axis=-1), -1)


def _sines(ends: Array, rotation: Array, f_px: Array, photo: Photo) -> Array:
    """(T, N, 3) sine of the angle between each segment and the line from its middle to each vanishing point.

    Args:
        ends: (N, 2, 2).
        rotation: (T, 3, 3) columns are the directions.
        f_px: (T,).
        photo: the picture.
    """
    middle = (np.array([photo.width_px, photo.height_px]) - 1) / 2
    along = ends[:, 1] - ends[:, 0]
    along = along / np.hypot(*along.T)[:, None]
    v = np.concatenate([rotation[:, :2] * f_px[:, None, None] + middle[:, None] * rotation[:, 2:], rotation[:, 2:]], 1)
    away = v[:, None, :2, :] - v[:, None, 2:, :] * ends.mean(axis=1)[None, :, :, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        cross = along[None, :, :1] * away[:, :, 1] - along[None, :, 1:] * away[:, :, 0]
        return np.asarray(abs(cross) / np.hypot(away[:, :, 0], away[:, :, 1]))
