"""Scenes of real pictures with known places of the cameras: lengths between them with their whole covariance."""

import itertools
import json

import numpy as np
import pytest

from subtense.methods.reconstruction import Settings
from subtense.quantity import Quantity
from subtense.scale import Known, scaled
from subtense.workflow.reconstruct import reconstructed
from subtense.workflow.reconstruct_input import read_positions
from subtense.workflow.reconstruct_measure import Asked, metric

pytest.importorskip("pycolmap")
pytestmark = pytest.mark.opencv

TRUTH_M = 0.002
"""Per coordinate of the fountain's truth: registered to a laser scan; programs of all makes differ from it by 2 to 3 mm."""


def scene_of(paths, camera, features):
    return reconstructed(paths, camera=camera, settings=Settings(most_features=features))


@pytest.fixture(scope="module")
def fountain(shared_data, tmp_path_factory):
    import cv2

    folder = tmp_path_factory.mktemp("fountain")
    source = shared_data / "sfm" / "fountain_P11"
    for path in sorted(source.glob("*.jpg")):
        small = cv2.resize(cv2.imread(str(path)), (768, 512), interpolation=cv2.INTER_AREA)
        cv2.imwrite(str(folder / path.name), small, [cv2.IMWRITE_JPEG_QUALITY, 95])
    scene = scene_of(sorted(folder.glob("*.jpg")), "f=690 ± 7 px", 1500)
    centres = json.loads((source / "truth.json").read_text())["centres"]
    return scene, {name: np.array(place) for name, place in centres.items()}


def compared(done, truth, truth_m):
    """Relative errors of all distances between cameras, and chi-square over freedom with the joint covariance of scene and truth."""
    views = done.scene.views()
    names = views.names
    pairs = list(itertools.combinations(range(len(names)), 2))
    slopes, errors, relative = np.zeros((len(pairs), len(views.covariance))), [], []
    by_truth, lengths = np.zeros((len(pairs), 3 * len(names))), []
    for row, (a, b) in enumerate(pairs):
        along, true = views.centre_m[a] - views.centre_m[b], truth[names[a]] - truth[names[b]]
        far, want = np.linalg.norm(along), np.linalg.norm(true)
        for sign, k in ((1, a), (-1, b)):
            slopes[row, 6 * k + 3 : 6 * k + 6] = sign * along / far
            by_truth[row, 3 * k : 3 * k + 3] = sign * true / want
        errors.append(far - want)
        relative.append(far / want - 1)
        lengths.append(far)
    cov = (
        slopes @ views.covariance @ slopes.T
        + np.outer(lengths, lengths) * views.u_scale**2
        + by_truth @ by_truth.T * truth_m**2
    )
    values, vectors = np.linalg.eigh(cov)
    free = values > 1e-6 * values[-1]
    along = (vectors[:, free].T @ np.array(errors)) / np.sqrt(values[free])
    return np.array(relative), float(along @ along), int(free.sum())


def quantile_99(freedom):
    spread = 2 / (9 * freedom)
    return freedom * (1 - spread + 2.326 * spread**0.5) ** 3


def test_the_fountain_by_one_distance(fountain):
    """Scaled by the distance of two named cameras, the other 14 are within 0.5 %, and within 99 % of chi-square together."""
    scene, truth = fountain
    a, b = scene.names[0], scene.names[-1]
    size = Quantity.normal(float(np.linalg.norm(truth[a] - truth[b])), TRUTH_M * 2**0.5, "m")
    relative, chi2, freedom = compared(scaled(scene, [Known("cameras", size, names=(a, b))]), truth, TRUTH_M)
    assert len(relative) == 15 and np.max(abs(relative)) < 0.005
    assert freedom >= 10 and chi2 < quantile_99(freedom)


def test_the_fountain_by_positions(fountain, tmp_path):
    """The same by positions of all its cameras but one."""
    scene, truth = fountain
    rows = ["name,x,y,z,u", *(f"{name},{','.join(map(str, truth[name]))},{TRUTH_M}" for name in scene.names[1:])]
    (tmp_path / "places.csv").write_text("\n".join(rows))
    assert set(read_positions(tmp_path / "places.csv").of) == set(scene.names[1:])
    done = metric(scene, {}, Asked(positions=tmp_path / "places.csv"))
    relative, chi2, freedom = compared(done, truth, TRUTH_M)
    assert np.max(abs(relative)) < 0.005 and chi2 < quantile_99(freedom)
    left_out = truth[scene.names[0]] - done.scene.centre[0] - done.scene.origin_m
    assert np.linalg.norm(left_out) < 0.015


def test_rendered_frames_with_exact_poses(shared_data):
    """Five frames 2 to 10 cm apart of a room 2 m deep: little parallax, exact truth."""
    folder = shared_data / "metric_depth" / "rgbd_sequence"
    scene = scene_of(sorted(folder.glob("*.jpg")), "f=525 ± 3 px", 3000)
    lines = (folder / "trajectory.log").read_text().splitlines()
    truth = {f"{i:05}.jpg": np.array([float(row.split()[3]) for row in lines[5 * i + 1 : 5 * i + 4]]) for i in range(5)}
    a, b = "00000.jpg", "00004.jpg"
    size = Quantity.normal(float(np.linalg.norm(truth[a] - truth[b])), 1e-5, "m")
    done = scaled(scene, [Known("cameras", size, names=(a, b))])
    relative, chi2, freedom = compared(done, truth, 1e-6)
    assert len(relative) == 10 and np.max(abs(relative)) < 0.05
    assert chi2 < quantile_99(freedom)
