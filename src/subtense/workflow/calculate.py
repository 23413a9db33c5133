"""The calculator: five numbers, one of them unknown."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from .. import propagate
from ..document import Document
from ..errors import GeometryError, InputError
from ..methods import calculator
from ..quantity import Measurement, Quantity
from .given import given
from .improve import improved

_FIELD_OF = {
    "distance": "distance_m", "size": "size_m", "extent": "extent_px", "focal_length": "focal_length_m",
    "sensor_width": "sensor_width_m", "image_width": "image_width_px",
}  # fmt: skip
_ALWAYS = ("range_m", "sensor_px_per_m", "focal_length_px", "object_m_per_px", "field_of_view_rad", "angle_rad")


def calculate(
    inputs: calculator.Inputs, *, image_height: Quantity | None = None, level: float = 0.95, seed: int = 0
) -> Document:
    """Solve the classical relation for the value that was left out.

    Args:
        inputs: with exactly one of distance, size, extent, focal_length, sensor_width, image_width left as None.
        image_height: px, to check an extent along the height against; None if unknown.
        level: coverage of the intervals.
        seed: of the draws, where they are needed.

    Raises:
        InputError: not exactly one unknown, a value of 0 or below, an extent wider than the picture.
        GeometryError: no finite answer.
    """
    _check(inputs, image_height)
    unknown = inputs.unknown
    found = propagate.measure(calculator.METHOD, inputs, level=level, seed=seed, given=given(inputs))
    by_name = dict(zip((o.name for o in calculator.METHOD.outputs), found, strict=True))
    _check_answer(by_name, inputs, image_height)
    chosen = [by_name[name] for name in dict.fromkeys((_FIELD_OF[unknown], *_ALWAYS))]
    return Document(improved(tuple(_headed(chosen))), _camera(by_name))


def _headed(measurements: list[Measurement]) -> list[Measurement]:
    """The notes stand with the headline only: they are the same for all."""
    head, *rest = measurements
    return [head, *(dataclasses.replace(m, notes=()) for m in rest)]


def _camera(found: dict[str, Measurement]) -> dict[str, Any]:
    f = found["focal_length_px"]
    return {"f_px": f.value, "u_f_px": f.u, "width_px": round(found["image_width_px"].value), "height_px": None,
            "source": "the relation between focal length, sensor and picture"}  # fmt: skip


def _check_answer(found: dict[str, Measurement], inputs: calculator.Inputs, image_height: Quantity | None) -> None:
    """Refuse what no camera sees: an object inside the focal length, or one that does not fit into the picture."""
    distance, focal, extent = (found[name].value for name in ("distance_m", "focal_length_m", "extent_px"))
    if distance <= focal:
        text = f"at {distance * 1000:g} mm the object lies inside the focal length of {focal * 1000:.4g} mm; no lens draws it"
        raise GeometryError(text, code="inside_focal_length")
    height = None if image_height is None else float(image_height.value)
    limit = found["image_width_px"].value if inputs.along == "width" else height
    if limit is not None and extent > limit:
        text = f"the object would span {extent:.0f} px, and the picture has {limit:.7g} px along its {inputs.along}"
        raise GeometryError(text, code="out_of_picture")


def _check(inputs: calculator.Inputs, image_height: Quantity | None) -> None:
    missing = [name for name in calculator.UNKNOWNS if getattr(inputs, name) is None]
    if len(missing) != 1:
        names = ", ".join(calculator.UNKNOWNS)
        raise InputError("the unknown", ", ".join(missing) or "nothing", f"leave out exactly one of {names}")
    for name in (*calculator.UNKNOWNS, "aspect"):
        quantity = getattr(inputs, name)
        if quantity is not None and not np.all(np.asarray(quantity.value) > 0):
            raise InputError(
                name.replace("_", " "), f"{float(quantity.value):g} {quantity.unit}", "give a number above 0"
            )
    limit = inputs.image_width if inputs.along == "width" else image_height
    if inputs.extent is not None and limit is not None and np.any(inputs.extent.value > limit.value):
        raise InputError(
            "extent",
            f"{float(inputs.extent.value):g} px",
            f"the picture has {float(limit.value):g} px along its {inputs.along}",
        )
    if abs(float(inputs.tilt.value)) >= np.pi / 2:
        raise InputError("tilt", f"{np.degrees(float(inputs.tilt.value)):g}°", "give an angle between -90° and 90°")


def curve(inputs: calculator.Inputs, *, level: float = 0.95, points: int = 49) -> dict[str, Any]:
    """The unknown over the extent (over the distance where the extent is the unknown), with its band, for a chart.

    The band is of first order in the logarithm, so that it stays above 0; near the value asked for it agrees with the
    interval of `calculate`.

    Args:
        inputs: as for `calculate`.
        level: coverage of the band.
        points: how many, evenly spaced in the logarithm over a factor of 20 each way.
    """
    unknown = inputs.unknown
    moved = "distance" if unknown == "extent" else "extent"
    at = getattr(inputs, moved)
    x = float(at.value) * np.geomspace(1 / 20, 20, points)
    widest = float(inputs.image_width.value) if moved == "extent" and inputs.image_width is not None else np.inf
    x = x[x <= max(widest, float(at.value))]
    # a distance is known to so many per cent, an extent to so many pixels
    u = float(at.u) * (x / float(at.value) if moved == "distance" else np.ones_like(x))
    many = dataclasses.replace(inputs, **{moved: dataclasses.replace(at, value=x, u=u)})
    found = propagate.rows(calculator.METHOD, many, level=level, threads=1)
    row = found.names.index(_FIELD_OF[unknown])
    value, answered = found.value[row], found.reason == 0
    spread = np.exp(found.coverage[row] * found.u[row] / value)
    columns = {"x": x, "value": value, "low": value / spread, "high": value * spread}
    return {
        "x_what": moved, "y_what": unknown, "x_unit": at.unit, "y_unit": "px" if unknown in ("extent", "image_width") else "m",
        **{name: column[answered].tolist() for name, column in columns.items()},
    }  # fmt: skip
