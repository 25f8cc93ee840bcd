"""Compiled blocks of the space-time least squares: residuals and normal equations over all collocation points."""

from typing import Any

import numpy as np

from dlocore.effects.laws import has_viscosity
from dlocore.kernels.assembly import NO_RATES, add_scalar_band, assemble, history_at, multiply_scalar_band
from dlocore.kernels.banded import factor, reduce_matrix, reduce_vector, solve_rows
from dlocore.kernels.compile import kernel


@kernel
def band_to_dense(A: Any, out: Any) -> None:
    """Write the symmetric banded A (n, width) as a full matrix (n, n)."""
    n, width = A.shape
    out[:] = 0.0
    for j in range(n):
        for o in range(min(width, n - j)):
            out[j + o, j] = A[j, o]
            out[j, j + o] = A[j, o]


@kernel
def _times_band(B: Any, X: Any, out: Any) -> None:
    """Write B X (n, m) for the symmetric banded B (n, width)."""
    n, width = B.shape
    m = X.shape[1]
    out[:] = 0.0
    for j in range(n):
        s = B[j, 0]
        for c in range(m):
            out[j, c] += s * X[j, c]
        for i in range(1, min(width, n - j)):
            s = B[j, i]
            for c in range(m):
                out[j, c] += s * X[j + i, c]
            for c in range(m):
                out[j + i, c] += s * X[j, c]


@kernel
def _products(X: Any, Y: Any, symmetric: bool, out: Any) -> None:
    """Write X' Y (m, m), of which half is computed where it is symmetric.

    Four rows at a time, to pass less often over the result.
    """
    n, m = X.shape
    out[:] = 0.0
    for r in range(0, n - n % 4, 4):
        y0, y1, y2, y3 = Y[r], Y[r + 1], Y[r + 2], Y[r + 3]
        for i in range(m):
            row = out[i]
            s0, s1, s2, s3 = X[r, i], X[r + 1, i], X[r + 2, i], X[r + 3, i]
            for j in range(i if symmetric else 0, m):
                row[j] += s0 * y0[j] + s1 * y1[j] + s2 * y2[j] + s3 * y3[j]
    for r in range(n - n % 4, n):
        for i in range(m):
            s = X[r, i]
            for j in range(i if symmetric else 0, m):
                out[i, j] += s * Y[r, j]
    if symmetric:
        for i in range(m):
            for j in range(i):
                out[i, j] = out[j, i]


@kernel
def states_at(first: Any, table: Any, C: Any, out: Any) -> None:
    """Write q, v and a (3, n, nc) of the control points C (n_t, n, nc) with basis `table` (3, 4) from `first`."""
    out[:] = 0.0
    for o in range(3):
        for j in range(4):
            s = table[o, j]
            for i in range(out.shape[1]):
                for d in range(out.shape[2]):
                    out[o, i, d] += s * C[first + j, i, d]


@kernel
def normal_equations(
    axes: Any, C: Any, first: Any, table: Any, weights: Any, h: float, unit: Any, density: float, dragged: float,
    tables: Any, active: Any, p: Any, histories: Any, applied: Any, e: Any, A: Any, right: Any, forces: Any,
    matrix: bool, begin: int, end: int,
) -> float:  # fmt: skip
    """Add points to the normal equations of the weighted least squares at C; return their part of the objective [J].

    The objective is (1/T) sum_k w_k |W_k Z' R_k|^2 with the residual R = M a + C v + f(q, v) - F of the motion at the
    collocation point k and W'W = G^-1 B G^-1, B = 12/h^2 M + 2/h C, G = B + K+ + 2/h N (docs/model.md eq. 16).

    Masses and linear drag are parts of B, and K+ = G - B - 2/h N, so that by the control point with basis function c
    G^-1 dR = c I + d S + e V, with S = G^-1 B, V = G^-1 N and numbers d, e. The products of three matrices serve all
    pairs of control points, and B S and S' B S are symmetric. The right side alone takes none: S' y = B G^-1 y.

    Args:
        axes: (0, 1), (0, 1, 2) or (0, 1, 2, 3).
        C: control points (n_t, n, nc) [m]; the first two are given.
        first, table: (k,), (k, 3, 4): time basis functions and two derivatives at the collocation points.
        weights: (k,) [s].
        h: length of a time span [s].
        unit: (n, 4) mass matrix of unit density; `density` [kg/m] and `dragged` [N s/m^2] are those of the cable.
        histories: `History` with arrays (1 or k, ...), what lies behind each collocation point.
        applied: (1 or k, n, nc) [N].
        e: elimination of the held degrees of freedom.
        A, right: normal matrix, banded ((n_t - 2) free, 4 free), and right side, which are added to.
        forces: (k, held) residual at the held degrees of freedom: the forces that hold them [N]; written.
        matrix: whether A is wanted; else it is left alone.
        begin, end: collocation points to add.
    """
    nc = len(axes)
    n = C.shape[1]
    size = n * nc
    free = size - len(e.held)
    f = np.empty((n, nc))
    full = np.zeros((size, 4 * nc))
    K = np.empty((size, 4 * nc))
    N, B, G = np.empty((free, e.width)), np.empty((free, e.width)), np.empty((free, e.width))
    weight = 12.0 / (h * h) * density + 2.0 / h * dragged
    add_scalar_band(nc, unit, weight, full)
    reduce_matrix(e, full, B)
    many = free if matrix else 0
    S, P, Q = np.empty((many, many)), np.empty((many, many)), np.empty((many, many))
    dense = np.empty((many, many))
    if matrix:
        band_to_dense(B, dense)
    viscous = has_viscosity(active)
    wide = many if viscous else 0
    V, BV, SBV, VBV = np.empty((wide, wide)), np.empty((wide, wide)), np.empty((wide, wide)), np.empty((wide, wide))
    r, y, z = np.empty((free, 1)), np.empty((free, 1)), np.empty((free, 1))
    Bz, Nz = np.empty((free, 1)), np.zeros((free, 1))  # S' y and V' y
    state = np.empty((3, n, nc))
    objective = 0.0
    total = np.sum(weights)
    for k in range(begin, end):
        states_at(first[k], table[k], C, state)
        q, v, a = state[0], state[1], state[2]
        history = history_at(histories, k)
        assemble(axes, q, v, tables, active, p, history, NO_RATES, (1.0, 0.0, 0.0), f, K)
        reduce_matrix(e, K, G)
        G += B
        if viscous:
            assemble(axes, q, v, tables, active, p, history, NO_RATES, (0.0, 1.0, 0.0), f, K)
            reduce_matrix(e, K, N)
            G += 2.0 / h * N
        factor(G)
        multiply_scalar_band(unit, a, density, f)
        multiply_scalar_band(unit, v, dragged, f)
        f -= applied[min(k, len(applied) - 1)]
        for i in range(len(e.held)):
            forces[k, i] = f[e.held[i] // nc, e.held[i] % nc]
        reduce_vector(e, f.ravel(), r[:, 0])
        solve_rows(G, r)
        _times_band(B, r, y)
        share = weights[k] / total
        objective += share * np.sum(r * y)
        z[:] = y
        solve_rows(G, z)
        _times_band(B, z, Bz)
        if viscous:
            _times_band(N, z, Nz)
        for j in range(4):
            column = (first[k] + j - 2) * free
            if column < 0:
                continue
            cj, dj, ej = _parts(table[k, :, j], density / weight, dragged / weight, h)
            for c in range(free):
                right[column + c] += share * (cj * y[c, 0] + dj * Bz[c, 0] + ej * Nz[c, 0])
        if not matrix:
            continue
        S[:] = dense
        solve_rows(G, S)
        _times_band(B, S, P)
        _products(S, P, True, Q)
        if viscous:
            band_to_dense(N, V)
            solve_rows(G, V)
            _times_band(B, V, BV)
            _products(S, BV, False, SBV)
            _products(V, BV, True, VBV)
        for j in range(4):
            column = (first[k] + j - 2) * free
            if column < 0:
                continue
            cj, dj, ej = _parts(table[k, :, j], density / weight, dragged / weight, h)
            for i in range(j, 4):
                ci, di, ei = _parts(table[k, :, i], density / weight, dragged / weight, h)
                cc, cd, dd = share * cj * ci, share * (cj * di + dj * ci), share * dj * di
                shift = (i - j) * free
                for c in range(free):
                    first_d = c if i == j else 0
                    row = A[column + c, shift - c + first_d : shift - c + free]
                    Bc, Pc, Qc = dense[c, first_d:], P[c, first_d:], Q[c, first_d:]
                    for d in range(len(row)):
                        row[d] += cc * Bc[d] + cd * Pc[d] + dd * Qc[d]
                if viscous:
                    ce, ec, ee = share * cj * ei, share * ej * ci, share * ej * ei
                    de, ed = share * dj * ei, share * ej * di
                    for c in range(free):
                        for d in range(c if i == j else 0, free):
                            value = ce * BV[c, d] + ec * BV[d, c] + de * SBV[c, d] + ed * SBV[d, c] + ee * VBV[c, d]
                            A[column + c, shift + d - c] += value
    return objective


@kernel
def _parts(basis: Any, mass: float, drag: float, h: float) -> tuple[float, float, float]:
    """Return c, d and e of G^-1 dR = c I + d S + e V for `basis` (3,), a basis function and its derivatives.

    `mass` and `drag` are density and drag coefficient over that of B.
    """
    return basis[0], mass * basis[2] + drag * basis[1] - basis[0], basis[1] - 2.0 / h * basis[0]
