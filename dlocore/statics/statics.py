"""Static equilibrium alone: the equations without M and N, as in the paper's remark after eq. (20)."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dlocore.answer.frames import free_of_frames
from dlocore.answer.parts import Status, with_notes
from dlocore.answer.reactions import reactions
from dlocore.answer.report import elastic_energy
from dlocore.answer.sharp_bends import missing_moments
from dlocore.compiling.interrupts import interruptible
from dlocore.effects.contact import DEEPEST
from dlocore.errors import SceneError, number, whole
from dlocore.kernels.assembly import History, slopes
from dlocore.problem.buckling import UNSTABLE, side_notes
from dlocore.problem.checks import TOO_DEEP
from dlocore.problem.discretisation import make_grid, smallest_n_u
from dlocore.problem.events import closed_grasps
from dlocore.problem.grid import Grid
from dlocore.problem.held_ends import held_back
from dlocore.problem.notes import cable_notes
from dlocore.problem.problem import Problem, pose
from dlocore.problem.strained import FOLDED, TORN, strain_notes
from dlocore.problem.winding import unseen_helix
from dlocore.scene.scene import Scene
from dlocore.solvers.monitor import Monitor, time_allowed
from dlocore.spline import design_matrix, in_range
from dlocore.stability.determined import UNDETERMINED, bend_in_words, bent
from dlocore.stability.sideways import WITH_TWIST, is_unstable, lacks_twist, solved_in_space
from dlocore.statics.regrid import begin_on, starts_folded
from dlocore.statics.resting import slide_to_rest
from dlocore.statics.settling import Settled, depth, holding, settle, settle_along
from dlocore.statics.tipping import tip_notes, tipped
from dlocore.statics.yielding import yield_notes
from dlocore.words import in_mm

Floats = NDArray[np.float64]

RESTLESS = "shape.settle"  # the field that the error names if a start finds no rest
LEVELS = (9, 13, 17, 25, 33, 49, 65, 97, 129, 193, 257, 385)
_WOUND = np.pi  # [rad]: a start that turns more than this along its length may have other equilibria than that downhill
_COARSE = 12  # control points: on so few, a start may settle to a different one of several equilibria than on more
_ELSEWHERE = 0.02  # of the length: starts farther apart than this may be different equilibria
_FAR = 0.05  # of the length: a start that settles no farther away has hardly passed by another equilibrium
_TELLING = 13  # control points of a start that is settled twice, to see whether the side it goes to is determined
_IN_SPANS = np.array([0.0, 0.25, 0.5, 0.75])  # fractions of each span of both grids at which they are compared
_LEFT = 1.5  # times the difference to the grid before: the error of a force, as for motions
_FINER = (1.5, 2.0)  # times the control points: grids on which a start that finds no rest may find one


@dataclass(frozen=True, kw_only=True, eq=False)
class Equilibrium:
    """A static equilibrium.

    Attributes:
        status: "converged", or why not.
        message: the status in words.
        control_points: (n_u, 4) [m, m, m, rad].
        knots_u: (n_u + 4,) [m].
        reactions: force of each grasp, in the scene's order (grasps, 3) [N]; zero if it is open.
        moments: moment of each grasp (grasps, 3) [N m].
        reaction_errors: estimated error of each reaction, from the grid before (grasps,) [N]; None if n_u was given.
        moment_errors: the same for the moments (grasps,) [N m].
        energy: elastic energy [J].
        error_estimate: largest distance to the grid before, plus how far unit length at its ends keeps a stretched
            cable from its true position [m]; None if n_u was given.
    """

    status: Status
    message: str
    control_points: Floats
    knots_u: Floats
    reactions: Floats
    moments: Floats
    reaction_errors: Floats | None
    moment_errors: Floats | None
    energy: float
    error_estimate: float | None

    def positions(self, u: ArrayLike) -> Floats:
        """Return r at the material coordinates u (k,) [m]; (k, 3) [m].

        Raises:
            SceneError: a place is off the cable.
        """
        return design_matrix(self.knots_u, in_range("u", u, float(self.knots_u[-1]), "m")) @ self.control_points[:, :3]


@interruptible
def equilibrium(
    scene: Scene,
    *,
    at: float = 0.0,
    n_u: int | None = None,
    deadline: float | None = None,
    cancelled: Callable[[], bool] | None = None,
) -> Equilibrium:
    """Find the static equilibrium of a scene's cable with its grasps at their poses of time `at`.

    The cable is brought there from its start shape along the paths of the grasps. So if there are several equilibria,
    the result is the one that it would slowly reach. A gripper that closes later holds the cable where it has come to
    rest. Without a given `n_u`, grids are refined until two agree to a tenth of a per mille of the length, or to the
    scene's `target_error`.

    Args:
        scene: its horizon, inertia, drag, damping, friction and plasticity play no part.
        at: time of the grasps' poses and of the loads [s]; for a load that jumps then, the force before the jump.
        n_u: number of control points, at least as many as the scene needs and at most 385; None: chosen.
        deadline: time allowed [s].
        cancelled: called between relaxations; if it returns True the solve stops.

    Raises:
        SceneError: bad input, or nothing holds the cable against its weight.
        Cancelled: `cancelled` returned True.
    """
    at = number("at", at, at_least=0.0, at_most=1e4, unit="s")
    problem = pose(scene, at_rest=True)
    if not closed_grasps(scene, at, at) and _is_driven(problem, at):
        given = f"no grasp that is closed at {at:g} s" if scene.grasps else "no grasp"
        raise SceneError("primitives", given, "a grasp that holds the cable", "Nothing holds it against its forces")
    monitor = Monitor(None, time_allowed(deadline), cancelled)
    target = scene.quality.target_error or 1e-4 * scene.cable.length
    least = smallest_n_u(problem)
    if n_u is None:
        sizes = [max(n, least + 2 * i) for i, n in enumerate(LEVELS)]
    else:
        sizes = [whole("n_u", n_u, at_least=least, at_most=max(least, LEVELS[-1]))]
    rest, notes = _refined(problem, sizes, at, target, monitor), cable_notes(scene)
    found = rest.settled
    if rest.status == "converged" and is_unstable(found.problem, rest.grid, found.q, at, found.history):
        if lacks_twist(problem):
            notes.append(solved_in_space([WITH_TWIST]))
        else:
            problem = pose(scene, {"side": UNSTABLE}, at_rest=True)
            rest = _refined(problem, sizes, at, target, monitor)
    if problem.start.bow and problem.start.material is None and rest.status == "converged":
        rest = _without_bow(rest, at, target, monitor)
    sides = [*side_notes(problem.start), *tip_notes(rest.grid.tipped, scene.cable.length)]
    notes += sides
    if problem.friction is not None:
        notes.append("friction is left out, though it can hold a cable where it came to lie")
    grid, q, history, problem = rest.grid, rest.settled.q, rest.settled.history, rest.settled.problem
    sunk = _sunk(grid, rest.settled)
    if DEEPEST < sunk <= TOO_DEEP:
        notes.append(f"the cable is pressed {sunk:.0%} of its diameter into what it touches")
    if rest.settled.rest == "settled" and _strain(grid, rest.settled) <= TORN:
        notes += strain_notes(scene.cable, _strain(grid, rest.settled), "the equilibrium")
    notes += yield_notes(problem, grid, q, history)
    apart = _rests_apart(problem, rest, at, monitor) if rest.status == "converged" and not sides else 0.0
    if apart > UNDETERMINED * scene.cable.length:
        bend = bend_in_words(problem, apart)
        notes.append(f"which of several equilibria it comes to is not determined: {bend}")
    world = problem.world(free_of_frames(problem, grid, q[None], history.past[None])[0])
    forces, *before = [np.array(_held(*one)) for one in rest.found[::-1]]
    reaction_errors: Floats | None = None
    moment_errors: Floats | None = None
    if before:
        reaction_errors, moment_errors = _LEFT * np.linalg.norm(forces - before[0], axis=2)
        moment_errors = np.maximum(moment_errors, missing_moments(problem, grid.knots, world, forces[1]))
    return Equilibrium(
        status=rest.status,
        message=with_notes(rest.message, notes),
        control_points=world,
        knots_u=grid.knots,
        reactions=forces[0],
        moments=forces[1],
        reaction_errors=reaction_errors,
        moment_errors=moment_errors,
        energy=elastic_energy(problem, grid, q, history),
        error_estimate=None if n_u is not None or not np.isfinite(rest.change) else rest.change,
    )


def _is_driven(problem: Problem, at: float) -> bool:
    """Tell whether forces other than those that press it onto the table act on a cable at the time `at` [s]."""
    weight = problem.plane.world_vectors(problem.weight()[None, : problem.plane.dimensions])
    forces = np.vstack([weight, *(load.at(np.array([at])) for load in problem.scene.loads)])
    if problem.on_table or problem.table is not None:
        forces[:, 2] = forces[:, 2].clip(min=0.0)
    return bool(forces.any())


class _Rest(NamedTuple):
    """The result of `settle` on the last of some grids and on the one before it, if there is one, with its message.

    Attributes:
        found: the grids and what they settled to, the finest last.
        status, message: of the result.
        change: its distance to the result on the grid before [m].
    """

    found: tuple[tuple[Grid, Settled], ...]
    status: Status
    message: str
    change: float

    @property
    def grid(self) -> Grid:
        """The last grid."""
        return self.found[-1][0]

    @property
    def settled(self) -> Settled:
        """What it settled to."""
        return self.found[-1][1]


def _refined(problem: Problem, sizes: list[int], at: float, target: float, monitor: Monitor) -> _Rest:
    """Settle on finer and finer grids until two agree to the target [m]."""
    found: tuple[tuple[Grid, Settled], ...] = ()
    change, status = np.inf, cast(Status, "converged")
    for n in sizes:
        grid, settled = _rested(problem, make_grid(problem, n), at, monitor)
        if settled.rest == "time":
            message = "The time limit passed. Allow more time or a smaller n_u."
            return _Rest(found or ((grid, settled),), "time_limit", message, change)
        if found:
            change = _apart(*found[-1], grid, settled)
        found = (*found[-1:], (grid, settled))
        unseen = max(change, unseen_helix(problem, grid, settled.q, settled.history))
        if unseen <= target and not _is_folded(grid, settled):
            break
    message = "Forces balance." if len(sizes) == 1 else _agreed(change)
    if settled.rest == "restless":
        status = "stalled"
        message = "The relaxation did not come to rest. The scene may have no equilibrium, or many side by side."
    elif _is_folded(grid, settled):
        status, message = "stalled", "The cable is folded finer than its control points can show. Use more of them."
    elif _strain(grid, settled) > TORN:
        status = "stalled"
        message = f"The cable is strained along itself by {_strain(grid, settled):.0%}, which no cable can follow. "
        message += _loosened(problem.scene, at)
    elif _sunk(grid, settled) > TOO_DEEP:
        status = "stalled"
        message = (
            f"The cable is pressed {_sunk(grid, settled):.0%} of its diameter into what it touches. Press it less."
        )
    elif settled.deepest > TOO_DEEP * problem.scene.cable.diameter:
        status = "stalled"
        message = (
            f"On its way the cable was pressed {settled.deepest / problem.scene.cable.diameter:.0%} of its diameter "
            "into something, and may have gone through. Press it less."
        )
    elif len(sizes) > 1 and not change <= target:
        status, message = "max_iterations", f"The finest grid still moved the shape by {in_mm(change)}."
    return _Rest(found, status, message, change)


def _agreed(change: float) -> str:
    return f"Two grids agree to {in_mm(change)}."


def _without_bow(rest: _Rest, at: float, target: float, monitor: Monitor) -> _Rest:
    """Return the rest of a cable after its stress-free bow, which gave it a side to buckle to, is removed.

    It is the given rest if no rest is found without the bow, or if grids do not agree on it to the target [m].
    """
    found = []
    for grid, settled in rest.found:
        history = History(*(x.copy() for x in settled.history))
        history.memory[:] = 0.0  # a cable that is given a bow is straight when stress-free
        # the first tangent takes the tension of the strain: without it a cable that is twisted would have none
        history = history._replace(tension=grid.untensed())
        straight = settle(settled.problem, grid, at, monitor, (settled.q.copy(), history), settled.starts)
        if straight.rest != "settled":
            return rest
        found.append((grid, straight))
    if len(found) == 1:
        return rest._replace(found=tuple(found))
    change = _apart(*found[0], *found[1])
    return rest._replace(found=tuple(found), message=_agreed(change), change=change) if change <= target else rest


def _held(grid: Grid, settled: Settled) -> tuple[Floats, Floats]:
    """Return the force [N] and the moment [N m] of each grasp on a settled cable, (grasps, 3) each."""
    held = reactions(settled.problem, grid, (holding(settled.problem, grid, settled),))
    force, moment = ([getattr(g, name)[-1] for g in held] for name in ("reaction", "moment"))
    return np.array(force).reshape(-1, 3), np.array(moment).reshape(-1, 3)


def _is_folded(grid: Grid, settled: Settled) -> bool:
    """Tell whether a cable came to rest folded within a span, which its energy does not see."""
    points = grid.tables.curvature
    return not slopes(settled.q[None], 1, points.first, points.b1)[0] >= FOLDED


def _apart(coarse: Grid, before: Settled, grid: Grid, settled: Settled) -> float:
    """Return the largest distance between a cable that settled on a grid and on a coarser one [m].

    The effect of unit length at held ends is added, because two grids show only part of it.
    """
    cuts, dimensions = np.union1d(coarse.knots, grid.knots), settled.problem.plane.dimensions
    u = (cuts[:-1, None] + np.diff(cuts)[:, None] * _IN_SPANS).ravel()
    one, other = (design_matrix(g.knots, u) @ x[:, :dimensions] for g, x in ((coarse, before.q), (grid, settled.q)))
    r = settled.q[None, :, :dimensions]
    lacking = held_back(settled.problem.scene, grid, r, grid.largest_strain(r))
    return float(np.linalg.norm(other - one, axis=1).max()) + lacking


def _strain(grid: Grid, settled: Settled) -> float:
    """Return the largest axial strain of a settled cable."""
    return grid.largest_strain(settled.q[None, :, : settled.problem.plane.dimensions])


def _loosened(scene: Scene, at: float) -> str:
    """Return advice on how to strain a cable less under the grasps of the time `at`."""
    if len(closed_grasps(scene, at, at)) > 1:
        return "Bring the grasps no farther apart than the length of cable between them."
    stiffness = cast(float, scene.cable.axial_stiffness)
    return f"Its axial stiffness is {stiffness:.3g} N: give it more, or less mass, weight or load."


def _sunk(grid: Grid, settled: Settled) -> float:
    """Return how deep a settled cable lies in what it touches, as a fraction of its diameter."""
    return depth(settled.problem, grid, settled.q) / settled.problem.scene.cable.diameter


def _rested(problem: Problem, grid: Grid, at: float, monitor: Monitor) -> tuple[Grid, Settled]:
    """Return a grid, and the rest that its start comes to and stays in under the grasps and loads of the time `at`."""
    settled = settle_along(problem, grid, at, monitor)
    if settled.rest != "settled":
        return grid, settled
    stays = tipped(problem, grid.changed(start=settled.q, history=settled.history), monitor, at, settled.starts)
    return grid.changed(tipped=stays.tipped), settled._replace(q=stays.start, history=stays.history)


def start_grid(problem: Problem, n_u: int, monitor: Monitor, like: Grid | None = None) -> Grid:
    """Return the grid of a motion's start, settled to equilibrium if the scene requests it.

    If a grid `like` it, of the same problem, has settled, the start settles from there, so that it reaches the same one
    of several equilibria, and is near it. If none has, and this one finds no rest from the given start or folds within
    a span, it settles from the start of a finer grid.

    Raises:
        SceneError: the start was to settle and found no equilibrium.
    """
    grid = make_grid(problem, n_u)
    if not problem.scene.shape.settle:
        return grid
    found = _settled(problem, grid, monitor, like)
    for finer in _FINER if like is None or starts_folded(like) else ():
        if _is_wanting(problem, found):
            other = _settled(problem, make_grid(problem, round(finer * n_u)), monitor, None)
            again = None if other is None else _settled(problem, grid, monitor, other)
            found = again or found
    if found is None:
        allowed = "false, or a start that grasps hold in an equilibrium"
        raise SceneError(RESTLESS, True, allowed, "The start did not come to rest")
    return found


def settles_elsewhere(problem: Problem, settled: Grid, monitor: Monitor) -> float:
    """Return the distance between the rests of a start that is bent by DISTURBED of the length to either side [m].

    For example, an S between two pins may go to either side of the line between them. A coarse grid is enough to see
    it. The result is 0 if the start did not move far to where it is `settled`, if friction holds it, and if it finds no
    rest.

    Raises:
        Cancelled: the caller asked to stop.
        TimeIsUp: the deadline passed.
    """
    if not problem.scene.shape.settle or problem.friction is not None:
        return 0.0

    def rest_of(start: Grid) -> Floats | None:
        monitor.check()
        found = _settled(problem, start, monitor, None)
        return None if found is None else found.start

    return _to_two_sides(problem, settled, settled.start, rest_of)


def _rests_apart(problem: Problem, rest: _Rest, at: float, monitor: Monitor) -> float:
    """Return the same distance for an equilibrium under the grasps and loads of the time `at` [m]."""

    def rest_of(start: Grid) -> Floats | None:
        other = _rested(problem, start, at, monitor)[1]
        return other.q if other.rest == "settled" else None

    return _to_two_sides(problem, rest.grid, rest.settled.q, rest_of)


def _to_two_sides(problem: Problem, grid: Grid, q: Floats, rest_of: Callable[[Grid], Floats | None]) -> float:
    """Return the distance between the rests of a start bent to either side, if it moved far to `q` on `grid` [m].

    `rest_of` returns the control points of a start's rest on a grid; None if it finds none.
    """
    u = np.linspace(0.0, problem.scene.cable.length, 33)
    dimensions = problem.plane.dimensions
    way = design_matrix(grid.knots, u) @ q[:, :dimensions] - problem.plane.points(problem.start(u))
    if not np.linalg.norm(way, axis=1).max() > _FAR * problem.scene.cable.length:
        return 0.0
    coarse = make_grid(problem, max(_TELLING, smallest_n_u(problem)))
    ends = []
    for side in (1.0, -1.0):
        rest = rest_of(coarse.changed(start=coarse.start + side * bent(problem, coarse, seed=1)))
        if rest is None:
            return 0.0
        ends.append(rest[:, :dimensions])
    return float(np.linalg.norm(ends[0] - ends[1], axis=1).max())


def _settled(problem: Problem, grid: Grid, monitor: Monitor, like: Grid | None) -> Grid | None:
    """Return a grid whose start is settled and stays at rest; None if it finds no rest; see `_at_rest`."""
    found = _at_rest(problem, grid, monitor, like)
    return None if found is None else tipped(problem, found, monitor)


def _at_rest(problem: Problem, grid: Grid, monitor: Monitor, like: Grid | None) -> Grid | None:
    """Return a grid with its start settled, if possible from that of a grid like it; None if it finds no rest.

    Where friction holds a cable depends on the way it took. If a start is wound or has obstacles below it, relaxations
    may jump to a different one of several equilibria. Such starts slide downhill from the given start, on every grid. A
    start that folds within a span as it slides, which the energy does not see, is relaxed all the same if nothing is in
    its way. If the similar grid is coarse and its start moved far, this start is settled from the given one too, and
    the result is used if it is a different equilibrium.
    """
    slid: Grid | None = None
    if problem.friction is not None or problem.obstacles or problem.start.turning > _WOUND:
        q, rest, history = slide_to_rest(problem, grid, monitor)
        if rest != "restless":
            slid = grid.changed(start=q, history=history)
        if problem.friction is not None or not _is_wanting(problem, slid):
            return slid
    begin = None if like is None else begin_on(problem, grid, like)
    found = settle(problem, grid, 0.0, monitor, begin)
    if like is not None and begin is not None:
        lost = found.rest == "restless"
        if lost or (like.n_u <= _COARSE and _is_elsewhere(problem, grid.start, found.q)):
            afresh = settle(problem, grid, 0.0, monitor)
            if lost or (afresh.rest != "restless" and _is_elsewhere(problem, found.q, afresh.q)):
                found = afresh
    if found.rest == "restless":
        return slid
    return grid.changed(start=found.q, history=found.history, tipped=like is not None and like.tipped)


def _is_elsewhere(problem: Problem, one: Floats, other: Floats) -> bool:
    """Tell whether control points (n_u, nc) of two starts on one grid may be in different equilibria."""
    apart = (one - other)[:, : problem.plane.dimensions]
    return float(np.abs(apart).max()) > _ELSEWHERE * problem.scene.cable.length


def _is_wanting(problem: Problem, start: Grid | None) -> bool:
    """Tell whether a start found no rest, or a fold within a span that a relaxation may unfold.

    Over an obstacle it may not, because it would take the cable through the obstacle.
    """
    return start is None or (problem.friction is None and not problem.obstacles and starts_folded(start))
