"""Recorded paths, which tremble faster than coarse steps can see, and take a stiff cable along with them."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.hard.generator import draw
from dlocore import Cable, Environment, Grasp, Move, Quality, Scene, Straight, Table, Waypoints, predict
from dlocore.problem.problem import pose
from dlocore.problem.trembling import trembles
from dlocore.scene.scene import Method
from tests.solver.scenes import apart

LENGTH = 0.25
HORIZON = 2.0
SWING = 2.0 * LENGTH**0.5  # [s], shorter than the horizon
SIZE, PERIOD = 1e-3, 0.1  # [m], [s]


def led(path: Waypoints | Move, **grasp: float) -> Scene:
    cable = Cable(length=LENGTH, diameter=0.005, linear_density=0.04, bending_stiffness=1e-2)
    around = Environment(drag=0.1, table=Table())
    grasps = (Grasp(u=0.0, path=path, **grasp),)
    return Scene(cable=cable, shape=Straight(), grasps=grasps, environment=around, horizon=HORIZON)


def waved(size: float, until: float = HORIZON) -> Waypoints:
    """Return a path that moves to and fro across the cable, with waypoints so close that they follow it."""
    t = np.linspace(0.0, until, round(800 * until / HORIZON) + 1)
    return Waypoints(times=t, positions=np.column_stack([0 * t, size * np.sin(2.0 * np.pi * t / PERIOD), 0 * t]))


def expected(step: float) -> float:
    """Return what steps do not see of the speed of `waved`, r.m.s., while the cable swings."""
    return SIZE * 2.0 * np.pi / PERIOD / 2.0**0.5 * (1.0 - np.sinc(step / PERIOD)) * SWING


@pytest.mark.parametrize("step", [0.01, 0.03, 0.1])
def test_it_is_how_far_the_speed_that_steps_do_not_see_takes_a_cable(step: float):
    assert trembles(pose(led(waved(SIZE))), step) == pytest.approx(expected(step), rel=0.05)


def test_the_way_until_a_gripper_opens_counts_and_none_after():
    late = trembles(pose(led(waved(SIZE, 1.0), grasp_time=0.5)), 0.03)
    assert late == pytest.approx(expected(0.03), rel=0.1)
    still = [0.0, 0.0, 0.0]
    jolt = [still, still, still, [0.0, 1e-3, 0.0], still, still]
    calm = Waypoints(times=[0.0, 1.0, 1.5, 1.51, 1.52, 2.0], positions=jolt)
    assert trembles(pose(led(calm)), 0.03) > 1e-3 * SWING
    assert trembles(pose(led(calm, release_time=1.2)), 0.03) < 1e-2 * trembles(pose(led(calm)), 0.03)


def test_without_inertia_only_the_way_counts():
    assert trembles(pose(replace(led(waved(SIZE)), effects={"inertia": "off"})), 0.03) == 0.0


def test_a_smooth_path_is_seen_by_coarse_steps_however_close_its_waypoints_are():
    t = np.linspace(0.0, HORIZON, 401)
    y = 0.1 * (1.0 - np.cos(np.pi * t / HORIZON))
    smooth = led(Waypoints(times=t, positions=np.column_stack([0 * t, y, 0 * t])))
    assert trembles(pose(smooth), HORIZON / 40) < 1e-3 * LENGTH
    assert trembles(pose(led(Move(displacement=(0.0, 0.1, 0.0), duration=1.0))), HORIZON / 40) == 0.0


def test_scene_149_124_is_within_its_target():
    """A stiff rod on a noisy path: its first grids agreed to 2.8 mm, and all of them were 24 mm off."""
    scene = draw(149, 124).make()
    target = scene.quality.target_error
    found, fine = predict(scene), predict(replace(scene, quality=Quality(target_error=0.1 * target)))
    assert found.status == fine.status == "converged"
    assert apart(found.surface, fine.surface).max() < target
    assert found.level.unseen < found.accuracy.error_estimate < target
    assert found.accuracy.error_estimate == pytest.approx(sum(found.accuracy.error_parts.values()))


@pytest.mark.parametrize("method", ["march", "spacetime"])
def test_a_given_grid_tells_of_it_too(method: Method):
    """By the march its estimate was a quarter, by the least squares a third of what it errs."""
    scene = draw(149, 124).make()
    fine = predict(replace(scene, quality=Quality(target_error=1e-3)))
    given = predict(replace(scene, quality=Quality(n_u=9, n_t=13, method=method, keep_grid=True)))
    error = apart(given.surface, fine.surface).max()
    assert fine.status == given.status == "converged"
    assert given.accuracy.method == method
    assert 0.01 < error < given.accuracy.error_estimate < 3.0 * error
    assert given.accuracy.error_estimate == pytest.approx(sum(given.accuracy.error_parts.values()))
