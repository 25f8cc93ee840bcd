"""Bring a held cable to rest by relaxations that are held back by springs, which become weaker and weaker."""

from itertools import pairwise
from typing import Literal, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from dlocore.answer.reactions import WindowForces
from dlocore.effects.contact import DEEPEST
from dlocore.kernels.assembly import NO_RATES, History, assemble
from dlocore.kernels.contact import passes, remember
from dlocore.kernels.entry import remember_start
from dlocore.kernels.relax import descend, relax
from dlocore.kernels.tension import COLUMNS
from dlocore.problem.discretisation import applied_at_rest
from dlocore.problem.events import closed_grasps
from dlocore.problem.grid import Grid
from dlocore.problem.holding import Held, Starts, close_grasps, hold
from dlocore.problem.problem import Problem, stiff_as_taut, stiffer_for
from dlocore.scene.paths import Waypoints, held_at
from dlocore.scene.scene import Grasp, Load, Scene
from dlocore.solvers.monitor import Monitor, TimeIsUp
from dlocore.spline import greville

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Rest = Literal["settled", "restless", "time"]  # at rest; no rest found; out of time

TOLERANCE = 1e-10  # of the length, for the last Newton update
RESTING = 1e-8  # of the length: as near to the equilibrium as a march solves its steps
UNDRIVEN = 1e-6  # of the force that weighs on the cable and bends it: a force this small drives nothing
ROUNDS = 400  # of relaxations, each held back by springs to where it started
PATH_STEPS = 24  # at least, that bring a grasp to its pose at a later time, or a load to its force
PATH_ROUNDS = 4  # of relaxations at each of these steps except the last
STIFFER = 6  # times that contact is made stiffer, at most
_ROUNDING = 1e-15  # of the axial stiffness: the force that rounding makes of it
_SPRINGS = 10.0  # times what weighs on the cable and bends it, per length: the springs of the first relaxation
_CLOSE = 0.05  # of the first update of a relaxation: once an update is smaller, the next relaxation follows
_WEAK = 2e-3  # of the first springs: these hold back nothing, and their relaxations end at TOLERANCE
_NEARBY = 1e-5  # of the first springs: those for a start that was found on another grid, which needs none so strong
_STRONGEST = 1e6  # times the first springs: the strongest with which Newton's method alone is tried
_STRONGER = 4.0  # times, if it fails
_COMES_TO_REST = 0.5  # of the previous relaxation: a cable that moves less than this is coming to rest
_ITERATIONS = 60  # of a relaxation with a line search
_ROUGH = 1e-5  # of the length: the tolerance of the first of these, which others follow
_YIELDING = 0.8  # of the depth is left by a stiffer contact, at most, if stiffness was the problem
_FAR = 0.1  # of the length: the farthest that a grasp moves in one of these steps
_TURNED = 0.5  # [rad]: the farthest that it turns
_PLACES = 384  # on its path, at least, at which that is checked
_CHANGED = 0.25  # of a load's total change: a push in between that is weaker is ignored
_SHORTEST = 1e-9  # of the time: the shortest steps that bring the grasps to their poses


class Settled(NamedTuple):
    """The state in which a cable came to rest, or failed to.

    Attributes:
        problem: what was solved: contact may have been made stiffer.
        q: control points (n_u, nc) [m].
        rest: whether they rest.
        held: which of them are held.
        history: their history.
        at: the grasps are at their poses of this time [s].
        starts: where the paths of the grasps begin.
        deepest: the largest depth of the control points in the table or an obstacle as they were carried there [m].
    """

    problem: Problem
    q: Floats
    rest: Rest
    held: Held
    history: History
    at: float
    starts: Starts
    deepest: float = 0.0


def settle(
    problem: Problem, grid: Grid, at: float, monitor: Monitor, begin: tuple[Floats, History] | None = None,
    starts: Starts | None = None,
) -> Settled:  # fmt: skip
    """Bring the cable to rest from where it is, with the grasps at their poses of time `at` [s].

    The relaxations are held back by a spring towards where they started, strongly at first and then less and less, so
    that a cable without a stable tangent (buckling, free rotation) walks downhill instead of jumping. Each uses
    Newton's method alone, with stronger springs if that fails. If it fails with any springs, or if something is
    touched, which makes kinks, the relaxation uses a line search.

    Args:
        begin: control points and history near the equilibrium; by default the start of the grid.
        starts: where the paths of the grasps begin; by default on the start.

    Raises:
        Cancelled: the caller asked to stop.
    """
    q, history = (grid.start.copy(), grid.past()) if begin is None else begin
    history, starts = _with_tension(grid, history), {} if starts is None else starts
    grasps = closed_grasps(problem.scene, at, at)
    close_grasps(problem, grid, grasps, starts, q)
    held = hold(problem, grid, grasps, np.full(2, at), starts, q if at > 0.0 else grid.start)
    applied = applied_at_rest(problem, grid, at)
    share = 1.0 if begin is None else _NEARBY
    rest = _Relaxation(problem, grid, q, history, held, applied, share).rest(ROUNDS, monitor)
    return Settled(problem, q, rest, held, history._replace(tension=grid.history.tension), at, starts)


def settle_along(problem: Problem, grid: Grid, at: float, monitor: Monitor) -> Settled:
    """Bring the cable from its start along the paths of its grasps, and to rest at their poses of time `at` [s].

    On the way it is relaxed a little at some times, at more of them where it would be carried through an obstacle. It
    comes to rest before a gripper closes on it. Parts that nothing holds stay where they are, unless they may touch
    something. Contact is made stiffer if the cable sinks in by more than DEEPEST.

    Raises:
        Cancelled: the caller asked to stop.
    """
    scene, q, history = problem.scene, grid.start.copy(), _with_tension(grid, grid.past())
    starts, before, restless, deepest = Starts(), 0.0, False, 0.0
    ahead = _times(scene, at)
    while True:
        t = ahead.pop()
        grasps = closed_grasps(scene, before, t)
        close_grasps(problem, grid, grasps, starts, q)
        carried = q if t == before else _carried(problem, grid, grasps, starts, t, q)
        if t - before > _SHORTEST * at and _is_through(problem, grid, q, carried):
            ahead += [t, 0.5 * (before + t)]
            continue
        held = hold(problem, grid, grasps, np.array([before, t]), starts, q)
        q, before = carried, t
        wholly = not ahead or any(g.start == t and g not in starts for g in scene.grasps)
        if grasps or not ahead or problem.contact is not None:
            applied = applied_at_rest(problem, grid, t)
            rounds = ROUNDS if wholly else PATH_ROUNDS
            problem, rest = _relaxed_firmly(problem, grid, q, history, held, applied, rounds, monitor)
            restless |= wholly and rest == "restless"
            deepest = max(deepest, depth(problem, grid, q))
            if not ahead or rest == "time":
                break
    if restless and rest == "settled":
        rest = "restless"
    return Settled(problem, q, rest, held, history._replace(tension=grid.history.tension), t, starts, deepest)


def depth(problem: Problem, grid: Grid, q: Floats) -> float:
    """Return the largest depth of control points q (n_u, nc) in the table or an obstacle; 0 if in none [m]."""
    if problem.contact is None:
        return 0.0
    nodes, unrubbed = grid.tables.contact, np.zeros((0, 3))
    return float(remember(problem.nc, q, nodes, problem.laws[1], unrubbed, np.empty_like(nodes.w), True))


def holding(problem: Problem, grid: Grid, settled: Settled) -> WindowForces:
    """Return what holds a cable that has settled."""
    q, at = settled.q, settled.at
    forces = _unbalanced(problem, grid, settled.history, q, applied_at_rest(problem, grid, at))
    return WindowForces(settled.held, np.array([at]), forces.reshape(1, -1)[:, settled.held.elimination.held], q[None])


def _with_tension(grid: Grid, history: History) -> History:
    """Return a history with room for the tension that relaxations use."""
    if len(history.tension):
        return history
    return history._replace(tension=np.zeros((len(grid.tables.axial.w), COLUMNS)))


class _Relaxation:
    """Relaxations of a cable, one after another, with the springs that the next one begins with.

    Args:
        problem, grid: the equations.
        q, history: control points (n_u, nc) [m] and their history, which are changed in place.
        held: which of them are held.
        applied: forces on them (n_u, nc) [N].
        share: share of the first springs to begin with.
    """

    def __init__(
        self, problem: Problem, grid: Grid, q: Floats, history: History, held: Held, applied: Floats, share: float = 1.0
    ) -> None:
        self.problem, self.grid, self.held, self.applied = problem, grid, held, applied
        self.q, self.history = q, history
        self.laws, self.length = problem.law_table(), problem.scene.cable.length
        self.untouched = history._replace(tension=grid.history.tension)
        self.from_nearby = share < 1.0
        self.springs = _SPRINGS * problem.stiffness_aside() + 1e-9  # the first ones
        self.strength = self.searched = share * self.springs  # of Newton's method alone, and with a line search
        self.plain = problem.contact is None  # whether Newton's method alone is used next
        self.weak = self.near = False  # whether its springs hold back nothing, and the last one moved the cable no more
        self.moved = 0.0  # by the last one [m]

    def rest(self, rounds: int, monitor: Monitor) -> Rest:
        """Relax in up to `rounds` rounds; return how the control points rest."""
        while rounds > 0:
            try:
                monitor.check()
            except TimeIsUp:
                return "time"
            before, plain = self.q.copy(), self.plain
            found = self._descended() if plain else self._searched(before)
            rest = None
            if found is not None:
                rest = self._rests(before, *found)
                self.plain = self.problem.contact is None
            elif plain:
                rest = self._strengthened()
            if rest is not None:
                return rest
            if found is not None or not plain:  # a failure of Newton's method alone is no round
                rounds -= 1
        return "restless"

    def _descended(self) -> tuple[float, float] | None:
        """Relax by Newton's method alone; return its last update [m] and a factor on the way, None if it failed."""
        self.weak = self.weak or self.strength <= _WEAK * self.springs
        update, used = descend(
            self.problem.axes, self.q, self.strength, self.applied, self.grid.tables, *self.laws, self.history,
            self.held.elimination, self.held.offsets[-1], 0.0 if self.weak else _CLOSE, TOLERANCE * self.length,
            RESTING * self.length,
        )  # fmt: skip
        if not np.isfinite(update):
            return None
        scale = max(1.0, self.strength / self.springs)
        self.strength *= 0.04 if used <= 2 else 0.2 if used <= 4 else 0.5
        return update, scale

    def _strengthened(self) -> Rest | None:
        """Make the springs stronger, as Newton's method alone failed; return how the cable rests if that ends it."""
        if self.near:  # and no weaker springs hold it: at rest, unless it is pushed
            return "settled"
        self.strength *= _STRONGER
        if self.from_nearby and self.strength > self.springs:
            return "restless"
        self.plain = self.strength <= _STRONGEST * self.springs
        return None

    def _searched(self, before: Floats) -> tuple[float, float] | None:
        """Relax with a line search, as `_descended` does; None, and nothing moves, if it went through an obstacle."""
        tolerance = TOLERANCE if self.searched < self.springs else _ROUGH
        tables, (active, parameters) = self.grid.tables, self.laws
        update, used = relax(
            self.problem.axes, self.q, before, self.searched, self.applied, tables, active, parameters, self.untouched,
            self.held.elimination, self.held.offsets[-1], tolerance * self.length, _ITERATIONS,
        )  # fmt: skip
        if passes(self.problem.nc, before, self.q, tables.contact, parameters, self.history.pressing):
            self.q[:] = before
            self.searched *= _STRONGER
            return None
        found = update <= max(tolerance, RESTING) * self.length
        self.searched *= 0.2 if used <= 12 else 0.5 if found else 1.0
        self.strength = self.springs
        self.history.tension[:] = 0.0
        return update, 1.0

    def _rests(self, before: Floats, update: float, scale: float) -> Rest | None:
        """Return "settled" if a relaxation from `before` (n_u, nc) ended at rest, else None."""
        problem, history = self.problem, self.history
        if problem.twist is not None:
            remember_start(problem.axes, self.q, self.grid.tables, *self.laws, history)
        last, self.moved = self.moved, float(np.abs(self.q - before).max())
        self.near = scale * self.moved <= RESTING * self.length
        if self.near and update <= RESTING * self.length:  # rounding may keep a stiff cable from TOLERANCE
            return "settled"
        stays = self.moved > _COMES_TO_REST * last  # a turn that dies out ends where nothing drives it
        if self.near or not stays or (self.plain and not self.weak):
            return None
        return "settled" if _only_turns(problem, self.grid, history, before, self.q, self.applied) else None


def _relaxed_firmly(
    problem: Problem, grid: Grid, q: Floats, history: History, held: Held, applied: Floats, rounds: int,
    monitor: Monitor,
) -> tuple[Problem, Rest]:  # fmt: skip
    """Relax q (n_u, nc) and their history in place, with stiffer contact while they sink in too deep and that helps.

    Returns:
        what was solved, and how the control points rest.
    """
    rest, tried = _Relaxation(problem, grid, q, history, held, applied).rest(rounds, monitor), problem
    for _ in range(STIFFER if problem.contact is not None else 0):
        deepest = depth(problem, grid, q)
        if rest == "time" or deepest <= DEEPEST * problem.scene.cable.diameter:
            break
        tried = stiffer_for(tried, deepest)
        before = q.copy(), *(x.copy() for x in history)
        again = _Relaxation(tried, grid, q, history, held, applied).rest(rounds, monitor)
        if again != "time" and depth(tried, grid, q) <= _YIELDING * deepest:
            problem, rest = tried, again
            continue
        for x, old in zip((q, *history), before, strict=True):
            x[:] = old
        taut = stiff_as_taut(tried)
        if again == "time" or taut is None:  # what is this deep was not pushed in
            return problem, again if again == "time" else rest
        tried = taut  # soft contact stops nothing that is pulled in
    return problem, rest


def _only_turns(problem: Problem, grid: Grid, history: History, before: Floats, q: Floats, applied: Floats) -> bool:
    """Tell whether a relaxation turned the cable as a whole, from `before` to q (n_u, nc), and no force drives that.

    A cable that hangs from a point, or between two, may turn about itself: it is in equilibrium at any angle. If it is
    straight when stress-free, its energy is the same at all angles; a difference on a coarse grid is no force.
    """
    length, dimensions = problem.scene.cable.length, problem.plane.dimensions
    if not _moved_rigidly(before[:, :dimensions], q[:, :dimensions], RESTING * length):
        return False
    step = q - before
    straight = problem.contact is None and not np.any(history.memory)
    driving = applied if straight else _unbalanced(problem, grid, history, q, applied)
    work = abs(float(np.sum(driving * step)))
    bending = problem.bend.bending_stiffness if problem.bend else 0.0
    scale = bending / length**2 + length * float(np.linalg.norm(problem.weight()))
    force = UNDRIVEN * scale + _ROUNDING * problem.stretch.axial_stiffness
    return work <= force * float(np.abs(step).max())


def _moved_rigidly(before: Floats, after: Floats, tolerance: float) -> bool:
    """Tell whether points (n, 2 or 3) are within a tolerance [m] of a rigid motion of their previous positions."""
    a, b = before - before[0], after - after[0]
    apart = np.sqrt((a * a).sum(axis=1)) - np.sqrt((b * b).sum(axis=1))
    if np.abs(apart).max() > 2.0 * before.shape[1] ** 0.5 * tolerance:  # a distance that no such motion leaves
        return False
    x, y = before - before.mean(axis=0), after - after.mean(axis=0)
    left, _, right = np.linalg.svd(x.T @ y)
    return bool(np.abs(x @ (left @ right) - y).max() <= tolerance)


def _times(scene: Scene, at: float) -> list[float]:
    """Return the times [s] at which a cable relaxes on its way to the poses of time `at`, the last first.

    Where a gripper closes or opens there are two: one with what held until then, and one with what holds from then on.
    """
    sudden = [t for g in scene.grasps for t in (g.start, g.release_time) if t is not None and 0.0 < t <= at]
    turns = [t for g in scene.grasps if isinstance(g.path, Waypoints) for t in (g.start + g.path.stops).tolist()]
    steps = [t for g in scene.grasps for t in _steps(g, at, scene.cable.length)]
    steps += [t for load in scene.loads if load.times is not None for t in _load_steps(load, at)]
    once = {t for t in (*steps, *sudden, *turns, at) if 0.0 < t <= at} or {at}
    return sorted([*once, *set(sudden)], reverse=True)


def _steps(grasp: Grasp, at: float, length: float) -> list[float]:
    """Return times [s] on the way of a grasp until `at`: PATH_STEPS even steps, and more if it goes far in one.

    In no step does it move by more than _FAR of the length, or turn by more than _TURNED.
    """
    path, lasts = grasp.path, min(at, grasp.release_time or np.inf) - grasp.start
    lasts = min(lasts, path.duration)
    if lasts <= 0.0:
        return []
    even = np.linspace(0.0, lasts, PATH_STEPS + 1)
    knots = np.append(0.0, cast(Floats, path.times)) if isinstance(path, Waypoints) else np.array([0.0, path.duration])
    parts = max(1, _PLACES // (len(knots) - 1))
    t = np.interp(np.arange(parts * (len(knots) - 1) + 1) / parts, np.arange(len(knots)), knots)
    t = np.union1d(even, t[t < lasts])
    r, turned = path.at(t, np.zeros(3)), path.rotation_at(t)

    def far(k: int, last: int) -> Bools:
        goes = np.linalg.norm(r[k : last + 1] - r[k], axis=1) > _FAR * length
        if turned is None:
            return np.asarray(goes)
        # rotations by an angle a apart are 8^0.5 sin(a/2) apart
        apart = np.linalg.norm(turned[k : last + 1] - turned[k], axis=(1, 2))
        return np.asarray(goes | (apart > 8.0**0.5 * np.sin(0.5 * _TURNED)))

    found = even.tolist()
    for k, last in pairwise(np.searchsorted(t, even).tolist()):
        while (beyond := far(k, last)).any():
            k += max(1, int(np.argmax(beyond)) - 1)
            found.append(float(t[k]))
    return [grasp.start + x for x in found]


def _load_steps(load: Load, at: float) -> list[float]:
    """Return even times [s] until `at` while a load changes, and times of strong pushes in between.

    Such a time is when the load differs most from its value at the even time before, if that is at least _CHANGED of
    the largest change.
    """
    times = cast(Floats, load.times)
    begin, end = max(0.0, times[0]), min(at, times[-1])
    if end < begin:
        return []
    even = np.linspace(begin, end, PATH_STEPS + 1)
    t = np.union1d(even, times[(begin < times) & (times < end)])
    force = load.at(t)
    change = _CHANGED * np.linalg.norm(force - force[0], axis=1).max()
    found = even.tolist()
    for k, last in pairwise(np.searchsorted(t, even).tolist()):
        changed = np.linalg.norm(force[k : last + 1] - force[k], axis=1)
        if changed.max() > change:
            found.append(float(t[k + int(np.argmax(changed))]))
    return found


def _carried(problem: Problem, grid: Grid, grasps: list[Grasp], starts: Starts, t: float, q: Floats) -> Floats:
    """Return control points q (n_u, nc) shifted with the grasps to their places at `t` [s], evenly in between.

    A grasp that moves alone by more than a span folds the cable there, and a fold finer than the quadrature stays.
    """
    carried = q.copy()
    if not grasps:
        return carried
    order = sorted(grasps, key=lambda g: g.u)
    dimensions = problem.plane.dimensions
    shift = np.array(
        [
            problem.plane.points(held_at(g.path, np.array([t - g.start]), starts[g][0])[0])
            - grid.at(q, g.u)[:dimensions]
            for g in order
        ]
    )
    middle = greville(grid.knots)  # of the control points
    for d in range(dimensions):
        carried[:, d] += np.interp(middle, [g.u for g in order], shift[:, d])
    return carried


def _is_through(problem: Problem, grid: Grid, before: Floats, carried: Floats) -> bool:
    """Tell whether control points (n_u, nc) were carried past the middle of an obstacle, or nearly.

    Carried twice as far, they would be through it: from within its near half, contact pushes the cable back.
    """
    nodes = grid.tables.contact
    return bool(passes(problem.nc, before, 2.0 * carried - before, nodes, problem.laws[1], nodes.w))


def _unbalanced(problem: Problem, grid: Grid, history: History, q: Floats, applied: Floats) -> Floats:
    """Return the forces (n_u, nc) [N] on the control points q that only the grasps balance."""
    active, parameters = problem.laws
    f, nothing = np.empty_like(q), np.empty((1, 1))
    assemble(
        problem.axes, q, np.zeros_like(q), grid.tables, active, parameters, history, NO_RATES, (0.0, 0.0, 0.0), f,
        nothing,
    )  # fmt: skip
    return np.asarray(f - applied)
