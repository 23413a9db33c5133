"""Outlines of drawn things with exact extents on textured grounds, and of real things of known size."""

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from subtense.cli import main
from subtense.detection import Search
from subtense.detectors.outline import outline
from subtense.errors import FileFormatError, InputError, NothingFoundError
from subtense.outline import EXTENTS
from subtense.photo import Metadata, Photo

pytestmark = pytest.mark.opencv
SIZE = 320


def encoded(light):
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * np.maximum(light, 1e-9) ** (1 / 2.4) - 0.055)


def rough(rng, colour, amplitude, grain):
    """A colour whose light varies over the picture."""
    import cv2

    spots = cv2.GaussianBlur(rng.normal(0, 1, (SIZE, SIZE)), (0, 0), grain)
    return np.array(colour) * np.exp(amplitude * spots / spots.std())[..., None]


def true_extents(rim):
    spans = {
        angle: np.ptp(rim @ [np.cos(angle), np.sin(angle)]) for angle in np.linspace(0, np.pi, 1800, endpoint=False)
    }
    across, down = np.ptp(rim, axis=0)
    return {"longest": max(spans.values()), "shortest": min(spans.values()), "width": across, "height": down}


def scene(kind, seed, blur=0.8, noise=2.0, amplitude=0.15):
    """A photo of an ellipse, a box or a blob, its middle, and its extents: drawn 3 times larger in linear light."""
    import cv2

    rng, scale = np.random.default_rng(seed), 3
    middle = SIZE / 2 + rng.uniform(-12, 12, 2)
    turn, a, b = rng.uniform(0, np.pi), rng.uniform(50, 85), rng.uniform(30, 45)
    t = np.linspace(0, 2 * np.pi, 4000, endpoint=False)
    if kind == "ellipse":
        rim = np.stack([a * np.cos(t), b * np.sin(t)], -1)
    elif kind == "box":
        rim = np.array([[-a, -b], [a, -b], [a, b], [-a, b]])
    else:
        r = 60 + 11 * np.cos(2 * t + 1) + 5 * np.sin(3 * t) + 3 * np.cos(5 * t)
        rim = np.stack([r * np.cos(t), r * np.sin(t)], -1)
    rim = rim @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]]) + middle
    inside = np.zeros((SIZE * scale, SIZE * scale), np.uint8)
    cv2.fillPoly(inside, [np.round(((rim + 0.5) * scale - 0.5) * 256).astype(np.int32)], 1, shift=8)
    ground = rough(rng, (0.5, 0.42, 0.3), amplitude, 3)
    thing = rough(rng, (0.08, 0.15, 0.4), amplitude, 5)
    ground, thing = (cv2.resize(one, (SIZE * scale, SIZE * scale)) for one in (ground, thing))
    light = cv2.GaussianBlur(np.where(inside[..., None] > 0, thing, ground), (0, 0), blur * scale)
    light = light.reshape(SIZE, scale, SIZE, scale, 3).mean(axis=(1, 3))
    value = 255 * encoded(np.clip(light, 0, 1)) + rng.normal(0, noise, light.shape)
    return photo_of(np.clip(np.round(value), 0, 255)), middle, true_extents(rim), rim


def photo_of(pixels):
    return Photo(np.asarray(pixels).astype(np.uint8), Metadata(), Path("drawn.png"), "0")


def length(seen):
    """Length between two ends, and its u by their covariance."""
    d = seen.points_px[1] - seen.points_px[0]
    size = np.hypot(*d)
    along = np.concatenate([-d, d]) / size
    return size, np.sqrt(along @ seen.cov @ along)


def around(rim, margin=8.0):
    return np.concatenate([rim.min(axis=0) - margin, rim.max(axis=0) + margin])


@pytest.mark.parametrize("kind", ["ellipse", "box", "blob"])
def test_extents_hold_the_truth(kind):
    """Normalised errors over seeds, from a point and from a box; u stays below 2 %."""
    z = []
    for seed in range(4):
        photo, middle, truth, rim = scene(kind, seed)
        for where in (middle,) if seed % 2 else (around(rim),):
            found = outline(photo, where)
            for name in EXTENTS:
                size, u = length(found.extents[name])
                z.append((size - truth[name]) / u)
                assert u < 0.02 * size
    assert np.max(np.abs(z)) < 3
    assert 0.2 < np.sqrt(np.mean(np.square(z))) < 1.3


@pytest.mark.parametrize("how", [{"amplitude": 0.45}, {"blur": 3.0}, {"noise": 12.0}])
def test_grainy_blurred_and_noisy_pictures_hold_the_truth(how):
    """Grain makes outlines off by up to 20 px, which is noted; blur and noise do not."""
    z, noted = [], 0
    for seed in range(2):
        for kind in ("ellipse", "box"):
            photo, _, truth, rim = scene(kind, seed, **how)
            found = outline(photo, around(rim))
            noted += "outline_ambiguous" in [note.code for note in found.notes]
            z += [(length(found.extents[name])[0] - truth[name]) / length(found.extents[name])[1] for name in EXTENTS]
    assert np.max(np.abs(z)) < 3
    assert np.sqrt(np.mean(np.square(z))) < 1.4
    assert noted >= 2 if "amplitude" in how else noted <= 1


def test_area_box_and_mask_belong_together():
    photo, _, _, rim = scene("box", 1)
    x, y = rim.T
    area = abs(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)) / 2
    found = outline(photo, around(rim))
    assert abs(found.area_px - area) < 3 * found.u_area_px + 4  # four rounded corners lose up to a pixel each
    assert found.mask.sum() == pytest.approx(area, rel=0.01)
    box = found.extents["box"]
    assert np.linalg.eigvalsh(box.cov).min() > 0
    away = np.hypot(*(box.points_px[:, None] - rim[None]).transpose(2, 0, 1)).min(axis=1)
    assert away.max() < 2.0


def test_the_same_is_found_again():
    photo, middle, *_ = scene("blob", 2)
    one, other = outline(photo, middle), outline(photo, middle)
    assert np.array_equal(one.contour.points_px, other.contour.points_px)


def test_what_is_cut_by_the_border_is_noted():
    photo, _, _, rim = scene("box", 3)
    edge = int(rim[:, 0].mean())
    cut = photo_of(photo.pixels[:, :edge])
    found = outline(cut, np.clip(around(rim), 0, [edge - 1, SIZE - 1, edge - 1, SIZE - 1]))
    assert "cut_by_border" in [note.code for note in found.notes]


def test_nothing_is_invented():
    noise = np.random.default_rng(0).integers(0, 255, (120, 120, 3))
    for pixels in (np.full((120, 120, 3), 128), np.zeros((120, 120, 3)), noise):
        with pytest.raises(NothingFoundError):
            outline(photo_of(pixels), np.array([60.0, 60.0]))
    with pytest.raises(NothingFoundError):
        outline(photo_of(np.full((120, 120, 3), 128)), np.array([20.0, 20.0, 90.0, 90.0]))
    with pytest.raises((NothingFoundError, InputError)):
        outline(photo_of(np.zeros((1, 1, 3))), np.array([0.0, 0.0]))


def test_wrong_places_are_refused():
    photo = photo_of(np.full((50, 60, 3), 90))
    for place in ([70, 5], [1, 1, 5, 5], [np.nan, 3], [1, 2, 3]):
        with pytest.raises(InputError):
            outline(photo, np.array(place, float))


def test_a_model_that_is_none_is_refused(tmp_path):
    file = tmp_path / "model.onnx"
    file.write_bytes(b"no network")
    with pytest.raises(FileFormatError):
        outline(photo_of(np.full((50, 60, 3), 90)), np.array([30.0, 30.0]), Search(model=file))


def measured(photo, tmp_path, *words):
    from PIL import Image

    file = tmp_path / "thing.png"
    Image.fromarray(photo.pixels).save(file)
    return CliRunner().invoke(main, ["measure", str(file), *words])


def test_the_command_measures_by_an_outline(tmp_path):
    photo, middle, truth, _ = scene("ellipse", 4)
    place, size = f"{middle[0]:.0f},{middle[1]:.0f}", f"{truth['longest']:.3f} mm"
    overlay = tmp_path / "over.png"
    told = measured(photo, tmp_path, "--outline", place, "--size", size, "--camera", "f=1000px", "--tilt", "0 ± 0.5 deg",
                    "--format", "csv", "--overlay", str(overlay))  # fmt: skip
    assert told.exit_code == 0, told.output
    assert (
        abs(float(told.output.splitlines()[2].split(",")[3]) - 1.0) < 0.02
    )  # depth: 1 mm a pixel at f = 1000 px is 1 m
    assert overlay.stat().st_size > 10_000


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--outline", "5"], "--size is missing"),
        (["--outline", "5", "--size", "1"], "give X,Y"),
        (["--outline", "9999,5", "--size", "1"], "must lie in it"),
        (["--outline", "150,150", "--size", "1", "--extent", "diagonal"], "longest, shortest, width, height"),
        (["--outline", "150,150", "--size", "1", "--line", "1,1,9,9"], "by themselves"),
    ],
)
def test_what_the_command_refuses_is_one_line(words, said, tmp_path):
    photo, *_ = scene("ellipse", 4)
    told = measured(photo, tmp_path, *words, "--camera", "f=1000px")
    assert told.exit_code == 2
    assert said in told.output
    assert len(told.output.strip().splitlines()) == 1


def test_coins_and_a_card_by_a_quarter_beside_them(shared_data):
    """Sizes from the extents by the mean of two quarters (24.26 mm), within the interval that all of them leave."""
    photo = Photo.load(shared_data / "reference_object" / "coins_card" / "example_01.png")
    quarters = [outline(photo, np.array(at)) for at in ([66.0, 213.0], [372.0, 206.0])]
    scales = [length(one.extents[name])[0] / 24.26 for one in quarters for name in ("longest", "shortest")]
    scale, u_scale = np.mean(scales), max(np.std(scales, ddof=1), 0.005 * np.mean(scales))
    things = (
        ([519.0, 227.0], "longest", 21.21),
        ([519.0, 227.0], "shortest", 21.21),
        ([165.0, 53.0, 370.0, 200.0], "shortest", 50.8),
    )
    for place, name, truth in things:
        size, u = length(outline(photo, np.array(place)).extents[name])
        relative = np.hypot(u / size, u_scale / scale)
        assert abs(size / scale - truth) < 2.5 * relative * truth, (name, size / scale, truth)
