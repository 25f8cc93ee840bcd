"""Knot spans side by side: what a compiler makes vector instructions of.

Spans are taken SPANS at a time, a group. A number of a span is at SPANS places in a row, one for each of them, a number
of its curvature points, of which it has POINTS, at LANES places: that of point m of span s is at SPANS m + s. Rows of
one kind lie in one array, at places that the compiler knows: it would else have to find out each time which of them are
the same. Loops over less than sixteen places it would not make vectors of. Where a cable has no more spans, its last
one is repeated.
"""

from typing import Any

import numpy as np

from dlocore.compiling.kernel import kernel, law
from dlocore.effects.base import Vector

SPANS, POINTS = 16, 3
LANES = SPANS * POINTS
# rows of `side_by_side`: four basis functions, their first and their second derivatives; weight [m]; share of a point
# in the mean of its span; place from the middle [m] and share in the slope [1/m], zero where a span has none
VALUES, FIRSTS, SECONDS, WEIGHT, SHARE, LEVER, SLOPE = 0, 4, 8, 12, 13, 14, 15
_ROWS = 16
TRIPLE = 3  # control points on from one span to the next across a triple knot


@kernel
def side_by_side(first: Any, u: Any, weights: Any, b0: Any, b1: Any, b2: Any) -> Any:
    """Return the basis functions at the curvature points (groups, 16 LANES), and how their values are smoothed.

    In a span they become the mean, sum SHARE x, and in the two end spans and beside a triple knot the straight line
    through them, sum SHARE x + LEVER sum SLOPE x.
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
    """Return what a row has at a lane."""
    return W[row * LANES + lane]


@law
def put(W: Any, row: int, lane: int, x: float) -> None:
    """Set what a row has at a lane."""
    W[row * LANES + lane] = x


@law
def vector_at(W: Any, row: int, lane: int) -> Vector:
    """Return what three rows have at a lane."""
    return W[row * LANES + lane], W[(row + 1) * LANES + lane], W[(row + 2) * LANES + lane]


@law
def put_vector(W: Any, row: int, lane: int, x: Vector) -> None:
    """Set what three rows have at a lane."""
    W[row * LANES + lane] = x[0]
    W[(row + 1) * LANES + lane] = x[1]
    W[(row + 2) * LANES + lane] = x[2]


@law
def added(W: Any, row: int, s: int) -> float:
    """Return the sum of a row over the points of span s."""
    return W[row * LANES + s] + W[row * LANES + SPANS + s] + W[row * LANES + 2 * SPANS + s]


@law
def over(T: Any, share: int, W: Any, row: int, s: int) -> float:
    """Return the sum of a row of W over the points of span s, each times what the row `share` of T has there."""
    a, b = share * LANES + s, row * LANES + s
    return T[a] * W[b] + T[a + SPANS] * W[b + SPANS] + T[a + 2 * SPANS] * W[b + 2 * SPANS]


@law
def combined(W: Any, place: int, T: Any, row: int, lane: int) -> float:
    """Return the combination of the coordinate at `place` of four control points, by four rows of T at a lane.

    Control points of a span, four coordinates each, are at 16 rows of SPANS places.
    """
    own = T[row * LANES + lane] * W[place] + T[(row + 1) * LANES + lane] * W[place + 4 * SPANS]
    more = T[(row + 2) * LANES + lane] * W[place + 8 * SPANS]
    return own + more + T[(row + 3) * LANES + lane] * W[place + 12 * SPANS]
