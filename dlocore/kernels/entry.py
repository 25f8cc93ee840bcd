"""How a motion and its smooth stretches begin and end: brief steps around the march, which keep the GIL.

To hand it over for microseconds would let another thread's solve take it for as long as its Python lasts.
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

_LASTS = 0.25  # (h w)^2 of a wave of which a step keeps half the acceleration that it begins with, inverse


@brief
def remember_start(axes: Any, q: Any, tables: Any, active: Any, p: Any, history: Any) -> None:
    """Note in `history` the strain of the start q (n, nc), with the anchors of friction under the cable."""
    remember(axes, q, tables, active, p, history, 0.0, True)


@brief
def begin_stretch(
    axes: Any, q: Any, v: Any, density: float, dragged: float, tables: Any, active: Any, p: Any,
    history: Any, rates: Any, load: Any, e: Any, near: Any, h: float, inertial: bool, dimensions: int,
) -> Any:  # fmt: skip
    """Return velocity, acceleration and G = f + C v - load, each (n, nc), where a smooth stretch begins, and its jump.

    The velocity is what the last one, v, becomes as the grasps close; the acceleration is consistent with the forces.
    The jump is the largest change of a component of the centreline's velocity [m/s]; strain resists at the rate before.

    Args:
        q: (n, nc) [m] the state.
        density, dragged: of the mass matrix [kg/m] and of the drag matrix [N s/m^2].
        rates: of strain, see `assemble`: from v, or from the last step.
        near: (3, held) [m] prescribed part of what is held at the beginning, h and 2 h later.
        h: [s], short.
        dimensions: of the centreline.
        inertial: False where the cable goes through equilibria: it has no velocity that counts, and no acceleration.
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
    """Return the velocity (n, nc) that a jump at the state q leaves: that to the state h [s] later, held as it is held.

    As the grasps close only what they hold has their speed. The next moment a cable that hardly stretches has set out
    with them, as far as it is pulled along itself: a time spline that began without would be late by that for a span.

    Args:
        q, later: (n, nc) [m] the states.
        near: (3, held) [m] prescribed part of what is held at the jump, `short` and 2 `short` [s] later.
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
    """Return what lasts for a step of the acceleration a (n, nc) that a stretch begins with, and a G that balances it.

    What a cable is let go from, or springs away with, acts at one point, or at an end: the shorter the spans, the more
    of its acceleration is of waves faster than any step. A step turns that into speeds which the cable never has, and
    drag and damping of these hold it back. So (M + c h^2 K) a' = M a, which leaves alone what is slower than the step,
    with the positive semidefinite part of K; G' = G + M (a - a').

    Args:
        q, a, G: (n, nc) what `begin_stretch` was given and returned.
        density: of the mass matrix [kg/m].
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
    """Bring the reactions (steps + 1, held) of the steps after `first` to `last` to their times, in place.

    A generalised-alpha step balances its forces `lag` steps before its end (alpha_f).
    """
    for i in range(reactions.shape[1] if last - first > 1 else 0):
        rate = 0.0
        for k in range(first + 1, last):
            rate = reactions[k + 1, i] - reactions[k, i]
            reactions[k, i] += lag * rate
        reactions[last, i] += lag * rate
