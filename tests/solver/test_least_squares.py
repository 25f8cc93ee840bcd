"""The compiled normal equations of the space-time least squares are those of docs/model.md eq. 16 and 17."""

import numpy as np
import pytest
from numpy.typing import NDArray

from dlocore import Cable, Environment, Grasp, Move, Points, Scene, Table
from dlocore.events import closed_grasps, time_knots
from dlocore.holding import Starts, close_grasps
from dlocore.kernels.assembly import NO_RATES, assemble, history_at
from dlocore.kernels.banded import factor, factor_columns
from dlocore.kernels.leastsquares import band_to_dense, states_at
from dlocore.problem import pose
from dlocore.solvers.march import march
from dlocore.solvers.monitor import Monitor
from dlocore.solvers.spacetime import WindowSolver, windows_of
from dlocore.solvers.timefit import fit
from dlocore.statics import start_grid

Floats = NDArray[np.float64]


def window(table: Table | None, twist: str, damping: float) -> tuple[WindowSolver, Floats]:
    """Return the least squares of a clamped cable on a small grid, and control points near its solution."""
    u = np.linspace(0.0, 1.0, 12)[:, None]
    arc = u * [1.0, 0.0, 0.0] + 0.05 * np.sin(3.0 * u) * [0.0, 1.0, 0.0]
    scene = Scene(
        cable=Cable.preset("paper", bending_damping=damping),
        shape=Points(points=arc),
        grasps=(Grasp(u=0.3, hold="clamp", path=Move(displacement=(0.0, 0.1, 0.0), duration=1.0)),),
        environment=Environment(drag=0.05, table=table),
        effects={"twist": twist},
        horizon=1.2,
    )
    problem = pose(scene)
    monitor = Monitor(None, None, None)
    grid = start_grid(problem, 9, monitor)
    motion = march(problem, grid, 40, monitor)
    knots = time_knots(problem, 9)
    assert knots is not None
    part = windows_of(problem, knots)[0]
    grasps = closed_grasps(problem, part.begin, part.end)
    starts: Starts = {}
    close_grasps(problem, grid, grasps, starts, grid.start)
    solver = WindowSolver(
        problem, grid, part, grasps, starts, grid.start, motion.velocity, motion, 50.0, Monitor(None, None, None)
    )
    control = fit(motion, knots)[0] + 1e-3 * np.random.default_rng(0).standard_normal((9, 9, problem.nc))
    return solver, solver.constrain(control)


def dense(solver: WindowSolver, control: Floats) -> tuple[float, Floats, Floats]:
    """Return objective, normal matrix and right side from full matrices, as the equations are written."""
    nc, (n_t, n_u, _) = solver.nc, control.shape
    Z = np.array([solver.expand(row)[2].ravel() for row in np.eye((n_t - 2) * solver.free)[: solver.free]]).T
    band, full = np.zeros((n_u * nc, 4 * nc)), np.empty((n_u * nc, n_u * nc))
    for o in range(4):
        band[:, o * nc] = np.repeat(solver.grid.tables.mass[:, o], nc)
    band_to_dense(band, full)
    problem, h = solver.problem, solver.span
    M, C = (Z.T @ (factor * full) @ Z for factor in (problem.mass_density(), problem.drag_coefficient()))
    B = 12.0 / h**2 * M + 2.0 / h * C
    A, right, value = np.zeros((n_t * solver.free,) * 2), np.zeros(n_t * solver.free), 0.0
    state, f, K, held = np.empty((3, n_u, nc)), np.empty((n_u, nc)), np.empty((n_u * nc, 4 * nc)), np.empty_like(full)
    for k, (first, basis) in enumerate(zip(solver.first, solver.table, strict=True)):
        states_at(first, basis, control, state)
        tangents = []
        for scales in ((0.0, 1.0, 0.0), (1.0, 0.0, 0.0)):
            history = history_at(solver.histories, k)
            tables, laws = solver.grid.tables, (solver.active, solver.parameters)
            assemble(solver.axes, state[0], state[1], tables, *laws, history, NO_RATES, scales, f, K)
            band_to_dense(K, held)
            tangents.append(Z.T @ held @ Z)
        V, Kp = tangents
        weight = np.linalg.inv(B + Kp + 2.0 / h * V)
        weight = weight @ B @ weight * solver.weights[k] / solver.weights.sum()
        force = (f - solver.applied[min(k, len(solver.applied) - 1)]).ravel()
        force += full @ (problem.mass_density() * state[2] + problem.drag_coefficient() * state[1]).ravel()
        R = Z.T @ force
        J = np.zeros((solver.free, n_t * solver.free))
        for j in range(4):
            columns = slice((first + j) * solver.free, (first + j + 1) * solver.free)
            J[:, columns] = basis[2, j] * M + basis[1, j] * (C + V) + basis[0, j] * Kp
        A += J.T @ weight @ J
        right += J.T @ weight @ R
        value += float(R @ weight @ R)
    given = 2 * solver.free
    return value, A[given:, given:], right[given:]


@pytest.mark.parametrize("damping", [0.0, 2e-4])
@pytest.mark.parametrize(("table", "twist"), [(Table(), "off"), (None, "off"), (None, "on")], ids=["2", "3", "4"])
def test_the_normal_equations_are_those_of_the_dense_matrices(table: Table | None, twist: str, damping: float) -> None:
    solver, control = window(table, twist, damping)
    value, A, right, _ = solver.objective(control, True)
    problem, h = solver.problem, solver.span
    unit = (12.0 * problem.mass_density() / h**2 + 2.0 * problem.drag_coefficient() / h) * problem.scene.cable.length
    expected, full, gradient = dense(solver, control)
    lower = np.zeros_like(A)
    for o in range(A.shape[1]):
        lower[: len(A) - o, o] = np.diagonal(full, -o)
    # rounding, of matrices whose stretch is 1e5 times as stiff as their bending
    assert value * unit == pytest.approx(expected, rel=1e-8)
    np.testing.assert_allclose(A, lower, atol=1e-8 * np.abs(lower).max())
    np.testing.assert_allclose(right, gradient, atol=1e-8 * np.abs(gradient).max())
    without_matrix = solver.objective(control, False)
    assert without_matrix[0] == value
    np.testing.assert_array_equal(without_matrix[2], right)


@pytest.mark.parametrize(("size", "width"), [(40, 12), (41, 12), (43, 12), (9, 12), (30, 3)])
@pytest.mark.parametrize("part", [1000, 7, 4])
def test_columns_by_fours_give_the_factors_of_single_ones(size: int, width: int, part: int) -> None:
    A = np.random.default_rng(size).standard_normal((size, width))
    A[:, 0] += 20.0
    inside = np.arange(width) < size - np.arange(size)[:, None]
    single, fours = np.where(inside, A, 0.0), np.where(inside, A, 0.0)
    assert factor(single) == -1
    for start in range(0, size, part):
        assert factor_columns(fours, start, min(start + part, size)) == -1
    np.testing.assert_allclose(fours[inside], single[inside], rtol=1e-12, atol=1e-14)


def test_columns_by_fours_tell_which_pivot_is_not_positive() -> None:
    A = np.zeros((20, 6))
    A[:, 0], A[:, 1] = 1.0, 0.1
    A[13, 0] = -1.0
    assert factor_columns(A.copy(), 0, 20) == factor(A.copy()) == 13
