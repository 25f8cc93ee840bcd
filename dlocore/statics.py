"""Static equilibrium alone: the paper's remark after eq. (20), the equations without M and N."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dlocore.discretisation import applied_forces, make_grid, smallest_n_u
from dlocore.errors import SceneError, number
from dlocore.events import closed_grasps
from dlocore.frames import free_of_frames
from dlocore.grid import Grid
from dlocore.holding import Starts, close_grasps, hold
from dlocore.kernels.assembly import NO_RATES, History, assemble, remember
from dlocore.kernels.relax import relax
from dlocore.prediction import Status
from dlocore.problem import Problem, pose
from dlocore.report import WindowForces, elastic_energy, reactions
from dlocore.scene import Grasp, Scene
from dlocore.solvers.monitor import Monitor, TimeIsUp
from dlocore.spline import design_matrix

Floats = NDArray[np.float64]

LEVELS = (9, 13, 17, 25, 33, 49, 65, 97)
TOLERANCE = 1e-10  # of the length, on the last Newton update
RESTING = 1e-8  # of the length, as near to the equilibrium as a march solves its steps
UNDRIVEN = 1e-6  # of what weighs on the cable and bends it: a force that drives nothing
_ROUNDING = 1e-15  # of the axial stiffness: what it makes of a force
_ROUGH = 1e-5  # of the length: the same of the first relaxation, which others follow; Newton's method leaves its square
ITERATIONS = 60  # of one relaxation
ROUNDS = 400  # of relaxations, each held back less by where it started
Rest = Literal["settled", "restless", "time"]  # at rest; no rest found; the time was up
Settled = tuple[Floats, Rest, tuple[WindowForces, ...], History]
PATH_STEPS = 24  # that bring the grasps to their poses at a later time


@dataclass(frozen=True, kw_only=True, eq=False)
class Equilibrium:
    """A static equilibrium.

    Attributes:
        status: "converged", or why not.
        message: the status in words.
        control_points: (n_u, 4) [m, m, m, rad].
        knots_u: (n_u + 4,) [m].
        reactions: force of each grasp, in the scene's order (grasps, 3) [N]; zero where it is open.
        moments: moment of each grasp (grasps, 3) [N m].
        energy: elastic energy [J].
        error_estimate: largest distance to the grid before [m]; None where n_u was given.
    """

    status: Status
    message: str
    control_points: Floats
    knots_u: Floats
    reactions: Floats
    moments: Floats
    energy: float
    error_estimate: float | None

    def positions(self, u: ArrayLike) -> Floats:
        """Return r at the material coordinates u (k,) [m]; (k, 3) [m]."""
        return design_matrix(self.knots_u, np.atleast_1d(u)) @ self.control_points[:, :3]


def equilibrium(
    scene: Scene,
    *,
    at: float = 0.0,
    n_u: int | None = None,
    deadline: float | None = None,
    cancelled: Callable[[], bool] | None = None,
) -> Equilibrium:
    """Find the static equilibrium of a scene's cable with its grasps at their poses of time `at`.

    The cable is brought there from its start shape along the grasps' paths, so that of several equilibria the one is
    found that it would slowly reach. Without a given `n_u` grids are refined until two agree to a tenth of a per mille
    of the length, or to the scene's `target_error`.

    Args:
        scene: its horizon, inertia, drag and damping play no part.
        at: time of the grasps' poses and of the loads [s].
        n_u: number of control points; None: chosen.
        deadline: time allowed [s].
        cancelled: asked between relaxations; where it returns True the solve stops.

    Raises:
        SceneError: bad input, or nothing holds the cable against its weight.
        Cancelled: `cancelled` returned True.
    """
    at = number("at", at, at_least=0.0, at_most=1e4, unit="s")
    problem = pose(scene)
    if not closed_grasps(problem, at, at) and (np.any(problem.weight() != 0) or scene.loads):
        raise SceneError(
            "primitives", "no grasp", "a grasp that holds the cable", "Nothing holds it against its forces"
        )
    monitor = Monitor(None, deadline, cancelled)
    target = scene.quality.target_error or 1e-4 * scene.cable.length
    least = smallest_n_u(problem)
    sizes = [n_u] if n_u is not None else [max(n, least + 2 * i) for i, n in enumerate(LEVELS)]
    found: tuple[Grid, *Settled] | None = None
    change, status, message = np.inf, "time_limit", "The time limit passed. Allow more time or a smaller n_u."
    for n in sizes:
        grid = make_grid(problem, n)
        q, rest, forces, history = settle(problem, grid, at, monitor)
        if rest == "time" and found is not None:
            break
        if found is not None:
            u = np.linspace(0.0, scene.cable.length, 65)
            before = design_matrix(found[0].knots, u) @ found[1][:, :3]
            change = float(np.linalg.norm(design_matrix(grid.knots, u) @ q[:, :3] - before, axis=1).max())
        found = (grid, q, rest, forces, history)
        if rest == "time":
            break
        status, message = "converged", "Forces balance." if n_u else f"Two grids agree to {change * 1e3:.2g} mm."
        if change <= target:
            break
    assert found is not None, "every list of sizes has a first"
    grid, q, rest, forces, history = found
    if rest == "restless":
        status = "stalled"
        message = "The relaxation did not come to rest. The scene may have no equilibrium, or many side by side."
    elif status == "converged" and n_u is None and not change <= target:
        status, message = "max_iterations", f"The finest grid still moved the shape by {change * 1e3:.2g} mm."
    world = problem.world(free_of_frames(problem, grid, q[None], history.past[None])[0])
    held = reactions(problem, grid, forces)
    return Equilibrium(
        status=status,  # type: ignore[arg-type]
        message=message,
        control_points=world,
        knots_u=grid.knots,
        reactions=np.array([g.reaction[-1] for g in held]).reshape(-1, 3),
        moments=np.array([g.moment[-1] for g in held]).reshape(-1, 3),
        energy=elastic_energy(problem, grid, q, history),
        error_estimate=None if n_u is not None or not np.isfinite(change) else change,
    )


def start_grid(problem: Problem, n_u: int, monitor: Monitor) -> Grid:
    """Return the grid of a motion's start: settled to equilibrium where the scene asks for it.

    Raises:
        SceneError: the start was to settle and found no equilibrium.
    """
    grid = make_grid(problem, n_u)
    if not problem.scene.shape.settle:
        return grid
    q, rest, _, history = settle(problem, grid, 0.0, monitor)
    if rest == "restless":
        allowed = "false, or a start that grasps hold in an equilibrium"
        raise SceneError("shape.settle", True, allowed, "The start did not come to rest")
    return grid.changed(start=q, history=history)


def settle(problem: Problem, grid: Grid, at: float, monitor: Monitor) -> Settled:
    """Return control points (n_u, nc) [m] with the grasps at their poses of time `at`, how they rest, what holds them,
    and what lies behind them.

    Relaxations held back by a spring towards where they started: the first strongly, later ones less, so that a cable
    without a stable tangent (buckling, free rotation) walks downhill instead of jumping.

    Raises:
        Cancelled: the caller asked to stop.
    """
    q = grid.start.copy()
    starts: Starts = {}
    before_t = 0.0
    times = np.linspace(0.0, at, PATH_STEPS + 1)[1:] if at > 0 else np.zeros(1)
    active, parameters = problem.law_table()
    axes, history = problem.axes, grid.past()
    length = problem.scene.cable.length
    bending = problem.bend.bending_stiffness if problem.bend else 0.0
    load = float(np.linalg.norm(problem.weight()))
    springs = 10.0 * (bending / length**4 + load / length) + 1e-9
    rest: Rest = "restless"
    forces: tuple[WindowForces, ...] = ()
    for t in times:
        grasps = closed_grasps(problem, t, t)
        close_grasps(problem, grid, grasps, starts, q)
        held = hold(problem, grid, grasps, np.array([before_t, t]), starts, q)
        if t > 0.0:
            _carry(problem, grid, grasps, starts, t, q)
        before_t = t
        applied = applied_forces(problem, grid, np.array([t]))[0]
        strength = springs
        rest = "restless"
        for _ in range(ROUNDS if t == times[-1] else 4):
            try:
                monitor.check()
            except TimeIsUp:
                rest = "time"
                break
            before = q.copy()
            tolerance = TOLERANCE if strength < springs else _ROUGH
            update, used = relax(
                axes, q, before, strength, applied, grid.tables, active, parameters, history, held.elimination,
                held.offsets[-1], tolerance * length, ITERATIONS,
            )  # fmt: skip
            if problem.twist is not None:
                remember(axes, q, grid.tables, active, parameters, history, 0.0, True)
            moved = float(np.abs(q - before).max())
            resting = update <= RESTING * length  # rounding may keep a stiff cable from TOLERANCE
            found = update <= max(tolerance, RESTING) * length
            strength *= 0.2 if used <= 12 else 0.5 if found else 1.0
            near = moved <= RESTING * length
            if resting if near else _only_turns(problem, grid, history, before, q, applied):
                rest = "settled"
                break
        forces = (
            WindowForces(
                held,
                np.array([t]),
                _unbalanced(problem, grid, history, q, applied).reshape(1, -1)[:, held.elimination.held],
                q[None],
            ),
        )
        if rest == "time":
            break
    return q, rest, forces, history


def _only_turns(problem: Problem, grid: Grid, history: History, before: Floats, q: Floats, applied: Floats) -> bool:
    """Tell whether a relaxation turned the cable as a whole, from `before` to q (n_u, nc), and no force drives that.

    A cable that hangs from a point, or between two, may turn about itself: it is in equilibrium at any angle.
    """
    length, dimensions = problem.scene.cable.length, problem.plane.dimensions
    if not _moved_rigidly(before[:, :dimensions], q[:, :dimensions], RESTING * length):
        return False
    step = q - before
    work = abs(float(np.sum(_unbalanced(problem, grid, history, q, applied) * step)))
    bending = problem.bend.bending_stiffness if problem.bend else 0.0
    scale = bending / length**2 + length * float(np.linalg.norm(problem.weight()))
    force = UNDRIVEN * scale + _ROUNDING * problem.stretch.axial_stiffness
    return work <= force * float(np.abs(step).max())


def _moved_rigidly(before: Floats, after: Floats, tolerance: float) -> bool:
    """Tell whether points (n, 2 or 3) lie within a tolerance [m] of a rigid motion of where they were before."""
    a, b = before - before[0], after - after[0]
    apart = np.sqrt((a * a).sum(axis=1)) - np.sqrt((b * b).sum(axis=1))
    if np.abs(apart).max() > 2.0 * before.shape[1] ** 0.5 * tolerance:  # a distance that no such motion leaves
        return False
    x, y = before - before.mean(axis=0), after - after.mean(axis=0)
    left, _, right = np.linalg.svd(x.T @ y)
    return bool(np.abs(x @ (left @ right) - y).max() <= tolerance)


def _carry(problem: Problem, grid: Grid, grasps: list[Grasp], starts: Starts, t: float, q: Floats) -> None:
    """Shift the control points q (n_u, nc) with the grasps, evenly in between, where they move to at time `t` [s].

    A grasp that moves alone by more than a span folds the cable there, and a fold finer than the quadrature stays.
    """
    if not grasps:
        return
    order = sorted(grasps, key=lambda g: g.u)
    dimensions = problem.plane.dimensions
    shift = np.array(
        [
            problem.plane.points(g.path.at(np.array([t - g.start]), starts[g][0])[0]) - grid.at(q, g.u)[:dimensions]
            for g in order
        ]
    )
    middle = (grid.knots[1:-3] + grid.knots[2:-2] + grid.knots[3:-1]) / 3  # of the control points
    for d in range(dimensions):
        q[:, d] += np.interp(middle, [g.u for g in order], shift[:, d])


def _unbalanced(problem: Problem, grid: Grid, history: History, q: Floats, applied: Floats) -> Floats:
    """Return the forces (n_u, nc) [N] on the control points q that nothing balances but what holds them."""
    active, parameters = problem.laws
    f, nothing = np.empty_like(q), np.empty((1, 1))
    assemble(
        problem.axes, q, np.zeros_like(q), grid.tables, active, parameters, history, NO_RATES, (0.0, 0.0, 0.0), f,
        nothing,
    )  # fmt: skip
    return np.asarray(f - applied)
