"""Faces: of each the distance of the pupils, and one iris, both of which are much alike among adults.

The pupils are the centres of the irises. Their distance shrinks with the cosine of the angle by which the head is turned, which
the mesh of the face tells; the iris's width with that of the gaze, which is the head's turn and where the iris stands between
the corners of the eye (the eye turns about a point 10.5 mm behind it). Both angles are to the line of sight; how the line of
sight lies to the picture's axis is added from the place in the picture, by the camera or else by a usual focal length.

The limbus, the iris's border, is soft over some 0.5 mm, and a fit of its edges finds it at another place than clinicians'
callipers, by more than the network's points are off; so the network's width is taken, put right by what it is too wide on
average, and it is only looked whether an iris is to be seen: lids apart, and lighter to both sides.

Source: the numbers below are what benchmarks/faces.py prints.
"""

from __future__ import annotations

import math

import numpy as np

from ..arrays import Array
from ..camera import Camera
from ..detection import Detection, Search
from ..networks.face_mesh import Eye, Face, find_faces
from ..observation import Observation
from ..photo import Photo
from ..quantity import Note, Quantity
from ..subpixel import encoded_gray
from ..targets import KnownTarget, find_target

EYES = ("eye-distance", "eye-distance-man", "eye-distance-woman")
IRIS_TOO_WIDE, IRIS_TOO_WIDE_U = 1.07, 0.03
"""Width of the iris by the network over that by clinicians (8 persons)."""
IRIS_SIGMA, IRIS_SIGMA_PX = 0.04, 0.35
"""Standard deviation of the width of one iris: relative, and in pixels."""
EYES_SIGMA, EYES_SIGMA_PX = 0.015, 0.3
"""Standard deviation of the pupils' distance: relative (the network 0.9 %; gaze that is not parallel 1 %), and in pixels."""
TURN_SIGMA_RAD = math.radians(5.0)
TURN_SIGMA = 0.2
"""Of the head's turn: a fixed part, and a share of it."""
GAZE_SIGMA_RAD = math.radians(8.0)
EYE_RADIUS_M = 0.0105
"""From the point about which an eye turns to its iris."""
USUAL_FOCAL, USUAL_FOCAL_U = 0.9, 0.35
"""Focal length over the picture's longer side where no camera is told, and its relative u."""
TURNED_RAD = math.radians(25.0)
TURNED_TOO_FAR_RAD = math.radians(40.0)
FEW_PX = 10.0
"""Width of an iris below which the note `small_iris` is given."""
FEWEST_PX = 4.0
SMALLEST_EYES_PX = 12.0
OPEN = 0.45
"""Distance of the lids over the iris's width from which its width can be seen."""
LIGHTER, LIGHTER_ONE_SIDE = 0.04, 0.1
"""Encoded value by which the white is lighter than the iris: on the worse side, on the better one."""


def faces(photo: Photo, search: Search | None = None) -> tuple[Detection, ...]:
    """The pupils' distance and an iris of each face, left to right.

    Args:
        photo: the picture.
        search: `targets`, `camera`, `thorough` and `progress` of it are heeded.

    Returns:
        Lengths "face 1 eyes" and "face 1 iris": ends from left to right as they stand in the picture of an upright face.

    Raises:
        MissingExtraError: the networks are not installed.
    """
    search = search or Search()
    camera = search.camera
    eyes_target, iris_target = _wanted(search.targets)
    if eyes_target is None and iris_target is None:
        return ()
    gray = encoded_gray(photo.pixels)
    out: list[Detection] = []
    for number, face in enumerate(find_faces(photo.pixels, thorough=search.thorough, progress=search.progress), 1):
        contrasts = [contrast(gray, eye) for eye in face.eyes]
        if abs(face.eyes_turned_rad) > TURNED_TOO_FAR_RAD:
            continue
        if eyes_target is not None:
            out += _eyes(photo, camera, face, contrasts, eyes_target, f"face {number} eyes")
        if iris_target is not None:
            out += _iris(photo, camera, face, contrasts, iris_target, f"face {number} iris")
    return tuple(out)


def _wanted(stated: tuple[KnownTarget, ...]) -> tuple[KnownTarget | None, KnownTarget | None]:
    """What the eyes and the iris are measured by; None for what a person did not ask for."""
    if not stated:
        return find_target(EYES[0]), find_target("iris")
    eyes = [target for target in stated if target.name in EYES]
    iris = [target for target in stated if target.name == "iris"]
    return (eyes[0] if eyes else None), (iris[0] if iris else None)


def _eyes(
    photo: Photo,
    camera: Camera | None,
    face: Face,
    contrasts: list[tuple[float, float]],
    target: KnownTarget,
    label: str,
) -> list[Detection]:
    ends = np.stack([eye.centre_px for eye in face.eyes])
    length = float(np.hypot(*(ends[1] - ends[0])))
    if length < SMALLEST_EYES_PX or not _inside(photo, ends):
        return []
    notes = []
    seen = [better >= LIGHTER_ONE_SIDE for _, better in contrasts]
    sigma = math.hypot(EYES_SIGMA * length, EYES_SIGMA_PX)
    if not all(seen):
        sigma *= 2
        notes.append(Note("eyes_unclear", "the irises do not stand out (closed or narrow eyes, glasses, a dark picture); "
                          "where the pupils are is told by the rest of the face",
                          "take a picture with open, well lit eyes"))  # fmt: skip
    notes += _turned(face.eyes_turned_rad)
    turn = _to_picture(photo, camera, face, face.eyes_turned_rad,
                       math.hypot(TURN_SIGMA_RAD, TURN_SIGMA * face.eyes_turned_rad), "turn of the head")  # fmt: skip
    observation = Observation(ends, sigma / math.sqrt(2), label=label, score=face.score, source="network: face mesh")
    return [Detection(observation, "length", target, tilt=turn, notes=tuple(notes))]


def _turned(angle_rad: float) -> list[Note]:
    if abs(angle_rad) <= TURNED_RAD:
        return []
    return [Note("head_turned", f"the head is turned by {math.degrees(abs(angle_rad)):.0f}°, which is known to a fifth; it makes much "
                 "of u", "take a picture in which the person faces the camera")]  # fmt: skip


def _iris(
    photo: Photo,
    camera: Camera | None,
    face: Face,
    contrasts: list[tuple[float, float]],
    target: KnownTarget,
    label: str,
) -> list[Detection]:
    """The width of the irises, about the one that is seen better; nothing where none can be seen."""
    seen = [i for i, eye in enumerate(face.eyes) if _width_is_seen(eye, contrasts[i])]
    gaze = face.eyes_turned_rad + _gaze_in_head(face)
    if not seen or abs(gaze) > TURNED_TOO_FAR_RAD:
        return []
    width = sum(face.eyes[i].iris_width_px for i in seen) / len(seen) / IRIS_TOO_WIDE
    best = max(seen, key=lambda i: contrasts[i][0])
    ends = face.eyes[best].centre_px + np.array([[-0.5], [0.5]]) * width * _along(face)
    if width < FEWEST_PX or not _inside(photo, ends):
        return []
    notes = []
    if width < FEW_PX:
        notes.append(Note("small_iris", f"the iris is only {width:.1f} px wide", "come closer, or use a longer lens"))
    notes += _turned(face.eyes_turned_rad)
    sigma = math.hypot(math.hypot(IRIS_SIGMA * width, IRIS_SIGMA_PX) / math.sqrt(len(seen)), IRIS_TOO_WIDE_U * width)
    tilt = _to_picture(photo, camera, face, gaze, GAZE_SIGMA_RAD, "direction of gaze")
    observation = Observation(ends, sigma / math.sqrt(2), label=label, score=face.score, source="network: iris")
    return [Detection(observation, "length", target, tilt=tilt, notes=tuple(notes))]


def _width_is_seen(eye: Eye, contrast: tuple[float, float]) -> bool:
    """Whether the lids are apart, and the white is lighter than the iris on both sides."""
    worse, better = contrast
    return eye.opening_px >= OPEN * eye.iris_width_px and worse >= LIGHTER and better >= LIGHTER_ONE_SIDE


def _along(face: Face) -> Array:
    """(2,) unit vector from the one eye to the other."""
    between = face.eyes[1].centre_px - face.eyes[0].centre_px
    return np.asarray(between / max(float(np.hypot(*between)), 1e-9))


def _gaze_in_head(face: Face) -> float:
    """Angle of the gaze to where the head points, rad, positive to the right in the picture: where the irises stand between
    the corners of the eyes, the mean of both, as each stands a little to the nose."""
    found = []
    for eye in face.eyes:
        middle = (eye.lids_px[0] + eye.lids_px[8]) / 2
        scale_m = 0.01171 / (eye.iris_width_px / IRIS_TOO_WIDE)
        found.append(float((eye.centre_px - middle) @ _along(face)) * scale_m)
    return math.asin(max(-1.0, min(1.0, sum(found) / 2 / EYE_RADIUS_M)))


def _to_picture(
    photo: Photo, camera: Camera | None, face: Face, turned_rad: float, u_rad: float, what: str
) -> Quantity:
    """An angle to what faces the viewer as one to the image plane: less the angle of the line of sight along the eyes."""
    middle = (face.eyes[0].centre_px + face.eyes[1].centre_px) / 2
    if camera is None:
        off_px = middle - np.array([(photo.width_px - 1) / 2, (photo.height_px - 1) / 2])
        slope, u_relative = off_px / (USUAL_FOCAL * max(photo.width_px, photo.height_px)), USUAL_FOCAL_U
    else:
        slope, u_relative = np.concatenate(camera.slopes(middle[None])), camera.u_f_px / float(camera.f_px)
    sight = math.atan(float(slope @ _along(face)))
    if math.isnan(sight):  # the camera's numbers give no direction here; its method will say so
        sight = 0.0
    u_sight = u_relative * abs(math.sin(sight) * math.cos(sight))
    return Quantity.normal(turned_rad - sight, math.hypot(u_rad, u_sight), "rad", f"network: {what}")


def _inside(photo: Photo, points_px: Array) -> bool:
    return bool(np.all(points_px >= -0.5) and np.all(points_px <= np.array([photo.width_px, photo.height_px]) - 0.5))


def contrast(gray: Array, eye: Eye) -> tuple[float, float]:
    """By how much the white of the eye is lighter than the iris, on the worse side and on the better one.

    Args:
        gray: (H, W) encoded luminance, 0 to 1.
        eye: whose lids bound what is looked at.
    """
    along = eye.lids_px[8] - eye.lids_px[0]
    along = along / max(float(np.hypot(*along)), 1e-9)
    inside = _median(gray, eye, along, np.linspace(-0.36, 0.36, 9))
    sides = [_median(gray, eye, along, side * np.linspace(0.6, 0.85, 5)) - inside for side in (-1, 1)]
    known = sorted(-1.0 if math.isnan(side) else side for side in sides)
    return known[0], known[1]


def _median(gray: Array, eye: Eye, along: Array, places: Array) -> float:
    """Median of the pixels between the lids, at places along the eye in widths of the iris; NaN where there are few."""
    across = np.array([-along[1], along[0]])
    steps = places[:, None, None] * along + np.linspace(-0.2, 0.2, 7)[None, :, None] * across
    points = (eye.centre_px + steps * eye.iris_width_px).reshape(-1, 2)
    points = points[_between_lids(eye, points)]
    if len(points) < 4:
        return math.nan
    x, y = np.rint(points).astype(int).T
    known = (x >= 0) & (y >= 0) & (x < gray.shape[1]) & (y < gray.shape[0])
    return float(np.median(gray[y[known], x[known]])) if known.any() else math.nan


def _between_lids(eye: Eye, points: Array) -> Array:
    """Whether points lie inside the outline of the lids (ray casting)."""
    ring = eye.lids_px[[0, 1, 2, 3, 4, 5, 6, 7, 8, 15, 14, 13, 12, 11, 10, 9]]
    inside = np.zeros(len(points), bool)
    for start, end in zip(ring, np.roll(ring, -1, axis=0), strict=True):
        crosses = (start[1] > points[:, 1]) != (end[1] > points[:, 1])
        rise = end[1] - start[1] if end[1] != start[1] else 1e-12
        inside ^= crosses & (points[:, 0] < start[0] + (points[:, 1] - start[1]) / rise * (end[0] - start[0]))
    return inside
