"""Networks: files of all kinds and none, threads, and the small calculations around a network."""

import subprocess
import sys
import threading

import numpy as np
import pytest
from tests.made_networks import onnx_file

from subtense.errors import FileFormatError, InputError, MissingExtraError
from subtense.networks import Network, files, model_file, network, packaged
from subtense.networks.boxes import blended, grid_anchors, groups, overlaps, sigmoid, ssd_anchors, suppressed
from subtense.networks.face_mesh import MESH
from subtense.networks.parts import part_of
from subtense.networks.view import cut, whole

SMALL = "selfie_segmentation.tflite"


def made(tmp_path, content: bytes, name: str = "made.onnx"):
    path = tmp_path / name
    path.write_bytes(content)
    return path


# -- files -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("path", sorted(files.FOLDER.glob("*.tflite")), ids=lambda path: path.name)
def test_every_packaged_network_is_one(path):
    found = Network(path)
    assert found.kind == "tflite"
    if path.name != MESH:  # of it only parts are run
        assert all(None not in tensor.shape for tensor in found.inputs)


def test_a_network_gives_what_it_gave_before_in_every_thread():
    found = packaged(SMALL)
    image = np.random.default_rng(1).random((1, 256, 256, 3))
    [expected] = found.run(image)
    got: list[np.ndarray] = []
    threads = [threading.Thread(target=lambda: got.append(found.run(image)[0])) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(got) == 4 and all(np.array_equal(one, expected) for one in got)
    assert expected.shape == (1, 256, 256, 1)


def test_an_onnx_file_is_run_and_tells_its_metadata(tmp_path):
    found = Network(made(tmp_path, onnx_file("Add", (2, "n"), inputs=("a", "b"), metadata={"names": "{0: 'cup'}"})))
    assert found.kind == "onnx" and found.metadata["names"] == "{0: 'cup'}"
    assert [str(tensor) for tensor in found.inputs] == ["a float32 (2 x any)", "b float32 (2 x any)"]
    [total] = found.run(np.ones((2, 3)), np.full((2, 3), 2.5))
    assert np.array_equal(total, np.full((2, 3), 3.5))
    assert found.expect([(2, 5), (2, 5)], [(2, 5)]) is found


def test_what_is_expected_of_a_network_is_told_where_it_differs():
    with pytest.raises(FileFormatError, match=r"selfie_segmentation\.tflite: takes .*256 x 256 x 3.* not 1 x 192"):
        packaged(SMALL).expect([(1, 192, 192, 3)], [(1, 256, 256, 1)])
    with pytest.raises(FileFormatError, match=r"gives .* and not 1 x 4"):
        packaged(SMALL).expect([(1, 256, 256, 3)], [(1, 4)])
    with pytest.raises(FileFormatError, match=r"takes .* not an array of 1 x 2 x 2 x 3"):
        packaged(SMALL).run(np.zeros((1, 2, 2, 3)))
    with pytest.raises(FileFormatError, match="takes 1 arrays, not 2"):
        packaged(SMALL).run(np.zeros(1), np.zeros(1))


def broken():
    good = model_file(SMALL).read_bytes()
    onnx = onnx_file("Relu", (2, 3))
    return {
        "empty": b"", "text": b"hello, I am no network at all", "picture": b"\xff\xd8\xff\xe0" + bytes(100),
        "cut": good[: len(good) // 3], "head only": good[:64], "turned": good[:8] + good[:7:-1], "cut onnx": onnx[:-9],
        "noise onnx": b"\x08" + bytes(range(256)), "own operation": onnx_file("Steal", (2, 3), domain="somebody.else"),
        "no such operation": onnx_file("Steal", (2, 3)),
    }  # fmt: skip


@pytest.mark.parametrize("name", broken())
def test_a_broken_file_is_one_line(tmp_path, name):
    path = made(tmp_path, broken()[name], "broken.bin")
    with pytest.raises(FileFormatError) as caught:
        _ = Network(path).inputs
    assert str(caught.value).startswith(f"{path}: ") and "\n" not in str(caught.value)


def test_a_missing_file_and_a_folder(tmp_path):
    for path in (tmp_path / "none.onnx", tmp_path):
        with pytest.raises(FileFormatError, match="cannot be read"):
            Network(path)


def test_a_network_with_operations_of_its_own_is_refused():
    with pytest.raises(FileFormatError, match="no network that can be run"):
        _ = Network(model_file(MESH)).inputs


def test_limits_on_size(tmp_path, monkeypatch):
    path = made(tmp_path, onnx_file("Relu", (2**15, 2**14)))
    with pytest.raises(FileFormatError, match="which is more than"):
        _ = Network(path).inputs
    monkeypatch.setattr(network, "MOST_BYTES", 20)
    with pytest.raises(FileFormatError, match="MiB"):
        Network(path)


def test_an_installation_without_networks_says_what_to_do(monkeypatch, tmp_path):
    monkeypatch.setattr(files, "FOLDER", tmp_path)
    with pytest.raises(MissingExtraError, match="SUBTENSE_WITHOUT_NETWORKS"):
        model_file(SMALL)


def test_an_installation_without_engines_says_what_to_install(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "ai_edge_litert.interpreter", None)
    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    for path in (model_file(SMALL), made(tmp_path, onnx_file("Relu", (2, 3)))):
        with pytest.raises(MissingExtraError, match=r'pip install "subtense\[networks\]"'):
            _ = Network(path).inputs


def test_running_a_network_says_nothing_and_imports_late():
    code = (
        "import sys, numpy as np; from subtense.networks import packaged; n = packaged('selfie_segmentation.tflite');"
        "assert not {'ai_edge_litert', 'onnxruntime'} & set(sys.modules); n.run(np.zeros((1, 256, 256, 3)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


# -- parts -------------------------------------------------------------------------------------------


def test_the_part_from_input_to_output_is_the_whole():
    path = model_file(SMALL)
    image = np.random.default_rng(2).random((1, 256, 256, 3))
    part = Network(path, (("input_1",), ("activation_10",)))
    assert np.array_equal(part.run(image)[0], Network(path).run(image)[0])


def test_two_parts_one_after_the_other_are_the_whole():
    path = model_file(MESH)
    image = np.random.default_rng(3).random((1, 192, 192, 3))
    mesh, middle = Network(path, (("input_1",), ("output_mesh", "p_re_lu_3"))).run(image)
    [again] = Network(path, (("p_re_lu_3",), ("output_mesh",))).run(middle)
    assert np.allclose(mesh, again, atol=1e-3) and np.ptp(mesh) > 1


def test_a_part_of_tensors_that_are_not_there():
    content = model_file(SMALL).read_bytes()
    with pytest.raises(InputError, match="no tensor of this name"):
        part_of(content, ["input_1"], ["elsewhere"])
    with pytest.raises(InputError, match="at most 1"):
        part_of(content, ["input_1", "activation_10"], ["activation_10"])


# -- views -------------------------------------------------------------------------------------------


def spot(width: int, height: int, x: float, y: float, sigma: float) -> np.ndarray:
    yy, xx = np.mgrid[0:height, 0:width]
    value = 255 * np.exp(-((xx - x) ** 2 + (yy - y) ** 2) / (2 * sigma**2))
    return np.repeat(value[..., None], 3, axis=2).round().astype(np.uint8)


def centre_of(seen) -> np.ndarray:
    weights = seen.pixels[..., 0]
    y, x = np.mgrid[0 : weights.shape[0], 0 : weights.shape[1]]
    return seen.in_picture(np.array([(weights * x).sum(), (weights * y).sum()]) / weights.sum())


@pytest.mark.opencv
@pytest.mark.parametrize(("width", "height"), [(640, 480), (300, 900), (192, 192), (100, 60), (1999, 1501)])
def test_a_letterbox_keeps_the_proportions_and_the_places(width, height):
    at = np.array([0.7 * width, 0.3 * height])
    seen = whole(spot(width, height, *at, sigma=max(width, height) / 40), 192, 160)
    assert seen.pixels.shape == (160, 192, 3)
    assert np.allclose(seen.to_picture[0, 0], seen.to_picture[1, 1]) and not np.any(seen.to_picture[[0, 1], [1, 0]])
    assert np.allclose(centre_of(seen), at, atol=0.06 * seen.scale + 0.02)


@pytest.mark.opencv
@pytest.mark.parametrize("angle", [-2.2, -0.3, 0.4, 1.5])
@pytest.mark.parametrize("scale", [0.4, 1.0, 1.1, 3.3, 7.0])
def test_a_turned_cut_keeps_the_places(angle, scale):
    at = np.array([402.3, 311.8])
    seen = cut(spot(800, 600, *at, sigma=max(6 * scale, 3.0)), np.array([400.0, 310.0]), scale, 96, 80, angle_rad=angle)
    assert np.allclose(centre_of(seen), at, atol=0.06 * max(scale, 1))
    assert seen.scale == pytest.approx(scale)


@pytest.mark.opencv
def test_beyond_the_picture_there_is_what_was_asked_for():
    white = np.full((50, 50, 3), 255, np.uint8)
    assert np.all(cut(white, np.array([500.0, 500.0]), 1.0, 20, 20, beyond=7.0).pixels == 7)
    half = cut(white, np.array([49.5, 25.0]), 1.0, 20, 20, beyond=0.0).input(-1.0, 1.0)
    assert half.shape == (1, 20, 20, 3) and np.all(half[0, :, :9] == 1.0) and np.all(half[0, :, 11:] == -1.0)


# -- boxes -------------------------------------------------------------------------------------------


def test_anchors_stand_in_the_middle_of_cells():
    found = grid_anchors(128, [(8, 2), (16, 6)])
    assert found.shape == (16 * 16 * 2 + 8 * 8 * 6, 2)
    assert np.allclose(found[:2], 0.5 / 16) and np.allclose(found[2], [1.5 / 16, 0.5 / 16])
    assert np.allclose(found[-1], 7.5 / 8)


def test_ssd_anchors_of_300_px():
    found = ssd_anchors(300, (16, 32, 64, 128, 256, 512), smallest=0.2, largest=0.95, ratios=(1, 2, 0.5, 3, 1 / 3))
    assert found.shape == (1917, 4)
    assert np.allclose(found[0], [0.5 / 19, 0.5 / 19, 0.1, 0.1])
    assert np.allclose(found[1, 2] / found[1, 3], 2) and np.allclose(found[1, 2] * found[1, 3], 0.04)
    assert np.allclose(found[-6:, :2], 0.5) and np.allclose(found[-6, 2:], 0.95)
    assert np.allclose(found[-1, 2:], 0.95**0.5)


def test_boxes_of_one_thing_are_one():
    boxes = np.array([[0, 0, 10, 10], [1, 0, 11, 10], [50, 50, 60, 70], [0, 1, 10, 11]], float)
    scores = np.array([0.6, 0.9, 0.8, 0.3])
    assert [list(group) for group in groups(boxes, scores, 0.5)] == [[1, 0, 3], [2]]
    assert list(suppressed(boxes, scores, 0.5)) == [1, 2]
    values, best = blended(boxes, scores, 0.5)
    assert np.allclose(best, [0.9, 0.8]) and np.allclose(values[1], boxes[2])
    assert np.allclose(values[0], scores[[1, 0, 3]] @ boxes[[1, 0, 3]] / 1.8)
    assert np.allclose(overlaps(boxes[0], boxes)[:3], [1.0, 9 / 11, 0.0])


def test_no_box_at_all():
    none = np.zeros((0, 4))
    values, scores = blended(none, np.zeros(0), 0.5, np.zeros((0, 7)))
    assert values.shape == (0, 7) and scores.shape == (0,) and len(suppressed(none, np.zeros(0), 0.5)) == 0


def test_sigmoid_of_anything():
    assert np.allclose(sigmoid(np.array([-1e4, 0.0, 1e4])), [0.0, 0.5, 1.0])
