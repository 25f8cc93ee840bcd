"""Factorisation and solution of the bands of a march, whose width the compiler knows.

The bands are those of `banded.py`. The plane's band of eight is written out, so that rows stay in registers; this is
three to four times as fast. The loops of wider bands are unrolled. ROOM rows of zeros follow the matrix and ROOM zeros
follow the vector, so that no check is needed whether a column ends early.
"""

from typing import Any

from dlocore.compiling.kernel import law
from dlocore.kernels.banded import factor, solve

ROOM = 16  # rows beyond the last
WIDTH = 8  # of the band that is written out: two coordinates of four control points
SPACE, TWISTED = 12, 16  # of the bands in space: three and four coordinates


@law
def factor_step(A: Any, n: int) -> int:
    """Factor the first n columns of A (n + ROOM, width) in place, as `banded.factor` does, and return the same."""
    if A.shape[1] == TWISTED:
        return _factor_columns(A, n, TWISTED)
    if A.shape[1] == SPACE:
        return _factor_columns(A, n, SPACE)
    if A.shape[1] != WIDTH:
        return int(factor(A[:n]))
    for j in range(n):
        a0, a1, a2, a3, a4, a5, a6, a7 = _row(A, j)
        if not a0 > 0.0:
            return j
        inverse = 1.0 / a0
        r = a1 * inverse
        A[j, 1] = r
        A[j + 1, 0] -= r * a1
        A[j + 1, 1] -= r * a2
        A[j + 1, 2] -= r * a3
        A[j + 1, 3] -= r * a4
        A[j + 1, 4] -= r * a5
        A[j + 1, 5] -= r * a6
        A[j + 1, 6] -= r * a7
        r = a2 * inverse
        A[j, 2] = r
        A[j + 2, 0] -= r * a2
        A[j + 2, 1] -= r * a3
        A[j + 2, 2] -= r * a4
        A[j + 2, 3] -= r * a5
        A[j + 2, 4] -= r * a6
        A[j + 2, 5] -= r * a7
        r = a3 * inverse
        A[j, 3] = r
        A[j + 3, 0] -= r * a3
        A[j + 3, 1] -= r * a4
        A[j + 3, 2] -= r * a5
        A[j + 3, 3] -= r * a6
        A[j + 3, 4] -= r * a7
        r = a4 * inverse
        A[j, 4] = r
        A[j + 4, 0] -= r * a4
        A[j + 4, 1] -= r * a5
        A[j + 4, 2] -= r * a6
        A[j + 4, 3] -= r * a7
        r = a5 * inverse
        A[j, 5] = r
        A[j + 5, 0] -= r * a5
        A[j + 5, 1] -= r * a6
        A[j + 5, 2] -= r * a7
        r = a6 * inverse
        A[j, 6] = r
        A[j + 6, 0] -= r * a6
        A[j + 6, 1] -= r * a7
        r = a7 * inverse
        A[j, 7] = r
        A[j + 7, 0] -= r * a7
    return -1


@law
def solve_step(A: Any, n: int, x: Any) -> None:
    """Solve L D L' x = b in place for the first n of x (n + ROOM,), with the factors of `factor_step`."""
    if A.shape[1] == TWISTED:
        _solve_columns(A, n, x, TWISTED)
        return
    if A.shape[1] == SPACE:
        _solve_columns(A, n, x, SPACE)
        return
    if A.shape[1] != WIDTH:
        solve(A[:n], x[:n])
        return
    x0, x1, x2, x3, x4, x5, x6, x7 = x[0], x[1], x[2], x[3], x[4], x[5], x[6], x[7]
    for j in range(n):
        a0, a1, a2, a3, a4, a5, a6, a7 = _row(A, j)
        s = x0
        x[j] = s / a0
        x0, x1, x2, x3 = x1 - a1 * s, x2 - a2 * s, x3 - a3 * s, x4 - a4 * s
        x4, x5, x6, x7 = x5 - a5 * s, x6 - a6 * s, x7 - a7 * s, x[j + WIDTH]
    x1 = x2 = x3 = x4 = x5 = x6 = x7 = 0.0
    for j in range(n - 1, -1, -1):
        _, a1, a2, a3, a4, a5, a6, a7 = _row(A, j)
        # the newest one last: the others need not wait for it
        s = x[j] - (a7 * x7 + a6 * x6 + a5 * x5 + a4 * x4 + a3 * x3 + a2 * x2) - a1 * x1
        x[j] = s
        x1, x2, x3, x4, x5, x6, x7 = s, x1, x2, x3, x4, x5, x6


@law
def _row(A: Any, j: int) -> tuple[float, float, float, float, float, float, float, float]:
    return A[j, 0], A[j, 1], A[j, 2], A[j, 3], A[j, 4], A[j, 5], A[j, 6], A[j, 7]


@law
def _factor_columns(A: Any, n: int, width: int) -> int:
    for j in range(n):
        pivot = A[j, 0]
        if not pivot > 0.0:
            return j
        inverse = 1.0 / pivot
        for i in range(1, width):
            ratio = A[j, i] * inverse
            for k in range(i, width):
                A[j + i, k - i] -= ratio * A[j, k]
            # the loop above needs only the unscaled entries to the right of i in this column
            A[j, i] = ratio
    return -1


@law
def _solve_columns(A: Any, n: int, x: Any, width: int) -> None:
    for j in range(n):
        s = x[j]
        for i in range(1, width):
            x[j + i] -= A[j, i] * s
        x[j] = s / A[j, 0]
    for i in range(n, n + width):
        x[i] = 0.0
    for j in range(n - 1, -1, -1):
        total = x[j]
        for i in range(width - 1, 0, -1):  # the newest one last: the others need not wait for it
            total -= A[j, i] * x[j + i]
        x[j] = total
