"""A scene as text: what was placed, how well it fits, and what its scale rests on."""

from __future__ import annotations

from collections.abc import Iterator
from textwrap import wrap

import numpy as np

from ..scale import Scaled
from ..scene import Scene

WIDTH = 100


def text(scene: Scene, done: Scaled | None = None) -> str:
    """Figures of the scene, one a line; with the scale's sources, and the check sizes."""
    return "\n".join([*_scene(scene), *(_scale(done) if done is not None else ())])


def _scene(scene: Scene) -> Iterator[str]:
    placed, all_of = len(scene.names), len(scene.names) + len(scene.left_out)
    tracks = scene.tracks
    residual = scene.residual_px()
    rms = float(np.sqrt(np.nanmean(residual**2))) if len(residual) else float("nan")
    yield f"pictures: {placed} of {all_of} placed, with {len(set(map(int, scene.camera_of)))} camera(s)"
    yield (f"points: {len(scene.points)}, seen {len(scene.view)} times, {tracks.mean() if len(tracks) else 0:.1f} pictures each; "
           f"residuals {rms:.2f} px rms, u of a place in a picture {scene.sigma_px:.2f} px")  # fmt: skip
    for c in sorted(set(map(int, scene.camera_of))):
        camera = scene.cameras[c]
        yield f"camera {c + 1}: f = {float(camera.f_px):.1f} ± {1.96 * camera.u_f_px:.1f} px (95 %), {camera.source}"
    if scene.inflation > 1.05:
        yield f"halves of the points differ {scene.inflation:.1f} times as much as their noise says; the places' u is widened by that"
    for note in scene.notes:
        yield from wrap(f"note {note.code}: {note.text}; {note.cure}", WIDTH, subsequent_indent="  ")


def _scale(done: Scaled) -> Iterator[str]:
    yield f"scale: known to {100 * done.relative_u:.2g} % (1s), from {done.scene.scale_source}"
    wide = max(len(one.label) for one in done.said)
    for one in done.said:
        apart = one.found_m - one.length_m
        unit, factor = ("", 1.0) if one.kind in ("shape", "positions") else (" m", 1.0)
        kept = "check  " if one.check else f"{100 * one.weight:5.1f} %"
        times = f"{abs(apart) / one.u_m:.1f} u" if one.u_m > 0 else ""
        size = f"{one.length_m * factor:.4g}{unit}" if unit else "size"
        yield f"  {kept}  {one.label:<{wide}}  {size:>10}  {1000 * apart:+9.2f} {'mm' if unit else '‰ '}  {times}"
    if done.check_rms_m is not None:
        yield f"  check distances: {1000 * done.check_rms_m:.2f} mm rms"
