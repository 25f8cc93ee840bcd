"""The answer of ``/v1/calibration``."""

from typing import Literal

from pydantic import BaseModel, Field

from app.schemas.response import ProblemDocument


class CalibrationPoint(BaseModel):
    """A method on one grid, over the calibration's scenes."""

    method: Literal["march", "spacetime"] = Field(description="How it was solved.", examples=["march"])
    n_u: int = Field(description="Control points along the cable.", examples=[13])
    n_t: int = Field(description="Control points in time.", examples=[19])
    steps: int = Field(description="Time steps of the march.", examples=[95])
    wall_time: float = Field(
        description="Time of a solve without error estimate, on a core of its own; the median [s].", examples=[0.0023]
    )
    spread: float = Field(description="Half the width that holds half of the repeats [s].", examples=[0.0001])
    error: float = Field(description="Largest distance to the converged motion [m].", examples=[4.7e-4])
    iterations: int = Field(description="Iterations of the least squares; 0 for a march.", examples=[0])
    converged: bool = Field(description="Whether every scene was solved.", examples=[True])


class CalibrationResponse(BaseModel):
    """What accuracy costs in time on the machine of the service."""

    machine: dict[str, str] = Field(
        description="Processor, cores, system and versions.", examples=[{"processor": "a processor", "cores": "2"}]
    )
    version: str = Field(description="Version of the program that was measured.", examples=["0.1.0"])
    measured_at: str = Field(description="When, ISO 8601 in UTC.", examples=["2026-01-31T12:00:00Z"])
    duration: float = Field(description="How long the measurement took [s].", examples=[24.3])
    current: bool = Field(
        description="Whether machine and program are still those that were measured.", examples=[True]
    )
    dimensions: int = Field(
        description="Of the motions: 2 in the plane (the paper's four grasps), 3 in space (a hanging cable).",
        examples=[2],
    )
    points: list[CalibrationPoint] = Field(description="What was measured.")
    front: list[int] = Field(
        description="Indices of the points that no other one beats in both time and error, fastest first.",
        examples=[[0, 1, 2]],
    )


class ProgressModel(BaseModel):
    """How far a measurement is."""

    number: int = Field(description="Of this news, from 0.", examples=[12])
    done: int = Field(description="Parts that are done.", examples=[12])
    total: int = Field(description="Parts in all.", examples=[99])
    what: str = Field(description="The part that comes, in words.", examples=["grasp at 0.25 m: march, 13 x 19"])


class MeasurementLinks(BaseModel):
    """Addresses of a measurement, relative to the service."""

    self: str = Field(description="Where the answer is, or will be.", examples=["/v1/calibration"])
    events: str = Field(description="Its progress as server-sent events.", examples=["/v1/calibration/events"])


class MeasurementResponse(BaseModel):
    """A calibration or a study that is under way, or has failed."""

    id: str = Field(description="Its id.", examples=["019b1f5a2c07f3e9d1c5b6a7e8f0"])
    created: str = Field(description="When it was asked for, ISO 8601 in UTC.", examples=["2026-01-31T12:00:00.000Z"])
    state: Literal["queued", "running", "done", "failed", "cancelled"] = Field(
        description="How far it is.", examples=["running"]
    )
    progress: ProgressModel | None = Field(description="The last news of it.")
    problem: ProblemDocument | None = Field(description="Why it failed.")
    links: MeasurementLinks = Field(description="Addresses of its parts.")
