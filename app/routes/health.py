"""``/health``, ``/ready`` and ``/metrics``, for monitoring."""

from typing import Literal

from fastapi import APIRouter, Request, Response
from pydantic import BaseModel, Field

from app.routes import described
from app.schemas import problem_document
from app.service import metrics
from app.service.service import TheService

router = APIRouter(tags=["service"])


class Health(BaseModel):
    """The process answers."""

    status: Literal["ok"] = "ok"
    calibrated: bool = Field(description="Whether `GET /v1/calibration` has a result.", examples=[False])


class Ready(BaseModel):
    """The solver is compiled."""

    status: Literal["ready"] = "ready"


@router.get("/health", summary="Is the process alive?")
async def health(request: Request) -> Health:
    """Answer as long as the process is alive."""
    return Health(calibrated=request.app.state.settings.calibration_file.exists())


@router.get("/ready", summary="Can it solve?", responses={503: problem_document("The solver is still being compiled.")})
async def ready(service: TheService) -> Ready:
    """Answer once the solver is compiled."""
    service.check_ready()
    return Ready()


@router.get(
    "/metrics",
    response_class=Response,
    summary="Counters for Prometheus",
    responses={
        200: {"description": "Prometheus text format.", "content": {"text/plain": {"schema": {"type": "string"}}}},
        **described.failures(401),
    },
)
async def counters(service: TheService) -> Response:
    """Return solves by status and method, iterations, solve times, the queue, the stored runs, and the process."""
    return Response(service.metrics.text(), media_type=metrics.MEDIA_TYPE)
