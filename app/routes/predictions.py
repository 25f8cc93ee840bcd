"""``/v1/predictions``: predict, follow, list, read, cancel and remove."""

import re
from collections.abc import Callable
from datetime import datetime
from functools import partial
from typing import Annotated, Any, Literal

import anyio
import anyio.to_thread
import orjson
from fastapi import APIRouter, Body, Header, Query, Request
from fastapi.responses import Response
from pydantic import AwareDatetime, BeforeValidator
from pydantic_core import PydanticCustomError

from app.http.formats import EVENTS, FORMS, JSON, json_response, negotiated, prediction_response
from app.http.preferences import preferences
from app.http.problems import ProblemError, no_such_run
from app.routes import described
from app.routes.body import JsonRoute, calling_when_gone
from app.schemas import EXAMPLES, PredictionList, PredictionRequest
from app.schemas.base import LIKE, RunId
from app.service import events
from app.service.jobs import Job
from app.service.service import Service, TheService
from dlocore.answer.parts import Status

router = APIRouter(prefix="/v1/predictions", tags=["predictions"], route_class=JsonRoute)
_PART = "this part of it is available once it is done and stored"
_ISO = re.compile(r"\d{4}-\d\d-\d\d[Tt ]\d\d:\d\d(:\d\d([.,]\d+)?)?([Zz]|[+-]\d\d:?\d\d)", re.ASCII)


def _iso(value: str) -> str:
    """Return `value` if it is ISO 8601; pydantic alone would also take a bare number as seconds since 1970."""
    if not _ISO.fullmatch(value):
        raise PydanticCustomError("datetime_parsing", "not ISO 8601")
    return value


Instant = Annotated[AwareDatetime, BeforeValidator(_iso)]


@router.post(
    "",
    status_code=201,
    response_class=Response,
    summary="Predict the motion of a cable",
    responses=described.PREDICT,
)
async def predict(
    request: Request,
    scene: Annotated[PredictionRequest, Body(openapi_examples=EXAMPLES)],
    service: TheService,
    store: Annotated[bool, Query(description="Whether to keep the run.", examples=[True])] = True,
    like: Annotated[RunId | None, Query(description=LIKE)] = None,
    prefer: Annotated[
        str | None,
        Header(description=described.PREFER, examples=["respond-async", "respond-async, wait=5"]),
    ] = None,
) -> Response:
    """Solve the scene and return the predicted space-time surface.

    The answer says whether the solve converged (`status`, `message`), how accurate the surface is, and what was
    simulated and why. Closing the connection cancels the solve, unless `Prefer: respond-async` was sent.
    """
    form = negotiated(request.headers.get("accept"), (*FORMS, EVENTS))
    wishes = preferences(prefer)
    job = await service.submit(scene, await request.body(), store=store, like=like)
    if form == EVENTS:
        response = events.of_job(job, cancel=not wishes.respond_async)
    elif wishes.respond_async:
        with anyio.move_on_after(wishes.wait):
            await job.finished.wait()
        response = await _answer(job, service, form) if job.finished.is_set() else _state(job, 202)
    else:
        async with calling_when_gone(request, job.cancel):
            await job.finished.wait()
        if not job.beyond_limit:
            service.jobs.forget(job.id)  # it is answered here
        response = await _answer(job, service, form)
    if response.status_code == 201 or form == EVENTS or wishes.respond_async:
        response.headers["Location"] = f"/v1/predictions/{job.id}"
    if wishes.applied:
        response.headers["Preference-Applied"] = wishes.applied
    return response


async def _answer(job: Job, service: Service, form: str) -> Response:
    """Return the answer of a job: 201 for a stored run, 200 for one that is not stored."""
    if job.problem is not None:
        raise job.problem
    address = f"/v1/predictions/{job.id}"
    document, material = job.document or b"", job.material
    if job.beyond_limit:
        message = orjson.loads(document)["message"]
        limit = service.settings.time_limit
        detail = f"The solve reached the limit of {limit:g} s; the best iterate so far is kept. {message}"
        raise ProblemError(504, "time-limit", detail, prediction=address)
    return await prediction_response(document, form, lambda: material, 201 if job.store else 200)


def _state(job: Job, status: int = 200) -> Response:
    headers = {"Vary": "Accept"} | ({} if job.finished.is_set() else {"Retry-After": "1"})
    return Response(orjson.dumps(job.summary()), status, headers, JSON)


@router.get(
    "",
    response_model=PredictionList,
    summary="List the stored runs, newest first",
    responses=described.failures(401, 406, 422),
)
async def listed(
    request: Request,
    service: TheService,
    limit: Annotated[int, Query(ge=1, le=1000, description="Largest number of runs on a page.", examples=[20])] = 20,
    offset: Annotated[int, Query(ge=0, le=10**9, description="Number of newer runs to skip.", examples=[0])] = 0,
    cursor: Annotated[
        RunId | None,
        Query(description="Only runs older than the one with this id, as in `next`."),
    ] = None,
    status: Annotated[list[Status] | None, Query(description="Only runs with one of these statuses.")] = None,
    method: Annotated[
        Literal["march", "spacetime", "paper", "reference"] | None,
        Query(description="Only runs solved by this method."),
    ] = None,
    name: Annotated[str, Query(max_length=200, description="Only runs whose name contains this, ignoring case.")] = "",
    since: Annotated[
        Instant | None, Query(description="Only runs requested at this time or later, ISO 8601 with offset.")
    ] = None,
    before: Annotated[
        Instant | None, Query(description="Only runs requested before this time, ISO 8601 with offset.")
    ] = None,
) -> Response:
    """List the stored runs and, as `under_way`, the predictions that are running or waiting, which are not filtered.

    Follow `next` for the next page: runs that are added or removed in the meantime don't shift it.
    """
    negotiated(request.headers.get("accept"), (JSON,))

    def wanted(run: dict[str, Any]) -> bool:
        created = datetime.fromisoformat(run["created"])
        return (
            (not status or run["status"] in status)
            and (method is None or run["method"] == method)
            and name.casefold() in run.get("name", "").casefold()
            and (since is None or created >= since)
            and (before is None or created < before)
        )

    def page() -> tuple[list[dict[str, Any]], int]:
        return service.runs.page(limit + 1, offset, cursor=cursor, where=wanted)

    runs, total = await anyio.to_thread.run_sync(page)
    following = None
    if len(runs) > limit:
        runs = runs[:limit]
        following = str(request.url.include_query_params(cursor=runs[-1]["id"]).remove_query_params("offset").query)
    document = {
        "predictions": runs,
        "total": total,
        "limit": limit,
        "offset": offset,
        "next": None if following is None else f"/v1/predictions?{following}",
        "under_way": [job.item() for job in service.jobs.under_way()],
    }
    return json_response(document)


@router.get("/{id}", response_class=Response, summary="Read a prediction, or its progress", responses=described.READ)
async def read(id: str, request: Request, service: TheService) -> Response:
    """Return the prediction as it was answered; if there is none (yet), its state and the iterations so far."""
    form = negotiated(request.headers.get("accept"), FORMS)
    document, job = await _found(service, service.document, id)
    if document is not None:
        return await prediction_response(document, form, partial(service.material, id))
    if job is None:
        raise no_such_run(id)
    if form != JSON:
        raise job.not_done(_PART)
    return _state(job)


@router.delete(
    "/{id}",
    status_code=204,
    response_class=Response,
    summary="Cancel a prediction, or remove it",
    responses=described.DELETE,
)
async def remove(id: str, service: TheService) -> Response:
    """Cancel the prediction if it is queued or running (200, or 202 while it is still stopping), or remove it (204)."""
    job = service.jobs.get(id)
    if job is not None and not job.finished.is_set():
        await job.stop()
        if job.state != "done":
            return _state(job, 200 if job.finished.is_set() else 202)
    known = service.jobs.forget(id)
    service.recent.forget(id)
    if not await anyio.to_thread.run_sync(service.runs.delete, id) and not known:
        raise no_such_run(id)
    return Response(status_code=204)


@router.get("/{id}/events", response_class=Response, summary="Follow a prediction", responses=described.FOLLOW)
async def follow(
    id: str,
    request: Request,
    service: TheService,
    last_event_id: events.LastEventId = None,
) -> Response:
    """Return the progress of the solve as server-sent events.

    `state` has the id and the state, `iteration` one item of `iterations`. The last event is `done` with the prediction
    or `error` with a problem document. A client that connects late gets the past iterations first. 204: no events are
    left.
    """
    negotiated(request.headers.get("accept"), (EVENTS,))
    seen = events.seen_before(last_event_id)
    job = service.jobs.get(id)
    if job is not None:
        return events.of_job(job, seen)
    document = await anyio.to_thread.run_sync(service.document, id)
    if document is None:
        raise no_such_run(id)
    return events.of_document(document, seen)


async def part(service: Service, read: Callable[[str], bytes | None], id: str) -> bytes:
    """Return what `read` finds of the stored run `id`.

    Raises:
        ProblemError: 404 if there is no such run, 409 if it has no answer or is not stored.
    """
    content, job = await _found(service, read, id)
    if content is None:
        raise no_such_run(id) if job is None else job.not_done(_PART)
    return content


async def _found(service: Service, read: Callable[[str], bytes | None], id: str) -> tuple[bytes | None, Job | None]:
    """Return what `read` finds of the run `id`, and its job, even if the job ends during the search."""
    job = service.jobs.get(id)
    content = await anyio.to_thread.run_sync(read, id)
    if content is None and job is not None and job.state == "done":
        content = await anyio.to_thread.run_sync(read, id)
    return content, service.jobs.get(id)
