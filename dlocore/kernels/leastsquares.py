"""Compiled blocks of the space-time least squares: residuals and normal equations over all collocation points."""

from typing import Any

import numpy as np

from dlocore.effects.laws import has_viscosity
from dlocore.kernels.assembly import NO_RATES, add_scalar_band, assemble, history_at, multiply_scalar_band
from dlocore.kernels.banded import factor, reduce_matrix, reduce_vector
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
def solve_rows(A: Any, X: Any) -> None:
    """Solve L D L' X = B in place for the rows of X (n, m), with the factors of `factor`."""
    n, width = A.shape
    m = X.shape[1]
    for j in range(n):
        for i in range(1, min(width, n - j)):
            s = A[j, i]
            for c in range(m):
                X[j + i, c] -= s * X[j, c]
    for j in range(n - 1, -1, -1):
        s = 1.0 / A[j, 0]
        for c in range(m):
            X[j, c] *= s
        for i in range(1, min(width, n - j)):
            s = A[j, i]
            for c in range(m):
                X[j, c] -= s * X[j + i, c]


@kernel
def _times_root(B: Any, X: Any) -> None:
    """Replace X (n, m) by D^1/2 L' X with the factors L D L' = B of `factor`."""
    n, width = B.shape
    m = X.shape[1]
    for j in range(n):
        for i in range(1, min(width, n - j)):
            s = B[j, i]
            for c in range(m):
                X[j, c] += s * X[j + i, c]
        s = np.sqrt(B[j, 0])
        for c in range(m):
            X[j, c] *= s


@kernel
def _gram(X: Any, Y: Any, out: Any) -> None:
    """Write X' Y."""
    n, m = X.shape
    out[:] = 0.0
    for r in range(n):
        for i in range(m):
            s = X[r, i]
            for j in range(m):
                out[i, j] += s * Y[r, j]


@kernel
def _add_transposed(X: Any, r: Any, out: Any) -> None:
    """Add X' r for r (n, 1)."""
    for i in range(X.shape[0]):
        s = r[i, 0]
        for c in range(X.shape[1]):
            out[c] += s * X[i, c]


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
    axes: Any, C: Any, first: Any, table: Any, weights: Any, h: float, mass: Any, drag: Any, tables: Any, active: Any,
    p: Any, histories: Any, applied: Any, e: Any, geometric: float, A: Any, right: Any, forces: Any, tangent: bool,
    begin: int, end: int,
) -> float:  # fmt: skip
    """Add points to the normal equations of the weighted least squares at C; return their part of the objective [J].

    The objective is (1/T) sum_k w_k |W_k Z' R_k|^2 with the residual R = M a + C v + f(q, v) - F of the motion at the
    collocation point k and W'W = G^-1 B G^-1, B = 12/h^2 M + 2/h C, G = B + K+ (docs/model.md eq. 16).

    Args:
        axes: (0, 1) or (0, 1, 2).
        C: control points (n_t, n, nc) [m]; the first two are given.
        first, table: (k,), (k, 3, 4): time basis functions and two derivatives at the collocation points.
        weights: (k,) [s].
        h: length of a time span [s].
        mass, drag: scalar bands (n, 4) times density and drag coefficient.
        histories: `History` with arrays (1 or k, ...), what lies behind each collocation point.
        applied: (1 or k, n, nc) [N].
        e: elimination of the held degrees of freedom.
        geometric: 1 for the full tangent in the Jacobian, 0 for its positive semidefinite part.
        A, right: normal matrix, banded ((n_t - 2) free, 4 free), and right side, which are added to; untouched where
            `tangent` is False.
        forces: (k, held) residual at the held degrees of freedom: the forces that hold them [N]; written.
        tangent: whether A and right are wanted.
        begin, end: collocation points to add.
    """
    nc = len(axes)
    n = C.shape[1]
    size = n * nc
    free = size - len(e.held)
    f = np.empty((n, nc))
    full = np.zeros((size, 4 * nc))
    K = np.empty((size, 4 * nc))
    Kr = np.empty((free, e.width))
    Mr = np.empty((free, e.width))
    Nr = np.empty((free, e.width))
    B = np.empty((free, e.width))
    G = np.empty((free, e.width))
    add_scalar_band(nc, mass, 1.0, full)
    reduce_matrix(e, full, Mr)
    full[:] = 0.0
    add_scalar_band(nc, drag, 1.0, full)
    reduce_matrix(e, full, Nr)
    B0 = 12.0 / (h * h) * Mr + 2.0 / h * Nr
    B[:] = B0
    factor(B)
    Md = np.empty((free, free))
    Nd = np.empty((free, free))
    band_to_dense(Mr, Md)
    band_to_dense(Nr, Nd)
    X, Y, Z = np.empty((free, free)), np.empty((free, free)), np.empty((free, free))
    XX, XZ, ZZ = np.empty((free, free)), np.empty((free, free)), np.empty((free, free))
    XY, YY, YZ = np.empty((free, free)), np.empty((free, free)), np.empty((free, free))
    gradient = np.empty((3, free))
    r = np.empty((free, 1))
    state = np.empty((3, n, nc))
    viscous = has_viscosity(active)
    objective = 0.0
    total = np.sum(weights)
    for k in range(begin, end):
        states_at(first[k], table[k], C, state)
        q, v, a = state[0], state[1], state[2]
        history = history_at(histories, k)
        assemble(axes, q, v, tables, active, p, history, NO_RATES, (1.0, 0.0, 0.0), f, K)
        reduce_matrix(e, K, Kr)
        G[:] = B0 + Kr
        if viscous:
            assemble(axes, q, v, tables, active, p, history, NO_RATES, (0.0, 1.0, 0.0), f, K)
            reduce_matrix(e, K, Nr)
            G += 2.0 / h * Nr
            if tangent:
                band_to_dense(Nr, Y)
                Y += Nd
        if tangent and geometric != 0.0:
            assemble(axes, q, v, tables, active, p, history, NO_RATES, (1.0, 0.0, 1.0), f, K)
            reduce_matrix(e, K, Kr)
        factor(G)
        multiply_scalar_band(mass, a, 1.0, f)
        multiply_scalar_band(drag, v, 1.0, f)
        f -= applied[min(k, len(applied) - 1)]
        for i in range(len(e.held)):
            forces[k, i] = f[e.held[i] // nc, e.held[i] % nc]
        reduce_vector(e, f.ravel(), r[:, 0])
        solve_rows(G, r)
        _times_root(B, r)
        share = weights[k] / total
        objective += share * np.sum(r * r)
        if not tangent:
            continue
        X[:] = Md
        band_to_dense(Kr, Z)
        solve_rows(G, X)
        solve_rows(G, Z)
        _times_root(B, X)
        _times_root(B, Z)
        # J_j = a_j X + b_j Y + c_j Z: the products of the three matrices serve all pairs of time basis functions.
        # Without viscous laws the damping matrix is proportional to the mass matrix, and Y is merged into X.
        _gram(X, X, XX)
        _gram(X, Z, XZ)
        _gram(Z, Z, ZZ)
        gradient[:] = 0.0
        _add_transposed(X, r, gradient[0])
        _add_transposed(Z, r, gradient[2])
        if viscous:
            solve_rows(G, Y)
            _times_root(B, Y)
            _gram(X, Y, XY)
            _gram(Y, Y, YY)
            _gram(Y, Z, YZ)
            _add_transposed(Y, r, gradient[1])
        merged = 0.0 if viscous else drag[0, 0] / mass[0, 0]
        for j in range(4):
            column = (first[k] + j - 2) * free
            if column < 0:
                continue
            aj, bj, cj = table[k, 2, j] + merged * table[k, 1, j], table[k, 1, j], table[k, 0, j]
            for c in range(free):
                right[column + c] += share * (aj * gradient[0, c] + bj * gradient[1, c] + cj * gradient[2, c])
            for i in range(j, 4):
                ai, bi, ci = table[k, 2, i] + merged * table[k, 1, i], table[k, 1, i], table[k, 0, i]
                shift = (i - j) * free
                aa, ac, ca, cc = share * aj * ai, share * aj * ci, share * cj * ai, share * cj * ci
                for c in range(free):
                    for d in range(c if i == j else 0, free):
                        A[column + c, shift + d - c] += aa * XX[c, d] + ac * XZ[c, d] + ca * XZ[d, c] + cc * ZZ[c, d]
                if viscous:
                    ab, ba, bb = share * aj * bi, share * bj * ai, share * bj * bi
                    bc, cb = share * bj * ci, share * cj * bi
                    for c in range(free):
                        for d in range(c if i == j else 0, free):
                            value = ab * XY[c, d] + ba * XY[d, c] + bb * YY[c, d] + bc * YZ[c, d] + cb * YZ[d, c]
                            A[column + c, shift + d - c] += value
    return objective
