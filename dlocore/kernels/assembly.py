"""Assembly of forces and tangents over the quadrature points: the only place that knows the sparsity.

Control points q are (n, nc) with nc = 2 in the plane and 3 in space; `axes` is the tuple (0, 1) or (0, 1, 2), so that
the compiler knows nc and unrolls. A symmetric banded matrix is stored by column below its diagonal, A[j, i - j], with
degree of freedom i * nc + d and half-bandwidth 4 nc - 1.

A tangent is asked for as `scales` = (stiffness, viscosity, geometric): the factors of dF/dstrain, dF/d(strain rate) and
of the part that comes from the stress at hand. (1, c, 1) is the full tangent of a step where dv/dq = c, (1, c, 0) its
positive semidefinite part, (0, 1, 0) the damping matrix alone, (0, 0, 0) forces only.
"""

from typing import Any

import numpy as np

from dlocore.effects.laws import BEND, DAMPING, QUADRATIC_DRAG
from dlocore.kernels import plane, space
from dlocore.kernels.compile import kernel

NO_RATES = (0.0, 0.0, 0.0)  # `rates` of `assemble` where the rate of strain comes from v


@kernel
def assemble(
    axes: Any, q: Any, v: Any, tables: Any, active: Any, p: Any, memory: Any, past: Any, rates: Any, scales: Any,
    f: Any, K: Any,
) -> None:  # fmt: skip
    """Write internal forces minus body forces f (n, nc) [N] and their tangent K (n nc, 4 nc) [N/m].

    Args:
        axes: (0, 1) or (0, 1, 2).
        q, v: control points and their velocities (n, nc) [m, m/s].
        tables: `basis.Tables`.
        active: switches of the laws (laws.COUNT,).
        p: parameters of the laws (laws.COUNT, laws.PARAMETERS).
        memory: curvature of the stress-free shape at the curvature points (points, 1 or 3) [1/m].
        past: strain of earlier steps, see `remember`; not read where rates[0] is zero.
        rates: (now, last, before): the rate of a strain as a combination of its values now and at the two last steps;
            zeros: the rate comes from v.
        scales: (stiffness, viscosity, geometric) factors of the tangent.
        f, K: outputs; K is untouched where all scales are zero.
    """
    tangent = scales[0] != 0.0 or scales[1] != 0.0
    f[:] = 0.0
    if tangent:
        K[:] = 0.0
    bends = active[BEND] or active[DAMPING]
    if len(axes) == 2:
        plane.axial(q, tables, active, p, scales, tangent, f, K)
        if bends:
            plane.curvature(q, v, tables, active, p, memory, past, rates, scales, tangent, f, K)
        if active[QUADRATIC_DRAG]:
            plane.body(q, v, tables, active, p, scales, tangent, f, K)
    else:
        space.axial(q, tables, active, p, scales, tangent, f, K)
        if bends:
            space.curvature(q, v, tables, active, p, memory, past, rates, scales, tangent, f, K)
        if active[QUADRATIC_DRAG]:
            space.body(q, v, tables, active, p, scales, tangent, f, K)


@kernel
def remember(axes: Any, q: Any, tables: Any, past: Any) -> None:
    """Note the curvature of q (n, nc) in `past` (points, 2 or 9) as that of the last step."""
    if len(axes) == 2:
        plane.remember(q, tables, past)
    else:
        space.remember(q, tables, past)


@kernel
def stored_energy(axes: Any, q: Any, tables: Any, active: Any, p: Any, memory: Any) -> float:
    """Return the elastic energy [J] of the control points q (n, nc)."""
    if len(axes) == 2:
        return plane.energy(q, tables, active, p, memory)
    return space.energy(q, tables, active, p, memory)


@kernel
def largest_strain(axes: Any, states: Any, tables: Any) -> float:
    """Return the largest |axial strain| at the axial points over the states (k, n, nc)."""
    largest = 0.0
    for s in range(len(states)):
        for n in range(len(tables.axial_w)):
            square = 0.0
            for d in range(len(axes)):
                value = 0.0
                for i in range(4):
                    value += tables.axial_b1[n, i] * states[s, tables.axial_first[n] + i, d]
                square += value * value
            largest = max(largest, abs(np.sqrt(square) - 1.0))
    return largest


@kernel
def multiply_scalar_band(band: Any, x: Any, scale: float, out: Any) -> None:
    """Add scale * B x to out (n, nc) for the symmetric banded B (n, 4), which acts alike on every coordinate."""
    n, nc = x.shape
    for i in range(n):
        for d in range(nc):
            out[i, d] += scale * band[i, 0] * x[i, d]
        for o in range(1, min(4, n - i)):
            factor = scale * band[i, o]
            for d in range(nc):
                out[i, d] += factor * x[i + o, d]
                out[i + o, d] += factor * x[i, d]


@kernel
def add_scalar_band(nc: int, band: Any, scale: float, K: Any) -> None:
    """Add scale * B to K (n nc, 4 nc) for the symmetric banded B (n, 4), which acts alike on every coordinate."""
    for i in range(len(band)):
        for o in range(min(4, len(band) - i)):
            factor = scale * band[i, o]
            for d in range(nc):
                K[i * nc + d, o * nc] += factor
