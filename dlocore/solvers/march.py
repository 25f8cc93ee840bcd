"""The compiled march: implicit steps of the spatial spline, fitted by the time spline."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from dlocore.discretisation import Grid, Starts, applied_forces, close_grasps, hold
from dlocore.kernels.assembly import largest_strain
from dlocore.kernels.basis import graded_knots
from dlocore.kernels.march import (
    FAILED_STEP,
    LEFT,
    constrained_mass_solve,
    fit_time,
    initial_state,
    march_steps,
)
from dlocore.paths import Move, Waypoints
from dlocore.problem import Problem
from dlocore.report import WindowForces
from dlocore.scene import Grasp
from dlocore.solvers.monitor import Monitor, TimeIsUp

Floats = NDArray[np.float64]

# Spectral radius at infinite frequency. 0.9 is a little more accurate where the motion is smooth, but in stiff,
# undamped motion energy grows without bounds; 0.5 holds nearly always, 0 always (docs/model.md).
RHO = 0.5
STRONGLY_DAMPED = 0.0
TOLERANCE = 3e-7  # of the length, on the error that the Newton iterations of a step leave
_CHUNK = 256  # steps between looks at the clock
_SPLITS = (4, 16, 64)  # parts of a step that found no equilibrium


@dataclass(frozen=True, eq=False)
class Event:
    """A time at which the motion is not smooth, and how much of it jumps.

    Attributes:
        time: [s].
        multiplicity: of the time knot there: 1 smooth, 2 acceleration jumps, 3 velocity jumps.
    """

    time: float
    multiplicity: int


@dataclass(frozen=True, eq=False)
class March:
    """A marched motion.

    Attributes:
        grid: space discretisation.
        times: (steps + 1,) [s].
        states: (steps + 1, n_u, nc) control points at those times.
        velocity: (n_u, nc) [m/s] just after t = 0.
        forces: what holds the cable between each two events.
        reached: last step that found equilibrium.
        stopped: why it ended there: "" (the end), "step" (no equilibrium) or "time" (deadline).
        rho: spectral radius it was marched with.
        split: steps that found equilibrium only in smaller ones.
        largest_strain: largest |axial strain| of the motion.
        update: largest error left by the Newton iterations of a step, as estimated [m].
    """

    grid: Grid
    times: Floats
    states: Floats
    velocity: Floats
    forces: tuple[WindowForces, ...]
    reached: int
    stopped: str
    rho: float
    split: int
    largest_strain: float
    update: float


def events_of(problem: Problem) -> list[Event]:
    """Return the events inside the horizon, by time."""
    found: dict[float, int] = {}

    def add(time: float, multiplicity: int) -> None:
        if 0.0 < time < problem.horizon * (1 - 1e-9):
            found[time] = max(found.get(time, 0), multiplicity)

    for g in problem.scene.grasps:
        add(g.start, 3)
        if g.release_time is not None:
            add(g.release_time, 2)
        released = np.inf if g.release_time is None else g.release_time
        end = g.start + g.path.duration
        if g.path.duration and end < released:
            add(end, _smoothness(g, g.path.duration))
        if isinstance(g.path, Waypoints):
            add(g.start + float(np.asarray(g.path.times)[0]), 2)
    return [Event(t, found[t]) for t in sorted(found)]


def _smoothness(grasp: Grasp, end: float) -> int:
    if isinstance(grasp.path, Move):
        return {"minimum_jerk": 1, "cubic": 2, "linear": 3}[grasp.path.profile]
    return 3


def time_knots(problem: Problem, n_t: int) -> Floats | None:
    """Return the time knots (n_t + 4,) [s] with a knot at every event, or None where n_t is too small for them."""
    events = events_of(problem)
    times = np.array([e.time for e in events])
    multiplicity = np.array([e.multiplicity for e in events], dtype=np.int64)
    knots = graded_knots(n_t, problem.horizon, times, multiplicity, np.zeros(len(events)), np.ones(len(events)))
    return knots if len(knots) else None


def smallest_n_t(problem: Problem) -> int:
    """Return the least number of control points in time that has a knot at every event."""
    return max(5, 4 + sum(e.multiplicity for e in events_of(problem)))


def closed_grasps(problem: Problem, begin: float, end: float) -> list[Grasp]:
    """Return the grasps that hold all through the times `begin` to `end` [s]."""
    middle = 0.5 * (begin + end)
    return [
        g for g in problem.scene.grasps if g.start <= middle and (g.release_time is None or g.release_time > middle)
    ]


def march(problem: Problem, grid: Grid, steps: int, monitor: Monitor, *, rho: float = RHO) -> March:
    """March the motion of a problem on `grid` in about `steps` equal steps, more where events lie close.

    Raises:
        Cancelled: the caller asked to stop.
    """
    plane = problem.plane
    axes = tuple(range(plane.dimensions))
    marks = [0.0, *[e.time for e in events_of(problem)], problem.horizon]
    counts = [max(8, steps // (2 * len(marks)), round(steps * (b - a) / problem.horizon)) for a, b in pairwise(marks)]
    if len(counts) == 1:
        counts = [steps]
    times = np.concatenate(
        [[0.0], *[np.linspace(a, b, n + 1)[1:] for a, b, n in zip(marks[:-1], marks[1:], counts, strict=True)]]
    )
    active, parameters = problem.law_table()
    if problem.inertia is None:
        rho = 0.0
    unit_mass = grid.tables.mass
    mass = unit_mass * problem.mass_density()
    drag = unit_mass * problem.drag_coefficient()
    applied = applied_forces(problem, grid, times)
    tolerance = TOLERANCE * problem.scene.cable.length
    states = np.empty((len(times), grid.n_u, plane.dimensions))
    states[0] = grid.start
    v = grid.velocity.copy()
    velocity = v
    info = np.zeros(2)
    info[FAILED_STEP] = -1
    starts: Starts = {}
    forces: list[WindowForces] = []
    reached, stopped, split = 0, "", 0
    past = np.zeros((len(grid.tables.curvature_w) if problem.damping else 0, 2 if plane.dimensions == 2 else 9))
    first = 0
    for begin, end, count in zip(marks[:-1], marks[1:], counts, strict=True):
        last = first + count
        h = (end - begin) / count
        grasps = closed_grasps(problem, begin, end)
        close_grasps(problem, grid, grasps, starts, states[first])
        near_times = begin + 1e-3 * h * np.arange(3.0)  # for velocity and acceleration of the paths at the beginning
        held = hold(problem, grid, grasps, np.concatenate([near_times, times[first : last + 1]]), starts)
        near, e = held.offsets[:3], held.elimination
        rate = (4 * near[1] - 3 * near[0] - near[2]) / (2e-3 * h)
        v = constrained_mass_solve(plane.dimensions, unit_mass, e, rate, times_mass(unit_mass, v))
        if first == 0:
            velocity = v.copy()
        load = applied[min(first, len(applied) - 1)]
        G = np.empty_like(v)
        acceleration = (near[2] - 2 * near[1] + near[0]) / (1e-3 * h) ** 2
        if problem.inertia is None:
            v = np.zeros_like(v)
        a = initial_state(
            axes,
            states[first],
            v,
            mass,
            drag,
            grid.tables,
            active,
            parameters,
            grid.memory,
            past,
            load,
            e,
            acceleration,
            G,
        )
        if problem.inertia is None:
            a = np.zeros_like(v)
        offsets = np.zeros((len(times), len(e.held)))
        offsets[first : last + 1] = held.offsets[3:]
        reactions = np.zeros((len(times), len(e.held)))
        reactions[first] = (times_mass(mass, a) + G).reshape(-1)[e.held]
        at, smooth = first, first  # the step reached, and the first of the smooth stretch that it lies in
        while at < last and not stopped:
            try:
                monitor.check()
            except TimeIsUp:
                stopped = "time"
                break
            until = min(at + _CHUNK, last)
            march_steps(
                axes, at, until, smooth, h, rho, tolerance, states, v, a, G, mass, drag, grid.tables, active,
                parameters, grid.memory, past, applied, e, offsets, reactions, info,
            )  # fmt: skip
            at = until
            failed = int(info[FAILED_STEP])
            if failed < 0:
                continue
            # no equilibrium: this step in smaller ones, which damp what they can't resolve
            info[FAILED_STEP] = -1
            at = failed - 1
            for parts in _SPLITS:
                inner = np.linspace(times[at], times[failed], parts + 1)
                inner_offsets = hold(problem, grid, grasps, inner, starts).offsets
                inner_states = np.empty((parts + 1, *states.shape[1:]))
                inner_states[0] = states[at]
                inner_reactions = np.zeros((parts + 1, len(e.held)))
                kept = [x.copy() for x in (v, a, G, past)]
                march_steps(
                    axes, 0, parts, 0, h / parts, STRONGLY_DAMPED, tolerance, inner_states, v, a, G, mass, drag,
                    grid.tables, active, parameters, grid.memory, past, applied_forces(problem, grid, inner), e,
                    inner_offsets, inner_reactions, info,
                )  # fmt: skip
                if info[FAILED_STEP] < 0:
                    states[failed], reactions[failed] = inner_states[-1], inner_reactions[-1]
                    at = smooth = failed
                    split += 1
                    break
                info[FAILED_STEP] = -1
                for x, before in zip((v, a, G, past), kept, strict=True):
                    x[:] = before
            else:
                stopped = "step"
        reached = at
        _to_ends_of_steps(reactions[first : reached + 1], rho / (1.0 + rho))
        part = slice(first, last + 1)
        forces.append(WindowForces(held, times[part], reactions[part], states[part]))
        if stopped:
            break
        first = last
    states[reached + 1 :] = states[reached]
    return March(
        grid, times, states, velocity, tuple(forces), reached, stopped, rho, split,
        float(largest_strain(axes, states, grid.tables)), float(info[LEFT]),
    )  # fmt: skip


def _to_ends_of_steps(reactions: Floats, lag: float) -> None:
    """Bring the reactions (k, held) of steps 1 to k - 1 to their times, in place.

    A generalised-alpha step balances its forces `lag` steps before its end (alpha_f).
    """
    if len(reactions) > 2:
        rate = np.diff(reactions[1:], axis=0)
        reactions[1:-1] += lag * rate
        reactions[-1] += lag * rate[-1]


def times_mass(mass: Floats, v: Floats) -> Floats:
    """Return M v (n_u, nc) for the scalar band `mass` (n_u, 4)."""
    out = mass[:, 0, None] * v
    for o in range(1, 4):
        out[:-o] += mass[:-o, o, None] * v[o:]
        out[o:] += mass[:-o, o, None] * v[:-o]
    return out


def fit(motion: March, knots_t: Floats) -> Floats:
    """Return control points (n_t, n_u, nc) [m] of the time spline fitted to a marched motion."""
    steps, n_u, nc = motion.states.shape
    flat = fit_time(knots_t, motion.times, motion.states.reshape(steps, n_u * nc), motion.velocity.reshape(-1))
    return flat.reshape(len(knots_t) - 4, n_u, nc)
