"""The tangent of the assembly with twist, for a group of spans that is already measured, see `twisted.py`."""

from typing import Any

from dlocore.compiling.kernel import law, leaf, part
from dlocore.effects.base import Vector
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
    added,
    at,
    over,
    put,
    put_vector,
    vector_at,
)
from dlocore.kernels.strands import dot
from dlocore.kernels.twisted_rows import (
    AA,
    AB,
    AC,
    ALONG,
    B1,
    B2,
    BB,
    BC,
    BY_FIRST,
    CC,
    K1,
    K2,
    KAPPA,
    LEAN,
    LENGTH,
    M1,
    M2,
    MEAN,
    NOW,
    OF_MEAN,
    OF_SLOPE,
    RISE,
    S11,
    S12,
    S22,
    SPIN,
    STIFF,
    TORQUE,
    derivatives,
)


@leaf
def tangent_of(inverse: float, geometric: float, W: Any) -> None:
    """Write the tangents of the points by r', r'' and theta, without the stiffness of the twist rate."""
    for n in range(LANES):
        length, h, k1, k2 = at(W, LENGTH, n), at(W, ALONG, n), at(W, K1, n), at(W, K2, n)
        t, kappa, spin = vector_at(W, NOW, n), vector_at(W, KAPPA, n), vector_at(W, SPIN, n)
        m1, m2 = vector_at(W, M1, n), vector_at(W, M2, n)
        S11_, S22_, S12_ = at(W, S11, n), at(W, S22, n), at(W, S12, n)
        a, b, T = geometric * at(W, B1, n), geometric * at(W, B2, n), geometric * at(W, TORQUE, n)
        O1, P1 = derivatives(length, h, m1, k2, spin, -k1, t)
        O2, P2 = derivatives(length, h, m2, -k1, spin, -k2, t)
        A1, A2 = inverse * k2, -inverse * k1
        SO1, SO2 = _combined(S11_, O1, S12_, O2), _combined(S12_, O1, S22_, O2)
        SP1, SP2 = _combined(S11_, P1, S12_, P2), _combined(S12_, P1, S22_, P2)
        M, N = _combined(a, m1, b, m2), _combined(a, m2, -b, m1)  # N = t x M
        over_l = 1.0 / length
        scale, turn, along, work = over_l * over_l, inverse * over_l, h * over_l, a * k1 + b * k2
        binormal = (
            t[1] * kappa[2] - t[2] * kappa[1], t[2] * kappa[0] - t[0] * kappa[2], t[0] * kappa[1] - t[1] * kappa[0],
        )  # fmt: skip
        u = _combined(1.0, _combined(1.5 * work, t, 2.0 * along, M), -1.5 * T, binormal)
        u, M = (scale * u[0], scale * u[1], scale * u[2]), (scale * M[0], scale * M[1], scale * M[2])
        half, minus = (-0.5 * M[0], -0.5 * M[1], -0.5 * M[2]), 0.5 * scale * T
        put(W, BB, n, _entry(0, 0, t, u, half, kappa, O1, SO1, O2, SO2) - scale * work)
        put(W, BB + 1, n, _entry(1, 0, t, u, half, kappa, O1, SO1, O2, SO2))
        put(W, BB + 2, n, _entry(2, 0, t, u, half, kappa, O1, SO1, O2, SO2))
        put(W, BB + 3, n, _entry(1, 1, t, u, half, kappa, O1, SO1, O2, SO2) - scale * work)
        put(W, BB + 4, n, _entry(2, 1, t, u, half, kappa, O1, SO1, O2, SO2))
        put(W, BB + 5, n, _entry(2, 2, t, u, half, kappa, O1, SO1, O2, SO2) - scale * work)
        put(W, BC, n, _mixed(0, 0, t, M, O1, SP1, O2, SP2))
        put(W, BC + 1, n, _mixed(0, 1, t, M, O1, SP1, O2, SP2) - minus * t[2])
        put(W, BC + 2, n, _mixed(0, 2, t, M, O1, SP1, O2, SP2) + minus * t[1])
        put(W, BC + 3, n, _mixed(1, 0, t, M, O1, SP1, O2, SP2) + minus * t[2])
        put(W, BC + 4, n, _mixed(1, 1, t, M, O1, SP1, O2, SP2))
        put(W, BC + 5, n, _mixed(1, 2, t, M, O1, SP1, O2, SP2) - minus * t[0])
        put(W, BC + 6, n, _mixed(2, 0, t, M, O1, SP1, O2, SP2) - minus * t[1])
        put(W, BC + 7, n, _mixed(2, 1, t, M, O1, SP1, O2, SP2) + minus * t[0])
        put(W, BC + 8, n, _mixed(2, 2, t, M, O1, SP1, O2, SP2))
        put(W, CC, n, P1[0] * SP1[0] + P2[0] * SP2[0])
        put(W, CC + 1, n, P1[1] * SP1[0] + P2[1] * SP2[0])
        put(W, CC + 2, n, P1[2] * SP1[0] + P2[2] * SP2[0])
        put(W, CC + 3, n, P1[1] * SP1[1] + P2[1] * SP2[1])
        put(W, CC + 4, n, P1[2] * SP1[1] + P2[2] * SP2[1])
        put(W, CC + 5, n, P1[2] * SP1[2] + P2[2] * SP2[2])
        by_first = _combined(-turn * along, N, -turn * dot(N, kappa), t)
        put_vector(W, AB, n, _combined(1.0, _combined(A1, SO1, A2, SO2), 1.0, by_first))
        put_vector(W, AC, n, _combined(1.0, _combined(A1, SP1, A2, SP2), turn, N))
        put(W, AA, n, S11_ * A1 * A1 + 2.0 * S12_ * A1 * A2 + S22_ * A2 * A2 - inverse * inverse * work)


@law
def _combined(x: float, a: Vector, y: float, b: Vector) -> Vector:
    return x * a[0] + y * b[0], x * a[1] + y * b[1], x * a[2] + y * b[2]


@law
def _entry(
    d: int, e: int, t: Vector, u: Vector, half: Vector, kappa: Vector, O1: Vector, SO1: Vector, O2: Vector, SO2: Vector
) -> float:
    """Return t u' + u t' + half kappa' + kappa half' + O1 SO1' + O2 SO2' at d, e."""
    geometric = t[d] * u[e] + u[d] * t[e] + half[d] * kappa[e] + kappa[d] * half[e]
    return geometric + O1[d] * SO1[e] + O2[d] * SO2[e]


@law
def _mixed(d: int, e: int, t: Vector, M: Vector, O1: Vector, SP1: Vector, O2: Vector, SP2: Vector) -> float:
    """Return O1 SP1' + O2 SP2' - t M' - M t' at d, e."""
    return O1[d] * SP1[e] + O2[d] * SP2[e] - M[d] * t[e] - t[d] * M[e]


@leaf
def twist_tangent(T: Any, inverse: float, W: Any) -> None:
    """Write the stiffness of the twist rate of each span, and its derivatives with respect to the control points.

    With the stiffnesses S of the points and their distances x from the middle, the energy of the mean m and the slope a
    of the twist rate is sum S (m + x a)^2/2. It is the sum of the energies of m + LEAN a and of a alone, with LEAN =
    sum S x/sum S.
    """
    for s in range(SPANS):
        stiff, lever = added(W, STIFF, s), over(T, LEVER, W, STIFF, s)
        x0, x1, x2 = at(T, LEVER, s), at(T, LEVER, SPANS + s), at(T, LEVER, 2 * SPANS + s)
        square = x0 * x0 * at(W, STIFF, s) + x1 * x1 * at(W, STIFF, SPANS + s) + x2 * x2 * at(W, STIFF, 2 * SPANS + s)
        lean = lever / stiff if stiff != 0.0 else 0.0
        W[OF_MEAN + s], W[LEAN + s], W[OF_SLOPE + s] = stiff, lean, square - lean * lever
    _twist_by(0, T, inverse, W)
    _twist_by(1, T, inverse, W)
    _twist_by(2, T, inverse, W)
    _twist_by(3, T, inverse, W)


@part
def _twist_by(i: int, T: Any, inverse: float, W: Any) -> None:
    """Write the derivatives of the twist rates of the spans with respect to their i-th control points."""
    for s in range(SPANS):
        _put_twist(i, 0, s, _twist_of(i, 0, 0, T, W, s), _twist_of(i, 0, 1, T, W, s), _twist_of(i, 0, 2, T, W, s), T, W)
        _put_twist(i, 1, s, _twist_of(i, 1, 0, T, W, s), _twist_of(i, 1, 1, T, W, s), _twist_of(i, 1, 2, T, W, s), T, W)
        _put_twist(i, 2, s, _twist_of(i, 2, 0, T, W, s), _twist_of(i, 2, 1, T, W, s), _twist_of(i, 2, 2, T, W, s), T, W)
        b0, b1, b2 = at(T, FIRSTS + i, s), at(T, FIRSTS + i, SPANS + s), at(T, FIRSTS + i, 2 * SPANS + s)
        _put_twist(i, 3, s, inverse * b0, inverse * b1, inverse * b2, T, W)


@law
def _twist_of(i: int, d: int, m: int, T: Any, W: Any, s: int) -> float:
    """Return the derivative of the twist rate of point m with respect to coordinate d of the i-th control point."""
    n = SPANS * m + s
    return at(T, FIRSTS + i, n) * at(W, BY_FIRST + d, n) + at(T, SECONDS + i, n) * at(W, SPIN + d, n) / at(W, LENGTH, n)


@law
def _put_twist(i: int, d: int, s: int, x0: float, x1: float, x2: float, T: Any, W: Any) -> None:
    """Write the derivatives of the mean and the slope of a span from those of its points."""
    mean = at(T, SHARE, s) * x0 + at(T, SHARE, SPANS + s) * x1 + at(T, SHARE, 2 * SPANS + s) * x2
    rise = at(T, SLOPE, s) * x0 + at(T, SLOPE, SPANS + s) * x1 + at(T, SLOPE, 2 * SPANS + s) * x2
    W[MEAN + (4 * i + d) * SPANS + s] = mean + W[LEAN + s] * rise
    W[RISE + (4 * i + d) * SPANS + s] = rise


@leaf
def add_blocks(first: Any, count: int, group: int, T: Any, W: Any, block: Any, K: Any) -> None:
    """Add the tangents of a group of spans to the band K (4 n, 16)."""
    for j in range(4):
        for i in range(j, 4):
            _block(T[i * LANES :], T[j * LANES :], W[4 * i * SPANS :], W[4 * j * SPANS :], W, block)
            _scatter_block(i, j, first, count, group, block, K)


@leaf
def _block(Ti: Any, Tj: Any, Wi: Any, Wj: Any, W: Any, block: Any) -> None:
    """Write the blocks (16 SPANS,) of the tangents of the spans between their control points i and j.

    Row 4 e + d is the entry of coordinate d of i and e of j. The tables and the derivatives of the twist rate begin at
    the rows of i and of j.
    """
    for s in range(SPANS):
        _column(0, Ti, Tj, Wi, Wj, W, block, s)
        _column(1, Ti, Tj, Wi, Wj, W, block, s)
        _column(2, Ti, Tj, Wi, Wj, W, block, s)
        angular = _of_angles(0, Ti, Tj, W, s) + _of_angles(1, Ti, Tj, W, s) + _of_angles(2, Ti, Tj, W, s)
        block[15 * SPANS + s] = angular + _of_twist(3, 3, Wi, Wj, W, s)


@law
def _column(e: int, Ti: Any, Tj: Any, Wi: Any, Wj: Any, W: Any, block: Any, s: int) -> None:
    """Write the entries of a block for coordinate e of the centreline."""
    block[4 * e * SPANS + s] = _of_place(0, e, Ti, Tj, W, s) + _of_twist(0, e, Wi, Wj, W, s)
    block[(4 * e + 1) * SPANS + s] = _of_place(1, e, Ti, Tj, W, s) + _of_twist(1, e, Wi, Wj, W, s)
    block[(4 * e + 2) * SPANS + s] = _of_place(2, e, Ti, Tj, W, s) + _of_twist(2, e, Wi, Wj, W, s)
    below = _of_angle(e, 0, Ti, Tj, W, s) + _of_angle(e, 1, Ti, Tj, W, s) + _of_angle(e, 2, Ti, Tj, W, s)
    above = _of_angle(e, 0, Tj, Ti, W, s) + _of_angle(e, 1, Tj, Ti, W, s) + _of_angle(e, 2, Tj, Ti, W, s)
    block[(4 * e + 3) * SPANS + s] = below + _of_twist(3, e, Wi, Wj, W, s)
    block[(12 + e) * SPANS + s] = above + _of_twist(e, 3, Wi, Wj, W, s)


@law
def _of_place(d: int, e: int, Ti: Any, Tj: Any, W: Any, s: int) -> float:
    """Return the entry of coordinates d and e of the centreline."""
    own = _of_point(d, e, 0, Ti, Tj, W, s) + _of_point(d, e, 1, Ti, Tj, W, s)
    return own + _of_point(d, e, 2, Ti, Tj, W, s)


@law
def _of_point(d: int, e: int, m: int, Ti: Any, Tj: Any, W: Any, s: int) -> float:
    n, least = SPANS * m + s, min(d, e)
    symmetric = least * (5 - least) // 2 + max(d, e)
    b, c = at(Tj, FIRSTS, n), at(Tj, SECONDS, n)
    first = at(W, BB + symmetric, n) * b + at(W, BC + 3 * d + e, n) * c
    second = at(W, BC + 3 * e + d, n) * b + at(W, CC + symmetric, n) * c
    return at(Ti, FIRSTS, n) * first + at(Ti, SECONDS, n) * second


@law
def _of_angle(e: int, m: int, Ti: Any, Tj: Any, W: Any, s: int) -> float:
    """Return the share of point m in the entry of the angle of i and coordinate e of j."""
    n = SPANS * m + s
    return at(Ti, VALUES, n) * (at(W, AB + e, n) * at(Tj, FIRSTS, n) + at(W, AC + e, n) * at(Tj, SECONDS, n))


@law
def _of_angles(m: int, Ti: Any, Tj: Any, W: Any, s: int) -> float:
    n = SPANS * m + s
    return at(W, AA, n) * at(Ti, VALUES, n) * at(Tj, VALUES, n)


@law
def _of_twist(d: int, e: int, Wi: Any, Wj: Any, W: Any, s: int) -> float:
    """Return the part of an entry that comes from the stiffness of the twist rate."""
    a, b = d * SPANS + s, e * SPANS + s
    return W[OF_MEAN + s] * Wi[MEAN + a] * Wj[MEAN + b] + W[OF_SLOPE + s] * Wi[RISE + a] * Wj[RISE + b]


@part
def _scatter_block(i: int, j: int, first: Any, count: int, group: int, block: Any, K: Any) -> None:
    """Add the blocks of a group of spans between their control points i >= j to the band K."""
    band = K.reshape(K.size)
    for s in range(count):
        entries = band[64 * (first[POINTS * (SPANS * group + s)] + j) + 4 * (i - j) :]
        if i == j:
            for e in range(4):
                for d in range(e, 4):
                    entries[15 * e + d] += block[(4 * e + d) * SPANS + s]
        else:
            for e in range(4):
                for d in range(4):
                    entries[15 * e + d] += block[(4 * e + d) * SPANS + s]
