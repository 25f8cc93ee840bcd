"""Twist: energy density GJ/2 (tau - tau_0)^2 [J/m] of the twist rate tau [rad/m] of the sections (paper eq. 8).

tau = theta', where theta is the angle of the sections against a frame without twist; docs/model.md eq. 19 gives tau
against the frames that the solve uses. tau_0 is the twist rate of the stress-free shape. The torque is T = GJ (tau -
tau_0) [N m].

The fourth coordinate of the solve is not theta but theta times the polar radius of gyration of the section, D/sqrt(8)
for a solid round section. That is a length whose inertia per unit length is the same as that of the other coordinates.
"""

from dataclasses import dataclass
from typing import ClassVar

from dlocore.compiling.kernel import law
from dlocore.effects.base import Effect, Site


@dataclass(frozen=True)
class Twist(Effect):
    """Torsional stiffness GJ [N m^2] and diameter D [m]."""

    name: ClassVar[str] = "twist"
    site: ClassVar[Site] = "twist"
    torsional_stiffness: float
    diameter: float

    @property
    def radius(self) -> float:
        """Polar radius of gyration of the section, D/sqrt(8) [m]."""
        return self.diameter / 8.0**0.5

    def parameters(self) -> tuple[float, ...]:
        """Return (GJ, 1/radius)."""
        return (self.torsional_stiffness, 1.0 / self.radius)


@law
def torque(GJ: float, tau: float, memory: float) -> tuple[float, float]:
    """Return T = GJ (tau - tau_0) and dT/dtau = GJ."""
    return GJ * (tau - memory), GJ
