"""The progress of a prediction or a measurement as server-sent events: its state, each iteration, and its end."""

from typing import Annotated

import orjson
from fastapi import Header, Response

from app.http.formats import EVENTS
from app.http.problems import document_of
from app.http.streamed import Emit, Streamed
from app.service.jobs import Job

LastEventId = Annotated[
    str | None, Header(description="The `id` of the last event received; the events continue after it.", examples=["3"])
]
# nothing may hold events back: no cache, and no buffering proxy
_HEADERS = {"Cache-Control": "no-store", "X-Accel-Buffering": "no", "Vary": "Accept"}
_DIGITS = 9  # most digits of the number of an event
_LAST = 10**_DIGITS - 1  # number of the last event if it is not known how many events came before


def _event(kind: str, data: bytes, number: int | None = None, mark: str = "") -> bytes:
    """Return one event; `data` is JSON, so it has no line breaks. Only after a numbered event can a client continue."""
    numbered = b"" if number is None else f"id: {mark}{number}\n".encode()
    return numbered + f"event: {kind}\ndata: ".encode() + data + b"\n\n"


def _state(id: str, state: str) -> bytes:
    return _event("state", orjson.dumps({"id": id, "state": state}))


def of_job(job: Job, seen: int = 0, *, cancel: bool = False) -> Response:
    """Return the events of a job: states, the iterations after the first `seen`, and `done` or `error`.

    The answer is 204 if no events are left, so that an `EventSource` does not reconnect.

    Args:
        job: the job.
        seen: how many events, other than states, the client already has.
        cancel: whether to cancel the job when the client disconnects.
    """
    if job.finished.is_set() and seen > len(job.iterations):
        return Response(status_code=204, headers=_HEADERS)

    async def produce(emit: Emit) -> None:
        try:
            await _follow(job, seen, emit)
        except BaseException:
            if cancel:
                job.cancel()
            raise

    return Streamed(produce, EVENTS, _HEADERS)


async def _follow(job: Job, seen: int, emit: Emit) -> None:
    async for news in job.progress(seen):
        if news is None:
            await emit(b": still here\n\n")
        elif isinstance(news, str):
            await emit(_state(job.id, news))
        else:
            await emit(_event(job.EVENT, orjson.dumps(news), news["number"], job.mark))
    if job.problem is None:
        await emit(_event("done", job.document or b"", len(job.iterations), job.mark))
    else:
        await emit(_event("error", orjson.dumps(document_of(job.problem)), len(job.iterations), job.mark))


def of_document(document: bytes, seen: int = 0) -> Response:
    """Return the events of a stored run after the first `seen`, the same as those of its job."""
    answer = orjson.loads(document)
    past = [_event("iteration", orjson.dumps(shown), shown["number"]) for shown in answer["iterations"][seen:]]
    return _of_past(answer["id"], past, document, seen, len(answer["iterations"]))


def of_finished(id: str, document: bytes, seen: int = 0) -> Response:
    """Return the events of a measurement that ended before the service was last started, without its progress."""
    return _of_past(id, [], document, seen, _LAST)


def _of_past(id: str, past: list[bytes], document: bytes, seen: int, last: int) -> Response:
    """Return the `past` events and a `done` with the number `last`, or 204 if the client already has that one."""
    if seen > last:
        return Response(status_code=204, headers=_HEADERS)
    pieces = [_state(id, "done"), *past, _event("done", document, last)]
    return Response(b"".join(pieces), media_type=EVENTS, headers=_HEADERS)


def seen_before(last_event_id: str | None, mark: str = "") -> int:
    """Return how many events with a `mark` a client has, by its ``Last-Event-ID``; 0 if that is not such an id."""
    given = (last_event_id or "").strip().removeprefix(mark)
    return int(given) + 1 if given.isascii() and given.isdigit() and len(given) <= _DIGITS else 0
