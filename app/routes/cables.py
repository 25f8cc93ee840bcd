"""``/v1/cables``: the presets."""

from fastapi import APIRouter
from pydantic import BaseModel, Field

from dlocore import PRESETS, Cable

router = APIRouter(prefix="/v1/cables", tags=["cables"])


class CablePreset(BaseModel):
    """A real cable with measured values."""

    name: str = Field(description="For `cable.preset`.", examples=["black-wire"])
    source: str = Field(description="Where the values come from.")
    length: float = Field(description="Length [m].")
    diameter: float = Field(description="Diameter [m].")
    linear_density: float = Field(description="Mass per length [kg/m].")
    bending_stiffness: float = Field(description="EI [N m^2].")
    axial_stiffness: float = Field(description="EA [N].")
    torsional_stiffness: float = Field(description="GJ [N m^2].")
    bending_damping: float = Field(description="Internal damping on the rate of curvature [N m^2 s].")


class CablePresets(BaseModel):
    """The presets."""

    cables: list[CablePreset]


@router.get("", summary="List the cable presets")
async def presets() -> CablePresets:
    """Return the presets with their sources; `cable.preset` in a request names one, fields beside it override it."""
    return CablePresets(
        cables=[
            CablePreset.model_validate({**vars(Cable.preset(name)), "name": name, "source": preset.source})
            for name, preset in PRESETS.items()
        ]
    )
