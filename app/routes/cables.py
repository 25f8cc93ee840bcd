"""``/v1/cables``: the presets."""

from fastapi import APIRouter
from pydantic import BaseModel, Field

from app.routes import described
from dlocore import PRESETS, Cable

router = APIRouter(prefix="/v1/cables", tags=["cables"])


class CablePreset(BaseModel):
    """A real cable with measured values."""

    name: str = Field(description="Name for `cable.preset`.", examples=["black-wire"])
    source: str = Field(description="Where the values come from.", examples=["measured: weight, and sag over an edge"])
    length: float = Field(description="Length [m].", examples=[1.0])
    diameter: float = Field(description="Diameter [m].", examples=[0.005])
    linear_density: float = Field(description="Mass per length [kg/m].", examples=[0.05])
    bending_stiffness: float = Field(description="Bending stiffness EI [N m^2].", examples=[1e-3])
    axial_stiffness: float = Field(description="Axial stiffness EA [N].", examples=[640.0])
    torsional_stiffness: float = Field(description="Torsional stiffness GJ [N m^2].", examples=[1e-3])
    bending_damping: float = Field(description="Internal damping on the rate of curvature [N m^2 s].", examples=[1e-4])
    axial_damping: float = Field(description="Internal damping on the rate of the axial strain [N s].", examples=[3.6])


class CablePresets(BaseModel):
    """The presets."""

    cables: list[CablePreset] = Field(description="The presets.")


@router.get("", summary="List the cable presets", responses=described.failures(401))
async def presets() -> CablePresets:
    """Return the presets with their sources.

    `cable.preset` in a request names one; other fields of `cable` override its values.
    """
    return CablePresets(
        cables=[
            CablePreset.model_validate({**vars(Cable.preset(name)), "name": name, "source": preset.source})
            for name, preset in PRESETS.items()
        ]
    )
