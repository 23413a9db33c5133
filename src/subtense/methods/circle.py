"""Range, depth and tilt of a disc of known diameter, from its rim.

The directions of the rim lie on an elliptic cone, whatever the lens. With p <= q the tangents of its half angles and r the
radius, the disc's own centre (not that of the ellipse) is at range r sqrt(1 + (1 - p^2) / q^2), and cos(tilt) =
p / (q sqrt(1 + q^2 - p^2)). A cone is that of two discs, which mirror each other about it: their range and tilt are the same,
their centres lie a little to either side of the axis, which `side` says.

Where a disc nearly faces the camera, noise makes every ellipse slimmer than it is, and so too large across. So the flattening is
settled once: its law is the posterior of the rim's shape where all tilts were equally likely before. It is a line of the budget
of its own, and the size is then what the rim says for that flattening.

Source: Q. Chen, H. Wu, T. Wada, Camera calibration with two arbitrary coplanar circles, ECCV 2004, section 2.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np

from ..arrays import Array, Codes
from ..camera import Camera
from ..conic import Cone, ConeFit, misfit, refit, rim_cone
from ..errors import InputError
from ..focus import NO_EXTENSION, close_focus, thin_lens
from ..geometry import Pose, rotation_from_vector
from ..lenses import LENSES
from ..method import Method, Output, Reason, reasons
from ..observation import Observation
from ..quantity import Note, Quantity

LEAST_POINTS = 5


def either_side() -> Quantity:
    """Nothing in the picture says which of the two discs it is: between them, with the variance of either."""
    return Quantity.between(-(2.0**0.5), 2.0**0.5, "1", "arcsine", "two discs have this rim")


@dataclass(frozen=True)
class Inputs:
    """A camera, five or more points of a disc's rim, and its diameter.

    Attributes:
        camera: of the upright picture.
        rim: points of the rim, in order around it; more, and all around, are better.
        diameter: of the rim, m.
        focus: share of the thin-lens extension that is added where the focal length is nominal; 1.
        side: 1 where the half that is lower in the picture is nearer, -1 where it is farther; either, if not said.
        flattening: half the logarithm of the rim's axis ratio, seen along the cone's axis; found from the points by itself.
    """

    camera: Camera
    rim: Observation = field(metadata={"closed": True, "least": LEAST_POINTS})
    diameter: Quantity = field(metadata={"unit": "m", "assume": "size"})
    focus: Quantity = field(default_factory=thin_lens, metadata={"unit": "1"})
    side: Quantity = field(default_factory=either_side, metadata={"unit": "1"})
    flattening: Quantity | None = field(default=None, metadata={"unit": "1"})

    def __post_init__(self) -> None:
        seen = self.rim.points_px.shape[-2]
        if seen < LEAST_POINTS:
            raise InputError("rim", f"{seen} points", f"give {LEAST_POINTS} or more, all around the rim")


@dataclass(frozen=True)
class Result:
    """Arrays (...): range from the entrance pupil and depth along the axis of the disc's centre, and the angle between
    the disc's normal and the line of sight (0 where it faces the camera)."""

    range_m: Array
    depth_m: Array
    tilt_rad: Array
    reason: Codes


@dataclass(frozen=True, eq=False)
class Start:
    """The nominal fit, with how size and flattening vary together in it.

    Attributes:
        fit: of the cone.
        along: (..., 2) unit vector of the nominal flattening.
        size_by_flattening: (...) change of the size's logarithm with the flattening along it, at given points.
    """

    fit: ConeFit
    along: Array
    size_by_flattening: Array


@lru_cache(maxsize=8)
def start(inputs: Inputs) -> Start:
    """Fit the nominal rim."""
    fit = rim_cone(inputs.camera, inputs.rim)
    length = np.sqrt(np.sum(fit.cone.flat**2, -1, keepdims=True))
    along = np.where(length > 0, fit.cone.flat / np.where(length > 0, length, 1.0), np.array([1.0, 0.0]))
    own = np.einsum("...i,...ij,...j->...", along, fit.cov[..., 3:, 3:], along)
    mixed = np.einsum("...i,...i->...", fit.cov[..., 2, 3:], along)
    return Start(fit, along, mixed / np.where(own > 0, own, np.inf))


def circle(inputs: Inputs, begin: Start) -> Result:
    """Range, depth (m) and tilt (rad) of the disc's centre.

    Source: the two discs of an elliptic cone; see the module.
    """
    rays = inputs.camera.rays(inputs.rim.points_px)
    cone, converged = refit(begin.fit, rays)
    diameter = np.asarray(inputs.diameter.value)
    range_m, depth, (short, long), _ = _centre(inputs, begin, cone)
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        extension = 1 + np.asarray(inputs.focus.value) * (inputs.camera.nominal_focal_m or 0.0) / depth
        cosine = short / (long * np.sqrt(1 + long**2 - short**2))
        tilt = np.arccos(np.clip(cosine, -1.0, 1.0))
    lead = np.broadcast_shapes(range_m.shape, extension.shape)
    range_m, depth_m, tilt = (np.broadcast_to(x, lead) for x in (range_m * extension, depth * extension, tilt))
    perspective = np.asarray(not LENSES[inputs.camera.lens].perspective)
    code = reasons(
        lead, (perspective, Reason.NOT_PINHOLE), (np.asarray(~np.isfinite(rays).all(axis=(-1, -2))), Reason.NOT_INVERTIBLE),
        (~(diameter > 0), Reason.OUT_OF_RANGE), (~converged | ~np.isfinite(range_m), Reason.NOT_CONVERGED),
        (~(depth_m > 0), Reason.BEHIND_CAMERA),
    )  # fmt: skip
    return Result(range_m, depth_m, tilt, code)


def place(inputs: Inputs, begin: Start) -> Array:
    """(..., 3) the disc's centre in the camera's frame, m."""
    cone, _ = refit(begin.fit, inputs.camera.rays(inputs.rim.points_px))
    _, depth, _, centre = _centre(inputs, begin, cone)
    return np.asarray(centre * (circle(inputs, begin).depth_m / depth)[..., None])


def _centre(inputs: Inputs, begin: Start, cone: Cone) -> tuple[Array, Array, tuple[Array, Array], Array]:
    """At infinite focus: range and depth of the centre, the tangents of both half angles, and the centre (..., 3)."""
    flattening = None if inputs.flattening is None else np.asarray(inputs.flattening.value)
    diameter, side = np.asarray(inputs.diameter.value), np.asarray(inputs.side.value)
    short, long = _half_angles(cone, begin, flattening)
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        range_m = diameter / 2 * np.sqrt(1 + (1 - short**2) / long**2)
        off = diameter / 2 * short * np.sqrt(np.maximum(1 - (short / long) ** 2, 0) / (1 + short**2))
        ahead = np.sqrt(range_m**2 - (side * off) ** 2)
        centre = ahead[..., None] * cone.axis - (side * off)[..., None] * cone.short
    return range_m, centre[..., 2], (short, long), centre


def _half_angles(cone: Cone, begin: Start, flattening: Array | None) -> tuple[Array, Array]:
    """Tangents of the short and the long half angle: as the rim is, or as it would be with a given flattening."""
    if flattening is None:
        found = np.sqrt(np.sum(cone.flat**2, -1))
        return np.exp(cone.log_size - found), np.exp(cone.log_size + found)
    along = np.sum(cone.flat * begin.along, -1)
    log_size = cone.log_size - begin.size_by_flattening * (along - flattening)
    return np.exp(log_size - flattening), np.exp(log_size + flattening)


def settled_flattening(fit: ConeFit) -> Quantity:
    """The flattening of one rim, by its shape and a disc that may face any direction.

    The likelihood is normal in the two components of the flattening; all directions of the long axis are alike, and so are all
    tilts, with cos(tilt) = exp(-2 flattening).
    """
    found, cov = fit.cone.flat, fit.cov[3:, 3:]
    length, u = float(np.hypot(*found)), float(np.sqrt(np.linalg.eigvalsh(cov).max()))
    source = "the rim's shape; all tilts equally likely before"
    if not 0 < u < 10:
        return Quantity.exact(length, "1", source)
    root = np.linspace(max(length - 6 * u, 1e-6 * u) ** 0.5, (length + 6 * u) ** 0.5, 401)  # dense where tilts are
    size = root**2
    by_tilt = np.exp(-2 * size) / np.sqrt(-np.expm1(-4 * size)) * root  # tilts per step of the root
    most = min(np.pi, 6 * u / max(length - 6 * u, u))
    angle = np.arctan2(found[1], found[0]) + np.linspace(-most, most, 181)
    off = size[:, None, None] * np.stack([np.cos(angle), np.sin(angle)], -1) - found
    chi2 = np.einsum("...i,ij,...j->...", off, np.linalg.inv(cov + 1e-12 * u**2 * np.eye(2)), off)
    weight = np.exp(-(chi2 - chi2.min()) / 2).sum(axis=1) * by_tilt
    mean = float(np.average(size, weights=weight))
    return Quantity.normal(mean, float(np.sqrt(np.average((size - mean) ** 2, weights=weight))), "1", source)


def prepare(inputs: Inputs) -> Inputs:
    """Inputs whose flattening is settled; a calibrated focal length holds its focus extension already."""
    if not inputs.camera.nominal_focal_m:
        inputs = replace(inputs, focus=NO_EXTENSION)
    if inputs.flattening is not None or inputs.camera.leading or inputs.rim.leading:
        return inputs
    begin = start(inputs)
    return replace(inputs, flattening=settled_flattening(begin.fit)) if begin.fit.fits else inputs


def notes(inputs: Inputs, result: Result) -> tuple[Note, ...]:
    """`points_misfit` and `close_focus`."""
    found = []
    off = misfit(float(start(inputs).fit.chi2), inputs.rim.points_px.shape[-2] - LEAST_POINTS)
    if off:
        found.append(Note("points_misfit", f"the points do not lie on the rim of one disc: they are off by {off:.2g} times what is "
                          "stated of them, and the interval is too narrow", "check that all are on one rim, and the camera"))  # fmt: skip
    note = close_focus(inputs.camera.nominal_focal_m, float(result.depth_m), inputs.focus)
    return (*found, note) if note else tuple(found)


def example() -> Inputs:
    """A coin of 23.25 mm, tilted by 50 degrees, 0.4 m away; eight points of its rim."""
    camera = Camera(1600, 1200, 1300.0, 799.5, 599.5, cov=np.diag([10.0**2, 0, 4.0**2, 4.0**2]))
    there = Pose(rotation_from_vector(np.array([np.radians(50), 0.0, 0.0])), np.array([0.05, -0.03, 0.4]))
    around = np.linspace(0, 2 * np.pi, 8, endpoint=False)
    rim = 0.01162 * np.stack([np.cos(around), np.sin(around), np.zeros(8)], -1)
    return Inputs(camera, Observation(camera.project(there.apply(rim)), 0.3), Quantity.interval(0.02325, 0.0001, "m"))


METHOD = Method(
    name="circle",
    title="a disc of known diameter: a coin, a lid, a round sign",
    inputs=Inputs,
    outputs=(Output("range_m", "range", "m", "range (from the entrance pupil)"),
             Output("depth_m", "depth", "m", "depth (along the axis)"),
             Output("tilt_rad", "tilt", "rad", "tilt to the line of sight", digits=1)),
    function=circle,
    assumes=("the points lie on the rim of one flat disc of the stated diameter",
             "the picture is not cropped or edited after the camera's numbers were taken"),
    source="Q. Chen, H. Wu, T. Wada, ECCV 2004",
    typical="0.2 to 0.5 % calibrated, 1 to 3 % with a nominal focal length",
    example=example,
    button="Disc",
    start=start,
    place=place,
    prepare=prepare,
    most_draws=100_000,
    notes=notes,
)  # fmt: skip
