"""The tables of all ways: to add one, write its file and add its line here (camera sources stand in
resolve_camera, reports in report_of)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from ..detection import Detection, Search
from ..detectors import circles, faces, markers, objects, qr_codes, sheets
from ..method import Method
from ..methods import (
    calculator,
    circle,
    depth_map,
    ground_footprint,
    ground_length,
    ground_plane,
    ground_sampling,
    ground_speed,
    height,
    known_distance,
    known_size,
    plane,
    plane_conditions,
    plane_distance,
    pose,
    same_plane,
    sphere,
    stereo,
    surveyed_ground,
    triangulation,
    wall,
)
from ..photo import Photo
from .report_of import REPORTS
from .resolve_camera import CAMERA_SOURCES

METHODS: dict[str, Method] = {
    m.name: m
    for m in (
        calculator.METHOD,
        known_size.METHOD,
        known_distance.METHOD,
        same_plane.METHOD,
        pose.METHOD,
        circle.METHOD,
        sphere.METHOD,
        ground_plane.METHOD,
        ground_length.METHOD,
        ground_speed.METHOD,
        ground_sampling.METHOD,
        ground_footprint.METHOD,
        surveyed_ground.METHOD,
        same_plane.DISTANCE,
        plane.METHOD,
        plane.AREA,
        plane.ANGLE,
        plane_distance.METHOD,
        plane_conditions.METHOD,
        plane_conditions.AREA,
        plane_conditions.ANGLE,
        height.METHOD,
        wall.METHOD,
        depth_map.METHOD,
        stereo.METHOD,
        stereo.LENGTH,
        triangulation.METHOD,
        triangulation.LENGTH,
        triangulation.CAMERAS,
    )
}
"""Ways to measure, by name."""


@dataclass(frozen=True)
class Detector:
    """One way to see things in a photo by themselves.

    Attributes:
        name: the key in DETECTORS.
        title: what a button says.
        function: from Photo and Search to Detections.
        groups: of data/targets.toml, whose things it can find; empty for what has no size of its own.
        asks: what a person must say to have it measured; empty where that is nothing.
        automatic: whether `subtense measure PHOTO` looks for it unasked.
        extra: of the package, that it needs; empty for none.
        reach: size in px down to which a photo was searched, from Photo, Search, and whether anything was found; None
            where all of it is searched alike.
    """

    name: str
    title: str
    function: Callable[[Photo, Search], tuple[Detection, ...]]
    groups: tuple[str, ...] = ()
    asks: str = ""
    automatic: bool = True
    extra: str = ""
    reach: Callable[[Photo, Search, bool], float] | None = None


DETECTORS: dict[str, Detector] = {
    d.name: d
    for d in (
        Detector(
            "markers",
            "ArUco and AprilTag markers",
            markers.markers,
            asks="side of the markers' black square",
            reach=markers.reach_px,
        ),
        Detector("qr_codes", "QR codes", qr_codes.qr_codes, asks="side of the code"),
        Detector("faces", "faces, by their eyes", faces.faces, ("body",), extra="networks"),
        Detector(
            "objects",
            "people, vehicles and household things",
            objects.objects,
            ("body", "vehicle", "bottle", "household"),
            extra="networks",
        ),
        Detector(
            "sheets",
            "sheets, cards, plates and signs",
            sheets.sheets,
            sheets.GROUPS,
            asks="which kind a sheet is, or its width and height",
            reach=sheets.reach_px,
        ),
        Detector(
            "circles",
            "coins, balls and round signs",
            circles.circles,
            circles.GROUPS,
            asks="which coin or ball it is, or its diameter",
            automatic=False,
        ),
    )
}
"""Ways to see things in a photo by themselves, by name."""


__all__ = ["CAMERA_SOURCES", "DETECTORS", "METHODS", "REPORTS"]
