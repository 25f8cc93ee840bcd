"""``/v1/studies``: measure what accuracy costs in time, follow it, read it, stop it."""

import logging
from collections.abc import Callable
from typing import Annotated, Any, cast

import anyio
import anyio.to_thread
import orjson
from fastapi import APIRouter, Body, Request
from fastapi.responses import Response

from app.http.formats import EVENTS, JSON, json_response, negotiated
from app.http.problems import ProblemError
from app.routes import described
from app.routes.body import JsonRoute
from app.schemas import to_scene
from app.schemas.ids import new_id
from app.schemas.study import STUDY_EXAMPLES, StudyList, StudyRequest, StudyResponse
from app.service import events
from app.service.measurements import Tell, item_of
from app.service.service import Service, TheService
from app.store.studies import StudyStore
from dlocore import Scene
from dlocore.errors import within
from dlocore.scene.scene import Switch
from dlocore.study.plan import StudyPlan
from dlocore.study.record import to_document
from dlocore.study.running import run_study

router = APIRouter(prefix="/v1/studies", tags=["studies"], route_class=JsonRoute)
_log = logging.getLogger("dlo")
KIND = "studies"
MOST_WAITING = 4  # studies that may run or wait at once: each may take minutes


def store_of(service: Service) -> StudyStore:
    """Return the stored studies of a service."""
    return StudyStore(service.settings.data_dir)


@router.post("", status_code=202, response_class=Response, summary="Run a study", responses=described.STUDY)
async def study(
    request: Request, wanted: Annotated[StudyRequest, Body(openapi_examples=STUDY_EXAMPLES)], service: TheService
) -> Response:
    """Measure time and true error of every scene on every grid, in the background; predictions go first.

    Studies run one after the other and are stored. With `Accept: text/event-stream` the answer is the progress of the
    study; closing the connection does not stop it, `DELETE` does.
    """
    form = negotiated(request.headers.get("accept"), (JSON, EVENTS))
    service.check_ready()
    plan = await anyio.to_thread.run_sync(_plan, wanted, service)
    if len(service.measurements.under_way(KIND)) >= MOST_WAITING:
        detail = f"{MOST_WAITING} studies are running or waiting, as many as allowed."
        raise ProblemError(429, "queue-full", detail, headers={"Retry-After": "60"})
    id, store = new_id(), store_of(service)

    def work(tell: Tell, cancelled: Callable[[], bool]) -> bytes:
        measured = run_study(plan, on_progress=tell, cancelled=cancelled, deadline=service.settings.time_limit)
        document = orjson.dumps({"id": id, "state": "done", "created": job.created, **to_document(measured)})
        try:
            store.save(id, document)
        except OSError as error:  # it can still be read until the service stops
            _log.error("the study %s is not stored: %s", id, error)
        return document

    job = service.measure(KIND, id, work)
    response = events.of_job(job) if form == EVENTS else json_response(job.summary(), 202)
    response.headers["Location"] = job.address
    return response


def _plan(wanted: StudyRequest, service: Service) -> StudyPlan:
    asked: dict[str, Any] = {
        "grids": tuple((grid.n_u, grid.n_t) for grid in wanted.grids),
        "methods": tuple(wanted.methods),
        "deltas": tuple(wanted.deltas),
        "repeats": wanted.repeats,
        "estimate": wanted.estimate,
        "judge": wanted.judge,
        "parts": tuple(wanted.parts),
    }
    if wanted.scenes is not None:
        scenes: dict[str, Scene] = {}
        for name, scene in wanted.scenes.items():
            with within(f"scenes.{name}"):
                scenes[name] = to_scene(scene, service.motion)
        asked["scenes"] = scenes
    if wanted.effects is not None:
        asked["effects"] = {
            name: cast(dict[str, Switch], switches.model_dump(exclude_unset=True))
            for name, switches in wanted.effects.items()
        }
    return StudyPlan(**asked)


@router.get("", response_model=StudyList, summary="List the studies", responses=described.failures(401, 406))
async def listed(request: Request, service: TheService) -> Response:
    """List the studies, newest first: stored, running and waiting ones, and the last that failed or were stopped."""
    negotiated(request.headers.get("accept"), (JSON,))
    found = {job.id: {**job.item(), "size": None} for job in service.measurements.of(KIND)}
    for id, size in (await anyio.to_thread.run_sync(store_of(service).sizes)).items():
        found[id] = {**item_of(f"/v1/{KIND}/{id}", id, "done"), "size": size}
    return json_response({"studies": [found[id] for id in sorted(found, reverse=True)]})


@router.get("/{id}", response_model=StudyResponse, summary="Read a study", responses=described.READ_STUDY)
async def read(id: str, request: Request, service: TheService) -> Response:
    """Return the study; 202 with its state if it is running or waiting, has failed or was stopped."""
    negotiated(request.headers.get("accept"), (JSON,))
    document = await anyio.to_thread.run_sync(store_of(service).document, id)
    if document is not None:
        return Response(document, media_type=JSON)
    job = service.measurements.get(KIND, id)
    if job is None:
        raise _no_study(id)
    if job.state == "done":  # it ended after the search for its document
        return Response(job.document, media_type=JSON)
    return json_response(job.summary(), 202)


@router.delete(
    "/{id}",
    status_code=204,
    response_class=Response,
    summary="Stop a study, or remove it",
    responses=described.REMOVE_STUDY,
)
async def remove(id: str, service: TheService) -> Response:
    """Stop the study if it is running or waiting (200, or 202 while it is still stopping), or remove it (204)."""
    job = service.measurements.get(KIND, id)
    if job is not None and not job.finished.is_set():
        await job.stop()
        if job.state != "done":
            return json_response(job.summary(), 200 if job.finished.is_set() else 202)
    known = job is not None and service.measurements.forget(id)
    if not await anyio.to_thread.run_sync(store_of(service).delete, id) and not known:
        raise _no_study(id)
    return Response(status_code=204)


@router.get("/{id}/events", response_class=Response, summary="Follow a study", responses=described.PROGRESS)
async def follow(
    id: str,
    request: Request,
    service: TheService,
    last_event_id: events.LastEventId = None,
) -> Response:
    """Return the progress of a study as server-sent events: `state`, `progress`, and `done` or `error`.

    204: no events are left.
    """
    negotiated(request.headers.get("accept"), (EVENTS,))
    seen = events.seen_before(last_event_id)
    job = service.measurements.get(KIND, id)
    if job is not None:
        return events.of_job(job, seen)
    document = await anyio.to_thread.run_sync(store_of(service).document, id)
    if document is None:
        raise _no_study(id)
    return events.of_finished(id, document, seen)


def _no_study(id: str) -> ProblemError:
    return ProblemError(404, "no-such-study", f"There is no study {id[:64]!r}; it may have been removed.")
