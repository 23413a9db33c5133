"""Bundle adjustment of board views: intrinsics, relative poses and board poses that explain what was seen, with their covariance.

Minimises the sum over all points of |project(camera, pose, point) - seen|^2 / sigma^2 by Levenberg-Marquardt. The board
poses are eliminated block by block (Schur complement), so the cost grows with the number of views only.

Source: B. Triggs et al., "Bundle Adjustment - A Modern Synthesis", 1999; Z. Zhang, "A flexible new technique for camera
calibration", 2000.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from .arrays import Array, Indices
from .board import Board, BoardView
from .camera import Camera
from .errors import GeometryError
from .geometry import Pose, rotation_from_vector
from .lenses import LENSES

CONVERGED = 1e-7
"""Relative change of the sum of squares at which a solution stands: a thousandth of what one unknown is worth."""


@dataclass(frozen=True)
class LensModel:
    """Which coefficients of which lens are free.

    Attributes:
        name: as on the command line; OPENCV names as mrcal and COLMAP have them.
        lens: a key of LENSES.
        count: coefficients of the camera.
        free: which of them are estimated; the others stay 0.
    """

    name: str
    lens: str
    count: int
    free: tuple[int, ...]


LENS_MODELS: dict[str, LensModel] = {
    m.name: m
    for m in (
        LensModel("pinhole", "pinhole", 0, ()), LensModel("k1", "brown_conrady", 5, (0,)),
        LensModel("k1k2", "brown_conrady", 5, (0, 1)), LensModel("opencv4", "brown_conrady", 5, (0, 1, 2, 3)),
        LensModel("opencv5", "brown_conrady", 5, (0, 1, 2, 3, 4)), LensModel("opencv8", "brown_conrady", 8, tuple(range(8))),
        LensModel("opencv12", "brown_conrady", 12, tuple(range(12))), LensModel("fisheye", "fisheye", 4, (0, 1, 2, 3)),
    )
}  # fmt: skip
"""Every model of a lens that can be estimated, leanest first."""


@dataclass(frozen=True, eq=False)
class Sight:
    """One picture of the board.

    Attributes:
        camera: which camera took it, from 0.
        frame: which place of the board it shows; pictures taken at once share one.
        view: what was seen.
    """

    camera: int
    frame: int
    view: BoardView


@dataclass(frozen=True, eq=False)
class State:
    """The unknowns.

    Attributes:
        intrinsics: per camera (f_px, aspect, cx_px, cy_px, distortion...).
        relative: camera_from_first of each camera after the first.
        boards: first_camera_from_board of all frames, with a leading axis.
        warp_m: how far the board's middle bulges away from the camera, along its width and along its height.
    """

    intrinsics: tuple[Array, ...]
    relative: tuple[Pose, ...]
    boards: Pose
    warp_m: Array = field(default_factory=lambda: np.zeros(2))


@dataclass(frozen=True, eq=False)
class _Block:
    """All points that one camera saw, padded to (frames, most points of a frame); a weight of 0 marks the padding."""

    ids: Indices
    seen_px: Array
    weight: Array


@dataclass(frozen=True, eq=False)
class Problem:
    """What is to be explained.

    Attributes:
        board: its points are known up to their common scale, which the pictures cannot tell.
        sights: the pictures.
        models: the lens of each camera.
        sizes_px: width and height of each camera's pictures.
        free_aspect: whether pixels may be other than square.
        free_warp: whether the board may be bowed.
        held: whether the cameras are held and only the board's places are sought.
    """

    board: Board
    sights: tuple[Sight, ...]
    models: tuple[LensModel, ...]
    sizes_px: tuple[tuple[int, int], ...]
    free_aspect: bool = True
    free_warp: bool = False
    held: bool = False

    @cached_property
    def frames(self) -> int:
        """How many places of the board there are."""
        return 1 + max(s.frame for s in self.sights)

    @cached_property
    def blocks(self) -> tuple[_Block, ...]:
        """The points by camera."""
        return tuple(self._block(camera) for camera in range(len(self.models)))

    def _block(self, camera: int) -> _Block:
        mine = [s for s in self.sights if s.camera == camera]
        shape = (self.frames, max((s.view.ids.size for s in mine), default=1))
        ids, seen, weight = np.zeros(shape, int), np.zeros((*shape, 2)), np.zeros(shape)
        for s in mine:
            n = s.view.ids.size
            ids[s.frame, :n], seen[s.frame, :n], weight[s.frame, :n] = s.view.ids, s.view.points_px, 1 / s.view.sigma_px
        return _Block(ids, seen, weight)

    def subset(self, frames: Sequence[int]) -> Problem:
        """The same with these frames only, numbered anew."""
        number = {frame: i for i, frame in enumerate(frames)}
        kept = tuple(replace(s, frame=number[s.frame]) for s in self.sights if s.frame in number)
        return replace(self, sights=kept)

    @cached_property
    def free(self) -> Indices:
        """Which of all global unknowns are estimated: intrinsics of all cameras, relative poses, warp."""
        if self.held:
            return np.zeros(0, int)
        kept: list[int] = []
        at = 0
        for model in self.models:
            kept += [at, *([at + 1] if self.free_aspect else []), at + 2, at + 3, *(at + 4 + k for k in model.free)]
            at += 4 + model.count
        kept += range(at, at + 6 * (len(self.models) - 1))
        at += 6 * (len(self.models) - 1)
        return np.array(kept + ([at, at + 1] if self.free_warp else []), int)

    @cached_property
    def size(self) -> int:
        """Number of all global unknowns, estimated or not."""
        return sum(4 + m.count for m in self.models) + 6 * (len(self.models) - 1) + 2

    @cached_property
    def shape_m(self) -> Array:
        """(points, 2) how far each point of the board goes along with either warp."""
        xy = self.board.points_m[:, :2]
        middle = (xy.max(0) + xy.min(0)) / 2
        return np.asarray(1 - ((xy - middle) / ((xy.max(0) - xy.min(0)) / 2)) ** 2)


@dataclass(frozen=True, eq=False)
class Adjusted:
    """A solution.

    Attributes:
        problem: what was explained.
        state: the unknowns.
        cov: of all global unknowns, in the order of `Problem.free`'s indices; rows of what was held are 0.
        residuals_px: per camera (frames, points, 2), project - seen; NaN where there is no point.
        chi2: sum of squared residuals over sigma.
        dof: degrees of freedom.
    """

    problem: Problem
    state: State
    cov: Array
    residuals_px: tuple[Array, ...]
    chi2: float
    dof: int

    @property
    def factor(self) -> float:
        """The noise seen over the detector's own sigma; the covariance goes by what is seen."""
        return float(np.sqrt(self.chi2 / self.dof))

    @property
    def rms_px(self) -> float:
        """Root mean square distance between points projected and seen, as cv2.calibrateCamera gives it."""
        all_px = np.concatenate([r[np.isfinite(r)] for r in self.residuals_px])
        return float(np.sqrt(2 * np.mean(all_px**2)))

    def rms_of_frames_px(self, camera: int = 0) -> Array:
        """(frames,) the same for each picture of a camera; NaN where it took none."""
        r2 = np.sum(self.residuals_px[camera] ** 2, -1)
        count = np.isfinite(r2).sum(1)
        with np.errstate(invalid="ignore"):
            return np.asarray(np.sqrt(np.nansum(r2, 1) / np.where(count, count, np.nan)))

    def camera(self, index: int = 0, source: str = "calibrated") -> Camera:
        """A camera with its covariance."""
        width, height = self.problem.sizes_px[index]
        model, first = self.problem.models[index], self.first(index)
        f, aspect, cx, cy, *k = self.state.intrinsics[index]
        n = 4 + model.count
        return Camera(width, height, f, cx, cy, aspect, model.lens, np.array(k), self.cov[first : first + n, first : first + n],
                      source)  # fmt: skip

    def first(self, index: int) -> int:
        """Where a camera's numbers begin among the global unknowns."""
        return sum(4 + m.count for m in self.problem.models[:index])


# -- projection and its derivatives ------------------------------------------------------------------------------------


def _plane(lens: str, points: Array, k: Array) -> tuple[Array, Array]:
    """Normalised coordinates by the smooth formula: where a lens folds is asked when the solution stands."""
    return (LENSES[lens].formula or LENSES[lens].to_plane)(points[..., 0], points[..., 1], points[..., 2], list(k))


def project(lens: str, intrinsics: Array, points_m: Array) -> Array:
    """(..., 2) pixels of points in the camera frame."""
    x, y = _plane(lens, points_m, intrinsics[4:])
    f, aspect, cx, cy = intrinsics[:4]
    return np.stack([f * x + cx, f * aspect * y + cy], -1)


def projection(lens: str, intrinsics: Array, points_m: Array, free: Sequence[int]) -> tuple[Array, Array, Array]:
    """Pixels, their derivatives (..., 2, 4 + k) by the intrinsics and (..., 2, 3) by the points.

    Those of the lens by differences, which serve every lens model; coefficients that are not `free` get 0.
    """
    f, aspect, cx, cy = intrinsics[:4]
    k = intrinsics[4:]
    x, y = _plane(lens, points_m, k)
    scale = np.array([f, f * aspect])
    pixels = np.stack([f * x + cx, f * aspect * y + cy], -1)
    inner = np.zeros((*x.shape, 2, 4 + k.size))
    inner[..., 0, 0], inner[..., 1, 0], inner[..., 1, 1] = x, aspect * y, f * y
    inner[..., 0, 2] = inner[..., 1, 3] = 1
    for i in free:
        inner[..., 4 + i] = _by_coefficient(lens, points_m, k, i, (x, y)) * scale
    return pixels, inner, _by_point(lens, points_m, k) * scale[:, None]


def _by_coefficient(lens: str, points_m: Array, k: Array, i: int, here: tuple[Array, Array]) -> Array:
    """(..., 2) exact where the image is linear in a coefficient, by central differences else."""
    unit = np.eye(k.size)[i]
    if i in LENSES[lens].linear:
        return _difference(_plane(lens, points_m, k + unit), here, 1.0)
    step = 1e-5
    return _difference(_plane(lens, points_m, k + step * unit), _plane(lens, points_m, k - step * unit), 2 * step)


def _by_point(lens: str, points_m: Array, k: Array) -> Array:
    """(..., 2, 3) by central differences; only the direction counts, so x d/dx + y d/dy + z d/dz = 0."""
    z = points_m[..., 2]
    far = np.linalg.norm(points_m, axis=-1)
    reach = 1e-6 * far[..., None]
    found = np.empty((*z.shape, 2, 3))
    sideways = bool(np.any(abs(z) < 0.01 * far))
    for i in range(3 if sideways else 2):
        step = np.eye(3)[i] * reach
        found[..., i] = _difference(_plane(lens, points_m + step, k), _plane(lens, points_m - step, k), 2 * reach)
    if not sideways:
        found[..., 2] = -(found[..., 0] * points_m[..., :1] + found[..., 1] * points_m[..., 1:2]) / z[..., None]
    return found


def _difference(above: tuple[Array, Array], below: tuple[Array, Array], step: float | Array) -> Array:
    return np.asarray(np.stack([above[0] - below[0], above[1] - below[1]], -1) / step)


def board_points(problem: Problem, state: State, ids: Indices) -> Array:
    """(..., 3) points of the board in its own frame, bowed as the state says."""
    points = problem.board.points_m[ids]
    points[..., 2] = problem.shape_m[ids] @ state.warp_m
    return points


def _placed(problem: Problem, state: State, camera: int, ids: Indices) -> tuple[Array, Array]:
    """Points in the first camera's frame, and in this camera's."""
    first = state.boards.apply(board_points(problem, state, ids))
    return first, first if camera == 0 else state.relative[camera - 1].apply(first)


def residuals(problem: Problem, state: State) -> list[Array]:
    """Per camera (frames, points, 2) px: projected - seen, as they are; NaN where a point can't be projected."""
    found = []
    for camera, block in enumerate(problem.blocks):
        points = _placed(problem, state, camera, block.ids)[1]
        lens = problem.models[camera].lens
        found.append(project(lens, state.intrinsics[camera], points) - block.seen_px)
    return found


def linearised(problem: Problem, state: State, camera: int, ids: Indices) -> tuple[Array, Array, Array]:
    """Pixels (frames, n, 2) of board points, with derivatives (frames, n, 2, globals) and (frames, n, 2, 6).

    Poses are perturbed on the left: rotated = exp(w) R point, then moved by t + dt.
    """
    model, first = problem.models[camera], sum(4 + m.count for m in problem.models[:camera])
    begin, points = _placed(problem, state, camera, ids)
    pixels, inner, outer = projection(model.lens, state.intrinsics[camera], points, model.free)
    by_global = np.zeros((*pixels.shape, problem.size))
    by_global[..., first : first + 4 + model.count] = inner
    if camera:
        turned = points - state.relative[camera - 1].translation_m
        at = problem.size - 2 - 6 * (len(problem.models) - camera)
        by_global[..., at : at + 3] = np.cross(turned[..., None, :], outer)
        by_global[..., at + 3 : at + 6] = outer
        outer = outer @ state.relative[camera - 1].rotation
    turned = begin - state.boards.translation_m[:, None]
    by_board = np.concatenate([np.cross(turned[..., None, :], outer), outer], -1)
    bulge = outer @ state.boards.rotation[:, None, :, 2:]
    by_global[..., -2:] = bulge * problem.shape_m[ids][..., None, :]
    return pixels, by_global, by_board


RATIONAL = (5, 6, 7)
"""The coefficients of the denominator of a rational lens model."""
RATIONAL_U = 0.5
"""A weak prior on them, as the size of each term in the picture's corner: numerator and denominator can cancel, and then
pictures alone leave them open."""


def _precision(problem: Problem, state: State) -> tuple[Array, Array]:
    """(globals,) what is known beforehand of each unknown, as 1 / u^2, and its value less what is expected: rational terms only."""
    known, off = np.zeros(problem.size), np.zeros(problem.size)
    at = 0
    for model, theta, size in zip(problem.models, state.intrinsics, problem.sizes_px, strict=True):
        corner2 = (size[0] ** 2 + size[1] ** 2) / 4 / theta[0] ** 2
        for power, k in enumerate(RATIONAL, 1):
            if k in model.free and model.lens == "brown_conrady":
                known[at + 4 + k], off[at + 4 + k] = (corner2**power / RATIONAL_U) ** 2, theta[4 + k]
        at += 4 + model.count
    return known, off


# -- the normal equations ------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Normal:
    """J^T J and J^T r, poses (frames) apart from global unknowns."""

    u: Array
    w: Array
    v: Array
    g_global: Array
    g_board: Array


def _normal(problem: Problem, state: State) -> _Normal:
    free = problem.free
    n, frames = free.size, problem.frames
    u, w, v = np.zeros((n, n)), np.zeros((frames, n, 6)), np.zeros((frames, 6, 6))
    g_global, g_board = np.zeros(n), np.zeros((frames, 6))
    for camera, block in enumerate(problem.blocks):
        pixels, by_global, by_board = linearised(problem, state, camera, block.ids)
        weight = np.repeat(block.weight[..., None], 2, -1).reshape(frames, -1, 1)
        present, rows = weight > 0, weight.shape[1]
        jg = np.where(present, by_global[..., free].reshape(frames, rows, n) * weight, 0.0)
        jb = np.where(present, by_board.reshape(frames, rows, 6) * weight, 0.0)
        r = np.where(present, (pixels - block.seen_px).reshape(frames, rows, 1) * weight, 0.0)
        flat = jg.reshape(frames * rows, n)
        u += flat.T @ flat
        w += jg.swapaxes(1, 2) @ jb
        v += jb.swapaxes(1, 2) @ jb
        g_global += flat.T @ r.reshape(-1)
        g_board += (jb.swapaxes(1, 2) @ r)[..., 0]
    known, off = _precision(problem, state)
    return _Normal(u + np.diag(known[free]), w, v, g_global + (known * off)[free], g_board)


def _step(normal: _Normal, damping: float) -> tuple[Array, Array]:
    """The Levenberg-Marquardt step of global unknowns and poses."""
    v = normal.v + damping * np.eye(6) * np.einsum("fii->fi", normal.v)[:, None, :]
    u = normal.u + damping * np.diag(np.diag(normal.u))
    wv = np.linalg.solve(v, normal.w.swapaxes(1, 2)).swapaxes(1, 2)
    reduced = u - np.einsum("fik,fjk->ij", wv, normal.w)
    right = -normal.g_global + np.einsum("fik,fk->i", wv, normal.g_board)
    scale = 1 / np.sqrt(np.diag(u))
    step = scale * np.linalg.solve(reduced * np.outer(scale, scale), right * scale)
    poses = np.linalg.solve(v, (-normal.g_board - np.einsum("fik,i->fk", normal.w, step))[..., None])[..., 0]
    return step, poses


def _reduced(normal: _Normal) -> Array:
    """The information on the global unknowns when every board pose is unknown."""
    wv = np.linalg.solve(normal.v, normal.w.swapaxes(1, 2)).swapaxes(1, 2)
    return np.asarray(normal.u - np.einsum("fik,fjk->ij", wv, normal.w))


def reduced(problem: Problem, state: State) -> tuple[Array, list[Array]]:
    """The information on the free global unknowns with all poses unknown, and how each point's pixels enter the right side.

    Returns:
        (n, n), and per camera (frames, points, n, 2): the right side moves by this times a shift of the point in px.
    """
    normal = _normal(problem, state)
    wv = np.linalg.solve(normal.v, normal.w.swapaxes(1, 2)).swapaxes(1, 2)
    gains = []
    for camera, block in enumerate(problem.blocks):
        _, by_global, by_board = linearised(problem, state, camera, block.ids)
        apart = by_global[..., problem.free] - np.einsum("fik,fpdk->fpdi", wv, by_board)
        gains.append(
            np.where(
                block.weight[..., None, None] > 0, apart.swapaxes(-1, -2) * block.weight[..., None, None] ** 2, 0.0
            )
        )
    return _reduced(normal), gains


def inverse(information: Array) -> Array:
    """The covariance of an information matrix.

    Raises:
        GeometryError: it leaves a direction open.
    """
    if not information.size:
        return information
    with np.errstate(all="ignore"):
        scale = 1 / np.sqrt(np.diag(information))
        values, vectors = np.linalg.eigh(np.nan_to_num(information * np.outer(scale, scale)))
    if not np.all(np.isfinite(scale)) or values[0] < 1e-13 * values[-1]:
        raise GeometryError("these views leave the camera open: take pictures of the board tilted by 30 to 45 degrees in "
                            "several directions, all over the picture", code="degenerate_views")  # fmt: skip
    half = scale[:, None] * vectors / np.sqrt(values)
    return np.asarray(half @ half.T)


# -- the solver ----------------------------------------------------------------------------------------------------------


def _moved(problem: Problem, state: State, step: Array, poses: Array) -> State:
    """The state after a step."""
    whole = np.zeros(problem.size)
    whole[problem.free] = step
    intrinsics, at = [], 0
    for old in state.intrinsics:
        intrinsics.append(old + whole[at : at + old.size])
        at += old.size
    relative = []
    for old_pose in state.relative:
        relative.append(_perturbed(old_pose, whole[at : at + 6]))
        at += 6
    return State(tuple(intrinsics), tuple(relative), _perturbed(state.boards, poses), state.warp_m + whole[-2:])


def _perturbed(pose: Pose, step: Array) -> Pose:
    return Pose(rotation_from_vector(step[..., :3]) @ pose.rotation, pose.translation_m + step[..., 3:])


def _cost(problem: Problem, state: State) -> float:
    """Sum of squared weighted residuals; infinite where a point can't be projected or a focal length is not above 0."""
    if any(i[0] <= 0 or i[1] <= 0 for i in state.intrinsics):
        return np.inf
    total = 0.0
    for block, r in zip(problem.blocks, residuals(problem, state), strict=True):
        present = block.weight > 0
        total += float(np.sum((r[present] * block.weight[present][:, None]) ** 2))
    known, off = _precision(problem, state)
    total += float(known @ off**2)
    return total if np.isfinite(total) and not _has_pole(problem, state) else np.inf


def _has_pole(problem: Problem, state: State) -> bool:
    """Whether the denominator of a rational lens comes near 0 in the picture: the numerator would have to cancel it."""
    for model, theta, size in zip(problem.models, state.intrinsics, problem.sizes_px, strict=True):
        if model.lens == "brown_conrady" and model.count >= 8:
            r2 = np.linspace(0, 1.5, 16) * (size[0] ** 2 + size[1] ** 2) / 4 / theta[0] ** 2
            if np.min(1 + r2 * (theta[9] + r2 * (theta[10] + r2 * theta[11]))) < 0.2:
                return True
    return False


WARM = 1e-7
"""Damping for a start that is nearly a solution."""


def adjust(problem: Problem, start: State, iterations: int = 60, damping: float = 1e-3) -> Adjusted:
    """The least-squares solution from a start.

    Args:
        problem: what is to be explained.
        start: where to begin.
        iterations: at most.
        damping: of the first step; WARM where the start is nearly a solution.

    Raises:
        GeometryError: the views leave something open (`degenerate_views`), or no solution was reached (`no_convergence`).
    """
    state, cost = start, _cost(problem, start)
    if not np.isfinite(cost):
        raise GeometryError("the calibration found no start: points can't be projected", code="no_convergence")
    for _ in range(iterations):
        normal = _normal(problem, state)
        state, new, damping, moved = _descend(problem, state, cost, normal, damping)
        done = moved and cost - new <= CONVERGED * new and damping < 1e-2
        cost = new
        if done or not moved:
            break
    _check_folds(problem, state)
    cov, dof = _covariance(problem, state, cost)
    return Adjusted(problem, state, cov, _kept(problem, state), cost, dof)


def _descend(
    problem: Problem, state: State, cost: float, normal: _Normal, damping: float
) -> tuple[State, float, float, bool]:
    """One step downhill, with as much damping as it takes; whether there was one."""
    while damping < 1e8:
        try:
            trial = _moved(problem, state, *_step(normal, damping))
        except np.linalg.LinAlgError:
            damping *= 10
            continue
        new = _cost(problem, trial)
        if new <= cost:
            return trial, new, max(damping / 10, 1e-12), True
        damping *= 10
    return state, cost, damping, False


def _check_folds(problem: Problem, state: State) -> None:
    """Refuse a lens whose image folds over within what was seen: it has no way back from pixels to directions."""
    for camera, block in enumerate(problem.blocks):
        points = _placed(problem, state, camera, block.ids)[1][block.weight > 0]
        lens, k = problem.models[camera].lens, state.intrinsics[camera][4:]
        if not np.all(np.isfinite(LENSES[lens].to_plane(points[:, 0], points[:, 1], points[:, 2], list(k))[0])):
            raise GeometryError(f"the lens model {problem.models[camera].name} folds over in the picture; give another --model",
                                code="lens_folds")  # fmt: skip


def _kept(problem: Problem, state: State) -> tuple[Array, ...]:
    """Residuals in px, NaN in the padding."""
    return tuple(np.where(b.weight[..., None] > 0, r, np.nan)
                 for b, r in zip(problem.blocks, residuals(problem, state), strict=True))  # fmt: skip


def _covariance(problem: Problem, state: State, chi2: float) -> tuple[Array, int]:
    """Of all global unknowns, scaled by the noise that was seen."""
    count = 2 * sum(int((b.weight > 0).sum()) for b in problem.blocks)
    dof = count - problem.free.size - 6 * problem.frames
    if dof < 1:
        raise GeometryError(f"{count // 2} points can't tell {problem.free.size + 6 * problem.frames} unknowns: take more "
                            "pictures", code="too_few_views")  # fmt: skip
    cov = np.zeros((problem.size, problem.size))
    cov[np.ix_(problem.free, problem.free)] = inverse(_reduced(_normal(problem, state))) * chi2 / dof
    return cov, dof
