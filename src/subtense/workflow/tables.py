"""The tables of all ways: to add one, write its file and add its line here (camera sources stand in
resolve_camera, reports in report_of)."""

from __future__ import annotations

from collections.abc import Callable

from ..detectors import markers
from ..method import Method
from ..methods import calculator, known_size, pose
from ..observation import Observation
from ..photo import Photo
from .report_of import REPORTS
from .resolve_camera import CAMERA_SOURCES

METHODS: dict[str, Method] = {m.name: m for m in (calculator.METHOD, known_size.METHOD, pose.METHOD)}
"""Ways to measure, by name."""

DETECTORS: dict[str, Callable[[Photo], tuple[Observation, ...]]] = {"markers": markers.markers}
"""Ways to see targets in a photo by themselves, by name."""


__all__ = ["CAMERA_SOURCES", "DETECTORS", "METHODS", "REPORTS"]
