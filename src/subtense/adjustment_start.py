"""Where a bundle adjustment starts: focal lengths by trying, board poses by homographies, relative poses by their median.

Source: Z. Zhang, "A flexible new technique for camera calibration", 2000, section 3.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .adjustment import Problem, Sight, State, project
from .arrays import Array
from .camera import Camera
from .errors import GeometryError
from .geometry import Pose


def start_state(problem: Problem, intrinsics: Sequence[Array] | None = None) -> State:
    """Where to start: lenses without distortion and a middle in the picture's; focal lengths by the best fit of a few.

    Args:
        problem: what is to be explained.
        intrinsics: of each camera where they are known.

    Raises:
        GeometryError: no start (`no_convergence`).
    """
    thetas = intrinsics or [_start_of(problem, camera) for camera in range(len(problem.models))]
    found = [_poses(problem, camera, theta) for camera, theta in enumerate(thetas)]
    firsts = found[0]
    relative = []
    for camera in range(1, len(found)):
        relative.append(_relative(firsts, found[camera]))
        for frame, pose in found[camera].items():  # frames that the first camera did not see
            if frame not in firsts:
                firsts[frame] = _chained(relative[-1].inverse(), pose)
    missing = [f for f in range(problem.frames) if f not in firsts]
    if missing:
        raise GeometryError("no start for a picture of the board", code="no_convergence")
    ordered = [firsts[f] for f in range(problem.frames)]
    boards = Pose(np.stack([p.rotation for p in ordered]), np.stack([p.translation_m for p in ordered]))
    return State(tuple(thetas), tuple(relative), boards)


def _chained(a_from_b: Pose, b_from_c: Pose) -> Pose:
    return Pose(
        a_from_b.rotation @ b_from_c.rotation, a_from_b.rotation @ b_from_c.translation_m + a_from_b.translation_m
    )


def _relative(firsts: dict[int, Pose], own: dict[int, Pose]) -> Pose:
    """camera_from_first by the median over the frames that both saw."""
    both = sorted(set(firsts) & set(own))
    if not both:
        raise GeometryError("no two pictures show the board to both cameras at once", code="no_common_views")
    each = [_chained(own[f], firsts[f].inverse()) for f in both]
    u, _, vt = np.linalg.svd(np.sum([p.rotation for p in each], 0))
    rotation = u @ np.diag([1, 1, np.linalg.det(u @ vt)]) @ vt
    return Pose(rotation, np.median([p.translation_m for p in each], 0))


def _poses(problem: Problem, camera: int, theta: Array) -> dict[int, Pose]:
    """The board's place in each frame that a camera saw."""
    sights = [s for s in problem.sights if s.camera == camera]
    poses = {s.frame: _pose_of(problem, s, theta, problem.models[camera].lens)[0] for s in sights}
    return {frame: pose for frame, pose in poses.items() if pose is not None}


def _start_of(problem: Problem, camera: int) -> Array:
    """Intrinsics of one camera, by trying focal lengths from a fisheye's to a long lens's."""
    width, height = problem.sizes_px[camera]
    model = problem.models[camera]
    sights = [s for s in problem.sights if s.camera == camera]
    best: tuple[float, Array] | None = None
    for f in max(width, height) * np.geomspace(0.25, 12, 18):
        theta = np.concatenate([[f, 1.0, (width - 1) / 2, (height - 1) / 2], np.zeros(model.count)])
        cost = float(np.median([_pose_of(problem, s, theta, model.lens)[1] for s in sights[:: 1 + len(sights) // 6]]))
        if np.isfinite(cost) and (best is None or cost < best[0]):
            best = (cost, theta)
    if best is None:
        raise GeometryError("no start for the camera: the points fit no flat board", code="no_convergence")
    return best[1]


def _pose_of(problem: Problem, sight: Sight, theta: Array, lens: str) -> tuple[Pose | None, float]:
    """A board's pose by the homography from the board to the plane at depth 1, and its rms in px."""
    width, height = problem.sizes_px[sight.camera]
    camera = Camera(width, height, theta[0], theta[2], theta[3], theta[1], lens, theta[4:])
    x, y = camera.slopes(sight.view.points_px)
    ok = np.hypot(x, y) < 4.0  # nearer to 90 degrees off the axis they say little, in no plane
    if ok.sum() < 4:
        return None, np.inf
    board = problem.board.points_m[sight.view.ids]
    pose = pose_of_plane(board[ok, :2], np.column_stack([x, y])[ok])
    if pose is None:
        return None, np.inf
    off = project(lens, theta, pose.apply(board)) - sight.view.points_px
    return pose, float(np.sqrt(np.nanmean(np.sum(off**2, -1))))


def pose_of_plane(plane_m: Array, slopes: Array) -> Pose | None:
    """camera_from_plane of a flat target by its homography (Zhang 2000, 3.1); None where its points lie on a line."""
    middle, spread = plane_m.mean(0), max(float(np.ptp(plane_m)), 1e-12)
    p = (plane_m - middle) / spread
    one, zero = np.ones(len(p)), np.zeros((len(p), 3))
    ph = np.column_stack([p, one])
    rows = np.concatenate([np.hstack([ph, zero, -slopes[:, :1] * ph]), np.hstack([zero, ph, -slopes[:, 1:] * ph])])
    _, singular, vt = np.linalg.svd(rows, full_matrices=False)
    if len(singular) < 9 or singular[-2] < 1e-9 * singular[0]:
        return None
    h = vt[-1].reshape(3, 3)
    h = h * np.sign(h[2, 2] or 1.0)
    scale = 2 / (np.linalg.norm(h[:, 0]) + np.linalg.norm(h[:, 1]))
    a, b, t = (h * scale).T
    u, _, v = np.linalg.svd(np.column_stack([a, b, np.cross(a, b)]))
    rotation = u @ np.diag([1, 1, np.linalg.det(u @ v)]) @ v
    return Pose(rotation, t * spread - rotation[:, :2] @ middle)
