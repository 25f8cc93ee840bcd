"""Strain of the centreline and the generalised forces of stress: all geometry of the model is here.

With l = |r'|, t = r'/l and P = I - t t' (docs/model.md eq. 3 to 6):

    axial strain  e = l - 1,
    curvature     kappa = dt/du = P r''/l; in the plane its signed value (r' x r'')/l^2.

A moment M conjugate to kappa gives generalised forces g1, g2 conjugate to r', r''. Its tangent has a material part
J'SJ, which is positive semidefinite, and a geometric part M . d2kappa. In space M and kappa are vectors perpendicular
to the tangent.
"""

from typing import Any

import numpy as np

from dlocore.compiling.kernel import law
from dlocore.effects.base import Vector


@law
def vector(table: Any, n: int, at: int) -> Vector:
    """Return columns `at` to `at` + 2 of row n."""
    return table[n, at], table[n, at + 1], table[n, at + 2]


@law
def squared_slope(q: Any, first: int, b1: tuple[float, float, float, float], dimensions: int) -> float:
    """Return |r'|^2 of control points q (n, nc) where the four basis functions from `first` have derivatives b1."""
    square = 0.0
    for d in range(dimensions):
        slope = b1[0] * q[first, d] + b1[1] * q[first + 1, d] + b1[2] * q[first + 2, d] + b1[3] * q[first + 3, d]
        square += slope * slope
    return square


@law
def plane_curvature(ax: float, ay: float, cx: float, cy: float) -> tuple[float, tuple[float, float, float, float]]:
    """Return kappa [1/m] of r' = (ax, ay), r'' = (cx, cy), and its derivatives with respect to r' and r''."""
    inverse = 1.0 / (ax * ax + ay * ay)
    kappa = (ax * cy - ay * cx) * inverse
    twice = 2.0 * kappa
    return kappa, ((cy - twice * ax) * inverse, -(cx + twice * ay) * inverse, -ay * inverse, ax * inverse)


@law
def plane_hessian(
    ax: float, ay: float, cx: float, cy: float, kappa: float
) -> tuple[float, float, float, float, float, float, float]:
    """Return the second derivatives of kappa: r' and r' (xx, xy, yy), then r' and r'' (xx, xy, yx, yy)."""
    inverse = 1.0 / (ax * ax + ay * ay)
    n0, n1 = cy * inverse, -cx * inverse  # cross-product part of the derivative, over l^2
    n2, n3 = -ay * inverse, ax * inverse
    s0, s1 = 2.0 * ax * inverse, 2.0 * ay * inverse  # derivative of log l^2
    xx = -2.0 * n0 * s0 + kappa * (2.0 * s0 * s0 - 2.0 * inverse)
    xy = -n0 * s1 - n1 * s0 + 2.0 * kappa * s0 * s1
    yy = -2.0 * n1 * s1 + kappa * (2.0 * s1 * s1 - 2.0 * inverse)
    return xx, xy, yy, -n2 * s0, inverse - n3 * s0, -inverse - n2 * s1, -n3 * s1


@law
def space_curvature(a: Vector, c: Vector) -> tuple[float, float, Vector, Vector]:
    """Return l, h = t . r'', the unit tangent t and the curvature vector kappa [1/m] of r' = a, r'' = c."""
    length = np.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])
    inverse = 1.0 / length
    t = (a[0] * inverse, a[1] * inverse, a[2] * inverse)
    h = t[0] * c[0] + t[1] * c[1] + t[2] * c[2]
    return length, h, t, ((c[0] - h * t[0]) * inverse, (c[1] - h * t[1]) * inverse, (c[2] - h * t[2]) * inverse)


@law
def space_curvature_rate(length: float, h: float, t: Vector, kappa: Vector, da: Vector, dc: Vector) -> Vector:
    """Return the rate of kappa seen by sections that do not spin, P kappa_t, from the rates da of r' and dc of r''."""
    da_t = t[0] * da[0] + t[1] * da[1] + t[2] * da[2]
    dc_t = t[0] * dc[0] + t[1] * dc[1] + t[2] * dc[2]
    inverse = 1.0 / length
    s = h * inverse
    return (
        (dc[0] - dc_t * t[0] - s * (da[0] - da_t * t[0]) - kappa[0] * da_t) * inverse,
        (dc[1] - dc_t * t[1] - s * (da[1] - da_t * t[1]) - kappa[1] * da_t) * inverse,
        (dc[2] - dc_t * t[2] - s * (da[2] - da_t * t[2]) - kappa[2] * da_t) * inverse,
    )


@law
def cross(a: Vector, b: Vector) -> Vector:
    """Return a x b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@law
def transport(t0: Vector, t1: Vector, x: Vector) -> Vector:
    """Return x after the smallest rotation that brings the unit vector t0 to t1 (parallel transport)."""
    cosine = t0[0] * t1[0] + t0[1] * t1[1] + t0[2] * t1[2]
    if cosine < -0.999999:
        return x
    b = (t0[1] * t1[2] - t0[2] * t1[1], t0[2] * t1[0] - t0[0] * t1[2], t0[0] * t1[1] - t0[1] * t1[0])
    s = (b[0] * x[0] + b[1] * x[1] + b[2] * x[2]) / (1.0 + cosine)
    return (
        cosine * x[0] + b[1] * x[2] - b[2] * x[1] + s * b[0],
        cosine * x[1] + b[2] * x[0] - b[0] * x[2] + s * b[1],
        cosine * x[2] + b[0] * x[1] - b[1] * x[0] + s * b[2],
    )


@law
def twist_increment(t0: Vector, k0: Vector, t: Vector, kappa: Vector) -> tuple[float, Vector, Vector]:
    """Return the increase of the twist rate of a frame that is carried from t0 to t, and its derivatives.

    A frame without twist along the cable has the tangent t0 with t0' = k0. At every point it is turned by the smallest
    rotation that brings t0 to t, where t' = kappa. Its twist rate is then (docs/model.md eq. 19)

        s (t x t0) . (k0 + kappa),  s = 1/(1 + t . t0).

    Returns:
        that twist rate tau [rad/m]; d tau/d kappa = spin = s (t x t0), which is also how much the carried frame spins
        about t for each change of t; d tau/dt.
    """
    s = 1.0 / (1.0 + t[0] * t0[0] + t[1] * t0[1] + t[2] * t0[2])
    spin = (
        s * (t[1] * t0[2] - t[2] * t0[1]),
        s * (t[2] * t0[0] - t[0] * t0[2]),
        s * (t[0] * t0[1] - t[1] * t0[0]),
    )
    w = (k0[0] + kappa[0], k0[1] + kappa[1], k0[2] + kappa[2])
    twist = spin[0] * w[0] + spin[1] * w[1] + spin[2] * w[2]
    change = s * twist
    return (
        twist,
        spin,
        (
            s * (t0[1] * w[2] - t0[2] * w[1]) - change * t0[0],
            s * (t0[2] * w[0] - t0[0] * w[2]) - change * t0[1],
            s * (t0[0] * w[1] - t0[1] * w[0]) - change * t0[2],
        ),
    )


@law
def space_moment(length: float, h: float, t: Vector, kappa: Vector, M: Vector) -> tuple[Vector, Vector]:
    """Return the generalised forces by r' and by r'' of the moment vector M perpendicular to the tangent."""
    inverse = 1.0 / length
    dot = (M[0] * kappa[0] + M[1] * kappa[1] + M[2] * kappa[2]) * inverse
    s = -h * inverse * inverse
    by_first = (s * M[0] - dot * t[0], s * M[1] - dot * t[1], s * M[2] - dot * t[2])
    return by_first, (M[0] * inverse, M[1] * inverse, M[2] * inverse)
