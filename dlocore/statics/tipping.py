"""Starts that settle on an unstable equilibrium: they are tipped off it and settle further.

An example is an arch that stands on two points that let it turn. A start that is symmetric to the vertical slides up to
it: the forces balance there, but no cable stays. The tangent K of such a state has a negative eigenvalue.
"""

import numpy as np
from numpy.typing import NDArray

from dlocore.kernels.assembly import NO_RATES, add_scalar_band, assemble, times_scalar_band
from dlocore.kernels.banded import solve_free
from dlocore.problem.buckling import BOW
from dlocore.problem.discretisation import applied_at_rest
from dlocore.problem.events import closed_grasps
from dlocore.problem.grid import Grid
from dlocore.problem.holding import Starts, close_grasps, hold
from dlocore.problem.problem import Problem
from dlocore.solvers.monitor import Monitor
from dlocore.spline import greville
from dlocore.stability.sideways import is_looked_at
from dlocore.statics.settling import settle
from dlocore.words import in_mm

Floats = NDArray[np.float64]

TIPPED = "at rest the cable stands on an unstable equilibrium"
_SLACK = 1e-4  # of what weighs on the cable and bends it: a stiffness that may be rounding
_STIFFER = 4.0  # times: factor between the springs that are tried until they hold the cable
_SPRINGS = 20  # tried, at most
_ITERATIONS = 30  # of the search for the way in which it falls
_SIDE = np.array([1.0, 0.7, 0.4])  # the side to which it falls, of two opposite ones: the same on every grid
_LOPSIDED = 0.37  # the end counts more than the beginning by this, since they may go to opposite sides
_FALLS = 3  # from one such equilibrium to another, at most


def tipped(problem: Problem, grid: Grid, monitor: Monitor, at: float = 0.0, starts: Starts | None = None) -> Grid:
    """Return a settled grid, free of contact, tipped off an equilibrium where it would fall and settled further.

    The tip is `BOW` of the length, in the shape of the fastest fall. If it finds no rest after it, or falls again and
    again, the grid is returned as it is. A start is not tipped if friction holds it, or if it lies in a plane and
    `stability/sideways.py` decides whether it leaves that.

    Args:
        problem: the equations.
        grid: the grid.
        monitor: of the solve.
        at: the grasps are at their poses of this time [s].
        starts: where the paths of the grasps begin; by default all at t = 0.

    Raises:
        Cancelled: the caller asked to stop.
    """
    if not may_fall(problem):
        return grid
    now = grid
    for _ in range(_FALLS):
        way = falls(problem, now, at, starts)
        if way is None:
            return now
        off = now.changed(start=now.start + BOW * problem.scene.cable.length * way)
        found = settle(problem, off, at, monitor, starts=starts)
        if found.rest != "settled":
            return grid
        now = now.changed(start=found.q, history=found.history, tipped=True)
    return grid if falls(problem, now, at, starts) is not None else now


def may_fall(problem: Problem) -> bool:
    """Tell whether a start of a problem is to be tipped if it would fall."""
    # a cable straight when stress-free, in a plane that it may leave, gets a bow instead if `is_unstable` says so
    bowed = problem.plane.dimensions == 3 and problem.rest_plane.dimensions == 2 and is_looked_at(problem)
    return not problem.touches and not bowed


def to_a_side(u: Floats) -> Floats:
    """Return displacements (n, 3) along a cable at u (n,), relative to its length: a start falls to their side."""
    return (1.0 + _LOPSIDED * u)[:, None] * _SIDE


def tip_notes(tipped: bool, length: float) -> list[str]:
    """Return the notes about a start that was tipped; `length` [m] is that of the cable."""
    tip = f"it is tipped by {in_mm(BOW * length)}, and another side may be as likely"
    return [f"{TIPPED}: {tip}"] if tipped else []


def falls(problem: Problem, grid: Grid, at: float = 0.0, starts: Starts | None = None) -> Floats | None:
    """Return the direction (n_u, nc) in which a start at rest falls, or None if it stays; see `tipped`.

    Its largest displacement is one, or less if sections turn by more than that over the length. It is the eigenvector
    of the least eigenvalue of the tangent, if that is negative. It is found by inverse iteration, with springs just
    strong enough to hold the cable.
    """
    cable, nc, q, dimensions = problem.scene.cable, problem.nc, grid.start, problem.plane.dimensions
    grasps = closed_grasps(problem.scene, at, at)
    starts = {} if starts is None else starts
    close_grasps(problem, grid, grasps, starts, q)
    elimination = hold(problem, grid, grasps, np.full(2, at), starts, q).elimination
    active, parameters = problem.law_table()
    pull = float(np.abs(applied_at_rest(problem, grid, at)).max())  # largest force on any control point [N]

    def pushed(springs: float, right: Floats) -> Floats | None:
        f, K = np.empty_like(q), np.empty((q.size, 4 * nc))
        assemble(
            problem.axes, q, np.zeros_like(q), grid.tables, active, parameters, grid.past(), NO_RATES, (1.0, 0.0, 1.0),
            f, K,
        )  # fmt: skip
        add_scalar_band(nc, grid.tables.unit, springs, K)
        change, positive = solve_free(elimination, K, np.ascontiguousarray(right).ravel())
        return change.reshape(q.shape) if positive else None

    u = greville(grid.knots) / cable.length
    way = np.zeros_like(q)
    way[:, :dimensions] = to_a_side(u)[:, :dimensions]
    springs = _SLACK * problem.stiffness_aside(pull)
    if pushed(springs, way) is not None:
        return None
    for _ in range(_SPRINGS):
        springs *= _STIFFER
        if pushed(springs, way) is not None:
            break
    else:
        return None
    side = way.copy()
    turn = cable.length / problem.twist.radius if problem.twist is not None else 0.0
    for _ in range(_ITERATIONS):
        moved = pushed(springs, times_scalar_band(grid.tables.unit, way))
        assert moved is not None, "these springs hold it"
        size = float(np.abs(moved[:, :dimensions]).max())
        way = moved / max(size, turn * float(np.abs(moved[:, dimensions:]).max(initial=0.0)))
    farthest = np.sum(way**2, axis=1, keepdims=True)  # it falls to where it moves farthest, whatever it does elsewhere
    return way if float(np.sum(farthest * way * side)) >= 0.0 else -way
