"""Accuracy against truth, into docs/accuracy.md: simulated coverage, the example pictures, and real pictures.

The real pictures lie outside the repository (../shared/data); without them their part of the page is left as it is.

    python benchmarks/accuracy.py [TABLE...]
"""

import json
import re
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT / "tests" / "synthetic"))
sys.path.insert(0, str(ROOT / "tests"))

import calibrations  # noqa: E402
import circles  # noqa: E402
import ground  # noqa: E402
import markers  # noqa: E402
import plane_conditions  # noqa: E402
import planes  # noqa: E402
import scenes  # noqa: E402
import sheets  # noqa: E402
import stereo_accuracy  # noqa: E402
import test_apriltag_library as tags  # noqa: E402
import test_coverage as coverage  # noqa: E402
import test_real_pictures as real  # noqa: E402
import test_rim_coverage as rims  # noqa: E402
import together  # noqa: E402

from subtense import Photo, Quantity, measure_lines, measure_markers, resolve_camera  # noqa: E402
from subtense.methods import known_distance, known_size, pose, same_plane, sphere  # noqa: E402
from subtense.observation import Observation  # noqa: E402

PAGE = ROOT / "docs" / "accuracy.md"
DATA = ROOT.parent / "shared" / "data"
REPEATS = 200
"""Of simulated calibrations."""
PLACE_U_M = 0.0005
"""u of where the faces of the april_vision tags stand: all alike they are measured 0.6 mm before the listed places."""
Row = tuple[str, ...]


def percent(x: float, digits: int = 1) -> str:
    """A share as a percentage."""
    return f"{100 * x:.{digits}f} %"


def simulated() -> list[Row]:
    """Coverage of the headline, share of truths below the interval, u of the headline, for 1,000 scenes a geometry."""
    rows = [("method", "geometry", "intervals that hold the truth", "truth below / above", "typical u")]
    jobs = [(known_size.METHOD, coverage.known_size_scene, kind) for kind in coverage.GEOMETRY]
    jobs += [(known_distance.METHOD, coverage.known_distance_scene, kind) for kind in coverage.GEOMETRY]
    jobs += [(same_plane.METHOD, coverage.plane_scene, kind) for kind in coverage.PLANES]
    jobs += [(pose.METHOD, coverage.marker_scene, kind) for kind in ("near", "typical", "tilted")]
    jobs += [(rims.without_tilt(), rims.disc_scene, kind) for kind in rims.DISCS]
    jobs += [(sphere.METHOD, rims.ball_scene, kind) for kind in rims.BALLS]
    for method, make, kind in jobs:
        hit, below, _, width, _ = coverage.score(method, make, kind)
        above = 1 - hit.mean(axis=0) - below.mean(axis=0)
        u = percent(float(np.median(width[:, 0])) / 3.92)
        sides = f"{percent(float(below[:, 0].mean()))} / {percent(float(above[0]))}"
        rows.append((method.name, kind, percent(float(hit[:, 0].mean())), sides, u))
        print(rows[-1], flush=True)
    return rows


def examples() -> list[Row]:
    """The example pictures by their metadata alone."""
    pictures = {p["file"]: p for p in json.loads((ROOT / "examples" / "truth.json").read_text())["pictures"]}
    things = (
        ("desk.jpg", "marker", None, 0.05), ("belt.jpg", "package_top", ("left_edge_middle", "right_edge_middle"), 0.2),
        ("street.jpg", "person", ("soles", "head_top"), 1.75), ("street.jpg", "car_rear", ("bottom_left", "bottom_right"), 1.8),
        ("facade.jpg", "door", ("bottom_left", "top_left"), 2.1),
    )  # fmt: skip
    rows = [("picture", "what", "true range", "measured", "95 %", "error", "in u")]
    for file, thing, ends, size in things:
        known = {p["name"]: p for p in next(o for o in pictures[file]["objects"] if o["name"] == thing)["points"]}
        pair = [known[name] for name in ends] if ends else list(known.values())
        true = float(np.linalg.norm(np.mean([p["camera_m"] for p in pair], axis=0)))
        photo, length = Photo.load(ROOT / "examples" / file), Quantity.interval(size, 0.005 * size, "m")
        if ends:
            document = measure_lines(photo, [Observation(np.round([p["pixel_px"] for p in pair]))], [length])
        else:
            document = measure_markers(photo, length)
        rows.append((file, thing.replace("_", " "), f"{true:.3f} m", *outcome(document.measurements[0], true)))
    return rows


def outcome(m, true: float, u_true: float = 0.0) -> Row:
    """Measured value, interval, relative error, and the error in u, that of the truth included."""
    interval = f"{m.low:.4g} to {m.high:.4g} m"
    return (
        f"{m.value:.4g} m",
        interval,
        percent(m.value / true - 1, 2),
        f"{(m.value - true) / np.hypot(m.u, u_true):+.1f} u",
    )


def frc_2019() -> list[Row]:
    """Width of a lit target at 21 to 108 inches, camera from its calibration."""
    folder = DATA / "known_size" / "frc2019"
    truth = json.loads((folder / "truth.json").read_text())
    rows = [("picture", "true depth", "measured", "95 %", "error", "in u")]
    for name, distance in truth["images"].items():
        photo = Photo.load(folder / name)
        size = Quantity.interval(truth["known_width_m"], 0.002, "m")
        document = measure_lines(
            photo, [Observation(real.ends_of_green(photo), 0.7)], [size], camera=f"f={truth['f_px']} ± 3 px"
        )
        depth = next(m for m in document.measurements if m.what == "depth")
        rows.append((name, f"{distance:.3f} m", *outcome(depth, distance)))
    return rows


def april_vision(tmp: Path) -> list[Row]:
    """Tags of 0.2 m at 1 and 2 m, synthetic pictures of another project, camera known."""
    path, pictures = real.april_vision(DATA / "fiducial" / "april_vision_synth", tmp)
    rows = [("picture", "true range", "measured", "95 %", "error", "in u")]
    for picture, true in pictures:
        document = measure_markers(Photo.load(picture), Quantity.exact(0.2, "m"), camera=str(path))
        rows.append((picture.name, f"{true:.4f} m", *outcome(document.measurements[0], true, PLACE_U_M)))
    return rows


def frc_2024() -> list[Row]:
    """Tags of 6.5 in whose plane was taped, roughly, perpendicular to it; every tag in the picture."""
    rows = [("picture", "tag", "taped", "measured", "95 %", "off")]
    for name, true in (("Amp_42in.jpg", 1.0668), ("Loading_83in.jpg", 2.1082)):
        photo = Photo.load(DATA / "fiducial" / "frc2024" / name)
        found = measure_markers(photo, Quantity.interval(0.1651, 0.0005, "m"), camera="f=1127.5 ± 16 px").measurements
        for far, tilt in zip(
            (m for m in found if m.what == "range"), (m for m in found if m.what == "tilt"), strict=True
        ):
            share = float(np.cos(tilt.value))  # of the range, to the plane
            rows.append(
                (
                    name,
                    far.label,
                    f"{true:.2f} m",
                    f"{far.value * share:.3f} m",
                    f"{far.low * share:.3f} to {far.high * share:.3f} m",
                    f"{100 * (far.value * share / true - 1):+.1f} %",
                )
            )
    return rows


def focal_lengths() -> list[Row]:
    """Focal length from the metadata against a calibration of the same camera."""
    cases = (
        ("iPhone 8 Plus", "exif_intrinsics/iphone8plus/IMG_1443.jpg", 3280.1),
        ("Kodak Z612", "exif_intrinsics/kodak_sceaux/100_7100.JPG", 2905.88),
        ("DJI FC300S, 16:9", "ground_plane/drone_nadir/DJI_0024.JPG", 2344.0),
    )  # fmt: skip
    rows = [("camera", "calibrated f", "from the metadata", "95 %", "error")]
    for name, file, f_px in cases:
        camera = resolve_camera(Photo.load(DATA / file)).camera
        half = 1.96 * camera.u_f_px
        interval = f"{camera.f_px - half:.0f} to {camera.f_px + half:.0f} px"
        rows.append((name, f"{f_px:.0f} px", f"{camera.f_px:.0f} px", interval, percent(camera.f_px / f_px - 1)))
    return rows


def calibration_spread() -> list[Row]:
    """Stated over observed standard deviation of each intrinsic number."""
    rows: list[Row] = [("lens model", "number", "stated u", "spread seen", "stated / seen")]
    for name in calibrations.LENSES:
        for what, stated, seen in zip(*calibrations.spreads(name, REPEATS), strict=True):
            rows.append((name, what, f"{stated:.3g}", f"{seen:.3g}", f"{stated / seen:.2f}"))
        print(rows[-1], flush=True)
    return rows


def calibration_faults() -> list[Row]:
    """What is noticed, and whether the interval of the focal length holds the truth."""
    rows: list[Row] = [
        ("fault", "any note", "the right note", "interval holds the truth", "mean error of f", "mean u of f")
    ]
    for name in calibrations.FAULTS:
        found = calibrations.score(name, REPEATS)
        rightly = "-" if name.startswith("none") else percent(found.rightly)
        rows.append(
            (
                name,
                percent(found.noted),
                rightly,
                percent(found.covered),
                f"{found.bias_px:+.2f} px",
                f"{found.u_px:.2f} px",
            )
        )
        print(rows[-1], flush=True)
    return rows


def calibration_real() -> list[Row]:
    """Real sets of pictures with the default options."""
    from subtense.board import Board
    from subtense.workflow.calibrate import calibrate, calibrate_rig

    folder = DATA / "calibration"
    chess, charuco = Board("chessboard", 10, 7, 0.025), Board("charuco", 8, 8, 0.0254, 0.01905, "4x4_1000")
    left, right = (sorted((folder / "opencv_stereo_chess").glob(f"{side}*.jpg")) for side in ("left", "right"))
    rows: list[Row] = [("pictures", "used", "model", "rms", "f", "95 %", "others say")]
    for name, paths, board, others in (
        ("OpenCV, left", left, chess, "rms 0.195 px, f 532.8 px"),
        ("LifeCam, ChArUco", sorted((folder / "charuco_1280").glob("*.jpg")), charuco, "rms 0.250 px, f 1127.5 px"),
        (
            "LifeCam, chessboard",
            sorted((folder / "chess_480").glob("*.png")),
            Board("chessboard", 11, 11, 0.0254),
            "f 705.3 px",
        ),
    ):
        found = calibrate(paths, board)
        f, half = float(found.camera.f_px), 1.96 * found.camera.u_f_px
        rows.append((name, f"{len(found.used)} of {len(paths)}", found.models[0], f"{found.solution.rms_px:.3f} px", f"{f:.1f} px",
                     f"{f - half:.1f} to {f + half:.1f} px", others))  # fmt: skip
    found = calibrate_rig(left, right, chess)
    assert found.rig is not None
    b, half = 1000 * found.rig.baseline_m, 1960 * found.rig.u_baseline_m
    rows.append(("OpenCV, stereo baseline", f"{len(found.used)} of {2 * len(left)}", found.models[0], f"{found.solution.rms_px:.3f} px",
                 f"{b:.2f} mm", f"{b - half:.2f} to {b + half:.2f} mm", "83.4 mm"))  # fmt: skip
    return rows


def table(rows: list[Row]) -> str:
    """Rows as a Markdown table."""
    head, *body = ("| " + " | ".join(row) + " |" for row in rows)
    return "\n".join([head, "|" + " --- |" * len(rows[0]), *body])


def put(name: str, rows: list[Row]) -> None:
    """Write a table between its markers on the page."""
    text = PAGE.read_text()
    block = f"<!-- {name} -->\n\n{table(rows)}\n\n<!-- end -->"
    PAGE.write_text(re.sub(rf"<!-- {name} -->.*?<!-- end -->", lambda _: block, text, flags=re.DOTALL))


def families() -> list[Row]:
    """A drawn tag of each family that has data outside its border."""
    rows = [("family", "read as", "largest error of a corner")]
    for family in tags.FAMILIES:
        found, error = tags.located(family)
        rows.append((family, found.label, f"{float(np.abs(error).max()):.3f} px"))
    return rows


def april_vision_in_a_folder() -> list[Row]:
    """`april_vision` with a folder for its camera file."""
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        return april_vision(Path(folder))


TABLES: dict[str, Callable[[], list[Row]]] = {
    "examples": examples, "frc2019": frc_2019, "focal": focal_lengths, "april_vision": april_vision_in_a_folder,
    "calibration_real": calibration_real, "frc2024": frc_2024, "planes_real": planes.pictures, "ground_real": ground.pictures,
    "families": families,
    "marker_cov": markers.covariance_rows,
    "markers": markers.rows, "marker_bias": markers.bias_rows, "circles": circles.rows, "circles_rendered": circles.rendered,
    "sheets": sheets.rows, "sheets_rendered": sheets.rendered, "simulated": simulated, "planes": planes.simulated,
    "gross_clicks": planes.gross_clicks, "line_cameras": planes.cameras, "ground": ground.simulated, "together": together.rows,
    "plane_conditions": plane_conditions.simulated, "plane_conditions_real": plane_conditions.pictures,
    "calibration_spread": calibration_spread, "calibration_faults": calibration_faults,
    "scenes_real": scenes.pictures, "scenes_rendered": scenes.rendered,
    "stereo": stereo_accuracy.depths, "stereo_rows": stereo_accuracy.chess,
}  # fmt: skip
"""What stands between its markers on the page, by their name."""
REAL = (
    "frc2019",
    "focal",
    "april_vision",
    "calibration_real",
    "frc2024",
    "planes_real",
    "ground_real",
    "plane_conditions_real",
    "scenes_real",
    "stereo",
    "stereo_rows",
)
"""Those of pictures outside the repository."""


def main(names: Sequence[str]) -> None:
    """Measure the named tables, or all, and rewrite the page."""
    for name in names or TABLES:
        if name not in REAL or DATA.is_dir():
            put(name, TABLES[name]())


if __name__ == "__main__":
    main(sys.argv[1:])
