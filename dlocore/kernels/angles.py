"""Angles of the sections that have given twist rates: a least squares whose rows span four control points."""

from typing import Any

import numpy as np

from dlocore.compiling.kernel import kernel, leaf
from dlocore.kernels.lanes import FIRSTS, LEVER, POINTS, SECONDS, SHARE, SLOPE, SPANS, WEIGHT, added, at, over


@kernel
def angles_with(tables: Any, slopes: Any, given: Any, smooth: float) -> Any:
    """Return the smoothest values (k, n) at the control points that have the given slopes.

    Slopes are treated as the twist rate is: by their mean over a span, or by the straight line through them. Givens
    rotations factor the matrix row by row; they leave nothing outside the band and do not square the condition number.

    Args:
        tables: `basis.Tables`, of n control points.
        slopes: (k, points) at the curvature points.
        given: (k,) the value at the first control point.
        smooth: weight of the second derivatives times the span, relative to the slopes.
    """
    n, count = len(tables.span), len(slopes)
    R, right = np.zeros((n, 4)), np.zeros((n, count))
    row, own = np.empty(4), np.empty(count)
    for span in range(len(tables.curvature.w) // POINTS):
        T, s, first = tables.curvature.lanes[span // SPANS], span % SPANS, tables.curvature.first[POINTS * span]
        width = added(T, WEIGHT, s)
        for m in range(POINTS):
            lane = SPANS * m + s
            root = np.sqrt(at(T, WEIGHT, lane))
            for i in range(4):
                lean = at(T, LEVER, lane) * over(T, SLOPE, T, FIRSTS + i, s)
                row[i] = root * (over(T, SHARE, T, FIRSTS + i, s) + lean)
            for k in range(count):
                own[k] = root * slopes[k, POINTS * span + m]
            _add_row(first, row, own, given, R, right)
            for i in range(4):
                row[i] = smooth * width * root * at(T, SECONDS + i, lane)
            own[:] = 0.0
            _add_row(first, row, own, given, R, right)
    out = np.empty((count, n))
    out[:, 0] = given
    for k in range(count):
        for j in range(n - 1, 0, -1):
            value = right[j, k]
            for i in range(1, min(4, n - j)):
                value -= R[j, i] * out[k, j + i]
            out[k, j] = value / R[j, 0]
    return out


@leaf
def _add_row(first: int, row: Any, own: Any, given: Any, R: Any, right: Any) -> None:
    """Rotate a row (4,) over the control points from `first` on, with right sides (k,), into the factor R (n, 4)."""
    for i in range(4):
        if first + i == 0:  # the value of this control point is known
            for k in range(len(own)):
                own[k] -= row[0] * given[k]
        elif row[i] != 0.0:
            j = first + i
            size = np.hypot(R[j, 0], row[i])
            c, s = R[j, 0] / size, row[i] / size
            for m in range(4 - i):
                before = R[j, m]
                R[j, m] = c * before + s * row[i + m]
                row[i + m] = c * row[i + m] - s * before
            for k in range(len(own)):
                before = right[j, k]
                right[j, k] = c * before + s * own[k]
                own[k] = c * own[k] - s * before
