"""Inputs of a measurement in words, as their JSON has them: name, value, u, law and source."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

from .rounding import digits_for, grouped, number

NO_BREAK = "\u00a0"
MOST_POINTS = 8
"""Of an observation, written out."""


def typeset(text: str) -> str:
    """A number with its unit on one line, with a minus sign instead of a hyphen."""
    return text.replace("-", "−").replace(" ", NO_BREAK)


def with_doubt(value: float, unit: str, doubt: float | None) -> str:
    """A number to two digits of its doubt; a value of 0 takes the doubt's unit."""
    return typeset(number(value, unit, doubt, reference=value or doubt or 1.0))


def short(u: float, unit: str, reference: float) -> str:
    """A standard deviation to two digits, in the unit that suits the value it belongs to."""
    return typeset(number(abs(u), unit, abs(u), reference=reference or u))


def input_row(name: str, value: Any, camera: Mapping[str, Any] | None) -> list[str]:
    """Name, value, u, and law with source of one input, whichever noun it is."""
    shown = name.replace("_", " ")
    if value is None:
        return [shown, "not given", "", ""]
    if not isinstance(value, Mapping):
        return [shown, str(value), "", ""]
    source = str(value.get("source", ""))
    if "$ref" in value:
        return [shown, f"the same as {str(value['$ref']).rpartition('/')[2].replace('_', ' ')}", "", ""]
    if "points_px" in value:
        return [shown, *_points(value), source]
    if "points_m" in value:
        return [shown, *_target(value), source]
    if "f_px" in value:
        same = camera is not None and all(
            camera.get(key) == value[key] for key in ("f_px", "cov", "source") if key in value
        )
        return [shown, *_camera_input(value), "see Camera" if same else source]
    if "right_from_left" in value:
        return [shown, *_rig(value), source]
    if "centre_m" in value:
        u_m = [
            math.sqrt(max(value["cov"][6 * i + k][6 * i + k], 0.0))
            for i in range(len(value["names"]))
            for k in (3, 4, 5)
        ]
        return [
            shown,
            f"{len(value['names'])} pictures: {', '.join(value['names'])}",
            f"places to {with_doubt(max(u_m), 'm', max(u_m))}",
            source,
        ]
    if "seen" in value:
        places, u = _points(value["seen"])
        return [shown, f"in {', '.join(value['names'])}: {places}", u, str(value["seen"].get("source", ""))]
    if "value" in value and not isinstance(value["value"], (list, Mapping)):
        return [shown, *_quantity(value)]
    return [shown, ", ".join(f"{key} {part}" for key, part in value.items()), "", ""]


def _quantity(value: Mapping[str, Any]) -> tuple[str, str, str]:
    number_, u, unit = float(value["value"]), value.get("u") or 0.0, str(value.get("unit", "1"))
    shown = with_doubt(number_, unit, u)
    law = value.get("distribution", "normal")
    law = str(law if isinstance(law, str) else law["name"]).replace("_", " ")
    dof = f", {value['dof']:g} degrees of freedom" if "dof" in value else ""
    source = str(value.get("source", ""))
    if not u:
        return shown, "exact", source
    return shown, short(u, unit, number_), "; ".join(text for text in (law + dof, source) if text)


def _points(value: Mapping[str, Any]) -> tuple[str, str]:
    """Where the points are, and the smallest and largest u of their coordinates."""
    points_px = value["points_px"]
    if value.get("cov"):
        u_px = [math.sqrt(max(row[i], 0.0)) for i, row in enumerate(value["cov"])]
    else:
        u_px = list(_flat(value.get("sigma_px", 0.0)))
    decimals = min(max(digits_for(min(u_px)), 0), 3)
    texts = [typeset(f"({', '.join(grouped(x_px, decimals) for x_px in point)})") for point in points_px[:MOST_POINTS]]
    more = f" and {len(points_px) - MOST_POINTS} more" if len(points_px) > MOST_POINTS else ""
    least, most = (with_doubt(end_px, "px", end_px) for end_px in (min(u_px), max(u_px)))
    return " ".join(texts) + more + f"{NO_BREAK}px", most if least == most else f"{least} to {most}"


def _percent_of(share: float) -> str:
    return typeset(f"{grouped(100 * share, max(digits_for(100 * share), 0))} %")


def _flat(value: Any) -> Iterator[float]:
    if isinstance(value, (list, tuple)):
        for part in value:
            yield from _flat(part)
    else:
        yield float(value)


def _target(value: Mapping[str, Any]) -> tuple[str, str]:
    """Name, number of points and their span; the u of the scale and of single points."""
    points_m, u_scale, sigma_m = value["points_m"], value.get("u_scale") or 0.0, value.get("sigma_m") or 0.0
    spans_m = [max(axis) - min(axis) for axis in zip(*points_m, strict=True)]
    span = " × ".join(with_doubt(span_m, "m", (span_m * u_scale) or None) for span_m in spans_m if span_m > 0)
    doubts = [f"{_percent_of(u_scale)} of its size"] if u_scale else []
    doubts += [f"{with_doubt(sigma_m, 'm', sigma_m)} a point"] if sigma_m else []
    return f"{value.get('name', '')}, {len(points_m)} points, {span}", ", ".join(doubts) or "exact"


def _camera_input(value: Mapping[str, Any]) -> tuple[str, str]:
    if isinstance(value["f_px"], list):
        return f"{len(value['f_px'])} cameras", ""
    u_px = math.sqrt(max(value["cov"][0][0], 0.0)) if value.get("cov") else 0.0
    return f"f{NO_BREAK}{with_doubt(value['f_px'], 'px', u_px)}", with_doubt(u_px, "px", u_px) if u_px else "exact"


def _rig(value: Mapping[str, Any]) -> tuple[str, str]:
    """Focal lengths and baseline of two cameras, and the u of the baseline."""
    along = value["right_from_left"]["translation_m"]
    baseline_m = math.hypot(*along)
    block = [row[-3:] for row in value["cov"][-3:]]
    variance = sum(a * c * b for a, row in zip(along, block, strict=True) for c, b in zip(row, along, strict=True))
    u_m = math.sqrt(max(variance, 0.0)) / baseline_m if baseline_m else 0.0
    f = " and ".join(with_doubt(value[side]["f_px"], "px", None) for side in ("left", "right"))
    return (
        f"two cameras, f {f}, baseline {with_doubt(baseline_m, 'm', u_m or None)}",
        f"{with_doubt(u_m, 'm', u_m)} of the baseline",
    )
