"""``/v1/calibration``: what accuracy costs in time on the machine of the service.

It is measured on request, not at the first start: it takes tens of seconds of a core, which would slow the first
requests down, and times that are measured while other code is being compiled are worth little.
"""

import logging
from typing import Annotated, Any, Literal

import anyio
import anyio.to_thread
import orjson
from fastapi import APIRouter, Query, Request
from fastapi.responses import Response

from app.http.formats import EVENTS, JSON, json_response, negotiated
from app.http.problems import ProblemError, not_written
from app.routes import described
from app.routes.body import JsonRoute
from app.schemas.calibration import CalibrationResponse
from app.schemas.ids import new_id
from app.service import events
from app.service.measurements import Tell
from app.service.service import TheService
from dlocore import calibration
from dlocore.calibration import Calibration

router = APIRouter(prefix="/v1/calibration", tags=["calibration"], route_class=JsonRoute)
_log = logging.getLogger("dlo")
KIND = "calibration"


def document_of(found: Calibration, dimensions: int) -> dict[str, Any]:
    """Return the points of a calibration for motions of some dimensions, and which of them are on the Pareto front."""
    points = found.of_dimensions(dimensions)

    def plain(point: calibration.Measured) -> dict[str, Any]:
        return {name: value for name, value in vars(point).items() if name != "dimensions"}

    return {
        "machine": found.machine,
        "version": found.version,
        "measured_at": found.measured_at,
        "duration": found.duration,
        "current": found.current,
        "dimensions": dimensions,
        "points": [plain(p) for p in points],
        "front": calibration.front_of(points),
        "default": next((plain(p) for p in found.defaults if p.dimensions == dimensions), None),
    }


@router.get(
    "",
    response_model=CalibrationResponse,
    summary="Read what accuracy costs in time on this machine",
    responses=described.failures(401, 404, 406, 422),
)
async def read(
    request: Request,
    service: TheService,
    dimensions: Annotated[
        Literal["2", "3"], Query(description="Dimensions of the motions: 2, in the plane, or 3.", examples=["2"])
    ] = "2",
) -> Response:
    """Return the error and time of both methods over grids, and the Pareto front; 404 until they are measured."""
    negotiated(request.headers.get("accept"), (JSON,))
    found = await anyio.to_thread.run_sync(calibration.load, service.settings.calibration_file)
    if found is None:
        detail = "This machine has not been calibrated. POST /v1/calibration, or run: dlo calibrate."
        raise ProblemError(404, "not-calibrated", detail)
    return json_response(document_of(found, int(dimensions)))


@router.post("", status_code=202, response_class=Response, summary="Calibrate", responses=described.MEASURE)
async def measure(request: Request, service: TheService) -> Response:
    """Measure this machine in the background for about 10 to 20 seconds; predictions go first.

    If a calibration is already under way, the answer is that one. With `Accept: text/event-stream` the answer is its
    progress; closing the connection does not stop the calibration, `DELETE` does.
    """
    form = negotiated(request.headers.get("accept"), (JSON, EVENTS))
    running = service.measurements.under_way(KIND)

    def work(tell: Tell, cancelled: Any) -> bytes:
        from dlocore.study import calibrating  # the solver, which it measures, is slow to import

        found = calibrating.measure(on_progress=tell, cancelled=cancelled)
        try:
            found.save(service.settings.calibration_file)
        except OSError as error:
            _log.error("the calibration is not stored: %s", error)
            raise not_written("The calibration", error) from None
        return orjson.dumps(document_of(found, 2))

    job = running[0] if running else service.measure(KIND, new_id(), work)
    response = events.of_job(job) if form == EVENTS else json_response(job.summary(), 202)
    response.headers["Location"] = job.address
    return response


@router.delete("", response_class=Response, summary="Stop calibrating", responses=described.STOP)
async def stop(service: TheService) -> Response:
    """Stop the calibration that is under way; an earlier result is kept."""
    running = service.measurements.under_way(KIND)
    if not running:
        raise ProblemError(404, "not-calibrating", "No calibration is under way.")
    job = running[0]
    await job.stop()
    return json_response(job.summary(), 200 if job.finished.is_set() else 202)


@router.get("/events", response_class=Response, summary="Follow a calibration", responses=described.PROGRESS)
async def follow(
    request: Request,
    service: TheService,
    last_event_id: events.LastEventId = None,
) -> Response:
    """Return the progress of the last calibration as server-sent events: `state`, `progress`, and `done` or `error`.

    204: no events are left.
    """
    negotiated(request.headers.get("accept"), (EVENTS,))
    job = service.measurements.last(KIND)
    if job is None:
        raise ProblemError(404, "not-calibrating", "No calibration is under way.")
    return events.of_job(job, events.seen_before(last_event_id, job.mark))
