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

from dlocore.effects.laws import axial_energy, axial_stress, body_force, curvature_energy, curvature_stress
from dlocore.effects.laws import BEND, DAMPING, QUADRATIC_DRAG
from dlocore.kernels.compile import kernel, law
from dlocore.kernels.strain import (
    plane_curvature,
    space_curvature,
    space_curvature_rate,
    space_moment,
    space_tangent,
)


@law
def _combine(nc: int, q: Any, first: int, b: Any, out: Any) -> None:
    for d in range(nc):
        out[d] = b[0] * q[first, d] + b[1] * q[first + 1, d] + b[2] * q[first + 2, d] + b[3] * q[first + 3, d]


@law
def _scatter_1(nc: int, first: int, b: Any, w: float, g: Any, H: Any, tangent: bool, f: Any, K: Any) -> None:
    """Add forces g (nc,) and tangent H (nc, nc) conjugate to one interpolated vector."""
    for i in range(4):
        for d in range(nc):
            f[first + i, d] += w * b[i] * g[d]
    if tangent:
        for j in range(4):
            for i in range(j, 4):
                factor = w * b[i] * b[j]
                for e in range(nc):
                    column = (first + j) * nc + e
                    offset = (i - j) * nc - e
                    for d in range(e if i == j else 0, nc):
                        K[column, offset + d] += factor * H[d, e]


@law
def _scatter_2(nc: int, first: int, b1: Any, b2: Any, w: float, g: Any, H: Any, tangent: bool, f: Any, K: Any) -> None:
    """Add forces g (2 nc,) and tangent H (2 nc, 2 nc) conjugate to r' and r''."""
    for i in range(4):
        for d in range(nc):
            f[first + i, d] += w * (b1[i] * g[d] + b2[i] * g[nc + d])
    if tangent:
        for j in range(4):
            x, y = w * b1[j], w * b2[j]
            for e in range(nc):
                column = (first + j) * nc + e
                for d in range(nc):
                    upper = x * H[d, e] + y * H[d, nc + e]
                    lower = x * H[nc + d, e] + y * H[nc + d, nc + e]
                    for i in range(j, 4):
                        if i > j or d >= e:
                            K[column, (i - j) * nc + d - e] += b1[i] * upper + b2[i] * lower


@kernel
def assemble(
    axes: Any, q: Any, v: Any, tables: Any, active: Any, p: Any, memory: Any, scales: Any, f: Any, K: Any
) -> None:
    """Write internal forces minus body forces f (n, nc) [N] and their tangent K (n nc, 4 nc) [N/m].

    Args:
        axes: (0, 1) or (0, 1, 2).
        q, v: control points and their velocities (n, nc) [m, m/s].
        tables: `basis.Tables`.
        active: switches of the laws (laws.COUNT,).
        p: parameters of the laws (laws.COUNT, laws.PARAMETERS).
        memory: curvature of the stress-free shape at the curvature points (points, 1 or 3) [1/m].
        scales: (stiffness, viscosity, geometric) factors of the tangent.
        f, K: outputs; K is untouched where all scales are zero.
    """
    nc = len(axes)
    elastic, viscous, geometric = scales
    tangent = elastic != 0.0 or viscous != 0.0
    f[:] = 0.0
    if tangent:
        K[:] = 0.0
    a = np.empty(nc)
    g = np.empty(2 * nc)
    H = np.empty((2 * nc, 2 * nc))
    # --- axial
    for i in range(len(tables.axial_w)):
        first, b = tables.axial_first[i], tables.axial_b1[i]
        _combine(nc, q, first, b, a)
        square = 0.0
        for d in range(nc):
            square += a[d] * a[d]
        length = np.sqrt(square)
        tension, modulus = axial_stress(active, p, length - 1.0)
        for d in range(nc):
            g[d] = tension * a[d] / length
        if tangent:
            # the stress part is positive only in tension
            stress = (geometric * tension if geometric != 0.0 else elastic * max(tension, 0.0)) / length
            along = (elastic * modulus - stress) / square
            for d in range(nc):
                for e in range(nc):
                    H[d, e] = along * a[d] * a[e]
                H[d, d] += stress
        _scatter_1(nc, first, b, tables.axial_w[i], g, H, tangent, f, K)
    if active[BEND] or active[DAMPING]:
        if nc == 2:
            _assemble_plane(q, v, tables, active, p, memory, scales, tangent, f, K, g, H)
        else:
            _assemble_space(q, v, tables, active, p, memory, scales, tangent, f, K, g, H)
    if active[QUADRATIC_DRAG]:
        _assemble_body(axes, q, v, tables, active, p, scales, tangent, f, K)


@law
def _assemble_plane(
    q: Any,
    v: Any,
    tables: Any,
    active: Any,
    p: Any,
    memory: Any,
    scales: Any,
    tangent: bool,
    f: Any,
    K: Any,
    g: Any,
    H: Any,
) -> None:
    elastic, viscous, geometric = scales
    a, b, da, db = np.empty(2), np.empty(2), np.zeros(2), np.zeros(2)
    kappa, rate, moment = np.empty(1), np.zeros(1), np.empty(1)
    stiffness, viscosity = np.empty((1, 1)), np.empty((1, 1))
    J = np.empty(4)
    for i in range(len(tables.curvature_w)):
        first, b1, b2 = tables.curvature_first[i], tables.curvature_b1[i], tables.curvature_b2[i]
        _combine(2, q, first, b1, a)
        _combine(2, q, first, b2, b)
        kappa[0] = plane_curvature(a, b, J, H)
        if active[DAMPING]:
            _combine(2, v, first, b1, da)
            _combine(2, v, first, b2, db)
            rate[0] = J[0] * da[0] + J[1] * da[1] + J[2] * db[0] + J[3] * db[1]
        moment[0] = 0.0
        stiffness[0, 0] = 0.0
        viscosity[0, 0] = 0.0
        curvature_stress(active, p, kappa, rate, memory[i], moment, stiffness, viscosity)
        S = elastic * stiffness[0, 0] + viscous * viscosity[0, 0]
        M = geometric * moment[0]
        for d in range(4):
            g[d] = moment[0] * J[d]
        if tangent:
            for d in range(4):
                for e in range(4):
                    H[d, e] = M * H[d, e] + S * J[d] * J[e]
        _scatter_2(2, first, b1, b2, tables.curvature_w[i], g, H, tangent, f, K)


@law
def _assemble_space(
    q: Any,
    v: Any,
    tables: Any,
    active: Any,
    p: Any,
    memory: Any,
    scales: Any,
    tangent: bool,
    f: Any,
    K: Any,
    g: Any,
    H: Any,
) -> None:
    elastic, viscous, geometric = scales
    a, b, da, db = np.empty(3), np.empty(3), np.zeros(3), np.zeros(3)
    t, kappa, rate, moment = np.empty(3), np.empty(3), np.zeros(3), np.empty(3)
    stiffness, viscosity, S = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    for i in range(len(tables.curvature_w)):
        first, b1, b2 = tables.curvature_first[i], tables.curvature_b1[i], tables.curvature_b2[i]
        _combine(3, q, first, b1, a)
        _combine(3, q, first, b2, b)
        length, h = space_curvature(a, b, t, kappa)
        if active[DAMPING]:
            _combine(3, v, first, b1, da)
            _combine(3, v, first, b2, db)
            space_curvature_rate(length, h, t, kappa, da, db, rate)
        moment[:] = 0.0
        stiffness[:] = 0.0
        viscosity[:] = 0.0
        curvature_stress(active, p, kappa, rate, memory[i], moment, stiffness, viscosity)
        space_moment(length, h, t, kappa, moment, g)
        if tangent:
            for d in range(3):
                for e in range(3):
                    S[d, e] = elastic * stiffness[d, e] + viscous * viscosity[d, e]
            _project(t, S)
            space_tangent(length, h, t, kappa, moment, S, geometric, H)
        _scatter_2(3, first, b1, b2, tables.curvature_w[i], g, H, tangent, f, K)


@law
def _project(t: Any, S: Any) -> None:
    """Project the symmetric S (3, 3) across t: P S P."""
    St = (
        S[0, 0] * t[0] + S[0, 1] * t[1] + S[0, 2] * t[2],
        S[1, 0] * t[0] + S[1, 1] * t[1] + S[1, 2] * t[2],
        S[2, 0] * t[0] + S[2, 1] * t[1] + S[2, 2] * t[2],
    )
    tSt = St[0] * t[0] + St[1] * t[1] + St[2] * t[2]
    for d in range(3):
        for e in range(3):
            S[d, e] += tSt * t[d] * t[e] - St[d] * t[e] - t[d] * St[e]


@law
def _assemble_body(
    axes: Any, q: Any, v: Any, tables: Any, active: Any, p: Any, scales: Any, tangent: bool, f: Any, K: Any
) -> None:
    nc = len(axes)
    elastic, viscous, _ = scales
    x, speed, force = np.empty(nc), np.empty(nc), np.empty(nc)
    stiffness, viscosity = np.empty((nc, nc)), np.empty((nc, nc))
    for i in range(len(tables.body_w)):
        first, b0 = tables.body_first[i], tables.body_b0[i]
        _combine(nc, q, first, b0, x)
        _combine(nc, v, first, b0, speed)
        force[:] = 0.0
        stiffness[:] = 0.0
        viscosity[:] = 0.0
        body_force(active, p, x, speed, force, stiffness, viscosity)
        for d in range(nc):
            force[d] = -force[d]
            for e in range(nc):
                stiffness[d, e] = elastic * stiffness[d, e] + viscous * viscosity[d, e]
        _scatter_1(nc, first, b0, tables.body_w[i], force, stiffness, tangent, f, K)


@kernel
def stored_energy(axes: Any, q: Any, tables: Any, active: Any, p: Any, memory: Any) -> float:
    """Return the elastic energy [J] of the control points q (n, nc)."""
    nc = len(axes)
    a, b = np.empty(nc), np.empty(nc)
    total = 0.0
    for i in range(len(tables.axial_w)):
        _combine(nc, q, tables.axial_first[i], tables.axial_b1[i], a)
        total += tables.axial_w[i] * axial_energy(active, p, np.sqrt(np.sum(a * a)) - 1.0)
    kappa = np.empty(1 if nc == 2 else 3)
    t = np.empty(3)
    J = np.empty(4)
    H = np.empty((4, 4))
    for i in range(len(tables.curvature_w)):
        _combine(nc, q, tables.curvature_first[i], tables.curvature_b1[i], a)
        _combine(nc, q, tables.curvature_first[i], tables.curvature_b2[i], b)
        if nc == 2:
            kappa[0] = plane_curvature(a, b, J, H)
        else:
            space_curvature(a, b, t, kappa)
        total += tables.curvature_w[i] * curvature_energy(active, p, kappa, memory[i])
    return total


@kernel
def axial_tension(axes: Any, q: Any, tables: Any, active: Any, p: Any) -> Any:
    """Return the tension at the axial points (points,) [N] of the control points q (n, nc)."""
    nc = len(axes)
    a = np.empty(nc)
    out = np.empty(len(tables.axial_w))
    for i in range(len(tables.axial_w)):
        _combine(nc, q, tables.axial_first[i], tables.axial_b1[i], a)
        out[i] = axial_stress(active, p, np.sqrt(np.sum(a * a)) - 1.0)[0]
    return out


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
