"""Finding a point that was set in one picture of a scene in its other pictures."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path

import numpy as np

from ..arrays import Array
from ..errors import NothingFoundError
from ..observation import Observation
from ..photo import Photo
from ..quantity import Note
from ..scene import Scene
from ..views import Track

PATCH = 10
"""Pixels to each side of the point that are compared."""
SMALL_PATCH = 4
STEP_PX = 0.7
MOST_DEPTHS = 200
AGREE_PX = 1.5
"""How far apart the two sizes of patch may find a point before it is in doubt, to a pixel."""
REFINED_AGREE_PX = 1.0
"""The same, to a part of a pixel."""
NEIGHBOURS = 12
LEAST_LIKENESS = 0.75
"""Normalised correlation below which a picture does not show the point."""
UNIQUE = 0.08
"""How much more alike the best place must be than any other that is apart from it."""
MATCH_PX = 0.3
"""Standard deviation of a found place beside that of the point that was set."""
MOST_PICTURES = 5


class Finder:
    """Finds points of one picture in the others, by the depth of the scene around them and by their likeness."""

    def __init__(self, scene: Scene, photos: Mapping[str, Path]) -> None:
        self.scene, self.photos = scene, photos
        self.notes: list[Note] = []

    def found(self, track: Track) -> Track:
        """The track with the point in further pictures.

        Raises:
            NothingFoundError: no other picture shows it beyond doubt.
        """
        name, seen = track.names[0], track.seen.points_px[0]
        i = self.scene.names.index(name)
        depth, spread = self._depth_at(i, seen)
        names, points, slopes = [name], [seen], [np.eye(2)]
        for j in self._others(i):
            hit = self._match(i, seen, j, depth, spread)
            if hit is not None:
                names.append(self.scene.names[j])
                points.append(hit[0])
                slopes.append(hit[1])
        if len(names) < 2:
            raise NothingFoundError(f"{name}:{seen[0]:g},{seen[1]:g} is found in no other picture beyond doubt; set it in a second one: "
                                    "'a.jpg:120,80; b.jpg:95,82'", found=1, needed=2)  # fmt: skip
        places = "; ".join(f"{n}:{p[0]:.1f},{p[1]:.1f}" for n, p in zip(names[1:], points[1:], strict=True))
        text = (f"{track.seen.label} was found in other pictures by its looks ({places}); at the edge of a thing that may be what lies "
                "behind it")  # fmt: skip
        self.notes.append(Note("point_found", text, "look there, or set it in a second picture"))
        return Track(tuple(names), self._observation(track, np.array(points), slopes))

    def _observation(self, track: Track, points: Array, slopes: list[Array]) -> Observation:
        """What was set off moves along in all pictures; what each match adds is its own."""
        sigma = float(np.max(track.seen.standard_deviations))
        root = np.concatenate(slopes) * sigma
        own = np.repeat([0.0] + [MATCH_PX] * (len(points) - 1), 2)
        source = f"{track.seen.source}; found in {len(points) - 1} more pictures to {MATCH_PX:g} px"
        return Observation(points, sigma, root @ root.T + np.diag(own**2 + 1e-6), track.seen.label, source=source)

    def _depth_at(self, i: int, seen: Array) -> tuple[float, float]:
        """Depth of the scene's points around a pixel, and how far they scatter."""
        mine = self.scene.view == i
        apart = np.linalg.norm(self.scene.seen_px[mine] - seen, axis=1)
        near = np.argsort(apart)[:NEIGHBOURS]
        points = self.scene.points[self.scene.point[mine][near]]
        depths = ((points - self.scene.centre[i]) @ self.scene.rotation[i].T)[:, 2]
        depths = depths[depths > 0]
        if not len(depths):
            raise NothingFoundError(
                f"{self.scene.names[i]} sees nothing of the scene around {seen[0]:g},{seen[1]:g}", found=0, needed=1
            )
        return float(np.median(depths)), float(max(np.ptp(depths), 0.1 * np.median(depths)))

    def _others(self, i: int) -> list[int]:
        """The pictures that see most of what this one sees, nearest in direction first."""
        mine = np.zeros(len(self.scene.points), bool)
        mine[self.scene.point[self.scene.view == i]] = True
        shared = np.bincount(self.scene.view[mine[self.scene.point]], minlength=len(self.scene.names))
        shared[i] = 0
        return [int(j) for j in np.argsort(-shared)[:MOST_PICTURES] if shared[j] >= 5]

    def _match(self, i: int, seen: Array, j: int, depth: float, spread: float) -> tuple[Array, Array] | None:
        """Where another picture shows it, and how that place moves with the point; None if not beyond doubt.

        Two sizes of patch must agree: at the edge of a thing the larger one shows what is behind it, and the smaller one the thing.
        """
        ends = np.array([0.5 / (depth + spread), 2 / max(depth - 0.7 * spread, 0.2 * depth)])
        apart = float(
            np.linalg.norm(self._at(i, seen[None], j, 1 / ends[0])[0] - self._at(i, seen[None], j, 1 / ends[1])[0])
        )
        if not np.isfinite(apart):
            return None
        inverse = np.linspace(float(ends[0]), float(ends[1]), int(np.clip(apart / STEP_PX, 16, MOST_DEPTHS)))
        places = np.array([self._at(i, seen[None], j, 1 / w)[0] for w in inverse])
        best = [self._best(i, seen, j, inverse, places, half) for half in (PATCH, SMALL_PATCH)]
        if best[0] is None or best[1] is None or np.linalg.norm(places[best[0]] - places[best[1]]) > AGREE_PX:
            return None
        found = [self._refined(i, seen, j, 1 / inverse[best[0]], half) for half in (PATCH, SMALL_PATCH)]
        if found[0] is None or found[1] is None or np.linalg.norm(found[0][0] - found[1][0]) > REFINED_AGREE_PX:
            return None
        return found[0]

    def _best(self, i: int, seen: Array, j: int, inverse: Array, places: Array, half: int) -> int | None:
        """Which inverse depth looks most alike, if nothing apart from it looks nearly so; a small patch need not be unique."""
        want = self._patch(i, seen, np.eye(2), half)
        if want is None:
            return None
        scores = np.array([self._likeness(i, seen, j, 1 / w, want) for w in inverse])
        if not np.any(np.isfinite(scores)):
            return None
        best = int(np.nanargmax(scores))
        apart = np.linalg.norm(places - places[best], axis=1) > 3.0
        rival = float(np.max(np.nan_to_num(np.where(apart, scores, -1.0), nan=-1.0)))
        unique = UNIQUE if half == PATCH else 0.0
        return best if scores[best] >= LEAST_LIKENESS and scores[best] - rival >= unique else None

    def _at(self, i: int, points_px: Array, j: int, depth: float) -> Array:
        """(N, 2) where picture j shows pixels of picture i, were they at a depth."""
        s = self.scene
        ray = s.cameras[s.camera_of[i]].rays(points_px)
        world = (ray / ray[:, 2:] * depth) @ s.rotation[i] + s.centre[i]
        return np.asarray(s.cameras[s.camera_of[j]].project((world - s.centre[j]) @ s.rotation[j].T))

    def _slope(self, i: int, seen: Array, j: int, depth: float) -> tuple[Array, Array]:
        ends = self._at(i, seen + np.array([[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1.0]]), j, depth)
        return ends[0], np.stack([(ends[1] - ends[2]) / 2, (ends[3] - ends[4]) / 2], -1)

    def _likeness(self, i: int, seen: Array, j: int, depth: float, want: Array) -> float:
        place, slope = self._slope(i, seen, j, depth)
        return _correlation(want, self._patch(j, place, slope, len(want) // 2))

    def _refined(self, i: int, seen: Array, j: int, depth: float, half: int) -> tuple[Array, Array] | None:
        """To a part of a pixel, by Gauss-Newton steps on the difference of the patches, gain and offset free."""
        place, slope = self._slope(i, seen, j, depth)
        want = self._patch(i, seen, np.eye(2), half)
        start = place
        for _ in range(15):
            here = self._patch(j, place, slope, half)
            if here is None or want is None:
                return None
            dx, dy = (self._patch(j, place + step, slope, half) for step in (np.array([0.5, 0]), np.array([0, 0.5])))
            if dx is None or dy is None:
                return None
            a = np.stack([2 * (dx - here), 2 * (dy - here), here, np.ones_like(here)], -1).reshape(-1, 4)
            answer, *_ = np.linalg.lstsq(a, want.reshape(-1), rcond=None)
            gain = answer[2] if abs(answer[2]) > 0.2 else 1.0
            step = answer[:2] / gain
            place = place + np.clip(step, -1, 1)
            if np.linalg.norm(step) < 0.01:
                break
        likeness = _correlation(want, self._patch(j, place, slope, half))
        return (place, slope) if likeness >= LEAST_LIKENESS and np.linalg.norm(place - start) < 4 else None

    def _patch(self, i: int, place: Array, slope: Array, half: int) -> Array | None:
        """(2 half + 1, 2 half + 1) gray values around a place, on a grid that `slope` deforms; None at the picture's edge."""
        import cv2

        gray = _gray(self.photos[self.scene.names[i]])
        grid = np.arange(-half, half + 1, dtype=float)
        offset = np.stack(np.meshgrid(grid, grid), -1) @ slope.T + place
        if (
            not np.all(np.isfinite(offset))
            or offset.min() < 1
            or np.any(offset.reshape(-1, 2).max(0) > np.array(gray.shape[::-1]) - 2)
        ):
            return None
        found = cv2.remap(gray, offset[..., 0].astype(np.float32), offset[..., 1].astype(np.float32), cv2.INTER_CUBIC)
        return np.asarray(found, float)


@lru_cache(maxsize=12)
def _gray(path: Path) -> Array:
    photo = Photo.load(path, gray=True)
    return np.asarray(np.asarray(photo.pixels, np.float32).mean(axis=2))


def _correlation(a: Array | None, b: Array | None) -> float:
    if a is None or b is None:
        return float("nan")
    a, b = a - a.mean(), b - b.mean()
    size = float(np.sqrt(np.sum(a * a) * np.sum(b * b)))
    return float(np.sum(a * b)) / size if size > 1e-9 and np.std(a) > 2.0 else float("nan")
