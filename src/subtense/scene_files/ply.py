"""PLY: points with colours, and the places of the pictures.

Source: G. Turk, The PLY polygon file format, 1994. Binary, little-endian; coordinates in metres (or the scene's own unit, which a
comment says) less the origin, double precision.
"""

from __future__ import annotations

import numpy as np

from ..scene import Scene


def write(scene: Scene) -> bytes:
    """The points of a scene, then the places of its pictures in red."""
    unit = "metres" if scene.metric else "a unit of its own"
    places = np.concatenate([scene.points, scene.centre])
    colour = np.concatenate([scene.colour, np.tile(np.array([[255, 0, 0]], np.uint8), (len(scene.centre), 1))])
    head = [
        "ply",
        "format binary_little_endian 1.0",
        f"comment subtense: coordinates in {unit}; the last {len(scene.centre)} are cameras",
    ]
    if scene.origin_m is not None:
        head.append(
            "comment origin "
            + " ".join(f"{x:.4f}" for x in scene.origin_m)
            + (f" {scene.frame}" if scene.frame else "")
        )
    head += [f"element vertex {len(places)}", *(f"property double {axis}" for axis in "xyz"),
             *(f"property uchar {name}" for name in ("red", "green", "blue")), "end_header"]  # fmt: skip
    rows = np.empty(len(places), dtype=[("place", "<f8", 3), ("colour", "u1", 3)])
    rows["place"], rows["colour"] = places, colour
    return ("\n".join(head) + "\n").encode() + rows.tobytes()
