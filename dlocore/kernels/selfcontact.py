"""Contact of the cable with itself: pairs of segments between neighbouring nodes, and the tangent they widen.

The distance rho of a pair is that of its closest points, slightly drawn to the middles of the segments, so that it has
a gradient and a Hessian even where the segments are parallel:

    rho^2 = min over s, t in [0, 1] of |x_i(s) - x_j(t)|^2 + eps [h_i^2 (s - 1/2)^2 + h_j^2 (t - 1/2)^2]

h are the lengths of the segments, at most D. rho is too large by at most eps (h_i^2 + h_j^2)/(8 rho). Every pair of
segments more than `separation` apart along the cable has the potential w Phi(D - rho), where w is the shorter length
and Phi' = k phi is the elastic part of docs/model.md eq. 21. The elastic force and its tangent are exact derivatives.

A pair couples control points that are far apart along the cable. The reduced tangent is then stored by rows right of
its diagonal, each up to the last entry that a factorisation fills.
"""

from typing import Any

import numpy as np

from dlocore.compiling.kernel import kernel, law, leaf
from dlocore.effects.base import Vector
from dlocore.effects.contact import normal_force
from dlocore.effects.laws import SELF_CONTACT
from dlocore.kernels.nearby import look, place_pairs
from dlocore.kernels.strands import between, between_nodes, closest, dot

_DRAWN = 0.05  # eps
_WINDOW = 8  # control points of a segment, at most
_GATHERED = 3  # cost of an indexed entry relative to a consecutive one
_ROOM = 4096  # reduced entries of a pair, at most: held control points may follow many free ones


@law
def _pair(x: Any, u: Any, D: float, i: int, j: int) -> tuple[Vector, float, float, float, Vector, Vector, float, float]:
    """Return the vector between the closest points of segments i and j, rho, s, t, the segments' vectors and pulls."""
    a, b, r = between_nodes(x, i + 1, i), between_nodes(x, j + 1, j), between_nodes(x, i, j)
    pull_a, pull_b = _DRAWN * min(u[i + 1] - u[i], D) ** 2, _DRAWN * min(u[j + 1] - u[j], D) ** 2
    s, t = closest(r, a, b, pull_a, pull_b)
    y = between(r, a, b, s, t)
    rho = np.sqrt(dot(y, y) + pull_a * (s - 0.5) ** 2 + pull_b * (t - 0.5) ** 2)
    return y, rho, s, t, a, b, pull_a, pull_b


@law
def _spread_one(first: Any, b0: Any, i: int, s: float, sign: float, begin: int, point: Any, c: Any) -> int:
    """Write the control points of segment i and their weights at its point s, from place `begin` on; return the end."""
    shift = min(first[i + 1] - first[i], 4)  # control points between those of its ends have no weight
    for o in range(4 + shift):
        point[begin + o] = first[i] + o if o < shift else first[i + 1] + o - shift
        c[begin + o] = 0.0
    for o in range(4):
        c[begin + o] += sign * (1.0 - s) * b0[i, o]
        c[begin + o + shift] += sign * s * b0[i + 1, o]
    return begin + 4 + shift


@kernel
def _spread(first: Any, b0: Any, i: int, j: int, s: float, t: float, point: Any, c: Any) -> Any:
    """Write the control points of segments i and j and their weights in point s of i minus point t of j.

    Returns:
        the number of control points of i, and that of i and j together.
    """
    ni = _spread_one(first, b0, i, s, 1.0, 0, point, c)
    return ni, _spread_one(first, b0, j, t, -1.0, ni, point, c)


@law
def _rate(v: Any, point: Any, c: Any, m: int, y: Vector) -> float:
    """Return y . (velocity of the closest point of the first segment minus that of the second)."""
    total = 0.0
    for o in range(m):
        k = point[o]
        total += c[o] * (y[0] * v[k, 0] + y[1] * v[k, 1])
        if v.shape[1] > 2:
            total += c[o] * y[2] * v[k, 2]
    return total


@kernel
def press(q: Any, v: Any, nodes: Any, p: Any, x: Any, near: Any, f: Any) -> Any:
    """Subtract the forces of the contact from f (n, nc); return the number of touching pairs and the depth [m].

    The pairs are written to `near.met`.

    Args:
        q, v: control points and their velocities (n, nc) [m, m/s].
        x: (nodes, 2 or 3) positions of the nodes [m]; written, at least for these pairs.
        near: see `Nearby`.
    """
    look(q, nodes, p, x, near)
    u, first, b0 = nodes.u, nodes.first, nodes.b0
    D, stiffness, passage, damping = p[SELF_CONTACT, 0], p[SELF_CONTACT, 1], p[SELF_CONTACT, 2], p[SELF_CONTACT, 3]
    pairs, count = near.pairs[0], near.count[0]
    if count > len(near.met[0]):
        near.met[0] = np.empty_like(pairs)
    found = near.met[0]
    point = np.empty(2 * _WINDOW, np.int64)
    c = np.empty(2 * _WINDOW)
    kept = 0
    deepest = 0.0
    for n in range(count):
        i, j = pairs[n, 0], pairs[n, 1]
        y, rho, s, t, _, _, _, _ = _pair(x, u, D, i, j)
        if rho >= D:
            continue
        _, m = _spread(first, b0, i, j, s, t, point, c)
        total, _, _ = normal_force(stiffness, passage, damping, D - rho, _rate(v, point, c, m, y) / rho)
        if total <= 0.0:
            continue
        found[kept, 0], found[kept, 1] = i, j
        kept += 1
        deepest = max(deepest, D - np.sqrt(dot(y, y)))
        scale = total * min(u[i + 1] - u[i], u[j + 1] - u[j]) / rho
        for o in range(m):
            for d in range(x.shape[1]):
                f[point[o], d] -= scale * c[o] * y[d]
    return kept, deepest


@kernel
def _pair_tangent(
    v: Any, u: Any, first: Any, b0: Any, push: Any, x: Any, i: int, j: int, scales: Any, point: Any, H: Any
) -> int:
    """Write the control points of a pair to `point` and its tangent to H (m nd, m nd); return their number m."""
    elastic, viscous, geometric = scales
    nd = x.shape[1]
    y, rho, s, t, a, b, pull_a, pull_b = _pair(x, u, push[0], i, j)
    c = np.empty(2 * _WINDOW)
    ni, m = _spread(first, b0, i, j, s, t, point, c)
    leaving = _rate(v, point, c, m, y) / rho
    total, stiffness, viscosity = normal_force(push[1], push[2], push[3], push[0] - rho, leaving)
    w = min(u[i + 1] - u[i], u[j + 1] - u[j])
    size = m * nd
    # gradients, with respect to the control points, of rho^2/2 (g) and of its derivatives by s and t (vs, vt)
    along = np.empty(2 * _WINDOW)
    _spread(first, b0, i, j, s + 1.0, t + 1.0, point, along)  # linear in s and t
    g = np.empty(size)
    vs = np.empty(size)
    vt = np.empty(size)
    for o in range(m):
        for d in range(nd):
            turn = (along[o] - c[o]) * y[d]
            g[o * nd + d] = c[o] * y[d]
            vs[o * nd + d] = c[o] * a[d] + (turn if o < ni else 0.0)
            vt[o * nd + d] = -c[o] * b[d] + (turn if o >= ni else 0.0)
    # s and t follow where they are free, and stay where they are at a bound
    A, B, C = dot(a, a) + pull_a, dot(b, b) + pull_b, -dot(a, b)
    free_s, free_t = 0.0 < s < 1.0, 0.0 < t < 1.0
    ss = tt = st = 0.0
    if free_s and free_t:
        det = A * B - C * C
        ss, tt, st = B / det, A / det, -C / det
    elif free_s:
        ss = 1.0 / A
    elif free_t:
        tt = 1.0 / B
    bend = -w * geometric * total / rho
    normal = w * (elastic * stiffness + viscous * viscosity) / (rho * rho) - bend / (rho * rho)
    for k in range(size):
        by_g, by_s, by_t = normal * g[k], -bend * (ss * vs[k] + st * vt[k]), -bend * (st * vs[k] + tt * vt[k])
        for o in range(size):
            H[k, o] = by_g * g[o] + by_s * vs[o] + by_t * vt[o]
        for o in range(m):
            H[k, o * nd + k % nd] += bend * c[k // nd] * c[o]
    return m


@kernel
def widen(
    nc: int, v: Any, nodes: Any, p: Any, x: Any, found: Any, count: int, scales: Any, e: Any, A: Any, end: Any, S: Any
) -> None:
    """Write the banded reduced tangent A (free, width) plus that of the pairs to S (free, free), right of its diagonal.

    Args:
        found, count: pairs in contact and their number, from `press`.
        scales: of `assemble`, times the factor of the tangent in a step.
        e: elimination of the held degrees of freedom.
        S, end: what the last call wrote, and its factorisation, or zeros. `end` (free,) is one past the last column
            that the factorisation fills in each row.
    """
    free, width = A.shape
    nd = x.shape[1]
    u, first, b0 = nodes.u, nodes.first, nodes.b0
    push = (p[SELF_CONTACT, 0], p[SELF_CONTACT, 1], p[SELF_CONTACT, 2], p[SELF_CONTACT, 3])
    point = np.empty(2 * _WINDOW, np.int64)
    H = np.empty((2 * _WINDOW * nd, 2 * _WINDOW * nd))
    rows = np.empty(_ROOM, np.int64)
    place = np.empty(_ROOM, np.int64)
    share = np.empty(_ROOM)
    for r in range(free):
        S[r, r : end[r]] = 0.0
        end[r] = min(r + width, free)
        for o in range(end[r] - r):
            S[r, r + o] = A[r, o]
    for n in range(count):
        m = _pair_tangent(v, u, first, b0, push, x, found[n, 0], found[n, 1], scales, point, H)
        size = 0
        for o in range(m):
            for d in range(nd):
                k = e.index[point[o] * nc + d]
                if k >= 0:
                    rows[size], share[size], place[size] = k, 1.0, o * nd + d
                    size += 1
                else:
                    for z in range(e.start[-1 - k], e.start[-k]):
                        rows[size], share[size], place[size] = e.index[e.dof[z]], e.coefficient[z], o * nd + d
                        size += 1
        last = 0
        for k in range(size):
            last = max(last, rows[k] + 1)
            for o in range(size):
                if rows[k] <= rows[o]:
                    S[rows[k], rows[o]] += share[k] * share[o] * H[place[k], place[o]]
        for k in range(size):
            end[rows[k]] = max(end[rows[k]], last)
    for r in range(1, free):  # a row inherits what the rows before it fill
        end[r] = max(end[r], end[r - 1])


@leaf
def factor_wide(S: Any, end: Any, filled: Any, columns: Any) -> int:
    """Factor S = U' D U in place, up to the ends of its rows; return -1, or the row of a pivot that is not positive.

    Args:
        filled, columns: (free,) and (free, free), written: number and indices of the nonzero columns of each row beyond
            the diagonal.
    """
    for j in range(len(end)):
        pivot = S[j, j]
        if not pivot > 0.0:
            return j
        count = 0
        for i in range(j + 1, end[j]):
            if S[j, i] != 0.0:
                columns[j, count] = i
                count += 1
        filled[j] = count
        for a in range(count):
            i = columns[j, a]
            ratio = S[j, i] / pivot
            if _GATHERED * (count - a) > end[j] - i:
                for k in range(i, end[j]):
                    S[i, k] -= ratio * S[j, k]
            else:
                for b in range(a, count):
                    k = columns[j, b]
                    S[i, k] -= ratio * S[j, k]
    return -1


@leaf
def solve_wide(S: Any, filled: Any, columns: Any, x: Any) -> None:
    """Solve U' D U x = b in place with the factors of `factor_wide`."""
    n = len(filled)
    for j in range(n):
        ratio = x[j] / S[j, j]
        for a in range(filled[j]):
            i = columns[j, a]
            x[i] -= ratio * S[j, i]
    for j in range(n - 1, -1, -1):
        total = x[j]
        for a in range(filled[j]):
            i = columns[j, a]
            total -= S[j, i] * x[i]
        x[j] = total / S[j, j]


@kernel
def closing(q0: Any, q1: Any, nodes: Any, p: Any, x0: Any, x1: Any, found: Any, count: int) -> float:
    """Return the largest approach [m], from q0 to q1, of a pair that comes into contact."""
    place_pairs(q0, nodes, found, count, x0)
    place_pairs(q1, nodes, found, count, x1)
    u, D = nodes.u, p[SELF_CONTACT, 0]
    most = 0.0
    for n in range(count):
        i, j = found[n, 0], found[n, 1]
        before = _pair(x0, u, D, i, j)[1]
        if before > D:
            most = max(most, before - _pair(x1, u, D, i, j)[1])
    return most
