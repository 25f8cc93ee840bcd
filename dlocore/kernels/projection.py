"""Splines on other knots, and control points in coordinates of the solve and of the world."""

from typing import Any

import numpy as np

from dlocore.compiling.kernel import brief, kernel
from dlocore.kernels.banded import factor, solve_rows
from dlocore.kernels.basis import basis_rows, gauss_points


@brief
def on_knots(given: Any, control: Any, knots: Any, rule: Any, weights: Any) -> Any:
    """Return control points (n, m) on clamped cubic `knots` (n + 4,) of a spline on the knots `given`.

    A single polynomial is transferred exactly, and so is a spline to its own knots. Otherwise the result is the least
    squares fit over the length, by the Gauss `rule` with `weights` in each span.
    """
    if len(control) == 4:
        return _blossom(given, control, knots)
    if len(given) == len(knots):
        same = True
        for k in range(len(knots)):
            same &= given[k] == knots[k]
        if same:
            return control.copy()
    n, m = len(knots) - 4, control.shape[1]
    u, w = gauss_points(knots, rule, weights)
    to, table = basis_rows(knots, u, 0)
    of, given_table = basis_rows(given, u, 0)
    A, out = np.zeros((n, 4)), np.zeros((n, m))
    for p in range(len(u)):
        for i in range(4):
            share = w[p] * table[p, 0, i]
            for j in range(i, 4):
                A[to[p] + i, j - i] += share * table[p, 0, j]
            for s in range(4):
                for d in range(m):
                    out[to[p] + i, d] += share * given_table[p, 0, s] * control[of[p] + s, d]
    factor(A)
    solve_rows(A, out)
    return out


@kernel
def _blossom(given: Any, control: Any, knots: Any) -> Any:
    """Return control points of a single cubic polynomial on any knots, exactly: its blossom at every three knots."""
    length = given[-1]
    n, m = len(knots) - 4, control.shape[1]
    out = np.empty((n, m))
    c = np.empty(4)
    for j in range(n):
        for d in range(m):
            c[:] = control[:, d]
            for i in range(3):
                a = knots[j + 1 + i] / length
                for k in range(3 - i):
                    c[k] += a * (c[k + 1] - c[k])
            out[j, d] = c[0]
    return out


@brief
def in_world(q: Any, origin: Any, axes: Any, radius: float) -> Any:
    """Return (x, y, z, theta) (k, 4) [m, m, m, rad] of control points q (k, nc) in coordinates along `axes` (nd, 3).

    A fourth coordinate is `radius` times the angle; without it the angle is zero.
    """
    nd = len(axes)
    out = np.zeros((len(q), 4))
    for k in range(len(q)):
        for i in range(3):
            value = 0.0
            for d in range(nd):
                value += q[k, d] * axes[d, i]
            out[k, i] = origin[i] + value
        if q.shape[1] > nd:
            out[k, 3] = q[k, nd] / radius
    return out
