"""Banded symmetric factorisation, and the local elimination of grasped control points.

A symmetric matrix of half-bandwidth m is stored by column below its diagonal: A[j, i - j], (n, m + 1).
"""

from typing import Any, NamedTuple

import numpy as np

from dlocore.compiling.kernel import brief, kernel, law, leaf, part


@law
def clear(A: Any) -> None:
    """Set the entries of A (n, m) to zero."""
    for i in range(A.shape[0]):
        for j in range(A.shape[1]):
            A[i, j] = 0.0


@leaf
def factor(A: Any) -> int:
    """Factor A = L D L' in place; return -1, or the column of a pivot that is not positive (A is then invalid)."""
    n, width = A.shape
    for j in range(n):
        pivot = A[j, 0]
        if not pivot > 0.0:
            return j
        last = min(width, n - j)
        for i in range(1, last):
            ratio = A[j, i] / pivot
            for k in range(i, last):
                A[j + i, k - i] -= ratio * A[j, k]
            # the loop above needs only the unscaled entries to the right of i in this column
            A[j, i] = ratio
    return -1


@leaf
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


@leaf
def solve_rows(A: Any, X: Any) -> None:
    """Solve L D L' X = B in place for the rows of X (n, m), with the factors of `factor`."""
    n, width = A.shape
    m = X.shape[1]
    for j in range(n):
        for i in range(1, min(width, n - j)):
            s = A[j, i]
            for c in range(m):
                X[j + i, c] -= s * X[j, c]
    for j in range(n - 1, -1, -1):
        s = 1.0 / A[j, 0]
        for c in range(m):
            X[j, c] *= s
        for i in range(1, min(width, n - j)):
            s = A[j, i]
            for c in range(m):
                X[j, c] -= s * X[j + i, c]


@leaf
def multiply_band(A: Any, x: Any, out: Any) -> None:
    """Write A x (n,) of the symmetric banded A."""
    n, width = A.shape
    for j in range(n):
        out[j] = A[j, 0] * x[j]
    for j in range(n):
        for o in range(1, min(width, n - j)):
            out[j + o] += A[j, o] * x[j]
            out[j] += A[j, o] * x[j + o]


class Elimination(NamedTuple):
    """How held degrees of freedom follow the free ones: q_held = offset(t) + sum_j coefficient_j q_j.

    Attributes:
        index: (n nc,) number of a free degree of freedom among the free ones, or -1 - k for the k-th held one.
        held: (m,) the held degrees of freedom.
        start: (m + 1,) where the terms of the k-th held one begin.
        dof: degrees of freedom of the terms (all free).
        coefficient: coefficients of the terms.
        width: columns of the reduced band; held degrees of freedom couple the ones that they follow beyond the band.
        entry, place, share: (k,) for each contribution an entry of the flattened band (n nc, 4 nc), its place in the
            flattened reduced band (free, width), and its factor there.
    """

    index: Any
    held: Any
    start: Any
    dof: Any
    coefficient: Any
    width: int
    entry: Any
    place: Any
    share: Any


@brief
def elimination(n: int, nc: int, dimensions: int, pivots: Any, follow: Any, turned: Any, turned_follow: Any) -> Any:
    """Return the `Elimination` of held control points among n.

    Args:
        n, nc: number of control points, and of coordinates of each.
        dimensions: of the centreline, 2 or 3.
        pivots: (rows,) control points that are held in each dimension.
        follow: (rows, n) how they follow the others, 0 for the pivots themselves.
        turned, turned_follow: the same for the fourth coordinate.
    """
    count = len(pivots) * dimensions + len(turned)
    held = np.empty(count, np.int64)
    start = np.zeros(count + 1, np.int64)
    dof = np.empty(count * n, np.int64)
    coefficient = np.empty(count * n)
    terms = 0
    for k in range(count):
        row, d = k // dimensions, k % dimensions
        if row >= len(pivots):
            row, d = k - len(pivots) * dimensions, 3
        pivot = pivots[row] if d < 3 else turned[row]
        held[k] = pivot * nc + d
        for column in range(n):
            value = follow[row, column] if d < 3 else turned_follow[row, column]
            if abs(value) > 1e-14:
                dof[terms], coefficient[terms] = column * nc + d, value
                terms += 1
        start[k + 1] = terms
    index = np.zeros(n * nc, np.int64)
    for k in range(count):
        index[held[k]] = -1 - k
    free = 0
    for i in range(n * nc):
        if index[i] == 0:
            index[i] = free
            free += 1
    dof, coefficient = dof[:terms].copy(), coefficient[:terms].copy()
    width = 4 * nc
    for k in range(count):
        for i in range(max(0, held[k] - 4 * nc + 1), min(n * nc, held[k] + 4 * nc)):
            a, b = (0, 1) if index[i] >= 0 else (start[-1 - index[i]], start[-index[i]])
            for s in range(start[k], start[k + 1]):
                for r in range(a, b):
                    row = index[i] if index[i] >= 0 else index[dof[r]]
                    width = max(width, abs(row - index[dof[s]]) + 1)
    entry, place, share = _folded(index, start, dof, coefficient, 4 * nc, width)
    return Elimination(index, held, start, dof, coefficient, width, entry, place, share)


@part
def reduce_vector(e: Any, f: Any, out: Any) -> None:
    """Write Z' f (free,) for the full vector f (n nc,)."""
    out[:] = 0.0
    for i in range(len(f)):
        k = e.index[i]
        if k >= 0:
            out[k] += f[i]
        else:
            for s in range(e.start[-1 - k], e.start[-k]):
                out[e.index[e.dof[s]]] += e.coefficient[s] * f[i]


@part
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


@brief
def expand_rows(e: Any, x: Any, n: int) -> Any:
    """Return Z x (k, n) for each row of x (k, free)."""
    out = np.empty((len(x), n))
    for k in range(len(x)):
        expand_vector(e, x[k], out[k])
    return out


@part
def place_held(e: Any, offsets: Any, row: int, q: Any) -> None:
    """Set the held degrees of freedom of q (n nc,) from the free ones and a row of `offsets` (rows, m)."""
    for k in range(len(e.held)):
        value = offsets[row, k]
        for s in range(e.start[k], e.start[k + 1]):
            value += e.coefficient[s] * q[e.dof[s]]
        q[e.held[k]] = value


@brief
def place_rows(e: Any, offsets: Any, C: Any, begin: int) -> None:
    """Set the held degrees of freedom of C[begin:] (n_t, n, nc) from the free ones and `offsets` (n_t, m)."""
    for j in range(begin, len(C)):
        place_held(e, offsets, j, C[j].ravel())


@part
def holding(e: Any, A: Any, x: Any, R: Any, forces: Any, at: int, out: Any) -> None:
    """Write A x to `out` (n nc,) and the reaction forces R + A x of the held ones to row `at` of `forces`.

    x solves Z' A x = -Z' R. Only the rows of the banded A (n nc, 4 nc) that belong to held degrees of freedom are
    multiplied; the other rows follow from Z' (R + A x) = 0.
    """
    n, width = A.shape
    for i in range(n):
        out[i] = -R[i]
    for k in range(len(e.held)):
        row = e.held[k]
        total = 0.0
        for j in range(max(0, row - width + 1), row):
            total += A[j, row - j] * x[j]
        for o in range(min(width, n - row)):
            total += A[row, o] * x[row + o]
        out[row] = total
        forces[at, k] = R[row] + total
        for s in range(e.start[k], e.start[k + 1]):
            out[e.dof[s]] -= e.coefficient[s] * forces[at, k]


@brief
def solve_free(e: Any, K: Any, right: Any) -> Any:
    """Return the change Z x (n nc,) with Z' K Z x = Z' right, and whether Z' K Z is positive definite.

    K (n nc, 4 nc) is banded. If Z' K Z is not positive definite, the change is zero.
    """
    free = len(right) - len(e.held)
    A, x, change = np.empty((free, e.width)), np.empty(free), np.zeros(len(right))
    reduce_matrix(e, K, A)
    if factor(A) >= 0:
        return change, False
    reduce_vector(e, right, x)
    solve(A, x)
    expand_vector(e, x, change)
    return change, True


@leaf
def reduce_matrix(e: Any, A: Any, out: Any) -> None:
    """Write Z' A Z of the banded A (n nc, 4 nc) to the banded out (free, e.width)."""
    entries, reduced = A.reshape(A.size), out.reshape(out.size)
    reduced[:] = 0.0
    for k in range(len(e.share)):
        reduced[e.place[k]] += e.share[k] * entries[e.entry[k]]


@kernel
def _folded(index: Any, start: Any, dof: Any, coefficient: Any, band: int, width: int) -> Any:
    """Return entries of a band (n, band), their places in the reduced band of `width` columns, and their factors there.

    An entry of a held degree of freedom contributes to all degrees of freedom that it follows.
    """
    n = len(index)
    count = 0
    for j in range(n):
        inner = 1 if index[j] >= 0 else start[-index[j]] - start[-1 - index[j]]
        for i in range(j, min(j + band, n)):
            count += inner * (1 if index[i] >= 0 else start[-index[i]] - start[-1 - index[i]])
    entry, place, share = np.empty(count, np.int64), np.empty(count, np.int64), np.empty(count)
    k = 0
    for j in range(n):
        b = index[j]
        b0, b1 = (0, 1) if b >= 0 else (start[-1 - b], start[-b])
        for i in range(j, min(j + band, n)):
            a = index[i]
            a0, a1 = (0, 1) if a >= 0 else (start[-1 - a], start[-a])
            for s in range(a0, a1):
                row = a if a >= 0 else index[dof[s]]
                of_row = 1.0 if a >= 0 else coefficient[s]
                for r in range(b0, b1):
                    column = b if b >= 0 else index[dof[r]]
                    value = of_row if b >= 0 else of_row * coefficient[r]
                    if i == j and row < column:
                        continue  # diagonal blocks of held degrees of freedom are symmetric: half is enough
                    if i != j and row == column:
                        value *= 2.0  # for A[i, j] and A[j, i]
                    entry[k] = j * band + i - j
                    place[k] = min(row, column) * width + abs(row - column)
                    share[k] = value
                    k += 1
    return entry[:k].copy(), place[:k].copy(), share[:k].copy()
