"""From what a person typed into a calculator to its Inputs, with the defaults of `assumptions`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from .. import assumptions
from ..errors import InputError
from ..methods.calculator import Inputs
from ..quantity import Assume, Quantity

if TYPE_CHECKING:
    from ..presets import Preset

_HOW: dict[str, tuple[str, str, Assume]] = {
    "focal": ("m", "mm", assumptions.focal_length),
    "size": ("m", "mm", assumptions.size),
    "extent": ("px", "px", assumptions.extent),
    "distance": ("m", "mm", assumptions.size),
    "sensor_width": ("m", "mm", assumptions.sensor_width),
    "sensor_height": ("m", "mm", assumptions.sensor_width),
    "sensor_diagonal": ("m", "mm", assumptions.sensor_width),
    "image_width": ("px", "px", assumptions.count),
    "image_height": ("px", "px", assumptions.count),
    "aspect": ("1", "1", assumptions.ratio),
    "tilt": ("rad", "deg", assumptions.angle),
}
"""Option: the unit it is kept in, the unit of a bare number, and what is assumed of it without ±."""


def _preset(name: str | None) -> Preset | None:
    if not name:
        return None
    from ..presets import find_preset  # most calculations name none

    return find_preset(name, "--preset")


def calculator_input(text: Mapping[str, str | None]) -> tuple[Inputs, Quantity | None]:
    """The calculator's Inputs, and the image height where it was said.

    Args:
        text: what was typed, by the names of `_HOW`, `along`, `offset` and `preset`; None where nothing was.

    Raises:
        InputError: a text that can't be read, or something missing: which, and what to give.
    """
    said = {name: _read(name, text.get(name)) for name in _HOW}
    preset = _preset(text.get("preset"))
    object_side: dict[str, Any] = {name: said[name] for name in ("size", "extent", "distance")}
    asked_for_camera = all(object_side.values())
    focal = said["focal"] or (preset.focal_length if preset and not asked_for_camera else None)
    wants_one = asked_for_camera and focal is not None  # the unknown is the sensor's or the picture's width
    image_width = said["image_width"] or (preset.image_width if preset else None)
    if image_width is None and not wants_one:
        raise InputError("--image-width", None, "give the picture's width in pixels, or a --preset of a camera class")
    sensor_width = _sensor_width(said, preset, image_width, needed=not wants_one or image_width is None)
    optional: dict[str, Any] = {name: said[name] for name in ("aspect", "tilt") if said[name] is not None}
    optional |= _offset(text.get("offset"))
    inputs = Inputs(sensor_width, image_width, focal, **object_side, along=text.get("along") or "width", **optional)
    return inputs, said["image_height"]


def _read(name: str, text: str | None) -> Quantity | None:
    unit, bare, assume = _HOW[name]
    if text is None:
        return None
    option = "--" + name.replace("_", "-")
    quantity = Quantity.parse(text, unit, bare=bare, name=option, assume=assume)
    if name != "tilt" and not float(quantity.value) > 0:
        raise InputError(option, text, "give a number above 0")
    return quantity


def _sensor_width(
    said: Mapping[str, Quantity | None], preset: Preset | None, image_width: Quantity | None, *, needed: bool
) -> Quantity | None:
    """The sensor's width, from its height or diagonal by the picture's proportions where those were said."""
    if said["sensor_width"] is not None:
        return said["sensor_width"]
    other = said["sensor_height"] or said["sensor_diagonal"]
    if other is None:
        if preset is None and needed:
            raise InputError("--sensor-width", None, "give it, its height or diagonal, or a --preset")
        return preset.sensor_width if preset else None
    if said["image_height"] is None or image_width is None:
        missing = "--image-width" if image_width is None else "--image-height"
        raise InputError(missing, None, "the sensor's width follows from its height or diagonal by it")
    aspect = float(said["aspect"].value) if said["aspect"] else 1.0
    ratio = float(image_width.value) * aspect / float(said["image_height"].value)
    return other.scaled(ratio if said["sensor_height"] else ratio / (1 + ratio * ratio) ** 0.5)


def _offset(text: str | None) -> dict[str, Quantity]:
    if text is None:
        return {}
    words = text.replace(";", ",").split(",")
    try:
        x, y = (float(word) for word in words)
    except ValueError:
        raise InputError("--offset", text, "give two numbers of pixels, as in '300,-120'") from None
    return {"offset_x": Quantity.exact(x, "px", "stated"), "offset_y": Quantity.exact(y, "px", "stated")}


def as_command(text: Mapping[str, str | None]) -> str:
    """The command line that calculates the same."""
    import shlex

    said = {name: value for name, value in text.items() if value}
    return " ".join(
        ["subtense calc", *(f"--{name.replace('_', '-')} {shlex.quote(value)}" for name, value in said.items())]
    )


def as_python(text: Mapping[str, str | None]) -> str:
    """A program that calculates the same."""
    said = {name: value for name, value in text.items() if value}
    lines = "".join(f"    {name!r}: {value!r},\n" for name, value in said.items())
    return (
        "from subtense import calculate, calculator_input\n\n"
        f"inputs, image_height = calculator_input({{\n{lines}}})\n"
        "answer = calculate(inputs, image_height=image_height).measurements[0]\n"
        'print(answer.what, answer.value, answer.unit, "95 %:", answer.low, answer.high)'
    )
