"""Bring a cable to rest downhill of its position: it slides in small steps until friction, if any, holds it."""

import numpy as np
from numpy.typing import NDArray

from dlocore.effects import laws
from dlocore.effects.contact import DEEPEST
from dlocore.kernels.assembly import History
from dlocore.kernels.march import DEEPEST as DEEPEST_PLACE
from dlocore.kernels.march import FAILED_STEP, march_steps
from dlocore.problem.discretisation import applied_at_rest
from dlocore.problem.events import closed_grasps
from dlocore.problem.grid import Grid
from dlocore.problem.holding import Starts, close_grasps, hold
from dlocore.problem.problem import Problem, firmer, stiffer_for
from dlocore.solvers.monitor import Monitor, TimeIsUp
from dlocore.statics.settling import RESTING, STIFFER, Rest

Floats = NDArray[np.float64]

_TOLERANCE = 1e-9  # of the length: the residual error of Newton's method in a step
_FIRST, _LONG, _LAST = 1e-3, 1e2, 1e3  # steps [s]: the first, one long enough to tell rest from creeping, the longest
_STEPS = 2000  # at most
_PATIENCE = 64  # steps, at most, until a failed length is tried again; the wait doubles each time it fails
_FARTHEST = 0.05  # of the length, per step: farther, the cable might pass through an obstacle
_RATES = (
    laws.DAMPING, laws.TWIST_DAMPING, laws.STRETCH_DAMPING, laws.QUADRATIC_DRAG,
    laws.BENDING_MEMORY, laws.TWIST_MEMORY, laws.STRETCH_MEMORY,
)  # fmt: skip


def slide_to_rest(problem: Problem, grid: Grid, monitor: Monitor) -> tuple[Floats, Rest, History]:
    """Return control points (n_u, nc) [m] at rest with the grasps at their first poses, the rest, and the history.

    The cable takes backward Euler steps, each of which forgets the velocity. Each is twice as long as the last, unless
    a step of that length has just failed. The cable goes where its energy falls, and friction, whose anchors it drags
    along, holds it where it can. Nothing yields on the way. If the cable sinks too deep into something, and might sink
    through it, it slides again with stiffer contact.

    Raises:
        Cancelled: the caller asked to stop.
    """
    allowed = DEEPEST * problem.scene.cable.diameter
    q, rest, history, deepest = _slid(problem, grid, monitor)
    for _ in range(STIFFER if problem.contact is not None else 0):
        if rest == "time" or deepest <= allowed:
            break
        problem = stiffer_for(problem, deepest)
        q, rest, history, deepest = _slid(problem, grid, monitor)
    return q, rest, history


def _slid(problem: Problem, grid: Grid, monitor: Monitor) -> tuple[Floats, Rest, History, float]:
    """Do what `slide_to_rest` does with the given contact stiffness; return also the largest depth on the way [m]."""
    cable = problem.scene.cable
    active, parameters = firmer(problem, 0.0).law_table()
    active[list(_RATES)] = 0
    axes, tables, length = problem.axes, grid.tables, cable.length
    history = grid.past()._replace(tension=grid.untensed())
    starts: Starts = {}
    grasps = closed_grasps(problem.scene, 0.0, 0.0)
    close_grasps(problem, grid, grasps, starts, None)
    held = hold(problem, grid, grasps, np.zeros(2), starts, grid.start)
    offsets = np.ascontiguousarray(held.offsets)
    applied, nothing, log = applied_at_rest(problem, grid, 0.0)[None], np.zeros_like(offsets), np.zeros((0, 0, 0))
    q, h, deepest = grid.start.copy(), _FIRST, 0.0
    longest, wait, patience = _LAST, 0, 1
    rest: Rest = "restless"
    for _ in range(_STEPS):
        try:
            monitor.check()
        except TimeIsUp:
            rest = "time"
            break
        states, info = np.array([q, q]), np.zeros(3)
        v, a, G = (np.zeros_like(q) for _ in range(3))
        info[FAILED_STEP] = -1
        before = [x.copy() for x in history]
        march_steps(
            axes, 0, 1, 0, True, h, 0.0, _TOLERANCE * length, states, v, a, G, cable.linear_density, 0.0, tables,
            active, parameters, history, applied, held.elimination, offsets, nothing, log, info,
        )  # fmt: skip
        moved = float(np.abs(states[1] - q).max())
        if info[FAILED_STEP] >= 0 or moved > _FARTHEST * length:
            for x, old in zip(history, before, strict=True):
                x[:] = old
            longest, wait, patience, h = 0.5 * h, patience, min(2 * patience, _PATIENCE), 0.25 * h
            continue
        q, deepest = states[1], max(deepest, float(info[DEEPEST_PLACE]))
        if moved <= RESTING * length and h >= _LONG:
            rest = "settled"
            break
        if h > longest:  # the length that had failed no longer does
            longest, patience = _LAST, 1
        wait = max(wait - 1, 0)
        h = min(2.0 * h, longest if wait > 0 else _LAST)
    kept = grid.history
    return q, rest, history._replace(memory=kept.memory, axial=kept.axial, tension=kept.tension), deepest
