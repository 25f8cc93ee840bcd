"""``/v1/cables:identify``: the parameters of a cable from recordings of it."""

from collections.abc import Callable
from threading import Event
from typing import Annotated

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
from app.schemas.convert import cable_of
from app.schemas.identify import IdentifyRequest, IdentifyResponse
from app.service.searches import Searches
from app.service.service import TheService
from dlocore import Cable
from dlocore.errors import SceneError, within
from dlocore.identify import Identification, Progress, Resolution
from dlocore.recordings import Recording, recording_of

router = APIRouter(tags=["cables"], route_class=JsonRoute)


@router.post(
    "/v1/cables:identify",
    response_model=IdentifyResponse,
    summary="Identify a cable from recordings",
    responses={
        **described.failures(401, 406, 413, 415, 422, 429, 503, 504),
        200: {"description": "The cable; or the progress as server-sent events.", "content": {EVENTS: {}}},
    },
)
async def identify(request: Request, asked: Annotated[IdentifyRequest, Body()], service: TheService) -> Response:
    """Find the parameters with which predictions fit the recordings best, with 95 % intervals.

    With `Accept: text/event-stream` the answer is a stream of events: `iteration` with the values so far, and finally
    `done` with the answer or `error` with the problem. An identification takes seconds to minutes. One runs at a time.
    At the time limit of the service (`DLO_TIME_LIMIT`) it ends with 504.
    """
    form = negotiated(request.headers.get("accept"), (JSON, EVENTS))
    recordings = await anyio.to_thread.run_sync(_recordings, asked)
    with within("cable"):
        cable = None if asked.cable is None else cable_of(asked.cable)
    service.searches.check_room()
    search = _Search(asked, recordings, cable, service.searches)
    if form == EVENTS:
        return Streamed(search.course, EVENTS, {"Cache-Control": "no-store", "X-Accel-Buffering": "no"})
    async with calling_when_gone(request, search.cancelled.set):
        return Response(await search.result(), media_type=JSON)


class _Search:
    """One identification: its answer, or its events."""

    def __init__(
        self, asked: IdentifyRequest, recordings: list[Recording], cable: Cable | None, searches: Searches
    ) -> None:
        self.asked, self.recordings, self.cable, self.searches = asked, recordings, cable, searches
        self.cancelled = Event()

    async def course(self, emit: Emit) -> None:
        """Emit the events."""
        try:

            async def send(data: bytes) -> None:
                await emit(b"event: iteration\ndata: " + data + b"\n\n")

            def show(progress: Progress) -> None:
                anyio.from_thread.run(send, orjson.dumps(vars(progress)))

            answer = await self.result(show)
            await emit(b"event: done\ndata: " + answer + b"\n\n")
        except (ProblemError, SceneError) as error:
            await emit(b"event: error\ndata: " + orjson.dumps(document_of(problem_of(error))) + b"\n\n")

    async def result(self, show: Callable[[Progress], None] | None = None) -> bytes:
        """Return the answer as JSON."""
        try:
            found = await self.searches.identify(
                self.recordings,
                self.cancelled.is_set,
                cable=self.cable,
                names=tuple(self.asked.parameters),
                resolution=Resolution(n_u=self.asked.n_u),
                on_progress=show,
            )
        except SceneError as error:
            raise _by_number(error, self.recordings) from None
        return await anyio.to_thread.run_sync(_answer, found)


def _answer(found: Identification) -> bytes:
    return orjson.dumps(document_of_identification(found), option=orjson.OPT_SERIALIZE_NUMPY)


def _by_number(error: SceneError, recordings: list[Recording]) -> SceneError:
    """Return the error with the path that the field has in the request: by number of the recording, not by name."""
    places = {recording.place: f"recordings[{i}]" for i, recording in enumerate(recordings)}
    place = next((place for place in places if error.field.startswith(place)), None)
    field = error.field if place is None else places[place] + error.field.removeprefix(place)
    return SceneError(field, error.given, error.allowed, error.reason)


def _recordings(asked: IdentifyRequest) -> list[Recording]:
    out: list[Recording] = []
    for i, given in enumerate(asked.recordings):
        with within(f"recordings[{i}]"):
            name = f"recordings[{i}]" if given.name is None else given.name
            if name in [recording.name for recording in out]:
                raise SceneError("name", name, "a name that no other recording has")
            if len(given.markers) != len(given.times):
                raise SceneError("markers", f"{len(given.markers)} frames", f"{len(given.times)}, one for each time")
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
            out.append(recording_of(np.array(given.times), markers, {**facts, "name": name}))
    return out
