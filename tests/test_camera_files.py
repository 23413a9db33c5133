"""Calibration files: each format against the tool that writes it, both ways, and what is refused."""

import json
import math
import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from subtense.camera import Camera
from subtense.camera_files import formats, selector
from subtense.camera_files.reading import Found
from subtense.errors import FileFormatError, InputError
from subtense.quantity import Note

HERE = Path(__file__).parent / "data" / "camera_files"
SHARED = Path(__file__).parent.parent.parent / "shared" / "data"
TOLD = json.loads((HERE / "projections.json").read_text())
POINTS = np.array(TOLD["points_m"])
K5 = (-0.1123456789012345, 0.0612345678901234, 0.000712345678901, -0.000412345678901, 0.0123456789)
K8 = (*K5, 0.0212345678, 0.0051234567, -0.0031234567)
K12 = (*K8, 1.1e-4, -2.1e-4, 3.1e-4, 1.3e-4)


def read(content, name="calib.yml", form=None):
    path, pick = selector.split(name, there=False)
    return formats.read(path, content.encode() if isinstance(content, str) else content, pick, form)


def read_file(name, there=HERE):
    path, pick = selector.split(str(there / name))
    return formats.read(path, path.read_bytes(), pick).camera


def shared(name):
    if not SHARED.is_dir():
        pytest.skip("the folder of real data is not here")
    return read_file(name, SHARED)


def perspective(k=(), f=900.1234567890123, aspect=1.0012345678901234, c=(321.2345678901234, 239.7654321098765)):
    return Camera(640, 480, f, *c, aspect, "brown_conrady" if k else "pinhole", np.array(k))


def fisheye():
    return Camera(640, 480, 300.123, 321.25, 239.75, 1.001, "fisheye", np.array([-0.011, 0.006, -0.0007, 0.0004]))


def panorama(width=2000):
    f = width / (2 * math.pi)
    return Camera(width, width // 2, f, (width - 1) / 2, (width / 2 - 1) / 2, 1.0, "equirectangular")


# -- numbers of others ---------------------------------------------------------------------------------


@pytest.mark.parametrize("model", [m for m in TOLD["colmap"] if m not in ("FOV", "THIN_PRISM_FISHEYE")])
@pytest.mark.parametrize("file", ["cameras.txt", "cameras.bin"])
def test_colmap_projects_as_colmap_does(model, file):
    number = list(TOLD["colmap"]).index(model) + 1
    pixels = read_file(f"{file}#{number}").project(POINTS)
    assert pixels == pytest.approx(np.array(TOLD["colmap"][model]) - 0.5, abs=1e-9)  # its pixel (0, 0) is a corner


@pytest.mark.parametrize("model", ["FOV", "THIN_PRISM_FISHEYE"])
def test_colmap_models_without_a_lens_are_refused_by_name(model):
    with pytest.raises(FileFormatError, match=rf"has the model {model}, which is not read; SIMPLE_PINHOLE, "):
        read_file(f"cameras.txt#{list(TOLD['colmap']).index(model) + 1}")


@pytest.mark.parametrize("model", list(TOLD["mrcal"]))
def test_mrcal_projects_as_mrcal_does(model):
    camera = read_file(f"{model.removeprefix('LENSMODEL_').lower()}.cameramodel")
    assert camera.project(POINTS) == pytest.approx(np.array(TOLD["mrcal"][model]), abs=1e-9)


def test_other_mrcal_models_are_refused_by_name():
    with pytest.raises(FileFormatError, match="LENSMODEL_STEREOGRAPHIC is not read; LENSMODEL_PINHOLE"):
        read_file("stereographic.cameramodel")


def storage(path, **values):
    import cv2

    file = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    for name, value in values.items():
        file.write(name, value)
    file.release()
    return path.read_bytes()


@pytest.mark.opencv
@pytest.mark.parametrize("ending", ["yml", "xml", "json"])
@pytest.mark.parametrize("k", [(), K5[:4], K5, K8, K12, (*K12, 0.01, -0.02)], ids=len)
def test_what_opencv_writes_projects_as_opencv_does(tmp_path, ending, k):
    import cv2

    matrix = np.array([[900.1234567890123, 0, 321.2], [0, 901.5, 239.7], [0, 0, 1]])
    content = storage(
        tmp_path / f"c.{ending}", image_width=640, image_height=480, camera_matrix=matrix,
        distortion_coefficients=np.array(k or (0.0,) * 5).reshape(-1, 1), note='a "b" # c: d', error=0.1,
    )  # fmt: skip
    camera = read(content, f"c.{ending}").camera
    pixels, _ = cv2.projectPoints(POINTS, np.zeros(3), np.zeros(3), matrix, np.array(k) if k else None)
    assert camera.project(POINTS) == pytest.approx(pixels[:, 0], abs=1e-9)
    assert float(camera.f_px) == matrix[0, 0]


@pytest.mark.opencv
@pytest.mark.parametrize("ending", ["yml", "xml", "json"])
def test_four_coefficients_are_a_fisheye_where_that_is_said(tmp_path, ending):
    import cv2

    matrix = np.array([[400.1, 0, 321.2], [0, 401.5, 239.7], [0, 0, 1]])
    k = np.array([-0.011, 0.006, -0.0007, 0.0004])
    values = {"image_width": 640, "image_height": 480, "camera_matrix": matrix, "distortion_coefficients": k}
    told = storage(tmp_path / f"a.{ending}", fisheye_model=1, **values)
    silent = storage(tmp_path / f"b.{ending}", **values)
    pixels, _ = cv2.fisheye.projectPoints(POINTS[:, None], np.zeros(3), np.zeros(3), matrix, k)
    for camera in (read(told, f"a.{ending}").camera, read(silent, f"b.{ending}#fisheye").camera):
        assert camera.lens == "fisheye"
        assert camera.project(POINTS) == pytest.approx(pixels[:, 0], abs=1e-9)
    plain = read(silent, f"b.{ending}").camera
    assert plain.lens == "brown_conrady" and plain.coefficients.tolist() == [*k, 0.0]


@pytest.mark.opencv
@pytest.mark.parametrize("form", ["opencv", "opencv_xml", "opencv_json"])
@pytest.mark.parametrize("camera", [perspective(K5), perspective(K8), fisheye()], ids=["5", "8", "fisheye"])
def test_opencv_reads_what_is_written(tmp_path, form, camera):
    import cv2

    path = tmp_path / ("c" + formats.FORMATS[form].endings[0])
    path.write_bytes(formats.write(Found(camera), form))
    file = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    assert file.getNode("camera_matrix").mat() == pytest.approx(camera.matrix, rel=1e-15)
    assert file.getNode("distortion_coefficients").mat().ravel().tolist() == camera.coefficients.tolist()
    assert (file.getNode("image_width").real(), file.getNode("image_height").real()) == (640, 480)


def test_ros_and_kalibr_as_their_yaml_writer_lays_them_out():
    yaml = pytest.importorskip("yaml")
    matrix = {"rows": 3, "cols": 3, "data": [900.5, 0.0, 321.0, 0.0, 901.5, 239.0, 0.0, 0.0, 1.0]}
    info = {"image_width": 640, "image_height": 480, "camera_name": "left", "camera_matrix": matrix,
            "distortion_model": "plumb_bob", "distortion_coefficients": {"rows": 1, "cols": 5, "data": [*K5]},
            "rectification_matrix": {"rows": 3, "cols": 3, "data": [1, 0, 0, 0, 1, 0, 0, 0, 1]},
            "projection_matrix": {"rows": 3, "cols": 4, "data": [900.5, 0.0, 321.0, 0, 0, 901.5, 239.0, 0, 0, 0, 1, 0]}}  # fmt: skip
    chain = {f"cam{i}": {"camera_model": "pinhole", "intrinsics": [900.5 + i, 901.5, 321.0, 239.0], "rostopic": f"/cam{i}/image_raw",
                         "distortion_model": "radtan", "distortion_coeffs": [*K5[:4]], "resolution": [640, 480],
                         "T_cn_cnm1": np.eye(4).tolist(), "cam_overlaps": [1 - i]} for i in (0, 1)}  # fmt: skip
    for flow in (None, True, False):
        camera = read(yaml.safe_dump(info, default_flow_style=flow)).camera
        assert (camera.f_px, camera.cx_px, camera.cy_px, camera.coefficients.tolist()) == (900.5, 321, 239, [*K5])
        camera = read(yaml.safe_dump(chain, default_flow_style=flow), "c.yaml#cam1").camera
        assert (camera.f_px, camera.coefficients.tolist()) == (901.5, [*K5[:4], 0.0])


def test_real_files():
    left = shared("calibration/opencv_stereo_chess/left_intrinsics.yml")
    assert (left.width_px, left.height_px, left.f_px, left.cy_px) == (640, 480, 535.91573396163199, 235.57082909788173)
    assert shared("calibration/opencv_stereo_chess/intrinsics.yml#M1,640x480").f_px == 534.80326845051309
    nested = shared("exif_intrinsics/iphone8plus/calibration_4032x3024.yaml#4032x3024")
    assert (nested.f_px, nested.coefficients[4]) == (3280.1416389452497, 9.145486487494859)
    assert shared("fiducial/opencv_aruco/tutorial_camera_charuco.yml").f_px == 452.51072219637672
    depth = shared("metric_depth/rgbd_sequence/camera_primesense.json")
    assert (depth.f_px, depth.cx_px, depth.cy_px) == (525, 319.5, 239.5)


# -- there and back ------------------------------------------------------------------------------------

CAMERAS = {
    "pinhole": perspective(), "4": perspective((*K5[:4], 0.0)), "5": perspective(K5), "8": perspective(K8), "12": perspective(K12),
    "14": perspective((*K12, 0.01, -0.02)), "fisheye": fisheye(), "panorama": panorama(),
    "round": perspective((0.1, 0, 0, 0, 0), 1000.0, 1.0, (319.5, 239.5)), "far": perspective(K5, c=(-0.1, 0.3)),
}  # fmt: skip
HELD = {
    "subtense": set(CAMERAS), "opencv": set(CAMERAS) - {"panorama"}, "opencv_xml": set(CAMERAS) - {"panorama"},
    "opencv_json": set(CAMERAS) - {"panorama"}, "ros": {"pinhole", "4", "5", "8", "fisheye", "round", "far"},
    "colmap": {"pinhole", "4", "5", "8", "fisheye", "round", "far"}, "colmap_bin": {"pinhole", "4", "5", "8", "fisheye", "round", "far"},
    "kalibr": {"pinhole", "4", "fisheye", "round"}, "mrcal": {"pinhole", "4", "5", "8", "12", "round", "far"},
    "opensfm": {"pinhole", "4", "5", "fisheye", "panorama", "round", "far"}, "matlab": {"pinhole", "4", "5", "round", "far"},
    "open3d": {"pinhole"},
}  # fmt: skip
MOVED = {"colmap", "colmap_bin", "matlab", "opensfm"}
"""Their principal point is not ours but moved (OpenSfM's also in other units); adding half a pixel and taking it off again
may cost the last digit of the larger number."""


def test_the_table_below_is_the_table():
    assert list(HELD) == sorted(HELD, key=list(HELD).index) and set(HELD) == set(formats.FORMATS)


@pytest.mark.parametrize("form", formats.FORMATS)
@pytest.mark.parametrize("name", CAMERAS)
def test_there_and_back_to_the_last_digit(form, name):
    camera = CAMERAS[name]
    if name not in HELD[form]:
        with pytest.raises(InputError, match=r"can't hold .*; subtense.* can"):
            formats.write(Found(camera), form)
        return
    content = formats.write(Found(camera), form)
    again = formats.read(Path("a" + formats.FORMATS[form].endings[0]), content).camera
    assert (again.width_px, again.height_px, again.lens) == (camera.width_px, camera.height_px, camera.lens)
    last = np.spacing(1000.0) if form in MOVED else 0.0
    assert abs(again.cx_px - camera.cx_px) <= last and abs(again.cy_px - camera.cy_px) <= last
    units = 1e-15 if form == "opensfm" else 0.0  # a focal length in units of the longer side
    assert abs(again.f_px / camera.f_px - 1) <= units and abs(again.aspect / camera.aspect - 1) <= 2 * units
    k = camera.coefficients.tolist()
    assert again.coefficients.tolist()[: len(k)] == k and not any(again.coefficients[len(k) :])


def test_numbers_of_a_file_come_out_as_they_went_in():
    text = "1 OPENCV 640 480 900.1 899.3 319.7 241.3 -0.11 0.06 0.0007 -0.0004"
    assert text in formats.write(read(text, "cameras.txt"), "colmap").decode()


@pytest.mark.parametrize("form", ["opencv", "ros", "kalibr", "colmap", "matlab", "mrcal"])
def test_a_person_s_numbers_stay_a_person_s(form):
    dice = np.random.default_rng(5)
    for fx, fy, cx, cy in np.round(dice.uniform([500, 500, 200, 200], [2000, 2000, 400, 300], (100, 4)), 2).tolist():
        if form == "kalibr":
            text = f"cam0:\n  camera_model: pinhole\n  intrinsics: [{fx}, {fy}, {cx}, {cy}]\n  resolution: [640, 480]\n"
        else:
            text = f"K: [{fx}, 0, {cx}, 0, {fy}, {cy}, 0, 0, 1]\n" + SIZE
        there = formats.write(read(text), form)
        assert repr(fx) in there.decode() and repr(fy) in there.decode()
        again = formats.write(formats.read("a" + formats.FORMATS[form].endings[0], there), "kalibr").decode()
        assert f"intrinsics: [{fx!r}, {fy!r}, " in again


OURS = {"width_px": 640, "height_px": 480, "f_px": 900, "cx_px": 320, "cy_px": 240}


@pytest.mark.parametrize(
    ("change", "wrong"),
    [
        ({"f_px": 10**400}, "f_px is a huge number; a finite number is needed"),
        ({"f_px": True}, "f_px is missing or no number"),
        ({"f_px": [900, 901]}, "f_px is missing or no number"),
        ({"width_px": 0}, "the picture's width is 0"),
        ({"width_px": 10**9}, "a whole number of 1 to 1000000 is needed"),
        ({"aspect": [1, 2]}, "aspect is a list"),
        ({"lens": "thin"}, "lens is 'thin'; known are pinhole"),
        ({"lens": ["pinhole"]}, "values of the wrong kind"),
        ({"part_sources": [1]}, "values of the wrong kind"),
        ({"lens": "fisheye", "distortion": [1, 2]}, r"distortion is \[1.0, 2.0\]; fisheye takes 4 numbers"),
        ({"distortion": ["a"]}, r"distortion\[0\] is 'a'"),
        ({"cov": [[1, 2], [3, 4]]}, "cov is .of shape"),
        ({"cov": [[1], [3, 4]]}, "values of the wrong kind"),
        ({"frame": "turned"}, 'frame must be "stored" or "upright"'),
    ],
)
def test_our_own_refusals(change, wrong):
    with pytest.raises(FileFormatError, match=wrong):
        read(json.dumps({**OURS, **change}), "c.json")


def test_one_of_our_rig():
    rig = json.dumps({"rig": {"left": OURS, "right": {**OURS, "f_px": 950}, "cov": []}, "notes": []})
    assert read(rig, "rig.json#right").camera.f_px == 950
    with pytest.raises(FileFormatError, match=r"has 2 cameras \(left, right\); choose one, as rig\.json#left"):
        read(rig, "rig.json")


def test_ours_keeps_covariance_notes_and_frame():
    camera = replace(perspective(K5), cov=np.diag([1.2, 0.1, 0.8, 0.8, 0.002, 0.01, 0.0001, 0.0001, 0.0]) ** 2)
    found = Found(camera, (Note("model_error", "misfits at the edges", "another lens model"),), "stored")
    again = formats.read("a.json", formats.write(found, "subtense"))
    assert np.array_equal(again.camera.cov, camera.cov)
    assert (again.notes, again.frame, formats.lost(found, "subtense")) == (found.notes, "stored", ())
    assert formats.lost(found, "ros") == (
        "the uncertainty (covariance)",
        "the notes model_error",
        "that it is for pictures as stored",
    )


# -- OpenCV's other spellings --------------------------------------------------------------------------

MATRIX = "[900, 0, 320, 0, 901, 240, 0, 0, 1]"


@pytest.mark.parametrize(
    "text",
    [
        "width: 640\nheight: 480\nK: {m}\nD: [-0.1, 0.02, 0, 0]",
        "image_size: [640, 480]\nCamera_Matrix: {m}\nDistortion_Coefficients: [-0.1, 0.02, 0, 0, 0]",
        "img_size: [640, 480]\nmtx: [[900, 0, 320], [0, 901, 240], [0, 0, 1]]\ndist: [[-0.1, 0.02, 0, 0, 0]]",
        "cameraMatrix: {m}\ndistCoeffs:\n- -0.1\n- 0.02\n- 0\n- 0\n- 0\nimageWidth: 640\nimageHeight: 480",
        '{{"resolution":{{"width":640.0,"height":480.0}},"cameraIntrinsics":{{"rows":3,"cols":3,"type":6,"data":{m}}},'
        '"distCoeffs":{{"rows":1,"cols":8,"type":6,"data":[-0.1,0.02,0,0,0,0,0,0]}},"calobjectWarp":[1e-4,2e-5]}}',
        "%YAML 1.2\n---\n'image_width': 640 # px\nimage_height: 480\n\nK: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n"
        "   data: [ 900., 0., 320., 0.,\n       # a comment\n       901., 240., 0., 0., 1. ]\nD: [-1.e-1, 2.e-2, 0, 0,]",
    ],
    ids=["KD", "old sample", "tutorial", "camelCase", "PhotonVision", "FileStorage"],
)
def test_spellings(text):
    camera = read(text.format(m=MATRIX), "calib").camera
    assert (camera.width_px, camera.height_px, camera.f_px, camera.matrix[1, 1], camera.cx_px) == (
        640,
        480,
        900,
        901,
        320,
    )
    assert camera.coefficients[:2].tolist() == [-0.1, 0.02]


SIZE = "image_width: 640\nimage_height: 480\n"
STEREO = f"{SIZE}M1: {MATRIX}\nD1: [0.1, 0, 0, 0, 0]\nM2: {MATRIX.replace('900', '950')}\nD2: [0.2, 0, 0, 0, 0]\n"


def test_one_of_several_cameras():
    camera = read(STEREO, "stereo.yml#M2").camera
    assert (camera.f_px, camera.coefficients[0]) == (950, 0.2)
    with pytest.raises(FileFormatError, match=r"has 2 cameras \(M1, M2\); choose one, as stereo\.yml#M1"):
        read(STEREO, "stereo.yml")
    with pytest.raises(FileFormatError, match="has no camera 'M3'; it has M1, M2"):
        read(STEREO, "stereo.yml#M3")
    sides = STEREO.replace("M1", "K_left").replace("D1", "left_D").replace("M2", "K_right").replace("D2", "D_r")
    assert read(sides, "stereo.yml#K_right").camera.coefficients[0] == 0.2


def test_a_size_that_the_file_lacks_is_given_beside_it():
    text = f"K: {MATRIX}\nD: [0.1, 0, 0, 0]"
    with pytest.raises(
        FileFormatError, match=r"does not tell the picture's size; write it behind the name, as calib\.yml#640x480"
    ):
        read(text)
    assert read(text, "calib.yml#640x480").camera.height_px == 480
    with pytest.raises(FileFormatError, match=r"is for 640 x 480 px; leave out #800x600"):
        read(STEREO, "stereo.yml#M1,800x600")


def test_a_size_in_the_wrong_order_is_noticed():
    with pytest.raises(FileFormatError, match="seems to be height and width"):
        read(f"K: {MATRIX.replace('320', '600')}\nimage_size: [480, 640]")


SPREAD = """<?xml version="1.0"?><opencv_storage><calibrationDate>"Thu 07 Apr 2016"</calibrationDate>
<cameraResolution>640 480</cameraResolution><cameraMatrix type_id="opencv-matrix"><rows>3</rows><cols>3</cols><dt>d</dt>
<data>900. 0. 320. 0. 990. 240. 0. 0. 1.</data></cameraMatrix><cameraMatrix_std_dev type_id="opencv-matrix"><rows>4</rows>
<cols>1</cols><dt>d</dt><data>{} 2. 3.</data></cameraMatrix_std_dev><dist_coeffs type_id="opencv-matrix"><rows>1</rows>
<cols>5</cols><dt>d</dt><data>0.1 -0.2 0. 0. 0.1</data></dist_coeffs><dist_coeffs_std_dev type_id="opencv-matrix"><rows>5</rows>
<cols>1</cols><dt>d</dt><data>0.01 0.02 0. 0. 0.03</data></dist_coeffs_std_dev></opencv_storage>"""


def test_standard_deviations_of_opencv():
    found = read(SPREAD.format("1.5 2.5"), "c.xml")
    jacobian = np.array([[1, 0], [-990 / 900**2, 1 / 900]])  # (fx, fy) to (f, fy / fx)
    assert found.camera.cov[:2, :2] == pytest.approx(jacobian @ np.diag([1.5**2, 2.5**2]) @ jacobian.T, rel=1e-12)
    assert np.sqrt(np.diag(found.camera.cov))[2:] == pytest.approx([2, 3, 0.01, 0.02, 0, 0, 0.03])
    assert [note.code for note in found.notes] == ["calibration_without_correlations"]


def test_a_kept_aspect_ratio_is_no_exact_focal_length():
    cov = read(SPREAD.format("0. 11."), "c.xml").camera.cov  # as OpenCV writes it with CALIB_FIX_ASPECT_RATIO
    assert math.sqrt(cov[0, 0]) == pytest.approx(10) and cov[1, 1] == 0


# -- other formats -------------------------------------------------------------------------------------

ROS = """image_width: 640
image_height: 480
camera_matrix: {{rows: 3, cols: 3, data: [900, 0, 320, 0, 900, 240, 0, 0, 1]}}
distortion_model: {}
distortion_coefficients: {{rows: 1, cols: {}, data: [{}]}}
"""


@pytest.mark.parametrize(
    ("model", "k", "lens"),
    [
        ("plumb_bob", K5, "brown_conrady"),
        ("rational_polynomial", K8, "brown_conrady"),
        ("equidistant", K5[:4], "fisheye"),
    ],
)
def test_ros_models(model, k, lens):
    camera = read(ROS.format(model, len(k), ", ".join(map(str, k)))).camera
    assert (camera.lens, camera.coefficients.tolist()) == (lens, [*k])
    with pytest.raises(FileFormatError, match="distortion_model 'omni' is not read; plumb_bob"):
        read(ROS.format("omni", len(k), ", ".join(map(str, k))))


def test_ros_region_and_binning_are_applied():
    whole = ROS.format("plumb_bob", 5, "0, 0, 0, 0, 0.0")
    cut = read(
        whole + "binning_x: 2\nbinning_y: 2\nroi: {x_offset: 40, y_offset: 20, width: 400, height: 200}\n"
    ).camera
    assert (cut.width_px, cut.height_px, cut.f_px) == (200, 100, 450)
    assert cut.cx_px == (320 - 40 + 0.5) / 2 - 0.5  # a bin's centre lies between its pixels
    none = read(
        whole + "binning_x: 0\nbinning_y: 0\nroi: {x_offset: 0, y_offset: 0, width: 0, height: 0, do_rectify: false}\n"
    )
    assert none.camera.f_px == 900
    with pytest.raises(FileFormatError, match="roi lies outside"):
        read(whole + "roi: {x_offset: 400, y_offset: 0, width: 400, height: 100}\n")
    with pytest.raises(FileFormatError, match="binning must be whole numbers that divide"):
        read(whole + "binning_x: 7\n")


def test_ros_as_the_topic_prints_it():
    printed = "header: \n  seq: 0\n  frame_id: 'cam'\nheight: 480\nwidth: 640\ndistortion_model: \"plumb_bob\"\n"
    printed += "D: [0.1, 0.0, 0.0, 0.0, 0.0]\nK: [900.0, 0.0, 320.0, 0.0, 900.0, 240.0, 0.0, 0.0, 1.0]\n"
    printed += "binning_x: 0\nroi: \n  x_offset: 0\n---\n"
    assert read(printed, "topic.txt").camera.f_px == 900


@pytest.mark.parametrize(
    ("what", "wrong"),
    [
        ("camera_model: omni\nintrinsics: [0.8, 900, 900, 320, 240]", "camera_model omni is not read"),
        (
            "camera_model: pinhole\nintrinsics: [900, 900, 320, 240]\ndistortion_model: fov\ndistortion_coeffs: [0.9]",
            "distortion_model fov is not",
        ),
    ],
)
def test_kalibr_models_that_are_refused(what, wrong):
    with pytest.raises(FileFormatError, match=wrong):
        read("cam0:\n" + "".join(f"  {line}\n" for line in [*what.split("\n"), "resolution: [640, 480]"]))


def opensfm(**camera):
    return json.dumps({"v2 make model 2000 1000": {"width": 2000, "height": 1000, **camera}})


def test_opensfm_is_in_units_of_the_longer_side_from_the_middle():
    brown = {
        "focal_x": 0.8,
        "focal_y": 0.81,
        "c_x": 0.01,
        "c_y": -0.02,
        "k1": 0.1,
        "k2": 0.01,
        "p1": 0.001,
        "p2": 0.002,
        "k3": 0.003,
    }
    camera = read(opensfm(projection_type="brown", **brown), "camera_models.json").camera
    assert (camera.f_px, camera.matrix[1, 1]) == (1600, 1620)
    assert (camera.cx_px, camera.cy_px) == (0.01 * 2000 + 2000 / 2 - 0.5, -0.02 * 2000 + 1000 / 2 - 0.5)
    assert camera.coefficients.tolist() == [0.1, 0.01, 0.001, 0.002, 0.003]
    fish = read(opensfm(projection_type="fisheye", focal=0.4, k1=0.01, k2=0.001), "a.json").camera
    assert (fish.lens, fish.f_px, fish.coefficients.tolist()) == ("fisheye", 800, [0.01, 0.001, 0, 0])
    plain = read(opensfm(projection_type="perspective", focal=0.8, k1=0.01, k2=0.001), "a.json").camera
    assert (plain.cx_px, plain.coefficients.tolist()) == (999.5, [0.01, 0.001, 0, 0, 0])
    sphere = read(opensfm(projection_type="spherical"), "a.json").camera
    assert sphere.project(np.array([[1.0, 0.0, 0.0]])) == pytest.approx(np.array([[2000 * 0.75 - 0.5, 499.5]]))
    with pytest.raises(FileFormatError, match="projection_type dual is not read"):
        read(opensfm(projection_type="dual", focal=1), "a.json")


MATLAB = {"FocalLength": [900, 901], "PrincipalPoint": [321, 241], "ImageSize": [480, 640], "RadialDistortion": [-0.1, 0.02],
          "TangentialDistortion": [0.001, 0.002], "Skew": 0}  # fmt: skip


def test_matlab_begins_at_one_and_transposes():
    camera = read(json.dumps(MATLAB), "m.json").camera
    assert (camera.width_px, camera.height_px, camera.cx_px, camera.cy_px) == (640, 480, 320, 240)
    assert camera.coefficients.tolist() == [-0.1, 0.02, 0.001, 0.002, 0]
    rest = {key: value for key, value in MATLAB.items() if key not in ("FocalLength", "PrincipalPoint")}
    for matrix in (
        {"IntrinsicMatrix": [[900, 0, 0], [0, 901, 0], [321, 241, 1]]},
        {"K": [[900, 0, 321], [0, 901, 241], [0, 0, 1]]},
    ):
        assert read(json.dumps({**rest, **matrix}), "m.json").camera.matrix.tolist() == camera.matrix.tolist()
        assert read(json.dumps({**MATLAB, **matrix}), "m.json").camera.matrix.tolist() == camera.matrix.tolist()
    pair = {"CameraParameters1": {**rest, **matrix}, "CameraParameters2": {"Intrinsics": MATLAB}}
    assert read(json.dumps(pair), "m.json#CameraParameters2").camera.f_px == 900
    with pytest.raises(FileFormatError, match="contradict each other"):
        read(json.dumps({**MATLAB, "K": [[950, 0, 321], [0, 901, 241], [0, 0, 1]]}), "m.json")
    with pytest.raises(FileFormatError, match=r"has a skew of 0\.5"):
        read(json.dumps({**MATLAB, "Skew": 0.5}), "m.json")


# -- what is refused -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "wrong"),
    [
        (SIZE + "K: [900, 0.1, 320, 0, 900, 240, 0, 0, 1]", "has a skew of 0.1"),
        (SIZE + "K: [0, 0, 320, 0, 900, 240, 0, 0, 1]", "fx is 0; a focal length above 0 is needed"),
        (SIZE + "K: [900, 0, 320, 0, -900, 240, 0, 0, 1]", "fy is -900; a focal length above 0"),
        (SIZE + "K: [900, 0, 320, 0, 900, 240, 0, 1, 1]", "K is no camera matrix"),
        (SIZE + "K: [.nan, 0, 320, 0, 900, 240, 0, 0, 1]", r"K\[0\] is nan; a finite number"),
        (SIZE + "K: [1e999, 0, 320, 0, 900, 240, 0, 0, 1]", r"K\[0\] is inf; a finite number"),
        (SIZE + f"K: {MATRIX}\nD: [1, 2, 3]", "D has 3 numbers; 0 or 4 or 5 or 8 or 12 or 14 are needed"),
        (SIZE + f"K: {MATRIX}\nD: [a, 2, 3, 4]", r"D\[0\] is 'a'; a number is needed"),
        (SIZE + f"K: {MATRIX}\nK: {MATRIX}", "line 4: the key 'K' stands here twice"),
        ("image_width: 0\nimage_height: 480\nK: " + MATRIX, "the picture's width is 0"),
        ("image_width: 640.5\nimage_height: 480\nK: " + MATRIX, "the picture's width is 640.5"),
        (SIZE + "K: {rows: 3, cols: 3, data: [900, 0, 320, 0, 900, 240, 0, 0]}", "has no camera_matrix"),
        (SIZE + "K: {rows: 2, cols: 3, data: [900, 0, 320, 0, 900, 240, 0, 0, 1]}", "has 9 numbers, and its rows and cols say 6"),
        (SIZE + f"a: &x 1\nK: {MATRIX}", "line 3: anchors and aliases are not read here"),
        (SIZE + f"a: !!python/object:os.system 1\nK: {MATRIX}", "line 3: the tag !!python/object:os.system is not read"),
        (SIZE + "---\nb: 1", "line 4: a second document begins here"),
        (SIZE + "\tb: 1", "line 3: is indented by tabs"),
        (SIZE + "K: [900, 0, 320", "the file may be cut off"),
        (SIZE + "K: 5\n  a: 1", "line 4: a key can't stand below a value"),
        ("", "is empty"),
        ("a: " + "[" * 40 + "]" * 40, "nested deeper than 32 levels"),
        ("\n".join("  " * i + "a:" for i in range(40)), "nested deeper than 32 levels"),
        ("- " * 40 + "1", "nested deeper than 32 levels"),
        ('{"a": NaN}', "holds NaN"),
        ('{"a": 1, "a": 2}', "has the key 'a' twice"),
        ('{"a":' * 40 + "1" + "}" * 40, "nested deeper than 32 levels"),
        ('{"a":' * 100_000, "nested deeper than 32 levels"),
        ('{"a": ' + "1" * 5000 + "}", "a number of too many digits"),
        ('{"a": 1', "is not JSON: line 1"),
        ('<!DOCTYPE a [<!ENTITY b "c">]><opencv_storage/>', "line 1: a document type is not read here"),
        ("<html></html>", "is not OpenCV's <opencv_storage>"),
        ("<opencv_storage>" + "<a>" * 40, "nested deeper than 32 levels"),
        ("<opencv_storage><a>1</a><a>2</a></opencv_storage>", "<a> stands here twice"),
        ("<opencv_storage><a>&x;</a></opencv_storage>", "is not XML: undefined entity"),
        ("1 OPENCV 640 480", "line 1: CAMERA_ID MODEL WIDTH HEIGHT PARAMS are needed"),
        ("1 PINHOLE 640 480 900 900 320", "PARAMS of PINHOLE has 3 numbers; 4 are needed"),
        ("1 PINHOLE 640 480 9 9 3 2\n1 PINHOLE 640 480 9 9 3 2", "line 2: camera 1 stands here twice"),
        ("# Camera list with one line of data per camera:\n# Number of cameras: 0\n", "holds no camera"),
        ("{'lens_model': 'LENSMODEL_CAHVORE_linearity=0.37', 'intrinsics': [1]}", "LENSMODEL_CAHVORE_linearity=0.37 is not read"),
        ("{'lens_model': 'LENSMODEL_PINHOLE', 'intrinsics': [" + "(" * 200_000, "nested deeper than 32 levels"),
        ("Lorem ipsum dolor\nsit amet", "is no calibration file that is known here"),
        ("a: 1\nb: 2", "has no camera_matrix of 3 x 3 numbers"),
    ],
)  # fmt: skip
def test_refusals_name_place_and_cure(text, wrong):
    with pytest.raises(FileFormatError, match=f"^calib.yml: .*{wrong}") as caught:
        read(text)
    assert "\n" not in str(caught.value)


def test_binary_refusals():
    good = (HERE / "cameras.bin").read_bytes()
    for content, wrong in [
        (good[:100], "ends too early"), (good + b"\0", "bytes are left"), (struct.pack("<Q", 2**60), "says that it has"),
        (struct.pack("<QIiQQ", 1, 1, 99, 640, 480), "model number 99"), (b"\xff\xfe\x01", "not a text in UTF-8"),
        (b"a" * 2**20 + b"a", "is larger than 1 MiB"),
    ]:  # fmt: skip
        with pytest.raises(FileFormatError, match=wrong):
            read(content, "cameras.bin")


def test_what_is_no_calibration_at_all():
    picture = (Path(__file__).parent.parent / "examples" / "belt.jpg").read_bytes()[:10_000]
    for content in (picture, "K: 1".encode("utf-16")):
        with pytest.raises(FileFormatError, match=r"is neither a text in UTF-8 nor a cameras\.bin"):
            read(content, "belt.jpg")
    assert read((HERE / "cameras.bin").read_bytes(), "cameras#2").camera.lens == "pinhole"


def test_a_lens_that_folds_over_inside_of_the_picture_is_refused():
    text = SIZE + f"K: {MATRIX.replace('900', '300').replace('901', '300')}\nD: [-0.4, 0, 0, 0, 0]"
    with pytest.raises(FileFormatError, match=r"its lens distortion turns back \d+ px from the principal point"):
        read(text)
    assert read(text.replace("-0.4", "-0.05")).camera.f_px == 300
    corners = read(text.replace("-0.4", "-0.2"))
    assert [n.code for n in corners.notes] == ["distortion_folds"]
    assert corners.camera.invertible(np.array([[0.0, 0.0], [320.0, 240.0], [320.0, 20.0]])).tolist() == [
        False,
        True,
        True,
    ]
    wide = SIZE + "fisheye_model: 1\nK: [150, 0, 320, 0, 150, 240, 0, 0, 1]\nD: [{}, 0, 0, 0]"
    assert read(wide.format(-0.05)).camera.invertible(np.array([[0.0, 0.0]])).tolist() == [
        False
    ]  # outside of its circle
    with pytest.raises(FileFormatError, match="turns back"):
        read(wide.format(-0.2))


def test_a_format_may_be_said():
    assert read(f"K: {MATRIX}\nD: [0.1, 0, 0, 0, 0]\nwidth: 640\nheight: 480\n", form="ros").camera.f_px == 900
    with pytest.raises(InputError, match="--from is 'exif'; known are subtense"):
        read(STEREO, form="exif")


def test_selectors():
    assert selector.parse("640x480") == selector.Pick((640, 480))
    assert selector.parse("fisheye, 640 × 480 px") == selector.Pick((640, 480), True)
    assert selector.parse("v2 a, b 640 perspective 0,640x480") == selector.Pick(
        (640, 480), False, "v2 a, b 640 perspective 0"
    )
    assert selector.split("a#b.yml#M1")[0] == Path("a#b.yml")


def test_the_page_lists_every_format():
    text = (Path(__file__).parent.parent / "docs" / "calibration-files.md").read_text("utf-8")
    listed = [
        line.split("`")[1]
        for line in text.split("## Formats")[1].split("\n## ")[0].splitlines()
        if line.startswith("| `")
    ]
    assert sorted(listed) == sorted(formats.FORMATS)
