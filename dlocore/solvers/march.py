"""The compiled march: implicit time steps of the spatial spline, to which the time spline is fitted."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from dlocore.answer.reactions import WindowForces
from dlocore.kernels.assembly import History, note, slopes, times_scalar_band
from dlocore.kernels.entry import to_ends_of_steps
from dlocore.kernels.march import (
    DEEPEST,
    DIVIDED_FROM,
    FAILED_STEP,
    LEFT,
    STRUCK,
    march_steps,
)
from dlocore.kernels.twisted_rows import PAST
from dlocore.pickling import state_with
from dlocore.problem.discretisation import applied_forces, applied_in_steps
from dlocore.problem.events import closed_grasps
from dlocore.problem.grid import Grid
from dlocore.problem.holding import Starts, hold
from dlocore.problem.problem import Problem, firmer
from dlocore.problem.time_grid import marks_of, step_counts, step_times
from dlocore.scene.scene import Grasp
from dlocore.solvers.kept import Kept
from dlocore.solvers.leaning import lean_on_anchors, lean_on_table
from dlocore.solvers.monitor import Monitor, TimeIsUp
from dlocore.solvers.stretch import Entry, enter, with_what_lasts

Floats = NDArray[np.float64]

# Spectral radius at infinite frequency. 0.9 is a little more accurate where the motion is smooth, but energy grows in
# stiff, undamped motion; with 0.5 it hardly ever grows, with 0 never (docs/model.md).
RHO = 0.5
STRONGLY_DAMPED = 0.0
TOLERANCE = 1e-8  # of the length: the error that Newton's iterations leave in a step of COARSE
LEAST_TOLERANCE, MOST_TOLERANCE = 1e-11, 1e-7
COARSE = 1 / 256  # of the period of a swing: the tolerance is proportional to the square of the step
_SHORT = 20.0  # times the shortest knot span: from this mean span on, forces need more than positions do
_STIFF = 3e6  # EA L^2/EI up to which tension is not noisy; cables whose EA is not given are mostly below it
_NOISELESS = 1e-4  # of the tolerance, at least
CHUNK = 256  # steps between checks of the clock, at most
# of these steps, at most: times control points and their coordinates squared; some hundredths of a second
_WORK = 2.5e5
_NODE = 5.0  # a node of contact counts as this many: where many touch, a step may take many iterations
MOST_FRAMES = 1_300_000  # control points times steps for which a motion with twist keeps frames: 0.6 GB of them
_SPLITS = (4, 16, 64)  # parts of a step that found no equilibrium
_STRUCK = (16,)  # the same if the cable strikes something, which leaves an error proportional to the step
_MOST_STRUCK = 1 / 8  # of the steps: if it strikes in more, the others are taken whole
_LOOKS = 12  # states of a motion, at least, that are searched for folds


@dataclass(frozen=True, eq=False)
class March:
    """A marched motion.

    Attributes:
        grid: space discretisation.
        times: (k,) [s], of all steps, or of one of every few in a very long march, see `Kept`.
        states: (k, n_u, nc) control points at those times.
        steps: time steps that were to be taken.
        asked: the requested number of steps: events may need more.
        velocity: (n_u, nc) [m/s] just after t = 0.
        history: the history of the cable at the end of the motion.
        log: frames and memory at the times `logged` (rows, points, columns), see `kernels.assembly.note`; (0, 0, 0) if
            nothing is kept.
        reached: index of the last time before it ended.
        stopped: why it ended there: "" (the end), "step" (no equilibrium), "time" (deadline), or, if it was given up,
            "strain" or "depth".
        rho: spectral radius it was marched with.
        split: number of steps that found equilibrium only when divided.
        largest_strain: largest |axial strain| of the motion.
        slopes: least and largest |r'| at the curvature points of some of its states.
        update: largest error left by the Newton iterations of a step, as estimated [m].
        deepest: largest depth of the cable in an obstacle, the table or itself [m].
        find_forces: computes `forces` when they are first read.
        growth: approximate logarithm of the largest growth of a disturbance, if it was examined.
    """

    grid: Grid
    times: Floats
    states: Floats
    steps: int
    asked: int
    velocity: Floats
    history: History
    log: Floats
    reached: int
    stopped: str
    rho: float
    split: int
    largest_strain: float
    slopes: tuple[float, float]
    update: float
    deepest: float
    find_forces: Callable[[], tuple[WindowForces, ...]] = field(repr=False)
    growth: float | None = None

    @cached_property
    def forces(self) -> tuple[WindowForces, ...]:
        """What holds the cable between each pair of events."""
        return self.find_forces()

    def __getstate__(self) -> dict[str, Any]:
        return state_with(self, forces="find_forces")

    @property
    def unlogged(self) -> "March":
        """The same motion without its log."""
        return self if len(self.log) == 0 else replace(self, log=self.log[:0].copy())

    @property
    def kinked(self) -> bool:
        """Whether errors of its steps may be of first order: they are strongly damped, or something was touched."""
        return self.rho == STRONGLY_DAMPED or self.deepest > 0.0

    @property
    def logged(self) -> NDArray[np.int64]:
        """Indices of the times (rows,) of the rows of the log; all of them if nothing is kept."""
        at = np.arange(len(self.times))
        if len(self.log) == 0:
            return at
        every = -(-at[-1] // (len(self.log) - 1))
        return np.append(at[:-1:every], at[-1])

    @property
    def frames(self) -> Floats:
        """Frames of the curvature points at the times `logged` (rows, points, PAST); no columns without twist."""
        return self.log[:, : len(self.grid.tables.curvature.w), : self.log.shape[2] - self._remembered]

    @property
    def memory(self) -> Floats:
        """Stress-free strain of the curvature points at the times `logged` (rows, points, 1 in the plane or 3)."""
        return self.log[:, : len(self.grid.tables.curvature.w), self.log.shape[2] - self._remembered :]

    @property
    def axial_memory(self) -> Floats:
        """Stress-free axial strain at the times `logged` (rows, axial points); no columns where none is kept."""
        return np.asarray(self.log[:, len(self.grid.tables.curvature.w) :, :1].sum(axis=2))

    @property
    def _remembered(self) -> int:
        return 3 if self.log.shape[2] > PAST else min(1, self.log.shape[2])

    def behind(self, times: Floats) -> History:
        """Return the history of the motion at the times (k,) [s]: a `History` with arrays (1 or k, ...)."""
        start = self.grid.past()
        if len(self.log) == 0:
            return start._replace(memory=start.memory[None], past=start.past[None], axial=start.axial[None])
        at = np.clip(np.searchsorted(self.times[self.logged], times, side="right") - 1, 0, len(self.log) - 1)
        memory = np.broadcast_to(start.memory, (len(at), *start.memory.shape)).copy()
        memory[..., : self._remembered] = self.memory[at]
        past = self.frames[at] if self.frames.shape[2] else np.zeros((len(at), *start.past.shape))
        axial = np.broadcast_to(start.axial, (len(at), *start.axial.shape)).copy()
        if self.axial_memory.shape[1]:
            axial[..., 0] = self.axial_memory[at]
        return start._replace(memory=memory, past=np.ascontiguousarray(past), axial=axial)


def march(
    problem: Problem, grid: Grid, steps: int, monitor: Monitor, *, rho: float = RHO, whole: bool = False,
    credible: float = math.inf, shallow: float = math.inf, knocks: Mapping[float, Floats] | None = None,
) -> March:  # fmt: skip
    """March the motion of a problem on `grid` in about `steps` equal steps, more if events are close together.

    Args:
        problem: what is solved.
        grid: its space discretisation, with the start on it.
        steps: time steps.
        monitor: of the solve.
        rho: spectral radius.
        whole: whether a march cut short by the deadline is of no use, because it was to improve an existing answer.
        credible, shallow: axial strain, and depth in an obstacle, the table or itself [m], beyond which it is given up.
        knocks: displacements of the control points (n_u, nc) [m] at some times [s] inside the motion, to see how a
            disturbance develops; a stretch ends there.

    Raises:
        Cancelled: the caller asked to stop.
        TimeIsUp: the deadline passed, and it had to be `whole`.
    """
    knocks = knocks or {}
    marks = sorted({*marks_of(problem), *knocks})
    counts = step_counts(marks, steps)
    problem = firmer(problem, problem.horizon / steps)
    if problem.inertia is None or (problem.friction is not None and problem.friction.lying > 0.0):
        rho = STRONGLY_DAMPED  # without waves, or if a rough table stops them, there is nothing to preserve
    walk = _Walk(problem, grid, monitor, marks, counts, rho, credible, shallow)
    first = 0
    for begin, end, count in zip(marks[:-1], marks[1:], counts, strict=True):
        if begin in knocks:
            walk.knock(knocks[begin])
        walk.go(begin, end, first, first + count)
        if whole and walk.stopped == "time":
            raise TimeIsUp
        if walk.stopped:
            break
        first += count
    return walk.ended(steps)


@dataclass(frozen=True, eq=False)
class _Stretch:
    """A stretch of smooth motion under way: v, a and G (n_u, nc) are those at the step reached.

    Attributes:
        h: time step [s].
        first, last: its steps.
        grasps: those that hold in it.
        entry: how it begins.
        v, a, G: velocity [m/s], acceleration [m/s^2] and forces [N], see `march_steps`.
        reactions: (its steps + 1, held) forces [N] on the held degrees of freedom.
    """

    h: float
    first: int
    last: int
    grasps: list[Grasp]
    entry: Entry
    v: Floats
    a: Floats
    G: Floats
    reactions: Floats


class _Walk:
    """A march under way.

    Args:
        problem: what is solved.
        grid: its space discretisation, with the start on it.
        monitor: of the solve.
        marks: times [s] between which the motion is smooth.
        counts: steps of each stretch between two of them.
        rho: spectral radius.
        credible, shallow: axial strain and depth [m] beyond which it is given up.
    """

    def __init__(
        self, problem: Problem, grid: Grid, monitor: Monitor, marks: list[float], counts: list[int], rho: float,
        credible: float, shallow: float,
    ) -> None:  # fmt: skip
        self._problem, self._grid, self._monitor, self._rho = problem, grid, monitor, rho
        self._times = times = step_times(marks, counts)
        self._credible, self._shallow = credible, shallow
        at_ends = problem.contact is not None or problem.friction is not None  # forces that jump, see `newmark.py`
        self._lag = 0.0 if at_ends else rho / (1.0 + rho)  # of the times at which steps balance forces, in steps
        self._laws = problem.laws
        self._mass = grid.tables.inertia * problem.mass_density()
        self._step = problem.horizon / len(times)
        self._kept = Kept(grid.start, counts, _frames(problem), _columns(problem, grid))
        self._v = grid.velocity.copy()
        self._beginning: tuple[Entry, float]  # of the motion, and its time step [s]
        self._info = np.zeros(5)
        self._info[FAILED_STEP] = -1
        self._starts: Starts = {}
        self._forces: list[WindowForces] = []
        self._history = grid.past()._replace(tension=grid.untensed())
        if len(self._kept.log):
            note(problem.axes, self._history, self._kept.log[0])
        self._reached, self._split, self._strain = 0, 0, 0.0
        self.stopped = ""  # why it ended early

    def knock(self, by: Floats) -> None:
        """Displace the state at the step that was reached by control points (n_u, nc) [m]."""
        self._kept.knock(by, self._reached)

    def go(self, begin: float, end: float, first: int, last: int) -> None:
        """March through the stretch from `begin` to `end` [s], steps `first` to `last`, or until it has to stop."""
        stretch = self._enter(begin, end, first, last)
        anchors = self._history.stick.copy(), self._history.slide.copy()
        at, smooth = first, first  # the step reached, and the first of the smooth steps that it belongs to
        jumps = stretch.entry.jumps  # whether these begin with a jump or a strike
        try:
            while at < last and not self.stopped:
                self._monitor.check()
                until = min(at + chunk_of(self._problem, self._grid), last)
                before, (base, states, log) = at, self._kept.window(at, until, first)
                failed = self._steps(
                    stretch, at - base, until - base, max(smooth - base, 0), jumps, stretch.h, self._rho, states,
                    self._times[base : until + 1], stretch.entry.offsets[base - first :],
                    stretch.reactions[base - first :], log, base,
                )  # fmt: skip
                at = until if failed < 0 else failed - 1
                self._kept.keep(base, states, log, before, at)
                if self._kept.thin:
                    self._strain = max(self._strain, self._grid.largest_strain(states[: at - base + 1]))
                self.stopped = self._astray()
                if self.stopped:
                    break
                if failed < 0:
                    continue
                if self._in_smaller_steps(stretch, failed, jumps and at == smooth):
                    at = smooth = failed
                    jumps = bool(self._info[STRUCK])
                elif not self._info[STRUCK]:  # if it found equilibrium as one step
                    self.stopped = "step"
                if self._info[STRUCK]:
                    left = self._split < _MOST_STRUCK * len(self._times)
                    self._info[DIVIDED_FROM], self._info[STRUCK] = failed + 1 if left else np.inf, 0.0
        except TimeIsUp:
            self.stopped = "time"
        self._reached, self._v = at, stretch.v
        to_ends_of_steps(stretch.reactions, 0, at - first, self._lag)
        kept = self._kept
        begins, ends = np.searchsorted(kept.steps, (first, last))
        rows = slice(begins, ends + 1)
        steps = kept.steps[rows]
        reactions = stretch.reactions[steps - first]
        self._forces.append(WindowForces(stretch.entry.held, self._times[steps], reactions, kept.states[rows], anchors))

    def _astray(self) -> str:
        """Return why the march is given up at the step that was reached; "" if it is not."""
        if self._info[DEEPEST] > self._shallow:
            return "depth"
        if self._credible < math.inf and self._grid.largest_strain(self._kept.now[None]) > self._credible:
            return "strain"
        return ""

    def ended(self, asked: int) -> March:
        """Return the march, for which `asked` steps were requested; if it stopped early, its last state is held."""
        kept = self._kept
        reached, states = kept.stand_still(self._reached), kept.states
        grid, forces = self._grid, tuple(self._forces)
        tables, every = grid.tables, every_of(len(states))
        least, most = slopes(states, every, tables.curvature.first, tables.curvature.b1)
        return March(
            grid=grid,
            times=self._times[kept.steps],
            states=states,
            steps=len(self._times) - 1,
            asked=asked,
            velocity=self._velocity(),
            history=self._history,
            log=kept.log,
            reached=reached,
            stopped=self.stopped,
            rho=self._rho,
            split=self._split,
            largest_strain=max(self._strain, grid.largest_strain(states)),
            slopes=(float(least), float(most)),
            update=float(self._info[LEFT]),
            deepest=float(self._info[DEEPEST]),
            find_forces=lambda: forces,
        )

    def _velocity(self) -> Floats:
        """Return the velocity (n_u, nc) [m/s] just after t = 0."""
        entry, h = self._beginning
        q, later = self._kept.states[:2]
        return entry.velocity(q, later, h, float(self._times[self._kept.steps[1]]))

    def _enter(self, begin: float, end: float, first: int, last: int) -> _Stretch:
        """Close the grasps of a stretch, with friction holding from its beginning."""
        problem, grid, times = self._problem, self._grid, self._times
        h = (end - begin) / (last - first)
        grasps = closed_grasps(problem.scene, begin, end)
        load = applied_forces(problem, grid, times[first : first + 1])[0]
        before = float(times[first] - times[first - 1]) if first > 0 else 0.0
        entry = enter(
            problem, grid, grasps, self._starts, times[first : last + 1], h, before, self._kept.now, self._v,
            self._history, load,
        )  # fmt: skip
        e, a = entry.held.elimination, entry.a
        if first == 0:
            self._beginning = entry, h
            if problem.friction is not None and problem.table is not None:
                lean_on_table(problem, grid, a, self._history)
            if problem.friction is not None and problem.friction.lying > 0:
                a = lean_on_anchors(problem, grid, entry.v, a, self._mass, e, entry.G, self._history)
                if problem.inertia is None:
                    a = np.zeros_like(entry.v)
        reactions = np.zeros((last - first + 1, len(e.held)))
        reactions[0] = (times_scalar_band(self._mass, a) + entry.G).reshape(-1)[e.held]
        a, G = with_what_lasts(problem, grid, entry, a, h, self._kept.now, self._history)
        return _Stretch(h, first, last, grasps, entry, entry.v, a, G, reactions)

    def _steps(
        self, stretch: _Stretch, start: int, stop: int, begin: int, jumps: bool, h: float, rho: float, states: Floats,
        times: Floats, offsets: Floats, reactions: Floats, log: Floats, base: int = 0,
    ) -> int:  # fmt: skip
        """Take steps as `march_steps` does, which counts them from the step `base`; return the one that failed, or -1.

        `times` (rows of states,) [s] are the times of the states.
        """
        begins, ends = self._times[[stretch.first, stretch.last]]
        applied = applied_in_steps(self._problem, self._grid, times, begins, ends)
        tolerance = tolerance_of(self._problem, self._grid, min(self._step, stretch.h))  # between events that are close
        self._info[DIVIDED_FROM] -= base
        march_steps(
            self._problem.axes, start, stop, begin, jumps, h, rho, tolerance, states, stretch.v, stretch.a,
            stretch.G, self._problem.mass_density(), self._problem.drag_coefficient(), self._grid.tables, *self._laws,
            self._history, applied, stretch.entry.held.elimination, offsets, reactions, log, self._info,
        )  # fmt: skip
        self._info[DIVIDED_FROM] += base
        failed = int(self._info[FAILED_STEP])
        self._info[FAILED_STEP] = -1
        return base + failed if failed >= 0 else -1

    def _in_smaller_steps(self, stretch: _Stretch, failed: int, jumps: bool) -> bool:
        """Take a failed step in smaller ones, which damp what they can't resolve, if these find equilibrium."""
        times, now, at = self._times, self._kept.now, failed - 1
        under_way = (stretch.v, stretch.a, stretch.G, *self._history)
        kept = [x.copy() for x in under_way]
        divided_from, self._info[DIVIDED_FROM] = self._info[DIVIDED_FROM], np.inf
        for parts in _STRUCK if self._info[STRUCK] else _SPLITS:
            inner = np.linspace(times[at], times[failed], parts + 1)
            offsets = hold(self._problem, self._grid, stretch.grasps, inner, self._starts, now).offsets
            inner_states = np.empty((parts + 1, *now.shape))
            inner_states[0] = now
            reactions = np.zeros((parts + 1, stretch.reactions.shape[1]))
            k, found = 0, -1
            while k < parts and found < 0:
                self._monitor.check()
                begun, k = k, min(k + chunk_of(self._problem, self._grid), parts)
                found = self._steps(
                    stretch, begun, k, 0, jumps, stretch.h / parts, STRONGLY_DAMPED, inner_states, inner, offsets,
                    reactions, self._kept.log[:0],
                )  # fmt: skip
            if found < 0:
                base, states, log = self._kept.window(at, failed, stretch.first)
                states[-1] = inner_states[-1]
                if len(log):
                    note(self._problem.axes, self._history, log[-1])
                self._kept.keep(base, states, log, at, failed)
                # a strike pulls at the grasps for an instant: what lasts is the impulse
                lasts = reactions[1:].mean(axis=0) if self._info[STRUCK] else reactions[-1]
                stretch.reactions[failed - stretch.first] = lasts
                self._split += 1
                break
            for x, before in zip(under_way, kept, strict=True):
                x[:] = before
        self._info[DIVIDED_FROM] = divided_from
        return found < 0


def chunk_of(problem: Problem, grid: Grid) -> int:
    """Return how many steps on a grid are taken between checks of the clock."""
    spacings = problem.table_spacing(grid.n_u), problem.contact_spacing(), problem.strand_spacing()
    nodes = problem.scene.cable.length * sum(1.0 / spacing for spacing in spacings)
    return min(CHUNK, max(1, int(_WORK / (grid.n_u * problem.nc**2 + _NODE * nodes))))


def every_of(states: int) -> int:
    """Return the stride at which states of a motion are searched for folds."""
    return max(1, states // _LOOKS)


def tolerance_of(problem: Problem, grid: Grid, step: float) -> float:
    """Return the error that Newton's iterations may leave in a step [m].

    Over a short step this error is an acceleration, which the tension of a nearly inextensible cable turns into noise.
    The same holds for a short span, or one that is far stiffer along itself than sideways. Forces with kinks are not
    solved more closely, because steps would fail at them.
    """
    cable = problem.scene.cable
    length = cable.length
    of_coarse = step / (COARSE * problem.scene.swing)
    spans = [b - a for a, b in pairwise(grid.knots.tolist()) if b > a]
    short = min(1.0, _SHORT * len(spans) * min(spans) / length)
    stiff = cast(float, cable.axial_stiffness) * length**2 / cast(float, cable.bending_stiffness)
    noisy = max(short**2 * min(1.0, _STIFF / stiff), _NOISELESS)
    least = TOLERANCE if problem.touches else LEAST_TOLERANCE
    return min(max(TOLERANCE * of_coarse**2 * noisy, least), MOST_TOLERANCE) * length


def _frames(problem: Problem) -> float:
    """Return how many control points times steps may have rows in the log."""
    return MOST_FRAMES if problem.twist is not None else math.inf


def _columns(problem: Problem, grid: Grid) -> tuple[int, int]:
    """Return the points and columns of frames and memory of a motion; (0, 0) if it keeps none."""
    kept = (problem.twist, problem.bending_memory, problem.twist_memory, problem.stretch_memory)
    if all(effect is None for effect in kept):
        return 0, 0
    points = len(grid.tables.curvature.w) + (len(grid.tables.axial.w) if problem.stretch_memory is not None else 0)
    return points, PAST + 3 if problem.twist is not None else 1
