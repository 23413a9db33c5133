"""What a camera's covariance means over its picture, and which picture would make it smaller.

A shift of the principal point that a turn of the camera undoes is no error of any distance, so the turn that fits best is
taken out before (mrcal, "Projection uncertainty", does the same by the boards' poses).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .adjustment import Adjusted, Problem, Sight, State, linearised, projection, reduced
from .arrays import Array
from .board import BoardView
from .camera import Camera
from .geometry import Pose, rotation_from_vector

PLACES = {"left": 0.2, "middle": 0.5, "right": 0.8}, {"top": 0.2, "middle": 0.5, "bottom": 0.8}
TILT_RAD = np.radians(40.0)
TURNS = {
    "facing the camera": (0.0, 0.0), "its left side tilted away by 40 degrees": (0.0, -1.0),
    "its right side tilted away by 40 degrees": (0.0, 1.0), "its top tilted away by 40 degrees": (1.0, 0.0),
    "its bottom tilted away by 40 degrees": (-1.0, 0.0),
}  # fmt: skip
SHARES = (0.35, 0.65)
"""Parts of the picture's shorter side that the proposed board's longer side spans."""
WORTHWHILE = 0.03
"""A picture that lowers the mean uncertainty by less is not worth proposing."""


@dataclass(frozen=True, eq=False)
class UncertaintyMap:
    """Over a grid of pixels.

    Attributes:
        x_px: (columns,) of the grid.
        y_px: (rows,) of the grid.
        u_px: (rows, columns) standard deviation of where a known direction is seen, along its worse axis; NaN where the lens
            model has no direction.
        relative_u_range: (rows, columns) relative standard deviation of a range from a known size seen there.
    """

    x_px: Array
    y_px: Array
    u_px: Array
    relative_u_range: Array


def uncertainty_map(camera: Camera, columns: int = 33, rows: int = 25) -> UncertaintyMap:
    """What the camera's covariance means at each place of the picture; all zero where it has none."""
    x = np.linspace(0, camera.width_px - 1, columns)
    y = np.linspace(0, camera.height_px - 1, rows)
    grid = np.stack(np.meshgrid(x, y), -1).reshape(-1, 2)
    _, turn = _moves(camera, grid, None)
    shape = (rows, columns)
    return UncertaintyMap(
        x, y, uncertainty_at(camera, grid).reshape(shape), _scale_u(camera, grid, turn).reshape(shape)
    )


def uncertainty_at(camera: Camera, points_px: Array, *, turned: bool = True) -> Array:
    """(N,) standard deviation of where known directions are seen, px, along its worse axis; NaN where there is no direction.

    Args:
        camera: with its covariance.
        points_px: (N, 2).
        turned: whether the turn of the camera that fits best is taken out.
    """
    n = 4 + camera.coefficients.size
    moves, _ = _moves(camera, points_px, None if turned else np.zeros((3, n)))
    each = moves @ _cov(camera) @ moves.swapaxes(-1, -2)
    good = np.isfinite(each).all((1, 2))
    u = np.full(len(points_px), np.nan)
    u[good] = np.sqrt(np.linalg.eigvalsh(each[good])[:, -1].clip(0))
    return u


def _cov(camera: Camera) -> Array:
    return np.zeros((4 + camera.coefficients.size,) * 2) if camera.cov is None else camera.cov


def _moves(camera: Camera, points_px: Array, turn: Array | None) -> tuple[Array, Array]:
    """(N, 2, n) how pixels of fixed directions move with each intrinsic number, less a turn of the camera, and that turn (3, n)."""
    rays = camera.rays(points_px)
    theta = np.concatenate([[camera.f_px, camera.aspect, camera.cx_px, camera.cy_px], camera.coefficients])
    _, inner, outer = projection(camera.lens, theta, rays, range(camera.coefficients.size))
    by_turn = np.cross(rays[:, None, :], outer)
    if turn is None:
        turn = _best_turn(inner, by_turn)
    return inner - by_turn @ turn, turn


def _best_turn(inner: Array, by_turn: Array) -> Array:
    """(3, n) the turn of the camera that undoes most of what each number moves."""
    good = np.isfinite(inner).all((1, 2)) & np.isfinite(by_turn).all((1, 2))
    n = inner.shape[-1]
    return np.asarray(np.linalg.lstsq(by_turn[good].reshape(-1, 3), inner[good].reshape(-1, n), rcond=None)[0])


def _scale_u(camera: Camera, grid: Array, turn: Array) -> Array:
    """(N,) relative u of the size of something small seen at each point: half the divergence of the moves."""
    reach = 2.0
    ends = [
        _moves(camera, grid + np.array(step), turn)[0] for step in ((reach, 0), (-reach, 0), (0, reach), (0, -reach))
    ]
    growth = ((ends[0] - ends[1])[:, 0] + (ends[2] - ends[3])[:, 1]) / (4 * reach)
    return np.asarray(np.sqrt(np.einsum("pi,ij,pj->p", growth, _cov(camera), growth).clip(0)))


# -- the next picture -----------------------------------------------------------------------------------------------------


def next_picture(solution: Adjusted) -> str:
    """In words: the picture of the board that would lower the camera's mean uncertainty most."""
    information, _ = reduced(solution.problem, solution.state)
    words, gained = _candidates(solution)
    if not words:
        return "take more pictures, with the whole board in them"
    want = _mean_moves(solution)
    before = float(np.trace(np.linalg.solve(information, want)))
    after = np.trace(np.linalg.solve(information[None] + gained, np.broadcast_to(want, gained.shape)), axis1=1, axis2=2)
    best = int(np.argmin(after))
    u_before, u_after = (solution.factor * np.sqrt(max(v, 0.0) / 2) for v in (before, float(after[best])))
    if u_after > (1 - WORTHWHILE) * u_before:
        return f"no single picture helps much: four times as many like these halve the mean uncertainty of {u_before:.2g} px"
    return f"{words[best]}; it lowers the mean uncertainty from {u_before:.2g} to {u_after:.2g} px"


def _mean_moves(solution: Adjusted) -> Array:
    """The matrix whose trace with a covariance of the free unknowns is the mean squared move of a pixel."""
    camera = solution.camera()
    x, y = np.meshgrid(np.linspace(0, camera.width_px - 1, 9), np.linspace(0, camera.height_px - 1, 7))
    moves, _ = _moves(camera, np.column_stack([x.ravel(), y.ravel()]), None)
    moves = moves[np.isfinite(moves).all((1, 2))]
    whole = np.zeros((solution.problem.size,) * 2)
    n = moves.shape[-1]
    whole[:n, :n] = np.einsum("pdi,pdj->ij", moves, moves) / len(moves)
    free = solution.problem.free
    return whole[np.ix_(free, free)]


def _candidates(solution: Adjusted) -> tuple[list[str], Array]:
    """Pictures one could take, in words, and the information (n, n) that each adds."""
    problem, camera = solution.problem, solution.camera()
    words, poses = [], []
    for share in SHARES:
        for across, x in PLACES[0].items():
            for down, y in PLACES[1].items():
                for how, turn in TURNS.items():
                    pose = _board_at(problem, camera, share, (x, y), np.array([*turn, 0.0]) * TILT_RAD)
                    if pose is not None:
                        place = "the middle" if across == down else f"the {down} {across}"
                        words.append(f"next, the board in {place} of the picture, {how}, "
                                     f"spanning {share:.0%} of its shorter side".replace("%", " %"))  # fmt: skip
                        poses.append(pose)
    if not poses:
        return [], np.zeros((0, 0, 0))
    return words, _information(solution, poses)


def _board_at(
    problem: Problem, camera: Camera, share: float, place: tuple[float, float], turn_rad: Array
) -> Pose | None:
    """A board's pose at a place of the picture; None where it would not be wholly in it."""
    points = problem.board.points_m
    middle = points.mean(0)
    size_m = float(np.ptp(points, axis=0).max())
    ray = camera.rays(np.array([[place[0] * camera.width_px, place[1] * camera.height_px]]))[0]
    depth = float(camera.f_px) * size_m / (share * min(camera.width_px, camera.height_px))
    if not np.all(np.isfinite(ray)) or ray[2] < 0.05:
        return None
    rotation = rotation_from_vector(turn_rad)
    pose = Pose(rotation, ray / ray[2] * depth - rotation @ middle)
    seen = camera.project(pose.apply(points))
    inside = (seen > 0).all() and (seen < [camera.width_px - 1, camera.height_px - 1]).all()
    return pose if inside else None


def _information(solution: Adjusted, poses: list[Pose]) -> Array:
    """(poses, n, n) what a picture of the board at each pose tells of the free unknowns, its own pose being unknown."""
    problem = solution.problem
    board = problem.board
    sigma = float(np.median(np.concatenate([s.view.sigma_px for s in problem.sights])))
    ids = np.arange(len(board.points_m))
    view = BoardView("", *problem.sizes_px[0], ids, np.zeros((ids.size, 2)), np.full(ids.size, sigma))
    boards = Pose(np.stack([p.rotation for p in poses]), np.stack([p.translation_m for p in poses]))
    trial = replace(problem, sights=tuple(Sight(0, i, view) for i in range(len(poses))))
    state: State = replace(solution.state, boards=boards)
    _, by_global, by_board = linearised(trial, state, 0, np.broadcast_to(ids, (len(poses), ids.size)))
    jg = by_global[..., problem.free].reshape(len(poses), -1, problem.free.size) / sigma
    jb = by_board.reshape(len(poses), -1, 6) / sigma
    w, v = jg.swapaxes(1, 2) @ jb, jb.swapaxes(1, 2) @ jb
    return np.asarray(jg.swapaxes(1, 2) @ jg - w @ np.linalg.solve(v, w.swapaxes(1, 2)))
