"""``/v1/predictions:batch``: many predictions in one request."""

from typing import Annotated

from fastapi import APIRouter, Body, Request
from fastapi.responses import Response

from app.http.formats import LINES, negotiated
from app.http.streamed import Emit, Streamed
from app.routes import described
from app.routes.body import JsonRoute
from app.schemas.batch import BATCH_EXAMPLES, BatchRequest
from app.service.batch import check_size, predict_all
from app.service.service import TheService

router = APIRouter(tags=["predictions"], route_class=JsonRoute)
_LINE = {"schema": {"$ref": "#/components/schemas/BatchLine"}}  # of each line, which OpenAPI 3.1 can't express


@router.post(
    "/v1/predictions:batch",
    response_class=Response,
    summary="Predict many scenes",
    responses={
        200: {"description": "JSON lines. The schema `BatchLine` describes each line.", "content": {LINES: _LINE}},
        **described.failures(401, 404, 406, 409, 413, 415, 422, 429, 503),
    },
)
async def batch(
    request: Request, wanted: Annotated[BatchRequest, Body(openapi_examples=BATCH_EXAMPLES)], service: TheService
) -> Response:
    """Predict many scenes, or one scene with many primitives, on all cores.

    The answer is a stream of JSON lines. An invalid scene gives a line with its problem and does not affect the others.
    Closing the connection cancels the rest. The runs are only stored with `store`.
    """
    negotiated(request.headers.get("accept"), (LINES,))
    scenes = wanted.scenes()
    check_size(len(scenes), service.settings.max_batch, wanted.field)
    service.check_ready()
    await service.check_known(wanted.root.like)
    service.worker.admit()

    async def produce(emit: Emit) -> None:
        try:
            asked = wanted.root
            await predict_all(
                service, scenes, emit, store=asked.store, like=asked.like, order=asked.order, fields=asked.fields
            )
        finally:
            service.worker.release()

    return Streamed(produce, LINES, {"X-Accel-Buffering": "no"})
