"""Knots, cubic B-spline basis tables and Gauss points; compiled, because they are rebuilt for every scene."""

from typing import Any, NamedTuple

import numpy as np

from dlocore.compiling.kernel import brief, kernel, law, leaf
from dlocore.kernels.lanes import side_by_side
from dlocore.kernels.pairs import pair_products

GAUSS_2 = np.polynomial.legendre.leggauss(2)
GAUSS_3 = np.polynomial.legendre.leggauss(3)
GAUSS_4 = np.polynomial.legendre.leggauss(4)
_ITERATIONS = 60  # at most, for the position of a knot
_ROUNDING = 1e-15  # relative to the length


@leaf
def basis(knots: Any, span: int, x: float, order: int, out: Any) -> None:
    """Write the four cubic basis functions of `span` at `x`, with derivatives up to `order`, to out (order + 1, 4).

    `span` is the index k with knots[k] <= x <= knots[k+1] (Cox-de Boor; Piegl and Tiller, The NURBS Book, A2.3).
    """
    h1, h2, h3 = x - knots[span], x - knots[span - 1], x - knots[span - 2]
    g1, g2, g3 = knots[span + 1] - x, knots[span + 2] - x, knots[span + 3] - x
    # functions of degree 0, 1 and 2, divided by the length of their support
    w = 1.0 / (g1 + h1)
    w0, w1 = g1 * w / (g1 + h2), h1 * w / (g2 + h1)
    b0, b1, b2 = g1 * w0 / (g1 + h3), (h2 * w0 + g2 * w1) / (g2 + h2), h1 * w1 / (g3 + h1)
    out[0, 0], out[0, 1], out[0, 2], out[0, 3] = g1 * b0, h3 * b0 + g2 * b1, h2 * b1 + g3 * b2, h1 * b2
    if order > 0:
        _write_differences(b0, b1, b2, out[1])
    if order > 1:
        c0, c1, c2 = -2.0 * w0 / (g1 + h3), 2.0 * (w0 - w1) / (g2 + h2), 2.0 * w1 / (g3 + h1)
        _write_differences(c0, c1, c2, out[2])
    if order > 2:
        v0, v1 = -w / (g1 + h2), w / (g2 + h1)
        c0, c1, c2 = -2.0 * v0 / (g1 + h3), 2.0 * (v0 - v1) / (g2 + h2), 2.0 * v1 / (g3 + h1)
        _write_differences(c0, c1, c2, out[3])


@law
def _write_differences(a: float, b: float, c: float, out: Any) -> None:
    """Write the derivatives of the cubic functions, from the quadratic ones divided by the length of their support."""
    out[0], out[1], out[2], out[3] = -3.0 * a, 3.0 * (a - b), 3.0 * (b - c), 3.0 * c


@leaf
def find_span(knots: Any, x: float) -> int:
    """Return k with knots[k] <= x < knots[k+1], or the last non-empty span at the end."""
    k = len(knots) - 5
    while k > 3 and (x < knots[k] or knots[k] == knots[k + 1]):
        k -= 1
    return k


@brief
def basis_rows(knots: Any, x: Any, order: int) -> Any:
    """Return first control points (len(x),) and basis tables (len(x), order + 1, 4) at the points `x`."""
    first = np.empty(len(x), np.int64)
    table = np.empty((len(x), order + 1, 4))
    for p in range(len(x)):
        span = find_span(knots, x[p])
        first[p] = span - 3
        basis(knots, span, x[p], order, table[p])
    return first, table


@brief
def spline_values(knots: Any, control: Any, u: Any, derivative: int) -> Any:
    """Return values (len(u), m), or a derivative, of the spline with control points (n, m) at the points `u`."""
    first, table = basis_rows(knots, u, derivative)
    out = np.zeros((len(u), control.shape[1]))
    for p in range(len(u)):
        for i in range(4):
            for d in range(control.shape[1]):
                out[p, d] += table[p, derivative, i] * control[first[p] + i, d]
    return out


@leaf
def _integrated(u: float, length: float, features: Any, power: Any, width: Any) -> tuple[float, float]:
    """Return the integral of the knot density up to u [m], apart from a constant, and the density there."""
    total, density = u, 1.0
    for f in range(len(features)):
        x = (u - features[f]) / length
        y, p = width[f] + abs(x), power[f]
        here = ((width[f] + 1.0) / y) ** p
        if p == 1.0:
            part = (width[f] + 1.0) * np.log(y / width[f])
        else:
            part = (here * y - ((width[f] + 1.0) / width[f]) ** p * width[f]) / (1.0 - p)
        total += length * (part if x > 0.0 else -part)
        density += here
    return total, density


@brief
def graded_knots(n: int, length: float, features: Any, multiplicity: Any, power: Any, width: Any) -> Any:
    """Return clamped knots for `n` control points on [0, length], with knots at the features and denser towards them.

    Features are grasps and loads. The knot density is 1 + sum_f ((w_f + 1) / (w_f + |u - u_f| / L))^p_f. A feature
    inside the cable becomes a knot of its multiplicity. Spans are divided among the segments between features in
    proportion to the integral of the density, at least one each, and are spread by the density within each segment.

    Args:
        n: number of control points, at least 4 + the multiplicities inside.
        length: L [m].
        features: sorted material coordinates (m,) [m].
        multiplicity: of the knot at each feature (m,), 1 to 3; ignored at the ends of the cable.
        power: grading exponent p_f (m,).
        width: grading width w_f (m,), fraction of L.

    Returns:
        knots (n + 4,) [m]; empty where n is too small.
    """
    cuts = np.empty(len(features) + 2)
    repeat = np.ones(len(features) + 2, np.int64)
    cuts[0] = 0.0
    m = 1
    extra = 0
    for f in range(len(features)):
        if features[f] > 1e-9 * length and features[f] < (1.0 - 1e-9) * length:
            cuts[m] = features[f]
            repeat[m] = multiplicity[f]
            extra += multiplicity[f] - 1
            m += 1
    cuts[m] = length
    spans = n - 3 - extra
    if spans < m:
        return np.empty(0)
    total = np.empty(m)
    for s in range(m):
        before, _ = _integrated(cuts[s], length, features, power, width)
        after, _ = _integrated(cuts[s + 1], length, features, power, width)
        total[s] = after - before
    share = np.ones(m, np.int64)
    for _ in range(spans - m):
        worst = 0
        for s in range(1, m):
            if total[s] / share[s] > total[worst] / share[worst]:
                worst = s
        share[worst] += 1
    knots = np.empty(n + 4)
    knots[:4] = 0.0
    k = 4
    for s in range(m):
        b, low = cuts[s + 1], cuts[s]
        before, _ = _integrated(low, length, features, power, width)
        for j in range(1, share[s]):
            target, high = before + total[s] * j / share[s], b
            u = low + (b - low) / (share[s] - j + 1)
            for _ in range(_ITERATIONS):  # Newton's method, safeguarded by bisection
                value, density = _integrated(u, length, features, power, width)
                if value < target:
                    low = u
                else:
                    high = u
                new = u - (value - target) / density
                if not low <= new <= high:
                    new = 0.5 * (low + high)
                moved, u = abs(new - u), new
                if moved <= _ROUNDING * length:
                    break
            knots[k] = low = u
            k += 1
        if s < m - 1:
            for _ in range(repeat[s + 1]):
                knots[k] = b
                k += 1
    knots[k:] = length
    return knots


@law
def row_of(table: Any, i: int) -> tuple[float, float, float, float]:
    """Return row i of a table (points, 4) as scalars."""
    return table[i, 0], table[i, 1], table[i, 2], table[i, 3]


class AxialPoints(NamedTuple):
    """Quadrature points of stretch: one a span, and two in an end span whose end direction is free.

    This is selective reduced integration, see docs/model.md.

    Attributes:
        u: (p,) [m].
        first: (p,) index of the first of the four control points at each.
        b1: (p, 4) first derivatives of their basis functions [1/m].
        w: (p,) weights [m].
        share: (p,) strain at each point of a uniformly strained cable, relative to that strain, see `shares`.
    """

    u: Any
    first: Any
    b1: Any
    w: Any
    share: Any


class CurvaturePoints(NamedTuple):
    """Quadrature points of bending, twist and body forces on the cable: three a span.

    Attributes:
        u: (p,) [m].
        first: (p,) index of the first of the four control points at each.
        b0, b1, b2: (p, 4) values [-] and first and second derivatives [1/m, 1/m^2] of their basis functions.
        w: (p,) weights [m].
        pairs: see `pairs.py`.
        lanes: see `lanes.py`.
    """

    u: Any
    first: Any
    b0: Any
    b1: Any
    b2: Any
    w: Any
    pairs: Any
    lanes: Any


class ContactNodes(NamedTuple):
    """Nodes of contact: the ends of equal parts of every span, once for the table and once for obstacles.

    Without contact there are none.

    Attributes:
        u: (p,) [m].
        first: (p,) index of the first of the four control points at each.
        b0: (p, 4) values of their basis functions.
        w: (p,) weights [m].
        table_nodes: number of nodes for the table, which come first; the others are for the obstacles.
        cell: number of obstacle nodes that one node can stand for where edges are far.
    """

    u: Any
    first: Any
    b0: Any
    w: Any
    table_nodes: Any
    cell: Any


class StrandNodes(NamedTuple):
    """Ends of the segments for contact of the cable with itself, equally long on every grid; none without that contact.

    Attributes:
        u: (p,) [m].
        first: (p,) index of the first of the four control points at each.
        b0: (p, 4) values of their basis functions.
    """

    u: Any
    first: Any
    b0: Any


class LyingPoints(NamedTuple):
    """Points where friction acts on a cable that lies on the table: those of bending, and its point masses.

    Attributes:
        first: (p,) index of the first of the four control points at each.
        b0: (p, 4) values of their basis functions.
        w: (p,) weights [m]; for a point mass, the length of cable of the same mass.
    """

    first: Any
    b0: Any
    w: Any


class Tables(NamedTuple):
    """Basis functions of a set of knots at all points that kernels use; each kernel takes the ones it needs.

    A point mass m at u counts as m/mu of the cable's length in one place (docs/model.md eq. 9a).

    Attributes:
        axial, curvature, lying: quadrature points.
        contact, strands: nodes.
        unit: (n, 4) integrals of b_i b_{i+d} du [m], for linear drag.
        inertia: (n, 4) the same plus (m/mu) b_i b_{i+d} of each point mass [m]: the mass matrix divided by mu.
        span: (n,) integrals of b_i du [m].
        weight: (n,) the same plus (m/mu) b_i of each point mass [m].
    """

    axial: AxialPoints
    curvature: CurvaturePoints
    lying: LyingPoints
    contact: ContactNodes
    strands: StrandNodes
    unit: Any
    inertia: Any
    span: Any
    weight: Any


@kernel
def gauss_points(knots: Any, rule: Any, weights: Any) -> Any:
    """Return the points u (k,) [m] of a Gauss rule on [-1, 1] in each knot span, and their weights (k,) [m]."""
    spans = 0
    for k in range(3, len(knots) - 4):
        spans += knots[k + 1] > knots[k]
    g = len(rule)
    u = np.empty(spans * g)
    w = np.empty(spans * g)
    p = 0
    for k in range(3, len(knots) - 4):
        half = 0.5 * (knots[k + 1] - knots[k])
        if half > 0.0:
            for i in range(g):
                u[p] = knots[k] + half * (1.0 + rule[i])
                w[p] = half * weights[i]
                p += 1
    return u, w


@kernel
def _axial_points(knots: Any, free_start: bool, free_end: bool, rule: Any, weights: Any) -> Any:
    """Return quadrature points u (k,) [m] of stretch and their weights, as many as the control points have strains.

    There is one point a span, two in an end span whose direction is free, and one at a double knot, which takes a sixth
    of the length of each adjacent span. Fewer points leave a mode without energy, in which the cable folds; more lock
    its bending.
    """
    last = len(knots) - 4
    spans = 0
    doubles = 0
    for k in range(3, last):
        spans += knots[k + 1] > knots[k]
        doubles += k > 3 and knots[k + 1] == knots[k]
    u = np.empty(spans + doubles + 2)
    w = np.empty(spans + doubles + 2)
    p = 0
    s = 0
    knot = 0  # place of the double knot at the beginning of the span
    for k in range(3, last):
        half = 0.5 * (knots[k + 1] - knots[k])
        if half > 0.0:
            s += 1
            begins = s > 1 and knots[k - 1] == knots[k]
            ends = s < spans and knots[k + 1] == knots[k + 2]
            given = half / 3.0
            kept = 1.0 - (begins + ends) / 6.0
            if begins:
                w[knot] += given
            if (s == 1 and free_start) or (s == spans and free_end):
                for i in range(2):
                    u[p] = knots[k] + half * (1.0 + rule[i])
                    w[p] = kept * half * weights[i]
                    p += 1
            else:
                u[p] = knots[k] + half
                w[p] = kept * 2.0 * half
                p += 1
            if ends:
                knot = p
                u[p] = knots[k + 1]
                w[p] = given
                p += 1
    return u[:p], w[:p]


@brief
def shares(knots: Any, first: Any, b1: Any, w: Any, free_start: bool, free_end: bool) -> Any:
    """Return the magnitude of the strain (p,) at the axial points of a cable whose tension calls for the strain one.

    It is |r| where sum_p w_p r_p phi_j(u_p) = int phi_j du for the quadratic basis functions phi_j, of which the b_i'
    are combinations (docs/model.md, selective reduced integration). Left out are the first function where the direction
    of the start is held, and the last where that of the end is held: the grasp carries the difference. The two
    functions that end and begin at a triple knot are held together and count as their sum. Splines at increasing points
    are totally positive, so elimination needs no pivoting.
    """
    count = len(w)
    begin, end = 0 if free_start else 1, len(knots) - 5 if free_end else len(knots) - 6
    row = np.empty(len(knots) - 5, np.int64)  # of each function; -1 for none
    r = np.zeros(count)
    rows = 0
    for j in range(len(row)):
        row[j] = -1
        if begin <= j < end:
            joins = j > begin and knots[3] < knots[j + 1] and knots[j + 1] == knots[j + 3]
            rows += 0 if joins else 1
            row[j] = rows - 1
            r[rows - 1] += (knots[j + 4] - knots[j + 1]) / 3.0
    A = np.zeros((count, 5))  # two diagonals on either side
    for p in range(count):
        phi = 0.0
        for i in range(3):
            phi -= b1[p, i]
            j = first[p] + i
            if row[j] >= 0:
                A[row[j], 2 + p - row[j]] += w[p] * phi * (knots[j + 4] - knots[j + 1]) / 3.0
    for k in range(count):
        for i in range(k + 1, min(k + 3, count)):
            factor = A[i, 2 + k - i] / A[k, 2]
            r[i] -= factor * r[k]
            for p in range(k, min(k + 3, count)):
                A[i, 2 + p - i] -= factor * A[k, 2 + p - k]
    for k in range(count - 1, -1, -1):
        for p in range(k + 1, min(k + 3, count)):
            r[k] -= A[k, 2 + p - k] * r[p]
        r[k] /= A[k, 2]
    return np.abs(r)


@kernel
def _nodes(knots: Any, spacing: float) -> Any:
    """Return nodes u (k,) [m] at most `spacing` apart, which include the knots, and their trapezoidal weights [m]."""
    if not np.isfinite(spacing):
        return np.empty(0), np.empty(0)
    last = len(knots) - 4
    count = 1
    for k in range(3, last):
        count += int(np.ceil((knots[k + 1] - knots[k]) / spacing - 1e-9))
    u = np.empty(count)
    w = np.zeros(count)
    u[0] = knots[0]
    n = 0
    for k in range(3, last):
        parts = int(np.ceil((knots[k + 1] - knots[k]) / spacing - 1e-9))
        for i in range(parts):
            width = (knots[k + 1] - knots[k]) / parts
            w[n] += 0.5 * width
            n += 1
            u[n] = knots[k] + (i + 1) * width
            w[n] += 0.5 * width
    return u, w


@brief
def build_tables(
    knots: Any,
    free_start: bool,
    free_end: bool,
    rule2: Any,
    w2: Any,
    rule3: Any,
    w3: Any,
    rule4: Any,
    w4: Any,
    above: float,
    spacing: float,
    cell: int,
    segment: float,
    masses: Any,
) -> Any:
    """Return `Tables` of the clamped cubic `knots`.

    Args:
        free_start, free_end: the direction at that end of the cable is free.
        rule2, w2, rule3, w3, rule4, w4: Gauss rules on [-1, 1] and their weights.
        above, spacing: largest distance of contact nodes for the table and for obstacles [m]; infinite for no nodes.
        cell: see `ContactNodes`.
        segment: largest distance of strand nodes [m]; infinite for no nodes.
        masses: (k, 2) position of each point mass [m], and the length of cable of the same mass [m]. Contact presses it
            with the stiffness of that length, so that it sinks in no deeper than the cable.
    """
    u, axial_w = _axial_points(knots, free_start, free_end, rule2, w2)
    axial_first, table = basis_rows(knots, u, 1)
    axial_b1 = np.ascontiguousarray(table[:, 1])
    curvature_u, curvature_w = gauss_points(knots, rule3, w3)
    curvature_first, table = basis_rows(knots, curvature_u, 2)
    b0 = np.ascontiguousarray(table[:, 0])
    b1 = np.ascontiguousarray(table[:, 1])
    b2 = np.ascontiguousarray(table[:, 2])
    u_above, w_above = _nodes(knots, above)
    u_beside, w_beside = _nodes(knots, spacing)
    for k in range(len(masses)):
        for places, weights in ((u_above, w_above), (u_beside, w_beside)):
            if len(places) > 0:
                weights[np.argmin(np.abs(places - masses[k, 0]))] += masses[k, 1]
    contact_u, contact_w = np.append(u_above, u_beside), np.append(w_above, w_beside)
    contact_first, table = basis_rows(knots, contact_u, 0)
    contact_b0 = np.ascontiguousarray(table[:, 0])
    strand_u = np.linspace(0.0, knots[-1], 1 + int(np.ceil(knots[-1] / segment - 1e-9)) if segment < np.inf else 0)
    strand_first, table = basis_rows(knots, strand_u, 0)
    strand_b0 = np.ascontiguousarray(table[:, 0])
    n = len(knots) - 4
    unit = np.zeros((n, 4))
    span = np.zeros(n)
    u4, weights4 = gauss_points(knots, rule4, w4)
    first4, table4 = basis_rows(knots, u4, 0)
    for p in range(len(u4)):
        f = first4[p]
        for i in range(4):
            span[f + i] += weights4[p] * table4[p, 0, i]
            for j in range(i, 4):
                unit[f + i, j - i] += weights4[p] * table4[p, 0, i] * table4[p, 0, j]
    inertia, weight = unit.copy(), span.copy()
    first_mass, table_mass = basis_rows(knots, np.ascontiguousarray(masses[:, 0]), 0)
    mass_b0, mass_w = np.ascontiguousarray(table_mass[:, 0]), np.ascontiguousarray(masses[:, 1])
    for p in range(len(mass_w)):
        f = first_mass[p]
        for i in range(4):
            weight[f + i] += mass_w[p] * mass_b0[p, i]
            for j in range(i, 4):
                inertia[f + i, j - i] += mass_w[p] * mass_b0[p, i] * mass_b0[p, j]
    lying = LyingPoints(
        np.append(curvature_first, first_mass), np.concatenate((b0, mass_b0)), np.append(curvature_w, mass_w)
    )
    axial_share = shares(knots, axial_first, axial_b1, axial_w, free_start, free_end)
    axial = AxialPoints(u, axial_first, axial_b1, axial_w, axial_share)
    lanes = side_by_side(curvature_first, curvature_u, curvature_w, b0, b1, b2)
    curvature = CurvaturePoints(curvature_u, curvature_first, b0, b1, b2, curvature_w, pair_products(b1, b2), lanes)
    contact = ContactNodes(contact_u, contact_first, contact_b0, contact_w, len(u_above), cell)
    strands = StrandNodes(strand_u, strand_first, strand_b0)
    return Tables(axial, curvature, lying, contact, strands, unit, inertia, span, weight)
