"""Depth maps: of networks whose arithmetic is known, of files, anchored and not, on scenes and pictures with truth."""

import json
import math
import sys
import types
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from depth_networks import gray_network
from onnx_files import constants
from PIL import Image

from subtense import propagate
from subtense.anchoring import Anchor, aligned
from subtense.camera import Camera
from subtense.cli import main
from subtense.depth_models import depth_models, find_depth_model, u_of_share
from subtense.errors import FileFormatError, GeometryError, InputError, MissingExtraError
from subtense.methods import depth_map
from subtense.observation import Observation
from subtense.photo import Photo
from subtense.quantity import Quantity
from subtense.raw_depth import RawDepth
from subtense.workflow.depth import Wanted, anchored, depth_document, depth_map_of
from subtense.workflow.depth_source import DepthTexts
from subtense.workflow.ground import GroundTexts

pytestmark = pytest.mark.opencv
WIDTH, HEIGHT, F = 320, 240, 260.0
CAMERA = f"f={F}±0.001px"
MEAN, DEVIATION = np.array([0.485, 0.456, 0.406]), np.array([0.229, 0.224, 0.225])
WHITENED = (float(np.mean(1 / DEVIATION)), float(np.mean(MEAN / DEVIATION)))
"""The mean of the channels of gray g, normalised as ImageNet: g times the first, less the second."""


def gray(x, y):
    """Of the picture below, 0 to 1."""
    return (40 + 0.5 * x + 0.2 * y) / 255


@pytest.fixture(scope="module")
def picture(tmp_path_factory) -> Photo:
    """A gray ramp."""
    x, y = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
    pixels = np.repeat(np.round(255 * gray(x, y)).astype(np.uint8)[..., None], 3, -1)
    path = tmp_path_factory.mktemp("picture") / "ramp.png"
    Image.fromarray(pixels).save(path)
    return Photo.load(path)


def document(photo, said, *, points=(), boxes=(), pairs=(), camera=CAMERA, **more):
    return depth_document(photo, said, Wanted(points, boxes, pairs), camera=camera, **more)[0]


def depth_of(found):
    return next(m for m in found.measurements if m.what == "depth")


def codes(found):
    return {note.code for note in (*found.notes, *(n for m in found.measurements for n in m.notes))}


# -- networks ----------------------------------------------------------------------------------------


def test_a_network_of_a_canonical_camera_is_corrected_by_this_camera(picture, tmp_path):
    """Metric3D: 0 to 255, one size, the picture in proportion within it; metres of a focal length of 1000 px."""
    path = gray_network(tmp_path / "metric3d-v2-small.onnx", 4.0 / 255, 1.0, shape=(1, 3, 616, 1064))
    scale = min(616 / HEIGHT, 1064 / WIDTH)
    for f in (F, 2 * F):
        found = document(picture, DepthTexts(model=path), points=["200,120"], camera=f"f={f}px")
        truth = (1 + 4 * gray(200, 120)) * f * scale / 1000
        assert depth_of(found).value == pytest.approx(truth, rel=0.005)
    assert {"unanchored_depth"} <= codes(found)


def test_a_length_across_does_not_hang_on_the_focal_length_of_a_canonical_network(picture, tmp_path):
    path = gray_network(tmp_path / "metric3d-v2-small.onnx", 0.0001, 2.0, shape=(1, 3, 616, 1064))
    found = document(picture, DepthTexts(model=path, error="1 %"), pairs=["100,120;220,120"], camera=f"f={F}±13px")
    shares = {line.name: line.share for line in found.measurements[0].budget}
    assert shares.get("focal length", 0) < 0.02


def test_a_network_trained_with_one_focal_length_is_corrected_and_doubted(picture, tmp_path):
    slope, start = 3.0 / WHITENED[0], 1 + 3.0 * WHITENED[1] / WHITENED[0]
    path = gray_network(tmp_path / "depth-anything-v2-metric-indoor-small.onnx", slope, start)
    ratio = F / (1.1547 * HEIGHT)
    for f, noted in ((F, True), (1.1547 * HEIGHT, False)):
        found = document(picture, DepthTexts(model=path), points=["200,120"], camera=f"f={f}px")
        assert depth_of(found).value == pytest.approx((1 + 3 * gray(200, 120)) * f / (1.1547 * HEIGHT), rel=0.005)
        assert ("focal_corrected" in codes(found)) == noted
    assert abs(math.log(ratio)) > 0.02


def test_a_network_that_tells_its_focal_length_is_corrected_by_it(picture, tmp_path):
    """Depth Pro: -1 to 1, squeezed into a square."""
    size = (1, 3, 256, 256)
    path = gray_network(tmp_path / "depth-pro.onnx", 1.5, 2.5, shape=size, more={"focallength_px": np.array([200.0])})
    found = document(picture, DepthTexts(model=path), points=["200,120"])
    truth = (2.5 + 1.5 * (2 * gray(200, 120) - 1)) * F * (256 / WIDTH) / 200
    assert depth_of(found).value == pytest.approx(truth, rel=0.005)
    alone = gray_network(tmp_path / "depth-pro-2.onnx", 1.5, 2.5, shape=size)
    with pytest.raises(FileFormatError, match="no focal length beside"):
        document(picture, DepthTexts(model=alone), points=["200,120"])


def points_network(path, *, shift=0.7, scale=1.3, mask=None):
    """MoGe: places up to a shift along the axis, and a factor."""
    height, width = 252, 336
    x, y = np.meshgrid(
        (np.arange(width) + 0.5) / width * WIDTH - 0.5, (np.arange(height) + 0.5) / height * HEIGHT - 0.5
    )
    depth = 2 + 0.004 * x + 0.002 * y
    places = np.stack([(x - (WIDTH - 1) / 2) / F * depth, (y - (HEIGHT - 1) / 2) / F * depth, depth - shift], -1)
    outputs = {"points": places[None], "metric_scale": np.array([scale])}
    if mask is not None:
        outputs["mask"] = mask(x, y)[None].astype(float)
    inputs = {"image": ("float32", (1, 3, height, width)), "num_tokens": ("int64", ())}
    return constants(path, outputs, inputs=inputs), lambda x, y: scale * (2 + 0.004 * x + 0.002 * y)


def test_a_map_of_points_gets_the_shift_at_which_they_are_seen_by_this_camera(picture, tmp_path):
    path, truth = points_network(tmp_path / "moge-2-small.onnx", mask=lambda x, y: y > 40)
    found = document(picture, DepthTexts(model=path), points=["60,90", "280,200"])
    depths = [m.value for m in found.measurements if m.what == "depth"]
    assert depths == pytest.approx([truth(60, 90), truth(280, 200)], rel=1e-3)
    with pytest.raises(GeometryError, match="no number at 100,20"):
        document(picture, DepthTexts(model=path), points=["100,20"])


def relative_network(tmp_path):
    """Depth Anything: disparity up to a factor and a shift; the truth is 1 / (0.2 + 0.6 g)."""
    slope, start = 30.0 / WHITENED[0], 5 + 30.0 * WHITENED[1] / WHITENED[0]
    path = gray_network(tmp_path / "depth-anything-v2-small.onnx", slope, start)
    return path, lambda x, y: 1 / (0.2 + 0.6 * gray(x, y))


@pytest.mark.parametrize("anchors", [[], ["100,100 = depth 2.4 m"]])
def test_a_relative_network_without_two_anchors_refuses(picture, tmp_path, anchors):
    path, _ = relative_network(tmp_path)
    with pytest.raises(InputError, match="give two known distances at different depths"):
        document(picture, DepthTexts(model=path), points=["200,120"], anchors=anchors)


def test_anchors_make_metres_of_a_relative_network(picture, tmp_path):
    path, truth = relative_network(tmp_path)
    places = [(20, 20), (160, 120), (300, 220)]
    typed = [f"{x},{y} = depth {truth(x, y):.5f} m ± 0.2 %" for x, y in places]
    found = document(picture, DepthTexts(model=path), points=["90,200"], anchors=typed)
    m = depth_of(found)
    assert m.low < truth(90, 200) < m.high and m.value == pytest.approx(truth(90, 200), rel=0.01)
    assert "anchored_depth" in codes(found) and "unanchored_depth" not in codes(found)


def test_the_doubt_of_a_network_is_its_published_error_and_lopsided(picture, tmp_path):
    path = gray_network(tmp_path / "metric3d-v2-small.onnx", 4.0 / 255, 1.0, shape=(1, 3, 616, 1064))
    m = depth_of(document(picture, DepthTexts(model=path), points=["200,120"]))
    row = depth_models()["metric3d-v2-small"]
    assert math.hypot(row.u_factor, row.u_local) == pytest.approx(row.u_total)
    assert m.high / m.value > m.value / m.low * 0.9 and m.high - m.value > m.value - m.low
    assert 0.5 * (m.high - m.low) / m.value == pytest.approx(1.96 * row.u_total, rel=0.25)


def test_published_shares_mean_what_they_say():
    """Of normal errors of that deviation in the logarithm, the share lies within a factor of 1.25."""
    errors = np.random.default_rng(1).normal(0, u_of_share(0.875), 200_000)
    assert np.mean(np.abs(errors) < math.log(1.25)) == pytest.approx(0.875, abs=0.003)
    assert all(0.05 < row.u_total < 0.8 and row.licence and row.source for row in depth_models().values())


def test_a_network_of_one_s_own_is_told_by_what_it_gives(picture, tmp_path):
    path = gray_network(tmp_path / "mine.onnx", 4.0, 1.0, shape=(1, 3, 224, 224))
    with pytest.raises(InputError, match="no known network"):
        document(picture, DepthTexts(model=path), points=["9,9"])
    with pytest.raises(InputError, match="--depth-error is missing"):
        document(picture, DepthTexts(model=path, gives="metric", takes="unit"), points=["9,9"])
    said = DepthTexts(model=path, gives="metric", takes="unit", error="10 %")
    m = depth_of(document(picture, said, points=["200,120"]))
    assert m.value == pytest.approx(1 + 4 * gray(200, 120), rel=0.005)
    assert m.u == pytest.approx(0.1 / 1.96 * m.value, rel=0.05)


def test_a_network_that_asks_for_the_camera_s_matrix_gets_it(picture, tmp_path):
    more = {"K": ("float32", (1, 3, 3))}
    path = gray_network(tmp_path / "unidepth-v2-small.onnx", 1.0, 3.0, extra=more)
    assert depth_of(document(picture, DepthTexts(model=path), points=["9,9"])).value > 0
    odd = gray_network(tmp_path / "unidepth-v2-small-b.onnx", 1.0, 3.0, extra={"prompt": ("float32", (1, 77))})
    with pytest.raises(FileFormatError, match="takes prompt"):
        document(picture, DepthTexts(model=odd), points=["9,9"])


def test_the_only_network_that_is_here_is_used_and_said(picture, tmp_path):
    said = DepthTexts(folder=tmp_path)
    with pytest.raises(InputError, match=r"hf download \S+ .*MB, BSD"):
        document(picture, said, points=["9,9"])
    with pytest.raises(InputError, match=r"its file is not in .* hf download Ruicheng"):
        document(picture, replace(said, prefer="moge-2-small"), points=["9,9"])
    gray_network(tmp_path / "metric3d-v2-small" / "onnx" / "model.onnx", 0.01, 1.0, shape=(1, 3, 616, 1064))
    assert "depth_model_chosen" in codes(document(picture, said, points=["9,9"]))
    gray_network(tmp_path / "metric3d-v2-large.onnx", 0.01, 1.0, shape=(1, 3, 616, 1064))
    with pytest.raises(InputError, match="2 networks are here; name one: metric3d-v2-small, metric3d-v2-large"):
        document(picture, said, points=["9,9"])
    named = document(picture, replace(said, prefer="metric3d-v2-large"), points=["9,9"])
    assert "depth_model_chosen" not in codes(named)
    with pytest.raises(InputError, match="known are metric3d"):
        find_depth_model("metrik3d")


def test_a_network_of_transformers_is_run_where_it_is_installed(picture, monkeypatch, tmp_path):
    said = DepthTexts(prefer="depth-anything/Depth-Anything-V2-Metric-Indoor-Small-hf", folder=tmp_path)
    monkeypatch.setitem(sys.modules, "transformers", None)
    with pytest.raises(MissingExtraError, match="pip install transformers torch"):
        document(picture, said, points=["9,9"])

    class Values:
        def __init__(self, array):
            self.array = array

        def squeeze(self):
            return Values(self.array.squeeze())

        def numpy(self):
            return self.array

    class Fake:
        there = True

        @classmethod
        def from_pretrained(cls, name, local_files_only=False):
            assert local_files_only, "nothing is fetched"
            if not cls.there:
                raise OSError(f"{name} is not in the cache")
            return cls()

        def __call__(self, images=None, return_tensors=None, **values):
            if images is not None:
                return {"pixel_values": images}
            seen = np.asarray(values["pixel_values"], float)[::2, ::2, 0] / 255
            return types.SimpleNamespace(predicted_depth=Values(1 + 3 * seen[None]))

    class NoGrad:
        def __enter__(self):
            return self

        def __exit__(self, *_):
            return None

    fake = types.ModuleType("transformers")
    fake.AutoImageProcessor = fake.AutoModelForDepthEstimation = Fake
    torch = types.ModuleType("torch")
    torch.no_grad = NoGrad
    monkeypatch.setitem(sys.modules, "transformers", fake)
    monkeypatch.setitem(sys.modules, "torch", torch)
    found = depth_of(document(picture, said, points=["200,120"]))
    assert found.value == pytest.approx((1 + 3 * gray(200, 120)) * F / (1.1547 * HEIGHT), rel=0.01)
    Fake.there = False
    with pytest.raises(InputError, match="fetch it: hf download depth-anything"):
        document(picture, said, points=["9,9"])


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda p: p.write_bytes(b"not a network"), "neither a TFLite nor an ONNX"),
        (lambda p: p.write_bytes(b"\x08\x08" + b"x" * 99), "no network that can be run"),
        (lambda p: gray_network(p, 1.0, 1.0, shape=(1, 4, 64, 64)), "takes image float32"),
        (lambda p: gray_network(p, 0.0, 3.0, shape=(1, 3, 64, 64)), "gives 3 everywhere"),
        (lambda p: gray_network(p, math.nan, 3.0, shape=(1, 3, 64, 64)), "hardly a number that is finite"),
        (lambda p: gray_network(p, -1.0, -3.0, shape=(1, 3, 64, 64)), "no depth above 0"),
        (lambda p: gray_network(p, 1.0, 3.0, shape=(1, 3, 8, 8)), "14 to 4096 px"),
        (lambda p: constants(p, {"boxes": np.ones((1, 30, 6))}, inputs={"image": ("float32", (1, 3, 64, 64))}), "gives 1 everywhere"),
        (lambda p: constants(p, {"a": np.ones((1, 9, 9)), "b": np.ones((1, 9, 9))}), "no single map of depth"),
    ],
)  # fmt: skip
def test_a_file_that_is_no_network_of_depth_is_one_line(picture, tmp_path, make, says):
    path = tmp_path / "metric3d-v2-small.onnx"
    make(path)
    with pytest.raises(FileFormatError, match=says) as error:
        document(picture, DepthTexts(model=path), points=["9,9"])
    assert "\n" not in str(error.value)


# -- maps in files -----------------------------------------------------------------------------------


def written(path: Path, depth, unit=0.001):
    """A depth map as a file, by its ending; NaN as none."""
    if path.suffix == ".png":
        Image.fromarray(np.rint(np.nan_to_num(depth) / unit).astype(np.uint16)).save(path)
    elif path.suffix == ".npy":
        np.save(path, depth)
    else:
        head = f"Pf\n{depth.shape[1]} {depth.shape[0]}\n-1.0\n".encode()
        path.write_bytes(head + np.asarray(depth, "<f4")[::-1].tobytes())
    return path


def wall(width=WIDTH, height=HEIGHT):
    """A slanting wall, in numbers for each pixel of a map of any size."""
    x = (np.arange(width) + 0.5) / width * WIDTH - 0.5
    return np.broadcast_to(2 + 0.005 * x, (height, width)).copy()


@pytest.mark.parametrize("ending", [".png", ".pfm", ".npy"])
@pytest.mark.parametrize("size", [(WIDTH, HEIGHT), (160, 120), (640, 480)])
def test_a_map_made_elsewhere_is_read_and_fitted_to_the_picture(picture, tmp_path, ending, size):
    path = written(tmp_path / f"map{ending}", wall(*size))
    said = DepthTexts(path, unit="1 mm" if ending == ".png" else None, error="1 %")
    found = document(picture, said, points=["100,200"])
    assert depth_of(found).value == pytest.approx(2.5, abs=0.011)
    assert ("depth_unit_assumed" in codes(found)) == (ending != ".png")
    assert "unanchored_depth" not in codes(found), "its error was stated by a person"


def test_ranges_in_a_file_become_depths(picture, tmp_path):
    x, y = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
    slant = np.sqrt(1 + ((x - 159.5) / F) ** 2 + ((y - 119.5) / F) ** 2)
    path = written(tmp_path / "ranges.npy", wall() * slant)
    m = depth_of(document(picture, DepthTexts(path, unit="1 m", error="1 %", gives="range"), points=["20,30"]))
    assert m.value == pytest.approx(2.1, rel=1e-3)


def test_the_edge_of_a_thing_is_noted_and_holds_both_depths(picture, tmp_path):
    depth = np.full((HEIGHT, WIDTH), 4.0)
    depth[:, 150:] = 1.5
    depth[0, 0] = 4.1
    said = DepthTexts(written(tmp_path / "edge.npy", depth), unit="1 m", error="1 %")
    m = depth_of(edge := document(picture, said, points=["149,100"]))
    assert "depth_edge" in codes(edge) and m.low < 1.5 and m.high > 4.0
    clear = document(picture, said, points=["200,100"])
    assert "depth_edge" not in codes(clear)
    box = document(picture, said, boxes=["140,40,260,160"])
    assert depth_of(box).value == pytest.approx(1.5)


@pytest.mark.parametrize(
    ("text", "relative", "u_m"),
    [
        ("1 %", 0.01 / 1.96, 0),
        ("5 mm", 0, 0.005 / 1.96),
        ("5 mm + 1 %", 0.01 / 1.96, 0.005 / 1.96),
        ("2 % (1s)", 0.02, 0),
    ],
)
def test_a_stated_error_is_the_u_of_a_depth(picture, tmp_path, text, relative, u_m):
    said = DepthTexts(
        written(tmp_path / "map.npy", np.full((HEIGHT, WIDTH), 3.0) + 1e-6 * wall()), unit="1 m", error=text
    )
    m = depth_of(document(picture, said, points=["160,120"]))
    assert m.u == pytest.approx(math.hypot(3 * relative, u_m), rel=0.02)


BAD_FILES = {
    "no.npy": (None, "cannot be read"),
    "map.tif": (b"II*", "told by its ending"),
    "text.png": (b"hello", "no PNG"),
    "text.pfm": (b"hello", "no PFM"),
    "cut.pfm": (b"Pf\n320 240\n-1.0\n" + bytes(100), "is cut"),
    "three.pfm": (b"PF\n2 2\n-1.0\n" + bytes(48), "three channels"),
    "huge.pfm": (b"Pf\n999999 999999\n-1.0\n", "100 million"),
    "text.npy": (b"hello", "no NPY"),
    "cut.npy": (b"\x93NUMPY\x01\x00\x76\x00", "no NPY"),
}


@pytest.mark.parametrize("name", BAD_FILES)
def test_a_file_that_is_no_map_is_one_line(picture, tmp_path, name):
    content, says = BAD_FILES[name]
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(FileFormatError, match=says) as error:
        document(picture, DepthTexts(path, unit="1 m", error="1 %"), points=["9,9"])
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("depth", "says"),
    [
        (np.full((HEIGHT, WIDTH), np.nan), "has no number above 0"),
        (np.zeros((HEIGHT, WIDTH)), "has no number above 0"),
        (np.full((HEIGHT, WIDTH), 2.0), "has the number 2 everywhere"),
        (wall(100, 100), "100 x 100 numbers and the picture 320 x 240"),
        (wall(HEIGHT, WIDTH), "turn it as the picture"),
        (np.ones((2, 3, 4)), "2 x 3 x 4"),
        (np.array(["a", "b"]), "no NPY file of numbers"),
    ],
)
def test_a_map_that_says_nothing_or_is_of_another_picture_is_one_line(picture, tmp_path, depth, says):
    path = tmp_path / "map.npy"
    np.save(path, depth)
    with pytest.raises(FileFormatError, match=says):
        document(picture, DepthTexts(path, unit="1 m", error="1 %"), points=["9,9"])


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ("--depth {npy} --point 9,9", "--depth-error is missing"),
        ("--depth {png} --depth-error 1% --point 9,9", "--depth-unit is missing"),
        ("--depth {png} --depth-error 1% --depth-unit 2kg --point 9,9", "give the length of one number"),
        ("--depth {png} --depth-error much --depth-unit 1mm --point 9,9", "give a share, a length or both"),
        ("--depth {npy} --depth-error 0% --point 9,9", "an error above 0"),
        ("--depth {npy} --depth-error 1% --prefer zoedepth --point 9,9", "a map or a network, not both"),
        ("--depth {npy} --gives depth --point 9,9", "known are metric"),
        ("--depth {npy} --depth-error 1%", "say where to measure"),
        ("--depth {npy} --depth-error 1% --point 999,9", "it must lie in it"),
        ("--depth {npy} --depth-error 1% --box 50,50,40,60", "left, top, right and bottom"),
        ("--depth {npy} --depth-error 1% --box 1,2,3", "left, top, right and bottom"),
        ("--depth {npy} --depth-error 1% --point 9,9 --anchor 3m", "write where and how far"),
        ("--depth {npy} --depth-error 1% --point 9,9 --anchor 9,9=3", "give a length in"),
        ("--depth {npy} --depth-error 1% --point 9,9 --anchor 9,9=-3m", "give a distance above 0"),
        ("--depth {npy} --depth-error 1% --point 9,9 --anchor 9999,9=3m", "it must lie in it"),
        ("--depth {npy} --gives disparity --point 9,9 --anchor 9,9=3m --anchor 9,90=3.1m", "one number at all of them"),
        ("--depth {npy} --gives disparity --point 9,9 --anchor 9,9=2m --anchor 300,90=3.5m", "or is it a map of depth"),
        ("--depth {npy} --depth-error 1% --point 9,9 --anchor-by unicorn", "unicorn"),
        ("--depth {npy} --depth-error 1% --depth-map {npy}.gif", "give a name that ends in"),
        ("--model {npy} --point 9,9", "give a map that was made elsewhere with --depth"),
        ("--prefer zoedepth --gives metric --point 9,9", "say that themselves"),
        ("--depth-unit 1mm --point 9,9", "name that with --depth"),
    ],
)
def test_what_can_t_be_used_is_one_line(picture, tmp_path, options, says):
    written(tmp_path / "map.png", wall())
    written(tmp_path / "map.npy", wall())
    words = [
        w.replace("{png}", str(tmp_path / "map.png")).replace("{npy}", str(tmp_path / "map.npy"))
        for w in options.split()
    ]
    result = CliRunner().invoke(
        main, ["depth", str(picture.path), "--camera", CAMERA, "--models", str(tmp_path), *words]
    )
    assert result.exit_code in (2, 3) and result.output.startswith("subtense: "), result.output
    assert says in result.output and result.output.count("\n") == 1


# -- anchors -----------------------------------------------------------------------------------------


def scene(rng, tau, kind):
    """Depths of a made scene, and its map with local errors of tau, scale and shift unknown."""
    x, y = np.meshgrid(np.linspace(0, 1, 32), np.linspace(0, 1, 24))
    a, b, c = rng.uniform(0, 6, 3)
    depth = np.exp(
        rng.uniform(0.2, 1.5) + 0.5 * np.sin(a + 4 * x) + 0.4 * np.cos(b + 3 * y) + 0.3 * np.sin(c + 5 * x * y)
    )
    seen = depth * (1 + tau * rng.standard_normal(depth.shape))
    if kind == "disparity":
        return depth, rng.uniform(5, 50) / seen + rng.uniform(-0.5, 3.0)
    scale, shift = rng.uniform(0.3, 3.0), (rng.uniform(0.5, 2.0) if kind == "affine" else 0.0)
    return depth, scale * seen + shift


@pytest.mark.parametrize(
    ("kind", "count"), [("scaled", 1), ("scaled", 6), ("affine", 4), ("disparity", 3), ("disparity", 10)]
)
def test_95_of_100_anchored_intervals_hold_the_truth(tmp_path, kind, count):
    """Of all places of many scenes. Each has a number of its own, and the anchors err by 1 %."""
    rng, tau, inside, total = np.random.default_rng(7), 0.04, 0, 0
    Image.new("RGB", (32, 24), (99, 99, 99)).save(tmp_path / "small.png")
    photo, path = Photo.load(tmp_path / "small.png"), tmp_path / "map.npy"
    for _ in range(60):
        depth, numbers = scene(rng, tau, kind)
        np.save(path, numbers + max(0.1 - numbers.min(), 0))
        rows, columns = divmod(rng.permutation(32 * 24)[:count], 32)
        known = depth[rows, columns] * (1 + 0.01 * rng.standard_normal(count))
        typed = [f"{x},{y}±0.01px = depth {z:.6f} m ± 1 % (1s)" for x, y, z in zip(columns, rows, known, strict=True)]
        said = DepthTexts(path, error=f"{100 * tau * 2**0.5} % (1s)", gives=kind)
        try:
            found = anchored(photo, said, typed, camera="f=30±0.001px")
        except InputError:  # noise may turn two anchors round
            continue
        made, reach = depth_map_of(found), 1.96
        x, sigma = (
            (1 / made.depth_m, made.sigma_m / made.depth_m**2) if kind == "disparity" else (made.depth_m, made.sigma_m)
        )
        truth = 1 / depth if kind == "disparity" else depth
        inside += np.count_nonzero(np.abs(x - truth) <= reach * sigma)
        total += depth.size
    assert total > 30_000 and inside / total >= 0.94, f"{inside / total:.3f} of {total}"


def test_an_anchor_that_lies_far_off_is_named_and_does_not_carry_the_map_away(picture, tmp_path):
    said = DepthTexts(written(tmp_path / "map.npy", 2 * wall()), gives="scaled", error="1 %")
    places = [(20, 20), (80, 100), (150, 60), (220, 200), (300, 120)]
    typed = [f"{x},{y} = depth {2 + 0.005 * x:.4f} m ± 0.2 %" for x, y in places]
    right = depth_of(document(picture, said, points=["120,120"], anchors=typed))
    typed[2] = "150,60 = depth 4.1 m ± 0.2 %"
    wrong = document(picture, said, points=["120,120"], anchors=typed)
    assert right.value == pytest.approx(2.6, rel=0.003)
    assert "anchors_disagree" in codes(wrong) and "4.1 m" in str([n.text for n in wrong.notes])
    m = depth_of(wrong)
    assert m.low < 2.6 < m.high and m.u > 2 * right.u


def test_no_anchor_however_wild_ends_in_anything_but_an_alignment_or_one_line():
    rng, answered = np.random.default_rng(0), 0
    for _ in range(150):
        kind = rng.choice(["metric", "scaled", "affine", "disparity"])
        raw = RawDepth(
            np.ones((2, 2)), kind, "map", 0.3, float(10 ** rng.uniform(-6, 0)), float(rng.choice([0, 1e-3, 1]))
        )
        given = [
            Anchor(
                np.zeros(2), *(float(10**e) for e in rng.uniform(-6, 6, 3)), float(rng.choice([0.0, 0.01])), "anchor"
            )
            for _ in range(rng.integers(1, 6))
        ]
        try:
            found = aligned(raw, given)
        except InputError:
            continue
        answered += 1
        assert found.scale > 0 and np.isfinite([found.u_scale, found.u_offset, found.offset, found.u_local]).all()
    assert answered > 50


def test_a_map_of_metres_that_anchors_make_three_times_as_long_is_doubted(picture, tmp_path):
    said = DepthTexts(written(tmp_path / "map.npy", wall()), unit="1 m", error="1 %")
    found = document(picture, said, points=["120,120"], anchors=["100,100 = depth 7.5 m"])
    assert "anchor_unlikely" in codes(found)
    assert depth_of(found).value == pytest.approx(7.8, rel=0.01)


def test_a_range_and_a_size_anchor_like_a_depth(picture, tmp_path):
    said = DepthTexts(written(tmp_path / "map.npy", 3 * wall()), gives="scaled", error="1 %")
    slant = math.sqrt(1 + (59.5 / F) ** 2 + (19.5 / F) ** 2)
    by_range = document(picture, said, points=["160,120"], anchors=[f"100,100 = {2.5 * slant:.5f} m"])
    size = 40 / F * 2.5
    by_size = document(picture, said, points=["160,120"], anchors=[f"100,80;100,120 = {1000 * size:.3f} mm"])
    assert depth_of(by_range).value == pytest.approx(2.8, rel=0.005)
    m = depth_of(by_size)  # a thing may be turned by 20 degrees, so it is nearer than it looks
    assert m.low < 2.8 < m.high and m.value == pytest.approx(2.8, rel=0.03)
    assert depth_of(by_size).u > depth_of(by_range).u


def test_points_on_the_ground_anchor_the_map(picture, tmp_path):
    """A level camera 1.2 m above a plane: depth = 1.2 f / (y - horizon)."""
    y = np.arange(HEIGHT)[:, None] - (HEIGHT - 1) / 2
    depth = np.where(y > 15, 1.2 * F / np.maximum(y, 1e-9), 30.0) + 0 * np.arange(WIDTH)
    said = DepthTexts(written(tmp_path / "map.npy", 0.4 * depth), gives="scaled", error="1 %")
    ground = GroundTexts(height="1.2 ± 0.02 m", pitch="0 ± 0.2 deg", roll="0 ± 0.2 deg", slope="0 ± 0.1 deg")
    found = document(picture, said, points=["200,180"], anchors=["100,200 = ground", "200,220 = ground"], ground=ground)
    truth = 1.2 * F / (180 - 119.5)
    m = depth_of(found)
    assert m.low < truth < m.high and m.value == pytest.approx(truth, rel=0.02)


@pytest.fixture(scope="module")
def desk(examples, truth):
    """The desk's picture, and depths of its plane by the true camera."""
    told = truth["desk.jpg"]["camera"]
    pose = truth["desk.jpg"]["camera_from_world"]
    camera = Camera(
        1600,
        1200,
        told["f_px"],
        told["cx_px"],
        told["cy_px"],
        lens="brown_conrady",
        distortion=np.array(told["distortion"]),
    )
    x, y = np.meshgrid(np.arange(1600.0), np.arange(1200.0))
    rays = camera.rays(np.stack([x, y], -1))
    normal, through = np.array(pose["rotation"])[:, 2], np.array(pose["translation_m"])
    scale = (normal @ through) / (rays @ normal)
    return Photo.load(examples / "desk.jpg"), np.where(scale > 0, scale * rays[..., 2], np.nan)


@pytest.mark.parametrize("by", ["markers = 50 mm", "a4"])
def test_what_is_found_in_the_picture_anchors_the_map(desk, tmp_path, by):
    photo, depth = desk
    said = DepthTexts(written(tmp_path / "map.npy", 0.37 * depth), gives="scaled", error="1 %")
    found = document(photo, said, points=["760,600", "300,900"], things=[by], camera=None)
    depths = [m for m in found.measurements if m.what == "depth"]
    for m, place in zip(depths, [(600, 760), (900, 300)], strict=True):
        assert m.low < depth[place] < m.high and abs(m.value / depth[place] - 1) < 0.03
    # one camera measured all markers, so many of them do not make its focal length better known
    assert depths[0].u / depths[0].value > 0.008


def test_a_person_who_is_found_and_taken_to_be_of_usual_height_anchors_and_says_so(examples, truth, tmp_path):
    photo = Photo.load(examples / "street.jpg")
    [person] = [thing for thing in truth["street.jpg"]["objects"] if thing["name"] == "person"]
    depth = np.mean([point["depth_m"] for point in person["points"]])
    numbers = 3.0 * np.where(np.indices((1200, 1800))[1] < 900, depth, 1.5 * depth)
    said = DepthTexts(written(tmp_path / "map.npy", numbers), gives="scaled", error="2 %")
    told = document(photo, said, points=["1200,600"], things=["person"], camera=None)
    guessed = document(photo, said, points=["1200,600"], things=["objects"], camera=None)
    for found in (told, guessed):
        m = depth_of(found)
        assert m.low < 1.5 * depth < m.high and m.u / m.value > 0.03
    assert "assumed_size" in codes(guessed) and "assumed_size" not in codes(told)


# -- the whole map, and the method -------------------------------------------------------------------


def test_the_map_in_metres_agrees_with_what_is_measured_in_it(picture, tmp_path):
    path, truth = relative_network(tmp_path)
    places = [(20, 20), (90, 60), (160, 120), (200, 40), (250, 200), (300, 220)]
    typed = [f"{x},{y} = depth {truth(x, y):.5f} m ± 0.2 %" for x, y in places]
    found, map_ = depth_document(picture, DepthTexts(model=path), Wanted(["90,200"]), anchors=typed, camera=CAMERA)
    made = depth_map_of(map_)
    m = depth_of(found)
    assert made.depth_m[200, 90] == pytest.approx(m.value, rel=1e-4)
    z, sigma = made.depth_m[200, 90], made.sigma_m[200, 90]
    assert z + 1.9 * sigma < m.high < z + 4 * sigma and z - 3 * sigma < m.low < z - 1.4 * sigma
    assert made.camera.width_px == WIDTH and made.answered.all()


def test_files_of_the_map_are_written(picture, tmp_path):
    path = written(tmp_path / "map.npy", wall())
    files = {
        "--depth-map": "out.png",
        "--sigma-map": "sigma.npy",
        "--depth-picture": "shown.png",
        "--cloud": "points.ply",
    }
    words = [w for option, name in files.items() for w in (option, str(tmp_path / name))]
    result = CliRunner().invoke(
        main, ["depth", str(picture.path), "--camera", CAMERA, "--depth", str(path), "--depth-error", "1 %", *words]
    )
    assert result.exit_code == 0, result.output
    assert np.asarray(Image.open(tmp_path / "out.png"))[120, 100] == 2500
    assert np.load(tmp_path / "sigma.npy")[120, 100] == pytest.approx(2.5 * 0.01 / 1.96, rel=0.01)
    assert all((tmp_path / name).stat().st_size > 300 for name in files.values())


def test_command_and_json(picture, tmp_path):
    path = written(tmp_path / "map.npy", wall())
    words = [
        "depth",
        str(picture.path),
        "--camera",
        CAMERA,
        "--depth",
        str(path),
        "--depth-error",
        "1 %",
        "--point",
        "100,120",
    ]
    result = CliRunner().invoke(main, [*words, "--between", "60,60;200,60", "--format", "json"], catch_exceptions=False)
    told = json.loads(result.output)
    assert [m["what"] for m in told["measurements"]] == ["range", "depth", "length", "depth_difference"]
    ends = np.array([[60, 60, 1], [200, 60, 1.0]]) @ np.array(
        [[1 / F, 0, 0], [0, 1 / F, 0], [-159.5 / F, -119.5 / F, 1]]
    )
    ends *= np.array([[2.3], [3.0]])
    assert told["measurements"][2]["value"] == pytest.approx(np.linalg.norm(ends[1] - ends[0]), rel=1e-3)
    table = CliRunner().invoke(main, ["depth-models", "metric3d"]).output
    assert "hf download onnx-community/metric3d-vit-small" in table and "35 %" in table


def test_a_place_beyond_what_disparity_can_tell_has_an_open_interval():
    camera = Camera(WIDTH, HEIGHT, F, 159.5, 119.5)
    inputs = depth_map.Inputs(
        camera, Observation(np.array([[100.0, 100.0]]), 0.1), Quantity.normal(0.02, 0.03, "1"), space="disparity"
    )
    range_m = propagate.measure(depth_map.METHOD, inputs)[0]
    assert range_m.high is None and "open_interval" in {note.code for note in range_m.notes}
    with pytest.raises(GeometryError):
        propagate.measure(depth_map.METHOD, replace(inputs, map_value=Quantity.exact(-0.01)))
    with pytest.raises(InputError, match="give depth or disparity"):
        replace(inputs, space="inverse")


def test_a_panorama_has_no_depth_by_a_network(picture, tmp_path):
    from subtense.detectors.learned_depth import onnx_depth

    path = gray_network(tmp_path / "net.onnx", 1.0, 1.0)
    with pytest.raises(InputError, match="perspective"):
        onnx_depth(picture, depth_models()["zoedepth"], path, Camera(WIDTH, HEIGHT, F, 1, 1, lens="equirectangular"))


# -- real maps with truth ----------------------------------------------------------------------------


def rgbd(shared_data, number):
    folder = shared_data / "metric_depth" / "rgbd_sequence"
    return Photo.load(folder / f"0000{number}.jpg"), folder / f"0000{number}.png"


def poses(shared_data):
    rows = (shared_data / "metric_depth" / "rgbd_sequence" / "trajectory.log").read_text().split("\n")
    return [np.array([[float(w) for w in row.split()] for row in rows[5 * i + 1 : 5 * i + 5]]) for i in range(5)]


def test_a_depth_camera_s_map_places_points_where_the_next_frame_sees_them(shared_data):
    """The pose between two frames is known: a point placed by one map is as deep in the other as that one says."""
    (first, one), (second, two) = rgbd(shared_data, 0), rgbd(shared_data, 4)
    world = poses(shared_data)
    step = np.linalg.inv(world[4]) @ world[0]
    camera = "f=525px"
    said = DepthTexts(one, unit="1 mm", error="1 %")
    map_ = depth_map_of(anchored(first, said, camera=camera))
    places = map_.points_m()
    grid = [(x, y) for x in range(80, 600, 60) for y in range(60, 440, 50)]
    inside = total = 0
    other = depth_map_of(anchored(second, DepthTexts(two, unit="1 mm", error="1 %"), camera=camera))
    for x, y in grid:
        there = step[:3, :3] @ places[y, x] + step[:3, 3]
        if not np.isfinite(there).all():
            continue
        u, v = map_.camera.project(there[None])[0]
        if not (5 < u < 634 and 5 < v < 474):
            continue
        near = other.depth_m[round(v) - 2 : round(v) + 3, round(u) - 2 : round(u) + 3]
        if np.ptp(near) > 0.05 or not np.isfinite(near).all():
            continue
        m = (
            depth_of(
                document(second, DepthTexts(two, unit="1 mm", error="1 %"), points=[f"{u:.3f},{v:.3f}"], camera=camera)
            )
            if total < 8
            else None
        )
        low, high = (
            (m.low, m.high)
            if m
            else np.array([-1.96, 1.96]) * other.sigma_m[round(v), round(u)] + other.depth_m[round(v), round(u)]
        )
        inside += low <= there[2] <= high
        total += 1
    assert total > 30 and inside / total > 0.9, f"{inside} of {total}"


MAPS = {
    "nyu": ("rgb_00000.jpg", "sync_depth_00000.png", "1 mm", "f=518.9px"),
    "kitti": ("0000000005.png", "0000000005_depth.png", "1/256 m", "f=707px"),
    "rgbd_sequence": ("00000.jpg", "00000.png", "1 mm", "f=525px"),
}


@pytest.mark.parametrize("kind", ["affine", "disparity"])
def test_distorted_copies_of_true_maps_are_recovered(shared_data, tmp_path, kind):
    """Scale, shift and 3 % of noise are put on sensors' maps; six places are told to 1 %, and all others are looked at."""
    held, path, slack = [], tmp_path / "map.npy", f"{3 * 2**0.5} % (1s)"
    for name, (picture, file, unit, camera) in MAPS.items():
        folder = shared_data / "metric_depth" / name
        photo, stored = Photo.load(folder / picture), np.asarray(Image.open(folder / file), float)
        metres = np.where(stored > 0, stored * (1 / 256 if "256" in unit else 0.001), np.nan)
        rows, columns = np.nonzero(smooth(metres))
        truth = metres[rows, columns]
        for seed in range(4):
            rng = np.random.default_rng(seed)
            noisy = metres * (1 + 0.03 * rng.standard_normal(metres.shape))
            np.save(path, 0.3 * noisy + 1.1 if kind == "affine" else 12 / noisy + 2)
            some = rng.permutation(len(rows))[:36]
            some = some[np.argsort(truth[some])][[0, 7, 14, 21, 28, 35]]
            known = truth[some] * (1 + 0.01 * rng.standard_normal(6))
            told = zip(columns[some], rows[some], known, strict=True)
            typed = [f"{x},{y} = depth {z:.4f} m ± 1 % (1s)" for x, y, z in told]
            found = anchored(photo, DepthTexts(path, gives=kind, error=slack), typed, camera=camera)
            made, reach = depth_map_of(found), 1.96
            depth, sigma, true = made.depth_m[rows, columns], made.sigma_m[rows, columns], truth
            if kind == "disparity":
                depth, sigma, true = 1 / depth, sigma / depth**2, 1 / truth
            held.append(np.mean(np.abs(depth - true) <= reach * sigma))
            assert np.median(sigma / depth) < 0.06
    assert np.mean(held) >= 0.94, held


def test_a_sensor_s_map_reads_as_its_data_set_says(shared_data):
    for name, (picture, file, unit, camera) in MAPS.items():
        folder = shared_data / "metric_depth" / name
        stored = np.asarray(Image.open(folder / file), float)
        told = json.loads((folder / "truth.json").read_text())["depth_scale"]
        rows, columns = np.nonzero(smooth(np.where(stored > 0, stored, np.nan)))
        i = len(rows) // 2
        said = DepthTexts(folder / file, unit=unit, error="1 %")
        m = depth_of(document(Photo.load(folder / picture), said, points=[f"{columns[i]},{rows[i]}"], camera=camera))
        assert m.value == pytest.approx(stored[rows[i], columns[i]] / told, rel=1e-6)


def smooth(metres):
    """Where a map has numbers all about a place that differ little."""
    ok = np.isfinite(metres)
    same = ok.copy()
    for shift in ((0, 1), (1, 0), (0, -1), (-1, 0), (1, 1), (-1, -1)):
        moved = np.roll(metres, shift, (0, 1))
        same &= np.isfinite(moved) & (np.abs(moved / metres - 1) < 0.02)
    same[:10], same[-10:], same[:, :10], same[:, -10:] = False, False, False, False
    return same
