"""Inertia of the moving cable: kinetic energy density mu/2 |r_t|^2 [J/m] (paper eq. 5-7).

mu is the linear density [kg/m] and r_t the velocity of the centreline [m/s]. The force per unit length is mu r_tt
[N/m], the term M q_tt of docs/model.md eq. 10. Point masses add to mu (docs/model.md eq. 9a).

Where twist is simulated, the sections also have the rotary inertia mu D^2/8 [kg m] about their tangent (docs/model.md,
Twist), where D is the diameter [m].
"""

from dataclasses import dataclass
from typing import ClassVar

from dlocore.effects.base import Effect, Site


@dataclass(frozen=True)
class Inertia(Effect):
    """Linear density mu [kg/m]; rotary inertia against bending is left out (docs/model.md, Forces)."""

    name: ClassVar[str] = "inertia"
    site: ClassVar[Site] = "field"
    linear_density: float

    def density(self) -> float:
        """Return mu, the coefficient of the mass matrix [kg/m]."""
        return self.linear_density
