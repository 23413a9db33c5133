"""Routes without a photo: the tables, the calculator."""

from __future__ import annotations

import json
from contextlib import suppress
from typing import Annotated, Any

from fastapi import APIRouter, Query
from starlette.concurrency import run_in_threadpool
from starlette.responses import JSONResponse, Response

from .. import propagate
from ..document import Document
from ..errors import GeometryError
from ..photo import Photo
from ..presets import presets
from ..quantity import UNITS
from ..targets import search, targets
from ..workflow import describe
from ..workflow.calculate import calculate, curve
from ..workflow.calculator_input import as_command, as_python, calculator_input
from ..workflow.report_of import REPORTS, report_of
from ..workflow.resolve_camera import CAMERA_SOURCES
from .answers import Curve, Presets, Tables, Targets
from .models import Calc
from .openapi import answers, gives, ref, reports

router = APIRouter(prefix="/api")
Format = Annotated[
    str, Query(alias="format", description="a report: json, text, csv, pdf; overlay with a photo", max_length=20)
]


def shown(document: Document, form: str, photo: Photo | None = None, name: str = "subtense") -> Response:
    """A document as a report; what is no text or JSON comes as a file to save."""
    report = report_of(form, photo=photo is not None)
    try:
        json.dumps(document.to_json(), allow_nan=False)
    except ValueError:
        text = "the numbers are too large or too small to calculate with: no finite answer is left"
        raise GeometryError(text, code="not_finite") from None
    content = report.function(document, photo)
    headers = (
        {} if form in ("json", "text") else {"content-disposition": f'attachment; filename="{name}{report.suffix}"'}
    )
    return Response(content, media_type=report.media_type, headers=headers)


@router.get("/methods", summary="What can be measured, and from what", responses=gives(Tables))
def get_methods() -> Response:
    """Every method with its fields, units and assumptions as JSON Schema, and the other tables of the house."""
    return JSONResponse({
        "methods": describe.methods(), "detectors": describe.detectors(), "camera_sources": list(CAMERA_SOURCES),
        "reports": [{"name": r.name, "title": r.title, "media_type": r.media_type, "suffix": r.suffix, "of_photo": r.of_photo}
                    for r in REPORTS.values()],
        "units": {unit: {"unit": kept, "factor": factor} for unit, (kept, factor) in UNITS.items()},
    })  # fmt: skip


@router.get("/presets", summary="Camera classes and sensors", responses=gives(Presets))
def get_presets() -> Response:
    """Each with what a calculator's fields take of it: ranges are limits."""
    return JSONResponse({"presets": [p.to_json() for p in presets().values()]})


@router.get("/targets", summary="Things of known size", responses=gives(Targets))
def get_targets(q: Annotated[str, Query(max_length=100, description="words to search for")] = "") -> Response:
    """Each with its size and doubt, as text that the fields take, and its public source."""
    found = search(q.split()) if q.strip() else targets().values()
    return JSONResponse({"targets": [target.to_json() for target in found]})


_CALC = answers(ref("document"), more={**reports(), "text/x-shellscript": {"schema": {"type": "string"}},
                                       "text/x-python": {"schema": {"type": "string"}}})  # fmt: skip


@router.post("/calc", summary="The classical relation, solved for what is left out", responses=_CALC)
async def post_calc(body: Calc, form: Format = "json") -> Response:
    """distance = size x focal length in pixels / extent in pixels; `format` may also be `shell` or `python`."""
    texts = body.texts()
    inputs, image_height = calculator_input(texts)
    if form == "shell":
        return Response(as_command(texts), media_type="text/x-shellscript")
    if form == "python":
        return Response(as_python(texts), media_type="text/x-python")
    known: dict[str, Any] = {"image_height": image_height, "level": body.level, "seed": body.seed}
    try:  # a thread for a millisecond costs more than it saves; draws would keep others waiting
        document = calculate(inputs, **known, draws=0)
    except propagate.DrawsNeeded:
        document = await run_in_threadpool(calculate, inputs, **known)
    return shown(document, form) if form == "json" else await run_in_threadpool(shown, document, form)


@router.post("/calc/curve", summary="The unknown over the extent, with its band", responses=gives(Curve))
def post_curve(body: Calc) -> Response:
    """For a chart: 49 points over a factor of 20 each way, and the interval at each."""
    inputs, image_height = calculator_input(body.texts())
    with suppress(propagate.DrawsNeeded):  # refuses what has no answer
        calculate(inputs, image_height=image_height, level=body.level, seed=body.seed, draws=0)
    return Response(json.dumps(curve(inputs, level=body.level), allow_nan=False), media_type="application/json")
