"""The answer of ``POST /v1/scenes:explain``."""

from pydantic import BaseModel, Field

from app.schemas.response import EffectModel


class PlanResponse(BaseModel):
    """What a prediction of a scene would do."""

    dimensions: int = Field(description="2 if the motion is planar, otherwise 3.", examples=[2])
    reason: str = Field(
        description="Why the motion has so many dimensions, in words.", examples=["all lies in one plane"]
    )
    effects: list[EffectModel] = Field(description="Which effects the scene calls for, and why.")
    method: str = Field(description="Method that would solve it.", examples=["march"])
    n_u: int = Field(description="Control points along the cable.", examples=[25])
    n_t: int = Field(description="Control points in time.", examples=[33])
    steps: int = Field(description="Time steps of the march.", examples=[160])
    expected_time: float = Field(
        description="Time that a solve would take, to an order of magnitude [s].", examples=[0.02]
    )
