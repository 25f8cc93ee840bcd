"""Compiled normal equations of the space-time least squares, over all collocation points."""

from typing import Any, NamedTuple

import numpy as np

from dlocore.compiling.kernel import brief, kernel, leaf
from dlocore.effects.laws import has_viscosity
from dlocore.kernels.assembly import NO_RATES, add_scalar_band, assemble, history_at, multiply_scalar_band
from dlocore.kernels.banded import reduce_matrix, reduce_vector, solve_rows
from dlocore.kernels.basis import GAUSS_2, basis_rows, row_of
from dlocore.kernels.narrow import ROOM, factor_step, solve_step
from dlocore.kernels.strain import squared_slope

POINTS = 2  # collocation points in each time span


class Equations(NamedTuple):
    """The equations of motion at the collocation points of a window.

    Attributes:
        axes: (0, 1), (0, 1, 2) or (0, 1, 2, 3).
        first, table: (k,), (k, 3, 4): time basis functions and two derivatives at the points, POINTS in each span.
        weights: (k,) [s].
        h: length of a time span [s].
        density: factor of the mass matrix [kg/m].
        dragged: coefficient of linear drag [N s/m^2] without point masses, where the drag matrix is proportional to the
            mass matrix.
        beside: the same coefficient with point masses; one of the two is zero.
        tables: `basis.Tables`.
        active, p: switches and parameters of the laws.
        histories: `History` with arrays (1 or k, ...), what earlier steps left behind at each point.
        applied: (1 or k, n, nc) [N].
        e: elimination of the held degrees of freedom.
    """

    axes: Any
    first: Any
    table: Any
    weights: Any
    h: float
    density: float
    dragged: float
    beside: float
    tables: Any
    active: Any
    p: Any
    histories: Any
    applied: Any
    e: Any


@brief
def collocation(knots: Any) -> Any:
    """Return the Gauss points of the time spans between `knots` [s].

    Returns:
        the points (k,) [s], POINTS in each span, their weights (k,) [s], first control points (k,) and basis functions
        with two derivatives (k, 3, 4) there; and evenly spaced times (6 k / POINTS + 1,) from the first to the last
        knot.
    """
    times, weights = np.empty(POINTS * len(knots)), np.empty(POINTS * len(knots))
    k = 0
    for s in range(len(knots) - 1):
        half = 0.5 * (knots[s + 1] - knots[s])
        for g in range(POINTS if half > 0.0 else 0):
            times[k], weights[k] = knots[s] + half * (1.0 + GAUSS_2[0][g]), half * GAUSS_2[1][g]
            k += 1
    first, table = basis_rows(knots, times[:k], 2)
    even = np.linspace(knots[0], knots[-1], 6 * (k // POINTS) + 1)
    return times[:k].copy(), weights[:k].copy(), first, table, even


@leaf
def _strain(points: Any, n: int, q: Any) -> float:
    """Return the axial strain of control points q (n, nc) at the n-th axial point."""
    row = row_of(points.b1, n)
    return np.sqrt(squared_slope(q, points.first[n], row, min(q.shape[1], 3))) - 1.0


@kernel
def resting_strains(
    times: Any, states: Any, at: Any, tables: Any, behind: Any, stiffness: float, viscosity: float, soft: float
) -> Any:
    """Return `behind` with stress-free strains for which a softer cable has the tension of a march.

    At the strain e the tension is then N_m + EA_b (e - e_m), where the march has the strain e_m and, including the
    damping of stretch, the tension N_m (docs/model.md eq. 15b).

    Args:
        times, states: of the march, (s,) [s] and (s, n, nc).
        at: (k,) [s].
        tables: `basis.Tables`.
        behind: `History.axial` of the march at these times (1 or k, points, 3).
        stiffness, viscosity: EA [N] and damping of stretch [N s] in the march.
        soft: EA_b [N].
    """
    out = np.empty((len(at), behind.shape[1], 3))
    for k in range(len(at)):
        s = min(max(np.searchsorted(times, at[k], side="right") - 1, 0), len(times) - 2)
        h = times[s + 1] - times[s]
        share = (at[k] - times[s]) / h
        axial = behind[min(k, len(behind) - 1)]
        for n in range(behind.shape[1]):
            before, after = _strain(tables.axial, n, states[s]), _strain(tables.axial, n, states[s + 1])
            strain = (1.0 - share) * before + share * after
            tension = stiffness * (strain - axial[n, 0]) + viscosity * (after - before) / h
            out[k, n, 0], out[k, n, 1], out[k, n, 2] = strain - tension / soft, axial[n, 1], axial[n, 2]
    return out


@leaf
def band_to_dense(A: Any, out: Any) -> None:
    """Write the symmetric banded A (n, width) as a full matrix (n, n)."""
    n, width = A.shape
    out[:] = 0.0
    for j in range(n):
        for o in range(min(width, n - j)):
            out[j + o, j] = A[j, o]
            out[j, j + o] = A[j, o]


class Sparse(NamedTuple):
    """A symmetric matrix: its diagonal (n,), and row, column and value (m,) of each nonzero entry right of it."""

    diagonal: Any
    row: Any
    column: Any
    value: Any


@kernel
def _sparse(A: Any) -> Any:
    """Return the symmetric banded A (n, width) as `Sparse`."""
    n, width = A.shape
    row, column, value = np.empty(n * width, np.int64), np.empty(n * width, np.int64), np.empty(n * width)
    k = 0
    for j in range(n):
        for o in range(1, min(width, n - j)):
            if A[j, o] != 0.0:
                row[k], column[k], value[k] = j, j + o, A[j, o]
                k += 1
    return Sparse(A[:, 0].copy(), row[:k].copy(), column[:k].copy(), value[:k].copy())


@leaf
def _times(B: Any, x: Any, out: Any) -> None:
    """Write B x (n,) for a `Sparse` B."""
    for j in range(len(B.diagonal)):
        out[j] = B.diagonal[j] * x[j]
    for k in range(len(B.value)):
        i, j, s = B.row[k], B.column[k], B.value[k]
        out[i] += s * x[j]
        out[j] += s * x[i]


@leaf
def _times_rows(B: Any, X: Any, out: Any) -> None:
    """Write B X (n, m) for a `Sparse` B."""
    n, m = X.shape
    for j in range(n):
        s = B.diagonal[j]
        for c in range(m):
            out[j, c] = s * X[j, c]
    for k in range(len(B.value)):
        i, j, s = B.row[k], B.column[k], B.value[k]
        for c in range(m):
            out[i, c] += s * X[j, c]
        for c in range(m):
            out[j, c] += s * X[i, c]


@leaf
def _products(X: Any, Y: Any, out: Any) -> None:
    """Write X' Y (m, m).

    Four rows are added at a time, to pass over the result less often. Rows are computed in full even where the result
    is symmetric: half rows that begin anywhere take longer up to 40 columns, and hardly less beyond.
    """
    n, m = X.shape
    out[:] = 0.0
    for r in range(0, n - n % 4, 4):
        y0, y1, y2, y3 = Y[r], Y[r + 1], Y[r + 2], Y[r + 3]
        for i in range(m):
            row = out[i]
            s0, s1, s2, s3 = X[r, i], X[r + 1, i], X[r + 2, i], X[r + 3, i]
            for j in range(m):
                row[j] += s0 * y0[j] + s1 * y1[j] + s2 * y2[j] + s3 * y3[j]
    for r in range(n - n % 4, n):
        for i in range(m):
            s = X[r, i]
            for j in range(m):
                out[i, j] += s * Y[r, j]


@leaf
def states_at(first: Any, table: Any, C: Any, out: Any) -> None:
    """Write q, v and a (3, n, nc) of control points C (n_t, n, nc) by the time basis `table` (3, 4) from `first` on."""
    for o in range(3):
        b0, b1, b2, b3 = table[o, 0], table[o, 1], table[o, 2], table[o, 3]
        for i in range(out.shape[1]):
            for d in range(out.shape[2]):
                out[o, i, d] = (
                    b0 * C[first, i, d] + b1 * C[first + 1, i, d] + b2 * C[first + 2, i, d] + b3 * C[first + 3, i, d]
                )


@leaf
def _add_inertia(eq: Any, k: int, state: Any, moved: Any, f: Any) -> None:
    """Add inertia, linear drag and applied forces at point k to the internal forces f (n, nc) [N]."""
    load = eq.applied[min(k, len(eq.applied) - 1)]
    for i in range(f.shape[0]):
        for d in range(f.shape[1]):
            f[i, d] -= load[i, d]
            moved[i, d] = eq.density * state[2, i, d] + eq.dragged * state[1, i, d]
    multiply_scalar_band(eq.tables.inertia, moved, 1.0, f)
    if eq.beside > 0.0:
        multiply_scalar_band(eq.tables.unit, state[1], eq.beside, f)


@kernel
def holding_forces(eq: Any, C: Any) -> Any:
    """Return the reaction forces (k, held) [N] at the collocation points, and the states (k, n, nc) [m] there."""
    nc, n, held = len(eq.axes), C.shape[1], eq.e.held
    forces, states = np.empty((len(eq.first), len(held))), np.empty((len(eq.first), n, nc))
    f, K, moved, state = np.empty((n, nc)), np.empty((1, 1)), np.empty((n, nc)), np.empty((3, n, nc))
    for k in range(len(eq.first)):
        states_at(eq.first[k], eq.table[k], C, state)
        history = history_at(eq.histories, k)
        assemble(eq.axes, state[0], state[1], eq.tables, eq.active, eq.p, history, NO_RATES, (0.0, 0.0, 0.0), f, K)
        _add_inertia(eq, k, state, moved, f)
        states[k] = state[0]
        for i in range(len(held)):
            forces[k, i] = f[held[i] // nc, held[i] % nc]
    return forces, states


@kernel
def normal_equations(eq: Any, C: Any, A: Any, right: Any, matrix: bool, begin: int, end: int) -> float:
    """Add time spans to the normal equations of the weighted least squares at C; return their part of the objective.

    The objective [J] is (1/T) sum_k w_k |W_k Z' R_k|^2, with the residual R = M a + C v + f(q, v) - F of the motion at
    the collocation point k and W'W = G^-1 B G^-1, B = 12/h^2 M + 2/h C, G = B + K+ + 2/h N (docs/model.md eq. 16, where
    N is V).

    Mass, and linear drag where it is not part of N, belong to B. With K+ = G - B - 2/h N, the derivative with
    respect to the control point of the time basis function c is G^-1 dR = c I + d S + e V, with S = G^-1 B, V = G^-1 N
    and numbers d and e. So the products of three matrices serve all pairs of control points; B S and S' B S are
    symmetric. The right side alone needs no products: S' y = B G^-1 y.

    Args:
        eq: `Equations`.
        C: control points (n_t, n, nc) [m]; the first two are given.
        A, right: normal matrix, (n_t - 2, free, 4 free), see `blocks.py`, and right side; both are added to.
        matrix: whether A is wanted; otherwise it is left unchanged.
        begin, end: range of the time spans to add.
    """
    nc, n, e, h = len(eq.axes), C.shape[1], eq.e, eq.h
    size = n * nc
    free = size - len(e.held)
    f, moved, state = np.empty((n, nc)), np.empty((n, nc)), np.empty((3, n, nc))
    K = np.zeros((size, 4 * nc))
    G, N, band = np.zeros((free + ROOM, e.width)), np.zeros((free, e.width)), np.empty((free, e.width))
    weight = 12.0 / (h * h) * eq.density + 2.0 / h * eq.dragged
    add_scalar_band(nc, eq.tables.inertia, weight, K)
    reduce_matrix(e, K, band)
    B = _sparse(band)
    many = free if matrix else 0
    dense, S = np.empty((many, many)), np.empty((many, many))
    P, Q = np.empty((POINTS, many, many)), np.empty((POINTS, many, many))
    if matrix:
        band_to_dense(band, dense)
    viscous = has_viscosity(eq.active) or eq.beside > 0.0
    wide = many if viscous else 0
    V, BV, SBV, VBV = np.empty((wide, wide)), np.empty((wide, wide)), np.empty((wide, wide)), np.empty((wide, wide))
    r, y, Bz, Nz = np.zeros(free + ROOM), np.empty(free), np.empty(free), np.zeros(free)  # S' y and V' y
    parts = np.empty((POINTS, 4, 3))
    objective = 0.0
    total = np.sum(eq.weights)
    for k in range(POINTS * begin, POINTS * end):
        states_at(eq.first[k], eq.table[k], C, state)
        q, v = state[0], state[1]
        history = history_at(eq.histories, k)
        assemble(eq.axes, q, v, eq.tables, eq.active, eq.p, history, NO_RATES, (1.0, 0.0, 0.0), f, K)
        reduce_matrix(e, K, G[:free])
        for i in range(free):
            for o in range(e.width):
                G[i, o] += band[i, o]
        if viscous:
            assemble(eq.axes, q, v, eq.tables, eq.active, eq.p, history, NO_RATES, (0.0, 1.0, 0.0), f, K)
            add_scalar_band(nc, eq.tables.unit, eq.beside, K)
            reduce_matrix(e, K, N)
            for i in range(free):
                for o in range(e.width):
                    G[i, o] += 2.0 / h * N[i, o]
        factor_step(G, free)
        _add_inertia(eq, k, state, moved, f)
        reduce_vector(e, f.ravel(), r[:free])
        solve_step(G, free, r)
        _times(B, r, y)
        share = eq.weights[k] / total
        for c in range(free):
            objective += share * r[c] * y[c]
            r[c] = y[c]
        solve_step(G, free, r)
        _times(B, r, Bz)
        if viscous:
            _times(_sparse(N), r, Nz)
        at = k % POINTS
        for j in range(4):
            cj, dj, ej = _parts(eq.table[k, :, j], eq.density / weight, eq.dragged / weight, h)
            parts[at, j, 0], parts[at, j, 1], parts[at, j, 2] = cj, dj, ej
            row = (eq.first[k] + j - 2) * free
            for c in range(free if row >= 0 else 0):
                right[row + c] += share * (cj * y[c] + dj * Bz[c] + ej * Nz[c])
        if not matrix:
            continue
        S[:] = dense
        solve_rows(G[:free], S)
        _times_rows(B, S, P[at])
        _products(S, P[at], Q[at])
        if viscous:
            band_to_dense(N, V)
            solve_rows(G[:free], V)
            _times_rows(B, V, BV)
            _products(S, BV, SBV)
            _products(V, BV, VBV)
            _add_viscous(A, eq.first[k] - 2, share, parts[at], BV, SBV, VBV)
        if at == POINTS - 1:
            _add_span(A, eq.first[k] - 2, eq.weights[k + 1 - POINTS : k + 1] / total, parts, dense, P, Q)
    return objective


@leaf
def _parts(basis: Any, mass: float, drag: float, h: float) -> tuple[float, float, float]:
    """Return c, d and e of G^-1 dR = c I + d S + e V for `basis` (3,), a basis function and its derivatives.

    `mass` and `drag` are the density and the drag coefficient divided by that of B.
    """
    return basis[0], mass * basis[2] + drag * basis[1] - basis[0], basis[1] - 2.0 / h * basis[0]


@leaf
def _add_span(A: Any, t: int, shares: Any, parts: Any, B: Any, P: Any, Q: Any) -> None:
    """Add the contribution of the two points of a span to the blocks of its four control points, from unknown t on.

    P and Q (2, free, free) are B S and S' B S at the points.
    """
    free = len(B)
    s0, s1 = shares
    for j in range(max(0, -t), 4):
        for i in range(j, 4):
            (c0, d0), (c1, d1) = (parts[0, j, 0], parts[0, j, 1]), (parts[1, j, 0], parts[1, j, 1])
            (g0, h0), (g1, h1) = (parts[0, i, 0], parts[0, i, 1]), (parts[1, i, 0], parts[1, i, 1])
            both = s0 * c0 * g0 + s1 * c1 * g1
            p0, p1 = s0 * (c0 * h0 + d0 * g0), s1 * (c1 * h1 + d1 * g1)
            q0, q1 = s0 * d0 * h0, s1 * d1 * h1
            for c in range(free):
                row = A[t + j, c, (i - j) * free : (i - j + 1) * free]
                b, pa, pb, qa, qb = B[c], P[0, c], P[1, c], Q[0, c], Q[1, c]
                for d in range(free):
                    row[d] += both * b[d] + p0 * pa[d] + p1 * pb[d] + q0 * qa[d] + q1 * qb[d]


@kernel
def _add_viscous(A: Any, t: int, share: float, parts: Any, BV: Any, SBV: Any, VBV: Any) -> None:
    """Add the contribution of damping at a point, in the same way as `_add_span`."""
    free = len(BV)
    VB, VBS = BV.T.copy(), SBV.T.copy()
    for j in range(max(0, -t), 4):
        for i in range(j, 4):
            ce, ec, ee = share * parts[j, 0] * parts[i, 2], share * parts[j, 2] * parts[i, 0], parts[j, 2] * parts[i, 2]
            de, ed = share * parts[j, 1] * parts[i, 2], share * parts[j, 2] * parts[i, 1]
            ee *= share
            for c in range(free):
                row = A[t + j, c, (i - j) * free : (i - j + 1) * free]
                a, at, b, bt, w = BV[c], VB[c], SBV[c], VBS[c], VBV[c]
                for d in range(free):
                    row[d] += ce * a[d] + ec * at[d] + de * b[d] + ed * bt[d] + ee * w[d]
