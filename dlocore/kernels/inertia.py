"""Inertia and drag of a time step: the contributions of the mass and drag matrices to residual and tangent.

The drag matrix is a density times the unit matrix of the basis, the integrals of b_i b_j du. The mass matrix is another
density times the same matrix with the point masses (`basis.Tables.inertia`). Both are the same for every coordinate.
"""

from typing import Any

import numpy as np

from dlocore.compiling.kernel import kernel, part

_REACH = 3  # control points on either side that share a span with a control point


@kernel
def both_sides(unit: Any) -> Any:
    """Return the rows (n, 7), from left to right, of the symmetric matrix with the lower band `unit` (n, 4) [m]."""
    n = len(unit)
    rows = np.zeros((n, 2 * _REACH + 1))
    for i in range(n):
        for o in range(min(_REACH + 1, n - i)):
            rows[i, _REACH + o] = unit[i, o]
            rows[i + o, _REACH - o] = unit[i, o]
    return rows


@kernel
def padded(n: int, nc: int) -> Any:
    """Allocate workspace (n + 6, 2 nc) for vectors that `residual` multiplies by matrices; its end rows are zero."""
    return np.zeros((n + 2 * _REACH, 2 * nc))


@part
def residual(
    nc: int, heavy: Any, rows: Any, density: float, dragged: float, alpha_m: float, alpha_f: float, a: Any, a1: Any,
    v1: Any, load: Any, G: Any, f: Any, R: Any, stacked: Any,
) -> None:  # fmt: skip
    """Turn f into G1 = f + C v1 - load, and write the residual R of a step, all (n, nc) [N].

    R = M [(1 - alpha_m) a1 + alpha_m a] + (1 - alpha_f) G1 + alpha_f G.

    Args:
        nc: coordinates of a control point.
        heavy, rows: rows of the matrices of inertia and of drag, see `both_sides`.
        density: factor of the mass matrix [kg/m].
        dragged: factor of the drag matrix [N s/m^2].
        alpha_m, alpha_f: weights of the beginning of the step.
        a, a1, v1: accelerations at the beginning and the end of the step, and velocity at its end.
        load, G: applied forces, and G at the beginning of the step.
        stacked: workspace of `padded`; overwritten.
    """
    n = len(rows)
    for i in range(n):
        for d in range(nc):
            stacked[i + _REACH, d] = density * ((1.0 - alpha_m) * a1[i, d] + alpha_m * a[i, d])
            stacked[i + _REACH, nc + d] = dragged * v1[i, d]
    for i in range(n):
        for d in range(nc):
            inertia, drag = 0.0, 0.0
            for o in range(2 * _REACH + 1):
                inertia += heavy[i, o] * stacked[i + o, d]
                drag += rows[i, o] * stacked[i + o, nc + d]
            f[i, d] += drag - load[i, d]
            R[i, d] = inertia + (1.0 - alpha_f) * f[i, d] + alpha_f * G[i, d]


@part
def follow(
    nc: int, heavy: Any, inertia: float, share: float, change: Any, moved: Any, f: Any, stacked: Any
) -> None:  # fmt: skip
    """Add to the forces f (n, nc) [N] their change, to first order, due to a change (n, nc) [m] of the control points.

    Args:
        nc: coordinates of a control point.
        heavy: rows of the matrix of inertia, see `both_sides`.
        inertia: factor of the matrix of inertia in the tangent of the step [N/m^2], see `effective`.
        share: factor of the forces in the tangent of the step.
        moved: the tangent of the step times the change (n nc,) [N].
        stacked: workspace of `padded`; overwritten.
    """
    n = len(heavy)
    for i in range(n):
        for d in range(nc):
            stacked[i + _REACH, d] = inertia * change[i, d]
    for i in range(n):
        for d in range(nc):
            force = 0.0
            for o in range(2 * _REACH + 1):
                force += heavy[i, o] * stacked[i + o, d]
            f[i, d] += (moved[i * nc + d] - force) / share


@part
def effective(nc: int, K: Any, heavy: Any, unit: Any, inertia: float, share: float, drag: float) -> None:
    """Turn the tangent K (n nc, 4 nc) of the forces into that of a step: share K + inertia H + drag U.

    `heavy` and `unit` (n, 4) are the lower bands of the matrices of inertia H and of drag U; `inertia` and `drag`
    [N/m^2] are their factors.
    """
    size, width = K.shape
    for j in range(size):
        for o in range(width):
            K[j, o] *= share
    for i in range(len(unit)):
        for o in range(min(_REACH + 1, len(unit) - i)):
            value = inertia * heavy[i, o] + drag * unit[i, o]
            for d in range(nc):
                K[i * nc + d, o * nc] += value
