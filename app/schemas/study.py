"""The request of ``POST /v1/studies``, and its answers."""

from typing import Annotated, Any, Literal

from fastapi.openapi.models import Example
from pydantic import BaseModel, Field

from app.schemas.base import Count, Flag, Model, Number
from app.schemas.calibration import MeasurementLinks
from app.schemas.request import PAPER, PredictionRequest
from app.schemas.surroundings import EffectsModel
from dlocore.scene.scene import MAX_N_T, MAX_N_U
from dlocore.study.plan import GRIDS, MAX_REPEATS, Judge
from dlocore.study.record import Part

NAME = Annotated[str, Field(min_length=1, max_length=200)]


class GridModel(Model):
    """Control points along the cable and in time."""

    n_u: Count = Field(ge=5, le=MAX_N_U, description="Control points along the cable.", examples=[9])
    n_t: Count = Field(ge=5, le=MAX_N_T, description="Control points in time.", examples=[13])


class StudyRequest(Model):
    """Scenes over grids, thresholds, methods and sets of effects."""

    scenes: dict[NAME, PredictionRequest] | None = Field(
        default=None,
        max_length=64,
        min_length=1,
        description="Scenes by name, as for `POST /v1/predictions`; their `quality` is ignored. "
        "Absent: the paper's four grasps and a hanging cable.",
        examples=[{"a quarter": PAPER}],
    )
    grids: list[GridModel] = Field(
        default=[GridModel(n_u=n_u, n_t=n_t) for n_u, n_t in GRIDS],
        min_length=1,
        max_length=100,
        description="Grids.",
        examples=[[{"n_u": 9, "n_t": 13}, {"n_u": 17, "n_t": 25}]],
    )
    methods: list[Literal["march", "spacetime", "paper"]] = Field(
        default=["march", "spacetime"], min_length=1, max_length=3, description="Methods.", examples=[["march"]]
    )
    deltas: list[Annotated[Number, Field(ge=1e-10, le=1e-2)]] = Field(
        default=[1e-5],
        min_length=1,
        max_length=20,
        description="Thresholds on the update of a least squares [m]; a march has none.",
        examples=[[1e-5]],
    )
    effects: dict[NAME, EffectsModel] | None = Field(
        default=None,
        min_length=1,
        max_length=20,
        description="Sets of effects by name, which replace those of the scenes. Absent: those of the scenes.",
        examples=[{"chosen": {}, "all but twist": {"twist": "off"}}],
    )
    repeats: Count = Field(
        default=5, ge=1, le=MAX_REPEATS, description="Largest number of timed calls of each solve.", examples=[5]
    )
    estimate: Flag = Field(default=False, description="Whether the solves also estimate their error.", examples=[False])
    judge: Judge = Field(
        default="march",
        description="The solution that errors are distances to: `march`, the solver's own march, refined until it no "
        "longer changes; or `reference`, the independent step-by-step simulation, which takes from a second to minutes "
        "per scene.",
        examples=["march"],
    )
    parts: list[Part] = Field(
        default=["runs"],
        min_length=1,
        max_length=3,
        description="`runs`: the scenes; `scaling`: cost over the size of a problem; `effects`: cost of each effect.",
        examples=[["runs"]],
    )


class StepModel(BaseModel):
    """An iteration of a solve."""

    update: float | None = Field(description="Norm of the update [m].", examples=[1e-4])
    residual: float | None = Field(description="Residual of the equations.", examples=[2e-5])
    wall_time: float = Field(description="Time since the solve began [s].", examples=[0.002])


class StudyRun(BaseModel):
    """One scene solved by one method on one grid."""

    scene: str = Field(description="Name of the scene.", examples=["a quarter"])
    effects: str = Field(description="Name of the set of effects.", examples=["auto"])
    method: str = Field(description="How it was solved.", examples=["march"])
    n_u: int = Field(description="Control points along the cable.", examples=[9])
    n_t: int = Field(description="Control points in time.", examples=[13])
    delta: float = Field(description="Threshold on the update [m].", examples=[1e-5])
    dimensions: int = Field(description="Dimensions of the motion.", examples=[2])
    steps: int = Field(description="Time steps of the march.", examples=[65])
    status: str = Field(description="Status of the prediction.", examples=["converged"])
    wall_time: float = Field(description="Median time of a solve on a core of its own [s].", examples=[0.0018])
    spread: float = Field(description="Median absolute deviation of the repeats [s].", examples=[0.0001])
    repeats: int = Field(description="Number of timed calls.", examples=[5])
    error: float = Field(description="Largest distance to the truth [m].", examples=[1.4e-3])
    rms: float = Field(description="Root mean square distance to the truth [m].", examples=[4e-4])
    truth_error: float | None = Field(description="Approximate error of the truth itself [m].", examples=[1e-5])
    estimate: float | None = Field(description="Error estimate of the prediction [m].", examples=[1.9e-3])
    iterations: list[StepModel] = Field(description="How the solve went.")
    phases: dict[str, float] = Field(description="Time by phase [s].", examples=[{"march": 0.001}])
    active: list[str] = Field(description="The effects that were simulated.", examples=[["inertia", "bend"]])


class ScaledModel(BaseModel):
    """The time of a solve at one size of a problem."""

    variable: Literal["n_u", "n_u in space", "n_t", "horizon", "grasps"] = Field(
        description="The size that varies.", examples=["n_u"]
    )
    value: float = Field(description="Its value.", examples=[25])
    method: str = Field(description="How it was solved.", examples=["march"])
    wall_time: float = Field(description="Time of a march, or of an iteration [s].", examples=[0.003])
    spread: float = Field(description="Median absolute deviation of the repeats [s].", examples=[0.0001])


class EffectCostModel(BaseModel):
    """The time of a march with and without an effect."""

    effect: str = Field(description="Name of the effect.", examples=["friction"])
    present: float = Field(description="Time with it [s].", examples=[0.006])
    absent: float = Field(description="Time without it [s].", examples=[0.004])


class StudyResponse(BaseModel):
    """What a study measured."""

    id: str = Field(description="Id of the study.", examples=["019b1f5a2c07f3e9d1c5b6a7e8f0"])
    state: Literal["done"] | None = Field(
        default=None,
        description="The study has a result. Absent, like `created`, for a study that was stored before these fields "
        "existed.",
        examples=["done"],
    )
    created: str | None = Field(
        default=None, description="When it was requested, ISO 8601 in UTC.", examples=["2026-01-31T12:00:00.000Z"]
    )
    format: int = Field(
        description="Version of this format; `dlo study --compare` reads a file of this document.", examples=[1]
    )
    machine: dict[str, str] = Field(description="Processor, cores, system and versions.", examples=[{"cores": "2"}])
    source: str = Field(description="Fingerprint of the source code that was measured.", examples=["0123456789ab"])
    measured_at: str = Field(description="When it was measured, ISO 8601 in UTC.", examples=["2026-01-31T12:00:00Z"])
    duration: float = Field(description="How long it took [s].", examples=[42.0])
    judge: str = Field(description="The solution that the errors are distances to.", examples=["march"])
    runs: list[StudyRun] = Field(description="What was measured.")
    refused: list[str] = Field(description="Runs that the solver refused, and why.", examples=[[]])
    scaling: list[ScaledModel] = Field(description="Cost over the size of a problem.")
    effects: list[EffectCostModel] = Field(description="Cost of each effect.")


class StudySummary(BaseModel):
    """A study, as an item of a list."""

    id: str = Field(description="Id of the study.", examples=["019b1f5a2c07f3e9d1c5b6a7e8f0"])
    created: str = Field(description="When it was requested, ISO 8601 in UTC.", examples=["2026-01-31T12:00:00.000Z"])
    state: Literal["queued", "running", "done", "failed", "cancelled"] = Field(
        description="Its state.", examples=["running"]
    )
    links: MeasurementLinks = Field(description="Its addresses.")
    size: int | None = Field(description="Stored bytes; null if nothing is stored.", examples=[20000])


class StudyList(BaseModel):
    """The studies, newest first."""

    studies: list[StudySummary] = Field(description="The studies.")


_QUICK: dict[str, Any] = {
    "scenes": {"grasped at a quarter": PAPER},
    "grids": [{"n_u": 9, "n_t": 13}, {"n_u": 13, "n_t": 19}],
    "repeats": 3,
}
STUDY_EXAMPLES: dict[str, Example] = {
    "quick": {"summary": "The paper's Fig. 1 on two grids by both methods", "value": _QUICK},
    "standard": {"summary": "The standard scenes and grids", "value": {}},
}
