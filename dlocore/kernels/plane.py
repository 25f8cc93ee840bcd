"""Assembly in the plane: two coordinates, one signed curvature.

Everything local to a point is scalars and tuples, never small arrays, so that the compiler keeps it in registers. This
is more than twice as fast (docs/model.md, cost).
"""

from typing import Any

import numpy as np

from dlocore.compiling.kernel import law, leaf, part
from dlocore.effects.laws import (
    BENDING_MEMORY,
    DAMPING,
    STRETCH_DAMPING,
    axial_energy,
    axial_stress,
    body_force,
    curvature_energy,
    curvature_memory,
    curvature_stress,
)
from dlocore.kernels.basis import row_of
from dlocore.kernels.strain import plane_curvature, plane_hessian
from dlocore.kernels.tension import AT_HAND, MODULUS, assumed


@law
def _combine(q: Any, k: int, b: tuple[float, float, float, float]) -> tuple[float, float]:
    x = b[0] * q[k, 0] + b[1] * q[k + 1, 0] + b[2] * q[k + 2, 0] + b[3] * q[k + 3, 0]
    y = b[0] * q[k, 1] + b[1] * q[k + 1, 1] + b[2] * q[k + 2, 1] + b[3] * q[k + 3, 1]
    return x, y


@law
def _add_block(K: Any, k: int, i: int, j: int, xx: float, xy: float, yx: float, yy: float) -> None:
    """Add the block of control points k + i and k + j, i >= j; `xy` is row x, column y."""
    column, offset = 2 * (k + j), 2 * (i - j)
    K[column, offset] += xx
    K[column, offset + 1] += yx
    K[column + 1, offset] += yy
    if i > j:
        K[column + 1, offset - 1] += xy


@part
def axial(
    q: Any, v: Any, points: Any, active: Any, p: Any, past: Any, kept: Any, rates: Any, scales: Any, tangent: bool,
    f: Any, K: Any,
) -> None:  # fmt: skip
    """Add the forces and tangents of the axial site.

    `past` holds the stress-free strain and the strain of the last two steps; `kept` is `History.tension`.
    """
    elastic, viscous, geometric = scales
    if viscous != 0.0 and rates[0] != 0.0:
        viscous = rates[0]
    firsts, b1, weights = points.first, points.b1, points.w
    for n in range(len(weights)):
        k, w = firsts[n], weights[n]
        b = row_of(b1, n)
        x, y = _combine(q, k, b)
        length = np.sqrt(x * x + y * y)
        inverse = 1.0 / length
        strain, rate = length - 1.0, 0.0
        if active[STRETCH_DAMPING] and rates[0] != 0.0:
            rate = rates[0] * strain + rates[1] * past[n, 1] + rates[2] * past[n, 2]
        elif active[STRETCH_DAMPING]:
            vx, vy = _combine(v, k, b)
            rate = (x * vx + y * vy) * inverse
        tension, modulus, viscosity = axial_stress(
            active, p, strain, rate, past[n, 0], past[n, 1], rates[3], points.share[n]
        )
        if len(kept) > 0:
            kept[n, AT_HAND], kept[n, MODULUS] = tension, modulus + rates[0] * viscosity
        g = w * tension * inverse
        gx, gy = g * x, g * y
        for i in range(4):
            f[k + i, 0] += b[i] * gx
            f[k + i, 1] += b[i] * gy
        if tangent:
            # the part due to the stress is positive only in tension
            pull = assumed(kept, n, tension) if geometric != 0.0 else tension
            stress = w * (geometric * pull if geometric != 0.0 else elastic * max(pull, 0.0)) * inverse
            along = (w * (elastic * modulus + viscous * viscosity) - stress) * inverse * inverse
            xx, xy, yy = along * x * x + stress, along * x * y, along * y * y + stress
            for j in range(4):
                for i in range(j, 4):
                    s = b[i] * b[j]
                    _add_block(K, k, i, j, s * xx, s * xy, s * xy, s * yy)


@part
def curvature(
    q: Any, v: Any, points: Any, active: Any, p: Any, memory: Any, past: Any, rates: Any, scales: Any, tangent: bool,
    f: Any, K: Any,
) -> None:  # fmt: skip
    """Add the forces and tangents of the curvature site; `past` holds kappa of the last two steps (points, 2)."""
    elastic, viscous, geometric = scales
    if viscous != 0.0 and rates[0] != 0.0:
        viscous = rates[0]
    firsts, b1, b2, weights = points.first, points.b1, points.b2, points.w
    for n in range(len(weights)):
        k, w = firsts[n], weights[n]
        b, c = row_of(b1, n), row_of(b2, n)
        ax, ay = _combine(q, k, b)
        cx, cy = _combine(q, k, c)
        kappa, J = plane_curvature(ax, ay, cx, cy)
        rate = 0.0
        if active[DAMPING] and rates[0] != 0.0:
            rate = rates[0] * kappa + rates[1] * past[n, 0] + rates[2] * past[n, 1]
        elif active[DAMPING]:
            vx, vy = _combine(v, k, b)
            ux, uy = _combine(v, k, c)
            rate = J[0] * vx + J[1] * vy + J[2] * ux + J[3] * uy
        last = past[n, 0] if active[BENDING_MEMORY] else 0.0
        moment, stiffness, viscosity = curvature_stress(
            active, p, (kappa, 0.0, 0.0), (rate, 0.0, 0.0), (memory[n, 0], 0.0, 0.0), (memory[n, 1], 0.0, 0.0),
            (last, 0.0, 0.0), rates[3],
        )  # fmt: skip
        M = w * moment[0]
        g0, g1, g2, g3 = M * J[0], M * J[1], M * J[2], M * J[3]
        for i in range(4):
            f[k + i, 0] += b[i] * g0 + c[i] * g2
            f[k + i, 1] += b[i] * g1 + c[i] * g3
        if tangent:
            S = w * (elastic * stiffness[0] + viscous * viscosity[0])
            H = plane_hessian(ax, ay, cx, cy, kappa)
            M *= geometric
            # second derivatives of the energy: r' and r', r' (rows) and r'', r'' and r''
            s0, s1, s2, s3 = S * J[0], S * J[1], S * J[2], S * J[3]
            aa, ab, bb = s0 * J[0] + M * H[0], s0 * J[1] + M * H[1], s1 * J[1] + M * H[2]
            ac, ad, bc, bd = s0 * J[2] + M * H[3], s0 * J[3] + M * H[4], s1 * J[2] + M * H[5], s1 * J[3] + M * H[6]
            cc, cd, dd = s2 * J[2], s2 * J[3], s3 * J[3]
            for j in range(4):
                bj, cj = b[j], c[j]
                # derivatives of the forces conjugate to r' and r'' with respect to control point j: rows, columns x, y
                pxx, pxy, pyx, pyy = bj * aa + cj * ac, bj * ab + cj * ad, bj * ab + cj * bc, bj * bb + cj * bd
                rxx, rxy, ryx, ryy = bj * ac + cj * cc, bj * bc + cj * cd, bj * ad + cj * cd, bj * bd + cj * dd
                for i in range(j, 4):
                    bi, ci = b[i], c[i]
                    _add_block(
                        K, k, i, j,
                        bi * pxx + ci * rxx, bi * pxy + ci * rxy, bi * pyx + ci * ryx, bi * pyy + ci * ryy,
                    )  # fmt: skip


@law
def curvature_at(q: Any, points: Any, n: int) -> float:
    """Return the curvature [1/m] of q at a curvature point."""
    k = points.first[n]
    ax, ay = _combine(q, k, row_of(points.b1, n))
    cx, cy = _combine(q, k, row_of(points.b2, n))
    return plane_curvature(ax, ay, cx, cy)[0]


@leaf
def remember(q: Any, points: Any, active: Any, p: Any, memory: Any, past: Any, h: float) -> None:
    """Shift `past` (points, 2) so that kappa of q is its last entry, and let what yielded in a step h become memory."""
    for n in range(len(past)):
        kappa = curvature_at(q, points, n)
        free, _ = curvature_memory(
            active, p, (kappa, 0.0, 0.0), (memory[n, 0], 0.0, 0.0), (memory[n, 1], 0.0, 0.0), (past[n, 0], 0.0, 0.0), h
        )
        memory[n, 0] = free[0]
        past[n, 1] = past[n, 0]
        past[n, 0] = kappa


@part
def body(q: Any, v: Any, points: Any, active: Any, p: Any, scales: Any, tangent: bool, f: Any, K: Any) -> None:
    """Subtract the forces, and add the tangents, of the body site."""
    elastic, viscous, _ = scales
    firsts, b0, weights = points.first, points.b0, points.w
    for n in range(len(weights)):
        k, w = firsts[n], weights[n]
        b = row_of(b0, n)
        x, y = _combine(q, k, b)
        vx, vy = _combine(v, k, b)
        force, stiffness, viscosity = body_force(active, p, (x, y, 0.0), (vx, vy, 0.0))
        for i in range(4):
            f[k + i, 0] -= w * b[i] * force[0]
            f[k + i, 1] -= w * b[i] * force[1]
        if tangent:
            xx = w * (elastic * stiffness[0] + viscous * viscosity[0])
            yy = w * (elastic * stiffness[1] + viscous * viscosity[1])
            xy = w * (elastic * stiffness[3] + viscous * viscosity[3])
            for j in range(4):
                for i in range(j, 4):
                    s = b[i] * b[j]
                    _add_block(K, k, i, j, s * xx, s * xy, s * xy, s * yy)


@leaf
def energy(q: Any, tables: Any, active: Any, p: Any, memory: Any, past: Any) -> float:
    """Return the stored energy [J]."""
    total = 0.0
    for n in range(len(tables.axial.w)):
        x, y = _combine(q, tables.axial.first[n], row_of(tables.axial.b1, n))
        total += tables.axial.w[n] * axial_energy(active, p, np.sqrt(x * x + y * y) - 1.0, past[n, 0])
    for n in range(len(tables.curvature.w)):
        kappa = curvature_at(q, tables.curvature, n)
        total += tables.curvature.w[n] * curvature_energy(active, p, (kappa, 0.0, 0.0), (memory[n, 0], 0.0, 0.0))
    return total
