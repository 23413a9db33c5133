"""Sheets and edges found by themselves against truth: rendered pictures, the example pictures, and real ones with truth."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT / "tests" / "synthetic"))

import sheet_scenes as scenes  # noqa: E402

from subtense import Photo, Quantity  # noqa: E402
from subtense.detection import Search, unknown_curve  # noqa: E402
from subtense.detectors.sheets import sheets  # noqa: E402
from subtense.edges import width_along  # noqa: E402
from subtense.errors import NothingFoundError  # noqa: E402
from subtense.methods import same_plane  # noqa: E402
from subtense.observation import Observation  # noqa: E402
from subtense.targets import KnownTarget, find_target, targets  # noqa: E402
from subtense.workflow.detect import item_of  # noqa: E402
from subtense.workflow.in_photo import Item, measure_item  # noqa: E402
from subtense.workflow.resolve_camera import resolve_camera  # noqa: E402

DATA = ROOT.parent / "shared" / "data"
Row = tuple[str, ...]
HEAD: Row = ("picture", "what", "truth", "answer", "u", "inside 95 %")
LOADING = """[frc-loading]
title = "lit frame, 11 x 7 in"
width_mm = 279.4
height_mm = 177.8
spread_mm = 2.0
source = "FRC 2020"
"""


def row(picture: str, what: str, true: float, m, unit: str = "m") -> Row:
    """One line of the table."""
    inside = "yes" if m.low < true < m.high else f"no, {(m.value - true) / m.u:+.1f} u"
    factor, digits = (1000.0, 1) if unit == "mm" else (1.0, 3)
    answer, u = factor * m.value, factor * m.u
    return picture, what, f"{factor * true:.{digits}f} {unit}", f"{answer:.{digits}f} {unit}", f"{u:.{digits}f}", inside


def found(photo: Photo, target: KnownTarget, resolved):
    """Detections of one kind that was told."""
    return sheets(photo, Search(targets=(target,), camera=resolved.camera))


def examples() -> list[Row]:
    """The sheet and the card on the desk, by the photo's metadata."""
    objects = {o["name"]: o for p in json.loads((ROOT / "examples" / "truth.json").read_text())["pictures"]
               if p["file"] == "desk.jpg" for o in p["objects"]}  # fmt: skip
    photo = Photo.load(ROOT / "examples" / "desk.jpg")
    resolved, out = resolve_camera(photo), []
    for name, kind in (("a4", "a4"), ("card", "id-1")):
        true = float(np.linalg.norm(np.mean([p["camera_m"] for p in objects[name]["points"]], axis=0)))
        for one in found(photo, find_target(kind), resolved):
            m = measure_item(item_of(one), photo, resolved).measurements[0]
            out.append(row("desk.jpg", f"{kind}, range", true, m))
    return out


def loading(tmp: Path) -> list[Row]:
    """A lit frame of tape at 84 and 108 inches; nearer its proportions are not those stated, or it is cut."""
    (tmp / "own.toml").write_text(LOADING)
    target, folder = targets(tmp / "own.toml")["frc-loading"], DATA / "known_size" / "frc2020"
    truth, out = json.loads((folder / "truth.json").read_text()), []
    for name, said in truth["images"].items():
        if not name.startswith("Red"):
            continue
        photo = Photo.load(folder / name)
        resolved = resolve_camera(photo, f"f={truth['f_px']} ± 3 px")
        seen = found(photo, target, resolved)
        for one in seen:
            m = measure_item(item_of(one), photo, resolved).measurements[0]
            out.append(row(name, "frame of tape, range", said["ground_distance_m"], m))
        if not seen:
            out.append((name, "frame of tape, range", f"{said['ground_distance_m']:.3f} m", "not found", "", ""))
    return out


def coins() -> list[Row]:
    """Coins by callipers, beside a business card that was found; all lie on one table."""
    photo = Photo.load(DATA / "reference_object" / "coins_card" / "example_01.png")
    (card,) = sheets(photo, Search(targets=(find_target("business-card-us"),)))
    points = card.seen.points_px
    middle = [(points[0] + points[3]) / 2, (points[1] + points[2]) / 2]
    reference = width_along(photo, Observation(np.array(middle)))
    out = []
    for name, rough, true in (("quarter, left", ((42, 214), (90, 214)), 24.26), ("quarter", ((348, 206), (394, 206)), 24.26),
                              ("nickel", ((499, 227), (540, 227)), 21.21)):  # fmt: skip
        try:
            ends = width_along(photo, Observation(np.array(rough, float)), strip_px=5.0)
        except NothingFoundError:  # a rim of several lines, of which none is a clear edge
            out.append(("coins_card", name, f"{true:.1f} mm", "no clear edge", "", ""))
            continue
        inputs = {"reference": reference, "ends": ends, "length": find_target("business-card-us").width}
        m = measure_item(Item(same_plane.METHOD, inputs), photo, None).measurements[0]
        out.append(row("coins_card", name, true / 1000, m, "mm"))
    return out


def step() -> list[Row]:
    """The height of a step from a bank card that leans on its riser, by two clicks; the truth is known to 6 %, as limits."""
    out, true_m = [], 0.170
    for name, clicks in (("stepA_1.jpg", ((434, 432), (432, 160))),):
        photo = Photo.load(DATA / "reference_object" / "step_card" / name)
        resolved = resolve_camera(photo)
        for one in found(photo, find_target("id-1"), resolved):
            p, order = one.seen.points_px, np.array([1, 2])
            side = Observation(p[order], cov=one.seen.cov[2:6, 2:6])
            inputs = {"reference": side, "ends": Observation(np.array(clicks, float), 2.0),
                      "length": find_target("id-1").height, "camera": resolved.camera}  # fmt: skip
            m = measure_item(Item(same_plane.METHOD, inputs), photo, resolved).measurements[0]
            line = row(name, "height of the step (truth ± 6 %)", true_m, m, "mm")
            near = m.low < 1.06 * true_m and m.high > 0.94 * true_m
            out.append((*line[:-1], "yes" if near else line[-1]))
    return out


def rows() -> list[Row]:
    """Real and example pictures; the real ones only where they are at hand."""
    import tempfile

    out = [HEAD, *examples()]
    if DATA.is_dir():
        with tempfile.TemporaryDirectory() as folder:
            out += loading(Path(folder))
        out += [*coins(), *step()]
    return out


def rendered(count: int = 40) -> list[Row]:
    """Sheets to 60 degrees of tilt: how many are found, how far corners are off, and normalised errors."""
    table = [("tilt", "curve", "found", "rms of a corner", "mean u", "chi² / 8", "range inside 95 %")]
    for low, high in ((0, 20), (20, 40), (40, 60)):
        for curve in ("told", "unknown"):
            table.append(_rendered(low, high, curve, count))
            print(table[-1], flush=True)
    return table


def _rendered(low: int, high: int, curve: str, count: int) -> Row:
    from subtense import propagate
    from subtense.methods import pose
    from subtense.target import Target

    target, errors, u, chi2, inside = find_target("a4"), [], [], [], []
    drawn = 0
    for seed in range(count):
        rng = np.random.default_rng(seed)
        exponent = 2.2 if curve == "told" else float(np.clip(rng.normal(2.2, 0.5), 1.0, 3.4))
        photo, corners, camera, true = scenes.sheet(
            tilt=rng.uniform(low, high), axis=rng.uniform(0, 360), turn=rng.uniform(0, 360), distance_m=rng.uniform(0.6, 1.2),
            blur=rng.uniform(0.5, 1.6), noise=rng.uniform(1, 6), exponent=exponent, seed=seed, dark=rng.uniform(30, 120),
        )  # fmt: skip
        if np.any(corners < 0) or np.any(corners > [photo.width_px - 1, photo.height_px - 1]):
            continue  # cut by the border: not to be found
        drawn += 1
        told = Quantity.exact(2.2, "1") if curve == "told" else unknown_curve()
        seen = [one.seen for one in sheets(photo, Search(targets=(target,), camera=camera, curve=told))]
        if len(seen) != 1:
            continue
        off = (seen[0].points_px - scenes.in_order(seen[0].points_px, corners)).ravel()
        errors.append(off)
        u.append(np.sqrt(np.diag(seen[0].cov)).mean())
        chi2.append(off @ np.linalg.solve(seen[0].cov, off) / 8)
        known = Target.rectangle(Quantity.exact(0.297, "m"), Quantity.exact(0.210, "m"), "a4")
        m = propagate.measure(pose.METHOD, pose.Inputs(camera, seen[0], known))[0]
        inside.append(m.low < true < m.high)
    return (f"{low} to {high}°", curve, f"{len(errors)} of {drawn}", f"{np.sqrt(np.mean(np.square(errors))):.3f} px",
            f"{np.mean(u):.3f} px", f"{np.mean(chi2):.2f}", f"{100 * np.mean(inside):.0f} %")  # fmt: skip


def main() -> None:
    """Print both tables."""
    from accuracy import table

    print(table(rows()))
    print(table(rendered()))


if __name__ == "__main__":
    main()
