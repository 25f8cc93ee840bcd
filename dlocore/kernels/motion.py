"""A whole smooth motion without twist in one call, as a short march spends much of its time between its parts."""

from typing import Any

import numpy as np

from dlocore.compiling.kernel import kernel
from dlocore.effects.laws import keeps_curvature, keeps_history
from dlocore.kernels.assembly import (
    MEMORY_IN_PLANE,
    MEMORY_IN_SPACE,
    NO_RATES,
    PAST_IN_PLANE,
    PAST_IN_SPACE,
    History,
    slopes,
    times_scalar_band,
)
from dlocore.kernels.basis import build_tables
from dlocore.kernels.entry import after_jump, begin_stretch, lasting, remember_start, to_ends_of_steps
from dlocore.kernels.growth import SLOWEST, fastest_growth, looked_at
from dlocore.kernels.holding import hold_rows
from dlocore.kernels.march import march_steps
from dlocore.kernels.space import ROOM, ROOM_OF_POINT
from dlocore.kernels.tension import COLUMNS
from dlocore.kernels.timefit import fitted

# places in `info` after those of `march_steps`, and the total number of places
STRAIN, LEAST_SLOPE, MOST_SLOPE, GROWTH, SEEN = 5, 6, 7, 8, 9


@kernel
def smooth_motion(
    axes: Any, knots: Any, free_start: bool, free_end: bool, rule2: Any, w2: Any, rule3: Any, w3: Any, rule4: Any,
    w4: Any, masses: Any, start: Any, velocity: Any, memory: Any, times: Any, near: Any, rows: Any, sampled: Any,
    origin: Any, directions: Any, knots_t: Any, active: Any, p: Any, density: float, dragged: float, weight: Any,
    rho: float, tolerance: float, least_jump: float, every: int, looks: int, info: Any,
) -> Any:  # fmt: skip
    """March a smooth motion without twist from its start, and fit the time spline to it.

    Calls `build_tables`, `remember_start`, `hold_rows`, `begin_stretch`, `lasting`, `march_steps`, `to_ends_of_steps`,
    `after_jump` and `fitted` in this order; see there for arguments that are not described here.

    Args:
        axes: (0, 1) or (0, 1, 2).
        masses: point masses, as `build_tables` takes them.
        start, velocity: (n, nc) [m, m/s] of the control points at t = 0.
        memory: (points, 2) stress-free curvature and its natural value [1/m], in the plane; (0, 2) for a straight one.
        times: (steps + 1 + near,) [s] `near` times at the beginning, for velocity and acceleration of the paths,
            followed by those of the steps.
        rows, sampled: conditions of the grasps at `times`.
        origin, directions: (3,) [m] and (nc, 3), of the coordinates of the solve.
        weight: (nc,) [N/m] per unit length.
        least_jump: least jump of the velocity, times a step, that counts as a jump [m].
        every: every this many states, one is searched for folds.
        looks: least number of states at which the growth of a disturbance is checked; 0 for no check.
        info: (SEEN,) as in `march_steps`, followed by the largest axial strain of the motion, the least and the largest
            |r'| at the curvature points, and an approximate bound on the logarithm of the growth of a disturbance.

    Returns:
        The states (steps + 1, n, nc) [m], the velocity (n, nc) [m/s] just after t = 0, the reaction forces (steps + 1,
        held) [N], the `History` at the end of the motion, the control points (n_t, n, nc) [m] of the time spline, and
        the distance by which it misses each state (steps + 1,) [m].
    """
    one = np.int64(1)
    tables = build_tables(
        knots, free_start, free_end, rule2, w2, rule3, w3, rule4, w4, np.inf, np.inf, one, np.inf, masses
    )
    n, nc = start.shape
    points, stretched = len(tables.curvature.w), len(tables.axial.w)
    history = History(
        memory.copy() if len(memory) > 0 else np.zeros((points, MEMORY_IN_PLANE if nc == 2 else MEMORY_IN_SPACE)),
        np.zeros((points if keeps_curvature(active) else 0, PAST_IN_PLANE if nc == 2 else PAST_IN_SPACE)),
        np.zeros((stretched, 3)),
        np.zeros((0, 6)),
        np.zeros((0, 2)),
        np.zeros(0),
        np.full((stretched, COLUMNS), np.nan),
        np.zeros(0 if nc == 2 else ROOM + ROOM_OF_POINT * points),
    )
    if keeps_history(active):
        remember_start(axes, start, tables, active, p, history)
    no_clamps, no_spins = np.empty((0, 2), np.int64), np.empty((0, len(times)))
    e, offsets, _, _ = hold_rows(
        knots, nc, times, rows, sampled, origin, directions, no_clamps, no_spins, start, 1.0
    )  # fmt: skip
    load = np.empty((1, n, nc))
    for i in range(n):
        for d in range(nc):
            load[0, i, d] = tables.weight[i] * weight[d]
    steps = len(times) - near - 1
    first, inertial = np.int64(0), np.bool_(True)  # passed as constants, they would have separate kernels compiled
    h = times[near + 1] - times[near]
    closed, a, G, jump = begin_stretch(
        axes, start, velocity, density, dragged, tables, active, p, history, NO_RATES, load[0], e,
        offsets[:near],
        times[1] - times[0], inertial, nc,
    )  # fmt: skip
    reactions = np.zeros((steps + 1, len(e.held)))
    inertia = times_scalar_band(tables.inertia, a)
    for k in range(len(e.held)):
        i, d = e.held[k] // nc, e.held[k] % nc
        reactions[0, k] = density * inertia[i, d] + G[i, d]
    a, G = lasting(axes, start, a, G, density, h, tables, active, p, history, e)
    states = np.empty((steps + 1, n, nc))
    states[0] = start
    march_steps(
        axes, first, steps, first, h * jump > least_jump, h, rho, tolerance, states, closed.copy(), a, G, density,
        dragged, tables, active, p, history, load, e, offsets[near:], reactions, np.zeros((0, 0, 0)), info,
    )  # fmt: skip
    to_ends_of_steps(reactions, first, steps, rho / (1.0 + rho))
    if h * jump > least_jump:
        closed = after_jump(e, offsets[:near], times[1] - times[0], states[0], states[1], h)
    control, off = fitted(knots_t, times[near:], states, closed, nc)
    least, most = slopes(states, 1, tables.axial.first, tables.axial.b1)
    info[STRAIN] = max(0.0, most - 1.0, 1.0 - least)
    info[LEAST_SLOPE], info[MOST_SLOPE] = slopes(states, every, tables.curvature.first, tables.curvature.b1)
    if looks > 0:
        # np.expand_dims would give another array type, for which the rest would be compiled again
        m, past, axial = history.memory, history.past, history.axial
        kept = m.reshape((1, *m.shape)), past.reshape((1, *past.shape)), axial.reshape((1, *axial.shape))
        behind = History(*kept, history.stick, history.slide, history.pressing, np.zeros((0, COLUMNS)), history.room)
        at, lasts = looked_at(steps, looks), times[-1] - times[near]
        still = np.zeros((len(at) - 1, n, nc))
        rates = fastest_growth(
            axes, states[at[1:]], still, behind, tables, active, p, density, dragged, e, SLOWEST / lasts,
        )  # fmt: skip
        info[GROWTH] = rates.mean() * lasts
    return states, closed, reactions, history, control, off
