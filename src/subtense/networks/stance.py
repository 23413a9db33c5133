"""Stance: whether a person stands upright and is seen whole, so that from sole to head is the body's height.

The limits hold 9 of 10 walking and standing adults; benchmarks/boxes.py prints the shares of each. A body that is hidden from
the shins down changes several of these numbers at once.
"""

from __future__ import annotations

import math

import numpy as np

from ..arrays import Array
from .body import ANKLES, EYES, FEET, HIPS, KNEES, SHOULDERS, Body

LEAST_SCORE = 0.8
STRAIGHT_KNEE, BENT_KNEE, STRAIGHT_HIP = math.radians(138), math.radians(110), math.radians(143)
"""The straighter knee, the other one (of a walker), the straighter hip: at least."""
LEAST_LEG = 0.93
"""Hips to ankles in the vertical, by the shoulders' distance from the hips; a seated person's thighs come towards us."""
MOST_LEAN = math.radians(12)
LEAST_SEEN = 0.72
"""Mean visibility of the better foot."""
FEET_FROM_BOTTOM = (-0.11, 0.06)
"""The lowest point of the feet below the person's lowest pixel, shares of the height."""
SHOULDERS_FROM_TOP, EYES_FROM_TOP = (0.14, 0.25), (0.035, 0.125)
"""Shares of the height."""
MOST_APART = 0.04
"""Of the height: ends of two looks that lie farther apart are not trusted; 99 of 100 lie within 0.02."""
AT_BORDER = 0.015
"""Of the height: a person who ends nearer to the border of the picture is cut by it."""


def cut_by_border(body: Body, width_px: int, height_px: int) -> bool:
    """Whether the person reaches above, below or beside the picture."""
    near = max(AT_BORDER * body.height_px, body.pixel)
    feet = body.joints_px[[*FEET[0], *FEET[1]]]
    return bool(
        body.top_px < near - 0.5 or body.bottom_px > height_px - 0.5 - near
        or body.left_px < near - 0.5 or body.right_px > width_px - 0.5 - near
        or feet[:, 1].max() > height_px - 0.5
    )  # fmt: skip


def hidden(body: Body) -> str:
    """Which end of a standing person is not seen, in words; empty where both are."""
    height = body.height_px
    lowest = float(body.joints_px[[*FEET[0], *FEET[1]], 1].max() - body.bottom_px) / height
    seen = max(float(body.seen[list(foot)].mean()) for foot in FEET)
    if seen < LEAST_SEEN or not _within(lowest, FEET_FROM_BOTTOM):
        return "the feet can't be made out"
    eyes, shoulders = (float(body.middle(pair)[1] - body.top_px) / height for pair in (EYES, SHOULDERS))
    if not (_within(eyes, EYES_FROM_TOP) and _within(shoulders, SHOULDERS_FROM_TOP)):
        return "head and shoulders are not where those of a whole adult body would be"
    return ""


def disagreement(body: Body, again: Body) -> tuple[float, float]:
    """How far apart two looks at a person put the highest and the lowest edge, px."""
    return abs(body.top_px - again.top_px), abs(body.bottom_px - again.bottom_px)


def doubtful(body: Body, again: Body | None) -> str:
    """Why a second look at a standing person does not confirm the first, in words; empty where it does."""
    if again is None or again.score < LEAST_SCORE or posture(again) or hidden(again):
        return "a second look makes out something else"
    if max(disagreement(body, again)) > MOST_APART * body.height_px:
        return "head or feet can't be told from what is around them"
    return ""


def posture(body: Body) -> str:
    """Why the person is not taken to stand upright, in words; empty for one who stands or walks."""
    knees = [_angle(body.joints_m[[HIPS[side], KNEES[side], ANKLES[side]]]) for side in (0, 1)]
    hips = [_angle(body.joints_m[[SHOULDERS[side], HIPS[side], KNEES[side]]]) for side in (0, 1)]
    shoulders, middle, ankles = (body.middle(pair) for pair in (SHOULDERS, HIPS, ANKLES))
    torso = max(float(np.hypot(*(middle - shoulders))), 1e-9)
    if max(knees) < STRAIGHT_KNEE or min(knees) < BENT_KNEE:
        return "the knees are bent"
    if max(hips) < STRAIGHT_HIP or (ankles[1] - middle[1]) / torso < LEAST_LEG:
        return "the legs don't hang straight down, as of one who sits, squats or rides"
    if abs(math.atan2(ankles[0] - shoulders[0], ankles[1] - shoulders[1])) > MOST_LEAN:
        return "the body leans, or the camera was held askew"
    return ""


def _within(value: float, limits: tuple[float, float]) -> bool:
    return limits[0] <= value <= limits[1]


def _angle(points: Array) -> float:
    """At the second of three points (3, 3), rad."""
    one, other = points[0] - points[1], points[2] - points[1]
    cosine = one @ other / max(float(np.linalg.norm(one) * np.linalg.norm(other)), 1e-12)
    return math.acos(float(np.clip(cosine, -1, 1)))
