"""``/v1/scenes:explain``: what a prediction of a scene would do, without solving it."""

from typing import Annotated, Any

import anyio.to_thread
import orjson
from fastapi import APIRouter, Body, Request
from fastapi.responses import Response

from app.http.fields import BadField
from app.http.formats import JSON, negotiated
from app.http.problems import bad_scene
from app.routes import described
from app.routes.body import JsonRoute
from app.schemas import EXAMPLES, PredictionRequest, to_scene
from app.schemas.check import scene_errors
from app.schemas.plan import PlanResponse
from app.service.service import Service, TheService
from dlocore import plan

router = APIRouter(tags=["scenes"], route_class=JsonRoute)


@router.post(
    "/v1/scenes:explain",
    response_model=PlanResponse,
    summary="Explain a scene without solving it",
    responses=described.failures(401, 406, 413, 415, 422, 503),
)
async def explain(
    request: Request, scene: Annotated[PredictionRequest, Body(openapi_examples=EXAMPLES)], service: TheService
) -> Response:
    """Return which effects the scene calls for and why, and which grid and time a solve would take.

    422 names every part of the scene that is wrong, not only the first.
    """
    negotiated(request.headers.get("accept"), (JSON,))
    service.check_ready()
    document = await anyio.to_thread.run_sync(_explained, service, scene)
    return Response(orjson.dumps(document, option=orjson.OPT_SERIALIZE_NUMPY), media_type=JSON)


def _explained(service: Service, request: PredictionRequest) -> dict[str, Any]:
    errors = scene_errors(request, service.motion)
    if errors:
        raise bad_scene([BadField.from_scene_error(error) for error in errors])
    found = plan(to_scene(request, service.motion))
    return {**vars(found), "effects": [vars(effect) for effect in found.effects]}
