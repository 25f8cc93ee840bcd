"""The time spline of a march: its fit, how far it misses the march, and samples of its surface, in one call each."""

from typing import Any

import numpy as np

from dlocore.compiling.kernel import brief, kernel, leaf
from dlocore.kernels.banded import factor, solve_rows
from dlocore.kernels.basis import basis_rows, row_of


@kernel
def fit_time(knots: Any, times: Any, Q: Any, v0: Any) -> Any:
    """Return control points (n_t, m) of the time spline fitted to the states Q (k, m) at `times`.

    The fit is a least squares weighted by the time that each state stands for. The first two control points give the
    initial position and velocity exactly, the last one the final position. A control point at a triple knot, where the
    velocity may jump, gives the state there: errors of the spline on one side of it do not move it on the other.
    """
    first, table = basis_rows(knots, times, 0)
    return _fit(knots, first, table, times, Q, v0)


@brief
def fit_missed(knots: Any, times: Any, Q: Any, C: Any, dimensions: int) -> Any:
    """Return the distance [m] by which the time spline of C (n_t, n, nc) misses each state of Q (k, n, nc) at `times`.

    It is the largest distance of a control point in the first `dimensions` axes.
    """
    first, table = basis_rows(knots, times, 0)
    return _missed(first, table, Q, C, dimensions)


@kernel
def fitted(knots: Any, times: Any, states: Any, v0: Any, dimensions: int) -> Any:
    """Return control points (n_t, n, nc) that `fit_time` fits to the states (k, n, nc), and their `fit_missed` (k,)."""
    steps, n, nc = states.shape
    first, table = basis_rows(knots, times, 0)
    flat = _fit(knots, first, table, times, states.reshape((steps, n * nc)), v0.reshape(n * nc))
    control = flat.reshape((len(knots) - 4, n, nc))
    return control, _missed(first, table, states, control, dimensions)


@kernel
def _fit(knots: Any, first: Any, table: Any, times: Any, Q: Any, v0: Any) -> Any:
    n = len(knots) - 4
    k, m = Q.shape
    C = np.zeros((n, m))
    given = np.zeros(n, np.bool_)
    C[0] = Q[0]
    C[1] = Q[0] + v0 * ((knots[4] - knots[1]) / 3.0)
    C[n - 1] = Q[k - 1]
    given[0] = given[1] = given[n - 1] = True
    for j in range(4, n - 2):
        if knots[j] == knots[j + 2]:  # the spline passes through this control point
            s = np.searchsorted(times, knots[j])
            if s < k and times[s] == knots[j]:
                C[j - 1], given[j - 1] = Q[s], True
    A = np.zeros((n, 4))
    for s in range(1, k - 1):
        w = 0.5 * (times[s + 1] - times[s - 1])
        b = table[s, 0]
        for i in range(4):
            row = first[s] + i
            if given[row]:
                continue
            share = w * b[i]
            for c in range(m):
                C[row, c] += share * Q[s, c]
            for j in range(4):
                column = first[s] + j
                if given[column]:
                    for c in range(m):
                        C[row, c] -= share * b[j] * C[column, c]
                elif j >= i:
                    A[row, j - i] += share * b[j]
    trace = 0.0
    for i in range(n):
        trace += A[i, 0]
    for i in range(n):
        A[i, 0] = 1.0 if given[i] else A[i, 0] + 1e-13 * trace
    factor(A)
    solve_rows(A, C)
    return C


@kernel
def _missed(first: Any, table: Any, Q: Any, C: Any, dimensions: int) -> Any:
    out = np.zeros(len(Q))
    for s in range(len(Q)):
        b0, b1, b2, b3 = table[s, 0, 0], table[s, 0, 1], table[s, 0, 2], table[s, 0, 3]
        g = first[s]
        most, total = 0.0, 0.0
        for i in range(Q.shape[1]):
            square = 0.0
            for d in range(dimensions):
                fitted = b0 * C[g, i, d] + b1 * C[g + 1, i, d] + b2 * C[g + 2, i, d] + b3 * C[g + 3, i, d]
                away = Q[s, i, d] - fitted
                square += away * away
            most = max(most, square)
            total += square
        out[s] = np.sqrt(most) if total == total else np.inf
    return out


@brief
def sampled(knots_t: Any, knots_u: Any, control: Any, times: int, places: int) -> Any:
    """Return the surface (times, places, nc) [m] of control points (n_t, n, nc) at evenly spaced times and places."""
    _, n, nc = control.shape
    first_t, over = basis_rows(knots_t, np.arange(times) / (times - 1) * knots_t[-1], 0)
    first_u, along = basis_rows(knots_u, np.arange(places) / (places - 1) * knots_u[-1], 0)
    out = np.empty((times, places, nc))
    q = np.empty((n, nc))
    for k in range(times):
        f, (b0, b1, b2, b3) = first_t[k], row_of(over[k], 0)
        for i in range(n):
            for d in range(nc):
                own = b0 * control[f, i, d] + b1 * control[f + 1, i, d]
                q[i, d] = own + b2 * control[f + 2, i, d] + b3 * control[f + 3, i, d]
        for s in range(places):
            g, (b0, b1, b2, b3) = first_u[s], row_of(along[s], 0)
            for d in range(nc):
                out[k, s, d] = b0 * q[g, d] + b1 * q[g + 1, d] + b2 * q[g + 2, d] + b3 * q[g + 3, d]
    return out


@leaf
def farthest(a: Any, b: Any, dimensions: int) -> float:
    """Return the largest distance [m] of points of a from those of b (k, m, nc) in the first `dimensions` axes."""
    most, total = 0.0, 0.0
    for k in range(a.shape[0]):
        for s in range(a.shape[1]):
            square = 0.0
            for d in range(dimensions):
                away = a[k, s, d] - b[k, s, d]
                square += away * away
            most = max(most, square)
            total += square
    return np.sqrt(most) if total == total else np.nan
