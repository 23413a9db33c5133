"""The bodies of requests, as the OpenAPI document shows them; those of answers are in answers.py."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

_ID = "c5d4c6d0ffae35b1dd6dec8353c2868e"
"""That of examples/desk.jpg."""
Typed = Annotated[str, Field(max_length=200)]
PhotoId = Annotated[str, Field(pattern="^[0-9a-f]{32}$", description="from POST /api/photos", examples=[_ID])]


def _shown(example: dict[str, Any]) -> ConfigDict:
    """Nothing else is taken, and this is what one looks like."""
    return ConfigDict(extra="forbid", json_schema_extra={"examples": [example]})


class _Body(BaseModel):
    model_config = ConfigDict(extra="forbid")


class _Evaluated(_Body):
    level: float = Field(0.95, strict=True, ge=0.5, le=0.999, description="coverage of the intervals")
    seed: int = Field(0, strict=True, ge=0, le=2**32 - 1, description="of Monte Carlo draws, where they are needed")


class Calc(_Evaluated):
    """What a person types into the calculator, as on the command line; leave one value out to solve for it."""

    focal: Typed | None = Field(None, description="focal length; mm if bare")
    size: Typed | None = Field(None, description="real size of the object; mm if bare")
    extent: Typed | None = Field(None, description="its length in the picture, px")
    distance: Typed | None = Field(None, description="depth along the axis; mm if bare")
    sensor_width: Typed | None = Field(None, description="mm if bare")
    sensor_height: Typed | None = Field(None, description="instead of the width; needs image_height")
    sensor_diagonal: Typed | None = Field(None, description="instead of the width; needs image_height")
    image_width: Typed | None = Field(None, description="px")
    image_height: Typed | None = Field(None, description="px")
    preset: Typed | None = Field(None, description="a camera class or sensor of GET /api/presets")
    along: Literal["width", "height"] | None = None
    aspect: Typed | None = Field(None, description="pixel width over pixel height")
    tilt: Typed | None = Field(None, description="of the object to the image plane; degrees if bare")
    offset: Typed | None = Field(None, description="of its middle from the picture's, px, as in 300,-120")

    model_config = _shown(
        {"focal": "35 mm", "sensor_width": "14.1 mm", "image_width": "4096", "size": "200 mm", "extent": "150"}
    )

    def texts(self) -> dict[str, str | None]:
        """The fields as the command line takes them."""
        return {k: v for k, v in self.__dict__.items() if k not in ("level", "seed") and v is not None and v != ""}


class Calibration(_Body):
    """A calibration file, sent."""

    name: Annotated[
        str, Field(max_length=255, description="what the file lacks may stand behind a #: calib.yml#640x480")
    ]
    content: Annotated[str, Field(description="the file's text, in any format of calibration files that is one")]


GivenCamera = Annotated[
    Typed | Calibration | None,
    Field(
        description="f=1500px, f=35mm,sensor=14.1mm, fov=70deg, a preset, or a calibration file; null to go by the photo"
    ),
]


class OfPhoto(_Body):
    """A photo, and what is known of its camera."""

    photo: PhotoId
    camera: GivenCamera = None

    model_config = _shown({"photo": _ID, "camera": "f=35mm,sensor=14.1mm"})


_INPUTS = {"camera": "1600x1200, f=1500 ± 10 px", "ends": "120,80;640,80 ± 0.5px", "size": "200 ± 0.5 mm"}


class Measure(_Evaluated):
    """The inputs of one method; with a photo, its camera and the defaults of `assumptions` are filled in."""

    inputs: dict[str, Any] = Field(
        description="as GET /api/methods describes them: each an object, or text as it is typed"
    )
    label: Annotated[str, Field(max_length=100)] = ""
    photo: PhotoId | None = None
    camera: GivenCamera = None

    model_config = _shown({"inputs": _INPUTS})


class Item(_Body):
    """One measurement of a sheet."""

    method: Annotated[str, Field(max_length=100)]
    inputs: dict[str, Any]
    label: Annotated[str, Field(max_length=100)] = ""


class Sheet(_Evaluated):
    """All that was measured in one photo."""

    photo: PhotoId
    camera: GivenCamera = None
    items: Annotated[list[Item], Field(max_length=200)] = Field(default_factory=list)

    model_config = _shown({"photo": _ID, "items": [{"method": "known_size", "inputs": {
        "ends": "120,80;640,80", "size": "200 mm"}, "label": "shelf"}]})  # fmt: skip


class Search(_Body):
    """A detector's work."""

    photo: PhotoId

    model_config = _shown({"photo": _ID})


class NewJob(_Body):
    """Long work: a search in a photo."""

    kind: Literal["detect"] = "detect"
    detector: Annotated[str, Field(max_length=100)]
    photo: PhotoId

    model_config = _shown({"kind": "detect", "detector": "markers", "photo": _ID})


class Keep(_Body):
    """The photos a page still shows."""

    photos: Annotated[list[PhotoId], Field(max_length=500)]

    model_config = _shown({"photos": [_ID]})
