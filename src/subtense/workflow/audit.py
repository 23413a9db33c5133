"""Auditing a calibration that someone else made, with pictures of a board that it has not seen."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..adjustment import Adjusted, LensModel, Problem, Sight, adjust
from ..adjustment_start import start_state
from ..arrays import Array
from ..board import Board
from ..calibration import Audit, Calibration
from ..calibration_checks import Check, ranges_m
from ..calibration_maps import uncertainty_at, uncertainty_map
from ..camera import Camera
from ..errors import InputError
from ..geometry import rotation_from_vector
from ..quantity import Note, Quantity
from .calibrate import Progress, Seen, calibrate_views, check_found, printed_scale, see

TOO_FAR = 3.0
"""So many combined u between the stated camera and that of the pictures can't be trusted."""


def audit(camera: Camera, paths: Sequence[Path], board: Board, *, printed: Quantity | None = None, progress: Progress | None = None,
          threads: int | None = None) -> Audit:  # fmt: skip
    """Ask pictures of a board whether a stated camera is right.

    Args:
        camera: as stated, with its covariance.
        paths: pictures by it, in the mode it is stated for.
        board, printed, progress, threads: as in `calibrate`.

    Raises:
        InputError: pictures of other proportions than the camera's.
        NothingFoundError: the board is in too few pictures.
        GeometryError: the pictures leave the camera open.
    """
    board, _ = printed_scale(board, printed)
    seen = see(paths, board, progress, threads)
    check_found(seen, board)
    return audit_views(camera, seen, board)


def audit_views(camera: Camera, seen: Seen, board: Board) -> Audit:
    """The same from points that were found before."""
    own = calibrate_views(seen, board)
    camera, notes = _at_size_of(camera, own.camera)
    if camera.cov is None:
        notes = (*notes, Note("calibration_without_uncertainty", "the stated camera has no covariance: it is judged as if exact",
                              "calibrate with a tool that tells it"))  # fmt: skip
    held = _explained_by(camera, own)
    ratio = ranges_m(held) / ranges_m(own.solution)
    u_ratio = math.hypot(*(_central_u(c) for c in (camera, own.camera)))
    grid = _covered(own)
    moves = difference_px(camera, own.camera, grid)
    expected = np.hypot(uncertainty_at(camera, grid), uncertainty_at(own.camera, grid))
    with np.errstate(divide="ignore", invalid="ignore"):
        in_u = float(np.sqrt(np.nanmean(np.sum(moves**2, -1) / 2 / expected**2)))
    off = float(np.sqrt(np.nanmean(np.sum(moves**2, -1) / 2)))
    error = float(np.mean(ratio)) - 1
    checks = (
        _range_verdict(error, u_ratio),
        _projection_verdict(off, in_u, held.rms_px, own),
        _axis_verdict(camera, own.camera),
    )
    return Audit(camera, own, held.rms_px, error, u_ratio, off, in_u, checks, notes)


def _at_size_of(camera: Camera, own: Camera) -> tuple[Camera, tuple[Note, ...]]:
    size, wanted = (camera.width_px, camera.height_px), (own.width_px, own.height_px)
    if size == wanted:
        return camera, ()
    if abs(size[0] / size[1] * wanted[1] / wanted[0] - 1) > 0.005:
        raise InputError("--check", f"for {size[0]} x {size[1]} px", f"the pictures have {wanted[0]} x {wanted[1]} px; give "
                         "pictures in the mode it was calibrated for")  # fmt: skip
    note = Note("calibration_size_mismatch", f"the camera is for {size[0]} x {size[1]} px; it was scaled to the pictures' "
                f"{wanted[0]} x {wanted[1]} px", "give pictures of its own size")  # fmt: skip
    return camera.resized(*wanted), (note,)


def _explained_by(camera: Camera, own: Calibration) -> Adjusted:
    """The pictures explained by the stated camera, with only the board's places free."""
    k = camera.coefficients
    model = LensModel("stated", camera.lens, k.size, tuple(range(k.size)))
    sights = tuple(Sight(0, s.frame, s.view) for s in own.solution.problem.sights)
    problem = Problem(own.board, sights, (model,), ((camera.width_px, camera.height_px),), held=True)
    theta = np.array([camera.f_px, camera.aspect, camera.cx_px, camera.cy_px, *k])
    return adjust(problem, start_state(problem, [theta]))


def _covered(own: Calibration) -> Array:
    """(N, 2) places of a grid over the picture that lie near a point of the board in one of the pictures."""
    camera = own.camera
    x, y = np.meshgrid(np.linspace(0, camera.width_px - 1, 25), np.linspace(0, camera.height_px - 1, 19))
    grid = np.column_stack([x.ravel(), y.ravel()])
    seen_px = np.concatenate([s.view.points_px for s in own.solution.problem.sights])
    reach = max(camera.width_px, camera.height_px) / 24
    near = [bool((np.abs(seen_px - place).max(1) < reach).any()) for place in grid]
    return np.asarray(grid[np.array(near)])


def _central_u(camera: Camera) -> float:
    """Relative u of ranges by a camera: the median over its picture."""
    return float(np.nanmedian(uncertainty_map(camera, 9, 7).relative_u_range))


def difference_px(stated: Camera, other: Camera, grid: Array) -> Array:
    """(N, 2) how far the stated camera puts the direction of a pixel of the other one from that pixel, px, the turn between the
    two that fits best taken out."""
    rays = other.rays(grid)
    turn = np.zeros(3)
    for _ in range(5):
        turned = rays @ rotation_from_vector(turn).T
        off = stated.project(turned) - grid
        steps = [(stated.project(turned @ rotation_from_vector(h).T) - grid - off) / 1e-6 for h in 1e-6 * np.eye(3)]
        jacobian = np.stack(steps, -1)
        good = np.isfinite(off).all(1) & np.isfinite(jacobian).all((1, 2))
        turn = turn - np.linalg.lstsq(jacobian[good].reshape(-1, 3), off[good].reshape(-1), rcond=None)[0]
    return np.asarray(stated.project(rays @ rotation_from_vector(turn).T) - grid)


def _range_verdict(error: float, u: float) -> Check:
    word = "long" if error > 0 else "short"
    text = f"ranges by the stated camera come out {abs(error):.2%} too {word}, by these pictures (u of that {u:.2%})".replace(
        "%", " %"
    )
    return Check("range", abs(error) <= TOO_FAR * u, text, "calibrate anew, or widen its covariance")


def _projection_verdict(off: float, in_u: float, rms: float, own: Calibration) -> Check:
    text = (f"directions differ by {off:.2f} px rms where the board was seen, {in_u:.1f} times what both uncertainties let expect; "
            f"the stated camera leaves {rms:.3f} px rms, the pictures' own {own.solution.rms_px:.3f} px")  # fmt: skip
    return Check("directions", in_u <= TOO_FAR, text, "calibrate anew: another focus, zoom, mode, or a bad calibration")


def _axis_verdict(stated: Camera, other: Camera) -> Check:
    """Whether the middle of the picture looks the same way: a shifted principal point is a turn to all else."""
    middle = np.array([[(other.width_px - 1) / 2, (other.height_px - 1) / 2]])
    off = float(np.hypot(*(stated.project(other.rays(middle)) - middle)[0]))
    u = math.hypot(*(float(uncertainty_at(c, middle, turned=False)[0]) for c in (stated, other)))
    text = f"the middle of the picture looks {off:.2f} px elsewhere by the stated camera (u of that {u:.2f} px)"
    return Check(
        "axis", off <= TOO_FAR * u, text, "calibrate anew: pictures were cropped, or the principal point was held"
    )
