"""Knot spans side by side, in a layout that a compiler turns into vector instructions.

Spans are processed in groups of SPANS. A row holds one number of every span in SPANS places, or one number of every
curvature point, POINTS in each span, in LANES places: point m of span s is at the lane SPANS m + s. The rows of a kind
are in one array, at places known to the compiler; otherwise it would have to check each time which of them overlap. It
would not vectorise loops over fewer than sixteen places. Where a cable has no more spans, its last one is repeated.
"""

from typing import Any

import numpy as np

from dlocore.compiling.kernel import kernel, law
from dlocore.effects.base import Vector

SPANS, POINTS = 16, 3
LANES = SPANS * POINTS
# rows of `side_by_side`: four basis functions, their first and their second derivatives; weight [m]; share of a point
# in the mean of its span; distance from the middle [m] and share in the slope [1/m], both zero where a span has only a
# mean
VALUES, FIRSTS, SECONDS, WEIGHT, SHARE, LEVER, SLOPE = 0, 4, 8, 12, 13, 14, 15
_ROWS = 16
TRIPLE = 3  # control points by which the next span's first one is ahead across a triple knot


@kernel
def side_by_side(first: Any, u: Any, weights: Any, b0: Any, b1: Any, b2: Any) -> Any:
    """Return the basis functions at the curvature points (groups, 16 LANES), and how values there are smoothed.

    In a span the values x become their mean, sum SHARE x. In the two end spans and beside a triple knot they become the
    straight line through them, sum SHARE x + LEVER sum SLOPE x.
    """
    spans = len(first) // POINTS
    out = np.zeros((-(-spans // SPANS), _ROWS * LANES))
    for place in range(len(out) * SPANS):
        row, s, span = out[place // SPANS], place % SPANS, min(place, spans - 1)
        n = POINTS * span
        end = n + POINTS
        leans = span == 0 or span == spans - 1
        leans = leans or first[n] - first[n - 1] == TRIPLE or first[end] - first[n] == TRIPLE
        middle, width, moment = 0.0, 0.0, 0.0
        for m in range(n, end):
            middle += weights[m] * u[m]
            width += weights[m]
        middle /= width
        for m in range(n, end):
            moment += weights[m] * (u[m] - middle) ** 2
        for m in range(POINTS):
            lane = SPANS * m + s
            for i in range(4):
                row[(VALUES + i) * LANES + lane] = b0[n + m, i]
                row[(FIRSTS + i) * LANES + lane] = b1[n + m, i]
                row[(SECONDS + i) * LANES + lane] = b2[n + m, i]
            row[WEIGHT * LANES + lane] = weights[n + m]
            row[SHARE * LANES + lane] = weights[n + m] / width
            if leans:
                row[LEVER * LANES + lane] = u[n + m] - middle
                row[SLOPE * LANES + lane] = weights[n + m] * (u[n + m] - middle) / moment
    return out


@law
def at(W: Any, row: int, lane: int) -> float:
    """Return the number of a row at a lane."""
    return W[row * LANES + lane]


@law
def put(W: Any, row: int, lane: int, x: float) -> None:
    """Set the number of a row at a lane."""
    W[row * LANES + lane] = x


@law
def vector_at(W: Any, row: int, lane: int) -> Vector:
    """Return the vector in three rows at a lane."""
    return W[row * LANES + lane], W[(row + 1) * LANES + lane], W[(row + 2) * LANES + lane]


@law
def put_vector(W: Any, row: int, lane: int, x: Vector) -> None:
    """Set the vector in three rows at a lane."""
    W[row * LANES + lane] = x[0]
    W[(row + 1) * LANES + lane] = x[1]
    W[(row + 2) * LANES + lane] = x[2]


@law
def added(W: Any, row: int, s: int) -> float:
    """Return the sum of a row over the points of span s."""
    return W[row * LANES + s] + W[row * LANES + SPANS + s] + W[row * LANES + 2 * SPANS + s]


@law
def over(T: Any, share: int, W: Any, row: int, s: int) -> float:
    """Return the sum of a row of W over the points of span s, weighted by the row `share` of T."""
    a, b = share * LANES + s, row * LANES + s
    return T[a] * W[b] + T[a + SPANS] * W[b + SPANS] + T[a + 2 * SPANS] * W[b + 2 * SPANS]


@law
def combined(W: Any, place: int, T: Any, row: int, lane: int) -> float:
    """Return the combination of a coordinate of four control points, weighted by four rows of T at a lane.

    The control points of a span, with four coordinates each, are in 16 rows of SPANS places; `place` is that of the
    coordinate of the first one.
    """
    own = T[row * LANES + lane] * W[place] + T[(row + 1) * LANES + lane] * W[place + 4 * SPANS]
    more = T[(row + 2) * LANES + lane] * W[place + 8 * SPANS]
    return own + more + T[(row + 3) * LANES + lane] * W[place + 12 * SPANS]
