"""Internal damping on the rate of curvature, so that a rigid swing costs nothing (docs/model.md eq. 9).

With a twist coordinate the rate is that of the two curvatures in the frame of the sections, and of the twist rate.
Without one the spin of the sections about the tangent is free, and only the radial part of the rate
costs: kappa_t . kappa/|kappa|. Near zero curvature that direction is undefined; there the whole rate costs, with a
smooth passage at |kappa| of about `EPSILON`/L: the dissipation density is

    eta/2 (eps^2 |kappa_t|^2 + (kappa . kappa_t)^2) / (|kappa|^2 + eps^2)  [W/m],

in the plane, where kappa has one component, exactly eta/2 kappa_t^2.
"""

from dataclasses import dataclass
from typing import ClassVar

from dlocore.effects.base import Effect, Site, Symmetric, Vector
from dlocore.kernels.compile import law

EPSILON = 0.1  # times 1/L: a cable bent to less than a tenth of a radian over its length


@dataclass(frozen=True)
class Damping(Effect):
    """Bending damping eta [N m^2 s], the length L [m] that scales the passage near zero curvature, and whether the
    curvature is that in the frame of the sections, whose whole rate costs.
    """

    name: ClassVar[str] = "damping"
    site: ClassVar[Site] = "curvature"
    bending_damping: float
    length: float
    of_sections: bool = False

    def parameters(self) -> tuple[float, ...]:
        """Return (eta, eps^2)."""
        return (self.bending_damping, 1e12 if self.of_sections else (EPSILON / self.length) ** 2)


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
def damping_moment(eta: float, epsilon2: float, kappa: Vector, rate: Vector) -> tuple[Vector, Symmetric]:
    """Return M = V kappa_t and V = eta (eps^2 I + kappa kappa') / (|kappa|^2 + eps^2), which is positive definite."""
    x, y, z = kappa
    scale = eta / (epsilon2 + x * x + y * y + z * z)
    along = x * rate[0] + y * rate[1] + z * rate[2]
    moment = (
        scale * (epsilon2 * rate[0] + x * along),
        scale * (epsilon2 * rate[1] + y * along),
        scale * (epsilon2 * rate[2] + z * along),
    )
    diagonal = (scale * (epsilon2 + x * x), scale * (epsilon2 + y * y), scale * (epsilon2 + z * z))
    return moment, (*diagonal, scale * x * y, scale * x * z, scale * y * z)
