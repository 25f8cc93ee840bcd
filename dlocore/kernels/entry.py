"""How a motion and its smooth stretches begin and end: brief steps around the march, which keep the GIL.

Releasing the GIL for microseconds would let another thread take it, for as long as its Python code runs.
"""

from typing import Any

import numpy as np

from dlocore.compiling.kernel import brief
from dlocore.effects.laws import SELF_CONTACT, keeps_history
from dlocore.kernels.assembly import (
    NO_RATES,
    add_scalar_band,
    assemble,
    multiply_scalar_band,
    remember,
    times_scalar_band,
)
from dlocore.kernels.banded import multiply_band, place_held, solve_free
from dlocore.kernels.march import constrained_mass_solve
from dlocore.kernels.nearby import nothing_known
from dlocore.kernels.selfcontact import press

_LASTS = 0.25  # c of `lasting`: the inverse of (h w)^2 of a wave that keeps half of its initial acceleration


@brief
def remember_start(axes: Any, q: Any, tables: Any, active: Any, p: Any, history: Any) -> None:
    """Record in `history` the strain of the start q (n, nc), with the anchors of friction at the cable."""
    remember(axes, q, tables, active, p, history, 0.0, True)


@brief
def begin_stretch(
    axes: Any, q: Any, v: Any, density: float, dragged: float, tables: Any, active: Any, p: Any,
    history: Any, rates: Any, load: Any, e: Any, near: Any, h: float, inertial: bool, dimensions: int,
) -> Any:  # fmt: skip
    """Return velocity, acceleration, G = f + C v - load, each (n, nc), and the jump at the start of a smooth stretch.

    The velocity is what the previous velocity v becomes as the grasps close. The acceleration is consistent with the
    forces, for which the strain rates are those before the jump. The jump is the largest change of a component of the
    centreline's velocity [m/s].

    Args:
        q: (n, nc) [m] the state.
        density, dragged: factors of the mass matrix [kg/m] and of the drag matrix [N s/m^2].
        rates: of strain, see `assemble`: from v, or from the last step.
        near: (3, held) [m] prescribed part of the held degrees of freedom at the beginning, h and 2 h later.
        h: short time [s].
        inertial: False where the cable goes through equilibria: its velocity does not count, and it has no
            acceleration.
        dimensions: of the centreline.
    """
    nc = len(axes)
    rate = (4.0 * near[1] - 3.0 * near[0] - near[2]) / (2.0 * h)
    heavy = tables.inertia
    closed = constrained_mass_solve(nc, heavy, e, rate, times_scalar_band(heavy, v))
    jump = 0.0
    for i in range(len(v)):
        for d in range(dimensions):
            jump = max(jump, abs(closed[i, d] - v[i, d]))
    before = v if inertial else np.zeros_like(v)
    v = closed if inertial else before
    G = np.empty_like(v)
    K = np.empty((1, 1))
    assemble(axes, q, before, tables, active, p, history, rates, (0.0, 0.0, 0.0), G, K)
    if active[SELF_CONTACT]:
        x = np.empty((len(tables.strands.u), min(nc, 3)))
        press(q, v, tables.strands, p, x, nothing_known(len(q), nc), G)
    if keeps_history(active):
        remember(axes, q, tables, active, p, history, 0.0, False)
    multiply_scalar_band(dragged * tables.unit, v, 1.0, G)
    for i in range(len(G)):
        for d in range(nc):
            G[i, d] -= load[i, d]
    if not inertial:
        return closed, np.zeros_like(v), G, jump
    held_acceleration = (near[2] - 2.0 * near[1] + near[0]) / (h * h)
    return closed, constrained_mass_solve(nc, density * heavy, e, held_acceleration, -G), G, jump


@brief
def after_jump(e: Any, near: Any, short: float, q: Any, later: Any, h: float) -> Any:
    """Return the velocity (n, nc) after a jump at the state q: the one that leads to the state `later`, h [s] later.

    Held degrees of freedom get their prescribed velocity. When grasps close, only the held points have the velocity of
    the grippers. A moment later, a cable that hardly stretches has started to move with them wherever it is pulled
    along its axis. A time spline that began without this velocity would lag behind for a time span.

    Args:
        e: elimination of the held degrees of freedom.
        near: (3, held) [m] prescribed part of the held degrees of freedom at the jump, `short` and 2 `short` [s] later.
        q, later: (n, nc) [m] the states.
    """
    v = (later - q) / h
    rate = np.empty((1, near.shape[1]))
    rate[0] = (4.0 * near[1] - 3.0 * near[0] - near[2]) / (2.0 * short)
    place_held(e, rate, 0, v.reshape(v.size))
    return v


@brief
def lasting(
    axes: Any, q: Any, a: Any, G: Any, density: float, h: float, tables: Any, active: Any, p: Any,
    history: Any, e: Any,
) -> Any:  # fmt: skip
    """Return the part of a stretch's initial acceleration a (n, nc) that lasts for a step, and a G that balances it.

    A released cable is accelerated at one point or at an end. The shorter the spans, the more of this acceleration
    belongs to waves faster than any step. A step would turn it into velocities that the cable never has, and drag and
    damping of these would hold the cable back. So (M + c h^2 K) a' = M a, with the positive semidefinite part of K,
    which keeps everything slower than the step; G' = G + M (a - a') (docs/model.md eq. 13a).

    Args:
        q, a, G: (n, nc) the state given to `begin_stretch`, and the acceleration and G that it returned.
        density: factor of the mass matrix [kg/m].
        h: time step [s].
    """
    nc = len(axes)
    f, K = np.empty_like(q), np.empty((q.size, 4 * nc))
    assemble(axes, q, np.zeros_like(q), tables, active, p, history, NO_RATES, (1.0, 0.0, 0.0), f, K)
    K *= _LASTS * h * h
    force = np.empty(q.size)
    multiply_band(K, a.ravel(), force)
    add_scalar_band(nc, tables.inertia, density, K)
    change, positive = solve_free(e, K, force)
    if not positive:
        return a, G
    fast = change.reshape(q.shape)
    return a - fast, G + density * times_scalar_band(tables.inertia, fast)


@brief
def to_ends_of_steps(reactions: Any, first: int, last: int, lag: float) -> None:
    """Move the reactions (steps + 1, held) of the steps after `first` to `last` to the ends of the steps, in place.

    A generalised-alpha step balances its forces `lag` (alpha_f) steps before its end.
    """
    for i in range(reactions.shape[1] if last - first > 1 else 0):
        rate = 0.0
        for k in range(first + 1, last):
            rate = reactions[k + 1, i] - reactions[k, i]
            reactions[k, i] += lag * rate
        reactions[last, i] += lag * rate
