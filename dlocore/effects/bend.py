"""Bending: energy density EI/2 |kappa - kappa_0|^2 [J/m] (docs/model.md eq. 7, paper eq. 8).

kappa = dt/du is the curvature of the centreline per rest length [1/m] (docs/model.md eq. 4 and 5). kappa_0 is the
curvature of the stress-free shape, the paper's strain memory eps_0. The moment is M = EI (kappa - kappa_0) [N m].
"""

from dataclasses import dataclass
from typing import ClassVar

from dlocore.compiling.kernel import law
from dlocore.effects.base import Effect, Site, Symmetric, Vector


@dataclass(frozen=True)
class Bend(Effect):
    """Bending stiffness EI [N m^2]."""

    name: ClassVar[str] = "bend"
    site: ClassVar[Site] = "curvature"
    bending_stiffness: float

    def parameters(self) -> tuple[float, ...]:
        """Return (EI,)."""
        return (self.bending_stiffness,)


@law
def bending_moment(EI: float, kappa: Vector, memory: Vector) -> tuple[Vector, Symmetric]:
    """Return M = EI (kappa - kappa_0) and dM/dkappa = EI."""
    moment = (EI * (kappa[0] - memory[0]), EI * (kappa[1] - memory[1]), EI * (kappa[2] - memory[2]))
    return moment, (EI, EI, EI, 0.0, 0.0, 0.0)


@law
def bending_energy(EI: float, kappa: Vector, memory: Vector) -> float:
    """Return EI/2 |kappa - kappa_0|^2 [J/m]."""
    x, y, z = kappa[0] - memory[0], kappa[1] - memory[1], kappa[2] - memory[2]
    return 0.5 * EI * (x * x + y * y + z * z)
