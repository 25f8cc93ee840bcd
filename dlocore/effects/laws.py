"""The one list of compiled laws: which of them act at each site.

`active[EFFECT]` switches a law on, and `p[EFFECT]` holds its parameters. An inactive law costs one untaken branch. Rows
of `p` from COUNT on are obstacles (`dlocore/scene/obstacles.py`).
"""

from typing import Any

from dlocore.compiling.kernel import law
from dlocore.effects.base import Symmetric, Vector
from dlocore.effects.bend import bending_energy, bending_moment
from dlocore.effects.damping import damping_moment
from dlocore.effects.distance import ROW
from dlocore.effects.drag import quadratic_drag
from dlocore.effects.plasticity import yielded
from dlocore.effects.stretch import tension
from dlocore.effects.twist import torque

(
    STRETCH, BEND, DAMPING, QUADRATIC_DRAG, TWIST, TWIST_DAMPING, BENDING_MEMORY, TWIST_MEMORY, STRETCH_MEMORY, CONTACT,
    TABLE, FRICTION, SELF_CONTACT, STRETCH_DAMPING,
) = range(14)  # fmt: skip
COUNT = 14  # compiled laws
PARAMETERS = ROW  # columns for the parameters of one law, or for an obstacle

# laws that read the curvature or the frames of earlier steps, and laws that read any state of earlier steps
READ_CURVATURE = (DAMPING, TWIST, BENDING_MEMORY)
READ_HISTORY = (*READ_CURVATURE, STRETCH_MEMORY, STRETCH_DAMPING, FRICTION, CONTACT)

_NO_VECTOR = (0.0, 0.0, 0.0)
_NO_TANGENT = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@law
def keeps_curvature(active: Any) -> bool:
    """Tell whether an active law reads the curvature or the frames of earlier steps."""
    acting = 0
    for row in READ_CURVATURE:
        acting += active[row]
    return acting > 0


@law
def keeps_history(active: Any) -> bool:
    """Tell whether an active law reads any state of earlier steps."""
    acting = 0
    for row in READ_HISTORY:
        acting += active[row]
    return acting > 0


@law
def has_kinks(active: Any) -> bool:
    """Tell whether the force of an active law has kinks, as where something yields, touches or slips."""
    return bool(
        active[BENDING_MEMORY] or active[TWIST_MEMORY] or active[STRETCH_MEMORY] or active[CONTACT] or active[FRICTION]
    )


@law
def has_jumps(active: Any) -> bool:
    """Tell whether the force of an active law may jump at the start of a step, as in contact or friction."""
    return bool(active[CONTACT] or active[FRICTION])


@law
def has_viscosity(active: Any) -> bool:
    """Tell whether an active law depends on velocities or rates of strain other than through the drag matrix."""
    return bool(
        active[DAMPING]
        or active[QUADRATIC_DRAG]
        or active[TWIST_DAMPING]
        or active[STRETCH_DAMPING]
        or active[CONTACT]
        or active[FRICTION]
    )


@law
def _origin(memory: float, natural: float, soft: float) -> float:
    """Return z, the strain about which the section is elastic (docs/model.md eq. 20)."""
    return natural + (memory - natural) / soft


@law
def axial_memory(
    active: Any, p: Any, strain: float, memory: float, last: float, h: float, share: float
) -> tuple[float, float]:
    """Return the stress-free axial strain after a step h, and its derivative with respect to the strain.

    `share` is the ratio of the strain at this point to the strain that the tension calls for; the threshold is scaled
    by it.
    """
    if not active[STRETCH_MEMORY] or h == 0.0:
        return memory, 0.0
    soft = p[STRETCH_MEMORY, 2]
    z = _origin(memory, 0.0, soft)
    threshold = share * p[STRETCH_MEMORY, 0]
    e, De = yielded((strain, 0.0, 0.0), (last, 0.0, 0.0), (z, 0.0, 0.0), h, threshold, p[STRETCH_MEMORY, 1])
    return soft * (strain - e[0]), soft * (1.0 - De[0])


@law
def axial_stress(
    active: Any, p: Any, strain: float, rate: float, memory: float, last: float, h: float, share: float
) -> tuple[float, float, float]:
    """Return the tension N [N] of the active laws, dN/d(strain) [N] and dN/d(rate of strain) [N s]."""
    free, change = axial_memory(active, p, strain, memory, last, h, share)
    N, modulus = tension(p[STRETCH, 0], strain - free)
    viscosity = p[STRETCH_DAMPING, 0] if active[STRETCH_DAMPING] else 0.0
    return N + viscosity * rate, modulus * (1.0 - change), viscosity


@law
def axial_energy(active: Any, p: Any, strain: float, memory: float) -> float:
    """Return the stored energy density of the axial strain [J/m]."""
    return 0.5 * p[STRETCH, 0] * (strain - memory) * (strain - memory)


@law
def curvature_memory(
    active: Any, p: Any, kappa: Vector, memory: Vector, natural: Vector, last: Vector, h: float
) -> tuple[Vector, Symmetric]:
    """Return the stress-free curvature after a step h, and its derivative with respect to kappa."""
    if not active[BENDING_MEMORY] or h == 0.0:
        return memory, _NO_TANGENT
    soft = p[BENDING_MEMORY, 2]
    z = (
        _origin(memory[0], natural[0], soft),
        _origin(memory[1], natural[1], soft),
        _origin(memory[2], natural[2], soft),
    )
    e, De = yielded(kappa, last, z, h, p[BENDING_MEMORY, 0], p[BENDING_MEMORY, 1])
    free = (
        natural[0] + soft * (kappa[0] - e[0] - natural[0]),
        natural[1] + soft * (kappa[1] - e[1] - natural[1]),
        natural[2] + soft * (kappa[2] - e[2] - natural[2]),
    )
    diagonal = (soft * (1.0 - De[0]), soft * (1.0 - De[1]), soft * (1.0 - De[2]))
    return free, (*diagonal, -soft * De[3], -soft * De[4], -soft * De[5])


@law
def curvature_stress(
    active: Any, p: Any, kappa: Vector, rate: Vector, memory: Vector, natural: Vector, last: Vector, h: float
) -> tuple[Vector, Symmetric, Symmetric]:
    """Return the moment M [N m] of the active laws, dM/dkappa [N m^2] and dM/d(rate of kappa) [N m^2 s]."""
    moment, stiffness, viscosity = _NO_VECTOR, _NO_TANGENT, _NO_TANGENT
    if active[BEND]:
        free, change = curvature_memory(active, p, kappa, memory, natural, last, h)
        moment, stiffness = bending_moment(p[BEND, 0], kappa, free)
        if active[BENDING_MEMORY]:
            EI = p[BEND, 0]
            stiffness = (
                stiffness[0] - EI * change[0], stiffness[1] - EI * change[1], stiffness[2] - EI * change[2],
                -EI * change[3], -EI * change[4], -EI * change[5],
            )  # fmt: skip
    if active[DAMPING]:
        damping, viscosity = damping_moment(p[DAMPING, 0], rate)
        moment = (moment[0] + damping[0], moment[1] + damping[1], moment[2] + damping[2])
    return moment, stiffness, viscosity


@law
def curvature_energy(active: Any, p: Any, kappa: Vector, memory: Vector) -> float:
    """Return the stored energy density [J/m] of the curvature."""
    return bending_energy(p[BEND, 0], kappa, memory) if active[BEND] else 0.0


@law
def twist_memory(
    active: Any, p: Any, tau: float, memory: float, natural: float, last: float, h: float
) -> tuple[float, float]:
    """Return the stress-free twist rate after a step h, and its derivative with respect to tau."""
    if not active[TWIST_MEMORY] or h == 0.0:
        return memory, 0.0
    soft = p[TWIST_MEMORY, 2]
    z = _origin(memory, natural, soft)
    e, De = yielded((tau, 0.0, 0.0), (last, 0.0, 0.0), (z, 0.0, 0.0), h, p[TWIST_MEMORY, 0], p[TWIST_MEMORY, 1])
    return natural + soft * (tau - e[0] - natural), soft * (1.0 - De[0])


@law
def twist_stress(
    active: Any, p: Any, tau: float, rate: float, memory: float, natural: float, last: float, h: float
) -> tuple[float, float, float]:
    """Return the torque T [N m] of the active laws, dT/dtau [N m^2] and dT/d(rate of tau) [N m^2 s]."""
    if not active[TWIST]:
        return 0.0, 0.0, 0.0
    free, change = twist_memory(active, p, tau, memory, natural, last, h)
    T, stiffness = torque(p[TWIST, 0], tau, free)
    viscosity = p[TWIST_DAMPING, 0] if active[TWIST_DAMPING] else 0.0
    return T + viscosity * rate, stiffness * (1.0 - change), viscosity


@law
def twist_energy(active: Any, p: Any, tau: float, memory: float) -> float:
    """Return the stored energy density [J/m] of the twist rate."""
    return 0.5 * p[TWIST, 0] * (tau - memory) * (tau - memory) if active[TWIST] else 0.0


@law
def body_force(active: Any, p: Any, x: Vector, v: Vector) -> tuple[Vector, Symmetric, Symmetric]:
    """Return the force per unit length [N/m] of the active laws and minus its derivatives with respect to x and v."""
    force, stiffness, viscosity = _NO_VECTOR, _NO_TANGENT, _NO_TANGENT
    if active[QUADRATIC_DRAG]:
        force, viscosity = quadratic_drag(p[QUADRATIC_DRAG, 0], v)
    return force, stiffness, viscosity
