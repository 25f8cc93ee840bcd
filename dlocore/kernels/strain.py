"""Strain of the centreline and the generalised forces of stress: all geometry of the model lies here.

With l = |r'|, t = r'/l and P = I - t t' (docs/model.md eq. 3 to 6):

    axial strain  e = l - 1,
    curvature     kappa = dt/du = P r''/l; in the plane its signed value (r' x r'')/l^2.

A moment M conjugate to kappa gives generalised forces g1, g2 conjugate to r', r''; its tangent has a material part
J'SJ, positive semidefinite, and a geometric part M . d2kappa. In space M and kappa are vectors across the tangent.
"""

from typing import Any

import numpy as np

from dlocore.kernels.compile import law


@law
def plane_curvature(a: Any, b: Any, J: Any, H: Any) -> float:
    """Return kappa [1/m] of r' = a, r'' = b (2,), and write J = dkappa (4,) and H = d2kappa (4, 4) by (r', r'')."""
    square = a[0] * a[0] + a[1] * a[1]
    inverse = 1.0 / square
    kappa = (a[0] * b[1] - a[1] * b[0]) * inverse
    n0, n1 = b[1] * inverse, -b[0] * inverse  # cross-product part of the derivative, over l^2
    n2, n3 = -a[1] * inverse, a[0] * inverse
    s0, s1 = 2.0 * a[0] * inverse, 2.0 * a[1] * inverse  # derivative of log l^2
    J[0] = n0 - kappa * s0
    J[1] = n1 - kappa * s1
    J[2] = n2
    J[3] = n3
    H[0, 0] = -2.0 * n0 * s0 + kappa * (2.0 * s0 * s0 - 2.0 * inverse)
    H[1, 1] = -2.0 * n1 * s1 + kappa * (2.0 * s1 * s1 - 2.0 * inverse)
    H[0, 1] = -n0 * s1 - n1 * s0 + 2.0 * kappa * s0 * s1
    H[0, 2] = -n2 * s0
    H[0, 3] = inverse - n3 * s0
    H[1, 2] = -inverse - n2 * s1
    H[1, 3] = -n3 * s1
    H[2, 2] = 0.0
    H[2, 3] = 0.0
    H[3, 3] = 0.0
    for i in range(4):
        for j in range(i):
            H[i, j] = H[j, i]
    return kappa


@law
def space_curvature(a: Any, b: Any, t: Any, kappa: Any) -> tuple[float, float]:
    """Write the unit tangent t and curvature vector kappa [1/m] of r' = a, r'' = b (3,); return l and h = t . r''."""
    length = np.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])
    for d in range(3):
        t[d] = a[d] / length
    h = t[0] * b[0] + t[1] * b[1] + t[2] * b[2]
    for d in range(3):
        kappa[d] = (b[d] - h * t[d]) / length
    return length, h


@law
def space_curvature_rate(length: float, h: float, t: Any, kappa: Any, da: Any, db: Any, rate: Any) -> None:
    """Write the rate of kappa seen by sections that do not spin, P kappa_t, of the rates da of r' and db of r''."""
    da_t = t[0] * da[0] + t[1] * da[1] + t[2] * da[2]
    db_t = t[0] * db[0] + t[1] * db[1] + t[2] * db[2]
    for d in range(3):
        rate[d] = ((db[d] - db_t * t[d]) - h * (da[d] - da_t * t[d]) / length - kappa[d] * da_t) / length


@law
def space_moment(length: float, h: float, t: Any, kappa: Any, M: Any, g: Any) -> None:
    """Write the generalised forces g (6,) by (r', r'') of the moment vector M across the tangent."""
    dot = (M[0] * kappa[0] + M[1] * kappa[1] + M[2] * kappa[2]) / length
    for d in range(3):
        g[d] = -h * M[d] / (length * length) - dot * t[d]
        g[3 + d] = M[d] / length


@law
def space_tangent(length: float, h: float, t: Any, kappa: Any, M: Any, S: Any, geometric: float, H: Any) -> None:
    """Write the tangent H (6, 6) by (r', r''): J'SJ + `geometric` times the symmetric part of M . d2kappa.

    M and S act across the tangent: S t = 0.
    """
    l2 = length * length
    Sk = (
        S[0, 0] * kappa[0] + S[0, 1] * kappa[1] + S[0, 2] * kappa[2],
        S[1, 0] * kappa[0] + S[1, 1] * kappa[1] + S[1, 2] * kappa[2],
        S[2, 0] * kappa[0] + S[2, 1] * kappa[1] + S[2, 2] * kappa[2],
    )
    dot = geometric * (M[0] * kappa[0] + M[1] * kappa[1] + M[2] * kappa[2])
    kSk = Sk[0] * kappa[0] + Sk[1] * kappa[1] + Sk[2] * kappa[2]
    for i in range(3):
        for j in range(3):
            unit = 1.0 if i == j else 0.0
            tt = t[i] * t[j]
            MtM = geometric * (M[i] * t[j] + t[i] * M[j])
            Mk = 0.5 * geometric * (M[i] * kappa[j] + kappa[i] * M[j])
            SttS = Sk[i] * t[j] + t[i] * Sk[j]
            H[3 + i, 3 + j] = S[i, j] / l2
            H[3 + i, j] = -(h * S[i, j] / length + Sk[i] * t[j] + MtM) / l2
            H[j, 3 + i] = H[3 + i, j]
            H[i, j] = (
                h * h * S[i, j] / l2 + (kSk + 2.0 * dot) * tt - dot * (unit - tt) + h / length * (SttS + 2.0 * MtM) - Mk
            ) / l2
