"""Drag of the surrounding air: force per unit length f = -c v - c2 |v| v [N/m] (docs/model.md eq. 8).

v is the velocity of the centreline [m/s]; c [N s/m^2] and c2 [N s^2/m^3] are the same along and across the cable. Where
twist is simulated, linear drag also resists the spin omega [rad/s] of the sections about their tangent, with the torque
-c D^2/8 omega per unit length [N], where D is the diameter [m].
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from dlocore.compiling.kernel import law
from dlocore.effects.base import Effect, Site, Symmetric, Vector


@dataclass(frozen=True)
class LinearDrag(Effect):
    """Linear drag -c v with the coefficient c [N s/m^2]: the matrix N of the paper's eq. (13)."""

    name: ClassVar[str] = "drag"
    site: ClassVar[Site] = "field"
    drag: float

    def coefficient(self) -> float:
        """Return c, the coefficient of the drag matrix [N s/m^2]."""
        return self.drag


@dataclass(frozen=True)
class QuadraticDrag(Effect):
    """Quadratic drag -c2 |v| v with the coefficient c2 [N s^2/m^3]."""

    name: ClassVar[str] = "drag"
    site: ClassVar[Site] = "body"
    drag_quadratic: float

    def parameters(self) -> tuple[float, ...]:
        """Return (c2,)."""
        return (self.drag_quadratic,)


@law
def quadratic_drag(c2: float, v: Vector) -> tuple[Vector, Symmetric]:
    """Return f = -c2 |v| v and -df/dv = c2 (|v| I + v v'/|v|), which is positive semidefinite."""
    x, y, z = v
    speed = np.sqrt(x * x + y * y + z * z)
    scale = c2 * speed
    turn = c2 / speed if speed > 0.0 else 0.0
    diagonal = (scale + turn * x * x, scale + turn * y * y, scale + turn * z * z)
    return (-scale * x, -scale * y, -scale * z), (*diagonal, turn * x * y, turn * x * z, turn * y * z)
