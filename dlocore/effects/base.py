"""The contract that every effect meets.

An effect is a frozen dataclass of parameters. Its `site` says where its compiled law acts:

========== ============================== ============================================================================
site       arguments of the law           results of the law
========== ============================== ============================================================================
field      -                              constant coefficients of linear terms: density, drag, weight per unit length
axial      strain e, its rate, its memory tension N, modulus dN/de, viscosity dN/d(rate)
curvature  kappa, its rate, its memory    moment M, stiffness dM/dkappa, viscosity dM/d(rate)
twist      tau, its rate, its memory      torque T, stiffness dT/dtau, viscosity dT/d(rate)
body       position, velocity             force per unit length f [N/m], -df/d(position), -df/d(velocity)
contact    position, velocity, anchor     the same as body, at nodes spaced by the size of the obstacles
========== ============================== ============================================================================

Curvature is always a vector, so that a law is written once for all cases: in the plane it has the signed value and two
zeros; in space, three world components perpendicular to the tangent; with a twist coordinate, the two components in the
frame of the sections and a zero. Vectors and symmetric tangents are tuples of scalars, which compilers keep in
registers.

Laws at strain sites know nothing of splines or geometry: `kernels/strain.py` turns stress into generalised forces.

Memory is the paper's eps_0, the strain of the stress-free shape at the point. It is state that belongs to the solve,
not to the law. Effects at the same site superpose.

`effects/laws.py` is the one list of the compiled laws: to add an effect, add a file here and its line there.
"""

from dataclasses import dataclass
from typing import ClassVar, Literal

Site = Literal["field", "axial", "curvature", "twist", "body", "contact"]
Vector = tuple[float, float, float]
Symmetric = tuple[float, float, float, float, float, float]  # xx, yy, zz, xy, xz, yz


@dataclass(frozen=True)
class Effect:
    """Base class of the effects: a name, a site, and the parameters of the compiled law."""

    name: ClassVar[str]
    site: ClassVar[Site]

    def parameters(self) -> tuple[float, ...]:
        """Return the numbers that the compiled law reads, in the order in which it reads them."""
        return ()
