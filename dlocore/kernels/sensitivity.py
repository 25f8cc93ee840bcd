"""Follow a motion next to a marched one: the same steps, with the factors of the known motion.

The derivative of a motion with respect to a parameter is the difference of two neighbouring motions. They are so close
that the factorised tangent of the known motion serves all their Newton steps: no tangent is assembled or factored. They
are followed to rounding; a march with its own tolerance could not tell them apart.
"""

from typing import Any

import numpy as np

from dlocore.compiling.kernel import kernel
from dlocore.effects.laws import DAMPING, keeps_history
from dlocore.kernels.assembly import assemble, remember
from dlocore.kernels.banded import expand_vector, factor, place_held, reduce_matrix, reduce_vector, solve
from dlocore.kernels.inertia import both_sides, effective, padded, residual
from dlocore.kernels.mixing import mixed, room
from dlocore.kernels.newmark import coefficients

_ITERATIONS = 40


@kernel
def newmark(rho: float, h: float, late: bool) -> Any:
    """Return (alpha_m, alpha_f, gamma, to_a, to_v, carry) of a step, as in `march_steps` without forces that jump.

    The step is of generalised alpha, or if `late` of backward Euler.
    """
    if late:
        return 0.0, 0.0, 1.0, 1.0 / (h * h), 1.0 / h, 0.0
    alpha_m, alpha_f, gamma, beta = coefficients(rho, False)
    return alpha_m, alpha_f, gamma, 1.0 / (beta * h * h), gamma / (beta * h), 0.5 / beta - 1.0


@kernel
def factor_steps(
    axes: Any, jumps: bool, h: float, rho: float, Q: Any, v: Any, a: Any, density: float, dragged: float, tables: Any,
    active: Any, p: Any, history: Any, e: Any, factors: Any,
) -> int:  # fmt: skip
    """Write the factors (steps, free, e.width) of the tangent of every step of a marched motion Q (steps + 1, n, nc).

    v, a (n, nc) and `history` are those of its first state; on return, of its last. If the motion `jumps` there, the
    first step is by backward Euler. Where a tangent is not positive definite, its positive semidefinite part is used.

    Returns:
        the number of steps where that was the case, or -1 if even that part could not be factored.
    """
    nc = len(axes)
    n = Q.shape[1]
    size = n * nc
    K = np.empty((size, 4 * nc))
    f = np.empty((n, nc))
    v1 = np.empty((n, nc))
    keeps = keeps_history(active)
    softened = 0
    for k in range(1, len(Q)):
        al_m, al_f, gm, ta, tv, carry = newmark(rho, h, jumps and k == 1)
        q0, q1 = Q[k - 1], Q[k]
        rates = (1.5 / h, -2.0 / h, 0.5 / h, h) if k > 1 else (1.0 / h, -1.0 / h, 0.0, h)
        for i in range(n):
            for d in range(nc):
                after = ta * (q1[i, d] - q0[i, d] - h * v[i, d]) - carry * a[i, d]
                v1[i, d] = v[i, d] + h * ((1.0 - gm) * a[i, d] + gm * after)
                a[i, d] = after
        for attempt in range(3):
            geometric = 1.0 if attempt == 0 else 0.0
            assemble(axes, q1, v1, tables, active, p, history, rates, (1.0, tv, geometric), f, K)
            share = 1.0 - al_f
            effective(nc, K, tables.inertia, tables.unit, (1.0 - al_m) * ta * density, share, share * tv * dragged)
            if attempt == 2:
                for i in range(size):
                    K[i, 0] *= 1.0 + 1e-10
            reduce_matrix(e, K, factors[k - 1])
            if factor(factors[k - 1]) < 0:
                break
            softened += attempt == 0
            if attempt == 2:
                return -1
        v[:] = v1
        if keeps:
            remember(axes, q1, tables, active, p, history, h, False)
    return softened


@kernel
def follow_steps(
    axes: Any, jumps: bool, h: float, rho: float, tolerance: float, known: Any, factors: Any, Q: Any, v: Any, a: Any,
    G: Any, density: float, dragged: float, tables: Any, active: Any, p: Any, history: Any, applied: Any, e: Any,
    offsets: Any,
) -> float:  # fmt: skip
    """Write to Q (steps + 1, n, nc) the neighbouring motion of the `known` one that starts at Q[0].

    The equations are those of `march_steps` with the arguments of the neighbouring motion; `factors` are those of
    `factor_steps` for the known motion. v, a, G (n, nc) and `history` are those of its first state; on return, of its
    last.

    Returns:
        the largest update [m] left at the end of a step's iteration, infinite where one did not converge.
    """
    nc = len(axes)
    n = Q.shape[1]
    size = n * nc
    K = np.empty((1, 1))
    f = np.empty((n, nc))
    R = np.empty((n, nc))
    heavy, rows, stacked = both_sides(tables.inertia), both_sides(tables.unit), padded(n, nc)
    v1 = np.empty((n, nc))
    a1 = np.empty((n, nc))
    q1 = np.empty((n, nc))
    x = np.empty(size - len(e.held))
    change = np.empty(size)
    keeps = keeps_history(active)
    mixes = nc == 3 and bool(active[DAMPING])  # the tangent is incomplete
    mixing, differences = room(len(x) if mixes else 0), -1
    worst = 0.0
    for k in range(1, len(Q)):
        al_m, al_f, gm, ta, _, carry = newmark(rho, h, jumps and k == 1)
        load = applied[min(k, len(applied) - 1)]
        q0 = Q[k - 1]
        rates = (1.5 / h, -2.0 / h, 0.5 / h, h) if k > 1 else (1.0 / h, -1.0 / h, 0.0, h)
        for i in range(n):
            for d in range(nc):
                q1[i, d] = known[k, i, d] + q0[i, d] - known[k - 1, i, d]
                if k > 1:
                    q1[i, d] += q0[i, d] - known[k - 1, i, d] - Q[k - 2, i, d] + known[k - 2, i, d]
        place_held(e, offsets, k, q1.reshape(size))
        previous = np.inf
        left = np.inf
        for it in range(_ITERATIONS):
            for i in range(n):
                for d in range(nc):
                    a1[i, d] = ta * (q1[i, d] - q0[i, d] - h * v[i, d]) - carry * a[i, d]
                    v1[i, d] = v[i, d] + h * ((1.0 - gm) * a[i, d] + gm * a1[i, d])
            assemble(axes, q1, v1, tables, active, p, history, rates, (0.0, 0.0, 0.0), f, K)
            residual(nc, heavy, rows, density, dragged, al_m, al_f, a, a1, v1, load, G, f, R, stacked)
            if it > 0 and (left <= tolerance or left > 10.0 * previous):
                break
            reduce_vector(e, R.ravel(), x)
            solve(factors[k - 1], x)
            if mixes:
                differences = mixed(mixing, -1 if it == 0 else differences, x)
            expand_vector(e, x, change)
            previous = left
            left = 0.0
            for i in range(n):
                for d in range(nc):
                    q1[i, d] -= change[i * nc + d]
                    left = max(left, abs(change[i * nc + d]))
            if not np.isfinite(left):
                return np.inf
        worst = max(worst, left)
        Q[k] = q1
        G[:] = f
        v[:] = v1
        a[:] = a1
        if keeps:
            remember(axes, q1, tables, active, p, history, h, False)
    return worst
