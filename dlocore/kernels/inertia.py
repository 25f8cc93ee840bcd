"""Inertia and drag of a time step: what mass and drag matrix add to residual and tangent.

The drag matrix is the unit matrix of the basis, the integrals of b_i b_j du, times a density; the mass matrix that with
the point masses (`basis.Tables.inertia`), times another; both are alike in every coordinate.
"""

from typing import Any

import numpy as np

from dlocore.compiling.kernel import kernel, part

_REACH = 3  # control points to either side that a control point shares a span with


@kernel
def both_sides(unit: Any) -> Any:
    """Return the rows (n, 7) of a symmetric matrix, whose lower band is `unit` (n, 4) [m], from left to right."""
    n = len(unit)
    rows = np.zeros((n, 2 * _REACH + 1))
    for i in range(n):
        for o in range(min(_REACH + 1, n - i)):
            rows[i, _REACH + o] = unit[i, o]
            rows[i + o, _REACH - o] = unit[i, o]
    return rows


@kernel
def padded(n: int, nc: int) -> Any:
    """Return room (n + 6, 2 nc) for what `residual` multiplies by matrices, with rows of zeros at both ends."""
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
        heavy, rows: of the matrices of inertia and of drag, see `both_sides`.
        density: of the mass matrix [kg/m].
        dragged: that of the drag matrix [N s/m^2].
        alpha_m, alpha_f: shares of the step's beginning.
        a, a1, v1: accelerations at its beginning and its end, and velocity at its end.
        load, G: applied forces, and G at its beginning.
        stacked: of `padded`; overwritten.
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
    """Add to the forces f (n, nc) [N], to first order, what a change (n, nc) [m] of the control points makes of them.

    Args:
        nc: coordinates of a control point.
        heavy: rows of the matrix of inertia, see `both_sides`.
        inertia: what the step makes of its density [N/m^2], see `effective`.
        share: of the forces in the tangent of the step.
        moved: that tangent times the change (n nc,) [N].
        stacked: of `padded`; overwritten.
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

    `heavy` and `unit` (n, 4) are the lower bands of the matrices of inertia H and of drag U, `inertia` and `drag`
    [N/m^2] what the step makes of their densities.
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
