"""Inertia of the moving cable: kinetic energy density mu/2 |r_t|^2 [J/m] (paper eq. 5-7)."""

from dataclasses import dataclass
from typing import ClassVar

from dlocore.effects.base import Effect, Site


@dataclass(frozen=True)
class Inertia(Effect):
    """Linear density mu [kg/m]. The rotary inertia of a thin cable is negligible (docs/model.md)."""

    name: ClassVar[str] = "inertia"
    site: ClassVar[Site] = "field"
    linear_density: float

    def density(self) -> float:
        """Return the coefficient of the mass matrix [kg/m]."""
        return self.linear_density
