"""The tables of all ways: to add one, write its file and add its line here (camera sources stand in
resolve_camera, reports in report_of)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from ..detectors import markers
from ..method import Method
from ..methods import calculator, known_distance, known_size, pose, same_plane
from ..observation import Observation
from .report_of import REPORTS
from .resolve_camera import CAMERA_SOURCES

METHODS: dict[str, Method] = {
    m.name: m for m in (calculator.METHOD, known_size.METHOD, known_distance.METHOD, same_plane.METHOD, pose.METHOD)
}
"""Ways to measure, by name."""


@dataclass(frozen=True)
class Detector:
    """One way to see targets in a photo by themselves.

    Attributes:
        name: the key in DETECTORS.
        title: what a button says.
        function: Photo, and a callable that takes the share done (0 to 1), to Observations.
        method: the key of METHODS that measures what it finds.
        field: the field of that method's Inputs that an Observation goes into.
        target: the shape of what it finds, as `Target.parse` takes it in front of a size.
        asks: what a person must say to have it measured.
    """

    name: str
    title: str
    function: Callable[..., tuple[Observation, ...]]
    method: str
    field: str
    target: str
    asks: str


DETECTORS: dict[str, Detector] = {
    d.name: d
    for d in (
        Detector("markers", "ArUco and AprilTag markers", markers.markers, "pose", "points", "square",
                 "side of the markers' black square"),
    )
}  # fmt: skip
"""Ways to see targets in a photo by themselves, by name."""


__all__ = ["CAMERA_SOURCES", "DETECTORS", "METHODS", "REPORTS"]
