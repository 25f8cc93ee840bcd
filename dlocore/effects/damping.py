"""Internal damping on the rate of curvature that the sections see, so that a rigid swing costs nothing.

With the sections' frames turning as they do, the dissipation density is eta/2 |kappa_t|^2 (docs/model.md eq. 9): with a
twist coordinate the rate is that of the two curvatures in the frame of the sections, and of the twist rate; without one
it is that of sections that do not twist (`kernels/bishop.py`); in the plane, that of the one curvature.
"""

from dataclasses import dataclass
from typing import ClassVar

from dlocore.compiling.kernel import law
from dlocore.effects.base import Effect, Site, Symmetric, Vector


@dataclass(frozen=True)
class Damping(Effect):
    """Bending damping eta [N m^2 s]."""

    name: ClassVar[str] = "damping"
    site: ClassVar[Site] = "curvature"
    bending_damping: float

    def parameters(self) -> tuple[float, ...]:
        """Return the damping."""
        return (self.bending_damping,)


@dataclass(frozen=True)
class TwistDamping(Effect):
    """Torsional damping [N m^2 s] on the rate of the twist rate."""

    name: ClassVar[str] = "damping"
    site: ClassVar[Site] = "twist"
    torsional_damping: float

    def parameters(self) -> tuple[float, ...]:
        """Return the damping."""
        return (self.torsional_damping,)


@law
def damping_moment(eta: float, rate: Vector) -> tuple[Vector, Symmetric]:
    """Return M = eta kappa_t and its derivative by the rate."""
    return (eta * rate[0], eta * rate[1], eta * rate[2]), (eta, eta, eta, 0.0, 0.0, 0.0)
