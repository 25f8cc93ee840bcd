"""One step of a diagonally implicit Runge-Kutta method on a rod's equations, with an error estimate.

Stage i of a step h has the unknown rates V and the coordinates q = q_n + h sum_j a_ij V_j. It solves

    M (V - v_n - h sum_{j<i} a_ij A_j)/(h a_ii) + forces(q, V, t_n + c_i h) = 0

by Newton's iteration on q. One factorisation serves as many stages as possible. The same method integrates strain
memory and the anchors of friction, with their implicit part in closed form.
"""

from typing import Any

import numpy as np

from dlocore.reference.banded import factor, solve
from dlocore.reference.body import CLAMP, GYRATION, REAL
from dlocore.reference.compile import compiled
from dlocore.reference.forces import add_contact, add_drag, add_edges, add_hinges, frames

ITERATIONS = 12
DOWNHILL = 40  # iterations of a long step downhill, each with factors of its own
SHRINKS = 0.3  # largest ratio of an update to the previous one: above it the factors are too old
DONE, FAILED = 0, 1


@compiled
def _scatter(body: Any, x: Any, out: Any) -> None:
    """Write the free coordinates of x (n, 4), and zeros for the others, into out (n dims,)."""
    for n in range(x.shape[0]):
        for d in range(body.dims):
            out[n * body.dims + d] = 0.0 if body.fixed[n, d] else x[n, d]


@compiled
def _largest(body: Any, dx: Any) -> float:
    """Return the largest coordinate of a displacement (n dims,) [m], with spins converted to lengths."""
    found = 0.0
    for k in range(len(dx) // body.dims):
        for d in range(body.dims):
            found = max(found, abs(dx[k * body.dims + d]) * (1.0 if d < 3 else body.law[GYRATION]))
    return found


@compiled
def _remains(body: Any, period: float, state: Any, end: Any, tangent_rate: Any, lengths: Any, b: Any, e: Any) -> float:
    """Return approximately how far an error e (n, 4) of the velocities moves the rod within `period` [s], in m.

    It is the displacement due to the impulse M e spread over the period T, by one implicit step: T e where the rod is
    free, and e/(T w^2) where it is held so stiffly that it swings at w.
    """
    n, dims = len(body.rest) + 1, body.dims
    K, dx = np.zeros((n * dims, 6 if dims == 2 else 11)), np.empty(n * dims)
    R, torque, memory = np.empty((n, 4)), np.empty_like(end.t), np.empty_like(end.memory)
    axial, turn, anchor = np.empty_like(end.axial), np.empty_like(end.turn), np.empty_like(end.anchor)
    for mode in (1, 2):  # the tangent, or where the rod is unstable its definite part
        K[:] = 0.0
        for k in range(n):
            for d in range(dims):
                K[k * dims + d, 0] = 1.0 if body.fixed[k, d] else body.mass[k, d] / (period * period)
        add_edges(body, end.v, end.axial, period, end.t, lengths, axial, R, K, mode)
        add_hinges(
            body, end.v, state.turn, end.memory, period, end.t, end.a, b, lengths, tangent_rate, turn, memory, torque,
            R, K, mode,
        )  # fmt: skip
        add_drag(body, end.v, period, R, K, mode)
        add_contact(body, end.q, end.v, end.anchor, period, anchor, R, K, mode)
        if factor(K):
            _scatter(body, e * body.mass / period, dx)
            solve(K, dx)
            return _largest(body, dx)
    return np.inf


@compiled
def add_forces(
    body: Any, state: Any, after: Any, load: Any, pull: Any, memory: Any, axial: Any, anchor: Any, implicit: float,
    b: Any, lengths: Any, tangent_rate: Any, R: Any, torque: Any, K: Any, mode: int,
) -> float:  # fmt: skip
    """Write the residual force on each node (n, 4) [N] to `R`; on held coordinates it is the reaction force.

    Args:
        body: the rod.
        state: at the start of the step.
        after: state of the stage; receives what it remembers.
        load: on each node (n, 3) [N].
        pull: velocity (n, 4) that the stage would have without a force of its own.
        memory, axial, anchor: what would be remembered without the rates of this stage.
        implicit: duration that the stage counts for [s].
        b, lengths, tangent_rate: second directors and lengths of the edges, and the rates of held tangents.
        R, torque: receive the forces and the moments of held directions (n - 1, 3) [N m].
        K, mode: the band to which the tangent is added: 0 none, 1 all of it, 2 its definite part.

    Returns:
        the largest depth in a surface [m].
    """
    q, v = after.q, after.v
    for k in range(len(q)):
        for d in range(4):
            R[k, d] = 0.0 if body.fixed[k, d] else body.mass[k, d] * (v[k, d] - pull[k, d]) / implicit
            if d < 3:
                R[k, d] -= body.weight[k, d] + load[k, d]
    torque[:] = 0.0
    add_edges(body, v, axial, implicit, after.t, lengths, after.axial, R, K, mode)
    add_hinges(
        body, v, state.turn, memory, implicit, after.t, after.a, b, lengths, tangent_rate, after.turn, after.memory,
        torque, R, K, mode,
    )  # fmt: skip
    add_drag(body, v, implicit, R, K, mode)
    return float(add_contact(body, q, v, anchor, implicit, after.anchor, R, K, mode))


@compiled
def take_step(
    body: Any, tableau: Any, h: float, period: float, state: Any, guide: Any, tolerance: float, after: Any,
    reaction: Any, torque: Any, told: Any,
) -> int:  # fmt: skip
    """Step from `state` to `after`; return DONE or FAILED.

    Args:
        body, tableau: the rod and the method.
        h: step [s].
        period: time for which an error of the velocity lasts [s]; 0 discards the velocity, so that the step goes
            downhill, damped by inertia alone.
        state: at the beginning.
        guide: what is prescribed at the stages.
        tolerance: of Newton's iteration [m].
        after: receives the state at the end.
        reaction: receives the mean over the step of the forces that hold the nodes (n, 4) [N], without the inertia of
            the held coordinates. The force at the end of the step would be dominated by waves of stretch, which no step
            of a smooth motion resolves.
        torque: receives the mean of the moments taken by held directions (n - 1, 3) [N m].
        told: receives the estimated error [m], the last update [m] and the largest depth in a surface [m].
    """
    n, dims, static = len(body.rest) + 1, body.dims, period == 0.0
    stages, hinges, edges, points = len(tableau.times), n - 2, n - 1, len(body.point_edge)
    width = 5 if dims == 2 else 10
    V, A = np.zeros((stages, n, 4)), np.zeros((stages, n, 4))
    memory_rate, axial_rate = np.zeros((stages, hinges, 3)), np.zeros((stages, edges))
    anchor_rate = np.zeros((stages, points, 3))
    guess, pull = np.empty((n, 4)), np.empty((n, 4))
    memory, axial, anchor = np.empty((hinges, 3)), np.empty(edges), np.empty((points, 3))
    b, lengths, tangent_rate = np.zeros((edges, 3)), np.empty(edges), np.zeros((edges, 3))
    R, T = np.empty((n, 4)), np.empty((edges, 3))
    K, dx = np.zeros((n * dims, width + 1)), np.empty(n * dims)
    reaction[:], torque[:] = 0.0, 0.0
    q, v, gyration = after.q, after.v, body.law[GYRATION]
    factored = False
    deepest = 0.0
    for i in range(stages):
        implicit = h * tableau.coefficients[i, i]
        for k in range(n):
            for d in range(4):
                guess[k, d], pull[k, d] = state.q[k, d], 0.0 if static else state.v[k, d]
        memory[:], axial[:], anchor[:] = state.memory, state.axial, state.anchor
        for j in range(i):
            weight = h * tableau.coefficients[i, j]
            guess += weight * V[j]
            pull += weight * A[j]
            memory += weight * memory_rate[j]
            axial += weight * axial_rate[j]
            anchor += weight * anchor_rate[j]
        # initial guess of Newton's iteration: the rate of the previous stage, extrapolated by its acceleration
        for k in range(n):
            for d in range(4):
                if i == 0:
                    v[k, d] = pull[k, d]
                else:
                    v[k, d] = V[i - 1, k, d] + (tableau.times[i] - tableau.times[i - 1]) * h * A[i - 1, k, d]
                q[k, d] = guess[k, d] + implicit * v[k, d]
        for k in range(len(guide.nodes)):
            for d in range(3):
                q[guide.nodes[k], d] = guide.position[i, k, d]
                v[guide.nodes[k], d] = guide.velocity[i, k, d]
        for k in range(len(guide.edges)):
            e = guide.edges[k]
            for d in range(3):
                after.t[e, d] = guide.tangent[i, k, d]
                tangent_rate[e, d] = guide.tangent_rate[i, k, d]
                if body.kind[e] == CLAMP:
                    after.a[e, d] = guide.director[i, k, d]
            if body.kind[e] == CLAMP:
                q[e, 3], v[e, 3] = 0.0, guide.spin[i, k]
        last = np.inf
        fresh, converged = False, False
        for iteration in range(DOWNHILL if static else ITERATIONS):
            if not frames(body, state, q, after.t, after.a, b, lengths):
                return FAILED
            refactor = static or not factored
            mode = 1
            while True:
                if refactor:
                    K[:] = 0.0
                    for k in range(n):
                        for d in range(dims):
                            free = not body.fixed[k, d]
                            K[k * dims + d, 0] = body.mass[k, d] / (implicit * implicit) if free else 1.0
                use = mode if refactor else 0
                deepest = add_forces(
                    body, state, after, guide.load[i], pull, memory, axial, anchor, implicit, b, lengths, tangent_rate,
                    R, T, K, use,
                )  # fmt: skip
                if not refactor:
                    break
                if factor(K):
                    factored, fresh = True, True
                    break
                if mode == 2:
                    return FAILED
                mode = 2  # an unstable state: the definite part of the tangent
            _scatter(body, R, dx)
            solve(K, dx)
            update = 0.0
            for k in range(n):
                for d in range(dims):
                    change = dx[k * dims + d]
                    q[k, d] -= change
                    v[k, d] -= change / implicit
                    update = max(update, abs(change) if d < 3 else gyration * abs(change))
            if not np.isfinite(update):
                return FAILED
            if update == 0.0:
                converged = True
            elif iteration > 0:
                ratio = update / last
                if ratio < 1.0 and update * ratio / (1.0 - ratio) < tolerance:
                    converged = True
                elif ratio > SHRINKS:
                    if fresh and ratio > 2.0 and iteration > 3 and not static:
                        return FAILED
                    factored = False
            elif update < 1e-3 * tolerance:
                converged = True
            last = update
            told[1] = update
            if converged:
                break
        if not converged:
            return FAILED
        # geometry after the last update
        if not frames(body, state, q, after.t, after.a, b, lengths):
            return FAILED
        # forces, memory and anchors at the very end of the stage: those before the last update differ, as the cable
        # hardly stretches
        add_forces(
            body, state, after, guide.load[i], pull, memory, axial, anchor, implicit, b, lengths, tangent_rate, R, T,
            K, 0,
        )  # fmt: skip
        # weights of the stages in the step: the mean of the forces changes the momentum
        share = tableau.coefficients[stages - 1, i]
        reaction += share * R
        torque += share * T
        for k in range(n):
            for d in range(4):
                V[i, k, d] = v[k, d]
                A[i, k, d] = 0.0 if body.fixed[k, d] else (v[k, d] - pull[k, d]) / implicit
        for k in range(hinges):
            for d in range(3):
                memory_rate[i, k, d] = (after.memory[k, d] - memory[k, d]) / implicit
        for e in range(edges):
            if body.kind[e] == REAL:
                axial_rate[i, e] = (after.axial[e] - axial[e]) / implicit
        for k in range(points):
            for d in range(3):
                anchor_rate[i, k, d] = (after.anchor[k, d] - anchor[k, d]) / implicit
    told[2] = deepest
    told[0] = 0.0
    if static:
        return DONE
    # error of the step, filtered by the tangent because stiff parts decay, plus the displacement due to the error of
    # the velocity
    error, slip = np.zeros((n, 4)), np.zeros((n, 4))
    implicit = h * tableau.coefficients[stages - 1, stages - 1]
    for j in range(stages):
        error += h * tableau.error[j] * V[j]
        slip += h * tableau.error[j] * A[j]
    _scatter(body, error * body.mass / (implicit * implicit), dx)
    solve(K, dx)
    told[0] = _largest(body, dx) + _remains(body, period, state, after, tangent_rate, lengths, b, slip)
    return DONE
