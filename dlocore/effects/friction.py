"""Coulomb friction that sticks: force per length against a small elastic slip s (docs/model.md eq. 22).

    f = -mu N s/max(|s|, s_0),

with s the displacement along the surface from an anchor. Where |s| passes s_0 the anchor is dragged behind, so that a
cable at rest stays at rest under any force below mu N, and moves by less than s_0 while it sticks. Coulomb's law is
the limit of a small s_0, which goes with the square of the step: so its refinement is part of that of the steps. N is
the whole normal force (eq. 21); that it changes is left out of the tangent, which stays symmetric. Where there is no
step (space-time least squares) the law is -mu N v/sqrt(v^2 + v_0^2).
"""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from dlocore.compiling.kernel import law
from dlocore.effects.base import Effect, Site, Symmetric, Vector

Floats = NDArray[np.float64]

STICK = 0.02  # of the diameter: s_0 of steps of COARSE and longer ones
COARSE = 0.05  # [s] for a cable of 1 m; with the root of the length, as the period of one that swings
LEAST_STICK = 1e-7  # of the length: ten times what Newton's method leaves of a step
SLIP_SPEED = 0.005  # [m/s]: v_0


@dataclass(frozen=True)
class Friction(Effect):
    """The slip s_0 [m], and the friction per length mu N [N/m] of a cable lying in the plane of the motion, or 0."""

    name: ClassVar[str] = "friction"
    site: ClassVar[Site] = "contact"
    slip: float
    lying: float

    def parameters(self) -> tuple[float, ...]:
        """Return (s_0, v_0, mu N of the lying cable)."""
        return (self.slip, SLIP_SPEED, self.lying)


def slip_of(diameter: float, length: float, step: float) -> float:
    """Return the slip s_0 [m] of steps of `step` [s], for a cable of a diameter and a length [m]."""
    most = STICK * diameter
    return min(most, max(LEAST_STICK * length, most * (step / (COARSE * math.sqrt(length))) ** 2))


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


def friction_forces(
    limit: Floats, n: Floats, slip: Floats, v: Floats, stick: float, slow: float, steps: bool
) -> Floats:
    """Return the force that `friction` does (k, 3) [N/m], of nodes with limits (k,), and n, slip and v (k, 3)."""
    x = slip if steps else v
    x = x - np.einsum("kd,kd->k", x, n)[:, None] * n
    size = np.linalg.norm(x, axis=1)
    return np.asarray(-(limit / (np.maximum(size, stick) if steps else np.hypot(size, slow)))[:, None] * x)
