"""Plain tables: presets, targets, methods, camera hypotheses."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..presets import Preset
    from ..targets import KnownTarget


def columns(rows: Sequence[Sequence[str]], gap: str = "   ") -> str:
    """Rows of texts in aligned columns; the last one is not padded."""
    if not rows:
        return ""
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    return "\n".join(
        gap.join([*(cell.ljust(width) for cell, width in zip(row[:-1], widths, strict=False)), row[-1]]).rstrip()
        for row in rows
    )


def preset_table(presets: Sequence[Preset]) -> str:
    """Name, sensor, focal length, picture width and title of presets."""

    def limits(quantity: object, factor: float, unit: str) -> str:
        from ..quantity import Quantity

        if not isinstance(quantity, Quantity):
            return "-"
        half = float(quantity.u) * 3**0.5
        low, high = ((float(quantity.value) + sign * half) / factor for sign in (-1, 1))
        return f"{low:g} {unit}" if half == 0 else f"{low:.4g} to {high:.4g} {unit}"

    rows = [("name", "sensor width", "focal length", "picture width", "what it is")]
    rows += [(p.name, limits(p.sensor_width, 1e-3, "mm"), limits(p.focal_length, 1e-3, "mm"), limits(p.image_width, 1.0, "px"), p.title)
             for p in presets]  # fmt: skip
    return columns(rows)


def target_table(targets: Sequence[KnownTarget]) -> str:
    """Name, size with its doubt, which length it is, and title of things of known size."""
    rows = [("name", "size", "which length", "what it is")]
    return columns([*rows, *((t.name, t.text, t.what, t.title) for t in targets)])
