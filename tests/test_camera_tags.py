"""Cameras that makers and phones write into their files: DJI, Pix4D's namespace, Google, HEIC, panoramas."""

import math

import heic_boxes
import numpy as np
import pytest
from written_photos import packet, write

from subtense.errors import UnknownCameraError
from subtense.photo import Photo
from subtense.workflow.resolve_camera import resolve_camera

K = (-0.269478, 0.115681, -0.0000875619, -0.000306177, -0.0357628)


@pytest.fixture
def take(tmp_path):
    def make(size, xmp=None, **more):
        return resolve_camera(Photo.load(write(tmp_path / "a.jpg", size, xmp, **more)))

    return make


def dji(flag="0", centre=(2432, 1824), **more):
    data = "2018-03-13;3659.78,3653.17,-7.71,45.9," + ",".join(map(str, K))
    return packet(drone_dji_DewarpData=data, drone_dji_CalibratedFocalLength="3666.666504", drone_dji_DewarpFlag=flag,
                  drone_dji_CalibratedOpticalCenterX=centre[0], drone_dji_CalibratedOpticalCenterY=centre[1], **more)  # fmt: skip


def test_dji_tells_the_units_own_calibration(take):
    found = take((4864, 3648), dji())
    camera = found.camera
    assert found.chosen.source == "dji_tags"
    assert (camera.f_px, camera.f_px * camera.aspect) == pytest.approx((3659.78, 3653.17))
    assert (camera.cx_px, camera.cy_px) == pytest.approx((4863 / 2 - 7.71, 3647 / 2 + 45.9))
    assert camera.coefficients == pytest.approx(K)
    assert 0.001 < camera.u_f_px / camera.f_px < 0.01


def test_dji_undistorts_as_opencv_does(take):
    """The camera matrix and the coefficients go into OpenCV's model as DJI's guide says."""
    import cv2

    camera = take((4864, 3648), dji()).camera
    points = np.array([[0.1, 0.2, 1.0], [-0.5, 0.3, 1.0]])
    matrix = np.array([[3659.78, 0, 4863 / 2 - 7.71], [0, 3653.17, 3647 / 2 + 45.9], [0, 0, 1]])
    theirs = cv2.projectPoints(points, np.zeros(3), np.zeros(3), matrix, np.array(K))[0][:, 0]
    assert camera.project(points) == pytest.approx(theirs, abs=1e-6)


def test_dji_that_has_straightened_the_picture(take):
    camera = take((4864, 3648), dji("1")).camera
    assert not camera.coefficients.any()
    assert math.sqrt(camera.cov[3, 3]) > 20  # it may have been centred


def test_dji_that_does_not_say_whether_holds_both(take):
    camera = take((4864, 3648), dji(flag="")).camera
    u = math.sqrt(camera.cov[4, 4])
    for k1 in (0.0, K[0]):
        assert abs(camera.coefficients[0] - k1) < 1.1 * u


def test_dji_resized(take):
    whole, half = (take(size, dji()).camera for size in ((4864, 3648), (2432, 1824)))
    assert half.f_px == pytest.approx(whole.f_px / 2)
    assert (half.cx_px + 0.5, half.cy_px + 0.5) == pytest.approx(((whole.cx_px + 0.5) / 2, (whole.cy_px + 0.5) / 2))


def test_dji_of_another_mode_is_not_believed(take):
    with pytest.raises(UnknownCameraError, match="4864 x 3648 px"):
        take((4864, 2736), dji())


def test_dji_with_the_designs_focal_length_only(take):
    xmp = packet(
        drone_dji_CalibratedFocalLength="3666.67",
        drone_dji_CalibratedOpticalCenterX="2736",
        drone_dji_CalibratedOpticalCenterY="1824",
    )
    camera = take((5472, 3648), xmp).camera
    assert camera.f_px == pytest.approx(3666.67)
    assert abs(3659.78 - camera.f_px) < 1.96 * camera.u_f_px
    assert math.sqrt(camera.cov[4, 4]) >= 0.05


@pytest.mark.parametrize(
    "data", ["", "x", "d;1,2,3", "d;0,0,0,0,0,0,0,0,0", "d;nan,3653,0,0,0,0,0,0,0", "d;3659,3653,0,0,99,0,0,0,0"]
)
def test_damaged_dewarp_data_are_left_out(take, data):
    with pytest.raises(UnknownCameraError):
        take((400, 300), packet(drone_dji_DewarpData=data))


def test_pix4d_as_micasense_writes_it(take):
    """Focal length and centre in mm, 1/3.75 px per um: as MicaSense's own library makes a camera matrix of it."""
    xmp = packet(Camera_PrincipalPoint="2.42299,1.850154", Camera_PerspectiveFocalLength="5.4709", Camera_PerspectiveFocalLengthUnits="mm",
                 Camera_PerspectiveDistortion="-0.09,0.14,-0.02,0.0004,-0.0003")  # fmt: skip
    camera = take(
        (1280, 960),
        xmp,
        make="MicaSense",
        fp_x=266.666667,
        fp_y=266.666667,
        fp_unit=4,
        focal=5.5,
        width=1280,
        height=960,
    ).camera
    assert camera.f_px == pytest.approx(5.4709 * 266.666667, rel=1e-6)
    assert (camera.cx_px, camera.cy_px) == pytest.approx(
        (2.42299 * 266.666667 - 0.5, 1.850154 * 266.666667 - 0.5), abs=1e-3
    )
    assert camera.coefficients == pytest.approx([-0.09, 0.14, 0.0004, -0.0003, -0.02])


def test_pix4d_of_another_maker_is_unsure_of_the_side_the_centre_lies_on(take):
    xmp = packet(Camera_PrincipalPoint="2.4,1.85", Camera_PerspectiveFocalLength="5.47")
    camera = take((1280, 960), xmp, make="Other", fp_x=266.666667, fp_unit=4, focal=5.5).camera
    assert math.sqrt(camera.cov[3, 3]) > 2 * abs(1.85 * 266.666667 - 480)


def test_pix4d_with_items_of_an_array_and_no_resolution(take):
    elements = ("<Camera:PrincipalPoint><rdf:Seq><rdf:li>2.4</rdf:li><rdf:li>1.8</rdf:li></rdf:Seq></Camera:PrincipalPoint>"
                "<Camera:PerspectiveFocalLength>5.47</Camera:PerspectiveFocalLength>")  # fmt: skip
    camera = take((1280, 960), packet(elements)).camera
    assert camera.f_px == pytest.approx(5.47 * 640 / 2.4)
    assert camera.u_f_px / camera.f_px > 0.02


def test_pix4d_fisheye_agrees_with_its_own_equation(take):
    """rho = p0 + p1 t + p2 t^2 + p3 t^3 with t = 2 / pi * angle, in units of the affine matrix."""
    p, c = (0, 1, -0.025178575, 0.067834214), 1583.319083002
    xmp = packet(Camera_ModelType="fisheye", Camera_PrincipalPoint="2.4,1.8", Camera_FisheyeAffineMatrix=f"{c},0,0,{c}",
                 Camera_FisheyePolynomial=",".join(map(str, p)))  # fmt: skip
    camera = take((1280, 960), xmp, fp_x=266.666667, fp_unit=4).camera
    assert camera.lens == "fisheye"
    angle = np.linspace(0.02, 0.7, 30)
    t = 2 / math.pi * angle
    rho = c * sum(p[i] * t**i for i in range(4))
    seen = camera.project(np.stack([np.sin(angle), 0 * angle, np.cos(angle)], -1))
    assert seen[:, 0] - camera.cx_px == pytest.approx(rho, rel=2e-3, abs=0.1)


def test_pix4d_fisheye_that_is_not_round_is_left_out(take):
    xmp = packet(Camera_ModelType="fisheye", Camera_PrincipalPoint="2.4,1.8", Camera_FisheyeAffineMatrix="1500,200,0,1500",
                 Camera_FisheyePolynomial="0,1,0,0")  # fmt: skip
    with pytest.raises(UnknownCameraError, match="round lens"):
        take((1280, 960), xmp)


@pytest.mark.parametrize(("fx", "fy"), [("3000", "3000"), ("0.75", "0.75"), ("0.75", "1.0")])
def test_googles_imaging_model_in_px_and_in_fractions(take, fx, fy):
    elements = (f'<rdf:li><rdf:Description ImagingModel:FocalLengthX="{fx}" ImagingModel:FocalLengthY="{fy}" '
                'ImagingModel:ImageWidth="4000" ImagingModel:ImageHeight="3000"/></rdf:li>')  # fmt: skip
    found = take((2000, 1500), packet(f"<xmp:Cameras><rdf:Seq>{elements}</rdf:Seq></xmp:Cameras>"))
    assert found.chosen.source == "google_tags"
    assert found.camera.f_px == pytest.approx(1500)


@pytest.mark.parametrize(
    "properties",
    [
        [], [heic_boxes.irot(1)], [heic_boxes.irot(2)], [heic_boxes.irot(3)], [heic_boxes.imir(0)], [heic_boxes.imir(1)],
        [heic_boxes.irot(1), heic_boxes.imir(0)], [heic_boxes.clap(300, 200, -20, 10)],
        [heic_boxes.clap(300, 200, -20, 10), heic_boxes.irot(1)],
    ],
)  # fmt: skip
def test_the_matrix_of_a_heic_follows_the_pixels(tmp_path, properties):
    """A spot at the principal point of the coded picture is at that of the camera, however the container turns and cuts."""
    y, x = np.mgrid[:304, :400]
    spot = np.hypot(x + 0.5 - 160, y + 0.5 - 106.4) < 14
    pixels = np.repeat(np.where(spot, 255, 0).astype(np.uint8)[..., None], 3, -1)
    path = tmp_path / "a.heic"
    path.write_bytes(
        heic_boxes.heic(pixels=pixels, properties=[heic_boxes.cmin(1.25, 0.4, 0.35), *properties], quality=95)
    )
    photo = Photo.load(path)
    found = resolve_camera(photo)
    seen = np.where(photo.pixels[..., 1] > 100, photo.pixels[..., 1], 0).astype(float)
    y, x = np.mgrid[: seen.shape[0], : seen.shape[1]]
    middle = (x * seen).sum() / seen.sum(), (y * seen).sum() / seen.sum()
    assert found.chosen.source == "heic_matrix"
    assert (found.camera.cx_px, found.camera.cy_px) == pytest.approx(middle, abs=0.1)
    assert found.camera.f_px == pytest.approx(500, rel=1e-5)


def test_a_heics_exif_orientation_turns_the_focal_plane_and_not_the_picture(tmp_path):
    from written_photos import exif

    path = tmp_path / "a.heic"
    path.write_bytes(heic_boxes.heic(properties=[heic_boxes.irot(3)], exif=exif(turn=6, f35=26, width=400, height=300)))
    photo = Photo.load(path)
    assert (photo.width_px, photo.height_px) == (300, 400)
    assert resolve_camera(photo).notes == ()


@pytest.mark.parametrize("focal", [0.0001, 200.0, -1.0])
def test_a_matrix_of_another_picture_is_not_believed(tmp_path, focal):
    path = tmp_path / "a.heic"
    path.write_bytes(heic_boxes.heic(properties=[heic_boxes.cmin(focal, 0.5, 0.5)]))
    with pytest.raises(UnknownCameraError, match="another picture"):
        resolve_camera(Photo.load(path))


def pano(**changes):
    tags = {"ProjectionType": "equirectangular", "FullPanoWidthPixels": 800, "FullPanoHeightPixels": 400, "CroppedAreaLeftPixels": 200,
            "CroppedAreaTopPixels": 100, "CroppedAreaImageWidthPixels": 400, "CroppedAreaImageHeightPixels": 200}  # fmt: skip
    return packet(**{f"GPano_{name}": value for name, value in {**tags, **changes}.items() if value is not None})


@pytest.mark.parametrize("size", [(400, 200), (200, 100)])
def test_a_panorama_that_tells_its_geometry_has_a_camera(take, size):
    found = take(size, pano(), f35=26)
    assert [note.code for note in found.notes] == ["panorama"]
    assert found.camera.lens == "equirectangular"
    middle = [[size[0] / 2 - 0.5, size[1] / 2 - 0.5], [-0.5, size[1] / 2 - 0.5], [size[0] / 2 - 0.5, -0.5]]
    rays = found.camera.rays(np.array(middle, float))
    assert rays == pytest.approx(np.array([[0, 0, 1], [-1, 0, 0], [0, -math.sqrt(0.5), math.sqrt(0.5)]]), abs=1e-9)


@pytest.mark.parametrize(
    "changes",
    [
        {"ProjectionType": "cylindrical"},
        {"FullPanoWidthPixels": None},
        {"CroppedAreaLeftPixels": 700},
        {"FullPanoHeightPixels": 300},
    ],
)
def test_a_panorama_that_does_not_is_refused(take, changes):
    with pytest.raises(UnknownCameraError) as caught:
        take((400, 200), pano(**changes), f35=26)
    assert caught.value.code == "panorama"
