"""``/v1/cables:identify``: the parameters of a cable from recordings of it."""

import math
import time
from collections.abc import Callable
from threading import Event
from typing import Annotated

import anyio
import anyio.from_thread
import anyio.to_thread
import numpy as np
import orjson
from fastapi import APIRouter, Body, Request
from fastapi.responses import Response

from app.http.formats import EVENTS, JSON, negotiated
from app.http.problems import ProblemError, document_of, problem_of
from app.http.streamed import Emit, Streamed
from app.reports.identification import document_of_identification
from app.routes import described
from app.routes.body import JsonRoute, calling_when_gone
from app.schemas.identify import IdentifyRequest, IdentifyResponse
from app.service.service import Service
from app.service.worker import Worker
from dlocore import Cancelled
from dlocore.errors import SceneError, within
from dlocore.recordings import Recording, recording_of

router = APIRouter(tags=["cables"], route_class=JsonRoute)
_WAITING = 8  # identifications that may wait for the one that runs
Show = Callable[[bytes], None]
_one_at_a_time = anyio.CapacityLimiter(1)


@router.post(
    "/v1/cables:identify",
    response_model=IdentifyResponse,
    summary="Identify a cable from recordings",
    responses={
        **described.failures(401, 406, 413, 415, 422, 429, 503, 504),
        200: {"description": "The cable; or the course as server-sent events.", "content": {EVENTS: {}}},
    },
)
async def identify(request: Request, asked: Annotated[IdentifyRequest, Body()]) -> Response:
    """Find the parameters with which predictions meet recordings best, with 95 % intervals.

    With `Accept: text/event-stream` the answer is a course of events: `iteration` with the values so far, and `done`
    with the answer or `error` with the problem. Takes seconds to minutes; one runs at a time, and ends with 504 at the
    time limit of the service (`DLO_TIME_LIMIT`).
    """
    form = negotiated(request.headers.get("accept"), (JSON, EVENTS))
    recordings = _recordings(asked)
    service: Service = request.app.state.service
    if _one_at_a_time.statistics().tasks_waiting >= _WAITING:
        raise ProblemError(429, "queue-full", "Too many identifications are waiting.", headers={"Retry-After": "30"})
    search = _Search(asked, recordings, service.worker)
    if form == EVENTS:
        return Streamed(search.course, EVENTS, {"Cache-Control": "no-store", "X-Accel-Buffering": "no"})
    async with calling_when_gone(request, search.cancelled.set):
        return Response(await search.result(), media_type=JSON)


class _Search:
    """One identification, run in a thread."""

    def __init__(self, asked: IdentifyRequest, recordings: list[Recording], worker: Worker) -> None:
        self.asked, self.recordings, self.worker = asked, recordings, worker
        self.cancelled = Event()
        self.ends = math.inf

    async def course(self, emit: Emit) -> None:
        """Emit the events."""
        try:

            async def send(data: bytes) -> None:
                await emit(b"event: iteration\ndata: " + data + b"\n\n")

            def show(data: bytes) -> None:
                anyio.from_thread.run(send, data)

            answer = await self.result(show)
            await emit(b"event: done\ndata: " + answer + b"\n\n")
        except (ProblemError, SceneError) as error:
            await emit(b"event: error\ndata: " + orjson.dumps(document_of(problem_of(error))) + b"\n\n")

    async def result(self, show: Show | None = None) -> bytes:
        """Return the answer as JSON."""
        try:
            with self.worker.stoppable(self.cancelled):
                return await anyio.to_thread.run_sync(self._run, show, abandon_on_cancel=True, limiter=_one_at_a_time)
        except Cancelled:
            if time.monotonic() < self.ends:
                raise ProblemError(503, "cancelled", "The identification was cancelled.") from None
            detail = (
                f"The identification took longer than the limit of {self.worker.time_limit:g} s. Send fewer windows."
            )
            raise ProblemError(504, "time-limit", detail) from None

    def _run(self, show: Show | None) -> bytes:
        from dlocore.identify import Progress, Resolution
        from dlocore.identify import identify as find

        self.ends = time.monotonic() + self.worker.time_limit

        def on_progress(progress: Progress) -> None:
            if show is not None:
                show(orjson.dumps(vars(progress)))

        def stop() -> bool:
            return self.cancelled.is_set() or time.monotonic() > self.ends

        try:
            found = find(
                self.recordings,
                names=tuple(self.asked.parameters),
                resolution=Resolution(n_u=self.asked.n_u),
                on_progress=on_progress,
                cancelled=stop,
            )
        except SceneError:
            raise
        except (ValueError, ArithmeticError, np.linalg.LinAlgError) as error:  # of scales that no arithmetic holds
            allowed = "a cable of usual size, moved by what holds it"
            raise SceneError("recordings", "markers", allowed, "They can't be replayed") from error
        return orjson.dumps(document_of_identification(found), option=orjson.OPT_SERIALIZE_NUMPY)


def _recordings(asked: IdentifyRequest) -> list[Recording]:
    out = []
    for i, given in enumerate(asked.recordings):
        with within(f"recordings[{i}]"):
            width = next((len(m) for frame in given.markers for m in frame if m is not None), 3)
            count = len(given.markers[0])
            markers = np.full((len(given.markers), count, width), np.nan)
            for k, frame in enumerate(given.markers):
                if len(frame) != count:
                    raise SceneError(f"markers[{k}]", f"{len(frame)} markers", f"{count}, as in the first frame")
                for m, marker in enumerate(frame):
                    if marker is not None and len(marker) != width:
                        raise SceneError(f"markers[{k}][{m}]", marker, f"{width} coordinates, as in the first")
                    if marker is not None:
                        markers[k, m] = marker
            facts = given.model_dump(exclude={"times", "markers"}, exclude_none=True)
            out.append(recording_of(np.array(given.times), markers, facts))
    return out
