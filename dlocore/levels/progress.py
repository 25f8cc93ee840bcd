"""What a solve reports while it runs: its grids and iterates, as surfaces in the world frame."""

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from dlocore.answer.frames import free_control
from dlocore.answer.parts import Iteration
from dlocore.answer.report import elastic_energy, surface_of
from dlocore.levels.level import Level
from dlocore.pickling import Known
from dlocore.solvers.march import STRONGLY_DAMPED
from dlocore.solvers.monitor import Monitor
from dlocore.spline import SplineSurface

Floats = NDArray[np.float64]


_LARGE = 1.6e7  # bytes of a march's log, which is not kept for the surface of an iterate if it is larger


def record_level(level: Level, monitor: Monitor) -> None:
    """Report a level of refinement."""
    motion = level.motion
    note = "march" + (", strongly damped" if motion.rho == STRONGLY_DAMPED else "")
    note += f", {motion.split} steps in smaller ones" if motion.split else ""
    note += f", {level.note}" if level.note else ""
    record(level, level.control, monitor, update=level.change, residual=motion.update, note=note, kept=False)


def record(
    level: Level,
    control: Floats,
    monitor: Monitor,
    *,
    update: float,
    residual: float,
    note: str,
    damping: float = 0.0,
    step_length: float = 1.0,
    kept: bool = True,
) -> None:
    """Report an iterate `control` (n_t, n_u, nc) on the grid of a level; the rest is as in `Iteration`.

    If the level is not `kept` to the end of the solve, the iterate does not keep it either if it is large.
    """
    grid = level.motion.grid
    monitor.report(
        Iteration(
            number=len(monitor.iterations),
            update=update,
            residual=residual,
            wall_time=monitor.elapsed(),
            damping=damping,
            step_length=step_length,
            n_u=grid.n_u,
            n_t=len(control),
            find_surface=_finder(level, control, kept),
            find_energy=partial(elastic_energy, level.problem, grid, control[-1].copy(), level.motion.history),
            note=note,
        )
    )


def _finder(level: Level, control: Floats, kept: bool) -> Callable[[], SplineSurface]:
    """Return a function that finds the surface of an iterate when it is asked for; see `record`."""
    if level.problem.twist is None:
        return partial(surface_of, level.problem, level.motion.grid.knots, level.knots_t, control)
    find = partial(surface_at, level, control)
    return find if kept or level.motion.log.nbytes <= _LARGE else Known(find())


def surface_at(level: Level, control: Floats) -> SplineSurface:
    """Return the surface of control points (n_t, n_u, nc) on the knots of a level."""
    problem, motion, grid = level.problem, level.motion, level.motion.grid
    if problem.twist is not None:
        log = motion.log[:, : len(grid.tables.curvature.w)]  # with memory: copying the frames alone takes longer
        control = free_control(problem, grid, level.knots_t, control, motion.times[motion.logged], log)
    return surface_of(problem, grid.knots, level.knots_t, control)
