"""Disturbances in mid-motion: what the judge learns of motions that have forgotten their start by then."""

import numpy as np
import pytest

from benchmarks.hard import curves
from benchmarks.hard.judge import WRONG, disturbed, disturbed_midway, is_undetermined
from dlocore import Cable, Environment, Grasp, Move, Points, Prediction, Quality, Scene, predict
from dlocore.problem.problem import pose
from dlocore.shape.shape import start_curve
from dlocore.solvers.march import march
from dlocore.solvers.monitor import Monitor
from dlocore.stability.determined import DISTURBED
from dlocore.statics.statics import start_grid


def pushed_through(drag: float) -> Scene:
    """Return an arch with clamped ends whose middle is pushed to the other side, where it snaps."""
    shape = Points(points=curves.arc(1.0, 1.5, "flat"))
    at = start_curve(shape, 1.0)([0.0, 0.5, 1.0])
    way = -1.6 * (at[1] - 0.5 * (at[0] + at[2]))
    path = Move(displacement=tuple(way), duration=4.0)
    grasps = (Grasp(u=0.0, hold="tangent"), Grasp(u=1.0, hold="tangent"), Grasp(u=0.5, path=path))
    cable = Cable(length=1.0, diameter=0.005, linear_density=0.05, bending_stiffness=1e-2)
    environment = Environment(gravity=(0.0, 0.0, 0.0), drag=drag)
    return Scene(cable=cable, shape=shape, grasps=grasps, environment=environment, quality=Quality(target_error=0.01))


@pytest.fixture(scope="module")
def snaps() -> Prediction:
    return predict(pushed_through(1.0))


def test_a_motion_that_forgets_its_start_may_be_sensitive_midway(snaps: Prediction):
    first, midway = disturbed(snaps, snaps.scene, 30.0), disturbed_midway(snaps, snaps.scene, 30.0)
    assert first is not None
    assert midway is not None
    assert first < 3 * DISTURBED  # it is the bend itself that is left, where it is largest
    assert midway > 20 * first


def test_one_that_is_heavily_damped_is_sensitive_at_no_time():
    scene = pushed_through(20.0)
    midway = disturbed_midway(predict(scene), scene, 30.0)
    assert midway is not None
    assert midway < 3 * DISTURBED


def test_no_time_tells_nothing(snaps: Prediction):
    assert disturbed_midway(snaps, snaps.scene, 0.0) is None


def test_a_scene_is_undetermined_by_either():
    assert is_undetermined({"disturbed": 1e-6, "midway": 1.1 * WRONG})
    assert is_undetermined({"disturbed": 1.1 * WRONG})
    assert not is_undetermined({"disturbed": 0.9 * WRONG, "midway": 0.9 * WRONG})
    assert not is_undetermined({"disturbed": None, "midway": None})


def test_a_knock_displaces_the_motion_from_its_time_on_and_none_does_not():
    problem, monitor = pose(pushed_through(1.0)), Monitor()
    grid = start_grid(problem, 25, monitor)
    none = np.zeros_like(grid.start)
    by = none.copy()
    by[8, :2] = 1e-4
    at = 0.5 * problem.horizon
    plain = march(problem, grid, 200, monitor)
    marked, knocked = (march(problem, grid, 200, monitor, knocks={at: x}) for x in (none, by))
    k = int(np.searchsorted(marked.times, at))
    assert marked.times[k] == at
    np.testing.assert_array_equal(knocked.states[:k], marked.states[:k])
    np.testing.assert_allclose(knocked.states[k] - marked.states[k], by, atol=1e-15)
    assert np.abs(knocked.states[k + 1 :] - marked.states[k + 1 :]).max() > 1e-6
    assert np.abs(marked.states[-1] - plain.states[-1]).max() < 1e-3
