"""Residual and tangent of a rod's equations of motion at one stage of a step: stretch, bend, twist, drag, contact.

    M v' + internal forces + drag - weight - load - contact = 0

The internal forces are those of the energy: EA/2 e^2 h of each edge and (EI |kappa - kappa_0|^2 + GJ (tau - tau_0)^2)
w/2 of each hinge. Their rates are damped (docs/model.md eq. 7, 7a and 9). The same Runge-Kutta method integrates the
rate of the memory (docs/model.md eq. 20).
"""

from typing import Any

import numpy as np

from dlocore.reference.body import (
    AXIAL_DAMPING,
    BEND_DAMPING,
    CLAMP,
    CONTACT_DAMPING,
    DENSITY,
    DRAG,
    DRAG_QUADRATIC,
    EA,
    EI,
    GJ,
    GYRATION,
    LYING,
    MEMORY_RATE,
    PASSAGE,
    RADIUS,
    REAL,
    SOFTENED,
    STICK,
    STIFFNESS,
    TWIST_DAMPING,
    YIELD_BEND,
    YIELD_STRETCH,
    YIELD_TWIST,
)
from dlocore.reference.compile import compiled
from dlocore.reference.hinge import FOLDED, add_curvature_of_strains, carry, cross, dot, gradients, strains
from dlocore.reference.surface import FRICTION, gap, press, rub, thickness


@compiled
def frames(body: Any, before: Any, q: Any, t: Any, a: Any, b: Any, lengths: Any) -> bool:
    """Write tangents, directors (n - 1, 3) and lengths (n - 1,) of the edges; return False where two of them fold up.

    Held tangents, and the directors of clamps, are already in t and a. `before` is the state at the start of the step.
    """
    d = np.empty(3)
    for e in range(len(body.rest)):
        if body.kind[e] == REAL:
            for i in range(3):
                d[i] = q[e + 1, i] - q[e, i]
            length = np.sqrt(dot(d, d))
            if not length > 0.0:
                return False
            lengths[e] = length
            for i in range(3):
                t[e, i] = d[i] / length
        else:
            lengths[e] = 0.0
        if body.kind[e] == CLAMP:
            cross(t[e], a[e], b[e])
        else:
            if not 1.0 + dot(before.t[e], t[e]) > FOLDED:
                return False
            carry(before.t[e], t[e], before.a[e], q[e, 3], a[e], b[e])
        if e > 0 and not 1.0 + dot(t[e - 1], t[e]) > FOLDED:
            return False
    return True


@compiled
def returned(trial: float, threshold: float, pace: float) -> tuple[float, float]:
    """Return the magnitude e of the elastic strain after yielding, and de/d(`trial`), the trial magnitude.

    `pace` is the rate of the memory times the implicit part of the step: e + pace (e - threshold) = trial
    (docs/model.md eq. 20).
    """
    if trial <= threshold:
        return trial, 1.0
    return (trial + pace * threshold) / (1.0 + pace), 1.0 / (1.0 + pace)


@compiled
def add_edges(
    body: Any, v: Any, axial: Any, implicit: float, t: Any, lengths: Any, memory: Any, R: Any, K: Any, mode: int
) -> None:
    """Add the axial forces to R (n, 4), and their tangent to the band K: all of it (`mode` 1), or without thrust (2).

    With `mode` 0 no tangent is added. The tangent leaves out that the rate of strain changes as an edge with a velocity
    across it turns, because that part is not symmetric.
    """
    pace = body.law[MEMORY_RATE] * implicit
    for e in range(len(body.rest)):
        if body.kind[e] != REAL:
            continue
        strain = lengths[e] / body.rest[e] - 1.0
        trial = strain - axial[e]
        kept, slope = returned(abs(trial), body.law[YIELD_STRETCH], pace)
        memory[e] = strain - np.copysign(kept, trial)
        soft = body.law[SOFTENED]
        rate = 0.0
        for i in range(3):
            rate += (v[e + 1, i] - v[e, i]) * t[e, i] / body.rest[e]
        N = body.law[EA] * (strain - soft * memory[e]) + body.law[AXIAL_DAMPING] * rate
        modulus = body.law[EA] * (1.0 - soft * (1.0 - slope)) + body.law[AXIAL_DAMPING] / implicit
        for i in range(3):
            R[e, i] -= N * t[e, i]
            R[e + 1, i] += N * t[e, i]
        if mode == 0:
            continue
        geometric = (N if mode == 1 else max(N, 0.0)) / lengths[e]
        along = modulus / body.rest[e] - geometric
        dims = min(body.dims, 3)
        for i in range(dims):
            for j in range(dims):
                value = along * t[e, i] * t[e, j] + (geometric if i == j else 0.0)
                add(body, K, e, i, e, j, value)
                add(body, K, e + 1, i, e + 1, j, value)
                add(body, K, e + 1, i, e, j, -value)


@compiled
def add(body: Any, K: Any, node: int, i: int, other: int, j: int, value: float) -> None:
    """Add a value to the lower band K if both coordinates are free."""
    if body.fixed[node, i] or body.fixed[other, j]:
        return
    row, column = node * body.dims + i, other * body.dims + j
    if row >= column:
        K[row, row - column] += value


@compiled
def add_hinges(
    body: Any, v: Any, turn: Any, memory: Any, implicit: float, t: Any, a: Any, b: Any, lengths: Any, tangent_rate: Any,
    turned: Any, remembered: Any, torque: Any, R: Any, K: Any, mode: int,
) -> None:  # fmt: skip
    """Add bend and twist forces to R (n, 4), and their tangent to K: all of it (`mode` 1), or its definite part (2).

    With `mode` 0 no tangent is added. `turn` and `memory` are the twist of the last step and the memory before this
    stage; `turned` and `remembered` are written. `torque` (n - 1, 3) receives the moment taken by each held direction.
    """
    law = body.law
    pace = law[MEMORY_RATE] * implicit
    s, rate, stress = np.empty(3), np.empty(3), np.empty(3)
    trial, elastic = np.empty(3), np.empty(3)
    B, C, H, W = np.empty((3, 8)), np.empty((3, 3)), np.empty((8, 8)), np.empty((11, 8))
    y, g, side = np.empty(8), np.empty(8), np.empty(3)
    full = np.empty((11, 11))
    moment_of = np.empty(3)
    for k in range(len(body.width)):
        e, f = k, k + 1
        w = body.width[k]
        strains(t[e], a[e], b[e], t[f], a[f], b[f], turn[k], s)
        gradients(t[e], a[e], b[e], t[f], a[f], b[f], s, B)
        turned[k] = s[2]
        # memory: the pair of bends returns along its own direction
        for i in range(3):
            s[i] /= w
            trial[i] = s[i] - memory[k, i]
        bent = np.sqrt(trial[0] * trial[0] + trial[1] * trial[1])
        kept, slope = returned(bent, law[YIELD_BEND], pace)
        across = kept / bent if bent > 0.0 else 1.0
        kept_twist, slope_twist = returned(abs(trial[2]), law[YIELD_TWIST], pace)
        elastic[0], elastic[1] = across * trial[0], across * trial[1]
        elastic[2] = np.copysign(kept_twist, trial[2])
        for i in range(3):
            remembered[k, i] = s[i] - elastic[i]
        for part in range(2):
            last, first = (e, 0) if part == 0 else (f, 3)
            if body.kind[last] == REAL:
                for i in range(3):
                    side[i] = v[last + 1, i] - v[last, i]
                along = dot(side, t[last])
                for i in range(3):
                    y[first + i] = (side[i] - along * t[last, i]) / lengths[last]
            else:
                for i in range(3):
                    y[first + i] = tangent_rate[last, i]
            y[6 + part] = v[last, 3]
        for i in range(3):
            modulus = law[EI] if i < 2 else law[GJ]
            viscosity = law[BEND_DAMPING] if i < 2 else law[TWIST_DAMPING]
            rate[i] = 0.0
            for j in range(8):
                rate[i] += B[i, j] * y[j]
            free = body.natural[k, i] + law[SOFTENED] * (remembered[k, i] - body.natural[k, i])
            stress[i] = modulus * (s[i] - free) + viscosity * rate[i] / w
        for j in range(8):
            g[j] = stress[0] * B[0, j] + stress[1] * B[1, j] + stress[2] * B[2, j]
        for part in range(2):
            last, first = (e, 0) if part == 0 else (f, 3)
            along = g[first] * t[last, 0] + g[first + 1] * t[last, 1] + g[first + 2] * t[last, 2]
            if body.kind[last] == REAL:
                for i in range(3):
                    force = (g[first + i] - along * t[last, i]) / lengths[last]
                    R[last, i] -= force
                    R[last + 1, i] += force
            else:
                cross(t[last], g[first : first + 3], moment_of)
                for i in range(3):
                    torque[last, i] += moment_of[i] + g[6 + part] * t[last, i]
            R[last, 3] += g[6 + part]
        if mode == 0:
            continue
        # C = d stress/d strain, divided by w because the strains here are not per length
        soft = law[SOFTENED]
        for i in range(3):
            for j in range(3):
                C[i, j] = 0.0
        for i in range(2):
            for j in range(2):
                direction = trial[i] * trial[j] / (bent * bent) if bent > 0.0 else 0.0
                yields = (1.0 - across) * ((1.0 if i == j else 0.0) - direction) + (1.0 - slope) * direction
                C[i, j] = law[EI] * ((1.0 if i == j else 0.0) - soft * yields) / w
            C[i, i] += law[BEND_DAMPING] / (w * implicit)
        C[2, 2] = law[GJ] * (1.0 - soft * (1.0 - slope_twist)) / w + law[TWIST_DAMPING] / (w * implicit)
        for i in range(8):
            for j in range(8):
                H[i, j] = C[2, 2] * B[2, i] * B[2, j]
                for d in range(2):
                    H[i, j] += B[d, i] * (C[d, 0] * B[0, j] + C[d, 1] * B[1, j])
        if mode == 1:
            add_curvature_of_strains(t[e], a[e], b[e], t[f], a[f], b[f], s * w, B, stress, H)
        _to_edges(body, e, t, lengths, g, H, mode)
        _add_full(body, k, H, W, full, K)


@compiled
def _to_edges(body: Any, e: int, t: Any, lengths: Any, g: Any, H: Any, mode: int) -> None:
    """Turn H (8, 8), with respect to the tangents, into one with respect to the edge vectors, in place.

    To second order, eta = P de/l - ((t.de) P de + t |P de|^2/2)/l^2.
    """
    for part in range(2):
        last, o = e + part, 3 * part
        scale = 1.0 / lengths[last] if body.kind[last] == REAL else 0.0
        for j in range(8):
            along = H[o, j] * t[last, 0] + H[o + 1, j] * t[last, 1] + H[o + 2, j] * t[last, 2]
            for i in range(3):
                H[o + i, j] = scale * (H[o + i, j] - along * t[last, i])
        for j in range(8):
            along = H[j, o] * t[last, 0] + H[j, o + 1] * t[last, 1] + H[j, o + 2] * t[last, 2]
            for i in range(3):
                H[j, o + i] = scale * (H[j, o + i] - along * t[last, i])
        if mode == 1:
            along = g[o] * t[last, 0] + g[o + 1] * t[last, 1] + g[o + 2] * t[last, 2]
            for i in range(3):
                for j in range(3):
                    gi, gj = g[o + i] - along * t[last, i], g[o + j] - along * t[last, j]
                    P = (1.0 if i == j else 0.0) - t[last, i] * t[last, j]
                    H[o + i, o + j] -= scale * scale * (gi * t[last, j] + t[last, i] * gj + along * P)


@compiled
def _add_full(body: Any, k: int, H: Any, W: Any, full: Any, K: Any) -> None:
    """Add H (8, 8), by the two edges and their spins, to the band K of the coordinates of three nodes."""
    for j in range(8):
        for i in range(3):
            W[i, j] = -H[i, j]
            W[3 + i, j] = H[i, j] - H[3 + i, j]
            W[6 + i, j] = H[3 + i, j]
        W[9, j], W[10, j] = H[6, j], H[7, j]
    for j in range(11):
        for i in range(3):
            full[j, i] = -W[j, i]
            full[j, 3 + i] = W[j, i] - W[j, 3 + i]
            full[j, 6 + i] = W[j, 3 + i]
        full[j, 9], full[j, 10] = W[j, 6], W[j, 7]
    for i in range(11):
        node, d = (k + i // 3, i % 3) if i < 9 else (k + i - 9, 3)
        if d >= body.dims:
            continue
        for j in range(11):
            other, c = (k + j // 3, j % 3) if j < 9 else (k + j - 9, 3)
            if c < body.dims:
                add(body, K, node, d, other, c, full[i, j])


@compiled
def add_drag(body: Any, v: Any, implicit: float, R: Any, K: Any, mode: int) -> None:
    """Add the drag of the nodes and of the spins of the edges (docs/model.md eq. 8)."""
    c, c2 = body.law[DRAG], body.law[DRAG_QUADRATIC]
    for e in range(len(body.rest) if body.dims == 4 else 0):
        spins = c * body.law[GYRATION] ** 2 * body.rest[e]
        R[e, 3] += spins * v[e, 3]
        if mode != 0:
            add(body, K, e, 3, e, 3, spins / implicit)
    for n in range(len(body.cell)):
        speed = np.sqrt(v[n, 0] ** 2 + v[n, 1] ** 2 + v[n, 2] ** 2)
        for i in range(3):
            R[n, i] += body.cell[n] * (c + c2 * speed) * v[n, i]
        if mode == 0:
            continue
        turn = c2 / speed if speed > 0.0 else 0.0
        for i in range(min(body.dims, 3)):
            add(body, K, n, i, n, i, body.cell[n] * (c + c2 * speed) / implicit)
            for j in range(i + 1):
                add(body, K, n, i, n, j, body.cell[n] * turn * v[n, i] * v[n, j] / implicit)


@compiled
def add_contact(
    body: Any, q: Any, v: Any, anchor: Any, implicit: float, slipped: Any, R: Any, K: Any, mode: int
) -> float:
    """Add the forces of surfaces on the points of the cable, with friction; return the largest depth [m].

    `anchor` (p, 3) is the displacement from the anchors before the implicit part of this stage; `slipped` is written.
    """
    law = body.law
    n, most, x, u = np.empty(3), np.zeros(3), np.empty(3), np.empty(3)
    force, drawn, tangent, own = np.empty(3), np.empty(3), np.empty((3, 3)), np.empty((3, 3))
    deepest = 0.0
    for p in range(len(body.point_edge)):
        e, s = body.point_edge[p], body.point_along[p]
        length = body.point_length[p]
        for i in range(3):
            x[i] = (1.0 - s) * q[e, i] + s * q[e + 1, i]
            u[i] = (1.0 - s) * v[e, i] + s * v[e + 1, i]
            force[i] = 0.0
            most[i] = 0.0
            for j in range(3):
                tangent[i, j] = 0.0
        lies = body.point_lies[p]
        limit = law[LYING] if lies else 0.0
        for m in range(0 if lies else len(body.surfaces)):
            depth = law[RADIUS] - gap(body.surfaces[m], x, n)
            if depth <= 0.0:
                continue
            deepest = max(deepest, depth)
            N, by_depth, by_speed = press(law[STIFFNESS], law[PASSAGE], law[CONTACT_DAMPING], depth, -dot(n, u))
            for i in range(3):
                force[i] += N * n[i]
                for j in range(3):
                    tangent[i, j] += (by_depth + by_speed / implicit) * n[i] * n[j]
            if body.surfaces[m, FRICTION] * N > limit:
                limit = body.surfaces[m, FRICTION] * N
                for i in range(3):
                    most[i] = n[i]
        if limit > 0.0:
            for i in range(3):
                slipped[p, i] = anchor[p, i] + implicit * u[i]
            rub(limit, most, slipped[p], u, law[STICK], law[DENSITY], implicit, drawn, own)
            for i in range(3):
                force[i] += drawn[i]
                for j in range(3):
                    tangent[i, j] += own[i, j]
        else:
            for i in range(3):
                slipped[p, i] = 0.0
        for i in range(3):
            R[e, i] -= (1.0 - s) * length * force[i]
            R[e + 1, i] -= s * length * force[i]
        if mode == 0:
            continue
        for i in range(min(body.dims, 3)):
            for j in range(min(body.dims, 3)):
                value = length * tangent[i, j]
                add(body, K, e, i, e, j, (1.0 - s) * (1.0 - s) * value)
                add(body, K, e + 1, i, e + 1, j, s * s * value)
                add(body, K, e + 1, i, e, j, s * (1.0 - s) * value)
    return deepest


@compiled
def goes_through(body: Any, q: Any, after: Any) -> bool:
    """Tell whether a point of the cable passes through a solid on its straight path from q to `after` (n, 4).

    It does if it is nearer to the middle of the solid than to its surface on the path, and leaves it again: no step
    that sees the solid takes such a path.
    """
    n, x, y, z = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for p in range(len(body.point_edge)):
        e, s = body.point_edge[p], body.point_along[p]
        way = 0.0
        for i in range(3):
            x[i] = (1.0 - s) * q[e, i] + s * q[e + 1, i]
            y[i] = (1.0 - s) * after[e, i] + s * after[e + 1, i]
            way += (y[i] - x[i]) ** 2
        way = np.sqrt(way)
        for m in range(0 if body.point_lies[p] else len(body.surfaces)):
            thick = body.law[RADIUS] + thickness(body.surfaces[m])
            begin = gap(body.surfaces[m], x, n) - body.law[RADIUS]
            if not begin - way < -0.5 * thick:
                continue
            end = gap(body.surfaces[m], y, n) - body.law[RADIUS]
            looks = int(min(8.0 * way / thick, 1e4)) + 2
            for k in range(1, looks):
                for i in range(3):
                    z[i] = x[i] + (y[i] - x[i]) * k / looks
                here = gap(body.surfaces[m], z, n) - body.law[RADIUS]
                if here < -0.5 * thick and here < min(begin, end) - 0.05 * thick:
                    return True
    return False
