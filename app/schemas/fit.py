"""The request and the answer of ``POST /v1/shapes:fit``."""

from typing import Annotated, Any, Literal

from fastapi.openapi.models import Example
from pydantic import BaseModel, Field

from app.schemas.base import Flag, Model, Number
from dlocore.scene.cable import MAX_LENGTH, MIN_LENGTH

Coordinate = Annotated[Number, Field(ge=-1e5, le=1e5)]  # [m]
Seen = Annotated[list[Coordinate], Field(min_length=2, max_length=3)]


class FitRequest(Model):
    """Points of a cable as a vision system sees them: noisy, unevenly spaced, with outliers, 2D or 3D."""

    points: list[Seen] = Field(
        min_length=4,
        max_length=100_000,
        description="Points [m], all 2D (z = 0) or all 3D; at most 20,000 if they are not in order.",
        examples=[[[0.02, 0.01], [0.24, 0.05], [0.47, -0.03], [0.74, 0.13]]],
    )
    ordered: Flag = Field(default=True, description="Whether the points are in order along the cable.", examples=[True])
    length: Number | None = Field(
        default=None,
        ge=MIN_LENGTH,
        le=MAX_LENGTH,
        description="Length of the cable [m], and so of the curve; absent: the length that the points show.",
        examples=[0.8],
    )
    start: Annotated[list[Coordinate], Field(min_length=3, max_length=3)] | None = Field(
        default=None,
        description="A point near the cable's end at u = 0 [m], for points that are not in order; absent: the end with "
        "the smaller x.",
        examples=[[0.02, 0.01, 0.0]],
    )
    outliers: Literal["remove", "keep"] = Field(
        default="remove", description="What to do with points that do not belong to the cable.", examples=["remove"]
    )


class FitErrorModel(BaseModel):
    """Distances of the points from the curve."""

    rms: float = Field(description="Root mean square [m].", examples=[0.0012])
    max: float = Field(description="Largest distance [m].", examples=[0.0031])


class FitResponse(BaseModel):
    """A cubic spline in arclength through the points."""

    control_points: list[list[float]] = Field(description="Control points [n][3] [m].", examples=[[[0.0, 0.0, 0.0]]])
    knots: list[float] = Field(description="Clamped knots (n + 4) from 0 to the length [m].", examples=[[0.0, 0.8]])
    degree: int = Field(description="Degree of the spline.", examples=[3])
    length: float = Field(description="Length of the spline [m].", examples=[0.8])
    measured_length: float = Field(description="Length that the points show [m].", examples=[0.795])
    fit_error: FitErrorModel = Field(description="Distances of the points from the curve.")
    order: list[int] = Field(description="Indices of the points in order along the cable.", examples=[[0, 1, 2, 3]])
    outliers: list[int] = Field(description="Indices of the points that were left out as outliers.", examples=[[]])
    shape: dict[str, Any] = Field(
        description="The curve as the `shape` of a request.",
        examples=[{"kind": "control_points", "control_points": [[0.0, 0.0, 0.0]], "knots": [0.0, 0.8]}],
    )


_SEEN = [[0.02, 0.01], [0.13, 0.06], [0.24, 0.05], [0.36, -0.01], [0.47, -0.03], [0.58, 0.02], [0.68, 0.09]]
_CLOUD = [
    [0.47, 0.03],
    [0.61, 0.11],
    [0.16, 0.11],
    [0.3, 0.6],
    [0.52, 0.06],
    [0.38, -0.01],
    [0.56, 0.09],
    [0.7, 0.09],
    [0.07, 0.09],
    [0.11, 0.11],
    [0.65, 0.11],
    [0.02, 0.06],
    [0.43, 0.0],
    [0.2, 0.08],
    [0.34, 0.0],
    [0.29, 0.02],
    [0.25, 0.05],
]
FIT_EXAMPLES: dict[str, Example] = {
    "ordered": {"summary": "Points in order along a cable of known length", "value": {"points": _SEEN, "length": 0.73}},
    "cloud": {
        "summary": "Points that are not in order, one of which does not belong to the cable",
        "value": {"points": _CLOUD, "ordered": False},
    },
}
