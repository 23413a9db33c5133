"""Ways to measure that can be planned: from a set-up and a distance to the Inputs that its picture would give.

Pictures are those of a perfect view: nominal values without error, so that a method gives back the distance, with the u that
the set-up's doubts make of it. What a way can be asked for stands in its row of WAYS.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from .. import ground
from ..arrays import Array
from ..camera import Camera
from ..errors import GeometryError
from ..horizon import effective_radius_m, level_from_angles
from ..hypothesis import unknown_lens
from ..method import Method
from ..methods import ground_length, ground_plane, ground_sampling, known_size, stereo
from ..observation import Observation
from ..planned import Entry
from ..rig import Rig

CALIBRATED_CENTRE = 0.001
"""u of the principal point of a calibrated camera, in picture widths."""
CALIBRATED_K1 = 0.002
"""u of the first distortion coefficient of a calibrated camera."""


@dataclass(frozen=True)
class Setup:
    """A camera and what it measures with, by numbers that can be changed one at a time.

    Attributes:
        entries: by their keys.
        planned_m: the distance planned for, which a camera above ground aims at.
        calibrated: whether focal length, principal point and distortion are from a calibration at this focus.
        proportion: height of the picture over its width.
        width_px: of the picture for which a focal length in pixels was said.
        aimed: whether a camera above ground points at the planned distance, as no pitch was said.
    """

    entries: Mapping[str, Entry]
    planned_m: float
    calibrated: bool
    proportion: float
    width_px: float
    aimed: bool = False

    def value(self, key: str) -> float:
        """Of an entry."""
        return float(self.entries[key].quantity.value)

    def with_entry(self, entry: Entry) -> Setup:
        """The set-up with one entry changed."""
        return dataclasses.replace(self, entries={**self.entries, entry.key: entry})

    def camera(self) -> Camera:
        """Of the whole picture, looking through its middle; `unknown_lens` as in a photo, better known where calibrated."""
        width, focal = round(self.value("width-px")), self.entries["focal"].quantity
        in_pixels = focal.unit == "px"
        f_px = float(focal.value) * width / (self.width_px if in_pixels else self.value("sensor"))
        relative = float(focal.u) / float(focal.value)
        nominal_m = None if in_pixels or self.calibrated else float(focal.value)
        height = max(round(width * self.proportion), 1)
        made = unknown_lens(width, height, f_px, relative * f_px, focal.source, nominal_m)
        if not self.calibrated:
            return made
        cov = np.array(made.cov)
        cov[[2, 3, 4], [2, 3, 4]] = (CALIBRATED_CENTRE * width) ** 2, (CALIBRATED_CENTRE * width) ** 2, CALIBRATED_K1**2
        parts = {
            "principal point": f"assumed: calibrated, to {100 * CALIBRATED_CENTRE:g} % of the width",
            "lens distortion": f"assumed: calibrated, k1 to {CALIBRATED_K1:g}",
        }
        return dataclasses.replace(made, cov=cov, part_sources=parts, id=None)


@dataclass(frozen=True)
class Way:
    """One row of the table of what can be planned.

    Attributes:
        name: as `--way` names it.
        title: a few words.
        what: what is measured.
        method: which does it.
        output: of the method.
        inputs: from a set-up and a distance to the method's Inputs; raises GeometryError where no picture shows it.
        keys: the entries it needs beside camera and pixel error.
        lever: the one that is changed together with better knowledge of others, where no change alone is enough; or empty.
        seen_px: how long what is measured is in the picture, or its disparity, by the Inputs; None where that has no meaning.
        sampling: the Inputs of `ground_sampling` at the middle of the picture; None where it has no meaning.
    """

    name: str
    title: str
    what: str
    method: Method
    output: str
    inputs: Callable[[Setup, float], Any]
    keys: tuple[str, ...]
    lever: str
    seen_px: Callable[[Any], float] | None = None
    sampling: Callable[[Setup], Any] | None = None

    @property
    def headline(self) -> Method:
        """The method with the planned output alone, so that nothing else is evaluated."""
        return dataclasses.replace(self.method, outputs=tuple(o for o in self.method.outputs if o.name == self.output))


# -- an object of known size --------------------------------------------------------------------------------------------


def _known_size(setup: Setup, distance_m: float) -> known_size.Inputs:
    """An object in the middle of the picture, level, its middle at this distance."""
    camera, pixels = setup.camera(), float(setup.entries["pixel"].quantity.u)
    size, tilt = setup.entries["size"].quantity, setup.entries["tilt"].quantity
    nominal_m = camera.nominal_focal_m or 0.0
    depth = distance_m - nominal_m
    half, angle = float(size.value) / 2, float(tilt.value)
    near = depth - half * abs(math.sin(angle))
    if not near > 0:
        nearest = nominal_m + half * abs(math.sin(angle))
        raise GeometryError(
            f"at {distance_m:.4g} m nothing is drawn; the nearest is beyond {nearest:.3g} m", code="too_near"
        )
    z = depth + np.array([-half, half]) * math.sin(angle)
    x = float(camera.cx_px) + float(camera.f_px) * np.array([-half, half]) * math.cos(angle) / z
    points = np.stack([x, np.full(2, float(camera.cy_px))], -1)
    _check_seen(points, camera, f"at {distance_m:.4g} m a size of {2 * half:.4g} m")
    seen = Observation(points, pixels, source=setup.entries["pixel"].quantity.source)
    return known_size.Inputs(camera, seen, size, tilt)


def _check_seen(points_px: Array, camera: Camera, what: str) -> None:
    limit = np.array([camera.width_px, camera.height_px]) - 0.5
    if np.any(points_px < -0.5) or np.any(points_px > limit) or not np.all(np.isfinite(points_px)):
        raise GeometryError(
            f"{what} does not fit into the picture of {camera.width_px} x {camera.height_px} px", code="out_of_picture"
        )


# -- on the ground ------------------------------------------------------------------------------------------------------


def _fall_m(setup: Setup, distance_m: float) -> float:
    """How far below the camera level ground lies at a distance: its height, and the earth's curvature."""
    return setup.value("height") + distance_m**2 / (2 * float(effective_radius_m(np.asarray(ground.REFRACTION))))


def _standing(setup: Setup, pitch_rad: float) -> dict[str, Any]:
    """The fields that all methods on the ground share."""
    entries = setup.entries
    pitch, slope = entries["pitch"].quantity, entries["slope"].quantity
    return {
        "camera": setup.camera(), "height": entries["height"].quantity,
        "pitch": dataclasses.replace(pitch, value=pitch_rad), "roll": entries["roll"].quantity,
        "slope": slope, "cross_slope": dataclasses.replace(slope, value=0.0),
    }  # fmt: skip


def aim_rad(setup: Setup) -> float:
    """The pitch of a camera above ground with the planned distance in the middle of its picture."""
    return -math.atan2(_fall_m(setup, setup.planned_m), setup.planned_m)


def _ground(setup: Setup, distance_m: float) -> ground_plane.Inputs:
    """A point on level ground straight ahead."""
    pitch = aim_rad(setup) if setup.aimed else setup.value("pitch")
    standing = _standing(setup, pitch)
    camera: Camera = standing["camera"]
    level = level_from_angles(np.asarray(pitch), np.zeros(()))
    foot = camera.project((distance_m * level.ahead - _fall_m(setup, distance_m) * level.up)[None])
    _check_seen(foot, camera, f"the ground at {distance_m:.4g} m")
    quantity = setup.entries["pixel"].quantity
    return ground_plane.Inputs(**standing, foot=Observation(foot, float(quantity.u), source=quantity.source))


def _from_above(setup: Setup, length_m: float) -> ground_length.Inputs:
    """A length across the middle of a picture taken straight down."""
    standing = _standing(setup, -math.pi / 2)
    camera: Camera = standing["camera"]
    level = level_from_angles(np.asarray(-math.pi / 2), np.zeros(()))
    ends = np.stack([sign * length_m / 2 * level.right - _fall_m(setup, length_m / 2) * level.up for sign in (-1, 1)])
    points = camera.project(ends)
    _check_seen(points, camera, f"from {setup.value('height'):.4g} m a length of {length_m:.4g} m")
    quantity = setup.entries["pixel"].quantity
    return ground_length.Inputs(**standing, ends=Observation(points, float(quantity.u), source=quantity.source))


def _sampling(setup: Setup) -> ground_sampling.Inputs:
    """The middle of a picture taken straight down."""
    standing = _standing(setup, -math.pi / 2)
    camera: Camera = standing["camera"]
    return ground_sampling.Inputs(
        **standing, place=Observation(np.array([[float(camera.cx_px), float(camera.cy_px)]]), 0.0)
    )


# -- two cameras side by side -------------------------------------------------------------------------------------------


def _stereo(setup: Setup, distance_m: float) -> stereo.Inputs:
    """A point ahead of the middle between two cameras, in rectified pictures."""
    camera, baseline = setup.camera(), setup.entries["baseline"].quantity
    assert camera.cov is not None
    rectified = dataclasses.replace(camera, lens="pinhole", distortion=None, cov=camera.cov[:4, :4], id=None)
    disparity = float(camera.f_px) * float(baseline.value) / distance_m
    if disparity > camera.width_px - 1:
        nearest = float(camera.f_px) * float(baseline.value) / (camera.width_px - 1)
        text = f"at {distance_m:.4g} m nothing is in both pictures; the nearest is {nearest:.3g} m away"
        raise GeometryError(text, code="too_near")
    spot = np.array([[float(camera.cx_px) + disparity / 2, float(camera.cy_px)]])
    return stereo.Inputs(
        rig=Rig.of_rectified(rectified, baseline, setup.entries["offset"].quantity, "the set-up"),
        spot=Observation(spot, 0.0, source="a pixel, as named"),
        disparity=dataclasses.replace(setup.entries["pixel"].quantity, value=disparity),
    )


def _between_ends(inputs: Any) -> float:
    """Between two ends, px."""
    first, second = inputs.ends.points_px
    return math.hypot(*(second - first))


def _disparity(inputs: Any) -> float:
    return float(inputs.disparity.value)


WAYS: dict[str, Way] = {
    way.name: way
    for way in (
        Way("known_size", "an object of known size", "range", known_size.METHOD, "range_m", _known_size, ("size", "tilt"),
            "size", _between_ends),
        Way("ground", "a point on the ground", "ground distance", ground_plane.METHOD, "ground_distance_m", _ground,
            ("height", "pitch", "roll", "slope"), "height"),
        Way("stereo", "two cameras side by side", "depth", stereo.METHOD, "depth_m", _stereo, ("baseline", "offset"), "baseline",
            _disparity),
        Way("drone", "the ground from straight above", "length", ground_length.METHOD, "length_m", _from_above,
            ("height", "pitch", "roll", "slope"), "", _between_ends, _sampling),
    )
}  # fmt: skip
"""Ways that can be planned, by name."""
