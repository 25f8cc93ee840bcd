"""Search for strands of the cable that are near each other or meet: pairs of segments between neighbouring nodes."""

from typing import Any

import numpy as np

from dlocore.compiling.kernel import kernel, law, leaf
from dlocore.effects.base import Vector

_SLACK = 0.9  # of a length that is skipped along the cable: a strained cable is longer
_TOO_NEAR = 0.5  # of the diameter: no step brings strands from farther away nearer than this
_LOOK = 1e-3  # diameters: the least distance between two evaluations of a gap
_WIDE = 8.0  # times the distance of interest, or ...
_WIDER = 0.3  # ... of the length between strands: the larger is the distance up to which gaps are measured
_KEPT = (
    # strands are searched from this share of the length within which they can't be near: later states turn more
    0.8
)
_BLOCK = 16  # segments that are checked as one before each of them is


@law
def between_nodes(x: Any, a: int, b: int) -> Vector:
    """Return node a minus node b."""
    z = 0.0
    if x.shape[1] > 2:
        z = x[a, 2] - x[b, 2]
    return x[a, 0] - x[b, 0], x[a, 1] - x[b, 1], z


@law
def dot(a: Vector, b: Vector) -> float:
    """Return the dot product of two vectors."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@law
def _clamp(s: float) -> float:
    return min(max(s, 0.0), 1.0)


@law
def closest(r: Vector, a: Vector, b: Vector, pull_a: float, pull_b: float) -> tuple[float, float]:
    """Return s, t of the closest points of r + s a and t b, drawn to the middles (Ericson, 2005, section 5.1.9)."""
    A, B, C = dot(a, a) + pull_a, dot(b, b) + pull_b, dot(a, b)
    p, q = 0.5 * pull_a - dot(a, r), 0.5 * pull_b + dot(b, r)
    s = _clamp((p * B + q * C) / (A * B - C * C))
    t = (q + C * s) / B
    if t < 0.0 or t > 1.0:
        t = _clamp(t)
        s = _clamp((p + C * t) / A)
    return s, t


@law
def between(r: Vector, a: Vector, b: Vector, s: float, t: float) -> Vector:
    """Return the vector between the points r + s a and t b."""
    return r[0] + s * a[0] - t * b[0], r[1] + s * a[1] - t * b[1], r[2] + s * a[2] - t * b[2]


@leaf
def longest_part(u: Any) -> float:
    """Return the largest distance between neighbours in u (k,)."""
    longest = 0.0
    for n in range(len(u) - 1):
        longest = max(longest, u[n + 1] - u[n])
    return longest


@kernel
def _middles(x: Any) -> Any:
    """Return the midpoints (k - 1, 3) of the segments between the nodes x (k, 2 or 3), and half their lengths."""
    middle = np.zeros((len(x) - 1, 3))
    half = np.empty(len(x) - 1)
    for i in range(len(half)):
        square = 0.0
        for d in range(x.shape[1]):
            middle[i, d] = 0.5 * (x[i, d] + x[i + 1, d])
            square += (x[i + 1, d] - x[i, d]) ** 2
        half[i] = 0.5 * np.sqrt(square)
    return middle, half


@law
def _apart(x: Any, a: int, b: int) -> float:
    """Return the distance between two of the points x (k, 3)."""
    u, v, w = x[a, 0] - x[b, 0], x[a, 1] - x[b, 1], x[a, 2] - x[b, 2]
    return np.sqrt(u * u + v * v + w * w)


@leaf
def _hop(x: Any, moved: Any) -> float:
    """Return the largest sum, over neighbours in x (k, 3), of their distance and of their relative displacement."""
    most = 0.0
    for n in range(1, len(x)):
        most = max(most, _apart(x, n, n - 1) + _apart(moved, n, n - 1))
    return most


@kernel
def _blocks(middle: Any, half: Any) -> Any:
    """Return centres (k, 3) and radii (k,) [m] of balls around blocks of segments, from midpoints and half lengths.

    Half lengths may include further margins; a radius is the largest sum of a half length and the distance from the
    centre.
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


@kernel
def _ways(half: Any) -> Any:
    """Return the length [m] from the first segment to each block, and to the end of the last, from half lengths."""
    last = len(half)
    ways = np.zeros((last + _BLOCK - 1) // _BLOCK + 1)
    for i in range(last):
        ways[i // _BLOCK + 1] += 2.0 * half[i]
    for n in range(1, len(ways)):
        ways[n] += ways[n - 1]
    return ways


@kernel
def _stretches(u: Any, half: Any) -> Any:
    """Return the least ratio of length to length along the cable (k,) of the segments of each block; at most one.

    Args:
        u: material coordinates of the nodes [m].
        half: half lengths of the segments between them [m].
    """
    last = len(half)
    least = np.ones((last + _BLOCK - 1) // _BLOCK)
    for i in range(last):
        least[i // _BLOCK] = min(least[i // _BLOCK], 2.0 * half[i] / (u[i + 1] - u[i]))
    return least


@leaf
def _is_open(x: Any, ways: Any, least: Any, a: int, b: int, separation: float, near: float) -> bool:
    """Tell whether the nodes x (k, 2 or 3) from block a to block b are so straight that no part of them meets another.

    In a stretch of length S and chord c, a part of length s has a chord of at least s - (S - c).

    Args:
        ways, least: see `_ways` and `_stretches`.
        separation: least distance along the cable of parts that may meet [m].
        near: distance at which parts meet [m].
    """
    c = between_nodes(x, min((b + 1) * _BLOCK, len(x) - 1), a * _BLOCK)
    room = separation - near - (ways[b + 1] - ways[a] - np.sqrt(dot(c, c)))
    n = a
    while n <= b and (1.0 - least[n]) * separation < room:
        n += 1
    return n > b


@leaf
def _blocks_near(
    x: Any, block: int, center: Any, way: Any, hop: float, around: Any, widest: float, ways: Any, least: Any,
    separation: float, near: float, found: Any,
) -> int:  # fmt: skip
    """Write to `found` (blocks,) the blocks from `block` on whose segments may meet its own; return their number.

    Args:
        x: the nodes (k, 2 or 3) [m].
        center, around, widest: centres and radii of the balls around the blocks, see `_blocks`, and the largest radius
            [m].
        way, hop: displacements of the centres (blocks, 3) [m], and their `_hop`.
        ways, least, separation, near: see `_is_open`.
    """
    count, other = 0, block
    while other < len(around):
        clear = _apart(center, block, other) - _apart(way, block, other) - near - around[block] - widest
        if clear > 0.0:
            other += max(1, int(clear / hop))
            continue
        if not _is_open(x, ways, least, block, other, separation, near):
            found[count] = other
            count += 1
        other += 1
    return count


@kernel
def _noted(found: Any, count: int, i: int, j: int) -> Any:
    """Append a pair to the pairs `found` (room, 2), of which `count` are set; return them, or a larger copy."""
    if count == len(found):
        larger = np.empty((2 * len(found) + 16, 2), np.int64)
        larger[:count] = found
        found = larger
    found[count, 0], found[count, 1] = i, j
    return found


@kernel
def near_pairs(x: Any, u: Any, radius: float, separation: float, found: Any) -> Any:
    """Return (found, count): pairs of segments of the nodes x (k, 2 or 3) that may be nearer than `radius` [m].

    The distance of two segments, or of two blocks of them, grows at most as fast as the length along the cable, so
    after a distant one the next are skipped. Blocks between which the cable is nearly straight are skipped too.

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
    still = np.zeros_like(center)
    hop, widest = _hop(center, still), np.max(around)
    ways, least = _ways(half), _stretches(u, half)
    near = np.empty(len(around), np.int64)
    j0 = 0
    for block in range(len(around)):
        nears = _blocks_near(
            x, block, center, still, hop, around, widest, ways, least, separation, radius, near
        )  # fmt: skip
        if nears == 0:
            continue
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
                    found = _noted(found, count, i, j)
                    count += 1
                    j += 1
    return found, count


@kernel
def meeting_pairs(x0: Any, x1: Any, u: Any, near: float, separation: float, found: Any) -> Any:
    """Return (found, count): pairs of segments that may come nearer than `near` [m] as nodes go straight from x0 to x1.

    Strands that move together stay apart: only the relative motion of two segments counts. Like their distance, it
    grows at most as fast as the length along the cable, so after a segment with clearance the next are skipped. The
    count is -1 where the displacement of the nodes is not finite.

    Args:
        x0, x1: nodes (k, 2 or 3) [m].
        u, separation, found: see `near_pairs`.
    """
    middle, half = _middles(x0)
    moved, turned = _middles(x1 - x0)
    last = len(half)
    least = _stretches(u, half)
    reach, slope = 0.0, _hop(middle, moved)
    for j in range(last):
        half[j] += turned[j]
        reach = max(reach, half[j])
        if not half[j] < np.inf:
            return found, -1
    center, around = _blocks(middle, half)
    way, stray = _blocks(moved, np.zeros(last))
    around += stray
    hop, widest = _hop(center, way), np.max(around)
    # lengths include the relative motion of the segments: it reduces how much of a chord is left on the way
    ways = _ways(half)
    near_by = np.empty(len(around), np.int64)
    count = 0
    j0 = 0
    for block in range(len(around)):
        nears = _blocks_near(
            x0, block, center, way, hop, around, widest, ways, least, separation, near, near_by
        )  # fmt: skip
        if nears == 0:
            continue
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
                    found = _noted(found, count, i, j)
                    count += 1
                    j += 1
    return found, count


@kernel
def clear_way(x0: Any, x1: Any, u: Any, diameter: float, separation: float, found: Any) -> Any:
    """Return (found, share): how far, 0 to 1, nodes may go straight from x0 to x1 before strands pass through strands.

    The limit is where a pair of segments comes nearer than the smaller of `_TOO_NEAR` diameters and 0.8 times its
    distance at x0. `u`, `separation`, `found`: see `near_pairs`.
    """
    found, count = meeting_pairs(x0, x1, u, _TOO_NEAR * diameter, separation, found)
    return found, 0.0 if count < 0 else clear_way_of(x0, x1, diameter, found, count)


@leaf
def clear_way_of(x0: Any, x1: Any, diameter: float, pairs: Any, count: int) -> float:
    """Return the share of `clear_way` if only these pairs of segments can meet.

    Distances change at most as fast as the nodes move against each other, which limits how far ahead to evaluate next.
    """
    share = 1.0
    near = _TOO_NEAR * diameter
    for c in range(count):
        i, j = pairs[c, 0], pairs[c, 1]
        r0, a0, b0 = between_nodes(x0, i, j), between_nodes(x0, i + 1, i), between_nodes(x0, j + 1, j)
        r1, a1, b1 = between_nodes(x1, i, j), between_nodes(x1, i + 1, i), between_nodes(x1, j + 1, j)
        fastest = 0.0
        for k in range(4):
            s, t = k // 2, k % 2
            y0, y1 = between(r0, a0, b0, s, t), between(r1, a1, b1, s, t)
            move = (y1[0] - y0[0], y1[1] - y0[1], y1[2] - y0[2])
            fastest = max(fastest, np.sqrt(dot(move, move)))
        if fastest == 0.0:
            continue
        if not fastest < np.inf:
            return 0.0
        least = near
        z = 0.0
        while z < share:
            r = (r0[0] + z * (r1[0] - r0[0]), r0[1] + z * (r1[1] - r0[1]), r0[2] + z * (r1[2] - r0[2]))
            a = (a0[0] + z * (a1[0] - a0[0]), a0[1] + z * (a1[1] - a0[1]), a0[2] + z * (a1[2] - a0[2]))
            b = (b0[0] + z * (b1[0] - b0[0]), b0[1] + z * (b1[1] - b0[1]), b0[2] + z * (b1[2] - b0[2]))
            tiny = 1e-12 * diameter * diameter
            s, t = closest(r, a, b, tiny, tiny)
            y = between(r, a, b, s, t)
            gap = np.sqrt(dot(y, y))
            if z == 0.0:
                least = min(near, 0.8 * gap)
            elif gap <= least:
                share = z
                break
            # go at least so far ahead that the gap changes by a tenth of its limit
            z += max(gap - least, 0.1 * least, _LOOK * diameter) / fastest
    return share


@kernel
def nearest(x: Any, u: Any, separation: float, cap: float) -> float:
    """Return the smallest distance between segments of the nodes x (k, 2 or 3), at most `cap` [m].

    Args:
        u: material coordinates of the nodes (k,) [m].
        separation: segments closer than this along the cable are left out [m].
        cap: returned where all are farther apart.
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
            first, second, apart = between_nodes(x, i + 1, i), between_nodes(x, j + 1, j), between_nodes(x, i, j)
            s, t = closest(apart, first, second, tiny, tiny)
            y = between(apart, first, second, s, t)
            best = min(best, np.sqrt(dot(y, y)))
            j += 1
    return best


@kernel
def lengths_apart(states: Any, knots: Any, nd: int, angle: float) -> Any:
    """Return for each of the states the length [m] up to which no part of a cable turns by more than `angle` [rad].

    A part turns by no more than the control polygon of its spans. The length is infinite where the whole cable turns by
    less.

    Args:
        states: control points (k, n, nc) [m].
        knots: (n + 4,) [m].
        nd: dimensions of the centreline.
    """
    n = states.shape[1]
    out = np.full(len(states), np.inf)
    turned = np.zeros(n)  # by the polygon, up to a control point
    for k in range(len(states)):
        for i in range(1, n - 1):
            product, before, after = 0.0, 0.0, 0.0
            for d in range(nd):
                a, b = states[k, i, d] - states[k, i - 1, d], states[k, i + 1, d] - states[k, i, d]
                product += a * b
                before += a * a
                after += b * b
            turned[i] = turned[i - 1]
            if before > 0.0 and after > 0.0:
                turned[i] += np.arccos(min(max(product / np.sqrt(before * after), -1.0), 1.0))
        last = 0  # span up to which the cable turns by less than `angle`, from `first` on
        for first in range(n - 3):
            last = max(last, first)
            while last < n - 3 and turned[last + 2] - turned[first] <= angle:
                last += 1
            if last == n - 3:
                break
            out[k] = min(out[k], max(0.0, knots[last + 3] - knots[first + 4]))
    return out


@kernel
def nearest_of(
    states: Any, which: Any, apart: Any, first: Any, b: Any, u: Any, nd: int, separation: float, cap: float
) -> float:
    """Return the smallest `nearest` of the states `which` of (k, n, nc), at nodes with rows `first` (m,), b (m, 4).

    No point moves farther than the control point that moves most. A state is skipped if it is so close to one with a
    large distance between strands that its strands can't be nearer than the smallest distance found.

    Args:
        apart: (k,) [m] for each of all states: nodes nearer than this along the cable are left out.
    """
    best = cap
    x = np.empty((len(u), nd))
    # the last evaluated state, and the least distance of its strands, along the cable and in space
    seen, along, gap = -1, 0.0, 0.0
    for k in which:
        if seen >= 0 and along <= max(separation, apart[k]):
            moved = 0.0
            for n in range(states.shape[1]):
                square = 0.0
                for d in range(nd):
                    square += (states[k, n, d] - states[seen, n, d]) ** 2
                moved = max(moved, square)
            if gap - 2.0 * np.sqrt(moved) >= best:
                continue
        for n in range(len(u)):
            for d in range(nd):
                value = 0.0
                for i in range(4):
                    value += b[n, i] * states[k, first[n] + i, d]
                x[n, d] = value
        along = max(separation, _KEPT * apart[k])
        seen, gap = k, nearest(x, u, along, max(_WIDE * cap, _WIDER * along))
        best = min(best, gap)
    return best
