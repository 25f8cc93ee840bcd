"""Motions of many steps with twist, of which not the frames of every step are kept."""

import numpy as np
import pytest

from benchmarks.hard.curves import arc
from dlocore import Cable, Grasp, Move, Points, Quality, Scene, predict
from dlocore.problem.problem import pose
from dlocore.solvers import march as marching
from dlocore.solvers.monitor import Monitor
from dlocore.statics.statics import start_grid

# yields where it is bent and turned, so that there is memory as well as frames
SCENE = Scene(
    cable=Cable(
        length=1.0, diameter=0.01, linear_density=0.1, bending_stiffness=1e-2, yield_strain=0.01, memory_rate=10.0
    ),
    shape=Points(points=arc(1.0, 1.5, "upright")),
    grasps=(
        Grasp(u=0.0, hold="clamp"),
        Grasp(u=1.0, hold="clamp", path=Move(displacement=(-0.2, 0.1, 0.1), duration=1.0, rotation=(2.0, 0.0, 0.0))),
    ),
    effects={"plasticity": "on"},
    horizon=1.5,
    quality=Quality(n_u=13, n_t=25, method="march", estimate=False),
)


@pytest.mark.parametrize("every", [2, 3])
def test_twist_and_memory_are_the_same_where_frames_of_few_steps_are_kept(every: int, monkeypatch: pytest.MonkeyPatch):
    whole = predict(SCENE)
    steps = whole.accuracy.steps
    monkeypatch.setattr(marching, "MOST_FRAMES", -(-13 * (steps + 1) // every))
    thinned = predict(SCENE)
    assert thinned.level is not None
    assert len(thinned.level.motion.log) < steps / every + 2
    u, t = np.linspace(0.0, 1.0, 21), np.linspace(0.0, 1.5, 33)
    np.testing.assert_array_equal(thinned.surface.positions(u, t), whole.surface.positions(u, t))
    twist = whole.surface.twist_rate(u, t)
    # the fit in time sees fewer of the states: what it misses of them, about 1e-3 of the largest
    np.testing.assert_allclose(thinned.surface.twist_rate(u, t), twist, rtol=0.0, atol=5e-3 * np.abs(twist).max())
    assert whole.material is not None
    assert thinned.material is not None
    np.testing.assert_allclose(thinned.material.memory[-1], whole.material.memory[-1], rtol=1e-12)
    np.testing.assert_allclose(thinned.material.director[-1], whole.material.director[-1], atol=1e-3)


@pytest.mark.parametrize("steps", [20, 23])
@pytest.mark.parametrize("kept", [1, 2, 5, 19, 20, 100])
def test_rows_of_a_thin_log_are_of_the_steps_that_it_says(steps: int, kept: int, monkeypatch: pytest.MonkeyPatch):
    problem = pose(SCENE)
    monitor = Monitor(None, None)
    grid = start_grid(problem, 13, monitor)
    full = marching.march(problem, grid, steps, monitor)
    monkeypatch.setattr(marching, "MOST_FRAMES", 13 * kept)
    thin = marching.march(problem, grid, steps, monitor)
    np.testing.assert_array_equal(thin.states, full.states)
    np.testing.assert_array_equal(thin.log, full.log[thin.logged])
    assert thin.logged[0] == 0
    assert thin.logged[-1] == len(thin.times) - 1
    np.testing.assert_array_equal(thin.behind(thin.times[thin.logged]).past, thin.frames)
