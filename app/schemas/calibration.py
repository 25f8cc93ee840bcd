"""The answer of ``/v1/calibration``."""

from typing import Literal

from pydantic import BaseModel, Field

from app.schemas.response import ProblemDocument


class CalibrationPoint(BaseModel):
    """One method on one grid, measured over the scenes of the calibration."""

    method: Literal["march", "spacetime", "auto"] = Field(
        description="How it was solved; `auto` is the default quality, which chooses its own grids.", examples=["march"]
    )
    n_u: int = Field(description="Control points along the cable; of `auto` the most of the scenes.", examples=[13])
    n_t: int = Field(description="Control points in time; of `auto` the most of the scenes.", examples=[19])
    steps: int = Field(description="Time steps of the march.", examples=[95])
    wall_time: float = Field(
        description="Median time of a solve on a core of its own [s]; only `auto` includes its error estimate.",
        examples=[0.0023],
    )
    spread: float = Field(description="Median absolute deviation of the repeats [s].", examples=[0.0001])
    error: float = Field(description="Largest distance to the converged motion [m].", examples=[4.7e-4])
    iterations: int = Field(description="Iterations of the least squares; 0 for a march.", examples=[0])
    converged: bool = Field(description="Whether every scene was solved.", examples=[True])


class CalibrationResponse(BaseModel):
    """What accuracy costs in time on the machine of the service."""

    machine: dict[str, str] = Field(
        description="Processor, cores, system and versions.", examples=[{"processor": "a processor", "cores": "2"}]
    )
    version: str = Field(description="Version of the program that was measured.", examples=["0.1.0"])
    measured_at: str = Field(description="When it was measured, ISO 8601 in UTC.", examples=["2026-01-31T12:00:00Z"])
    duration: float = Field(description="How long the measurement took [s].", examples=[24.3])
    current: bool = Field(
        description="Whether the machine and the program are still those that were measured.", examples=[True]
    )
    dimensions: int = Field(
        description="Dimensions of the motions: 2, in the plane (the paper's four grasps), or 3, in space (a hanging "
        "cable).",
        examples=[2],
    )
    points: list[CalibrationPoint] = Field(description="What was measured.")
    front: list[int] = Field(
        description="Indices of the points that no other point beats in both time and error, fastest first.",
        examples=[[0, 1, 2]],
    )
    default: CalibrationPoint | None = Field(
        description="What a scene without a `quality` takes and reaches; null where it was not measured yet.",
        examples=[None],
    )


class ProgressModel(BaseModel):
    """Progress of a measurement."""

    number: int = Field(description="Number of this progress report, from 0.", examples=[12])
    done: int = Field(description="Number of parts that are done.", examples=[12])
    total: int = Field(description="Number of parts in total.", examples=[99])
    what: str = Field(description="The next part, in words.", examples=["grasp at 0.25 m: march, 13 x 19"])


class MeasurementLinks(BaseModel):
    """Addresses of a measurement, relative to the service."""

    self: str = Field(description="Where the answer is or will be.", examples=["/v1/calibration"])
    events: str = Field(description="Its progress as server-sent events.", examples=["/v1/calibration/events"])


class MeasurementResponse(BaseModel):
    """The state of a calibration or a study."""

    id: str = Field(description="Id of the calibration or study.", examples=["019b1f5a2c07f3e9d1c5b6a7e8f0"])
    created: str = Field(description="When it was requested, ISO 8601 in UTC.", examples=["2026-01-31T12:00:00.000Z"])
    state: Literal["queued", "running", "done", "failed", "cancelled"] = Field(
        description="Its state.", examples=["running"]
    )
    progress: ProgressModel | None = Field(description="The latest progress.")
    problem: ProblemDocument | None = Field(description="Why it failed or was cancelled.")
    links: MeasurementLinks = Field(description="Its addresses.")
