"""Assembly in space with twist: the fourth coordinate is theta times the polar radius of gyration of the section.

At every curvature point a frame without spin is kept: `past` (points, 16) holds the tangent t0 of the last step, its
derivative k0 along the cable, a director across it, the twist rate of these frames along the cable, and the strain
(two curvatures in the frame of the sections, twist rate) of the two last steps. A state is measured against the frame
that the smallest rotation carries from t0 to its tangent: nothing is singular where the cable is straight, and theta
counts turns without end (docs/model.md eq. 19).

The twist rate of a point is the mean over its knot span, and in the two end spans and beside a triple knot the straight
line through those of the span: as many conditions as theta has freedoms. Where the curvature jumps, the twist rate of
the carried frames jumps too as the cable swings about its own tangent. Theta can follow at a triple knot, where it may
have a kink, but at no other: point by point the cable would be held back from swinging (membrane locking, of twist).
"""

from typing import Any

import numpy as np

from dlocore.effects.base import Vector
from dlocore.effects.laws import (
    DAMPING,
    TWIST,
    TWIST_DAMPING,
    curvature_energy,
    curvature_memory,
    curvature_stress,
    twist_energy,
    twist_memory,
    twist_stress,
)
from dlocore.kernels.basis import basis, find_span, row_of
from dlocore.kernels.compile import kernel, law, part
from dlocore.kernels.pairs import AA, AB, AC, BA, BB, BC, CA, CB, CC, PAIRS, SUMS, add_point, add_span, no_blocks
from dlocore.kernels.space import combine
from dlocore.kernels.strain import space_curvature, transport, twist_increment, vector

TANGENT, BEND, DIRECTOR, FRAME, LAST, BEFORE = 0, 3, 6, 9, 10, 13  # columns of `past`
TWIST_RATE = LAST + 2
PAST = 16
LENGTH, ALONG, NOW, KAPPA, SPIN = 0, 1, 2, 5, 8  # columns of a point's geometry: |r'|, t . r'', t, kappa, spin
LOCAL = 11
Row = tuple[float, float, float, float]  # of basis functions
_TRIPLE = 3  # control points on from one span to the next across a triple knot
_STEPS = 8  # of the transport along the cable between two curvature points


@law
def _angle(q: Any, k: int, b: Row) -> float:
    return b[0] * q[k, 3] + b[1] * q[k + 1, 3] + b[2] * q[k + 2, 3] + b[3] * q[k + 3, 3]


@law
def _dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@law
def _directors(t0: Vector, t: Vector, director: Vector, theta: float) -> tuple[Vector, Vector]:
    """Return the two directors of a section turned by theta against the carried frame."""
    d = transport(t0, t, director)
    e = (t[1] * d[2] - t[2] * d[1], t[2] * d[0] - t[0] * d[2], t[0] * d[1] - t[1] * d[0])
    c, s = np.cos(theta), np.sin(theta)
    return (
        (c * d[0] + s * e[0], c * d[1] + s * e[1], c * d[2] + s * e[2]),
        (c * e[0] - s * d[0], c * e[1] - s * d[1], c * e[2] - s * d[2]),
    )


@law
def _strain(q: Any, tables: Any, past: Any, n: int, inverse: float) -> tuple[Vector, Vector, Vector]:
    """Return (k1, k2, tau) of a curvature point, its tangent and its curvature vector."""
    k = tables.curvature_first[n]
    b1 = row_of(tables.curvature_b1, n)
    _, _, t, kappa = space_curvature(combine(q, k, b1), combine(q, k, row_of(tables.curvature_b2, n)))
    t0 = vector(past, n, TANGENT)
    theta = inverse * _angle(q, k, row_of(tables.body_b0, n))
    m1, m2 = _directors(t0, t, vector(past, n, DIRECTOR), theta)
    tau = inverse * _angle(q, k, b1) + past[n, FRAME] + twist_increment(t0, vector(past, n, BEND), t, kappa)[0]
    return (_dot(kappa, m1), _dot(kappa, m2), tau), t, kappa


@law
def _span_end(firsts: Any, n: int) -> int:
    """Return the end of the points of a knot span, of which n is the first."""
    end = n + 1
    while end < len(firsts) and firsts[end] == firsts[n]:
        end += 1
    return end


@law
def _leans(firsts: Any, n: int, end: int) -> bool:
    """Tell whether the twist rate is a straight line over the span of the points n to `end`, not its mean."""
    outer = n == 0 or end == len(firsts)
    return outer or firsts[n] - firsts[n - 1] == _TRIPLE or firsts[end] - firsts[n] == _TRIPLE


@law
def _middle(u: Any, weights: Any, n: int, end: int) -> tuple[float, float, float]:
    """Return the middle [m] of the span of the points n to `end`, its width [m] and its second moment [m^3]."""
    middle, width, moment = 0.0, 0.0, 0.0
    for m in range(n, end):
        middle += weights[m] * u[m]
        width += weights[m]
    middle /= width
    for m in range(n, end):
        moment += weights[m] * (u[m] - middle) ** 2
    return middle, width, moment


@kernel
def _span_twists(q: Any, tables: Any, past: Any, inverse: float) -> Any:
    """Return the twist rate (points,) [rad/m] of q, over each knot span its mean or a straight line."""
    out = np.empty(len(tables.curvature_w))
    for n in range(len(out)):
        out[n] = _strain(q, tables, past, n, inverse)[0][2]
    _straighten(tables.curvature_first, tables.curvature_w, tables.curvature_u, out)
    return out


@law
def _straighten(firsts: Any, weights: Any, u: Any, tau: Any) -> None:
    """Turn twist rates at the points (points,) into those over each knot span: their mean or a straight line."""
    n = 0
    while n < len(tau):
        end = _span_end(firsts, n)
        middle, width, moment = _middle(u, weights, n, end)
        mean, slope = 0.0, 0.0
        for m in range(n, end):
            mean += weights[m] / width * tau[m]
            slope += weights[m] * (u[m] - middle) / moment * tau[m]
        leans = _leans(firsts, n, end)
        for m in range(n, end):
            tau[m] = mean + (slope * (u[m] - middle) if leans else 0.0)
        n = end


def over_spans(tables: Any) -> Any:
    """Return the matrix (points, points) that takes values at the curvature points to those that the twist rate has."""
    firsts, weights, u = tables.curvature_first, tables.curvature_w, tables.curvature_u
    same = firsts[:, None] == firsts
    shares = same * weights / (same @ weights)[:, None]
    x = u - shares @ u
    slopes = same * (weights * x) / (same @ (weights * x**2))[:, None]
    spans = np.unique(firsts)
    outer = np.concatenate([[True], np.diff(spans) == _TRIPLE, [True]])
    leans = np.isin(firsts, spans[outer[:-1] | outer[1:]])
    return shares + (leans * x)[:, None] * slopes


@kernel
def curvature(
    q: Any, v: Any, tables: Any, active: Any, p: Any, memory: Any, past: Any, rates: Any, scales: Any, tangent: bool,
    f: Any, K: Any,
) -> None:  # fmt: skip
    """Add the forces and tangents of curvature and twist.

    The derivatives of k1 and k2 are O by r', P by r'' and A by theta; that of the twist rate is the mean of its points'
    over a span, or their straight line. The material part of the tangent is E' S E with the derivatives E by the
    control points. The geometric part is that at the carried frame: what the carrying adds vanishes with the step.
    """
    local = np.empty((len(tables.curvature_w), LOCAL))
    _add_curvature(
        q, v, tables, active, p, memory, past, rates, scales, tangent, np.empty(16), np.empty(16), np.empty(16), local,
        no_blocks(4 if tangent else 0), f, K,
    )  # fmt: skip


@part
def _add_curvature(
    q: Any, v: Any, tables: Any, active: Any, p: Any, memory: Any, past: Any, rates: Any, scales: Any, tangent: bool,
    mean: Any, slope: Any, own: Any, local: Any, blocks: Any, f: Any, K: Any,
) -> None:  # fmt: skip
    """Do the work of `curvature` in the room made there.

    `mean` and `slope` (16,) are those of the derivative of the twist rate over a span, `own` (16,) is that of a point.
    """
    firsts, weights, pairs = tables.curvature_first, tables.curvature_w, tables.curvature_pairs
    b0, b1, b2, u = tables.body_b0, tables.curvature_b1, tables.curvature_b2, tables.curvature_u
    n = 0
    while n < len(weights):
        k, until = firsts[n], _span_end(firsts, n)
        middle, width, moment = _middle(u, weights, n, until)
        leans = _leans(firsts, n, until)
        tau, rise = _span_twist(
            q, k, weights, u, b1, b2, past, n, until, p[TWIST, 1], middle, 1.0 / width, 1.0 / moment if leans else 0.0,
            mean, slope, local,
        )  # fmt: skip
        torque, stiffness = 0.0, 0.0
        for m in range(n, until):
            x = u[m] - middle if leans else 0.0
            for j in range(16):
                own[j] = mean[j] + x * slope[j]
            T, S = _point(
                q, v, k, weights[m], row_of(b0, m), row_of(b1, m), row_of(b2, m), pairs, active, p, memory, past, rates,
                scales, tangent, m, tau + x * rise, own, local, f, blocks,
            )  # fmt: skip
            torque += T
            stiffness += S
            if leans or m == until - 1:
                _add_twist(k, torque, stiffness, own, tangent, f, K)
                torque, stiffness = 0.0, 0.0
        if tangent:
            add_span(4, K, k, blocks)
        n = until


@law
def _add_twist(k: int, torque: float, stiffness: float, derivative: Any, tangent: bool, f: Any, K: Any) -> None:
    """Add the force and tangent of a twist rate, or the sum of some alike, with this `derivative` (16,)."""
    for j in range(4):
        for d in range(4):
            f[k + j, d] += torque * derivative[4 * j + d]
    if tangent:
        for j in range(16):
            row, stiff = K[4 * k + j], stiffness * derivative[j]
            for i in range(j, 16):
                row[i - j] += stiff * derivative[i]


@law
def _span_twist(
    q: Any, k: int, weights: Any, u: Any, b1: Any, b2: Any, past: Any, n: int, until: int, inverse: float,
    middle: float, shared: float, inclined: float, mean: Any, slope: Any, local: Any,
) -> tuple[float, float]:  # fmt: skip
    """Return the mean twist rate [rad/m] of the points n to `until` of a span, and its slope [rad/m^2].

    Their derivatives (16,) by x, y, z, fourth of the four control points are written to `mean` and `slope`, and the
    geometry of the points to `local` (points, LOCAL). `shared` is one over the width of the span, `inclined` one over
    its second moment, or zero where it has no slope.
    """
    for j in range(16):
        mean[j] = slope[j] = 0.0
    tau, rise = 0.0, 0.0
    for m in range(n, until):
        b, c = row_of(b1, m), row_of(b2, m)
        w, z = shared * weights[m], inclined * weights[m] * (u[m] - middle)
        length, h, t, kappa = space_curvature(combine(q, k, b), combine(q, k, c))
        increment, spin, by_t = twist_increment(vector(past, m, TANGENT), vector(past, m, BEND), t, kappa)
        local[m, LENGTH], local[m, ALONG] = length, h
        for d in range(3):
            local[m, NOW + d], local[m, KAPPA + d], local[m, SPIN + d] = t[d], kappa[d], spin[d]
        there = inverse * _angle(q, k, b) + past[m, FRAME] + increment
        tau += w * there
        rise += z * there
        turned = _dot(by_t, t) + _dot(spin, kappa)
        for j in range(4):
            across, along = (c[j] - h * b[j] / length) / length, b[j] / length
            for d in range(3):
                derivative = across * spin[d] + along * (by_t[d] - turned * t[d])
                mean[4 * j + d] += w * derivative
                slope[4 * j + d] += z * derivative
            mean[4 * j + 3] += w * inverse * b[j]
            slope[4 * j + 3] += z * inverse * b[j]
    return tau, rise


@law
def _point(
    q: Any, v: Any, k: int, w: float, a: Row, b: Row, c: Row, pairs: Any, active: Any, p: Any, memory: Any, past: Any,
    rates: Any, scales: Any, tangent: bool, n: int, tau: float, by_points: Any, local: Any, f: Any, blocks: Any,
) -> tuple[float, float]:  # fmt: skip
    """Add the forces of the bends of a point, and its share in the blocks of its span, but for that of the twist rate.

    Returns:
        the torque and the torsional stiffness of its part of the cable.
    """
    elastic, viscous, geometric = scales
    if viscous != 0.0 and rates[0] != 0.0:
        viscous = rates[0]
    inverse = p[TWIST, 1]
    length, h, t = local[n, LENGTH], local[n, ALONG], vector(local, n, NOW)
    kappa, spin = vector(local, n, KAPPA), vector(local, n, SPIN)
    m1, m2 = _directors(vector(past, n, TANGENT), t, vector(past, n, DIRECTOR), inverse * _angle(q, k, a))
    k1, k2 = _dot(kappa, m1), _dot(kappa, m2)
    O1, P1 = _derivatives(length, h, m1, k2, spin, -k1, t)
    O2, P2 = _derivatives(length, h, m2, -k1, spin, -k2, t)
    A1, A2 = inverse * k2, -inverse * k1
    rate = (0.0, 0.0, 0.0)
    damped = active[DAMPING] or active[TWIST_DAMPING]
    if damped and rates[0] != 0.0:
        rate = (
            rates[0] * k1 + rates[1] * past[n, LAST] + rates[2] * past[n, BEFORE],
            rates[0] * k2 + rates[1] * past[n, LAST + 1] + rates[2] * past[n, BEFORE + 1],
            rates[0] * tau + rates[1] * past[n, LAST + 2] + rates[2] * past[n, BEFORE + 2],
        )
    elif damped:
        first, second, turn = combine(v, k, b), combine(v, k, c), _angle(v, k, a)
        twisting = 0.0
        for j in range(4):
            for d in range(4):
                twisting += by_points[4 * j + d] * v[k + j, d]
        rate = (
            _dot(O1, first) + _dot(P1, second) + A1 * turn, _dot(O2, first) + _dot(P2, second) + A2 * turn, twisting,
        )  # fmt: skip
    moment, stiffness, viscosity = curvature_stress(
        active, p, (k1, k2, 0.0), (rate[0], rate[1], 0.0), (memory[n, 0], memory[n, 1], 0.0),
        (memory[n, 3], memory[n, 4], 0.0), (past[n, LAST], past[n, LAST + 1], 0.0), rates[3],
    )  # fmt: skip
    T, twist_stiffness, twist_viscosity = twist_stress(
        active, p, tau, rate[2], memory[n, 2], memory[n, 5], past[n, LAST + 2], rates[3]
    )
    M1, M2 = moment[0], moment[1]
    for j in range(4):
        bj, cj = w * b[j], w * c[j]
        for d in range(3):
            f[k + j, d] += bj * (M1 * O1[d] + M2 * O2[d]) + cj * (M1 * P1[d] + M2 * P2[d])
        f[k + j, 3] += w * a[j] * (M1 * A1 + M2 * A2)
    if not tangent:
        return w * T, 0.0
    S11 = w * (elastic * stiffness[0] + viscous * viscosity[0])
    S22 = w * (elastic * stiffness[1] + viscous * viscosity[1])
    S12 = w * (elastic * stiffness[3] + viscous * viscosity[3])
    M = (M1 * m1[0] + M2 * m2[0], M1 * m1[1] + M2 * m2[1], M1 * m1[2] + M2 * m2[2])
    N = (M1 * m2[0] - M2 * m1[0], M1 * m2[1] - M2 * m1[1], M1 * m2[2] - M2 * m1[2])  # t x M
    dot, along = M1 * k1 + M2 * k2, _dot(N, kappa)
    scale = w * geometric / (length * length)
    turn = w * geometric * inverse / length
    kb = (t[1] * kappa[2] - t[2] * kappa[1], t[2] * kappa[0] - t[0] * kappa[2], t[0] * kappa[1] - t[1] * kappa[0])
    half = 0.5 * scale * T
    cross = ((0.0, -half * t[2], half * t[1]), (half * t[2], 0.0, -half * t[0]), (-half * t[1], half * t[0], 0.0))
    products = pairs[n]
    for e in range(3):
        # S times the derivatives by coordinate e of r' and of r''
        SO1, SO2 = S11 * O1[e] + S12 * O2[e], S12 * O1[e] + S22 * O2[e]
        SP1, SP2 = S11 * P1[e] + S12 * P2[e], S12 * P1[e] + S22 * P2[e]
        for d in range(3):
            Mt = M[d] * t[e] + t[d] * M[e]
            by_first = 3.0 * dot * t[d] * t[e] + 2.0 * h / length * Mt - 0.5 * (M[d] * kappa[e] + kappa[d] * M[e])
            by_first -= 1.5 * T * (kb[d] * t[e] + t[d] * kb[e])
            if d == e:
                by_first -= dot
            at = 4 * e + d
            blocks[BB, at] = scale * by_first + O1[d] * SO1 + O2[d] * SO2
            blocks[BC, at] = cross[d][e] - scale * Mt + O1[d] * SP1 + O2[d] * SP2
            blocks[CB, at] = -cross[d][e] - scale * Mt + P1[d] * SO1 + P2[d] * SO2
            blocks[CC, at] = P1[d] * SP1 + P2[d] * SP2
    add_point(blocks, products)
    for e in range(3):
        # S times the derivatives by coordinate e, against the angle
        by_first = A1 * (S11 * O1[e] + S12 * O2[e]) + A2 * (S12 * O1[e] + S22 * O2[e])
        by_second = A1 * (S11 * P1[e] + S12 * P2[e]) + A2 * (S12 * P1[e] + S22 * P2[e])
        by_first -= turn * (h / length * N[e] + along * t[e])
        by_second += turn * N[e]
        for pair in range(PAIRS):
            of = products[pair]
            blocks[SUMS + pair, 4 * e + 3] += by_first * of[AB] + by_second * of[AC]
            blocks[SUMS + pair, 12 + e] += by_first * of[BA] + by_second * of[CA]
    angular = S11 * A1 * A1 + 2.0 * S12 * A1 * A2 + S22 * A2 * A2 - w * geometric * inverse * inverse * dot
    for pair in range(PAIRS):
        blocks[SUMS + pair, 15] += angular * products[pair, AA]
    return w * T, w * (elastic * twist_stiffness + viscous * twist_viscosity)


@law
def _derivatives(
    length: float, h: float, director: Vector, by_spin: float, spin: Vector, by_t: float, t: Vector
) -> tuple[Vector, Vector]:
    """Return the derivatives by r' and by r'' of a curvature along a director, which turns with the frames."""
    inverse = 1.0 / length
    along = h * inverse
    first = (
        (by_spin * spin[0] + by_t * t[0] - along * director[0]) * inverse,
        (by_spin * spin[1] + by_t * t[1] - along * director[1]) * inverse,
        (by_spin * spin[2] + by_t * t[2] - along * director[2]) * inverse,
    )
    return first, (director[0] * inverse, director[1] * inverse, director[2] * inverse)


@kernel
def remember(q: Any, tables: Any, active: Any, p: Any, memory: Any, past: Any, h: float) -> None:
    """Carry the frames to q, note its strain, and let what yielded in a step h become memory."""
    _remember(q, tables, active, p, memory, past, h, np.empty((len(past), SPIN)), np.empty(len(past)))


@part
def _remember(
    q: Any, tables: Any, active: Any, p: Any, memory: Any, past: Any, h: float, state: Any, twists: Any
) -> None:
    """Do the work of `remember` in the room made there: `state` (points, SPIN) is k1, k2, t and kappa."""
    for n in range(len(past)):
        (state[n, 0], state[n, 1], twists[n]), t, kappa = _strain(q, tables, past, n, p[TWIST, 1])
        for d in range(3):
            state[n, NOW + d], state[n, KAPPA + d] = t[d], kappa[d]
    _straighten(tables.curvature_first, tables.curvature_w, tables.curvature_u, twists)
    for n in range(len(past)):
        strain, t, kappa = (state[n, 0], state[n, 1], twists[n]), vector(state, n, NOW), vector(state, n, KAPPA)
        last = vector(past, n, LAST)
        free, _ = curvature_memory(
            active, p, (strain[0], strain[1], 0.0), (memory[n, 0], memory[n, 1], 0.0),
            (memory[n, 3], memory[n, 4], 0.0), (last[0], last[1], 0.0), h,
        )  # fmt: skip
        memory[n, 0], memory[n, 1] = free[0], free[1]
        memory[n, 2], _ = twist_memory(active, p, strain[2], memory[n, 2], memory[n, 5], last[2], h)
        t0 = vector(past, n, TANGENT)
        past[n, FRAME] += twist_increment(t0, vector(past, n, BEND), t, kappa)[0]
        director = transport(t0, t, vector(past, n, DIRECTOR))
        for d in range(3):
            past[n, BEFORE + d] = past[n, LAST + d]
            past[n, LAST + d] = strain[d]
            past[n, TANGENT + d] = t[d]
            past[n, BEND + d] = kappa[d]
            past[n, DIRECTOR + d] = director[d]


@kernel
def energy(q: Any, tables: Any, active: Any, p: Any, memory: Any, past: Any) -> float:
    """Return the stored energy of curvature and twist [J]."""
    total = 0.0
    twists = _span_twists(q, tables, past, p[TWIST, 1])
    for n in range(len(tables.curvature_w)):
        strain, _, _ = _strain(q, tables, past, n, p[TWIST, 1])
        free = (memory[n, 0], memory[n, 1], 0.0)
        total += tables.curvature_w[n] * (
            curvature_energy(active, p, (strain[0], strain[1], 0.0), free)
            + twist_energy(active, p, twists[n], memory[n, 2])
        )
    return total


@kernel
def twist_rates(states: Any, tables: Any, p: Any, frames: Any, out: Any) -> None:
    """Write the twist rate (k, points) [rad/m] of the states (k, n, 4) measured against `frames` (k, points, >= 16)."""
    for s in range(len(states)):
        out[s] = _span_twists(states[s], tables, frames[s], p[TWIST, 1])


@kernel
def start_frames(knots: Any, q: Any, tables: Any, director: Any, past: Any) -> None:
    """Write frames without twist along the cable q (n, >= 3) to `past` (points, 16), from `director` (3,) at u = 0."""
    row = np.empty((3, 4))
    before = 0.0
    u = 0.0
    basis(knots, 3, 0.0, 2, row)
    t0 = space_curvature(combine(q, 0, row_of(row, 1)), combine(q, 0, row_of(row, 2)))[2]
    along = director[0] * t0[0] + director[1] * t0[1] + director[2] * t0[2]
    x = (director[0] - along * t0[0], director[1] - along * t0[1], director[2] - along * t0[2])
    size = np.sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2])
    d0 = (x[0] / size, x[1] / size, x[2] / size)
    for n in range(len(past)):
        for step in range(1, _STEPS + 1):
            u = before + (tables.curvature_u[n] - before) * step / _STEPS
            span = find_span(knots, u)
            basis(knots, span, u, 2, row)
            _, _, t, kappa = space_curvature(combine(q, span - 3, row_of(row, 1)), combine(q, span - 3, row_of(row, 2)))
            d0 = transport(t0, t, d0)
            t0 = t
            if step == _STEPS:
                for d in range(3):
                    past[n, TANGENT + d] = t[d]
                    past[n, BEND + d] = kappa[d]
                    past[n, DIRECTOR + d] = d0[d]
                past[n, FRAME] = 0.0
        before = tables.curvature_u[n]
