"""Calibrating: from pictures of a board to a camera, or two, that says how far it can be trusted."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..adjustment import LENS_MODELS, WARM, Adjusted, LensModel, Problem, Sight, adjust
from ..adjustment_start import start_state
from ..arrays import Array
from ..board import Board, BoardView
from ..calibration import Calibration, Picture, doubts
from ..calibration_checks import LEVEL, by_chance, checks_of, ranges_m, tilts_rad, warp_check, widened
from ..calibration_maps import next_picture
from ..camera import Camera
from ..errors import FileFormatError, GeometryError, InputError, NothingFoundError
from ..geometry import Pose
from ..quantity import Note, Quantity
from ..rig import Rig

AUTOMATIC = ("opencv4", "opencv5", "opencv8", "fisheye")
"""The models that are tried where none is given, leanest first."""
LEAST_PICTURES = 3
NO_BETTER = 0.06
"""A richer model must foretell the squares of residuals by more than that share better (3 % of their rms): what it gains in
the middle it pays for where it is extrapolated."""
ASSUMED_SCALE = 0.005
"""Relative u of a board's lengths where nobody measured the print (TRAPS of print scale: 97 % is common)."""
OUTLIER = 6.0
"""A point so many robust standard deviations off is left out."""
USELESS = 0.2
"""A focal length of a larger relative u is none."""
BAD_PICTURE = 3.0
"""A picture whose rms is so many times the others' is left out."""
MOST_BAD = 0.3
"""If more than that share would have to be left out, they are not outliers."""

Progress = Callable[[int, int], None]
"""Is told how many of how many pictures are done."""


@dataclass(frozen=True, eq=False)
class Seen:
    """The pictures of one camera.

    Attributes:
        views: by picture, None where nothing was found.
        reasons: why, by picture; "" where something was.
        names: of the pictures.
    """

    views: tuple[BoardView | None, ...]
    reasons: tuple[str, ...]
    names: tuple[str, ...]


def printed_scale(board: Board, printed: Quantity | None) -> tuple[Board, tuple[Note, ...]]:
    """The board as its print was measured, or as it is said to be, with the doubt of that.

    Args:
        board: as stated.
        printed: length between the outer edges of the pattern across, as measured on the print; None if nobody did.
    """
    if printed is None:
        if board.relative_u > 0 and not board.source.startswith("assumed"):
            return board, ()
        relative_u = board.relative_u or ASSUMED_SCALE
        note = Note("print_scale_assumed", f"lengths rest on the stated square of {board.square_m * 1000:.6g} mm, taken to "
                    f"{relative_u:.1%}: pictures can't show the scale of a print; focal lengths don't depend on it".replace("%", " %"),
                    "measure the whole width of the pattern and give it with --printed")  # fmt: skip
        return replace(board, relative_u=relative_u, source=f"assumed: {relative_u:.1%}".replace("%", " %")), (note,)
    ratio = float(printed.value) / board.width_m
    if not 0.5 < ratio < 2:
        raise InputError("--printed", f"{float(printed.value) * 1000:g} mm", "give the measured width of the whole pattern, "
                         f"nominally {board.width_m * 1000:g} mm")  # fmt: skip
    return replace(board, square_m=board.square_m * ratio, marker_m=board.marker_m * ratio,
                   relative_u=float(printed.u / printed.value), source="measured on the print"), ()  # fmt: skip


# -- pictures ----------------------------------------------------------------------------------------------------------


def see(paths: Sequence[Path], board: Board, progress: Progress | None = None, threads: int | None = None) -> Seen:
    """Find the board in pictures, several at a time; a file that is no picture is named and the rest goes on.

    The pictures are turned back to how the camera stored them, so that pictures held any way are of one camera.
    """

    def one(path: Path) -> BoardView | str:
        from ..detectors.boards import board_view
        from ..photo import Photo

        try:
            return board_view(Photo.load(path, gray=True).as_stored(), board)
        except (FileFormatError, NothingFoundError) as error:
            return str(error)

    found: list[BoardView | str] = []
    with ThreadPoolExecutor(threads or os.cpu_count() or 1) as pool:
        for done, view in enumerate(pool.map(one, paths), 1):
            found.append(view)
            if progress:
                progress(done, len(paths))
    views = tuple(v if isinstance(v, BoardView) else None for v in found)
    reasons = tuple(v if isinstance(v, str) else "" for v in found)
    return Seen(views, reasons, tuple(_names(paths)))


def _names(paths: Sequence[Path]) -> list[str]:
    """File names; with their folders where two are alike."""
    names = [p.name for p in paths]
    return [name if names.count(name) == 1 else str(path) for name, path in zip(names, paths, strict=True)]


def _of_one_size(seen: Seen) -> tuple[int, int]:
    sizes: dict[tuple[int, int], str] = {}
    for name, view in zip(seen.names, seen.views, strict=True):
        if view is not None:
            sizes.setdefault((view.width_px, view.height_px), name)
    if len(sizes) > 1:
        told = ", ".join(f"{w} x {h} px ({name})" for (w, h), name in sizes.items())
        raise InputError("the pictures", f"of different sizes: {told}", "give pictures of one camera in one mode")
    return next(iter(sizes))


def check_found(seen: Seen, board: Board) -> None:
    """Enough pictures show the board.

    Raises:
        NothingFoundError: with the first reason, as that often is everybody's.
    """
    found = sum(v is not None for v in seen.views)
    if found >= LEAST_PICTURES:
        return
    first = next((r for r in seen.reasons if r), "")
    if not found:
        raise NothingFoundError(f"the board ({board.text}) is in none of {len(seen.views)} pictures; {first}",
                                needed=LEAST_PICTURES)  # fmt: skip
    raise NothingFoundError(f"the board is in {found} of {len(seen.views)} pictures, {LEAST_PICTURES} are needed and 20 are good"
                            + (f"; {first}" if first else ""), found=found, needed=LEAST_PICTURES)  # fmt: skip


# -- one camera ----------------------------------------------------------------------------------------------------------


def calibrate(paths: Sequence[Path], board: Board, *, printed: Quantity | None = None, model: str | None = None,
              square_pixels: bool = False, progress: Progress | None = None, threads: int | None = None) -> Calibration:  # fmt: skip
    """Calibrate a camera from pictures of a board.

    Args:
        paths: the pictures, of one camera at one zoom and focus.
        board: what is in them.
        printed: the pattern's whole width as measured, m.
        model: of LENS_MODELS; None tries several and takes what foretells unseen pictures best.
        square_pixels: whether to hold the pixels square.
        progress: told after each picture.
        threads: pictures at a time; None for as many as there are processors.

    Raises:
        InputError: no such model, or pictures of different sizes.
        NothingFoundError: the board is in too few pictures.
        GeometryError: the pictures leave the camera open.
    """
    _check_model(model)
    board, notes = printed_scale(board, printed)
    seen = see(paths, board, progress, threads)
    check_found(seen, board)
    return calibrate_views(seen, board, model=model, square_pixels=square_pixels, notes=notes)


def _check_model(model: str | None) -> None:
    if model is not None and model not in LENS_MODELS:
        raise InputError("--model", model, f"known are {', '.join(LENS_MODELS)}")


def calibrate_views(seen: Seen | Sequence[BoardView], board: Board, *, model: str | None = None, square_pixels: bool = False,
                    notes: tuple[Note, ...] = ()) -> Calibration:  # fmt: skip
    """The same from points that were found before."""
    _check_model(model)
    if not isinstance(seen, Seen):
        seen = Seen(tuple(seen), ("",) * len(seen), tuple(v.name for v in seen))
    check_found(seen, board)
    size = _of_one_size(seen)
    order = [i for i, v in enumerate(seen.views) if v is not None]
    sights = tuple(Sight(0, n, view) for n, i in enumerate(order) if (view := seen.views[i]) is not None)
    first = LENS_MODELS[model or "opencv5"]
    problem = Problem(board, sights, (first,), (size,), free_aspect=not square_pixels)
    solution, kept, why = without_outliers(_first_solution(problem, model))
    tried: dict[str, float] = {}
    if model is None:
        solution, tried = _chosen_flat(solution)
    left = {order[frame]: reason for frame, reason in why.items()}
    return _finished(solution, board, seen, [order[f] for f in kept], left, tried, notes)


def _first_solution(problem: Problem, asked: str | None) -> Adjusted:
    """A first solution; where no model was asked for and the usual one is too rich for the pictures, of a leaner one."""
    start = start_state(problem)
    try:
        return adjust(problem, start)
    except GeometryError as error:
        if asked is not None or error.code == "no_convergence":
            raise
    lean = replace(problem, models=(LENS_MODELS["k1"],))
    return adjust(lean, start)


def without_outliers(solution: Adjusted) -> tuple[Adjusted, list[int], dict[int, str]]:
    """Leave out points, then pictures, that nothing explains.

    Returns:
        The solution without them, the frames that are kept, and why the others are not.
    """
    kept = list(range(solution.problem.frames))
    why: dict[int, str] = {}
    solution = _without_points(solution) or solution
    allowed = int(MOST_BAD * len(kept))
    while True:
        worst = _worst_frame(solution)
        if worst is None or len(why) >= allowed or len(kept) <= LEAST_PICTURES:
            break
        frame, reason = worst
        why[kept.pop(frame)] = reason
        solution = _again(solution, solution.problem, [f for f in range(solution.problem.frames) if f != frame])
    return (_without_points(solution) or solution), kept, why


def _worst_frame(solution: Adjusted) -> tuple[int, str] | None:
    """The picture that stands out most, by residuals over the detector's sigma: a blurred picture may be off by more."""
    cameras = range(len(solution.problem.models))
    chi = np.nanmax([_chi_of_frames(solution, c) for c in cameras], axis=0)
    frame, usual = int(np.argmax(chi)), float(np.median(chi))
    if chi.size <= LEAST_PICTURES or chi[frame] <= BAD_PICTURE * usual:
        return None
    rms = np.nanmax([solution.rms_of_frames_px(c) for c in cameras], axis=0)
    return (
        frame,
        f"its points are off by {rms[frame]:.2f} px rms, those of the other pictures by {float(np.median(rms)):.2f} px",
    )


def _chi_of_frames(solution: Adjusted, camera: int) -> Array:
    """(frames,) root mean square of residuals over sigma; NaN where the camera took no picture."""
    weight = solution.problem.blocks[camera].weight
    r2 = np.sum(solution.residuals_px[camera] ** 2, -1) * weight**2
    count = (weight > 0).sum(1)
    return np.asarray(np.sqrt(np.nansum(r2, 1) / np.where(count, count, np.nan)))


def _again(solution: Adjusted, problem: Problem, frames: Sequence[int]) -> Adjusted:
    """Adjusted again with some frames only, from where it was."""
    picked = list(frames)
    boards = Pose(solution.state.boards.rotation[picked], solution.state.boards.translation_m[picked])
    return adjust(problem.subset(picked), replace(solution.state, boards=boards), damping=WARM)


def _without_points(solution: Adjusted) -> Adjusted | None:
    """Without single points that are far off, unless a picture would lose a fifth of its points; None if there are none."""
    sights = []
    changed = False
    for sight in solution.problem.sights:
        n = sight.view.ids.size
        r = np.linalg.norm(solution.residuals_px[sight.camera][sight.frame, :n], axis=-1) / sight.view.sigma_px
        usual = float(np.median(r))
        good = r < OUTLIER * max(usual / 1.18, solution.factor)  # the median of a Rayleigh law is 1.18 of its sigma
        if good.all() or (~good).sum() > n // 5:
            sights.append(sight)
            continue
        changed = True
        view = sight.view
        sights.append(replace(sight, view=replace(view, ids=view.ids[good], points_px=view.points_px[good],
                                                  sigma_px=view.sigma_px[good])))  # fmt: skip
    return adjust(replace(solution.problem, sights=tuple(sights)), solution.state, damping=WARM) if changed else None


# -- which lens model ------------------------------------------------------------------------------------------------------


def chosen_model(
    solution: Adjusted, names: Sequence[str] = AUTOMATIC, folds: int = 4
) -> tuple[Adjusted, dict[str, float]]:
    """The leanest model that foretells pictures it has not seen as well as the best one does, and the rms of each.

    Each fold's pictures are explained by a camera from the others, with only their boards' places free. A model that does not
    explain what it has seen better than a leaner one is not asked to foretell.
    """
    errors: dict[str, Array] = {}
    fitted: dict[str, Adjusted] = {}
    for name in names:
        try:
            tried = _with_model(solution, LENS_MODELS[name])
            if _turns_back(tried.camera()) or _no_better(tried, fitted):
                continue
            fitted[name], errors[name] = tried, _foretold(tried, folds)
        except GeometryError:
            continue
    if not errors:
        return solution, {}
    means = {name: float(np.mean(e)) for name, e in errors.items()}
    best = min(means, key=lambda name: means[name])
    for name in errors:
        more = errors[name] - errors[best]
        if np.mean(more) <= max(np.std(more) / np.sqrt(more.size), NO_BETTER * means[best]):
            best = name
            break
    told = {name: float(np.sqrt(2 * m)) for name, m in means.items()}
    return (_with_k3(fitted[best]) if best == "opencv4" else fitted[best]), told


def _with_k3(solution: Adjusted) -> Adjusted:
    """With a third radial coefficient where noise alone would not explain what it explains, small as that may be: it costs little,
    and without it the uncertainty would leave out what the check of the lens model then finds."""
    with suppress(GeometryError):
        richer = _with_model(solution, LENS_MODELS["opencv5"])
        if not _turns_back(richer.camera()) and by_chance(solution, richer) < LEVEL:
            return richer
    return solution


def _no_better(tried: Adjusted, fitted: Mapping[str, Adjusted]) -> bool:
    """Whether a leaner model explains the pictures as well already."""
    return any(tried.chi2 > (1 - NO_BETTER) * leaner.chi2 for leaner in list(fitted.values())[:1])


def _turns_back(camera: Camera) -> bool:
    """Whether a lens, no fisheye, has no direction for some pixels of the picture: it is then extrapolated beyond sense."""
    x, y = np.meshgrid(np.linspace(0, camera.width_px - 1, 17), np.linspace(0, camera.height_px - 1, 17))
    return bool(not camera.invertible(np.column_stack([x.ravel(), y.ravel()])).all()) and camera.lens != "fisheye"


def _chosen_flat(solution: Adjusted) -> tuple[Adjusted, dict[str, float]]:
    """The model chosen with the board let bow if it seems to, as a richer lens would swallow a bow; the solution is of a flat one."""
    bow = warp_check(solution)
    if bow is None or bow.better is None:
        return chosen_model(solution)
    chosen, tried = chosen_model(bow.better)
    flat = replace(chosen.state, warp_m=np.zeros(2))
    return adjust(replace(chosen.problem, free_warp=False), flat, damping=WARM), tried


def _with_model(solution: Adjusted, model: LensModel) -> Adjusted:
    problem = replace(solution.problem, models=(model,))
    own = solution.problem.models[0]
    if model.lens != own.lens:
        return adjust(problem, start_state(problem))
    theta = np.zeros(4 + model.count)
    shared = [*range(4), *(4 + k for k in model.free if k in own.free)]
    theta[shared] = solution.state.intrinsics[0][shared]
    return adjust(problem, replace(solution.state, intrinsics=(theta,)), damping=WARM)


def _foretold(solution: Adjusted, folds: int) -> Array:
    """(frames,) mean square px per coordinate of each picture by a camera that did not see it."""
    frames = np.arange(solution.problem.frames)
    found = np.zeros(frames.size)
    for fold in range(min(folds, frames.size)):
        out = frames[fold::folds]
        if frames.size - out.size < LEAST_PICTURES:
            raise GeometryError("too few pictures", code="too_few_views")
        trained = _again(solution, solution.problem, [int(f) for f in frames if f not in out])
        boards = Pose(solution.state.boards.rotation[out], solution.state.boards.translation_m[out])
        held = replace(solution.problem.subset(list(out)), held=True)
        told = adjust(held, replace(trained.state, boards=boards), damping=WARM)
        found[out] = told.rms_of_frames_px() ** 2 / 2
    return found


# -- what comes of it ------------------------------------------------------------------------------------------------------


def _finished(solution: Adjusted, board: Board, seen: Seen, kept: Sequence[int], left: dict[int, str], tried: dict[str, float],
              notes: tuple[Note, ...]) -> Calibration:  # fmt: skip
    checks = checks_of(solution)
    final = widened(solution, checks)
    source = f"calibrated from {len(kept)} pictures of a {board.text} (rms {final.rms_px:.3f} px)"
    _check_known(final.camera())
    pictures = _pictures(final, seen, kept, left)
    notes = (*doubts(checks), *_left_out_note(pictures), *notes)
    return Calibration((final.camera(0, source),), board, tuple(m.name for m in final.problem.models), pictures, checks, tried,
                       next_picture(final), final, None, notes)  # fmt: skip


def _check_known(camera: Camera) -> None:
    """Refuse a camera that the pictures hardly tell.

    Raises:
        GeometryError: how badly, and which pictures are missing.
    """
    relative = camera.u_f_px / float(camera.f_px)
    if relative > USELESS:
        raise GeometryError(f"these views leave the focal length open to {relative:.0%} (1s): take pictures of the board tilted by "
                            "30 to 45 degrees in several directions, near and far, all over the picture".replace("%", " %"),
                            code="degenerate_views")  # fmt: skip


def _pictures(
    solution: Adjusted, seen: Seen, kept: Sequence[int], left: dict[int, str], camera: int = 0
) -> tuple[Picture, ...]:
    frame_of = {index: frame for frame, index in enumerate(kept)}
    rms, tilts, ranges = solution.rms_of_frames_px(camera), tilts_rad(solution, camera), ranges_m(solution, camera)
    points = {s.frame: s.view.ids.size for s in solution.problem.sights if s.camera == camera}
    found = []
    for i, (name, view) in enumerate(zip(seen.names, seen.views, strict=True)):
        if i in frame_of and view is not None:
            f = frame_of[i]
            found.append(
                Picture(name, camera, points[f], float(rms[f]), float(tilts[f]), float(ranges[f]), view.source)
            )
        else:
            found.append(
                Picture(name, camera, detector=view.source if view else "", left_out=left.get(i) or seen.reasons[i])
            )
    return tuple(found)


def _left_out_note(pictures: Sequence[Picture]) -> tuple[Note, ...]:
    out = [p for p in pictures if p.left_out]
    if not out:
        return ()
    told = "; ".join(f"{p.name}: {p.left_out}" for p in out[:5]) + (
        f"; and {len(out) - 5} more" if len(out) > 5 else ""
    )
    return (Note("views_left_out", f"{len(out)} of {len(pictures)} pictures were left out: {told}", "look at them"),)


# -- two cameras -----------------------------------------------------------------------------------------------------------


def calibrate_rig(left: Sequence[Path], right: Sequence[Path], board: Board, *, printed: Quantity | None = None,
                  model: str | None = None, square_pixels: bool = False, progress: Progress | None = None,
                  threads: int | None = None) -> Calibration:  # fmt: skip
    """Calibrate two cameras that are fixed to each other, from pictures that they took at once.

    Args:
        left: pictures of the left camera.
        right: pictures of the right camera, in the same order.
        board, printed, model, square_pixels, progress, threads: as in `calibrate`; where no model is given each camera
            gets its own.

    Raises:
        InputError: unequal numbers of pictures, or pictures of different sizes.
        NothingFoundError: the board is in too few pictures, or in too few pairs.
        GeometryError: the pictures leave something open.
    """
    _check_model(model)
    if len(left) != len(right):
        raise InputError(
            "--stereo", f"{len(left)} left and {len(right)} right pictures", "give as many of each, in the same order"
        )
    board, notes = printed_scale(board, printed)
    both = see([*left, *right], board, progress, threads)
    n = len(left)
    seen = [Seen(both.views[at : at + n], both.reasons[at : at + n], both.names[at : at + n]) for at in (0, n)]
    return calibrate_rig_views(seen[0], seen[1], board, model=model, square_pixels=square_pixels, notes=notes)


def calibrate_rig_views(left: Seen, right: Seen, board: Board, *, model: str | None = None, square_pixels: bool = False,
                        notes: tuple[Note, ...] = ()) -> Calibration:  # fmt: skip
    """The same from points that were found before; pictures of one index were taken at once."""
    for seen in (left, right):
        check_found(seen, board)
    pairs = sum(a is not None and b is not None for a, b in zip(left.views, right.views, strict=True))
    if pairs < LEAST_PICTURES:
        raise NothingFoundError(f"the board is in both pictures of {pairs} pairs, {LEAST_PICTURES} are needed", found=pairs,
                                needed=LEAST_PICTURES)  # fmt: skip
    sizes = (_of_one_size(left), _of_one_size(right))
    order = [i for i in range(len(left.views)) if left.views[i] is not None or right.views[i] is not None]
    sights = tuple(Sight(camera, n, view) for n, i in enumerate(order) for camera, seen in enumerate((left, right))
                   if (view := seen.views[i]) is not None)  # fmt: skip
    models = tuple(LENS_MODELS[model or _model_of(seen, board, square_pixels)] for seen in (left, right))
    problem = Problem(board, sights, models, sizes, free_aspect=not square_pixels)
    solution, kept, why = without_outliers(adjust(problem, start_state(problem)))
    return _finished_rig(
        solution, board, (left, right), [order[f] for f in kept], {order[f]: r for f, r in why.items()}, notes
    )


def _model_of(seen: Seen, board: Board, square_pixels: bool) -> str:
    """The model that one camera of a rig is best described by."""
    return calibrate_views(seen, board, square_pixels=square_pixels).models[0]


def _finished_rig(solution: Adjusted, board: Board, seen: tuple[Seen, Seen], kept: Sequence[int], left: dict[int, str],
                  notes: tuple[Note, ...]) -> Calibration:  # fmt: skip
    checks = checks_of(solution)
    final = widened(solution, checks)
    source = f"calibrated from {len(kept)} pairs of pictures of a {board.text} (rms {final.rms_px:.3f} px)"
    cameras = (final.camera(0, source), final.camera(1, source))
    for camera in cameras:
        _check_known(camera)
    cov = final.cov[:-2, :-2].copy()
    pose = final.state.relative[0]
    cov[-3:, -3:] += board.relative_u**2 * np.outer(pose.translation_m, pose.translation_m)
    rig = Rig(*cameras, Pose(pose.rotation, pose.translation_m, cov[-6:, -6:]), cov, source)
    pictures = tuple(p for camera in (0, 1) for p in _pictures(final, seen[camera], kept, left, camera))
    notes = (*doubts(checks), *_left_out_note(pictures), *notes)
    return Calibration(cameras, board, tuple(m.name for m in final.problem.models), pictures, checks, {}, next_picture(final),
                       final, rig, notes)  # fmt: skip
