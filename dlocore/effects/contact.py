"""Contact with a table or an obstacle: a normal force per unit length N [N/m] of the depth (docs/model.md eq. 21).

    N = k phi(d) - c phi'(d) n.v >= 0,   phi = d^2/(2 w) for d < w, d - w/2 for d >= w,

d [m] is the depth of the cable's surface in the obstacle, n the outward normal of the obstacle and v the velocity of
the cable [m/s]. At the depth w [m] the full stiffness is reached.

The stiffness k [N/m^2] is numerical: it is raised until the deepest point of the motion is less than `DEEPEST`
diameters inside. c [N s/m^2] makes the contact critically damped, so that a cable that falls on a table stays there.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from dlocore.compiling.kernel import law
from dlocore.effects.base import Effect, Site

Floats = NDArray[np.float64]

DEEPEST = 0.02  # in diameters
PASSAGE = 0.005  # in diameters: the depth w at which the full stiffness is reached


def critical_damping(stiffness: float, linear_density: float) -> float:
    """Return the damping c = 2 sqrt(k mu) [N s/m^2], with which contact does not bounce."""
    return 2.0 * float(np.sqrt(stiffness * linear_density))


@dataclass(frozen=True)
class Contact(Effect):
    """Radius of the cable [m], stiffness k [N/m^2] and linear density mu [kg/m]."""

    name: ClassVar[str] = "obstacles"
    site: ClassVar[Site] = "contact"
    radius: float
    stiffness: float
    linear_density: float

    def parameters(self) -> tuple[float, ...]:
        """Return (radius, k, w, c)."""
        return (self.radius, self.stiffness, self._width, critical_damping(self.stiffness, self.linear_density))

    @property
    def _width(self) -> float:
        return 2.0 * PASSAGE * self.radius

    def depth_under(self, load: float) -> float:
        """Return the depth [m] at which contact carries a load per unit length [N/m]."""
        soft = 0.5 * self.stiffness * self._width
        return float(np.sqrt(load / soft)) * self._width if load < soft else load / self.stiffness + 0.5 * self._width


@dataclass(frozen=True)
class TableContact(Effect):
    """Height of the table in the coordinates of the solve [m], and its coefficient of friction."""

    name: ClassVar[str] = "table"
    site: ClassVar[Site] = "contact"
    height: float
    friction: float

    def parameters(self) -> tuple[float, ...]:
        """Return (height, mu)."""
        return (self.height, self.friction)


@law
def pressure(k: float, w: float, depth: float) -> tuple[float, float]:
    """Return k phi(depth) [N/m] and its derivative [N/m^2]."""
    if depth <= 0.0:
        return 0.0, 0.0
    if depth < w:
        return 0.5 * k * depth * depth / w, k * depth / w
    return k * (depth - 0.5 * w), k


@law
def normal_force(k: float, w: float, c: float, depth: float, leaving: float) -> tuple[float, float, float]:
    """Return N [N/m], its stiffness k phi' [N/m^2] and its viscosity c phi' [N s/m^2].

    `leaving` is the speed n.v [m/s] at which the cable leaves the obstacle.
    """
    elastic, stiffness = pressure(k, w, depth)
    viscosity = c * stiffness / k
    return max(elastic - viscosity * leaving, 0.0), stiffness, viscosity


def normal_forces(k: float, w: float, c: float, depth: Floats, leaving: Floats) -> Floats:
    """Return N [N/m], as `normal_force` gives it, for all nodes in contact (n,) at once."""
    soft = np.minimum(depth / w, 1.0)
    return np.asarray(
        np.maximum(k * np.where(depth < w, 0.5 * depth * soft, depth - 0.5 * w) - c * soft * leaving, 0.0)
    )
