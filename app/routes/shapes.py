"""``/v1/shapes:fit``: fit a curve to the points of a cable that a vision system sees."""

from typing import Annotated

import anyio.to_thread
import numpy as np
import orjson
from fastapi import APIRouter, Body, Request
from fastapi.responses import Response

from app.http.formats import JSON, negotiated
from app.routes import described
from app.routes.body import JsonRoute
from app.schemas.convert import check_columns
from app.schemas.fit import FIT_EXAMPLES, FitRequest, FitResponse
from dlocore.shape.cloud import fit_cloud
from dlocore.spline import DEGREE

router = APIRouter(tags=["shapes"], route_class=JsonRoute)


@router.post(
    "/v1/shapes:fit",
    response_model=FitResponse,
    summary="Fit a spline to points of a cable",
    responses=described.failures(401, 406, 413, 415, 422),
)
async def fit(request: Request, seen: Annotated[FitRequest, Body(openapi_examples=FIT_EXAMPLES)]) -> Response:
    """Fit a cubic spline in arclength to points, ordered or not, and return how far they are from it.

    `shape` of the answer can be used as the `shape` of a prediction. Points that branch, cross or lie in several parts
    are refused, because they show no single cable.
    """
    negotiated(request.headers.get("accept"), (JSON,))
    return Response(await anyio.to_thread.run_sync(_fitted, seen), media_type=JSON)


def _fitted(seen: FitRequest) -> bytes:
    check_columns("points", seen.points)
    found = fit_cloud(
        seen.points,
        ordered=seen.ordered,
        length=seen.length,
        start=None if seen.start is None else np.array(seen.start),
        remove_outliers=seen.outliers == "remove",
    )
    curve = found.curve
    document = {
        "control_points": curve.control_points,
        "knots": curve.knots,
        "degree": DEGREE,
        "length": float(curve.knots[-1]),
        "measured_length": found.measured_length,
        "fit_error": {"rms": curve.fit_rms, "max": curve.fit_max},
        "order": found.order.tolist(),
        "outliers": found.outliers.tolist(),
        "shape": {"kind": "control_points", "control_points": curve.control_points, "knots": curve.knots},
    }
    return orjson.dumps(document, option=orjson.OPT_SERIALIZE_NUMPY)
