"""Checks of a calibration that its own standard deviations do not show, and how much each makes the camera doubtful.

The covariance of a least-squares solution holds if the lens model is right, the board is what it is said to be, and the noise
is independent. Each check here asks the residuals, or other halves of the pictures, whether that is so; where it is not, what
it showed is added to the covariance.

Source: mrcal, "Uncertainty" and "Formulation" (board warp, cross-validation); F-test of nested least-squares models.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np

from .adjustment import (
    LENS_MODELS,
    RATIONAL,
    WARM,
    Adjusted,
    LensModel,
    Problem,
    State,
    adjust,
    inverse,
    projection,
    reduced,
)
from .arrays import Array, Indices
from .errors import GeometryError
from .geometry import Pose
from .quantity import Note

LEVEL = 0.002
"""How often each check may raise a false alarm."""
HIGHER = LensModel("more terms", "brown_conrady", 12, (0, 1, 2, 3, 4, 5, 8, 9, 10, 11))
"""opencv5 with a fourth radial term and thin prism: unlike opencv8 its terms are told apart where they are 0, so that the
F-test holds (the rational model raised four times as many false alarms as its level)."""
RICHER = {
    "pinhole": LENS_MODELS["opencv4"], "k1": LENS_MODELS["opencv5"], "k1k2": LENS_MODELS["opencv5"],
    "opencv4": LENS_MODELS["opencv5"], "opencv5": HIGHER, "opencv8": LENS_MODELS["opencv12"],
}  # fmt: skip
"""The model that a leaner one is tried against."""
ADVISED = {"more terms": "opencv8"}
ENOUGH_TILT_RAD, TILTED_VIEWS = np.radians(12.0), 3
"""So many pictures of the board should be tilted by more than that, or the focal length and the range are told apart badly."""
ENOUGH_SPREAD = 1.25
"""The farthest board should be so many times as far as the nearest."""
COVERAGE = 0.6
"""Share of the picture, in cells of a 5 x 4 grid, that points should lie in."""
FEW_VIEWS = 8


def _stands_out(gain: float, noise: float, dof: int) -> bool:
    """Whether a bow is more than noise that is not independent would make: if not it is doubt, and the value stays as it is.

    How much larger the noise is than residuals say was itself learnt from `dof` differences only, hence the F law.
    """
    from scipy.stats import chi2
    from scipy.stats import f as fisher

    return bool((chi2.sf(gain, 2) if noise == 1 else fisher.sf(gain / noise**2 / 2, 2, dof)) < LEVEL)


@dataclass(frozen=True)
class Check:
    """One question to a calibration, and its answer.

    Attributes:
        name: what was looked at.
        passed: whether all is well.
        found: what was seen, in words and numbers.
        cure: what to do if not.
        note: the note where it did not pass; None for a part of the one on the model.
        extra_cov: what it adds to the covariance of all global unknowns; None for nothing.
        noise_factor: by how much the noise seems larger than the residuals say, as far as the camera goes.
        better: a solution that the check found better; None for none.
        gain: by how much it lowers the sum of squares, in variances of the noise; with 2 degrees of freedom.
    """

    name: str
    passed: bool
    found: str
    cure: str = ""
    note: Note | None = None
    extra_cov: Array | None = field(default=None, compare=False, repr=False)
    noise_factor: float = 1.0
    better: Adjusted | None = field(default=None, compare=False, repr=False)
    gain: float = 0.0


def widened(solution: Adjusted, checks: Sequence[Check]) -> Adjusted:
    """The solution that the checks found best, with the covariance of what they showed.

    Common directions of residuals and halves that disagree are two views of noise that is not independent: the larger counts.
    """
    noise = max(c.noise_factor for c in checks)
    sure = [c.better for c in checks if c.better is not None and _stands_out(c.gain, noise, solution.problem.free.size)]
    best = sure[0] if sure else solution
    cov = best.cov * noise**2
    return replace(best, cov=cov + sum((c.extra_cov for c in checks if c.extra_cov is not None), np.zeros_like(cov)))


def checks_of(solution: Adjusted) -> tuple[Check, ...]:
    """All checks of one camera's or a rig's calibration."""
    asked: tuple[Callable[[Adjusted], Check | None], ...] = (
        lens_check, warp_check, board_check, residual_check, halves_check,
        tilt_check, range_check, coverage_check, count_check,
    )  # fmt: skip
    return tuple(answer for ask in asked if (answer := ask(solution)) is not None)


# -- models that explain more ------------------------------------------------------------------------------------------


def _better(solution: Adjusted, problem: Problem, start: State) -> tuple[Adjusted, float] | None:
    """The richer solution and the probability that noise alone makes it so much better; None where it can't be had."""
    found = []
    for begin in _starts(problem, start):
        with suppress(GeometryError):
            found.append(adjust(problem, begin, damping=WARM))
    if not found:
        return None
    richer = min(found, key=lambda a: a.chi2)
    return richer, by_chance(solution, richer)


def by_chance(solution: Adjusted, richer: Adjusted) -> float:
    """The probability that noise alone makes a richer solution so much better (F-test)."""
    from scipy.stats import f as fisher

    more = solution.dof - richer.dof
    statistic = (solution.chi2 - richer.chi2) / more / (richer.chi2 / richer.dof)
    return float(fisher.sf(statistic, more, richer.dof))


def _starts(problem: Problem, start: State) -> tuple[State, ...]:
    """The start, and for a rational lens one without distortion: its solutions lie in valleys that don't lead to each other."""
    if not any(set(RATIONAL) <= set(m.free) for m in problem.models):
        return (start,)
    plain = tuple(np.concatenate([i[:4], np.zeros(i.size - 4)]) for i in start.intrinsics)
    return (start, replace(start, intrinsics=plain))


def _shift(solution: Adjusted, other: Adjusted) -> Array:
    """How far the global unknowns move to another solution of the same lens models."""
    intrinsics = [b - a for a, b in zip(solution.state.intrinsics, other.state.intrinsics, strict=True)]
    return np.concatenate([*intrinsics, _shift_of_poses(solution, other), other.state.warp_m - solution.state.warp_m])


def _as_seen(solution: Adjusted, richer: Adjusted) -> Array:
    """How far the global unknowns of the leaner model would move for its cameras to look as the richer ones where points were seen.

    Coefficients of unlike models can't be subtracted, directions can: pixels of the richer camera's directions are explained by
    the leaner model's numbers and a turn of the camera. Of a rig, the turns are a part of how the cameras stand to each other.
    """
    shift, turns = np.zeros(solution.problem.size), []
    for index, model in enumerate(solution.problem.models):
        block, theta = solution.problem.blocks[index], solution.state.intrinsics[index]
        seen = block.seen_px[block.weight > 0]
        rays = richer.camera(index).rays(seen)
        pixels, inner, outer = projection(model.lens, theta, rays, model.free)
        first = solution.first(index)
        own = [i for i in range(theta.size) if first + i in solution.problem.free]
        columns = np.concatenate([inner[..., own], np.cross(rays[:, None, :], outer)], -1)
        good = np.isfinite(pixels).all(1) & np.isfinite(columns).all((1, 2))
        found = np.linalg.lstsq(columns[good].reshape(-1, len(own) + 3), (seen - pixels)[good].reshape(-1), rcond=None)[
            0
        ]
        shift[[first + i for i in own]] = found[: len(own)]
        turns.append(found[len(own) :])
    at = solution.first(len(solution.problem.models))
    moved = _shift_of_poses(solution, richer)
    for index, pose in enumerate(richer.state.relative):
        moved[6 * index : 6 * index + 3] += turns[index + 1] - pose.rotation @ turns[0]
        moved[6 * index + 3 : 6 * index + 6] += np.cross(turns[index + 1], pose.translation_m)
    shift[at : at + moved.size] = moved
    return shift


def _shift_of_poses(solution: Adjusted, richer: Adjusted) -> Array:
    """Of the relative poses: rotation vectors and translations."""
    found = [np.zeros(0)]
    for own_pose, pose in zip(solution.state.relative, richer.state.relative, strict=True):
        turn = pose.rotation @ own_pose.rotation.T
        vector = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]) / 2
        found += [vector, pose.translation_m - own_pose.translation_m]
    return np.concatenate(found)


def lens_check(solution: Adjusted) -> Check | None:
    """Whether a lens model with more coefficients explains the pictures better than noise would let it."""
    models = [RICHER.get(m.name) for m in solution.problem.models]
    if None in models:
        return None
    richer_models = tuple(m for m in models if m is not None)
    problem = replace(solution.problem, models=richer_models)
    start = replace(solution.state, intrinsics=tuple(
        np.concatenate([i, np.zeros(4 + m.count - i.size)])
        for i, m in zip(solution.state.intrinsics, richer_models, strict=True)))  # fmt: skip
    found = _better(solution, problem, start)
    names = " and ".join(dict.fromkeys(m.name for m in solution.problem.models))
    advised = list(dict.fromkeys(ADVISED.get(m.name, m.name) for m in richer_models))
    other = "a lens with more terms" if HIGHER in richer_models else " and ".join(advised)
    if found is None or found[1] >= LEVEL:
        return Check("lens model", True, f"{other} explains no more than {names}")
    richer = found[0]
    shift = _as_seen(solution, richer)
    text = (f"{other} explains the pictures better than {names} (rms {richer.rms_px:.3f} against {solution.rms_px:.3f} px); "
            f"it moves the focal length by {shift[0]:+.2f} px")  # fmt: skip
    return Check(
        "lens model",
        False,
        text,
        f"calibrate with --model {advised[-1]}",
        extra_cov=np.outer(shift, shift),
    )


def warp_check(solution: Adjusted) -> Check | None:
    """Whether the pictures show a bowed board. Both halves of a split share the bow, so nothing else can see it."""
    if solution.problem.free_warp:
        return None
    found = _better(solution, replace(solution.problem, free_warp=True), solution.state)
    if found is None or found[1] >= LEVEL:
        return Check("board flatness", True, "no bow of the board can be seen")
    bowed = found[0]
    shift = _shift(solution, bowed)
    shift[-2:] = 0
    bow = bowed.state.warp_m * 1000
    text = (f"the board bulges by {abs(bow[0]):.2f} mm along its width and {abs(bow[1]):.2f} mm along its height; letting it "
            f"moves the focal length by {shift[0]:+.2f} px")  # fmt: skip
    # the true shape is between flat and beyond the fitted one by a part: the shift stands for limits
    return Check("board flatness", False, text, "fix the board to a plate of glass or aluminium",
                 extra_cov=np.outer(shift, shift) / 3, better=bowed,
                 gain=(solution.chi2 - bowed.chi2) / bowed.factor**2)  # fmt: skip


# -- residuals ---------------------------------------------------------------------------------------------------------


def _standardised(solution: Adjusted) -> list[tuple[Array, Indices, Array]]:
    """Per camera residuals over their noise (n, 2), the points' ids (n,), and where they were seen (n, 2)."""
    found = []
    for block, r in zip(solution.problem.blocks, solution.residuals_px, strict=True):
        present = block.weight > 0
        scaled = r[present] * block.weight[present][:, None] / solution.factor
        found.append((scaled, block.ids[present], block.seen_px[present]))
    return found


def _grouped(scaled: Array, group: Indices, count: int) -> tuple[Array, Indices]:
    """Sum of squares of the groups' means over their variance, per group, and how many each has."""
    n = np.bincount(group, minlength=count)
    sums = np.column_stack([np.bincount(group, scaled[:, i], count) for i in range(2)])
    return np.asarray(np.sum(sums**2, 1) / np.maximum(n, 1)), n


def board_check(solution: Adjusted) -> Check:
    """Whether single points of the board lie elsewhere than stated: the mean residual of a point over all pictures."""
    from scipy.stats import chi2

    parts = _standardised(solution)
    scaled, ids = np.concatenate([p[0] for p in parts]), np.concatenate([p[1] for p in parts])
    squares, n = _grouped(scaled, ids, len(solution.problem.board.points_m))
    seen = n > 0
    total, dof = float(squares[seen].sum()), 2 * int(seen.sum())
    sigma = solution.factor * float(np.median(np.concatenate([s.view.sigma_px for s in solution.problem.sights])))
    excess = max(0.0, total / dof - 1) / float(np.mean(n[seen]))
    off_px = sigma * np.sqrt(excess)
    if chi2.sf(total, dof) >= LEVEL:
        return Check("board points", True, "the same points are off in no common direction")
    text = f"single points of the board seem to lie {off_px:.3f} px from where they should, in all pictures alike"
    return Check("board points", False, text, "print the board anew, or use one that was made for measuring",
                 extra_cov=_of_board_errors(solution, off_px))  # fmt: skip


def _of_board_errors(solution: Adjusted, off_px: float) -> Array:
    """Covariance of the global unknowns if every point of the board is off by so many px, alike in all pictures."""
    problem, state = solution.problem, solution.state
    normal, gains = reduced(problem, state)
    per_point = np.zeros((len(problem.board.points_m), problem.free.size, 2))
    for block, gain in zip(problem.blocks, gains, strict=True):
        np.add.at(per_point, block.ids, gain * (block.weight > 0)[..., None, None])
    inner = np.einsum("pik,pjk->ij", per_point, per_point) * off_px**2
    inverted = inverse(normal)
    cov = np.zeros((problem.size, problem.size))
    cov[np.ix_(problem.free, problem.free)] = inverted @ inner @ inverted
    return cov


def residual_check(solution: Adjusted, columns: int = 6, rows: int = 4) -> Check:
    """Whether residuals have a common direction somewhere in the picture, as a wrong lens model leaves them."""
    from scipy.stats import chi2

    total, dof = 0.0, 0
    for (scaled, _, seen), (width, height) in zip(_standardised(solution), solution.problem.sizes_px, strict=True):
        cell = _cell(seen, width, height, columns, rows)
        squares, n = _grouped(scaled, cell, columns * rows)
        total, dof = total + float(squares[n > 5].sum()), dof + 2 * int((n > 5).sum())
    ratio = total / dof if dof else 0.0
    if not dof or chi2.sf(total, dof) >= LEVEL:
        return Check("residual structure", True, "residuals have no common direction anywhere in the picture")
    text = f"residuals have common directions in parts of the picture, {np.sqrt(ratio):.1f} times as large as noise would leave"
    return Check("residual structure", False, text, "try another --model, and look at the pictures of the residuals",
                 noise_factor=float(np.sqrt(ratio)))  # fmt: skip


def _cell(points_px: Array, width: int, height: int, columns: int, rows: int) -> Indices:
    x = np.clip((points_px[:, 0] + 0.5) / width * columns, 0, columns - 1).astype(int)
    y = np.clip((points_px[:, 1] + 0.5) / height * rows, 0, rows - 1).astype(int)
    return np.asarray(y * columns + x)


def halves_check(solution: Adjusted) -> Check | None:
    """Whether halves of the pictures give cameras that differ by no more than their uncertainties say."""
    from scipy.stats import chi2

    frames = np.arange(solution.problem.frames)
    if frames.size < FEW_VIEWS:
        return None
    ratios = []
    for seed in range(3):
        order = np.random.default_rng(seed).permutation(frames)
        found = [_fit_of(solution, sorted(order[k::2])) for k in (0, 1)]
        if found[0] is None or found[1] is None:
            continue
        ratios.append(_distance(found[0], found[1]))
    if not ratios:
        return None
    dof = solution.problem.free.size
    mean = float(np.mean(ratios))
    if chi2.sf(mean, dof) >= LEVEL:
        return Check(
            "halves of the pictures", True, f"their cameras agree ({np.sqrt(mean / dof):.2f} of what is expected)"
        )
    text = f"halves of the pictures give cameras that differ by {np.sqrt(mean / dof):.1f} times what their uncertainties say"
    return Check("halves of the pictures", False, text, "look for a lens that refocused, or a board that moved or bent",
                 noise_factor=float(np.sqrt(mean / dof)))  # fmt: skip


def _fit_of(solution: Adjusted, frames: Sequence[int]) -> Adjusted | None:
    state = solution.state
    picked = list(frames)
    boards = replace(
        state.boards, rotation=state.boards.rotation[picked], translation_m=state.boards.translation_m[picked]
    )
    try:
        return adjust(solution.problem.subset(picked), replace(state, boards=boards), damping=WARM)
    except GeometryError:
        return None


def _distance(a: Adjusted, b: Adjusted) -> float:
    """Squared difference of two solutions in their own uncertainties."""
    free = a.problem.free
    shift = _shift(a, b)[free]
    cov = (a.cov + b.cov)[np.ix_(free, free)]
    scale = np.sqrt(np.diag(cov))
    return float(shift / scale @ np.linalg.solve(cov / np.outer(scale, scale), shift / scale))


# -- the pictures themselves --------------------------------------------------------------------------------------------


def boards_of(solution: Adjusted, camera: int = 0) -> Pose:
    """camera_from_board of all frames."""
    boards = solution.state.boards
    if camera == 0:
        return boards
    relative = solution.state.relative[camera - 1]
    return Pose(relative.rotation @ boards.rotation, relative.apply(boards.translation_m))


def tilts_rad(solution: Adjusted, camera: int = 0) -> Array:
    """(frames,) angle between the board and the image plane of a camera."""
    return np.asarray(np.arccos(np.clip(abs(boards_of(solution, camera).rotation[:, 2, 2]), 0, 1)))


def ranges_m(solution: Adjusted, camera: int = 0) -> Array:
    """(frames,) from a camera to the board's middle."""
    middle = solution.problem.board.points_m.mean(0)
    return np.asarray(np.linalg.norm(boards_of(solution, camera).apply(middle[None, :])[:, 0], axis=-1))


def tilt_check(solution: Adjusted) -> Check:
    """Whether the board was tilted: seen from the front only, focal length and range can't be told apart."""
    tilts = tilts_rad(solution)
    text = f"tilts from {np.degrees(tilts.min()):.0f} to {np.degrees(tilts.max()):.0f} degrees"
    cure = "take pictures with the board tilted by 30 to 45 degrees, to each of its four sides"
    passed = int((tilts > ENOUGH_TILT_RAD).sum()) >= TILTED_VIEWS
    return Check("tilt of the board", passed, text, cure, Note("frontal_views", text, cure))


def range_check(solution: Adjusted) -> Check:
    """Whether the board was near and far."""
    ranges = ranges_m(solution)
    text, cure = f"ranges from {ranges.min():.3g} to {ranges.max():.3g} m", "take some pictures from twice as far"
    passed = bool(ranges.max() > ENOUGH_SPREAD * ranges.min())
    return Check("range of the board", passed, text, cure, Note("single_range", text, cure))


def coverage_check(solution: Adjusted, columns: int = 5, rows: int = 4) -> Check:
    """Whether there are points all over the picture; where there are none, the lens is extrapolated."""
    worst = 1.0
    for (_, _, seen), (width, height) in zip(_standardised(solution), solution.problem.sizes_px, strict=True):
        cells = np.unique(_cell(seen, width, height, columns, rows)).size
        worst = min(worst, cells / (columns * rows))
    text = f"points in {worst:.0%} of the picture".replace("%", " %")
    cure = "take pictures with the board near the corners and edges of the picture"
    return Check("coverage of the picture", worst >= COVERAGE, text, cure, Note("low_coverage", text, cure))


def count_check(solution: Adjusted) -> Check:
    """Whether there are enough pictures."""
    frames = solution.problem.frames
    text, cure = f"{frames} places of the board", f"take {FEW_VIEWS} or more, 20 are good"
    return Check("number of pictures", frames >= FEW_VIEWS, text, cure, Note("few_views", text, cure))
