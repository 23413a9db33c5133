"""How far the ends of people and boxes found by networks lie from the truth, and how often the distance holds it.

The constants of detectors/objects.py come from here. The pictures lie outside the repository:

- `--video vtest.avi` of OpenCV's sample data: PETS 2009, view 1, people who walk before a fixed camera 7 m above the ground.
  The truth of head and sole is where the difference to the empty scene passes half its strength; that of the distance, the
  sole on the ground plane by the published calibration (Tsai) of that camera. Both halves are printed by themselves.
- `--data ../shared/data`: labelled boxes and distances of KITTI, and pairs of a drive, from which nothing is learned.
- `--indoors FOLDER` of stereo pairs NAME_left.png, NAME_right.png with stereodemo_calibration.json: chairs by stereo.
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from subtense import Camera, Photo, propagate
from subtense.assumptions import unknown_tilt
from subtense.detection import Detection
from subtense.detectors import objects as detector
from subtense.detectors.objects import objects
from subtense.metadata import Metadata
from subtense.methods import known_size
from subtense.networks.body import body_in
from subtense.networks.kinds import PERSON
from subtense.networks.stance import cut_by_border, hidden, posture
from subtense.networks.things import things

Row = tuple[float, ...]
F_MM, SX, DPX_MM, DPY_MM, K1_MM2 = 5.5549183034, 1.0937855397, 5.1273271277e-3, 4.65e-3, 5.1113043639e-3
CX_PX, CY_PX = 324.22149053, 282.56650051
TURN_RAD, MOVE_M = (2.0405458695, -0.8933770375, -0.4305612479), np.array([0.82873214225, -3.1754796051, 35.469298547])
OCCLUDERS = ((405, 442, 0, 400), (462, 525, 330, 576))
"""The lamp post and the tripod: left, right, top, bottom px."""


def pets_camera() -> Camera:
    """The camera of the video; Tsai's distortion, from the picture outwards, as the first term of its inverse."""
    f = F_MM * SX / DPX_MM
    return Camera(768, 576, f, CX_PX, CY_PX, aspect=F_MM / DPY_MM / f, lens="brown_conrady",
                  distortion=np.array([-K1_MM2 * F_MM**2, 0, 0, 0, 0]),
                  cov=np.diag([(0.005 * f) ** 2, 0, 4, 4, 0, 0, 0, 0, 0]))  # fmt: skip


def camera_from_world() -> np.ndarray:
    """(3, 3) rotation, x then y then z."""
    (a, b, c), eye = TURN_RAD, np.eye(3)
    turns = []
    for axis, angle in enumerate((a, b, c)):
        i, j = [k for k in range(3) if k != axis]
        turn = eye.copy()
        sign = -1 if axis == 1 else 1
        turn[i, i] = turn[j, j] = math.cos(angle)
        turn[i, j], turn[j, i] = -sign * math.sin(angle), sign * math.sin(angle)
        turns.append(turn)
    return turns[2] @ turns[1] @ turns[0]


def on_ground(point_px: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The camera's place and the point of the ground plane seen at a pixel, m."""
    rotation = camera_from_world()
    place = -rotation.T @ MOVE_M
    x, y = (point_px[0] - CX_PX) * DPX_MM / SX, (point_px[1] - CY_PX) * DPY_MM
    grow = (1 + K1_MM2 * (x * x + y * y)) / F_MM
    direction = rotation.T @ np.array([x * grow, y * grow, 1.0])
    return place, place - direction * place[2] / direction[2]


# -- truth of the video ------------------------------------------------------------------------------


def frames(video: Path, every: int) -> tuple[np.ndarray, np.ndarray]:
    """(N, H, W, 3) frames and the empty scene, RGB."""
    reader, kept = cv2.VideoCapture(str(video)), []
    while (read := reader.read())[0]:
        kept.append(read[1][..., ::-1])
    every_frame = np.array(kept)
    return every_frame[::every], np.median(every_frame[::8], axis=0)


def walkers(frame: np.ndarray, empty: np.ndarray) -> Iterator[np.ndarray]:
    """Boxes (left, top, right, bottom) of people who walk alone, wholly seen."""
    height, width = frame.shape[:2]
    change = np.abs(frame.astype(float) - empty).max(axis=2)
    mask = cv2.morphologyEx(
        (cv2.GaussianBlur(change, (3, 3), 0.7) > 28).astype(np.uint8), cv2.MORPH_CLOSE, np.ones((7, 3), np.uint8)
    )
    _, parts, stats, _ = cv2.connectedComponentsWithStats(mask)
    for number, (x, y, w, h, area) in enumerate(stats[1:], 1):
        if (
            not (55 < h < 230 and 2.0 < h / w < 4.6 and area > 0.28 * w * h)
            or min(x, y) < 4
            or x + w > width - 4
            or y + h > height - 4
        ):
            continue
        if any(
            x - 6 < right and x + w + 6 > left and y < below and y + h > above
            for left, right, above, below in OCCLUDERS
        ):
            continue
        close = [k for k in range(1, len(stats)) if k != number and stats[k, 4] > 15
                 and stats[k, 0] < x + w + 8 and stats[k, 0] + stats[k, 2] > x - 8
                 and stats[k, 1] < y + h + 25 and stats[k, 1] + stats[k, 3] > y - 25]  # fmt: skip
        if not close:
            strength = np.where(parts[:, x : x + w] == number, change[:, x : x + w], 0)
            top, bottom = half_strength(strength[y - 2 : y + h + 2])
            yield np.array([x - 0.5, y - 2 + top, x + w - 0.5, y - 2 + bottom])


def half_strength(change: np.ndarray) -> tuple[float, float]:
    """Rows where the strongest change of a row first and last passes half of that a little inside."""
    rows = np.sort(change, axis=1)[:, -3:].mean(axis=1)

    def first(values: np.ndarray) -> float:
        level = np.median(values[4:12]) / 2
        i = int(np.argmax(values > level))
        return i - (values[i] - level) / max(values[i] - values[i - 1], 1e-9) if i else 0.0

    return float(first(rows)), float(len(rows) - 1 - first(rows[::-1]))


# -- comparison --------------------------------------------------------------------------------------


def scatter(title: str, shares: Sequence[float]) -> None:
    """Bias, robust sigma and 95th percentile of shares of the height."""
    x = np.asarray(shares)
    if len(x) < 3:
        print(f"  {title:34s} {len(x)} only: {np.round(x, 3)}")
        return
    bias = float(np.median(x))
    off = np.abs(x - bias)
    print(f"  {title:34s} n {len(x):4d}  bias {bias:+.4f}  sigma {1.4826 * np.median(off):.4f}  rms {np.sqrt((off**2).mean()):.4f}"
          f"  95 % within {np.percentile(off, 95):.4f}")  # fmt: skip


def distance(camera: Camera, seen: Detection, level: float = 0.95) -> Any:
    """Range and depth by the height of what it is taken to be."""
    assert seen.target is not None
    assert seen.target.size is not None
    return propagate.measure(
        known_size.METHOD, known_size.Inputs(camera, seen.seen, seen.target.size, unknown_tilt()), level=level
    )


def coverage(title: str, found: Sequence[tuple[Any, float]]) -> None:
    """How often intervals hold the truth, and errors over u."""
    if not found:
        print(f"  {title}: nothing found")
        return
    hold = np.mean([m.low <= truth <= m.high for m, truth in found])
    z = np.array([(m.value - truth) / m.u for m, truth in found])
    off = np.array([m.value / truth - 1 for m, truth in found])
    print(f"  {title:34s} n {len(found):4d}  hold {hold:.0%}  error {np.median(off):+.1%} (rms {np.sqrt((off**2).mean()):.1%})"
          f"  u {np.median([m.u / m.value for m, _ in found]):.1%}  error/u: mean {z.mean():+.2f}"
          f" rms {np.sqrt((z**2).mean()):.2f} worst {np.abs(z).max():.1f}")  # fmt: skip


def people(video: Path, every: int) -> None:
    """Edges, stances and distances of the video's people, its first half apart from its second."""
    pictures, empty = frames(video, every)
    camera, found = pets_camera(), []
    for number, picture in enumerate(pictures):
        photo = Photo(np.ascontiguousarray(picture), Metadata(), video, "0")
        boxes = [one for one in things(photo.pixels) if one.label == "Person"]
        truths = [truth for truth in walkers(picture, empty) if not two_people(truth, boxes)]
        detections = [one for one in objects(photo) if one.label == PERSON.name]
        found += [(number / len(pictures), truth, *nearest(photo, truth, boxes, detections)) for truth in truths]
    for title, low, high in (("first half", 0.0, 0.5), ("second half", 0.5, 1.0), ("all", 0.0, 1.0)):
        part = [one for one in found if low <= one[0] < high]
        report_people(title, part, camera)
    small = [one for one in found if one[1][3] - one[1][1] < 90]
    report_people("lower than 90 px", small, camera)
    report_people("higher", [one for one in found if one[1][3] - one[1][1] >= 90], camera)


def two_people(truth: np.ndarray, boxes: Sequence[Any]) -> bool:
    """Whether what changed is of two people, one behind the other: the middles of two boxes lie in it."""
    middles = np.reshape([(one.box_px[:2] + one.box_px[2:]) / 2 for one in boxes], (-1, 2))
    inside = middles[np.all((middles > truth[:2]) & (middles < truth[2:]), axis=1), 1]
    return len(inside) > 1 and float(np.ptp(inside)) > 0.15 * (truth[3] - truth[1])


def nearest(photo: Photo, truth: np.ndarray, boxes: Sequence[Any], detections: Sequence[Detection]) -> tuple[Any, ...]:
    """The box of a person, its body, and the detection; None where there is none."""
    height = truth[3] - truth[1]
    box = min(boxes, key=lambda one: np.abs(one.box_px - truth).max(), default=None)
    if box is not None and np.abs(box.box_px - truth).max() > 0.3 * height:
        box = None
    middle = (truth[[0, 1]] + truth[[2, 3]]) / 2
    near = [one for one in detections if np.hypot(*(one.seen.points_px.mean(axis=0) - middle)) < 0.2 * height]
    return box, None if box is None else body_in(photo.pixels, box.box_px), near[0] if near else None


def report_people(title: str, found: Sequence[tuple[Any, ...]], camera: Camera) -> None:
    """One part of the video."""
    print(f"people, {title}: {len(found)} in the truth, {np.mean([f[2] is not None for f in found]):.0%} have a box, "
          f"{np.mean([f[4] is not None and f[4].target is not None for f in found]):.0%} are measured")  # fmt: skip
    bodies = [(truth, body) for _, truth, _, body, _ in found if body is not None]
    for why, test in (("border", lambda b: cut_by_border(b, 768, 576)), ("posture", posture), ("hidden", hidden)):
        print(f"  refused by {why}: {np.mean([bool(test(body)) for _, body in bodies]):.0%}", end="")
    print()
    good = [(t, b) for t, b in bodies if b.score > 0.8 and not (posture(b) or hidden(b))]
    scatter("head of the pixels", [(b.top_px - t[1]) / (t[3] - t[1]) for t, b in good])
    scatter("sole of the pixels", [(b.bottom_px - t[3]) / (t[3] - t[1]) for t, b in good])
    scatter("upper edge of the box", [(f[2].box_px[1] - f[1][1]) / (f[1][3] - f[1][1]) for f in found if f[2]])
    scatter("lower edge of the box", [(f[2].box_px[3] - f[1][3]) / (f[1][3] - f[1][1]) for f in found if f[2]])
    measured = [(truth, seen) for _, truth, _, _, seen in found if seen is not None and seen.target is not None]
    for end, row in (("head", 0), ("sole", 1)):
        z = [
            (s.seen.points_px[row, 1] - t[1 + 2 * row]) / np.broadcast_to(s.seen.sigma_px, 2)[row] for t, s in measured
        ]
        print(
            f"  {end} as detected, error/sigma: mean {np.mean(z):+.2f} rms {np.sqrt(np.mean(np.square(z))):.2f} worst {np.abs(z).max():.1f}"
        )
    pairs = []
    for truth, seen in measured:
        place, foot = on_ground(np.array([(truth[0] + truth[2]) / 2, truth[3] - 0.02 * (truth[3] - truth[1])]))
        pairs.append((distance(camera, seen)[0], float(np.linalg.norm(foot + np.array([0, 0, 0.85]) - place))))
    coverage("range", pairs)


# -- vehicles ----------------------------------------------------------------------------------------


def kitti(data: Path) -> Iterator[tuple[Photo, Camera, list[list[str]]]]:
    """Labelled pictures."""
    known = data / "known_size" / "kitti"
    jobs = [
        (known / "image_2" / f"{n}.png", known / "calib" / f"{n}.txt", known / "label_2" / f"{n}.txt")
        for n in ("000000", "000001", "000002")
    ]
    lidar = data / "ground_plane" / "kitti_lidar"
    jobs.append((lidar / "000008.png", lidar / "000008_P2.txt", lidar / "000008_label.txt"))
    for picture, calibration, labels in jobs:
        lines = calibration.read_text().splitlines()
        numbers = next((line.removeprefix("P2:") for line in lines if line.startswith("P2:")), lines[0]).split()
        f, cx, cy = float(numbers[0]), float(numbers[2]), float(numbers[6])
        photo = Photo.load(picture)
        camera = Camera(photo.width_px, photo.height_px, f, cx, cy, cov=np.diag([(0.003 * f) ** 2, 0, 1, 1]))
        yield photo, camera, [line.split() for line in labels.read_text().splitlines()]


def near_depth(label: Sequence[str]) -> float:
    """Depth of the nearest corner of a labelled box, m."""
    _, w, length, _, _, z, turn = map(float, label[8:15])
    return min(z - math.sin(turn) * a * length / 2 + math.cos(turn) * b * w / 2 for a in (-1, 1) for b in (-1, 1))


def vehicles(data: Path) -> None:
    """Boxes and depths of labelled vehicles and people."""
    edges: dict[str, list[float]] = {"upper": [], "lower": [], "left": [], "right": []}
    pairs, pedestrians = [], []
    for photo, camera, labels in kitti(data):
        for seen in objects(photo):
            points = seen.seen.points_px
            height = float(points[1, 1] - points[0, 1])
            named = [(one, np.array(one[4:8], float)) for one in labels if one[0] != "DontCare"]
            near = [(one, box) for one, box in named
                    if abs((box[1] + box[3]) / 2 - points[:, 1].mean()) < 0.25 * height
                    and box[0] - 0.1 * height < points[0, 0] < box[2] + 0.1 * height
                    and 0.6 < (box[3] - box[1]) / height < 1.6]  # fmt: skip
            if not near or float(near[0][0][1]) > 0.1 or seen.target is None:
                continue
            label, box = near[0]
            measured = distance(camera, seen)[1]
            print(f"  {photo.name} {label[0]} {box[3] - box[1]:.0f} px high as {seen.label}: {measured.value:.1f} m "
                  f"({measured.low:.1f} to {measured.high:.1f}), labelled {near_depth(label):.1f}"
                  f" (near end) to {label[13]} m (middle)")  # fmt: skip
            if seen.label == PERSON.name:
                pedestrians.append((measured, float(label[13])))
                continue
            edges["upper"].append((points[0, 1] - box[1]) / (box[3] - box[1]))
            edges["lower"].append((points[1, 1] - box[3]) / (box[3] - box[1]))
            pairs.append((measured, near_depth(label)))
    for side in ("upper", "lower"):
        scatter(f"{side} edge of a vehicle's box", edges[side])
    coverage("depth of the vehicles' near end", pairs)
    coverage("depth of the people", pedestrians)


def by_stereo(left: np.ndarray, right: np.ndarray, f_px: float, baseline_m: float) -> np.ndarray:
    """Depth of each pixel, m; NaN where the pair does not match."""
    matcher = cv2.StereoSGBM_create(
        0, 128, 5, 200, 800, disp12MaxDiff=1, uniquenessRatio=10, speckleWindowSize=100, speckleRange=2
    )
    shift = matcher.compute(left, right).astype(float) / 16
    return np.where(shift > 0.5, f_px * baseline_m / np.maximum(shift, 0.5), np.nan)


def held_out(title: str, pairs: Iterator[tuple[str, Path, Path, float, float, float, float]], share: float) -> None:
    """Depths by usual heights against stereo: the given share of the depths in the middle of the thing are nearer."""
    found = []
    for name, left, right, f, cx, cy, baseline in pairs:
        photo = Photo.load(left)
        depth = by_stereo(cv2.imread(str(left), 0), cv2.imread(str(right), 0), f, baseline)
        camera = Camera(photo.width_px, photo.height_px, f, cx, cy, cov=np.diag([(0.003 * f) ** 2, 0, 1, 1]))
        for seen in objects(photo):
            if seen.target is None:
                continue
            (x, top), (_, bottom) = seen.seen.points_px
            height = bottom - top
            part = depth[
                int(top + 0.35 * height) : int(top + 0.8 * height),
                int(max(x - 0.3 * height, 0)) : int(x + 0.3 * height),
            ]
            if np.isfinite(part).mean() < 0.2:
                continue
            truth, measured = float(np.nanpercentile(part, 100 * share)), distance(camera, seen)[1]
            print(
                f"  {name} {seen.label} {height:.0f} px: {measured.value:.2f} m ({measured.low:.2f} to {measured.high:.2f}),"
                f" by stereo {truth:.2f} m"
            )
            found.append((measured, truth))
    coverage(title, found)


def kitti_pairs(data: Path) -> Iterator[tuple[str, Path, Path, float, float, float, float]]:
    """A drive, one pair in about 1.2 m."""
    folder = data / "stereo" / "kitti_vo_seq1"
    lines = [line.split() for line in (folder / "calib.txt").read_text().splitlines()]
    f, cx, cy = (float(lines[0][-12:][k]) for k in (0, 2, 6))
    for left in sorted((folder / "image_l").glob("*.png")):
        yield left.name, left, folder / "image_r" / left.name, f, cx, cy, 379.81 / 707.09


def indoor_pairs(folder: Path) -> Iterator[tuple[str, Path, Path, float, float, float, float]]:
    """Rooms."""
    said = json.loads((folder / "stereodemo_calibration.json").read_text())
    for left in sorted(folder.glob("*_left.png")):
        right = left.with_name(left.name.replace("_left", "_right"))
        yield left.name, left, right, said["fx"], said["cx0"], said["cy"], said["baseline_meters"]


def main() -> None:
    """Print all that the options give pictures for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--video", type=Path)
    parser.add_argument("--every", type=int, default=6, help="frames between those used")
    parser.add_argument("--data", type=Path, default=Path(__file__).parent.parent.parent / "shared" / "data")
    parser.add_argument("--indoors", type=Path)
    given = parser.parse_args()
    print({k: v for k, v in vars(detector).items() if k.endswith(("_BIAS", "_SIGMA"))})
    if given.video:
        people(given.video, given.every)
    if given.data.is_dir():
        print("labelled vehicles and people (KITTI)")
        vehicles(given.data)
        print("held out: a drive in stereo")
        held_out("depth of vehicles", kitti_pairs(given.data), 0.25)
    if given.indoors:
        print("held out: rooms in stereo")
        held_out("depth of things", indoor_pairs(given.indoors), 0.5)


if __name__ == "__main__":
    main()
