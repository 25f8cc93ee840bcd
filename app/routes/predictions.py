"""``/v1/predictions``: predict, and read back what was predicted."""

from collections.abc import Callable
from typing import Annotated, Any

import anyio.to_thread
import orjson
from fastapi import APIRouter, Body, Query, Request
from fastapi.responses import RedirectResponse, Response

from app.archive import surface_npz
from app.problems import ProblemError
from app.routes.body import JsonRoute, cancelled_when_gone
from app.schemas import EXAMPLES, PredictionList, PredictionRequest, problem_document
from app.service import Service, TheService

NPZ = "application/x-npz"
router = APIRouter(prefix="/v1/predictions", tags=["predictions"], route_class=JsonRoute)
_NOT_FOUND: dict[int | str, dict[str, Any]] = {404: problem_document("There is no such run.")}
_AS_NPZ = {NPZ: {"schema": {"type": "string", "format": "binary"}}}
_PREDICTION = {"$ref": "#/components/schemas/PredictionResponse"}
_FAILURES: dict[int | str, dict[str, Any]] = {
    413: problem_document("The body is too large."),
    415: problem_document("The body is not declared as JSON."),
    422: problem_document("The request is wrong: `errors` names each field, what was given, and what is allowed."),
    429: problem_document("Too many solves are waiting; `Retry-After` says when to try again."),
    503: problem_document("The solver is not ready yet."),
    504: problem_document("The time limit has passed; `prediction` is the address of the best iterate."),
}


@router.post(
    "",
    status_code=201,
    response_class=Response,
    summary="Predict the motion of a cable",
    responses={
        201: {
            "description": "The prediction, stored. As JSON, or as .npz where `Accept` prefers `application/x-npz`.",
            "content": {"application/json": {"schema": _PREDICTION}, **_AS_NPZ},
            "headers": {"Location": {"description": "Address of the prediction.", "schema": {"type": "string"}}},
        },
        **_FAILURES,
    },
)
async def predict(
    request: Request, scene: Annotated[PredictionRequest, Body(openapi_examples=EXAMPLES)], service: TheService
) -> Response:
    """Solve the scene, store the run, and answer with the predicted space-time surface.

    The answer says whether it converged (`status`, `message`), how accurate it is, and what was simulated and why.
    Closing the connection cancels the solve.
    """
    raw = await request.body()
    async with cancelled_when_gone(request) as cancelled:
        id = await service.predict(scene, raw, cancelled)
    response = await _document(service, id, request)
    response.status_code = 201
    response.headers["Location"] = f"/v1/predictions/{id}"
    return response


@router.get("", response_model=PredictionList, summary="List the stored runs, newest first")
async def listed(
    service: TheService,
    limit: Annotated[int, Query(ge=1, le=1000, description="At most so many.")] = 20,
    offset: Annotated[int, Query(ge=0, le=10**9, description="Pass over so many newer ones.")] = 0,
) -> Response:
    """List the stored runs."""
    runs, total = service.runs.page(limit, offset)
    following = offset + limit
    document = {
        "predictions": runs,
        "total": total,
        "limit": limit,
        "offset": offset,
        "next": f"/v1/predictions?limit={limit}&offset={following}" if following < total else None,
    }
    return Response(orjson.dumps(document), media_type="application/json")


@router.get(
    "/{id}",
    response_class=Response,
    summary="Read a stored prediction",
    responses={
        200: {
            "description": "The prediction.",
            "content": {"application/json": {"schema": _PREDICTION}, **_AS_NPZ},
        },
        **_NOT_FOUND,
    },
)
async def read(id: str, request: Request, service: TheService) -> Response:
    """Return the prediction as it was answered."""
    return await _document(service, id, request)


@router.delete("/{id}", status_code=204, summary="Remove a stored run", responses=_NOT_FOUND)
async def remove(id: str, service: TheService) -> Response:
    """Remove the run."""
    if not await anyio.to_thread.run_sync(service.runs.delete, id):
        raise _no_run(id)
    return Response(status_code=204)


@router.get(
    "/{id}/surface.npz",
    response_class=Response,
    summary="The surface for NumPy",
    responses={
        200: {"description": "Arrays of the surface, the spline and the reactions.", "content": _AS_NPZ},
        **_NOT_FOUND,
    },
)
async def surface(id: str, service: TheService) -> Response:
    """Return `u`, `t`, `positions`, `twist`, the spline, and the reactions of the grasps."""
    document = await _part(service.runs.document, id)
    content = await anyio.to_thread.run_sync(_npz, document)
    return _file(content, NPZ, f"{id}.npz")


@router.get(
    "/{id}/recording.rrd",
    response_class=Response,
    summary="The recording for rerun",
    responses={
        200: {"description": "How the solve went and the motion.", "content": {"application/octet-stream": {}}},
        **_NOT_FOUND,
    },
)
async def recording(id: str, service: TheService) -> Response:
    """Return the recording; it is written when first asked for."""
    return _file(await _part(service.runs.recording, id), "application/octet-stream", f"{id}.rrd")


@router.get(
    "/{id}/scene.json",
    response_class=Response,
    summary="The request as it was sent",
    responses={
        200: {"description": "Send it again to repeat the run.", "content": {"application/json": {}}},
        **_NOT_FOUND,
    },
)
async def scene_json(id: str, service: TheService) -> Response:
    """Return the request."""
    return Response(await _part(service.runs.request, id), media_type="application/json")


@router.get(
    "/{id}/viewer",
    status_code=307,
    response_class=RedirectResponse,
    summary="The recording in the browser",
    responses=_NOT_FOUND,
)
async def viewer(id: str, request: Request, service: TheService) -> Response:
    """Redirect to the recording in rerun's web viewer, which this service serves too."""
    if id not in service.runs:
        raise _no_run(id)
    origin = str(request.base_url).rstrip("/")  # the viewer takes whole addresses only
    urls = f"url={origin}/rerun/layout.rbl&url={origin}/v1/predictions/{id}/recording.rrd"
    return RedirectResponse(f"/rerun/?{urls}&renderer=webgl", 307)


async def _document(service: Service, id: str, request: Request) -> Response:
    document = await _part(service.runs.document, id)
    if not prefers_npz(request.headers.get("accept", "")):
        return Response(document, media_type="application/json", headers={"Vary": "Accept"})
    content = await anyio.to_thread.run_sync(_npz, document)
    return Response(content, media_type=NPZ, headers={"Vary": "Accept"})


def prefers_npz(accept: str) -> bool:
    """Return whether an ``Accept`` header ranks .npz above JSON."""
    ranks: dict[str, float] = {}
    for part in accept.lower().split(","):
        media, *parameters = (word.strip() for word in part.split(";"))
        quality = next((p[2:] for p in parameters if p.startswith("q=")), "1")
        try:
            ranks[media] = float(quality)
        except ValueError:
            ranks[media] = 0.0
    return ranks.get(NPZ, 0.0) > ranks.get("application/json", 0.0)


def _npz(document: bytes) -> bytes:
    return surface_npz(orjson.loads(document))


async def _part(read: Callable[[str], bytes | None], id: str) -> bytes:
    content = await anyio.to_thread.run_sync(read, id)
    if content is None:
        raise _no_run(id)
    return content


def _no_run(id: str) -> ProblemError:
    return ProblemError(404, "no-such-run", f"There is no stored run {id[:64]!r}; it may have been removed.")


def _file(content: bytes, media_type: str, name: str) -> Response:
    return Response(content, media_type=media_type, headers={"Content-Disposition": f'attachment; filename="{name}"'})
