"""Internal damping of bending and twist: moment M = eta D, dissipation density eta/2 |D|^2 [W/m] (docs/model.md eq. 9).

D is the rate of curvature that the sections see [1/(m s)], so that a rigid motion dissipates nothing:

- In the plane, D is the rate of the signed curvature.
- With a twist coordinate, D is the rate of the two curvatures in the frame of the sections. The twist rate tau is
  damped by the torque eta_t tau_t, with the density eta_t/2 tau_t^2.
- In space without a twist coordinate, the sections do not twist, and D is what such sections see (`kernels/bishop.py`).
"""

from dataclasses import dataclass
from typing import ClassVar

from dlocore.compiling.kernel import law
from dlocore.effects.base import Effect, Site, Symmetric, Vector


@dataclass(frozen=True)
class Damping(Effect):
    """Bending damping eta [N m^2 s], on the rate of curvature."""

    name: ClassVar[str] = "damping"
    site: ClassVar[Site] = "curvature"
    bending_damping: float

    def parameters(self) -> tuple[float, ...]:
        """Return (eta,)."""
        return (self.bending_damping,)


@dataclass(frozen=True)
class TwistDamping(Effect):
    """Torsional damping eta_t [N m^2 s], on the rate of the twist rate."""

    name: ClassVar[str] = "damping"
    site: ClassVar[Site] = "twist"
    torsional_damping: float

    def parameters(self) -> tuple[float, ...]:
        """Return (eta_t,)."""
        return (self.torsional_damping,)


@law
def damping_moment(eta: float, rate: Vector) -> tuple[Vector, Symmetric]:
    """Return M = eta D and dM/dD = eta, where `rate` is D."""
    return (eta * rate[0], eta * rate[1], eta * rate[2]), (eta, eta, eta, 0.0, 0.0, 0.0)
