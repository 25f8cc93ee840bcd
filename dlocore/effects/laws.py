"""The one list of compiled laws: which of them act at each site.

`active[EFFECT]` switches a law, `p[EFFECT]` holds its parameters. A law that is not active costs one untaken branch.
"""

from typing import Any

from dlocore.effects.bend import bending_energy, bending_moment
from dlocore.effects.damping import damping_moment
from dlocore.effects.drag import quadratic_drag
from dlocore.effects.stretch import tension
from dlocore.kernels.compile import law

STRETCH, BEND, DAMPING, QUADRATIC_DRAG = range(4)
COUNT = 4  # of compiled laws
PARAMETERS = 4  # room for parameters of one law


@law
def axial_stress(active: Any, p: Any, strain: float) -> tuple[float, float]:
    """Return the tension [N] and its derivative by the strain [N]."""
    return tension(p[STRETCH], strain)


@law
def axial_energy(active: Any, p: Any, strain: float) -> float:
    """Return the stored energy density [J/m] of the axial strain."""
    return 0.5 * p[STRETCH, 0] * strain * strain


@law
def curvature_stress(
    active: Any, p: Any, kappa: Any, rate: Any, memory: Any, moment: Any, stiffness: Any, viscosity: Any
) -> None:
    """Add the moments [N m] of the active laws and their derivatives by kappa [N m^2] and by its rate [N m^2 s]."""
    if active[BEND]:
        bending_moment(p[BEND], kappa, memory, moment, stiffness)
    if active[DAMPING]:
        damping_moment(p[DAMPING], kappa, rate, moment, viscosity)


@law
def curvature_energy(active: Any, p: Any, kappa: Any, memory: Any) -> float:
    """Return the stored energy density [J/m] of the curvature."""
    return bending_energy(p[BEND], kappa, memory) if active[BEND] else 0.0


@law
def body_force(active: Any, p: Any, x: Any, v: Any, force: Any, stiffness: Any, viscosity: Any) -> None:
    """Add the forces per unit length [N/m] of the active laws and minus their derivatives by x and by v."""
    if active[QUADRATIC_DRAG]:
        quadratic_drag(p[QUADRATIC_DRAG], x, v, force, stiffness, viscosity)
