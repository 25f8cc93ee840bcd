"""Minimise the stored energy of a held cable, for start shapes and static equilibria.

A step that bends a nearly inextensible cable by more than a thousandth of its length also stretches it, to second
order. The energy of that stretch exceeds everything else, so that a line search on the energy creeps. Newton's method
with the tension as an unknown of its own (`tension.py`) does not creep, so `descend` has no line search. `relax` has
one, for energies that have kinks or no reliable tangent.
"""

from typing import Any

import numpy as np

from dlocore.compiling.kernel import kernel
from dlocore.kernels.assembly import (
    NO_RATES,
    add_scalar_band,
    assemble,
    contact_energy,
    multiply_scalar_band,
    stored_energy,
)
from dlocore.kernels.banded import expand_vector, factor, place_held, reduce_matrix, reduce_vector, solve
from dlocore.kernels.tension import point_on
from dlocore.kernels.twisted import remember as carry

_PLAIN_ITERATIONS = 8
_SHRINKS = 0.5  # of the previous update, from the third on: an update above this is not converging
_HALVINGS = 30
_DROWNED = 1e-9  # relative to the energy: differences that rounding may cause where the cable hardly stretches


@kernel
def _merit(
    axes: Any,
    q: Any,
    target: Any,
    strength: float,
    applied: Any,
    tables: Any,
    active: Any,
    p: Any,
    history: Any,
    w: Any,
) -> float:
    """Return the energy: stored + strength/2 (q - target)' B (q - target) - applied . q."""
    w[:] = 0.0
    away = q - target
    multiply_scalar_band(tables.unit, away, strength, w)
    total = stored_energy(axes, q, tables, active, p, history) + contact_energy(axes, q, tables, active, p)
    for i in range(q.shape[0]):
        for d in range(q.shape[1]):
            total += 0.5 * away[i, d] * w[i, d] - applied[i, d] * q[i, d]
    return total


@kernel
def relax(
    axes: Any, q: Any, target: Any, strength: float, applied: Any, tables: Any, active: Any, p: Any, history: Any,
    e: Any, offset: Any, tolerance: float, limit: int,
) -> Any:  # fmt: skip
    """Minimise energy over q (n, nc) in place by Newton steps with a line search; return (update [m], iterations).

    The energy is the stored one, minus the work of the applied forces, plus a spring of `strength` [N/m^2] towards
    `target`. Where the tangent is not positive definite, its positive semidefinite part is used. Where energy
    differences drown in rounding, the work of the residual decides instead of the energy. Every step carries the frames
    of the sections along: the tangent is exact only at the carried frame.

    Args:
        e, offset: elimination and prescribed part of the held degrees of freedom.
        tolerance: on the largest update [m].
        limit: on the iterations.
    """
    nc = len(axes)
    n = q.shape[0]
    size = n * nc
    free = size - len(e.held)
    K = np.empty((size, 4 * nc))
    A = np.empty((free, e.width))
    f = np.empty((n, nc))
    still = np.zeros((n, nc))
    w = np.empty((n, nc))
    x = np.empty(free)
    change = np.empty(size)
    place_held(e, offset.reshape((1, len(offset))), 0, q.reshape(q.size))
    energy = _merit(axes, q, target, strength, applied, tables, active, p, history, w)
    update = np.inf
    damping = 0.0
    largest = 0.25 * np.sum(tables.span)  # a step no longer than a quarter of the cable
    for it in range(limit):
        for attempt in range(40):
            geometric = 1.0 if attempt == 0 else 0.0
            assemble(axes, q, still, tables, active, p, history, NO_RATES, (1.0, 0.0, geometric), f, K)
            add_scalar_band(nc, tables.unit, strength, K)
            if attempt > 1:
                damping = max(10.0 * damping, 1e-12 * np.max(K[:, 0]))
            for i in range(size):
                K[i, 0] += damping
            reduce_matrix(e, K, A)
            if factor(A) < 0:
                break
        damping *= 0.1
        f -= applied
        multiply_scalar_band(tables.unit, q - target, strength, f)
        reduce_vector(e, f.ravel(), x)
        solve(A, x)
        expand_vector(e, x, change)
        update = np.max(np.abs(change))
        if not np.isfinite(update):
            return np.inf, it
        length = min(1.0, largest / update)
        slope = 0.0
        for i in range(size):
            slope += change[i] * f.ravel()[i]
        step = change.reshape((n, nc))
        after = np.nan
        if update > tolerance:
            for _ in range(_HALVINGS):
                after = _merit(axes, q - length * step, target, strength, applied, tables, active, p, history, w)
                if after <= energy - 1e-4 * length * slope + 1e-14 * abs(energy):
                    break
                if abs(after - energy) <= _DROWNED * abs(energy):
                    trial = q - length * step
                    assemble(axes, trial, still, tables, active, p, history, NO_RATES, (0.0, 0.0, 0.0), f, K)
                    f -= applied
                    multiply_scalar_band(tables.unit, trial - target, strength, f)
                    work = 0.0
                    for i in range(size):
                        work += change[i] * f.ravel()[i]
                    if abs(work) <= 0.9 * abs(slope):
                        break
                length *= 0.5
                after = np.nan
        q -= length * step
        if len(axes) == 4:
            carry(q, tables.curvature, active, p, history.memory, history.past, 0.0, history.room)
        if update <= tolerance:
            return update, it + 1
        if np.isfinite(after):  # carrying the frames changes nothing but rounding
            energy = after
        else:
            energy = _merit(axes, q, target, strength, applied, tables, active, p, history, w)
    return update, limit


@kernel
def descend(
    axes: Any, q: Any, strength: float, applied: Any, tables: Any, active: Any, p: Any, history: Any, e: Any,
    offset: Any, close: float, tolerance: float, resting: float,
) -> Any:  # fmt: skip
    """Minimise the energy of `relax`, with the spring towards q itself, by Newton's method alone; return the same.

    Every tangent must be positive definite, so that the cable moves downhill, and updates must shrink. Otherwise q (n,
    nc) and `history` are left as they were, and the update is infinite. `history.tension` holds the tension that the
    first tangent uses, and on return the tension at q.

    Args:
        e, offset: elimination and prescribed part of the held degrees of freedom.
        close: tolerance on the last update as a share of the first.
        tolerance: on the last update, where that is smaller [m].
        resting: updates below this need not shrink [m].
    """
    nc = len(axes)
    n = q.shape[0]
    size = n * nc
    free = size - len(e.held)
    K = np.empty((size, 4 * nc))
    A = np.empty((free, e.width))
    f = np.empty((n, nc))
    still = np.zeros((n, nc))
    x = np.empty(free)
    change = np.empty(size)
    step = change.reshape((n, nc))
    target, past, memory, tension = q.copy(), history.past.copy(), history.memory.copy(), history.tension.copy()
    place_held(e, offset.reshape((1, len(offset))), 0, q.reshape(q.size))
    largest = 0.25 * np.sum(tables.span)  # a step no longer than a quarter of the cable
    enough, previous = tolerance, np.inf
    it = 0
    while it < _PLAIN_ITERATIONS:
        it += 1
        assemble(axes, q, still, tables, active, p, history, NO_RATES, (1.0, 0.0, 1.0), f, K)
        add_scalar_band(nc, tables.unit, strength, K)
        reduce_matrix(e, K, A)
        if factor(A) >= 0:
            break
        f -= applied
        multiply_scalar_band(tables.unit, q - target, strength, f)
        reduce_vector(e, f.ravel(), x)
        for i in range(free):
            x[i] = -x[i]
        solve(A, x)
        expand_vector(e, x, change)
        update = np.max(np.abs(change))
        stuck = it > 2 and update > _SHRINKS * previous
        if not update < largest or (stuck and update > max(enough, resting)):
            break
        q += step
        if nc == 4:
            carry(q, tables.curvature, active, p, history.memory, history.past, 0.0, history.room)
        point_on(nc, q, step, tables.axial, history.tension)
        if it == 1:
            enough = max(tolerance, close * update)
        if update <= enough or stuck:
            return update, it
        previous = update
    q[:] = target
    history.past[:] = past
    history.memory[:] = memory
    history.tension[:] = tension
    return np.inf, it
