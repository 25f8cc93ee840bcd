"""The compiled march: generalised-alpha steps of the spatial spline, and the time spline fitted to them."""

from typing import Any

import numpy as np

from dlocore.effects.laws import DAMPING
from dlocore.kernels.assembly import NO_RATES, add_scalar_band, assemble, multiply_scalar_band, remember
from dlocore.kernels.banded import expand_vector, factor, place_held, reduce_matrix, reduce_vector, solve
from dlocore.kernels.basis import basis_rows
from dlocore.kernels.compile import kernel

FAILED_STEP, LEFT = range(2)  # places in `info`
_REFRESH = 0.1  # contraction of the updates above which the old factors no longer serve
_PLAIN_ITERATIONS = 8  # Newton iterations before a step is done again with a line search
_ROBUST_ITERATIONS = 60
_LINE_SEARCH = 7  # halvings


@kernel
def constrained_mass_solve(nc: int, mass: Any, e: Any, held: Any, right: Any) -> Any:
    """Return x (n, nc) with Z' M x = Z' right and the held degrees of freedom placed by `held`.

    With right = M v this is the velocity after the grasps close (the paper's initial conditions made compatible); with
    right = forces, the consistent acceleration.
    """
    n = len(mass)
    x = np.zeros((n, nc))
    place_held(e, held, x.ravel())
    rest = right.copy()
    multiply_scalar_band(mass, x, -1.0, rest)
    full = np.zeros((n * nc, 4 * nc))
    add_scalar_band(nc, mass, 1.0, full)
    free = n * nc - len(e.held)
    reduced = np.empty((free, 4 * nc))
    reduce_matrix(e, full, reduced)
    y = np.empty(free)
    reduce_vector(e, rest.ravel(), y)
    factor(reduced)
    solve(reduced, y)
    change = np.empty(n * nc)
    expand_vector(e, y, change)
    return x + change.reshape((n, nc))


@kernel
def march_steps(
    axes: Any, start: int, stop: int, begin: int, h: float, rho: float, tolerance: float, Q: Any, v: Any, a: Any,
    G: Any, mass: Any, drag: Any, tables: Any, active: Any, p: Any, memory: Any, past: Any, applied: Any, e: Any,
    offsets: Any, reactions: Any, info: Any,
) -> None:  # fmt: skip
    """Advance from step `start` to `stop` by the generalised-alpha method (Chung and Hulbert, 1993).

    M [(1 - alpha_m) a1 + alpha_m a0] + (1 - alpha_f) G1 + alpha_f G0 = 0 with G = f(q, v) + C v - F, and Newmark's
    relations between q, v and a. The first Newton step of a time step has the full tangent, later ones its factors. A
    step that does not converge so, or whose tangent is not positive, is done again with the positive semidefinite part
    of the tangent where needed and a line search on the work of the residual.

    Args:
        axes: (0, 1) or (0, 1, 2).
        start, stop: step numbers.
        begin: first step of the smooth stretch of motion that `start` lies in.
        h: time step [s].
        rho: spectral radius at infinite frequency, 0 (strong damping of the unresolved) to 1 (none).
        tolerance: on the estimated error of the Newton iteration [m], largest component.
        Q: (steps + 1, n, nc) control points; written from start + 1 to stop.
        v, a, G: (n, nc) velocity, acceleration and G at step `start`; at `stop` on return.
        mass, drag: (n, 4) scalar bands, times density [kg/m] and drag coefficient [N s/m^2].
        past: curvature of the last steps; read and written where internal damping acts.
        applied: (1 or steps + 1, n, nc) applied forces [N].
        e: elimination of the held degrees of freedom.
        offsets: (steps + 1, held) their prescribed part [m].
        reactions: (steps + 1, held) forces that hold them [N]; written.
        info: (2,) the step that found no equilibrium, or -1, and the largest error that Newton's iterations left [m].
    """
    nc = len(axes)
    n = Q.shape[1]
    size = n * nc
    alpha_m = (2.0 * rho - 1.0) / (rho + 1.0)
    alpha_f = rho / (rho + 1.0)
    gamma = 0.5 - alpha_m + alpha_f
    beta = 0.25 * (1.0 - alpha_m + alpha_f) ** 2
    to_a = 1.0 / (beta * h * h)
    to_v = gamma / (beta * h)
    inertia = (1.0 - alpha_m) * to_a
    free = size - len(e.held)
    largest = 10.0 * np.sum(tables.weight)  # an update of ten lengths is divergence
    K = np.empty((size, 4 * nc))
    A = np.empty((free, 4 * nc))
    f = np.empty((n, nc))
    R = np.empty((n, nc))
    weighted = np.empty((n, nc))
    x = np.empty(free)
    trial_x = np.empty(free)
    change = np.empty(size)
    step_change = change.reshape((n, nc))
    q1 = np.empty((n, nc))
    v1 = np.empty((n, nc))
    a1 = np.empty((n, nc))
    for k in range(start + 1, stop + 1):
        load = applied[min(k, len(applied) - 1)]
        q0 = Q[k - 1]
        # backward differences for the rate of curvature: its force then has a potential, and an exact tangent
        rates = (1.5 / h, -2.0 / h, 0.5 / h) if k - begin > 1 else (1.0 / h, -1.0 / h, 0.0)
        for attempt in range(2):
            # predict: quadratic, since after a cubic prediction the iteration ends a fifth sooner, but before the
            # forces of the stiff stretch modes, and with them the reactions, are right
            for i in range(n):
                for d in range(nc):
                    if attempt == 1:
                        q1[i, d] = q0[i, d]
                    elif k - begin > 2:
                        q1[i, d] = 3.0 * q0[i, d] - 3.0 * Q[k - 2, i, d] + Q[k - 3, i, d]
                    else:
                        q1[i, d] = q0[i, d] + h * v[i, d] + 0.5 * h * h * a[i, d]
            place_held(e, offsets[k], q1.ravel())
            for i in range(n):
                for d in range(nc):
                    a1[i, d] = to_a * (q1[i, d] - q0[i, d] - h * v[i, d]) - (0.5 / beta - 1.0) * a[i, d]
                    v1[i, d] = v[i, d] + h * ((1.0 - gamma) * a[i, d] + gamma * a1[i, d])
            # --- iterate
            limit = _PLAIN_ITERATIONS if attempt == 0 else _ROBUST_ITERATIONS
            fresh = False
            converged = False
            previous = np.inf
            for it in range(limit):
                refactor = attempt == 1 or not fresh
                scales = (1.0, to_v, 1.0) if refactor else (0.0, 0.0, 0.0)
                assemble(axes, q1, v1, tables, active, p, memory, past, rates, scales, f, K)
                _residual(mass, drag, alpha_m, alpha_f, a, a1, v1, load, G, f, weighted, R)
                reduce_vector(e, R.ravel(), x)
                if refactor:
                    _effective(nc, K, mass, drag, inertia, 1.0 - alpha_f, to_v)
                    reduce_matrix(e, K, A)
                    if factor(A) >= 0:
                        if attempt == 0:
                            break
                        assemble(axes, q1, v1, tables, active, p, memory, past, rates, (1.0, to_v, 0.0), f, K)
                        _effective(nc, K, mass, drag, inertia, 1.0 - alpha_f, to_v)
                        for i in range(size):
                            K[i, 0] *= 1.0 + 1e-10
                        reduce_matrix(e, K, A)
                        if factor(A) >= 0:
                            break
                    fresh = True
                for i in range(free):
                    trial_x[i] = -x[i]
                solve(A, trial_x)
                expand_vector(e, trial_x, change)
                update = 0.0  # largest step of a control point, the same in every frame
                for i in range(n):
                    square = 0.0
                    for d in range(nc):
                        square += step_change[i, d] * step_change[i, d]
                    update = max(update, square) if np.isfinite(square) else np.inf
                update = np.sqrt(update)
                if not update < largest:
                    break
                length = 1.0
                if attempt == 1 and update > tolerance:
                    work = 0.0
                    for i in range(free):
                        work += trial_x[i] * x[i]
                    for _ in range(_LINE_SEARCH):
                        q2 = q1 + length * step_change
                        v2 = v1 + (length * to_v) * step_change
                        a2 = a1 + (length * to_a) * step_change
                        assemble(axes, q2, v2, tables, active, p, memory, past, rates, (0.0, 0.0, 0.0), f, K)
                        _residual(mass, drag, alpha_m, alpha_f, a, a2, v2, load, G, f, weighted, R)
                        reduce_vector(e, R.ravel(), x)
                        after = 0.0
                        for i in range(free):
                            after += trial_x[i] * x[i]
                        if abs(after) <= 0.9 * abs(work):
                            break
                        length *= 0.5
                    else:
                        length = 1.0
                for i in range(n):
                    for d in range(nc):
                        s = length * step_change[i, d]
                        q1[i, d] += s
                        v1[i, d] += to_v * s
                        a1[i, d] += to_a * s
                # with contraction c the error left after this update is c/(1-c) of it
                contraction = min(update / previous, 1.0) if it > 0 else 0.5
                left = update * min(1.0, contraction / (1.0 - contraction + 1e-300))
                if left <= tolerance and length == 1.0:
                    info[LEFT] = max(info[LEFT], left)
                    converged = True
                    break
                if attempt == 0:
                    if update > 2.0 * previous:
                        break
                    fresh = contraction <= _REFRESH
                previous = update
            if converged:
                break
        if not converged:
            info[FAILED_STEP] = k
            return
        if active[DAMPING]:
            remember(axes, q1, tables, past)
        for i in range(len(e.held)):
            reactions[k, i] = R[e.held[i] // nc, e.held[i] % nc]
        for i in range(n):
            for d in range(nc):
                Q[k, i, d] = q1[i, d]
                G[i, d] = f[i, d]
                v[i, d] = v1[i, d]
                a[i, d] = a1[i, d]


@kernel
def _residual(
    mass: Any,
    drag: Any,
    alpha_m: float,
    alpha_f: float,
    a: Any,
    a1: Any,
    v1: Any,
    load: Any,
    G: Any,
    f: Any,
    w: Any,
    R: Any,
) -> None:
    """Turn f into G1 = f + C v1 - load, and write the residual R."""
    n, nc = f.shape
    if drag[0, 0] != 0.0:
        multiply_scalar_band(drag, v1, 1.0, f)
    for i in range(n):
        for d in range(nc):
            f[i, d] -= load[i, d]
            R[i, d] = (1.0 - alpha_f) * f[i, d] + alpha_f * G[i, d]
            w[i, d] = (1.0 - alpha_m) * a1[i, d] + alpha_m * a[i, d]
    multiply_scalar_band(mass, w, 1.0, R)


@kernel
def _effective(nc: int, K: Any, mass: Any, drag: Any, inertia: float, share: float, to_v: float) -> None:
    """Turn K into the tangent of a step: inertia M + share (K + to_v C)."""
    size, width = K.shape
    for j in range(size):
        for o in range(width):
            K[j, o] *= share
    for i in range(len(mass)):
        for o in range(min(4, len(mass) - i)):
            value = inertia * mass[i, o] + share * to_v * drag[i, o]
            for d in range(nc):
                K[i * nc + d, o * nc] += value


@kernel
def initial_state(
    axes: Any, q: Any, v: Any, mass: Any, drag: Any, tables: Any, active: Any, p: Any, memory: Any, past: Any,
    load: Any, e: Any, held_acceleration: Any, G: Any,
) -> Any:  # fmt: skip
    """Return the consistent acceleration (n, nc), and write G = f + C v - load, where a smooth stretch begins."""
    nc = len(axes)
    K = np.empty((1, 1))
    assemble(axes, q, v, tables, active, p, memory, past, NO_RATES, (0.0, 0.0, 0.0), G, K)
    if active[DAMPING]:
        remember(axes, q, tables, past)
    multiply_scalar_band(drag, v, 1.0, G)
    for i in range(len(G)):
        for d in range(nc):
            G[i, d] -= load[i, d]
    return constrained_mass_solve(nc, mass, e, held_acceleration, -G)


@kernel
def fit_time(knots: Any, times: Any, Q: Any, v0: Any) -> Any:
    """Return control points (n_t, m) of the time spline fitted to the states Q (k, m) at `times`.

    Least squares weighted by the time each state stands for; the first two control points give the initial position
    and velocity exactly, the last the final position.
    """
    n = len(knots) - 4
    k, m = Q.shape
    C = np.empty((n, m))
    C[0] = Q[0]
    C[1] = Q[0] + v0 * ((knots[4] - knots[1]) / 3.0)
    C[n - 1] = Q[k - 1]
    size = n - 3
    A = np.zeros((size, 4))
    right = np.zeros((size, m))
    first, table = basis_rows(knots, times, 0)
    values = np.empty(m)
    for s in range(1, k - 1):
        w = 0.5 * (times[s + 1] - times[s - 1])
        b = table[s, 0]
        values[:] = Q[s]
        for i in range(4):
            g = first[s] + i
            if g < 2 or g == n - 1:
                values -= b[i] * C[g]
        for i in range(4):
            row = first[s] + i - 2
            if row < 0 or row >= size:
                continue
            right[row] += (w * b[i]) * values
            for j in range(i, 4):
                column = first[s] + j - 2
                if column < size:
                    A[row, column - row] += w * b[i] * b[j]
    trace = 0.0
    for i in range(size):
        trace += A[i, 0]
    for i in range(size):
        A[i, 0] += 1e-13 * trace
    factor(A)
    for d in range(m):
        x = right[:, d].copy()
        solve(A, x)
        C[2 : n - 1, d] = x
    return C
