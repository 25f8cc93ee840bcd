"""The one list of compiled laws: which of them act at each site.

`active[EFFECT]` switches a law, `p[EFFECT]` holds its parameters. A law that is not active costs one untaken branch.
"""

from typing import Any

from dlocore.effects.base import Symmetric, Vector
from dlocore.effects.bend import bending_energy, bending_moment
from dlocore.effects.damping import damping_moment
from dlocore.effects.drag import quadratic_drag
from dlocore.effects.stretch import tension
from dlocore.kernels.compile import law

STRETCH, BEND, DAMPING, QUADRATIC_DRAG = range(4)
COUNT = 4  # of compiled laws
PARAMETERS = 4  # room for parameters of one law

_NO_VECTOR = (0.0, 0.0, 0.0)
_NO_TANGENT = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@law
def axial_stress(active: Any, p: Any, strain: float) -> tuple[float, float]:
    """Return the tension [N] and its derivative by the strain [N]."""
    return tension(p[STRETCH, 0], strain)


@law
def axial_energy(active: Any, p: Any, strain: float) -> float:
    """Return the stored energy density [J/m] of the axial strain."""
    return 0.5 * p[STRETCH, 0] * strain * strain


@law
def curvature_stress(
    active: Any, p: Any, kappa: Vector, rate: Vector, memory: Vector
) -> tuple[Vector, Symmetric, Symmetric]:
    """Return the moment [N m] of the active laws and its derivatives by kappa [N m^2] and by its rate [N m^2 s]."""
    moment, stiffness, viscosity = _NO_VECTOR, _NO_TANGENT, _NO_TANGENT
    if active[BEND]:
        moment, stiffness = bending_moment(p[BEND, 0], kappa, memory)
    if active[DAMPING]:
        damping, viscosity = damping_moment(p[DAMPING, 0], p[DAMPING, 1], kappa, rate)
        moment = (moment[0] + damping[0], moment[1] + damping[1], moment[2] + damping[2])
    return moment, stiffness, viscosity


@law
def curvature_energy(active: Any, p: Any, kappa: Vector, memory: Vector) -> float:
    """Return the stored energy density [J/m] of the curvature."""
    return bending_energy(p[BEND, 0], kappa, memory) if active[BEND] else 0.0


@law
def body_force(active: Any, p: Any, x: Vector, v: Vector) -> tuple[Vector, Symmetric, Symmetric]:
    """Return the force per unit length [N/m] of the active laws and minus its derivatives by x and by v."""
    force, stiffness, viscosity = _NO_VECTOR, _NO_TANGENT, _NO_TANGENT
    if active[QUADRATIC_DRAG]:
        force, viscosity = quadratic_drag(p[QUADRATIC_DRAG, 0], v)
    return force, stiffness, viscosity
