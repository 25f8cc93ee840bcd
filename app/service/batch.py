"""Many predictions in one request, on all workers: each has a line, and an invalid scene does not affect the others."""

import logging
from collections.abc import Collection
from threading import Event
from typing import Any, Literal

import anyio
import anyio.to_thread
import orjson
from pydantic import ValidationError

from app.http.fields import bad_fields
from app.http.problems import ProblemError, bad_scene, document_of, problem_of
from app.http.streamed import Emit
from app.logs import RUN
from app.schemas import PredictionRequest, to_scene
from app.schemas.ids import new_id
from app.service.service import Service
from dlocore import Scene

_log = logging.getLogger("dlo")
AHEAD = 4  # finished lines per worker that may wait for an earlier one


async def predict_all(
    service: Service,
    scenes: list[Any],
    emit: Emit,
    *,
    store: bool,
    like: str | None,
    order: Literal["index", "finished"],
    fields: Collection[str],
) -> None:
    """Predict `scenes` and emit a line of JSON for each; if cancelled, cancel those under way.

    Args:
        service: the service whose workers are used; the batch has been admitted as one request.
        scenes: requests as data, valid or not.
        emit: takes a line; it is awaited, so that a slow client slows the batch down.
        store: whether to keep the runs.
        like: id of a similar run whose grid and error estimate all of them reuse, if any.
        order: "index", in the order of the scenes, or "finished", as they finish.
        fields: the members of `OPTIONAL_FIELDS` that each answer has.
    """
    waiting: dict[int, bytes] = {}
    turn = anyio.Condition()
    following = 0

    async def deliver(index: int, line: bytes) -> None:
        nonlocal following
        async with turn:
            await turn.wait_for(lambda: index < following + AHEAD * service.worker.workers)
            waiting[index] = line
            while following in waiting:
                await emit(waiting.pop(following))
                following += 1
            turn.notify_all()

    indices = iter(range(len(scenes)))
    one_at_a_time = anyio.Lock()

    async def work() -> None:
        for index in indices:
            line = await _line(service, index, scenes[index], store, like, fields)
            if order == "index":
                await deliver(index, line)
            else:
                async with one_at_a_time:
                    await emit(line)

    async with anyio.create_task_group() as tasks:
        for _ in range(min(service.worker.workers, len(scenes))):
            tasks.start_soon(work)


async def _line(
    service: Service, index: int, data: Any, store: bool, like: str | None, fields: Collection[str]
) -> bytes:
    id = new_id()
    RUN.set(id)
    try:
        request, scene = await anyio.to_thread.run_sync(_scene, service, data)
        prediction = await service.solve(scene, Event(), like=like)

        def keep() -> tuple[bytes, bool]:
            return service.keep(prediction, request, orjson.dumps(data), id, store, fields)

        document, _ = await anyio.to_thread.run_sync(keep)
        head = orjson.dumps({"index": index, "status": prediction.status})
        return head[:-1] + b',"result":' + document + b"}\n"
    except Exception as error:
        problem = problem_of(error)
        if problem.status == 500:
            _log.error("the solve failed", exc_info=error)
        return orjson.dumps({"index": index, "status": "failed", "problem": document_of(problem)}) + b"\n"


def _scene(service: Service, data: Any) -> tuple[PredictionRequest, Scene]:
    try:
        request = PredictionRequest.model_validate(data)
    except ValidationError as error:
        raise bad_scene(bad_fields(error.errors(), data)) from None
    return request, to_scene(request, service.motion)


def check_size(count: int, most: int, field: str) -> None:
    """Raise a 413 problem if a batch has more than `most` predictions, one for each entry of `field`."""
    if count > most:
        detail = f"{field}: got {count}. Allowed: at most {most} in one batch. Send them in several batches."
        raise ProblemError(413, "batch-too-large", detail)
