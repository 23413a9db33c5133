"""Reports of what was found in a photo, before anything is measured: text, JSON, CSV."""

from __future__ import annotations

import csv as _csv
import io
import json as _json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..photo import Photo
from ..quantity import Note
from .table import columns

Row = Mapping[str, Any]
SCHEMA = "subtense/detections/1"


def text(rows: Sequence[Row], photo: Photo, notes: Sequence[Note]) -> str:
    """One line each, and the notes below."""
    lines = [f"{photo.name}, {photo.width_px} x {photo.height_px} px", ""]
    table = [("what", "where, px", "across", "sigma", "its size")]
    for row in rows:
        points = np.asarray(row["points_px"], float)
        middle, reach = points.mean(axis=0), float(np.max(np.hypot(*(points[:, None] - points[None]).T)))
        size = row["target"] or "must be told"
        if row["others"]:
            size += f" (or {', '.join(row['others'])})"
        table.append(
            (row["label"], f"{middle[0]:.0f}, {middle[1]:.0f}", f"{reach:.0f} px", f"{_sigma(row):.2g} px", size)
        )
    lines.append(columns(table))
    told = [f"{row['label']}: {note['text']}" for row in rows for note in row["notes"]] + [note.text for note in notes]
    return "\n".join([*lines, *(["", "notes"] if told else []), *(f"  {one}" for one in told)])


def _sigma(row: Row) -> float:
    """Rms standard deviation of a coordinate, px."""
    if row["cov"] is not None:
        return float(np.sqrt(np.mean(np.diag(np.asarray(row["cov"], float)))))
    return float(np.sqrt(np.mean(np.asarray(row["sigma_px"], float) ** 2)))


def json(rows: Sequence[Row], photo: Photo, notes: Sequence[Note]) -> str:
    """Everything, on one line."""
    found = {
        "schema": SCHEMA,
        "photo": photo.to_json(),
        "detections": list(rows),
        "notes": [n.to_json() for n in notes],
    }
    return _json.dumps(found, allow_nan=False)


def csv(rows: Sequence[Row], photo: Photo, notes: Sequence[Note]) -> str:  # noqa: ARG001
    """One row for each point."""
    out = io.StringIO()
    writer = _csv.writer(out, lineterminator="\n")
    writer.writerow(("photo", "label", "shape", "target", "point", "x_px", "y_px", "u_x_px", "u_y_px", "score"))
    for row in rows:
        points = np.asarray(row["points_px"], float)
        if row["cov"] is not None:
            u = np.sqrt(np.diag(np.asarray(row["cov"], float))).reshape(-1, 2)
        else:
            u = np.broadcast_to(np.asarray(row["sigma_px"], float).reshape(-1, 1), points.shape)
        for i, (point, doubt) in enumerate(zip(points, u, strict=True)):
            cells = (photo.name, row["label"], row["shape"], row["target"] or "", i)
            writer.writerow((*cells, *(f"{v:.4f}" for v in (*point, *doubt)), f"{row['score']:.3g}"))
    return out.getvalue().rstrip("\n")
