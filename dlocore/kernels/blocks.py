"""Factorisation of symmetric matrices of square blocks, each coupled with the next three.

A (count, m, 4 m) holds in A[t, c] the coupling of unknown c of block t with the unknowns of blocks t to t + 3. Entries
left of the diagonal within a block, and entries beyond the last block, are not read.
"""

from typing import Any

import numpy as np

from dlocore.compiling.kernel import kernel, law, leaf

REACH = 4  # blocks coupled with a block, including itself
_PANEL = 8  # rows that are subtracted from the rows below in one go
_STRIP = 256  # columns of these that stay in the cache meanwhile


@kernel
def factor_rows(A: Any, start: int, stop: int) -> int:
    """Factor the rows `start` to `stop` of A = U' D U in place; the rows before them are already factored.

    Rows are counted over all blocks. A panel of rows is applied to two rows below at a time: each value read serves
    sixteen products. The strip is one array whose rows are at a distance known to the compiler, which therefore need
    not check whether they overlap with what is written.

    Returns:
        -1, or the row of a pivot that is not positive; A is then invalid.
    """
    count, m, _ = A.shape
    strip = np.zeros(_PANEL * _STRIP)
    row = start
    while row < stop:
        t, begin = row // m, row % m
        size = min(_PANEL, m - begin, stop - row)
        width = min(REACH, count - t) * m
        rows = A[t]
        for p in range(begin, begin + size):
            pivot = rows[p]
            if not pivot[p] > 0.0:
                return t * m + p
            for c in range(p + 1, begin + size):
                ratio = pivot[c] / pivot[p]
                below = rows[c]
                for k in range(c, width):
                    below[k] -= ratio * pivot[k]
        for left in range(begin + size, width, _STRIP):
            right = min(left + _STRIP, width)
            for p in range(_PANEL):
                for k in range(right - left):
                    strip[p * _STRIP + k] = rows[begin + p, left + k] if p < size else 0.0
            c = begin + size
            while c < right:
                first = max(c, left)
                over, length = c // m * m, right - first
                above = strip[first - left :]
                x = A[t + c // m, c - over, first - over : right - over]
                s0, s1, s2, s3, s4, s5, s6, s7 = _ratios(rows, begin, size, c)
                if c + 1 < right and c + 1 < over + m:
                    y = A[t + c // m, c + 1 - over, first - over : right - over]
                    r0, r1, r2, r3, r4, r5, r6, r7 = _ratios(rows, begin, size, c + 1)
                    for k in range(length):
                        a0, a1, a2, a3, a4, a5, a6, a7 = _column(above, k)
                        x[k] -= s0 * a0 + s1 * a1 + s2 * a2 + s3 * a3 + s4 * a4 + s5 * a5 + s6 * a6 + s7 * a7
                        y[k] -= r0 * a0 + r1 * a1 + r2 * a2 + r3 * a3 + r4 * a4 + r5 * a5 + r6 * a6 + r7 * a7
                    c += 2
                else:
                    for k in range(length):
                        a0, a1, a2, a3, a4, a5, a6, a7 = _column(above, k)
                        x[k] -= s0 * a0 + s1 * a1 + s2 * a2 + s3 * a3 + s4 * a4 + s5 * a5 + s6 * a6 + s7 * a7
                    c += 1
        for p in range(begin, begin + size):
            pivot = rows[p]
            inverse = 1.0 / pivot[p]
            for k in range(p + 1, width):
                pivot[k] *= inverse
        row += size
    return -1


@law
def _column(above: Any, k: int) -> tuple[float, float, float, float, float, float, float, float]:
    return (
        above[k], above[k + _STRIP], above[k + 2 * _STRIP], above[k + 3 * _STRIP],
        above[k + 4 * _STRIP], above[k + 5 * _STRIP], above[k + 6 * _STRIP], above[k + 7 * _STRIP],
    )  # fmt: skip


@law
def _ratios(rows: Any, begin: int, size: int, c: int) -> tuple[float, float, float, float, float, float, float, float]:
    """Return the multipliers of a panel's rows in the elimination of column c, 0 for missing rows."""
    return (
        _ratio(rows, begin, size, c, 0), _ratio(rows, begin, size, c, 1), _ratio(rows, begin, size, c, 2),
        _ratio(rows, begin, size, c, 3), _ratio(rows, begin, size, c, 4), _ratio(rows, begin, size, c, 5),
        _ratio(rows, begin, size, c, 6), _ratio(rows, begin, size, c, 7),
    )  # fmt: skip


@law
def _ratio(rows: Any, begin: int, size: int, c: int, p: int) -> float:
    return rows[begin + p, c] / rows[begin + p, begin + p] if p < size else 0.0


@leaf
def solve_blocks(A: Any, x: Any) -> None:
    """Solve U' D U x = b in place for x (count m,), with the factors of `factor_rows`."""
    count, m, _ = A.shape
    for t in range(count):
        width = min(REACH, count - t) * m
        y = x[t * m : t * m + width]
        for c in range(m):
            row = A[t, c]
            s = y[c]
            for k in range(c + 1, width):
                y[k] -= row[k] * s
    for t in range(count - 1, -1, -1):
        width = min(REACH, count - t) * m
        y = x[t * m : t * m + width]
        for c in range(m - 1, -1, -1):
            row = A[t, c]
            y[c] = y[c] / row[c] - dot(row[c + 1 : width], y[c + 1 :])


@leaf
def dot(a: Any, b: Any) -> float:
    """Return a' b of the first n (length of a) entries of b, in eight sums that do not wait for each other."""
    n = len(a)
    s0 = s1 = s2 = s3 = s4 = s5 = s6 = s7 = 0.0
    whole = n - n % 8
    for k in range(0, whole, 8):
        s0 += a[k] * b[k]
        s1 += a[k + 1] * b[k + 1]
        s2 += a[k + 2] * b[k + 2]
        s3 += a[k + 3] * b[k + 3]
        s4 += a[k + 4] * b[k + 4]
        s5 += a[k + 5] * b[k + 5]
        s6 += a[k + 6] * b[k + 6]
        s7 += a[k + 7] * b[k + 7]
    for k in range(whole, n):
        s0 += a[k] * b[k]
    return ((s0 + s4) + (s2 + s6)) + ((s1 + s5) + (s3 + s7))
