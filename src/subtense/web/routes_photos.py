"""Routes of photos: send, look at, measure in, search, drop."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Request
from fastapi import Path as InPath
from starlette.concurrency import run_in_threadpool
from starlette.datastructures import UploadFile
from starlette.responses import JSONResponse, Response, StreamingResponse

from ..errors import InputError, UnknownCameraError
from ..workflow.calculator_of import calculator_of
from ..workflow.in_photo import Item, measure_item, measure_items
from ..workflow.measure import camera_document, no_camera_document
from ..workflow.tables import DETECTORS, METHODS
from . import answers as shapes
from . import models
from .children import unwatched
from .jobs import Job, events
from .openapi import answers, gives, ref, reports
from .photos import Held, tile
from .problems import AbsentError
from .routes_numbers import Format, shown
from .state import camera_for, held, state_of
from .uploads import read_form, shown_name

router = APIRouter(prefix="/api")
Id = Annotated[str, InPath(pattern="^[0-9a-f]{32}$", description="from POST /api/photos")]
_UPLOAD = {
    "requestBody": {
        "required": True,
        "content": {"multipart/form-data": {"schema": {
            "type": "object", "required": ["file"], "properties": {"file": {"type": "string", "format": "binary"}}}}},
    }
}  # fmt: skip


@router.get("/photos", summary="The photos held", responses=gives(shapes.Photos))
def get_photos(request: Request) -> Response:
    """Those named on the command line stay; the others go when no page shows them."""
    photos = state_of(request).photos
    return JSONResponse({"photos": [one.to_json() for one in photos.held.values()]})


@router.post(
    "/photos", summary="Send photos", status_code=201, responses=gives(shapes.Photos, 201), openapi_extra=_UPLOAD
)
async def post_photos(request: Request) -> Response:
    """One photo or several, each in a part named file. A photo's id follows from its content."""
    form = await read_form(request, state_of(request).settings.limits)
    try:
        files = [part for _, part in form.multi_items() if isinstance(part, UploadFile)]
        if not files:
            raise InputError("file", None, "send the picture in a part named file, with a file name")
        found = [(await _add(request, part)).to_json() for part in files]
    finally:
        await form.close()
    return JSONResponse({"photos": found}, 201)


async def _add(request: Request, part: UploadFile) -> Held:
    state = state_of(request)
    with tempfile.NamedTemporaryFile(dir=state.photos.folder, delete=False) as file:
        while data := await part.read(2**20):
            await run_in_threadpool(file.write, data)
    path = Path(file.name)
    try:
        return await state.photos.add(path, shown_name(part.filename))
    finally:
        path.unlink(missing_ok=True)


@router.post("/photos/keep", summary="Say which photos are still shown", responses=gives(shapes.Absent))
def post_keep(request: Request, body: models.Keep) -> Response:
    """A photo that is named in no request for two minutes is dropped; `absent` must be sent again to be used."""
    photos = state_of(request).photos
    photos.sweep()
    return JSONResponse({"absent": [photo for photo in body.photos if photos.find(photo) is None]})


@router.get("/photos/{photo}", summary="A photo's size and tags", responses=gives(shapes.Photo))
def get_photo(request: Request, photo: Id) -> Response:
    """No position and no serial number is ever read from it."""
    return JSONResponse(held(request, photo).to_json())


@router.delete("/photos/{photo}", summary="Drop a photo", status_code=204, responses={204: {"description": "dropped"}})
def delete_photo(request: Request, photo: Id) -> Response:
    """Its pixels are removed at once."""
    if not state_of(request).photos.drop(photo):
        raise AbsentError("no such photo here")
    return Response(status_code=204)


_BYTES = {"schema": {"type": "string", "format": "binary"}}
_FILE: dict[int | str, Any] = {200: {"description": "the file", "content": {"application/octet-stream": _BYTES}}}


@router.get(
    "/photos/{photo}/file",
    summary="The file of a photo named on the command line",
    responses=_FILE,
    response_class=Response,
)
def get_file(request: Request, photo: Id) -> Response:
    """For projects, and for the browser to keep; what was sent is not kept here."""
    source = held(request, photo).source
    if source is None or not source.is_file():
        raise AbsentError("the file of this photo is not kept here")
    return Response(source.read_bytes(), media_type="application/octet-stream", headers={"cache-control": "no-store"})


_TILE: dict[int | str, Any] = {200: {"description": "the tile", "content": {"image/jpeg": _BYTES, "image/png": _BYTES}}}
Count = Annotated[int, InPath(ge=0, le=10**6)]


@router.get(
    "/photos/{photo}/tiles/{level}/{column}_{row}.{form}",
    summary="A tile of 512 px",
    responses=_TILE,
    response_class=Response,
)
def get_tile(request: Request, photo: Id, level: Annotated[int, InPath(ge=0, le=40)], column: Count, row: Count,
             form: Literal["jpg", "png"]) -> Response:  # fmt: skip
    """Level 0 is the smallest; the last one is the photo at full size. PNG has the exact pixels."""
    found = tile(held(request, photo), level, column, row, form)
    if found is None:
        raise AbsentError("no such tile")
    media_type = "image/png" if form == "png" else "image/jpeg"
    return Response(found, media_type=media_type, headers={"cache-control": "private, max-age=86400"})


# -- the camera, and measuring ---------------------------------------------------------------------------


@router.post("/camera", summary="The camera of a photo, by every source",
             responses=answers(ref("document"), more=reports()))  # fmt: skip
def post_camera(request: Request, body: models.OfPhoto, form: Format = "json") -> Response:
    """As `subtense camera`: what was chosen and why, its u, and what the other sources say.

    Where nothing tells the camera, `camera` is null, and the note `unknown_camera` says what was tried and what to give.
    """
    photo = held(request, body.photo)
    found = camera_for(state_of(request), photo, body.camera, ask_all=True)
    if isinstance(found, UnknownCameraError):
        return shown(no_camera_document(photo.photo, found), form, photo.photo)
    return shown(camera_document(photo.photo, found), form, photo.photo)


@router.post("/camera/calculator", summary="What a photo fills into the calculator", responses=gives(shapes.Texts))
def post_calculator(request: Request, body: models.OfPhoto) -> Response:
    """Texts for focal, sensor_width and image_width."""
    photo = held(request, body.photo)
    return JSONResponse(calculator_of(photo.photo, _known(camera_for(state_of(request), photo, body.camera))))


def _known(camera: Any) -> Any:
    if isinstance(camera, UnknownCameraError):
        raise camera
    return camera


@router.post("/measure", summary="All that was measured in a photo, as one document",
             responses=answers(ref("document"), more=reports()))  # fmt: skip
def post_sheet(request: Request, body: models.Sheet, form: Format = "json") -> Response:
    """An item that has no answer becomes a note `refused`, and does not lose the others."""
    photo = held(request, body.photo)
    items = [Item(_method(one.method), one.inputs, one.label) for one in body.items]
    document = measure_items(
        items, photo.photo, camera_for(state_of(request), photo, body.camera), level=body.level, seed=body.seed
    )
    return shown(document, form, photo.photo)


@router.post("/measure/{method}", summary="One measurement by one method",
             responses=answers(ref("document"), more=reports()))  # fmt: skip
def post_measure(request: Request, method: Annotated[str, InPath(max_length=100)], body: models.Measure,
                 form: Format = "json") -> Response:  # fmt: skip
    """Inputs as GET /api/methods describes them. With a photo its camera is filled in, and points must lie in it."""
    photo = held(request, body.photo) if body.photo else None
    camera = camera_for(state_of(request), photo, body.camera) if photo else None
    item = Item(_method(method), body.inputs, body.label)
    document = measure_item(item, photo.photo if photo else None, camera, level=body.level, seed=body.seed)
    return shown(document, form, photo.photo if photo else None)


def _method(name: str) -> Any:
    if name not in METHODS:
        raise InputError("method", name, f"known are {', '.join(METHODS)}")
    return METHODS[name]


# -- searches --------------------------------------------------------------------------------------------


async def _search(request: Request, detector: str, photo: Held, job: Job | None = None) -> list[dict[str, Any]]:
    """What a row of DETECTORS sees, by a child process."""
    state = state_of(request)
    limits = state.settings.limits
    pixels = photo.levels[0]
    task = {"do": "detect", "detector": detector, "name": photo.photo.name, "path": str(photo.folder / "pixels.bin"),
            "size": [pixels.shape[1], pixels.shape[0]]}  # fmt: skip
    async with state.children.place():
        found: list[dict[str, Any]] = await state.children.run(
            task, photo.folder, cpu_s=limits.job_s, wall_s=limits.job_s, file_bytes=2**20, memory_bytes=2 * limits.memory_bytes,
            progress=job.moved if job else unwatched,
        )  # fmt: skip
    return found


def _detector(name: str) -> str:
    if name not in DETECTORS:
        raise InputError("detector", name, f"known are {', '.join(DETECTORS)}")
    return name


@router.post("/detect/{name}", summary="Find targets in a photo", responses=gives(shapes.Observations))
async def post_detect(request: Request, name: Annotated[str, InPath(max_length=100)], body: models.Search) -> Response:
    """Waits for the outcome; as a job, POST /api/jobs, it tells its progress and can be cancelled."""
    photo = held(request, body.photo)
    return JSONResponse({"observations": await _search(request, _detector(name), photo)})


@router.post("/jobs", summary="Start long work", status_code=202, responses=gives(shapes.Job, 202))
async def post_job(request: Request, body: models.NewJob) -> Response:
    """Gives its id at once."""
    photo, name = held(request, body.photo), _detector(body.detector)
    state = state_of(request)
    state.children.check()

    async def work(job: Job) -> dict[str, Any]:
        return {"observations": await _search(request, name, photo, job)}

    return JSONResponse(state.jobs.start(f"detect {name}", work).to_json(), 202)


JobId = Annotated[str, InPath(pattern="^[A-Za-z0-9_-]{16}$")]


def _job(request: Request, job: str) -> Job:
    found = state_of(request).jobs.all.get(job)
    if found is None:
        raise AbsentError("no such job here")
    return found


@router.get("/jobs/{job}", summary="How a job stands", responses=gives(shapes.Job))
async def get_job(request: Request, job: JobId) -> Response:
    """Its state, progress, and result or error."""
    return JSONResponse(_job(request, job).to_json())


_EVENTS: dict[int | str, Any] = {
    200: {
        "description": "an event each time it moves, until it ends",
        "content": {"text/event-stream": {"schema": {"type": "string"}}},
    }
}


@router.get(
    "/jobs/{job}/events", summary="A job's progress as server-sent events", responses=_EVENTS, response_class=Response
)
async def get_events(request: Request, job: JobId) -> Response:
    """Events are named by the job's state; their data is that of GET /api/jobs/{job}."""
    headers = {"cache-control": "no-store", "x-accel-buffering": "no"}
    return StreamingResponse(events(_job(request, job)), media_type="text/event-stream", headers=headers)


@router.delete("/jobs/{job}", summary="Cancel a job", status_code=204, responses={204: {"description": "it ends"}})
async def delete_job(request: Request, job: JobId) -> Response:
    """Its child process is ended at once."""
    state_of(request).jobs.cancel(_job(request, job))
    return Response(status_code=204)
