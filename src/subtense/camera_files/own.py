"""Our own JSON: a camera as `Camera.to_json` gives it, alone or under "camera", as in every report; or "left" and "right" under "rig".

Beside "camera" may stand "notes", doubts that go wherever the camera goes, and "frame": "stored" where the calibration is
of pictures before their EXIF orientation was applied.
"""

from __future__ import annotations

import json
from typing import Any

from ..camera import Camera
from ..errors import InputError
from ..quantity import Note
from .reading import Found, Reading

_NUMBERS = ("width_px", "height_px", "f_px", "cx_px", "cy_px")
_OPTIONAL = ("aspect", "nominal_focal_m")
_MOST_NOTES, _LONGEST_NOTE = 50, 1000
_OF_THE_CHOICE = "camera_source"
"""A report's note on how its camera was chosen; it is no doubt about the camera."""


def tells(tree: Any) -> bool:
    """Whether this is one."""
    if not isinstance(tree, dict):
        return False
    inner = tree.get("camera", tree.get("rig"))
    return "f_px" in tree or (isinstance(inner, dict) and "projection_type" not in inner)  # that is a camera of OpenSfM


def read(reading: Reading) -> Found:
    """The camera, its covariance and its notes."""
    tree = reading.mapping(reading.content, "the file")
    data = _chosen(reading, tree)
    for key in _NUMBERS:
        if not isinstance(data.get(key), (int, float)) or isinstance(data.get(key), bool):
            raise reading.refused(f"{key} is missing or no number")
    for key in (*_NUMBERS, *_OPTIONAL):
        if data.get(key) is not None:
            reading.number(data[key], key)
    data = {**data, "aspect": 1.0 if data.get("aspect") is None else data["aspect"]}
    reading.size(data["width_px"], data["height_px"])
    frame = tree.get("frame", "")
    if frame not in ("", "stored", "upright"):
        raise reading.refused('frame must be "stored" or "upright"')
    return Found(_camera(reading, data), _notes(reading, tree.get("notes")), frame)


def _chosen(reading: Reading, tree: dict[str, Any]) -> dict[str, Any]:
    """The camera's own part: the file itself, or under "camera", or one of two under "rig"."""
    rig = tree.get("rig")
    if isinstance(rig, dict):
        sides: dict[str, dict[str, Any]] = {s: rig[s] for s in ("left", "right") if isinstance(rig.get(s), dict)}
        return reading.one(sides)[1]
    reading.none_to_choose()
    inner = tree.get("camera")
    return inner if isinstance(inner, dict) else tree


def _camera(reading: Reading, data: dict[str, Any]) -> Camera:
    name = getattr(reading.path, "name", reading.path)
    texts = data.get("part_sources", {})
    if not isinstance(texts, dict) or not all(isinstance(data.get(key, ""), str) for key in ("source", "lens")):
        raise reading.refused("holds values of the wrong kind")
    lists = {key: reading.numbers(data[key], key) for key in ("distortion", "cov") if data.get(key) is not None}
    if "cov" in lists:
        lists["cov"] = data["cov"]
    try:
        camera = Camera.from_json({"source": f"calibration file {name}", **data, **lists})
    except InputError as error:
        raise reading.refused(str(error)) from None
    except (TypeError, ValueError):
        raise reading.refused("holds values of the wrong kind") from None
    return camera


def _notes(reading: Reading, data: Any) -> tuple[Note, ...]:
    if data is None:
        return ()
    if not isinstance(data, list) or len(data) > _MOST_NOTES:
        raise reading.refused(f"notes must be a list of at most {_MOST_NOTES}")
    notes = [_note(reading, item) for item in data]
    return tuple(note for note in notes if note.code != _OF_THE_CHOICE)


def _note(reading: Reading, item: Any) -> Note:
    item = reading.mapping(item, "a note")
    said = [item.get("code"), item.get("message", item.get("text")), item.get("cure", "")]
    if not all(isinstance(text, str) for text in said) or not said[0]:
        raise reading.refused("a note must have code, message and cure, all of them texts")
    code, text, cure = map(_one_line, said)
    return Note(code, text, cure)


def _one_line(text: str) -> str:
    line = " ".join("".join(c if c.isprintable() else " " for c in text).split())
    return line if len(line) <= _LONGEST_NOTE else line[: _LONGEST_NOTE - 3] + "..."


def write(found: Found) -> str:
    """All of it: this format holds every camera."""
    notes = [{"code": n.code, "message": n.text, "cure": n.cure} for n in found.notes]
    tree = {"camera": found.camera.to_json(), "notes": notes, **({"frame": found.frame} if found.frame else {})}
    return json.dumps(tree, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
