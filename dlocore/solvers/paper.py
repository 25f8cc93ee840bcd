"""The paper's scheme exactly as printed (eq. 20 to 25), for comparison.

It is a plain least squares over all collocation points, started from the cable at rest, with the true stretch stiffness
and the full Hessian, iterated until the update is below delta. It often does not converge (docs/model.md); the message
then says so.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from dlocore.errors import SceneError
from dlocore.kernels.assembly import NO_RATES, History, assemble, history_at, multiply_scalar_band
from dlocore.kernels.basis import basis_rows
from dlocore.kernels.leastsquares import band_to_dense, states_at
from dlocore.problem.discretisation import applied_forces
from dlocore.problem.events import closed_grasps
from dlocore.problem.holding import Starts, close_grasps
from dlocore.problem.problem import Problem
from dlocore.solvers.bands import dense_of
from dlocore.solvers.march import March
from dlocore.solvers.monitor import Monitor
from dlocore.solvers.spacetime import Solved, WindowSolver, windows_of

Floats = NDArray[np.float64]

MAX_ITERATIONS = 50
LARGEST_NET = 600  # control points: the least squares is dense, as printed
BEYOND = 1e6  # times the length: iterates that went so far do not come back


def refuse(problem: Problem, n_u: int, n_t: int) -> None:
    """Refuse what the printed scheme can't solve on a grid of n_u control points along the cable and n_t in time.

    Raises:
        SceneError: the motion has jumps in it, or the net is too large for a dense least squares.
    """
    if any(event.multiplicity > 1 for event in problem.events):
        allowed = '"march" or "spacetime" where grasps open, close or jump in mid-motion'
        raise SceneError("quality.method", "paper", allowed, "The printed scheme has one smooth motion")
    if n_u * n_t > LARGEST_NET:
        allowed = f"at most {LARGEST_NET} control points with the printed scheme, which is dense"
        raise SceneError("quality.n_u", f"n_u n_t = {n_u * n_t}", allowed)


def solve_as_printed(
    problem: Problem,
    motion: March,
    knots_t: Floats,
    delta: float,
    monitor: Monitor,
    on_step: Callable[[Floats, float, float], None],
) -> Solved:
    """Iterate the printed scheme, for a problem that `refuse` accepts.

    Args:
        problem: what is solved.
        on_step: called with (control, update [m], residual [N]) after every iteration.

    Raises:
        Cancelled: the caller asked to stop.
    """
    grid = motion.grid
    n_t, n_u = len(knots_t) - 4, grid.n_u
    grasps = closed_grasps(problem.scene, 0.0, problem.horizon)
    starts: Starts = {}
    close_grasps(problem, grid, grasps, starts, None)
    window = WindowSolver(
        problem,
        grid,
        windows_of(problem, knots_t)[0],
        grasps,
        starts,
        grid.start,
        grid.velocity,
        motion,
        problem.stretch.axial_stiffness,
        monitor,
    )
    times = np.linspace(0.0, problem.horizon, n_u * n_t + 1)[1:]
    first, table = basis_rows(knots_t, times, 2)
    applied = applied_forces(problem, grid, times, problem.horizon)
    histories = motion.behind(times)
    control = window.constrain(np.tile(grid.start, (n_t, 1, 1)))
    Z = np.array([window.expand(row)[2].ravel() for row in np.eye(window.free)]).T
    update = np.inf
    for _ in range(MAX_ITERATIONS):
        monitor.check()
        J, R = _equations(window, control, first, table, applied, Z, histories)
        if not np.isfinite(J).all():
            break
        x = np.asarray(np.linalg.lstsq(J, -R, rcond=None)[0], dtype=np.float64)
        step = window.expand(x)
        control = control + step
        update = float(np.linalg.norm(step))
        on_step(control, update, float(np.sqrt(np.mean(R * R))))
        if not update <= BEYOND * problem.scene.cable.length or update < delta:
            break
    return Solved(control, update < delta, update, None)


def _equations(
    window: WindowSolver,
    control: Floats,
    first: NDArray[np.int64],
    table: Floats,
    applied: Floats,
    Z: Floats,
    histories: History,
) -> tuple[Floats, Floats]:
    """Return the stacked regression matrix (paper eq. 21, 23) in the free unknowns and the residuals at the iterate."""
    n_t, n_u, nc = control.shape
    size, free = n_u * nc, window.free
    K, dense = np.empty((size, 4 * nc)), np.empty((size, size))
    heavy = window.problem.mass_density() * window.grid.tables.inertia
    dragged = window.problem.drag_coefficient() * window.grid.tables.unit
    M, N = (np.kron(dense_of(band), np.eye(nc)) for band in (heavy, dragged))
    f, state = np.empty((n_u, nc)), np.empty((3, n_u, nc))
    J = np.zeros((len(first) * free, (n_t - 2) * free))
    R = np.empty(len(first) * free)
    for k in range(len(first)):
        states_at(first[k], table[k], control, state)
        laws = (window.equations.active, window.equations.p, history_at(histories, k), NO_RATES)
        assemble(window.equations.axes, state[0], state[1], window.grid.tables, *laws, (1.0, 0.0, 1.0), f, K)
        band_to_dense(K, dense)
        multiply_scalar_band(heavy, state[2], 1.0, f)
        multiply_scalar_band(dragged, state[1], 1.0, f)
        f -= applied[min(k, len(applied) - 1)]
        rows = slice(k * free, (k + 1) * free)
        R[rows] = Z.T @ f.ravel()
        reduced = [Z.T @ matrix @ Z for matrix in (dense, N, M)]
        for j in range(max(0, 2 - int(first[k])), 4):
            column = (int(first[k]) + j - 2) * free
            J[rows, column : column + free] = sum(table[k, o, j] * reduced[o] for o in range(3))
    return J, R
