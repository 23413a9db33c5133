"""What a calibration says in numbers and in words: the same for every report of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from .arrays import Array
from .board import Board
from .calibration import Calibration, Picture
from .calibration_maps import uncertainty_map
from .camera import Camera
from .distribution import HALF_WIDTH_95
from .geometry import Pose, rotation_from_vector
from .quantity import Note
from .rig import Rig

COEFFICIENTS = {
    "brown_conrady": ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6", "s1", "s2", "s3", "s4", "tau x", "tau y"),
    "fisheye": ("k1", "k2", "k3", "k4"),
}
STEREO_BASELINES = (5, 20, 100)
"""Depths, in baselines, at which the verdict of a rig is given."""
TOLD_ELSEWHERE = ("views_left_out", "print_scale_assumed")
"""Notes whose content every report has in its table of pictures and in its sentence on lengths."""


@dataclass(frozen=True)
class Number:
    """One number of a calibration.

    Attributes:
        name: in words.
        value: in `unit`.
        u: one standard deviation; 0 where it was held.
        unit: px, rad, m or 1.
        remark: what else is to be said.
    """

    name: str
    value: float
    u: float
    unit: str
    remark: str = ""


@dataclass(frozen=True)
class Verdict:
    """What the calibration is good for.

    Attributes:
        grade: "good", "gaps" (some pictures are missing) or "doubtful" (model, board or noise are not what was assumed).
        title: the same in a few words.
        sentences: for what it is good, what is doubtful, what is weak.
    """

    grade: str
    title: str
    sentences: tuple[str, ...]


def printable(text: str) -> str:
    """Text of strangers on one line, with what would steer a terminal replaced."""
    return "".join(c if c.isprintable() else " " if c.isspace() else "?" for c in text)


def percent(share: float) -> str:
    """Two digits of a share: "0.12 %", "1.0 %", "23 %"."""
    if not np.isfinite(share):
        return "unknown"
    digits = max(0, 1 - int(np.floor(np.log10(100 * abs(share))))) if share else 0
    return f"{100 * share:.{digits}f} %"


def camera_titles(calibration: Calibration) -> tuple[str, ...]:
    """What the cameras are called: "" for a single one."""
    return ("",) if len(calibration.cameras) == 1 else ("left", "right")


def size_text(calibration: Calibration) -> str:
    """Size of the pictures: "1600 x 1200 px", of a rig both where they differ."""
    sizes = dict.fromkeys(f"{c.width_px} x {c.height_px} px" for c in calibration.cameras)
    return " and ".join(sizes)


def reason(picture: Picture) -> str:
    """Why a picture was left out, without its name, which stands beside it."""
    return printable(picture.left_out.partition(f"{picture.name}: ")[2] or picture.left_out)


def next_text(calibration: Calibration) -> str:
    """The next picture, to stand after a colon."""
    return calibration.next_picture.removeprefix("next, ")


# -- numbers ---------------------------------------------------------------------------------------------------------------


def camera_numbers(camera: Camera) -> tuple[Number, ...]:
    """Focal length first, then principal point, aspect, distortion, field of view."""
    cov = _cov(camera)
    u = np.sqrt(np.diag(cov).clip(0))
    off = camera.cx_px - (camera.width_px - 1) / 2, camera.cy_px - (camera.height_px - 1) / 2
    sides = [f"{abs(v):.1f} px {words[v > 0]} the picture's middle"
             for v, words in zip(off, (("left of", "right of"), ("above", "below")), strict=True)]  # fmt: skip
    numbers = [
        Number("focal length", float(camera.f_px), u[0], "px"),
        Number("principal point, x", float(camera.cx_px), u[2], "px", sides[0]),
        Number("principal point, y", float(camera.cy_px), u[3], "px", sides[1]),
        Number("pixel aspect", float(camera.aspect), u[1], "1", "" if u[1] else "held"),
    ]
    for name, value, doubt in zip(COEFFICIENTS.get(camera.lens, ()), camera.coefficients, u[4:], strict=False):
        if value or doubt:
            numbers.append(Number(f"distortion {name}", float(value), float(doubt), "1"))
    return (*numbers, *_fields_of_view(camera, cov))


def _cov(camera: Camera) -> Array:
    return np.zeros((4 + camera.coefficients.size,) * 2) if camera.cov is None else camera.cov


def _fields_of_view(camera: Camera, cov: Array) -> list[Number]:
    """Across and down, between the outer edges of the picture; left out where the lens model does not reach them."""
    values = np.array(camera.field_of_view_rad)
    slopes = _slopes(lambda t: np.array(moved_camera(camera, t).field_of_view_rad), _theta(camera), cov)
    names = ("field of view across", "field of view down")
    us = np.sqrt(np.einsum("ki,ij,kj->k", slopes, cov, slopes).clip(0))
    return [
        Number(n, float(v), float(u), "rad") for n, v, u in zip(names, values, us, strict=True) if np.isfinite(v + u)
    ]


def _theta(camera: Camera) -> Array:
    return np.concatenate([[camera.f_px, camera.aspect, camera.cx_px, camera.cy_px], camera.coefficients])


def moved_camera(camera: Camera, theta: Array) -> Camera:
    """The camera with other numbers (f_px, aspect, cx_px, cy_px, distortion...), taken as exact."""
    f, aspect, cx, cy, *k = theta
    return replace(camera, f_px=f, aspect=aspect, cx_px=cx, cy_px=cy, distortion=np.array(k), cov=None, id=None)


def _slopes(function: Callable[[Array], Array], theta: Array, cov: Array) -> Array:
    """(outputs, n) central differences over a tenth of each number's u; 0 for what is held."""
    steps = np.sqrt(np.diag(cov).clip(0)) / 10
    columns = []
    for i, step in enumerate(steps):
        moved = np.eye(theta.size)[i] * step
        columns.append(
            (function(theta + moved) - function(theta - moved)) / (2 * step) if step else 0 * function(theta)
        )
    return np.stack(columns, -1)


def rig_numbers(calibration: Calibration) -> tuple[Number, ...]:
    """Baseline, angle between the axes, and how far points lie from their epipolar lines; empty for one camera."""
    rig = calibration.rig
    if rig is None:
        return ()
    baseline = Number("baseline", rig.baseline_m, rig.u_baseline_m, "m")
    angle, u_angle = _axes_angle(rig.right_from_left, rig.cov[-6:-3, -6:-3])
    off, pairs = epipolar_rms_px(calibration)
    return (
        baseline,
        Number("angle between the axes", angle, u_angle, "rad"),
        Number("off epipolar lines, rms", off, 0.0, "px", f"{pairs} points that both cameras see"),
    )


def _axes_angle(pose: Pose, cov: Array) -> tuple[float, float]:
    """Angle between the two optical axes and its u; parallel axes have the u of the larger of their two tilts."""
    axis = pose.rotation[:, 2]
    normal = np.cross([0.0, 0.0, 1.0], axis)
    sine = float(np.linalg.norm(normal))
    angle = float(np.arctan2(sine, axis[2]))
    if sine < 1e-9:
        return angle, float(np.sqrt(np.linalg.eigvalsh(cov[:2, :2])[-1].clip(0)))
    normal = normal / sine
    return angle, float(np.sqrt(normal @ cov @ normal))


def epipolar_rms_px(calibration: Calibration) -> tuple[float, int]:
    """Root mean square distance of points of the right camera from the epipolar lines of the left one's, without distortion.

    Returns:
        px of the right camera, and of how many points; NaN for none.
    """
    rig, blocks = calibration.rig, calibration.solution.problem.blocks
    assert rig is not None
    found = []
    for frame in range(calibration.solution.problem.frames):
        own = [(b.ids[frame][b.weight[frame] > 0], b.seen_px[frame][b.weight[frame] > 0]) for b in blocks]
        _, a, b = np.intersect1d(own[0][0], own[1][0], return_indices=True)
        found.append(_line_distances(rig, own[0][1][a], own[1][1][b]))
    off = np.concatenate(found)
    off = off[np.isfinite(off)]
    return (float(np.sqrt(np.mean(off**2))) if off.size else np.nan), off.size


def _line_distances(rig: Rig, left_px: Array, right_px: Array) -> Array:
    t = rig.right_from_left.translation_m
    cross = np.array([[0, -t[2], t[1]], [t[2], 0, -t[0]], [-t[1], t[0], 0]])
    lines = rig.left.rays(left_px) @ (cross @ rig.right_from_left.rotation).T
    x, y = rig.right.slopes(right_px)
    off = (lines[:, 0] * x + lines[:, 1] * y + lines[:, 2]) / np.hypot(lines[:, 0], lines[:, 1])
    return np.asarray(off * float(rig.right.f_px))


# -- what it is good for -----------------------------------------------------------------------------------------------------


def verdict(calibration: Calibration) -> Verdict:
    """The first thing to say: may I use it, and for what."""
    failed = [c for c in calibration.checks if not c.passed]
    model = ", ".join(dict.fromkeys(c.name for c in failed if c.note is None))
    gaps = ", ".join(dict.fromkeys(c.name for c in failed if c.note is not None))
    weak = (f"Weak: {gaps}.",) if gaps else ()
    if model or not calibration.trusted:
        why = f" ({model})" if model else ""
        first = f"The pictures do not fit what was assumed{why}. What the checks showed is in the uncertainty, as far as they can tell."
        return Verdict("doubtful", "Use it with care", (first, *_good_for(calibration), *weak))
    if gaps:
        return Verdict("gaps", "It can be used, with gaps", (*_good_for(calibration), *weak))
    return Verdict("good", "It can be used", _good_for(calibration))


def _good_for(calibration: Calibration) -> tuple[str, ...]:
    """The 95 % limits of ranges that the camera, or the rig, alone leaves."""
    told = []
    for title, camera in zip(camera_titles(calibration), calibration.cameras, strict=True):
        typical, worst, place = relative_ranges(camera)
        who = f" with the {title} camera" if title else ""
        told.append(
            f"Ranges from a known size{who}: {_within(typical)} in most of the picture, {_within(worst)} {place} (95 %)."
        )
    rig = calibration.rig
    if rig is not None:
        each = [HALF_WIDTH_95 * stereo_relative_u(rig, n * rig.baseline_m) for n in STEREO_BASELINES]
        depths = ", ".join(f"{_within(u)} at {n}" for u, n in zip(each, STEREO_BASELINES, strict=True))
        told.append(f"Depths by stereo: {depths} baselines (95 %), besides the noise of the points themselves.")
    return tuple(told)


def _within(half_width: float) -> str:
    return f"±{percent(half_width)}" if half_width < 1 else "no better than ±100 %"


def relative_ranges(camera: Camera) -> tuple[float, float, str]:
    """Half-widths of the 95 % interval of a range from a known size: the median and the worst over the picture, and where that is."""
    found = uncertainty_map(camera)
    u = found.relative_u_range
    if not np.isfinite(u).any():
        return np.nan, np.nan, "everywhere"
    row, column = np.unravel_index(int(np.nanargmax(u)), u.shape)
    down = ("at the top", "", "at the bottom")[int(3 * row / u.shape[0])]
    across = ("left", "", "right")[int(3 * column / u.shape[1])]
    place = " ".join(w for w in (down, across if down else across and f"at the {across}") if w) or "in the middle"
    return HALF_WIDTH_95 * float(np.nanmedian(u)), HALF_WIDTH_95 * float(np.nanmax(u)), place


def stereo_relative_u(rig: Rig, depth_m: float) -> float:
    """Relative u of the depth of a point before the left camera, as far as the rig's numbers leave it."""
    n, m = 4 + rig.left.coefficients.size, 4 + rig.right.coefficients.size
    ahead = np.array([[0.0, 0.0, depth_m]])
    left_px, right_px = rig.left.project(ahead), rig.right.project(rig.right_from_left.apply(ahead))

    def depth(theta: Array) -> Array:
        left, right = moved_camera(rig.left, theta[:n]), moved_camera(rig.right, theta[n : n + m])
        turn = rotation_from_vector(theta[-6:-3]) @ rig.right_from_left.rotation
        a, b = left.rays(left_px)[0], turn.T @ right.rays(right_px)[0]
        along = np.linalg.lstsq(np.column_stack([a, -b]), -turn.T @ theta[-3:], rcond=None)[0]
        return np.array([along[0] * a[2]])

    theta = np.concatenate([_theta(rig.left), _theta(rig.right), np.zeros(3), rig.right_from_left.translation_m])
    slope = _slopes(depth, theta, rig.cov)[0] / depth_m
    return float(np.sqrt(max(slope @ rig.cov @ slope, 0.0)))


def lengths(board: Board) -> str:
    """What every length rests on, with its u: the pictures can't tell the scale of a print."""
    doubt = f"u {percent(board.relative_u)}" if board.relative_u else "taken as exact"
    if board.source.startswith("measured"):
        return f"lengths rest on the width of the print as it was measured ({doubt})"
    what = "square" if board.kind in ("chessboard", "charuco") else "spacing"
    said = f", {board.source}" if board.source not in ("", "stated") else ""
    return (f"lengths rest on the stated {what} of {board.square_m * 1000:.6g} mm ({doubt}{said}), which pictures can't show; "
            f"focal lengths don't depend on it. Measure the whole width of the pattern, {board.width_m * 1000:.6g} mm by what was "
            "stated, and give it with --printed")  # fmt: skip


def model_text(calibration: Calibration) -> str:
    """The lens models, and what the others foretold of pictures they had not seen."""
    names = " and ".join(dict.fromkeys(calibration.models))
    if not calibration.tried:
        return names
    others = ", ".join(f"{name} {rms:.3f} px" for name, rms in calibration.tried.items())
    return f"{names}; rms on pictures that a model had not seen: {others}"


def fit_text(calibration: Calibration) -> str:
    """How far the points are from where the solution puts them, and how that compares with the detector's own sigma."""
    factor = calibration.solution.factor
    return f"{calibration.solution.rms_px:.3f} px rms, {factor:.2f} times the noise that the detector tells"


def bow_text(calibration: Calibration) -> str:
    """How far the board bulges, where it was found to; "" where not."""
    bow = calibration.solution.state.warp_m * 1000
    return f"{abs(bow[0]):.2f} mm along its width, {abs(bow[1]):.2f} mm along its height" if np.any(bow) else ""


def other_notes(calibration: Calibration) -> tuple[Note, ...]:
    """Notes that the checks, the table of pictures and the sentence on lengths do not hold already."""
    codes = {c.note.code if c.note else "model_error" for c in calibration.checks if not c.passed} | set(TOLD_ELSEWHERE)
    return tuple(n for n in calibration.notes if n.code not in codes)
