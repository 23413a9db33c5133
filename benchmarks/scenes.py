"""Accuracy of scenes: distances between cameras of real pictures, and lengths in rendered rooms, with the intervals that hold the truth."""

from __future__ import annotations

import itertools
import json
import tempfile
from pathlib import Path

import numpy as np
import scene_pictures as room
import test_reconstruct_real as real

from subtense import propagate
from subtense.methods import triangulation
from subtense.methods.reconstruction import Settings
from subtense.quantity import Quantity
from subtense.scale import Known, Scaled, scaled
from subtense.workflow.reconstruct import pictures_in, reconstructed
from subtense.workflow.reconstruct_measure import Asked, metric

DATA = Path(__file__).parent.parent.parent / "shared" / "data"
ROOMS = 5
FEATURES = 1000
Row = tuple[str, ...]
HEAD = ("scene", "scale by", "lengths", "largest error", "typical u", "chi-square / freedom (99 % below)")


def _row(name: str, by: str, done: Scaled, truth: dict[str, np.ndarray], truth_m: float) -> Row:
    relative, chi2, freedom = real.compared(done, truth, truth_m)
    views = done.scene.views()
    u = []
    for pair in itertools.combinations(views.names, 2):
        [m] = propagate.measure(triangulation.CAMERAS, triangulation.CamerasInputs(views.subset(pair)))
        u.append(float(m.u or 0.0) / m.value)
    return (name, by, str(len(relative)), f"{100 * np.max(abs(relative)):.2f} %", f"{100 * np.median(u):.2f} %",
            f"{chi2:.1f} / {freedom} ({real.quantile_99(freedom):.1f})")  # fmt: skip


def _cameras(truth: dict[str, np.ndarray], a: str, b: str, u_m: float) -> Known:
    return Known("cameras", Quantity.normal(float(np.linalg.norm(truth[a] - truth[b])), u_m, "m"), names=(a, b))


def pictures() -> list[Row]:
    """The fountain at half its size with 3 000 features of each picture, and rendered frames with exact poses."""
    folder = DATA / "sfm" / "fountain_P11"
    centres = json.loads((folder / "truth.json").read_text())["centres"]
    truth = {name: np.array(place) for name, place in centres.items()}
    scene = real.scene_of(sorted(folder.glob("*.jpg")), "f=1380 ± 14 px", 3000)
    names, u = scene.names, real.TRUTH_M * 2**0.5
    rows = [HEAD]
    for by, a, b in (
        ("its longest distance, 8.46 m", names[0], names[-1]),
        ("its shortest distance, 1.71 m", names[0], names[1]),
    ):
        rows.append(
            _row("fountain P11, 6 pictures", by, scaled(scene, [_cameras(truth, a, b, u)]), truth, real.TRUTH_M)
        )
    places = np.array([truth[name] for name in names])
    known = Known("positions", Quantity.exact(1.0, "1"), names=names, places_m=places, sigma_m=real.TRUTH_M)
    rows.append(
        _row("fountain P11, 6 pictures", "positions of all cameras", scaled(scene, [known]), truth, real.TRUTH_M)
    )
    rows.append(_frames())
    return rows


def _frames() -> Row:
    folder = DATA / "metric_depth" / "rgbd_sequence"
    scene = real.scene_of(sorted(folder.glob("*.jpg")), "f=525 ± 3 px", 3000)
    lines = (folder / "trajectory.log").read_text().splitlines()
    truth = {f"{i:05}.jpg": np.array([float(r.split()[3]) for r in lines[5 * i + 1 : 5 * i + 4]]) for i in range(5)}
    done = scaled(scene, [_cameras(truth, "00000.jpg", "00004.jpg", 1e-5)])
    return _row("rendered room, 5 frames 2.5 cm apart, 2 m deep", "its longest distance, 9.8 cm", done, truth, 1e-6)


def rendered() -> list[Row]:
    """Rooms of other textures: distances of cameras by a marker, and by one distance."""
    rows = [HEAD]
    for seed in range(ROOMS):
        with tempfile.TemporaryDirectory() as folder:
            _, centre = room.write(Path(folder) / "room", room.TAKEN[:5], seed=10 + seed)
            paths = pictures_in(Path(folder) / "room")
            scene = reconstructed(paths, camera="f=600 ± 6 px", settings=Settings(most_features=FEATURES))
            truth = {f"{i}.png": place for i, place in enumerate(centre)}
            rows.append(
                _row(
                    f"room {seed + 1}",
                    "one distance",
                    scaled(scene, [_cameras(truth, "0.png", "3.png", 1e-5)]),
                    truth,
                    1e-7,
                )
            )
            asked = Asked(marker_size=Quantity.normal(room.MARKER_M, 1e-4, "m"))
            rows.append(
                _row(
                    f"room {seed + 1}",
                    "a marker of 300 mm",
                    metric(scene, {p.name: p for p in paths}, asked),
                    truth,
                    1e-7,
                )
            )
    return rows
