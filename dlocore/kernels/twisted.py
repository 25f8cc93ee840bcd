"""Assembly in space with twist: the fourth coordinate is theta times the polar radius of gyration of the section.

At every curvature point a frame without spin is kept. `past` (points, 17) holds the tangent t0 of the last step, its
derivative k0 along the cable, a director perpendicular to it, the twist rate of these frames along the cable, the
strain (two curvatures in the frame of the sections, twist rate) of the last two steps, and the difference of the
section's angle from theta, see `twisted_angles.py`. A state is measured against the frame that the smallest rotation
carries from t0 to its tangent: nothing is singular where the cable is straight, and theta counts any number of turns
(docs/model.md eq. 19).

The twist rate is smoothed over each knot span: by the mean of its points, and in the two end spans and beside a triple
knot by the straight line through them. These are as many conditions as theta has freedoms. Where the curvature jumps,
the twist rate of the carried frames jumps too as the cable swings about its own tangent. Theta can follow only at a
triple knot, where it may have a kink. Without smoothing, the cable would be held back from swinging (membrane locking,
of twist).

Spans are measured and assembled group by group in one array W, see `lanes.py`.
"""

from typing import Any

import numpy as np

from dlocore.compiling.kernel import kernel, law, leaf, part
from dlocore.effects.laws import (
    BENDING_MEMORY,
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
from dlocore.kernels.lanes import (
    FIRSTS,
    LANES,
    LEVER,
    POINTS,
    SECONDS,
    SHARE,
    SLOPE,
    SPANS,
    VALUES,
    WEIGHT,
    added,
    at,
    combined,
    over,
    put,
    put_vector,
    vector_at,
)
from dlocore.kernels.space import combine
from dlocore.kernels.strain import space_curvature, transport, twist_increment
from dlocore.kernels.strands import dot
from dlocore.kernels.twisted_angles import correct_angles
from dlocore.kernels.twisted_rows import (
    ALONG,
    ANGLE,
    B1,
    B2,
    BEFORE,
    BEND,
    BLOCK,
    BY_FIRST,
    COS,
    D0,
    DIRECTOR,
    FRAME,
    G0,
    G1,
    G2,
    HANDED,
    K0,
    K1,
    K2,
    KAPPA,
    KNOT,
    LAST,
    LENGTH,
    M1,
    M2,
    NOW,
    OFFSET,
    R1,
    R2,
    RATE,
    S11,
    S12,
    S22,
    SIN,
    SIZE,
    SPIN,
    STIFF,
    T0,
    TANGENT,
    TAU,
    TORQUE,
    F,
    Q,
    count_of,
    derivatives,
)
from dlocore.kernels.twisted_tangent import add_blocks, tangent_of, twist_tangent

_STEPS = 8  # steps of the transport along the cable between two curvature points


@part
def _measure(q: Any, points: Any, past: Any, inverse: float, group: int, W: Any) -> None:
    """Write the geometry of a group of spans, its twist rate, and what these are measured against."""
    _gather(q, points.first, past, group, W)
    _locate(points.lanes[group], inverse, W)
    _bend(W)
    _smooth(points.lanes[group], TAU, W)


@leaf
def _gather(q: Any, first: Any, past: Any, group: int, W: Any) -> None:
    """Copy the control points q (n, 4) of a group of spans, and the frames of the last step, to their places."""
    count = count_of(len(past), group)
    for s in range(SPANS):
        n = POINTS * (SPANS * group + min(s, count - 1))
        for i in range(4):
            for d in range(4):
                W[Q + (4 * i + d) * SPANS + s] = q[first[n] + i, d]
        for m in range(POINTS):
            lane = SPANS * m + s
            for i in range(FRAME):
                W[(T0 + i) * LANES + lane] = past[n + m, i]
            put(W, TAU, lane, past[n + m, FRAME])
            put(W, ANGLE, lane, past[n + m, OFFSET])


@leaf
def _locate(T: Any, inverse: float, W: Any) -> None:
    """Write r' and r'' of the points; add theta to their angle and its derivative to their twist rate."""
    _locate_points(0, T, inverse, W)
    _locate_points(1, T, inverse, W)
    _locate_points(2, T, inverse, W)


@part
def _locate_points(m: int, T: Any, inverse: float, W: Any) -> None:
    for s in range(SPANS):
        n, x, y, z, theta = SPANS * m + s, Q + s, Q + SPANS + s, Q + 2 * SPANS + s, Q + 3 * SPANS + s
        a = (combined(W, x, T, FIRSTS, n), combined(W, y, T, FIRSTS, n), combined(W, z, T, FIRSTS, n))
        c = (combined(W, x, T, SECONDS, n), combined(W, y, T, SECONDS, n), combined(W, z, T, SECONDS, n))
        put_vector(W, R1, n, a)
        put_vector(W, R2, n, c)
        put(W, ANGLE, n, at(W, ANGLE, n) + inverse * combined(W, theta, T, VALUES, n))
        put(W, TAU, n, at(W, TAU, n) + inverse * combined(W, theta, T, FIRSTS, n))


@leaf
def _bend(W: Any) -> None:
    """Write the geometry of the points, and add to their twist rate the part due to carrying the frames.

    The derivatives of the twist rate with respect to r' and r'' are BY_FIRST and spin/l.
    """
    for n in range(LANES):
        length, h, t, kappa = space_curvature(vector_at(W, R1, n), vector_at(W, R2, n))
        increment, spin, by_t = twist_increment(vector_at(W, T0, n), vector_at(W, K0, n), t, kappa)
        inverse = 1.0 / length
        turned, along = dot(by_t, t) + dot(spin, kappa), h * inverse
        by_first = (
            (by_t[0] - turned * t[0] - along * spin[0]) * inverse,
            (by_t[1] - turned * t[1] - along * spin[1]) * inverse,
            (by_t[2] - turned * t[2] - along * spin[2]) * inverse,
        )
        put(W, LENGTH, n, length)
        put(W, ALONG, n, h)
        put_vector(W, NOW, n, t)
        put_vector(W, KAPPA, n, kappa)
        put_vector(W, SPIN, n, spin)
        put_vector(W, BY_FIRST, n, by_first)
        put(W, TAU, n, at(W, TAU, n) + increment)


@leaf
def _smooth(T: Any, row: int, W: Any) -> None:
    """Smooth the values at the points of each span: by their mean, or by the straight line."""
    for s in range(SPANS):
        mean, slope = over(T, SHARE, W, row, s), over(T, SLOPE, W, row, s)
        for m in range(POINTS):
            put(W, row, SPANS * m + s, mean + at(T, LEVER, SPANS * m + s) * slope)


@part
def _measure_bends(active: Any, memory: Any, group: int, W: Any) -> None:
    """Write the directors of the sections, and the curvatures along them.

    Where sections bend alike in all directions and do not resist the rate of bending, the choice of directors is free.
    """
    turns = bool(active[DAMPING] or active[BENDING_MEMORY])
    for s in range(count_of(len(memory), group)):
        for m in range(POINTS):
            n, lane = POINTS * (SPANS * group + s) + m, SPANS * m + s
            c, r = 1.0, 0.0
            if turns or memory[n, 0] != 0.0 or memory[n, 1] != 0.0:
                c, r = np.cos(at(W, ANGLE, lane)), np.sin(at(W, ANGLE, lane))
            put(W, COS, lane, c)
            put(W, SIN, lane, r)
    _direct(W)


@leaf
def _direct(W: Any) -> None:
    """Carry the directors to the current tangents, write those of the sections, and write k1 and k2."""
    for n in range(LANES):
        t, kappa, c, s = vector_at(W, NOW, n), vector_at(W, KAPPA, n), at(W, COS, n), at(W, SIN, n)
        d = transport(vector_at(W, T0, n), t, vector_at(W, D0, n))
        e = (t[1] * d[2] - t[2] * d[1], t[2] * d[0] - t[0] * d[2], t[0] * d[1] - t[1] * d[0])
        m1 = (c * d[0] + s * e[0], c * d[1] + s * e[1], c * d[2] + s * e[2])
        m2 = (c * e[0] - s * d[0], c * e[1] - s * d[1], c * e[2] - s * d[2])
        put_vector(W, D0, n, d)
        put_vector(W, M1, n, m1)
        put_vector(W, M2, n, m2)
        put(W, K1, n, dot(kappa, m1))
        put(W, K2, n, dot(kappa, m2))


@leaf
def curvature(
    q: Any, v: Any, points: Any, active: Any, p: Any, memory: Any, past: Any, rates: Any, scales: Any, tangent: bool,
    room: Any, f: Any, K: Any,
) -> None:  # fmt: skip
    """Add the forces and tangents of curvature and twist.

    The derivatives of k1 and k2 with respect to r', r'' and theta are O, P and A. Those of the twist rate are smoothed
    over a span as the twist rate is. The material part of the tangent is E' S E, where E are the derivatives with
    respect to the control points. The geometric part is that at the carried frame: what the carrying adds vanishes with
    the step. `room` is that of a `History`.
    """
    W, block = room[:SIZE], room[SIZE : SIZE + BLOCK]
    first, inverse = points.first, p[TWIST, 1]
    damped = active[DAMPING] or active[TWIST_DAMPING]
    for group in range(len(points.lanes)):
        T = points.lanes[group]
        _measure(q, points, past, inverse, group, W)
        _measure_bends(active, memory, group, W)
        if damped and rates[0] != 0.0:
            _rate_by_steps(past, rates, group, W)
        elif damped:
            _rate_by_velocity(v, points, inverse, group, W)
        _stress(active, p, memory, past, rates, scales, damped, group, T, W)
        _force(T, inverse, W)
        _scatter_force(first, count_of(len(past), group), group, W, f)
        if tangent:
            tangent_of(inverse, scales[2], W)
            twist_tangent(T, inverse, W)
            add_blocks(first, count_of(len(past), group), group, T, W, block, K)


@leaf
def _rate_by_steps(past: Any, rates: Any, group: int, W: Any) -> None:
    """Write the rates of k1, k2 and twist as the combination `rates` of their values now and at the last two steps."""
    for s in range(count_of(len(past), group)):
        for m in range(POINTS):
            n, lane = POINTS * (SPANS * group + s) + m, SPANS * m + s
            now = (at(W, K1, lane), at(W, K2, lane), at(W, TAU, lane))
            for d in range(3):
                W[(RATE + d) * LANES + lane] = (
                    rates[0] * now[d] + rates[1] * past[n, LAST + d] + rates[2] * past[n, BEFORE + d]
                )


@leaf
def _rate_by_velocity(v: Any, points: Any, inverse: float, group: int, W: Any) -> None:
    """Write the rates of k1, k2 and twist that follow from the velocity v (n, 4)."""
    first = points.first
    for s in range(count_of(len(first), group)):
        for m in range(POINTS):
            n, lane = POINTS * (SPANS * group + s) + m, SPANS * m + s
            k, b = first[n], row_of(points.b1, n)
            a, c = combine(v, k, b), combine(v, k, row_of(points.b2, n))
            length, h, k1, k2 = at(W, LENGTH, lane), at(W, ALONG, lane), at(W, K1, lane), at(W, K2, lane)
            t, spin = vector_at(W, NOW, lane), vector_at(W, SPIN, lane)
            O1, P1 = derivatives(length, h, vector_at(W, M1, lane), k2, spin, -k1, t)
            O2, P2 = derivatives(length, h, vector_at(W, M2, lane), -k1, spin, -k2, t)
            turn, twisting = inverse * _angle(v, k, row_of(points.b0, n)), inverse * _angle(v, k, b)
            twisting += dot(vector_at(W, BY_FIRST, lane), a) + dot(spin, c) / length
            rate = (dot(O1, a) + dot(P1, c) + k2 * turn, dot(O2, a) + dot(P2, c) - k1 * turn, twisting)
            put_vector(W, RATE, lane, rate)
    _smooth(points.lanes[group], RATE + 2, W)


@law
def _angle(q: Any, k: int, b: tuple[float, float, float, float]) -> float:
    return b[0] * q[k, 3] + b[1] * q[k + 1, 3] + b[2] * q[k + 2, 3] + b[3] * q[k + 3, 3]


@leaf
def _stress(
    active: Any, p: Any, memory: Any, past: Any, rates: Any, scales: Any, damped: bool, group: int, T: Any, W: Any
) -> None:
    """Write moments, torques and their derivatives with respect to the strain, all times the weights of the points."""
    elastic, viscous = scales[0], rates[0] if scales[1] != 0.0 and rates[0] != 0.0 else scales[1]
    for s in range(count_of(len(past), group)):
        for m in range(POINTS):
            n, lane = POINTS * (SPANS * group + s) + m, SPANS * m + s
            w, rate = at(T, WEIGHT, lane), vector_at(W, RATE, lane) if damped else (0.0, 0.0, 0.0)
            moment, stiffness, viscosity = curvature_stress(
                active, p, (at(W, K1, lane), at(W, K2, lane), 0.0), (rate[0], rate[1], 0.0),
                (memory[n, 0], memory[n, 1], 0.0), (memory[n, 3], memory[n, 4], 0.0),
                (past[n, LAST], past[n, LAST + 1], 0.0), rates[3],
            )  # fmt: skip
            torque, stiff, viscid = twist_stress(
                active, p, at(W, TAU, lane), rate[2], memory[n, 2], memory[n, 5], past[n, LAST + 2], rates[3]
            )
            put(W, B1, lane, w * moment[0])
            put(W, B2, lane, w * moment[1])
            put(W, TORQUE, lane, w * torque)
            put(W, S11, lane, w * (elastic * stiffness[0] + viscous * viscosity[0]))
            put(W, S22, lane, w * (elastic * stiffness[1] + viscous * viscosity[1]))
            put(W, S12, lane, w * (elastic * stiffness[3] + viscous * viscosity[3]))
            put(W, STIFF, lane, w * (elastic * stiff + viscous * viscid))


@leaf
def _force(T: Any, inverse: float, W: Any) -> None:
    """Write the forces of the points by r', r'' and theta, and those of the spans by their control points."""
    for s in range(SPANS):
        force, couple = added(W, TORQUE, s), over(T, LEVER, W, TORQUE, s)
        for m in range(POINTS):
            lane = SPANS * m + s
            put(W, HANDED, lane, at(T, SHARE, lane) * force + at(T, SLOPE, lane) * couple)
    for n in range(LANES):
        a, b, torque, k1, k2 = at(W, B1, n), at(W, B2, n), at(W, HANDED, n), at(W, K1, n), at(W, K2, n)
        m1, m2, by_first = vector_at(W, M1, n), vector_at(W, M2, n), vector_at(W, BY_FIRST, n)
        t, spin, over_l = vector_at(W, NOW, n), vector_at(W, SPIN, n), 1.0 / at(W, LENGTH, n)
        along, turn, work = at(W, ALONG, n) * over_l, a * k2 - b * k1, a * k1 + b * k2
        M = (a * m1[0] + b * m2[0], a * m1[1] + b * m2[1], a * m1[2] + b * m2[2])
        g1 = (
            (turn * spin[0] - work * t[0] - along * M[0]) * over_l + torque * by_first[0],
            (turn * spin[1] - work * t[1] - along * M[1]) * over_l + torque * by_first[1],
            (turn * spin[2] - work * t[2] - along * M[2]) * over_l + torque * by_first[2],
        )
        put_vector(W, G1, n, g1)
        put(W, G2, n, (M[0] + torque * spin[0]) * over_l)
        put(W, G2 + 1, n, (M[1] + torque * spin[1]) * over_l)
        put(W, G2 + 2, n, (M[2] + torque * spin[2]) * over_l)
        put(W, G0, n, inverse * turn)
    _force_on(0, T, inverse, W)
    _force_on(1, T, inverse, W)
    _force_on(2, T, inverse, W)
    _force_on(3, T, inverse, W)


@part
def _force_on(i: int, T: Any, inverse: float, W: Any) -> None:
    """Write the forces of the spans on their i-th control points."""
    for s in range(SPANS):
        place = F + 4 * i * SPANS + s
        W[place] = over(T, FIRSTS + i, W, G1, s) + over(T, SECONDS + i, W, G2, s)
        W[place + SPANS] = over(T, FIRSTS + i, W, G1 + 1, s) + over(T, SECONDS + i, W, G2 + 1, s)
        W[place + 2 * SPANS] = over(T, FIRSTS + i, W, G1 + 2, s) + over(T, SECONDS + i, W, G2 + 2, s)
        W[place + 3 * SPANS] = over(T, VALUES + i, W, G0, s) + inverse * over(T, FIRSTS + i, W, HANDED, s)


@leaf
def _scatter_force(first: Any, count: int, group: int, W: Any, f: Any) -> None:
    """Add the forces of a group of spans to f (n, 4)."""
    for s in range(count):
        k = first[POINTS * (SPANS * group + s)]
        for i in range(4):
            for d in range(4):
                f[k + i, d] += W[F + (4 * i + d) * SPANS + s]


@leaf
def remember(q: Any, points: Any, active: Any, p: Any, memory: Any, past: Any, h: float, room: Any) -> None:
    """Carry the frames to q, record its strain, and let what yielded in a step h become memory."""
    W, knots = room[:SIZE], room[SIZE + BLOCK :].reshape((len(past) // POINTS + 1, KNOT))
    turns = bool(active[DAMPING] or active[BENDING_MEMORY])
    for n in range(len(memory)):
        turns = turns or memory[n, 0] != 0.0 or memory[n, 1] != 0.0
    for group in range(len(points.lanes)):
        _measure(q, points, past, p[TWIST, 1], group, W)
        _measure_bends(active, memory, group, W)
        _note(active, p, memory, past, h, group, W)
    if turns:
        correct_angles(q, points, p[TWIST, 1], past, knots)


@leaf
def _note(active: Any, p: Any, memory: Any, past: Any, h: float, group: int, W: Any) -> None:
    """Do what `remember` does for a group of spans that is already measured."""
    for s in range(count_of(len(past), group)):
        for m in range(POINTS):
            n, lane = POINTS * (SPANS * group + s) + m, SPANS * m + s
            k1, k2, tau = at(W, K1, lane), at(W, K2, lane), at(W, TAU, lane)
            free, _ = curvature_memory(
                active, p, (k1, k2, 0.0), (memory[n, 0], memory[n, 1], 0.0), (memory[n, 3], memory[n, 4], 0.0),
                (past[n, LAST], past[n, LAST + 1], 0.0), h,
            )  # fmt: skip
            memory[n, 0], memory[n, 1] = free[0], free[1]
            memory[n, 2], _ = twist_memory(active, p, tau, memory[n, 2], memory[n, 5], past[n, LAST + 2], h)
            t, kappa = vector_at(W, NOW, lane), vector_at(W, KAPPA, lane)
            t0, k0 = vector_at(W, T0, lane), vector_at(W, K0, lane)
            past[n, FRAME] += twist_increment(t0, k0, t, kappa)[0]
            for d in range(3):
                past[n, BEFORE + d] = past[n, LAST + d]
                past[n, TANGENT + d] = t[d]
                past[n, BEND + d] = kappa[d]
                past[n, DIRECTOR + d] = W[(D0 + d) * LANES + lane]
            past[n, LAST], past[n, LAST + 1], past[n, LAST + 2] = k1, k2, tau


@kernel
def energy(q: Any, points: Any, active: Any, p: Any, memory: Any, past: Any) -> float:
    """Return the stored energy of curvature and twist [J]."""
    total = 0.0
    W = np.empty(SIZE)
    for group in range(len(points.lanes)):
        _measure(q, points, past, p[TWIST, 1], group, W)
        _measure_bends(active, memory, group, W)
        for s in range(count_of(len(past), group)):
            for m in range(POINTS):
                n, lane = POINTS * (SPANS * group + s) + m, SPANS * m + s
                free = (memory[n, 0], memory[n, 1], 0.0)
                total += points.w[n] * (
                    curvature_energy(active, p, (at(W, K1, lane), at(W, K2, lane), 0.0), free)
                    + twist_energy(active, p, at(W, TAU, lane), memory[n, 2])
                )
    return total


@kernel
def twist_rates(states: Any, points: Any, p: Any, frames: Any, out: Any) -> None:
    """Write the twist rates (k, points) [rad/m] of the states (k, n, 4) measured against `frames` (k, points, PAST)."""
    W = np.empty(SIZE)
    for k in range(len(states)):
        for group in range(len(points.lanes)):
            _measure(states[k], points, frames[k], p[TWIST, 1], group, W)
            for s in range(count_of(out.shape[1], group)):
                for m in range(POINTS):
                    out[k, POINTS * (SPANS * group + s) + m] = at(W, TAU, SPANS * m + s)


@kernel
def start_frames(knots: Any, q: Any, points: Any, director: Any, past: Any) -> None:
    """Write frames without twist along the cable q (n, >= 3) to `past`, starting from `director` (3,) at u = 0."""
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
            u = before + (points.u[n] - before) * step / _STEPS
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
        before = points.u[n]
