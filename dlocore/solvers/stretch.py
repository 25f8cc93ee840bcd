"""The beginning of a stretch of smooth motion: what is held in it, and the state when the grasps close."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dlocore.kernels.assembly import NO_RATES, History
from dlocore.kernels.entry import after_jump, begin_stretch, lasting
from dlocore.problem.grid import Grid
from dlocore.problem.holding import Held, Starts, close_grasps, hold
from dlocore.problem.problem import Problem
from dlocore.problem.stopping import stopping_time
from dlocore.scene.scene import Grasp

Floats = NDArray[np.float64]

JUMPS = 1e-6  # of the length: a velocity jump that moves the cable less than this in a step is rounding
_STOPPED = 4.0  # times the time that drag takes: a start velocity that is stopped within a step counts as a jump
NEAR = 1e-3 * np.arange(3.0)  # of a step: for velocity and acceleration of the paths at the beginning


@dataclass(frozen=True, eq=False)
class Entry:
    """How a stretch begins.

    Attributes:
        held: what is held in it.
        offsets: (k, held) [m] prescribed part at the times of the stretch.
        closed: (n_u, nc) [m/s] velocity as the grasps close.
        v: the same, but zero if inertia is left out.
        a: (n_u, nc) [m/s^2] consistent acceleration.
        G: (n_u, nc) [N] forces f + C v - load.
        sudden: whether the velocity jumps.
        jumps: the same, but False if inertia is left out; if it is True, the acceleration is only that of the instant.
    """

    held: Held
    offsets: Floats
    closed: Floats
    v: Floats
    a: Floats
    G: Floats
    sudden: bool
    jumps: bool

    def velocity(self, q: Floats, later: Floats, h: float, after: float) -> Floats:
        """Return the velocity (n_u, nc) [m/s] with which the motion continues from q to a state `after` [s] later.

        Both states are (n_u, nc) [m]; h is the time step [s] with which the stretch was entered.
        """
        if not self.sudden:
            return self.closed
        e, near = self.held.elimination, self.held.offsets[:3]
        return np.asarray(after_jump(e, near, h * NEAR[1], q, later, after))


def enter(
    problem: Problem, grid: Grid, grasps: list[Grasp], starts: Starts, times: Floats, h: float, last: float, q: Floats,
    v: Floats, history: History, load: Floats,
) -> Entry:  # fmt: skip
    """Close the grasps of a stretch and return how it begins.

    Args:
        problem: what is solved.
        grid: its space discretisation.
        grasps: those that hold in the stretch.
        starts: where paths begin; those of grasps that close now are added.
        times: (k,) [s] of the stretch.
        h: time step [s].
        last: the time step before it [s], 0 at the start of the motion.
        q, v: (n_u, nc) state and velocity before [m, m/s].
        history: the history; the strain of q is written to it.
        load: (n_u, nc) applied forces at its beginning [N].
    """
    close_grasps(problem, grid, grasps, starts, q)
    held = hold(problem, grid, grasps, np.concatenate([times[0] + h * NEAR, times]), starts, q)
    # the rate of a strain that hardly changes is lost in the error that steps leave in the velocities
    rates = (1.0 / last, 0.0, -1.0 / last, 0.0) if last > 0.0 else NO_RATES
    inertial = problem.inertia is not None
    closed, a, G, jump = begin_stretch(
        problem.axes, q, v, problem.mass_density(), problem.drag_coefficient(), grid.tables,
        *problem.laws, history, rates, load, held.elimination, held.offsets[:3], h * NEAR[1], inertial,
        problem.plane.dimensions,
    )  # fmt: skip
    started = closed.copy() if inertial else np.zeros_like(closed)
    sudden = h * jump > (JUMPS * problem.scene.cable.length if last > 0.0 else least_jump(problem, h))
    return Entry(held, held.offsets[3:], closed, started, a, G, sudden, sudden and inertial)


def least_jump(problem: Problem, h: float) -> float:
    """Return the size from which on a velocity jump at the start counts, as its displacement in a step of `h` [s] [m].

    If drag stops what moves then within the step, any velocity counts: the motion begins with a jump.
    """
    return -1.0 if h > _STOPPED * stopping_time(problem) else JUMPS * problem.scene.cable.length


def with_what_lasts(
    problem: Problem, grid: Grid, entry: Entry, a: Floats, h: float, q: Floats, history: History
) -> tuple[Floats, Floats]:
    """Return acceleration and forces (n_u, nc) with which the steps of a stretch begin [m/s^2, N].

    They are `a`, with which it is entered at the state q [m], and `entry.G`, without what does not last for a step `h`
    [s], see `lasting`.
    """
    if problem.inertia is None:
        return a, entry.G
    found: tuple[Floats, Floats] = lasting(
        problem.axes, q, a, entry.G, problem.mass_density(), h, grid.tables, *problem.laws, history,
        entry.held.elimination,
    )  # fmt: skip
    return found
