"""Contact of the cable with itself: pairs of segments between neighbouring nodes, and the tangent they widen.

A pair's distance rho is that of its closest points, slightly drawn to the segments' middles, so that it has a gradient
and a Hessian also where the segments are parallel:

    rho^2 = min over s, t in [0, 1] of |x_i(s) - x_j(t)|^2 + eps [h_i^2 (s - 1/2)^2 + h_j^2 (t - 1/2)^2]

with the segments' lengths h, at most D. It is too large by at most eps (h_i^2 + h_j^2)/(8 rho). Every pair of segments
that are more than `separation` apart along the cable has the potential w phi(D - rho), w the shorter length: force and
tangent are its exact derivatives.

A pair couples control points that are far apart along the cable. The reduced tangent is then kept by rows above its
diagonal, each with the end of what a factorisation fills.
"""

from typing import Any

import numpy as np

from dlocore.effects.base import Vector
from dlocore.effects.contact import pressure
from dlocore.effects.laws import SELF_CONTACT
from dlocore.kernels.compile import kernel, law

_DRAWN = 0.05  # eps
_SLACK = 0.9  # of a distance that is skipped along the cable: a strained cable is longer
_TOO_NEAR = 0.5  # of the diameter: no step brings strands from farther away nearer than this
_LOOK = 1e-3  # diameters: the least way between two looks at a gap
_WIDE = 8.0  # times the distance of interest, up to which it is told how far apart strands are
_WINDOW = 8  # control points of a segment, at most
_BLOCK = 16  # segments that are looked at as one before each of them is
_ROOM = 4096  # reduced entries of a pair, at most: held control points may follow many free ones


@kernel
def place_nodes(q: Any, tables: Any, x: Any) -> None:
    """Write the positions x (nodes, 2 or 3) [m] of the contact nodes of the control points q (n, nc)."""
    for n in range(len(x)):
        k = tables.contact_first[n]
        for d in range(x.shape[1]):
            value = 0.0
            for i in range(4):
                value += tables.contact_b0[n, i] * q[k + i, d]
            x[n, d] = value


@law
def _vector(x: Any, a: int, b: int) -> Vector:
    """Return node a minus node b."""
    z = 0.0
    if x.shape[1] > 2:
        z = x[a, 2] - x[b, 2]
    return x[a, 0] - x[b, 0], x[a, 1] - x[b, 1], z


@law
def _dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@law
def _clamp(s: float) -> float:
    return min(max(s, 0.0), 1.0)


@law
def _closest(r: Vector, a: Vector, b: Vector, pull_a: float, pull_b: float) -> tuple[float, float]:
    """Return s, t of the closest points of r + s a and t b, drawn to the middles (Ericson, 2005, section 5.1.9)."""
    A, B, C = _dot(a, a) + pull_a, _dot(b, b) + pull_b, _dot(a, b)
    p, q = 0.5 * pull_a - _dot(a, r), 0.5 * pull_b + _dot(b, r)
    s = _clamp((p * B + q * C) / (A * B - C * C))
    t = (q + C * s) / B
    if t < 0.0 or t > 1.0:
        t = _clamp(t)
        s = _clamp((p + C * t) / A)
    return s, t


@law
def _between(r: Vector, a: Vector, b: Vector, s: float, t: float) -> Vector:
    return r[0] + s * a[0] - t * b[0], r[1] + s * a[1] - t * b[1], r[2] + s * a[2] - t * b[2]


@kernel
def longest_part(u: Any) -> float:
    """Return the largest distance of neighbours among u (k,)."""
    longest = 0.0
    for n in range(len(u) - 1):
        longest = max(longest, u[n + 1] - u[n])
    return longest


@kernel
def _middles(x: Any) -> Any:
    """Return the middles (k - 1, 3) of the segments between the nodes x (k, 2 or 3), and half their lengths."""
    middle = np.zeros((len(x) - 1, 3))
    half = np.empty(len(x) - 1)
    for i in range(len(half)):
        square = 0.0
        for d in range(x.shape[1]):
            middle[i, d] = 0.5 * (x[i, d] + x[i + 1, d])
            square += (x[i + 1, d] - x[i, d]) ** 2
        half[i] = 0.5 * np.sqrt(square)
    return middle, half


@kernel
def _blocks(middle: Any, half: Any) -> Any:
    """Return centres (k, 3) and radii (k,) [m] of balls around blocks of segments with these middles and half lengths.

    Half lengths may hold more than that; the radii are sums of all they hold and the way from the centre.
    """
    last = len(half)
    count = (last + _BLOCK - 1) // _BLOCK
    center = np.empty((count, 3))
    radius = np.zeros(count)
    for n in range(count):
        a, b = n * _BLOCK, min((n + 1) * _BLOCK, last)
        for d in range(3):
            center[n, d] = 0.5 * (middle[a, d] + middle[b - 1, d])
        for i in range(a, b):
            square = 0.0
            for d in range(3):
                square += (middle[i, d] - center[n, d]) ** 2
            radius[n] = max(radius[n], np.sqrt(square) + half[i])
    return center, radius


@law
def _apart(x: Any, a: int, b: int) -> float:
    """Return the distance of two of the points x (k, 3)."""
    u, v, w = x[a, 0] - x[b, 0], x[a, 1] - x[b, 1], x[a, 2] - x[b, 2]
    return np.sqrt(u * u + v * v + w * w)


@kernel
def near_pairs(x: Any, u: Any, radius: float, separation: float, found: Any) -> Any:
    """Return (found, count): pairs of segments of the nodes x (k, 2 or 3) that may be nearer than `radius` [m].

    The distance of two segments grows at most as fast as one goes along the cable, so that from a far one the next are
    skipped.

    Args:
        u: material coordinates of the nodes (k,) [m].
        separation: pairs closer than this along the cable are left out [m].
        found: (room, 2) to be written, or replaced by a larger one.
    """
    count = 0
    last = len(u) - 1
    ahead = _SLACK / longest_part(u)
    middle, half = _middles(x)
    longest = np.max(half)
    center, around = _blocks(middle, half)
    near = np.empty(len(around), np.int64)
    j0 = 0
    for block in range(len(around)):
        nears = 0
        for other in range(block, len(around)):
            if not _apart(center, block, other) > radius + around[block] + around[other]:
                near[nears] = other
                nears += 1
        for i in range(block * _BLOCK, min((block + 1) * _BLOCK, last)):
            while j0 < last and u[j0] - u[i + 1] < separation:
                j0 += 1
            j = j0
            reach = radius + half[i] + longest
            for n in range(nears):
                j = max(j, near[n] * _BLOCK)
                end = min((near[n] + 1) * _BLOCK, last)
                while j < end:
                    a, b, c = middle[i, 0] - middle[j, 0], middle[i, 1] - middle[j, 1], middle[i, 2] - middle[j, 2]
                    square = a * a + b * b + c * c
                    if square > reach * reach:
                        j += max(1, int(ahead * (np.sqrt(square) - reach)))
                        continue
                    if count == len(found):
                        larger = np.empty((2 * len(found) + 16, 2), np.int64)
                        larger[:count] = found
                        found = larger
                    found[count, 0], found[count, 1] = i, j
                    count += 1
                    j += 1
    return found, count


@law
def _pair(x: Any, u: Any, D: float, i: int, j: int) -> Any:
    """Return the vector between the closest points of segments i and j, rho, s, t and the segments' vectors."""
    a, b, r = _vector(x, i + 1, i), _vector(x, j + 1, j), _vector(x, i, j)
    pull_a, pull_b = _DRAWN * min(u[i + 1] - u[i], D) ** 2, _DRAWN * min(u[j + 1] - u[j], D) ** 2
    s, t = _closest(r, a, b, pull_a, pull_b)
    y = _between(r, a, b, s, t)
    rho = np.sqrt(_dot(y, y) + pull_a * (s - 0.5) ** 2 + pull_b * (t - 0.5) ** 2)
    return y, rho, s, t, a, b, pull_a, pull_b


@kernel
def _spread(first: Any, b0: Any, i: int, j: int, s: float, t: float, point: Any, c: Any) -> Any:
    """Write the control points of segments i and j and how they weigh in point s of i minus point t of j.

    Returns:
        how many control points belong to i, and how many to both.
    """
    shift = first[i + 1] - first[i]
    ni = 4 + shift
    for o in range(ni):
        point[o], c[o] = first[i] + o, 0.0
    for o in range(4):
        c[o] += (1.0 - s) * b0[i, o]
        c[o + shift] += s * b0[i + 1, o]
    shift = first[j + 1] - first[j]
    m = ni + 4 + shift
    for o in range(ni, m):
        point[o], c[o] = first[j] + o - ni, 0.0
    for o in range(4):
        c[ni + o] -= (1.0 - t) * b0[j, o]
        c[ni + o + shift] -= t * b0[j + 1, o]
    return ni, m


@law
def _rate(v: Any, point: Any, c: Any, m: int, y: Vector) -> float:
    """Return y . (velocity of the one closest point minus that of the other)."""
    total = 0.0
    for o in range(m):
        k = point[o]
        total += c[o] * (y[0] * v[k, 0] + y[1] * v[k, 1])
        if v.shape[1] > 2:
            total += c[o] * y[2] * v[k, 2]
    return total


@law
def _push(D: float, k: float, w: float, c: float, rho: float, rate: float) -> tuple[float, float, float]:
    """Return the force per length with its damping [N/m], its stiffness [N/m^2] and viscosity [N s/m^2]."""
    N, stiffness = pressure(k, w, D - rho)
    viscosity = c * stiffness / k
    return N - viscosity * rate, stiffness, viscosity


@kernel
def press(q: Any, v: Any, tables: Any, p: Any, x: Any, found: Any, f: Any) -> Any:
    """Subtract the forces of the contact from f (n, nc); return (found, count, depth), the pairs and the deepest [m].

    Args:
        q, v: control points and their velocities (n, nc) [m, m/s].
        x: (nodes, 2 or 3), written: the nodes' positions [m].
        found: room for the pairs, see `near_pairs`.
    """
    place_nodes(q, tables, x)
    u, first, b0 = tables.contact_u, tables.contact_first, tables.contact_b0
    D, stiffness, passage, damping = p[SELF_CONTACT, 0], p[SELF_CONTACT, 1], p[SELF_CONTACT, 2], p[SELF_CONTACT, 3]
    found, count = near_pairs(x, u, D, p[SELF_CONTACT, 4], found)
    point = np.empty(2 * _WINDOW, np.int64)
    c = np.empty(2 * _WINDOW)
    kept = 0
    deepest = 0.0
    for n in range(count):
        i, j = found[n, 0], found[n, 1]
        y, rho, s, t, _, _, _, _ = _pair(x, u, D, i, j)
        if rho >= D:
            continue
        _, m = _spread(first, b0, i, j, s, t, point, c)
        total, _, _ = _push(D, stiffness, passage, damping, rho, _rate(v, point, c, m, y) / rho)
        if total <= 0.0:
            continue
        found[kept, 0], found[kept, 1] = i, j
        kept += 1
        deepest = max(deepest, D - np.sqrt(_dot(y, y)))
        scale = total * min(u[i + 1] - u[i], u[j + 1] - u[j]) / rho
        for o in range(m):
            for d in range(x.shape[1]):
                f[point[o], d] -= scale * c[o] * y[d]
    return found, kept, deepest


@kernel
def _pair_tangent(
    v: Any, u: Any, first: Any, b0: Any, push: Any, x: Any, i: int, j: int, scales: Any, point: Any, H: Any
) -> int:
    """Write the control points of a pair to `point`, its tangent to H (m nd, m nd), and return their number m."""
    elastic, viscous, geometric = scales
    nd = x.shape[1]
    y, rho, s, t, a, b, pull_a, pull_b = _pair(x, u, push[0], i, j)
    c = np.empty(2 * _WINDOW)
    ni, m = _spread(first, b0, i, j, s, t, point, c)
    total, stiffness, viscosity = _push(push[0], push[1], push[2], push[3], rho, _rate(v, point, c, m, y) / rho)
    w = min(u[i + 1] - u[i], u[j + 1] - u[j])
    size = m * nd
    # derivatives of half rho^2: by the control points (g), and of its derivatives by s and t (vs, vt)
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
    # s and t follow where they are free, and stay where they are clamped
    A, B, C = _dot(a, a) + pull_a, _dot(b, b) + pull_b, -_dot(a, b)
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
    nc: int, v: Any, tables: Any, p: Any, x: Any, found: Any, count: int, scales: Any, e: Any, A: Any, end: Any, S: Any
) -> None:
    """Write the banded reduced tangent A (free, width) plus that of the pairs to S (free, free), above its diagonal.

    Args:
        found, count: of `press`.
        scales: of `assemble`, times what the tangent counts in a step.
        e: elimination of the held degrees of freedom.
        end: (free,), written: the place after the last column of each row that the factorisation of S fills.
    """
    free, width = A.shape
    nd = x.shape[1]
    u, first, b0 = tables.contact_u, tables.contact_first, tables.contact_b0
    push = (p[SELF_CONTACT, 0], p[SELF_CONTACT, 1], p[SELF_CONTACT, 2], p[SELF_CONTACT, 3])
    point = np.empty(2 * _WINDOW, np.int64)
    H = np.empty((2 * _WINDOW * nd, 2 * _WINDOW * nd))
    rows = np.empty(_ROOM, np.int64)
    place = np.empty(_ROOM, np.int64)
    share = np.empty(_ROOM)
    S[:] = 0.0
    for r in range(free):
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


@kernel
def factor_wide(S: Any, end: Any) -> int:
    """Factor S = U' D U in place, within its rows' ends; return -1, or the row where a pivot is not positive."""
    for j in range(len(end)):
        pivot = S[j, j]
        if not pivot > 0.0:
            return j
        for i in range(j + 1, end[j]):
            if S[j, i] != 0.0:
                ratio = S[j, i] / pivot
                for k in range(i, end[j]):
                    S[i, k] -= ratio * S[j, k]
    return -1


@kernel
def solve_wide(S: Any, end: Any, x: Any) -> None:
    """Solve U' D U x = b in place with the factors of `factor_wide`."""
    n = len(end)
    for j in range(n):
        ratio = x[j] / S[j, j]
        for i in range(j + 1, end[j]):
            x[i] -= ratio * S[j, i]
    for j in range(n - 1, -1, -1):
        total = x[j]
        for i in range(j + 1, end[j]):
            total -= S[j, i] * x[i]
        x[j] = total / S[j, j]


@kernel
def meeting_pairs(x0: Any, x1: Any, u: Any, near: float, separation: float, found: Any) -> Any:
    """Return (found, count): pairs of segments that may come nearer than `near` [m] as nodes go straight from x0 to x1.

    Strands that move together stay apart: only how far two segments move against each other counts. That, as their
    distance, grows at most so fast as one goes along the cable, so that from a clear one the next are skipped. The
    count is -1 where the nodes go beyond all bounds.

    Args:
        x0, x1: nodes (k, 2 or 3) [m].
        u, separation, found: see `near_pairs`.
    """
    middle, half = _middles(x0)
    moved, turned = _middles(x1 - x0)
    last = len(half)
    reach, slope = 0.0, 0.0
    for j in range(last):
        half[j] += turned[j]
        reach = max(reach, half[j])
        if j > 0:
            slope = max(slope, _apart(middle, j, j - 1) + _apart(moved, j, j - 1))
        if not half[j] < np.inf:
            return found, -1
    center, around = _blocks(middle, half)
    way, stray = _blocks(moved, np.zeros(last))
    near_by = np.empty(len(around), np.int64)
    count = 0
    j0 = 0
    for block in range(len(around)):
        nears = 0
        for other in range(block, len(around)):
            room = near + around[block] + around[other] + stray[block] + stray[other]
            if not _apart(center, block, other) - _apart(way, block, other) > room:
                near_by[nears] = other
                nears += 1
        for i in range(block * _BLOCK, min((block + 1) * _BLOCK, last)):
            while j0 < last and u[j0] - u[i + 1] < separation:
                j0 += 1
            j = j0
            for n in range(nears):
                j = max(j, near_by[n] * _BLOCK)
                end = min((near_by[n] + 1) * _BLOCK, last)
                while j < end:
                    clear = _apart(middle, i, j) - _apart(moved, i, j) - near - half[i] - reach
                    if clear > 0.0:
                        j += max(1, int(clear / slope))
                        continue
                    if count == len(found):
                        larger = np.empty((2 * len(found) + 16, 2), np.int64)
                        larger[:count] = found
                        found = larger
                    found[count, 0], found[count, 1] = i, j
                    count += 1
                    j += 1
    return found, count


@kernel
def clear_way(x0: Any, x1: Any, u: Any, diameter: float, separation: float, found: Any) -> Any:
    """Return (found, share): how far, 0 to 1, the nodes may go from x0 straight to x1 without strands passing strands.

    That is up to where a pair of segments comes nearer than `_TOO_NEAR` diameters; one that is nearer already, than a
    fifth nearer still. Distances change at most as fast as the nodes move against each other, which is how far one may
    look ahead.
    """
    share = 1.0
    near = _TOO_NEAR * diameter
    found, count = meeting_pairs(x0, x1, u, near, separation, found)
    if count < 0:
        return found, 0.0
    for c in range(count):
        i, j = found[c, 0], found[c, 1]
        r0, a0, b0 = _vector(x0, i, j), _vector(x0, i + 1, i), _vector(x0, j + 1, j)
        r1, a1, b1 = _vector(x1, i, j), _vector(x1, i + 1, i), _vector(x1, j + 1, j)
        fastest = 0.0
        for k in range(4):
            s, t = k // 2, k % 2
            y0, y1 = _between(r0, a0, b0, s, t), _between(r1, a1, b1, s, t)
            move = (y1[0] - y0[0], y1[1] - y0[1], y1[2] - y0[2])
            fastest = max(fastest, np.sqrt(_dot(move, move)))
        if fastest == 0.0:
            continue
        if not fastest < np.inf:
            return found, 0.0
        least = near
        z = 0.0
        while z < share:
            r = (r0[0] + z * (r1[0] - r0[0]), r0[1] + z * (r1[1] - r0[1]), r0[2] + z * (r1[2] - r0[2]))
            a = (a0[0] + z * (a1[0] - a0[0]), a0[1] + z * (a1[1] - a0[1]), a0[2] + z * (a1[2] - a0[2]))
            b = (b0[0] + z * (b1[0] - b0[0]), b0[1] + z * (b1[1] - b0[1]), b0[2] + z * (b1[2] - b0[2]))
            tiny = 1e-12 * diameter * diameter
            s, t = _closest(r, a, b, tiny, tiny)
            y = _between(r, a, b, s, t)
            gap = np.sqrt(_dot(y, y))
            if z == 0.0:
                least = min(near, 0.8 * gap)
            elif gap <= least:
                share = z
                break
            # a look at least so far ahead that the gap changes by a tenth of what is kept
            z += max(gap - least, 0.1 * least, _LOOK * diameter) / fastest
    return found, share


@kernel
def closing(x0: Any, x1: Any, u: Any, D: float, found: Any, count: int) -> float:
    """Return how far, from x0 to x1, a pair that newly touches has come towards each other [m], the largest."""
    most = 0.0
    for n in range(count):
        i, j = found[n, 0], found[n, 1]
        before = _pair(x0, u, D, i, j)[1]
        if before > D:
            most = max(most, before - _pair(x1, u, D, i, j)[1])
    return most


@kernel
def nearest(x: Any, u: Any, separation: float, cap: float) -> float:
    """Return the smallest distance of segments of the nodes x (k, 2 or 3), at most `cap` [m].

    Args:
        u: material coordinates of the nodes (k,) [m].
        separation: segments closer than this along the cable are left out [m].
        cap: what is returned where all are farther.
    """
    best = cap
    last = len(u) - 1
    ahead = _SLACK / longest_part(u)
    middle, half = _middles(x)
    longest = np.max(half)
    tiny = 1e-12 * longest * longest
    j0 = 0
    for i in range(last):
        while j0 < last and u[j0] - u[i + 1] < separation:
            j0 += 1
        j = j0
        while j < last:
            a, b, c = middle[i, 0] - middle[j, 0], middle[i, 1] - middle[j, 1], middle[i, 2] - middle[j, 2]
            square = a * a + b * b + c * c
            reach = best + half[i] + longest
            if square > reach * reach:
                j += max(1, int(ahead * (np.sqrt(square) - reach)))
                continue
            first, second, apart = _vector(x, i + 1, i), _vector(x, j + 1, j), _vector(x, i, j)
            s, t = _closest(apart, first, second, tiny, tiny)
            y = _between(apart, first, second, s, t)
            best = min(best, np.sqrt(_dot(y, y)))
            j += 1
    return best


@kernel
def turning(q: Any, nd: int) -> float:
    """Return the total angle [rad] by which the control polygon of q (n, nc) turns."""
    turned = 0.0
    for i in range(1, q.shape[0] - 1):
        product, before, after = 0.0, 0.0, 0.0
        for d in range(nd):
            a, b = q[i, d] - q[i - 1, d], q[i + 1, d] - q[i, d]
            product += a * b
            before += a * a
            after += b * b
        if before > 0.0 and after > 0.0:
            turned += np.arccos(min(max(product / np.sqrt(before * after), -1.0), 1.0))
    return turned


@kernel
def turning_states(states: Any, nd: int, angle: float) -> Any:
    """Return the numbers of the states (k, n, nc) whose control polygon turns by more than `angle` [rad]."""
    found = np.empty(len(states), np.int64)
    count = 0
    for k in range(len(states)):
        if turning(states[k], nd) > angle:
            found[count] = k
            count += 1
    return found[:count]


@kernel
def nearest_of(states: Any, which: Any, first: Any, b: Any, u: Any, nd: int, separation: float, cap: float) -> float:
    """Return the smallest `nearest` of the states `which` of (k, n, nc), at nodes with rows `first` (m,), b (m, 4).

    No point moves farther than the control point that moves most. So states that lie so close to one whose strands are
    far apart that they can't have come nearer than what was found are not looked at.
    """
    best = cap
    wide = _WIDE * cap
    x = np.empty((len(u), nd))
    seen, apart = -1, 0.0  # the state last looked at, and how far apart its strands are, at most `wide`
    for k in which:
        if seen >= 0:
            moved = 0.0
            for n in range(states.shape[1]):
                square = 0.0
                for d in range(nd):
                    square += (states[k, n, d] - states[seen, n, d]) ** 2
                moved = max(moved, square)
            if apart - 2.0 * np.sqrt(moved) >= best:
                continue
        for n in range(len(u)):
            for d in range(nd):
                value = 0.0
                for i in range(4):
                    value += b[n, i] * states[k, first[n] + i, d]
                x[n, d] = value
        seen, apart = k, nearest(x, u, separation, wide)
        best = min(best, apart)
    return best
