"""Drag of the surrounding air: force per unit length -c v - c2 |v| v [N/m] (docs/model.md eq. 8)."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from dlocore.effects.base import Effect, Site
from dlocore.kernels.compile import law


@dataclass(frozen=True)
class LinearDrag(Effect):
    """Linear drag c [N s/m^2]: the matrix N of the paper's eq. (13)."""

    name: ClassVar[str] = "drag"
    site: ClassVar[Site] = "field"
    drag: float

    def coefficient(self) -> float:
        """Return the coefficient of the drag matrix [N s/m^2]."""
        return self.drag


@dataclass(frozen=True)
class QuadraticDrag(Effect):
    """Quadratic drag c2 [N s^2/m^3]."""

    name: ClassVar[str] = "drag"
    site: ClassVar[Site] = "body"
    drag_quadratic: float

    def parameters(self) -> tuple[float, ...]:
        """Return (c2,)."""
        return (self.drag_quadratic,)


@law
def quadratic_drag(p: Any, x: Any, v: Any, force: Any, stiffness: Any, viscosity: Any) -> None:
    """Add f = -c2 |v| v and -df/dv = c2 (|v| I + v v'/|v|), which is positive semidefinite."""
    n = len(v)
    speed = 0.0
    for d in range(n):
        speed += v[d] * v[d]
    speed = np.sqrt(speed)
    if speed > 0.0:
        for d in range(n):
            force[d] -= p[0] * speed * v[d]
            viscosity[d, d] += p[0] * speed
            for e in range(n):
                viscosity[d, e] += p[0] * v[d] * v[e] / speed
