"""The bodies of answers, as the OpenAPI document shows them; that of a document is in data/schema.json."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

Limits2 = Annotated[list[float], Field(min_length=2, max_length=2)]


class _Answer(BaseModel):
    model_config = ConfigDict(extra="forbid")


class Output(_Answer):
    """One number a method gives."""

    what: str
    unit: str
    title: str


class Method(_Answer):
    """One row of METHODS."""

    name: str
    title: str
    button: str
    needs: str
    assumes: list[str]
    source: str
    typical: str
    outputs: list[Output]
    inputs: dict[str, Any] = Field(
        description="JSON Schema of `inputs` of POST /api/measure/{method}; `x-` keys are for forms"
    )
    example: dict[str, Any] = Field(description="inputs that can be measured")


class Detector(_Answer):
    """One row of DETECTORS."""

    name: str
    title: str
    groups: list[str] = Field(description="of the targets, whose things it can find")
    asks: str = Field(description="what must be said to have it measured; empty where that is nothing")
    automatic: bool = Field(description="whether it is looked for unasked")
    extra: str = Field(description="of the package, that it needs")


class Report(_Answer):
    """One row of REPORTS."""

    name: str
    title: str
    media_type: str
    suffix: str
    of_photo: bool


class Unit(_Answer):
    """What a unit is kept as, and how many of that it is."""

    unit: str
    factor: float


class Tables(_Answer):
    """The tables of the house."""

    methods: list[Method]
    detectors: list[Detector]
    camera_sources: list[str]
    reports: list[Report]
    units: dict[str, Unit]


class Preset(_Answer):
    """A camera class or a sensor; its numbers are limits, null where the row does not say them."""

    name: str
    title: str
    kind: Literal["class", "sensor"]
    aliases: list[str]
    source: str
    sensor_width_mm: Limits2
    sensor_height_mm: Limits2 | None
    focal_mm: Limits2 | None
    image_width_px: Limits2 | None


class Presets(_Answer):
    """All presets."""

    presets: list[Preset]


class KnownTarget(_Answer):
    """A thing of known size; its sizes are texts as fields take them, null where its shape has none."""

    name: str
    title: str
    group: str
    what: str
    shape: Literal["length", "circle", "rectangle"]
    size: str | None
    width: str | None
    height: str | None
    text: str
    aliases: list[str]
    doubt: str
    source: str


class Targets(_Answer):
    """Those that were found."""

    targets: list[KnownTarget]


class Curve(_Answer):
    """Columns of a chart."""

    x_what: str
    y_what: str
    x_unit: str
    y_unit: str
    x: list[float]
    value: list[float]
    low: list[float]
    high: list[float]


class Texts(_Answer):
    """What a photo fills into the calculator."""

    focal: str
    sensor_width: str
    image_width: str


class Tags(_Answer):
    """What the file says of its camera; what it does not say is left out."""

    make: str | None = None
    model: str | None = None
    lens: str | None = None
    focal_mm: float | None = None
    f35_mm: float | None = None


class Doubt(_Answer):
    """A note: a doubt and its cure."""

    code: str
    text: str
    cure: str


class Photo(_Answer):
    """A photo that is held."""

    id: str = Field(pattern="^[0-9a-f]{32}$")
    name: str
    width_px: int = Field(ge=1)
    height_px: int = Field(ge=1)
    sha256: str = Field(pattern="^[0-9a-f]{64}$")
    tile_px: int = Field(ge=1)
    levels: int = Field(ge=1)
    tags: Tags
    notes: list[Doubt]
    kept: bool = Field(description="whether it stays without a page")


class Photos(_Answer):
    """Photos."""

    photos: list[Photo]


class Absent(_Answer):
    """Photos that must be sent again to be used."""

    absent: list[str]


class Observation(_Answer):
    """Points seen in a picture; (0, 0) is the centre of the top-left pixel of the upright picture."""

    points_px: list[Limits2]
    sigma_px: float | list[float]
    cov: list[list[float]] | None
    label: str
    score: float
    source: str
    id: str | None = None


class Detection(Observation):
    """One thing found, and how it is measured.

    Put the observation into the field `points_field` of `method`, and its size into `size_field`.
    """

    detector: str = Field(description="who found it")
    shape: Literal["square", "rectangle", "length", "circle", "sphere"]
    target: str | None = Field(
        description="what its size is taken to be, of GET /api/targets; null where it must be told"
    )
    others: list[str] = Field(description="further targets that fit as well")
    tilt: dict[str, Any] | None = Field(description="of a length, for the field tilt, where it is known")
    notes: list[Doubt] = Field(
        description="for `notes` of the measurement; assumed_size falls away where the size is told"
    )
    method: str
    points_field: str
    size_field: str
    size_prefix: str = Field(description="stands before a size that is told, as in 'square 50 mm'")
    size_text: str | None = Field(description="the size of its target, as size_field takes it")
    size: dict[str, Any] | None = Field(description="the same with its law and where it comes from")


class Detections(_Answer):
    """What was found."""

    detections: list[Detection]
    notes: list[Doubt] = Field(description="detectors that could not be asked")


class Snapped(_Answer):
    """The points at the edges near them, with their joint covariance, and what is doubtful about that."""

    observation: Observation
    notes: list[Doubt]


class Outlined(_Answer):
    """The outline of a thing, and its extents, each as two ends with their covariance.

    Put an extent into the field `points_field` of `method`, and its real size into `size_field`.
    """

    contour_px: list[Limits2] = Field(description="around the thing")
    extents: dict[str, Observation] = Field(
        description="longest, shortest, width, height; box: the corners of the narrowest"
    )
    area_px: float = Field(description="in square pixels")
    u_area_px: float
    notes: list[Doubt] = Field(description="for `notes` of a measurement")
    method: str
    points_field: str
    size_field: str


class Fault(_Answer):
    """As `error` of any answer."""

    type: str
    name: str | None
    given: Any = None
    message: str


class Job(_Answer):
    """Long work, and how it stands."""

    id: str = Field(pattern="^[A-Za-z0-9_-]{16}$")
    kind: str
    state: Literal["running", "done", "failed", "cancelled"]
    progress: float = Field(ge=0, le=1)
    doing: str = Field(description="what is looked for now")
    result: Detections | None
    error: Fault | None
