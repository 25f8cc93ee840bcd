"""Coulomb friction with sticking: force per unit length f [N/m] against a small elastic slip s (docs/model.md eq. 22).

    f = -mu N s/max(|s|, s_0)

s [m] is the displacement along the surface from an anchor, mu the coefficient of friction and N the normal force per
unit length [N/m], all of it (eq. 21). When |s| exceeds s_0, the anchor is dragged along. So a cable at rest stays at
rest under any force below mu N, and moves by less than s_0 while it sticks.

Coulomb's law is the limit of a small s_0. As s_0 is proportional to the square of the time step, refining the steps
refines it too. The tangent leaves out that N changes, and so stays symmetric.

The space-time least squares has no steps; there the law is f = -mu N v/sqrt(v^2 + v_0^2), with the velocity v along the
surface [m/s].
"""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from dlocore.compiling.kernel import law
from dlocore.effects.base import Effect, Site, Symmetric, Vector

Floats = NDArray[np.float64]

STICK = 0.02  # in diameters: s_0 where the step is COARSE or longer
COARSE = 0.05  # [s] for a cable of 1 m; proportional to the root of the length, as is the period of a swinging cable
LEAST_STICK = 1e-7  # in lengths of the cable: ten times the error that Newton's method leaves in a step
SLIP_SPEED = 0.005  # [m/s]: v_0


@dataclass(frozen=True)
class Friction(Effect):
    """Slip s_0 [m], and friction per unit length mu N [N/m] of a cable that lies in the plane of the motion, else 0."""

    name: ClassVar[str] = "friction"
    site: ClassVar[Site] = "contact"
    slip: float
    lying: float

    def parameters(self) -> tuple[float, ...]:
        """Return (s_0, v_0, mu N of the lying cable)."""
        return (self.slip, SLIP_SPEED, self.lying)


def slip_of(diameter: float, length: float, step: float) -> float:
    """Return the slip s_0 [m] for a cable of this diameter and length [m] in time steps of `step` [s]."""
    most = STICK * diameter
    return min(most, max(LEAST_STICK * length, most * (step / (COARSE * math.sqrt(length))) ** 2))


@law
def friction(
    limit: float, n: Vector, slip: Vector, v: Vector, stick: float, slow: float, steps: bool
) -> tuple[Vector, Symmetric, Symmetric]:
    """Return the force per unit length [N/m] and minus its derivatives with respect to position and velocity.

    Both of these are positive semidefinite.

    Args:
        limit: mu N [N/m].
        n: unit normal of the surface; zero where slip and velocity have no component along it.
        slip: displacement from the anchor [m].
        v: velocity [m/s].
        stick, slow: s_0 [m] and v_0 [m/s].
        steps: True to use the displacement, False to use the velocity.
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


def friction_forces(
    limit: Floats, n: Floats, slip: Floats, v: Floats, stick: float, slow: float, steps: bool
) -> Floats:
    """Return the forces (k, 3) [N/m], as `friction` gives them, of nodes with limits (k,) and n, slip and v (k, 3)."""
    x = slip if steps else v
    x = x - np.einsum("kd,kd->k", x, n)[:, None] * n
    size = np.linalg.norm(x, axis=1)
    return np.asarray(-(limit / (np.maximum(size, stick) if steps else np.hypot(size, slow)))[:, None] * x)
