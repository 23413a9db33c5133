"""Plain tables: presets, targets, methods, camera hypotheses."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..presets import Preset
    from ..sensors import Sensor
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


def sensor_table(sensors: Sequence[Sensor]) -> str:
    """Name, size, pixels and pixel pitch, with the relative u, and the title of sensors; lenses where the row is of one."""
    rows = [("name", "sensor", "u", "pixels", "pitch", "lens", "what it is")]
    for s in sensors:
        lens = " = ".join(f"{x:g} mm" for x in (s.focal_mm, s.f35_mm) if x)
        pitch = f"{1000 * s.width_mm / s.native_px[0]:.3g} µm"
        rows.append((s.name, f"{s.width_mm:.2f} x {s.height_mm:.2f} mm", f"{100 * s.u:.2g} %", f"{s.native_px[0]} x {s.native_px[1]}",
                     pitch, lens or "-", s.title))  # fmt: skip
    return columns(rows)


def method_table(rows: Sequence[tuple[str, str, str, str]]) -> str:
    """Name, what it measures, what it still needs, and title of methods."""
    return columns([("name", "measures", "needs still", "how"), *rows])
