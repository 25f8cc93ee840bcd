"""One march on one grid, repeated if it failed or overstrained the cable, and its time spline."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dlocore.effects.contact import DEEPEST
from dlocore.kernels.growth import LOOKS
from dlocore.kernels.timefit import farthest, sampled
from dlocore.problem.checks import TOO_DEEP
from dlocore.problem.discretisation import smallest_n_u
from dlocore.problem.events import JUMP, moments, swings
from dlocore.problem.grid import Grid
from dlocore.problem.held_ends import held_back
from dlocore.problem.problem import Problem, firmer, stiff_as_taut, stiffer, stiffer_for
from dlocore.problem.stopping import unresolved_way
from dlocore.problem.time_grid import smallest_n_t, time_knots
from dlocore.problem.trembling import trembles
from dlocore.scene.scene import AUTO_TARGET
from dlocore.solvers.march import RHO, STRONGLY_DAMPED, March, march
from dlocore.solvers.monitor import Monitor
from dlocore.solvers.smooth import march_smooth
from dlocore.solvers.timefit import fit, largest, missed, refined
from dlocore.solvers.watched import watched
from dlocore.spline import spline_at
from dlocore.statics.statics import start_grid

Floats = NDArray[np.float64]

# (n_u, n_t, steps) for a motion of about two seconds of one metre, before it is refined in one direction only. Each has
# twice the steps and 1.45 times the control points of the one before: with an error of second order in time and of
# fourth order along the cable, both leave about the same share of the change.
LEVELS = (
    (9, 13, 40),
    (13, 19, 80),
    (19, 28, 160),
    (28, 41, 320),
    (41, 60, 640),
)
CREDIBLE_STRAIN = 0.02  # axial strain: a march that stretches the cable more is repeated with strong damping
TEARS = 1.5  # times the strain of another march: a strain this much larger is due to too few steps
_STIFFER = 5  # times that contact is made stiffer on one grid, at most
_MISSED = 0.01  # of the diameter: how far the time spline may miss a motion with contact
_LONG = 4.0  # times the period of a swing: in a motion this long the fast part may be short, so it ...
_FITTED = 0.1  # ... gets more time knots where the spline misses it by more than this share of the target
_ROUNDING = 1e-9
_SAMPLES = 33  # along the cable, and in time per swing, at which surfaces are compared
_AT_ONCE = 1e-2  # of the length: what moves more between two of these times is compared in between too, at ...
_SOONER = 0.5 ** np.arange(1.0, 7.0)  # ... these fractions if it sets out suddenly, and ...
_EVENLY = np.arange(1.0, 8.0) / 8.0  # ... these in motions so long that the times are far apart
_YIELDING = 0.8  # of the depth is left by a stiffer contact, at most, if stiffness was the problem
ACCEPT = 0.75  # of the target: an answer with a smaller error estimate is accepted


class Size(NamedTuple):
    """Size of a grid: control points along the cable and in time, and steps of the march."""

    n_u: int
    n_t: int
    steps: int


@dataclass(frozen=True, eq=False)
class Level:
    """A march on one grid and its spline.

    Attributes:
        size: of the grid, as requested.
        posed: the problem that was to be solved.
        problem: the problem that was solved: contact may have been made stiffer.
        motion: the march.
        knots_t: (n_t + 4,) [s].
        control: (n_t, n_u, nc) [m].
        missed: the misfit of the time spline to the march [m], see `largest`.
        change: largest distance to the level before [m]; infinite at the first.
        turned: largest angle of the sections from those of the level before, or of the march that its error was
            estimated with [rad]; 0 without twist.
        beside: the levels that its forces are compared with: the one that its error was estimated with, or the level
            before, and the one before that if the two differ in one direction only.
        note: what was found on it, in words.
        mended: what was done differently because the first march on the given grid failed, in words.
    """

    size: Size
    posed: Problem
    problem: Problem
    motion: March
    knots_t: Floats
    control: Floats
    missed: float
    change: float
    turned: float = 0.0
    beside: "tuple[Level, ...]" = ()
    note: str = ""
    mended: str = ""

    @property
    def alone(self) -> "Level":
        """The level without those in `beside`."""
        return replace(self, beside=())

    @property
    def lean(self) -> "Level":
        """The level as its forces are compared with: alone, and without the log of its motion, the most of its data."""
        return replace(self, beside=(), motion=self.motion.unlogged)

    @property
    def marched(self) -> Problem:
        """The problem as it was marched: the give of friction is adapted to the steps."""
        return firmer(self.problem, self.problem.horizon / self.motion.asked)

    @cached_property
    def unseen(self) -> float:
        """How far unresolved motion within the steps may move the cable [m], see `trembles` and `unresolved_way`."""
        step = self.problem.horizon / self.motion.steps
        return max(trembles(self.problem, step), unresolved_way(self.problem, step))

    @cached_property
    def held_back(self) -> float:
        """How far unit length at its ends keeps a stretched cable from its true position [m], see `held_back`."""
        motion, dimensions = self.motion, self.problem.plane.dimensions
        return held_back(self.problem.scene, motion.grid, motion.states[..., :dimensions], motion.largest_strain)

    @cached_property
    def samples(self) -> Floats:
        """The surface at evenly spaced times and 33 places along the cable (moments, 33, nc) [m]."""
        times = moments(self.problem.scene, _SAMPLES)
        return np.asarray(sampled(self.knots_t, self.motion.grid.knots, self.control, times, _SAMPLES))

    @cached_property
    def between(self) -> Floats:
        """Further times (k,) [s] to compare it at, where the evenly spaced ones may miss something."""
        step = self.problem.horizon / (len(self.samples) - 1)
        found = [begin + step * _SOONER for begin in self.sudden]
        if step * (_SAMPLES - 1) > (1.0 + _ROUNDING) * self.problem.scene.swing:
            found += [begin + step * _EVENLY for begin in self._lively(step)]
        times = np.unique(np.concatenate([[], *found]))
        return np.asarray(times[times < self.problem.horizon])

    def _lively(self, step: float) -> Floats:
        """Return the times (k,) [s] from which on the cable moves far within `step` [s]."""
        states = self.motion.states[..., : self.problem.plane.dimensions]
        way = np.linalg.norm(np.diff(states, axis=0), axis=2).max(axis=1)
        number = np.minimum(self.motion.times[1:] / step - _ROUNDING, len(self.samples) - 2).astype(int)
        return np.asarray(step * np.flatnonzero(np.bincount(number, way) > _AT_ONCE * self.problem.scene.cable.length))

    @property
    def sudden(self) -> list[float]:
        """Times at which it sets out so fast that the next evenly spaced time may come too late to show it [s]."""
        problem, motion, dimensions = self.problem, self.motion, self.problem.plane.dimensions
        far = _AT_ONCE * problem.scene.cable.length
        found = [0.0] if farthest(self.samples[:1], self.samples[1:2], dimensions) > far else []
        jumps = np.array([event.time for event in problem.events if event.multiplicity == JUMP])
        if len(jumps):
            step = problem.horizon / (len(self.samples) - 1)
            last = len(motion.times) - 1
            before, after = (np.minimum(np.searchsorted(motion.times, t), last) for t in (jumps, jumps + step))
            moved = (motion.states[after] - motion.states[before])[..., :dimensions]
            found += jumps[np.linalg.norm(moved, axis=2).max(axis=1) > far].tolist()
        return found

    def at(self, times: Floats, u: Floats | None = None) -> Floats:
        """Return the surface at times (k,) [s] and places `u` (m,) [m], else those of `samples`; (k, m, nc) [m]."""
        knots = self.motion.grid.knots
        u = np.linspace(0.0, knots[-1], _SAMPLES) if u is None else u
        states = np.swapaxes(spline_at(self.knots_t, self.control, times), 0, 1)
        return np.ascontiguousarray(np.swapaxes(spline_at(knots, states, u), 0, 1))


def stretched(problem: Problem, level: int) -> Size:
    """Return the size of a level for the horizon and the features of a problem."""
    n_u, n_t, steps = LEVELS[level]
    factor = swings(problem.scene)
    n_u = max(n_u, smallest_n_u(problem) + 2 * level) + problem.kinks
    n_t = max(round(n_t * factor), smallest_n_t(problem) + 4 * (level + 1))
    return Size(n_u, n_t, max(round(steps * factor), 3 * n_t))


def given_steps(n_t: int) -> int:
    """Return the number of time steps for a given number of control points in time."""
    return max(48, 5 * n_t)


def run_level(
    problem: Problem,
    n_u: int,
    n_t: int,
    steps: int,
    monitor: Monitor,
    *,
    rho: float = RHO,
    booked: bool = True,
    free_knots: bool = False,
    hardness: float = 1.0,
    credible: float = CREDIBLE_STRAIN,
    watch: bool = False,
    grid: Grid | None = None,
    like: Grid | None = None,
    knots_t: Floats | None = None,
    whole: bool = False,
) -> Level:
    """March on one grid and fit the time spline.

    A march that found no equilibrium, or stretched the cable beyond belief, is repeated with strong numerical damping,
    or without if it had that. The repeated one is kept if it gets farther or strains the cable far less.

    Args:
        rho: spectral radius of the march.
        booked: whether to book the time by phase.
        free_knots: whether to add time knots where the cable strikes something. The grid is then free to be refined,
            and it matters whether a disturbance may grow.
        hardness: the factor on the contact stiffness to begin with, as a previous grid needed it.
        credible: axial strain up to which a march is believed.
        watch: whether to watch the stretch at more points, between which the cable can't fold.
        grid: with the start on it, if that is known.
        like: another grid of the same problem, from whose start the start of this one is settled.
        knots_t: time knots to begin with, if they are known.
        whole: whether a march cut short by the deadline is of no use.

    Raises:
        Cancelled: the caller asked to stop.
        TimeIsUp: the deadline passed, and the march had to be `whole`.
    """
    posed = problem
    if hardness > 1.0:
        problem = stiffer(problem, hardness)
    if grid is None:
        grid = start_grid(problem, n_u, monitor, like)
        grid = watched(grid) if watch else grid
    if knots_t is None:
        knots_t = time_knots(problem, n_t)
    assert knots_t is not None, "the caller asks for enough control points"
    if booked:
        monitor.phase("setup")
    looks = LOOKS if free_knots else 0
    plain = None if grid.watched else march_smooth(problem, grid, steps, knots_t, monitor, rho, looks)
    damped: March | None = None
    if plain is None:
        problem, motion, damped = _march(problem, grid, steps, monitor, rho, whole, credible)
    else:
        motion = plain[0]
    if hardness > 1.0 and motion.stopped == "step":  # too stiff for this grid
        problem = posed
        motion = march(problem, grid, steps, monitor, rho=rho, whole=whole)
    problem, motion = _stiffened(problem, motion, grid, steps, monitor, rho, whole)
    doubtful = motion.stopped == "step" or motion.largest_strain > credible
    if doubtful and motion is not damped and (rho > STRONGLY_DAMPED or motion.stopped == "step"):
        other_rho = RHO if rho == STRONGLY_DAMPED else STRONGLY_DAMPED
        again = damped or march(problem, grid, steps, monitor, rho=other_rho, whole=whole)
        less = TEARS * again.largest_strain < motion.largest_strain
        if again.reached > motion.reached or (again.reached == motion.reached and less):
            motion = again
    if booked:
        monitor.phase("march")
    known = None if plain is None or motion is not plain[0] else (plain[1], plain[2])
    knots_t, control, off = _splined(problem, motion, knots_t, known, free_knots, monitor, whole)
    if booked:
        monitor.phase("fit")
    worst = largest(motion.times, off, problem.scene.swing)
    return Level(Size(n_u, n_t, steps), posed, problem, motion, knots_t, control, worst, np.inf)


def _stiffened(
    problem: Problem, motion: March, grid: Grid, steps: int, monitor: Monitor, rho: float, whole: bool
) -> tuple[Problem, March]:
    """Return the solved problem and its march, repeated with stiffer contact if the cable is pressed in too deep.

    A stiffer one is kept if the motion gets farther with it, or as far and is pressed in less. It is of no use against
    what is pulled in by tension.
    """
    allowed, tried = DEEPEST * problem.scene.cable.diameter, problem
    for _ in range(_STIFFER):
        if motion.stopped == "time" or motion.deepest <= allowed:
            break
        if motion.stopped and problem.self_contact is None:
            break  # soft contact may be why strands got through each other and the march ended
        harder = stiffer_for(tried, motion.deepest)
        again = march(harder, grid, steps, monitor, rho=rho, whole=whole)
        if (again.reached, -again.deepest) < (motion.reached, -_YIELDING * motion.deepest):
            taut = stiff_as_taut(harder) if again.reached == motion.reached else None
            if taut is not None:  # soft contact stops nothing that is pulled in by tension
                tried = taut
                continue
            if problem.self_contact is None or tried is not problem or again.reached < motion.reached:
                break  # what is this deep was not pushed in
            tried = harder  # strands that strike each other harder by chance are tried once more
        else:
            problem, motion, tried = harder, again, harder
    return problem, motion


def _splined(
    problem: Problem, motion: March, knots_t: Floats, known: tuple[Floats, Floats] | None, free_knots: bool,
    monitor: Monitor, whole: bool,
) -> tuple[Floats, Floats, Floats]:  # fmt: skip
    """Return time knots (n_t + 4,) [s] and control points (n_t, n_u, nc) [m] of a march, and their misfit [m].

    Args:
        problem: that was solved.
        motion: its march.
        knots_t: the knots to begin with.
        known: control points on these, and the misfit at each state (steps + 1,) [m], if they are known.
        free_knots: whether to add knots where the cable strikes something, or is fast within a long time.
        monitor: of the solve.
        whole: whether a spline that the deadline leaves with too few knots is of no use.
    """
    smooth = motion
    period = problem.scene.swing
    if free_knots and (problem.contact is not None or motion.deepest > 0.0):
        knots_t, smooth = refined(motion, knots_t, _MISSED * problem.scene.cable.diameter, True, monitor, whole)
    elif free_knots and problem.horizon > _LONG * period:
        target = problem.scene.quality.target_error or AUTO_TARGET * problem.scene.cable.length
        knots_t, _ = refined(motion, knots_t, _FITTED * target, False, monitor, whole)
    if known is not None and len(knots_t) == len(known[0]) + 4:
        control, off = known
    else:
        control, off = fit(smooth, knots_t)
    if smooth is not motion:
        off = missed(motion, knots_t, control)
    return knots_t, control, off


def _fastest(motion: March) -> float:
    """Return the largest speed of a control point in a motion, up to where it ended [m/s]."""
    states = motion.states[: motion.reached + 1, :, : min(3, motion.states.shape[2])]
    moved = np.linalg.norm(np.diff(states, axis=0), axis=2).max(axis=1)
    return float((moved / np.diff(motion.times[: motion.reached + 1])).max(initial=0.0))


def _march(
    problem: Problem, grid: Grid, steps: int, monitor: Monitor, rho: float, whole: bool, credible: float
) -> tuple[Problem, March, March | None]:
    """March; return the solved problem, its march, and one with strong damping if it is known.

    A march that goes astray is stopped at once if an alternative does not go astray:

    - Waves that gain energy strain the cable beyond belief, and most of their steps find equilibrium only in smaller
      ones. Finishing such a march before trying strong damping takes forty times as long.
    - A cable that moves so fast that it goes through what it strikes, or through itself, jams or goes another way.
      Contact is made stiffer, and if that is not enough, so stiff that it stops the largest speed reached until then.
    """
    damped: March | None = None
    shallow = TOO_DEEP * problem.scene.cable.diameter
    believed = np.inf if rho == STRONGLY_DAMPED or problem.touches else credible
    motion = march(problem, grid, steps, monitor, rho=rho, whole=whole, credible=believed, shallow=shallow)
    if motion.stopped == "strain":
        damped = march(problem, grid, steps, monitor, rho=STRONGLY_DAMPED, whole=whole)
        less = TEARS * damped.largest_strain < motion.largest_strain
        if damped.stopped == "time" or (less and not damped.stopped):
            return problem, damped, damped
    elif motion.stopped == "depth":
        for speed in (0.0, _fastest(motion)):
            harder = stiffer_for(problem, motion.deepest, speed)
            again = march(harder, grid, steps, monitor, rho=rho, whole=whole, shallow=shallow)
            if again.stopped in ("", "time"):
                return harder, again, None
    else:
        return problem, motion, None
    return problem, march(problem, grid, steps, monitor, rho=rho, whole=whole), damped


def stiffened(level: Level) -> float:
    """Return how many times stiffer than posed contact was in the march of a level: 1 or more."""
    posed, solved = (p.self_contact or p.contact for p in (level.posed, level.problem))
    return 1.0 if posed is None or solved is None else solved.stiffness / posed.stiffness


def hardness(level: Level) -> float:
    """Return how many times stiffer than posed contact may have to be on the grid after a level: 1 or more.

    It is the factor that the level needed, but no more than leaves half of the depth that is allowed.
    """
    allowed = DEEPEST * level.problem.scene.cable.diameter
    return max(1.0, stiffened(level) * min(1.0, 2.0 * level.motion.deepest / allowed))


def credible_after(level: Level) -> float:
    """Return the axial strain up to which a march on the grid after a level is believed."""
    return max(CREDIBLE_STRAIN, TEARS * level.motion.largest_strain)


def distance(a: Level, b: Level) -> float:
    """Return the largest distance between the surfaces of two levels [m], including just after a sudden start.

    They solve the same problem, or that of `a` differs little from that of `b`.

    On fine grids it is also sought beside the ends and beside whatever holds, loads or weighs down the cable: a
    stretched cable is worst in the short spans there, which may contain none of the evenly spaced places.
    """
    problem, dimensions = b.problem, b.problem.plane.dimensions
    most = float(farthest(a.samples, b.samples, dimensions))
    times = np.union1d(a.between, b.between)
    if len(times):
        most = max(most, float(farthest(a.at(times), b.at(times), dimensions)))
    if max(a.motion.grid.n_u, b.motion.grid.n_u) > _SAMPLES:
        u = np.union1d(_beside(problem, a.motion.grid), _beside(problem, b.motion.grid))
        times = np.linspace(0.0, problem.horizon, len(a.samples))
        most = max(most, float(farthest(a.at(times, u), b.at(times, u), dimensions)))
    return most


def _beside(problem: Problem, grid: Grid) -> Floats:
    """Return two knots of a grid on each side of each end and of whatever holds, loads or weighs down the cable [m]."""
    breaks = np.unique(grid.knots)
    at = np.searchsorted(breaks, [0.0, *problem.scene.places, problem.scene.cable.length])
    return breaks[(at[:, None] + np.arange(-2, 3)).clip(0, len(breaks) - 1)].ravel()


def turned(a: Level, b: Level) -> float:
    """Return the largest angle between the sections of two levels of a problem [rad]; 0 without twist."""
    twist = b.problem.twist
    return 0.0 if twist is None else float(np.abs(a.samples[..., 3] - b.samples[..., 3]).max()) / twist.radius
