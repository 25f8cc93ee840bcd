"""Loads that jump, or last for less than a step: none is stepped over, and of its impulse nothing is lost."""

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from dlocore import (
    Cable,
    Environment,
    Grasp,
    Load,
    Move,
    Quality,
    Scene,
    SceneError,
    Straight,
    Table,
    equilibrium,
    predict,
)
from dlocore.problem.discretisation import applied_forces, applied_in_steps, make_grid
from dlocore.problem.problem import pose

HORIZON = 2.0
MASS = 0.1  # [kg], of a metre
NOWHERE = Environment(gravity=(0.0, 0.0, 0.0))
INSTANTS = np.sort(np.random.default_rng(4).uniform(0.1, 1.9, 40))
PUSHES = np.random.default_rng(5).normal(size=(40, 3))
PUSHES[[0, -1]] = 0.0


def bar(load: Load, **quality: Any) -> Scene:
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


@pytest.mark.parametrize("steps", [20, 21, 1000])
def test_the_impulse_of_a_load_that_jumps_is_kept(steps: int) -> None:
    instants = np.append(INSTANTS[:-1], 1.9)  # the last on a time of 20 steps
    pushes = np.random.default_rng(6).normal(size=(80, 3))
    pushes[[0, -1]] = 0.0
    jumps = Load(u=0.3, force=pushes, times=np.repeat(instants, 2))
    forces = stepped(jumps, np.linspace(0.0, HORIZON, steps + 1))
    expected = (np.diff(instants)[:, None] * 0.5 * (pushes[1:-1:2] + pushes[2::2])).sum(axis=0)
    np.testing.assert_allclose(HORIZON / steps * forces.sum(axis=0), expected, atol=1e-12)


def test_where_a_load_jumps_it_is_that_before_it_to_what_ends_there_and_that_after_it_to_what_begins() -> None:
    load = Load(u=0.3, force=[[1.0, 0, 0], [2.0, 0, 0], [5.0, 0, 0], [6.0, 0, 0]], times=[0.0, 1.0, 1.0, 2.0])
    times = np.array([0.5, 1.0, 1.5])
    np.testing.assert_allclose(load.at(times)[:, 0], [1.5, 5.0, 5.5], atol=1e-15)
    np.testing.assert_allclose(load.at(times[:2], 1.0)[:, 0], [1.5, 2.0], atol=1e-15)
    before, after = np.linspace(0.0, 1.0, 11), np.linspace(1.0, 2.0, 11)
    np.testing.assert_allclose(stepped(load, before, 0.0, 1.0)[:, 0], 1.0 + before, atol=1e-12)
    np.testing.assert_allclose(stepped(load, after, 1.0, 2.0)[:, 0], 4.0 + after, atol=1e-12)


@pytest.mark.parametrize("times", [[0.0, 2.0, 1.0], [1.0, 1.0, 1.0]], ids=["falling", "three are equal"])
def test_times_that_neither_rise_nor_are_a_jump_are_refused(times: list[float]) -> None:
    with pytest.raises(SceneError, match=r"^times: got .* Allowed: rising times \[s\], two equal ones where the force"):
        Load(u=0.3, force=np.zeros((3, 3)), times=times)


@pytest.mark.parametrize(("method", "error"), [("march", 1e-3), ("reference", 1e-7)])
def test_a_free_bar_that_is_pushed_at_once_goes_as_far_as_that_takes_it(method: str, error: float) -> None:
    force, begin, end = 0.05, 0.37, 1.21  # [N, s, s]
    push = Load(u=0.5, force=[[0, 0, 0], [0, force, 0], [0, force, 0], [0, 0, 0]], times=[begin, begin, end, end])
    found = predict(bar(push, target_error=1e-2, method=method))
    t = np.array([0.3, 1.0, HORIZON])
    went = 0.5 * force / MASS * (np.maximum(t - begin, 0.0) ** 2 - np.maximum(t - end, 0.0) ** 2)
    middle = np.trapezoid(found.surface(np.linspace(0.0, 1.0, 101), t)[:, :, 1], dx=0.01, axis=1)
    np.testing.assert_allclose(middle, went, atol=error)


@pytest.mark.parametrize("replaced", [0, 1])
def test_the_force_of_a_gripper_in_its_place_moves_the_cable_as_it_did(replaced: int) -> None:
    """It had been refused, as the times of a reaction are there twice where a grasp opens."""
    up, aside = (Move(displacement=way, duration=1.0) for way in ((0.05, 0.1, 0.1), (-0.2, 0.1, 0.1)))
    held = Scene(
        cable=Cable(length=1.0, diameter=0.006, linear_density=0.05, bending_stiffness=2e-3),
        shape=Straight(),
        grasps=[Grasp(u=0.0, path=up), Grasp(u=1.0, path=aside, release_time=0.6)],
        environment=Environment(drag=0.1),
        quality=Quality(target_error=2e-3),
    )
    own = predict(held)
    given = own.grasps[replaced]
    load = Load(u=given.u, force=given.reaction, times=given.times)
    pulled = predict(replace(held, grasps=[held.grasps[1 - replaced]], loads=[load]))
    assert (own.status, pulled.status) == ("converged", "converged")
    u, t = np.linspace(0.0, 1.0, 21), np.linspace(0.0, 1.0, 41)
    off = np.linalg.norm(own.surface.positions(u, t) - pulled.surface.positions(u, t), axis=-1).max()
    assert off < own.accuracy.error_estimate + pulled.accuracy.error_estimate


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


@pytest.mark.parametrize("friction", [None, 0.3], ids=["hanging", "on a rough table"])
@pytest.mark.parametrize("method", ["march", "reference"])
def test_a_start_settles_under_the_force_before_a_jump(method: str, friction: float | None) -> None:
    """It had settled under the force after it, and nothing moved."""
    tugged = Scene(
        cable=Cable(length=1.0, diameter=0.006, linear_density=0.05, bending_stiffness=2e-3),
        shape=Straight(direction=(0, 0, -1) if friction is None else (1, 0, 0), settle=True),
        grasps=[Grasp(u=0.0)],
        loads=[Load(u=1.0, force=[[0, 0, 0], [0, 0.2, 0]], times=[0.0, 0.0])],
        environment=Environment(table=None if friction is None else Table(friction=friction)),
        horizon=0.05,
        quality=Quality(method=method, target_error=1e-2),
    )
    given = replace(tugged, shape=replace(tugged.shape, settle=False))  # it lies at rest as it is
    settles, begins = (predict(scene).surface.positions([0.5, 1.0], [0.0, 0.05]) for scene in (tugged, given))
    np.testing.assert_allclose(settles, begins, atol=2e-3)  # of which its weight stretches it by 0.3 mm
    assert settles[1, 1, 1] > 0.05


def test_an_equilibrium_is_that_under_the_force_before_a_jump() -> None:
    before, then, after = [0.0, 0.0, 0.0], [0.0, 0.2, 0.0], [0.0, -0.1, 0.0]
    hanging = Scene(
        cable=Cable(length=1.0, diameter=0.006, linear_density=0.05, bending_stiffness=2e-3),
        shape=Straight(direction=(0, 0, -1)),
        grasps=[Grasp(u=0.0)],
        loads=[Load(u=1.0, force=[before, then, then, after], times=[0.0, 0.0, 0.5, 0.5])],
    )
    for at, force in ((0.0, before), (0.25, then), (0.5, then), (0.6, after)):
        found = equilibrium(hanging, at=at, n_u=17)
        expected = equilibrium(replace(hanging, loads=[Load(u=1.0, force=force)]), n_u=17)
        np.testing.assert_allclose(found.positions([1.0]), expected.positions([1.0]), atol=1e-6)
        np.testing.assert_allclose(found.reactions, expected.reactions, atol=1e-6)


@pytest.mark.parametrize("u", [0.0, 1.0])
@pytest.mark.parametrize("method", ["march", "spacetime", "paper", "reference"])
def test_what_a_load_jumps_to_as_the_motion_ends_is_nothing_to_it(method: str, u: float) -> None:
    pulled = Scene(
        cable=Cable(length=1.0, diameter=0.006, linear_density=0.05, bending_stiffness=2e-3, axial_stiffness=100.0),
        shape=Straight(direction=(0, 0, -1)),
        grasps=[Grasp(u=0.0, hold="tangent")],
        loads=[Load(u=u, force=[0, 0, -1])],
        horizon=0.3,
        quality=Quality(method=method, **({} if method == "reference" else {"n_u": 9, "n_t": 13, "keep_grid": True})),
    )
    jumps = replace(pulled, loads=[Load(u=u, force=[[0, 0, -1], [0, 0, 9]], times=[0.3, 0.3])])
    found, expected = predict(jumps), predict(pulled)
    assert found.status == expected.status
    np.testing.assert_allclose(found.surface.control_points, expected.surface.control_points, atol=1e-9)
    np.testing.assert_allclose(found.grasps[0].reaction, expected.grasps[0].reaction, atol=1e-6)
    np.testing.assert_allclose(found.stretch.strain, expected.stretch.strain, atol=1e-7)


def test_a_push_that_comes_as_the_motion_ends_buckles_nothing() -> None:
    pushed = bar(Load(u=0.0, force=[[0, 0, 0], [1e5, 0, 0]], times=[HORIZON, HORIZON]))
    assert pose(pushed).start.bow == 0.0
    earlier = replace(pushed, loads=[Load(u=0.0, force=[[0, 0, 0], [1e5, 0, 0]], times=[1.0, 1.0])])
    assert pose(earlier).start.bow > 0.0


def test_a_load_is_constant_before_its_times_and_after_them() -> None:
    load = Load(u=0.3, force=[[1.0, -2.0, 0.5], [-3.0, 1.0, 0.0]], times=[0.5, 1.0])
    expected = [load.force[0], load.force[0], [-1.0, -0.5, 0.25], load.force[1], load.force[1]]
    np.testing.assert_array_equal(load.at(np.array([0.0, 0.5, 0.75, 1.0, 2.0])), expected)


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
