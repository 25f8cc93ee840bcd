"""Banded symmetric factorisation, and the local elimination of grasped control points.

A symmetric matrix of half-bandwidth m is stored by column below its diagonal: A[j, i - j], (n, m + 1).
"""

from typing import Any, NamedTuple

from dlocore.kernels.compile import kernel


@kernel
def factor(A: Any) -> int:
    """Factor A = L D L' in place; return -1, or the column where a pivot is not positive (A is then spoilt)."""
    return factor_columns(A, 0, A.shape[0])


@kernel
def factor_columns(A: Any, start: int, stop: int) -> int:
    """Factor the columns `start` to `stop` of A, those before them being factored; return as `factor`."""
    n, width = A.shape
    for j in range(start, stop):
        pivot = A[j, 0]
        if not pivot > 0.0:
            return j
        last = min(width, n - j)
        for i in range(1, last):
            ratio = A[j, i] / pivot
            for k in range(i, last):
                A[j + i, k - i] -= ratio * A[j, k]
            # the loop above still needs the unscaled entries of this column to the right of i only
            A[j, i] = ratio
    return -1


@kernel
def solve(A: Any, x: Any) -> None:
    """Solve L D L' x = b in place with the factors of `factor`."""
    n, width = A.shape
    for j in range(n):
        for i in range(1, min(width, n - j)):
            x[j + i] -= A[j, i] * x[j]
    for j in range(n - 1, -1, -1):
        total = x[j] / A[j, 0]
        for i in range(1, min(width, n - j)):
            total -= A[j, i] * x[j + i]
        x[j] = total


class Elimination(NamedTuple):
    """How held degrees of freedom follow the free ones: q_held = offset(t) + sum_j coefficient_j q_j.

    Attributes:
        index: (n nc,) number of a free degree of freedom among the free ones, or -1 - k for the k-th held one.
        held: (m,) the held degrees of freedom.
        start: (m + 1,) where the terms of the k-th held one begin.
        dof: terms' degrees of freedom (all free).
        coefficient: terms' coefficients.
    """

    index: Any
    held: Any
    start: Any
    dof: Any
    coefficient: Any


@kernel
def reduce_vector(e: Any, f: Any, out: Any) -> None:
    """Write Z' f for the full vector f (n nc,)."""
    out[:] = 0.0
    for i in range(len(f)):
        k = e.index[i]
        if k >= 0:
            out[k] += f[i]
        else:
            for s in range(e.start[-1 - k], e.start[-k]):
                out[e.index[e.dof[s]]] += e.coefficient[s] * f[i]


@kernel
def expand_vector(e: Any, x: Any, out: Any) -> None:
    """Write Z x, the full vector (n nc,) of a change x of the free degrees of freedom."""
    for i in range(len(out)):
        k = e.index[i]
        if k >= 0:
            out[i] = x[k]
        else:
            out[i] = 0.0
            for s in range(e.start[-1 - k], e.start[-k]):
                out[i] += e.coefficient[s] * x[e.index[e.dof[s]]]


@kernel
def place_held(e: Any, offset: Any, q: Any) -> None:
    """Set the held degrees of freedom of q (n nc,) from the free ones and `offset` (m,)."""
    for k in range(len(e.held)):
        value = offset[k]
        for s in range(e.start[k], e.start[k + 1]):
            value += e.coefficient[s] * q[e.dof[s]]
        q[e.held[k]] = value


@kernel
def reduce_matrix(e: Any, A: Any, out: Any) -> None:
    """Write Z' A Z of the banded A (n nc, width) to the banded out (free, width)."""
    n, width = A.shape
    out[:] = 0.0
    for j in range(n):
        b = e.index[j]
        for o in range(min(width, n - j)):
            value = A[j, o]
            a = e.index[j + o]
            if a >= 0 and b >= 0:
                out[b, a - b] += value
            elif value != 0.0:
                _distribute(e, j + o, j, value, out)


@kernel
def _distribute(e: Any, i: int, j: int, value: float, out: Any) -> None:
    """Add the entry A[i, j] = A[j, i] = value, of which one or both degrees of freedom are held."""
    a, b = e.index[i], e.index[j]
    a0, a1 = (0, 1) if a >= 0 else (e.start[-1 - a], e.start[-a])
    b0, b1 = (0, 1) if b >= 0 else (e.start[-1 - b], e.start[-b])
    for s in range(a0, a1):
        row = a if a >= 0 else e.index[e.dof[s]]
        scale = value if a >= 0 else value * e.coefficient[s]
        for r in range(b0, b1):
            column = b if b >= 0 else e.index[e.dof[r]]
            entry = scale if b >= 0 else scale * e.coefficient[r]
            if row == column:
                out[row, 0] += entry if i == j else 2.0 * entry
            elif row > column:
                out[column, row - column] += entry
            elif i != j:
                out[row, column - row] += entry
