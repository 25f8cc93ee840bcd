"""Assembly in space: three coordinates, and a curvature vector perpendicular to the tangent.

The axial and body sites also serve four coordinates, `nc` = 4 (`twisted.py`).
"""

from typing import Any

import numpy as np

from dlocore.compiling.kernel import law, leaf, part
from dlocore.effects.base import Symmetric, Vector
from dlocore.effects.laws import (
    DAMPING,
    STRETCH_DAMPING,
    axial_energy,
    axial_stress,
    body_force,
    curvature_energy,
    curvature_stress,
)
from dlocore.kernels.basis import row_of
from dlocore.kernels.bishop import BEND, LENGTH, STATE, TANGENT, H, carry, rate_by_steps, rate_by_velocity, torques
from dlocore.kernels.pairs import BB, BC, CB, CC, PAIRS, SUMS, add_point, add_span
from dlocore.kernels.strain import space_curvature, space_curvature_rate, space_moment, vector
from dlocore.kernels.tension import AT_HAND, MODULUS, assumed

STRAIGHT = (0.0, 0.0, 0.0)  # the stress-free curvature without a twist coordinate
# Workspace of an assembly: the blocks of a point and the sums of a span, see `pairs.py`, which are zero at the start
# because a span clears its sums; and the numbers for each curvature point.
ROOM, ROOM_OF_POINT = 9 * (SUMS + PAIRS), 3 * STATE


@law
def combine(q: Any, k: int, b: tuple[float, float, float, float]) -> Vector:
    """Return the first three coordinates of the combination of four control points from k on."""
    x = b[0] * q[k, 0] + b[1] * q[k + 1, 0] + b[2] * q[k + 2, 0] + b[3] * q[k + 3, 0]
    y = b[0] * q[k, 1] + b[1] * q[k + 1, 1] + b[2] * q[k + 2, 1] + b[3] * q[k + 3, 1]
    z = b[0] * q[k, 2] + b[1] * q[k + 1, 2] + b[2] * q[k + 2, 2] + b[3] * q[k + 3, 2]
    return x, y, z


@law
def add_symmetric(nc: int, K: Any, k: int, i: int, j: int, s: float, H: Symmetric) -> None:
    """Add s H to the block of control points k + i and k + j, i >= j."""
    column, offset = nc * (k + j), nc * (i - j)
    K[column, offset] += s * H[0]
    K[column, offset + 1] += s * H[3]
    K[column, offset + 2] += s * H[4]
    K[column + 1, offset] += s * H[1]
    K[column + 1, offset + 1] += s * H[5]
    K[column + 2, offset] += s * H[2]
    if i > j:
        K[column + 1, offset - 1] += s * H[3]
        K[column + 2, offset - 2] += s * H[4]
        K[column + 2, offset - 1] += s * H[5]


@part
def axial(
    nc: int, q: Any, v: Any, points: Any, active: Any, p: Any, past: Any, kept: Any, rates: Any, scales: Any,
    tangent: bool, f: Any, K: Any,
) -> None:  # fmt: skip
    """Add the forces and tangents of the axial site.

    `past` holds the stress-free strain and the strain of the last two steps; `kept` is `History.tension`.
    """
    elastic, viscous, geometric = scales
    if viscous != 0.0 and rates[0] != 0.0:
        viscous = rates[0]
    firsts, b1, weights = points.first, points.b1, points.w
    for n in range(len(weights)):
        k, w = firsts[n], weights[n]
        b = row_of(b1, n)
        x, y, z = combine(q, k, b)
        length = np.sqrt(x * x + y * y + z * z)
        inverse = 1.0 / length
        strain, rate = length - 1.0, 0.0
        if active[STRETCH_DAMPING] and rates[0] != 0.0:
            rate = rates[0] * strain + rates[1] * past[n, 1] + rates[2] * past[n, 2]
        elif active[STRETCH_DAMPING]:
            vx, vy, vz = combine(v, k, b)
            rate = (x * vx + y * vy + z * vz) * inverse
        tension, modulus, viscosity = axial_stress(
            active, p, strain, rate, past[n, 0], past[n, 1], rates[3], points.share[n]
        )
        if len(kept) > 0:
            kept[n, AT_HAND], kept[n, MODULUS] = tension, modulus + rates[0] * viscosity
        g = w * tension * inverse
        for i in range(4):
            f[k + i, 0] += b[i] * g * x
            f[k + i, 1] += b[i] * g * y
            f[k + i, 2] += b[i] * g * z
        if tangent:
            # the part due to the stress is positive only in tension
            pull = assumed(kept, n, tension) if geometric != 0.0 else tension
            stress = w * (geometric * pull if geometric != 0.0 else elastic * max(pull, 0.0)) * inverse
            s = (w * (elastic * modulus + viscous * viscosity) - stress) * inverse * inverse
            H = (s * x * x + stress, s * y * y + stress, s * z * z + stress, s * x * y, s * x * z, s * y * z)
            for j in range(4):
                for i in range(j, 4):
                    add_symmetric(nc, K, k, i, j, b[i] * b[j], H)


@leaf
def _write_state(q: Any, points: Any, state: Any) -> None:
    """Write l, h, t and kappa of the curvature points (points, 8)."""
    for n in range(len(state)):
        k = points.first[n]
        a, c = combine(q, k, row_of(points.b1, n)), combine(q, k, row_of(points.b2, n))
        length, h, t, kappa = space_curvature(a, c)
        state[n, LENGTH], state[n, H] = length, h
        for d in range(3):
            state[n, TANGENT + d], state[n, BEND + d] = t[d], kappa[d]


@leaf
def _write_rate(v: Any, points: Any, state: Any, turning: Any, rate: Any) -> None:
    """Write the rate of the tangent, and that of the curvature seen by sections that do not spin (points, 3)."""
    for n in range(len(state)):
        k = points.first[n]
        a, c = combine(v, k, row_of(points.b1, n)), combine(v, k, row_of(points.b2, n))
        length, t = state[n, LENGTH], vector(state, n, TANGENT)
        change = space_curvature_rate(length, state[n, H], t, vector(state, n, BEND), a, c)
        along = a[0] * t[0] + a[1] * t[1] + a[2] * t[2]
        for d in range(3):
            turning[n, d] = (a[d] - along * t[d]) / length
            rate[n, d] = change[d]


@leaf
def curvature(
    q: Any, v: Any, points: Any, active: Any, p: Any, past: Any, rates: Any, scales: Any, tangent: bool, room: Any,
    f: Any, K: Any,
) -> None:  # fmt: skip
    """Add the forces and tangents of the curvature site; `past` holds kappa of two steps and t of the last (points, 9).

    The derivatives of kappa with respect to r' and r'' are J = -h P / l^2 - kappa t' / l and P / l. The material part
    of the tangent is J' S J, where S is a number, P kappa = kappa and P t = 0; the geometric part is M . d2kappa. Two
    parts of damping are in the forces only: the dependence on the spin of the sections, which couples the whole cable,
    and the torque that keeps the sections from twisting. `room` is that of a `History`.
    """
    damped = len(points.w) if active[DAMPING] else 0
    blocks = room[:ROOM].reshape(SUMS + PAIRS, 9)
    rows = room[ROOM:].reshape((len(room) - ROOM) // STATE, STATE)
    state, rate, by_torque = rows[:damped], rows[damped : 2 * damped], rows[2 * damped : 3 * damped]
    elastic, viscous, geometric = scales
    if viscous != 0.0 and rates[0] != 0.0:
        viscous = rates[0]
    firsts, b1, b2, weights = points.first, points.b1, points.b2, points.w
    pairs = points.pairs
    if damped:
        _write_state(q, points, state)
        if rates[0] != 0.0:
            rate_by_steps(weights, state, past, rates, rate)
        else:
            _write_rate(v, points, state, by_torque, rate)
            rate_by_velocity(weights, state, by_torque, rate)
        torques(weights, state, p[DAMPING, 0], rate, by_torque)
    for n in range(len(weights)):
        k, w = firsts[n], weights[n]
        b, c = row_of(b1, n), row_of(b2, n)
        change = (0.0, 0.0, 0.0)
        if damped:
            length, h, t, kappa = state[n, LENGTH], state[n, H], vector(state, n, TANGENT), vector(state, n, BEND)
            change = vector(rate, n, 0)
            for i in range(4):
                for d in range(3):
                    f[k + i, d] += b[i] * by_torque[n, d]
        else:
            length, h, t, kappa = space_curvature(combine(q, k, b), combine(q, k, c))
        M, stiffness, viscosity = curvature_stress(active, p, kappa, change, STRAIGHT, STRAIGHT, STRAIGHT, 0.0)
        g, u = space_moment(length, h, t, kappa, M)
        for i in range(4):
            bi, ci = w * b[i], w * c[i]
            f[k + i, 0] += bi * g[0] + ci * u[0]
            f[k + i, 1] += bi * g[1] + ci * u[1]
            f[k + i, 2] += bi * g[2] + ci * u[2]
        if not tangent:
            continue
        # sections without orientation are alike in all directions across the tangent: J' J is enough
        stiff = w * (elastic * stiffness[0] + viscous * viscosity[0]) / (length * length)
        scale = w * geometric / (length * length)
        along = h / length
        dot = M[0] * kappa[0] + M[1] * kappa[1] + M[2] * kappa[2]
        square = kappa[0] * kappa[0] + kappa[1] * kappa[1] + kappa[2] * kappa[2]
        of_one = stiff * along * along - scale * dot
        of_tangent = stiff * (square - along * along) + 3.0 * scale * dot
        for d in range(3):
            for e in range(3):
                Mt = scale * (M[d] * t[e] + t[d] * M[e])
                across = -t[d] * t[e]
                by_first = -of_tangent * across + stiff * along * (kappa[d] * t[e] + t[d] * kappa[e])
                by_first += 2.0 * along * Mt - 0.5 * scale * (M[d] * kappa[e] + kappa[d] * M[e])
                if d == e:
                    across += 1.0
                    by_first += of_one
                at = 3 * e + d
                blocks[BB, at] = by_first
                blocks[BC, at] = -stiff * (along * across + t[d] * kappa[e]) - Mt
                blocks[CB, at] = -stiff * (along * across + kappa[d] * t[e]) - Mt
                blocks[CC, at] = stiff * across
        add_point(blocks, pairs[n])
        if n + 1 == len(weights) or firsts[n + 1] != k:
            add_span(3, K, k, blocks)


@leaf
def remember(q: Any, points: Any, past: Any, room: Any) -> None:
    """Make kappa and t of q the last ones in `past` (points, 9), and the last kappa, carried along, the one before."""
    count = len(past)
    rows = room[ROOM:].reshape((len(room) - ROOM) // STATE, STATE)
    state, before = rows[:count], rows[count : 2 * count]
    _write_state(q, points, state)
    carry(points.w, state, past, 1.0, 1.0, 0.0, before)
    for n in range(count):
        for d in range(3):
            past[n, 3 + d] = before[n, d]
            past[n, d] = state[n, BEND + d]
            past[n, 6 + d] = state[n, TANGENT + d]


@part
def body(nc: int, q: Any, v: Any, points: Any, active: Any, p: Any, scales: Any, tangent: bool, f: Any, K: Any) -> None:
    """Subtract the forces, and add the tangents, of the body site."""
    elastic, viscous, _ = scales
    firsts, b0, weights = points.first, points.b0, points.w
    for n in range(len(weights)):
        k, w = firsts[n], weights[n]
        b = row_of(b0, n)
        force, S, V = body_force(active, p, combine(q, k, b), combine(v, k, b))
        for i in range(4):
            f[k + i, 0] -= w * b[i] * force[0]
            f[k + i, 1] -= w * b[i] * force[1]
            f[k + i, 2] -= w * b[i] * force[2]
        if tangent:
            H = (
                elastic * S[0] + viscous * V[0], elastic * S[1] + viscous * V[1], elastic * S[2] + viscous * V[2],
                elastic * S[3] + viscous * V[3], elastic * S[4] + viscous * V[4], elastic * S[5] + viscous * V[5],
            )  # fmt: skip
            for j in range(4):
                for i in range(j, 4):
                    add_symmetric(nc, K, k, i, j, w * b[i] * b[j], H)


@leaf
def axial_energies(q: Any, points: Any, active: Any, p: Any, past: Any) -> float:
    """Return the stored energy of the axial site [J]."""
    total = 0.0
    for n in range(len(points.w)):
        x, y, z = combine(q, points.first[n], row_of(points.b1, n))
        strain = np.sqrt(x * x + y * y + z * z) - 1.0
        total += points.w[n] * axial_energy(active, p, strain, past[n, 0])
    return total


@leaf
def energy(q: Any, points: Any, active: Any, p: Any) -> float:
    """Return the stored energy of the curvature site [J]."""
    total = 0.0
    for n in range(len(points.w)):
        k = points.first[n]
        a = combine(q, k, row_of(points.b1, n))
        kappa = space_curvature(a, combine(q, k, row_of(points.b2, n)))[3]
        total += points.w[n] * curvature_energy(active, p, kappa, STRAIGHT)
    return total
