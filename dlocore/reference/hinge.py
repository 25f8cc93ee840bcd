"""The hinge of a discrete elastic rod: bend and twist between two edges, with first and second derivatives.

The edges have unit tangents t0, t1 and directors a, b perpendicular to them (b = t x a). Their bends are

    s_1 = (t1.a0 - t0.a1)/chi,   s_2 = (t1.b0 - t0.b1)/chi,   chi = 1 + t0.t1,

the components in the frame of the sections of the curvature binormal 2 t0 x t1/chi, turned by a right angle (Bergou et
al., Discrete viscous threads, 2010). Their twist s_3 is the angle from a0, carried to t1 by the smallest rotation, to
a1. Divided by the length between the midpoints of the edges they are curvatures and twist rate.

Variations are those of the tangents, eta0 and eta1, with directors that do not spin, and the spins alpha0, alpha1 about
the tangents: y = (eta0, eta1, alpha0, alpha1), eight numbers.
"""

from typing import Any

import numpy as np

from dlocore.reference.compile import compiled

FOLDED = 1e-3  # chi below which an edge is folded back on the one before it


@compiled
def dot(a: Any, b: Any) -> float:
    """Return a . b of vectors (3,)."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compiled
def cross(a: Any, b: Any, out: Any) -> None:
    """Write a x b into `out` (3,)."""
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]


@compiled
def carry(before: Any, after: Any, x: Any, angle: float, first: Any, second: Any) -> None:
    """Carry the director x (3,) from its tangent `before` to the tangent `after` by the smallest rotation, and spin it.

    Write the director and `after` x director, both of unit length, into `first` and `second` (3,).
    """
    scale = dot(x, after) / (1.0 + dot(before, after))
    for d in range(3):
        first[d] = x[d] - scale * (before[d] + after[d])
    along = dot(first, after)
    for d in range(3):
        first[d] -= along * after[d]
    size = np.sqrt(dot(first, first))
    for d in range(3):
        first[d] /= size
    cross(after, first, second)
    if angle != 0.0:
        c, s = np.cos(angle), np.sin(angle)
        for d in range(3):
            x0, x1 = first[d], second[d]
            first[d] = c * x0 + s * x1
            second[d] = c * x1 - s * x0


@compiled
def strains(t0: Any, a0: Any, b0: Any, t1: Any, a1: Any, b1: Any, turn: float, s: Any) -> None:
    """Write bends and twist of a hinge into s (3,); the twist is the equivalent angle nearest to `turn` [rad]."""
    chi = 1.0 + dot(t0, t1)
    s[0] = (dot(t1, a0) - dot(t0, a1)) / chi
    s[1] = (dot(t1, b0) - dot(t0, b1)) / chi
    # a0 carried to t1 is a0 - (a0.t1)/chi (t0 + t1)
    scale = dot(a0, t1) / chi
    x = dot(a0, a1) - scale * dot(t0, a1)
    y = dot(a0, b1) - scale * dot(t0, b1)
    angle = -np.arctan2(y, x)
    s[2] = angle + 2.0 * np.pi * np.round((turn - angle) / (2.0 * np.pi))


@compiled
def gradients(t0: Any, a0: Any, b0: Any, t1: Any, a1: Any, b1: Any, s: Any, B: Any) -> None:
    """Write the derivatives of the strains s (3,) with respect to y into B (3, 8)."""
    c = dot(t0, t1)
    chi = 1.0 + c
    for d in range(3):
        B[0, d] = (-c * a0[d] - a1[d] - s[0] * t1[d]) / chi
        B[0, 3 + d] = (a0[d] + c * a1[d] - s[0] * t0[d]) / chi
        B[1, d] = (-c * b0[d] - b1[d] - s[1] * t1[d]) / chi
        B[1, 3 + d] = (b0[d] + c * b1[d] - s[1] * t0[d]) / chi
    B[0, 6], B[0, 7] = dot(t1, b0) / chi, -dot(t0, b1) / chi
    B[1, 6], B[1, 7] = -dot(t1, a0) / chi, dot(t0, a1) / chi
    B[2, 0] = B[2, 3] = (t0[1] * t1[2] - t0[2] * t1[1]) / chi
    B[2, 1] = B[2, 4] = (t0[2] * t1[0] - t0[0] * t1[2]) / chi
    B[2, 2] = B[2, 5] = (t0[0] * t1[1] - t0[1] * t1[0]) / chi
    B[2, 6], B[2, 7] = -1.0, 1.0


@compiled
def add_curvature_of_strains(
    t0: Any, a0: Any, b0: Any, t1: Any, a1: Any, b1: Any, s: Any, B: Any, stress: Any, H: Any
) -> None:
    """Add the second derivatives of the strains with respect to y, times `stress` (3,), to H (8, 8)."""
    c = dot(t0, t1)
    chi = 1.0 + c
    M1, M2, T = stress[0] / chi, stress[1] / chi, stress[2] / chi
    tension = -(M1 * s[0] + M2 * s[1])  # factor of the second derivative of chi, which is the unit matrix
    H[6, 6] -= M1 * dot(t1, a0) + M2 * dot(t1, b0)
    H[7, 7] += M1 * dot(t0, a1) + M2 * dot(t0, b1)
    for i in range(3):
        spin0, spin1 = M1 * b0[i] - M2 * a0[i], M1 * b1[i] - M2 * a1[i]
        H[6, i] -= c * spin0
        H[i, 6] -= c * spin0
        H[6, 3 + i] += spin0
        H[3 + i, 6] += spin0
        H[7, 3 + i] += c * spin1
        H[3 + i, 7] += c * spin1
        H[7, i] -= spin1
        H[i, 7] -= spin1
        k_i = B[2, i]  # t0 x t1/chi
        m0i, m1i = M1 * a0[i] + M2 * b0[i], M1 * a1[i] + M2 * b1[i]
        for j in range(3):
            k_j = B[2, j]
            m0j, m1j = M1 * a0[j] + M2 * b0[j], M1 * a1[j] + M2 * b1[j]
            H[i, j] -= 0.5 * (m0i * t1[j] + t1[i] * m0j) + 0.5 * T * (k_i * t1[j] + t1[i] * k_j)
            H[3 + i, 3 + j] += 0.5 * (m1i * t0[j] + t0[i] * m1j) - 0.5 * T * (k_i * t0[j] + t0[i] * k_j)
            mixed = -m0i * t0[j] + t1[i] * m1j - 0.5 * T * (k_i * t0[j] + t1[i] * k_j)
            if i == j:
                mixed += tension
            else:  # the matrix of (t0 + t1) x, halved
                k = 3 - i - j
                side = -1.0 if (j - i) % 3 == 1 else 1.0
                mixed += 0.5 * T * side * (t0[k] + t1[k])
            H[i, 3 + j] += mixed
            H[3 + j, i] += mixed
    # - (ds dchi' + dchi ds') / chi, the rest of the quotient rule: dchi = (t1, t0, 0, 0)
    for i in range(8):
        bend = M1 * B[0, i] + M2 * B[1, i]
        for j in range(3):
            H[i, j] -= bend * t1[j]
            H[j, i] -= bend * t1[j]
            H[i, 3 + j] -= bend * t0[j]
            H[3 + j, i] -= bend * t0[j]
