"""The tension that the tangent of a step takes: an unknown of its own, which converges to that of the strain."""

from typing import NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from dlocore import Cable, Environment, Grasp, Move, Scene, Straight
from dlocore.kernels.assembly import NO_RATES, History, assemble
from dlocore.kernels.tension import ASSUMED, AT_HAND, COLUMNS, LAST, MODULUS, assume_last, keep, point_on
from dlocore.problem.discretisation import make_grid
from dlocore.problem.problem import Problem, pose
from dlocore.solvers.march import march
from dlocore.solvers.monitor import Monitor

Floats = NDArray[np.float64]

LENGTH, EA = 1.0, 640.0
CABLE = Cable(length=LENGTH, diameter=0.005, linear_density=0.05, bending_stiffness=1e-3, axial_stiffness=EA)
PLANE, SPACE = Environment(gravity=(0.0, 0.0, 0.0), drag=0.05), Environment(gravity=(0.0, 2.0, -9.81), drag=0.05)
DIMENSIONS = pytest.mark.parametrize("around", [PLANE, SPACE], ids=["plane", "space"])
FULL, NONE = (1.0, 0.0, 1.0), (0.0, 0.0, 0.0)


class Line(NamedTuple):
    """A problem, its tables and a history that keeps the tension."""

    problem: Problem
    tables: NamedTuple
    history: History

    @property
    def kept(self) -> Floats:
        return np.asarray(self.history.tension)

    def force(self, q: Floats) -> Floats:
        f = np.zeros_like(q)
        self._assemble(q, NONE, f, np.zeros((1, 1)))
        return f

    def tangent(self, q: Floats) -> Floats:
        """Return the dense tangent (n nc, n nc) [N/m]."""
        nc = q.shape[1]
        band = np.zeros((q.size, 4 * nc))
        self._assemble(q, FULL, np.zeros_like(q), band)
        K = np.zeros((q.size, q.size))
        for o in range(4 * nc):
            j = np.arange(q.size - o)
            K[j + o, j] = K[j, j + o] = band[: q.size - o, o]
        return K

    def _assemble(self, q: Floats, scales: tuple[float, float, float], f: Floats, K: Floats) -> None:
        problem = self.problem
        still = np.zeros_like(q)
        assemble(problem.axes, q, still, self.tables, *problem.laws, self.history, NO_RATES, scales, f, K)


def line(around: Environment) -> Line:
    problem = pose(Scene(cable=CABLE, shape=Straight(), environment=around, effects={"twist": "off"}, horizon=1.0))
    grid = make_grid(problem, 9)
    tension = np.full((len(grid.tables.axial.w), COLUMNS), np.nan)
    return Line(problem, grid.tables, grid.past()._replace(tension=tension))


def bent(nc: int) -> Floats:
    """Return a bent and strained cable (9, nc) [m]."""
    u = np.linspace(0.0, LENGTH, 9)
    q = np.random.default_rng(2).normal(0.0, 3e-4, (9, nc))
    q[:, 0] += np.sin(2.0 * u) / 2.0
    q[:, 1] += (1.0 - np.cos(2.0 * u)) / 2.0
    return q


@DIMENSIONS
def test_the_tension_is_pointed_to_to_first_order(around: Environment) -> None:
    cable = line(around)
    q = bent(cable.problem.nc)
    change = np.random.default_rng(3).normal(size=q.shape)
    missed = []
    for step in (1e-4, 1e-5):
        cable.force(q)
        point_on(q.shape[1], q + step * change, step * change, cable.tables.axial, cable.kept)
        pointed = cable.kept[:, ASSUMED].copy()
        cable.force(q + step * change)
        missed.append(np.abs(cable.kept[:, AT_HAND] - pointed).max())
    assert missed[0] < EA * (1e-4 * 30.0) ** 2  # slopes of splines through nine points change by 30 times as much
    np.testing.assert_allclose(missed[0] / missed[1], 100.0, rtol=0.05)  # of second order, but for the third


@DIMENSIONS
def test_the_tangent_that_takes_the_tension_at_hand_is_that_of_the_force(around: Environment) -> None:
    cable = line(around)
    q = bent(cable.problem.nc)
    unknown = cable.tangent(q)  # NaN: nothing is assumed
    np.testing.assert_array_equal(cable.kept[:, MODULUS], EA)
    cable.kept[:, ASSUMED] = cable.kept[:, AT_HAND]
    np.testing.assert_array_equal(cable.tangent(q), unknown)
    columns = []
    for i in range(q.size):
        e = np.zeros(q.size)
        e[i] = 1e-6
        ahead, behind = (cable.force(q + side * e.reshape(q.shape)).ravel() for side in (1.0, -1.0))
        columns.append((ahead - behind) / 2e-6)
    # rounding of the force over the step, and step^2 of its third derivative
    np.testing.assert_allclose(np.column_stack(columns), unknown, atol=1e-7 * np.abs(unknown).max())


@DIMENSIONS
def test_a_newton_step_with_the_tension_of_the_solution_leaves_a_tenth_of_the_error(around: Environment) -> None:
    cable = line(around)
    solution = bent(cable.problem.nc)
    held = 50.0  # [N/m] of every control point: the stiffness of inertia in a step
    sought = cable.force(solution) - held * solution
    right = cable.kept[:, AT_HAND].copy()
    guess = solution + np.random.default_rng(4).normal(0.0, 5e-5, solution.shape)
    left = []
    for assumed in (np.nan, right):
        cable.kept[:, ASSUMED] = assumed
        K = cable.tangent(guess) - held * np.eye(guess.size)
        residual = cable.force(guess) - held * guess - sought
        step = np.linalg.solve(K, residual.ravel()).reshape(guess.shape)
        left.append(np.abs(guess - step - solution).max())
    assert left[1] < 0.1 * left[0]


def test_a_step_takes_the_tension_of_the_last_one_where_it_is_known() -> None:
    kept = np.arange(12.0).reshape(3, COLUMNS)
    keep(kept)
    np.testing.assert_array_equal(kept[:, LAST], [0.0, 4.0, 8.0])
    kept[:, ASSUMED] = 99.0
    assume_last(kept, True)
    np.testing.assert_array_equal(kept[:, ASSUMED], kept[:, LAST])
    assume_last(kept, False)
    assert np.isnan(kept[:, ASSUMED]).all()


@DIMENSIONS
def test_a_march_ends_with_the_tension_of_its_last_state(around: Environment) -> None:
    grasp = Grasp(u=0.3, path=Move(displacement=(0.1, 0.3, 0.0), duration=1.0))
    scene = Scene(cable=CABLE, shape=Straight(), grasps=(grasp,), environment=around, horizon=1.0)
    problem = pose(scene)
    motion = march(problem, make_grid(problem, 9), 80, Monitor(None, None, None))
    kept = motion.history.tension
    tables = motion.grid.tables
    index = tables.axial.first[:, None] + np.arange(4)
    slopes = np.einsum("pi,pid->pd", tables.axial.b1, motion.states[-1][index][..., : problem.plane.dimensions])
    tension = EA * (np.linalg.norm(slopes, axis=1) - 1.0)
    # the strain of the last state is known to what Newton's method leaves of it, 1e-7 L over a span of L/8
    np.testing.assert_allclose(kept[:, LAST], tension, atol=0.05 * np.abs(tension).max() + EA * 1e-6)
