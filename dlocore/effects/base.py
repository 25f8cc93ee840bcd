"""The one contract that all effects meet.

An effect is a frozen dataclass of parameters with a `site`, the place where its compiled law acts:

========== ============================== ============================================================================
site       the law is given               the law gives
========== ============================== ============================================================================
field      -                              constant coefficients of linear terms: density, drag, weight per unit length
axial      strain e, its rate, its memory tension N, modulus dN/de, viscosity dN/d(rate)
curvature  kappa, its rate, its memory    moment M, stiffness dM/dkappa, viscosity dM/d(rate)
twist      tau, its rate, its memory      torque T, stiffness dT/dtau, viscosity dT/d(rate)
body       position, velocity             force per unit length, minus its derivatives by position and by velocity
contact    position, velocity, the last   as body, at points as close as the obstacles are small
========== ============================== ============================================================================

Curvature is a vector: in the plane its signed value and two zeros, in space three world components across the tangent,
with a twist coordinate the two components in the frame of the sections and a zero; a law is written once for all.
Vectors and symmetric tangents are tuples of scalars, which compilers keep in registers.
Laws at strain sites know nothing of splines or of geometry: `kernels/strain.py` turns stress into generalised forces.
Memory is the paper's eps_0, the curvature of the stress-free shape at the point: state that
belongs to the solve, not to the law. Effects at one site superpose.
`effects/laws.py` is the one list of them: adding an effect is adding a file and its line there.
"""

from dataclasses import dataclass
from typing import ClassVar, Literal

Site = Literal["field", "axial", "curvature", "twist", "body", "contact"]
Vector = tuple[float, float, float]
Symmetric = tuple[float, float, float, float, float, float]  # xx, yy, zz, xy, xz, yz


@dataclass(frozen=True)
class Effect:
    """Base of the effects: a name, a site, and up to four parameters for the compiled law."""

    name: ClassVar[str]
    site: ClassVar[Site]

    def parameters(self) -> tuple[float, ...]:
        """Return the numbers that the compiled law reads, in its order."""
        return ()
