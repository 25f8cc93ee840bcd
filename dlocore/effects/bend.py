"""Bending: energy density EI/2 |kappa - kappa_0|^2 [J/m] of the curvature kappa = dt/du (paper eq. 8).

kappa_0 is the paper's strain memory eps_0 at the point: the curvature of the stress-free shape.
"""

from dataclasses import dataclass
from typing import Any, ClassVar

from dlocore.effects.base import Effect, Site
from dlocore.kernels.compile import law


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
def bending_moment(p: Any, kappa: Any, memory: Any, moment: Any, stiffness: Any) -> None:
    """Add M = EI (kappa - kappa_0) and dM/dkappa = EI."""
    for k in range(len(kappa)):
        moment[k] += p[0] * (kappa[k] - memory[k])
        stiffness[k, k] += p[0]


@law
def bending_energy(p: Any, kappa: Any, memory: Any) -> float:
    """Return EI/2 |kappa - kappa_0|^2 [J/m]."""
    total = 0.0
    for k in range(len(kappa)):
        total += (kappa[k] - memory[k]) ** 2
    return 0.5 * p[0] * total
