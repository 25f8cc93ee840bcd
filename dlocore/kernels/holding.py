"""What grasps hold, compiled: their rows, the control points eliminated for them, and the starts of their paths."""

from typing import Any

import numpy as np

from dlocore.compiling.kernel import brief, kernel, law
from dlocore.effects.base import Vector
from dlocore.kernels.banded import elimination
from dlocore.kernels.basis import basis, find_span
from dlocore.kernels.strain import cross, transport, vector

ROW = 17  # numbers in a row
_JUMP = 2  # in place of the order of a derivative: the jump of the slope


@brief
def place(knots: Any, control: Any, u: float, dimensions: int) -> Any:
    """Return the point and the unit tangent (2, dimensions) at `u` of the spline with control points (n, m)."""
    table = np.empty((2, 4))
    span = find_span(knots, u)
    basis(knots, span, u, 1, table)
    out = np.zeros((2, dimensions))
    for order in range(2):
        for i in range(4):
            for d in range(dimensions):
                out[order, d] += table[order, i] * control[span - 3 + i, d]
    square = 0.0
    for d in range(dimensions):
        square += out[1, d] * out[1, d]
    for d in range(dimensions):
        out[1, d] /= np.sqrt(square)
    return out


@brief
def hold_rows(
    knots: Any, nc: int, times: Any, rows: Any, sampled: Any, origin: Any, axes: Any, clamps: Any, spins: Any, q: Any,
    radius: float,
) -> Any:  # fmt: skip
    """Solve each condition that grasps impose for one control point (docs/model.md eq. 11, 12).

    At an interior triple knot a spline may have a kink. The angle of the sections has one there, where a gripper turns
    them or their bends jump. The centreline has none: an additional row keeps the jump of its slope at zero, whether
    there is a grasp or not.

    Args:
        knots: (n + 4,) [m].
        nc: number of coordinates of a control point.
        times: (k,) [s].
        rows: (r, ROW) conditions on every coordinate of the centreline. Each has: the place [m], whether it holds a
            direction, whether its grasp holds the direction, the number of its path in `sampled` or -1, the start of
            the path [s], the straight move of a point or the turn about one axis of a direction
            (`dlocore.scene.paths.Move.line` and `turn`: duration [s], profile (5), and displacement [m] or rotation
            vector [rad] (3)), and the value at the start (3) in the world. `dlocore/problem/holding.py` writes them.
        sampled: (m, k, 3) points [m] or unit tangents over time of other paths, in the world.
        origin, axes: (3,) [m] and (dimensions, 3), of the coordinates of the solve.
        clamps: (c, 2) for each clamp, which also holds the angle of the section: the row of its direction, and the
            number of its spin in `spins` or -1.
        spins: (m, k) [rad] rotation of a gripper about the cable since the first of the times, for other paths.
        q: (n, nc) the state at the first of the times, which gives the angles of the sections there.
        radius: factor of the fourth coordinate [m], which is an angle times this radius.

    Returns:
        The `Elimination`, the prescribed part (k, held) [m] of the held degrees of freedom, and the inverses (rows,
        rows) and (c, c) of the pivot blocks of the rows. The rows are the given ones, followed by one for each triple
        knot.
    """
    given, nd = len(rows), len(axes)
    kinks = _triple_knots(knots)
    count = given + len(kinks)
    u, order, first = np.empty(count), np.full(count, _JUMP), np.zeros(count)
    u[given:] = kinks
    for r in range(given):
        u[r], order[r], first[r] = rows[r, 0], int(rows[r, 1]), rows[r, 2]
    pivots, inverse, follow = _solved_for(knots, u, order, first)
    turned = np.empty(len(clamps))
    for r in range(len(clamps)):
        turned[r] = rows[clamps[r, 0], 0]
    none = np.zeros(len(turned))
    turned_pivots, turned_inverse, turned_follow = _solved_for(knots, turned, np.zeros(len(turned), np.int64), none)
    offsets = np.zeros((len(times), count * nd + len(turned)))
    target = np.empty(3)
    for s in range(given):
        row = rows[s]
        for k in range(len(times)):
            if row[3] >= 0.0:
                for i in range(3):
                    target[i] = sampled[int(row[3]), k, i]
            elif row[1] == 0.0:
                done = _done(row, times[k])
                for i in range(3):
                    target[i] = row[14 + i] + done * row[11 + i]
            else:
                target[0], target[1], target[2] = _turned(row, _done(row, times[k]), (row[14], row[15], row[16]))
            if row[1] == 0.0:
                for i in range(3):
                    target[i] -= origin[i]
            for d in range(nd):
                value = target[0] * axes[d, 0] + target[1] * axes[d, 1] + target[2] * axes[d, 2]
                for r in range(count):
                    offsets[k, r * nd + d] += inverse[r, s] * value
    table = np.empty((2, 4))
    for s in range(len(turned)):
        span = find_span(knots, turned[s])
        basis(knots, span, turned[s], 0, table)
        begun = 0.0
        for i in range(4):
            begun += table[0, i] * q[span - 3 + i, nc - 1]
        spin = spins[clamps[s, 1]] if clamps[s, 1] >= 0 else _spin_of(rows[clamps[s, 0]], times)
        for r in range(len(turned)):
            for k in range(len(times)):
                offsets[k, count * nd + r] += turned_inverse[r, s] * (begun + radius * spin[k])
    e = elimination(len(knots) - 4, nc, nd, pivots, follow, turned_pivots, turned_follow)
    return e, offsets, inverse, turned_inverse


@law
def _done(row: Any, t: float) -> float:
    """Return the share of its way that the path of a row of `hold_rows` has covered at time t [s]."""
    x = min(max((t - row[4]) / row[5], 0.0), 1.0)
    return float(x * (row[6] + x * (row[7] + x * (row[8] + x * (row[9] + x * row[10])))))


@law
def _turned(row: Any, done: float, x: Vector) -> Vector:
    """Return x turned by the share `done` of the rotation of a row of `hold_rows` (Rodrigues)."""
    full = np.sqrt(row[11] * row[11] + row[12] * row[12] + row[13] * row[13])
    if full == 0.0:
        return x
    n = (row[11] / full, row[12] / full, row[13] / full)
    sine, half = np.sin(done * full), np.sin(0.5 * done * full)
    y = cross(n, x)
    z = cross(n, y)
    versine = 2.0 * half * half
    return (
        x[0] + sine * y[0] + versine * z[0],
        x[1] + sine * y[1] + versine * z[1],
        x[2] + sine * y[2] + versine * z[2],
    )


@kernel
def _spin_of(row: Any, times: Any) -> Any:
    """Return how far the gripper of a row of `hold_rows` has turned about the cable at `times`; see `spun`.

    It turns about one axis, and the angle between this axis and the tangent stays the same.
    """
    tangent = (row[14], row[15], row[16])
    about = row[11] * tangent[0] + row[12] * tangent[1] + row[13] * tangent[2]
    least = min(abs(tangent[0]), abs(tangent[1]), abs(tangent[2]))
    k = 0 if abs(tangent[0]) == least else 1 if abs(tangent[1]) == least else 2
    across = cross(tangent, (1.0 * (k == 0), 1.0 * (k == 1), 1.0 * (k == 2)))
    size = np.sqrt(across[0] * across[0] + across[1] * across[1] + across[2] * across[2])
    director = (across[0] / size, across[1] / size, across[2] / size)
    tangents, directors = np.empty((len(times), 3)), np.empty((len(times), 3))
    expected = np.empty(max(len(times) - 1, 0))
    before = 0.0
    for k in range(len(times)):
        done = _done(row, times[k])
        tangents[k, 0], tangents[k, 1], tangents[k, 2] = _turned(row, done, tangent)
        directors[k, 0], directors[k, 1], directors[k, 2] = _turned(row, done, director)
        if k > 0:
            expected[k - 1] = (done - before) * about
        before = done
    return spun(tangents, directors, expected)


@brief
def spun(tangents: Any, directors: Any, expected: Any) -> Any:
    """Return how far a gripper has turned about the cable since the first of the times (k,) [rad].

    The angle is measured against a frame that the smallest rotations carry from each tangent to the next; full turns
    count.

    Args:
        tangents: (k, 3) unit tangents of the cable, fixed in the gripper, over time.
        directors: (k, 3) unit vectors perpendicular to them, fixed in the gripper.
        expected: (k - 1,) rotation between consecutive times, correct to less than half a turn [rad].
    """
    out = np.zeros(len(tangents))
    for k in range(1, len(tangents)):
        t = vector(tangents, k, 0)
        x, y = transport(vector(tangents, k - 1, 0), t, vector(directors, k - 1, 0)), vector(directors, k, 0)
        turned = (x[1] * y[2] - x[2] * y[1]) * t[0] + (x[2] * y[0] - x[0] * y[2]) * t[1]
        turned += (x[0] * y[1] - x[1] * y[0]) * t[2]
        angle = np.arctan2(turned, x[0] * y[0] + x[1] * y[1] + x[2] * y[2])
        out[k] = out[k - 1] + angle + 2.0 * np.pi * np.round((expected[k - 1] - angle) / (2.0 * np.pi))
    return out


@kernel
def _triple_knots(knots: Any) -> Any:
    """Return the places (k,) [m] of the interior triple knots."""
    places = np.empty(len(knots))
    count = 0
    for k in range(4, len(knots) - 6):
        if knots[k] == knots[k + 2]:
            places[count] = knots[k]
            count += 1
    return places[:count].copy()


@kernel
def _solved_for(knots: Any, u: Any, order: Any, first: Any) -> Any:
    """Return the pivots of the rows at `u`, the inverse of their block, and how they follow the other control points.

    Pivots are chosen by Gauss elimination, for the rows `first` before the others: a held direction has only two
    control points to choose from, so it chooses before its neighbours do.
    """
    rows, n = len(u), len(knots) - 4
    A = np.zeros((rows, n))
    table = np.empty((2, 4))
    for r in range(rows):
        span, derivative = find_span(knots, u[r]), min(order[r], 1)
        basis(knots, span, u[r], derivative, table)
        A[r, span - 3 : span + 1] = table[derivative]
        if order[r] == _JUMP:
            basis(knots, span - 3, u[r], 1, table)
            A[r, span - 6 : span - 2] -= table[1]
    work = A.copy()
    pivots = np.full(rows, -1)
    for turn in range(2):
        for r in range(rows):
            if (first[r] != 0.0) != (turn == 0):
                continue
            for s in range(rows):
                if pivots[s] >= 0:
                    work[r] -= work[r, pivots[s]] / work[s, pivots[s]] * work[s]
            pivots[r] = np.argmax(np.abs(work[r]))
    block = np.empty((rows, rows))
    for s in range(rows):
        block[:, s] = A[:, pivots[s]]
    inverse = _inverse(block)
    follow = np.zeros((rows, n))
    for r in range(rows):
        for s in range(rows):
            follow[r] -= inverse[r, s] * A[s]
    for p in pivots:
        follow[:, p] = 0.0
    return pivots, inverse, follow


@kernel
def _inverse(block: Any) -> Any:
    """Return the inverse of a small matrix by Gauss-Jordan elimination with row pivoting; `block` is overwritten."""
    n = len(block)
    inverse = np.eye(n)
    for c in range(n):
        p = c + np.argmax(np.abs(block[c:, c]))
        for i in range(n):
            block[c, i], block[p, i] = block[p, i], block[c, i]
            inverse[c, i], inverse[p, i] = inverse[p, i], inverse[c, i]
        scale = 1.0 / block[c, c]
        block[c] *= scale
        inverse[c] *= scale
        for r in range(n):
            if r != c:
                factor = block[r, c]
                block[r] -= factor * block[c]
                inverse[r] -= factor * inverse[c]
    return inverse
