"""The calculator: five numbers, one of them unknown."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from .. import propagate
from ..arrays import Array
from ..document import Document
from ..errors import GeometryError, InputError
from ..method import Method
from ..methods import calculator
from ..noun import fields_of, unchecked
from ..quantity import Quantity
from .given import given
from .improve import improved

_FIELD_OF = {
    "distance": "distance_m", "size": "size_m", "extent": "extent_px", "focal_length": "focal_length_m",
    "sensor_width": "sensor_width_m", "image_width": "image_width_px",
}  # fmt: skip
_ALWAYS = ("range_m", "sensor_px_per_m", "focal_length_px", "object_m_per_px", "field_of_view_rad", "angle_rad")


def calculate(
    inputs: calculator.Inputs, *, image_height: Quantity | None = None, level: float = 0.95, seed: int = 0,
    draws: int | None = None,
) -> Document:  # fmt: skip
    """Solve the classical relation for the value that was left out.

    Args:
        inputs: of the calculator; the value left as None is solved for.
        image_height: px, to check an extent along the height against; None if unknown.
        level: coverage of the intervals.
        seed: of the draws, where they are needed.
        draws: how many; None for as many as are wanted, 0 for none.

    Raises:
        DrawsNeeded: `draws` is 0, and without them an interval would be wrong.
        InputError: a value of 0 or below, an extent wider than the picture, several scenes at once.
        GeometryError: no finite answer.
    """
    if any(isinstance(value, Quantity) and value.leading for value in vars(inputs).values()):
        raise InputError("inputs", "with leading axes", "one scene at a time; use propagate.rows for many")
    _check(inputs, image_height)
    unknown = inputs.unknown
    method = _ANSWERING[unknown]
    found = propagate.measure(method, inputs, level=level, seed=seed, draws=draws, given=given(inputs))
    values = {name: float(q.value) for name in calculator.UNKNOWNS if (q := getattr(inputs, name)) is not None}
    values[unknown] = found[0].value
    _check_answer(values, inputs, image_height)
    f = found[[output.name for output in method.outputs].index("focal_length_px")]
    camera = {"f_px": f.value, "u_f_px": f.u, "width_px": round(values["image_width"]), "height_px": None,
              "source": "the relation between focal length, sensor and picture"}  # fmt: skip
    # the notes stand with the headline only: they are the same for all
    return Document(improved((found[0], *(unchecked(m, notes=()) for m in found[1:]))), camera)


def _answering(unknown: str) -> Method:
    """The calculator with the outputs that are shown: the unknown, and what lies between; the others were given."""
    names = dict.fromkeys((_FIELD_OF[unknown], *_ALWAYS))
    outputs = {output.name: output for output in calculator.METHOD.outputs}
    return dataclasses.replace(calculator.METHOD, outputs=tuple(outputs[name] for name in names))


_ANSWERING = {unknown: _answering(unknown) for unknown in calculator.UNKNOWNS}


def _check_answer(values: dict[str, float], inputs: calculator.Inputs, image_height: Quantity | None) -> None:
    """Refuse what no camera sees: an object inside the focal length, or one that does not fit into the picture."""
    distance, focal, extent = (values[name] for name in ("distance", "focal_length", "extent"))
    if distance <= focal:
        text = f"at {distance * 1000:g} mm the object lies inside the focal length of {focal * 1000:.4g} mm; no lens draws it"
        raise GeometryError(text, code="inside_focal_length")
    height = None if image_height is None else float(image_height.value)
    limit = values["image_width"] if inputs.along == "width" else height
    if limit is not None and extent > limit:
        text = f"the object would span {extent:.0f} px, and the picture has {limit:.7g} px along its {inputs.along}"
        raise GeometryError(text, code="out_of_picture")


def _check(inputs: calculator.Inputs, image_height: Quantity | None) -> None:
    for name in (*calculator.UNKNOWNS, "aspect"):
        quantity = getattr(inputs, name)
        if quantity is not None and not (float(quantity.value) > 0):
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


CURVE_DRAWS = 5000
"""Of a band: its limits scatter by about a hundredth of its width."""


def curve(inputs: calculator.Inputs, *, level: float = 0.95, points: int = 49, seed: int = 0) -> dict[str, Any]:
    """The unknown over the extent (over the distance where the extent is the unknown), with its band, for a chart.

    The band is that of the same draws at all points, so that it is smooth. A distance is known to so many per cent
    everywhere, an extent to so many pixels. Points without an answer, or with an open limit, are left out.

    Args:
        inputs: as for `calculate`.
        level: coverage of the band.
        points: how many, evenly spaced in the logarithm over a factor of 20 each way.
        seed: of the draws.
    """
    unknown = inputs.unknown
    moved = "distance" if unknown == "extent" else "extent"
    at = getattr(inputs, moved)
    nominal = float(at.value)
    x = nominal * np.geomspace(1 / 20, 20, points)
    widest = float(inputs.image_width.value) if moved == "extent" and inputs.image_width is not None else np.inf
    x = x[x <= max(widest, nominal)]
    known = {name: q for name, q in fields_of(inputs).items() if isinstance(q, Quantity)}

    def solved(**values: float | Array) -> dict[str, Array]:
        grid = x[:, None] + (values[moved] - nominal) * (1 if moved == "extent" else x[:, None] / nominal)
        there: dict[str, Any] = {
            name: dataclasses.replace(known[name], value=v) for name, v in {**values, moved: grid}.items()
        }
        result = calculator.calculator(dataclasses.replace(inputs, **there))
        found = np.where(result.reason == 0, getattr(result, _FIELD_OF[unknown]), np.nan)
        return {str(i): row for i, row in enumerate(found)}

    value = np.array(list(solved(**{name: q.value for name, q in known.items()}).values()))[:, 0]
    drawn = propagate.sample(solved, known, CURVE_DRAWS, seed=seed)
    low, high = np.array([drawn.interval(i, level) for i in range(len(x))]).T
    # a one-sided doubt puts the value at an end of what is possible; the band is never without it
    columns = {"x": x, "value": value, "low": np.minimum(low, value).clip(0.0), "high": np.maximum(high, value)}
    answered = np.isfinite(value) & np.isfinite(high)
    return {
        "x_what": moved, "y_what": unknown, "x_unit": at.unit, "y_unit": "px" if unknown in ("extent", "image_width") else "m",
        **{name: column[answered].tolist() for name, column in columns.items()},
    }  # fmt: skip
