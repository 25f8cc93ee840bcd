"""Signed distance d [m] from the exact surface of an obstacle, with its gradient n and Hessian H [1/m].

The depth in docs/model.md eq. 21 is the radius of the cable minus this distance of its centreline.

The nearest point of a sphere, capsule, cylinder or box is known in closed form in the frame of the body. Where it lies
on a face, an edge or a corner, q = x - nearest has components only in the coordinates that the nearest point does not
follow. With D = 1 in those coordinates and 0 in the others,

    d = |q| - radius,   n = q / |q|,   H = (D - n n') / |q|.

The layout of a row is defined here, beside the compiled code that reads it: numba freezes these numbers into its cached
code, and the cache follows the source of this file but not that of `dlocore/scene/obstacles.py`.
"""

from typing import Any

import numpy as np

from dlocore.compiling.kernel import kernel, law
from dlocore.effects.base import Symmetric, Vector
from dlocore.effects.kinds import CAPSULE, CYLINDER, SPHERE

ROW = 17  # numbers in a row: kind, centre 3, axes of the body's frame 9, half sizes 3, friction

_NEAR = 1e-12  # [m]: nearer than this to a centre, an axis or an edge, the direction from it is only rounding
_FLAT = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@law
def _from_nearest(q: Vector, free: Vector, radius: float) -> tuple[float, Vector, Symmetric]:
    """Return |q| - radius, its gradient and its Hessian; `free` is the diagonal of D."""
    x, y, z = q
    length = np.sqrt(x * x + y * y + z * z)
    if length < _NEAR:
        return length - radius, (1.0, 0.0, 0.0), _FLAT
    s = 1.0 / length
    x, y, z = s * x, s * y, s * z
    diagonal = (s * (free[0] - x * x), s * (free[1] - y * y), s * (free[2] - z * z))
    return length - radius, (x, y, z), (*diagonal, -s * x * y, -s * x * z, -s * y * z)


@law
def _capsule(p: Vector, radius: float, half: float) -> tuple[float, Vector, Symmetric]:
    """Return the distance, its gradient and its Hessian at p, in the frame of the body."""
    x, y, z = p
    if z > half:
        return _from_nearest((x, y, z - half), (1.0, 1.0, 1.0), radius)
    if z < -half:
        return _from_nearest((x, y, z + half), (1.0, 1.0, 1.0), radius)
    return _from_nearest((x, y, 0.0), (1.0, 1.0, 0.0), radius)


@law
def _cylinder(p: Vector, radius: float, half: float) -> tuple[float, Vector, Symmetric]:
    """Return the distance, its gradient and its Hessian at p, in the frame of the body."""
    x, y, z = p
    rho = np.sqrt(x * x + y * y)
    side = 1.0 if z >= 0.0 else -1.0
    out, up = rho - radius, side * z - half
    c, s, bend = 1.0, 0.0, 0.0  # direction from the axis and the curvature 1/rho across it
    if rho >= _NEAR:
        bend = 1.0 / rho
        c, s = bend * x, bend * y
    if out > _NEAR and up > _NEAR:  # the edge, which is a circle
        length = np.sqrt(out * out + up * up)
        a, b = out / length, side * up / length
        # in the half plane of rho and z the curvature across n is 1/d; along the circle it is n_rho/rho
        across, around = b * b / length, a * bend
        diagonal = (across * c * c + around * s * s, across * s * s + around * c * c, a * a / length)
        slope = -a * b / length
        return length, (a * c, a * s, b), (*diagonal, (across - around) * c * s, slope * c, slope * s)
    if out >= up:
        return out, (c, s, 0.0), (bend * s * s, bend * c * c, 0.0, -bend * c * s, 0.0, 0.0)
    return up, (0.0, 0.0, side), _FLAT


@law
def _box(p: Vector, half: Vector) -> tuple[float, Vector, Symmetric]:
    """Return the distance, its gradient and its Hessian at p, in the frame of the body."""
    i = 1.0 if p[0] >= 0.0 else -1.0
    j = 1.0 if p[1] >= 0.0 else -1.0
    k = 1.0 if p[2] >= 0.0 else -1.0
    x, y, z = i * p[0] - half[0], j * p[1] - half[1], k * p[2] - half[2]
    if x > _NEAR or y > _NEAR or z > _NEAR:
        free_x = 1.0 if x > _NEAR else 0.0
        free_y = 1.0 if y > _NEAR else 0.0
        free_z = 1.0 if z > _NEAR else 0.0
        return _from_nearest((free_x * i * x, free_y * j * y, free_z * k * z), (free_x, free_y, free_z), 0.0)
    if x >= y and x >= z:
        return x, (i, 0.0, 0.0), _FLAT
    if y >= z:
        return y, (0.0, j, 0.0), _FLAT
    return z, (0.0, 0.0, k), _FLAT


@law
def _times(H: Symmetric, v: Vector) -> Vector:
    return (
        H[0] * v[0] + H[3] * v[1] + H[4] * v[2],
        H[3] * v[0] + H[1] * v[1] + H[5] * v[2],
        H[4] * v[0] + H[5] * v[1] + H[2] * v[2],
    )


@law
def _dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@law
def signed_distance(rows: Any, k: int, x: Vector) -> tuple[float, Vector, Symmetric]:
    """Return the distance [m] of x from the surface of obstacle k, its gradient and its Hessian [1/m].

    `rows` is (m, ROW). The distance is negative inside; the gradient is the outward unit normal. Inside a cylinder or a
    box, the nearest face counts. Where several points of the surface are equally near, as at the centre of a sphere,
    the gradient points to one of them; where these are a whole circle or sphere, the Hessian is zero.
    """
    kind = rows[k, 0]
    q = (x[0] - rows[k, 1], x[1] - rows[k, 2], x[2] - rows[k, 3])
    half = (rows[k, 13], rows[k, 14], rows[k, 15])
    if kind == SPHERE:
        return _from_nearest(q, (1.0, 1.0, 1.0), half[0])
    first = (rows[k, 4], rows[k, 5], rows[k, 6])
    second = (rows[k, 7], rows[k, 8], rows[k, 9])
    third = (rows[k, 10], rows[k, 11], rows[k, 12])
    p = (_dot(first, q), _dot(second, q), _dot(third, q))
    if kind == CAPSULE:
        d, n, H = _capsule(p, half[0], half[2])
    elif kind == CYLINDER:
        d, n, H = _cylinder(p, half[0], half[2])
    else:
        d, n, H = _box(p, half)
    a = (first[0], second[0], third[0])  # the world's axes in the frame of the body
    b = (first[1], second[1], third[1])
    c = (first[2], second[2], third[2])
    Ha, Hb, Hc = _times(H, a), _times(H, b), _times(H, c)
    turned = (_dot(a, Ha), _dot(b, Hb), _dot(c, Hc), _dot(a, Hb), _dot(a, Hc), _dot(b, Hc))
    return d, (_dot(a, n), _dot(b, n), _dot(c, n)), turned


@law
def to_edge(rows: Any, k: int, x: Vector) -> float:
    """Return the distance [m] from an edge of obstacle k of its surface point nearest to x.

    It is negative where that point is on an edge, and infinite for spheres and capsules, which have none.
    """
    if rows[k, 0] == SPHERE or rows[k, 0] == CAPSULE:
        return np.inf
    q = (x[0] - rows[k, 1], x[1] - rows[k, 2], x[2] - rows[k, 3])
    a = abs(_dot((rows[k, 4], rows[k, 5], rows[k, 6]), q))
    b = abs(_dot((rows[k, 7], rows[k, 8], rows[k, 9]), q))
    c = abs(_dot((rows[k, 10], rows[k, 11], rows[k, 12]), q)) - rows[k, 15]
    if rows[k, 0] == CYLINDER:
        return -min(np.sqrt(a * a + b * b) - rows[k, 13], c)
    a, b = a - rows[k, 13], b - rows[k, 14]
    return min(max(-a, -b), max(-a, -c), max(-b, -c))  # minus the second largest


@kernel
def distances(rows: Any, points: Any) -> Any:
    """Return the signed distances (n, m) [m] of `points` (n, 3) from the obstacles of `rows` (m, ROW)."""
    n, m = len(points), len(rows)
    out = np.empty((n, m))
    for i in range(n):
        x = (points[i, 0], points[i, 1], points[i, 2])
        for k in range(m):
            out[i, k] = signed_distance(rows, k, x)[0]
    return out
