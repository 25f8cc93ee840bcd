"""Assembly of contact and friction, in the plane and in space.

Contact acts at nodes: the first `table_nodes` of them are for the table, the others for obstacles. Nodes for obstacles
lie closer together, as an obstacle may be thin or have edges. Away from edges that is not needed, and one node stands
for a whole `cell` of nodes. `pressing` holds the weights [m] of the nodes until the next step.

The distance to an obstacle grows at most as fast as the length along the cable, so after a node that is far away the
next ones are skipped. `stick` (nodes, 3) holds the anchors of friction, `slide` (lying points, 2) those of a cable that
lies on the table.
"""

from typing import Any

import numpy as np

from dlocore.compiling.kernel import kernel, law, leaf, part
from dlocore.effects.base import Symmetric, Vector
from dlocore.effects.contact import normal_force
from dlocore.effects.distance import signed_distance, to_edge
from dlocore.effects.friction import friction
from dlocore.effects.kinds import BOX, CYLINDER
from dlocore.effects.laws import CONTACT, COUNT, FRICTION, TABLE
from dlocore.kernels.basis import row_of
from dlocore.kernels.strands import dot

_UP = (0.0, 0.0, 1.0)
_ANY = (0.0, 0.0, 0.0)
_FLAT = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
_SLACK = 0.9  # of the length that is skipped: a strained cable is longer
_THROUGH = 0.5  # of the way to the middle of an obstacle: a node that was deeper on its way went through
_LEAVES = 0.05  # of that depth: by at least this much the node must have come out again
_INSIDE = 2.0  # lengths of a cell: least distance from an edge at which one node stands for a cell
_TILT = 0.04  # of the radius: how much deeper than its middle the ends of a cell may be
_PASSED = 2.0  # times the sliding distance: how far from a node others are searched that were at its new place
_SEARCH = 24  # rounds of the search for the deepest place of a path; each leaves two thirds of the interval


@law
def _point(nc: int, q: Any, k: int, b: tuple[float, float, float, float]) -> Vector:
    x = b[0] * q[k, 0] + b[1] * q[k + 1, 0] + b[2] * q[k + 2, 0] + b[3] * q[k + 3, 0]
    y = b[0] * q[k, 1] + b[1] * q[k + 1, 1] + b[2] * q[k + 2, 1] + b[3] * q[k + 3, 1]
    z = 0.0
    if nc > 2:
        z = b[0] * q[k, 2] + b[1] * q[k + 1, 2] + b[2] * q[k + 2, 2] + b[3] * q[k + 3, 2]
    return x, y, z


@law
def _met_at(nodes: Any, p: Any, n: int) -> tuple[int, int]:
    """Return the range of contacts that node n may touch, first and last + 1: the table, or the obstacles."""
    return (COUNT - 1, COUNT) if n < nodes.table_nodes else (COUNT, len(p))


@law
def _gap(p: Any, i: int, x: Vector) -> tuple[float, Vector, Symmetric, float]:
    """Return the gap of contact i at x, its gradient, Hessian and coefficient of friction; below COUNT is the table."""
    if i < COUNT:
        return x[2] - p[TABLE, 0], _UP, _FLAT, p[TABLE, 1]
    d, n, H = signed_distance(p, i, x)
    return d - p[CONTACT, 0], n, H, p[i, 16]


@law
def _add(nc: int, K: Any, k: int, b: Any, w: float, H: Symmetric) -> None:
    """Add w b_i b_j H to the blocks of control points k to k + 3."""
    for j in range(4):
        for i in range(j, 4):
            s = w * b[i] * b[j]
            column, offset = nc * (k + j), nc * (i - j)
            K[column, offset] += s * H[0]
            K[column, offset + 1] += s * H[3]
            K[column + 1, offset] += s * H[1]
            if i > j:
                K[column + 1, offset - 1] += s * H[3]
            if nc > 2:
                K[column, offset + 2] += s * H[4]
                K[column + 1, offset + 1] += s * H[5]
                K[column + 2, offset] += s * H[2]
                if i > j:
                    K[column + 2, offset - 2] += s * H[4]
                    K[column + 2, offset - 1] += s * H[5]


@law
def _spread(nc: int, f: Any, k: int, b: Any, w: float, force: Vector) -> None:
    for i in range(4):
        f[k + i, 0] -= w * b[i] * force[0]
        f[k + i, 1] -= w * b[i] * force[1]
        if nc > 2:
            f[k + i, 2] -= w * b[i] * force[2]


@law
def _mixed(a: float, A: Symmetric, b: float, B: Symmetric) -> Symmetric:
    return (
        a * A[0] + b * B[0], a * A[1] + b * B[1], a * A[2] + b * B[2],
        a * A[3] + b * B[3], a * A[4] + b * B[4], a * A[5] + b * B[5],
    )  # fmt: skip


@part
def contact(
    nc: int, q: Any, v: Any, nodes: Any, active: Any, p: Any, stick: Any, weights: Any, h: float, scales: Any,
    tangent: bool, f: Any, K: Any,
) -> None:  # fmt: skip
    """Subtract the forces and add the tangents of contact with table and obstacles, and of friction on them.

    `weights` (nodes,) are those of the nodes [m], zero where another node stands for this one.
    """
    elastic, viscous, geometric = scales
    firsts, b0, places = nodes.first, nodes.b0, nodes.u
    k_n, width, damping = p[CONTACT, 1], p[CONTACT, 2], p[CONTACT, 3]
    reach = 0.0  # material coordinate up to which nothing can touch
    for n in range(len(weights)):
        if n == nodes.table_nodes:
            reach = 0.0
        if places[n] < reach or weights[n] == 0.0:
            continue
        begin, end = _met_at(nodes, p, n)
        k, w = firsts[n], weights[n]
        b = row_of(b0, n)
        x = _point(nc, q, k, b)
        nearest = np.inf
        for i in range(begin, end):
            gap, normal, bend, mu = _gap(p, i, x)
            nearest = min(nearest, gap)
            if gap >= 0.0:
                continue
            u = _point(nc, v, k, b)
            N, stiffness, viscosity = normal_force(k_n, width, damping, -gap, dot(u, normal))
            if N <= 0.0:
                continue
            _spread(nc, f, k, b, w, (N * normal[0], N * normal[1], N * normal[2]))
            if tangent:
                s = elastic * stiffness + viscous * viscosity
                nn = (
                    normal[0] * normal[0], normal[1] * normal[1], normal[2] * normal[2],
                    normal[0] * normal[1], normal[0] * normal[2], normal[1] * normal[2],
                )  # fmt: skip
                _add(nc, K, k, b, w, _mixed(s, nn, -geometric * N, bend))
            if active[FRICTION] and mu > 0.0:
                slip = (x[0] - stick[n, 0], x[1] - stick[n, 1], x[2] - stick[n, 2])
                force, S, V = friction(mu * N, normal, slip, u, p[FRICTION, 0], p[FRICTION, 1], h != 0.0)
                _spread(nc, f, k, b, w, force)
                if tangent:
                    _add(nc, K, k, b, w, _mixed(elastic, S, viscous, V))
        reach = places[n] + _SLACK * nearest


@leaf
def energy(nc: int, q: Any, nodes: Any, active: Any, p: Any) -> float:
    """Return the potential of contact [J]."""
    total = 0.0
    k, w = p[CONTACT, 1], p[CONTACT, 2]
    for n in range(len(nodes.w)):
        x = _point(nc, q, nodes.first[n], row_of(nodes.b0, n))
        begin, end = _met_at(nodes, p, n)
        for i in range(begin, end):
            d = -_gap(p, i, x)[0]
            if d > w:
                total += nodes.w[n] * k * (0.5 * d * (d - w) + w * w / 6.0)
            elif d > 0.0:
                total += nodes.w[n] * k * d * d * d / (6.0 * w)
    return total


@law
def _nearest_within(nc: int, q: Any, nodes: Any, p: Any, i: int, n: int, way: float) -> float:
    """Return the smallest gap [m] to contact i of its nodes within `way` [m] of node n, or the first below 0."""
    first, last = (0, nodes.table_nodes) if i < COUNT else (nodes.table_nodes, len(nodes.u))
    nearest = np.inf
    for side in (-1, 1):
        m = n if side < 0 else n + 1
        while first <= m < last and abs(nodes.u[m] - nodes.u[n]) <= way and nearest > 0.0:
            x = _point(nc, q, nodes.first[m], row_of(nodes.b0, m))
            nearest = min(nearest, _gap(p, i, x)[0])
            m += side
    return nearest


@leaf
def strikes(nc: int, q0: Any, q1: Any, nodes: Any, p: Any, weights: Any, least: float) -> bool:
    """Tell whether a node, from q0 to q1 (n, nc), approaches something that it newly touches by more than `least` [m].

    Sliding to a place where other nodes already were, as around an edge, is no approach.
    """
    reach = 0.0
    for n in range(len(weights)):
        if n == nodes.table_nodes:
            reach = 0.0
        if nodes.u[n] < reach or weights[n] == 0.0:
            continue
        begin, end = _met_at(nodes, p, n)
        k, b = nodes.first[n], row_of(nodes.b0, n)
        x = _point(nc, q1, k, b)
        nearest = np.inf
        for i in range(begin, end):
            gap, normal = _gap(p, i, x)[:2]
            nearest = min(nearest, gap)
            if gap < 0.0:
                y = _point(nc, q0, k, b)
                before = _gap(p, i, y)[0]
                if before > 0.0 and before - gap > least:
                    move = (x[0] - y[0], x[1] - y[1], x[2] - y[2])
                    way = _PASSED * np.sqrt(max(0.0, dot(move, move) - dot(move, normal) ** 2))
                    before = _nearest_within(nc, q0, nodes, p, i, n, way)
                    if before > 0.0 and before - gap > least:
                        return True
        reach = nodes.u[n] + _SLACK * nearest
    return False


@law
def _thickness(p: Any, i: int) -> float:
    """Return the depth [m] of the middle of obstacle i, seen by the axis of the cable."""
    if p[i, 0] == CYLINDER:
        return min(p[i, 13], p[i, 15]) + p[CONTACT, 0]
    if p[i, 0] == BOX:
        return min(p[i, 13], p[i, 14], p[i, 15]) + p[CONTACT, 0]
    return p[i, 13] + p[CONTACT, 0]


@law
def _between(x: Vector, y: Vector, s: float) -> Vector:
    return x[0] + s * (y[0] - x[0]), x[1] + s * (y[1] - x[1]), x[2] + s * (y[2] - x[2])


@leaf
def passes(nc: int, q0: Any, q1: Any, nodes: Any, p: Any, weights: Any) -> bool:
    """Tell whether a node goes through an obstacle on the straight path from q0 to q1 (n, nc), as in too long a step.

    The distance from a convex body is convex along a straight path, so ternary search finds its minimum.
    """
    if len(p) == COUNT:
        return False
    longest = 0.0
    for i in range(len(q0)):
        square = 0.0
        for d in range(min(nc, 3)):
            square += (q1[i, d] - q0[i, d]) ** 2
        longest = max(longest, square)
    longest = np.sqrt(longest)
    reach = 0.0  # material coordinate up to which nothing is near enough
    for n in range(nodes.table_nodes, len(weights)):
        if nodes.u[n] < reach or weights[n] == 0.0:
            continue
        k, b = nodes.first[n], row_of(nodes.b0, n)
        x, y = _point(nc, q0, k, b), _point(nc, q1, k, b)
        way = np.sqrt((y[0] - x[0]) ** 2 + (y[1] - x[1]) ** 2 + (y[2] - x[2]) ** 2)
        nearest = np.inf
        for i in range(COUNT, len(p)):
            begin = _gap(p, i, x)[0]
            nearest = min(nearest, begin)
            deep = -_THROUGH * _thickness(p, i)
            if begin - way >= deep:
                continue
            end = _gap(p, i, y)[0]
            low, high, least = 0.0, 1.0, np.inf
            for _ in range(_SEARCH):
                left, right = (2.0 * low + high) / 3.0, (low + 2.0 * high) / 3.0
                one = _gap(p, i, _between(x, y, left))[0]
                other = _gap(p, i, _between(x, y, right))[0]
                least = min(least, one, other)
                if one < other:
                    high = right
                else:
                    low = left
            if least < deep and least < min(begin, end) + _LEAVES * deep:
                return True
        reach = nodes.u[n] + _SLACK * (nearest - longest)
    return False


@law
def _met(nodes: Any, p: Any, n: int, x: Vector, near: float) -> tuple[float, float, Vector, float]:
    """Return what node n at x touches.

    Returns:
        the smallest gap [m]; the depth [m] and the normal of the deepest contact with friction; and the distance from
        an edge of anything nearer than `near` [m].
    """
    nearest, depth, normal, inside = np.inf, 0.0, _ANY, np.inf
    begin, end = _met_at(nodes, p, n)
    for i in range(begin, end):
        gap, gradient, _, mu = _gap(p, i, x)
        nearest = min(nearest, gap)
        if -gap > depth and mu > 0.0:
            depth, normal = -gap, gradient
        if i >= COUNT and gap < near:
            inside = min(inside, to_edge(p, i, x))
    return nearest, depth, normal, inside


@law
def _drag(p: Any, stick: Any, n: int, x: Vector, depth: float, normal: Vector) -> None:
    """Drag the anchor of node n behind its position x; without contact with friction, place it at x."""
    if len(stick) == 0:
        return
    s, kept = _ANY, 0.0
    if depth > 0.0:
        a = (x[0] - stick[n, 0], x[1] - stick[n, 1], x[2] - stick[n, 2])
        along = dot(a, normal)
        s = (a[0] - along * normal[0], a[1] - along * normal[1], a[2] - along * normal[2])
        size = np.sqrt(dot(s, s))
        kept = 1.0 if size <= p[FRICTION, 0] else p[FRICTION, 0] / size
    for d in range(3):
        stick[n, d] = x[d] - kept * s[d]


@law
def _lies_along(nc: int, q: Any, nodes: Any, p: Any, n: int, cell: int, gap: float) -> bool:
    """Tell whether the ends of the cell of nodes from n on come hardly nearer to anything than its middle.

    `gap` [m] is the smallest gap of the middle node. Where the cable stands on a face with its end, or is bent around
    something, the middle does not show what touches.
    """
    least = gap - _TILT * p[CONTACT, 0]
    for m in (n, n + cell - 1):
        x = _point(nc, q, nodes.first[m], row_of(nodes.b0, m))
        begin, end = _met_at(nodes, p, m)
        for i in range(begin, end):
            if _gap(p, i, x)[0] < least:
                return False
    return True


@leaf
def remember(nc: int, q: Any, nodes: Any, p: Any, stick: Any, pressing: Any, loose: bool) -> float:
    """Drag the anchors of friction behind q, note where few nodes suffice, and return the largest depth [m].

    If `loose`, as at the start, the anchors are placed at the cable.
    """
    deepest = 0.0
    reach = 0.0
    first, b0, u, weights = nodes.first, nodes.b0, nodes.u, nodes.w
    n = 0
    while n < len(weights):
        if n == nodes.table_nodes:
            reach = 0.0
        cell = 1 if n < nodes.table_nodes else min(nodes.cell, len(weights) - n)
        few, middle, total, x = False, n + cell // 2, 0.0, _ANY
        if cell > 1 and u[n + cell - 1] >= reach:
            x = _point(nc, q, first[middle], row_of(b0, middle))
            long = u[n + cell - 1] - u[n]
            near = 0.5 * _INSIDE * long
            nearest, depth, normal, inside = _met(nodes, p, middle, x, near)
            few = nearest < near and inside > _INSIDE * long
            few = few and _lies_along(nc, q, nodes, p, n, cell, nearest)
            if few:
                deepest = max(deepest, -nearest)
                _drag(p, stick, middle, x, 0.0 if loose else depth, normal)
        for m in range(n, n + cell):
            total += weights[m]
            pressing[m] = 0.0 if few else weights[m]
            if few and (m == middle or len(stick) == 0):
                continue
            y = _point(nc, q, first[m], row_of(b0, m))
            if few:  # as far behind it as the anchor of the middle node
                for d in range(3):
                    stick[m, d] = y[d] + stick[middle, d] - x[d]
                continue
            nearest, depth, normal = np.inf, 0.0, _ANY
            if u[m] >= reach:
                nearest, depth, normal, _ = _met(nodes, p, m, y, 0.0)
                reach = u[m] + _SLACK * nearest
            deepest = max(deepest, -nearest)
            _drag(p, stick, m, y, 0.0 if loose else depth, normal)
        if few:
            pressing[middle] = total
        n += cell
    return deepest


@part
def lying(
    nc: int, q: Any, v: Any, points: Any, p: Any, slide: Any, h: float, scales: Any, tangent: bool, f: Any, K: Any
) -> None:
    """Subtract the friction, and add its tangents, of a cable that lies on the table and moves in its plane."""
    elastic, viscous, _ = scales
    limit = p[FRICTION, 2]
    for n in range(len(points.w)):
        k, w = points.first[n], points.w[n]
        b = row_of(points.b0, n)
        u = _point(nc, v, k, b)
        slip = _ANY
        if h != 0.0:
            x = _point(nc, q, k, b)
            slip = (x[0] - slide[n, 0], x[1] - slide[n, 1], 0.0)
        force, S, V = friction(limit, _UP, slip, u, p[FRICTION, 0], p[FRICTION, 1], h != 0.0)
        _spread(nc, f, k, b, w, force)
        if tangent:
            _add(nc, K, k, b, w, _mixed(elastic, S, viscous, V))


@leaf
def drag_anchors(nc: int, q: Any, points: Any, p: Any, slide: Any, loose: bool) -> None:
    """Drag the anchors of a lying cable behind q; if `loose`, as at the start, place them at the cable."""
    for n in range(len(slide)):
        x = _point(nc, q, points.first[n], row_of(points.b0, n))
        a, b = x[0] - slide[n, 0], x[1] - slide[n, 1]
        size = np.sqrt(a * a + b * b)
        kept = 0.0 if loose else 1.0 if size <= p[FRICTION, 0] else p[FRICTION, 0] / size
        slide[n, 0] = x[0] - kept * a
        slide[n, 1] = x[1] - kept * b


@kernel
def follow(
    nc: int,
    states: Any,
    until: Any,
    tables: Any,
    active: Any,
    p: Any,
    history: Any,
    pressing: Any,
    stick: Any,
    slide: Any,
) -> None:
    """Drag the anchors of friction in `history` behind the states (m, n, nc) one after the other, as a march does.

    After each of the states with the numbers `until` (k,), in order, the history is written to pressing (k, contact
    nodes), stick (k, contact nodes, 3) and slide (k, lying points, 2), see `History`.
    """
    row = 0
    for m in range(until[-1] + 1):
        if active[CONTACT]:
            remember(nc, states[m], tables.contact, p, history.stick, history.pressing, False)
        if active[FRICTION] and p[FRICTION, 2] > 0.0:
            drag_anchors(nc, states[m], tables.lying, p, history.slide, False)
        while row < len(until) and until[row] == m:
            pressing[row], stick[row], slide[row] = history.pressing, history.stick, history.slide
            row += 1
