"""Contact of the cable with itself: strands nearer than the diameter D push each other apart (docs/model.md eq. 21).

    N = k phi(d) - c phi'(d) n.v >= 0,   d = D - rho

is the force per unit length [N/m], where rho is the distance of the two strands [m], n.v the speed at which they
separate [m/s], and k, phi and c are as in `contact.py`. Strands less than `APART` diameters apart along the cable
belong to one bend, which its bending stiffness keeps open.
"""

from dataclasses import dataclass
from typing import ClassVar

from dlocore.effects.base import Effect, Site
from dlocore.effects.contact import PASSAGE, critical_damping

APART = 4.0  # diameters along the cable: parts at least this far apart are two strands
NEAR_START = 2.0  # diameters: strands of the start nearer than this call for the effect
CLOSE = 1.2  # diameters: strands of a motion nearer than this call for the effect


@dataclass(frozen=True)
class SelfContact(Effect):
    """Diameter D of the cable [m], stiffness k [N/m^2] and linear density mu [kg/m]."""

    name: ClassVar[str] = "self_contact"
    site: ClassVar[Site] = "contact"
    diameter: float
    stiffness: float
    linear_density: float

    def parameters(self) -> tuple[float, ...]:
        """Return (D, k, w, c, least distance along the cable [m])."""
        damping = critical_damping(self.stiffness, self.linear_density)
        return (self.diameter, self.stiffness, PASSAGE * self.diameter, damping, APART * self.diameter)
