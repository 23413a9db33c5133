"""A plane as it is seen: picture coordinates without the lens's distortion, and the nominal fit of reference points to them.

With a camera the coordinates are slopes of viewing directions. Without one they are pixels, from which a radial distortion of
unknown size is taken: a point at r of the half diagonal from the picture's middle is moved by the share d r^2 of its distance, so that
d is the share in the corner. Its value is 0, and its doubt goes through everything that follows.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .arrays import Array
from .camera import Camera
from .errors import InputError
from .geometry import Pose
from .homography import FLOOR_PX, Fit, covariance_by, fit, mirrored, pose_of, settled_pose, transfer
from .observation import Observation
from .quantity import Note, Quantity
from .target import Target

MOST_POINTS = 100
"""Reference points beyond these tell nothing more, and their budget takes minutes."""
UNKNOWN_DISTORTION = 0.02
"""u of the radial distortion in the corner of a picture of which nothing is known, as share of the distance from the middle."""
ASSUMED = "assumed: no distortion"


def unknown_distortion() -> Quantity:
    """A lens of which nothing is known: 2 % in the corner."""
    return Quantity.normal(
        0.0, UNKNOWN_DISTORTION, "1", f"{ASSUMED}, {100 * UNKNOWN_DISTORTION:.0f} % (1s) in the corner"
    )


def whole_picture(width_px: int, height_px: int) -> Observation:
    """Two opposite corners of a picture: its middle and half diagonal say where its lens may distort."""
    ends = np.array([[-0.5, -0.5], [width_px - 0.5, height_px - 0.5]])
    return Observation(ends, 0.0, label="picture", source="picture size")


@dataclass(frozen=True, eq=False)
class Disc:
    """The circle through the corners of a picture.

    Attributes:
        middle_px: (2,).
        radius_px: half the diagonal.
    """

    middle_px: Array
    radius_px: float

    @classmethod
    def around(cls, frame: Observation | None, *seen: Observation) -> Disc:
        """Of the picture's corners where they are told; else twice as wide as what was marked, about its middle."""
        if frame is not None:
            one, other = frame.points_px.reshape(-1, 2)[:2]
            return cls((one + other) / 2, max(float(np.hypot(*(other - one))) / 2, 1.0))
        points = np.concatenate([one.points_px.reshape(-1, 2) for one in seen])
        low, high = points.min(axis=0), points.max(axis=0)
        return cls((low + high) / 2, max(float(np.hypot(*(high - low))), 1.0))


def straight_view(camera: Camera | None, points_px: Array, distortion: Quantity, disc: Disc) -> Array:
    """(..., N, 2) slopes with a camera, pixels without the distortion else."""
    if camera is not None:
        return camera.normalised(points_px)
    share = np.asarray(distortion.value)[..., None, None]
    away = points_px - disc.middle_px
    return np.asarray(points_px + share * away * np.sum(away**2, -1, keepdims=True) / disc.radius_px**2)


def check_reference(points: Observation, target: Target) -> None:
    """Four to MOST_POINTS flat points, as many as were marked.

    Raises:
        InputError: they are not.
    """
    seen, known = points.points_px.shape[-2], target.points_m.shape[-2]
    if seen != known or seen < 4:
        raise InputError("points", f"{seen} for {known} of the plane", "give the same number, four or more")
    if seen > MOST_POINTS:
        raise InputError(
            "points", f"{seen} of them", f"give the {MOST_POINTS} that are best spread; more tell nothing more"
        )
    places = target.points_m
    if places.ndim > 2:  # moved or drawn points
        return
    if np.ptp(places[:, 2]) > 1e-9 * max(float(np.ptp(places[:, :2])), 1e-300):
        raise InputError("target", "points that are not flat", "give all of them with the same z, as 0")


@dataclass(frozen=True, eq=False)
class FlatView:
    """The nominal fit of a plane's reference points.

    Attributes:
        fit: the homography.
        disc: where a lens of which nothing is known may distort.
        poses: camera_from_plane with its camera, better first: one, or two that fit; none without a camera.
        chi2: of each pose.
        whiten: of slopes, for the poses.
    """

    fit: Fit
    disc: Disc
    poses: tuple[Pose, ...] = ()
    chi2: tuple[float, ...] = ()
    whiten: Array | None = None


def flat_view(
    camera: Camera | None, points: Observation, target: Target, distortion: Quantity, disc: Disc, *, place: bool = False
) -> FlatView:
    """Fit one nominal scene, weighted by all that is doubtful of where the points are seen.

    Args:
        camera: of the picture, if known.
        points: the reference.
        target: their places, z = 0.
        distortion: of the lens, where there is no camera.
        disc: of the picture.
        place: whether the plane's place is wanted too.
    """
    n = points.points_px.size
    seen = straight_view(camera, points.points_px, distortion, disc)
    scale = np.ones(2) if camera is None else float(camera.f_px) * np.array([1.0, float(camera.aspect)])
    floor = np.diag(np.tile((FLOOR_PX / scale) ** 2, n // 2))
    cov = floor + covariance_by((points,), lambda p: straight_view(camera, p.points_px, distortion, disc), n)
    flat = target.points_m[..., :2]
    first = fit(flat, seen, cov)
    if not np.all(np.isfinite(first.h)):
        return FlatView(first, disc)
    whole = np.linalg.inv(first.seen.matrix) @ first.h @ first.plane.matrix
    # the camera's doubt moves points in proportion to where they are: of where they were clicked it would bias the fit
    smooth = points.points_px + (transfer(whole, flat)[0] - seen) * scale
    cov = cov + covariance_by((camera, distortion), lambda c, d: straight_view(c, smooth, d, disc), n)
    if target.sigma_m:
        cov = cov + covariance_by((target,), lambda t: transfer(whole, t.points_m[..., :2])[0], n)
    first = fit(flat, seen, cov)
    if camera is None or not place or not np.all(np.isfinite(first.h)):
        return FlatView(first, disc)
    return _placed(first, disc, target.points_m, seen, cov)


def _placed(first: Fit, disc: Disc, points_m: Array, seen: Array, cov: Array) -> FlatView:
    """The view with one or two poses of the plane."""
    whiten = np.linalg.inv(np.linalg.cholesky(cov))
    begin = pose_of(first.h, first)
    found: list[tuple[float, Pose]] = []
    for candidate in (begin, mirrored(begin, points_m.mean(axis=0))):
        pose = settled_pose(candidate, points_m, seen, whiten)
        placed = pose.apply(points_m)
        residual = whiten @ (placed[:, :2] / placed[:, 2:] - seen).reshape(-1)
        chi2 = float(residual @ residual)
        again = any(np.allclose(pose.rotation, other.rotation, atol=1e-6) for _, other in found)
        if np.isfinite(chi2) and np.all(placed[:, 2] > 0) and not again:
            found.append((chi2, pose))
    found.sort(key=lambda pair: pair[0])
    return FlatView(first, disc, tuple(p for _, p in found), tuple(c for c, _ in found), whiten)


def reference_notes(view: FlatView, count: int) -> list[Note]:
    """`points_misfit` where the reference points contradict each other, `points_unchecked` where nothing would show it."""
    if view.fit.freedom <= 0:
        return [Note("points_unchecked", f"{count} reference points fit any plane: a wrong click or a wrong order can't be noticed",
                     "give a fifth point of the plane")]  # fmt: skip
    if not view.fit.misfit:
        return []
    worst = int(np.argmax(view.fit.snooped))
    text = (f"the reference points do not fit one plane: point {worst + 1} lies off what the others say by "
            f"{view.fit.snooped[worst]:.2g} times what is stated, and the interval is too narrow")  # fmt: skip
    cure = f"look at point {worst + 1} again, at the order of the points and at their coordinates"
    return [Note("points_misfit", text, cure)]
