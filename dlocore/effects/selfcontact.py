"""Contact of the cable with itself: strands that come nearer than the diameter push each other off (docs/model.md).

The force per length is that of eq. 21 with the depth D - rho, where rho is the distance of two strands. Strands less
than `APART` diameters apart along the cable are one bend, which its bending stiffness keeps open.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from dlocore.effects.base import Effect, Site
from dlocore.effects.contact import PASSAGE, critical_damping
from dlocore.kernels.basis import basis_rows
from dlocore.kernels.strands import lengths_apart, nearest_of

Floats = NDArray[np.float64]


APART = 4.0  # diameters along the cable from which on two parts of it are two strands
NEAR_START = 2.0  # diameters: strands of the start nearer than this call for the effect
CLOSE = 1.2  # diameters: strands of a motion nearer than this call for the effect
MOST_PARTS = 1000  # of a cable whose strands are looked for


@dataclass(frozen=True)
class SelfContact(Effect):
    """Diameter D of the cable [m], stiffness k [N/m^2] and linear density mu [kg/m]."""

    name: ClassVar[str] = "self_contact"
    site: ClassVar[Site] = "contact"
    diameter: float
    stiffness: float
    linear_density: float

    def parameters(self) -> tuple[float, ...]:
        """Return (D, k, w, c, least distance along the cable)."""
        damping = critical_damping(self.stiffness, self.linear_density)
        return (self.diameter, self.stiffness, PASSAGE * self.diameter, damping, APART * self.diameter)


def nearest_strands(knots: Floats, states: Floats, dimensions: int, diameter: float, within: float) -> float:
    """Return the smallest distance of two strands [m] in the states of a motion, infinite where it is above `within`.

    Strands a length s apart are at least s cos(T/2) apart in space where the cable turns by T < pi between them
    (Schur), and the control polygon turns at least as much: most states need no closer look, and others only at strands
    that lie far apart along the cable.

    Args:
        knots: (n + 4,) [m].
        states: control points (k, n, nc) [m].
        dimensions: of the centreline, 2 or 3.
        diameter: of the cable [m].
        within: largest distance of interest [m], less than `APART` diameters.
    """
    apart = lengths_apart(states, knots, dimensions, 2.0 * float(np.arccos(within / (APART * diameter))))
    which = np.flatnonzero(apart < knots[-1])
    if len(which) == 0:
        return np.inf
    length = float(knots[-1])
    u = np.linspace(0.0, length, 1 + int(np.ceil(length / max(diameter, length / MOST_PARTS))))
    first, table = basis_rows(knots, u, 0)
    rows = np.ascontiguousarray(table[:, 0])
    found = float(nearest_of(states, which, apart, first, rows, u, dimensions, APART * diameter, within))
    return found if found < within else np.inf
