"""Foot points on a terrain model: the plane that the terrain is around each, as the ground of `ground_plane`.

A line of sight is followed to the first place where it meets the terrain. Around it the terrain is a plane of its own slope; how far
it departs from that plane, within what the camera's u lets the point be, is in the u of its height, and so is what the doubt of
position and heading makes of the slope.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import propagate
from ..arrays import Array
from ..errors import GeometryError, InputError
from ..geometry import rotation_from_vector
from ..ground import meet, stand
from ..method import Reason
from ..methods import ground_plane
from ..photo import Photo
from ..quantity import Note, Quantity
from ..terrain import Terrain, load_terrain, same_datum
from .in_photo import Item, item_inputs
from .resolve_camera import Resolved

if TYPE_CHECKING:
    from .ground import TerrainTexts

ROUNDS = 2
"""Of fitting the plane as wide as the point is doubtful."""
DIFFERS = 0.5
"""Of u: a line of sight at the end of its doubt that meets the terrain farther than so much from where the plane has it is noted."""


@dataclass(frozen=True)
class _Camera:
    """Where the camera is on the map: east, north and height, m; where it looks, clockwise from north; u of both, and of the height."""

    place_m: Array
    u_place_m: float
    heading_rad: float
    u_heading_rad: float
    height: Quantity


def on_terrain(
    items: Sequence[Item], told: TerrainTexts, datum: str, common: Mapping[str, Any], resolved: Resolved, photo: Photo
) -> list[Item]:
    """The items with the ground that the terrain is around their points.

    Args:
        items: foot points only.
        told: the model and the camera's place in it.
        datum: what the camera's height counts from.
        common: how the camera stands.
        resolved: its camera.
        photo: the picture.

    Raises:
        InputError: items that are no foot points, datums that differ, a text that can't be read.
        GeometryError: a line of sight that leaves the model without meeting it.
    """
    if any(item.method is not ground_plane.METHOD for item in items):
        raise InputError(
            "--terrain",
            told.file.name,
            "it is for points on the ground; lengths and footprints need a plane, so leave it out",
        )
    if "height" not in common:
        raise InputError(
            "--reference", "with a terrain model", "give the camera's height above the ground or the model's datum"
        )
    east, north, u_place = _position(told.position)
    sigma = Quantity.parse(
        f"0 {told.sigma}" if told.sigma.strip().startswith("±") else f"0 ± {told.sigma}", "m", name="--terrain-sigma"
    )
    terrain = load_terrain(told.file, (east, north), float(sigma.u), told.datum)
    heading = Quantity.parse(told.heading, "rad", bare="deg", name="--heading")
    height = _above_datum(common["height"], datum, terrain, east, north)
    place = np.array([east, north, float(height.value)])
    camera = _Camera(place, u_place, float(heading.value), float(heading.u), height)
    return [_grounded(item, terrain, camera, common, resolved, photo) for item in items]


def _position(text: str) -> tuple[float, float, float]:
    """East, north and their u from "E,N ± 3 m"."""
    head, _, tail = text.replace("+-", "±").replace("+/-", "±").partition("±")
    words = [word for word in head.replace(";", ",").split(",") if word.strip()]
    try:
        east, north = (float(word) for word in words)
    except ValueError:
        east = north = math.nan
    if not (math.isfinite(east) and math.isfinite(north) and tail.strip()):
        raise InputError(
            "--position",
            text,
            "give east and north in the terrain's coordinates with their ±, as '512300,5403100 ± 3 m'",
        )
    return east, north, float(Quantity.parse(f"0 ± {tail}", "m", name="--position").u)


def _above_datum(height: Quantity, datum: str, terrain: Terrain, east: float, north: float) -> Quantity:
    """The camera's height above the terrain's datum."""
    below = float(terrain.height_m(np.asarray(east), np.asarray(north)))
    if datum == "the ground":
        if not math.isfinite(below):
            raise InputError(
                "--position",
                f"{east:g},{north:g}",
                "the terrain model has no height there; give the height above its datum",
            )
        u = math.hypot(float(height.u), terrain.sigma_m)
        return Quantity.normal(below + float(height.value), u, "m", f"{height.source}, above {terrain.source}")
    if not same_datum(datum, terrain.datum):
        raise InputError("--height", f"above {datum}", f"the terrain's heights are above {terrain.datum}; give the camera's above that, "
                         "or above the ground below it")  # fmt: skip
    if math.isfinite(below) and float(height.value) <= below:
        raise InputError(
            "--height",
            f"{float(height.value):g} m above {datum}",
            f"the terrain there is at {below:.1f} m, above the camera",
        )
    return height


def _grounded(
    item: Item, terrain: Terrain, camera: _Camera, common: Mapping[str, Any], resolved: Resolved, photo: Photo
) -> Item:
    """One foot point with its own plane."""
    level = {**common, "slope": Quantity.exact(0.0, "rad"), "cross_slope": Quantity.exact(0.0, "rad")}
    trial = item_inputs(
        dataclasses.replace(item, inputs={**level, "height": camera.height, **item.inputs}), photo, resolved
    )
    above = float(trial.point_height.value)
    raised = dataclasses.replace(terrain, heights_m=terrain.heights_m + above) if above else terrain
    way = _way(trial, camera)
    far = raised.meet(camera.place_m, way, float(trial.refraction.value))
    if not math.isfinite(far):
        text = f"the line of sight leaves the terrain model {terrain.source} without meeting it, or starts below it"
        raise GeometryError(text, code=Reason.AT_OR_ABOVE_HORIZON.name.lower())
    radius, notes = 0.0, item.notes
    for _ in range(ROUNDS):
        fields, misfit = _plane(terrain, camera, way, far, radius)
        inputs = {**common, **fields, **item.inputs}
        settled = item_inputs(dataclasses.replace(item, inputs=inputs), photo, resolved)
        found = propagate.first_order(ground_plane.METHOD, settled)
        radius = 2 * float(found.u[0])
    if _uneven(raised, camera, trial, settled):
        text = (f"within the interval the terrain departs from a plane, by {misfit:.2g} m (rms) or so that another slope is met first; "
                "the interval may be too narrow")  # fmt: skip
        notes = (
            *notes,
            Note("terrain_uneven", text, "state pitch and heading more closely, or look down more steeply"),
        )
    return dataclasses.replace(item, inputs=inputs, notes=notes)


def _way(inputs: ground_plane.Inputs, camera: _Camera, up_rad: float = 0.0) -> Array:
    """(3,) east, north, up of the line of sight, raised by an angle."""
    level = stand(inputs).level
    ray = inputs.camera.rays(inputs.foot.points_px)[0]
    right, ahead, up = (float(ray @ axis) for axis in (level.right, level.ahead, level.up))
    if up_rad:
        turned = math.atan2(up, math.hypot(right, ahead)) + up_rad
        scale = math.cos(turned) / max(math.hypot(right, ahead), 1e-12)
        right, ahead, up = right * scale, ahead * scale, math.sin(turned)
    c, s = math.cos(camera.heading_rad), math.sin(camera.heading_rad)
    return np.array([right * c + ahead * s, ahead * c - right * s, up])


def _plane(
    terrain: Terrain, camera: _Camera, way: Array, far: float, radius: float
) -> tuple[dict[str, Quantity], float]:
    """Height, slopes and rise of the plane around the met point, seen from the camera's foot, and its misfit."""
    step = far * way[:2]
    x, y = (float(v) for v in camera.place_m[:2] + step)
    height, east, north, misfit = terrain.plane(x, y, radius)
    if not math.isfinite(height):
        text = f"the terrain model {terrain.source} ends where the line of sight meets it"
        raise GeometryError(text, code=Reason.AT_OR_ABOVE_HORIZON.name.lower())
    c, s = math.cos(camera.heading_rad), math.sin(camera.heading_rad)
    across, ahead = east * c - north * s, east * s + north * c
    at_foot = height - east * float(step[0]) - north * float(step[1])
    if not float(camera.height.value) > at_foot:
        raise GeometryError(
            "the line of sight only grazes the terrain there", code=Reason.AT_OR_ABOVE_HORIZON.name.lower()
        )
    reach = max(radius, 1.5 * terrain.cell_m)
    # a place or heading that is off puts the same slope elsewhere; the plane's own height is the terrain's sigma
    moved = math.hypot(camera.u_place_m, camera.u_heading_rad * float(np.hypot(*step))) * math.hypot(east, north)
    u_rise = math.sqrt(terrain.sigma_m**2 + misfit**2 + moved**2)
    u_slope = misfit / reach
    own = camera.height
    source = f"{terrain.source}, heights above {terrain.datum}"
    fields = {
        "height": Quantity(float(own.value) - at_foot, own.u, "m", own.distribution, own.dof, own.source),
        "rise": Quantity.normal(0.0, u_rise, "m", f"{source}, and its place"),
        "slope": Quantity.normal(math.atan(ahead), u_slope, "rad", source),
        "cross_slope": Quantity.normal(math.atan(across), u_slope, "rad", source),
    }
    return fields, misfit


def _uneven(terrain: Terrain, camera: _Camera, trial: ground_plane.Inputs, settled: ground_plane.Inputs) -> bool:
    """Whether lines of sight at the ends of the pitch's doubt meet the terrain elsewhere than the plane."""
    tilt = 0.002 if trial.pitch is None else float(trial.pitch.u)
    u = float(propagate.first_order(ground_plane.METHOD, settled).u[1])
    place = stand(settled)
    for sign in (-2.0, 2.0):
        met = terrain.meet(camera.place_m, _way(trial, camera, sign * tilt), float(trial.refraction.value))
        turned = rotation_from_vector(sign * tilt * place.level.right)
        ray = settled.camera.rays(settled.foot.points_px) @ turned.T
        flat = float(meet(settled, place, ray, np.asarray(settled.point_height.value)[..., None]).range_m[0])
        if not abs(met - flat) <= DIFFERS * u:
            return True
    return False
