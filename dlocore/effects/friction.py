"""Coulomb friction that sticks: force per length against a small elastic slip s (docs/model.md eq. 22).

    f = -mu N s/max(|s|, s_0),

with s the displacement along the surface from an anchor. Where |s| passes s_0 the anchor is dragged behind, so that a
cable at rest stays at rest under any force below mu N, and moves by less than s_0 while it sticks. N is that of the
last step, which keeps the tangent symmetric. Where there is no step (space-time least squares) the law is
-mu N v/sqrt(v^2 + v_0^2).
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from dlocore.effects.base import Effect, Site, Symmetric, Vector
from dlocore.kernels.compile import law

STICK = 0.02  # of the diameter: s_0
SLIP_SPEED = 0.005  # [m/s]: v_0


@dataclass(frozen=True)
class Friction(Effect):
    """Diameter D [m], and the friction per length mu N of a cable that lies in the plane of the motion [N/m], or 0."""

    name: ClassVar[str] = "friction"
    site: ClassVar[Site] = "contact"
    diameter: float
    lying: float

    def parameters(self) -> tuple[float, ...]:
        """Return (s_0, v_0, mu N of the lying cable)."""
        return (STICK * self.diameter, SLIP_SPEED, self.lying)


@law
def friction(
    limit: float, n: Vector, slip: Vector, v: Vector, stick: float, slow: float, steps: bool
) -> tuple[Vector, Symmetric, Symmetric]:
    """Return the force per length and minus its derivatives by position and by velocity, both positive semidefinite.

    Args:
        limit: mu N [N/m].
        n: unit normal of the surface; zero where slip and velocity have no part along it.
        slip: displacement from the anchor [m].
        v: velocity [m/s].
        stick, slow: s_0 [m] and v_0 [m/s].
        steps: whether the displacement counts, or the velocity.
    """
    if steps:
        x, floor = slip, stick
    else:
        x, floor = v, slow
    along = x[0] * n[0] + x[1] * n[1] + x[2] * n[2]
    a, b, c = x[0] - along * n[0], x[1] - along * n[1], x[2] - along * n[2]
    square = a * a + b * b + c * c
    size = max(np.sqrt(square), floor) if steps else np.sqrt(square + floor * floor)
    scale = limit / size
    inside = steps and square < floor * floor
    turn = 0.0 if inside else scale / (size * size)
    tangent = (
        scale * (1.0 - n[0] * n[0]) - turn * a * a,
        scale * (1.0 - n[1] * n[1]) - turn * b * b,
        scale * (1.0 - n[2] * n[2]) - turn * c * c,
        -scale * n[0] * n[1] - turn * a * b,
        -scale * n[0] * n[2] - turn * a * c,
        -scale * n[1] * n[2] - turn * b * c,
    )
    nothing = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    force = (-scale * a, -scale * b, -scale * c)
    return (force, tangent, nothing) if steps else (force, nothing, tangent)
