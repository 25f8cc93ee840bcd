"""The march of a smooth motion without twist in one compiled call: the simplest and most frequent kind of motion."""

from functools import partial

import numpy as np
from numpy.typing import NDArray

from dlocore.answer.reactions import WindowForces
from dlocore.kernels.basis import GAUSS_2, GAUSS_3, GAUSS_4
from dlocore.kernels.march import FAILED_STEP, LEFT
from dlocore.kernels.motion import GROWTH, LEAST_SLOPE, MOST_SLOPE, SEEN, STRAIN, smooth_motion
from dlocore.problem.events import closed_grasps
from dlocore.problem.features import free_ends
from dlocore.problem.grid import Grid
from dlocore.problem.holding import Starts, close_grasps, constraint_rows, hold
from dlocore.problem.problem import Problem
from dlocore.problem.time_grid import marks_of
from dlocore.scene.scene import Grasp
from dlocore.solvers.march import March, chunk_of, every_of, tolerance_of
from dlocore.solvers.monitor import Monitor, TimeIsUp
from dlocore.solvers.stretch import NEAR, least_jump

Floats = NDArray[np.float64]

_STRAIGHT = np.empty((0, 2))
_NO_LOG = np.zeros((0, 0, 0))


def march_smooth(
    problem: Problem, grid: Grid, steps: int, knots_t: Floats, monitor: Monitor, rho: float, looks: int = 0
) -> tuple[March, Floats, Floats] | None:
    """March a motion without events and without twist, and fit the time spline to it.

    Args:
        knots_t: (n_t + 4,) [s] of the time spline.
        rho: spectral radius.
        looks: how many states are examined, at least, for whether a disturbance may grow.

    Returns:
        What `march` and `fit` return. None if they have to be used instead: if there is more to the motion, if it takes
        so long that the clock has to be checked in between, or if a step found no equilibrium.

    Raises:
        Cancelled: the caller asked to stop.
    """
    marks = marks_of(problem)
    if not _is_plain(problem) or len(marks) > 2 or steps > chunk_of(problem, grid):
        return None
    try:
        monitor.check()
    except TimeIsUp:
        return None
    h = problem.horizon / steps
    times = np.concatenate([h * NEAR, h * np.arange(steps + 1)])
    times[-1] = problem.horizon
    grasps = closed_grasps(problem.scene, 0.0, problem.horizon)
    starts: Starts = {}
    close_grasps(problem, grid, grasps, starts, grid.start)
    _, rows, sampled = constraint_rows(grasps, times, starts)
    memory = _STRAIGHT if problem.rests_straight or problem.nc == 3 else grid.history.memory
    info = np.zeros(SEEN)
    info[FAILED_STEP] = -1
    states, closed, forces, history, control, off = smooth_motion(
        problem.axes, grid.knots, *free_ends(problem.scene), *GAUSS_2, *GAUSS_3, *GAUSS_4, problem.masses, grid.start,
        grid.velocity, memory, times, len(NEAR), rows, sampled, problem.plane.origin, problem.plane.axes, knots_t,
        *problem.laws, problem.mass_density(), problem.drag_coefficient(), problem.weight(), rho,
        tolerance_of(problem, grid, problem.horizon / (steps + 1)), least_jump(problem, h),
        every_of(steps + 1), looks, info,
    )  # fmt: skip
    if info[FAILED_STEP] >= 0:
        return None
    times = times[len(NEAR) :]
    motion = March(
        grid=grid,
        times=times,
        states=states,
        steps=steps,
        asked=steps,
        velocity=closed,
        find_forces=partial(_forces, problem, grid, grasps, starts, times, forces, states),
        history=history,
        log=_NO_LOG,
        reached=steps,
        stopped="",
        rho=rho,
        split=0,
        largest_strain=float(info[STRAIN]),
        slopes=(float(info[LEAST_SLOPE]), float(info[MOST_SLOPE])),
        update=float(info[LEFT]),
        deepest=0.0,
        growth=float(info[GROWTH]) if looks > 0 else None,
    )
    return motion, control, off


def _is_plain(problem: Problem) -> bool:
    """Tell whether a motion has inertia but neither twist, loads, contact nor anything that yields."""
    return (
        problem.twist is None
        and problem.inertia is not None
        and not problem.touches
        and problem.bending_memory is None
        and problem.stretch_memory is None
        and problem.start.material is None
        and not problem.start.bow
        and not problem.scene.loads
    )


def _forces(
    problem: Problem, grid: Grid, grasps: list[Grasp], starts: Starts, times: Floats, forces: Floats, states: Floats
) -> tuple[WindowForces, ...]:
    return (WindowForces(hold(problem, grid, grasps, times, starts, grid.start), times, forces, states),)
