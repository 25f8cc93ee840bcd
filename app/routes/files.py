"""The parts of a stored run: its surface, its recording, its request, and the viewer that opens it."""

import anyio.to_thread
from fastapi import APIRouter, Request
from fastapi.responses import RedirectResponse, Response

from app.http.formats import JSON, NPZ, as_npz
from app.http.problems import not_written
from app.routes import described
from app.routes.predictions import part
from app.service.service import TheService

_ANY = "application/octet-stream"
router = APIRouter(prefix="/v1/predictions/{id}", tags=["predictions"])


@router.get(
    "/surface.npz",
    response_class=Response,
    summary="The surface for NumPy",
    responses=described.a_file("Arrays of the surface, the spline, the reactions, and what the cable remembers.", NPZ),
)
async def surface(id: str, service: TheService) -> Response:
    """Return the surface: `u`, `t`, `positions`, `twist`, the spline, the reactions, and what the cable remembers."""
    document = await part(service, service.document, id)

    def npz() -> bytes:
        return as_npz(document, service.material(id))

    return _file(await anyio.to_thread.run_sync(npz), NPZ, f"{id}.npz")


@router.get(
    "/recording.rrd",
    response_class=Response,
    summary="The recording for rerun",
    responses={**described.a_file("How the solve went and the motion.", _ANY), **described.failures(507)},
)
async def recording(id: str, service: TheService) -> Response:
    """Return the recording; it is written at the first request."""
    try:
        content = await part(service, service.runs.recording, id)
    except OSError as error:
        raise not_written("The recording", error) from None
    return _file(content, _ANY, f"{id}.rrd")


@router.get(
    "/scene.json",
    response_class=Response,
    summary="The request as it was sent",
    responses=described.a_file("The request, which can be sent again to repeat the run.", JSON),
)
async def scene_json(id: str, service: TheService) -> Response:
    """Return the request as it was sent."""
    return Response(await part(service, service.runs.request, id), media_type=JSON)


@router.get(
    "/viewer",
    status_code=307,
    response_class=RedirectResponse,
    summary="The recording in the browser",
    responses=described.failures(401, 404, 409),
)
async def viewer(id: str, request: Request, service: TheService) -> Response:
    """Redirect to the recording in rerun's web viewer, which this service also serves."""
    await part(service, service.runs.document, id)
    origin = str(request.base_url).rstrip("/")  # the viewer takes only absolute addresses
    urls = f"url={origin}/rerun/layout.rbl&url={origin}/v1/predictions/{id}/recording.rrd"
    return RedirectResponse(f"/rerun/?{urls}&renderer=webgl", 307)


def _file(content: bytes, media_type: str, name: str) -> Response:
    return Response(content, media_type=media_type, headers={"Content-Disposition": f'attachment; filename="{name}"'})
