"""Routes of photos: send, look at, measure in, search, drop."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from fastapi import APIRouter, Request
from fastapi import Path as InPath
from starlette.concurrency import run_in_threadpool
from starlette.datastructures import UploadFile
from starlette.responses import JSONResponse, Response, StreamingResponse

from ..detection import Detection, parse_curve, unknown_curve
from ..detectors.markers import ALL_FAMILIES
from ..errors import InputError, UnknownCameraError
from ..observation import Observation
from ..quantity import Note
from ..targets import find_target
from ..workflow.calculator_of import calculator_of
from ..workflow.detect import detectors_for
from ..workflow.grade import graded
from ..workflow.in_photo import Item, measure_item, measure_items
from ..workflow.measure import camera_document, no_camera_document
from ..workflow.snap import snapped
from ..workflow.tables import DETECTORS, METHODS
from ..workflow.together import with_distances, with_fused
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
ALL = "all"
"""Instead of a detector's name: those that look unasked, or find the targets that are said."""
DRAWS = 20_000
"""Of what is calculated from several items: an answer while a handle is dragged; ends of intervals scatter by 0.02 u."""
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
    """An item that has no answer becomes a note `refused`, and does not lose the others.

    `between` adds the distances of pairs of items, `same` one number from several, what they share treated as common.
    """
    photo = held(request, body.photo)
    items = [Item(_method(one.method), one.inputs, one.label, _notes(one.notes), judged=True) for one in body.items]
    document = measure_items(
        items, photo.photo, camera_for(state_of(request), photo, body.camera), level=body.level, seed=body.seed
    )
    for text in body.same:
        document = with_fused(document, text, option="same", level=body.level, seed=body.seed, draws=DRAWS)
    for text in body.between:
        document = with_distances(document, text, option="between", level=body.level, seed=body.seed, draws=DRAWS)
    return shown(document, form, photo.photo)


@router.post("/measure/{method}", summary="One measurement by one method",
             responses=answers(ref("document"), more=reports()))  # fmt: skip
def post_measure(request: Request, method: Annotated[str, InPath(max_length=100)], body: models.Measure,
                 form: Format = "json") -> Response:  # fmt: skip
    """Inputs as GET /api/methods describes them. With a photo its camera is filled in, and points must lie in it."""
    photo = held(request, body.photo) if body.photo else None
    camera = camera_for(state_of(request), photo, body.camera) if photo else None
    item = Item(_method(method), body.inputs, body.label, _notes(body.notes), judged=True)
    document = measure_item(item, photo.photo if photo else None, camera, level=body.level, seed=body.seed)
    return shown(document, form, photo.photo if photo else None)


def _notes(doubts: list[models.Doubt]) -> tuple[Note, ...]:
    return tuple(Note(**one.model_dump()) for one in doubts)


def _method(name: str) -> Any:
    if name not in METHODS:
        raise InputError("method", name, f"known are {', '.join(METHODS)}")
    return METHODS[name]


# -- searches --------------------------------------------------------------------------------------------


async def _search(request: Request, photo: Held, task: dict[str, Any], job: Job | None = None) -> dict[str, Any]:
    """What a child process sees in the photo."""
    state = state_of(request)
    limits = state.settings.limits
    height, width = photo.levels[0].shape[:2]
    task |= {"name": photo.photo.name, "path": str(photo.folder / "pixels.bin"), "size": [width, height]}
    async with state.children.place():
        found: dict[str, Any] = await state.children.run(
            task, photo.folder, cpu_s=limits.job_s, wall_s=limits.job_s, file_bytes=2**20, memory_bytes=2 * limits.memory_bytes,
            progress=job.moved if job else unwatched,
        )  # fmt: skip
    return found


def _task(request: Request, name: str, photo: Held, body: models.Search) -> dict[str, Any]:
    """What a child is told: all that a person said, checked here, where a wrong word costs nothing."""
    if name != ALL and name not in DETECTORS:
        raise InputError("detector", name, f"known are {ALL}, {', '.join(DETECTORS)}")
    if body.family is not None and body.family not in ALL_FAMILIES:
        raise InputError("family", body.family, f"known are {', '.join(ALL_FAMILIES)}")
    try:
        wanted = [find_target(text, "targets") for text in body.targets]
        only = [] if name == ALL else [name]
        detectors_for(only, wanted)
        if body.curve is not None:
            parse_curve(body.curve)
    except InputError as error:
        field = {"--target": "targets", "--curve": "curve"}.get(error.name, error.name)
        raise InputError(field, error.given, error.allowed) from None
    camera = camera_for(state_of(request), photo, body.camera)
    return {
        "do": "detect", "only": only, "targets": [one.name for one in wanted], "family": body.family, "curve": body.curve,
        "thorough": body.thorough,
        "camera": None if isinstance(camera, UnknownCameraError) else camera.camera.to_json(),
    }  # fmt: skip


@router.post("/detect/{name}", summary="Find things in a photo", responses=gives(shapes.Detections))
async def post_detect(request: Request, name: Annotated[str, InPath(max_length=100)], body: models.Search) -> Response:
    """By one detector, or `all`; `targets` narrows what is looked for, and says what is there.

    Waits for the outcome; as a job, POST /api/jobs, it tells its progress and can be cancelled.
    """
    photo = held(request, body.photo)
    return JSONResponse(await _search(request, photo, _task(request, name, photo, body)))


@router.post("/jobs", summary="Start long work", status_code=202, responses=gives(shapes.Job, 202))
async def post_job(request: Request, body: models.NewJob) -> Response:
    """Gives its id at once."""
    photo = held(request, body.photo)
    task = _task(request, body.detector, photo, body)
    state = state_of(request)
    state.children.check()

    async def work(job: Job) -> dict[str, Any]:
        return await _search(request, photo, task, job)

    return JSONResponse(state.jobs.start(f"detect {body.detector}", work).to_json(), 202)


@router.post("/snap", summary="Move marked points to the edges near them", responses=gives(shapes.Snapped))
def post_snap(request: Request, body: models.Snap) -> Response:
    """The two ends of a line go to the edges it crosses there; any other number of points go to corners."""
    photo = held(request, body.photo)
    marked = Observation(np.array(body.points_px), body.sigma_px)
    limit = np.array([photo.photo.width_px, photo.photo.height_px]) - 0.5
    if np.any(marked.points_px < -0.5) or np.any(marked.points_px > limit):
        raise InputError("points_px", str(body.points_px), "all points must lie in the picture")
    try:
        curve = parse_curve(body.curve) if body.curve is not None else unknown_curve()
    except InputError as error:
        raise InputError("curve", error.given, error.allowed) from None
    found, notes = snapped(photo.photo, marked, curve, radius_px=body.radius_px)
    shape = {2: "length", 4: "rectangle"}.get(len(body.points_px))
    if shape is not None:
        judged = graded(photo.photo, Detection(found, shape))
        found, notes = judged.seen, (*notes, *judged.notes)
    return JSONResponse({"observation": found.to_json(), "notes": [note.to_json() for note in notes]})


@router.post("/outline", summary="The outline of a thing, by a click or a box", responses=gives(shapes.Outlined))
async def post_outline(request: Request, body: models.OutlineOf) -> Response:
    """Its contour at the edges, and its extents with their covariance: what a real size makes a distance of."""
    photo = held(request, body.photo)
    if len(body.place) == 3:
        raise InputError(
            "place", "3 numbers", "give x, y of a point on the thing, or x1, y1, x2, y2 of a box around it"
        )
    task = {"do": "outline", "place": body.place, "person": body.person}
    return JSONResponse(await _search(request, photo, task))


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
