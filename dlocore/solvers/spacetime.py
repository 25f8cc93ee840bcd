"""The paper's least squares over all collocation points, in a weighted form that converges.

The motion is split into windows where velocity or acceleration jumps. In each window, Gauss-Newton iteration from a
march finds the control points of a clamped time spline, until the update is below delta (paper eq. 25).
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from dlocore.answer.reactions import WindowForces
from dlocore.effects import laws
from dlocore.kernels.anderson import advance, room
from dlocore.kernels.assembly import History, times_scalar_band
from dlocore.kernels.banded import expand_rows, place_rows
from dlocore.kernels.blocks import REACH, factor_rows
from dlocore.kernels.entry import after_jump
from dlocore.kernels.leastsquares import (
    POINTS,
    Equations,
    collocation,
    holding_forces,
    normal_equations,
    resting_strains,
)
from dlocore.kernels.march import constrained_mass_solve
from dlocore.kernels.timefit import fit_time
from dlocore.problem.discretisation import applied_forces
from dlocore.problem.events import closed_grasps
from dlocore.problem.grid import Grid
from dlocore.problem.holding import Held, Starts, close_grasps, hold
from dlocore.problem.problem import Problem
from dlocore.scene.scene import Grasp
from dlocore.solvers.march import March
from dlocore.solvers.monitor import Monitor
from dlocore.solvers.stretch import JUMPS

Floats = NDArray[np.float64]

MAX_ITERATIONS = 200
_CHUNK = 1.5e7  # multiplications between two checks of the clock, about
_HISTORY = 4  # iterates that Anderson acceleration combines
_FRESH = 2  # iterations that have their own normal matrix, at least; after them a matrix serves at least twice
_SHRINKS = 0.7  # of the previous update: if an update is larger, the next iteration gets its own matrix too
_PATIENCE = 20  # iterations after which the least update has to be below ...
_FALLS = 0.9  # ... this share of what it was; else it won't fall below delta, as most do in 15 iterations, few in 40
_DAMPING = 1e-6  # of the diagonal, for normal equations whose factors are no longer positive because of rounding
_LARGEST_STEP = 0.25  # of the length, in one control point: a larger step is shortened
_SHORT = 1e-6  # [s] after an event: to find the velocity of what is held
LARGEST_STRAIN = 0.003  # of a cable with the bounded axial stiffness under the largest tension of the march
RESOLVED = 15.0  # times mu L^2/h^2: the axial stiffness that a time spline of span h resolves


@dataclass(frozen=True, eq=False)
class Window:
    """A smooth part of the motion, from `begin` to `end` [s], with its own clamped time knots (n + 4,) [s]."""

    begin: float
    end: float
    knots: Floats
    velocity_jumps: bool


def windows_of(problem: Problem, knots_t: Floats) -> list[Window]:
    """Split the time knots into windows at the events where velocity or acceleration jumps."""
    cuts = [e for e in problem.events if e.multiplicity > 1]
    if not cuts:
        return [Window(0.0, problem.horizon, knots_t, False)]
    marks = [0.0, *[e.time for e in cuts], problem.horizon]
    windows = []
    for i, (a, b) in enumerate(pairwise(marks)):
        inner = knots_t[(knots_t > a) & (knots_t < b)]
        knots = np.concatenate([np.full(4, a), inner, np.full(4, b)])
        windows.append(Window(a, b, knots, i > 0 and cuts[i - 1].multiplicity == 3))
    return windows


def join(parts: list[Floats], windows: list[Window]) -> Floats:
    """Join the windows' control points (n, ...) into those of the whole time spline."""
    joined = parts[0]
    for part, window in zip(parts[1:], windows[1:], strict=True):
        kept = joined if window.velocity_jumps else joined[:-1]
        joined = np.concatenate([kept, part[1:]])
    return joined


def bounded_axial_stiffness(problem: Problem, largest_tension: float, span: float) -> float:
    """Return the axial stiffness [N] of the least squares: what the time spline resolves, never above the true one.

    Collocated in time, near-inextensibility over-constrains the time spline (docs/model.md eq. 15a).
    """
    cable = problem.scene.cable
    true = problem.stretch.axial_stiffness
    resolved = RESOLVED * cable.linear_density * (cable.length / span) ** 2
    buckles = 400.0 * (problem.bend.bending_stiffness if problem.bend else 0.0) / cable.length**2
    return min(true, max(largest_tension / LARGEST_STRAIN, resolved, buckles))


def behind_softer(problem: Problem, motion: March, times: Floats, axial_stiffness: float) -> History:
    """Return the history of a march at the times (k,) [s] for a cable of another axial stiffness [N].

    With the strain of the march, that cable bears the same tension (docs/model.md eq. 15b).
    """
    history, true = motion.behind(times), problem.stretch.axial_stiffness
    if axial_stiffness == true:
        return history
    active, parameters = problem.laws
    viscosity = float(parameters[laws.STRETCH_DAMPING, 0]) if active[laws.STRETCH_DAMPING] else 0.0
    axial = resting_strains(
        motion.times, motion.states, times, motion.grid.tables, history.axial, true, viscosity, axial_stiffness
    )
    return history._replace(axial=axial)


class WindowSolver:
    """The least squares of one window; it holds the equations, and the iterate is passed in and out."""

    def __init__(
        self,
        problem: Problem,
        grid: Grid,
        window: Window,
        grasps: list[Grasp],
        starts: Starts,
        start: Floats,
        velocity: Floats,
        motion: March,
        axial_stiffness: float,
        monitor: Monitor,
    ) -> None:
        self.problem, self.grid, self.motion, self.monitor = problem, grid, motion, monitor
        self.nc = problem.nc
        self.times, weights, first, table, fine = collocation(window.knots)
        active, parameters = problem.law_table()
        parameters[laws.STRETCH, 0] = axial_stiffness
        active[laws.STRETCH_DAMPING] = 0  # so soft a cable has no waves of stretch that need damping
        self.held = hold(problem, grid, grasps, fine, starts, start)
        e = self.held.elimination
        self.equations = Equations(
            axes=problem.axes,
            first=first,
            table=table,
            weights=weights,
            h=(window.end - window.begin) * POINTS / len(self.times),
            density=problem.mass_density(),
            dragged=0.0 if len(problem.masses) else problem.drag_coefficient(),
            beside=problem.drag_coefficient() if len(problem.masses) else 0.0,
            tables=grid.tables,
            active=active,
            p=parameters,
            histories=behind_softer(problem, motion, self.times, axial_stiffness),
            applied=applied_forces(problem, grid, self.times),
            e=e,
        )
        rates = velocity.reshape(-1)[e.held].copy()
        for k in range(len(e.held)):
            for s in range(e.start[k], e.start[k + 1]):
                rates[k] -= e.coefficient[s] * velocity.reshape(-1)[e.dof[s]]
        self.offsets = (
            fit_time(window.knots, fine, self.held.offsets, rates)
            if len(e.held)
            else np.zeros((len(window.knots) - 4, 0))
        )
        self.free = grid.n_u * self.nc - len(e.held)

    def constrain(self, control: Floats) -> Floats:
        """Return control points (n, n_u, nc) whose held degrees of freedom follow the grasps."""
        control = control.copy()
        place_rows(self.held.elimination, self.offsets, control, 2)
        return control

    def objective(self, control: Floats, matrix: bool) -> tuple[float, Floats, Floats]:
        """Return the objective [m^2], the normal matrix in blocks, and its right side at `control`.

        See docs/model.md eq. 16. Without `matrix` the normal matrix, which is most of the work, is left out.
        """
        count, eq = len(control) - 2, self.equations
        A = np.zeros(
            (count if matrix else 0, self.free, REACH * self.free)
        )  # lazily: a large one is not cleared at once
        right = np.zeros(count * self.free)
        value = 0.0
        spans = len(self.times) // POINTS
        part = max(1, round(_CHUNK / (POINTS * self.free**3))) if matrix else spans
        for begin in range(0, spans, part):
            self.monitor.check()
            value += normal_equations(eq, control, A, right, matrix, begin, min(begin + part, spans))
        weight = 12.0 * eq.density / eq.h**2 + 2.0 * eq.dragged / eq.h
        return value / (weight * self.problem.scene.cable.length), A, right

    def factor(self, A: Floats, damping: float) -> bool:
        """Write the factors of A + damping diag A to A; return whether they are positive."""
        if damping > 0.0:
            A.reshape(len(A), -1)[:, :: A.shape[2] + 1] *= 1.0 + damping
        size = len(A) * self.free
        rows = max(1, round(_CHUNK / A.shape[2] ** 2))
        for start in range(0, size, rows):
            self.monitor.check()
            if factor_rows(A, start, min(start + rows, size)) >= 0:
                return False
        return True

    def expand(self, x: Floats) -> Floats:
        """Return the change (n, n_u, nc) of all control points for a step x of the free ones."""
        steps = x.reshape(-1, self.free)
        change = np.zeros((len(steps) + 2, self.grid.n_u, self.nc))
        change[2:] = expand_rows(self.held.elimination, steps, self.grid.n_u * self.nc).reshape(change[2:].shape)
        return change

    def forces(self, control: Floats) -> Callable[[], WindowForces]:
        """Return a function that finds what holds the cable at `control`."""
        lean = self.equations._replace(histories=None)  # the motion has them, and is kept
        return partial(_window_forces, self.problem, self.motion, self.held, self.times, lean, control)


def _window_forces(
    problem: Problem, motion: March, held: Held, times: Floats, lean: Equations, control: Floats
) -> WindowForces:
    equations = lean._replace(histories=behind_softer(problem, motion, times, float(lean.p[laws.STRETCH, 0])))
    return WindowForces(held, times, *holding_forces(equations, control))


FindForces = Callable[[], tuple[WindowForces, ...]]


@dataclass(frozen=True, eq=False)
class Solved:
    """A solution in space and time, by this least squares or by the printed scheme.

    Attributes:
        control: (n_t, n_u, nc) [m]; that of the march from the first window on that did not converge.
        converged: whether the update fell below delta in every window.
        update: the last update norm [m], the largest over the solved windows; for a window that did not converge, its
            least update.
        find_forces: finds what holds the cable in each solved window, at its collocation points; None for the printed
            scheme.
    """

    control: Floats
    converged: bool
    update: float
    find_forces: FindForces | None


OnStep = Callable[[Floats, float, float, float, float], None]


def solve(problem: Problem, motion: March, knots_t: Floats, delta: float, monitor: Monitor, on_step: OnStep) -> Solved:
    """Solve the space-time least squares, started from a march on the same grid.

    Gauss-Newton steps with the positive semidefinite part of the tangent are combined over the last iterates by
    Anderson acceleration (Walker and Ni, 2011), until the norm of the update of all control points is below `delta`.
    The first window that does not reach this is the last one that is tried.

    Args:
        problem: what is solved.
        motion: the march.
        knots_t: knots of the time spline [s].
        delta: threshold on the update [m].
        monitor: of the solve.
        on_step: called with (control, update, residual, damping, step length) after every iteration.

    Raises:
        Cancelled: the caller asked to stop.
    """
    grid = motion.grid
    tension = motion.largest_strain * problem.stretch.axial_stiffness
    windows = windows_of(problem, knots_t)
    guess = [_window_fit(motion, w) for w in windows]
    parts: list[Floats] = []
    forces: list[Callable[[], WindowForces]] = []
    starts: Starts = {}
    q, v = motion.states[0], motion.velocity
    worst = 0.0
    for i, window in enumerate(windows):
        grasps = closed_grasps(problem.scene, window.begin, window.end)
        close_grasps(problem, grid, grasps, starts, q)
        span = (window.end - window.begin) / (len(window.knots) - 7)
        stiffness = bounded_axial_stiffness(problem, tension, span)
        if i > 0:
            near = hold(problem, grid, grasps, window.begin + _SHORT * np.arange(3.0), starts, q)
            v = _closed(problem, motion, window, near, v)
        solver = WindowSolver(problem, grid, window, grasps, starts, q, v, motion, stiffness, monitor)
        control = guess[i]
        control[0] = q
        control[1] = q + v * (window.knots[4] - window.knots[1]) / 3
        control = solver.constrain(control)

        def show(iterate: Floats, update: float, residual: float, damping: float, length: float, at: int = i) -> None:
            on_step(join([*parts, iterate, *guess[at + 1 :]], windows), update, residual, damping, length)

        control, update = _iterate(solver, control, delta, monitor, show)
        worst = max(worst, update)
        if not update < delta:
            return Solved(join([*parts, *guess[i:]], windows), False, worst, lambda: tuple(find() for find in forces))
        parts.append(control)
        forces.append(solver.forces(control))
        q = control[-1]
        v = 3 * (control[-1] - control[-2]) / (window.knots[-2] - window.knots[-5])
    return Solved(join(parts, windows), True, worst, lambda: tuple(find() for find in forces))


def _closed(problem: Problem, motion: March, window: Window, near: Held, v: Floats) -> Floats:
    """Return the velocity that v (n_u, nc) [m/s] becomes when a window begins and its grasps close.

    `near` is what is held then, and _SHORT and 2 _SHORT later. If the velocity jumps, the result is that with which the
    march continues.
    """
    rate = (4 * near.offsets[1] - 3 * near.offsets[0] - near.offsets[2]) / (2 * _SHORT)
    mass = motion.grid.tables.inertia
    closed = constrained_mass_solve(problem.nc, mass, near.elimination, rate, times_scalar_band(mass, v))
    k = int(np.searchsorted(motion.times, window.begin - 1e-12))
    step = motion.times[k + 1] - motion.times[k]
    if step * np.abs(closed - v).max() <= JUMPS * problem.scene.cable.length:
        return np.asarray(closed)
    return np.asarray(after_jump(near.elimination, near.offsets, _SHORT, *motion.states[k : k + 2], step))


def _window_fit(motion: March, window: Window) -> Floats:
    """Return control points (n, n_u, nc) of the march inside a window."""
    inside = slice(*np.searchsorted(motion.times, (window.begin - 1e-12, window.end + 1e-12)))
    times, states = motion.times[inside], motion.states[inside]
    k, n_u, nc = states.shape
    step = times[1] - times[0]
    v = (4 * states[1] - 3 * states[0] - states[2]) / (2 * step)
    return fit_time(window.knots, times, states.reshape(k, -1), v.reshape(-1)).reshape(-1, n_u, nc)


def _iterate(
    solver: WindowSolver, control: Floats, delta: float, monitor: Monitor, on_step: OnStep
) -> tuple[Floats, float]:
    """Iterate one window; return its control points and the norm of the last update [m], or the least if none is small.

    It ends if the least update has fallen by less than a tenth in the last _PATIENCE iterations.

    As long as updates shrink, the normal matrix of an earlier iterate is reused, which takes a fraction of the time;
    only the right side has to be new. A fresh matrix is also used for the next iteration: combining the last steps
    gains as much as another matrix would.
    """
    limit = _LARGEST_STEP * solver.problem.scene.cable.length
    last = room(_HISTORY, control.size)
    best: list[float] = []  # the least update so far, by iteration
    factors: Floats | None = None
    damping, before = 0.0, np.inf
    for known in range(MAX_ITERATIONS):
        monitor.check()
        fresh = factors is None
        if factors is None:
            value, factors, right, damping = _linearised(solver, control)
        else:
            value, _, right = solver.objective(control, False)
        if factors is None or not np.isfinite(value):
            break
        update, length, following = advance(solver.held.elimination, factors, right, control, last, known, limit, delta)
        if not np.isfinite(update):
            break
        on_step(following, update, float(np.sqrt(value)), damping, length)
        if update < delta:
            return following, update
        best.append(min([update, *best[-1:]]))
        if known >= _PATIENCE and best[-1] > _FALLS * best[-1 - _PATIENCE]:
            break
        if known + 1 < _FRESH or not (fresh or update < _SHRINKS * before):
            factors = None
        control, before = following, update
    return control, best[-1] if best else np.inf


def _linearised(solver: WindowSolver, control: Floats) -> tuple[float, Floats | None, Floats, float]:
    """Return the objective, the factors of the normal matrix, its right side, and the damping that was needed.

    The factors are None if the matrix is not positive even with damping.
    """
    damping = 0.0
    while True:
        value, A, right = solver.objective(control, True)
        if np.isfinite(value) and solver.factor(A, damping):
            return value, A, right, damping
        if damping > 0.0 or not np.isfinite(value):
            return value, None, right, damping
        damping = _DAMPING
        del A  # it is spoilt, and most of the memory of a solve
