"""Document: what every report shows and `--format json` prints, schema "subtense/1"."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from .quantity import Measurement, Note

SCHEMA = "subtense/1"


@dataclass(frozen=True)
class Shape:
    """Something to draw on the photo, in pixels of the upright picture, with the measurement it belongs to.

    Attributes:
        points_px: the corners or ends, in order.
        closed: whether the last point joins the first.
        label: as the measurements' label.
    """

    points_px: tuple[tuple[float, float], ...]
    closed: bool
    label: str


@dataclass(frozen=True)
class Document:
    """Measurements with the camera and the photo they rest on.

    Attributes:
        measurements: headline first within each label.
        camera: the camera's JSON, with its source; None where there is none.
        photo: name, size and SHA-256 of the picture; None where there is none.
        notes: doubts about the whole.
        shapes: for the overlay; not part of the JSON.
    """

    measurements: tuple[Measurement, ...] = ()
    camera: Mapping[str, Any] | None = None
    photo: Mapping[str, Any] | None = None
    notes: tuple[Note, ...] = ()
    shapes: tuple[Shape, ...] = field(default=(), compare=False)

    def to_json(self) -> dict[str, Any]:
        """As in docs/schema.json."""
        from . import __version__

        return {
            "schema": SCHEMA, "version": __version__, "photo": dict(self.photo) if self.photo else None,
            "camera": dict(self.camera) if self.camera else None,
            "measurements": [m.to_json() for m in self.measurements], "notes": [n.to_json() for n in self.notes],
        }  # fmt: skip
