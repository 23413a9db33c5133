"""Distances from images, each with the uncertainty it deserves.

    from subtense import Photo, Quantity, measure_markers
    document = measure_markers(Photo.load("desk.jpg"), Quantity.interval(0.050, 0.0002, "m"))
    print(document.measurements[0].value)  # metres

All numbers are in metres, pixels, radians and seconds; pixel (0, 0) is the centre of the top-left pixel.
Exported is what a program needs to measure, to add a method, and to catch what goes wrong.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

__version__ = "0.3.0"

if TYPE_CHECKING:
    from . import propagate as propagate
    from .board import Board as Board
    from .camera import Camera as Camera
    from .document import Document as Document
    from .errors import FileFormatError as FileFormatError
    from .errors import GeometryError as GeometryError
    from .errors import InputError as InputError
    from .errors import MissingExtraError as MissingExtraError
    from .errors import NothingFoundError as NothingFoundError
    from .errors import SubtenseError as SubtenseError
    from .errors import UnknownCameraError as UnknownCameraError
    from .method import Method as Method
    from .observation import Observation as Observation
    from .photo import Photo as Photo
    from .quantity import Measurement as Measurement
    from .quantity import Quantity as Quantity
    from .target import Target as Target
    from .workflow.calculate import calculate as calculate
    from .workflow.calculator_input import calculator_input as calculator_input
    from .workflow.calibrate import calibrate as calibrate
    from .workflow.calibrate import calibrate_rig as calibrate_rig
    from .workflow.measure import measure_lines as measure_lines
    from .workflow.measure import measure_markers as measure_markers
    from .workflow.resolve_camera import resolve_camera as resolve_camera
    from .workflow.tables import METHODS as METHODS

_HOME = {
    "Board": "board", "Camera": "camera", "Document": "document", "FileFormatError": "errors", "GeometryError": "errors",
    "InputError": "errors", "METHODS": "workflow.tables", "Measurement": "quantity", "Method": "method",
    "MissingExtraError": "errors", "NothingFoundError": "errors", "Observation": "observation", "Photo": "photo",
    "Quantity": "quantity", "SubtenseError": "errors", "Target": "target", "UnknownCameraError": "errors",
    "calculate": "workflow.calculate", "calculator_input": "workflow.calculator_input",
    "calibrate": "workflow.calibrate", "calibrate_rig": "workflow.calibrate",
    "measure_lines": "workflow.measure", "measure_markers": "workflow.measure",
    "propagate": "propagate", "resolve_camera": "workflow.resolve_camera",
}  # fmt: skip

__all__ = sorted(_HOME)


def __getattr__(name: str) -> Any:
    """Import what is asked for when it is asked for, so that `import subtense` and `subtense --help` start at once."""
    if name not in _HOME:
        raise AttributeError(f"module 'subtense' has no attribute {name!r}")
    module = importlib.import_module(f"{__name__}.{_HOME[name]}")
    return module if name == "propagate" else getattr(module, name)


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
