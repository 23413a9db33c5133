"""The bodies of requests, as the OpenAPI document shows them; those of answers are in answers.py."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from ..assumptions import CLICK_SIGMA_PX

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


class Doubt(_Body):
    """A note that goes with a measurement, as a detector tells it of what it found."""

    code: Annotated[str, Field(pattern="^[a-z0-9_]{1,50}$")]
    text: Annotated[str, Field(max_length=1000)]
    cure: Annotated[str, Field(max_length=1000)] = ""


Doubts = Annotated[list[Doubt], Field(max_length=20, description="about what was seen; they go with the measurement")]


class Measure(_Evaluated):
    """The inputs of one method; with a photo, its camera and the defaults of `assumptions` are filled in."""

    inputs: dict[str, Any] = Field(
        description="as GET /api/methods describes them: each an object, or text as it is typed"
    )
    label: Annotated[str, Field(max_length=100)] = ""
    notes: Doubts = Field(default_factory=list)
    photo: PhotoId | None = None
    camera: GivenCamera = None

    model_config = _shown({"inputs": _INPUTS})


class Item(_Body):
    """One measurement of a sheet."""

    method: Annotated[str, Field(max_length=100)]
    inputs: dict[str, Any]
    label: Annotated[str, Field(max_length=100)] = ""
    notes: Doubts = Field(default_factory=list)


class Sheet(_Evaluated):
    """All that was measured in one photo."""

    photo: PhotoId
    camera: GivenCamera = None
    items: Annotated[list[Item], Field(max_length=200)] = Field(default_factory=list)
    between: Annotated[
        list[Typed],
        Field(max_length=20, description="pairs of items whose distance is wanted, by labels or numbers: 1,2"),
    ] = Field(default_factory=list)
    same: Annotated[list[Typed], Field(max_length=20, description="items that are one and the same thing: 1,2")] = (
        Field(default_factory=list)
    )

    model_config = _shown({"photo": _ID, "items": [{"method": "known_size", "inputs": {
        "ends": "120,80;640,80", "size": "200 mm"}, "label": "shelf"}]})  # fmt: skip


class Search(OfPhoto):
    """What to look for in a photo, and what is known beside it."""

    targets: Annotated[
        list[Typed], Field(max_length=50, description="kinds of GET /api/targets that are in the picture")
    ] = Field(default_factory=list)
    family: Typed | None = Field(None, description="of markers, as 36h11; null for all")
    curve: Typed | None = Field(None, description="the picture's transfer curve: srgb, linear, or an exponent, as 2.2")
    thorough: bool = Field(False, strict=True, description="search the full resolution where a coarse one would do")

    model_config = _shown({"photo": _ID, "curve": "srgb"})


class NewJob(Search):
    """Long work: a search in a photo."""

    kind: Literal["detect"] = "detect"
    detector: Annotated[
        str,
        Field(max_length=100, description="of GET /api/methods; all for those that look unasked, or find the targets"),
    ]

    model_config = _shown({"kind": "detect", "detector": "markers", "photo": _ID})


class Snap(_Body):
    """Points that were marked by hand."""

    photo: PhotoId
    points_px: Annotated[
        list[Annotated[list[float], Field(min_length=2, max_length=2)]],
        Field(min_length=1, max_length=20, description="two are the ends of a line; any other number are corners"),
    ]
    sigma_px: float = Field(
        CLICK_SIGMA_PX, strict=True, gt=0, le=1000, description="standard deviation of a marked point"
    )
    radius_px: float | None = Field(None, strict=True, ge=1, le=200, description="how far from a point is looked")
    curve: Typed | None = Field(None, description="the picture's transfer curve: srgb, linear, or an exponent, as 2.2")

    model_config = _shown({"photo": _ID, "points_px": [[394, 372], [748, 368]]})


class OutlineOf(_Body):
    """A thing, by a point on it or a box around it."""

    photo: PhotoId
    place: Annotated[
        list[float], Field(min_length=2, max_length=4, description="x, y of a point, or x1, y1, x2, y2 of a box, px")
    ]
    person: bool = Field(False, strict=True, description="cut a person out, by a network; needs the extra networks")

    model_config = _shown({"photo": _ID, "place": [860, 680, 1085, 825]})


class Keep(_Body):
    """The photos a page still shows."""

    photos: Annotated[list[PhotoId], Field(max_length=500)]

    model_config = _shown({"photos": [_ID]})
