"""The space-time least squares: its compiled normal equations (docs/model.md eq. 16, 17), and its tension (eq. 15b)."""

import weakref
from typing import Literal, cast

import numpy as np
import pytest
from numpy.typing import NDArray

from dlocore import Cable, Environment, Grasp, Move, PointMass, Points, Quality, Scene, Table, predict
from dlocore.kernels.anderson import advance, room
from dlocore.kernels.assembly import NO_RATES, assemble, history_at
from dlocore.kernels.banded import elimination
from dlocore.kernels.blocks import REACH, factor_rows, solve_blocks
from dlocore.kernels.leastsquares import band_to_dense, holding_forces, states_at
from dlocore.problem.events import closed_grasps
from dlocore.problem.holding import Starts, close_grasps
from dlocore.problem.problem import pose
from dlocore.problem.time_grid import time_knots
from dlocore.solvers.bands import dense_of
from dlocore.solvers.march import march
from dlocore.solvers.monitor import Monitor
from dlocore.solvers.spacetime import WindowSolver, _linearised, behind_softer, windows_of
from dlocore.solvers.timefit import fit
from dlocore.statics.statics import start_grid
from tests.solver.scenes import arc

Floats = NDArray[np.float64]


def window(
    table: Table | None, twist: str, damping: float, masses: tuple[PointMass, ...] = ()
) -> tuple[WindowSolver, Floats]:
    """Return the least squares of a clamped cable on a small grid, and control points near its solution."""
    u = np.linspace(0.0, 1.0, 12)[:, None]
    wave = u * [1.0, 0.0, 0.0] + 0.05 * np.sin(3.0 * u) * [0.0, 1.0, 0.0]
    scene = Scene(
        cable=Cable.preset("paper", bending_damping=damping, point_masses=masses),
        shape=Points(points=wave),
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
    grasps = closed_grasps(problem.scene, part.begin, part.end)
    starts: Starts = {}
    close_grasps(problem, grid, grasps, starts, grid.start)
    solver = WindowSolver(
        problem, grid, part, grasps, starts, grid.start, motion.velocity, motion, 50.0, Monitor(None, None, None)
    )
    control = fit(motion, knots)[0] + 1e-3 * np.random.default_rng(0).standard_normal((9, 9, problem.nc))
    return solver, solver.constrain(control)


def dense(solver: WindowSolver, control: Floats) -> tuple[float, Floats, Floats, Floats]:
    """Return objective, normal matrix, right side and holding forces from full matrices."""
    eq, nc, (n_t, n_u, _) = solver.equations, solver.nc, control.shape
    Z = np.array([solver.expand(row)[2].ravel() for row in np.eye((n_t - 2) * solver.free)[: solver.free]]).T
    problem, h, tables = solver.problem, eq.h, solver.grid.tables
    inertia = np.kron(problem.mass_density() * dense_of(tables.inertia), np.eye(nc))
    drag = np.kron(problem.drag_coefficient() * dense_of(tables.unit), np.eye(nc))
    M, C = (Z.T @ matrix @ Z for matrix in (inertia, drag))
    beside = len(problem.masses) > 0  # drag is viscosity then
    B = 12.0 / h**2 * M + (0.0 if beside else 2.0 / h) * C
    A, right, value = np.zeros((n_t * solver.free,) * 2), np.zeros(n_t * solver.free), 0.0
    state, f, K, held = np.empty((3, n_u, nc)), np.empty((n_u, nc)), np.empty((n_u * nc, 4 * nc)), np.empty_like(drag)
    holding = np.empty((len(eq.first), len(eq.e.held)))
    for k, (first, basis) in enumerate(zip(eq.first, eq.table, strict=True)):
        states_at(first, basis, control, state)
        tangents = []
        for scales in ((0.0, 1.0, 0.0), (1.0, 0.0, 0.0)):
            history = history_at(eq.histories, k)
            assemble(eq.axes, state[0], state[1], eq.tables, eq.active, eq.p, history, NO_RATES, scales, f, K)
            band_to_dense(K, held)
            tangents.append(Z.T @ held @ Z)
        V, Kp = tangents
        weight = np.linalg.inv(B + Kp + 2.0 / h * (V + C if beside else V))
        weight = weight @ B @ weight * eq.weights[k] / eq.weights.sum()
        force = (f - eq.applied[min(k, len(eq.applied) - 1)]).ravel()
        force += inertia @ state[2].ravel() + drag @ state[1].ravel()
        holding[k] = force[eq.e.held]
        R = Z.T @ force
        J = np.zeros((solver.free, n_t * solver.free))
        for j in range(4):
            columns = slice((first + j) * solver.free, (first + j + 1) * solver.free)
            J[:, columns] = basis[2, j] * M + basis[1, j] * (C + V) + basis[0, j] * Kp
        A += J.T @ weight @ J
        right += J.T @ weight @ R
        value += float(R @ weight @ R)
    given = 2 * solver.free
    return value, A[given:, given:], right[given:], holding


def whole(blocks: Floats) -> Floats:
    """Return the symmetric matrix that blocks as those of `factor_rows` stand for."""
    count, m, _ = blocks.shape
    A = np.zeros((count + REACH, m, count + REACH, m))
    for t in range(count):
        for o in range(REACH):
            A[t, :, t + o] = blocks[t, :, o * m : (o + 1) * m]
    upper = np.triu(A[:count, :, :count].reshape(count * m, count * m))
    return upper + np.triu(upper, 1).T


@pytest.mark.parametrize("masses", [(), (PointMass(u=0.6, mass=0.02), PointMass(u=1.0, mass=0.03))], ids=["", "heavy"])
@pytest.mark.parametrize("damping", [0.0, 2e-4])
@pytest.mark.parametrize(("table", "twist"), [(Table(), "off"), (None, "off"), (None, "on")], ids=["2", "3", "4"])
def test_the_normal_equations_are_those_of_the_dense_matrices(
    table: Table | None, twist: str, damping: float, masses: tuple[PointMass, ...]
) -> None:
    solver, control = window(table, twist, damping, masses)
    value, A, right = solver.objective(control, True)
    problem, h = solver.problem, solver.equations.h
    unit = (12.0 * problem.mass_density() / h**2 + 2.0 * solver.equations.dragged / h) * problem.scene.cable.length
    expected, full, gradient, holding = dense(solver, control)
    # rounding, of matrices whose stretch is 1e5 times as stiff as their bending
    assert value * unit == pytest.approx(expected, rel=1e-8)
    np.testing.assert_allclose(whole(A), full, atol=1e-8 * np.abs(full).max())
    np.testing.assert_allclose(right, gradient, atol=1e-8 * np.abs(gradient).max())
    without_matrix = solver.objective(control, False)
    assert without_matrix[0] == value
    np.testing.assert_array_equal(without_matrix[2], right)
    forces, states = holding_forces(solver.equations, control)
    np.testing.assert_allclose(forces, holding, atol=1e-8 * np.abs(holding).max())
    first, table_t = solver.equations.first, solver.equations.table
    np.testing.assert_allclose(
        states, np.einsum("kj,kjid->kid", table_t[:, 0], control[first[:, None] + np.arange(4)]), atol=1e-14
    )


@pytest.mark.parametrize(("count", "m"), [(7, 5), (6, 8), (5, 19), (2, 16), (1, 3), (3, 75)])
@pytest.mark.parametrize("part", [10000, 16, 7])
def test_blocks_are_solved_as_the_whole_matrix(count: int, m: int, part: int) -> None:
    rng = np.random.default_rng(m)
    blocks = rng.standard_normal((count, m, REACH * m))
    blocks[:, np.arange(m), np.arange(m)] += 10.0 * m
    A, right = whole(blocks), rng.standard_normal(count * m)
    for start in range(0, count * m, part):
        assert factor_rows(blocks, start, min(start + part, count * m)) == -1
    x = right.copy()
    solve_blocks(blocks, x)
    np.testing.assert_allclose(x, np.linalg.solve(A, right), rtol=1e-9)  # rounding; the condition number is below 10


def test_the_factorisation_tells_which_pivot_is_not_positive() -> None:
    blocks = np.zeros((4, 5, 20))
    blocks[:, np.arange(5), np.arange(5)] = 1.0
    blocks[2, 3, 3] = -1.0
    assert factor_rows(blocks, 0, 20) == 13


def test_steps_are_combined_as_least_squares_of_their_differences() -> None:
    """The next iterate is x + f - (dX + dF) g, with the g for which |f - dF g| is least (Walker and Ni, 2011)."""
    n_t, n, depth, rng = 6, 3, 2, np.random.default_rng(3)
    e = elimination(n, 2, 2, np.array([1]), np.zeros((1, n)), np.empty(0, np.int64), np.empty((0, n)))
    free = n * 2 - 2
    blocks = np.zeros((n_t - 2, free, REACH * free))
    blocks[:, np.arange(free), np.arange(free)] = 1.0
    last = room(depth, n_t * n * 2)
    points, steps = [], []
    for known in range(5):
        control = rng.standard_normal((n_t, n, 2))
        right = rng.standard_normal((n_t - 2) * free)
        step = np.zeros((n_t, n, 2))
        step[2:, [0, 2]] = -right.reshape(n_t - 2, 2, 2)
        update, share, following = advance(e, blocks, right, control, last, known, 0.5, 0.0)
        assert update == pytest.approx(np.linalg.norm(step), rel=1e-12)  # rounding, as all below
        assert share == pytest.approx(0.5 / np.abs(step).max(), rel=1e-12)
        points.append(control.ravel())
        steps.append(share * step.ravel())
        expected = points[-1] + steps[-1]
        if known > 0:
            dx, df = (np.diff(a[-depth - 1 :], axis=0).T for a in (points, steps))
            expected = expected - (dx + df) @ np.linalg.lstsq(df, steps[-1], rcond=None)[0]
        np.testing.assert_allclose(following.ravel(), expected, atol=1e-12)
    last_step = advance(e, blocks, 1e-3 * right, control, last, 5, 0.5, 1.0)
    np.testing.assert_allclose(last_step[2], control + 1e-3 * step, atol=1e-15)


def pulled_taut(method: Literal["march", "spacetime"]) -> Scene:
    """Return an arc of 1 m whose ends are pulled apart until 0.1 mm are left of what it is longer than straight."""
    points = arc(1.0, 0.85)
    end = points[-1]
    way = end / np.linalg.norm(end) * 0.9999 - end
    return Scene(
        cable=Cable.preset("paper"),
        shape=Points(points=points, settle=True),
        grasps=(Grasp(u=0.0), Grasp(u=1.0, path=Move(displacement=way, duration=1.0))),
        environment=Environment(drag=0.05, table=Table()),
        horizon=1.2,
        quality=Quality(n_u=17, n_t=25, method=method, keep_grid=True),
    )


def test_a_softer_cable_that_is_pulled_taut_does_not_sag() -> None:
    # the bounded stiffness alone left it 7 mm from the march
    marched, least = predict(pulled_taut("march")), predict(pulled_taut("spacetime"))
    assert least.status == "converged"
    u, t = np.linspace(0.0, 1.0, 65), np.linspace(0.0, 1.2, 65)
    apart = np.linalg.norm(least.surface.positions(u, t) - marched.surface.positions(u, t), axis=-1)
    assert apart.max() < 3e-4
    pull, expected = (answer.grasps[1].reaction[-1] for answer in (least, marched))
    np.testing.assert_allclose(pull, expected, rtol=0.15)


@pytest.mark.parametrize("soft", [0.1, 1.0])
def test_strained_as_the_march_it_bears_the_tension_of_the_march(soft: float) -> None:
    problem = pose(pulled_taut("spacetime"))
    monitor = Monitor(None, None, None)
    motion = march(problem, start_grid(problem, 9, monitor), 40, monitor)
    tables, stiffness = motion.grid.tables, problem.stretch.axial_stiffness
    step = np.diff(motion.times)[:, None]
    between = 0.5 * (motion.times[1:] + motion.times[:-1])
    index = tables.axial.first[:, None] + np.arange(4)
    slopes = np.einsum("pi,kpid->kpd", tables.axial.b1, motion.states[:, index])
    strains = np.linalg.norm(slopes, axis=-1) - 1.0
    mean = 0.5 * (strains[1:] + strains[:-1])
    damping = problem.stretch_damping
    assert damping is not None
    tension = stiffness * mean + damping.axial_damping * np.diff(strains, axis=0) / step
    resting = behind_softer(problem, motion, between, soft * stiffness).axial[..., 0]
    expected = tension if soft < 1.0 else stiffness * mean  # of the true stiffness the march is no guide
    np.testing.assert_allclose(soft * stiffness * (mean - resting), expected, atol=1e-9 * np.abs(tension).max())


class Indefinite:
    """A least squares whose normal matrix has no positive factors without damping; it counts those that are kept."""

    def __init__(self) -> None:
        self.matrices: list[weakref.ref[Floats]] = []
        self.kept: list[int] = []

    def objective(self, control: Floats, matrix: bool) -> tuple[float, Floats, Floats]:
        self.kept.append(sum(one() is not None for one in self.matrices))
        A = np.ones((2, 3, 12))
        self.matrices.append(weakref.ref(A))
        return 1.0, A, np.zeros(6)

    def factor(self, A: Floats, damping: float) -> bool:
        return damping > 0.0


def test_a_matrix_without_positive_factors_is_given_up_before_the_next_is_made() -> None:
    solver = Indefinite()
    _, factors, _, damping = _linearised(cast(WindowSolver, solver), np.zeros((4, 3, 1)))
    assert factors is not None
    assert damping > 0.0
    assert solver.kept == [0, 0]
