"""Observed orders of convergence in the material coordinate, in the time steps and in the time spline."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.catalogue import catalogue
from dlocore import Quality, Scene, predict
from dlocore.kernels.newmark import coefficients
from dlocore.levels.level import run_level
from dlocore.problem.problem import Problem, pose
from dlocore.solvers.march import RHO, STRONGLY_DAMPED, march
from dlocore.solvers.monitor import Monitor
from dlocore.spline import design_matrix
from dlocore.statics.statics import start_grid
from tests.solver.scenes import Floats, apart, paper_scene, refined, rms


def swept(hold: str = "point", u: float = 0.0) -> Scene:
    """Return a stiff cable moved gently at one end: no sharp bend that a coarse grid could miss."""
    return paper_scene(u, 1e-2, hold=hold)


def marched(problem: Problem, n_u: int, steps: int) -> Floats:
    """Return the shapes (9, 101, nc) [m] at nine time steps of a march, without the time spline."""
    motion = run_level(problem, n_u, 13, steps, Monitor()).motion
    assert not motion.stopped
    at = np.searchsorted(motion.times, np.linspace(0.0, problem.horizon, 9) - 1e-9)
    return design_matrix(motion.grid.knots, np.linspace(0.0, 1.0, 101)) @ motion.states[at]


def orders(values: list[Floats], exact: Floats) -> Floats:
    """Return the observed orders between values of which each has twice the resolution of the one before."""
    errors = [np.sqrt(((v - exact) ** 2).sum(axis=-1).mean()) for v in values]
    return np.log2(np.divide(errors[:-1], errors[1:]))


@pytest.mark.parametrize(("hold", "u"), [("point", 0.0), ("tangent", 0.0), ("point", 0.5), ("tangent", 0.5)])
def test_order_of_convergence_in_space_is_four(hold, u):
    problem = pose(swept(hold, u))
    exact = marched(problem, 97, 320)
    # 8, 16, 32 spans; knots at and towards the grasps keep the order where r''' jumps
    assert orders([marched(problem, n, 320) for n in (11, 19, 35)], exact).min() > 3.7


@pytest.mark.parametrize("u", [0.0, 0.5])
def test_order_of_convergence_in_time_is_two(u):
    problem = pose(swept(u=u))
    exact = marched(problem, 13, 5120)
    found = orders([marched(problem, 13, n) for n in (80, 160, 320)], exact)
    assert found.min() > 1.8
    assert found.max() < 2.2


@pytest.mark.parametrize(
    ("rho", "jumps", "slower", "decay"),
    [(0.5, False, 0.12, None), (0.5, True, 0.17, 1.8e-3), (0.0, True, 0.39, 1.03e-2)],
)
def test_steps_keep_period_and_swing_as_the_model_says(rho: float, jumps: bool, slower: float, decay: float | None):
    # a'' = -w^2 q in steps with w h = 0.3: the part of the frequency that is lost, over (w h)^2, and the damping ratio
    alpha_m, alpha_f, gamma, beta = coefficients.py_func(rho, jumps)
    wh = 0.3
    after = [[wh**2 * (1.0 - alpha_f), 0.0, 1.0 - alpha_m], [1.0, 0.0, -beta], [0.0, 1.0, -gamma]]
    before = [[-(wh**2) * alpha_f, 0.0, -alpha_m], [1.0, 1.0, 0.5 - beta], [0.0, 1.0, 1.0 - gamma]]
    values = np.linalg.eigvals(np.linalg.solve(after, before))
    swing = values[np.argmax(np.abs(values.imag))]
    assert (1.0 - abs(np.angle(swing)) / wh) / wh**2 == pytest.approx(slower, abs=5e-3)
    if decay is not None:
        assert -np.log(abs(swing)) / abs(np.angle(swing)) == pytest.approx(decay, rel=0.01)


def test_contact_in_reach_leaves_the_order_in_time_and_most_of_the_accuracy():
    # forces that jump are balanced at the end of a step; the table is never touched
    problem = pose(catalogue()["cable carried high above a table"])
    assert problem.contact is not None

    def shapes(steps: int, rho: float = RHO) -> Floats:
        motion = march(problem, start_grid(problem, 13, Monitor()), steps, Monitor(), rho=rho)
        assert motion.deepest == 0.0
        assert not motion.kinked or rho == STRONGLY_DAMPED
        return motion.states[:: steps // 40]

    exact, damped = shapes(5120), [shapes(n, STRONGLY_DAMPED) for n in (160, 320)]
    errors = [np.abs(shapes(n) - exact).max() for n in (160, 320)]
    assert 3.4 < errors[0] / errors[1] < 4.6
    assert all(error < 0.5 * np.abs(x - exact).max() for error, x in zip(errors, damped, strict=True))


def test_time_spline_converges_with_its_control_points():
    problem = pose(swept())
    level = {n: run_level(problem, 13, n, 640, Monitor()) for n in (11, 19, 35, 67)}
    u, t = np.linspace(0.0, 1.0, 51), np.linspace(0.0, 1.6, 97)

    def shapes(n: int) -> Floats:
        along_u = design_matrix(level[n].motion.grid.knots, u)
        return np.einsum("tj,jid,ui->tud", design_matrix(level[n].knots_t, t), level[n].control, along_u)

    # four for a smooth motion, 3 where the jerk jumps: at both ends of a minimum-jerk move
    assert orders([shapes(n) for n in (11, 19, 35)], shapes(67)).min() > 2.9


def test_least_squares_tends_to_the_march_with_its_control_points():
    scene = swept()
    exact = refined(scene, 1e-4).surface
    errors = []
    for n_u, n_t in ((9, 13), (13, 21), (17, 33)):
        found = predict(replace(scene, quality=Quality(n_u=n_u, n_t=n_t, method="spacetime", keep_grid=True)))
        errors.append(rms(apart(found.surface, exact)))
    assert errors[2] < 0.5 * errors[1] < 0.25 * errors[0]  # measured: 0.16, 0.05 and 0.02 mm
