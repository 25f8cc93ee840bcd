"""The comparison march on another grid, from which the error on a given grid is estimated."""

from dataclasses import replace
from typing import NamedTuple

from dlocore.levels.level import Level, Size, distance, run_level, turned
from dlocore.levels.whole_march import march_status
from dlocore.problem.discretisation import smallest_n_u
from dlocore.problem.problem import Problem
from dlocore.problem.time_grid import smallest_n_t
from dlocore.solvers.monitor import Monitor, TimeIsUp

FINER = 1.5  # times n_u, n_t and the steps
COARSER, FEWER = 0.75, 0.5  # times n_u and n_t, and times the steps
_SAFETY = 1.5  # times the distance to a finer march: a slowly converging motion may be off by more than that distance
_LEFT = 0.75  # times the distance to a coarser march: benchmarks.estimate
_LEFT_KINKED = 1.0  # the same for a `kinked` march
_ROOM = 0.8  # of n_u and n_t: a march with more than this does not count as coarser
TOO_LATE = "The time limit passed before its error was estimated."
UNKNOWN = "Its error is not known"


class Compared(NamedTuple):
    """The error of a march on one grid, from a march on another.

    Attributes:
        estimate: the estimated error [m]; None if there is none.
        doubt: why there is none, in words.
        turned: largest angle between the sections of the two [rad].
        beside: the other level; empty if there is no estimate.
    """

    estimate: float | None
    doubt: str = ""
    turned: float = 0.0
    beside: tuple[Level, ...] = ()

    def on(self, level: Level) -> Level:
        """Return a level together with what it was compared with."""
        return replace(level, turned=self.turned, beside=self.beside) if self.beside else level


def coarser(problem: Problem, size: Size) -> Size | None:
    """Return the size of the march from which the error on a given grid is estimated; None if it is not coarser."""
    other = _resized(problem, size, COARSER, FEWER)
    return other if other.n_u <= _ROOM * size.n_u and other.n_t <= _ROOM * size.n_t else None


def finer(problem: Problem, size: Size) -> Size:
    """Return the size of a grid that is finer by a factor of 1.5."""
    return _resized(problem, size, FINER, FINER)


def by_coarser(problem: Problem, level: Level, monitor: Monitor) -> Compared:
    """Return the estimated error of a march on a given grid.

    It is a share of the distance to a march on a coarser grid, which takes less than half the time. If no coarser grid
    is possible, or its march fails, a finer one is used.
    """
    size = coarser(problem, level.size)
    if size is not None:
        other, said = _marched(problem, size, level, monitor)
        if other is None:
            return Compared(None, said)
        if march_status(other)[0] == "converged":
            left = _LEFT_KINKED if level.motion.kinked else _LEFT
            return _compared(left, level, other)
    return by_finer(problem, level, monitor)


def by_finer(problem: Problem, level: Level, monitor: Monitor) -> Compared:
    """Return the estimated error of a solution on a given grid.

    It is the distance to a march on a grid finer by a factor of 1.5, with a margin.
    """
    other, said = _marched(problem, finer(problem, level.size), level, monitor)
    if other is None:
        return Compared(None, said)
    if other.motion.stopped:
        return Compared(None, f" {UNKNOWN}: the finer march to compare it with found no equilibrium.")
    return _compared(_SAFETY, level, other)


def _compared(share: float, level: Level, other: Level) -> Compared:
    """Return the estimate as a share of the distance to another march."""
    apart = share * distance(level, other)
    return Compared(apart, turned=turned(level, other), beside=(other.lean,))


def _resized(problem: Problem, size: Size, points: float, steps: float) -> Size:
    """Return a size with scaled control points, but at least as many as the problem needs, and scaled steps."""
    n_u = max(smallest_n_u(problem), round(points * size.n_u))
    n_t = max(smallest_n_t(problem), round(points * size.n_t))
    return Size(n_u, n_t, round(steps * size.steps))


def _marched(problem: Problem, size: Size, level: Level, monitor: Monitor) -> tuple[Level | None, str]:
    """March on another grid than a level; return None and the reason if that is of no use or the time is up."""
    if level.motion.stopped:
        return None, ""
    try:
        monitor.check()
        other = run_level(problem, *size, monitor, booked=False, like=level.motion.grid, whole=True)
    except TimeIsUp:
        return None, f" {TOO_LATE}"
    finally:
        monitor.phase("estimate")
    return other, ""
