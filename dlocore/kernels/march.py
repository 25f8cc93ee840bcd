"""The compiled march: generalised-alpha steps of the spatial spline."""

from typing import Any

import numpy as np

from dlocore.compiling.kernel import brief, kernel
from dlocore.effects.laws import CONTACT, DAMPING, SELF_CONTACT, has_jumps, has_kinks, keeps_history
from dlocore.kernels.assembly import (
    add_scalar_band,
    assemble,
    multiply_scalar_band,
    note,
    remember,
)
from dlocore.kernels.banded import (
    expand_vector,
    holding,
    multiply_band,
    place_held,
    reduce_matrix,
    reduce_vector,
    solve_free,
)
from dlocore.kernels.contact import passes, strikes
from dlocore.kernels.inertia import both_sides, effective, follow, padded, residual
from dlocore.kernels.mixing import mixed, room
from dlocore.kernels.narrow import ROOM, factor_step, solve_step
from dlocore.kernels.nearby import clear, nothing_known
from dlocore.kernels.newmark import coefficients
from dlocore.kernels.predictor import differences_of, predict_by, shift
from dlocore.kernels.selfcontact import closing, factor_wide, press, solve_wide, widen
from dlocore.kernels.tension import assume_last, keep, point_on

FAILED_STEP, LEFT, DEEPEST, DIVIDED_FROM, STRUCK = range(5)  # places in `info`
_REFRESH = 0.2  # contraction of the updates above which the tangent is factored anew
_UNMEASURED = 8  # most consecutive steps that may end with their first update, judged by the last measured contraction
_DOUBT = 3.0  # safety factor on that contraction
_PLAIN_ITERATIONS = 8  # Newton iterations before a step is repeated with a line search
_MIXED_ITERATIONS = 80  # the same with mixing, which learns from iterations with the same factors
_ROBUST_ITERATIONS = 60
_STRIKE = 0.02  # [m/s]: a node that approaches faster would bounce, by an amount that depends on the steps
_DULL = 3  # steps by backward Euler, in which the cable does not bounce
_LINE_SEARCH = 12  # most evaluations along a step


@brief
def constrained_mass_solve(nc: int, mass: Any, e: Any, held: Any, right: Any) -> Any:
    """Return x (n, nc) with Z' M x = Z' right, where `held` places the held degrees of freedom.

    With right = M v this is the velocity after the grasps close (the paper's initial conditions made compatible). With
    right = forces it is the consistent acceleration.
    """
    n = len(mass)
    x = np.zeros((n, nc))
    place_held(e, held.reshape((1, len(held))), 0, x.reshape(n * nc))
    rest = right.copy()
    multiply_scalar_band(mass, x, -1.0, rest)
    full = np.zeros((n * nc, 4 * nc))
    add_scalar_band(nc, mass, 1.0, full)
    change, _ = solve_free(e, full, rest.reshape(n * nc))
    return x + change.reshape((n, nc))


@kernel
def march_steps(
    axes: Any, start: int, stop: int, begin: int, jumps: bool, h: float, rho: float, tolerance: float, Q: Any, v: Any,
    a: Any, G: Any, density: float, dragged: float, tables: Any, active: Any, p: Any, history: Any, applied: Any,
    e: Any, offsets: Any, reactions: Any, log: Any, info: Any,
) -> None:  # fmt: skip
    """Advance from step `start` to `stop` by the generalised-alpha method (docs/model.md eq. 13; `newmark.py`).

    M [(1 - alpha_m) a1 + alpha_m a0] + (1 - alpha_f) G1 + alpha_f G0 = 0 with G = f(q, v) + C v - F, and Newmark's
    relations between q, v and a. The first Newton iteration of a time step uses the full tangent, later ones its
    factors. Earlier iterations correct them where the band cannot hold the whole tangent. If a step does not converge,
    or its tangent is not positive definite, it is repeated with a line search on the work of the residual, and with the
    positive semidefinite part of the tangent where needed.

    Args:
        axes: (0, 1), (0, 1, 2) or (0, 1, 2, 3).
        start, stop: step numbers.
        begin: first step of the smooth stretch of motion that contains `start`.
        jumps: whether that stretch begins with a jump or a strike, whose a and G do not last for a step.
        h: time step [s].
        rho: spectral radius at infinite frequency, 0 (strong damping of what is not resolved) to 1 (no damping).
        tolerance: on the estimated error of the Newton iteration [m], largest component.
        Q: (steps + 1, n, nc) control points; written from start + 1 to stop.
        v, a, G: (n, nc) velocity, acceleration and G at step `start`; on return, at `stop`.
        density: linear density [kg/m], factor of the mass matrix.
        dragged: drag coefficient [N s/m^2], factor of the drag matrix.
        history: what earlier steps left behind; read and written where a law keeps it.
        applied: (1 or steps + 1, n, nc) applied forces [N].
        e: elimination of the held degrees of freedom.
        offsets: (steps + 1, held) prescribed part of the held degrees of freedom [m].
        reactions: (steps + 1, held) reaction forces [N]; written.
        log: (steps + 1, points, columns) frames and memory, see `note`; or (0, 0, 0).
        info: (5,) in this order: the step that found no equilibrium or is to be divided, or -1; the largest error that
            Newton's iterations left [m]; the largest depth in an obstacle or the table [m]; as input, the first step
            that is to be divided if the cable strikes something in it; 1 if a strike is why a step is to be divided.
    """
    nc = len(axes)
    keeps = keeps_history(active)
    exact = has_kinks(active)
    n = Q.shape[1]
    size = n * nc
    alpha_m, alpha_f, gamma, beta = coefficients(rho, has_jumps(active))
    to_a = 1.0 / (beta * h * h)
    to_v = gamma / (beta * h)
    touches = bool(active[CONTACT])
    tight = bool(active[SELF_CONTACT])
    # remaining steps by backward Euler: the first step is one if the acceleration at the start does not include contact
    # yet, or is that of the instant of a jump or a strike
    dull = 1 if (touches or jumps) and start == begin else 0
    # the tangent of this damping is incomplete; across kinks earlier iterations teach nothing
    mixes = nc == 3 and bool(active[DAMPING]) and not exact and not tight
    smooth = not mixes and not exact
    plain_iterations = _MIXED_ITERATIONS if mixes else _PLAIN_ITERATIONS
    free = size - len(e.held)
    largest = 10.0 * np.sum(tables.span)  # an update of more than ten lengths is divergence
    K = np.empty((size, 4 * nc))
    A = np.zeros((free + ROOM, e.width))
    f = np.empty((n, nc))
    R = np.empty((n, nc))
    flat = R.reshape(size)
    unit, heavy = tables.unit, tables.inertia
    rows, heavy_rows, stacked = both_sides(unit), both_sides(heavy), padded(n, nc)
    x = np.empty(free)
    trial_x = np.zeros(free + ROOM)
    change = np.empty(size)
    moved = np.empty(size)
    step_change = change.reshape((n, nc))
    q1 = np.empty((n, nc))
    flat_q = q1.reshape(size)
    v1 = np.empty((n, nc))
    a1 = np.empty((n, nc))
    # contact of the cable with itself: nodes before, at and after an update, pairs, and the widened tangent
    shape = (len(tables.strands.u) if tight else 0, min(nc, 3))
    x0, x1, x2 = np.empty(shape), np.empty(shape), np.empty(shape)
    near = nothing_known(n, nc)
    row_end = np.zeros(free if tight else 0, np.int64)
    S = np.zeros((free if tight else 0, free if tight else 0))
    filled, columns = np.empty_like(row_end), np.empty(S.shape, np.int32)
    pairs, wide, depth, share = 0, False, 0.0, 1.0
    first_contraction, first_update, unmeasured = 1.0, 1.0, _UNMEASURED  # measured for first updates
    # the acceleration at the start does not include this damping yet: a prediction with it would go too far
    bent = 0.0 if mixes else 0.5
    mixing, differences = room(free if mixes else 0), -1
    past = differences_of(Q[begin : start + 1])
    for k in range(start + 1, stop + 1):
        load = applied[min(k, len(applied) - 1)]
        q0 = Q[k - 1]
        order = predict_by(past, k - begin)
        # rates of curvature are backward differences: in the plane their force has a potential, and an exact tangent
        rates = (1.5 / h, -2.0 / h, 0.5 / h, h) if k - begin > 1 else (1.0 / h, -1.0 / h, 0.0, h)
        first = 2 if dull > 0 else 0
        attempts = 4 if touches or tight or dull > 0 else 2
        dull -= 1
        converged = False
        # attempts: plain, then robust; where the cable strikes something, both again by backward Euler. Plain attempts
        # first use the tension of the last step; then, where nothing touches, the current one
        for turn in range(2 * attempts):
            attempt = turn // 2
            robust = attempt % 2 == 1
            late = attempt >= 2
            assumes = turn % 2 == 0 and not robust
            if attempt < first or (turn % 2 == 1 and (robust or touches)):
                continue
            al_m, al_f = (0.0, 0.0) if late else (alpha_m, alpha_f)
            ta = 1.0 / (h * h) if late else to_a
            tv = 1.0 / h if late else to_v
            carry = 0.0 if late else 0.5 / beta - 1.0
            gm = 1.0 if late else gamma
            inertia = (1.0 - al_m) * ta * density
            # predict
            for i in range(n):
                for d in range(nc):
                    if robust:
                        q1[i, d] = q0[i, d]
                    elif order > 0:
                        ahead = past[0, i, d]
                        for m in range(1, order):
                            ahead += past[m, i, d]
                        q1[i, d] = ahead
                    else:
                        q1[i, d] = q0[i, d] + h * v[i, d] + (0.0 if late else bent * h * h * a[i, d])
            place_held(e, offsets, k, flat_q)
            for i in range(n):
                for d in range(nc):
                    a1[i, d] = ta * (q1[i, d] - q0[i, d] - h * v[i, d]) - carry * a[i, d]
                    v1[i, d] = v[i, d] + h * ((1.0 - gm) * a[i, d] + gm * a1[i, d])
            if tight and robust:
                share = clear(q0, q1, tables.strands, p, x0, x1, near)
                if share < 1.0:
                    converged = False
                    continue  # a held point or direction would pass through a strand
            assume_last(history.tension, assumes)
            # --- iterate
            limit = plain_iterations if not robust else _ROBUST_ITERATIONS
            fresh = False
            converged = False
            previous = np.inf
            for it in range(limit):
                refactor = (robust and not mixes) or not fresh
                scales = (1.0, tv, 1.0) if refactor else (0.0, 0.0, 0.0)
                assemble(axes, q1, v1, tables, active, p, history, rates, scales, f, K)
                if tight:
                    pairs, depth = press(q1, v1, tables.strands, p, x1, near, f)
                residual(nc, heavy_rows, rows, density, dragged, al_m, al_f, a, a1, v1, load, G, f, R, stacked)
                reduce_vector(e, flat, x)
                if refactor:
                    effective(nc, K, heavy, unit, inertia, 1.0 - al_f, (1.0 - al_f) * tv * dragged)
                    reduce_matrix(e, K, A)
                    wide = pairs > 0
                    if wide:
                        part = (1.0 - al_f, (1.0 - al_f) * tv, 1.0 - al_f)
                        widen(nc, v1, tables.strands, p, x1, near.met[0], pairs, part, e, A[:free], row_end, S)
                    if (factor_wide(S, row_end, filled, columns) if wide else factor_step(A, free)) >= 0:
                        if not robust:
                            break
                        assemble(axes, q1, v1, tables, active, p, history, rates, (1.0, tv, 0.0), f, K)
                        effective(nc, K, heavy, unit, inertia, 1.0 - al_f, (1.0 - al_f) * tv * dragged)
                        for i in range(size):
                            K[i, 0] *= 1.0 + 1e-10
                        reduce_matrix(e, K, A)
                        if wide:
                            part = (1.0 - al_f, (1.0 - al_f) * tv, 0.0)
                            widen(nc, v1, tables.strands, p, x1, near.met[0], pairs, part, e, A[:free], row_end, S)
                        if (factor_wide(S, row_end, filled, columns) if wide else factor_step(A, free)) >= 0:
                            break
                    fresh = True
                for i in range(free):
                    trial_x[i] = -x[i]
                if wide:
                    solve_wide(S, filled, columns, trial_x[:free])
                else:
                    solve_step(A, free, trial_x)
                if mixes:
                    differences = mixed(mixing, -1 if refactor else differences, trial_x[:free])
                expand_vector(e, trial_x, change)
                update = 0.0  # largest step of a control point, the same in every frame of reference
                for i in range(n):
                    square = 0.0
                    for d in range(nc):
                        square += step_change[i, d] * step_change[i, d]
                    update = max(update, square) if np.isfinite(square) else np.inf
                update = np.sqrt(update)
                if not update < largest:
                    break
                length = 1.0
                if tight and robust:
                    length = clear(q1, q1 + step_change, tables.strands, p, x1, x2, near)
                work = 0.0
                if robust and update > tolerance:
                    for i in range(free):
                        work += trial_x[i] * x[i]
                if work < 0.0:
                    # along the step, the work of the residual rises through zero where the potential of the step is
                    # smallest
                    low, low_work, high, high_work = 0.0, work, length, 0.0
                    for search in range(_LINE_SEARCH):
                        q2 = q1 + length * step_change
                        v2 = v1 + (length * tv) * step_change
                        a2 = a1 + (length * ta) * step_change
                        assemble(axes, q2, v2, tables, active, p, history, rates, (0.0, 0.0, 0.0), f, K)
                        if tight:
                            pairs, depth = press(q2, v2, tables.strands, p, x2, near, f)
                        residual(nc, heavy_rows, rows, density, dragged, al_m, al_f, a, a2, v2, load, G, f, R, stacked)
                        reduce_vector(e, flat, x)
                        after = 0.0
                        for i in range(free):
                            after += trial_x[i] * x[i]
                        if abs(after) <= 0.5 * abs(work) or (search == 0 and after * work > 0.0):
                            break
                        if not np.isfinite(after) or after * work < 0.0:
                            high, high_work = length, after
                        else:
                            low, low_work = length, after
                        share = low_work / (low_work - high_work) if np.isfinite(high_work) else 0.5
                        length = low + min(max(share, 0.1), 0.9) * (high - low)
                for i in range(n):
                    for d in range(nc):
                        s = length * step_change[i, d]
                        q1[i, d] += s
                        v1[i, d] += tv * s
                        a1[i, d] += ta * s
                # with the contraction c, the error left after this update is c/(1-c) times it
                left = update
                if it > 0:
                    contraction = min(update / previous, 1.0)
                    left *= min(1.0, contraction / (1.0 - contraction + 1e-300))
                else:  # as recently measured for first updates; in Newton's method it is proportional to the update
                    contraction = min(first_contraction * max(1.0, update / first_update), 0.5)
                    if not robust and smooth and pairs == 0 and unmeasured < _UNMEASURED:
                        left *= _DOUBT * contraction / (1.0 - contraction)
                if it == 1:
                    first_contraction, first_update, unmeasured = contraction, previous, 0
                converged = left <= tolerance and length == 1.0
                if converged or assumes:
                    point_on(nc, q1, step_change, tables.axial, history.tension)
                if converged:
                    info[LEFT] = max(info[LEFT], left)
                    break
                if mixes:
                    fresh = length == 1.0
                elif not robust:
                    if update > 2.0 * previous:
                        break
                    fresh = contraction <= _REFRESH
                previous = update
            if converged and tight and not robust:
                share = clear(q0, q1, tables.strands, p, x0, x1, near)
                converged = share == 1.0
            struck = False
            if converged and not late and touches:
                struck = strikes(nc, q0, q1, tables.contact, p, history.pressing, _STRIKE * h)
            if converged and not late and pairs > 0:
                struck = struck or closing(q0, q1, tables.strands, p, x0, x1, near.met[0], pairs) > _STRIKE * h
            if struck:
                if k >= info[DIVIDED_FROM]:
                    info[FAILED_STEP], info[STRUCK] = k, 1.0
                    return
                converged = False
                dull = _DULL
                first = 2
                continue
            if converged:
                break
        if not converged or (touches and passes(nc, q0, q1, tables.contact, p, history.pressing)):
            info[FAILED_STEP] = k
            return
        keep(history.tension)
        unmeasured += 1
        anew = exact or pairs > 0 or work < 0.0  # where a law has kinks, or a line search has evaluated elsewhere
        if anew:
            assemble(axes, q1, v1, tables, active, p, history, rates, (0.0, 0.0, 0.0), f, K)
            if tight:
                pairs, depth = press(q1, v1, tables.strands, p, x1, near, f)
                info[DEEPEST] = max(info[DEEPEST], depth)
            residual(nc, heavy_rows, rows, density, dragged, al_m, al_f, a, a1, v1, load, G, f, R, stacked)
        if keeps:
            info[DEEPEST] = max(info[DEEPEST], remember(axes, q1, tables, active, p, history, h, False))
            if len(log) > 0:
                note(axes, history, log[k])
        # R and f do not include the last update yet
        if anew:
            for i in range(len(e.held)):
                reactions[k, i] = flat[e.held[i]]
        else:
            # to first order, the tangent gives its effect
            if mixes:
                multiply_band(K, change, moved)
                for i in range(len(e.held)):
                    reactions[k, i] = flat[e.held[i]] + moved[e.held[i]]
            else:
                holding(e, K, change, flat, reactions, k, moved)
            follow(nc, heavy_rows, inertia, 1.0 - al_f, step_change, moved, f, stacked)
        for i in range(n):
            for d in range(nc):
                Q[k, i, d] = q1[i, d]
                G[i, d] = f[i, d]
                v[i, d] = v1[i, d]
                a[i, d] = a1[i, d]
        shift(past, q1)
