"""Loads that last for less than a step: none is stepped over, and of its impulse nothing is lost."""

from itertools import pairwise

import numpy as np
import pytest

from dlocore import Cable, Environment, Grasp, Load, Quality, Scene, Straight, predict
from dlocore.problem.discretisation import applied_forces, applied_in_steps, make_grid
from dlocore.problem.problem import pose

HORIZON = 2.0
MASS = 0.1  # [kg], of a metre
NOWHERE = Environment(gravity=(0.0, 0.0, 0.0))
INSTANTS = np.sort(np.random.default_rng(4).uniform(0.1, 1.9, 40))
PUSHES = np.random.default_rng(5).normal(size=(40, 3))
PUSHES[[0, -1]] = 0.0


def bar(load: Load, **quality: float) -> Scene:
    """Return a stiff bar that flies freely."""
    cable = Cable(length=1.0, diameter=0.01, linear_density=MASS, bending_stiffness=1.0)
    return Scene(
        cable=cable, shape=Straight(), loads=[load], environment=NOWHERE, horizon=HORIZON, quality=Quality(**quality)
    )


def stepped(load: Load, times: np.ndarray, begin: float = 0.0, end: float = HORIZON) -> np.ndarray:
    """Return the sum (k, 3) [N] of the forces that a march takes from a load."""
    problem = pose(bar(load))
    grid = make_grid(problem, 9)
    return applied_in_steps(problem, grid, times, begin, end).sum(axis=1) @ problem.plane.axes


@pytest.mark.parametrize("steps", [21, 40, 1000])
def test_the_impulse_of_any_load_is_kept(steps: int) -> None:
    times = np.linspace(0.0, HORIZON, steps + 1)
    forces = stepped(Load(u=0.3, force=PUSHES, times=INSTANTS), times)
    np.testing.assert_allclose(HORIZON / steps * forces.sum(axis=0), np.trapezoid(PUSHES, INSTANTS, axis=0), atol=1e-12)


def test_what_pushes_in_the_first_step_comes_with_the_next() -> None:
    tap = Load(u=0.3, force=[[0, 0, 0], [3, 2, 1], [0, 0, 0]], times=[0.01, 0.02, 0.03])
    forces = stepped(tap, np.linspace(0.0, HORIZON, 11))
    np.testing.assert_allclose(0.2 * forces[1:].sum(axis=0), [0.03, 0.02, 0.01], atol=1e-12)


def test_a_load_that_is_linear_meanwhile_stays_what_it_is() -> None:
    load = Load(u=0.3, force=[[1.0, -2.0, 0.5], [-3.0, 1.0, 0.0]], times=[0.0, HORIZON])
    times = np.linspace(0.0, HORIZON, 12)
    np.testing.assert_allclose(stepped(load, times), load.at(times), atol=1e-12)
    steady = Load(u=0.3, force=[[1.0, -2.0, 0.5]], times=[0.5])
    np.testing.assert_allclose(stepped(steady, times), steady.at(times), atol=1e-12)


def test_steps_that_are_taken_in_parts_take_the_same_forces() -> None:
    times = np.linspace(0.0, HORIZON, 21)
    load = Load(u=0.3, force=PUSHES, times=np.sort(np.append(INSTANTS[1:], times[8])))  # one as a part ends
    whole = stepped(load, times)
    for first, last in pairwise([0, 1, 8, 15, 20]):
        part = stepped(load, times[first : last + 1])
        np.testing.assert_allclose(part[1:], whole[first + 1 : last + 1], atol=1e-12)


def test_without_loads_forces_are_those_of_any_time() -> None:
    problem = pose(Scene(cable=Cable.preset("paper"), shape=Straight(), grasps=(Grasp(u=0.0),), horizon=1.0))
    grid = make_grid(problem, 9)
    times = np.linspace(0.0, 1.0, 5)
    np.testing.assert_array_equal(
        applied_in_steps(problem, grid, times, 0.0, 1.0), applied_forces(problem, grid, times)
    )


@pytest.mark.parametrize("lasts", [1e-4, 2e-3, 0.05])
def test_a_free_bar_flies_off_with_the_impulse_of_a_tap(lasts: float) -> None:
    impulse, at = 0.2, 0.83  # [N s, s]
    tap = Load(u=0.5, force=[[0, 0, 0], [0, impulse / lasts, 0], [0, 0, 0]], times=[at - lasts, at, at + lasts])
    found = predict(bar(tap))
    assert found.status == "converged"
    control = found.surface([0.0, 0.5, 1.0], [0.5, HORIZON])[:, :, 1]
    np.testing.assert_allclose(control[0], 0.0, atol=1.5 * found.accuracy.error_estimate)
    went = impulse / MASS * (HORIZON - at)
    middle = np.trapezoid(found.surface(np.linspace(0.0, 1.0, 101), [HORIZON])[0, :, 1], dx=0.01)
    assert middle == pytest.approx(went, abs=1.5 * found.accuracy.error_estimate)
    assert found.accuracy.error_estimate < 0.01


@pytest.mark.parametrize("grid", [{}, {"n_u": 21, "n_t": 61}], ids=["free", "given"])
def test_a_tap_on_a_hanging_cable_moves_it_as_the_reference_says(grid: dict[str, int]) -> None:
    # both had not moved at all, at an estimated error of 0.1 mm
    tapped = Scene(
        cable=Cable(length=1.0, diameter=0.006, linear_density=0.05, bending_stiffness=2e-3),
        shape=Straight(direction=(0, 0, -1)),
        grasps=[Grasp(u=0)],
        loads=[Load(u=1.0, force=[[0, 0, 0], [0, 1, 0], [0, 0, 0]], times=[1.03, 1.04, 1.05])],
        environment=Environment(drag=0.02),
        horizon=3.0,
        quality=Quality(**grid),
    )
    found = predict(tapped)
    assert found.status == "converged"
    tip = np.abs(found.surface([1.0], np.linspace(0.0, 3.0, 601))[:, 0, 1]).max()
    assert tip == pytest.approx(0.2337, abs=2e-3 + found.accuracy.error_estimate)  # by the reference, to 2 mm
    assert found.accuracy.error_estimate < 0.01
