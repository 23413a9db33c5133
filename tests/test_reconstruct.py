"""Scenes from pictures by themselves: truth by rendered pictures, scales of all kinds, refusals, and files."""

import dataclasses
import io
import itertools
import json
import struct
import sys
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image
from PIL.TiffImagePlugin import IFDRational
from tests import scene_pictures as room

from subtense.camera import Camera
from subtense.cli import main
from subtense.errors import FileFormatError, GeometryError, InputError, MissingExtraError, NothingFoundError
from subtense.methods.reconstruction import Settings, colmap_camera
from subtense.quantity import Quantity
from subtense.scale import Known, scaled
from subtense.scene_files import colmap, geojson, las, opensfm, ply
from subtense.views import Views
from subtense.workflow.reconstruct import opened_scene, pictures_in, reconstructed
from subtense.workflow.reconstruct_board import read_board
from subtense.workflow.reconstruct_input import read_positions
from subtense.workflow.reconstruct_measure import Asked, measurements, metric
from subtense.workflow.reconstruct_rig import read_pairs, rig_of, write_pairs

pytest.importorskip("pycolmap")
pytestmark = pytest.mark.opencv

NAMES = tuple(f"{i}.png" for i in range(5))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("room") / "pictures"
    room.write(path, room.TAKEN[:5])
    return path


@pytest.fixture(scope="module")
def scene(folder):
    return reconstructed(pictures_in(folder), camera="f=600 ± 6 px", settings=Settings(most_features=1000))


@pytest.fixture(scope="module")
def photos(folder):
    return {name: folder / name for name in NAMES}


ROTATION, CENTRE = room.poses(room.TAKEN[:5])


def apart(a, b):
    return float(np.linalg.norm(CENTRE[a] - CENTRE[b]))


def known(a, b, u=1e-4, **more):
    return Known(
        "cameras", Quantity.normal(apart(a, b), u, "m"), names=(NAMES[a], NAMES[b]), label=f"{a} to {b}", **more
    )


def test_all_pictures_are_placed(scene):
    assert scene.names == NAMES and scene.left_out == () and not scene.metric
    assert scene.cameras[0].u_f_px < 3 and abs(scene.cameras[0].f_px - room.F) < 3 * scene.cameras[0].u_f_px
    assert 0.03 < scene.sigma_px < 0.3 and [n.code for n in scene.notes] == []


def lengths(views):
    pairs = list(itertools.combinations(range(len(NAMES)), 2))
    found = np.array([np.linalg.norm(views.centre_m[a] - views.centre_m[b]) for a, b in pairs])
    slopes = np.zeros((len(pairs), len(views.covariance)))
    for row, (a, b) in enumerate(pairs):
        along = (views.centre_m[a] - views.centre_m[b]) / found[row]
        slopes[row, 6 * a + 3 : 6 * a + 6], slopes[row, 6 * b + 3 : 6 * b + 6] = along, -along
    return found, np.array([apart(a, b) for a, b in pairs]), slopes


def test_global_mapping_of_pictures_matched_by_position(folder):
    places = {name: (float(x), float(y), float(z)) for name, (x, y, z) in zip(NAMES, CENTRE, strict=True)}
    settings = Settings("position", "global", 1000)
    found = reconstructed(pictures_in(folder), camera="f=600 ± 6 px", settings=settings, positions=places)
    done = scaled(found, [known(0, 3)])
    assert sorted(done.scene.names) == sorted(NAMES)
    at = dict(zip(done.scene.names, done.scene.centre, strict=True))
    assert np.linalg.norm(at["1.png"] - at["4.png"]) == pytest.approx(apart(1, 4), rel=0.005)


def test_distances_hold_with_their_whole_covariance(scene):
    done = scaled(scene, [known(0, 3)])
    views = done.scene.views()
    found, truth, slopes = lengths(views)
    cov = slopes @ views.covariance @ slopes.T + np.outer(found, found) * views.u_scale**2
    assert np.max(abs(found / truth - 1)) < 0.003
    values, vectors = np.linalg.eigh(cov)
    free = values > 1e-6 * values[-1]
    along = (vectors[:, free].T @ (found - truth)) / np.sqrt(values[free])
    chi2, freedom = float(along @ along), int(free.sum())
    assert chi2 < freedom * (1 - 2 / (9 * freedom) + 2.326 * (2 / (9 * freedom)) ** 0.5) ** 3


def test_a_reference_is_as_long_as_it_is_said_to_be(scene):
    """Its own length has the u that was said; what the places add to the scale cancels there."""
    views = scaled(scene, [known(0, 3, 1e-3)]).scene.views()
    found, _, slopes = lengths(views)
    row = list(itertools.combinations(range(5), 2)).index((0, 3))
    u = np.sqrt(slopes[row] @ views.covariance @ slopes[row] + (found[row] * views.u_scale) ** 2)
    assert found[row] == pytest.approx(apart(0, 3), rel=1e-9) and u == pytest.approx(1e-3, rel=1e-3)


def test_markers_give_the_scale_by_themselves(scene, photos):
    asked = Asked(
        marker_size=Quantity.normal(room.MARKER_M, 1e-4, "m"), checks=(f"0.png -> 3.png = {apart(0, 3)} m ± 0.1 mm",)
    )
    done = metric(scene, photos, asked)
    [marker, check] = done.said
    assert done.relative_u < 0.004 and marker.kind == "shape" and done.notes == ()
    assert abs(check.found_m - check.length_m) < 2.6 * check.u_m and check.check
    assert done.check_rms_m == pytest.approx(abs(check.found_m - check.length_m))


def test_a_wrong_size_is_seen_by_the_others(scene, photos):
    wrong = Known("cameras", Quantity.normal(1.03 * apart(1, 2), 1e-4, "m"), names=(NAMES[1], NAMES[2]), label="wrong")
    done = scaled(scene, [known(0, 3), known(1, 4), wrong])
    assert [n.code for n in done.notes] == ["scales_disagree"] and "wrong" in done.notes[0].text
    assert done.relative_u > 3 * scaled(scene, [known(0, 3), known(1, 4)]).relative_u
    checked = scaled(scene, [known(0, 3), dataclasses.replace(wrong, check=True)])
    assert [n.code for n in checked.notes] == ["check_failed"]


def test_a_board_gives_the_scale(scene, tmp_path):
    """The same places, with a ChArUco board of 10 cm squares on the back wall."""
    import cv2

    board = cv2.aruco.CharucoBoard((9, 7), 0.1, 0.075, cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_100))
    drawn, rng = room.planes(), np.random.default_rng(8)
    size = (9 * room.PX_PER_M // 10, 7 * room.PX_PER_M // 10)
    drawn[0][1][240 : 240 + size[1] + 60, 270 : 270 + size[0] + 60] = 240
    drawn[0][1][270 : 270 + size[1], 300 : 300 + size[0]] = board.generateImage(size)
    files = {}
    for i, name in enumerate(NAMES):
        cv2.imwrite(str(tmp_path / name), room.render(ROTATION[i], CENTRE[i], drawn, rng))
        files[name] = tmp_path / name
    asked = Asked(board=read_board("charuco, 9x7, 100 ± 0.2 mm, 75 mm, 5x5_100"),
                  checks=(f"0.png -> 3.png = {apart(0, 3)} m ± 0.1 mm",))  # fmt: skip
    done = metric(scene, files, asked)
    [shape, check] = done.said
    assert shape.kind == "shape" and done.relative_u < 0.004
    assert abs(check.found_m - check.length_m) < 2.6 * check.u_m
    with pytest.raises(NothingFoundError, match="two pictures"):
        metric(scene, files, Asked(board=read_board("charuco, 8x6, 25 mm, 18 mm, 4x4_50")))
    for text in ("charuco", "charuco, 8x6, 25 mm", "wall, 8x6, 25 mm", "chessboard, 0x0, 25 mm"):
        with pytest.raises(InputError):
            read_board(text)


def test_one_tape_errs_once(scene):
    tape = Quantity.normal(apart(0, 3), 0.01 * apart(0, 3), "m", "tape")
    same = scaled(scene, [Known("cameras", tape, names=("0.png", "3.png")) for _ in range(2)])
    assert same.relative_u == pytest.approx(
        scaled(scene, [Known("cameras", tape, names=("0.png", "3.png"))]).relative_u
    )
    two = scaled(scene, [known(0, 3, 0.01), known(1, 3, 0.01)])
    assert two.relative_u < 0.9 * scaled(scene, [known(0, 3, 0.01)]).relative_u


def test_points_are_found_in_other_pictures(scene, photos):
    """A point set in one picture: its range holds the truth; a length between two as well."""
    done = scaled(scene, [known(0, 3)])
    corners = room.marker_corners()[:2] + np.array([[0.03, 0.1, 0], [0.3, 0.1, 0]])
    pixels = [room.seen(ROTATION[1], CENTRE[1], p) for p in corners]
    texts = [f"1.png:{x:.2f},{y:.2f} ± 0.2px" for x, y in pixels]
    found = measurements(done, photos, [texts[0], f"{texts[0]} -> {texts[1]}", f"2.png -> {texts[0]}"]).measurements
    reach = found[0]
    assert len(reach.given["point"]["names"]) >= 3
    assert [note.code for note in reach.notes] == ["point_found"] and "3.png:" in reach.notes[0].text
    assert reach.low < np.linalg.norm(corners[0] - CENTRE[1]) < reach.high
    length, from_camera = found[2], found[3]
    assert length.low < np.linalg.norm(corners[1] - corners[0]) < length.high and length.u < 0.005
    assert from_camera.low < np.linalg.norm(corners[0] - CENTRE[2]) < from_camera.high


def test_the_height_of_a_camera_gives_the_scale(scene, photos):
    on_wall = room.marker_corners()[:3]
    ends = [
        "; ".join(f"{i}.png:{x:.3f},{y:.3f}" for i in (0, 2, 3) for x, y in [room.seen(ROTATION[i], CENTRE[i], p)])
        + " ± 0.05px"
        for p in on_wall
    ]
    off = room.SIZE - CENTRE[0][2]
    done = metric(scene, photos, Asked(heights=(f"0.png = {off} m ± 1 mm over {' | '.join(ends)}",),
                                       checks=(f"0.png -> 3.png = {apart(0, 3)} m ± 0.1 mm",)))  # fmt: skip
    assert abs(done.said[1].found_m - done.said[1].length_m) < 3 * done.said[1].u_m and done.relative_u < 0.02


def table(path, rows, head="name,x,y,z,u"):
    path.write_text("\n".join([head, *(",".join(map(str, row)) for row in rows)]), encoding="utf-8")
    return path


def test_positions_give_scale_and_frame(scene, photos, tmp_path):
    rng = np.random.default_rng(4)
    turn = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])
    places = CENTRE @ turn.T + [5e5, 5.6e6, 100] + rng.normal(0, 0.005, CENTRE.shape)
    file = table(
        tmp_path / "rtk.csv", [(name, *place, 0.005) for name, place in zip(NAMES, places.tolist(), strict=True)]
    )
    done = metric(scene, photos, Asked(positions=file, checks=(f"0.png -> 3.png = {apart(0, 3)} m ± 0.1 mm",)))
    assert abs(done.said[1].found_m - done.said[1].length_m) < 3 * done.said[1].u_m
    assert np.max(abs(done.scene.centre + done.scene.origin_m - places)) < 0.03
    assert done.scene.views().rotation[0] == pytest.approx(ROTATION[0] @ turn.T, abs=0.05)
    [only] = measurements(done, photos, ["0.png -> 1.png"]).measurements
    assert only.low < apart(0, 1) < only.high


def test_latitude_and_longitude(tmp_path, scene, photos):
    rows = [
        (name, 47 - CENTRE[i][0] / 111e3, 8 + CENTRE[i][2] / 76e3, 400 - CENTRE[i][1]) for i, name in enumerate(NAMES)
    ]
    told = read_positions(table(tmp_path / "g.csv", rows, "name,lat,lon,alt"))
    east, north = geojson.radii_m(np.radians(47), 400)
    assert east == pytest.approx(6378137 * np.cos(np.radians(47)), rel=5e-3) and north == pytest.approx(
        6.367e6, rel=3e-3
    )
    assert np.isnan(told.of["0.png"][1]).all()
    done = metric(scene, photos, Asked(positions=tmp_path / "g.csv", accuracy="1 cm (1s)"))
    features = json.loads(geojson.write(done.scene))["features"]
    assert features[2]["geometry"]["coordinates"][:2] == pytest.approx([rows[2][2], rows[2][1]], abs=3e-7)
    assert done.notes == ()
    rows[1] = (rows[1][0], rows[1][1] + 3e-6, *rows[1][2:])
    wrong = metric(
        scene, photos, Asked(positions=table(tmp_path / "w.csv", rows, "name,lat,lon,alt"), accuracy="1 cm (1s)")
    )
    assert [n.code for n in wrong.notes] == [
        "positions_misfit",
        "scale_doubtful",
    ] and wrong.relative_u > 3 * done.relative_u
    with pytest.raises(InputError, match="--accuracy"):
        metric(scene, photos, Asked(positions=tmp_path / "g.csv"))


def test_positions_in_the_pictures_own_files(tmp_path, scene, photos):
    """As a drone with RTK writes them, to a hundredth of a millimetre."""
    tagged = {}
    for i, name in enumerate(NAMES):
        with Image.open(photos[name]) as picture:
            exif = Image.Exif()
            exif[0x10F] = "M"  # Pillow writes none without a tag of the picture itself
            gps = exif.get_ifd(0x8825)
            for tag, ref, degrees in ((2, "N", 47 - CENTRE[i][0] / 111e3), (4, "E", 8 + CENTRE[i][2] / 76e3)):
                minutes = degrees % 1 * 60
                gps[tag - 1], gps[tag] = (
                    ref,
                    (int(degrees), int(minutes), IFDRational(round(minutes % 1 * 60e6), 1_000_000)),
                )
            gps[5], gps[6] = b"\0", IFDRational(round(1e5 * (400 - CENTRE[i][1])), 100_000)
            picture.save(tmp_path / name, exif=exif)
        tagged[name] = tmp_path / name
    done = metric(scene, tagged, Asked(positions=Path("tags"), accuracy="1 cm (1s)"))
    [only] = measurements(done, tagged, ["0.png -> 1.png"]).measurements
    assert only.low < apart(0, 1) < only.high
    with pytest.raises(InputError, match="0 of 5 pictures tell a position"):
        metric(scene, photos, Asked(positions=Path("tags"), accuracy="1 cm (1s)"))


def test_without_a_scale_there_are_no_metres(scene, photos):
    with pytest.raises(InputError, match="known distance"):
        scene.views()
    with pytest.raises(InputError, match="known distance"):
        metric(scene, photos, Asked(checks=("0.png -> 1.png = 1 m ± 1 mm",)))
    with pytest.raises(InputError, match="scale"):
        las.write(scene)


def test_points_that_do_not_meet_are_no_scale(scene, photos):
    with pytest.raises(GeometryError):
        metric(scene, photos, Asked(distances=("0.png:10,10; 3.png:630,470 -> 0.png:20,20; 3.png:600,10 = 1 m ± 1mm",)))


@pytest.mark.parametrize("form", [".bin", ".txt"])
def test_colmap_models_are_read_and_written(scene, tmp_path, form, photos):
    if form == ".txt":
        colmap.write(scene, tmp_path)
    else:
        import pycolmap

        colmap.write(scene, tmp_path)
        pycolmap.Reconstruction(str(tmp_path)).write_binary(str(tmp_path))
        [p.unlink() for p in tmp_path.glob("*.txt")]
    again = opened_scene(tmp_path)
    assert again.names == scene.names and len(again.points) == len(scene.points)
    assert (
        abs(
            np.median(np.linalg.norm(again.residual_px(), axis=1))
            - np.median(np.linalg.norm(scene.residual_px(), axis=1))
        )
        < 0.02
    )
    [m] = measurements(scaled(again, [known(0, 3)]), photos, ["1.png -> 4.png"]).measurements
    assert m.low < apart(1, 4) < m.high


def test_opensfm(scene, tmp_path, photos):
    """What OpenSfM and OpenDroneMap leave: normalised focal length and pixels, rotation vectors."""
    camera, side = scene.cameras[0], room.WIDTH
    import cv2

    shots = {name: {"rotation": cv2.Rodrigues(scene.rotation[i])[0].ravel().tolist(), "camera": "one",
                    "translation": (-scene.rotation[i] @ scene.centre[i]).tolist()} for i, name in enumerate(scene.names)}  # fmt: skip
    data = {"cameras": {"one": {"projection_type": "perspective", "width": room.WIDTH, "height": room.HEIGHT,
                                "focal": float(camera.f_px) / side, "k1": 0.0, "k2": 0.0}},
            "shots": shots,
            "points": {str(i): {"coordinates": p.tolist(), "color": [1, 2, 3]} for i, p in enumerate(scene.points)}}  # fmt: skip
    (tmp_path / "opensfm").mkdir()
    (tmp_path / "opensfm" / "reconstruction.json").write_text(json.dumps([data]))
    with pytest.raises(FileFormatError, match=r"tracks\.csv"):
        opened_scene(tmp_path)
    middle = (np.array([room.WIDTH, room.HEIGHT]) - 1) / 2
    rows = ["OPENSFM_TRACKS_VERSION_v2"]
    for v, p, xy in zip(scene.view, scene.point, scene.seen_px, strict=True):
        x, y = (xy - middle) / side
        rows.append(f"{scene.names[v]}\t{p}\t0\t{x:.8f}\t{y:.8f}\t0.001\t1\t2\t3\t-1\t-1")
    (tmp_path / "opensfm" / "tracks.csv").write_text("\n".join(rows))
    again = opened_scene(tmp_path)
    [m] = measurements(scaled(again, [known(0, 3)]), photos, ["1.png -> 4.png"]).measurements
    assert m.low < apart(1, 4) < m.high and m.u < 0.01
    assert opensfm.folder_of(tmp_path / "nowhere") is None


@pytest.mark.parametrize("cut", [0.0, 0.5, 0.95])
@pytest.mark.parametrize("which", ["cameras", "images", "points3D"])
def test_cut_models_are_told(scene, tmp_path, cut, which):
    import pycolmap

    colmap.write(scene, tmp_path)
    pycolmap.Reconstruction(str(tmp_path)).write_binary(str(tmp_path))
    path = tmp_path / f"{which}.bin"
    path.write_bytes(path.read_bytes()[: int(cut * path.stat().st_size)])
    with pytest.raises(FileFormatError) as error:
        opened_scene(tmp_path)
    assert len(str(error.value).splitlines()) == 1


def test_ply_and_las(scene):
    done = scaled(scene, [known(0, 3)]).scene
    head, _, body = ply.write(done).partition(b"end_header\n")
    assert b"metres" in head and len(body) == (len(done.points) + len(done.centre)) * 27
    assert np.frombuffer(body[:24], "<f8") == pytest.approx(done.points[0])
    data = las.write(done)
    (count,) = struct.unpack_from("<I", data, 107)
    (step,) = struct.unpack_from("<d", data, 131)
    assert data[:4] == b"LASF" and count == len(done.points) and len(data) == 227 + 26 * count
    assert np.frombuffer(data[227:239], "<i4") * step == pytest.approx(done.points[0], abs=1e-4)


def test_laz_is_the_same_compressed(scene):
    laspy = pytest.importorskip("laspy")
    pytest.importorskip("lazrs")
    done = scaled(scene, [known(0, 3)]).scene
    plain, packed = las.write(done), las.write_compressed(done)
    assert len(packed) < 0.7 * len(plain)
    one, other = (laspy.read(io.BytesIO(content)) for content in (plain, packed))
    assert one.xyz == pytest.approx(other.xyz, abs=1e-9) and np.array_equal(one.red, other.red)


def test_without_laspy_laz_says_what_to_install(scene, monkeypatch):
    monkeypatch.setitem(sys.modules, "laspy", None)
    with pytest.raises(MissingExtraError, match="laz"):
        las.write_compressed(scaled(scene, [known(0, 3)]).scene)


def test_cameras_for_colmap():
    model, params = colmap_camera(Camera(640, 480, 500.0, 319.5, 239.5))
    assert model == "RADIAL" and params[:3] == [500.0, 320.0, 240.0]
    lens = Camera(640, 480, 500.0, 319.5, 239.5, 1.01, "brown_conrady", np.array([0.1, 0.01, 1e-3, 0, 1e-3]))
    assert colmap_camera(lens)[0] == "FULL_OPENCV"
    with pytest.raises(InputError):
        colmap_camera(Camera(640, 320, 100.0, 319.5, 159.5, lens="equirectangular"))


def run(*words):
    return CliRunner().invoke(main, ["reconstruct", *map(str, words)], catch_exceptions=False)


def test_on_the_command_line(scene, folder, tmp_path):
    """An existing scene, its pictures beside it: text, JSON, and views that `triangulate` takes."""
    model = tmp_path / "sparse" / "0"
    model.mkdir(parents=True)
    colmap.write(scene, model)
    words = [
        tmp_path,
        "--photos",
        folder,
        "--distance",
        f"0.png -> 3.png = {apart(0, 3)} m ± 1 mm",
        "--measure",
        "1.png -> 4.png",
    ]
    result = run(*words, "-o", tmp_path / "out.json", "-o", tmp_path / "out.ply", "-o", tmp_path / "colmap")
    assert result.exit_code == 0 and "pictures: 5 of 5" in result.output and "scale: known to" in result.output
    assert (tmp_path / "colmap" / "images.txt").is_file() and (tmp_path / "out.ply").is_file()
    data = json.loads((tmp_path / "out.json").read_text())
    assert data["schema"] == "subtense-scene/1" and data["scale"]["said"][0]["weight"] == 1.0
    views = Views.from_json(data["views"])
    assert views.names == NAMES
    point = "; ".join(
        "{}:{:.2f},{:.2f}".format(NAMES[i], *room.seen(ROTATION[i], CENTRE[i], room.marker_corners()[0]))
        for i in (1, 3)
    )
    again = CliRunner().invoke(
        main, ["triangulate", "--views", str(tmp_path / "out.json"), "--point", point, "--format", "json"]
    )
    reach = json.loads(again.output)["measurements"][0]
    assert reach["low"] < np.linalg.norm(room.marker_corners()[0] - CENTRE[1]) < reach["high"]
    as_json = json.loads(run(*words, "--format", "json").output)
    assert as_json["document"]["measurements"][0]["value"] == pytest.approx(apart(1, 4), rel=0.01)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("{folder}",), "give a scale"),
        (("{folder}", "--measure", "0.png -> 1.png"), "give a scale"),
        (("{folder}", "--unscaled", "--measure", "0.png -> 1.png"), "give a scale"),
        (("{folder}", "--distance", "0.png -> 1.png = 1 m ± 1 mm", "-o", "x.obj"), ".ply"),
        (("{folder}", "--distance", "0.png -> 1.png = 1 m ± 1 mm", "-o", "nowhere/x.ply"), "folder"),
        (("{folder}", "--distance", "0.png -> 1.png = 1 m ± 1 mm", "--matching", "guess"), "--matching"),
        (("{folder}", "--distance", "0.png -> 1.png = 1 m ± 1 mm", "--mapping", "guess"), "--mapping"),
        (("{folder}", "--distance", "0.png -> 1.png = 1 m ± 1 mm", "--level", "2"), "--level"),
        (("nowhere", "--distance", "0.png -> 1.png = 1 m ± 1 mm"), "FOLDER"),
        (("{folder}", "--positions", "nowhere.csv"), "nowhere.csv"),
    ],
)  # fmt: skip
def test_what_is_missing_is_said_before_minutes_are_spent(folder, words, said):
    result = run(*(word.replace("{folder}", str(folder)) for word in words))
    assert result.exit_code == 2 and said in result.stderr and len(result.stderr.splitlines()) == 1


@pytest.mark.parametrize(
    "text",
    ["0.png", "0.png -> 1.png", "0.png -> 1.png = 3", "a -> b = 1 m ± 1 mm", "0.png -> 1.png -> 2.png = 1 m ± 1 mm",
     " -> 1.png = 1 m ± 1 mm",
     "0.png:9999,3; 1.png:3,4 -> 1.png = 1 m ± 1 mm"],
)  # fmt: skip
def test_distances_that_can_not_be_read(scene, photos, text):
    with pytest.raises(InputError):
        metric(scene, photos, Asked(distances=(text,)))


def test_pairs_of_a_rig(scene, photos):
    renamed = dataclasses.replace(scene, names=("left0", "left1", "x", "right0", "right1"))
    size = f"left, right = {apart(0, 3)} m ± 1 mm"
    done = metric(renamed, photos, Asked(baseline=size, checks=()))
    assert [one.label for one in done.said] == ["baseline of left0", "baseline of left1"]
    with pytest.raises(InputError, match="--baseline"):
        metric(scene, photos, Asked(baseline=size))


def test_two_pictures_are_a_rig(scene, folder, tmp_path):
    """Its baseline has the u that the scene says, its cameras are one, and `stereo` measures with it."""
    views = scaled(scene, [known(0, 3)]).scene.views()
    rig = rig_of(views, "0.png", "1.png")
    assert abs(rig.baseline_m - apart(0, 1)) < 4 * rig.u_baseline_m
    [m] = measurements(scaled(scene, [known(0, 3)]), {}, ["0.png -> 1.png"]).measurements
    assert rig.baseline_m == pytest.approx(m.value) and rig.u_baseline_m == pytest.approx(m.u, rel=1e-3)
    size = 4 + rig.left.coefficients.size
    assert rig.cov[0, 0] == pytest.approx(rig.cov[0, size]) and np.linalg.eigvalsh(rig.cov).min() > -1e-12
    turn = ROTATION[1] @ ROTATION[0].T
    assert rig.right_from_left.rotation == pytest.approx(turn, abs=2e-3)
    write_pairs(scaled(scene, [known(0, 3)]).scene, read_pairs([f"0.png, 1.png = {tmp_path}/rig.json"]))
    spot = room.marker_corners()[0] + [0.15, 0.5, 0]
    x, y = room.seen(ROTATION[0], CENTRE[0], spot)
    words = [
        "stereo",
        folder / "0.png",
        folder / "1.png",
        "--rig",
        tmp_path / "rig.json",
        "--at",
        f"{x:.1f},{y:.1f}",
        "--format",
        "json",
    ]
    result = CliRunner().invoke(main, [str(word) for word in words], catch_exceptions=False)
    reach = next(m for m in json.loads(result.output)["measurements"] if m["what"] == "range")
    assert reach["low"] < np.linalg.norm(spot - CENTRE[0]) < reach["high"]
    for text in ("0.png = x.json", "0.png, 1.png = x.txt", "0.png, 0.png = x.json", "0.png, 1.png = nowhere/x.json"):
        with pytest.raises(InputError):
            read_pairs([text])


def copies(folder, tmp_path, *pictures):
    for i, picture in enumerate(pictures):
        data = picture if isinstance(picture, bytes) else (folder / picture).read_bytes()
        (tmp_path / f"{i}.png").write_bytes(data)
    return pictures_in(tmp_path)


def black():
    import cv2

    return cv2.imencode(".png", np.zeros((480, 640), np.uint8))[1].tobytes()


def test_pictures_that_make_no_scene(folder, tmp_path):
    small = Settings(most_features=400)
    (tmp_path / "same").mkdir()
    (tmp_path / "black").mkdir()
    with pytest.raises(NothingFoundError, match="no scene"):
        reconstructed(copies(folder, tmp_path / "same", "0.png", "0.png"), camera="f=600 ± 6 px", settings=small)
    with pytest.raises(NothingFoundError, match="no scene"):
        reconstructed(copies(folder, tmp_path / "black", black(), black()), camera="f=600 ± 6 px", settings=small)
    (tmp_path / "one").mkdir()
    with pytest.raises(InputError, match="two pictures"):
        copies(folder, tmp_path / "one", "0.png")


def test_a_camera_that_only_turns_makes_no_scene(tmp_path):
    import cv2

    rng, drawn = np.random.default_rng(0), room.planes()
    for i, angle in enumerate((-0.1, 0.0, 0.1)):
        turn = room.rotation_from_vector(np.array([0.05 * i, angle, 0.0]))
        cv2.imwrite(str(tmp_path / f"{i}.png"), room.render(turn @ ROTATION[2], CENTRE[2], drawn, rng, supersample=1))
    with pytest.raises(NothingFoundError, match="no scene"):
        reconstructed(pictures_in(tmp_path), camera="f=600 ± 6 px", settings=Settings(most_features=400))
